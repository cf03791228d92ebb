//! The MPU6050 on a bus that asserts every transaction: set-up, readings, failures.

use embedded_hal::i2c::{ErrorKind, NoAcknowledgeSource};
use embedded_hal_mock::eh1::i2c::{Mock, Transaction};
use firmware::imu::{Config, FAULT_AFTER_TICKS, FROZEN_TICKS, Imu, Reading};
use protocol::units::{AccelRange, GyroRange, SensorCounts, TemperatureCounts};
use protocol::{Fault, Settings};

const ADDRESS: u8 = 0x68;
const NACK: ErrorKind = ErrorKind::NoAcknowledge(NoAcknowledgeSource::Address);
const CONFIG: Config = Config { gyro_range: GyroRange::Dps500, accel_range: AccelRange::G8, low_pass: 3 };

/// Steps of set-up, one per tick.
const STEPS: usize = 6;

/// Ticks from the end of set-up to the first reading.
const SETTLING_TICKS: usize = 10;

fn write(register: u8, value: u8) -> Transaction {
    Transaction::write(ADDRESS, vec![register, value])
}

fn read(register: u8, values: &[u8]) -> Transaction {
    Transaction::write_read(ADDRESS, vec![register], values.to_vec())
}

/// Returns the transactions of set-up, one per tick.
fn set_up(id: u8) -> Vec<Transaction> {
    vec![
        write(0x6B, 0x01),
        write(0x1C, 0b0001_0000),
        write(0x1B, 0b0000_1000),
        write(0x1A, 3),
        write(0x19, 4),
        read(0x75, &[id]),
    ]
}

/// Returns a sample whose values depend on the number, and the register after it.
fn bytes(number: u8) -> Vec<u8> {
    let mut bytes: Vec<u8> = (0..7).flat_map(|word| [number, word]).collect();
    bytes.push(0);
    bytes
}

fn sample(number: u8) -> Transaction {
    read(0x3B, &bytes(number))
}

fn reading(number: u8) -> Reading {
    let word = |word: u8| i16::from_be_bytes([number, word]);
    Reading {
        accel: [0, 1, 2].map(|axis| SensorCounts(word(axis))),
        temperature: TemperatureCounts(word(3)),
        gyro: [4, 5, 6].map(|axis| SensorCounts(word(axis))),
    }
}

/// Returns a sensor that is set up and settled, and a bus that expects `then` next.
fn settled(then: &[Transaction]) -> (Imu<Mock>, Mock) {
    let (mut imu, bus) = configured(&[set_up(0x68), then.to_vec()].concat());
    imu.set_up_now();
    assert_eq!(polls(&mut imu, SETTLING_TICKS), 0);
    (imu, bus)
}

fn configured(transactions: &[Transaction]) -> (Imu<Mock>, Mock) {
    let bus = Mock::new(transactions);
    let mut imu = Imu::new(bus.clone());
    imu.configure(CONFIG);
    (imu, bus)
}

fn poll(imu: &mut Imu<Mock>) -> Option<Reading> {
    imu.poll().then(|| imu.reading())
}

/// Polls `ticks` times and returns the number of readings.
fn polls(imu: &mut Imu<Mock>, ticks: usize) -> usize {
    (0..ticks).filter(|_| imu.poll()).count()
}

#[test]
fn a_genuine_sensor_is_set_up_and_read() {
    let (mut imu, mut bus) = settled(&[sample(1), sample(2)]);
    assert_eq!(imu.id(), 0x68);
    assert_eq!(poll(&mut imu), Some(reading(1)));
    assert_eq!(poll(&mut imu), Some(reading(2)));
    assert_eq!((imu.errors(), imu.fault()), (0, Fault::None));
    bus.done();
}

#[test]
fn signs_and_extremes_are_read_correctly() {
    let mut bytes = vec![0x80, 0x00, 0x7F, 0xFF, 0xFF, 0xFF, 0xF0, 0x60, 0x00, 0x01, 0xFF, 0xFE, 0x12, 0x34];
    bytes.push(0);
    let (mut imu, mut bus) = settled(&[read(0x3B, &bytes)]);
    let expected = Reading {
        accel: [SensorCounts(i16::MIN), SensorCounts(i16::MAX), SensorCounts(-1)],
        temperature: TemperatureCounts(-4000),
        gyro: [SensorCounts(1), SensorCounts(-2), SensorCounts(0x1234)],
    };
    assert_eq!(poll(&mut imu), Some(expected));
    bus.done();
}

#[test]
fn a_clone_is_used_and_reported() {
    for id in [0x70, 0x71, 0x72, 0x98, 0x19] {
        let (mut imu, mut bus) = configured(&[set_up(id), vec![sample(1)]].concat());
        imu.set_up_now();
        assert_eq!(polls(&mut imu, SETTLING_TICKS + 1), 1);
        assert_eq!((imu.id(), imu.fault()), (id, Fault::None));
        bus.done();
    }
}

#[test]
fn an_absent_sensor_has_no_id_and_becomes_a_fault() {
    let attempts = usize::from(FAULT_AFTER_TICKS) + 5;
    let (mut imu, mut bus) = configured(&vec![write(0x6B, 0x01).with_error(NACK); attempts]);
    for tick in 1..=attempts {
        assert_eq!(poll(&mut imu), None);
        let expected = if tick < usize::from(FAULT_AFTER_TICKS) { Fault::None } else { Fault::ImuSilent };
        assert_eq!(imu.fault(), expected, "tick {tick}");
    }
    assert_eq!((imu.id(), imu.errors()), (0, attempts as u16));
    bus.done();
}

/// Whichever byte fails, the driver sees an error of the transaction.
#[test]
fn a_failure_in_any_transaction_of_set_up_restarts_it() {
    for error in [NACK, ErrorKind::NoAcknowledge(NoAcknowledgeSource::Data), ErrorKind::Bus, ErrorKind::Other] {
        for failing in 0..set_up(0x68).len() {
            let mut transactions = set_up(0x68);
            transactions.truncate(failing + 1);
            let last = transactions.pop().unwrap().with_error(error);
            transactions.push(last);
            transactions.extend(set_up(0x68));
            transactions.push(sample(1));
            let (mut imu, mut bus) = configured(&transactions);
            let ticks_to_reading = (1..).find(|_| imu.poll()).unwrap();
            assert!(ticks_to_reading <= 2 * STEPS + SETTLING_TICKS + 1, "{ticks_to_reading}");
            assert_eq!((imu.errors(), imu.fault(), imu.id()), (1, Fault::None, 0x68));
            bus.done();
        }
    }
}

#[test]
fn a_single_failure_is_counted_and_the_next_tick_reads() {
    for error in [NACK, ErrorKind::Bus, ErrorKind::ArbitrationLoss] {
        let (mut imu, mut bus) = settled(&[sample(1), sample(2).with_error(error), sample(3)]);
        assert_eq!(poll(&mut imu), Some(reading(1)));
        assert_eq!(poll(&mut imu), None);
        assert_eq!(poll(&mut imu), Some(reading(3)));
        assert_eq!((imu.errors(), imu.fault()), (1, Fault::None));
        bus.done();
    }
}

#[test]
fn lasting_failures_have_their_fault_and_end_with_a_new_set_up() {
    for (error, fault) in [(NACK, Fault::ImuSilent), (ErrorKind::Bus, Fault::ImuBusStuck)] {
        let failing = vec![sample(0).with_error(error); usize::from(FAULT_AFTER_TICKS)];
        let (mut imu, mut bus) = settled(&[vec![sample(9)], failing, set_up(0x68), vec![sample(1)]].concat());
        assert_eq!(poll(&mut imu), Some(reading(9)));
        assert_eq!(polls(&mut imu, usize::from(FAULT_AFTER_TICKS) - 1), 0);
        assert_eq!(imu.fault(), Fault::None);
        assert_eq!(poll(&mut imu), None);
        assert_eq!(imu.fault(), fault);
        // The fault lasts until the next reading.
        assert_eq!(polls(&mut imu, STEPS + SETTLING_TICKS), 0);
        assert_eq!(imu.fault(), fault);
        assert_eq!(poll(&mut imu), Some(reading(1)));
        assert_eq!((imu.fault(), imu.errors()), (Fault::None, u16::from(FAULT_AFTER_TICKS)));
        bus.done();
    }
}

/// A sensor that releases the bus while it sends is not seen by a missing acknowledgement: the rest reads as ones.
#[test]
fn a_sensor_that_falls_silent_within_a_reading_is_seen() {
    for byte in 0..15 {
        let mut cut = bytes(7);
        cut[byte..].fill(0xFF);
        let (mut imu, mut bus) = settled(&[read(0x3B, &cut), sample(8)]);
        assert_eq!(poll(&mut imu), None, "silent from byte {byte}");
        assert_eq!(poll(&mut imu), Some(reading(8)));
        assert_eq!(imu.errors(), 1);
        bus.done();
    }
}

#[test]
fn frozen_data_become_a_fault_and_new_data_end_it() {
    let frozen = vec![sample(5); usize::from(FROZEN_TICKS) + 1];
    let (mut imu, mut bus) = settled(&[frozen, set_up(0x68), vec![sample(6)]].concat());
    assert_eq!(polls(&mut imu, usize::from(FROZEN_TICKS)), usize::from(FROZEN_TICKS));
    assert_eq!(imu.fault(), Fault::None);
    assert_eq!(poll(&mut imu), None);
    assert_eq!(imu.fault(), Fault::ImuFrozen);
    assert_eq!(polls(&mut imu, STEPS + SETTLING_TICKS), 0);
    assert_eq!(poll(&mut imu), Some(reading(6)));
    assert_eq!(imu.fault(), Fault::None);
    bus.done();
}

#[test]
fn frozen_data_stay_a_fault_while_they_last() {
    let frozen = vec![sample(5); usize::from(FROZEN_TICKS) + 1];
    let again = [set_up(0x68), vec![sample(5)]].concat();
    let (mut imu, mut bus) = settled(&[frozen, again.clone(), again].concat());
    polls(&mut imu, usize::from(FROZEN_TICKS) + 1);
    for _ in 0..2 * (STEPS + SETTLING_TICKS + 1) {
        assert_eq!((poll(&mut imu), imu.fault()), (None, Fault::ImuFrozen));
    }
    bus.done();
}

#[test]
fn a_sensor_that_samples_at_half_the_rate_is_not_frozen() {
    let slow: Vec<_> = (1..=100).flat_map(|number| [sample(number), sample(number)]).collect();
    let (mut imu, mut bus) = settled(&slow);
    assert_eq!(polls(&mut imu, 200), 200);
    assert_eq!((imu.errors(), imu.fault()), (0, Fault::None));
    bus.done();
}

#[test]
fn a_short_loss_of_supply_is_repaired_without_a_fault() {
    let asleep = read(0x3B, &[0; 15]);
    let (mut imu, mut bus) = settled(&[vec![sample(1), asleep], set_up(0x68), vec![sample(2)]].concat());
    assert_eq!(poll(&mut imu), Some(reading(1)));
    let ticks_to_reading = (1..).find(|_| imu.poll()).unwrap();
    assert!(ticks_to_reading < usize::from(FAULT_AFTER_TICKS), "{ticks_to_reading}");
    assert_eq!((imu.errors(), imu.fault()), (1, Fault::None));
    bus.done();
}

#[test]
fn a_sensor_that_stays_asleep_becomes_a_fault() {
    let round = [vec![read(0x3B, &[0; 15])], set_up(0x68)].concat();
    let (mut imu, mut bus) = settled(&[round.clone(), round.clone(), round].concat());
    polls(&mut imu, 3 * (1 + STEPS + SETTLING_TICKS));
    assert_eq!((imu.fault(), imu.errors()), (Fault::ImuFrozen, 3));
    bus.done();
}

#[test]
fn a_lost_configuration_is_found_within_a_second_and_restored() {
    let samples: Vec<_> = (0..200).map(|number| sample(1 + number as u8 % 100)).collect();
    let checked = vec![read(0x19, &[4]), sample(201)];
    let lost = vec![read(0x19, &[0])];
    let then = [samples.clone(), checked, samples, lost, set_up(0x68), vec![sample(7)]].concat();
    let (mut imu, mut bus) = settled(&then);
    assert_eq!(polls(&mut imu, 401), 401);
    assert_eq!(poll(&mut imu), None);
    assert_eq!(imu.errors(), 1);
    assert_eq!(polls(&mut imu, STEPS + SETTLING_TICKS + 1), 1);
    bus.done();
}

#[test]
fn another_configuration_is_applied_and_the_same_one_is_not() {
    let narrow = Config { gyro_range: GyroRange::Dps250, accel_range: AccelRange::G2, low_pass: 6 };
    let steps =
        vec![write(0x6B, 0x01), write(0x1C, 0), write(0x1B, 0), write(0x1A, 6), write(0x19, 4), read(0x75, &[0x68])];
    let (mut imu, mut bus) = settled(&[vec![sample(1)], steps, vec![sample(2)]].concat());
    imu.configure(CONFIG);
    assert_eq!(poll(&mut imu), Some(reading(1)));
    imu.configure(narrow);
    assert_eq!(polls(&mut imu, STEPS + SETTLING_TICKS + 1), 1);
    assert_eq!((imu.errors(), imu.fault()), (0, Fault::None));
    bus.done();
}

#[test]
fn the_configuration_is_that_of_the_settings() {
    let settings = Settings { gyro_range: GyroRange::Dps500, accel_range: AccelRange::G8, ..Settings::DEFAULT };
    assert_eq!(Config::from(&settings), CONFIG);
}
