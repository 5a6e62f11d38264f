//! The interleaved gather against its twin and against the exact gather.

use glam::{Mat4, Vec3};

use super::{builtins, floor, light, render, with_frame};
use crate::gl::Headless;
use crate::passes::near::Lists;
use crate::reference::gather;
use crate::settings::{GatherMethod, Model, Settings, Tier, Visibility};
use crate::{Exposure, Layer, Profile, RenderOptions, Renderer, Scene};

fn interleaved(n: u32, half: bool) -> Settings {
    let mut settings = Settings { visibility: Visibility::None, ..Settings::default() };
    (settings.wave.delta_theta, settings.wave.delta_phi) = (15.0, 15.0);
    (settings.gather.method, settings.gather.interleave, settings.gather.half) = (GatherMethod::Interleaved, n, half);
    settings
}

fn exact() -> Settings {
    Settings { gather: Settings::default().gather, ..interleaved(2, false) }
}

/// Each frame for itself.
fn alone(n: u32, half: bool) -> Settings {
    let mut settings = interleaved(n, half);
    settings.gather.history = 1;
    settings
}

/// The subset of a place: the bits of its coordinates, in turn, the other way round.
fn subset(n: u32, place: [i32; 2]) -> usize {
    (0..n.ilog2())
        .fold(0, |subset, bit| subset * 4 + (place[0] >> bit & 1) as usize + 2 * (place[1] >> bit & 1) as usize)
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
                // Half way between two columns of pixels that have means, it has the mean of both.
                let columns = if half && x % 2 == 0 { -1..=0 } else { 0..=0 };
                let share = 1.0 / columns.clone().count() as f64;
                let around = (-reach..=reach).flat_map(|i| (-reach..=reach).map(move |j| (i, j)));
                for (column, (i, j)) in columns.flat_map(|column| around.clone().map(move |at| (column, at))) {
                    let (cell_x, cell_y) = (x / step + column + i, y / step + j);
                    let pixel = at(cell_x * step + step / 2, cell_y * step + step / 2);
                    let subset = subset(n, [cell_x, cell_y]);
                    let in_subset = |vpl: usize| vpl % square as usize == subset;
                    let weight = [i, j].map(|i| if i.abs() == reach { 0.5 } else { 1.0 }).iter().product::<f64>();
                    expected +=
                        share * weight * gather::irradiance(&frame.vpls, pixel.position, pixel.normal, &in_subset).y;
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
        let [one, sixteen] =
            [1, 16].map(|frames| render(&scene, &exact(), &RenderOptions { frames, ..options.clone() }).linear);
        let mut errors = Vec::new();
        for (n, half, frames) in [(2, false, 1), (4, false, 16), (4, false, 1), (8, false, 1)] {
            options.frames = frames;
            let (got, exact) =
                (render(&scene, &alone(n, half), &options).linear, if frames == 1 { &one } else { &sixteen });
            let (mut sum, mut difference, mut total) = (Vec3::ZERO, 0.0, Vec3::ZERO);
            for (&got, &exact) in got.iter().zip(exact) {
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
        // As many frames as subsets: each pixel has all of them, if not at the same point.
        assert!(errors[1] < 0.3 * errors[2], "{}: {errors:?}", scene.name);
        assert!(errors[0] < errors[2] && errors[1] < errors[2] && errors[2] < errors[3], "{}: {errors:?}", scene.name);
    }
}

/// A picture that has no frames before it is not left with the few VPLs of one.
#[test]
fn a_picture_alone_has_enough_vpls() {
    let scene = Scene::builtin("atrium").unwrap();
    let errors = [0, 1].map(|seed| {
        let mut options = RenderOptions { seed, ..RenderOptions::new(64, 64, scene.cameras[0].clone()) };
        options.layer = Layer::Indirect;
        let expected = render(&scene, &exact(), &options).linear;
        [(alone(8, false), 1), (interleaved(8, false), 1), (interleaved(8, false), 4)].map(|(settings, frames)| {
            let options = RenderOptions { frames, ..options.clone() };
            let expected = if frames == 1 { &expected } else { &render(&scene, &exact(), &options).linear };
            off(&render(&scene, &settings, &options).linear, expected)
        })
    });
    let [frame, picture, pictures] = [0, 1, 2].map(|k| 0.5 * (errors[0][k] + errors[1][k]));
    println!("{frame} {picture} {pictures}");
    assert!(picture < 0.6 * frame && pictures < 0.6 * picture, "{frame} {picture} {pictures}");
}

/// Where there are more VPLs than a pixel is to sum, it sums others in every frame, and all of them in time.
#[test]
fn a_limit_on_the_vpls_of_a_pixel_costs_frames_but_no_vpls() {
    let scene = Scene::builtin("column").unwrap();
    let mut options = RenderOptions::new(48, 40, scene.cameras[0].clone());
    options.layer = Layer::Indirect;
    let expected = render(&scene, &exact(), &options).linear;
    let mut settings = interleaved(4, false);
    // About 700 VPLs in 16 subsets are 44 each: then there are five times as many.
    settings.gather.most = 10;
    let got = draw(&vec![(scene.clone(), settings, options.clone()); 84]);
    let errors: Vec<f32> = got.iter().map(|got| off(got, &expected)).collect();
    println!("{errors:.5?}");
    let done = got.windows(2).position(|pair| pair[0] == pair[1]).unwrap();
    assert!((64..84).contains(&done) && errors[done] < 1e-5 && errors[15] > 10.0 * errors[done], "{done}");
}

/// Mean difference of two pictures over the mean of the second.
fn off(got: &[[f32; 3]], expected: &[[f32; 3]]) -> f32 {
    let pairs = || got.as_flattened().iter().zip(expected.as_flattened());
    pairs().map(|(a, b)| (a - b).abs()).sum::<f32>() / pairs().map(|(_, b)| b).sum::<f32>()
}

/// The picture after each of these frames.
fn draw(frames: &[(Scene, Settings, RenderOptions)]) -> Vec<Vec<[f32; 3]>> {
    let headless = Headless::new(None).unwrap();
    let mut renderer = Renderer::new(headless.context()).unwrap();
    let frame = |(scene, settings, options): &(Scene, Settings, RenderOptions)| {
        renderer.draw(scene, settings, options).unwrap();
        renderer.read().unwrap().unwrap().linear
    };
    frames.iter().map(frame).collect()
}

/// What near VPLs give is taken from the frame before while the camera moves, made anew in turn, and at once where the light
/// changes.
#[test]
fn near_sums_go_on_while_only_the_camera_moves() {
    for tier in [Tier::Fragment, Tier::Compute] {
        let mut scene = Scene::builtin("atrium").unwrap();
        let mut settings = Settings { visibility: Visibility::Ism, tier, ..interleaved(4, false) };
        (settings.ism.points, settings.ism.size) = (256, 16);
        // VPLs are what they are in a picture alone.
        settings.reflected.frames = 1;
        let headless = Headless::new(None).unwrap();
        let mut renderer = Renderer::new(headless.context()).unwrap();
        let options = |k: usize| {
            let mut options = RenderOptions::new(192, 144, scene.cameras[0].clone());
            options.camera.eye += Vec3::new(0.06, 0.0, 0.03) * k as f32;
            options
        };
        let options: Vec<RenderOptions> = (0..14).map(options).collect();
        let near = |renderer: &mut Renderer, scene: &Scene, k: usize| {
            renderer.draw(scene, &settings, &options[k]).unwrap();
            renderer.frame.as_ref().unwrap().gather.read_near()
        };
        let anew = |scene: &Scene, k: usize| near(&mut Renderer::new(headless.context()).unwrap(), scene, k);
        let apart = |got: &[[f32; 4]], expected: &[[f32; 4]]| {
            let sum =
                |of: &dyn Fn(&[f32; 4], &[f32; 4]) -> f32| got.iter().zip(expected).map(|(a, b)| of(a, b)).sum::<f32>();
            let total = sum(&|_, b| b[1]);
            assert!(total > 0.0);
            [sum(&|a, b| (a[1] - b[1]).abs()) / total, sum(&|a, b| a[1] - b[1]) / total]
        };
        let kept = |got: &[[f32; 4]]| got.iter().filter(|sum| sum[3] > 0.0).count() as f32 / got.len() as f32;

        // They are one to fifteen frames old. Taken from their own pixels, where those show the same plane, they are .24 of `stays` off.
        let moving = (0..14).map(|k| near(&mut renderer, &scene, k)).last().unwrap();
        let ([off, bias], [stays, _]) = (apart(&moving, &anew(&scene, 13)), apart(&anew(&scene, 9), &anew(&scene, 13)));
        println!(
            "{tier:?}: {:.3} kept, {off:.4} off, bias {bias:.4}; had they stayed in their pixels {stays:.4}",
            kept(&moving)
        );
        assert!(
            kept(&moving) > 0.76 && kept(&moving) < 0.9 && bias.abs() < 0.01 && off < 0.19 * stays,
            "{off} {bias} {stays}"
        );

        // At rest all are made anew, two kinds of block in each frame.
        let resting = (0..4).map(|_| near(&mut renderer, &scene, 13)).last().unwrap();
        assert!(apart(&resting, &anew(&scene, 13))[0] < 1e-6);

        for light in &mut scene.lights {
            light.intensity *= 2.0;
        }
        let lit = near(&mut renderer, &scene, 13);
        assert_eq!(kept(&lit), 0.0);
        assert!(kept(&near(&mut renderer, &scene, 13)) > 0.6);
        let last = scene.instances.len() - 1;
        scene.instances[last].world_from_object.w_axis.y += 0.1;
        assert_eq!(kept(&near(&mut renderer, &scene, 13)), 0.0);
    }
}

/// What was kept of the frame before would have light of all ranges.
#[test]
fn near_sums_of_vpls_in_several_ranges_are_made_anew() {
    for tier in [Tier::Fragment, Tier::Compute] {
        let scene = Scene::builtin("cornell").unwrap();
        let mut settings = Settings { visibility: Visibility::Mixed, tier, ..interleaved(4, false) };
        (settings.ism.points, settings.ism.size, settings.shadow_maps.count) = (256, 16, 16);
        let headless = Headless::new(None).unwrap();
        let mut renderer = Renderer::new(headless.context()).unwrap();
        let options = RenderOptions::new(48, 40, scene.cameras[0].clone());
        let mut near = || {
            renderer.draw(&scene, &settings, &options).unwrap();
            renderer.frame.as_ref().unwrap().gather.read_near()
        };
        let (first, second) = (near(), near());
        assert!(first.iter().any(|sum| sum[1] > 0.0) && first == second);
    }
}

/// When every pixel has had every subset, near VPLs and far ones together are the exact sum, and stay that.
#[test]
fn a_still_view_becomes_that_of_the_exact_gather() {
    for (scene, visibility) in builtins().zip([Visibility::Ism, Visibility::None, Visibility::Mixed, Visibility::Dao]) {
        let mut options = RenderOptions::new(48, 40, scene.cameras[0].clone());
        options.layer = Layer::Indirect;
        let with = |settings: Settings| {
            let mut settings = Settings { visibility, ..settings };
            (settings.ism.points, settings.ism.size, settings.shadow_maps.count) = (128, 16, 16);
            settings
        };
        let expected = render(&scene, &with(exact()), &options).linear;
        let got = draw(&vec![(scene.clone(), with(interleaved(4, false)), options.clone()); 18]);
        let errors: Vec<f32> = got.iter().map(|got| off(got, &expected)).collect();
        println!("{} {visibility:?}: {errors:.5?}", scene.name);
        assert!(errors[15] < 1e-5 && errors[0] > 10.0 * errors[15], "{}: {errors:?}", scene.name);
        assert!(got[15] == got[16] && got[15] == got[17], "{}", scene.name);

        // After another view too, in time.
        let mut elsewhere = options.clone();
        elsewhere.camera.eye.x += 0.05;
        let frame = |options: &RenderOptions| (scene.clone(), with(interleaved(4, false)), options.clone());
        let mut frames = vec![frame(&elsewhere); 8];
        frames.extend(vec![frame(&options); 65]);
        let got = draw(&frames);
        let errors: Vec<f32> = got[8..].iter().map(|got| off(got, &expected)).collect();
        assert!(errors[63] < 0.3 * errors[0] && got[8 + 64] == got[8 + 63], "{}: {errors:.5?}", scene.name);
    }
}

/// Where one of 2 × 2 pixels takes part, also the last of an odd number does.
#[test]
fn half_of_an_odd_size_reaches_the_edge() {
    for tier in [Tier::Fragment, Tier::Compute] {
        let scene = Scene::builtin("corridor").unwrap();
        let mut options = RenderOptions::new(49, 41, scene.cameras[0].clone());
        options.layer = Layer::Indirect;
        let edge = |picture: &[[f32; 3]]| {
            let at = picture.iter().enumerate().filter(|(k, _)| k % 49 == 48 || k / 49 == 0 || k / 49 == 40);
            at.map(|(_, rgb)| rgb[1]).sum::<f32>()
        };
        let expected = edge(&render(&scene, &Settings { tier, ..exact() }, &options).linear);
        let frames = vec![(scene, Settings { tier, ..interleaved(4, true) }, options); 16];
        let got = edge(draw(&frames).last().unwrap()) / expected;
        println!("{tier:?}: {got}");
        assert!((got - 1.0).abs() < 0.05, "{tier:?}: {got}");
    }
}

/// Along edges of things, where no pixel that has a mean is of the surface of one between them.
#[test]
fn half_resolution_leaves_no_pixel_dark() {
    for (tier, name) in [Tier::Fragment, Tier::Compute].into_iter().flat_map(|t| ["corridor", "atrium"].map(|n| (t, n)))
    {
        let scene = Scene::builtin(name).unwrap();
        let mut options = RenderOptions::new(80, 46, scene.cameras[0].clone());
        options.layer = Layer::Indirect;
        let expected = render(&scene, &Settings { tier, ..exact() }, &options).linear;
        let got = render(&scene, &Settings { tier, ..alone(4, true) }, &options).linear;
        let is_dark = |(got, expected): &(&[f32; 3], &[f32; 3])| got[1] < 0.2 * expected[1];
        let dark = got.iter().zip(&expected).filter(is_dark).count();
        println!("{tier:?} {name}: {dark} of {}, {} off", got.len(), off(&got, &expected));
        assert!(dark == 0, "{tier:?} {name}: {dark}");
    }
}

/// Also with shadow maps alone, and where VPLs are near from beyond the distance within which they are rectangles: those
/// in a spot of light are much brighter than the others.
#[test]
fn near_vpls_and_far_ones_are_the_exact_sum_where_light_falls_in_a_spot() {
    let mut scene = Scene::builtin("cornell").unwrap();
    scene.lights[0].profile = Profile::Spot { inner: 0.15, outer: 0.2 };
    scene.lights[0].axis = Vec3::NEG_Y;
    let mut options = RenderOptions::new(48, 40, scene.cameras[0].clone());
    options.layer = Layer::Indirect;
    for visibility in [Visibility::None, Visibility::ShadowMaps] {
        let with = |settings: Settings| Settings { visibility, ..settings };
        let exact = render(&scene, &with(exact()), &options);
        // Some are near from farther than they are rectangles.
        let reaches = Lists::new(&exact.vpls, &scene.bounds().unwrap()).reaches;
        assert!(reaches.iter().zip(&exact.vpls).any(|(&reach, vpl)| reach > vpl.near()), "{visibility:?}");
        let expected = exact.linear;
        let got = draw(&vec![(scene.clone(), with(interleaved(4, false)), options.clone()); 16]);
        let errors: Vec<f32> = got.iter().map(|got| off(got, &expected)).collect();
        assert!(errors[15] < 1e-5 && errors[0] > 10.0 * errors[15], "{visibility:?}: {errors:?}");
    }
}

/// The turns of a picture alone have one motion before them all, which is no motion between them.
#[test]
fn a_picture_alone_is_the_same_after_something_moved() {
    let scene = Scene::builtin("cornell").unwrap();
    let mut moved = scene.clone();
    let last = moved.instances.len() - 1;
    moved.instances[last].world_from_object =
        Mat4::from_translation(Vec3::Z * 0.2) * moved.instances[last].world_from_object;
    let mut options = RenderOptions::new(48, 40, scene.cameras[0].clone());
    options.layer = Layer::Indirect;
    let mut settings = interleaved(4, false);
    // Several turns.
    settings.gather.most = 8;
    let headless = Headless::new(None).unwrap();
    let mut renderer = Renderer::new(headless.context()).unwrap();
    renderer.draw(&scene, &settings, &options).unwrap();
    let got = renderer.render(&moved, &settings, &options, &mut |_| {}).unwrap();
    let mut fresh = Renderer::new(headless.context()).unwrap();
    let expected = fresh.render(&moved, &settings, &options, &mut |_| {}).unwrap();
    assert!(got.linear == expected.linear);
}

/// Where subsets are many, two turns of them are enough after another view.
#[test]
fn a_view_of_many_subsets_settles_in_two_turns() {
    let scene = Scene::builtin("cornell").unwrap();
    let mut options = RenderOptions::new(24, 20, scene.cameras[0].clone());
    (options.layer, options.exposure) = (Layer::Indirect, Exposure::Ev(0.0));
    let with = |settings: Settings| Settings { model: Model::Wave, ..settings };
    let expected = render(&scene, &with(exact()), &options).linear;
    let mut settings = with(interleaved(4, false));
    settings.gather.most = 4;
    let mut elsewhere = options.clone();
    elsewhere.camera.eye.x += 0.05;

    let headless = Headless::new(None).unwrap();
    let mut renderer = Renderer::new(headless.context()).unwrap();
    (0..8).for_each(|_| renderer.draw(&scene, &settings, &elsewhere).unwrap());
    let subsets = 16 * renderer.vpls().len().div_ceil(16 * 4);
    assert!(subsets > 128, "{subsets}");
    let mut frame = |number: usize| {
        renderer.draw(&scene, &settings, &options).unwrap();
        let share = number as f32 / (2 * subsets) as f32;
        assert!((renderer.converged() - share.min(1.0)).abs() < 1e-5, "{number}: {}", renderer.converged());
        (renderer.read().unwrap().unwrap().linear, renderer.show().unwrap().unwrap().settled)
    };
    let shown: Vec<_> = (1..2 * subsets + 2).map(&mut frame).collect();
    let settled = shown.iter().position(|(_, settled)| *settled);
    assert_eq!(settled, Some(2 * subsets), "one frame after the last turn");
    let (first, last) = (off(&shown[0].0, &expected), off(&shown[2 * subsets - 1].0, &expected));
    println!("{first} {last}");
    assert!(last < 0.1 * first && shown[2 * subsets].0 == shown[2 * subsets - 1].0, "{first} {last}");
}

/// Lists and what reads them come with the model, though nothing else changes.
#[test]
fn near_vpls_are_apart_whatever_the_model_was_before() {
    let scene = Scene::builtin("cornell").unwrap();
    let mut options = RenderOptions::new(32, 32, scene.cameras[0].clone());
    options.layer = Layer::Indirect;
    let mut elsewhere = options.clone();
    elsewhere.camera.eye.x += 0.05;
    let mut settings = alone(4, false);
    settings.gather.specular = false;
    // With other means, programs are made anew, too.
    let mut other = settings.clone();
    other.gather.history = 2;
    let shown = |before: &Settings| {
        let headless = Headless::new(None).unwrap();
        let mut renderer = Renderer::new(headless.context()).unwrap();
        // As many turns of the subsets.
        (0..16).for_each(|_| renderer.draw(&scene, before, &elsewhere).unwrap());
        renderer.draw(&scene, &settings, &options).unwrap();
        renderer.read().unwrap().unwrap().linear
    };
    let wave = Settings { model: Model::Wave, ..settings.clone() };
    assert_eq!(off(&shown(&wave), &shown(&other)), 0.0);
}

/// Means follow surfaces: a view or a thing that moves is nearer to the exact gather than each of its frames alone.
#[test]
fn means_follow_what_moves() {
    let scene = Scene::builtin("cornell").unwrap();
    let options = |k: usize| {
        let mut options = RenderOptions::new(64, 64, scene.cameras[0].clone());
        options.layer = Layer::Indirect;
        options.camera.eye.x += 0.01 * k as f32;
        options
    };
    let still = |_| options(0);
    let stands = |_| scene.clone();
    let last = scene.instances.len() - 1;
    let moves = |k: usize| {
        let mut scene = scene.clone();
        // Toward the camera: what stays where it was is then on no plane of the thing.
        let to = Mat4::from_translation(Vec3::Z * 0.02 * k as f32);
        scene.instances[last].world_from_object = to * scene.instances[last].world_from_object;
        scene
    };
    let frames = 12;
    for (name, scene_of, options_of) in [
        ("camera", &stands as &dyn Fn(usize) -> Scene, &options as &dyn Fn(usize) -> RenderOptions),
        ("object", &moves, &still),
    ] {
        // In the mean of some: from seed to seed it differs much how far the VPLs' light lags behind.
        let seeds = if name == "object" { 0..3 } else { 0..1 };
        let error = |history: u32, seed: u32| {
            let mut settings = interleaved(16, false);
            settings.gather.history = history;
            // The VPLs of each frame are those of the picture that it is held against.
            settings.reflected.frames = 1;
            let options_of = |k| RenderOptions { seed, ..options_of(k) };
            let of = |k| (scene_of(k), settings.clone(), options_of(k));
            let got = draw(&(0..frames).map(of).collect::<Vec<_>>());
            let (there, options) = (scene_of(frames - 1), options_of(frames - 1));
            let expected = render(&there, &exact(), &options).linear;
            // Only what moves counts.
            let mut gone = there.clone();
            gone.instances.pop();
            let depth = |scene: &Scene| {
                render(scene, &exact(), &RenderOptions { layer: Layer::Depth, ..options.clone() }).linear
            };
            let is_thing: Vec<bool> = depth(&there).iter().zip(depth(&gone)).map(|(a, b)| *a != b).collect();
            assert!(is_thing.iter().filter(|is| **is).count() > 200);
            let shown = |picture: &[[f32; 3]]| -> Vec<[f32; 3]> {
                let counts = picture.iter().zip(&is_thing).filter(|(_, is)| **is || name == "camera");
                counts.map(|(pixel, _)| *pixel).collect()
            };
            off(&shown(&got[frames - 1]), &shown(&expected))
        };
        let errors = [1, 64].map(|history| seeds.clone().map(|seed| error(history, seed)).sum::<f32>());
        println!("{name}: {errors:?}");
        // The thing's own light changes as it goes, which means lag behind; without its motion they are 1.07 times as far off.
        let most = if name == "object" { 0.9 } else { 0.8 };
        assert!(errors[1] < most * errors[0], "{name}: {errors:?}");
    }
}

/// Other subsets of the same VPLs have the same mean: the one over frames goes on.
#[test]
fn means_go_on_with_other_subsets() {
    let headless = Headless::new(None).unwrap();
    let scene = Scene::builtin("column").unwrap();
    let options = RenderOptions::new(48, 32, scene.cameras[0].clone());
    let draw = |frames: &[&Settings]| {
        let mut renderer = Renderer::new(headless.context()).unwrap();
        for settings in frames {
            renderer.draw(&scene, settings, &options).unwrap();
        }
        renderer.read().unwrap().unwrap().linear
    };
    let (before, mut after) = (interleaved(8, false), interleaved(4, false));
    after.gather.most = 8;
    let exact = draw(&[&exact()]);
    let error = |frames: &[&Settings]| {
        let got = draw(frames);
        let pairs = got.as_flattened().iter().zip(exact.as_flattened());
        pairs.map(|(a, b)| (a - b).abs()).sum::<f32>() / exact.as_flattened().iter().sum::<f32>()
    };
    let alone = error(&[&after]);
    let mut frames = vec![&before; 64];
    let kept = error(&frames);
    frames.push(&after);
    let changed = error(&frames);
    println!("{kept} {changed} {alone}");
    assert!(kept < 1e-5 && changed < 0.5 * alone);
}
