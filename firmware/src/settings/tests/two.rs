//! Settings before and after a save that changes every byte. The tests of the emulated board use them, too.

use protocol::frame::{Accumulator, MAX_FRAME, encode};
use protocol::units::{AccelRange, Axis, AxisMap, GyroRange, Millivolts};
use protocol::{Bridge, Settings, SpeedFrom};

pub fn old() -> Settings {
    Settings {
        board_id: 7,
        gyro_bias: [594.1, 6.2, 147.0],
        deadline_ms: 400,
        bandgap: Millivolts(1010),
        ..Settings::DEFAULT
    }
}

/// Returns settings that differ from `old` in every byte.
pub fn new() -> Settings {
    let axes = |axes: [&str; 3]| AxisMap(axes.map(|name| Axis::from_name(name).unwrap()));
    Settings {
        board_id: 0x4711,
        gyro_range: GyroRange::Dps1000,
        accel_range: AccelRange::G8,
        low_pass: 5,
        gyro_axes: axes(["-y", "+x", "-z"]),
        accel_axes: axes(["+y", "-x", "-z"]),
        gyro_bias: [0xC107_0203, 0x4122_2324, 0xC233_3435].map(f32::from_bits),
        attitude_kp: f32::from_bits(0x4001_0203),
        attitude_ki: f32::from_bits(0x3E01_0203),
        speed_kp: f32::from_bits(0x4101_0203),
        speed_ki: f32::from_bits(0x4131_3233),
        counts_per_turn: f32::from_bits(0x4532_3334),
        motor_reversed: [true; 2],
        encoder_reversed: [true; 2],
        deadline_ms: 0x0203,
        moving_duty: [31, 32],
        bandgap: Millivolts(0x0401),
        bridge: Bridge::InIn,
        speed_from: SpeedFrom::Duty,
    }
}

#[test]
fn all_bytes_of_the_two_settings_differ() {
    let bytes = |settings: Settings| {
        let (mut buffer, mut accumulator) = ([0; MAX_FRAME], Accumulator::new());
        let frame = encode(&settings, &mut buffer).unwrap();
        frame.iter().find_map(|byte| Some(accumulator.push_for_payload(*byte)?.unwrap().to_vec())).unwrap()
    };
    let (old, new) = (bytes(old()), bytes(new()));
    let same: Vec<_> = (0..old.len()).filter(|at| old[*at] == new[*at]).collect();
    assert!(same.is_empty() && self::new().is_valid(), "{same:?}");
}
