//! Shares the sums of the interleaved gather between neighbours.

use std::rc::Rc;

use glam::{IVec4, Vec4};

use crate::gl::{Context, Format, Program, State, Target, Uniform, uniform_block};
use crate::passes::GBuffer;
use crate::passes::gather::Interleave;
use crate::{Result, shaders};

uniform_block! {
    /// `reconstruct.frag`.
    ReconstructBlock as "PassBlock" {
        grid: IVec4,
        along: IVec4,
        scale: Vec4,
    }
}

/// Pass and result.
pub(crate) struct Reconstruct {
    context: Rc<Context>,
    program: Program,
    block: Uniform<ReconstructBlock>,
    rows: Target,
    result: Target,
}

impl Reconstruct {
    /// `cells` are the pixels that have sums.
    pub fn new(context: &Rc<Context>, cells: [u32; 2], width: u32, height: u32) -> Result<Self> {
        let target = |[width, height]: [u32; 2]| Target::new(context, &[Format::Rgba32F; 2], false, width, height);
        Ok(Self {
            context: context.clone(),
            program: Program::new(context, &shaders::RECONSTRUCT)?,
            block: Uniform::new(context)?,
            rows: target(cells)?,
            result: target([width, height])?,
        })
    }

    /// `sums` of irradiance and glossy radiance.
    pub fn run(&self, gbuffer: &GBuffer, sums: &Target, interleave: &Interleave) {
        let [n, step] = [interleave.n, interleave.step].map(|n| n as i32);
        let [width, height] = interleave.layer.map(|n| n as i32);
        let square = (n * n) as f32;
        for (from, to, block) in [
            (sums, &self.rows, [IVec4::new(n, step, width, height), IVec4::new(1, 0, 0, 0)]),
            (&self.rows, &self.result, [IVec4::new(n, step, 0, 0), IVec4::new(0, 1, 1, 0)]),
        ] {
            for (unit, texture) in [gbuffer.surface(), from.color(0), from.color(1)].into_iter().enumerate() {
                texture.bind(unit as u32, None);
            }
            to.bind();
            let [grid, along] = block;
            let scale = Vec4::new(if along.z == 1 { square } else { 1.0 }, 0.0, 0.0, 0.0);
            self.block.set(&ReconstructBlock { grid, along, scale });
            State::full_screen(to.width, to.height).apply(&self.context);
            self.program.draw_full_screen();
        }
    }

    /// Irradiance from all VPLs, and radiance that glossy surfaces reflect of them.
    pub fn result(&self) -> &Target {
        &self.result
    }
}
