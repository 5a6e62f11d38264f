//! What a pointer takes hold of to move a light or an object: arrows along the axes, a disc across the view, and for a light
//! a knob that turns it.

use eframe::egui::{self, Color32, Pos2, Rect, Sense, Stroke, Ui, vec2};
use glam::{Vec2, Vec3};
use huygens::Camera;

/// Length of an arrow, points.
const LENGTH: f32 = 70.0;

/// Radius of what is taken hold of, points.
const GRIP: f32 = 9.0;

const AXES: [(Vec3, Color32); 3] = [
    (Vec3::X, Color32::from_rgb(230, 80, 80)),
    (Vec3::Y, Color32::from_rgb(90, 200, 90)),
    (Vec3::Z, Color32::from_rgb(90, 140, 255)),
];

/// A camera with the rectangle on the screen that it fills.
pub struct Screen<'a> {
    pub camera: &'a Camera,
    pub rect: Rect,
}

impl Screen<'_> {
    /// Where a point of the world is seen, and its distance along the line of sight, m; `None` behind the camera.
    pub fn project(&self, point: Vec3) -> Option<(Pos2, f32)> {
        let vs = self.camera.view_from_world().transform_point3(point);
        let depth = -vs.z;
        let per = self.metres(depth);
        let at = self.rect.center() + vec2(vs.x, -vs.y) / per;
        // Painters do not like what is far off the screen.
        let near = at.x.abs().max(at.y.abs()) < 1e5;
        (depth > 0.0 && per > 0.0 && near).then_some((at, depth))
    }

    /// Metres that a point of the screen is wide at such a distance.
    fn metres(&self, depth: f32) -> f32 {
        let (scale, a, b) = self.camera.unprojection(self.rect.width() / self.rect.height());
        2.0 * scale.y * (a + b * depth) / self.rect.height()
    }

    /// The ray through a point of the screen.
    pub fn ray(&self, at: Pos2) -> (Vec3, Vec3) {
        let (at, size) = (at - self.rect.min, self.rect.size());
        // Whole pixels, so many that rounding does not show.
        let fine = 65536.0 / size.y;
        let (width, height) = ((size.x * fine).round(), (size.y * fine).round());
        self.camera.ray(Vec2::new(at.x / size.x * width, at.y / size.y * height), width as u32, height as u32)
    }
}

/// What a drag asks for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Moved {
    /// Somewhere else by so many metres.
    By(Vec3),
    /// To face in that direction.
    Facing(Vec3),
}

/// Draws it at a point and tells what a drag does to it.
pub fn show(ui: &Ui, screen: &Screen, name: &str, origin: Vec3, facing: Option<Vec3>) -> Option<Moved> {
    let (center, depth) = screen.project(origin)?;
    let metres = screen.metres(depth);
    let (camera, length) = (screen.camera, LENGTH * metres);
    let right = camera.forward.cross(camera.up);
    let painter = ui.painter().with_clip_rect(screen.rect);
    let grip = |at: Pos2, part: &str| {
        let rect = Rect::from_center_size(at, vec2(2.0 * GRIP, 2.0 * GRIP)).intersect(screen.rect);
        ui.interact(rect, ui.scope_id().with(("gizmo", name, part)), Sense::drag())
    };
    let mut moved = None;
    for (i, (axis, color)) in AXES.into_iter().enumerate() {
        let Some((tip, _)) = screen.project(origin + axis * length) else { continue };
        let along = tip - center;
        // Seen from its end, an arrow cannot be drawn out.
        if along.length() < 0.15 * LENGTH {
            continue;
        }
        let response = grip(tip, ["x", "y", "z"][i]);
        let held = response.hovered() || response.dragged();
        painter.arrow(center, along, Stroke::new(if held { 4.0 } else { 2.0 }, color));
        if response.dragged() {
            moved = Some(Moved::By(axis * (response.drag_delta().dot(along) / along.length_sq()) * length));
        }
    }
    if let Some((tip, _)) = facing.and_then(|facing| screen.project(origin + facing * length * 1.4)) {
        let response = grip(tip, "facing");
        let held = response.hovered() || response.dragged();
        painter.line_segment([center, tip], Stroke::new(1.5, Color32::YELLOW));
        painter.circle(tip, if held { 7.0 } else { 5.0 }, Color32::YELLOW, Stroke::new(1.0, Color32::BLACK));
        if response.dragged() {
            let by = response.drag_delta() * metres;
            let tip = facing.unwrap_or(Vec3::Z) * length * 1.4 + right * by.x - camera.up * by.y;
            moved = tip.try_normalize().map(Moved::Facing);
        }
    }
    let response = grip(center, "centre");
    let held = response.hovered() || response.dragged();
    let fill = if facing.is_some() { Color32::YELLOW } else { Color32::WHITE };
    painter.circle(center, if held { 9.0 } else { 7.0 }, fill, Stroke::new(1.5, Color32::BLACK));
    if response.dragged() {
        let by = response.drag_delta() * metres;
        moved = Some(Moved::By(right * by.x - camera.up * by.y));
    }
    if moved.is_some() {
        ui.ctx().set_cursor_icon(egui::CursorIcon::Grabbing);
    }
    moved
}

#[cfg(test)]
mod tests {
    use super::*;
    use eframe::egui::pos2;
    use huygens::camera::Projection;

    #[test]
    fn rays_go_through_what_is_projected() {
        let mut camera = Camera::look_at(Vec3::new(1.0, 2.0, 3.0), Vec3::new(-2.0, 0.5, 1.0), 0.8).unwrap();
        let rect = Rect::from_min_max(pos2(10.0, 20.0), pos2(650.0, 380.0));
        for projection in [camera.projection, Projection::Orthographic { half_height: 2.5 }] {
            camera.projection = projection;
            let screen = Screen { camera: &camera, rect };
            let point = Vec3::new(-1.5, 1.0, 1.2);
            let (at, depth) = screen.project(point).unwrap();
            let (origin, direction) = screen.ray(at);
            assert!((origin + direction * depth - point).length() < 1e-3, "{at:?} {depth}");
            assert!(screen.project(camera.eye - camera.forward).is_none());
        }
    }
}
