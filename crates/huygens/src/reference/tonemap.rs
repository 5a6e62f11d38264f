//! From radiance to a display: the twin of the pass `tonemap`.

/// What automatic exposure makes of the geometric mean of the luminance (Reinhard et al. 2002).
pub(crate) const KEY: f64 = 0.18;

/// What automatic exposure keeps the arithmetic mean of the luminance below.
pub(crate) const LARGEST_MEAN: f64 = 0.4;

/// Automatic exposure, EV, for a picture of linear radiance (Rec. 709). Black does not count.
pub fn auto_exposure(linear: &[[f32; 3]]) -> f32 {
    let (mut logs, mut count, mut sum) = (0.0, 0.0, 0.0);
    for [r, g, b] in linear {
        let luminance = f64::from((0.2126 * r + 0.7152 * g + 0.0722 * b).min(1e30));
        if luminance > 0.0 {
            logs += luminance.log2();
            count += 1.0;
            sum += luminance;
        }
    }
    exposure_from_sums(logs, count, sum)
}

/// The exposure from the sum of the binary logarithms of luminance, the number of pixels and the sum of luminance.
pub(crate) fn exposure_from_sums(logs: f64, count: f64, sum: f64) -> f32 {
    if count <= 0.0 {
        return 0.0;
    }
    // Where much of the picture is nearly black, the geometric mean says nothing of what is lit.
    let (by_key, by_mean) = (KEY.log2() - logs / count, LARGEST_MEAN.log2() - (sum / count).log2());
    // The bounds are those of the command line.
    by_key.min(by_mean).clamp(-64.0, 64.0) as f32
}

/// A picture of linear radiance as a display shows it, 8-bit sRGB: exposed (EV) and tone mapped.
pub fn display(linear: &[[f32; 3]], ev: f32) -> Vec<[u8; 3]> {
    shown(linear, ev).into_iter().map(|c| c.map(|c| (c * 255.0 + 0.5) as u8)).collect()
}

/// The same before it is rounded, sRGB from 0 to 1.
pub fn shown(linear: &[[f32; 3]], ev: f32) -> Vec<[f32; 3]> {
    let scale = ev.exp2();
    linear.iter().map(|&c| pbr_neutral(c.map(|c| (c * scale).min(1e15))).map(srgb_from_linear)).collect()
}

/// Khronos PBR Neutral tone mapper (2024).
fn pbr_neutral(color: [f32; 3]) -> [f32; 3] {
    const START: f32 = 0.8 - 0.04;
    const DESATURATION: f32 = 0.15;
    let low = color.into_iter().fold(f32::INFINITY, f32::min);
    let offset = if low < 0.08 { low - 6.25 * low * low } else { 0.04 };
    let color = color.map(|c| c - offset);
    let peak = color.into_iter().fold(f32::NEG_INFINITY, f32::max);
    if peak < START {
        return color;
    }
    let d = 1.0 - START;
    let compressed = 1.0 - d * d / (peak + d - START);
    let grey = 1.0 - 1.0 / (DESATURATION * (peak - compressed) + 1.0);
    color.map(|c| c * (compressed / peak) * (1.0 - grey) + compressed * grey)
}

/// IEC 61966-2-1.
fn srgb_from_linear(c: f32) -> f32 {
    let c = c.clamp(0.0, 1.0);
    if c <= 0.003_130_8 { 12.92 * c } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 }
}
