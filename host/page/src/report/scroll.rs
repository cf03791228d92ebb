//! Tables that may be wider than the page, which then scroll on their own.

use maud::{Markup, html};

/// Returns a table of facts with these heads. `label`: its description for screen readers.
pub(super) fn scrolled(label: &str, heads: &[&str], body: &Markup) -> Markup {
    html! {
        div.scroll tabindex="0" role="region" aria-label=(label) {
            table.facts {
                thead { tr { @for head in heads { th scope="col" { (head) } } } }
                tbody { (body) }
            }
        }
    }
}
