//! Triangles that shine, drawn by their power: for the path tracer, and as VPLs that stand for squares of them.

use std::f32::consts::PI;

use glam::Vec3;

use super::surface::margin;
use super::{Hit, Surface};
use crate::Scene;
use crate::lattice::Vpl;
use crate::sampling::on_triangle;
use crate::scene::AlphaMode;
use crate::scene::texture::Transfer;

/// The emissive triangles of a scene.
pub struct Emitters {
    triangles: Vec<Emitter>,
    /// Sums of power up to and with each triangle.
    cumulated: Vec<f64>,
    /// For each instance: the density by area, 1/m², of a point of each triangle; empty where nothing shines.
    densities: Vec<Vec<f32>>,
}

/// A point of one side of an emissive triangle.
#[derive(Clone, Copy, Debug)]
pub struct Emission {
    /// Position, m, off the surface.
    pub position: Vec3,
    /// Unit normal of the side.
    pub normal: Vec3,
    /// Radiance, W/(m² sr).
    pub radiance: Vec3,
    /// Density by the area of this side, 1/m², with which it was drawn.
    pub density: f32,
}

struct Emitter {
    vertices: [Vec3; 3],
    instance: usize,
    index: usize,
}

impl Emitters {
    /// Finds them. A triangle's power is its area times its mean emission over a grid of points, at least a
    /// hundredth of what it would have without its texture (a lamp may be smaller than the grid).
    pub fn new(scene: &Scene) -> Self {
        let mut emitters = Self { triangles: Vec::new(), cumulated: Vec::new(), densities: Vec::new() };
        let mut total = 0.0;
        for (i, instance) in scene.instances.iter().enumerate() {
            let mesh = &scene.meshes[instance.mesh];
            let material = &scene.materials[mesh.material];
            let mut densities = Vec::new();
            let sides = if material.double_sided { 2.0 } else { 1.0 };
            if material.emissive.max_element() > 0.0 && !material.unlit {
                for (index, corners) in mesh.indices.as_chunks::<3>().0.iter().enumerate() {
                    let corners = corners.map(|corner| corner as usize);
                    let vertices = corners.map(|c| instance.world_from_object.transform_point3(mesh.positions[c]));
                    let area = area(&vertices);
                    let factor = material.emissive.element_sum();
                    let mean = material.emissive_texture.as_ref().map_or(factor, |texture| {
                        let at = |i: u32| {
                            let [u, v] = [i % 8, i / 8].map(|k| (k as f32 + 0.5) / 8.0);
                            let uv = mesh.uv(texture, corners, on_triangle([u, v]));
                            (material.emissive * scene.sample(texture, uv, Transfer::Srgb).truncate()).element_sum()
                        };
                        ((0..64).map(at).sum::<f32>() / 64.0).max(0.01 * factor)
                    });
                    total += area * f64::from(sides * mean);
                    emitters.cumulated.push(total);
                    emitters.triangles.push(Emitter { vertices, instance: i, index });
                    densities.push(sides * mean);
                }
            }
            emitters.densities.push(densities);
        }
        for density in emitters.densities.iter_mut().flatten() {
            *density = (f64::from(*density) / total) as f32;
        }
        emitters
    }

    /// Density, 1/sr, with which [`Emitters::sample`] finds that surface from `position`.
    pub fn pdf(&self, position: Vec3, hit: &Hit, surface: &Surface) -> f32 {
        let Some(density) = self.densities[hit.instance].get(hit.triangle) else { return 0.0 };
        let d = surface.position - position;
        let cosine = d.normalize_or_zero().dot(surface.geometric_normal).abs();
        density * d.length_squared() / cosine.max(1e-6)
    }

    /// About the flux of all emissive triangles, W, the sum of the channels.
    pub fn flux(&self) -> f64 {
        self.cumulated.last().map_or(0.0, |total| total * std::f64::consts::PI)
    }

    /// A point on one side of an emissive triangle, from four numbers in [0, 1). `None` in a hole, or if nothing shines.
    pub fn emit(&self, scene: &Scene, [pick, x, y, side]: [f32; 4]) -> Option<Emission> {
        let (emitter, weights) = self.pick(pick, [x, y])?;
        let radiance = emitter.radiance(scene, weights)?;
        let density = self.densities[emitter.instance][emitter.index];
        let (front, double_sided) = emitter.front(scene);
        let (normal, density) = match double_sided {
            false => (front, density),
            true => (if side < 0.5 { front } else { -front }, 0.5 * density),
        };
        let position = emitter.point(weights) + normal * margin(&emitter.vertices);
        Some(Emission { position, normal, radiance, density })
    }

    /// VPLs on the emissive triangles, about as many as asked for: each stands for a square of their area.
    pub fn vpls(&self, scene: &Scene, count: u32, seed: u32) -> Vec<Vpl> {
        let vpl = |i: u32| {
            let [pick, x, y, side] = sobol_burley::sample_4d(i & 0xffff, 0, seed.wrapping_add(i >> 16));
            let pick = ((f64::from(i) + f64::from(pick)) / f64::from(count)) as f32;
            let point = self.emit(scene, [pick, x, y, side])?;
            let area = 1.0 / (point.density * count as f32);
            Some(Vpl::lambertian(point.position, point.normal, point.radiance * area, (area / PI).sqrt()))
        };
        (0..count).filter_map(vpl).collect()
    }

    fn pick(&self, pick: f32, on_it: [f32; 2]) -> Option<(&Emitter, Vec3)> {
        let total = self.cumulated.last().copied().filter(|&total| total > 0.0)?;
        let found = self.cumulated.partition_point(|&sum| sum <= f64::from(pick) * total);
        Some((&self.triangles[found.min(self.triangles.len() - 1)], on_triangle(on_it)))
    }

    /// A point on an emissive triangle, from three numbers in [0, 1): direction to it, its radiance, its density as
    /// seen from `position` (1/sr), the point itself. `None` if nothing shines, or not to this side.
    pub fn sample(&self, scene: &Scene, position: Vec3, [pick, x, y]: [f32; 3]) -> Option<(Vec3, Vec3, f32, Vec3)> {
        let (emitter, weights) = self.pick(pick, [x, y])?;
        let point = emitter.point(weights);
        let d = point - position;
        let l = d.try_normalize()?;
        let (front, double_sided) = emitter.front(scene);
        if !double_sided && front.dot(l) >= 0.0 {
            return None;
        }
        let radiance = emitter.radiance(scene, weights)?;
        let density = self.densities[emitter.instance][emitter.index];
        let pdf = density * d.length_squared() / front.dot(l).abs().max(1e-6);
        Some((l, radiance, pdf, point))
    }
}

impl Emitter {
    fn point(&self, weights: Vec3) -> Vec3 {
        let [a, b, c] = self.vertices;
        a * weights.x + b * weights.y + c * weights.z
    }

    /// Unit normal of the front, and whether the back shines too.
    fn front(&self, scene: &Scene) -> (Vec3, bool) {
        let [a, b, c] = self.vertices.map(|vertex| vertex.as_dvec3());
        let normal = (b - a).cross(c - a).normalize_or_zero().as_vec3();
        // Counter-clockwise from the front in the mesh; an instance that mirrors turns the cross product round.
        let instance = &scene.instances[self.instance];
        let material = &scene.materials[scene.meshes[instance.mesh].material];
        (normal * instance.world_from_object.determinant().signum(), material.double_sided)
    }

    /// What the point emits, W/(m² sr); `None` in a hole.
    fn radiance(&self, scene: &Scene, weights: Vec3) -> Option<Vec3> {
        let mesh = &scene.meshes[scene.instances[self.instance].mesh];
        let material = &scene.materials[mesh.material];
        let corners = mesh.indices.as_chunks::<3>().0[self.index].map(|corner| corner as usize);
        if let AlphaMode::Mask { cutoff } = material.alpha_mode
            && scene.base_color(material, mesh, corners, weights).w < cutoff
        {
            return None;
        }
        let texture = material.emissive_texture.as_ref();
        let texel = texture.map(|t| scene.sample(t, mesh.uv(t, corners, weights), Transfer::Srgb).truncate());
        Some(material.emissive * texel.unwrap_or(Vec3::ONE))
    }
}

fn area([a, b, c]: &[Vec3; 3]) -> f64 {
    0.5 * (b - a).as_dvec3().cross((c - a).as_dvec3()).length()
}
