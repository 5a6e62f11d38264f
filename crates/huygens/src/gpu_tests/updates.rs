//! Frames of an animation: only what differs is made anew, and it is what a fresh renderer makes.

use std::sync::Arc;

use glam::{Mat4, Vec3};

use super::render;
use crate::gl::Headless;
use crate::scene::Mesh;
use crate::settings::{GatherMethod, Model, Settings, Visibility};
use crate::{Layer, Light, Profile, Rebuilds, RenderOptions, Renderer, Scene};

fn quick() -> Settings {
    let mut settings = Settings::default();
    (settings.wave.delta_theta, settings.wave.delta_phi) = (15.0, 30.0);
    (settings.ism.size, settings.ism.points, settings.ism.surfels) = (16, 128, 4096);
    (settings.shadow.size, settings.shadow_maps.count, settings.shadow_maps.size) = (128, 8, 32);
    (settings.reflected.rays, settings.emission.samples) = (2, 4);
    settings
}

/// Lights of every kind, a shining surface, and things that stand in the light.
fn scene() -> Scene {
    let mut scene = Scene::builtin("column").unwrap();
    let light = scene.lights[0].clone();
    let sun = Light { profile: Profile::Directional, intensity: Vec3::ONE, ..light.clone() };
    let lamp = Light { profile: Profile::Point, position: Vec3::new(0.4, 1.0, 1.5), ..light };
    scene.lights.extend([sun, lamp]);
    let material = scene.meshes[0].material;
    scene.materials[material].emissive = Vec3::splat(0.2);
    scene
}

type Change = fn(&mut Scene, &mut Settings, &mut RenderOptions);

#[test]
fn a_frame_after_a_change_is_that_of_a_fresh_renderer() {
    let changes: &[(&str, Change)] = &[
        ("first", |_, _, _| ()),
        ("camera", |_, _, o| o.camera.eye.x += 0.1),
        ("light", |s, _, _| s.lights[0].position.x += 0.3),
        ("sun", |s, _, _| s.lights[1].axis = Vec3::new(0.3, -0.9, 0.1).normalize()),
        ("lamp", |s, _, _| s.lights[2].intensity *= 2.0),
        ("fewer lights", |s, _, _| s.lights.truncate(1)),
        ("object", |s, _, _| {
            let last = s.instances.len() - 1;
            let moved = Mat4::from_translation(Vec3::new(0.2, 0.0, 0.1));
            s.instances[last].world_from_object = moved * s.instances[last].world_from_object;
        }),
        ("shape", |s, _, _| {
            let mesh = Mesh::clone(&s.meshes[0]);
            s.meshes[0] = Arc::new(Mesh { positions: mesh.positions.iter().map(|p| *p * 1.1).collect(), ..mesh });
        }),
        ("material", |s, _, _| s.materials[1].base_color.x *= 0.5),
        ("size", |_, _, o| (o.width, o.height) = (40, 24)),
        ("seed", |_, _, o| o.seed += 1),
        ("strength", |_, s, _| s.strength = 2.0),
        ("shadow size", |_, s, _| s.shadow.size = 64),
        ("ism size", |_, s, _| s.ism.size = 32),
        ("surfels", |_, s, _| s.ism.surfels = 2048),
        ("fraction", |_, s, _| s.wave.fraction = 0.5),
        ("emission", |_, s, _| s.emission.samples = 2),
        ("no visibility", |_, s, _| s.visibility = Visibility::None),
        ("mixed", |_, s, _| s.visibility = Visibility::Mixed),
        ("mixed from elsewhere", |_, _, o| o.camera.eye.z += 0.2),
        ("shadow maps", |_, s, _| s.visibility = Visibility::ShadowMaps),
        ("less memory", |_, s, _| (s.shadow_maps.size, s.shadow_maps.memory) = (256, 4)),
        ("ao", |_, s, _| s.visibility = Visibility::Dao),
        ("lattice", |_, s, _| s.model = Model::Wave),
        ("angles", |_, s, _| s.wave.delta_theta = 30.0),
        ("layer", |_, _, o| o.layer = Layer::Indirect),
        ("back", |_, s, _| *s = quick()),
        ("direct", |_, _, o| o.layer = Layer::Direct),
        ("final", |_, _, o| o.layer = Layer::Final),
    ];
    let (mut scene, mut settings) = (scene(), quick());
    let mut options = RenderOptions::new(32, 24, scene.cameras[0].clone());
    let headless = Headless::new(None).unwrap();
    let mut renderer = Renderer::new(headless.context()).unwrap();
    assert!(renderer.read().unwrap().is_none());
    let mut frames = Vec::new();
    for (name, change) in changes {
        change(&mut scene, &mut settings, &mut options);
        renderer.draw(&scene, &settings, &options).unwrap();
        let drawn = renderer.read().unwrap().unwrap().linear;
        frames.push((name, scene.clone(), settings.clone(), options.clone(), drawn));
    }
    drop((renderer, headless));
    let mut before = &Vec::new();
    for (name, scene, settings, options, drawn) in &frames {
        let fresh = render(scene, settings, options).linear;
        let total: f32 = fresh.as_flattened().iter().sum();
        let off: f32 = fresh.as_flattened().iter().zip(drawn.as_flattened()).map(|(a, b)| (a - b).abs()).sum();
        println!("{name}: {off} of {total}");
        // Surfels stay on the surfaces that move, where a fresh renderer lays them anew.
        assert!(off <= if **name == "object" { 0.02 * total } else { 0.0 }, "{name}: {off} of {total}");
        assert!(drawn != before, "{name}: nothing changed");
        before = drawn;
    }
}

/// Means over frames are of one kind of light.
#[test]
fn a_change_of_settings_begins_means_over_frames_anew() {
    let scene = scene();
    let options = RenderOptions::new(32, 24, scene.cameras[0].clone());
    let headless = Headless::new(None).unwrap();
    let mut settings = quick();
    settings.gather.method = GatherMethod::Interleaved;
    let dimmed = Settings { strength: 0.1, ..settings.clone() };
    let fresh = |settings: &Settings, frames| {
        let mut renderer = Renderer::new(headless.context()).unwrap();
        for _ in 0..frames {
            renderer.draw(&scene, settings, &options).unwrap();
        }
        renderer
    };
    let expected = fresh(&dimmed, 1).read().unwrap().unwrap().linear;
    let mut renderer = fresh(&settings, 16);
    renderer.draw(&scene, &dimmed, &options).unwrap();
    let got = renderer.read().unwrap().unwrap().linear;
    // Which subsets the frame has depends on its number: the means are compared.
    let mean = |picture: &[[f32; 3]]| picture.as_flattened().iter().sum::<f32>() / picture.len() as f32;
    assert!((mean(&got) / mean(&expected) - 1.0).abs() < 0.01, "{} {}", mean(&got), mean(&expected));
}

#[test]
fn an_unchanged_frame_rebuilds_nothing() {
    let (scene, headless) = (scene(), Headless::new(None).unwrap());
    let mut renderer = Renderer::new(headless.context()).unwrap();
    let options = RenderOptions::new(16, 12, scene.cameras[0].clone());
    for visibility in [Visibility::Ism, Visibility::Mixed, Visibility::ShadowMaps, Visibility::None] {
        let settings = Settings { visibility, ..quick() };
        let mut draw = |scene: &Scene, options: &RenderOptions| -> Rebuilds {
            renderer.draw(scene, &settings, options).unwrap();
            renderer.read().unwrap().unwrap().stats.rebuilds
        };
        let first = draw(&scene, &options);
        assert_eq!(draw(&scene, &options), first, "{visibility:?}");
        let mut elsewhere = options.clone();
        elsewhere.camera.eye.x += 0.1;
        if visibility != Visibility::Mixed {
            assert_eq!(draw(&scene, &elsewhere), first, "{visibility:?}");
        }
        let mut lit = scene.clone();
        lit.lights[0].position.x += 0.2;
        let now = draw(&lit, &options);
        let isms = u64::from(visibility.has_isms());
        assert!(now.vpls > first.vpls && now.isms - first.isms >= isms && now.shadow_maps > first.shadow_maps);
        assert_eq!(now.scene, 1);
    }
}
