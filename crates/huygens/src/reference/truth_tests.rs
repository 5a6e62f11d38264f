//! Worlds whose light has a closed form, and statistics of the path tracer.

use std::f64::consts::PI;

use glam::{Affine2, DVec2, Mat4, Vec2, Vec3};

use super::emitter::Emitters;
use super::*;
use crate::camera::Projection;
use crate::scene::{Image, Instance, Material, Mesh, Sampler, Texture, TextureRef};
use crate::{Camera, Light, Profile, Scene};

fn options(camera: &Camera, size: u32, samples: u32) -> PathOptions {
    let (camera, filter) = (camera.clone(), PixelFilter::Box);
    PathOptions { width: size, height: size, camera, samples, bounces: None, seed: 1, filter }
}

fn trace(scene: &Scene, options: &PathOptions) -> PathTraced {
    PathTracer::new(scene).trace(options, &mut |_| true)
}

/// Mean of a channel of the picture and its standard error by the variance image.
fn mean_and_error(picture: &PathTraced, channel: usize) -> (f64, f64) {
    let n = picture.direct.len() as f64;
    let seen = picture.direct.iter().zip(&picture.indirect).map(|(d, i)| f64::from(d[channel] + i[channel]));
    let variance: f64 = picture.variance.iter().map(|v| f64::from(v[channel])).sum();
    (seen.sum::<f64>() / n, variance.sqrt() / n)
}

fn square(corners: [Vec3; 4], normal: Vec3, material: usize) -> Mesh {
    let uv = [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
    Mesh {
        material,
        positions: corners.to_vec(),
        normals: vec![normal; 4],
        uvs: [uv.to_vec(), Vec::new()],
        indices: vec![0, 1, 2, 0, 2, 3],
        ..Mesh::default()
    }
}

fn scene(meshes: Vec<Mesh>, materials: Vec<Material>) -> Scene {
    let instance = |mesh| Instance { mesh, world_from_object: Mat4::IDENTITY };
    Scene {
        instances: (0..meshes.len()).map(instance).collect(),
        meshes: meshes.into_iter().map(Into::into).collect(),
        materials,
        ..Scene::default()
    }
}

/// A sphere of radius 1 from inside, its normals inward; each facet within 3e-4 of it.
pub(crate) fn sphere(material: usize) -> Mesh {
    let (rings, sectors) = (64, 128);
    let mut mesh = Mesh { material, ..Mesh::default() };
    for ring in 0..=rings {
        for sector in 0..sectors {
            let (theta, phi) =
                (PI * f64::from(ring) / f64::from(rings), 2.0 * PI * f64::from(sector) / f64::from(sectors));
            let p = Vec3::new((theta.sin() * phi.cos()) as f32, theta.cos() as f32, (theta.sin() * phi.sin()) as f32);
            mesh.positions.push(p);
            mesh.normals.push(-p);
            if ring < rings {
                let at = |ring: u32, sector: u32| ring * sectors + sector % sectors;
                let [a, b, c, d] =
                    [at(ring, sector), at(ring, sector + 1), at(ring + 1, sector + 1), at(ring + 1, sector)];
                mesh.indices.extend([a, c, b, a, d, c]);
            }
        }
    }
    mesh
}

fn inside() -> Camera {
    Camera::look_at(Vec3::new(0.2, 0.1, -0.3), Vec3::new(-0.4, 0.0, 0.7), 1.2).unwrap()
}

/// Everything shines with radiance 1 and reflects half of what comes: 1 + ½ + ¼ + … = 2, and 2 − ½ⁿ⁺¹ after n bounces.
#[test]
fn furnace() {
    let half = Material { emissive: Vec3::ONE, ..Material::lambert("", Vec3::splat(0.5)) };
    let corner = |i: u32| Vec3::new(f32::from(i & 1 != 0), f32::from(i & 2 != 0), f32::from(i & 4 != 0)) * 2.0 - 1.0;
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let walls = faces.map(|face| square(face.map(corner), Vec3::Y, 0)).map(|mut wall| {
        let [a, b, c] = [0, 1, 2].map(|i| wall.positions[i]);
        wall.normals = vec![(b - a).cross(c - a).normalize(); 4];
        wall
    });
    for (name, meshes) in [("box", walls.to_vec()), ("sphere", vec![sphere(0)])] {
        let scene = scene(meshes, vec![half.clone()]);
        for (bounces, expected) in [(None, 2.0), (Some(0), 1.5), (Some(1), 1.75), (Some(4), 2.0 - 1.0 / 32.0)] {
            let picture = trace(&scene, &PathOptions { bounces, ..options(&inside(), 16, 256) });
            for channel in 0..3 {
                let (mean, error) = mean_and_error(&picture, channel);
                assert!(error < 2e-3, "{name}, {bounces:?}: {mean} ± {error}");
                assert!((mean - expected).abs() < 4.0 * error + 1e-6, "{name}, {bounces:?}: {mean} ± {error}");
            }
        }
    }
}

/// A point light of π W/sr in the middle of a unit sphere of albedo ½: every bounce lights the sphere evenly with half
/// of the one before, ½ + ¼ + … = 1.
#[test]
fn point_light_inside_a_sphere() {
    let mut scene = scene(vec![sphere(0)], vec![Material::lambert("", Vec3::new(0.5, 0.25, 0.75))]);
    scene.lights.push(Light {
        name: String::new(),
        position: Vec3::ZERO,
        axis: Vec3::Y,
        intensity: Vec3::splat(PI as f32),
        profile: Profile::Point,
    });
    let picture = trace(&scene, &options(&inside(), 16, 256));
    for (channel, albedo) in [0.5, 0.25, 0.75].into_iter().enumerate() {
        let direct = picture.direct.iter().map(|d| f64::from(d[channel])).sum::<f64>() / 256.0;
        assert!((direct / albedo - 1.0).abs() < 2e-3, "{direct}");
        let (mean, error) = mean_and_error(&picture, channel);
        let expected = albedo / (1.0 - albedo);
        // The facets' distance from the sphere is worth 2e-3.
        assert!((mean / expected - 1.0).abs() < 2e-3 + 4.0 * error / expected, "{mean} ± {error}, {expected}");
    }
}

#[test]
fn point_light_over_a_plane() {
    let corners = [(-4.0, -4.0), (-4.0, 4.0), (4.0, 4.0), (4.0, -4.0)].map(|(x, z)| Vec3::new(x, 0.0, z));
    let albedo = Vec3::new(0.5, 0.25, 0.75);
    let mut scene = scene(vec![square(corners, Vec3::Y, 0)], vec![Material::lambert("", albedo)]);
    let camera = Camera::look_at(Vec3::new(0.5, 6.0, 3.0), Vec3::ZERO, 0.9).unwrap();
    let spot = Profile::Spot { inner: 0.3, outer: 0.8 };
    for profile in [Profile::Uniform, Profile::Cosine, spot, Profile::Point, Profile::Directional] {
        scene.lights = vec![Light {
            name: String::new(),
            position: Vec3::new(0.3, 1.7, -0.2),
            axis: Vec3::new(0.1, -1.0, 0.2).normalize(),
            intensity: Vec3::new(3.0, 2.0, 1.0),
            profile,
        }];
        let options = PathOptions { filter: PixelFilter::Center, samples: 1, ..options(&camera, 32, 1) };
        let picture = trace(&scene, &options);
        let mut lit = 0;
        for (i, radiance) in picture.direct.iter().enumerate() {
            let (origin, direction) = camera.ray(Vec2::new((i % 32) as f32 + 0.5, (i / 32) as f32 + 0.5), 32, 32);
            let position = origin + direction * (-origin.y / direction.y);
            if position.abs().max_element() < 3.99 {
                let expected = direct::lambert(&scene.lights[0], albedo, position, Vec3::Y);
                for c in 0..3 {
                    let error = (f64::from(radiance[c]) - expected[c]).abs();
                    assert!(error <= 1e-4 * expected[c] + 1e-5, "{profile:?}: {radiance:?} {expected}");
                }
                lit += usize::from(expected.x > 0.0);
            }
        }
        assert!(lit > 150 && picture.indirect.iter().all(|i| *i == [0.0; 3]), "{profile:?}: {lit}");
    }
}

/// Share of what leaves a point that a parallel rectangle in front of it receives, the point below the rectangle's
/// corner (Howell, "A catalog of radiation heat transfer configuration factors", B-3).
fn corner_factor(a: f64, b: f64, distance: f64) -> f64 {
    let (x, y) = (a / distance, b / distance);
    let (sx, sy) = ((1.0 + x * x).sqrt(), (1.0 + y * y).sqrt());
    (x / sx * (y / sx).atan() + y / sy * (x / sy).atan()) / (2.0 * PI)
}

/// The same for a square of half edge 1 over its middle, the point at `p` of the parallel plane.
fn square_factor(p: DVec2, distance: f64) -> f64 {
    let part = |a: f64, b: f64| (a * b).signum() * corner_factor(a.abs(), b.abs(), distance);
    part(1.0 - p.x, 1.0 - p.y) + part(1.0 + p.x, 1.0 - p.y) + part(1.0 - p.x, 1.0 + p.y) + part(1.0 + p.x, 1.0 + p.y)
}

/// Two squares face each other. The upper shines; the lower reflects that (closed form) and the upper reflects it
/// again (the closed form integrated once more).
#[test]
fn two_parallel_plates() {
    let (distance, below, above) = (0.8, 0.6, 0.5);
    let plate = |y: f32, up: bool, material| {
        let corners = [(-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0)].map(|(x, z)| Vec3::new(x, y, z));
        let normal = if up { Vec3::Y } else { Vec3::NEG_Y };
        let mut mesh = square(corners, normal, material);
        if !up {
            mesh.indices = vec![0, 2, 1, 0, 3, 2];
        }
        mesh
    };
    let one_sided = |albedo: f64| Material { double_sided: false, ..Material::lambert("", Vec3::splat(albedo as f32)) };
    let shining = Material { emissive: Vec3::splat(3.0), ..one_sided(above) };
    let meshes = vec![plate(0.0, true, 0), plate(distance as f32, false, 1)];
    let scene = scene(meshes, vec![one_sided(below), shining]);

    // The backs are not drawn: either plate can be seen through the other.
    let look = |eye: Vec3| Camera {
        projection: Projection::Orthographic { half_height: 1.0 },
        ..Camera::look_at(eye, Vec3::ZERO, 1.0).unwrap()
    };
    let size = 8;
    let at = |pixel: u32| (f64::from(pixel) + 0.5) / f64::from(size) * 2.0 - 1.0;
    let at_center =
        |camera: Camera| PathOptions { bounces: Some(1), filter: PixelFilter::Center, ..options(&camera, size, 4096) };
    let (from_above, from_below) = (at_center(look(Vec3::Y * 5.0)), at_center(look(Vec3::Y * -5.0)));
    let (lower, upper) = (trace(&scene, &from_above), trace(&scene, &from_below));
    let steps = 200;
    for pixel in 0..size * size {
        // The plates are symmetric: which way the picture's axes go does not matter.
        let p = DVec2::new(at(pixel % size), at(pixel / size));
        let index = pixel as usize;
        let expected = 3.0 * below * square_factor(p, distance);
        let (got, error) = (f64::from(lower.direct[index][0]), f64::from(lower.variance[index][0]).sqrt());
        assert!(error < 0.02 * expected, "{got} ± {error}");
        assert!((got - expected).abs() < 4.5 * error, "direct at {p}: {got} ± {error}, {expected}");

        let mut sum = 0.0;
        for i in 0..steps * steps {
            let q = [i % steps, i / steps].map(|k| (f64::from(k) + 0.5) / f64::from(steps) * 2.0 - 1.0);
            let q = DVec2::from(q);
            let d2 = (p - q).length_squared() + distance * distance;
            sum += 3.0 * below * square_factor(q, distance) * distance * distance / (PI * d2 * d2);
        }
        let expected = above * sum * 4.0 / f64::from(steps * steps);
        let (got, error) = (f64::from(upper.indirect[index][0]), f64::from(upper.variance[index][0]).sqrt());
        assert!(error < 0.02 * expected, "{got} ± {error}");
        assert!((got - expected).abs() < 4.5 * error, "indirect at {p}: {got} ± {error}, {expected}");
        assert!((upper.direct[index][0] - 3.0).abs() < 1e-6);
    }
}

/// Emissive triangles: the mean of 1/pdf is the solid angle, and the density of a sample is that of the same ray when
/// it is found otherwise.
#[test]
fn emitters_are_drawn_with_the_density_that_is_stated() {
    let ceiling = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, z)| Vec3::new(x, 0.7, z));
    let side = [(0.0, 0.0), (0.0, 0.5), (1.0, 0.5), (1.0, 0.0)].map(|(y, z)| Vec3::new(2.0, y, z));
    let bright = Material { emissive: Vec3::splat(2.0), ..Material::lambert("", Vec3::ZERO) };
    let mut textured = Material { emissive: Vec3::ONE, ..bright.clone() };
    let texture = TextureRef { texture: 0, uv_set: 0, uv_transform: Affine2::IDENTITY };
    textured.emissive_texture = Some(texture);
    let mut scene = scene(vec![square(ceiling, Vec3::NEG_Y, 0), square(side, Vec3::NEG_X, 1)], vec![bright, textured]);
    scene.images = vec![Image { width: 2, height: 1, rgba: vec![255, 255, 255, 255, 0, 0, 0, 255] }.into()];
    scene.textures = vec![Texture { image: 0, sampler: Sampler::default() }];
    let (surfaces, emitters) = (Surfaces::new(&scene), Emitters::new(&scene));
    let from = Vec3::new(0.1, 0.0, -0.2);
    let count = 65_536;
    let mut solid_angles = [0.0; 2];
    for i in 0..count {
        let [pick, x, y, _] = sobol_burley::sample_4d(i, 0, 5);
        let (l, radiance, pdf, point) = emitters.sample(&scene, from, [pick, x, y]).unwrap();
        let (hit, surface) = surfaces.closest(from, l, 0.0, false).unwrap();
        assert!((surface.position - point).length() < 1e-4);
        assert!((surface.emission - radiance).abs().max_element() < 1e-3, "{} {radiance}", surface.emission);
        let found = emitters.pdf(from, &hit, &surface);
        assert!((found / pdf - 1.0).abs() < 1e-3, "{found} {pdf}");
        solid_angles[hit.instance] += 1.0 / f64::from(pdf) / f64::from(count);
    }
    // Van Oosterom & Strackee 1983 for each triangle.
    for (mesh, got) in scene.meshes.iter().zip(solid_angles) {
        let expected: f64 = mesh
            .indices
            .as_chunks::<3>()
            .0
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(|i| (mesh.positions[i as usize] - from).as_dvec3().normalize());
                2.0 * a.dot(b.cross(c)).abs().atan2(1.0 + a.dot(b) + b.dot(c) + c.dot(a))
            })
            .sum();
        assert!((got / expected - 1.0).abs() < 5e-3, "{got} {expected}");
    }
}

/// Two seeds differ by no more than their variance says. With 16 passes each, the difference over its standard error
/// follows Student's t with 30 degrees of freedom: 99.46 % lie within 3, and the mean square is 30/28. Paths that are
/// rare and bright make tails heavier and the spread of a pixel's 16 passes too small at times, so that 98.5 % must
/// pass; a variance that was wrong by a fifth would show in the mean square.
#[test]
fn two_seeds_differ_as_their_variance_says() {
    for (name, bounces) in [("cornell", None), ("column", Some(1))] {
        let scene = Scene::builtin(name).unwrap();
        let tracer = PathTracer::new(&scene);
        let of = |seed| {
            let options = PathOptions { seed, bounces, ..options(&scene.cameras[0], 48, 64) };
            tracer.trace(&options, &mut |_| true)
        };
        let (a, b) = (of(1), of(2));
        assert_ne!(a.indirect, b.indirect);
        let luminance = |c: &[f32; 3]| f64::from(c[0] + c[1] + c[2]);
        let (mut within, mut squares, mut judged) = (0.0, 0.0, 0.0);
        for i in 0..a.direct.len() {
            let seen = |p: &PathTraced| f64::from(p.direct[i][1] + p.indirect[i][1]);
            let variance = f64::from(a.variance[i][1] + b.variance[i][1]);
            if luminance(&a.direct[i]) + luminance(&a.indirect[i]) > 0.0 {
                let z = (seen(&a) - seen(&b)) / variance.sqrt().max(1e-12);
                within += f64::from(z.abs() < 3.0);
                squares += z * z;
                judged += 1.0;
            }
        }
        println!("{name}: {:.4} within 3, mean square {:.3}", within / judged, squares / judged);
        assert!(judged > 1000.0 && within / judged > 0.985, "{name}: {} of {judged}", within);
        assert!((0.85..1.3).contains(&(squares / judged)), "{name}: {}", squares / judged);
    }
}

#[test]
fn a_picture_is_the_same_whatever_the_number_of_threads_and_stops_when_told() {
    let scene = Scene::builtin("column").unwrap();
    let tracer = PathTracer::new(&scene);
    let options = options(&scene.cameras[0], 24, 16);
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| tracer.trace(&options, &mut |_| true))
    };
    let whole = with(1);
    assert_eq!(whole, with(3));
    assert_eq!(whole.samples, 16);

    let mut calls = 0;
    let part = tracer.trace(&options, &mut |share| {
        calls += 1;
        assert!((0.0..1.0).contains(&share));
        calls <= 4
    });
    assert_eq!(part.samples, 4);
    let few = tracer.trace(&PathOptions { samples: 4, ..options.clone() }, &mut |_| true);
    assert_eq!(part.direct, few.direct);
    assert_eq!(tracer.trace(&options, &mut |_| false).samples, 0);
    // Rounded up to whole passes.
    assert_eq!(tracer.trace(&PathOptions { samples: 35, ..options }, &mut |_| true).samples, 36);
}

/// What is masked out is not there for any ray; the back of a single-sided wall is not seen but casts a shadow.
#[test]
fn holes_let_light_through_and_culled_backs_do_not() {
    let floor = [(-2.0, -2.0), (-2.0, 2.0), (2.0, 2.0), (2.0, -2.0)].map(|(x, z)| Vec3::new(x, 0.0, z));
    let lid = floor.map(|p| p * 0.5 + Vec3::Y);
    let mut scene = scene(
        vec![square(floor, Vec3::Y, 0), square(lid, Vec3::Y, 1)],
        vec![Material::lambert("floor", Vec3::splat(0.5)), Material::lambert("lid", Vec3::splat(0.5))],
    );
    scene.lights.push(Light {
        name: String::new(),
        position: Vec3::Y * 2.0,
        axis: Vec3::NEG_Y,
        intensity: Vec3::ONE,
        profile: Profile::Cosine,
    });
    // Straight up from below the lid, past the floor's corner; and down onto the floor below the lid.
    let camera = Camera::look_at(Vec3::new(0.0, 0.5, 0.0), Vec3::ZERO, 0.3).unwrap();
    let seen = |scene: &Scene, camera: &Camera| {
        let options = PathOptions { bounces: Some(0), ..options(camera, 4, 1) };
        let picture = trace(scene, &options);
        picture.direct.iter().map(|d| d[0]).sum::<f32>() / 16.0
    };
    let open = 0.5 / PI as f32 / 4.0;
    assert_eq!(seen(&scene, &camera), 0.0);
    scene.materials[1].alpha_mode = crate::scene::AlphaMode::Mask { cutoff: 0.5 };
    scene.materials[1].base_color.w = 0.4;
    assert!((seen(&scene, &camera) / open - 1.0).abs() < 0.01, "{}", seen(&scene, &camera));
    scene.materials[1].base_color.w = 0.6;
    assert_eq!(seen(&scene, &camera), 0.0);
    // From below, the lid's back hides nothing when it is single-sided, yet keeps its shadow.
    let up = Camera::look_at(Vec3::new(0.0, 0.5, 0.0), Vec3::Y * 3.0, 0.3).unwrap();
    let above = floor.map(|p| Vec3::new(p.x, 3.0, -p.z));
    scene.meshes.push(square(above, Vec3::NEG_Y, 0).into());
    scene.instances.push(Instance { mesh: 2, world_from_object: Mat4::IDENTITY });
    scene.materials[0].emissive = Vec3::ONE;
    let shadowed = seen(&scene, &camera);
    scene.materials[1].double_sided = false;
    assert_eq!(seen(&scene, &camera), shadowed);
    assert!(seen(&scene, &up) >= 1.0);
    scene.materials[1].double_sided = true;
    assert!(seen(&scene, &up) < 1.0);
}

/// The holes of a lamp send no light: neither by its own points nor by directions that find them.
#[test]
fn holes_of_a_lamp_do_not_shine() {
    let floor = [(-2.0, -2.0), (-2.0, 2.0), (2.0, 2.0), (2.0, -2.0)].map(|(x, z)| Vec3::new(x, 0.0, z));
    let lamp = floor.map(|p| Vec3::new(p.x, 1.0, -p.z) * Vec3::new(0.5, 1.0, 0.5));
    let masked = crate::scene::AlphaMode::Mask { cutoff: 0.5 };
    let shining = Material { emissive: Vec3::ONE, alpha_mode: masked, ..Material::lambert("lamp", Vec3::ZERO) };
    let mut scene = scene(
        vec![square(floor, Vec3::Y, 0), square(lamp, Vec3::NEG_Y, 1)],
        vec![Material::lambert("floor", Vec3::splat(0.5)), shining],
    );
    let camera = Camera::look_at(Vec3::new(0.0, 0.5, 0.0), Vec3::ZERO, 0.3).unwrap();
    let mut seen = |alpha| {
        scene.materials[1].base_color.w = alpha;
        trace(&scene, &options(&camera, 4, 256)).direct.iter().map(|d| f64::from(d[1])).sum::<f64>() / 16.0
    };
    assert_eq!(seen(0.4), 0.0);
    // Straight above, four squares of 1 × 1 around the foot of the normal.
    let expected = 0.5 * 4.0 * corner_factor(1.0, 1.0, 1.0);
    let got = seen(0.6);
    assert!((got / expected - 1.0).abs() < 0.02, "{got}, expected {expected}");
}

/// A roof a third of a metre above a plain of a kilometre keeps its shadow, of the sun and of a lamp ten kilometres high.
#[test]
fn what_is_near_casts_shadows_of_far_light() {
    let plain = [(-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0)].map(|(x, z)| Vec3::new(x, 0.0, z));
    let roof = plain.map(|p| p + Vec3::Y * 0.3);
    let mut scene = scene(
        vec![square(plain.map(|p| p * 500.0), Vec3::Y, 0), square(roof, Vec3::Y, 0)],
        vec![Material::lambert("", Vec3::splat(0.5))],
    );
    for (profile, intensity) in [(Profile::Directional, 1.0), (Profile::Point, 1e8)] {
        scene.lights = vec![Light {
            name: String::new(),
            position: Vec3::Y * 1e4,
            axis: Vec3::NEG_Y,
            intensity: Vec3::splat(intensity),
            profile,
        }];
        let seen = |x: f32| {
            let camera = Camera::look_at(Vec3::new(x, 0.15, 0.0), Vec3::new(x, 0.0, 0.0), 0.5).unwrap();
            trace(&scene, &PathOptions { bounces: Some(0), ..options(&camera, 4, 1) }).direct
        };
        assert!(seen(0.0).iter().all(|d| *d == [0.0; 3]), "{profile:?}: {:?}", seen(0.0));
        assert!(seen(3.0).iter().all(|d| (d[0] - 0.5 / PI as f32).abs() < 1e-4), "{profile:?}: {:?}", seen(3.0));
    }
}

/// A glossy floor within a sphere of radiance 1 that reflects nothing sends what its BRDF has altogether, whichever of
/// the two, points of the sphere and directions of the BRDF, find the light.
#[test]
fn a_glossy_floor_in_even_light() {
    let floor = [(-0.5, -0.5), (-0.5, 0.5), (0.5, 0.5), (0.5, -0.5)].map(|(x, z)| Vec3::new(x, 0.0, z));
    let shining = Material { emissive: Vec3::ONE, ..Material::lambert("sky", Vec3::ZERO) };
    let brdfs = [
        brdf::Brdf { base: Vec3::new(0.9, 0.5, 0.2), metallic: 1.0, roughness: 0.3, specular: 1.0 },
        brdf::Brdf { base: Vec3::new(0.2, 0.5, 0.8), metallic: 0.0, roughness: 0.5, specular: 1.0 },
    ];
    for brdf in brdfs {
        let mut glossy = Material::lambert("floor", brdf.base);
        (glossy.metallic, glossy.roughness, glossy.specular) = (brdf.metallic, brdf.roughness, brdf.specular);
        let scene = scene(vec![square(floor, Vec3::Y, 0), sphere(1)], vec![glossy, shining.clone()]);
        let eye = Vec3::new(0.0, 0.4, 0.5);
        let camera = Camera::look_at(eye, Vec3::ZERO, 0.02).unwrap();
        let picture = trace(&scene, &options(&camera, 8, 1024));
        let v = eye.normalize();
        let steps = 1500;
        for channel in 0..3 {
            let mut expected = 0.0;
            for i in 0..steps * steps {
                // Even in solid angle.
                let (z, angle) = ((i / steps) as f32 + 0.5, ((i % steps) as f32 + 0.5) * std::f32::consts::TAU);
                let (z, angle) = (z / steps as f32, angle / steps as f32);
                let l = Vec3::new((1.0 - z * z).sqrt() * angle.cos(), z, (1.0 - z * z).sqrt() * angle.sin());
                expected += f64::from(brdf.value(Vec3::Y, l, v)[channel] * z);
            }
            expected *= 2.0 * PI / f64::from(steps * steps);
            let (mean, error) = mean_and_error(&picture, channel);
            println!("{brdf:?}: {mean} ± {error}, expected {expected}");
            assert!(error < 4e-3 * expected, "{mean} ± {error}");
            assert!((mean - expected).abs() < 4.0 * error + 1e-3 * expected, "{mean} ± {error}, expected {expected}");
        }
    }
}

/// A floor whose shading normal leans by 64°: a lamp and a light beside it light it from above, and not from below, where
/// that normal would see them.
#[test]
fn nothing_shines_through_a_surface_whose_shading_normal_leans() {
    let corner = |x: f32, z: f32| Vec3::new(x, 0.0, z);
    let floor = [corner(-0.5, -0.5), corner(-0.5, 0.5), corner(0.5, 0.5), corner(0.5, -0.5)];
    let floor = square(floor, Vec3::new(0.9, 0.436, 0.0).normalize(), 0);
    let lamp = Material { emissive: Vec3::ONE, ..Material::lambert("lamp", Vec3::ZERO) };
    let camera = Camera::look_at(Vec3::new(0.0, 2.0, 0.1), Vec3::ZERO, 0.3).unwrap();
    let lit = |height: f32, shines: bool| {
        let corner = |y: f32, z: f32| Vec3::new(1.0, height + 0.4 * y, z);
        let panel = [corner(-1.0, -1.0), corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0)];
        let lamp = if shines { lamp.clone() } else { Material::lambert("", Vec3::ZERO) };
        let materials = vec![Material::lambert("floor", Vec3::splat(0.5)), Material { double_sided: true, ..lamp }];
        let mut scene = scene(vec![floor.clone(), square(panel, Vec3::NEG_X, 1)], materials);
        if !shines {
            let (position, axis) = (Vec3::new(0.9, height, 0.0), Vec3::NEG_X);
            let profile = Profile::Point;
            scene.lights = vec![Light { name: String::new(), position, axis, intensity: Vec3::ONE, profile }];
        }
        let picture = trace(&scene, &options(&camera, 4, 64));
        picture.direct.iter().chain(&picture.indirect).map(|pixel| pixel[0]).sum::<f32>()
    };
    for shines in [true, false] {
        let [above, below] = [0.5, -0.5].map(|height| lit(height, shines));
        assert!(above > 0.1 && below == 0.0, "{shines}: {above} {below}");
    }
}
