//! Shadow maps of the lights: a cube map for lights that stand somewhere, one plane for parallel rays.

use std::rc::Rc;

use glam::camera::rh::{proj::opengl, view};
use glam::{Mat3, Mat4, Vec3, Vec4};

use crate::gl::{Context, CubeTarget, Format, Program, Target, Uniform, Viewport, uniform_block};
use crate::passes::geometry::{DrawView, GpuScene};
use crate::{Result, shaders};

uniform_block! {
    /// One face of a shadow map; `shadow.vert`.
    ShadowBlock as "PassBlock" {
        clip_from_world: Mat4,
        origin_ws: Vec4,
        axis_ws: Vec4,
    }
}

/// Direction and upward vector of OpenGL's cube map faces.
const FACES: [(Vec3, Vec3); 6] = [
    (Vec3::X, Vec3::NEG_Y),
    (Vec3::NEG_X, Vec3::NEG_Y),
    (Vec3::Y, Vec3::Z),
    (Vec3::NEG_Y, Vec3::NEG_Z),
    (Vec3::Z, Vec3::NEG_Y),
    (Vec3::NEG_Z, Vec3::NEG_Y),
];

/// The block for one face of a cube around `origin`, whose axes are `world_from_light`. `far` in metres.
pub(super) fn face_block(face: usize, origin: Vec3, world_from_light: Mat3, far: f32) -> ShadowBlock {
    let (direction, up) = FACES[face];
    let light_from_world = Mat4::from_mat3(world_from_light.transpose()) * Mat4::from_translation(-origin);
    // Distance is written by the fragment shader, so that the near plane costs no precision.
    let clip_from_light = opengl::perspective(std::f32::consts::FRAC_PI_2, 1.0, far * 1e-5, far * 1.01)
        * view::look_to_mat4(Vec3::ZERO, direction, up);
    ShadowBlock {
        clip_from_world: clip_from_light * light_from_world,
        origin_ws: origin.extend(1.0 / far),
        axis_ws: Vec4::ZERO,
    }
}

/// Pass and result: a cube of distances in light space (z along the light's axis), and for the primary light the
/// albedo that it sees.
pub(crate) struct Shadow {
    program: Program,
    block: Uniform<ShadowBlock>,
    pub cube: CubeTarget,
    /// World space to light space.
    pub light_from_world: Mat4,
    /// Farthest distance that the map holds, m.
    pub far: f32,
}

impl Shadow {
    pub fn new(context: &Rc<Context>, size: u32, with_albedo: bool) -> Result<Self> {
        let source = if with_albedo { &shaders::SHADOW_ALBEDO } else { &shaders::SHADOW };
        Ok(Self {
            program: Program::new(context, source)?,
            block: Uniform::new(context)?,
            cube: CubeTarget::new(context, with_albedo.then_some(Format::Rgba16F), size)?,
            light_from_world: Mat4::IDENTITY,
            far: 1.0,
        })
    }

    /// Draws the scene from `origin`. Behind the light (face −z) only if `whole_sphere`: no other light shines there.
    pub fn run(&mut self, scene: &GpuScene, origin: Vec3, world_from_light: Mat3, far: f32, whole_sphere: bool) {
        self.far = far;
        self.light_from_world = Mat4::from_mat3(world_from_light.transpose()) * Mat4::from_translation(-origin);
        for face in 0..6 {
            self.cube.clear_face(face);
            if face == 5 && !whole_sphere {
                continue;
            }
            let mut block = face_block(face as usize, origin, world_from_light, far);
            if !whole_sphere {
                block.axis_ws = world_from_light.z_axis.extend(0.0);
            }
            self.program.bind();
            self.block.set(&block);
            let viewport = Viewport { x: 0, y: 0, width: self.cube.size, height: self.cube.size };
            scene.draw(&DrawView { clip_from_world: block.clip_from_world, viewport, cull_back: false, textures: 1 });
        }
        if let Some(albedo) = &self.cube.color {
            albedo.generate_mipmap();
        }
    }

    /// Angle that a texel spans in the middle of a face, radians.
    pub fn texel_angle(&self) -> f32 {
        2.0 / self.cube.size as f32
    }
}

/// Pass and result: the distances along parallel rays through the sphere around the scene.
pub(crate) struct PlaneShadow {
    program: Program,
    block: Uniform<ShadowBlock>,
    pub target: Target,
    /// World space to texture coordinates and depth 0…1.
    pub texture_from_world: Mat4,
    /// Edge of a texel, m.
    pub texel: f32,
}

impl PlaneShadow {
    pub fn new(context: &Rc<Context>, size: u32) -> Result<Self> {
        Ok(Self {
            program: Program::new(context, &shaders::SHADOW)?,
            block: Uniform::new(context)?,
            target: Target::new(context, &[], true, size, size)?,
            texture_from_world: Mat4::IDENTITY,
            texel: 1.0,
        })
    }

    /// Draws the scene along `axis`; `center` and `radius` (m) of the sphere around it.
    pub fn run(&mut self, scene: &GpuScene, axis: Vec3, center: Vec3, radius: f32) {
        let radius = radius * 1.01;
        let (x, _) = axis.any_orthonormal_pair();
        let origin = center - axis * radius;
        let clip_from_world = opengl::orthographic(-radius, radius, -radius, radius, 0.0, 2.0 * radius)
            * view::look_to_mat4(origin, axis, x);
        let half = Mat4::from_translation(Vec3::splat(0.5)) * Mat4::from_scale(Vec3::splat(0.5));
        self.texture_from_world = half * clip_from_world;
        self.texel = 2.0 * radius / self.target.width as f32;
        self.target.clear();
        self.program.bind();
        self.block.set(&ShadowBlock {
            clip_from_world,
            origin_ws: origin.extend(0.5 / radius),
            axis_ws: axis.extend(1.0),
        });
        let viewport = Viewport { x: 0, y: 0, width: self.target.width, height: self.target.height };
        scene.draw(&DrawView { clip_from_world, viewport, cull_back: false, textures: 1 });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faces_agree_with_opengls_table() {
        // OpenGL 3.3 core, table 3.19: (sc, tc, ma) of each face.
        let d = Vec3::new(0.3, -0.2, 0.1);
        let table = [
            (Vec3::X, [-d.z, -d.y]),
            (Vec3::NEG_X, [d.z, -d.y]),
            (Vec3::Y, [d.x, d.z]),
            (Vec3::NEG_Y, [d.x, -d.z]),
            (Vec3::Z, [d.x, -d.y]),
            (Vec3::NEG_Z, [-d.x, -d.y]),
        ];
        for (face, (axis, expected)) in table.into_iter().enumerate() {
            // The component along the axis becomes 1; the others stay.
            let point = axis + d - axis * axis.dot(d);
            let block = face_block(face, Vec3::splat(7.0), Mat3::IDENTITY, 10.0);
            let ndc = block.clip_from_world.project_point3(point + Vec3::splat(7.0));
            assert!((ndc.x - expected[0]).abs() < 1e-5 && (ndc.y - expected[1]).abs() < 1e-5, "{face}: {ndc}");
        }
    }
}
