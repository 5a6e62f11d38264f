//! Means over frames of what the interleaved gather sums.

use std::rc::Rc;

use glam::{IVec4, Mat4, UVec4, Vec3, Vec4};

use crate::gl::{Context, Format, JointTarget, Program, State, Target, Texture, Uniform, uniform_block};
use crate::passes::gather::Interleave;
use crate::passes::{Accumulator, FrameBlock, GBuffer};
use crate::{Result, shaders};

uniform_block! {
    /// `common/reproject.glsl`.
    BeforeBlock as "BeforeBlock" {
        previous_view_from_world: Mat4,
        previous_unprojection: Vec4,
        previous_jitter: Vec4,
        previous_scale: Vec4,
        cells: IVec4,
        scales: Vec4,
        count: UVec4,
        renew: UVec4,
    }
}

/// The textures of a mean, see `common/mean.glsl`.
pub(crate) const MEAN: [Format; 2] = [Format::Rgba32F, Format::Rgba32Ui];

/// Instances in a row of the texture of motions.
const ROW: usize = 256;

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

/// Near sums that are kept where it is not their turn: sums of the frame before, and where they go.
pub(crate) struct Kept<'a> {
    pub sums: &'a mut Accumulator,
    /// Which of the eight kinds of blocks of pixels have their turn, see `common/near_before.glsl`.
    pub turns: [u32; 2],
}

/// Pass and result.
pub(crate) struct Accumulate {
    context: Rc<Context>,
    /// Whether the programs compute, or draw.
    computes: bool,
    program: Program,
    /// Takes near sums of the same pixels along.
    with_near: Option<WithNear>,
    block: Uniform<BeforeBlock>,
    /// Means, as `common/mean.glsl` has them: of the frame before, and of this one.
    targets: [Target; 2],
    current: usize,
    /// The camera that the means are seen from.
    camera: FrameBlock,
}

struct WithNear {
    program: Program,
    /// For the program that draws.
    joint: Option<JointTarget>,
}

impl Accumulate {
    /// `cells` are the pixels that have sums; `near` are near sums that may be [`Kept`], of as many pixels.
    pub fn new(context: &Rc<Context>, computes: bool, cells: [u32; 2], near: Option<&Accumulator>) -> Result<Self> {
        let target = || Target::new(context, &MEAN, false, cells[0], cells[1]);
        let targets = [target()?, target()?];
        let [alone, both] = match computes {
            true => [&shaders::COMPUTE_ACCUMULATE, &shaders::COMPUTE_ACCUMULATE_NEAR],
            false => [&shaders::ACCUMULATE, &shaders::ACCUMULATE_NEAR],
        };
        let with_near = |near: &Accumulator| {
            // Without it near sums are made anew.
            let joint = if computes { None } else { Some(JointTarget::new(context, &targets[0], near.result()).ok()?) };
            Some(Program::new(context, both).map(|program| WithNear { program, joint }))
        };
        Ok(Self {
            context: context.clone(),
            computes,
            program: Program::new(context, alone)?,
            with_near: near.and_then(with_near).transpose()?,
            block: Uniform::new(context)?,
            targets,
            current: 0,
            camera: bytemuck::Zeroable::zeroed(),
        })
    }

    /// Whether near sums may be [`Kept`].
    pub fn takes_near(&self) -> bool {
        self.with_near.is_some()
    }

    /// Takes in the sums of a frame, each of one of so many `subsets`. What is `kept` has a number of frames; where a draw
    /// made it, what is not passes a depth test.
    pub fn run(
        &mut self,
        gbuffer: &GBuffer,
        sums: &Target,
        (interleave, subsets): (&Interleave, u32),
        change: &Change,
        kept: Option<Kept>,
    ) {
        self.block.set(&self.before(interleave, subsets, change, kept.as_ref().map_or([0; 2], |kept| kept.turns)));
        let (before, target) = (&self.targets[self.current], &self.targets[1 - self.current]);
        let textures = [gbuffer.surface(), sums.color(0), sums.color(1), before.color(0), before.color(1)];
        let near = kept.map(|kept| kept.sums.next());
        // Near sums are kept only where no object moves.
        debug_assert!(near.is_none() || change.motion.is_none());
        let near_before = near.iter().flat_map(|(before, _)| before.colors());
        let emission = gbuffer.emission();
        // What the shader will not look at is some texture all the same.
        let motion = near.is_none().then(|| [emission, change.motion.unwrap_or(emission)]);
        for (unit, texture) in textures.into_iter().chain(near_before).chain(motion.into_iter().flatten()).enumerate() {
            texture.bind(unit as u32, None);
        }
        let with_near = near.as_ref().and(self.with_near.as_ref());
        let program = with_near.map_or(&self.program, |with_near| &with_near.program);
        if self.computes {
            let targets = [target].into_iter().chain(near.map(|(_, target)| target));
            for (unit, image) in targets.flat_map(Target::colors).enumerate() {
                image.bind_image(unit as u32);
            }
            program.dispatch([target.width.div_ceil(8), target.height.div_ceil(8), 1]);
        } else {
            let mut state = State::full_screen(target.width, target.height);
            match (with_near.and_then(|with_near| with_near.joint.as_ref()), near) {
                (Some(joint), Some((_, near))) => {
                    near.clear_depth();
                    joint.bind(target, near);
                    state.depth = true;
                }
                _ => target.bind(),
            }
            state.apply(&self.context);
            program.draw_full_screen();
        }
        self.camera = *change.frame;
        self.current = 1 - self.current;
    }

    /// What there is to know of the frame before.
    fn before(&self, interleave: &Interleave, subsets: u32, change: &Change, [a, b]: [u32; 2]) -> BeforeBlock {
        let camera = &self.camera;
        let [width, height] = interleave.layer.map(|n| n as i32);
        let [x, y] = interleave.cells.map(|n| 1.0 / n as f32);
        let [u, v] = interleave.layer.map(|n| 1.0 / (n * interleave.n) as f32);
        BeforeBlock {
            previous_view_from_world: camera.view_from_world,
            previous_unprojection: camera.unprojection,
            previous_jitter: camera.jitter,
            previous_scale: change.scale.extend(1.0),
            cells: IVec4::new(interleave.n.ilog2() as i32, interleave.step.ilog2() as i32, width, height),
            scales: Vec4::new(x, y, u, v),
            count: UVec4::new(change.frames, u32::from(change.still), u32::from(change.motion.is_some()), subsets),
            renew: UVec4::new(a, b, 0, 0),
        }
    }

    /// Means with their numbers of frames.
    pub fn result(&self) -> &Target {
        &self.targets[self.current]
    }
}

/// The matrices that take each instance to where it was, four texels each, as `common/motion.glsl` reads them.
pub(crate) fn motion(context: &Rc<Context>, matrices: &[Mat4]) -> Result<Texture> {
    let mut texels = matrices.to_vec();
    texels.resize(matrices.len().next_multiple_of(ROW).max(ROW), Mat4::IDENTITY);
    let (width, height) = (4 * ROW as u32, (texels.len() / ROW) as u32);
    Texture::with_pixels(context, Format::Rgba32F, width, height, Some(bytemuck::cast_slice(&texels)))
}
