//! The HTML document of a page: its head, styles and scripts. All of it is in the file; nothing is fetched.

use maud::{DOCTYPE, Markup, PreEscaped, html};
use study::secret::secret;

/// The generator named in the head of every page, by which a page is recognised.
pub(super) const GENERATOR: &str = concat!("biflag ", env!("CARGO_PKG_VERSION"));

const STYLE: [&str; 2] = [include_str!("assets/uPlot.min.css"), include_str!("assets/page.css")];

/// Scripts that draw a trial: charts and the robot.
const DRAWING: [&str; 12] = [
    include_str!("assets/sharp.js"),
    include_str!("assets/uPlot.iife.min.js"),
    include_str!("assets/data.js"),
    include_str!("assets/charts.js"),
    include_str!("assets/chart.js"),
    include_str!("assets/ribbon.js"),
    include_str!("assets/gl.js"),
    include_str!("assets/mesh.js"),
    include_str!("assets/tank.js"),
    include_str!("assets/robot.js"),
    include_str!("assets/hand.js"),
    include_str!("assets/scene.js"),
];

/// Scripts that are only on pages of completed trials.
const REPORT: [&str; 9] = [
    include_str!("assets/address.js"),
    include_str!("assets/save.js"),
    include_str!("assets/film.js"),
    include_str!("assets/rove.js"),
    include_str!("assets/player.js"),
    include_str!("assets/trial.js"),
    include_str!("assets/swept.js"),
    include_str!("assets/sweep.js"),
    include_str!("assets/page.js"),
];

/// Scripts that are only on the page of a running recording.
const LIVE: [&str; 1] = [include_str!("assets/live.js")];

/// Returns a page. `kind` is the class of its body, `data` the elements that the scripts read.
///
/// maud escapes every text. As a second defence, the content security policy only runs scripts with a nonce that the
/// author of a log cannot know, and blocks all network access. It allows images from `blob:`, which the page needs to
/// save a chart as PNG.
pub(super) fn page(title: &str, kind: &str, body: &Markup, data: &Markup) -> Markup {
    document(title, kind, body, data, &REPORT, "")
}

/// Returns the page of a running recording, which may send requests to the program that serves it.
pub(super) fn live(title: &str, body: &Markup, data: &Markup) -> Markup {
    document(title, "one live", body, data, &LIVE, " connect-src 'self';")
}

fn document(title: &str, kind: &str, body: &Markup, data: &Markup, scripts: &[&str], more: &str) -> Markup {
    let nonce = secret();
    let policy = format!(
        "default-src 'none'; script-src 'nonce-{nonce}'; style-src 'unsafe-inline'; img-src blob:;{more} \
         base-uri 'none'; form-action 'none'"
    );
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="generator" content=(GENERATOR);
                meta http-equiv="Content-Security-Policy" content=(policy);
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { (title) }
                @for style in STYLE { style { (PreEscaped(style)) } }
            }
            body class=(kind) {
                (body)
                (data)
                @for script in DRAWING.iter().chain(scripts) { script nonce=(nonce) { (PreEscaped(script)) } }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_of_the_page_ends_its_own_script_or_style_or_names_a_server() {
        for script in DRAWING.iter().chain(&REPORT).chain(&LIVE) {
            assert!(!script.contains("</script") && !script.contains("<!--"));
        }
        for script in DRAWING.iter().chain(&REPORT) {
            assert!(!script.contains("fetch(") && !script.contains("XMLHttpRequest") && !script.contains("import("));
        }
        assert!(STYLE.iter().all(|style| !style.contains("</style") && !style.contains("url(")));
    }
}
