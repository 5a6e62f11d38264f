//! The fixed-function state of a draw, set as a whole so that no pass inherits another's.

use glow::HasContext;

use super::Context;

/// What a draw writes to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Viewport {
    pub x: u32,
    pub y: u32,
    pub width: u32,
    pub height: u32,
}

/// Which sides of triangles are left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Cull {
    None,
    /// As `None`, of a mirrored instance: front and back are told apart the other way.
    NoneMirrored,
    Back,
    /// Back sides of a mirrored instance, whose triangles wind the other way.
    BackMirrored,
}

/// Everything that a draw relies on besides program, target, textures and buffers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct State {
    pub viewport: Viewport,
    /// Nearer fragments win and leave their depth.
    pub depth: bool,
    pub cull: Cull,
}

impl State {
    /// A full-screen pass: no depth, every fragment replaces.
    pub fn full_screen(width: u32, height: u32) -> Self {
        let viewport = Viewport { x: 0, y: 0, width, height };
        Self { viewport, depth: false, cull: Cull::None }
    }

    /// Opaque geometry with a depth test.
    pub fn geometry(viewport: Viewport, cull: Cull) -> Self {
        Self { viewport, depth: true, cull }
    }

    /// Points with a depth test.
    pub fn splats(width: u32, height: u32) -> Self {
        Self { depth: true, ..Self::full_screen(width, height) }
    }

    /// Makes it the context's state.
    pub fn apply(&self, context: &Context) {
        let gl = &context.gl;
        let v = self.viewport;
        // SAFETY: see `Context::new`; all of it is of OpenGL 3.3 and ES 3.0, but for the two that ES has built in.
        unsafe {
            gl.viewport(v.x as i32, v.y as i32, v.width as i32, v.height as i32);
            gl.disable(glow::SCISSOR_TEST);
            gl.disable(glow::STENCIL_TEST);
            gl.disable(glow::POLYGON_OFFSET_FILL);
            gl.disable(glow::RASTERIZER_DISCARD);
            gl.disable(glow::SAMPLE_ALPHA_TO_COVERAGE);
            gl.disable(glow::DITHER);
            gl.disable(glow::SAMPLE_COVERAGE);
            if context.info().es {
                gl.depth_range_f32(0.0, 1.0);
            } else {
                gl.depth_range_f64(0.0, 1.0);
                for capability in [
                    glow::FRAMEBUFFER_SRGB,
                    glow::COLOR_LOGIC_OP,
                    glow::PRIMITIVE_RESTART,
                    glow::DEPTH_CLAMP,
                    glow::SAMPLE_MASK,
                ] {
                    gl.disable(capability);
                }
                gl.enable(glow::PROGRAM_POINT_SIZE);
                gl.enable(glow::TEXTURE_CUBE_MAP_SEAMLESS);
                gl.polygon_mode(glow::FRONT_AND_BACK, glow::FILL);
            }
            gl.color_mask(true, true, true, true);
            gl.depth_mask(true);
            gl.depth_func(glow::LESS);
            switch(gl, glow::DEPTH_TEST, self.depth);
            switch(gl, glow::BLEND, false);
            switch(gl, glow::CULL_FACE, matches!(self.cull, Cull::Back | Cull::BackMirrored));
            gl.cull_face(glow::BACK);
            gl.front_face(if matches!(self.cull, Cull::NoneMirrored | Cull::BackMirrored) {
                glow::CW
            } else {
                glow::CCW
            });
        }
    }
}

/// SAFETY: the context is current and knows the capability.
unsafe fn switch(gl: &glow::Context, capability: u32, on: bool) {
    // SAFETY: the caller's.
    unsafe { if on { gl.enable(capability) } else { gl.disable(capability) } }
}
