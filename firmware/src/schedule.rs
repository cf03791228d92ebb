//! The schedule of a trial: the speeds of both motors over the board's ticks. The motion of the robot then does not
//! depend on the load of the host.

use protocol::units::{CentiRpm, Micros};
use protocol::{MAX_SET_POINTS, SetPoint};

/// Farthest start of a schedule in the future, µs.
const MAX_DELAY_US: u32 = 600_000_000;

#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
enum Progress {
    #[default]
    Idle,
    /// Until tick 0, which is at this time.
    Waiting(Micros),
    /// The tick of the schedule that comes next.
    Running(u32),
}

/// The set-points and the progress of a schedule.
#[derive(Debug, Default)]
pub struct Schedule {
    points: [SetPoint; MAX_SET_POINTS as usize],
    progress: Progress,
    /// Number of set-points in the schedule that runs.
    count: u8,
    /// Number of its set-points that have begun.
    begun: u8,
}

impl Schedule {
    /// Stores a set-point; returns false if it is out of range.
    pub fn set(&mut self, index: u8, point: &SetPoint) -> bool {
        let in_range = point.speeds.iter().all(|speed| speed.0.unsigned_abs() <= CentiRpm::LIMIT.0.unsigned_abs());
        match self.points.get_mut(usize::from(index)).filter(|_| in_range && point.phase != 0) {
            Some(place) => {
                *place = *point;
                true
            }
            None => false,
        }
    }

    /// Starts the first `count` set-points, with tick 0 at the time `at`; returns false if they are not a schedule or the
    /// time is not in the near future.
    pub fn start(&mut self, count: u8, at: Micros, now: Micros) -> bool {
        let Some(points) = self.points.get(..usize::from(count)) else { return false };
        let is_schedule = points.last().is_some_and(|last| !is_motion(last))
            && points.windows(2).all(|pair| pair[0].tick < pair[1].tick);
        if !is_schedule || at.since(now) > MAX_DELAY_US {
            return false;
        }
        self.progress = Progress::Waiting(at);
        self.count = count;
        self.begun = 0;
        true
    }

    /// Ends the schedule.
    pub fn stop(&mut self) {
        self.progress = Progress::Idle;
    }

    /// Returns whether a schedule runs or waits for its start.
    pub fn is_active(&self) -> bool {
        self.progress != Progress::Idle
    }

    /// Returns whether a motor will turn after this set-point.
    pub fn will_move(&self) -> bool {
        self.is_active() && self.remaining().iter().any(is_motion)
    }

    /// Returns the set-points that have not begun. It cannot panic: an image that can panic does not link.
    #[inline(never)]
    fn remaining(&self) -> &[SetPoint] {
        self.points.get(usize::from(self.begun)..usize::from(self.count)).unwrap_or(&[])
    }

    /// Advances by the `ticks` that have passed, at the time `now`; returns the set-point that begins, if one does.
    pub fn advance(&mut self, ticks: u8, now: Micros) -> Option<SetPoint> {
        let tick = match self.progress {
            Progress::Idle => return None,
            Progress::Waiting(at) if now.since(at).cast_signed().is_negative() => return None,
            Progress::Waiting(_) => 0,
            Progress::Running(next) => next + u32::from(ticks) - 1,
        };
        self.progress = Progress::Running(tick + 1);
        // More than one if ticks were missed.
        let due = self.remaining().iter().take_while(|point| point.tick <= tick);
        let (begun, due) = due.fold((self.begun, None), |(begun, _), point| (begun + 1, Some(*point)));
        self.begun = begun;
        if self.begun == self.count {
            self.progress = Progress::Idle;
        }
        due
    }
}

fn is_motion(point: &SetPoint) -> bool {
    point.speeds[0].0 | point.speeds[1].0 != 0
}

#[cfg(test)]
mod tests {
    use super::*;

    const TICK_US: u32 = 5000;

    fn point(tick: u32, rpm: i16, phase: u8) -> SetPoint {
        SetPoint { tick, speeds: [CentiRpm(rpm * 100), CentiRpm(0)], duties: [0; 2], phase }
    }

    fn trial(points: &[SetPoint]) -> Schedule {
        let mut schedule = Schedule::default();
        for (index, point) in points.iter().enumerate() {
            assert!(schedule.set(index as u8, point));
        }
        schedule
    }

    const TRIAL: [SetPoint; 4] = [
        SetPoint { tick: 0, speeds: [CentiRpm(0); 2], duties: [0; 2], phase: 1 },
        SetPoint { tick: 10, speeds: [CentiRpm(5000), CentiRpm(0)], duties: [0; 2], phase: 2 },
        SetPoint { tick: 30, speeds: [CentiRpm(0); 2], duties: [0; 2], phase: 3 },
        SetPoint { tick: 40, speeds: [CentiRpm(0); 2], duties: [0; 2], phase: 4 },
    ];

    /// Runs 60 ticks from a time just below the clock's wrap; returns the tick and phase of each set-point that began.
    fn run(schedule: &mut Schedule, start_tick: u32, missed: impl Fn(u32) -> u8) -> Vec<(u32, u8)> {
        let first = Micros(u32::MAX - 50_000);
        assert!(schedule.start(4, Micros(first.0.wrapping_add(start_tick * TICK_US)), first));
        let mut tick = 0;
        let mut begun = Vec::new();
        while tick < 60 {
            let skipped = missed(tick);
            tick += u32::from(skipped);
            let now = Micros(first.0.wrapping_add(tick * TICK_US + 7));
            if let Some(point) = schedule.advance(skipped + 1, now) {
                begun.push((tick - start_tick, point.phase));
            }
            tick += 1;
        }
        begun
    }

    #[test]
    fn set_points_begin_at_their_ticks_across_the_clocks_wrap() {
        let mut schedule = trial(&TRIAL);
        assert_eq!(run(&mut schedule, 8, |_| 0), [(0, 1), (10, 2), (30, 3), (40, 4)]);
        assert!(!schedule.is_active() && !schedule.will_move());
        assert_eq!(run(&mut schedule, 0, |_| 0), [(0, 1), (10, 2), (30, 3), (40, 4)], "it can be started again");
    }

    #[test]
    fn missed_ticks_count_and_what_they_skipped_is_not_repeated() {
        let begun = run(&mut trial(&TRIAL), 4, |tick| if tick == 12 { 5 } else { 0 });
        assert_eq!(begun, [(0, 1), (13, 2), (30, 3), (40, 4)]);
        let begun = run(&mut trial(&TRIAL), 4, |tick| if tick == 12 { 25 } else { 0 });
        assert_eq!(begun, [(0, 1), (33, 3), (40, 4)], "a phase within missed ticks is left out");
    }

    #[test]
    fn motion_ahead_is_known_until_the_motors_stop() {
        let mut schedule = trial(&TRIAL);
        assert!(!schedule.will_move());
        assert!(schedule.start(4, Micros(0), Micros(0)));
        let will_move: Vec<_> = (0..50)
            .map(|tick| {
                schedule.advance(1, Micros(tick * TICK_US));
                schedule.will_move()
            })
            .collect();
        assert_eq!(will_move.iter().position(|moves| !moves), Some(10));
        assert!(will_move[10..].iter().all(|moves| !moves));
        schedule.start(4, Micros(0), Micros(0));
        schedule.stop();
        assert!(!schedule.will_move() && schedule.advance(1, Micros(5000)).is_none());
    }

    #[test]
    fn what_is_not_a_schedule_is_refused() {
        let now = Micros(1000);
        let refused = |points: &[SetPoint], count, at| !trial(points).start(count, at, now);
        assert!(!refused(&TRIAL, 4, now));
        assert!(refused(&TRIAL, 0, now) && refused(&TRIAL, MAX_SET_POINTS + 1, now) && refused(&TRIAL, 255, now));
        assert!(refused(&TRIAL, 2, now), "it ends with a motor on");
        let both = SetPoint { speeds: [CentiRpm(100); 2], ..point(0, 0, 1) };
        assert!(refused(&[both], 1, now), "it ends with both motors on");
        assert!(refused(&[point(5, 1, 1), point(5, 0, 2)], 2, now), "two at one tick");
        assert!(refused(&TRIAL, 4, Micros(999)), "the past");
        assert!(!refused(&TRIAL, 4, Micros(1000 + MAX_DELAY_US)), "ten minutes ahead");
        assert!(refused(&TRIAL, 4, Micros(1001 + MAX_DELAY_US)), "more than ten minutes ahead");
        let mut schedule = Schedule::default();
        assert!(
            !schedule.set(MAX_SET_POINTS, &point(0, 0, 1))
                && !schedule.set(0, &point(0, 91, 1))
                && !schedule.set(0, &point(0, 0, 0))
        );
        assert!(!schedule.set(0, &SetPoint { speeds: [CentiRpm(i16::MIN); 2], ..point(0, 0, 1) }));
    }

    #[test]
    fn the_longest_schedule_uses_every_place() {
        let points: Vec<_> = (0..MAX_SET_POINTS)
            .map(|i| point(u32::from(i) * 2, if i < MAX_SET_POINTS - 1 { 9 } else { 0 }, i + 1))
            .collect();
        let mut schedule = trial(&points);
        assert!(schedule.start(MAX_SET_POINTS, Micros(0), Micros(0)));
        let begun = (0..40).filter_map(|tick| schedule.advance(1, Micros(tick * TICK_US))).map(|point| point.phase);
        assert_eq!(begun.collect::<Vec<_>>(), (1..=MAX_SET_POINTS).collect::<Vec<_>>());
    }
}
