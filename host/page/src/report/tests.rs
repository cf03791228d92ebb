//! Pages of logs and sessions, valid and hostile.

use super::*;
use biflag_log::{
    BoardMeta, CalibrationMeta, End, EventKind, Identity, ModelMeta, Origin, PlanMeta, RecoveryMeta, RobotMeta,
    Summary, TrialMeta,
};
use protocol::units::{CentiRpm, Count, Quaternion};
use protocol::{Settings, State, Telemetry};
use std::time::{Duration, SystemTime};
use study::plan::Plan;
use study::plan::board;
use study::run;

/// Ends an attribute, an element and a script, and begins others; the last two characters end a line in older scripts.
const MARKUP: &str = "\"'><img src=x onerror=alert(1)></script><script>alert(2)</script>&lt;\u{2028}\u{2029}";

const PLAN: &str = "[session]\nname = \"glycerin\"\n[trial]\ncalibrate = 0\npreroll = 0\nrun = 2\ndecay = 0\n\
                    [speeds]\npairs = [[50, 10], [0, 45], [-90, 90]]\n";

fn host(seconds: f64) -> SystemTime {
    SystemTime::UNIX_EPOCH + Duration::from_secs_f64(1_700_000_000.0 + seconds)
}

/// A log of two seconds, with `text` in all of its texts.
fn log(path: &Path, plan: &Plan, text: Option<&str>) {
    let info = protocol::Info { imu_id: protocol::GENUINE_IMU_ID, ..protocol::Info::default() };
    let board = board::to_log(&info, &Settings::DEFAULT);
    // A log of another trial, or of before its session, would be left out.
    let trial = plan.trials.iter().find(|trial| path.file_stem().is_some_and(|name| name == trial.name.as_str()));
    let trial = trial.unwrap_or(&plan.trials[0]);
    let start = run::start(plan, trial, 1, Origin::Rig, Some(board), SystemTime::now());
    let mut writer = run::Recorder::create(path, &start, Settings::DEFAULT, host(0.0)).unwrap();
    if let Some(text) = text {
        let text = || text.to_owned();
        let identity =
            Identity { format: 2, host_version: text(), host_git_hash: text(), created: text(), ..Identity::default() };
        writer.log.meta(&identity).unwrap();
        writer.log.meta(&PlanMeta { name: text(), operator: text(), note: text(), trials: 1, text: text() }).unwrap();
        writer.log.meta(&TrialMeta { name: text(), w1_rpm: 50.0, w2_rpm: 10.0, ..TrialMeta::default() }).unwrap();
        writer.log.meta(&RobotMeta { name: text(), text: text() }).unwrap();
        writer.log.meta(&ModelMeta { parameters: text(), ..ModelMeta::default() }).unwrap();
        writer
            .log
            .meta(&BoardMeta {
                firmware: text(),
                firmware_git_hash: text(),
                reset_cause: text(),
                settings: text(),
                ..BoardMeta::default()
            })
            .unwrap();
        writer.log.meta(&CalibrationMeta::default()).unwrap();
        writer.log.meta(&RecoveryMeta { source: text(), lost: text() }).unwrap();
    }
    writer.event(EventKind::Phase, text.unwrap_or("run"), host(0.0)).unwrap();
    for i in 0..400_u16 {
        let half = (f64::from(i) * 0.05).to_radians() / 2.0;
        let frame = Telemetry {
            seq: Count(i),
            attitude: Quaternion::from_f64([half.cos(), 0.0, 0.0, half.sin()]),
            target: [CentiRpm(5000), CentiRpm(1000)],
            speed: [CentiRpm(5000), CentiRpm(1000)],
            state: State::Running,
            imu_fresh: true,
            ..Telemetry::default()
        };
        let time_us = u64::from(i) * 5_000;
        writer.frame(&frame, time_us, host(f64::from(i) * 0.005)).unwrap();
        for kind in [EventKind::Fault, EventKind::Warning, EventKind::Note].into_iter().filter(|_| i == 100) {
            writer.event(kind, text.unwrap_or("something"), host(0.5)).unwrap();
        }
    }
    writer.event(EventKind::Phase, "end", host(2.0)).unwrap();
    let reason = text.unwrap_or_default().to_owned();
    let end = if text.is_some() { End::Failed } else { End::Complete };
    writer.finish(&mut Summary { end, reason, ..Summary::default() }).unwrap();
}

fn plan() -> Plan {
    Plan::parse(PLAN, "plan.toml").unwrap()
}

#[test]
fn a_page_is_self_contained_small_and_written_again() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("001.mcap");
    log(&path, &plan(), None);
    let written = write(&path, Kind::Report, None, Vec::new(), None).unwrap();
    assert_eq!(written.html, folder.path().join("001.html"));
    let page = std::fs::read_to_string(&written.html).unwrap();
    assert_eq!(written.bytes, page.len() as u64);
    assert!(page.len() < 400_000, "{}", page.len());
    assert!(page.contains("001_w1+50_w2+10 at (50, 10) rpm") && page.contains("The charts show every sample."));
    // The only addresses are in comments of the library, and in the name of SVG, which nothing fetches.
    for address in page.match_indices("://").map(|(at, _)| &page[at.saturating_sub(8)..(at + 40).min(page.len())]) {
        assert!(
            ["github.com/leeoniya/uPlot", "www.w3.org/2000/svg"].iter().any(|known| address.contains(known)),
            "{address}"
        );
    }
    write(&path, Kind::Report, None, Vec::new(), None).unwrap();
}

#[test]
fn other_files_are_not_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let (path, page) = (folder.path().join("a.mcap"), folder.path().join("a.html"));
    log(&path, &plan(), None);
    assert!(matches!(write(&path, Kind::Report, None, Vec::new(), Some(&path)), Err(PageError::WrongUse { .. })));
    std::fs::write(&page, "<html>mine</html>").unwrap();
    assert!(matches!(write(&path, Kind::Report, None, Vec::new(), None), Err(PageError::WrongUse { .. })));
    std::fs::remove_file(&page).unwrap();
    std::os::unix::fs::symlink(folder.path().join("elsewhere"), &page).unwrap();
    assert!(matches!(write(&path, Kind::Report, None, Vec::new(), None), Err(PageError::WrongUse { .. })));
    assert!(!folder.path().join("elsewhere").exists());
    let nowhere = folder.path().join("no/such/folder.html");
    let no_folder = write(&path, Kind::Report, None, Vec::new(), Some(&nowhere));
    assert!(matches!(no_folder, Err(PageError::Output(study::output::OutputError::Folder { .. }))));
}

/// Returns the number of elements of a kind on a page.
fn count(page: &str, element: &str) -> usize {
    page.matches(&format!("<{element}")).count()
}

#[test]
fn markup_in_any_text_is_escaped() {
    let folder = tempfile::tempdir().unwrap();
    let [good, bad] = ["good", "bad"].map(|name| folder.path().join(name).with_extension("mcap"));
    log(&good, &plan(), None);
    log(&bad, &plan(), Some(MARKUP));
    let [good, bad] = [good, bad].map(|log| {
        let written = write(&log, Kind::Report, None, Vec::new(), None).unwrap();
        std::fs::read_to_string(written.html).unwrap()
    });
    assert_eq!(count(&bad, "script"), count(&good, "script"));
    assert_eq!(count(&bad, "/script"), count(&good, "/script"));
    assert_eq!((count(&bad, "img"), count(&bad, "canvas")), (0, 1));
    assert!(bad.matches("&lt;img src=x onerror=alert(1)&gt;").count() >= 15);
    // In the data, the text is JSON.
    assert!(bad.contains(r"\u003cimg src=x onerror=alert(1)\u003e"));
}

#[test]
fn a_hostile_session_reads_and_writes_nothing_outside_its_folder() {
    let outside = tempfile::tempdir().unwrap();
    let folder = outside.path().join("session");
    let hostile = "[session]\nname = \"../../escape\"\nnote = \"<script>alert(1)</script>\"\noperator = \"<b>\"\nrobot = \"/etc/passwd\"\n\
                   [speeds]\npairs = [[50, 10], [0, 45], [1, 2]]\n";
    let plan = Plan::parse(hostile, "plan.toml").unwrap();
    let session = Session::create(&folder, &plan).unwrap();
    log(&folder.join("001_w1+50_w2+10.mcap"), &plan, Some("../../../escape"));
    std::fs::write(folder.join("002_w1+0_w2+45.mcap"), "no log").unwrap();
    // A link to a file elsewhere is not a log of the session.
    std::fs::write(outside.path().join("secret.mcap"), "the secret outside").unwrap();
    std::os::unix::fs::symlink(outside.path().join("secret.mcap"), folder.join("003_w1+1_w2+2.mcap")).unwrap();
    let text = std::fs::read_to_string(folder.join("session.toml")).unwrap();
    std::fs::write(folder.join("session.toml"), text.replace("/etc/passwd", "../../etc/passwd")).unwrap();

    let before = names(outside.path());
    let written = write(&folder, Kind::Report, None, Vec::new(), None);
    // One unreadable log does not keep the page from being written.
    let written = written.unwrap();
    assert_eq!(names(outside.path()), before);
    assert_eq!(written.html, folder.join("report.html"));
    assert_eq!(names(&folder).len(), 5);
    assert!(session.folder().join("report.html").is_file());
    let page = std::fs::read_to_string(written.html).unwrap();
    assert!(page.contains("../../escape") && !page.contains("<script>alert") && !page.contains("<b>../"));
    assert!(!page.contains("root:x:0") && !page.contains("the secret outside"));
}

fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let mut names: Vec<_> = entries.collect();
    names.sort();
    names
}

#[test]
fn a_session_lists_its_trials_and_those_without_a_log() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path().join("session");
    let plan = plan();
    let session = Session::create(&folder, &plan).unwrap();
    log(&folder.join("001_w1+50_w2+10.mcap"), &plan, None);
    let written = write(session.folder(), Kind::Report, None, Vec::new(), None).unwrap();
    assert_eq!(written.trials, 1);
    let page = std::fs::read_to_string(written.html).unwrap();
    assert!(
        page.contains("href=\"#trial-1\"")
            && page.contains("data-trial=\"trial-1\"")
            && !page.contains("href=\"#trial-2\"")
    );
    assert_eq!(page.matches("no log yet").count(), 2);
    assert!(page.contains("No log yet: 2 of 3 trials."));
}

/// The data of the `i`-th trial on a page.
fn data(page: &str, i: usize) -> serde_json::Value {
    let element = page.split(&format!("id=\"trial-{i}-data\">")).nth(1).unwrap();
    serde_json::from_str(element.split("</script>").next().unwrap()).unwrap()
}

/// Numbers of the page in 16 or 32 bits.
fn numbers(packed: &serde_json::Value) -> Vec<f64> {
    use base64::Engine;
    let decode = |text: &serde_json::Value| base64::prelude::BASE64_STANDARD.decode(text.as_str().unwrap()).unwrap();
    if packed["f32"].is_string() {
        return decode(&packed["f32"]).as_chunks().0.iter().map(|four| f32::from_le_bytes(*four).into()).collect();
    }
    let (from, step) = (packed["from"].as_f64().unwrap(), packed["step"].as_f64().unwrap());
    if let Some(count) = packed["count"].as_u64() {
        return vec![from; count as usize];
    }
    decode(&packed["u16"]).as_chunks().0.iter().map(|two| from + step * f64::from(u16::from_le_bytes(*two))).collect()
}

#[test]
fn a_trial_among_many_is_played_from_real_samples_and_drawn_with_its_range() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path().join("session");
    let plan = Plan::parse(
        "[trial]\ncalibrate = 0\npreroll = 2\nrun = 20\ndecay = 0\n[speeds]\ngrid = { w1 = [-90, 90, 10], w2 = [0, 90, 10] }\n",
        "plan.toml",
    )
    .unwrap();
    let path = |trial: &study::plan::Trial| folder.join(format!("{}.mcap", trial.name));
    std::fs::create_dir(&folder).unwrap();
    let trial = &plan.trials[0];
    let start = run::start(&plan, trial, 1, Origin::Rig, None, SystemTime::now());
    let mut writer = run::Recorder::create(&path(trial), &start, Settings::DEFAULT, host(0.0)).unwrap();
    writer.event(EventKind::Phase, "preroll", host(0.0)).unwrap();
    // Pitch and roll go round a circle once in 0.65 s, so that a smallest pitch never comes with a smallest roll.
    for i in 0..4_400_u16 {
        let seconds = f64::from(i) * 0.005;
        let angle = seconds / 0.65 * std::f64::consts::TAU;
        let radius = if i < 400 { 0.0 } else { 10.0 };
        let [pitch, roll] = [angle.sin(), angle.cos()].map(|part| (radius * part).to_radians() / 2.0);
        if i == 400 {
            writer.event(EventKind::Phase, "run", host(seconds)).unwrap();
        }
        let (sp, cp, sr, cr) = (pitch.sin(), pitch.cos(), roll.sin(), roll.cos());
        let frame = Telemetry {
            seq: Count(i),
            attitude: Quaternion::from_f64([cp * cr, cp * sr, sp * cr, -sp * sr]),
            state: State::Running,
            imu_fresh: true,
            ..Telemetry::default()
        };
        writer.frame(&frame, u64::from(i) * 5_000, host(seconds)).unwrap();
    }
    writer.event(EventKind::Phase, "end", host(22.0)).unwrap();
    writer.finish(&mut Summary { end: End::Complete, ..Summary::default() }).unwrap();

    let view = view(&Attempt::of_log(&path(trial)), ByteBudget::of_trials(plan.trials.len())).unwrap();
    let written = folder.join("page.html");
    put(&written, &page_of_log(&view), [1, 0], Vec::new()).unwrap();
    let page = std::fs::read_to_string(written).unwrap();
    let data = data(&page, 1);
    let attitude = &data["attitude"];
    let [pitch, roll] = ["pitch", "roll"].map(|name| numbers(&attitude[name]));
    assert!((200..4_400).contains(&pitch.len()), "{}", pitch.len());
    for (pitch, roll) in pitch.iter().zip(&roll) {
        let radius = pitch.hypot(*roll);
        assert!((radius - 10.0).abs() < 0.02 || radius < 0.02, "({pitch}, {roll}) is not on the circle");
    }
    // The charts have the whole range of every stretch about its mean.
    let ranges = &attitude["ranges"];
    let width_s = ranges["width_s"].as_f64().unwrap();
    assert!(width_s > 0.1 && width_s < 2.0);
    let part = |part: &str| numbers(&ranges["columns"]["pitch"][part]);
    let (low, mean, high) = (part("low"), part("mean"), part("high"));
    assert_eq!(low.len() as u64, ranges["count"].as_u64().unwrap());
    assert!((0..low.len()).all(|i| low[i] <= mean[i] && mean[i] <= high[i]));
    let extreme = |values: &[f64]| values.iter().copied().fold(0.0_f64, |most, value| most.max(value.abs()));
    assert!((extreme(&low) - 10.0).abs() < 0.02 && (extreme(&high) - 10.0).abs() < 0.02);
    assert!(page.contains(&format!("range of {width_s:.2} s (line: mean)")));
}

#[test]
fn sessions_of_scattered_speeds_have_maps() {
    let folder = tempfile::tempdir().unwrap();
    for (name, pairs, marks) in [
        ("subset", "[[-90, 0], [90, 90], [-50, 20], [0, 10], [40, 40], [10, 70], [60, 30]]", "<rect"),
        ("scattered", "[[-90, 0], [90, 90], [-51.3, 20.2], [0, 11.7], [40, 43], [10.1, 70], [60, 30]]", "<circle"),
        ("few", "[[-90, 0], [90, 90]]", ""),
    ] {
        let text = format!("[trial]\ncalibrate = 0\npreroll = 0\nrun = 2\ndecay = 0\n[speeds]\npairs = {pairs}\n");
        let plan = Plan::parse(&text, "plan.toml").unwrap();
        let folder = folder.path().join(name);
        let session = Session::create(&folder, &plan).unwrap();
        for trial in &plan.trials {
            log(&folder.join(format!("{}.mcap", trial.name)), &plan, None);
        }
        let page = std::fs::read_to_string(write(session.folder(), Kind::Report, None, Vec::new(), None).unwrap().html)
            .unwrap();
        let maps: Vec<&str> =
            page.split("<svg viewBox").skip(1).map(|map| map.split("</svg>").next().unwrap()).collect();
        assert_eq!(maps.len(), if marks.is_empty() { 0 } else { 4 }, "{name}");
        for map in maps {
            let linked = map.split("<a href=\"#trial-").skip(1).filter(|link| link.contains(marks)).count();
            assert_eq!(linked, plan.trials.len(), "{name}");
            assert!(map.contains("speed of flagellum 1 (w1), rpm") && map.contains(", °</text>"));
        }
    }
}
