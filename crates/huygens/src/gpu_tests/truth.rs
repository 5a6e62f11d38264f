//! What the GPU draws against the path tracer.

use glam::{Mat4, Vec3};
use rayon::prelude::*;

use super::materials::one_texel;
use super::{builtins, hidden_but_for_the_rim, render, with_frame};
use crate::reference::{Bvh, PathOptions, PathTracer, PixelFilter, Surfaces, gather, ism, tonemap};
use crate::settings::{Model, Settings, Visibility};
use crate::{Camera, Exposure, Layer, RenderOptions, Scene, sampling};

/// The direct light of the built-in scenes. Left out are shadow rims: pixels around which, within the radius of the
/// percentage closer filter and one texel more, some points see the light and others do not.
#[test]
fn direct_light_is_that_of_the_path_tracer() {
    for scene in builtins() {
        let mut options = RenderOptions::new(160, 160, scene.cameras[0].clone());
        options.layer = Layer::Direct;
        let mut settings = Settings { visibility: Visibility::None, ..Settings::default() };
        settings.wave.delta_theta = 45.0;
        let (width, height) = (options.width, options.height);
        let truth = PathTracer::new(&scene).trace(
            &PathOptions {
                width,
                height,
                camera: options.camera.clone(),
                samples: 1,
                bounces: Some(0),
                seed: 0,
                filter: PixelFilter::Center,
            },
            &mut |_| true,
        );
        let bvh = Bvh::new(&scene);
        let spread = 2.0 * (settings.shadow.filter + 1.0) / settings.shadow.size as f32;
        with_frame(&scene, &settings, &options, |frame, pixels| {
            let got = frame.direct.result().read::<[f32; 4]>(0);
            let mut errors: Vec<f32> = pixels
                .iter()
                .filter(|pixel| hidden_but_for_the_rim(&bvh, &scene.lights[0], pixel, spread).is_some())
                .flat_map(|pixel| {
                    let (x, y) = (pixel.index as u32 % width, height - 1 - pixel.index as u32 / width);
                    let (got, expected) = (got[pixel.index], truth.direct[(y * width + x) as usize]);
                    (0..3).map(move |c| {
                        let difference = (got[c] - expected[c]).abs();
                        if difference == 0.0 { 0.0 } else { difference / expected[c] }
                    })
                })
                .collect();
            errors.sort_by(f32::total_cmp);
            let at = |share: f64| errors[(share * errors.len() as f64) as usize];
            let lit = truth.direct.iter().filter(|d| d[0] > 0.0).count();
            let judged = errors.len() / 3;
            println!(
                "{}: {judged} of {} pixels, {lit} lit: median {:.5}, 95th percentile {:.5}, 99th {:.5}",
                scene.name,
                pixels.len(),
                at(0.5),
                at(0.95),
                at(0.99)
            );
            assert!(judged > pixels.len() / 2 && lit > pixels.len() / 10, "{}: {judged}, {lit}", scene.name);
            assert!(at(0.5) < 0.01 && at(0.95) < 0.05, "{}: {} {}", scene.name, at(0.5), at(0.95));
        });
    }
}

#[test]
fn tone_mapping_is_that_of_its_twin() {
    for (scene, exposure) in builtins().zip([Exposure::Auto, Exposure::Auto, Exposure::Ev(3.0), Exposure::Ev(-4.0)]) {
        let mut options = RenderOptions::new(70, 50, scene.cameras[0].clone());
        (options.layer, options.exposure) = (Layer::Direct, exposure);
        let mut settings = Settings { visibility: Visibility::None, ..Settings::default() };
        settings.wave.delta_theta = 45.0;
        let got = render(&scene, &settings, &options);
        let ev = match exposure {
            Exposure::Auto => tonemap::auto_exposure(&got.linear),
            Exposure::Ev(ev) => ev,
        };
        assert!((got.stats.exposure_ev - ev).abs() < 1e-4, "{} {ev}", got.stats.exposure_ev);
        let expected = tonemap::display(&got.linear, ev);
        assert!(expected.iter().any(|c| *c != expected[0]));
        for (got, expected) in got.display.iter().zip(&expected) {
            // Rounding of 8 bits.
            assert!((0..3).all(|c| got[c].abs_diff(expected[c]) <= 1), "{got:?} {expected:?}");
        }
    }
}

/// What glossy and diffuse surfaces reflect of the VPLs, without visibility.
#[test]
fn indirect_light_is_that_of_its_twin() {
    for name in ["atrium", "column"] {
        let mut scene = Scene::builtin(name).unwrap();
        if name == "column" {
            for (i, material) in scene.materials.iter_mut().enumerate() {
                (material.metallic, material.roughness, material.specular) = (i as f32 * 0.3, 0.4, 1.0);
            }
            let half = one_texel(&mut scene, [128; 4]);
            let material = scene.materials.last_mut().unwrap();
            (material.occlusion_texture, material.occlusion_strength) = (Some(half), 0.9);
        }
        let options = RenderOptions { layer: Layer::Indirect, ..RenderOptions::new(48, 48, scene.cameras[0].clone()) };
        let mut settings = Settings { visibility: Visibility::None, model: Model::Reflected, ..Settings::default() };
        (settings.wave.delta_theta, settings.wave.delta_phi) = (10.0, 10.0);
        for specular in [true, false] {
            settings.gather.specular = specular;
            let got = render(&scene, &settings, &options);
            let sum = gather::Sum { occlusion: false, specular };
            let expected = gather::Pictures::new(&Surfaces::new(&scene), &got.vpls, &options, sum, &mut |_| ()).bounded;
            let mut errors: Vec<f32> = (got.linear.iter().zip(&expected))
                .filter(|(_, expected)| expected[1] > 0.0)
                .map(|(got, expected)| (0..3).map(|c| (got[c] / expected[c] - 1.0).abs()).fold(0.0, f32::max))
                .collect();
            errors.sort_by(f32::total_cmp);
            let at = |share: f32| errors[(share * (errors.len() - 1) as f32) as usize];
            println!("{name}, specular {specular}: median {}, 95th percentile {}", at(0.5), at(0.95));
            // Roughness and metalness have 8 bits in the G-buffer; at edges the two may see different surfaces.
            assert!(errors.len() > 2000 && at(0.5) < 2e-3 && at(0.95) < 2e-2, "{name}: {} {}", at(0.5), at(0.95));
        }
    }
}

/// The same in a room whose shading normals lean by 35°, where VPLs are above the one horizon and below the other.
#[test]
fn indirect_light_is_that_of_its_twin_where_shading_normals_lean() {
    let mut scene = Scene::builtin("cornell").unwrap();
    for mesh in &mut scene.meshes {
        for normal in &mut std::sync::Arc::make_mut(mesh).normals {
            *normal = (*normal + 0.7 * normal.any_orthonormal_vector()).normalize();
        }
    }
    for material in &mut scene.materials {
        (material.roughness, material.specular) = (0.4, 1.0);
    }
    let options = RenderOptions { layer: Layer::Indirect, ..RenderOptions::new(64, 64, scene.cameras[0].clone()) };
    let mut settings = Settings { visibility: Visibility::None, ..Settings::default() };
    (settings.wave.delta_theta, settings.wave.delta_phi) = (15.0, 15.0);
    let got = render(&scene, &settings, &options);
    let sum = gather::Sum { occlusion: false, specular: true };
    let expected = gather::Pictures::new(&Surfaces::new(&scene), &got.vpls, &options, sum, &mut |_| ()).bounded;
    let mut errors: Vec<f32> = (got.linear.iter().zip(&expected))
        .filter(|(_, expected)| expected[1] > 0.0)
        .map(|(got, expected)| (got[1] / expected[1] - 1.0).abs())
        .collect();
    errors.sort_by(f32::total_cmp);
    let off = errors[errors.len() * 99 / 100];
    println!("{} pixels, 99th percentile {off}", errors.len());
    assert!(errors.len() > 2000 && off < 2e-3, "{off}");
}

/// Between a metal floor and a ceiling close above it, where the middles of patches are at grazing light.
#[test]
fn what_metal_reflects_of_patches_at_grazing_light_is_that_of_its_twin() {
    let mut scene = Scene::builtin("cornell").unwrap();
    for material in &mut scene.materials {
        (material.metallic, material.roughness) = (1.0, 0.3);
    }
    let flat = Vec3::new(1.0, 0.02, 1.0);
    for instance in &mut scene.instances {
        instance.world_from_object = Mat4::from_scale(flat) * instance.world_from_object;
    }
    scene.lights[0].position *= flat;
    let bounds = scene.bounds().unwrap();
    let camera = Camera::look_at(bounds.center(), bounds.min, 1.0).unwrap();
    let options = RenderOptions { layer: Layer::Indirect, ..RenderOptions::new(48, 48, camera) };
    let mut settings = Settings { visibility: Visibility::None, ..Settings::default() };
    (settings.wave.delta_theta, settings.wave.delta_phi) = (15.0, 15.0);
    let got = render(&scene, &settings, &options);
    let sum = gather::Sum { occlusion: false, specular: true };
    let expected = gather::Pictures::new(&Surfaces::new(&scene), &got.vpls, &options, sum, &mut |_| ()).bounded;
    let errors = || got.linear.iter().zip(&expected).filter(|(_, expected)| expected[0] > 0.0);
    let off = errors().filter(|(got, expected)| (got[0] / expected[0] - 1.0).abs() > 0.02).count();
    println!("{off} of {} off", errors().count());
    assert!(errors().count() > 1000 && off < 5, "{off} of {}", errors().count());
}

/// The gather through imperfect shadow maps against its twin. The two differ where rounding decides which texel a
/// point falls into, or on which side of a 16-bit distance it lies.
#[test]
fn the_gather_through_isms_is_that_of_its_twin() {
    for (scene, model) in builtins().zip([Model::Wave, Model::Reflected, Model::Reflected, Model::Wave]) {
        let options = RenderOptions { seed: 3, ..RenderOptions::new(24, 24, scene.cameras[0].clone()) };
        let mut settings = Settings { model, ..Settings::default() };
        (settings.wave.delta_theta, settings.wave.delta_phi) = (15.0, 15.0);
        (settings.ism.size, settings.ism.points) = (32, 512);
        settings.ism.pull_levels = if scene.name.ends_with("atrium") { 0 } else { 2 };
        with_frame(&scene, &settings, &options, |frame, pixels| {
            let surfels = frame.surfels.as_ref().unwrap();
            let in_world = surfels.in_world(&scene);
            let splats = ism::Splats {
                settings: &settings.ism,
                surfels: &in_world,
                area: surfels.area,
                far: frame.vpl_range(),
                seed: sampling::hash(sampling::hash(options.seed)),
            };
            let vpls = &frame.vpls;
            let tiles: Vec<_> =
                (0..vpls.len()).into_par_iter().map(|v| ism::Tile::new(&splats, v as u32, &vpls[v])).collect();
            let got = frame.gather.read_irradiance();
            let (mut difference, mut sum, mut unshadowed, mut worst) = (0.0, 0.0, 0.0, 0.0f64);
            let (mut off, mut below) = (0.0, 0.0);
            for pixel in pixels {
                let irradiance =
                    |seen: &dyn Fn(usize) -> bool| gather::irradiance(vpls, pixel.position, pixel.normal, seen).y;
                let expected = irradiance(&|v| tiles[v].sees(pixel.position, pixel.geometric_normal));
                let error = (f64::from(got[pixel.index][1]) - expected).abs();
                difference += error;
                sum += expected;
                unshadowed += irradiance(&|_| true);
                worst = worst.max(error / expected.max(1e-9));
                // What of patches whose middle is below the surface is above it is seen whatever the maps say.
                let unasked = irradiance(&|_| false);
                if unasked > 0.02 * expected {
                    off += error;
                    below += unasked;
                }
            }
            let (error, hidden) = (difference / sum, 1.0 - sum / unshadowed);
            println!("{}: mean difference {error:.5}, worst {worst:.4}, {hidden:.2} hidden", scene.name);
            assert!(error < 0.005 && hidden > 0.05, "{}: {error} {hidden}", scene.name);
            println!("of {below} from below the horizon {off} off");
            assert!((below > 0.0) == (model == Model::Reflected) && off <= 0.05 * below, "{off} of {below}");
        });
    }
}
