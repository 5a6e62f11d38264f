//! Ground truth on the CPU: the same scene, traced with rays. Slow and exact; what the GPU's passes are measured
//! against.

mod bvh;

pub use bvh::{Bvh, Hit};
