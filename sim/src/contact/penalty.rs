//! The smooth contact energy of the implicit contact model, its definition of contact.
//!
//! With the distance D and lengths in rod radii, K = 15 r/delta: E = [ln(1 + exp(K (2 - D)))/K]^2,
//! quadratic (2 - D)^2 below 2 - delta/r and zero above 2 + delta/r (Tong et al. 2023).

/// Energy (in squares of the rod radius) and its derivative with respect to the scaled distance.
///
/// `distance` and `tolerance` in rod radii.
pub fn energy(distance: f64, tolerance: f64) -> (f64, f64) {
    let overlap = 2.0 - distance;
    if overlap > tolerance {
        return (overlap * overlap, -2.0 * overlap);
    }
    if overlap < -tolerance {
        return (0.0, 0.0);
    }
    let sharpness = 15.0 / tolerance;
    let grown = (sharpness * overlap).exp();
    let soft = grown.ln_1p() / sharpness;
    (soft * soft, -2.0 * soft * grown / (1.0 + grown))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn branches_meet_and_the_derivative_is_one() {
        let delta = 0.01;
        for at in [2.0 - delta, 2.0 + delta] {
            let (below, above) = (energy(at - 1e-12, delta), energy(at + 1e-12, delta));
            assert!((below.0 - above.0).abs() < 1e-6 * delta * delta);
            assert!((below.1 - above.1).abs() < 1e-5 * delta);
        }
        for distance in [1.985, 1.995, 2.0, 2.004, 2.02] {
            let h = 1e-7;
            let difference = (energy(distance + h, delta).0 - energy(distance - h, delta).0) / (2.0 * h);
            assert!((difference - energy(distance, delta).1).abs() < 1e-8);
        }
    }

    #[test]
    fn the_multiplier_law_is_its_limit() {
        // Force over stiffness against overlap: the two differ by less than the tolerance everywhere.
        let delta = 1e-2;
        for i in -300..300 {
            let overlap = i as f64 * 1e-4;
            let force = -0.5 * energy(2.0 - overlap, delta).1;
            assert!((force - overlap.max(0.0)).abs() < 0.1 * delta);
        }
    }
}
