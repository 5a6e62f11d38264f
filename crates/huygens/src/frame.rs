//! What a caller asks of a frame and what it gets back.

use serde::Serialize;

use crate::lattice::Vpl;
use crate::{Camera, Error, Result};

/// Which part of the light, or which intermediate, a picture shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layer {
    /// Radiance: direct and indirect.
    Final,
    /// Radiance emitted by surfaces or reflected straight from the lights.
    Direct,
    /// Radiance that the VPLs bring: `Final` = `Direct` + `Indirect`.
    Indirect,
    /// Linear base colour.
    Albedo,
    /// Shading normal, world space, components −1…1.
    Normal,
    /// Distance from the camera's plane along its axis, metres; 0 where there is no surface.
    Depth,
    /// Ambient visibility, 0…1: the share of the cosine-weighted hemisphere that nothing near hides (setting
    /// `ao.radius`); 0 where there is no surface.
    Ao,
}

impl Layer {
    /// Every layer, in the order in which lists show them.
    pub const ALL: [Layer; 7] =
        [Layer::Final, Layer::Direct, Layer::Indirect, Layer::Albedo, Layer::Normal, Layer::Depth, Layer::Ao];

    /// The name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Layer::Final => "final",
            Layer::Direct => "direct",
            Layer::Indirect => "indirect",
            Layer::Albedo => "albedo",
            Layer::Normal => "normal",
            Layer::Depth => "depth",
            Layer::Ao => "ao",
        }
    }

    /// Whether the light of the VPLs shows in it.
    pub(crate) fn has_indirect_light(self) -> bool {
        matches!(self, Layer::Final | Layer::Indirect)
    }

    /// Whether its values are radiance, which an exposure makes bright.
    pub fn is_radiance(self) -> bool {
        matches!(self, Layer::Final | Layer::Direct | Layer::Indirect)
    }

    /// The layer with that name.
    pub fn from_name(name: &str) -> Result<Self> {
        Self::ALL.into_iter().find(|layer| layer.name() == name).ok_or_else(|| Error::Argument {
            what: "layer",
            problem: format!("`{name}` is not known"),
            allowed: Self::ALL.map(Layer::name).join(", "),
        })
    }
}

/// How radiance becomes brightness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Exposure {
    /// The geometric mean of the picture's luminance becomes 0.18 (Reinhard et al. 2002), or its mean 0.4 if that is
    /// darker. Black does not count.
    Auto,
    /// Radiance is multiplied by 2 to this power.
    Ev(f32),
}

/// What to render.
#[derive(Clone, Debug)]
pub struct RenderOptions {
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// Where from.
    pub camera: Camera,
    /// What to show.
    pub layer: Layer,
    /// Brightness of the display picture; radiance is not touched.
    pub exposure: Exposure,
    /// Frames to average, at least 1. The first samples pixel centres, the others spread over the pixel.
    pub frames: u32,
    /// Seed of every random choice.
    pub seed: u32,
}

impl RenderOptions {
    /// One frame of the final light with automatic exposure.
    pub fn new(width: u32, height: u32, camera: Camera) -> Self {
        Self { width, height, camera, layer: Layer::Final, exposure: Exposure::Auto, frames: 1, seed: 0 }
    }
}

/// How far a render has come.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// What is being done, for people: the name of a pass.
    pub pass: &'static str,
    /// Share of the whole render that is done, 0…1; never falls.
    pub fraction: f32,
}

/// What [`Renderer::show`](crate::Renderer::show) shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shown {
    /// 8-bit sRGB, first row at the bottom. It belongs to the renderer, which draws the next frames to the same one,
    /// of whatever size.
    pub texture: glow::Texture,
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// Exposure, EV; an automatic one is that of a frame before.
    pub exposure_ev: f32,
    /// Whether another frame of the same would change nothing.
    pub settled: bool,
}

/// An intermediate of a frame, for [`Renderer::show_debug`](crate::Renderer::show_debug).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DebugView {
    /// The cube shadow map around the first light, in light space: the faces +x, +y, +z above −x, −y, −z, each as a cube
    /// map has it. Distance over the farthest that the map holds in grey; white where there is nothing. What is behind a
    /// light that shines to one side alone is not drawn.
    ShadowMap,
    /// The imperfect shadow maps of all VPLs, tile by tile from the upper left, in their order. Distance over the
    /// farthest that the maps hold in grey; white where there is nothing.
    IsmAtlas,
    /// The imperfect shadow map of the VPL with that index in [`Renderer::vpls`](crate::Renderer::vpls).
    IsmTile(u32),
    /// The texture of the VPLs, in lines from the top; four texels for each VPL: position within the scene's bounds,
    /// direction, intensity over the greatest, tone mapped, and extent over the scene's radius.
    VplTexture,
}

/// A picture that was rendered.
#[derive(Clone, Debug)]
pub struct Rendered {
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// The layer's linear values, rows from the top: radiance in W/(m² sr), or what [`Layer`] says.
    pub linear: Vec<[f32; 3]>,
    /// The layer as a display shows it, sRGB with alpha 255, rows from the top: exposed and tone mapped, or for
    /// albedo, normal and depth mapped to 0…1.
    pub display: Vec<[u8; 4]>,
    /// What was done.
    pub stats: Stats,
    /// The VPLs that lit the last frame.
    pub vpls: Vec<Vpl>,
}

/// Time of one pass, the last time that it ran.
#[derive(Clone, Debug, Serialize)]
pub struct PassTime {
    /// The pass.
    pub name: &'static str,
    /// Milliseconds on the GPU; `None` where the driver has no timer queries.
    pub gpu_ms: Option<f64>,
    /// Milliseconds on the CPU.
    pub cpu_ms: f64,
}

/// How often things were made since [`Renderer::render`](crate::Renderer::render) was called last: what did not
/// change is kept.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Rebuilds {
    /// Uploads of the scene, since the renderer was made.
    pub scene: u64,
    /// Shadow maps: of lights, and of VPLs and points of emissive surfaces one for each.
    pub shadow_maps: u64,
    /// Sets of VPLs.
    pub vpls: u64,
    /// Sets of imperfect shadow maps.
    pub isms: u64,
}

/// Numbers about a render, written by `--stats`.
#[derive(Clone, Debug, Serialize)]
pub struct Stats {
    /// The driver's name for the device.
    pub driver: String,
    /// OpenGL version as the driver reports it.
    pub version: String,
    /// Name of the scene.
    pub scene: String,
    /// Width and height, pixels.
    pub size: [u32; 2],
    /// Frames averaged.
    pub frames: u32,
    /// Seed.
    pub seed: u32,
    /// Setting `model`.
    pub model: &'static str,
    /// Setting `visibility`.
    pub visibility: &'static str,
    /// Rays of the lattice.
    pub rays: usize,
    /// Shells of the lattice.
    pub shells: u32,
    /// VPLs of the lattice, rays times shells, or of all generations of reflected waves.
    pub vpls: usize,
    /// VPLs that lit the last frame (after fraction, sampling and those that carry nothing).
    pub active_vpls: usize,
    /// Depth of the scene in the light's shadow map, m.
    pub scene_depth_m: f32,
    /// Distance of each shell from the light, m (with `wave.depth = "ray"` for a ray as deep as the scene).
    pub shell_distances_m: Vec<f32>,
    /// Attenuation a of each shell.
    pub attenuation: Vec<f32>,
    /// Albedo that the light sees on average.
    pub mean_albedo: f32,
    /// Share of reflected light that is reflected once more, as the energy rule has it.
    pub later_albedo: f32,
    /// Flux of the primary light, W, summed over the three channels; with reflected waves of all lights and emissive
    /// surfaces.
    pub light_flux_w: f64,
    /// Flux that all VPLs emit, W, summed over the three channels.
    pub lattice_flux_w: f64,
    /// Lights that shine directly.
    pub lights: usize,
    /// Surfels of the scene; 0 where none were needed.
    pub surfels: usize,
    /// Edge of an ISM tile, texels; 0 where there is none.
    pub ism_tile: u32,
    /// Triangles drawn.
    pub triangles: usize,
    /// Exposure that was used, EV (radiance times 2 to this power).
    pub exposure_ev: f32,
    /// How often things were made.
    pub rebuilds: Rebuilds,
    /// Passes in the order in which they ran.
    pub passes: Vec<PassTime>,
    /// Sum of `passes[].gpu_ms`; `None` where the driver has no timer queries.
    pub gpu_ms: Option<f64>,
    /// Wall-clock time of the last frame, ms. Passes that ran in the first frame alone are not in it.
    pub frame_ms: f64,
    /// Wall-clock time of the whole render, ms.
    pub total_ms: f64,
}
