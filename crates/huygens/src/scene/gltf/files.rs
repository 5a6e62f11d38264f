//! Bytes of a glTF file: the .glb container, buffers and images inside the file and beside it.
//!
//! A file may name only files below its own folder, so that looking at a stranger's model reads nothing else.

use std::fs::{self, File};
use std::io::Read;
use std::path::{Component, Path, PathBuf};

use super::Problem;

/// Largest single file, and largest sum of all files beside the first, bytes.
const MAX_FILE: u64 = 2 << 30;
const MAX_TOTAL: u64 = 4 << 30;

/// Reads the file itself.
pub(super) fn read_main(path: &Path) -> Problem<Vec<u8>> {
    let bytes = read(path, "a .gltf or .glb file that exists and may be read")?;
    match bytes.is_empty() {
        true => Err("the file is empty; allowed: glTF 2.0, .gltf or .glb".to_owned()),
        false => Ok(bytes),
    }
}

fn read(path: &Path, allowed: &str) -> Problem<Vec<u8>> {
    let unreadable = |e| format!("cannot be read: {e}; allowed: {allowed}");
    // The kind is asked before opening: opening a pipe would wait for a writer.
    let meta = fs::metadata(path).map_err(unreadable)?;
    if meta.is_dir() {
        return Err("is a directory; allowed: a file".to_owned());
    }
    if !meta.is_file() {
        return Err("is not a regular file; allowed: a file".to_owned());
    }
    if meta.len() > MAX_FILE {
        return Err(format!("is too large, {} bytes; allowed: at most {MAX_FILE}", meta.len()));
    }
    let mut bytes = Vec::new();
    bytes
        .try_reserve_exact(meta.len() as usize)
        .map_err(|e| format!("is too large for the memory: {e}; allowed: what fits into it"))?;
    let file = File::open(path).map_err(unreadable)?;
    file.take(MAX_FILE).read_to_end(&mut bytes).map_err(unreadable)?;
    Ok(bytes)
}

/// Splits a .glb into JSON and the binary chunk; a .gltf is JSON as a whole.
pub(super) fn split(bytes: &[u8]) -> Problem<(&[u8], Option<&[u8]>)> {
    if !bytes.starts_with(b"glTF") {
        // A byte order mark is against the specification, but harmless.
        return Ok((bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes), None));
    }
    let truncated = || "truncated .glb: the file ends early; allowed: as long as its header says".to_owned();
    let word = |at: usize| -> Problem<u32> {
        let word = bytes.get(at..at + 4).and_then(|w| w.try_into().ok()).ok_or_else(truncated)?;
        Ok(u32::from_le_bytes(word))
    };
    let version = word(4)?;
    if version != 2 {
        return Err(format!("glTF version {version} in the .glb header; allowed: 2"));
    }
    let length = word(8)? as usize;
    if length > bytes.len() || length < 12 {
        return Err(format!(
            "truncated .glb: its header says {length} bytes, the file has {}; allowed: the same",
            bytes.len()
        ));
    }
    let (mut at, mut json, mut bin) = (12, None, None);
    while at < length {
        let (size, kind) = (word(at)? as usize, word(at + 4)?);
        let chunk = bytes[..length].get(at + 8..).and_then(|rest| rest.get(..size)).ok_or_else(truncated)?;
        match (&kind.to_le_bytes(), json, bin) {
            (b"JSON", None, _) => json = Some(chunk),
            (b"BIN\0", Some(_), None) => bin = Some(chunk),
            // The specification has other chunks ignored.
            _ => {}
        }
        at += 8 + size;
    }
    Ok((json.ok_or("the .glb has no JSON chunk; allowed: one, first")?, bin))
}

/// Resolves the URIs of a file.
pub(super) struct Files {
    folder: PathBuf,
    read: u64,
    /// What was read, with links resolved.
    pub(super) opened: Vec<PathBuf>,
}

impl Files {
    pub(super) fn new(path: &Path) -> Problem<Self> {
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        Ok(Self {
            folder: folder
                .canonicalize()
                .map_err(|e| format!("its folder cannot be read: {e}; allowed: one that exists"))?,
            read: 0,
            opened: Vec::new(),
        })
    }

    /// The bytes behind a URI: `data:` or a file below the folder.
    pub(super) fn fetch(&mut self, uri: &str) -> Problem<Vec<u8>> {
        let short = shorten(uri);
        let with_uri = |problem: String| format!("URI `{short}`: {problem}");
        if let Some(data) = strip_prefix_ignoring_case(uri, "data:") {
            let (head, body) = data
                .split_once(',')
                .ok_or_else(|| with_uri("a data URI without a comma; allowed: data:…;base64,…".to_owned()))?;
            if !head.to_ascii_lowercase().ends_with(";base64") {
                return Err(with_uri("a data URI that is not base64; allowed: base64".to_owned()));
            }
            return base64(body).ok_or_else(|| with_uri("broken base64; allowed: A–Z a–z 0–9 + / =".to_owned()));
        }
        let path = self.path_of(uri).map_err(with_uri)?;
        self.read += fs::metadata(&path).map_or(0, |meta| meta.len());
        if self.read > MAX_TOTAL {
            return Err(with_uri(format!("files beside it are too large together; allowed: {MAX_TOTAL} bytes")));
        }
        let bytes = read(&path, "a file that exists and may be read").map_err(with_uri)?;
        self.opened.push(path);
        Ok(bytes)
    }

    fn path_of(&self, uri: &str) -> Problem<PathBuf> {
        const ALLOWED: &str = "allowed: data: URIs and relative paths below the file's folder";
        if let Some((scheme, _)) = uri.split_once(':')
            && scheme.starts_with(|c: char| c.is_ascii_alphabetic())
            && scheme.chars().all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c))
        {
            return Err(format!("the scheme or drive `{}:` is refused; {ALLOWED}", shorten(scheme)));
        }
        let relative = percent_decoded(uri).ok_or("is not UTF-8 when decoded; allowed: UTF-8")?;
        if relative.is_empty() || relative.contains('\0') {
            return Err(format!("is not a file name; {ALLOWED}"));
        }
        // First by the letters, so that nothing outside is even looked up …
        let mut depth = 0_i32;
        for component in Path::new(&relative).components() {
            match component {
                Component::Normal(_) => depth += 1,
                Component::CurDir => {}
                Component::ParentDir => depth -= 1,
                Component::RootDir | Component::Prefix(_) => return Err(format!("an absolute path; {ALLOWED}")),
            }
            if depth < 0 {
                return Err(format!("leaves the file's folder; {ALLOWED}"));
            }
        }
        // … then where it really leads: a link may lead out.
        let path = self.folder.join(&relative).canonicalize().map_err(|e| format!("cannot be read: {e}; {ALLOWED}"))?;
        match path.starts_with(&self.folder) {
            true => Ok(path),
            false => Err(format!("leaves the file's folder through a link; {ALLOWED}")),
        }
    }
}

/// At most 80 characters of a text, for messages.
pub(super) fn shorten(text: &str) -> String {
    match text.char_indices().nth(80) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_owned(),
    }
}

fn strip_prefix_ignoring_case<'a>(text: &'a str, prefix: &str) -> Option<&'a str> {
    let head = text.get(..prefix.len())?;
    head.eq_ignore_ascii_case(prefix).then(|| &text[prefix.len()..])
}

/// Decodes `%xx`; a percent sign that starts none stays (files named by hand have them).
fn percent_decoded(text: &str) -> Option<String> {
    let bytes = text.as_bytes();
    let (mut out, mut i) = (Vec::with_capacity(bytes.len()), 0);
    while i < bytes.len() {
        let digit = |at: usize| bytes.get(at).and_then(|&b| char::from(b).to_digit(16));
        match (bytes[i], digit(i + 1), digit(i + 2)) {
            (b'%', Some(high), Some(low)) => {
                out.push((high * 16 + low) as u8);
                i += 3;
            }
            (byte, ..) => {
                out.push(byte);
                i += 1;
            }
        }
    }
    String::from_utf8(out).ok()
}

fn base64(text: &str) -> Option<Vec<u8>> {
    let text = text.trim_ascii_end().trim_end_matches('=');
    let mut out = Vec::with_capacity(text.len() / 4 * 3 + 3);
    let (mut bits, mut count) = (0_u32, 0);
    for byte in text.bytes() {
        let value = match byte {
            b'A'..=b'Z' => byte - b'A',
            b'a'..=b'z' => byte - b'a' + 26,
            b'0'..=b'9' => byte - b'0' + 52,
            b'+' | b'-' => 62,
            b'/' | b'_' => 63,
            _ => return None,
        };
        bits = bits << 6 | u32::from(value);
        count += 6;
        if count >= 8 {
            count -= 8;
            out.push((bits >> count) as u8);
        }
    }
    // One letter alone holds no byte.
    (text.len() % 4 != 1).then_some(out)
}
