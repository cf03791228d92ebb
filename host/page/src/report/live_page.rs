//! The page of a running recording: the robot, its curves so far, and the trials of the session.
//!
//! The recording program serves the page, which requests updates from it. Its parts are those of the report.

use super::heat_map::{self, Map, Point};
use super::session_page::MAPS;
use super::stage::{SPEEDS, looks, values, zoom};
use super::text::{clip, count, json_for_script};
use super::trial_section::{Entry, chart, speed_entries};
use super::{curves, document, ribbon};
use maud::{Markup, PreEscaped, html};
use serde_json::json;
use sim::params::Robot;
use study::attitude::Columns;
use study::plan::Plan;
use study::text::printable;
use study::trial::{AtSpeeds, Shapes, mean_of_repeats};

/// Returns the page of a session of `trials` trials.
pub fn live_page(plan: &Plan, trials: usize) -> String {
    let robot: Robot = plan.robot.parse().unwrap_or_default();
    let has_tank = robot.tank.is_some();
    let robot = curves::drawn(&robot, 0.0, &Columns::default(), &Shapes::new(1), 0);
    let data = json!({ "robots": [robot], "own": "measured", "phases": [], "marks": [] });
    let name = clip(&plan.name, 200);
    let body = html! {
        main {
            section.trial #trial data-data="trial-data" data-waiting="Waiting for the board" {
                nav.tools aria-label="Recording" {
                    span.now role="status" { "Recording" }
                    input.note type="text" maxlength="200" placeholder="Note, Enter" aria-label="Note for the log of the trial that runs";
                    button.stop type="button" { "Stop" }
                }
                h1 { "Waiting for the board" }
                p.meta { span { "session " (name) } span { (count(trials, "trial", "trials")) } span { "robot " (clip(&plan.robot.name, 200)) } }
                div.bench {
                    div.stage { (scene(has_tank)) (readout()) }
                    div.charts {
                        h2.unseen { "Over time" }
                        (ribbon::figure(&data))
                        @for (name, title) in [("yaw", "Yaw ψ from the start of the run, ° counter-clockwise"), ("pitch", "Pitch θ, °"), ("roll", "Roll φ, °")] {
                            (chart(&[name], title, &[Entry::new("c-measured", "measured", "own")]))
                        }
                        (chart(&["motors"], "Speed of the flagella, rpm", &speed_entries()))
                        p.meta.small { "Twenty values a second, as the board says them. The drift of the gyroscope is removed when a trial ends." }
                    }
                }
                h2 { "Trials" }
                div.scroll tabindex="0" role="region" aria-label="Table of the trials" {
                    table.trials #trials {
                        thead { tr {
                            @for head in ["Trial", "w1, rpm", "w2, rpm", "ψ, °", "θ, °", "φ, °", "lost"] { th scope="col" { (head) } }
                            th.text scope="col" { "Notes" }
                        } }
                        tbody {}
                    }
                }
                div.maps {}
            }
        }
    };
    let data = html! { script type="application/json" id="trial-data" { (PreEscaped(json_for_script(&data))) } };
    printable(&document::live(&format!("Recording {name}"), &body, &data).0)
}

fn scene(has_tank: bool) -> Markup {
    html! {
        figure.scene {
            canvas.view3d tabindex="0" role="img"
                aria-label="The robot now: base, motors and both flagella. Arrow keys rotate the view, plus and minus zoom, Home resets it." {}
            div.tools role="group" aria-label="View" {
                (looks(has_tank))
                (zoom())
            }
            figcaption { "The measured attitude, from the start of the run on without the tilt at rest. The flagella are drawn as rigid helices that turn with their shafts." }
        }
    }
}

fn readout() -> Markup {
    let angles = [("Yaw ψ, °", "yaw 1"), ("Pitch θ, °", "pitch 2"), ("Roll φ, °", "roll 2")];
    let angles = angles.map(|(name, column)| (name, "", vec![Some(format!("attitude {column}"))]));
    let speeds = SPEEDS.map(|(name, key, column)| (name, key, vec![Some(format!("motors {column} 1"))]));
    values(&["measured"], &[&angles[..], &speeds].concat())
}

/// Returns the maps of yaw and pitch over both speeds, from each trial's speeds (rpm) and its angles (degrees), if it has them.
/// Pairs without angles have empty cells. Few pairs make no map.
pub fn live_maps(trials: &[([f64; 2], Option<[f64; 3]>)]) -> String {
    let trial = |(speeds_rpm, angles_deg): &([f64; 2], Option<[f64; 3]>)| {
        Some(AtSpeeds::of_trial(*speeds_rpm, (*angles_deg)?, true, ()))
    };
    let means = mean_of_repeats(trials.iter().filter_map(trial));
    let maps = MAPS.into_iter().take(2).map(|(i, name, symbol)| {
        let point = |(speeds_rpm, _): &([f64; 2], Option<[f64; 3]>)| {
            let mean = means.iter().find(|mean| mean.speeds_rpm == *speeds_rpm);
            let value_deg = mean.map_or(f64::NAN, |mean| mean.magnitudes_deg()[i]);
            Point { speeds_rpm: *speeds_rpm, value_deg, is_settled: true, anchor: None }
        };
        let points: Vec<Point> = trials.iter().map(point).collect();
        let (title, scale_deg) = (format!("{name} {symbol}"), heat_map::largest(&points));
        let map = Map { title: &title, symbol, points: &points, scale_deg };
        html! { @if heat_map::is_map(&points) { figure { div.head { h3 { (title) } } (map.svg()) } } }
    });
    maps.map(|map| map.0).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use study::plan::RobotFile;

    #[test]
    fn the_page_may_ask_its_own_program_only_and_escapes_the_plan() {
        let plan = Plan::of_speeds([protocol::units::CentiRpm(5000); 2], "run = 10", "").unwrap();
        let plan = Plan { name: "<script>alert(1)</script>".into(), ..plan };
        let page = live_page(&plan, 3);
        assert!(page.contains("connect-src 'self'; base-uri 'none'") && page.contains("new biflag.LiveTrial"));
        assert!(!page.contains("<script>alert") && page.contains("&lt;script&gt;alert") && page.contains("3 trials"));
        // Only a robot in a tank has a view of the tank.
        let text = include_str!("../../../plans/robot-tank.toml").to_owned();
        let in_tank = Plan { robot: RobotFile { name: "robot-tank.toml".to_owned(), text }, ..plan };
        let has_view = |page: &str| page.contains(r#"data-look="tank""#);
        assert!(!has_view(&page) && has_view(&live_page(&in_tank, 3)) && page.contains(r#"data-look="top""#));
        // The scene needs both helices at rest.
        assert!(page.contains(r#""rigid":true"#) && page.contains(r#""nodes":50"#));
    }

    #[test]
    fn maps_fill_cell_by_cell() {
        let grid = |measured: usize| -> Vec<_> {
            let speeds = (0..6).map(|i| [f64::from(i % 3) * 10.0, f64::from(i / 3) * 10.0]);
            speeds
                .enumerate()
                .map(|(i, speeds)| (speeds, (i < measured).then_some([-3.0 * i as f64, 1.0, 0.0])))
                .collect()
        };
        let cells = |measured: usize| live_maps(&grid(measured)).matches("data-at").count();
        assert_eq!([cells(0), cells(4), cells(6)], [0, 8, 12]);
        assert!(live_maps(&grid(6)).contains("w1 20, w2 10 rpm: 15.00°"));
        assert_eq!(live_maps(&grid(6)[..4]), "");
        // A repeat counts with its sign.
        let repeated: Vec<_> = grid(6).into_iter().chain([([20.0, 10.0], Some([45.0, 1.0, 0.0]))]).collect();
        assert!(
            live_maps(&repeated).contains("w1 20, w2 10 rpm: 15.00°")
                && live_maps(&repeated).contains("w1 10, w2 10 rpm: 12.00°")
        );
    }
}
