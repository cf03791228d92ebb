//! Tests of the page of a swept table.

use super::{is_quiet, picture, report};
use host::sweep;
use serde_json::json;
use tests::Bench;
use tests::browser::Browser;

#[test]
fn swept_table_has_a_map_over_any_two_inputs_and_sliders_for_the_others() {
    let bench = Bench::new();
    let mut table =
        String::from("# a sweep\npoint,w1_rpm,w2_rpm,viscosity_pa_s,young_pa,stiffness,yaw_deg,tilt_deg,status\n");
    for (i, w1) in [-90.0, -60.0, -30.0, 0.0, 45.0, 60.0, 75.0, 90.0].into_iter().enumerate() {
        for w2 in [10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 75.0, 90.0] {
            for viscosity in [0.5, 1.0, 2.0] {
                for young in [1e6, 2e6] {
                    let failed = i == 0 && w2 == 10.0;
                    let yaw = if failed { String::new() } else { format!("{}", w1 * viscosity - w2 * young * 1e-6) };
                    let line = format!("p,{w1},{w2},{viscosity},{young},{},{yaw},{w2},ok\n", viscosity / young);
                    table += &line;
                }
            }
        }
    }
    bench.file("table.csv", &table);
    let page = report(&bench, "table.csv", 0);
    let mut browser = Browser::start();
    browser.window(1280, 900, false);
    browser.open(&page);
    let sliders = "[...document.querySelectorAll('.sliders label')].map((label) => label.textContent)";
    let marks = "[...document.querySelectorAll('.sweep [data-at]')].map((mark) => mark.dataset.at)";
    // The stiffness follows from the viscosity and Young's modulus.
    assert_eq!(browser.evaluate(sliders), json!(["viscosity 1", "Young's modulus 2000000"]));
    let shown = browser.evaluate(marks);
    assert_eq!(shown.as_array().unwrap().len(), 63, "one point has no yaw: {shown}");
    assert_eq!(shown[62], "90,90,-90");
    // The yaw has both signs: contours at round values, and a thicker one of zero.
    assert_eq!(browser.evaluate("document.querySelectorAll('.contour.zero').length"), 1);
    assert!(browser.evaluate("document.querySelectorAll('.contour').length").as_u64() > Some(3));
    browser.picture(&picture("sweep.png"));
    // The first step of the slider is half the viscosity.
    browser.evaluate("document.querySelector('.sliders input').focus()");
    browser.key("Home", 36);
    assert_eq!(browser.evaluate(marks)[62], "90,90,-135");
    // Another axis, and another result.
    browser.evaluate(
        "for (const [name, value] of [['x', 'viscosity_pa_s'], ['value', 'tilt_deg']]) { \
         const select = document.querySelector(`[name=${name}]`); select.value = value; select.dispatchEvent(new Event('change')); }",
    );
    assert_eq!(browser.evaluate(sliders), json!(["speed of flagellum 1 (w1) 45", "Young's modulus 2000000"]));
    assert_eq!(browser.evaluate(marks).as_array().unwrap().len(), 24);
    assert_eq!(browser.text(".sweep figure h3"), "tilt over viscosity and speed of flagellum 2 (w2)");
    // Three values of the viscosity are too few for contours.
    assert_eq!(browser.evaluate("document.querySelectorAll('.contour').length"), 0);
    // The same as lines: one for each speed.
    browser.evaluate("(() => { const s = document.querySelector('[name=view]'); s.value = 'lines'; s.dispatchEvent(new Event('change')); })()");
    assert_eq!(browser.text(".sweep figure h3"), "tilt over viscosity, for each speed of flagellum 2 (w2)");
    assert_eq!(browser.evaluate("document.querySelectorAll('.sweep svg path[stroke][d*=L]').length"), 8);
    assert_eq!(browser.evaluate(marks).as_array().unwrap().len(), 24);
    assert_eq!(browser.inaccessible(), [""; 0]);
    browser.dark(true);
    assert_eq!(browser.inaccessible(), [""; 0]);
    browser.window(390, 800, true);
    browser.open(&page);
    assert!(browser.evaluate("document.documentElement.scrollWidth") == json!(390), "the page fits a phone");
    is_quiet(&browser, &page);

    // The points of a Sobol sequence, each at two pairs of speeds: a dot each, over the keys on which the yaw depends most.
    let varies = ["viscosity_pa_s", "young_pa", "tether"].map(|key| format!("# {key} [1]: {}\n", sweep::VARIES));
    let mut table =
        varies.concat() + "point,w1_rpm,w2_rpm,viscosity_pa_s,young_pa,tether,yaw_deg,yaw_spread_deg,kind,status\n";
    for i in 0..40 {
        let [viscosity, young, tether] = [0.618, 0.755, 0.570].map(|step| 1.0 + (f64::from(i) * step).fract());
        for (w1, w2) in [(50.0, 10.0), (0.0, 45.0)] {
            let kind = if i == 0 { "not_found" } else { "steady" };
            let spread = if i == 1 { 0.4 } else { 0.2 };
            let yaw = -w1 * viscosity / tether - w2 + 0.01 * young;
            table += &format!("p,{w1},{w2},{viscosity},{young},{tether},{yaw},{spread},{kind},ok\n");
        }
    }
    bench.file("sobol.csv", &table);
    browser.open(&report(&bench, "sobol.csv", 0));
    let caption = browser.text(".sweep figcaption");
    assert_eq!(browser.text(".sweep figure h3"), "yaw over viscosity and tether");
    assert!(
        caption.contains("40 of 80 points, a dot each;")
            && caption.contains("1 not found, with a ring.")
            && caption.contains("other starting phases, with a ring: 1."),
        "{caption}"
    );
    assert_eq!(browser.evaluate("document.querySelectorAll('.sweep .odd').length"), 2);
    assert_eq!(browser.evaluate("document.querySelectorAll('.sweep .dot').length"), 40);
    assert_eq!(
        browser.evaluate(sliders),
        json!(["speed of flagellum 1 (w1) 50", "speed of flagellum 2 (w2) 10", "Young's modulus all"])
    );
    // The other pair of speeds follows one of its speeds.
    browser.evaluate("document.querySelectorAll('.sliders input')[0].focus()");
    browser.key("Home", 36);
    assert_eq!(browser.evaluate(sliders)[1], "speed of flagellum 2 (w2) 45");
    browser.picture(&picture("sobol.png"));

    // Of one input at a time, not every combination was computed.
    let mut table = String::from("point,w1_rpm,w2_rpm,viscosity_pa_s,young_pa,yaw_deg,status\n");
    for (viscosity, young) in [(1.0, 1e6), (0.5, 1e6), (2.0, 1e6), (1.0, 2e6)] {
        for (w1, w2) in [(0.0, 10.0), (0.0, 20.0), (30.0, 10.0), (30.0, 20.0)] {
            table += &format!("p,{w1},{w2},{viscosity},{young},{},ok\n", w1 * viscosity - w2 * young * 1e-6);
        }
    }
    bench.file("single.csv", &table);
    browser.open(&report(&bench, "single.csv", 0));
    assert_eq!(browser.text(".sweep figure h3"), "yaw over speed of flagellum 1 (w1) and viscosity");
    browser.evaluate("(() => { const s = document.querySelector('[name=y]'); s.value = 'w2_rpm'; s.dispatchEvent(new Event('change')); })()");
    for (slider, key, expected) in [
        (0, ("Home", 36), ["viscosity 0.5", "Young's modulus 1000000"]),
        (1, ("End", 35), ["viscosity 1", "Young's modulus 2000000"]),
        (0, ("End", 35), ["viscosity 2", "Young's modulus 1000000"]),
    ] {
        browser.evaluate(&format!("document.querySelectorAll('.sliders input')[{slider}].focus()"));
        browser.key(key.0, key.1);
        assert_eq!(browser.evaluate(sliders), json!(expected));
        assert_eq!(browser.evaluate(marks).as_array().unwrap().len(), 4, "{expected:?}");
    }
}
