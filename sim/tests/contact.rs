//! The search for close edges.

use nalgebra::UnitQuaternion;
use proptest::prelude::*;
use sim::V3;
use sim::contact::{broad_phase::BroadPhase, distance::segment_distance, pairs::Lines};
use sim::params::Robot;
use sim::rod::Rod;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Rods that turn and move by fractions of the skin, or jump: pairs and least distance do not depend on earlier searches.
    #[test]
    fn a_search_that_remembers_finds_what_a_fresh_one_finds(
        apart in 0.004..0.05f64,
        moves in prop::collection::vec((prop::array::uniform3(-1.0..1.0f64), 0.0..0.004f64, 0.0..0.3f64, -0.5..0.5f64, any::<bool>()), 1..12),
    ) {
        let robot = Robot::published();
        let rod = Rod::stress_free(robot.flagellum.helix(0).nodes(49), robot.flagellum.stiffness());
        let rods = [rod.clone(), rod];
        let radius = robot.flagellum.rod_radius_m;
        let new = || BroadPhase::new(&rods, radius);
        let mut lines: Lines = [rods[0].shape.clone(), rods[1].shape.iter().map(|x| x + V3::x() * apart).collect()];
        let mut remembers = new();
        for (direction, far, bend, turn, wide) in moves {
            let push = V3::from(direction) * far;
            for (k, x) in lines[1].iter_mut().enumerate() {
                *x += push * (1.0 + bend * (k as f64 * 0.3).sin());
            }
            // A turn about its foot moves nothing in a rod's own frame.
            let turn = UnitQuaternion::from_axis_angle(&V3::z_axis(), turn);
            lines[0].iter_mut().for_each(|x| *x = turn * *x);
            let own = [rods[0].shape.as_slice(), lines[1].as_slice()];
            let limit = if wide { 3.0 * radius } else { 2.5 * radius };
            let least = (0..rods[0].edges())
                .flat_map(|i| (0..rods[1].edges()).map(move |j| (i, j)))
                .map(|(i, j)| segment_distance(lines[0][i], lines[0][i + 1], lines[1][j], lines[1][j + 1]).separation.norm())
                .fold(f64::INFINITY, f64::min);
            prop_assert_eq!(remembers.least_distance(&lines), least);
            prop_assert_eq!(remembers.search(&lines, own, limit), new().search(&lines, own, limit));
        }
    }
}
