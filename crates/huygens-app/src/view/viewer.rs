//! The window: what it shows, and what happens to keys and pointer.

use std::cell::Cell;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::time::{Duration, Instant};

use anyhow::Context as _;
use eframe::egui;
use egui::{Align2, Color32, PointerButton, Rect, Sense, Ui, ViewportCommand};
use glam::{Quat, Vec2, Vec3};
use huygens::gl::Context;
use huygens::reference::Bvh;
use huygens::settings::{DIAL, Key, Model, PRESETS, Visibility};
use huygens::{DebugView, Exposure, Layer, RenderOptions, Scene, Settings};

use super::command::Picture;
use super::drawing::{Asked, Drawing};
use super::gizmo::{self, Moved, Screen};
use super::keys::{Action, BINDINGS, HELD};
use super::lattice::{self, Overlay};
use super::load::{Answer, Dialog, Loading, Watch};
use super::navigate::Navigator;
use super::numbers::Times;
use super::panel;
use super::trace::{Tracing, Wanted};
use super::wipe::{ErrorView, Side, Wipe};
use crate::input::{self, Changes};
use crate::output::{self, Format, Target};

/// A longer step of time than that, s, is not what was meant: the window was hidden, or a frame took too long.
const LONGEST_STEP: f32 = 0.25;

/// Recorded pictures are so far apart in the time of animations, 1/s.
const RECORDED_FPS: f64 = 30.0;

/// What is told is shown for so long.
const TOLD: Duration = Duration::from_secs(6);

/// Name under which recent scenes are kept.
const RECENT: &str = "recent";

/// What can be undone.
#[derive(Clone, PartialEq)]
struct State {
    settings: Settings,
    preset: String,
    layer: Layer,
    exposure: Exposure,
    changes: Changes,
}

/// What a debug view shows in place of the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Debug {
    None,
    ShadowMap,
    IsmAtlas,
    /// Of the VPL that is chosen, or the first.
    IsmTile,
    VplTexture,
}

impl Debug {
    const ALL: [(Debug, &'static str); 5] = [
        (Debug::None, "nothing"),
        (Debug::ShadowMap, "shadow map"),
        (Debug::IsmAtlas, "ISM atlas"),
        (Debug::IsmTile, "ISM tile"),
        (Debug::VplTexture, "VPL texture"),
    ];
}

/// What a click chose.
#[derive(Clone, Copy, PartialEq)]
enum Chosen {
    Light,
    Thing(usize),
    Vpl(usize),
}

/// Numbered pictures that are being recorded.
struct Recording {
    folder: PathBuf,
    next: u32,
}

/// Where a window leaves what the next one begins with, if it has lost its context.
pub type Heir = Rc<Cell<Option<Start>>>;

/// A scene to begin with.
pub struct Start {
    pub source: OsString,
    /// At rest.
    pub scene: Scene,
    pub settings: Settings,
    pub preset: String,
    pub options: RenderOptions,
    pub changes: Changes,
    pub time: Option<f64>,
    pub animation: Option<usize>,
}

pub struct Viewer {
    /// Takes what a window has to begin with where the context of this one is lost.
    heir: Heir,
    main: Drawing,
    /// The right side of a wipe.
    other: Option<Drawing>,
    wipe: Wipe,
    tracing: Tracing,
    error: ErrorView,
    source: OsString,
    /// At rest.
    scene: Scene,
    /// As it is drawn, and a number that rises whenever that changes.
    posed: Scene,
    posed_version: u64,
    /// What it was posed with.
    posed_with: (Changes, Option<f64>, Option<usize>),
    /// Seconds that animations have played; `None` at rest.
    time: Option<f64>,
    animation: Option<usize>,
    playing: bool,
    camera_index: usize,
    navigator: Navigator,
    seed: u32,
    state: State,
    undoer: egui::util::undoer::Undoer<State>,
    keys: Vec<Key>,
    /// One of so many pixels along each edge is drawn.
    coarseness: u32,
    target_fps: f64,
    frozen: bool,
    /// The chosen VPL alone gives light.
    alone: bool,
    debug: Debug,
    times: Times,
    frames: Vec<Instant>,
    /// What is told: wrong or right.
    message: Option<(bool, String)>,
    told: Option<Instant>,
    overlay: Overlay,
    chosen: Option<Chosen>,
    /// For the picking of things, of the scene with that version.
    tree: Option<(u64, Bvh)>,
    loading: Option<Loading>,
    dialog: Option<Dialog>,
    watch: Option<Watch>,
    #[cfg(debug_assertions)]
    shaders: Option<Watch>,
    recent: Vec<String>,
    path: String,
    title: String,
    recording: Option<Recording>,
    help: bool,
    panel: bool,
}

impl Viewer {
    pub fn new(creation: &eframe::CreationContext<'_>, start: Start, heir: Heir) -> huygens::Result<Self> {
        let Start { source, scene, settings, preset, options, changes, time, animation } = start;
        let context: Rc<Context> = Context::of_eframe(creation)?;
        let software = context.info().software;
        let navigator = Navigator::new(options.camera, scene.bounds());
        let recent = creation.storage.and_then(|storage| storage.get_string(RECENT)).unwrap_or_default();
        let mut viewer = Self {
            heir,
            main: Drawing::new(context)?,
            other: None,
            wipe: Wipe::default(),
            tracing: Tracing::default(),
            error: ErrorView::default(),
            posed: scene.clone(),
            posed_version: 0,
            posed_with: (Changes::default(), None, None),
            time,
            animation,
            playing: false,
            camera_index: 0,
            navigator,
            seed: options.seed,
            state: State { settings, preset, layer: options.layer, exposure: options.exposure, changes },
            undoer: egui::util::undoer::Undoer::default(),
            keys: huygens::settings::keys(),
            coarseness: if software { 2 } else { 1 },
            target_fps: if software { 5.0 } else { 60.0 },
            frozen: false,
            alone: false,
            debug: Debug::None,
            times: Times::default(),
            frames: Vec::new(),
            message: None,
            told: None,
            overlay: Overlay { shown: false, by_shell: true, rays: false, hemispheres: false },
            chosen: None,
            tree: None,
            loading: None,
            dialog: None,
            watch: Watch::new(&source, &scene, &creation.egui_ctx),
            #[cfg(debug_assertions)]
            shaders: watch_shaders(&creation.egui_ctx),
            recent: recent.lines().map(str::to_owned).collect(),
            path: source.to_string_lossy().into_owned(),
            source,
            recording: None,
            title: String::new(),
            help: false,
            panel: true,
            scene,
        };
        viewer.remember();
        viewer.pose();
        Ok(viewer)
    }

    /// Ends this window, whose context is lost, for another one with the same scene.
    fn bequeath(&mut self, ctx: &egui::Context) {
        let [width, height] = self.main.size().unwrap_or([1280, 720]);
        self.heir.set(Some(Start {
            source: self.source.clone(),
            scene: self.scene.clone(),
            settings: self.state.settings.clone(),
            preset: self.state.preset.clone(),
            options: RenderOptions {
                layer: self.state.layer,
                exposure: self.state.exposure,
                seed: self.seed,
                ..RenderOptions::new(width, height, self.navigator.camera.clone())
            },
            changes: self.state.changes.clone(),
            time: self.time,
            animation: self.animation,
        }));
        ctx.send_viewport_cmd(ViewportCommand::Close);
    }

    /// Puts the scene first in the list of recent ones.
    fn remember(&mut self) {
        let name = match Path::new(&self.source).canonicalize() {
            Ok(path) => path.to_string_lossy().into_owned(),
            Err(_) => self.source.to_string_lossy().into_owned(),
        };
        self.recent.retain(|other| *other != name);
        self.recent.insert(0, name);
        self.recent.truncate(12);
    }

    fn refuse(&mut self, problem: impl ToString) {
        (self.message, self.told) = (Some((true, problem.to_string())), None);
    }

    fn tell(&mut self, text: impl ToString) {
        (self.message, self.told) = (Some((false, text.to_string())), None);
    }

    fn open(&mut self, source: OsString, ctx: &egui::Context) {
        self.loading = Some(Loading::start(source, false, ctx));
    }

    /// What came from other threads: scenes, dialogs, files that changed.
    fn receive(&mut self, ctx: &egui::Context) {
        for file in ctx.input(|i| i.raw.dropped_files.clone()) {
            self.open(file.path().as_os_str().to_owned(), ctx);
        }
        if let Some(asked) = self.dialog.as_ref().and_then(Dialog::take) {
            self.dialog = None;
            match asked {
                Some(Answer::Scene(path)) => self.open(path.into_os_string(), ctx),
                Some(Answer::LoadSettings(path)) => self.load_settings(&path),
                Some(Answer::SaveSettings(path)) => self.save_settings(&path),
                None => {}
            }
        }
        if self.watch.as_mut().is_some_and(|watch| watch.changed(ctx)) && self.loading.is_none() {
            self.loading = Some(Loading::start(self.source.clone(), true, ctx));
        }
        #[cfg(debug_assertions)]
        if self.shaders.as_mut().is_some_and(|shaders| shaders.changed(ctx)) {
            match self.main.renderer.reload_shaders() {
                Ok(()) => self.tell("shaders read again"),
                Err(error) => self.refuse(error),
            }
            self.main.forget();
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
            [] => None,
            [first] => Some((false, first.clone())),
            [first, rest @ ..] => Some((false, format!("{first} (and {} more warnings)", rest.len()))),
        };
        if scene.triangle_count() == 0 {
            self.tell("the scene has no triangles; there is only background");
        }
        self.watch = Watch::new(&source, &scene, ctx);
        (self.scene, self.source, self.chosen) = (scene, source, None);
        let things = self.scene.instances.len();
        self.state.changes.moves.retain(|thing, _| *thing < things);
        self.animation = self.animation.filter(|animation| *animation < self.scene.animations().len());
        if !again {
            self.path = self.source.to_string_lossy().into_owned();
            self.remember();
            self.state.changes = Changes::default();
            (self.time, self.animation, self.playing) = (None, None, false);
            self.go_to_camera(0);
        }
        self.pose();
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

    /// The command line that makes this picture.
    fn command(&self, output: &str) -> String {
        // With a wipe that is the left side.
        let asked = self.asked(self.sides()[0], self.main.size().unwrap_or([1280, 720]));
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

    /// The picture as PNG and EXR, and the settings beside it with the command line that makes it again.
    fn screenshot(&mut self) {
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
        let Asked { settings, layer, .. } = self.asked(self.sides()[0], [rendered.width, rendered.height]);
        let sidecar = format!("# {}\n{}", self.command(&format!("{name}.png")), settings.to_toml());
        let target = |end: &str| Target::new("screenshot", Path::new(&format!("{name}.{end}")));
        output::write(&[
            (target("png")?, Format::Png.encode(&rendered, layer)?),
            (target("exr")?, Format::Exr.encode(&rendered, layer)?),
            (target("toml")?, sidecar.into_bytes()),
        ])?;
        Ok(name)
    }

    /// Begins to record numbered pictures, or ends.
    fn record(&mut self) {
        if let Some(recording) = self.recording.take() {
            self.tell(format!("{} pictures in {}", recording.next, recording.folder.display()));
            return;
        }
        let folder =
            (1..10_000).map(|n| PathBuf::from(format!("huygens-recording-{n:04}"))).find(|path| !path.exists());
        let folder = folder.unwrap_or_default();
        match std::fs::create_dir(&folder) {
            Ok(()) => self.recording = Some(Recording { folder, next: 0 }),
            Err(error) => self.refuse(format!("{}: {error}", folder.display())),
        }
    }

    /// Writes the frame that was just drawn, while pictures are recorded.
    fn record_frame(&mut self) -> Result<(), crate::Failure> {
        if self.recording.is_none() {
            return Ok(());
        }
        let rendered = self.main.renderer.read()?;
        if let (Some(recording), Some(rendered)) = (&mut self.recording, rendered) {
            let path = recording.folder.join(format!("frame-{:05}.png", recording.next));
            let target = Target::new("recording", &path)?;
            output::write(&[(target, Format::Png.encode(&rendered, self.state.layer)?)])?;
            recording.next += 1;
        }
        Ok(())
    }

    /// What a frame is asked to be, of one side of the picture.
    fn asked(&self, side: Side, size: [u32; 2]) -> Asked {
        let mut settings = self.state.settings.clone();
        let mut layer = self.state.layer;
        match side {
            Side::Direct => layer = Layer::Direct,
            Side::Wave => settings.model = Model::Wave,
            Side::Reflected => settings.model = Model::Reflected,
            Side::AsSet | Side::Traced | Side::Error => {}
        }
        let vpl = match self.chosen {
            Some(Chosen::Vpl(vpl)) => Some(vpl as u32),
            _ => None,
        };
        Asked {
            settings,
            navigator: self.navigator.clone(),
            size,
            layer,
            exposure: self.state.exposure,
            seed: self.seed,
            scene: self.posed_version,
            frozen: self.frozen,
            alone: vpl.filter(|_| self.alone),
            debug: match self.debug {
                Debug::None => None,
                Debug::ShadowMap => Some(DebugView::ShadowMap),
                Debug::IsmAtlas => Some(DebugView::IsmAtlas),
                Debug::IsmTile => Some(DebugView::IsmTile(vpl.unwrap_or(0))),
                Debug::VplTexture => Some(DebugView::VplTexture),
            },
            target_fps: self.target_fps,
        }
    }

    /// Draws what differs from what was drawn last; whether there is more to draw.
    fn draw(&mut self, frame: &mut eframe::Frame, size: [u32; 2], ctx: &egui::Context) -> huygens::Result<bool> {
        let [left, right] = self.sides();
        let right = self.wipe.on.then_some(right);
        let asked = self.asked(left, size);
        let times = &mut self.times;
        let drawn = self.main.draw(frame, &self.posed, asked, &mut |late| times.push(late))?;
        let mut settled = self.main.is_settled();
        if drawn {
            let now = Instant::now();
            self.frames.push(now);
            self.frames.retain(|then| now.duration_since(*then).as_secs_f32() < 2.0);
            if let Err(failure) = self.record_frame() {
                self.recording = None;
                self.refuse(format!("{:#}", failure.cause));
            }
        }
        let ev = self.main.shown().map_or(0.0, |(shown, _)| shown.exposure_ev);
        match right.filter(|right| right.is_drawn() && *right != left) {
            Some(right) => {
                if self.other.is_none() {
                    self.other = Some(Drawing::new(self.main.renderer.context().clone())?);
                }
                // Both sides are as bright.
                let asked = Asked {
                    exposure: Exposure::Ev(ev),
                    frozen: false,
                    debug: None,
                    alone: None,
                    ..self.asked(right, size)
                };
                if let Some(other) = &mut self.other {
                    other.draw(frame, &self.posed, asked, &mut |_| ())?;
                    settled &= other.is_settled();
                }
            }
            None => self.other = None,
        }
        let shows = |wanted: Side| left == wanted || right == Some(wanted);
        if shows(Side::Traced) || shows(Side::Error) {
            let wanted = Wanted { camera: self.navigator.camera.clone(), size, scene: self.posed_version };
            self.tracing.want(wanted, &self.posed, ctx);
            if shows(Side::Error) {
                self.error.update(ctx, &mut self.main, &self.tracing, self.state.layer, size, ev)?;
            }
        } else {
            self.tracing.stop();
        }
        Ok(!settled)
    }

    /// What is left and, with a wipe, right.
    fn sides(&self) -> [Side; 2] {
        if self.wipe.on { [self.wipe.left, self.wipe.right] } else { [Side::AsSet; 2] }
    }

    /// The scene as time, lights and things stand now.
    fn pose(&mut self) {
        self.posed_with = (self.state.changes.clone(), self.time, self.animation);
        let posed = match self.time {
            Some(seconds) => self.scene.at(seconds, self.animation),
            None => Ok(self.scene.clone()),
        };
        let mut posed = match posed {
            Ok(posed) => posed,
            Err(error) => return self.refuse(error),
        };
        self.state.changes.apply(&mut posed);
        self.posed = posed;
        self.posed_version += 1;
    }

    fn set_preset(&mut self, name: &str) {
        if let Ok(settings) = Settings::preset(name) {
            self.state.settings = settings;
            self.state.preset = name.to_owned();
        }
    }

    /// Sets a setting to a value that may be out of its range; then it stays.
    fn set(&mut self, key: &str, value: impl ToString) {
        if let Err(error) = self.state.settings.set(key, &value.to_string()) {
            self.refuse(error);
        }
    }

    fn act(&mut self, action: Action, ctx: &egui::Context) {
        let settings = self.state.settings.clone();
        let wave = &settings.wave;
        match action {
            Action::Help => self.help = !self.help,
            Action::Model => {
                self.set("model", if settings.model == Model::Wave { "reflected" } else { "wave" });
            }
            Action::Visibility => {
                let all = [
                    Visibility::Ism,
                    Visibility::None,
                    Visibility::Ao,
                    Visibility::Dao,
                    Visibility::ShadowMaps,
                    Visibility::Mixed,
                ];
                self.set("visibility", after(&all, settings.visibility).name());
            }
            Action::Lights => {
                self.state.layer = after(&[Layer::Final, Layer::Direct, Layer::Indirect], self.state.layer);
            }
            Action::View => {
                let layers = [Layer::Final, Layer::Albedo, Layer::Normal, Layer::Depth, Layer::Ao];
                // The layers first, then what the frame is made of.
                if self.debug != Debug::None || self.state.layer == Layer::Ao {
                    self.debug = after(&Debug::ALL.map(|(debug, _)| debug), self.debug);
                    self.state.layer = Layer::Final;
                } else {
                    self.state.layer = after(&layers, self.state.layer);
                }
            }
            Action::BetterQuality | Action::WorseQuality => {
                let at = DIAL.iter().position(|&name| name == self.state.preset).unwrap_or(1);
                let next = if action == Action::BetterQuality { at + 1 } else { at.saturating_sub(1) };
                self.set_preset(DIAL[next.min(DIAL.len() - 1)]);
            }
            Action::CoarserTheta => self.set("wave.delta_theta", step(90.0, wave.delta_theta, true)),
            Action::FinerTheta => self.set("wave.delta_theta", step(90.0, wave.delta_theta, false)),
            Action::CoarserPhi => self.set("wave.delta_phi", step(360.0, wave.delta_phi, true)),
            Action::FinerPhi => self.set("wave.delta_phi", step(360.0, wave.delta_phi, false)),
            Action::FewerShells => self.set("wave.shells", wave.shells.saturating_sub(1).max(1)),
            Action::MoreShells => self.set("wave.shells", (wave.shells + 1).min(16)),
            Action::SmallerFraction => self.set("wave.fraction", (wave.fraction * 0.5).max(0.001)),
            Action::LargerFraction => self.set("wave.fraction", (wave.fraction * 2.0).min(1.0)),
            Action::LightOnOff => self.state.changes.dark = !self.state.changes.dark,
            Action::Play => self.playing = !self.playing && !self.scene.animations().is_empty(),
            Action::FrameAll => {
                let chosen = match self.chosen {
                    Some(Chosen::Thing(i)) => self.posed.instances.get(i).and_then(|i| self.posed.bounds_of(i)),
                    _ => None,
                };
                if let Some(bounds) = chosen.or_else(|| self.posed.bounds()) {
                    let aspect = self.main.size().map_or(1.0, |[width, height]| width as f32 / height as f32);
                    self.navigator.frame(bounds, aspect);
                }
            }
            Action::NextCamera => self.go_to_camera(self.camera_index + 1),
            Action::Reset => {
                (self.state.changes, self.chosen) = (Changes::default(), None);
                (self.time, self.playing) = (None, false);
                self.go_to_camera(self.camera_index);
            }
            Action::Undo => {
                if let Some(state) = self.undoer.undo(&self.state) {
                    self.state = state.clone();
                }
            }
            Action::Redo => {
                if let Some(state) = self.undoer.redo(&self.state) {
                    self.state = state.clone();
                }
            }
            Action::Panel => self.panel = !self.panel,
            Action::FullScreen => {
                let full = ctx.input(|i| i.viewport().fullscreen.unwrap_or(false));
                ctx.send_viewport_cmd(ViewportCommand::Fullscreen(!full));
            }
            Action::Quit => ctx.send_viewport_cmd(ViewportCommand::Close),
            Action::Freeze => self.frozen = !self.frozen,
            Action::Handles => {
                self.chosen = if self.chosen == Some(Chosen::Light) { None } else { Some(Chosen::Light) };
            }
            Action::Lattice => self.overlay.shown = !self.overlay.shown,
            Action::Open => self.dialog = Some(Dialog::scene(ctx)),
            Action::SaveSettings => self.dialog = Some(Dialog::save_settings(ctx)),
            Action::CopyCommand => {
                let line = self.command("huygens.png");
                ctx.copy_text(line.clone());
                self.tell(line);
            }
            Action::Screenshot => self.screenshot(),
            Action::Record => self.record(),
        }
    }

    fn go_to_camera(&mut self, index: usize) {
        if let Some(camera) = self.scene.cameras.get(index % self.scene.cameras.len().max(1)) {
            self.camera_index = index % self.scene.cameras.len();
            self.navigator = Navigator::new(camera.clone(), self.scene.bounds());
        }
    }

    /// Keys that are pressed, and those that are held.
    fn keyboard(&mut self, ctx: &egui::Context) {
        if ctx.egui_wants_keyboard_input() {
            return;
        }
        let pressed: Vec<Action> = ctx.input_mut(|input| {
            let is_pressed = |input: &mut egui::InputState, keys: &[egui::KeyboardShortcut]| {
                keys.iter().any(|key| input.consume_shortcut(key))
            };
            BINDINGS.iter().filter(|b| is_pressed(input, b.keys)).map(|b| b.action).collect()
        });
        for action in pressed {
            self.act(action, ctx);
        }
        let (seconds, held, modifiers) = ctx.input(|i| {
            let axis = |less, more| f32::from(i8::from(i.key_down(more)) - i8::from(i.key_down(less)));
            use egui::Key::{A, ArrowDown, ArrowLeft, ArrowRight, ArrowUp, D, E, Q, S, W};
            let fly = Vec3::new(axis(A, D), axis(Q, E), axis(S, W));
            let arrows = Vec2::new(axis(ArrowLeft, ArrowRight), axis(ArrowDown, ArrowUp));
            (i.stable_dt.min(LONGEST_STEP), (fly, arrows), i.modifiers)
        });
        let (fly, arrows) = held;
        if fly != Vec3::ZERO && !modifiers.command {
            self.navigator.fly(fly, seconds);
            ctx.request_repaint();
        }
        if arrows != Vec2::ZERO {
            self.move_light(arrows * seconds, modifiers);
            ctx.request_repaint();
        }
    }

    /// Moves the primary light across the view, along it with Shift, or turns it with Ctrl.
    fn move_light(&mut self, by: Vec2, modifiers: egui::Modifiers) {
        let Some(light) = self.posed.lights.first() else { return };
        let (mut position, mut axis) = (light.position, light.axis);
        let camera = &self.navigator.camera;
        let right = camera.forward.cross(camera.up);
        if modifiers.command {
            let turn = Quat::from_axis_angle(camera.up, by.x) * Quat::from_axis_angle(right, by.y);
            axis = (turn * axis).normalize_or(axis);
        } else {
            let speed = 0.4 * self.posed.bounds().map_or(1.0, |b| b.radius());
            let along = if modifiers.shift { camera.forward } else { camera.up };
            position += (right * by.x + along * by.y) * speed;
        }
        self.state.changes.light = (Some(position), Some(axis));
    }

    /// What is under the pointer becomes what is chosen: a VPL if they are shown, else a thing.
    fn choose(&mut self, screen: &Screen, at: egui::Pos2) {
        if self.overlay.shown
            && let Some(vpl) = lattice::pick(screen, self.main.renderer.vpls(), at)
        {
            self.chosen = Some(Chosen::Vpl(vpl));
            return;
        }
        if self.tree.as_ref().is_none_or(|(version, _)| *version != self.posed_version) {
            self.tree = Some((self.posed_version, Bvh::new(&self.posed)));
        }
        let (origin, direction) = screen.ray(at);
        let hit = self.tree.as_ref().and_then(|(_, tree)| tree.closest(origin, direction, 0.0, f32::INFINITY));
        let chosen = hit.map(|hit| Chosen::Thing(hit.instance));
        self.chosen = chosen.filter(|chosen| self.chosen != Some(*chosen));
    }

    /// Handles on the light and on what is chosen.
    fn gizmos(&mut self, ui: &Ui, screen: &Screen) {
        if self.chosen == Some(Chosen::Light)
            && let Some(light) = self.posed.lights.first()
        {
            let (position, axis) = (light.position, light.axis);
            let moved = match gizmo::show(ui, screen, "light", position, Some(axis)) {
                Some(Moved::By(by)) => Some((position + by, axis)),
                Some(Moved::Facing(axis)) => Some((position, axis)),
                None => None,
            };
            if let Some((position, axis)) = moved {
                self.state.changes.light = (Some(position), Some(axis));
            }
        }
        if let Some(Chosen::Thing(index)) = self.chosen
            && let Some(bounds) = self.posed.instances.get(index).and_then(|thing| self.posed.bounds_of(thing))
            && let Some(Moved::By(by)) = gizmo::show(ui, screen, "thing", bounds.center(), None)
        {
            *self.state.changes.moves.entry(index).or_insert(Vec3::ZERO) += by;
        }
    }

    fn pointer(&mut self, ui: &Ui, response: &egui::Response) {
        let delta = response.drag_delta();
        let drag = Vec2::new(delta.x, delta.y) / response.rect.height().max(1.0);
        let shift = ui.input(|i| i.modifiers.shift);
        if response.dragged_by(PointerButton::Middle) || (shift && response.dragged_by(PointerButton::Primary)) {
            self.navigator.pan(drag);
        } else if response.dragged_by(PointerButton::Primary) {
            self.navigator.orbit(drag * std::f32::consts::PI);
        } else if response.dragged_by(PointerButton::Secondary) {
            self.navigator.look(drag * std::f32::consts::FRAC_PI_2);
        }
        if response.hovered() {
            let (scroll, zoom, right) =
                ui.input(|i| (i.smooth_scroll_delta().y, i.zoom_delta(), i.pointer.secondary_down()));
            let steps = scroll / 40.0 + zoom.ln() * 10.0;
            if steps != 0.0 && steps.is_finite() {
                if right { self.navigator.faster(steps) } else { self.navigator.zoom(steps) }
            }
        }
    }

    /// The picture, which fills what the panels leave.
    fn picture(&mut self, ui: &mut Ui, frame: &mut eframe::Frame) {
        let (rect, response) = ui.allocate_exact_size(ui.available_size(), Sense::click_and_drag());
        self.pointer(ui, &response);
        let pixels = rect.size() * ui.ctx().pixels_per_point() / self.coarseness as f32;
        let size = [pixels.x, pixels.y].map(|x| x.round().clamp(0.0, 16384.0) as u32);
        if size.iter().all(|&n| n > 0) {
            match self.draw(frame, size, ui.ctx()) {
                Ok(true) => ui.ctx().request_repaint(),
                Ok(false) => {}
                Err(error) => self.refuse(error),
            }
        }
        self.paint(ui, rect);
        let camera = self.navigator.camera.clone();
        let screen = Screen { camera: &camera, rect };
        if let Some(at) = response.interact_pointer_pos().filter(|_| response.clicked()) {
            self.choose(&screen, at);
        }
        if self.overlay.shown {
            let settings = &self.state.settings;
            // Rays that meet black surfaces are left out whole.
            let shells = settings.wave.shells as usize;
            let whole = settings.model == Model::Wave
                && settings.wave.fraction >= 1.0
                && self.main.renderer.vpls().len().is_multiple_of(shells);
            let shells = whole.then_some(shells);
            let chosen = match self.chosen {
                Some(Chosen::Vpl(vpl)) => Some(vpl),
                _ => None,
            };
            let light = self.posed.lights.first();
            lattice::show(ui.painter(), &screen, self.overlay, self.main.renderer.vpls(), shells, light, chosen);
        }
        let before = self.state.changes.clone();
        self.gizmos(ui, &screen);
        if before != self.state.changes {
            ui.ctx().request_repaint();
        }
        self.heads_up(ui, rect);
    }

    /// The picture, or two with a line between them.
    fn paint(&mut self, ui: &mut Ui, rect: Rect) {
        let ev = self.main.shown().map_or(0.0, |(shown, _)| shown.exposure_ev);
        let [left, right] = self.sides();
        let middle = rect.left() + rect.width() * self.wipe.at;
        let parts = match self.wipe.on {
            false => vec![(left, rect)],
            true => vec![(left, rect.with_max_x(middle)), (right, rect.with_min_x(middle))],
        };
        for (place, (side, part)) in parts.into_iter().enumerate() {
            let drawn = match (place, &self.other) {
                (1, Some(other)) => other.shown(),
                _ => self.main.shown(),
            };
            let from_the_top = Rect::from_min_max(egui::pos2(0.0, 0.0), egui::pos2(1.0, 1.0));
            let from_below = Rect::from_min_max(egui::pos2(0.0, 1.0), egui::pos2(1.0, 0.0));
            let image = match side {
                Side::Traced => self.tracing.texture(ui.ctx(), self.state.layer, ev).map(|id| (id, from_the_top)),
                Side::Error => self.error.texture().map(|id| (id, from_the_top)),
                _ => drawn.map(|(_, id)| (id, from_below)),
            };
            let painter = ui.painter().with_clip_rect(part);
            if self.debug != Debug::None && place == 0 {
                painter.rect_filled(part, 0.0, Color32::from_gray(32));
                match self.main.debug() {
                    Some((shown, id)) => {
                        let pixels = egui::vec2(shown.width as f32, shown.height as f32);
                        let fitting = (part.width() / pixels.x).min(part.height() / pixels.y);
                        let place = Rect::from_center_size(part.center(), pixels * fitting);
                        painter.image(id, place, from_below, Color32::WHITE);
                    }
                    None => {
                        outlined(&painter, part.center(), Align2::CENTER_CENTER, "there is none with these settings")
                    }
                }
            } else if let Some((id, uv)) = image {
                painter.image(id, rect, uv, Color32::WHITE);
            }
            if self.wipe.on {
                let text = match side {
                    Side::Traced => format!("{}, {} paths", side.name(), self.tracing.samples()),
                    Side::Error => self.error.text(),
                    side => side.name().to_owned(),
                };
                let (at, align) = match place {
                    0 => (part.left_top() + egui::vec2(8.0, 8.0), Align2::LEFT_TOP),
                    _ => (part.right_top() + egui::vec2(-8.0, 8.0), Align2::RIGHT_TOP),
                };
                outlined(&painter, at, align, &text);
            }
        }
        if self.wipe.on {
            let line = Rect::from_x_y_ranges(middle - 5.0..=middle + 5.0, rect.y_range());
            let response = ui.interact(line, ui.scope_id().with("wipe"), Sense::drag());
            if response.dragged() {
                self.wipe.at = (self.wipe.at + response.drag_delta().x / rect.width()).clamp(0.02, 0.98);
            }
            if response.hovered() || response.dragged() {
                ui.ctx().set_cursor_icon(egui::CursorIcon::ResizeHorizontal);
            }
            ui.painter().vline(middle, rect.y_range(), egui::Stroke::new(2.0, Color32::WHITE));
        }
    }

    fn heads_up(&self, ui: &Ui, rect: Rect) {
        let text = self.summary();
        outlined(ui.painter(), rect.left_bottom() + egui::vec2(8.0, -8.0), Align2::LEFT_BOTTOM, &text);
    }

    fn summary(&self) -> String {
        let frames = self.frames.len();
        let span = match self.frames.as_slice() {
            [first, .., last] => last.duration_since(*first).as_secs_f64(),
            _ => 0.0,
        };
        let fps = if span > 0.0 { (frames - 1) as f64 / span } else { 0.0 };
        let (gpu, cpu) = self.times.last();
        let (on, all) = (self.main.renderer.vpls().len(), self.main.renderer.all_vpls());
        let still = if self.main.is_settled() { "  still" } else { "" };
        let made = self.main.renderer.isms_made();
        let making = if made < 1.0 { format!("  ISMs {:.0} %", made * 100.0) } else { String::new() };
        let recording = self.recording.as_ref().map_or_else(String::new, |r| format!("  recording {}", r.next));
        format!("{on} of {all} VPLs  GPU {gpu:.1} ms  CPU {cpu:.1} ms  {fps:.0} fps{making}{still}{recording}")
    }

    fn side_panel(&mut self, ui: &mut Ui) {
        self.file_row(ui);
        egui::ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
            egui::CollapsingHeader::new("View").default_open(true).show(ui, |ui| self.view_rows(ui));
            if !self.scene.animations().is_empty() {
                egui::CollapsingHeader::new("Animation").default_open(true).show(ui, |ui| self.animation_rows(ui));
            }
            egui::CollapsingHeader::new("Light and things").show(ui, |ui| self.things_rows(ui));
            egui::CollapsingHeader::new("VPLs").show(ui, |ui| self.vpl_rows(ui));
            egui::CollapsingHeader::new("Comparison").show(ui, |ui| self.wipe_rows(ui));
            egui::CollapsingHeader::new("Numbers").show(ui, |ui| self.number_rows(ui));
            egui::CollapsingHeader::new("Settings").default_open(true).show(ui, |ui| self.settings_rows(ui));
        });
    }

    fn file_row(&mut self, ui: &mut Ui) {
        let ctx = ui.ctx().clone();
        let mut open = None;
        ui.horizontal(|ui| {
            if ui.button("Open…").on_hover_text("a .gltf or .glb file; one may be dropped on the window too").clicked()
            {
                self.dialog = Some(Dialog::scene(&ctx));
            }
            ui.menu_button("Recent", |ui| {
                let builtin = huygens::scene::BUILTIN_NAMES.iter().map(|(name, _)| format!("builtin:{name}"));
                let all = self.recent.iter().cloned().chain(builtin.filter(|name| !self.recent.contains(name)));
                for name in all.collect::<Vec<_>>() {
                    if ui.button(&name).clicked() {
                        open = Some(name);
                    }
                }
            });
            if ui.button("Screenshot").on_hover_text("PNG, EXR and the settings, in the current folder").clicked() {
                self.screenshot();
            }
            if ui.button("?").on_hover_text("keys and pointer").clicked() {
                self.help = true;
            }
        });
        ui.horizontal(|ui| {
            let field = egui::TextEdit::singleline(&mut self.path).desired_width(ui.available_width() - 8.0);
            let response = ui.add(field).on_hover_text("a file or a built-in scene; Enter opens it");
            if response.lost_focus() && ui.input(|i| i.key_pressed(egui::Key::Enter)) {
                open = Some(self.path.clone());
            }
        });
        if let Some(name) = open {
            self.open(name.into(), &ctx);
        }
        if let Some(loading) = &self.loading {
            let mut cancel = false;
            ui.horizontal(|ui| {
                cancel = ui.button("Cancel").clicked();
                let name = Path::new(&loading.source).file_name().unwrap_or(&loading.source).to_string_lossy();
                ui.add(egui::ProgressBar::new(loading.progress()).text(format!("loading {name}")).animate(true));
            });
            if cancel {
                self.loading = None;
            }
        }
        ui.separator();
    }

    fn view_rows(&mut self, ui: &mut Ui) {
        let cameras: Vec<String> = self.scene.cameras.iter().map(|camera| camera.name.clone()).collect();
        egui::Grid::new("view").num_columns(2).show(ui, |ui| {
            ui.label("shows");
            egui::ComboBox::from_id_salt("layer").selected_text(self.state.layer.name()).show_ui(ui, |ui| {
                for layer in Layer::ALL {
                    ui.selectable_value(&mut self.state.layer, layer, layer.name());
                }
            });
            ui.end_row();
            ui.label("or, in its place");
            let debug = Debug::ALL.iter().find(|(debug, _)| *debug == self.debug).map_or("", |(_, name)| name);
            egui::ComboBox::from_id_salt("debug").selected_text(debug).show_ui(ui, |ui| {
                for (debug, name) in Debug::ALL {
                    ui.selectable_value(&mut self.debug, debug, name);
                }
            });
            ui.end_row();
            ui.label("camera");
            let name = |i: usize| match cameras.get(i).map(String::as_str) {
                None | Some("") => format!("{i}"),
                Some(name) => format!("{i} {name}"),
            };
            egui::ComboBox::from_id_salt("camera").selected_text(name(self.camera_index)).show_ui(ui, |ui| {
                for i in 0..cameras.len() {
                    if ui.selectable_label(i == self.camera_index, name(i)).clicked() {
                        self.go_to_camera(i);
                    }
                }
            });
            ui.end_row();
            ui.label("exposure");
            ui.horizontal(|ui| {
                let mut auto = self.state.exposure == Exposure::Auto;
                let now = self.main.shown().map_or(0.0, |(shown, _)| shown.exposure_ev);
                if ui.checkbox(&mut auto, "auto").changed() {
                    self.state.exposure = if auto { Exposure::Auto } else { Exposure::Ev(now) };
                }
                match &mut self.state.exposure {
                    Exposure::Auto => drop(ui.weak(format!("{now:.2} EV"))),
                    Exposure::Ev(ev) => {
                        drop(ui.add(egui::DragValue::new(ev).range(-64.0..=64.0).speed(0.02).suffix(" EV")))
                    }
                }
            });
            ui.end_row();
            ui.label("pixels").on_hover_text("one of so many along each edge is drawn");
            egui::ComboBox::from_id_salt("pixels").selected_text(format!("1/{}", self.coarseness)).show_ui(ui, |ui| {
                for n in [1, 2, 4, 8] {
                    ui.selectable_value(&mut self.coarseness, n, format!("1/{n}"));
                }
            });
            ui.end_row();
            ui.label("frames a second").on_hover_text("a pixel sums as many VPLs in a frame as leave time for that");
            ui.add(egui::DragValue::new(&mut self.target_fps).range(1.0..=240.0).speed(0.2).max_decimals(1));
            ui.end_row();
            ui.label("speed of flight");
            ui.add(egui::DragValue::new(&mut self.navigator.speed).range(1e-6..=1e6).speed(0.01).suffix(" m/s"));
            ui.end_row();
        });
    }

    fn animation_rows(&mut self, ui: &mut Ui) {
        let animations = self.scene.animations();
        let names: Vec<String> = animations.iter().map(|animation| animation.name.clone()).collect();
        let longest = animations.iter().map(|animation| animation.duration).fold(0.0, f64::max);
        let text = |i: Option<usize>| match i.map(|i| (i, names[i].as_str())) {
            None => "all".to_owned(),
            Some((i, "")) => format!("{i}"),
            Some((i, name)) => format!("{i} {name}"),
        };
        ui.horizontal(|ui| {
            if ui.button(if self.playing { "⏸" } else { "▶" }).on_hover_text("Space").clicked() {
                self.playing = !self.playing;
            }
            egui::ComboBox::from_id_salt("animation").selected_text(text(self.animation)).show_ui(ui, |ui| {
                for i in std::iter::once(None).chain((0..names.len()).map(Some)) {
                    ui.selectable_value(&mut self.animation, i, text(i));
                }
            });
        });
        let mut time = self.time.unwrap_or(0.0);
        let slider =
            egui::Slider::new(&mut time, 0.0..=longest.max(1e-3)).suffix(" s").clamping(egui::SliderClamping::Never);
        if ui.add(slider).changed() {
            self.time = Some(time.max(0.0));
        }
    }

    fn things_rows(&mut self, ui: &mut Ui) {
        let mut on = !self.state.changes.dark;
        ui.horizontal(|ui| {
            ui.checkbox(&mut on, "primary light");
            let held = self.chosen == Some(Chosen::Light);
            if ui.selectable_label(held, "move").on_hover_text("handles on the picture (G); arrow keys too").clicked() {
                self.chosen = if held { None } else { Some(Chosen::Light) };
            }
        });
        self.state.changes.dark = !on;
        if let Some(light) = self.posed.lights.first() {
            let (mut position, mut axis) = (light.position, light.axis);
            let mut changed = false;
            let speed = 0.002 * self.navigator.distance;
            for (name, vector) in [("at, m", &mut position), ("facing", &mut axis)] {
                ui.horizontal(|ui| {
                    for x in vector.as_mut() {
                        changed |= ui.add(egui::DragValue::new(x).speed(speed).max_decimals(3)).changed();
                    }
                    ui.label(name);
                });
            }
            if changed && position.is_finite() {
                let axis = axis.try_normalize().unwrap_or(light.axis);
                self.state.changes.light = (Some(position), Some(axis));
            }
        }
        match self.chosen {
            Some(Chosen::Thing(index)) => {
                let mesh = self.posed.instances.get(index).map(|instance| &self.posed.meshes[instance.mesh]);
                let name = mesh.map_or("", |mesh| mesh.name.as_str());
                ui.label(format!("thing {index} {name}"));
                let mut by = self.state.changes.moves.get(&index).copied().unwrap_or(Vec3::ZERO);
                let mut changed = false;
                ui.horizontal(|ui| {
                    for x in by.as_mut() {
                        let drag = egui::DragValue::new(x).speed(0.002 * self.navigator.distance).max_decimals(3);
                        changed |= ui.add(drag).changed();
                    }
                    ui.label("moved by, m");
                });
                if changed && by.is_finite() {
                    self.state.changes.moves.insert(index, by);
                }
            }
            _ => drop(ui.weak("a click on the picture chooses a thing")),
        }
    }

    fn vpl_rows(&mut self, ui: &mut Ui) {
        ui.checkbox(&mut self.overlay.shown, "show (K)");
        ui.horizontal(|ui| {
            ui.selectable_value(&mut self.overlay.by_shell, true, "by shell");
            ui.selectable_value(&mut self.overlay.by_shell, false, "by intensity");
        });
        ui.horizontal(|ui| {
            ui.checkbox(&mut self.overlay.rays, "rays");
            ui.checkbox(&mut self.overlay.hemispheres, "hemispheres");
        });
        ui.checkbox(&mut self.frozen, "freeze (Z)").on_hover_text("VPLs stay as they are, whatever moves");
        ui.checkbox(&mut self.alone, "the chosen one alone gives light");
        let Some(Chosen::Vpl(index)) = self.chosen else {
            ui.weak("a click on a VPL chooses it");
            return;
        };
        let Some(vpl) = self.main.renderer.vpls().get(index) else { return };
        let vector = |v: Vec3| format!("{:9.4} {:9.4} {:9.4}", v.x, v.y, v.z);
        egui::Grid::new("vpl").num_columns(2).show(ui, |ui| {
            for (name, value) in [
                ("VPL", index.to_string()),
                ("at, m", vector(vpl.position)),
                ("facing", vector(vpl.direction)),
                ("intensity, W/sr", vector(vpl.intensity)),
                ("flux, W", vector(vpl.flux())),
                ("d_min, m", format!("{:9.4}", vpl.d_min)),
            ] {
                ui.label(name);
                ui.monospace(value);
                ui.end_row();
            }
        });
    }

    fn wipe_rows(&mut self, ui: &mut Ui) {
        ui.checkbox(&mut self.wipe.on, "wipe between two").on_hover_text("drag the line on the picture");
        ui.horizontal(|ui| {
            for (name, side) in [("left", &mut self.wipe.left), ("right", &mut self.wipe.right)] {
                egui::ComboBox::from_id_salt(name).selected_text(side.name()).width(96.0).show_ui(ui, |ui| {
                    for each in Side::ALL {
                        ui.selectable_value(side, each, each.name());
                    }
                });
            }
        });
        ui.weak(
            "The path tracer refines its picture while the view is still. The error is FLIP of what is drawn on the \
                 left against it.",
        );
    }

    fn number_rows(&mut self, ui: &mut Ui) {
        let info = self.main.renderer.context().info();
        ui.label(info.renderer.as_str());
        ui.weak(format!("OpenGL {}", info.version));
        let rebuilds = self.main.renderer.rebuilds();
        let memory = self.main.renderer.context().memory() as f64 / f64::from(1 << 20);
        let most = self.main.vpls_per_pixel();
        egui::Grid::new("numbers").num_columns(2).show(ui, |ui| {
            for (name, value) in [
                ("VPLs", format!("{} of {}", self.main.renderer.vpls().len(), self.main.renderer.all_vpls())),
                ("VPLs a pixel in a frame", most.to_string()),
                ("memory on the GPU", format!("{memory:.0} MiB")),
                ("triangles", self.posed.triangle_count().to_string()),
                ("sets of VPLs made", rebuilds.vpls.to_string()),
                ("shadow maps made", rebuilds.shadow_maps.to_string()),
                ("sets of ISMs made", rebuilds.isms.to_string()),
            ] {
                ui.label(name);
                ui.monospace(value);
                ui.end_row();
            }
        });
        self.times.show(ui);
    }

    fn settings_rows(&mut self, ui: &mut Ui) {
        let ctx = ui.ctx().clone();
        let preset = self.state.preset.clone();
        ui.horizontal(|ui| {
            ui.label("preset");
            egui::ComboBox::from_id_salt("preset").selected_text(&preset).show_ui(ui, |ui| {
                for name in PRESETS {
                    if ui.selectable_label(name == preset, name).clicked() {
                        self.set_preset(name);
                    }
                }
            });
            if ui.small_button("reset").on_hover_text("all settings as the preset has them").clicked() {
                self.set_preset(&preset);
            }
        });
        ui.horizontal(|ui| {
            if ui.button("Load…").clicked() {
                self.dialog = Some(Dialog::load_settings(&ctx));
            }
            if ui.button("Save…").clicked() {
                self.dialog = Some(Dialog::save_settings(&ctx));
            }
            if ui.button("Copy command line").on_hover_text("that renders this picture").clicked() {
                self.act(Action::CopyCommand, &ctx);
            }
        });
        let base = Settings::preset(&self.state.preset).unwrap_or_default();
        if let Some(refused) = panel::settings(ui, &self.keys, &mut self.state.settings, &base) {
            self.refuse(refused);
        }
    }

    /// What is wrong stays until it is closed, what is told for a while. It lies over the picture, which keeps its size.
    fn show_message(&mut self, ctx: &egui::Context) {
        let Some((wrong, message)) = self.message.clone() else { return };
        let told = *self.told.get_or_insert_with(Instant::now);
        let left = TOLD.saturating_sub(told.elapsed());
        let mut close = !wrong && left.is_zero();
        let area = egui::Area::new(egui::Id::unique("message")).anchor(Align2::LEFT_BOTTOM, [8.0, -32.0]);
        area.order(egui::Order::Foreground).show(ctx, |ui| {
            egui::Frame::popup(ui.style()).show(ui, |ui| {
                ui.set_max_width((ctx.content_rect().width() * 0.6).max(200.0));
                ui.horizontal(|ui| {
                    close |= ui.small_button("✖").clicked();
                    let color = if wrong { ui.visuals().error_fg_color } else { ui.visuals().text_color() };
                    ui.add(egui::Label::new(egui::RichText::new(message).color(color)).wrap());
                });
            });
        });
        if !wrong {
            ctx.request_repaint_after(left);
        }
        if close {
            self.message = None;
        }
    }

    fn help_window(&mut self, ctx: &egui::Context) {
        let mut open = self.help;
        let lines: Vec<(String, &str)> = HELD
            .iter()
            .map(|(keys, meaning)| ((*keys).to_owned(), *meaning))
            .chain(BINDINGS.iter().map(|binding| (binding.keys_text(), binding.meaning)))
            .collect();
        let window = egui::Window::new("Keys and pointer").open(&mut open).resizable(false);
        window.anchor(Align2::CENTER_CENTER, [0.0, 0.0]).show(ctx, |ui| {
            let most = (ctx.content_rect().height() - 80.0).max(100.0);
            egui::ScrollArea::vertical().max_height(most).min_scrolled_height(most).show(ui, |ui| {
                ui.horizontal_top(|ui| {
                    for (column, lines) in lines.chunks(lines.len().div_ceil(2)).enumerate() {
                        egui::Grid::new(("help", column)).num_columns(2).striped(true).show(ui, |ui| {
                            for (keys, meaning) in lines {
                                ui.monospace(keys);
                                ui.label(*meaning);
                                ui.end_row();
                            }
                        });
                    }
                });
            });
        });
        self.help = open;
    }
}

impl eframe::App for Viewer {
    fn ui(&mut self, ui: &mut Ui, frame: &mut eframe::Frame) {
        let ctx = ui.ctx().clone();
        if self.main.renderer.context().is_lost() {
            return self.bequeath(&ctx);
        }
        self.receive(&ctx);
        self.keyboard(&ctx);
        if self.playing {
            let step = match self.recording {
                Some(_) => 1.0 / RECORDED_FPS,
                None => f64::from(ctx.input(|i| i.stable_dt).min(LONGEST_STEP)),
            };
            self.time = Some(self.time.unwrap_or(0.0) + step);
            ctx.request_repaint();
        }
        if self.panel {
            egui::Panel::right("panel").default_size(300.0).show(ui, |ui| self.side_panel(ui));
        }
        // What handles on the picture moved in the frame before is taken up here too.
        if self.posed_with != (self.state.changes.clone(), self.time, self.animation) {
            self.pose();
        }
        egui::CentralPanel::no_frame().show(ui, |ui| self.picture(ui, frame));
        self.show_message(&ctx);
        if self.help {
            self.help_window(&ctx);
        }
        self.undoer.feed_state(ctx.input(|i| i.time), &self.state);
        let title = format!("Huygens — {} — {} VPLs", self.source.display(), self.main.renderer.all_vpls());
        // Every command asks for another frame.
        if title != self.title {
            ctx.send_viewport_cmd(ViewportCommand::Title(title.clone()));
            self.title = title;
        }
    }

    fn save(&mut self, storage: &mut dyn eframe::Storage) {
        storage.set_string(RECENT, self.recent.join("\n"));
    }

    fn on_exit(&mut self, _gl: Option<&eframe::glow::Context>) {
        // The context is current for the last time.
        self.other = None;
        self.main.clear();
    }
}

/// Tells of shaders that are edited.
#[cfg(debug_assertions)]
fn watch_shaders(ctx: &egui::Context) -> Option<Watch> {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../huygens/shaders")).canonicalize().ok()?;
    let files = |folder: &Path| -> Option<Vec<PathBuf>> {
        Some(std::fs::read_dir(folder).ok()?.flatten().map(|file| file.path()).collect())
    };
    let mut all = files(&folder)?;
    all.extend(files(&folder.join("common"))?);
    Watch::files(all, ctx)
}

/// Text that is read on any picture.
fn outlined(painter: &egui::Painter, at: egui::Pos2, align: Align2, text: &str) {
    let font = egui::FontId::monospace(12.0);
    painter.text(at + egui::vec2(1.0, 1.0), align, text, font.clone(), Color32::BLACK);
    painter.text(at, align, text, font, Color32::WHITE);
}

/// What follows in a list, over and over; the second where it is not in it.
fn after<T: Copy + PartialEq>(all: &[T], now: T) -> T {
    let at = all.iter().position(|&each| each == now).unwrap_or(0);
    all[(at + 1) % all.len()]
}

/// The next coarser or finer step, degrees, that divides `whole`: of so many steps, the nearest whole numbers that differ
/// by a quarter.
fn step(whole: f32, now: f32, coarser: bool) -> String {
    let count = (whole / now).round().max(1.0);
    let next = if coarser { (count * 0.8).floor().max(1.0) } else { (count * 1.25).ceil() };
    let step = (whole / next).clamp(0.5, whole);
    format!("{step}")
}
