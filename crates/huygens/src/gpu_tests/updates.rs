//! Frames of an animation: only what differs is made anew, and it is what a fresh renderer makes.

use std::sync::Arc;

use glam::{Mat4, Vec3};

use super::{floor, light, render};
use crate::gl::Headless;
use crate::scene::{Instance, Mesh};
use crate::settings::{GatherMethod, Model, Settings, Visibility};
use crate::{Layer, Light, Profile, Rebuilds, RenderOptions, Rendered, Renderer, Scene};

fn quick() -> Settings {
    let mut settings = Settings::default();
    (settings.wave.delta_theta, settings.wave.delta_phi) = (15.0, 30.0);
    (settings.ism.size, settings.ism.points, settings.ism.surfels) = (16, 128, 4096);
    (settings.shadow.size, settings.shadow_maps.count, settings.shadow_maps.size) = (128, 8, 32);
    (settings.reflected.rays, settings.emission.samples) = (2, 4);
    // Every change at once.
    settings.reflected.frames = 1;
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
        // Surfels stay on the surfaces that move and deform, where a fresh renderer lays them anew.
        assert!(off <= if ["object", "shape"].contains(name) { 0.02 * total } else { 0.0 }, "{name}: {off} of {total}");
        assert!(drawn != before, "{name}: nothing changed");
        before = drawn;
    }
}

/// VPLs follow a light that moves, frame by frame, without new places and maps, and are in the end nearly those that a
/// fresh renderer has: their flux is.
#[test]
fn vpls_follow_the_lights() {
    let mut scene = scene();
    for material in &mut scene.materials {
        material.emissive *= 0.02;
    }
    let mut options = RenderOptions::new(48, 40, scene.cameras[0].clone());
    options.layer = Layer::Indirect;
    let mut settings = quick();
    (settings.wave.delta_theta, settings.wave.delta_phi) = (10.0, 10.0);
    (settings.reflected.rays, settings.reflected.frames) = (16, 4);
    settings.strength = 2.0;
    let headless = Headless::new(None).unwrap();
    let mut renderer = Renderer::new(headless.context()).unwrap();
    let mut draw = |scene: &Scene| {
        renderer.draw(scene, &settings, &options).unwrap();
        renderer.read().unwrap().unwrap()
    };
    let before = draw(&scene);
    type Change = fn(&mut Scene);
    let changes: [(&str, Change); 4] = [
        ("moved", |s| s.lights[0].position += Vec3::new(1.0, -0.5, 0.4)),
        ("coloured", |s| s.lights[0].intensity *= Vec3::new(2.0, 1.0, 0.5)),
        ("brighter", |s| s.lights[2].intensity *= 3.0),
        ("fewer", |s| s.lights.truncate(1)),
    ];
    let mut last = before.clone();
    for (name, change) in changes {
        change(&mut scene);
        let mut fresh = Renderer::new(headless.context()).unwrap();
        let fresh = fresh.render(&scene, &settings, &options, &mut |_| ()).unwrap();
        let off = |picture: &[[f32; 3]]| {
            let pairs = || picture.as_flattened().iter().zip(fresh.linear.as_flattened());
            pairs().map(|(a, b)| (a - b).abs()).sum::<f32>() / pairs().map(|(_, b)| b).sum::<f32>()
        };
        let frames: Vec<_> = (0..6).map(|_| draw(&scene)).collect();
        let errors: Vec<f32> = frames.iter().map(|frame| off(&frame.linear)).collect();
        println!("{name}: {} before, {errors:.3?}", off(&last.linear));
        let done = &frames[3];
        // Part by part, in place of what was there.
        let flux = |rendered: &Rendered| rendered.stats.lattice_flux_w;
        for (frame, share) in frames.iter().zip([0.25, 0.5, 0.75]) {
            let expected = flux(&last) + share * (flux(done) - flux(&last));
            assert!((flux(frame) / expected - 1.0).abs() < 0.02, "{name}, {share}: {} {expected}", flux(frame));
        }
        let ratio = done.stats.lattice_flux_w / fresh.stats.lattice_flux_w;
        assert!((ratio - 1.0).abs() < 0.02, "{name}: flux {ratio}");
        assert!((done.stats.light_flux_w / fresh.stats.light_flux_w - 1.0).abs() < 1e-5, "{name}");
        assert!(errors[3] < 0.08 && errors[3] < 0.6 * off(&last.linear), "{name}: {errors:?}");
        assert!(frames[0].linear != frames[1].linear && frames[2].linear != frames[3].linear, "{name}");
        assert!(frames[4].linear == frames[3].linear && frames[5].linear == frames[3].linear, "{name}");
        let same_places = done.vpls.iter().zip(&before.vpls).all(|(a, b)| a.position == b.position);
        assert!(same_places && done.vpls.len() == before.vpls.len(), "{name}");
        assert_eq!(done.stats.rebuilds.isms, before.stats.rebuilds.isms, "{name}");
        assert_eq!(frames[5].stats.rebuilds.vpls, done.stats.rebuilds.vpls, "{name}");
        last = frames[5].clone();
    }
    // While a light moves on and on, no part is forgotten: they are some frames behind.
    for _ in 0..8 {
        scene.lights[0].intensity *= 1.1;
        last = draw(&scene);
    }
    let expected = (0..4).map(|k| 1.1f64.powi(-k)).sum::<f64>() / 4.0;
    let now = (0..4).map(|_| draw(&scene)).last().unwrap();
    let ratio = last.stats.lattice_flux_w / now.stats.lattice_flux_w;
    assert!((ratio - expected).abs() < 0.02, "{ratio} {expected}");
    last = now;
    // Without light they have no flux, and have it again with light.
    let light = scene.lights[0].clone();
    scene.lights[0].intensity = Vec3::ZERO;
    let dark = (0..4).map(|_| draw(&scene)).last().unwrap();
    assert!(dark.stats.lattice_flux_w < 0.5 * last.stats.lattice_flux_w && dark.vpls.len() == before.vpls.len());
    scene.lights[0] = light;
    let lit = (0..4).map(|_| draw(&scene)).last().unwrap();
    assert!((lit.stats.lattice_flux_w / last.stats.lattice_flux_w - 1.0).abs() < 0.01);
}

/// VPLs go with what they stand on, and what a thing hides goes with it within some frames.
#[test]
fn vpls_follow_things_that_move() {
    let mut scene = scene();
    scene.lights.truncate(1);
    for material in &mut scene.materials {
        material.emissive = Vec3::ZERO;
    }
    let mut options = RenderOptions::new(48, 40, scene.cameras[0].clone());
    options.layer = Layer::Indirect;
    let mut settings = quick();
    (settings.wave.delta_theta, settings.wave.delta_phi) = (10.0, 10.0);
    (settings.ism.size, settings.ism.points, settings.ism.surfels) = (32, 1024, 65536);
    (settings.reflected.rays, settings.reflected.frames) = (16, 4);
    let headless = Headless::new(None).unwrap();
    let mut renderer = Renderer::new(headless.context()).unwrap();
    let mut draw = |scene: &Scene| {
        renderer.draw(scene, &settings, &options).unwrap();
        renderer.read().unwrap().unwrap()
    };
    let before = draw(&scene);
    let column = scene.instances.len() - 1;
    let motion = Mat4::from_translation(Vec3::new(0.08, 0.0, 0.05));
    let mut frames = Vec::new();
    for step in 0..14 {
        if step < 8 {
            scene.instances[column].world_from_object = motion * scene.instances[column].world_from_object;
        }
        frames.push(draw(&scene));
    }
    let fresh = Renderer::new(headless.context()).unwrap();
    let fresh = { fresh }.render(&scene, &settings, &options, &mut |_| ()).unwrap();
    let off = |picture: &[[f32; 3]]| {
        let pairs = || picture.as_flattened().iter().zip(fresh.linear.as_flattened());
        pairs().map(|(a, b)| (a - b).abs()).sum::<f32>() / pairs().map(|(_, b)| b).sum::<f32>()
    };
    let errors: Vec<f32> = frames.iter().map(|frame| off(&frame.linear)).collect();
    println!("{} before, {errors:.3?}", off(&before.linear));
    assert!(errors[11] < 0.06 && errors[11] < 0.5 * off(&before.linear) && errors[7] < 2.0 * errors[11]);
    assert!(frames[10].linear == frames[13].linear && frames[9].linear != frames[10].linear);
    // A set of ISMs after each set of frames, but while the column moves there is always one to be made.
    assert_eq!(frames[13].stats.rebuilds.isms, before.stats.rebuilds.isms + 1);
    let whole = Mat4::from_translation(Vec3::new(0.64, 0.0, 0.4));
    let (mut moved, mut stayed) = (0, 0);
    for (now, then) in frames[13].vpls.iter().zip(&before.vpls) {
        match now.position.distance(then.position) {
            0.0 => stayed += 1,
            _ => {
                assert!(now.position.distance(whole.transform_point3(then.position)) < 1e-4);
                moved += 1;
            }
        }
    }
    println!("{moved} moved, {stayed} stayed");
    assert!(moved > 20 && stayed > 500);
}

/// Two halves of a floor under a lamp, one of which goes below the other, into its shadow: nothing is left to it, neither
/// of what it had nor of what it was next to.
#[test]
fn vpls_that_are_apart_exchange_nothing_though_they_were_next_to_each_other() {
    let profile = Profile::Spot { inner: 0.6, outer: 0.6 };
    let mut scene = floor(Light { axis: Vec3::NEG_Y, position: Vec3::new(-0.1, 1.7, 0.0), ..light(profile) });
    let half = |x: f32, y: f32| Mat4::from_translation(Vec3::new(x, y, 0.0));
    scene.instances = [-4.0, 4.0].map(|x| Instance { mesh: 0, world_from_object: half(x, 0.0) }).to_vec();
    let mut options = RenderOptions::new(16, 12, scene.cameras[0].clone());
    options.layer = Layer::Indirect;
    let mut settings = Settings { visibility: Visibility::None, ..quick() };
    (settings.reflected.rays, settings.reflected.frames) = (16, 4);
    let headless = Headless::new(None).unwrap();
    let mut renderer = Renderer::new(headless.context()).unwrap();
    let mut vpls_below = |scene: &Scene, frames: u32, height: f32| {
        (0..frames).for_each(|_| renderer.draw(scene, &settings, &options).unwrap());
        let mut vpls = renderer.read().unwrap().unwrap().vpls;
        vpls.retain(|vpl| vpl.position.y < height);
        (vpls.iter().map(|vpl| vpl.flux().x).sum::<f32>(), vpls)
    };
    let (all, _) = vpls_below(&scene, 1, 1.0);
    let tilt = Mat4::from_rotation_z(0.1);
    scene.instances[1].world_from_object = half(-4.0, -3.0) * tilt;
    let (flux, vpls) = vpls_below(&scene, 4, -1.0);
    assert!(vpls.len() > 10 && flux < 1e-6 * all, "{flux} of {all} in {}", vpls.len());
    assert!(vpls.iter().all(|vpl| vpl.direction.distance(tilt.transform_vector3(Vec3::Y)) < 1e-5));
}

/// A sample of the VPLs is another one where the light is elsewhere; one that stands for a part of them does not follow.
#[test]
fn vpls_of_a_sample_are_placed_anew_at_once() {
    let mut scene = scene();
    let mut options = RenderOptions::new(32, 24, scene.cameras[0].clone());
    options.layer = Layer::Indirect;
    let headless = Headless::new(None).unwrap();
    for (fraction, visibility) in [(0.5, Visibility::Ism), (1.0, Visibility::ShadowMaps), (1.0, Visibility::Mixed)] {
        let mut settings = Settings { visibility, ..quick() };
        (settings.wave.fraction, settings.reflected.frames) = (fraction, 4);
        let mut renderer = Renderer::new(headless.context()).unwrap();
        renderer.draw(&scene, &settings, &options).unwrap();
        scene.lights[0].position.x += 0.1;
        renderer.draw(&scene, &settings, &options).unwrap();
        let got = renderer.read().unwrap().unwrap();
        let mut fresh = Renderer::new(headless.context()).unwrap();
        let fresh = fresh.render(&scene, &settings, &options, &mut |_| ()).unwrap();
        assert!(got.vpls == fresh.vpls && got.linear == fresh.linear, "{visibility:?}");
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

/// A mesh of the same triangles is uploaded alone.
#[test]
fn a_mesh_that_deforms_leaves_the_rest_of_the_scene_where_it_is() {
    let (mut scene, headless) = (scene(), Headless::new(None).unwrap());
    let mut renderer = Renderer::new(headless.context()).unwrap();
    let mut options = RenderOptions::new(48, 36, scene.cameras[0].clone());
    options.layer = Layer::Direct;
    let mut draw = |scene: &Scene| {
        renderer.draw(scene, &quick(), &options).unwrap();
        let drawn = renderer.read().unwrap().unwrap();
        (drawn.linear, drawn.stats.rebuilds.scene)
    };
    let (before, _) = draw(&scene);
    let column = scene.instances.last().unwrap().mesh;
    let mut mesh = Mesh::clone(&scene.meshes[column]);
    mesh.positions.iter_mut().for_each(|p| p.x += 0.3 * p.y);
    scene.meshes[column] = Arc::new(mesh.clone());
    let (bent, uploads) = draw(&scene);
    assert!(bent != before && uploads == 1, "{uploads}");
    let mut fresh = Renderer::new(headless.context()).unwrap();
    assert!(bent == fresh.render(&scene, &quick(), &options, &mut |_| ()).unwrap().linear);
    // The same again is no change, and other triangles are another scene.
    scene.meshes[column] = Arc::new(mesh.clone());
    assert!(draw(&scene) == (bent, 1));
    mesh.indices.truncate(mesh.indices.len() - 3);
    scene.meshes[column] = Arc::new(mesh);
    assert_eq!(draw(&scene).1, 2);
}

/// ISMs that are made in parts are in the end those that are made at once; until then they hide less.
#[test]
fn isms_in_parts_become_those_in_one() {
    let (scene, settings) = (scene(), quick());
    let mut options = RenderOptions::new(32, 24, scene.cameras[0].clone());
    options.layer = Layer::Indirect;
    let light = |rendered: &Rendered| -> f32 { rendered.linear.as_flattened().iter().sum() };
    let headless = Headless::new(None).unwrap();
    let fresh = |settings: &Settings, options: &RenderOptions| {
        Renderer::new(headless.context()).unwrap().render(&scene, settings, options, &mut |_| ()).unwrap()
    };
    let whole = fresh(&settings, &options);
    let nearly_unshadowed = |now: f32, options: &RenderOptions| {
        let none = Settings { visibility: Visibility::None, ..settings.clone() };
        let (none, all) = (light(&fresh(&none, options)), light(&fresh(&settings, options)));
        assert!(
            now <= 1.001 * none && now > all + 0.8 * (none - all),
            "{now} of {none} without shadows, {all} with all"
        );
    };
    let mut renderer = Renderer::new(headless.context()).unwrap();
    renderer.set_ism_budget(Some(128 * 16));
    let (mut before, mut frames) = (f32::INFINITY, 0);
    loop {
        renderer.draw(&scene, &settings, &options).unwrap();
        let settled = renderer.show().unwrap().unwrap().settled;
        let drawn = renderer.read().unwrap().unwrap();
        let now = light(&drawn);
        assert!(now <= 1.001 * before, "frame {frames}: {now} after {before}");
        if frames == 0 {
            nearly_unshadowed(now, &options);
        }
        if settled {
            assert_eq!(drawn.linear, whole.linear);
            break;
        }
        (before, frames) = (now, frames + 1);
        assert!(frames < 100);
    }
    assert!(frames > 4, "{frames}");
    // Other VPLs, in the same atlas: maps that others left there count no more.
    options.seed += 1;
    renderer.draw(&scene, &settings, &options).unwrap();
    nearly_unshadowed(light(&renderer.read().unwrap().unwrap()), &options);
}

/// A light that goes out leaves nothing in the means over frames, and one that goes on is soon as bright as it is.
#[test]
fn means_go_out_with_the_light_and_come_with_it() {
    let mut scene = Scene::builtin("column").unwrap();
    let mut options = RenderOptions::new(32, 24, scene.cameras[0].clone());
    options.layer = Layer::Indirect;
    let mut settings = quick();
    (settings.gather.method, settings.reflected.frames) = (GatherMethod::Interleaved, 4);
    let headless = Headless::new(None).unwrap();
    let mut renderer = Renderer::new(headless.context()).unwrap();
    let mut light = |scene: &Scene, frames: u32| -> f32 {
        for _ in 0..frames {
            renderer.draw(scene, &settings, &options).unwrap();
        }
        renderer.read().unwrap().unwrap().linear.as_flattened().iter().sum()
    };
    let before = light(&scene, 40);
    let intensity = std::mem::take(&mut scene.lights[0].intensity);
    assert_eq!(light(&scene, 5), 0.0);
    scene.lights[0].intensity = intensity;
    let after = light(&scene, 5);
    assert!(before > 0.0 && (after / before - 1.0).abs() < 0.1, "{after} of {before}");
}
