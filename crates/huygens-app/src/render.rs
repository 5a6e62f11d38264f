//! `huygens render`: checks every argument and file, then renders, then writes.

use anyhow::Context;
use huygens::Renderer;
use huygens::gl::Headless;

use crate::cli::RenderArgs;
use crate::output::{self, Format, Target};
use crate::progress::Bar;
use crate::{Failure, input, print};

pub fn run(arguments: &RenderArgs) -> Result<(), Failure> {
    let (common, output) = (&arguments.common, &arguments.output);
    let format = Format::of(output)?;
    let picture = Target::new("--output", output)?;
    let stats = common.stats.as_deref().map(|path| Target::new("--stats", path)).transpose()?;
    let targets: Vec<&Target> = [Some(&picture), stats.as_ref()].into_iter().flatten().collect();
    input::check_distinct(common, &targets)?;
    let settings = input::settings(common)?;
    let mut bar = Bar::new(common.quiet, format_args!("loading {}", common.scene.display()));
    let scene = input::load(common)?;
    input::check_not_of_scene(&scene, &targets)?;
    let options = input::options(common, &scene)?;

    let headless = Headless::new(common.device.index)?;
    let mut renderer = Renderer::new(headless.context())?;
    let rendered = renderer.render(&scene, &settings, &options, &mut |progress| bar.update(progress))?;
    drop(bar);
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
