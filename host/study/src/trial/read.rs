//! Reads a trial from its log, in one pass.

use super::collect::Collector;
use super::data::{Data, Records, Want};
use biflag_log::schema::foxglove::SceneUpdate;
use biflag_log::{BoardMeta, Body, Condition, FORMAT, Identity, LogError, Message, Reader, TrialClock};
use protocol::units::TemperatureCounts;
use std::path::Path;

impl Data {
    /// Reads a log, even if it is damaged.
    ///
    /// # Errors
    /// [`LogError`] if the file is not a biflag log or cannot be read.
    pub(crate) fn read(path: &Path, want: Want) -> Result<Self, LogError> {
        let reader = Reader::open(path)?;
        let format = reader.meta().map_or(FORMAT, |identity: Identity| identity.format);
        let mut channels = vec!["/telemetry", "/event", "/truth", "/dropout", "/command"];
        if want.forces {
            channels.push("/forces");
        }
        if want.shapes > 0 {
            // Logs of format 1 contain the flagella only as lines for viewers.
            channels.push(if format == 1 { "/flagella" } else { "/nodes" });
        }
        let mut reader = reader.only(channels);
        if want.hash {
            reader = reader.hashing();
        }
        let mut collector = Collector::new(want, format);
        let mut clock = TrialClock::default();
        let mut imu_id = None;
        while let Some(message) = reader.next() {
            let mut message = message?;
            clock.see(&message);
            if let Body::Telemetry(frame) = &mut message.body {
                // Older programs converted the temperature of every part like an MPU6050's, and a model's board named no part.
                let id = *imu_id.get_or_insert_with(|| reader.meta::<BoardMeta>().map_or(0, |board| board.imu_id));
                if id != 0 {
                    frame.temperature_c = TemperatureCounts(frame.temperature_counts as i16).celsius(id);
                }
            }
            take(&mut collector, &message, clock.time_s(&message));
        }
        let mut data = collector.finish(path, Records::of(&reader));
        data.channels = reader.counts.clone();
        data.condition = reader.condition().unwrap_or(Condition::Damaged);
        data.rewritten_by = reader.rewritten_by().map(str::to_owned);
        data.losses = reader.losses().to_vec();
        data.sha256 = want.hash.then(|| reader.sha256()).transpose()?;
        Ok(data)
    }
}

fn take(collector: &mut Collector, message: &Message, time_s: f64) {
    match &message.body {
        Body::Telemetry(frame) => collector.telemetry(frame),
        Body::Truth(truth) => collector.truth(truth),
        Body::Forces(forces) => collector.forces(forces),
        Body::Nodes(nodes) => {
            if let Some(lines) = nodes.lines() {
                collector.shapes(nodes.time_s, lines);
            }
        }
        Body::Flagella(scene) => {
            if let Some(lines) = lines(scene) {
                collector.shapes(time_s, lines);
            }
        }
        Body::Dropout(dropout) => collector.dropout(time_s, dropout.count),
        Body::Command(command) => collector.command(time_s, command.attempts),
        Body::Event(event) => collector.event(time_s, event.kind(), &event.text),
        Body::Raw(_) | Body::Attitude(_) | Body::FlagellaPoints(_) | Body::Steering(_) | Body::Other(_) => {}
    }
}

/// Returns the first two lines of a scene.
fn lines(scene: &SceneUpdate) -> Option<[Vec<[f64; 3]>; 2]> {
    let mut lines = (scene.entities.iter().flat_map(|entity| &entity.lines))
        .map(|line| line.points.iter().map(|point| [point.x, point.y, point.z]).collect());
    Some([lines.next()?, lines.next()?])
}
