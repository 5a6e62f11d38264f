//! Intermediates to look at.

use std::ops::Range;
use std::rc::Rc;

use glam::{UVec4, Vec3, Vec4};

use crate::gl::{Context, Filter, Format, Program, SamplerObject, State, Target, Uniform, uniform_block};
use crate::lattice::Vpl;
use crate::passes::{Ism, Shadow, VplTexture};
use crate::scene::Bounds;
use crate::{Result, shaders};

uniform_block! {
    /// `debug_*.frag`.
    DebugBlock as "PassBlock" {
        picture: Vec4,
        tiles: UVec4,
        range: UVec4,
        low: Vec4,
        scale: Vec4,
    }
}

/// Passes and result: 8-bit sRGB.
pub(crate) struct Debug {
    context: Rc<Context>,
    shadow: Program,
    ism: Program,
    vpl: Program,
    block: Uniform<DebugBlock>,
    nearest: SamplerObject,
    target: Target,
}

impl Debug {
    pub fn new(context: &Rc<Context>) -> Result<Self> {
        Ok(Self {
            context: context.clone(),
            shadow: Program::new(context, &shaders::DEBUG_SHADOW)?,
            ism: Program::new(context, &shaders::DEBUG_ISM)?,
            vpl: Program::new(context, &shaders::DEBUG_VPL)?,
            block: Uniform::new(context)?,
            nearest: SamplerObject::new(context, Filter::Nearest)?,
            target: Target::new(context, &[Format::Rgba8], false, 1, 1)?,
        })
    }

    /// The faces of a light's shadow map.
    pub fn shadow_map(&mut self, map: &Shadow, space: [u32; 2]) -> Result<()> {
        self.fit(3.0 / 2.0, space)?;
        map.cube.depth.bind(0, &self.nearest);
        self.draw(&self.shadow, UVec4::ZERO, UVec4::ZERO, Vec4::ZERO, Vec4::ZERO);
        Ok(())
    }

    /// Maps of the VPLs, or of one alone; those of a range have some.
    pub fn isms(&mut self, ism: &Ism, tile: Option<u32>, mapped: Range<u32>, space: [u32; 2]) -> Result<()> {
        let layout = ism.layout();
        let (first, columns, rows) = match tile {
            Some(index) => (index, 1, 1),
            None => (0, layout.columns, mapped.end.div_ceil(layout.columns)),
        };
        self.fit(columns as f32 / rows as f32, space)?;
        ism.result().bind(0, None);
        let tiles = UVec4::new(layout.tile, layout.columns, columns, rows);
        self.draw(&self.ism, tiles, UVec4::new(first, mapped.start, mapped.end, 0), Vec4::ZERO, Vec4::ZERO);
        Ok(())
    }

    /// Texels of the VPLs, of which there is at least one; `bounds` are the scene's.
    pub fn vpls(&mut self, texture: &VplTexture, vpls: &[Vpl], bounds: &Bounds, space: [u32; 2]) -> Result<()> {
        // Nearly square.
        let columns = (0.5 * f64::from(texture.count).sqrt()).ceil() as u32;
        let rows = texture.count.div_ceil(columns);
        self.fit(4.0 * columns as f32 / rows as f32, space)?;
        let greatest = vpls.iter().map(|vpl| vpl.intensity.max_element()).fold(f32::MIN_POSITIVE, f32::max);
        let size = (bounds.max - bounds.min).max(Vec3::splat(f32::MIN_POSITIVE));
        texture.texture.bind(0, None);
        self.draw(
            &self.vpl,
            UVec4::new(0, 0, columns, rows),
            UVec4::new(0, 0, texture.count, 0),
            bounds.min.extend(greatest),
            size.recip().extend(1.0 / bounds.radius().max(f32::MIN_POSITIVE)),
        );
        Ok(())
    }

    /// The largest picture of that width over height within a space of so many pixels.
    fn fit(&mut self, aspect: f32, space: [u32; 2]) -> Result<()> {
        let [width, height] = space.map(|pixels| pixels.max(1));
        let (wide, high) = ((height as f32 * aspect).round() as u32, (width as f32 / aspect).round() as u32);
        let size = if wide <= width { [wide.max(1), height] } else { [width, high.clamp(1, height)] };
        if size != [self.target.width, self.target.height] {
            self.target.resize(size[0], size[1])?;
        }
        Ok(())
    }

    fn draw(&self, program: &Program, tiles: UVec4, range: UVec4, low: Vec4, scale: Vec4) {
        let Target { width, height, .. } = self.target;
        self.target.bind();
        let picture = Vec4::new(width as f32, height as f32, 0.0, 0.0);
        self.block.set(&DebugBlock { picture, tiles, range, low, scale });
        State::full_screen(width, height).apply(&self.context);
        program.draw_full_screen();
    }

    /// What a display shows.
    pub fn result(&self) -> &Target {
        &self.target
    }
}
