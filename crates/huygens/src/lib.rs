//! Real-time global illumination on any OpenGL 3.3 / OpenGL ES 3.0 driver.
//!
//! Indirect light comes from a lattice of virtual point lights (VPLs) that stands in stacked hemispheres around
//! the primary light, like wavefronts flowing outward. The crate draws on a [`glow`] context that the caller owns;
//! it opens no window. With the feature `headless` (on by default) it can make a context of its own through EGL.
//!
//! ```no_run
//! use huygens::{RenderOptions, Renderer, Scene, Settings, gl};
//!
//! # fn main() -> huygens::Result<()> {
//! let headless = gl::Headless::new(None)?;
//! let mut renderer = Renderer::new(headless.context())?;
//! let scene = Scene::builtin("cornell")?; // or Scene::load("model.glb")?
//! let options = RenderOptions::new(640, 480, scene.cameras[0].clone());
//! let picture = renderer.render(&scene, &Settings::default(), &options, &mut |_| ())?;
//! assert_eq!(picture.linear.len(), 640 * 480);
//! # Ok(())
//! # }
//! ```
//!
//! `docs/technique.md` of the repository says what is computed and why; `examples/one_picture.rs` writes a file.
//!
//! Units: metres, watts, radians; light is linear RGB with Rec. 709 primaries. Spaces are named in suffixes:
//! `_ws` world, `_vs` view, `_ls` light; a matrix `a_from_b` takes b to a. World space is right-handed, y up.
#![warn(missing_docs)]
#![deny(unsafe_code)]

pub mod camera;
mod error;
mod frame;
pub mod gl;
mod governor;
#[cfg(test)]
mod gpu_tests;
pub mod lattice;
pub mod light;
mod limits;
mod passes;
mod patches;
pub mod reference;
pub mod reflected;
mod renderer;
pub mod sampling;
pub mod scene;
pub mod settings;
mod shaders;
pub mod surfel;

pub use camera::Camera;
pub use error::{Error, Result};
pub use frame::{DebugView, Exposure, Layer, PassTime, Progress, Rebuilds, RenderOptions, Rendered, Shown, Stats};
pub use governor::Governor;
pub use light::{Light, Profile};
pub use renderer::Renderer;
pub use scene::Scene;
pub use settings::Settings;

/// The Rust code in the README is compiled with the documentation's tests.
#[cfg(all(doctest, feature = "headless"))]
#[doc = include_str!("../../../README.md")]
struct Readme;
