//! Control of a motor's speed and angle.
//!
//! A motor follows an angle that advances with exactly its target speed, in integers, so that two motors keep the ratio of
//! their targets for any time. A speed in proportion to its lag behind this angle is added to its set-point.

use protocol::units::{CentiRpm, Duty, EncoderCounts};

use crate::encoder::Motion;
use crate::{TICK_S, round_to_i16};

/// Gains of the speed control, in its internal units.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Gains {
    /// Duty steps per hundredth of rpm.
    kp: f32,
    /// Duty steps per hundredth of rpm and tick.
    ki: f32,
}

impl Gains {
    /// Converts from duty steps per rpm, and per rpm and second.
    pub fn new(kp: f32, ki: f32) -> Self {
        Self { kp: kp * 0.01, ki: ki * (0.01 * TICK_S) }
    }
}

/// Parts of the unit of an angle, which is the turn of one tick at a hundredth of rpm. A count of the published encoder is
/// 510,113 parts.
pub(crate) const PARTS: i32 = 1 << 8;

/// The largest lag or lead of a motor, a third of a turn: a motor that was held does not catch up with more.
const MAX_LAG: i32 = 400_000 * PARTS;

/// The speed that is added per lag: 12.5 rpm for each rpm·s, as a shift.
const CATCH_UP: u8 = 12;

/// The limit of that speed, hundredths of rpm, to which half of the target is added. A motor that is ahead slows down to a
/// standstill at most.
const SLOWEST_CATCH_UP: i32 = 1000;

/// Returns `x`, at most `limit` either way. Unlike `clamp`, it cannot panic.
#[inline(never)]
fn within(x: i32, limit: i32) -> i32 {
    x.min(limit).max(-limit)
}

/// Returns a count of the encoder in the unit of [`SpeedControl::follow`].
pub fn count_in_ticks(counts_per_turn: f32) -> i32 {
    // Hundredths of rpm times ticks of one turn.
    const TURN: f32 = 100.0 * 60.0 / TICK_S;
    (TURN * PARTS as f32 / counts_per_turn + 0.5) as i32
}

/// Control of one motor: PI of the speed, with the angle as a part of its set-point. A target of zero turns the motor off.
#[derive(Debug, Default)]
pub struct SpeedControl {
    /// Integral term, duty steps.
    integral: f32,
    /// The integral of the target less the counted angle, in hundredths of rpm times ticks, in [`PARTS`].
    lag: i32,
    /// The estimated angle since the last count, from half a count behind the middle between two edges to half a count
    /// ahead of it.
    since: i32,
}

impl SpeedControl {
    /// Takes the motion of a tick and of the `missed` ticks before it, in which the target was in force. `count` is
    /// [`count_in_ticks`] of the encoder.
    #[inline(never)]
    pub fn follow(&mut self, target: CentiRpm, missed: u8, motion: &Motion, count: i32) {
        let turned = i32::from(motion.counts).wrapping_mul(count);
        let asked = i32::from(target.0).wrapping_mul(i32::from(missed) * PARTS);
        self.lag = within(self.lag.wrapping_add(asked).wrapping_sub(turned), MAX_LAG);
        let (half, step) = (count >> 1, i32::from(motion.speed.0) * PARTS);
        self.since = match motion.counts {
            0 => within(self.since + step, half),
            // On average, the last edge came half-way between two edges or two ticks.
            counts => within(step >> 1, half) + if counts > 0 { -half } else { half },
        };
    }

    /// Returns the duty for the next tick of a turn to a position. The target is the speed of the approach; 0 brakes.
    pub fn approach(&mut self, target: CentiRpm, speed: CentiRpm, gains: Gains) -> Duty {
        self.lag = 0;
        self.since = 0;
        if target.0 == 0 {
            self.integral = 0.0;
            return Duty(round_to_i16(-gains.kp * f32::from(speed.0), 0).clamp(-Duty::FULL.0, Duty::FULL.0));
        }
        // The integral that tore a sticking gear loose would take the motor too far.
        if speed.0.unsigned_abs() > target.0.unsigned_abs() {
            self.integral *= 0.5;
        }
        self.duty(target, speed, gains)
    }

    /// Returns the duty for the next tick.
    #[inline(never)]
    pub fn duty(&mut self, target: CentiRpm, speed: CentiRpm, gains: Gains) -> Duty {
        if target.0 == 0 {
            *self = Self::default();
            return Duty(0);
        }
        let target = i32::from(target.0);
        let is_behind = (self.lag ^ target) >= 0;
        let limit = if is_behind { SLOWEST_CATCH_UP + (target.abs() >> 1) } else { target.abs() };
        let catch_up = within((self.lag - self.since) >> CATCH_UP, limit);
        self.lag = within(self.lag + target * PARTS, MAX_LAG);
        let error = (target + catch_up - i32::from(speed.0)) as f32;
        // The integral never acts against the target: its rest from before a reversal is dropped at once.
        if self.integral.is_sign_negative() != target.is_negative() {
            self.integral = 0.0;
        }
        let integral = self.integral + gains.ki * error;
        let duty = gains.kp * error + integral;
        let limited = round_to_i16(duty, 0).clamp(-Duty::FULL.0, Duty::FULL.0);
        // Anti-windup: at the limit of the duty, the integral only moves away from it.
        if limited.abs() < Duty::FULL.0 || duty.is_sign_negative() != error.is_sign_negative() {
            self.integral = integral;
        }
        Duty(limited)
    }
}

/// A turn of both motors to positions of their encoders.
#[derive(Clone, Copy, Debug)]
pub struct Turn {
    /// The positions to reach.
    pub position: [EncoderCounts; 2],
    /// The speed far from these positions.
    pub speed: CentiRpm,
}

/// The distance at which a motor has arrived, counts: its braking distance from the slowest speed.
const ARRIVED: u32 = 2;

/// The speed of an approach, hundredths of rpm for each count of the distance.
const APPROACH: i32 = 50;

impl Turn {
    /// Returns the speeds of motors at these positions.
    pub fn speeds(&self, [first, second]: [EncoderCounts; 2]) -> [CentiRpm; 2] {
        let [to_first, to_second] = self.position;
        [self.speed(to_first, first), self.speed(to_second, second)]
    }

    #[inline(never)]
    fn speed(&self, to: EncoderCounts, from: EncoderCounts) -> CentiRpm {
        let distance = to.0.wrapping_sub(from.0);
        if distance.unsigned_abs() <= ARRIVED {
            return CentiRpm(0);
        }
        let fastest = i32::from(self.speed.0);
        CentiRpm(within(within(distance, fastest) * APPROACH, fastest) as i16)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GAINS: Gains = Gains { kp: 0.01, ki: 0.05 * TICK_S };

    #[test]
    fn a_turn_slows_down_before_its_position_and_ends_at_it() {
        let turn = Turn { position: [EncoderCounts(100), EncoderCounts(-7)], speed: CentiRpm(3000) };
        let speeds = |from: [i32; 2]| turn.speeds(from.map(EncoderCounts)).map(|speed| speed.0);
        assert_eq!(speeds([-500, 700]), [3000, -3000]);
        assert_eq!(speeds([41, 52]), [2950, -2950]);
        assert_eq!(speeds([97, -4]), [150, -150]);
        assert_eq!(speeds([98, -9]), [0, 0]);
    }

    #[test]
    fn a_motor_is_braked_where_its_turn_ends() {
        let mut control = SpeedControl::default();
        assert_eq!([700, -700].map(|speed| control.approach(CentiRpm(0), CentiRpm(speed), GAINS)), [Duty(-7), Duty(7)]);
        assert_eq!(control.approach(CentiRpm(0), CentiRpm(i16::MAX), Gains { kp: 1.0, ..GAINS }), Duty(-255));
    }

    #[test]
    fn a_motor_that_turns_too_fast_for_its_approach_loses_half_of_its_integral() {
        for (speed, duty) in [(999, 40), (1000, 40), (1001, 20), (-1001, 20)] {
            let mut control = SpeedControl { integral: 40.0, ..SpeedControl::default() };
            let none = Gains { kp: 0.0, ki: 0.0 };
            assert_eq!(control.approach(CentiRpm(1000), CentiRpm(speed), none), Duty(duty), "{speed}");
        }
    }

    #[test]
    fn a_motor_catches_up_by_half_its_speed_and_waits_by_standing_still() {
        let gains = Gains { kp: 0.01, ki: 0.0 };
        for (lag, target, duty) in [(1, 6000, 40), (-1, -6000, -40), (-1, 6000, -60), (1, -6000, 60)] {
            let mut control = SpeedControl { lag: lag * MAX_LAG, ..SpeedControl::default() };
            let speed = CentiRpm(target);
            assert_eq!(control.duty(speed, speed, gains), Duty(duty), "{lag} {target}");
        }
    }

    #[test]
    fn a_motor_falls_behind_its_angle_in_missed_ticks() {
        let count = count_in_ticks(602.22);
        assert_eq!(count, 510_113);
        // A tick at 59.783 rpm is three counts.
        let motion = |ticks: i8| Motion { counts: 3 * ticks, speed: CentiRpm(5978), edges: 3, glitches: 0 };
        let [mut kept, mut missed] = [(), ()].map(|()| SpeedControl::default());
        kept.follow(CentiRpm(5978), 2, &motion(2), count);
        missed.follow(CentiRpm(5978), 2, &motion(0), count);
        assert!(kept.lag.abs() < count / 10, "{}", kept.lag);
        // So fast that the angle is counted to the middle between two edges.
        assert_eq!((kept.since, missed.since), (0, count >> 1));
        // The edge of a slow one came, on average, in the middle of the tick.
        kept.follow(CentiRpm(500), 0, &Motion { counts: 1, speed: CentiRpm(500), ..motion(0) }, count);
        assert_eq!(kept.since, 250 * PARTS - (count >> 1));
        assert!((missed.lag - 6 * count).abs() < count / 10, "{} of {count}", missed.lag);
    }

    #[test]
    fn a_motor_that_keeps_its_speed_keeps_its_duty_between_its_edges() {
        let (gains, count) = (Gains { kp: 1.0, ki: 0.0 }, count_in_ticks(602.22));
        for target in [437, -437, 1263].map(CentiRpm) {
            let (mut control, mut position) = (SpeedControl::default(), 0);
            let duties = (0..400).map(|_| {
                let duty = control.duty(target, target, gains);
                let before: i32 = position / count;
                position += i32::from(target.0) * PARTS;
                let motion = Motion { counts: (position / count - before) as i8, speed: target, ..Motion::default() };
                control.follow(target, 0, &motion, count);
                duty.0
            });
            let duties: Vec<_> = duties.skip(20).collect();
            let [least, most] = [duties.iter().min(), duties.iter().max()].map(Option::unwrap);
            // An edge may have come at any time of its tick.
            let tick = (i32::from(target.0).abs() * PARTS) >> CATCH_UP;
            assert!(i32::from(most - least) <= tick + 1, "{least} to {most} at {target:?}");
        }
    }

    /// A motor that reaches `rpm_per_step * duty` with a time constant of 80 ms, and its encoder.
    fn simulate(control: &mut SpeedControl, speed: &mut f64, target: CentiRpm, rpm_per_step: f64, ticks: u32) -> i16 {
        let (mut duty, mut position, count) = (Duty(0), 0.0f64, count_in_ticks(602.22));
        for _ in 0..ticks {
            duty = control.duty(target, CentiRpm::from_rpm(*speed), GAINS);
            *speed += (f64::from(duty.0) * rpm_per_step - *speed) * 0.005 / 0.08;
            let before = position;
            position += *speed / 60.0 * 602.22 * 0.005;
            let counts = (position.floor() - before.floor()) as i8;
            control.follow(
                target,
                0,
                &Motion { counts, speed: CentiRpm::from_rpm(*speed), ..Motion::default() },
                count,
            );
        }
        duty.0
    }

    #[test]
    fn the_target_is_reached_in_both_directions_and_zero_is_off() {
        for target in [90.0, -35.5, 4.0] {
            let (mut control, mut speed) = (SpeedControl::default(), 0.0);
            simulate(&mut control, &mut speed, CentiRpm::from_rpm(target), 0.4, 2000);
            assert!((speed - target).abs() < 0.5, "{speed} for {target}");
            assert_eq!(control.duty(CentiRpm(0), CentiRpm::from_rpm(speed), GAINS), Duty(0));
            assert_eq!(control.integral, 0.0);
        }
    }

    #[test]
    fn a_long_overload_does_not_wind_up_the_integral() {
        let (mut control, mut speed) = (SpeedControl::default(), 0.0);
        // The supply is too weak for the target: the duty stays at its limit.
        assert_eq!(simulate(&mut control, &mut speed, CentiRpm(9000), 0.2, 4000), 255);
        // Back at full supply the duty leaves its limit within a second: a third of a turn at 37 rpm more than the target's.
        assert!(simulate(&mut control, &mut speed, CentiRpm(9000), 0.5, 200) < 255);
        let (mut control, mut speed) = (SpeedControl::default(), 0.0);
        assert_eq!(simulate(&mut control, &mut speed, CentiRpm(-9000), 0.2, 4000), -255);
        assert!(simulate(&mut control, &mut speed, CentiRpm(-9000), 0.5, 200) > -255);
    }

    #[test]
    fn gains_at_their_limits_stay_finite() {
        let mut control = SpeedControl::default();
        for speed in [i16::MIN, i16::MAX, 0] {
            let duty = control.duty(CentiRpm(9000), CentiRpm(speed), Gains::new(1000.0, 1000.0));
            assert!(duty.0.abs() <= 255 && control.integral.is_finite());
        }
        assert_eq!(
            control.duty(CentiRpm(9000), CentiRpm(0), Gains::new(0.0, 0.0)).0,
            round_to_i16(control.integral, 0)
        );
    }
}
