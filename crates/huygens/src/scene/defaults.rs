//! A light and a camera for scenes that have none.
//!
//! The rule. Rays are cast in all directions from nine points in the middle half of the scene. Where a third of the
//! points see the fronts of surfaces with at least four rays of five, the scene is an interior, else an object.
//!
//! - An **object** is seen from in front (+z), a little from the right and from above, from where the sphere around it
//!   fills the picture's height (42°). The light is a Lambertian emitter at 2.5 radii, from in front, above and a
//!   little to the left.
//! - In an **interior** the camera stands at 0.55 of the room's height and looks, level and with 65°, where the view
//!   goes furthest on average, at least 12 % of the room's height away from everything. The light is a Lambertian
//!   emitter that faces down from 4 % of the room's height below the ceiling; of the roomiest quarter of places it
//!   hangs at the one from which it lights most of what the camera sees.
//!
//! The light's irradiance is π W/m² at the object's centre, or at the floor below the light: a white Lambertian
//! surface there has a radiance of 1.

use std::f32::consts::{PI, TAU};

use glam::{Vec3, vec3};

use super::{Bounds, Scene};
use crate::camera::Projection;
use crate::reference::Bvh;
use crate::{Camera, Light, Profile};

/// Share of the rays around a point that must meet fronts for the point to be indoors.
const INDOORS: f32 = 0.8;

/// Adds a light where the scene has none, and a camera likewise, by the rule above.
pub(crate) fn complete(scene: &mut Scene) {
    if !scene.lights.is_empty() && !scene.cameras.is_empty() {
        return;
    }
    let bounds = scene.bounds().unwrap_or(Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE });
    let extent = bounds.max - bounds.min;
    // Nothing is inside something flat, and many rays in its plane would take long.
    let flat = extent.min_element() <= 1e-3 * extent.max_element();
    let given = scene.cameras.first();
    let found = if flat { None } else { interior(&Bvh::new(scene), bounds, given) };
    let (camera, light) = found.unwrap_or_else(|| object(bounds));
    if scene.cameras.is_empty() {
        scene.cameras.push(camera);
    }
    if scene.lights.is_empty() {
        scene.lights.push(light);
    }
}

fn object(bounds: Bounds) -> (Camera, Light) {
    let center = bounds.center();
    // Something that has no size, or so little that coordinates do not resolve it, is shown as if it had some.
    let mut radius = bounds.radius().max(1e-4 * center.abs().max_element());
    if radius == 0.0 {
        radius = 1.0;
    }
    let fov_y = 42_f32.to_radians();
    let to_eye = vec3(0.4, 0.35, 1.0).normalize();
    let eye = center + to_eye * (1.05 * radius / (0.5 * fov_y).sin());
    let (to_light, distance) = (vec3(-0.35, 0.8, 1.0).normalize(), 2.5 * radius);
    (camera(eye, -to_eye, fov_y), light(center + to_light * distance, -to_light, distance))
}

/// `None` if the scene is no interior.
fn interior(bvh: &Bvh, bounds: Bounds, given: Option<&Camera>) -> Option<(Camera, Light)> {
    let at = |x: f32, y: f32, z: f32| bounds.min + (bounds.max - bounds.min) * vec3(x, y, z);
    let quarters = (0..8).map(|i| [1, 2, 4].map(|bit| if i & bit == 0 { 0.25 } else { 0.75 }));
    let probes = quarters.chain([[0.5; 3]]).filter(|[x, y, z]| indoors(bvh, at(*x, *y, *z), 256).is_some());
    if probes.count() < 3 {
        return None;
    }

    // Every place of a coarse grid that is indoors, with the floor and the ceiling there.
    let mut columns = Vec::new();
    for i in 0..9 * 9 * 3 {
        let place = at(((i % 9) as f32 + 0.5) / 9.0, ((i / 81) as f32 + 0.5) / 3.0, ((i / 9 % 9) as f32 + 0.5) / 9.0);
        let reach = |direction| front(bvh, place, direction);
        if let (Some(_), Some(up), Some(down)) = (indoors(bvh, place, 64), reach(Vec3::Y), reach(Vec3::NEG_Y)) {
            columns.push((place - down * Vec3::Y, up + down));
        }
    }

    let mut best_view: Option<(f32, Camera)> = None;
    for &(floor, height) in &columns {
        let eye = floor + 0.55 * height * Vec3::Y;
        if indoors(bvh, eye, 64).is_none_or(|room| room.nearest < 0.12 * height) {
            continue;
        }
        for turn in 0..16 {
            let (sin, cos) = (TAU * turn as f32 / 16.0).sin_cos();
            let camera = camera(eye, vec3(sin, 0.0, -cos), 65_f32.to_radians());
            let depth: f32 =
                view_rays(&camera, 5).map(|(origin, direction)| front(bvh, origin, direction).unwrap_or(0.0)).sum();
            if best_view.as_ref().is_none_or(|(best, _)| depth > *best) {
                best_view = Some((depth, camera));
            }
        }
    }
    let camera = best_view?.1;

    let mut places: Vec<(f32, Light)> = columns
        .iter()
        .filter_map(|&(floor, height)| {
            let drop = 0.96 * height;
            let position = floor + drop * Vec3::Y;
            Some((indoors(bvh, position, 64)?.mean, light(position, Vec3::NEG_Y, drop)))
        })
        .collect();
    places.sort_by(|a, b| b.0.total_cmp(&a.0));
    places.truncate(places.len().div_ceil(4));
    let seen = seen_surfaces(bvh, given.unwrap_or(&camera));
    // The roomiest of those that light the same: the first.
    let lit = |light: &Light| seen.iter().filter(|(point, normal)| lights(bvh, light, *point, *normal)).count();
    let light =
        places.into_iter().map(|(_, light)| (lit(&light), light)).reduce(|a, b| if b.0 > a.0 { b } else { a })?;
    Some((camera, light.1))
}

fn camera(eye: Vec3, forward: Vec3, fov_y: f32) -> Camera {
    let up = forward.cross(Vec3::Y).cross(forward).normalize();
    Camera { name: "default".to_owned(), eye, forward, up, projection: Projection::Perspective { fov_y }, near: None }
}

/// An emitter whose irradiance is π W/m² at `distance` along its axis.
fn light(position: Vec3, axis: Vec3, distance: f32) -> Light {
    let intensity = Vec3::splat(PI * distance * distance);
    Light { name: "default".to_owned(), position, axis, intensity, profile: Profile::Cosine }
}

/// How far away surfaces are around a point.
struct Room {
    mean: f32,
    nearest: f32,
}

/// Looks around with `count` rays; `None` out of doors, and within solid things, whose surfaces show their backs.
fn indoors(bvh: &Bvh, point: Vec3, count: u32) -> Option<Room> {
    let (mut hits, mut sum, mut nearest) = (0, 0.0, f32::INFINITY);
    for i in 0..count {
        // A Fibonacci lattice: directions spread evenly over the sphere.
        let y = 1.0 - (2.0 * i as f32 + 1.0) / count as f32;
        let (sin, cos) = (i as f32 * PI * (3.0 - 5.0_f32.sqrt())).sin_cos();
        let r = (1.0 - y * y).sqrt();
        if let Some(distance) = front(bvh, point, vec3(r * cos, y, r * sin)) {
            (hits, sum, nearest) = (hits + 1, sum + distance, nearest.min(distance));
        } else if (i + 1 - hits) as f32 > (1.0 - INDOORS) * count as f32 {
            return None;
        }
    }
    (hits as f32 >= INDOORS * count as f32).then(|| Room { mean: sum / hits as f32, nearest })
}

/// Distance to what a ray meets, if it meets the front of it.
fn front(bvh: &Bvh, origin: Vec3, direction: Vec3) -> Option<f32> {
    let hit = bvh.closest(origin, direction, 0.0, f32::INFINITY)?;
    (hit.normal.dot(direction) < 0.0).then_some(hit.t)
}

/// Origins and directions (1 along the camera's axis) of `count` × `count` rays through a square picture.
fn view_rays(camera: &Camera, count: u32) -> impl Iterator<Item = (Vec3, Vec3)> {
    let (scale, parallel, perspective) = camera.unprojection(1.0);
    let right = camera.forward.cross(camera.up);
    (0..count * count).map(move |i| {
        let ndc = [i % count, i / count].map(|k| (2 * k + 1) as f32 / count as f32 - 1.0);
        let offset = right * (ndc[0] * scale.x) + camera.up * (ndc[1] * scale.y);
        (camera.eye + offset * parallel, camera.forward + offset * perspective)
    })
}

/// Points on what the camera sees, with the geometric normal on its side.
fn seen_surfaces(bvh: &Bvh, camera: &Camera) -> Vec<(Vec3, Vec3)> {
    view_rays(camera, 16)
        .filter_map(|(origin, direction)| {
            let hit = bvh.closest(origin, direction, 0.0, f32::INFINITY)?;
            Some((origin + direction * hit.t, hit.normal * -hit.normal.dot(direction).signum()))
        })
        .collect()
}

/// Whether a light reaches a point on a surface from its front.
fn lights(bvh: &Bvh, light: &Light, point: Vec3, normal: Vec3) -> bool {
    let to_light = light.position - point;
    light.profile.value(-to_light.normalize_or_zero().dot(light.axis)) > 0.0
        && normal.dot(to_light) > 0.0
        && !bvh.occluded(point, light.position)
}

#[cfg(test)]
pub(super) mod tests {
    use glam::{Mat4, Vec4Swizzles};

    use super::*;
    use crate::scene::{BUILTIN_NAMES, Instance, Mesh};

    /// The share of what the first camera sees that the first light lights directly.
    pub fn directly_lit(scene: &Scene) -> f32 {
        let bvh = Bvh::new(scene);
        let seen = seen_surfaces(&bvh, &scene.cameras[0]);
        let lit = seen.iter().filter(|(point, normal)| lights(&bvh, &scene.lights[0], *point, *normal)).count();
        lit as f32 / seen.len() as f32
    }

    fn bare(name: &str) -> Scene {
        Scene { lights: Vec::new(), cameras: Vec::new(), ..Scene::builtin(name).unwrap() }
    }

    #[test]
    fn built_in_scenes_are_interiors_and_well_lit() {
        for (name, _) in BUILTIN_NAMES {
            let mut scene = bare(name);
            complete(&mut scene);
            let (bounds, camera, light) = (scene.bounds().unwrap(), &scene.cameras[0], &scene.lights[0]);
            for point in [camera.eye, light.position] {
                assert!(point.cmpgt(bounds.min).all() && point.cmplt(bounds.max).all(), "{name}: {point}");
            }
            let lit = directly_lit(&scene);
            println!("{name}: {:.2} lit; eye {} to {}, light {}", lit, camera.eye, camera.forward, light.position);
            assert!(lit > 0.5, "{name}: {lit} lit from {}, seen from {camera:?}", light.position);
        }
    }

    #[test]
    fn what_is_there_stays() {
        let whole = Scene::builtin("column").unwrap();
        for (lights, cameras) in [(true, false), (false, true), (true, true)] {
            let mut scene = whole.clone();
            if !lights {
                scene.lights.clear();
            }
            if !cameras {
                scene.cameras.clear();
            }
            complete(&mut scene);
            assert_eq!((scene.lights.len(), scene.cameras.len()), (1, 1));
            assert_eq!((scene.lights == whole.lights, scene.cameras == whole.cameras), (lights, cameras));
        }
    }

    /// The column of the room alone.
    fn only_the_column(scale: f32) -> Scene {
        let mut scene = bare("column");
        let column = scene.meshes.iter().position(|mesh| mesh.name == "column").unwrap();
        scene.instances.retain(|instance| instance.mesh == column);
        scene.instances[0].world_from_object =
            Mat4::from_scale(Vec3::splat(scale)) * scene.instances[0].world_from_object;
        scene
    }

    #[test]
    fn an_object_fills_the_picture_at_every_scale_and_is_lit() {
        for scale in [1e-6, 1.0, 1e6] {
            let mut scene = only_the_column(scale);
            complete(&mut scene);
            let (bounds, camera, light) = (scene.bounds().unwrap(), &scene.cameras[0], &scene.lights[0]);
            let clip_from_world = camera.clip_from_view(1.0, 0.01 * scale, 100.0 * scale) * camera.view_from_world();
            let mut highest = 0.0_f32;
            for mesh in scene.instances.iter().map(|i| (&scene.meshes[i.mesh], i.world_from_object)) {
                for &position in &mesh.0.positions {
                    let clip = clip_from_world * mesh.1 * position.extend(1.0);
                    assert!(clip.w > 0.0 && clip.xy().abs().max_element() < clip.w, "{scale}: {clip}");
                    highest = highest.max(clip.y.abs() / clip.w);
                }
            }
            assert!(highest > 0.75, "{scale}: {highest}");
            let to_center = bounds.center() - light.position;
            assert!(to_center.normalize().dot(light.axis) > 0.9999);
            let irradiance = light.intensity.x / to_center.length_squared();
            assert!((irradiance - PI).abs() < 1e-3, "{scale}: {irradiance}");
            let lit = directly_lit(&scene);
            assert!(lit > 0.5, "{scale}: {lit}");
        }
    }

    #[test]
    fn degenerate_scenes_get_something_finite_that_looks_at_them() {
        let triangles = |positions: Vec<Vec3>, indices: Vec<u32>| Scene {
            meshes: vec![
                Mesh { normals: vec![Vec3::Y; positions.len()], positions, indices, ..Mesh::default() }.into(),
            ],
            instances: vec![Instance { mesh: 0, world_from_object: Mat4::IDENTITY }],
            ..Scene::default()
        };
        let plane = vec![vec3(-1.0, 0.0, -1.0), vec3(-1.0, 0.0, 1.0), vec3(1.0, 0.0, 1.0), vec3(1.0, 0.0, -1.0)];
        let far = vec![Vec3::splat(1e6), Vec3::splat(1e6) + Vec3::X, Vec3::splat(1e6) + Vec3::Y];
        for (what, scene) in [
            ("empty", Scene::default()),
            ("plane", triangles(plane, vec![0, 1, 2, 0, 2, 3])),
            ("one triangle", triangles(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![0, 1, 2])),
            ("far away", triangles(far, vec![0, 1, 2])),
            ("a point", triangles(vec![Vec3::ONE; 3], vec![0, 1, 2])),
            ("a point at the origin", triangles(vec![Vec3::ZERO; 3], vec![0, 1, 2])),
            ("huge", triangles(vec![Vec3::ZERO, 1e6 * Vec3::X, 1e6 * Vec3::Y], vec![0, 1, 2])),
            ("tiny", triangles(vec![Vec3::ZERO, 1e-6 * Vec3::X, 1e-6 * Vec3::Y], vec![0, 1, 2])),
        ] {
            let (mut first, mut second) = (scene.clone(), scene);
            complete(&mut first);
            complete(&mut second);
            assert_eq!((&first.cameras, &first.lights), (&second.cameras, &second.lights), "{what}");
            let (camera, light) = (&first.cameras[0], &first.lights[0]);
            assert!(camera.eye.is_finite() && (camera.forward.length() - 1.0).abs() < 1e-5, "{what}");
            assert!((camera.up.length() - 1.0).abs() < 1e-5 && camera.up.dot(camera.forward).abs() < 1e-5, "{what}");
            assert!(light.position.is_finite() && light.intensity.is_finite() && light.intensity.x > 0.0, "{what}");
            assert!((light.axis.length() - 1.0).abs() < 1e-5, "{what}");
            let center = first.bounds().map_or(Vec3::ZERO, |bounds| bounds.center());
            assert!((center - camera.eye).normalize().dot(camera.forward) > 0.999, "{what}");
        }
    }
}
