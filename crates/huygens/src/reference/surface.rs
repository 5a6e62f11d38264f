//! What a ray meets: the point of a surface with its material, as `shaders/gbuffer.frag` writes it, but with textures
//! at their finest level.

use std::sync::Arc;

use glam::{Mat4, Vec3, Vec4};

use super::brdf::Brdf;
use super::bvh::SEGMENT_ENDS;
use super::{Bvh, Hit};
use crate::Scene;
use crate::scene::AlphaMode;
use crate::scene::texture::{Transfer, interpolate};

/// A point of a surface, seen from one side.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    /// Position, m, world space.
    pub position: Vec3,
    /// Unit geometric normal of the side that is seen.
    pub geometric_normal: Vec3,
    /// Unit shading normal of that side: interpolated, normal map applied.
    pub normal: Vec3,
    /// What is reflected; black base colour for an unlit material.
    pub brdf: Brdf,
    /// Radiance that this side emits, W/(m² sr); nothing for an unlit material.
    pub emission: Vec3,
    /// The base colour of an unlit material, which shows it and takes no part in lighting.
    pub unlit: Option<Vec3>,
    /// What the occlusion texture leaves of indirect light, 0…1. The path tracer does not look at it.
    pub occlusion: f32,
    /// Whether this is the back of a single-sided material, which is not drawn and reflects nothing.
    pub culled: bool,
    /// Distance, m, beyond which rounding cannot put a point on the wrong side of the surface.
    margin: f32,
}

impl Surface {
    /// A point on the side toward `direction`, away from the surface by more than rounding: where a ray starts.
    pub fn start(&self, direction: Vec3) -> Vec3 {
        self.position + self.geometric_normal * self.margin.copysign(self.geometric_normal.dot(direction))
    }
}

/// A scene's surfaces as rays find them: masked texels are holes.
pub struct Surfaces<'a> {
    /// The scene.
    pub scene: &'a Scene,
    tree: Arc<Tree>,
}

/// What rays need besides the scene; it may outlive a borrow of it.
#[derive(Clone)]
pub(crate) struct Tree {
    bvh: Bvh,
    normal_from_object: Vec<Mat4>,
}

impl Tree {
    pub fn new(scene: &Scene) -> Self {
        Self { bvh: Bvh::new(scene), normal_from_object: normal_from_object(scene) }
    }

    /// As [`Bvh::follow`].
    pub fn follow(&mut self, scene: &Scene) {
        self.bvh.follow(scene);
        self.normal_from_object = normal_from_object(scene);
    }
}

fn normal_from_object(scene: &Scene) -> Vec<Mat4> {
    scene.instances.iter().map(|i| i.world_from_object.inverse().transpose()).collect()
}

impl<'a> Surfaces<'a> {
    /// Builds the tree.
    pub fn new(scene: &'a Scene) -> Self {
        Self::with(scene, Arc::new(Tree::new(scene)))
    }

    /// With a tree that was built for the scene as it is.
    pub(crate) fn with(scene: &'a Scene, tree: Arc<Tree>) -> Self {
        Self { scene, tree }
    }

    /// The nearest surface on a ray that starts at `origin` (t in lengths of `direction`), and the hit itself. With
    /// `cull`, the backs of single-sided materials are not there, as on the screen.
    pub fn closest(&self, origin: Vec3, direction: Vec3, t_min: f32, cull: bool) -> Option<(Hit, Surface)> {
        let counts = |hit: &Hit| self.is_there(hit) && !(cull && self.is_culled(hit, direction));
        let hit = self.tree.bvh.closest_where(origin, direction, t_min, f32::INFINITY, counts)?;
        Some((hit, self.at(&hit, direction)))
    }

    /// Whether anything stands between `start`, which is off every surface ([`Surface::start`]), and a point that may
    /// lie on one. Both sides of a surface cast shadows.
    pub fn occluded(&self, start: Vec3, to: Vec3) -> bool {
        self.tree.bvh.hits_where(start, to - start, [0.0, 1.0 - SEGMENT_ENDS], |hit| self.is_there(hit))
    }

    /// Whether there is anything on the ray from `start`, which is off every surface.
    pub fn hits(&self, start: Vec3, direction: Vec3) -> bool {
        self.tree.bvh.hits_where(start, direction, [0.0, f32::INFINITY], |hit| self.is_there(hit))
    }

    fn is_there(&self, hit: &Hit) -> bool {
        let mesh = &self.scene.meshes[self.scene.instances[hit.instance].mesh];
        let material = &self.scene.materials[mesh.material];
        let AlphaMode::Mask { cutoff } = material.alpha_mode else { return true };
        let (corners, weights) = (corners(mesh, hit.triangle), weights(hit));
        self.scene.base_color(material, mesh, corners, weights).w >= cutoff
    }

    fn is_culled(&self, hit: &Hit, direction: Vec3) -> bool {
        let mesh = &self.scene.meshes[self.scene.instances[hit.instance].mesh];
        !self.scene.materials[mesh.material].double_sided && hit.normal.dot(direction) > 0.0
    }

    fn at(&self, hit: &Hit, direction: Vec3) -> Surface {
        let scene = self.scene;
        let instance = &scene.instances[hit.instance];
        let mesh = &scene.meshes[instance.mesh];
        let material = &scene.materials[mesh.material];
        let (corners, weights) = (corners(mesh, hit.triangle), weights(hit));
        let vertices = corners.map(|corner| instance.world_from_object.transform_point3(mesh.positions[corner]));
        let [a, b, c] = vertices;
        // From the corners: more exact than along the ray.
        let position = a + (b - a) * weights.y + (c - a) * weights.z;

        let front = hit.normal.dot(direction) <= 0.0;
        let side = if front { 1.0 } else { -1.0 };
        let normal = interpolate(&mesh.normals, corners, weights);
        let normal = self.tree.normal_from_object[hit.instance].transform_vector3(normal).normalize_or(hit.normal);
        let normal = match &material.normal_texture {
            Some(texture) if !mesh.tangents.is_empty() => {
                let texel = scene.sample(texture, mesh.uv(texture, corners, weights), Transfer::Linear).truncate();
                let bent = texel * 2.0 - 1.0;
                let tangent = interpolate(&mesh.tangents, corners, weights);
                self.bend(
                    normal,
                    tangent,
                    bent.truncate().extend(0.0) * material.normal_scale + Vec3::Z * bent.z,
                    instance,
                )
            }
            _ => normal,
        };

        let base = scene.base_color(material, mesh, corners, weights).truncate();
        let sampled = |texture: &Option<_>, transfer| {
            texture.as_ref().map_or(Vec4::ONE, |t| scene.sample(t, mesh.uv(t, corners, weights), transfer))
        };
        let metallic_roughness = sampled(&material.metallic_roughness_texture, Transfer::Linear);
        let culled = !front && !material.double_sided;
        let shines = !material.unlit && !culled;
        Surface {
            position,
            geometric_normal: hit.normal * side,
            normal: normal * side,
            brdf: Brdf {
                base: if material.unlit { Vec3::ZERO } else { base },
                metallic: material.metallic * metallic_roughness.z,
                roughness: material.roughness * metallic_roughness.y,
                specular: if material.unlit { 0.0 } else { material.specular },
            },
            emission: if shines && material.emissive != Vec3::ZERO {
                material.emissive * sampled(&material.emissive_texture, Transfer::Srgb).truncate()
            } else {
                Vec3::ZERO
            },
            unlit: material.unlit.then_some(base),
            occlusion: 1.0
                + material.occlusion_strength * (sampled(&material.occlusion_texture, Transfer::Linear).x - 1.0),
            culled,
            margin: margin(&vertices),
        }
    }

    /// A normal bent by a tangent-space one.
    fn bend(&self, normal: Vec3, tangent: Vec4, bent: Vec3, instance: &crate::scene::Instance) -> Vec3 {
        let handedness = tangent.w.signum() * instance.world_from_object.determinant().signum();
        let tangent = instance.world_from_object.transform_vector3(tangent.truncate());
        let tangent = (tangent - normal * normal.dot(tangent)).normalize_or_zero();
        let bitangent = normal.cross(tangent) * handedness;
        (tangent * bent.x + bitangent * bent.y + normal * bent.z).normalize_or(normal)
    }
}

/// Distance, m, from a triangle beyond which rounding cannot put a point of it on the wrong side.
pub(super) fn margin(vertices: &[Vec3; 3]) -> f32 {
    let largest = vertices.iter().fold(0.0_f32, |m, v| m.max(v.abs().max_element()));
    (largest * 4e-6).max(f32::MIN_POSITIVE)
}

fn corners(mesh: &crate::scene::Mesh, triangle: usize) -> [usize; 3] {
    mesh.indices.as_chunks::<3>().0[triangle].map(|index| index as usize)
}

fn weights(hit: &Hit) -> Vec3 {
    let [v, w] = hit.barycentric.to_array();
    Vec3::new(1.0 - v - w, v, w)
}
