//! The sum over the VPLs in double precision: the twin of the pass `gather`.

use glam::{DVec3, Vec2, Vec3};
use rayon::prelude::*;

use super::brdf::Brdf;
use super::surface::{Surface, Surfaces};
use crate::RenderOptions;
use crate::lattice::{Emission, Vpl};

/// Pixels between two calls of `progress`.
const REPORT_EVERY: usize = 1 << 10;

/// Irradiance that a VPL would give to a point unhindered, W/m², as if it were at least at the distance `bound`, m.
fn point_irradiance(vpl: &Vpl, position: Vec3, normal: Vec3, bound: f32) -> DVec3 {
    let d = position.as_dvec3() - vpl.position.as_dvec3();
    let direction = d.normalize_or_zero();
    let cosine = -normal.as_dvec3().dot(direction);
    let along = direction.dot(vpl.direction.as_dvec3());
    let weight = match vpl.emission {
        Emission::Wavelet => {
            if along >= 0.0 {
                1.0
            } else {
                0.5
            }
        }
        Emission::Lambertian => along.max(0.0),
    };
    let d2 = d.length_squared().max(f64::from(bound).powi(2)).max(1e-36);
    vpl.intensity.as_dvec3() * (weight * cosine.max(0.0) / d2)
}

/// What a VPL gives to a point as the gather has it, if nothing hides it.
struct Bounded {
    /// Unit, to its middle.
    direction: Vec3,
    /// W/m².
    irradiance: DVec3,
    /// Whether its middle is above the surface. Else parts of its patch are, and whether they are seen is not asked: the
    /// surface itself is between the point and the middle.
    above: bool,
    /// Whether its middle is above the horizon of the shading normal, too.
    faces: bool,
}

/// As [`point_irradiance`], at least at the distance `d_min`, and near a Lambertian VPL that of its patch. `geometric` is the
/// surface's own normal.
fn bounded(vpl: &Vpl, position: Vec3, normal: Vec3, geometric: Vec3) -> Option<Bounded> {
    let (d, normal, geometric) =
        (position.as_dvec3() - vpl.position.as_dvec3(), normal.as_dvec3(), geometric.as_dvec3());
    let direction = -d.normalize_or_zero().as_vec3();
    let (near, intensity) = (f64::from(vpl.near()), vpl.intensity.as_dvec3());
    let is_rectangle = vpl.emission == Emission::Lambertian && d.length() < near;
    let (height, geometric_height) = (-normal.dot(d), -geometric.dot(d));
    if height.min(geometric_height) > 0.0 {
        let gives = vpl.emission == Emission::Wavelet || vpl.direction.as_dvec3().dot(d) > 0.0;
        return gives.then(|| {
            let point = || point_irradiance(vpl, position, normal.as_vec3(), vpl.d_min);
            let irradiance = if is_rectangle { intensity * patch(vpl, d, normal) } else { point() };
            Bounded { direction, irradiance, above: true, faces: true }
        });
    }
    // A VPL of the same plane is before the point by rounding alone.
    if !is_rectangle || vpl.direction.as_dvec3().dot(d) <= 1e-3 * near || height.min(geometric_height) <= -0.3125 * near
    {
        return None;
    }
    let above = geometric_height > 0.0;
    let normal = if above { normal } else { geometric };
    Some(Bounded { direction, irradiance: intensity * patch(vpl, d, normal), above, faces: false })
}

/// Irradiance, W/m², that the rectangle of a VPL gives for an intensity of 1 W/sr, at `d` (m) from it with the unit normal
/// `n`, but for what is below the horizon: the twin of `common/patch.glsl`.
fn patch(vpl: &Vpl, d: DVec3, n: DVec3) -> f64 {
    let [x, y] = Vpl::frame(vpl.direction).map(|axis| axis.as_dvec3());
    let [left, right, back, front] = vpl.extent.map(f64::from);
    let corners = [[right, front], [-left, front], [-left, -back], [right, -back]].map(|[a, b]| x * a + y * b - d);
    let side = |a: DVec3, b: DVec3| {
        let c = a.cross(b);
        if c == DVec3::ZERO { 0.0 } else { c.dot(n) * c.length().atan2(a.dot(b)) / c.length() }
    };
    // What is above the horizon: Sutherland & Hodgman 1974.
    let mut above = Vec::with_capacity(5);
    for (k, &b) in corners.iter().enumerate() {
        let a = corners[(k + 3) % 4];
        let (height_a, height_b) = (a.dot(n), b.dot(n));
        if height_a * height_b < 0.0 {
            above.push(a.lerp(b, height_a / (height_a - height_b)));
        }
        if height_b >= 0.0 {
            above.push(b);
        }
    }
    let sum: f64 = (0..above.len()).map(|k| side(above[k], above[(k + 1) % above.len()])).sum();
    let rectangle = (left + right) * (back + front);
    let area = std::f64::consts::PI * f64::from(vpl.d_min).powi(2);
    let afar = (2.0 * d.length() / f64::from(vpl.near())).powi(2).min(1.0);
    (-0.5 * sum).max(0.0) * ((1.0 - afar) / area + afar / rectangle)
}

/// Irradiance, W/m², at `position` (m) with unit `normal` from the VPLs that `visible` (by index) lets through:
/// `E = Σ I_v · w · max(0, n·ω) · V_v / max(d, d_min)²`, w = 1 in front of the VPL and ½ behind it; for a Lambertian
/// VPL the cosine in front and 0 behind, and near it what its patch gives.
/// `visible` is asked only about VPLs that would count, and whose middle is above the horizon.
pub fn irradiance(vpls: &[Vpl], position: Vec3, normal: Vec3, mut visible: impl FnMut(usize) -> bool) -> DVec3 {
    let mut sum = DVec3::ZERO;
    for (index, vpl) in vpls.iter().enumerate() {
        if let Some(Bounded { irradiance, above, .. }) = bounded(vpl, position, normal, normal)
            && (!above || visible(index))
        {
            sum += irradiance;
        }
    }
    sum
}

/// Points along either side of a view that stand for it.
const VIEW_POINTS: u32 = 24;

/// Sorts VPLs by what they would add to a view if nothing hid them, most first: by their shares of the light at a
/// grid of points, each of which has the same weight however bright it is.
pub fn most_important_first(vpls: &mut [Vpl], surfaces: &Surfaces, options: &RenderOptions) {
    let camera = &options.camera;
    let t_min = camera.near(surfaces.scene.bounds().map_or(0.0, |bounds| bounds.farthest(camera.eye)));
    let size = Vec2::new(options.width as f32, options.height as f32);
    let gives = |vpl: &Vpl, surface: &Surface| {
        bounded(vpl, surface.position, surface.normal, surface.geometric_normal)
            .filter(|bounded| bounded.above)
            .map_or(0.0, |bounded| bounded.irradiance.element_sum())
    };
    let point = |i: u32| {
        let at = (Vec2::new((i % VIEW_POINTS) as f32, (i / VIEW_POINTS) as f32) + 0.5) / VIEW_POINTS as f32;
        let (origin, direction) = camera.ray(at * size, options.width, options.height);
        let (_, surface) = surfaces.closest(origin, direction, t_min, true)?;
        let sum: f64 = vpls.iter().map(|vpl| gives(vpl, &surface)).sum();
        (sum > 0.0).then_some((surface, sum))
    };
    let points: Vec<(Surface, f64)> = (0..VIEW_POINTS * VIEW_POINTS).into_par_iter().filter_map(point).collect();
    let shares = |vpl: &Vpl| -> f64 { points.iter().map(|(surface, sum)| gives(vpl, surface) / sum).sum() };
    let mut keyed: Vec<(f64, Vpl)> = vpls.par_iter().map(|vpl| (shares(vpl), *vpl)).collect();
    keyed.sort_by(|a, b| b.0.total_cmp(&a.0));
    for (place, (_, vpl)) in vpls.iter_mut().zip(keyed) {
        *place = vpl;
    }
}

/// How [`Pictures::new`] sums.
#[derive(Clone, Copy, Debug)]
pub struct Sum {
    /// Whether rays find what hides the VPLs; else nothing does.
    pub occlusion: bool,
    /// See [`crate::Settings::sums_specular`].
    pub specular: bool,
}

/// Indirect radiance, W/(m² sr), at the pixels' centres, rows from the top.
pub struct Pictures {
    /// As the gather sums it.
    pub bounded: Vec<[f32; 3]>,
    /// With points in place of the VPLs' patches, and with lobes as narrow as they are: bright dots where VPLs
    /// are near.
    pub unbounded: Vec<[f32; 3]>,
}

impl Pictures {
    /// Sums over the VPLs at each pixel. `progress` hears the share that is done.
    pub fn new(
        surfaces: &Surfaces,
        vpls: &[Vpl],
        options: &RenderOptions,
        sum: Sum,
        progress: &mut dyn FnMut(f32),
    ) -> Self {
        let (width, camera) = (options.width, &options.camera);
        let t_min = camera.near(surfaces.scene.bounds().map_or(0.0, |bounds| bounds.farthest(camera.eye)));
        let pixel = |pixel: usize| {
            let at = Vec2::new((pixel as u32 % width) as f32, (pixel as u32 / width) as f32) + 0.5;
            let (origin, direction) = camera.ray(at, width, options.height);
            let Some((_, surface)) = surfaces.closest(origin, direction, t_min, true) else { return [[0.0; 3]; 2] };
            radiance(surfaces, &surface, -direction.normalize(), vpls, sum)
                .map(|sum| (sum.as_vec3() * surface.occlusion).to_array())
        };
        let count = width as usize * options.height as usize;
        let mut pixels = Vec::with_capacity(count);
        for first in (0..count).step_by(REPORT_EVERY) {
            progress(first as f32 / count as f32);
            pixels.par_extend((first..count.min(first + REPORT_EVERY)).into_par_iter().map(pixel));
        }
        let (bounded, unbounded) = pixels.into_iter().map(|[bounded, unbounded]| (bounded, unbounded)).unzip();
        Self { bounded, unbounded }
    }
}

/// Radiance, W/(m² sr), that a surface reflects toward the unit vector `v`: with the bound and without.
fn radiance(surfaces: &Surfaces, surface: &Surface, v: Vec3, vpls: &[Vpl], sum: Sum) -> [DVec3; 2] {
    let brdf = if sum.specular { surface.brdf } else { Brdf { metallic: 0.0, specular: 0.0, ..surface.brdf } };
    let alpha2 = brdf.roughness.powi(4).max(1e-6);
    let mut sums = [DVec3::ZERO; 2];
    for vpl in vpls {
        let Some(Bounded { direction: l, irradiance: bounded, above, faces }) =
            bounded(vpl, surface.position, surface.normal, surface.geometric_normal)
        else {
            continue;
        };
        if above && sum.occlusion && surfaces.occluded(surface.start(l), vpl.position) {
            continue;
        }
        if !faces {
            sums[0] += bounded * (brdf.base * (1.0 - brdf.metallic)).as_dvec3() / std::f64::consts::PI;
            continue;
        }
        let unbounded = point_irradiance(vpl, surface.position, surface.normal, 0.0);
        let (d2, bound2) = (surface.position.distance_squared(vpl.position), vpl.d_min * vpl.d_min);
        let wide = (alpha2 + 2.0 * bound2 / d2.max(1e-36)).min(1.0).powf(0.25);
        // What is reflected of a disc is no brighter than the disc, I / (π d_min²).
        let of_one = bounded.element_sum() / vpl.intensity.as_dvec3().element_sum().max(1e-36);
        let most = 1.0 / (std::f64::consts::PI * f64::from(bound2) * of_one).max(1e-36);
        let [wide, narrow] = [(bounded, wide, most as f32), (unbounded, brdf.roughness, f32::INFINITY)];
        for (sum, (irradiance, roughness, most)) in sums.iter_mut().zip([wide, narrow]) {
            let value = Brdf { roughness, ..brdf }.value_within(surface.normal, l, v, most);
            *sum += irradiance * value.as_dvec3();
        }
    }
    sums
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use glam::Mat4;

    use super::*;
    use crate::scene::{Instance, Material, Mesh};
    use crate::{Camera, Scene};

    #[test]
    fn one_vpl_in_front_behind_near_and_from_below() {
        let vpl = Vpl {
            position: Vec3::ZERO,
            direction: Vec3::Z,
            intensity: Vec3::new(3.0, 2.0, 1.0),
            d_min: 0.5,
            extent: [0.0; 4],
            emission: Emission::Wavelet,
        };
        let at = |position, normal| irradiance(&[vpl], position, normal, |_| true).x;
        assert!((at(Vec3::new(0.0, 0.0, 2.0), Vec3::NEG_Z) - 3.0 / 4.0).abs() < 1e-12);
        assert!((at(Vec3::new(0.0, 0.0, -2.0), Vec3::Z) - 3.0 / 8.0).abs() < 1e-12);
        assert!((at(Vec3::new(0.0, 0.0, 0.1), Vec3::NEG_Z) - 3.0 / 0.25).abs() < 1e-6);
        assert_eq!(at(Vec3::new(0.0, 0.0, 2.0), Vec3::Z), 0.0);
        assert_eq!(irradiance(&[vpl], Vec3::Z, Vec3::NEG_Z, |_| false), DVec3::ZERO);
    }

    /// Of VPLs of one power those near what is seen come first.
    #[test]
    fn near_vpls_are_the_most_important() {
        let scene = crate::Scene::builtin("cornell").unwrap();
        let options = RenderOptions::new(64, 48, scene.cameras[0].clone());
        let (origin, direction) = options.camera.ray(Vec2::new(32.0, 24.0), 64, 48);
        let surfaces = Surfaces::new(&scene);
        let (_, wall) = surfaces.closest(origin, direction, 0.0, true).unwrap();
        let at = |distance: f32| {
            let position = wall.position + wall.geometric_normal * distance;
            Vpl::lambertian(position, -wall.geometric_normal, Vec3::ONE, 0.01)
        };
        let mut vpls = [0.7, 0.1, 0.9, 0.3, 0.5].map(at);
        most_important_first(&mut vpls, &surfaces, &options);
        let first = vpls[0].position.distance(wall.position);
        let last = vpls[4].position.distance(wall.position);
        assert!(first < 0.35 && last > 0.65, "{first} {last}");
    }

    /// A white metal reflects a patch of radiance 1 that is close above it and whose middle is aside.
    #[test]
    fn what_is_reflected_of_a_patch_is_no_brighter() {
        let mut scene = crate::Scene::builtin("cornell").unwrap();
        for material in &mut scene.materials {
            *material = Material {
                base_color: glam::Vec4::ONE,
                metallic: 1.0,
                roughness: 0.3,
                ..Material::lambert("metal", Vec3::ONE)
            };
        }
        let options = RenderOptions::new(64, 48, scene.cameras[0].clone());
        let (origin, direction) = options.camera.ray(Vec2::new(32.0, 24.0), 64, 48);
        let surfaces = Surfaces::new(&scene);
        let (_, wall) = surfaces.closest(origin, direction, 0.0, true).unwrap();
        let n = wall.geometric_normal;
        let [x, _] = Vpl::frame(-n);
        let sum = Sum { occlusion: false, specular: true };
        let (mut most, mut sums) = (0.0f64, 0);
        // A long one, above the point with one half.
        let extent = [1.0, 1.0, 0.1, 0.1];
        let d_min = (0.4 / PI).sqrt() as f32;
        for (height, aside, view) in (0..1000).map(|i| (i % 10, i / 10 % 10, i / 100)) {
            let (height, aside) = (0.01 * (height + 1) as f32, 0.12 * aside as f32);
            let position = wall.position + n * height + x * aside;
            let vpl = Vpl { extent, ..Vpl::lambertian(position, -n, Vec3::splat(PI as f32 * d_min.powi(2)), d_min) };
            let (sine, cosine) = (0.157 * (view as f32 + 0.5)).sin_cos();
            let radiance = radiance(&surfaces, &wall, n * sine - x * cosine, &[vpl], sum)[0];
            most = most.max(radiance.x);
            sums += usize::from(radiance.x > 0.0);
        }
        println!("{most}");
        assert!(sums > 500 && most > 0.5 && most < 1.0 + 1e-6, "{sums} {most}");
    }

    /// On a table whose shading normal leans by 40°, at the middle of its top: rectangles that stand on it, in it or beside
    /// it, against sums over their areas. `n` is the normal by which light is cut off; rays are asked where the middle is
    /// above the top, whatever the shading normal says, and what stands between takes all of it then.
    #[test]
    fn where_the_shading_normal_leans_the_surface_itself_hides_what_is_below_it() {
        let (side, lean) = (0.2, Vec3::new(0.643, 0.766, 0.0).normalize());
        let square = |to: &dyn Fn(f32, f32) -> Vec3, normal: Vec3| Mesh {
            positions: [(-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0)].map(|(a, b)| to(a, b)).to_vec(),
            normals: vec![normal; 4],
            indices: vec![0, 1, 2, 0, 2, 3],
            ..Mesh::default()
        };
        let wall = |x: f32| square(&|a, b| Vec3::new(x, 0.51 + 0.5 * a, b), Vec3::X);
        let top = square(&|x, z| Vec3::new(x, 0.0, z), lean);
        let underside = square(&|x, z| Vec3::new(x, -0.01, z), Vec3::NEG_Y);
        let camera = Camera::look_at(Vec3::new(0.0, 1.0, 0.3), Vec3::ZERO, 0.5).unwrap();
        for (middle, n, is_asked, faces) in [
            (Vec3::new(0.3, 0.3, 0.0), lean, true, true),
            (Vec3::new(-0.3, 0.1, 0.0), lean, true, false),
            (Vec3::new(0.3, -0.05, 0.0), Vec3::Y, false, false),
            (Vec3::new(-0.1, -0.05, 0.0), Vec3::Y, false, false),
        ] {
            let out = Vec3::new(-middle.x.signum(), 0.0, 0.0);
            let vpl = Vpl::lambertian(middle, out, Vec3::ONE, side / (0.5 * PI.sqrt() as f32));
            let steps = 400;
            let mut expected = 0.0;
            for i in 0..steps * steps {
                let [y, z] = [i % steps, i / steps].map(|k| (2.0 * (k as f32 + 0.5) / steps as f32 - 1.0) * side);
                let to = (middle + Vec3::new(0.0, y, z)).as_dvec3();
                let l = to.normalize();
                let cosines = l.dot(n.as_dvec3()).max(0.0) * -l.dot(out.as_dvec3());
                expected += cosines / to.length_squared() / f64::from(steps * steps);
            }
            // A lobe adds nothing to what does not face.
            let specular = if faces { 0.0 } else { 1.0 };
            let material = Material { specular, roughness: 0.4, ..Material::lambert("", Vec3::splat(0.5)) };
            for hides in [false, true] {
                let scene = Scene {
                    meshes: [top.clone(), underside.clone(), wall(if hides { 0.5 * middle.x } else { 2.0 })]
                        .map(Into::into)
                        .to_vec(),
                    materials: vec![Material { double_sided: true, ..material.clone() }],
                    instances: (0..3).map(|mesh| Instance { mesh, world_from_object: Mat4::IDENTITY }).collect(),
                    ..Scene::default()
                };
                let sum = Sum { occlusion: true, specular: true };
                let options = RenderOptions::new(1, 1, camera.clone());
                let got = Pictures::new(&Surfaces::new(&scene), &[vpl], &options, sum, &mut |_| ()).bounded[0][0];
                let expected = if hides && is_asked { 0.0 } else { 0.5 / PI * expected };
                assert!((f64::from(got) - expected).abs() <= 0.01 * expected, "{middle} {hides}: {got}, {expected}");
            }
            let afar = Vpl { position: 20.0 * middle, ..vpl };
            assert_eq!(bounded(&afar, Vec3::ZERO, lean, Vec3::Y).is_some(), faces, "{middle}");
        }
    }

    /// A rectangle against a sum over its area: above it, aside, in the corner of a wall that it stands before.
    #[test]
    fn a_patch_is_the_integral_over_its_rectangle() {
        let half = 0.25 * PI.sqrt();
        let extent = [half, 0.5 * half, 1.5 * half, half].map(|side| side as f32);
        let [left, right, back, front] = extent.map(f64::from);
        let area = (left + right) * (back + front);
        let vpl =
            |area: f64| Vpl { extent, ..Vpl::lambertian(Vec3::ZERO, Vec3::Z, Vec3::ONE, (area / PI).sqrt() as f32) };
        let vpl = (vpl(area), vpl(0.5 * area));
        // The frame of the VPL: x is −y of the world, y is x.
        assert_eq!(Vpl::frame(Vec3::Z), [Vec3::NEG_Y, Vec3::X]);
        let steps = 2000;
        for (d, n) in [
            (DVec3::new(0.0, 0.0, 0.1), DVec3::NEG_Z),
            (DVec3::new(0.0, 0.0, 1.9), DVec3::NEG_Z),
            (DVec3::new(0.7, 0.2, 0.3), DVec3::new(-0.6, 0.0, -0.8)),
            // Some of it is behind the receiver, or but for a corner all of it.
            (DVec3::new(0.0, 0.0, 0.3), DVec3::X),
            (DVec3::new(-half, 0.0, 0.2), DVec3::X),
            (DVec3::new(0.9 * half, 0.9 * half, 0.05), DVec3::new(0.6, 0.8, 0.0)),
        ] {
            let mut expected = 0.0;
            for i in 0..steps * steps {
                let [x, y] = [i % steps, i / steps].map(|k| (f64::from(k) + 0.5) / f64::from(steps));
                let (x, y) = (x * (left + right) - left, y * (back + front) - back);
                let to = DVec3::new(y, -x, 0.0) - d;
                let l = to.normalize();
                expected += (-l.z).max(0.0) * l.dot(n).max(0.0) / to.length_squared();
            }
            expected /= f64::from(steps * steps);
            let got = patch(&vpl.0, d, n);
            assert!((got / expected - 1.0).abs() < 0.01, "{d} {n}: {got}, expected {expected}");
            // Of half of it that is surface the radiance is twice as high near it, and the flux is the same afar.
            let expected = expected * (2.0 - (2.0 * d.length() / f64::from(vpl.1.near())).powi(2).min(1.0));
            let got = patch(&vpl.1, d, n);
            assert!((got / expected - 1.0).abs() < 0.01, "{d} {n}: {got}, expected {expected}");
        }
        // Against the whole sky: π times its radiance.
        assert!((patch(&vpl.0, DVec3::new(0.0, 0.0, 1e-6), DVec3::NEG_Z) * area / PI - 1.0).abs() < 1e-3);
    }
}
