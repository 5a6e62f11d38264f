//! `huygens info`: the driver, its limits and the tier in use; lists of scenes, settings and presets.

use std::fmt::Display;

use huygens::Settings;
use huygens::gl::Headless;
use huygens::scene::BUILTIN_NAMES;
use huygens::settings::{self, PRESETS};

use crate::cli::InfoArgs;
use crate::{Failure, print};

pub fn run(arguments: &InfoArgs) -> Result<(), Failure> {
    let mut parts = Vec::new();
    if arguments.scenes {
        parts.push(scenes());
    }
    if arguments.settings {
        parts.push(setting_list());
    }
    if arguments.presets {
        parts.push(presets()?);
    }
    // The lists need no driver; a device that is named is asked for its driver all the same.
    if parts.is_empty() || arguments.device.index.is_some() {
        parts.push(driver(arguments.device.index)?);
    }
    print(&parts.join("\n"))
}

/// The built-in scenes as the command line takes them.
pub fn scene_names() -> Vec<String> {
    BUILTIN_NAMES.iter().map(|(name, _)| format!("builtin:{name}")).collect()
}

fn scenes() -> String {
    let names = scene_names();
    let width = widest(&names);
    names.iter().zip(BUILTIN_NAMES).map(|(name, (_, about))| format!("{name:width$}  {about}\n")).collect()
}

/// Two lines for each setting, so that both the numbers and the meaning fit 120 columns.
fn setting_list() -> String {
    let defaults = Settings::default();
    let keys = settings::keys();
    let width = keys.iter().map(|key| key.name.len()).max().unwrap_or(0);
    let mut text = String::new();
    for key in keys {
        let default = defaults.get(&key.name).map_or_else(String::new, |value| plain(&value));
        let kind = key.kind.type_name();
        // What is allowed is the longest by far: at the end of the line it need not be padded.
        text.push_str(&format!("{:width$}  {kind:<7}  default {default:<11}  {}\n", key.name, key.kind));
        text.push_str(&format!("    {}\n", key.meaning));
    }
    text
}

fn presets() -> Result<String, Failure> {
    let (defaults, width) = (Settings::default(), widest(&PRESETS));
    let mut text = String::new();
    for name in PRESETS {
        let preset = Settings::preset(name)?;
        let differences: Vec<String> = settings::keys()
            .into_iter()
            .filter_map(|key| {
                let (value, default) = (preset.get(&key.name)?, defaults.get(&key.name)?);
                (value != default).then(|| format!("{} = {}", key.name, plain(&value)))
            })
            .collect();
        let differences = if differences.is_empty() { vec!["the default settings".to_owned()] } else { differences };
        // Three to a line fit 120 columns.
        for (i, line) in differences.chunks(3).enumerate() {
            let name = if i == 0 { name } else { "" };
            let comma = if (i + 1) * 3 < differences.len() { "," } else { "" };
            text.push_str(&format!("{name:width$}  {}{comma}\n", line.join(", ")));
        }
    }
    Ok(text)
}

fn driver(device: Option<usize>) -> Result<String, Failure> {
    let headless = Headless::new(device)?;
    let context = headless.context();
    let info = context.info();
    let yes_no = |yes| if yes { "yes" } else { "no" };
    let [viewport_width, viewport_height] = info.max_viewport;
    let rows: [(&str, &dyn Display); 10] = [
        ("Huygens", &env!("CARGO_PKG_VERSION")),
        ("Vendor", &info.vendor),
        ("Renderer", &info.renderer),
        ("Version", &info.version),
        ("GLSL", &info.glsl),
        ("Tier in use", &info.tier),
        ("Largest texture", &info.max_texture_size),
        ("Largest viewport", &format_args!("{viewport_width}x{viewport_height}").to_string()),
        ("Timer queries", &yes_no(info.timer_queries)),
        ("Compute shaders", &yes_no(info.compute)),
    ];
    let mut text: String = rows.iter().map(|(name, value)| format!("{name:<18}{value}\n")).collect();
    text.push_str(&format!("{:<18}{} bytes\n", "Uniform block", info.max_uniform_block));

    text.push_str("\nDevices (--device N; * in use)\n");
    match Headless::devices() {
        Ok(devices) => {
            // Without --device the library chooses; its choice is known by the name that the driver gives it.
            let by_name = devices.iter().find(|d| d.name == info.renderer);
            let only = devices.first().filter(|_| devices.len() == 1);
            let in_use = device.or(by_name.or(only).map(|d| d.index));
            for d in &devices {
                let mark = if in_use == Some(d.index) { '*' } else { ' ' };
                let kind = if d.software { "software" } else { "hardware" };
                text.push_str(&format!("{mark} {}  {kind}  {}\n", d.index, d.name));
            }
        }
        Err(error) => text.push_str(&format!("  the list is not available: {error}\n")),
    }
    Ok(text)
}

/// A TOML value as `--set` takes it: names need no quotes.
fn plain(value: &impl Display) -> String {
    value.to_string().trim_matches('"').to_owned()
}

fn widest<T: AsRef<str>>(names: &[T]) -> usize {
    names.iter().map(|name| name.as_ref().len()).max().unwrap_or(0)
}
