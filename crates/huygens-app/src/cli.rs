//! The arguments, and what is said when they are wrong.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::ops::RangeInclusive;
use std::path::PathBuf;

use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::error::{ContextKind, ErrorKind};
use clap::parser::ValueSource;
use clap::{ArgMatches, Args, CommandFactory, FromArgMatches, Parser, Subcommand};
use glam::Vec3;
use huygens::settings::PRESETS;
use huygens::{Exposure, Layer};

use crate::bench::Moving;
use crate::compare::TECHNIQUES;
use crate::input::Changes;
use crate::{Failure, say};

/// Where `huygens` without arguments puts its picture.
const DEFAULT_OUTPUT: &str = "huygens.png";

/// Real-time global illumination from a lattice of virtual point lights.
///
/// Without a command: opens the viewer on the built-in scene `cornell`, or without a display renders it to huygens.png.
#[derive(Debug, Parser)]
#[command(name = "huygens", version, disable_help_subcommand = true)]
struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
}

#[derive(Debug, Subcommand)]
pub enum Command {
    /// Open a window in which a scene can be seen, moved and changed
    View(Box<ViewArgs>),
    /// Render a scene to a PNG or EXR file
    Render(Box<RenderArgs>),
    /// Trace paths through a scene on the CPU: what the techniques are measured against
    Reference(Box<ReferenceArgs>),
    /// Measure techniques against the path tracer on a scene, or one picture against another
    Compare(Box<CompareArgs>),
    /// Measure what frames cost and how far they are from the exact gather
    Bench(Box<BenchArgs>),
    /// Show the driver, its limits and the tier in use; or list scenes, settings, presets
    Info(InfoArgs),
}

/// What every command that makes pictures takes.
#[derive(Args, Debug)]
pub struct Common {
    /// A built-in scene (`huygens info --scenes` lists them) or a .gltf/.glb file
    #[arg(value_name = "SCENE", default_value = "builtin:cornell")]
    pub scene: OsString,

    /// Width and height in pixels, 1 to 16384 each; `view`: of the window, in points
    #[arg(long, value_name = "WxH", default_value = "1280x720", value_parser = parse_size, allow_hyphen_values = true)]
    pub size: [u32; 2],

    /// Settings to start from (`huygens info --presets` tells them apart)
    #[arg(long, value_name = "NAME", default_value = "exact", value_parser = PossibleValuesParser::new(PRESETS))]
    pub preset: String,

    /// TOML file of settings; it overrides the preset
    #[arg(long, value_name = "FILE.toml")]
    pub config: Option<PathBuf>,

    /// One setting (`huygens info --settings` lists them); overrides preset and config; repeatable
    #[arg(long = "set", value_name = "KEY=VALUE", value_parser = parse_assignment, allow_hyphen_values = true)]
    pub set: Vec<(String, String)>,

    /// Camera of the file, by index from 0 or by name; the first unless given
    #[arg(long, value_name = "INDEX|NAME", allow_negative_numbers = true)]
    pub camera: Option<String>,

    /// Position of the camera in metres, in place of the chosen camera's; the direction of sight stays
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_position, allow_hyphen_values = true)]
    pub eye: Option<Vec3>,

    /// Point in metres that the camera looks at, y up, in place of the chosen camera's direction of sight
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_position, allow_hyphen_values = true)]
    pub target: Option<Vec3>,

    /// Vertical field of view in degrees, 1 to 170, in place of the chosen camera's
    #[arg(long, value_name = "DEG", value_parser = parse_fov, allow_hyphen_values = true)]
    pub fov: Option<f32>,

    /// Height in metres that an orthographic camera sees, in place of the chosen camera's
    #[arg(long, value_name = "M", value_parser = parse_height, allow_hyphen_values = true)]
    pub view_height: Option<f32>,

    /// Seed of every random choice, 0 to 4294967295
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = whole(0..=u32::MAX), allow_hyphen_values = true)]
    pub seed: u32,

    /// Frames to average, 1 to 65536; or numbered pictures from A up to and without B, 0 to 10000
    ///
    /// `render --frames A..B` writes one picture for each frame k, A to B - 1 (A..=B: B too), of the scene at k / FPS
    /// seconds. Their names are that of the output with `-` and k, in four digits, before the ending:
    /// `-o out.png` gives out-0000.png, out-0001.png ….
    #[arg(long, value_name = "N|A..B", default_value = "1", value_parser = parse_frames, allow_hyphen_values = true,
        verbatim_doc_comment)]
    pub frames: Frames,

    /// Seconds that the scene's animations have played, 0 to 1000000; it is at rest unless given
    #[arg(long, value_name = "T", value_parser = parse_time, allow_hyphen_values = true)]
    pub time: Option<f64>,

    /// The one animation of the file that plays, by index from 0 or by name
    ///
    /// Unless given, the first plays, and with it all others that move something else.
    #[arg(long, value_name = "INDEX|NAME", allow_negative_numbers = true)]
    pub animation: Option<String>,

    /// Turn the strongest light about the vertical axis through the scene's centre, degrees in a second
    #[arg(long, value_name = "DEG", value_parser = parse_orbit, allow_hyphen_values = true)]
    pub light_orbit: Option<f64>,

    /// Place of the strongest light in metres, in place of the scene's; or off
    #[arg(long, value_name = "X,Y,Z|off", value_parser = parse_place, allow_hyphen_values = true)]
    pub light: Option<Place>,

    /// Direction that the strongest light faces, in place of the scene's
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_direction, allow_hyphen_values = true)]
    pub light_axis: Option<Vec3>,

    /// Move an object by so many metres, by its number in the viewer, from 0; repeatable
    #[arg(long = "move", value_name = "N:X,Y,Z", value_parser = parse_move, allow_hyphen_values = true)]
    pub moves: Vec<(usize, Vec3)>,

    /// What the picture shows
    #[arg(long, value_name = "NAME", default_value = Layer::Final.name(), value_parser = layer_parser())]
    pub layer: Layer,

    /// Brightness of a PNG: radiance times 2 to the power EV, -64 to 64, or from the picture's mean
    #[arg(long, value_name = "auto|EV", default_value = "auto", value_parser = parse_exposure,
        allow_hyphen_values = true)]
    pub exposure: Exposure,

    /// Write numbers about the render to this file, as JSON
    #[arg(long, value_name = "FILE.json")]
    pub stats: Option<PathBuf>,

    #[command(flatten)]
    pub device: DeviceArgs,

    /// Show no progress
    #[arg(short, long)]
    pub quiet: bool,
}

impl Common {
    /// What stands elsewhere than the scene has it.
    pub fn changes(&self) -> Changes {
        let mut moves = BTreeMap::new();
        for &(instance, by) in &self.moves {
            *moves.entry(instance).or_insert(Vec3::ZERO) += by;
        }
        let (position, dark) = match self.light {
            Some(Place::At(position)) => (Some(position), false),
            Some(Place::Off) => (None, true),
            None => (None, false),
        };
        Changes { light: (position, self.light_axis), dark, moves }
    }
}

#[derive(Args, Debug)]
pub struct ViewArgs {
    #[command(flatten)]
    pub common: Common,
}

#[derive(Args, Debug)]
pub struct RenderArgs {
    #[command(flatten)]
    pub common: Common,

    /// File for the picture; its name ends in .png or .exr
    ///
    /// .png: 8-bit sRGB, exposed and tone mapped.
    /// .exr: linear 32-bit floats, no exposure, in the channels R, G and B: radiance in W/(m² sr), linear albedo, or
    /// the world-space normal, -1 to 1. With `--layer depth` the one channel Z: distance from the camera's plane in
    /// metres, 0 where there is no surface.
    /// A file that is there already is replaced at the end, in one step.
    #[arg(short, long, value_name = "OUT.png|OUT.exr", verbatim_doc_comment)]
    pub output: PathBuf,

    /// Frames in a second of `--frames A..B`, 1 to 240
    #[arg(long, value_name = "N", default_value_t = 30, value_parser = whole(1..=240), allow_hyphen_values = true)]
    pub fps: u32,
}

#[derive(Args, Debug)]
pub struct ReferenceArgs {
    #[command(flatten)]
    pub common: Common,

    /// File for the picture; its name ends in .exr or .png
    ///
    /// .exr: linear 32-bit floats, radiance in W/(m² sr): the layer that was asked for in R, G and B, and beside it
    /// direct.*, indirect.* and variance.* (of direct + indirect as an estimate).
    /// .png: 8-bit sRGB, exposed and tone mapped.
    /// A file that is there already is replaced at the end, in one step.
    #[arg(short, long, value_name = "OUT.exr|OUT.png", verbatim_doc_comment)]
    pub output: PathBuf,

    /// Paths for each pixel, 1 to 1048576; from 17 on rounded up to whole passes
    #[arg(long, value_name = "N", default_value_t = 256, value_parser = whole(1..=1 << 20), allow_hyphen_values = true)]
    pub spp: u32,

    /// Reflections from surface to surface that indirect light takes at most, 0 to 65535, or inf
    #[arg(long, value_name = "N|inf", default_value = "inf", value_parser = parse_bounces, allow_hyphen_values = true)]
    pub bounces: Bounces,
}

#[derive(Args, Debug)]
pub struct CompareArgs {
    #[command(flatten)]
    pub common: Common,

    /// A second picture: the first is compared with this one, the reference
    #[arg(value_name = "REFERENCE.exr|REFERENCE.png")]
    pub second: Option<PathBuf>,

    /// Folder for the pictures, metrics.json and report.html; made if it is not there
    ///
    /// A scene needs one. Files of the same names are replaced in the folder of an earlier comparison, known by its
    /// metrics.json, and refused in any other; anything else is left alone.
    #[arg(short, long, value_name = "DIR")]
    pub output: Option<PathBuf>,

    /// Techniques to compare, in order; all unless given
    #[arg(long, value_name = "A,B", value_delimiter = ',', value_parser = PossibleValuesParser::new(TECHNIQUES))]
    pub techniques: Option<Vec<String>>,

    /// One more technique: the settings with these changes; repeatable
    #[arg(long = "variant", value_name = "LABEL:KEY=VALUE,KEY=VALUE", value_parser = parse_variant)]
    pub variants: Vec<Variant>,

    /// Paths of the reference for each pixel, 1 to 1048576; from 17 on rounded up to whole passes
    #[arg(long, value_name = "N", default_value_t = 256, value_parser = whole(1..=1 << 20), allow_hyphen_values = true)]
    pub spp: u32,
}

#[derive(Args, Debug)]
pub struct BenchArgs {
    #[command(flatten)]
    pub common: Common,

    /// Presets to measure, in order
    #[arg(long, value_name = "A,B", value_delimiter = ',', default_value = "fast,balanced,quality",
        value_parser = PossibleValuesParser::new(PRESETS))]
    pub presets: Vec<String>,

    /// One more case: the settings of --preset, --config and --set with these changes; repeatable
    #[arg(long = "variant", value_name = "LABEL:KEY=VALUE,KEY=VALUE", value_parser = parse_variant)]
    pub variants: Vec<Variant>,

    /// Write the numbers to this file
    #[arg(long, value_name = "FILE.json")]
    pub json: Option<PathBuf>,

    /// What moves
    ///
    /// With the light or an object, FLIP to the exact gather has the difference between VPLs that follow and VPLs that are
    /// placed anew, too.
    #[arg(long, value_name = "A,B", value_delimiter = ',', default_value = "camera", value_enum)]
    pub moving: Vec<Moving>,

    /// Frames that are measured while something moves, 1 to 1000
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = whole(1..=1000), allow_hyphen_values = true)]
    pub runs: u32,

    /// Frames before those, 0 to 1000
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = whole(0..=1000), allow_hyphen_values = true)]
    pub warm_up: u32,

    /// Frames at rest after those, 1 to 4096
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = whole(1..=4096), allow_hyphen_values = true)]
    pub still: u32,

    /// Measure flicker too: 60 frames each in which the light, the camera and an object move, beside the exact gather's
    ///
    /// Means over pixels and channels (sRGB, 0 to 1) of how much the picture changes from frame to frame, how much the
    /// one of the exact gather does, and of the difference of the two changes. Every frame takes an exact one as well.
    #[arg(long)]
    pub motion: bool,

    /// Measure how cost grows with pixels, VPLs and triangles too, and plot it to this file
    ///
    /// Light and camera move. Of pixels and VPLs there are a quarter, as many, and four times as many; of triangles as
    /// many, four times and sixteen times as many.
    #[arg(long, value_name = "FILE.svg")]
    pub sweep: Option<PathBuf>,

    /// Hold so many frames a second for 60 more moving frames too, 0.01 to 1000
    ///
    /// A pixel sums as many VPLs in a frame as there is time for. What is left without the gather is not changed.
    #[arg(long, value_name = "N", value_parser = parse_fps, allow_hyphen_values = true)]
    pub target_fps: Option<f64>,

    /// Measure against the path tracer too, with so many paths for each pixel, 1 to 1048576
    #[arg(long, value_name = "N", value_parser = whole(1..=1 << 20), allow_hyphen_values = true)]
    pub spp: Option<u32>,
}

impl BenchArgs {
    /// Number of the last frame of the moving camera.
    pub fn last(&self) -> u32 {
        self.warm_up + self.runs - 1
    }
}

/// What `--frames` asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Frames {
    /// One picture, the mean of so many.
    Mean(u32),
    /// Pictures with numbers, up to and without `end`.
    Numbered { first: u32, end: u32 },
}

impl Frames {
    /// Frames that a picture is the mean of.
    pub fn averaged(self) -> u32 {
        match self {
            Self::Mean(count) => count,
            Self::Numbered { .. } => 1,
        }
    }
}

/// Where a light is put.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Place {
    /// There, m.
    At(Vec3),
    /// It gives no light.
    Off,
}

/// Bounces of indirect light; `None`: as many as it likes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bounces(pub Option<u32>);

/// A technique that the caller defines.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Variant {
    /// Its name in tables and files.
    pub label: String,
    /// Settings by their dotted names.
    pub set: Vec<(String, String)>,
}

#[derive(Args, Debug)]
pub struct InfoArgs {
    /// List the built-in scenes
    #[arg(long)]
    pub scenes: bool,

    /// List every setting: type, default, what is allowed, meaning
    #[arg(long)]
    pub settings: bool,

    /// List the presets and how each differs from the default
    #[arg(long)]
    pub presets: bool,

    #[command(flatten)]
    pub device: DeviceArgs,
}

#[derive(Args, Debug)]
pub struct DeviceArgs {
    /// Device to render on, by its index in `huygens info`; the library chooses unless given
    #[arg(long = "device", value_name = "N", value_parser = parse_device, allow_hyphen_values = true)]
    pub index: Option<usize>,
}

/// The command that was asked for; `None` where the answer (help, version) has been printed already.
pub fn parse() -> Result<Option<Command>, Failure> {
    let arguments: Vec<OsString> = std::env::args_os().collect();
    let parsed = command_line().try_get_matches_from(&arguments).and_then(|matches| {
        refuse_idle(&matches)?;
        Cli::from_arg_matches(&matches)
    });
    let parsed = parsed.and_then(|cli| match cli.command {
        Some(command) => Ok(command),
        None => parse_from(&["huygens", "view"]),
    });
    match parsed {
        Ok(command) => Ok(Some(command)),
        Err(error) if !error.use_stderr() => {
            // Help and version. A reader that closes the pipe early has read enough.
            let _ = error.print();
            Ok(None)
        }
        Err(error) => Err(Failure { status: 2, cause: anyhow::anyhow!(one_line(error, arguments.get(1))) }),
    }
}

/// What `huygens` without arguments does where no window can be opened.
pub fn without_window() -> Option<Command> {
    if std::env::args_os().len() > 1 {
        return None;
    }
    say("note", format_args!("no display to open a window on: rendering builtin:cornell to {DEFAULT_OUTPUT}"));
    parse_from(&["huygens", "render", "-o", DEFAULT_OUTPUT]).ok()
}

fn parse_from(arguments: &[&str]) -> Result<Command, clap::Error> {
    let cli = Cli::from_arg_matches(&command_line().try_get_matches_from(arguments)?)?;
    cli.command.ok_or_else(|| command_line().error(ErrorKind::MissingSubcommand, "no command"))
}

/// The arguments; some have another default in a window.
fn command_line() -> clap::Command {
    Cli::command().mut_subcommand("view", |view| view.mut_arg("preset", |preset| preset.default_value("balanced")))
}

/// Refuses what would have no influence: two pictures are compared as they are, frames are measured by their number, and
/// what plays needs a time.
fn refuse_idle(matches: &ArgMatches) -> Result<(), clap::Error> {
    const USED: [&str; 6] = ["scene", "second", "output", "exposure", "stats", "quiet"];
    const NOT_BENCHED: [&str; 3] = ["frames", "layer", "stats"];
    const NOT_VIEWED: [&str; 5] = ["frames", "stats", "index", "quiet", "light_orbit"];
    let Some((name, given)) = matches.subcommand() else { return Ok(()) };
    let command = command_line();
    let arguments = command.find_subcommand(name).into_iter().flat_map(clap::Command::get_arguments);
    let is_given =
        |id: &str| given.try_contains_id(id).is_ok() && given.value_source(id) == Some(ValueSource::CommandLine);
    let conflict = |message: &str| Err(clap::Error::raw(ErrorKind::ArgumentConflict, message));
    let frames = given.try_get_one::<Frames>("frames").ok().flatten();
    let numbered = matches!(frames, Some(Frames::Numbered { .. }));
    if !is_given("second") {
        if numbered && name != "render" {
            return conflict(
                "--frames A..B: only `render` writes numbered pictures; allowed: a whole number from 1 to 65536",
            );
        }
        if numbered && is_given("time") {
            return conflict(
                "--time has no influence on --frames A..B, which has its own times; allowed: one of the two",
            );
        }
        if !numbered && is_given("fps") {
            return conflict("--fps has no influence without --frames A..B; allowed: both");
        }
        let moving = [("animation", "--animation"), ("light_orbit", "--light-orbit")];
        if let Some((_, flag)) = moving.iter().find(|(id, _)| is_given(id) && !is_given("time") && !numbered) {
            let frames = if name == "render" { ", --frames A..B" } else { "" };
            return conflict(&format!("{flag} has no influence on a scene at rest; allowed: with --time{frames}"));
        }
    }
    // In a window it can be switched on.
    let off = given.try_get_one::<Place>("light").ok().flatten() == Some(&Place::Off) && name != "view";
    let of_light = [("light_axis", "--light-axis"), ("light_orbit", "--light-orbit")];
    if let Some((_, flag)) = of_light.iter().find(|(id, _)| off && is_given(id)) {
        return conflict(&format!("{flag} has no influence on a light that is off; allowed: without --light off"));
    }
    if !matches!(name, "compare" | "bench" | "view") {
        return Ok(());
    }
    let arguments = arguments.filter(|a| given.try_contains_id(a.get_id().as_str()).is_ok());
    let is_used = |id: &str| match name {
        "bench" => !NOT_BENCHED.contains(&id),
        "view" => !NOT_VIEWED.contains(&id),
        _ => USED.contains(&id),
    };
    let mut idle = arguments.filter(|a| !is_used(a.get_id().as_str()) && is_given(a.get_id().as_str()));
    match idle.next().and_then(clap::Arg::get_long) {
        Some(idle) if name == "bench" => {
            let message =
                format!("--{idle} has no influence on a benchmark; allowed: --runs, --warm-up, --still, --json");
            Err(clap::Error::raw(ErrorKind::ArgumentConflict, message))
        }
        Some(idle) if name == "view" => {
            let message = format!("--{idle} has no influence on a window; allowed: with `huygens render`");
            Err(clap::Error::raw(ErrorKind::ArgumentConflict, message))
        }
        Some(idle) if is_given("second") => {
            let message = format!(
                "--{idle} has no influence on the comparison of two pictures; allowed: --output, --stats, --exposure, --quiet"
            );
            Err(clap::Error::raw(ErrorKind::ArgumentConflict, message))
        }
        _ => Ok(()),
    }
}

/// clap's message, which takes several lines, as one that says what is allowed too.
fn one_line(mut error: clap::Error, command: Option<&OsString>) -> String {
    error.remove(ContextKind::Usage);
    let text = error.render().to_string();
    let end = text.rfind("\n\nFor more information");
    let mut line = String::new();
    for part in text[..end.unwrap_or(text.len())].trim_start_matches("error: ").lines().map(str::trim) {
        if !part.is_empty() {
            let joint = if line.is_empty() || line.ends_with(':') { " " } else { "; " };
            line.push_str(joint);
            match part.strip_prefix("[possible values: ").and_then(|rest| rest.strip_suffix(']')) {
                Some(values) => line.push_str(&format!("allowed: {values}")),
                None => line.push_str(part),
            }
        }
    }
    let cli = command_line();
    let subcommand = command.and_then(|name| name.to_str()).and_then(|name| cli.find_subcommand(name));
    let allowed: Vec<String> = match (error.kind(), subcommand) {
        (ErrorKind::UnknownArgument, Some(subcommand)) => subcommand.get_arguments().map(usage).collect(),
        (ErrorKind::UnknownArgument | ErrorKind::InvalidSubcommand, _) => cli
            .get_subcommands()
            .map(|c| c.get_name().to_owned())
            .chain(["--help".into(), "--version".into()])
            .collect(),
        (ErrorKind::InvalidUtf8, _) => vec!["UTF-8, except in the names of files".to_owned()],
        (ErrorKind::ArgumentConflict, _) if !line.contains("allowed:") => vec!["once each".to_owned()],
        // A value is missing: the help has what it may be.
        (ErrorKind::InvalidValue | ErrorKind::MissingRequiredArgument, Some(subcommand))
            if !line.contains("allowed:") =>
        {
            let concerned = |a: &&clap::Arg| a.get_long().is_some_and(|long| line.contains(&format!("--{long} ")));
            subcommand
                .get_arguments()
                .filter(concerned)
                .flat_map(|a| a.get_help())
                .map(|help| help.to_string())
                .collect()
        }
        _ => Vec::new(),
    };
    if !allowed.is_empty() {
        line.push_str(&format!("; allowed: {}", allowed.join(", ")));
    }
    line.trim().to_owned()
}

/// An argument as a list of arguments names it.
fn usage(argument: &clap::Arg) -> String {
    match (argument.get_long(), argument.get_value_names()) {
        (Some(long), _) => format!("--{long}"),
        (None, Some([name, ..])) => format!("one {name}"),
        (None, _) => argument.get_id().to_string(),
    }
}

fn layer_parser() -> impl TypedValueParser<Value = Layer> {
    PossibleValuesParser::new(Layer::ALL.map(Layer::name)).try_map(|name| Layer::from_name(&name))
}

fn parse_size(text: &str) -> Result<[u32; 2], String> {
    let side = |text: &str| text.parse().ok().filter(|n| (1..=16384).contains(n));
    text.split_once('x')
        .and_then(|(width, height)| Some([side(width)?, side(height)?]))
        .ok_or_else(|| "allowed: width x height such as 1280x720, 1 to 16384 each".to_owned())
}

fn parse_assignment(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((key, value)) => Ok((key.trim().to_owned(), value.trim().to_owned())),
        None => Err("allowed: key=value, with the keys of `huygens info --settings`".to_owned()),
    }
}

fn parse_point(text: &str) -> Result<Vec3, String> {
    let numbers: Option<Vec<f32>> = text.split(',').map(number).collect();
    match numbers.as_deref() {
        Some(&[x, y, z]) => Ok(Vec3::new(x, y, z)),
        _ => Err("allowed: three finite numbers such as -1,0.5,2".to_owned()),
    }
}

/// Where a scene may be: so far, m, numbers are finite whatever is done with them.
pub const FARTHEST: f32 = 1e12;

fn parse_metres(text: &str) -> Option<Vec3> {
    parse_point(text).ok().filter(|point| point.abs().max_element() <= FARTHEST)
}

fn parse_position(text: &str) -> Result<Vec3, String> {
    let allowed = || format!("allowed: three finite numbers such as -1,0.5,2, each from -{FARTHEST:e} to {FARTHEST:e}");
    parse_metres(text).ok_or_else(allowed)
}

fn parse_height(text: &str) -> Result<f32, String> {
    let height = number(text).filter(|height| (1e-6..=FARTHEST).contains(height));
    height.ok_or_else(|| format!("allowed: metres, 0.000001 to {FARTHEST:e}"))
}

fn parse_place(text: &str) -> Result<Place, String> {
    match text {
        "off" => Ok(Place::Off),
        _ => parse_metres(text).map(Place::At).ok_or_else(|| {
            format!("allowed: three numbers from -{FARTHEST:e} to {FARTHEST:e} such as -1,0.5,2, or off")
        }),
    }
}

fn parse_direction(text: &str) -> Result<Vec3, String> {
    let direction = parse_point(text)?.as_dvec3().try_normalize().map(|direction| direction.as_vec3());
    direction.ok_or_else(|| "allowed: three finite numbers that are not all 0".to_owned())
}

fn parse_move(text: &str) -> Result<(usize, Vec3), String> {
    let parts = text.split_once(':').and_then(|(number, by)| Some((number.parse().ok()?, parse_metres(by)?)));
    parts.ok_or_else(|| format!("allowed: a number and three from -{FARTHEST:e} to {FARTHEST:e} such as 2:0.5,0,-1"))
}

fn parse_fov(text: &str) -> Result<f32, String> {
    number(text).filter(|fov| (1.0..=170.0).contains(fov)).ok_or_else(|| "allowed: degrees, 1 to 170".to_owned())
}

fn parse_fps(text: &str) -> Result<f64, String> {
    let fps = number(text).map(f64::from).filter(|fps| (0.0099..=1000.0).contains(fps));
    fps.ok_or_else(|| "allowed: a number from 0.01 to 1000".to_owned())
}

fn parse_exposure(text: &str) -> Result<Exposure, String> {
    match number(text) {
        _ if text == "auto" => Ok(Exposure::Auto),
        Some(ev) if (-64.0..=64.0).contains(&ev) => Ok(Exposure::Ev(ev)),
        _ => Err("allowed: auto, or a number from -64 to 64".to_owned()),
    }
}

fn parse_frames(text: &str) -> Result<Frames, String> {
    let numbers = || {
        let (first, last) = text.split_once("..")?;
        let (last, more) = last.strip_prefix('=').map_or((last, 0), |last| (last, 1));
        let (first, end) = (first.parse().ok()?, last.parse::<u32>().ok()?.checked_add(more)?);
        (first < end && end <= 10_000).then_some(Frames::Numbered { first, end })
    };
    match text.parse() {
        Ok(count @ 1..=65536) => Ok(Frames::Mean(count)),
        _ => numbers().ok_or_else(|| {
            "allowed: a whole number from 1 to 65536, or A..B with 0 <= A < B <= 10000 such as 0..24".to_owned()
        }),
    }
}

/// Longest that animations may have played, s.
pub const MOST_SECONDS: f64 = 1e6;

fn parse_time(text: &str) -> Result<f64, String> {
    let time = text.trim().parse().ok().filter(|time| (0.0..=MOST_SECONDS).contains(time));
    time.ok_or_else(|| format!("allowed: seconds, 0 to {MOST_SECONDS}"))
}

fn parse_orbit(text: &str) -> Result<f64, String> {
    let degrees = text.trim().parse().ok().filter(|degrees| (-36000.0..=36000.0).contains(degrees));
    degrees.ok_or_else(|| "allowed: degrees in a second, -36000 to 36000".to_owned())
}

fn parse_bounces(text: &str) -> Result<Bounces, String> {
    match text.parse() {
        _ if text == "inf" => Ok(Bounces(None)),
        Ok(n) if n <= 65535 => Ok(Bounces(Some(n))),
        _ => Err("allowed: a whole number from 0 to 65535, or inf".to_owned()),
    }
}

fn parse_variant(text: &str) -> Result<Variant, String> {
    let refuse = || "allowed: LABEL:KEY=VALUE,KEY=VALUE; the label of up to 64 letters, digits, `-` and `_`".to_owned();
    let (label, set) = text.split_once(':').ok_or_else(refuse)?;
    // It names files.
    if label.is_empty() || label.len() > 64 || !label.chars().all(|c| c.is_ascii_alphanumeric() || c == '-' || c == '_')
    {
        return Err(refuse());
    }
    let set = set.split(',').map(parse_assignment).collect::<Result<_, _>>().map_err(|_| refuse())?;
    Ok(Variant { label: label.to_owned(), set })
}

fn parse_device(text: &str) -> Result<usize, String> {
    text.parse().map_err(|_| "allowed: an index that `huygens info` lists, from 0".to_owned())
}

fn whole(range: RangeInclusive<u32>) -> impl Fn(&str) -> Result<u32, String> + Clone + Send + Sync {
    move |text| match text.parse() {
        Ok(n) if range.contains(&n) => Ok(n),
        _ => Err(format!("allowed: a whole number from {} to {}", range.start(), range.end())),
    }
}

/// A number that f32 can hold; not infinity.
fn number(text: &str) -> Option<f32> {
    text.trim().parse().ok().filter(|x: &f32| x.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clap_finds_no_fault_with_the_arguments() {
        command_line().debug_assert();
    }

    #[test]
    fn numbers_outside_their_range_are_refused() {
        assert_eq!(parse_size("1x16384"), Ok([1, 16384]));
        for size in ["", "x", "0x1", "1x0", "16385x1", "1x1x1", "-1x1", "1.5x1", "1280", "4294967297x1"] {
            assert!(parse_size(size).is_err(), "{size}");
        }
        assert_eq!(parse_point("-1,2.5,3e1"), Ok(Vec3::new(-1.0, 2.5, 30.0)));
        for point in ["", "1,2", "1,2,3,4", "1,2,nan", "inf,0,0", "1e39,0,0", "1,,2", "a,b,c"] {
            assert!(parse_point(point).is_err(), "{point}");
        }
        assert!(parse_fov("1").is_ok() && parse_fov("170").is_ok());
        assert_eq!(parse_place("off"), Ok(Place::Off));
        assert_eq!(parse_direction("0,-2,0"), Ok(Vec3::NEG_Y));
        assert_eq!(parse_move("3:1,-2,0.5"), Ok((3, Vec3::new(1.0, -2.0, 0.5))));
        for text in ["", "on", "0,0", "0,0,0", "nan,0,1"] {
            assert!(parse_direction(text).is_err(), "{text}");
        }
        for text in ["", "on", "0,0", "1e13,0,0", "nan,0,1"] {
            assert!(parse_place(text).is_err(), "{text}");
        }
        for text in ["", "1:", "-1:0,0,0", "1:0,0", "1:inf,0,0", "1:0,-1e13,0", "0,0,0"] {
            assert!(parse_move(text).is_err(), "{text}");
        }
        assert_eq!(parse_height("2.5"), Ok(2.5));
        for text in ["0", "-1", "inf", ""] {
            assert!(parse_height(text).is_err(), "{text}");
        }
        for fov in ["0.9", "170.1", "nan", "-30", ""] {
            assert!(parse_fov(fov).is_err(), "{fov}");
        }
        assert_eq!(parse_frames("65536"), Ok(Frames::Mean(65536)));
        assert_eq!(parse_frames("0..10000"), Ok(Frames::Numbered { first: 0, end: 10000 }));
        assert_eq!(parse_frames("7..=7"), Ok(Frames::Numbered { first: 7, end: 8 }));
        for frames in ["", "0", "65537", "..", "1..", "..2", "2..2", "3..2", "0..10001", "0..=10000", "-1..2", "0...2"]
        {
            assert!(parse_frames(frames).is_err(), "{frames}");
        }
        assert_eq!((parse_time("1e6"), parse_orbit("-36000")), (Ok(1e6), Ok(-36000.0)));
        for bad in ["", "-1e9", "1e9", "nan", "inf", "1s"] {
            assert!(parse_time(bad).is_err() && parse_orbit(bad).is_err(), "{bad}");
        }
        assert_eq!(parse_exposure("-64"), Ok(Exposure::Ev(-64.0)));
        for exposure in ["Auto", "64.1", "-65", "inf", "nan", ""] {
            assert!(parse_exposure(exposure).is_err(), "{exposure}");
        }
    }
}
