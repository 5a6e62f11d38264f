//! Programs: GLSL files with a header for the target, linked, their samplers and uniform blocks bound. They draw, or
//! compute.

use std::rc::Rc;

use glow::HasContext;

use super::Context;
use crate::shaders::Target;
use crate::{Error, Result};

/// The files of one shader stage, in order; see `shaders.rs`.
pub(crate) type Stage = &'static [&'static str];

/// What a program is made of.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ProgramSource {
    pub name: &'static str,
    /// What it draws with; empty if it computes.
    pub vertex: Stage,
    pub fragment: Stage,
    /// What it computes with, on OpenGL 4.3; empty if it draws.
    pub compute: Stage,
    /// Texture units are numbered in this order.
    pub samplers: &'static [&'static str],
}

/// Points at which the uniform blocks of all programs are bound.
pub(crate) const BLOCKS: [&str; 5] = ["FrameBlock", "ObjectBlock", "MaterialBlock", "PassBlock", "BeforeBlock"];

/// Workgroups along an axis that every driver allows.
pub(crate) const MOST_GROUPS: u32 = 65535;

/// A linked program.
pub(crate) struct Program {
    context: Rc<Context>,
    raw: glow::Program,
    empty_vao: glow::VertexArray,
}

impl Program {
    /// Compiles and links; the error names the file and line.
    pub fn new(context: &Rc<Context>, source: &ProgramSource) -> Result<Self> {
        let gl = &context.gl;
        let fail = |what: &str, log: String| Error::Gl(format!("{} {what}: {}", source.name, log.replace('\n', " ")));
        // SAFETY: see `Context::new`; every object is deleted or owned by the result.
        unsafe {
            let raw = gl.create_program().map_err(|e| fail("program", e))?;
            let empty_vao = gl.create_vertex_array().map_err(|e| {
                gl.delete_program(raw);
                fail("vertex array", e)
            })?;
            let program = Self { context: context.clone(), raw, empty_vao };
            let stages = [
                (glow::VERTEX_SHADER, Target::of(context), source.vertex),
                (glow::FRAGMENT_SHADER, Target::of(context), source.fragment),
                (glow::COMPUTE_SHADER, Target::Compute, source.compute),
            ];
            for (kind, target, files) in stages.into_iter().filter(|(.., files)| !files.is_empty()) {
                let shader = gl.create_shader(kind).map_err(|e| fail("shader", e))?;
                gl.shader_source(shader, &crate::shaders::assemble(&context.shaders.borrow(), target, files));
                gl.compile_shader(shader);
                let log = gl.get_shader_info_log(shader);
                let compiled = gl.get_shader_compile_status(shader);
                if compiled {
                    gl.attach_shader(raw, shader);
                }
                // Lives on for as long as it is attached.
                gl.delete_shader(shader);
                if !compiled {
                    return Err(fail("does not compile", crate::shaders::name_lines(&log, files)));
                }
            }
            gl.link_program(raw);
            if !gl.get_program_link_status(raw) {
                return Err(fail("does not link", gl.get_program_info_log(raw)));
            }
            gl.use_program(Some(raw));
            for (unit, name) in source.samplers.iter().enumerate() {
                let location = gl.get_uniform_location(raw, name);
                // A shader that is being edited may not need all that it has.
                assert!(!cfg!(test) || location.is_some(), "{}: sampler {name} is not used", source.name);
                gl.uniform_1_i32(location.as_ref(), unit as i32);
            }
            for (binding, name) in BLOCKS.iter().enumerate() {
                if let Some(index) = gl.get_uniform_block_index(raw, name) {
                    gl.uniform_block_binding(raw, index, binding as u32);
                }
            }
            Ok(program)
        }
    }

    /// Name and offset in bytes of every active uniform of a block, as the driver lays them out; `None` if the
    /// program has no such block.
    #[cfg(test)]
    pub fn block_layout(&self, block: &str) -> Option<Vec<(String, usize)>> {
        let gl = &self.context.gl;
        // SAFETY: see `Context::new`; the indices come from the driver.
        unsafe {
            let block = gl.get_uniform_block_index(self.raw, block)? as i32;
            let mut layout = Vec::new();
            for index in 0..gl.get_active_uniforms(self.raw) {
                let parameter = |name| gl.get_active_uniforms_parameter(self.raw, &[index], name)[0];
                if parameter(glow::UNIFORM_BLOCK_INDEX) == block {
                    let name = gl.get_active_uniform(self.raw, index)?.name;
                    layout.push((name.trim_end_matches("[0]").to_owned(), parameter(glow::UNIFORM_OFFSET) as usize));
                }
            }
            Some(layout)
        }
    }

    /// Makes it the program in use.
    pub fn bind(&self) {
        // SAFETY: see `Context::new`.
        unsafe { self.context.gl.use_program(Some(self.raw)) }
    }

    /// Draws one triangle that covers the viewport, without vertex attributes.
    pub fn draw_full_screen(&self) {
        self.draw_without_attributes(glow::TRIANGLES, 3);
    }

    /// Draws `count` points, without vertex attributes.
    pub fn draw_points(&self, count: u32) {
        self.draw_without_attributes(glow::POINTS, count);
    }

    /// Runs so many workgroups along each axis. They see all that was drawn and computed before, and whatever follows sees
    /// what they write.
    pub fn dispatch(&self, groups: [u32; 3]) {
        debug_assert!(groups.iter().all(|&n| n <= MOST_GROUPS));
        self.bind();
        // What follows fetches, draws over or reads back textures, or computes with the same images.
        let all =
            glow::TEXTURE_FETCH_BARRIER_BIT | glow::SHADER_IMAGE_ACCESS_BARRIER_BIT | glow::FRAMEBUFFER_BARRIER_BIT;
        let gl = &self.context.gl;
        // SAFETY: see `Context::new`; a program that computes is made where there are compute shaders alone.
        unsafe {
            // Images that are written may still be read by what was drawn before.
            gl.memory_barrier(glow::SHADER_IMAGE_ACCESS_BARRIER_BIT);
            gl.dispatch_compute(groups[0], groups[1], groups[2]);
            gl.memory_barrier(all);
        }
    }

    fn draw_without_attributes(&self, mode: u32, count: u32) {
        self.bind();
        // SAFETY: see `Context::new`; an empty vertex array reads no memory.
        unsafe {
            self.context.gl.bind_vertex_array(Some(self.empty_vao));
            self.context.gl.draw_arrays(mode, 0, count as i32);
        }
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        // SAFETY: see `Context::new`; both are ours.
        unsafe {
            self.context.gl.delete_program(self.raw);
            self.context.gl.delete_vertex_array(self.empty_vao);
        }
    }
}
