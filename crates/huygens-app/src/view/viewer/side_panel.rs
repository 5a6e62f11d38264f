//! The panel beside the picture.

use std::path::Path;

use eframe::egui::{self, ThemePreference, Ui};
use glam::Vec3;
use huygens::settings::PRESETS;
use huygens::{Exposure, Layer, Settings};

use super::{Chosen, DEBUG_VIEWS, Viewer};
use crate::cli::{FARTHEST, MOST_SECONDS};
use crate::view::keys::Action;
use crate::view::load::Dialog;
use crate::view::settings;
use crate::view::wipe::Side;

/// A field for a coordinate, m, that is no wider for one far away.
fn coordinate(x: &mut f32, speed: f32) -> egui::DragValue<'_> {
    let field = egui::DragValue::new(x).speed(speed).range(-FARTHEST..=FARTHEST);
    field.custom_formatter(|x, decimals| match x.abs() < 1e4 {
        true => egui::emath::format_with_decimals_in_range(x, decimals),
        // All digits: what is shown is read again when the field is left.
        false => format!("{:e}", x as f32),
    })
}

/// A slider for the time of animations, the longest of which lasts so long; the time that it is moved to, s.
fn seconds(ui: &mut Ui, mut time: f64, longest: f64) -> Option<f64> {
    let slider = egui::Slider::new(&mut time, 0.0..=longest.max(1e-3)).suffix(" s");
    // More than the longest may be typed.
    let changed = ui.add(slider.clamping(egui::SliderClamping::Never)).changed();
    (changed && time.is_finite()).then(|| time.clamp(0.0, MOST_SECONDS))
}

impl Viewer {
    pub(super) fn side_panel(&mut self, ui: &mut Ui) {
        self.file_row(ui);
        egui::ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
            egui::CollapsingHeader::new("View").default_open(true).show(ui, |ui| self.view_rows(ui));
            if !self.scene.animations().is_empty() {
                egui::CollapsingHeader::new("Animation").default_open(true).show(ui, |ui| self.animation_rows(ui));
            }
            egui::CollapsingHeader::new("Light and objects").show(ui, |ui| self.object_rows(ui));
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
                self.ask(Dialog::scene, &ctx);
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
            if ui.button("?").on_hover_text("keys and pointer").clicked() {
                self.help = true;
            }
        });
        ui.horizontal(|ui| {
            if ui.button("Screenshot").on_hover_text("PNG, EXR and the settings, in the current folder").clicked() {
                self.ask_for_screenshot();
            }
            let record = if self.recording.is_some() { "Stop" } else { "Record" };
            if ui.button(record).on_hover_text("numbered PNGs, in a new folder in the current one").clicked() {
                self.record();
            }
            if ui.button("Copy command line").on_hover_text("that renders this picture").clicked() {
                self.act(Action::CopyCommand, &ctx);
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
            ui.label("layer").on_hover_text("L: direct, indirect or both; B: the others");
            egui::ComboBox::from_id_salt("layer").selected_text(self.state.layer.name()).show_ui(ui, |ui| {
                for layer in Layer::ALL {
                    ui.selectable_value(&mut self.state.layer, layer, layer.name());
                }
            });
            ui.end_row();
            ui.label("debug view").on_hover_text("in place of the layer; B");
            let debug = DEBUG_VIEWS.iter().find(|(debug, _)| *debug == self.debug).map_or("", |(_, name)| name);
            egui::ComboBox::from_id_salt("debug").selected_text(debug).show_ui(ui, |ui| {
                for (debug, name) in DEBUG_VIEWS {
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
            ui.label("resolution").on_hover_text("one pixel of so many along each edge is drawn");
            egui::ComboBox::from_id_salt("pixels").selected_text(format!("1/{}", self.coarseness)).show_ui(ui, |ui| {
                for n in [1, 2, 4, 8] {
                    ui.selectable_value(&mut self.coarseness, n, format!("1/{n}"));
                }
            });
            ui.end_row();
            ui.label("target fps").on_hover_text("a pixel sums as many VPLs in a frame as leave time for that; at rest, with the exact gather, a GPU then sums all");
            ui.horizontal(|ui| {
                ui.checkbox(&mut self.hold_fps, "").on_hover_text("hold it; without, the settings alone decide");
                let fps = egui::DragValue::new(&mut self.target_fps).range(1.0..=240.0).speed(0.2).max_decimals(1);
                ui.add_enabled(self.hold_fps, fps);
            });
            ui.end_row();
            ui.label("theme");
            let theme = ui.ctx().options(|options| options.theme_preference);
            let all = [
                (ThemePreference::System, "system"),
                (ThemePreference::Dark, "dark"),
                (ThemePreference::Light, "light"),
            ];
            let name = all.iter().find(|(each, _)| *each == theme).map_or("", |(_, name)| name);
            egui::ComboBox::from_id_salt("theme").selected_text(name).show_ui(ui, |ui| {
                for (each, name) in all {
                    if ui.selectable_label(each == theme, name).clicked() {
                        ui.ctx().set_theme(each);
                    }
                }
            });
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
            if ui.button(if self.playing { "Pause" } else { "Play" }).on_hover_text("Space").clicked() {
                self.playing = !self.playing;
            }
            egui::ComboBox::from_id_salt("animation").selected_text(text(self.animation)).show_ui(ui, |ui| {
                for i in std::iter::once(None).chain((0..names.len()).map(Some)) {
                    ui.selectable_value(&mut self.animation, i, text(i));
                }
            });
        });
        // All begin anew when they are over.
        let mut time = self.time.unwrap_or(0.0);
        if self.playing && longest > 0.0 {
            time %= longest;
        }
        self.time = seconds(ui, time, longest).or(self.time);
    }

    fn object_rows(&mut self, ui: &mut Ui) {
        let mut on = !self.state.changes.dark;
        ui.horizontal(|ui| {
            ui.checkbox(&mut on, "primary light");
            let held = self.chosen == Some(Chosen::Light);
            if ui.selectable_label(held, "gizmo (G)").on_hover_text("on the picture; arrow keys move it too").clicked()
            {
                self.chosen = if held { None } else { Some(Chosen::Light) };
            }
        });
        self.state.changes.dark = !on;
        if let Some(light) = self.posed.lights.first() {
            let (mut position, mut axis) = (light.position, light.axis);
            let mut changed = false;
            let metres = 0.002 * self.navigator.distance;
            for (name, vector, speed) in [("at, m", &mut position, metres), ("facing", &mut axis, 0.01)] {
                ui.horizontal(|ui| {
                    for x in vector.as_mut() {
                        changed |= ui.add(coordinate(x, speed)).changed();
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
            Some(Chosen::Object(index)) => {
                let mesh = self.posed.instances.get(index).map(|instance| &self.posed.meshes[instance.mesh]);
                let name = mesh.map_or("", |mesh| mesh.name.as_str());
                ui.label(format!("object {index} {name}"));
                let mut by = self.state.changes.moves.get(&index).copied().unwrap_or(Vec3::ZERO);
                let mut changed = false;
                ui.horizontal(|ui| {
                    for x in by.as_mut() {
                        changed |= ui.add(coordinate(x, 0.002 * self.navigator.distance)).changed();
                    }
                    ui.label("moved by, m");
                });
                if changed && by.is_finite() {
                    self.state.changes.moves.insert(index, by);
                }
            }
            _ => drop(ui.weak("a click on the picture chooses an object")),
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
        ui.checkbox(&mut self.wipe.on, "wipe between two (X)").on_hover_text("drag the line on the picture");
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
                self.ask(Dialog::load_settings, &ctx);
            }
            if ui.button("Save…").clicked() {
                self.ask(Dialog::save_settings, &ctx);
            }
        });
        let base = Settings::preset(&self.state.preset).unwrap_or_default();
        if let Some(refused) = settings::groups(ui, &self.keys, &mut self.state.settings, &base) {
            self.refuse(refused);
        }
    }
}

#[cfg(test)]
mod tests {
    use egui::accesskit::Role;
    use egui_kittest::Harness;
    use egui_kittest::kittest::Queryable as _;

    use super::*;

    /// A window with that in it, where fields need no names.
    fn window<'a, State>(app: impl FnMut(&mut Ui, &mut State) + 'a, state: State) -> Harness<'a, State> {
        Harness::builder().with_accessibility_check(false).build_ui_state(app, state)
    }

    /// Types over what a field has, as a person does.
    fn enter<State>(harness: &mut Harness<'_, State>, text: &str) {
        harness.get_by_role(Role::SpinButton).focus();
        harness.run();
        harness.key_press_modifiers(egui::Modifiers::COMMAND, egui::Key::A);
        harness.event(egui::Event::Text(text.to_owned()));
        harness.key_press(egui::Key::Enter);
        harness.run();
    }

    #[test]
    fn any_time_that_is_typed_is_one_that_scenes_can_be_posed_at() {
        let app = |ui: &mut Ui, time: &mut f64| *time = seconds(ui, *time, 4.0).unwrap_or(*time);
        let mut harness = window(app, 1.0);
        for (text, is) in [("2.5", 2.5), ("7", 7.0), ("nan", 7.0), ("inf", 7.0), ("1e30", MOST_SECONDS), ("-3", 0.0)] {
            enter(&mut harness, text);
            assert_eq!(*harness.state(), is, "{text}");
        }
    }

    #[test]
    fn coordinates_keep_all_digits_in_fields_that_grow_no_wider() {
        let app = |ui: &mut Ui, x: &mut f32| drop(ui.add(coordinate(x, 0.01)));
        let mut harness = window(app, 1.25);
        for (text, is) in [("-12.5", -12.5), ("1234567", 1_234_567.0), ("-9.87654e11", -9.87654e11), ("1e30", FARTHEST)]
        {
            enter(&mut harness, text);
            // Looked at and left as it is.
            harness.get_by_role(Role::SpinButton).focus();
            harness.run();
            harness.key_press(egui::Key::Enter);
            harness.run();
            assert_eq!(*harness.state(), is, "{text}");
            let width = harness.get_by_role(Role::SpinButton).rect().width();
            assert!(width < 90.0, "{text}: {width}");
        }
    }
}
