//! `huygens render`: checks every argument and file, then renders, then writes.

use std::time::{Duration, Instant};

use anyhow::Context;
use huygens::gl::Headless;
use huygens::{Progress, Renderer};
use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::cli::RenderArgs;
use crate::output::{self, Format, Target};
use crate::{Failure, input, print};

pub fn run(arguments: &RenderArgs) -> Result<(), Failure> {
    let (common, output) = (&arguments.common, &arguments.output);
    let format = Format::of(output)?;
    let picture = Target::new("--output", output)?;
    let stats = common.stats.as_deref().map(|path| Target::new("--stats", path)).transpose()?;
    let targets: Vec<&Target> = [Some(&picture), stats.as_ref()].into_iter().flatten().collect();
    input::check_distinct(common, &targets)?;
    let settings = input::settings(common)?;
    let scene = input::load(common)?;
    input::check_not_of_scene(&scene, &targets)?;
    let options = input::options(common, &scene)?;

    let headless = Headless::new(common.device.index)?;
    let mut renderer = Renderer::new(headless.context())?;
    let mut bar = Bar::new(common.quiet);
    let rendered = renderer.render(&scene, &settings, &options, &mut |progress| bar.update(progress));
    bar.clear();
    let rendered = rendered?;
    // Only now: had the driver's limits refused the picture, its one line would have stood alone.
    input::warn(&scene);

    let mut files = vec![(&picture, format.encode(&rendered, common.layer)?)];
    if let Some(target) = &stats {
        files.push((target, output::json(&rendered.stats).context("--stats")?));
    }
    output::write(&files)?;
    let numbers = &rendered.stats;
    let plural = if numbers.frames == 1 { "" } else { "s" };
    print(&format!(
        "wrote {}: {}x{}, {} frame{plural} in {:.1} s, {} of {} VPLs on\n",
        picture.given.display(),
        rendered.width,
        rendered.height,
        numbers.frames,
        numbers.total_ms * 1e-3,
        numbers.active_vpls,
        numbers.vpls,
    ))
}

/// Progress on stderr. It shows itself after a second, and on a terminal alone.
pub struct Bar {
    started: Instant,
    quiet: bool,
    bar: Option<ProgressBar>,
}

impl Bar {
    const STEPS: f32 = 1000.0;

    pub fn new(quiet: bool) -> Self {
        Self { started: Instant::now(), quiet, bar: None }
    }

    pub fn update(&mut self, progress: Progress) {
        let elapsed = self.started.elapsed();
        if self.quiet || elapsed < Duration::from_secs(1) {
            return;
        }
        let fraction = progress.fraction.clamp(0.0, 1.0);
        let bar = self.bar.get_or_insert_with(|| {
            let style = ProgressStyle::with_template("{percent:>3}% [{bar:40}] {msg}");
            ProgressBar::with_draw_target(Some(Self::STEPS as u64), ProgressDrawTarget::stderr())
                .with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()).progress_chars("=> "))
        });
        // From the whole render so far; the bar itself knows only what came after it was shown.
        let left = elapsed.as_secs_f32() * (1.0 / fraction - 1.0);
        bar.set_position((fraction * Self::STEPS) as u64);
        bar.set_message(match Duration::try_from_secs_f32(left) {
            Ok(left) => format!("{}, {} left", progress.pass, HumanDuration(left)),
            Err(_) => progress.pass.to_owned(),
        });
    }

    pub fn clear(&mut self) {
        if let Some(bar) = self.bar.take() {
            bar.finish_and_clear();
        }
    }
}
