//! Times of the passes, as a plot and a table.

use std::collections::VecDeque;

use eframe::egui::{self, Color32, Sense, Ui, vec2};
use egui_plot::{Bar, BarChart, GridInput, GridMark, Plot};
use huygens::PassTime;

/// Frames that the plot has.
const FRAMES: usize = 120;

/// Times of the last frames.
#[derive(Default)]
pub struct Times {
    frames: VecDeque<Vec<PassTime>>,
    /// Passes that have been, each with its colour for good.
    names: Vec<&'static str>,
    cpu: bool,
}

/// Milliseconds of a pass.
fn ms(time: &PassTime, cpu: bool) -> f64 {
    if cpu { time.cpu_ms } else { time.gpu_ms.unwrap_or(0.0) }
}

/// Marks so far from each other that each has its number.
fn marks(input: GridInput) -> Vec<GridMark> {
    let (low, high) = input.bounds;
    let least = (high - low) / 4.0;
    if !(least > 0.0 && least.is_finite()) {
        return Vec::new();
    }
    let power = 10f64.powf(least.log10().floor());
    let step = [1.0, 2.0, 5.0].map(|n| n * power).into_iter().find(|step| *step >= least).unwrap_or(10.0 * power);
    (0..=(high / step) as u8).map(|i| GridMark { value: f64::from(i) * step, step_size: step }).collect()
}

impl Times {
    pub fn push(&mut self, times: Vec<PassTime>) {
        for time in &times {
            if !self.names.contains(&time.name) {
                self.names.push(time.name);
            }
        }
        if self.frames.len() == FRAMES {
            self.frames.pop_front();
        }
        self.frames.push_back(times);
    }

    /// Milliseconds of the last frame on the GPU and on the CPU.
    pub fn last(&self) -> (f64, f64) {
        let sum = |cpu| self.frames.back().map_or(0.0, |times| times.iter().map(|time| ms(time, cpu)).sum());
        (sum(false), sum(true))
    }

    pub fn show(&mut self, ui: &mut Ui) {
        ui.horizontal(|ui| {
            ui.selectable_value(&mut self.cpu, false, "GPU");
            ui.selectable_value(&mut self.cpu, true, "CPU");
            ui.label("ms of each pass").on_hover_text("of the last frames");
        });
        let mut charts: Vec<BarChart> = Vec::new();
        for (i, &name) in self.names.iter().enumerate() {
            let bars = self.frames.iter().enumerate().map(|(x, times)| {
                let sum = times.iter().filter(|time| time.name == name).map(|time| ms(time, self.cpu)).sum();
                Bar::new(x as f64, sum).width(1.0)
            });
            let chart = BarChart::new(name, bars.collect()).color(color(i));
            charts.push(match charts.is_empty() {
                true => chart,
                false => chart.stack_on(&charts.iter().collect::<Vec<_>>()),
            });
        }
        let plot = Plot::new("passes").height(120.0).include_y(0.0).include_x(0.0).include_x(FRAMES as f64);
        let plot = plot.show_x(false).show_axes([false, true]).allow_drag(false).allow_zoom(false).allow_scroll(false);
        plot.allow_boxed_zoom(false).y_grid_spacer(marks).show(ui, |plot| {
            for chart in charts {
                plot.bar_chart(chart);
            }
        });
        egui::Grid::new("passes").num_columns(3).striped(true).show(ui, |ui| {
            for text in ["pass", "GPU ms", "CPU ms"] {
                ui.weak(text);
            }
            ui.end_row();
            let last = self.frames.back();
            for (i, &name) in self.names.iter().enumerate() {
                ui.horizontal(|ui| {
                    let (rect, _) = ui.allocate_exact_size(vec2(8.0, 8.0), Sense::hover());
                    ui.painter().rect_filled(rect, 1.0, color(i));
                    ui.label(name);
                });
                // What was made before is not made again.
                let time = last.and_then(|times| times.iter().find(|time| time.name == name));
                for ms in [time.and_then(|time| time.gpu_ms), time.map(|time| time.cpu_ms)] {
                    ui.monospace(ms.map_or_else(|| format!("{:>8}", "–"), |ms| format!("{ms:8.2}")));
                }
                ui.end_row();
            }
        });
    }
}

fn color(i: usize) -> Color32 {
    egui::ecolor::Hsva::new(i as f32 * 0.382 % 1.0, 0.65, 0.9, 1.0).into()
}
