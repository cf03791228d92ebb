//! The errors of a comparison by angle, with the parts that limit them.

use super::scroll::scrolled;
use super::text::{degrees, number};
use maud::{Markup, html};
use study::text::{signed, word};
use study::twin::{AngleComparison, Comparison};

/// Returns the table of the errors of yaw, pitch and roll.
pub(super) fn table(comparison: &Comparison) -> Markup {
    html! {
        details {
            summary { "Errors and their uncertainty" }
            (scrolled(
                "Errors and their uncertainty",
                &["", "Steady error", "± 95 %", "of it noise", "of it sensor", "Model’s own error", "Limited by", "RMS over the run", "Transient", "allowed"],
                &html! { @for angle in &comparison.angles { (line(angle)) } },
            ))
            p.meta.small {
                "The ± is the smallest difference that the trials could show. Transient: root mean square of the error before \
                 the steady end of the run, without what the steady error explains; allowed is what 95 of 100 equal trials stay \
                 below."
                @if comparison.compared_share < 0.999 {
                    " Both attitudes are known in " (number(100.0 * comparison.compared_share, 1)) " % of the run; gaps are left out."
                }
            }
        }
    }
}

fn line(angle: &AngleComparison) -> Markup {
    let known = |deg: Option<f64>| deg.map_or_else(|| "–".to_owned(), |deg| degrees(deg, 2));
    let part = |of: fn(&study::twin::Uncertainty) -> f64| known(angle.uncertainty.as_ref().map(of));
    html! {
        tr {
            th scope="row" { (angle.angle) }
            td.number { (signed(angle.error_deg, 2)) "°" }
            td.number { (part(|all| all.total_deg)) }
            td.number { (part(|all| all.noise_deg)) }
            td.number { (part(|all| all.sensor_deg)) }
            td.number { (known(angle.model_error_deg)) }
            td { (angle.limited_by.map_or_else(|| "–".to_owned(), |limit| word(&limit))) }
            td.number { (degrees(angle.rmse_deg, 2)) }
            td.number { (known(angle.transient.map(|transient| transient.residual_deg))) }
            td.number { (known(angle.transient.map(|transient| transient.allowed_deg))) }
        }
    }
}
