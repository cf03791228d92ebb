//! The known errors of a board's sensor before trials: the file that the plan names, or the scales that the board keeps.

use super::answer::wrong_use;
use super::sensor::percent;
use super::settings;
use crate::link::Link;
use crate::plan::Plan;
use crate::run::rig::note as board_note;
use biflag_log::MeasuredSensorMeta;
use study::sensor::{AXES, MeasuredSensor, note};

/// Scales that differ by more than this number of standard uncertainties are of two sensors, or one of them is old.
const APART: f64 = 3.0;

/// Adds the scales that the board keeps to a plan without a sensor file. Returns a note for the user.
///
/// # Errors
/// The board cannot be asked, or the plan names the file of another sensor.
pub fn complete(plan: &mut Plan, link: &Link) -> miette::Result<Option<String>> {
    let settings = settings::read(link)?;
    let kept = note::read(&board_note::read(link)?, &settings);
    let Some(file) = &plan.sensor else {
        let Some(kept) = kept else { return Ok(None) };
        let text = format!("the scales of the gyroscope are those that the board keeps, measured on {}", kept.date);
        plan.sensor = Some(MeasuredSensorMeta { name: note::OF_BOARD.to_owned(), text: kept.to_toml() });
        return Ok(Some(text));
    };
    let of_file = MeasuredSensor::parse(&file.text, &file.name)?;
    if let Some(why) = of_file.mismatch(&settings) {
        let help = "name the file of this board's sensor in the plan, or measure it with `biflag sensor`";
        return Err(wrong_use(format!("{} is of another sensor: {why}", file.name), help));
    }
    Ok(kept.and_then(|kept| difference(&of_file, &kept, &file.name)))
}

/// Describes a difference between a file and a board.
fn difference(file: &MeasuredSensor, kept: &MeasuredSensor, name: &str) -> Option<String> {
    AXES.into_iter().find_map(|axis| {
        let (one, other) = (file.get("gyro_scale", axis)?, kept.get("gyro_scale", axis)?);
        let is_apart = (one.value - other.value).abs() > APART * one.u.hypot(other.u);
        let of_file = format!("{} in {name} ({})", percent(one), file.date);
        let of_board = format!("{} on the board ({})", percent(other), kept.date);
        let scales = format!("the gyroscope's scale about {axis} is {of_file}, and {of_board}");
        is_apart.then(|| format!("{scales}: use the file of the latest measurement"))
    })
}
