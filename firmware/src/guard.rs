//! Faults of a motor: stall, runaway, overload, and a failed encoder.
//!
//! | finding | rule |
//! | --- | --- |
//! | stalled | for a second, a duty that turns it freely, and less than a quarter of the target speed or 0.2 rpm |
//! | runaway | for 150 ms, 3 rpm or more against its duty, and not braked by it |
//! | overloaded | the heat of its winding, estimated from duty and speed; in an open-loop drive too |
//! | encoder failed | 16 successive edges, each of which undoes the one before; or no edge for the time of four counts at the target speed and at least 100 ms, if the motor had reached its speed and is driven: a lost encoder or a blocked rotor |
//!
//! A speed far above its target needs no rule of its own: the speed control lowers the duty until it points against the
//! motion.

use protocol::Fault;
use protocol::units::{CentiRpm, Duty};

use crate::encoder::Motion;
use crate::speed::PARTS;

/// A motor is stalled above this many ticks of too little motion, less those of enough motion: one second.
const STALL_TICKS: u8 = protocol::TICK_HZ;

/// The least speed that counts as motion, hundredths of rpm: two edges a second with the published encoders.
const SLOWEST: i16 = 20;

/// Ticks of motion against the duty after which a motor is a runaway, unless it is being braked: 150 ms.
const RUNAWAY_TICKS: u8 = 30;

/// The least speed that counts as motion against the duty, hundredths of rpm.
const AGAINST: i16 = 300;

/// Number of edges in a row that cancel each other after which an encoder has failed. A motor that reverses makes some
/// too.
const CANCELLED_EDGES: u8 = 16;

/// Least number of ticks without an edge after which a motor that had reached its speed has lost its encoder: 100 ms, ...
const QUIET_TICKS: u8 = 20;

/// ... and the time of four counts at its target speed, as a shift.
const QUIET_COUNTS: u8 = 2;

/// The largest continuous current, in steps of the duty: a third of the current of a blocked motor at full voltage.
const LASTING: u32 = 85;

/// The winding cools by a factor of e in 2^12 ticks, 20 s.
const COOLING: u32 = 12;

/// Watches one motor.
///
/// The heat of the winding grows with the square of its current, and decays by cooling. The current is estimated as the duty
/// minus the duty that the speed corresponds to, in steps of the duty: at most 255, for a motor that is blocked at full
/// voltage; 0 for one that is faster than its duty. A current of 128 (half the speed without load, at full voltage) reaches
/// the limit after 12 s, 178 after 5 s, 255 after 2.4 s. At 90 rpm even full voltage gives a current of at most 80, which may
/// last: a motor that keeps this speed cannot be overloaded.
#[derive(Debug, Default)]
pub struct Guard {
    heat: u32,
    stalled_ticks: u8,
    against_ticks: u8,
    /// The speed in the first of these ticks.
    against_from: i16,
    /// Edges in a row that cancel each other, except for at most one count, and the change of the position by them.
    edges: u8,
    counts: i8,
    /// Sign of the target.
    sense: i16,
    /// Whether the motor has reached a target of this sign.
    has_reached: bool,
    /// Ticks without an edge in which the motor was driven.
    quiet_ticks: u8,
}

impl Guard {
    /// Advances one tick. `count` is [`count_in_ticks`](crate::speed::count_in_ticks) of the encoder. Returns a finding as the
    /// corresponding faults of motors 1 and 2.
    #[inline(never)]
    pub fn check(&mut self, duty: Duty, target: CentiRpm, motion: &Motion, moving_duty: u8, count: i32) -> [Fault; 2] {
        let sense = target.0.signum();
        if sense != self.sense {
            // A motor that reverses makes edges that cancel each other.
            self.sense = sense;
            (self.edges, self.counts, self.has_reached) = (0, 0, false);
        }
        let is_driven = duty.0.signum() == sense && duty.0.unsigned_abs() >= u16::from(moving_duty);
        // In the direction of the duty.
        let speed = if duty.0.is_negative() { -motion.speed.0 } else { motion.speed.0 };
        let duty = duty.0.unsigned_abs() as u8;
        // An open-loop drive tests the wiring, so the sign of the speed may be wrong.
        let turning = if target.0 == 0 { speed.abs() } else { speed };
        if self.is_overloaded(duty, turning) {
            [Fault::Motor1Overloaded, Fault::Motor2Overloaded]
        } else if self.has_cancelled(motion) | self.is_quiet(is_driven, target, motion, count) {
            [Fault::Encoder1Failed, Fault::Encoder2Failed]
        } else if self.is_runaway(duty, speed) {
            [Fault::Motor1Runaway, Fault::Motor2Runaway]
        } else if self.is_stalled(duty >= moving_duty, speed, target) {
            [Fault::Motor1Stalled, Fault::Motor2Stalled]
        } else {
            [Fault::None; 2]
        }
    }

    fn is_overloaded(&mut self, duty: u8, speed: i16) -> bool {
        // A multiple of 65536 is simple to divide.
        let loss = ((self.heat >> 16) as u16) << (16 - COOLING);
        self.heat -= u32::from(loss);
        if duty != 0 {
            // 5 for every 256 hundredths of rpm: 255 at 130.6 rpm, the speed of the published motor without load.
            let own = i16::from((speed >> 8) as i8) * 5;
            // A motor that is faster than the published one at its duty is of another kind, or coasts.
            let current = (i16::from(duty) - own).clamp(0, 255).unsigned_abs();
            self.heat += u32::from(current * current);
        }
        self.is_hot()
    }

    /// Returns whether the winding has reached its limit of heat.
    pub fn is_hot(&self) -> bool {
        self.heat >= (LASTING * LASTING) << COOLING
    }

    fn has_cancelled(&mut self, motion: &Motion) -> bool {
        self.edges = self.edges.saturating_add(motion.edges);
        self.counts += motion.counts;
        let has_moved = self.counts.unsigned_abs() > 1;
        let has_failed = self.edges >= CANCELLED_EDGES && !has_moved;
        if has_failed || has_moved {
            self.edges = 0;
            self.counts = 0;
        }
        has_failed
    }

    fn is_quiet(&mut self, is_driven: bool, target: CentiRpm, motion: &Motion, count: i32) -> bool {
        let wanted = target.0.abs();
        let speed = if target.0.is_negative() { -motion.speed.0 } else { motion.speed.0 };
        self.has_reached |= speed >= wanted - (wanted >> 3);
        self.quiet_ticks = if is_driven && motion.edges == 0 { self.quiet_ticks.saturating_add(1) } else { 0 };
        if !self.has_reached || self.quiet_ticks < QUIET_TICKS {
            return false;
        }
        let turned = i32::from(wanted) * i32::from(self.quiet_ticks) * PARTS;
        turned >> QUIET_COUNTS >= count
    }

    fn is_runaway(&mut self, duty: u8, speed: i16) -> bool {
        if duty == 0 || speed > -AGAINST {
            self.against_ticks = 0;
            return false;
        }
        if self.against_ticks == 0 {
            self.against_from = speed;
        }
        self.against_ticks += 1;
        if self.against_ticks < RUNAWAY_TICKS {
            return false;
        }
        self.against_ticks = 0;
        // A motor that is being braked has lost more than an eighth of its speed.
        speed <= self.against_from - (self.against_from >> 3)
    }

    fn is_stalled(&mut self, driven: bool, speed: i16, target: CentiRpm) -> bool {
        let least = (target.0.unsigned_abs() >> 2) as i16;
        if !driven {
            self.stalled_ticks = 0;
        } else if speed < least.max(SLOWEST) {
            self.stalled_ticks = self.stalled_ticks.wrapping_add(1);
        } else if self.stalled_ticks > 0 {
            self.stalled_ticks -= 1;
        }
        self.stalled_ticks > STALL_TICKS
    }
}
