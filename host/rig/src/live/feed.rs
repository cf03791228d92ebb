//! The updates of a recording for a page in a browser: the running trial twenty times a second, and the session so far.

use crate::run::Notes;
use biflag_log::Tap;
use biflag_log::schema::biflag::{Event, Telemetry, event::Kind};
use biflag_log::schema::foxglove::FrameTransform;
use biflag_log::schema::{ChannelSpec, LogMessage};
use nalgebra::UnitQuaternion;
use protocol::TICK_HZ;
use serde::Serialize;
use serde_json::{Value, json};
use std::sync::{Arc, Mutex};
use study::attitude::{Unwrap, rotation};
use study::lock::lock;
use study::trial::OPERATOR;

/// Frames of the board for each row.
const FRAMES_A_ROW: u32 = TICK_HZ as u32 / 20;

/// Values of a row: time (s), yaw, pitch, roll (degrees), speeds, their targets (rpm), and turns of both motors.
const COLUMNS: usize = 10;

/// The data for the page. Clones share it.
#[derive(Clone, Default)]
pub struct Feed {
    state: Arc<Mutex<State>>,
    /// What the user writes on the page.
    pub notes: Notes,
}

#[derive(Default)]
struct State {
    trial: Trial,
    /// Rows of the running trial.
    rows: Vec<[f64; COLUMNS]>,
    /// The trials of the session, in the form shown by the program.
    session: Value,
    /// The last words of the program.
    ended: Option<String>,
    unwrap: Unwrap,
    /// Frames of the trial so far.
    frames: u32,
    /// The frame of the next row. Its attitude for viewers arrives after it.
    frame: Option<Telemetry>,
}

/// The running trial, without its rows.
#[derive(Clone, Default, Serialize)]
struct Trial {
    /// Counts the trials of the program, from 1; 0 before the first. A repeated attempt is another trial.
    number: u32,
    name: String,
    /// Its planned duration.
    planned_s: f64,
    /// The yaw at the start of the run.
    zero_deg: f64,
    /// Name and start of each phase.
    phases: Vec<(String, f64)>,
    /// Time, kind and text of faults and warnings.
    marks: Vec<(f64, &'static str, String)>,
}

impl Feed {
    /// Starts a trial.
    pub fn begin(&self, name: &str, planned_s: f64) {
        let mut state = lock(&self.state);
        let number = state.trial.number + 1;
        state.trial = Trial { number, name: name.to_owned(), planned_s, ..Trial::default() };
        state.rows.clear();
        (state.unwrap, state.frames, state.frame) = (Unwrap::default(), 0, None);
    }

    /// Shows the trials of the session.
    pub fn session(&self, session: Value) {
        lock(&self.state).session = session;
    }

    /// Ends the recording.
    pub fn end(&self, words: &str) {
        lock(&self.state).ended = Some(words.to_owned());
    }

    /// Returns a tap that receives the messages of a log.
    pub fn tap(&self) -> Tap {
        let feed = self.clone();
        Box::new(move |channel, _, bytes| lock(&feed.state).message(channel, bytes))
    }

    /// Returns everything that a page does not have yet: the rows of the running trial after the first `have`, or all
    /// rows if the page has another trial.
    pub fn news(&self, trial: u32, have: usize) -> Value {
        let state = lock(&self.state);
        let have = if trial == state.trial.number { have.min(state.rows.len()) } else { 0 };
        json!({
            "trial": state.trial,
            "from": have,
            "rows": state.rows[have..],
            "session": state.session,
            "ended": state.ended,
        })
    }
}

impl State {
    fn message(&mut self, channel: &ChannelSpec, bytes: &[u8]) {
        if channel.id == FrameTransform::CHANNEL.id
            && let Ok(FrameTransform { rotation: Some(q), .. }) = prost::Message::decode(bytes)
        {
            self.attitude(&rotation([q.w, q.x, q.y, q.z]));
        } else if channel.id == Telemetry::CHANNEL.id
            && let Ok(frame) = prost::Message::decode(bytes)
        {
            self.frame = self.frames.is_multiple_of(FRAMES_A_ROW).then_some(frame);
            self.frames += 1;
        } else if channel.id == Event::CHANNEL.id
            && let Ok(event) = prost::Message::decode(bytes)
        {
            self.event(&event);
        }
    }

    fn attitude(&mut self, attitude: &UnitQuaternion<f64>) {
        let [yaw_deg, pitch_deg, roll_deg] = self.unwrap.angles_deg(attitude);
        let Some(frame) = self.frame.take() else { return };
        let [one, two] = [frame.motor1, frame.motor2].map(Option::unwrap_or_default);
        let angles = [frame.time_s, yaw_deg, pitch_deg, roll_deg];
        let motors = [one.speed_rpm, two.speed_rpm, one.target_rpm, two.target_rpm, one.turns, two.turns];
        let mut row = [0.0; COLUMNS];
        row[..4].copy_from_slice(&angles);
        row[4..].copy_from_slice(&motors);
        self.rows.push(row.map(|value| (value * 1e4).round() / 1e4));
    }

    fn event(&mut self, event: &Event) {
        let time_s = self.rows.last().map_or(0.0, |row| row[0]);
        let kind = match event.kind() {
            Kind::Phase => {
                if event.text == "run" {
                    self.trial.zero_deg = self.rows.last().map_or(0.0, |row| row[1]);
                }
                self.trial.phases.push((event.text.clone(), time_s));
                return;
            }
            Kind::Fault => "fault",
            Kind::Warning => "warning",
            Kind::Note if event.text.starts_with(OPERATOR) => "note",
            Kind::Note | Kind::State | Kind::Retry | Kind::Calibration | Kind::Clock => return,
        };
        // A serial line that is bad for an hour should not fill the page.
        const MOST: usize = 100;
        if self.trial.marks.len() < MOST {
            self.trial.marks.push((time_s, kind, event.text.clone()));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use biflag_log::schema::biflag::Motor;
    use biflag_log::{EventKind, event};
    use study::draw;

    fn send<M: LogMessage>(tap: &Tap, message: &M) {
        tap(&M::CHANNEL, 0, &message.encode_to_vec());
    }

    /// Sends frames of a robot that turns about the vertical at 100 degrees per second.
    fn turn(tap: &Tap, from: u32, to: u32) {
        for i in from..to {
            let time_s = f64::from(i) / f64::from(TICK_HZ);
            let motor = Motor { speed_rpm: 50.0, target_rpm: 51.0, turns: time_s * 50.0 / 60.0, ..Motor::default() };
            send(tap, &Telemetry { time_s, motor1: Some(motor), ..Telemetry::default() });
            let attitude = UnitQuaternion::from_euler_angles(0.0, 0.0, (100.0 * time_s).to_radians());
            send(tap, &draw::attitude(&attitude, 0));
        }
    }

    #[test]
    fn a_page_gets_twenty_rows_a_second_and_each_of_them_once() {
        let feed = Feed::default();
        feed.begin("001", 60.0);
        let tap = feed.tap();
        turn(&tap, 0, 400);
        send(&tap, &event(EventKind::Phase, "run"));
        send(&tap, &event(EventKind::Warning, "slow"));
        let first = feed.news(0, 0);
        let rows = first["rows"].as_array().unwrap();
        assert_eq!((rows.len(), first["from"].as_u64()), (40, Some(0)));
        // The yaw continues beyond half a turn.
        let last: Vec<f64> = rows[39].as_array().unwrap().iter().map(|value| value.as_f64().unwrap()).collect();
        assert_eq!(last, [1.95, 195.0, 0.0, 0.0, 50.0, 0.0, 51.0, 0.0, 1.625, 0.0]);
        let trial = &first["trial"];
        assert_eq!(
            (&trial["zero_deg"], &trial["phases"][0][0], &trial["marks"][0][2]),
            (&195.0.into(), &"run".into(), &"slow".into())
        );

        turn(&tap, 400, 500);
        let more = feed.news(1, 40);
        assert_eq!((more["rows"].as_array().unwrap().len(), more["from"].as_u64()), (10, Some(40)));
        // A page with the previous trial starts again; a page that claims too many rows gets nothing.
        feed.begin("002", 60.0);
        turn(&feed.tap(), 0, 100);
        assert_eq!(feed.news(1, 50)["rows"].as_array().unwrap().len(), 10);
        assert_eq!(feed.news(2, 5000)["from"], 10);
    }
}
