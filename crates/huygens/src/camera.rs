//! Cameras: where the picture is taken from.

use glam::camera::rh::{proj::opengl, view};
use glam::{Mat4, Vec2, Vec3};

/// How a camera projects.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// A pinhole; the vertical field of view in radians.
    Perspective {
        /// Vertical angle between the upper and the lower edge, radians, in (0, π).
        fov_y: f32,
    },
    /// Parallel rays; half of the height that is seen, in metres.
    Orthographic {
        /// Half of the height that is seen, metres.
        half_height: f32,
    },
}

/// A camera in world space. It looks along −z of its own space, y up (glTF's convention).
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// Name in the file; empty if it has none.
    pub name: String,
    /// Position, metres, world space.
    pub eye: Vec3,
    /// Unit vector of sight, world space.
    pub forward: Vec3,
    /// Unit vector that points up in the picture; at right angles to `forward`.
    pub up: Vec3,
    /// The projection.
    pub projection: Projection,
    /// Distance in front of which nothing is seen, metres; `None` leaves it to the scene's size, 0.1 at most.
    pub near: Option<f32>,
}

impl Camera {
    /// A perspective camera at `eye` that looks at `target`, with the y axis up (or z, when it looks along y).
    /// `fov_y` is in radians. `None` if the two points are the same or not finite.
    pub fn look_at(eye: Vec3, target: Vec3, fov_y: f32) -> Option<Self> {
        let forward = (target - eye).try_normalize()?;
        let helper = if forward.y.abs() > 0.999 { Vec3::NEG_Z * forward.y.signum() } else { Vec3::Y };
        let up = forward.cross(helper).cross(forward).normalize();
        (eye.is_finite() && up.is_finite()).then_some(Self {
            name: String::new(),
            eye,
            forward,
            up,
            projection: Projection::Perspective { fov_y },
            near: None,
        })
    }

    /// World space to view space.
    pub fn view_from_world(&self) -> Mat4 {
        view::look_to_mat4(self.eye, self.forward, self.up)
    }

    /// View space to clip space (OpenGL: z in −w…w). `aspect` is width over height; `near` and `far` in metres.
    pub fn clip_from_view(&self, aspect: f32, near: f32, far: f32) -> Mat4 {
        match self.projection {
            Projection::Perspective { fov_y } => opengl::perspective(fov_y, aspect, near, far),
            Projection::Orthographic { half_height: h } => {
                opengl::orthographic(-h * aspect, h * aspect, -h, h, near, far)
            }
        }
    }

    /// Distance along the axis in front of which nothing is seen, m; `far` to the farthest point of the scene.
    pub(crate) fn near(&self, far: f32) -> f32 {
        let far = far.max(1e-20) * 1.01;
        self.near.unwrap_or((far * 1e-4).min(0.1)).min(far * 0.5)
    }

    /// The ray through a point of the picture, in pixels from its upper left corner. World space; the direction
    /// advances by 1 m along the camera's axis.
    pub fn ray(&self, at: Vec2, width: u32, height: u32) -> (Vec3, Vec3) {
        let size = Vec2::new(width as f32, height as f32);
        let ndc = (at / size * 2.0 - 1.0) * Vec2::new(1.0, -1.0);
        let right = self.forward.cross(self.up);
        let (scale, a, b) = self.unprojection(size.x / size.y);
        let [x, y] = (ndc * scale).to_array();
        let across = right * x + self.up * y;
        (self.eye + across * a, self.forward + across * b)
    }

    /// What takes normalised device coordinates and a depth to view space:
    /// `xy_vs = ndc · scale · (a + b · depth)`, `z_vs = −depth`. Returns (scale, a, b).
    pub fn unprojection(&self, aspect: f32) -> (Vec2, f32, f32) {
        match self.projection {
            Projection::Perspective { fov_y } => {
                let tan = (0.5 * fov_y).tan();
                (Vec2::new(tan * aspect, tan), 0.0, 1.0)
            }
            Projection::Orthographic { half_height: h } => (Vec2::new(h * aspect, h), 1.0, 0.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unprojection_inverts_the_projection() {
        let mut camera = Camera::look_at(Vec3::new(1.0, 2.0, 3.0), Vec3::new(-2.0, 0.5, 1.0), 0.8).unwrap();
        let point = Vec3::new(-1.5, 1.0, 1.2);
        for projection in [camera.projection, Projection::Orthographic { half_height: 2.5 }] {
            camera.projection = projection;
            let (vs, aspect) = (camera.view_from_world().transform_point3(point), 1.7);
            let ndc = camera.clip_from_view(aspect, 0.1, 10.0).project_point3(vs);
            let (scale, a, b) = camera.unprojection(aspect);
            let back = (ndc.truncate() * scale * (a + b * -vs.z)).extend(vs.z);
            assert!((back - vs).length() < 1e-5, "{back} {vs}");
        }
    }

    #[test]
    fn rays_go_where_the_projection_shows_their_points() {
        let mut camera = Camera::look_at(Vec3::new(1.0, 2.0, 3.0), Vec3::new(-2.0, 0.5, 1.0), 0.8).unwrap();
        for projection in [camera.projection, Projection::Orthographic { half_height: 2.5 }] {
            camera.projection = projection;
            let (origin, direction) = camera.ray(Vec2::new(17.25, 40.0), 100, 50);
            assert!((direction.dot(camera.forward) - 1.0).abs() < 1e-5);
            let clip_from_world = camera.clip_from_view(2.0, 0.1, 10.0) * camera.view_from_world();
            let ndc = clip_from_world.project_point3(origin + direction * 3.0);
            let pixel = (ndc.truncate() * Vec2::new(0.5, -0.5) + 0.5) * Vec2::new(100.0, 50.0);
            assert!((pixel - Vec2::new(17.25, 40.0)).length() < 1e-3, "{pixel}");
        }
    }

    #[test]
    fn looking_straight_down_is_allowed_and_nowhere_is_not() {
        let camera = Camera::look_at(Vec3::Y, Vec3::ZERO, 1.0).unwrap();
        assert!((camera.up.length() - 1.0).abs() < 1e-6 && camera.up.dot(camera.forward).abs() < 1e-6);
        assert!(Camera::look_at(Vec3::Y, Vec3::Y, 1.0).is_none());
    }
}
