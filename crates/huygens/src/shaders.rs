//! The shader files, the programs made of them, and the header that makes one source valid on all targets.

use std::borrow::Cow;

use crate::gl::{Context, ProgramSource, Stage};

macro_rules! files {
    ($($name:literal),+ $(,)?) => {
        /// Every file below `shaders/`.
        const FILES: &[(&str, &str)] = &[$(($name, include_str!(concat!("../shaders/", $name)))),+];
    };
}

files![
    "accumulate.comp",
    "accumulate.frag",
    "accumulate_near.comp",
    "accumulate_near.frag",
    "ao.frag",
    "common/accumulate.glsl",
    "common/azimuth.glsl",
    "common/brdf.glsl",
    "common/cube_face.glsl",
    "common/display.glsl",
    "common/frame.glsl",
    "common/gather.glsl",
    "common/gather_range.glsl",
    "common/gather_sum.glsl",
    "common/ism_splat.glsl",
    "common/ism_surfel.glsl",
    "common/ism_tile.glsl",
    "common/light.glsl",
    "common/material.glsl",
    "common/math.glsl",
    "common/mean.glsl",
    "common/motion.glsl",
    "common/motion_none.glsl",
    "common/near.glsl",
    "common/near_before.glsl",
    "common/patch.glsl",
    "common/receiver_plane.glsl",
    "common/reconstruct.glsl",
    "common/reconstruct_group.glsl",
    "common/reproject.glsl",
    "common/shadow_cube.glsl",
    "common/shadow_plane.glsl",
    "common/surface.glsl",
    "common/visibility_dao.glsl",
    "common/visibility_ism.glsl",
    "common/visibility_none.glsl",
    "common/visibility_shadow_map.glsl",
    "common/vpl.glsl",
    "composite.frag",
    "debug_ism.frag",
    "debug_shadow.frag",
    "debug_vpl.frag",
    "depth_extent.frag",
    "direct.frag",
    "direct_emission.frag",
    "full_screen.vert",
    "gather.comp",
    "gather.frag",
    "gather_near.comp",
    "gather_near.frag",
    "gbuffer.frag",
    "geometry.vert",
    "ism.comp",
    "ism_pull.frag",
    "ism_push.frag",
    "ism_splat.frag",
    "ism_splat.vert",
    "lattice_probe.frag",
    "luminance.frag",
    "reconstruct_columns.comp",
    "reconstruct_columns.frag",
    "reconstruct_rows.comp",
    "reconstruct_rows.frag",
    "shadow.frag",
    "shadow.vert",
    "shadow_albedo.frag",
    "tonemap.frag",
];

const FULL_SCREEN: Stage = &["full_screen.vert"];

macro_rules! programs {
    ($($name:ident: $vertex:expr, [$($fragment:literal),+], [$($sampler:literal),*];)+) => {
        $(pub(crate) const $name: ProgramSource = ProgramSource {
            name: stringify!($name),
            vertex: $vertex,
            fragment: &[$($fragment),+],
            compute: &[],
            samplers: &[$($sampler),*],
        };)+

        /// Every program that draws.
        #[cfg(any(test, debug_assertions))]
        pub(crate) const PROGRAMS: &[ProgramSource] = &[$($name),+];
    };
}

programs! {
    GBUFFER: &["common/frame.glsl", "geometry.vert"],
        ["common/math.glsl", "common/frame.glsl", "common/material.glsl", "gbuffer.frag"],
        ["s_base_color", "s_metallic_roughness", "s_normal", "s_occlusion", "s_emissive"];
    SHADOW: &["shadow.vert"], ["common/material.glsl", "shadow.frag"], ["s_base_color"];
    SHADOW_ALBEDO: &["shadow.vert"], ["common/material.glsl", "shadow_albedo.frag"], ["s_base_color"];
    DIRECT_CUBE: FULL_SCREEN,
        ["common/math.glsl", "common/frame.glsl", "common/surface.glsl", "common/brdf.glsl", "common/light.glsl",
         "common/receiver_plane.glsl", "common/shadow_cube.glsl", "direct.frag"],
        ["s_surface", "s_albedo", "s_previous", "s_shadow"];
    DIRECT_PLANE: FULL_SCREEN,
        ["common/math.glsl", "common/frame.glsl", "common/surface.glsl", "common/brdf.glsl", "common/light.glsl",
         "common/shadow_plane.glsl", "direct.frag"],
        ["s_surface", "s_albedo", "s_previous", "s_shadow"];
    DIRECT_EMISSION: FULL_SCREEN,
        ["common/math.glsl", "common/frame.glsl", "common/surface.glsl", "common/brdf.glsl", "common/vpl.glsl",
         "common/patch.glsl", "common/gather.glsl", "common/receiver_plane.glsl",
         "common/visibility_shadow_map.glsl", "common/gather_sum.glsl", "common/gather_range.glsl",
         "direct_emission.frag"],
        ["s_surface", "s_albedo", "s_previous", "s_vpl", "s_atlas"];
    AO: FULL_SCREEN,
        ["common/math.glsl", "common/frame.glsl", "common/surface.glsl", "common/azimuth.glsl", "ao.frag"],
        ["s_surface"];
    LATTICE_PROBE: FULL_SCREEN, ["lattice_probe.frag"], ["s_ray", "s_depth", "s_cube_albedo"];
    DEPTH_EXTENT: FULL_SCREEN, ["common/cube_face.glsl", "depth_extent.frag"], ["s_depth"];
    ISM_SPLAT:
        &["common/math.glsl", "common/vpl.glsl", "common/ism_tile.glsl", "common/ism_splat.glsl",
          "common/ism_surfel.glsl", "ism_splat.vert"],
        ["common/math.glsl", "common/ism_tile.glsl", "common/ism_splat.glsl", "ism_splat.frag"],
        ["s_vpl", "s_surfel"];
    ISM_PULL: FULL_SCREEN, ["ism_pull.frag"], ["s_fine"];
    ISM_PUSH: FULL_SCREEN, ["ism_push.frag"], ["s_fine", "s_coarse"];
    GATHER_NONE: FULL_SCREEN,
        ["common/math.glsl", "common/frame.glsl", "common/surface.glsl", "common/brdf.glsl", "common/vpl.glsl",
         "common/patch.glsl", "common/gather.glsl", "common/visibility_none.glsl", "common/gather_sum.glsl",
         "common/gather_range.glsl", "gather.frag"],
        ["s_surface", "s_albedo", "s_vpl", "s_previous", "s_previous_specular"];
    GATHER_ISM: FULL_SCREEN,
        ["common/math.glsl", "common/frame.glsl", "common/surface.glsl", "common/brdf.glsl", "common/vpl.glsl",
         "common/patch.glsl", "common/gather.glsl", "common/ism_tile.glsl", "common/visibility_ism.glsl",
         "common/gather_sum.glsl", "common/gather_range.glsl", "gather.frag"],
        ["s_surface", "s_albedo", "s_vpl", "s_ism", "s_previous", "s_previous_specular"];
    GATHER_DAO: FULL_SCREEN,
        ["common/math.glsl", "common/frame.glsl", "common/surface.glsl", "common/brdf.glsl", "common/vpl.glsl",
         "common/patch.glsl", "common/gather.glsl", "common/azimuth.glsl", "common/visibility_dao.glsl",
         "common/gather_sum.glsl", "common/gather_range.glsl", "gather.frag"],
        ["s_surface", "s_albedo", "s_vpl", "s_horizons", "s_previous", "s_previous_specular"];
    GATHER_SHADOW_MAP: FULL_SCREEN,
        ["common/math.glsl", "common/frame.glsl", "common/surface.glsl", "common/brdf.glsl", "common/vpl.glsl",
         "common/patch.glsl", "common/gather.glsl", "common/receiver_plane.glsl",
         "common/visibility_shadow_map.glsl", "common/gather_sum.glsl", "common/gather_range.glsl", "gather.frag"],
        ["s_surface", "s_albedo", "s_vpl", "s_atlas", "s_previous", "s_previous_specular"];
    NEAR_NONE: FULL_SCREEN,
        ["common/math.glsl", "common/frame.glsl", "common/surface.glsl", "common/mean.glsl", "common/brdf.glsl",
         "common/vpl.glsl", "common/patch.glsl", "common/gather.glsl", "common/visibility_none.glsl",
         "common/gather_sum.glsl", "common/near.glsl", "gather_near.frag"],
        ["s_surface", "s_albedo", "s_vpl", "s_near", "s_previous"];
    NEAR_ISM: FULL_SCREEN,
        ["common/math.glsl", "common/frame.glsl", "common/surface.glsl", "common/mean.glsl", "common/brdf.glsl",
         "common/vpl.glsl", "common/patch.glsl", "common/gather.glsl", "common/ism_tile.glsl",
         "common/visibility_ism.glsl", "common/gather_sum.glsl", "common/near.glsl", "gather_near.frag"],
        ["s_surface", "s_albedo", "s_vpl", "s_near", "s_ism", "s_previous"];
    NEAR_DAO: FULL_SCREEN,
        ["common/math.glsl", "common/frame.glsl", "common/surface.glsl", "common/mean.glsl", "common/brdf.glsl",
         "common/vpl.glsl", "common/patch.glsl", "common/gather.glsl", "common/azimuth.glsl",
         "common/visibility_dao.glsl", "common/gather_sum.glsl", "common/near.glsl", "gather_near.frag"],
        ["s_surface", "s_albedo", "s_vpl", "s_near", "s_horizons", "s_previous"];
    NEAR_SHADOW_MAP: FULL_SCREEN,
        ["common/math.glsl", "common/frame.glsl", "common/surface.glsl", "common/mean.glsl", "common/brdf.glsl",
         "common/vpl.glsl", "common/patch.glsl", "common/gather.glsl", "common/receiver_plane.glsl",
         "common/visibility_shadow_map.glsl", "common/gather_sum.glsl", "common/near.glsl", "gather_near.frag"],
        ["s_surface", "s_albedo", "s_vpl", "s_near", "s_atlas", "s_previous"];
    ACCUMULATE_NEAR: FULL_SCREEN,
        ["common/math.glsl", "common/frame.glsl", "common/surface.glsl", "common/mean.glsl", "common/reproject.glsl",
         "common/motion_none.glsl", "common/accumulate.glsl", "common/near_before.glsl", "accumulate_near.frag"],
        ["s_surface", "s_sum", "s_sum_specular", "s_mean", "s_mean_surface", "s_near_sum"];
    ACCUMULATE: FULL_SCREEN,
        ["common/math.glsl", "common/frame.glsl", "common/surface.glsl", "common/mean.glsl", "common/reproject.glsl",
         "common/motion.glsl", "common/accumulate.glsl", "accumulate.frag"],
        ["s_surface", "s_sum", "s_sum_specular", "s_mean", "s_mean_surface", "s_emission", "s_motion"];
    RECONSTRUCT_ROWS: FULL_SCREEN,
        ["common/math.glsl", "common/frame.glsl", "common/surface.glsl", "common/mean.glsl", "common/reconstruct.glsl",
         "reconstruct_rows.frag"],
        ["s_surface", "s_mean", "s_mean_surface"];
    RECONSTRUCT_COLUMNS: FULL_SCREEN,
        ["common/math.glsl", "common/frame.glsl", "common/surface.glsl", "common/mean.glsl", "common/reconstruct.glsl",
         "reconstruct_columns.frag"],
        ["s_surface", "s_mean", "s_mean_surface", "s_near_sum"];
    COMPOSITE: FULL_SCREEN,
        ["common/math.glsl", "common/frame.glsl", "common/surface.glsl", "composite.frag"],
        ["s_surface", "s_albedo", "s_emission", "s_direct", "s_irradiance", "s_specular", "s_previous", "s_ambient"];
    LUMINANCE: FULL_SCREEN, ["luminance.frag"], ["s_value"];
    TONEMAP: FULL_SCREEN, ["common/display.glsl", "tonemap.frag"], ["s_value"];
    DEBUG_SHADOW: FULL_SCREEN, ["common/cube_face.glsl", "debug_shadow.frag"], ["s_depth"];
    DEBUG_ISM: FULL_SCREEN, ["debug_ism.frag"], ["s_ism"];
    DEBUG_VPL: FULL_SCREEN, ["common/vpl.glsl", "common/display.glsl", "debug_vpl.frag"], ["s_vpl"];
}

macro_rules! compute_programs {
    ($($name:ident: [$($file:literal),+], [$($sampler:literal),*];)+) => {
        $(pub(crate) const $name: ProgramSource = ProgramSource {
            name: stringify!($name),
            vertex: &[],
            fragment: &[],
            compute: &[$($file),+],
            samplers: &[$($sampler),*],
        };)+

        /// Every program that computes.
        #[cfg(any(test, debug_assertions))]
        pub(crate) const COMPUTE_PROGRAMS: &[ProgramSource] = &[$($name),+];
    };
}

compute_programs! {
    COMPUTE_ISM:
        ["common/math.glsl", "common/vpl.glsl", "common/ism_tile.glsl", "common/ism_splat.glsl",
         "common/ism_surfel.glsl", "ism.comp"],
        ["s_vpl", "s_surfel"];
    COMPUTE_GATHER_NONE:
        ["common/math.glsl", "common/frame.glsl", "common/surface.glsl", "common/brdf.glsl", "common/vpl.glsl",
         "common/patch.glsl", "common/gather.glsl", "common/visibility_none.glsl", "common/gather_sum.glsl",
         "common/gather_range.glsl", "gather.comp"],
        ["s_surface", "s_albedo", "s_vpl"];
    COMPUTE_GATHER_ISM:
        ["common/math.glsl", "common/frame.glsl", "common/surface.glsl", "common/brdf.glsl", "common/vpl.glsl",
         "common/patch.glsl", "common/gather.glsl", "common/ism_tile.glsl", "common/visibility_ism.glsl",
         "common/gather_sum.glsl", "common/gather_range.glsl", "gather.comp"],
        ["s_surface", "s_albedo", "s_vpl", "s_ism"];
    COMPUTE_GATHER_DAO:
        ["common/math.glsl", "common/frame.glsl", "common/surface.glsl", "common/brdf.glsl", "common/vpl.glsl",
         "common/patch.glsl", "common/gather.glsl", "common/azimuth.glsl", "common/visibility_dao.glsl",
         "common/gather_sum.glsl", "common/gather_range.glsl", "gather.comp"],
        ["s_surface", "s_albedo", "s_vpl", "s_horizons"];
    COMPUTE_GATHER_SHADOW_MAP:
        ["common/math.glsl", "common/frame.glsl", "common/surface.glsl", "common/brdf.glsl", "common/vpl.glsl",
         "common/patch.glsl", "common/gather.glsl", "common/receiver_plane.glsl",
         "common/visibility_shadow_map.glsl", "common/gather_sum.glsl", "common/gather_range.glsl", "gather.comp"],
        ["s_surface", "s_albedo", "s_vpl", "s_atlas"];
    COMPUTE_NEAR_NONE:
        ["common/math.glsl", "common/frame.glsl", "common/surface.glsl", "common/mean.glsl", "common/brdf.glsl",
         "common/vpl.glsl", "common/patch.glsl", "common/gather.glsl", "common/visibility_none.glsl",
         "common/gather_sum.glsl", "common/near.glsl", "gather_near.comp"],
        ["s_surface", "s_albedo", "s_vpl", "s_near", "s_previous"];
    COMPUTE_NEAR_ISM:
        ["common/math.glsl", "common/frame.glsl", "common/surface.glsl", "common/mean.glsl", "common/brdf.glsl",
         "common/vpl.glsl", "common/patch.glsl", "common/gather.glsl", "common/ism_tile.glsl",
         "common/visibility_ism.glsl", "common/gather_sum.glsl", "common/near.glsl", "gather_near.comp"],
        ["s_surface", "s_albedo", "s_vpl", "s_near", "s_ism", "s_previous"];
    COMPUTE_NEAR_DAO:
        ["common/math.glsl", "common/frame.glsl", "common/surface.glsl", "common/mean.glsl", "common/brdf.glsl",
         "common/vpl.glsl", "common/patch.glsl", "common/gather.glsl", "common/azimuth.glsl",
         "common/visibility_dao.glsl", "common/gather_sum.glsl", "common/near.glsl", "gather_near.comp"],
        ["s_surface", "s_albedo", "s_vpl", "s_near", "s_horizons", "s_previous"];
    COMPUTE_NEAR_SHADOW_MAP:
        ["common/math.glsl", "common/frame.glsl", "common/surface.glsl", "common/mean.glsl", "common/brdf.glsl",
         "common/vpl.glsl", "common/patch.glsl", "common/gather.glsl", "common/receiver_plane.glsl",
         "common/visibility_shadow_map.glsl", "common/gather_sum.glsl", "common/near.glsl", "gather_near.comp"],
        ["s_surface", "s_albedo", "s_vpl", "s_near", "s_atlas", "s_previous"];
    COMPUTE_ACCUMULATE_NEAR:
        ["common/math.glsl", "common/frame.glsl", "common/surface.glsl", "common/mean.glsl", "common/reproject.glsl",
         "common/motion_none.glsl", "common/accumulate.glsl", "common/near_before.glsl", "accumulate_near.comp"],
        ["s_surface", "s_sum", "s_sum_specular", "s_mean", "s_mean_surface", "s_near_sum"];
    COMPUTE_ACCUMULATE:
        ["common/math.glsl", "common/frame.glsl", "common/surface.glsl", "common/mean.glsl", "common/reproject.glsl",
         "common/motion.glsl", "common/accumulate.glsl", "accumulate.comp"],
        ["s_surface", "s_sum", "s_sum_specular", "s_mean", "s_mean_surface", "s_emission", "s_motion"];
    COMPUTE_RECONSTRUCT_ROWS:
        ["common/math.glsl", "common/frame.glsl", "common/surface.glsl", "common/mean.glsl", "common/reconstruct.glsl",
         "common/reconstruct_group.glsl", "reconstruct_rows.comp"],
        ["s_surface", "s_mean", "s_mean_surface"];
    COMPUTE_RECONSTRUCT_COLUMNS:
        ["common/math.glsl", "common/frame.glsl", "common/surface.glsl", "common/mean.glsl", "common/reconstruct.glsl",
         "common/reconstruct_group.glsl", "reconstruct_columns.comp"],
        ["s_surface", "s_mean", "s_mean_surface", "s_near_sum"];
}

/// What a stage is compiled for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Target {
    Core,
    Es,
    /// Compute shaders of OpenGL 4.3.
    Compute,
}

impl Target {
    /// For the stages with which a context draws.
    pub fn of(context: &Context) -> Self {
        if context.info().es { Self::Es } else { Self::Core }
    }
}

/// Names and texts of the shader files.
pub(crate) struct Texts(Vec<(&'static str, Cow<'static, str>)>);

impl Texts {
    /// Those that are in the library.
    pub fn embedded() -> Self {
        Self(FILES.iter().map(|&(name, text)| (name, Cow::Borrowed(text))).collect())
    }

    /// Those in a folder.
    #[cfg(debug_assertions)]
    pub fn read(folder: &std::path::Path) -> crate::Result<Self> {
        let read = |&(name, _): &(&'static str, &str)| {
            let path = folder.join(name);
            match std::fs::read_to_string(&path) {
                Ok(text) => Ok((name, Cow::Owned(text))),
                Err(error) => Err(crate::Error::File { path, problem: error.to_string() }),
            }
        };
        FILES.iter().map(read).collect::<crate::Result<_>>().map(Self)
    }

    fn of(&self, file: &str) -> &str {
        self.0.iter().find(|(name, _)| *name == file).map_or("", |(_, text)| text)
    }
}

/// The text of a stage: the target's header, then the files. `#line` numbers them, so that a message can be traced.
pub(crate) fn assemble(texts: &Texts, target: Target, files: &[&str]) -> String {
    let mut text = String::from(match target {
        Target::Core => "#version 330 core\n",
        Target::Es => "#version 300 es\nprecision highp float;\nprecision highp int;\nprecision highp sampler2D;\n",
        Target::Compute => "#version 430 core\n",
    });
    for (number, file) in files.iter().enumerate() {
        text += &format!("#line 1 {number}\n{}", texts.of(file));
    }
    text
}

/// A driver's message with file numbers (`0:12` or `0(12)`) replaced by names.
pub(crate) fn name_lines(log: &str, files: &[&str]) -> String {
    let named = log.lines().map(|line| {
        let number = files
            .iter()
            .enumerate()
            .find(|(i, _)| line.strip_prefix(&i.to_string()).is_some_and(|rest| rest.starts_with([':', '('])));
        match number {
            Some((i, file)) => format!("{file}{}", &line[i.to_string().len()..]),
            None => line.to_owned(),
        }
    });
    named.collect::<Vec<_>>().join("\n")
}
