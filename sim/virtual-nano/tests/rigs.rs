//! Rigs with other bridges and without encoders: what the real image does to their motors. Heat takes 3.5 s of a processor, the lines
//! 2 s, all others 2 s together.

use crate::common::{Host, MS, TICK};
use protocol::units::{CentiRpm, Duty, EncoderCounts};
use protocol::{Bridge, Command, Fault, Refusal, Reply, Settings, SpeedFrom, State};
use virtual_nano::bridge::Drive;
use virtual_nano::rig::RIGS;

/// Duties that a host tries, both senses: the lowest is where a motor may turn.
const DUTIES: [i16; 5] = [60, 100, 150, 200, 255];

/// Drives both motors in an open loop. Returns their mean speeds after 0.5 s, rpm.
fn speeds_at(host: &mut Host, duty: i16) -> [f64; 2] {
    host.order(Command::Drive { duty: [Duty(duty); 2], duration_ms: 800 });
    host.run_linked_ms(500);
    let begin = host.board.rig().motors.each_ref().map(|motor| motor.angle_rad());
    host.run_linked_ms(200);
    let end = host.board.rig().motors.each_ref().map(|motor| motor.angle_rad());
    host.order(Command::Stop);
    [0, 1].map(|motor| (end[motor] - begin[motor]) / 0.2 * 30.0 / std::f64::consts::PI)
}

#[test]
fn each_rig_has_the_line_of_its_bridge_and_its_motors() {
    println!("| rig | duty | motor 1, rpm | motor 2, rpm |");
    println!("| --- | ---: | ---: | ---: |");
    for rig in RIGS {
        let mut host = Host::of_rig(rig.name);
        let mut line = |sense: i16| {
            DUTIES.map(|duty| {
                let rpm = speeds_at(&mut host, sense * duty);
                println!("| {} | {} | {:.1} | {:.1} |", rig.name, sense * duty, rpm[0], rpm[1]);
                rpm
            })
        };
        let (forwards, backwards) = (line(1), line(-1));
        assert_eq!(host.fault(), Fault::None);
        let on_s = host.board.rig().supply.on_s;
        assert!((7.0..7.2).contains(&on_s), "ten drives of 0.7 s took {on_s} s of the battery");
        let has_line = |line: [[f64; 2]; 5], motor: usize, is_bent: bool| {
            // At a duty of 100, of the chord to full duty from the duty that friction takes.
            let friction = 255.0 * rig.motors[motor].dead_zone;
            let chord = line[4][motor].abs() * (100.0 - friction) / (255.0 - friction);
            let part = line[1][motor].abs() / chord;
            assert!(if is_bent { part > 1.4 } else { part < 1.1 }, "{}, motor {motor}: {part} of its chord", rig.name);
        };
        for motor in 0..2 {
            let sense = if rig.motors[motor].reversed { -1.0 } else { 1.0 };
            assert!(sense * forwards[4][motor] > 90.0 && sense * backwards[4][motor] < -90.0);
            has_line(forwards, motor, rig.name != "encoders");
            has_line(backwards, motor, rig.name == "duty");
        }
        let apart = forwards[4][0].abs() / forwards[4][1].abs() - 1.0;
        assert!(if rig.has_encoders { apart.abs() < 1e-6 } else { (0.01..0.20).contains(&apart) }, "{apart}");
    }
}

/// The duties of set-points, their signs from the speeds; nothing of encoders. The LED tells when a motor is on.
#[test]
fn duties_of_a_schedule_reach_motors_without_encoders_by_two_a_tick() {
    for name in ["duty", "duty-in-in"] {
        let mut host = Host::of_rig(name);
        host.schedule(&[
            (0, [0.0; 2], [99; 2]),
            (20, [50.0, -30.0], [120, 91]),
            (120, [-20.0, 0.0], [7, 0]),
            (240, [0.0; 2], [0; 2]),
        ]);
        let first = host.telemetry.len();
        let mut lit = [0, 0];
        for _ in 0..1400 {
            host.run_linked_ms(1);
            let bridge = host.board.rig().bridge;
            let is_on = bridge.drive.iter().any(|drive| *drive != Drive::Coast);
            assert_eq!(bridge.led, is_on, "{name}: {bridge:?}");
            lit[usize::from(is_on)] += 1;
        }
        let frames: Vec<_> = host.telemetry[first..].iter().map(|(_, frame)| *frame).collect();
        for pair in frames.windows(2).filter(|pair| pair[1].state == State::Running) {
            let steps = [0, 1].map(|motor| (pair[1].duty[motor].0 - pair[0].duty[motor].0).abs());
            assert!(steps.iter().all(|step| *step <= 2), "{name}: {steps:?}");
        }
        let is_at = |phase: u8, wanted: [i16; 2]| {
            frames.iter().position(|frame| frame.phase == phase && frame.duty == wanted.map(Duty))
        };
        let begun = frames.iter().position(|frame| frame.phase == 2).unwrap();
        assert_eq!(is_at(2, [120, -91]), Some(begun + 59), "{name}");
        assert_eq!(is_at(3, [-7, 0]), Some(begun + 100 + 63), "{name}");
        assert!(frames.iter().all(|frame| frame.speed == [CentiRpm::UNKNOWN; 2]));
        assert!(frames.iter().all(|frame| frame.encoder == frames[0].encoder && frame.glitches.0 == 0));
        assert_eq!((frames.last().unwrap().state, frames.last().unwrap().fault), (State::Idle, Fault::None));
        // 220 ticks, of which the motors pass through a duty of zero in one.
        assert!((1090..=1102).contains(&lit[1]), "{name}: lit for {} ms", lit[1]);
    }
}

#[test]
fn motors_without_encoders_are_asked_for_no_angles_and_no_speeds() {
    let mut host = Host::of_rig("duty");
    let turn = Command::TurnTo { position: [EncoderCounts(100); 2], speed: CentiRpm(1000) };
    for command in [turn, Command::Align, Command::SetSpeeds([CentiRpm(3000), CentiRpm(0)])] {
        assert_eq!(host.ask(command), Reply::Refused(Refusal::NoEncoders), "{command:?}");
    }
    host.order(Command::SetSpeeds([CentiRpm(0); 2]));
    assert!(!host.hello().angles_known);
}

/// Whatever ends a run turns motors and LED off: a stop, a silent host, a hang.
#[test]
fn motors_without_encoders_stop_as_those_with_them_do() {
    const RUN: &[(u32, [f64; 2], [u8; 2])] = &[(0, [50.0; 2], [150; 2]), (4000, [0.0; 2], [0; 2])];
    for name in ["duty", "duty-in-in"] {
        let mut host = Host::of_rig(name);
        let is_off = |host: &Host| {
            let bridge = host.board.rig().bridge;
            !bridge.led && bridge.pwm == [0, 0] && bridge.drive == [Drive::Coast; 2]
        };
        host.schedule(RUN);
        host.run_linked_ms(300);
        assert!(host.board.rig().bridge.led && host.board.rig().bridge.pwm != [0, 0]);
        host.order(Command::Stop);
        assert!(is_off(&host), "{name}: a stop");
        host.schedule(RUN);
        host.run_linked_ms(300);
        host.send(Command::Ping);
        let heard = host.run_until_heard();
        let deadline = u64::from(Settings::DEFAULT.deadline_ms) * MS;
        let late = (host.run_until_off(deadline + 10 * TICK) - heard).saturating_sub(deadline);
        host.run_ms(10);
        println!("{name}: link lost, {late} cycles past the deadline (a tick has {TICK})");
        assert!(late <= TICK && is_off(&host) && host.fault() == Fault::LinkLost, "{name}: {:?}", host.fault());
        host.order(Command::ClearFault);
        host.schedule(RUN);
        host.run_linked_ms(300);
        let begin = host.board.cycle();
        host.hang(false);
        let off = host.run_until_off(100 * MS) - begin;
        println!("{name}: hang, off after {:.1} ms", off as f64 / MS as f64);
        host.run_ms(5);
        assert!(off <= 69 * MS && is_off(&host), "{name}: hang");
    }
}

/// What a duty of 60 does through a bridge of the other kind. Forwards, PWM is high for 60 of 255; backwards too with the settings
/// of an enable, and for 195 with those of an input.
#[test]
fn a_bridge_of_the_other_kind_turns_the_motors_as_its_inputs_say() {
    let share = 60.0 / 255.0;
    for (name, bridge, forwards, backwards) in [
        ("in-in", Bridge::Enable, Some(share - 1.0), Some(share)),
        ("duty-in-in", Bridge::Enable, Some(share - 1.0), Some(share)),
        ("encoders", Bridge::InIn, None, Some(1.0 - share)),
        ("duty", Bridge::InIn, None, Some(1.0 - share)),
    ] {
        let mut host = Host::of_rig(name);
        let rig = host.board.rig().kind;
        host.order(Command::WriteSettings(Settings { bridge, ..rig.settings() }));
        for (duty, wanted) in [(60, forwards), (-60, backwards)] {
            host.order(Command::Drive { duty: [Duty(duty), Duty(0)], duration_ms: 400 });
            host.run_linked_ms(350);
            let drive = host.board.rig().bridge.drive[0];
            let given = match drive {
                Drive::Voltage(share) | Drive::Pulses { share, .. } => Some(share),
                Drive::Coast | Drive::Brake => None,
            };
            let rpm = host.board.rig().motors[0].speed_rpm;
            println!("{name} with {bridge:?}, {duty}: {drive:?}, {rpm:.1} rpm");
            assert!(given.zip(wanted).is_none_or(|(given, wanted)| (given - wanted).abs() < 1e-9), "{given:?}");
            assert_eq!(
                (given.is_some(), rpm > 1.0, rpm < -1.0),
                match wanted {
                    Some(share) => (true, share > 0.0, share < 0.0),
                    None => (false, false, false),
                }
            );
            host.run_linked_ms(100);
        }
    }
}

/// The guard of a motor without encoder takes it to turn at its target, 90 rpm at most. The battery of each rig is at its end.
#[test]
fn full_duty_at_the_speed_that_it_makes_is_no_overload() {
    for name in ["duty", "duty-in-in"] {
        let mut host = Host::of_rig(name);
        host.board.rig_mut().supply.on_s = 3600.0;
        let rpm = speeds_at(&mut host, 255).map(f64::abs);
        host.schedule(&[(0, rpm.map(|rpm| rpm.min(90.0)), [255; 2]), (6000, [0.0; 2], [0; 2])]);
        host.run_linked_ms(29_000);
        println!("{name}: {rpm:.1?} rpm at full duty for 29 s, {:?}", host.fault());
        assert_eq!((host.fault(), host.last().state), (Fault::None, State::Running), "{name}");
    }
}

/// A motor that stands is for the host to see: nothing tells the board.
#[test]
fn a_motor_without_encoder_that_stands_is_no_fault() {
    for fault in ["blocked=1", "slips=1", "motor-off=1"] {
        let mut host = Host::of_rig("duty");
        host.inject(fault);
        host.schedule(&[(0, [50.0, -50.0], [110, 110]), (800, [0.0; 2], [0; 2])]);
        host.run_linked_ms(3000);
        let rpm = host.board.rig().motors.each_ref().map(|motor| motor.speed_rpm);
        assert!(rpm[0] == 0.0 && rpm[1] > 40.0, "{fault}: {rpm:?}");
        assert_eq!((host.fault(), host.last().state), (Fault::None, State::Running), "{fault}");
    }
}

#[test]
fn a_rig_is_set_up_by_its_user() {
    for rig in RIGS {
        let mut host = Host::of_rig(rig.name);
        let Reply::Settings(settings) = host.ask(Command::ReadSettings) else { panic!() };
        let wanted = match rig.name {
            "encoders" => (Bridge::Enable, SpeedFrom::Encoders),
            "duty" => (Bridge::Enable, SpeedFrom::Duty),
            "in-in" => (Bridge::InIn, SpeedFrom::Encoders),
            _ => (Bridge::InIn, SpeedFrom::Duty),
        };
        assert_eq!((settings.bridge, settings.speed_from), wanted);
        assert_eq!((host.hello().settings_stored, host.hello().boot_count), (true, 2));
    }
}
