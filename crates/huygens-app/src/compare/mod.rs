//! `huygens compare`: techniques against the path tracer on a scene, or one picture against another.

mod files;
mod report;
mod techniques;

use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::Context;
use huygens::gl::Headless;
use huygens::reference::{PathOptions, PathTraced, PathTracer, PixelFilter, tonemap};
use huygens::{Exposure, Layer, RenderOptions, Renderer, Scene};
use serde::{Deserialize, Serialize};

use crate::cli::{Common, CompareArgs};
use crate::metrics::{self, Metrics};
use crate::output::{self, Target};
use crate::progress::Bar;
use crate::{Failure, input, interrupt, print, reference, say};

pub use techniques::TECHNIQUES;
use techniques::{Outcome, Shot, Technique};

/// What `metrics.json` holds of a scene.
#[derive(Serialize)]
struct Report {
    scene: String,
    size: [u32; 2],
    frames: u32,
    seed: u32,
    /// Exposure of all pictures: that of the reference, EV.
    exposure_ev: f32,
    driver: String,
    reference: ReferenceEntry,
    techniques: Vec<Entry>,
    /// Where the error of the technique with `ray_cast`'s settings comes from; empty without that technique.
    steps: Vec<StepEntry>,
}

/// An approximation in `metrics.json`: the picture after it against that before it.
#[derive(Serialize)]
struct StepEntry {
    name: String,
    about: String,
    #[serde(flatten)]
    metrics: Metrics,
}

/// The reference in `metrics.json`.
#[derive(Serialize)]
struct ReferenceEntry {
    /// Paths for each pixel.
    samples: u32,
    trace_ms: f64,
    /// Whether it was there from an earlier comparison.
    cached: bool,
    picture: String,
    exr: String,
}

/// A technique in `metrics.json`.
#[derive(Serialize)]
struct Entry {
    name: String,
    about: String,
    /// Factor on the albedo of a constant ambient term that gives the lowest FLIP.
    #[serde(skip_serializing_if = "Option::is_none")]
    scale: Option<f64>,
    /// Wall-clock time of the last frame; null where the technique is no frame.
    frame_ms: Option<f64>,
    #[serde(flatten)]
    metrics: Metrics,
    picture: String,
    exr: String,
    heat_map: String,
}

/// The reference of a comparison.
pub(crate) struct Reference {
    pub size: [u32; 2],
    /// Paths for each pixel.
    pub samples: u32,
    pub shot: Shot,
    /// The direct part of it.
    pub direct: Vec<[f32; 3]>,
    /// As a display shows it.
    pub display: Vec<[u8; 3]>,
    pub exposure_ev: f32,
}

pub fn run(arguments: &CompareArgs) -> Result<(), Failure> {
    let common = &arguments.common;
    if files::is_picture(Path::new(&common.scene)) || arguments.second.is_some() {
        return files::run(arguments);
    }
    let settings = input::settings(common)?;
    let techniques = Technique::of(arguments, &settings)?;
    if common.layer != Layer::Final {
        let what = format_args!("--layer {}", common.layer.name()).to_string();
        return Err(Failure::bad_input(what, "compare looks at the final light", "final"));
    }
    let Some(folder) = &arguments.output else {
        return Err(Failure::bad_input("compare", "a scene needs a folder for what is made of it", "--output DIR"));
    };
    let folder = Folder::new(folder)?;
    let stats = common.stats.as_deref().map(|path| Target::new("--stats", path)).transpose()?;
    metrics::check_size(common.size).map_err(|e| {
        Failure::bad_input(format_args!("--size {}x{}", common.size[0], common.size[1]), e, metrics::LARGEST)
    })?;
    input::check_memory(common, PIXEL + PIXEL_OF_TECHNIQUE * techniques.len())?;
    let names = techniques.iter().flat_map(|technique| files_of(technique.name()));
    let names = names.chain([REFERENCE_EXR, REFERENCE_PNG, METRICS, PAGE].map(str::to_owned));
    let planned = folder.planned(names)?;
    let targets: Vec<&Target> = planned.iter().chain(&stats).collect();
    input::check_distinct(common, &targets)?;
    let bar = Bar::new(common.quiet, format_args!("loading {}", common.scene.display()));
    let scene = input::load(common)?;
    input::check_not_of_scene(&scene, &targets)?;
    let options = input::options(common, &scene)?;
    // Before minutes of tracing: is there a driver at all, and can it draw this?
    let headless = Headless::new(common.device.index)?;
    let mut renderer = Renderer::new(headless.context())?;
    for technique in &techniques {
        renderer.check(technique.settings(&settings), &options)?;
    }
    drop(bar);
    input::warn(&scene);

    let (reference, cached, trace_ms) = reference_of(&scene, arguments, &options, &folder)?;
    let outcomes =
        techniques::render(&mut renderer, &scene, &settings, &options, &techniques, &reference, common.quiet)?;
    // FLIP of large pictures takes its time.
    let bar = Bar::new(common.quiet, "measuring");
    let mut files = Vec::new();
    let (mut entries, mut steps) = (Vec::new(), Vec::new());
    for outcome in &outcomes {
        entries.push(judge(outcome, &reference, &folder, &mut files)?);
        for step in &outcome.steps {
            let before = step.before.as_ref().unwrap_or(&reference.shot);
            let (metrics, ..) = measure(common.size, reference.exposure_ev, before, &step.after)?;
            steps.push(StepEntry { name: step.name.to_owned(), about: step.about.clone(), metrics });
        }
    }
    let driver = headless.context().info().renderer.clone();
    let report = Report {
        scene: scene.name.clone(),
        size: common.size,
        frames: common.frames.averaged(),
        seed: common.seed,
        exposure_ev: reference.exposure_ev,
        driver,
        reference: ReferenceEntry {
            samples: reference.samples,
            trace_ms,
            cached,
            picture: REFERENCE_PNG.to_owned(),
            exr: REFERENCE_EXR.to_owned(),
        },
        techniques: entries,
        steps,
    };
    let json = output::json(&report).context(METRICS)?;
    files.push((folder.target(PAGE)?, report::html(&json)?));
    if let Some(stats) = stats {
        files.push((stats, json.clone()));
    }
    files.push((folder.target(METRICS)?, json));
    let size = common.size;
    files.push((folder.target(REFERENCE_PNG)?, output::encode_png(size[0], size[1], &reference.display)?));
    output::write(&files)?;
    drop(bar);
    print(&table(&report))?;
    print(&format!("wrote {}\n", folder.given.join(PAGE).display()))
}

/// Memory for each pixel, bytes: of the path tracer and the reference, and of each technique with its files (that with
/// the steps has more).
const PIXEL: usize = 512;
const PIXEL_OF_TECHNIQUE: usize = 64;

/// What is written beside the files of the techniques.
const REFERENCE_EXR: &str = "reference.exr";
const REFERENCE_PNG: &str = "reference.png";
const METRICS: &str = "metrics.json";
const PAGE: &str = "report.html";

/// Names of a technique's files: picture, layers, heat map.
fn files_of(technique: &str) -> [String; 3] {
    [".png", ".exr", "-flip.png"].map(|ending| format!("{technique}{ending}"))
}

/// Metrics of one technique, and its files.
fn judge(
    outcome: &Outcome,
    reference: &Reference,
    folder: &Folder,
    files: &mut Vec<(Target, Vec<u8>)>,
) -> Result<Entry, Failure> {
    let (size, shot) = (reference.size, &outcome.shot);
    let (metrics, map, display) = measure(size, reference.exposure_ev, &reference.shot, shot)?;
    let name = &outcome.name;
    let [picture, exr, heat_map] = files_of(name);
    files.push((folder.target(&picture)?, output::encode_png(size[0], size[1], &display)?));
    let layers: [(&str, &[[f32; 3]]); 1] = [("indirect", &shot.indirect)];
    files.push((folder.target(&exr)?, output::encode_layers(size, &shot.seen, &layers, None)?));
    files.push((folder.target(&heat_map)?, output::encode_png(size[0], size[1], &metrics::heat_map(&map)?)?));
    Ok(Entry {
        name: name.clone(),
        about: outcome.about.clone(),
        scale: outcome.scale,
        frame_ms: outcome.frame_ms,
        metrics,
        picture,
        exr,
        heat_map,
    })
}

/// What `metrics.json` says of one picture against another, the FLIP map and what a display shows.
fn measure(size: [u32; 2], exposure_ev: f32, before: &Shot, after: &Shot) -> anyhow::Result<Measured> {
    let [expected, display] = [before, after].map(|shot| tonemap::display(&shot.seen, exposure_ev));
    let map = metrics::flip(size, &expected, &display)?;
    let energy = metrics::energy(&before.indirect, &after.indirect);
    let metrics = Metrics {
        flip: metrics::mean(&map),
        hdr_flip: metrics::hdr(size, &before.seen, &after.seen)?,
        ssim: metrics::ssim(size, &expected, &display),
        relative_rmse: energy.map(|(rmse, _)| rmse),
        energy_ratio: energy.map(|(_, ratio)| ratio),
    };
    Ok((metrics, map, display))
}

type Measured = (Metrics, flip_rs::ErrorMap, Vec<[u8; 3]>);

/// The attribute of the reference's EXR that tells whether it is still the one that is asked for: a [`ReferenceKey`].
const REFERENCE_KEY: &str = "huygensReference";

#[derive(Serialize, Deserialize)]
struct ReferenceKey {
    /// Of the scene, the camera and everything that has an influence on the picture.
    key: String,
    samples: u32,
    trace_ms: f64,
}

/// Traces the reference, or takes the one of an earlier comparison; with whether it did, and how long tracing took, ms.
fn reference_of(
    scene: &Scene,
    arguments: &CompareArgs,
    options: &RenderOptions,
    folder: &Folder,
) -> Result<(Reference, bool, f64), Failure> {
    let common = &arguments.common;
    // The first frame of the GPU samples pixel centres: the comparison is to be about light, not about edges.
    let filter = if common.frames.averaged() == 1 { PixelFilter::Center } else { PixelFilter::Box };
    let path = reference::path_options(options, arguments.spp, None, filter);
    let fingerprint = scene.fingerprint();
    let key = |samples: u32| {
        let mut hasher = DefaultHasher::new();
        let path = PathOptions { samples, ..path.clone() };
        (reference::VERSION, fingerprint, format!("{path:?}")).hash(&mut hasher);
        format!("{:016x}", hasher.finish())
    };

    let (traced, cached, trace_ms) = match cached(folder, &key, &path)? {
        Some((traced, trace_ms)) => (traced, true, trace_ms),
        None => {
            let started = Instant::now();
            let tracer = PathTracer::new(scene);
            let (traced, stopped) = reference::trace(&tracer, &path, common.quiet);
            let trace_ms = started.elapsed().as_secs_f64() * 1e3;
            if stopped {
                return Err(Failure::interrupted("the reference is not done, nothing is written"));
            }
            let key = ReferenceKey { key: key(traced.samples), samples: traced.samples, trace_ms };
            let seen = reference::sum(&traced.direct, &traced.indirect);
            // At once: it is what takes longest, and whatever fails later, the next comparison will find it.
            let key = serde_json::to_string(&key).context(REFERENCE_EXR)?;
            let bytes = reference::encode(&seen, &traced, Some((REFERENCE_KEY, &key)))?;
            folder.make()?;
            output::write(&[(folder.target(REFERENCE_EXR)?, bytes)])?;
            if interrupt::is_asked_to_end() {
                return Err(Failure::interrupted("the reference is there, and nothing else yet"));
            }
            (traced, false, trace_ms)
        }
    };
    let (size, samples) = ([traced.width, traced.height], traced.samples);
    if cached {
        let there = folder.given.join(REFERENCE_EXR);
        say("note", format_args!("the reference is that of {} ({})", there.display(), reference::paths(samples)));
    }
    let shot = Shot::new(&traced.direct, traced.indirect);
    let exposure_ev = exposure(common, &shot.seen);
    let display = tonemap::display(&shot.seen, exposure_ev);
    Ok((Reference { size, samples, shot, direct: traced.direct, display, exposure_ev }, cached, trace_ms))
}

/// The exposure that was asked for; automatic exposure is that of the reference.
fn exposure(common: &Common, reference: &[[f32; 3]]) -> f32 {
    match common.exposure {
        Exposure::Auto => tonemap::auto_exposure(reference),
        Exposure::Ev(ev) => ev,
    }
}

/// The reference of an earlier comparison, if it can be read and is the same one, or one of more paths. Refuses to
/// replace what is none.
fn cached(
    folder: &Folder,
    key: &dyn Fn(u32) -> String,
    options: &PathOptions,
) -> Result<Option<(PathTraced, f64)>, Failure> {
    let path = folder.given.join(REFERENCE_EXR);
    if !path.exists() {
        return Ok(None);
    }
    let found = files::attribute(&path, REFERENCE_KEY);
    let Some(found) = found.and_then(|text| serde_json::from_str::<ReferenceKey>(&text).ok()) else {
        let problem = "it would replace a file that is no reference of a comparison";
        return Err(Failure::bad_input(format_args!("--output {}", path.display()), problem, "another folder"));
    };
    let same = found.samples >= options.samples && found.key == key(found.samples);
    let size = [options.width, options.height];
    let same = same.then(|| read_reference(&path, found.samples, size)).flatten();
    if same.is_none() {
        let paths = reference::paths(found.samples);
        say("note", format_args!("{} is of other settings ({paths}): will be replaced", path.display()));
    }
    Ok(same.map(|traced| (traced, found.trace_ms)))
}

/// What [`reference::encode`] wrote.
fn read_reference(path: &Path, samples: u32, size: [u32; 2]) -> Option<PathTraced> {
    let picture = files::read_exr(path).ok().filter(|picture| picture.size == size)?;
    let layer = |name: &str| picture.layer(name);
    let (direct, indirect, variance) = (layer("direct.")?, layer("indirect.")?, layer("variance.")?);
    Some(PathTraced { width: size[0], height: size[1], samples, direct, indirect, variance })
}

/// Whether a comparison of a scene or of two pictures wrote this `metrics.json`.
fn is_of_comparison(metrics: &Path) -> bool {
    let json = std::fs::read(metrics).ok().and_then(|bytes| serde_json::from_slice::<serde_json::Value>(&bytes).ok());
    let has = |key| json.as_ref().is_some_and(|json| json.get(key).is_some());
    has("size") && has("reference") && (has("techniques") || has("picture"))
}

/// The folder that takes everything.
pub(crate) struct Folder {
    given: PathBuf,
}

impl Folder {
    fn new(given: &Path) -> Result<Self, Failure> {
        let refuse =
            |problem: &str, allowed| Failure::bad_input(format_args!("--output {}", given.display()), problem, allowed);
        if given.exists() && !given.is_dir() {
            return Err(refuse("it is a file", "a folder, or the name of a new one"));
        }
        let parent = given.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        if !given.is_dir() && !parent.is_dir() {
            return Err(refuse("the folder above it does not exist", "a folder, or the name of a new one in a folder"));
        }
        Ok(Self { given: given.to_owned() })
    }

    /// Checks that files of these names can be written: they, or the folder that is yet to be made for them.
    fn planned(&self, names: impl Iterator<Item = String>) -> Result<Vec<Target>, Failure> {
        if self.given.is_dir() {
            let targets = names.map(|name| self.target(&name)).collect::<Result<Vec<_>, _>>()?;
            let ours = is_of_comparison(&self.given.join(METRICS));
            // The reference, which may be there alone, says itself what it is.
            let foreign = |target: &&Target| !ours && target.given.exists() && !target.given.ends_with(REFERENCE_EXR);
            return match targets.iter().find(foreign) {
                Some(target) => {
                    let problem = "it would replace a file, and no metrics.json beside it is that of a comparison";
                    Err(Failure::bad_input(target, problem, "another folder"))
                }
                None => Ok(targets),
            };
        }
        let parent = self.given.parent().unwrap_or(Path::new("."));
        let folder = Target::new("--output", &parent.join(self.given.file_name().unwrap_or_default()))?;
        Ok(vec![folder])
    }

    /// Makes it if it is not there.
    fn make(&self) -> Result<(), Failure> {
        if !self.given.is_dir() {
            std::fs::create_dir(&self.given)
                .map_err(|e| Failure::bad_input(format_args!("--output {}", self.given.display()), e, "a folder"))?;
        }
        Ok(())
    }

    fn target(&self, name: &str) -> Result<Target, Failure> {
        Target::new("--output", &self.given.join(name))
    }
}

/// The numbers for a terminal, in the order in which they were asked for.
fn table(report: &Report) -> String {
    let rows = report.techniques.iter().map(|t| (t.name.as_str(), &t.metrics, t.frame_ms));
    let paths = reference::paths(report.reference.samples);
    let mut text = format!("{} against {paths}\n{}", report.scene, lines(rows));
    if !report.steps.is_empty() {
        text.push_str("\nwhere the error comes from: the picture with each step against that without it\n");
        text.push_str(&lines(report.steps.iter().map(|step| (step.name.as_str(), &step.metrics, None))));
    }
    text
}

/// One line for each picture, aligned.
fn lines<'a>(rows: impl Iterator<Item = (&'a str, &'a Metrics, Option<f64>)>) -> String {
    let rows: Vec<_> = rows.collect();
    let width = rows.iter().map(|row| row.0.chars().count()).max().unwrap_or(0).max(9);
    let mut text = format!(
        "{:width$}  {:>6}  {:>8}  {:>6}  {:>8}  {:>6}  {:>9}\n",
        "technique", "FLIP", "HDR-FLIP", "SSIM", "rel.RMSE", "energy", "frame ms"
    );
    let number = |value: Option<f64>, digits: usize| match value {
        Some(v) if v.abs() < 1e6 => format!("{v:.digits$}"),
        Some(v) => format!("{v:.1e}"),
        None => "-".to_owned(),
    };
    for (name, m, frame_ms) in rows {
        text.push_str(&format!(
            "{name:width$}  {:>6}  {:>8}  {:>6}  {:>8}  {:>6}  {:>9}\n",
            number(Some(m.flip), 4),
            number(m.hdr_flip, 4),
            number(Some(m.ssim), 3),
            number(m.relative_rmse, 3),
            number(m.energy_ratio, 3),
            number(frame_ms, 0),
        ));
    }
    text
}
