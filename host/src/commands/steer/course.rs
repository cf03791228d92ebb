//! The task: the wanted attitude, the source of the speeds, and the plan of the one trial.

use super::Args;
use crate::aim::{self, Quantity, Target};
use crate::plan::{Plan, RobotFile};
use protocol::units::CentiRpm;
use study::steer::{Controller, Map, PATIENCE_OF_MODEL, PATIENCE_OF_RIG, Pilot, Policy, Wanted};

/// The task of a steered trial.
pub struct Course {
    /// The attitude.
    pub wanted: Wanted,
    /// The source of the speeds.
    pub pilot: Pilot,
    /// The plan, with one trial. Its speeds are the feed-forward.
    pub plan: Plan,
    /// The table's values at these speeds.
    pub expected: Expected,
}

/// A table's values for the feed-forward.
#[derive(Clone, Copy, Debug)]
pub struct Expected {
    /// Tilt of the robot.
    pub tilt_deg: f64,
    /// Whether the built-in controller holds an attitude in which the flagella touch.
    pub touches: bool,
}

impl Expected {
    /// Returns a note for the user before the run.
    pub fn note(&self) -> Option<String> {
        let note = "the flagella touch near these speeds, where the attitude jumps: it may not be reached or held";
        self.touches.then(|| note.to_owned())
    }
}

impl Course {
    /// Returns the course of the arguments, and starts the policy. `robot`: the steered robot.
    ///
    /// # Errors
    /// [`study::steer::SteerError`] for an attitude out of reach or a policy that does not start; errors of files.
    pub fn new(args: &Args, robot: RobotFile) -> miette::Result<Self> {
        let of_robot = robot.parse()?;
        let table = args.table.as_deref().map_or_else(aim::shipped, |path| aim::load(path, &of_robot))?;
        let (wanted, rpm, expected, pilot) = match &args.policy {
            None => {
                let map = Map::of_table(&table, args.yaw, args.pitch)?;
                let expected = Expected { tilt_deg: map.tilt_deg, touches: map.touches };
                (map.wanted, map.rpm, expected, Pilot::Controller(Controller::new(map).into()))
            }
            Some(command) => {
                let target = Target::new([(Quantity::Yaw, Some(args.yaw)), (Quantity::Pitch, Some(args.pitch))])?;
                let nearest = aim::nearest(&table, &target)?;
                let patience = if args.model || args.lock_step { PATIENCE_OF_MODEL } else { PATIENCE_OF_RIG };
                let wanted = Wanted { yaw_deg: args.yaw, pitch_deg: args.pitch };
                let own = command == "-";
                let pilot = Pilot::Policy(if own { Policy::own(patience) } else { Policy::start(command, patience)? });
                (wanted, nearest.rpm, Expected { tilt_deg: nearest.attitude.tilt_deg(), touches: false }, pilot)
            }
        };
        let plan = Plan { robot, ..plan(args, rpm)? };
        Ok(Self { wanted, pilot, plan, expected })
    }
}

/// Returns a plan with one trial.
fn plan(args: &Args, rpm: [f64; 2]) -> miette::Result<Plan> {
    let [w1, w2] = rpm.map(|rpm| CentiRpm::from_rpm(rpm).rpm());
    let still = match args.rest {
        _ if args.model => "calibrate = 0\npreroll = 0\ndecay = 0".to_owned(),
        0.0 => "calibrate = 0\npreroll = 0\ndecay = 0\nrest_at_most = 0".to_owned(),
        rest_s => format!("preroll = {rest_s}"),
    };
    let (yaw, pitch, run_s) = (args.yaw, args.pitch, args.run_s);
    let text = format!(
        "[session]\nname = \"steer_yaw{yaw:+}_pitch{pitch:+}\"\n\n[trial]\n{still}\nrun = {run_s}\n\n[speeds]\npairs = [[{w1}, {w2}]]\n"
    );
    Ok(Plan::parse(&text, "steer")?)
}
