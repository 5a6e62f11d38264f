//! Scenes, settings and pictures that come from files or go to them.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use anyhow::Context as _;
use eframe::egui::{self, util::undoer::Undoer};
use huygens::Scene;

use super::{Recording, Viewer};
use crate::input::{self, Changes};
use crate::output::{self, Format, Target};
use crate::view::command::Picture;
use crate::view::drawing::Asked;
use crate::view::load::{Answer, Dialog, Loading, Watch};

impl Viewer {
    /// Puts the scene first in the list of recent ones.
    pub(super) fn remember(&mut self) {
        let name = match Path::new(&self.source).canonicalize() {
            Ok(path) => path.to_string_lossy().into_owned(),
            Err(_) => self.source.to_string_lossy().into_owned(),
        };
        self.recent.retain(|other| *other != name);
        self.recent.insert(0, name);
        self.recent.truncate(12);
    }

    pub(super) fn open(&mut self, source: OsString, ctx: &egui::Context) {
        self.loading = Some(Loading::start(source, false, ctx));
    }

    /// What came from other threads: scenes, dialogs, files that changed.
    pub(super) fn receive(&mut self, ctx: &egui::Context) {
        for file in ctx.input(|i| i.raw.dropped_files.clone()) {
            self.open(file.path().as_os_str().to_owned(), ctx);
        }
        if let Some(asked) = self.dialog.as_ref().and_then(Dialog::take) {
            self.dialog = None;
            match asked {
                Answer::Scene(path) => self.open(path.into_os_string(), ctx),
                Answer::LoadSettings(path) => self.load_settings(&path),
                Answer::SaveSettings(path) => self.save_settings(&path),
                Answer::Cancelled => {}
                Answer::NoDialog => self.refuse(
                    "no dialog: the system has neither a desktop portal nor zenity (Debian: apt-get install zenity); a \
                     scene can also be named in the field or dropped on the window",
                ),
            }
        }
        if self.loading.is_none() && self.watch.as_mut().is_some_and(|watch| watch.changed(ctx)) {
            self.loading = Some(Loading::start(self.source.clone(), true, ctx));
        }
        #[cfg(debug_assertions)]
        if self.shaders.as_mut().is_some_and(|shaders| shaders.changed(ctx)) {
            match self.main.renderer.reload_shaders() {
                Ok(()) => self.tell("shaders read again"),
                Err(error) => self.refuse(error),
            }
            self.main.forget();
            self.other = None;
        }
        let Some(scene) = self.loading.as_ref().and_then(Loading::take) else { return };
        match (scene, self.loading.take()) {
            (Ok(scene), Some(loading)) => self.take_scene(scene, loading.source.clone(), loading.again, ctx),
            // The old scene stays.
            (Err(problem), _) => self.refuse(problem),
            (Ok(_), None) => {}
        }
    }

    fn take_scene(&mut self, scene: Scene, source: OsString, again: bool, ctx: &egui::Context) {
        self.told = None;
        self.message = match scene.warnings.as_slice() {
            [] if scene.triangle_count() == 0 => Some((false, input::NO_TRIANGLES.to_owned())),
            [] => None,
            [first] => Some((false, first.clone())),
            [first, rest @ ..] => Some((false, format!("{first} (and {} more warnings)", rest.len()))),
        };
        // What changed while it was read has yet to be heard of.
        if !again || self.watch.is_none() || scene.files != self.scene.files {
            self.watch = Watch::new(&source, &scene, ctx);
        }
        (self.scene, self.source, self.chosen, self.hit) = (scene, source, None, None);
        // Objects that were moved are those of the scene before.
        self.undoer = Undoer::default();
        self.keep_moves_of_objects();
        self.animation = self.animation.filter(|animation| *animation < self.scene.animations().len());
        self.playing &= !self.scene.animations().is_empty();
        if again {
            self.pose();
            return;
        }
        self.path = self.source.to_string_lossy().into_owned();
        self.remember();
        self.state.changes = Changes::default();
        (self.time, self.animation, self.playing) = (None, None, false);
        self.pose();
        self.go_to_camera(0);
    }

    fn load_settings(&mut self, path: &Path) {
        let mut settings = self.state.settings.clone();
        match input::merge_file(&mut settings, path) {
            Ok(()) => self.state.settings = settings,
            Err(failure) => self.refuse(format!("{:#}", failure.cause)),
        }
    }

    fn save_settings(&mut self, path: &Path) {
        let text = self.state.settings.to_toml();
        let written = Target::new("settings", path).and_then(|target| output::write(&[(target, text.into_bytes())]));
        match written {
            Ok(()) => self.tell(format!("settings written to {}", path.display())),
            Err(failure) => self.refuse(format!("{:#}", failure.cause)),
        }
    }

    /// The command line that makes this picture; with a wipe that is what is rendered of it, the left side first.
    pub(super) fn command(&self, output: &str) -> String {
        let asked = self.asked(self.main_side(), self.main.size().unwrap_or([1280, 720]));
        let picture = Picture {
            source: &self.source,
            scene: &self.posed,
            size: asked.size,
            preset: &self.state.preset,
            settings: &asked.settings,
            camera: &self.navigator.camera,
            layer: asked.layer,
            exposure: self.state.exposure,
            seed: self.seed,
            time: self.time,
            animation: self.animation,
            changes: &self.state.changes,
        };
        picture.command(output)
    }

    /// What the picture has that no command line says.
    pub(super) fn beside_the_command(&self) -> Option<&'static str> {
        match (self.frozen, self.asked(self.main_side(), [1, 1]).alone.is_some()) {
            (_, true) => Some("but for the VPL that alone gives light here"),
            (true, _) => Some("but for the VPLs that are frozen here"),
            _ => None,
        }
    }

    /// Takes a screenshot of the next frame, if that is what is seen.
    pub(super) fn ask_for_screenshot(&mut self) {
        let hidden = match self.sides()[0] {
            _ if self.debug.is_some() => Some("the debug view is"),
            side if !side.is_drawn() => Some("the left side is"),
            _ => None,
        };
        match hidden {
            Some(what) => self.refuse(format!("a screenshot has what is rendered, which {what} not")),
            None => self.screenshot = true,
        }
    }

    /// The picture as PNG and EXR, and the settings beside it with the command line that makes it again.
    pub(super) fn take_screenshot(&mut self) {
        self.screenshot = false;
        match self.write_screenshot() {
            Ok(name) => self.tell(format!("written: {name}.png, .exr and .toml")),
            Err(failure) => self.refuse(format!("{:#}", failure.cause)),
        }
    }

    fn write_screenshot(&mut self) -> Result<String, crate::Failure> {
        let free =
            |n: &u32| !["png", "exr", "toml"].iter().any(|end| Path::new(&format!("huygens-{n:04}.{end}")).exists());
        let number = (1..10_000).find(free).context("there are 9999 screenshots in this folder already")?;
        let name = format!("huygens-{number:04}");
        let rendered = self.main.renderer.read()?.context("nothing has been drawn yet")?;
        let Asked { settings, layer, .. } = self.asked(self.main_side(), [rendered.width, rendered.height]);
        let mut comment = self.command(&format!("{name}.png"));
        if let Some(but) = self.beside_the_command() {
            comment.push('\n');
            comment.push_str(but);
        }
        let sidecar = format!("# {}\n{}", comment.replace('\n', "\n# "), settings.to_toml());
        let target = |end: &str| Target::new("screenshot", Path::new(&format!("{name}.{end}")));
        output::write(&[
            (target("png")?, Format::Png.encode(&rendered, layer)?),
            (target("exr")?, Format::Exr.encode(&rendered, layer)?),
            (target("toml")?, sidecar.into_bytes()),
        ])?;
        Ok(name)
    }

    /// Begins to record numbered pictures, or ends.
    pub(super) fn record(&mut self) {
        if let Some(recording) = self.recording.take() {
            self.tell(format!("{} pictures in {}", recording.next, recording.folder.display()));
            return;
        }
        let folder =
            (1..10_000).map(|n| PathBuf::from(format!("huygens-recording-{n:04}"))).find(|path| !path.exists());
        let folder = folder.unwrap_or_default();
        match std::fs::create_dir(&folder) {
            Ok(()) => self.recording = Some(Recording { folder, next: 0 }),
            Err(error) => {
                self.refuse(format!("{}: {error}; allowed: a current folder that can be written", folder.display()))
            }
        }
    }

    /// Writes the frame that was just drawn, while pictures are recorded.
    pub(super) fn record_frame(&mut self) -> Result<(), crate::Failure> {
        if self.recording.is_none() {
            return Ok(());
        }
        let layer = self.asked(self.main_side(), [1, 1]).layer;
        let rendered = self.main.renderer.read()?;
        if let (Some(recording), Some(rendered)) = (&mut self.recording, rendered) {
            let path = recording.folder.join(format!("frame-{:05}.png", recording.next));
            let target = Target::new("recording", &path)?;
            output::write(&[(target, Format::Png.encode(&rendered, layer)?)])?;
            recording.next += 1;
        }
        Ok(())
    }
}
