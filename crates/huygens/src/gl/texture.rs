//! Textures and samplers.

use std::cell::Cell;
use std::rc::Rc;

use glow::HasContext;

use super::Context;
use crate::scene::{Sampler, Wrap};
use crate::{Error, Result};

/// The formats in use; each can be rendered to in OpenGL 3.3 and in ES 3.0 with float targets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Format {
    Rgba8,
    Srgba8,
    R16F,
    Rgba16F,
    Rgba32F,
    Rgba32Ui,
    Depth32F,
}

impl Format {
    /// Internal format, format and type of the data, bytes a texel.
    pub(super) fn gl(self) -> (u32, u32, u32, usize) {
        match self {
            Format::Rgba8 => (glow::RGBA8, glow::RGBA, glow::UNSIGNED_BYTE, 4),
            Format::Srgba8 => (glow::SRGB8_ALPHA8, glow::RGBA, glow::UNSIGNED_BYTE, 4),
            Format::R16F => (glow::R16F, glow::RED, glow::HALF_FLOAT, 2),
            Format::Rgba16F => (glow::RGBA16F, glow::RGBA, glow::HALF_FLOAT, 8),
            Format::Rgba32F => (glow::RGBA32F, glow::RGBA, glow::FLOAT, 16),
            Format::Rgba32Ui => (glow::RGBA32UI, glow::RGBA_INTEGER, glow::UNSIGNED_INT, 16),
            Format::Depth32F => (glow::DEPTH_COMPONENT32F, glow::DEPTH_COMPONENT, glow::FLOAT, 4),
        }
    }
}

/// How a texture that is not a material's is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Filter {
    /// Nearest texel, clamped.
    Nearest,
    /// Linear within the texel grid and between mip levels, clamped.
    Trilinear,
    /// Depth comparison (less or equal), bilinear, clamped.
    Compare,
}

/// A two-dimensional texture.
pub(crate) struct Texture {
    context: Rc<Context>,
    pub(super) raw: glow::Texture,
    pub(super) format: Format,
    pub width: u32,
    pub height: u32,
    mipmapped: Cell<bool>,
}

impl Texture {
    /// Without content, one level, read to the nearest texel or through a sampler object.
    pub fn new(context: &Rc<Context>, format: Format, width: u32, height: u32) -> Result<Self> {
        Self::with_pixels(context, format, width, height, None)
    }

    /// With content: `width · height` texels of the format, tightly packed, first row first.
    pub fn with_pixels(
        context: &Rc<Context>,
        format: Format,
        width: u32,
        height: u32,
        pixels: Option<&[u8]>,
    ) -> Result<Self> {
        let (.., texel) = format.gl();
        assert!(pixels.is_none_or(|p| p.len() == width as usize * height as usize * texel));
        let gl = &context.gl;
        // SAFETY: see `Context::new`.
        let raw = unsafe {
            let raw = gl.create_texture().map_err(Error::Gl)?;
            gl.active_texture(glow::TEXTURE0);
            gl.bind_texture(glow::TEXTURE_2D, Some(raw));
            gl.tex_parameter_i32(glow::TEXTURE_2D, glow::TEXTURE_MIN_FILTER, glow::NEAREST as i32);
            gl.tex_parameter_i32(glow::TEXTURE_2D, glow::TEXTURE_MAG_FILTER, glow::NEAREST as i32);
            gl.tex_parameter_i32(glow::TEXTURE_2D, glow::TEXTURE_WRAP_S, glow::CLAMP_TO_EDGE as i32);
            gl.tex_parameter_i32(glow::TEXTURE_2D, glow::TEXTURE_WRAP_T, glow::CLAMP_TO_EDGE as i32);
            gl.tex_parameter_i32(glow::TEXTURE_2D, glow::TEXTURE_MAX_LEVEL, 0);
            raw
        };
        let mut texture =
            Self { context: context.clone(), raw, format, width: 0, height: 0, mipmapped: Cell::new(false) };
        texture.store(width, height, pixels)?;
        Ok(texture)
    }

    /// Another size under the same name; the content is gone.
    pub fn resize(&mut self, width: u32, height: u32) -> Result<()> {
        self.store(width, height, None)
    }

    /// `pixels`, if there are any, are as many as the size and the format say.
    fn store(&mut self, width: u32, height: u32, pixels: Option<&[u8]>) -> Result<()> {
        let limit = self.context.info().max_texture_size;
        let (internal, layout, kind, _) = self.format.gl();
        if width > limit || height > limit {
            return Err(Error::Gl(format!("a texture of {width}x{height} is needed; the driver allows {limit}")));
        }
        let before = self.bytes();
        // SAFETY: see `Context::new`; the length of the pixels was checked where they came in.
        unsafe {
            let gl = &self.context.gl;
            gl.active_texture(glow::TEXTURE0);
            gl.bind_texture(glow::TEXTURE_2D, Some(self.raw));
            self.context.pack_tightly();
            gl.tex_image_2d(
                glow::TEXTURE_2D,
                0,
                internal as i32,
                width as i32,
                height as i32,
                0,
                layout,
                kind,
                glow::PixelUnpackData::Slice(pixels),
            );
        }
        (self.width, self.height) = (width, height);
        count(&self.context, before, self.bytes());
        self.context.check("making a texture")
    }

    fn bytes(&self) -> u64 {
        let (.., texel) = self.format.gl();
        let base = u64::from(self.width) * u64::from(self.height) * texel as u64;
        if self.mipmapped.get() { base * 4 / 3 } else { base }
    }

    /// The driver's name for it.
    pub fn native(&self) -> glow::Texture {
        self.raw
    }

    /// Shows it smoothly where it is enlarged, to code that binds no sampler.
    pub fn smooth(&self) {
        // SAFETY: see `Context::new`.
        unsafe {
            let gl = &self.context.gl;
            gl.active_texture(glow::TEXTURE0);
            gl.bind_texture(glow::TEXTURE_2D, Some(self.raw));
            gl.tex_parameter_i32(glow::TEXTURE_2D, glow::TEXTURE_MAG_FILTER, glow::LINEAR as i32);
        }
    }

    /// Makes all mip levels from the first.
    pub fn generate_mipmap(&self) {
        // SAFETY: see `Context::new`.
        unsafe {
            let gl = &self.context.gl;
            gl.active_texture(glow::TEXTURE0);
            gl.bind_texture(glow::TEXTURE_2D, Some(self.raw));
            gl.tex_parameter_i32(glow::TEXTURE_2D, glow::TEXTURE_MAX_LEVEL, 1000);
            gl.generate_mipmap(glow::TEXTURE_2D);
        }
        let before = self.bytes();
        self.mipmapped.set(true);
        count(&self.context, before, self.bytes());
    }

    /// Binds it to an image unit, for compute shaders to read and write.
    pub fn bind_image(&self, unit: u32) {
        let (internal, ..) = self.format.gl();
        // SAFETY: see `Context::new`; shaders that have images run where there are compute shaders alone.
        unsafe {
            self.context.gl.bind_image_texture(unit, Some(self.raw), 0, false, 0, glow::READ_WRITE, internal);
        }
    }

    /// Binds it to a unit, to be read to the nearest texel, by `texelFetch` or its own parameters, or through `sampler`.
    pub fn bind(&self, unit: u32, sampler: Option<&SamplerObject>) {
        bind(&self.context, glow::TEXTURE_2D, self.raw, unit, sampler);
    }
}

impl Drop for Texture {
    fn drop(&mut self) {
        count(&self.context, self.bytes(), 0);
        // SAFETY: see `Context::new`; it is ours.
        unsafe { self.context.gl.delete_texture(self.raw) }
    }
}

/// A cube map with square faces.
pub(crate) struct TextureCube {
    context: Rc<Context>,
    pub(super) raw: glow::Texture,
    bytes: u64,
}

impl TextureCube {
    /// Without content.
    pub fn new(context: &Rc<Context>, format: Format, size: u32) -> Result<Self> {
        let (internal, layout, kind, texel) = format.gl();
        let gl = &context.gl;
        // SAFETY: see `Context::new`; no data is passed.
        unsafe {
            let raw = gl.create_texture().map_err(Error::Gl)?;
            gl.active_texture(glow::TEXTURE0);
            gl.bind_texture(glow::TEXTURE_CUBE_MAP, Some(raw));
            context.pack_tightly();
            gl.tex_parameter_i32(glow::TEXTURE_CUBE_MAP, glow::TEXTURE_MIN_FILTER, glow::NEAREST as i32);
            gl.tex_parameter_i32(glow::TEXTURE_CUBE_MAP, glow::TEXTURE_MAG_FILTER, glow::NEAREST as i32);
            gl.tex_parameter_i32(glow::TEXTURE_CUBE_MAP, glow::TEXTURE_MAX_LEVEL, 0);
            for face in 0..6 {
                gl.tex_image_2d(
                    glow::TEXTURE_CUBE_MAP_POSITIVE_X + face,
                    0,
                    internal as i32,
                    size as i32,
                    size as i32,
                    0,
                    layout,
                    kind,
                    glow::PixelUnpackData::Slice(None),
                );
            }
            let texture = Self { context: context.clone(), raw, bytes: 6 * u64::from(size).pow(2) * texel as u64 };
            count(context, 0, texture.bytes);
            context.check("making a cube map")?;
            Ok(texture)
        }
    }

    /// Makes all mip levels from the first.
    pub fn generate_mipmap(&self) {
        // SAFETY: see `Context::new`.
        unsafe {
            let gl = &self.context.gl;
            gl.active_texture(glow::TEXTURE0);
            gl.bind_texture(glow::TEXTURE_CUBE_MAP, Some(self.raw));
            gl.tex_parameter_i32(glow::TEXTURE_CUBE_MAP, glow::TEXTURE_MAX_LEVEL, 1000);
            gl.generate_mipmap(glow::TEXTURE_CUBE_MAP);
        }
    }

    /// Binds it to a unit, to be read through `sampler`.
    pub fn bind(&self, unit: u32, sampler: &SamplerObject) {
        bind(&self.context, glow::TEXTURE_CUBE_MAP, self.raw, unit, Some(sampler));
    }
}

impl Drop for TextureCube {
    fn drop(&mut self) {
        count(&self.context, self.bytes, 0);
        // SAFETY: see `Context::new`; it is ours.
        unsafe { self.context.gl.delete_texture(self.raw) }
    }
}

/// Takes note of what takes so many bytes now.
fn count(context: &Context, before: u64, now: u64) {
    context.memory.set((context.memory.get() + now).saturating_sub(before));
}

fn bind(context: &Context, target: u32, raw: glow::Texture, unit: u32, sampler: Option<&SamplerObject>) {
    // SAFETY: see `Context::new`.
    unsafe {
        context.gl.active_texture(glow::TEXTURE0 + unit);
        context.gl.bind_texture(target, Some(raw));
        context.gl.bind_sampler(unit, sampler.map(|s| s.raw));
    }
}

/// How a texture is read, apart from the texture.
pub(crate) struct SamplerObject {
    context: Rc<Context>,
    raw: glow::Sampler,
}

impl SamplerObject {
    /// For the renderer's own textures.
    pub fn new(context: &Rc<Context>, filter: Filter) -> Result<Self> {
        let (min, mag) = match filter {
            Filter::Nearest => (glow::NEAREST, glow::NEAREST),
            Filter::Trilinear => (glow::LINEAR_MIPMAP_LINEAR, glow::LINEAR),
            Filter::Compare => (glow::NEAREST, glow::NEAREST),
        };
        let edge = glow::CLAMP_TO_EDGE;
        let compare = if filter == Filter::Compare { glow::COMPARE_REF_TO_TEXTURE } else { glow::NONE };
        Self::with_parameters(
            context,
            &[
                (glow::TEXTURE_MIN_FILTER, min),
                (glow::TEXTURE_MAG_FILTER, mag),
                (glow::TEXTURE_WRAP_S, edge),
                (glow::TEXTURE_WRAP_T, edge),
                (glow::TEXTURE_WRAP_R, edge),
                (glow::TEXTURE_COMPARE_MODE, compare),
                (glow::TEXTURE_COMPARE_FUNC, glow::LEQUAL),
            ],
        )
    }

    /// As a material's texture asks for.
    pub fn for_material(context: &Rc<Context>, sampler: &Sampler) -> Result<Self> {
        let min = match (sampler.min_linear, sampler.mip_linear) {
            (false, None) => glow::NEAREST,
            (true, None) => glow::LINEAR,
            (false, Some(false)) => glow::NEAREST_MIPMAP_NEAREST,
            (true, Some(false)) => glow::LINEAR_MIPMAP_NEAREST,
            (false, Some(true)) => glow::NEAREST_MIPMAP_LINEAR,
            (true, Some(true)) => glow::LINEAR_MIPMAP_LINEAR,
        };
        let wrap = |wrap| match wrap {
            Wrap::Clamp => glow::CLAMP_TO_EDGE,
            Wrap::Mirror => glow::MIRRORED_REPEAT,
            Wrap::Repeat => glow::REPEAT,
        };
        Self::with_parameters(
            context,
            &[
                (glow::TEXTURE_MIN_FILTER, min),
                (glow::TEXTURE_MAG_FILTER, if sampler.mag_linear { glow::LINEAR } else { glow::NEAREST }),
                (glow::TEXTURE_WRAP_S, wrap(sampler.wrap_u)),
                (glow::TEXTURE_WRAP_T, wrap(sampler.wrap_v)),
            ],
        )
    }

    fn with_parameters(context: &Rc<Context>, parameters: &[(u32, u32)]) -> Result<Self> {
        // SAFETY: see `Context::new`.
        unsafe {
            let raw = context.gl.create_sampler().map_err(Error::Gl)?;
            for &(name, value) in parameters {
                context.gl.sampler_parameter_i32(raw, name, value as i32);
            }
            Ok(Self { context: context.clone(), raw })
        }
    }
}

impl Drop for SamplerObject {
    fn drop(&mut self) {
        // SAFETY: see `Context::new`; it is ours.
        unsafe { self.context.gl.delete_sampler(self.raw) }
    }
}
