//! A sensor that is not what it says.

use super::{Host, off_after, row, turning, until};
use crate::common::yaw_deg;
use protocol::units::{AccelRange, GyroRange};
use protocol::{Command, Fault, Refusal, Reply, Settings, Telemetry};
use virtual_nano::BoardOptions;
use virtual_nano::imu::source::{Source, Turntable};

fn is_of_imu(fault: Fault) -> bool {
    matches!(fault, Fault::ImuSilent | Fault::ImuBusStuck | Fault::ImuFrozen | Fault::ImuLostConfig)
}

/// Share of the frames that have a fresh reading.
fn fresh(frames: &[(u64, Telemetry)]) -> f64 {
    frames.iter().filter(|(_, frame)| frame.imu_fresh).count() as f64 / frames.len() as f64
}

#[test]
fn a_register_that_changes_is_put_right_within_a_second() {
    for (address, value) in [(0x19, 0x04), (0x1A, 0x06), (0x1B, 0x18), (0x1C, 0x18), (0x6B, 0x40)] {
        let mut host = Host::ready(BoardOptions::default());
        host.run_linked_ms(1000);
        let right = host.board.rig().imu.register(address);
        let errors = host.last().imu_errors;
        host.inject(&format!("register={address:#x},{value:#x}"));
        let put_right_s = until(&mut host, 3.0, |host| host.board.rig().imu.register(address) == right);
        host.run_linked_ms(300);
        let counted = host.last().imu_errors != errors;
        row(
            format!("register {address:#04x} changes to {value:#04x}"),
            format!("right after {:.2} s, counted: {counted}", put_right_s.unwrap_or(f64::NAN)),
            "1.1 s, counted",
        );
        assert!(put_right_s.is_some_and(|seconds| seconds <= 1.1), "{address:#x}: {put_right_s:?}");
        assert!(counted && host.last().imu_fresh && host.fault() == Fault::None, "{address:#x}: {:?}", host.last());
    }
}

#[test]
fn set_up_resets_the_sensor() {
    /// FIFO_EN, which the program does not use.
    const FIFO_EN: u8 = 0x23;
    let mut host = Host::new(BoardOptions::default());
    host.inject(&format!("register={FIFO_EN:#x},0x78"));
    host.hello();
    host.stream();
    host.run_ms(500);
    let (resets, value) = (host.board.rig().imu.count.resets, host.board.rig().imu.register(FIFO_EN));
    row("a register from before the start", format!("{resets} resets, reads {value:#04x}"), "reset, 0x00");
    assert!(resets >= 1 && value == 0 && host.last().imu_fresh);
}

#[test]
fn frozen_data_stop_the_motors_within_a_fifth_of_a_second() {
    let mut host = turning([40.0, -40.0]);
    host.inject("frozen");
    let off_s = off_after(&mut host, 2.0);
    host.run_linked_ms(20);
    row("frozen data", format!("{:?} after {:.3} s", host.fault(), off_s.unwrap_or(f64::NAN)), "0.2 s");
    assert!(off_s.is_some_and(|off_s| off_s <= 0.2) && is_of_imu(host.fault()), "{off_s:?}, {:?}", host.fault());
}

/// `tests/data/mpu6050/still-655s.csv`, 65,067 samples of a sensor that lies still, has no two in a row whose accelerometer
/// or gyroscope are equal, and none whose gyroscope is zero.
#[test]
fn data_that_no_sensor_reads_stop_the_motors_though_they_are_said_to_be_new() {
    for (fault, what) in [("repeats", "data repeated as new"), ("gyro-zero", "gyroscope zero")] {
        let mut host = turning([40.0, -40.0]);
        host.inject(fault);
        let off_s = off_after(&mut host, 2.0);
        host.run_linked_ms(20);
        row(what, format!("{:?} after {:.3} s", host.fault(), off_s.unwrap_or(f64::NAN)), "0.3 s");
        assert!(off_s.is_some_and(|off_s| off_s <= 0.3), "{fault}: {off_s:?}");
        // A new set-up does not help, and until it does the fault cannot be cleared.
        for _ in 0..20 {
            assert_eq!(
                (host.fault(), host.ask(Command::ClearFault)),
                (Fault::ImuFrozen, Reply::Refused(Refusal::Faulted))
            );
            host.run_linked_ms(33);
        }
        host.board.clear_faults();
        host.run_linked_ms(400);
        host.order(Command::ClearFault);
        host.run_linked_ms(400);
        assert!(host.last().imu_fresh && host.fault() == Fault::None, "{fault}: {:?}", host.last());
    }
}

/// The ranges and the filter with the least noise in counts.
#[test]
fn the_quietest_sensor_at_rest_is_no_fault() {
    let mut host = Host::ready(BoardOptions { source: Source::still(1), ..BoardOptions::default() });
    host.order(Command::WriteSettings(Settings {
        gyro_range: GyroRange::Dps2000,
        accel_range: AccelRange::G16,
        low_pass: 6,
        ..Settings::DEFAULT
    }));
    host.run_linked_ms(30_000);
    let share = fresh(&host.telemetry);
    row(
        "at rest for 30 s, 2000 deg/s, 16 g, 5 Hz",
        format!("{:?}, {:.1} % fresh", host.fault(), 100.0 * share),
        "no fault",
    );
    assert!(host.fault() == Fault::None && share >= 0.98, "{share}");
}

#[test]
fn an_oscillator_off_by_one_percent_is_no_fault() {
    for percent in [-1, 1] {
        let mut host = turning([40.0, -40.0]);
        host.inject(&format!("sensor-clock={percent}"));
        let errors = host.last().imu_errors;
        host.telemetry.clear();
        host.run_linked_ms(3000);
        let share = fresh(&host.telemetry);
        row(format!("sensor's clock {percent:+} %"), format!("{:.1} % fresh", 100.0 * share), "98 %, no errors");
        assert!(share >= 0.98 && host.fault() == Fault::None && host.last().imu_errors == errors);
    }
}

#[test]
fn clipping_is_counted() {
    let mut host = Host::ready(BoardOptions::default());
    host.run_linked_ms(500);
    assert_eq!(host.last().clipped.0, 0, "at rest");
    host.inject("spin=3000");
    host.run_linked_ms(500);
    let clipped = host.last().clipped.0;
    row("100 ticks beyond the range", format!("{clipped} counted"), "95 to 101");
    assert!((95..=101).contains(&clipped));
}

#[test]
fn a_slow_bus_is_read_more_slowly() {
    for us in [1.0, 2.0, 4.0] {
        let mut host = Host::new(BoardOptions::default());
        host.inject(&format!("bus-rise={us}"));
        host.hello();
        host.stream();
        host.run_linked_ms(1500);
        host.telemetry.clear();
        host.run_linked_ms(1000);
        let (share, worst) = (fresh(&host.telemetry), host.board.rig().marks.tick.worst);
        row(
            format!("SCL rises in {us} us"),
            format!("{:?}, {:.1} % fresh, worst tick {worst} cycles", host.fault(), 100.0 * share),
            "no fault, 99 % fresh",
        );
        assert!(share >= 0.99 && host.fault() == Fault::None, "{:?}", host.last());
        assert!(worst < crate::common::TICK, "a tick of {worst} cycles");
    }
}

#[test]
fn a_bus_that_turns_slow_is_read_more_slowly() {
    let mut host = turning([40.0, -40.0]);
    host.inject("bus-rise=2");
    host.run_linked_ms(1500);
    host.telemetry.clear();
    host.run_linked_ms(1000);
    let share = fresh(&host.telemetry);
    row("SCL rises in 2 us from now on", format!("{:?}, {:.1} % fresh", host.fault(), 100.0 * share), "99 % fresh");
    assert!(share >= 0.99, "{:?}", host.last());
}

#[test]
fn scale_and_axes_within_the_data_sheet_show_as_far_as_they_must() {
    let up = [0.0, 0.0, 1.0];
    for (fault, expected) in [("scale=0", 100.0), ("scale=3", 103.0), ("askew=2", 100.0)] {
        let source = Source::turntable(Turntable { up, dps: 100.0, swing_hz: 0.0, start_s: 0.5 }, 3);
        let mut host = Host::ready(BoardOptions { source, ..BoardOptions::default() });
        host.inject(fault);
        host.run_linked_ms(500);
        let before = yaw_deg(&host.last());
        host.run_linked_ms(1000);
        let turned = (yaw_deg(&host.last()) - before).rem_euclid(360.0);
        row(format!("{fault} at 100 deg/s"), format!("{turned:.2} deg in a second"), format!("{expected} +- 0.6"));
        assert!((turned - expected).abs() < 0.6, "{fault}: {turned}");
    }
}

/// A sensor that turns, and is gone for a while: the yaw is that of one that was there all the time, or the fault is named.
#[test]
fn a_gap_in_the_readings_is_bridged_or_named() {
    // The last one swings by 5 degrees at 90 rpm.
    for (dps, swing_hz) in [(100.0, 0.0), (20.0, 0.4), (47.1, 1.5)] {
        let turning = |gap_ms: u64| {
            let source = Source::turntable(Turntable { up: [0.0, 0.0, 1.0], dps, swing_hz, start_s: 0.5 }, 3);
            let mut host = Host::ready(BoardOptions { source, ..BoardOptions::default() });
            host.run_linked_ms(813);
            host.telemetry.clear();
            if gap_ms > 0 {
                host.inject("gone");
                host.run_linked_ms(gap_ms);
                host.board.clear_faults();
            }
            host.run_linked_ms(900 - gap_ms);
            host
        };
        let whole = yaw_deg(&turning(0).last());
        let gaps_ms =
            if swing_hz == 1.5 { [6, 17, 29, 43, 81, 100, 135, 310] } else { [5, 11, 20, 50, 120, 190, 210, 400] };
        for gap_ms in gaps_ms {
            let host = turning(gap_ms);
            let error = (yaw_deg(&host.last()) - whole + 540.0).rem_euclid(360.0) - 180.0;
            let missing = host.telemetry.iter().filter(|(_, frame)| !frame.imu_fresh).count();
            row(
                format!("sensor gone for {gap_ms} ms at {dps} deg/s, {swing_hz} Hz"),
                format!("yaw {error:+.3} deg off, {missing} ticks without a reading, {:?}", host.fault()),
                "0.05 deg, or a fault",
            );
            assert!(error.abs() <= 0.05 || is_of_imu(host.fault()), "{gap_ms} ms: {error} deg, {:?}", host.fault());
        }
    }
}
