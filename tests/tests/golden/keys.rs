//! Keys of `--json` and of the data of pages.

use super::{columns, recording};
use serde_json::Value;
use std::fmt::Write;
use std::path::Path;
use std::time::Instant;
use tests::golden::{Keys, hold};
use tests::{Bench, data};

const PLAN: &str = "[session]\nname = \"golden\"\nrepeats = 2\n[board]\ndeadline_ms = 5000\n[trial]\ncalibrate = 2\npreroll = 12\nrun = 12\ndecay = 12\n\
                    [speeds]\npairs = [[50, 10]]\n";

/// Four points, of which two are impossible.
const SWEEP: &str = "[session]\nname = \"sweep\"\n[trial]\nrun = 40\nmethod = \"steady\"\nphases = 2\n[vary]\n\
                     \"group.spacing\" = [1, 0.4]\n[speeds]\npairs = [[50, 10], [30, 30]]\n";

/// What is asked: the golden file, what it is about, and the arguments; `LOG` and `MODEL` are logs of the same trial.
const ASKED: &[(&str, &str, &str)] = &[
    ("simulate", "the robot `physical`", "simulate --speeds 50,10 --duration 26 --rate 5 --shapes --out physical"),
    (
        "simulate",
        "the robot `published`",
        "simulate --speeds 50,10 --duration 12 --rate 5 --robot published --out published",
    ),
    ("simulate", "--method steady", "simulate --speeds 50,10 --duration 60 --method steady --out steady"),
    ("simulate", "--from", "simulate --from LOG --rate 5 --out from"),
    ("sweep", "sweep", "sweep sweep.toml --out sweep"),
    ("sweep", "status", "sweep status sweep --failed"),
    ("sweep", "merge", "sweep merge sweep"),
    ("aim", "aim", "aim --yaw=-67 --pitch=-4 -o aimed.toml"),
    ("compare", "a log with a model's", "compare LOG MODEL --out compare.html"),
    ("info", "a recording", "info LOG"),
    ("info", "a model's log", "info MODEL"),
    ("info", "a model's steady state", "info steady/001_w1+50_w2+10.mcap"),
    ("info", "a log of format 1", "info format1.mcap"),
    ("info", "a session", "info recorded"),
    ("info", "a model's session", "info model"),
    ("export", "a log", "export LOG -o log.csv"),
    ("export", "a log as Parquet", "export LOG --format parquet -o log.parquet"),
    ("export", "a model's log", "export MODEL -o model.csv"),
    ("export", "a session", "export recorded -o tables"),
    ("export", "a session as Parquet", "export recorded --format parquet -o parquet"),
    (
        "import",
        "a table",
        "import camera.csv --columns time=time_s,yaw=yaw_deg,pitch=pitch_deg,roll=roll_deg,turns1=turns1,turns2=turns2 \
      --uncertainty 0.3,0.1 -o camera.mcap",
    ),
    (
        "import",
        "beside a recording",
        "import camera.csv --columns time=time_s,yaw=yaw_deg,pitch=0,roll=0 --trial LOG \
      --uncertainty 0.3,0.1 -o beside.mcap",
    ),
    ("info", "an import", "info camera.mcap"),
    ("export", "an import", "export camera.mcap -o imported.csv"),
    ("report", "a recording", "report LOG --out log.html"),
    ("report", "a model's log with shapes", "report physical/001_w1+50_w2+10.mcap --out physical.html"),
    ("report", "a session", "report recorded --out recorded.html"),
    ("report", "a sweep", "report sweep --out sweep.html"),
    ("figure", "figure", "figure trial LOG -o trial.svg"),
    ("film", "film", "film LOG -o film.gif --time 1,2 --width 120"),
    ("pack", "pack", "pack steady -o steady.zip"),
    ("doctor", "a session", "doctor recorded"),
    ("recover", "a whole log", "recover LOG"),
    ("recover", "a log that is cut off", "recover cut.mcap"),
    ("recover", "a session", "recover recorded"),
    ("plan", "check", "plan check golden.toml"),
    ("plan", "new", "new new.toml"),
    ("plan", "plans", "plans"),
    ("plan", "record --dry-run", "record golden.toml --dry-run"),
    ("resistance", "resistance", "resistance"),
    ("settings", "settings", "settings --virtual"),
    ("wrong-use", "a missing log", "info none.mcap"),
];

/// The pages, and what each is about.
const PAGES: [(&str, &str); 5] = [
    ("log.html", "a recording"),
    ("physical.html", "a model's log with shapes"),
    ("recorded.html", "a session"),
    ("compare.html", "a comparison"),
    ("sweep.html", "a sweep"),
];

/// The log of the first trial, without its ending.
const LOG: &str = "001_w1+50_w2+10_r1";

#[test]
fn keys_and_columns_are_the_golden_ones() {
    let bench = Bench::new();
    recording::sessions(&bench, PLAN, "model", "recorded");
    bench.file("golden.toml", PLAN);
    bench.file("sweep.toml", SWEEP);
    let path = |name: &str| bench.path().join(name);
    std::fs::copy(data("format1/recorded.mcap"), path("format1.mcap")).unwrap();
    let log = std::fs::read(path(&format!("recorded/{LOG}.mcap"))).unwrap();
    std::fs::write(path("cut.mcap"), &log[..log.len() * 2 / 3]).unwrap();

    let mut texts: Vec<(&str, String)> = Vec::new();
    for (file, about, arguments) in ASKED {
        if *file == "import" {
            camera(&bench);
        }
        let words = arguments.split_whitespace().map(|word| match word {
            "LOG" => format!("recorded/{LOG}.mcap"),
            "MODEL" => format!("model/{LOG}.mcap"),
            word => word.to_owned(),
        });
        let begun = Instant::now();
        let run = bench.run(words.chain(["--json".to_owned()]));
        println!("{:.2} s: biflag {arguments}", begun.elapsed().as_secs_f64());
        let expected: &[i32] = if *file == "wrong-use" { &[2] } else { &[0, 3] };
        assert!(run.code.is_some_and(|code| expected.contains(&code)), "biflag {arguments}: {run:?}");
        let at = texts.iter().position(|(of, _)| of == file).unwrap_or(texts.len());
        if at == texts.len() {
            texts.push((file, String::new()));
        }
        let _ = write!(texts[at].1, "# {about}\n{}\n", Keys::of(&run.json()));
    }
    let mut pages = String::new();
    for (page, about) in PAGES {
        let _ = write!(pages, "# {about}\n{}\n", keys_of_page(&path(page)));
    }
    columns::check(&bench);
    hold("pages", &pages);
    texts.iter().for_each(|(file, text)| hold(&format!("json/{file}"), text));
}

/// Writes the table of a camera that saw the first trial.
fn camera(bench: &Bench) {
    let export = std::fs::read_to_string(bench.path().join("model.csv")).unwrap();
    let rows: Vec<&str> = export.lines().filter(|line| !line.starts_with('#')).step_by(4).collect();
    bench.file("camera.csv", &rows.join("\n"));
}

/// Returns the keys of all data of a page; the sections of a session's trials are alike.
fn keys_of_page(page: &Path) -> String {
    let text = std::fs::read_to_string(page).unwrap();
    let mut all: Vec<(String, Keys)> = Vec::new();
    for script in text.split("<script type=\"application/json\" id=\"").skip(1) {
        let (id, rest) = script.split_once('"').unwrap();
        let json = rest.split_once('>').unwrap().1.split_once("</script>").unwrap().0;
        let json: Value = serde_json::from_str(json).unwrap();
        let id: String = id.chars().filter(|c| !c.is_ascii_digit()).collect();
        let at = all.iter().position(|(of, _)| *of == id).unwrap_or(all.len());
        if at == all.len() {
            all.push((id, Keys::default()));
        }
        all[at].1.add(&json);
    }
    all.iter().map(|(id, keys)| format!("## {id}\n{keys}")).collect()
}
