//! Ambient occlusion and its directional form, from horizons in the G-buffer (Bavoil & Sainz 2008).

use std::rc::Rc;

use glam::{Vec2, Vec4};

use crate::gl::{Context, Format, Program, State, Target, Texture, Uniform, uniform_block};
use crate::passes::{FrameBlock, GBuffer};
use crate::{Result, shaders};

uniform_block! {
    /// `ao.frag`.
    AoBlock as "PassBlock" {
        ao: Vec4,
    }
}

/// Largest radius as a share of the picture's longer edge: samples further apart would miss what is between them.
const LARGEST_RADIUS: f32 = 0.5;

/// Pass and result.
pub(crate) struct Ao {
    context: Rc<Context>,
    program: Program,
    block: Uniform<AoBlock>,
    target: Target,
}

impl Ao {
    pub fn new(context: &Rc<Context>, width: u32, height: u32) -> Result<Self> {
        Ok(Self {
            context: context.clone(),
            program: Program::new(context, &shaders::AO)?,
            block: Uniform::new(context)?,
            target: Target::new(context, &[Format::Rgba32Ui, Format::R16F], false, width, height)?,
        })
    }

    /// Finds the horizons within `radius`, m.
    pub fn run(&self, gbuffer: &GBuffer, frame: &FrameBlock, radius: f32) {
        let size = Vec2::new(self.target.width as f32, self.target.height as f32);
        // Half the picture's height in pixels, over what it covers in m at a distance of 1 m.
        let pixels = 0.5 * size.y / frame.unprojection.y;
        gbuffer.surface().bind(0, None);
        self.target.bind();
        self.block.set(&AoBlock { ao: Vec4::new(radius, pixels, LARGEST_RADIUS * size.max_element(), 0.0) });
        State::full_screen(self.target.width, self.target.height).apply(&self.context);
        self.program.draw_full_screen();
    }

    /// The horizons of every pixel, packed.
    pub fn horizons(&self) -> &Texture {
        self.target.color(0)
    }

    /// Ambient visibility, 0…1.
    pub fn ambient(&self) -> &Texture {
        self.target.color(1)
    }
}
