//! How far a picture is from another.
//!
//! FLIP (Andersson et al. 2020) and HDR-FLIP (Andersson et al. 2021) are those of `flip-rs`, with its 67 pixels per
//! degree; SSIM is that of Wang et al. 2004: of luma, in 11 × 11 windows weighted by a Gaussian of 1.5 pixels, averaged
//! over all windows within the picture.

use anyhow::Context;
use flip_rs::{DEFAULT_PPD, ErrorMap, HdrOptions, RgbImage, hdr_flip, ldr_flip};
use serde::Serialize;

/// What [`check_size`] allows.
pub const LARGEST: &str = "up to 28 million pixels";

/// Refuses pictures that are too large for `flip-rs`, which has a limit on its work.
pub fn check_size([width, height]: [u32; 2]) -> Result<(), String> {
    let pixels = u64::from(width) * u64::from(height);
    if pixels <= 28_000_000 { Ok(()) } else { Err(format!("{width}x{height} pixels are too many for FLIP")) }
}

/// Numbers about a picture against a reference.
#[derive(Clone, Debug, Serialize, PartialEq)]
pub struct Metrics {
    /// Mean FLIP of the tone-mapped pictures at one exposure, 0…1; lower is better.
    pub flip: f64,
    /// Mean HDR-FLIP of the linear pictures, 0…1; lower is better. Null where the reference is black or there is no
    /// linear picture.
    pub hdr_flip: Option<f64>,
    /// Structural similarity of the tone-mapped pictures, up to 1; higher is better.
    pub ssim: f64,
    /// √(Σ (a − b)² / Σ b²) over pixels and channels of the indirect layer (of the whole picture where there are no
    /// layers), b the reference. Null where the reference has none.
    pub relative_rmse: Option<f64>,
    /// Mean of the indirect layer (or the whole picture) over that of the reference. Null where the reference has none.
    pub energy_ratio: Option<f64>,
}

/// FLIP of two 8-bit sRGB pictures of the same size.
pub fn flip(size: [u32; 2], reference: &[[u8; 3]], test: &[[u8; 3]]) -> anyhow::Result<ErrorMap> {
    let image = |rgb: &[[u8; 3]]| RgbImage::new(size[0] as usize, size[1] as usize, rgb.as_flattened().to_vec());
    ldr_flip(&image(reference)?, &image(test)?, DEFAULT_PPD).context("FLIP")
}

/// The mean of an error map.
pub fn mean(map: &ErrorMap) -> f64 {
    map.pixels().iter().map(|&e| f64::from(e)).sum::<f64>() / map.pixels().len() as f64
}

/// An error map in the colours of FLIP's authors, 8-bit sRGB: black 0, white 1.
pub fn heat_map(map: &ErrorMap) -> anyhow::Result<Vec<[u8; 3]>> {
    let colors = map.colorize().context("heat map")?;
    Ok(colors.pixels().as_chunks::<3>().0.iter().map(|c| c.map(|v| (v * 255.0 + 0.5) as u8)).collect())
}

/// Mean HDR-FLIP of two linear pictures; `None` for a black reference, which has no exposure.
pub fn hdr(size: [u32; 2], reference: &[[f32; 3]], test: &[[f32; 3]]) -> anyhow::Result<Option<f64>> {
    let luminance = |c: &[f32; 3]| 0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2];
    let brightest = reference.iter().map(luminance).fold(0.0, f32::max);
    if brightest <= 0.0 {
        return Ok(None);
    }
    // Exposures follow the reference, so that a factor on both pictures changes nothing; but flip-rs takes very small
    // numbers for zero. A power of two is exact.
    let factor = (-brightest.log2().floor()).clamp(-126.0, 126.0).exp2();
    let image = |rgb: &[[f32; 3]]| {
        // What is so bright is white at every exposure; flip-rs squares it.
        let scaled = rgb.as_flattened().iter().map(|v| (v * factor).clamp(-1e9, 1e9)).collect();
        RgbImage::new(size[0] as usize, size[1] as usize, scaled)
    };
    let mut options = HdrOptions::default();
    options.return_exposure_map = false;
    let result = hdr_flip(&image(reference)?, &image(test)?, options).context("HDR-FLIP")?;
    Ok(Some(mean(&result.error_map)))
}

/// SSIM of two 8-bit sRGB pictures of the same size. Windows are cut to the size of smaller pictures.
pub fn ssim(size: [u32; 2], reference: &[[u8; 3]], test: &[[u8; 3]]) -> f64 {
    /// (0.01 · 255)² and (0.03 · 255)², of the paper.
    const C: [f64; 2] = [6.5025, 58.5225];
    let luma = |rgb: &[[u8; 3]]| -> Vec<f64> {
        let luma = |c: &[u8; 3]| 0.299 * f64::from(c[0]) + 0.587 * f64::from(c[1]) + 0.114 * f64::from(c[2]);
        rgb.iter().map(luma).collect()
    };
    let (a, b) = (luma(reference), luma(test));
    let product = |a: &[f64], b: &[f64]| -> Vec<f64> { a.iter().zip(b).map(|(a, b)| a * b).collect() };
    let blurred = [&a, &b, &product(&a, &a), &product(&b, &b), &product(&a, &b)].map(|picture| blur(size, picture));
    let windows = blurred[0].len();
    let similarity = |i: usize| {
        let [a, b, aa, bb, ab] = [0, 1, 2, 3, 4].map(|k| blurred[k][i]);
        let (variances, covariance) = (aa - a * a + bb - b * b, ab - a * b);
        (2.0 * a * b + C[0]) * (2.0 * covariance + C[1]) / ((a * a + b * b + C[0]) * (variances + C[1]))
    };
    (0..windows).map(similarity).sum::<f64>() / windows as f64
}

/// The mean over each window of SSIM that lies within a picture.
fn blur(size: [u32; 2], picture: &[f64]) -> Vec<f64> {
    let [width, height] = size.map(|n| n as usize);
    let weights = |n: usize| {
        let n = n.min(11);
        let weight = |i: usize| (-0.5 * ((i as f64 - 0.5 * (n - 1) as f64) / 1.5).powi(2)).exp();
        let sum: f64 = (0..n).map(weight).sum();
        (0..n).map(|i| weight(i) / sum).collect::<Vec<f64>>()
    };
    let (across, down) = (weights(width), weights(height));
    let (columns, rows) = (width + 1 - across.len(), height + 1 - down.len());
    let line = |y: usize, x: usize| across.iter().zip(&picture[y * width + x..]).map(|(w, v)| w * v).sum::<f64>();
    let lines: Vec<f64> =
        (0..height).flat_map(|y| (0..columns).map(move |x| (y, x))).map(|(y, x)| line(y, x)).collect();
    let window = |y: usize, x: usize| down.iter().enumerate().map(|(j, w)| w * lines[(y + j) * columns + x]).sum();
    (0..rows).flat_map(|y| (0..columns).map(move |x| (y, x))).map(|(y, x)| window(y, x)).collect()
}

/// Relative RMSE and energy ratio of two linear pictures; `None` for a black reference.
pub fn energy(reference: &[[f32; 3]], test: &[[f32; 3]]) -> Option<(f64, f64)> {
    let (mut difference, mut squares, mut sums) = (0.0, 0.0, [0.0; 2]);
    for (&a, &b) in test.as_flattened().iter().zip(reference.as_flattened()) {
        let (a, b) = (f64::from(a), f64::from(b));
        difference += (a - b) * (a - b);
        squares += b * b;
        sums = [sums[0] + a, sums[1] + b];
    }
    (squares > 0.0 && sums[1] > 0.0).then(|| ((difference / squares).sqrt(), sums[0] / sums[1]))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: [u32; 2] = [48, 40];

    /// Waves of colour, and what differs from them by noise, colour or blur.
    fn pictures() -> [Vec<[u8; 3]>; 4] {
        let pixel = |i: u32| (i % SIZE[0], i / SIZE[0]);
        let wave = |i: u32, c: usize| {
            let (x, y) = pixel(i);
            0.5 + 0.4 * ((x as f32 * 0.3 + c as f32).sin() * (y as f32 * 0.2).cos())
        };
        let make = |f: &dyn Fn(u32, usize) -> f32| {
            let byte = |v: f32| (v.clamp(0.0, 1.0) * 255.0) as u8;
            (0..SIZE[0] * SIZE[1]).map(|i| std::array::from_fn(|c| byte(f(i, c)))).collect()
        };
        let noise = |i: u32, c: usize| huygens::sampling::random(3, c as u32, i) - 0.5;
        [
            make(&wave),
            make(&|i, c| wave(i, c) + 0.3 * noise(i, c)),
            make(&|i, c| if c == 0 { wave(i, c) * 0.7 } else { wave(i, c) }),
            make(&|i, c| if pixel(i).0 > 20 { wave(i, c) } else { wave(i, (c + 1) % 3) }),
        ]
    }

    /// The authors' C++ code, by nv-flip, is the oracle.
    #[test]
    fn flip_is_that_of_its_authors() {
        let all = pictures();
        for (i, test) in all.iter().enumerate() {
            let map = flip(SIZE, &all[0], test).unwrap();
            let image = |rgb: &[[u8; 3]]| nv_flip::FlipImageRgb8::with_data(SIZE[0], SIZE[1], rgb.as_flattened());
            let expected = nv_flip::flip(image(&all[0]), image(test), DEFAULT_PPD).to_vec();
            let worst = map.pixels().iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            let authors = expected.iter().map(|&e| f64::from(e)).sum::<f64>() / expected.len() as f64;
            println!("{i}: {} {authors}, worst pixel {worst}", mean(&map));
            assert!((mean(&map) - authors).abs() < 1e-6 && worst < 1e-5, "{i}: {} {authors} {worst}", mean(&map));
            assert!((mean(&map) == 0.0) == (i == 0));
        }
    }

    #[test]
    fn the_same_is_perfect_and_a_factor_is_what_it_is() {
        let linear: Vec<[f32; 3]> = pictures()[0].iter().map(|p| p.map(|v| f32::from(v) / 64.0)).collect();
        let double: Vec<[f32; 3]> = linear.iter().map(|p| p.map(|v| v * 1.5)).collect();
        assert_eq!(energy(&linear, &linear), Some((0.0, 1.0)));
        let (rmse, ratio) = energy(&linear, &double).unwrap();
        assert!((rmse - 0.5).abs() < 1e-6 && (ratio - 1.5).abs() < 1e-6, "{rmse} {ratio}");
        assert_eq!(energy(&[[0.0; 3]; 4], &[[1.0; 3]; 4]), None);
        assert_eq!(hdr(SIZE, &linear, &linear).unwrap(), Some(0.0));
        let wrong = hdr(SIZE, &linear, &double).unwrap().unwrap();
        assert!((0.05..1.0).contains(&wrong), "{wrong}");
        assert_eq!(hdr(SIZE, &vec![[0.0; 3]; 1920], &linear).unwrap(), None);
    }

    /// scikit-image 0.26.0 is the oracle: `structural_similarity` of the luma with `gaussian_weights=True, sigma=1.5,
    /// use_sample_covariance=False, data_range=255`.
    #[test]
    fn ssim_is_that_of_its_authors() {
        let all = pictures();
        for (test, expected) in all.iter().zip([1.0, 0.799_931_115_454, 0.987_957_463_310, 0.862_651_848_363]) {
            let got = ssim(SIZE, &all[0], test);
            assert!((got - expected).abs() < 1e-9, "{got}, expected {expected}");
        }
        // Smaller than a window: of even pictures only their means are left.
        let even = |v: u8| [[v; 3]; 12];
        let expected = (2.0 * 100.0 * 120.0 + 6.5025) / (100.0 * 100.0 + 120.0 * 120.0 + 6.5025);
        let got = ssim([4, 3], &even(100), &even(120));
        assert!((got - expected).abs() < 1e-9, "{got}, expected {expected}");
    }

    /// A factor on both pictures moves the exposures and nothing else, however dim they are.
    #[test]
    fn hdr_flip_does_not_depend_on_the_unit() {
        let linear = |picture: &[[u8; 3]], factor: f32| -> Vec<[f32; 3]> {
            picture.iter().map(|p| p.map(|v| f32::from(v) * factor)).collect()
        };
        let [a, b, ..] = pictures();
        let at = |factor: f32| hdr(SIZE, &linear(&a, factor), &linear(&b, factor)).unwrap().unwrap();
        let expected = at(1.0 / 256.0);
        assert!(expected > 0.01, "{expected}");
        for exponent in [-80, -40, 40] {
            let got = at((exponent as f32).exp2());
            assert!((got - expected).abs() < 1e-6, "{exponent}: {got}, expected {expected}");
        }
        assert_eq!(hdr([1, 1], &[[-2.0, 0.1, 0.0]], &[[1.0; 3]]).unwrap(), None);
        // A dot brighter than squares can be is as wrong as any very bright one.
        let with = |dot: f32| {
            let mut picture = linear(&a, 1e-4);
            picture[0] = [dot; 3];
            hdr(SIZE, &linear(&a, 1e-4), &picture).unwrap().unwrap()
        };
        assert!(with(1e6) > 0.0 && with(2e36) == with(1e9), "{} {}", with(1e6), with(2e36));
    }
}
