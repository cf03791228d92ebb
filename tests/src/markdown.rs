//! The parts of a Markdown page that the tests need: its links, its anchors, and its code.

use pulldown_cmark::{CodeBlockKind, Event, Options, Parser, Tag, TagEnd};
use std::collections::{HashMap, HashSet};

/// A Markdown page.
#[derive(Debug, Default)]
pub struct Page {
    /// The targets of its links and images.
    pub links: Vec<String>,
    /// The anchors of its headings, without `#`.
    pub anchors: HashSet<String>,
    /// Its blocks of code.
    pub code: Vec<Code>,
}

/// A block of code.
#[derive(Debug)]
pub struct Code {
    /// The language, such as `sh`.
    pub language: String,
    /// The file that the comment before the block names: `<!-- file: plan.toml -->`.
    pub file: Option<String>,
    /// The code.
    pub text: String,
}

impl Page {
    /// Reads a page.
    pub fn parse(text: &str) -> Self {
        let mut page = Self::default();
        let (mut heading, mut code, mut file) = (None::<String>, None::<Code>, None);
        let mut counts = HashMap::new();
        for event in Parser::new_ext(text, Options::ENABLE_TABLES) {
            match event {
                Event::Start(Tag::Link { dest_url, .. } | Tag::Image { dest_url, .. }) => {
                    page.links.push(dest_url.to_string());
                }
                Event::Start(Tag::Heading { .. }) => heading = Some(String::new()),
                Event::End(TagEnd::Heading(_)) => {
                    page.anchors.insert(anchor(&heading.take().unwrap_or_default(), &mut counts));
                }
                Event::Start(Tag::CodeBlock(kind)) => {
                    let language = match kind {
                        CodeBlockKind::Fenced(language) => language.to_string(),
                        CodeBlockKind::Indented => String::new(),
                    };
                    code = Some(Code { language, file: file.take(), text: String::new() });
                }
                Event::End(TagEnd::CodeBlock) => page.code.extend(code.take()),
                Event::Html(html) => {
                    let name = html.trim().strip_prefix("<!-- file: ").and_then(|rest| rest.strip_suffix(" -->"));
                    file = name.map(str::to_owned).or(file);
                }
                Event::Text(text) | Event::Code(text) => match (&mut code, &mut heading) {
                    (Some(code), _) => code.text += &text,
                    (None, Some(heading)) => *heading += &text,
                    (None, None) => {}
                },
                _ => {}
            }
        }
        page
    }
}

/// Returns the anchor that mdBook and GitHub give a heading: lower case, words joined by `-`, a number after a repeated one.
fn anchor(heading: &str, counts: &mut HashMap<String, usize>) -> String {
    let kept: String =
        heading.to_lowercase().chars().filter(|c| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_')).collect();
    let name = str::replace(&kept, ' ', "-");
    let count = counts.entry(name.clone()).or_default();
    *count += 1;
    if *count == 1 { name } else { format!("{name}-{}", *count - 1) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn links_anchors_and_code_are_found() {
        let text = "# A plan, `in` short\n\n# A plan, in short\n\n[one](a.md#b) ![two](c.svg) `[three](d.md)`\n\n\
                    <!-- file: p.toml -->\n```toml\nx = 1\n```\n\n```sh\nbiflag info\n[four](e.md)\n```\n";
        let page = Page::parse(text);
        assert_eq!(page.links, ["a.md#b", "c.svg"]);
        assert_eq!(page.anchors, HashSet::from(["a-plan-in-short".to_owned(), "a-plan-in-short-1".to_owned()]));
        assert_eq!((page.code[0].file.as_deref(), page.code[0].text.as_str()), (Some("p.toml"), "x = 1\n"));
        assert_eq!((page.code[1].file.as_deref(), page.code[1].language.as_str()), (None, "sh"));
    }
}
