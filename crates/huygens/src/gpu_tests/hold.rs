//! VPLs that are held, and those that light alone.

use std::rc::Rc;

use glam::{Mat4, Vec3};

use crate::gl::{Context, Headless};
use crate::settings::{GatherMethod, Model, Settings, Tier, Visibility};
use crate::{DebugView, Exposure, Layer, RenderOptions, Rendered, Renderer, Scene};

fn quick() -> Settings {
    let mut settings = Settings::default();
    (settings.wave.delta_theta, settings.wave.delta_phi) = (30.0, 30.0);
    (settings.ism.size, settings.ism.points, settings.ism.surfels) = (16, 64, 4096);
    (settings.shadow.size, settings.shadow_maps.count, settings.shadow_maps.size) = (128, 8, 32);
    (settings.reflected.rays, settings.reflected.frames) = (2, 1);
    settings
}

fn column() -> (Scene, RenderOptions) {
    let scene = Scene::builtin("column").unwrap();
    let mut options = RenderOptions::new(48, 32, scene.cameras[0].clone());
    (options.layer, options.exposure) = (Layer::Indirect, Exposure::Ev(0.0));
    (scene, options)
}

/// What a fresh renderer makes of it.
fn fresh(context: &Rc<Context>, scene: &Scene, settings: &Settings, options: &RenderOptions) -> Rendered {
    Renderer::new(context.clone()).unwrap().render(scene, settings, options, &mut |_| ()).unwrap()
}

fn draw(renderer: &mut Renderer, scene: &Scene, settings: &Settings, options: &RenderOptions) -> Rendered {
    renderer.draw(scene, settings, options).unwrap();
    renderer.read().unwrap().unwrap()
}

fn atlas(renderer: &mut Renderer) -> Option<Vec<[u8; 4]>> {
    let shown = renderer.show_debug(DebugView::IsmAtlas, 256, 256).unwrap()?;
    Some(renderer.context().read_texture(shown.texture, shown.width, shown.height))
}

#[test]
fn held_vpls_stay_as_they_are_and_follow_when_let_go() {
    for visibility in [Visibility::Ism, Visibility::Mixed, Visibility::ShadowMaps] {
        let (mut scene, mut options) = column();
        let mut settings = Settings { visibility, ..quick() };
        settings.reflected.frames = if visibility == Visibility::Ism { 4 } else { 1 };
        let headless = Headless::new(None).unwrap();
        let mut renderer = Renderer::new(headless.context()).unwrap();
        // They are made first.
        renderer.hold_vpls(true);
        let before = draw(&mut renderer, &scene, &settings, &options);
        assert!(before.linear == fresh(&headless.context(), &scene, &settings, &options).linear);
        let maps = atlas(&mut renderer);
        let stay = |renderer: &mut Renderer, now: &Rendered| {
            let [was, is] = [&before, now].map(|frame| (frame.stats.rebuilds.vpls, frame.stats.rebuilds.isms));
            assert!(now.vpls == before.vpls && was == is && atlas(renderer) == maps, "{visibility:?}");
        };
        // The light.
        scene.lights[0].position += Vec3::new(1.0, -0.5, 0.4);
        let moved = draw(&mut renderer, &scene, &settings, &options);
        stay(&mut renderer, &moved);
        assert!(moved.linear == before.linear);
        // Direct light follows it.
        options.layer = Layer::Direct;
        let direct = draw(&mut renderer, &scene, &settings, &options);
        assert!(direct.linear == fresh(&headless.context(), &scene, &settings, &options).linear);
        options.layer = Layer::Indirect;
        let again = draw(&mut renderer, &scene, &settings, &options);
        stay(&mut renderer, &again);
        assert!(again.linear == before.linear);
        // A thing, away and back: what hides it from VPLs is where it was.
        let column = scene.instances.len() - 1;
        let place = scene.instances[column].world_from_object;
        scene.instances[column].world_from_object = Mat4::from_translation(Vec3::new(0.4, 0.0, 0.3)) * place;
        let moved = draw(&mut renderer, &scene, &settings, &options);
        stay(&mut renderer, &moved);
        assert!(
            moved.linear != before.linear && moved.stats.rebuilds.shadow_maps == again.stats.rebuilds.shadow_maps + 1
        );
        scene.instances[column].world_from_object = place;
        assert!(draw(&mut renderer, &scene, &settings, &options).linear == before.linear);
        // The camera.
        options.camera.eye.x += 0.3;
        let elsewhere = draw(&mut renderer, &scene, &settings, &options);
        stay(&mut renderer, &elsewhere);
        assert!(elsewhere.linear != before.linear);
        renderer.draw(&scene, &settings, &options).unwrap();
        assert!(renderer.show().unwrap().is_some());
        // Let go, they are those of a fresh renderer.
        renderer.hold_vpls(false);
        let fresh = fresh(&headless.context(), &scene, &settings, &options);
        let now = draw(&mut renderer, &scene, &settings, &options);
        assert!(now.vpls == fresh.vpls && now.linear == fresh.linear && now.vpls != before.vpls, "{visibility:?}");
        // And follow the light again.
        scene.lights[0].intensity *= 2.0;
        let now = (0..4).map(|_| draw(&mut renderer, &scene, &settings, &options)).last().unwrap();
        let ratio = now.stats.lattice_flux_w / fresh.stats.lattice_flux_w;
        assert!((ratio - 2.0).abs() < 0.2, "{visibility:?}: {ratio}");
    }
}

/// Flux that is on its way when they are held comes when they are let go.
#[test]
fn vpls_are_held_half_way() {
    let (mut scene, options) = column();
    let mut settings = quick();
    settings.reflected.frames = 4;
    let headless = Headless::new(None).unwrap();
    let mut renderer = Renderer::new(headless.context()).unwrap();
    let mut flux = |scene: &Scene, hold| {
        renderer.hold_vpls(hold);
        let flux = draw(&mut renderer, scene, &settings, &options).stats.lattice_flux_w;
        (flux, renderer.show().unwrap().unwrap())
    };
    let (first, _) = flux(&scene, false);
    scene.lights[0].intensity *= 5.0;
    // A quarter comes in each frame.
    let (half, _) = [flux(&scene, false), flux(&scene, false)][1];
    let (held, _) = flux(&scene, true);
    let (still, shown) = [flux(&scene, true), flux(&scene, true), flux(&scene, true)][2];
    assert!(half > 2.0 * first && half < 4.0 * first && held == half && still == half, "{first} {half} {held} {still}");
    assert!(shown.settled);
    let (end, _) = [flux(&scene, false), flux(&scene, false), flux(&scene, false)][2];
    assert!(end > 4.0 * first, "{first} {end}");
}

/// Maps that are made in parts come while they are held.
#[test]
fn held_vpls_get_the_maps_that_they_have_not() {
    let (mut scene, options) = column();
    let headless = Headless::new(None).unwrap();
    let expected = fresh(&headless.context(), &scene, &quick(), &options);
    let mut renderer = Renderer::new(headless.context()).unwrap();
    renderer.set_ism_budget(Some(64 * 8));
    renderer.hold_vpls(true);
    for frame in 0.. {
        let drawn = draw(&mut renderer, &scene, &quick(), &options);
        if renderer.show().unwrap().unwrap().settled {
            assert!(frame > 2 && drawn.linear == expected.linear, "{frame}");
            break;
        }
        assert!(frame < 100);
        scene.lights[0].position.x += if frame < 2 { 0.1 } else { 0.0 };
    }
}

/// Another draw of the lattice waits; the VPLs of another scene do not.
#[test]
fn held_vpls_are_not_drawn_anew_but_in_another_scene() {
    let (scene, options) = column();
    let mut settings = quick();
    (settings.wave.redraw, settings.wave.fraction) = (true, 0.5);
    let headless = Headless::new(None).unwrap();
    let mut renderer = Renderer::new(headless.context()).unwrap();
    let mut vpls = |scene: &Scene, settings: &Settings| {
        renderer.hold_vpls(true);
        draw(&mut renderer, scene, settings, &options).vpls
    };
    let first = vpls(&scene, &settings);
    assert!(vpls(&scene, &settings) == first);
    settings.wave.fraction = 0.25;
    let fewer = vpls(&scene, &settings);
    assert!(fewer.len() < first.len() && vpls(&scene, &settings) == fewer);
    let mut other = scene.clone();
    other.materials[0].base_color *= 0.5;
    assert!(vpls(&other, &settings) != fewer);
}

#[test]
fn vpls_that_light_alone_sum_to_all_of_them() {
    let (scene, options) = column();
    let mut settings = Settings { visibility: Visibility::None, model: Model::Wave, ..quick() };
    (settings.wave.delta_theta, settings.wave.delta_phi, settings.wave.shells) = (45.0, 90.0, 2);
    for (tier, method, visibility) in [
        (Tier::Fragment, GatherMethod::Exact, Visibility::None),
        (Tier::Fragment, GatherMethod::Interleaved, Visibility::None),
        (Tier::Compute, GatherMethod::Exact, Visibility::None),
        (Tier::Fragment, GatherMethod::Exact, Visibility::Mixed),
    ] {
        (settings.tier, settings.gather.method, settings.visibility) = (tier, method, visibility);
        settings.shadow_maps.count = 3;
        let mut exact = settings.clone();
        exact.gather.method = GatherMethod::Exact;
        let headless = Headless::new(None).unwrap();
        let whole = fresh(&headless.context(), &scene, &exact, &options);
        let mut renderer = Renderer::new(headless.context()).unwrap();
        let all = draw(&mut renderer, &scene, &settings, &options);
        let mut sum = vec![Vec3::ZERO; whole.linear.len()];
        let (mut lit, mut rebuilds) = (0, all.stats.rebuilds.vpls);
        for index in 0..all.vpls.len() as u32 {
            renderer.only_vpl(Some(index));
            let alone = draw(&mut renderer, &scene, &settings, &options);
            assert!(alone.vpls == all.vpls);
            // Settled after one frame.
            let again = draw(&mut renderer, &scene, &settings, &options);
            assert!(renderer.show().unwrap().unwrap().settled && again.linear == alone.linear);
            lit += usize::from(alone.linear.iter().any(|c| *c != [0.0; 3]));
            sum.iter_mut().zip(&alone.linear).for_each(|(sum, &c)| *sum += Vec3::from(c));
            rebuilds = rebuilds.max(alone.stats.rebuilds.vpls);
        }
        let count = all.vpls.len();
        println!("{tier:?} {method:?} {visibility:?}: {lit} of {count} VPLs are seen");
        assert!((8..100).contains(&count) && lit > count / 2 && rebuilds == all.stats.rebuilds.vpls);
        for (sum, whole) in sum.iter().zip(&whole.linear) {
            let whole = Vec3::from(*whole);
            assert!((*sum - whole).abs().max_element() <= 1e-4 * whole.max_element().max(1e-3), "{sum} {whole}");
        }
        renderer.only_vpl(Some(count as u32));
        assert!(draw(&mut renderer, &scene, &settings, &options).linear.iter().all(|c| *c == [0.0; 3]));
        renderer.only_vpl(None);
        let back = draw(&mut renderer, &scene, &settings, &options);
        assert!(method == GatherMethod::Interleaved || back.linear == whole.linear);
        let mean = |picture: &[[f32; 3]]| picture.as_flattened().iter().sum::<f32>();
        assert!((mean(&back.linear) / mean(&whole.linear) - 1.0).abs() < 0.2);
    }
}
