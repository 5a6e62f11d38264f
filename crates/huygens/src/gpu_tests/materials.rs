//! Materials, lights and the lattice probe: what the G-buffer and the direct light make of a scene, against closed
//! forms in f64 and rays.

use std::sync::Arc;

use std::f32::consts::{FRAC_PI_2, PI};
use std::f64::consts;

use glam::{Affine2, DVec3, Mat4, Vec2, Vec3, Vec4};

use super::{Pixel, builtins, floor, light, pixels, render, with_frame};
use crate::gl::Headless;
use crate::reference::{Bvh, PathOptions, PathTracer, PixelFilter, Surfaces, direct};
use crate::renderer::Frame;
use crate::scene::{AlphaMode, Image, Instance, Material, Mesh, Sampler, Texture, TextureRef, Wrap};
use crate::settings::{Depth, Settings, Visibility};
use crate::{Camera, Layer, Light, Profile, RenderOptions, Scene};

const SIZE: u32 = 64;

fn quick() -> Settings {
    let mut settings = Settings { visibility: Visibility::None, ..Settings::preset("wave").unwrap() };
    settings.wave.delta_theta = 45.0;
    settings.wave.delta_phi = 45.0;
    settings.shadow.filter = 0.0;
    settings
}

/// A square of 2 × 2 m at z = 0 that faces +z; its first texel is at the upper left, its second texture coordinates
/// run from right to left.
fn quad(material: usize) -> Mesh {
    let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| Vec2::new(x, y));
    Mesh {
        material,
        positions: corners.map(|c| c.extend(0.0)).to_vec(),
        normals: vec![Vec3::Z; 4],
        tangents: vec![Vec4::new(1.0, 0.0, 0.0, 1.0); 4],
        uvs: [corners.map(|c| uv_at(c, 0)).to_vec(), corners.map(|c| uv_at(c, 1)).to_vec()],
        indices: vec![0, 1, 2, 0, 2, 3],
        ..Mesh::default()
    }
}

fn uv_at(point: Vec2, set: usize) -> Vec2 {
    let u = 0.5 + 0.5 * point.x;
    Vec2::new(if set == 0 { u } else { 1.0 - u }, 0.5 - 0.5 * point.y)
}

/// Squares, each with a material and a place, seen from 3 m in front of the origin.
fn squares(list: Vec<(Material, Mat4)>) -> Scene {
    Scene {
        name: "squares".to_owned(),
        meshes: (0..list.len()).map(|i| quad(i).into()).collect(),
        instances: list.iter().enumerate().map(|(mesh, &(_, m))| Instance { mesh, world_from_object: m }).collect(),
        materials: list.into_iter().map(|(material, _)| material).collect(),
        lights: vec![Light { position: Vec3::new(2.0, 0.0, 2.0), axis: Vec3::NEG_Z, ..light(Profile::Point) }],
        cameras: vec![Camera::look_at(Vec3::Z * 3.0, Vec3::ZERO, 0.9).unwrap()],
        ..Scene::default()
    }
}

/// Adds an image with a nearest sampler.
fn texture(scene: &mut Scene, width: u32, texels: &[[u8; 4]], uv_set: usize, uv_transform: Affine2) -> TextureRef {
    let height = texels.len() as u32 / width;
    scene.images.push(Image { width, height, rgba: texels.concat() }.into());
    let (wrap_u, wrap_v) = (Wrap::Repeat, Wrap::Repeat);
    let sampler = Sampler { mag_linear: false, min_linear: false, mip_linear: None, wrap_u, wrap_v };
    scene.textures.push(Texture { image: scene.images.len() - 1, sampler });
    TextureRef { texture: scene.textures.len() - 1, uv_set, uv_transform }
}

pub(super) fn one_texel(scene: &mut Scene, texel: [u8; 4]) -> TextureRef {
    texture(scene, 1, &[texel], 0, Affine2::IDENTITY)
}

fn srgb(byte: u8) -> f32 {
    let c = f32::from(byte) / 255.0;
    if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
}

/// All that a frame of `squares` holds.
struct Picture {
    pixels: Vec<Pixel>,
    albedo: Vec<[f32; 4]>,
    emission: Vec<[f32; 4]>,
    surface: Vec<[u32; 4]>,
    direct: Vec<[f32; 4]>,
}

impl Picture {
    fn of(scene: &Scene) -> Self {
        let options = RenderOptions::new(SIZE, SIZE, scene.cameras[0].clone());
        with_frame(scene, &quick(), &options, |frame, pixels| Self {
            pixels: pixels.iter().map(|p| Pixel { ..*p }).collect(),
            albedo: frame.gbuffer.read_albedo(),
            emission: frame.gbuffer.read_emission(),
            surface: frame.gbuffer.read_surface(),
            direct: frame.direct.result().read(0),
        })
    }

    /// The pixel that shows a point.
    fn index(point: Vec3) -> usize {
        let ndc = point.truncate() / ((3.0 - point.z) * 0.45f32.tan());
        let at = (ndc * 0.5 + 0.5) * SIZE as f32;
        at.y as usize * SIZE as usize + at.x as usize
    }

    fn pixel(&self, point: Vec3) -> Option<&Pixel> {
        self.pixels.iter().find(|p| p.index == Self::index(point))
    }

    fn albedo(&self, point: Vec3) -> Vec3 {
        Vec4::from(self.albedo[Self::index(point)]).truncate()
    }

    fn emission(&self, point: Vec3) -> Vec3 {
        Vec4::from(self.emission[Self::index(point)]).truncate()
    }

    fn direct(&self, point: Vec3) -> Vec3 {
        Vec4::from(self.direct[Self::index(point)]).truncate()
    }

    /// Roughness, metalness, specular factor, occlusion.
    fn packed(&self, point: Vec3) -> Vec4 {
        Vec4::from(self.surface[Self::index(point)][3].to_le_bytes().map(|b| f32::from(b) / 255.0))
    }
}

fn near(a: Vec3, b: Vec3, tolerance: f32) -> bool {
    (a - b).abs().max_element() <= tolerance
}

#[test]
fn every_texture_slot_is_decoded_and_multiplied_by_its_factor() {
    let a = 0.6f32;
    let byte = |x: f32| ((0.5 + 0.5 * x) * 255.0).round() as u8;
    let bent = Vec3::new(a.sin() * 0.8, a.sin() * 0.6, a.cos());
    for mirror in [1.0, -1.0] {
        let material = Material {
            base_color: Vec4::new(0.5, 1.0, 0.5, 1.0),
            metallic: 0.75,
            roughness: 0.5,
            occlusion_strength: 0.5,
            emissive: Vec3::new(2.0, 4.0, 8.0),
            specular: 0.3,
            ..Material::default()
        };
        let mut scene = squares(vec![(material, Mat4::from_scale(Vec3::new(mirror, 1.0, 1.0)))]);
        scene.materials[0].base_color_texture = Some(one_texel(&mut scene, [188, 64, 255, 255]));
        scene.materials[0].metallic_roughness_texture = Some(one_texel(&mut scene, [10, 102, 51, 255]));
        let texel = [byte(bent.x), byte(bent.y), byte(bent.z), 255];
        scene.materials[0].normal_texture = Some(one_texel(&mut scene, texel));
        scene.materials[0].occlusion_texture = Some(one_texel(&mut scene, [51, 200, 220, 255]));
        scene.materials[0].emissive_texture = Some(one_texel(&mut scene, [188, 0, 255, 255]));
        Arc::make_mut(&mut scene.meshes[0]).colors = vec![Vec4::new(1.0, 0.5, 0.25, 1.0); 4];
        let picture = Picture::of(&scene);
        let at = Vec3::new(0.3, -0.2, 0.0);

        assert!((srgb(188) - 0.5).abs() < 0.01);
        let albedo = Vec3::new(srgb(188) * 0.5, srgb(64) * 0.5, 0.125);
        assert!(near(picture.albedo(at), albedo, 2e-3), "{} {albedo}", picture.albedo(at));
        let emission = Vec3::new(srgb(188) * 2.0, 0.0, 8.0);
        assert!(near(picture.emission(at), emission, 8e-3), "{} {emission}", picture.emission(at));
        let packed = Vec4::new(0.2, 0.15, 0.3, 0.6);
        assert!((picture.packed(at) - packed).abs().max_element() < 0.7 / 255.0, "{} {packed}", picture.packed(at));
        let normal = Vec3::new(mirror * bent.x, bent.y, bent.z);
        assert!(
            near(picture.pixel(at).unwrap().normal, normal, 0.01),
            "{mirror}: {:?}",
            picture.pixel(at).map(|p| p.normal)
        );
    }
}

#[test]
fn normal_scale_bends_further() {
    let mut scene = squares(vec![(Material { normal_scale: 2.0, ..Material::default() }, Mat4::IDENTITY)]);
    scene.materials[0].normal_texture = Some(one_texel(&mut scene, [178, 102, 241, 255]));
    let expected = (Vec3::new(178.0, 102.0, 241.0) / 127.5 - 1.0) * Vec3::new(2.0, 2.0, 1.0);
    let picture = Picture::of(&scene);
    assert!(near(picture.pixel(Vec3::ZERO).unwrap().normal, expected.normalize(), 1e-3));
}

#[test]
fn every_texture_has_its_own_transform_and_set_of_coordinates() {
    let grey = [30u8, 90, 160, 220];
    let bends = [[255u8, 127, 127], [127, 255, 127], [0, 127, 127], [127, 0, 127]];
    // About the middle by a quarter turn more for every slot, so that no two slots read the same texel.
    let transform = |slot: usize| {
        Affine2::from_translation(Vec2::splat(0.5))
            * Affine2::from_angle(FRAC_PI_2 * slot as f32)
            * Affine2::from_translation(Vec2::splat(-0.5))
    };
    for shift in 0..2 {
        let material = Material { emissive: Vec3::ONE, ..Material::default() };
        let mut scene = squares(vec![(material, Mat4::IDENTITY)]);
        let mut add = |slot: usize| {
            let texels: [[u8; 4]; 4] = std::array::from_fn(|k| match slot {
                2 => [bends[k][0], bends[k][1], bends[k][2], 255],
                _ => [grey[k], grey[k], grey[k], 255],
            });
            Some(texture(&mut scene, 2, &texels, (slot + shift) % 2, transform(slot)))
        };
        let [base, rough, normal, occlusion, emissive] = std::array::from_fn(&mut add);
        let m = &mut scene.materials[0];
        (m.base_color_texture, m.metallic_roughness_texture) = (base, rough);
        (m.normal_texture, m.occlusion_texture, m.emissive_texture) = (normal, occlusion, emissive);
        let picture = Picture::of(&scene);
        for (x, y) in [(-0.5, 0.5), (0.5, 0.5), (-0.5, -0.5), (0.5, -0.5)] {
            let at = Vec3::new(x, y, 0.0);
            let texel = |slot: usize| {
                let uv = transform(slot).transform_point2(uv_at(at.truncate(), (slot + shift) % 2));
                usize::from(uv.x.rem_euclid(1.0) > 0.5) + 2 * usize::from(uv.y.rem_euclid(1.0) > 0.5)
            };
            let linear = |slot: usize| f32::from(grey[texel(slot)]) / 255.0;
            assert!((picture.albedo(at).x - srgb(grey[texel(0)])).abs() < 3e-3, "{at}");
            assert!((picture.packed(at).x - linear(1)).abs() < 3e-3, "{at}");
            let b = bends[texel(2)].map(|b| f32::from(b) / 127.5 - 1.0);
            let normal = picture.pixel(at).unwrap().normal;
            assert!(near(normal, Vec3::from(b).normalize(), 1e-2), "{at}: {normal} {b:?}");
            assert!((picture.packed(at).w - linear(3)).abs() < 3e-3, "{at}");
            assert!((picture.emission(at).x - srgb(grey[texel(4)])).abs() < 3e-3, "{at}");
        }
    }
}

#[test]
fn what_is_masked_out_shows_what_is_behind_and_casts_no_shadow() {
    let (front, back) = (Vec3::new(0.2, 0.4, 0.6), Vec3::new(0.75, 0.5, 0.25));
    let behind = Mat4::from_translation(Vec3::NEG_Z) * Mat4::from_scale(Vec3::splat(2.0));
    let mut masked = Material::lambert("masked", front);
    masked.alpha_mode = AlphaMode::Mask { cutoff: 0.5 };
    let mut scene = squares(vec![(masked, Mat4::IDENTITY), (Material::lambert("back", back), behind)]);
    let texels = [[255, 255, 255, 140], [255, 255, 255, 110]];
    scene.materials[0].base_color_texture = Some(texture(&mut scene, 2, &texels, 0, Affine2::IDENTITY));
    let picture = Picture::of(&scene);
    let (kept, cut) = (Vec3::new(-0.5, 0.0, 0.0), Vec3::new(0.5, 0.0, 0.0));
    assert!(near(picture.albedo(kept), front, 2e-3) && near(picture.albedo(cut), back, 2e-3));
    // Light from (2, 0, 2): what falls through x = 0…1 reaches x = −1…0.5 at z = −1, the rest is in shadow.
    for (x, lit) in [(0.3, true), (-1.7, false)] {
        let at = Vec3::new(x, 0.0, -1.0);
        let pixel = picture.pixel(at).unwrap();
        let full = direct::lambert(&scene.lights[0], back, pixel.position, Vec3::Z).as_vec3();
        assert!((pixel.position.z + 1.0).abs() < 1e-4 && full.y > 1e-3);
        let expected = if lit { full } else { Vec3::ZERO };
        assert!(near(picture.direct(at), expected, 0.01 * full.x), "{x}: {} {expected}", picture.direct(at));
    }
}

#[test]
fn single_sided_backs_are_culled_and_double_sided_ones_face_the_viewer() {
    let mirror = Mat4::from_scale(Vec3::new(-1.0, 1.0, 1.0));
    let turn = Mat4::from_rotation_y(PI);
    // Place, double-sided, seen.
    let cases = [
        (Mat4::IDENTITY, false, true),
        (turn, false, false),
        (turn, true, true),
        (mirror, false, true),
        (mirror * turn, false, false),
        (mirror * turn, true, true),
        (mirror, true, true),
    ];
    for (place, double_sided, seen) in cases {
        let scene = squares(vec![(Material { double_sided, ..Material::default() }, place)]);
        let picture = Picture::of(&scene);
        let pixel = picture.pixel(Vec3::ZERO);
        assert_eq!(pixel.is_some(), seen, "{place} {double_sided}");
        if let Some(pixel) = pixel {
            assert!(near(pixel.normal, Vec3::Z, 1e-3) && near(pixel.geometric_normal, Vec3::Z, 1e-3), "{place}");
        }
    }
}

#[test]
fn unlit_shows_its_base_colour_and_reflects_nothing() {
    let color = Vec3::new(0.25, 0.5, 0.75);
    for unlit in [true, false] {
        let material = Material { base_color: color.extend(1.0), unlit, emissive: Vec3::ONE, ..Material::default() };
        let picture = Picture::of(&squares(vec![(material, Mat4::IDENTITY)]));
        let (albedo, emission) = if unlit { (Vec3::ZERO, color) } else { (color, Vec3::ONE) };
        assert!(near(picture.albedo(Vec3::ZERO), albedo, 1e-3) && near(picture.emission(Vec3::ZERO), emission, 1e-3));
    }
}

/// glTF 2.0, appendix B, with KHR_materials_specular's factor; times n·l.
fn reflected(material: &Material, n: DVec3, l: DVec3, v: DVec3) -> DVec3 {
    let mix = |a: f64, b: f64, t: f64| a + (b - a) * t;
    let (metallic, specular) = (f64::from(material.metallic), f64::from(material.specular));
    let base = material.base_color.truncate().as_dvec3();
    let alpha = f64::from(material.roughness).powi(2).max(1e-3);
    let a2 = alpha * alpha;
    let h = (l + v).normalize();
    let (n_l, n_v, n_h, v_h) = (n.dot(l).max(0.0), n.dot(v).abs(), n.dot(h), v.dot(h));
    let d = a2 / (consts::PI * (n_h * n_h * (a2 - 1.0) + 1.0).powi(2));
    let root = |c: f64| (c * c * (1.0 - a2) + a2).sqrt();
    let visibility = 0.5 / (n_l * root(n_v) + n_v * root(n_l));
    let f90 = mix(specular, 1.0, metallic);
    let channel = |base: f64| {
        let f0 = mix(0.04 * specular, base, metallic);
        let fresnel = f0 + (f90 - f0) * (1.0 - v_h).powi(5);
        let diffuse = base * (1.0 - metallic) / consts::PI;
        ((1.0 - fresnel) * diffuse + fresnel * d * visibility) * n_l
    };
    DVec3::new(channel(base.x), channel(base.y), channel(base.z))
}

#[test]
fn glossy_direct_light_is_appendix_b_of_gltf() {
    // Roughness in steps of 1/255, as the G-buffer holds it.
    for (metallic, specular, roughness) in
        [(0.0, 1.0, 0.4), (1.0, 1.0, 0.4), (1.0, 1.0, 0.2), (0.2, 0.6, 0.6), (0.0, 1.0, 1.0)]
    {
        let mut scene = floor(light(Profile::Point));
        scene.materials[0] = Material { metallic, specular, roughness, ..scene.materials[0].clone() };
        // Low, so that Fresnel's term grows.
        for eye in [Vec3::new(0.5, 6.0, 3.0), Vec3::new(0.5, 0.8, 4.5)] {
            let options = RenderOptions::new(SIZE, SIZE, Camera::look_at(eye, Vec3::ZERO, 0.9).unwrap());
            with_frame(&scene, &quick(), &options, |frame, pixels| {
                let got = frame.direct.result().read::<[f32; 4]>(0);
                let light = &scene.lights[0];
                let expected: Vec<DVec3> = pixels
                    .iter()
                    .map(|pixel| {
                        let p = pixel.position.as_dvec3();
                        let to_light = light.position.as_dvec3() - p;
                        let (l, v) = (to_light.normalize(), (eye.as_dvec3() - p).normalize());
                        reflected(&scene.materials[0], DVec3::Y, l, v) * light.intensity.as_dvec3()
                            / to_light.length_squared()
                    })
                    .collect();
                let max = expected.iter().map(|e| e.max_element()).fold(0.0, f64::max);
                let (mut worst, mut judged) = (0.0f64, 0);
                for (pixel, expected) in pixels.iter().zip(&expected) {
                    for c in 0..3 {
                        if expected[c] > 0.01 * max {
                            worst = worst.max((f64::from(got[pixel.index][c]) / expected[c] - 1.0).abs());
                            judged += 1;
                        }
                    }
                }
                println!("{metallic} {specular} {roughness} {eye}: worst {worst:.5} of {judged}");
                assert!(worst < 0.01 && judged > 50, "{metallic} {specular} {roughness} {eye}: {worst} {judged}");
            });
        }
    }
}

/// An axis-aligned box with flat normals.
fn block(center: Vec3, half: Vec3) -> Mesh {
    let mut mesh = Mesh::default();
    for axis in 0..3 {
        for sign in [-1.0, 1.0] {
            let (n, u) = (Vec3::AXES[axis] * sign, Vec3::AXES[(axis + 1) % 3]);
            let v = n.cross(u);
            let first = mesh.positions.len() as u32;
            for (a, b) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
                mesh.positions.push(center + (n + u * a + v * b) * half);
                mesh.normals.push(n);
            }
            mesh.indices.extend([0, 1, 2, 0, 2, 3].map(|i| first + i));
        }
    }
    mesh
}

#[test]
fn direct_light_is_the_sum_over_all_lights_that_rays_let_through() {
    let mut scene = floor(light(Profile::Cosine));
    scene.meshes.push(block(Vec3::new(0.6, 0.6, 0.5), Vec3::new(0.4, 0.2, 0.3)).into());
    scene.instances.push(Instance { mesh: 1, world_from_object: Mat4::IDENTITY });
    let point =
        Light { position: Vec3::new(-1.2, 2.0, 1.5), intensity: Vec3::new(1.0, 2.0, 4.0), ..light(Profile::Point) };
    let axis = Vec3::new(-0.5, -1.0, -0.3).normalize();
    scene.lights.push(point);
    scene.lights.push(Light { axis, intensity: Vec3::new(0.3, 0.4, 0.6), ..light(Profile::Directional) });
    let bvh = Bvh::new(&scene);
    let settings = quick();
    let spread = 4.0 / settings.shadow.size as f32;
    let options = RenderOptions::new(SIZE, SIZE, scene.cameras[0].clone());
    with_frame(&scene, &settings, &options, |frame, pixels| {
        let got = frame.direct.result().read::<[f32; 4]>(0);
        let albedos = frame.gbuffer.read_albedo();
        // Judged pixels by which lights reach them.
        let (mut judged, mut seen) = (0, [0; 8]);
        'pixels: for pixel in pixels {
            let n = pixel.geometric_normal;
            let mut sum = DVec3::ZERO;
            let mut reached = 0;
            for (i, light) in scene.lights.iter().enumerate() {
                let from = match light.profile {
                    Profile::Directional => pixel.position - light.axis * 20.0,
                    _ => light.position,
                };
                let to_light = from - pixel.position;
                let cosine = to_light.normalize().dot(n);
                if cosine < -0.02 {
                    continue;
                }
                if cosine < 0.05 {
                    continue 'pixels;
                }
                let (u, v) = n.any_orthonormal_pair();
                let reach = spread * to_light.length().min(8.0) / cosine;
                let hidden: [bool; 9] = std::array::from_fn(|k| {
                    let offset = u * ((k % 3) as f32 - 1.0) + v * ((k / 3) as f32 - 1.0);
                    bvh.occluded(pixel.position + n * 2e-3 + offset * reach, from)
                });
                if hidden.iter().any(|&h| h != hidden[0]) {
                    continue 'pixels;
                }
                if !hidden[0] {
                    let albedo = Vec4::from(albedos[pixel.index]).truncate();
                    sum += direct::lambert(light, albedo, pixel.position, pixel.normal);
                    reached |= 1 << i;
                }
            }
            judged += 1;
            seen[reached] += 1;
            for c in 0..3 {
                let value = f64::from(got[pixel.index][c]);
                let error = (value - sum[c]).abs();
                assert!(error <= 0.01 * sum[c] + 1e-6, "{} by {reached:b}: {value} {}", pixel.position, sum[c]);
            }
        }
        println!("{judged} of {}, by lights: {seen:?}", pixels.len());
        assert!(judged > pixels.len() * 3 / 4);
        // All lights, and each of them hidden alone.
        assert!([7, 6, 5, 3].iter().all(|&lights| seen[lights] > 5), "{seen:?}");
    });
}

#[test]
fn the_lattice_measures_what_rays_measure() {
    for scene in builtins() {
        let bvh = Bvh::new(&scene);
        let light = &scene.lights[0];
        let far = 2.0 * scene.bounds().unwrap().farthest(light.position);
        let hit = |direction: Vec3| bvh.closest(light.position, direction, 1e-5, far).map(|hit| hit.t);
        let options = RenderOptions::new(8, 8, scene.cameras[0].clone());
        let distances = |depth: Depth| {
            let mut settings = quick();
            (settings.wave.depth, settings.wave.shells) = (depth, 1);
            (settings.wave.delta_theta, settings.wave.delta_phi) = (9.0, 15.0);
            with_frame(&scene, &settings, &options, |frame, _| {
                // One shell, at its share of the depth.
                let of = |vpl: &crate::lattice::Vpl| {
                    (vpl.direction, (vpl.position - light.position).length() / settings.wave.reach)
                };
                frame.vpls.iter().map(of).collect::<Vec<_>>()
            })
        };

        // Directions on a spiral over the hemisphere.
        let count = 200_000;
        let (x, y) = light.axis.any_orthonormal_pair();
        let farthest = (0..count)
            .filter_map(|i| {
                let z = (i as f32 + 0.5) / count as f32;
                let (s, c) = ((f64::from(i) * 2.399_963_229_728_653) % consts::TAU).sin_cos();
                hit(((x * c as f32 + y * s as f32) * (1.0 - z * z).sqrt() + light.axis * z).normalize())
            })
            .fold(0.0f32, f32::max);
        let of_scene = distances(Depth::Scene);
        println!("{}: farthest {farthest}, scene depth {}", scene.name, of_scene[0].1);
        for (_, distance) in &of_scene {
            assert!((distance / farthest - 1.0).abs() < 0.02, "{}: {distance} {farthest}", scene.name);
        }

        let rays = distances(Depth::Ray);
        assert!(rays.len() > 150, "{}", rays.len());
        // At a silhouette or at grazing incidence, what a texel of the map holds is what a ray through it meets.
        let texel = 1.0 / quick().shadow.size as f32;
        let agrees = |direction: Vec3, distance: f32| {
            let (u, v) = direction.any_orthonormal_pair();
            let depths: [f32; 9] = std::array::from_fn(|k| {
                let offset = u * ((k % 3) as f32 - 1.0) + v * ((k / 3) as f32 - 1.0);
                hit(direction + offset * texel).unwrap_or(farthest)
            });
            let (near, far) = depths.iter().fold((f32::MAX, 0.0f32), |(a, b), &d| (a.min(d), b.max(d)));
            (depths[4], distance > 0.98 * near && distance < 1.02 * far)
        };
        let exact = rays.iter().filter(|(u, d)| (d / agrees(*u, *d).0 - 1.0).abs() < 0.02).count();
        let right = rays.iter().filter(|(u, d)| agrees(*u, *d).1).count();
        println!("{}: {exact} and within a texel {right} of {} rays", scene.name, rays.len());
        assert!(
            exact * 100 >= rays.len() * 90 && right * 100 >= rays.len() * 98,
            "{}: {right} of {}",
            scene.name,
            rays.len()
        );
    }
}

/// The path tracer's surfaces against the G-buffer, on textured, bent, masked, mirrored and turned squares.
#[test]
fn the_reference_meets_the_surfaces_of_the_gbuffer() {
    let tilted = |x: f32, mirror: f32, turn: f32| {
        Mat4::from_translation(Vec3::new(x, 0.1, -0.3))
            * Mat4::from_euler(glam::EulerRot::XYZ, 0.5, turn, 0.4)
            * Mat4::from_scale(Vec3::new(0.6 * mirror, 0.7, 0.5))
    };
    let glossy = Material { emissive: Vec3::new(1.0, 2.0, 0.5), double_sided: true, ..Material::default() };
    let back = Mat4::from_translation(Vec3::NEG_Z) * Mat4::from_scale(Vec3::splat(2.0));
    let single = Material { double_sided: false, ..glossy.clone() };
    let mut scene = squares(vec![
        (glossy.clone(), tilted(-0.6, 1.0, 0.3)),
        (glossy, tilted(0.6, -1.0, 0.3 + PI)),
        (single, Mat4::from_translation(Vec3::Y * 0.2) * tilted(0.0, 1.0, PI)),
        (Material::lambert("back", Vec3::new(0.3, 0.6, 0.9)), back),
    ]);
    let noise = |seed: u32| -> Vec<[u8; 4]> {
        (0..64).map(|i| crate::sampling::hash(i ^ crate::sampling::hash(seed)).to_le_bytes()).collect()
    };
    for m in 0..3 {
        let transform = Affine2::from_angle(0.3 * m as f32) * Affine2::from_scale(Vec2::new(0.8, -0.7));
        let mut add = |slot: u32| Some(texture(&mut scene, 8, &noise(slot), (slot % 2) as usize, transform));
        let [base, rough, normal, emissive] = std::array::from_fn(|slot| add(slot as u32));
        let material = &mut scene.materials[m];
        (material.base_color_texture, material.metallic_roughness_texture) = (base, rough);
        (material.normal_texture, material.emissive_texture) = (normal, emissive);
        material.alpha_mode = AlphaMode::Mask { cutoff: 0.3 };
        material.normal_scale = 0.6;
        // Smooth normals, so that interpolation counts.
        let normals = [(-0.3, -0.2), (0.3, -0.2), (0.2, 0.3), (-0.2, 0.3)];
        let mesh = Arc::make_mut(&mut scene.meshes[m]);
        mesh.normals = normals.map(|(x, y)| Vec3::new(x, y, 1.0).normalize()).to_vec();
        mesh.colors = (0..4).map(|i| Vec4::new(1.0, 0.25 * i as f32, 0.5, 1.0)).collect();
    }
    let picture = Picture::of(&scene);
    let surfaces = Surfaces::new(&scene);
    let (mut alike, mut on) = (0, [0; 4]);
    for pixel in &picture.pixels {
        let (x, y) = (pixel.index as u32 % SIZE, SIZE - 1 - pixel.index as u32 / SIZE);
        let (origin, direction) = scene.cameras[0].ray(Vec2::new(x as f32 + 0.5, y as f32 + 0.5), SIZE, SIZE);
        let Some((hit, surface)) = surfaces.closest(origin, direction, 0.0, true) else { continue };
        on[hit.instance] += 1;
        let packed = Vec4::from(picture.surface[pixel.index][3].to_le_bytes().map(|b| f32::from(b) / 255.0));
        let brdf = surface.brdf;
        let same = near(pixel.position, surface.position, 1e-4)
            && near(pixel.geometric_normal, surface.geometric_normal, 1e-3)
            && near(pixel.normal, surface.normal, 1e-3)
            && near(Vec4::from(picture.albedo[pixel.index]).truncate(), brdf.base, 2e-3)
            && near(Vec4::from(picture.emission[pixel.index]).truncate(), surface.emission, 4e-3)
            && near(packed.truncate(), Vec3::new(brdf.roughness, brdf.metallic, brdf.specular), 3e-3);
        alike += usize::from(same);
    }
    // Where a pixel lies on the border of texels or at an edge, rounding decides.
    println!("{alike} of {} alike; on each {on:?}", picture.pixels.len());
    // The third shows its back, which is culled.
    assert!(on[0] > 100 && on[1] > 100 && on[2] == 0 && on[3] > 100, "{on:?}");
    assert!(alike as f64 > 0.99 * picture.pixels.len() as f64, "{alike} of {}", picture.pixels.len());
}

/// Along its outline a closed surface shows no back, which light from behind would reach.
#[test]
fn no_back_shows_at_an_outline() {
    let mut scene = Scene::builtin("column").unwrap();
    let column = scene.meshes.iter().position(|mesh| mesh.name == "column").unwrap();
    scene.instances.retain(|instance| instance.mesh == column);
    let axis = scene.instances[0].world_from_object.w_axis.truncate();
    let eye = axis + Vec3::new(2.0, 1.65, 3.0);
    let options = RenderOptions::new(192, 512, Camera::look_at(eye, axis + Vec3::Y * 1.4, 0.8).unwrap());
    let headless = Headless::new(None).unwrap();
    let mut frame = Frame::new(&headless.context(), &scene, &quick(), &options).unwrap();
    let (mut backs, mut edges) = (0, 0);
    for sample in 0..64 {
        frame.run(sample, 64, false, None).unwrap();
        for pixel in pixels(&frame, &options) {
            let outward = pixel.normal.dot((pixel.position - axis).with_y(0.0).normalize());
            backs += usize::from(outward < 0.0);
            edges += usize::from(pixel.normal.dot((eye - pixel.position).normalize()).abs() < 0.2);
        }
    }
    println!("{backs} backs, {edges} pixels at outlines");
    assert!(backs == 0 && edges > 50_000, "{backs} of {edges}");
}

/// Direct light of emissive surfaces against the path tracer: a lamp over a floor with a table between, whose shadow is
/// soft; the lamp's light from both of its sides; and nothing through the holes of a masked lamp.
#[test]
fn emissive_surfaces_light_as_in_the_path_tracer() {
    for (double_sided, alpha) in [(false, 1.0), (true, 1.0), (false, 0.0)] {
        let mut scene = floor(light(Profile::Point));
        scene.lights[0].intensity = Vec3::ZERO;
        let mut add = |material: Material, transform: Mat4| {
            let mesh = Mesh { material: scene.materials.len(), ..(*scene.meshes[0]).clone() };
            scene.materials.push(material);
            scene.meshes.push(mesh.into());
            scene.instances.push(Instance { mesh: scene.meshes.len() - 1, world_from_object: transform });
        };
        let at = |y: f32, size: f32| Mat4::from_translation(Vec3::Y * y) * Mat4::from_scale(Vec3::splat(size));
        let mut lamp =
            Material { emissive: Vec3::new(3.0, 2.0, 1.0), double_sided, ..Material::lambert("lamp", Vec3::ZERO) };
        lamp.base_color.w = alpha;
        lamp.alpha_mode = AlphaMode::Mask { cutoff: 0.5 };
        add(lamp, at(1.5, 0.3) * Mat4::from_rotation_x(std::f32::consts::PI));
        add(Material::lambert("table", Vec3::splat(0.5)), at(0.5, 0.15));
        add(Material::lambert("ceiling", Vec3::splat(0.8)), at(2.5, 1.0) * Mat4::from_rotation_x(std::f32::consts::PI));
        let camera = Camera::look_at(Vec3::new(0.0, 1.2, 4.0), Vec3::new(0.0, 1.0, 0.0), 1.0).unwrap();
        let options = RenderOptions { layer: Layer::Direct, ..RenderOptions::new(48, 48, camera.clone()) };
        let filter = PixelFilter::Center;
        let path = PathOptions { width: 48, height: 48, camera, samples: 512, bounces: Some(0), seed: 0, filter };
        let expected = PathTracer::new(&scene).trace(&path, &mut |_| true).direct;
        for (samples, limit) in [(64, 0.04), (1024, 0.012)] {
            let mut settings = quick();
            settings.emission.samples = samples;
            let got = render(&scene, &settings, &options).linear;
            let (mut difference, mut sum, mut bias) = (0.0, 0.0, 0.0);
            for (got, expected) in got.iter().zip(&expected) {
                for c in 0..3 {
                    let error = f64::from(got[c] - expected[c]);
                    difference += error.abs();
                    bias += error;
                    sum += f64::from(expected[c]);
                }
            }
            let [difference, bias] = [difference, bias].map(|error| error / sum.max(f64::MIN_POSITIVE));
            println!("{double_sided} {alpha} {samples}: mean difference {difference:.4}, bias {bias:.4}");
            if alpha == 0.0 {
                assert_eq!((sum, difference), (0.0, 0.0));
            } else {
                assert!(sum > 100.0 && difference < limit && bias.abs() < 0.01, "{sum} {difference} {bias}");
            }
        }
    }
}

/// A lamp that stands before the edge of a table and reaches above it by less than half of each of its patches.
#[test]
fn a_lamp_lights_what_sees_only_some_of_its_patches() {
    let mut scene = floor(light(Profile::Point));
    scene.lights[0].intensity = Vec3::ZERO;
    let lamp = Material { emissive: Vec3::splat(2.0), ..Material::lambert("lamp", Vec3::ZERO) };
    scene.meshes.push(Mesh { material: 1, ..(*scene.meshes[0]).clone() }.into());
    scene.materials.push(lamp);
    let at = |x: f32, y: f32, size: Vec3| Mat4::from_translation(Vec3::new(x, y, 0.0)) * Mat4::from_scale(size / 4.0);
    scene.instances[0].world_from_object = at(-1.0, 0.0, Vec3::ONE);
    let turn = Mat4::from_rotation_z(std::f32::consts::FRAC_PI_2);
    let lamp = at(0.05, -0.12, Vec3::new(1.0, 0.3, 0.3)) * turn;
    scene.instances.push(Instance { mesh: 1, world_from_object: lamp });
    let camera = Camera::look_at(Vec3::new(-0.5, 1.5, 0.0), Vec3::new(-0.5, 0.0, -0.1), 0.6).unwrap();
    let options = RenderOptions { layer: Layer::Direct, ..RenderOptions::new(32, 32, camera.clone()) };
    let filter = PixelFilter::Center;
    let path = PathOptions { width: 32, height: 32, camera, samples: 256, bounces: Some(0), seed: 0, filter };
    let sum = |pixels: &[[f32; 3]]| pixels.iter().map(|pixel| f64::from(pixel[0])).sum::<f64>();
    let expected = sum(&PathTracer::new(&scene).trace(&path, &mut |_| true).direct);
    let mut settings = quick();
    // Other patches in every frame.
    settings.emission.samples = 4;
    let got = sum(&render(&scene, &settings, &RenderOptions { frames: 256, ..options }).linear);
    println!("{got} {expected}");
    assert!(expected > 5.0 && (got / expected - 1.0).abs() < 0.1, "{got} {expected}");
}

/// A light above the shading normal's horizon and below the floor itself.
#[test]
fn no_direct_light_comes_from_below_where_the_shading_normal_leans() {
    for (height, is_lit) in [(0.5, true), (-0.5, false)] {
        let mut scene = floor(Light { position: Vec3::new(3.0, height, 0.0), ..light(Profile::Point) });
        Arc::make_mut(&mut scene.meshes[0]).normals = vec![Vec3::new(0.9, 0.436, 0.0).normalize(); 4];
        let options = RenderOptions { layer: Layer::Direct, ..RenderOptions::new(16, 16, scene.cameras[0].clone()) };
        let lit = render(&scene, &quick(), &options).linear.iter().filter(|pixel| pixel[0] > 0.0).count();
        assert_eq!(lit > 50, is_lit, "{height}: {lit}");
        assert!(is_lit || lit == 0, "{lit}");
    }
}

/// A lamp on a floor whose shading normal leans away from it: what of it is above that normal's horizon lights the floor, but
/// not where a wall stands between, though the middle of most of its patches is below that horizon.
#[test]
fn a_wall_hides_a_lamp_of_which_the_shading_normal_sees_a_part() {
    let mut scene = floor(light(Profile::Point));
    scene.lights[0].intensity = Vec3::ZERO;
    let lamp = Material { emissive: Vec3::splat(2.0), ..Material::lambert("lamp", Vec3::ZERO) };
    scene.materials.extend([lamp, Material { double_sided: true, ..Material::lambert("wall", Vec3::ZERO) }]);
    let mesh = scene.meshes[0].clone();
    scene.meshes.extend([1, 2].map(|material| Mesh { material, ..(*mesh).clone() }.into()));
    Arc::make_mut(&mut scene.meshes[0]).normals = vec![Vec3::new(0.643, 0.766, 0.0); 4];
    let upright = |x: f32, size: f32| {
        Mat4::from_translation(Vec3::new(x, 0.5 * size + 1e-3, 0.0))
            * Mat4::from_scale(Vec3::splat(size / 8.0))
            * Mat4::from_rotation_z(-FRAC_PI_2)
    };
    scene.instances.push(Instance { mesh: 1, world_from_object: upright(0.0, 0.3) });
    let camera = Camera::look_at(Vec3::new(0.35, 0.4, 0.0), Vec3::new(0.35, 0.0, -1e-3), 0.4).unwrap();
    let mut settings = quick();
    settings.emission.samples = 1;
    let options = RenderOptions { layer: Layer::Direct, frames: 16, ..RenderOptions::new(16, 16, camera) };
    let sum = |scene: &Scene| render(scene, &settings, &options).linear.as_flattened().iter().sum::<f32>();
    let open = sum(&scene);
    scene.instances.push(Instance { mesh: 2, world_from_object: upright(0.15, 1.0) });
    let hidden = sum(&scene);
    println!("{hidden} of {open}");
    assert!(open > 0.5 && hidden < 0.02 * open, "{hidden} of {open}");
}
