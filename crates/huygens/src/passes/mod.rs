//! The passes of a frame, in the order in which they run. A pass is a struct with `new` and `run` (or `add`, where it
//! adds to a sum); it takes what it reads as arguments and keeps what it makes.

mod accumulate;
mod ao;
mod composite;
mod debug;
mod direct;
mod gather;
mod gbuffer;
mod geometry;
mod ism;
mod lattice_probe;
pub(crate) mod near;
mod reconstruct;
mod shadow;
mod shadow_maps;
mod vpl;

use std::rc::Rc;

use glam::{Mat4, Vec2, Vec4};

use crate::gl::{Context, Format, Target, uniform_block};
use crate::{Camera, Result};

#[cfg(test)]
pub(crate) use accumulate::BeforeBlock;
pub(crate) use accumulate::{Accumulate, Change, motion};
pub(crate) use ao::Ao;
#[cfg(test)]
pub(crate) use ao::AoBlock;
pub(crate) use composite::{Composite, LightLayers, Tonemap};
#[cfg(test)]
pub(crate) use composite::{CompositeBlock, TonemapBlock};
pub(crate) use debug::Debug;
#[cfg(test)]
pub(crate) use debug::DebugBlock;
pub(crate) use direct::Direct;
#[cfg(test)]
pub(crate) use direct::DirectBlock;
#[cfg(test)]
pub(crate) use gather::GatherBlock;
pub(crate) use gather::{Gather, VplVisibility};
pub(crate) use gbuffer::GBuffer;
pub(crate) use geometry::GpuScene;
#[cfg(test)]
pub(crate) use geometry::{MaterialBlock, ObjectBlock};
pub(crate) use ism::Ism;
#[cfg(test)]
pub(crate) use ism::IsmBlock;
pub(crate) use lattice_probe::LatticeProbe;
#[cfg(test)]
pub(crate) use lattice_probe::ProbeBlock;
pub(crate) use reconstruct::Reconstruct;
#[cfg(test)]
pub(crate) use reconstruct::ReconstructBlock;
#[cfg(test)]
pub(crate) use shadow::ShadowBlock;
pub(crate) use shadow::{PlaneShadow, Shadow};
pub(crate) use shadow_maps::ShadowMaps;
pub(crate) use vpl::VplTexture;

uniform_block! {
    /// The camera; `common/frame.glsl`.
    FrameBlock as "FrameBlock" {
        view_from_world: Mat4,
        clip_from_view: Mat4,
        world_from_view: Mat4,
        eye_ws: Vec4,
        forward_ws: Vec4,
        unprojection: Vec4,
        jitter: Vec4,
        size: Vec4,
    }
}

impl FrameBlock {
    /// A camera for a picture of that size. `reach` is the distance from the eye to the farthest point of the scene, m;
    /// `jitter` moves the sample within the pixel, in pixels.
    pub fn new(camera: &Camera, width: u32, height: u32, reach: f32, jitter: Vec2) -> Self {
        let size = Vec2::new(width as f32, height as f32);
        let aspect = size.x / size.y;
        let far = reach.max(1e-20) * 1.01;
        let near = camera.near(reach);
        let view_from_world = camera.view_from_world();
        let (scale, a, b) = camera.unprojection(aspect);
        Self {
            view_from_world,
            clip_from_view: camera.clip_from_view(aspect, near, far),
            world_from_view: view_from_world.inverse(),
            eye_ws: camera.eye.extend(b),
            forward_ws: camera.forward.extend(0.0),
            unprojection: Vec4::new(scale.x, scale.y, a, b),
            jitter: (jitter * 2.0 / size).extend(1.0 / far).extend(0.0),
            size: Vec4::new(size.x, size.y, 1.0 / size.x, 1.0 / size.y),
        }
    }
}

/// A sum in two targets, of which one is read while the other is written: float blending is not everywhere.
pub(crate) struct Accumulator {
    targets: [Target; 2],
    current: usize,
}

impl Accumulator {
    /// Sums side by side in those formats; with `depth`, draws may be limited to some of the pixels.
    pub fn new(context: &Rc<Context>, formats: &[Format], depth: bool, width: u32, height: u32) -> Result<Self> {
        let target = || Target::new(context, formats, depth, width, height);
        Ok(Self { targets: [target()?, target()?], current: 0 })
    }

    /// Makes the sum zero.
    pub fn clear(&mut self) {
        self.targets[self.current].clear();
    }

    /// What there is, and where the next sum goes; from now on that is the result.
    pub fn next(&mut self) -> (&Target, &Target) {
        self.current = 1 - self.current;
        self.last()
    }

    /// What [`Self::next`] gave last.
    pub fn last(&self) -> (&Target, &Target) {
        (&self.targets[1 - self.current], &self.targets[self.current])
    }

    /// The sum so far.
    pub fn result(&self) -> &Target {
        &self.targets[self.current]
    }
}
