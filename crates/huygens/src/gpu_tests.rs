//! Tests that draw, headless, and hold what the GPU made against closed forms and CPU twins.

use glam::{Mat4, Vec3, Vec4};
use rayon::prelude::*;

use crate::gl::{Api, Headless, Program, UniformBlock};
use crate::passes::{self, FrameBlock};
use crate::reference::{Bvh, direct, gather};
use crate::renderer::Frame;
use crate::scene::{BUILTIN_NAMES, Instance, Material, Mesh};
use crate::settings::{Model, Settings, Visibility};
use crate::{Camera, Layer, Light, Profile, RenderOptions, Rendered, Renderer, Scene, shaders};

fn builtins() -> impl Iterator<Item = Scene> {
    BUILTIN_NAMES.iter().map(|(name, _)| Scene::builtin(name).unwrap())
}

fn render(scene: &Scene, settings: &Settings, options: &RenderOptions) -> Rendered {
    let headless = Headless::new(None).unwrap();
    Renderer::new(headless.context()).unwrap().render(scene, settings, options, &mut |_| {}).unwrap()
}

/// What the G-buffer holds at a pixel.
struct Pixel {
    index: usize,
    position: Vec3,
    normal: Vec3,
    geometric_normal: Vec3,
}

/// The pixels of a frame that has been run which show a surface, first row at the bottom.
fn pixels(frame: &Frame, options: &RenderOptions) -> Vec<Pixel> {
    let block = FrameBlock::new(&options.camera, options.width, options.height, 1.0, glam::Vec2::ZERO);
    let decode = |q: u32| {
        let unpack = |q: u32| q as f32 / 65535.0 * 2.0 - 1.0;
        let p = glam::Vec2::new(unpack(q & 0xffff), unpack(q >> 16));
        let mut d = p.extend(1.0 - p.x.abs() - p.y.abs());
        let t = (-d.z).max(0.0);
        d.x -= t * if d.x >= 0.0 { 1.0 } else { -1.0 };
        d.y -= t * if d.y >= 0.0 { 1.0 } else { -1.0 };
        d.normalize()
    };
    let surface = frame.gbuffer.read_surface();
    let of = |(index, texel): (usize, &[u32; 4])| {
        let depth = f32::from_bits(texel[0]);
        let (x, y) = (index as u32 % options.width, index as u32 / options.width);
        let ndc = (glam::Vec2::new(x as f32, y as f32) + 0.5)
            / glam::Vec2::new(options.width as f32, options.height as f32)
            * 2.0
            - 1.0;
        let u = block.unprojection;
        let vs = (ndc * glam::Vec2::new(u.x, u.y) * (u.z + u.w * depth)).extend(-depth);
        let position = block.world_from_view.transform_point3(vs);
        (depth > 0.0).then(|| Pixel { index, position, normal: decode(texel[1]), geometric_normal: decode(texel[2]) })
    };
    surface.iter().enumerate().filter_map(of).collect()
}

/// Runs one frame and hands it over with its pixels.
fn with_frame<R>(
    scene: &Scene,
    settings: &Settings,
    options: &RenderOptions,
    look: impl FnOnce(&Frame, &[Pixel]) -> R,
) -> R {
    let headless = Headless::new(None).unwrap();
    let mut frame = Frame::new(&headless.context(), scene, settings, options).unwrap();
    frame.run(0, 1, false, None).unwrap();
    let pixels = pixels(&frame, options);
    look(&frame, &pixels)
}

/// A grey floor of 8 × 8 m at y = 0 under a light, seen from above.
fn floor(light: Light) -> Scene {
    let mesh = Mesh {
        positions: [(-4.0, -4.0), (-4.0, 4.0), (4.0, 4.0), (4.0, -4.0)].map(|(x, z)| Vec3::new(x, 0.0, z)).to_vec(),
        normals: vec![Vec3::Y; 4],
        indices: vec![0, 1, 2, 0, 2, 3],
        ..Mesh::default()
    };
    Scene {
        name: "floor".to_owned(),
        meshes: vec![mesh.into()],
        materials: vec![Material::lambert("grey", Vec3::new(0.5, 0.25, 0.75))],
        instances: vec![Instance { mesh: 0, world_from_object: Mat4::IDENTITY }],
        lights: vec![light],
        cameras: vec![Camera::look_at(Vec3::new(0.5, 6.0, 3.0), Vec3::ZERO, 0.9).unwrap()],
        ..Scene::default()
    }
}

fn light(profile: Profile) -> Light {
    Light {
        name: String::new(),
        position: Vec3::new(0.3, 1.7, -0.2),
        axis: Vec3::new(0.1, -1.0, 0.2).normalize(),
        intensity: Vec3::new(3.0, 2.0, 1.0),
        profile,
    }
}

#[test]
fn every_program_compiles_for_opengl_and_for_es_and_its_blocks_are_laid_out_as_declared() {
    for api in [Api::Core, Api::Es] {
        let headless = Headless::with_api(None, api).unwrap();
        let context = headless.context();
        assert_eq!(context.info().es, api == Api::Es);
        let computes = context.info().compute.then_some(shaders::COMPUTE_PROGRAMS);
        assert!(computes.is_some() == (api == Api::Core));
        for source in shaders::PROGRAMS.iter().chain(computes.into_iter().flatten()) {
            let program = Program::new(&context, source).unwrap_or_else(|e| panic!("{api:?}: {e}"));
            let pass = match source.name.trim_start_matches("COMPUTE_") {
                "SHADOW" | "SHADOW_ALBEDO" => fields::<passes::ShadowBlock>(),
                "DIRECT_CUBE" | "DIRECT_PLANE" => fields::<passes::DirectBlock>(),
                "LATTICE_PROBE" | "DEPTH_EXTENT" => fields::<passes::ProbeBlock>(),
                "ISM_SPLAT" | "ISM" => fields::<passes::IsmBlock>(),
                "AO" => fields::<passes::AoBlock>(),
                name if name.starts_with("GATHER_") || name.starts_with("NEAR_") => fields::<passes::GatherBlock>(),
                "DIRECT_EMISSION" => fields::<passes::GatherBlock>(),
                "RECONSTRUCT_ROWS" | "RECONSTRUCT_COLUMNS" => fields::<passes::ReconstructBlock>(),
                "COMPOSITE" => fields::<passes::CompositeBlock>(),
                "DEBUG_SHADOW" | "DEBUG_ISM" | "DEBUG_VPL" => fields::<passes::DebugBlock>(),
                "TONEMAP" => fields::<passes::TonemapBlock>(),
                _ => ("PassBlock", &[][..]),
            };
            let (before, frame) = (fields::<passes::BeforeBlock>(), fields::<FrameBlock>());
            for (name, fields) in
                [before, frame, fields::<passes::ObjectBlock>(), fields::<passes::MaterialBlock>(), pass]
            {
                let Some(layout) = program.block_layout(name) else { continue };
                for (field, offset) in layout {
                    let declared = fields.iter().find(|(name, _)| *name == field);
                    assert_eq!(declared.map(|f| f.1), Some(offset), "{} {name}.{field}", source.name);
                }
            }
            context.check(source.name).unwrap();
        }
    }
}

fn fields<T: UniformBlock>() -> (&'static str, &'static [(&'static str, usize)]) {
    (T::NAME, T::FIELDS)
}

#[test]
fn a_gl_error_fails_the_render() {
    let headless = Headless::new(None).unwrap();
    let context = headless.context();
    assert!(crate::gl::Texture::new(&context, crate::gl::Format::Rgba8, 4, 4).is_ok());
    context.provoke_an_error();
    let error = context.check("provoking").unwrap_err().to_string();
    assert!(error.contains("provoking") && error.contains("invalid"), "{error}");
    assert!(context.check("nothing").is_ok());
}

#[test]
fn es_and_core_draw_the_same_picture() {
    let scene = Scene::builtin("column").unwrap();
    let options = RenderOptions::new(48, 32, scene.cameras[0].clone());
    let mut settings = Settings::default();
    settings.wave.delta_theta = 15.0;
    settings.wave.delta_phi = 15.0;
    let pictures = [Api::Core, Api::Es].map(|api| {
        let headless = Headless::with_api(None, api).unwrap();
        let mut renderer = Renderer::new(headless.context()).unwrap();
        renderer.render(&scene, &settings, &options, &mut |_| {}).unwrap().linear
    });
    for (a, b) in pictures[0].iter().zip(&pictures[1]) {
        for c in 0..3 {
            assert!((a[c] - b[c]).abs() <= 1e-3 * a[c].abs().max(0.01), "{a:?} {b:?}");
        }
    }
}

#[test]
fn direct_light_on_a_plane_is_the_closed_form() {
    let spot = Profile::Spot { inner: 0.3, outer: 0.8 };
    for profile in [Profile::Uniform, Profile::Cosine, spot, Profile::Point, Profile::Directional] {
        let scene = floor(light(profile));
        let mut options = RenderOptions::new(96, 96, scene.cameras[0].clone());
        options.layer = Layer::Direct;
        let mut settings = Settings { visibility: Visibility::None, ..Settings::default() };
        settings.wave.delta_theta = 45.0;
        let (mut worst, mut lit) = (0.0f64, 0);
        with_frame(&scene, &settings, &options, |frame, pixels| {
            assert!(pixels.len() > 4000);
            let radiance = frame.direct.result().read::<[f32; 4]>(0);
            for pixel in pixels {
                let albedo = scene.materials[0].base_color.truncate();
                let expected = direct::lambert(&scene.lights[0], albedo, pixel.position, Vec3::Y);
                for c in 0..3 {
                    let got = f64::from(radiance[pixel.index][c]);
                    // Half a per cent of what it is; at a cone's edge, where it goes to zero, of the brightest there.
                    let floor = 1e-3 * scene.lights[0].intensity.max_element() as f64;
                    worst = worst.max((got - expected[c]).abs() / expected[c].max(floor));
                }
                lit += usize::from(expected.x > 0.0);
            }
        });
        assert!(worst < 0.005 && lit > 1000, "{profile:?}: worst {worst}, lit {lit}");
    }
}

#[test]
fn gather_is_the_sum_in_double_precision() {
    for scene in [Scene::builtin("cornell").unwrap(), Scene::builtin("corridor").unwrap()] {
        let options = RenderOptions::new(24, 24, scene.cameras[0].clone());
        let mut settings = Settings::preset("thesis").unwrap();
        settings.visibility = Visibility::None;
        let reflected = Settings { model: Model::Reflected, ..settings.clone() };
        for settings in [settings, reflected] {
            with_frame(&scene, &settings, &options, |frame, pixels| {
                let got = frame.gather.read_irradiance();
                assert!(pixels.len() > 400 && (5800..=6485).contains(&frame.vpls.len()), "{}", frame.vpls.len());
                let mut behind = 0;
                for pixel in pixels {
                    let expected = gather::irradiance(&frame.vpls, pixel.position, pixel.normal, |v| {
                        behind +=
                            usize::from((pixel.position - frame.vpls[v].position).dot(frame.vpls[v].direction) < 0.0);
                        true
                    });
                    for c in 0..3 {
                        let error = (f64::from(got[pixel.index][c]) - expected[c]).abs();
                        assert!(error <= 1e-3 * expected[c], "{}: {} {expected}", scene.name, got[pixel.index][c]);
                    }
                }
                let wavelets = settings.model == Model::Wave;
                assert_eq!(behind > 10_000, wavelets, "both sides of VPLs are seen: {behind}");
            });
        }
    }
}

/// Whether a pixel lies in the shadow of a light; `None` at the rim of a shadow, where rays to points `spread` around
/// (radians as the light sees them) disagree.
fn hidden_but_for_the_rim(bvh: &Bvh, light: &Light, pixel: &Pixel, spread: f32) -> Option<bool> {
    let d = light.position.distance(pixel.position);
    let (u, v) = ((light.position - pixel.position) / d).any_orthonormal_pair();
    let (u, v) = (u * (spread * d), v * (spread * d));
    let around = [Vec3::ZERO, u, -u, v, -v, u + v, u - v, v - u, -u - v];
    // Rays from the light, so that a receiver that is moved a little cannot hide behind its surface.
    let hidden = around.map(|offset| {
        let plane = pixel.geometric_normal;
        let ray = pixel.position + offset - light.position;
        let t = (pixel.position - light.position).dot(plane) / ray.dot(plane);
        bvh.occluded(light.position, light.position + ray * t)
    });
    hidden.iter().all(|&h| h == hidden[0]).then_some(hidden[0])
}

/// However large the pixels are: what is off a thin surface is lit by what is behind it.
#[test]
fn positions_are_on_their_surfaces() {
    for scene in builtins() {
        let options = RenderOptions::new(24, 20, scene.cameras[0].clone());
        let settings = Settings { visibility: Visibility::None, ..Settings::default() };
        let surfaces = crate::reference::Surfaces::new(&scene);
        with_frame(&scene, &settings, &options, |_, pixels| {
            let off = |pixel: &Pixel| {
                let ray = pixel.position - options.camera.eye;
                let (_, surface) = surfaces.closest(options.camera.eye, ray, 0.0, true)?;
                // Another surface may be seen in a pixel that has an edge in it.
                let same = surface.geometric_normal.dot(pixel.geometric_normal) > 0.99999
                    && surface.position.distance(pixel.position) < 0.01 * ray.length();
                let height = (surface.position - pixel.position).dot(surface.geometric_normal);
                same.then_some(height.abs() / ray.length())
            };
            let offs: Vec<f32> = pixels.iter().filter_map(off).collect();
            let most = offs.iter().copied().fold(0.0, f32::max);
            println!("{}: {} of {}, {most:.1e}", scene.name, offs.len(), pixels.len());
            assert!(offs.len() > pixels.len() / 2 && most < 3e-6, "{}: {most}", scene.name);
        });
    }
}

#[test]
fn shadow_cube_agrees_with_rays() {
    for mut scene in builtins() {
        let options = RenderOptions::new(128, 128, scene.cameras[0].clone());
        let mut settings = Settings { visibility: Visibility::None, ..Settings::default() };
        settings.wave.delta_theta = 45.0;
        settings.shadow.filter = 0.0;
        // Lambertian, so that the closed form tells how much of the light is there.
        for material in &mut scene.materials {
            material.specular = 0.0;
        }
        let bvh = Bvh::new(&scene);
        let light = &scene.lights[0];
        // The rim: where rays within one texel around the receiver disagree.
        let spread = 2.0 / settings.shadow.size as f32;
        with_frame(&scene, &settings, &options, |frame, pixels| {
            let got = frame.direct.result().read::<[f32; 4]>(0);
            let albedos = frame.gbuffer.read_albedo();
            let verdicts: Vec<Option<bool>> = pixels
                .par_iter()
                .map(|pixel| {
                    let to_light = light.position - pixel.position;
                    let d = to_light.length();
                    if to_light.dot(pixel.geometric_normal) / d < 0.02 || to_light.dot(pixel.normal) / d < 0.02 {
                        return None;
                    }
                    if light.profile.value(-to_light.dot(light.axis) / d) < 0.01 {
                        return None;
                    }
                    let hidden = hidden_but_for_the_rim(&bvh, light, pixel, spread)?;
                    // All of the light or none of it: what is half lit is acne.
                    let albedo = albedos[pixel.index];
                    let full = direct::lambert(
                        light,
                        Vec3::new(albedo[0], albedo[1], albedo[2]),
                        pixel.position,
                        pixel.normal,
                    );
                    let visible = f64::from(got[pixel.index][1]) / full.y;
                    Some(if hidden { visible < 0.01 } else { visible > 0.95 })
                })
                .collect();
            let judged = verdicts.iter().flatten().count();
            let right = verdicts.iter().flatten().filter(|&&right| right).count();
            let share = right as f64 / judged as f64;
            println!("{}: {right} of {judged} agree, {share:.4}", scene.name);
            assert!(judged > pixels.len() / 10, "{}: {judged} of {}", scene.name, pixels.len());
            assert!(share > 0.999, "{}: {share}", scene.name);
        });
    }
}

/// Lights outside a closed room, the sun and a lamp, that graze its walls: they do not come in where walls meet.
#[test]
fn light_from_outside_stays_outside() {
    let mut scene = Scene::builtin("column").unwrap();
    let options = RenderOptions::new(160, 160, scene.cameras[0].clone());
    let mut settings = Settings { visibility: Visibility::None, ..Settings::default() };
    settings.wave.delta_theta = 45.0;
    for material in &mut scene.materials {
        material.specular = 0.0;
    }
    for (x, z) in [(0.1, 0.2), (0.8, -0.15), (-0.2, 0.1)] {
        let axis = Vec3::new(x, -1.0, z).normalize();
        let light = |profile| Light { axis, position: axis * -12.0, profile, ..scene.lights[0].clone() };
        for light in [light(Profile::Directional), light(Profile::Cosine)] {
            let profile = light.profile;
            scene.lights = vec![light.clone()];
            with_frame(&scene, &settings, &options, |frame, pixels| {
                let albedos = frame.gbuffer.read_albedo();
                let got = frame.direct.result().read::<[f32; 4]>(0);
                let share = |pixel: &Pixel| {
                    let albedo = Vec4::from(albedos[pixel.index]).truncate();
                    let full = direct::lambert(&light, albedo, pixel.position, pixel.normal).y;
                    if full > 0.0 { f64::from(got[pixel.index][1]) / full } else { 0.0 }
                };
                let lit: f64 = pixels.iter().map(share).sum();
                println!("{profile:?} {axis}: {lit:.1} of {} lit", pixels.len());
                assert!(lit < pixels.len() as f64 / 150.0, "{profile:?} {axis}: {lit}");
            });
        }
    }
}

/// For every setting: mean absolute difference of the summed irradiance from what rays give, over the mean of the
/// latter; and the ratio of the means.
fn visibility_errors(scene: &Scene, settings: &[Settings], size: u32) -> Vec<(f64, f64)> {
    let options = RenderOptions::new(size, size, scene.cameras[0].clone());
    let bvh = Bvh::new(scene);
    let mut exact = Vec::new();
    let errors = settings.iter().map(|settings| {
        with_frame(scene, settings, &options, |frame, pixels| {
            let got = frame.gather.read_irradiance();
            let vpls = &frame.vpls;
            if exact.is_empty() {
                pixels
                    .par_iter()
                    .map(|pixel| {
                        gather::irradiance(vpls, pixel.position, pixel.normal, |v| {
                            !bvh.occluded(pixel.position, vpls[v].position)
                        })
                    })
                    .collect_into_vec(&mut exact);
            }
            let mut sums = [0.0; 3];
            for (pixel, exact) in pixels.iter().zip(&exact) {
                let got = Vec4::from(got[pixel.index]).truncate().as_dvec3();
                sums[0] += (got - *exact).abs().element_sum();
                sums[1] += got.element_sum();
                sums[2] += exact.element_sum();
            }
            (sums[0] / sums[2], sums[1] / sums[2])
        })
    });
    errors.collect()
}

#[test]
fn ism_visibility_is_near_that_of_rays() {
    for scene in builtins() {
        for name in ["exact", "wave", "thesis"] {
            let mut settings = Settings::preset(name).unwrap();
            if settings.model == Model::Wave {
                (settings.wave.delta_theta, settings.wave.delta_phi) = (10.0, 10.0);
            }
            let errors = visibility_errors(&scene, &[settings], 20);
            println!("{}, {name}: (mean absolute difference, energy) {errors:.4?}", scene.name);
            assert!(errors[0].0 < 0.1, "{}, {name}: {errors:?}", scene.name);
        }
    }
}

/// Each step has twice the texels along an edge of a tile and twice the points of the step before it. Flat surfaces
/// that are close have whole discs, which makes the error of coarse tiles smaller: in the atrium 32 texels are as good as 64.
#[test]
fn ism_visibility_comes_nearer_with_size_and_points() {
    let settings = [(16, 256), (32, 512), (64, 1024), (128, 2048)].map(|(size, points)| {
        let mut settings = Settings::default();
        (settings.wave.delta_theta, settings.wave.delta_phi) = (15.0, 15.0);
        (settings.ism.size, settings.ism.points) = (size, points);
        settings
    });
    for scene in builtins() {
        let errors = visibility_errors(&scene, &settings, 20);
        println!("{}: (mean absolute difference, energy) {errors:.4?}", scene.name);
        for (coarse, fine) in [(0, 1), (2, 3), (0, 2), (1, 3)] {
            assert!(errors[coarse].0 > errors[fine].0, "{}: {errors:?}", scene.name);
        }
        assert!(errors[2].0 < 1.05 * errors[1].0, "{}: {errors:?}", scene.name);
    }
}

#[test]
fn shadow_maps_of_all_vpls_are_near_rays_and_batches_do_not_matter() {
    let mut settings = Settings { visibility: Visibility::ShadowMaps, ..Settings::default() };
    (settings.wave.delta_theta, settings.wave.delta_phi) = (30.0, 30.0);
    settings.shadow_maps.count = 8192;
    let mut batches = settings.clone();
    batches.shadow_maps.memory = 1;
    for scene in [Scene::builtin("cornell").unwrap(), Scene::builtin("corridor").unwrap()] {
        let errors = visibility_errors(&scene, std::slice::from_ref(&settings), 20);
        println!("{}: {errors:.4?}", scene.name);
        assert!(errors[0].0 < 0.005, "{}: {errors:?}", scene.name);
        let options = RenderOptions { layer: Layer::Indirect, ..RenderOptions::new(20, 20, scene.cameras[0].clone()) };
        let [all, batches] = [&settings, &batches].map(|settings| render(&scene, settings, &options).linear);
        let same = |(a, b): &(&[f32; 3], &[f32; 3])| (0..3).all(|c| (a[c] - b[c]).abs() <= 1e-5 * a[c]);
        let same = all.iter().zip(&batches).filter(same).count();
        // Maps that stand elsewhere in the atlas: where an edge goes through the middle of a texel, rounding decides.
        assert!(same >= 396 && all.iter().any(|c| c[0] > 0.0), "{}: {same} of 400", scene.name);
    }
}

/// The more of them have shadow maps, the nearer the sum is to that with rays.
#[test]
fn the_most_important_vpls_have_shadow_maps() {
    for name in ["cornell", "column"] {
        let scene = Scene::builtin(name).unwrap();
        let settings =
            [(Visibility::Ism, 1), (Visibility::Mixed, 32), (Visibility::Mixed, 128), (Visibility::Mixed, 8192)];
        let settings = settings.map(|(visibility, count)| {
            let mut settings = Settings { visibility, ..Settings::default() };
            (settings.wave.delta_theta, settings.wave.delta_phi) = (15.0, 15.0);
            settings.shadow_maps.count = count;
            settings
        });
        let errors = visibility_errors(&scene, &settings, 20);
        println!("{name}: none, 32, 128, all: {errors:.4?}");
        assert!(errors.is_sorted_by(|a, b| a.0 > b.0), "{name}: {errors:?}");
    }
}

#[test]
fn mean_indirect_light_stays_when_steps_shells_and_fraction_change() {
    for scene in builtins() {
        type Change = fn(&mut Settings);
        let mean = |change: Change| {
            let mut settings = Settings::preset("wave").unwrap();
            // Small maps are enough: it is about the lattice.
            (settings.ism.size, settings.ism.points) = (16, 256);
            change(&mut settings);
            let mut options = RenderOptions::new(16, 16, scene.cameras[0].clone());
            options.layer = Layer::Indirect;
            let rendered = render(&scene, &settings, &options);
            rendered.linear.iter().map(|c| f64::from(c[0] + c[1] + c[2])).sum::<f64>()
        };
        let base = mean(|_| {});
        let changes: [(&str, Change); 5] = [
            ("half the steps", |s| (s.wave.delta_theta, s.wave.delta_phi) = (2.5, 2.5)),
            ("4 shells", |s| s.wave.shells = 4),
            ("7 shells", |s| s.wave.shells = 7),
            ("fraction 0.5", |s| s.wave.fraction = 0.5),
            ("fraction 0.25", |s| s.wave.fraction = 0.25),
        ];
        for (name, change) in changes {
            let ratio = mean(change) / base;
            println!("{}: {name}: {ratio:.4}", scene.name);
            assert!((ratio - 1.0).abs() < 0.05, "{}: {name}: {ratio:.4}", scene.name);
        }
    }
}

mod ao;
mod compute;
mod debug;
mod hold;
mod interleave;
mod materials;
#[cfg(debug_assertions)]
mod reload;
mod show;
mod truth;
mod updates;
