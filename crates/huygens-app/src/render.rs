//! `huygens render`: checks every argument and file, then renders, then writes.

use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::Context;
use huygens::gl::Headless;
use huygens::{Progress, Renderer, Stats};
use serde::Serialize;

use crate::cli::{Frames, RenderArgs};
use crate::output::{self, Format, Target};
use crate::progress::Bar;
use crate::{Failure, input, print};

/// What `--stats` tells of numbered pictures.
#[derive(Serialize)]
struct Numbered {
    fps: u32,
    frames: Vec<Frame>,
}

#[derive(Serialize)]
struct Frame {
    frame: u32,
    /// Time of the scene, s.
    seconds: f64,
    #[serde(flatten)]
    stats: Stats,
}

pub fn run(arguments: &RenderArgs) -> Result<(), Failure> {
    let (common, output) = (&arguments.common, &arguments.output);
    let format = Format::of(output)?;
    let (numbers, names): (Vec<u32>, Vec<PathBuf>) = match common.frames {
        Frames::Mean(_) => (Vec::new(), vec![output.clone()]),
        Frames::Numbered { first, end } => (first..end).map(|number| (number, numbered(output, number))).unzip(),
    };
    let pictures = names.iter().map(|name| Target::new("--output", name)).collect::<Result<Vec<_>, _>>()?;
    let stats = common.stats.as_deref().map(|path| Target::new("--stats", path)).transpose()?;
    for picture in &pictures {
        let targets: Vec<&Target> = [Some(picture), stats.as_ref()].into_iter().flatten().collect();
        input::check_distinct(common, &targets)?;
    }
    let settings = input::settings(common)?;
    let mut bar = Bar::new(common.quiet, format_args!("loading {}", common.scene.display()));
    let scene = input::load(common)?;
    input::check_not_of_scene(&scene, &pictures.iter().chain(&stats).collect::<Vec<_>>())?;
    if numbers.is_empty() {
        let options = input::options(common, &scene)?;
        let headless = Headless::new(common.device.index)?;
        let mut renderer = Renderer::new(headless.context())?;
        let rendered = renderer.render(&scene, &settings, &options, &mut |progress| bar.update(progress))?;
        drop(bar);
        // Only now: had the driver's limits refused the picture, its one line would have stood alone.
        input::warn(&scene);

        let mut files = vec![(&pictures[0], format.encode(&rendered, common.layer)?)];
        if let Some(target) = &stats {
            files.push((target, output::json(&rendered.stats).context("--stats")?));
        }
        output::write(&files)?;
        let numbers = &rendered.stats;
        let plural = if numbers.frames == 1 { "" } else { "s" };
        return print(&format!(
            "wrote {}: {}x{}, {} frame{plural} in {:.1} s, {} of {} VPLs on\n",
            output.display(),
            rendered.width,
            rendered.height,
            numbers.frames,
            numbers.total_ms * 1e-3,
            numbers.active_vpls,
            numbers.vpls,
        ));
    }

    let started = Instant::now();
    let mut told = Numbered { fps: arguments.fps, frames: Vec::new() };
    let seconds = |number: u32| f64::from(number) / f64::from(arguments.fps);
    let headless = Headless::new(common.device.index)?;
    let mut renderer = Renderer::new(headless.context())?;
    for (done, (&number, picture)) in numbers.iter().zip(&pictures).enumerate() {
        let posed = input::at(common, &scene, seconds(number))?;
        let options = input::options(common, &posed)?;
        let rendered = renderer.render(&posed, &settings, &options, &mut |Progress { pass, fraction }| {
            bar.update(Progress { pass, fraction: (done as f32 + fraction) / numbers.len() as f32 });
        })?;
        output::write(&[(picture, format.encode(&rendered, common.layer)?)])?;
        told.frames.push(Frame { frame: number, seconds: seconds(number), stats: rendered.stats });
    }
    drop(bar);
    input::warn(&scene);
    if let Some(target) = &stats {
        output::write(&[(target, output::json(&told).context("--stats")?)])?;
    }
    let what = match names.as_slice() {
        [first, .., last] => format!("{} to {}: {} of ", first.display(), last.display(), names.len()),
        _ => format!("{}: ", names[0].display()),
    };
    print(&format!("wrote {what}{}x{}, in {:.1} s\n", common.size[0], common.size[1], started.elapsed().as_secs_f64()))
}

/// The name of a picture with a number.
fn numbered(output: &Path, number: u32) -> PathBuf {
    let mut name = output.file_stem().unwrap_or_default().to_owned();
    name.push(format!("-{number:04}."));
    name.push(output.extension().unwrap_or_default());
    output.with_file_name(name)
}
