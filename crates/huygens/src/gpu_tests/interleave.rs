//! The interleaved gather against its twin and against the exact gather.

use glam::Vec3;

use super::{builtins, floor, light, render, with_frame};
use crate::reference::gather;
use crate::settings::{GatherMethod, Model, Settings, Visibility};
use crate::{Layer, Profile, RenderOptions};

fn interleaved(n: u32, half: bool) -> Settings {
    let mut settings = Settings { visibility: Visibility::None, ..Settings::default() };
    (settings.wave.delta_theta, settings.wave.delta_phi) = (15.0, 15.0);
    (settings.gather.method, settings.gather.interleave, settings.gather.half) = (GatherMethod::Interleaved, n, half);
    settings
}

/// On a plane, where the filter knows no edges, every pixel has the mean of what its neighbours sum of their own subsets.
#[test]
fn every_pixel_has_the_mean_of_the_sums_around_it() {
    let scene = floor(light(Profile::Cosine));
    for (n, half) in [(2, false), (4, false), (8, false), (4, true)] {
        let mut settings = interleaved(n, half);
        settings.model = Model::Wave;
        // Odd sizes: the last pixels of a layer have no place in the picture.
        let options = RenderOptions::new(45, 37, scene.cameras[0].clone());
        with_frame(&scene, &settings, &options, |frame, pixels| {
            let got = frame.gather.read_irradiance();
            let step = if half { 2 } else { 1 };
            let (width, reach, square) = (options.width as i32, n as i32 / 2, (n * n) as i32);
            let at = |x: i32, y: i32| pixels.iter().find(|pixel| pixel.index == (y * width + x) as usize).unwrap();
            for (x, y) in [(22, 18), (23, 19), (25, 17), (20, 16), (21, 21)] {
                let mut expected = 0.0;
                for (i, j) in (-reach..=reach).flat_map(|i| (-reach..=reach).map(move |j| (i, j))) {
                    let (cell_x, cell_y) = (x / step + i, y / step + j);
                    let pixel = at(cell_x * step + step / 2, cell_y * step + step / 2);
                    let subset = (cell_x % n as i32 + cell_y % n as i32 * n as i32) as usize;
                    let in_subset = |vpl: usize| vpl % square as usize == subset;
                    let weight = [i, j].map(|i| if i.abs() == reach { 0.5 } else { 1.0 }).iter().product::<f64>();
                    expected += weight * gather::irradiance(&frame.vpls, pixel.position, pixel.normal, &in_subset).y;
                }
                let ratio = f64::from(got[(y * width + x) as usize][1]) / expected;
                assert!((ratio - 1.0).abs() < 1e-3, "{n} {half}, pixel {x}, {y}: {ratio}");
            }
        });
    }
}

/// Subsets are all of the light together, whatever the scene; nearer to the exact gather the fewer there are, and the
/// more frames are averaged.
#[test]
fn the_mean_is_that_of_the_exact_gather() {
    for scene in builtins() {
        let mut options = RenderOptions::new(64, 64, scene.cameras[0].clone());
        options.layer = Layer::Indirect;
        let exact = render(&scene, &Settings { gather: Settings::default().gather, ..interleaved(2, false) }, &options);
        let mut errors = Vec::new();
        for (n, half, frames) in [(2, false, 1), (4, false, 16), (4, false, 1), (8, false, 1)] {
            options.frames = frames;
            let got = render(&scene, &interleaved(n, half), &options).linear;
            let (mut sum, mut difference, mut total) = (Vec3::ZERO, 0.0, Vec3::ZERO);
            for (&got, &exact) in got.iter().zip(&exact.linear) {
                (sum, total) = (sum + Vec3::from(got), total + Vec3::from(exact));
                difference += (Vec3::from(got) - Vec3::from(exact)).abs().element_sum();
            }
            let (ratio, error) = ((sum / total).to_array(), difference / total.element_sum());
            println!("{} {n} {half} {frames}: {ratio:.3?}, {error:.4} off", scene.name);
            // With 64 subsets a surface of few pixels has not all of them.
            let bound = if n == 8 { 0.1 } else { 0.03 };
            assert!(ratio.iter().all(|ratio| (ratio - 1.0).abs() < bound), "{} {n}: {ratio:?}", scene.name);
            errors.push(error);
        }
        assert!(errors[0] < errors[2] && errors[1] < errors[2] && errors[2] < errors[3], "{}: {errors:?}", scene.name);
    }
}
