//! Surface samples (surfels) of the whole scene, of which every VPL splats its own subset into its imperfect shadow
//! map.
//!
//! They are drawn in proportion to area, in object space, once: a rigid motion of an instance moves them with it, and they
//! go with the triangles of a mesh that deforms.
//! They are ordered along a space-filling curve, one for each of the six main directions of the normal, so that a
//! run of neighbours in the list is a patch of surface; a VPL takes one surfel of every run.
//!
//! A surfel stands for a disc. So that discs do not stick out where the surface ends or folds, each knows the nearest
//! such edges and is cut off there.

use std::collections::HashMap;

use glam::{Mat4, Vec2, Vec3, Vec4};

use crate::Scene;
use crate::sampling::on_triangle;
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
    /// How the surface bends away.
    pub bend: Bend,
    /// The nearest edges, by two points each, at which the surface ends or folds, object space.
    pub edges: [Option<[Vec3; 2]>; EDGES],
    /// Vertices of its triangle.
    pub corners: [u32; 3],
    /// How much of each it has.
    pub weights: Vec3,
    /// Vertices at the ends of the edges, where those are of the same instance.
    pub edge_corners: [Option<[u32; 2]>; EDGES],
}

/// How a convex surface bends away from its tangent plane.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Bend {
    /// Curvature in the direction in which that is most, over the unit of length of object space; 0 for what is flat.
    pub curvature: f32,
    /// That direction, object space.
    pub direction: Vec3,
    /// Whether it is about the same in all directions, as on a sphere; else it is none across that one, as on a cylinder.
    pub in_all: bool,
}

/// Edges that a surfel knows: the two at the corner of a rectangle.
pub const EDGES: usize = 2;

/// A surfel in world space as the splat pass reads it: position (m), unit normal, then for each edge the unit vector
/// in the surfel's plane across the edge and (w) the distance to it, m. In w of the first two is [`Bend::direction`], as long
/// as the root of the curvature, 1/m, along the axes of `Vec3::any_orthonormal_pair`; the first is less than 0 for one that
/// is [`Bend::in_all`] directions, and 0 for one that is flat.
pub type SurfelTexels = [Vec4; 2 + EDGES];

/// Faces beside each other of which one is so many times as wide as the other are not of one curved surface.
const STRIP: f32 = 3.0;

/// Angle between two faces up to which rounding may have set it.
const LEAST_BEND: f32 = 0.005;

/// Cosine of the angle between two faces up to which the surface goes on over their edge, 20°.
const SMOOTH: f32 = 0.94;

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
        let in_world: Vec<[Vec3; 3]> = triangles
            .iter()
            .map(|&(i, t)| {
                let instance = &scene.instances[i];
                let positions = &scene.meshes[instance.mesh].positions;
                t.map(|index| instance.world_from_object.transform_point3(positions[index as usize]))
            })
            .collect();
        let mut area = 0.0;
        let cumulated: Vec<f64> = in_world
            .iter()
            .map(|corners| {
                let [a, b, c] = corners.map(|corner| corner.as_dvec3());
                area += 0.5 * (b - a).cross(c - a).length();
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
        let neighbours = neighbours(&in_world, extent);
        let object_from_world: Vec<_> = scene.instances.iter().map(|i| i.world_from_object.inverse()).collect();
        for index in 0..count {
            let sample = sobol_burley::sample_4d(index & 0xffff, 0, index >> 16);
            let target = (f64::from(index) + f64::from(sample[2])) / f64::from(count) * area;
            let found = cumulated.partition_point(|&sum| sum <= target).min(triangles.len() - 1);
            let (i, t) = triangles[found];
            let weights = on_triangle([sample[0], sample[1]]);
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
            let normal_ws = object_from_world[i].transpose().transform_vector3(normal);
            let position_ws = instance.world_from_object.transform_point3(position);
            let nearest = nearest_edges(&in_world, &neighbours, found, position_ws);
            let mirrors = instance.world_from_object.determinant() < 0.0;
            let bend = Bend::of(&in_world, &neighbours[found], found, mirrors);
            let bend = Bend {
                curvature: bend.curvature * scale(&instance.world_from_object),
                direction: object_from_world[i].transform_vector3(bend.direction),
                ..bend
            };
            let edges = nearest
                .map(|edge| edge.map(|ends| ends.map(|(t, k)| object_from_world[i].transform_point3(in_world[t][k]))));
            let edge_corners = nearest.map(|edge| {
                edge.filter(|[(t, _), _]| triangles[*t].0 == i).map(|ends| ends.map(|(t, k)| triangles[t].1[k]))
            });
            let key = (main_direction(normal_ws) << 60) | morton((position_ws - bounds.min) / extent);
            keyed.push((key, Surfel { instance: i, position, normal, bend, edges, corners: t, weights, edge_corners }));
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

    /// Takes surfels with the vertices of `meshes`, which are what has changed in the scene. Their area stays what it was.
    pub fn deform(&mut self, scene: &Scene, meshes: &[usize]) {
        let mut deformed = vec![false; scene.meshes.len()];
        meshes.iter().for_each(|&mesh| deformed[mesh] = true);
        for surfel in &mut self.list {
            let mesh = scene.instances[surfel.instance].mesh;
            if !deformed[mesh] {
                continue;
            }
            let at = |vertex: u32| scene.meshes[mesh].positions[vertex as usize];
            let [a, b, c] = surfel.corners.map(at);
            surfel.position = a * surfel.weights.x + b * surfel.weights.y + c * surfel.weights.z;
            surfel.normal = (b - a).cross(c - a).try_normalize().unwrap_or(surfel.normal);
            // What was convex may be so no more.
            surfel.bend = Bend::UNKNOWN;
            for (edge, ends) in surfel.edges.iter_mut().zip(surfel.edge_corners) {
                *edge = ends.map_or(*edge, |ends| Some(ends.map(at)));
            }
        }
    }

    /// Every surfel in world space, as the instances stand now.
    pub fn in_world(&self, scene: &Scene) -> Vec<SurfelTexels> {
        let normal_matrices: Vec<_> =
            scene.instances.iter().map(|i| i.world_from_object.inverse().transpose()).collect();
        let texels = self.list.iter().map(|surfel| {
            let world_from_object = scene.instances[surfel.instance].world_from_object;
            let position = world_from_object.transform_point3(surfel.position);
            // No −0, whose sign the shader does not look at.
            let normal =
                normal_matrices[surfel.instance].transform_vector3(surfel.normal).normalize_or_zero() + Vec3::ZERO;
            let mut texels = [Vec4::ZERO; 2 + EDGES];
            let Bend { curvature, direction, in_all } = surfel.bend;
            let curvature = Some(curvature / scale(&world_from_object)).filter(|c| c.is_finite()).unwrap_or(0.0);
            let (x, y) = normal.any_orthonormal_pair();
            let direction = world_from_object.transform_vector3(direction);
            let along = Vec2::new(direction.dot(x), direction.dot(y)).normalize_or_zero() * curvature.sqrt();
            let bend = match in_all {
                true => Vec2::new(-curvature.sqrt(), 0.0),
                // The opposite is the same.
                false if along.x < 0.0 => -along,
                false => along.max(Vec2::new(1e-6 * along.y.abs(), f32::NEG_INFINITY)),
            };
            texels[0] = position.extend(bend.x);
            texels[1] = normal.extend(bend.y);
            for (texel, edge) in texels[2..].iter_mut().zip(&surfel.edges) {
                *texel = edge.map_or(Vec4::ZERO, |ends| {
                    let [a, b] = ends.map(|end| world_from_object.transform_point3(end));
                    let across = (b - a).cross(normal).normalize_or_zero();
                    let distance = (a - position).dot(across);
                    (across * distance.signum()).extend(distance.abs())
                });
            }
            texels
        });
        texels.collect()
    }
}

impl Bend {
    /// That of a surface that is not flat, or may not be, and of which no more is known: next to none, and not 0.
    const UNKNOWN: Self = Self { curvature: 1e-20, direction: Vec3::ZERO, in_all: true };

    /// That of a triangle, by the angles between it and those beside it; its front is not that of its winding where its
    /// instance mirrors it.
    fn of(triangles: &[[Vec3; 3]], neighbours: &[Option<usize>; 3], triangle: usize, mirrors: bool) -> Self {
        let normal = |[a, b, c]: [Vec3; 3]| (b - a).cross(c - a).normalize_or_zero();
        let (here, up) = (triangles[triangle], normal(triangles[triangle]));
        let over = |(k, beyond): (usize, &Option<usize>)| {
            let there = triangles[(*beyond)?];
            let angle = up.angle_between(normal(there));
            if angle <= LEAST_BEND {
                return None;
            }
            let (from, along) = (here[k], (here[(k + 1) % 3] - here[k]).normalize_or_zero());
            let height =
                |corners: [Vec3; 3]| corners.map(|p| (p - from).cross(along).length()).into_iter().fold(0.0, f32::max);
            let sinks = (there.iter().map(|p| (p - from).dot(up)).sum::<f32>() < 0.0) != mirrors;
            let (this, other) = (height(here), height(there));
            let curvature = 2.0 * angle / (this + other);
            // A strip beside a plane is the rounding of its edge.
            let is_strip = this.max(other) > STRIP * this.min(other);
            Some((sinks && !is_strip && curvature.is_finite()).then_some((curvature, along.cross(up))))
        };
        let over: Vec<Option<(f32, Vec3)>> = neighbours.iter().enumerate().filter_map(over).collect();
        let bends: Vec<(f32, Vec3)> = over.iter().flatten().copied().collect();
        let Some(&(curvature, direction)) = bends.iter().max_by(|a, b| a.0.total_cmp(&b.0)) else {
            return if over.is_empty() { Self::default() } else { Self::UNKNOWN };
        };
        let across = |&(other, along): &(f32, Vec3)| other > 0.5 * curvature && along.dot(direction).abs() < 0.7;
        Self { curvature, direction, in_all: bends.iter().any(across) }
    }
}

/// How much longer a transform makes things, in the mean over all directions.
fn scale(transform: &Mat4) -> f32 {
    transform.determinant().abs().cbrt().max(f32::MIN_POSITIVE)
}

/// For every triangle the triangles beyond its three edges over which the surface goes on.
fn neighbours(triangles: &[[Vec3; 3]], extent: f32) -> Vec<[Option<usize>; 3]> {
    // Corners that differ by rounding are the same (but for the few at a boundary of the grid, whose edges then end).
    let grid = |p: Vec3| (p / extent * 1e5).round().to_array().map(|x| x as i64);
    let mut welded = HashMap::new();
    let mut edges = Vec::with_capacity(3 * triangles.len());
    for (t, corners) in triangles.iter().enumerate() {
        let ids = corners.map(|corner| {
            let next = welded.len() as u32;
            *welded.entry(grid(corner)).or_insert(next)
        });
        for k in 0..3 {
            let (a, b) = (ids[k], ids[(k + 1) % 3]);
            edges.push((a.min(b), a.max(b), t as u32, k as u32));
        }
    }
    edges.sort_unstable();
    let normal = |t: usize| {
        let [a, b, c]: [Vec3; 3] = triangles[t];
        (b - a).cross(c - a).normalize_or_zero()
    };
    let mut neighbours = vec![[None; 3]; triangles.len()];
    for shared in edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
        if let &[(_, _, s, i), (_, _, t, k)] = shared {
            let (s, t) = (s as usize, t as usize);
            if normal(s).dot(normal(t)) > SMOOTH {
                neighbours[s][i as usize] = Some(t);
                neighbours[t][k as usize] = Some(s);
            }
        }
    }
    neighbours
}

/// The edges nearest to a point of a triangle at which the surface ends or folds, out of its own and those of the
/// triangles beside it: a triangle and its corner for both ends.
fn nearest_edges(
    triangles: &[[Vec3; 3]],
    neighbours: &[[Option<usize>; 3]],
    triangle: usize,
    point: Vec3,
) -> [Option<[(usize, usize); 2]>; EDGES] {
    let mut found = [(f32::INFINITY, None); EDGES];
    let around = neighbours[triangle].into_iter().flatten();
    for t in std::iter::once(triangle).chain(around) {
        for (k, beyond) in neighbours[t].iter().enumerate() {
            if beyond.is_some() {
                continue;
            }
            let ends = [(t, k), (t, (k + 1) % 3)];
            let [from, to] = ends.map(|(t, k)| triangles[t][k]);
            let along = (to - from).normalize_or_zero();
            let distance = (point - from).cross(along).length();
            // Sorted, nearest first; the last falls out.
            if let Some(place) = found.iter().position(|(d, _)| distance < *d) {
                found[place..].rotate_right(1);
                found[place] = (distance, Some(ends));
            }
        }
    }
    found.map(|(_, ends)| ends)
}

/// True where an alpha mask leaves nothing of a point of a triangle.
fn masked_out(scene: &Scene, instance: usize, triangle: [u32; 3], weights: Vec3) -> bool {
    let mesh = &scene.meshes[scene.instances[instance].mesh];
    let material = &scene.materials[mesh.material];
    let AlphaMode::Mask { cutoff } = material.alpha_mode else { return false };
    scene.base_color(material, mesh, triangle.map(|index| index as usize), weights).w < cutoff
}

/// Which of ±x, ±y, ±z a vector points along most, 0…5.
pub(crate) fn main_direction(v: Vec3) -> u64 {
    let axis = v.abs().max_position();
    2 * axis as u64 + u64::from(v[axis] < 0.0)
}

/// Interleaves 20 bits of each coordinate 0…1 (Morton 1966).
pub(crate) fn morton(p: Vec3) -> u64 {
    let spread = |x: f32| {
        let bits = (x.clamp(0.0, 1.0) * 1_048_575.0) as u64;
        (0..20).fold(0, |sum, bit| sum | ((bits >> bit) & 1) << (3 * bit))
    };
    spread(p.x) | spread(p.y) << 1 | spread(p.z) << 2
}

#[cfg(test)]
mod tests {
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
            meshes: vec![mesh.into()],
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
        for [position, normal, ..] in surfels.in_world(&scene) {
            assert!(position.z.abs() < 1e-5 || (position.z - 5.0).abs() < 1e-5);
            assert!((normal.truncate() - Vec3::Z).length() < 1e-5);
        }
        // Uniform within a square: each quadrant of the large one has a quarter.
        let far: Vec<_> = surfels.list.iter().filter(|s| s.instance == 1).collect();
        let quadrant = far.iter().filter(|s| s.position.x < 0.5 && s.position.y < 0.5).count();
        assert!((quadrant as f32 / far.len() as f32 - 0.25).abs() < 0.01, "{quadrant} of {}", far.len());
    }

    /// A column of radius 0.35, a ball of radius 2 (and what it is from inside), and a square.
    #[test]
    fn surfels_bend_as_their_surface_does() {
        let column = Scene::builtin("column").unwrap();
        let surfels = Surfels::new(&column, 4096);
        let round: Vec<_> = surfels.list.iter().filter(|surfel| surfel.instance == 6).collect();
        assert!(round.len() > 100);
        for surfel in round {
            let Bend { curvature, direction, in_all } = surfel.bend;
            assert!((curvature * 0.35 - 1.0).abs() < 0.01 && !in_all, "{curvature}");
            assert!(direction.y.abs() < 1e-3 && direction.dot(surfel.normal).abs() < 1e-3, "{direction}");
        }
        for (side, scale, expected) in [(1, 2.0, 0.5), (-1, 2.0, 0.0), (1, -2.0, 0.5), (-1, -2.0, 0.0)] {
            let mut mesh = crate::reference::truth_tests::sphere(0);
            if side > 0 {
                mesh.indices.chunks_exact_mut(3).for_each(|triangle| triangle.swap(1, 2));
            }
            let twice = Mat4::from_scale(Vec3::splat(scale));
            let scene = Scene {
                meshes: vec![mesh.into()],
                materials: vec![Material::lambert("", Vec3::ONE)],
                instances: vec![Instance { mesh: 0, world_from_object: twice }],
                ..Scene::default()
            };
            let surfels = Surfels::new(&scene, 1024);
            let off = |texels: &&SurfelTexels| texels[0].w >= 0.0 || (texels[0].w.powi(2) - expected).abs() > 0.05;
            // At the poles triangles are not what they are elsewhere.
            let wrong = surfels.in_world(&scene).iter().filter(off).count();
            assert!(wrong < 20, "{wrong}");
        }
        assert!(Surfels::new(&squares(), 64).list.iter().all(|surfel| surfel.bend == Bend::default()));
    }

    #[test]
    fn a_rigid_motion_moves_surfels_with_their_instance() {
        let mut scene = squares();
        let surfels = Surfels::new(&scene, 1024);
        let before = surfels.in_world(&scene);
        let motion = Mat4::from_rotation_x(1.0) * Mat4::from_translation(Vec3::new(0.1, 0.2, 0.3));
        scene.instances[0].world_from_object = motion;
        assert_eq!(surfels.list, Surfels::new(&squares(), 1024).list);
        for (surfel, ([a, ..], [b, normal, ..])) in
            surfels.list.iter().zip(before.iter().zip(&surfels.in_world(&scene)))
        {
            let expected = if surfel.instance == 0 { motion.transform_point3(a.truncate()) } else { a.truncate() };
            assert!((b.truncate() - expected).length() < 1e-5);
            let normal_ws = if surfel.instance == 0 { motion.transform_vector3(Vec3::Z) } else { Vec3::Z };
            assert!((normal.truncate() - normal_ws).length() < 1e-5);
        }
    }

    #[test]
    fn surfels_go_with_the_triangles_of_a_mesh_that_deforms() {
        let mut scene = squares();
        let mut surfels = Surfels::new(&scene, 1024);
        // Bent about the diagonal, and wider: (x, y) becomes (2 x, y), and the half above the diagonal rises.
        let mut mesh = Mesh::clone(&scene.meshes[0]);
        for p in &mut mesh.positions {
            *p = Vec3::new(2.0 * p.x, p.y, (p.y - p.x).max(0.0));
        }
        scene.meshes[0] = mesh.into();
        let before = surfels.clone();
        surfels.deform(&scene, &[]);
        assert_eq!(surfels.list, before.list);
        surfels.deform(&scene, &[0]);
        for (now, then) in surfels.list.iter().zip(&before.list) {
            let p = then.position;
            let rise = (p.y - p.x).max(0.0);
            assert!((now.position - Vec3::new(2.0 * p.x, p.y, rise)).length() < 1e-5);
            let normal = if rise > 0.0 { Vec3::new(0.5, -1.0, 1.0).normalize() } else { Vec3::Z };
            assert!((now.normal - normal).length() < 1e-5, "{} {rise}", now.normal);
            assert_eq!(now.bend, Bend::UNKNOWN);
            for (now, then) in now.edges.iter().zip(&then.edges) {
                for (now, then) in now.unwrap().iter().zip(then.unwrap()) {
                    let rise = (then.y - then.x).max(0.0);
                    assert!((*now - Vec3::new(2.0 * then.x, then.y, rise)).length() < 1e-4, "{now} {then}");
                }
            }
        }
    }

    #[test]
    fn surfels_know_where_their_square_ends_but_not_its_diagonal() {
        let scene = squares();
        for ([position, _, first, second], surfel) in
            Surfels::new(&scene, 1024).in_world(&scene).iter().zip(&Surfels::new(&scene, 1024).list)
        {
            let size = if surfel.instance == 0 { 1.0 } else { 3.0 };
            let (x, y) = (position.x.min(size - position.x), position.y.min(size - position.y));
            let mut expected = [x, y, size - x, size - y];
            expected.sort_by(f32::total_cmp);
            assert!((first.w - expected[0]).abs() < 1e-4 && (second.w - expected[1]).abs() < 1e-4);
            // Across the edge and outward.
            let edge = *position + first.truncate().extend(0.0) * first.w;
            let outside = [edge.x, edge.y, size - edge.x, size - edge.y].iter().any(|d| d.abs() < 1e-4);
            assert!(outside && first.z.abs() < 1e-6, "{position} {first}");
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
        std::sync::Arc::make_mut(&mut scene.meshes[0]).colors =
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
