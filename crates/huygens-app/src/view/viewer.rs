//! The window: all that it knows.

mod files;
mod keyboard;
mod picture;
mod side_panel;

use std::cell::Cell;
use std::ffi::OsString;
use std::path::PathBuf;
use std::rc::Rc;
use std::time::{Duration, Instant};

use eframe::egui;
use egui::{Align2, Color32, Ui, ViewportCommand};
use huygens::gl::Context;
use huygens::settings::Key;
use huygens::{DebugView, Exposure, Layer, RenderOptions, Scene, Settings};

use super::drawing::Drawing;
use super::keys::{BINDINGS, HELD};
use super::later::Later;
use super::lattice::Overlay;
use super::load::{Dialog, Loading, Watch};
use super::navigate::Navigator;
use super::numbers::Times;
use super::trace::Tracing;
use super::wipe::{ErrorView, Wipe};
use crate::input::Changes;

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

/// What a debug view shows in place of the picture; the tile is that of the VPL that is chosen, or the first.
const DEBUG_VIEWS: [(Option<DebugView>, &str); 5] = [
    (None, "none"),
    (Some(DebugView::ShadowMap), "shadow map"),
    (Some(DebugView::IsmAtlas), "ISM atlas"),
    (Some(DebugView::IsmTile(0)), "ISM tile"),
    (Some(DebugView::VplTexture), "VPL texture"),
];

/// What a click chose.
#[derive(Clone, Copy, PartialEq)]
enum Chosen {
    Light,
    Object(usize),
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
    /// Size of the window, points.
    pub window: [f32; 2],
    pub source: OsString,
    /// At rest.
    pub scene: Scene,
    pub settings: Settings,
    pub preset: String,
    /// Index of the scene's camera that it begins with.
    pub camera: usize,
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
    /// Whether that frame rate is held.
    hold_fps: bool,
    target_fps: f64,
    frozen: bool,
    /// The chosen VPL alone gives light.
    alone: bool,
    debug: Option<DebugView>,
    times: Times,
    frames: Vec<Instant>,
    /// What is told: wrong or right.
    message: Option<(bool, String)>,
    told: Option<Instant>,
    overlay: Overlay,
    chosen: Option<Chosen>,
    /// What a click on the picture hits: an object, or none.
    hit: Option<Later<Option<usize>>>,
    loading: Option<Loading>,
    dialog: Option<Dialog>,
    watch: Option<Watch>,
    #[cfg(debug_assertions)]
    shaders: Option<Watch>,
    recent: Vec<String>,
    path: String,
    title: String,
    /// Waits for the next frame.
    screenshot: bool,
    recording: Option<Recording>,
    help: bool,
    panel: bool,
}

impl Viewer {
    pub fn new(creation: &eframe::CreationContext<'_>, start: Start, heir: Heir) -> huygens::Result<Self> {
        let Start { window: _, source, scene, settings, preset, camera, options, changes, time, animation } = start;
        let context: Rc<Context> = Context::of_eframe(creation)?;
        // Else what is weak is hard to read on light ground, and what is wrong on dark.
        creation.egui_ctx.all_styles_mut(|style| {
            style.visuals.weak_text_alpha = 0.85;
            let red = if style.visuals.dark_mode { [255, 120, 110] } else { [180, 0, 0] };
            style.visuals.error_fg_color = Color32::from_rgb(red[0], red[1], red[2]);
        });
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
            camera_index: camera,
            navigator,
            seed: options.seed,
            state: State { settings, preset, layer: options.layer, exposure: options.exposure, changes },
            undoer: egui::util::undoer::Undoer::default(),
            keys: huygens::settings::keys(),
            coarseness: if software { 2 } else { 1 },
            hold_fps: true,
            target_fps: if software { 5.0 } else { 60.0 },
            frozen: false,
            alone: false,
            debug: None,
            times: Times::default(),
            frames: Vec::new(),
            message: None,
            told: None,
            overlay: Overlay { shown: false, by_shell: true, rays: false, hemispheres: false },
            chosen: None,
            hit: None,
            loading: None,
            dialog: None,
            watch: Watch::new(&source, &scene, &creation.egui_ctx),
            #[cfg(debug_assertions)]
            shaders: watch_shaders(&creation.egui_ctx),
            recent: recent.lines().map(str::to_owned).collect(),
            path: source.to_string_lossy().into_owned(),
            source,
            screenshot: false,
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
            window: ctx.content_rect().size().into(),
            source: self.source.clone(),
            scene: self.scene.clone(),
            settings: self.state.settings.clone(),
            preset: self.state.preset.clone(),
            camera: self.camera_index,
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

    fn refuse(&mut self, problem: impl ToString) {
        (self.message, self.told) = (Some((true, problem.to_string())), None);
    }

    fn tell(&mut self, text: impl ToString) {
        (self.message, self.told) = (Some((false, text.to_string())), None);
    }

    /// The scene as time, lights and objects stand now. A camera that nobody has moved goes with it.
    fn pose(&mut self) {
        self.posed_with = (self.state.changes.clone(), self.time, self.animation);
        let posed = match self.time {
            Some(seconds) => self.scene.at(seconds, self.animation),
            None => Ok(self.scene.clone()),
        };
        let mut posed = match posed {
            Ok(posed) => posed,
            Err(error) => {
                self.refuse(error);
                self.playing = false;
                self.scene.clone()
            }
        };
        self.state.changes.apply(&mut posed);
        let [was, is] = [&self.posed, &posed].map(|scene| scene.cameras.get(self.camera_index));
        if let (Some(was), Some(is)) = (was, is)
            && *was == self.navigator.camera
        {
            self.navigator.camera = is.clone();
        }
        self.posed = posed;
        self.posed_version += 1;
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
                    close |= ui.small_button("×").on_hover_text("close").clicked();
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
            let most = (ctx.content_rect().size() - egui::vec2(48.0, 80.0)).max(egui::vec2(100.0, 100.0));
            let columns = if most.x > 950.0 { 2 } else { 1 };
            let area = egui::ScrollArea::both().max_height(most.y);
            area.min_scrolled_width(most.x).min_scrolled_height(most.y).show(ui, |ui| {
                ui.horizontal_top(|ui| {
                    for (column, lines) in lines.chunks(lines.len().div_ceil(columns)).enumerate() {
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
        // A pass that egui throws away is no time that goes by.
        let counts = ctx.current_pass_index() == 0;
        if counts {
            self.keyboard(&ctx);
        }
        if self.playing && counts {
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
        if self.undoer.is_in_flux() {
            // What can be undone is what has been so for a while.
            ctx.request_repaint_after(Duration::from_secs(1));
        }
        if crate::interrupt::is_asked_to_end() {
            ctx.send_viewport_cmd(ViewportCommand::Close);
        }
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
    use std::path::Path;
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../huygens/shaders")).canonicalize().ok()?;
    let files = |folder: &Path| -> Option<Vec<PathBuf>> {
        Some(std::fs::read_dir(folder).ok()?.flatten().map(|file| file.path()).collect())
    };
    let mut all = files(&folder)?;
    all.extend(files(&folder.join("common"))?);
    Watch::files(all, ctx)
}
