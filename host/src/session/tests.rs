//! Sessions that are begun, broken off, gone on with, and abused.

use super::*;
use crate::log::{Origin, Start, Writer};
use std::time::SystemTime;

fn plan(text: &str) -> Plan {
    Plan::parse(text, "plan.toml").unwrap()
}

fn two_trials() -> Plan {
    plan("[session]\nname = \"a\"\n[speeds]\npairs = [[50, 10], [0, 45]]\n")
}

fn attempt(session: &Session, trial: &Trial, end: Option<End>) -> PathBuf {
    let (number, path) = session.next_attempt(trial).unwrap();
    let start = Start {
        plan: session.plan(),
        trial,
        attempt: number,
        origin: Origin::Rig,
        board: None,
        time: SystemTime::UNIX_EPOCH,
    };
    let writer = Writer::create(&path, &start).unwrap();
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
fn what_is_complete_is_not_repeated_and_what_is_not_keeps_its_log() {
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
    log::recover(&cut, &recovered).unwrap();
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

#[test]
fn a_folder_holds_one_plans_session() {
    let folder = tempfile::tempdir().unwrap();
    let begun = Session::resume(folder.path(), &two_trials()).unwrap();
    assert_eq!(Session::open(folder.path()).unwrap(), begun);
    assert!(matches!(Session::create(folder.path(), &two_trials()), Err(SessionError::Exists { .. })));

    let renamed = plan("# the same\n[session]\nname = \"b\"\n[speeds]\npairs = [[50, 10], [0, 45]]\n");
    Session::resume(folder.path(), &renamed).unwrap();
    for (text, expected) in [
        ("[speeds]\npairs = [[50, 10]]", "the speeds, repeats or seed"),
        ("[trial]\nrun = 60\n[speeds]\npairs = [[50, 10], [0, 45]]", "the durations of [trial]"),
        ("[board]\ndeadline_ms = 300\n[speeds]\npairs = [[50, 10], [0, 45]]", "the settings of [board]"),
        ("[session]\nrobot = \"soft.toml\"\n[speeds]\npairs = [[50, 10], [0, 45]]", "the robot"),
    ] {
        match Session::resume(folder.path(), &plan(text)) {
            Err(SessionError::OtherPlan { difference, .. }) => assert_eq!(difference, expected),
            other => panic!("{other:?}"),
        }
    }
}

#[test]
fn what_is_no_session_is_said_to_be_none() {
    let folder = tempfile::tempdir().unwrap();
    assert!(matches!(Session::open(folder.path()), Err(SessionError::NotASession { .. })));
    assert!(matches!(Session::open(&folder.path().join("none")), Err(SessionError::Io { .. })));
    std::fs::write(folder.path().join(MANIFEST), "format = 1").unwrap();
    assert!(matches!(Session::open(folder.path()), Err(SessionError::Manifest { .. })));
    let file = folder.path().join("file");
    std::fs::write(&file, "").unwrap();
    assert!(matches!(Session::create(&file, &two_trials()), Err(SessionError::Io { .. })));
}

#[test]
fn no_name_leads_out_of_the_folder() {
    for (name, expected) in [
        ("../../etc/passwd", "etc-passwd"),
        ("/", "session"),
        ("..", "session"),
        ("C:\\\\temp", "C--temp"),
        ("a\\u0000b\\nc", "a-b-c"),
        ("Glyzerin 30 °C", "Glyzerin-30--C"),
    ] {
        let plan = plan(&format!("[session]\nname = \"{name}\"\n[speeds]\npairs = [[50, 10]]"));
        let folder = default_folder(&plan);
        assert_eq!(folder, Path::new(expected), "{name}");
        assert_eq!(folder.components().count(), 1);
        assert!(plan.trials[0].name.chars().all(|c| c.is_ascii_alphanumeric() || "_+-.".contains(c)));
    }
}
