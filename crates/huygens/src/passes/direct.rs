//! Direct light: one full-screen draw for each light, added up.

use std::rc::Rc;

use glam::{IVec4, Mat4, UVec4, Vec4};

use crate::gl::{Context, Filter, Format, Program, SamplerObject, State, Uniform, uniform_block};
use crate::passes::gather::{GLOSSY, GatherBlock};
use crate::passes::{Accumulator, GBuffer, PlaneShadow, Shadow, ShadowMaps, VplTexture};
use crate::{Light, Profile, Result, shaders};

uniform_block! {
    /// A light; `common/light.glsl`.
    DirectBlock as "PassBlock" {
        light_from_world: Mat4,
        light_position: Vec4,
        light_axis: Vec4,
        light_intensity: Vec4,
        shadow: Vec4,
    }
}

/// Pass and result.
pub(crate) struct Direct {
    context: Rc<Context>,
    cube: Program,
    plane: Program,
    emission: Program,
    vpl_block: Uniform<GatherBlock>,
    block: Uniform<DirectBlock>,
    compare: SamplerObject,
    sum: Accumulator,
}

impl Direct {
    pub fn new(context: &Rc<Context>, width: u32, height: u32) -> Result<Self> {
        Ok(Self {
            context: context.clone(),
            cube: Program::new(context, &shaders::DIRECT_CUBE)?,
            plane: Program::new(context, &shaders::DIRECT_PLANE)?,
            emission: Program::new(context, &shaders::DIRECT_EMISSION)?,
            vpl_block: Uniform::new(context)?,
            block: Uniform::new(context)?,
            compare: SamplerObject::new(context, Filter::Compare)?,
            sum: Accumulator::new(context, &[Format::Rgba32F], false, width, height)?,
        })
    }

    /// Begins a frame: no light yet.
    pub fn clear(&mut self) {
        self.sum.clear();
    }

    /// Adds a light with a cube shadow map; `filter` is half the width of the PCF, texels.
    pub fn add(&mut self, gbuffer: &GBuffer, light: &Light, map: &Shadow, filter: f32) {
        let shadow = Vec4::new(1.0 / map.far, map.texel_angle(), filter, 0.0);
        let block = block(light, map.light_from_world, shadow);
        map.cube.depth.bind(3, &self.compare);
        self.draw(gbuffer, &block, false);
    }

    /// Adds a light of parallel rays.
    pub fn add_parallel(&mut self, gbuffer: &GBuffer, light: &Light, map: &PlaneShadow, filter: f32) {
        let edge = map.target.width as f32;
        let shadow = Vec4::new(1.0 / edge, map.texel, filter, map.texel * edge * 2e-6);
        let block = block(light, map.texture_from_world, shadow);
        map.target.depth().bind(3, Some(&self.compare));
        self.draw(gbuffer, &block, true);
    }

    /// Adds a range of the VPLs that stand for emissive surfaces, with their shadow maps, which hold distances up to
    /// `far`, m.
    pub fn add_emission(
        &mut self,
        gbuffer: &GBuffer,
        vpls: &VplTexture,
        range: std::ops::Range<u32>,
        maps: &ShadowMaps,
        far: f32,
    ) {
        let (before, target) = self.sum.next();
        let textures = [gbuffer.surface(), gbuffer.albedo(), before.color(0), &vpls.texture, maps.result()];
        for (unit, texture) in textures.into_iter().enumerate() {
            texture.bind(unit as u32, None);
        }
        target.bind();
        let first = range.start;
        self.vpl_block.set(&GatherBlock {
            range: UVec4::new(first, range.end, first, GLOSSY),
            map: maps.layout(far),
            grid: IVec4::new(1, 1, target.width as i32, target.height as i32),
            turn: UVec4::ZERO,
            near_grid: Vec4::ZERO,
            near_scale: Vec4::ZERO,
            near_cells: IVec4::ZERO,
        });
        State::full_screen(target.width, target.height).apply(&self.context);
        self.emission.draw_full_screen();
    }

    fn draw(&mut self, gbuffer: &GBuffer, block: &DirectBlock, parallel: bool) {
        let (before, target) = self.sum.next();
        gbuffer.surface().bind(0, None);
        gbuffer.albedo().bind(1, None);
        before.color(0).bind(2, None);
        target.bind();
        self.block.set(block);
        State::full_screen(target.width, target.height).apply(&self.context);
        if parallel { &self.plane } else { &self.cube }.draw_full_screen();
    }

    /// Radiance from all lights that were added.
    pub fn result(&self) -> &crate::gl::Target {
        self.sum.result()
    }
}

fn block(light: &Light, light_from_world: Mat4, shadow: Vec4) -> DirectBlock {
    let profile = match light.profile {
        Profile::Uniform => 0.0,
        Profile::Cosine => 1.0,
        Profile::Spot { .. } => 2.0,
        Profile::Point => 3.0,
        Profile::Directional => 4.0,
    };
    let [scale, offset] = light.profile.cone();
    DirectBlock {
        light_from_world,
        light_position: light.position.extend(profile),
        light_axis: light.axis.extend(scale),
        light_intensity: light.intensity.extend(offset),
        shadow,
    }
}
