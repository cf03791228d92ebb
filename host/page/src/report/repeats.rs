//! The scatter of repeats beside their budget: a table and bars.

use super::text::{degrees, number, plain, short};
use maud::{Markup, html};
use study::text::capitalised;
use study::trial::{Judgement, Repeats, Scatter};

const WIDTH: f64 = 430.0;
/// Width of the labels with the speeds.
const LEFT: f64 = 96.0;
/// Width of the values to the right of the bars.
const RIGHT: f64 = 62.0;
const TOP: f64 = 6.0;
const ROW: f64 = 24.0;
const BAR: f64 = 10.0;

const ANGLES: [(&str, &str); 3] = [("yaw", "ψ"), ("pitch", "θ"), ("roll", "φ")];

/// Returns the section about repeats; nothing without them.
pub(super) fn section(repeats: &[Repeats]) -> Markup {
    html! {
        @if repeats.iter().any(|set| !set.angles.is_empty()) {
            h2 { "Scatter of repeats" }
            p.meta {
                "Standard deviation of the steady angles between trials at the same speeds (bar), beside the standard \
                 uncertainty of one trial (tick), without errors that all trials of the sensor have in common. The line is \
                 what 95 of 100 sets of so few repeats have if that budget is right."
            }
            (table(repeats))
            div.maps {
                @for (angle, symbol) in ANGLES {
                    @let rows: Vec<(&Repeats, &Scatter)> = rows(repeats, angle);
                    @if !rows.is_empty() {
                        @let title = format!("Scatter of the {angle} {symbol}, °");
                        figure { div.head { h3 { (title) } } (bars(&rows, &title)) }
                    }
                }
            }
        }
    }
}

fn rows<'a>(repeats: &'a [Repeats], angle: &str) -> Vec<(&'a Repeats, &'a Scatter)> {
    let of = |set: &'a Repeats| Some((set, set.angles.iter().find(|one| one.angle == angle)?));
    repeats.iter().filter_map(of).collect()
}

fn table(repeats: &[Repeats]) -> Markup {
    html! {
        div.scroll tabindex="0" role="region" aria-label="Scatter of repeats" {
            table.facts.repeats {
                thead { tr {
                    th scope="col" { "Speeds" } th scope="col" { "Trials" } th scope="col" { "Angle" }
                    th scope="col" { "Scatter" } th scope="col" { "Budget" } th scope="col" { "By chance" } th scope="col" { "Judgement" }
                } }
                tbody { @for set in repeats { @for one in &set.angles {
                    tr {
                        td { (set.speeds()) } td { (set.trials.len()) } td { (one.angle) }
                        td.number { (degrees(one.scatter_deg, 2)) } td.number { (degrees(one.budget_deg, 2)) }
                        td.number { (number(one.by_chance_deg[0], 2)) " to " (degrees(one.by_chance_deg[1], 2)) }
                        td { (one.remark().map_or_else(|| "as its budget says".to_owned(), |remark| capitalised(&remark))) }
                    }
                } } }
            }
        }
    }
}

/// Draws a bar for each set of repeats.
fn bars(rows: &[(&Repeats, &Scatter)], title: &str) -> Markup {
    let largest =
        rows.iter().map(|(_, one)| one.scatter_deg.max(one.by_chance_deg[1])).fold(f64::MIN_POSITIVE, f64::max);
    let x = |deg: f64| LEFT + deg / largest * (WIDTH - LEFT - RIGHT);
    let bottom = TOP + ROW * rows.len() as f64;
    html! {
        svg viewBox={ "0 0 " (WIDTH) " " (bottom + TOP) } role="group" aria-label=(title) {
            @for (i, (set, one)) in rows.iter().enumerate() {
                @let middle = TOP + (i as f64 + 0.5) * ROW;
                @let [low, high] = one.by_chance_deg.map(x);
                @let fill = if one.judgement == Judgement::AsBudget { "var(--measured)" } else { "var(--bad)" };
                @let speeds = format!("{}, {}", plain(set.w1_rpm), plain(set.w2_rpm));
                text x=(LEFT - 6.0) y=(middle + 4.0) text-anchor="end" { (speeds) " rpm" }
                rect x=(LEFT) y=(middle - 0.5 * BAR) width=(short(x(one.scatter_deg) - LEFT)) height=(BAR) fill=(fill) {
                    title { (set.speeds()) ": scatter " (degrees(one.scatter_deg, 2)) ", budget " (degrees(one.budget_deg, 2)) }
                }
                path fill="none" stroke="var(--ink)" d={
                    "M" (short(low)) " " (middle) "H" (short(high))
                    "M" (short(x(one.budget_deg))) " " (middle - 0.7 * BAR) "V" (middle + 0.7 * BAR)
                } {}
                text x=(WIDTH - RIGHT + 6.0) y=(middle + 4.0) { (degrees(one.scatter_deg, 2)) }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set(w1_rpm: f64, scatter_deg: f64, judgement: Judgement) -> Repeats {
        let yaw = Scatter { angle: "yaw", scatter_deg, budget_deg: 0.6, by_chance_deg: [0.1, 1.15], judgement };
        Repeats { w1_rpm, w2_rpm: 10.5, reverse: None, trials: vec![String::new(); 3], angles: vec![yaw] }
    }

    #[test]
    fn bars_are_as_long_as_the_scatter_and_red_beyond_the_budget() {
        let page = section(&[set(50.0, 0.8, Judgement::AsBudget), set(-60.0, 2.4, Judgement::More)]).into_string();
        let bars: Vec<&str> = page.split("<rect").skip(1).collect();
        let width =
            |bar: &str| bar.split("width=\"").nth(1).unwrap().split('"').next().unwrap().parse::<f64>().unwrap();
        assert_eq!(bars.len(), 2);
        assert!((width(bars[1]) / width(bars[0]) - 3.0).abs() < 0.01);
        assert!(!bars[0].contains("--bad") && bars[1].contains("--bad"));
        assert!(page.contains("0.80°") && page.contains("0.60°") && page.contains("as its budget says"));
        assert!(page.contains("Yaw scatters by more than") && page.contains("−60, 10.5"), "{page}");
        assert_eq!(section(&[]).into_string(), "");
    }
}
