use super::*;
use crate::sensor::file::pair;
use crate::sensor::tests::Hand;
use crate::sensor::{Estimate, Sensor};
use nalgebra::{UnitQuaternion, Vector3};
use protocol::Settings;

const PLAN: TurnPlan = TurnPlan { axis: 2, degrees: 720.0, turns: 6 };

fn up_deg(degrees: f64) -> Vector3<f64> {
    Vector3::z() * degrees
}

/// Turns by hand, forwards and back, to marks missed by normally distributed errors. Returns the watch and the last
/// step.
fn turned(hand: &mut Hand, plan: TurnPlan, stops_deg: f64) -> (TurnWatch, TurnStep) {
    let mut watch = TurnWatch::new(plan);
    let mut step = TurnStep::Ready;
    let mut at_deg = 0.0;
    let mut readings = hand.rest(5.0);
    for m in 1..=plan.turns {
        let mark_deg = if m % 2 == 1 { plan.degrees } else { 0.0 } + stops_deg * hand.random.normal();
        let seconds = 9.0 + hand.random.uniform();
        readings.extend(hand.moved(up_deg(mark_deg - at_deg), seconds));
        readings.extend(hand.rest(5.0));
        at_deg = mark_deg;
    }
    for reading in &readings {
        step = watch.push(reading).unwrap();
        if step == TurnStep::Done {
            break;
        }
    }
    (watch, step)
}

fn nothing() -> MeasuredSensor {
    MeasuredSensor::new(&Settings::DEFAULT)
}

/// Returns a sensor with errors within the data sheet.
fn part(seed: u64) -> Hand {
    let mut hand = Hand::new(seed);
    hand.gyro = hand.matrix(0.03, 0.02);
    hand.gyro_g_dps = hand.matrix(0.1, 0.1);
    hand.accel = hand.matrix(0.03, 0.02);
    hand.offset_g = Vector3::from_fn(|_, _| hand.within(0.05));
    hand.bias_dps = Vector3::from_fn(|_, _| hand.within(20.0));
    hand.drift_dps = Vector3::from_fn(|_, _| hand.within(2e-4));
    hand
}

/// Returns the accelerometer as measured by six poses.
fn posed(hand: &mut Hand) -> MeasuredSensor {
    let mut known = nothing();
    for (i, axis) in AXES.iter().enumerate() {
        let value = hand.offset_g[i] + 0.0005 * hand.random.normal();
        known.set("accel_offset_g", axis, Estimate { value, u: 0.0005 });
        for j in (0..3).filter(|j| *j != i) {
            let value = hand.accel[(i, j)] + 0.005 * hand.random.normal();
            known.set("accel_cross", &pair(i, j), Estimate { value, u: 0.005 });
        }
    }
    known
}

#[test]
fn intervals_without_the_poses_are_wide_and_contain_the_truth() {
    let (mut inside, mut u) = (0, 0.0);
    for seed in 0..50 {
        let mut hand = part(500 + seed);
        let (watch, _) = turned(&mut hand, PLAN, 0.5);
        let scale = watch.result(1.0, &nothing(), 0.0).unwrap().scale;
        inside += u32::from((scale.value - hand.gyro[(2, 2)]).abs() < 1.96 * scale.u);
        u += scale.u / 50.0;
    }
    println!("{inside} of 50, mean u {u:.5}");
    assert!(inside >= 45 && u < 0.004, "{inside}, {u}");
}

#[test]
fn intervals_of_the_scale_contain_the_truth() {
    let seeds = 200;
    let (mut inside, mut offs) = (0, Vec::new());
    for seed in 0..seeds {
        let mut hand = part(seed);
        let (watch, step) = turned(&mut hand, PLAN, 0.5);
        assert_eq!((step, watch.count()), (TurnStep::Done, 6), "seed {seed}");
        // The marks are taken as exact.
        let result = watch.result(0.0, &posed(&mut hand), 0.0).unwrap();
        assert_eq!((result.freedom, result.is_consistent), (4, true));
        let off = (result.scale.value - hand.gyro[(2, 2)]).abs() / result.scale.u;
        inside += u32::from(off < 1.96);
        offs.push(off / 1.96);
    }
    offs.sort_by(f64::total_cmp);
    println!("{inside} of {seeds} inside 95 %, median of error over ± {:.2}", offs[offs.len() / 2]);
    assert!((180..=198).contains(&inside), "{inside}");
    assert!((0.2..0.5).contains(&offs[offs.len() / 2]), "{}", offs[offs.len() / 2]);
}

#[test]
fn intervals_of_the_cross_axis_terms_contain_the_truth() {
    let (mut inside, mut count) = (0, 0);
    for seed in 0..100 {
        let mut hand = part(1000 + seed);
        let (watch, _) = turned(&mut hand, PLAN, 0.5);
        let result = watch.result(1.0, &posed(&mut hand), 0.0).unwrap();
        for i in 0..2 {
            let cross = result.cross[i].unwrap();
            inside += u32::from((cross.value - hand.gyro[(i, 2)]).abs() < 1.96 * cross.u);
            count += 1;
            assert!(cross.u < Sensor::of_data_sheet().gyro_cross[i][2].u);
        }
    }
    println!("{inside} of {count}");
    assert!(inside as f64 >= 0.9 * f64::from(count), "{inside} of {count}");
}

#[test]
fn an_axis_that_leans_is_told_from_the_scale() {
    for seed in 0..20 {
        let mut hand = Hand::new(seed);
        hand.gyro[(2, 2)] = 0.025;
        // A lean of 2° in the mounting, which the accelerometer measures.
        hand.attitude = UnitQuaternion::from_scaled_axis(Vector3::new(0.035, -0.02, 0.3));
        let (watch, _) = turned(&mut hand, PLAN, 0.0);
        let result = watch.result(0.0, &posed(&mut hand), 0.0).unwrap();
        assert!((result.scale.value - 0.025).abs() < 3.0 * result.scale.u, "{result:?}");
        // Without the lean it would be 0.0008 less.
        assert!((result.scale.value - 0.025).abs() < 4e-4, "{result:?}");
    }
}

#[test]
fn a_sensor_upside_down_and_a_clockwise_start_give_the_same_scale() {
    let mut hand = Hand::new(3);
    hand.gyro[(2, 2)] = -0.021;
    hand.attitude = UnitQuaternion::from_scaled_axis(Vector3::x() * std::f64::consts::PI);
    let (watch, _) = turned(&mut hand, PLAN, 0.2);
    let result = watch.result(1.0, &nothing(), 0.0).unwrap();
    assert!(result.is_consistent && (result.scale.value + 0.021).abs() < 2.0 * result.scale.u, "{result:?}");
    assert!(result.turned_deg[0] < 0.0);

    let mut hand = Hand::new(4);
    hand.gyro[(2, 2)] = -0.021;
    let mut watch = TurnWatch::new(TurnPlan { turns: 1, ..PLAN });
    let mut readings = hand.rest(5.0);
    readings.extend(hand.moved(up_deg(-720.0), 10.0));
    readings.extend(hand.rest(5.0));
    assert!(readings.iter().any(|reading| watch.push(reading).unwrap() == TurnStep::Done));
    let result = watch.result(1.0, &nothing(), 0.0).unwrap();
    assert!(!result.is_consistent && result.cross == [None; 3], "{result:?}");
    assert!((result.scale.value + 0.021).abs() < 2.0 * result.scale.u && result.freedom == 0, "{result:?}");
}

#[test]
fn a_clock_that_is_fast_is_taken_off() {
    let mut hand = Hand::new(5);
    let (watch, _) = turned(&mut hand, PLAN, 0.0);
    let result = watch.result(0.0, &nothing(), 0.005).unwrap();
    assert!((result.scale.value - (1.0 / 1.005 - 1.0)).abs() < 1e-4, "{result:?}");
}

/// Returns the first error of these movements, each a rotation about the world's axes in degrees, followed by a rest.
fn error_of(movements: &[Vector3<f64>]) -> NotMeasured {
    let mut hand = Hand::new(6);
    let mut watch = TurnWatch::new(PLAN);
    let mut readings = hand.rest(5.0);
    for movement in movements {
        readings.extend(hand.moved(*movement, 10.0));
        readings.extend(hand.rest(25.0));
    }
    readings.iter().find_map(|reading| watch.push(reading).err()).expect("no error")
}

#[test]
fn every_mistake_of_the_hand_is_named() {
    let half = error_of(&[up_deg(360.0)]);
    assert_eq!(half.to_string(), "turn 1 stopped at 360° of 720°");
    let same = error_of(&[up_deg(720.0), up_deg(720.0)]);
    assert!(same.to_string().starts_with("turn 2 went the wrong way: "), "{same}");
    assert!(same.to_string().ends_with("° instead of -720°"), "{same}");
    let other = error_of(&[Vector3::x() * 90.0]);
    assert!(other.to_string().contains("° about x, and by "), "{other}");
    let far = error_of(&[up_deg(1080.0)]);
    assert!(far.to_string().starts_with("turn 1 went on to "), "{far}");

    let mut hand = Hand::new(7);
    let mut watch = TurnWatch::new(TurnPlan { axis: 0, ..PLAN });
    let error = hand.rest(5.0).iter().find_map(|reading| watch.push(reading).err());
    assert_eq!(error.unwrap().to_string(), "x is not vertical: +z points up");
    let mut watch = TurnWatch::new(PLAN);
    let waiting = hand.rest(70.0).iter().find(|reading| watch.push(reading).unwrap() == TurnStep::Done).copied();
    assert!(waiting.is_some_and(|reading| reading.time_s < 80.0));
    let error = watch.result(1.0, &nothing(), 0.0).unwrap_err();
    assert_eq!(error.to_string(), "the sensor was not turned within 60 s");
}

#[test]
fn a_pause_within_a_turn_and_a_jolt_before_it_are_no_mistakes() {
    let mut hand = Hand::new(8);
    hand.gyro[(2, 2)] = 0.012;
    let mut watch = TurnWatch::new(TurnPlan { turns: 1, ..PLAN });
    let mut readings = hand.rest(5.0);
    readings.extend(hand.moved(up_deg(6.0), 0.5));
    readings.extend(hand.rest(5.0));
    readings.extend(hand.moved(up_deg(300.0), 5.0));
    readings.extend(hand.rest(6.0));
    readings.extend(hand.moved(up_deg(420.0), 5.0));
    readings.extend(hand.rest(5.0));
    assert!(readings.iter().any(|reading| watch.push(reading).unwrap() == TurnStep::Done));
    let result = watch.result(0.0, &nothing(), 0.0).unwrap();
    assert!((result.scale.value - 0.012).abs() < 2e-4, "{result:?}");
}
