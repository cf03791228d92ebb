//! One sample of every message for the golden file, and strategies that make any of them.

use proptest::prelude::*;
use protocol::frame::{MAX_FRAME, encode};
use protocol::units::*;
use protocol::*;

/// Every message once, by its name in the documentation, as a frame.
pub fn samples() -> Vec<(&'static str, Vec<u8>)> {
    let settings = Settings { board_id: 0x1234, gyro_bias: [-595.5, 6.25, 147.0], ..Settings::DEFAULT };
    let calibration = Calibration { still: true, bias: [-595.5, 6.25, 147.0], noise: 17, samples: 1000 };
    let record = FaultRecord {
        boot: 300,
        time: Micros(0xDEAD_BEEF),
        fault: Fault::Motor2Runaway,
        duty: [Duty(100), Duty(-255)],
        speed: [CentiRpm(4987), CentiRpm(-8999)],
        program_counter: 0x1234,
    };
    let info = Info {
        protocol: VERSION,
        schema: SCHEMA,
        firmware: [1, 2, 3],
        git_hash: [0xde, 0xad, 0xbe, 0xef],
        git_dirty: true,
        board_id: 0x1234,
        imu_id: GENUINE_IMU_ID,
        gyro_range: GyroRange::Dps500,
        accel_range: AccelRange::G8,
        settings_stored: true,
        reset_cause: ResetCause::External,
        boot_count: 300,
        angles_known: true,
        encoder: [EncoderCounts(-1), EncoderCounts(602)],
        ram_left: 614,
    };
    let telemetry = Telemetry {
        seq: Count(513),
        time: Micros(0xDEAD_BEEF),
        attitude: Quaternion::from_f64([0.5, -0.5, 0.5, -0.5]),
        gyro: [SensorCounts(-1), SensorCounts(i16::MIN), SensorCounts(i16::MAX)],
        accel: [SensorCounts(1), SensorCounts(-2), SensorCounts(16384)],
        temperature: TemperatureCounts(-4000),
        target: [CentiRpm(5000), CentiRpm(-9000)],
        speed: [CentiRpm(4987), CentiRpm(-8999)],
        duty: [Duty(100), Duty(-255)],
        encoder: [EncoderCounts(i32::MIN), EncoderCounts(1_000_000)],
        state: State::Faulted,
        fault: Fault::ImuFrozen,
        phase: 7,
        supply: Millivolts(4987),
        imu_fresh: true,
        unsent: Count(1),
        imu_errors: Count(2),
        clipped: Count(5),
        glitches: Count(6),
        bad_frames: Count(3),
        missed_ticks: Count(4),
    };
    let commands = [
        ("Command::Hello", Command::Hello),
        ("Command::SetSpeeds", Command::SetSpeeds([CentiRpm(5000), CentiRpm(-9000)])),
        ("Command::Stop", Command::Stop),
        ("Command::Stream", Command::Stream { rate_hz: TICK_HZ }),
        ("Command::CalibrateGyro", Command::CalibrateGyro { duration_ms: 5000 }),
        ("Command::ReadCalibration", Command::ReadCalibration),
        ("Command::ReadSettings", Command::ReadSettings),
        ("Command::WriteSettings", Command::WriteSettings(settings)),
        ("Command::SaveSettings", Command::SaveSettings),
        ("Command::Ping", Command::Ping),
        ("Command::ClearFault", Command::ClearFault),
        (
            "Command::SetPoint",
            Command::SetPoint {
                index: 7,
                point: SetPoint {
                    tick: 24_000,
                    speeds: [CentiRpm(5000), CentiRpm(-9000)],
                    duties: [98, 190],
                    phase: 2,
                },
            },
        ),
        ("Command::StartSchedule", Command::StartSchedule { count: 4, at: Micros(123_456_789) }),
        ("Command::Drive", Command::Drive { duty: [Duty(60), Duty(-60)], duration_ms: 1000 }),
        ("Command::ReadFault", Command::ReadFault { index: 7 }),
        (
            "Command::TurnTo",
            Command::TurnTo { position: [EncoderCounts(-301), EncoderCounts(90_333)], speed: MAX_TURN_SPEED },
        ),
        ("Command::Align", Command::Align),
        ("Command::ReadNote", Command::ReadNote { index: 36 }),
        ("Command::WriteNote", Command::WriteNote { index: 39, byte: 0xA5 }),
    ];
    let replies = [
        ("Reply::Info", Reply::Info(info)),
        ("Reply::Done", Reply::Done),
        ("Reply::Refused", Reply::Refused(Refusal::Faulted)),
        ("Reply::Settings", Reply::Settings(settings)),
        ("Reply::Calibration", Reply::Calibration(calibration)),
        ("Reply::Pong", Reply::Pong(Micros(123_456_789))),
        ("Reply::FaultRecord", Reply::FaultRecord(record)),
    ];
    commands
        .map(|(name, command)| (name, frame(&Request { seq: 200, command })))
        .into_iter()
        .chain(replies.map(|(name, reply)| (name, frame(&Message::Reply { to: 200, reply }))))
        .chain([("Telemetry", frame(&Message::Telemetry(telemetry)))])
        .collect()
}

fn frame<T: serde::Serialize>(message: &T) -> Vec<u8> {
    encode(message, &mut [0; MAX_FRAME]).unwrap().to_vec()
}

fn counts() -> impl Strategy<Value = Count> {
    any::<u16>().prop_map(Count)
}

fn readings() -> impl Strategy<Value = [SensorCounts; 3]> {
    any::<[i16; 3]>().prop_map(|xyz| xyz.map(SensorCounts))
}

fn speeds() -> impl Strategy<Value = [CentiRpm; 2]> {
    any::<[i16; 2]>().prop_map(|both| both.map(CentiRpm))
}

fn axes() -> impl Strategy<Value = AxisMap> {
    proptest::array::uniform3((0usize..6).prop_map(|i| Axis::NAMES[i].0)).prop_map(AxisMap)
}

fn duties() -> impl Strategy<Value = [Duty; 2]> {
    any::<[i16; 2]>().prop_map(|both| both.map(Duty))
}

fn one_of<T: Clone + std::fmt::Debug + 'static>(values: &'static [T]) -> impl Strategy<Value = T> {
    proptest::sample::select(values)
}

prop_compose! {
    fn any_settings()(
        board_id in any::<u16>(),
        gyro_range in one_of(&GyroRange::ALL),
        accel_range in one_of(&AccelRange::ALL),
        low_pass in any::<u8>(),
        (gyro_axes, accel_axes) in (axes(), axes()),
        gyro_bias in any::<[f32; 3]>(),
        gains in proptest::array::uniform5(proptest::num::f32::NORMAL),
        motor_reversed in any::<[bool; 2]>(),
        encoder_reversed in any::<[bool; 2]>(),
        deadline_ms in any::<u16>(),
        moving_duty in any::<[u8; 2]>(),
        bandgap in any::<u16>().prop_map(Millivolts),
        bridge in one_of(&[Bridge::Enable, Bridge::InIn]),
        speed_from in one_of(&[SpeedFrom::Encoders, SpeedFrom::Duty]),
    ) -> Settings {
        let [attitude_kp, attitude_ki, speed_kp, speed_ki, counts_per_turn] = gains;
        Settings {
            board_id, gyro_range, accel_range, low_pass, gyro_axes, accel_axes, gyro_bias, attitude_kp, attitude_ki,
            speed_kp, speed_ki, counts_per_turn, motor_reversed, encoder_reversed, deadline_ms, moving_duty,
            bandgap, bridge, speed_from,
        }
    }
}

prop_compose! {
    fn any_telemetry()(
        (seq, unsent, imu_errors, bad_frames, missed_ticks) in (counts(), counts(), counts(), counts(), counts()),
        (clipped, glitches, phase) in (counts(), counts(), any::<u8>()),
        supply in any::<u16>().prop_map(Millivolts),
        time in any::<u32>().prop_map(Micros),
        attitude in any::<[i16; 4]>().prop_map(|q| Quaternion(q.map(Q15))),
        (gyro, accel) in (readings(), readings()),
        temperature in any::<i16>().prop_map(TemperatureCounts),
        (target, speed) in (speeds(), speeds()),
        duty in duties(),
        encoder in any::<[i32; 2]>().prop_map(|both| both.map(EncoderCounts)),
        state in one_of(&[State::Idle, State::Calibrating, State::Running, State::Driving, State::Faulted]),
        fault in one_of(&Fault::ALL),
        imu_fresh in any::<bool>(),
    ) -> Telemetry {
        Telemetry {
            seq, time, attitude, gyro, accel, temperature, target, speed, duty, encoder, state, fault, phase,
            supply, imu_fresh, unsent, imu_errors, clipped, glitches, bad_frames, missed_ticks,
        }
    }
}

/// Any request.
pub fn any_request() -> impl Strategy<Value = Request> {
    let command = prop_oneof![
        Just(Command::Hello),
        speeds().prop_map(Command::SetSpeeds),
        Just(Command::Stop),
        any::<u8>().prop_map(|rate_hz| Command::Stream { rate_hz }),
        any::<u16>().prop_map(|duration_ms| Command::CalibrateGyro { duration_ms }),
        any_settings().prop_map(Command::WriteSettings),
        Just(Command::Ping),
        (any::<u8>(), any::<u32>(), speeds(), any::<[u8; 2]>(), any::<u8>()).prop_map(
            |(index, tick, speeds, duties, phase)| Command::SetPoint {
                index,
                point: SetPoint { tick, speeds, duties, phase }
            }
        ),
        (any::<u8>(), any::<u32>()).prop_map(|(count, at)| Command::StartSchedule { count, at: Micros(at) }),
        (duties(), any::<u16>()).prop_map(|(duty, duration_ms)| Command::Drive { duty, duration_ms }),
        any::<u8>().prop_map(|index| Command::ReadFault { index }),
        (any::<[i32; 2]>(), any::<i16>()).prop_map(|(counts, speed)| Command::TurnTo {
            position: counts.map(EncoderCounts),
            speed: CentiRpm(speed),
        }),
        Just(Command::Align),
        any::<u8>().prop_map(|index| Command::ReadNote { index }),
        any::<[u8; 2]>().prop_map(|[index, byte]| Command::WriteNote { index, byte }),
    ];
    (any::<u8>(), command).prop_map(|(seq, command)| Request { seq, command })
}

/// Any message of the board.
pub fn any_message() -> impl Strategy<Value = Message> {
    let reply = prop_oneof![
        Just(Reply::Done),
        one_of(&[Refusal::Calibrating, Refusal::EepromFailed]).prop_map(Reply::Refused),
        any_settings().prop_map(Reply::Settings),
        any::<u32>().prop_map(|time| Reply::Pong(Micros(time))),
    ];
    prop_oneof![
        (any::<u8>(), reply).prop_map(|(to, reply)| Message::Reply { to, reply }),
        any_telemetry().prop_map(Message::Telemetry),
    ]
}
