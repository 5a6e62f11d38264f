//! The scene on the GPU, and drawing it.

use std::borrow::Cow;
use std::collections::HashMap;
use std::rc::Rc;

use glam::{Mat4, Vec3, Vec4};

use crate::gl::{
    Context, Cull, Format, GeometryBuffer, SamplerObject, State, Texture, UniformArray, Viewport, uniform_block,
};
use crate::scene::{AlphaMode, Image, Material, Mesh, Sampler, Scene, TextureRef};
use crate::{Error, Result};

uniform_block! {
    /// An instance; `geometry.vert`, `shadow.vert`.
    ObjectBlock as "ObjectBlock" {
        world_from_object: Mat4,
        normal_from_object: Mat4,
        instance: Vec4,
    }
}

uniform_block! {
    /// A material; `common/material.glsl`.
    MaterialBlock as "MaterialBlock" {
        base_color: Vec4,
        emissive: Vec4,
        factors: Vec4,
        flags: Vec4,
        uv_matrix: [Vec4; 5],
        uv_offset: [Vec4; 5],
    }
}

/// Floats of each vertex attribute: position, normal, tangent, two sets of texture coordinates, colour.
const ATTRIBUTES: [usize; 5] = [3, 3, 4, 4, 4];

/// A mesh among the indices of all.
struct Shape {
    /// First float of its vertices.
    first_float: usize,
    first_index: usize,
    index_count: usize,
    material: usize,
    /// Smallest and largest coordinates, object space.
    bounds: [Vec3; 2],
}

struct Drawable {
    shape: usize,
    /// The transform mirrors, so that triangles wind the other way.
    mirrored: bool,
    center_ws: Vec3,
    radius: f32,
}

struct GpuMaterial {
    /// Texture and sampler of each of the five slots.
    slots: [(usize, usize); 5],
    double_sided: bool,
}

/// A scene's buffers and textures.
pub(crate) struct GpuScene {
    context: Rc<Context>,
    geometry: Option<GeometryBuffer>,
    shapes: Vec<Shape>,
    objects: UniformArray<ObjectBlock>,
    materials: UniformArray<MaterialBlock>,
    gpu_materials: Vec<GpuMaterial>,
    textures: Vec<Texture>,
    samplers: Vec<SamplerObject>,
    drawables: Vec<Drawable>,
}

/// How the scene is drawn.
#[derive(Clone, Copy)]
pub(crate) struct DrawView {
    pub clip_from_world: Mat4,
    pub viewport: Viewport,
    /// Leave out the back of single-sided surfaces (the camera does; shadows fall from both sides).
    pub cull_back: bool,
    /// How many of a material's textures the program reads: base colour first.
    pub textures: usize,
}

impl GpuScene {
    /// Uploads everything.
    pub fn new(context: &Rc<Context>, scene: &Scene) -> Result<Self> {
        let mut textures = Textures {
            context,
            list: Vec::new(),
            known: HashMap::new(),
            samplers: Vec::new(),
            known_samplers: HashMap::new(),
        };
        let white = textures.white()?;
        let mut blocks = Vec::new();
        let mut gpu_materials = Vec::new();
        for material in &scene.materials {
            let mut slots = [white; 5];
            for (slot, (texture, srgb)) in slots.iter_mut().zip(slots_of(material)) {
                if let Some(texture) = texture {
                    *slot = textures.get(scene, texture, srgb)?;
                }
            }
            blocks.push(material_block(material));
            gpu_materials.push(GpuMaterial { slots, double_sided: material.double_sided });
        }
        if blocks.is_empty() {
            blocks.push(material_block(&Material::default()));
        }

        let (mut vertices, mut indices, mut shapes) = (Vec::new(), Vec::new(), Vec::new());
        for mesh in &scene.meshes {
            let floats: usize = ATTRIBUTES.iter().sum();
            let base = vertices.len() / floats;
            if base + mesh.positions.len() > u32::MAX as usize {
                return Err(Error::Gl("the scene has more vertices than 32-bit indices can name".into()));
            }
            shapes.push(Shape {
                first_float: vertices.len(),
                first_index: indices.len(),
                index_count: mesh.indices.len(),
                material: mesh.material,
                bounds: bounds(mesh),
            });
            append_vertices(&mut vertices, mesh);
            // glDrawElementsBaseVertex is not in ES 3.0.
            indices.extend(mesh.indices.iter().map(|index| index + base as u32));
        }

        let geometry = if indices.is_empty() {
            None
        } else {
            Some(GeometryBuffer::new(context, &ATTRIBUTES, &vertices, &indices)?)
        };
        let (objects, drawables) = place(context, &shapes, scene)?;
        Ok(Self {
            context: context.clone(),
            geometry,
            shapes,
            objects,
            materials: UniformArray::new(context, &blocks)?,
            gpu_materials,
            textures: textures.list,
            samplers: textures.samplers,
            drawables,
        })
    }

    /// Takes up where the instances of `scene` stand; it must be the one that was uploaded but for its instances.
    pub fn place(&mut self, scene: &Scene) -> Result<()> {
        (self.objects, self.drawables) = place(&self.context, &self.shapes, scene)?;
        Ok(())
    }

    /// Uploads the vertices of some meshes of `scene`, which must differ from what was uploaded in nothing but these and in
    /// its instances; takes up where those stand.
    pub fn deform(&mut self, scene: &Scene, meshes: &[usize]) -> Result<()> {
        let mut vertices = Vec::new();
        for &number in meshes {
            let (mesh, shape) = (&scene.meshes[number], &mut self.shapes[number]);
            vertices.clear();
            append_vertices(&mut vertices, mesh);
            shape.bounds = bounds(mesh);
            if let Some(geometry) = &self.geometry {
                geometry.set_vertices(shape.first_float, &vertices);
            }
        }
        self.place(scene)
    }

    /// Draws every instance that the view can see, with the program and the target that are bound.
    pub fn draw(&self, view: &DrawView) {
        let Some(geometry) = &self.geometry else { return };
        geometry.bind();
        let (mut bound_material, mut bound_cull) = (None, None);
        for (i, drawable) in self.drawables.iter().enumerate() {
            let shape = &self.shapes[drawable.shape];
            if shape.index_count == 0 || outside(&view.clip_from_world, drawable.center_ws, drawable.radius) {
                continue;
            }
            let material = &self.gpu_materials[shape.material];
            let cull = match (view.cull_back && !material.double_sided, drawable.mirrored) {
                (false, false) => Cull::None,
                (false, true) => Cull::NoneMirrored,
                (true, false) => Cull::Back,
                (true, true) => Cull::BackMirrored,
            };
            if bound_cull != Some(cull) {
                State::geometry(view.viewport, cull).apply(&self.context);
                bound_cull = Some(cull);
            }
            if bound_material != Some(shape.material) {
                self.materials.bind(shape.material);
                for (unit, &(texture, sampler)) in material.slots.iter().enumerate().take(view.textures) {
                    self.textures[texture].bind(unit as u32, Some(&self.samplers[sampler]));
                }
                bound_material = Some(shape.material);
            }
            self.objects.bind(i);
            geometry.draw(shape.first_index, shape.index_count);
        }
    }
}

/// Vertices as the vertex array reads them.
fn append_vertices(vertices: &mut Vec<f32>, mesh: &Mesh) {
    for i in 0..mesh.positions.len() {
        let tangent = mesh.tangents.get(i).copied().unwrap_or(Vec4::ZERO);
        let uv = |set: usize| mesh.uvs[set].get(i).copied().unwrap_or_default();
        let color = mesh.colors.get(i).copied().unwrap_or(Vec4::ONE);
        vertices.extend_from_slice(&mesh.positions[i].to_array());
        vertices.extend_from_slice(&mesh.normals[i].to_array());
        vertices.extend_from_slice(&tangent.to_array());
        vertices.extend_from_slice(&uv(0).to_array());
        vertices.extend_from_slice(&uv(1).to_array());
        vertices.extend_from_slice(&color.to_array());
    }
}

/// Smallest and largest coordinates, object space.
fn bounds(mesh: &Mesh) -> [Vec3; 2] {
    let empty = [Vec3::INFINITY, Vec3::NEG_INFINITY];
    mesh.positions.iter().fold(empty, |[min, max], &p| [min.min(p), max.max(p)])
}

/// Transforms of all instances, and where they stand.
fn place(context: &Rc<Context>, shapes: &[Shape], scene: &Scene) -> Result<(UniformArray<ObjectBlock>, Vec<Drawable>)> {
    let mut objects = Vec::new();
    let mut drawables = Vec::new();
    for instance in &scene.instances {
        let matrix = instance.world_from_object;
        let bounds = shapes[instance.mesh].bounds;
        objects.push(object_block(matrix, objects.len()));
        let (mut min, mut max) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for corner in 0..8 {
            let pick = |axis: usize| bounds[corner >> axis & 1][axis];
            let point = matrix.transform_point3(Vec3::new(pick(0), pick(1), pick(2)));
            (min, max) = (min.min(point), max.max(point));
        }
        drawables.push(Drawable {
            shape: instance.mesh,
            mirrored: matrix.determinant() < 0.0,
            center_ws: 0.5 * (min + max),
            radius: 0.5 * (max - min).length(),
        });
    }
    if objects.is_empty() {
        objects.push(object_block(Mat4::IDENTITY, 0));
    }
    Ok((UniformArray::new(context, &objects)?, drawables))
}

fn object_block(world_from_object: Mat4, number: usize) -> ObjectBlock {
    let normal_from_object = world_from_object.inverse().transpose();
    ObjectBlock { world_from_object, normal_from_object, instance: Vec4::new(number as f32, 0.0, 0.0, 0.0) }
}

/// True if a sphere lies wholly outside one plane of the view volume (Gribb & Hartmann 2001), beyond what rounding may do:
/// far from the origin the planes lose their digits, that of the near plane first.
fn outside(clip_from_world: &Mat4, center: Vec3, radius: f32) -> bool {
    let rows = clip_from_world.transpose();
    let (w, center) = (rows.w_axis, center.extend(1.0));
    [rows.x_axis, rows.y_axis, rows.z_axis].into_iter().any(|axis| {
        let rounding = 4.0 * f32::EPSILON * (w.abs() + axis.abs()).dot(center.abs());
        [w + axis, w - axis].into_iter().any(|p| p.dot(center) < -radius * p.truncate().length() - rounding)
    })
}

/// The five textures of a material, in the order of the shader's slots, and whether their colours are sRGB.
fn slots_of(material: &Material) -> [(Option<&TextureRef>, bool); 5] {
    [
        (material.base_color_texture.as_ref(), true),
        (material.metallic_roughness_texture.as_ref(), false),
        (material.normal_texture.as_ref(), false),
        (material.occlusion_texture.as_ref(), false),
        (material.emissive_texture.as_ref(), true),
    ]
}

fn material_block(material: &Material) -> MaterialBlock {
    let cutoff = match material.alpha_mode {
        AlphaMode::Opaque => -1.0,
        AlphaMode::Mask { cutoff } => cutoff,
    };
    let flag = |on: bool| f32::from(u8::from(on));
    let mut uv_matrix = [Vec4::new(1.0, 0.0, 0.0, 1.0); 5];
    let mut uv_offset = [Vec4::ZERO; 5];
    for (i, (texture, _)) in slots_of(material).into_iter().enumerate() {
        if let Some(texture) = texture {
            let m = texture.uv_transform.matrix2;
            uv_matrix[i] = Vec4::new(m.x_axis.x, m.x_axis.y, m.y_axis.x, m.y_axis.y);
            uv_offset[i] = texture.uv_transform.translation.extend(texture.uv_set as f32).extend(0.0);
        }
    }
    MaterialBlock {
        base_color: material.base_color,
        emissive: material.emissive.extend(cutoff),
        factors: Vec4::new(material.metallic, material.roughness, material.normal_scale, material.occlusion_strength),
        flags: Vec4::new(material.specular, flag(material.unlit), flag(material.normal_texture.is_some()), 0.0),
        uv_matrix,
        uv_offset,
    }
}

/// Textures and samplers, each made once.
struct Textures<'a> {
    context: &'a Rc<Context>,
    list: Vec<Texture>,
    known: HashMap<(usize, bool), usize>,
    samplers: Vec<SamplerObject>,
    known_samplers: HashMap<Sampler, usize>,
}

impl Textures<'_> {
    /// What a slot without a texture reads: factors alone count.
    fn white(&mut self) -> Result<(usize, usize)> {
        self.list.push(Texture::with_pixels(self.context, Format::Rgba8, 1, 1, Some(&[255; 4]))?);
        Ok((0, self.sampler(&Sampler::default())?))
    }

    fn get(&mut self, scene: &Scene, reference: &TextureRef, srgb: bool) -> Result<(usize, usize)> {
        let texture = scene.textures[reference.texture];
        let sampler = self.sampler(&texture.sampler)?;
        if let Some(&known) = self.known.get(&(texture.image, srgb)) {
            return Ok((known, sampler));
        }
        let format = if srgb { Format::Srgba8 } else { Format::Rgba8 };
        let image = within_limit(&scene.images[texture.image], self.context.info().max_texture_size);
        let made = Texture::with_pixels(self.context, format, image.width, image.height, Some(&image.rgba))?;
        made.generate_mipmap();
        self.list.push(made);
        self.known.insert((texture.image, srgb), self.list.len() - 1);
        Ok((self.list.len() - 1, sampler))
    }

    fn sampler(&mut self, sampler: &Sampler) -> Result<usize> {
        if let Some(&known) = self.known_samplers.get(sampler) {
            return Ok(known);
        }
        self.samplers.push(SamplerObject::for_material(self.context, sampler)?);
        self.known_samplers.insert(*sampler, self.samplers.len() - 1);
        Ok(self.samplers.len() - 1)
    }
}

/// The image, made smaller if the driver cannot hold it.
fn within_limit(image: &Image, limit: u32) -> Cow<'_, Image> {
    let longest = image.width.max(image.height);
    if longest <= limit {
        return Cow::Borrowed(image);
    }
    let fit = |edge: u32| ((u64::from(edge) * u64::from(limit) / u64::from(longest)) as u32).max(1);
    let (width, height) = (fit(image.width), fit(image.height));
    match image::RgbaImage::from_raw(image.width, image.height, image.rgba.clone()) {
        Some(buffer) => {
            let small = image::imageops::resize(&buffer, width, height, image::imageops::FilterType::Triangle);
            Cow::Owned(Image { width, height, rgba: small.into_raw() })
        }
        None => Cow::Borrowed(image),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn culling_keeps_what_touches_the_view() {
        let clip = glam::camera::rh::proj::opengl::perspective(1.0, 1.0, 0.1, 10.0);
        let half = 0.5f32;
        for (center, out) in [
            (Vec3::new(0.0, 0.0, -5.0), false),
            (Vec3::new(0.0, 0.0, 1.0), true),
            (Vec3::new(0.0, 0.0, -11.0), true),
            (Vec3::new(0.0, 0.0, -10.4), false),
            (Vec3::new(5.0, 0.0, -5.0), true),
            (Vec3::new(5.0 * half.tan() + 0.5, 0.0, -5.0), false),
        ] {
            assert_eq!(outside(&clip, center, 0.5), out, "{center}");
        }
        // Far from the origin what is in view stays in view.
        let eye = Vec3::new(1e4, 1e4, 3.0);
        let clip = glam::camera::rh::proj::opengl::perspective(1.0, 1.0, 1e-3, 10.0)
            * glam::camera::rh::view::look_to_mat4(eye, Vec3::NEG_Z, Vec3::Y);
        assert!(!outside(&clip, eye - Vec3::Z * 3.0, 0.5));
        assert!(outside(&clip, eye + Vec3::Z * 3e3, 0.5));
    }
}
