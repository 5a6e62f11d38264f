//! Rays against all triangles of a scene, in world space, through a bounding volume hierarchy.
//!
//! The trees come from `obvhs` (PLOC with reinsertion): one over all instances that have never moved, and one for each
//! that has. Where they move on, boxes are fitted to them, and only the top level, over those trees, is built anew.
//! Traversal and triangle test are our own, because both must be watertight: a ray at an edge or vertex that triangles
//! share hits at least one of them. The triangle test is Woop, Benthin and Wald, "Watertight Ray/Triangle
//! Intersection" (JCGT 2013); the box test is widened as Ize, "Robust BVH Ray Traversal" (JCGT 2013) has it. Of surfaces
//! at the same distance the one that comes first in the scene is hit, so that what the tree was before does not matter.
//!
//! Surfaces count from both sides. Textures are not looked at: whoever wants rays to pass where an alpha mask leaves
//! nothing asks with [`Bvh::closest_where`] and [`Bvh::occluded_where`].

use std::ops::Range;
use std::sync::Arc;
use std::time::Duration;

use glam::{Mat4, Vec2, Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::builder::build_bvh2;
use obvhs::bvh2::node::Bvh2Node;

use crate::Scene;
use crate::scene::{Instance, Mesh};

/// Share of a segment that [`Bvh::occluded`] leaves out at either end, so that the surfaces that its ends lie on do
/// not count: 1 mm in 10 m. It is far above the rounding of a hit point (about 1e-6 of its coordinates), so that even
/// rays at 0.1° to a surface get away from it.
pub(super) const SEGMENT_ENDS: f32 = 1e-4;

/// Where a ray meets a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance along the ray, in lengths of its direction.
    pub t: f32,
    /// Index into [`Scene::instances`].
    pub instance: usize,
    /// Which triangle of the instance's mesh; its indices are `mesh.indices[3 · triangle ..][..3]`.
    pub triangle: usize,
    /// Weights of the triangle's second and third vertex; the first has the rest to 1.
    pub barycentric: Vec2,
    /// Unit geometric normal of the triangle's front, world space: the side from which it is counter-clockwise in its
    /// mesh, whether the instance mirrors it or not (as glTF has it).
    pub normal: Vec3,
}

/// All triangles of a scene, for ray queries from any number of threads.
#[derive(Clone)]
pub struct Bvh {
    /// Part after part, each with its root first and children after their parents, and then the top level, whose leaves
    /// are roots of the parts.
    nodes: Vec<Bvh2Node>,
    /// Index of the root of the top level; there is none in a scene without triangles.
    root: usize,
    /// Part after part, in the order of the leaves.
    triangles: Vec<Triangle>,
    parts: Vec<Part>,
    /// Of each instance of the scene.
    instances: Vec<Placed>,
    /// How far from the origin of coordinates vertices may be for the boxes to be wide enough, m.
    reach: f32,
}

/// The tree of one instance, or that of all which have never moved.
#[derive(Clone)]
struct Part {
    nodes: Range<usize>,
    triangles: Range<usize>,
    /// How far from the origin of coordinates its vertices get, along any axis, m.
    farthest: f32,
}

/// An instance as the tree has it.
#[derive(Clone)]
struct Placed {
    mesh: Arc<Mesh>,
    world_from_object: Mat4,
    /// Whether it has a part of its own, because it has moved.
    moves: bool,
}

/// A triangle in world space, counter-clockwise from the front.
#[derive(Clone, Copy)]
struct Triangle {
    vertices: [Vec3; 3],
    /// Whether the last two vertices are swapped against the mesh, because the instance mirrors.
    swapped: bool,
    instance: u32,
    index: u32,
}

impl Triangle {
    fn new(mesh: &Mesh, transform: &Mat4, instance: u32, index: u32) -> Self {
        let corners = mesh.indices.as_chunks::<3>().0[index as usize];
        let at = |k: usize| transform.transform_point3(mesh.positions[corners[k] as usize]);
        let swapped = transform.determinant() < 0.0;
        let vertices = if swapped { [at(0), at(2), at(1)] } else { [at(0), at(1), at(2)] };
        Self { vertices, swapped, instance, index }
    }

    fn hit(&self, t: f32, [u, v, w]: [f32; 3]) -> Hit {
        let [a, b, c] = self.vertices.map(Vec3::as_dvec3);
        let sum = u + v + w;
        Hit {
            t,
            instance: self.instance as usize,
            triangle: self.index as usize,
            barycentric: if self.swapped { Vec2::new(w, v) } else { Vec2::new(v, w) } / sum,
            // In f64, where the product of even the shortest edges does not underflow.
            normal: (b - a).cross(c - a).normalize().as_vec3(),
        }
    }

    fn bounds(&self, margin: f32) -> Aabb {
        let [a, b, c] = self.vertices.map(Vec3A::from);
        Aabb::new(a.min(b).min(c) - margin, a.max(b).max(c) + margin)
    }
}

/// Nodes of a tree over boxes, the root first, children after their parents; and the boxes in the order of its leaves.
fn build(boxes: &[Aabb], params: BvhBuildParams) -> (Vec<Bvh2Node>, Vec<u32>) {
    if boxes.is_empty() {
        return (Vec::new(), Vec::new());
    }
    let mut tree = build_bvh2(boxes, params, &mut Duration::default());
    tree.reorder_in_stack_traversal_order();
    (tree.nodes, tree.primitive_indices)
}

impl Bvh {
    /// Builds the tree over all instances of `scene`. A scene without triangles is allowed; nothing is hit in it.
    pub fn new(scene: &Scene) -> Self {
        Self::with(scene, |_| false)
    }

    /// Brings the tree to what `scene` has become. An instance that has moved or bent for the first time gets a tree of
    /// its own, for which all is built anew; after that its boxes are fitted, and the top level is built. A scene with
    /// another number of instances is taken for another one.
    pub fn follow(&mut self, scene: &Scene) {
        if self.instances.len() != scene.instances.len() {
            *self = Self::new(scene);
            return;
        }
        let mut fits = true;
        let mut changed = Vec::new();
        for (i, (placed, instance)) in self.instances.iter_mut().zip(&scene.instances).enumerate() {
            let (old, mesh) = (placed.mesh.clone(), &scene.meshes[instance.mesh]);
            let same = |old: &Mesh, mesh: &Mesh| old.indices == mesh.indices && old.positions == mesh.positions;
            let same_shape = Arc::ptr_eq(&old, mesh) || same(&old, mesh);
            placed.mesh = mesh.clone();
            if placed.world_from_object != instance.world_from_object || !same_shape {
                fits &= placed.moves && old.indices.len() == mesh.indices.len();
                *placed = Placed { mesh: mesh.clone(), world_from_object: instance.world_from_object, moves: true };
                changed.push(i);
            }
        }
        if !fits {
            *self = Self::with(scene, |i| self.instances[i].moves);
        } else if !changed.is_empty() {
            self.fit_parts(|instance| changed.binary_search(&instance).is_ok());
        }
    }

    /// Builds all. Which instances have parts of their own?
    fn with(scene: &Scene, moves: impl Fn(usize) -> bool) -> Self {
        let place = |(i, instance): (usize, &Instance)| Placed {
            mesh: scene.meshes[instance.mesh].clone(),
            world_from_object: instance.world_from_object,
            moves: moves(i),
        };
        let instances: Vec<Placed> = scene.instances.iter().enumerate().map(place).collect();
        let (own, still): (Vec<usize>, Vec<usize>) = (0..instances.len()).partition(|&i| instances[i].moves);
        let mut bvh =
            Self { nodes: Vec::new(), root: 0, triangles: Vec::new(), parts: Vec::new(), instances, reach: 0.0 };
        bvh.add(&still);
        for instance in own {
            bvh.add(&[instance]);
        }
        bvh.root = bvh.nodes.len();
        bvh.fit_parts(|_| true);
        bvh
    }

    /// Fits the boxes of the parts that begin with such instances (a part of several has none that moves), and builds the
    /// top level.
    fn fit_parts(&mut self, changed: impl Fn(usize) -> bool) {
        let begins = |part: &Part| self.triangles[part.triangles.start].instance as usize;
        let mut fits: Vec<usize> = (0..self.parts.len()).filter(|&part| changed(begins(&self.parts[part]))).collect();
        for &part in &fits {
            self.place(part);
        }
        let farthest = self.parts.iter().map(|part| part.farthest).fold(0.0, f32::max);
        if farthest > self.reach || farthest < self.reach / 16.0 {
            // Twice as far as anything is, so that most of what moves stays within.
            self.reach = 2.0 * farthest;
            fits = (0..self.parts.len()).collect();
        }
        for part in fits {
            self.fit(part);
        }
        self.build_top();
    }

    /// Adds a part over such instances, whose boxes have still to be fitted.
    fn add(&mut self, instances: &[usize]) {
        let mut triangles = Vec::new();
        for &i in instances {
            let Placed { mesh, world_from_object, moves } = &self.instances[i];
            // What moves may be anywhere and of any size now.
            let size = mesh.positions.iter().fold(1e-30, |size: f32, p| size.max(p.abs().max_element()));
            let transform = if *moves { &Mat4::from_scale(Vec3::splat(1.0 / size)) } else { world_from_object };
            let count = mesh.indices.len() / 3;
            triangles.extend((0..count).map(|k| Triangle::new(mesh, transform, i as u32, k as u32)));
        }
        if triangles.is_empty() {
            return;
        }
        let boxes: Vec<Aabb> = triangles.iter().map(|t| t.bounds(0.0)).collect();
        let (nodes, order) = build(&boxes, BvhBuildParams::medium_build());
        let (first_node, first_triangle) = (self.nodes.len(), self.triangles.len());
        self.nodes.extend(nodes.iter().map(|node| {
            let first = if node.is_leaf() { first_triangle } else { first_node };
            Bvh2Node::new(*node.aabb(), node.prim_count, first as u32 + node.first_index)
        }));
        self.triangles.extend(order.into_iter().map(|i| triangles[i as usize]));
        let (nodes, triangles) = (first_node..self.nodes.len(), first_triangle..self.triangles.len());
        self.parts.push(Part { nodes, triangles, farthest: 0.0 });
    }

    /// Puts the triangles of a part where their instances are.
    fn place(&mut self, part: usize) {
        let mut farthest = 0.0_f32;
        for triangle in &mut self.triangles[self.parts[part].triangles.clone()] {
            let Placed { mesh, world_from_object, .. } = &self.instances[triangle.instance as usize];
            *triangle = Triangle::new(mesh, world_from_object, triangle.instance, triangle.index);
            farthest = triangle.vertices.iter().fold(farthest, |m, v| m.max(v.abs().max_element()));
        }
        self.parts[part].farthest = farthest;
    }

    /// Fits the boxes of a part to its triangles.
    fn fit(&mut self, part: usize) {
        // The triangle test moves vertices by some ulp of their distance from the ray's origin. Boxes are wider than
        // that for every origin up to a few scene sizes away, so that none is missed whose triangle would be hit.
        let margin = 16.0 * f32::EPSILON * self.reach;
        for i in self.parts[part].nodes.clone().rev() {
            let node = self.nodes[i];
            let first = node.first_index as usize;
            let bounds = if node.is_leaf() {
                let bounds = self.triangles[first..][..node.prim_count as usize].iter().map(|t| t.bounds(margin));
                bounds.reduce(|a, b| a.union(&b)).unwrap_or_default()
            } else {
                self.nodes[first].aabb().union(self.nodes[first + 1].aabb())
            };
            self.nodes[i].set_aabb(bounds);
        }
    }

    /// Builds the top level.
    fn build_top(&mut self) {
        self.nodes.truncate(self.root);
        let roots: Vec<Bvh2Node> = self.parts.iter().map(|part| self.nodes[part.nodes.start]).collect();
        let boxes: Vec<Aabb> = roots.iter().map(|root| *root.aabb()).collect();
        let (top, order) = build(&boxes, BvhBuildParams { max_prims_per_leaf: 1, ..BvhBuildParams::medium_build() });
        self.nodes.extend(top.iter().map(|node| match node.first_index as usize {
            first if node.is_leaf() => roots[order[first] as usize],
            first => Bvh2Node::new(*node.aabb(), 0, (self.root + first) as u32),
        }));
    }

    /// The nearest surface on the ray with `t_min ≤ t ≤ t_max` (in lengths of `direction`, which need not be a unit
    /// vector). World space.
    pub fn closest(&self, origin: Vec3, direction: Vec3, t_min: f32, t_max: f32) -> Option<Hit> {
        self.closest_where(origin, direction, t_min, t_max, |_| true)
    }

    /// As [`Bvh::closest`], but only of what `counts`.
    pub fn closest_where(
        &self,
        origin: Vec3,
        direction: Vec3,
        t_min: f32,
        t_max: f32,
        counts: impl Fn(&Hit) -> bool,
    ) -> Option<Hit> {
        let (t, index, edges) = self.search(&Ray::new(origin, direction)?, [t_min, t_max], false, counts)?;
        Some(self.triangles[index].hit(t, edges))
    }

    /// Whether anything lies between two points, world space. A ten-thousandth of the way at either end does not
    /// count, nor does anything if the points are the same.
    pub fn occluded(&self, from: Vec3, to: Vec3) -> bool {
        self.occluded_where(from, to, |_| true)
    }

    /// As [`Bvh::occluded`], but only by what `counts`.
    pub fn occluded_where(&self, from: Vec3, to: Vec3, counts: impl Fn(&Hit) -> bool) -> bool {
        self.hits_where(from, to - from, [SEGMENT_ENDS, 1.0 - SEGMENT_ENDS], counts)
    }

    /// Whether anything that `counts` is hit by a ray between two distances, in lengths of `direction`.
    pub fn hits_where(
        &self,
        origin: Vec3,
        direction: Vec3,
        [t_min, t_max]: [f32; 2],
        counts: impl Fn(&Hit) -> bool,
    ) -> bool {
        Ray::new(origin, direction).is_some_and(|ray| self.search(&ray, [t_min, t_max], true, counts).is_some())
    }

    /// The nearest hit (or `any` hit): its t, its place in `triangles`, and its three edge functions.
    fn search(
        &self,
        ray: &Ray,
        [t_min, mut t_max]: [f32; 2],
        any: bool,
        counts: impl Fn(&Hit) -> bool,
    ) -> Option<(f32, usize, [f32; 3])> {
        let nodes = &self.nodes;
        let root = nodes.get(self.root)?;
        ray.enters(&root.aabb, t_min, t_max)?;
        let (mut node, mut found) = (root, None::<(f32, usize, [f32; 3])>);
        let order = |index: usize| (self.triangles[index].instance, self.triangles[index].index);
        let mut stack = Vec::with_capacity(64);
        loop {
            if node.is_leaf() {
                let first = node.first_index as usize;
                for (i, triangle) in self.triangles[first..][..node.prim_count as usize].iter().enumerate() {
                    let hit = ray.hits(&triangle.vertices, t_min, t_max);
                    let comes_first = |t| found.is_none_or(|(best, j, _)| t < best || order(first + i) < order(j));
                    let hit = hit.filter(|&(t, edges)| comes_first(t) && counts(&triangle.hit(t, edges)));
                    if let Some((t, edges)) = hit {
                        found = Some((t, first + i, edges));
                        t_max = t;
                        if any {
                            return found;
                        }
                    }
                }
            } else {
                let pair = &nodes[node.first_index as usize..][..2];
                let [a, b] = [0, 1].map(|i| ray.enters(&pair[i].aabb, t_min, t_max));
                match (a, b) {
                    (Some(a), Some(b)) => {
                        let near = usize::from(b < a);
                        stack.push((a.max(b), &pair[1 - near]));
                        node = &pair[near];
                        continue;
                    }
                    (Some(_), None) => {
                        node = &pair[0];
                        continue;
                    }
                    (None, Some(_)) => {
                        node = &pair[1];
                        continue;
                    }
                    (None, None) => {}
                }
            }
            // Back to the nearest subtree left aside that is not behind what has been hit since.
            node = loop {
                let Some((enters, node)) = stack.pop() else { return found };
                if enters <= t_max {
                    break node;
                }
            };
        }
    }
}

/// A ray with what both tests want of it.
struct Ray {
    origin: Vec3,
    inverse: Vec3A,
    /// The axes, the last being the one along which the ray goes furthest.
    axes: [usize; 3],
    /// Takes the ray to (0, 0, 1): shear along the first two axes, scale along the last.
    shear: Vec3,
}

impl Ray {
    /// `None` for a direction of no length, or anything that is not finite.
    fn new(origin: Vec3, direction: Vec3) -> Option<Self> {
        let largest = direction.abs().max_element();
        if !(origin.is_finite() && direction.is_finite() && largest >= f32::MIN_POSITIVE) {
            return None;
        }
        let z = direction.abs().max_position();
        let (x, y) = ((z + 1) % 3, (z + 2) % 3);
        // Finite even for a component of zero: boxes have a margin, so that a product with it is as good as infinite
        // and never 0 · ∞.
        let least = (largest * 1e-30).max(f32::MIN_POSITIVE);
        let inverse = Vec3A::from(direction.abs().max(Vec3::splat(least)).copysign(direction)).recip();
        let shear = Vec3::new(direction[x] / direction[z], direction[y] / direction[z], 1.0 / direction[z]);
        Some(Self { origin, inverse, axes: [x, y, z], shear })
    }

    /// Where the ray enters a box, if it does so between `t_min` and `t_max`.
    fn enters(&self, bounds: &Aabb, t_min: f32, t_max: f32) -> Option<f32> {
        let origin = Vec3A::from(self.origin);
        let (a, b) = ((bounds.min - origin) * self.inverse, (bounds.max - origin) * self.inverse);
        let near = a.min(b).max_element().max(t_min);
        // Three roundings on either side: 1 + 2 γ₃ (Ize 2013).
        let far = (a.max(b).min_element() * (1.0 + 4.0 * f32::EPSILON)).min(t_max);
        (near <= far).then_some(near)
    }

    /// Distance and edge functions of a hit between `t_min` and `t_max` (Woop et al. 2013, without culling).
    fn hits(&self, vertices: &[Vec3; 3], t_min: f32, t_max: f32) -> Option<(f32, [f32; 3])> {
        let [x, y, z] = self.axes;
        let [a, b, c] = vertices.map(|vertex| {
            let p = vertex - self.origin;
            Vec3::new(p[x] - self.shear.x * p[z], p[y] - self.shear.y * p[z], self.shear.z * p[z])
        });
        let edge = |p: Vec3, q: Vec3| p.x * q.y - p.y * q.x;
        let mut edges = [edge(c, b), edge(a, c), edge(b, a)];
        if edges.contains(&0.0) {
            // The sign decides which of two neighbours has the ray; in f64 the products are exact.
            let edge = |p: Vec3, q: Vec3| (f64::from(p.x) * f64::from(q.y) - f64::from(p.y) * f64::from(q.x)) as f32;
            edges = [edge(c, b), edge(a, c), edge(b, a)];
        }
        let [u, v, w] = edges;
        if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
            return None;
        }
        let determinant = u + v + w;
        let t = (u * a.z + v * b.z + w * c.z) / determinant;
        // Seen edge-on there is nothing to hit: 0/0 fails every comparison.
        (t >= t_min && t <= t_max).then_some((t, edges))
    }
}

#[cfg(test)]
mod tests {
    use std::f32::consts::{PI, TAU};

    use glam::{DVec3, Mat4, vec3};
    use rayon::prelude::*;

    use super::*;
    use crate::scene::{BUILTIN_NAMES, Instance, Mesh};

    /// Numbers in 0…1 that are the same in every run (SplitMix64).
    struct Random(u64);

    impl Random {
        fn next(&mut self) -> f32 {
            self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            ((z ^ (z >> 31)) >> 40) as f32 / (1 << 24) as f32
        }

        fn vec3(&mut self) -> Vec3 {
            vec3(self.next(), self.next(), self.next())
        }

        fn direction(&mut self) -> Vec3 {
            let (z, angle) = (2.0 * self.next() - 1.0, TAU * self.next());
            let r = (1.0 - z * z).sqrt();
            vec3(r * angle.cos(), r * angle.sin(), z)
        }
    }

    fn scene_of(positions: Vec<Vec3>, indices: Vec<u32>, world_from_object: Mat4) -> Scene {
        let normals = vec![Vec3::Y; positions.len()];
        Scene {
            meshes: vec![Mesh { positions, normals, indices, ..Mesh::default() }.into()],
            instances: vec![Instance { mesh: 0, world_from_object }],
            ..Scene::default()
        }
    }

    /// Möller and Trumbore 1997 in f64.
    fn brute_force(triangles: &[[DVec3; 3]], origin: DVec3, direction: DVec3) -> Option<f64> {
        let mut nearest = None;
        for [a, b, c] in triangles {
            let (ab, ac) = (b - a, c - a);
            let p = direction.cross(ac);
            let determinant = ab.dot(p);
            let s = origin - a;
            let u = s.dot(p) / determinant;
            let q = s.cross(ab);
            let v = direction.dot(q) / determinant;
            let t = ac.dot(q) / determinant;
            if u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t >= 0.0 && nearest.is_none_or(|nearest| t < nearest) {
                nearest = Some(t);
            }
        }
        nearest
    }

    #[test]
    fn agrees_with_brute_force_on_the_built_in_scenes() {
        for (name, _) in BUILTIN_NAMES {
            let scene = Scene::builtin(name).unwrap();
            let bvh = Bvh::new(&scene);
            let bounds = scene.bounds().unwrap();
            let mut triangles = Vec::new();
            for instance in &scene.instances {
                let mesh = &scene.meshes[instance.mesh];
                for corners in mesh.indices.as_chunks::<3>().0 {
                    triangles.push(
                        corners.map(|i| {
                            instance.world_from_object.transform_point3(mesh.positions[i as usize]).as_dvec3()
                        }),
                    );
                }
            }
            let mut random = Random(1);
            let rays: Vec<_> = (0..2000)
                .map(|_| {
                    let size = bounds.max - bounds.min;
                    (bounds.min - 0.1 * size + 1.2 * size * random.vec3(), random.direction())
                })
                .collect();
            let hits: usize = rays
                .par_iter()
                .map(|&(origin, direction)| {
                    let expected = brute_force(&triangles, origin.as_dvec3(), direction.as_dvec3());
                    let hit = bvh.closest(origin, direction, 0.0, f32::INFINITY);
                    match (hit, expected) {
                        (Some(hit), Some(t)) => {
                            let difference = (f64::from(hit.t) - t).abs();
                            assert!(difference <= 1e-5 * t.max(1.0), "{name}: {hit:?} {t}");
                            let mesh = &scene.meshes[scene.instances[hit.instance].mesh];
                            let [a, b, c] = [0, 1, 2].map(|k| {
                                let vertex = mesh.positions[mesh.indices[3 * hit.triangle + k] as usize];
                                scene.instances[hit.instance].world_from_object.transform_point3(vertex)
                            });
                            let point = a + (b - a) * hit.barycentric.x + (c - a) * hit.barycentric.y;
                            assert!((point - (origin + direction * hit.t)).length() < 1e-4, "{name}: {hit:?}");
                            assert!((b - a).cross(c - a).dot(hit.normal) > 0.0);
                            1
                        }
                        (None, None) => 0,
                        _ => panic!("{name}: {hit:?} {expected:?} for {origin} {direction}"),
                    }
                })
                .sum();
            assert!(hits > 500, "{name}: {hits}");
        }
    }

    /// A sphere of 64 × 32 cells, its poles included.
    fn sphere() -> (Vec<Vec3>, Vec<u32>) {
        let (rows, columns) = (32_u32, 64_u32);
        let mut positions = vec![Vec3::Y, Vec3::NEG_Y];
        for j in 1..rows {
            for i in 0..columns {
                let (sin_phi, cos_phi) = (TAU * i as f32 / columns as f32).sin_cos();
                let (sin, cos) = (PI * j as f32 / rows as f32).sin_cos();
                positions.push(vec3(sin * cos_phi, cos, sin * sin_phi));
            }
        }
        let at = |j: u32, i: u32| match j {
            0 => 0,
            _ if j == rows => 1,
            _ => 2 + (j - 1) * columns + i % columns,
        };
        let mut indices = Vec::new();
        for j in 0..rows {
            for i in 0..columns {
                for triangle in [[at(j, i), at(j, i + 1), at(j + 1, i + 1)], [at(j, i), at(j + 1, i + 1), at(j + 1, i)]]
                {
                    if (0..3).all(|k| triangle[k] != triangle[(k + 1) % 3]) {
                        indices.extend(triangle);
                    }
                }
            }
        }
        (positions, indices)
    }

    #[test]
    fn rays_at_shared_edges_never_get_through() {
        let (positions, indices) = sphere();
        // Far from the origin of coordinates, turned and stretched, everything rounds.
        let moved = Mat4::from_translation(vec3(30.0, -7.0, 11.0))
            * Mat4::from_rotation_x(0.3)
            * Mat4::from_scale(vec3(2.0, 0.5, 1.0));
        for transform in [Mat4::IDENTITY, moved] {
            let bvh = Bvh::new(&scene_of(positions.clone(), indices.clone(), transform));
            let mut random = Random(2);
            for i in 0..65_536 {
                let triangle = 3 * ((random.next() * (indices.len() / 3) as f32) as usize);
                let [a, b] = [0, 1].map(|k| positions[indices[triangle + k] as usize]);
                // Every eighth ray goes for the vertex itself.
                let along = if i % 8 == 0 { 0.0 } else { random.next() };
                let [from, to] = [0.5 * (random.vec3() - 0.5), a + (b - a) * along];
                let [from, to] = [from, to].map(|p| transform.transform_point3(p));
                let hit = bvh.closest(from, to - from, 0.0, f32::INFINITY);
                assert!(hit.is_some_and(|hit| (hit.t - 1.0).abs() < 1e-3), "ray {i} from {from} to {to}: {hit:?}");
                assert!(bvh.occluded(from, to + 0.5 * (to - from)), "segment {i} from {from} to {to}");
                // From outside it may not get past both sides of the sphere either.
                let outside = to + (to - from);
                let hit = bvh.closest(outside, from - outside, 0.0, 1.0);
                assert!(hit.is_some(), "ray {i} from {outside} to {from}");
            }
        }
    }

    #[test]
    fn rays_along_the_axes_through_vertices_are_stopped() {
        // A cube of 8 × 8 cells a side; coordinates are exact, so that rays run within box and triangle faces.
        let (mut positions, mut indices) = (Vec::new(), Vec::new());
        for axis in 0..3 {
            for side in [-1.0, 1.0] {
                let first = positions.len() as u32;
                for k in 0..81 {
                    let mut p = Vec3::splat(side);
                    p[(axis + 1) % 3] = (k / 9) as f32 / 4.0 - 1.0;
                    p[(axis + 2) % 3] = (k % 9) as f32 / 4.0 - 1.0;
                    positions.push(p);
                }
                for k in (0..72).filter(|k| k % 9 < 8) {
                    indices.extend([k, k + 1, k + 10, k, k + 10, k + 9].map(|i| first + i));
                }
            }
        }
        let bvh = Bvh::new(&scene_of(positions.clone(), indices, Mat4::IDENTITY));
        for &position in &positions {
            for axis in 0..3 {
                for sign in [-1.0, 1.0] {
                    let mut direction = Vec3::ZERO;
                    direction[axis] = sign;
                    let mut origin = position;
                    origin[axis] = -0.5 * sign;
                    let hit = bvh.closest(origin, direction, 0.0, f32::INFINITY).unwrap_or_else(|| {
                        panic!("{origin} {direction}");
                    });
                    // On a side of the cube the ray runs within it, and stops where its edge-on triangles end.
                    assert!(hit.t == 1.5 && hit.normal.abs()[axis] > 0.0, "{origin} {direction} {hit:?}");
                }
            }
        }
    }

    #[test]
    fn a_tree_that_follows_is_as_good_as_a_new_one() {
        let mut scene = Scene::builtin("column").unwrap();
        let last = scene.instances.len() - 1;
        let mut bvh = Bvh::new(&scene);
        let mut random = Random(3);
        let still = scene.instances[last].world_from_object;
        let about = |m: Mat4| Mat4::from_translation(Vec3::Y) * m * Mat4::from_translation(Vec3::NEG_Y) * still;
        let mut mirrored = (*scene.meshes[scene.instances[last].mesh]).clone();
        for position in &mut mirrored.positions {
            position.x = -position.x;
        }
        let mut half = mirrored.clone();
        half.indices.truncate(3 * (half.indices.len() / 6));
        // Its first move gives it a part of its own; then it shrinks to nothing, is far away, bends, and is another.
        let steps: [(Mat4, Option<Mesh>); 8] = [
            (about(Mat4::from_scale(Vec3::ZERO)), None),
            (about(Mat4::from_rotation_z(0.4)), None),
            (about(Mat4::from_scale(vec3(-0.5, 1.0, 0.5))), None),
            (Mat4::from_translation(vec3(300.0, 0.0, 0.0)) * still, None),
            (about(Mat4::from_rotation_x(0.2)), Some(mirrored)),
            (about(Mat4::from_rotation_x(0.4)), None),
            (still, Some(half)),
            (about(Mat4::from_rotation_x(0.1)), None),
        ];
        let bounds = scene.bounds().unwrap();
        let mut parts = Vec::new();
        for (world_from_object, mesh) in steps {
            scene.instances[last].world_from_object = world_from_object;
            if let Some(mesh) = mesh {
                let number = scene.instances[last].mesh;
                scene.meshes[number] = mesh.into();
            }
            bvh.follow(&scene);
            parts.push(bvh.parts.len());
            let away = scene.instances[last].world_from_object.w_axis.x.abs();
            assert!(bvh.reach >= away && bvh.reach < 16.0 * away.max(7.0), "{} {away}", bvh.reach);
            let new = Bvh::new(&scene);
            let mut of_it = 0;
            for _ in 0..4000 {
                let origin = bounds.min + (bounds.max - bounds.min) * random.vec3();
                let direction = random.direction();
                let [hit, expected] = [&bvh, &new].map(|bvh| bvh.closest(origin, direction, 0.0, f32::INFINITY));
                assert_eq!(hit, expected, "{origin} {direction}");
                of_it += u32::from(hit.is_some_and(|hit| hit.instance == last));
            }
            let near = scene.instances[last].world_from_object.w_axis.x.abs() < 100.0;
            let there = near && world_from_object.determinant() != 0.0;
            assert_eq!(of_it > 0, there, "{world_from_object}: {of_it}");
        }
        assert!(parts.iter().all(|&parts| parts == 2), "{parts:?}");
        // The same shapes once more are no motion, and of other instances nothing is known.
        let triangles = bvh.triangles.as_ptr();
        for mesh in &mut scene.meshes {
            *mesh = Arc::new((**mesh).clone());
        }
        bvh.follow(&scene);
        assert_eq!((bvh.parts.len(), bvh.triangles.as_ptr()), (2, triangles));
        scene.instances.remove(0);
        bvh.follow(&scene);
        assert_eq!(bvh.parts.len(), 1);
        assert_eq!(bvh.triangles.len(), scene.triangle_count());
    }

    #[test]
    fn of_what_lies_at_the_same_place_the_first_is_hit_whatever_has_moved() {
        let positions = vec![vec3(-1.0, -1.0, 0.0), vec3(1.0, -1.0, 0.0), vec3(0.0, 1.0, 0.0)];
        // The same triangle twice in each of four instances.
        let mut scene = scene_of(positions, vec![0, 1, 2, 0, 1, 2], Mat4::IDENTITY);
        scene.instances = vec![scene.instances[0]; 4];
        let mut bvh = Bvh::new(&scene);
        for moving in [1, 3, 0, 2] {
            for x in [5.0, 0.0] {
                scene.instances[moving].world_from_object = Mat4::from_translation(vec3(x, 0.0, 0.0));
                bvh.follow(&scene);
                let hit = bvh.closest(Vec3::Z, -Vec3::Z, 0.0, f32::INFINITY).unwrap();
                assert_eq!((hit.instance, hit.triangle), (usize::from(moving == 0 && x > 0.0), 0));
            }
        }
    }

    #[test]
    fn occlusion_leaves_out_the_ends_alone() {
        let positions = vec![vec3(-1.0, -1.0, 0.0), vec3(1.0, -1.0, 0.0), vec3(0.0, 1.0, 0.0)];
        let bvh = Bvh::new(&scene_of(positions, vec![0, 1, 2], Mat4::IDENTITY));
        assert!(!bvh.occluded(Vec3::ZERO, Vec3::Z) && !bvh.occluded(Vec3::Z, Vec3::ZERO));
        assert!(bvh.occluded(vec3(0.0, 0.0, 1.0), vec3(0.0, 0.0, -1.0)));
        assert!(bvh.occluded(vec3(0.0, 0.0, 1.0), vec3(0.0, 0.0, -1e-3)));
        assert!(!bvh.occluded(vec3(0.0, 0.0, 1.0), vec3(0.0, 0.0, 1e-3)));
        assert!(!bvh.occluded(vec3(0.0, 3.0, 1.0), vec3(0.0, 3.0, -1.0)));
        assert!(!bvh.occluded(Vec3::ZERO, Vec3::ZERO));
    }

    #[test]
    fn a_mirrored_instance_keeps_its_front_and_its_vertices() {
        let positions = vec![vec3(0.0, 0.0, 0.0), vec3(4.0, 0.0, 0.0), vec3(0.0, 4.0, 0.0)];
        let bvh = Bvh::new(&scene_of(positions, vec![0, 1, 2], Mat4::from_scale(vec3(-1.0, 1.0, 1.0))));
        let hit = bvh.closest(vec3(-1.0, 2.0, 3.0), Vec3::NEG_Z, 0.0, 10.0).unwrap();
        assert_eq!((hit.t, hit.normal, hit.barycentric), (3.0, Vec3::Z, Vec2::new(0.25, 0.5)));
        assert!(bvh.closest(vec3(-1.0, 2.0, 3.0), Vec3::NEG_Z, 3.5, 10.0).is_none());
        assert!(bvh.closest(vec3(-1.0, 2.0, 3.0), Vec3::NEG_Z, 0.0, 2.5).is_none());
    }

    #[test]
    fn nothing_is_hit_in_an_empty_scene_or_by_a_ray_that_is_none() {
        let empty = Bvh::new(&Scene::default());
        assert!(empty.closest(Vec3::ZERO, Vec3::X, 0.0, f32::INFINITY).is_none() && !empty.occluded(Vec3::X, Vec3::Y));
        let bvh = Bvh::new(&Scene::builtin("cornell").unwrap());
        for direction in [Vec3::ZERO, Vec3::NAN, Vec3::INFINITY] {
            assert!(bvh.closest(Vec3::splat(0.2), direction, 0.0, f32::INFINITY).is_none());
        }
    }
}
