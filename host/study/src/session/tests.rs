//! Sessions that are started, interrupted, resumed, and misused.

use super::*;
use crate::plan::{PUBLISHED, RobotFile, board};
use crate::run;
use biflag_log::{ClockMeta, EventKind, Origin, SensorMeta, Writer};
use protocol::{Info, Settings};
use std::time::SystemTime;

fn plan(text: &str) -> Plan {
    Plan::parse(text, "plan.toml").unwrap()
}

fn two_trials() -> Plan {
    plan("[session]\nname = \"a\"\n[speeds]\npairs = [[50, 10], [0, 45]]\n")
}

fn attempt(session: &Session, trial: &Trial, end: Option<End>) -> PathBuf {
    attempt_on(session, trial, end, Origin::Rig, Settings::DEFAULT)
}

fn attempt_on(session: &Session, trial: &Trial, end: Option<End>, origin: Origin, settings: Settings) -> PathBuf {
    let (number, path) = session.next_attempt(trial).unwrap();
    let (board, time) = (board::to_log(&info(&settings), &settings), SystemTime::now());
    let start = run::start(session.plan(), trial, number, origin, Some(board), time);
    let mut writer = Writer::create(&path, &start, time).unwrap();
    for text in ["one", "two", "three"] {
        writer.event(EventKind::Note, text, SystemTime::UNIX_EPOCH).unwrap();
        // A metadata record closes the chunk before it.
        writer.meta(&ClockMeta::default()).unwrap();
    }
    match end {
        Some(end) => writer.finish(&Summary { end, ..Summary::default() }).unwrap(),
        None => {
            drop(writer);
            let length = std::fs::metadata(&path).unwrap().len();
            std::fs::File::options().write(true).open(&path).unwrap().set_len(length - 10).unwrap();
        }
    }
    path
}

#[test]
fn incomplete_trials_are_repeated_and_their_logs_kept() {
    let folder = tempfile::tempdir().unwrap();
    let plan = two_trials();
    let [first, second] = [&plan.trials[0], &plan.trials[1]];
    let session = Session::create(folder.path(), &plan).unwrap();
    let names = |session: &Session, trial| -> Vec<(u32, String, Option<End>)> {
        let state = session.state(trial).unwrap();
        let name = |path: &Path| path.file_name().unwrap().to_string_lossy().into_owned();
        state.attempts.iter().map(|a| (a.number, name(&a.path), a.summary.as_ref().map(|s| s.end))).collect()
    };
    attempt(&session, first, Some(End::Complete));
    attempt(&session, second, Some(End::Aborted));
    let cut = attempt(&session, second, None);

    let session = Session::resume(folder.path(), &plan).unwrap();
    let states = session.states().unwrap();
    assert_eq!(states.iter().map(|state| state.complete().is_some()).collect::<Vec<_>>(), [true, false]);
    assert_eq!(states[1].next_number(), 3);
    attempt(&session, second, Some(End::Complete));
    let recovered = cut.with_extension("recovered.mcap");
    biflag_log::recover(&cut, &recovered).unwrap();
    assert_eq!(
        names(&session, second),
        [
            (1, "002_w1+0_w2+45.mcap".to_owned(), Some(End::Aborted)),
            (2, "002_w1+0_w2+45.attempt2.mcap".to_owned(), None),
            (2, "002_w1+0_w2+45.attempt2.recovered.mcap".to_owned(), None),
            (3, "002_w1+0_w2+45.attempt3.mcap".to_owned(), Some(End::Complete)),
        ]
    );
    assert_eq!(names(&session, first), [(1, "001_w1+50_w2+10.mcap".to_owned(), Some(End::Complete))]);
}

fn info(settings: &Settings) -> Info {
    Info { board_id: settings.board_id, ..Info::default() }
}

/// Damage in the middle of a log does not show at its end, but is recorded in the recovered log.
#[test]
fn trial_with_a_damaged_log_is_repeated() {
    let folder = tempfile::tempdir().unwrap();
    let plan = two_trials();
    let session = Session::create(folder.path(), &plan).unwrap();
    let first = &plan.trials[0];
    let log = attempt(&session, first, Some(End::Complete));
    let mut bytes = std::fs::read(&log).unwrap();
    // The first chunk declares the channels; the data of the second follow the name of its compression and a length.
    let place = bytes.windows(4).enumerate().filter(|(_, four)| four == b"zstd").nth(1).unwrap().0 + 4 + 8 + 6;
    bytes[place] ^= 0x55;
    std::fs::write(&log, bytes).unwrap();
    assert!(!biflag_log::check(&log).unwrap().is_empty());
    assert_eq!(session.state(first).unwrap().complete().unwrap().path, log, "the damage does not show at the end");
    let checked = &session.checked_states().unwrap()[0];
    assert_eq!(checked.complete(), None);
    assert!(checked.attempts[0].losses[0].starts_with("a chunk"), "{checked:?}");

    biflag_log::recover(&log, &log.with_extension("recovered.mcap")).unwrap();
    let state = session.state(first).unwrap();
    assert_eq!((state.complete(), state.next_number()), (None, 2));
    let again = attempt(&session, first, Some(End::Complete));
    assert_eq!(session.state(first).unwrap().complete().unwrap().path, again);
    assert!(log.exists());
}

/// A log that was copied while being written can still become complete; a copy of its beginning does not show its losses.
#[test]
fn complete_log_wins_over_a_copy_of_its_beginning() {
    let folder = tempfile::tempdir().unwrap();
    let plan = two_trials();
    let session = Session::create(folder.path(), &plan).unwrap();
    let first = &plan.trials[0];
    let log = attempt(&session, first, Some(End::Complete));
    let whole = std::fs::read(&log).unwrap();
    std::fs::write(&log, &whole[..whole.len() / 2]).unwrap();
    let copy = log.with_extension("recovered.mcap");
    assert!(!biflag_log::recover(&log, &copy).unwrap().losses.is_empty());
    assert_eq!(session.state(first).unwrap().complete(), None, "the log is cut off");
    std::fs::write(&log, &whole).unwrap();
    let states = [session.states().unwrap(), session.intact_states().unwrap(), session.checked_states().unwrap()];
    for state in states.iter().map(|states| &states[0]).chain([&session.state(first).unwrap()]) {
        assert_eq!(state.complete().map(|attempt| &attempt.path), Some(&log), "{state:?}");
        assert_eq!(state.best().unwrap().path, log);
        assert_eq!(state.attempts[1].path, copy);
        assert!(!state.attempts[1].losses.is_empty(), "the copy itself is not complete");
    }
}

/// A log that cannot be read may be complete, so its trial is not repeated. The test simulates a failing disk, because
/// permissions do not apply to the superuser.
#[test]
#[cfg(target_os = "linux")]
fn log_that_cannot_be_read_is_an_error_and_no_loss() {
    use std::os::unix::fs::symlink;
    let folder = tempfile::tempdir().unwrap();
    let plan = two_trials();
    let [first, second] = [&plan.trials[0], &plan.trials[1]];
    let session = Session::create(folder.path(), &plan).unwrap();
    attempt(&session, first, Some(End::Complete));
    let log = folder.path().join(format!("{}.mcap", second.name));
    // A regular file whose content cannot be read.
    symlink("/proc/self/mem", &log).unwrap();
    for result in [session.states(), session.intact_states(), session.checked_states()] {
        match result {
            Err(SessionError::Log(error @ LogError::Read { .. })) => {
                assert_eq!(error.to_string(), format!("{}: cannot be read", log.display()));
            }
            other => panic!("{other:?}"),
        }
    }
    assert!(matches!(session.next_attempt(second), Err(SessionError::Log(_))));
    assert!(session.state(first).unwrap().complete().is_some(), "the other trial is not concerned");
    // A link to itself cannot be read either.
    std::fs::remove_file(&log).unwrap();
    symlink(log.file_name().unwrap(), &log).unwrap();
    assert!(matches!(session.states(), Err(SessionError::Io { path, .. }) if path == log));
}

#[test]
fn session_that_is_written_is_known_to_be_in_use() {
    let folder = tempfile::tempdir().unwrap();
    assert!(!is_in_use(folder.path()), "it has no session");
    let session = Session::create(folder.path(), &two_trials()).unwrap();
    attempt(&session, &session.plan().trials[0], Some(End::Complete));
    assert!(!is_in_use(folder.path()));
    let lock = session.lock(Sharing::Alone).unwrap();
    let draft = folder.path().join("session.toml.1.partial");
    std::fs::write(&draft, "half").unwrap();
    assert!(is_in_use(folder.path()) && is_in_use(folder.path()));
    assert!(draft.exists(), "nothing is swept");
    assert!(!rebuild(folder.path()).unwrap().written, "an intact manifest needs nothing");
    let manifest = folder.path().join(MANIFEST);
    let text = std::fs::read_to_string(&manifest).unwrap();
    std::fs::write(&manifest, &text[..60]).unwrap();
    assert!(matches!(rebuild(folder.path()), Err(SessionError::BeingRecorded { path }) if path == folder.path()));
    assert_eq!(std::fs::read_to_string(&manifest).unwrap(), text[..60]);
    drop(lock);
    assert!(!is_in_use(folder.path()));
    assert!(rebuild(folder.path()).unwrap().written);
    drop(session.lock(Sharing::Alone).unwrap());
}

#[test]
fn session_is_locked_for_one_program_or_for_shards() {
    let folder = tempfile::tempdir().unwrap();
    let session = Session::create(folder.path(), &two_trials()).unwrap();
    for left in ["session.toml.1.partial", "001_w1+50_w2+10.mcap.unfinished"] {
        std::fs::write(folder.path().join(left), "half").unwrap();
    }
    let in_use = |sharing| matches!(session.lock(sharing), Err(SessionError::InUse { .. }));
    let alone = session.lock(Sharing::Alone).unwrap();
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "what killed programs left is removed");
    assert!(in_use(Sharing::Alone) && in_use(Sharing::WithShards));
    drop(alone);
    let shards = [(); 2].map(|()| session.lock(Sharing::WithShards).unwrap());
    assert!(in_use(Sharing::Alone));
    drop(shards);
    assert!(!in_use(Sharing::Alone));
}

#[test]
fn session_continues_only_with_the_same_emulated_sensor() {
    let folder = tempfile::tempdir().unwrap();
    let plan = two_trials();
    let session = Session::create(folder.path(), &plan).unwrap();
    let part = SensorMeta { seed: 7, kind: "typical".to_owned(), gyro_scale: [0.02; 3], ..SensorMeta::default() };
    let (_, path) = session.next_attempt(&plan.trials[0]).unwrap();
    let start = run::start(session.plan(), &plan.trials[0], 1, Origin::VirtualRig, None, SystemTime::now());
    let mut writer = Writer::create(&path, &start, SystemTime::now()).unwrap();
    writer.meta(&part).unwrap();
    writer.finish(&Summary { end: End::Complete, ..Summary::default() }).unwrap();

    let go_on =
        |part: &SensorMeta| session.expect_same_rig(&session.states().unwrap(), Origin::VirtualRig, None, Some(part));
    assert!(go_on(&part).is_ok());
    let other = SensorMeta { seed: 8, gyro_scale: [0.01; 3], ..part };
    let refused = go_on(&other).unwrap_err().to_string();
    assert!(refused.contains("typical\" of seed 7") && refused.contains("of seed 8"), "{refused}");
}

#[test]
fn session_continues_only_on_the_same_rig_and_settings() {
    let folder = tempfile::tempdir().unwrap();
    let plan = two_trials();
    let session = Session::create(folder.path(), &plan).unwrap();
    let settings = Settings { board_id: 3, ..Settings::DEFAULT };
    let go_on = |origin, settings: Settings, info: Info| {
        session.expect_same_rig(&session.states().unwrap(), origin, Some(&board::to_log(&info, &settings)), None)
    };
    let refused = |origin, settings: Settings| match go_on(origin, settings, info(&settings)) {
        Err(error @ SessionError::OtherRig { .. }) => error.to_string(),
        other => panic!("{other:?}"),
    };
    attempt_on(&session, &plan.trials[0], Some(End::Aborted), Origin::VirtualRig, Settings::DEFAULT);
    assert_eq!(go_on(Origin::Rig, settings, info(&settings)).unwrap(), None, "incomplete trials are not compared");
    attempt_on(&session, &plan.trials[0], Some(End::Complete), Origin::Rig, settings);

    let recalibrated = Settings { gyro_bias: [1.0, 2.0, 3.0], deadline_ms: 900, ..settings };
    assert_eq!(go_on(Origin::Rig, recalibrated, info(&settings)).unwrap(), None);
    let newer = Info { firmware: [9, 8, 7], ..info(&settings) };
    assert!(go_on(Origin::Rig, settings, newer).unwrap().unwrap().contains("9.8.7"));
    assert!(refused(Origin::VirtualRig, settings).contains("ran on the rig"));
    assert!(refused(Origin::Model, settings).contains("run in the model"));
    assert!(refused(Origin::Rig, Settings { board_id: 4, ..settings }).contains("run on board 4"));
    assert!(refused(Origin::Rig, Settings { speed_kp: 2.0, ..settings }).contains("speed_kp = 1.0"));
}

/// The clock of a computer without a clock chip is behind until it is set.
#[test]
fn log_of_another_robot_is_left_out_and_one_of_an_earlier_time_is_used_for_want_of_another() {
    let folder = tempfile::tempdir().unwrap();
    let plan = two_trials();
    let session = Session::create(folder.path(), &plan).unwrap();
    let [now, earlier] = [0, 86_400].map(|s| SystemTime::now() - std::time::Duration::from_secs(s));
    let write = |plan: &Plan, trial: &Trial, origin, time| {
        let (number, path) = session.next_attempt(trial).unwrap();
        let start = run::start(plan, trial, number, origin, None, time);
        Writer::create(&path, &start, time)
            .unwrap()
            .finish(&Summary { end: End::Complete, ..Summary::default() })
            .unwrap();
        session.state(trial).unwrap()
    };
    let robot = RobotFile { name: "thick.toml".to_owned(), text: "[fluid]\nviscosity_pa_s = 2.5\n".to_owned() };
    let state = write(&Plan { robot, ..plan.clone() }, &plan.trials[0], Origin::Model, now);
    assert!(state.attempts.is_empty() && state.left_out[0].finding.text.contains("is of another robot"), "{state:?}");

    let state = write(&plan, &plan.trials[1], Origin::Rig, earlier);
    let [found] = &state.complete().unwrap().identity[..] else { panic!("{state:?}") };
    assert!(found.grave && !found.empties_uncertainty() && found.text.contains("the session began on"), "{found}");
    attempt(&session, &plan.trials[1], Some(End::Complete));
    let state = session.state(&plan.trials[1]).unwrap();
    assert!(state.attempts.len() == 2 && state.complete().unwrap().identity.is_empty(), "{state:?}");
}

#[test]
fn folder_with_stray_logs_is_rejected() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("001_w1+50_w2+10.mcap"), "of another session").unwrap();
    for begun in [Session::create(folder.path(), &two_trials()), Session::resume(folder.path(), &two_trials())] {
        assert!(matches!(begun, Err(SessionError::StrayLog { log, .. }) if log == "001_w1+50_w2+10.mcap"));
    }
    assert!(!folder.path().join(MANIFEST).exists());
}

#[test]
fn folder_contains_the_session_of_one_plan() {
    let folder = tempfile::tempdir().unwrap();
    let begun = Session::resume(folder.path(), &two_trials()).unwrap();
    assert_eq!(Session::open(folder.path()).unwrap(), begun);
    assert!(matches!(Session::create(folder.path(), &two_trials()), Err(SessionError::Exists { .. })));

    let renamed = plan("# the same\n[session]\nname = \"b\"\n[speeds]\npairs = [[50, 10], [0, 45]]\n");
    Session::resume(folder.path(), &renamed).unwrap();
    let patient = plan("[board]\ndeadline_ms = 900\n[speeds]\npairs = [[50, 10], [0, 45]]\n");
    Session::resume(folder.path(), &patient).unwrap();
    for (text, expected) in [
        ("[speeds]\npairs = [[50, 10]]", "the speeds, starting phases, repeats or seed differ"),
        ("[trial]\nrun = 60\n[speeds]\npairs = [[50, 10], [0, 45]]", "the durations of [trial] differ"),
        ("[board]\nspeed_kp = 2\n[speeds]\npairs = [[50, 10], [0, 45]]", "the settings of [board] differ"),
        ("[session]\nrobot = \"soft.toml\"\n[speeds]\npairs = [[50, 10], [0, 45]]", "the robot differs"),
    ] {
        match Session::resume(folder.path(), &plan(text)) {
            Err(SessionError::OtherPlan { difference, .. }) => assert_eq!(difference, expected),
            other => panic!("{other:?}"),
        }
    }
}

#[test]
fn invalid_session_folders_are_rejected() {
    let folder = tempfile::tempdir().unwrap();
    assert!(matches!(Session::open(folder.path()), Err(SessionError::NotASession { .. })));
    assert!(matches!(Session::open(&folder.path().join("none")), Err(SessionError::NotASession { .. })));
    std::fs::write(folder.path().join(MANIFEST), "format = 1").unwrap();
    assert!(matches!(Session::open(folder.path()), Err(SessionError::Manifest { .. })));
    let file = folder.path().join("file");
    std::fs::write(&file, "").unwrap();
    assert!(matches!(Session::create(&file, &two_trials()), Err(SessionError::NotAFolder { .. })));
}

#[test]
fn folder_named_after_a_plan_is_safe() {
    for (name, expected) in [
        ("../../etc/passwd", "etc-passwd"),
        ("/", "session"),
        ("..", "session"),
        ("C:\\\\temp", "C--temp"),
        ("a\\u0000b\\nc", "a-b-c"),
        ("Glyzerin 30 °C", "Glyzerin-30--C"),
        ("10:30", "10-30"),
        ("Con", "session-Con"),
        ("com1.2", "session-com1.2"),
        ("control", "control"),
    ] {
        let plan = plan(&format!("[session]\nname = \"{name}\"\n[speeds]\npairs = [[50, 10]]"));
        let folder = folder_named(&plan.name);
        assert_eq!(folder, Path::new(expected), "{name}");
        assert_eq!(folder.components().count(), 1);
        assert!(plan.trials[0].name.chars().all(|c| c.is_ascii_alphanumeric() || "_+-.".contains(c)));
    }
}

/// Plan and robot are in every log, so a session without its manifest can continue.
#[test]
fn lost_or_damaged_manifest_is_rebuilt_from_the_logs() {
    let folder = tempfile::tempdir().unwrap();
    let mut plan = two_trials();
    plan.robot = RobotFile { name: "soft.toml".to_owned(), text: "[base]\nmass_kg = 0.1\n".to_owned() };
    plan.text = plan.text.replace("[session]", "[session]\nrobot = \"soft.toml\"");
    let session = Session::create(folder.path(), &plan).unwrap();
    attempt(&session, &plan.trials[0], Some(End::Complete));
    attempt(&session, &plan.trials[1], None);
    std::fs::write(folder.path().join("003_w1+1_w2+1.mcap"), "").unwrap();
    std::fs::write(folder.path().join("session.toml.1.partial"), "half").unwrap();
    let intact = rebuild(folder.path()).unwrap();
    assert_eq!((intact.written, intact.session), (false, session.clone()));
    assert!(!folder.path().join("session.toml.1.partial").exists());

    let manifest = folder.path().join(MANIFEST);
    let text = std::fs::read_to_string(&manifest).unwrap();
    for damage in [None, Some(""), Some(&text[..60]), Some("plan = \"[speeds]\"\n"), Some("\u{0}\u{0}")] {
        match damage {
            None => std::fs::remove_file(&manifest).unwrap(),
            Some(damage) => std::fs::write(&manifest, damage).unwrap(),
        }
        assert!(Session::open(folder.path()).is_err());
        let rebuilt = rebuild(folder.path()).unwrap();
        assert_eq!((rebuilt.written, rebuilt.logs, rebuilt.unreadable.len()), (true, 2, 1), "{damage:?}");
        assert_eq!(rebuilt.kept.map(|kept| std::fs::read_to_string(kept).unwrap()).as_deref(), damage);
        let again = Session::resume(folder.path(), &plan).unwrap();
        assert_eq!((again.plan(), again.states().unwrap()), (&plan, session.states().unwrap()));
    }

    // A manifest of a newer version is not replaced.
    let newer = "format = 9\nhost_version = \"9.1\"\n";
    std::fs::write(&manifest, newer).unwrap();
    assert!(matches!(rebuild(folder.path()), Err(SessionError::Newer { program, .. }) if program == "9.1"));
    assert_eq!(std::fs::read_to_string(&manifest).unwrap(), newer);
}

#[test]
fn manifest_is_rebuilt_from_the_logs_of_one_plan_only() {
    let [folder, other] = [(); 2].map(|()| tempfile::tempdir().unwrap());
    assert!(matches!(rebuild(folder.path()), Err(SessionError::NothingToRebuild { .. })));
    let session = Session::create(folder.path(), &two_trials()).unwrap();
    attempt(&session, &session.plan().trials[0], Some(End::Complete));
    let another = Session::create(other.path(), &plan("[speeds]\npairs = [[50, 20]]\n")).unwrap();
    let log = attempt(&another, &another.plan().trials[0], Some(End::Complete));
    std::fs::copy(&log, folder.path().join(log.file_name().unwrap())).unwrap();
    std::fs::remove_file(folder.path().join(MANIFEST)).unwrap();
    assert!(matches!(rebuild(folder.path()), Err(SessionError::DifferentPlans { .. })));
    assert!(!folder.path().join(MANIFEST).exists());
}

/// Only the plan and the text of its own robot are needed to continue. Without a name, the robot is the published one.
#[test]
fn cosmetic_keys_may_be_missing_in_the_manifest() {
    let folder = tempfile::tempdir().unwrap();
    let plan = Plan { robot: RobotFile::built_in(PUBLISHED), ..two_trials() };
    let session = Session::create(folder.path(), &plan).unwrap();
    let manifest = folder.path().join(MANIFEST);
    let table: toml::Table = std::fs::read_to_string(&manifest).unwrap().parse().unwrap();
    for key in table.keys().filter(|key| *key != "plan") {
        let mut less = table.clone();
        less.remove(key);
        std::fs::write(&manifest, less.to_string()).unwrap();
        assert_eq!(Session::open(folder.path()).unwrap().plan(), session.plan(), "{key}");
    }
    let only = toml::Table::from_iter([("plan".to_owned(), table["plan"].clone())]);
    std::fs::write(&manifest, only.to_string()).unwrap();
    assert_eq!(Session::open(folder.path()).unwrap().plan(), session.plan());
    let robot = "plan = \"[session]\\nrobot = 'soft.toml'\\n[speeds]\\npairs = [[1, 1]]\"\n";
    std::fs::write(&manifest, robot).unwrap();
    assert!(matches!(Session::open(folder.path()), Err(SessionError::Manifest { .. })));
}

/// Links to logs are logs. Other files with a log's name are not overwritten, and do not stop a trial.
#[test]
#[cfg(target_os = "linux")]
fn links_are_followed_and_what_is_no_log_is_the_loss_of_its_trial() {
    use std::os::unix::fs::symlink;
    let [folder, store] = [(); 2].map(|()| tempfile::tempdir().unwrap());
    let plan = two_trials();
    let [first, second] = [&plan.trials[0], &plan.trials[1]];
    let session = Session::create(folder.path(), &plan).unwrap();
    let log = attempt(&session, first, Some(End::Complete));
    let stored = store.path().join("stored.mcap");
    std::fs::rename(&log, &stored).unwrap();
    symlink(&stored, &log).unwrap();
    std::fs::write(folder.path().join(format!("{}.mcap", second.name)), "a text that is no log at all").unwrap();
    let states = session.checked_states().unwrap();
    assert_eq!(states[0].complete().unwrap().path, log);
    assert_eq!((states[1].complete(), states[1].attempts.len()), (None, 1));
    assert_eq!(states[1].next_number(), 2);

    for name in ["attempt2", "attempt3", "attempt4"] {
        let path = folder.path().join(format!("{}.{name}.mcap", second.name));
        match name {
            "attempt2" => std::fs::create_dir(path).unwrap(),
            "attempt3" => symlink("/dev/zero", path).unwrap(),
            _ => symlink("nowhere", path).unwrap(),
        }
    }
    assert_eq!(session.next_attempt(second).unwrap().0, 5);
    std::fs::write(folder.path().join(format!("{}.attempt4294967295.mcap", second.name)), "").unwrap();
    assert_eq!(session.next_attempt(second).unwrap().0, 5);
}
