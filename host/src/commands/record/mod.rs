//! `biflag record`: records the trials of a plan on the rig.

mod recorded;
mod row;
mod trials;
mod viewers;

pub(super) use trials::check_trial;

use super::answer::{Answer, Outcome, WRONG_USE};
use super::options::{duration, speeds};
use super::virtual_board::SensorArgs;
use super::{board_sensor, plan, settings, virtual_board};
use crate::colour;
use crate::link::{Link, LinkError};
use crate::live::{self, Live};
use crate::plan::line::Lines;
use crate::plan::{EXAMPLE, Plan, Schedule, Trial, board};
use crate::preview::{amount, end_after};
use crate::progress::Progress;
use crate::run::rig::board_copy::BoardCopies;
use crate::run::rig::{Notes, RecordError, SimulatedRobot, VirtualNano, lines, park, preflight};
use crate::session::{self, MANIFEST, Session, Sharing, TrialState};
use crate::signals::interruption;
use biflag_log::Origin;
use protocol::units::CentiRpm;
use protocol::{Command, Settings, SpeedFrom};
use recorded::Recorded;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use study::lock::lock;
use system::shell;
use trials::Rig;
use viewers::Viewers;

/// Run the trials of a plan, or one pair of speeds, on the rig and write a log of each.
///
/// In a terminal, n, a text and Enter write a note with its time into the log of the trial that runs.
#[derive(clap::Args, Debug)]
#[command(
    override_usage = "biflag record [OPTIONS] <PLAN>\n       biflag record [OPTIONS] --speeds <W1,W2> [--run <S>]",
    after_help = format!(
        "Examples:\n  \
        biflag record plan.toml --port /dev/ttyUSB0 --out glycerin-day-1\n  \
        biflag record plan.toml --dry-run\n  \
        biflag record --speeds 50,10 --run 60\n\nA plan, which `biflag new` writes:\n\n{EXAMPLE}"
    )
)]
pub struct Args {
    /// The plan: a TOML file like the one below, or the name of one inside biflag (`biflag plans`).
    #[arg(required_unless_present = "speeds", conflicts_with_all = ["speeds", "run"])]
    plan: Option<PathBuf>,
    /// Speeds of flagella 1 and 2 in rpm instead of a plan, for one trial with the usual phases; write `--speeds=-90,90` if
    /// the first is negative.
    #[arg(long, value_name = "W1,W2", value_parser = speeds, allow_hyphen_values = true)]
    speeds: Option<[CentiRpm; 2]>,
    /// Duration of the run at these speeds, in seconds.
    #[arg(long, value_name = "S", value_parser = duration, default_value = "120", requires = "speeds")]
    run: f64,
    /// Print the trials that would run, their duration and what may be wrong, and stop before the board is used.
    #[arg(long)]
    dry_run: bool,
    /// The serial port of the board; not needed if only one board is plugged in.
    #[arg(long, conflicts_with = "virtual")]
    port: Option<String>,
    /// Record on the emulated board with the simulated robot of the plan; with a file, its sensor replays the counts
    /// recorded from a real sensor.
    #[arg(long = "virtual", value_name = "IMU.csv", num_args = 0..=1, require_equals = true)]
    #[expect(clippy::option_option, reason = "the flag may come without its file")]
    r#virtual: Option<Option<PathBuf>>,
    /// Speed of the emulated board relative to real time: a factor, or `max`.
    #[arg(long, default_value = "max", requires = "virtual")]
    speed: String,
    /// The emulated rig: `encoders`, or one without them or with another bridge: `duty`, `in-in`, `duty-in-in`.
    #[arg(long, value_name = "RIG", requires = "virtual", conflicts_with = "port", default_value = "encoders")]
    rig: String,
    #[command(flatten)]
    sensor: SensorArgs,
    /// Simulate a fault of the emulated board, from its start or from a second of its clock, such as `blocked=2@30`;
    /// may be repeated. `help` lists the faults.
    #[arg(long = "fault", value_name = "NAME[=VALUE][@SECONDS]", requires = "virtual")]
    faults: Vec<String>,
    /// Serve the recording to Foxglove at this address, by default 127.0.0.1:8765.
    #[arg(long, value_name = "ADDR:PORT", num_args = 0..=1, require_equals = true, default_missing_value = live::ADDRESS)]
    live: Option<SocketAddr>,
    /// Show the recording in the browser: the robot, its curves, the trials done, and a button that stops the motors. Only
    /// this computer can reach the page, at an address that is printed.
    #[arg(long)]
    open: bool,
    /// The session folder; by default named after the plan.
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Continue a session, skipping the trials that are complete.
    #[arg(long)]
    resume: bool,
}

pub fn run(args: &Args) -> miette::Result<Answer> {
    if let Some(answer) = virtual_board::help(&args.faults, Some(&args.sensor)) {
        return answer;
    }
    let interrupted = interruption()?;
    let mut plan = match (&args.plan, args.speeds) {
        (Some(path), _) => Plan::load(path)?,
        (None, Some(speeds)) => Plan::of_speeds(speeds, &format!("run = {}", args.run), "")?,
        (None, None) => return Err(miette::miette!(code = WRONG_USE, "give a plan or --speeds")),
    };
    if args.dry_run {
        return plan::preview(&plan);
    }
    let folder = args.out.clone().unwrap_or_else(|| session::folder_named(&plan.name));
    if let Some(answer) = complete(args, &plan, &folder)? {
        return Ok(answer);
    }
    // This comes first, so that a busy address is reported before the board is used.
    let live = args.live.map(Live::listen).transpose()?;
    let interrupted_early = || Answer::new(Outcome::Interrupted, &Recorded::default(), "interrupted");
    let Connected { link, settings, mut player, robot, notes } = match connect(args, &mut plan, &interrupted) {
        Err(report) if matches!(report.downcast_ref(), Some(LinkError::Interrupted)) => return interrupted_early(),
        connected => connected?,
    };
    let origin = if args.r#virtual.is_some() { Origin::VirtualRig } else { Origin::Rig };
    let board = board::to_log(link.info(), &settings);
    let sensor = robot.as_ref().map(|robot| &robot.sensor);
    let open = || -> miette::Result<_> {
        let (session, lock, states) = open(args.resume, &folder, &plan)?;
        let note = session.expect_same_rig(&states, origin, Some(&board), sensor)?;
        Ok((session, lock, states, note))
    };
    // The checks of an existing session come before any motor turns. A new session is created last, so that a refused plan leaves
    // no folder.
    let known = folder.join(MANIFEST).exists().then(&open).transpose()?;
    let is_done = |states: &[TrialState]| states.iter().all(|state| state.complete().is_some());
    let is_done = known.as_ref().is_some_and(|(_, _, states, _)| is_done(states));
    let lines = match if is_done { Ok(None) } else { lines(args, &plan, &link, &interrupted) } {
        Err(RecordError::Interrupted) => return interrupted_early(),
        lines => lines?,
    };
    let (session, _lock, states, note) = known.map_or_else(open, Ok)?;

    let trials = states.iter().map(|state| state.trial.clone()).collect();
    let typed = Notes::default();
    let viewers = Viewers::new(live, args.open, &plan, trials, &typed, &interrupted)?;
    hear_notes(&typed);
    let (mut recorded, todo) = Recorded::of(folder, states)?;
    let outcome = recorded.outcome();
    let mut progress = Progress::new(todo.iter().map(|trial| trial.phases.total_s()).sum());
    let rig = Rig { link, interrupted: &interrupted, robot, lines, typed, session, plan, origin, viewers };
    begin(&todo, origin).iter().for_each(|begin| progress.line(begin));
    note.into_iter().chain(notes).for_each(|note| progress.line(&format!("note: {note}")));
    // Without encoders, no command makes the angles known.
    let knows_angles = board.angle_deg.is_some() || settings.speed_from == SpeedFrom::Duty;
    rig.say_what_is_known(knows_angles, &recorded, &progress);
    rig.viewers.session(&recorded.trials, todo.first());
    rig.viewers.open().iter().for_each(|line| progress.line(line));
    let ended = rig.record(&todo, player.as_mut(), &mut recorded, &mut progress);
    let outcome = match &ended {
        Ok(true) => outcome,
        Ok(false) => Outcome::WithLoss,
        Err(report) if matches!(report.downcast_ref(), Some(RecordError::Interrupted)) => Outcome::Interrupted,
        Err(_) => Outcome::Failed,
    };
    let resumes = ended.as_ref().err().is_some_and(
        |report| !matches!(report.downcast_ref(), Some(RecordError::Preflight(refused)) if refused.changes_plan()),
    );
    if resumes {
        progress.line(&format!("continue with: {}", continuation()));
    }
    rig.viewers.end(match outcome {
        Outcome::Failed => "Ended by an error, the motors are stopped. The terminal says more.",
        Outcome::Interrupted => "Stopped, the motors are off.",
        _ => "Recorded.",
    });
    progress.ring();
    progress.finish();
    recorded.trials.sort_by(|a, b| a.name.cmp(&b.name));
    match ended {
        Err(report) if outcome == Outcome::Failed => Answer::failed(&recorded, &report),
        _ => Answer::new(outcome, &recorded, recorded.end(outcome, todo.len())),
    }
}

/// A board that is ready for the trials of a plan.
struct Connected {
    link: Link,
    settings: Settings,
    player: Option<VirtualNano>,
    robot: Option<SimulatedRobot>,
    notes: Vec<String>,
}

/// Connects to the board, and prepares it for the plan.
fn connect(args: &Args, plan: &mut Plan, interrupted: &AtomicBool) -> miette::Result<Connected> {
    let nano = args.r#virtual.as_ref().map(|imu| start_virtual(args, imu.as_ref(), plan)).transpose()?;
    let port = virtual_board::port(nano.as_ref(), args.port.as_deref())?;
    let (player, robot) = match (nano, &args.r#virtual) {
        (Some(nano), Some(None)) => (None, Some(SimulatedRobot::new(nano, plan, args.sensor.seed(plan.seed))?)),
        (nano, _) => (nano, None),
    };
    let link = Link::open_unless(&port, interrupted)?;
    let note_of_copy = if args.r#virtual.is_some() { None } else { check_settings(&link)? };
    prepare(&link, plan)?;
    let note_of_sensor = board_sensor::complete(plan, &link)?;
    let settings = settings::read(&link)?;
    if plan.has_phases() || plan.trials.iter().any(|trial| trial.reverse.is_some()) {
        settings::need_encoders(&settings)?;
    }
    if args.r#virtual.is_some() && settings.speed_from == SpeedFrom::Encoders {
        // The flagella of the emulated board stand at their marks at power-on.
        link.command(Command::Align)?;
    }
    if plan.has_phases() {
        park::known(&link)?;
    }
    let notes = note_of_copy.into_iter().chain(note_of_sensor).collect();
    Ok(Connected { link, settings, player, robot, notes })
}

/// Returns the lines of motors without encoders. The lines of an emulated board are not stored, so they are measured.
fn lines(args: &Args, plan: &Plan, link: &Link, interrupted: &AtomicBool) -> Result<Option<Lines>, RecordError> {
    let settings = settings::read(link)?;
    if settings.speed_from == SpeedFrom::Encoders {
        return Ok(None);
    }
    let mut lines = match args.r#virtual {
        Some(_) => {
            let measured = lines::measure(link, interrupted, |what| colour::eprint(&format!("{what}\n")))?;
            link.command(Command::WriteSettings(measured.corrected(settings)))?;
            measured.lines
        }
        None => {
            // The board's own id, not one of the plan.
            let lines = BoardCopies::of_user().and_then(|copies| copies.lines(link.info().board_id));
            let lines = lines.ok_or(RecordError::NoLines)?;
            if lines.wiring != Lines::wiring_of(&settings) {
                return Err(RecordError::OtherLines(lines.wiring.to_toml().trim().replace('\n', ", ")));
            }
            lines
        }
    };
    // Before the first trial: a later one would end the session.
    let reached = |lines: &Lines| {
        plan.trials.iter().try_for_each(|trial| Schedule::planned(trial).set_points(Some(lines)).map(|_| ()))
    };
    reached(&lines)?;
    // A trial that does not wait for a still robot would begin with the end of this motion.
    if plan.trials.iter().all(|trial| trial.phases.rest_at_most_s > 0.0) {
        colour::eprint("checking the supply by the speed of each motor; 40 s\n");
        lines::follow_supply(link, interrupted, &mut lines)?;
        reached(&lines)?;
    }
    Ok(Some(lines))
}

/// Creates or resumes a session, for this program alone.
fn open(resume: bool, folder: &Path, plan: &Plan) -> miette::Result<(Session, session::Lock, Vec<TrialState>)> {
    let session = if resume { Session::resume(folder, plan)? } else { Session::create(folder, plan)? };
    let lock = session.lock(Sharing::Alone)?;
    let states = session.checked_states()?;
    Ok((session, lock, states))
}

/// Adds to the notes what the user types after an `n`.
fn hear_notes(typed: &Notes) {
    let into = Notes::clone(typed);
    let text = |line: &str| format!("{line} ").strip_prefix("n ").map(|text| text.trim().to_owned());
    system::terminal::hear(move |line| lock(&into).extend(text(line)));
}

/// Returns the answer about a session of the emulated board that is complete: it needs no board, and so no firmware.
fn complete(args: &Args, plan: &Plan, folder: &Path) -> miette::Result<Option<Answer>> {
    // Other requests to the board need a check against the session.
    let is_plain = args.faults.is_empty()
        && args.sensor == SensorArgs::default()
        && args.live.is_none()
        && !args.open
        && args.speed == "max"
        && args.rig == "encoders";
    if !args.resume || !is_plain || args.r#virtual != Some(None) || !folder.join(MANIFEST).exists() {
        return Ok(None);
    }
    let session = Session::resume(folder, plan)?;
    if !session.states()?.iter().all(|state| state.complete().is_some()) {
        return Ok(None);
    }
    let states = session.checked_states()?;
    session.expect_same_rig(&states, Origin::VirtualRig, None, None)?;
    let (recorded, todo) = Recorded::of(folder.to_owned(), states)?;
    if !todo.is_empty() {
        return Ok(None);
    }
    recorded.say_left_out(&Progress::new(0.0));
    Answer::new(recorded.outcome(), &recorded, recorded.end(recorded.outcome(), 0)).map(Some)
}

/// Describes the remaining trials of a session that begins or continues; `None` if nothing is left to do.
fn begin(todo: &[Trial], origin: Origin) -> Option<String> {
    let duration_s = todo.iter().map(|trial| trial.phases.total_s()).sum();
    let end = match origin {
        // Its clock does not keep the time of day.
        Origin::VirtualRig => "by the clock of the emulated board".to_owned(),
        _ => format!("ends at {} if the robot comes to rest as planned", end_after(duration_s)),
    };
    (!todo.is_empty()).then(|| format!("{}, {end}", amount(todo.len(), duration_s)))
}

/// Returns the command that continues this one.
fn continuation() -> String {
    let command = shell::command_line();
    if command.split(' ').any(|word| word == "--resume") { command } else { format!("{command} --resume") }
}

/// Refuses a board that has lost its settings; otherwise keeps a copy of them. Returns a note for the user.
pub(super) fn check_settings(link: &Link) -> miette::Result<Option<String>> {
    let copies = BoardCopies::of_user();
    preflight::settings(link, copies.as_ref())?;
    Ok(settings::keep(copies.as_ref(), &settings::read(link)?))
}

/// Sends the plan's settings to the board.
fn prepare(link: &Link, plan: &Plan) -> miette::Result<()> {
    link.command(Command::Stop)?;
    if !plan.board.is_empty() {
        let settings = plan.board.apply(settings::read(link)?)?;
        link.command(Command::WriteSettings(settings))?;
    }
    Ok(())
}

/// Starts the emulated board, with a recording for its sensor or with the plan's robot.
fn start_virtual(args: &Args, imu: Option<&PathBuf>, plan: &Plan) -> miette::Result<VirtualNano> {
    let mut arguments: Vec<_> = ["--speed", &args.speed, "--rig", &args.rig].map(Into::into).into();
    arguments.extend(args.sensor.arguments(plan.seed));
    let _file;
    match imu {
        Some(imu) if args.sensor.sensor.is_some() => {
            let imu = imu.display();
            return Err(miette::miette!(code = WRONG_USE, "{imu} has its own sensor's errors: leave out --sensor"));
        }
        Some(imu) => arguments.extend(["--imu".into(), imu.clone().into_os_string()]),
        None => {
            let (robot, file) = virtual_board::robot(&plan.robot)?;
            _file = file;
            arguments.extend(["--robot".into(), robot]);
        }
    }
    virtual_board::start(arguments, &args.faults)
}
