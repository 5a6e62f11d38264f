//! Moves a camera: orbit, pan, zoom, look round, fly. What is asked for comes in radians, shares of the picture's height
//! and seconds, so that it is the same at any frame rate.

use std::f32::consts::{FRAC_PI_2, TAU};

use glam::{Vec2, Vec3};
use huygens::Camera;
use huygens::camera::Projection;
use huygens::scene::Bounds;

/// Angle from the vertical that the camera keeps, radians: nearer, `Camera::look_at` takes another axis as up.
const POLE: f32 = 0.05;

/// Farthest from the middle of the scene that the camera flies, radii of the scene.
const REACH: f32 = 1e4;

/// A camera that turns about a point in front of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Navigator {
    /// Where the picture is taken from.
    pub camera: Camera,
    /// Distance of the point that it turns about, m.
    pub distance: f32,
    /// Speed of flight, m/s.
    pub speed: f32,
    /// Middle of the scene and its radius, m.
    center: Vec3,
    radius: f32,
}

impl Navigator {
    /// Starts with a camera of a scene.
    pub fn new(camera: Camera, bounds: Option<Bounds>) -> Self {
        let (center, radius) = bounds.map_or((Vec3::ZERO, 1.0), |b| (b.center(), b.radius().max(1e-6)));
        let ahead = (center - camera.eye).dot(camera.forward);
        Self { camera, distance: ahead.clamp(0.1 * radius, 4.0 * radius), speed: 0.5 * radius, center, radius }
    }

    /// Radius of the scene, m.
    pub fn radius(&self) -> f32 {
        self.radius
    }

    /// The point that it turns about.
    pub fn pivot(&self) -> Vec3 {
        self.camera.eye + self.camera.forward * self.distance
    }

    /// Turns about the point in front of it, as if the pointer turned the scene: radians to the right and down.
    pub fn orbit(&mut self, angles: Vec2) {
        let pivot = self.pivot();
        self.look(angles);
        self.camera.eye = pivot - self.camera.forward * self.distance;
    }

    /// Looks elsewhere from the same place, radians to the right and down. It is upright from then on, as after any move: a
    /// position and a direction of sight say all of it.
    pub fn look(&mut self, angles: Vec2) {
        let Camera { forward, up, .. } = self.camera;
        // What looks straight down has its heading above, and what looks up below.
        let heading = if forward.y.abs() > POLE.cos() { up * -forward.y.signum() } else { forward };
        let yaw = (-heading.x).atan2(-heading.z) - angles.x;
        let pitch = (forward.y.clamp(-1.0, 1.0).asin() - angles.y).clamp(POLE - FRAC_PI_2, FRAC_PI_2 - POLE);
        let yaw = yaw.rem_euclid(TAU);
        let direction = Vec3::new(-yaw.sin() * pitch.cos(), pitch.sin(), -yaw.cos() * pitch.cos());
        self.face(direction);
    }

    fn face(&mut self, direction: Vec3) {
        if let Some(turned) = Camera::look_at(Vec3::ZERO, direction, 1.0) {
            (self.camera.forward, self.camera.up) = (turned.forward, turned.up);
        }
    }

    /// Moves across the line of sight so that what is at the pivot's distance follows the pointer: shares of the picture's
    /// height, to the right and down.
    pub fn pan(&mut self, by: Vec2) {
        self.look(Vec2::ZERO);
        let height = match self.camera.projection {
            Projection::Perspective { fov_y } => 2.0 * self.distance * (0.5 * fov_y).tan(),
            Projection::Orthographic { half_height } => 2.0 * half_height,
        };
        let right = self.camera.forward.cross(self.camera.up);
        self.move_by((self.camera.up * by.y - right * by.x) * height);
    }

    /// Comes nearer to the pivot by so many steps of a tenth, or goes away.
    pub fn zoom(&mut self, steps: f32) {
        self.look(Vec2::ZERO);
        let factor = 0.9_f32.powf(steps.clamp(-40.0, 40.0));
        if let Projection::Orthographic { half_height } = &mut self.camera.projection {
            *half_height = (*half_height * factor).clamp(1e-4 * self.radius, 1e3 * self.radius);
            return;
        }
        let pivot = self.pivot();
        self.distance = (self.distance * factor).clamp(1e-3 * self.radius, 1e3 * self.radius);
        self.camera.eye = pivot - self.camera.forward * self.distance;
    }

    /// Flies for so many seconds: `direction` is to the right, up and ahead.
    pub fn fly(&mut self, direction: Vec3, seconds: f32) {
        self.look(Vec2::ZERO);
        let Camera { forward, up, .. } = self.camera;
        let along = forward.cross(up) * direction.x + Vec3::Y * direction.y + forward * direction.z;
        self.move_by(along.normalize_or_zero() * self.speed * seconds);
    }

    /// Flies faster by so many steps of a fifth, or slower.
    pub fn faster(&mut self, steps: f32) {
        self.speed = (self.speed * 1.2_f32.powf(steps.clamp(-40.0, 40.0))).clamp(1e-3 * self.radius, 1e2 * self.radius);
    }

    /// Shows all of a box, from the same side.
    pub fn frame(&mut self, bounds: Bounds, aspect: f32) {
        self.look(Vec2::ZERO);
        let radius = bounds.radius().max(1e-3 * self.radius);
        match &mut self.camera.projection {
            Projection::Perspective { fov_y } => {
                let half = (0.5 * *fov_y).tan() * aspect.min(1.0);
                self.distance = radius / half.atan().sin();
            }
            Projection::Orthographic { half_height } => {
                *half_height = radius / aspect.min(1.0);
                self.distance = 2.0 * radius;
            }
        }
        self.camera.eye = bounds.center() - self.camera.forward * self.distance;
    }

    /// Stays within reach of the scene, where numbers are exact enough.
    fn move_by(&mut self, by: Vec3) {
        let eye = self.camera.eye + by;
        if (eye - self.center).length() < REACH * self.radius {
            self.camera.eye = eye;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn navigator() -> Navigator {
        let camera = Camera::look_at(Vec3::new(0.0, 1.0, 5.0), Vec3::new(0.0, 1.0, 0.0), 0.9).unwrap();
        Navigator::new(camera, Some(Bounds { min: Vec3::NEG_ONE, max: Vec3::new(1.0, 3.0, 1.0) }))
    }

    #[test]
    fn many_small_steps_are_one_large_one() {
        let moves: [fn(&mut Navigator, f32); 6] = [
            |n, share| n.orbit(Vec2::new(0.9, 0.3) * share),
            |n, share| n.look(Vec2::new(-0.4, 0.2) * share),
            |n, share| n.pan(Vec2::new(0.5, -0.2) * share),
            |n, share| n.zoom(7.0 * share),
            |n, share| n.fly(Vec3::new(1.0, 0.0, 2.0), 3.0 * share),
            |n, share| n.faster(4.0 * share),
        ];
        for (i, step) in moves.iter().enumerate() {
            let (mut slow, mut fast) = (navigator(), navigator());
            step(&mut slow, 1.0);
            (0..20).for_each(|_| step(&mut fast, 0.05));
            let far =
                (slow.camera.eye - fast.camera.eye).length() + (slow.camera.forward - fast.camera.forward).length();
            assert!(far < 1e-4 && (slow.speed / fast.speed - 1.0).abs() < 1e-4, "{i}: {slow:?} {fast:?}");
            assert!(slow != navigator(), "{i}");
        }
    }

    #[test]
    fn an_orbit_keeps_its_distance_and_does_not_pass_the_poles() {
        let mut n = navigator();
        let (pivot, distance) = (n.pivot(), n.distance);
        for _ in 0..100 {
            n.orbit(Vec2::new(0.7, 0.9));
            assert!((n.pivot() - pivot).length() < 1e-3 && ((n.camera.eye - pivot).length() - distance).abs() < 1e-3);
            assert!(n.camera.up.y > 0.0 && n.camera.up.dot(n.camera.forward).abs() < 1e-4);
        }
        assert!(n.camera.eye.y > pivot.y, "the pointer went down, so the camera has gone up");
    }

    #[test]
    fn what_looks_straight_down_keeps_its_heading() {
        for (forward, up) in [(Vec3::NEG_Y, Vec3::X), (Vec3::NEG_Y, Vec3::NEG_Z), (Vec3::Y, Vec3::X)] {
            let mut n = navigator();
            (n.camera.forward, n.camera.up) = (forward, up);
            n.look(Vec2::ZERO);
            assert!((n.camera.up - up).length() < 0.06, "{forward} {up}: {}", n.camera.up);
            n.look(Vec2::new(0.0, -forward.y * 0.3));
            assert!(n.camera.up.dot(up) > 0.9 && n.camera.up.y > 0.0, "{forward} {up}: {}", n.camera.up);
        }
    }

    #[test]
    fn flight_stays_within_reach() {
        let mut n = navigator();
        (0..100).for_each(|_| n.fly(Vec3::X, 1e4));
        assert!(n.camera.eye.length() < 2.1 * REACH, "{}", n.camera.eye);
        let before = n.camera.eye;
        n.fly(Vec3::NEG_X, 1.0);
        assert!(n.camera.eye.x < before.x);
    }

    #[test]
    fn what_is_under_the_pointer_follows_it() {
        let mut n = navigator();
        let (width, height) = (200, 100);
        let at = Vec2::new(70.0, 40.0);
        let hit = |n: &Navigator, at: Vec2| {
            let (origin, direction) = n.camera.ray(at, width, height);
            origin + direction * n.distance
        };
        let before = hit(&n, at);
        n.pan(Vec2::new(0.3, 0.2));
        assert!((hit(&n, at + Vec2::new(30.0, 20.0)) - before).length() < 1e-4);
    }

    #[test]
    fn all_of_a_box_is_seen() {
        let mut n = navigator();
        n.orbit(Vec2::new(2.0, 0.4));
        let bounds = Bounds { min: Vec3::new(-3.0, 0.0, -1.0), max: Vec3::new(4.0, 2.0, 1.0) };
        for aspect in [0.5, 1.7] {
            n.frame(bounds, aspect);
            let clip = n.camera.clip_from_view(aspect, 0.01, 1e3) * n.camera.view_from_world();
            for corner in 0..8 {
                let pick = |bit: usize, axis: usize| {
                    if corner >> bit & 1 == 0 { bounds.min[axis] } else { bounds.max[axis] }
                };
                let ndc = clip.project_point3(Vec3::new(pick(0, 0), pick(1, 1), pick(2, 2)));
                assert!(ndc.x.abs() <= 1.0 && ndc.y.abs() <= 1.0, "{aspect} {corner}: {ndc}");
            }
        }
    }
}
