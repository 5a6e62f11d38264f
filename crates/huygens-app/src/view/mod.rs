//! `huygens view`: a window in which a scene can be seen, moved and changed while it is drawn.

mod command;
mod drawing;
mod gizmo;
mod keys;
mod later;
mod lattice;
mod load;
mod navigate;
mod numbers;
mod settings;
mod trace;
mod viewer;
mod wipe;

use std::ffi::OsStr;
use std::time::{Duration, Instant};

use eframe::egui;
use huygens::Progress;

use crate::cli::ViewArgs;
use crate::progress::Bar;
use crate::{Failure, input};
use viewer::{Heir, Start, Viewer};

/// A window that loses its context sooner is not opened again.
const SURVIVES: Duration = Duration::from_secs(5);

/// No window can be opened, and why.
#[derive(Debug)]
pub struct NoWindow(String);

impl std::fmt::Display for NoWindow {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "no window can be opened: {}; `huygens render` makes pictures without a display", self.0)
    }
}

impl std::error::Error for NoWindow {}

/// Whether there is a display to open a window on, as far as the environment tells.
fn has_display() -> bool {
    let set = |name: &str| std::env::var_os(name).is_some_and(|value| value != OsStr::new(""));
    !cfg!(all(unix, not(target_os = "macos"))) || set("DISPLAY") || set("WAYLAND_DISPLAY")
}

pub fn run(arguments: &ViewArgs) -> Result<(), Failure> {
    let common = &arguments.common;
    // What is wrong with the arguments is told before a window opens.
    let settings = input::settings(common)?;
    let mut bar = Bar::new(false, "loading");
    let scene = input::read(&common.scene, &mut |fraction| {
        bar.update(Progress { pass: "loading", fraction });
        true
    })?;
    drop(bar);
    input::check_changes(common, &scene)?;
    let animation = input::animation(common, &scene)?;
    // At rest, animations have no say.
    let posed = common.time.map(|seconds| input::at(common, &scene, seconds)).transpose()?;
    let options = input::options(common, posed.as_ref().unwrap_or(&scene))?;
    let camera = input::camera_index(common, &scene)?;
    input::warn(&scene);
    if !has_display() {
        return Err(no_display("DISPLAY and WAYLAND_DISPLAY are not set"));
    }
    let mut start = Start {
        window: common.size.map(|points| points as f32),
        source: common.scene.clone(),
        scene,
        settings,
        preset: common.preset.clone(),
        camera,
        options,
        changes: common.changes(),
        time: common.time,
        animation,
    };
    loop {
        let viewport = egui::ViewportBuilder::default()
            .with_title("Huygens")
            .with_app_id("huygens")
            .with_inner_size(start.window)
            .with_min_inner_size([320.0, 240.0])
            .with_drag_and_drop(true);
        // The size is that of `--size`.
        let native = eframe::NativeOptions {
            viewport,
            persist_window: false,
            depth_buffer: 0,
            stencil_buffer: 0,
            ..Default::default()
        };
        let heir = Heir::default();
        let theirs = heir.clone();
        let create: eframe::AppCreator<'_> =
            Box::new(move |creation| Ok(Box::new(Viewer::new(creation, start, theirs)?)));
        let opened = Instant::now();
        eframe::run_native("Huygens", native, create).map_err(|error| match error {
            eframe::Error::AppCreation(cause) => anyhow::anyhow!("{cause}").into(),
            // Its own words name a file of its source.
            eframe::Error::WinitEventLoop(_) => no_display("the display does not answer"),
            error => no_display(error),
        })?;
        start = match heir.take() {
            None => return Ok(()),
            // It may be this very scene that the GPU does not survive.
            Some(_) if opened.elapsed() < SURVIVES => {
                return Err(anyhow::Error::from(huygens::Error::ContextLost).into());
            }
            Some(start) => start,
        };
        crate::say("warning", format_args!("{}; the window opens again", huygens::Error::ContextLost));
    }
}

fn no_display(problem: impl std::fmt::Display) -> Failure {
    anyhow::Error::from(NoWindow(problem.to_string())).into()
}
