use super::*;
use crate::plan::{PHYSICAL, RobotFile, robot};
use crate::trial::{Data, Judged, Want};
use miette::Diagnostic;
use protocol::units::CentiRpm;
use std::ops::Range;
use std::path::{Path, PathBuf};

const COLUMNS: &str = "time=t:ms,yaw=-psi:rad,pitch=#3,roll=0,w1=w1,w2=w2:rps";

fn conditions() -> Conditions {
    let robot = robot::load(Path::new(PHYSICAL)).unwrap();
    Conditions {
        speeds: None,
        run_s: None,
        reverse: None,
        robot,
        uncertainty_deg: None,
        temperature_c: None,
        note: String::new(),
    }
}

/// Returns a table of 6 s at 20 Hz: a rest of 2 s with a yaw of 2.9 rad, then a turn of 12 °/s at 41.7 and -6 rpm, in
/// which the sensor's angle passes half a turn.
fn table(folder: &Path) -> PathBuf {
    let mut text = "# a camera\nt,psi,\"pitch, measured\",w1,w2\n".to_owned();
    for i in 0..=120 {
        let run_s = (f64::from(i) * 0.05 - 2.0).max(0.0);
        let psi = 2.9 - (12.0 * run_s).to_radians();
        let psi = (psi + std::f64::consts::PI).rem_euclid(std::f64::consts::TAU) - std::f64::consts::PI;
        let (w1, w2) = if i >= 40 { (41.7, -0.1) } else { (0.0, 0.0) };
        let pitch = if i == 77 { String::new() } else { format!("{}", 1.5 + 0.25 * run_s) };
        text += &format!("{},{psi},{pitch},{w1},{w2}\n", 5000 + 50 * i);
    }
    let path = folder.join("camera.csv");
    std::fs::write(&path, text).unwrap();
    path
}

fn imported(columns: &str, conditions: &Conditions) -> (Imported, Data) {
    imported_without(0..0, columns, conditions)
}

/// Like [`imported`], without these rows of the table.
fn imported_without(lost: Range<usize>, columns: &str, conditions: &Conditions) -> (Imported, Data) {
    let folder = tempfile::tempdir().unwrap();
    let (csv, log) = (table(folder.path()), folder.path().join("camera.mcap"));
    let text = std::fs::read_to_string(&csv).unwrap();
    let kept = text.lines().enumerate().filter(|(line, _)| *line < 2 || !lost.contains(&(line - 2)));
    let kept: Vec<&str> = kept.map(|(_, line)| line).collect();
    std::fs::write(&csv, kept.join("\n")).unwrap();
    let states = Table::read(&csv, 0).unwrap().states(&columns.parse().unwrap()).unwrap();
    let imported = write(&states, conditions, "camera.csv", &log).unwrap();
    (imported, Judged::read(&log, Want::default()).unwrap().data)
}

/// A camera has no telemetry.
#[test]
fn rows_that_a_camera_lost_are_rows_of_the_table() {
    let (_, data) = imported_without(82..109, COLUMNS, &conditions());
    let texts: Vec<String> = Judged::of(data.clone()).findings.into_iter().map(|finding| finding.text).collect();
    let has = |part: &str| texts.iter().any(|text| text.contains(part));
    assert!(
        has("full turn: rows of the table are missing from ") && has("rows of the table are missing in 1 place, 1.4"),
        "{texts:?}"
    );
    assert!(has("of the last ") && has("have rows of the table") && !has("telemetry"), "{texts:?}");
}

#[test]
fn units_signs_and_rest_of_a_table_are_those_of_the_log() {
    let (camera, data) = imported(COLUMNS, &Conditions { uncertainty_deg: Some([0.5, 0.2]), ..conditions() });
    assert_eq!((camera.samples, camera.speeds.map(|w| w.rpm())), (120, [41.7, -6.0]));
    assert!((camera.run_s.start - 6.95).abs() < 1e-9 && (camera.run_s.end - 11.0).abs() < 1e-9, "{camera:?}");
    assert!((data.duration_s - 6.0).abs() < 1e-9 && (data.times.run.start - 1.95).abs() < 1e-9, "{:?}", data.times);
    let zeroed = Judged::of(data.clone()).angles;
    // The yaw turns at 12 °/s from 2 s on, one row after the start of the run.
    for (time_s, angles) in [(1.0, [0.0, 0.0, 0.0]), (4.0, [24.0, 0.5, 0.0]), (6.0, [48.0, 1.0, 0.0])] {
        for (found, expected) in zeroed.at(time_s).into_iter().zip(angles) {
            assert!((found - expected).abs() < 0.02, "at {time_s}: {:?} for {angles:?}", zeroed.at(time_s));
        }
    }
    let [.., one, two] = data.motors.values.clone();
    assert!(
        (one[119] - 41.7 / 60.0 * 4.025).abs() < 1e-3 && (two[119] + 0.1 * 4.025).abs() < 1e-3,
        "{} {}",
        one[119],
        two[119]
    );
    let angles = zeroed.angles().unwrap();
    assert_eq!((angles.yaw_uncertainty_deg, angles.drift_deg), (Some(0.5), None));
    let measured = COLUMNS.replace("roll=0", "roll=-#3");
    let (_, whole) = imported(&measured, &Conditions { uncertainty_deg: Some([0.5, 0.2]), ..conditions() });
    assert!((Judged::of(whole.clone()).angles.angles().unwrap().roll_uncertainty_deg.unwrap() - 0.2).abs() < 1e-12);
    let texts: Vec<_> =
        Judged::of(data.clone()).findings.into_iter().map(|finding| (finding.grave, finding.text)).collect();
    let has = |part: &str| texts.iter().any(|(grave, text)| !grave && text.contains(part));
    assert!(has("1 row of the table without a value") && has("roll was not measured"), "{texts:?}");
    assert!(!texts.iter().any(|(_, text)| text.contains("uncertainty")), "{texts:?}");
}

/// The motors stop, and motor 2 turns back, before the angles are averaged.
#[test]
fn a_speed_that_changes_in_the_run_is_grave() {
    let folder = tempfile::tempdir().unwrap();
    let (csv, log) = (folder.path().join("a.csv"), folder.path().join("a.mcap"));
    for (w2, is_found) in [("-12.3", false), ("if", true)] {
        let row = |i: u32| {
            format!("{},0,0,0,37.7,{}\n", 0.1 * f64::from(i), if w2 == "if" && i > 200 { "12.3" } else { "-12.3" })
        };
        std::fs::write(&csv, (0..400).map(row).collect::<String>()).unwrap();
        let mapping: Mapping = "time=#1,yaw=#2,pitch=#3,roll=#4,w1=#5,w2=#6".parse().unwrap();
        let states = Table::read(&csv, 0).unwrap().states(&mapping).unwrap();
        write(&states, &conditions(), "a.csv", &log).unwrap();
        let data = Judged::read(&log, Want::default()).unwrap().data;
        let found = Judged::of(data.clone()).findings;
        let other = found.iter().any(|finding| finding.grave && finding.text.contains("motor 2 turned at 12.3 rpm"));
        assert_eq!(other, is_found, "{found:?}");
        std::fs::remove_file(&log).unwrap();
    }
}

/// Returns the grave findings about a table of 40 s with these rows of yaw and turns at times `step_s` apart.
/// The table's clock begins at 100 s.
fn grave(step_s: f64, row: impl Fn(f64) -> (f64, f64), run_s: Option<std::ops::Range<f64>>) -> String {
    grave_with_roll(|_| 0.0, step_s, row, run_s)
}

fn grave_with_roll(
    roll_deg: impl Fn(f64) -> f64,
    step_s: f64,
    row: impl Fn(f64) -> (f64, f64),
    run_s: Option<std::ops::Range<f64>>,
) -> String {
    let folder = tempfile::tempdir().unwrap();
    let (csv, log) = (folder.path().join("a.csv"), folder.path().join("a.mcap"));
    let line = |i: u32| {
        let time_s = f64::from(i) * step_s;
        let (yaw_deg, turns) = row(time_s);
        format!("{},{yaw_deg},0,{},{turns}\n", 100.0 + time_s, roll_deg(time_s))
    };
    std::fs::write(&csv, (0..(40.0 / step_s) as u32).map(line).collect::<String>()).unwrap();
    let mapping: Mapping = "time=#1,yaw=#2,pitch=#3,roll=#4,turns1=#5,turns2=0".parse().unwrap();
    let states = Table::read(&csv, 0).unwrap().states(&mapping).unwrap();
    write(&states, &Conditions { run_s, ..conditions() }, "a.csv", &log).unwrap();
    let data = Judged::read(&log, Want::default()).unwrap().data;
    let found = Judged::of(data.clone()).findings;
    found.into_iter().filter(|finding| finding.grave).map(|finding| finding.text + "\n").collect()
}

/// A motor that turns at 52.9 rpm after 10.3 s, and a robot that then swings about -40 degrees.
fn swinging(time_s: f64) -> (f64, f64) {
    let run_s = (time_s - 10.3).max(0.0);
    (-40.0 * (1.0 - (-run_s).exp()) + 2.0 * (5.5 * run_s).sin(), 52.9 / 60.0 * run_s)
}

#[test]
fn doubtful_tables_are_grave() {
    assert_eq!(grave(0.05, swinging, None), "");
    let text = grave(0.9, swinging, None);
    assert!(text.contains("1.3 rows for a turn of the faster flagellum"), "{text}");
    let text = grave(0.05, swinging, Some(120.0..139.0));
    assert!(text.contains("motor 1 turned before the run"), "{text}");
    let lost =
        |time_s: f64| if (30.0..30.05).contains(&time_s) { (-999.0, swinging(time_s).1) } else { swinging(time_s) };
    let text = grave(0.05, lost, None);
    assert!(text.contains("the attitude jumps by"), "{text}");
    let stood = |time_s: f64| (swinging(time_s.min(25.0)).0, swinging(time_s).1);
    let text = grave(0.05, stood, None);
    assert!(text.contains("does not change for more than 3 s from 125.0 s on"), "{text}");
    let slipped = |time_s: f64| (swinging(time_s).0 + if time_s < 30.0 { 0.0 } else { 15.0 }, swinging(time_s).1);
    let text = grave(0.05, slipped, None);
    assert!(text.contains("the attitude jumps by 15° at 130.00 s"), "{text}");
    let clipped = |time_s: f64| (swinging(time_s).0.max(-41.0), swinging(time_s).1);
    assert_eq!(grave(0.05, clipped, None), "", "for less than a turn");
    let (from, to) = (swinging(25.0).0, swinging(31.0).0);
    let joined = |time_s: f64| match (25.0..31.0).contains(&time_s) {
        true => (from + (to - from) * (time_s - 25.0) / 6.0, swinging(time_s).1),
        false => swinging(time_s),
    };
    let text = grave(0.05, joined, None);
    assert!(text.contains("the yaw is a straight line for more than 3 s from 125."), "{text}");
    assert_eq!(grave(0.05, |time_s| (swinging(time_s).0.round(), swinging(time_s).1), None), "", "whole degrees");
}

#[test]
fn an_angle_that_was_not_measured_has_no_uncertainty() {
    let (_, data) = imported(COLUMNS, &Conditions { uncertainty_deg: Some([0.5, 0.2]), ..conditions() });
    let zeroed = Judged::of(data.clone()).angles;
    let angles = zeroed.angles().unwrap();
    assert_eq!((angles.yaw_uncertainty_deg, angles.roll_uncertainty_deg), (Some(0.5), None));
    let known = zeroed.budgets(&data.times.run).map(|budget| budget.is_some());
    assert_eq!(known, [true, true, false]);
    let over_time = zeroed.over_time(&[3.0], 1.0).map(|angle| angle.is_some());
    assert_eq!(over_time, [true, true, false], "a comparison judges the others, and no fit weighs the trial");
}

/// A program that has no pitch may write zeros.
#[test]
fn an_angle_of_one_value_was_not_measured() {
    let folder = tempfile::tempdir().unwrap();
    let csv = folder.path().join("a.csv");
    let row = |i: u32| {
        let (yaw, roll) = (0.02 * f64::from(i % 7), 0.01 * f64::from(i % 3));
        let w1 = if i < 20 { 0.0 } else { 37.7 };
        format!("{},{yaw},0,{roll},{w1},-12.3\n", 0.1 * f64::from(i))
    };
    std::fs::write(&csv, (0..400).map(row).collect::<String>()).unwrap();
    let mapping: Mapping = "time=#1,yaw=#2,pitch=#3,roll=#4,w1=#5,w2=0".parse().unwrap();
    let states = Table::read(&csv, 0).unwrap().states(&mapping).unwrap();
    assert_eq!(states.about.constant, ["pitch", "w2"]);
    let log = folder.path().join("a.mcap");
    write(&states, &Conditions { uncertainty_deg: Some([0.5, 0.2]), ..conditions() }, "a.csv", &log).unwrap();
    let data = Judged::read(&log, Want::default()).unwrap().data;
    let known = Judged::of(data.clone()).angles.budgets(&data.times.run).map(|budget| budget.is_some());
    assert_eq!(known, [true, false, true]);
}

#[test]
fn quaternion_is_the_attitude_that_its_angles_are() {
    let folder = tempfile::tempdir().unwrap();
    let q = nalgebra::UnitQuaternion::from_euler_angles(0.1, -0.2, 2.3);
    let row = |t: u32| format!("{t};{};{};{};{}\n", q.w, q.i, q.j, q.k);
    let csv = folder.path().join("a.csv");
    std::fs::write(&csv, [0, 1, 2].map(row).concat()).unwrap();
    let mapping: Mapping = "time=#1,qw=#2,qx=#3,qy=#4,qz=#5".parse().unwrap();
    let states = Table::read(&csv, 0).unwrap().states(&mapping).unwrap();
    let expected = [2.3f64, -0.2, 0.1].map(f64::to_degrees);
    assert!(states.rows[2].angles_deg.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9), "{states:?}");
}

#[test]
fn an_import_without_an_uncertainty_says_so_and_has_none() {
    let (_, data) = imported(COLUMNS, &conditions());
    let zeroed = Judged::of(data.clone()).angles;
    assert_eq!(zeroed.angles().unwrap().yaw_uncertainty_deg, None);
    assert!(Judged::of(data.clone()).findings.iter().any(|finding| finding.text.contains("states no uncertainty")));
    assert_eq!(data.robot().unwrap(), RobotFile::of_log(data.records.robot.clone()).parse().unwrap());
}

#[test]
fn what_cannot_be_imported_is_said() {
    let folder = tempfile::tempdir().unwrap();
    for (columns, why) in [
        ("yaw=a,pitch=b,roll=c", "time is missing"),
        ("time=t,yaw=a,pitch=b", "roll is missing"),
        ("time=t,yaw=a,pitch=b,roll=c,qw=d", "the attitude is given twice"),
        ("time=t,qw=d,qx=e,qy=f", "qz is missing"),
        ("time=t,yaw=a,yaw=b,pitch=b,roll=c", "yaw is named twice"),
        ("time=t,yaw=a,pitch=b,roll=c,w1=d", "w1 is given without w2"),
        ("time=t,yaw=a:grad,pitch=b,roll=c", "\"grad\" is no unit of yaw"),
        ("time=t,jaw=a", "\"jaw\" is no quantity"),
        ("time=t,yaw=#0,pitch=b,roll=c", "\"#0\" is no column"),
        ("time=1,yaw=a,pitch=b,roll=c", "time cannot be 1"),
        ("time", "\"time\" names no column"),
    ] {
        let error = columns.parse::<Mapping>().unwrap_err();
        assert!(error.to_string().contains(why) && error.is_wrong_use(), "{columns}: {error}");
    }
    let rows = |rows: &[&str]| format!("t,y,p,r,n\n{}\n", rows.join("\n"));
    for (columns, text, why) in [
        ("time=t,yaw=y,pitch=p,roll=x", rows(&["0,0,0,0,0"]), "has no column x"),
        ("time=t,yaw=y,pitch=p,roll=#9", rows(&["0,0,0,0,0"]), "line 2: has 5 columns, so no column 9 for roll"),
        (
            "time=t,yaw=y,pitch=p,roll=r",
            rows(&["0,0,0,0,0", "1,fast,0,0,0"]),
            "line 3: \"fast\" for yaw is not a number",
        ),
        ("time=t,yaw=y,pitch=p,roll=r", rows(&["0,0,1,5,0,0"]), "decimal commas? write points"),
        ("time=t,yaw=y,pitch=p,roll=r", rows(&["0,0,0,0,0", "0,0,0,0,0"]), "line 3: the time 0 s follows 0 s"),
        ("time=t,yaw=y,pitch=p,roll=r", rows(&["0,0,170,0,0", "1,0,0,0,0"]), "check the units"),
        ("time=t,yaw=y,pitch=p,roll=r", rows(&["0,0,1,0,0", "1,0,359,359.9,0"]), "angles from 0 to 360 are folded"),
        ("time=t,yaw=y,pitch=p,roll=r,turns1=n,turns2=0", rows(&["0,0,0,0,9.9", "0.1,0,0,0,0.1"]), "turns1 goes from"),
        ("time=t,yaw=y,pitch=p,roll=r", rows(&["0,0,0,0,0", "1,,0,0,0"]), "has 1 rows"),
        (
            "time=t,yaw=y,pitch=p,roll=p",
            rows(&["0,0,1,0,0", "1,0,2,0,0"]),
            "two of its angles are the same in all rows",
        ),
        ("time=t,yaw=y,pitch=p,roll=r", rows(&["0,0,0,0,0", "9,0,0,0,0"]), "speeds of the motors are not known"),
        ("time=t,yaw=y,pitch=p,roll=r,w1=n,w2=n", rows(&["0,0,0,0,0", "9,0,0,0,0"]), "its motors never turn"),
        ("time=t,qw=y,qx=p,qy=r,qz=n", rows(&["0,0.5,0,0,0", "9,1,0,0,0"]), "a quaternion of length 0.500"),
    ] {
        let csv = folder.path().join("a.csv");
        std::fs::write(&csv, &text).unwrap();
        let log = folder.path().join("a.mcap");
        let states = Table::read(&csv, 0).and_then(|table| table.states(&columns.parse().unwrap()));
        let error = states.and_then(|states| write(&states, &conditions(), "a.csv", &log)).unwrap_err();
        let said = format!("{error}; {}", error.help().map_or_else(String::new, |help| help.to_string()));
        assert!(said.contains(why) && error.is_wrong_use(), "{why}: {said}");
        assert!(!log.exists());
    }
}

/// Decimal commas are distinguished from separators, and the end of an empty line is not a cell.
#[test]
fn separator_is_told_from_a_decimal_comma() {
    let folder = tempfile::tempdir().unwrap();
    let csv = folder.path().join("a.csv");
    let read = |bytes: &[u8]| {
        std::fs::write(&csv, bytes).unwrap();
        Table::read(&csv, 0)
    };
    for text in ["\r\nt;y\r\n0;1\r\n1;2\r\n", "# 1,2\n\nt;\"y, seen; deg\"\n0;1\n1;2\n", "\"t, s;\",y\n0,1\n1,2\n"] {
        let states = read(text.as_bytes()).unwrap().states(&"time=#1,yaw=#2,pitch=0,roll=0".parse().unwrap()).unwrap();
        assert_eq!((states.rows.len(), states.rows[1].angles_deg[0]), (2, 2.0), "{text:?}");
    }
    let table = read(b"0,00;1,5;2\n0,05;1,5;2\n").unwrap();
    let error = table.states(&"time=#1,yaw=#2,pitch=#3,roll=0".parse().unwrap()).unwrap_err();
    assert!(error.to_string().ends_with("\"0,00\" for time is not a number"), "{error}");
    for bytes in [&b"t,\xB0\n0,1\n"[..], b"\xFF\xFEt\0,\0y\0"] {
        let error = read(bytes).unwrap_err();
        assert!(error.to_string().ends_with("is no text in UTF-8") && error.is_wrong_use(), "{error}");
    }
}

/// As an editor counts them: with the line ends of Windows, comments and empty lines.
#[test]
fn errors_name_the_line_of_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let csv = folder.path().join("a.csv");
    let text = "# a camera\n\nt;y\n0;1\n# it was lost\n\n1;2\n2;x\n3;4\n";
    for (text, skip, line) in [
        (text.to_owned(), 0, 8),
        (text.replace('\n', "\r\n"), 0, 8),
        (text.replace("# it was lost\n", ""), 0, 7),
        (format!("camera;30 Hz;x;y\n\"take;\n{text}"), 2, 10),
    ] {
        std::fs::write(&csv, format!("\u{feff}{text}")).unwrap();
        let error =
            Table::read(&csv, skip).unwrap().states(&"time=t,yaw=y,pitch=0,roll=0".parse().unwrap()).unwrap_err();
        assert!(error.to_string().contains(&format!("line {line}: \"x\" for yaw")), "{error}");
    }
}

/// The tilt of a camera's frame does not turn with the body; the tilt of a mounting does.
#[test]
fn tilt_at_rest_that_may_be_of_the_frame_is_said() {
    let found = |yaw_deg: f64, tilt_deg: f64| {
        let folder = tempfile::tempdir().unwrap();
        let csv = folder.path().join("a.csv");
        let of = |roll: f64, pitch: f64, yaw: f64| {
            nalgebra::UnitQuaternion::from_euler_angles(roll.to_radians(), pitch.to_radians(), yaw.to_radians())
        };
        let row = |i: u32| {
            let time_s = 0.1 * f64::from(i);
            let share = ((time_s - 5.0) / 3.0).clamp(0.0, 1.0);
            let q = of(0.0, tilt_deg, 0.0) * of(2.0 * share, 4.0 * share, yaw_deg * share);
            format!("{time_s},{},{},{},{}\n", q.w, q.i, q.j, q.k)
        };
        std::fs::write(&csv, (0..400).map(row).collect::<String>()).unwrap();
        let states = Table::read(&csv, 0).unwrap().states(&"time=#1,qw=#2,qx=#3,qy=#4,qz=#5".parse().unwrap()).unwrap();
        let speeds = Some([37.7, -12.3].map(CentiRpm::from_rpm));
        let known = Conditions { uncertainty_deg: Some([0.5, 0.3]), speeds, run_s: Some(5.0..39.0), ..conditions() };
        let log = folder.path().join("a.mcap");
        write(&states, &known, "a.csv", &log).unwrap();
        let data = Judged::read(&log, Want::default()).unwrap().data;
        let findings = Judged::of(data.clone()).findings;
        findings.into_iter().map(|finding| finding.text).find(|text| text.contains("the tilt at rest"))
    };
    let said = found(-67.0, 3.0).unwrap();
    assert!(said.contains("pitch 3.0° and roll 0.0°") && said.ends_with("are -67.00°, 4.00° and 2.00°"), "{said}");
    assert_eq!([found(-67.0, 0.1), found(3.0, 3.0)], [None, None], "within the stated uncertainty");
}

/// Motors that need 3 s to stop are not in the run, and the numbers of the columns are names.
#[test]
fn the_run_ends_where_the_motors_slow_down() {
    let folder = tempfile::tempdir().unwrap();
    let csv = folder.path().join("numbered.csv");
    let row = |i: u32| {
        let time_s = 0.1 * f64::from(i) + 0.013;
        let share = ((time_s - 5.0) / 0.5).clamp(0.0, 1.0) * ((28.0 - time_s) / 3.0).clamp(0.0, 1.0);
        let noise = 1.0 + 0.02 * f64::from(i % 3) - 0.02;
        format!("{time_s},3.5,1,-0.5,{},{}\n", 43.3 * share * noise, -17.9 * share * noise)
    };
    std::fs::write(&csv, format!("0,1,2,3,4,5\n{}", (0..350).map(row).collect::<String>())).unwrap();
    let mapping: Mapping = "time=#1,yaw=#2,pitch=#3,roll=#4,w1=#5,w2=#6".parse().unwrap();
    let states = Table::read(&csv, 0).unwrap().states(&mapping).unwrap();
    assert_eq!((states.rows.len(), states.rows[0].time_s), (350, 0.013));
    let imported = write(&states, &conditions(), "numbered.csv", &folder.path().join("numbered.mcap")).unwrap();
    let [start, end] = [imported.run_s.start, imported.run_s.end];
    assert!((start - 5.0).abs() < 0.11 && (24.9..25.4).contains(&end), "{imported:?}");
    let [w1, w2] = imported.speeds.map(|speed| speed.rpm());
    assert!((w1 - 43.3).abs() < 0.1 && (w2 + 17.9).abs() < 0.1, "{imported:?}");
}

/// An instrument that loses the robot for a moment writes zeros; angles near zero are not affected.
#[test]
fn rows_of_zeros_beside_an_attitude_are_grave() {
    for (yaw_deg, lost, is_found) in [(2.0, 5, true), (2.0, 2, false), (0.2, 5, false)] {
        let folder = tempfile::tempdir().unwrap();
        let (csv, log) = (folder.path().join("a.csv"), folder.path().join("a.mcap"));
        let row = |i: u32| {
            let is_lost = i >= 150 && i < 150 + lost;
            let yaw = if is_lost { 0.0 } else { yaw_deg + 0.001 * f64::from(i % 7) };
            format!("{},{yaw},0,0,37.7,-12.3\n", 0.1 * f64::from(i))
        };
        std::fs::write(&csv, (0..300).map(row).collect::<String>()).unwrap();
        let mapping: Mapping = "time=#1,yaw=#2,pitch=#3,roll=#4,w1=#5,w2=#6".parse().unwrap();
        let states = Table::read(&csv, 0).unwrap().states(&mapping).unwrap();
        write(&states, &conditions(), "a.csv", &log).unwrap();
        let data = Judged::read(&log, Want::default()).unwrap().data;
        let found = Judged::of(data.clone()).findings;
        let says = |text: &str| found.iter().any(|finding| finding.grave && finding.text.contains(text));
        assert_eq!(says("exactly zero"), is_found, "yaw {yaw_deg}, {lost} lost: {found:?}");
    }
}

/// Noise of the speeds is not a motion, and a unit of turns per second is rejected.
#[test]
fn noisy_speeds_leave_the_rest_at_rest() {
    let folder = tempfile::tempdir().unwrap();
    let csv = folder.path().join("a.csv");
    let row = |i: u32| {
        let time_s = 0.04 * f64::from(i);
        let rpm = if (10.0..40.0).contains(&time_s) { 50.0 } else { 0.0 };
        let noise = 4.0 * ((f64::from(i) * 0.618_034).fract() - 0.5);
        format!("{time_s},{},1,2,{},{}\n", time_s.sin(), rpm + noise, 0.2 * rpm - noise)
    };
    std::fs::write(&csv, (0..1500).map(row).collect::<String>()).unwrap();
    let mapping: Mapping = "time=#1,yaw=#2,pitch=#3,roll=#4,w1=#5,w2=#6".parse().unwrap();
    let states = Table::read(&csv, 0).unwrap().states(&mapping).unwrap();
    let imported = write(&states, &conditions(), "a.csv", &folder.path().join("a.mcap")).unwrap();
    assert!((imported.run_s.start - 10.0).abs() < 0.3 && (imported.run_s.end - 40.0).abs() < 0.3, "{imported:?}");
    let rps: Mapping = "time=#1,yaw=#2,pitch=#3,roll=#4,w1=#5:rps,w2=#6:rps".parse().unwrap();
    let states = Table::read(&csv, 0).unwrap().states(&rps).unwrap();
    let error = write(&states, &conditions(), "a.csv", &folder.path().join("b.mcap")).unwrap_err();
    assert_eq!(error.to_string(), "a.csv: motor 1 turns faster than 90 rpm");
}

/// A run from 5 s to 25 s at -40°, the return to rest, and a slip of the instrument in the run.
#[test]
fn robot_hangs_upright_and_comes_back() {
    let slipped = |slip_deg: f64, time_s: f64| slip_deg * (time_s - 15.0).clamp(0.0, 1.0);
    let found = |roll_deg: f64, slips_deg: [f64; 2]| {
        let row = |time_s: f64| {
            let (run_s, after_s) = ((time_s - 5.0).clamp(0.0, 20.0), (time_s - 25.0).max(0.0));
            let yaw_deg = -40.0 * (1.0 - (-run_s / 3.0).exp()) * (-after_s / 10.0).exp();
            (yaw_deg + slipped(slips_deg[0], time_s), run_s * 37.7 / 60.0)
        };
        let roll_deg = |time_s: f64| roll_deg + slipped(slips_deg[1], time_s);
        let found = grave_with_roll(roll_deg, 0.1, row, Some(105.0..125.0));
        found.lines().filter(|line| !line.starts_with("not settled")).collect::<String>()
    };
    assert_eq!([found(0.0, [0.0; 2]), found(8.0, [0.0; 2]), found(0.0, [4.0, 1.0])], ["", "", ""]);
    for (slips_deg, said) in [([20.0, 0.0], "the yaw does not come back"), ([0.0, 4.0], "the roll does not come back")]
    {
        let slipped = found(0.0, slips_deg);
        assert!(slipped.contains(said) && slipped.contains("instrument has moved"), "{slipped}");
    }
    for (roll_deg, frame) in [
        (15.0, "tilted by 15.0"),
        (92.0, "axis of the body's frame points"),
        (179.0, "the z axis of the body's frame points down"),
    ] {
        let askew = found(roll_deg, [0.0; 2]);
        assert!(askew.contains(frame), "{roll_deg}: {askew}");
    }
}
