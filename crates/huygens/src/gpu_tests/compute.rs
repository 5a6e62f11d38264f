//! The compute tier against the fragment tier.

use glam::{Mat4, Vec3};

use super::{builtins, with_frame};
use crate::gl::{Api, Headless};
use crate::settings::{GatherMethod, Model, Settings, Tier, Visibility};
use crate::{Error, Layer, RenderOptions, Renderer, Scene};

fn small(model: Model) -> Settings {
    let mut settings = Settings { model, ..Settings::default() };
    (settings.wave.delta_theta, settings.wave.delta_phi) = (15.0, 15.0);
    (settings.ism.size, settings.ism.points, settings.ism.surfels) = (16, 128, 8192);
    settings.shadow_maps.count = 16;
    settings
}

fn with(settings: &Settings, tier: Tier) -> Settings {
    Settings { tier, ..settings.clone() }
}

/// Share of the pixels that are off by more than a thousandth of the mean of the second picture, and the mean difference
/// over that mean.
fn off(got: &[[f32; 3]], expected: &[[f32; 3]]) -> (f32, f32) {
    let mean = expected.as_flattened().iter().sum::<f32>() / (3 * expected.len()) as f32;
    assert!(mean > 0.0);
    let differences = got.iter().zip(expected).map(|(a, b)| (0..3).map(|c| (a[c] - b[c]).abs()).fold(0.0, f32::max));
    let differences: Vec<f32> = differences.map(|difference| difference / mean).collect();
    let count = differences.len() as f32;
    let off = differences.iter().filter(|&&difference| difference > 1e-3).count();
    (off as f32 / count, differences.iter().sum::<f32>() / count)
}

#[test]
fn compute_is_refused_where_there_is_none() {
    let scene = Scene::builtin("cornell").unwrap();
    let options = RenderOptions::new(8, 8, scene.cameras[0].clone());
    for api in [Api::Es, Api::Core] {
        let headless = Headless::with_api(None, api).unwrap();
        let renderer = Renderer::new(headless.context()).unwrap();
        let check = |tier| renderer.check(&with(&small(Model::Wave), tier), &options);
        check(Tier::Auto).unwrap();
        check(Tier::Fragment).unwrap();
        match check(Tier::Compute) {
            Ok(()) => assert_eq!(api, Api::Core),
            Err(Error::Setting { key, .. }) => assert!(api == Api::Es && key == "tier"),
            Err(other) => panic!("{other}"),
        }
        let info = headless.context().info().clone();
        assert_eq!(Tier::Auto.computes(&info), info.tier.contains("compute"), "{info:?}");
    }
}

/// The maths is the same and the sums are in the same order. ISMs may differ by a step of their 16 bits, and then a VPL
/// that is seen at its very edge is seen in one tier alone.
#[test]
fn compute_gathers_what_fragments_gather() {
    use GatherMethod::{Exact, Interleaved};
    let cases = [
        (Exact, false, vec![(Visibility::None, Model::Wave, true), (Visibility::Ism, Model::Reflected, true)]),
        (Exact, false, vec![(Visibility::Ism, Model::Wave, true), (Visibility::Dao, Model::Reflected, false)]),
        (
            Interleaved,
            false,
            vec![(Visibility::None, Model::Reflected, true), (Visibility::Ism, Model::Reflected, true)],
        ),
        (
            Interleaved,
            true,
            vec![(Visibility::Mixed, Model::Reflected, false), (Visibility::ShadowMaps, Model::Wave, true)],
        ),
    ];
    for (mut scene, (method, half, cases)) in builtins().zip(cases) {
        for material in &mut scene.materials {
            // Lobes that show.
            material.roughness = material.roughness.min(0.4);
        }
        // Odd sizes: workgroups overhang.
        let mut options = RenderOptions::new(45, 37, scene.cameras[0].clone());
        options.layer = Layer::Indirect;
        let headless = Headless::new(None).unwrap();
        let mut renderer = Renderer::new(headless.context()).unwrap();
        for (visibility, model, specular) in cases {
            let mut settings = Settings { visibility, ..small(model) };
            (settings.gather.method, settings.gather.half, settings.gather.specular) = (method, half, specular);
            let [fragment, compute] = [Tier::Fragment, Tier::Compute]
                .map(|tier| renderer.render(&scene, &with(&settings, tier), &options, &mut |_| {}).unwrap().linear);
            let name = format!("{} {method:?} {visibility:?} {model:?}", scene.name);
            let (share, mean) = off(&compute, &fragment);
            println!("{name}: {share:.2e} of the pixels, mean {mean:.2e}");
            let most = if visibility.has_isms() { 0.01 } else { 0.0 };
            assert!(share <= most && mean < 1e-4, "{name}: {share} {mean}");
        }
    }
}

/// Means go with what moves, in frames in which the camera, a thing or nothing does.
#[test]
fn compute_follows_what_moves_as_fragments_do() {
    let scene = Scene::builtin("cornell").unwrap();
    let mut options = RenderOptions::new(45, 37, scene.cameras[0].clone());
    options.layer = Layer::Indirect;
    // The widest box, and one of 2 × 2 pixels.
    for (n, half) in [(16, false), (4, true)] {
        let mut settings = Settings { visibility: Visibility::None, ..small(Model::Reflected) };
        (settings.gather.method, settings.gather.interleave, settings.gather.half) =
            (GatherMethod::Interleaved, n, half);
        let [fragment, compute] = [Tier::Fragment, Tier::Compute].map(|tier| {
            let headless = Headless::new(None).unwrap();
            let mut renderer = Renderer::new(headless.context()).unwrap();
            let (mut scene, mut options) = (scene.clone(), options.clone());
            let frame = |k| {
                match k {
                    1 => options.camera.eye.x += 0.02,
                    2 => {
                        let thing = scene.instances.last_mut().unwrap();
                        thing.world_from_object = Mat4::from_translation(Vec3::Z * 0.03) * thing.world_from_object;
                    }
                    _ => {}
                }
                renderer.draw(&scene, &with(&settings, tier), &options).unwrap();
                renderer.read().unwrap().unwrap().linear
            };
            (0..4).map(frame).collect::<Vec<_>>()
        });
        assert!(fragment.windows(2).all(|pair| pair[0] != pair[1]));
        for (fragment, compute) in fragment.iter().zip(&compute) {
            let (share, mean) = off(compute, fragment);
            println!("{n} {half}: {share:.2e} of the pixels, mean {mean:.2e}");
            assert!(share == 0.0 && mean < 1e-4, "{n} {half}: {share} {mean}");
        }
    }
}

/// Texel by texel, for spheres and hemispheres, tiles of one block and of four, holes closed and open.
#[test]
fn compute_makes_the_isms_that_fragments_make() {
    let cases = [(16, 128, 2), (64, 1024, 6), (128, 512, 6), (8, 128, 0)];
    for (scene, (size, points, levels)) in builtins().zip(cases) {
        for model in [Model::Wave, Model::Reflected] {
            let mut settings = small(model);
            (settings.wave.delta_theta, settings.wave.delta_phi) = (90.0, 90.0);
            (settings.ism.size, settings.ism.points, settings.ism.pull_levels) = (size, points, levels);
            let options = RenderOptions::new(8, 8, scene.cameras[0].clone());
            let [fragment, compute] = [Tier::Fragment, Tier::Compute].map(|tier| {
                with_frame(&scene, &with(&settings, tier), &options, |frame, _| {
                    let ism = frame.ism.as_ref().unwrap();
                    let (columns, tile, count) = (ism.layout().columns, ism.layout().tile, frame.vpls.len() as u32);
                    let (width, texels) = (columns * tile, ism.read());
                    let of_vpl = |v: u32| {
                        let first = v / columns * tile * width + v % columns * tile;
                        let texels = &texels;
                        (0..tile * tile).map(move |k| texels[(first + k / tile * width + k % tile) as usize][0])
                    };
                    (0..count).flat_map(of_vpl).collect::<Vec<f32>>()
                })
            });
            let held = fragment.iter().filter(|&&depth| depth < 1.0).count();
            let differ = fragment.iter().zip(&compute).filter(|(a, b)| (*a - *b).abs() > 1e-3).count();
            println!("{} {model:?} {size}: {differ} of {} differ, {held} held", scene.name, fragment.len());
            assert!(fragment.len() == compute.len() && held > fragment.len() / 4);
            // A point's centre on the edge between two texels may round to either.
            assert!(differ as f64 <= 1e-4 * fragment.len() as f64, "{} {model:?} {size}: {differ}", scene.name);
        }
    }
}
