//! Scenes that are read beside the window's thread, and files that are watched.

use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::mpsc::{self, Receiver};
use std::time::{Duration, Instant};

use eframe::egui;
use huygens::{Error, Scene};
use notify::{RecommendedWatcher, RecursiveMode, Watcher};

use super::later::Later;
use crate::input;

/// Files change in many steps: a change counts when nothing more has come for so long.
const QUIET: Duration = Duration::from_millis(300);

/// A scene that is being read.
pub struct Loading {
    pub source: OsString,
    /// Whether it is the scene that is shown, read again.
    pub again: bool,
    progress: Arc<AtomicU32>,
    go_on: Arc<AtomicBool>,
    result: Later<Result<Scene, String>>,
}

impl Loading {
    pub fn start(source: OsString, again: bool, ctx: &egui::Context) -> Self {
        let (progress, go_on) = (Arc::new(AtomicU32::new(0)), Arc::new(AtomicBool::new(true)));
        let (theirs, ours, name, repaint) = (progress.clone(), go_on.clone(), source.clone(), ctx.clone());
        let result = Later::new(ctx, move || {
            let mut hear = |share: f32| {
                theirs.store(share.to_bits(), Ordering::Relaxed);
                repaint.request_repaint();
                ours.load(Ordering::Relaxed)
            };
            input::read(&name, &mut hear).map_err(|failure| format!("{:#}", failure.cause))
        });
        Self { source, again, progress, go_on, result }
    }

    /// Share that is read, 0…1.
    pub fn progress(&self) -> f32 {
        f32::from_bits(self.progress.load(Ordering::Relaxed))
    }

    /// The scene or what is wrong with it, once it is there.
    pub fn take(&self) -> Option<Result<Scene, String>> {
        Some(self.result.take()?.unwrap_or_else(|| Err(Error::Cancelled.to_string())))
    }
}

impl Drop for Loading {
    fn drop(&mut self) {
        self.go_on.store(false, Ordering::Relaxed);
    }
}

/// Tells when one of some files changes.
pub struct Watch {
    /// Ends with it.
    _watcher: RecommendedWatcher,
    changes: Receiver<()>,
    last: Option<Instant>,
}

impl Watch {
    /// Watches the files of a scene; `None` for what is no file, or where the system does not tell.
    pub fn new(source: &OsStr, scene: &Scene, ctx: &egui::Context) -> Option<Self> {
        if source.to_str().is_some_and(|name| name.starts_with("builtin:")) {
            return None;
        }
        let main = Path::new(source).canonicalize().ok()?;
        Self::files(std::iter::once(main).chain(scene.files.iter().cloned()).collect(), ctx)
    }

    /// Watches files, named without links; `None` where the system does not tell.
    pub fn files(files: Vec<PathBuf>, ctx: &egui::Context) -> Option<Self> {
        // Many programs write another file and rename it: folders tell of that, files do not.
        let mut folders: Vec<&Path> = files.iter().filter_map(|file| file.parent()).collect();
        folders.sort();
        folders.dedup();
        let (sender, changes) = mpsc::channel();
        let (watched, ctx) = (files.clone(), ctx.clone());
        let handler = move |event: notify::Result<notify::Event>| {
            let touched =
                |event: notify::Event| !event.kind.is_access() && event.paths.iter().any(|path| watched.contains(path));
            if event.is_ok_and(touched) && sender.send(()).is_ok() {
                ctx.request_repaint_after(QUIET);
            }
        };
        let mut watcher = notify::recommended_watcher(handler).ok()?;
        for folder in folders {
            watcher.watch(folder, RecursiveMode::NonRecursive).ok()?;
        }
        Some(Self { _watcher: watcher, changes, last: None })
    }

    /// Whether a file has changed and is whole by now, once for each change.
    pub fn changed(&mut self, ctx: &egui::Context) -> bool {
        while self.changes.try_recv().is_ok() {
            self.last = Some(Instant::now());
        }
        match self.last {
            Some(last) if last.elapsed() >= QUIET => {
                self.last = None;
                true
            }
            Some(last) => {
                ctx.request_repaint_after(QUIET.saturating_sub(last.elapsed()));
                false
            }
            None => false,
        }
    }
}

/// What a dialog of the system asks for.
pub enum Answer {
    Scene(PathBuf),
    LoadSettings(PathBuf),
    SaveSettings(PathBuf),
    Cancelled,
    NoDialog,
}

/// Nobody cancels a dialog sooner.
const GLANCE: Duration = Duration::from_millis(250);

/// A dialog that is open beside the window.
pub struct Dialog(Later<Answer>);

impl Dialog {
    pub fn scene(ctx: &egui::Context) -> Self {
        let dialog = rfd::AsyncFileDialog::new().add_filter("glTF 2.0", &["gltf", "glb"]).pick_file();
        Self::ask(ctx, dialog, Answer::Scene)
    }

    pub fn load_settings(ctx: &egui::Context) -> Self {
        let dialog = rfd::AsyncFileDialog::new().add_filter("TOML", &["toml"]).pick_file();
        Self::ask(ctx, dialog, Answer::LoadSettings)
    }

    pub fn save_settings(ctx: &egui::Context) -> Self {
        let dialog =
            rfd::AsyncFileDialog::new().add_filter("TOML", &["toml"]).set_file_name("huygens.toml").save_file();
        Self::ask(ctx, dialog, Answer::SaveSettings)
    }

    fn ask(
        ctx: &egui::Context,
        dialog: impl Future<Output = Option<rfd::FileHandle>> + Send + 'static,
        answer: fn(PathBuf) -> Answer,
    ) -> Self {
        let asked = Instant::now();
        Self(Later::new(ctx, move || match pollster::block_on(dialog) {
            Some(file) => answer(file.path().to_owned()),
            // No dialog and a cancelled one are told apart by time alone.
            None if asked.elapsed() < GLANCE => Answer::NoDialog,
            None => Answer::Cancelled,
        }))
    }

    /// What was chosen, once the dialog is closed.
    pub fn take(&self) -> Option<Answer> {
        Some(self.0.take()?.unwrap_or(Answer::Cancelled))
    }
}
