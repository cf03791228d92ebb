//! `biflag doctor --motors`: the self-test of motors and encoders, and the settings that follow from it.

use super::check::{Check, answer, check};
use super::{Args, board};
use crate::colour;
use crate::commands::answer::{Answer, Outcome};
use crate::commands::ask::ask;
use crate::commands::{settings, virtual_board};
use crate::link::{Link, LinkError};
use crate::plan::line::{LinePoint, Lines};
use crate::plan::{BoardSettings, PUBLISHED};
use crate::run::rig::board_copy::BoardCopies;
use crate::run::rig::self_test::{self, Board, Drive, Finding, MotorTest};
use crate::run::rig::{self, GLITCHES_ALLOWED, RecordError, fault_cure, fault_text, preflight};
use crate::signals::interruption;
use protocol::{Bridge, Command, MAX_DRIVE_MS, Settings, SpeedFrom};
use serde_json::json;
use std::io::IsTerminal;
use std::sync::atomic::AtomicBool;

/// Speed at full duty below which a motor cannot be relied on for the fastest trials, rpm.
const FASTEST_TRIAL_RPM: f64 = 90.0;

/// Largest difference of the moving duty that is not saved.
const SAME_DUTY: u8 = 20;

/// Duty at which the user watches a flagellum, unless it needs more to move.
const SHOWN_DUTY: u8 = 150;

/// The bridge's terminals, and the Nano's pins, of motors 1 and 2.
const MOTOR_LEADS: [&str; 2] = ["AO1 and AO2", "BO1 and BO2"];
const EDGE_PINS: [&str; 2] = ["D3", "D2"];
const DIRECTION_PINS: [&str; 2] = ["D5", "D4"];
const WAY_PINS: [[&str; 2]; 2] = [["AIN1 (D8)", "AIN2 (D7)"], ["BIN1 (D10)", "BIN2 (D12)"]];

pub(super) fn run(args: &Args) -> miette::Result<Answer> {
    if let Some(answer) = virtual_board::help(&args.faults, None) {
        return answer;
    }
    let interrupted = interruption()?;
    let arguments = ["--speed", "max", "--robot", PUBLISHED, "--rig", &args.rig].map(Into::into).into();
    let nano = args.r#virtual.then(|| virtual_board::start(arguments, &args.faults)).transpose()?;
    let port = virtual_board::port(nano.as_ref(), args.port.as_deref())?;
    // The EEPROM of the emulated board is blank at each start, so there is nothing to keep of it.
    let copies = if nano.is_some() { None } else { BoardCopies::of_user() };
    match test(args, &port, copies.as_ref(), &interrupted) {
        Err(RecordError::Interrupted) | Err(RecordError::Link(LinkError::Interrupted)) => {
            Answer::new(Outcome::Interrupted, &json!({ "checks": [] }), "interrupted")
        }
        Err(RecordError::Faulted(fault)) => {
            Err(miette::miette!(help = fault_cure(fault), "the board stopped the test: {}", fault_text(fault)))
        }
        // The advice of a trial, to continue with --resume, is not for this test.
        Err(RecordError::Preflight(error)) => Err(error.into()),
        Err(error) => Err(error.into()),
        Ok(checks) => answer(checks, Outcome::WithLoss),
    }
}

fn test(
    args: &Args,
    port: &str,
    copies: Option<&BoardCopies>,
    interrupted: &AtomicBool,
) -> Result<Vec<Check>, RecordError> {
    let link = Link::open_unless(port, interrupted)?;
    link.command(Command::Stop)?;
    let is_new = !link.info().settings_stored;
    // A board that has lost its settings must get them back; a computer without copies sees its first board.
    if is_new && copies.is_some_and(|copies| !copies.ids().is_empty()) {
        preflight::settings(&link, copies)?;
    }
    let mut checks: Vec<Check> = board::checks(&link, copies).into();
    let settings = settings::read(&link)?;
    if is_new || settings.board_id == 0 {
        // This test does what the board's check asks for.
        checks.remove(1);
    }
    preflight::supply(&link, interrupted)?;
    let mut board = Board { link: &link, interrupted };
    if let Some(motor) = self_test::turns_at_idle(&mut board, &settings)? {
        checks.push(wrong_bridge(motor, settings.bridge));
        return Ok(checks);
    }
    if settings.speed_from == SpeedFrom::Duty {
        checks.extend(lines(args, &board, copies, settings)?);
        return Ok(checks);
    }
    let mut tests = self_test::run(&mut board, &settings, |what| colour::eprint(&format!("{what}\n")))?;
    let mut wanted = settings;
    let mut assumed = false;
    for (motor, test) in tests.iter_mut().enumerate() {
        let seen = match args.yes || !test.finding.is_usable() {
            true => None,
            false => match watch(&mut board, motor, test) {
                // The results so far are reported.
                Err(RecordError::Faulted(fault)) => {
                    test.finding = Finding::Faulted(fault);
                    None
                }
                seen => seen?,
            },
        };
        assumed |= test.finding.is_usable() && seen.is_none();
        wanted = self_test::correction(wanted, motor, test.finding, seen);
        if let Some(duty) = test.moving_setting()
            && duty.abs_diff(wanted.moving_duty[motor]) > SAME_DUTY
        {
            wanted.moving_duty[motor] = duty;
        }
    }
    checks.extend(judgements(&tests));
    if assumed {
        let detail = "not tested: the program assumes that, seen from above, a positive speed turns the flagellum \
                      counter-clockwise; check this once by eye, or run this test in a terminal";
        checks.push(check("direction".into(), Ok(detail.into())));
    }
    if tests.iter().all(|test| test.finding.is_usable()) {
        checks.extend(save(args, &board, copies, (settings, wanted))?);
    }
    Ok(checks)
}

/// Returns the check of a bridge with a motor that turns where none may.
fn wrong_bridge(motor: usize, set: Bridge) -> Check {
    let [set, other] = match set {
        Bridge::Enable => ["enable", "in-in"],
        Bridge::InIn => ["in-in", "enable"],
    };
    let detail = format!("motor {} turns at a duty of {} of 255, at which none may", motor + 1, self_test::IDLE_DUTY);
    let cure = format!(
        "the board is set to bridge = \"{set}\": if its bridge is of the other kind, write bridge = \"{other}\" with `biflag \
         settings --write`; otherwise check the wires of its inputs"
    );
    check("bridge".into(), Err((detail, cure)))
}

/// Measures the lines of motors without encoders, and saves them and the resulting settings.
fn lines(
    args: &Args,
    board: &Board,
    copies: Option<&BoardCopies>,
    settings: Settings,
) -> Result<Vec<Check>, RecordError> {
    let measured = rig::lines::measure(board.link, board.interrupted, |what| colour::eprint(&format!("{what}\n")))?;
    let wanted = measured.corrected(settings);
    let lines = Lines { wiring: Lines::wiring_of(&wanted), ..measured.lines };
    let mut checks = Vec::new();
    for (motor, line) in lines.motor.iter().enumerate() {
        let half = |points: &[LinePoint]| {
            let all = points.iter().map(|point| format!("{:.1} at {}", point.speed_rpm, point.duty));
            all.collect::<Vec<_>>().join(", ")
        };
        let [forwards, backwards] = [&line.forwards, &line.backwards].map(|points| half(points));
        let detail = format!("turns at {line}; rpm at a duty, forwards: {forwards}; backwards: {backwards}");
        checks.push(check(format!("motor {}", motor + 1), Ok(detail)));
    }
    checks.extend(save(args, board, copies, (settings, wanted))?);
    let board_id = settings::read(board.link)?.board_id;
    // Any board without an id would use them.
    if let Some(copies) = copies.filter(|_| board_id != 0) {
        let kept = copies.keep_lines(board_id, &lines).map_err(|error| {
            (format!("not kept: {error}"), "make room for the user's settings, then test again".to_owned())
        });
        checks.push(check("lines".into(), kept.map(|()| format!("kept for board {board_id}"))));
    }
    Ok(checks)
}

/// Returns the checks of motors, encoders and their supply.
fn judgements(tests: &[MotorTest; 2]) -> Vec<Check> {
    if tests.iter().all(|test| test.finding == Finding::Still) {
        let detail = "neither motor moves, at any duty, and the board's own supply is good";
        let cure = "switch on the motors' 6 V supply; check it at VM, and STBY on D9";
        return vec![check("motor supply".into(), Err((detail.into(), cure.into())))];
    }
    if tests.iter().all(|test| test.finding == Finding::OtherEncoder) {
        let detail = "driving motor 1 moves encoder 2, and driving motor 2 moves encoder 1";
        let cure = "if driving motor 1 turns flagellum 2, swap the motors' leads (AO1 and AO2 with BO1 and BO2); \
                    otherwise swap the encoders' leads (C1 and C2 of one with those of the other)";
        return vec![check("motors".into(), Err((detail.into(), cure.into())))];
    }
    let glitches: u64 = tests.iter().map(|test| u64::from(test.glitches)).sum();
    let mut checks: Vec<_> = tests
        .iter()
        .enumerate()
        .map(|(motor, test)| check(format!("motor {}", motor + 1), judge(motor, test)))
        .collect();
    let detail = format!("{glitches} edges that are not motion");
    let cure = "keep the encoders' leads away from the motors' leads, and check the encoders' ground and supply";
    let noise = if glitches <= GLITCHES_ALLOWED { Ok(detail) } else { Err((detail, cure.into())) };
    checks.push(check("encoder noise".into(), noise));
    checks
}

fn judge(motor: usize, test: &MotorTest) -> super::check::Finding {
    let number = motor + 1;
    let wrong = |detail: &str, cure: String| Err((detail.to_owned(), cure));
    let (leads, edges, direction) = (MOTOR_LEADS[motor], EDGE_PINS[motor], DIRECTION_PINS[motor]);
    let [one, other] = WAY_PINS[motor];
    let [forwards, backwards] = test.full_rpm;
    let speeds = format!("{forwards:.0} rpm forwards and {backwards:.0} rpm backwards at full duty");
    match test.finding {
        Finding::Agrees | Finding::Opposes if forwards.min(backwards) < FASTEST_TRIAL_RPM => Err((
            format!("only {speeds}"),
            "trials at 90 rpm are not possible: check the motors' 6 V supply, and what brakes the flagellum".into(),
        )),
        Finding::Agrees | Finding::Opposes => {
            let counts = if test.finding == Finding::Agrees { "" } else { "; the encoder counts against the duty" };
            let moving = test.moving_duty.iter().flatten().max().copied().unwrap_or_default();
            Ok(format!("turns from a duty of {moving} of 255 on, {speeds}{counts}"))
        }
        Finding::OneWay { forwards } => {
            let pin = if forwards { other } else { one };
            wrong("it turns in one direction only", format!("check the wire of {pin}"))
        }
        Finding::SameWay => {
            wrong("it turns in one direction whatever the duty", format!("check the wires of {one} and {other}"))
        }
        Finding::DirectionDead => wrong(
            "its encoder counts back and forth: channel C2 does not change",
            format!("check the wire from the encoder's C2 to {direction}"),
        ),
        Finding::OtherEncoder => wrong(
            &format!("driving it moves encoder {} instead of encoder {number}", 2 - motor),
            format!("check that {leads} lead to motor {number}, and C1 of its encoder to {edges}"),
        ),
        Finding::BothEncoders => wrong(
            "driving it moves both encoders",
            "check the encoders' leads for contact with each other and with the motors' leads".into(),
        ),
        Finding::EdgesDead => wrong(
            "it turns, as the gyroscope shows, but its encoder has no edges: channel C1 is dead",
            format!(
                "check the encoder's supply, and the wire from its C1 to {edges}; if it has no encoder, write speed_from = \
                 \"duty\" with `biflag settings --write`"
            ),
        ),
        Finding::Still => wrong(
            "no edge of its encoder at any duty",
            format!(
                "if the flagellum turned, check the encoder's supply and the wire from its C1 to {edges}; otherwise check \
                 {leads} and that nothing holds it"
            ),
        ),
        Finding::Faulted(fault) if self_test::motor_of(fault) == Some(motor) => {
            wrong(fault_text(fault), fault_cure(fault).into())
        }
        Finding::Faulted(fault) => {
            wrong(&format!("not tested to the end: {}", fault_text(fault)), fault_cure(fault).into())
        }
    }
}

/// Turns a motor for the user to watch. Returns whether its flagellum turned counter-clockwise; `None` if nobody watches.
fn watch(board: &mut Board, motor: usize, test: &MotorTest) -> Result<Option<bool>, RecordError> {
    if !is_interactive() {
        return Ok(None);
    }
    let duty = test.moving_setting().unwrap_or(SHOWN_DUTY).max(SHOWN_DUTY);
    loop {
        colour::eprint(&format!("Watch flagellum {} from above: it turns for two seconds.\n", motor + 1));
        board.drive(motor, duty.into(), MAX_DRIVE_MS)?;
        match ask("Did it turn counter-clockwise? y, n, or r to see it again", board.interrupted)?.as_str() {
            "y" | "yes" => return Ok(Some(true)),
            "n" | "no" => return Ok(Some(false)),
            _ => {}
        }
    }
}

/// Saves the settings that the test found, if there is anything to save and the user agrees.
fn save(
    args: &Args,
    board: &Board,
    copies: Option<&BoardCopies>,
    (before, wanted): (Settings, Settings),
) -> Result<Option<Check>, RecordError> {
    let changes = changes(&before, &wanted);
    let is_named = before.board_id != 0 || copies.is_none();
    if changes.is_empty() && board.link.info().settings_stored && is_named {
        return Ok(None);
    }
    let what = match changes.as_slice() {
        [] => "the settings in force".to_owned(),
        changes => changes.join(", "),
    };
    let agreed = args.yes
        || is_interactive()
            && matches!(ask(&format!("Save {what} to the board? y or n"), board.interrupted)?.as_str(), "y" | "yes");
    let name = || "settings".to_owned();
    if !agreed {
        let detail = format!("not saved: {what}");
        let cure = format!("`biflag doctor --motors --yes --port {}` tests again and saves them", board.link.path());
        return Ok(Some(check(name(), Err((detail, cure)))));
    }
    let (_, notes) = settings::save(board.link, wanted, copies)?;
    let notes: String = notes.iter().map(|note| format!("; {note}")).collect();
    Ok(Some(check(name(), Ok(format!("saved {what}{notes}")))))
}

/// Returns the settings that differ, as lines of a settings file.
fn changes(before: &Settings, wanted: &Settings) -> Vec<String> {
    let lines = |settings| BoardSettings::all(settings).to_toml().lines().map(str::to_owned).collect::<Vec<_>>();
    let before = lines(before);
    lines(wanted).into_iter().filter(|line| !before.contains(line)).collect()
}

fn is_interactive() -> bool {
    std::io::stdin().is_terminal() && std::io::stderr().is_terminal()
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol::Fault;

    fn tests(findings: [Finding; 2]) -> [MotorTest; 2] {
        findings.map(|finding| MotorTest {
            finding,
            moving_duty: [Some(20), Some(30)],
            full_rpm: [130.0, 128.0],
            glitches: 0,
        })
    }

    #[test]
    fn a_common_cause_is_one_problem() {
        for (finding, name) in [(Finding::Still, "motor supply"), (Finding::OtherEncoder, "motors")] {
            let checks = judgements(&tests([finding; 2]));
            assert_eq!((checks.len(), checks[0].name.as_str(), checks[0].ok), (1, name, false));
        }
    }

    #[test]
    fn each_finding_names_the_wire_of_its_motor() {
        let cure = |motor: usize, finding| judge(motor, &tests([finding; 2])[motor]).unwrap_err().1;
        assert!(cure(0, Finding::DirectionDead).ends_with("C2 to D5"));
        assert!(cure(1, Finding::DirectionDead).ends_with("C2 to D4"));
        assert!(cure(1, Finding::EdgesDead).contains("C1 to D2; if it has no encoder"));
        assert_eq!(cure(0, Finding::OneWay { forwards: true }), "check the wire of AIN2 (D7)");
        assert!(cure(1, Finding::Still).contains("BO1 and BO2"));
        let good = judge(0, &tests([Finding::Agrees; 2])[0]).unwrap();
        assert_eq!(good, "turns from a duty of 30 of 255 on, 130 rpm forwards and 128 rpm backwards at full duty");
        let slow = MotorTest { full_rpm: [130.0, 60.0], ..tests([Finding::Agrees; 2])[0] };
        assert!(judge(0, &slow).unwrap_err().0.starts_with("only 130 rpm forwards and 60"));
        let of_the_other = judge(0, &tests([Finding::Faulted(Fault::Encoder2Noisy); 2])[0]).unwrap_err();
        assert!(of_the_other.0.starts_with("not tested to the end: encoder 2 has more edges"), "{of_the_other:?}");
        let own = judge(1, &tests([Finding::Faulted(Fault::Encoder2Noisy); 2])[1]).unwrap_err();
        assert!(own.0.starts_with("encoder 2 has more edges"), "{own:?}");
        let noisy = MotorTest { glitches: 11, ..tests([Finding::Agrees; 2])[0] };
        assert!(judgements(&[noisy; 2]).iter().any(|check| check.name == "encoder noise" && !check.ok));
    }

    #[test]
    fn changed_settings_are_named_as_in_their_file() {
        let wanted = Settings { encoder_reversed: [false, true], moving_duty: [40, 100], ..Settings::DEFAULT };
        let changes = changes(&Settings::DEFAULT, &wanted);
        assert_eq!(changes, ["encoder_reversed = [false, true]", "moving_duty = [40, 100]"]);
    }
}
