//! The fault log in the board's EEPROM. It keeps earlier faults, because the host resets the board by opening the port.

use super::error::fault_text;
use crate::link::{Link, LinkError};
use biflag_log::FaultMeta;
use protocol::units::CentiRpm;
use protocol::{Command, FAULT_RECORDS, Fault, FaultRecord, Reply};

/// Reads the fault log, the latest entry first.
///
/// # Errors
/// As [`Link::ask`].
pub fn read(link: &Link) -> Result<Vec<FaultRecord>, LinkError> {
    let mut records = Vec::new();
    for index in 0..FAULT_RECORDS {
        let command = Command::ReadFault { index };
        match link.ask(command)? {
            Reply::FaultRecord(record) if record.fault == Fault::None => break,
            Reply::FaultRecord(record) => records.push(record),
            other => return Err(link.wrong_answer(&command, &other)),
        }
    }
    Ok(records)
}

/// Converts the entry to a log's record.
pub fn to_log(record: &FaultRecord) -> FaultMeta {
    FaultMeta {
        boot: record.boot,
        time_s: seconds(record),
        fault: format!("{:?}", record.fault),
        duty: record.duty.map(|duty| duty.0),
        speed_rpm: Some(record.speed.map(CentiRpm::rpm)).filter(|speeds| speeds.iter().all(|rpm| rpm.is_finite())),
        program_counter: record.program_counter,
    }
}

/// Describes the entry in a line.
pub fn line(record: &FaultRecord) -> String {
    let [d1, d2] = record.duty.map(|duty| duty.0);
    let speeds = match record.speed {
        [CentiRpm::UNKNOWN, _] => "speeds unknown".to_owned(),
        [w1, w2] => format!("speeds {:.1} and {:.1} rpm", w1.rpm(), w2.rpm()),
    };
    let place = match record.program_counter {
        0 if record.fault == Fault::Hang => ", without an address, so a reset is likely".to_owned(),
        0 => String::new(),
        address => format!(" at {address:#06x} in flash"),
    };
    format!(
        "start {}, {:.1} s: {}{place}; duties {d1} and {d2}, {speeds}",
        record.boot,
        seconds(record),
        fault_text(record.fault),
    )
}

fn seconds(record: &FaultRecord) -> f64 {
    f64::from(record.time.0) * 1e-6
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol::units::{CentiRpm, Duty, Micros};

    #[test]
    fn an_entry_is_one_line() {
        let stall = FaultRecord {
            boot: 12,
            time: Micros(34_560_000),
            fault: Fault::Motor2Stalled,
            duty: [Duty(0), Duty(-255)],
            speed: [CentiRpm(0), CentiRpm(-1210)],
            program_counter: 0,
        };
        assert_eq!(
            line(&stall),
            "start 12, 34.6 s: motor 2 is stalled: it is driven but hardly turns; duties 0 and -255, speeds 0.0 and -12.1 rpm"
        );
        let hang = FaultRecord { fault: Fault::Hang, program_counter: 0x1a2c, ..FaultRecord::default() };
        assert!(line(&hang).contains("restarted at 0x1a2c in flash;"), "{}", line(&hang));
        let reset = FaultRecord { fault: Fault::Hang, ..FaultRecord::default() };
        assert!(line(&reset).contains("restarted, without an address, so a reset is likely;"), "{}", line(&reset));
        assert_eq!(to_log(&stall).fault, "Motor2Stalled");
        assert_eq!(to_log(&stall).speed_rpm, Some([0.0, -12.1]));
    }
}
