//! Regular omnidirectional shadow maps of sampled VPLs, a batch at a time within a memory limit.

use std::rc::Rc;

use glam::{Mat3, Vec4};

use crate::gl::{Context, Program, Target, Texture, Uniform, Viewport};
use crate::lattice::Vpl;
use crate::passes::geometry::{DrawView, GpuScene};
use crate::passes::shadow::{ShadowBlock, face_block};
use crate::settings::ShadowMaps as ShadowMapsSettings;
use crate::{Result, shaders};

/// Pass and result: an atlas with the six faces of each VPL's cube, 3 × 2.
pub(crate) struct ShadowMaps {
    program: Program,
    block: Uniform<ShadowBlock>,
    target: Target,
    /// Texels along the edge of a face.
    pub size: u32,
    /// Cubes in a row.
    pub columns: u32,
    /// Cubes that exist at a time.
    pub batch: u32,
}

impl ShadowMaps {
    /// Room for as many cubes as memory and the driver's textures allow, at most `vpls`, at least one.
    pub fn new(context: &Rc<Context>, settings: &ShadowMapsSettings, vpls: u32) -> Result<Self> {
        let size = settings.size;
        let limit = context.info().max_texture_size;
        let bytes = 6 * u64::from(size).pow(2) * 4;
        let within_memory = (u64::from(settings.memory) << 20) / bytes;
        let columns_limit = (limit / (3 * size)).max(1);
        let within_texture = columns_limit * (limit / (2 * size)).max(1);
        let batch = (within_memory as u32).min(within_texture).min(vpls).max(1);
        let columns = (f64::from(batch).sqrt().ceil() as u32).min(columns_limit);
        Ok(Self {
            program: Program::new(context, &shaders::SHADOW)?,
            block: Uniform::new(context)?,
            target: Target::new(context, &[], true, columns * 3 * size, batch.div_ceil(columns) * 2 * size)?,
            size,
            columns,
            batch,
        })
    }

    /// Draws the maps of one batch of VPLs. `far` is the farthest distance between a VPL and a surface, m.
    pub fn run(&self, scene: &GpuScene, vpls: &[Vpl], far: f32) {
        assert!(vpls.len() <= self.batch as usize);
        self.target.clear();
        self.program.bind();
        for (i, vpl) in vpls.iter().enumerate() {
            let (column, row) = (i as u32 % self.columns, i as u32 / self.columns);
            for face in 0..6 {
                let block = face_block(face as usize, vpl.position, Mat3::IDENTITY, far);
                self.block.set(&block);
                let viewport = Viewport {
                    x: (column * 3 + face % 3) * self.size,
                    y: (row * 2 + face / 3) * self.size,
                    width: self.size,
                    height: self.size,
                };
                scene.draw(&DrawView {
                    clip_from_world: block.clip_from_world,
                    viewport,
                    cull_back: false,
                    textures: 1,
                });
            }
        }
    }

    /// Distance over the farthest; 1 where there is nothing.
    pub fn result(&self) -> &Texture {
        self.target.depth()
    }

    /// Where the maps stand, as `common/visibility_shadow_map.glsl` has it; `far` as in [`ShadowMaps::run`].
    pub fn layout(&self, far: f32) -> Vec4 {
        Vec4::new(self.size as f32, self.columns as f32, 1.0 / far, 0.0)
    }
}
