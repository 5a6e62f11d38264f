//! Ground truth on the CPU: the same scene, traced with rays. Slow and exact; what the GPU's passes are measured
//! against. A file has the name of the pass whose twin it is.

mod bvh;
pub mod direct;
pub mod gather;

pub use bvh::{Bvh, Hit};
