//! `huygens render`: checks every argument and file, then renders, then writes.

use std::fs::File;
use std::io::Read;
use std::path::Path;
use std::time::{Duration, Instant};

use anyhow::Context;
use huygens::camera::Projection;
use huygens::gl::Headless;
use huygens::{Camera, Error, Progress, RenderOptions, Renderer, Scene, Settings};
use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::cli::RenderArgs;
use crate::output::{self, Format, Target};
use crate::{Failure, print, say};

/// A longer file is not a file of settings; all of them take a few KiB.
const CONFIG_LIMIT: u64 = 1 << 20;

pub fn run(arguments: &RenderArgs) -> Result<(), Failure> {
    let format = Format::of(&arguments.output)?;
    let picture = Target::new("--output", &arguments.output)?;
    let stats = arguments.stats.as_deref().map(|path| Target::new("--stats", path)).transpose()?;
    check_distinct(arguments, &picture, stats.as_ref())?;
    let settings = settings(arguments)?;
    let scene = load(arguments)?;
    for target in [Some(&picture), stats.as_ref()].into_iter().flatten() {
        if scene.files.iter().any(|file| target.is_same(file)) {
            return Err(Failure::bad_input(
                target,
                "it would replace a file that the scene is made of",
                "another file",
            ));
        }
    }
    let options = RenderOptions {
        layer: arguments.layer,
        exposure: arguments.exposure,
        frames: arguments.frames,
        seed: arguments.seed,
        ..RenderOptions::new(arguments.size[0], arguments.size[1], camera(arguments, &scene)?)
    };

    let headless = Headless::new(arguments.device.index)?;
    let mut renderer = Renderer::new(headless.context())?;
    let mut bar = Bar::new(arguments.quiet);
    let rendered = renderer.render(&scene, &settings, &options, &mut |progress| bar.update(progress));
    bar.clear();
    let rendered = rendered?;
    // Only now: had the driver's limits refused the picture, its one line would have stood alone.
    for warning in &scene.warnings {
        say("warning", warning);
    }
    if scene.triangle_count() == 0 {
        say("warning", format_args!("{}: the scene has no triangles; there is only background", scene.name));
    }

    let mut files = vec![(&picture, format.encode(&rendered, arguments.layer)?)];
    if let Some(target) = &stats {
        let mut json = serde_json::to_vec_pretty(&rendered.stats).context("--stats")?;
        json.push(b'\n');
        files.push((target, json));
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

/// Refuses to write two things to one file, or over what is read.
fn check_distinct(arguments: &RenderArgs, picture: &Target, stats: Option<&Target>) -> Result<(), Failure> {
    if let Some(stats) = stats.filter(|stats| stats.is_same_target(picture)) {
        return Err(Failure::bad_input(stats, "--output names the same file", "two different files"));
    }
    let inputs = [Some(Path::new(&arguments.scene)), arguments.config.as_deref()];
    for target in [Some(picture), stats].into_iter().flatten() {
        if inputs.iter().flatten().any(|input| target.is_same(input)) {
            return Err(Failure::bad_input(target, "it would replace a file that is read", "another file"));
        }
    }
    Ok(())
}

/// Preset, then the file, then each `--set`; the later overrides the earlier.
fn settings(arguments: &RenderArgs) -> Result<Settings, Failure> {
    let mut settings = Settings::preset(&arguments.preset)?;
    if let Some(path) = &arguments.config {
        let refuse = |problem: String| Error::File { path: path.clone(), problem };
        let allowed = "allowed: a TOML file of settings, at most 1 MiB of UTF-8";
        let mut bytes = Vec::new();
        File::open(path)
            .and_then(|file| file.take(CONFIG_LIMIT + 1).read_to_end(&mut bytes))
            .map_err(|e| refuse(format!("{e}; {allowed}")))?;
        if bytes.len() as u64 > CONFIG_LIMIT {
            return Err(refuse(format!("it is larger than 1 MiB; {allowed}")).into());
        }
        let text = String::from_utf8(bytes).map_err(|_| refuse(format!("it is not UTF-8; {allowed}")))?;
        settings.merge_toml(&text).map_err(refuse)?;
    }
    for (key, value) in &arguments.set {
        settings.set(key, value)?;
    }
    Ok(settings)
}

fn load(arguments: &RenderArgs) -> Result<Scene, Failure> {
    if let Some(name) = arguments.scene.to_str().and_then(|s| s.strip_prefix("builtin:")) {
        return Ok(Scene::builtin(name)?);
    }
    let path = Path::new(&arguments.scene);
    let ending = path.extension().map(|e| e.to_ascii_lowercase());
    if !ending.is_some_and(|e| e == "gltf" || e == "glb") {
        return Err(Failure::bad_input(
            format_args!("scene {}", path.display()),
            "neither a built-in scene nor the name of a glTF file",
            format_args!("a .gltf or .glb file, {}", crate::info::scene_names().join(", ")),
        ));
    }
    Ok(Scene::load(path)?)
}

/// The camera that `--camera` chooses, with what `--eye`, `--target` and `--fov` replace in it.
fn camera(arguments: &RenderArgs, scene: &Scene) -> Result<Camera, Failure> {
    let chosen = match &arguments.camera {
        None => scene.cameras.first(),
        Some(text) => text
            .parse::<usize>()
            .ok()
            .and_then(|index| scene.cameras.get(index))
            .or_else(|| scene.cameras.iter().find(|camera| !camera.name.is_empty() && camera.name == *text)),
    };
    let mut camera = chosen.cloned().ok_or_else(|| {
        let text = arguments.camera.as_deref().unwrap_or("0");
        Failure::bad_input(format_args!("--camera {text}"), "the scene has no such camera", list(&scene.cameras))
    })?;
    let projection = camera.projection;

    camera.eye = arguments.eye.unwrap_or(camera.eye);
    if let Some(target) = arguments.target {
        // The angle is put in below; it has no influence on where the camera looks.
        let looking = Camera::look_at(camera.eye, target, 1.0).ok_or_else(|| {
            let what = format_args!("--target {},{},{}", target.x, target.y, target.z).to_string();
            Failure::bad_input(what, "no direction leads there from the eye", "a point away from the eye, within reach")
        })?;
        camera = Camera { projection, name: camera.name, near: camera.near, ..looking };
    }
    if let Some(fov) = arguments.fov {
        let all_given = arguments.eye.is_some() && arguments.target.is_some();
        if matches!(projection, Projection::Orthographic { .. }) && !all_given {
            return Err(Failure::bad_input(
                format_args!("--fov {fov}"),
                "the chosen camera is orthographic and has no field of view",
                "a perspective camera, or --fov with both --eye and --target",
            ));
        }
        camera.projection = Projection::Perspective { fov_y: fov.to_radians() };
    }
    Ok(camera)
}

/// The cameras of a scene for a message, however many there are.
fn list(cameras: &[Camera]) -> String {
    const SHOWN: usize = 16;
    let name = |(i, camera): (usize, &Camera)| match camera.name.as_str() {
        "" => i.to_string(),
        name => format!("{i} ({name})"),
    };
    let mut names: Vec<String> = cameras.iter().enumerate().take(SHOWN).map(name).collect();
    if cameras.len() > SHOWN {
        names.push(format!("up to {}", cameras.len() - 1));
    }
    names.join(", ")
}

/// Progress on stderr. It shows itself after a second, and on a terminal alone.
struct Bar {
    started: Instant,
    quiet: bool,
    bar: Option<ProgressBar>,
}

impl Bar {
    const STEPS: f32 = 1000.0;

    fn new(quiet: bool) -> Self {
        Self { started: Instant::now(), quiet, bar: None }
    }

    fn update(&mut self, progress: Progress) {
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

    fn clear(&mut self) {
        if let Some(bar) = self.bar.take() {
            bar.finish_and_clear();
        }
    }
}
