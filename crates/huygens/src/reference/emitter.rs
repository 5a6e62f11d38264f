//! Triangles that shine, drawn by their power.

use glam::Vec3;

use super::surface::Surfaces;
use super::{Hit, Surface};
use crate::Scene;
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
                    total += area * f64::from(mean);
                    emitters.cumulated.push(total);
                    emitters.triangles.push(Emitter { vertices, instance: i, index });
                    densities.push(mean);
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

    /// A point on an emissive triangle, from three numbers in [0, 1): direction to it, its radiance, its density as
    /// seen from `position` (1/sr), the point itself. `None` if nothing shines, or not to this side.
    pub fn sample(
        &self,
        surfaces: &Surfaces,
        position: Vec3,
        [pick, x, y]: [f32; 3],
    ) -> Option<(Vec3, Vec3, f32, Vec3)> {
        let total = self.cumulated.last().copied().filter(|&total| total > 0.0)?;
        let found = self.cumulated.partition_point(|&sum| sum <= f64::from(pick) * total);
        let emitter = &self.triangles[found.min(self.triangles.len() - 1)];
        let weights = on_triangle([x, y]);
        let [a, b, c] = emitter.vertices;
        let point = a * weights.x + b * weights.y + c * weights.z;
        let normal = (b - a).as_dvec3().cross((c - a).as_dvec3()).normalize_or_zero().as_vec3();
        let d = point - position;
        let l = d.try_normalize()?;

        let scene = surfaces.scene;
        let instance = &scene.instances[emitter.instance];
        let mesh = &scene.meshes[instance.mesh];
        let material = &scene.materials[mesh.material];
        // Counter-clockwise from the front in the mesh; an instance that mirrors turns the cross product round.
        let front = normal * instance.world_from_object.determinant().signum();
        if !material.double_sided && front.dot(l) >= 0.0 {
            return None;
        }
        let corners = mesh.indices.as_chunks::<3>().0[emitter.index].map(|corner| corner as usize);
        if let AlphaMode::Mask { cutoff } = material.alpha_mode
            && scene.base_color(material, mesh, corners, weights).w < cutoff
        {
            return None;
        }
        let mut radiance = material.emissive;
        if let Some(texture) = &material.emissive_texture {
            radiance *= scene.sample(texture, mesh.uv(texture, corners, weights), Transfer::Srgb).truncate();
        }
        let density = self.densities[emitter.instance][emitter.index];
        let pdf = density * d.length_squared() / normal.dot(l).abs().max(1e-6);
        Some((l, radiance, pdf, point))
    }
}

fn area([a, b, c]: &[Vec3; 3]) -> f64 {
    0.5 * (b - a).as_dvec3().cross((c - a).as_dvec3()).length()
}
