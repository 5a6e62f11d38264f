//! Ground truth on the CPU: the same scene, traced with rays. Slow and exact; what the GPU's passes are measured
//! against. A file has the name of the pass whose twin it is.

pub mod brdf;
mod bvh;
pub mod direct;
mod emitter;
pub mod gather;
pub mod ism;
mod path;
mod surface;
pub mod tonemap;
#[cfg(test)]
pub(crate) mod truth_tests;

pub use bvh::{Bvh, Hit};
pub use emitter::{Emission, Emitters};
pub use path::{PathOptions, PathTraced, PathTracer, PixelFilter};
pub(crate) use surface::Tree;
pub use surface::{Surface, Surfaces};
