//! The data, angles and findings of a trial, computed together.

use super::angles::Angles;
use super::data::{Data, Want};
use super::finding::{Finding, LogFinding};
use super::findings::{self, Section, TABLE};
use super::zero::Zeroed;
use biflag_log::LogError;
use std::ops::Range;
use std::path::Path;

/// A trial with its data, angles and findings. All output about a trial takes them from here.
#[derive(Clone, Debug)]
pub struct Judged {
    /// The content of its log.
    pub data: Data,
    /// Its attitude relative to its zero. A finding may have removed the uncertainties.
    pub angles: Zeroed,
    /// All findings about it.
    pub findings: Vec<Finding>,
    /// Why some tests could not judge the trial.
    pub not_judged: Vec<&'static str>,
}

impl Judged {
    /// Reads a trial from its log, even if the log is damaged.
    ///
    /// # Errors
    /// [`LogError`] if the file is not a biflag log or cannot be read.
    pub fn read(path: &Path, want: Want) -> Result<Self, LogError> {
        Ok(Self::of(Data::read(path, want)?))
    }

    /// Judges a trial.
    pub fn of(data: Data) -> Self {
        let after = data.times.decay.clone();
        Self::by(&TABLE, data, after)
    }

    /// Judges a trial, with the drift only from the still phase before the run.
    pub fn from_rest(data: Data) -> Self {
        let after = data.duration_s..data.duration_s;
        Self::by(&TABLE, data, after)
    }

    /// Judges a trial by a table. `after`: the time in which the robot may be still again.
    fn by(table: &[Section], mut data: Data, after: Range<f64>) -> Self {
        let mut angles = Zeroed::with_end(&data, after);
        if data.is_blind()
            && let Some(steady) = &angles.steady
        {
            data.take_speeds(findings::speeds_without_encoders(&data, &angles, steady));
        }
        let (mut found, mut not_judged) = findings::all(table, &data, &angles);
        let is_unsure = found.iter().any(Finding::empties_uncertainty);
        angles.judge(is_unsure);
        if is_unsure {
            // Some findings depend on whether the uncertainties are known.
            (found, not_judged) = findings::all(table, &data, &angles);
        }
        Self { data, angles, findings: found, not_judged }
    }

    /// Returns the steady angles; `None` if there is no attitude in the run.
    pub fn steady_angles(&self) -> Option<Angles> {
        self.angles.angles()
    }

    /// Returns the findings with the log that they are about.
    pub fn log_findings(&self) -> Vec<LogFinding> {
        LogFinding::all_of(&self.data.path, self.findings.iter().cloned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::export::session::{self, Summary};
    use crate::export::table::Values;
    use crate::plan::Plan;
    use crate::trial::findings::Rule;
    use crate::trial::{Collector, FindingKind, Records};
    use biflag_log::FORMAT;
    use biflag_log::schema::biflag::{Motor, Quaternion, Telemetry, Vector, event::Kind};

    fn data() -> Data {
        let mut collector = Collector::new(Want::default(), FORMAT);
        collector.event(0.0, Kind::Phase, "preroll");
        for tick in 0..6000 {
            let time_s = 0.005 * f64::from(tick);
            if tick == 4000 {
                collector.event(time_s, Kind::Phase, "run");
            }
            let target_rpm = if tick < 4000 { 0.0 } else { 50.0 };
            let motor = Some(Motor { target_rpm, ..Motor::default() });
            let attitude = Some(Quaternion { w: 1.0, ..Quaternion::default() });
            let angular_velocity_dps = Some(Vector::default());
            let still = Telemetry { time_s, imu_fresh: true, attitude, angular_velocity_dps, ..Telemetry::default() };
            collector.telemetry(&Telemetry { motor1: motor, motor2: motor, ..still });
        }
        collector.finish("a.mcap".as_ref(), Records::default())
    }

    /// A new finding needs only a row of the table.
    #[test]
    fn new_row_is_in_all_that_is_made_of_a_trial() {
        static ROW: [Rule; 1] = [Rule::warning(FindingKind::Conduct, "mend it", |data, _| {
            Some(format!("{} readings", data.readings.len()))
        })];
        static NOTE: [Rule; 1] = [Rule::note(FindingKind::Conduct, "", |_, _| Some("so it is".to_owned()))];
        let of_rules = |rules: &'static [Rule]| vec![Section { is_judged: |_| true, rules }];
        let [table, row, note] = [TABLE.to_vec(), of_rules(&ROW), of_rules(&NOTE)];
        let of = |table: &[Section]| Judged::by(table, data(), 30.0..30.0);
        let (before, after, alone) = (of(&table), of(&[table.clone(), row.clone()].concat()), of(&row));
        assert_eq!(after.findings.len(), before.findings.len() + 1);
        let said = after.findings.last().unwrap().to_string();
        assert_eq!(said, "6000 readings: mend it");
        assert_eq!(after.log_findings().last().unwrap().log, "a.mcap");
        // A warning removes the uncertainties.
        let yaw_uncertainty_deg = |judged: &Judged| judged.steady_angles().unwrap().yaw_uncertainty_deg;
        assert_eq!(yaw_uncertainty_deg(&alone), None);
        // A note does not.
        let [bare, noted] = [of(&[]), of(&note)];
        assert!(!noted.findings[0].grave && yaw_uncertainty_deg(&noted) == yaw_uncertainty_deg(&bare));
        assert!(yaw_uncertainty_deg(&bare).is_some());
        let plan = Plan::of_speeds([5000, 1000].map(protocol::units::CentiRpm), "", "").unwrap();
        let trials = session::table("a", &[Summary::new(&plan.trials[0], after, String::new())]);
        let texts = trials.columns.iter().filter_map(|column| match &column.values {
            Values::Text(texts) => Some(texts.concat()),
            _ => None,
        });
        assert!(texts.collect::<String>().contains(&said));
    }
}
