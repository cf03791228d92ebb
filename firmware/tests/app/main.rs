//! The application, seen from the host.

mod attitude;
mod bridge;
mod calibration;
mod duty;
mod link;
#[path = "../robot/mod.rs"]
mod robot;
mod trial;
mod unequal;

use embedded_hal::i2c::{ErrorKind, NoAcknowledgeSource};
use firmware::app::Start;
use firmware::link::{Link, Outbox};
use protocol::frame::{MAX_FRAME, encode};
use protocol::units::{
    AccelRange, AxisMap, CentiRpm, Count, Duty, EncoderCounts, GyroRange, Micros, Millivolts, SensorCounts,
};
use protocol::{
    Calibration, Command, Fault, FaultRecord, Info, MAX_DRIVE_MS, Message, Refusal, Reply, ResetCause, SetPoint,
    Settings, State, VERSION,
};
use robot::{Bench, TICK_US, World};

const OFF: [CentiRpm; 2] = [CentiRpm(0); 2];
const TURN: [CentiRpm; 2] = [CentiRpm(6000), CentiRpm(-3000)];
const NACK: ErrorKind = ErrorKind::NoAcknowledge(NoAcknowledgeSource::Address);

/// Returns a board that streams in every tick.
fn streaming() -> Bench {
    let mut bench = Bench::new();
    assert_eq!(bench.ask(Command::Stream { rate_hz: 200 }), Reply::Done);
    bench
}

fn running() -> Bench {
    let mut bench = streaming();
    assert_eq!(bench.ask(Command::SetSpeeds(TURN)), Reply::Done);
    bench.speed = [2, -1];
    bench.ticks(2);
    assert!(!bench.world.is_off());
    bench
}

#[test]
fn it_starts_with_the_motors_off_and_silent() {
    let mut bench = Bench::new();
    bench.ticks(50);
    assert!(bench.world.is_off());
    assert!(bench.telemetry.is_empty() && bench.replies.is_empty());
}

#[test]
fn the_handshake_identifies_the_board() {
    let mut bench = Bench::new();
    let Reply::Info(info) = bench.ask(Command::Hello) else { panic!() };
    assert_eq!((info.protocol, info.git_hash, info.git_dirty), (VERSION, [1, 2, 3, 4], true));
    assert_eq!(info.firmware.map(|part| part.to_string()).join("."), env!("CARGO_PKG_VERSION"));
    assert_eq!((info.imu_id, info.boot_count, info.settings_stored), (0x68, 1, false));
    assert_eq!(info.ram_left, 614);
    assert_eq!(info.reset_cause, ResetCause::Unknown);
}

#[test]
fn a_clone_and_a_missing_sensor_are_reported_in_the_handshake() {
    for (id, error) in [(0x70, None), (0, Some(NACK))] {
        let world = World::new();
        world.change(|state| {
            state.registers[0x75] = 0x70;
            state.bus_error = error;
        });
        let mut bench = Bench::start(world, Start::default());
        let Reply::Info(info) = bench.ask(Command::Hello) else { panic!() };
        assert_eq!(info.imu_id, id);
    }
}

#[test]
fn streams_have_the_requested_rate() {
    for rate_hz in [1, 2, 4, 5, 8, 10, 20, 25, 40, 50, 100, 200] {
        let mut bench = Bench::new();
        assert_eq!(bench.ask(Command::Stream { rate_hz }), Reply::Done);
        bench.ticks(400);
        assert_eq!(bench.telemetry.len(), 2 * usize::from(rate_hz));
        let gaps = bench.telemetry.windows(2).map(|pair| pair[1].time.since(pair[0].time));
        assert!(gaps.into_iter().all(|gap| gap == 1_000_000 / u32::from(rate_hz)));
        assert_eq!(bench.ask(Command::Stream { rate_hz: 0 }), Reply::Done);
        bench.ticks(400);
        assert_eq!(bench.telemetry.len(), 2 * usize::from(rate_hz));
    }
    for rate_hz in [3, 7, 150, 201, 255] {
        assert_eq!(Bench::new().ask(Command::Stream { rate_hz }), Reply::Refused(Refusal::OutOfRange));
    }
}

#[test]
fn frames_are_numbered_and_the_unsent_ones_counted() {
    let mut bench = streaming();
    bench.ticks(3);
    for _ in 0..5 {
        bench.tick_unsent(0);
    }
    bench.deliver();
    bench.ticks(2);
    let seq: Vec<_> = bench.telemetry.iter().map(|frame| frame.seq.0).collect();
    // The queue holds two frames; three did not fit.
    assert_eq!(seq, [0, 1, 2, 3, 4, 8, 9]);
    assert_eq!(bench.telemetry.last().unwrap().unsent, Count(3));
}

#[test]
fn telemetry_holds_the_readings_of_the_sensor_and_the_encoders() {
    let mut bench = streaming();
    bench.world.set_sample([100, -200, 16000], [7, -8, 9]);
    bench.speed = [3, 0];
    bench.ticks(20);
    let frame = bench.look();
    assert_eq!(frame.time, Micros(bench.now));
    assert_eq!(frame.accel, [100, -200, 16000].map(SensorCounts));
    assert_eq!(frame.gyro, [7, -8, 9].map(SensorCounts));
    assert!(frame.imu_fresh);
    assert_eq!(frame.encoder, [EncoderCounts(63), EncoderCounts(0)]);
    assert!((frame.speed[0].rpm() - 3.0 * 200.0 * 60.0 / 602.22).abs() < 0.05, "{:?}", frame.speed);
    assert_eq!((frame.speed[1], frame.state, frame.fault), (CentiRpm(0), State::Idle, Fault::None));
}

#[test]
fn speeds_are_controlled_in_both_directions() {
    let mut bench = running();
    let frame = bench.look();
    assert_eq!((frame.state, frame.target), (State::Running, TURN));
    assert!(frame.duty[0] > Duty(0) && frame.duty[1] < Duty(0));
    let duty = frame.duty.map(|duty| duty.0.unsigned_abs());
    bench.world.change(|state| {
        assert_eq!(state.pins, [true, false, false, true, true]);
        assert_eq!(state.duty, duty);
    });
    assert_eq!(bench.ask(Command::SetSpeeds([CentiRpm(100), CentiRpm(0)])), Reply::Done);
    bench.ticks(2);
    bench.world.change(|state| assert_eq!((state.pins[2], state.pins[3], state.duty[1]), (false, false, 0)));
    assert_eq!(bench.look().duty[1], Duty(0));
    assert_eq!(bench.ask(Command::Stop), Reply::Done);
    assert!(bench.world.is_off(), "at once, not with the next tick");
    let frame = bench.look();
    assert_eq!((frame.state, frame.target, frame.duty), (State::Idle, OFF, [Duty(0); 2]));
    assert_eq!(bench.ask(Command::SetSpeeds(TURN)), Reply::Done);
    bench.ticks(2);
    assert_eq!(bench.ask(Command::SetSpeeds(OFF)), Reply::Done);
    assert!(bench.world.is_off());
}

#[test]
fn reversed_motors_and_encoders_change_the_signs() {
    let mut bench = streaming();
    let settings = Settings { motor_reversed: [true, false], encoder_reversed: [false, true], ..Settings::DEFAULT };
    assert_eq!(bench.ask(Command::WriteSettings(settings)), Reply::Done);
    assert_eq!(bench.ask(Command::SetSpeeds([CentiRpm(3000), CentiRpm(3000)])), Reply::Done);
    bench.speed = [1, -1];
    bench.ticks(5);
    let frame = bench.look();
    assert!(frame.speed[0].0 > 0 && frame.speed[1].0 > 0 && frame.duty[0].0 > 0 && frame.duty[1].0 > 0);
    assert_eq!(frame.encoder, [EncoderCounts(6), EncoderCounts(6)]);
    bench.world.change(|state| assert_eq!(state.pins, [false, true, true, false, true]));
}

#[test]
fn speeds_outside_of_the_range_are_refused() {
    let mut bench = streaming();
    for speed in [9001, -9001, i16::MAX, i16::MIN] {
        let refused = Reply::Refused(Refusal::OutOfRange);
        assert_eq!(bench.ask(Command::SetSpeeds([CentiRpm(0), CentiRpm(speed)])), refused);
    }
    assert_eq!(bench.look().state, State::Idle);
    assert_eq!(bench.ask(Command::SetSpeeds([CentiRpm(9000), CentiRpm(-9000)])), Reply::Done);
}

#[test]
fn a_motor_at_full_duty_without_edges_is_a_stall() {
    for (motor, fault) in [Fault::Motor1Stalled, Fault::Motor2Stalled].into_iter().enumerate() {
        let mut bench = running();
        bench.ask(Command::SetSpeeds([CentiRpm(9000); 2]));
        bench.speed = [4; 2];
        bench.speed[motor] = 0;
        bench.ticks_alive(200);
        assert_eq!(bench.look().fault, Fault::None);
        bench.ticks_alive(200);
        let frame = bench.look();
        assert_eq!((frame.state, frame.fault), (State::Faulted, fault));
        assert!(bench.world.is_off());
        assert_eq!(bench.ask(Command::ClearFault), Reply::Done);
        assert_eq!(bench.look().state, State::Idle);
    }
}

#[test]
fn a_lost_sensor_stops_the_motors_and_cannot_be_cleared_until_it_is_back() {
    for (error, fault) in [(NACK, Fault::ImuSilent), (ErrorKind::Bus, Fault::ImuBusStuck)] {
        let mut bench = running();
        bench.world.change(|state| state.bus_error = Some(error));
        bench.ticks(39);
        let frame = *bench.telemetry.last().unwrap();
        assert_eq!((frame.fault, frame.imu_fresh, frame.imu_errors), (Fault::None, false, Count(39)));
        assert!(!bench.world.is_off());
        bench.ticks(1);
        assert!(bench.world.is_off());
        assert_eq!(bench.look().fault, fault);
        assert_eq!(bench.ask(Command::ClearFault), Reply::Refused(Refusal::Faulted));
        bench.world.change(|state| state.bus_error = None);
        bench.ticks(40);
        assert_eq!(bench.look().fault, fault, "it lasts until it is cleared");
        assert_eq!(bench.ask(Command::ClearFault), Reply::Done);
        let frame = bench.look();
        assert_eq!((frame.state, frame.imu_fresh), (State::Idle, true));
    }
}

#[test]
fn a_frozen_sensor_stops_the_motors() {
    let mut bench = running();
    bench.world.change(|state| state.alive = false);
    bench.ticks(25);
    assert!(bench.world.is_off());
    assert_eq!(bench.look().fault, Fault::ImuFrozen);
    assert_eq!(bench.ask(Command::ClearFault), Reply::Refused(Refusal::Faulted));
    bench.world.change(|state| state.alive = true);
    bench.ticks(40);
    assert_eq!(bench.ask(Command::ClearFault), Reply::Done);
}

#[test]
fn a_fault_ends_a_calibration() {
    let mut bench = streaming();
    bench.ask(Command::CalibrateGyro { duration_ms: 5000 });
    bench.world.change(|state| state.bus_error = Some(NACK));
    bench.ticks(45);
    assert_eq!(bench.look().state, State::Faulted);
    assert_eq!(bench.ask(Command::ReadCalibration), Reply::Calibration(Calibration::default()));
}

#[test]
fn a_hang_is_latched_and_reported_after_the_restart() {
    let mut bench = Bench::start(World::new(), Start { hang: Some(0x1234), ..Start::default() });
    assert!(bench.world.is_off());
    let Reply::Info(info) = bench.ask(Command::Hello) else { panic!() };
    assert_eq!(info.reset_cause, ResetCause::Hang);
    assert_eq!(bench.ask(Command::SetSpeeds(TURN)), Reply::Refused(Refusal::Faulted));
    bench.ask(Command::Stream { rate_hz: 200 });
    assert_eq!(bench.look().fault, Fault::Hang);
    assert_eq!(bench.ask(Command::ClearFault), Reply::Done);
    assert_eq!(bench.ask(Command::SetSpeeds(TURN)), Reply::Done);
}

#[test]
fn the_clock_may_wrap_while_the_motors_turn() {
    let mut bench = streaming();
    bench.now = u32::MAX - 50 * TICK_US;
    bench.ticks(1);
    bench.ask(Command::SetSpeeds(TURN));
    bench.speed = [2, -1];
    bench.ticks_alive(200);
    let frame = bench.look();
    assert_eq!(frame.fault, Fault::None);
    assert!((frame.speed[0].rpm() - 39.9).abs() < 0.1 && frame.time.0 < 2_000_000);
    bench.ticks(120);
    assert_eq!(bench.look().fault, Fault::LinkLost);
}

#[test]
fn a_low_supply_stops_the_motors_and_cannot_be_cleared_while_it_lasts() {
    let mut bench = running();
    bench.bandgap_counts = Some(225);
    assert_eq!(bench.look().supply, Millivolts(5006));
    // 4.28 V
    bench.bandgap_counts = Some(263);
    bench.ticks(2);
    assert!(bench.world.is_off());
    assert_eq!(bench.look().fault, Fault::SupplyLow);
    assert_eq!(bench.ask(Command::ClearFault), Reply::Refused(Refusal::Faulted));
    bench.bandgap_counts = Some(225);
    bench.tick();
    assert_eq!(bench.ask(Command::ClearFault), Reply::Done);
}

#[test]
fn the_fault_log_tells_what_happened_before_a_reset() {
    let mut bench = running();
    let speed = bench.look().speed;
    bench.ticks(200);
    assert_eq!(bench.look().fault, Fault::LinkLost);
    bench.ticks(30);
    let crash = Start { hang: Some(0x1234), ..Start::default() };
    let mut bench = Bench::start(bench.world, crash);
    bench.ticks(30);
    let mut entry = |index| match bench.ask(Command::ReadFault { index }) {
        Reply::FaultRecord(record) => record,
        other => panic!("{other:?}"),
    };
    let (hang, lost) = (entry(0), entry(1));
    assert_eq!((hang.boot, hang.fault, hang.program_counter), (2, Fault::Hang, 0x1234));
    assert_eq!((lost.boot, lost.fault, lost.program_counter), (1, Fault::LinkLost, 0));
    assert_eq!(lost.speed.map(|speed| speed.0.signum()), speed.map(|speed| speed.0.signum()));
    assert!(lost.duty[0].0 > 0 && lost.duty[1].0 < 0 && lost.time.0 > 500_000, "{lost:?}");
    assert_eq!(entry(2), FaultRecord::default());
    assert_eq!(bench.ask(Command::ReadFault { index: 8 }), Reply::Refused(Refusal::OutOfRange));
}

#[test]
fn a_fault_is_being_logged_until_its_record_is_complete() {
    let mut bench = running();
    assert!(!bench.app.is_logging());
    while bench.app.is_driven() {
        bench.tick();
    }
    let fault = |bench: &mut Bench| match bench.ask(Command::ReadFault { index: 0 }) {
        Reply::FaultRecord(record) => record.fault,
        other => panic!("{other:?}"),
    };
    let mut ticks = 0;
    while bench.app.is_logging() {
        assert_eq!(fault(&mut bench), Fault::None, "after {ticks} ticks");
        bench.tick();
        ticks += 1;
    }
    assert!((10..100).contains(&ticks), "{ticks}");
    assert_eq!(fault(&mut bench), Fault::LinkLost);
}

#[test]
fn a_reading_at_the_end_of_its_range_is_counted() {
    let mut bench = streaming();
    bench.ticks(5);
    let before = bench.look().clipped.0;
    bench.world.set_sample([0, 0, 16384], [i16::MIN, 0, 0]);
    bench.ticks(7);
    bench.world.set_sample([0, i16::MAX, 16384], [5, 0, 0]);
    bench.ticks(3);
    bench.world.set_sample([0, i16::MAX - 1, 16384], [5, 0, 0]);
    assert_eq!(bench.look().clipped.0 - before, 10);
}

#[test]
fn a_start_that_cut_a_run_off_refuses_the_motors_until_the_fault_is_cleared() {
    let mut bench = Bench::start(World::new(), Start { cut_off: true, ..Start::default() });
    let speeds = Command::SetSpeeds([CentiRpm(6130), CentiRpm(-3780)]);
    assert_eq!(bench.ask(speeds), Reply::Refused(Refusal::Faulted));
    assert_eq!(bench.ask(Command::ClearFault), Reply::Done);
    assert_eq!(bench.ask(speeds), Reply::Done);
}
