//! Tests the pages of `biflag report` in a browser: opened from disk, played, read, on a phone, and printed.
//! Screenshots are in `target/report-pictures`.

mod comparison;
mod table;

use biflag_log::{
    Body, EventKind, Message, ModelMeta, Origin, PlanMeta, Reader, Summary, TrialClock, TrialMeta, Writer,
};
use host::plan::Plan;
use host::run;
use host::session::Session;
use serde_json::json;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant, SystemTime};
use tests::browser::Browser;
use tests::{Bench, Run, memory_kb, wait_until};

fn picture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).with_file_name("target").join("report-pictures").join(name)
}

/// Writes the page of a log or a session and returns its path.
fn report(bench: &Bench, subject: &str, code: i32) -> PathBuf {
    let answer = bench.run(["report", subject, "--json"]).expect_code(code).json();
    bench.path().join(answer["html"].as_str().unwrap())
}

/// Sets the time by the slider.
fn scrub(browser: &mut Browser, time_s: f64) {
    browser.evaluate(&format!(
        "(() => {{ const s = document.querySelector('section:not([hidden]) .scrub'); s.value = {time_s}; \
         s.dispatchEvent(new Event('input', {{ bubbles: true }})); }})()"
    ));
}

/// Returns the pixels of the view of the robot as text.
fn view(browser: &mut Browser) -> String {
    let pixels = browser.evaluate("document.querySelector('section:not([hidden]) .scene canvas').toDataURL()");
    pixels.as_str().unwrap().to_owned()
}

/// Prints the page and returns the text of the PDF.
fn printed(browser: &mut Browser, name: &str) -> String {
    let pdf = picture(name);
    browser.print(&pdf);
    let text = Command::new("pdftotext").arg("-layout").arg(&pdf).arg("-").output().unwrap();
    String::from_utf8_lossy(&text.stdout).into_owned()
}

fn is_quiet(browser: &Browser, page: &Path) {
    assert!(browser.problems.is_empty(), "{:#?}", browser.problems);
    let address = format!("file://{}", page.display());
    // A link within the page adds its anchor, and a chart becomes a picture through a file that the page has made.
    let own = |request: &str| request.split('#').next() == Some(&address) || request.starts_with("blob:");
    let foreign = browser.requests.iter().filter(|request| !own(request));
    assert_eq!(foreign.count(), 0, "{:?}", browser.requests);
}

#[test]
fn trial_page_shows_the_values_of_the_log() {
    let bench = Bench::new();
    bench.run(["simulate", "--speeds=50,10", "--duration", "30", "--shapes", "--rate", "50", "--out", "s"]);
    let log = bench.path().join("s/001_w1+50_w2+10.mcap");
    let page = report(&bench, "s/001_w1+50_w2+10.mcap", 3);
    assert!(page.metadata().unwrap().len() < 10_000_000);

    let mut browser = Browser::start();
    browser.window(1280, 900, false);
    let took = browser.open(&page);
    println!("a trial of {} kB: opened in {} ms", page.metadata().unwrap().len() / 1000, took.as_millis());
    assert_eq!(browser.text("h1"), "001_w1+50_w2+10 at (50, 10) rpm");
    is_quiet(&browser, &page);
    browser.picture(&picture("trial-light.png"));

    // The values beside the robot are those of the log.
    let mut samples = Vec::new();
    for message in Reader::open(&log).unwrap() {
        if let Body::Telemetry(telemetry) = message.unwrap().body {
            samples.push(telemetry);
        }
    }
    assert!(samples.len() > 1000);
    let zero = 0.0;
    for sample in samples.iter().step_by(97) {
        scrub(&mut browser, sample.time_s);
        assert!((browser.number("[data-out^=time]").unwrap() - sample.time_s).abs() < 0.006);
        // The slider has steps of 0.01 s.
        for (name, value) in [("yaw", sample.yaw_deg - zero), ("pitch", sample.pitch_deg), ("roll", sample.roll_deg)] {
            let shown = browser.number(&format!("[data-out='attitude {name} 2']")).unwrap();
            assert!((shown - value).abs() < 0.02, "{name} at {} s: {shown}, not {value}", sample.time_s);
        }
        let motor = sample.motor1.as_ref().unwrap();
        assert!((browser.number("[data-out='motors speed1 1']").unwrap() - motor.speed_rpm).abs() < 0.06);
    }
    let steady: biflag_log::SteadyMeta = biflag_log::last_meta(&log).unwrap().unwrap();
    assert!((browser.number(".tile .big").unwrap() - steady.values.angles_deg()[0]).abs() < 0.006);

    // The button starts the playback: the time advances and the flagella turn. A key stops it.
    scrub(&mut browser, 5.0);
    let before = view(&mut browser);
    browser.click(".play");
    wait_until("the time advances", || browser.number("[data-out^=time]").unwrap() > 5.1);
    let rate = browser.evaluate(
        "new Promise((done) => { let frames = 0; const end = performance.now() + 1000; const count = () => { frames += 1; \
         if (performance.now() < end) requestAnimationFrame(count); else done(frames); }; count(); })",
    );
    println!("played at {rate} frames a second, drawn without a graphics card");
    // What limits that rate: the page's own work, or the pixels that a processor draws in place of a graphics card.
    let costs = browser.evaluate(
        "(() => { const Renderer = biflag.Renderer.prototype; const draw = Renderer.draw; const scene = biflag.Scene.prototype.draw; \
         const spent = { scene: 0, pixels: 0 }; let frames = 0; \
         Renderer.draw = function (...all) { const begun = performance.now(); const picture = draw.apply(this, all); \
         spent.pixels += performance.now() - begun; return picture; }; \
         biflag.Scene.prototype.draw = function (time) { const begun = performance.now(); scene.call(this, time); \
         spent.scene += performance.now() - begun; frames += 1; }; \
         return new Promise((done) => setTimeout(() => { Renderer.draw = draw; biflag.Scene.prototype.draw = scene; \
         done([spent.scene / frames, spent.pixels / frames]); }, 1000)); })()",
    );
    let [all_ms, pixels_ms] = [0, 1].map(|i| costs[i].as_f64().expect("frames were drawn"));
    println!("a frame takes {all_ms:.1} ms, {pixels_ms:.1} ms of them for the pixels");
    assert!(view(&mut browser) != before);
    browser.evaluate("document.querySelector('.scene canvas').focus()");
    browser.key(" ", 32);
    let stopped = browser.number("[data-out^=time]").unwrap();
    std::thread::sleep(Duration::from_millis(200));
    assert_eq!(browser.number("[data-out^=time]").unwrap(), stopped);

    // The view is rotated with keys and the mouse, and reset.
    let front = view(&mut browser);
    browser.key("ArrowLeft", 37);
    let turned = view(&mut browser);
    assert!(turned != front);
    let [x, y] = browser.middle(".scene canvas");
    browser.drag([x, y], [x + 80.0, y - 40.0]);
    assert!(view(&mut browser) != turned);
    browser.key("Home", 36);
    assert!(view(&mut browser) == front);

    // The slider is moved with keys.
    browser.evaluate("document.querySelector('.scrub').focus()");
    browser.key("End", 35);
    assert!((browser.number("[data-out^=time]").unwrap() - 30.0).abs() < 0.02);

    // The values under the pointer, and zooming by dragging across a chart.
    browser.hover("[data-chart=pitch] .u-over");
    let tooltip = browser.text("[data-chart=pitch] .tooltip");
    assert!(tooltip.contains(" smodel ") && !tooltip.contains('–'), "{tooltip}");
    let [x, y] = browser.middle("[data-chart=pitch] .u-over");
    browser.drag([x - 60.0, y], [x + 60.0, y]);
    browser.picture(&picture("trial-zoomed.png"));
    browser.click(".zoom-all");

    assert_eq!(browser.inaccessible(), [""; 0]);
    browser.dark(true);
    browser.picture(&picture("trial-dark.png"));
    assert_eq!(browser.inaccessible(), [""; 0]);
    browser.dark(false);

    browser.window(360, 740, true);
    browser.open(&page);
    assert!(browser.evaluate("document.documentElement.scrollWidth") == json!(360), "the page fits a phone");
    browser.picture(&picture("trial-phone.png"));

    browser.window(1280, 900, false);
    browser.open(&page);
    let text = printed(&mut browser, "trial.pdf");
    assert!(text.contains("001_w1+50_w2+10 at (50, 10) rpm") && text.contains("Steady yaw"), "{text}");
    is_quiet(&browser, &page);
}

/// Markup that ends an attribute, an element and a script, and sets a variable if it runs.
const MARKUP: &str =
    "\"'><img src=x onerror=\"window.ran=1;alert(1)\"></script><script>window.ran=2</script><b onmouseover=alert(3)>";

#[test]
fn markup_in_a_log_is_escaped() {
    let bench = Bench::new();
    let plan =
        Plan::parse("[trial]\ncalibrate = 0\npreroll = 0\nrun = 1\ndecay = 0\n[speeds]\npairs = [[50, 10]]\n", "plan")
            .unwrap();
    let time = |seconds: f64| SystemTime::UNIX_EPOCH + Duration::from_secs_f64(seconds);
    let start = run::start(&plan, &plan.trials[0], 1, Origin::Rig, None, time(0.0));
    let path = bench.path().join("hostile.mcap");
    let mut log = run::Recorder::create(&path, &start, protocol::Settings::DEFAULT, time(0.0)).unwrap();
    let text = || MARKUP.to_owned();
    log.log.meta(&PlanMeta { name: text(), operator: text(), note: text(), trials: 1, text: text() }).unwrap();
    log.log.meta(&TrialMeta { name: text(), w1_rpm: 50.0, w2_rpm: 10.0, run_s: 1.0, ..TrialMeta::default() }).unwrap();
    log.event(EventKind::Phase, MARKUP, time(0.0)).unwrap();
    for i in 0..200_u16 {
        let frame = protocol::Telemetry { seq: protocol::units::Count(i), ..protocol::Telemetry::default() };
        log.frame(&frame, u64::from(i) * 5_000, time(f64::from(i) * 0.005)).unwrap();
    }
    log.event(EventKind::Warning, MARKUP, time(0.5)).unwrap();
    log.finish(&mut Summary { reason: text(), ..Summary::default() }).unwrap();

    let page = report(&bench, "hostile.mcap", 3);
    let mut browser = Browser::start();
    browser.open(&page);
    assert_eq!(browser.text("h1"), format!("{MARKUP} at (50, 10) rpm"));
    assert_eq!(browser.text(".note"), MARKUP);
    assert_eq!(
        browser
            .evaluate("window.ran === undefined && document.querySelectorAll('img, b[onmouseover], [onerror]').length"),
        json!(0)
    );
    assert_eq!(browser.evaluate("document.documentElement.dataset.ready"), json!("yes"));
    is_quiet(&browser, &page);

    // If an element slipped through, the policy would block its script.
    browser.evaluate("document.body.insertAdjacentHTML('beforeend', '<img src=data:, onerror=\"window.ran=3\">')");
    browser.evaluate("new Promise((done) => setTimeout(done, 200)).then(() => 0)");
    assert_eq!(browser.evaluate("window.ran ?? null"), json!(null));
    assert!(!browser.problems.is_empty(), "the violation is on the console");
}

#[test]
fn session_page_shows_its_map_and_opens_its_trials() {
    let bench = Bench::new();
    bench.file(
        "plan.toml",
        "[session]\nname = \"a small map\"\noperator = \"the bench\"\nnote = \"short runs, for the picture\"\n\
         [trial]\ncalibrate = 0\npreroll = 1\nrun = 8\ndecay = 1\n\
         [speeds]\ngrid = { w1 = [-90, 90, 30], w2 = [0, 90, 30] }\n",
    );
    bench.run(["simulate", "plan.toml", "--shapes", "--out", "s"]);
    let page = report(&bench, "s", 3);
    let mut browser = Browser::start();
    browser.window(1280, 900, false);
    let took = browser.open(&page);
    println!("a session of {} kB: opened in {} ms", page.metadata().unwrap().len() / 1000, took.as_millis());
    assert_eq!(browser.text("h1"), "a small map");
    assert_eq!(browser.evaluate("document.querySelectorAll('table.trials tbody tr').length"), json!(28));
    assert_eq!(browser.evaluate("document.querySelectorAll('.maps svg').length"), json!(4));
    assert_eq!(browser.evaluate("document.querySelectorAll('.maps svg a').length"), json!(112));
    assert!(browser.text(".notices").contains(" of 28 trials, such as those at "), "what holds for one starting phase");
    // The elements of a trial are made when it is opened, and the Tab key stops once at all trials.
    assert_eq!(browser.evaluate("document.querySelectorAll('section.trial').length"), json!(0));
    let stops = browser.evaluate(comparison::STOPS).as_u64().unwrap();
    assert!(stops <= comparison::MOST_STOPS, "{stops} stops of the Tab key");
    browser.picture(&picture("session-light.png"));

    // A cell of the map is a link to its trial.
    browser.evaluate(
        "location.hash = document.querySelector('.maps a[aria-label^=\"w1 90, w2 60 \"]').getAttribute('href')",
    );
    browser.evaluate("new Promise((done) => setTimeout(done, 100)).then(() => 0)");
    assert_eq!(browser.text("section.trial:not([hidden]) h2"), "027_w1+90_w2+60 at (90, 60) rpm");
    scrub(&mut browser, 5.0);
    assert!((browser.number("section:not([hidden]) [data-out='motors speed1 1']").unwrap() - 90.0).abs() < 0.1);
    browser.picture(&picture("session-open.png"));

    // Sorted by the yaw.
    browser.click("th:nth-child(4) button");
    let order = browser.evaluate("[...document.querySelectorAll('table.trials tbody tr td:nth-child(4)')].map((c) => Number(c.dataset.key)).every((v, i, all) => i === 0 || all[i - 1] <= v)");
    assert_eq!(order, json!(true));

    assert_eq!(browser.inaccessible(), [""; 0]);
    browser.dark(true);
    browser.picture(&picture("session-dark.png"));
    browser.dark(false);
    browser.window(360, 740, true);
    browser.open(&page);
    assert!(browser.evaluate("document.documentElement.scrollWidth") == json!(360), "the page fits a phone");
    let height = browser.evaluate("document.documentElement.scrollHeight").as_u64().unwrap();
    assert!(height < 4_000, "{height} pixels, however many trials there are");
    browser.picture(&picture("session-phone.png"));
    browser.window(1280, 900, false);
    browser.open(&page);
    let text = printed(&mut browser, "session.pdf");
    assert!(
        text.contains("028_w1+90_w2+90") && !text.contains("Settling time"),
        "28 trials are printed as a table: {text}"
    );
    is_quiet(&browser, &page);
}

#[test]
fn trial_of_a_large_session_is_drawn_with_ranges() {
    let bench = Bench::new();
    bench.run(["simulate", "--speeds=-90,90", "--duration", "60", "--rate", "50", "--out", "one"]);
    let log = bench.path().join("one/001_w1-90_w2+90.mcap");
    // Like a trial of the published map, it has a small share of the page.
    let map = Path::new(env!("CARGO_MANIFEST_DIR")).with_file_name("host").join("plans/published-map.toml");
    let plan = Plan::parse(&std::fs::read_to_string(map).unwrap(), "map.toml").unwrap();
    let session = Session::create(&bench.path().join("map"), &plan).unwrap();
    let mut reader = Reader::open(&log).unwrap();
    let mut clock = TrialClock::default();
    let messages = reader.by_ref().map(|message| {
        let message = message.unwrap();
        clock.see(&message);
        (clock.time_s(&message), message.body)
    });
    let messages: Vec<(f64, Body)> = messages.collect();
    let (model, summary): (ModelMeta, Summary) = (reader.meta().unwrap(), reader.meta().unwrap());
    for trial in &plan.trials {
        let start = run::start(&plan, trial, 1, Origin::Model, None, SystemTime::UNIX_EPOCH);
        let path = session.folder().join(format!("{}.mcap", trial.name));
        let mut copy = Writer::create(&path, &start, SystemTime::UNIX_EPOCH).unwrap();
        copy.meta(&model).unwrap();
        for (time_s, body) in &messages {
            let host = SystemTime::UNIX_EPOCH;
            match body {
                Body::Telemetry(frame) => copy.message_at(*time_s, &**frame, host).unwrap(),
                Body::Truth(truth) => copy.message_at(*time_s, truth, host).unwrap(),
                Body::Event(event) => copy.message_at(*time_s, event, host).unwrap(),
                _ => {}
            }
        }
        copy.finish(&summary).unwrap();
    }
    let trial = plan.trials.iter().position(|trial| trial.name.contains("w1-90_w2+90")).unwrap();
    let page = report(&bench, "map", 0);
    assert!(page.metadata().unwrap().len() < 10_000_000);

    let mut browser = Browser::start();
    browser.window(1400, 900, false);
    browser.open(&page);
    browser.evaluate(&format!("location.hash = 'trial-{}'", trial + 1));
    browser.evaluate("new Promise((done) => setTimeout(done, 100)).then(() => 0)");
    assert!(browser.text("section:not([hidden]) .charts").contains("range of 0.5"));
    browser.hover("section:not([hidden]) [data-chart=roll] .u-over");
    let tooltip = browser.text("section:not([hidden]) [data-chart=roll] .tooltip");
    assert!(tooltip.contains(" s, mean (range)model ") && tooltip.contains(" to "), "{tooltip}");
    browser.picture(&picture("ranges.png"));

    // The playback shows samples of the log, not extremes of the ranges.
    let times = browser.evaluate(&format!(
        "biflag.numbers(JSON.parse(document.getElementById('trial-{}-data').textContent).attitude.time)",
        trial + 1
    ));
    let times: Vec<f64> = times.as_array().unwrap().iter().map(|time| time.as_f64().unwrap()).collect();
    let telemetry = |message: Result<Message, _>| match message.unwrap().body {
        Body::Telemetry(telemetry) => Some(telemetry),
        _ => None,
    };
    let samples: Vec<_> = Reader::open(&log).unwrap().filter_map(telemetry).collect();
    assert!(times.len() < samples.len());
    for time in times.iter().step_by(times.len() / 20) {
        scrub(&mut browser, *time);
        let sample = samples.iter().find(|sample| (sample.time_s - time).abs() < 1e-3).expect("a sample of the log");
        for (name, value) in [("pitch", sample.pitch_deg), ("roll", sample.roll_deg)] {
            let shown = browser.number(&format!("section:not([hidden]) [data-out='attitude {name} 2']")).unwrap();
            assert!((shown - value).abs() < 0.02, "{name} at {time} s: {shown}, not {value}");
        }
    }
    is_quiet(&browser, &page);
}

/// Runs `biflag`; returns how long it took, s, and its peak memory, MB.
fn measured(bench: &Bench, arguments: &[&str]) -> (Run, f64, f64) {
    let begun = Instant::now();
    let mut child = bench.start(arguments);
    let mut peak_kb = 0.0_f64;
    while child.try_wait().unwrap().is_none() {
        peak_kb = peak_kb.max(memory_kb(&child, "VmHWM"));
        std::thread::sleep(Duration::from_millis(5));
    }
    (Run::of(child), begun.elapsed().as_secs_f64(), peak_kb * 1e-3)
}

/// Reports 75 trials of 120 s at 20 Hz with shapes, then replays, compares and reports them.
/// `cargo test -p tests --test all report -- --ignored --nocapture`
#[test]
#[ignore = "the simulation takes some minutes"]
fn long_session_is_reported_in_a_minute_and_a_gigabyte() {
    let bench = Bench::new();
    bench.file(
        "plan.toml",
        "[session]\nname = \"long\"\n[trial]\ncalibrate = 0\npreroll = 0\nrun = 120\ndecay = 0\n\
         [speeds]\ngrid = { w1 = [-70, 70, 10], w2 = [10, 50, 10] }\n",
    );
    bench.run(["simulate", "plan.toml", "--shapes", "--out", "s"]);
    let (run, wall_s, peak_mb) = measured(&bench, &["report", "s", "--json"]);
    let answer = run.json();
    let page = bench.path().join(answer["html"].as_str().unwrap());
    let megabytes = page.metadata().unwrap().len() as f64 * 1e-6;
    println!("75 trials of 120 s: {wall_s:.1} s, {peak_mb:.0} MB of memory, a page of {megabytes:.2} MB");
    assert_eq!(answer["trials"], 75);
    assert!(wall_s < 60.0 && peak_mb < 1000.0 && megabytes < 10.0);
    let (run, wall_s, peak_mb) = measured(&bench, &["compare", "s", "--json"]);
    println!("replayed, compared and reported: {wall_s:.1} s, {peak_mb:.0} MB of memory");
    assert_eq!(run.json()["trials"].as_array().unwrap().len(), 75);
    assert!(wall_s < 60.0 && peak_mb < 1000.0 && page.metadata().unwrap().len() < 10_000_000);
    let mut browser = Browser::start();
    let mut times: Vec<_> = (0..5).map(|_| browser.open(&page)).collect();
    times.sort_unstable();
    println!("opened in {} ms, the middle of five", times[2].as_millis());
    assert!(times[2] < Duration::from_secs(2));
    is_quiet(&browser, &page);
}
