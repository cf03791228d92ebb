use super::*;
use protocol::units::{EncoderCounts, SensorCounts};
use protocol::{State, TICK_HZ, Telemetry};

/// Two motors and encoders that can be wired wrong in every way.
#[derive(Clone, Copy)]
struct Robot {
    settings: Settings,
    /// Whether motor leads are swapped: duty and direction of the flagellum disagree.
    motor_leads: [bool; 2],
    /// Whether the encoder's channels are swapped: it counts against the flagellum.
    channels: [bool; 2],
    /// The flagellum turned by each bridge.
    turns: [usize; 2],
    /// The bridges' supply.
    powered: bool,
    edges_dead: [bool; 2],
    direction_dead: [bool; 2],
    /// Duty below which the motor does not turn.
    dead_zone: [i16; 2],
    /// Whether the motors can turn forwards, backwards.
    ways: [bool; 2],
    position: [f64; 2],
    glitches: u16,
    /// Heat of a blocked motor, as summed by the board without cooling: seconds at full duty.
    heat_s: [f64; 2],
}

impl Robot {
    fn right() -> Self {
        Self {
            settings: Settings::DEFAULT,
            motor_leads: [false; 2],
            channels: [false; 2],
            turns: [0, 1],
            powered: true,
            edges_dead: [false; 2],
            direction_dead: [false; 2],
            dead_zone: [15, 33],
            ways: [true; 2],
            position: [0.0; 2],
            glitches: 0,
            heat_s: [0.0; 2],
        }
    }

    /// Returns whether a positive duty turns the flagellum of a motor forwards, seen from above.
    fn forwards(&self, motor: usize) -> bool {
        !(self.motor_leads[motor] ^ self.settings.motor_reversed[motor])
    }

    fn frame(&self, state: State, gyro: i16) -> Telemetry {
        let encoder = [0, 1].map(|motor| {
            let edges = self.position[motor].floor() as i32;
            let counted = match () {
                () if self.edges_dead[motor] => 0,
                () if self.direction_dead[motor] => edges.rem_euclid(2),
                () => edges,
            };
            let against = self.channels[motor] ^ self.settings.encoder_reversed[motor];
            EncoderCounts(if against { -counted } else { counted })
        });
        Telemetry {
            state,
            encoder,
            gyro: [SensorCounts(0), SensorCounts(gyro), SensorCounts(0)],
            ..Telemetry::default()
        }
    }
}

impl Drive for Robot {
    fn drive(&mut self, motor: usize, duty: i16, duration_ms: u16) -> Result<Driven, RecordError> {
        assert!(duration_ms <= protocol::MAX_DRIVE_MS);
        let before = vec![self.frame(State::Idle, 0); 20];
        let flagellum = self.turns[motor];
        let turns = self.powered && duty.abs() > self.dead_zone[flagellum] && self.ways[usize::from(duty < 0)];
        if !turns {
            self.heat_s[motor] += f64::from(duty).powi(2) / 255.0_f64.powi(2) * f64::from(duration_ms) * 1e-3;
            // The board stops a blocked motor after 2.4 s at full duty.
            assert!(self.heat_s[motor] < 2.0, "the board may refuse the self-test");
        }
        let duty = if self.forwards(motor) { duty } else { -duty };
        // 1305 counts per second at full duty are 130 rpm.
        let rate = if turns { 1305.0 * f64::from(duty) / 255.0 } else { 0.0 };
        let during = (0..u32::from(duration_ms) / 5)
            .map(|_| {
                self.position[flagellum] += rate / f64::from(TICK_HZ);
                let mut frame = self.frame(State::Driving, if turns { 300 * duty.signum() } else { 0 });
                frame.glitches.0 = self.glitches;
                frame
            })
            .collect();
        Ok(Driven { before, during })
    }
}

fn findings(robot: Robot) -> [Finding; 2] {
    run(&mut robot.clone(), &robot.settings, |_| {}).unwrap().map(|test| test.finding)
}

#[test]
fn a_robot_without_faults_is_measured() {
    let [first, second] = run(&mut Robot::right(), &Settings::DEFAULT, |_| {}).unwrap();
    assert_eq!((first.finding, second.finding), (Finding::Agrees, Finding::Agrees));
    assert_eq!((first.moving_duty, second.moving_duty), ([Some(20); 2], [Some(40); 2]));
    assert_eq!((first.moving_setting(), second.moving_setting()), (Some(40), Some(60)));
    assert!(first.full_rpm.iter().all(|rpm| (rpm - 130.0).abs() < 0.5), "{first:?}");
}

#[test]
fn each_wrong_wire_has_its_finding() {
    use Finding::{Agrees, DirectionDead, EdgesDead, OneWay, Opposes, OtherEncoder, Still};
    let right = Robot::right();
    let cases = [
        ("6 V off", Robot { powered: false, ..right }, [Still, Still]),
        ("motors swapped", Robot { turns: [1, 0], ..right }, [OtherEncoder, OtherEncoder]),
        ("channels of 2 swapped", Robot { channels: [false, true], ..right }, [Agrees, Opposes]),
        ("leads of motor 1 swapped", Robot { motor_leads: [true, false], ..right }, [Opposes, Agrees]),
        ("C1 of 1 dead", Robot { edges_dead: [true, false], ..right }, [EdgesDead, Agrees]),
        ("C2 of 2 dead", Robot { direction_dead: [false, true], ..right }, [Agrees, DirectionDead]),
        ("a direction pin is cut", Robot { ways: [true, false], ..right }, [OneWay { forwards: true }; 2]),
    ];
    for (name, robot, expected) in cases {
        assert_eq!(findings(robot), expected, "{name}");
    }
    let jammed = Robot { dead_zone: [15, 300], ..right };
    assert_eq!(findings(jammed), [Agrees, Still]);
}

/// For any leads and settings, the corrected settings make a positive target turn the flagellum counter-clockwise and
/// the encoder count up; without the user's observation they at least make the encoder agree with the duty.
#[test]
fn corrections_make_every_wiring_right() {
    for bits in 0..16 {
        let bit = |bit: u32| bits >> bit & 1 == 1;
        let settings =
            Settings { motor_reversed: [bit(0), false], encoder_reversed: [bit(1), false], ..Settings::DEFAULT };
        let robot = Robot { settings, motor_leads: [bit(2), false], channels: [bit(3), false], ..Robot::right() };
        let [finding, _] = findings(robot);
        let seen = Some(robot.forwards(0));
        let corrected = Robot { settings: correction(settings, 0, finding, seen), ..robot };
        assert!(corrected.forwards(0), "{bits:04b}");
        assert_eq!(findings(corrected), [Finding::Agrees; 2], "{bits:04b}");
        let blind = Robot { settings: correction(settings, 0, finding, None), ..robot };
        assert_eq!(findings(blind), [Finding::Agrees; 2], "{bits:04b}");
        assert_eq!(blind.settings.motor_reversed, settings.motor_reversed);
    }
    let still = correction(Settings::DEFAULT, 0, Finding::Still, Some(false));
    assert_eq!(still, Settings::DEFAULT, "nothing is corrected that does not work");
}

/// A robot that comes to rest, and turns with its motor 2 at any duty if its bridge is of the other kind.
struct Restless {
    rate_dps: f64,
    is_wrong: bool,
}

impl Drive for Restless {
    fn drive(&mut self, motor: usize, duty: i16, duration_ms: u16) -> Result<Driven, RecordError> {
        let driven_dps = if self.is_wrong && motor == 1 && duty > 0 { 8.0 } else { 0.0 };
        let mut frames = |count: u16, more_dps: f64| {
            let frame = |_| {
                self.rate_dps *= (-0.005_f64).exp();
                Robot::right().frame(State::Driving, ((self.rate_dps + more_dps) * 131.0) as i16)
            };
            (0..count).map(frame).collect()
        };
        Ok(Driven { before: frames(20, 0.0), during: frames(duration_ms / 5, driven_dps) })
    }
}

#[test]
fn a_robot_that_comes_to_rest_does_not_look_driven() {
    for (is_wrong, found) in [(false, None), (true, Some(1))] {
        let mut robot = Restless { rate_dps: 40.0, is_wrong };
        assert_eq!(turns_at_idle(&mut robot, &Settings::DEFAULT).unwrap(), found);
    }
}

#[test]
fn moving_duty_has_a_margin_and_a_limit() {
    let test =
        |duty| MotorTest { finding: Finding::Agrees, moving_duty: [Some(10), duty], full_rpm: [100.0; 2], glitches: 0 };
    assert_eq!(
        [Some(20), Some(100), Some(200), None].map(|duty| test(duty).moving_setting()),
        [Some(40), Some(150), Some(255), None]
    );
}
