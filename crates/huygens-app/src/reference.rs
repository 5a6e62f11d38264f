//! `huygens reference`: traces paths through a scene on the CPU.

use std::time::Instant;

use anyhow::Context;
use huygens::reference::{PathOptions, PathTraced, PathTracer, PixelFilter, tonemap};
use huygens::{Exposure, Layer, Progress, RenderOptions, Settings};
use serde::Serialize;

use crate::cli::ReferenceArgs;
use crate::output::{self, Format, Target};
use crate::progress::Bar;
use crate::{Failure, input, interrupt, print, say};

/// Goes up whenever the path tracer makes another picture of the same scene: what was traced before is then out of date.
pub const VERSION: u32 = 1;

/// What `--stats` tells.
#[derive(Serialize)]
struct Stats<'a> {
    scene: &'a str,
    size: [u32; 2],
    /// Paths for each pixel that were averaged.
    samples: u32,
    /// Bounces of indirect light; null where there was no limit.
    bounces: Option<u32>,
    seed: u32,
    triangles: usize,
    /// Exposure of a PNG, EV.
    exposure_ev: f32,
    /// Bound on the standard error of the mean radiance of the picture, from the variance of its pixels, over the mean:
    /// what it is where the channels of a pixel err together. Null for one pass, which has no variance.
    relative_error_of_mean: Option<f64>,
    build_ms: f64,
    trace_ms: f64,
}

pub fn run(arguments: &ReferenceArgs) -> Result<(), Failure> {
    let (common, output) = (&arguments.common, &arguments.output);
    let format = Format::of(output)?;
    let picture = Target::new("--output", output)?;
    let stats = common.stats.as_deref().map(|path| Target::new("--stats", path)).transpose()?;
    let targets: Vec<&Target> = [Some(&picture), stats.as_ref()].into_iter().flatten().collect();
    input::check_distinct(common, &targets)?;
    // The path tracer takes none of them, but a mistake in them is still one.
    if input::settings(common)? != Settings::default() || common.frames.averaged() > 1 {
        say("note", format_args!("settings and --frames have no influence on the path tracer"));
    }
    input::check_memory(common, PIXEL)?;
    if !matches!(common.layer, Layer::Final | Layer::Direct | Layer::Indirect) {
        let what = format_args!("--layer {}", common.layer.name()).to_string();
        return Err(Failure::bad_input(what, "the path tracer makes light alone", "final, direct, indirect"));
    }
    let bar = Bar::new(common.quiet, format_args!("loading {}", common.scene.display()));
    let scene = input::load(common)?;
    input::check_not_of_scene(&scene, &targets)?;
    let options = input::options(common, &scene)?;
    drop(bar);
    input::warn(&scene);

    let started = Instant::now();
    let tracer = PathTracer::new(&scene);
    let build_ms = started.elapsed().as_secs_f64() * 1e3;
    let started = Instant::now();
    let path = path_options(&options, arguments.spp, arguments.bounces.0, PixelFilter::Box);
    let (traced, stopped) = trace(&tracer, &path, common.quiet);
    let trace_ms = started.elapsed().as_secs_f64() * 1e3;
    if traced.samples == 0 {
        return Err(Failure::interrupted("not even the first pass was done, nothing is written"));
    }
    let seen = sum(&traced.direct, &traced.indirect);
    let layer = match common.layer {
        Layer::Direct => &traced.direct,
        Layer::Indirect => &traced.indirect,
        _ => &seen,
    };
    let ev = match common.exposure {
        Exposure::Auto => tonemap::auto_exposure(layer),
        Exposure::Ev(ev) => ev,
    };
    let bytes = match format {
        Format::Exr => encode(layer, &traced, None),
        Format::Png => output::encode_png(traced.width, traced.height, &tonemap::display(layer, ev)),
    };
    let mut files = vec![(&picture, bytes?)];
    if let Some(target) = &stats {
        let numbers = Stats {
            scene: &scene.name,
            size: common.size,
            samples: traced.samples,
            bounces: path.bounces,
            seed: path.seed,
            triangles: scene.triangle_count(),
            exposure_ev: ev,
            relative_error_of_mean: relative_error_of_mean(&traced.variance, &seen),
            build_ms,
            trace_ms,
        };
        files.push((target, output::json(&numbers).context("--stats")?));
    }
    output::write(&files)?;
    let seconds = trace_ms * 1e-3;
    print(&format!(
        "wrote {}: {}x{}, {} in {seconds:.1} s, {:.2} million paths a second\n",
        picture.given.display(),
        traced.width,
        traced.height,
        paths(traced.samples),
        f64::from(traced.samples) * traced.direct.len() as f64 / seconds.max(1e-9) * 1e-6,
    ))?;
    if stopped {
        let planned = paths(path.samples);
        return Err(Failure::interrupted(format_args!("the picture has {} of {planned}", traced.samples)));
    }
    Ok(())
}

/// See [`Stats`].
fn relative_error_of_mean(variance: &[[f32; 3]], seen: &[[f32; 3]]) -> Option<f64> {
    // Channels of a path are anything but independent: standard errors add up, not variances.
    let pixel = |v: &[f32; 3]| v.iter().map(|&v| f64::from(v).sqrt()).sum::<f64>().powi(2);
    let error = variance.iter().map(pixel).sum::<f64>().sqrt();
    let total = seen.as_flattened().iter().map(|&v| f64::from(v)).sum::<f64>();
    error.is_finite().then(|| error / total.max(f64::MIN_POSITIVE))
}

/// The path tracer's options for what the GPU would be asked.
pub fn path_options(options: &RenderOptions, spp: u32, bounces: Option<u32>, filter: PixelFilter) -> PathOptions {
    PathOptions {
        width: options.width,
        height: options.height,
        camera: options.camera.clone(),
        samples: spp,
        bounces,
        seed: options.seed,
        filter,
    }
}

/// Memory for each pixel, bytes: sums, pictures and files.
const PIXEL: usize = 256;

/// Traces with a progress bar. After Ctrl-C the passes so far are the result, and the second value is true; a second
/// Ctrl-C ends the program, as one does outside of tracing.
pub fn trace(tracer: &PathTracer, options: &PathOptions, quiet: bool) -> (PathTraced, bool) {
    let mut bar = Bar::new(quiet, "tracing");
    let mut go_on = |fraction| {
        bar.update(Progress { pass: "tracing", fraction });
        !interrupt::is_asked_to_end()
    };
    let traced = interrupt::tracing(|| tracer.trace(options, &mut go_on));
    drop(bar);
    let stopped = traced.samples < options.samples;
    (traced, stopped)
}

/// An EXR file of a layer with everything that was traced beside it; an attribute's name and value.
pub fn encode(layer: &[[f32; 3]], traced: &PathTraced, attribute: Option<(&str, &str)>) -> anyhow::Result<Vec<u8>> {
    let others: [(&str, &[[f32; 3]]); 3] =
        [("direct", &traced.direct), ("indirect", &traced.indirect), ("variance", &traced.variance)];
    output::encode_layers([traced.width, traced.height], layer, &others, attribute).context("EXR")
}

/// A number of paths as messages say it.
pub fn paths(samples: u32) -> String {
    format!("{samples} path{} a pixel", if samples == 1 { "" } else { "s" })
}

/// The sum of two pictures.
pub fn sum(a: &[[f32; 3]], b: &[[f32; 3]]) -> Vec<[f32; 3]> {
    a.iter().zip(b).map(|(a, b)| std::array::from_fn(|c| a[c] + b[c])).collect()
}
