//! `--motion`: how restless a picture is in which something moves.

use std::f32::consts::TAU;

use clap::ValueEnum;
use glam::{Mat4, Quat, Vec3};
use huygens::reference::tonemap;
use huygens::{Camera, Exposure, Light, Profile, RenderOptions, Renderer, Scene, Settings};
use serde::Serialize;

use super::{exact, read};
use crate::Failure;

/// Frames of each motion that are compared.
pub const FRAMES: u32 = 60;

/// Frames before a motion comes back to where it began.
const PERIOD: f32 = 60.0;

/// How far everything goes to either side, as a share of the scene's size.
const SWAY: f32 = 0.02;

/// What moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Moving {
    Light,
    Camera,
    Object,
}

impl Moving {
    pub const ALL: [Self; 3] = [Self::Light, Self::Camera, Self::Object];

    pub fn name(self) -> &'static str {
        match self {
            Self::Light => "light",
            Self::Camera => "camera",
            Self::Object => "object",
        }
    }
}

/// From frame to frame, as means over the frames, pixels and channels of sRGB values from 0 to 1.
#[derive(Serialize)]
pub struct Motion {
    pub moving: Moving,
    frames: u32,
    /// Of the picture.
    pub change: f64,
    /// Of the exact gather of the same VPLs.
    pub exact_change: f64,
    /// Difference of the two changes of each pixel.
    pub flicker: f64,
}

/// Scene and view of a frame.
pub fn frame(moving: &[Moving], before: &Scene, view: &RenderOptions, number: u32) -> (Scene, RenderOptions) {
    let (mut scene, mut options) = (before.clone(), view.clone());
    let size = before.bounds().map_or(1.0, |bounds| bounds.radius());
    let offset = circle(number, Vec3::X, Vec3::Z) * (SWAY * size);
    if moving.contains(&Moving::Light)
        && let Some(light) = scene.lights.first_mut()
    {
        *light = swayed(light, offset, number);
    }
    if moving.contains(&Moving::Camera) {
        options.camera = path(&view.camera, size, number);
    }
    if moving.contains(&Moving::Object)
        && let Some(object) = object(before, &view.camera)
    {
        let placed = &mut scene.instances[object].world_from_object;
        *placed = Mat4::from_translation(offset) * *placed;
    }
    (scene, options)
}

/// Frame `number` on a circle through the origin, of radius 1.
fn circle(number: u32, right: Vec3, up: Vec3) -> Vec3 {
    let (sine, cosine) = (number as f32 / PERIOD * TAU).sin_cos();
    right * sine + up * (1.0 - cosine)
}

/// The camera turns 5° to either side of where it looked, half a degree a frame at most, and goes round a circle.
pub fn path(camera: &Camera, size: f32, number: u32) -> Camera {
    let right = camera.forward.cross(camera.up);
    let turn = Quat::from_axis_angle(camera.up, 5f32.to_radians() * (number as f32 / PERIOD * TAU).sin());
    Camera {
        eye: camera.eye + circle(number, right, camera.up) * (SWAY * size),
        forward: (turn * camera.forward).normalize(),
        ..camera.clone()
    }
}

/// A light elsewhere; one without a place turns, by 5° to either side.
fn swayed(light: &Light, offset: Vec3, number: u32) -> Light {
    let mut light = light.clone();
    match light.profile {
        Profile::Directional => {
            let angle = 5f32.to_radians() * (number as f32 / PERIOD * TAU).sin();
            let turn = Quat::from_axis_angle(light.axis.any_orthonormal_vector(), angle);
            light.axis = (turn * light.axis).normalize();
        }
        _ => light.position += offset,
    }
    light
}

/// Of the instances that take up at most half of the scene, the one that is nearest to the middle of the view.
fn object(scene: &Scene, camera: &Camera) -> Option<usize> {
    let size = scene.bounds()?.radius();
    let angle = |instance| {
        let bounds = scene.bounds_of(instance).filter(|bounds| bounds.radius() <= 0.5 * size)?;
        let angle = (bounds.center() - camera.eye).normalize_or_zero().dot(camera.forward).clamp(-1.0, 1.0).acos();
        Some(angle)
    };
    let angles = scene.instances.iter().enumerate().filter_map(|(i, instance)| Some((i, angle(instance)?)));
    angles.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(i, _)| i)
}

/// Whether the scene has something of the kind.
pub fn moves(moving: Moving, scene: &Scene, options: &RenderOptions) -> bool {
    match moving {
        Moving::Light => !scene.lights.is_empty(),
        Moving::Camera => true,
        Moving::Object => object(scene, &options.camera).is_some(),
    }
}

/// Draws the frames twice. `renderers` may have drawn anything before.
pub fn measure(
    moving: Moving,
    renderers: &mut [Renderer; 2],
    scene: &Scene,
    settings: &Settings,
    options: &RenderOptions,
    warm_up: u32,
    step: &mut dyn FnMut(),
) -> Result<Motion, Failure> {
    let settings = [settings.clone(), exact(settings)];
    let mut ev = match options.exposure {
        Exposure::Ev(ev) => Some(ev),
        Exposure::Auto => None,
    };
    let mut last: Option<[Vec<[f32; 3]>; 2]> = None;
    let mut sums = [0.0; 3];
    for number in 0..=warm_up + FRAMES {
        let (scene, options) = frame(&[moving], scene, options, number);
        let mut now = [Vec::new(), Vec::new()];
        for ((renderer, settings), now) in renderers.iter_mut().zip(&settings).zip(&mut now).rev() {
            renderer.draw(&scene, settings, &options)?;
            if number >= warm_up {
                let rendered = read(renderer)?;
                // One exposure for all, that of the first exact picture.
                let ev = *ev.get_or_insert(rendered.stats.exposure_ev);
                *now = tonemap::shown(&rendered.linear, ev);
            }
        }
        if let Some(last) = last.replace(now.clone()).filter(|_| number > warm_up) {
            for (sum, change) in sums.iter_mut().zip(changes(&last, &now)) {
                *sum += change / f64::from(FRAMES);
            }
        }
        step();
    }
    let [change, exact_change, flicker] = sums;
    Ok(Motion { moving, frames: FRAMES, change, exact_change, flicker })
}

/// Mean change of both pictures, and of their difference.
fn changes(last: &[Vec<[f32; 3]>; 2], now: &[Vec<[f32; 3]>; 2]) -> [f64; 3] {
    let of = |i: usize| now[i].as_flattened().iter().zip(last[i].as_flattened()).map(|(a, b)| f64::from(a - b));
    let count = now[0].as_flattened().len() as f64;
    let (mut sums, pairs) = ([0.0; 3], of(0).zip(of(1)));
    for (test, exact) in pairs {
        for (sum, change) in sums.iter_mut().zip([test, exact, test - exact]) {
            *sum += change.abs() / count;
        }
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_camera_comes_back_and_never_leaps() {
        let scene = Scene::builtin("column").unwrap();
        let camera = &scene.cameras[0];
        let size = scene.bounds().unwrap().radius();
        let at = |number| path(camera, size, number);
        assert!(at(0) == *camera && (at(60).eye - camera.eye).length() < 1e-4);
        for number in 0..60 {
            let turned = at(number).forward.angle_between(at(number + 1).forward).to_degrees();
            assert!(turned < 0.53 && (at(number).forward.length() - 1.0).abs() < 1e-5, "{number}: {turned}");
        }
    }

    #[test]
    fn each_motion_moves_one_thing() {
        for (name, _) in huygens::scene::BUILTIN_NAMES {
            let scene = Scene::builtin(name).unwrap();
            let options = RenderOptions::new(8, 8, scene.cameras[0].clone());
            for moving in Moving::ALL {
                let (moved, view) = frame(&[moving], &scene, &options, 15);
                let instances = scene.instances.iter().zip(&moved.instances).filter(|(a, b)| a != b).count();
                assert_eq!(scene.lights != moved.lights, moving == Moving::Light, "{name}");
                assert_eq!(options.camera != view.camera, moving == Moving::Camera, "{name}");
                let movable = moves(Moving::Object, &scene, &options);
                assert_eq!(instances, usize::from(moving == Moving::Object && movable), "{name}");
            }
            let (moved, view) = frame(&Moving::ALL, &scene, &options, 15);
            let [light, camera, object] = Moving::ALL.map(|moving| frame(&[moving], &scene, &options, 15));
            assert!(moved.lights == light.0.lights && view.camera == camera.1.camera, "{name}");
            assert!(moved.instances == object.0.instances, "{name}");
        }
    }

    #[test]
    fn flicker_is_change_that_the_exact_picture_has_not() {
        let picture = |values: [f32; 3]| vec![values];
        let last = [picture([0.0; 3]), picture([0.5; 3])];
        let now = [picture([0.3, 0.1, 0.0]), picture([0.8, 0.5, 0.2])];
        let expected = [0.4 / 3.0, 0.6 / 3.0, 0.4 / 3.0];
        for (got, expected) in changes(&last, &now).iter().zip(expected) {
            assert!((got - expected).abs() < 1e-6, "{got} {expected}");
        }
    }
}
