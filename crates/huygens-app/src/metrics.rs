//! How far a picture is from another.
//!
//! FLIP (Andersson et al. 2020) and HDR-FLIP (Andersson et al. 2021) are those of `flip-rs`, with its 67 pixels per
//! degree; SSIM (Wang et al. 2004) is `image-compare`'s, on 8 × 8 windows, the least of the three channels.

use anyhow::Context;
use flip_rs::{DEFAULT_PPD, ErrorMap, HdrOptions, RgbImage, hdr_flip, ldr_flip};
use image_compare::Algorithm;
use serde::Serialize;

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
    if reference.as_flattened().iter().all(|&v| v <= 0.0) {
        return Ok(None);
    }
    let image = |rgb: &[[f32; 3]]| RgbImage::new(size[0] as usize, size[1] as usize, rgb.as_flattened().to_vec());
    let mut options = HdrOptions::default();
    options.return_exposure_map = false;
    let result = hdr_flip(&image(reference)?, &image(test)?, options).context("HDR-FLIP")?;
    Ok(Some(mean(&result.error_map)))
}

/// SSIM of two 8-bit sRGB pictures of the same size.
pub fn ssim(size: [u32; 2], reference: &[[u8; 3]], test: &[[u8; 3]]) -> anyhow::Result<f64> {
    let image = |rgb: &[[u8; 3]]| {
        image::RgbImage::from_raw(size[0], size[1], rgb.as_flattened().to_vec()).context("a picture of another size")
    };
    let similarity =
        image_compare::rgb_similarity_structure(&Algorithm::MSSIMSimple, &image(reference)?, &image(test)?);
    Ok(similarity.context("SSIM")?.score)
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
        let [a, noisy, ..] = pictures();
        assert!((ssim(SIZE, &a, &a).unwrap() - 1.0).abs() < 1e-9);
        assert!(ssim(SIZE, &a, &noisy).unwrap() < 0.9);
    }
}
