//! The VPL texture, which every later pass reads.

use std::rc::Rc;

use crate::Result;
use crate::gl::{Context, Format, Texture};
use crate::lattice::{Emission, Vpl};
use crate::passes::near::{Lists, Near};
use crate::scene::Bounds;

/// VPLs in a row of the texture.
const ROW: usize = 512;

/// The VPLs that are active: four texels each, as `common/vpl.glsl` has them, RGBA32F.
pub(crate) struct VplTexture {
    pub texture: Texture,
    pub count: u32,
    /// Lists of those that are near, if they are asked for and there are any.
    pub near: Option<Near>,
    /// Distance, m, within which each VPL is near; 0 for those that are in no list.
    reaches: Vec<f32>,
}

impl VplTexture {
    /// With lists of near VPLs if `listed` gives the bounds of the scene.
    pub fn new(context: &Rc<Context>, vpls: &[Vpl], listed: Option<&Bounds>) -> Result<Self> {
        let lists = listed.map(|bounds| Lists::new(vpls, bounds));
        let near = lists.as_ref().map(|lists| Near::new(context, lists)).transpose()?.flatten();
        let reaches = lists.map_or_else(|| vec![0.0; vpls.len()], |lists| lists.reaches);
        Ok(Self { texture: texture(context, vpls, &reaches)?, count: vpls.len() as u32, near, reaches })
    }

    /// Takes other intensities of the same VPLs.
    pub fn relight(&mut self, context: &Rc<Context>, vpls: &[Vpl]) -> Result<()> {
        self.texture = texture(context, vpls, &self.reaches)?;
        Ok(())
    }
}

fn texture(context: &Rc<Context>, vpls: &[Vpl], reaches: &[f32]) -> Result<Texture> {
    let rows = vpls.len().div_ceil(ROW).max(1);
    let mut texels = vec![[0f32; 4]; ROW * 4 * rows];
    for (i, (texel, vpl)) in texels.chunks_exact_mut(4).zip(vpls).enumerate() {
        let near = match vpl.emission {
            Emission::Wavelet => -1.0,
            Emission::Lambertian => vpl.near(),
        };
        // Whether it gives light is told by the first two.
        texel[0] = vpl.position.extend(reaches[i]).to_array();
        texel[1] = vpl.direction.extend(near).to_array();
        texel[2] = vpl.intensity.extend(vpl.d_min).to_array();
        texel[3] = vpl.extent;
    }
    let (width, height) = (ROW as u32 * 4, rows as u32);
    let pixels = Some(bytemuck::cast_slice(&texels));
    Texture::with_pixels(context, Format::Rgba32F, width, height, pixels)
}
