//! The caller's context, what its driver can do, and what it complains about.

use std::rc::Rc;
use std::sync::{Arc, Mutex};

use glow::HasContext;

use crate::{Error, Result};

/// What the driver is and can do.
#[derive(Clone, Debug)]
pub struct DriverInfo {
    /// The company.
    pub vendor: String,
    /// The device.
    pub renderer: String,
    /// Version of OpenGL or OpenGL ES and of the driver.
    pub version: String,
    /// Version of the shading language.
    pub glsl: String,
    /// True on OpenGL ES (and WebGL), false on desktop OpenGL.
    pub es: bool,
    /// Which set of shaders is used.
    pub tier: &'static str,
    /// Largest edge of a texture, texels.
    pub max_texture_size: u32,
    /// Largest width and height of a picture, pixels.
    pub max_viewport: [u32; 2],
    /// Largest uniform block, bytes.
    pub max_uniform_block: u32,
    /// Largest point that is splatted, pixels.
    pub max_point_size: f32,
    /// GPU times can be measured.
    pub timer_queries: bool,
    /// Compute shaders are there (OpenGL 4.3).
    pub compute: bool,
}

/// An OpenGL 3.3 or OpenGL ES 3.0 context that the caller made and keeps current.
pub struct Context {
    pub(super) gl: glow::Context,
    info: DriverInfo,
    complaints: Arc<Mutex<Vec<String>>>,
}

impl Context {
    /// Takes a context. Fails with [`Error::NoContext`] if it is older than OpenGL 3.3 or OpenGL ES 3.0, or cannot
    /// render to float textures.
    ///
    /// # Safety
    ///
    /// The context must be current on this thread now, and whenever this value or anything made from it is used or
    /// dropped.
    pub unsafe fn new(mut gl: glow::Context) -> Result<Rc<Self>> {
        let complaints = Arc::new(Mutex::new(Vec::new()));
        let version = gl.version().clone();
        let (major, minor, es) = (version.major, version.minor, version.is_embedded);
        let needed = if es { (3, 0) } else { (3, 3) };
        if (major, minor) < needed {
            return Err(Error::NoContext(format!(
                "the driver gives OpenGL {}{major}.{minor}; OpenGL 3.3 or OpenGL ES 3.0 is needed",
                if es { "ES " } else { "" }
            )));
        }
        let has = |name: &str| gl.supported_extensions().contains(name);
        if es && !has("GL_EXT_color_buffer_float") && (major, minor) < (3, 2) {
            return Err(Error::NoContext("the driver cannot render to float textures (EXT_color_buffer_float)".into()));
        }
        let timer_queries = !es || has("GL_EXT_disjoint_timer_query");
        let compute = !es && (major, minor) >= (4, 3);
        // SAFETY: the caller vouches for the context; every parameter is of OpenGL 3.3 and ES 3.0.
        let info = unsafe {
            let mut viewport = [0; 2];
            gl.get_parameter_i32_slice(glow::MAX_VIEWPORT_DIMS, &mut viewport);
            let mut points = [0.0; 2];
            gl.get_parameter_f32_slice(glow::ALIASED_POINT_SIZE_RANGE, &mut points);
            DriverInfo {
                vendor: gl.get_parameter_string(glow::VENDOR),
                renderer: gl.get_parameter_string(glow::RENDERER),
                version: gl.get_parameter_string(glow::VERSION),
                glsl: gl.get_parameter_string(glow::SHADING_LANGUAGE_VERSION),
                es,
                tier: if es { "OpenGL ES 3.0 fragment" } else { "OpenGL 3.3 fragment" },
                max_texture_size: gl.get_parameter_i32(glow::MAX_TEXTURE_SIZE).max(0) as u32,
                max_viewport: viewport.map(|x| x.max(0) as u32),
                max_uniform_block: gl.get_parameter_i32(glow::MAX_UNIFORM_BLOCK_SIZE).max(0) as u32,
                max_point_size: points[1],
                timer_queries,
                compute,
            }
        };
        if cfg!(debug_assertions) && gl.supports_debug() {
            let sink = complaints.clone();
            // SAFETY: as above; the callback owns all that it touches.
            unsafe {
                gl.enable(glow::DEBUG_OUTPUT);
                gl.enable(glow::DEBUG_OUTPUT_SYNCHRONOUS);
                gl.debug_message_callback(move |_source, kind, _id, _severity, message| {
                    if kind == glow::DEBUG_TYPE_ERROR || kind == glow::DEBUG_TYPE_UNDEFINED_BEHAVIOR {
                        if let Ok(mut list) = sink.lock() {
                            list.push(message.trim().to_owned());
                        }
                    } else {
                        log::debug!("driver: {}", message.trim());
                    }
                });
            }
        }
        Ok(Rc::new(Self { gl, info, complaints }))
    }

    /// What the driver is and can do.
    pub fn info(&self) -> &DriverInfo {
        &self.info
    }

    /// Fails if the driver has raised an error since the last call; `after` says what has just been done.
    pub(crate) fn check(&self, after: &str) -> Result<()> {
        // SAFETY: see `Context::new`.
        let code = unsafe { self.gl.get_error() };
        let complaints = self.complaints.lock().map(|mut list| std::mem::take(&mut *list)).unwrap_or_default();
        let name = match code {
            glow::NO_ERROR if complaints.is_empty() => return Ok(()),
            glow::NO_ERROR => "error",
            glow::INVALID_ENUM => "invalid enum",
            glow::INVALID_VALUE => "invalid value",
            glow::INVALID_OPERATION => "invalid operation",
            glow::INVALID_FRAMEBUFFER_OPERATION => "invalid framebuffer operation",
            glow::OUT_OF_MEMORY => "out of memory",
            _ => "unknown error",
        };
        let details = complaints.into_iter().next().map_or(String::new(), |text| format!(": {text}"));
        Err(Error::Gl(format!("{name} in {after}{details}").replace('\n', " ")))
    }

    /// Does what OpenGL does not allow.
    #[cfg(test)]
    pub fn provoke_an_error(&self) {
        // SAFETY: see `Context::new`; a wrong capability only raises an error.
        unsafe { self.gl.enable(0xdead) }
    }

    /// Waits until the GPU has done everything that it was asked.
    pub(crate) fn finish(&self) {
        // SAFETY: see `Context::new`.
        unsafe { self.gl.finish() }
    }
}
