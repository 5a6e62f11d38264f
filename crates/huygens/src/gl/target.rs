//! Render targets: framebuffers that own the textures they draw to.

use std::rc::Rc;

use bytemuck::Pod;
use glow::HasContext;

use super::{Context, Format, Texture, TextureCube};
use crate::{Error, Result};

/// A framebuffer with its textures.
pub(crate) struct Target {
    context: Rc<Context>,
    raw: glow::Framebuffer,
    colors: Vec<Texture>,
    depth: Option<Texture>,
    pub width: u32,
    pub height: u32,
}

impl Target {
    /// Colour textures of those formats, and a depth texture if `depth`.
    pub fn new(context: &Rc<Context>, colors: &[Format], depth: bool, width: u32, height: u32) -> Result<Self> {
        let colors: Vec<Texture> =
            colors.iter().map(|&format| Texture::new(context, format, width, height)).collect::<Result<_>>()?;
        let depth = depth.then(|| Texture::new(context, Format::Depth32F, width, height)).transpose()?;
        let gl = &context.gl;
        // SAFETY: see `Context::new`.
        unsafe {
            let raw = gl.create_framebuffer().map_err(Error::Gl)?;
            let target = Self { context: context.clone(), raw, colors, depth, width, height };
            gl.bind_framebuffer(glow::FRAMEBUFFER, Some(raw));
            for (i, texture) in target.colors.iter().enumerate() {
                let point = glow::COLOR_ATTACHMENT0 + i as u32;
                gl.framebuffer_texture_2d(glow::FRAMEBUFFER, point, glow::TEXTURE_2D, Some(texture.raw), 0);
            }
            if let Some(texture) = &target.depth {
                let point = glow::DEPTH_ATTACHMENT;
                gl.framebuffer_texture_2d(glow::FRAMEBUFFER, point, glow::TEXTURE_2D, Some(texture.raw), 0);
            }
            set_draw_buffers(gl, target.colors.len());
            complete(gl)?;
            Ok(target)
        }
    }

    /// Another size; the textures keep their names and lose their content.
    pub fn resize(&mut self, width: u32, height: u32) -> Result<()> {
        for texture in self.colors.iter_mut().chain(&mut self.depth) {
            texture.resize(width, height)?;
        }
        (self.width, self.height) = (width, height);
        Ok(())
    }

    /// Draws go here from now on.
    pub fn bind(&self) {
        // SAFETY: see `Context::new`.
        unsafe { self.context.gl.bind_framebuffer(glow::FRAMEBUFFER, Some(self.raw)) }
    }

    /// Binds it and fills all of it: colours with zero, depth with the far end.
    pub fn clear(&self) {
        self.clear_rows(0..self.height);
    }

    /// Binds it and fills those rows as [`Self::clear`] does.
    pub fn clear_rows(&self, rows: std::ops::Range<u32>) {
        self.fill_rows(rows, 0.0);
    }

    /// Binds it and fills depth with the far end.
    pub fn clear_depth(&self) {
        self.bind();
        let gl = &self.context.gl;
        // SAFETY: see `Context::new`. The masks of the last draw would hold the clear back.
        unsafe {
            gl.disable(glow::SCISSOR_TEST);
            gl.disable(glow::RASTERIZER_DISCARD);
            gl.depth_mask(true);
            gl.clear_buffer_f32_slice(glow::DEPTH, 0, &[1.0]);
        }
    }

    /// Binds it and fills it with that number; depth is 1.
    pub fn fill(&self, color: f32) {
        self.fill_rows(0..self.height, color);
    }

    fn fill_rows(&self, rows: std::ops::Range<u32>, color: f32) {
        self.bind();
        let gl = &self.context.gl;
        // SAFETY: see `Context::new`. The masks of the last draw would hold clears back.
        unsafe {
            gl.enable(glow::SCISSOR_TEST);
            gl.scissor(0, rows.start as i32, self.width as i32, (rows.end - rows.start) as i32);
            gl.disable(glow::RASTERIZER_DISCARD);
            gl.color_mask(true, true, true, true);
            gl.depth_mask(true);
            for (i, texture) in self.colors.iter().enumerate() {
                match texture.format {
                    Format::Rgba32Ui => gl.clear_buffer_u32_slice(glow::COLOR, i as u32, &[color as u32; 4]),
                    _ => gl.clear_buffer_f32_slice(glow::COLOR, i as u32, &[color; 4]),
                }
            }
            if self.depth.is_some() {
                gl.clear_buffer_f32_slice(glow::DEPTH, 0, &[1.0]);
            }
            gl.disable(glow::SCISSOR_TEST);
        }
    }

    /// Its colour textures.
    pub fn colors(&self) -> &[Texture] {
        &self.colors
    }

    /// The colour texture with that index.
    pub fn color(&self, index: usize) -> &Texture {
        &self.colors[index]
    }

    /// The depth texture of a target that was made with one.
    pub fn depth(&self) -> &Texture {
        self.depth.as_ref().expect("made with a depth texture")
    }

    /// Waits for the GPU and returns a colour texture, first row at the bottom. `T` is a texel of its format
    /// (float targets are read as four 32-bit floats).
    pub fn read<T: Pod>(&self, index: usize) -> Vec<T> {
        let (layout, kind, texel) = match self.colors[index].format {
            Format::Rgba32Ui => (glow::RGBA_INTEGER, glow::UNSIGNED_INT, 16),
            Format::Rgba8 => (glow::RGBA, glow::UNSIGNED_BYTE, 4),
            _ => (glow::RGBA, glow::FLOAT, 16),
        };
        assert_eq!(size_of::<T>(), texel);
        let mut pixels = vec![T::zeroed(); self.width as usize * self.height as usize];
        self.bind();
        let gl = &self.context.gl;
        // SAFETY: see `Context::new`; the buffer holds width · height texels, packed.
        unsafe {
            self.context.pack_tightly();
            gl.read_buffer(glow::COLOR_ATTACHMENT0 + index as u32);
            gl.read_pixels(
                0,
                0,
                self.width as i32,
                self.height as i32,
                layout,
                kind,
                glow::PixelPackData::Slice(Some(bytemuck::cast_slice_mut(&mut pixels))),
            );
            gl.read_buffer(glow::COLOR_ATTACHMENT0);
        }
        pixels
    }
}

#[cfg(test)]
impl Context {
    /// Whatever other code finds in an 8-bit texture of that size, first row at the bottom; waits for the GPU.
    pub fn read_texture(&self, texture: glow::Texture, width: u32, height: u32) -> Vec<[u8; 4]> {
        let mut pixels = vec![[0; 4]; width as usize * height as usize];
        let into = glow::PixelPackData::Slice(Some(pixels.as_flattened_mut()));
        let gl = &self.gl;
        // SAFETY: see `Context::new`; the buffer holds width · height texels, packed.
        unsafe {
            let raw = gl.create_framebuffer().unwrap();
            gl.bind_framebuffer(glow::FRAMEBUFFER, Some(raw));
            let point = glow::COLOR_ATTACHMENT0;
            gl.framebuffer_texture_2d(glow::FRAMEBUFFER, point, glow::TEXTURE_2D, Some(texture), 0);
            self.pack_tightly();
            gl.read_pixels(0, 0, width as i32, height as i32, glow::RGBA, glow::UNSIGNED_BYTE, into);
            gl.delete_framebuffer(raw);
        }
        pixels
    }
}

/// A read-back that does not wait: pixels go to a buffer, and a fence tells when they are there.
pub(crate) struct Readback {
    context: Rc<Context>,
    buffer: glow::Buffer,
    fence: glow::Fence,
    bytes: usize,
}

impl Readback {
    /// Asks for the first colour texture of a target, of 32-bit floats.
    pub fn start(target: &Target) -> Result<Self> {
        let context = &target.context;
        let gl = &context.gl;
        let bytes = target.width as usize * target.height as usize * 16;
        target.bind();
        // SAFETY: see `Context::new`; the buffer holds width · height texels, packed.
        unsafe {
            context.pack_tightly();
            let buffer = gl.create_buffer().map_err(Error::Gl)?;
            gl.bind_buffer(glow::PIXEL_PACK_BUFFER, Some(buffer));
            gl.buffer_data_size(glow::PIXEL_PACK_BUFFER, bytes as i32, glow::STREAM_READ);
            gl.read_buffer(glow::COLOR_ATTACHMENT0);
            let (width, height) = (target.width as i32, target.height as i32);
            let into = glow::PixelPackData::BufferOffset(0);
            gl.read_pixels(0, 0, width, height, glow::RGBA, glow::FLOAT, into);
            gl.bind_buffer(glow::PIXEL_PACK_BUFFER, None);
            let fence = gl.fence_sync(glow::SYNC_GPU_COMMANDS_COMPLETE, 0).map_err(|e| {
                gl.delete_buffer(buffer);
                Error::Gl(e)
            })?;
            gl.flush();
            Ok(Self { context: context.clone(), buffer, fence, bytes })
        }
    }

    /// Whether the pixels are there.
    pub fn is_ready(&self) -> bool {
        // SAFETY: see `Context::new`; the fence is ours.
        unsafe { self.context.gl.get_sync_status(self.fence) == glow::SIGNALED }
    }

    /// The pixels, rows from the bottom; waits if they are not there.
    pub fn read(self) -> Vec<[f32; 4]> {
        let mut pixels = vec![[0.0; 4]; self.bytes / 16];
        let gl = &self.context.gl;
        // SAFETY: see `Context::new`; the buffer has so many bytes, and what is mapped is copied before it is unmapped.
        unsafe {
            gl.bind_buffer(glow::PIXEL_PACK_BUFFER, Some(self.buffer));
            let mapped = gl.map_buffer_range(glow::PIXEL_PACK_BUFFER, 0, self.bytes as i32, glow::MAP_READ_BIT);
            if !mapped.is_null() {
                let bytes = std::slice::from_raw_parts(mapped, self.bytes);
                bytemuck::cast_slice_mut::<_, u8>(&mut pixels).copy_from_slice(bytes);
                gl.unmap_buffer(glow::PIXEL_PACK_BUFFER);
            }
            gl.bind_buffer(glow::PIXEL_PACK_BUFFER, None);
        }
        pixels
    }
}

impl Drop for Readback {
    fn drop(&mut self) {
        // SAFETY: see `Context::new`; both are ours.
        unsafe {
            self.context.gl.delete_sync(self.fence);
            self.context.gl.delete_buffer(self.buffer);
        }
    }
}

/// A framebuffer that draws to what two targets have, which are of one size.
pub(crate) struct JointTarget {
    context: Rc<Context>,
    raw: glow::Framebuffer,
}

impl JointTarget {
    /// For targets with such formats; an error where the driver cannot draw to all at once.
    pub fn new(context: &Rc<Context>, first: &Target, second: &Target) -> Result<Self> {
        // SAFETY: see `Context::new`.
        let raw = unsafe { context.gl.create_framebuffer() }.map_err(Error::Gl)?;
        let joint = Self { context: context.clone(), raw };
        joint.bind(first, second);
        // SAFETY: see `Context::new`.
        unsafe {
            set_draw_buffers(&context.gl, first.colors.len() + second.colors.len());
            complete(&context.gl)?;
        }
        Ok(joint)
    }

    /// Draws go to the colours of the first and then to those of the second from now on, with the depth of the second.
    pub fn bind(&self, first: &Target, second: &Target) {
        let gl = &self.context.gl;
        // SAFETY: see `Context::new`.
        unsafe {
            gl.bind_framebuffer(glow::FRAMEBUFFER, Some(self.raw));
            for (i, texture) in first.colors.iter().chain(&second.colors).enumerate() {
                let point = glow::COLOR_ATTACHMENT0 + i as u32;
                gl.framebuffer_texture_2d(glow::FRAMEBUFFER, point, glow::TEXTURE_2D, Some(texture.raw), 0);
            }
            let depth = Some(second.depth().raw);
            gl.framebuffer_texture_2d(glow::FRAMEBUFFER, glow::DEPTH_ATTACHMENT, glow::TEXTURE_2D, depth, 0);
        }
    }
}

impl Drop for JointTarget {
    fn drop(&mut self) {
        // SAFETY: see `Context::new`; it is ours, its textures are the targets'.
        unsafe { self.context.gl.delete_framebuffer(self.raw) }
    }
}

impl Drop for Target {
    fn drop(&mut self) {
        // SAFETY: see `Context::new`; it is ours.
        unsafe { self.context.gl.delete_framebuffer(self.raw) }
    }
}

/// A framebuffer over the faces of a cube map: depth, and one colour if it was asked for.
pub(crate) struct CubeTarget {
    context: Rc<Context>,
    raw: glow::Framebuffer,
    pub color: Option<TextureCube>,
    pub depth: TextureCube,
    pub size: u32,
}

impl CubeTarget {
    /// Square faces of `size` texels.
    pub fn new(context: &Rc<Context>, color: Option<Format>, size: u32) -> Result<Self> {
        let color = color.map(|format| TextureCube::new(context, format, size)).transpose()?;
        let depth = TextureCube::new(context, Format::Depth32F, size)?;
        // SAFETY: see `Context::new`.
        let raw = unsafe { context.gl.create_framebuffer() }.map_err(Error::Gl)?;
        let target = Self { context: context.clone(), raw, color, depth, size };
        target.clear_face(0);
        // SAFETY: see `Context::new`.
        unsafe { complete(&context.gl)? };
        Ok(target)
    }

    /// Binds one face (0…5: +x −x +y −y +z −z) and fills it: colour with zero, depth with the far end.
    pub fn clear_face(&self, face: u32) {
        let gl = &self.context.gl;
        let side = glow::TEXTURE_CUBE_MAP_POSITIVE_X + face;
        // SAFETY: see `Context::new`.
        unsafe {
            gl.bind_framebuffer(glow::FRAMEBUFFER, Some(self.raw));
            gl.framebuffer_texture_2d(glow::FRAMEBUFFER, glow::DEPTH_ATTACHMENT, side, Some(self.depth.raw), 0);
            if let Some(color) = &self.color {
                gl.framebuffer_texture_2d(glow::FRAMEBUFFER, glow::COLOR_ATTACHMENT0, side, Some(color.raw), 0);
            }
            set_draw_buffers(gl, usize::from(self.color.is_some()));
            gl.disable(glow::SCISSOR_TEST);
            gl.disable(glow::RASTERIZER_DISCARD);
            gl.color_mask(true, true, true, true);
            gl.depth_mask(true);
            if self.color.is_some() {
                gl.clear_buffer_f32_slice(glow::COLOR, 0, &[0.0; 4]);
            }
            gl.clear_buffer_f32_slice(glow::DEPTH, 0, &[1.0]);
        }
    }
}

impl Drop for CubeTarget {
    fn drop(&mut self) {
        // SAFETY: see `Context::new`; it is ours.
        unsafe { self.context.gl.delete_framebuffer(self.raw) }
    }
}

/// SAFETY: a framebuffer of the current context is bound.
unsafe fn set_draw_buffers(gl: &glow::Context, colors: usize) {
    let buffers: Vec<u32> = (0..colors as u32).map(|i| glow::COLOR_ATTACHMENT0 + i).collect();
    // SAFETY: the caller's.
    unsafe {
        if buffers.is_empty() {
            gl.draw_buffers(&[glow::NONE]);
            gl.read_buffer(glow::NONE);
        } else {
            gl.draw_buffers(&buffers);
        }
    }
}

/// SAFETY: a framebuffer of the current context is bound.
unsafe fn complete(gl: &glow::Context) -> Result<()> {
    // SAFETY: the caller's.
    match unsafe { gl.check_framebuffer_status(glow::FRAMEBUFFER) } {
        glow::FRAMEBUFFER_COMPLETE => Ok(()),
        status => Err(Error::Gl(format!("the driver does not render to this target (status {status:#x})"))),
    }
}
