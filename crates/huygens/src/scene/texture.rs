//! Textures and vertex attributes read on the CPU: the finest level, filtered as the sampler magnifies.

use std::sync::LazyLock;

use glam::{Vec2, Vec3, Vec4};

use super::{Material, Mesh, Scene, TextureRef, Wrap};
use crate::sampling::on_triangle;

/// Linear value of every sRGB byte (IEC 61966-2-1).
static LINEAR_FROM_SRGB: LazyLock<[f32; 256]> = LazyLock::new(|| {
    std::array::from_fn(|byte| {
        let s = byte as f64 / 255.0;
        (if s <= 0.04045 { s / 12.92 } else { ((s + 0.055) / 1.055).powf(2.4) }) as f32
    })
});

/// What the bytes of a texture's colour channels stand for; alpha is always linear.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Transfer {
    Linear,
    Srgb,
}

impl Scene {
    /// A texture's value at texture coordinates of the mesh, 0…1 in each channel.
    pub(crate) fn sample(&self, reference: &TextureRef, uv: Vec2, transfer: Transfer) -> Vec4 {
        let texture = self.textures[reference.texture];
        let (image, sampler) = (&self.images[texture.image], texture.sampler);
        let size = [image.width as i64, image.height as i64];
        let wrap = [sampler.wrap_u, sampler.wrap_v];
        let texel = |x: i64, y: i64| {
            let [x, y] = [(x, 0), (y, 1)].map(|(i, axis)| wrapped(i, size[axis], wrap[axis]) as usize);
            let [r, g, b, a] = image.rgba.as_chunks::<4>().0[y * image.width as usize + x];
            let linear = |byte: u8| f32::from(byte) / 255.0;
            match transfer {
                Transfer::Linear => Vec4::from([r, g, b, a].map(linear)),
                Transfer::Srgb => {
                    Vec3::from([r, g, b].map(|byte| LINEAR_FROM_SRGB[usize::from(byte)])).extend(linear(a))
                }
            }
        };
        let at = reference.uv_transform.transform_point2(uv) * Vec2::new(size[0] as f32, size[1] as f32);
        // A file may scale beyond all numbers; far out every texel is as good as another.
        let at = if at.is_finite() { at.clamp(Vec2::splat(-1e9), Vec2::splat(1e9)) } else { Vec2::ZERO };
        if !sampler.mag_linear {
            return texel(at.x.floor() as i64, at.y.floor() as i64);
        }
        let first = (at - 0.5).floor();
        let t = at - 0.5 - first;
        let (x, y) = (first.x as i64, first.y as i64);
        texel(x, y).lerp(texel(x + 1, y), t.x).lerp(texel(x, y + 1).lerp(texel(x + 1, y + 1), t.x), t.y)
    }

    /// Linear base colour and alpha of a material at a point of a mesh's triangle.
    pub(crate) fn base_color(&self, material: &Material, mesh: &Mesh, corners: [usize; 3], weights: Vec3) -> Vec4 {
        let mut color = material.base_color;
        if !mesh.colors.is_empty() {
            color *= interpolate(&mesh.colors, corners, weights);
        }
        if let Some(texture) = &material.base_color_texture {
            color *= self.sample(texture, mesh.uv(texture, corners, weights), Transfer::Srgb);
        }
        color
    }
}

impl Scene {
    /// Mean linear base colour of all surfaces by area, from points spread over them; black for no surface.
    pub(crate) fn mean_albedo(&self) -> Vec3 {
        const POINTS: u32 = 4096;
        let mut triangles = Vec::with_capacity(self.triangle_count());
        let mut area = 0.0;
        for instance in &self.instances {
            let mesh = &self.meshes[instance.mesh];
            for corners in mesh.indices.as_chunks::<3>().0 {
                let corners = corners.map(|corner| corner as usize);
                let [a, b, c] = corners
                    .map(|corner| instance.world_from_object.transform_point3(mesh.positions[corner]).as_dvec3());
                area += 0.5 * (b - a).cross(c - a).length();
                triangles.push((area, mesh, corners));
            }
        }
        if area.partial_cmp(&0.0) != Some(std::cmp::Ordering::Greater) || !area.is_finite() {
            return Vec3::ZERO;
        }
        let albedo = |i: u32| {
            let [x, y, z, _] = sobol_burley::sample_4d(i, 0, 0);
            let target = (f64::from(i) + f64::from(z)) / f64::from(POINTS) * area;
            let (_, mesh, corners) = triangles[triangles.partition_point(|t| t.0 <= target).min(triangles.len() - 1)];
            let material = &self.materials[mesh.material];
            let weights = on_triangle([x, y]);
            if material.unlit { Vec3::ZERO } else { self.base_color(material, mesh, corners, weights).truncate() }
        };
        (0..POINTS).map(albedo).sum::<Vec3>() / POINTS as f32
    }
}

impl Mesh {
    /// The texture coordinates that a texture takes at a point of a triangle.
    pub(crate) fn uv(&self, texture: &TextureRef, corners: [usize; 3], weights: Vec3) -> Vec2 {
        let uvs = &self.uvs[texture.uv_set];
        if uvs.is_empty() { Vec2::ZERO } else { interpolate(uvs, corners, weights) }
    }
}

/// A vertex attribute at a point of a triangle, by the weights of its corners.
pub(crate) fn interpolate<T>(attribute: &[T], corners: [usize; 3], weights: Vec3) -> T
where
    T: Copy + std::ops::Mul<f32, Output = T> + std::ops::Add<Output = T>,
{
    let [a, b, c] = corners.map(|corner| attribute[corner]);
    a * weights.x + b * weights.y + c * weights.z
}

/// The texel that stands for texel `i` of an axis that has `size`.
fn wrapped(i: i64, size: i64, wrap: Wrap) -> i64 {
    match wrap {
        Wrap::Clamp => i.clamp(0, size - 1),
        Wrap::Repeat => i.rem_euclid(size),
        Wrap::Mirror => {
            let i = i.rem_euclid(2 * size);
            i.min(2 * size - 1 - i)
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::Affine2;

    use super::*;
    use crate::scene::{Image, Sampler, Texture};

    #[test]
    fn mean_albedo_is_weighted_by_area() {
        let scene = Scene::builtin("column").unwrap();
        // 6 × 3 × 8 m: floor, ceiling, two walls across z, one warm and one cool; a column of radius 0.35 m.
        let sides = 2.0 * 18.0 + 48.0 + 2.0 * std::f32::consts::PI * 0.35 * 3.02;
        let sum = Vec3::splat(0.75) * sides
            + 48.0 * Vec3::new(0.45, 0.4, 0.35)
            + 24.0 * (Vec3::new(0.75, 0.28, 0.1) + Vec3::new(0.12, 0.32, 0.65));
        let expected = sum / (sides + 96.0);
        assert!((scene.mean_albedo() - expected).abs().max_element() < 2e-3, "{} {expected}", scene.mean_albedo());
        assert_eq!(Scene::default().mean_albedo(), Vec3::ZERO);
    }

    #[test]
    fn texels_are_filtered_and_wrapped_as_the_sampler_says() {
        let mut scene = Scene {
            // One row: 0, 51, 102, 255.
            images: vec![Image { width: 4, height: 1, rgba: [0u8, 51, 102, 255].map(|v| [v; 4]).concat() }.into()],
            ..Scene::default()
        };
        let reference = TextureRef { texture: 0, uv_set: 0, uv_transform: Affine2::IDENTITY };
        let mut at = |wrap_u, mag_linear, u: f32| {
            scene.textures = vec![Texture { image: 0, sampler: Sampler { wrap_u, mag_linear, ..Sampler::default() } }];
            scene.sample(&reference, Vec2::new(u, 0.5), Transfer::Linear).x
        };
        for (wrap, linear, u, expected) in [
            (Wrap::Repeat, true, 0.125, 0.0),
            (Wrap::Repeat, true, 0.25, 0.1),
            (Wrap::Repeat, true, 0.3125, 0.15),
            (Wrap::Repeat, true, 1.0, 0.5),
            (Wrap::Repeat, true, -0.875, 0.0),
            (Wrap::Clamp, true, 1.0, 1.0),
            (Wrap::Clamp, true, -3.0, 0.0),
            (Wrap::Mirror, true, 1.0, 1.0),
            (Wrap::Mirror, false, 1.3, 0.4),
            (Wrap::Mirror, false, -0.3, 0.2),
            (Wrap::Repeat, false, 0.26, 0.2),
            (Wrap::Repeat, false, -0.1, 1.0),
        ] {
            let got = at(wrap, linear, u);
            assert!((got - expected).abs() < 1e-5, "{wrap:?} {linear} {u}: {got}, expected {expected}");
        }
        for scale in [1e30, 3e38, f32::INFINITY] {
            let uv_transform = Affine2::from_scale(Vec2::splat(scale));
            let got = scene.sample(&TextureRef { uv_transform, ..reference }, Vec2::splat(2.0), Transfer::Linear);
            assert!(got.is_finite(), "{scale}: {got}");
        }
        let srgb = scene.sample(&reference, Vec2::new(0.625, 0.5), Transfer::Srgb);
        // 102/255 = 0.4 → ((0.4 + 0.055) / 1.055)^2.4; alpha stays.
        assert!((srgb.x - 0.132_868).abs() < 1e-5 && (srgb.w - 0.4).abs() < 1e-5, "{srgb}");
    }
}
