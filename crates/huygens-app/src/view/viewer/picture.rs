//! The picture: what is drawn of it, what lies over it, and what the pointer does on it.

use std::time::Instant;

use eframe::egui::{self, Align2, Color32, PointerButton, Rect, Sense, Ui};
use glam::{Vec2, Vec3};
use huygens::reference::Bvh;
use huygens::settings::{Depth, Model, Visibility};
use huygens::{DebugView, Exposure, Layer};

use super::{Chosen, Viewer};
use crate::view::drawing::{Asked, Drawing};
use crate::view::gizmo::{self, Moved, Screen};
use crate::view::later::Later;
use crate::view::lattice::{self, Overlay};
use crate::view::trace::Wanted;
use crate::view::wipe::{ErrorView, Side};

impl Viewer {
    /// What a frame is asked to be, of one side of the picture.
    pub(super) fn asked(&self, side: Side, size: [u32; 2]) -> Asked {
        let mut settings = self.state.settings.clone();
        let mut layer = self.state.layer;
        match side {
            Side::Direct => layer = Layer::Direct,
            Side::Wave => settings.model = Model::Wave,
            Side::Reflected => settings.model = Model::Reflected,
            Side::AsSet | Side::Traced | Side::Error => {}
        }
        let vpl = match self.chosen {
            // Of other VPLs than when it was chosen there may be fewer.
            Some(Chosen::Vpl(vpl)) => Some(vpl as u32).filter(|_| vpl < self.main.renderer.vpls().len()),
            _ => None,
        };
        Asked {
            settings,
            camera: self.navigator.camera.clone(),
            size,
            layer,
            exposure: self.state.exposure,
            seed: self.seed,
            scene: self.posed_version,
            frozen: self.frozen,
            alone: vpl.filter(|_| self.alone),
            debug: match self.debug {
                Some(DebugView::IsmTile(_)) => Some(DebugView::IsmTile(vpl.unwrap_or(0))),
                debug => debug,
            },
            target_fps: self.hold_fps.then_some(self.target_fps),
        }
    }

    /// Draws what differs from what was drawn last; whether there is more to draw.
    fn draw(&mut self, frame: &mut eframe::Frame, size: [u32; 2], ctx: &egui::Context) -> huygens::Result<bool> {
        let (sides, main) = (self.sides(), self.main_side());
        let asked = self.asked(main, size);
        let times = &mut self.times;
        let drawn = self.main.draw(frame, &self.posed, asked, &mut |late| times.push(late))?;
        let mut settled = self.main.is_settled();
        if drawn {
            let now = Instant::now();
            self.frames.push(now);
            self.frames.retain(|then| now.duration_since(*then).as_secs_f32() < 2.0);
            if let Err(failure) = self.record_frame() {
                // Nothing is left of what has no picture.
                let _ = self.recording.take().map(|recording| std::fs::remove_dir(recording.folder));
                self.refuse(format!("{:#}", failure.cause));
            }
        }
        let ev = self.main.shown().map_or(0.0, |(shown, _)| shown.exposure_ev);
        match self.other_side() {
            Some(right) => {
                if self.other.is_none() {
                    self.other = Some(Drawing::new(self.main.renderer.context().clone())?);
                }
                // Both sides are as bright.
                let asked = Asked { exposure: Exposure::Ev(ev), debug: None, alone: None, ..self.asked(right, size) };
                if let Some(other) = &mut self.other {
                    other.draw(frame, &self.posed, asked, &mut |_| ())?;
                    settled &= other.is_settled();
                }
            }
            None => self.other = None,
        }
        if sides.contains(&Side::Traced) || sides.contains(&Side::Error) {
            let wanted = Wanted { camera: self.navigator.camera.clone(), size, scene: self.posed_version };
            self.tracing.want(wanted, &self.posed, ctx);
            if sides.contains(&Side::Error) {
                self.error.update(ctx, &mut self.main, &self.tracing, self.state.layer, size, ev)?;
            } else {
                self.error = ErrorView::default();
            }
        } else {
            self.tracing.stop();
        }
        Ok(!settled)
    }

    /// What is left and, with a wipe, right.
    pub(super) fn sides(&self) -> [Side; 2] {
        if self.wipe.on { [self.wipe.left, self.wipe.right] } else { [Side::AsSet; 2] }
    }

    /// What the main renderer draws: the left side, or the right one if that is none that is drawn.
    pub(super) fn main_side(&self) -> Side {
        self.sides().into_iter().find(|side| side.is_drawn()).unwrap_or(Side::AsSet)
    }

    /// The right side, if it is another picture to draw.
    fn other_side(&self) -> Option<Side> {
        Some(self.sides()[1]).filter(|right| right.is_drawn() && *right != self.main_side())
    }

    /// What is under the pointer becomes what is chosen: a VPL if they are shown, else an object.
    fn choose(&mut self, screen: &Screen, at: egui::Pos2, ctx: &egui::Context) {
        if self.overlay.shown
            && let Some(vpl) = lattice::pick(screen, self.main.renderer.vpls(), at)
        {
            self.chosen = Some(Chosen::Vpl(vpl));
            return;
        }
        let (origin, direction) = screen.ray(at);
        let scene = self.posed.clone();
        self.hit = Some(Later::new(ctx, move || {
            Bvh::new(&scene).closest(origin, direction, 0.0, f32::INFINITY).map(|hit| hit.instance)
        }));
    }

    /// Gizmos on the light and on what is chosen.
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
        if let Some(Chosen::Object(index)) = self.chosen
            && let Some(bounds) = self.posed.instances.get(index).and_then(|object| self.posed.bounds_of(object))
            && let Some(Moved::By(by)) = gizmo::show(ui, screen, "object", bounds.center(), None)
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
    pub(super) fn picture(&mut self, ui: &mut Ui, frame: &mut eframe::Frame) {
        let (rect, response) = ui.allocate_exact_size(
            ui.available_size(), // Keys are meant for the picture anyhow.
            Sense::CLICK | Sense::DRAG,
        );
        // A pass that egui throws away would move things twice.
        let counts = ui.ctx().current_pass_index() == 0;
        if counts {
            self.pointer(ui, &response);
        }
        let pixels = rect.size() * ui.ctx().pixels_per_point() / self.coarseness as f32;
        let size = [pixels.x, pixels.y].map(|x| x.round().clamp(0.0, 16384.0) as u32);
        if size.iter().all(|&n| n > 0) {
            match self.draw(frame, size, ui.ctx()) {
                Ok(more) => {
                    if more {
                        ui.ctx().request_repaint();
                    }
                    if self.screenshot {
                        self.take_screenshot();
                    }
                }
                Err(error) => self.refuse(error),
            }
        }
        self.paint(ui, rect);
        let camera = self.navigator.camera.clone();
        let screen = Screen { camera: &camera, rect };
        if let Some(at) = response.interact_pointer_pos().filter(|_| response.clicked()) {
            self.choose(&screen, at, ui.ctx());
        }
        if let Some(hit) = self.hit.as_ref().and_then(Later::take) {
            self.hit = None;
            let chosen = hit.flatten().map(Chosen::Object);
            self.chosen = chosen.filter(|chosen| self.chosen != Some(*chosen));
        }
        if self.overlay.shown && self.debug.is_none() {
            let settings = self.asked(self.main_side(), size).settings;
            // Rays that meet black surfaces are left out whole.
            let shells = settings.wave.shells as usize;
            let ordered = !matches!(settings.visibility, Visibility::ShadowMaps | Visibility::Mixed);
            let whole = settings.model == Model::Wave
                && settings.wave.fraction >= 1.0
                && ordered
                && !self.frozen
                && self.main.renderer.vpls().len().is_multiple_of(shells);
            let shells = whole.then_some(shells);
            let chosen = match self.chosen {
                Some(Chosen::Vpl(vpl)) => Some(vpl),
                _ => None,
            };
            let light = self.posed.lights.first();
            let overlay = Overlay {
                hemispheres: self.overlay.hemispheres && settings.wave.depth == Depth::Scene,
                ..self.overlay
            };
            lattice::show(ui.painter(), &screen, overlay, self.main.renderer.vpls(), shells, light, chosen);
        }
        let before = self.state.changes.clone();
        self.gizmos(ui, &screen);
        if !counts {
            self.state.changes = before;
        } else if before != self.state.changes {
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
                Side::Traced if self.state.layer.is_radiance() => {
                    self.tracing.texture(ui.ctx(), self.state.layer, ev).map(|id| (id, from_the_top))
                }
                Side::Traced => None,
                Side::Error => self.error.texture().map(|id| (id, from_the_top)),
                _ => drawn.map(|(_, id)| (id, from_below)),
            };
            let painter = ui.painter().with_clip_rect(part);
            if self.debug.is_some() && place == 0 {
                painter.rect_filled(part, 0.0, Color32::from_gray(32));
                match self.main.debug() {
                    Some((shown, id)) => {
                        let pixels = egui::vec2(shown.width as f32, shown.height as f32);
                        let fitting = (part.width() / pixels.x).min(part.height() / pixels.y);
                        let place = Rect::from_center_size(part.center(), pixels * fitting);
                        painter.image(id, place, from_below, Color32::WHITE);
                    }
                    None => {
                        let text = "there is none with these settings";
                        on_dark(&painter, part.center(), Align2::CENTER_CENTER, part.width(), text);
                    }
                }
            } else if let Some((id, uv)) = image {
                painter.image(id, rect, uv, Color32::WHITE);
            }
            if self.wipe.on {
                let text = match side {
                    Side::Traced if self.state.layer.is_radiance() => {
                        format!("{}, {} paths", side.name(), self.tracing.samples())
                    }
                    Side::Traced => "paths of light: final, direct or indirect".to_owned(),
                    Side::Error => self.error.text(),
                    side => side.name().to_owned(),
                };
                let (at, align) = match place {
                    0 => (part.left_top() + egui::vec2(8.0, 8.0), Align2::LEFT_TOP),
                    _ => (part.right_top() + egui::vec2(-8.0, 8.0), Align2::RIGHT_TOP),
                };
                on_dark(&painter, at, align, part.width() - 16.0, &text);
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
        let at = rect.left_bottom() + egui::vec2(8.0, -8.0);
        on_dark(ui.painter(), at, Align2::LEFT_BOTTOM, rect.width() - 16.0, &text);
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
        let converged = match self.main.is_settled() {
            true => "  still".to_owned(),
            false => format!("  {:.0} % converged", (self.main.renderer.converged() * 100.0).floor()),
        };
        let made = self.main.renderer.isms_made();
        let making = if made < 1.0 { format!("  ISMs {:.0} %", made * 100.0) } else { String::new() };
        let recording = self.recording.as_ref().map_or_else(String::new, |r| format!("  recording {}", r.next));
        format!("{on} of {all} VPLs  GPU {gpu:.1} ms  CPU {cpu:.1} ms  {fps:.0} fps{making}{converged}{recording}")
    }
}

/// Text that is read on any picture, in as many lines as it takes to fit into `width`, points.
fn on_dark(painter: &egui::Painter, at: egui::Pos2, align: Align2, width: f32, text: &str) {
    let lines = painter.layout(text.to_owned(), egui::FontId::monospace(12.0), Color32::WHITE, width);
    let place = align.anchor_size(at, lines.size());
    painter.rect_filled(place.expand(3.0), 3.0, Color32::from_black_alpha(140));
    painter.galley(place.min, lines, Color32::WHITE);
}
