//! The OpenGL objects: context, programs, textures, targets, buffers and timers, each deleted on drop.
//!
//! This is the only module with `unsafe` code. Its types keep the rules that make the calls sound: an object holds
//! the context that made it, sizes and formats are fixed at creation, uploads and read-backs check the length of
//! what they are given. A context must be current on the thread that uses it; that is what [`Context::new`] asks
//! of its caller.
#![allow(unsafe_code)]

mod buffer;
mod context;
#[cfg(feature = "eframe")]
mod eframe;
#[cfg(feature = "headless")]
mod headless;
mod program;
mod state;
mod target;
mod texture;
mod timer;

pub(crate) use buffer::{GeometryBuffer, Uniform, UniformArray, UniformBlock, uniform_block};
pub use context::{Context, DriverInfo};
#[cfg(feature = "headless")]
pub use headless::{Api, DeviceInfo, Headless};
pub(crate) use program::{MOST_GROUPS, Program, ProgramSource, Stage};
pub(crate) use state::{Cull, State, Viewport};
pub(crate) use target::{CubeTarget, JointTarget, Readback, Target};
pub(crate) use texture::{Filter, Format, SamplerObject, Texture, TextureCube};
pub(crate) use timer::Timer;
