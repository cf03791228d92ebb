//! End-to-end tests of `figure`: files, formats, sizes on paper, and errors.

use crate::program::biflag;
use resvg::usvg::{self, Node, Rect};
use serde_json::Value;
use sha2::{Digest, Sha256};
use sim::body::closure::Closure;
use sim::params::Robot;
use std::path::Path;
use std::sync::Arc;
use study::plan::{Fit, FittedParameter, FittedTo, with_fit};

const PLAN: &str = "[session]\nname = \"short\"\n[trial]\ncalibrate = 0\npreroll = 0.5\nrun = 2\ndecay = 0.5\n\
                    [speeds]\ngrid = { w1 = [-90, 90, 90], w2 = [0, 90, 45] }\n";

const WIDTH_PT: f32 = 88.0 * 72.0 / 25.4;

/// Runs `biflag figure`, which must succeed; returns the file. Short trials have not settled.
fn figure(folder: &Path, args: &[&str], file: &str) -> Vec<u8> {
    let output = biflag(folder, &[&["figure"], args, &["-o", file, "--json"]].concat());
    let answer: Value = serde_json::from_slice(&output.stdout).unwrap();
    // The robots may differ, which the figure says as `compare` does.
    let warns = args.contains(&"--anyway") || answer["findings"].to_string().contains("\"grave\":true");
    let code = if warns { 3 } else { 0 };
    assert_eq!(output.status.code(), Some(code), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(answer["files"], serde_json::json!([file]));
    std::fs::read(folder.join(file)).unwrap()
}

fn tree(svg: &[u8]) -> usvg::Tree {
    let font = concat!(env!("CARGO_MANIFEST_DIR"), "/page/src/figure/font/LiberationSans-Regular.ttf");
    let mut fonts = usvg::fontdb::Database::new();
    fonts.load_font_file(font).unwrap();
    let options = usvg::Options { dpi: 72.0, fontdb: Arc::new(fonts), ..usvg::Options::default() };
    usvg::Tree::from_data(svg, &options).unwrap()
}

/// Returns the words of a figure, their sizes and their places.
fn texts(group: &usvg::Group) -> Vec<(String, f32, Rect)> {
    let one = |node: &Node| match node {
        Node::Group(group) => texts(group),
        Node::Text(text) => {
            let chunk = &text.chunks()[0];
            vec![(chunk.text().to_owned(), chunk.spans()[0].font_size().get(), text.abs_bounding_box())]
        }
        Node::Path(_) | Node::Image(_) => Vec::new(),
    };
    group.children().iter().flat_map(one).collect()
}

/// Returns the text of a PDF's entry that is written as UTF-16 in hexadecimal digits.
fn entry(pdf: &[u8], key: &str) -> String {
    let text = String::from_utf8_lossy(pdf);
    let (_, rest) = text.rsplit_once(&format!("{key} <FEFF")).unwrap();
    let digits = rest.split_once('>').unwrap().0.as_bytes();
    let unit = |digits: &[u8]| u16::from_str_radix(std::str::from_utf8(digits).unwrap(), 16).unwrap();
    String::from_utf16(&digits.chunks(4).map(unit).collect::<Vec<_>>()).unwrap()
}

/// A swept table over both speeds and the viscosity, with standard errors and one point that is not steady.
fn swept() -> String {
    let mut table = "# biflag sweep test, version 2 of the model's results\n# w1_rpm [rpm]: speed of flagellum 1\n\
                     # w2_rpm [rpm]: speed of flagellum 2\n# fluid_viscosity_pa_s [Pa s]: key of the robot's file, which varies\n\
                     # yaw_deg [deg]: steady yaw\nw1_rpm,w2_rpm,fluid_viscosity_pa_s,yaw_deg,pitch_deg,roll_deg,tilt_deg,yaw_se_deg,kind\n"
        .to_owned();
    for (i, w1) in [-37.5, 0.0, 12.25, 90.0].into_iter().enumerate() {
        for w2 in [0.0, 33.3, 90.0] {
            for viscosity in [0.8, 1.0, 1.25] {
                let yaw = -w1 * viscosity - w2;
                let kind = if i == 1 { "beating" } else { "steady" };
                table += &format!("{w1},{w2},{viscosity},{yaw},1,2,2.2,0.8,{kind}\n");
            }
        }
    }
    table
}

/// A fit of two parameters to a model.
fn fit() -> Fit {
    let parameter = |name: &str, unit: &str, start, value, interval_95| FittedParameter {
        name: name.to_owned(),
        key: None,
        unit: unit.to_owned(),
        start,
        value,
        std_error: 0.0,
        interval_95,
        model_error: None,
    };
    Fit {
        closure: Closure::default(),
        fitted_to: FittedTo::Simulation,
        is_described: true,
        short_of_minimum: Vec::new(),
        temperature_c: None,
        degrees_of_freedom: 10.0,
        covariance: vec![vec![0.0; 2]; 2],
        scatter_covariance: vec![vec![0.0; 2]; 2],
        lacks_correlations: false,
        parameters: vec![
            parameter("viscosity", "Pa s", 1.0, 0.851, [0.84, 0.86]),
            parameter("tether", "N m/rad", 5e-4, 6e-4, [5.9e-4, 6.1e-4]),
        ],
    }
}

/// A figure that is found in a year says how it was made, and of what.
#[test]
fn figure_says_where_it_comes_from() {
    let bench = tempfile::tempdir().unwrap();
    let folder = bench.path();
    let simulate = ["simulate", "--speeds=-37.3,12.9", "--duration", "1.5", "--out", "a & <b>"];
    assert_eq!(biflag(folder, &simulate).status.code(), Some(3), "not settled");
    let log = "a & <b>/001_w1-37.3_w2+12.9.mcap";
    let digest = Sha256::digest(std::fs::read(folder.join(log)).unwrap());
    let digest: String = digest.iter().map(|byte| format!("{byte:02x}")).collect();
    let program = String::from_utf8(biflag(folder, &["--version"]).stdout).unwrap();
    for (number, file) in ["f.svg", "f.png", "f.pdf"].into_iter().enumerate() {
        let bytes = figure(folder, &["forces", log], file);
        let text = String::from_utf8_lossy(&bytes);
        let (title, description) = match number {
            0 => {
                let between = |a: &str, b: &str| text.split_once(a).unwrap().1.split_once(b).unwrap().0.to_owned();
                let plain = |text: String| text.replace("&lt;", "<").replace("&gt;", ">").replace("&amp;", "&");
                (plain(between("<title>", "</title>")), plain(between("<desc>", "</desc>")))
            }
            1 => {
                resvg::tiny_skia::Pixmap::decode_png(&bytes).unwrap();
                let after = |key: &str| text.split_once(&format!("iTXt{key}\0\0\0\0\0")).unwrap().1.to_owned();
                (after("Title"), after("Description"))
            }
            _ => {
                // The last table of the file begins where the file says.
                let start: usize = text.rsplit_once("startxref\n").unwrap().1.lines().next().unwrap().parse().unwrap();
                assert!(bytes[start..].starts_with(b"xref\n"), "{start}");
                (entry(&bytes, "/Title"), entry(&bytes, "/Subject"))
            }
        };
        assert!(title.starts_with("Forces of both flagella in trial 001_w1-37.3_w2+12.9"), "{title}");
        let command =
            format!("biflag figure forces 'a & <b>/001_w1-37.3_w2+12.9.mcap' -o {file} --json\n{}", program.trim());
        assert!(description.starts_with(&command), "{description}");
        assert!(description.contains(&format!("log {log}, SHA-256 {digest}")), "{description}");
    }
}

#[test]
fn every_figure_has_its_width_its_letters_and_three_formats() {
    let bench = tempfile::tempdir().unwrap();
    let folder = bench.path();
    std::fs::write(folder.join("plan.toml"), PLAN).unwrap();
    std::fs::write(folder.join("thick.toml"), "[fluid]\nviscosity_pa_s = 1.3\n").unwrap();
    for (robot, out) in [("physical", "a"), ("thick.toml", "b")] {
        let code = biflag(folder, &["simulate", "plan.toml", "--robot", robot, "--out", out]).status.code();
        assert!(matches!(code, Some(0 | 3)), "{code:?}");
    }
    let shapes = ["simulate", "--speeds=50,10", "--duration", "3", "--shapes", "--out", "shapes"];
    assert_eq!(biflag(folder, &shapes).status.code(), Some(3), "not settled");
    std::fs::write(folder.join("sweep.csv"), swept()).unwrap();
    std::fs::write(folder.join("fitted.toml"), with_fit(&Robot::default(), Some(&fit()))).unwrap();
    let unfit = Fit { is_described: false, ..fit() };
    std::fs::write(folder.join("unfit.toml"), with_fit(&Robot::default(), Some(&unfit))).unwrap();
    let (a, b) = ("a/005_w1+0_w2+45.mcap", "b/005_w1+0_w2+45.mcap");
    for (args, words) in [
        (&["trial", a][..], &["Yaw ψ (°)", "Roll φ (°)", "model", "Time from the start of the run (s)"][..]),
        (&["trial", a, "--against", b, "--anyway"], &["Pitch θ (°)", "Δ (°)", "first model", "second model"]),
        (&["trial", a, "--time", "-0.5,1"], &["−0.4", "1.0"]),
        (&["forces", a], &["Force x (mN)", "Force z (mN)", "flagellum 2"]),
        (&["map", "a"], &["|ψ| (°)", "|θ| (°)", "|φ| (°)", "tilt (°)", "ω₁ (rpm)", "ω₂ (rpm)"]),
        (
            &["map", "b", "--against", "a", "--anyway"],
            &["b, in the colours of the map", "8 of 9 points hold for one starting phase of the flagella"],
        ),
        (&["map", "sweep.csv", "--at", "fluid_viscosity_pa_s=0.8"], &["tilt (°)", "fluid viscosity 0.8 Pa s"]),
        // Of several viscosities: that it is of another robot can only be warned of.
        (&["map", "a", "--against", "sweep.csv", "--anyway"], &["tilt (°)"]),
        (&["strip", "shapes/001_w1+50_w2+10.mcap", "--moments", "3"], &["0.0 s", "1.5 s", "3.0 s", "ψ 0.0°"]),
        (&["fit", "fitted.toml"], &["viscosity (Pa s)", "0.8510 (0.8400 to 0.8600)", "0.90", "tether (N m/rad)"]),
        (
            &["fit", "fitted.toml", "fitted.toml"],
            &["fitted.toml", "0.90", "Bars: 95 % intervals; open: start of the fit"],
        ),
        (&["contact", a], &["Smallest gap (mm)", "Winding (turns)", "apart", "touching", "bundled"]),
        (
            &["lines", "sweep.csv", "--by", "fluid_viscosity_pa_s", "--at", "w2_rpm=33.3"],
            &[
                "yaw, °",
                "speed of flagellum 1 (w1), rpm",
                "fluid viscosity, Pa s",
                "1.25",
                "speed of flagellum 2 (w2) 33.3 rpm",
            ],
        ),
        (
            &["lines", "sweep.csv", "--value", "tilt_deg", "--over", "fluid_viscosity_pa_s"],
            &["tilt", "fluid viscosity, Pa s"],
        ),
        (&["scatter", "a", "--against", "b", "--anyway"], &["First model yaw ψ (°)", "Second model roll φ (°)"]),
    ] {
        let svg = figure(folder, args, "figure.svg");
        let tree = tree(&svg);
        assert!((tree.size().width() - WIDTH_PT).abs() < 0.01, "{args:?}");
        let texts = texts(tree.root());
        for word in words {
            assert!(texts.iter().any(|(text, _, _)| text == word), "{args:?} lacks {word}: {texts:?}");
        }
        for (i, (text, size, place)) in texts.iter().enumerate() {
            assert!(*size >= 7.0, "{args:?}: {text} has {size} pt");
            let inside = place.left() > 0.0
                && place.top() > 0.0
                && place.right() < WIDTH_PT
                && place.bottom() < tree.size().height();
            assert!(inside, "{args:?}: {text} is cut off: {place:?}");
            for (other, _, beside) in &texts[i + 1..] {
                // Boxes of letters have some room above and below.
                let across = place.right().min(beside.right()) - place.left().max(beside.left());
                let down = place.bottom().min(beside.bottom()) - place.top().max(beside.top());
                assert!(across < 0.5 || down < 2.5, "{args:?}: {text} and {other} overlap by {across} and {down} pt");
            }
        }
        let pdf = figure(folder, args, "figure.pdf");
        assert!(pdf.starts_with(b"%PDF-"));
        let has = |needle: &str| pdf.windows(needle.len()).any(|window| window == needle.as_bytes());
        assert!(has("+LiberationSans") && has("/FontFile2"), "the font is inside");
        let png = figure(folder, args, "figure.png");
        assert!(png.starts_with(b"\x89PNG"));
        assert_eq!(u32::from_be_bytes(png[16..20].try_into().unwrap()), 2079, "600 dpi");
    }
    // Three curves with their bands, four points each, those that are not steady empty.
    let lines = figure(folder, &["lines", "sweep.csv", "--by", "fluid_viscosity_pa_s"], "lines.svg");
    let lines = String::from_utf8(lines).unwrap();
    let count = |part: &str| lines.matches(part).count();
    assert_eq!([count("<circle"), count("fill=\"#ffffff\" stroke"), count("fill-opacity")], [12, 3, 3]);
    assert!(lines.contains("table sweep.csv, SHA-256 "), "{lines}");
    let wide = tree(&figure(folder, &["map", "a", "--width-mm", "180"], "wide.svg"));
    assert!((wide.size().width() - WIDTH_PT * 180.0 / 88.0).abs() < 0.01);

    let doubtful = biflag(folder, &["figure", "fit", "fitted.toml", "unfit.toml", "-o", "fits.svg"]);
    assert_eq!(doubtful.status.code(), Some(3));
    let said = String::from_utf8(doubtful.stderr).unwrap();
    assert!(said.contains("unfit.toml: tether: the model does not describe the trials"), "{said}");
    assert!(!said.contains(" fitted.toml"), "{said}");
    let fits = std::fs::read_to_string(folder.join("fits.svg")).unwrap();
    assert_eq!(fits.matches("stroke-dasharray").count(), 2, "the intervals of the second fit");

    for (args, message) in [
        (&["fit", "thick.toml", "-o", "x.svg"][..], "has no fit"),
        (&["trial", a, "-o", "figure.jpg"], "the name must end with .svg, .pdf or .png"),
        (&["trial", a, "--time", "3,1", "-o", "x.svg"], "the earlier one first"),
        (&["trial", a, "--width-mm", "5", "-o", "x.svg"], "give millimetres, 60 to 400"),
        (&["trial", a, "--time", "100,110", "-o", "x.svg"], "nothing to draw"),
        (&["forces", a, "--time", "100,110", "-o", "x.svg"], "nothing to draw"),
        (&["contact", a, "--time", "100,110", "-o", "x.svg"], "nothing to draw"),
        (&["lines", "sweep.csv", "--at", "w1_rpm=0", "-o", "x.svg"], "w1_rpm has no single value"),
        (
            &["lines", "sweep.csv", "--at", "w2_rpm=34", "-o", "x.svg"],
            "no point has w2_rpm = 34; the sweep has 0, 33.3, 90",
        ),
        (&["lines", "sweep.csv", "--by", "w1_rpm", "-o", "x.svg"], "cannot be the axis and tell the curves apart"),
        (&["lines", "sweep.csv", "--at", "w2_rpm=0", "--at", "w2_rpm=90", "-o", "x.svg"], "w2_rpm is given twice"),
        (&["lines", "sweep.csv", "--over", "yaw_deg", "-o", "x.svg"], "yaw_deg is no input of the sweep"),
        (&["lines", "a", "-o", "x.svg"], "is no sweep"),
        (&["trial", a, "--against", b, "-o", "x.svg"], "the robots differ: fluid.viscosity_pa_s is"),
        (&["map", "a", "--against", "b", "-o", "x.svg"], "the robots differ: fluid.viscosity_pa_s is"),
        (
            &["map", "a", "--against", "sweep.csv", "-o", "x.svg"],
            "a sweep of several robots, here at fluid_viscosity_pa_s=",
        ),
    ] {
        let output = biflag(folder, &[&["figure"], args].concat());
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{text}");
        assert!(text.contains(message), "{text}");
        assert!(!folder.join("x.svg").exists());
    }
}
