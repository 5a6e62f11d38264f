//! `huygens bench`: what a frame costs while the view moves and while it is still, and how far it is from the exact
//! gather.

mod motion;
mod sweep;

use std::time::Instant;

use anyhow::Context;
use huygens::gl::Headless;
use huygens::reference::{PathTracer, PixelFilter, tonemap};
use huygens::settings::{Gather, GatherMethod};
use huygens::{Exposure, Governor, Layer, PassTime, Progress, RenderOptions, Rendered, Renderer, Scene, Settings};
use serde::Serialize;

pub use self::motion::Moving;
use self::motion::{FRAMES, Motion};
use self::sweep::Sweep;
use crate::cli::BenchArgs;
use crate::output::{self, Target};
use crate::progress::Bar;
use crate::{Failure, input, metrics, print, reference};

/// What the file of `--json` holds.
#[derive(Serialize)]
struct Report {
    driver: String,
    runs: Vec<Run>,
    /// How cost grows; empty unless `--sweep` asked for it.
    sweeps: Vec<Sweep>,
}

/// One preset on one scene. Times are milliseconds.
#[derive(Serialize)]
struct Run {
    scene: String,
    preset: String,
    size: [u32; 2],
    /// Wall-clock time of a frame while things move.
    frame_ms: Spread,
    /// Passes that indirect light needs, of those frames: GPU time where the driver has timers, else CPU time.
    gi_ms: Spread,
    /// Gather and what shares its sums, of those frames.
    gather_ms: Spread,
    /// Medians over the frames that ran each pass.
    passes: Vec<PassTime>,
    /// FLIP of the last of those frames to the exact gather of the same VPLs with the same visibility.
    flip_to_exact: f64,
    /// FLIP of the same frame to the path tracer; null unless `--spp` asked for it.
    flip_to_reference: Option<f64>,
    /// The exact gather of the same view.
    exact_gather_ms: f64,
    still: Still,
    /// A frame of direct light alone of which nothing changed.
    direct_frame_ms: Spread,
    /// VPLs that are on.
    vpls: usize,
    /// A frame rate held; null unless `--target-fps` asked for it.
    governor: Option<Governed>,
    /// How restless the picture is; empty unless `--motion` asked for it.
    motion: Vec<Motion>,
}

/// The same view again and again.
#[derive(Serialize)]
struct Still {
    frames: u32,
    frame_ms: Spread,
    gather_ms: Spread,
    /// FLIP of the last frame to the exact gather.
    flip_to_exact: f64,
    /// Whether VPLs, shadow maps or ISMs were made though nothing changed.
    rebuilt: bool,
}

/// 60 frames in which things move, whose gather sums as much as a frame has time for.
#[derive(Serialize)]
struct Governed {
    target_fps: f64,
    /// Of the second half of the frames.
    frame_ms: Spread,
    /// Settings of the last frame.
    interleave: u32,
    most: u32,
    /// Number of the last frame before which they changed.
    settled: u32,
    /// FLIP of the last frame to the exact gather.
    flip_to_exact: f64,
}

/// Of a number of measurements.
#[derive(Serialize)]
struct Spread {
    median: f64,
    p95: f64,
}

impl Spread {
    /// Of at least one value; 0 of none.
    fn of(mut values: Vec<f64>) -> Self {
        values.sort_by(f64::total_cmp);
        let count = values.len();
        if count == 0 {
            return Self { median: 0.0, p95: 0.0 };
        }
        let median = 0.5 * (values[(count - 1) / 2] + values[count / 2]);
        // The nearest rank.
        Self { median, p95: values[(count * 95).div_ceil(100) - 1] }
    }
}

/// Passes that make indirect light.
const INDIRECT: [&str; 7] = ["lattice", "reflected", "vpl", "ism", "ao", "gather", "share"];

/// Those of them that work on the CPU.
const ON_CPU: [&str; 3] = ["lattice", "reflected", "vpl"];

/// The sum over the VPLs at every pixel, with the filter.
const GATHER: [&str; 2] = ["gather", "share"];

pub fn run(arguments: &BenchArgs) -> Result<(), Failure> {
    let common = &arguments.common;
    let mut cases = Vec::new();
    for (i, preset) in arguments.presets.iter().enumerate() {
        if arguments.presets[..i].contains(preset) {
            let what = format!("--presets {}", arguments.presets.join(","));
            return Err(Failure::bad_input(what, format_args!("{preset} is there twice"), "each preset once"));
        }
        cases.push((preset.clone(), input::settings_from(common, Settings::preset(preset)?)?));
    }
    for variant in &arguments.variants {
        let mut settings = input::settings(common)?;
        for (key, value) in &variant.set {
            settings.set(key, value)?;
        }
        if cases.iter().any(|(name, _)| *name == variant.label) {
            let what = format!("--variant {}", variant.label);
            return Err(Failure::bad_input(what, "the name is taken", "each name once"));
        }
        cases.push((variant.label.clone(), settings));
    }
    metrics::check_size(common.size).map_err(|e| {
        Failure::bad_input(format_args!("--size {}x{}", common.size[0], common.size[1]), e, metrics::LARGEST)
    })?;
    let json = arguments.json.as_deref().map(|path| Target::new("--json", path)).transpose()?;
    if let Some(path) = &arguments.sweep
        && path.extension().is_none_or(|ending| !ending.eq_ignore_ascii_case("svg"))
    {
        let what = format_args!("--sweep {}", path.display()).to_string();
        return Err(Failure::bad_input(what, "its ending names no format that is written", ".svg"));
    }
    let plot = arguments.sweep.as_deref().map(|path| Target::new("--sweep", path)).transpose()?;
    let targets: Vec<&Target> = json.iter().chain(&plot).collect();
    input::check_distinct(common, &targets)?;
    let bar = Bar::new(common.quiet, format_args!("loading {}", common.scene.display()));
    let scene = input::load(common)?;
    input::check_not_of_scene(&scene, &targets)?;
    let options = input::options(common, &scene)?;
    let (able, unable): (Vec<Moving>, Vec<Moving>) =
        Moving::ALL.into_iter().partition(|moving| motion::moves(*moving, &scene, &options));
    if let Some(unable) = unable.into_iter().find(|moving| arguments.moving.contains(moving)) {
        let able: Vec<&str> = able.into_iter().map(Moving::name).collect();
        let what = format_args!("--moving {}", unable.name());
        return Err(Failure::bad_input(what, "the scene has none", able.join(", ")));
    }
    let headless = Headless::new(common.device.index)?;
    for (_, settings) in &cases {
        Renderer::new(headless.context())?.check(settings, &options)?;
    }
    drop(bar);
    input::warn(&scene);

    let traced = arguments.spp.map(|spp| {
        let (scene, options) = motion::frame(&arguments.moving, &scene, &options, arguments.last());
        let path = reference::path_options(&options, spp, None, PixelFilter::Center);
        reference::trace(&PathTracer::new(&scene), &path, common.quiet)
    });
    let traced = match traced {
        Some((_, true)) => return Err(Failure::interrupted("the reference is not done, nothing is written")),
        Some((traced, false)) => Some(reference::sum(&traced.direct, &traced.indirect)),
        None => None,
    };
    let (mut runs, mut exact) = (Vec::new(), None);
    for (i, (name, settings)) in cases.iter().enumerate() {
        let mut bar = Bar::new(common.quiet, format_args!("measuring {name}"));
        let share = |fraction: f32| (i as f32 + fraction) / cases.len() as f32;
        let mut progress = |fraction| bar.update(Progress { pass: "measuring", fraction: share(fraction) });
        let mut renderer = Renderer::new(headless.context())?;
        let case = Case { name, settings, scene: &scene, options: &options, arguments, headless: &headless };
        runs.push(case.measure(&mut renderer, traced.as_deref(), &mut exact, &mut progress)?);
    }
    let mut sweeps = Vec::new();
    if plot.is_some() {
        for (name, settings) in &cases {
            let mut bar = Bar::new(common.quiet, format_args!("sweeping {name}"));
            let mut progress = |fraction| bar.update(Progress { pass: "sweeping", fraction });
            sweeps.extend(sweep::measure(&headless, (name, settings), &scene, &options, arguments, &mut progress)?);
        }
    }
    let report = Report { driver: headless.context().info().renderer.clone(), runs, sweeps };
    let mut files = Vec::new();
    if let Some(target) = json {
        files.push((target, output::json(&report).context("--json")?));
    }
    if let Some(target) = plot {
        let title = format!("{} at {}x{} on {}", scene.name, options.width, options.height, report.driver);
        files.push((target, sweep::plot(&report.sweeps, &title).context("--sweep")?));
    }
    output::write(&files)?;
    print(&table(&report))
}

/// What is measured.
struct Case<'a> {
    name: &'a str,
    settings: &'a Settings,
    scene: &'a Scene,
    options: &'a RenderOptions,
    arguments: &'a BenchArgs,
    headless: &'a Headless,
}

/// Times of a number of frames, ms.
#[derive(Default)]
struct Times {
    frame: Vec<f64>,
    passes: Vec<Vec<PassTime>>,
}

impl Times {
    /// Draws a frame and waits for it.
    fn take(
        &mut self,
        renderer: &mut Renderer,
        scene: &Scene,
        settings: &Settings,
        options: &RenderOptions,
    ) -> Result<(), Failure> {
        let begun = Instant::now();
        renderer.draw(scene, settings, options)?;
        renderer.wait();
        self.frame.push(begun.elapsed().as_secs_f64() * 1e3);
        self.passes.push(renderer.pass_times());
        Ok(())
    }

    fn of(&self, names: &[&str]) -> Spread {
        Spread::of(self.passes.iter().map(|passes| sum(passes, names)).collect())
    }

    /// The median of every pass over the frames in which it ran.
    fn medians(&self) -> Vec<PassTime> {
        let mut names: Vec<&'static str> = Vec::new();
        for pass in self.passes.iter().flatten() {
            if !names.contains(&pass.name) {
                names.push(pass.name);
            }
        }
        let median = |name: &'static str| {
            let times = || self.passes.iter().flatten().filter(move |pass| pass.name == name);
            let gpu: Option<Vec<f64>> = times().map(|pass| pass.gpu_ms).collect();
            PassTime {
                name,
                gpu_ms: gpu.map(|gpu| Spread::of(gpu).median),
                cpu_ms: Spread::of(times().map(|pass| pass.cpu_ms).collect()).median,
            }
        };
        names.into_iter().map(median).collect()
    }
}

/// Time of these passes: on the CPU for those that work there, else on the GPU if it can tell (on the CPU a pass
/// may wait for the one before).
fn sum(passes: &[PassTime], names: &[&str]) -> f64 {
    let passes = passes.iter().filter(|pass| names.contains(&pass.name));
    passes.map(|pass| pass.gpu_ms.filter(|_| !ON_CPU.contains(&pass.name)).unwrap_or(pass.cpu_ms)).sum()
}

impl Case<'_> {
    fn measure(
        &self,
        renderer: &mut Renderer,
        traced: Option<&[[f32; 3]]>,
        known: &mut Option<(Settings, Rendered)>,
        progress: &mut dyn FnMut(f32),
    ) -> Result<Run, Failure> {
        let (scene, settings, arguments) = (self.scene, self.settings, self.arguments);
        let wanted = |moving: &Moving| arguments.motion && motion::moves(*moving, scene, self.options);
        let motions: Vec<Moving> = Moving::ALL.into_iter().filter(wanted).collect();
        let governed = arguments.target_fps.map_or(0, |_| FRAMES);
        let animated = governed + motions.len() as u32 * (arguments.warm_up + FRAMES + 1);
        let steps = (arguments.last() + 1 + arguments.still + arguments.runs + 2 + animated) as f32;
        let mut done = 0.0;
        let mut step = || {
            done += 1.0;
            progress(done / steps);
        };
        let at = |number| motion::frame(&arguments.moving, scene, self.options, number);
        let mut moving = Times::default();
        for number in 0..=arguments.last() {
            if number == arguments.warm_up {
                moving = Times::default();
            }
            let (scene, options) = at(number);
            moving.take(renderer, &scene, settings, &options)?;
            step();
        }
        let (stopped, options) = at(arguments.last());
        let moved = read(renderer)?;

        let mut still = Times::default();
        for _ in 0..arguments.still {
            still.take(renderer, &stopped, settings, &options)?;
            step();
        }
        let rested = read(renderer)?;

        let mut governed = None;
        if let Some(target_fps) = arguments.target_fps {
            let mut governor = Governor::new(target_fps, settings);
            let (mut times, mut settled) = (Times::default(), 0);
            for number in 1..=FRAMES {
                if number == FRAMES / 2 {
                    times = Times::default();
                }
                let (scene, options) = at(arguments.last() + number);
                times.take(renderer, &scene, governor.settings(), &options)?;
                let spent = sum(&renderer.pass_times(), &GATHER);
                if governor.frame(times.frame.last().copied().unwrap_or_default(), spent) {
                    settled = number;
                }
                step();
            }
            governed = Some((target_fps, Spread::of(times.frame), settled, read(renderer)?, governor));
        }

        let direct_options = RenderOptions { layer: Layer::Direct, ..options.clone() };
        let mut direct = Times::default();
        for number in 0..=arguments.runs {
            if number == 1 {
                direct = Times::default();
            }
            direct.take(renderer, &stopped, settings, &direct_options)?;
            step();
        }
        let exact_settings = exact(settings);
        if known.as_ref().is_none_or(|(settings, _)| *settings != exact_settings) {
            // The first compiles its shaders: a picture of few pixels.
            let small = RenderOptions { width: 8, height: 8, frames: 1, ..options.clone() };
            renderer.render(&stopped, &exact_settings, &small, &mut |_| ())?;
            let options = RenderOptions { frames: 1, ..options.clone() };
            let rendered = renderer.render(&stopped, &exact_settings, &options, &mut |_| ())?;
            *known = Some((exact_settings, rendered));
        }
        let Some((_, exact)) = known else { return Err(anyhow::anyhow!("there is no exact picture").into()) };
        let ev = match options.exposure {
            Exposure::Ev(ev) => ev,
            Exposure::Auto => exact.stats.exposure_ev,
        };
        let size = [options.width, options.height];
        let flip = |truth: &[[f32; 3]], test: &Rendered| -> Result<f64, Failure> {
            let [truth, test] = [truth, &test.linear].map(|linear| tonemap::display(linear, ev));
            Ok(metrics::mean(&metrics::flip(size, &truth, &test)?))
        };
        let motion = if motions.is_empty() {
            Vec::new()
        } else {
            let mut pair = [Renderer::new(self.headless.context())?, Renderer::new(self.headless.context())?];
            let measure = |moving| {
                motion::measure(moving, &mut pair, scene, settings, self.options, arguments.warm_up, &mut step)
            };
            motions.into_iter().map(measure).collect::<Result<_, _>>()?
        };
        Ok(Run {
            scene: scene.name.clone(),
            preset: self.name.to_owned(),
            size,
            gi_ms: moving.of(&INDIRECT),
            gather_ms: moving.of(&GATHER),
            passes: moving.medians(),
            frame_ms: Spread::of(moving.frame),
            flip_to_exact: flip(&exact.linear, &moved)?,
            flip_to_reference: traced.map(|traced| flip(traced, &moved)).transpose()?,
            exact_gather_ms: sum(&exact.stats.passes, &GATHER),
            still: Still {
                frames: arguments.still,
                gather_ms: still.of(&GATHER),
                frame_ms: Spread::of(still.frame),
                flip_to_exact: flip(&exact.linear, &rested)?,
                rebuilt: rested.stats.rebuilds != moved.stats.rebuilds,
            },
            direct_frame_ms: Spread::of(direct.frame),
            vpls: exact.stats.active_vpls,
            governor: governed
                .map(|(target_fps, frame_ms, settled, rendered, governor)| {
                    let Gather { interleave, most, .. } = governor.settings().gather;
                    let flip_to_exact = flip(&exact.linear, &rendered)?;
                    Ok::<_, Failure>(Governed { target_fps, frame_ms, interleave, most, settled, flip_to_exact })
                })
                .transpose()?,
            motion,
        })
    }
}

/// The same VPLs and visibility with the exact gather.
fn exact(settings: &Settings) -> Settings {
    let mut exact = settings.clone();
    exact.gather = Gather {
        method: GatherMethod::Exact,
        d_min: settings.gather.d_min,
        specular: settings.gather.specular,
        ..Gather::default()
    };
    exact
}

fn read(renderer: &mut Renderer) -> Result<Rendered, Failure> {
    Ok(renderer.read()?.context("nothing was drawn")?)
}

/// The numbers for a terminal.
fn table(report: &Report) -> String {
    let width = report.runs.iter().map(|run| run.preset.chars().count()).max().unwrap_or(0).max(6);
    let mut text = String::new();
    if let Some(run) = report.runs.first() {
        let [w, h] = run.size;
        text.push_str(&format!("{} at {w}x{h} on {}\n", run.scene, report.driver));
    }
    let traced = if report.runs.iter().any(|run| run.flip_to_reference.is_some()) { "  ref. FLIP" } else { "" };
    text.push_str(&format!(
        "{:width$}  {:>9}  {:>9}  {:>9}  {:>9}  {:>8}  {:>8}{traced}  {:>9}  {:>10}  {:>9}\n",
        "preset", "frame ms", "p95", "GI ms", "gather ms", "x exact", "FLIP", "still ms", "still FLIP", "direct ms"
    ));
    for run in &report.runs {
        let traced = run.flip_to_reference.map_or(String::new(), |flip| format!("  {flip:>9.4}"));
        text.push_str(&format!(
            "{:width$}  {:>9.1}  {:>9.1}  {:>9.1}  {:>9.2}  {:>8.1}  {:>8.4}{traced}  {:>9.1}  {:>10.4}  {:>9.1}\n",
            run.preset,
            run.frame_ms.median,
            run.frame_ms.p95,
            run.gi_ms.median,
            run.gather_ms.median,
            run.exact_gather_ms / run.gather_ms.median.max(1e-9),
            run.flip_to_exact,
            run.still.frame_ms.median,
            run.still.flip_to_exact,
            run.direct_frame_ms.median,
        ));
    }
    for run in &report.runs {
        if let Some(governed) = &run.governor {
            text.push_str(&format!(
                "{:width$}  at {} frames a second: {:.1} ms (p95 {:.1}), gather.interleave {}, gather.most {} since frame \
                 {}, FLIP {:.4}\n",
                run.preset,
                governed.target_fps,
                governed.frame_ms.median,
                governed.frame_ms.p95,
                governed.interleave,
                governed.most,
                governed.settled,
                governed.flip_to_exact
            ));
        }
    }
    if report.runs.iter().any(|run| !run.motion.is_empty()) {
        text.push_str(&format!(
            "\n{:width$}  {:>9}  {:>9}  {:>9}  {:>9}\n",
            "preset", "moving", "change", "of exact", "flicker"
        ));
    }
    for run in &report.runs {
        for motion in &run.motion {
            text.push_str(&format!(
                "{:width$}  {:>9}  {:>9.5}  {:>9.5}  {:>9.5}\n",
                run.preset,
                motion.moving.name(),
                motion.change,
                motion.exact_change,
                motion.flicker,
            ));
        }
    }
    if !report.sweeps.is_empty() {
        text.push_str(&sweep::table(&report.sweeps, width));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spreads_are_those_of_textbooks() {
        let of = |values: &[f64]| {
            let spread = Spread::of(values.to_vec());
            (spread.median, spread.p95)
        };
        assert_eq!(of(&[]), (0.0, 0.0));
        assert_eq!(of(&[7.0]), (7.0, 7.0));
        assert_eq!(of(&[3.0, 1.0]), (2.0, 3.0));
        let hundred: Vec<f64> = (1..=100).rev().map(f64::from).collect();
        assert_eq!(of(&hundred), (50.5, 95.0));
    }
}
