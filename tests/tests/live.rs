//! Serving trials to viewers, and that slow or dead viewers do not affect a recording.

use biflag_log::Body;
use biflag_log::schema::{CHANNELS, LogMessage, biflag, foxglove};
use host::live::Live;
use prost::Message;
use rustix::process::Signal;
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader};
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::Child;
use std::time::{Duration, Instant};
use tests::browser::Browser;
use tests::{Bench, Run, Seen, Viewer, nano, signal, wait_until};

/// Every channel but `/raw`.
const SHOWN: usize = CHANNELS.len() - 1;

/// Returns the address that a program prints on its standard error, which is read to its end in the background.
fn url(child: &mut Child) -> String {
    said(child, |line| line.strip_prefix("live at ").and_then(|rest| rest.split(": ").next()))
}

/// Returns the part of the first line on a program's standard error that has one. The rest is read in the background.
fn said(child: &mut Child, part: impl Fn(&str) -> Option<&str>) -> String {
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines().map_while(Result::ok);
    let mut said = Vec::new();
    let url = lines.by_ref().find_map(|line| {
        let url = part(&line).map(str::to_owned);
        said.push(line);
        url
    });
    std::thread::spawn(move || lines.for_each(drop));
    url.unwrap_or_else(|| panic!("no address: {said:?}"))
}

/// Returns the log of a modelled trial with a run of `seconds`.
fn simulated(bench: &Bench, seconds: u32, more: &[&str]) -> PathBuf {
    let seconds = seconds.to_string();
    let arguments = ["simulate", "--speeds=50,10", "--duration", &seconds, "--out", "session", "--json"];
    let run = bench.run(arguments.iter().chain(more));
    bench.path().join(run.json()["trials"][0]["log"].as_str().unwrap())
}

/// Returns the messages of a log that are sent to viewers: topic, `log_time` in ns, bytes.
fn shown(log: &Path) -> Vec<(String, u64, Vec<u8>)> {
    let messages = biflag_log::Reader::open(log).unwrap().map(Result::unwrap);
    let shown = messages.filter(|message| message.topic != "/raw");
    shown.map(|message| (message.topic.clone(), message.log_time_ns, message.body.encode())).collect()
}

fn counts(messages: &[(String, u64, Vec<u8>)]) -> BTreeMap<&str, usize> {
    let mut counts = BTreeMap::new();
    messages.iter().for_each(|(topic, ..)| *counts.entry(topic.as_str()).or_default() += 1);
    counts
}

/// One viewer reads and gets all messages, the others never read, and the log is complete.
#[test]
fn viewers_do_not_affect_a_recording() {
    let bench = Bench::new();
    // The viewers connect in the pre-roll.
    let plan = bench.file(
        "plan.toml",
        "[session]\nname = \"bench\"\n[board]\ndeadline_ms = 5000\n[trial]\ncalibrate = 0\npreroll = 20\nrest_at_most = 0\nrun = 14\ndecay = 2\n\
         [speeds]\npairs = [[50, 10]]\n",
    );
    let nano = nano(["--speed", "4"]);
    let plan = plan.to_str().unwrap();
    let mut recording =
        bench.start(["record", plan, "--port", nano.port(), "--out", "session", "--live=127.0.0.1:0", "--json"]);
    let url = url(&mut recording);
    let reader = Viewer::connect(&url, SHOWN);
    let dead: Vec<Viewer> = (0..3).map(|_| Viewer::connect(&url, SHOWN)).collect();
    let seen = std::thread::spawn(move || reader.read_all());
    let run = Run::of(recording).expect_unsettled();
    let seen = seen.join().unwrap();
    drop(dead);
    let trial = &run.json()["trials"][0];
    assert_eq!((&trial["samples"], &trial["lost"]), (&7200.into(), &0.into()), "{trial}");
    assert_eq!((&trial["resyncs"], &trial["complete"]), (&0.into(), &true.into()), "{trial}");

    let log = shown(&bench.path().join(trial["log"].as_str().unwrap()));
    assert_eq!(counts(&log)["/telemetry"], 7200);
    assert_eq!(counts(&log)["/attitude"], 7200);
    println!("the log: {:?}\nthe viewer: {:?}", counts(&log), counts(&seen));
    let missed = log.iter().position(|message| *message == seen[0]).unwrap();
    assert!(log[missed..].starts_with(&seen), "the viewer got all messages recorded since it connected");
    let phases =
        seen.iter().filter(|(topic, ..)| topic == "/event").map(|(.., bytes)| biflag::Event::decode(&bytes[..]));
    let phases: Vec<String> = phases.map(|event| event.unwrap().text).collect();
    assert!(phases.contains(&"run".to_owned()) && phases.contains(&"decay".to_owned()), "{phases:?}");
}

/// A viewer that never reads is sent far more than the system's buffers hold. Sending does not block, the queue is
/// bounded, and another viewer still gets new messages.
#[test]
fn dead_viewer_blocks_nothing() {
    let live = Live::listen("127.0.0.1:0".parse().unwrap()).unwrap();
    let dead = Viewer::connect(&live.url(), SHOWN);
    let wait = |live: &Live| {
        while !live.is_watched() {
            std::thread::sleep(Duration::from_millis(1));
        }
    };
    wait(&live);
    let message = biflag::RawBytes { data: vec![7; 16_000] }.encode_to_vec();
    let mut worst = Duration::ZERO;
    let begun = Instant::now();
    for i in 0..20_000 {
        let shown = Instant::now();
        live.show(&biflag::Telemetry::CHANNEL, i, &message);
        worst = worst.max(shown.elapsed());
    }
    println!("320 MB sent without readers in {:?}, a message in {worst:?} at most", begun.elapsed());
    let resident = std::fs::read_to_string("/proc/self/status").unwrap();
    let resident_kb: u64 = resident
        .lines()
        .find_map(|line| line.strip_prefix("VmRSS:")?.trim().strip_suffix(" kB")?.parse().ok())
        .unwrap();
    assert!(resident_kb < 200_000, "{resident_kb} kB");

    let mut reader = Viewer::connect(&live.url(), SHOWN);
    let event = biflag::Event { kind: 0, text: "here".into() };
    let begun = Instant::now();
    std::thread::scope(|scope| {
        let seen = scope.spawn(move || {
            loop {
                if let Seen::Message(topic, _, bytes) = reader.read() {
                    return (topic, bytes);
                }
            }
        });
        while !seen.is_finished() && begun.elapsed() < Duration::from_secs(60) {
            live.message(30_000, &event);
            std::thread::sleep(Duration::from_millis(10));
        }
        assert_eq!(seen.join().unwrap(), ("/event".to_owned(), event.encode_to_vec()));
    });
    drop(dead);
}

/// A page that the user has open in a browser cannot read the experiment, and Foxglove's pages and programs can.
#[test]
fn other_web_pages_are_refused() {
    let bench = Bench::new();
    let log = simulated(&bench, 60, &[]);
    let mut playing = bench.start(["live", log.to_str().unwrap(), "--listen", "127.0.0.1:0"]);
    let url = url(&mut playing);
    for page in ["https://evil.example", "https://app.foxglove.dev.evil.example", "null"] {
        let (status, text) = Viewer::connect_from(Some(page), &url, SHOWN).err().expect(page);
        assert_eq!(status, 403, "{page}: {text}");
        assert!(text.contains("may not read"), "{page}: {text}");
    }
    for origin in [None, Some("https://app.foxglove.dev"), Some("file://"), Some("http://localhost:8080")] {
        let Ok(mut viewer) = Viewer::connect_from(origin, &url, SHOWN) else { panic!("{origin:?}") };
        assert_ne!(viewer.read(), Seen::End, "{origin:?}");
    }
    signal(&playing, Signal::INT);
    Run::of(playing).expect_code(130);
}

/// Viewers connect, and pages are refused, at an IPv6 address too.
#[test]
fn viewers_connect_over_ipv6() {
    let live = match Live::listen("[::1]:0".parse().unwrap()) {
        Ok(live) => live,
        Err(_) if TcpListener::bind("[::1]:0").is_err() => return,
        Err(error) => panic!("{error}"),
    };
    assert!(live.url().starts_with("ws://[::1]:"), "{}", live.url());
    let viewer = Viewer::connect(&live.url(), SHOWN);
    assert_eq!(viewer.channels.len(), SHOWN);
    let (status, _) = Viewer::connect_from(Some("https://evil.example"), &live.url(), SHOWN).err().unwrap();
    assert_eq!(status, 403);
}

/// A log with shapes arrives completely, at the requested speed, with self-contained schemas.
#[test]
fn log_is_played_at_the_requested_speed() {
    let bench = Bench::new();
    let log = simulated(&bench, 6, &["--shapes"]);
    let mut playing = bench.start(["live", log.to_str().unwrap(), "--speed", "3", "--listen", "127.0.0.1:0", "--json"]);
    let mut viewer = Viewer::connect(&url(&mut playing), SHOWN);
    for spec in CHANNELS.iter().filter(|spec| spec.topic != "/raw") {
        let channel = &viewer.channels[spec.topic];
        assert_eq!((&channel["encoding"], &channel["schemaName"]), (&"protobuf".into(), &spec.schema.into()));
    }
    let begun = Instant::now();
    let (mut seen, mut times) = (Vec::new(), Vec::new());
    loop {
        match viewer.read() {
            Seen::Message(topic, time, bytes) => seen.push((topic, time, bytes)),
            Seen::Time(ns) => times.push(ns),
            Seen::End => break,
        }
    }
    let took = begun.elapsed();
    let run = Run::of(playing).expect_code(0);
    assert_eq!(run.json()["played"]["messages"], seen.len());
    assert_eq!(seen, shown(&log));
    assert!(times.len() > 30 && times.is_sorted() && *times.last().unwrap() <= 6_000_000_000, "{times:?}");
    // It never runs ahead, and a busy computer may fall behind: at their own speed the messages take 6 s.
    assert!((2.0..6.0).contains(&took.as_secs_f64()), "6 s at three times their speed took {took:?}");
    let counts = counts(&seen);
    for topic in ["/telemetry", "/attitude", "/truth", "/forces", "/flagella", "/flagella_points"] {
        assert_eq!(counts[topic], 121, "{topic}");
    }
    let scene = seen.iter().find(|(topic, ..)| topic == "/flagella").unwrap();
    assert_eq!(foxglove::SceneUpdate::decode(&scene.2[..]).unwrap().entities[0].lines.len(), 2);
}

/// A watched board streams, its motors stay still, nothing is recorded, and Ctrl-C ends it.
#[test]
fn watching_a_board_does_not_change_it() {
    let bench = Bench::new();
    let mut nano = nano(["--speed", "4"]);
    let port = nano.port().to_owned();
    let mut watching = bench.start(["live", "--port", &port, "--listen", "127.0.0.1:0", "--json"]);
    let mut viewer = Viewer::connect(&url(&mut watching), SHOWN);
    let mut frames: Vec<biflag::Telemetry> = Vec::new();
    let mut attitudes = 0;
    while frames.len() < 200 {
        match viewer.read() {
            Seen::Message(topic, _, bytes) if topic == "/telemetry" => {
                frames.push(Message::decode(&bytes[..]).unwrap())
            }
            Seen::Message(topic, ..) if topic == "/attitude" => attitudes += 1,
            Seen::End => panic!("the stream ended"),
            _ => {}
        }
    }
    assert!(attitudes >= 199);
    assert_eq!(nano.control("status").unwrap()["pwm"], serde_json::json!([0, 0]));
    let one_by_one = |pair: &[biflag::Telemetry]| pair[1].seq == (pair[0].seq + 1) % 65_536;
    assert!(frames.windows(2).all(one_by_one) && frames.iter().all(|frame| frame.motor1.unwrap().duty == 0));
    signal(&watching, Signal::INT);
    let run = Run::of(watching).expect_code(130);
    assert_eq!(run.json()["link"]["lost"], 0);
    assert_eq!(std::fs::read_dir(bench.path()).unwrap().count(), 0, "nothing is recorded");
}

/// A busy address is an error before the board is used or a folder is created.
#[test]
fn busy_address_is_an_error_at_once() {
    let bench = Bench::new();
    let plan = bench.short_plan(5.0, [50.0, 10.0]);
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    let live = format!("--live={address}");
    let run = bench.run(["record", plan.to_str().unwrap(), "--port", "/dev/null", "--out", "s", &live]).expect_code(1);
    assert!(run.stderr.contains(&address) && run.stderr.contains("--live="), "{run:?}");
    assert!(!bench.path().join("s").exists());
    let run = bench.run(["live", "--port", "/dev/null", "--listen", &address]).expect_code(1);
    assert!(run.stderr.contains("--listen"), "{run:?}");
    bench.run(["live", "--port", "/dev/null", "--listen", "192.0.2.1:8765"]).expect_code(2);
}

/// Ctrl-C ends the playback while it waits for a viewer, and while it plays.
#[test]
fn ctrl_c_ends_a_playback() {
    let bench = Bench::new();
    let log = simulated(&bench, 60, &[]);
    for viewers in [0, 1] {
        let mut playing = bench.start(["live", log.to_str().unwrap(), "--listen", "127.0.0.1:0"]);
        let url = url(&mut playing);
        let mut viewers: Vec<Viewer> = (0..viewers).map(|_| Viewer::connect(&url, SHOWN)).collect();
        viewers.iter_mut().for_each(|viewer| drop(viewer.read()));
        signal(&playing, Signal::INT);
        let interrupted = Instant::now();
        Run::of(playing).expect_code(130);
        // It would have gone on for a minute.
        assert!(interrupted.elapsed() < Duration::from_secs(30));
    }
}

/// Viewers look up the attitude at the time stamp of a shape, so both must use the clock of the log, for a model and
/// for an emulated board with the simulated robot.
#[test]
fn drawn_messages_have_their_log_time() {
    let bench = Bench::new();
    let plan = bench.short_plan(2.0, [50.0, 10.0]);
    let run = bench.run(["record", plan.to_str().unwrap(), "--virtual", "--out", "recorded", "--json"]);
    let recorded = bench.path().join(run.json()["trials"][0]["log"].as_str().unwrap());
    for log in [recorded, simulated(&bench, 2, &["--shapes"])] {
        let (mut attitudes, mut shapes) = (0, 0);
        for message in biflag_log::Reader::open(&log).unwrap().map(Result::unwrap) {
            let stamp = match &message.body {
                Body::Attitude(transform) => transform.timestamp,
                Body::Flagella(scene) => scene.entities[0].timestamp,
                Body::FlagellaPoints(cloud) => cloud.timestamp,
                _ => continue,
            };
            let stamp = stamp.unwrap();
            let stamp_ns = stamp.seconds as u64 * 1_000_000_000 + stamp.nanos as u64;
            assert_eq!(stamp_ns, message.log_time_ns, "{} of {}", message.topic, log.display());
            let counted = if message.topic == "/attitude" { &mut attitudes } else { &mut shapes };
            *counted += 1;
        }
        assert!(attitudes >= 40 && shapes >= 40, "{attitudes} attitudes and {shapes} shapes in {}", log.display());
    }
}

/// The shipped layouts of Foxglove and PlotJuggler show fields that the log has.
#[test]
fn layouts_name_fields_that_exist() {
    let layouts = Path::new(env!("CARGO_MANIFEST_DIR")).join("../host/layouts");
    let foxglove: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(layouts.join("foxglove.json")).unwrap()).unwrap();
    let mut paths = Vec::new();
    for panel in foxglove["configById"].as_object().unwrap().values() {
        paths.extend(
            panel["paths"].as_array().into_iter().flatten().map(|path| path["value"].as_str().unwrap().to_owned()),
        );
        paths.extend(panel["topics"].as_object().into_iter().flat_map(|topics| topics.keys().cloned()));
        paths.extend(panel["topicPath"].as_str().map(str::to_owned));
    }
    let plotjuggler = std::fs::read_to_string(layouts.join("plotjuggler.xml")).unwrap();
    paths.extend(plotjuggler.split("curve name=\"").skip(1).map(|rest| rest.split('"').next().unwrap().to_owned()));
    assert!(paths.len() > 15, "{paths:?}");
    for path in paths {
        let mut parts = path.trim_start_matches('/').split(['/', '.']);
        let topic = format!("/{}", parts.next().unwrap());
        let channel = CHANNELS.iter().find(|channel| channel.topic == topic).unwrap_or_else(|| panic!("{path}"));
        let set = prost_types::FileDescriptorSet::decode(channel.descriptors).unwrap();
        let mut message = channel.schema.rsplit('.').next().unwrap().to_owned();
        for part in parts {
            let of = set.file.iter().flat_map(|file| &file.message_type).find(|of| *of.name() == message).unwrap();
            let field = of.field.iter().find(|field| field.name() == part).unwrap_or_else(|| panic!("{path}"));
            message = field.type_name().rsplit('.').next().unwrap().to_owned();
        }
    }
}

/// The robot moves, the first trial is in the table once it is done, and the button stops a later one.
#[test]
fn the_page_in_the_browser_follows_the_robot_and_stops_it() {
    let bench = Bench::new();
    let trial = "calibrate = 0\npreroll = 2\nrest_at_most = 0\nrun = 20\ndecay = 1";
    let plan = format!("[session]\nname = \"bench\"\nrepeats = 9\n[trial]\n{trial}\n[speeds]\npairs = [[50, 10]]\n");
    let plan = bench.file("plan.toml", &plan);
    // It takes a busy computer longer to start than the trials take.
    let mut browser = Browser::start();
    let nano = nano(["--speed", "4"]);
    let mut recording =
        bench.start(["record", plan.to_str().unwrap(), "--port", nano.port(), "--out", "session", "--open"]);
    let url = said(&mut recording, |line| line.find("http://").map(|at| &line[at..]));
    browser.visit(&url);
    let done = "#trials tbody tr:first-child td:nth-child(4)";
    wait_until("the first trial is in the table", || {
        browser.evaluate(&format!("(document.querySelector('{done}')?.textContent ?? '').includes('±')")) == true
    });
    // In one script, and with an observer: on a busy computer a trial may end between two of them.
    let write = "(() => {
        const text = (of) => document.querySelector(of)?.textContent ?? '';
        const runs = !text('h1').startsWith('001') && text('[data-out=phase]') === 'run';
        if (!runs || !(parseFloat(text(\"[data-out='motors speed1 1']\")) > 15)) return false;
        const look = () => { window.noted ||= text('.ribbon .events').includes('operator: stirred'); };
        new MutationObserver(look).observe(document.body, { subtree: true, childList: true, characterData: true });
        const field = document.querySelector('.note');
        field.value = 'stirred';
        field.dispatchEvent(new Event('change'));
        return true;
    })()";
    wait_until("a note is written in a later trial", || browser.evaluate(write) == true);
    wait_until("the note is at its time", || browser.evaluate("window.noted === true") == true);
    let before = browser.evaluate("document.querySelector('.scene canvas').toDataURL()");
    wait_until("the robot moves", || browser.evaluate("document.querySelector('.scene canvas').toDataURL()") != before);
    browser.click(".stop");
    wait_until("the page says so", || browser.text(".now") == "Stopped, the motors are off.");
    let pictures = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).with_file_name("target").join("report-pictures");
    browser.picture(&pictures.join("recording.png"));
    Run::of(recording).expect_code(130);
    let noted = |log: &PathBuf| bench.run(["info", log.to_str().unwrap(), "--json"]).json()["notes"].clone();
    let notes: Vec<_> = tests::logs(&bench.path().join("session")).iter().map(noted).collect();
    assert_eq!(notes.iter().filter(|notes| notes[0]["text"] == "stirred").count(), 1, "{notes:?}");
    assert_eq!(browser.inaccessible(), [""; 0]);
    assert!(browser.problems.is_empty(), "{:?}", browser.problems);
    assert!(browser.requests.iter().all(|request| request.starts_with(&url)), "{:?}", browser.requests);
}
