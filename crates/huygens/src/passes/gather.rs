//! The exact gather: every VPL at every pixel.

use std::rc::Rc;

use glam::{UVec4, Vec4};

use crate::gl::{Context, Program, State, Texture, Uniform, uniform_block};
use crate::passes::{Accumulator, Ao, GBuffer, Ism, ShadowMaps, VplTexture};
use crate::settings::{Settings, Visibility};
use crate::{Result, shaders};

uniform_block! {
    /// `common/gather.glsl`.
    GatherBlock as "PassBlock" {
        range: UVec4,
        map: Vec4,
    }
}

/// VPL·pixels of one draw: a few seconds on two cores, far below what makes a driver give a GPU up.
const TERMS_PER_DRAW: u64 = 1 << 27;

/// What decides whether a surface sees a VPL.
#[derive(Clone, Copy)]
pub(crate) enum VplVisibility<'a> {
    None,
    Ism(&'a Ism, f32),
    ShadowMaps(&'a ShadowMaps, f32),
    Dao(&'a Ao),
}

/// Pass and result.
pub(crate) struct Gather {
    context: Rc<Context>,
    program: Program,
    /// For VPLs with shadow maps where others have none.
    mapped: Option<Program>,
    block: Uniform<GatherBlock>,
    /// Whether it sums the glossy lobe too.
    specular: bool,
    sum: Accumulator,
}

impl Gather {
    pub fn new(context: &Rc<Context>, settings: &Settings, width: u32, height: u32) -> Result<Self> {
        let source = match settings.visibility {
            Visibility::None | Visibility::Ao => &shaders::GATHER_NONE,
            Visibility::Dao => &shaders::GATHER_DAO,
            Visibility::Ism | Visibility::Mixed => &shaders::GATHER_ISM,
            Visibility::ShadowMaps => &shaders::GATHER_SHADOW_MAP,
        };
        let mut sum = Accumulator::new(context, 2, width, height)?;
        // Layers without indirect light read it all the same.
        sum.clear();
        Ok(Self {
            context: context.clone(),
            program: Program::new(context, source)?,
            mapped: if settings.visibility == Visibility::Mixed {
                Some(Program::new(context, &shaders::GATHER_SHADOW_MAP)?)
            } else {
                None
            },
            block: Uniform::new(context)?,
            specular: settings.sums_specular(),
            sum,
        })
    }

    /// Begins a frame: no light yet.
    pub fn clear(&mut self) {
        self.sum.clear();
    }

    /// Adds the VPLs of a range. The distance with each visibility is the farthest that its maps hold. `done` hears
    /// after every draw how many VPLs it took.
    pub fn add(
        &mut self,
        gbuffer: &GBuffer,
        vpls: &VplTexture,
        range: std::ops::Range<u32>,
        visibility: VplVisibility,
        done: &mut dyn FnMut(u32),
    ) {
        let map = match visibility {
            VplVisibility::None | VplVisibility::Dao(_) => Vec4::ZERO,
            VplVisibility::Ism(ism, far) => {
                let layout = ism.layout();
                Vec4::new(layout.tile as f32, layout.columns as f32, far, layout.half_diagonal)
            }
            VplVisibility::ShadowMaps(maps, far) => maps.layout(far),
        };
        let pixels = u64::from(self.sum.result().width) * u64::from(self.sum.result().height);
        let per_draw = (TERMS_PER_DRAW / pixels).clamp(1, 1 << 20) as u32;
        for first in range.clone().step_by(per_draw as usize) {
            let count = per_draw.min(range.end - first);
            let (before, target) = self.sum.next();
            let textures = [gbuffer.surface(), gbuffer.albedo(), before.color(0), before.color(1), &vpls.texture];
            for (unit, texture) in textures.into_iter().enumerate() {
                texture.bind(unit as u32, None);
            }
            match visibility {
                VplVisibility::None => {}
                VplVisibility::Dao(ao) => ao.horizons().bind(5, None),
                VplVisibility::Ism(ism, _) => ism.result().bind(5, None),
                VplVisibility::ShadowMaps(maps, _) => maps.result().bind(5, None),
            }
            target.bind();
            self.block
                .set(&GatherBlock { range: UVec4::new(first, count, range.start, u32::from(self.specular)), map });
            State::full_screen(target.width, target.height).apply(&self.context);
            match (visibility, &self.mapped) {
                (VplVisibility::ShadowMaps(..), Some(mapped)) => mapped.draw_full_screen(),
                _ => self.program.draw_full_screen(),
            }
            done(count);
        }
    }

    /// Irradiance from all VPLs that were added.
    pub fn irradiance(&self) -> &Texture {
        self.sum.result().color(0)
    }

    /// Radiance that glossy surfaces reflect of them, if that was asked for.
    pub fn specular(&self) -> Option<&Texture> {
        self.specular.then(|| self.sum.result().color(1))
    }

    /// Irradiance of every pixel, first row at the bottom; waits for the GPU.
    #[cfg(test)]
    pub fn read_irradiance(&self) -> Vec<[f32; 4]> {
        self.sum.result().read(0)
    }
}
