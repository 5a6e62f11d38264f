//! The caller's context, what its driver can do, and what it complains about.

use std::any::Any;
use std::cell::{Cell, RefCell};
use std::rc::Rc;
use std::sync::{Arc, Mutex};

use glow::HasContext;

use crate::shaders::Texts;
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
    /// Which set of shaders is used where the settings leave it to the driver.
    pub tier: &'static str,
    /// It draws on the CPU.
    pub software: bool,
    /// Largest edge of a texture, texels.
    pub max_texture_size: u32,
    /// Largest edge of a face of a cube map, texels.
    pub max_cube_size: u32,
    /// Largest width and height of a picture, pixels.
    pub max_viewport: [u32; 2],
    /// Largest uniform block, bytes.
    pub max_uniform_block: u32,
    /// Largest point that is splatted, pixels.
    pub max_point_size: f32,
    /// GPU times can be measured.
    pub timer_queries: bool,
    /// Timer queries come in 64 bits (OpenGL 4.5; older ones have them too, but the loader does not find them).
    pub(super) long_queries: bool,
    /// Compute shaders are there (OpenGL 4.3).
    pub compute: bool,
}

/// Texture units that every driver has for fragments.
const UNITS: u32 = 16;

/// An OpenGL 3.3 or OpenGL ES 3.0 context that the caller made and keeps current.
pub struct Context {
    pub(super) gl: glow::Context,
    info: DriverInfo,
    complaints: Arc<Mutex<Vec<String>>>,
    /// The driver has said that the context is lost.
    lost: Cell<bool>,
    /// Bytes of all textures and buffers, as far as their formats tell.
    pub(super) memory: Cell<u64>,
    /// What programs are made of.
    pub(crate) shaders: RefCell<Texts>,
    /// What keeps the context alive, if it is our own; dropped last.
    _owner: Option<Box<dyn Any>>,
}

impl Context {
    /// Takes a context. Fails with [`Error::NoContext`] if it is older than OpenGL 3.3 or OpenGL ES 3.0, or cannot
    /// render to float textures.
    ///
    /// # Safety
    ///
    /// The context must be current on this thread now, and whenever this value or anything made from it is used or
    /// dropped.
    pub unsafe fn new(gl: glow::Context) -> Result<Rc<Self>> {
        // SAFETY: the caller's.
        unsafe { Self::with_owner(gl, None) }
    }

    /// As [`Context::new`]; with an `owner`, the context is ours, and debug builds listen to the driver.
    pub(super) unsafe fn with_owner(mut gl: glow::Context, owner: Option<Box<dyn Any>>) -> Result<Rc<Self>> {
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
            let renderer = gl.get_parameter_string(glow::RENDERER);
            let software = is_software(&renderer);
            DriverInfo {
                vendor: gl.get_parameter_string(glow::VENDOR),
                renderer,
                version: gl.get_parameter_string(glow::VERSION),
                glsl: gl.get_parameter_string(glow::SHADING_LANGUAGE_VERSION),
                es,
                tier: match (es, compute && !software) {
                    (true, _) => "OpenGL ES 3.0 fragment",
                    (_, false) => "OpenGL 3.3 fragment",
                    (_, true) => "OpenGL 4.3 compute",
                },
                software,
                max_texture_size: gl.get_parameter_i32(glow::MAX_TEXTURE_SIZE).max(0) as u32,
                max_cube_size: gl.get_parameter_i32(glow::MAX_CUBE_MAP_TEXTURE_SIZE).max(0) as u32,
                max_viewport: viewport.map(|x| x.max(0) as u32),
                max_uniform_block: gl.get_parameter_i32(glow::MAX_UNIFORM_BLOCK_SIZE).max(0) as u32,
                max_point_size: points[1],
                timer_queries,
                long_queries: !es && (major, minor) >= (4, 5),
                compute,
            }
        };
        // A caller's context may have a callback of its own.
        if cfg!(debug_assertions) && owner.is_some() && gl.supports_debug() {
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
        let shaders = RefCell::new(Texts::embedded());
        let (lost, memory) = (Cell::new(false), Cell::new(0));
        let context = Self { gl, info, complaints, lost, memory, shaders, _owner: owner };
        context.take_over();
        Ok(Rc::new(context))
    }

    /// What the driver is and can do.
    pub fn info(&self) -> &DriverInfo {
        &self.info
    }

    /// Bytes that textures and buffers take which are alive, as far as their sizes and formats tell.
    pub fn memory(&self) -> u64 {
        self.memory.get()
    }

    /// Whether the driver says that the context is lost, as it may after a reset of the GPU; other errors that the driver has
    /// to tell of are forgotten. See [`Error::ContextLost`].
    pub fn is_lost(&self) -> bool {
        self.take_over();
        self.lost.get()
    }

    /// Our turn to draw, until the result is dropped, however that comes about.
    pub(crate) fn turn(self: &Rc<Self>) -> Turn {
        self.take_over();
        Turn(self.clone())
    }

    /// Forgets the errors of whatever the caller did with the context: they are not ours.
    fn take_over(&self) {
        self.first_error();
        if let Ok(mut list) = self.complaints.lock() {
            list.clear();
        }
    }

    /// Unbinds what other code that draws on the context might take for its own: a sampler overrides a texture's
    /// parameters, and draws would go to our last target.
    fn hand_back(&self) {
        let gl = &self.gl;
        // SAFETY: see `Context::new`; all of it is of OpenGL 3.3 and ES 3.0.
        unsafe {
            for unit in 0..UNITS {
                gl.bind_sampler(unit, None);
            }
            gl.active_texture(glow::TEXTURE0);
            gl.bind_framebuffer(glow::FRAMEBUFFER, None);
            gl.bind_vertex_array(None);
            gl.use_program(None);
            gl.disable(glow::DEPTH_TEST);
            gl.disable(glow::CULL_FACE);
        }
        self.pack_tightly();
    }

    /// The first error that the driver has to tell of. It may have more, which would be blamed on what comes next.
    fn first_error(&self) -> u32 {
        let mut first = glow::NO_ERROR;
        // Some drivers never end to tell that a context is lost.
        for _ in 0..64 {
            // SAFETY: see `Context::new`.
            let code = unsafe { self.gl.get_error() };
            if code == glow::NO_ERROR {
                break;
            }
            self.lost.set(self.lost.get() || code == glow::CONTEXT_LOST);
            first = if first == glow::NO_ERROR { code } else { first };
        }
        first
    }

    /// Fails if the driver has raised an error since the last call; `after` says what has just been done.
    pub(crate) fn check(&self, after: &str) -> Result<()> {
        let code = self.first_error();
        if self.lost.get() {
            return Err(Error::ContextLost);
        }
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

    /// Whether no framebuffer, program, vertex array or sampler is bound.
    #[cfg(test)]
    pub fn has_nothing_bound(&self) -> bool {
        let gl = &self.gl;
        let names = [
            glow::FRAMEBUFFER_BINDING,
            glow::CURRENT_PROGRAM,
            glow::VERTEX_ARRAY_BINDING,
            glow::PIXEL_PACK_BUFFER_BINDING,
        ];
        // SAFETY: see `Context::new`; all of them are of OpenGL 3.3.
        let is_free = |name: u32| unsafe { gl.get_parameter_i32(name) } == 0;
        let has_no_sampler = |unit: u32| {
            // SAFETY: as above.
            unsafe { gl.active_texture(glow::TEXTURE0 + unit) };
            is_free(glow::SAMPLER_BINDING)
        };
        names.into_iter().all(is_free) && (0..UNITS).all(has_no_sampler)
    }

    /// Does what OpenGL does not allow.
    #[cfg(test)]
    pub fn provoke_an_error(&self) {
        // SAFETY: see `Context::new`; a wrong capability only raises an error.
        unsafe { self.gl.enable(0xdead) }
    }

    /// Makes rows of pixels lie in memory one after the other, without gaps, and in memory of the program rather than
    /// in a buffer, whatever the caller's settings are. Sound transfers rely on it.
    pub(super) fn pack_tightly(&self) {
        let gl = &self.gl;
        // SAFETY: see `Context::new`; all of it is of OpenGL 3.3 and ES 3.0, but for what ES leaves out.
        unsafe {
            gl.bind_buffer(glow::PIXEL_PACK_BUFFER, None);
            gl.bind_buffer(glow::PIXEL_UNPACK_BUFFER, None);
            for (name, value) in [
                (glow::PACK_ALIGNMENT, 1),
                (glow::PACK_ROW_LENGTH, 0),
                (glow::PACK_SKIP_ROWS, 0),
                (glow::PACK_SKIP_PIXELS, 0),
                (glow::UNPACK_ALIGNMENT, 1),
                (glow::UNPACK_ROW_LENGTH, 0),
                (glow::UNPACK_SKIP_ROWS, 0),
                (glow::UNPACK_SKIP_PIXELS, 0),
            ] {
                gl.pixel_store_i32(name, value);
            }
            if !self.info.es {
                for name in
                    [glow::PACK_SWAP_BYTES, glow::PACK_LSB_FIRST, glow::UNPACK_SWAP_BYTES, glow::UNPACK_LSB_FIRST]
                {
                    gl.pixel_store_i32(name, 0);
                }
            }
        }
    }

    /// Waits until the GPU has done everything that it was asked.
    pub(crate) fn finish(&self) {
        // SAFETY: see `Context::new`.
        unsafe { self.gl.finish() }
    }

    /// Has the GPU begin with what was drawn, without waiting.
    pub(crate) fn flush(&self) {
        // SAFETY: see `Context::new`.
        unsafe { self.gl.flush() }
    }
}

/// While it lives the context is ours to draw on; then other code finds nothing of ours bound.
pub(crate) struct Turn(Rc<Context>);

impl Drop for Turn {
    fn drop(&mut self) {
        self.0.hand_back();
    }
}

/// Whether a driver of that name draws on the CPU.
fn is_software(renderer: &str) -> bool {
    let name = renderer.to_ascii_lowercase();
    let known = ["llvmpipe", "softpipe", "swrast", "swiftshader", "lavapipe", "microsoft basic render", "software"];
    known.iter().any(|software| name.contains(software))
}

#[cfg(test)]
mod tests {
    use super::is_software;

    #[test]
    fn software_is_known_by_its_name() {
        for name in ["llvmpipe (LLVM 15.0.6, 256 bits)", "Google SwiftShader", "Apple Software Renderer"] {
            assert!(is_software(name), "{name}");
        }
        for name in [
            "NVIDIA H100 PCIe/PCIe/SSE2",
            "AMD Radeon RX 7900 XTX (radeonsi, navi31, LLVM 17.0.6)",
            "Mesa Intel(R) Arc(tm)",
        ] {
            assert!(!is_software(name), "{name}");
        }
    }
}
