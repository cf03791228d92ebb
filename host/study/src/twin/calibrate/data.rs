//! A trial prepared for a fit: means of yaw, pitch and roll over short blocks, and the speeds that drive the model.

use super::super::{TwinError, speeds};
use super::Blocks;
use super::errors::TrialErrors;
use crate::session::Attempt;
use crate::trial::{Data, Finding, Judged, OverTime, Unusable, Want};
use biflag_log::Origin;
use nalgebra::DVector;
use sim::body::closure::Closure;
use sim::params::Robot;
use sim::steady::phase::Ratio;
use sim::step::{InversesAtRest, Solver};
use sim::trial::profile::SpeedProfile;
use sim::trial::{Options, Trial};
use std::path::PathBuf;

/// Length of the blocks, s. Yaw and pitch change over seconds, and a block covers most of a turn of a fast motor.
const BLOCK_S: f64 = 0.5;

/// Number of the model's samples per block.
const SAMPLES: usize = 10;

/// A trial prepared for a fit.
#[derive(Debug)]
pub struct FitTrial {
    pub(super) name: String,
    pub(super) path: PathBuf,
    pub(super) sha256: String,
    pub(super) origin: Origin,
    pub(super) temperature_c: f64,
    /// Mounting of the sensor: pitch and roll at rest, degrees.
    pub(super) askew_deg: [f64; 2],
    /// Findings about the log.
    pub(super) findings: Vec<Finding>,
    /// Whether it measured a real robot.
    pub(super) is_real: bool,
    /// The trial's robot and the closure of its model.
    pub(super) robot: Result<Robot, TwinError>,
    pub(super) closure: Option<Closure>,
    /// As [`Data::ratio`].
    pub(super) ratio: Option<Ratio>,
    /// Whether it was recorded on a rig, with unknown starting angles of the flagella.
    pub(super) is_of_rig: bool,
    /// Number of the board and of its start. Its encoders count from that start.
    pub(super) board_start: Option<[u16; 2]>,
    /// Number of blocks of the run before the first one: how motors without encoders begin to turn is not measured.
    pub(super) before: usize,
    pub(super) measured: Blocks,
    pub(super) errors: TrialErrors,
    /// Viscosity and density of the trial's fluid, relative to the fitted robot's.
    pub(super) fluid: [f64; 2],
    profile: SpeedProfile,
}

impl FitTrial {
    /// Reads the log of a trial and prepares it.
    ///
    /// # Errors
    /// [`TwinError::Log`], and the errors of [`Self::new`].
    pub fn read(log: &Attempt) -> Result<Self, TwinError> {
        Self::new(log.data(Want { hash: true, ..Want::default() })?)
    }

    /// Prepares a trial.
    ///
    /// # Errors
    /// [`TwinError::Unusable`] if it has no run, or no still phase before the run.
    pub fn new(data: Data) -> Result<Self, TwinError> {
        // The decay is part of the fit, so the drift is only estimated from the still phase before the run.
        let Judged { data, angles: zeroed, findings, .. } = Judged::from_rest(data);
        let data = &data;
        let unusable = |reason: &str| {
            let help = "calibrate with trials that begin with a still phase of 10 s or more";
            TwinError::unusable(data, Unusable { reason: reason.to_owned(), help })
        };
        data.check().map_err(|error| TwinError::unusable(data, error))?;
        let Some(steady) = &zeroed.steady else { return Err(unusable("contains no attitude in its run")) };
        let run = &zeroed.run;
        let told_s = data.is_blind().then(|| steady.measured(&zeroed.angles_deg).over_time.span().start);
        let before = told_s.map_or(0, |told_s| ((told_s - run.start) / BLOCK_S).ceil() as usize);
        let start = run.start + before as f64 * BLOCK_S;
        let end = zeroed.span().end.min(data.duration_s);
        let count = ((end - start) / BLOCK_S).floor() as usize;
        let block = |i: usize| start + i as f64 * BLOCK_S..start + (i + 1) as f64 * BLOCK_S;
        let middle = |i: usize| start + (i as f64 + 0.5) * BLOCK_S;
        let means =
            |track: crate::attitude::Track| DVector::from_fn(count, |i, _| track.mean(block(i)).unwrap_or_default());
        let centres: Vec<f64> = (0..count).map(middle).collect();
        let errors = match zeroed.over_time(&centres, BLOCK_S) {
            [Some(yaw), Some(pitch), Some(roll)] => [yaw, pitch, roll],
            // The fit leaves the trial out, and says why: see [`super::select`].
            _ if findings.iter().any(Finding::empties_uncertainty) => {
                std::array::from_fn(|_| OverTime::exact(count))
            }
            _ if data.origin() == Origin::Imported => {
                let reason = "was imported without an uncertainty, or without one of its angles, so that no fit can weigh it".to_owned();
                let help = "import it with --uncertainty, and with yaw, pitch and roll";
                return Err(TwinError::unusable(data, Unusable { reason, help }));
            }
            _ => return Err(match zeroed.drift().map(|drift| drift.variance(run.end)) {
                None => unusable("has no still phase before the run, so the drift of its yaw is unknown"),
                Some(Some(_)) => unusable("has a still phase before the run that is too short"),
                Some(None) => TwinError::unusable(data, Unusable {
                    reason: "was recorded without a calibration of the gyroscope, and its still phase is too short to show \
                             the bias"
                        .to_owned(),
                    help: "calibrate the gyroscope before each trial, or begin with a still phase of 15 s or more",
                }),
            }),
        };
        let measured = zeroed.angles_deg.tracks().map(means);
        let errors = TrialErrors::new(data, errors, &measured, BLOCK_S);
        Ok(Self {
            name: data.trial().name,
            path: data.path.clone(),
            sha256: data.sha256.clone().unwrap_or_default(),
            origin: data.origin(),
            temperature_c: data.temperature_c,
            askew_deg: [zeroed.zero_deg[1], zeroed.zero_deg[2]],
            findings,
            is_real: data.is_real(),
            robot: data.robot().map_err(|source| TwinError::robot(data, source)),
            closure: data.records.model.as_ref().map(|model| model.closure),
            ratio: data.ratio(),
            is_of_rig: [Origin::Rig, Origin::Imported].contains(&data.origin()),
            board_start: (data.records.board.as_ref().filter(|_| !data.is_model()))
                .map(|board| [board.board_id, board.boot_count]),
            errors,
            before,
            measured,
            fluid: [1.0; 2],
            profile: speeds::profile_of_run(data, BLOCK_S / SAMPLES as f64)?,
        })
    }

    pub(super) fn blocks(&self) -> usize {
        self.measured[0].len()
    }

    /// Returns whether both are the same recording, possibly copied, recovered or cut.
    pub(super) fn is_copy_of(&self, other: &Self) -> bool {
        let count = self.blocks().min(other.blocks());
        let of = |trial: &Self| trial.measured.each_ref().map(|block| block.rows(0, count).into_owned());
        of(self) == of(other)
    }

    /// Returns the model's blocks of the trial; `None` if the solver fails.
    pub(super) fn modelled(&self, robot: &Robot, closure: Closure, at_rest: &InversesAtRest) -> Option<Blocks> {
        let mut robot = robot.clone();
        robot.fluid.viscosity_pa_s *= self.fluid[0];
        robot.fluid.density_kg_m3 *= self.fluid[1];
        let rate_hz = SAMPLES as f64 / BLOCK_S;
        let options = Options { rate_hz, shapes: false };
        let mut blocks: [Vec<f64>; 3] = Default::default();
        let mut sums = [0.0; 3];
        // Samples are in the middle of the run's steps, so that their mean is the block's mean.
        let first = ((self.profile.run()[0] - self.profile.start()) * rate_hz).ceil() as usize + self.before * SAMPLES;
        let trial =
            Trial::with_solver(Solver::sharing(&robot, closure, at_rest).ok()?, self.profile.clone(), options).ok()?;
        for (i, sample) in trial.enumerate().skip(first).take(self.blocks() * SAMPLES) {
            let sample = sample.ok()?;
            let angles = [sample.yaw_rad, sample.pitch_rad, sample.roll_rad];
            sums = [0, 1, 2].map(|k| sums[k] + angles[k].to_degrees());
            if (i - first) % SAMPLES == SAMPLES - 1 {
                for (block, sum) in blocks.iter_mut().zip(&mut sums) {
                    block.push(*sum / SAMPLES as f64);
                    *sum = 0.0;
                }
            }
        }
        // The last block may have fewer samples.
        Some(blocks.map(|block| {
            let last = block.last().copied().unwrap_or_default();
            DVector::from_fn(self.blocks(), |i, _| block.get(i).copied().unwrap_or(last))
        }))
    }
}
