//! The HTML document of a page: its head, styles and scripts. All of it is in the file; nothing is fetched.

use maud::{DOCTYPE, Markup, PreEscaped, html};
use std::hash::{BuildHasher, Hasher, RandomState};

/// The generator named in the head of every page, by which a page is recognised.
pub(super) const GENERATOR: &str = concat!("biflag ", env!("CARGO_PKG_VERSION"));

const STYLE: [&str; 2] = [include_str!("assets/uPlot.min.css"), include_str!("assets/page.css")];

const SCRIPTS: [&str; 14] = [
    include_str!("assets/sharp.js"),
    include_str!("assets/uPlot.iife.min.js"),
    include_str!("assets/data.js"),
    include_str!("assets/charts.js"),
    include_str!("assets/chart.js"),
    include_str!("assets/gl.js"),
    include_str!("assets/mesh.js"),
    include_str!("assets/robot.js"),
    include_str!("assets/scene.js"),
    include_str!("assets/address.js"),
    include_str!("assets/save.js"),
    include_str!("assets/player.js"),
    include_str!("assets/sweep.js"),
    include_str!("assets/page.js"),
];

/// Returns a page. `kind` is the class of its body, `data` the elements that the scripts read.
///
/// maud escapes every text. As a second defence, the content security policy only runs scripts with a nonce that the
/// author of a log cannot know, and blocks all network access. It allows images from `blob:`, which the page needs to
/// save a chart as PNG.
pub(super) fn page(title: &str, kind: &str, body: &Markup, data: &Markup) -> Markup {
    let nonce = nonce();
    let policy = format!(
        "default-src 'none'; script-src 'nonce-{nonce}'; style-src 'unsafe-inline'; img-src blob:; base-uri 'none'; \
         form-action 'none'"
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
                @for script in SCRIPTS { script nonce=(nonce) { (PreEscaped(script)) } }
            }
        }
    }
}

/// A number that cannot be guessed: the keys of a hasher come from the system's random numbers.
fn nonce() -> String {
    let part = || RandomState::new().build_hasher().finish();
    format!("{:016x}{:016x}", part(), part())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_of_the_page_ends_its_own_script_or_style_or_names_a_server() {
        for script in SCRIPTS {
            assert!(!script.contains("</script") && !script.contains("<!--"));
            assert!(!script.contains("fetch(") && !script.contains("XMLHttpRequest") && !script.contains("import("));
        }
        assert!(STYLE.iter().all(|style| !style.contains("</style") && !style.contains("url(")));
        assert_ne!(nonce(), nonce());
    }
}
