//! Checks that all trials of a session run on the same rig with the same settings.

use super::{Session, SessionError, TrialState};
use biflag_log::{BoardMeta, Identity, Origin, SensorMeta};

/// Settings that may differ: the wiring's settings only make the speeds right, and the id is compared separately.
const NOT_COMPARED: [&str; 7] =
    ["board_id", "gyro_bias_counts", "deadline_ms", "moving_duty", "bandgap_mv", "motor_reversed", "encoder_reversed"];

impl Session {
    /// Checks that the next trials run on the same rig, with the same settings and the same emulated sensor as the last
    /// complete one. Returns a note for the user.
    ///
    /// # Errors
    /// [`SessionError::OtherRig`], [`SessionError::Log`].
    pub fn expect_same_rig(
        &self,
        states: &[TrialState],
        origin: Origin,
        board: Option<&BoardMeta>,
        sensor: Option<&SensorMeta>,
    ) -> Result<Option<String>, SessionError> {
        let Some(last) = states.iter().filter_map(TrialState::complete).next_back() else { return Ok(None) };
        let other = |was: String, is: String| {
            let (folder, log) = (self.folder().to_owned(), last.path.clone());
            Err(SessionError::OtherRig { folder, log, was, is })
        };
        if let Some(identity) = biflag_log::last_meta::<Identity>(&last.path)?
            && identity.origin != origin
        {
            return other(place(identity.origin).to_owned(), place(origin).to_owned());
        }
        if let (Some(before), Some(now)) = (biflag_log::last_meta::<SensorMeta>(&last.path)?, sensor)
            && before != *now
        {
            return other(emulated(&before), emulated(now));
        }
        let (Some(before), Some(now)) = (biflag_log::last_meta::<BoardMeta>(&last.path)?, board) else {
            return Ok(None);
        };
        // A board without an id gets one when its settings are saved.
        if before.board_id != now.board_id && before.board_id != 0 {
            return other(format!("on board {}", before.board_id), format!("on board {}", now.board_id));
        }
        if let Some((was, is)) = other_setting(&before.settings, &now.settings) {
            return other(format!("with {was}"), format!("with {is}"));
        }
        let firmware = |board: &BoardMeta| format!("{} ({})", board.firmware, board.firmware_git_hash);
        let [was, is] = [&before, now].map(firmware);
        let note = || format!("the trials so far ran with firmware {was}, the next ones will run with {is}");
        Ok((was != is).then(note))
    }
}

fn place(origin: Origin) -> &'static str {
    match origin {
        Origin::Rig => "on the rig",
        Origin::VirtualRig => "on the emulated board",
        Origin::Model => "in the model",
        Origin::Imported => "on another rig",
    }
}

fn emulated(sensor: &SensorMeta) -> String {
    let kind = if sensor.kind.is_empty() { "ideal" } else { &sensor.kind };
    format!("with the emulated sensor {kind:?} of seed {}", sensor.seed)
}

/// Returns the first setting that differs, as `key = value` before and now.
fn other_setting(before: &str, now: &str) -> Option<(String, String)> {
    let [before, now] = [before, now].map(|text| text.parse::<toml::Table>().unwrap_or_default());
    before.iter().filter(|(key, _)| !NOT_COMPARED.contains(&key.as_str())).find_map(|(key, was)| {
        // A setting that is missing in one version of the firmware is not compared.
        let is = now.get(key).filter(|is| *is != was)?;
        Some((format!("{key} = {was}"), format!("{key} = {is}")))
    })
}
