//! The layer that was asked for, averaged over frames, and what a display shows of it.

use std::rc::Rc;

use glam::{UVec4, Vec4};

use crate::frame::{Exposure, Layer};
use crate::gl::{Context, Format, Program, Readback, State, Target, Texture, Uniform, uniform_block};
use crate::passes::{Accumulator, GBuffer};
use crate::reference::tonemap::exposure_from_sums;
use crate::{Result, shaders};

uniform_block! {
    /// `composite.frag`.
    CompositeBlock as "PassBlock" {
        layer: UVec4,
        blend: Vec4,
    }
}

uniform_block! {
    /// `tonemap.frag`.
    TonemapBlock as "PassBlock" {
        kind: UVec4,
        scale: Vec4,
    }
}

/// What the composite adds up.
pub(crate) struct LightLayers<'a> {
    /// Radiance that the lights' own light has.
    pub direct: &'a Texture,
    /// Irradiance from the VPLs.
    pub irradiance: &'a Texture,
    /// Radiance that glossy surfaces reflect of the VPLs; without it the base colour stands for all they reflect.
    pub specular: Option<&'a Texture>,
    /// Ambient occlusion that dims the VPLs' light.
    pub ambient: Option<&'a Texture>,
}

/// Pass and result: linear values.
pub(crate) struct Composite {
    context: Rc<Context>,
    program: Program,
    block: Uniform<CompositeBlock>,
    average: Accumulator,
}

impl Composite {
    pub fn new(context: &Rc<Context>, width: u32, height: u32) -> Result<Self> {
        Ok(Self {
            context: context.clone(),
            program: Program::new(context, &shaders::COMPOSITE)?,
            block: Uniform::new(context)?,
            average: Accumulator::new(context, &[Format::Rgba32F], false, width, height)?,
        })
    }

    /// Takes frame number `frame` (from 0) into the average.
    pub fn run(&mut self, gbuffer: &GBuffer, light: &LightLayers, layer: Layer, frame: u32) {
        let (before, target) = self.average.next();
        let number = Layer::ALL.iter().position(|&l| l == layer).unwrap_or(0) as u32;
        let (surface, albedo, emission) = (gbuffer.surface(), gbuffer.albedo(), gbuffer.emission());
        // What the shader will not look at is some texture all the same.
        let [specular, ambient] = [light.specular, light.ambient].map(|texture| texture.unwrap_or(albedo));
        let before = before.color(0);
        let textures = [surface, albedo, emission, light.direct, light.irradiance, specular, before, ambient];
        for (unit, texture) in textures.iter().enumerate() {
            texture.bind(unit as u32, None);
        }
        target.bind();
        self.block.set(&CompositeBlock {
            layer: UVec4::new(number, u32::from(light.ambient.is_some()), u32::from(light.specular.is_some()), 0),
            blend: Vec4::new(1.0 / (frame as f32 + 1.0), 0.0, 0.0, 0.0),
        });
        State::full_screen(target.width, target.height).apply(&self.context);
        self.program.draw_full_screen();
    }

    /// The average.
    pub fn result(&self) -> &Target {
        self.average.result()
    }
}

/// Blocks of the picture, along each edge, whose luminance is summed apart; `luminance.frag` has the same number.
const BLOCKS: u32 = 64;

/// Pass and result: 8-bit sRGB.
pub(crate) struct Tonemap {
    context: Rc<Context>,
    luminance: Program,
    sums: Target,
    program: Program,
    block: Uniform<TonemapBlock>,
    target: Target,
    /// Sums that are on their way, with whether they are of the picture that is there, and the exposure of those that came
    /// last.
    coming: Option<(Readback, bool)>,
    late_ev: Option<f32>,
}

impl Tonemap {
    pub fn new(context: &Rc<Context>, width: u32, height: u32) -> Result<Self> {
        let target = Target::new(context, &[Format::Rgba8], false, width, height)?;
        target.color(0).smooth();
        Ok(Self {
            context: context.clone(),
            luminance: Program::new(context, &shaders::LUMINANCE)?,
            sums: Target::new(context, &[Format::Rgba32F], false, BLOCKS, BLOCKS)?,
            program: Program::new(context, &shaders::TONEMAP)?,
            block: Uniform::new(context)?,
            target,
            coming: None,
            late_ev: None,
        })
    }

    /// Another size of the picture; the texture that a display shows stays the same one.
    pub fn resize(&mut self, width: u32, height: u32) -> Result<()> {
        self.target.resize(width, height)
    }

    /// The exposure, EV (0 for layers that are not light). Automatic exposure waits for the GPU.
    pub fn exposure(&self, value: &Texture, layer: Layer, exposure: Exposure) -> f32 {
        match exposure {
            _ if !layer.is_radiance() => 0.0,
            Exposure::Ev(ev) => ev,
            Exposure::Auto => self.auto_exposure(value),
        }
    }

    /// Maps a layer's values to a display, with an exposure in EV. Depth is shown as a share of `far`, m.
    pub fn run(&self, value: &Texture, layer: Layer, ev: f32, far: f32) {
        let (kind, scale) = match layer {
            Layer::Final | Layer::Direct | Layer::Indirect => (0, ev.exp2()),
            Layer::Albedo | Layer::Ao => (1, 1.0),
            Layer::Normal => (2, 1.0),
            Layer::Depth => (3, 1.0 / far),
        };
        value.bind(0, None);
        self.target.bind();
        self.block.set(&TonemapBlock { kind: UVec4::new(kind, 0, 0, 0), scale: Vec4::new(scale, 0.0, 0.0, 0.0) });
        State::full_screen(self.target.width, self.target.height).apply(&self.context);
        self.program.draw_full_screen();
    }

    /// The automatic exposure of this picture or, so as not to wait, of one before; and whether it will be the same if
    /// the picture stays. `same` is whether the picture is that of the call before.
    pub fn late_exposure(&mut self, value: &Texture, same: bool) -> Result<(f32, bool)> {
        let Some(before) = self.late_ev else {
            let ev = self.auto_exposure(value);
            self.late_ev = Some(ev);
            return Ok((ev, true));
        };
        if let (Some((_, of_this)), false) = (&mut self.coming, same) {
            *of_this = false;
        }
        let came = self.coming.take_if(|(coming, _)| coming.is_ready());
        let came = came.map(|(coming, of_this)| (exposure_of(&coming.read()), of_this));
        if self.coming.is_none() {
            self.sum_luminance(value);
            self.coming = Some((Readback::start(&self.sums)?, true));
        }
        let ev = came.map_or(before, |(ev, _)| ev);
        self.late_ev = Some(ev);
        Ok((ev, came == Some((before, true))))
    }

    fn auto_exposure(&self, value: &Texture) -> f32 {
        self.sum_luminance(value);
        exposure_of(&self.sums.read(0))
    }

    fn sum_luminance(&self, value: &Texture) {
        value.bind(0, None);
        self.sums.bind();
        State::full_screen(BLOCKS, BLOCKS).apply(&self.context);
        self.luminance.draw_full_screen();
    }

    /// What a display shows.
    pub fn result(&self) -> &Target {
        &self.target
    }
}

/// Exposure, EV, from what `luminance.frag` sums: logarithms, pixels and luminance of each block.
fn exposure_of(sums: &[[f32; 4]]) -> f32 {
    let (mut logs, mut count, mut sum) = (0.0, 0.0, 0.0);
    for &[log, pixels, luminance, _] in sums {
        logs += f64::from(log);
        count += f64::from(pixels);
        sum += f64::from(luminance);
    }
    exposure_from_sums(logs, count, sum)
}
