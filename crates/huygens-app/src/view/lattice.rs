//! The VPLs as points on the picture.

use eframe::egui::{self, Color32, Mesh, Painter, Pos2, Rect, Shape, Stroke, vec2};
use glam::Vec3;
use huygens::Light;
use huygens::lattice::Vpl;

use super::gizmo::Screen;

/// What is drawn of the lattice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Overlay {
    pub shown: bool,
    /// Colours are those of the shells; else of what the VPLs give.
    pub by_shell: bool,
    /// Lines from the light to the farthest VPL of each ray.
    pub rays: bool,
    /// Rims of the hemispheres.
    pub hemispheres: bool,
}

/// Half the edge of a point, points of the screen.
const HALF: f32 = 1.7;

/// Draws it; `shells` of a lattice with all its VPLs, `None` of reflected waves.
pub fn show(
    painter: &Painter,
    screen: &Screen,
    overlay: Overlay,
    vpls: &[Vpl],
    shells: Option<usize>,
    light: Option<&Light>,
    chosen: Option<usize>,
) {
    let painter = painter.with_clip_rect(screen.rect);
    if let (Some(shells), Some(light), true) = (shells, light, overlay.rays) {
        let stroke = Stroke::new(0.5, Color32::from_rgba_unmultiplied(255, 230, 120, 60));
        for ray in vpls.chunks_exact(shells) {
            let ends =
                ray.last().and_then(|last| Some([screen.project(light.position)?.0, screen.project(last.position)?.0]));
            if let Some(ends) = ends {
                painter.line_segment(ends, stroke);
            }
        }
    }
    if let (Some(shells), Some(light), true) = (shells, light, overlay.hemispheres) {
        for (shell, vpl) in vpls.iter().enumerate().take(shells) {
            let distance = (vpl.position - light.position).length();
            hemisphere(&painter, screen, light, distance, color_of_shell(shell, shells));
        }
    }
    let brightest = vpls.iter().map(|vpl| vpl.intensity.max_element()).fold(f32::MIN_POSITIVE, f32::max);
    let mut mesh = Mesh::default();
    for (i, vpl) in vpls.iter().enumerate() {
        let Some((at, _)) = screen.project(vpl.position) else { continue };
        let color = match shells {
            Some(shells) if overlay.by_shell => color_of_shell(i % shells, shells),
            // The brightest may be a hundred times as bright as most.
            _ => {
                let tone = (vpl.intensity / brightest).powf(1.0 / 3.0) * 255.0;
                Color32::from_rgb(tone.x as u8, tone.y as u8, tone.z as u8)
            }
        };
        mesh.add_colored_rect(Rect::from_center_size(at, vec2(2.0 * HALF + 1.0, 2.0 * HALF + 1.0)), Color32::BLACK);
        mesh.add_colored_rect(Rect::from_center_size(at, vec2(2.0 * HALF, 2.0 * HALF)), color);
    }
    painter.add(Shape::mesh(mesh));
    if let Some((vpl, (at, _))) = chosen.and_then(|i| vpls.get(i)).and_then(|v| Some((v, screen.project(v.position)?)))
    {
        painter.circle_stroke(at, 8.0, Stroke::new(2.0, Color32::from_rgb(0, 220, 255)));
        let size = 0.05 * (vpl.position - screen.camera.eye).length();
        if let Some((tip, _)) = screen.project(vpl.position + vpl.direction * size) {
            painter.arrow(at, tip - at, Stroke::new(2.0, Color32::from_rgb(0, 220, 255)));
        }
    }
}

/// The VPL that is nearest to a point of the screen, if one is near; of those that coincide the one in front.
pub fn pick(screen: &Screen, vpls: &[Vpl], at: Pos2) -> Option<usize> {
    let seen = vpls.iter().enumerate().filter_map(|(i, vpl)| {
        let (place, depth) = screen.project(vpl.position)?;
        let away = place.distance(at);
        (away < 8.0).then_some((i, away.round() as u32, depth))
    });
    seen.min_by(|a, b| a.1.cmp(&b.1).then(a.2.total_cmp(&b.2))).map(|(i, ..)| i)
}

fn color_of_shell(shell: usize, shells: usize) -> Color32 {
    egui::ecolor::Hsva::new(0.75 * shell as f32 / shells.max(1) as f32, 0.85, 1.0, 1.0).into()
}

/// The rim of a hemisphere and two arcs over it.
fn hemisphere(painter: &Painter, screen: &Screen, light: &Light, radius: f32, color: Color32) {
    let z = light.axis;
    let x = z.any_orthonormal_vector();
    let y = z.cross(x);
    let stroke = Stroke::new(1.0, color.gamma_multiply(0.6));
    let arc = |from: Vec3, over: Vec3, turn: f32| {
        let points = (0..=48).map(|i| {
            let (sin, cos) = (turn * i as f32 / 48.0).sin_cos();
            screen.project(light.position + (from * cos + over * sin) * radius).map(|(at, _)| at)
        });
        let points: Vec<Option<Pos2>> = points.collect();
        for pair in points.windows(2) {
            if let [Some(a), Some(b)] = pair {
                painter.line_segment([*a, *b], stroke);
            }
        }
    };
    arc(x, y, std::f32::consts::TAU);
    arc(x, z, std::f32::consts::PI);
    arc(y, z, std::f32::consts::PI);
}
