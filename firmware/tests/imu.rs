//! The MPU6050 on a bus that asserts every transaction: set-up, readings, failures.

use embedded_hal::i2c::{ErrorKind, NoAcknowledgeSource};
use embedded_hal_mock::eh1::i2c::{Mock, Transaction};
use firmware::imu::{Config, FAULT_AFTER_TICKS, FROZEN_TICKS, Imu, LIFELESS_READINGS, Reading};
use protocol::units::{AccelRange, GyroRange, SensorCounts, TemperatureCounts};
use protocol::{Fault, Settings};

const ADDRESS: u8 = 0x68;
const NACK: ErrorKind = ErrorKind::NoAcknowledge(NoAcknowledgeSource::Address);
const CONFIG: Config = Config { gyro_range: GyroRange::Dps500, accel_range: AccelRange::G8, low_pass: 3 };

/// Ticks from the start of set-up to the first reading.
const SET_UP_TICKS: usize = 32;

/// Readings between two checks of the configuration.
const CHECK_INTERVAL: usize = 4;

/// What the registers 0x19 to 0x1C hold: 1000 samples per second, a filter of 44 Hz, 500 °/s, 8 g.
const REGISTERS: [u8; 4] = [0, 3, 0b0000_1000, 0b0001_0000];

fn write(register: u8, values: &[u8]) -> Transaction {
    Transaction::write(ADDRESS, [&[register], values].concat())
}

fn read(register: u8, values: &[u8]) -> Transaction {
    Transaction::write_read(ADDRESS, vec![register], values.to_vec())
}

/// Returns the transactions of set-up.
fn set_up(id: u8) -> Vec<Transaction> {
    set_up_with(id, &REGISTERS)
}

fn set_up_with(id: u8, registers: &[u8; 4]) -> Vec<Transaction> {
    let mut transactions = vec![read(0x75, &[id]), write(0x6B, &[0x80]), write(0x6B, &[0x01])];
    transactions.extend((0x19..).zip(registers).map(|(register, value)| write(register, &[*value])));
    if id != 0x68 {
        // The accelerometer of a clone has a filter of its own.
        transactions.push(write(0x1D, &registers[1..2]));
    }
    transactions.push(write(0x38, &[0x01]));
    transactions
}

/// Returns DATA_RDY, a sample whose values depend on the number, and the register after it.
fn bytes(number: u8) -> Vec<u8> {
    let mut bytes = vec![1];
    bytes.extend((0..7).flat_map(|word| [number, word]));
    bytes.push(0);
    bytes
}

fn sample(number: u8) -> Transaction {
    read(0x3A, &bytes(number))
}

/// A sample that has been read before.
fn stale(number: u8) -> Transaction {
    let mut bytes = bytes(number);
    bytes[0] = 0;
    read(0x3A, &bytes)
}

/// What PWR_MGMT_1 and INT_ENABLE hold.
fn still_set_up() -> Vec<Transaction> {
    vec![read(0x6B, &[0x01]), read(0x38, &[0x01])]
}

fn check() -> Transaction {
    read(0x19, &REGISTERS)
}

/// Returns these samples with the checks of the configuration that follow them.
fn checked(samples: impl IntoIterator<Item = Transaction>) -> Vec<Transaction> {
    let with_checks = |(index, sample)| if index % CHECK_INTERVAL == 0 { vec![sample, check()] } else { vec![sample] };
    samples.into_iter().enumerate().flat_map(with_checks).collect()
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
    assert_eq!(polls(&mut imu, SET_UP_TICKS), 0);
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
    let (mut imu, mut bus) = settled(&checked([sample(1), sample(2)]));
    assert_eq!(imu.id(), 0x68);
    assert_eq!(poll(&mut imu), Some(reading(1)));
    assert_eq!(poll(&mut imu), Some(reading(2)));
    assert_eq!((imu.errors(), imu.fault()), (0, Fault::None));
    bus.done();
}

#[test]
fn set_up_waits_after_the_reset_and_after_waking() {
    let transactions = set_up(0x68);
    // 100 ms from the reset to waking, at least 30 ms from waking to the first sample.
    for (ticks, so_far) in [(1, 1), (2, 2), (21, 2), (22, 3), (26, 7), (SET_UP_TICKS, 8)] {
        let (mut imu, mut bus) = configured(&transactions[..so_far]);
        assert_eq!(polls(&mut imu, ticks), 0);
        assert_eq!((imu.errors(), imu.id()), (0, 0x68), "{ticks}");
        bus.done();
    }
}

#[test]
fn signs_and_extremes_are_read_correctly() {
    let bytes = [1, 0x80, 0x00, 0x7F, 0xFF, 0xFF, 0xFF, 0xF0, 0x60, 0x00, 0x01, 0xFF, 0xFE, 0x12, 0x34, 0];
    let (mut imu, mut bus) = settled(&checked([read(0x3A, &bytes)]));
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
        let (mut imu, mut bus) = configured(&[set_up(id), checked([sample(1)])].concat());
        assert_eq!(polls(&mut imu, SET_UP_TICKS + 1), 1);
        assert_eq!((imu.id(), imu.fault()), (id, Fault::None));
        bus.done();
    }
}

#[test]
fn an_absent_sensor_has_no_id_and_becomes_a_fault() {
    let attempts = usize::from(FAULT_AFTER_TICKS) + 5;
    let (mut imu, mut bus) = configured(&vec![read(0x75, &[0]).with_error(NACK); attempts]);
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
            transactions.extend(checked([sample(1)]));
            let (mut imu, mut bus) = configured(&transactions);
            let ticks_to_reading = (1..1000).find(|_| imu.poll()).unwrap();
            assert!(ticks_to_reading <= 2 * SET_UP_TICKS, "{ticks_to_reading}");
            assert_eq!((imu.errors(), imu.fault(), imu.id()), (1, Fault::None, 0x68));
            bus.done();
        }
    }
}

#[test]
fn a_single_failure_is_counted_and_the_next_tick_reads() {
    for error in [NACK, ErrorKind::Bus, ErrorKind::ArbitrationLoss] {
        let (mut imu, mut bus) = settled(&checked([sample(1), sample(2).with_error(error), sample(3)]));
        assert_eq!(poll(&mut imu), Some(reading(1)));
        assert_eq!(poll(&mut imu), None);
        assert_eq!(poll(&mut imu), Some(reading(3)));
        assert_eq!((imu.errors(), imu.fault()), (1, Fault::None));
        bus.done();
    }
}

#[test]
fn a_check_that_fails_is_repeated_in_the_next_tick() {
    let (mut imu, mut bus) = settled(&[sample(1), check().with_error(NACK), sample(2), check(), sample(3)]);
    assert_eq!([0; 3].map(|_| poll(&mut imu)), [None, Some(reading(2)), Some(reading(3))]);
    assert_eq!((imu.errors(), imu.fault()), (1, Fault::None));
    bus.done();
}

#[test]
fn lasting_failures_have_their_fault_and_end_with_a_new_set_up() {
    for (error, fault) in [(NACK, Fault::ImuSilent), (ErrorKind::Bus, Fault::ImuBusStuck)] {
        let failing = vec![sample(0).with_error(error); usize::from(FAULT_AFTER_TICKS)];
        let again = [set_up(0x68), vec![sample(1)]].concat();
        let (mut imu, mut bus) = settled(&[checked([sample(9)]), failing, again].concat());
        assert_eq!(poll(&mut imu), Some(reading(9)));
        assert_eq!(polls(&mut imu, usize::from(FAULT_AFTER_TICKS) - 1), 0);
        assert_eq!(imu.fault(), Fault::None);
        assert_eq!(poll(&mut imu), None);
        assert_eq!(imu.fault(), fault);
        // The fault lasts until the next reading.
        assert_eq!(polls(&mut imu, SET_UP_TICKS), 0);
        assert_eq!(imu.fault(), fault);
        assert_eq!(poll(&mut imu), Some(reading(1)));
        assert_eq!((imu.fault(), imu.errors()), (Fault::None, u16::from(FAULT_AFTER_TICKS)));
        bus.done();
    }
}

/// A sensor that releases the bus while it sends is not seen by a missing acknowledgement: the rest reads as ones.
#[test]
fn a_sensor_that_falls_silent_within_a_reading_is_seen() {
    for byte in 0..16 {
        let mut cut = bytes(7);
        cut[byte..].fill(0xFF);
        let (mut imu, mut bus) = settled(&[read(0x3A, &cut), sample(8), check()]);
        assert_eq!(poll(&mut imu), None, "silent from byte {byte}");
        assert_eq!(poll(&mut imu), Some(reading(8)));
        assert_eq!(imu.errors(), 1);
        bus.done();
    }
}

#[test]
fn a_slower_sensor_has_no_new_sample_now_and_then_and_that_is_no_error() {
    // Every third tick has none.
    let samples = (1..=90).map(|number| if number % 3 == 0 { stale(number) } else { sample(number) });
    let (mut imu, mut bus) = settled(&checked(samples));
    for number in 1..=90 {
        assert_eq!(poll(&mut imu), (number % 3 != 0).then(|| reading(number)), "{number}");
    }
    assert_eq!((imu.errors(), imu.fault()), (0, Fault::None));
    bus.done();
}

/// Returns a new sample with these counts of the gyroscope.
fn sample_with_rate(number: u8, rate: [i16; 3]) -> Transaction {
    let mut bytes = bytes(number);
    bytes[9..15].copy_from_slice(rate.map(i16::to_be_bytes).as_flattened());
    read(0x3A, &bytes)
}

#[test]
fn a_rate_about_any_axis_is_that_of_a_sensor() {
    // The least ones, and those that are zeros but for one byte.
    let counts = [0, 1, -1, 256];
    let rates = counts.into_iter().flat_map(|x| counts.map(|y| [x, y])).flat_map(|[x, y]| counts.map(|z| [x, y, z]));
    let rates: Vec<_> = rates.filter(|rate| *rate != [0; 3]).collect();
    let samples = (0..).zip(&rates).map(|(number, rate)| sample_with_rate(number, *rate));
    let (mut imu, mut bus) = settled(&checked(samples));
    for rate in rates {
        assert_eq!(poll(&mut imu).map(|reading| reading.gyro), Some(rate.map(SensorCounts)));
    }
    bus.done();
}

/// A sensor at rest may repeat a sample exactly, which is used four times, or read a rate of zero, which is not used, but not for
/// a fifth of a second.
#[test]
fn samples_that_no_sensor_makes_are_no_readings_and_then_a_fault() {
    let limit = usize::from(LIFELESS_READINGS);
    // The first of equal ones differs from that before.
    for (lifeless, readings, used) in [
        ((0..60).map(|_| sample(5)).collect::<Vec<_>>(), limit, 5),
        ((0..60).map(|number| sample_with_rate(number, [0; 3])).collect(), limit - 1, 0),
    ] {
        let once = [lifeless[..readings].to_vec(), vec![sample(7)]].concat();
        let then = lifeless[..=readings].to_vec();
        let (mut imu, mut bus) = settled(&checked([once, then].concat()));
        assert_eq!(polls(&mut imu, readings + 1 + readings), used + 1 + used);
        assert_eq!((imu.errors(), imu.fault()), (0, Fault::None));
        assert_eq!(poll(&mut imu), None);
        assert_eq!((imu.errors(), imu.fault()), (1, Fault::ImuFrozen));
        bus.done();
    }
}

#[test]
fn a_new_set_up_that_changes_nothing_keeps_the_fault() {
    let frozen = vec![sample(5); usize::from(LIFELESS_READINGS) + 1];
    let again = [set_up(0x68), vec![sample(5)], set_up(0x68), vec![sample(6)]].concat();
    let (mut imu, mut bus) = settled(&[checked(frozen), again].concat());
    assert_eq!(polls(&mut imu, usize::from(LIFELESS_READINGS) + 1), 5);
    assert_eq!(polls(&mut imu, SET_UP_TICKS + 1), 0);
    assert_eq!((imu.errors(), imu.fault()), (2, Fault::ImuFrozen));
    assert_eq!(polls(&mut imu, SET_UP_TICKS + 1), 1);
    assert_eq!((imu.errors(), imu.fault()), (2, Fault::None));
    bus.done();
}

#[test]
fn a_frozen_sensor_becomes_a_fault_and_new_data_end_it() {
    let frozen = [vec![sample(4)], vec![stale(4); usize::from(FROZEN_TICKS)]].concat();
    let again = [set_up(0x68), vec![sample(6)]].concat();
    let (mut imu, mut bus) = settled(&[checked(frozen), still_set_up(), again].concat());
    assert_eq!(polls(&mut imu, usize::from(FROZEN_TICKS)), 1);
    assert_eq!((imu.fault(), imu.errors()), (Fault::None, 0));
    assert_eq!(poll(&mut imu), None);
    assert_eq!((imu.fault(), imu.errors()), (Fault::ImuFrozen, 1));
    assert_eq!(polls(&mut imu, SET_UP_TICKS), 0);
    assert_eq!(imu.fault(), Fault::ImuFrozen);
    assert_eq!(poll(&mut imu), Some(reading(6)));
    assert_eq!(imu.fault(), Fault::None);
    bus.done();
}

#[test]
fn a_sensor_that_never_has_data_is_a_fault() {
    let first = [vec![stale(5), check()], still_set_up()].concat();
    let second = [vec![stale(5)], still_set_up()].concat();
    let (mut imu, mut bus) = settled(&[first, set_up(0x68), second, set_up(0x68)].concat());
    assert_eq!(polls(&mut imu, 2 * (1 + SET_UP_TICKS)), 0);
    assert_eq!((imu.fault(), imu.errors()), (Fault::ImuFrozen, 2));
    bus.done();
}

#[test]
fn a_sensor_that_fell_asleep_or_says_no_more_when_it_has_data_is_set_up_again_without_a_fault() {
    let asleep = vec![read(0x6B, &[0x40])];
    let disabled = vec![read(0x6B, &[0x01]), read(0x38, &[0x00])];
    for reason in [asleep, disabled] {
        let samples = [vec![sample(1)], vec![stale(1); usize::from(FROZEN_TICKS)]].concat();
        let again = [set_up(0x68), vec![sample(2)]].concat();
        let (mut imu, mut bus) = settled(&[checked(samples), reason, again].concat());
        assert_eq!(polls(&mut imu, 1 + usize::from(FROZEN_TICKS)), 1);
        assert_eq!((imu.fault(), imu.errors()), (Fault::None, 1));
        assert_eq!(polls(&mut imu, SET_UP_TICKS), 0);
        assert_eq!((poll(&mut imu), imu.fault(), imu.errors()), (Some(reading(2)), Fault::None, 1));
        bus.done();
    }
}

/// A loss of supply clears INT_ENABLE too: there is no new sample from then on, and the next check finds the rest.
#[test]
fn a_short_loss_of_supply_is_repaired_without_a_fault() {
    let asleep = read(0x3A, &[0; 16]);
    let lost = vec![asleep.clone(), asleep.clone(), asleep.clone(), asleep, read(0x19, &[0; 4])];
    let again = [set_up(0x68), vec![sample(2), check()]].concat();
    let (mut imu, mut bus) = settled(&[checked([sample(1)]), lost, again].concat());
    assert_eq!(poll(&mut imu), Some(reading(1)));
    let ticks_to_reading = (1..1000).find(|_| imu.poll()).unwrap();
    assert!(ticks_to_reading < usize::from(FAULT_AFTER_TICKS), "{ticks_to_reading}");
    assert_eq!((imu.errors(), imu.fault()), (1, Fault::None));
    bus.done();
}

#[test]
fn each_changed_register_is_found_within_four_ticks_and_restored() {
    for (register, bit) in (0..4).flat_map(|register| (0..8).map(move |bit| (register, bit))) {
        let mut changed = REGISTERS;
        changed[register] ^= 1 << bit;
        let unseen = [2, 3, 4].map(sample).to_vec();
        let lost = vec![sample(5), read(0x19, &changed)];
        let again = [set_up(0x68), vec![sample(7), check()]].concat();
        let (mut imu, mut bus) = settled(&[checked([sample(1)]), unseen, lost, again].concat());
        assert_eq!(polls(&mut imu, CHECK_INTERVAL), CHECK_INTERVAL);
        assert_eq!((poll(&mut imu), imu.errors()), (None, 1));
        assert_eq!(polls(&mut imu, SET_UP_TICKS), 0);
        assert_eq!((poll(&mut imu), imu.errors(), imu.fault()), (Some(reading(7)), 1, Fault::None));
        bus.done();
    }
}

#[test]
fn a_sensor_that_does_not_take_its_configuration_is_a_fault() {
    let round = [set_up(0x68), vec![sample(1), read(0x19, &[0; 4])]].concat();
    let (mut imu, mut bus) = configured(&[round.clone(), round].concat());
    assert_eq!(polls(&mut imu, SET_UP_TICKS + 1), 0);
    assert_eq!((imu.fault(), imu.errors()), (Fault::None, 1));
    assert_eq!(polls(&mut imu, SET_UP_TICKS + 1), 0);
    assert_eq!((imu.fault(), imu.errors()), (Fault::ImuLostConfig, 2));
    bus.done();
}

#[test]
fn a_configuration_that_is_lost_twice_is_no_fault() {
    let unseen = [2, 3, 4].map(sample).to_vec();
    let lost = [vec![sample(5), read(0x19, &[0; 4])], set_up(0x68)].concat();
    let (mut imu, mut bus) =
        settled(&[checked([sample(1)]), unseen, lost.clone(), lost, vec![sample(7), check()]].concat());
    assert_eq!(polls(&mut imu, CHECK_INTERVAL), CHECK_INTERVAL);
    for losses in 1..=2 {
        assert_eq!(polls(&mut imu, 1 + SET_UP_TICKS), 0);
        assert_eq!((imu.errors(), imu.fault()), (losses, Fault::None));
    }
    assert_eq!((poll(&mut imu), imu.fault()), (Some(reading(7)), Fault::None));
    bus.done();
}

/// Returns the number of losses, of six, at which there is a fault, where each comes after so many good readings, one more
/// than a multiple of the check's interval.
fn losses_to_fault(readings: usize) -> Option<usize> {
    let lost = [vec![sample(1); CHECK_INTERVAL], vec![read(0x19, &[0; 4])], set_up(0x68)].concat();
    let samples = (0..readings).map(|number| sample(2 + number as u8 % 2));
    let round = [checked(samples), lost].concat();
    let (mut imu, mut bus) = settled(&vec![round; 6].concat());
    let faults = [(); 6].map(|()| {
        assert_eq!(polls(&mut imu, readings + CHECK_INTERVAL), readings + CHECK_INTERVAL - 1);
        let fault = imu.fault();
        assert_eq!(polls(&mut imu, SET_UP_TICKS), 0);
        fault
    });
    bus.done();
    assert!(faults.iter().all(|fault| matches!(fault, Fault::None | Fault::ImuLostConfig)));
    faults.iter().position(|fault| *fault != Fault::None).map(|before| before + 1)
}

#[test]
fn a_configuration_that_is_lost_again_and_again_is_a_fault() {
    assert_eq!(losses_to_fault(1), Some(3));
    assert_eq!(losses_to_fault(201), Some(3));
    assert_eq!(losses_to_fault(401), Some(5));
    assert_eq!(losses_to_fault(601), None);
}

#[test]
fn another_configuration_is_applied_and_the_same_one_is_not() {
    let narrow = Config { gyro_range: GyroRange::Dps250, accel_range: AccelRange::G2, low_pass: 6 };
    let again = [set_up_with(0x68, &[0, 6, 0, 0]), vec![sample(2)]].concat();
    let (mut imu, mut bus) = settled(&[checked([sample(1)]), again].concat());
    imu.configure(CONFIG);
    assert_eq!(poll(&mut imu), Some(reading(1)));
    imu.configure(narrow);
    assert_eq!(polls(&mut imu, SET_UP_TICKS + 1), 1);
    assert_eq!((imu.errors(), imu.fault()), (0, Fault::None));
    bus.done();
}

#[test]
fn the_configuration_is_that_of_the_settings() {
    let settings = Settings { gyro_range: GyroRange::Dps500, accel_range: AccelRange::G8, ..Settings::DEFAULT };
    assert_eq!(Config::from(&settings), CONFIG);
}
