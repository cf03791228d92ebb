//! The scales of a gyroscope, stored in the note on its board so that they move with the board between computers.
//!
//! | byte | content |
//! | --- | --- |
//! | 0 | number of the note, which rises by one and wraps at 256 |
//! | 1 | number of this layout, 1 |
//! | 2, 3 | day of the measurement: years since 2000 times 512, month times 32, day |
//! | 4, 5 | axes of the gyroscope and of the accelerometer: the signed axes as digits to the base 6 |
//! | 6 to 11 | scales about x, y, z in steps of 1e-5 |
//! | 12 to 17 | their standard uncertainties in steps of 1e-6; 65535 for a scale that was not measured |
//! | 18, 19 | CRC-16 of the bytes before it |
//!
//! Numbers of two bytes are little-endian. The newer one of two valid copies counts.

use super::{AXES, Estimate, MeasuredSensor};
use protocol::Settings;
use protocol::frame::crc16;
use protocol::units::{Axis, AxisMap};

/// The name of the board's note, in place of a file name.
pub const OF_BOARD: &str = "the board";

/// Length of a note.
const LENGTH: usize = protocol::NOTE_LENGTH as usize;

const LAYOUT: u8 = 1;
const SCALE_STEP: f64 = 1e-5;
const U_STEP: f64 = 1e-6;
const NOT_MEASURED: u16 = u16::MAX;

/// Returns a sensor with the scales of the newest copy, on a board with these settings; `None` if no copy is valid or
/// if the axes of the sensor have changed since.
pub fn read(copies: &[[u8; LENGTH]], settings: &Settings) -> Option<MeasuredSensor> {
    let note = &copies[newest(copies)?];
    let two = |i: usize| [note[i], note[i + 1]];
    let day = u16::from_le_bytes(two(2));
    let mut sensor = MeasuredSensor::new(settings);
    sensor.date = format!("20{:02}-{:02}-{:02}", day / 512, day / 32 % 16, day % 32);
    if sensor.axes.map(digits) != two(4) {
        return None;
    }
    for (i, axis) in AXES.into_iter().enumerate() {
        let (value, u) = (i16::from_le_bytes(two(6 + 2 * i)), u16::from_le_bytes(two(12 + 2 * i)));
        if u != NOT_MEASURED {
            let estimate = Estimate { value: f64::from(value) * SCALE_STEP, u: f64::from(u) * U_STEP };
            sensor.set("gyro_scale", axis, estimate);
        }
    }
    Some(sensor)
}

/// Returns the index and the content of the copy to write, with the scales of a sensor; `None` if the newest copy
/// already has them, or if there are none.
pub fn next(copies: &[[u8; LENGTH]], sensor: &MeasuredSensor) -> Option<(usize, [u8; LENGTH])> {
    let last = newest(copies);
    let mut note = [0; LENGTH];
    note[0] = last.map_or(0, |last| copies[last][0].wrapping_add(1));
    note[1] = LAYOUT;
    let mut date = sensor.date.splitn(3, '-').map(|part| part.parse::<u16>().ok());
    let [year, month, day] = [date.next()??, date.next()??, date.next()??];
    note[2..4].copy_from_slice(&(year.checked_sub(2000)? * 512 + month * 32 + day).to_le_bytes());
    note[4..6].copy_from_slice(&sensor.axes.map(digits));
    let mut is_measured = false;
    for (i, axis) in AXES.into_iter().enumerate() {
        let (mut value, mut u) = (0, NOT_MEASURED);
        if let Some(estimate) = sensor.get("gyro_scale", axis) {
            let [steps, u_steps] = [estimate.value / SCALE_STEP, (estimate.u / U_STEP).ceil()];
            // Values out of the note's range are kept only in the file.
            if steps.abs() < f64::from(i16::MAX) && u_steps < f64::from(NOT_MEASURED) {
                (value, u) = (steps.round() as i16, u_steps as u16);
                is_measured = true;
            }
        }
        note[6 + 2 * i..8 + 2 * i].copy_from_slice(&value.to_le_bytes());
        note[12 + 2 * i..14 + 2 * i].copy_from_slice(&u.to_le_bytes());
    }
    let crc = crc16(&note[..LENGTH - 2]).to_le_bytes();
    note[LENGTH - 2..].copy_from_slice(&crc);
    let is_kept = last.is_some_and(|last| copies[last][1..LENGTH - 2] == note[1..LENGTH - 2]);
    (is_measured && !is_kept).then(|| (last.map_or(0, |last| (last + 1) % copies.len()), note))
}

/// Returns the index of the newest valid copy.
fn newest(copies: &[[u8; LENGTH]]) -> Option<usize> {
    let is_valid = |note: &[u8; LENGTH]| {
        let (content, crc) = note.split_at(LENGTH - 2);
        note[1] == LAYOUT && crc16(content).to_le_bytes() == crc
    };
    let valid = (0..copies.len()).filter(|place| is_valid(&copies[*place]));
    valid.reduce(|best, place| if copies[place][0].wrapping_sub(copies[best][0]) < 128 { place } else { best })
}

/// Returns the signed axes as digits to the base 6.
fn digits(axes: AxisMap) -> u8 {
    let digit = |axis: Axis| 2 * axis.index() as u8 + u8::from(axis.is_negative());
    axes.0.into_iter().fold(0, |digits, axis| 6 * digits + digit(axis))
}

#[cfg(test)]
mod tests {
    use super::*;

    const BLANK: [[u8; LENGTH]; 2] = [[0xFF; LENGTH]; 2];
    const SCALE: Estimate = Estimate { value: -0.02134, u: 0.000451 };

    fn settings() -> Settings {
        let gyro_axes = AxisMap([Axis::MinusY, Axis::PlusX, Axis::PlusZ]);
        Settings { board_id: 7, gyro_axes, ..Settings::DEFAULT }
    }

    fn of_z(estimate: Estimate) -> MeasuredSensor {
        let mut sensor = MeasuredSensor::new(&settings());
        "2026-11-24".clone_into(&mut sensor.date);
        sensor.set("gyro_scale", "z", estimate);
        sensor
    }

    fn scale_of_z(copies: &[[u8; LENGTH]]) -> Option<Estimate> {
        read(copies, &settings())?.get("gyro_scale", "z")
    }

    fn is_close(found: Estimate, expected: Estimate) -> bool {
        (found.value - expected.value).abs() < 1e-9 && (found.u - expected.u).abs() < 1.1e-6
    }

    #[test]
    fn a_board_has_the_scales_that_were_written() {
        let mut copies = BLANK;
        assert_eq!((read(&copies, &settings()), next(&copies, &MeasuredSensor::new(&settings()))), (None, None));
        let (place, note) = next(&copies, &of_z(SCALE)).unwrap();
        copies[place] = note;
        let found = read(&copies, &settings()).unwrap();
        assert!(is_close(found.get("gyro_scale", "z").unwrap(), SCALE), "{found:?}");
        assert_eq!((found.date.as_str(), found.board_id, found.get("gyro_scale", "x")), ("2026-11-24", 7, None));
        assert_eq!(next(&copies, &of_z(SCALE)), None, "it has them already");
        let turned = Settings { gyro_axes: Settings::DEFAULT.gyro_axes, ..settings() };
        assert_eq!(read(&copies, &turned), None, "the scales are about other axes");
    }

    /// Power fails after each byte of each of 300 notes: the valid note is the previous one, or the new one.
    #[test]
    fn a_note_that_is_cut_off_leaves_the_one_before() {
        let mut copies = BLANK;
        for k in 0..300 {
            let new = of_z(Estimate { value: f64::from(k) * 1e-4 - 0.01, u: 0.001 });
            let before = scale_of_z(&copies);
            let (place, note) = next(&copies, &new).unwrap();
            for cut in 0..LENGTH {
                copies[place][cut] = note[cut];
                let found = scale_of_z(&copies);
                assert!(found == before || cut + 2 >= LENGTH, "{k} {cut}: {found:?} for {before:?}");
            }
            assert!(is_close(scale_of_z(&copies).unwrap(), new.get("gyro_scale", "z").unwrap()), "{k}");
        }
    }

    #[test]
    fn a_scale_that_does_not_fit_is_left_to_the_file() {
        for estimate in [Estimate { value: 0.4, u: 0.001 }, Estimate { value: 0.0, u: 0.07 }] {
            assert_eq!(next(&BLANK, &of_z(estimate)), None);
            let mut sensor = of_z(SCALE);
            sensor.set("gyro_scale", "y", estimate);
            let (_, note) = next(&BLANK, &sensor).unwrap();
            assert_eq!(read(&[note], &settings()).unwrap().get("gyro_scale", "y"), None);
            assert!(is_close(scale_of_z(&[note]).unwrap(), SCALE));
        }
    }
}
