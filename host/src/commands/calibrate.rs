//! `biflag calibrate`: fits a robot's parameters to its trials.

use super::answer::{Answer, Outcome, are_slight, finding_line};
use super::options::{closure, cores, written_as};
use crate::plan::robot;
use crate::progress::Progress;
use crate::statistics::each_once;
use crate::twin::calibrate::{self, Calibration, FitTrial, Parameter, Request};
use crate::{output, text, twin};
use rayon::prelude::*;
use sim::body::closure::Closure;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use system::shell::quoted;

/// Fit parameters of the robot to recorded trials, with their uncertainties, and write a robot file.
#[derive(clap::Args, Debug)]
#[command(after_help = "Examples:\n  \
    biflag calibrate glycerin -o fitted.toml\n  \
    biflag calibrate glycerin/*.mcap --fit tether,viscosity -o fitted.toml\n  \
    biflag compare glycerin --robot fitted.toml\n  \
    biflag calibrate glycerin --fit phase --robot fitted.toml -o glycerin.toml\n\
    The trials should begin with a still phase and have different speeds.")]
pub struct Args {
    /// Logs or session folders.
    #[arg(required = true)]
    logs: Vec<PathBuf>,
    /// The robot file to write, which must not exist yet.
    #[arg(short, long, value_name = "FILE", value_parser = written_as(&["toml"]))]
    out: PathBuf,
    /// The parameters to fit: tether, righting, drag, viscosity, young, mount-yaw, phase; by default all except young
    /// and phase.
    ///
    /// `phase` fits the angles of the flagella at zero encoder counts. It needs logs from one start of the board, at
    /// speeds that are equal or in a simple ratio.
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    fit: Vec<Parameter>,
    /// The robot to start from (a robot file, `physical` or `published`); by default the robot of the first log.
    #[arg(long, value_name = "FILE|NAME")]
    robot: Option<PathBuf>,
    /// The closure; by default the closure of the first log's model, or `full`.
    #[arg(long, value_parser = closure())]
    closure: Option<Closure>,
    /// Number of parallel simulations; by default the number of cores.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    jobs: Option<u16>,
}

/// Number of rounds of a typical fit, to estimate the remaining time.
const USUAL_ROUNDS: usize = 8;

/// Number of parameters that are fitted to most robots if none is named.
const USUAL_PARAMETERS: usize = 4;

pub fn run(args: &Args) -> miette::Result<Answer> {
    // Check first that the file can be written, because a fit may take an hour.
    output::check_new(&args.out)?;
    let parameters = each_once(args.fit.iter().copied());
    let robot = args.robot.as_deref().map(robot::load).transpose()?.map(|file| file.parse()).transpose()?;
    let (mut logs, mut left_out) = (Vec::new(), Vec::new());
    for path in &args.logs {
        let (of_path, without_trial) = twin::logs(path)?;
        logs.extend(of_path);
        left_out.extend(without_trial);
    }
    let jobs = args.jobs.map_or_else(cores, usize::from);
    let request = Request { robot, closure: args.closure, parameters, jobs };

    let fitted = if request.parameters.is_empty() { USUAL_PARAMETERS } else { request.parameters.len() };
    let simulations = USUAL_ROUNDS * (fitted + 1) * logs.len();
    let progress = Progress::new(simulations as f64);
    progress.phase(&text::count(logs.len(), "trial"), &text::count(fitted, "parameter"));
    let done = AtomicUsize::new(0);
    let simulated = || {
        let count = done.fetch_add(1, Ordering::Relaxed) + 1;
        // The number of simulations is unknown in advance.
        progress.within(count.min(simulations - 1) as f64);
        true
    };
    let trials: Vec<_> = logs.par_iter().map(FitTrial::read).collect::<Result<_, _>>()?;
    let mut calibration = calibrate::calibrate(trials, &request, &simulated)?;
    progress.finish();
    calibration.findings.extend(left_out);

    output::write_new(&args.out, &calibrate::to_toml(&calibration))?;
    let is_good = calibration.is_sound() && are_slight(&calibration.findings);
    let mut text = describe(&calibration, &args.out);
    let [log, robot] = [&args.logs[0], &args.out].map(|path| quoted(&path.to_string_lossy()));
    let _ = write!(text, "\nnext: biflag compare {log} --robot {robot}");
    Ok(Answer::new(Outcome::of(is_good), &calibration, text)?.with("robot", args.out.to_string_lossy()))
}

fn describe(calibration: &Calibration, out: &Path) -> String {
    let mut text = format!("{:<10} {:>11} {:>11} {:>25}  unit\n", "parameter", "start", "fitted", "95 % interval");
    // Writing to a string cannot fail.
    for p in &calibration.parameters {
        let [low, high] = p.interval_95;
        let [start, value, low, high] = [p.start, p.value, low, high].map(text::figure);
        let _ = write!(text, "{:<10} {start:>11} {value:>11} {low:>11} to {high:>10}  {}", p.name, p.unit);
        let model =
            p.model_error.map_or_else(String::new, |error| format!("; ± {error:.1e} of it by the error of the model"));
        text += &(model + "\n");
    }
    let mount = &calibration.mounting;
    let [pitch, roll] = [mount.pitch_deg, mount.roll_deg].map(|deg| text::decimal(deg, 2));
    let _ = writeln!(text, "sensor at rest: pitch {pitch}, roll {roll} deg");
    let Calibration { weighted: [before, after], rmse_before_deg, rmse_after_deg, trials, .. } = calibration;
    let trials = text::count(trials.len(), "trial");
    let misfit =
        format!("weighted misfit {before:.3} before, {after:.3} after, in standard uncertainties, over {trials}");
    let _ = writeln!(text, "{misfit}; RMSE {rmse_before_deg:.3} deg before, {rmse_after_deg:.3} deg after");
    let number = format!("condition number of the correlations {:.0}", calibration.condition_number);
    let _ = writeln!(text, "{number} (if large, the parameters are hardly separable)");
    text.extend(calibration.findings.iter().map(|found| finding_line(Some(&found.log), &found.finding) + "\n"));
    let warnings = calibration.cannot_tell.iter().chain(&calibration.misfits).chain(&calibration.warnings);
    text.extend(warnings.map(|line| format!("warning: {line}\n")));
    text.extend(calibration.notes.iter().map(|line| format!("note: {line}\n")));
    text + &format!("robot {}", out.display())
}
