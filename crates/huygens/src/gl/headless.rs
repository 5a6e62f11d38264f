//! A context of its own, without a window: EGL's device platform, else Mesa's surfaceless platform.

use std::cell::Cell;
use std::rc::Rc;

use glutin::api::egl::context::PossiblyCurrentContext;
use glutin::api::egl::device::Device;
use glutin::api::egl::display::Display;
use glutin::config::{ConfigSurfaceTypes, ConfigTemplateBuilder};
use glutin::context::{ContextApi, ContextAttributesBuilder, GlProfile, Version};
use glutin::display::GlDisplay;
use khronos_egl as egl;

use super::Context;
use crate::{Error, Result};

/// A device that EGL offers.
#[derive(Clone, Debug)]
pub struct DeviceInfo {
    /// What to give [`Headless::new`]; hardware comes before software.
    pub index: usize,
    /// The driver's name for it, or where it is in the file system.
    pub name: String,
    /// A software rasterizer.
    pub software: bool,
}

/// Which OpenGL to ask for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Api {
    /// The newest OpenGL core profile, at least 3.3.
    Core,
    /// OpenGL ES 3.0 or newer.
    Es,
}

thread_local! {
    /// Whether this thread has a headless context.
    static TAKEN: Cell<bool> = const { Cell::new(false) };
}

/// The crate's tests, which are threads of one process, take turns with their contexts (see [`Headless`]).
struct Turn {
    #[cfg(test)]
    _held: std::sync::MutexGuard<'static, ()>,
}

impl Turn {
    fn wait() -> Self {
        #[cfg(test)]
        static TURN: std::sync::Mutex<()> = std::sync::Mutex::new(());
        Self {
            // A test that fails leaves nothing broken behind.
            #[cfg(test)]
            _held: TURN.lock().unwrap_or_else(std::sync::PoisonError::into_inner),
        }
    }
}

/// An OpenGL context without a window, current on the thread that made it. A thread has one at a time: the context
/// lives as long as anything that was made on it.
///
/// Threads that render at the same time are safe only where the driver is. Mesa's software rasterizer of version 22.3
/// is not: whoever maps a texture there looks through what every context of the process draws, without a lock, and
/// crashes when one of them ends a scene just then. Let such threads take turns, or give each a process of its own.
pub struct Headless {
    context: Rc<Context>,
    device: Option<usize>,
}

/// Keeps an EGL context alive, and the thread's only one.
struct Owner {
    _egl: Option<PossiblyCurrentContext>,
    release: Option<Box<dyn FnOnce()>>,
    _turn: Turn,
}

impl Drop for Owner {
    fn drop(&mut self) {
        if let Some(release) = self.release.take() {
            release();
        }
        TAKEN.set(false);
    }
}

impl Headless {
    /// The newest OpenGL core context, or else one of OpenGL ES, on the device with that index, or on the first that
    /// works: hardware before software, then Mesa's surfaceless platform.
    pub fn new(device: Option<usize>) -> Result<Self> {
        match Self::with_api(device, Api::Core) {
            Err(Error::NoContext(problem)) => Self::with_api(device, Api::Es).map_err(|_| Error::NoContext(problem)),
            result => result,
        }
    }

    /// As [`Headless::new`], with a choice of the API.
    pub fn with_api(device: Option<usize>, api: Api) -> Result<Self> {
        if TAKEN.get() {
            return Err(Error::NoContext(
                "this thread has a headless context; drop all that was made on it first".into(),
            ));
        }
        let devices = match sorted_devices() {
            Ok(devices) => devices,
            Err(problem) if problem.missing_library => return Err(Error::NoContext(problem.text)),
            Err(_) => Vec::new(),
        };
        if let Some(index) = device {
            let (egl_device, info) = devices.get(index).ok_or_else(|| Error::Argument {
                what: "device",
                problem: format!("there is no device {index}"),
                allowed: match devices.len() {
                    0 => "none: EGL lists no devices".to_owned(),
                    n => format!("0 to {}, as `huygens info` lists them", n - 1),
                },
            })?;
            return on_device(egl_device, api)
                .map(|context| Self { context, device: Some(index) })
                .map_err(|problem| Error::NoContext(format!("device {index} ({}): {problem}", info.name)));
        }
        let mut problems = Vec::new();
        for (egl_device, info) in &devices {
            match on_device(egl_device, api) {
                Ok(context) => return Ok(Self { context, device: Some(info.index) }),
                Err(problem) => problems.push(format!("{}: {problem}", info.name)),
            }
        }
        match Self::surfaceless(api) {
            Ok(headless) => Ok(headless),
            Err(problem) => {
                problems.push(format!("surfaceless: {problem}"));
                Err(Error::NoContext(format!(
                    "no driver for OpenGL 3.3 or OpenGL ES 3.0 works ({}); update the driver, or {INSTALL}",
                    problems.join("; ")
                )))
            }
        }
    }

    /// Mesa's surfaceless platform (EGL_MESA_platform_surfaceless), for which glutin has no handle.
    fn surfaceless(api: Api) -> Result<Self, String> {
        const PLATFORM_SURFACELESS_MESA: egl::Enum = 0x31DD;
        let (client, bit, version, profile) = match api {
            Api::Core => (egl::OPENGL_API, egl::OPENGL_BIT, [3, 3], egl::CONTEXT_OPENGL_CORE_PROFILE_BIT),
            Api::Es => (egl::OPENGL_ES_API, egl::OPENGL_ES3_BIT, [3, 0], egl::NONE),
        };
        let mut attributes = vec![egl::CONTEXT_MAJOR_VERSION, version[0], egl::CONTEXT_MINOR_VERSION, version[1]];
        if api == Api::Core {
            attributes.extend([egl::CONTEXT_OPENGL_PROFILE_MASK, profile]);
        }
        attributes.push(egl::NONE);
        let turn = Turn::wait();
        // SAFETY: libEGL is what the name says; the platform takes no native display, and the context that the loader
        // is for has just become current.
        unsafe {
            let egl = egl::DynamicInstance::<egl::EGL1_5>::load_required().map_err(|e| e.to_string())?;
            let connect = || -> Result<_, egl::Error> {
                let display =
                    egl.get_platform_display(PLATFORM_SURFACELESS_MESA, egl::DEFAULT_DISPLAY, &[egl::ATTRIB_NONE])?;
                egl.initialize(display)?;
                egl.bind_api(client)?;
                let wanted = [egl::SURFACE_TYPE, 0, egl::RENDERABLE_TYPE, bit, egl::NONE];
                let config = egl.choose_first_config(display, &wanted)?.ok_or(egl::Error::BadConfig)?;
                let context = egl.create_context(display, config, None, &attributes)?;
                egl.make_current(display, None, None, Some(context))?;
                Ok((display, context))
            };
            let (display, context) = connect().map_err(|e| e.to_string())?;
            let gl = glow::Context::from_loader_function_cstr(|name| {
                name.to_str()
                    .ok()
                    .and_then(|name| egl.get_proc_address(name))
                    .map_or(std::ptr::null(), |f| f as *const _)
            });
            TAKEN.set(true);
            let release = move || {
                // Nothing is left to do if it fails.
                let _ = egl.make_current(display, None, None, None);
                let _ = egl.destroy_context(display, context);
            };
            let owner = Owner { _egl: None, release: Some(Box::new(release)), _turn: turn };
            let context = Context::with_owner(gl, Some(Box::new(owner))).map_err(|e| e.to_string())?;
            Ok(Self { context, device: None })
        }
    }

    /// The context.
    pub fn context(&self) -> Rc<Context> {
        self.context.clone()
    }

    /// Index of the device in use; `None` on the surfaceless platform.
    pub fn device(&self) -> Option<usize> {
        self.device
    }

    /// The devices that EGL offers, hardware before software.
    pub fn devices() -> Result<Vec<DeviceInfo>> {
        match sorted_devices() {
            Ok(devices) => Ok(devices.into_iter().map(|(_, info)| info).collect()),
            Err(problem) if problem.missing_library => Err(Error::NoContext(problem.text)),
            Err(_) => Ok(Vec::new()),
        }
    }
}

const INSTALL: &str = "install Mesa: Debian/Ubuntu `apt-get install libegl1 libegl-mesa0 libgl1-mesa-dri`, \
    Fedora `dnf install libglvnd-egl mesa-libEGL mesa-dri-drivers`, Arch `pacman -S libglvnd mesa`";

struct NoDevices {
    missing_library: bool,
    text: String,
}

fn sorted_devices() -> Result<Vec<(Device, DeviceInfo)>, NoDevices> {
    let devices = Device::query_devices().map_err(|e| NoDevices {
        missing_library: matches!(e.error_kind(), glutin::error::ErrorKind::NotFound),
        text: format!("EGL (libEGL.so.1) is missing; {INSTALL}"),
    })?;
    let mut list: Vec<_> = devices
        .map(|device| {
            let software = device.extensions().contains("EGL_MESA_device_software");
            let node = device.drm_render_device_node_path().or(device.drm_device_node_path());
            let name = match (device.name(), node) {
                (Some(name), _) => name.to_owned(),
                (None, Some(node)) => node.display().to_string(),
                (None, None) if software => "Mesa software rasterizer".to_owned(),
                (None, None) => "unnamed device".to_owned(),
            };
            (device, DeviceInfo { index: 0, name, software })
        })
        .collect();
    list.sort_by_key(|(_, info)| info.software);
    for (index, (_, info)) in list.iter_mut().enumerate() {
        info.index = index;
    }
    Ok(list)
}

fn on_device(device: &Device, api: Api) -> Result<Rc<Context>, String> {
    // SAFETY: no native display handle is given.
    let display = unsafe { Display::with_device(device, None) }.map_err(|e| e.to_string())?;
    on_display(&display, api)
}

fn on_display(display: &Display, api: Api) -> Result<Rc<Context>, String> {
    let renderable = match api {
        Api::Core => glutin::config::Api::OPENGL,
        Api::Es => glutin::config::Api::GLES3,
    };
    let template =
        ConfigTemplateBuilder::new().with_api(renderable).with_surface_type(ConfigSurfaceTypes::empty()).build();
    let versions: &[ContextApi] = match api {
        Api::Core => &[
            ContextApi::OpenGl(Some(Version { major: 4, minor: 6 })),
            ContextApi::OpenGl(Some(Version { major: 4, minor: 5 })),
            ContextApi::OpenGl(Some(Version { major: 4, minor: 3 })),
            ContextApi::OpenGl(Some(Version { major: 3, minor: 3 })),
        ],
        Api::Es => &[ContextApi::Gles(Some(Version { major: 3, minor: 0 }))],
    };
    // SAFETY: the template and the attributes carry no window.
    let config = unsafe { display.find_configs(template) }
        .map_err(|e| e.to_string())?
        .next()
        .ok_or("it has no OpenGL configuration")?;
    let turn = Turn::wait();
    let mut problem = String::new();
    for &version in versions {
        let attributes = ContextAttributesBuilder::new()
            .with_debug(cfg!(debug_assertions))
            .with_profile(GlProfile::Core)
            .with_context_api(version)
            .build(None);
        // SAFETY: as above; the loader hands out addresses of this very context, which has just become current.
        unsafe {
            match display.create_context(&config, &attributes).and_then(|c| c.make_current_surfaceless()) {
                Ok(egl) => {
                    let gl = glow::Context::from_loader_function_cstr(|name| display.get_proc_address(name));
                    TAKEN.set(true);
                    let owner = Owner { _egl: Some(egl), release: None, _turn: turn };
                    return Context::with_owner(gl, Some(Box::new(owner))).map_err(|e| e.to_string());
                }
                Err(e) => problem = e.to_string(),
            }
        }
    }
    Err(problem)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn surfaceless_works_where_no_device_is_listed() {
        let headless = Headless::surfaceless(Api::Core).unwrap();
        assert!(Headless::new(None).is_err(), "a second context on the thread");
        assert!(headless.context().info().version.starts_with(|c: char| c >= '3'));
    }

    #[test]
    fn tests_take_turns() {
        let headless = Headless::new(None).unwrap();
        let (made, wait) = std::sync::mpsc::channel();
        let other = std::thread::spawn(move || {
            let _headless = Headless::new(None).unwrap();
            made.send(()).unwrap();
        });
        assert!(wait.recv_timeout(std::time::Duration::from_secs(1)).is_err(), "two contexts at a time");
        drop(headless);
        other.join().unwrap();
    }

    #[test]
    fn devices_are_numbered_with_software_last() {
        let devices = Headless::devices().unwrap();
        assert!(devices.iter().enumerate().all(|(i, device)| device.index == i));
        assert!(devices.is_sorted_by_key(|device| device.software));
        let error = Headless::new(Some(devices.len())).err().unwrap().to_string();
        assert!(error.contains("device") && error.contains("allowed"), "{error}");
    }
}
