//! The sensor as the real program reads it: recordings arrive unchanged, clones are named, and every fault at every byte
//! of every transaction is noticed, reported, and got over or latched.

use crate::common::{Host, TICK, TICK_BUDGET, yaw_deg};
use protocol::units::{AccelRange, SensorCounts};
use protocol::{Command, Fault, Settings, Telemetry};
use std::path::Path;
use virtual_nano::BoardOptions;
use virtual_nano::imu::fault::{At, Data, Fault as ImuFault};
use virtual_nano::imu::recording::Recording;
use virtual_nano::imu::source::{Source, Turntable};

#[test]
fn a_recording_arrives_unchanged() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/mpu6050/rotate-z-720.csv");
    let recording = Recording::read(&path).unwrap();
    let source = Source::recording(recording.clone(), 1);
    let mut host = Host::ready(BoardOptions { source, ..BoardOptions::default() });
    host.order(Command::WriteSettings(Settings { accel_range: AccelRange::G8, ..Settings::DEFAULT }));
    host.run_ms(500);
    host.board.change_imu(|imu| imu.source.play()).unwrap();
    host.telemetry.clear();
    host.run_ms(5000);
    // The first frame of the recording shows when it began; from there on every tick has its sample of it.
    let counts = |values: [SensorCounts; 3]| values.map(|value| f64::from(value.0));
    let begin = host.telemetry.iter().position(|(_, t)| counts(t.gyro) == recording.at(0.0).gyro).unwrap();
    let since = host.telemetry[begin].1.time;
    let mut exact = 0;
    for (_, telemetry) in &host.telemetry[begin..] {
        let seconds = f64::from(telemetry.time.since(since)) * 1e-6;
        // A sample may change within the time between the tick's beginning and the burst.
        let near = [-0.0025, 0.0, 0.0025, 0.005].map(|shift| recording.at(seconds + shift));
        exact += usize::from(near.iter().any(|sample| {
            let close = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() <= 40.0);
            close(counts(telemetry.gyro), sample.gyro) && close(counts(telemetry.accel), sample.accel)
        }));
    }
    let total = host.telemetry.len() - begin;
    println!("recording: {exact} of {total} frames hold the recording's sample of their time");
    assert!(total > 950 && exact * 100 >= total * 97, "{exact} of {total}");
}

#[test]
fn clones_are_named_and_used() {
    for imu_id in [0x68, 0x70, 0x71, 0x72, 0x98] {
        let mut host = Host::ready(BoardOptions { imu_id, ..BoardOptions::default() });
        assert_eq!(host.hello().imu_id, imu_id);
        assert!(host.last().imu_fresh && host.fault() == Fault::None, "{imu_id:#x}: {:?}", host.last());
    }
}

/// A fault at a byte, how it is called, and what it must lead to.
struct Case {
    name: &'static str,
    fault: fn(At) -> ImuFault,
    /// The sensor is well again afterwards.
    passes: bool,
}

const CASES: [Case; 6] = [
    Case { name: "no acknowledgement once", fault: |at| ImuFault::Nack { at, count: 1 }, passes: true },
    Case { name: "no acknowledgement at all", fault: |at| ImuFault::Nack { at, count: u32::MAX }, passes: false },
    Case { name: "no answer any more", fault: ImuFault::Gone, passes: false },
    Case { name: "SDA stuck for 9 clocks", fault: |at| ImuFault::Stuck { at, clocks: Some(9) }, passes: true },
    Case { name: "SDA stuck for ever", fault: |at| ImuFault::Stuck { at, clocks: None }, passes: false },
    Case { name: "supply lost for a moment", fault: ImuFault::GlitchAt, passes: true },
];

fn is_of_imu(fault: Fault) -> bool {
    matches!(fault, Fault::ImuSilent | Fault::ImuBusStuck)
}

/// What a fault leads to must be what its case says. `what` names fault and byte.
fn check(host: &Host, case: &Case, what: &str) {
    if case.passes {
        let telemetry = host.telemetry.iter().rev().take(20);
        assert!(telemetry.clone().all(|(_, telemetry)| telemetry.imu_fresh), "{what}: not got over, {:?}", host.last());
        assert_eq!(host.fault(), Fault::None, "{what}: a passing fault is latched");
    } else {
        assert!(is_of_imu(host.fault()), "{what}: {:?}", host.fault());
        assert_eq!(host.board.rig().bridge.pwm, [0, 0], "{what}: motors on");
    }
}

#[test]
fn every_fault_at_every_byte_of_set_up_is_got_over_or_latched() {
    /// Set-up and the first readings.
    const TRANSACTIONS: u64 = 10;
    let mut struck = 0;
    let mut worst = 0;
    for case in &CASES {
        for transaction in 1..=TRANSACTIONS {
            for byte in 0.. {
                let at = At { transaction: Some(transaction), byte };
                let mut host = Host::new(BoardOptions::default());
                host.board.change_imu(|imu| imu.inject((case.fault)(at)));
                // The reset in set-up alone takes 100 ms.
                host.run_ms(300);
                if host.board.rig().imu.count.faults == 0 {
                    break;
                }
                host.hello();
                host.stream();
                host.run_linked_ms(400);
                check(&host, case, &format!("{} at byte {byte} of transaction {transaction}", case.name));
                worst = worst.max(host.board.rig().marks.tick.worst);
                struck += 1;
            }
        }
    }
    println!("set-up: {struck} faults, worst tick {worst} cycles of {TICK_BUDGET}");
    assert!(struck >= 150, "only {struck} faults struck");
    assert!(worst <= TICK_BUDGET, "a tick of {worst} cycles");
}

#[test]
fn every_fault_at_every_byte_of_a_burst_is_counted_and_got_over_or_latched() {
    /// Two addresses, a register, the status, fourteen data, and the byte after them.
    const BURST: u8 = 19;
    let mut struck = 0;
    let mut worst = 0;
    for case in &CASES {
        for byte in 0..BURST {
            let what = format!("{} at byte {byte} of a burst", case.name);
            let mut host = Host::ready(BoardOptions::default());
            host.set_speeds([40.0, -40.0]);
            host.run_linked_ms(50);
            assert_eq!(host.fault(), Fault::None);
            let errors = host.last().imu_errors;
            host.board.change_imu(|imu| imu.inject((case.fault)(At::byte(byte))));
            host.run_linked_ms(400);
            if host.board.rig().imu.count.faults == 0 {
                assert!(case.name.starts_with("no acknowledgement") && byte > 2, "{what}: does not strike");
                continue;
            }
            assert_ne!(host.last().imu_errors, errors, "{what}: not counted");
            check(&host, case, &what);
            if !case.passes {
                host.board.change_imu(|imu| imu.clear_faults());
                host.run_linked_ms(400);
                host.order(Command::ClearFault);
                host.run_linked_ms(20);
                assert!(host.last().imu_fresh && host.fault() == Fault::None, "{what}: does not come back");
            }
            worst = worst.max(host.board.rig().marks.tick.worst);
            struck += 1;
        }
    }
    println!("burst: {struck} faults, worst tick {worst} cycles of {TICK_BUDGET}");
    assert_eq!(struck, 2 * 3 + 4 * usize::from(BURST));
    assert!(worst <= TICK_BUDGET, "a tick of {worst} cycles");
}

#[test]
fn frozen_data_stop_the_motors() {
    let mut host = Host::ready(BoardOptions::default());
    host.set_speeds([40.0, -40.0]);
    host.run_linked_ms(300);
    host.board.change_imu(|imu| imu.inject(ImuFault::Data(Data::Frozen)));
    host.run_linked_ms(400);
    assert_eq!((host.fault(), host.board.rig().bridge.pwm), (Fault::ImuFrozen, [0, 0]));
    host.board.change_imu(|imu| imu.clear_faults());
    host.run_linked_ms(400);
    host.order(Command::ClearFault);
    host.run_linked_ms(50);
    assert_eq!(host.fault(), Fault::None);
}

#[test]
fn another_id_in_mid_run_changes_nothing_until_the_next_start() {
    const WHO_AM_I: u8 = 0x75;
    let mut host = Host::ready(BoardOptions::default());
    host.board.change_imu(|imu| {
        imu.id = 0x70;
        imu.set_register_behind(WHO_AM_I, 0x70);
    });
    host.run_linked_ms(200);
    assert_eq!(host.fault(), Fault::None);
    host.reset();
    assert_eq!(host.hello().imu_id, 0x70);
}

/// The board's clock rules the attitude, not the sensor's: a slower sensor has no new sample in one tick of a hundred, and a
/// faster one replaces one sample of a hundred before it is read.
#[test]
fn the_angle_does_not_depend_on_the_sensors_oscillator() {
    const DPS: f64 = 30.0;
    for error in [-0.01, 0.0, 0.01] {
        let source = Source::turntable(Turntable { up: [0.0, 0.0, 1.0], dps: DPS, swing_hz: 0.0, start_s: 0.5 }, 3);
        let mut host = Host::ready(BoardOptions { source, ..BoardOptions::default() });
        host.board.change_imu(|imu| imu.oscillator_error = error);
        host.run_linked_ms(1000);
        host.telemetry.clear();
        host.run_linked_ms(6000);
        let ends = [host.telemetry[0].1, host.last()];
        let [from, to] = ends.map(|frame| yaw_deg(&frame));
        let turned = (to - from).rem_euclid(360.0);
        let expected = DPS * f64::from(ends[1].time.since(ends[0].time)) * 1e-6;
        println!("oscillator {:+} %: {turned:.3} of {expected:.3} deg", 100.0 * error);
        assert!((turned - expected).abs() < 0.1, "{error}: {turned} of {expected}");
        assert_eq!((host.last().imu_errors.0, host.fault()), (0, Fault::None));
    }
}

/// As often as samples would be read twice, or never, if the sensor took 200 in a second.
#[test]
fn a_swing_of_the_sensor_is_no_turn() {
    // The last is the worst that the age of a sample, up to 1 ms, can do. It is a sawtooth as fast as the swing, with a
    // fundamental of 1 ms / pi: with the swing's 283 deg/s^2, half of their product is a turn of 0.27 deg in 6 s.
    for (error, swing_hz, most_deg) in
        [(-0.0075, 1.5, 0.05), (0.0075, 1.5, 0.05), (-0.01, 2.0, 0.05), (-0.0015, 1.5, 0.27)]
    {
        let table = Turntable { up: [0.0, 0.0, 1.0], dps: 30.0, swing_hz, start_s: 0.5 };
        let mut host = Host::ready(BoardOptions { source: Source::turntable(table, 3), ..BoardOptions::default() });
        host.board.change_imu(|imu| imu.oscillator_error = error);
        host.run_linked_ms(1000);
        host.telemetry.clear();
        host.run_linked_ms(12_000);
        let whole = host.telemetry.len() / 2400 * 2400;
        let half = whole / 2;
        let mean = |frames: &[(u64, Telemetry)]| {
            frames.iter().map(|(_, frame)| yaw_deg(frame)).sum::<f64>() / frames.len() as f64
        };
        let turned = mean(&host.telemetry[half..whole]) - mean(&host.telemetry[..half]);
        println!("oscillator {:+} %, swing of {swing_hz} Hz: {turned:.3} deg in 6 s", 100.0 * error);
        assert!(turned.abs() < most_deg, "{error}: {turned} deg");
    }
}

#[test]
fn bus_errors_in_a_row_halve_the_speed_until_the_next_start() {
    /// The register TWBR; SCL runs at 16 MHz / (16 + 2 TWBR).
    const TWBR: u16 = 0xB8;
    const KHZ_400: u8 = 12;
    const KHZ_200: u8 = 32;
    let mut host = Host::ready(BoardOptions::default());
    // Each tick's frame is there before the next tick reads the sensor.
    let next_frame = |host: &mut Host| {
        let frames = host.telemetry.len();
        while host.telemetry.len() == frames {
            host.run_until(host.board.cycle() + TICK / 50);
        }
    };
    next_frame(&mut host);
    for (errors, twbr) in [(1, KHZ_400), (2, KHZ_400), (3, KHZ_400), (4, KHZ_200), (5, KHZ_200)] {
        host.board.change_imu(|imu| imu.inject(ImuFault::Stuck { at: At::byte(5), clocks: Some(3) }));
        next_frame(&mut host);
        assert_eq!((host.last().imu_errors.0, host.board.mcu.peek(TWBR)), (errors, twbr));
    }
    host.telemetry.clear();
    host.run_ms(1000);
    assert!(host.telemetry[1..].iter().all(|(_, telemetry)| telemetry.imu_fresh));
    assert_eq!((host.last().imu_errors.0, host.fault(), host.board.mcu.peek(TWBR)), (5, Fault::None, KHZ_200));
    host.reset();
    host.hello();
    assert_eq!(host.board.mcu.peek(TWBR), KHZ_400);
}

/// A lower speed frees no line that is held.
#[test]
fn a_stuck_bus_keeps_its_speed() {
    let mut host = Host::ready(BoardOptions::default());
    host.board.change_imu(|imu| imu.inject(ImuFault::Stuck { at: At::byte(5), clocks: None }));
    host.run_ms(500);
    assert_eq!((host.fault(), host.board.mcu.peek(0xB8)), (Fault::ImuBusStuck, 12));
}
