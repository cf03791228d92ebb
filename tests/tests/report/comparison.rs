//! Tests of the pages of `biflag compare` and of sessions with a comparison.

use super::{is_quiet, picture, printed, scrub, view};
use serde_json::json;
use tests::browser::Browser;
use tests::{Bench, wait_until};

#[test]
fn comparison_is_printed_with_the_robot_of_its_model() {
    let bench = Bench::new();
    bench.file(
        "plan.toml",
        "[trial]\ncalibrate = 0\npreroll = 1\nrun = 8\ndecay = 1\n[speeds]\npairs = [[50, 10], [-90, 90]]\n",
    );
    bench.file("fitted.toml", "# Fitted to the trials of a Tuesday.\n[fluid]\nviscosity_pa_s = 1.2345\n");
    bench.run(["simulate", "plan.toml", "--shapes", "--out", "s"]);
    let answer = bench.run(["compare", "s", "--robot", "fitted.toml", "--json"]).json();
    let page = bench.path().join(answer["report"].as_str().unwrap());

    let mut browser = Browser::start();
    browser.window(1400, 900, false);
    browser.open(&page);
    let fits = "document.querySelector('.scroll').scrollWidth <= document.querySelector('.scroll').clientWidth";
    assert_eq!(browser.evaluate(fits), json!(true), "the table fits the window");
    let top = "document.querySelector('section.trial:not([hidden]) .view3d').getBoundingClientRect().top";
    let top = browser.evaluate(top).as_f64().unwrap();
    // Below the warning that its trial has not settled.
    assert!(top < 600.0, "the page opens on the robot, which begins at {top} of 900 pixels");
    let stops = browser.evaluate(STOPS).as_u64().unwrap();
    assert!(stops <= MOST_STOPS, "{stops} stops of the Tab key");
    // One plain sentence first, and no sentence twice.
    let said = "[...document.querySelectorAll('.answer, .test')].map((e) => e.checkVisibility() && e.textContent)";
    let said: Vec<String> = serde_json::from_value(browser.evaluate(said)).unwrap();
    assert!(said[0].starts_with("The second model ") && said[0].ends_with(" rpm."), "{said:?}");
    let mut once = said.clone();
    once.sort();
    once.dedup();
    assert!(once.len() == said.len() && said.iter().any(|text| text.starts_with("Yaw differs by ")), "{said:?}");
    browser.picture(&picture("comparison.png"));
    // The results alone, on five pages: a form feed ends each.
    let text = printed(&mut browser, "comparison.pdf");
    let at = |words: &str| text.find(words).unwrap();
    assert!(at("RMS error,") < at("001_w1+50_w2+10 at"), "the session is printed first: {text}");
    assert_eq!(
        browser.evaluate("document.querySelector('main').compareDocumentPosition(document.querySelector('aside')) & 4"),
        json!(4),
        "the table is below again"
    );
    assert!(text.matches('\u{c}').count() <= 5, "{text}");
    for (words, count) in [
        ("001_w1+50_w2+10 at (50, 10) rpm", 1),
        ("002_w1-90_w2+90 at (−90, 90) rpm", 1),
        ("Roll φ, °", 2),
        ("Speed of the flagella, rpm", 2),
        ("fitted.toml, closure full", 1),
        ("Provenance", 0),
        ("Notes", 1),
        // A drawn text: the scale of the yaw at both robots, 90° and −90°.
        ("90°", 4),
    ] {
        assert_eq!(text.matches(words).count(), count, "{words}: {text}");
    }
    // What the reader has opened is printed, too.
    browser.evaluate("document.querySelectorAll('details').forEach((details) => { details.open = true; })");
    let text = printed(&mut browser, "comparison-whole.pdf");
    for (words, count) in [
        ("Events (", 2),
        ("Provenance", 2),
        ("Time shift", 2),
        ("fitted.toml, closure full", 4),
        ("# Fitted to the trials of a Tuesday.", 1),
        ("viscosity_pa_s = 1.2345", 2),
        ("pairs = [[50, 10], [-90, 90]]", 1),
    ] {
        assert_eq!(text.matches(words).count(), count, "{words}: {text}");
    }
    // Chromium shrinks a page that is wider than the paper.
    browser.call("Emulation.setEmulatedMedia", json!({ "media": "print" }));
    browser.window(688, 900, false);
    let fits = "document.documentElement.scrollWidth <= innerWidth && innerWidth";
    assert_eq!(browser.evaluate(fits), json!(688), "the page fits the paper");
    is_quiet(&browser, &page);
}

/// The most stops of the Tab key, however many trials a page has.
pub(super) const MOST_STOPS: u64 = 40;

/// Returns the number of stops of the Tab key.
pub(super) const STOPS: &str = "[...document.querySelectorAll('a[href], button, input, select, summary, [tabindex]')].filter((e) => \
                     e.tabIndex >= 0 && !e.disabled && e.checkVisibility()).length";

/// Saves every figure of the page in every format; returns title, format, type, size and text of each file.
const SAVE_ALL: &str = "(async () => {
    const files = [];
    const make = URL.createObjectURL;
    let done;
    HTMLAnchorElement.prototype.click = function () { done(this.download); };
    for (const button of document.querySelectorAll('section:not([hidden]) [data-save], .maps [data-save]')) {
        let last;
        URL.createObjectURL = (file) => { last = file; return make.call(URL, file); };
        const name = await new Promise((resolve) => { done = resolve; button.click(); });
        const text = button.dataset.save === 'png' ? '' : await last.text();
        const wrong = button.dataset.save === 'svg' && new DOMParser().parseFromString(text, 'image/svg+xml').querySelector('parsererror');
        files.push({ name, format: button.dataset.save, type: last.type, size: last.size, text: wrong ? wrong.textContent : text });
    }
    return files;
})()";

/// Films a view up to the end of its trial; returns the name, type, size and first bytes of the file.
const FILM: &str = "(async () => {
    const make = URL.createObjectURL;
    const made = new Promise((done) => { URL.createObjectURL = (file) => { done(file); return make.call(URL, file); }; });
    const named = new Promise((done) => { HTMLAnchorElement.prototype.click = function () { done(this.download); }; });
    const button = document.querySelector('SECTION .film');
    button.click();
    const file = await made;
    URL.createObjectURL = make;
    const head = [...new Uint8Array(await file.slice(0, 4).arrayBuffer())];
    return { name: await named, type: file.type, size: file.size, head };
})()";

#[test]
fn comparison_has_the_answer_first_and_every_chart_can_be_hidden_linked_and_saved() {
    let bench = Bench::new();
    bench.file(
        "plan.toml",
        "[trial]\ncalibrate = 0\npreroll = 1\nrun = 8\ndecay = 1\n[speeds]\npairs = [[50, 10], [-90, 90], [0, 45], [90, 0], [45, 45], [-45, 20]]\n",
    );
    bench.file("thick.toml", "[fluid]\nviscosity_pa_s = 1.5\n");
    bench.run(["simulate", "plan.toml", "--shapes", "--out", "s"]);
    let answer = bench.run(["compare", "s", "--robot", "thick.toml", "--json"]).json();
    let page = bench.path().join(answer["report"].as_str().unwrap());
    let mut browser = Browser::start();
    browser.window(1400, 900, false);
    browser.moving();
    browser.open(&page);
    // A session of few trials opens the first one, and its robot moves.
    assert!(browser.text("section.trial:not([hidden]) h2").starts_with("001_w1+50_w2+10"));
    // On a busy computer it may have come to its end.
    wait_until("its robot moves", || {
        browser.evaluate("document.querySelector('section:not([hidden]) .scrub').value > 0") == true
    });
    browser.evaluate("document.querySelector('section:not([hidden]) .play.playing')?.click()");
    browser.evaluate("location.hash = 'trial-2'");
    browser.evaluate("new Promise((done) => setTimeout(done, 100)).then(() => 0)");
    let shown = "section:not([hidden])";

    // The answer is above everything else; the residuals are below each angle.
    assert!(browser.text(&format!("{shown} .test")).starts_with("Yaw differs by "));
    // Red is for problems: what differs is a result.
    let rgb = "getComputedStyle(document.querySelector('.answer.differs')).borderLeftColor.match(/\\d+/g).map(Number)";
    let rgb = browser.evaluate(rgb);
    assert!(rgb[0].as_u64() < rgb[2].as_u64(), "{rgb}");
    let order = format!(
        "document.querySelector('{shown} .test').compareDocumentPosition(document.querySelector('{shown} .tiles')) & 4"
    );
    assert_eq!(browser.evaluate(&order), json!(4));
    let charts = browser
        .evaluate(&format!("[...document.querySelectorAll('{shown} [data-chart]')].map((c) => c.dataset.chart)"));
    let expected = json!([
        "yaw",
        "error_yaw",
        "pitch",
        "error_pitch",
        "roll",
        "error_roll",
        "motors",
        "force_z",
        "force_x",
        "force_y",
        "gap",
        "winding"
    ]);
    assert_eq!(charts, expected);
    // Where the values of the model's parameters that differ from the built-in robot come from.
    let sources = browser.text("aside details:has(table thead)");
    assert!(sources.contains("fluid.viscosity_pa_s1.5thick.tomlDynamic viscosity"), "{sources}");
    assert!(!sources.contains("base.mass_kg0.094"), "{sources}");

    // Ghost and forces can be hidden, and the robot seen from above.
    let press = |browser: &mut Browser, selector: &str| {
        browser.evaluate(&format!("document.querySelector('{shown} {selector}').click()"));
    };
    let whole = view(&mut browser);
    press(&mut browser, "[data-show=ghost]");
    let alone = view(&mut browser);
    press(&mut browser, "[data-show=forces]");
    let bare = view(&mut browser);
    press(&mut browser, "[data-show=trails]");
    let still = view(&mut browser);
    press(&mut browser, "[data-show=trails]");
    assert!(view(&mut browser) == bare && still != bare);
    // The camera turns with the yaw of the robot, and back.
    press(&mut browser, "[data-camera=follow]");
    let followed = view(&mut browser);
    press(&mut browser, "[data-camera=follow]");
    assert!(view(&mut browser) == bare && followed != bare);
    press(&mut browser, "[data-look=top]");
    let top = view(&mut browser);
    assert!(whole != alone && alone != bare && bare != top);

    // The legend hides a curve, and the address opens the same view again.
    let chart = format!("document.querySelector('{shown} [data-chart=yaw] canvas').toDataURL()");
    let both = browser.evaluate(&chart);
    press(&mut browser, "[data-curve=model]");
    assert_eq!(
        browser.evaluate(&format!("document.querySelector('{shown} [data-curve=model]').ariaPressed")),
        json!("false")
    );
    let hidden = browser.evaluate(&chart);
    assert!(both != hidden);
    scrub(&mut browser, 4.25);
    let seen = view(&mut browser);
    browser.evaluate("new Promise((done) => setTimeout(done, 400)).then(() => 0)");
    let address = browser.evaluate("location.hash").as_str().unwrap().to_owned();
    assert!(address.starts_with("#trial-2&t=4.25&hide=model&off=ghost,forces&look=top"), "{address}");
    browser.reload();
    assert_eq!(browser.evaluate("location.hash"), json!(address));
    assert!((browser.number(&format!("{shown} [data-out^=time]")).unwrap() - 4.25).abs() < 0.01);
    assert!(view(&mut browser) == seen);

    // The Tab key stops once at each group of buttons and at each map; arrow keys go on within it.
    let stops = browser.evaluate(STOPS);
    println!("{stops} stops of the Tab key");
    assert!(stops.as_u64().unwrap() <= MOST_STOPS, "{stops}");
    browser.evaluate(&format!("document.querySelector('{shown} [data-look=perspective]').focus()"));
    browser.key("ArrowRight", 39);
    assert_eq!(browser.evaluate("document.activeElement.dataset.look"), json!("top"));

    // The ribbon names the phases, and a click on it selects a time.
    let ribbon = format!("document.querySelector('{shown} .ribbon')");
    assert_eq!(
        browser.evaluate(&format!("{ribbon}.ariaLabel")),
        json!("preroll 0.0 to 1.0 s; run 1.0 to 9.0 s; decay 9.0 to 10.0 s")
    );
    assert_eq!(browser.evaluate(&format!("{ribbon}.querySelectorAll('.phases div').length")), json!(3));
    browser.click(&format!("{shown} [data-ribbon]"));
    assert!((browser.number(&format!("{shown} [data-out^=time]")).unwrap() - 5.0).abs() < 0.05);
    // A robot without a tank has no view of it.
    assert_eq!(browser.evaluate("document.querySelector('[data-look=tank]')"), json!(null));

    // The view is filmed up to the end of the trial.
    scrub(&mut browser, 7.0);
    let film = browser.evaluate(&FILM.replace("SECTION", shown));
    assert_eq!((&film["type"], &film["head"]), (&json!("video/webm"), &json!([0x1a, 0x45, 0xdf, 0xa3])), "{film}");
    assert!(film["size"].as_u64().unwrap() > 5_000, "{film}");
    assert!(film["name"].as_str().unwrap().ends_with("film.webm"), "{film}");
    assert_eq!(browser.number(&format!("{shown} [data-out^=time]")), Some(10.0));

    // Every figure can be saved; a table has the numbers of its chart.
    let files = browser.evaluate(SAVE_ALL);
    let files = files.as_array().unwrap();
    // Seven figures and eight maps in three formats, and the view of the robot.
    assert_eq!(files.len(), 7 * 3 + 8 * 3 + 1);
    for file in files {
        let text = file["text"].as_str().unwrap();
        let (kind, least) = match file["format"].as_str().unwrap() {
            "png" => ("image/png", 5_000),
            "svg" => ("image/svg+xml", 2_000),
            _ => ("text/csv", 100),
        };
        assert_eq!(file["type"], kind);
        assert!(file["size"].as_u64().unwrap() > least, "{file}");
        match file["format"].as_str().unwrap() {
            "svg" => assert!(text.starts_with("<svg ") && text.contains("<path") && !text.contains("NaN"), "{file}"),
            "csv" => assert!(
                text.lines().all(|line| line.split(',').count() == text.lines().next().unwrap().split(',').count())
            ),
            _ => {}
        }
    }
    let csv = |name: &str| {
        let file = files.iter().find(|file| file["format"] == "csv" && file["name"].as_str().unwrap().contains(name));
        file.unwrap_or_else(|| panic!("{name}"))["text"].as_str().unwrap().to_owned()
    };
    let yaw = csv("Yaw");
    assert!(yaw.starts_with("time_s,yaw_deg,model_yaw_deg,error_yaw_deg\n"), "{}", &yaw[..200]);
    for line in yaw.lines().skip(1) {
        let row: Vec<f64> = line.split(',').map(|value| value.parse().unwrap()).collect();
        assert!((row[2] - row[1] - row[3]).abs() < 0.02, "{line}");
    }
    assert!(csv("Forces").starts_with("time_s,z1_mn,z2_mn,contact,x1_mn,x2_mn,y1_mn,y2_mn\n"));
    assert_eq!(csv("Steady_yaw").lines().count(), 7);
    assert_eq!(browser.inaccessible(), [""; 0]);
    browser.dark(true);
    assert_eq!(browser.inaccessible(), [""; 0]);
    is_quiet(&browser, &page);
}
