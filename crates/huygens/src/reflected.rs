//! Reflected waves: where light arrives at a surface, the surface sends it on (Keller 1997, "Instant Radiosity").
//!
//! The rays of the lattice are traced to the first surface and leave a Lambertian VPL there; from these, drawn by power,
//! rays with a cosine distribution leave the next generation, and so on. What all generations leave is clustered, all
//! together and more evenly than by power, into the VPLs that light the scene: a fixed count with all of the flux. There is
//! no free scale.

use std::f32::consts::{FRAC_PI_2, PI, TAU};
use std::sync::Arc;

use glam::{DVec3, Mat3, Quat, Vec3};
use rayon::prelude::*;

use crate::lattice::{Lattice, Ray, Vpl};
use crate::reference::{Emitters, Surfaces};
use crate::sampling::{self, cosine_direction, hash};
use crate::scene::Bounds;
use crate::settings::Reflected;
use crate::surfel::{main_direction, morton};
use crate::{Light, Profile};

/// Generations beyond `reflected.bounces` are followed until their flux is below this share of the first one's.
const FAINT: f64 = 1e-3;

/// … or this many of them: walls of albedo 0.93 or more.
const LAST_GENERATION: u32 = 96;

/// Generations beyond `reflected.bounces` have at most the rays of one of them over this.
const LATER: u32 = 4;

/// How evenly the VPLs that light the scene are spread over its surfaces: 0 as their power, 1 by area. What is dim lights
/// what is near it, and is as visible there.
const EVENNESS: f64 = 0.7;

/// One of so many VPLs is for places that no other is near.
const SPARE: u32 = 64;

/// Neighbours along a space-filling curve, on either side, that stand for the nearest ones.
const WINDOW: usize = 32;

/// Neighbours by which it is told what is around.
pub(crate) const NEAR: usize = 8;

/// Cosine of the angle between normals up to which VPLs are of the same surface.
const SAME_SIDE: f32 = 0.7;

/// Share of the scene's radius that is next to nothing, and most of it, m: a scene may have a sky far away.
const LITTLE: f32 = 1e-4;
const MOST_LITTLE: f32 = 0.01;

/// The rays that light VPLs anew are traced in at most so many batches, each in one thread.
const BATCHES: u32 = 32;

/// Rays of a generation that make a thread worth its while.
const LEAST_OF_BATCH: u32 = 64;

/// Hits of the rays that are kept at a time, about 100 bytes each.
pub const MOST_HITS: u64 = 1 << 24;

/// The VPLs of all generations, and their numbers.
#[derive(Clone, Debug, Default)]
pub struct ReflectedWave {
    /// In spatial order.
    pub vpls: Vec<Vpl>,
    /// Flux of all lights and emissive surfaces, W, the sum of the channels.
    pub light_flux: f64,
    /// Flux that each generation sends out, W, the sum of the channels; the last one with all later ones.
    pub generations: Vec<f64>,
}

impl ReflectedWave {
    /// Flux of the VPLs, W, the sum of the channels.
    pub fn flux(&self) -> f64 {
        power(&self.vpls)
    }
}

/// A ray that carries flux, W.
struct Photon {
    origin: Vec3,
    direction: Vec3,
    flux: Vec3,
    /// Distance before which surfaces do not count, m.
    t_min: f32,
}

/// A light or all emissive surfaces, and the number of rays that start there in all batches.
struct Source<'a> {
    kind: SourceKind<'a>,
    rays: u32,
    seed: u32,
}

enum SourceKind<'a> {
    Light(Lamp<'a>),
    Surfaces,
}

struct Lamp<'a> {
    light: &'a Light,
    /// See [`Lattice::frame`].
    frame: (Vec3, Mat3),
    /// The sum of [`Lattice::share`] up to each ray's cell and with it, on all its sides; of lights of one profile the same.
    cumulated: Arc<[f64]>,
}

/// Rays that are followed together: one of so many from each source, the number says which.
#[derive(Clone, Copy)]
struct Batch {
    number: u32,
    count: u32,
}

impl Batch {
    /// Place among the rays of all batches.
    fn index(self, place: usize) -> u32 {
        place as u32 * self.count + self.number
    }
}

/// What traces the waves of one scene.
pub struct Tracer<'a> {
    pub(crate) surfaces: &'a Surfaces<'a>,
    emitters: &'a Emitters,
    pub(crate) bounds: Bounds,
    pub(crate) settings: &'a Reflected,
    seed: u32,
    /// Rays of the lattice.
    lattice_rays: u32,
}

impl<'a> Tracer<'a> {
    /// Takes what it needs; `lattice` says how many VPLs there are.
    pub fn new(
        surfaces: &'a Surfaces,
        emitters: &'a Emitters,
        bounds: Bounds,
        lattice: &Lattice,
        settings: &'a Reflected,
        seed: u32,
    ) -> Self {
        Self { surfaces, emitters, bounds, settings, seed, lattice_rays: lattice.rays.len() as u32 }
    }

    /// The VPLs of all lights and emissive surfaces.
    pub fn run(&self, lattice: &Lattice, lights: &[Light], strength: f32) -> ReflectedWave {
        let rays = self.lattice_rays * self.settings.rays;
        let sources = self.sources(lattice, lights, rays);
        let (generations, mut all) = self.trace(lattice, &sources, rays, Batch { number: 0, count: 1 });
        self.sort(&mut all);
        let mut vpls = self.merge(&all);
        for vpl in &mut vpls {
            vpl.intensity *= strength;
        }
        ReflectedWave { vpls, light_flux: self.light_flux(lights), generations }
    }

    /// Flux, W, of each of the VPLs of another run with lights and surfaces as they are now: that of a trace with one of so
    /// many `parts` of the rays, taken in by the nearest. And the flux of all lights, W, the sum of the channels.
    pub fn relight(&self, lattice: &Lattice, lights: &[Light], parts: u32, vpls: &[Vpl]) -> (Vec<Vec3>, f64) {
        let rays = (self.lattice_rays * self.settings.rays / parts).max(1);
        let sources = self.sources(lattice, lights, rays);
        // No batch waits for another between generations, each of which takes less time than threads need to wake.
        let count = (rays / LEAST_OF_BATCH).clamp(1, BATCHES);
        let batches = (0..count).into_par_iter().map(|number| Batch { number, count });
        let all: Vec<Vpl> = batches.flat_map_iter(|batch| self.trace(lattice, &sources, rays, batch).1).collect();
        // They may have moved.
        let mut order: Vec<usize> = (0..vpls.len()).collect();
        order.sort_by_cached_key(|&i| self.key(&vpls[i]));
        let sorted: Vec<Vpl> = order.iter().map(|&i| vpls[i]).collect();
        let mut flux = vec![Vec3::ZERO; vpls.len()];
        for (vpl, nearest) in all.iter().zip(self.nearest(&all, &sorted, false)) {
            if let Some(nearest) = nearest {
                flux[order[nearest]] += vpl.flux();
            }
        }
        (flux, self.light_flux(lights))
    }

    /// What a batch of about so many rays in each generation leaves where they meet surfaces, and the flux of each
    /// generation.
    fn trace(&self, lattice: &Lattice, sources: &[Source], rays: u32, batch: Batch) -> (Vec<f64>, Vec<Vpl>) {
        let left = MOST_HITS.saturating_sub(u64::from(rays) * u64::from(self.settings.bounces));
        let later = (rays / LATER).min((left / u64::from(LAST_GENERATION)) as u32);
        let [rays, later] = [rays, later].map(|rays| (rays / batch.count).max(1));
        let mut photons: Vec<Photon> = sources.iter().flat_map(|source| self.emit(lattice, source, batch)).collect();
        let (mut generations, mut all): (Vec<f64>, Vec<Vpl>) = (Vec::new(), Vec::new());
        let mut last_flux = 0.0;
        for generation in 1..=LAST_GENERATION {
            let hits = self.arrive(&photons, generation, batch);
            let flux = power(&hits);
            match generations.last_mut() {
                // The last one stands for all later ones too.
                Some(last) if generation > self.settings.bounces => *last += flux,
                _ => generations.push(flux),
            }
            let ratio = flux / last_flux;
            last_flux = flux;
            if flux <= generations[0] * FAINT || generation == LAST_GENERATION {
                // What is left of the series, as if it were geometric.
                let rest = if ratio < 1.0 { (1.0 / (1.0 - ratio)).min(100.0) } else { 1.0 };
                if let Some(last) = generations.last_mut() {
                    *last += flux * (rest - 1.0);
                }
                all.extend(hits.into_iter().map(|vpl| Vpl { intensity: vpl.intensity * rest as f32, ..vpl }));
                break;
            }
            let rays = if generation < self.settings.bounces { rays } else { later };
            photons = self.send_on(&hits, rays, generation, batch);
            all.extend(hits);
        }
        (generations, all)
    }

    /// Flux of all lights and emissive surfaces, W, the sum of the channels.
    fn light_flux(&self, lights: &[Light]) -> f64 {
        lights.iter().map(|light| self.flux(light)).sum::<f64>() + self.emitters.flux()
    }

    fn flux(&self, light: &Light) -> f64 {
        f64::from(light.flux(self.bounds.radius()).element_sum())
    }

    /// All lights and emissive surfaces, with as many rays for each as it has of the flux.
    fn sources<'l>(&self, lattice: &Lattice, lights: &'l [Light], rays: u32) -> Vec<Source<'l>> {
        let total = f64::from(rays) / self.light_flux(lights);
        let rays = |flux: f64| (flux * total).round().max(1.0) as u32;
        let mut sources: Vec<Source> = Vec::new();
        for (number, light) in lights.iter().enumerate().filter(|(_, light)| self.flux(light) > 0.0) {
            let known = sources.iter().find_map(|source| match &source.kind {
                SourceKind::Light(lamp) if lamp.light.profile == light.profile => Some(lamp.cumulated.clone()),
                _ => None,
            });
            let cumulated = known.unwrap_or_else(|| cumulated_shares(lattice, light.profile));
            let frame = Lattice::frame(light, self.bounds.center(), self.bounds.radius());
            let (rays, seed) = (rays(self.flux(light)), hash(self.seed ^ hash(number as u32)));
            sources.push(Source { kind: SourceKind::Light(Lamp { light, frame, cumulated }), rays, seed });
        }
        if self.emitters.flux() > 0.0 {
            let seed = hash(self.seed ^ 0x2545_f491);
            sources.push(Source { kind: SourceKind::Surfaces, rays: rays(self.emitters.flux()), seed });
        }
        sources
    }

    /// The rays of a batch from a source.
    fn emit<'s>(
        &'s self,
        lattice: &'s Lattice,
        source: &'s Source,
        batch: Batch,
    ) -> impl Iterator<Item = Photon> + use<'s, 'a> {
        // So that where each source has few rays these are not all of one batch.
        let first = (batch.number + source.seed % batch.count) % batch.count;
        let photon = move |i| match &source.kind {
            SourceKind::Light(lamp) => self.emit_from_light(lattice, lamp, source, i),
            SourceKind::Surfaces => self.emit_from_surfaces(source, i),
        };
        (first..source.rays).step_by(batch.count as usize).filter_map(photon)
    }

    /// A ray from a light, one cell of the lattice after the other, as many from each as it has of the flux; a ray starts
    /// anywhere in its cell.
    fn emit_from_light(&self, lattice: &Lattice, lamp: &Lamp, source: &Source, i: u32) -> Option<Photon> {
        let Lamp { light, frame: (center, world_from_light), cumulated } = lamp;
        let (sides, total) = (sides(light.profile), cumulated.last()?);
        let [along, x, y, _] = point(i, 0, source.seed);
        let target = (f64::from(i) + f64::from(along)) / f64::from(source.rays) * total;
        let cell = cumulated.partition_point(|&sum| sum <= target).min(cumulated.len() - 1);
        let share = cumulated[cell] - if cell > 0 { cumulated[cell - 1] } else { 0.0 };
        let weight = (total / (share * f64::from(source.rays))) as f32;
        let ray = &lattice.rays[cell / sides];
        let (mut direction, measure) = lattice.within(ray, [x, y], light.profile);
        if cell % sides == 1 {
            direction.z = -direction.z;
        }
        let photon = match light.profile {
            // The lattice seen along the axis is a disc that covers the scene.
            Profile::Directional => Photon {
                origin: *center + *world_from_light * (direction * Vec3::new(1.0, 1.0, 0.0)) * self.bounds.radius(),
                direction: light.axis,
                t_min: 0.0,
                flux: light.flux(self.bounds.radius()) * (measure * weight),
            },
            profile => Photon {
                origin: *center,
                direction: *world_from_light * direction,
                // A lamp may stand in the surface that it is fixed to.
                t_min: self.little(),
                flux: light.intensity * (profile.value(direction.z) * measure * weight),
            },
        };
        (photon.flux != Vec3::ZERO).then_some(photon)
    }

    /// A ray of a cosine distribution from an emissive surface.
    fn emit_from_surfaces(&self, source: &Source, i: u32) -> Option<Photon> {
        let [pick, x, y, side] = point(i, 0, source.seed);
        let pick = ((f64::from(i) + f64::from(pick)) / f64::from(source.rays)) as f32;
        let from = self.emitters.emit(self.surfaces.scene, [pick, x, y, side])?;
        let [x, y, ..] = point(i, 1, source.seed);
        Some(Photon {
            origin: from.position,
            direction: Quat::from_rotation_arc(Vec3::Z, from.normal) * cosine_direction([x, y]),
            flux: from.radiance * (PI / (from.density * source.rays as f32)),
            t_min: 0.0,
        })
    }

    /// What the photons leave where they meet surfaces, in spatial order.
    fn arrive(&self, photons: &[Photon], generation: u32, batch: Batch) -> Vec<Vpl> {
        let seed = hash(self.seed ^ hash(generation ^ 0x7f4a_7c15));
        let vpl = |(number, photon): (usize, &Photon)| {
            let (_, surface) = self.surfaces.closest(photon.origin, photon.direction, photon.t_min, false)?;
            // A glossy surface sends on what its lobe has, too, as if it were Lambertian.
            let points: [_; 4] = std::array::from_fn(|k| {
                let [choice, x, y, _] = point(4 * batch.index(number) + k as u32, 0, seed);
                [choice, x, y]
            });
            let flux = photon.flux * surface.brdf.reflectance(surface.normal, -photon.direction.normalize(), &points);
            let intensity = flux / PI;
            let shines = !surface.culled && intensity.max_element() > 0.0 && flux.is_finite();
            let (position, direction) = (surface.start(surface.geometric_normal), surface.geometric_normal);
            shines.then(|| Vpl::lambertian(position, direction, intensity, 0.0))
        };
        // One of several batches has a thread already.
        let least = if batch.count > 1 { photons.len().max(1) } else { LEAST_OF_BATCH as usize };
        let mut vpls: Vec<Vpl> = photons.par_iter().enumerate().with_min_len(least).filter_map(vpl).collect();
        self.sort(&mut vpls);
        vpls
    }

    /// Spatial order: a systematic sample of such a list is spread evenly over the surfaces.
    pub(crate) fn sort(&self, vpls: &mut [Vpl]) {
        vpls.sort_by_cached_key(|vpl| self.key(vpl));
    }

    pub(crate) fn key(&self, vpl: &Vpl) -> u64 {
        let extent = (self.bounds.max - self.bounds.min).max_element().max(f32::MIN_POSITIVE);
        (main_direction(vpl.direction) << 60) | morton((vpl.position - self.bounds.min) / extent)
    }

    /// Merges VPLs, in spatial order, to as many as are to light the scene.
    fn merge(&self, all: &[Vpl]) -> Vec<Vpl> {
        let count = self.lattice_rays * self.settings.bounces;
        let spare = count / SPARE;
        let stream = |number: u32| hash(self.seed ^ hash(number ^ 0x1b87_3593));
        // On the scale of what is to come: told on a finer one, small objects have fewer VPLs than they need.
        let coarse = sampling::by_power(all, count, stream(2), 0);
        let of_coarse: Vec<f64> = (0..coarse.len()).into_par_iter().map(|i| self.radiosity(&coarse, i)).collect();
        let weight = |(place, near): (usize, &Option<usize>)| {
            // Where the sample has nothing, what is there tells for itself.
            let radiosity = near.map_or_else(|| self.radiosity(all, place), |near| of_coarse[near]);
            f64::from(all[place].flux().element_sum()) / radiosity.powf(EVENNESS)
        };
        let weights: Vec<f64> = self.nearest(all, &coarse, true).par_iter().enumerate().map(weight).collect();
        let (mut vpls, alone) = self.cluster(all, &weights, count - spare, stream(0), spare > 0);

        // What no centre is near has centres of its own.
        let (alone, weights): (Vec<Vpl>, Vec<f64>) = alone.into_iter().map(|i| (all[i], weights[i])).unzip();
        vpls.extend(self.cluster(&alone, &weights, count - vpls.len() as u32, stream(1), false).0);
        self.sort(&mut vpls);
        vpls
    }

    /// Chooses centres by weight, each of which takes in the flux of all that are nearest to it and moves to the one in
    /// their middle: a step of k-means (Lloyd 1982), as Prutkin et al. 2012 cluster the texels of reflective shadow maps.
    /// With `within_reach` it is those in reach alone, see [`Self::nearest`]; the places of the others come second.
    fn cluster(
        &self,
        all: &[Vpl],
        weights: &[f64],
        count: u32,
        seed: u32,
        within_reach: bool,
    ) -> (Vec<Vpl>, Vec<usize>) {
        let centers = sampling::by_weight(all, weights, count, seed, 0);
        let (mut members, mut alone) = (vec![Vec::new(); centers.len()], Vec::new());
        for (i, center) in self.nearest(all, &centers, within_reach).into_iter().enumerate() {
            match center {
                Some(center) => members[center].push(i),
                None => alone.push(i),
            }
        }
        let merged = |members: &Vec<usize>| {
            let weight = members.iter().map(|&i| weights[i]).sum::<f64>();
            let middle = members.iter().map(|&i| all[i].position.as_dvec3() * (weights[i] / weight)).sum::<DVec3>();
            let distance = |&&i: &&usize| all[i].position.as_dvec3().distance_squared(middle);
            let &i = members.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
            let flux = members.iter().map(|&i| all[i].flux().as_dvec3()).sum::<DVec3>();
            Some(Vpl { intensity: flux.as_vec3() / PI, ..all[i] })
        };
        (members.par_iter().filter_map(merged).collect(), alone)
    }

    /// The nearest of `centers` to each of `all`, one on the same side if there is any; with `within_reach` only such, and
    /// only up to about as far as they are from each other. Both lists are in spatial order.
    fn nearest(&self, all: &[Vpl], centers: &[Vpl], within_reach: bool) -> Vec<Option<usize>> {
        let keys: Vec<u64> = centers.iter().map(|center| self.key(center)).collect();
        let reach = |i: usize| {
            neighbours(centers, i, WINDOW).get(NEAR).map_or(f32::INFINITY, |near| 2.0 * near.offset.length())
        };
        let reaches: Vec<f32> = match within_reach {
            true => (0..centers.len()).into_par_iter().map(reach).collect(),
            false => Vec::new(),
        };
        let find = |vpl: &Vpl| {
            let key = self.key(vpl);
            let place = keys.partition_point(|&other| other < key);
            // Those on another side are farther than any on the same.
            let (mut nearest, mut least) = (None, (true, f32::INFINITY));
            let first = place.saturating_sub(WINDOW);
            let window = &centers[first..centers.len().min(place + WINDOW)];
            for (i, center) in (first..).zip(window) {
                let turned = center.direction.dot(vpl.direction) <= SAME_SIDE;
                let found = (turned, center.position.distance_squared(vpl.position));
                if nearest.is_none() || found < least {
                    (nearest, least) = (Some(i), found);
                }
            }
            let (turned, distance) = (least.0, least.1.sqrt());
            nearest.filter(|&i| !within_reach || (!turned && distance <= reaches[i].max(self.least_distance())))
        };
        all.par_iter().map(find).collect()
    }

    /// About so many rays of a cosine distribution from VPLs drawn by power.
    fn send_on(&self, hits: &[Vpl], rays: u32, generation: u32, batch: Batch) -> Vec<Photon> {
        let share = power(hits) / f64::from(rays);
        let seed = hash(self.seed ^ hash(generation ^ 0x9e37_79b9));
        let mut photons = Vec::with_capacity(rays as usize);
        for vpl in sampling::by_power(hits, rays, hash(self.seed ^ batch.number), generation) {
            let to_world = Quat::from_rotation_arc(Vec3::Z, vpl.direction);
            let drawn = (f64::from(vpl.flux().element_sum()) / share).round().max(1.0);
            for _ in 0..drawn as u32 {
                let [x, y, ..] = point(batch.index(photons.len()), 0, seed);
                photons.push(Photon {
                    origin: vpl.position,
                    direction: to_world * cosine_direction([x, y]),
                    flux: vpl.flux() / drawn as f32,
                    t_min: 0.0,
                });
            }
        }
        photons
    }

    /// What closer neighbours count as, m: a narrow beam may leave all of them in one point.
    pub(crate) fn least_distance(&self) -> f32 {
        self.little().max(1e-18)
    }

    /// A distance, m, that is next to nothing in the scene.
    fn little(&self) -> f32 {
        (LITTLE * self.bounds.radius()).min(MOST_LITTLE)
    }

    /// Flux that goes out around a VPL of a list in spatial order, W/m², the sum of the channels; not nothing.
    fn radiosity(&self, vpls: &[Vpl], place: usize) -> f64 {
        let mut near = neighbours(vpls, place, WINDOW);
        near.truncate(NEAR + 1);
        let reached = near.last().map_or(0.0, |near| near.offset.length()).max(self.least_distance());
        let around: f64 = near.iter().map(|near| f64::from(near.flux)).sum();
        (around / (f64::from(reached).powi(2) * std::f64::consts::PI)).max(f64::MIN_POSITIVE)
    }
}

/// One of those around a VPL.
pub(crate) struct Neighbour {
    /// Its place in the list.
    pub place: usize,
    /// How it stands to the VPL, m.
    pub offset: Vec3,
    /// Flux, W, the sum of the channels.
    pub flux: f32,
}

/// Those around a VPL of a list in spatial order, nearest first and itself among them: that face about as it does.
pub(crate) fn neighbours(vpls: &[Vpl], place: usize, window: usize) -> Vec<Neighbour> {
    neighbours_of(&vpls[place], vpls, place, window)
}

/// As [`neighbours`], of a VPL that may be none of the list but would stand at that place.
pub(crate) fn neighbours_of(vpl: &Vpl, vpls: &[Vpl], place: usize, window: usize) -> Vec<Neighbour> {
    let around = place.saturating_sub(window)..vpls.len().min(place + window + 1);
    let mut near: Vec<Neighbour> = around
        .map(|place| (place, &vpls[place]))
        .filter(|(_, other)| other.direction.dot(vpl.direction) > SAME_SIDE)
        .map(|(place, other)| Neighbour {
            place,
            offset: other.position - vpl.position,
            flux: other.flux().element_sum(),
        })
        .collect();
    near.sort_by(|a, b| a.offset.length_squared().total_cmp(&b.offset.length_squared()));
    near
}

/// A point light has the lattice on either side of its plane.
fn sides(profile: Profile) -> usize {
    if profile == Profile::Point { 2 } else { 1 }
}

/// See [`Lamp::cumulated`].
fn cumulated_shares(lattice: &Lattice, profile: Profile) -> Arc<[f64]> {
    let shares = lattice.rays.iter().flat_map(|ray| std::iter::repeat_n(lattice.share(ray, profile), sides(profile)));
    shares
        .scan(0.0, |total, share| {
            *total += share;
            Some(*total)
        })
        .collect()
}

fn power(vpls: &[Vpl]) -> f64 {
    vpls.iter().map(|vpl| f64::from(vpl.flux().element_sum())).sum()
}

/// An Owen-scrambled Sobol point (Burley 2020); any index.
fn point(index: u32, set: u32, seed: u32) -> [f32; 4] {
    sobol_burley::sample_4d(index & 0xffff, set, seed.wrapping_add(index >> 16))
}

impl Lattice {
    /// About the share of the flux that goes through a ray's cell; not nothing where anything does.
    fn share(&self, ray: &Ray, profile: Profile) -> f64 {
        let [inner, middle, outer] = [0.0, 0.5, 1.0].map(|x| {
            let (direction, measure) = self.within(ray, [x, 0.5], profile);
            f64::from(profile.value(direction.z) * measure)
        });
        // Profiles fall off from the axis.
        ((inner + middle + outer) / 3.0).max(0.1 * inner)
    }

    /// A direction within a ray's cell, from two numbers in [0, 1), and the measure of the cell: its solid angle, sr,
    /// or for a directional light its share of the disc that the hemisphere is along its axis.
    fn within(&self, ray: &Ray, [x, y]: [f32; 2], profile: Profile) -> (Vec3, f32) {
        let [delta_theta, delta_phi] = self.steps;
        let inner = (ray.theta - 0.5 * delta_theta).max(0.0);
        let outer = (ray.theta + 0.5 * delta_theta).min(FRAC_PI_2);
        // The cell on the axis is a whole cap.
        let width = if ray.theta == 0.0 { TAU } else { delta_phi };
        let phi = ray.phi + width * (y - 0.5);
        let (cosine, measure) = if profile == Profile::Directional {
            let [from, to] = [inner.sin().powi(2), outer.sin().powi(2)];
            ((1.0 - (from + (to - from) * x)).max(0.0).sqrt(), (to - from) * width / TAU)
        } else {
            (inner.cos() + (outer.cos() - inner.cos()) * x, ray.solid_angle)
        };
        let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
        (Vec3::new(sine * phi.cos(), sine * phi.sin(), cosine), measure)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Mat4;

    use crate::Scene;
    use crate::reference::gather;
    use crate::scene::{Instance, Material, Mesh};
    use crate::settings::Settings;

    /// A closed box of albedo ½, seen from inside.
    fn closed_box() -> Scene {
        let mut scene = Scene::builtin("column").unwrap();
        for material in &mut scene.materials {
            *material = Material::lambert("half", Vec3::splat(0.5));
            material.double_sided = true;
        }
        scene
    }

    fn light(position: Vec3, profile: Profile) -> Light {
        let axis = Vec3::new(0.48, -0.6, 0.64);
        Light { name: String::new(), position, axis, intensity: Vec3::new(3.0, 2.0, 1.0), profile }
    }

    fn run(scene: &Scene, settings: &Settings, lights: &[Light], seed: u32) -> ReflectedWave {
        let surfaces = Surfaces::new(scene);
        let lattice = Lattice::new(&settings.wave).unwrap();
        let emitters = Emitters::new(scene);
        let bounds = scene.bounds().unwrap();
        let tracer = Tracer::new(&surfaces, &emitters, bounds, &lattice, &settings.reflected, seed);
        let mut wave = tracer.run(&lattice, lights, 1.0);
        tracer.lay_patches(&mut wave.vpls, usize::MAX);
        wave
    }

    const PROFILES: [Profile; 4] =
        [Profile::Uniform, Profile::Cosine, Profile::Spot { inner: 0.2, outer: 0.6 }, Profile::Point];

    /// Of flux Φ in a closed room of albedo ½, Φ/2ⁿ is reflected in the n-th generation and Φ in all.
    #[test]
    fn a_closed_room_keeps_the_flux_of_the_series() {
        let scene = closed_box();
        let center = scene.lights[0].position;
        for profile in PROFILES {
            for (bounces, seed) in [(1, 1), (5, 2)] {
                let mut settings = Settings::default();
                settings.reflected.bounces = bounces;
                let light = light(center, profile);
                let total = f64::from(light.flux(1.0).element_sum());
                let wave = run(&scene, &settings, &[light], seed);
                assert_eq!(wave.generations.len(), bounces as usize);
                for (n, flux) in wave.generations.iter().enumerate() {
                    let last = n + 1 == bounces as usize;
                    let expected = total * 0.5f64.powi(n as i32 + 1) * if last { 2.0 } else { 1.0 };
                    assert!((flux / expected - 1.0).abs() < 0.01, "{profile:?} {n}: {flux} {expected}");
                }
                let of_vpls = power(&wave.vpls);
                assert!((of_vpls / wave.generations.iter().sum::<f64>() - 1.0).abs() < 1e-4, "{of_vpls}");
                assert!(wave.vpls.len() <= 1297 * bounces as usize && wave.vpls.len() > 1100 * bounces as usize);
                // The colour stays that of the light.
                let color = wave.vpls.iter().map(Vpl::flux).sum::<Vec3>();
                assert!((color / color.x - Vec3::new(1.0, 2.0 / 3.0, 1.0 / 3.0)).abs().max_element() < 1e-3);
            }
        }
    }

    /// A wall 1e5 m away does not make a room the light's own surroundings, which are not looked at.
    #[test]
    fn what_is_far_away_takes_no_light() {
        let power = |scene: &Scene| power(&run(scene, &Settings::default(), &scene.lights, 1).vpls);
        let mut scene = Scene::builtin("cornell").unwrap();
        let without = power(&scene);
        let far = glam::Mat4::from_translation(Vec3::splat(1e5));
        scene.instances.push(Instance { world_from_object: far, ..scene.instances[0] });
        let ratio = power(&scene) / without;
        assert!((ratio - 1.0).abs() < 0.01, "{ratio}");
    }

    /// A square of 2 m under a sun that stands obliquely: E cos θ times its area arrives.
    #[test]
    fn a_directional_light_reaches_what_faces_it() {
        let mut material = Material::lambert("", Vec3::splat(0.25));
        material.double_sided = true;
        let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
        let mesh = Mesh {
            positions: corners.map(|[x, z]| Vec3::new(x, 0.0, z)).to_vec(),
            normals: vec![Vec3::Y; 4],
            indices: vec![0, 2, 1, 0, 3, 2],
            ..Mesh::default()
        };
        let scene = Scene {
            meshes: vec![mesh.into()],
            materials: vec![material],
            instances: vec![Instance { mesh: 0, world_from_object: glam::Mat4::IDENTITY }],
            ..Scene::default()
        };
        let sun = light(Vec3::ZERO, Profile::Directional);
        let wave = run(&scene, &Settings::default(), std::slice::from_ref(&sun), 1);
        let expected = 6.0 * 0.6 * 4.0 * 0.25;
        assert!((wave.generations[0] / expected - 1.0).abs() < 0.01, "{:?} {expected}", wave.generations);
        assert!(wave.vpls.iter().all(|v| v.direction.y > 0.99 && v.position.abs().max_element() <= 1.0001));
    }

    /// A point light of π W/sr in the middle of a unit sphere.
    fn sphere() -> Scene {
        let bulb = Light { intensity: Vec3::splat(PI), ..light(Vec3::ZERO, Profile::Point) };
        Scene {
            meshes: vec![crate::reference::truth_tests::sphere(0).into()],
            materials: vec![Material::lambert("", Vec3::new(0.5, 0.25, 0.75))],
            instances: vec![Instance { mesh: 0, world_from_object: glam::Mat4::IDENTITY }],
            lights: vec![bulb],
            ..Scene::default()
        }
    }

    /// What a glossy or metallic surface reflects is not its base colour: Φ times the reflectance that light along the
    /// normal has is sent on.
    #[test]
    fn a_glossy_sphere_reflects_what_its_lobe_has() {
        for (metallic, roughness) in [(0.0, 0.3), (1.0, 0.8)] {
            let mut scene = sphere();
            let material = &mut scene.materials[0];
            (material.specular, material.metallic, material.roughness) = (1.0, metallic, roughness);
            let brdf = crate::reference::brdf::Brdf {
                base: material.base_color.truncate(),
                metallic,
                roughness,
                specular: 1.0,
            };
            let points: Vec<_> = (0..1 << 14).map(|i| [0, 1, 2].map(|k| point(i, 0, 9)[k])).collect();
            let expected = brdf.reflectance(Vec3::Z, Vec3::Z, &points);
            assert!((expected / brdf.base - 1.0).abs().max_element() > 0.03, "{expected}");
            let wave = run(&scene, &Settings::default(), &scene.lights, 1);
            let ratio = wave.generations[0] / f64::from((expected * 4.0 * PI * PI).element_sum());
            assert!((ratio - 1.0).abs() < 5e-3, "metallic {metallic}: {ratio}");
        }
    }

    /// Every reflection lights the sphere evenly with ρ times the light before: ρ²/(1 − ρ) is reflected twice or more.
    #[test]
    fn vpls_light_a_sphere_as_the_series_does() {
        let scene = sphere();
        let mut settings = Settings::default();
        let camera = crate::Camera::look_at(Vec3::new(0.2, 0.1, -0.3), Vec3::new(-0.4, 0.0, 0.7), 1.2).unwrap();
        let options = crate::RenderOptions::new(24, 24, camera);
        for radius in [0.5, 3.0] {
            settings.reflected.radius = radius;
            let vpls = run(&scene, &settings, &scene.lights, 1).vpls;
            let sum = gather::Sum { occlusion: true, specular: true };
            let picture = gather::Pictures::new(&Surfaces::new(&scene), &vpls, &options, sum, &mut |_| ());
            let mean = picture.bounded.iter().map(|&c| Vec3::from(c)).sum::<Vec3>() / 576.0;
            let ratio = mean / Vec3::new(0.5, 0.25 / 3.0, 2.25);
            println!("radius {radius}: {ratio}");
            assert!((ratio - 1.0).abs().max_element() < 0.02, "radius {radius}: {ratio}");
        }
    }

    /// A lamp in the wall that it is fixed to sends its light into the room, as one just before the wall does.
    #[test]
    fn a_light_in_a_surface_shines() {
        let scene = closed_box();
        let ceiling = Vec3::new(1.0, 3.0, 1.0);
        for profile in PROFILES {
            let flux = |below: f32| {
                let lamp = Light { axis: Vec3::NEG_Y, ..light(ceiling - Vec3::Y * below, profile) };
                run(&scene, &Settings::default(), &[lamp], 1).generations[0]
            };
            let (at, before) = (flux(0.0), flux(0.01));
            // Of a point light one half goes into the ceiling.
            let before = if profile == Profile::Point { 0.5 * before } else { before };
            assert!((at / before - 1.0).abs() < 0.01, "{profile:?}: {at} {before}");
        }
    }

    /// A beam so narrow that all its VPLs are in one place, and of light that surfaces hardly take up.
    #[test]
    fn nothing_but_numbers_comes_of_a_beam_and_of_white_walls() {
        let mut scene = closed_box();
        for material in &mut scene.materials {
            *material = Material { double_sided: true, ..Material::lambert("white", Vec3::splat(0.98)) };
        }
        let beam = light(scene.lights[0].position, Profile::Spot { inner: 0.0, outer: 1e-6 });
        let lamp = light(scene.lights[0].position, Profile::Point);
        for lights in [[beam, lamp.clone()].to_vec(), [lamp].to_vec()] {
            let wave = run(&scene, &Settings::default(), &lights, 1);
            let finite = |vpl: &Vpl| vpl.intensity.is_finite() && vpl.extent.iter().all(|side| side.is_finite());
            assert!(wave.vpls.iter().all(|vpl| finite(vpl) && vpl.d_min.is_finite() && vpl.near().is_finite()));
            // Φ ρ / (1 − ρ).
            let ratio = wave.flux() / wave.light_flux / 49.0;
            assert!((ratio - 1.0).abs() < 0.02, "{ratio}");
        }
    }

    /// A sphere of radiance L that reflects ρ: of its flux π L A it reflects ρ, of that ρ again, and shows L ρ/(1 − ρ)
    /// more than its own.
    #[test]
    fn an_emissive_sphere_reflects_its_own_light() {
        let mut scene = sphere();
        scene.lights.clear();
        scene.materials[0].emissive = Vec3::new(1.0, 2.0, 3.0);
        let wave = run(&scene, &Settings::default(), &[], 1);
        let flux = wave.vpls.iter().map(Vpl::flux).sum::<Vec3>();
        let area = 4.0 * PI;
        let expected = scene.materials[0].emissive * Vec3::new(1.0, 1.0 / 3.0, 3.0) * (PI * area);
        let ratio = flux / expected;
        assert!((ratio - 1.0).abs().max_element() < 0.02, "{flux} {expected}");
        // Both of its sides shine.
        let emitted = Emitters::new(&scene).flux();
        assert!((emitted / f64::from(2.0 * 6.0 * PI * area) - 1.0).abs() < 0.01, "{emitted}");
    }

    /// Two spheres, one with 20 times the light: it has 20^0.3 times the VPLs, and all of them have their flux.
    #[test]
    fn dim_places_have_more_vpls_than_their_power() {
        let mut scene = sphere();
        let apart = Vec3::X * 8.0;
        scene.instances.push(Instance { mesh: 0, world_from_object: glam::Mat4::from_translation(apart) });
        scene.lights.push(light(apart, Profile::Point));
        (scene.lights[0].intensity, scene.lights[1].intensity) = (Vec3::splat(20.0), Vec3::ONE);
        let mut settings = Settings::default();
        // Enough that hardly one is drawn twice.
        settings.reflected.rays = 64;
        let wave = run(&scene, &settings, &scene.lights, 1);
        let (bright, dim): (Vec<Vpl>, Vec<Vpl>) = wave.vpls.iter().partition(|vpl| vpl.position.x < 4.0);
        let ratio = bright.len() as f64 / dim.len() as f64 / 20f64.powf(1.0 - EVENNESS);
        assert!((ratio - 1.0).abs() < 0.1, "{} {}", bright.len(), dim.len());
        assert!((power(&bright) / power(&dim) / 20.0 - 1.0).abs() < 0.02, "{}", power(&bright) / power(&dim));
    }

    /// The mean distance to the nearest neighbour over that of as many points that chance alone sets: the index of Clark &
    /// Evans (1954), 1.47 here. A systematic sample along the curve has 1.21.
    #[test]
    fn clusters_stand_apart_from_each_other() {
        let scene = sphere();
        let wave = run(&scene, &Settings::default(), &scene.lights, 1);
        let nearest = |(i, vpl): (usize, &Vpl)| {
            let others = wave.vpls.iter().enumerate().filter(|(k, _)| *k != i).map(|(_, other)| other);
            f64::from(others.map(|o| o.position.distance_squared(vpl.position)).fold(f32::MAX, f32::min).sqrt())
        };
        let mean = wave.vpls.iter().enumerate().map(nearest).sum::<f64>() / wave.vpls.len() as f64;
        let index = mean / (0.5 * (4.0 * std::f64::consts::PI / wave.vpls.len() as f64).sqrt());
        println!("{index}");
        assert!(index > 1.35, "{index}");
    }

    /// Hits on two spheres far apart, of two colours; on one so dim that it has hundreds of centres, or one or none.
    #[test]
    fn merged_vpls_have_the_flux_of_their_place_and_its_color() {
        let mut scene = sphere();
        let apart = Mat4::from_translation(Vec3::X * 8.0);
        scene.instances.push(Instance { mesh: 0, world_from_object: apart });
        let (surfaces, emitters) = (Surfaces::new(&scene), Emitters::new(&scene));
        let settings = Settings::default();
        let lattice = Lattice::new(&settings.wave).unwrap();
        for (seed, dim) in [(0, 1e-3), (1, 1e-3), (2, 1e-14), (3, 1e-14), (4, 1e-14), (5, 1e-7)] {
            let bounds = scene.bounds().unwrap();
            let tracer = Tracer::new(&surfaces, &emitters, bounds, &lattice, &settings.reflected, seed);
            let hit = |i: u32| {
                let [x, y, z, w] = point(i, 0, seed);
                let out = (2.0 * Vec3::new(x, y, z) - 1.0).normalize_or(Vec3::X);
                let color = if w < 0.4 { Vec3::X } else { Vec3::new(0.0, 0.5, 1.0) };
                let (center, intensity) = if i.is_multiple_of(8) { (8.0 * Vec3::X, dim) } else { (Vec3::ZERO, 1.0) };
                Vpl::lambertian(center + out, -out, color * intensity, 0.0)
            };
            let mut all: Vec<Vpl> = (0..80_000).map(hit).collect();
            tracer.sort(&mut all);
            let merged = tracer.merge(&all);
            assert!(merged.len() <= 6485, "{}", merged.len());
            let flux = |vpls: &[Vpl], dim: bool| {
                let there = vpls.iter().filter(|vpl| (vpl.position.x > 4.0) == dim);
                there.map(|vpl| vpl.flux().as_dvec3()).sum::<DVec3>()
            };
            let total = (flux(&merged, false) + flux(&merged, true)) / (flux(&all, false) + flux(&all, true));
            assert!((total - 1.0).abs().max_element() < 1e-5, "{total}");
            let dim = flux(&merged, true).element_sum() / flux(&all, true).element_sum();
            println!("{} dim VPLs of {}", merged.iter().filter(|vpl| vpl.position.x > 4.0).count(), merged.len());
            assert!((dim - 1.0).abs() < 0.05, "{dim}");
        }
    }

    #[test]
    fn lights_share_the_rays_by_flux() {
        let scene = closed_box();
        let mut lights = [light(scene.lights[0].position, Profile::Cosine), scene.lights[0].clone()];
        lights[0].intensity = Vec3::X;
        lights[1].intensity = Vec3::Y * 3.0;
        lights[1].profile = Profile::Cosine;
        let wave = run(&scene, &Settings::default(), &lights, 3);
        let flux = |channel: usize| wave.vpls.iter().map(|v| f64::from(v.flux()[channel])).sum::<f64>();
        let share = flux(0) / (flux(0) + flux(1));
        assert!((share - 0.25).abs() < 0.01, "{share}");
        // As many of the rays are red.
        let surfaces = Surfaces::new(&scene);
        let (lattice, emitters) = (Lattice::new(&Settings::default().wave).unwrap(), Emitters::new(&scene));
        let settings = Settings::default().reflected;
        let tracer = Tracer::new(&surfaces, &emitters, scene.bounds().unwrap(), &lattice, &settings, 3);
        let rays = lattice.rays.len() as u32 * settings.rays;
        let sources = tracer.sources(&lattice, &lights, rays);
        let batch = |number| {
            let batch = Batch { number, count: BATCHES };
            sources.iter().flat_map(|source| tracer.emit(&lattice, source, batch)).collect::<Vec<_>>()
        };
        let photons: Vec<Photon> = (0..BATCHES).flat_map(batch).collect();
        assert_eq!(photons.len(), rays as usize);
        let red = photons.iter().filter(|photon| photon.flux.x > 0.0).count() as f64 / photons.len() as f64;
        assert!((red - 0.25).abs() < 1e-3, "{red}");
    }

    /// The flux that VPLs are given anew is that which they have, however many batches and threads it took; nothing of a
    /// light that has a single ray is lost.
    #[test]
    fn relit_vpls_have_the_flux_of_the_series() {
        let scene = closed_box();
        let (surfaces, emitters) = (Surfaces::new(&scene), Emitters::new(&scene));
        let settings = Settings::default();
        let lattice = Lattice::new(&settings.wave).unwrap();
        let tracer =
            |seed| Tracer::new(&surfaces, &emitters, scene.bounds().unwrap(), &lattice, &settings.reflected, seed);
        let lamp =
            |intensity| Light { intensity: Vec3::splat(intensity), ..light(scene.lights[0].position, Profile::Point) };
        let vpls = tracer(1).run(&lattice, &[lamp(1.0)], 1.0).vpls;
        let many: Vec<Light> = (0..100).map(|_| lamp(0.01)).collect();
        let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        for (lights, parts) in [(&[lamp(1.0)][..], 8), (&many, 8), (&many, 400), (&[lamp(1.0)], 1 << 20)] {
            // As many runs as make that many rays.
            let runs = parts.min(64);
            let relit = |seed| tracer(hash(seed)).relight(&lattice, lights, parts, &vpls);
            let sums =
                (0..runs).map(|seed| relit(seed).0.iter().map(|flux| f64::from(flux.element_sum())).sum::<f64>());
            let ratio = sums.sum::<f64>() / f64::from(runs) / relit(0).1;
            println!("{} lights, 1/{parts}: {ratio}", lights.len());
            assert!((ratio - 1.0).abs() < 1e-3, "{parts}: {ratio}");
            assert!(alone.install(|| relit(3)) == relit(3));
        }
        // Of so many parts one is a single ray, which leaves one VPL in each generation at most.
        let lit = tracer(0).relight(&lattice, &[lamp(1.0)], 1 << 20, &vpls).0;
        let lit = lit.iter().filter(|flux| **flux != Vec3::ZERO).count();
        assert!((1..=LAST_GENERATION as usize).contains(&lit), "{lit}");
    }

    #[test]
    fn a_seed_gives_the_same_vpls_on_any_number_of_threads() {
        let scene = Scene::builtin("cornell").unwrap();
        let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let once = run(&scene, &Settings::default(), &scene.lights, 1).vpls;
        assert_eq!(once, alone.install(|| run(&scene, &Settings::default(), &scene.lights, 1).vpls));
        assert_ne!(once, run(&scene, &Settings::default(), &scene.lights, 2).vpls);
    }

    #[test]
    fn without_light_or_surfaces_there_is_nothing() {
        let settings = Settings::default();
        let scene = closed_box();
        assert!(run(&scene, &settings, &[], 1).vpls.is_empty());
        let mut black = scene.lights[0].clone();
        for intensity in [0.0, 1e-41] {
            black.intensity = Vec3::splat(intensity);
            run(&scene, &settings, std::slice::from_ref(&black), 1);
        }
        black.intensity = Vec3::ZERO;
        assert!(run(&scene, &settings, &[black], 1).vpls.is_empty());
    }
}
