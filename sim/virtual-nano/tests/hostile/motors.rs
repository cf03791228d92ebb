//! Motors that must not run away, burn, or turn where nobody looks.

use super::{Host, off_after, row, stops, turning, watch};
use protocol::units::Duty;
use protocol::{Command, Fault};
use virtual_nano::BoardOptions;
use virtual_nano::bridge::Drive;
use virtual_nano::motor::MotorParameters;
use virtual_nano::rig::RigKind;

const RUNAWAY: [[Fault; 1]; 2] = [[Fault::Motor1Runaway], [Fault::Motor2Runaway]];
/// Of a motor that had reached its speed: nothing tells a blocked rotor from a lost encoder.
const BLOCKED: [[Fault; 1]; 2] = [[Fault::Encoder1Failed], [Fault::Encoder2Failed]];

/// Speed of the motors at full voltage.
const NO_LOAD_RPM: f64 = 130.0;

/// A board with a fault from its start, that is asked to turn both flagella.
fn asked_with(fault: &str, rpm: [f64; 2]) -> Host {
    let mut host = Host::ready(BoardOptions::default());
    host.inject(fault);
    host.set_speeds(rpm);
    // The first tick of control comes first.
    host.run_linked_ms(10);
    host
}

#[test]
fn swapped_encoder_leads_are_a_runaway() {
    for (motor, faults) in RUNAWAY.iter().enumerate() {
        for rpm in [20.0, -90.0] {
            let mut host = asked_with(&format!("encoder-swapped={}", motor + 1), [rpm; 2]);
            let what = format!("encoder {} swapped, {rpm} rpm asked", motor + 1);
            stops(&mut host, &what, 0.3, faults);
        }
    }
    let mut host = turning([20.0, 20.0]);
    host.inject("encoder-swapped=1");
    stops(&mut host, "encoder 1 swapped at 20 rpm", 0.3, &RUNAWAY[0]);
}

#[test]
fn a_motor_with_its_leads_swapped_is_a_runaway() {
    let mut host = asked_with("motor-reversed=2", [20.0, 20.0]);
    stops(&mut host, "motor 2 reversed, 20 rpm asked", 0.3, &RUNAWAY[1]);
}

#[test]
fn a_blocked_rotor_stops_within_a_second_of_a_duty_that_would_turn_it() {
    /// Settings::moving_duty.
    const MOVES: u8 = 100;
    for fault in ["blocked=1", "slips=1"] {
        for rpm in [10.0, 20.0, -50.0, 90.0] {
            let mut host = asked_with(fault, [rpm, 0.0]);
            let begin_s = host.board.seconds();
            while host.board.rig().bridge.pwm[0] < MOVES && host.board.rig().bridge.pwm[0] > 0 {
                host.run_linked_ms(1);
            }
            let ramp_s = host.board.seconds() - begin_s;
            let what = format!("{fault}, {rpm} rpm asked ({ramp_s:.1} s to a duty of {MOVES})");
            stops(&mut host, &what, 1.05, &[Fault::Motor1Stalled, Fault::Motor1Overloaded]);
        }
    }
    for (motor, faults) in BLOCKED.iter().enumerate() {
        let mut host = turning([50.0, 50.0]);
        host.inject(&format!("blocked={}", motor + 1));
        stops(&mut host, &format!("motor {} blocked at 50 rpm", motor + 1), 0.2, faults);
    }
}

#[test]
fn a_rotor_that_is_blocked_below_that_duty_does_not_burn() {
    // 2 rpm: the duty rises by 10 a second.
    let mut host = asked_with("blocked=1", [2.0, 0.0]);
    let off_s = off_after(&mut host, 20.0);
    host.run_linked_ms(20);
    row("blocked, 2 rpm asked", format!("{:?} after {:.1} s", host.fault(), off_s.unwrap_or(f64::NAN)), "within 12 s");
    assert!(off_s.is_some_and(|off_s| off_s < 12.0));
    assert!([Fault::Motor1Stalled, Fault::Motor1Overloaded].contains(&host.fault()), "{:?}", host.fault());
}

/// The current of a blocked motor heats as its duty squared: a third of it may last, and the guard allows 2.4 s of all.
#[test]
fn a_blocked_motor_that_is_driven_again_and_again_does_not_burn() {
    const SECONDS: u64 = 30;
    let mut host = Host::ready(BoardOptions::default());
    host.inject("blocked=2");
    let (mut on_ms, mut named) = (0, false);
    for ms in 0..1000 * SECONDS {
        if ms % 5 == 0 {
            // A host that clears what stops it and does not look. Both are refused while the motor is on or hot.
            host.send(Command::ClearFault);
            host.send(Command::Drive { duty: [Duty(0), Duty(-255)], duration_ms: 2000 });
        }
        host.run_ms(1);
        on_ms += u64::from(host.board.rig().bridge.pwm[1] > 0);
        named |= host.fault() == Fault::Motor2Overloaded;
    }
    // A third of the current is a ninth of the heat.
    let allowed_s = 2.4 + SECONDS as f64 / 9.0;
    let on_s = on_ms as f64 * 1e-3;
    row(
        format!("blocked, driven at full duty again and again for {SECONDS} s"),
        format!("on for {on_s:.1} s, overload told: {named}"),
        format!("{:.1} s, told", 1.1 * allowed_s),
    );
    assert!(on_s < 1.1 * allowed_s && named, "on for {on_s} s");
}

/// The guard estimates the current by the published motor's speed without load, which must not overload a faster one.
/// `FREE_WHOLE=1 cargo test --release -p virtual-nano --test all free_motors -- --nocapture` runs 10 minutes of each.
#[test]
fn free_motors_of_any_kind_have_no_fault() {
    let mut runs = vec![
        (130.0, [2.0, -90.0], 12),
        (260.0, [-2.0, 40.0], 12),
        (320.0, [90.0, -61.3], 40),
        (500.0, [2.0, -15.0], 12),
        (500.0, [90.0, -5.0], 12),
    ];
    if std::env::var_os("FREE_WHOLE").is_some() {
        let speeds = [[2.0, -90.0], [-5.0, 70.0], [15.0, -40.0]];
        runs = [130.0, 260.0, 320.0, 500.0].into_iter().flat_map(|motor| speeds.map(|rpm| (motor, rpm, 600))).collect();
    }
    let free = |(no_load_rpm, rpm, s): (f64, [f64; 2], u64)| {
        let motors = [MotorParameters { no_load_rpm, ..MotorParameters::PUBLISHED }; 2];
        let rig = RigKind { motors, ..RigKind::default() };
        let mut host = Host::ready(BoardOptions { rig, ..BoardOptions::default() });
        host.set_speeds(rpm);
        host.run_linked_ms(1000 * s);
        row(
            format!("{no_load_rpm} rpm without load, {rpm:?} rpm for {s} s"),
            format!("{:?}", host.fault()),
            "no fault",
        );
        assert_eq!(host.fault(), Fault::None, "{no_load_rpm} rpm without load, {rpm:?} rpm");
    };
    std::thread::scope(|scope| {
        for half in [0, 1] {
            let runs = &runs;
            scope.spawn(move || runs.iter().skip(half).step_by(2).for_each(|run| free(*run)));
        }
    });
}

#[test]
fn without_the_motors_supply_nothing_is_driven_for_long() {
    let mut host = turning([50.0, -50.0]);
    host.inject("motor-supply-off");
    stops(&mut host, "6 V off at 50 rpm", 1.5, BLOCKED.as_flattened());
}

#[test]
fn swapped_motors_stop_each_other() {
    let mut host = asked_with("motors-swapped", [50.0, 0.0]);
    stops(&mut host, "motors swapped, 50 and 0 rpm asked", 1.5, &[Fault::Motor1Stalled, Fault::Motor2Runaway]);
}

#[test]
fn a_gear_that_sticks_is_no_fault_and_turns_in_the_end() {
    let mut host = asked_with("stiction=25", [30.0, 0.0]);
    host.run_linked_ms(3000);
    let speeds = watch(&mut host, 0, 30.0, 2000);
    row("gear sticks below 25 % of full voltage, 30 rpm asked", format!("{:.2} rpm", speeds.mean), "30 +- 1 rpm");
    assert!((speeds.mean - 30.0).abs() < 1.0 && host.fault() == Fault::None, "{:?}", host.fault());
}

#[test]
fn a_gear_that_shakes_the_sensor_is_no_fault() {
    let mut host = asked_with("shaking=1", [60.0, 0.0]);
    host.run_linked_ms(3000);
    let first = host.telemetry.len();
    let speeds = watch(&mut host, 0, 60.0, 2000);
    let z_dps = host.telemetry[first..].iter().map(|(_, frame)| f64::from(frame.gyro[2].0) / 131.0);
    let shaking_dps = (z_dps.map(|dps| dps * dps).sum::<f64>() / (host.telemetry.len() - first) as f64).sqrt();
    let speed = format!("{:.2} rpm, the gyroscope reads {shaking_dps:.1} deg/s", speeds.mean);
    row("gears shake the sensor, 60 rpm asked", speed, "60 +- 1 rpm, 1.7 deg/s");
    assert!((speeds.mean - 60.0).abs() < 1.0 && host.fault() == Fault::None, "{:?}", host.fault());
    // Six multiples of 1 deg/s, and what the sensor is off.
    assert!((1.2..3.0).contains(&shaking_dps), "{shaking_dps} deg/s");
}

#[test]
fn a_reversal_is_no_fault() {
    for [from, to] in [[60.0, -60.0], [90.0, -90.0], [-90.0, 20.0], [90.0, 0.0]] {
        let mut host = turning([from, -from]);
        host.set_speeds([to, -to]);
        let mut current: f64 = 0.0;
        for _ in 0..2500 {
            host.run_linked_ms(1);
            // Both motors have the same.
            if let Drive::Voltage(fraction) = host.board.rig().bridge.drive[0] {
                current = current.max((fraction - host.board.rig().motors[0].speed_rpm / NO_LOAD_RPM).abs());
            }
        }
        let speeds = host.board.rig().motors.each_ref().map(|motor| motor.speed_rpm);
        row(
            format!("from {from} to {to} rpm at once"),
            format!(
                "{:?}, {:.1} and {:.1} rpm, at most {:.0} % of the current of a blocked motor",
                host.fault(),
                speeds[0],
                speeds[1],
                100.0 * current
            ),
            "no fault, within 1 rpm",
        );
        assert_eq!(host.fault(), Fault::None, "from {from} to {to} rpm");
        assert!((speeds[0] - to).abs() < 1.0 && (speeds[1] + to).abs() < 1.0, "{speeds:?}");
    }
}

#[test]
fn the_bridge_gets_its_pwm_at_977_hz() {
    let host = turning([50.0, 50.0]);
    let [a, b] = host.board.rig().bridge.pwm_hz;
    row("PWM", format!("{a:.1} and {b:.1} Hz"), "977 Hz, of the bridge's 100 kHz at most");
    assert!([a, b].iter().all(|hz| (hz - 976.5625).abs() < 1.0));
}
