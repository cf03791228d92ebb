//! The application, seen from the host.

mod robot;

use embedded_hal::i2c::{ErrorKind, NoAcknowledgeSource};
use firmware::app::Start;
use firmware::fault::Crash;
use firmware::link::{Link, Outbox};
use protocol::frame::{MAX_FRAME, encode};
use protocol::units::{AxisMap, CentiRpm, Count, Duty, EncoderCounts, GyroRange, Micros, Millivolts, SensorCounts};
use protocol::{
    Calibration, Command, Fault, FaultRecord, MAX_DRIVE_MS, Refusal, Reply, ResetCause, SetPoint, Settings, State,
    VERSION,
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
    bench.speed = [3, -1];
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
fn the_attitude_follows_a_turn_and_the_axes_of_the_settings() {
    let mut bench = streaming();
    // The sensor hangs upside down and turns at -90°/s about its z axis, that is, +90°/s about the body's.
    let flipped = AxisMap(["+x", "-y", "-z"].map(|name| protocol::units::Axis::from_name(name).unwrap()));
    let settings = Settings { gyro_axes: flipped, accel_axes: flipped, ..Settings::DEFAULT };
    bench.world.set_sample([0, 0, -16384], [0, 0, -11790]);
    assert_eq!(bench.ask(Command::WriteSettings(settings)), Reply::Done);
    let start = bench.look();
    bench.ticks(199);
    let [w, x, y, z] = bench.look().attitude.to_f64();
    let yaw = 2.0 * z.atan2(w).to_degrees();
    assert_eq!(start.attitude.to_f64()[0].round(), 1.0);
    assert!((yaw - 90.0).abs() < 0.2 && x.abs() < 1e-3 && y.abs() < 1e-3, "{yaw}");
}

#[test]
fn missed_ticks_are_counted_and_made_up_for_in_the_attitude() {
    let mut bench = streaming();
    bench.ticks(10);
    bench.world.set_sample([0, 0, 16384], [0, 0, 11790]);
    for _ in 0..20 {
        bench.tick_after(4);
    }
    let frame = bench.look();
    assert_eq!(frame.missed_ticks, Count(80));
    let [w, .., z] = frame.attitude.to_f64();
    assert!((2.0 * z.atan2(w).to_degrees() - 45.0).abs() < 1.0);
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
fn silence_of_the_host_stops_the_motors_at_the_deadline_and_latches() {
    let mut bench = running();
    let heard = bench.now;
    bench.ask(Command::Ping);
    while !bench.world.is_off() {
        assert!(bench.now - heard < 510_000);
        bench.tick();
    }
    let silence = bench.now + 2500 - (heard + 100);
    assert!((500_000..505_000).contains(&silence), "{silence}");
    let frame = bench.look();
    assert_eq!((frame.state, frame.fault, frame.target), (State::Faulted, Fault::LinkLost, OFF));
    assert_eq!(bench.ask(Command::SetSpeeds(TURN)), Reply::Refused(Refusal::Faulted));
    assert_eq!(bench.ask(Command::ClearFault), Reply::Done);
    assert_eq!(bench.look().state, State::Idle);
    assert_eq!(bench.ask(Command::SetSpeeds(TURN)), Reply::Done);
}

#[test]
fn any_intact_frame_feeds_the_deadline_and_a_damaged_one_does_not() {
    let mut foreign = [0; MAX_FRAME];
    let foreign = encode(&[200u8; 9], &mut foreign).unwrap().to_vec();
    let mut damaged = foreign.clone();
    damaged[4] ^= 1;
    for (frame, fault, bad_frames) in [(foreign, Fault::None, 0), (damaged, Fault::LinkLost, 12)] {
        let mut bench = running();
        for _ in 0..12 {
            bench.send_bytes(&frame);
            bench.ticks(20);
        }
        let telemetry = bench.look();
        assert_eq!((telemetry.fault, telemetry.bad_frames), (fault, Count(bad_frames)));
    }
}

#[test]
fn a_silent_host_is_no_fault_while_the_motors_are_off() {
    let mut bench = streaming();
    bench.ticks(2000);
    assert_eq!(bench.look().fault, Fault::None);
}

#[test]
fn the_deadline_is_that_of_the_settings() {
    let mut bench = streaming();
    bench.ask(Command::WriteSettings(Settings { deadline_ms: 100, ..Settings::DEFAULT }));
    bench.ask(Command::SetSpeeds(TURN));
    bench.speed = [3, -1];
    bench.ticks(19);
    assert!(!bench.world.is_off());
    bench.ticks(2);
    assert!(bench.world.is_off());
}

#[test]
fn a_repeated_request_is_answered_again_and_not_carried_out_again() {
    let mut bench = streaming();
    assert_eq!(bench.send(7, Command::SetSpeeds(TURN)), [Reply::Done]);
    bench.ask(Command::Stop);
    assert_eq!(bench.send(9, Command::SetSpeeds(TURN)), [Reply::Done]);
    // The board has stopped meanwhile; the repetition must not start it.
    bench.ticks(200);
    assert_eq!(bench.look().fault, Fault::LinkLost);
    assert_eq!(bench.send(9, Command::SetSpeeds(TURN)), [Reply::Done]);
    assert!(bench.world.is_off());
    // Refusals and times are repeated unchanged.
    assert_eq!(bench.send(10, Command::SetSpeeds(TURN)), [Reply::Refused(Refusal::Faulted)]);
    bench.send(11, Command::ClearFault);
    let first = bench.send(12, Command::Ping);
    bench.ticks(3);
    assert_eq!(bench.send(12, Command::Ping), first);
    // Settings are read again.
    assert_eq!(bench.send(13, Command::ReadSettings), [Reply::Settings(Settings::DEFAULT)]);
    assert_eq!(bench.send(13, Command::ReadSettings), [Reply::Settings(Settings::DEFAULT)]);
    // A new host starts with the number with which the one before ended.
    bench.send(14, Command::Stop);
    assert!(matches!(bench.send(14, Command::Hello)[..], [Reply::Info(_)]));
}

#[test]
fn a_pong_tells_when_the_ping_came() {
    let mut bench = Bench::new();
    assert_eq!(bench.ask(Command::Ping), Reply::Pong(Micros(bench.now + 100)));
}

#[test]
fn noise_before_and_between_frames_is_counted_and_ignored() {
    let mut bench = streaming();
    bench.send_bytes(&[1, 2, 3, 0]);
    bench.send_bytes(&[0, 0]);
    bench.send_bytes(&[9; 200]);
    bench.send_bytes(&[0]);
    assert!(matches!(bench.ask(Command::Hello), Reply::Info(_)));
    assert_eq!(bench.look().bad_frames, Count(2));
}

#[test]
fn a_calibration_finds_the_bias_and_applies_it() {
    let mut bench = streaming();
    bench.world.set_sample([0, 0, 16384], [120, -35, 7]);
    assert_eq!(bench.ask(Command::CalibrateGyro { duration_ms: 1000 }), Reply::Done);
    assert_eq!(bench.look().state, State::Calibrating);
    for command in [Command::CalibrateGyro { duration_ms: 1000 }, Command::ReadCalibration, Command::SetSpeeds(TURN)] {
        assert_eq!(bench.ask(command), Reply::Refused(Refusal::Calibrating));
    }
    assert_eq!(bench.ask(Command::WriteSettings(Settings::DEFAULT)), Reply::Refused(Refusal::Calibrating));
    bench.ticks(200);
    assert_eq!(bench.look().state, State::Idle);
    let expected = Calibration { still: true, bias: [120.0, -35.0, 7.0], noise: 0, samples: 200 };
    assert_eq!(bench.ask(Command::ReadCalibration), Reply::Calibration(expected));
    let Reply::Settings(settings) = bench.ask(Command::ReadSettings) else { panic!() };
    assert_eq!(settings.gyro_bias, expected.bias);
    let yaw = bench.look().attitude.0[3];
    bench.ticks(400);
    assert_eq!(bench.look().attitude.0[3], yaw, "a bias that is known does not turn the robot");
}

#[test]
fn a_disturbed_calibration_changes_nothing() {
    let mut bench = streaming();
    bench.ask(Command::CalibrateGyro { duration_ms: 500 });
    for tick in 0..100 {
        bench.world.set_sample([0, 0, 16384], [(tick % 10) * 100, 0, 0]);
        bench.tick();
    }
    let Reply::Calibration(calibration) = bench.ask(Command::ReadCalibration) else { panic!() };
    assert!(!calibration.still && calibration.noise > 200);
    assert_eq!(bench.ask(Command::ReadSettings), Reply::Settings(Settings::DEFAULT));
}

#[test]
fn calibrations_at_the_wrong_time_are_refused() {
    let mut bench = running();
    assert_eq!(bench.ask(Command::CalibrateGyro { duration_ms: 1000 }), Reply::Refused(Refusal::Running));
    for duration_ms in [0, 99, 60_001] {
        assert_eq!(bench.ask(Command::CalibrateGyro { duration_ms }), Reply::Refused(Refusal::OutOfRange));
    }
}

#[test]
fn settings_are_applied_but_not_while_the_motors_turn() {
    let mut bench = running();
    assert_eq!(bench.ask(Command::WriteSettings(Settings::DEFAULT)), Reply::Refused(Refusal::Running));
    bench.ask(Command::Stop);
    let unfit = Settings { low_pass: 7, ..Settings::DEFAULT };
    assert_eq!(bench.ask(Command::WriteSettings(unfit)), Reply::Refused(Refusal::OutOfRange));
    let settings = Settings { board_id: 4711, gyro_range: GyroRange::Dps1000, low_pass: 5, ..Settings::DEFAULT };
    assert_eq!(bench.ask(Command::WriteSettings(settings)), Reply::Done);
    assert_eq!(bench.ask(Command::ReadSettings), Reply::Settings(settings));
    bench.ticks(40);
    bench.world.change(|state| {
        assert_eq!((state.registers[0x1B], state.registers[0x1A], state.registers[0x19]), (0b1_0000, 5, 4));
    });
    let Reply::Info(info) = bench.ask(Command::Hello) else { panic!() };
    assert_eq!((info.board_id, info.gyro_range), (4711, GyroRange::Dps1000));
}

#[test]
fn saved_settings_survive_a_reset_and_others_do_not() {
    let mut bench = Bench::new();
    let settings = Settings { board_id: 5, deadline_ms: 750, ..Settings::DEFAULT };
    bench.ask(Command::WriteSettings(settings));
    assert_eq!(bench.send(50, Command::SaveSettings), [], "the answer comes when it is done");
    assert_eq!(bench.send(50, Command::SaveSettings), []);
    let before = bench.replies.len();
    bench.ticks(100);
    assert_eq!(bench.replies[before..], [(50, Reply::Done)]);
    assert_eq!(bench.send(50, Command::SaveSettings), [Reply::Done]);
    let Reply::Info(info) = bench.ask(Command::Hello) else { panic!() };
    assert!(info.settings_stored);
    bench.ask(Command::WriteSettings(Settings { board_id: 6, ..settings }));
    let mut bench = Bench::start(bench.world, Start::default());
    assert_eq!(bench.ask(Command::ReadSettings), Reply::Settings(settings));
    let Reply::Info(info) = bench.ask(Command::Hello) else { panic!() };
    assert_eq!((info.settings_stored, info.boot_count, info.board_id), (true, 2, 5));
    // Reading the EEPROM does not count as hearing the host.
    bench.ask(Command::Stream { rate_hz: 200 });
    assert_eq!(bench.look().bad_frames, Count(0));
}

#[test]
fn other_requests_are_answered_during_a_save() {
    let mut bench = running();
    assert_eq!(bench.send(50, Command::SaveSettings), []);
    bench.ticks(10);
    assert_eq!(bench.send(51, Command::Stop), [Reply::Done]);
    let before = bench.replies.len();
    bench.ticks(100);
    assert_eq!(bench.replies[before..], [(50, Reply::Done)]);
    assert_eq!(bench.send(51, Command::Stop), [Reply::Done]);
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
fn a_crash_is_latched_and_reported_after_the_restart() {
    for (crash, fault, cause) in
        [(Crash::Hang, Fault::Hang, ResetCause::Hang), (Crash::Panic, Fault::Panic, ResetCause::Panic)]
    {
        let mut bench = Bench::start(World::new(), Start { crash: Some(crash), ..Start::default() });
        assert!(bench.world.is_off());
        let Reply::Info(info) = bench.ask(Command::Hello) else { panic!() };
        assert_eq!(info.reset_cause, cause);
        assert_eq!(bench.ask(Command::SetSpeeds(TURN)), Reply::Refused(Refusal::Faulted));
        bench.ask(Command::Stream { rate_hz: 200 });
        assert_eq!(bench.look().fault, fault);
        assert_eq!(bench.ask(Command::ClearFault), Reply::Done);
        assert_eq!(bench.ask(Command::SetSpeeds(TURN)), Reply::Done);
    }
}

#[test]
fn the_clock_may_wrap_while_the_motors_turn() {
    let mut bench = streaming();
    bench.now = u32::MAX - 50 * TICK_US;
    bench.ticks(1);
    bench.ask(Command::SetSpeeds(TURN));
    bench.speed = [3, -1];
    bench.ticks_alive(200);
    let frame = bench.look();
    assert_eq!(frame.fault, Fault::None);
    assert!((frame.speed[0].rpm() - 59.8).abs() < 0.1 && frame.time.0 < 2_000_000);
    bench.ticks(120);
    assert_eq!(bench.look().fault, Fault::LinkLost);
}

/// Sends set-points of preroll, run, reversal, decay and end, 40 ticks each, and starts them 20 ticks from now.
fn start_trial(bench: &mut Bench) {
    let reversed = TURN.map(|speed| CentiRpm(-speed.0));
    let points = [(0, OFF, 1), (40, TURN, 2), (80, reversed, 2), (120, OFF, 3), (160, OFF, 4)];
    for (index, (tick, speeds, phase)) in points.into_iter().enumerate() {
        let point = SetPoint { tick, speeds, phase };
        assert_eq!(bench.ask(Command::SetPoint { index: index as u8, point }), Reply::Done);
    }
    let at = Micros(bench.now.wrapping_add(20 * TICK_US - TICK_US / 2));
    assert_eq!(bench.ask(Command::StartSchedule { count: 5, at }), Reply::Done);
}

/// Runs ticks with a ping before each; returns the tick, phase and target of each frame whose phase or target is new.
fn changes(bench: &mut Bench, ticks: u32) -> Vec<(u32, u8, [CentiRpm; 2])> {
    let mut changes: Vec<(u32, u8, [CentiRpm; 2])> = vec![];
    for tick in 1..=ticks {
        bench.ask(Command::Ping);
        let frame = bench.look();
        let now = (frame.phase, frame.target);
        if changes.last().is_none_or(|(_, phase, target)| (*phase, *target) != now) {
            changes.push((tick, now.0, now.1));
        }
    }
    changes
}

#[test]
fn a_trial_runs_by_the_boards_ticks_and_ends_by_itself() {
    let mut bench = streaming();
    start_trial(&mut bench);
    bench.speed = [0, 0];
    let reversed = TURN.map(|speed| CentiRpm(-speed.0));
    let expected = [(1, 0, OFF), (20, 1, OFF), (60, 2, TURN), (100, 2, reversed), (140, 3, OFF), (180, 4, OFF)];
    assert_eq!(changes(&mut bench, 200), expected);
    assert!(bench.world.is_off());
    assert_eq!(bench.look().state, State::Idle);
    // A stop, and a new speed, end what is reported of the schedule.
    assert_eq!(bench.ask(Command::Stop), Reply::Done);
    assert_eq!(bench.look().phase, 0);
}

#[test]
fn a_silent_host_ends_a_trial_before_its_motors_start_and_not_after_they_stopped() {
    let mut bench = streaming();
    start_trial(&mut bench);
    bench.ticks(110);
    assert_eq!(bench.look().fault, Fault::LinkLost);
    bench.ticks(200);
    assert!(bench.world.is_off());

    let mut bench = streaming();
    start_trial(&mut bench);
    changes(&mut bench, 145);
    bench.ticks(300);
    assert_eq!((bench.look().fault, bench.look().phase), (Fault::None, 4));
}

#[test]
fn a_trial_excludes_other_orders_for_the_motors() {
    let mut bench = streaming();
    start_trial(&mut bench);
    let running = Reply::Refused(Refusal::Running);
    let point = SetPoint { tick: 0, speeds: OFF, phase: 1 };
    for command in [
        Command::SetSpeeds(TURN),
        Command::SetPoint { index: 0, point },
        Command::StartSchedule { count: 1, at: Micros(bench.now) },
        Command::Drive { duty: [Duty(50); 2], duration_ms: 100 },
        Command::CalibrateGyro { duration_ms: 100 },
        Command::WriteSettings(Settings::DEFAULT),
    ] {
        assert_eq!(bench.ask(command), running, "{command:?}");
    }
    assert_eq!(bench.ask(Command::Stop), Reply::Done);
    assert_eq!(bench.ask(Command::SetSpeeds(TURN)), Reply::Done);
}

#[test]
fn a_fault_ends_a_trial() {
    let mut bench = streaming();
    start_trial(&mut bench);
    changes(&mut bench, 70);
    bench.world.change(|state| state.bus_error = Some(NACK));
    changes(&mut bench, 40);
    assert_eq!(bench.look().fault, Fault::ImuSilent);
    bench.world.change(|state| state.bus_error = None);
    changes(&mut bench, 100);
    assert_eq!(bench.ask(Command::ClearFault), Reply::Done);
    changes(&mut bench, 100);
    assert!(bench.world.is_off() && bench.look().phase == 0);
}

#[test]
fn an_open_loop_drive_ends_by_itself_and_needs_the_host() {
    let mut bench = streaming();
    let drive = |duration_ms| Command::Drive { duty: [Duty(60), Duty(-255)], duration_ms };
    assert_eq!(bench.ask(drive(100)), Reply::Done);
    assert_eq!(bench.world.change(|state| state.duty), [60, 255]);
    let frame = bench.look();
    assert_eq!((frame.state, frame.duty), (State::Driving, [Duty(60), Duty(-255)]));
    let ticks = (1..100).find(|_| {
        bench.tick();
        bench.world.is_off()
    });
    assert_eq!(ticks, Some(20));
    assert_eq!(bench.look().state, State::Idle);

    for (duty, duration_ms) in [(Duty(256), 100), (Duty(i16::MIN), 100), (Duty(9), 0), (Duty(9), MAX_DRIVE_MS + 1)] {
        let command = Command::Drive { duty: [Duty(0), duty], duration_ms };
        assert_eq!(bench.ask(command), Reply::Refused(Refusal::OutOfRange));
    }

    assert_eq!(bench.ask(drive(MAX_DRIVE_MS)), Reply::Done);
    bench.ticks(105);
    assert!(bench.world.is_off());
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
    let crash = Start { crash: Some(Crash::Hang), program_counter: 0x1234, ..Start::default() };
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
fn a_reading_at_the_end_of_its_range_is_counted() {
    let mut bench = streaming();
    bench.ticks(5);
    let before = bench.look().clipped.0;
    bench.world.set_sample([0, 0, 16384], [i16::MIN, 0, 0]);
    bench.ticks(7);
    bench.world.set_sample([0, i16::MAX, 16384], [0, 0, 0]);
    bench.ticks(3);
    bench.world.set_sample([0, i16::MAX - 1, 16384], [0, 0, 0]);
    assert_eq!(bench.look().clipped.0 - before, 10);
}

#[test]
fn a_request_without_room_for_its_answer_is_dropped_and_feeds_the_deadline() {
    let mut bench = running();
    // The line takes nothing: the outbox fills with telemetry.
    for _ in 0..3 {
        bench.tick_unsent(0);
    }
    bench.receive(200, Command::Ping);
    for seq in 0..120 {
        bench.receive(seq, Command::SetSpeeds([CentiRpm(0), CentiRpm(100)]));
        bench.tick_unsent(0);
    }
    bench.deliver();
    let frame = bench.look();
    assert_eq!((frame.fault, frame.target), (Fault::None, TURN), "dropped requests have no effect");
}

/// An outbox with room for so many bytes.
struct Room(u8);

impl Outbox for Room {
    fn room(&self) -> u8 {
        self.0
    }

    fn add(&mut self, _: &[u8]) {}
}

/// The lengths are those of the answers' frames, with the longest of a group for all of them.
#[test]
fn a_request_needs_room_for_its_answer() {
    let link = Link::new();
    for (command, length) in [
        (Command::Hello, 29),
        (Command::ReadSettings, 60),
        (Command::ReadCalibration, 29),
        (Command::ReadFault { index: 0 }, 29),
        (Command::Ping, 11),
        (Command::Stop, 11),
    ] {
        assert!(link.has_room(&command, &Room(length)) && !link.has_room(&command, &Room(length - 1)), "{command:?}");
    }
}

#[test]
fn the_host_is_silent_after_the_deadline_and_not_at_it() {
    let mut link = Link::new();
    let mut frame = [0; MAX_FRAME];
    for byte in encode(&[200u8; 9], &mut frame).unwrap() {
        link.receive(*byte, Micros(u32::MAX - 99));
    }
    let after = |us: u32| link.is_silent(Micros((u32::MAX - 99).wrapping_add(us)), 50_000);
    assert_eq!([0, 50_000, 50_001, 2_000_000_000].map(after), [false, false, true, true]);
}
