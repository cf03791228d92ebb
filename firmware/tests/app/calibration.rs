//! Calibration of the gyroscope, and settings.

use super::*;

#[test]
fn a_calibration_finds_the_bias_and_applies_it() {
    let mut bench = streaming();
    bench.world.set_sample([0, 0, 16384], [120, -35, 7]);
    assert_eq!(bench.ask(Command::CalibrateGyro { duration_ms: 1000 }), Reply::Done);
    assert_eq!(bench.look().state, State::Calibrating);
    let turn = Command::TurnTo { position: [EncoderCounts(-700), EncoderCounts(451)], speed: CentiRpm(965) };
    let again = Command::CalibrateGyro { duration_ms: 1000 };
    for command in [again, Command::ReadCalibration, Command::SetSpeeds(TURN), turn] {
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
        assert_eq!((state.registers[0x1B], state.registers[0x1A], state.registers[0x19]), (0b1_0000, 5, 0));
    });
    let Reply::Info(info) = bench.ask(Command::Hello) else { panic!() };
    assert_eq!((info.board_id, info.gyro_range), (4711, GyroRange::Dps1000));
}

#[test]
fn saved_settings_survive_a_reset_and_others_do_not() {
    let mut bench = Bench::new();
    let ranges = Settings { gyro_range: GyroRange::Dps1000, accel_range: AccelRange::G8, ..Settings::DEFAULT };
    let settings = Settings { board_id: 5, deadline_ms: 750, low_pass: 4, ..ranges };
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
    bench.world.change(|state| state.registers[0x1A..0x1D].fill(0));
    let mut bench = Bench::start(bench.world, Start::default());
    assert_eq!(bench.ask(Command::ReadSettings), Reply::Settings(settings));
    bench.world.change(|state| assert_eq!(state.registers[0x1A..0x1D], [4, 0b1_0000, 0b1_0000]));
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
