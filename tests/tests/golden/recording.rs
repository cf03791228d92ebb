//! Recordings that are the same on every computer: the motion of the model, rounded to the counts of a sensor with noise and a
//! bias, through the firmware's filter and the recorder of `record`.

use biflag_log::schema::biflag::Truth;
use biflag_log::{Body, ClockMeta, End, EventKind, LinkStats, Origin, Reader, RestMeta, Summary};
use firmware::attitude::{Attitude, Gains};
use host::plan::{Phases, Plan, Trial, board};
use host::run::{self, Recorder};
use mcap::records::Record;
use nalgebra::{UnitQuaternion, Vector3};
use protocol::units::{CentiRpm, Count, Duty, EncoderCounts, SensorCounts, TemperatureCounts};
use protocol::{Calibration, Info, Settings, State, Telemetry};
use std::collections::BTreeMap;
use std::fs;
use std::io::Cursor;
use std::path::Path;
use std::time::{Duration, SystemTime};
use tests::Bench;
use tests::synthetic_rig::Random;

const TICK_S: f64 = 0.005;

/// The time at which all of them begin.
const CREATED: &str = "2026-01-01T00:00:00Z";
const CREATED_S: u64 = 1_767_225_600;

/// Simulates a plan into the folder `model`, and makes a recorded session of the same trials in the folder `session`.
pub fn sessions(bench: &Bench, plan: &str, model: &str, session: &str) {
    let path = bench.file(&format!("{model}.toml"), plan);
    let simulated = bench.run(["simulate", path.to_str().unwrap(), "--rate", "200", "--out", model]);
    assert!(matches!(simulated.code, Some(0 | 3)), "{simulated:?}");
    let plan = Plan::load(&path).unwrap();
    let [model, session] = [model, session].map(|name| bench.path().join(name));
    fs::create_dir(&session).unwrap();
    for folder in [&model, &session] {
        let mut manifest: toml::Table = fs::read_to_string(model.join("session.toml")).unwrap().parse().unwrap();
        manifest.insert("created".into(), CREATED.into());
        fs::write(folder.join("session.toml"), manifest.to_string()).unwrap();
    }
    for trial in &plan.trials {
        let name = format!("{}.mcap", trial.name);
        let log = session.join(&name);
        record(&plan, trial, &motion(&model.join(&name)), &log);
        chunk_by_size(&log);
    }
}

/// Writes a log again with chunks by their size, without drawings for viewers: a recorder closes a chunk every quarter of a second.
fn chunk_by_size(log: &Path) {
    let bytes = fs::read(log).unwrap();
    let (mut writer, mut channels, mut schemas) = (None, BTreeMap::new(), BTreeMap::new());
    for record in mcap::read::ChunkFlattener::new(&bytes).unwrap() {
        let record = record.unwrap();
        if let Record::Header(header) = &record {
            let options = mcap::WriteOptions::new().profile(&header.profile).library(&header.library);
            let options = options.compression_threads(0).chunk_size(Some(1 << 16));
            writer = Some(options.create(Cursor::new(Vec::new())).unwrap());
        }
        let Some(writer) = &mut writer else { continue };
        match record {
            Record::Schema { header, data } => {
                schemas.insert(header.id, writer.add_schema(&header.name, &header.encoding, &data).unwrap());
            }
            Record::Channel(channel) => {
                let schema = schemas[&channel.schema_id];
                let (topic, encoding) = (&channel.topic, &channel.message_encoding);
                let id = writer.add_channel(schema, topic, encoding, &channel.metadata).unwrap();
                if topic != "/flagella" && topic != "/attitude" {
                    channels.insert(channel.id, id);
                }
            }
            Record::Message { header, data } => {
                if let Some(&channel_id) = channels.get(&header.channel_id) {
                    let header = mcap::records::MessageHeader { channel_id, ..header };
                    writer.write_to_known_channel(&header, &data).unwrap();
                }
            }
            Record::Metadata(metadata) => writer.write_metadata(&metadata).unwrap(),
            _ => {}
        }
    }
    let mut writer = writer.unwrap();
    writer.finish().unwrap();
    fs::write(log, writer.into_inner().into_inner()).unwrap();
}

fn motion(model: &Path) -> Vec<Truth> {
    let messages = Reader::open(model).unwrap().map(|message| message.unwrap().body);
    messages.filter_map(|body| if let Body::Truth(truth) = body { Some(truth) } else { None }).collect()
}

fn body(truth: &Truth) -> UnitQuaternion<f64> {
    let [roll, pitch, yaw] = [truth.roll_deg, truth.pitch_deg, truth.yaw_deg].map(f64::to_radians);
    UnitQuaternion::from_euler_angles(roll, pitch, yaw)
}

fn record(plan: &Plan, trial: &Trial, motion: &[Truth], log: &Path) {
    let begun = SystemTime::UNIX_EPOCH + Duration::from_secs(CREATED_S);
    let settings = Settings { board_id: 7, ..Settings::DEFAULT };
    let info = Info { firmware: [0, 1, 0], board_id: 7, imu_id: 0x68, boot_count: 3, ..Info::default() };
    let board = board::to_log(&info, &settings);
    let mut start = run::start(plan, trial, 1, Origin::Rig, Some(board), begun);
    "golden".clone_into(&mut start.identity.host_git_hash);
    let mut recorder = Recorder::create(log, &start, settings, begun).unwrap();
    let rest = RestMeta { still: true, waited_s: 3.2, at_most_s: 300.0, yaw_dps: Some(0.02), tilt_dps: Some(0.03) };
    recorder.meta(rest, |records| &mut records.rest).unwrap();
    recorder.event(EventKind::Phase, "calibrate", begun).unwrap();

    let Phases { calibrate_s, preroll_s, run_s, .. } = trial.phases;
    let tick = |time_s: f64| (time_s / TICK_S).round() as usize;
    let [calibrated, runs, ends] = [calibrate_s, calibrate_s + preroll_s, calibrate_s + preroll_s + run_s].map(tick);
    let mut random = Random(7 + trial.index as u64);
    let (mut attitude, mut bias, mut sums) = (Attitude::default(), [0.0f32; 3], [0i64; 3]);
    let gains = Gains { kp: settings.attitude_kp, ki: settings.attitude_ki };
    let counts =
        |value: Vector3<f64>| -> [SensorCounts; 3] { value.map(|one| SensorCounts(one.round() as i16)).into() };
    for (i, pair) in motion.windows(2).enumerate() {
        let host = begun + Duration::from_micros(5000 * i as u64);
        let [before, now] = [&pair[0], &pair[1]].map(body);
        let rate_dps = (before.inverse() * now).scaled_axis().map(f64::to_degrees) / TICK_S;
        let gyro = counts((rate_dps + Vector3::new(0.3, -0.2, 0.15) + random.normals(0.05)) * 131.0);
        let accel = counts((now.inverse() * Vector3::z() + random.normals(0.004)) * 16384.0);
        if i < calibrated {
            (0..3).for_each(|k| sums[k] += i64::from(gyro[k].0));
        } else if i == calibrated {
            bias = sums.map(|sum| (sum as f64 / calibrated as f64) as f32);
            let samples = calibrated as u16;
            recorder.calibration(&Calibration { still: true, bias, noise: 7, samples }, host).unwrap();
            recorder.event(EventKind::Phase, "preroll", host).unwrap();
        }
        if i == runs {
            recorder.level(host).unwrap();
            recorder.event(EventKind::Phase, "run", host).unwrap();
        } else if i == ends {
            recorder.event(EventKind::Phase, "decay", host).unwrap();
        }
        let half_turn =
            [0, 1, 2].map(|k| ((f32::from(gyro[k].0) - bias[k]) / 131.0).to_radians() * (TICK_S / 2.0) as f32);
        attitude.update(half_turn, accel.map(|count| f32::from(count.0)), 1, gains);
        let is_running = (runs..ends).contains(&i);
        let (speeds, turns) = ([pair[1].motor1_rpm, pair[1].motor2_rpm], [pair[1].motor1_turns, pair[1].motor2_turns]);
        let frame = Telemetry {
            seq: Count(i as u16),
            attitude: attitude.quaternion(),
            gyro,
            accel,
            temperature: TemperatureCounts::from_celsius(26.5 - 1.5 * (-(i as f64) * TICK_S / 50.0).exp()),
            target: trial.speeds.map(|speed| if is_running { speed } else { CentiRpm(0) }),
            speed: speeds.map(CentiRpm::from_rpm),
            duty: speeds.map(|rpm| Duty((2.0 * rpm).round() as i16)),
            encoder: turns.map(|turns| EncoderCounts((turns * f64::from(settings.counts_per_turn)).round() as i32)),
            state: if is_running { State::Running } else { State::Idle },
            imu_fresh: true,
            ..Telemetry::default()
        };
        recorder.frame(&frame, 1_000_000 + 5000 * i as u64, host).unwrap();
    }
    let host = begun + Duration::from_micros(5000 * motion.len() as u64);
    recorder.event(EventKind::Phase, "end", host).unwrap();
    let clock = ClockMeta { pings: 300, offset_ns: 0, drift_ppm: 120.0, residual_us: 300.0 };
    recorder.meta(clock, |records| &mut records.clock).unwrap();
    let link = LinkStats { samples: motion.len() as u64 - 1, ..LinkStats::default() };
    recorder.finish(&mut Summary { end: End::Complete, link, ..Summary::default() }).unwrap();
}
