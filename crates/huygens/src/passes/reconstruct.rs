//! Shares the means of the interleaved gather between neighbours.

use std::rc::Rc;

use glam::{IVec4, Vec4};

use crate::gl::{Context, Format, Program, State, Target, Uniform, uniform_block};
use crate::passes::GBuffer;
use crate::passes::accumulate::MEAN;
use crate::passes::gather::Interleave;
use crate::{Result, shaders};

uniform_block! {
    /// `common/reconstruct.glsl`.
    ReconstructBlock as "PassBlock" {
        grid: IVec4,
        along: IVec4,
        width: Vec4,
    }
}

/// Pixels that a workgroup filters (`common/reconstruct_group.glsl`), along the direction and across.
const LENGTH: u32 = 16;
const BREADTH: u32 = 8;

/// Pass and result.
pub(crate) struct Reconstruct {
    context: Rc<Context>,
    /// Whether the programs compute, or draw.
    computes: bool,
    /// Along rows, and along columns.
    programs: [Program; 2],
    block: Uniform<ReconstructBlock>,
    rows: Target,
    result: Target,
}

impl Reconstruct {
    /// `cells` are the pixels that have means.
    pub fn new(context: &Rc<Context>, computes: bool, cells: [u32; 2], width: u32, height: u32) -> Result<Self> {
        let sources = if computes {
            [&shaders::COMPUTE_RECONSTRUCT_ROWS, &shaders::COMPUTE_RECONSTRUCT_COLUMNS]
        } else {
            [&shaders::RECONSTRUCT_ROWS, &shaders::RECONSTRUCT_COLUMNS]
        };
        Ok(Self {
            context: context.clone(),
            computes,
            programs: [Program::new(context, sources[0])?, Program::new(context, sources[1])?],
            block: Uniform::new(context)?,
            rows: Target::new(context, &MEAN, false, cells[0], cells[1])?,
            result: Target::new(context, &[Format::Rgba32F; 2], false, width, height)?,
        })
    }

    /// `means` of irradiance and glossy radiance, and what `near` VPLs add to every pixel. The box holds `share` sums for
    /// each subset of the VPLs.
    pub fn run(&self, gbuffer: &GBuffer, means: &Target, near: &Target, interleave: &Interleave, share: f32) {
        let n = interleave.n as i32;
        let width = share * (n * n) as f32;
        let [x, y] = interleave.cells.map(|n| 1.0 / n as f32);
        let [rows, columns] = &self.programs;
        for (program, from, to, along) in [
            (rows, means, &self.rows, IVec4::new(1, 0, 0, 0)),
            (columns, &self.rows, &self.result, IVec4::new(0, 1, 1, 0)),
        ] {
            let textures = [gbuffer.surface(), from.color(0), from.color(1), near.color(0)];
            for (unit, texture) in textures.into_iter().enumerate() {
                texture.bind(unit as u32, None);
            }
            self.block.set(&ReconstructBlock {
                grid: IVec4::new(n, interleave.step.ilog2() as i32, 0, 0),
                along,
                width: Vec4::new(width, x, y, 0.0),
            });
            if self.computes {
                to.color(0).bind_image(0);
                to.color(1).bind_image(1);
                let [x, y] = if along.x == 1 { [LENGTH, BREADTH] } else { [BREADTH, LENGTH] };
                program.dispatch([to.width.div_ceil(x), to.height.div_ceil(y), 1]);
            } else {
                to.bind();
                State::full_screen(to.width, to.height).apply(&self.context);
                program.draw_full_screen();
            }
        }
    }

    /// Irradiance from all VPLs, and radiance that glossy surfaces reflect of them.
    pub fn result(&self) -> &Target {
        &self.result
    }
}
