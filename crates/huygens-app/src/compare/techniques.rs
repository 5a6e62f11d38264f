//! The techniques that are compared: what the GPU renders, and constant ambient terms at their best.

use huygens::reference::gather::{self, Sum};
use huygens::reference::{Surfaces, tonemap};
use huygens::settings::{Shadow, Visibility};
use huygens::{Layer, Progress, RenderOptions, Rendered, Renderer, Scene, Settings};

use super::Reference;
use crate::cli::CompareArgs;
use crate::progress::Bar;
use crate::{Failure, metrics, reference};

/// Names on the command line, in the order of tables.
pub const TECHNIQUES: [&str; 12] =
    ["direct", "ambient", "ambient-ao", "none", "ism", "ao", "dao", "shadow_maps", "mixed", "thesis", "wave", RAY_CAST];

/// The one that is left out unless asked for where there are several frames: it samples the centres of pixels alone.
const RAY_CAST: &str = "ray_cast";

/// How a technique makes indirect light.
enum Kind {
    /// Not at all.
    Direct,
    /// The albedo times one number, which is chosen for the lowest FLIP on this very picture.
    Ambient,
    /// The same, times ambient occlusion.
    AmbientAo,
    /// As the library does with these settings.
    Vpls(Box<Settings>),
    /// The VPLs of these settings, summed on the CPU with rays that find what hides them, with the path tracer's direct
    /// light: no shadow map has a part in it.
    RayCast(Box<Settings>),
}

/// Something to compare.
pub struct Technique {
    name: String,
    about: String,
    kind: Kind,
}

/// A picture: linear radiance, rows from the top.
pub struct Shot {
    pub seen: Vec<[f32; 3]>,
    /// The indirect part of it.
    pub indirect: Vec<[f32; 3]>,
}

impl Shot {
    pub fn new(direct: &[[f32; 3]], indirect: Vec<[f32; 3]>) -> Self {
        Self { seen: reference::sum(direct, &indirect), indirect }
    }
}

/// What a technique made.
pub struct Outcome {
    pub name: String,
    pub about: String,
    pub shot: Shot,
    /// See [`Technique`].
    pub scale: Option<f64>,
    /// Wall-clock time of the last frame.
    pub frame_ms: Option<f64>,
    /// For the VPLs with rays: from the path tracer's light to the GPU's, step by step.
    pub steps: Vec<Step>,
}

/// One approximation: the picture without it and with it, all else the same.
pub struct Step {
    pub name: &'static str,
    pub about: String,
    /// `None`: the reference.
    pub before: Option<Shot>,
    pub after: Shot,
}

impl Technique {
    /// Its name in tables and files.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The settings that it is rendered with.
    pub fn settings<'a>(&'a self, base: &'a Settings) -> &'a Settings {
        match &self.kind {
            Kind::Vpls(settings) | Kind::RayCast(settings) => settings,
            Kind::Direct | Kind::Ambient | Kind::AmbientAo => base,
        }
    }

    /// The techniques that the arguments ask for; those that are a visibility have the settings `base` but for it.
    pub fn of(arguments: &CompareArgs, base: &Settings) -> Result<Vec<Self>, Failure> {
        let several = arguments.common.frames.averaged() > 1;
        let all = || TECHNIQUES.into_iter().filter(|&name| !several || name != RAY_CAST).map(str::to_owned).collect();
        let mut techniques = Vec::new();
        for name in arguments.techniques.clone().unwrap_or_else(all) {
            let (about, kind) = match name.as_str() {
                "direct" => ("direct light alone".to_owned(), Kind::Direct),
                "ambient" => ("direct light and the albedo times one number, the best".to_owned(), Kind::Ambient),
                "ambient-ao" => (
                    "direct light and the albedo times ambient occlusion times one number, the best".to_owned(),
                    Kind::AmbientAo,
                ),
                "thesis" | "wave" => (format!("preset {name}"), Kind::Vpls(Box::new(Settings::preset(&name)?))),
                RAY_CAST if several => {
                    let what = format_args!("technique {RAY_CAST}").to_string();
                    return Err(Failure::bad_input(what, "it samples the centres of pixels alone", "--frames 1"));
                }
                RAY_CAST => (
                    "the VPLs and direct light, with rays for what hides them".to_owned(),
                    Kind::RayCast(Box::new(base.clone())),
                ),
                visibility => {
                    let mut settings = base.clone();
                    settings.set("visibility", visibility)?;
                    (format!("visibility {visibility}"), Kind::Vpls(Box::new(settings)))
                }
            };
            techniques.push(Self { name, about, kind });
        }
        for variant in &arguments.variants {
            let mut settings = base.clone();
            for (key, value) in &variant.set {
                settings.set(key, value)?;
            }
            let set: Vec<String> = variant.set.iter().map(|(key, value)| format!("{key}={value}")).collect();
            let (name, about) = (variant.label.clone(), set.join(", "));
            techniques.push(Self { name, about, kind: Kind::Vpls(Box::new(settings)) });
        }
        for (i, technique) in techniques.iter().enumerate() {
            // `NAME-flip.png` is a heat map.
            let taken = technique.name == "reference" || technique.name.ends_with("-flip");
            if taken || techniques[..i].iter().any(|other| other.name == technique.name) {
                let what = format_args!("technique {}", technique.name).to_string();
                return Err(Failure::bad_input(what, "the name is taken", "each name once"));
            }
        }
        Ok(techniques)
    }
}

/// Renders all techniques, in order.
pub fn render(
    renderer: &mut Renderer,
    scene: &Scene,
    base: &Settings,
    options: &RenderOptions,
    techniques: &[Technique],
    reference: &Reference,
    quiet: bool,
) -> Result<Vec<Outcome>, Failure> {
    let mut picture = |settings: &Settings, layer: Layer| {
        let mut bar = Bar::new(quiet, "rendering");
        let options = RenderOptions { layer, ..options.clone() };
        renderer.render(scene, settings, &options, &mut |progress| bar.update(progress))
    };
    // Direct light differs where settings of its shadows do. The first frame of all compiles the shaders; no times of it.
    let plain = |settings: &Settings| Settings { visibility: Visibility::None, ..settings.clone() };
    picture(&plain(base), Layer::Direct)?;
    let mut directs: Vec<(&Shadow, Rendered)> = Vec::new();
    let size = [options.width, options.height];
    let mut outcomes = Vec::new();
    for technique in techniques {
        let settings = technique.settings(base);
        let found = directs.iter().position(|(shadow, _)| **shadow == settings.shadow);
        let direct = match found {
            Some(found) => &directs[found].1,
            None => {
                directs.push((&settings.shadow, picture(&plain(settings), Layer::Direct)?));
                &directs[directs.len() - 1].1
            }
        };
        let mut steps = Vec::new();
        let (indirect, scale, frame_ms) = match &technique.kind {
            Kind::Direct => (vec![[0.0; 3]; direct.linear.len()], None, Some(direct.stats.frame_ms)),
            Kind::Ambient | Kind::AmbientAo => {
                let mut term = picture(base, Layer::Albedo)?.linear;
                if matches!(technique.kind, Kind::AmbientAo) {
                    let open = picture(base, Layer::Ao)?.linear;
                    for (color, open) in term.iter_mut().zip(open) {
                        *color = color.map(|c| c * open[0]);
                    }
                }
                let _bar = Bar::new(quiet, format_args!("{}: finding the best scale", technique.name));
                let (indirect, scale) = best_scale(size, reference, &direct.linear, &term)?;
                (indirect, Some(scale), None)
            }
            Kind::Vpls(settings) => {
                let rendered = picture(settings, Layer::Indirect)?;
                (rendered.linear, None, Some(rendered.stats.frame_ms))
            }
            Kind::RayCast(settings) => {
                let open = picture(&plain(settings), Layer::Indirect)?;
                let surfaces = Surfaces::new(scene);
                let sum = |occlusion: bool| {
                    let mut bar = Bar::new(quiet, "casting rays to VPLs");
                    let sum = Sum { occlusion, specular: settings.sums_specular() };
                    gather::Pictures::new(&surfaces, &open.vpls, options, sum, &mut |fraction| {
                        bar.update(Progress { pass: "casting rays to VPLs", fraction });
                    })
                };
                let exact = sum(true);
                let visibility = settings.visibility.name();
                let mapped = picture(settings, Layer::Indirect)?.linear;
                let shot = |indirect: &[[f32; 3]]| Shot::new(&reference.direct, indirect.to_vec());
                let step = |name, about: &str, before, after: &[[f32; 3]]| Step {
                    name,
                    about: about.to_owned(),
                    before,
                    after: shot(after),
                };
                steps = vec![
                    step("VPLs", "so many VPLs in place of all light", None, &exact.unbounded),
                    step("bound", "the bound of each VPL", Some(shot(&exact.unbounded)), &exact.bounded),
                    step("visibility", &format!("{visibility} in place of rays"), Some(shot(&exact.bounded)), &mapped),
                    step(
                        "gather",
                        "the GPU's sum in place of the CPU's",
                        Some(shot(&sum(false).bounded)),
                        &open.linear,
                    ),
                    Step {
                        name: "direct",
                        about: "the GPU's direct light in place of the path tracer's".to_owned(),
                        before: Some(shot(&mapped)),
                        after: Shot::new(&direct.linear, mapped),
                    },
                ];
                (exact.bounded, None, None)
            }
        };
        let direct = if matches!(technique.kind, Kind::RayCast(_)) { &reference.direct } else { &direct.linear };
        outcomes.push(Outcome {
            name: technique.name.clone(),
            about: technique.about.clone(),
            shot: Shot::new(direct, indirect),
            scale,
            frame_ms,
            steps,
        });
    }
    Ok(outcomes)
}

/// `term` times the number that gives the lowest FLIP, and that number: the best of a grid of factors on the one that
/// has the energy of the reference, then golden-section search around it.
fn best_scale(
    size: [u32; 2],
    reference: &Reference,
    direct: &[[f32; 3]],
    term: &[[f32; 3]],
) -> Result<(Vec<[f32; 3]>, f64), Failure> {
    let scaled = |scale: f64| -> Vec<[f32; 3]> { term.iter().map(|c| c.map(|v| v * scale as f32)).collect() };
    let error = |scale: f64| -> Result<f64, Failure> {
        let display = tonemap::display(&reference::sum(direct, &scaled(scale)), reference.exposure_ev);
        Ok(metrics::mean(&metrics::flip(size, &reference.display, &display)?))
    };
    let total = |picture: &[[f32; 3]]| picture.as_flattened().iter().map(|&v| f64::from(v)).sum::<f64>();
    let even = total(&reference.shot.indirect) / total(term);
    // Without indirect light, or where nothing reflects any.
    if even <= 0.0 || !even.is_finite() {
        return Ok((scaled(0.0), 0.0));
    }
    // Factors 0, and 1/16 to 4 in steps of √2.
    let none = error(0.0)?;
    let mut best = (f64::INFINITY, 0.0);
    for step in -8..=4 {
        let exponent = 0.5 * f64::from(step);
        let error = error(even * exponent.exp2())?;
        if error < best.0 {
            best = (error, exponent);
        }
    }
    let error_at = |exponent: f64| Ok::<_, Failure>((error(even * exponent.exp2())?, exponent));
    let (mut low, mut high) = (best.1 - 0.5, best.1 + 0.5);
    let golden = 0.5 * (5f64.sqrt() - 1.0);
    let (mut a, mut b) = (error_at(high - golden)?, error_at(low + golden)?);
    for _ in 0..10 {
        if a.0 < b.0 {
            (high, b) = (b.1, a);
            a = error_at(high - golden * (high - low))?;
        } else {
            (low, a) = (a.1, b);
            b = error_at(low + golden * (high - low))?;
        }
    }
    for found in [a, b] {
        if found.0 < best.0 {
            best = found;
        }
    }
    let scale = if none < best.0 { 0.0 } else { even * best.1.exp2() };
    Ok((scaled(scale), scale))
}
