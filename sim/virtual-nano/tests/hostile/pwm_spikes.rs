//! Leads of motors and encoders in one cable: each edge of the PWM is a spike on the encoder lines.
//!
//! `SPIKES_WHOLE=1 cargo test --release -p virtual-nano --test all pwm_spikes -- --nocapture` prints the whole table.

use super::{Host, row, turning};
use protocol::{Command, Fault};
use virtual_nano::BoardOptions;

/// How a run with spikes went, for the worse of both motors.
struct Run {
    /// Errors of the mean speed that is told, of the true mean speed, and of the position, as fractions.
    told: f64,
    turned: f64,
    position: f64,
    fault: Fault,
    glitches_hz: f64,
}

impl Run {
    /// Speeds within 1 %, positions within 0.5 %.
    fn is_right(&self) -> bool {
        self.told < 0.01 && self.turned < 0.01 && self.position < 0.005
    }

    /// Returns whether the fault names an encoder and its cable.
    fn names_the_cable(&self) -> bool {
        matches!(self.fault, Fault::Encoder1Noisy | Fault::Encoder2Noisy)
    }
}

fn run(width_us: f64, rpm: f64, (cables, channel): (u8, u8), ms: u64) -> Run {
    let rpm = [rpm, -0.8 * rpm];
    let mut host = Host::ready(BoardOptions::default());
    host.inject(&format!("pwm-spikes={width_us},{cables},{channel}"));
    host.set_speeds(rpm);
    host.run_linked_ms(2000);
    let begin = host.last();
    let counts = |host: &Host| host.board.rig().motors.each_ref().map(|motor| motor.counts / 2.0);
    let (from, first) = (counts(&host), host.telemetry.len());
    host.run_linked_ms(ms);
    let (end, to) = (host.last(), counts(&host));
    let frames = &host.telemetry[first..];
    // The count wraps.
    let glitches: u32 =
        frames.windows(2).map(|pair| u32::from(pair[1].1.glitches.0.wrapping_sub(pair[0].1.glitches.0))).sum();
    let mut run = Run {
        told: 0.0,
        turned: 0.0,
        position: 0.0,
        fault: end.fault,
        glitches_hz: 1e3 * f64::from(glitches) / ms as f64,
    };
    for motor in 0..2 {
        let told = frames.iter().map(|(_, frame)| frame.speed[motor].rpm()).sum::<f64>() / frames.len() as f64;
        let truth = (to[motor] - from[motor]) / 602.22 * 60e3 / ms as f64;
        let counted = f64::from(end.encoder[motor].0.wrapping_sub(begin.encoder[motor].0));
        run.told = run.told.max((told / rpm[motor] - 1.0).abs());
        run.turned = run.turned.max((truth / rpm[motor] - 1.0).abs());
        run.position = run.position.max((counted / (to[motor] - from[motor]) - 1.0).abs());
    }
    run
}

/// The board reads its encoders when spikes of up to 56 us are over. Longer ones make edges of their own.
#[test]
fn pwm_spikes_are_right_up_to_the_longest_that_the_board_knows_and_longer_ones_are_a_fault() {
    for (width_us, rpm, cable) in
        [(30.0, 51.3, (2, 2)), (45.0, 17.3, (2, 2)), (55.0, 61.9, (1, 0)), (70.0, 43.7, (1, 0))]
    {
        let run = run(width_us, rpm, cable, 3000);
        row(
            format!("PWM spikes of {width_us} us, cables and channels {cable:?}, {rpm} rpm"),
            format!(
                "{:?}, off by: speed {:.2} %, position {:.2} %",
                run.fault,
                100.0 * run.turned,
                100.0 * run.position
            ),
            "1 %, 0.5 %, or a fault",
        );
        let is_failed = matches!(run.fault, Fault::Encoder1Failed | Fault::Encoder2Failed);
        assert_eq!((run.fault == Fault::None && run.is_right(), is_failed), (width_us < 60.0, width_us > 60.0));
    }
}

/// Each reversal changes the compare values by much, and turns the direction of edges that are far apart.
#[test]
fn pwm_spikes_leave_speed_and_position_right_while_the_motors_turn_round() {
    for (width_us, cable) in [(10.0, (1, 1)), (45.0, (1, 0))] {
        let mut host = Host::ready(BoardOptions::default());
        host.inject(&format!("pwm-spikes={width_us},{},{}", cable.0, cable.1));
        let shafts = |host: &Host| host.board.rig().motors.each_ref().map(|motor| (motor.counts / 2.0).round());
        let (begin, from) = (host.last(), shafts(&host));
        let mut worst: f64 = 0.0;
        for turn in 0..20 {
            host.set_speeds([[37.3, -61.7], [-61.7, 37.3]][turn % 2]);
            for _ in 0..58 {
                host.run_linked_ms(5);
                for (motor, told) in host.board.rig().motors.iter().zip(host.last().speed) {
                    worst = worst.max((told.rpm() - motor.speed_rpm).abs());
                }
            }
        }
        host.order(Command::Stop);
        host.run_linked_ms(1300);
        let (end, to) = (host.last(), shafts(&host));
        let off = [0, 1].map(|k| f64::from(end.encoder[k].0.wrapping_sub(begin.encoder[k].0)) - (to[k] - from[k]));
        row(
            format!("PWM spikes of {width_us} us, cables and channels {cable:?}, 20 reversals in 6 s"),
            format!("{:?}, told within {worst:.1} rpm, positions off by {off:?} counts", end.fault),
            "20 rpm (two edges), 1 count",
        );
        assert_eq!(end.fault, Fault::None);
        assert!(worst < 20.0 && off.iter().all(|counts| counts.abs() <= 1.0), "{worst} rpm, {off:?} counts");
    }
}

/// An edge of the PWM follows a random spike within some microseconds several times a second.
#[test]
fn random_spikes_among_pwm_spikes_do_not_change_the_speed() {
    let rpm = [7.7, -13.3];
    let mut host = turning(rpm);
    for fault in ["pwm-spikes=20,1", "spikes=300,1,1", "spikes=300,2,1"] {
        host.inject(fault);
    }
    let first = host.telemetry.len();
    host.run_linked_ms(8000);
    let told = host.telemetry[first..].iter().flat_map(|(_, frame)| [0, 1].map(|k| frame.speed[k].rpm() - rpm[k]));
    let worst = told.map(f64::abs).fold(0.0, f64::max);
    row(
        "PWM spikes of 20 us and 300 spikes/s, 8 s",
        format!("{:?}, told within {worst:.2} rpm", host.fault()),
        "1 rpm",
    );
    assert_eq!(host.fault(), Fault::None);
    assert!(worst < 1.0, "{worst} rpm");
}

#[test]
fn pwm_spikes_leave_speed_and_position_right_or_are_a_fault() {
    let whole = std::env::var_os("SPIKES_WHOLE").is_some();
    let mut cases = vec![(2.0, 90.0, (1, 0)), (10.0, 90.0, (2, 0)), (10.0, 30.0, (1, 2)), (20.0, 50.0, (1, 0))];
    if whole {
        cases.clear();
        for cable in [(1, 0), (2, 0), (1, 1), (1, 2)] {
            for width_us in [2.0, 5.0, 10.0, 20.0] {
                cases.extend([10.0, 30.0, 50.0, 70.0, 90.0].map(|rpm| (width_us, rpm, cable)));
            }
        }
    }
    let mut wrong = Vec::new();
    for (width_us, rpm, (cables, channel)) in cases {
        let run = run(width_us, rpm, (cables, channel), if whole { 10_000 } else { 3000 });
        let what = {
            let cable = if cables == 1 { "one cable for all" } else { "a cable each" };
            let lines = ["C1 and C2", "C1", "C2"][usize::from(channel)];
            format!("PWM spikes of {width_us} us on {lines}, {cable}, {rpm} rpm")
        };
        let percent = |x: f64| 100.0 * x;
        row(
            &what,
            format!(
                "{:?}, off by: speed {:.2} %, told speed {:.2} %, position {:.2} %; {:.0} glitches/s",
                run.fault,
                percent(run.turned),
                percent(run.told),
                percent(run.position),
                run.glitches_hz
            ),
            if width_us == 2.0 { "1 %, 1 %, 0.5 %" } else { "1 %, 1 %, 0.5 %, or a fault" },
        );
        let holds = if run.fault == Fault::None { run.is_right() } else { width_us > 2.0 && run.names_the_cable() };
        if !holds {
            wrong.push(what);
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}
