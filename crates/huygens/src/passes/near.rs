//! Lists of the VPLs that are near: the interleaved gather sums those at every pixel, since what they give changes too
//! much from pixel to pixel to be shared between neighbours.

use std::rc::Rc;

use glam::{IVec3, IVec4, Vec3, Vec4};

use crate::Result;
use crate::gl::{Context, Format, Texture};
use crate::lattice::{Emission, Vpl};
use crate::scene::Bounds;

/// Cells of the grid at most, and cells that one VPL may be near to, and entries of all lists together. VPLs that would
/// take more are not listed.
const MOST_CELLS: i32 = 1 << 20;
const MOST_CELLS_OF_ONE: i32 = 1 << 17;
const MOST_ENTRIES: usize = 1 << 23;

/// A VPL is near up to this share of the distance within which it is its rectangle.
const REACH: f32 = 0.6;

/// Texels in a row of the texture.
const ROW: usize = 512;

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
    /// Which VPLs are in lists.
    pub listed: Vec<bool>,
}

impl Lists {
    /// `bounds` are those of all surfaces.
    pub fn new(vpls: &[Vpl], bounds: &Bounds) -> Self {
        let extent = bounds.max - bounds.min;
        let mut reaches: Vec<f32> = vpls.iter().filter(|vpl| lists(vpl)).map(reach).collect();
        let middle = reaches.len() / 2;
        let usual = if reaches.is_empty() { 0.0 } else { *reaches.select_nth_unstable_by(middle, f32::total_cmp).1 };
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
        let (mut listed, mut total) = (vec![false; vpls.len()], 0);
        for (i, vpl) in vpls.iter().enumerate().filter(|(_, vpl)| lists(vpl)) {
            let near = reach(vpl);
            let low = cell(vpl.position - near).max(IVec3::ZERO);
            let high = cell(vpl.position + near).min(cells - 1);
            let size = (high - low + 1).max(IVec3::ZERO).element_product();
            if size > MOST_CELLS_OF_ONE || total + size as usize > MOST_ENTRIES {
                continue;
            }
            listed[i] = true;
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
        Self { grid: bounds.min.extend(1.0 / edge), cells, ranges, entries, listed }
    }
}

/// Distance, m, within which a VPL is near.
pub(crate) fn reach(vpl: &Vpl) -> f32 {
    REACH * vpl.near()
}

/// Whether a VPL can be listed.
fn lists(vpl: &Vpl) -> bool {
    vpl.emission == Emission::Lambertian && vpl.near() > 0.0 && vpl.near().is_finite()
}

/// The lists in a texture, as `common/near.glsl` reads them: a texel with the range of each cell, then four entries in
/// each texel.
pub(crate) struct Near {
    pub texture: Texture,
    pub grid: Vec4,
    /// Cells along each axis, and texels before the entries.
    pub cells: IVec4,
}

impl Near {
    /// `None` if there is nothing in the lists.
    pub fn new(context: &Rc<Context>, lists: &Lists) -> Result<Option<Self>> {
        if lists.entries.is_empty() {
            return Ok(None);
        }
        let mut texels: Vec<[u32; 4]> = lists.ranges.iter().map(|[first, end]| [*first, *end, 0, 0]).collect();
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
                Vpl::lambertian(inside(k), direction, Vec3::ONE, radius)
            })
            .collect();
        let lists = Lists::new(&vpls, &bounds);
        assert!(!lists.listed[7] && lists.listed.iter().filter(|listed| **listed).count() == 299);
        let (mut found, mut longest) = (0, 0);
        for k in 0..20000 {
            let point = inside(5000 + k);
            let cell = ((point - lists.grid.truncate()) * lists.grid.w).as_ivec3();
            let [first, end] = lists.ranges[(cell.x + lists.cells.x * (cell.y + lists.cells.y * cell.z)) as usize];
            let list = &lists.entries[first as usize..end as usize];
            longest = longest.max(list.len());
            for (i, vpl) in vpls.iter().enumerate().filter(|(i, _)| lists.listed[*i]) {
                let d = point - vpl.position;
                if d.length() < reach(vpl) && d.dot(vpl.direction) > 0.0 {
                    assert!(list.contains(&(i as u32)), "{i} at {point}");
                    found += 1;
                }
            }
        }
        assert!(found > 1500 && longest < 20, "{found} {longest}");
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
