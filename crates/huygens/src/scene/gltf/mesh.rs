//! Primitives: vertices, triangles, normals and tangents.

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::sync::Arc;

use bevy_mikktspace::{Geometry, TangentSpace, generate_tangents};
use glam::{Vec2, Vec3, Vec4};
use gltf::json::accessor::{ComponentType, GenericComponentType, Type};
use gltf::json::mesh::{Mode, Primitive, Semantic};
use gltf::json::validation::Checked;
use gltf::json::{Accessor, Index};

use super::{Loader, MAX_TEXTURE_COORDINATE, Problem, get};
use crate::scene::animation::MAX_COORDINATE;
use crate::scene::deform::{Deformable, Target, orthogonal};
use crate::scene::{Mesh, TextureRef};

/// Most vertices and indices of all meshes together, without vertices that no triangle uses; what deforms a vertex, and
/// the keys of animations, count as such.
const MAX_ELEMENTS: usize = 20_000_000;
/// Most vertices and keys that are read for them: primitives may share an array and use a part of it each. A vertex that is
/// deformed counts for everything that deforms it.
const MAX_READ: usize = 100_000_000;
/// Most triangles around one vertex for MikkTSpace: it recurses around the vertex, and its time is the square.
const MAX_VALENCE: usize = 256;

impl Loader<'_, '_> {
    /// Converts a primitive; `None` if there is nothing to draw.
    pub(super) fn primitive(&mut self, json: &Primitive, name: &str) -> Problem<Option<Deformable>> {
        let root = self.buffers.root;
        let Checked::Valid(mode) = json.mode else {
            return Err("unknown mode; allowed: 0 to 6".to_owned());
        };
        if !matches!(mode, Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
            self.warn("points and lines are not drawn");
            return Ok(None);
        }
        let attribute = |semantic| json.attributes.get(&Checked::Valid(semantic)).copied();
        let Some(positions) = attribute(Semantic::Positions) else {
            self.warn("a primitive without POSITION is not drawn");
            return Ok(None);
        };
        let count = self.buffers.count(positions)?;
        let corners = json.indices.map_or(Ok(count), |index| self.buffers.count(index))?;
        let indices = if mode == Mode::Triangles { corners } else { corners.saturating_mul(3) };
        self.count_read(count)?;
        self.count_elements(indices)?;

        let material = match json.material {
            Some(index) => {
                get(&root.materials, index.value(), "material")?;
                index.value()
            }
            None => self.default_material(),
        };
        let mut mesh = Mesh { name: name.to_owned(), material, ..Mesh::default() };
        mesh.positions = self.vec3s(positions)?;
        if mesh.positions.iter().any(|p| p.abs().max_element() > MAX_COORDINATE) {
            return Err(format!("POSITION: a coordinate beyond {MAX_COORDINATE:e} m; allowed: up to it"));
        }
        let check = |name: &str, length: usize| match length == count {
            true => Ok(()),
            false => Err(format!("{name} has {length} elements, POSITION has {count}; allowed: as many")),
        };

        let corners = match json.indices {
            Some(index) => self.buffers.indices(&mut self.files, index)?,
            None => (0..count as u32).collect(),
        };
        if let Some(bad) = corners.iter().find(|&&i| i as usize >= count) {
            return Err(format!("index {bad} is out of range; allowed: below {count}, the number of vertices"));
        }
        mesh.indices = triangles(mode, &corners);
        if mesh.indices.is_empty() {
            return Ok(None);
        }
        if mode == Mode::Triangles && !corners.len().is_multiple_of(3) {
            self.warn("a triangle list with an incomplete last triangle, which is not drawn");
        }

        for set in 0..2 {
            if let Some(index) = attribute(Semantic::TexCoords(set)) {
                let uvs = self.buffers.floats(&mut self.files, index, &[Type::Vec2])?;
                check(&format!("TEXCOORD_{set}"), uvs.len())?;
                if uvs.as_flattened().iter().any(|x| x.abs() > MAX_TEXTURE_COORDINATE) {
                    return Err(format!(
                        "TEXCOORD_{set}: a coordinate beyond {MAX_TEXTURE_COORDINATE:e}; allowed: up to it"
                    ));
                }
                mesh.uvs[set as usize] = uvs.into_iter().map(Vec2::from_array).collect();
            }
        }
        if let Some(index) = attribute(Semantic::Colors(0)) {
            let colors = self.buffers.floats(&mut self.files, index, &[Type::Vec3, Type::Vec4])?;
            check("COLOR_0", colors.len())?;
            mesh.colors = colors.into_iter().map(|c| Vec4::from_array(c).clamp(Vec4::ZERO, Vec4::ONE)).collect();
        }
        let normal_texture = self.scene.materials[material].normal_texture;
        let flat = attribute(Semantic::Normals).is_none();
        let mut origin = match attribute(Semantic::Normals) {
            Some(index) => {
                mesh.normals = self.vec3s(index)?;
                check("NORMAL", mesh.normals.len())?;
                if let Some(index) = attribute(Semantic::Tangents).filter(|_| normal_texture.is_some()) {
                    let tangents = self.buffers.floats(&mut self.files, index, &[Type::Vec4])?;
                    check("TANGENT", tangents.len())?;
                    mesh.tangents = tangents.into_iter().map(Vec4::from_array).collect();
                }
                let origin = compact(&mut mesh);
                renormalize(&mut mesh);
                mesh.tangents.iter_mut().zip(&mesh.normals).for_each(|(t, &n)| *t = orthogonal(*t, n));
                origin
            }
            None => flatten(&mut mesh),
        };
        self.count_elements(mesh.positions.len())?;
        if let Some(texture) = normal_texture
            && mesh.tangents.is_empty()
        {
            let split = tangents(&mut mesh, &texture);
            origin.extend(split.into_iter().map(|vertex| origin[vertex as usize]).collect::<Vec<_>>());
        }
        let mut deformable = Deformable { base: Arc::new(mesh), flat, ..Deformable::default() };
        self.targets(json, count, &origin, &mut deformable)?;
        if !root.skins.is_empty() {
            self.joints(json, count, &origin, &mut deformable)?;
        }
        Ok(Some(deformable))
    }

    /// Reads the morph targets of a primitive of `count` vertices, for the vertices that were made of `origin`.
    fn targets(&mut self, json: &Primitive, count: usize, origin: &[u32], out: &mut Deformable) -> Problem<()> {
        for (number, target) in json.targets.iter().flatten().enumerate() {
            let mut deltas = |index: Option<Index<Accessor>>, name: &str| -> Problem<Vec<Vec3>> {
                let Some(index) = index else { return Ok(Vec::new()) };
                let length = self.buffers.count(index)?;
                if length != count {
                    return Err(format!("{name} has {length} elements, POSITION has {count}; allowed: as many"));
                }
                self.count_read(count)?;
                self.count_elements(origin.len())?;
                let deltas = self.vec3s(index)?;
                Ok(origin.iter().map(|&vertex| deltas[vertex as usize]).collect())
            };
            let target = (|| {
                Ok(Target {
                    positions: deltas(target.positions, "POSITION")?,
                    // Flat normals, and tangents along them, are those of the triangles.
                    normals: deltas(target.normals.filter(|_| !out.flat), "NORMAL")?,
                    tangents: deltas(target.tangents.filter(|_| !out.base.tangents.is_empty()), "TANGENT")?,
                })
            })();
            out.targets.push(target.map_err(|e: String| format!("morph target {number}: {e}"))?);
        }
        Ok(())
    }

    /// Reads the joints and weights of a primitive likewise.
    fn joints(&mut self, json: &Primitive, count: usize, origin: &[u32], out: &mut Deformable) -> Problem<()> {
        let mut sets = Vec::new();
        for set in 0.. {
            let attribute = |semantic| json.attributes.get(&Checked::Valid(semantic)).copied();
            let (joints, weights) = match (attribute(Semantic::Joints(set)), attribute(Semantic::Weights(set))) {
                (Some(joints), Some(weights)) => (joints, weights),
                (None, None) => break,
                _ => return Err(format!("only one of JOINTS_{set} and WEIGHTS_{set}; allowed: both")),
            };
            for (name, index) in [("JOINTS", joints), ("WEIGHTS", weights)] {
                let length = self.buffers.count(index)?;
                if length != count {
                    return Err(format!("{name}_{set} has {length} elements, POSITION has {count}; allowed: as many"));
                }
                self.count_read(count)?;
                self.count_elements(origin.len())?;
            }
            let accessor = get(&self.buffers.root.accessors, joints.value(), "accessor")?;
            let whole = match accessor.component_type {
                Checked::Valid(GenericComponentType(kind)) => matches!(kind, ComponentType::U8 | ComponentType::U16),
                Checked::Invalid => false,
            };
            if !whole || accessor.normalized {
                return Err(format!(
                    "JOINTS_{set}: a componentType that does not fit; allowed: 5121, 5123, not normalized"
                ));
            }
            self.check_components(weights, &[ComponentType::F32, ComponentType::U8, ComponentType::U16])
                .map_err(|e| format!("WEIGHTS_{set}: {e}"))?;
            let joints = self.buffers.floats::<4>(&mut self.files, joints, &[Type::Vec4])?;
            let weights = self.buffers.floats::<4>(&mut self.files, weights, &[Type::Vec4])?;
            sets.push((joints, weights));
        }
        out.influences = 4 * sets.len();
        if sets.is_empty() {
            return Ok(());
        }
        for &vertex in origin {
            let start = out.weights.len();
            for (joints, weights) in &sets {
                let pairs = joints[vertex as usize].iter().zip(weights[vertex as usize]);
                for (&joint, weight) in pairs {
                    let weight = weight.max(0.0);
                    // What has no weight may name any joint.
                    out.joints.push(if weight > 0.0 { joint as u16 } else { 0 });
                    out.weights.push(weight);
                }
            }
            let weights = &mut out.weights[start..];
            let sum: f32 = weights.iter().sum();
            match sum > 0.0 && sum.is_finite() {
                true => weights.iter_mut().for_each(|weight| *weight /= sum),
                false => {
                    weights.fill(0.0);
                    weights[0] = 1.0;
                    out.joints[start] = 0;
                }
            }
        }
        Ok(())
    }

    pub(super) fn count_read(&mut self, more: usize) -> Problem<()> {
        self.read = self.read.saturating_add(more);
        match self.read > MAX_READ {
            true => Err(format!("the file is too large; allowed: {MAX_READ} vertices and keys to read in all")),
            false => Ok(()),
        }
    }

    pub(super) fn count_elements(&mut self, more: usize) -> Problem<()> {
        self.elements = self.elements.saturating_add(more);
        match self.elements > MAX_ELEMENTS {
            true => Err(format!("the file is too large; allowed: {MAX_ELEMENTS} vertices and indices in all meshes")),
            false => Ok(()),
        }
    }

    fn vec3s(&mut self, index: Index<Accessor>) -> Problem<Vec<Vec3>> {
        let values = self.buffers.floats(&mut self.files, index, &[Type::Vec3])?;
        Ok(values.into_iter().map(Vec3::from_array).collect())
    }
}

/// Triangle list of a list, strip or fan, with the specification's winding.
fn triangles(mode: Mode, corners: &[u32]) -> Vec<u32> {
    match mode {
        Mode::TriangleStrip => corners
            .windows(3)
            .enumerate()
            .flat_map(|(i, w)| if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[0], w[2], w[1]] })
            .collect(),
        Mode::TriangleFan => {
            corners.get(1..).unwrap_or_default().windows(2).flat_map(|w| [w[0], w[1], corners[0]]).collect()
        }
        _ => corners[..corners.len() / 3 * 3].to_vec(),
    }
}

/// Makes the vertices `indices` of a mesh its vertices.
fn gather(mesh: &mut Mesh, indices: &[u32]) {
    fn pick<T: Copy>(values: &mut Vec<T>, indices: &[u32]) {
        if !values.is_empty() {
            *values = indices.iter().map(|&i| values[i as usize]).collect();
        }
    }
    pick(&mut mesh.positions, indices);
    pick(&mut mesh.normals, indices);
    pick(&mut mesh.tangents, indices);
    pick(&mut mesh.colors, indices);
    pick(&mut mesh.uvs[0], indices);
    pick(&mut mesh.uvs[1], indices);
}

/// Drops vertices that no triangle uses; the others keep their order. Returns which they were.
fn compact(mesh: &mut Mesh) -> Vec<u32> {
    let mut new = vec![u32::MAX; mesh.positions.len()];
    mesh.indices.iter().for_each(|&i| new[i as usize] = 0);
    let used: Vec<u32> = (0..new.len() as u32).filter(|&i| new[i as usize] == 0).collect();
    if used.len() < new.len() {
        (0..).zip(&used).for_each(|(i, &old)| new[old as usize] = i);
        gather(mesh, &used);
        mesh.indices.iter_mut().for_each(|i| *i = new[*i as usize]);
    }
    used
}

/// Gives every triangle vertices of its own, and them its normal: the specification asks for flat normals where a
/// file has none. Returns which vertices they were.
fn flatten(mesh: &mut Mesh) -> Vec<u32> {
    let normals = mesh.indices.chunks_exact(3).flat_map(|triangle| {
        [mesh.area_normal(triangle).try_normalize().map_or(Vec3::Y, |n| n.as_vec3().normalize()); 3]
    });
    let normals = normals.collect();
    let indices = std::mem::take(&mut mesh.indices);
    gather(mesh, &indices);
    mesh.normals = normals;
    mesh.indices = (0..mesh.positions.len() as u32).collect();
    indices
}

/// Makes normals unit vectors; one without a direction becomes the mean of the triangles around it.
fn renormalize(mesh: &mut Mesh) {
    let unit = |n: Vec3| n.as_dvec3().try_normalize().map(|n| n.as_vec3());
    if mesh.normals.iter().any(|&n| unit(n).is_none()) {
        let mut sums = vec![glam::DVec3::ZERO; mesh.normals.len()];
        for triangle in mesh.indices.chunks_exact(3) {
            let normal = mesh.area_normal(triangle);
            triangle.iter().for_each(|&i| sums[i as usize] += normal);
        }
        for (normal, sum) in mesh.normals.iter_mut().zip(sums) {
            if unit(*normal).is_none() {
                *normal = sum.try_normalize().map_or(Vec3::Y, |n| n.as_vec3());
            }
        }
    }
    mesh.normals.iter_mut().for_each(|n| *n = unit(*n).unwrap_or(Vec3::Y));
}

/// A mesh as MikkTSpace sees it, with one tangent for every corner (zero where there is none).
struct Corners<'a> {
    mesh: &'a Mesh,
    /// Triangles without two corners in one place: MikkTSpace's time for those others is the square of their number.
    faces: Vec<usize>,
    uvs: Vec<Vec2>,
    tangents: Vec<Vec4>,
}

impl Geometry for Corners<'_> {
    fn num_faces(&self) -> usize {
        self.faces.len()
    }

    fn num_vertices_of_face(&self, _: usize) -> usize {
        3
    }

    fn position(&self, face: usize, vert: usize) -> [f32; 3] {
        self.mesh.positions[self.vertex(face, vert)].to_array()
    }

    fn normal(&self, face: usize, vert: usize) -> [f32; 3] {
        self.mesh.normals[self.vertex(face, vert)].to_array()
    }

    fn tex_coord(&self, face: usize, vert: usize) -> [f32; 2] {
        self.uvs[self.vertex(face, vert)].to_array()
    }

    fn set_tangent(&mut self, space: Option<TangentSpace>, face: usize, vert: usize) {
        let normal = self.mesh.normals[self.vertex(face, vert)];
        let tangent = space.map_or(Vec4::W, |s| Vec4::from_array(s.tangent_encoded()));
        self.tangents[self.faces[face] * 3 + vert] = orthogonal(tangent, normal);
    }
}

impl Corners<'_> {
    fn vertex(&self, face: usize, vert: usize) -> usize {
        self.mesh.indices[self.faces[face] * 3 + vert] as usize
    }

    /// Most corners that MikkTSpace takes for one vertex.
    fn valence(&self) -> usize {
        let mut corners = HashMap::<[u32; 8], usize>::new();
        for &i in &self.mesh.indices {
            let i = i as usize;
            let ([px, py, pz], [nx, ny, nz]) = (self.mesh.positions[i].to_array(), self.mesh.normals[i].to_array());
            // Adding 0 makes −0 the same as 0.
            let key = [px, py, pz, nx, ny, nz, self.uvs[i].x, self.uvs[i].y].map(|x| (x + 0.0).to_bits());
            *corners.entry(key).or_default() += 1;
        }
        corners.into_values().max().unwrap_or(0)
    }

    /// Tangents from the sums of the triangles around each vertex (Lengyel 2001).
    fn simple(&mut self) {
        let mut sums = vec![[glam::DVec3::ZERO; 2]; self.mesh.positions.len()];
        for t in self.mesh.indices.chunks_exact(3) {
            let [p, q, r] = [0, 1, 2].map(|k| self.mesh.positions[t[k] as usize].as_dvec3());
            let [u, v, w] = [0, 1, 2].map(|k| self.uvs[t[k] as usize].as_dvec2());
            let ((e, f), (a, b)) = ((q - p, r - p), (v - u, w - u));
            let sign = a.perp_dot(b).signum();
            for &i in t {
                sums[i as usize][0] += (e * b.y - f * a.y) * sign;
                sums[i as usize][1] += (f * a.x - e * b.x) * sign;
            }
        }
        for (tangent, &i) in self.tangents.iter_mut().zip(&self.mesh.indices) {
            let (normal, [s, t]) = (self.mesh.normals[i as usize], sums[i as usize]);
            let handedness = normal.as_dvec3().cross(s).dot(t).signum() as f32;
            *tangent = orthogonal(s.normalize_or_zero().as_vec3().extend(handedness), normal);
        }
    }
}

/// Generates tangents along the normal texture's own axes (its transform included); vertices whose triangles
/// disagree are split. Returns what the new ones were split from.
fn tangents(mesh: &mut Mesh, texture: &TextureRef) -> Vec<u32> {
    let zero = vec![Vec2::ZERO; mesh.positions.len()];
    let uvs = if mesh.uvs[texture.uv_set].is_empty() { &zero } else { &mesh.uvs[texture.uv_set] };
    // Upwards, as a normal texture has its y axis; glTF's v runs down.
    let up = |uv: &Vec2| texture.uv_transform.transform_point2(*uv) * Vec2::new(1.0, -1.0);
    let uvs = uvs.iter().map(up).collect();
    let apart = |face: &usize| {
        let [a, b, c] = [0, 1, 2].map(|k| mesh.positions[mesh.indices[face * 3 + k] as usize]);
        a != b && b != c && c != a
    };
    let faces = (0..mesh.indices.len() / 3).filter(apart).collect();
    let mut corners = Corners { mesh, faces, uvs, tangents: vec![Vec4::ZERO; mesh.indices.len()] };
    if corners.valence() > MAX_VALENCE || generate_tangents(&mut corners).is_err() {
        corners.simple();
    }
    let tangents = corners.tangents;

    let vertices = mesh.positions.len();
    mesh.tangents = vec![Vec4::ZERO; vertices];
    let mut split = HashMap::<(u32, [u32; 4]), u32>::new();
    let mut from = Vec::new();
    for (corner, tangent) in tangents.into_iter().enumerate() {
        let vertex = mesh.indices[corner] as usize;
        if mesh.tangents[vertex] == Vec4::ZERO {
            mesh.tangents[vertex] = tangent;
        }
        if mesh.tangents[vertex] == tangent || tangent == Vec4::ZERO {
            continue;
        }
        mesh.indices[corner] = match split.entry((vertex as u32, tangent.to_array().map(f32::to_bits))) {
            Entry::Occupied(entry) => *entry.get(),
            Entry::Vacant(entry) => {
                let new = mesh.positions.len() as u32;
                from.push(vertex as u32);
                mesh.positions.push(mesh.positions[vertex]);
                mesh.normals.push(mesh.normals[vertex]);
                mesh.tangents.push(tangent);
                if let Some(&color) = mesh.colors.get(vertex) {
                    mesh.colors.push(color);
                }
                for uvs in &mut mesh.uvs {
                    if let Some(&uv) = uvs.get(vertex) {
                        uvs.push(uv);
                    }
                }
                *entry.insert(new)
            }
        };
    }
    // Vertices of triangles without area alone.
    for (tangent, &normal) in mesh.tangents.iter_mut().zip(&mesh.normals).filter(|(t, _)| **t == Vec4::ZERO) {
        *tangent = orthogonal(Vec4::W, normal);
    }
    from
}
