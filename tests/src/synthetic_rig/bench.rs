//! The three commands of `biflag sensor` on a bench: their results for a part that a hand poses and turns.

use super::TICK_S;
use super::part::{Lot, Part, Powered};
use super::random::Random;
use super::recording::CLOCK_U;
use biflag_log::MeasuredSensorMeta;
use host::sensor::{
    AXES, Estimate, MeasuredSensor, PoseStep, PosesWatch, RawReading, StillWatch, TurnPlan, TurnStep, TurnWatch,
};
use nalgebra::{UnitQuaternion, Vector3};
use protocol::Settings;

/// Bound on the error of each pose, of the axis of a turn, and of a turn of 720°, °. These are the defaults of the commands.
const PLACED_DEG: f64 = 1.0;

/// Standard deviation of the stops of a hand at a mark, °.
const STOPS_DEG: f64 = 0.5;

impl Part {
    /// Returns the errors of a part as measured by `sensor poses`, `sensor turn` about each axis and `sensor still 600`. An ideal
    /// part has exactly zero errors, and its noise from `sensor still 600`.
    pub fn measured(&self, random: &mut Random) -> MeasuredSensorMeta {
        let is_ideal = self.lot == Lot::Ideal;
        let mut file = if is_ideal { exact() } else { MeasuredSensor::new(&Settings::DEFAULT) };
        if !is_ideal {
            poses(self, random, &mut file);
            (0..3).for_each(|axis| turns(self, random, axis, &mut file));
        }
        still(self, random, &mut file);
        "2026-11-24".clone_into(&mut file.date);
        MeasuredSensorMeta { name: "sensor.toml".to_owned(), text: file.to_toml() }
    }
}

/// Returns the file of a sensor for which all measured errors are exactly zero.
fn exact() -> MeasuredSensor {
    let mut file = MeasuredSensor::new(&Settings::DEFAULT);
    for i in AXES {
        ["gyro_scale", "accel_scale", "mounting_deg"].iter().for_each(|table| file.set(table, i, Estimate::default()));
        for j in AXES {
            file.set("gyro_g_dps", &format!("{i}{j}"), Estimate::default());
            for table in ["gyro_cross", "accel_cross"].iter().filter(|_| i != j) {
                file.set(table, &format!("{i}{j}"), Estimate::default());
            }
        }
    }
    file
}

/// Returns the file of a sensor without errors except one, which is known with a standard uncertainty.
pub fn known_but_for(table: &str, key: &str, value: f64, u: f64) -> MeasuredSensorMeta {
    let mut file = exact();
    file.set(table, key, Estimate { value, u });
    MeasuredSensorMeta { name: "sensor.toml".to_owned(), text: file.to_toml() }
}

/// A sensor in a hand.
struct Hand<'a> {
    powered: Powered<'a>,
    ticks: usize,
    attitude: UnitQuaternion<f64>,
}

impl<'a> Hand<'a> {
    fn new(part: &'a Part, random: &'a mut Random, attitude: UnitQuaternion<f64>) -> Self {
        Self { powered: Powered::new(part, random), ticks: 0, attitude }
    }

    /// Moves along a path, from 0 to 1 with a smooth start and stop. Calls `take` with each reading until it returns false,
    /// and returns whether it did not.
    fn go(
        &mut self,
        seconds: f64,
        path: impl Fn(f64) -> UnitQuaternion<f64>,
        take: &mut impl FnMut(&RawReading) -> bool,
    ) -> bool {
        let count = (seconds / TICK_S).round() as usize;
        for step in 1..=count {
            let share = step as f64 / count as f64;
            let before = std::mem::replace(&mut self.attitude, path(share * share * (3.0 - 2.0 * share)));
            let reading = self.powered.read(before, self.attitude);
            self.ticks += 1;
            let (rate_dps, force_g) = (reading.rate_dps.into(), reading.force_g.into());
            let time_s = self.ticks as f64 * TICK_S;
            if !take(&RawReading { time_s, rate_dps, force_g, temperature_c: reading.temperature_c }) {
                return false;
            }
        }
        true
    }

    fn rest(&mut self, seconds: f64, take: &mut impl FnMut(&RawReading) -> bool) -> bool {
        let attitude = self.attitude;
        self.go(seconds, |_| attitude, take)
    }

    /// Returns a rotation by errors of placement about the world's axes.
    fn askew(&mut self) -> UnitQuaternion<f64> {
        let limit = PLACED_DEG.to_radians();
        UnitQuaternion::from_scaled_axis(Vector3::from_fn(|_, _| self.powered.random.within(limit)))
    }
}

/// Returns the rotation that brings an axis of the body up.
fn upright(axis: Vector3<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::rotation_between(&axis, &Vector3::z())
        .unwrap_or_else(|| UnitQuaternion::from_scaled_axis(Vector3::x() * std::f64::consts::PI))
}

fn poses(part: &Part, random: &mut Random, file: &mut MeasuredSensor) {
    let mut watch = PosesWatch::new(20.0);
    let mut hand = Hand::new(part, random, UnitQuaternion::identity());
    let mut take = |reading: &RawReading| watch.push(reading).expect("a pose") != PoseStep::Done;
    let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
    for up in axes.into_iter().flat_map(|axis| [axis, -axis]) {
        let (from, to) = (hand.attitude, hand.askew() * upright(up));
        let turn = (from.inverse() * to).scaled_axis();
        let goes_on = hand.go(2.0, |share| from * UnitQuaternion::from_scaled_axis(turn * share), &mut take);
        if !(goes_on && hand.rest(22.5, &mut take)) {
            break;
        }
    }
    watch.result(PLACED_DEG).expect("six poses").enter(file);
}

fn turns(part: &Part, random: &mut Random, axis: usize, file: &mut MeasuredSensor) {
    let plan = TurnPlan { axis, degrees: 720.0, turns: 6 };
    let mut watch = TurnWatch::new(plan);
    let mut hand = Hand::new(part, random, UnitQuaternion::identity());
    let standing = hand.askew() * upright(Vector3::ith(axis, 1.0));
    hand.attitude = standing;
    let about = |deg: f64| UnitQuaternion::from_scaled_axis(Vector3::z() * deg.to_radians()) * standing;
    let marks_deg = [0.0, plan.degrees + hand.powered.random.within(PLACED_DEG)];
    let mut take = |reading: &RawReading| watch.push(reading).expect("a turn") != TurnStep::Done;
    let mut goes_on = hand.rest(5.0, &mut take);
    let mut at_deg = 0.0;
    for turn in 1..=plan.turns {
        let to_deg = marks_deg[turn % 2] + STOPS_DEG * hand.powered.random.normal();
        let from_deg = std::mem::replace(&mut at_deg, to_deg);
        goes_on = goes_on && hand.go(12.0, |share| about(from_deg + share * (to_deg - from_deg)), &mut take);
        goes_on = goes_on && hand.rest(5.0, &mut take);
    }
    // Pings measure the rate of the board's clock.
    let clock = part.clock + CLOCK_U * random.normal();
    watch.result(PLACED_DEG, file, clock).expect("turns").enter(axis, file);
}

fn still(part: &Part, random: &mut Random, file: &mut MeasuredSensor) {
    let mut watch = StillWatch::new(600.0);
    let mut hand = Hand::new(part, random, UnitQuaternion::identity());
    hand.rest(620.0, &mut |reading| watch.push(reading).expect("a rest") > 0.0);
    watch.result().expect("a rest").enter(file);
}
