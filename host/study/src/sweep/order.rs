//! The order in which the points of a shard are computed: the most expensive first, so that no worker starts a long
//! point when the others have finished.

use super::folder::Folder;
use super::point::{Shard, phases};
use super::points::Points;
use biflag_log::Method;
use rayon::prelude::*;
use sim::steady::effort;

impl Folder {
    /// Returns the unknown points of a shard, the most expensive first by the model's own estimate; equally expensive
    /// points keep the order of the plan.
    pub fn dearest_first(&self, shard: Shard, known: &Points) -> Vec<u32> {
        let points = self.sweep.points_of(shard, known);
        // The number of points fits in 32 bits.
        let mut costs: Vec<(f32, u32)> = points.map(|(index, _)| (self.estimate(index), index as u32)).collect();
        costs.par_sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        costs.into_iter().map(|(_, index)| index).collect()
    }

    /// Returns the estimated cost of a point in arbitrary units; 0 for an impossible point.
    fn estimate(&self, index: u64) -> f32 {
        let (point, plan) = (self.sweep.point(index), &self.sweep.plan);
        let Ok(robot) = &point.robot else { return 0.0 };
        if robot.validate().is_err() {
            return 0.0;
        }
        let one = effort::estimate(robot, point.speeds_rpm, plan.method == Method::Steady, plan.run_s);
        (phases(plan, point.speeds_rpm) as f64 * one) as f32
    }
}
