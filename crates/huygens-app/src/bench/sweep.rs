//! `--sweep`: how the cost of a frame grows with pixels, VPLs and triangles while the light and the camera move.

use std::collections::HashMap;
use std::sync::Arc;

use anyhow::Context;
use huygens::gl::Headless;
use huygens::scene::Mesh;
use huygens::{RenderOptions, Renderer, Scene, Settings};
use plotters::prelude::*;
use serde::Serialize;

use super::motion::{self, Moving};
use super::{INDIRECT, Spread, Times, read};
use crate::Failure;
use crate::cli::BenchArgs;

/// What grows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
enum Over {
    Pixels,
    Vpls,
    Triangles,
}

/// A case with more and more of one thing.
#[derive(Serialize)]
pub struct Sweep {
    preset: String,
    over: Over,
    points: Vec<Point>,
}

#[derive(Serialize)]
struct Point {
    /// How many pixels, VPLs or triangles.
    count: usize,
    /// Wall-clock time of a frame, ms.
    frame_ms: Spread,
    /// Passes that indirect light needs, ms.
    gi_ms: Spread,
}

/// Measures all sweeps of a case; each step has four times as many as the one before, and is left out where that is not
/// allowed.
pub fn measure(
    headless: &Headless,
    (name, settings): (&str, &Settings),
    scene: &Scene,
    options: &RenderOptions,
    arguments: &BenchArgs,
    progress: &mut dyn FnMut(f32),
) -> Result<Vec<Sweep>, Failure> {
    let [half, double] = [options.width.div_ceil(2), options.width * 2].map(|width| {
        let height = if width < options.width { options.height.div_ceil(2) } else { options.height * 2 };
        RenderOptions { width, height, ..options.clone() }
    });
    let steps = |factor: f32| {
        let mut settings = settings.clone();
        settings.wave.delta_theta *= factor;
        settings.wave.delta_phi *= factor;
        settings
    };
    let (fine, finer) = (subdivided(scene), subdivided(&subdivided(scene)));
    let cases = [
        (Over::Pixels, [(&half, settings, scene), (options, settings, scene), (&double, settings, scene)]),
        (Over::Vpls, [(options, &steps(2.0), scene), (options, settings, scene), (options, &steps(0.5), scene)]),
        (Over::Triangles, [(options, settings, scene), (options, settings, &fine), (options, settings, &finer)]),
    ];
    let frames = arguments.last() + 1;
    let all = (9 * frames) as f32;
    let mut done = 0;
    let mut sweeps = Vec::new();
    for (over, steps) in cases {
        let mut points = Vec::new();
        for (options, settings, scene) in steps {
            let mut renderer = Renderer::new(headless.context())?;
            if renderer.check(settings, options).is_err() {
                continue;
            }
            let mut times = Times::default();
            for number in 0..frames {
                if number == arguments.warm_up {
                    times = Times::default();
                }
                let (scene, options) = motion::frame(&[Moving::Light, Moving::Camera], scene, options, number);
                times.take(&mut renderer, &scene, settings, &options)?;
                done += 1;
                progress(done as f32 / all);
            }
            let stats = read(&mut renderer)?.stats;
            let count = match over {
                Over::Pixels => options.width as usize * options.height as usize,
                Over::Vpls => stats.vpls,
                Over::Triangles => stats.triangles,
            };
            points.push(Point { count, gi_ms: times.of(&INDIRECT), frame_ms: Spread::of(times.frame) });
        }
        sweeps.push(Sweep { preset: name.to_owned(), over, points });
    }
    Ok(sweeps)
}

/// The same surfaces in four times as many triangles.
fn subdivided(scene: &Scene) -> Scene {
    let mut scene = scene.clone();
    for mesh in &mut scene.meshes {
        *mesh = Arc::new(quartered(mesh));
    }
    scene
}

/// Every edge gets a vertex in its middle.
fn quartered(mesh: &Mesh) -> Mesh {
    let mut mesh = mesh.clone();
    let mut middles: HashMap<[u32; 2], u32> = HashMap::new();
    let triangles = std::mem::take(&mut mesh.indices);
    for &[a, b, c] in triangles.as_chunks::<3>().0 {
        let [ab, bc, ca] = [[a, b], [b, c], [c, a]].map(|edge| {
            let key = [edge[0].min(edge[1]), edge[0].max(edge[1])];
            *middles.entry(key).or_insert_with(|| add_middle(&mut mesh, key))
        });
        mesh.indices.extend([a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca]);
    }
    mesh
}

/// The vertex between two; lists that a mesh does not have stay empty.
fn add_middle(mesh: &mut Mesh, edge: [u32; 2]) -> u32 {
    let [a, b] = edge.map(|index| index as usize);
    let middle = mesh.positions.len() as u32;
    mesh.positions.push(mesh.positions[a].midpoint(mesh.positions[b]));
    if !mesh.normals.is_empty() {
        let sum = mesh.normals[a] + mesh.normals[b];
        mesh.normals.push(sum.try_normalize().unwrap_or(mesh.normals[a]));
    }
    if !mesh.tangents.is_empty() {
        let sum = (mesh.tangents[a] + mesh.tangents[b]).truncate();
        let direction = sum.try_normalize().unwrap_or(mesh.tangents[a].truncate());
        mesh.tangents.push(direction.extend(mesh.tangents[a].w));
    }
    for uvs in &mut mesh.uvs {
        if !uvs.is_empty() {
            uvs.push(uvs[a].midpoint(uvs[b]));
        }
    }
    if !mesh.colors.is_empty() {
        mesh.colors.push((mesh.colors[a] + mesh.colors[b]) * 0.5);
    }
    middle
}

/// What grew by four, for a terminal.
pub fn table(sweeps: &[Sweep], width: usize) -> String {
    let mut text = format!(
        "\n{:width$}  {:>9}  {:>9}  {:>9}  {:>9}  {:>7}  {:>9}\n",
        "preset", "over", "count", "frame ms", "p95", "times", "GI ms"
    );
    for sweep in sweeps {
        let mut before = None;
        for point in &sweep.points {
            let times = before.replace(point.frame_ms.median).map(|before| point.frame_ms.median / before);
            text.push_str(&format!(
                "{:width$}  {:>9}  {:>9}  {:>9.1}  {:>9.1}  {:>7}  {:>9.1}\n",
                sweep.preset,
                sweep.over.name(),
                point.count,
                point.frame_ms.median,
                point.frame_ms.p95,
                times.map_or(String::new(), |times| format!("{times:.2}")),
                point.gi_ms.median,
            ));
        }
    }
    text
}

impl Over {
    fn name(self) -> &'static str {
        match self {
            Self::Pixels => "pixels",
            Self::Vpls => "VPLs",
            Self::Triangles => "triangles",
        }
    }
}

/// Frame times over counts, both logarithmic, one plot for each thing that grows.
pub fn plot(sweeps: &[Sweep], title: &str) -> anyhow::Result<Vec<u8>> {
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, (1200, 420)).into_drawing_area();
        root.fill(&WHITE)?;
        let root = root.titled(title, ("sans-serif", 18))?;
        for (area, over) in root.split_evenly((1, 3)).iter().zip([Over::Pixels, Over::Vpls, Over::Triangles]) {
            let lines: Vec<&Sweep> = sweeps.iter().filter(|sweep| sweep.over == over).collect();
            // Of frame times one range for all plots, so that they compare.
            let range = |values: Vec<f64>| {
                let [low, high] = [f64::min, f64::max].map(|of| values.iter().copied().reduce(of).unwrap_or(1.0));
                (0.5 * low.max(1e-6)..2.0 * high.max(1e-5)).log_scale()
            };
            let counts = lines.iter().flat_map(|sweep| &sweep.points).map(|point| point.count as f64).collect();
            let times = sweeps.iter().flat_map(|sweep| &sweep.points).map(|point| point.frame_ms.median).collect();
            let mut chart = ChartBuilder::on(area)
                .margin(12)
                .x_label_area_size(40)
                .y_label_area_size(56)
                .build_cartesian_2d(range(counts), range(times))?;
            let mesh = &mut chart.configure_mesh();
            mesh.x_desc(over.name()).y_desc("ms a frame").x_labels(6).max_light_lines(0).draw()?;
            for (i, sweep) in lines.iter().enumerate() {
                let color = Palette99::pick(i).to_rgba();
                let places = || sweep.points.iter().map(|p| (p.count as f64, p.frame_ms.median));
                let line = chart.draw_series(LineSeries::new(places(), color.stroke_width(2)))?;
                line.label(&sweep.preset).legend(move |(x, y)| PathElement::new([(x, y), (x + 16, y)], color));
                chart.draw_series(places().map(|place| Circle::new(place, 3, color.filled())))?;
            }
            let labels = &mut chart.configure_series_labels();
            labels
                .position(SeriesLabelPosition::UpperLeft)
                .background_style(WHITE.mix(0.8))
                .border_style(BLACK)
                .draw()?;
        }
        root.present().context("SVG")?;
    }
    Ok(svg.into_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_subdivided_scene_has_the_same_surfaces_in_four_times_as_many_triangles() {
        for (name, _) in huygens::scene::BUILTIN_NAMES {
            let scene = Scene::builtin(name).unwrap();
            let fine = subdivided(&scene);
            assert_eq!(fine.triangle_count(), 4 * scene.triangle_count());
            for (mesh, fine) in scene.meshes.iter().zip(&fine.meshes) {
                // Area vectors keep their sum, and their sum of lengths.
                let areas = |mesh: &Mesh| {
                    let corners = |t: &[u32; 3]| t.map(|i| mesh.positions[i as usize]);
                    let triangles = mesh.indices.as_chunks::<3>().0.iter().map(corners);
                    let areas: Vec<_> = triangles.map(|[a, b, c]| 0.5 * (b - a).cross(c - a).as_dvec3()).collect();
                    let total: f64 = areas.iter().map(|area| area.length()).sum();
                    (areas.iter().copied().sum::<glam::DVec3>(), total)
                };
                let ((sum, total), (fine_sum, fine_total)) = (areas(mesh), areas(fine));
                assert!(
                    (sum - fine_sum).length() < 1e-4 * total && (total - fine_total).abs() < 1e-4 * total,
                    "{name}"
                );
                let count = fine.positions.len();
                assert!(fine.indices.iter().all(|&i| (i as usize) < count), "{name}");
                for list in [fine.normals.len(), fine.tangents.len(), fine.uvs[0].len(), fine.colors.len()] {
                    assert!(list == 0 || list == count, "{name}");
                }
            }
        }
    }
}
