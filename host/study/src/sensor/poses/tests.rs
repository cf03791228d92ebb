use super::*;
use crate::sensor::tests::Hand;
use nalgebra::{UnitQuaternion, Vector3};

/// The rotations of the world that bring each body axis up in turn, from one pose to the next.
fn ups() -> [Vector3<f64>; 6] {
    let [x, y, z] = [Vector3::x(), Vector3::y(), Vector3::z()];
    [x, -x, y, -y, z, -z]
}

/// Lays the sensor into six poses, each with an error about the two horizontal axes, and returns the readings.
fn laid(hand: &mut Hand, mounting: Vector3<f64>, placement_deg: f64) -> Vec<RawReading> {
    let mut readings = hand.rest(1.0);
    for up in ups() {
        readings.extend(hand.moved(Vector3::new(20.0, 15.0, 10.0), 1.0));
        let upright = UnitQuaternion::rotation_between(&up, &Vector3::z())
            .unwrap_or_else(|| UnitQuaternion::from_scaled_axis(Vector3::x() * std::f64::consts::PI));
        let error = Vector3::from_fn(|_, _| hand.within(placement_deg.to_radians()));
        hand.attitude = UnitQuaternion::from_scaled_axis(error) * upright * UnitQuaternion::from_scaled_axis(mounting);
        readings.extend(hand.rest(22.5));
    }
    readings
}

fn result(hand: &mut Hand, mounting: Vector3<f64>) -> PosesResult {
    let mut watch = PosesWatch::new(20.0);
    let readings = laid(hand, mounting, 1.0);
    assert!(readings.iter().any(|reading| watch.push(reading).unwrap() == PoseStep::Done), "{:?}", watch.missing());
    watch.result(1.0).unwrap()
}

#[test]
fn intervals_contain_the_truth() {
    let mut inside = [0; 5];
    let seeds = 60;
    for seed in 0..seeds {
        let mut hand = Hand::new(seed);
        hand.gyro_g_dps = hand.matrix(0.1, 0.1);
        hand.accel = hand.matrix(0.03, 0.02);
        hand.offset_g = Vector3::from_fn(|_, _| hand.within(0.05));
        hand.bias_dps = Vector3::from_fn(|_, _| hand.within(20.0));
        let mounting = Vector3::from_fn(|_, _| hand.within(0.035));
        let result = result(&mut hand, mounting);
        let mut count = |kind: usize, estimate: Estimate, truth: f64| {
            inside[kind] += u32::from((estimate.value - truth).abs() < 1.96 * estimate.u);
        };
        for i in 0..3 {
            let j = (i + 1) % 3;
            count(0, result.accel_scale[i], hand.accel[(i, i)]);
            count(1, result.accel_offset_g[i], hand.offset_g[i]);
            // The mounting makes the cross-axis terms symmetric: after a rotation r about k, axis i reads r of j, where
            // i, j, k is a cycle, and axis j reads -r of i.
            let k = (i + 2) % 3;
            let [a, b] = [hand.accel[(i, j)], hand.accel[(j, i)]];
            count(2, result.accel_cross[i][j], 0.5 * (a + b));
            count(3, result.mounting_deg[k], (mounting[k] + 0.5 * (a - b)).to_degrees());
            count(4, result.gyro_g_dps[i][j], hand.gyro_g_dps[(i, j)]);
            assert!(result.gyro_g_dps[i][j].u < 0.01 && result.accel_cross[i][j].u < 0.01);
        }
    }
    println!("{inside:?} of {} each: scale, offset, cross, mounting, g", 3 * seeds);
    assert!(inside.iter().all(|inside| f64::from(*inside) > 0.9 * 3.0 * seeds as f64), "{inside:?}");
}

#[test]
fn a_drift_from_pose_to_pose_widens_the_sensitivity_to_gravity() {
    let mut hand = Hand::new(77);
    let calm = result(&mut hand, Vector3::zeros()).gyro_g_dps[0][0].u;
    let mut hand = Hand::new(77);
    hand.drift_dps = Vector3::new(2e-3, -1e-3, 1e-3);
    let drifting = result(&mut hand, Vector3::zeros());
    assert!(drifting.gyro_g_dps[0][0].u > 5.0 * calm && drifting.drift_dps > 0.01, "{drifting:?}");
}

/// A freshly powered sensor: the change with temperature is separated from the sensitivity to gravity, and a lag of the
/// thermometer does no harm.
#[test]
fn warming_is_no_part_of_the_sensitivity_to_gravity() {
    let sensitivity = |warming_c: f64, lag_s: f64| {
        let mut hand = Hand::new(78);
        hand.drift_dps_per_c = Vector3::new(0.06, -0.03, 0.04);
        (hand.warming_c, hand.lag_s) = (warming_c, lag_s);
        hand.gyro_g_dps = hand.matrix(0.1, 0.1);
        let result = result(&mut hand, Vector3::zeros());
        let off = (0..9).map(|k| (result.gyro_g_dps[k / 3][k % 3].value - hand.gyro_g_dps[(k / 3, k % 3)]).abs());
        (off.fold(0.0, f64::max), result.gyro_g_dps[0][0].u)
    };
    let (_, calm_u) = sensitivity(0.0, 0.0);
    for (warming_c, lag_s) in [(3.0, 0.0), (3.0, 5.0), (-2.0, 3.0), (8.0, 12.0)] {
        let (off, u) = sensitivity(warming_c, lag_s);
        println!("{warming_c} °C, lag {lag_s} s: {off:.4} off, u {u:.4}; without warming u {calm_u:.4}");
        assert!(off < 0.005 && u < 2.5 * calm_u, "{warming_c} °C, {lag_s} s: {off}, {u}");
    }
}

#[test]
fn missing_and_askew_poses_are_told() {
    let mut hand = Hand::new(9);
    let mut watch = PosesWatch::new(20.0);
    let steps: Vec<_> = hand.rest(22.5).iter().map(|reading| watch.push(reading).unwrap()).collect();
    assert!(steps.iter().any(|step| matches!(step, PoseStep::Hold { up, left_s } if up == "+z" && *left_s < 1.0)));
    let missing: Vec<_> = ["+x", "-x", "+y", "-y", "-z"].map(str::to_owned).to_vec();
    assert_eq!(steps.last(), Some(&PoseStep::Move { missing: missing.clone() }));
    hand.attitude = UnitQuaternion::from_scaled_axis(Vector3::x() * 0.7);
    hand.moved(Vector3::x() * 90.0, 0.5).iter().for_each(|reading| drop(watch.push(reading)));
    hand.attitude = UnitQuaternion::from_scaled_axis(Vector3::x() * 0.7);
    let steps: Vec<_> = hand.rest(3.0).iter().map(|reading| watch.push(reading).unwrap()).collect();
    assert_eq!(steps.last(), Some(&PoseStep::Askew { missing: missing.clone() }));
    let error = hand.rest(200.0).iter().find_map(|reading| watch.push(reading).err()).unwrap();
    assert_eq!(error.to_string(), "poses are missing: +x, -x, +y, -y, -z");
}
