//! Motors without encoders: the board applies the duties of the set-points.

use super::*;
use protocol::{Bridge, SpeedFrom};

const BLIND: Settings = Settings { speed_from: SpeedFrom::Duty, ..Settings::DEFAULT };
/// A minute of a run.
const MINUTE: u32 = 12_000;

fn blind(bridge: Bridge) -> Bench {
    let mut bench = streaming();
    assert_eq!(bench.ask(Command::WriteSettings(Settings { bridge, ..BLIND })), Reply::Done);
    bench
}

/// Starts a schedule in the next tick: ticks, speeds in rpm and duties.
fn start(bench: &mut Bench, points: &[(u32, [i16; 2], [u8; 2])]) {
    for (index, (tick, rpm, duties)) in points.iter().enumerate() {
        let point = SetPoint { tick: *tick, speeds: rpm.map(|rpm| CentiRpm(100 * rpm)), duties: *duties, phase: 1 };
        assert_eq!(bench.ask(Command::SetPoint { index: index as u8, point }), Reply::Done);
    }
    let at = Micros(bench.now.wrapping_add(TICK_US / 2));
    assert_eq!(bench.ask(Command::StartSchedule { count: points.len() as u8, at }), Reply::Done);
}

/// Returns the seconds until a fault, and the fault, of a run at a speed (rpm) with a duty.
fn fault_of(rpm: i16, duty: u8, ticks: u32) -> (f64, Fault) {
    let mut bench = blind(Bridge::Enable);
    start(&mut bench, &[(0, [rpm, 0], [duty, 0]), (ticks, [0; 2], [0; 2])]);
    for tick in 0..ticks {
        bench.ticks_alive(1);
        let fault = bench.telemetry.last().unwrap().fault;
        if fault != Fault::None {
            return (f64::from(tick) * 0.005, fault);
        }
    }
    (f64::from(ticks) * 0.005, Fault::None)
}

#[test]
fn orders_of_angles_and_speeds_are_refused_without_encoders() {
    let mut bench = streaming();
    assert_eq!(bench.ask(Command::Align), Reply::Done);
    assert_eq!(bench.ask(Command::WriteSettings(BLIND)), Reply::Done);
    let known = |bench: &mut Bench| matches!(bench.ask(Command::Hello), Reply::Info(info) if info.angles_known);
    assert!(!known(&mut bench), "the positions are forgotten");
    let turn = Command::TurnTo { position: [EncoderCounts(9); 2], speed: CentiRpm(900) };
    for command in [Command::SetSpeeds([CentiRpm(0), CentiRpm(-1)]), turn, Command::Align] {
        assert_eq!(bench.ask(command), Reply::Refused(Refusal::NoEncoders), "{command:?}");
    }
    assert_eq!(bench.ask(Command::SetSpeeds(OFF)), Reply::Done);
    assert!(bench.world.is_off());
    // With encoders again, all of them are carried out.
    assert_eq!(bench.ask(Command::WriteSettings(Settings::DEFAULT)), Reply::Done);
    assert!(!known(&mut bench), "nobody has seen how the shafts turned");
    assert_eq!(bench.look().speed, OFF);
    for command in [Command::Align, Command::SetSpeeds(TURN)] {
        assert_eq!(bench.ask(command), Reply::Done, "{command:?}");
    }
}

#[test]
fn a_duty_changes_by_two_a_tick_through_zero_and_ends_at_once() {
    let mut bench = blind(Bridge::Enable);
    start(&mut bench, &[(0, [30, -60], [101, 255]), (150, [-90, -60], [10, 254]), (250, [0; 2], [99; 2])]);
    bench.speed = [7, -7];
    bench.ticks_alive(251);
    let frames = bench.telemetry.split_off(bench.telemetry.len() - 251);
    let duty = |frame: usize| frames[frame].duty.map(|duty| duty.0);
    assert_eq!([0, 1, 50, 127, 149].map(duty), [[2, -2], [4, -4], [101, -102], [101, -255], [101, -255]]);
    assert_eq!([150, 200, 205, 249].map(duty), [[99, -254], [-1, -254], [-10, -254], [-10, -254]]);
    assert_eq!((duty(250), frames[250].state), ([0, 0], State::Idle));
    assert!(bench.world.is_off());
    assert!(frames.iter().all(|frame| frame.speed == [CentiRpm::UNKNOWN; 2] && frame.fault == Fault::None));
    assert!(frames.iter().all(|frame| frame.encoder == [EncoderCounts(0); 2]), "whatever is at the pins of encoders");
}

/// PWM is at the first input, IN1 is the second, and IN2 stays low.
#[test]
fn a_bridge_without_enable_gets_its_duties_inverted_backwards() {
    let mut bench = blind(Bridge::InIn);
    start(&mut bench, &[(0, [30, -60], [100, 200]), (200, [0; 2], [0; 2])]);
    bench.ticks_alive(150);
    let outputs = |bench: &Bench| bench.world.change(|state| (state.pins, state.duty));
    assert_eq!(outputs(&bench), ([false, false, true, false, true], [100, 55]));
    bench.ticks_alive(60);
    assert!(bench.world.is_off(), "{:?}", outputs(&bench));
}

#[test]
fn motors_without_encoders_stop_when_the_host_falls_silent() {
    let mut bench = blind(Bridge::Enable);
    start(&mut bench, &[(0, [30, -60], [100, 200]), (4000, [0; 2], [0; 2])]);
    bench.ticks_alive(101);
    let silent = (0..200).find(|_| {
        bench.tick();
        bench.world.is_off()
    });
    // The last ping came a tick before these.
    let deadline = u32::from(BLIND.deadline_ms) * 1000 / TICK_US;
    assert!(silent.is_some_and(|ticks| (deadline - 2..=deadline).contains(&ticks)), "{silent:?}");
    assert_eq!((bench.look().fault, bench.look().speed), (Fault::LinkLost, [CentiRpm::UNKNOWN; 2]));
}

/// A weak supply needs much duty for a low speed. The host sees a motor that stands.
#[test]
fn no_duty_is_an_overload_where_nothing_measures_the_speed() {
    for (rpm, duty) in [(90, 255), (-90, 255), (40, 255), (10, 100)] {
        assert_eq!(fault_of(rpm, duty, MINUTE).1, Fault::None, "{rpm} rpm at a duty of {duty}");
    }
}

/// As the self-test of a host drives each motor, which sees no encoder.
#[test]
fn drives_of_motors_without_encoders_can_be_repeated() {
    let mut bench = blind(Bridge::InIn);
    for duty in (10..=250).step_by(20).chain([255; 8]).flat_map(|duty| [duty, -duty]) {
        let drive = Command::Drive { duty: [Duty(0), Duty(duty)], duration_ms: MAX_DRIVE_MS };
        assert_eq!(bench.ask(drive), Reply::Done);
        bench.ticks_alive(u32::from(MAX_DRIVE_MS) / 5 + 2);
        let frame = bench.look();
        assert_eq!((frame.state, frame.fault), (State::Idle, Fault::None), "{duty}");
    }
}
