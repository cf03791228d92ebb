//! Ways to spoil a session.

use super::log::Log;
use super::{LOGS, PLAN};
use biflag_log::schema::biflag::event::Kind;
use biflag_log::schema::biflag::{Event, Vector};
use biflag_log::{Body, CalibrationMeta, End, LevelMeta};
use std::fs;
use std::path::{Path, PathBuf};

/// What a command must say about a spoilt session.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// The finding, exit code 3, and no uncertainty of the trial.
    Grave,
    /// The finding and exit code 3; the uncertainty holds.
    Loss,
}

/// A way to spoil a session: its name, what every command must say, and how much that is.
pub struct Spoilt {
    pub how: &'static str,
    pub said: &'static str,
    pub verdict: Verdict,
    pub spoil: fn(&Path, &Sources),
}

/// Sound sessions that others are made of.
pub struct Sources {
    pub model: PathBuf,
}

/// Changes the first log of a session.
fn edit(session: &Path, change: impl FnOnce(&mut Log)) {
    let path = session.join(LOGS[0]);
    let mut log = Log::read(&path);
    fs::remove_file(&path).unwrap();
    change(&mut log);
    log.write(&path);
}

fn swap(session: &Path) {
    let [one, other, third] = [LOGS[0], LOGS[1], "held"].map(|name| session.join(name));
    fs::rename(&one, &third).unwrap();
    fs::rename(&other, &one).unwrap();
    fs::rename(&third, &other).unwrap();
}

fn bytes(session: &Path, change: impl FnOnce(&mut Vec<u8>)) {
    let path = session.join(LOGS[0]);
    let mut content = fs::read(&path).unwrap();
    change(&mut content);
    fs::write(&path, content).unwrap();
}

pub const SPOILT: &[Spoilt] = &[
    Spoilt {
        how: "two logs exchanged",
        said: "holds trial",
        verdict: Verdict::Grave,
        spoil: |session, _| swap(session),
    },
    Spoilt {
        how: "a log under another trial's name",
        said: "holds trial 002",
        verdict: Verdict::Grave,
        spoil: |session, _| fs::rename(session.join(LOGS[1]), session.join(LOGS[0])).unwrap(),
    },
    Spoilt {
        how: "one log copied under another name",
        said: "is a copy of 002",
        verdict: Verdict::Grave,
        spoil: |session, _| _ = fs::copy(session.join(LOGS[1]), session.join(LOGS[0])).unwrap(),
    },
    Spoilt {
        how: "a model's log among recordings",
        said: "computed by the model",
        verdict: Verdict::Grave,
        spoil: |session, sources| _ = fs::copy(sources.model.join(LOGS[0]), session.join(LOGS[0])).unwrap(),
    },
    Spoilt {
        how: "a log of another plan",
        said: "of another plan",
        verdict: Verdict::Grave,
        spoil: |session, _| {
            edit(session, |log| {
                log.start.plan.text = PLAN.replace("run = 12", "run = 13");
                log.start.trial.run_s = 13.0;
            });
        },
    },
    Spoilt {
        how: "a log of another board",
        said: "with board",
        verdict: Verdict::Grave,
        spoil: |session, _| edit(session, |log| log.start.board.as_mut().unwrap().board_id = 8),
    },
    Spoilt {
        how: "a log of an earlier session",
        said: "the session began on",
        verdict: Verdict::Loss,
        spoil: |session, _| edit(session, |log| log.start.identity.created = "2025-01-02T03:04:05Z".to_owned()),
    },
    Spoilt {
        how: "clipped gyroscope",
        said: "at the end of the sensor's range",
        verdict: Verdict::Grave,
        spoil: |session, _| {
            edit(session, |log| {
                let text = "7 readings were at the end of the sensor's range: give a wider gyro_range".to_owned();
                let end_s = log.messages.last().unwrap().0;
                log.messages.push((end_s, Body::Event(Event { kind: Kind::Warning.into(), text })));
            });
        },
    },
    Spoilt {
        how: "a board that stopped",
        said: "did not end as planned",
        verdict: Verdict::Grave,
        spoil: |session, _| {
            edit(session, |log| {
                log.summary.end = End::Faulted;
                log.summary.reason = "motor 1 is blocked".to_owned();
            });
        },
    },
    Spoilt {
        how: "a log that is cut off",
        said: "cut off",
        verdict: Verdict::Grave,
        spoil: |session, _| bytes(session, |content| content.truncate(content.len() * 9 / 10)),
    },
    Spoilt {
        how: "a damaged log",
        said: "damaged",
        verdict: Verdict::Grave,
        spoil: |session, _| {
            bytes(session, |content| {
                let middle = content.len() / 2;
                content[middle..middle + 200].fill(0x55);
            });
        },
    },
    Spoilt {
        how: "a recovered log",
        said: "recovered from",
        verdict: Verdict::Grave,
        spoil: |session, _| {
            bytes(session, |content| content.truncate(content.len() * 9 / 10));
            let log = session.join(LOGS[0]);
            biflag_log::recover(&log, &log.with_extension("recovered.mcap")).unwrap();
            fs::rename(log.with_extension("recovered.mcap"), &log).unwrap();
        },
    },
    Spoilt {
        how: "three frames lost",
        said: "telemetry frames were lost",
        verdict: Verdict::Loss,
        spoil: |session, _| edit(session, |log| log.lose(20.0, 20.014)),
    },
    Spoilt {
        how: "telemetry lost in the averaging time",
        said: "have telemetry",
        verdict: Verdict::Grave,
        spoil: |session, _| {
            edit(session, |log| {
                let end_s = log.messages.last().unwrap().0;
                log.lose(end_s - 8.0, end_s - 3.0);
            });
        },
    },
    Spoilt {
        how: "gyro_axes other than accel_axes",
        said: "contradict each other",
        verdict: Verdict::Grave,
        spoil: |session, _| {
            edit(session, |log| {
                log.frames(|frame| {
                    let rate = frame.angular_velocity_dps.unwrap_or_default();
                    frame.angular_velocity_dps = Some(Vector { x: rate.z, y: rate.x, z: rate.y });
                });
            });
        },
    },
    Spoilt {
        how: "a sensor with other axes than the settings",
        said: "tilt at rest of 91.8",
        verdict: Verdict::Grave,
        spoil: |session, _| {
            edit(session, |log| {
                log.level = Some(LevelMeta { up: [1.0, 0.0, -0.03], force_g: 1.0, tilt_deg: 91.77, used: false });
            });
        },
    },
    Spoilt {
        how: "a slow filter",
        said: "attitude_kp 0.1",
        verdict: Verdict::Grave,
        spoil: |session, _| {
            edit(session, |log| log.settings(|settings| _ = settings.insert("attitude_kp".into(), 0.1.into())));
        },
    },
    Spoilt {
        how: "a robot that still swings",
        said: "was not still before the run",
        verdict: Verdict::Grave,
        spoil: |session, _| {
            edit(session, |log| {
                let run_s = log.run_start_s();
                log.frames(|frame| {
                    // A pitch that grows by a third of a degree a second until the run.
                    let half = (frame.time_s.min(run_s) / 3.0).to_radians() / 2.0;
                    if let Some(q) = &mut frame.attitude {
                        let (c, s) = (half.cos(), half.sin());
                        (q.w, q.x, q.y, q.z) =
                            (c * q.w - s * q.y, c * q.x + s * q.z, c * q.y + s * q.w, c * q.z - s * q.x);
                    }
                });
            });
        },
    },
    Spoilt {
        how: "a wait that ended in a motion",
        said: "was not still after a wait",
        verdict: Verdict::Grave,
        spoil: |session, _| {
            edit(session, |log| {
                let rest = log.rest.as_mut().unwrap();
                (rest.still, rest.yaw_dps) = (false, Some(0.73));
            });
        },
    },
    Spoilt {
        how: "neither a calibration nor a rest",
        said: "neither a calibration nor a still phase",
        verdict: Verdict::Grave,
        spoil: |session, _| {
            edit(session, |log| {
                let run_s = log.run_start_s();
                log.lose(0.0, run_s - 0.1);
                log.calibration = Some(CalibrationMeta { still: false, ..CalibrationMeta::default() });
            });
        },
    },
    Spoilt {
        how: "an encoder that misses counts",
        said: "the measured turns are used",
        verdict: Verdict::Grave,
        spoil: |session, _| {
            edit(session, |log| {
                log.frames(|frame| {
                    if let Some(motor) = &mut frame.motor1 {
                        motor.turns *= 0.5;
                    }
                });
            });
        },
    },
    Spoilt {
        how: "a log of a newer biflag",
        said: "recorded with protocol 250",
        verdict: Verdict::Grave,
        spoil: |session, _| edit(session, |log| log.start.identity.protocol = 250),
    },
];
