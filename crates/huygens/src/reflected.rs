//! Reflected waves: where light arrives at a surface, the surface sends it on (Keller 1997, "Instant Radiosity").
//!
//! The rays of the lattice are traced to the first surface and leave a Lambertian VPL there; from these, rays with a
//! cosine distribution leave the next generation, and so on. Every generation is resampled by power to as many VPLs
//! as the lattice has rays; the last one stands for all generations that would come after it too, so that no light is
//! lost. There is no free scale.

use std::f32::consts::{FRAC_PI_2, PI, TAU};

use glam::{Mat3, Quat, Vec3};
use rayon::prelude::*;

use crate::lattice::{Emission, Lattice, Ray, Vpl};
use crate::reference::Surfaces;
use crate::sampling::{self, hash};
use crate::scene::Bounds;
use crate::settings::Reflected;
use crate::surfel::{main_direction, morton};
use crate::{Light, Profile};

/// Generations beyond `reflected.bounces` are followed until their flux is below this share of the first one's.
const FAINT: f64 = 1e-3;

/// … or this many of them: walls of albedo 0.93 or more.
const LAST_GENERATION: u32 = 96;

/// The VPLs of all generations, and their numbers.
#[derive(Clone, Debug, Default)]
pub struct ReflectedWave {
    /// Generation by generation, each in spatial order.
    pub vpls: Vec<Vpl>,
    /// Flux of all lights, W, the sum of the channels.
    pub light_flux: f64,
    /// Flux that each generation sends out, W, the sum of the channels; the last one with all later ones.
    pub generations: Vec<f64>,
}

/// A ray that carries flux, W.
struct Photon {
    origin: Vec3,
    direction: Vec3,
    flux: Vec3,
}

/// What traces the waves of one scene.
pub struct Tracer<'a> {
    surfaces: &'a Surfaces<'a>,
    bounds: Bounds,
    settings: &'a Reflected,
    seed: u32,
    /// VPLs that each generation keeps.
    kept: u32,
}

impl<'a> Tracer<'a> {
    /// Takes what it needs; `lattice` says how many VPLs a generation has.
    pub fn new(surfaces: &'a Surfaces, bounds: Bounds, lattice: &Lattice, settings: &'a Reflected, seed: u32) -> Self {
        Self { surfaces, bounds, settings, seed, kept: lattice.rays.len() as u32 }
    }

    /// The VPLs of all lights.
    pub fn run(&self, lattice: &Lattice, lights: &[Light], strength: f32) -> ReflectedWave {
        let radius = self.bounds.radius();
        let light_flux: f64 = lights.iter().map(|light| f64::from(light.flux(radius).element_sum())).sum();
        let mut photons = Vec::new();
        for (number, light) in lights.iter().enumerate() {
            let share = f64::from(light.flux(radius).element_sum()) / light_flux;
            let rays = (share * f64::from(self.kept * self.settings.rays)).round().max(1.0) as u32;
            if share > 0.0 {
                self.emit(lattice, light, rays, number as u32, &mut photons);
            }
        }
        let mut wave = ReflectedWave { light_flux, ..ReflectedWave::default() };
        let (mut first, mut last) = (0.0, Vec::new());
        for generation in 1..=LAST_GENERATION {
            let hits = self.arrive(&photons);
            let flux = power(&hits);
            if generation == 1 {
                first = flux;
            }
            let vpls = sampling::by_power(&hits, self.kept, self.seed, generation);
            if generation < self.settings.bounces {
                wave.generations.push(flux);
                wave.vpls.extend(&vpls);
            } else {
                last.extend(hits);
            }
            if flux <= first * FAINT {
                break;
            }
            photons = self.send_on(&vpls, generation);
        }
        if !last.is_empty() {
            wave.generations.push(power(&last));
            self.sort(&mut last);
            wave.vpls.extend(sampling::by_power(&last, self.kept, self.seed, 0));
        }
        for vpl in &mut wave.vpls {
            vpl.intensity *= strength;
        }
        self.bound(&mut wave.vpls);
        wave
    }

    /// Rays from a light, one cell of the lattice after the other; each starts anywhere in its cell.
    fn emit(&self, lattice: &Lattice, light: &Light, rays: u32, number: u32, photons: &mut Vec<Photon>) {
        let (center, world_from_light) = Lattice::frame(light, self.bounds.center(), self.bounds.radius());
        // A point light has the lattice on either side of its plane.
        let sides = if light.profile == Profile::Point { 2 } else { 1 };
        let cells = lattice.rays.len() as u32 * sides;
        let seed = hash(self.seed ^ hash(number));
        for i in 0..rays {
            let [along, x, y, _] = point(i, 0, seed);
            let cell = ((i as f32 + along) / rays as f32 * cells as f32) as u32;
            let cell = if rays % cells == 0 { i / (rays / cells) } else { cell.min(cells - 1) };
            let ray = &lattice.rays[(cell / sides) as usize];
            let weight = cells as f32 / rays as f32;
            let (mut direction, share) = lattice.within(ray, [x, y], light.profile);
            if cell % sides == 1 {
                direction.z = -direction.z;
            }
            let photon = match light.profile {
                // The lattice seen along the axis is a disc that covers the scene.
                Profile::Directional => Photon {
                    origin: center
                        + world_from_light * (direction * Vec3::new(1.0, 1.0, 0.0)) * self.bounds.radius(),
                    direction: light.axis,
                    flux: light.flux(self.bounds.radius()) * (share * weight),
                },
                profile => Photon {
                    origin: center,
                    direction: world_from_light * direction,
                    flux: light.intensity * (profile.value(direction.z) * share * weight),
                },
            };
            if photon.flux != Vec3::ZERO {
                photons.push(photon);
            }
        }
    }

    /// What the photons leave where they meet surfaces, in spatial order.
    fn arrive(&self, photons: &[Photon]) -> Vec<Vpl> {
        let vpl = |photon: &Photon| {
            let (_, surface) = self.surfaces.closest(photon.origin, photon.direction, 0.0, false)?;
            let flux = photon.flux * surface.brdf.base;
            let shines = !surface.culled && flux.max_element() > 0.0 && flux.is_finite();
            shines.then(|| Vpl {
                position: surface.start(surface.geometric_normal),
                direction: surface.geometric_normal,
                intensity: flux / PI,
                d_min: 0.0,
                emission: Emission::Lambertian,
            })
        };
        let mut vpls: Vec<Vpl> = photons.par_iter().filter_map(vpl).collect();
        self.sort(&mut vpls);
        vpls
    }

    /// Spatial order: a systematic sample of such a list is spread evenly over the surfaces.
    fn sort(&self, vpls: &mut [Vpl]) {
        let extent = (self.bounds.max - self.bounds.min).max_element().max(f32::MIN_POSITIVE);
        vpls.sort_by_cached_key(|vpl| {
            (main_direction(vpl.direction) << 60) | morton((vpl.position - self.bounds.min) / extent)
        });
    }

    /// Rays of a cosine distribution from each VPL.
    fn send_on(&self, vpls: &[Vpl], generation: u32) -> Vec<Photon> {
        let rays = if generation < self.settings.bounces { self.settings.rays } else { 1 };
        let seed = hash(self.seed ^ hash(generation ^ 0x9e37_79b9));
        let mut photons = Vec::with_capacity(vpls.len() * rays as usize);
        for (i, vpl) in vpls.iter().enumerate() {
            let to_world = Quat::from_rotation_arc(Vec3::Z, vpl.direction);
            for ray in 0..rays {
                let [x, y, ..] = point(i as u32 * rays + ray, 0, seed);
                // Malley's method: the cosine above a disc.
                let (radius, angle) = (x.sqrt(), TAU * y);
                let local = Vec3::new(radius * angle.cos(), radius * angle.sin(), (1.0 - x).max(0.0).sqrt());
                photons.push(Photon {
                    origin: vpl.position,
                    direction: to_world * local,
                    flux: vpl.flux() / rays as f32,
                });
            }
        }
        photons
    }

    /// How near each VPL may be taken to be.
    fn bound(&self, vpls: &mut [Vpl]) {
        let all: Vec<(Vec3, Vec3, f32)> = vpls.iter().map(|v| (v.position, v.direction, v.flux().element_sum())).collect();
        let found: Vec<f32> = all
            .par_iter()
            .map(|&(position, direction, flux)| {
                const NEAR: usize = 8;
                let mut nearest = [(f32::INFINITY, 0.0f32); NEAR];
                for &(p, n, f) in &all {
                    let d2 = p.distance_squared(position);
                    if d2 < nearest[NEAR - 1].0 && n.dot(direction) > 0.7 {
                        let place = nearest.iter().position(|(d, _)| d2 < *d).unwrap_or(NEAR - 1);
                        nearest[place..].rotate_right(1);
                        nearest[place] = (d2, f);
                    }
                }
                let reached = nearest[NEAR - 1].0;
                if !reached.is_finite() {
                    return self.bounds.radius() * 0.1;
                }
                let around: f32 = nearest[..NEAR - 1].iter().map(|(_, f)| f).sum();
                // Area that has the VPL's flux at the mean density of flux around it.
                (flux / around.max(f32::MIN_POSITIVE) * reached).sqrt()
            })
            .collect();
        for (vpl, r) in vpls.iter_mut().zip(found) {
            vpl.d_min = r * self.settings.radius;
        }
    }
}

fn power(vpls: &[Vpl]) -> f64 {
    vpls.iter().map(|vpl| f64::from(vpl.flux().element_sum())).sum()
}

/// An Owen-scrambled Sobol point (Burley 2020); any index.
fn point(index: u32, set: u32, seed: u32) -> [f32; 4] {
    sobol_burley::sample_4d(index & 0xffff, set, seed.wrapping_add(index >> 16))
}

impl Lattice {
    /// A direction within a ray's cell, from two numbers in [0, 1), and the measure of the cell: its solid angle, sr,
    /// or for a directional light its share of the disc that the hemisphere is along its axis.
    fn within(&self, ray: &Ray, [x, y]: [f32; 2], profile: Profile) -> (Vec3, f32) {
        // The steps, back from the rays: the axis alone, then rings of equal numbers.
        let rings = (self.rays.len() - 1) as f32;
        let last = self.rays[self.rays.len() - 1];
        let sectors = TAU / (TAU - last.phi).max(1e-6);
        let half_theta = 0.5 * FRAC_PI_2 / (rings / sectors).round().max(1.0);
        let (inner, outer) = ((ray.theta - half_theta).max(0.0), (ray.theta + half_theta).min(FRAC_PI_2));
        let phi = if ray.theta == 0.0 { TAU * y } else { ray.phi + TAU / sectors * (y - 0.5) };
        if profile == Profile::Directional {
            let [a, b] = [inner.sin().powi(2), outer.sin().powi(2)];
            let sine = (a + (b - a) * x).sqrt();
            let share = (b - a) * if ray.theta == 0.0 { 1.0 } else { 1.0 / sectors };
            return (Vec3::new(sine * phi.cos(), sine * phi.sin(), (1.0 - sine * sine).max(0.0).sqrt()), share);
        }
        let cosine = inner.cos() + (outer.cos() - inner.cos()) * x;
        let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
        (Vec3::new(sine * phi.cos(), sine * phi.sin(), cosine), ray.solid_angle)
    }
}
