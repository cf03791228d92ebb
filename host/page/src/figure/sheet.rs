//! A sheet of paper to draw on, as SVG. Lengths are in points of 1/72 inch, y points down.

use maud::{Markup, PreEscaped, html};

/// Points per millimetre.
pub(super) const MM: f64 = 72.0 / 25.4;

/// Size of all text, pt: journals ask for 7 at least in the printed width.
pub(super) const FONT_PT: f64 = 7.0;

/// The font of a figure, and its substitutes in viewers of SVG: all have the widths of Arial.
const FONT: &str = "Liberation Sans, Arial, Helvetica, sans-serif";

pub(super) const INK: &str = "#1c2329";
pub(super) const GRID: &str = "#dfe3e6";
/// The colours of Okabe and Ito, which are distinct for any colour vision; curves also differ in their dashes.
pub(super) const MEASURED: &str = "#0072b2";
pub(super) const MODEL: &str = "#d55e00";
pub(super) const FLAGELLA: [&str; 2] = ["#cc79a7", "#009e73"];

/// A line's look: colour, width in pt, and dashes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stroke<'a>(pub &'a str, pub f64, pub &'static str);

/// A sheet of a fixed width, as high as its content.
#[derive(Debug)]
pub(super) struct Sheet {
    pub width: f64,
    body: String,
}

impl Sheet {
    /// Creates an empty sheet.
    pub fn new(width_mm: f64) -> Self {
        Self { width: width_mm * MM, body: String::new() }
    }

    fn add(&mut self, element: &Markup) {
        self.body += &element.0;
    }

    /// Writes a text whose baseline is at `y`. `anchor`: its point at `x`, by SVG's names `start`, `middle` and `end`.
    pub fn text(&mut self, x: f64, y: f64, anchor: &str, text: &str) {
        self.add(&html! { text x=(short(x)) y=(short(y)) text-anchor=(anchor) { (text) } });
    }

    /// Writes a text, centred, that is legible on any colour.
    pub fn haloed(&mut self, x: f64, y: f64, text: &str) {
        self.add(&html! {
            text x=(short(x)) y=(short(y)) text-anchor="middle" stroke="#ffffff" stroke-width="1.6" stroke-linejoin="round"
                paint-order="stroke" { (text) }
        });
    }

    /// Writes a text from bottom to top, centred at a point of its baseline.
    pub fn upright(&mut self, x: f64, y: f64, text: &str) {
        self.add(&html! { text transform={ "translate(" (short(x)) " " (short(y)) ") rotate(-90)" } text-anchor="middle" { (text) } });
    }

    /// Draws a path.
    pub fn path(&mut self, d: &str, Stroke(colour, width, dashes): Stroke) {
        let dashes = Some(dashes).filter(|dashes| !dashes.is_empty());
        self.add(&html! {
            path d=(d) fill="none" stroke=(colour) stroke-width=(width) stroke-dasharray=[dashes] stroke-linejoin="round" {}
        });
    }

    /// Draws a straight rod with a dark rim along its sides.
    pub fn rod(&mut self, ends: [[f64; 2]; 2], width: f64, is_round: bool, [r, g, b]: [u8; 3]) {
        let d = straight(ends);
        let cap = if is_round { "round" } else { "butt" };
        let rim = format!("#{:02x}{:02x}{:02x}", r / 3, g / 3, b / 3);
        let colour = format!("#{r:02x}{g:02x}{b:02x}");
        self.add(&html! {
            path d=(d) stroke=(rim) stroke-width=(short(width + 0.3)) {}
            path d=(d) stroke=(colour) stroke-width=(short(width)) stroke-linecap=(cap) {}
        });
    }

    /// Fills a path.
    pub fn fill(&mut self, d: &str, colour: &str, opacity: f64) {
        let opacity = Some(opacity).filter(|opacity| *opacity < 1.0);
        self.add(&html! { path d=(d) fill=(colour) fill-opacity=[opacity] {} });
    }

    /// Fills a rectangle.
    pub fn rect(&mut self, [x, y]: [f64; 2], [width, height]: [f64; 2], colour: &str) {
        self.add(
            &html! { rect x=(short(x)) y=(short(y)) width=(short(width)) height=(short(height)) fill=(colour) {} },
        );
    }

    /// Draws a disc with a rim.
    pub fn dot(&mut self, [x, y]: [f64; 2], radius: f64, fill: &str, Stroke(rim, width, _): Stroke) {
        self.add(
            &html! { circle cx=(short(x)) cy=(short(y)) r=(radius) fill=(fill) stroke=(rim) stroke-width=(width) {} },
        );
    }

    /// Draws what `draw` adds within a rectangle only.
    pub fn clipped(&mut self, [x, y]: [f64; 2], [width, height]: [f64; 2], draw: impl FnOnce(&mut Self)) {
        let [x, y, width, height] = [x, y, width, height].map(short);
        // A page may have several figures, and browsers take the first of equal ids.
        let id = format!("clip_{x}_{y}_{width}_{height}");
        if !self.body.contains(&format!("id=\"{id}\"")) {
            self.add(&html! { clipPath id=(id) { rect x=(x) y=(y) width=(width) height=(height) {} } });
        }
        self.body += &format!("<g clip-path=\"url(#{id})\">");
        draw(self);
        self.body += "</g>";
    }

    /// Draws a legend in one line from `x` on: a line and a name for each entry.
    pub fn legend(&mut self, x: f64, y: f64, entries: &[(Stroke, &str)]) {
        let mut x = x;
        for (stroke, name) in entries {
            self.path(&format!("M{} {}h14", short(x), short(y - 0.35 * FONT_PT)), *stroke);
            self.text(x + 17.0, y, "start", name);
            x += 24.0 + 0.52 * FONT_PT * name.chars().count() as f64;
        }
    }

    /// Returns the SVG.
    pub fn svg(&self, height: f64) -> String {
        let (width, height) = (short(self.width), short(height));
        let [width_mm, height_mm] = [&width, &height].map(|pt| pt.parse::<f64>().map_or(0.0, |pt| pt / MM));
        html! {
            svg xmlns="http://www.w3.org/2000/svg" width=(format!("{width_mm:.3}mm")) height=(format!("{height_mm:.3}mm"))
                viewBox={ "0 0 " (width) " " (height) } font-family=(FONT) font-size=(FONT_PT) fill=(INK) {
                rect width=(width) height=(height) fill="#ffffff" {}
                (PreEscaped(&self.body))
            }
        }
        .into_string()
    }
}

/// Returns the path of a straight line between two points.
pub(super) fn straight([[x1, y1], [x2, y2]]: [[f64; 2]; 2]) -> String {
    format!("M{} {}L{} {}", short(x1), short(y1), short(x2), short(y2))
}

/// Returns a coordinate to a hundredth of a point.
pub(super) fn short(value: f64) -> String {
    format!("{}", (value * 100.0).round() / 100.0)
}
