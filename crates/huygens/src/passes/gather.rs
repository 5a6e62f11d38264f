//! The exact gather: every VPL at every pixel.

use std::rc::Rc;

use glam::{IVec4, UVec4, Vec4};

use crate::gl::{Context, Program, State, Target, Texture, Uniform, Viewport, uniform_block};
use crate::passes::{Accumulator, Ao, GBuffer, Ism, Reconstruct, ShadowMaps, VplTexture};
use crate::settings::{GatherMethod, Settings, Visibility};
use crate::{Result, shaders};

uniform_block! {
    /// `common/gather.glsl`.
    GatherBlock as "PassBlock" {
        range: UVec4,
        map: Vec4,
        layer: IVec4,
        first_pixel: IVec4,
    }
}

/// Which pixels sum what (Segovia et al. 2006): of every n × n pixels that take part, each sums another subset of the
/// VPLs, which lie in spatial order: every (n²)th. Pixels with the same subset lie together in a layer, so that neighbours do the same work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Interleave {
    pub n: u32,
    /// Pixels from one that takes part to the next.
    pub step: u32,
    /// Size of a layer.
    pub layer: [u32; 2],
    /// Pixels that take part.
    pub cells: [u32; 2],
}

impl Interleave {
    pub fn new(settings: &Settings, width: u32, height: u32) -> Self {
        let (n, step) = match settings.gather.method {
            GatherMethod::Exact => (1, 1),
            GatherMethod::Interleaved => (settings.gather.interleave, if settings.gather.half { 2 } else { 1 }),
        };
        let cells = [width, height].map(|pixels| pixels.div_ceil(step));
        Self { n, step, layer: cells.map(|cells| cells.div_ceil(n)), cells }
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
    interleave: Interleave,
    /// Number of the frame: subsets go round.
    turn: u32,
    sum: Accumulator,
    reconstruct: Option<Reconstruct>,
}

impl Gather {
    pub fn new(context: &Rc<Context>, settings: &Settings, width: u32, height: u32) -> Result<Self> {
        let source = match settings.visibility {
            Visibility::None | Visibility::Ao => &shaders::GATHER_NONE,
            Visibility::Dao => &shaders::GATHER_DAO,
            Visibility::Ism | Visibility::Mixed => &shaders::GATHER_ISM,
            Visibility::ShadowMaps => &shaders::GATHER_SHADOW_MAP,
        };
        let interleave = Interleave::new(settings, width, height);
        let Interleave { n, layer, cells, .. } = interleave;
        let mut sum = Accumulator::new(context, 2, layer[0] * n, layer[1] * n)?;
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
            interleave,
            turn: 0,
            sum,
            reconstruct: if n > 1 { Some(Reconstruct::new(context, cells, width, height)?) } else { None },
        })
    }

    /// Begins frame number `frame`: no light yet.
    pub fn clear(&mut self, frame: u32) {
        self.turn = frame;
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
        let Interleave { n, step, layer, .. } = self.interleave;
        let pixels = u64::from(self.sum.result().width) * u64::from(self.sum.result().height);
        let per_draw = ((TERMS_PER_DRAW / pixels) * u64::from(n * n)).clamp(1, 1 << 20) as u32;
        for first in range.clone().step_by(per_draw as usize) {
            let drawn = first..range.end.min(first + per_draw);
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
            for k in 0..n * n {
                let (x, y) = (k % n, k / n);
                let subset = k.wrapping_add(self.turn) % (n * n);
                let viewport = Viewport { x: x * layer[0], y: y * layer[1], width: layer[0], height: layer[1] };
                let at = |x: u32, y: u32| IVec4::new(x as i32, y as i32, (n * step) as i32, (n * n) as i32);
                self.block.set(&GatherBlock {
                    range: UVec4::new(drawn.start + subset, drawn.end, range.start, u32::from(self.specular)),
                    map,
                    layer: at(viewport.x, viewport.y),
                    first_pixel: at(x * step + step / 2, y * step + step / 2),
                });
                State { viewport, ..State::full_screen(0, 0) }.apply(&self.context);
                match (visibility, &self.mapped) {
                    (VplVisibility::ShadowMaps(..), Some(mapped)) => mapped.draw_full_screen(),
                    _ => self.program.draw_full_screen(),
                }
            }
            done(drawn.end - drawn.start);
        }
    }

    /// Shares the sums between neighbours, if each has its own subset.
    pub fn reconstruct(&self, gbuffer: &GBuffer) {
        if let Some(pass) = &self.reconstruct {
            pass.run(gbuffer, self.sum.result(), &self.interleave);
        }
    }

    fn result(&self) -> &Target {
        self.reconstruct.as_ref().map_or(self.sum.result(), Reconstruct::result)
    }

    /// Irradiance from all VPLs that were added.
    pub fn irradiance(&self) -> &Texture {
        self.result().color(0)
    }

    /// Radiance that glossy surfaces reflect of them, if that was asked for.
    pub fn specular(&self) -> Option<&Texture> {
        self.specular.then(|| self.result().color(1))
    }

    /// Irradiance of every pixel, first row at the bottom; waits for the GPU.
    #[cfg(test)]
    pub fn read_irradiance(&self) -> Vec<[f32; 4]> {
        self.result().read(0)
    }
}
