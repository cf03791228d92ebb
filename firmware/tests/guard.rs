//! Two motors with their encoders on the application: what is a fault, when, and what is none.

#[allow(dead_code)]
mod robot;

use firmware::encoder::Motion;
use firmware::guard::Guard;
use protocol::units::{CentiRpm, Duty};
use protocol::{Command, Fault, Refusal, Reply, Settings, State};
use robot::{Bench, TICK_US};

const STEP_US: u32 = 50;

/// A count of the published encoder.
const COUNT: i32 = 510_113;

/// A geared motor whose flagellum moves in a liquid.
struct Motor {
    /// rpm at full voltage.
    free_rpm: f64,
    time_constant_s: f64,
    /// Fraction of full voltage that friction takes.
    friction: f64,
    /// Fraction of the speed without load that the liquid leaves.
    load: f64,
    /// Edges of channel 1.
    position: f64,
    rpm: f64,
    /// Channels 1 and 2 are swapped, or channel 2 is cut.
    swapped: bool,
    cut: bool,
    /// Both channels are cut.
    lost: bool,
}

impl Motor {
    fn new() -> Self {
        Self {
            free_rpm: 130.0,
            time_constant_s: 0.08,
            friction: 0.06,
            load: 1.0,
            position: 0.4,
            rpm: 0.0,
            swapped: false,
            cut: false,
            lost: false,
        }
    }

    fn advance(&mut self, duty: Duty) {
        let voltage = f64::from(duty.0) / 255.0;
        let driven = (voltage.abs() - self.friction).max(0.0) / (1.0 - self.friction);
        let goal = driven.copysign(voltage) * self.free_rpm * self.load;
        let step_s = f64::from(STEP_US) * 1e-6;
        self.rpm += (goal - self.rpm) * step_s / (self.time_constant_s * self.load);
        self.position += self.rpm / 60.0 * 602.22 * step_s;
    }

    fn channels(&self) -> (bool, bool) {
        // `rem_euclid` would take most of the tests' time.
        let is_high = |position: f64| position - 2.0 * (0.5 * position).floor() >= 1.0;
        let channels = (is_high(self.position), self.cut || is_high(self.position - 0.5));
        if self.lost {
            return (true, true);
        }
        if self.swapped { (channels.1, channels.0) } else { channels }
    }
}

/// Runs a tick with both motors.
fn tick(bench: &mut Bench, motors: &mut [Motor; 2]) {
    let duty = bench.world.change(|state| {
        [(0, 0), (1, 2)].map(|(motor, pin)| {
            let duty = state.duty[motor] as i16;
            Duty(if state.pins[pin + 1] { -duty } else { duty })
        })
    });
    for step in 1..=TICK_US / STEP_US {
        for ((motor, encoder), duty) in motors.iter_mut().zip(&mut bench.encoders).zip(duty) {
            motor.advance(duty);
            let (channel_1, channel_2) = motor.channels();
            if channel_1 != encoder.level {
                encoder.level = channel_1;
                let time = bench.now.wrapping_add(step * STEP_US - 1);
                encoder.filter.feed(channel_1, channel_2, robot::clock(time), || channel_2);
            }
        }
    }
    bench.tick();
}

/// Runs until a fault, for at most `seconds`. Returns the fault and when it came.
fn run(bench: &mut Bench, motors: &mut [Motor; 2], seconds: f64) -> (Fault, f64) {
    let begin = bench.now;
    loop {
        let elapsed = f64::from(bench.now.wrapping_sub(begin)) * 1e-6;
        let fault = bench.telemetry.last().map_or(Fault::None, |frame| frame.fault);
        if fault != Fault::None || elapsed >= seconds {
            bench.telemetry.drain(..bench.telemetry.len() - 1);
            assert_eq!(bench.world.is_off(), fault != Fault::None);
            return (fault, elapsed);
        }
        if (elapsed * 200.0).round() % 20.0 == 0.0 {
            bench.ask(Command::Ping);
        }
        tick(bench, motors);
    }
}

fn with(settings: Settings) -> Bench {
    let mut bench = Bench::new();
    assert_eq!(bench.ask(Command::Stream { rate_hz: 200 }), Reply::Done);
    assert_eq!(bench.ask(Command::WriteSettings(settings)), Reply::Done);
    bench
}

fn bench() -> Bench {
    with(Settings::DEFAULT)
}

fn order(bench: &mut Bench, rpm: [f64; 2]) {
    assert_eq!(bench.ask(Command::SetSpeeds(rpm.map(CentiRpm::from_rpm))), Reply::Done);
}

/// Both motors, the one at fault first or second.
fn pair(fault: Motor, second: bool) -> [Motor; 2] {
    if second { [Motor::new(), fault] } else { [fault, Motor::new()] }
}

#[test]
fn swapped_encoder_leads_are_a_runaway_within_300_ms() {
    for (second, fault) in [(false, Fault::Motor1Runaway), (true, Fault::Motor2Runaway)] {
        for rpm in [10.0, 20.0, -20.0, 90.0] {
            let mut bench = bench();
            order(&mut bench, [rpm; 2]);
            let mut motors = pair(Motor { swapped: true, ..Motor::new() }, second);
            let (found, after) = run(&mut bench, &mut motors, 2.0);
            assert_eq!(found, fault);
            assert!(rpm == 10.0 || after < 0.3, "{after} s at {rpm} rpm");
        }
    }
}

#[test]
fn a_dead_second_channel_is_found_within_half_a_second() {
    for (second, fault) in [(false, Fault::Encoder1Failed), (true, Fault::Encoder2Failed)] {
        for rpm in [20.0, -20.0, 60.0, -90.0] {
            let mut bench = bench();
            order(&mut bench, [rpm; 2]);
            let mut motors = pair(Motor { cut: true, ..Motor::new() }, second);
            let (found, after) = run(&mut bench, &mut motors, 2.0);
            assert!(found == fault && after < 0.5, "{found:?} after {after} s at {rpm} rpm");
        }
    }
}

/// Nothing tells a lost encoder from a blocked rotor.
#[test]
fn an_encoder_without_edges_is_found_before_its_motor_races() {
    for (second, fault) in [(false, Fault::Encoder1Failed), (true, Fault::Encoder2Failed)] {
        for rpm in [2.0, -5.0, 10.0, 50.0, -90.0] {
            for is_blocked in [false, true] {
                let mut bench = bench();
                order(&mut bench, [rpm; 2]);
                let mut motors = [(); 2].map(|()| Motor::new());
                assert_eq!(run(&mut bench, &mut motors, 3.0).0, Fault::None);
                let motor = &mut motors[usize::from(second)];
                (motor.lost, motor.load) = (!is_blocked, if is_blocked { 1e-9 } else { 1.0 });
                let (found, after) = run(&mut bench, &mut motors, 3.0);
                let fastest = motors[usize::from(second)].rpm.abs();
                let what = format!("{found:?} after {after} s at {rpm} rpm, {fastest} rpm in the end");
                assert!(found == fault && after < 1.5 && (rpm.abs() < 50.0 || after < 0.2), "{what}");
            }
        }
    }
}

#[test]
fn no_change_of_the_target_is_a_fault() {
    let gains = [(1.0, 5.0), (0.3, 1.0), (0.1, 0.5), (3.0, 5.0), (10.0, 20.0)];
    for (speed_kp, speed_ki) in gains {
        for (time_constant_s, load) in [(0.04, 1.0), (0.08, 1.0), (0.16, 1.0), (0.16, 0.7)] {
            let mut bench = with(Settings { speed_kp, speed_ki, ..Settings::DEFAULT });
            let mut motors = [(); 2].map(|()| Motor { time_constant_s, load, ..Motor::new() });
            for rpm in [90.0, -90.0, 90.0, 5.0, -5.0, 60.0, 5.0, 90.0, 20.0, -90.0, -5.0] {
                order(&mut bench, [rpm, f64::clamp(10.0 - rpm, -90.0, 90.0)]);
                let (fault, after) = run(&mut bench, &mut motors, 1.5);
                assert_eq!(
                    fault,
                    Fault::None,
                    "{after} s after {rpm} rpm, gains {speed_kp} {speed_ki}, {time_constant_s} s"
                );
            }
        }
    }
}

#[test]
fn a_motor_that_hardly_moves_at_a_duty_that_turns_it_is_stalled_in_a_second() {
    for (second, fault) in [(false, Fault::Motor1Stalled), (true, Fault::Motor2Stalled)] {
        // From none to a tenth of the target.
        for load in [1e-9, 0.01, 0.03] {
            for rpm in [20.0, -60.0, 90.0] {
                let mut bench = bench();
                order(&mut bench, [rpm; 2]);
                let mut motors = pair(Motor { load, ..Motor::new() }, second);
                let (found, after) = run(&mut bench, &mut motors, 5.0);
                let moves = bench.telemetry[0].time;
                assert_eq!(found, fault, "{load} {rpm} {moves:?}");
                // 5 duty steps a second for each rpm at least: the lag adds to them.
                let ramp = (100.0 - f64::abs(rpm)).max(0.0) / (5.0 * f64::abs(rpm));
                assert!(
                    after > 1.0 && after < ramp + 1.1,
                    "{after} s, at most {ramp} s of them below the duty that turns it"
                );
            }
        }
    }
}

#[test]
fn slow_targets_and_heavy_liquids_are_no_stall() {
    for rpm in [0.5, 2.0, 10.0] {
        for load in [1.0, 0.5, 0.2] {
            let mut bench = bench();
            let mut motors = [(); 2].map(|()| Motor { load, time_constant_s: 0.3, ..Motor::new() });
            order(&mut bench, [rpm, -rpm]);
            assert_eq!(run(&mut bench, &mut motors, 30.0).0, Fault::None, "{rpm} rpm, {load}");
            assert!((motors[0].rpm - rpm).abs() < 0.5, "{} of {rpm}", motors[0].rpm);
        }
    }
}

#[test]
fn a_motor_held_at_a_fraction_of_its_speed_is_overloaded_and_one_that_keeps_90_rpm_is_not() {
    for (load, from, to) in [(0.3, 4.0, 7.0), (0.4, 5.5, 9.0), (0.5, 9.0, 13.0)] {
        for (second, fault) in [(false, Fault::Motor1Overloaded), (true, Fault::Motor2Overloaded)] {
            let mut bench = bench();
            order(&mut bench, [90.0, 90.0]);
            let (found, after) = run(&mut bench, &mut pair(Motor { load, ..Motor::new() }, second), 20.0);
            assert!(found == fault && after > from && after < to, "{found:?} after {after} s at {load} of the speed");
        }
    }
    // The heaviest liquid in which full voltage still makes 90 rpm.
    let mut bench = bench();
    order(&mut bench, [90.0, -90.0]);
    let mut motors = [(); 2].map(|()| Motor { load: 90.5 / 130.0, ..Motor::new() });
    assert_eq!(run(&mut bench, &mut motors, 300.0).0, Fault::None);
    let duty = bench.telemetry[0].duty[0];
    assert!(duty > Duty(250) && (motors[0].rpm - 90.0).abs() < 0.5, "{duty:?}, {} rpm", motors[0].rpm);
}

/// The estimate of the current knows the published motor only, which has 130 rpm without load.
#[test]
fn a_free_motor_of_any_speed_is_not_overloaded() {
    for free_rpm in [130.0, 260.0, 320.0, 500.0] {
        for rpm in [[90.0, -2.0], [31.7, -61.3]] {
            let mut bench = bench();
            order(&mut bench, rpm);
            let mut motors = [(); 2].map(|()| Motor { free_rpm, ..Motor::new() });
            // Five times the time in which a winding cools.
            let (fault, after) = run(&mut bench, &mut motors, 100.0);
            assert_eq!(fault, Fault::None, "{free_rpm} rpm without load, {rpm:?} rpm, after {after} s");
        }
    }
}

#[test]
fn an_overloaded_motor_stays_hot_while_it_is_off() {
    let mut bench = bench();
    let mut motors = pair(Motor { load: 0.3, ..Motor::new() }, false);
    order(&mut bench, [90.0, 0.0]);
    let (_, first) = run(&mut bench, &mut motors, 20.0);
    assert_eq!(bench.ask(Command::ClearFault), Reply::Refused(Refusal::Faulted), "as hot as it may be");
    for _ in 0..1000 {
        tick(&mut bench, &mut motors);
    }
    assert_eq!(bench.ask(Command::ClearFault), Reply::Done);
    bench.look();
    order(&mut bench, [90.0, 0.0]);
    let (fault, again) = run(&mut bench, &mut motors, 20.0);
    assert!(fault == Fault::Motor1Overloaded && again < 0.5 * first, "{again} s after {first} s");
}

#[test]
fn drives_heat_the_winding_that_they_drive() {
    for (motor, fault) in [Fault::Motor1Overloaded, Fault::Motor2Overloaded].into_iter().enumerate() {
        let mut bench = bench();
        let mut motors = [(); 2].map(|()| Motor { load: 1e-9, ..Motor::new() });
        let mut duty = [Duty(0); 2];
        duty[motor] = Duty(-255);
        let drive = Command::Drive { duty, duration_ms: 2000 };
        assert_eq!(bench.ask(drive), Reply::Done);
        assert_eq!(run(&mut bench, &mut motors, 1.99).0, Fault::None);
        (0..4).for_each(|_| tick(&mut bench, &mut motors));
        assert_eq!(bench.ask(drive), Reply::Done);
        // 2.4 s at full voltage.
        let (found, after) = run(&mut bench, &mut motors, 2.0);
        assert!(found == fault && (0.3..0.6).contains(&after), "{found:?} after {after} s of the second drive");
    }
}

/// A drive tests the wiring, and takes a speed for one in the direction of its duty.
#[test]
fn a_free_motor_with_swapped_encoder_leads_is_not_overloaded_by_drives() {
    let mut guard = Guard::default();
    let motion = Motion { speed: CentiRpm(-8137), edges: 4, counts: -4, glitches: 0 };
    for _ in 0..2000 {
        assert_ne!(guard.check(Duty(190), CentiRpm(0), &motion, 100, COUNT)[0], Fault::Motor1Overloaded);
    }
}

#[test]
fn one_open_loop_drive_is_watched_for_noise_only() {
    let wrong = || Motor { swapped: true, ..Motor::new() };
    for motor in [wrong(), Motor { cut: true, ..Motor::new() }, Motor { load: 1e-9, ..Motor::new() }] {
        let mut bench = bench();
        let mut motors = pair(motor, false);
        let drive = Command::Drive { duty: [Duty(255), Duty(0)], duration_ms: 2000 };
        assert_eq!(bench.ask(drive), Reply::Done);
        for step in 0..390 {
            if step % 20 == 0 {
                bench.ask(Command::Ping);
            }
            tick(&mut bench, &mut motors);
            assert!(!bench.world.is_off());
        }
        assert_eq!(bench.look().state, State::Driving);
    }
}

#[test]
fn a_noisy_encoder_stops_the_motors_and_is_told_at_rest_too() {
    for (encoder, fault) in [Fault::Encoder1Noisy, Fault::Encoder2Noisy].into_iter().enumerate() {
        for command in [None, Some(Command::SetSpeeds([CentiRpm(3000); 2])), Some(DRIVE)] {
            let mut bench = bench();
            command.map(|command| bench.ask(command));
            bench.ticks(3);
            for count in 0..40 {
                let filter = &mut bench.encoders[encoder].filter;
                filter.feed(count % 2 == 0, false, robot::clock(bench.now + 10 * count), || false);
            }
            bench.tick();
            assert!(bench.world.is_off());
            let frame = bench.look();
            assert_eq!((frame.fault, frame.state), (fault, State::Faulted));
            bench.ticks(1);
            let glitches = bench.look().glitches.0;
            assert!((38..=40).contains(&glitches), "{glitches}");
        }
    }
}

#[test]
fn an_encoder_at_fault_loses_the_positions_and_a_stalled_motor_keeps_them() {
    let are_known = |bench: &mut Bench| {
        let Reply::Info(info) = bench.ask(Command::Hello) else { panic!() };
        info.angles_known
    };
    for second in [false, true] {
        for (motor, is_known) in
            [(Motor { cut: true, ..Motor::new() }, false), (Motor { load: 1e-9, ..Motor::new() }, true)]
        {
            let mut bench = bench();
            assert_eq!(bench.ask(Command::Align), Reply::Done);
            order(&mut bench, [61.7, -53.4]);
            let (fault, _) = run(&mut bench, &mut pair(motor, second), 5.0);
            assert_eq!((fault != Fault::None, are_known(&mut bench)), (true, is_known), "{fault:?}");
        }
        let mut bench = bench();
        assert_eq!(bench.ask(Command::Align), Reply::Done);
        let filter = &mut bench.encoders[usize::from(second)].filter;
        for count in 0..40 {
            filter.feed(count % 2 == 0, false, robot::clock(bench.now + 10 * count), || false);
        }
        assert!(are_known(&mut bench));
        bench.tick();
        assert!(!are_known(&mut bench), "a noisy encoder may have missed a motion");
    }
}

/// Returns the first tick, from 1, in which a motor with a duty of 50 and a target of 80 rpm is at fault, and the fault. A
/// tick is its speed in hundredths of rpm, its edges, and the change of its position.
fn first_fault(moving_duty: u8, ticks: impl IntoIterator<Item = (i16, u8, i8)>) -> Option<(usize, Fault)> {
    let mut guard = Guard::default();
    let faults = ticks.into_iter().map(|(speed, edges, counts)| {
        let motion = Motion { speed: CentiRpm(speed), edges, counts, glitches: 0 };
        guard.check(Duty(50), CentiRpm(8000), &motion, moving_duty, COUNT)[0]
    });
    faults.enumerate().find(|(_, fault)| *fault != Fault::None).map(|(index, fault)| (index + 1, fault))
}

#[test]
fn a_runaway_is_3_rpm_against_the_duty_for_150_ms_unless_it_loses_an_eighth() {
    let against = |speeds: [i16; 2]| first_fault(100, (0..60).map(|tick| (speeds[usize::from(tick >= 20)], 0, 0)));
    assert_eq!(against([-300, -300]), Some((30, Fault::Motor1Runaway)));
    assert_eq!(against([-299, -299]), None);
    assert_eq!(against([-2400, -2100]), Some((30, Fault::Motor1Runaway)), "an eighth");
    // The speed that is left is a new one.
    assert_eq!(against([-2400, -2099]), Some((60, Fault::Motor1Runaway)), "more than an eighth");
    assert_eq!(first_fault(100, (0..600).map(|tick| (-8000 + 40 * tick.min(200), 0, 0))), None, "braked");
}

#[test]
fn a_stall_is_a_second_of_less_than_a_quarter_of_the_target_beyond_that_of_more() {
    let ticks = |ticks, speed| std::iter::repeat_n((speed, 1, 1), ticks);
    assert_eq!(first_fault(50, ticks(300, 1999)), Some((201, Fault::Motor1Stalled)));
    assert_eq!(first_fault(50, ticks(300, 2000)), None);
    assert_eq!(first_fault(51, ticks(300, 0)), None, "below the duty that moves it");
    let ever_again = ticks(150, 0).chain(ticks(100, 8000)).chain(ticks(300, 0));
    assert_eq!(first_fault(50, ever_again), Some((401, Fault::Motor1Stalled)));
}

#[test]
fn sixteen_edges_that_cancel_each_other_are_a_failed_encoder_and_turning_round_is_not() {
    let edges = |from: usize, to: usize| (from..to).map(|edge| (4000, 1, if edge % 2 == 0 { 1 } else { -1 }));
    let forwards = |edges| std::iter::repeat_n((4000, 1, 1), edges);
    assert_eq!(first_fault(100, edges(0, 20)), Some((16, Fault::Encoder1Failed)));
    assert_eq!(first_fault(100, edges(0, 15).chain(forwards(2)).chain(edges(0, 15)).chain(forwards(80))), None);
    let (mut guard, still) = (Guard::default(), Motion::default());
    let mut check = |motion| guard.check(Duty(50), CentiRpm(8000), &motion, 100, COUNT)[0];
    assert_eq!(check(Motion { speed: CentiRpm(4000), edges: 16, ..still }), Fault::Encoder1Failed);
    assert_eq!(check(still), Fault::None, "a fault that was cleared does not come back by itself");
    // Back and forth by two edges.
    let round = (0..80).map(|edge| (4000, 1, if edge % 4 < 2 { 1 } else { -1 }));
    assert_eq!(first_fault(100, round), None);
}

#[test]
fn a_target_that_alternates_is_no_failed_encoder() {
    let mut bench = bench();
    let mut motors = [(); 2].map(|()| Motor::new());
    for step in 0..600 {
        let rpm = if step % 2 == 0 { 60.0 } else { -60.0 };
        order(&mut bench, [rpm; 2]);
        tick(&mut bench, &mut motors);
        assert_eq!(bench.look().fault, Fault::None, "tick {step}");
    }
}

const DRIVE: Command = Command::Drive { duty: [Duty(100); 2], duration_ms: 1000 };
