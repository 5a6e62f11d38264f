//! The VPL texture, which every later pass reads.

use std::rc::Rc;

use crate::Result;
use crate::gl::{Context, Format, Texture};
use crate::lattice::{Emission, Vpl};

/// VPLs in a row of the texture.
const ROW: usize = 512;

/// The VPLs that are active: four texels each, as `common/vpl.glsl` has them, RGBA32F.
pub(crate) struct VplTexture {
    pub texture: Texture,
    pub count: u32,
}

impl VplTexture {
    pub fn new(context: &Rc<Context>, vpls: &[Vpl]) -> Result<Self> {
        let rows = vpls.len().div_ceil(ROW).max(1);
        let mut texels = vec![[0f32; 4]; ROW * 4 * rows];
        for (texel, vpl) in texels.chunks_exact_mut(4).zip(vpls) {
            texel[0] = vpl.position.extend(vpl.d_min).to_array();
            texel[1] = vpl.direction.extend((vpl.emission == Emission::Lambertian) as u32 as f32).to_array();
            texel[2] = vpl.intensity.extend(vpl.near()).to_array();
            texel[3] = vpl.extent;
        }
        let (width, height) = (ROW as u32 * 4, rows as u32);
        let pixels = Some(bytemuck::cast_slice(&texels));
        let texture = Texture::with_pixels(context, Format::Rgba32F, width, height, pixels)?;
        Ok(Self { texture, count: vpls.len() as u32 })
    }
}
