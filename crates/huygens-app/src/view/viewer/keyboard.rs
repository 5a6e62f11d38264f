//! What keys do.

use eframe::egui::{self, ViewportCommand};
use glam::{Quat, Vec2, Vec3};
use huygens::settings::{DIAL, Model, Visibility};
use huygens::{Layer, Settings};

use super::{Chosen, DEBUG_VIEWS, LONGEST_STEP, Viewer};
use crate::input::Changes;
use crate::view::keys::{self, Action};
use crate::view::load::Dialog;
use crate::view::navigate::Navigator;

impl Viewer {
    pub(super) fn set_preset(&mut self, name: &str) {
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

    pub(super) fn act(&mut self, action: Action, ctx: &egui::Context) {
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
                if self.debug.is_some() || self.state.layer == Layer::Ao {
                    self.debug = after(&DEBUG_VIEWS.map(|(debug, _)| debug), self.debug);
                    self.state.layer = Layer::Final;
                } else {
                    self.state.layer = after(&layers, self.state.layer);
                }
            }
            Action::Wipe => self.wipe.on = !self.wipe.on,
            Action::BetterQuality | Action::WorseQuality => {
                let at = DIAL.iter().position(|&name| name == self.state.preset).unwrap_or(1);
                let next = if action == Action::BetterQuality { at + 1 } else { at.saturating_sub(1) };
                let next = DIAL[next.min(DIAL.len() - 1)];
                // At the end of the dial settings that were changed stay.
                if next != self.state.preset {
                    self.set_preset(next);
                }
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
                    Some(Chosen::Object(i)) => self.posed.instances.get(i).and_then(|i| self.posed.bounds_of(i)),
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
                    self.keep_moves_of_objects();
                }
            }
            Action::Redo => {
                if let Some(state) = self.undoer.redo(&self.state) {
                    self.state = state.clone();
                    self.keep_moves_of_objects();
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
            Action::Open => self.ask(Dialog::scene, ctx),
            Action::SaveSettings => self.ask(Dialog::save_settings, ctx),
            Action::CopyCommand => {
                let line = self.command("huygens.png");
                ctx.copy_text(line.clone());
                let but = self.beside_the_command().map_or_else(String::new, |but| format!(" ({but})"));
                self.tell(format!("copied: {line}{but}"));
            }
            Action::Screenshot => self.ask_for_screenshot(),
            Action::Record => self.record(),
        }
    }

    /// Another state may have moved what is not there any more.
    pub(super) fn keep_moves_of_objects(&mut self) {
        let objects = self.scene.instances.len();
        self.state.changes.moves.retain(|object, _| *object < objects);
    }

    /// Opens a dialog of the system, if none is open.
    pub(super) fn ask(&mut self, dialog: fn(&egui::Context) -> Dialog, ctx: &egui::Context) {
        if self.dialog.is_none() {
            self.dialog = Some(dialog(ctx));
        }
    }

    pub(super) fn go_to_camera(&mut self, index: usize) {
        let index = index % self.posed.cameras.len().max(1);
        if let Some(camera) = self.posed.cameras.get(index) {
            self.camera_index = index;
            self.navigator = Navigator::new(camera.clone(), self.posed.bounds());
        }
    }

    /// Keys that are pressed, and those that are held.
    pub(super) fn keyboard(&mut self, ctx: &egui::Context) {
        if ctx.egui_wants_keyboard_input() {
            return;
        }
        // As often as it was pressed, however few frames there are.
        let pressed = |event: &egui::Event| match *event {
            egui::Event::Key { key, pressed: true, repeat: false, modifiers, .. } => keys::action_of(key, modifiers),
            _ => None,
        };
        let pressed: Vec<Action> = ctx.input(|input| input.events.iter().filter_map(pressed).collect());
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
            let speed = 0.4 * self.navigator.radius();
            let along = if modifiers.shift { camera.forward } else { camera.up };
            position += (right * by.x + along * by.y) * speed;
        }
        self.state.changes.light = (Some(position), Some(axis));
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
