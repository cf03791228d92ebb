//! Loss of power at random moments of turns and rests: the shafts' positions are then right, or not known.

use super::row;
use crate::common::{Host, MS};
use protocol::units::{CentiRpm, Duty, EncoderCounts};
use protocol::{Command, Info};
use virtual_nano::BoardOptions;
use virtual_nano::imu::noise::Noise;

/// Largest difference between a position that is told and that of the shaft, counts: the place of the mark between two edges,
/// that of the shaft between two edges, and half an edge between directions.
const WITHIN: f64 = 1.5;

fn shafts(host: &Host) -> [f64; 2] {
    // The board counts two edges of four.
    host.board.rig().motors.each_ref().map(|motor| motor.counts / 2.0)
}

/// Something that turns a shaft, or does not.
fn order(host: &mut Host, random: &mut Noise) {
    let mut speed = |limit: f64| CentiRpm::from_rpm((2.0 * random.uniform() - 1.0) * limit);
    let speeds = [speed(90.0), speed(90.0)];
    let command = match (random.uniform() * 6.0) as u8 {
        0 | 1 => Command::SetSpeeds(speeds),
        2 => Command::Drive { duty: [Duty(speeds[0].0 / 50), Duty(speeds[1].0 / 50)], duration_ms: 300 },
        3 => Command::TurnTo {
            position: speeds.map(|speed| EncoderCounts(i32::from(speed.0) / 30)),
            speed: CentiRpm(1000),
        },
        _ => Command::Stop,
    };
    host.send(command);
}

/// `CUTS=1000` is the long run.
#[test]
fn a_loss_of_power_leaves_right_positions_or_none() {
    let cuts = std::env::var("CUTS").map_or(20, |cuts| cuts.parse().expect("CUTS is a number"));
    let mut random = Noise::new(97);
    let mut host = Host::new(BoardOptions::default());
    host.hello();
    let mut marks = shafts(&host);
    let [mut right, mut unknown] = [0, 0];
    let mut worst: f64 = 0.0;
    for cut in 0..cuts {
        for _ in 0..=(random.uniform() * 3.0) as u8 {
            order(&mut host, &mut random);
            // In half of the cases long enough to come to rest and be written, 15 bytes in 15 ticks.
            let ms = if random.uniform() < 0.5 {
                10.0 + 300.0 * random.uniform()
            } else {
                1200.0 + 900.0 * random.uniform()
            };
            host.run_linked_ms(ms as u64);
        }
        if random.uniform() < 0.5 {
            host.send(Command::Stop);
            host.run_linked_ms(1080 + (random.uniform() * 250.0) as u64);
        }
        host.run_until(host.board.cycle() + (random.uniform() * 5.0 * MS as f64) as u64);
        host.cut();
        host.inject("brown-out=2");
        // Shafts that turn then turn on.
        host.run_ms(4);
        let Info { angles_known, encoder, .. } = host.hello();
        if angles_known {
            let shafts = shafts(&host);
            for k in 0..2 {
                let error = f64::from(encoder[k].0) - (shafts[k] - marks[k]);
                worst = worst.max(error.abs());
                assert!(error.abs() <= WITHIN, "cut {cut}: {encoder:?} at {shafts:?} from {marks:?}");
            }
            right += 1;
        } else {
            unknown += 1;
            host.run_linked_ms(1500);
            host.order(Command::Align);
            marks = shafts(&host);
        }
        // What the reset latched.
        host.send(Command::ClearFault);
        host.run_linked_ms(200);
    }
    row(
        format!("power cut while shafts turn or rest, {cuts} times"),
        format!("{right} times known, within {worst:.2} counts, {unknown} times not"),
        format!("within {WITHIN} counts or not known"),
    );
    assert!(right > cuts / 5 && unknown > cuts / 5, "{right} {unknown}");
}
