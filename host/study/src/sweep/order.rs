//! The order in which the points of a shard are computed: the dearest first, so that no worker begins a long one when the
//! others have ended.

use super::folder::Folder;
use super::point::{Shard, phases};
use super::points::Points;
use biflag_log::Method;
use rayon::prelude::*;
use sim::steady::effort;

impl Folder {
    /// Returns the points of a shard that are not known, the dearest first by the model's own estimate; equally dear ones in
    /// the order of the plan.
    pub fn dearest_first(&self, shard: Shard, known: &Points) -> Vec<u32> {
        let points = self.sweep.points_of(shard, known);
        // A plan has fewer points than an index of 32 bits.
        let mut costs: Vec<(f32, u32)> = points.map(|(index, _)| (self.estimate(index), index as u32)).collect();
        costs.par_sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        costs.into_iter().map(|(_, index)| index).collect()
    }

    /// Returns what a point costs, in no particular unit; 0 for one that is impossible.
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
