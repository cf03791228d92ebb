//! A plan of one trial, made from two speeds.

use super::{Plan, PlanError};
use protocol::units::CentiRpm;

impl Plan {
    /// Returns a plan of one trial at these speeds, named after them and `suffix`. `trial` contains the lines of its
    /// table `[trial]`.
    ///
    /// ```
    /// use protocol::units::CentiRpm;
    /// let plan = study::plan::Plan::of_speeds([50.0, -10.5].map(CentiRpm::from_rpm), "run = 60", "")?;
    /// assert_eq!((plan.name.as_str(), plan.trials.len()), ("w1+50_w2-10.5", 1));
    /// # Ok::<(), study::plan::PlanError>(())
    /// ```
    ///
    /// # Errors
    /// [`PlanError::Invalid`] if a plan cannot have these lines.
    pub fn of_speeds(speeds: [CentiRpm; 2], trial: &str, suffix: &str) -> Result<Self, PlanError> {
        let [w1, w2] = speeds.map(CentiRpm::rpm);
        let text = format!(
            "[session]\nname = \"w1{w1:+}_w2{w2:+}{suffix}\"\n\n[trial]\n{trial}\n\n[speeds]\npairs = [[{w1}, {w2}]]\n"
        );
        Self::parse(&text, "--speeds")
    }
}
