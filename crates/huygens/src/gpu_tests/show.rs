//! What a display is shown of frames, without waiting.

use std::rc::Rc;

use crate::gl::{Context, Format, Headless, Texture};
use crate::settings::{GatherMethod, Settings};
use crate::{DebugView, Exposure, Layer, RenderOptions, Rendered, Renderer, Scene, Shown};

fn quick() -> Settings {
    let mut settings = Settings::default();
    (settings.wave.delta_theta, settings.wave.delta_phi) = (15.0, 30.0);
    (settings.ism.size, settings.ism.points, settings.ism.surfels) = (16, 64, 4096);
    settings.shadow.size = 128;
    (settings.reflected.rays, settings.reflected.frames) = (2, 1);
    settings
}

fn column() -> (Scene, RenderOptions) {
    let scene = Scene::builtin("column").unwrap();
    let options = RenderOptions::new(48, 32, scene.cameras[0].clone());
    (scene, options)
}

/// What a fresh renderer makes of it.
fn fresh(context: &Rc<Context>, scene: &Scene, settings: &Settings, options: &RenderOptions) -> Rendered {
    Renderer::new(context.clone()).unwrap().render(scene, settings, options, &mut |_| ()).unwrap()
}

/// egui, for one, draws to whatever framebuffer is bound.
#[test]
fn nothing_of_ours_stays_bound_after_any_call() {
    let (scene, options) = column();
    let settings = quick();
    let headless = Headless::new(None).unwrap();
    let context = headless.context();
    let mut renderer = Renderer::new(context.clone()).unwrap();
    let mut after = |call: &str, work: &mut dyn FnMut(&mut Renderer)| {
        work(&mut renderer);
        assert!(context.has_nothing_bound(), "{call}");
    };
    after("render", &mut |r| drop(r.render(&scene, &settings, &options, &mut |_| ()).unwrap()));
    after("draw", &mut |r| r.draw(&scene, &settings, &options).unwrap());
    after("show", &mut |r| assert!(r.show().unwrap().is_some()));
    after("show_debug", &mut |r| assert!(r.show_debug(DebugView::IsmAtlas, 32, 32).unwrap().is_some()));
    after("read", &mut |r| drop(r.read().unwrap()));
    after("pass_times", &mut |r| drop(r.pass_times()));
    let huge = RenderOptions { width: 1 << 20, ..options.clone() };
    after("a draw that fails", &mut |r| assert!(r.draw(&scene, &settings, &huge).is_err()));
}

/// Draws and shows the same until that is settled.
fn settle(renderer: &mut Renderer, scene: &Scene, settings: &Settings, options: &RenderOptions) -> Shown {
    for _ in 0..200 {
        renderer.draw(scene, settings, options).unwrap();
        let shown = renderer.show().unwrap().unwrap();
        if shown.settled {
            return shown;
        }
    }
    panic!("not settled after 200 frames");
}

/// Pixels of what is shown, rows from the top.
fn picture(renderer: &Renderer, shown: &Shown) -> Vec<[u8; 4]> {
    let pixels = renderer.context().read_texture(shown.texture, shown.width, shown.height);
    pixels.chunks(shown.width as usize).rev().flatten().copied().collect()
}

fn close(a: &[[u8; 4]], b: &[[u8; 4]]) -> bool {
    a.len() == b.len() && a.as_flattened().iter().zip(b.as_flattened()).all(|(a, b)| a.abs_diff(*b) <= 1)
}

#[test]
fn what_is_shown_is_what_is_rendered_and_stays_in_one_texture() {
    let (scene, mut options) = column();
    options.exposure = Exposure::Ev(1.5);
    let headless = Headless::new(None).unwrap();
    let mut renderer = Renderer::new(headless.context()).unwrap();
    assert!(renderer.show().unwrap().is_none() && renderer.late_pass_times().is_none());
    let mut names = Vec::new();
    let mut interleaved = quick();
    interleaved.gather.method = GatherMethod::Interleaved;
    for (settings, size) in [(quick(), [48, 32]), (quick(), [32, 48]), (interleaved, [48, 32])] {
        [options.width, options.height] = size;
        let shown = settle(&mut renderer, &scene, &settings, &options);
        let picture = picture(&renderer, &shown);
        let Rendered { display, .. } = renderer.read().unwrap().unwrap();
        assert_eq!((shown.width, shown.height, shown.exposure_ev), (options.width, options.height, 1.5));
        assert!(
            close(&picture, &display)
                && close(&picture, &fresh(&headless.context(), &scene, &settings, &options).display)
        );
        names.push(shown.texture);
    }
    assert!(names.iter().all(|name| *name == names[0]), "{names:?}");
}

#[test]
fn an_automatic_exposure_comes_late_but_comes() {
    let (scene, options) = column();
    let (settings, headless) = (quick(), Headless::new(None).unwrap());
    let expected = fresh(&headless.context(), &scene, &settings, &options);
    let mut renderer = Renderer::new(headless.context()).unwrap();
    // From a picture that is darker.
    let mut dark = scene.clone();
    dark.lights[0].intensity *= 0.1;
    let first = settle(&mut renderer, &dark, &settings, &options);
    let shown = settle(&mut renderer, &scene, &settings, &options);
    assert!(first.exposure_ev > shown.exposure_ev + 1.0, "{first:?} {shown:?}");
    assert_eq!(shown.exposure_ev, expected.stats.exposure_ev);
    let rebuilds = renderer.rebuilds();
    renderer.wait();
    for _ in 0..3 {
        renderer.draw(&scene, &settings, &options).unwrap();
        let again = renderer.show().unwrap().unwrap();
        renderer.wait();
        assert_eq!(again, shown);
    }
    assert_eq!(renderer.rebuilds(), rebuilds);
}

/// What is on its way when another picture comes is of the old one.
#[test]
fn an_automatic_exposure_is_that_of_the_layer() {
    let (scene, mut options) = column();
    let (settings, headless) = (quick(), Headless::new(None).unwrap());
    let mut renderer = Renderer::new(headless.context()).unwrap();
    for layer in [Layer::Final, Layer::Direct, Layer::Indirect, Layer::Direct] {
        options.layer = layer;
        let expected = fresh(&headless.context(), &scene, &settings, &options);
        let shown = settle(&mut renderer, &scene, &settings, &options);
        assert_eq!(shown.exposure_ev, expected.stats.exposure_ev, "{layer:?}");
        // Time for what is on its way to come.
        renderer.wait();
    }
}

#[test]
fn pass_times_come_once_for_each_frame_but_the_last() {
    let (scene, options) = column();
    let headless = Headless::new(None).unwrap();
    let mut renderer = Renderer::new(headless.context()).unwrap();
    let frame = |renderer: &mut Renderer| {
        renderer.draw(&scene, &quick(), &options).unwrap();
        renderer.show().unwrap();
        renderer.wait();
    };
    frame(&mut renderer);
    assert!(renderer.late_pass_times().is_none());
    frame(&mut renderer);
    let first = renderer.late_pass_times().unwrap();
    frame(&mut renderer);
    let second = renderer.late_pass_times().unwrap();
    assert!(renderer.late_pass_times().is_none());
    let has = |times: &[crate::PassTime], name| times.iter().any(|time| time.name == name);
    for name in ["gbuffer", "direct", "composite", "tonemap"] {
        assert!(has(&first, name) && has(&second, name), "{name}: {first:?} {second:?}");
    }
    // Made once.
    for name in ["shadow", "vpl", "ism"] {
        assert!(has(&first, name) && !has(&second, name), "{name}: {first:?} {second:?}");
    }
}

#[test]
fn errors_of_the_caller_are_not_ours() {
    let (scene, options) = column();
    let headless = Headless::new(None).unwrap();
    let context = headless.context();
    let mut renderer = Renderer::new(context.clone()).unwrap();
    for _ in 0..2 {
        context.provoke_an_error();
        renderer.draw(&scene, &quick(), &options).unwrap();
        context.provoke_an_error();
        assert!(renderer.show().unwrap().is_some());
    }
}

#[test]
fn memory_is_given_back() {
    let (scene, mut options) = column();
    let headless = Headless::new(None).unwrap();
    let context = headless.context();
    let _other = Texture::new(&context, Format::Rgba8, 64, 64).unwrap();
    let before = context.memory();
    assert_eq!(before, 4 * 64 * 64);
    let mut renderer = Renderer::new(context.clone()).unwrap();
    settle(&mut renderer, &scene, &quick(), &options);
    let small = context.memory();
    // At least the G-buffer, 44 bytes a pixel, and the light's shadow map, 12 bytes a texel.
    assert!(small >= before + 44 * 48 * 32 + 12 * 6 * 128 * 128, "{before} {small}");
    options.width *= 2;
    settle(&mut renderer, &scene, &quick(), &options);
    assert!(context.memory() >= small + 44 * 48 * 32, "{small} {}", context.memory());
    drop(renderer);
    assert_eq!(context.memory(), before);
}

#[test]
fn vpls_and_their_maps_outlast_a_look_at_other_layers() {
    let (mut scene, mut options) = column();
    options.exposure = Exposure::Ev(1.5);
    let settings = quick();
    let headless = Headless::new(None).unwrap();
    let context = headless.context();
    let mut renderer = Renderer::new(context.clone()).unwrap();
    renderer.draw(&scene, &settings, &options).unwrap();
    let rebuilds = renderer.rebuilds();
    for layer in [Layer::Direct, Layer::Albedo, Layer::Indirect, Layer::Final] {
        options.layer = layer;
        renderer.draw(&scene, &settings, &options).unwrap();
        assert_eq!(renderer.rebuilds(), rebuilds, "{layer:?}");
    }
    // What changes meanwhile is taken up.
    options.layer = Layer::Direct;
    scene.lights[0].position.x += 0.3;
    renderer.draw(&scene, &settings, &options).unwrap();
    options.layer = Layer::Final;
    let shown = settle(&mut renderer, &scene, &settings, &options);
    let truth = fresh(&context, &scene, &settings, &options);
    assert!(close(&picture(&renderer, &shown), &truth.display));
}
