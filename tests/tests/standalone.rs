//! Programs that were copied out of the repository: they need neither it nor a compiler.

use host::run::rig::VirtualNano;
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use tests::{Bench, Run, program, repository};

/// Copies a program into a folder.
fn copy(name: &str, folder: &Path) {
    fs::create_dir_all(folder).unwrap();
    fs::copy(program(name), folder.join(name)).unwrap();
}

/// A bench whose folder `bin` has a copy of `biflag`, and whose folder `other` one of `vnano`.
fn bench() -> Bench {
    let bench = Bench::new();
    copy("biflag", &bench.path().join("bin"));
    copy("vnano", &bench.path().join("other"));
    bench
}

/// Runs the copy of `biflag`. Only the copy of `vnano` and avrdude are on its PATH.
fn run(bench: &Bench, arguments: &[&str]) -> Run {
    let tools = bench.path().join("tools");
    if !tools.exists() {
        fs::create_dir(&tools).unwrap();
        std::os::unix::fs::symlink("/usr/bin/avrdude", tools.join("avrdude")).unwrap();
    }
    let mut command = Command::new(bench.path().join("bin/biflag"));
    command.args(arguments).current_dir(bench.path()).stdin(Stdio::null());
    command.env("PATH", format!("{}:{}", bench.path().join("other").display(), tools.display()));
    command.env("XDG_CONFIG_HOME", bench.path().join("config"));
    Run::of(command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap())
}

/// A copy that knew the folder would use what lies there by then.
#[test]
fn no_program_knows_the_folder_that_it_was_built_in() {
    let folder = repository().as_os_str().as_encoded_bytes();
    for name in ["biflag", "vnano"] {
        let content = fs::read(program(name)).unwrap();
        assert!(!content.windows(folder.len()).any(|bytes| bytes == folder), "{name} contains {folder:?}");
    }
}

#[test]
fn a_copy_flashes_its_own_image() {
    let bench = bench();
    let nano = VirtualNano::start(&program("vnano"), ["--bootloader", "optiboot"]).unwrap();
    let flashed = run(&bench, &["flash", "--port", nano.port(), "--json"]).expect_code(0).json();
    assert_eq!((&flashed["baud"], &flashed["protocol"]), (&115_200.into(), &protocol::VERSION.into()));
    let checks = run(&bench, &["doctor", "--port", nano.port(), "--json"]).expect_code(3).json();
    let firmware = checks["checks"].as_array().unwrap().iter().find(|check| check["name"] == "firmware").unwrap();
    assert_eq!(firmware["detail"], format!("{}, inside biflag", flashed["firmware"].as_str().unwrap()));
}

#[test]
fn a_copy_records_and_simulates_plans_by_their_names() {
    let bench = bench();
    let plan = bench.file(
        "plan.toml",
        "[session]\nname = \"soft\"\nrobot = \"robot-soft.toml\"\n\
         [trial]\ncalibrate = 0\npreroll = 0\nrun = 2\ndecay = 0\n[speeds]\npairs = [[50, 10]]\n",
    );
    let recorded = run(&bench, &["record", plan.to_str().unwrap(), "--virtual", "--json"]).expect_code(3).json();
    assert_eq!(recorded["trials"][0]["complete"], true, "{recorded}");
    // Where no trial is left, no board is started.
    fs::rename(bench.path().join("other"), bench.path().join("away")).unwrap();
    let resumed = run(&bench, &["record", plan.to_str().unwrap(), "--virtual", "--resume"]).expect_code(3);
    assert!(resumed.stdout.contains("nothing left to do: 1 trial complete"), "{resumed:?}");
    fs::rename(bench.path().join("away"), bench.path().join("other")).unwrap();
    let points = run(&bench, &["simulate", "published-points", "--json"]).expect_code(0).json();
    assert_eq!(points["trials"].as_array().unwrap().len(), 4);
    run(&bench, &["simulate", "soft.toml"]).expect_code(2);
}

#[test]
fn a_missing_emulated_board_is_named_with_its_fix() {
    let bench = bench();
    fs::remove_dir_all(bench.path().join("other")).unwrap();
    let plan = bench.short_plan(1.0, [0.0, 0.0]);
    let run = run(&bench, &["record", plan.to_str().unwrap(), "--virtual"]).expect_code(1);
    assert!(run.stderr.contains("vnano on the PATH") && run.stderr.contains("copy vnano beside biflag"), "{run:?}");
}

#[test]
fn a_file_comes_before_the_plan_of_its_name() {
    let bench = bench();
    bench.file("demo.toml", "[speeds]\npairs = [[1, 2], [3, 4], [5, 6]]\n[trial]\nrun = 1\n");
    let count = |plan: &str, trials: usize| {
        let session = run(&bench, &["simulate", plan, "--out", &format!("out-{plan}"), "--json"]).json();
        assert_eq!(session["trials"].as_array().unwrap().len(), trials, "{session}");
    };
    count("demo.toml", 3);
    count("demo", 2);
}

#[test]
fn plans_completions_and_manual_pages_are_inside() {
    let bench = bench();
    let listed = run(&bench, &["plans", "--json"]).expect_code(0).json();
    let names = |list: &Value| -> Vec<String> {
        list.as_array().unwrap().iter().map(|file| file["name"].as_str().unwrap().to_owned()).collect()
    };
    assert!(names(&listed["plans"]).contains(&"published-points".to_owned()), "{listed}");
    assert!(names(&listed["robots"]).contains(&"robot-tank".to_owned()), "{listed}");
    let printed = run(&bench, &["plans", "demo"]).expect_code(0).stdout;
    assert_eq!(printed.trim(), include_str!("../../host/plans/demo.toml").trim());
    run(&bench, &["plans", "no-such-plan"]).expect_code(2);
    for shell in ["bash", "zsh", "fish"] {
        let script = run(&bench, &["completions", shell]).expect_code(0).stdout;
        assert!(script.contains("calibrate") && script.contains("virtual"), "{shell}: {script}");
    }
    run(&bench, &["man", "man"]).expect_code(0);
    let page = fs::read_to_string(bench.path().join("man/biflag-record.1")).unwrap();
    assert!(page.contains("biflag\\-record") && page.contains("virtual"), "{page}");
    let version = run(&bench, &["--version"]).expect_code(0).stdout;
    assert_eq!(version.trim(), format!("biflag {}", host::program::FULL_VERSION));
}

/// Colour is for terminals: `script` gives the program one.
#[test]
fn a_terminal_gets_colour_and_a_file_none() {
    let bench = bench();
    assert!(!run(&bench, &["info", "nothing"]).expect_code(2).stderr.contains('\x1b'));
    let terminal = |environment: &str| {
        let command = format!("{} {}/bin/biflag info nothing", environment, bench.path().display());
        let output =
            Command::new("script").args(["-qec", &command, "/dev/null"]).env("TERM", "xterm").output().unwrap();
        String::from_utf8(output.stdout).unwrap()
    };
    assert!(terminal("").contains("\x1b[31merror:\x1b[0m"), "{:?}", terminal(""));
    assert!(!terminal("NO_COLOR=1").contains('\x1b'));
}
