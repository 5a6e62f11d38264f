//! What the lattice has to know of the light's shadow map: its farthest depth, and depth and albedo along each ray.

use std::rc::Rc;

use glam::{Vec3, Vec4};

use crate::gl::{Context, Filter, Format, Program, SamplerObject, State, Target, Texture, Uniform, uniform_block};
use crate::lattice::{Lattice, LightProbe};
use crate::passes::Shadow;
use crate::{Result, shaders};

uniform_block! {
    /// `lattice_probe.frag`, `depth_extent.frag`.
    ProbeBlock as "PassBlock" {
        extent: Vec4,
    }
}

/// Blocks along the edge of a face whose maxima are read back.
const SPLIT: u32 = 32;

/// Rays in a row of the ray texture.
const ROW: u32 = 1024;

/// The pass.
pub(crate) struct LatticeProbe {
    context: Rc<Context>,
    probe: Program,
    extent: Program,
    block: Uniform<ProbeBlock>,
    nearest: SamplerObject,
    trilinear: SamplerObject,
    farthest: Target,
}

impl LatticeProbe {
    pub fn new(context: &Rc<Context>) -> Result<Self> {
        Ok(Self {
            context: context.clone(),
            probe: Program::new(context, &shaders::LATTICE_PROBE)?,
            extent: Program::new(context, &shaders::DEPTH_EXTENT)?,
            block: Uniform::new(context)?,
            nearest: SamplerObject::new(context, Filter::Nearest)?,
            trilinear: SamplerObject::new(context, Filter::Trilinear)?,
            farthest: Target::new(context, &[Format::Rgba32F], false, SPLIT, 6 * SPLIT)?,
        })
    }

    /// Reads the primary light's shadow map; waits for the GPU.
    pub fn run(&self, map: &Shadow, lattice: &Lattice) -> Result<LightProbe> {
        let extent = Vec4::new(map.far, map.cube.size as f32, SPLIT as f32, 0.0);
        self.block.set(&ProbeBlock { extent });
        map.cube.depth.bind(0, &self.nearest);
        self.farthest.bind();
        State::full_screen(SPLIT, 6 * SPLIT).apply(&self.context);
        self.extent.draw_full_screen();
        let farthest = self.farthest.read::<[f32; 4]>(0).iter().fold(0.0, |far, texel| texel[0].max(far));

        let rows = (lattice.rays.len() as u32).div_ceil(ROW);
        let mut texels = vec![[0.0; 4]; (ROW * rows) as usize];
        for (texel, ray) in texels.iter_mut().zip(&lattice.rays) {
            // The mip level whose texel spans as much as the ray's cell.
            let texel_angle = map.texel_angle();
            let level = (ray.solid_angle.max(0.0).sqrt() / texel_angle).max(1.0).log2();
            *texel = ray.direction_ls.extend(level).to_array();
        }
        let rays =
            Texture::with_pixels(&self.context, Format::Rgba32F, ROW, rows, Some(bytemuck::cast_slice(&texels)))?;
        let target = Target::new(&self.context, &[Format::Rgba32F], false, ROW, rows)?;
        rays.bind(0, None);
        map.cube.depth.bind(1, &self.nearest);
        if let Some(albedo) = &map.cube.color {
            albedo.bind(2, &self.trilinear);
        }
        target.bind();
        State::full_screen(ROW, rows).apply(&self.context);
        self.probe.draw_full_screen();
        let read = target.read::<[f32; 4]>(0);
        Ok(LightProbe {
            scene_depth: (farthest > 0.0).then_some(farthest),
            rays: read
                .iter()
                .take(lattice.rays.len())
                .map(|&[r, g, b, depth]| ((depth > 0.0).then_some(depth), Vec3::new(r, g, b)))
                .collect(),
        })
    }
}
