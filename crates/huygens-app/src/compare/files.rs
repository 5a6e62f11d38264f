//! One picture file against another.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::Context;
use exr::meta::MetaData;
use exr::meta::attribute::AttributeValue;
use exr::prelude::{FlatSamples, ReadChannels, ReadLayers, read};
use serde::Serialize;

use super::{Folder, METRICS, Shot, exposure, lines, measure};
use crate::cli::CompareArgs;
use crate::metrics::{self, Metrics};
use crate::output::{self, Format, Target};
use crate::progress::Bar;
use crate::{Failure, input, print};

/// What an EXR file holds: every channel by its name, rows from the top.
pub struct Exr {
    pub size: [u32; 2],
    channels: BTreeMap<String, Vec<f32>>,
}

impl Exr {
    /// The channels R, G and B behind a prefix.
    pub fn layer(&self, prefix: &str) -> Option<Vec<[f32; 3]>> {
        let [r, g, b] = ["R", "G", "B"].map(|name| self.channels.get(&format!("{prefix}{name}")));
        let (r, g, b) = (r?, g?, b?);
        Some((0..r.len()).map(|i| [r[i], g[i], b[i]]).collect())
    }
}

/// The heat map.
const FLIP: &str = "flip.png";

/// Two pictures in `metrics.json`.
#[derive(Serialize)]
struct Report<'a> {
    picture: String,
    reference: String,
    size: [u32; 2],
    #[serde(flatten)]
    metrics: &'a Metrics,
}

/// Whether a file's name is that of a picture.
pub fn is_picture(path: &Path) -> bool {
    Format::of(path).is_ok()
}

pub fn run(arguments: &CompareArgs) -> Result<(), Failure> {
    let (common, first) = (&arguments.common, Path::new(&arguments.common.scene));
    let Some(second) = &arguments.second else {
        return Err(Failure::bad_input(
            format_args!("compare {}", first.display()),
            "a picture is compared with a second one, and there is none",
            "two .exr or two .png files, or a scene",
        ));
    };
    let refuse = |path: &Path, problem: &dyn std::fmt::Display| {
        Failure::bad_input(path.display(), problem, "two .exr or two .png files of the same size")
    };
    let formats = [first, second].map(|path| Format::of(path).map_err(|_| refuse(path, &"it is no picture")));
    let [a, b] = formats;
    let format = a?;
    if format != b? {
        return Err(refuse(second, &"it has another format than the first picture"));
    }
    let folder = arguments.output.as_deref().map(Folder::new).transpose()?;
    let stats = common.stats.as_deref().map(|path| Target::new("--stats", path)).transpose()?;
    let planned = folder.as_ref().map(|folder| folder.planned([FLIP, METRICS].map(str::to_owned).into_iter()));
    let planned = planned.transpose()?.unwrap_or_default();
    let targets: Vec<&Target> = planned.iter().chain(&stats).collect();
    input::check_distinct(common, &targets)?;
    if let Some(target) = targets.iter().find(|target| target.is_same(second)) {
        return Err(Failure::bad_input(target, "it would replace a file that is read", "another file"));
    }

    let bar = Bar::new(common.quiet, "measuring");
    let (size, metrics, map) = match format {
        Format::Exr => {
            let [a, b] = [read_finite(first)?, read_finite(second)?];
            let size = same_size(second, a.size, b.size)?;
            let picture = |path, exr: &Exr| exr.layer("").ok_or_else(|| refuse(path, &"it has no channels R, G and B"));
            let (test, reference) = (picture(first, &a)?, picture(second, &b)?);
            let ev = exposure(common, &reference);
            let layers = (a.layer("indirect."), b.layer("indirect."));
            let (a, b) = if let (Some(a), Some(b)) = layers { (a, b) } else { (test.clone(), reference.clone()) };
            let (before, after) = (Shot { seen: reference, indirect: b }, Shot { seen: test, indirect: a });
            let (metrics, map, _) = measure(size, ev, &before, &after)?;
            (size, metrics, map)
        }
        Format::Png => {
            let [(a, shown), (b, expected)] = [read_png(first)?, read_png(second)?];
            let size = same_size(second, a, b)?;
            let map = metrics::flip(size, &expected, &shown)?;
            let metrics = Metrics {
                flip: metrics::mean(&map),
                hdr_flip: None,
                ssim: metrics::ssim(size, &expected, &shown),
                relative_rmse: None,
                energy_ratio: None,
            };
            (size, metrics, map)
        }
    };
    drop(bar);
    let (picture, reference) = (first.display().to_string(), second.display().to_string());
    let json = output::json(&Report { picture, reference, size, metrics: &metrics }).context(METRICS)?;
    let mut files = Vec::new();
    if let Some(folder) = folder {
        folder.make()?;
        files.push((folder.target(FLIP)?, output::encode_png(size[0], size[1], &metrics::heat_map(&map)?)?));
        files.push((folder.target(METRICS)?, json.clone()));
    }
    files.extend(stats.map(|stats| (stats, json)));
    output::write(&files)?;
    print(&lines(std::iter::once((first.display().to_string().as_str(), &metrics, None))))
}

fn same_size(path: &Path, a: [u32; 2], b: [u32; 2]) -> Result<[u32; 2], Failure> {
    if a == b {
        metrics::check_size(a).map_err(|e| Failure::bad_input(path.display(), e, metrics::LARGEST))?;
        return Ok(a);
    }
    let problem = format_args!("it has {}x{} pixels, the first picture {}x{}", b[0], b[1], a[0], a[1]).to_string();
    Err(Failure::bad_input(path.display(), problem, "pictures of the same size"))
}

fn read_png(path: &Path) -> Result<([u32; 2], Vec<[u8; 3]>), Failure> {
    let picture = image::ImageReader::open(path).map_err(anyhow::Error::from).and_then(|mut reader| {
        reader.set_format(image::ImageFormat::Png);
        Ok(reader.decode()?.to_rgb8())
    });
    let picture = picture.map_err(|e| Failure::bad_input(path.display(), e, "a PNG file"))?;
    Ok(([picture.width(), picture.height()], picture.into_raw().as_chunks::<3>().0.to_vec()))
}

/// A picture without NaN and infinity in the channels that count.
fn read_finite(path: &Path) -> Result<Exr, Failure> {
    let exr = read_exr(path).map_err(|e| Failure::bad_input(path.display(), e, "an OpenEXR file"))?;
    for prefix in ["", "indirect."] {
        let layer = exr.layer(prefix).unwrap_or_default();
        if let Some(at) = layer.iter().position(|pixel| pixel.iter().any(|v| !v.is_finite())) {
            let (x, y) = (at as u32 % exr.size[0], at as u32 / exr.size[0]);
            let problem = format_args!("pixel {x}, {y} is not a finite number").to_string();
            return Err(Failure::bad_input(path.display(), problem, "finite numbers"));
        }
    }
    Ok(exr)
}

/// A text attribute of the first layer of an EXR file.
pub fn attribute(path: &Path, name: &str) -> Option<String> {
    let headers = MetaData::read_from_file(path, false).ok()?.headers;
    let found = headers.first()?.own_attributes.other.iter().find(|(found, _)| **found == *name)?;
    if let AttributeValue::Text(text) = found.1 { Some(text.to_string()) } else { None }
}

/// The first layer of an EXR file.
pub fn read_exr(path: &Path) -> anyhow::Result<Exr> {
    // The reader takes memory for whatever a file says of itself.
    for header in MetaData::read_from_file(path, false)?.headers {
        let [width, height] = [header.layer_size.x(), header.layer_size.y()];
        let size = [width, height].map(|n| u32::try_from(n).unwrap_or(u32::MAX));
        metrics::check_size(size).map_err(anyhow::Error::msg)?;
        anyhow::ensure!(header.channels.list.len() <= 64, "it has more than 64 channels");
    }
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_file(path)?;
    let layer = image.layer_data;
    let channels = layer.channel_data.list.into_iter().map(|channel| {
        let samples = match channel.sample_data {
            FlatSamples::F32(samples) => samples,
            FlatSamples::F16(samples) => samples.into_iter().map(|v| v.to_f32()).collect(),
            FlatSamples::U32(samples) => samples.into_iter().map(|v| v as f32).collect(),
        };
        (channel.name.to_string(), samples)
    });
    let size = [layer.size.x() as u32, layer.size.y() as u32];
    Ok(Exr { size, channels: channels.collect() })
}
