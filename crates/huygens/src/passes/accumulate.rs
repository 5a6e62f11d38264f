//! Means over frames of what the interleaved gather sums.

use std::rc::Rc;

use glam::{IVec4, Mat4, UVec4, Vec3, Vec4};

use crate::gl::{Context, Format, Program, State, Target, Texture, Uniform, uniform_block};
use crate::passes::gather::Interleave;
use crate::passes::{FrameBlock, GBuffer};
use crate::{Result, shaders};

uniform_block! {
    /// `common/reproject.glsl`.
    BeforeBlock as "BeforeBlock" {
        previous_view_from_world: Mat4,
        previous_clip_from_view: Mat4,
        previous_unprojection: Vec4,
        previous_jitter: Vec4,
        previous_scale: Vec4,
        cells: IVec4,
        count: UVec4,
        renew: UVec4,
    }
}

/// The textures of a mean, see `common/mean.glsl`.
pub(crate) const MEAN: [Format; 2] = [Format::Rgba32F, Format::Rgba32Ui];

/// Instances in a row of the texture of motions.
const ROW: usize = 256;

/// Pixels are in eight kinds of blocks, of which each makes its near sums anew in its turn; or all do.
pub(crate) const ALL: u32 = 8;

/// What differs from the frame before.
pub(crate) struct Change<'a> {
    /// The camera of this frame.
    pub frame: &'a FrameBlock,
    /// How the instances moved, if any did.
    pub motion: Option<&'a Texture>,
    /// Neither the camera nor anything else did.
    pub still: bool,
    /// How many sums are to be shared for each subset of the VPLs: 1 where they are of all subsets alike.
    pub share: f32,
    /// Most frames that the means before may count for; 0: there are none.
    pub frames: u32,
    /// How much brighter all VPLs together are than in the frame before.
    pub scale: Vec3,
}

/// Pass and result.
pub(crate) struct Accumulate {
    context: Rc<Context>,
    /// Whether the program computes, or draws.
    computes: bool,
    program: Program,
    block: Uniform<BeforeBlock>,
    /// Means, as `common/mean.glsl` has them: of the frame before, and of this one.
    targets: [Target; 2],
    current: usize,
    /// The camera that the means are seen from.
    camera: FrameBlock,
}

impl Accumulate {
    /// `cells` are the pixels that have sums.
    pub fn new(context: &Rc<Context>, computes: bool, [width, height]: [u32; 2]) -> Result<Self> {
        let target = || Target::new(context, &MEAN, false, width, height);
        Ok(Self {
            context: context.clone(),
            computes,
            program: Program::new(context, if computes { &shaders::COMPUTE_ACCUMULATE } else { &shaders::ACCUMULATE })?,
            block: Uniform::new(context)?,
            targets: [target()?, target()?],
            current: 0,
            camera: bytemuck::Zeroable::zeroed(),
        })
    }

    /// Takes in the sums of a frame, each of one of so many `subsets`.
    pub fn run(&mut self, gbuffer: &GBuffer, sums: &Target, interleave: &Interleave, subsets: u32, change: &Change) {
        self.bind(&self.before(interleave, subsets, change));
        let (before, target) = (&self.targets[self.current], &self.targets[1 - self.current]);
        let emission = gbuffer.emission();
        let textures = [
            gbuffer.surface(),
            emission,
            sums.color(0),
            sums.color(1),
            before.color(0),
            before.color(1),
            // What the shader will not look at is some texture all the same.
            change.motion.unwrap_or(emission),
        ];
        for (unit, texture) in textures.into_iter().enumerate() {
            texture.bind(unit as u32, None);
        }
        if self.computes {
            for unit in 0..2 {
                target.color(unit).bind_image(unit as u32);
            }
            self.program.dispatch([target.width.div_ceil(8), target.height.div_ceil(8), 1]);
        } else {
            target.bind();
            State::full_screen(target.width, target.height).apply(&self.context);
            self.program.draw_full_screen();
        }
        self.camera = *change.frame;
        self.current = 1 - self.current;
    }

    /// What there is to know of the frame before; near sums of it do not count.
    pub fn before(&self, interleave: &Interleave, subsets: u32, change: &Change) -> BeforeBlock {
        let camera = &self.camera;
        let [width, height] = interleave.layer.map(|n| n as i32);
        BeforeBlock {
            previous_view_from_world: camera.view_from_world,
            previous_clip_from_view: camera.clip_from_view,
            previous_unprojection: camera.unprojection,
            previous_jitter: camera.jitter,
            previous_scale: change.scale.extend(1.0),
            cells: IVec4::new(interleave.n as i32, interleave.step as i32, width, height),
            count: UVec4::new(change.frames, u32::from(change.still), u32::from(change.motion.is_some()), subsets),
            renew: UVec4::new(ALL, 0, 0, 0),
        }
    }

    /// For draws that look at the frame before.
    pub fn bind(&self, before: &BeforeBlock) {
        self.block.set(before);
    }

    /// Means with their numbers of frames.
    pub fn result(&self) -> &Target {
        &self.targets[self.current]
    }
}

/// The matrices that take each instance to where it was, four texels each, as `common/accumulate.glsl` reads them.
pub(crate) fn motion(context: &Rc<Context>, matrices: &[Mat4]) -> Result<Texture> {
    let mut texels = matrices.to_vec();
    texels.resize(matrices.len().next_multiple_of(ROW).max(ROW), Mat4::IDENTITY);
    let (width, height) = (4 * ROW as u32, (texels.len() / ROW) as u32);
    Texture::with_pixels(context, Format::Rgba32F, width, height, Some(bytemuck::cast_slice(&texels)))
}
