//! Viridis (van der Walt and Smith, matplotlib): a scale of colours that is even in lightness, for any colour vision.

/// The scale in eleven steps.
const STEPS: [[u8; 3]; 11] = [
    [68, 1, 84],
    [72, 36, 117],
    [65, 68, 135],
    [53, 95, 141],
    [42, 120, 142],
    [33, 145, 140],
    [34, 168, 132],
    [68, 191, 112],
    [122, 209, 81],
    [189, 223, 38],
    [253, 231, 37],
];

/// Returns the colour of a share of the scale from 0 to 1; grey for a missing value.
pub fn colour(share: f64) -> String {
    if !share.is_finite() {
        return "#999999".to_owned();
    }
    let place = share.clamp(0.0, 1.0) * (STEPS.len() - 1) as f64;
    let i = (place as usize).min(STEPS.len() - 2);
    let mix = |k: usize| {
        let (a, b) = (f64::from(STEPS[i][k]), f64::from(STEPS[i + 1][k]));
        (a + (b - a) * (place - i as f64)).round() as u8
    };
    format!("#{:02x}{:02x}{:02x}", mix(0), mix(1), mix(2))
}
