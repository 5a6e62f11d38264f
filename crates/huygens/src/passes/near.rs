//! Lists of the VPLs that are near: the interleaved gather sums those at every pixel, since what they give changes too
//! much from pixel to pixel to be shared between neighbours.

use std::rc::Rc;

use glam::{IVec3, Vec3, Vec4};

use crate::Result;
use crate::gl::{Context, Format, Texture};
use crate::lattice::{Emission, Vpl};
use crate::scene::Bounds;

/// Cells of the grid at most, and cells that one VPL may be near to, and entries of all lists together. VPLs that would
/// take more are not listed.
const MOST_CELLS: i32 = 1 << 20;
const MOST_CELLS_OF_ONE: i32 = 1 << 17;
const MOST_ENTRIES: usize = 1 << 23;

/// A VPL that is as bright as those around it is near up to this share of the distance within which it is its rectangle.
const REACH: f32 = 0.54;

/// What one gives falls as its brightness over the square of the distance: the root of how much brighter it is than those
/// around is how much farther it is near, within these limits.
const STRETCH: [f32; 2] = [0.6, 4.0];

/// VPLs on either side of one, in their order, that are around it.
const AROUND: usize = 512;

/// Texels in a row of the texture.
const ROW: usize = 2048;

/// A grid over the scene, in each cell the numbers of the VPLs that are near to some point of it.
#[derive(Debug)]
pub(crate) struct Lists {
    /// Corner of the grid, m, and cells per m.
    pub grid: Vec4,
    /// Cells along each axis.
    pub cells: IVec3,
    /// For each cell where its list begins, and its end, in entries.
    ranges: Vec<[u32; 2]>,
    entries: Vec<u32>,
    /// Distance, m, within which each VPL is near; 0 for those that are in no list.
    pub reaches: Vec<f32>,
}

impl Lists {
    /// `bounds` are those of all surfaces.
    pub fn new(vpls: &[Vpl], bounds: &Bounds) -> Self {
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
        let cells = count(edge);
        let cell = |p: Vec3| ((p - bounds.min) / edge).floor().clamp(Vec3::NEG_ONE, cells.as_vec3()).as_ivec3();
        let mut lists_of: Vec<Vec<u32>> = vec![Vec::new(); cells.element_product() as usize];
        let mut total = 0;
        for (i, (vpl, reach)) in vpls.iter().zip(&mut reaches).enumerate().filter(|(_, (_, reach))| **reach > 0.0) {
            let near = *reach;
            let low = cell(vpl.position - near).max(IVec3::ZERO);
            let high = cell(vpl.position + near).min(cells - 1);
            let size = (high - low + 1).max(IVec3::ZERO).element_product();
            if size > MOST_CELLS_OF_ONE || total + size as usize > MOST_ENTRIES {
                *reach = 0.0;
                continue;
            }
            for z in low.z..=high.z {
                for y in low.y..=high.y {
                    for x in low.x..=high.x {
                        let at = IVec3::new(x, y, z);
                        let middle = bounds.min + (at.as_vec3() + 0.5) * edge;
                        let d = middle - vpl.position;
                        // Surfaces behind it get nothing. A cell is within half its diagonal of its middle.
                        let nearest = (d.abs() - 0.5 * edge).max(Vec3::ZERO).length();
                        let behind = d.dot(vpl.direction) + 0.5 * edge * vpl.direction.abs().element_sum() <= 0.0;
                        // A hundredth for rounding.
                        if nearest <= near + 0.01 * edge && !behind {
                            lists_of[(x + cells.x * (y + cells.y * z)) as usize].push(i as u32);
                            total += 1;
                        }
                    }
                }
            }
        }
        let mut entries = Vec::with_capacity(total);
        let ranges = lists_of.iter().map(|list| {
            let first = entries.len() as u32;
            entries.extend_from_slice(list);
            [first, entries.len() as u32]
        });
        let ranges = ranges.collect();
        Self { grid: bounds.min.extend(1.0 / edge), cells, ranges, entries, reaches }
    }

    /// For each cell a texel with the one where its list begins and its length, then the lists, four entries in a texel.
    fn texels(&self) -> Vec<[u32; 4]> {
        let mut texels = vec![[0; 4]; self.ranges.len()];
        for (cell, &[first, end]) in self.ranges.iter().enumerate() {
            texels[cell] = [texels.len() as u32, end - first, 0, 0];
            let list = &self.entries[first as usize..end as usize];
            texels.extend(list.chunks(4).map(|four| std::array::from_fn(|k| four.get(k).copied().unwrap_or(0))));
        }
        texels
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

/// The lists in a texture, see [`Lists::texels`].
pub(crate) struct Near {
    pub texture: Texture,
    pub grid: Vec4,
    /// Cells along each axis.
    pub cells: IVec3,
}

impl Near {
    /// `None` if there is nothing in the lists.
    pub fn new(context: &Rc<Context>, lists: &Lists) -> Result<Option<Self>> {
        if lists.entries.is_empty() {
            return Ok(None);
        }
        let mut texels = lists.texels();
        texels.resize(texels.len().next_multiple_of(ROW), [0; 4]);
        let (width, height) = (ROW as u32, (texels.len() / ROW) as u32);
        let pixels = Some(bytemuck::cast_slice(&texels));
        let texture = Texture::with_pixels(context, Format::Rgba32Ui, width, height, pixels)?;
        Ok(Some(Self { texture, grid: lists.grid, cells: lists.cells }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Scene;

    /// What a list leaves out gives nothing where it is read.
    #[test]
    fn lists_hold_every_vpl_that_is_near() {
        let bounds = Bounds { min: Vec3::new(-3.0, 0.0, -1.0), max: Vec3::new(3.0, 2.0, 1.0) };
        let random = |k: u32| Vec3::from_slice(&sobol_burley::sample_4d(k, 0, 7)[..3]);
        let inside = |k: u32| bounds.min + random(k) * (bounds.max - bounds.min);
        let vpls: Vec<Vpl> = (0..300)
            .map(|k| {
                let direction = (random(1000 + k) - 0.5).normalize();
                // One is too large to be listed.
                let radius = if k == 7 { 100.0 } else { 0.02 + 0.1 * random(2000 + k).x };
                Vpl::lambertian(inside(k), direction, Vec3::splat(radius * radius), radius)
            })
            .collect();
        let lists = Lists::new(&vpls, &bounds);
        assert!(lists.reaches[7] == 0.0 && lists.reaches.iter().filter(|reach| **reach > 0.0).count() == 299);
        let (mut found, mut longest) = (0, 0);
        for k in 0..20000 {
            let point = inside(5000 + k);
            let cell = ((point - lists.grid.truncate()) * lists.grid.w).as_ivec3();
            let [first, end] = lists.ranges[(cell.x + lists.cells.x * (cell.y + lists.cells.y * cell.z)) as usize];
            let list = &lists.entries[first as usize..end as usize];
            longest = longest.max(list.len());
            for (i, vpl) in vpls.iter().enumerate().filter(|(i, _)| lists.reaches[*i] > 0.0) {
                let d = point - vpl.position;
                if d.length() < lists.reaches[i] && d.dot(vpl.direction) > 0.0 {
                    assert!(list.contains(&(i as u32)), "{i} at {point}");
                    found += 1;
                }
            }
        }
        assert!(found > 1500 && longest < 20, "{found} {longest}");
    }

    /// As `common/near.glsl` reads them.
    #[test]
    fn lists_are_four_entries_in_a_texel() {
        let lengths = [0, 1, 4, 5, 0, 32, 33, 70];
        let lists: Vec<Vec<u32>> = lengths.iter().map(|&n| (0..n).map(|k| 1000 * n + k).collect()).collect();
        let ends: Vec<u32> = lengths.iter().scan(0, |end, n| Some(*end + n).inspect(|sum| *end = *sum)).collect();
        let lists_of = Lists {
            grid: Vec4::ZERO,
            cells: IVec3::new(8, 1, 1),
            ranges: ends.iter().zip(lengths).map(|(end, n)| [end - n, *end]).collect(),
            entries: lists.concat(),
            reaches: Vec::new(),
        };
        let texels = lists_of.texels();
        for (cell, list) in lists.iter().enumerate() {
            let [first, length, ..] = texels[cell];
            let read: Vec<u32> = (0..length).map(|k| texels[(first + k / 4) as usize][k as usize % 4]).collect();
            assert_eq!(&read, list);
        }
        assert_eq!(texels.len(), 8 + 1 + 1 + 2 + 8 + 9 + 18);
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
        let vpl = |radius| Vpl::lambertian(Vec3::splat(1e30), Vec3::Y, Vec3::ONE, radius);
        for bounds in [
            Bounds { min: Vec3::ZERO, max: Vec3::ZERO },
            Bounds { min: Vec3::splat(-1e30), max: Vec3::splat(1e30) },
            Bounds { min: Vec3::ZERO, max: Vec3::new(1e-30, 1e9, 0.0) },
            Scene::builtin("cornell").unwrap().bounds().unwrap(),
        ] {
            for vpls in [vec![], vec![vpl(0.0)], vec![vpl(1e-30), vpl(1e30), vpl(f32::INFINITY), vpl(f32::NAN)]] {
                let lists = Lists::new(&vpls, &bounds);
                assert!(lists.cells.min_element() >= 1 && lists.ranges.len() as i32 <= MOST_CELLS, "{lists:?}");
            }
        }
    }
}
