//! Imperfect shadow maps of all VPLs (Ritschel et al. 2008): splat, pull, push. A Lambertian VPL has a hemisphere.

use std::rc::Rc;

use glam::{UVec4, Vec4};

use crate::gl::{
    Context, DriverInfo, Format, MOST_GROUPS, Program, State, Target, Texture, Uniform, Viewport, uniform_block,
};
use crate::passes::VplTexture;
use crate::settings::Ism as IsmSettings;
use crate::surfel::SurfelTexels;
use crate::{Error, Result, shaders};

uniform_block! {
    /// `common/ism_splat.glsl`.
    IsmBlock as "PassBlock" {
        counts: UVec4,
        atlas: UVec4,
        disc: Vec4,
        target_size: Vec4,
    }
}

/// Surfels in a row of their texture.
const ROW: usize = 512;

/// Largest edge of what a workgroup of `ism.comp` makes, texels.
const BLOCK: u32 = 64;

/// Points of one draw: enough to fill any device, few enough not to hold a display up.
const POINTS_PER_DRAW: u32 = 1 << 22;

/// Pass and result: an atlas with one octahedral tile for each VPL.
pub(crate) struct Ism {
    context: Rc<Context>,
    /// Splats, or makes the maps whole where that is computed.
    program: Program,
    block: Uniform<IsmBlock>,
    surfels: Texture,
    surfel_count: u32,
    area: f32,
    /// Tiles that there are.
    pub capacity: u32,
    atlas: Atlas,
}

/// The layout of the atlas and its targets.
struct Atlas {
    tile: u32,
    columns: u32,
    /// Of pull and push.
    levels: u32,
    maps: Target,
    /// What comes before the maps where they are drawn.
    steps: Option<Steps>,
}

struct Steps {
    pull: Program,
    push: Program,
    splatted: Target,
    /// Each has the atlas halved once more than the one before it.
    pulled: Vec<Target>,
    pushed: Vec<Target>,
}

/// What the gather has to know of the maps.
#[derive(Clone, Copy)]
pub(crate) struct IsmLayout {
    pub tile: u32,
    pub columns: u32,
    /// Half the diagonal of the widest texel of a sphere as an angle, radians.
    pub half_diagonal: f32,
}

impl Ism {
    /// Refuses tiles that do not fit into the driver's textures.
    pub fn check(info: &DriverInfo, settings: &IsmSettings, vpls: u32) -> Result<()> {
        tiles(info, settings.size, vpls).map(|_| ())
    }

    /// `surfels` are in world space (a power of two of them), `area` in m² is what they stand
    /// for; `vpls` is how many tiles there must be; `computes` whether compute shaders make them.
    pub fn new(
        context: &Rc<Context>,
        settings: &IsmSettings,
        computes: bool,
        surfels: &[SurfelTexels],
        area: f32,
        vpls: u32,
    ) -> Result<Self> {
        Ok(Self {
            context: context.clone(),
            program: Program::new(context, if computes { &shaders::COMPUTE_ISM } else { &shaders::ISM_SPLAT })?,
            block: Uniform::new(context)?,
            surfels: upload(context, surfels)?,
            surfel_count: surfels.len() as u32,
            area,
            capacity: vpls,
            atlas: Atlas::new(context, settings, computes, vpls)?,
        })
    }

    /// Takes the same surfels where they are now.
    pub fn place(&mut self, surfels: &[SurfelTexels]) -> Result<()> {
        self.surfels = upload(&self.context, surfels)?;
        Ok(())
    }

    /// VPLs of one of so many parts of the atlas, which are whole rows of tiles.
    pub fn part(&self, part: u32, parts: u32) -> std::ops::Range<u32> {
        let rows = self.capacity.div_ceil(self.atlas.columns);
        let first = |part: u32| rows * part / parts * self.atlas.columns;
        first(part)..first(part + 1).min(self.capacity)
    }

    /// Lets every surface see every VPL, until their maps are made.
    pub fn show_all(&self) {
        self.atlas.maps.fill(1.0);
    }

    /// Makes the maps of a range of the VPLs, and spoils others in the rows of its first and last tile. `far` is the
    /// farthest distance between a VPL and a surface, m. `done` hears after every draw of how many VPLs it was.
    pub fn run(
        &self,
        settings: &IsmSettings,
        vpls: &VplTexture,
        range: std::ops::Range<u32>,
        far: f32,
        seed: u32,
        done: &mut dyn FnMut(u32),
    ) {
        if range.is_empty() {
            return;
        }
        let atlas = &self.atlas;
        // A VPL never takes more points than there are surfels.
        let points = settings.points.min(self.surfel_count);
        let stride = self.surfel_count / points.max(1);
        let near = settings.near.min(stride);
        let radius = settings.spread * (self.area / points as f32 / std::f32::consts::PI).sqrt();
        let bind = |first: u32| {
            vpls.texture.bind(0, None);
            self.surfels.bind(1, None);
            self.block.set(&IsmBlock {
                counts: UVec4::new(points, stride, first, seed),
                atlas: UVec4::new(atlas.tile, atlas.columns, near, atlas.levels),
                disc: Vec4::new(radius, 1.0 / far, self.context.info().max_point_size, 0.0),
                target_size: Vec4::new(atlas.maps.width as f32, atlas.maps.height as f32, 0.0, 0.0),
            });
        };
        let blocks = (atlas.tile / BLOCK).max(1).pow(2);
        let Some(steps) = &atlas.steps else {
            let per_dispatch = (POINTS_PER_DRAW / (points * near * blocks).max(1)).clamp(1, MOST_GROUPS);
            for first in range.clone().step_by(per_dispatch as usize) {
                let count = per_dispatch.min(range.end - first);
                bind(first);
                atlas.maps.color(0).bind_image(0);
                self.program.dispatch([count, blocks, 1]);
                done(count);
            }
            return;
        };
        let rows = range.start / atlas.columns * atlas.tile..range.end.div_ceil(atlas.columns) * atlas.tile;
        steps.splatted.clear_rows(rows.clone());
        if points > 0 {
            let per_draw = (POINTS_PER_DRAW / (points * near)).max(1);
            State::splats(steps.splatted.width, steps.splatted.height).apply(&self.context);
            for first in range.clone().step_by(per_draw as usize) {
                let count = per_draw.min(range.end - first);
                bind(first);
                self.program.draw_points(count * points * near);
                done(count);
            }
        }
        let state = |target: &Target, level: usize| {
            let viewport =
                Viewport { x: 0, y: rows.start >> level, width: target.width, height: rows.len() as u32 >> level };
            State { viewport, ..State::full_screen(target.width, target.height) }
        };
        let mut fine = steps.splatted.depth();
        for (level, target) in steps.pulled.iter().enumerate() {
            fine.bind(0, None);
            target.bind();
            state(target, level + 1).apply(&self.context);
            steps.pull.draw_full_screen();
            fine = target.color(0);
        }
        let targets = std::iter::once(&atlas.maps).chain(&steps.pushed);
        for (level, target) in targets.enumerate().collect::<Vec<_>>().into_iter().rev() {
            let fine = if level == 0 { steps.splatted.depth() } else { steps.pulled[level - 1].color(0) };
            // The coarsest level is filled as far as it will be.
            let coarse = match (steps.pushed.get(level), steps.pulled.get(level)) {
                (Some(pushed), _) => pushed.color(0),
                (None, Some(pulled)) => pulled.color(0),
                (None, None) => fine,
            };
            fine.bind(0, None);
            coarse.bind(1, None);
            target.bind();
            state(target, level).apply(&self.context);
            steps.push.draw_full_screen();
        }
    }

    /// Nearest distance in each texel over the farthest; 1 where there is nothing.
    pub fn result(&self) -> &Texture {
        self.atlas.maps.color(0)
    }

    /// The maps, a distance in each texel's first number; waits for the GPU.
    #[cfg(test)]
    pub fn read(&self) -> Vec<[f32; 4]> {
        self.atlas.maps.read(0)
    }

    /// Where the tiles stand.
    pub fn layout(&self) -> IsmLayout {
        IsmLayout {
            tile: self.atlas.tile,
            columns: self.atlas.columns,
            // In the middle of an octant, where the octahedral map shrinks most: √2 / tile across, at 1/6 tile/rad.
            half_diagonal: 3.0 * std::f32::consts::SQRT_2 / self.atlas.tile as f32,
        }
    }
}

fn upload(context: &Rc<Context>, surfels: &[SurfelTexels]) -> Result<Texture> {
    let mut texels = surfels.to_vec();
    texels.resize(surfels.len().next_multiple_of(ROW).max(ROW), SurfelTexels::default());
    let (width, height) = ((size_of::<SurfelTexels>() / 16 * ROW) as u32, (texels.len() / ROW) as u32);
    Texture::with_pixels(context, Format::Rgba32F, width, height, Some(bytemuck::cast_slice(&texels)))
}

/// Columns and rows of so many tiles, nearly square; refuses more than fit into a texture.
fn tiles(info: &DriverInfo, tile: u32, vpls: u32) -> Result<[u32; 2]> {
    let limit = info.max_texture_size;
    let columns = (f64::from(vpls.max(1)).sqrt().ceil() as u32).clamp(1, (limit / tile).max(1));
    let rows = vpls.max(1).div_ceil(columns);
    if rows.saturating_mul(tile) > limit {
        return Err(Error::Setting {
            key: "ism.size".to_owned(),
            problem: format!("{vpls} tiles of {tile}x{tile} texels do not fit into a texture of {limit}x{limit}"),
            allowed: format!("{} VPLs at this size, or smaller tiles", columns * (limit / tile)),
        });
    }
    Ok([columns, rows])
}

impl Atlas {
    fn new(context: &Rc<Context>, settings: &IsmSettings, computes: bool, vpls: u32) -> Result<Self> {
        let tile = settings.size;
        let [columns, rows] = tiles(context.info(), tile, vpls)?;
        let (width, height) = (columns * tile, rows * tile);
        // A level more would mix tiles.
        let levels = settings.pull_levels.min(tile.ilog2());
        let at = |level: u32| Target::new(context, &[Format::R16F], false, width >> level, height >> level);
        let steps = || {
            Ok(Steps {
                pull: Program::new(context, &shaders::ISM_PULL)?,
                push: Program::new(context, &shaders::ISM_PUSH)?,
                splatted: Target::new(context, &[], true, width, height)?,
                pulled: (1..=levels).map(at).collect::<Result<_>>()?,
                pushed: (1..levels).map(at).collect::<Result<_>>()?,
            })
        };
        Ok(Self { tile, columns, levels, maps: at(0)?, steps: (!computes).then(steps).transpose()? })
    }
}
