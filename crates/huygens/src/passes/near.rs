//! Lists of the VPLs that are near: the interleaved gather sums those at every pixel, since what they give changes too
//! much from pixel to pixel to be shared between neighbours.

use std::rc::Rc;

use glam::{IVec3, IVec4, Vec3, Vec4};
use rayon::prelude::*;

use crate::gl::{Context, Format, Texture};
use crate::lattice::{Emission, Vpl};
use crate::scene::Bounds;
use crate::{Result, Scene};

/// Cells of the grid at most, and cells that one VPL may be near to, and entries of all lists together. VPLs that would
/// take more are not listed.
const MOST_CELLS: i32 = 1 << 20;
const MOST_CELLS_OF_ONE: i32 = 1 << 17;
const MOST_ENTRIES: usize = 1 << 23;

/// A VPL that is as bright as those around it is near up to this share of the distance within which it is its rectangle.
const REACH: f32 = 0.56;

/// What one gives falls as its brightness over the square of the distance: the root of how much brighter it is than those
/// around is how much farther it is near, within these limits.
const STRETCH: [f32; 2] = [0.6, 4.0];

/// VPLs on either side of one, in their order, that are around it.
const AROUND: usize = 512;

/// Texels in a row of the texture.
const ROW: usize = 512;

/// Parts of triangles in cells at most; beyond, surfaces are taken to be everywhere.
const MOST_PARTS: u64 = 1 << 24;

/// A normal is along each axis of which it has so much of what it has along its main one.
const ALONG: f32 = 0.9;

/// What a cell counts for more than its edge, on every side: positions are rounded.
const MARGIN: f32 = 0.01;

/// No box.
const NONE: u32 = u32::MAX;

/// A grid over the scene, in each cell the numbers of the VPLs that are near to some surface in it and face it: for each
/// axis of those surfaces whose normals are along it.
#[derive(Debug)]
pub(crate) struct Lists {
    /// Corner of the grid, m, and cells per m.
    pub grid: Vec4,
    /// Cells along each axis.
    pub cells: IVec3,
    /// For each cell where its lists begin, in entries.
    starts: Vec<[u32; 3]>,
    /// Each list after its length; an empty one is first.
    entries: Vec<u32>,
    /// Distance, m, within which each VPL is near; 0 for those that are in no list.
    pub reaches: Vec<f32>,
}

impl Lists {
    /// `bounds` are those of all surfaces of the scene.
    pub fn new(vpls: &[Vpl], scene: &Scene, bounds: &Bounds) -> Self {
        let extent = bounds.max - bounds.min;
        let mut reaches = reaches(vpls);
        let mut able: Vec<f32> = reaches.iter().copied().filter(|&reach| reach > 0.0).collect();
        let middle = able.len() / 2;
        let usual = if able.is_empty() { 0.0 } else { *able.select_nth_unstable_by(middle, f32::total_cmp).1 };
        // Cells of a quarter of the reach, or larger where there would be too many.
        let mut edge = (0.25 * usual).max(extent.max_element() * 1e-3).max(f32::MIN_POSITIVE);
        let count = |edge: f32| (extent / edge).ceil().max(Vec3::ONE).min(Vec3::splat(1e4)).as_ivec3();
        let too_many = |cells: IVec3| cells.as_i64vec3().element_product() > i64::from(MOST_CELLS);
        while too_many(count(edge)) {
            edge *= 1.1;
        }
        let grid = Grid { corner: bounds.min, edge, cells: count(edge) };
        let inside = Inside::new(&grid, scene);
        let mut lists_of: Vec<Vec<u32>> = vec![Vec::new(); inside.boxes.len()];
        let mut total = 0;
        for (i, (vpl, reach)) in vpls.iter().zip(&mut reaches).enumerate().filter(|(_, (_, reach))| **reach > 0.0) {
            let near = *reach;
            let low = grid.cell(vpl.position - near).max(IVec3::ZERO);
            let high = grid.cell(vpl.position + near).min(grid.cells - 1);
            let size = (high - low + 1).max(IVec3::ZERO).element_product();
            if size > MOST_CELLS_OF_ONE || total + 3 * size as usize > MOST_ENTRIES {
                *reach = 0.0;
                continue;
            }
            for z in low.z..=high.z {
                for y in low.y..=high.y {
                    for x in low.x..=high.x {
                        for number in inside.numbers[grid.index(IVec3::new(x, y, z))] {
                            let Some([min, max]) = inside.boxes.get(number as usize) else { continue };
                            let nearest = vpl.position.clamp(*min, *max).distance(vpl.position);
                            // Surfaces behind it get nothing: of a floor, what stands on it.
                            let d = 0.5 * (*min + *max) - vpl.position;
                            let ahead = d.dot(vpl.direction) + 0.5 * (*max - *min).dot(vpl.direction.abs());
                            if nearest <= near + MARGIN * edge && ahead > 0.0 {
                                lists_of[number as usize].push(i as u32);
                                total += 1;
                            }
                        }
                    }
                }
            }
        }
        let mut entries = Vec::with_capacity(1 + total + lists_of.len());
        entries.push(0);
        let begins = lists_of.iter().map(|list| match list.len() {
            0 => 0,
            length => {
                let begin = entries.len() as u32;
                entries.push(length as u32);
                entries.extend_from_slice(list);
                begin
            }
        });
        let begins: Vec<u32> = begins.collect();
        let starts = inside.numbers.iter().map(|numbers| {
            // Normals are rounded too: where no surface is along an axis, those along another are meant.
            let any = numbers.iter().copied().find(|&number| number != NONE);
            numbers.map(|number| {
                let number = if number == NONE { any } else { Some(number) };
                number.map_or(0, |number| begins[number as usize])
            })
        });
        let starts = starts.collect();
        Self { grid: bounds.min.extend(1.0 / edge), cells: grid.cells, starts, entries, reaches }
    }
}

/// Cubes side by side.
struct Grid {
    corner: Vec3,
    /// Edge of a cell, m.
    edge: f32,
    cells: IVec3,
}

impl Grid {
    /// Which one a point is in; outside of the grid one beyond its end.
    fn cell(&self, p: Vec3) -> IVec3 {
        ((p - self.corner) / self.edge).floor().clamp(Vec3::NEG_ONE, self.cells.as_vec3()).as_ivec3()
    }

    fn index(&self, cell: IVec3) -> usize {
        (cell.x + self.cells.x * (cell.y + self.cells.y * cell.z)) as usize
    }

    /// The first and the last cell along an axis that hold a part of what reaches from `min` to `max`.
    fn range(&self, axis: usize, min: f32, max: f32) -> [i32; 2] {
        let last = self.cells[axis] - 1;
        let at = |x: f32| (x - self.corner[axis]) / self.edge;
        [at(min) - MARGIN, at(max) + MARGIN].map(|x| (x.floor() as i32).clamp(0, last))
    }

    /// From where to where a cell reaches along an axis, m.
    fn sides(&self, axis: usize, cell: i32) -> [f32; 2] {
        [cell as f32 - MARGIN, (cell + 1) as f32 + MARGIN].map(|x| self.corner[axis] + x * self.edge)
    }
}

/// Where in the cells there are surfaces.
struct Inside {
    /// For each cell the number of the box of those that face along each axis, or [`NONE`].
    numbers: Vec<[u32; 3]>,
    /// Smallest and largest coordinates.
    boxes: Vec<[Vec3; 2]>,
}

impl Inside {
    fn new(grid: &Grid, scene: &Scene) -> Self {
        let triangles: Vec<(usize, usize)> = scene
            .instances
            .iter()
            .enumerate()
            .flat_map(|(i, instance)| (0..scene.meshes[instance.mesh].indices.len() / 3).map(move |k| (i, k)))
            .collect();
        let triangle = |&(i, k): &(usize, usize)| {
            let instance = &scene.instances[i];
            let mesh = &scene.meshes[instance.mesh];
            [0, 1, 2].map(|corner| {
                let position = mesh.positions[mesh.indices[3 * k + corner] as usize];
                instance.world_from_object.transform_point3(position)
            })
        };
        let parts: u64 = triangles.par_iter().map(|place| most_parts(grid, triangle(place))).sum();
        let count = grid.cells.element_product() as usize;
        let mut inside = Self { numbers: vec![[NONE; 3]; count], boxes: Vec::new() };
        if parts > MOST_PARTS {
            for (k, numbers) in inside.numbers.iter_mut().enumerate() {
                let at = k as i32;
                let cell = [at % grid.cells.x, at / grid.cells.x % grid.cells.y, at / grid.cells.x / grid.cells.y];
                let sides = [0, 1, 2].map(|axis| grid.sides(axis, cell[axis]));
                inside.boxes.push([0, 1].map(|side| Vec3::from_array(sides.map(|sides| sides[side]))));
                // The other axes have what the first one has.
                numbers[0] = k as u32;
            }
            return inside;
        }
        let found: Vec<Vec<(u32, u8, [Vec3; 2])>> = triangles
            .par_chunks(1 << 10)
            .map(|places| {
                let mut found = Vec::new();
                places.iter().for_each(|place| cut_to_cells(grid, triangle(place), &mut found));
                found
            })
            .collect();
        for (cell, axis, [min, max]) in found.into_iter().flatten() {
            let number = &mut inside.numbers[cell as usize][usize::from(axis)];
            if *number == NONE {
                *number = inside.boxes.len() as u32;
                inside.boxes.push([min, max]);
            } else {
                let known = &mut inside.boxes[*number as usize];
                *known = [known[0].min(min), known[1].max(max)];
            }
        }
        inside
    }
}

/// At most so many cells hold a part of a triangle.
fn most_parts(grid: &Grid, [a, b, c]: [Vec3; 3]) -> u64 {
    let (min, max) = (a.min(b).min(c), a.max(b).max(c));
    let counts = [0, 1, 2].map(|axis| {
        let [first, last] = grid.range(axis, min[axis], max[axis]);
        (last - first + 1) as u64
    });
    // A plane goes through about as many as are on its largest side.
    3 * (0..3).map(|axis| counts[axis] * counts[(axis + 1) % 3]).max().unwrap_or(0)
}

/// The box around the part of a triangle in each cell, with the cell and each axis that the triangle faces along.
fn cut_to_cells(grid: &Grid, triangle: [Vec3; 3], found: &mut Vec<(u32, u8, [Vec3; 2])>) {
    let [a, b, c] = triangle;
    // Tiny ones must not vanish in the product.
    let unit = |v: Vec3| v / v.abs().max_element().max(1e-37);
    let normal = unit(b - a).cross(unit(c - a)).abs();
    let faces: [bool; 3] = [0, 1, 2].map(|axis| normal[axis] >= ALONG * normal.max_element());
    let mut whole = Polygon::default();
    triangle.into_iter().for_each(|corner| whole.push(corner));
    for_cells(grid, 0, whole, |x, slice| {
        for_cells(grid, 1, slice, |y, row| {
            for_cells(grid, 2, row, |z, part| {
                let cell = grid.index(IVec3::new(x, y, z)) as u32;
                for axis in (0..3).filter(|&axis| faces[usize::from(axis)]) {
                    found.push((cell, axis, part.bounds()));
                }
            });
        });
    });
}

/// Calls with each cell along an axis and the part of the polygon that is in it.
fn for_cells(grid: &Grid, axis: usize, polygon: Polygon, mut then: impl FnMut(i32, Polygon)) {
    let [min, max] = polygon.bounds();
    let [first, last] = grid.range(axis, min[axis], max[axis]);
    for cell in first..=last {
        let [low, high] = grid.sides(axis, cell);
        let part = if first == last { polygon } else { polygon.cut(axis, low, 1.0).cut(axis, high, -1.0) };
        if part.count > 0 {
            then(cell, part);
        }
    }
}

/// A convex polygon: a triangle cut at the six sides of a box has nine corners at most.
#[derive(Clone, Copy, Default)]
struct Polygon {
    corners: [Vec3; 9],
    count: usize,
}

impl Polygon {
    fn push(&mut self, corner: Vec3) {
        // Rounding could make it more.
        if let Some(free) = self.corners.get_mut(self.count) {
            *free = corner;
            self.count += 1;
        }
    }

    /// The part on one side of a plane across an axis: above it with `sign` 1, below it with −1.
    fn cut(&self, axis: usize, at: f32, sign: f32) -> Self {
        let mut part = Self::default();
        for k in 0..self.count {
            let [a, b] = [k, (k + 1) % self.count].map(|k| self.corners[k]);
            let [height_a, height_b] = [a, b].map(|p| sign * (p[axis] - at));
            if height_a >= 0.0 {
                part.push(a);
            }
            if (height_a >= 0.0) != (height_b >= 0.0) {
                part.push(a.lerp(b, height_a / (height_a - height_b)));
            }
        }
        part
    }

    /// Smallest and largest coordinates.
    fn bounds(&self) -> [Vec3; 2] {
        let corners = &self.corners[..self.count];
        corners.iter().fold([Vec3::INFINITY, Vec3::NEG_INFINITY], |[min, max], p| [min.min(*p), max.max(*p)])
    }
}

/// Distance, m, within which each VPL is near; 0 for those that cannot be listed.
fn reaches(vpls: &[Vpl]) -> Vec<f32> {
    let power = |vpl: &Vpl| f64::from(vpl.intensity.element_sum());
    let area = |vpl: &Vpl| f64::from(vpl.d_min).powi(2);
    let able = |vpl: &Vpl| vpl.emission == Emission::Lambertian && vpl.near() > 0.0 && vpl.near().is_finite();
    // Powers and areas of all before.
    let (mut sums, mut sum) = (vec![[0.0; 2]], [0.0; 2]);
    for vpl in vpls {
        if able(vpl) {
            sum = [sum[0] + power(vpl), sum[1] + area(vpl)];
        }
        sums.push(sum);
    }
    let reach = |(i, vpl): (usize, &Vpl)| {
        if !able(vpl) {
            return 0.0;
        }
        let (before, with) = (sums[i.saturating_sub(AROUND)], sums[vpls.len().min(i + AROUND + 1)]);
        let [powers, areas] = [0, 1].map(|k| with[k] - before[k]);
        let brighter = (power(vpl) * areas / (area(vpl) * powers)) as f32;
        // What is black may be lit.
        let stretch = if brighter > 0.0 { brighter.sqrt() } else { 1.0 };
        REACH * vpl.near() * stretch.clamp(STRETCH[0], STRETCH[1])
    };
    vpls.iter().enumerate().map(reach).collect()
}

/// The lists in a texture, as `common/near.glsl` reads them: a texel with where those of each cell begin, then four entries
/// in each texel.
pub(crate) struct Near {
    pub texture: Texture,
    pub grid: Vec4,
    /// Cells along each axis, and texels before the entries.
    pub cells: IVec4,
}

impl Near {
    /// `None` if there is nothing in the lists.
    pub fn new(context: &Rc<Context>, lists: &Lists) -> Result<Option<Self>> {
        if lists.entries.len() <= 1 {
            return Ok(None);
        }
        let mut texels: Vec<[u32; 4]> = lists.starts.iter().map(|[x, y, z]| [*x, *y, *z, 0]).collect();
        let header = texels.len() as i32;
        texels.extend(lists.entries.chunks(4).map(|four| std::array::from_fn(|k| four.get(k).copied().unwrap_or(0))));
        texels.resize(texels.len().next_multiple_of(ROW), [0; 4]);
        let (width, height) = (ROW as u32, (texels.len() / ROW) as u32);
        let pixels = Some(bytemuck::cast_slice(&texels));
        let texture = Texture::with_pixels(context, Format::Rgba32Ui, width, height, pixels)?;
        Ok(Some(Self { texture, grid: lists.grid, cells: lists.cells.extend(header) }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Instance, Mesh};

    /// Triangles of all sizes, any way round, and some that are flat along an axis.
    fn triangles(random: impl Fn(u32) -> Vec3, bounds: &Bounds) -> Scene {
        let size = bounds.max - bounds.min;
        let positions = (0..120).flat_map(|k| {
            let (at, scale) = (random(3 * k), if k % 3 == 0 { 1.0 } else { 0.1 });
            let mut corners = [0, 1, 2].map(|c| (at + scale * (random(3 * k + c) - 0.5)).clamp(Vec3::ZERO, Vec3::ONE));
            if k % 4 == 0 {
                let axis = k as usize / 4 % 3;
                corners.iter_mut().for_each(|corner| corner[axis] = [0.0, 0.25, at[axis]][k as usize % 3]);
            }
            corners.map(|corner| bounds.min + corner * size)
        });
        let mut scene = Scene::default();
        let mesh = Mesh { positions: positions.collect(), indices: (0..360).collect(), ..Mesh::default() };
        scene.meshes.push(mesh.into());
        scene.instances.push(Instance { mesh: 0, world_from_object: glam::Mat4::IDENTITY });
        scene
    }

    /// As `common/near.glsl` reads it.
    fn list(lists: &Lists, point: Vec3, normal: Vec3) -> &[u32] {
        let cell = ((point - lists.grid.truncate()) * lists.grid.w).floor().as_ivec3();
        let cell = cell.clamp(IVec3::ZERO, lists.cells - 1);
        let a = normal.abs();
        let axis = if a.x >= a.y.max(a.z) { 0 } else { 2 - usize::from(a.y >= a.z) };
        let index = (cell.x + lists.cells.x * (cell.y + lists.cells.y * cell.z)) as usize;
        let start = lists.starts[index][axis] as usize;
        &lists.entries[start + 1..][..lists.entries[start] as usize]
    }

    /// What a list leaves out gives nothing where it is read.
    #[test]
    fn lists_hold_every_vpl_that_is_near() {
        let bounds = Bounds { min: Vec3::new(-3.0, 0.0, -1.0), max: Vec3::new(3.0, 2.0, 1.0) };
        let random = |k: u32| Vec3::from_slice(&sobol_burley::sample_4d(k, 0, 7)[..3]);
        let scene = triangles(|k| random(40_000 + k), &bounds);
        let vpls: Vec<Vpl> = (0..300)
            .map(|k| {
                let direction = (random(1000 + k) - 0.5).normalize();
                // One is too large to be listed.
                let radius = if k == 7 { 100.0 } else { 0.02 + 0.1 * random(2000 + k).x };
                let position = bounds.min + random(k) * (bounds.max - bounds.min);
                Vpl::lambertian(position, direction, Vec3::splat(radius * radius), radius)
            })
            .collect();
        let lists = Lists::new(&vpls, &scene, &bounds);
        assert!(lists.reaches[7] == 0.0 && lists.reaches.iter().filter(|reach| **reach > 0.0).count() == 299);
        let (mut found, mut read) = (0, 0);
        for k in 0..40_000 {
            let corners = [0, 1, 2].map(|corner| scene.meshes[0].positions[3 * (k as usize % 120) + corner]);
            let weights = crate::sampling::on_triangle([random(5000 + k).x, random(5000 + k).y]);
            let point = corners[0] * weights.x + corners[1] * weights.y + corners[2] * weights.z;
            let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize();
            let list = list(&lists, point, normal);
            read += list.len();
            for (i, vpl) in vpls.iter().enumerate().filter(|(i, _)| lists.reaches[*i] > 0.0) {
                let d = point - vpl.position;
                if d.length() < lists.reaches[i] && d.dot(vpl.direction) > 0.0 {
                    assert!(list.contains(&(i as u32)), "{i} at {point}, normal {normal}");
                    found += 1;
                }
            }
        }
        println!("{found} of {read}");
        assert!(found > 3000 && read < 2 * found, "{found} {read}");
    }

    /// On a floor and the wall that stands on it, the one's VPLs are near to the other alone.
    #[test]
    fn a_plane_is_not_near_to_itself() {
        let bounds = Bounds { min: Vec3::ZERO, max: Vec3::splat(4.0) };
        let mut scene = Scene::default();
        let floor = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]];
        let positions = floor.iter().map(|[x, z]| Vec3::new(*x, 0.0, *z));
        let positions = positions.chain(floor.iter().map(|[y, z]| Vec3::new(0.0, *y, *z))).collect();
        let indices = vec![0, 2, 1, 0, 3, 2, 4, 5, 6, 4, 6, 7];
        scene.meshes.push(Mesh { positions, indices, ..Mesh::default() }.into());
        scene.instances.push(Instance { mesh: 0, world_from_object: glam::Mat4::IDENTITY });
        let vpl = |k: u32| {
            let (a, b) = (0.2 + (k / 2 % 10) as f32 * 0.4, 0.2 + (k / 20) as f32 * 0.4);
            let (position, direction) = match k % 2 {
                0 => (Vec3::new(a, 1e-4, b), Vec3::Y),
                _ => (Vec3::new(1e-4, a, b), Vec3::X),
            };
            Vpl::lambertian(position, direction, Vec3::ONE, 0.4)
        };
        let vpls: Vec<Vpl> = (0..200).map(vpl).collect();
        let lists = Lists::new(&vpls, &scene, &bounds);
        let mut longest = 0;
        for k in 0..1600 {
            let (a, b) = ((k % 40) as f32 * 0.1 + 0.05, (k / 40) as f32 * 0.1 + 0.05);
            for (point, normal, other) in [(Vec3::new(a, 0.0, b), Vec3::Y, 1), (Vec3::new(0.0, a, b), Vec3::X, 0)] {
                let list = list(&lists, point, normal);
                assert!(list.iter().all(|i| i % 2 == other), "{point}: {list:?}");
                longest = longest.max(list.len());
            }
        }
        assert!((5..40).contains(&longest), "{longest}");
        // A point in the air has no list; of surfaces alone the floor's is read whatever the normal.
        assert!(list(&lists, Vec3::splat(2.0), Vec3::Y).is_empty());
        let near_wall = Vec3::new(0.5, 0.0, 2.0);
        assert_eq!(list(&lists, near_wall, Vec3::X), list(&lists, near_wall, Vec3::Y));
        assert!(!list(&lists, near_wall, Vec3::X).is_empty());
    }

    /// Where there is too much to cut, lists are for cells whatever is in them.
    #[test]
    fn many_large_triangles_are_not_cut() {
        let bounds = Bounds { min: Vec3::ZERO, max: Vec3::ONE };
        let mut scene = Scene::default();
        let across = [Vec3::ZERO, Vec3::new(1.0, 1.0, 0.0), Vec3::ONE];
        let mesh = Mesh { positions: across.to_vec(), indices: [0, 1, 2].repeat(2000), ..Mesh::default() };
        scene.meshes.push(mesh.into());
        scene.instances.push(Instance { mesh: 0, world_from_object: glam::Mat4::IDENTITY });
        let vpls = [Vpl::lambertian(Vec3::new(0.5, 0.4, 0.3), Vec3::Y, Vec3::ONE, 0.01)];
        let lists = Lists::new(&vpls, &scene, &bounds);
        let above = vpls[0].position + Vec3::Y * (0.5 * lists.reaches[0]);
        for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
            assert_eq!(list(&lists, above, axis), [0]);
        }
        assert!(list(&lists, Vec3::splat(0.9), Vec3::Y).is_empty());
    }

    /// Four times as bright as those around, twice as far, however large the patch and however bright other places.
    #[test]
    fn what_is_brighter_is_near_from_farther() {
        let vpl = |brightness: f32, radius: f32| {
            Vpl::lambertian(Vec3::ZERO, Vec3::Y, Vec3::splat(brightness * radius * radius), radius)
        };
        let mut vpls: Vec<Vpl> = (0..6000).map(|k| vpl(if k < 3000 { 3.0 } else { 0.3 }, [0.1, 0.2][k % 2])).collect();
        let odd = [(500, 12.0, 2.0), (1800, 48.0, 4.0), (4500, 1.2, 2.0), (4501, 0.0, 1.0), (5600, 0.003, STRETCH[0])];
        let odd = odd.into_iter().chain([(2600, 3e6, STRETCH[1])]);
        for (i, brightness, _) in odd.clone() {
            vpls[i] = vpl(brightness, 1e-3);
        }
        let reaches = reaches(&vpls);
        for (i, _, stretch) in odd.chain([(0, 0.0, 1.0), (1, 0.0, 1.0), (1000, 0.0, 1.0), (5000, 0.0, 1.0)]) {
            let share = reaches[i] / (REACH * vpls[i].near());
            assert!((share / stretch - 1.0).abs() < 0.01, "{i}: {share}");
        }
    }

    #[test]
    fn odd_vpls_and_scenes_make_no_trouble() {
        let scene = Scene::builtin("cornell").unwrap();
        let vpl = |radius| Vpl::lambertian(Vec3::splat(1e30), Vec3::Y, Vec3::ONE, radius);
        for bounds in [
            Bounds { min: Vec3::ZERO, max: Vec3::ZERO },
            Bounds { min: Vec3::splat(-1e30), max: Vec3::splat(1e30) },
            Bounds { min: Vec3::ZERO, max: Vec3::new(1e-30, 1e9, 0.0) },
            Scene::builtin("cornell").unwrap().bounds().unwrap(),
        ] {
            for vpls in [vec![], vec![vpl(0.0)], vec![vpl(1e-30), vpl(1e30), vpl(f32::INFINITY), vpl(f32::NAN)]] {
                let lists = Lists::new(&vpls, &scene, &bounds);
                assert!(lists.cells.min_element() >= 1 && lists.starts.len() as i32 <= MOST_CELLS, "{lists:?}");
            }
        }
    }
}
