//! Viridis (van der Walt and Smith, matplotlib): a scale of colours that is even in lightness, for any colour vision.

/// The scale in eleven steps.
const STEPS: [u32; 11] =
    [0x440154, 0x482475, 0x414487, 0x355f8d, 0x2a788e, 0x21918c, 0x22a884, 0x44bf70, 0x7ad151, 0xbddf26, 0xfde725];

/// Returns the colour of a share of the scale from 0 to 1; grey for a missing value.
pub fn colour(share: f64) -> String {
    if !share.is_finite() {
        return "#999999".to_owned();
    }
    let place = share.clamp(0.0, 1.0) * (STEPS.len() - 1) as f64;
    let i = (place as usize).min(STEPS.len() - 2);
    let mix = |shift: u32| {
        let [a, b] = [STEPS[i], STEPS[i + 1]].map(|step| f64::from(step >> shift & 0xff));
        (a + (b - a) * (place - i as f64)).round() as u8
    };
    format!("#{:02x}{:02x}{:02x}", mix(16), mix(8), mix(0))
}
