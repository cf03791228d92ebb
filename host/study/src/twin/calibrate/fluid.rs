//! The fluid of each trial: the viscosity of a glycerol mixture depends on the trial's temperature.

use super::data::FitTrial;
use crate::statistics::extremes;
use crate::text::count;
use crate::twin::TwinError;
use sim::params::{Fluid, Glycerol};

/// Difference of the sensor's temperature between trials above which the viscosity of glycerol has changed by more than a
/// tenth, °C.
const SAME_C: f64 = 1.5;

/// Returns the mean temperature of the sensor in all trials, °C.
pub(super) fn mean_c(trials: &[FitTrial]) -> f64 {
    trials.iter().map(|trial| trial.temperature_c).sum::<f64>() / trials.len() as f64
}

/// Replaces a mixture by its viscosity and density at the mean temperature of all trials, and gives each trial its own
/// values relative to these. Returns a warning about the temperatures, and a note on the viscosity.
///
/// # Errors
/// [`TwinError::Unusable`] if the temperature of a trial in a mixture is unknown.
pub(super) fn at_temperatures(trials: &mut [FitTrial], fluid: &mut Fluid) -> Result<[Option<String>; 2], TwinError> {
    if let (Some(unknown), Some(_)) = (trials.iter().find(|trial| trial.temperature_c.is_nan()), &fluid.glycerol) {
        return Err(TwinError::Unusable {
            path: unknown.path.clone(),
            reason: "has no temperature, which the viscosity of the robot's glycerol depends on".to_owned(),
            help: "import it with --temperature, or give the fluid's viscosity_pa_s and density_kg_m3 instead of glycerol",
        });
    }
    let mean_c = mean_c(trials);
    let [least, most] = extremes(trials.iter().map(|trial| trial.temperature_c));
    let Some(mixture) = fluid.glycerol.take() else {
        let real = trials.iter().any(|trial| trial.is_real);
        let warning = (real && most - least > SAME_C).then(|| {
            format!(
                "the sensor had {least:.1} °C to {most:.1} °C, and the viscosity of glycerol changes by some 8 % per °C: \
                 all trials are fitted with one viscosity, unless the robot has a mixture under [fluid.glycerol]"
            )
        });
        return Ok([warning, None]);
    };
    let at = |temperature_c: f64| Glycerol { temperature_c, ..mixture };
    fluid.viscosity_pa_s = at(mean_c).viscosity_pa_s();
    fluid.density_kg_m3 = at(mean_c).density_kg_m3();
    for trial in trials.iter_mut() {
        let own = at(trial.temperature_c);
        trial.fluid = [own.viscosity_pa_s() / fluid.viscosity_pa_s, own.density_kg_m3() / fluid.density_kg_m3];
    }
    let (share, viscosity) = (100.0 * mixture.mass_fraction, fluid.viscosity_pa_s);
    let mut note =
        format!("the initial viscosity is that of {share:.1} % glycerol at {mean_c:.1} °C: {viscosity:.3} Pa s");
    if most - least > 0.1 {
        let trials = count(trials.len(), "trial");
        note += &format!("; each of {trials} has that of its own temperature, {least:.1} °C to {most:.1} °C");
    }
    Ok([None, Some(note)])
}
