//! The path tracer, which refines a picture in the background while the view is still.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use eframe::egui;
use huygens::reference::{PathOptions, PathTracer, PixelFilter, tonemap};
use huygens::{Camera, Layer, Scene};

/// A view counts as still after so long.
const PAUSE: Duration = Duration::from_millis(400);

/// Paths a pixel after which a picture is good enough.
const ENOUGH: u32 = 4096;

/// What is traced.
#[derive(Clone, PartialEq)]
pub struct Wanted {
    pub camera: Camera,
    pub size: [u32; 2],
    /// Number of the scene, which differs with every change.
    pub scene: u64,
}

/// Sums over the paths so far.
#[derive(Default)]
struct Sums {
    samples: u32,
    direct: Vec<[f64; 3]>,
    indirect: Vec<[f64; 3]>,
}

/// A picture that is being traced.
struct Job {
    wanted: Wanted,
    sums: Arc<Mutex<Sums>>,
    go_on: Arc<AtomicBool>,
}

impl Drop for Job {
    fn drop(&mut self) {
        self.go_on.store(false, Ordering::Relaxed);
    }
}

/// Traces whatever view is wanted long enough.
#[derive(Default)]
pub struct Tracing {
    job: Option<Job>,
    since: Option<(Wanted, Instant)>,
    texture: Option<egui::TextureHandle>,
    /// Of how many paths, which layer and which exposure the texture is.
    of: Option<(u32, Layer, f32)>,
}

impl Tracing {
    /// Wants this view; begins with it once that has been so for a while.
    pub fn want(&mut self, wanted: Wanted, scene: &Scene, ctx: &egui::Context) {
        if self.job.as_ref().is_some_and(|job| job.wanted == wanted) {
            return;
        }
        (self.job, self.of) = (None, None);
        match &self.since {
            Some((before, since)) if *before == wanted => {
                let left = PAUSE.saturating_sub(since.elapsed());
                if left.is_zero() {
                    self.job = Some(begin(wanted, scene.clone(), ctx.clone()));
                } else {
                    ctx.request_repaint_after(left);
                }
            }
            _ => {
                self.since = Some((wanted, Instant::now()));
                ctx.request_repaint_after(PAUSE);
            }
        }
    }

    /// Ends what is being traced.
    pub fn stop(&mut self) {
        *self = Self::default();
    }

    /// Paths for each pixel so far.
    pub fn samples(&self) -> u32 {
        self.job.as_ref().and_then(|job| Some(job.sums.lock().ok()?.samples)).unwrap_or(0)
    }

    /// The mean so far: linear radiance of a layer, rows from the top; `None` before the first path.
    pub fn picture(&self, layer: Layer) -> Option<Vec<[f32; 3]>> {
        let sums = self.job.as_ref()?.sums.lock().ok()?;
        let share = (sums.samples > 0).then(|| 1.0 / f64::from(sums.samples))?;
        let (direct, indirect) = match layer {
            Layer::Direct => (1.0, 0.0),
            Layer::Indirect => (0.0, 1.0),
            _ => (1.0, 1.0),
        };
        let pixel = |(a, b): (&[f64; 3], &[f64; 3])| {
            std::array::from_fn(|c| ((a[c] * direct + b[c] * indirect) * share) as f32)
        };
        Some(sums.direct.iter().zip(&sums.indirect).map(pixel).collect())
    }

    /// The picture so far as a display shows it.
    pub fn texture(&mut self, ctx: &egui::Context, layer: Layer, ev: f32) -> Option<egui::TextureId> {
        let samples = self.samples();
        if self.of != Some((samples, layer, ev)) {
            let size = self.job.as_ref()?.wanted.size;
            let rgb = tonemap::display(&self.picture(layer)?, ev);
            self.texture = Some(upload(ctx, self.texture.take(), "traced", size, &rgb));
            self.of = Some((samples, layer, ev));
        }
        self.texture.as_ref().map(egui::TextureHandle::id)
    }
}

/// Puts a picture, rows from the top, into a texture.
pub fn upload(
    ctx: &egui::Context,
    old: Option<egui::TextureHandle>,
    name: &str,
    size: [u32; 2],
    rgb: &[[u8; 3]],
) -> egui::TextureHandle {
    let image = egui::ColorImage::from_rgb(size.map(|n| n as usize), rgb.as_flattened());
    match old {
        Some(mut texture) => {
            texture.set(image, egui::TextureOptions::LINEAR);
            texture
        }
        None => ctx.load_texture(name, image, egui::TextureOptions::LINEAR),
    }
}

fn begin(wanted: Wanted, scene: Scene, ctx: egui::Context) -> Job {
    let (sums, go_on) = (Arc::new(Mutex::new(Sums::default())), Arc::new(AtomicBool::new(true)));
    let job = Job { wanted: wanted.clone(), sums: sums.clone(), go_on: go_on.clone() };
    thread::spawn(move || {
        let tracer = PathTracer::new(&scene);
        let [width, height] = wanted.size;
        for pass in 0..ENOUGH {
            let options = PathOptions {
                width,
                height,
                camera: wanted.camera.clone(),
                samples: 1,
                bounces: None,
                seed: pass,
                filter: PixelFilter::Center,
            };
            let traced = tracer.trace(&options, &mut |_| go_on.load(Ordering::Relaxed));
            if !go_on.load(Ordering::Relaxed) {
                return;
            }
            let Ok(mut sums) = sums.lock() else { return };
            let Sums { samples, direct, indirect } = &mut *sums;
            *samples += 1;
            for (sum, new) in [(direct, &traced.direct), (indirect, &traced.indirect)] {
                sum.resize(new.len(), [0.0; 3]);
                for (sum, new) in sum.as_flattened_mut().iter_mut().zip(new.as_flattened()) {
                    *sum += f64::from(*new);
                }
            }
            drop(sums);
            // Every picture at first, then ever fewer of them.
            if pass < 8 || pass % 8 == 0 {
                ctx.request_repaint();
            }
        }
    });
    job
}
