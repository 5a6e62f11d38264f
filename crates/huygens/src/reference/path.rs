//! The path tracer: what the rendering equation (Kajiya 1986) has for the same scene, camera, lights, BRDF and units
//! as the GPU's frame.
//!
//! Next-event estimation for every light and for emissive triangles, which are drawn by power; multiple importance
//! sampling with the balance heuristic (Veach & Guibas 1995) between them and the BRDF; Russian roulette past the
//! fourth reflection; Owen-scrambled Sobol points (Burley 2020).
//!
//! Samples come in passes that are scrambled independently, so that the passes' spread tells the variance of the
//! picture. Every pixel is a sum of its own in a fixed order: a picture is the same for a seed whatever the number of
//! threads.

use glam::{DVec3, Vec2, Vec3};
use rayon::prelude::*;

use super::direct;
use super::emitter::Emitters;
use super::surface::{Surface, Surfaces};
use crate::sampling::hash;
use crate::scene::Bounds;
use crate::{Camera, Scene};

/// Reflections before Russian roulette begins.
const ROULETTE_AFTER: u32 = 4;

/// Passes that the samples are spread over at most; more where a pass would grow beyond [`LARGEST_PASS`].
const PASSES: u32 = 16;

/// Samples of a pixel in the largest pass.
const LARGEST_PASS: u32 = 64;

/// Pixels between two calls of `progress`.
const REPORT_EVERY: usize = 1 << 14;

/// Where within a pixel paths start.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum PixelFilter {
    /// In its centre, as the first frame of the GPU does.
    Center,
    /// Evenly over the pixel.
    Box,
}

/// What to trace.
#[derive(Clone, Debug)]
pub struct PathOptions {
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// Where from.
    pub camera: Camera,
    /// Paths for each pixel, at least 1; rounded up to a whole number of passes.
    pub samples: u32,
    /// Reflections from surface to surface that indirect light may take; `None`: as many as it likes.
    pub bounces: Option<u32>,
    /// Seed of every random choice.
    pub seed: u32,
    /// Where within the pixel.
    pub filter: PixelFilter,
}

/// A traced picture; rows from the top, radiance in W/(m² sr). What is seen is `direct + indirect`.
#[derive(Clone, Debug, PartialEq)]
pub struct PathTraced {
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// Paths averaged for each pixel; 0 if `progress` stopped the first pass.
    pub samples: u32,
    /// Radiance emitted by surfaces or reflected once from the lights.
    pub direct: Vec<[f32; 3]>,
    /// Radiance that has been reflected more than once.
    pub indirect: Vec<[f32; 3]>,
    /// Variance of `direct + indirect` as an estimate, from the spread of the passes; infinite if there is only one.
    pub variance: Vec<[f32; 3]>,
}

/// Traces paths through a scene.
pub struct PathTracer<'a> {
    surfaces: Surfaces<'a>,
    emitters: Emitters,
    bounds: Bounds,
}

/// Sums over the passes of one pixel.
#[derive(Clone, Copy, Default)]
struct Sums {
    direct: DVec3,
    indirect: DVec3,
    squares: DVec3,
}

impl<'a> PathTracer<'a> {
    /// Builds the tree over the scene's triangles.
    pub fn new(scene: &'a Scene) -> Self {
        Self {
            surfaces: Surfaces::new(scene),
            emitters: Emitters::new(scene),
            bounds: scene.bounds().unwrap_or(Bounds { min: Vec3::ZERO, max: Vec3::ZERO }),
        }
    }

    /// Traces a picture. `progress` hears the share that is done and says whether to go on; if not, the passes so far
    /// are the result.
    pub fn trace(&self, options: &PathOptions, progress: &mut dyn FnMut(f32) -> bool) -> PathTraced {
        let (width, height) = (options.width, options.height);
        let per_pass = options.samples.div_ceil(PASSES).clamp(1, LARGEST_PASS);
        let passes = options.samples.max(1).div_ceil(per_pass);
        let near = options.camera.near(self.bounds.farthest(options.camera.eye));
        let mut sums = vec![Sums::default(); width as usize * height as usize];
        let mut averaged = 0;
        'passes: for pass in 0..passes {
            let mut traced = Vec::with_capacity(sums.len());
            for first in (0..sums.len()).step_by(REPORT_EVERY) {
                let done = (pass as f32 + first as f32 / sums.len() as f32) / passes as f32;
                if !progress(done) {
                    break 'passes;
                }
                let pixels = first..sums.len().min(first + REPORT_EVERY);
                traced.par_extend(
                    pixels.into_par_iter().map(|pixel| self.pixel(options, near, pixel as u32, [pass, per_pass])),
                );
            }
            for (sums, [direct, indirect]) in sums.iter_mut().zip(traced) {
                sums.direct += direct;
                sums.indirect += indirect;
                let seen = direct + indirect;
                sums.squares += seen * seen;
            }
            averaged += 1;
        }
        let n = f64::from(averaged);
        let mean = |sum: DVec3| (sum / n.max(1.0)).as_vec3().to_array();
        let variance = |s: &Sums| {
            if averaged < 2 {
                return [f32::INFINITY; 3];
            }
            let sum = s.direct + s.indirect;
            ((s.squares - sum * sum / n) / (n * (n - 1.0))).max(DVec3::ZERO).as_vec3().to_array()
        };
        PathTraced {
            width,
            height,
            samples: averaged * per_pass,
            direct: sums.iter().map(|s| mean(s.direct)).collect(),
            indirect: sums.iter().map(|s| mean(s.indirect)).collect(),
            variance: sums.iter().map(variance).collect(),
        }
    }

    /// The mean of one pass of so many samples over a pixel: direct and indirect.
    fn pixel(&self, options: &PathOptions, near: f32, pixel: u32, [pass, samples]: [u32; 2]) -> [DVec3; 2] {
        let seed = hash(pixel ^ hash(pass ^ hash(options.seed)));
        let mut sums = [DVec3::ZERO; 2];
        for index in 0..samples {
            let mut sampler = Sampler { index, set: 0, seed };
            let [x, y, ..] = sampler.next();
            let within = if options.filter == PixelFilter::Center { Vec2::splat(0.5) } else { Vec2::new(x, y) };
            let at = Vec2::new((pixel % options.width) as f32, (pixel / options.width) as f32) + within;
            for (sum, radiance) in sums.iter_mut().zip(self.radiance(options, near, at, &mut sampler)) {
                // A sample that overflowed would spoil the pixel for ever.
                if radiance.is_finite() {
                    *sum += radiance.as_dvec3();
                }
            }
        }
        sums.map(|sum| sum / f64::from(samples))
    }

    /// One path from a point of the picture (pixels from its upper left corner): direct and indirect radiance.
    fn radiance(&self, options: &PathOptions, near: f32, at: Vec2, sampler: &mut Sampler) -> [Vec3; 2] {
        let [mut direct, mut indirect] = [Vec3::ZERO; 2];
        let (mut origin, mut direction) = options.camera.ray(at, options.width, options.height);
        let mut t_min = near;
        let mut throughput = Vec3::ONE;
        // Density of the last direction by the BRDF, and where from; the camera's is no choice.
        let mut drawn: Option<(f32, Vec3)> = None;
        for reflections in 0.. {
            let Some((hit, surface)) = self.surfaces.closest(origin, direction, t_min, reflections == 0) else { break };

            // What the surface itself sends, as seen by the camera or found by the BRDF.
            let weight = match drawn {
                None => 1.0,
                Some((pdf, from)) => pdf / (pdf + self.emitters.pdf(from, &hit, &surface)),
            };
            let mut shines = surface.emission;
            if let (Some(base), 0) = (surface.unlit, reflections) {
                shines = base;
            }
            *if reflections < 2 { &mut direct } else { &mut indirect } += throughput * shines * weight;
            if surface.unlit.is_some() || surface.culled || options.bounces.is_some_and(|limit| reflections > limit) {
                break;
            }

            // Light that comes straight here.
            let v = -direction.normalize();
            let reflected = direct::radiance(&self.surfaces, &surface, v) + self.emitted(&surface, v, sampler.next());
            *if reflections == 0 { &mut direct } else { &mut indirect } += throughput * reflected;

            // On along a direction that the BRDF draws.
            let [choice, x, y, roulette] = sampler.next();
            let l = surface.brdf.sample(surface.normal, v, [choice, x, y]);
            let pdf = surface.brdf.pdf(surface.normal, l, v);
            let cosine = l.dot(surface.normal);
            if cosine <= 0.0 || l.dot(surface.geometric_normal) <= 0.0 || pdf <= 0.0 {
                break;
            }
            throughput *= surface.brdf.value(surface.normal, l, v) * (cosine / pdf);
            if reflections >= ROULETTE_AFTER {
                let survives = throughput.max_element().min(0.95);
                if roulette >= survives {
                    break;
                }
                throughput /= survives;
            } else if throughput == Vec3::ZERO {
                break;
            }
            drawn = Some((pdf, surface.position));
            (origin, direction, t_min) = (surface.start(l), l, 0.0);
        }
        [direct, indirect]
    }

    /// Radiance that a surface reflects toward `v` from one point of an emissive triangle.
    fn emitted(&self, surface: &Surface, v: Vec3, [pick, x, y, _]: [f32; 4]) -> Vec3 {
        let Some((l, radiance, pdf, point)) = self.emitters.sample(self.surfaces.scene, surface.position, [pick, x, y])
        else {
            return Vec3::ZERO;
        };
        let cosine = l.dot(surface.normal);
        if cosine <= 0.0 || l.dot(surface.geometric_normal) <= 0.0 || self.surfaces.occluded(surface.start(l), point) {
            return Vec3::ZERO;
        }
        let weight = 1.0 / (pdf + surface.brdf.pdf(surface.normal, l, v));
        surface.brdf.value(surface.normal, l, v) * radiance * (cosine * weight)
    }
}

/// Numbers in [0, 1), four at a time: every set is a stratified sequence of its own over the samples of a pass.
struct Sampler {
    index: u32,
    set: u32,
    seed: u32,
}

impl Sampler {
    fn next(&mut self) -> [f32; 4] {
        let sets = sobol_burley::NUM_DIMENSION_SETS_4D;
        let seed = hash(self.seed.wrapping_add(self.set / sets));
        self.set += 1;
        sobol_burley::sample_4d(self.index, (self.set - 1) % sets, seed)
    }
}
