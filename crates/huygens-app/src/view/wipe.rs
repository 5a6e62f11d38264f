//! Two pictures side by side, and the error of one against the path tracer.

use eframe::egui;
use huygens::Layer;
use huygens::reference::tonemap;

use super::drawing::Drawing;
use super::later::Later;
use super::trace::{Tracing, upload};
use crate::metrics;

/// What a side of the picture shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    AsSet,
    Direct,
    Wave,
    Reflected,
    Traced,
    Error,
}

impl Side {
    pub const ALL: [Side; 6] = [Side::AsSet, Side::Direct, Side::Wave, Side::Reflected, Side::Traced, Side::Error];

    pub fn name(self) -> &'static str {
        match self {
            Side::AsSet => "as set",
            Side::Direct => "direct",
            Side::Wave => "wave",
            Side::Reflected => "reflected",
            Side::Traced => "path tracer",
            Side::Error => "error",
        }
    }

    /// Whether the renderer draws it.
    pub fn is_drawn(self) -> bool {
        !matches!(self, Side::Traced | Side::Error)
    }
}

/// A line between two pictures.
pub struct Wipe {
    pub on: bool,
    pub left: Side,
    pub right: Side,
    /// Where the line is, 0…1.
    pub at: f32,
}

impl Default for Wipe {
    fn default() -> Self {
        Self { on: false, left: Side::AsSet, right: Side::Traced, at: 0.5 }
    }
}

/// Mean FLIP and its heat map.
type Measured = (f64, Vec<[u8; 3]>);

/// FLIP of the drawn picture against the traced one.
#[derive(Default)]
pub struct ErrorView {
    texture: Option<egui::TextureHandle>,
    /// Mean of the texture, and paths that it was measured with.
    shown: Option<(f64, u32)>,
    next: Option<Later<Option<Measured>>>,
    /// What was measured last, or is being: of how many paths, whether what is drawn was settled, of which layer and
    /// exposure.
    of: Option<(u32, bool, Layer, f32)>,
}

impl ErrorView {
    pub fn texture(&self) -> Option<egui::TextureId> {
        self.texture.as_ref().map(egui::TextureHandle::id)
    }

    pub fn text(&self) -> String {
        match (self.shown, self.of) {
            (Some((mean, paths)), _) => format!("FLIP {mean:.4}, {paths} paths"),
            (None, Some(_)) => "FLIP is being measured".to_owned(),
            (None, None) => "FLIP of light: final, direct or indirect".to_owned(),
        }
    }

    /// Measures anew when there are half as many paths again, or when what is drawn has settled: it takes a while, and waits
    /// for the GPU.
    pub fn update(
        &mut self,
        ctx: &egui::Context,
        drawing: &mut Drawing,
        tracing: &Tracing,
        layer: Layer,
        size: [u32; 2],
        ev: f32,
    ) -> huygens::Result<()> {
        let samples = tracing.samples();
        if samples == 0 || !layer.is_radiance() || metrics::check_size(size).is_err() {
            // Another view.
            *self = Self::default();
            return Ok(());
        }
        if let Some(next) = &self.next {
            let Some(measured) = next.take() else { return Ok(()) };
            self.next = None;
            if let Some((mean, rgb)) = measured.flatten()
                && let Some((paths, ..)) = self.of
            {
                self.shown = Some((mean, paths));
                self.texture = Some(upload(ctx, self.texture.take(), "error", size, &rgb));
            }
        }
        let same = self.of.is_some_and(|(before, settled, of, at)| {
            (settled, of, at) == (drawing.is_settled(), layer, ev) && (before..=before + before / 2).contains(&samples)
        });
        if same {
            return Ok(());
        }
        self.of = Some((samples, drawing.is_settled(), layer, ev));
        let (Some(reference), Some(drawn)) = (tracing.picture(layer), drawing.renderer.read()?) else { return Ok(()) };
        self.next = Some(Later::new(ctx, move || {
            let display = |linear: &[[f32; 3]]| tonemap::display(linear, ev);
            let map = metrics::flip(size, &display(&reference), &display(&drawn.linear)).ok()?;
            Some((metrics::mean(&map), metrics::heat_map(&map).ok()?))
        }));
        Ok(())
    }
}
