//! The G-buffer: what the light passes need of the surface at each pixel.
//!
//! | texture | format | holds |
//! | --- | --- | --- |
//! | surface | RGBA32UI | depth in metres as float bits; shading and geometric normal, octahedral, 2 × 16 bits each; roughness, metalness, specular factor, occlusion, 8 bits each |
//! | albedo | RGBA16F | linear base colour |
//! | emission | RGBA32F | radiance, W/(m² sr); number of the instance |
//!
//! Three colour targets, because ES 3.0 promises only four. Depth is linear and full float, so that the position
//! that comes back is good to 1e-7 of the depth wherever the near plane is; 16 bits an axis keep normals to 0.003°
//! (16-bit floats: 0.03°, which shows at grazing light); an integer format takes all of that in one fetch and is
//! rendered to without extensions. Albedo in half floats is good to 0.05 %, where eight bits would be off by 0.5 %. Emission has no upper limit, so that
//! half floats will not do.

use std::rc::Rc;

use crate::Result;
use crate::gl::{Context, Format, Program, Target, Texture, Uniform, Viewport};
use crate::passes::FrameBlock;
use crate::passes::geometry::{DrawView, GpuScene};
use crate::shaders;

/// Pass and result.
pub(crate) struct GBuffer {
    program: Program,
    frame: Uniform<FrameBlock>,
    target: Target,
}

impl GBuffer {
    pub fn new(context: &Rc<Context>, width: u32, height: u32) -> Result<Self> {
        let formats = [Format::Rgba32Ui, Format::Rgba16F, Format::Rgba32F];
        Ok(Self {
            program: Program::new(context, &shaders::GBUFFER)?,
            frame: Uniform::new(context)?,
            target: Target::new(context, &formats, true, width, height)?,
        })
    }

    /// Draws the scene. The camera's block stays bound for the passes that follow.
    pub fn run(&self, scene: &GpuScene, frame: &FrameBlock) {
        self.target.clear();
        self.program.bind();
        self.frame.set(frame);
        scene.draw(&DrawView {
            clip_from_world: frame.clip_from_view * frame.view_from_world,
            viewport: Viewport { x: 0, y: 0, width: self.target.width, height: self.target.height },
            cull_back: true,
            textures: 5,
        });
    }

    /// Geometry and material, packed.
    pub fn surface(&self) -> &Texture {
        self.target.color(0)
    }

    /// Linear base colour.
    pub fn albedo(&self) -> &Texture {
        self.target.color(1)
    }

    /// Emitted radiance.
    pub fn emission(&self) -> &Texture {
        self.target.color(2)
    }

    /// Linear base colour of every pixel, first row at the bottom; waits for the GPU.
    #[cfg(test)]
    pub fn read_albedo(&self) -> Vec<[f32; 4]> {
        self.target.read(1)
    }

    /// Emitted radiance of every pixel, first row at the bottom; waits for the GPU.
    #[cfg(test)]
    pub fn read_emission(&self) -> Vec<[f32; 4]> {
        self.target.read(2)
    }

    /// The packed surface of every pixel, first row at the bottom; waits for the GPU.
    #[cfg(test)]
    pub fn read_surface(&self) -> Vec<[u32; 4]> {
        self.target.read(0)
    }
}
