//! `biflag steer`: reaches an attitude and holds it.

mod args;
mod course;
mod in_model;
mod output;
mod rig;

pub use args::Args;

use super::answer::{Answer, Outcome, wrong_use};
use super::virtual_board;
use crate::link::LinkError;
use crate::plan::robot;
use crate::session::{self, SessionError};
use crate::signals::interruption;
use crate::trial::{Judged, Want};
use biflag_log::SteerMeta;
use course::Course;
use output::Steered;
use study::steer::{Held, RATE_HZ, Steering};

pub fn run(args: &Args) -> miette::Result<Answer> {
    if let Some(answer) = virtual_board::help(&args.faults, Some(&args.sensor)) {
        return answer;
    }
    let interrupted = interruption()?;
    let Course { wanted, pilot, plan, expected } = Course::new(args, robot::load(&args.robot)?)?;
    let policy = args.policy.clone().unwrap_or_default();
    let meta = SteerMeta { yaw_deg: wanted.yaw_deg, pitch_deg: wanted.pitch_deg, rate_hz: RATE_HZ, policy };
    let mut steering = Steering::new(wanted, pilot);
    let folder = args.out.clone().unwrap_or_else(|| session::folder_named(&plan.name));
    let to_steer = (&mut steering, &meta);
    let ran = if args.model {
        in_model::steer(&plan, &folder, to_steer, &expected, &interrupted)
    } else {
        rig::steer(args, &plan, &folder, to_steer, &expected, &interrupted)
    };
    let (log, ran) = match ran {
        Err(report) if matches!(report.downcast_ref(), Some(LinkError::Interrupted)) => {
            return Answer::new(Outcome::Interrupted, &serde_json::json!({ "log": null }), "interrupted");
        }
        Err(report) if matches!(report.downcast_ref(), Some(SessionError::Exists { .. })) => {
            let help = "name another folder with --out: a run that is steered begins anew";
            return Err(wrong_use(report, help));
        }
        ran => ran?,
    };
    let trial = Judged::read(&log, Want::default())?;
    let steered = Steered {
        log,
        origin: trial.data.origin().name(),
        wanted,
        held: Held::of(&trial),
        reached_s: steering.reached_s,
        steps: ran.tally.steps,
        late_steps: ran.tally.late,
        latency_p50_s: ran.tally.latency_s(0.5),
        latency_p99_s: ran.tally.latency_s(0.99),
        budget: trial.steady_angles().map(|angles| angles.budget).unwrap_or_default(),
        findings: trial.findings,
        notes: expected.note().into_iter().chain(ran.notes).collect(),
    };
    if let Some(report) = &ran.error {
        return Answer::failed(&steered, report);
    }
    let is_sound = steered.reached_s.is_some() && !steered.findings.iter().any(|finding| finding.grave);
    let outcome = if ran.interrupted { Outcome::Interrupted } else { Outcome::of(is_sound) };
    Answer::new(outcome, &steered, steered.to_string())
}
