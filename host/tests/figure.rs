//! End-to-end tests of `figure`: files, formats, sizes on paper, and errors.

use resvg::usvg::{self, Node, Rect};
use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output};
use std::sync::Arc;

const PLAN: &str = "[session]\nname = \"short\"\n[trial]\ncalibrate = 0\npreroll = 0.5\nrun = 2\ndecay = 0.5\n\
                    [speeds]\ngrid = { w1 = [-90, 90, 90], w2 = [0, 90, 45] }\n";

const WIDTH_PT: f32 = 88.0 * 72.0 / 25.4;

fn biflag(folder: &Path, args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_biflag")).current_dir(folder).args(args).output().unwrap()
}

/// Runs `biflag figure`, which must succeed; returns the file.
fn figure(folder: &Path, args: &[&str], file: &str) -> Vec<u8> {
    let output = biflag(folder, &[&["figure"], args, &["-o", file, "--json"]].concat());
    // The robots differ, which the figure says as `compare` does.
    let code = if args.contains(&"--anyway") { 3 } else { 0 };
    assert_eq!(output.status.code(), Some(code), "{}", String::from_utf8_lossy(&output.stderr));
    let answer: Value = serde_json::from_slice(&output.stdout).unwrap();
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
    let (a, b) = ("a/005_w1+0_w2+45.mcap", "b/005_w1+0_w2+45.mcap");
    for (args, words) in [
        (&["trial", a][..], &["Yaw ψ (°)", "Roll φ (°)", "model", "Time from the start of the run (s)"][..]),
        (&["trial", a, "--against", b, "--anyway"], &["Pitch θ (°)", "Δ (°)", "first model", "second model"]),
        (&["trial", a, "--time", "-0.5,1"], &["−0.4", "1.0"]),
        (&["forces", a], &["Force x (mN)", "Force z (mN)", "flagellum 2"]),
        (&["map", "a"], &["|ψ| (°)", "|θ| (°)", "|φ| (°)", "tilt (°)", "ω₁ (rpm)", "ω₂ (rpm)"]),
        (&["map", "a", "--against", "b"], &["tilt (°)"]),
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
    let wide = tree(&figure(folder, &["map", "a", "--width-mm", "180"], "wide.svg"));
    assert!((wide.size().width() - WIDTH_PT * 180.0 / 88.0).abs() < 0.01);

    for (args, message) in [
        (&["trial", a, "-o", "figure.jpg"][..], "no format ends like this"),
        (&["trial", a, "--time", "3,1", "-o", "x.svg"], "the earlier one first"),
        (&["trial", a, "--width-mm", "5", "-o", "x.svg"], "between 60 and 400 mm"),
        (&["trial", a, "--time", "100,110", "-o", "x.svg"], "nothing to draw"),
        (&["forces", a, "--time", "100,110", "-o", "x.svg"], "nothing to draw"),
    ] {
        let output = biflag(folder, &[&["figure"], args].concat());
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{text}");
        assert!(text.contains(message), "{text}");
        assert!(!folder.join("x.svg").exists());
    }
}
