//! What a driver can hold, and what is said when that is too little.

use crate::frame::RenderOptions;
use crate::gl::DriverInfo;
use crate::passes::Ism;
use crate::reflected::MOST_HITS;
use crate::settings::{Model, Settings, Tier};
use crate::{Error, Result};

/// Names the size of the picture when the driver has no memory for it.
pub(crate) fn too_many_pixels(options: &RenderOptions) -> impl FnOnce(Error) -> Error {
    move |error| match error {
        Error::Gl(problem) if problem.contains("out of memory") => Error::Argument {
            what: "size",
            problem: format!("{}x{} is more than the driver can hold ({problem})", options.width, options.height),
            allowed: "a smaller picture".to_owned(),
        },
        other => other,
    }
}

/// Names the setting when the driver has no memory for what it asks for.
pub(crate) fn too_large(key: &'static str, value: u32) -> impl FnOnce(Error) -> Error {
    move |error| match error {
        Error::Gl(problem) => Error::Setting {
            key: key.to_owned(),
            problem: format!("{value} is more than the driver can hold ({problem})"),
            allowed: "a smaller value".to_owned(),
        },
        other => other,
    }
}

/// Refuses pictures and settings that are not allowed or that the driver cannot hold.
pub(crate) fn check(info: &DriverInfo, settings: &Settings, options: &RenderOptions) -> Result<()> {
    check_size(info, options)?;
    settings.check()?;
    check_tier(info, settings)?;
    check_limits(info, settings)
}

/// Refuses more ISMs than fit into the driver's textures: as many as there can be, chance having its limits.
pub(crate) fn check_isms(info: &DriverInfo, settings: &Settings, options: &RenderOptions) -> Result<()> {
    if !settings.visibility.has_isms() || !options.layer.has_indirect_light() {
        return Ok(());
    }
    let (all, fraction) = (vpl_count(settings) as f32, settings.wave.fraction);
    let vpls = all * fraction + 6.0 * (all * fraction * (1.0 - fraction)).sqrt();
    Ism::check(info, &settings.ism, vpls.min(all) as u32)
}

/// Refuses compute shaders where there are none.
fn check_tier(info: &DriverInfo, settings: &Settings) -> Result<()> {
    if settings.tier == Tier::Compute && !info.compute {
        return Err(Error::Setting {
            key: "tier".to_owned(),
            problem: format!("this driver ({}) has no compute shaders of OpenGL 4.3", info.version),
            allowed: "auto, fragment".to_owned(),
        });
    }
    Ok(())
}

/// Refuses pictures that are larger than the driver can draw.
fn check_size(info: &DriverInfo, options: &RenderOptions) -> Result<()> {
    let (width, height) = (options.width, options.height);
    let limit = info.max_viewport.map(|edge| edge.min(info.max_texture_size));
    if width == 0 || height == 0 || width > limit[0] || height > limit[1] {
        return Err(Error::Argument {
            what: "size",
            problem: format!("{width}x{height} cannot be drawn"),
            allowed: format!("1x1 to {}x{} on this driver", limit[0], limit[1]),
        });
    }
    Ok(())
}

/// VPLs that there are at most.
pub(crate) fn vpl_count(settings: &Settings) -> u32 {
    match settings.model {
        Model::Wave => settings.wave.vpls(),
        Model::Reflected => settings.wave.vpls() / settings.wave.shells * settings.reflected.bounces,
    }
}

/// Refuses settings that ask for larger textures than the driver has.
fn check_limits(info: &DriverInfo, settings: &Settings) -> Result<()> {
    let limit = info.max_texture_size;
    let vpls = vpl_count(settings);
    let many = match settings.model {
        Model::Wave => ("wave.shells", settings.wave.shells),
        Model::Reflected => ("reflected.bounces", settings.reflected.bounces),
    };
    let hits = u64::from(vpls) * u64::from(settings.reflected.rays);
    if settings.model == Model::Reflected && hits > MOST_HITS {
        return Err(Error::Setting {
            key: "reflected.rays".to_owned(),
            problem: format!("{} for each of {vpls} VPLs are too many", settings.reflected.rays),
            allowed: format!("{MOST_HITS} rays in all: fewer rays, bounces, or a coarser lattice"),
        });
    }
    for (key, value, needed, limit) in [
        ("shadow.size", settings.shadow.size, settings.shadow.size, limit.min(info.max_cube_size)),
        ("shadow_maps.size", settings.shadow_maps.size, 3 * settings.shadow_maps.size, limit),
        ("ism.surfels", settings.ism.surfels, settings.ism.surfels.div_ceil(512), limit),
        (many.0, many.1, vpls.div_ceil(512), limit),
    ] {
        if needed > limit {
            return Err(Error::Setting {
                key: key.to_owned(),
                problem: format!("{value} needs a texture of {needed} texels"),
                allowed: format!("textures up to {limit} texels on this driver"),
            });
        }
    }
    Ok(())
}
