//! Materials, textures and images.

use std::collections::HashMap;
use std::io::Cursor;

use glam::{Affine2, Mat2, Vec2, Vec3, Vec4};
use gltf::json::extensions::texture::TextureTransform;
use gltf::json::material::AlphaMode as Alpha;
use gltf::json::texture::{Info, MagFilter, MinFilter, WrappingMode};
use gltf::json::validation::Checked;
use gltf::json::{Index, Value, deserialize};
use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};
use rayon::prelude::*;

use super::{Loader, MAX_INTENSITY, MAX_TEXTURE_COORDINATE, Problem, get};
use crate::scene::{AlphaMode, Image, Material, Sampler, Texture, TextureRef, Wrap};

/// Longest edge of an image, texels.
const MAX_EDGE: u32 = 16384;
/// Most memory for one decoded image, and for all of them, bytes.
const MAX_IMAGE: u64 = 1 << 30;
const MAX_IMAGES: u64 = 4 << 30;
/// Most bytes of all images as the files have them.
const MAX_ENCODED: u64 = 2 << 30;
/// Memory for images that are decoded at the same time, bytes; a single one may need more.
const CHUNK: u64 = 1 << 30;
const TRANSFORM: &str = "KHR_texture_transform";

impl<'a> Loader<'a, '_> {
    /// All materials of the file, in its order, and the images that they use.
    pub(super) fn materials(&mut self) -> Problem<()> {
        let mut used = Used::default();
        for (number, json) in self.buffers.root.materials.iter().enumerate() {
            let material = self.material(json, &mut used).map_err(|e| format!("material {number}: {e}"))?;
            self.scene.materials.push(material);
        }
        self.images(&used.images)
    }

    /// Reads and decodes images; what all of them need is counted before the first is decoded.
    fn images(&mut self, numbers: &[usize]) -> Problem<()> {
        let (mut encoded, mut decoded, mut images) = (0, 0, Vec::new());
        for &number in numbers {
            let bytes = self.encoded(number, &mut encoded).map_err(|e| format!("image {number}: {e}"))?;
            let decoder = decoder(&bytes).map_err(|e| format!("image {number}: {e}"))?;
            let size = u64::from(decoder.dimensions().0) * u64::from(decoder.dimensions().1) * 4;
            // Decoding may go through a format with more bytes for a texel.
            let needs = size + decoder.total_bytes();
            drop(decoder);
            decoded += size;
            if decoded > MAX_IMAGES {
                return Err(format!("images are too large together; allowed: {MAX_IMAGES} bytes decoded"));
            }
            images.push((number, bytes, needs));
        }
        // Between chunks the caller hears how far it is.
        let most = rayon::current_num_threads();
        let (mut chunk, mut weight) = (Vec::new(), 0);
        for (number, bytes, needs) in images {
            if weight + needs > CHUNK || chunk.len() == most {
                self.decode(&mut chunk)?;
                weight = 0;
            }
            weight += needs;
            chunk.push((number, bytes));
        }
        self.decode(&mut chunk)
    }

    fn decode(&mut self, chunk: &mut Vec<(usize, Vec<u8>)>) -> Problem<()> {
        let decode = |(number, bytes): (_, Vec<u8>)| decode(&bytes).map_err(|e| format!("image {number}: {e}"));
        let images: Vec<_> = std::mem::take(chunk).into_par_iter().map(decode).collect();
        for image in images {
            self.scene.images.push(image?.into());
            self.steps.advance(1)?;
        }
        Ok(())
    }

    fn material(&mut self, json: &gltf::json::Material, used: &mut Used<'a>) -> Problem<Material> {
        let pbr = &json.pbr_metallic_roughness;
        let mut info = |info: &Option<Info>| match info {
            Some(info) => {
                let transform = info.extensions.as_ref().and_then(|e| e.texture_transform.as_ref());
                self.texture(used, info.index, info.tex_coord, transform)
            }
            None => Ok(None),
        };
        let base_color_texture = info(&pbr.base_color_texture)?;
        let metallic_roughness_texture = info(&pbr.metallic_roughness_texture)?;
        let emissive_texture = info(&json.emissive_texture)?;
        let (mut normal_texture, mut normal_scale) = (None, 1.0);
        if let Some(normal) = &json.normal_texture {
            let transform = transform(normal.extensions.as_ref().and_then(|e| e.others.get(TRANSFORM)))?;
            normal_texture = self.texture(used, normal.index, normal.tex_coord, transform.as_ref())?;
            normal_scale = normal.scale;
        }
        let (mut occlusion_texture, mut occlusion_strength) = (None, 1.0);
        if let Some(occlusion) = &json.occlusion_texture {
            let transform = transform(occlusion.extensions.as_ref().and_then(|e| e.others.get(TRANSFORM)))?;
            occlusion_texture = self.texture(used, occlusion.index, occlusion.tex_coord, transform.as_ref())?;
            occlusion_strength = occlusion.strength.0.clamp(0.0, 1.0);
        }

        let (mut strength, mut specular, mut unlit) = (1.0, 1.0, false);
        let mut factors = pbr.base_color_factor.0.to_vec();
        factors.extend([pbr.metallic_factor.0, pbr.roughness_factor.0]);
        if let Some(extensions) = &json.extensions {
            strength = extensions.emissive_strength.as_ref().map_or(1.0, |e| e.emissive_strength.0);
            unlit = extensions.unlit.is_some();
            if let Some(s) = &extensions.specular {
                factors.push(s.specular_factor.0);
                specular = s.specular_factor.0.clamp(0.0, 1.0);
                if s.specular_texture.is_some()
                    || s.specular_color_texture.is_some()
                    || s.specular_color_factor.0 != [1.0; 3]
                {
                    self.warn("KHR_materials_specular: its textures and colour are ignored, its factor is not");
                }
            }
        }
        let emissive = Vec3::from(json.emissive_factor.0) * strength;
        if !factors.iter().all(|factor| (0.0..=1.0).contains(factor)) || emissive.min_element() < 0.0 {
            self.warn(
                "a material has a factor outside of 0 to 1, or a negative emission: the nearest allowed is taken",
            );
        }
        let alpha_mode = match json.alpha_mode {
            Checked::Valid(Alpha::Opaque) => AlphaMode::Opaque,
            Checked::Valid(Alpha::Mask) => AlphaMode::Mask { cutoff: json.alpha_cutoff.map_or(0.5, |c| c.0) },
            Checked::Valid(Alpha::Blend) => {
                self.warn("alphaMode BLEND is drawn opaque");
                AlphaMode::Opaque
            }
            Checked::Invalid => return Err("unknown alphaMode; allowed: OPAQUE, MASK, BLEND".to_owned()),
        };
        let material = Material {
            name: json.name.clone().unwrap_or_default(),
            base_color: Vec4::from(pbr.base_color_factor.0).clamp(Vec4::ZERO, Vec4::ONE),
            base_color_texture,
            metallic: pbr.metallic_factor.0.clamp(0.0, 1.0),
            roughness: pbr.roughness_factor.0.clamp(0.0, 1.0),
            metallic_roughness_texture,
            normal_texture,
            normal_scale,
            occlusion_texture,
            occlusion_strength,
            emissive: emissive.max(Vec3::ZERO),
            emissive_texture,
            specular,
            alpha_mode,
            double_sided: json.double_sided,
            unlit,
        };
        let cutoff = if let AlphaMode::Mask { cutoff } = alpha_mode { cutoff } else { 0.0 };
        match material.emissive.is_finite() && normal_scale.is_finite() && cutoff.is_finite() {
            true if material.emissive.max_element() > MAX_INTENSITY => {
                Err(format!("emission is out of range; allowed: 0 to {MAX_INTENSITY:e}"))
            }
            true => Ok(material),
            false => Err("a factor is NaN or infinite; allowed: finite ones".to_owned()),
        }
    }

    fn texture(
        &mut self,
        used: &mut Used<'a>,
        index: Index<gltf::json::Texture>,
        set: u32,
        transform: Option<&TextureTransform>,
    ) -> Problem<Option<TextureRef>> {
        let root = self.buffers.root;
        let json = get(&root.textures, index.value(), "texture")?;
        // This is how gltf says that there is no source: another extension has it (WebP, KTX2).
        if json.source.value() == u32::MAX as usize {
            self.warn("a texture has no PNG or JPEG source and is left out");
            return Ok(None);
        }
        let (texture, new) = used.textures.index(index.value());
        if new {
            let image = used.image(json.source.value(), get(&root.images, json.source.value(), "image")?);
            let sampler = match json.sampler {
                Some(index) => sampler(get(&root.samplers, index.value(), "sampler")?)?,
                None => Sampler::default(),
            };
            self.scene.textures.push(Texture { image, sampler });
        }
        let (mut set, mut uv_transform) = (set, Affine2::IDENTITY);
        if let Some(t) = transform {
            set = t.tex_coord.unwrap_or(set);
            // Translation · rotation · scale; counter-clockwise as seen with v down, which is what the sample model
            // TextureTransformTest shows and viewers do (the sign in the extension's GLSL listing: glTF issue 1563).
            uv_transform = Affine2::from_mat2_translation(
                Mat2::from_angle(-t.rotation.0) * Mat2::from_diagonal(Vec2::from(t.scale.0)),
                Vec2::from(t.offset.0),
            );
            // What is NaN is not in range.
            if !uv_transform.to_cols_array().iter().all(|x| x.abs() <= MAX_TEXTURE_COORDINATE) {
                return Err(format!("{TRANSFORM} has a number beyond {MAX_TEXTURE_COORDINATE:e}; allowed: up to it"));
            }
        }
        if set > 1 {
            self.warn("a texture uses TEXCOORD_2 or higher: it reads TEXCOORD_0");
            set = 0;
        }
        Ok(Some(TextureRef { texture, uv_set: set as usize, uv_transform }))
    }

    /// The bytes of an image as the file has them; adds them to `total`.
    fn encoded(&mut self, number: usize, total: &mut u64) -> Problem<Vec<u8>> {
        let mut count = |bytes: &[u8]| {
            *total += bytes.len() as u64;
            match *total > MAX_ENCODED {
                true => Err(format!("images are too large together; allowed: {MAX_ENCODED} bytes encoded")),
                false => Ok(()),
            }
        };
        let json = &self.buffers.root.images[number];
        match (&json.uri, json.buffer_view) {
            (Some(uri), _) => {
                let bytes = self.files.fetch(uri)?;
                count(&bytes).map(|()| bytes)
            }
            (None, Some(view)) => {
                let (bytes, _) = self.buffers.view(&mut self.files, view)?;
                count(bytes).map(|()| bytes.to_vec())
            }
            (None, None) => Err("it has neither a URI nor a bufferView; allowed: one of them".to_owned()),
        }
    }
}

/// The file's textures and images that materials use, numbered in the order of their first use.
#[derive(Default)]
struct Used<'a> {
    textures: Numbering,
    /// Images of the file, the first of each source.
    images: Vec<usize>,
    /// New number of each image, and of each URI and buffer view.
    image_of: HashMap<usize, usize>,
    image_of_source: HashMap<(Option<&'a str>, Option<usize>), usize>,
}

impl<'a> Used<'a> {
    /// New number of an image; those with the same bytes behind them are one.
    fn image(&mut self, number: usize, json: &'a gltf::json::Image) -> usize {
        if let Some(&index) = self.image_of.get(&number) {
            return index;
        }
        // A URI goes before a buffer view, as in reading.
        let uri = json.uri.as_deref();
        let view = json.buffer_view.filter(|_| uri.is_none()).map(|view| view.value());
        let next = self.images.len();
        let index = *self.image_of_source.entry((uri, view)).or_insert(next);
        if index == next {
            self.images.push(number);
        }
        self.image_of.insert(number, index);
        index
    }
}

#[derive(Default)]
struct Numbering {
    order: Vec<usize>,
    index: HashMap<usize, usize>,
}

impl Numbering {
    /// New number of what the file calls `number`, and whether this is its first use.
    fn index(&mut self, number: usize) -> (usize, bool) {
        let next = self.order.len();
        let index = *self.index.entry(number).or_insert(next);
        if index == next {
            self.order.push(number);
        }
        (index, index == next)
    }
}

/// KHR_texture_transform of a normal or occlusion texture, where the gltf crate does not read it itself.
fn transform(value: Option<&Value>) -> Problem<Option<TextureTransform>> {
    let read = |value: &Value| {
        deserialize::from_value(value.clone())
            .map_err(|e| format!("{TRANSFORM}: {e}; allowed: numbers as the extension has them"))
    };
    value.map(read).transpose()
}

fn sampler(json: &gltf::json::texture::Sampler) -> Problem<Sampler> {
    let wrap = |mode| match mode {
        Checked::Valid(WrappingMode::ClampToEdge) => Ok(Wrap::Clamp),
        Checked::Valid(WrappingMode::MirroredRepeat) => Ok(Wrap::Mirror),
        Checked::Valid(WrappingMode::Repeat) => Ok(Wrap::Repeat),
        Checked::Invalid => Err("a sampler with an unknown wrap mode; allowed: 10497, 33071, 33648".to_owned()),
    };
    let (min_linear, mip_linear) = match json.min_filter {
        None | Some(Checked::Valid(MinFilter::LinearMipmapLinear)) => (true, Some(true)),
        Some(Checked::Valid(MinFilter::LinearMipmapNearest)) => (true, Some(false)),
        Some(Checked::Valid(MinFilter::NearestMipmapLinear)) => (false, Some(true)),
        Some(Checked::Valid(MinFilter::NearestMipmapNearest)) => (false, Some(false)),
        Some(Checked::Valid(MinFilter::Linear)) => (true, None),
        Some(Checked::Valid(MinFilter::Nearest)) => (false, None),
        Some(Checked::Invalid) => {
            return Err("a sampler with an unknown minFilter; allowed: 9728, 9729, 9984 to 9987".to_owned());
        }
    };
    let mag_linear = match json.mag_filter {
        None | Some(Checked::Valid(MagFilter::Linear)) => true,
        Some(Checked::Valid(MagFilter::Nearest)) => false,
        Some(Checked::Invalid) => return Err("a sampler with an unknown magFilter; allowed: 9728, 9729".to_owned()),
    };
    Ok(Sampler { mag_linear, min_linear, mip_linear, wrap_u: wrap(json.wrap_s)?, wrap_v: wrap(json.wrap_t)? })
}

fn decoder(bytes: &[u8]) -> Problem<impl ImageDecoder + '_> {
    // By the content: files lie about the type, and other formats that the crate may know stay shut.
    let format = match image::guess_format(bytes) {
        Ok(format @ (ImageFormat::Png | ImageFormat::Jpeg)) => format,
        _ => return Err("neither PNG nor JPEG; allowed: these".to_owned()),
    };
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    let mut limits = Limits::default();
    limits.max_image_width = Some(MAX_EDGE);
    limits.max_image_height = Some(MAX_EDGE);
    limits.max_alloc = Some(MAX_IMAGE);
    reader.limits(limits);
    let too_large = format!("allowed: PNG or JPEG, at most {MAX_EDGE} texels wide and high");
    let decoder = reader.into_decoder().map_err(|e| format!("{e}; {too_large}"))?;
    let (width, height) = decoder.dimensions();
    match (1..=MAX_EDGE).contains(&width) && (1..=MAX_EDGE).contains(&height) && decoder.total_bytes() <= MAX_IMAGE {
        true => Ok(decoder),
        false => Err(format!("{width}×{height} texels are too large; {too_large}")),
    }
}

fn decode(bytes: &[u8]) -> Problem<Image> {
    let image = DynamicImage::from_decoder(decoder(bytes)?)
        .map_err(|e| format!("cannot be decoded: {e}; allowed: complete PNG or JPEG"))?;
    let image = image.into_rgba8();
    Ok(Image { width: image.width(), height: image.height(), rgba: image.into_raw() })
}
