//! Angles of the shafts: two motors keep the phase of their targets, and turn to positions.

use crate::common::{Host, MS};
use protocol::units::{CentiRpm, EncoderCounts};
use protocol::{Command, Fault, State};
use virtual_nano::BoardOptions;
use virtual_nano::motor::{COUNTS_PER_TURN, MotorParameters, Rotor};

/// Of the published motor on 6 V.
const NO_LOAD_RPM: f64 = 130.0;

/// Motors, supply and encoders of a case.
struct Rig {
    name: &'static str,
    supply_v: f64,
    /// Of motors 1 and 2: fraction of the speed without load that the liquid leaves, friction in parts of the full voltage, time
    /// constant.
    motors: [(f64, f64, f64); 2],
    uneven_poles: bool,
}

const RIGS: [Rig; 4] = [
    Rig { name: "6 V, equal motors", supply_v: 6.0, motors: [(1.0, 0.06, 0.08); 2], uneven_poles: false },
    Rig {
        name: "6 V, unequal motors and loads",
        supply_v: 6.0,
        motors: [(0.95, 0.05, 0.06), (0.88, 0.13, 0.12)],
        uneven_poles: false,
    },
    Rig {
        name: "6.5 V, the same, poles 20 % uneven",
        supply_v: 6.5,
        motors: [(0.88, 0.13, 0.12), (0.95, 0.05, 0.06)],
        uneven_poles: true,
    },
    Rig {
        name: "5.5 V, heavy loads",
        supply_v: 5.5,
        motors: [(0.93, 0.12, 0.07), (0.91, 0.08, 0.10)],
        uneven_poles: false,
    },
];

impl Rig {
    fn ready(&self) -> Host {
        let mut host = Host::ready(BoardOptions::default());
        for (motor, (load, dead_zone, time_constant_s)) in host.board.rig_mut().motors.iter_mut().zip(self.motors) {
            let no_load_rpm = NO_LOAD_RPM * self.supply_v / 6.0 * load;
            let breakaway = 1.5 * dead_zone;
            motor.parameters =
                MotorParameters { no_load_rpm, dead_zone, breakaway, time_constant_s, ..MotorParameters::PUBLISHED };
        }
        if self.uneven_poles {
            host.inject("uneven-poles=20,1");
            host.inject("uneven-poles=20,2");
        }
        host
    }
}

/// Angles of both shafts, degrees.
fn angles_deg(host: &Host) -> [f64; 2] {
    host.board.rig().motors.each_ref().map(|motor| motor.counts / COUNTS_PER_TURN * 360.0)
}

/// Returns the time at which the motors start, s.
fn start(host: &mut Host, rpm: [f64; 2]) -> f64 {
    host.send(Command::SetSpeeds(rpm.map(CentiRpm::from_rpm)));
    while host.board.rig().bridge.pwm == [0, 0] {
        host.run_until(host.board.cycle() + MS / 50);
    }
    host.board.seconds()
}

/// How far the shafts are ahead of their targets since `start`, degrees.
fn ahead_deg(host: &Host, start: (f64, [f64; 2]), rpm: [f64; 2]) -> [f64; 2] {
    let seconds = host.board.seconds() - start.0;
    let angles = angles_deg(host);
    [0, 1].map(|k| angles[k] - start.1[k] - 6.0 * rpm[k] * seconds)
}

/// Whether every case is run, and for as long as a trial: `PHASES_WHOLE=1`, as in `make hostile`.
fn whole() -> bool {
    std::env::var_os("PHASES_WHOLE").is_some()
}

/// `PHASES_WHOLE=1 cargo test --release -p virtual-nano --test all phase -- --nocapture` prints the table. By default each pair of
/// speeds has one of the rigs, and the pair with the largest errors all of them.
#[test]
fn the_phase_of_two_motors_does_not_leave_that_of_their_targets() {
    println!("| motors | rpm | error of the phase after 2 s, rms | at worst |");
    println!("| --- | --- | ---: | ---: |");
    let (mut worst_rms, mut worst): (f64, f64) = (0.0, 0.0);
    for (i, rig) in RIGS.iter().enumerate() {
        for (k, rpm) in [[-60.0, 60.0], [90.0, 90.0], [30.0, 30.0], [60.0, 20.0], [50.0, 10.0]].into_iter().enumerate()
        {
            if k > 0 && i != k - 1 && !whole() {
                continue;
            }
            let mut host = rig.ready();
            let angles = angles_deg(&host);
            let begin = (start(&mut host, rpm), angles);
            host.run_linked_ms(2000);
            let (mut squares, mut most, mut count) = (0.0, 0.0f64, 0);
            for _ in 0..800 {
                host.run_linked_ms(10);
                let [one, two] = ahead_deg(&host, begin, rpm);
                squares += (one - two).powi(2);
                most = most.max((one - two).abs());
                count += 1;
            }
            assert_eq!(host.fault(), Fault::None, "{} at {rpm:?} rpm", rig.name);
            let rms = (squares / f64::from(count)).sqrt();
            println!("| {} | {}, {} | {rms:.2}° | {most:.2}° |", rig.name, rpm[0], rpm[1]);
            (worst_rms, worst) = (worst_rms.max(rms), worst.max(most));
        }
    }
    assert!(worst_rms < 2.0 && worst < 5.0, "{worst_rms} {worst}");
}

#[test]
fn the_mean_speed_is_exact() {
    let seconds = if whole() { 120 } else { 40 };
    for (rig, rpm) in [(&RIGS[1], [10.0, -37.3]), (&RIGS[2], [90.0, 2.0])] {
        let mut host = rig.ready();
        let angles = angles_deg(&host);
        let begin = (start(&mut host, rpm), angles);
        host.run_linked_ms(1000 * seconds);
        let ahead = ahead_deg(&host, begin, rpm);
        let errors = [0, 1].map(|k| ahead[k] / (6.0 * rpm[k] * seconds as f64));
        println!(
            "| {} | {}, {} rpm for {seconds} s | {:.1e}, {:.1e} |",
            rig.name, rpm[0], rpm[1], errors[0], errors[1]
        );
        // At 2 rpm, 1e-4 are half a count of the encoder.
        for (k, error) in errors.into_iter().enumerate() {
            assert!(error.abs() < 1e-4 || ahead[k].abs() < 0.3, "{errors:?}, {ahead:?}°");
        }
    }
}

/// Blocked for less than the time that is a fault, a motor goes on with a third of a turn less at most. At 5 rpm its duty is
/// below the one that moves it for as long.
#[test]
fn a_motor_that_was_held_does_not_run_away_to_catch_up() {
    for (rpm, held_ms) in [(60.0, 90), (-20.0, 150), (5.0, 700)] {
        let mut host = Host::ready(BoardOptions::default());
        host.set_speeds([rpm, rpm]);
        host.run_linked_ms(3000);
        host.board.rig_mut().motors[0].hold(Rotor::Blocked);
        host.run_linked_ms(held_ms);
        host.board.rig_mut().motors[0].hold(Rotor::Free);
        let (mut fastest, mut gained_deg, mut most_deg): (f64, f64, f64) = (0.0, 0.0, 0.0);
        for _ in 0..4000 {
            host.run_linked_ms(1);
            let speed = host.board.rig().motors[0].speed_rpm / rpm.signum();
            fastest = fastest.max(speed);
            gained_deg += (speed - rpm.abs()) * 6e-3;
            most_deg = most_deg.max(gained_deg);
        }
        println!("| held for {held_ms} ms at {rpm} rpm | {fastest:.0} rpm at most, {most_deg:.0}° made up | 150° |");
        assert_eq!(host.fault(), Fault::None);
        assert!(most_deg < 150.0, "{most_deg}°");
        assert!((host.board.rig().motors[0].speed_rpm - rpm).abs() < 0.5);
    }
}

/// Turns to a position, and waits until the board says that it is there. Returns the seconds.
fn turn_to(host: &mut Host, position: [i32; 2], rpm: f64) -> f64 {
    let begin_s = host.board.seconds();
    host.order(Command::TurnTo { position: position.map(EncoderCounts), speed: CentiRpm::from_rpm(rpm) });
    host.run_linked_ms(10);
    while host.last().state == State::Running {
        host.run_linked_ms(10);
        assert!(host.board.seconds() - begin_s < 40.0, "never there: {:?}", host.last().encoder);
    }
    host.board.seconds() - begin_s
}

#[test]
fn shafts_turn_to_their_positions_and_stay() {
    let step = if whole() { 1 } else { 2 };
    for rig in RIGS.iter().step_by(step) {
        let mut host = rig.ready();
        host.order(Command::Align);
        for position in [[151, -301], [150, -290], [-452, 17], [-452, 16]] {
            let seconds = turn_to(&mut host, position, 10.0);
            let told = host.last().encoder.map(|counts| counts.0);
            let angles = host.board.rig().motors.each_ref().map(|motor| motor.counts / 2.0);
            println!("| {} | to {position:?} | {told:?} after {seconds:.1} s |", rig.name);
            for k in 0..2 {
                assert!((told[k] - position[k]).abs() <= 2, "{told:?} for {position:?}");
                // A count is a place between two edges of the encoder.
                assert!((angles[k] - f64::from(told[k])).abs() <= 1.3, "{angles:?} {told:?}");
            }
            assert_eq!((host.fault(), host.board.rig().bridge.pwm), (Fault::None, [0, 0]));
        }
        // Blocked on its way.
        host.inject("blocked=1");
        host.send(Command::TurnTo { position: [EncoderCounts(500); 2], speed: CentiRpm(1000) });
        host.run_linked_ms(3000);
        assert_eq!((host.fault(), host.board.rig().bridge.pwm), (Fault::Motor1Stalled, [0, 0]));
    }
}
