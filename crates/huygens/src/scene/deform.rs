//! Morph targets and skins (glTF 2.0, sections 3.7.2.2 and 3.7.3), on the CPU: what comes out is a mesh like any other.

use std::sync::Arc;

use glam::{Affine3A, Mat3A, Vec3, Vec4};
use rayon::prelude::*;

use super::Mesh;

/// A mesh and what deforms it.
#[derive(Debug, Default)]
pub(super) struct Deformable {
    /// As the file has it, without weights and joints.
    pub base: Arc<Mesh>,
    pub targets: Vec<Target>,
    /// Joints that act on a vertex, 0 if none do.
    pub influences: usize,
    /// So many for every vertex: indices into the joints of the skin, and their weights, whose sum is 1.
    pub joints: Vec<u16>,
    pub weights: Vec<f32>,
    /// Every triangle has vertices of its own, which have its normal.
    pub flat: bool,
}

/// What a weight of 1 adds to each vertex; empty where it adds nothing.
#[derive(Debug, Default)]
pub(super) struct Target {
    pub positions: Vec<Vec3>,
    pub normals: Vec<Vec3>,
    pub tangents: Vec<Vec3>,
}

impl Deformable {
    /// Whether anything deforms it, but for a skin.
    pub fn has_targets(&self) -> bool {
        !self.targets.is_empty()
    }

    /// Highest index of a joint that acts on it.
    pub fn last_joint(&self) -> Option<u16> {
        self.joints.iter().copied().max()
    }

    /// The mesh with its targets weighted and its joints at `joints` (object space from the space of the base).
    pub fn deform(&self, weights: &[f32], joints: Option<&[Affine3A]>) -> Mesh {
        let base = &*self.base;
        let joints = joints.filter(|_| self.influences > 0);
        let targets: Vec<(&Target, f32)> =
            self.targets.iter().zip(weights.iter().copied()).filter(|(_, weight)| *weight != 0.0).collect();
        let vertex = |i: usize| {
            let (mut position, mut normal) = (base.positions[i], base.normals[i]);
            let tangent = base.tangents.get(i).copied().unwrap_or(Vec4::ZERO);
            let (mut along, mut handedness) = (tangent.truncate(), tangent.w);
            for &(target, weight) in &targets {
                let delta = |deltas: &[Vec3]| deltas.get(i).map_or(Vec3::ZERO, |&delta| weight * delta);
                position += delta(&target.positions);
                normal += delta(&target.normals);
                along += delta(&target.tangents);
            }
            if let Some(joints) = joints {
                let skin = self.skin(i, joints);
                let matrix = skin.matrix3;
                position = skin.transform_point3(position);
                along = Vec3::from(matrix * glam::Vec3A::from(along));
                let sign = matrix.determinant().signum();
                normal = cofactors(&matrix) * sign * normal;
                handedness *= sign;
            }
            (position, unit(normal, base.normals[i]), along.extend(handedness))
        };
        let mut mesh = Mesh {
            name: base.name.clone(),
            material: base.material,
            uvs: base.uvs.clone(),
            colors: base.colors.clone(),
            indices: base.indices.clone(),
            ..Mesh::default()
        };
        let vertices: Vec<(Vec3, Vec3, Vec4)> = (0..base.positions.len()).into_par_iter().map(vertex).collect();
        mesh.positions = vertices.iter().map(|vertex| vertex.0).collect();
        mesh.normals = vertices.iter().map(|vertex| vertex.1).collect();
        if self.flat {
            for triangle in mesh.indices.chunks_exact(3) {
                let normal = mesh.area_normal(triangle).try_normalize().map(|n| n.as_vec3().normalize());
                for &corner in triangle {
                    let corner = corner as usize;
                    mesh.normals[corner] = normal.unwrap_or(base.normals[corner]);
                }
            }
        }
        if !base.tangents.is_empty() {
            let tangents =
                vertices.iter().zip(&mesh.normals).map(|((.., tangent), &normal)| orthogonal(*tangent, normal));
            mesh.tangents = tangents.collect();
        }
        mesh
    }

    /// The weighted mean of the joints of a vertex.
    fn skin(&self, vertex: usize, joints: &[Affine3A]) -> Affine3A {
        let range = vertex * self.influences..(vertex + 1) * self.influences;
        let mut mean = Affine3A { matrix3: Mat3A::ZERO, translation: glam::Vec3A::ZERO };
        for (&joint, &weight) in self.joints[range.clone()].iter().zip(&self.weights[range]) {
            let joint = &joints[usize::from(joint)];
            mean.matrix3 += joint.matrix3 * weight;
            mean.translation += joint.translation * weight;
        }
        mean
    }
}

/// The inverse transpose times the determinant, which has no poles.
fn cofactors(m: &Mat3A) -> glam::Mat3 {
    let [x, y, z] = [m.x_axis, m.y_axis, m.z_axis].map(Vec3::from);
    glam::Mat3::from_cols(y.cross(z), z.cross(x), x.cross(y))
}

fn unit(v: Vec3, otherwise: Vec3) -> Vec3 {
    v.as_dvec3().try_normalize().map_or(otherwise, |v| v.as_vec3())
}

/// The tangent at right angles to the normal, with handedness ±1; any such vector where it has no direction.
pub(super) fn orthogonal(tangent: Vec4, normal: Vec3) -> Vec4 {
    let xyz = tangent.truncate().as_dvec3().normalize_or_zero().as_vec3();
    let across = (xyz - normal * normal.dot(xyz)).try_normalize().filter(|t| t.dot(normal).abs() < 1e-3);
    across.unwrap_or_else(|| normal.any_orthonormal_vector()).extend(if tangent.w < 0.0 { -1.0 } else { 1.0 })
}

impl Mesh {
    /// Normal of a triangle times twice its area, in f64 so that small triangles have one too.
    pub(super) fn area_normal(&self, triangle: &[u32]) -> glam::DVec3 {
        let [a, b, c] = [0, 1, 2].map(|k| self.positions[triangle[k] as usize].as_dvec3());
        (b - a).cross(c - a)
    }

    /// Largest coordinates without their signs; infinite if one is not finite.
    pub(super) fn extent(&self) -> Vec3 {
        match self.positions.iter().all(|p| p.is_finite()) {
            true => self.positions.iter().fold(Vec3::ZERO, |m, p| m.max(p.abs())),
            false => Vec3::INFINITY,
        }
    }
}
