//! Surface samples (surfels) of the whole scene, of which every VPL splats its own subset into its imperfect shadow
//! map.
//!
//! They are drawn in proportion to area, in object space, once: a rigid motion of an instance moves them with it.
//! They are ordered along a space-filling curve, one for each of the six main directions of the normal, so that a
//! run of neighbours in the list is a patch of surface; a VPL takes one surfel of every run.

use glam::{Vec3, Vec4};

use crate::Scene;
use crate::scene::AlphaMode;

/// A sample of a surface, in the object space of its instance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surfel {
    /// Index into [`Scene::instances`].
    pub instance: usize,
    /// Position, object space.
    pub position: Vec3,
    /// Unit geometric normal by the winding, object space.
    pub normal: Vec3,
}

/// The surfels of a scene.
#[derive(Clone, Debug)]
pub struct Surfels {
    /// The samples, in the order that the module describes.
    pub list: Vec<Surfel>,
    /// Area that they stand for together, m².
    pub area: f32,
}

impl Surfels {
    /// `count` surfels (a power of two), the same for a scene on every machine; none for a scene without area.
    pub fn new(scene: &Scene, count: u32) -> Self {
        let triangles: Vec<(usize, [u32; 3])> = scene
            .instances
            .iter()
            .enumerate()
            .flat_map(|(i, instance)| {
                scene.meshes[instance.mesh].indices.chunks_exact(3).map(move |t| (i, [t[0], t[1], t[2]]))
            })
            .collect();
        let mut area = 0.0;
        let cumulated: Vec<f64> = triangles
            .iter()
            .map(|&(i, t)| {
                let instance = &scene.instances[i];
                let corner = |k: usize| {
                    let mesh = &scene.meshes[instance.mesh];
                    instance.world_from_object.transform_point3(mesh.positions[t[k] as usize]).as_dvec3()
                };
                area += 0.5 * (corner(1) - corner(0)).cross(corner(2) - corner(0)).length();
                area
            })
            .collect();
        if area <= 0.0 || !area.is_finite() {
            return Self { list: Vec::new(), area: 0.0 };
        }

        // One sample in each of `count` equal shares of the area; Owen-scrambled Sobol points within (Burley 2020).
        let mut keyed: Vec<(u64, Surfel)> = Vec::with_capacity(count as usize);
        let bounds = scene.bounds().unwrap_or(crate::scene::Bounds { min: Vec3::ZERO, max: Vec3::ZERO });
        let extent = (bounds.max - bounds.min).max_element().max(f32::MIN_POSITIVE);
        for index in 0..count {
            let sample = sobol_burley::sample_4d(index & 0xffff, 0, index >> 16);
            let target = (f64::from(index) + f64::from(sample[2])) / f64::from(count) * area;
            let found = cumulated.partition_point(|&sum| sum <= target).min(triangles.len() - 1);
            let (i, t) = triangles[found];
            // Shirley & Chiu's square-root map from the unit square to the triangle.
            let root = sample[0].sqrt();
            let weights = Vec3::new(1.0 - root, root * (1.0 - sample[1]), root * sample[1]);
            if masked_out(scene, i, t, weights) {
                continue;
            }
            let instance = &scene.instances[i];
            let positions = &scene.meshes[instance.mesh].positions;
            let [a, b, c] = t.map(|index| positions[index as usize]);
            let normal = (b - a).cross(c - a).normalize_or_zero();
            if normal == Vec3::ZERO {
                continue;
            }
            let position = a * weights.x + b * weights.y + c * weights.z;
            let normal_ws = instance.world_from_object.inverse().transpose().transform_vector3(normal);
            let position_ws = instance.world_from_object.transform_point3(position);
            let key = (main_direction(normal_ws) << 60) | morton((position_ws - bounds.min) / extent);
            keyed.push((key, Surfel { instance: i, position, normal }));
        }
        // Samples that fell through an alpha mask leave gaps; others stand in, so that the count stays.
        let area = (area * keyed.len() as f64 / f64::from(count)) as f32;
        let kept = keyed.len();
        for index in 0..(count as usize - kept) * usize::from(kept > 0) {
            keyed.push(keyed[index % kept]);
        }
        keyed.sort_by_key(|(key, _)| *key);
        Self { list: keyed.into_iter().map(|(_, surfel)| surfel).collect(), area }
    }

    /// Position (m) and unit normal of every surfel in world space, as the instances stand now.
    pub fn in_world(&self, scene: &Scene) -> Vec<[Vec4; 2]> {
        let normal_matrices: Vec<_> =
            scene.instances.iter().map(|i| i.world_from_object.inverse().transpose()).collect();
        self.list
            .iter()
            .map(|surfel| {
                let position = scene.instances[surfel.instance].world_from_object.transform_point3(surfel.position);
                let normal = normal_matrices[surfel.instance].transform_vector3(surfel.normal);
                [position.extend(1.0), normal.normalize_or_zero().extend(0.0)]
            })
            .collect()
    }
}

/// True where an alpha mask leaves nothing of a point of a triangle (nearest texel).
fn masked_out(scene: &Scene, instance: usize, triangle: [u32; 3], weights: Vec3) -> bool {
    let mesh = &scene.meshes[scene.instances[instance].mesh];
    let material = &scene.materials[mesh.material];
    let AlphaMode::Mask { cutoff } = material.alpha_mode else { return false };
    let mut alpha = material.base_color.w;
    let [a, b, c] = triangle.map(|index| index as usize);
    if !mesh.colors.is_empty() {
        alpha *= mesh.colors[a].w * weights.x + mesh.colors[b].w * weights.y + mesh.colors[c].w * weights.z;
    }
    if let Some(texture) = &material.base_color_texture {
        let uvs = &mesh.uvs[texture.uv_set.min(1)];
        let uv = if uvs.is_empty() {
            glam::Vec2::ZERO
        } else {
            uvs[a] * weights.x + uvs[b] * weights.y + uvs[c] * weights.z
        };
        let sampled = scene.textures[texture.texture];
        let image = &scene.images[sampled.image];
        let uv = texture.uv_transform.transform_point2(uv);
        let wrap = |x: f32, mode, size: u32| {
            let x = match mode {
                crate::scene::Wrap::Clamp => x.clamp(0.0, 1.0),
                crate::scene::Wrap::Repeat => x.rem_euclid(1.0),
                crate::scene::Wrap::Mirror => 1.0 - (x.rem_euclid(2.0) - 1.0).abs(),
            };
            ((x * size as f32) as usize).min(size as usize - 1)
        };
        let x = wrap(uv.x, sampled.sampler.wrap_u, image.width);
        let y = wrap(uv.y, sampled.sampler.wrap_v, image.height);
        alpha *= f32::from(image.rgba[4 * (y * image.width as usize + x) + 3]) / 255.0;
    }
    alpha < cutoff
}

/// Which of ±x, ±y, ±z a vector points along most, 0…5.
fn main_direction(v: Vec3) -> u64 {
    let axis = v.abs().max_position();
    2 * axis as u64 + u64::from(v[axis] < 0.0)
}

/// Interleaves 16 bits of each coordinate 0…1 (Morton 1966).
fn morton(p: Vec3) -> u64 {
    let spread = |x: f32| {
        let bits = (x.clamp(0.0, 1.0) * 65535.0) as u64;
        (0..16).fold(0, |sum, bit| sum | ((bits >> bit) & 1) << (3 * bit))
    };
    spread(p.x) | spread(p.y) << 1 | spread(p.z) << 2
}

#[cfg(test)]
mod tests {
    use glam::{Mat4, Vec2};

    use super::*;
    use crate::scene::{Instance, Material, Mesh};

    /// A unit square in the xy plane, as it is and moved and scaled by three (nine times the area).
    fn squares() -> Scene {
        let mesh = Mesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y],
            normals: vec![Vec3::Z; 4],
            uvs: [vec![Vec2::ZERO; 4], Vec::new()],
            indices: vec![0, 1, 2, 0, 2, 3],
            ..Mesh::default()
        };
        let far = Mat4::from_translation(Vec3::new(0.0, 0.0, 5.0)) * Mat4::from_scale(Vec3::splat(3.0));
        Scene {
            meshes: vec![mesh],
            materials: vec![Material::lambert("", Vec3::ONE)],
            instances: vec![
                Instance { mesh: 0, world_from_object: Mat4::IDENTITY },
                Instance { mesh: 0, world_from_object: far },
            ],
            ..Scene::default()
        }
    }

    #[test]
    fn surfels_lie_on_the_surface_in_proportion_to_world_area() {
        let scene = squares();
        let surfels = Surfels::new(&scene, 4096);
        assert_eq!(surfels.list.len(), 4096);
        assert!((surfels.area - 10.0).abs() < 1e-4);
        let near = surfels.list.iter().filter(|s| s.instance == 0).count();
        assert!((near as i32 - 410).abs() <= 2, "{near}");
        for [position, normal] in surfels.in_world(&scene) {
            assert!(position.z.abs() < 1e-5 || (position.z - 5.0).abs() < 1e-5);
            assert!((normal.truncate() - Vec3::Z).length() < 1e-5);
        }
        // Uniform within a square: each quadrant of the large one has a quarter.
        let far: Vec<_> = surfels.list.iter().filter(|s| s.instance == 1).collect();
        let quadrant = far.iter().filter(|s| s.position.x < 0.5 && s.position.y < 0.5).count();
        assert!((quadrant as f32 / far.len() as f32 - 0.25).abs() < 0.01, "{quadrant} of {}", far.len());
    }

    #[test]
    fn a_rigid_motion_moves_surfels_with_their_instance() {
        let mut scene = squares();
        let surfels = Surfels::new(&scene, 1024);
        let before = surfels.in_world(&scene);
        let motion = Mat4::from_rotation_x(1.0) * Mat4::from_translation(Vec3::new(0.1, 0.2, 0.3));
        scene.instances[0].world_from_object = motion;
        assert_eq!(surfels.list, Surfels::new(&squares(), 1024).list);
        for (surfel, ([a, _], [b, normal])) in surfels.list.iter().zip(before.iter().zip(&surfels.in_world(&scene))) {
            let expected = if surfel.instance == 0 { motion * *a } else { *a };
            assert!((*b - expected).length() < 1e-5);
            let normal_ws = if surfel.instance == 0 { motion.transform_vector3(Vec3::Z) } else { Vec3::Z };
            assert!((normal.truncate() - normal_ws).length() < 1e-5);
        }
    }

    #[test]
    fn runs_of_neighbours_are_patches() {
        let scene = squares();
        let surfels = Surfels::new(&scene, 4096);
        // 64 runs of 64 on 10 m²: a compact patch has 0.16 m², edge 0.4 m; Morton order stays within a few of those.
        let samples = surfels.in_world(&scene);
        let wide = samples.chunks(64).filter(|run| {
            let center = run.iter().map(|s| s[0]).sum::<Vec4>() / 64.0;
            run.iter().any(|s| (s[0] - center).length() > 1.2)
        });
        assert!(wide.count() <= 6);
    }

    #[test]
    fn nothing_stands_where_an_alpha_mask_leaves_nothing() {
        let mut scene = squares();
        scene.materials[0].alpha_mode = AlphaMode::Mask { cutoff: 0.5 };
        scene.meshes[0].colors =
            vec![Vec4::ONE, Vec4::new(1.0, 1.0, 1.0, 0.0), Vec4::new(1.0, 1.0, 1.0, 0.0), Vec4::ONE];
        let surfels = Surfels::new(&scene, 4096);
        assert_eq!(surfels.list.len(), 4096);
        assert!((surfels.area - 5.0).abs() < 0.1, "{}", surfels.area);
        assert!(surfels.list.iter().all(|s| s.position.x <= 0.5 + 1e-5));
        scene.materials[0].base_color.w = 0.1;
        assert!(Surfels::new(&scene, 1024).list.is_empty());
        assert!(Surfels::new(&Scene::default(), 1024).list.is_empty());
    }
}
