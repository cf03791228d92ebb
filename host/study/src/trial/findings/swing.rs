//! Finding about the swing of the robot: each flagellum swings it once a turn, so its motion says whether its speeds can be true.

use super::{Rule, Section};
use crate::swing::{Label, Labelled, label};
use crate::trial::data::Data;
use crate::trial::finding::FindingKind::Swing;
use crate::trial::zero::Zeroed;
use protocol::units::CentiRpm;

/// Share and rpm by which true speeds may be off those of a trial: of a board's encoders, and of an import.
const OFF: [(f64, f64); 2] = [(0.012, 0.1), (0.03, 0.3)];

/// Time in which the motion has settled enough, s, and the largest share of the run.
const SETTLED_S: f64 = 15.0;
const SETTLED_SHARE: f64 = 0.4;

pub(super) const SECTION: Section = Section { is_judged: |data| !data.is_model(), rules: &RULES };

static RULES: [Rule; 1] = [Rule::warning(
    Swing,
    "check the speeds with their unit and signs, the counts per turn of the encoders, and the unit of the angles",
    other_swing,
)];

fn other_swing(data: &Data, zeroed: &Zeroed) -> Option<String> {
    let rpm = data.speeds().map(CentiRpm::rpm);
    let (run, robot) = (&zeroed.run, data.robot().ok()?);
    let settled_s = run.start + SETTLED_S.min(SETTLED_SHARE * (run.end - run.start))..run.end;
    let are_constant = data.reverse().is_none() && data.records.steer.is_none();
    let is_whole = data.records.import.as_ref().is_none_or(|import| import.constant.is_empty());
    if !are_constant || !is_whole || rpm == [0.0; 2] {
        return None;
    }
    let (off, touches) = (OFF[usize::from(!data.is_recorded())], robot.flagellum.mesh(rpm));
    let trial = Labelled { angles_deg: &zeroed.angles_deg, settled_s, rpm, off, touches };
    let at = format!("{} and {} rpm", rpm[0], rpm[1]);
    match label(&trial) {
        Label::Wrong(causes) => {
            let causes: Vec<String> = causes.iter().map(|cause| format!("if {cause}")).collect();
            Some(format!("the robot does not swing as at {at}, but as {}", causes.join(", or as ")))
        }
        Label::HardlySwings => Some(format!(
            "the robot hardly swings, and would at {at}, once a turn of each flagellum: the motors stood, or the angles are radians"
        )),
        Label::Right | Label::NotJudged(_) => None,
    }
}
