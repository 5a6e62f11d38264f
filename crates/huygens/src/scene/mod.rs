//! Scenes: meshes, materials, textures, instances, lights and cameras, as the renderer and the CPU reference
//! both read them.
//!
//! A scene comes from a built-in generator ([`Scene::builtin`]) or a glTF file ([`Scene::load`]). Loading checks
//! everything (finite positions, indices in range), so that whatever holds a `Scene` may rely on it.

mod animation;
mod deform;
mod gltf;

use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{Affine2, Mat4, Vec2, Vec3, Vec4};

use crate::{Camera, Light, Result};

mod builtin;
mod defaults;
pub(crate) mod texture;

pub use animation::{Animation, Graph};
pub use builtin::BUILTIN_NAMES;

/// Axis-aligned bounds, world space, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Smallest coordinates.
    pub min: Vec3,
    /// Largest coordinates.
    pub max: Vec3,
}

impl Bounds {
    /// The middle.
    pub fn center(&self) -> Vec3 {
        0.5 * (self.min + self.max)
    }

    /// Radius of the sphere around the box, metres.
    pub fn radius(&self) -> f32 {
        0.5 * (self.max - self.min).length()
    }

    /// Largest distance from `point` to a corner, metres.
    pub fn farthest(&self, point: Vec3) -> f32 {
        (self.max - point).abs().max((self.min - point).abs()).length()
    }
}

/// Decoded picture: 8-bit RGBA, rows from the top, as the file has it (no transfer function applied).
#[derive(Clone, Debug)]
pub struct Image {
    /// Width in texels, at least 1.
    pub width: u32,
    /// Height in texels, at least 1.
    pub height: u32,
    /// `width · height · 4` bytes.
    pub rgba: Vec<u8>,
}

/// What happens to texture coordinates outside 0…1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Wrap {
    /// Clamp to the edge.
    Clamp,
    /// Mirror at every integer.
    Mirror,
    /// Repeat.
    Repeat,
}

/// How a texture is sampled.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Sampler {
    /// Linear interpolation when a texel covers several pixels (else nearest).
    pub mag_linear: bool,
    /// Linear interpolation within a mip level when minified (else nearest).
    pub min_linear: bool,
    /// Mip levels when minified: `None` none, `Some(true)` linear between two, `Some(false)` the nearest.
    pub mip_linear: Option<bool>,
    /// Wrapping along u.
    pub wrap_u: Wrap,
    /// Wrapping along v.
    pub wrap_v: Wrap,
}

impl Default for Sampler {
    /// Trilinear, repeating: glTF's choice where a file says nothing.
    fn default() -> Self {
        Self { mag_linear: true, min_linear: true, mip_linear: Some(true), wrap_u: Wrap::Repeat, wrap_v: Wrap::Repeat }
    }
}

/// An image with a sampler.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Texture {
    /// Index into [`Scene::images`].
    pub image: usize,
    /// How it is sampled.
    pub sampler: Sampler,
}

/// A texture as a material uses it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureRef {
    /// Index into [`Scene::textures`].
    pub texture: usize,
    /// Which of the mesh's two sets of texture coordinates, 0 or 1.
    pub uv_set: usize,
    /// Takes the mesh's texture coordinates to the texture's (KHR_texture_transform).
    pub uv_transform: Affine2,
}

/// Coverage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AlphaMode {
    /// Alpha is ignored.
    Opaque,
    /// A point with alpha below the cutoff is not there.
    Mask {
        /// The cutoff, 0…1.
        cutoff: f32,
    },
}

/// A metallic-roughness material (glTF 2.0). Factors multiply textures.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Name in the file; empty if it has none.
    pub name: String,
    /// Linear base colour and alpha, 0…1.
    pub base_color: Vec4,
    /// Base colour (sRGB) and alpha (linear).
    pub base_color_texture: Option<TextureRef>,
    /// Metalness, 0…1.
    pub metallic: f32,
    /// Perceptual roughness, 0…1.
    pub roughness: f32,
    /// Roughness in green, metalness in blue, both linear.
    pub metallic_roughness_texture: Option<TextureRef>,
    /// Tangent-space normals.
    pub normal_texture: Option<TextureRef>,
    /// Scales x and y of the normal texture.
    pub normal_scale: f32,
    /// Ambient occlusion in red; it darkens indirect light alone.
    pub occlusion_texture: Option<TextureRef>,
    /// 0: no occlusion, 1: as the texture says.
    pub occlusion_strength: f32,
    /// Emitted radiance, W/(m² sr), linear RGB, KHR_materials_emissive_strength multiplied in.
    pub emissive: Vec3,
    /// Multiplies `emissive` (sRGB).
    pub emissive_texture: Option<TextureRef>,
    /// Factor of the dielectric specular reflection, 0…1 (KHR_materials_specular); 0 makes a dielectric Lambertian.
    pub specular: f32,
    /// Coverage.
    pub alpha_mode: AlphaMode,
    /// Seen from behind too (with the normal turned round). Everything casts shadows from both sides.
    pub double_sided: bool,
    /// Shows its base colour and takes no part in lighting (KHR_materials_unlit).
    pub unlit: bool,
}

impl Default for Material {
    /// glTF's default material: white, metallic 1, roughness 1.
    fn default() -> Self {
        Self {
            name: String::new(),
            base_color: Vec4::ONE,
            base_color_texture: None,
            metallic: 1.0,
            roughness: 1.0,
            metallic_roughness_texture: None,
            normal_texture: None,
            normal_scale: 1.0,
            occlusion_texture: None,
            occlusion_strength: 1.0,
            emissive: Vec3::ZERO,
            emissive_texture: None,
            specular: 1.0,
            alpha_mode: AlphaMode::Opaque,
            double_sided: false,
            unlit: false,
        }
    }
}

impl Material {
    /// A double-sided Lambertian surface of one linear albedo (no specular part).
    pub fn lambert(name: &str, albedo: Vec3) -> Self {
        Self {
            name: name.to_owned(),
            base_color: albedo.extend(1.0),
            metallic: 0.0,
            specular: 0.0,
            double_sided: true,
            ..Self::default()
        }
    }
}

/// An indexed triangle list with one material, in object space.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Name in the file; empty if it has none.
    pub name: String,
    /// Index into [`Scene::materials`].
    pub material: usize,
    /// Positions, object space; all finite.
    pub positions: Vec<Vec3>,
    /// Unit normals, one for every position.
    pub normals: Vec<Vec3>,
    /// Tangents (xyz) and handedness (w = ±1), one for every position, or empty where the material has no normal
    /// texture.
    pub tangents: Vec<Vec4>,
    /// Two sets of texture coordinates; each one for every position, or empty (read as zero).
    pub uvs: [Vec<Vec2>; 2],
    /// Linear vertex colours 0…1, one for every position, or empty (read as white).
    pub colors: Vec<Vec4>,
    /// Three for every triangle, each below `positions.len()`; counter-clockwise from the front.
    pub indices: Vec<u32>,
}

/// A mesh that stands in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instance {
    /// Index into [`Scene::meshes`].
    pub mesh: usize,
    /// Object space to world space; all finite.
    pub world_from_object: Mat4,
}

/// All that a picture is made of. Every index in it is valid, every number finite.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// `builtin:NAME`, or the file's name.
    pub name: String,
    /// Triangle lists; shared, so that a scene is cheap to clone.
    pub meshes: Vec<Arc<Mesh>>,
    /// Materials.
    pub materials: Vec<Material>,
    /// Images with samplers.
    pub textures: Vec<Texture>,
    /// Decoded pictures.
    pub images: Vec<Arc<Image>>,
    /// Meshes in the world.
    pub instances: Vec<Instance>,
    /// Lights; the strongest first: it is the primary light. Never empty after loading.
    pub lights: Vec<Light>,
    /// Cameras of the file, or the default one. Never empty after loading.
    pub cameras: Vec<Camera>,
    /// Files beside the scene's own that were read for it (buffers, images), with links resolved.
    pub files: Vec<PathBuf>,
    /// What was read but not drawn as the file says, for people: one line each.
    pub warnings: Vec<String>,
    /// What [`Scene::at`] moves the scene by; `None` where the file has no animations.
    pub graph: Option<Arc<Graph>>,
}

impl Scene {
    /// Reads a glTF 2.0 file (.gltf or .glb): its default scene, or the first if it names none, at rest.
    ///
    /// What cannot be drawn as the file says is one line in [`Scene::warnings`].
    ///
    /// # Errors
    /// [`Error::File`](crate::Error::File) for whatever is wrong with the file or with one that it names. A file may
    /// name only files below its own folder.
    pub fn load(path: impl AsRef<Path>) -> Result<Scene> {
        Self::load_with(path, &mut |_| true)
    }

    /// As [`Scene::load`]; `progress` hears the share that is read, 0…1, and says whether to go on.
    ///
    /// # Errors
    /// As [`Scene::load`], and [`Error::Cancelled`](crate::Error::Cancelled) if `progress` said no.
    pub fn load_with(path: impl AsRef<Path>, progress: &mut dyn FnMut(f32) -> bool) -> Result<Scene> {
        let mut scene = gltf::load(path.as_ref(), progress)?;
        defaults::complete(&mut scene);
        Ok(scene)
    }

    /// Bounds of all instances in world space; `None` if there are no triangles.
    pub fn bounds(&self) -> Option<Bounds> {
        let all = self.instances.iter().filter_map(|instance| self.bounds_of(instance));
        all.reduce(|a, b| Bounds { min: a.min.min(b.min), max: a.max.max(b.max) })
    }

    /// Bounds of one of them.
    pub fn bounds_of(&self, instance: &Instance) -> Option<Bounds> {
        let mesh = &self.meshes[instance.mesh];
        let points =
            mesh.indices.iter().map(|&i| instance.world_from_object.transform_point3(mesh.positions[i as usize]));
        let boxes = points.map(|point| Bounds { min: point, max: point });
        boxes.reduce(|a, b| Bounds { min: a.min.min(b.min), max: a.max.max(b.max) })
    }

    /// A number that differs, but for chance, between scenes that look different: names and warnings do not count.
    /// For caches on one machine; it may change from one build to the next.
    pub fn fingerprint(&self) -> u64 {
        let mut hasher = DefaultHasher::new();
        for mesh in &self.meshes {
            mesh.material.hash(&mut hasher);
            for bytes in [
                bytemuck::cast_slice::<_, u8>(&mesh.positions),
                bytemuck::cast_slice(&mesh.normals),
                bytemuck::cast_slice(&mesh.tangents),
                bytemuck::cast_slice(&mesh.uvs[0]),
                bytemuck::cast_slice(&mesh.uvs[1]),
                bytemuck::cast_slice(&mesh.colors),
                bytemuck::cast_slice(&mesh.indices),
            ] {
                bytes.hash(&mut hasher);
            }
        }
        for image in &self.images {
            (image.width, image.height, &image.rgba).hash(&mut hasher);
        }
        // These are few: their text is the simplest form that misses no field.
        format!("{:?}", (&self.materials, &self.textures, &self.instances, &self.lights)).hash(&mut hasher);
        hasher.finish()
    }

    /// Number of triangles drawn, instances counted each.
    pub fn triangle_count(&self) -> usize {
        self.instances.iter().map(|i| self.meshes[i.mesh].indices.len() / 3).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fingerprint_tells_what_a_scene_looks_like() {
        let scene = Scene::builtin("column").unwrap();
        let mut other = scene.clone();
        other.name.push('x');
        assert_eq!(scene.fingerprint(), other.fingerprint());
        let changes: [fn(&mut Scene); 5] = [
            |s| Arc::make_mut(&mut s.meshes[0]).positions[0].x += 1e-3,
            |s| s.materials[0].roughness *= 0.5,
            |s| s.lights[0].intensity.y += 1.0,
            |s| s.instances[0].world_from_object.w_axis.x += 1.0,
            |s| s.images.push(Arc::new(Image { width: 1, height: 1, rgba: vec![1; 4] })),
        ];
        for change in changes {
            let mut other = scene.clone();
            change(&mut other);
            assert_ne!(scene.fingerprint(), other.fingerprint());
        }
    }
}
