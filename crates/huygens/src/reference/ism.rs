//! Imperfect shadow maps of one VPL at a time: the twin of the pass `ism` and of `common/visibility_ism.glsl`. It
//! keeps distances in full floats, where the GPU rounds them to 16 bits.

use std::f32::consts::{PI, SQRT_2};

use glam::{IVec2, Mat3, Vec2, Vec3};

use crate::lattice::{Emission, Vpl};
use crate::sampling::hash;
use crate::settings::Ism as Settings;
use crate::surfel::SurfelTexels;

/// Of a disc's radius over its distance, times the texels on a tile's edge: what is beyond counts as near.
const NEAR: f32 = 8.0;

/// Of the radius of a smaller disc: what is flat and no farther than this has whole ones.
const CLOSE: f32 = 0.25;

/// The octahedral map of the distances that a VPL sees.
pub struct Tile {
    size: i32,
    position: Vec3,
    /// From the space of a hemisphere, which is around z, to world space; `None` for a sphere.
    hemisphere: Option<Mat3>,
    /// Row by row over the farthest distance; 1 where there is nothing.
    depths: Vec<f32>,
    far: f32,
}

/// What all tiles of a frame share.
#[derive(Clone, Copy)]
pub struct Splats<'a> {
    /// Size, points, spread and levels.
    pub settings: &'a Settings,
    /// The surfels of the scene in world space (a power of two of them).
    pub surfels: &'a [SurfelTexels],
    /// Area that they stand for, m².
    pub area: f32,
    /// Farthest distance between a VPL and a surface, m.
    pub far: f32,
    /// Of the frame.
    pub seed: u32,
}

impl Tile {
    /// The tile of VPL `index`.
    pub fn new(splats: &Splats, index: u32, vpl: &Vpl) -> Self {
        let size = splats.settings.size as i32;
        let hemisphere = (vpl.emission == Emission::Lambertian).then(|| {
            let z = vpl.direction;
            let [x, _] = Vpl::frame(z);
            Mat3::from_cols(x, z.cross(x), z)
        });
        let position = vpl.position;
        let mut tile = Self { size, position, hemisphere, depths: vec![1.0; (size * size) as usize], far: splats.far };
        let points = splats.settings.points.min(splats.surfels.len() as u32);
        if let Some(stride) = (splats.surfels.len() as u32).checked_div(points) {
            let radius = splats.settings.spread * (splats.area / points as f32 / PI).sqrt();
            let parts = splats.settings.near.min(stride);
            for point in 0..points {
                let pick = hash(point ^ hash(index ^ hash(splats.seed))) % stride;
                let surfel = |at: u32| &splats.surfels[(point * stride + at) as usize];
                if radius * size as f32 > NEAR * surfel(pick)[0].truncate().distance(position) {
                    let part_of = stride / parts;
                    for part in 0..parts {
                        let surfel = surfel(part * part_of + pick % part_of);
                        let part_radius = radius / (parts as f32).sqrt();
                        let height = surfel[1].truncate().dot(surfel[0].truncate() - position).abs();
                        let whole = surfel[0].w == 0.0 && height < CLOSE * part_radius;
                        tile.splat(surfel, if whole { radius } else { part_radius });
                    }
                } else {
                    tile.splat(surfel(pick), radius);
                }
            }
        }
        tile.depths = filled(&tile.depths, size, splats.settings.pull_levels.min(size.ilog2()));
        tile
    }

    /// Cuts a surfel's disc out of the texels' rays.
    fn splat(&mut self, surfel: &SurfelTexels, radius: f32) {
        let size = self.size as f32;
        let [offset, normal] = [surfel[0].truncate() - self.position, surfel[1].truncate()];
        let behind = self.hemisphere.is_some_and(|world| world.z_axis.dot(offset) <= 0.0);
        let unseen = |world: Mat3| {
            let height = world.z_axis.dot(offset);
            (height <= 0.0 && normal.dot(offset) > 0.0) || height < -radius
        };
        if offset == Vec3::ZERO || self.hemisphere.is_some_and(unseen) {
            return;
        }
        let at = self.encode(offset) * size;
        let stretch = if self.hemisphere.is_some() { 5f32.sqrt() } else { SQRT_2 };
        let angle = (radius / offset.length().max(1e-30)).min(1.0).asin();
        let texels = (stretch * angle * size).clamp(1.0, 2.0 * size);
        let (first, last) = (at - 0.5 * texels - 0.5, at + 0.5 * texels - 0.5);
        let centre = at.as_ivec2();
        let distance = offset.length();
        for y in (first.y.ceil() as i32).max(0)..=(last.y.floor() as i32).min(self.size - 1) {
            for x in (first.x.ceil() as i32).max(0)..=(last.x.floor() as i32).min(self.size - 1) {
                let direction = self.decode((Vec2::new(x as f32, y as f32) + 0.5) / size);
                let t = distance_along(surfel, offset, direction);
                let miss = (direction * t - offset).reject_from_normalized(normal);
                let inside = t > 0.0
                    && miss.length_squared() <= radius * radius
                    && surfel[2..].iter().all(|edge| miss.dot(edge.truncate()) <= edge.w);
                if !inside && (behind || IVec2::new(x, y) != centre) {
                    continue;
                }
                let t = match (inside, t > 0.0) {
                    (true, _) => t,
                    (false, true) => t.clamp(0.5 * distance, 2.0 * distance),
                    (false, false) => distance,
                };
                let depth = &mut self.depths[(y * self.size + x) as usize];
                *depth = depth.min((t / self.far).clamp(0.0, 0.9999));
            }
        }
    }

    /// Whether the VPL sees a point with that unit geometric normal.
    pub fn sees(&self, point: Vec3, normal: Vec3) -> bool {
        let half_diagonal = 3.0 * if self.hemisphere.is_some() { 1.0 } else { SQRT_2 } / self.size as f32;
        let mut d = point - self.position;
        let along = normal.dot(d);
        d += normal * ((d.length_squared() - along * along).max(0.0).sqrt() * half_diagonal);
        let texel = (self.encode(d) * self.size as f32).as_ivec2();
        let texel = texel.clamp(IVec2::ZERO, IVec2::splat(self.size - 1));
        let nearest = self.depths[(texel.y * self.size + texel.x) as usize] * self.far;
        let slack = 0.056_f32.clamp(0.6 * half_diagonal, 1.2 * half_diagonal);
        d.length() * (1.0 - slack) <= nearest
    }

    /// To 0…1: `tile_encode` of `common/ism_tile.glsl`.
    fn encode(&self, d: Vec3) -> Vec2 {
        let p = match self.hemisphere {
            Some(world) => {
                let d = world.transpose() * d;
                let p = d.truncate() / (d.x.abs() + d.y.abs() + d.z.max(0.0));
                Vec2::new(p.x + p.y, p.x - p.y)
            }
            None => oct_encode(d),
        };
        p * 0.5 + 0.5
    }

    /// A direction in world space.
    fn decode(&self, at: Vec2) -> Vec3 {
        let p = at * 2.0 - 1.0;
        let Some(world) = self.hemisphere else { return oct_decode(p) };
        let q = 0.5 * Vec2::new(p.x + p.y, p.x - p.y);
        world * q.extend(1.0 - q.x.abs() - q.y.abs()).normalize()
    }
}

/// Distance along a unit ray to a surfel that stands at `offset` from where the ray starts: to its plane, or to the
/// paraboloid that bends away from it. Less than 0 where the ray passes over that.
fn distance_along(surfel: &SurfelTexels, offset: Vec3, direction: Vec3) -> f32 {
    let (normal, [along_x, along_y]) = (surfel[1].truncate(), [surfel[0].w, surfel[1].w]);
    let slope = normal.dot(direction);
    let t = normal.dot(offset) / if slope.abs() > 1e-5 { slope } else { 1e-5 };
    if slope > 0.0 || t <= 0.0 || along_x == 0.0 {
        return t;
    }
    let (x, y) = normal.any_orthonormal_pair();
    let bend = x * along_x + y * along_y;
    // How far it is below the plane: half the product of such a vector with itself.
    let form = |a: Vec3, b: Vec3| if along_x < 0.0 { along_x.powi(2) * a.dot(b) } else { a.dot(bend) * b.dot(bend) };
    let (p, along) = (direction * t - offset, direction.reject_from_normalized(normal));
    let (a, b, c) = (form(along, along), slope + form(p, along), form(p, p));
    let root = b * b - a * c;
    if b < 0.0 && root >= 0.0 { t + c / (root.sqrt() - b) } else { -1.0 }
}

/// Pull-push: what holds nothing takes the mean of the coarsest needed of `levels` halvings.
fn filled(fine: &[f32], size: i32, levels: u32) -> Vec<f32> {
    if levels == 0 {
        return fine.to_vec();
    }
    let half = size / 2;
    let coarse: Vec<f32> = (0..half * half)
        .map(|i| {
            let (x, y) = (i % half * 2, i / half * 2);
            let four = [0, 1, size, size + 1].map(|k| fine[(y * size + x + k) as usize]);
            let held: Vec<f32> = four.into_iter().filter(|&depth| depth < 1.0).collect();
            if held.is_empty() { 1.0 } else { held.iter().sum::<f32>() / held.len() as f32 }
        })
        .collect();
    let coarse = filled(&coarse, half, levels - 1);
    let at = |i: i32| coarse[(i / size / 2 * half + i % size / 2) as usize];
    (0..size * size).map(|i| if fine[i as usize] < 1.0 { fine[i as usize] } else { at(i) }).collect()
}

/// Octahedral map of the sphere to the square −1…1, as `common/math.glsl` has it.
fn oct_encode(d: Vec3) -> Vec2 {
    let p = d.truncate() / (d.x.abs() + d.y.abs() + d.z.abs());
    let sign = |x: f32| if x >= 0.0 { 1.0 } else { -1.0 };
    let fold = Vec2::new((1.0 - p.y.abs()) * sign(p.x), (1.0 - p.x.abs()) * sign(p.y));
    if d.z >= 0.0 { p } else { fold }
}

fn oct_decode(p: Vec2) -> Vec3 {
    let mut d = p.extend(1.0 - p.x.abs() - p.y.abs());
    let t = (-d.z).max(0.0);
    d.x -= if d.x >= 0.0 { t } else { -t };
    d.y -= if d.y >= 0.0 { t } else { -t };
    d.normalize()
}

#[cfg(test)]
mod tests {
    use glam::{Mat4, Quat};

    use super::*;
    use crate::Scene;
    use crate::reference::Surfaces;
    use crate::sampling::cosine_direction;
    use crate::scene::{Instance, Material, Mesh};
    use crate::surfel::Surfels;

    /// VPLs on the floor beside a column see what of it faces them, and little of what is behind it.
    #[test]
    fn what_is_round_does_not_shadow_itself() {
        let scene = Scene::builtin("column").unwrap();
        let surfaces = Surfaces::new(&scene);
        let settings = Settings::default();
        let surfels = Surfels::new(&scene, settings.surfels);
        let in_world = surfels.in_world(&scene);
        let splats = Splats { settings: &settings, surfels: &in_world, area: surfels.area, far: 12.0, seed: 1 };
        let (foot, radius) = (Vec3::new(-0.3, 0.0, -0.6), 0.35);
        let (mut hidden, mut faced, mut seen_behind, mut behind) = (0, 0, 0, 0);
        for i in 0..40 {
            let [a, b, ..] = sobol_burley::sample_4d(i, 0, 1);
            let (sine, cosine) = (2.0 * PI * a).sin_cos();
            let out = Vec3::new(cosine, 0.0, sine);
            let from = foot + out * (radius + 0.03 + 0.2 * b) + Vec3::Y * 1e-4;
            let tile = Tile::new(&splats, i, &Vpl::lambertian(from, Vec3::Y, Vec3::ONE, 0.0));
            for k in 0..200 {
                let [a, b, ..] = sobol_burley::sample_4d(k, 1, 1);
                let (sine, cosine) = (2.0 * PI * a).sin_cos();
                let normal = Vec3::new(cosine, 0.0, sine);
                let on_it = foot + normal * radius + Vec3::Y * (0.01 + 0.5 * b);
                if normal.dot((from - on_it).normalize()) > 0.02 {
                    faced += 1;
                    hidden += usize::from(!tile.sees(on_it, normal));
                }
                // On the wall behind.
                let (_, wall) = surfaces.closest(foot + Vec3::Y, -out, 0.4, false).unwrap();
                let at = wall.position + Vec3::Y * (b - 0.5);
                behind += 1;
                seen_behind += usize::from(tile.sees(at, wall.geometric_normal));
            }
        }
        println!("{hidden} of {faced} hidden, {seen_behind} of {behind} seen");
        // With flat discs 8 %, and as much of what is behind: there are holes between them.
        assert!(faced > 1000 && hidden * 50 < faced, "{hidden} of {faced}");
        assert!(seen_behind * 7 < behind, "{seen_behind} of {behind}");
    }

    /// A panel close to the floor, under which smaller discs leave holes that are most of what there is to see.
    #[test]
    fn what_is_close_and_flat_has_no_holes() {
        let square = |half: f32, y: f32| Mesh {
            positions: [[-half, -half], [half, -half], [half, half], [-half, half]]
                .map(|[x, z]| Vec3::new(x, y, z))
                .to_vec(),
            normals: vec![Vec3::Y; 4],
            indices: vec![0, 2, 1, 0, 3, 2],
            ..Mesh::default()
        };
        let scene = Scene {
            meshes: [square(20.0, 0.0), square(5.0, 0.05)].map(Into::into).to_vec(),
            materials: vec![Material::lambert("", Vec3::ONE)],
            instances: [0, 1].map(|mesh| Instance { mesh, world_from_object: Mat4::IDENTITY }).to_vec(),
            ..Scene::default()
        };
        let settings = Settings::default();
        let surfels = Surfels::new(&scene, settings.surfels);
        let in_world = surfels.in_world(&scene);
        let splats = Splats { settings: &settings, surfels: &in_world, area: surfels.area, far: 60.0, seed: 1 };
        let (mut seen, mut total) = (0, 0);
        for i in 0..40 {
            let [x, z, ..] = sobol_burley::sample_4d(i, 0, 1).map(|x| 6.0 * (x - 0.5));
            let from = Vec3::new(x, 1e-4, z);
            let tile = Tile::new(&splats, i, &Vpl::lambertian(from, Vec3::Y, Vec3::ONE, 0.0));
            for k in 0..100 {
                let [a, b, ..] = sobol_burley::sample_4d(k, 1, 1);
                let d = Quat::from_rotation_arc(Vec3::Z, Vec3::Y) * cosine_direction([a, b]);
                total += 1;
                seen += usize::from(tile.sees(from + d * 20.0, -d));
            }
        }
        // With smaller discs 28 %.
        assert!(seen * 100 < total, "{seen} of {total} seen through the panel");
    }
}
