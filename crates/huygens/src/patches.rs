//! Patches: the rectangle of surface that each VPL of reflected waves stands for.
//!
//! They are to meet without gap or overlap, since next to a seam a surface sees those along it alone. So a k-d tree
//! (Bentley 1975) splits space into boxes, one for each VPL, and a patch is what there is of the surface in its box.

use std::cmp::Reverse;
use std::f32::consts::PI;

use glam::Vec3;
use rayon::prelude::*;

use crate::lattice::Vpl;
use crate::reflected::{NEAR, Neighbour, Tracer, neighbours_of};
use crate::surfel::main_direction;

/// Neighbours along a space-filling curve, on either side, that stand for the nearest ones.
const WINDOW: usize = 128;

/// How far a patch may go in its box, over half the side of a square as large as the disc up to the eighth neighbour.
const REACH: f32 = 2.0;

/// What is off a plane by no more than this share of half that side is in it.
const FLAT: f32 = 0.1;

/// Cosine of the angle to a side up to which VPLs on what is round belong to that side, too.
const BESIDE: f32 = 0.5;

/// Cosine of the angle between normals up to which VPLs are in one plane.
const IN_PLANE: f32 = 0.99;

/// What a patch leaves of its box is looked for so far, as [`REACH`], in so many steps along either side.
const FAR: f32 = 3.0;
const STEPS: usize = 6;

/// How often what boxes leave is given to new VPLs.
const ROUNDS: usize = 3;

/// A patch that has so many times less than those around it is not taken from its box.
const SLIVER: f32 = 16.0;

/// Distances along the normal count for so much more: what lies in another plane is another surface.
const ACROSS: f32 = 3.0;

/// A box that is one VPL's own, m; without end where no other is.
#[derive(Clone, Copy, Debug)]
struct Cell {
    min: Vec3,
    max: Vec3,
}

impl Cell {
    const ALL: Self = Self { min: Vec3::NEG_INFINITY, max: Vec3::INFINITY };

    fn has(&self, point: Vec3) -> bool {
        point.cmpge(self.min).all() && point.cmple(self.max).all()
    }

    /// How far it goes from a point in it, m.
    fn room(&self, from: Vec3, along: Vec3) -> f32 {
        let to = |axis: usize| if along[axis] > 0.0 { self.max[axis] } else { self.min[axis] };
        let axes = (0..3).filter(|&axis| along[axis].abs() > 1e-3);
        axes.map(|axis| (to(axis) - from[axis]) / along[axis]).fold(f32::INFINITY, f32::min)
    }
}

/// Where a surface ceases.
#[derive(Clone, Copy, Debug)]
struct Limit {
    /// Distance to there, m.
    length: f32,
    /// Whether it ends; else something stands on it, or it goes on.
    is_end: bool,
}

/// What one VPL's patch is.
struct Patch {
    /// As [`Vpl::extent`].
    extent: [f32; 4],
    /// Of the surface in it, m².
    area: f32,
    /// Others of the same surface, and their weights.
    around: Vec<(usize, f32)>,
    /// Whether it is what there is in its box of a surface that is flat.
    is_flat: bool,
}

/// What a patch leaves of its box, beyond something that stands in it.
struct Left {
    /// How many points of it were found.
    size: usize,
    vpl: Vpl,
    /// What it and the box it is of have then.
    cells: [Cell; 2],
}

/// What VPLs next to each other exchange, so that the radiance of their patches is less noisy: as heat flows, from what
/// is brighter than its neighbour to that. None is lost, and what is even stays so.
#[derive(Clone, Debug, Default)]
pub(crate) struct Exchange {
    /// Two VPLs, and the share of its flux that each gives to the other.
    pairs: Vec<([usize; 2], [f32; 2])>,
}

impl Exchange {
    fn new(patches: &[Patch], order: &[usize]) -> Self {
        let pairs = || {
            patches
                .iter()
                .enumerate()
                .flat_map(|(i, patch)| patch.around.iter().map(move |&(k, weight)| (i, k, weight)))
        };
        let area = |i: usize| patches[i].area;
        let mut sums: Vec<f32> = patches.iter().map(|patch| 2.0 * patch.area).collect();
        for (i, k, weight) in pairs() {
            sums[i] += weight * area(k);
            sums[k] += weight * area(i);
        }
        let pair = |(i, k, weight): (usize, usize, f32)| {
            let part = weight / sums[i].max(sums[k]);
            ([order[i], order[k]], [part * area(k), part * area(i)])
        };
        Self { pairs: pairs().map(pair).collect() }
    }

    /// Keeps what those VPLs exchange of which this holds.
    pub fn retain(&mut self, mut keep: impl FnMut(usize, usize) -> bool) {
        self.pairs.retain(|&([a, b], _)| keep(a, b));
    }

    /// Changes what all VPLs send out, in the order that they had when their patches were laid.
    pub fn even_out(&self, flux: &mut [Vec3]) {
        let before = flux.to_vec();
        for &([a, b], [of_a, of_b]) in &self.pairs {
            let flow = before[a] * of_a - before[b] * of_b;
            flux[a] -= flow;
            flux[b] += flow;
        }
        // Rounding may leave less than nothing.
        for flux in flux {
            *flux = flux.max(Vec3::ZERO);
        }
    }
}

impl Tracer<'_> {
    /// Gives each VPL, of those that are to light the scene, its patch, and evens them out. Where something stands in a
    /// box, there are new VPLs for what is behind it, as long as there are no more than `most` in all.
    pub(crate) fn lay_patches(&self, vpls: &mut Vec<Vpl>, most: usize) -> Exchange {
        self.sort(vpls);
        let first = vpls.len();
        let mut cells = self.cells(vpls);
        let mut patches: Vec<Patch> =
            (0..vpls.len()).into_par_iter().map(|i| self.patch(vpls, first, i, &cells[i])).collect();
        let mut changed: Vec<usize> = (0..first).collect();
        for _ in 0..ROUNDS {
            let left = |&i: &usize| Some((i, self.left_by(vpls, first, i, &cells[i], &patches[i])?));
            let mut lefts: Vec<(usize, Left)> = changed.par_iter().filter_map(left).collect();
            lefts.sort_by_key(|(_, left)| Reverse(left.size));
            changed.clear();
            for (of, left) in lefts {
                if vpls.len() >= most {
                    break;
                }
                let i = vpls.len();
                vpls.push(left.vpl);
                let patch = self.patch(vpls, first, i, &left.cells[0]);
                if !patch.is_flat || patch.around.is_empty() {
                    vpls.pop();
                    continue;
                }
                cells[of] = left.cells[1];
                cells.push(left.cells[0]);
                patches.push(patch);
                patches[of] = self.patch(vpls, first, of, &cells[of]);
                changed.extend([of, i]);
            }
        }
        let mut flux: Vec<Vec3> = vpls.iter().map(Vpl::flux).collect();
        for i in first..vpls.len() {
            share_out(&patches, i, &mut flux);
        }

        let mut order: Vec<usize> = (0..vpls.len()).collect();
        order.sort_by_cached_key(|&i| self.key(&vpls[i]));
        let mut place_of = vec![0; vpls.len()];
        for (place, &i) in order.iter().enumerate() {
            place_of[i] = place;
        }
        let exchange = Exchange::new(&patches, &place_of);
        let mut flux: Vec<Vec3> = order.iter().map(|&i| flux[i]).collect();
        exchange.even_out(&mut flux);
        let laid = |(&i, flux): (&usize, Vec3)| {
            let Patch { extent, area, .. } = patches[i];
            Vpl { intensity: flux / PI, extent, d_min: (area / PI).sqrt(), ..vpls[i] }
        };
        *vpls = order.iter().zip(flux).map(laid).collect();
        exchange
    }

    /// The boxes of VPLs in spatial order.
    fn cells(&self, vpls: &[Vpl]) -> Vec<Cell> {
        let mut cells = vec![Cell::ALL; vpls.len()];
        let sides: Vec<usize> = vpls.iter().map(|vpl| main_direction(vpl.direction) as usize).collect();
        let round: Vec<bool> = (0..vpls.len()).into_par_iter().map(|i| self.is_round(vpls, i)).collect();
        for side in 0..6 {
            let sign = if side % 2 == 0 { 1.0 } else { -1.0 };
            // Where a smooth surface bends over to another side, boxes end at its VPLs there.
            let beside = |i: usize| round[i] && sign * vpls[i].direction[side / 2] > BESIDE;
            let mut places: Vec<usize> = (0..vpls.len()).filter(|&i| sides[i] == side || beside(i)).collect();
            let mut weights = Vec3::ONE;
            weights[side / 2] = ACROSS;
            self.split(vpls, &mut places, Cell::ALL, weights, &mut |i, cell| {
                if sides[i] == side {
                    cells[i] = cell;
                }
            });
        }
        cells
    }

    /// Whether a VPL and those around it are on a smooth surface that is not flat.
    fn is_round(&self, vpls: &[Vpl], i: usize) -> bool {
        let near = neighbours_of(&vpls[i], vpls, i, WINDOW);
        let Some(nearest) = near.get(..=NEAR) else { return false };
        let reached = self.reached(&nearest[NEAR]);
        nearest.iter().all(|near| on_one_surface(&vpls[i], vpls, near, reached))
            && nearest.iter().any(|near| vpls[near.place].direction.dot(vpls[i].direction) < IN_PLANE)
    }

    /// Half the side of a square as large as the disc up to a neighbour, m.
    fn reached(&self, near: &Neighbour) -> f32 {
        (0.5 * PI.sqrt() * near.offset.length()).max(self.least_distance())
    }

    /// From a VPL straight up to where things are as good as on its surface, m; not past what is close in front of it and
    /// parallel. (What stands at an angle, as in a fold, limits the surface.)
    fn lift(&self, vpl: &Vpl, reached: f32) -> Vec3 {
        let lift = vpl.direction * (FLAT * reached);
        let hit = self.surfaces.closest(vpl.position, lift, 0.0, false);
        let hit = hit.filter(|(_, surface)| surface.geometric_normal.dot(vpl.direction) < -IN_PLANE);
        lift * hit.map_or(1.0, |(hit, _)| (0.5 * hit.t).min(1.0))
    }

    /// Splits a box between VPLs, given by their places, across the longest side of what they span.
    fn split(&self, vpls: &[Vpl], places: &mut [usize], cell: Cell, weights: Vec3, give: &mut impl FnMut(usize, Cell)) {
        let (min, max) = places.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(min, max), &i| {
            (min.min(vpls[i].position), max.max(vpls[i].position))
        });
        let size = (max - min) * weights;
        let axis = size.max_position();
        if places.len() < 2 || size[axis] <= self.least_distance() {
            for &i in &*places {
                give(i, cell);
            }
            return;
        }
        let at = |i: usize| vpls[i].position[axis];
        places.sort_by(|&a, &b| at(a).total_cmp(&at(b)));
        // Not through those of one plane.
        let apart = |k: &usize| at(places[*k]) - at(places[*k - 1]) > 1e-5 * (max[axis] - min[axis]);
        let half = places.len() / 2;
        let nearest = (1..places.len()).filter(apart).min_by_key(|k| k.abs_diff(half));
        let (low, high) = places.split_at_mut(nearest.unwrap_or(half));
        let between = 0.5 * (at(low[low.len() - 1]) + at(high[0]));
        let (mut below, mut above) = (cell, cell);
        (below.max[axis], above.min[axis]) = (between, between);
        self.split(vpls, low, below, weights, give);
        self.split(vpls, high, above, weights, give);
    }

    /// Those around a VPL, nearest first and itself among them; of a list of which the `first` are in spatial order, and
    /// they alone are looked at.
    fn around(&self, vpls: &[Vpl], first: usize, i: usize) -> Vec<Neighbour> {
        if i < first {
            return neighbours_of(&vpls[i], &vpls[..first], i, WINDOW);
        }
        let key = self.key(&vpls[i]);
        let place = vpls[..first].partition_point(|vpl| self.key(vpl) < key);
        let mut near = neighbours_of(&vpls[i], &vpls[..first], place, WINDOW);
        near.insert(0, Neighbour { place: i, offset: Vec3::ZERO, flux: 0.0 });
        near
    }

    /// What a patch leaves of its box on the side on which that is most, if any of those around sees it.
    fn left_by(&self, vpls: &[Vpl], first: usize, i: usize, cell: &Cell, patch: &Patch) -> Option<Left> {
        let Vpl { position, direction, .. } = vpls[i];
        let [x, y] = Vpl::frame(direction);
        let sides = [-x, x, -y, y];
        let room = sides.map(|side| cell.room(position, side).max(0.0));
        if !patch.is_flat || (0..4).all(|k| room[k] < 1.01 * patch.extent[k]) {
            return None;
        }
        let near = self.around(vpls, first, i);
        let reached = self.reached(near.get(NEAR)?);
        let room = room.map(|room| room.min(FAR * reached));
        let lift = self.lift(&vpls[i], reached);
        let in_plane = |near: &&Neighbour| near.place != i && near.offset.dot(direction).abs() < lift.length();
        let others: Vec<Vec3> = near.iter().filter(in_plane).map(|near| near.offset).collect();
        let is_hidden_here = |offset: Vec3| {
            let above = position + offset + lift;
            let sees = |other: Vec3| !self.surfaces.occluded(above, position + other + lift);
            if sees(Vec3::ZERO) || !self.surfaces.occluded(above, above - 2.0 * lift) {
                return false;
            }
            let mut nearest = others.clone();
            nearest.sort_by(|a, b| a.distance_squared(offset).total_cmp(&b.distance_squared(offset)));
            nearest.into_iter().take(4).any(sees)
        };
        let mut left: [Vec<Vec3>; 4] = Default::default();
        for step in 0..STEPS * STEPS {
            let at = |step: usize, [low, high]: [f32; 2]| (step as f32 + 0.5) / STEPS as f32 * (low + high) - low;
            let offset = x * at(step % STEPS, [room[0], room[1]]) + y * at(step / STEPS, [room[2], room[3]]);
            let is_past = |&k: &usize| offset.dot(sides[k]) > patch.extent[k];
            if (0..4).any(|k| is_past(&k)) && cell.has(position + offset) && is_hidden_here(offset) {
                (0..4).filter(is_past).for_each(|k| left[k].push(offset));
            }
        }
        let k = (0..4).max_by_key(|&k| left[k].len())?;
        let middle = left[k].iter().sum::<Vec3>() / left[k].len() as f32;
        let off = |offset: &&Vec3| offset.distance_squared(middle);
        let offset = *left[k].iter().min_by(|a, b| off(a).total_cmp(&off(b)))?;
        let (_, surface) = self.surfaces.closest(position + offset + lift, -direction, 0.0, false)?;
        let normal = surface.geometric_normal;
        if surface.culled || normal.dot(direction) < IN_PLANE {
            return None;
        }
        let begin = left[k].iter().map(|offset| offset.dot(sides[k])).fold(f32::INFINITY, f32::min);
        let between = position + sides[k] * (0.5 * (patch.extent[k] + begin));
        let axis = sides[k].abs().max_position();
        let (mut its, mut own) = (*cell, *cell);
        let (low, high) = if sides[k][axis] > 0.0 { (&mut own, &mut its) } else { (&mut its, &mut own) };
        (low.max[axis], high.min[axis]) = (between[axis], between[axis]);
        if !its.has(surface.position) {
            return None;
        }
        Some(Left {
            size: left[k].len(),
            vpl: Vpl::lambertian(surface.start(normal), normal, Vec3::ZERO, 0.0),
            cells: [its, own],
        })
    }

    fn patch(&self, vpls: &[Vpl], first: usize, i: usize, cell: &Cell) -> Patch {
        let Vpl { position, direction, .. } = vpls[i];
        let [x, y] = Vpl::frame(direction);
        let sides = [-x, x, -y, y];
        let stretch = self.settings.radius;
        let near = self.around(vpls, first, i);
        // Too few to tell: all the surface around.
        let reached = near.get(NEAR).map_or(0.1 * self.bounds.radius(), |near| self.reached(near));
        let lift = self.lift(&vpls[i], reached);
        let limit = |from: Vec3, along: Vec3| self.limit(position + from, along, lift);
        let uncut = sides.map(|along| limit(Vec3::ZERO, along * (REACH * reached)).length);
        let limits = uncut.map(|length| length.min(reached));
        let within = |near: &&Neighbour| {
            let [left, right, back, front] = limits;
            let (along, across) = (near.offset.dot(x), near.offset.dot(y));
            (-left..=right).contains(&along) && (-back..=front).contains(&across)
        };
        let here: Vec<&Neighbour> = near.iter().filter(within).collect();
        let on_it = |near: &Neighbour| on_one_surface(&vpls[i], vpls, near, reached);
        // Where the surface is not smooth at this scale, boxes are not what it falls into.
        if near.len() > NEAR && near[..=NEAR].iter().all(on_it) {
            let in_plane = |near: &Neighbour| vpls[near.place].direction.dot(direction) > IN_PLANE;
            let is_flat = near[..=NEAR].iter().all(in_plane);
            let (extent, area) = part_of(cell, position, [x, y], uncut, limit);
            let usual = area_of(limits) / here.len() as f32;
            if i >= first || SLIVER * area > usual {
                let weight = |near: &Neighbour| 1.0 - (near.offset.length() / reached).powi(2);
                let seen = |other: Vec3| !self.surfaces.occluded(position + lift, other + lift);
                let others = near[..=NEAR].iter().filter(within).filter(|near| near.place != i);
                let around = others.map(|near| (near.place, weight(near))).filter(|&(_, weight)| weight > 0.0);
                let around = around.filter(|&(other, _)| seen(vpls[other].position)).collect();
                let extent = std::array::from_fn(|k| (extent[k] * stretch).min(uncut[k].max(extent[k])));
                return Patch { extent, area: (area * stretch.powi(2)).min(area_of(extent)), around, is_flat };
            }
        }
        // As large as has its flux at the density of flux around it.
        let share =
            vpls[i].flux().element_sum() / here.iter().map(|near| near.flux).sum::<f32>().max(f32::MIN_POSITIVE);
        let extent = cut_to_area(limits, area_of(limits) * share * stretch.powi(2));
        Patch { extent, area: area_of(extent), around: Vec::new(), is_flat: false }
    }

    /// How far the surface goes on from a point, up to the length of `along`: to where it ends or something stands on it.
    /// What is nearer to it than `lift` is part of it.
    fn limit(&self, from: Vec3, along: Vec3, lift: Vec3) -> Limit {
        let start = from + lift;
        let wall = self.surfaces.closest(start, along, 0.0, false).map_or(1.0, |(hit, _)| hit.t.min(1.0));
        let goes_on = |share: f32| {
            let above = start + along * share;
            self.surfaces.occluded(above, above - 2.0 * lift)
        };
        let (mut here, mut beyond) = (0.0, wall);
        let is_end = !goes_on(0.99 * wall);
        if !is_end {
            here = wall;
        } else {
            for _ in 0..5 {
                let middle = 0.5 * (here + beyond);
                *if goes_on(middle) { &mut here } else { &mut beyond } = middle;
            }
        }
        Limit { length: along.length() * here.max(0.005), is_end }
    }
}

/// The rectangle that a box, from a point in it, has of a surface, and how much of that is surface, m².
fn part_of(
    cell: &Cell,
    position: Vec3,
    [x, y]: [Vec3; 2],
    limits: [f32; 4],
    limit: impl Fn(Vec3, Vec3) -> Limit,
) -> ([f32; 4], f32) {
    let sides = [-x, x, -y, y];
    let farthest = limits.into_iter().fold(0.0, f32::max);
    let room = sides.map(|along| cell.room(position, along).min(farthest).max(1e-4 * farthest));
    let middle: [f32; 4] = std::array::from_fn(|k| limits[k].min(room[k]));
    if middle == room {
        return (room, area_of(room));
    }
    // What stands on it may do so at an angle. Five lines each way tell how much of the box there is, and how far it
    // goes: what stands there sees nothing of what is behind itself. But past an end others would.
    let [left, right, back, front] = middle;
    let lines = |along: Vec3, [before, after]: [f32; 2], k: usize| {
        let at = [-0.98 * before, -2.0 / 3.0 * before, 0.0, 2.0 / 3.0 * after, 0.98 * after];
        at.map(|at| [k, k + 1].map(|k| limit(along * at, sides[k] * room[k])))
    };
    let (rows, columns) = (lines(y, [back, front], 0), lines(x, [left, right], 2));
    let far = |lines: &[[Limit; 2]; 5], k: usize| match lines.iter().any(|line| line[k].is_end) {
        true => lines[2][k].length,
        false => lines.iter().map(|line| line[k].length).fold(0.0, f32::max),
    };
    let extent = [far(&rows, 0), far(&rows, 1), far(&columns, 0), far(&columns, 1)];
    // Those in the middle of either side stand for two thirds of it; those at the rim tell how far it goes alone.
    let area = |lines: [[Limit; 2]; 5], [before, after]: [f32; 2]| {
        let [_, first, second, third, _] = lines.map(|[a, b]| a.length + b.length);
        (2.0 * before * first + (before + after) * second + 2.0 * after * third) / 3.0
    };
    let area = area(rows, [back, front]).max(area(columns, [left, right]));
    // No brighter than twice, for the sake of those who see all of the rectangle.
    (extent, area.min(area_of(extent)).max(0.5 * area_of(extent)))
}

/// Gives a VPL, which has none, its share of the flux of those around it.
fn share_out(patches: &[Patch], i: usize, flux: &mut [Vec3]) {
    let patch = &patches[i];
    let area = patch.area + patch.around.iter().map(|&(k, weight)| patches[k].area * weight).sum::<f32>();
    let share = patch.area / area;
    let mut sum = Vec3::ZERO;
    for &(k, weight) in &patch.around {
        let part = flux[k] * (weight * share);
        flux[k] -= part;
        sum += part;
    }
    flux[i] += sum;
}

/// Whether a VPL and one of those around it are on one surface, flat or smooth: on a circle or a sphere the one is in the
/// plane through the other that is across the mean of both directions.
fn on_one_surface(vpl: &Vpl, vpls: &[Vpl], near: &Neighbour, reached: f32) -> bool {
    let across = (vpl.direction + vpls[near.place].direction).normalize_or(vpl.direction);
    near.offset.dot(across).abs() < 0.5 * FLAT * reached
}

fn area_of([left, right, back, front]: [f32; 4]) -> f32 {
    (left + right) * (back + front)
}

/// The largest part around the point of a rectangle that goes so far that has at most that area, its sides as far from
/// the point as those of a square or as they were; all of it, stretched, where it has less.
fn cut_to_area(limits: [f32; 4], area: f32) -> [f32; 4] {
    let whole = area_of(limits);
    if area >= whole {
        return limits.map(|side| side * (area / whole).sqrt());
    }
    let (mut low, mut high) = (0.0, limits.into_iter().fold(0.0, f32::max));
    for _ in 0..24 {
        let middle = 0.5 * (low + high);
        *if area_of(limits.map(|side| side.min(middle))) < area { &mut low } else { &mut high } = middle;
    }
    limits.map(|side| side.min(high))
}

#[cfg(test)]
mod tests {
    use glam::Mat4;

    use super::*;
    use crate::lattice::Lattice;
    use crate::reference::{Emitters, Surfaces, gather};
    use crate::sampling;
    use crate::scene::{Instance, Material, Mesh};
    use crate::settings::Settings;
    use crate::{Light, Profile, Scene};

    fn with_tracer<T>(scene: &Scene, then: impl FnOnce(&Tracer) -> T) -> T {
        let (surfaces, emitters, settings) = (Surfaces::new(scene), Emitters::new(scene), Settings::default());
        let lattice = Lattice::new(&settings.wave).unwrap();
        then(&Tracer::new(&surfaces, &emitters, scene.bounds().unwrap(), &lattice, &settings.reflected, 1))
    }

    /// A closed room of albedo ½ with a column, lit by a lamp in all directions.
    fn room() -> Scene {
        let mut scene = Scene::builtin("column").unwrap();
        for material in &mut scene.materials {
            *material = Material { double_sided: true, ..Material::lambert("half", Vec3::splat(0.5)) };
        }
        let position = Vec3::new(1.3, 1.7, 1.1);
        let axis = Vec3::new(0.48, -0.6, 0.64);
        let intensity = Vec3::new(3.0, 2.0, 1.0);
        scene.lights = vec![Light { name: String::new(), position, axis, intensity, profile: Profile::Point }];
        scene
    }

    fn vpls(tracer: &Tracer, lights: &[Light]) -> Vec<Vpl> {
        let lattice = Lattice::new(&Settings::default().wave).unwrap();
        tracer.run(&lattice, lights, 1.0).vpls
    }

    fn square(to: impl Fn(f32, f32) -> Vec3) -> Mesh {
        Mesh {
            positions: [[-2.0, -2.0], [2.0, -2.0], [2.0, 2.0], [-2.0, 2.0]].map(|[a, b]| to(a, b)).to_vec(),
            normals: vec![to(1.0, 0.0).any_orthonormal_vector(); 4],
            indices: vec![0, 2, 1, 0, 3, 2],
            ..Mesh::default()
        }
    }

    fn scene_of(meshes: [Mesh; 2]) -> Scene {
        Scene {
            meshes: meshes.map(Into::into).to_vec(),
            materials: vec![Material::lambert("", Vec3::ONE)],
            instances: [0, 1].map(|mesh| Instance { mesh, world_from_object: Mat4::IDENTITY }).to_vec(),
            ..Scene::default()
        }
    }

    fn floor(x: f32, z: f32) -> Vec3 {
        Vec3::new(x, 0.0, z)
    }

    /// At a wall that the floor goes on behind, and at the rim of the floor.
    #[test]
    fn patches_end_where_the_surface_does() {
        let scene = scene_of([square(floor), square(|y, z| Vec3::new(0.0, y, z))]);
        let (all, none) = (0.4, 0.0);
        with_tracer(&scene, |tracer| {
            for (x, z, expected) in [
                (-1.0, 1.0, [all; 4]),
                (-0.1, 1.0, [all, 0.1, all, all]),
                (-1.0, 1.8, [all, all, all, 0.2]),
                (-0.1, 1.999, [all, 0.1, all, none]),
            ] {
                let sides = [Vec3::NEG_X, Vec3::X, Vec3::NEG_Z, Vec3::Z];
                for (side, expected) in sides.into_iter().zip(expected) {
                    let got = tracer.limit(Vec3::new(x, 1e-4, z), side * 0.4, Vec3::Y * 0.04).length;
                    assert!((got - expected).abs() < 0.02, "{x} {z} {side}: {got}, expected {expected}");
                }
            }
        });
    }

    /// As close as a lamp's panel is to the ceiling.
    #[test]
    fn patches_end_where_the_surface_does_under_what_is_close() {
        let scene = scene_of([square(floor), square(|x, z| Vec3::new(4.0 * x, 0.02, 4.0 * z))]);
        with_tracer(&scene, |tracer| {
            let vpl = Vpl::lambertian(Vec3::new(1.8, 1e-4, 0.0), Vec3::Y, Vec3::ONE, 0.0);
            let got = tracer.limit(vpl.position, 0.4 * Vec3::X, tracer.lift(&vpl, 0.4)).length;
            assert!((got - 0.2).abs() < 0.02, "{got}");
        });
    }

    /// A box of 0.4 m around a VPL, cut by a wall that stands at an angle: a triangle is gone, but the rectangle has it.
    #[test]
    fn a_wall_at_an_angle_takes_a_part_of_the_area() {
        let wall = |y: f32, along: f32| Vec3::new(0.1 + along, y, 0.1 - along);
        let scene = scene_of([square(floor), square(wall)]);
        let cell = Cell { min: Vec3::new(-0.2, -1.0, -0.2), max: Vec3::new(0.2, 1.0, 0.2) };
        let vpl = Vpl::lambertian(Vec3::new(0.0, 1e-4, 0.0), Vec3::Y, Vec3::ONE, 0.0);
        let [x, y] = Vpl::frame(Vec3::Y);
        let (extent, area) = with_tracer(&scene, |tracer| {
            let limit = |from: Vec3, along: Vec3| tracer.limit(vpl.position + from, along, Vec3::Y * 0.02);
            let limits = [-x, x, -y, y].map(|along| limit(Vec3::ZERO, along * 0.2).length);
            part_of(&cell, vpl.position, [x, y], limits, limit)
        });
        // Beyond x + z = 0.2 within 0.2: half a square of 0.2.
        assert!((area - (0.16 - 0.02)).abs() < 0.01, "{area}");
        for (got, expected) in extent.into_iter().zip([0.2, 0.2, 0.2, 0.2]) {
            assert!((got - expected).abs() < 0.01, "{extent:?}");
        }
    }

    /// Of the walls of a room, seams and all, next to nothing is in two patches or in none; nor if there are few.
    #[test]
    fn patches_meet_and_do_not_overlap() {
        let mut scene = room();
        scene.instances.truncate(6);
        let bounds = scene.bounds().unwrap();
        let size = bounds.max - bounds.min;
        with_tracer(&scene, |tracer| {
            let all = vpls(tracer, &scene.lights);
            for (count, seed) in [(6485, 1), (600, 1), (600, 2), (600, 3)] {
                let mut vpls = sampling::by_power(&all, count, seed, 0);
                tracer.lay_patches(&mut vpls, usize::MAX);
                let mut times = [0; 3];
                for i in 0..6000 {
                    let [a, b, ..] = sobol_burley::sample_4d(i, 0, 1);
                    // Every other one is 1 mm from a seam.
                    let a = if i % 2 == 0 { a } else { 0.0005 };
                    let axis = i as usize % 3;
                    let mut at = Vec3::ZERO;
                    (at[(axis + 1) % 3], at[(axis + 2) % 3]) = (a, b);
                    let point = bounds.min + size * at;
                    let covers = |vpl: &&Vpl| {
                        let [x, y] = Vpl::frame(vpl.direction);
                        let [left, right, back, front] = vpl.extent;
                        let d = point - vpl.position;
                        let (along, across) = (d.dot(x), d.dot(y));
                        vpl.direction[axis] > 0.9
                            && (-left..=right).contains(&along)
                            && (-back..=front).contains(&across)
                    };
                    times[vpls.iter().filter(covers).count().min(2)] += 1;
                }
                println!("{} VPLs: {times:?}", vpls.len());
                assert!(times[0] < 10 && times[2] < 10, "{times:?}");
                for vpl in &vpls {
                    let [x, y] = Vpl::frame(vpl.direction);
                    let [left, right, back, front] = vpl.extent;
                    for corner in [x * right + y * front, x * -left - y * back] {
                        let outside = (vpl.position + corner - bounds.center()).abs() - 0.5 * size;
                        assert!(outside.max_element() < 0.02, "{vpl:?}");
                    }
                }
            }
        });
    }

    /// In a closed room in which every surface has the radiance L, π L arrives everywhere: next to seams too, at the foot
    /// of a column, and around that.
    #[test]
    fn corners_neither_spike_nor_darken() {
        let scene = room();
        let surfaces = Surfaces::new(&scene);
        let (min, max) = (scene.bounds().unwrap().min, scene.bounds().unwrap().max);
        with_tracer(&scene, |tracer| {
            let mut vpls = vpls(tracer, &scene.lights);
            tracer.lay_patches(&mut vpls, usize::MAX);
            for vpl in &mut vpls {
                vpl.intensity = Vec3::splat(vpl.d_min.powi(2));
            }
            let mut errors = [Vec::new(), Vec::new(), Vec::new()];
            for i in 0..480 {
                let [a, b, ..] = sobol_burley::sample_4d(i, 1, 1);
                let near = 0.002 + 0.03 * a;
                let (sine, cosine) = (std::f32::consts::TAU * b).sin_cos();
                let out = Vec3::new(cosine, 0.0, sine);
                let place = (i as usize % 4).saturating_sub(1);
                let (point, normal) = match place {
                    0 => {
                        let axis = i as usize % 3;
                        let mut at = Vec3::new(near, min.y.max(0.0) + near, near);
                        at[axis] = 1e-3;
                        let far = if axis == 1 { 2 } else { 1 };
                        at[far] = (0.02 + 0.96 * b) * (max[far] - min[far]);
                        let mut normal = Vec3::ZERO;
                        normal[axis] = 1.0;
                        (min * Vec3::new(1.0, 0.0, 1.0) + at, normal)
                    }
                    1 => (Vec3::new(-0.3, near, -0.6) + out * 0.3505, out),
                    _ => (Vec3::new(-0.3, 1e-4, -0.6) + out * (0.3505 + near), Vec3::Y),
                };
                let sees = |k: usize| !surfaces.occluded(point + normal * 1e-3, vpls[k].position);
                errors[place].push(gather::irradiance(&vpls, point, normal, sees).x - 1.0);
            }
            let [at_seams, at_foot, around_foot] = errors.map(|mut errors| {
                errors.sort_by(f64::total_cmp);
                let rms = (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt();
                println!("{} points: {rms}, from {} to {}", errors.len(), errors[0], errors[errors.len() - 1]);
                (rms, errors[0], errors[errors.len() - 1])
            });
            // By the density of flux alone: .22, from −.51 to .46.
            assert!(at_seams.0 < 0.01 && at_seams.1 > -0.04 && at_seams.2 < 0.04, "{at_seams:?}");
            // Without what boxes leave .12, without what is above the horizon of VPLs below it .12, without both .17.
            assert!(at_foot.0 < 0.03 && at_foot.1 > -0.15 && at_foot.2 < 0.05, "{at_foot:?}");
            // By the density of flux alone .27. Flat rectangles stand out from what is round.
            assert!(around_foot.0 < 0.2 && around_foot.1 > -0.5 && around_foot.2 < 0.6, "{around_foot:?}");
        });
    }

    /// Behind the column, in boxes of VPLs before it, there are new ones; they have their flux from those around.
    #[test]
    fn what_boxes_leave_has_vpls_of_its_own() {
        let scene = room();
        with_tracer(&scene, |tracer| {
            let before = vpls(tracer, &scene.lights);
            let mut after = before.clone();
            tracer.lay_patches(&mut after, usize::MAX);
            let new: Vec<&Vpl> =
                after.iter().filter(|vpl| before.iter().all(|other| other.position != vpl.position)).collect();
            println!("{} VPLs, {} new", before.len(), new.len());
            assert!(!new.is_empty() && new.len() == after.len() - before.len());
            // Where there may be no more there are none.
            let mut full = before.clone();
            tracer.lay_patches(&mut full, before.len());
            assert_eq!(full.len(), before.len());
            let flux = |vpls: &[Vpl]| vpls.iter().map(|vpl| f64::from(vpl.flux().x)).sum::<f64>();
            assert!((flux(&after) / flux(&before) - 1.0).abs() < 1e-5);
            // They are about as bright as what is around them.
            let radiance = |vpl: &Vpl| vpl.intensity.x / (PI * vpl.d_min.powi(2));
            for vpl in &new {
                let around = |other: &&Vpl| {
                    other.direction.dot(vpl.direction) > 0.99 && other.position.distance(vpl.position) < 0.4
                };
                let others: Vec<f32> = after.iter().filter(around).map(radiance).collect();
                let mean = others.iter().sum::<f32>() / others.len() as f32;
                assert!((0.3..3.0).contains(&(radiance(vpl) / mean)), "{} of {mean}", radiance(vpl));
            }
        });
    }

    /// Even radiance stays, none is lost, and what is not even is more so.
    #[test]
    fn exchange_keeps_the_flux() {
        let scene = room();
        with_tracer(&scene, |tracer| {
            let mut vpls = vpls(tracer, &scene.lights);
            let exchange = tracer.lay_patches(&mut vpls, usize::MAX);
            let area: Vec<Vec3> = vpls.iter().map(|vpl| Vec3::splat(vpl.d_min.powi(2))).collect();
            let mut flux = area.clone();
            exchange.even_out(&mut flux);
            for (got, expected) in flux.iter().zip(&area) {
                assert!((*got / *expected - 1.0).abs().max_element() < 1e-4, "{got} {expected}");
            }
            // Some have twice as much.
            let noise = |i: usize| 1.0 + (sampling::hash(i as u32) & 1) as f32;
            let mut flux: Vec<Vec3> = area.iter().enumerate().map(|(i, &area)| area * noise(i)).collect();
            let all = |flux: &[Vec3]| flux.iter().map(|flux| f64::from(flux.x)).sum::<f64>();
            let variance = |flux: &[Vec3]| {
                let off = |(flux, area): (&Vec3, &Vec3)| f64::from((flux.x / area.x - 1.5).powi(2) * area.x);
                flux.iter().zip(&area).map(off).sum::<f64>()
            };
            let before = (all(&flux), variance(&flux));
            exchange.even_out(&mut flux);
            assert!((all(&flux) / before.0 - 1.0).abs() < 1e-5);
            let left = variance(&flux) / before.1;
            println!("{left}");
            assert!(left < 0.4, "{left}");
            // Of two, one of which went elsewhere.
            let (mut apart, before) = (exchange.clone(), flux.clone());
            apart.retain(|a, b| a != 7 && b != 7);
            apart.even_out(&mut flux);
            assert!(flux[7] == before[7] && flux != before);
        });
    }

    /// Of a wall that stands at an angle the rectangles of patches go on behind it, but what is lit gives nothing to what
    /// is there.
    #[test]
    fn flux_does_not_go_through_a_wall() {
        let is_lit = |vpl: &&Vpl| vpl.position.x + vpl.position.z < 0.06;
        let scene = scene_of([square(floor), square(|y, along| Vec3::new(0.03 + along, y, 0.03 - along))]);
        let vpl = |i: u32| {
            let [x, z, ..] = sobol_burley::sample_4d(i, 0, 1);
            let vpl = Vpl::lambertian(Vec3::new(3.8 * x - 1.9, 1e-4, 3.8 * z - 1.9), Vec3::Y, Vec3::ZERO, 0.0);
            if is_lit(&&vpl) { Vpl { intensity: Vec3::ONE, ..vpl } } else { vpl }
        };
        let mut vpls: Vec<Vpl> = (0..1000).map(vpl).collect();
        let lit = |vpls: &[Vpl]| vpls.iter().filter(is_lit).map(|vpl| f64::from(vpl.intensity.x)).sum::<f64>();
        let before = lit(&vpls);
        with_tracer(&scene, |tracer| tracer.lay_patches(&mut vpls, usize::MAX));
        assert!((lit(&vpls) / before - 1.0).abs() < 1e-4, "{} of {before}", lit(&vpls));
    }

    /// A VPL of a grid of 0.2 m, 5 cm from where the surface is bent: its patch is as large whatever its box is. On a flat
    /// surface it is the box, but not if that is a sliver: then it has a ninth of what is within reach.
    #[test]
    fn neither_next_to_a_crease_nor_in_a_sliver_is_a_patch_its_box() {
        let area_of_patch = |slope: f32, width: f32| {
            let side = |sign: f32| move |x: f32, z: f32| Vec3::new(sign * (x + 2.0), -slope * (x + 2.0), z);
            let up = |x: f32| Vec3::new(slope * x.signum(), 1.0, 0.0).normalize();
            let vpl = |i: u32| {
                let [x, z] = [i % 7, i / 7].map(|k| 0.2 * (k as f32 - 3.0));
                let x = x + 0.05;
                let position = Vec3::new(x, -slope * x.abs(), z) + up(x) * 1e-4;
                Vpl::lambertian(position, up(x), Vec3::ONE, 0.0)
            };
            let mut vpls: Vec<Vpl> = (0..49).map(vpl).collect();
            with_tracer(&scene_of([square(side(1.0)), square(side(-1.0))]), |tracer| {
                tracer.sort(&mut vpls);
                let i = vpls.iter().position(|vpl| vpl.position.distance(Vec3::X * 0.05) < 0.05).unwrap();
                let half = Vec3::new(0.5 * width, 1.0, 0.1);
                let cell = Cell { min: vpls[i].position - half, max: vpls[i].position + half };
                tracer.patch(&vpls, vpls.len(), i, &cell).area
            })
        };
        let reached = 0.5 * PI.sqrt() * 0.2 * 2f32.sqrt();
        for (width, expected) in [(0.2, 0.04), (0.02, 0.004), (0.004, 4.0 * reached.powi(2) / 9.0)] {
            let area = area_of_patch(0.0, width);
            assert!((area / expected - 1.0).abs() < 0.01, "{width}: {area}, expected {expected}");
        }
        assert_eq!(area_of_patch(0.36, 0.2), area_of_patch(0.36, 0.1));
    }

    #[test]
    fn a_rectangle_is_cut_to_an_area() {
        assert_eq!(cut_to_area([1.0, 2.0, 1.0, 1.0], 24.0), [2.0, 4.0, 2.0, 2.0]);
        for (area, expected) in [(1.0, [0.5; 4]), (5.0, [1.0, 1.5, 1.0, 1.0])] {
            let got = cut_to_area([1.0, 2.0, 1.0, 1.0], area);
            assert!(got.iter().zip(expected).all(|(g, e)| (g - e).abs() < 1e-5), "{got:?}");
        }
    }
}
