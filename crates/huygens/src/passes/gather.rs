//! The sum over the VPLs at every pixel: of all of them, or of a subset that other pixels and frames share.

use std::rc::Rc;

use glam::{IVec4, UVec4, Vec4};

use crate::gl::{Context, Format, Program, ProgramSource, State, Target, Texture, Uniform, uniform_block};
use crate::passes::accumulate::Kept;
use crate::passes::{Accumulate, Accumulator, Ao, Change, GBuffer, Ism, Reconstruct, ShadowMaps, VplTexture};
use crate::settings::{GatherMethod, Model, Settings, Visibility};
use crate::{Result, shaders};

uniform_block! {
    /// `common/gather.glsl`.
    GatherBlock as "PassBlock" {
        range: UVec4,
        map: Vec4,
        grid: IVec4,
        turn: UVec4,
        near_grid: Vec4,
        near_scale: Vec4,
        near_cells: IVec4,
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

/// Irradiance and reflected radiance, in 32-bit floats, because thousands of small terms are added.
const SUM: [Format; 2] = [Format::Rgba32F; 2];

/// Both of near VPLs, see `common/mean.glsl`: rounded once for each range.
const NEAR_SUM: [Format; 1] = [Format::Rgba32Ui];

/// The bits of `range.w`: the glossy lobe too; VPLs in lists only where they are not near.
pub(crate) const GLOSSY: u32 = 1;
const FAR: u32 = 2;

/// VPL·pixels of one draw: a few seconds on two cores, far below what makes a driver give a GPU up.
const TERMS_PER_DRAW: u64 = 1 << 27;

/// What sums VPLs, drawing and computing, and what sums near ones.
type Sources = [[&'static ProgramSource; 2]; 2];

/// For VPLs that have shadow maps.
const MAPPED: Sources = [
    [&shaders::GATHER_SHADOW_MAP, &shaders::COMPUTE_GATHER_SHADOW_MAP],
    [&shaders::NEAR_SHADOW_MAP, &shaders::COMPUTE_NEAR_SHADOW_MAP],
];

/// Edge of the square of pixels that a workgroup of `gather.comp` or `gather_near.comp` has.
const GROUP: u32 = 8;

/// VPLs that a pixel sums in one draw at most: llvmpipe ends a shader's loops after 65 535 rounds, and lanes that run
/// together take up to three for each VPL. A tenth of that, so that other drivers may count otherwise.
const VPLS_PER_DRAW: u64 = 2048;

/// What decides whether a surface sees a VPL.
#[derive(Clone, Copy)]
pub(crate) enum VplVisibility<'a> {
    None,
    Ism(&'a Ism, f32),
    ShadowMaps(&'a ShadowMaps, f32),
    Dao(&'a Ao),
}

struct Programs {
    sums: Program,
    /// For near VPLs, if they may be summed apart.
    near: Option<Program>,
}

/// Pass and result.
pub(crate) struct Gather {
    context: Rc<Context>,
    /// Whether the programs compute, or draw.
    computes: bool,
    programs: Programs,
    /// For VPLs with shadow maps where others have none.
    mapped: Option<Programs>,
    block: Uniform<GatherBlock>,
    /// Whether it sums the glossy lobe too.
    specular: bool,
    interleave: Interleave,
    subsets: u32,
    /// The VPL that is summed alone.
    only: Option<u32>,
    /// What each layer's place in the n × n is changed by, and which of its subsets a place has: they go round.
    turn: [u32; 3],
    sum: Accumulator,
    /// What near VPLs give to every pixel, where the others' sums are shared.
    near: Option<Accumulator>,
    /// Which pixels are to sum near VPLs anew if the others may keep what those gave before, see [`Kept`]: until then.
    turns: Option<[u32; 2]>,
    share: Option<(Accumulate, Reconstruct)>,
    /// Whether this frame's VPLs, and near ones, have been added: else what is in the sums is of the frame before.
    begun: [bool; 2],
    /// Whether means over frames have this frame's sums.
    accumulated: bool,
}

impl Gather {
    pub fn new(context: &Rc<Context>, settings: &Settings, width: u32, height: u32) -> Result<Self> {
        let computes = settings.tier.computes(context.info());
        let sources = match settings.visibility {
            Visibility::None | Visibility::Ao => [
                [&shaders::GATHER_NONE, &shaders::COMPUTE_GATHER_NONE],
                [&shaders::NEAR_NONE, &shaders::COMPUTE_NEAR_NONE],
            ],
            Visibility::Dao => {
                [[&shaders::GATHER_DAO, &shaders::COMPUTE_GATHER_DAO], [&shaders::NEAR_DAO, &shaders::COMPUTE_NEAR_DAO]]
            }
            Visibility::Ism | Visibility::Mixed => {
                [[&shaders::GATHER_ISM, &shaders::COMPUTE_GATHER_ISM], [&shaders::NEAR_ISM, &shaders::COMPUTE_NEAR_ISM]]
            }
            Visibility::ShadowMaps => MAPPED,
        };
        let interleave = Interleave::new(settings, width, height);
        let Interleave { n, layer, cells, .. } = interleave;
        // Only reflected waves have lists.
        let listed = n > 1 && settings.model == Model::Reflected;
        let keeps = listed && interleave.step == 1;
        let of_tier = |[sums, near]: Sources| {
            let [sums, near] = [sums, near].map(|[draws, computed]| if computes { computed } else { draws });
            let near = listed.then(|| Program::new(context, near)).transpose()?;
            Ok::<_, crate::Error>(Programs { sums: Program::new(context, sums)?, near })
        };
        let mut sum = Accumulator::new(context, &SUM, false, layer[0] * n, layer[1] * n)?;
        // Layers without indirect light read it all the same.
        sum.clear();
        let draws_kept = keeps && !computes;
        let near = (n > 1).then(|| Accumulator::new(context, &NEAR_SUM, draws_kept, width, height)).transpose()?;
        Ok(Self {
            context: context.clone(),
            computes,
            programs: of_tier(sources)?,
            mapped: (settings.visibility == Visibility::Mixed).then(|| of_tier(MAPPED)).transpose()?,
            block: Uniform::new(context)?,
            specular: settings.sums_specular(),
            interleave,
            subsets: n * n,
            only: None,
            turn: [0; 3],
            sum,
            turns: None,
            share: if n > 1 {
                let accumulate = Accumulate::new(context, computes, cells, near.as_ref().filter(|_| keeps))?;
                Some((accumulate, Reconstruct::new(context, computes, cells, width, height)?))
            } else {
                None
            },
            near,
            begun: [false; 2],
            accumulated: false,
        })
    }

    /// Takes up other subsets of the VPLs; whether it could, and the means over frames go on.
    pub fn regroup(&mut self, settings: &Settings) -> Result<bool> {
        let [width, height] = self.near.as_ref().map_or([0; 2], |near| [near.result().width, near.result().height]);
        let interleave = Interleave::new(settings, width, height);
        if self.share.is_none() || interleave.n == 1 || interleave.step != self.interleave.step {
            return Ok(false);
        }
        if interleave == self.interleave {
            return Ok(true);
        }
        let Interleave { n, layer, .. } = interleave;
        self.sum = Accumulator::new(&self.context, &SUM, false, layer[0] * n, layer[1] * n)?;
        self.sum.clear();
        self.interleave = interleave;
        Ok(true)
    }

    /// Begins frame number `frame`, in which each pixel sums one of so many subsets, see [`Self::subsets`], or `only` one
    /// VPL, exactly; what was summed before no longer counts. If VPLs and surfaces `last`, some pixels keep what near VPLs gave before.
    pub fn begin(&mut self, frame: u32, subsets: u32, only: Option<u32>, change: &Change, last: bool) {
        (self.subsets, self.only, self.begun, self.accumulated) = (subsets, only, [false; 2], false);
        self.turn = turn(self.interleave.n, subsets, frame);
        self.turns = (last && self.interleave.step == 1).then(|| {
            // Blocks that follow one another seldom lie side by side.
            let kinds = [0, 7, 1, 6, 2, 5, 3, 4];
            // At rest all have their turn in four frames, as many as the fewest subsets.
            let turn = frame as usize % 8;
            let turns = if change.still { [2 * turn, 2 * turn + 1] } else { [turn; 2] };
            turns.map(|turn| kinds[turn % 8])
        });
    }

    /// Adds the VPLs of a range. The distance with each visibility is the farthest that its maps hold. `done` hears
    /// after every draw how many VPLs it took.
    pub fn add(
        &mut self,
        gbuffer: &GBuffer,
        vpls: &VplTexture,
        range: std::ops::Range<u32>,
        visibility: VplVisibility,
        change: &Change,
        done: &mut dyn FnMut(u32),
    ) {
        if range.is_empty() {
            return;
        }
        let map = match visibility {
            VplVisibility::None | VplVisibility::Dao(_) => Vec4::ZERO,
            VplVisibility::Ism(ism, far) => {
                let layout = ism.layout();
                Vec4::new(layout.tile as f32, layout.columns as f32, far, layout.half_diagonal)
            }
            VplVisibility::ShadowMaps(maps, far) => maps.layout(far),
        };
        let Interleave { n, step, layer, .. } = self.interleave;
        let programs = match (visibility, &self.mapped) {
            (VplVisibility::ShadowMaps(..), Some(mapped)) => mapped,
            _ => &self.programs,
        };
        let near = vpls.near.as_ref().zip(programs.near.as_ref());
        let surfaces = [gbuffer.surface(), gbuffer.albedo(), &vpls.texture];
        let maps = match visibility {
            VplVisibility::None => None,
            VplVisibility::Dao(ao) => Some(ao.horizons()),
            VplVisibility::Ism(ism, _) => Some(ism.result()),
            VplVisibility::ShadowMaps(maps, _) => Some(maps.result()),
        };
        let (context, block, computes) = (&self.context, &self.block, self.computes);
        // Draws to what is `kept`, where the depth test passes, or the sum of what there is and more.
        let run =
            |program: &Program, lists: Option<&Texture>, sum: &mut Accumulator, kept: bool, parameters: GatherBlock| {
                block.set(&parameters);
                let (before, target) = if kept || (computes && lists.is_none()) { sum.last() } else { sum.next() };
                let textures = surfaces.into_iter().chain(lists).chain(maps);
                if computes {
                    bind_all(textures.chain(before.colors().iter().filter(|_| lists.is_some())));
                    for (unit, image) in target.colors().iter().enumerate() {
                        image.bind_image(unit as u32);
                    }
                    let [n, _, width, height] = parameters.grid.to_array().map(|n| n as u32);
                    program.dispatch([width.div_ceil(GROUP), height.div_ceil(GROUP), n * n]);
                } else {
                    bind_all(textures.chain(before.colors()));
                    target.bind();
                    State { depth: kept, ..State::full_screen(target.width, target.height) }.apply(context);
                    program.draw_full_screen();
                }
            };
        let glossy = if self.specular { GLOSSY } else { 0 };
        let flags = glossy | if near.is_some() { FAR } else { 0 };
        let pixels = u64::from(self.sum.result().width) * u64::from(self.sum.result().height);
        let per_draw = (TERMS_PER_DRAW / pixels).min(VPLS_PER_DRAW) * u64::from(self.subsets);
        let per_draw = per_draw.clamp(1, 1 << 20) as u32;
        let summed = self.only.map_or(range.clone(), |i| range.start.max(i)..range.end.min(i.saturating_add(1)));
        for first in summed.clone().step_by(per_draw as usize) {
            let drawn = first..summed.end.min(first + per_draw);
            run(
                &programs.sums,
                None,
                &mut self.sum,
                false,
                GatherBlock {
                    range: UVec4::new(drawn.start, drawn.end, range.start, flags),
                    map,
                    grid: IVec4::new(n as i32, step as i32, layer[0] as i32, layer[1] as i32),
                    turn: UVec4::new(self.turn[0], self.turn[1], self.subsets, self.turn[2]),
                    near_grid: Vec4::ZERO,
                    near_scale: Vec4::ZERO,
                    near_cells: IVec4::new(0, 0, 0, i32::from(self.begun[0])),
                },
            );
            self.begun[0] = true;
            done(drawn.end - drawn.start);
        }
        if let (Some((near, program)), Some(sum)) = (near, &mut self.near) {
            let [width, height] = [sum.result().width as i32, sum.result().height as i32];
            let all = range == (0..vpls.count);
            let kept = match (&mut self.share, self.turns.take()) {
                (Some((accumulate, _)), Some(turns)) if all && accumulate.takes_near() => {
                    let kept = Kept { sums: &mut *sum, turns };
                    let interleave = (&self.interleave, self.subsets);
                    accumulate.run(gbuffer, self.sum.result(), interleave, change, Some(kept));
                    self.accumulated = true;
                    true
                }
                // They would have light of all ranges.
                _ => false,
            };
            // Computing, what is kept is taken over.
            let added = if kept { computes } else { self.begun[1] };
            run(
                program,
                Some(&near.texture),
                sum,
                kept && !computes,
                GatherBlock {
                    range: UVec4::new(range.start, range.end, range.start, glossy),
                    map,
                    grid: IVec4::new(1, 1, width, height),
                    turn: UVec4::new(0, 0, 1, 0),
                    near_grid: near.grid,
                    near_scale: Vec4::new(1.0 / near.texture.width as f32, 1.0 / near.texture.height as f32, 0.0, 0.0),
                    near_cells: near.cells.extend(i32::from(added)),
                },
            );
            self.begun[1] = true;
        }
    }

    /// How many subsets of so many VPLs there are if a pixel sums at most `most` in a frame: n² or more.
    pub fn subsets(&self, vpls: u32, most: u32) -> u32 {
        let places = self.interleave.n * self.interleave.n;
        match places {
            1 => 1,
            _ => places * vpls.div_ceil(places.saturating_mul(most)).max(1),
        }
    }

    /// Ends the frame: what nothing was added to is zero, and sums are shared between frames and neighbours, if each has its
    /// own subset.
    pub fn share(&mut self, gbuffer: &GBuffer, change: &Change) {
        // What has no VPLs has no light.
        if !self.begun[0] {
            self.sum.clear();
        }
        if let (Some((accumulate, reconstruct)), Some(near)) = (&mut self.share, &mut self.near) {
            if !self.begun[1] {
                near.clear();
            }
            if !self.accumulated {
                accumulate.run(gbuffer, self.sum.result(), (&self.interleave, self.subsets), change, None);
            }
            let turns = self.subsets as f32 / (self.interleave.n * self.interleave.n) as f32;
            reconstruct.run(gbuffer, accumulate.result(), near.result(), &self.interleave, change.share * turns);
        }
    }

    fn result(&self) -> &Target {
        self.share.as_ref().map_or(self.sum.result(), |(_, reconstruct)| reconstruct.result())
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

    /// What near VPLs give to every pixel, with the frames since it was summed, first row at the bottom.
    #[cfg(test)]
    pub fn read_near(&self) -> Vec<[f32; 4]> {
        let unpack = |[x, y]: [u32; 2]| {
            let scale = 2f32.powi((y >> 22 & 0xff) as i32 - 127 - 17);
            [x, x >> 18 | y << 14, y >> 4].map(|q| (q & 0x3ffff) as f32 * scale)
        };
        let sum = |[x, y, _, w]: [u32; 4]| {
            let [r, g, b] = unpack([x, y]);
            [r, g, b, (y >> 30 | w >> 30 << 2) as f32]
        };
        self.near.as_ref().map_or(Vec::new(), |near| near.result().read(0).into_iter().map(sum).collect())
    }
}

fn bind_all<'a>(textures: impl Iterator<Item = &'a Texture>) {
    for (unit, texture) in textures.enumerate() {
        texture.bind(unit as u32, None);
    }
}

/// What the place of a pixel in the n × n changes by in a frame, by exclusive or, to give the subset that it sums: in 4^k
/// frames that follow one another, and n / 2^k pixels along either side, every one of n² subsets has its turn. Of more
/// subsets, each place has several, and the third number says which; all have their turn after as many frames.
fn turn(n: u32, subsets: u32, frame: u32) -> [u32; 3] {
    let (bits, places) = (n.ilog2(), n * n);
    let [x, y] = [0, 1].map(|axis| (0..bits).map(|bit| (frame >> (2 * bit + axis) & 1) << (bits - 1 - bit)).sum());
    [x, y, (frame % places + frame / places) % (subsets / places)]
}

#[cfg(test)]
mod tests {
    use super::turn;

    /// As in `common/gather.glsl`.
    fn subset(n: u32, subsets: u32, place: [u32; 2], which: u32) -> u32 {
        let bits = n.ilog2();
        let bit = |axis| (0..bits).map(move |bit| (place[axis] >> bit & 1) << (2 * (bits - 1 - bit) + axis as u32));
        bit(0).chain(bit(1)).sum::<u32>() * (subsets / (n * n)) + which
    }

    #[test]
    fn fewer_pixels_have_every_subset_after_more_frames() {
        for n in [2, 4, 8, 16] {
            for k in 0..=u32::ilog2(n) {
                // A window anywhere, frames from any multiple on.
                let (side, frames, corner) = (n >> k, 1 << (2 * k), [3, 5]);
                for first in [0, frames, 7 * frames] {
                    let mut seen = std::collections::HashSet::new();
                    for frame in first..first + frames {
                        let [x, y, which] = turn(n, n * n, frame);
                        for i in 0..side * side {
                            let at = [corner[0] + i % side, corner[1] + i / side];
                            seen.insert(subset(n, n * n, [(at[0] % n) ^ x, (at[1] % n) ^ y], which));
                        }
                    }
                    assert_eq!(seen.len() as u32, n * n, "{n} {k} {first}");
                }
            }
        }
    }

    #[test]
    fn every_pixel_has_every_subset_in_time() {
        for (n, subsets) in [(2, 4), (2, 12), (4, 16), (4, 80), (8, 64), (16, 1024)] {
            for place in [[0, 0], [1, 0], [n - 1, n / 2]] {
                let mut seen: Vec<u32> = (0..subsets)
                    .map(|frame| {
                        let [x, y, which] = turn(n, subsets, frame);
                        subset(n, subsets, [place[0] ^ x, place[1] ^ y], which)
                    })
                    .collect();
                seen.sort();
                assert_eq!(seen, (0..subsets).collect::<Vec<_>>(), "{n} {subsets}");
            }
        }
    }
}
