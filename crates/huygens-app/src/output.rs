//! Files that are written whole or not at all.
//!
//! A [`Target`] is checked before anything is rendered. [`write()`] puts the bytes of every file beside its target
//! first and renames last, so that neither a full disk nor an interrupt leaves half a file, or one without the other.

use std::borrow::Borrow;
use std::io::{Cursor, ErrorKind, Write};
use std::path::{Path, PathBuf};

use anyhow::Context;
use exr::meta::attribute::AttributeValue;
use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer as ExrLayer, LayerAttributes, Text, WritableImage,
};
use huygens::{Layer, Rendered};

use crate::{Failure, interrupt};

/// Format of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Tone mapped, 8-bit sRGB.
    Png,
    /// Linear, 32-bit float.
    Exr,
}

impl Format {
    /// The format that the ending of a file's name asks for, in upper or lower case.
    pub fn of(path: &Path) -> Result<Self, Failure> {
        match path.extension().map(|e| e.to_ascii_lowercase()) {
            Some(ending) if ending == "png" => Ok(Self::Png),
            Some(ending) if ending == "exr" => Ok(Self::Exr),
            _ => Err(Failure::bad_input(
                format_args!("--output {}", path.display()),
                "its ending names no format that is written",
                ".png, .exr",
            )),
        }
    }

    /// The file's bytes.
    pub fn encode(self, rendered: &Rendered, layer: Layer) -> Result<Vec<u8>, Failure> {
        match self {
            Self::Png => {
                let rgb: Vec<[u8; 3]> = rendered.display.iter().map(|&[r, g, b, _]| [r, g, b]).collect();
                encode_png(rendered.width, rendered.height, &rgb).context("PNG")
            }
            Self::Exr => encode_exr(rendered, layer).context("EXR"),
        }
        .map_err(Failure::from)
    }
}

/// 8-bit sRGB, rows from the top.
pub fn encode_png(width: u32, height: u32, rgb: &[[u8; 3]]) -> anyhow::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(rgb.as_flattened())?;
    writer.finish()?;
    Ok(bytes)
}

/// Depth has the one channel `Z`, by the convention of the format; everything else R, G and B.
fn encode_exr(rendered: &Rendered, layer: Layer) -> anyhow::Result<Vec<u8>> {
    let size = [rendered.width, rendered.height];
    let names: &[&str] = if layer == Layer::Depth { &["Z"] } else { &["R", "G", "B"] };
    let channels = names.iter().enumerate().map(|(c, name)| ((*name).to_owned(), channel(&rendered.linear, c)));
    encode_channels(size, channels.collect(), None)
}

/// One channel of a picture.
fn channel(linear: &[[f32; 3]], channel: usize) -> Vec<f32> {
    linear.iter().map(|pixel| pixel[channel]).collect()
}

/// A picture in R, G and B, and others beside it in `NAME.R`, `NAME.G` and `NAME.B`; an attribute's name and value.
pub fn encode_layers(
    size: [u32; 2],
    main: &[[f32; 3]],
    others: &[(&str, &[[f32; 3]])],
    attribute: Option<(&str, &str)>,
) -> anyhow::Result<Vec<u8>> {
    let mut channels = Vec::new();
    for (prefix, linear) in
        std::iter::once((String::new(), main)).chain(others.iter().map(|(name, linear)| (format!("{name}."), *linear)))
    {
        for (c, name) in ["R", "G", "B"].into_iter().enumerate() {
            channels.push((format!("{prefix}{name}"), channel(linear, c)));
        }
    }
    encode_channels(size, channels, attribute)
}

fn encode_channels(
    size: [u32; 2],
    channels: Vec<(String, Vec<f32>)>,
    attribute: Option<(&str, &str)>,
) -> anyhow::Result<Vec<u8>> {
    let mut attributes = LayerAttributes {
        software_name: Text::new_or_none(concat!("huygens ", env!("CARGO_PKG_VERSION"))),
        ..LayerAttributes::default()
    };
    if let Some((name, value)) = attribute {
        let [name, value] = [name, value].map(|text| Text::new_or_none(text).context("an attribute"));
        attributes.other.insert(name?, AttributeValue::Text(value?));
    }
    let channels = channels.into_iter().map(|(name, samples)| {
        let name = Text::new_or_none(&name).context("a channel's name")?;
        Ok(AnyChannel::new(name, FlatSamples::F32(samples)))
    });
    let channels = AnyChannels::sort(channels.collect::<anyhow::Result<_>>()?);
    let size = (size[0] as usize, size[1] as usize);
    let mut bytes = Cursor::new(Vec::new());
    Image::from_layer(ExrLayer::new(size, attributes, Encoding::SMALL_LOSSLESS, channels))
        .write()
        .to_buffered(&mut bytes)?;
    Ok(bytes.into_inner())
}

/// A JSON file's bytes.
pub fn json(value: &impl serde::Serialize) -> anyhow::Result<Vec<u8>> {
    let mut bytes = serde_json::to_vec_pretty(value)?;
    bytes.push(b'\n');
    Ok(bytes)
}

/// A file that can be written, as far as can be told beforehand.
#[derive(Debug)]
pub struct Target {
    /// The name that the caller gave, for messages.
    pub given: PathBuf,
    /// The argument that names it, for messages.
    pub flag: &'static str,
    folder: PathBuf,
    file: PathBuf,
}

impl Target {
    /// Checks that the folder exists and takes files and that the target itself may be replaced. `flag` is for
    /// messages. Leaves nothing behind.
    pub fn new(flag: &'static str, given: &Path) -> Result<Self, Failure> {
        let refuse = |problem: &dyn std::fmt::Display, allowed| {
            Failure::bad_input(format_args!("{flag} {}", given.display()), problem, allowed)
        };
        let allowed_file = "a file that is new or may be replaced";
        // What a link points to is replaced, not the link.
        let path = match std::fs::metadata(given) {
            Ok(there) if there.is_dir() => return Err(refuse(&"it is a folder", allowed_file)),
            Ok(there) if !there.is_file() => return Err(refuse(&"it is not a regular file", allowed_file)),
            Ok(there) if there.permissions().readonly() => {
                return Err(refuse(&"it is write-protected", allowed_file));
            }
            // A stream that goes to a file is no file to be replaced.
            Ok(_) if ["/dev", "/proc"].iter().any(|system| given.starts_with(system)) => {
                return Err(refuse(&"it is not a regular file", allowed_file));
            }
            Ok(_) => given.canonicalize().map_err(|e| refuse(&e, allowed_file))?,
            Err(e) if e.kind() == ErrorKind::NotFound && given.is_symlink() => {
                return Err(refuse(&"it is a link to a file that does not exist", allowed_file));
            }
            Err(e) if e.kind() == ErrorKind::NotFound => given.to_owned(),
            // A file where a folder should be; the check of the folder has the better words.
            Err(e) if e.kind() == ErrorKind::NotADirectory => given.to_owned(),
            Err(e) => return Err(refuse(&e, allowed_file)),
        };
        let ends_in_separator = given.as_os_str().as_encoded_bytes().last().is_some_and(|&b| b == b'/');
        let name = path.file_name().filter(|_| !ends_in_separator);
        let name = name.ok_or_else(|| refuse(&"it names a folder", allowed_file))?;
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let folder = match folder.canonicalize() {
            Ok(folder) if folder.is_dir() => folder,
            Ok(_) => return Err(refuse(&"the folder before it is a file", "a folder that exists")),
            Err(e) if e.kind() == ErrorKind::NotFound => {
                return Err(refuse(&"its folder does not exist", "a folder that exists"));
            }
            Err(e) => return Err(refuse(&format_args!("its folder: {e}"), "a folder that exists")),
        };
        // This file has no name where the system can do that (Linux), so that not even a kill leaves it.
        tempfile::tempfile_in(&folder)
            .map_err(|e| refuse(&format_args!("its folder takes no files: {e}"), "a folder that may be written to"))?;
        let file = folder.join(name);
        Ok(Self { given: given.to_owned(), flag, folder, file })
    }

    /// Whether both name the same file.
    pub fn is_same(&self, path: &Path) -> bool {
        path.canonicalize().is_ok_and(|path| path == self.file)
    }

    /// Whether both name the same file, which need not exist.
    pub fn is_same_target(&self, other: &Target) -> bool {
        self.file == other.file
    }
}

impl std::fmt::Display for Target {
    /// The flag and the name, as messages begin.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} {}", self.flag, self.given.display())
    }
}

/// Writes the files. No name is touched before all bytes of all files are on the disk.
pub fn write<T: Borrow<Target>>(files: &[(T, Vec<u8>)]) -> Result<(), Failure> {
    interrupt::writing(|| write_all(files))
}

fn write_all<T: Borrow<Target>>(files: &[(T, Vec<u8>)]) -> Result<(), Failure> {
    let mut prepared = Vec::new();
    for (target, bytes) in files {
        let target = target.borrow();
        let mut builder = tempfile::Builder::new();
        builder.prefix(".huygens-");
        // tempfile would keep the file from everyone else; ask for what any new file has: 0666 less the umask.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        let written = builder.tempfile_in(&target.folder).and_then(|mut file| {
            // Errors of the other `write_all` name the file, which nobody knows of.
            file.as_file_mut().write_all(bytes)?;
            file.as_file().sync_all()?;
            Ok(file)
        });
        let file = written.with_context(|| target.to_string())?;
        prepared.push((target, file));
    }
    for (target, file) in prepared {
        file.persist(&target.file).map_err(|e| e.error).with_context(|| target.to_string())?;
    }
    Ok(())
}
