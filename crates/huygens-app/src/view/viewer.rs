//! The window: what it shows, and what happens to keys and pointer.

use std::ffi::OsString;
use std::rc::Rc;
use std::time::Instant;

use eframe::egui;
use egui::{Align2, Color32, PointerButton, Rect, Sense, TextureId, Ui, ViewportCommand};
use glam::{Quat, Vec2, Vec3};
use huygens::gl::Context;
use huygens::settings::{DIAL, Key, PRESETS, Visibility};
use huygens::{Exposure, Governor, Layer, RenderOptions, Renderer, Scene, Settings, Shown};

use super::keys::{Action, BINDINGS, HELD};
use super::navigate::Navigator;
use super::panel;

/// A longer step of time than that, s, is not what was meant: the window was hidden, or a frame took too long.
const LONGEST_STEP: f32 = 0.25;

/// What can be undone.
#[derive(Clone, PartialEq)]
struct State {
    settings: Settings,
    preset: String,
    layer: Layer,
    exposure: Exposure,
    light: Option<LightPose>,
    light_on: bool,
}

/// Where the primary light stands, in place of what the scene says.
#[derive(Clone, Copy, PartialEq)]
struct LightPose {
    position: Vec3,
    axis: Vec3,
}

/// What a frame is drawn of: as long as it stays the same, a settled picture does too.
#[derive(Clone, PartialEq)]
struct Drawn {
    settings: Settings,
    navigator: Navigator,
    size: [u32; 2],
    layer: Layer,
    exposure: Exposure,
    scene: u64,
}

pub struct Viewer {
    renderer: Renderer,
    /// What was drawn last, of what, and egui's name for its texture.
    shown: Option<(Shown, TextureId)>,
    drawn: Option<Drawn>,
    source: OsString,
    /// At rest.
    scene: Scene,
    /// As it is drawn, and a number that rises whenever that changes.
    posed: Scene,
    posed_version: u64,
    time: f64,
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
    governor: Option<(Settings, Governor)>,
    frame_ms: f64,
    frames: Vec<Instant>,
    message: Option<String>,
    help: bool,
    panel: bool,
}

impl Viewer {
    pub fn new(
        creation: &eframe::CreationContext<'_>,
        source: OsString,
        scene: Scene,
        settings: Settings,
        preset: String,
        options: RenderOptions,
    ) -> huygens::Result<Self> {
        let context: Rc<Context> = Context::of_eframe(creation)?;
        let software = context.info().software;
        let navigator = Navigator::new(options.camera, scene.bounds());
        Ok(Self {
            renderer: Renderer::new(context)?,
            shown: None,
            drawn: None,
            source,
            posed: scene.clone(),
            posed_version: 0,
            time: 0.0,
            playing: false,
            camera_index: 0,
            navigator,
            seed: options.seed,
            state: State {
                settings,
                preset,
                layer: options.layer,
                exposure: options.exposure,
                light: None,
                light_on: true,
            },
            undoer: egui::util::undoer::Undoer::default(),
            keys: huygens::settings::keys(),
            coarseness: if software { 2 } else { 1 },
            target_fps: if software { 5.0 } else { 60.0 },
            governor: None,
            frame_ms: 0.0,
            frames: Vec::new(),
            message: None,
            help: false,
            panel: true,
            scene,
        })
    }

    /// The settings that frames are drawn with: what was asked for, with as many VPLs a pixel as there is time for.
    fn settings(&mut self) -> Settings {
        let asked = &self.state.settings;
        if self.governor.as_ref().is_none_or(|(of, _)| of != asked) {
            self.governor = Some((asked.clone(), Governor::new(self.target_fps, asked).from_the_coarsest()));
        }
        self.governor.as_ref().map_or_else(|| asked.clone(), |(_, governor)| governor.settings().clone())
    }

    /// Draws the next frame if it would differ from the last one; whether there is more to draw after it.
    fn draw(&mut self, frame: &mut eframe::Frame, size: [u32; 2]) -> huygens::Result<bool> {
        let settings = self.settings();
        let State { layer, exposure, .. } = self.state;
        let navigator = self.navigator.clone();
        let now = Drawn { settings, navigator, size, layer, exposure, scene: self.posed_version };
        let settled = self.shown.is_some_and(|(shown, _)| shown.settled);
        if settled && self.drawn.as_ref() == Some(&now) {
            return Ok(false);
        }
        let options = RenderOptions {
            layer,
            exposure,
            seed: self.seed,
            ..RenderOptions::new(size[0], size[1], self.navigator.camera.clone())
        };
        self.renderer.check(&now.settings, &options)?;
        let begun = Instant::now();
        self.renderer.draw(&self.posed, &now.settings, &options)?;
        if let Some(shown) = self.renderer.show()? {
            let known = self.shown.filter(|(before, _)| before.texture == shown.texture);
            let id = known.map_or_else(|| frame.register_native_glow_texture(shown.texture), |(_, id)| id);
            self.shown = Some((shown, id));
        }
        let cpu_ms = begun.elapsed().as_secs_f64() * 1e3;
        self.drawn = Some(now);
        if let Some(times) = self.renderer.late_pass_times() {
            let gpu_ms = |wanted: &dyn Fn(&str) -> bool| -> f64 {
                let times = times.iter().filter(|time| wanted(time.name));
                times.map(|time| time.gpu_ms.unwrap_or(0.0).max(time.cpu_ms)).sum()
            };
            self.frame_ms = gpu_ms(&|_| true).max(cpu_ms);
            let gather_ms = gpu_ms(&|name| matches!(name, "gather" | "share"));
            let only_gather = times.iter().all(|time| !matches!(time.name, "ism" | "reflected" | "vpl" | "lattice"));
            if let Some((_, governor)) = self.governor.as_mut().filter(|_| only_gather) {
                governor.frame(gpu_ms(&|_| true), gather_ms);
            }
        }
        let now = Instant::now();
        self.frames.push(now);
        self.frames.retain(|then| now.duration_since(*then).as_secs_f32() < 2.0);
        Ok(self.shown.is_none_or(|(shown, _)| !shown.settled))
    }

    /// The scene as time, lights and things stand now.
    fn pose(&mut self) {
        let mut posed = match self.scene.animations().is_empty() {
            true => self.scene.clone(),
            false => match self.scene.at(self.time, None) {
                Ok(posed) => posed,
                Err(error) => {
                    self.message = Some(error.to_string());
                    return;
                }
            },
        };
        if let (Some(light), Some(pose)) = (posed.lights.first_mut(), self.state.light) {
            (light.position, light.axis) = (pose.position, pose.axis);
        }
        if let (Some(light), false) = (posed.lights.first_mut(), self.state.light_on) {
            light.intensity = Vec3::ZERO;
        }
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
            self.message = Some(error.to_string());
        }
    }

    fn act(&mut self, action: Action, ctx: &egui::Context) {
        let settings = self.state.settings.clone();
        let wave = &settings.wave;
        match action {
            Action::Help => self.help = !self.help,
            Action::Model => {
                self.set("model", if settings.model.name() == "wave" { "reflected" } else { "wave" });
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
                let views = [Layer::Final, Layer::Albedo, Layer::Normal, Layer::Depth, Layer::Ao];
                self.state.layer = after(&views, self.state.layer);
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
            Action::LightOnOff => self.state.light_on = !self.state.light_on,
            Action::Play => self.playing = !self.playing && !self.scene.animations().is_empty(),
            Action::FrameAll => {
                if let Some(bounds) = self.posed.bounds() {
                    let aspect = self.drawn.as_ref().map_or(1.0, |drawn| drawn.size[0] as f32 / drawn.size[1] as f32);
                    self.navigator.frame(bounds, aspect);
                }
            }
            Action::NextCamera => self.go_to_camera(self.camera_index + 1),
            Action::Reset => {
                (self.state.light, self.state.light_on) = (None, true);
                (self.time, self.playing) = (0.0, false);
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
            Action::Freeze
            | Action::Lattice
            | Action::Open
            | Action::SaveSettings
            | Action::CopyCommand
            | Action::Screenshot
            | Action::Record => {}
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
                keys.iter().fold(false, |any, key| input.consume_shortcut(key) || any)
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
        let mut pose = LightPose { position: light.position, axis: light.axis };
        let camera = &self.navigator.camera;
        let right = camera.forward.cross(camera.up);
        if modifiers.command {
            let turn = Quat::from_axis_angle(camera.up, by.x) * Quat::from_axis_angle(right, by.y);
            pose.axis = (turn * pose.axis).normalize_or(pose.axis);
        } else {
            let speed = 0.4 * self.posed.bounds().map_or(1.0, |b| b.radius());
            let along = if modifiers.shift { camera.forward } else { camera.up };
            pose.position += (right * by.x + along * by.y) * speed;
        }
        self.state.light = Some(pose);
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
            match self.draw(frame, size) {
                Ok(more) => {
                    if more {
                        ui.ctx().request_repaint();
                    }
                }
                Err(error) => {
                    self.message = Some(error.to_string());
                    self.drawn = None;
                }
            }
        }
        if let Some((_, id)) = self.shown {
            let uv = Rect::from_min_max(egui::pos2(0.0, 1.0), egui::pos2(1.0, 0.0));
            ui.painter().image(id, rect, uv, Color32::WHITE);
        }
        self.heads_up(ui, rect);
    }

    fn heads_up(&self, ui: &Ui, rect: Rect) {
        let text = self.summary();
        let font = egui::FontId::monospace(12.0);
        let at = rect.left_bottom() + egui::vec2(8.0, -8.0);
        ui.painter().text(at + egui::vec2(1.0, 1.0), Align2::LEFT_BOTTOM, &text, font.clone(), Color32::BLACK);
        ui.painter().text(at, Align2::LEFT_BOTTOM, &text, font, Color32::WHITE);
    }

    fn summary(&self) -> String {
        let frames = self.frames.len();
        let span = match self.frames.as_slice() {
            [first, .., last] => last.duration_since(*first).as_secs_f64(),
            _ => 0.0,
        };
        let fps = if span > 0.0 { (frames - 1) as f64 / span } else { 0.0 };
        format!(
            "{} of {} VPLs  {:.1} ms  {fps:.0} fps",
            self.renderer.vpls().len(),
            self.renderer.all_vpls(),
            self.frame_ms
        )
    }

    fn side_panel(&mut self, ui: &mut Ui) {
        let presets = self.state.preset.clone();
        ui.horizontal(|ui| {
            ui.label("preset");
            egui::ComboBox::from_id_salt("preset").selected_text(&presets).show_ui(ui, |ui| {
                for name in PRESETS {
                    if ui.selectable_label(name == presets, name).clicked() {
                        self.set_preset(name);
                    }
                }
            });
        });
        ui.separator();
        egui::ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
            let base = Settings::preset(&self.state.preset).unwrap_or_default();
            if let Some(refused) = panel::settings(ui, &self.keys, &mut self.state.settings, &base) {
                self.message = Some(refused);
            }
        });
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
            egui::ScrollArea::vertical().show(ui, |ui| {
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
        let before = (self.state.clone(), self.time);
        self.keyboard(&ctx);
        if self.playing {
            self.time += f64::from(ctx.input(|i| i.stable_dt).min(LONGEST_STEP));
            ctx.request_repaint();
        }
        if self.panel {
            egui::Panel::right("panel").default_size(300.0).show(ui, |ui| self.side_panel(ui));
        }
        if let Some(message) = self.message.clone() {
            egui::Panel::bottom("message").show(ui, |ui| {
                ui.horizontal(|ui| {
                    if ui.small_button("✖").clicked() {
                        self.message = None;
                    }
                    ui.colored_label(ui.visuals().error_fg_color, message);
                });
            });
        }
        let pose = |state: &State| (state.light, state.light_on);
        if pose(&before.0) != pose(&self.state) || before.1 != self.time {
            self.pose();
        }
        egui::CentralPanel::no_frame().show(ui, |ui| self.picture(ui, frame));
        if self.help {
            self.help_window(&ctx);
        }
        self.undoer.feed_state(ctx.input(|i| i.time), &self.state);
        let title = format!("Huygens — {} — {} VPLs", self.source.display(), self.renderer.all_vpls());
        ctx.send_viewport_cmd(ViewportCommand::Title(title));
    }

    fn on_exit(&mut self, _gl: Option<&eframe::glow::Context>) {
        // The context is current for the last time.
        self.shown = None;
        if let Ok(empty) = Renderer::new(self.renderer.context().clone()) {
            self.renderer = empty;
        }
    }
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
