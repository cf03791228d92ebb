//! The robot's parameters: limits and their messages.

use sim::V3;
use sim::body::closure::Closure;
use sim::fluid::walls::Walls;
use sim::params::{BUILT_IN, Face, Glycerol, HeadShape, Robot, Tank};
use sim::step::Solver;

#[test]
fn the_built_in_robots_are_possible() {
    for name in BUILT_IN {
        let robot = Robot::built_in(name).expect(name);
        robot.validate().expect(name);
        assert_eq!(robot.flagellum.edges(), 49);
    }
    assert!((Robot::published().base_drag() - 3.55e-5).abs() < 1e-6);
    assert_eq!(Robot::built_in("physical"), Some(Robot::default()));
    assert_eq!(Robot::built_in("published"), Some(Robot::published()));
    assert_eq!(Robot::built_in("my.toml"), None);
    assert!((Robot::default().fluid.regularisation_radii - 0.5f64.exp()).abs() < 1e-4, "a round rod");
}

#[test]
fn a_regularisation_above_the_edge_length_is_possible() {
    let mut robot = Robot::default();
    robot.flagellum.edge_length_m = 0.0025;
    robot.validate().expect("half the edge length");
    assert!(robot.epsilon() > robot.flagellum.edge_length_m);
}

#[test]
fn impossible_values_name_their_key() {
    type Change = fn(&mut Robot);
    let cases: [(&str, Change); 18] = [
        ("flagellum.rod_radius_m", |r| r.flagellum.rod_radius_m = -1e-3),
        ("flagellum.pitch_m", |r| r.flagellum.pitch_m = 5e-3),
        ("flagellum.helix_radius_m", |r| (r.flagellum.helix_radius_m, r.flagellum.pitch_m) = (0.001, 0.004)),
        ("flagellum.edge_length_m", |r| r.flagellum.edge_length_m = 0.02),
        ("flagellum.edge_length_m", |r| (r.flagellum.edge_length_m, r.fluid.regularisation_radii) = (1e-4, 0.11)),
        ("fluid.regularisation_radii", |r| r.fluid.regularisation_radii = 20.0),
        ("fluid.viscosity_pa_s", |r| r.fluid.viscosity_pa_s = f64::NAN),
        ("base.motor_distance_m", |r| r.base.motor_distance_m = 0.02),
        ("base.inertia_kg_m2", |r| r.base.inertia_kg_m2[2] = 0.0),
        ("contact.tolerance_m", |r| r.contact.tolerance_m = 0.0),
        ("head.radius_m", |r| r.head.radius_m = f64::NAN),
        ("head.radius_m", |r| (r.head.radius_m, r.head.centre_m[2]) = (0.03, -0.03)),
        ("head.radius_m", |r| (r.head.length_m, r.head.centre_m[2]) = (0.08, -0.04)),
        ("head.length_m", |r| r.head.length_m = 1e-3),
        ("head.centre_m", |r| r.head.centre_m[1] = f64::INFINITY),
        ("solver.step_rad", |r| r.solver.step_rad = f64::INFINITY),
        ("solver.step_error", |r| r.solver.step_error = 0.0),
        ("solver.gauss_points", |r| r.solver.gauss_points = 9),
    ];
    for (key, change) in cases {
        let mut robot = Robot::default();
        change(&mut robot);
        let error = robot.validate().expect_err(key);
        assert_eq!(error.key, key, "{error}");
        assert!(Solver::new(&robot, Closure::Full).is_err());
        assert!(error.to_string().contains(key) && error.reason.len() > 10, "{error}");
    }
}

/// The publication's tank.
fn tank() -> Tank {
    let text =
        r#"{"length_m": 1.22, "width_m": 0.45, "height_m": 0.515, "joint_m": [0.61, 0.225], "joint_depth_m": 0.14}"#;
    serde_json::from_str(text).expect("a tank")
}

#[test]
fn tanks_hold_the_robot() {
    let with = |change: fn(&mut Tank)| {
        let mut robot = Robot { tank: Some(tank()), ..Robot::default() };
        change(robot.tank.as_mut().expect("a tank"));
        robot.validate()
    };
    with(|_| {}).expect("the publication's tank");
    with(|t| t.joint_m = [0.05, 0.4]).expect("in a corner");
    with(|t| (t.walls, t.free_surface) = (vec![Face::PlusZ], false)).expect("a lid alone");
    type Change = fn(&mut Tank);
    let cases: [(&str, Change); 10] = [
        ("tank.length_m", |t| t.length_m = -1.0),
        ("tank.height_m", |t| t.height_m = f64::NAN),
        ("tank.joint_m", |t| t.joint_m[0] = 0.03),
        ("tank.joint_m", |t| t.joint_m[1] = 0.43),
        ("tank.joint_m", |t| t.joint_m[1] = f64::NAN),
        ("tank.joint_depth_m", |t| t.joint_depth_m = -0.01),
        ("tank.joint_depth_m", |t| t.joint_depth_m = 0.28),
        ("tank.walls", |t| t.walls = vec![Face::MinusX, Face::MinusZ, Face::MinusX]),
        ("tank.walls", |t| (t.walls, t.free_surface) = (vec![], false)),
        ("tank.free_surface", |t| t.walls = Face::ALL.to_vec()),
    ];
    for (key, change) in cases {
        let error = with(change).expect_err(key);
        assert_eq!(error.key, key, "{error}");
    }
}

#[test]
fn tanks_stand_about_the_joint() {
    let walls = Walls::of(&tank());
    for (x, clearance) in [
        (V3::zeros(), 0.14),
        (V3::new(0.0, 0.1, 0.0), 0.125),
        (V3::new(0.0, -0.2, -0.1), 0.025),
        (V3::new(0.6, 0.0, -0.1), 0.01),
        (V3::new(-0.62, 0.0, -0.1), -0.01),
        (V3::new(0.0, 0.0, -0.365), 0.01),
        (V3::new(0.0, 0.0, 0.13), 0.01),
    ] {
        assert!((walls.clearance(x) - clearance).abs() < 1e-12, "{x}: {}", walls.clearance(x));
    }
    let open = Walls::of(&Tank { walls: vec![Face::MinusY], free_surface: false, ..tank() });
    assert!((open.clearance(V3::new(5.0, 0.0, 5.0)) - 0.225).abs() < 1e-12);
}

#[test]
fn unknown_keys_and_missing_sections() {
    let robot: Robot = serde_json::from_str(r#"{"fluid": {"viscosity_pa_s": 0.5}}"#).expect("defaults fill the rest");
    assert_eq!(robot.fluid.viscosity(), 0.5);
    assert_eq!(robot.flagellum, Robot::default().flagellum);
    let error = serde_json::from_str::<Robot>(r#"{"fluid": {"viscosity": 0.5}}"#).expect_err("no such key");
    assert!(error.to_string().contains("viscosity"), "{error}");
    let again: Robot =
        serde_json::from_str(&serde_json::to_string(&Robot::default()).expect("text")).expect("the same");
    assert_eq!(again, Robot::default());
}

#[test]
fn glycerol_and_water_follow_the_published_table() {
    // Segur and Oberstar 1951, mPa s at 20 degrees Celsius.
    for (fraction, viscosity) in [(0.0, 1.005e-3), (0.5, 6.00e-3), (0.8, 60.1e-3), (0.95, 523e-3), (1.0, 1.41)] {
        let mixture = Glycerol { mass_fraction: fraction, temperature_c: 20.0 };
        assert!((mixture.viscosity_pa_s() / viscosity - 1.0).abs() < 0.05, "{fraction}: {}", mixture.viscosity_pa_s());
    }
    let pure = Glycerol { mass_fraction: 1.0, temperature_c: 20.0 };
    assert!((pure.density_kg_m3() - 1261.0).abs() < 5.0);
    let robot =
        Robot { fluid: sim::params::Fluid { glycerol: Some(pure), ..Default::default() }, ..Default::default() };
    assert_eq!(robot.fluid.viscosity(), pure.viscosity_pa_s());
}

#[test]
fn sizes_of_a_head_that_is_no_body_do_not_matter() {
    for shape in [HeadShape::None, HeadShape::Local] {
        let mut robot = Robot::default();
        (robot.head.shape, robot.head.length_m) = (shape, -1.0);
        robot.validate().expect("a robot without a body in the flow");
    }
}
