//! Speed control on the modelled motors and encoders, and a motor that does not turn.

use crate::common::Host;
use protocol::{Command, Fault};
use virtual_nano::BoardOptions;
use virtual_nano::motor::Rotor;

#[test]
fn speeds_settle_at_their_targets_either_way_round() {
    /// How far the true speed may be from the target once settled, rpm.
    const TOLERANCE_RPM: f64 = 1.5;
    println!("target rpm: settling time s, then largest error in the last second, rpm (true speed, and measured)");
    for rpm in [10.0, 20.0, 45.0, 70.0, 90.0, -10.0, -30.0, -60.0, -90.0] {
        let mut host = Host::ready(BoardOptions::default());
        host.set_speeds([rpm, -rpm]);
        let mut settled_s = 0.0;
        let (mut ripple, mut measured): (f64, f64) = (0.0, 0.0);
        for step in 0..800 {
            if step % 10 == 0 {
                host.send(Command::Ping);
            }
            host.run_ms(5);
            let seconds = f64::from(step) * 0.005;
            let error = host.board.rig().motors[0].speed_rpm - rpm;
            if error.abs() > TOLERANCE_RPM {
                settled_s = seconds;
            }
            if seconds > 3.0 {
                let other = host.board.rig().motors[1].speed_rpm + rpm;
                ripple = ripple.max(error.abs()).max(other.abs());
                measured = measured.max((host.last().speed[0].rpm() - rpm).abs());
            }
        }
        println!("{rpm:6.1}: {settled_s:.2}, {ripple:.2}, {measured:.2}");
        assert!(settled_s < 2.0, "{rpm} rpm settles after {settled_s} s");
        assert!(ripple < 1.0 && measured < 1.5, "{rpm} rpm: off by {ripple}, measured {measured}");
        assert_eq!(host.fault(), Fault::None);
        let counts = host.last().encoder.map(|counts| f64::from(counts.0));
        // The board counts two edges of four.
        let truth = host.board.rig().motors.each_ref().map(|motor| motor.encoder_counts() as f64 / 2.0);
        for (counts, truth) in counts.into_iter().zip(truth) {
            assert!((counts - truth).abs() < 20.0, "{counts} edges of {truth}");
        }
    }
}

#[test]
fn a_blocked_motor_is_a_fault_of_that_motor() {
    for (motor, fault) in [(0, Fault::Encoder1Failed), (1, Fault::Encoder2Failed)] {
        let mut host = Host::ready(BoardOptions::default());
        host.set_speeds([50.0, 50.0]);
        host.run_linked_ms(1500);
        assert_eq!(host.fault(), Fault::None);
        host.board.rig_mut().motors[motor].hold(Rotor::Blocked);
        let blocked = host.board.cycle();
        while host.fault() == Fault::None {
            host.run_linked_ms(50);
            assert!(host.board.cycle() - blocked < 6 * 16_000_000, "a stall goes unnoticed");
        }
        println!(
            "motor {} blocked at 50 rpm: fault after {:.2} s",
            motor + 1,
            (host.board.cycle() - blocked) as f64 / 16e6
        );
        assert_eq!(host.fault(), fault);
        assert_eq!(host.board.rig().bridge.pwm, [0, 0]);
        host.board.rig_mut().motors[motor].hold(Rotor::Free);
        host.order(Command::ClearFault);
        host.set_speeds([50.0, 50.0]);
        host.run_linked_ms(1500);
        assert_eq!(host.fault(), Fault::None);
    }
}
