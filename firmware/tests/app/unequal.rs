//! Two motors, two axes maps, two encoders that differ: what is of one is not of the other.

use super::*;
use protocol::units::Axis;

/// Settings in which nothing is the same for both motors or both sensors, and no axis is where it was.
fn unequal() -> Settings {
    let map = |names: [&str; 3]| AxisMap(names.map(|name| Axis::from_name(name).unwrap()));
    Settings {
        gyro_axes: map(["-y", "+z", "-x"]),
        accel_axes: map(["+z", "-x", "-y"]),
        gyro_bias: [310.0, -120.0, 55.0],
        motor_reversed: [true, false],
        encoder_reversed: [false, true],
        moving_duty: [20, 250],
        bandgap: Millivolts(1043),
        ..Settings::DEFAULT
    }
}

fn with(settings: Settings) -> Bench {
    let mut bench = streaming();
    assert_eq!(bench.ask(Command::WriteSettings(settings)), Reply::Done);
    bench.ticks(2);
    bench
}

/// The sensor's readings, counts, for an acceleration and rates in body axes. Entry i of a map is the sensor's axis that
/// reads body axis i.
fn sensor_reads(settings: &Settings, accel: [f64; 3], rates_dps: [f64; 3]) -> ([i16; 3], [i16; 3]) {
    let (mut accel_counts, mut gyro_counts) = ([0; 3], settings.gyro_bias.map(|bias| bias as i16));
    for body in 0..3 {
        let (a, g) = (settings.accel_axes.0[body], settings.gyro_axes.0[body]);
        let sign = |axis: Axis| if axis.is_negative() { -1.0 } else { 1.0 };
        accel_counts[a.index()] = (sign(a) * accel[body] * 16384.0).round() as i16;
        gyro_counts[g.index()] += (sign(g) * rates_dps[body] * 131.0).round() as i16;
    }
    (accel_counts, gyro_counts)
}

#[test]
fn each_sensor_is_turned_by_its_own_map_and_the_bias_is_of_the_sensors_axes() {
    let settings = unequal();
    for (axis, up) in [(2, [0.0, 0.0, 1.0]), (0, [1.0, 0.0, 0.0]), (1, [0.0, -1.0, 0.0])] {
        let mut bench = with(settings);
        // At rest first, then a turn by 45 degrees about the vertical.
        let (accel, gyro) = sensor_reads(&settings, up, [0.0; 3]);
        bench.world.set_sample(accel, gyro);
        bench.ask(Command::WriteSettings(settings));
        bench.ticks(200);
        let before = bench.look().attitude.to_f64();
        let mut rates = [0.0; 3];
        rates[axis] = 45.0;
        let (accel, gyro) = sensor_reads(&settings, up, rates);
        bench.world.set_sample(accel, gyro);
        bench.ticks(200);
        let after = bench.look().attitude.to_f64();
        // The rotation from before to after is about the vertical, by 45 degrees, and the body's `up` stays up.
        let [w, x, y, z] = multiply(after, conjugate(before));
        let yaw = 2.0 * z.atan2(w).to_degrees();
        let expected = 45.0 * up[axis];
        assert!((yaw - expected).abs() < 0.5 && x.hypot(y) < 2e-3, "{yaw} of {expected}: {w} {x} {y} {z}");
        assert!((rotate(after, up)[2] - 1.0).abs() < 1e-4, "{:?}", rotate(after, up));
    }
}

fn multiply(a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
    let ([a0, a1, a2, a3], [b0, b1, b2, b3]) = (a, b);
    [
        a0 * b0 - a1 * b1 - a2 * b2 - a3 * b3,
        a0 * b1 + a1 * b0 + a2 * b3 - a3 * b2,
        a0 * b2 - a1 * b3 + a2 * b0 + a3 * b1,
        a0 * b3 + a1 * b2 - a2 * b1 + a3 * b0,
    ]
}

fn conjugate([w, x, y, z]: [f64; 4]) -> [f64; 4] {
    [w, -x, -y, -z]
}

/// Returns a vector in body axes in world axes.
fn rotate(attitude: [f64; 4], [x, y, z]: [f64; 3]) -> [f64; 3] {
    let [_, x, y, z] = multiply(multiply(attitude, [0.0, x, y, z]), conjugate(attitude));
    [x, y, z]
}

#[test]
fn a_new_start_of_the_attitude_forgets_the_bias_that_it_estimated() {
    // The sensor turns by 1 degree a second about a horizontal axis that gravity denies: a bias.
    let mut bench = with(Settings { attitude_ki: 0.5, ..Settings::DEFAULT });
    bench.world.set_sample([0, 0, 16384], [131, 0, 0]);
    bench.ticks(6000);
    // Calibrated now, and the estimate with it.
    let settings = Settings { attitude_ki: 0.5, attitude_kp: 0.0, gyro_bias: [131.0, 0.0, 0.0], ..Settings::DEFAULT };
    assert_eq!(bench.ask(Command::WriteSettings(settings)), Reply::Done);
    bench.ticks(400);
    let [_, x, ..] = bench.look().attitude.to_f64();
    assert!(x.abs() < 1e-3, "tilted by {} degrees", 2.0 * x.asin().to_degrees());
}

#[test]
fn each_motor_and_encoder_has_its_own_direction() {
    let mut bench = with(unequal());
    assert_eq!(bench.ask(Command::SetSpeeds([CentiRpm(3000), CentiRpm(4500)])), Reply::Done);
    bench.speed = [1, -2];
    bench.ticks(5);
    let frame = bench.look();
    assert!(frame.speed[0].0 > 0 && frame.speed[1].0 > 0, "{:?}", frame.speed);
    assert_eq!(frame.encoder, [EncoderCounts(6), EncoderCounts(12)]);
    bench.world.change(|state| assert_eq!(state.pins, [false, true, true, false, true]));
}

#[test]
fn each_motor_is_judged_by_its_own_settings() {
    // Motor 2 stands still at duties from 20 to 200, which would turn motor 1.
    let mut bench = with(unequal());
    bench.ask(Command::SetSpeeds([CentiRpm(2200), CentiRpm(800)]));
    bench.speed = [1, 0];
    bench.ticks_alive(260);
    let frame = bench.look();
    assert!((150..250).contains(&frame.duty[1].0), "{:?}", frame.duty);
    assert_eq!(frame.fault, Fault::None);
    bench.speed = [0, -1];
    bench.ticks_alive(230);
    assert_eq!(bench.look().fault, Fault::Encoder1Failed);
}

#[test]
fn the_supply_is_measured_by_the_bandgap_of_the_settings() {
    let mut bench = with(unequal());
    bench.bandgap_counts = Some(225);
    // 1043 mV * 1024 / 225
    assert_eq!(bench.look().supply, Millivolts(4747));
}

#[test]
fn a_motor_that_was_off_starts_without_the_integral_of_before() {
    for motor in [0, 1] {
        let mut bench = streaming();
        let target = |rpm: i16| {
            let mut target = [CentiRpm(4000); 2];
            target[motor] = CentiRpm(rpm * 100);
            Command::SetSpeeds(target)
        };
        let first = |bench: &mut Bench| {
            bench.ask(target(30));
            bench.look().duty[motor]
        };
        let at_first = first(&mut bench);
        bench.ticks_alive(100);
        assert!(bench.look().duty[motor].0 > 2 * at_first.0, "the integral has grown");
        // By a target of zero while the other one goes on, by a stop, and by a target of zero for both.
        bench.ask(target(0));
        bench.ticks_alive(3);
        assert_eq!(first(&mut bench), at_first, "motor {motor} after its target was zero");
        for order in [Command::Stop, Command::SetSpeeds(OFF)] {
            bench.ticks_alive(50);
            bench.ask(order);
            bench.ticks_alive(3);
            assert_eq!(first(&mut bench), at_first, "motor {motor} after {order:?}");
        }
    }
}

#[test]
fn the_first_edge_after_a_standstill_tells_no_speed() {
    let mut bench = streaming();
    bench.speed = [3, -2];
    bench.ticks(100);
    assert!(bench.look().speed[0].0 > 5000);
    bench.speed = [0, 0];
    bench.ticks(220);
    assert_eq!(bench.look().speed, OFF);
    bench.speed = [1, -1];
    bench.tick();
    bench.speed = [0, 0];
    assert_eq!(bench.telemetry.last().unwrap().speed, OFF, "one edge has no speed");
}
