//! The command line as its users meet it: exit status, messages, files.
//!
//! Every run starts in a folder of its own, so that what it leaves behind shows.

use std::collections::BTreeMap;
use std::ffi::{OsStr, OsString};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;

use assert_cmd::Command;
use tempfile::TempDir;

/// Two triangles across each other, three cameras: 0 `front` (3 m away), 1 `side` (4 m), 2 `flat` (orthographic).
const GLTF: &str = include_str!("data/two-triangles.gltf");

/// What renders in no time on a software driver.
const TINY: [&str; 8] =
    ["--size", "32x24", "--set", "wave.delta_theta=30", "--set", "wave.delta_phi=30", "--set", "visibility=none"];

struct Run {
    folder: TempDir,
}

impl Run {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("scene.gltf"), GLTF).unwrap();
        Self { folder }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn command(&self) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_huygens"));
        command.current_dir(self.folder.path());
        // No test opens a window.
        command.env_remove("DISPLAY").env_remove("WAYLAND_DISPLAY");
        command
    }

    fn run<A: AsRef<OsStr>>(&self, arguments: impl IntoIterator<Item = A>) -> Output {
        self.command().args(arguments).output().unwrap()
    }

    /// A render in next to no time, which must succeed.
    fn render(&self, arguments: &[&str]) -> Output {
        let output = self.run(["render"].iter().chain(&TINY).chain(arguments));
        assert_eq!(output.status.code(), Some(0), "{arguments:?}: {}", text(&output.stderr));
        output
    }

    /// What `--stats` says about a render.
    fn stats(&self, arguments: &[&str]) -> serde_json::Value {
        // Only the size from TINY: these runs are about the settings.
        let fixed = ["render", "--size", "16x12", "-o", "stats.png", "--stats", "stats.json"];
        let output = self.run(fixed.iter().chain(arguments));
        assert_eq!(output.status.code(), Some(0), "{arguments:?}: {}", text(&output.stderr));
        let json = fs::read_to_string(self.path("stats.json")).unwrap();
        assert!(json.ends_with("}\n"));
        serde_json::from_str(&json).unwrap()
    }

    /// Every file in the folder with its bytes.
    fn files(&self) -> BTreeMap<PathBuf, Vec<u8>> {
        let mut files = BTreeMap::new();
        let mut folders = vec![self.folder.path().to_owned()];
        while let Some(folder) = folders.pop() {
            for entry in fs::read_dir(folder).unwrap() {
                let path = entry.unwrap().path();
                if path.is_dir() && !path.is_symlink() {
                    folders.push(path.clone());
                    files.insert(path, Vec::new());
                } else {
                    let bytes = fs::read(&path).unwrap_or_default();
                    files.insert(path, bytes);
                }
            }
        }
        files
    }

    /// Asserts exit status 2, one line on stderr with all `words` in it, and a folder that is as it was.
    #[track_caller]
    fn refuses<A: AsRef<OsStr>>(&self, arguments: &[A], words: &[&str]) {
        let before = self.files();
        let output = self.run(arguments);
        let arguments: Vec<&OsStr> = arguments.iter().map(AsRef::as_ref).collect();
        let line = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {line}");
        assert_eq!(text(&output.stdout), "", "{arguments:?}");
        assert!(line.starts_with("huygens: error: ") && line.ends_with('\n'), "{arguments:?}: {line}");
        assert_eq!(line.lines().count(), 1, "{arguments:?}: {line}");
        for word in words {
            assert!(line.contains(word), "{arguments:?}: no `{word}` in: {line}");
        }
        let names = |files: &BTreeMap<PathBuf, Vec<u8>>| files.keys().cloned().collect::<Vec<_>>();
        let after = self.files();
        assert_eq!(names(&before), names(&after), "{arguments:?}");
        assert!(before == after, "{arguments:?} changed a file");
    }

    /// Like `refuses`, for `huygens render -o a.png` with further arguments.
    #[track_caller]
    fn render_refuses(&self, arguments: &[&str], words: &[&str]) {
        let arguments: Vec<&str> = ["render", "-o", "a.png"].iter().chain(arguments).copied().collect();
        self.refuses(&arguments, words);
    }
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).expect("messages are UTF-8")
}

/// Width, height and RGB bytes of a PNG that says it is sRGB.
fn read_png(path: &Path) -> (u32, u32, Vec<u8>) {
    let file = std::io::BufReader::new(fs::File::open(path).unwrap());
    let mut reader = png::Decoder::new(file).read_info().unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut bytes).unwrap();
    assert_eq!((info.color_type, info.bit_depth), (png::ColorType::Rgb, png::BitDepth::Eight));
    assert!(reader.info().srgb.is_some());
    (info.width, info.height, bytes)
}

/// Width, height and channels by name of an EXR of 32-bit floats.
fn read_exr(path: &Path) -> (usize, usize, BTreeMap<String, Vec<f32>>) {
    use exr::prelude::{FlatSamples, ReadChannels, ReadLayers, read};
    let reader = read().no_deep_data().largest_resolution_level().all_channels().first_valid_layer().all_attributes();
    let layer = reader.from_file(path).unwrap().layer_data;
    let channels = layer.channel_data.list.into_iter().map(|channel| {
        let FlatSamples::F32(values) = channel.sample_data else { panic!("{} is not f32", channel.name) };
        (channel.name.to_string(), values)
    });
    (layer.size.x(), layer.size.y(), channels.collect())
}

/// Depth at the middle of the picture and in its upper left corner, metres.
fn depth(run: &Run, arguments: &[&str]) -> [f32; 2] {
    let fixed = ["scene.gltf", "--layer", "depth", "-o", "depth.exr"];
    run.render(&fixed.iter().chain(arguments).copied().collect::<Vec<_>>());
    let (width, height, channels) = read_exr(&run.path("depth.exr"));
    assert_eq!(channels.keys().collect::<Vec<_>>(), ["Z"]);
    let z = &channels["Z"];
    assert_eq!(z.len(), width * height);
    [z[height / 2 * width + width / 2], z[0]]
}

#[track_caller]
fn near(a: f32, b: f32) {
    assert!((a - b).abs() < 0.01 * b.abs().max(1.0), "{a} is not {b}");
}

#[test]
fn help_and_version_go_to_stdout() {
    let run = Run::new();
    let version = run.run(["--version"]);
    assert_eq!(version.status.code(), Some(0));
    assert_eq!(text(&version.stdout), concat!("huygens ", env!("CARGO_PKG_VERSION"), "\n"));
    for (arguments, words) in [
        (&["--help"][..], &["render", "info"][..]),
        (&["-h"], &["render", "info"]),
        (&["render", "--help"], &["--preset", "--eye", "balanced", "indirect", "channel Z", "1 to 16384"]),
        (&["info", "--help"], &["--scenes", "--settings", "--presets", "--device"]),
    ] {
        let help = run.run(arguments);
        assert_eq!((help.status.code(), text(&help.stderr).as_str()), (Some(0), ""), "{arguments:?}");
        for word in words {
            assert!(text(&help.stdout).contains(word), "{arguments:?}: no {word}");
        }
        assert!(text(&help.stdout).lines().all(|line| line.chars().count() <= 120));
    }
}

#[test]
fn wrong_arguments_are_named_with_what_is_allowed() {
    let run = Run::new();
    run.refuses(&["paint"], &["paint", "render", "info"]);
    run.refuses(&["--size", "1x1"], &["--size", "render", "info"]);
    run.refuses(&["render"], &["--output", ".png", ".exr"]);
    run.refuses(&["render", "-o"], &["--output", ".png", ".exr"]);
    run.refuses(&["info", "--list"], &["--list", "--scenes", "--settings", "--presets"]);
    run.refuses(&["info", "--device", "-1"], &["--device", "-1", "from 0"]);
    let size = "1 to 16384";
    for (arguments, words) in [
        (&["--bounce"][..], &["--bounce", "--size", "--stats", "SCENE"][..]),
        (&["scene.gltf", "another.gltf"], &["another.gltf", "one SCENE"]),
        (&["--size", "0x10"], &["--size", "0x10", size]),
        (&["--size", "10x16385"], &["--size", "10x16385", size]),
        (&["--size", "-1x5"], &["--size", "-1x5", size]),
        (&["--size", "640"], &["--size", "640", size]),
        (&["--size"], &["--size", size]),
        (&["--size", "1x1", "--size", "2x2"], &["--size", "once"]),
        (&["--preset", "best"], &["--preset", "best", "thesis, wave, fast, balanced, quality, exact"]),
        (&["--layer", "light"], &["--layer", "light", "final, direct, indirect, albedo, normal, depth"]),
        (&["--exposure", "bright"], &["--exposure", "bright", "auto", "-64 to 64"]),
        (&["--exposure", "-65"], &["--exposure", "-65", "-64 to 64"]),
        (&["--exposure", "nan"], &["--exposure", "nan", "-64 to 64"]),
        (&["--exposure", "-inf"], &["--exposure", "-inf", "-64 to 64"]),
        (&["--fov", "0"], &["--fov", "1 to 170"]),
        (&["--view-height", "0"], &["--view-height", "0.000001"]),
        (&["--fov", "-30"], &["--fov", "-30", "1 to 170"]),
        (&["--fov", "180"], &["--fov", "180", "1 to 170"]),
        (&["--eye", "1,2"], &["--eye", "1,2", "three finite numbers"]),
        (&["--eye", "1,2e12,3"], &["--eye", "1,2e12,3", "from -1e12 to 1e12"]),
        (&["--eye", "-1,2,nan"], &["--eye", "-1,2,nan", "three finite numbers"]),
        (&["--target", "1,2,1e40"], &["--target", "1,2,1e40", "three finite numbers"]),
        (&["--eye", "--target", "1,2,3"], &["--eye", "three finite numbers"]),
        (&["--eye", "1,2,3", "--target", "1,2,3"], &["--target", "1,2,3", "a point away from the eye"]),
        (&["--seed", "-1"], &["--seed", "-1", "0 to 4294967295"]),
        (&["--seed", "4294967296"], &["--seed", "0 to 4294967295"]),
        (&["--frames", "0"], &["--frames", "1 to 65536"]),
        (&["--frames", "65537"], &["--frames", "1 to 65536"]),
        (&["--frames", "3..3"], &["--frames", "3..3", "A..B"]),
        (&["--frames", "0..2", "--time", "1"], &["--time", "--frames A..B", "one of the two"]),
        (&["--frames", "0..2", "--fps", "0"], &["--fps", "1 to 240"]),
        (&["--fps", "24"], &["--fps", "--frames A..B"]),
        (&["--time", "-1"], &["--time", "-1", "0 to 1000000"]),
        (&["--time", "nan"], &["--time", "0 to 1000000"]),
        (&["--time", "1", "--light-orbit", "1e9"], &["--light-orbit", "-36000 to 36000"]),
        (&["--light-orbit", "9"], &["--light-orbit", "--time"]),
        (&["--light", "off", "--light-axis", "0,-1,0"], &["--light-axis", "no influence", "--light off"]),
        (&["--light", "off", "--light-orbit", "9", "--time", "1"], &["--light-orbit", "no influence", "--light off"]),
        (&["--animation", "0"], &["--animation", "--time"]),
        (&["--time", "1", "--animation", "walk"], &["--animation walk", "no such animation", "allowed"]),
        (&["--device", "gpu"], &["--device", "gpu", "huygens info"]),
        (&["--set", "wave.shells"], &["--set", "wave.shells", "key=value"]),
        (&["--set", "wave.shells=99"], &["wave.shells", "99", "1 to 16"]),
        (
            &["--set", "reflected.rays=64", "--set", "wave.delta_theta=0.5", "--set", "wave.delta_phi=0.5"],
            &["reflected.rays", "64", "16777216"],
        ),
        (&["--set", "wave.sheels=5"], &["wave.sheels", "wave.shells"]),
        (&["--set", "=5"], &["setting", "wave.shells"]),
        (&["--set", "visibility=a\nb"], &["visibility", "none, ism, shadow_maps"]),
        (&["--layer", "a\nb"], &["--layer", "final, direct"]),
        (&["--layer", "a\n\nUsage:"], &["--layer", "final, direct"]),
    ] {
        run.render_refuses(arguments, words);
    }
}

#[test]
fn lights_and_reflected_waves_that_cannot_be_are_named_with_what_is_allowed() {
    let run = Run::new();
    let metres = "from -1e12 to 1e12";
    for (arguments, words) in [
        (&["--light", "1,2"][..], &["--light", "1,2", metres, "or off"][..]),
        (&["--light", "0,0,1e13"], &["--light", "0,0,1e13", metres, "or off"]),
        (&["--light"], &["--light", "allowed: Place of the strongest light"]),
        (&["--light-axis", "1,2"], &["--light-axis", "1,2", "three finite numbers"]),
        (&["--light-axis", "0,0,0"], &["--light-axis", "0,0,0", "not all 0"]),
        (&["--move", "1"], &["--move", "a number and three", metres]),
        (&["--move", "99:0,0,1"], &["--move 99:0,0,1", "no such object", "a number below 7"]),
        (&["--set", "reflected.bounces=0"], &["`reflected.bounces`", "`0`", "whole number, 1 to 16"]),
        (&["--set", "reflected.rays=65"], &["`reflected.rays`", "`65`", "whole number, 1 to 64"]),
        (&["--set", "reflected.frames=0"], &["`reflected.frames`", "`0`", "whole number, 1 to 64"]),
        (&["--set", "reflected.radius=-1"], &["`reflected.radius`", "`-1`", "0 to 16"]),
        (
            &["--set", "reflected.lamps=1"],
            &["`reflected.lamps`", "no such setting", "reflected.bounces, reflected.rays"],
        ),
        (&["--set", "emission.samples=0"], &["`emission.samples`", "`0`", "whole number, 1 to 4096"]),
        (&["--set", "gather.specular=1"], &["`gather.specular`", "`1`", "true, false"]),
        (&["--set", "model=both"], &["`model`", "`both`", "wave, reflected"]),
    ] {
        run.render_refuses(arguments, words);
    }
    // Every command that takes them says so, before it reads the scene.
    for command in [&["reference", "-o", "a.exr"][..], &["compare", "-o", "a"], &["bench"], &["view"]] {
        let arguments = [command, &["missing.gltf", "--set", "reflected.rays=65"]].concat();
        run.refuses(&arguments, &["`reflected.rays`", "whole number, 1 to 64"]);
    }
    run.refuses(&["bench", "--moving", "lamp"], &["--moving", "lamp", "light, camera, object"]);
    run.refuses(&["reference", "-o", "a.exr", "--bounces", "65536"], &["--bounces", "65536", "0 to 65535, or inf"]);
}

#[test]
fn wrong_scenes_and_cameras_are_named_with_what_there_is() {
    let run = Run::new();
    fs::write(run.path("broken.gltf"), "{").unwrap();
    fs::create_dir(run.path("folder.glb")).unwrap();
    run.render_refuses(&["builtin:house"], &["house", "builtin:cornell"]);
    run.render_refuses(&["builtin:"], &["builtin:cornell"]);
    run.render_refuses(&["cornell"], &["cornell", ".gltf", ".glb", "builtin:cornell"]);
    run.render_refuses(&[""], &["scene", "builtin:cornell"]);
    run.render_refuses(&["missing.gltf"], &["missing.gltf"]);
    run.render_refuses(&["broken.gltf"], &["broken.gltf"]);
    run.render_refuses(&["folder.glb"], &["folder.glb"]);
    run.render_refuses(&["a\nb.gltf"], &["a\\nb.gltf"]);
    for camera in ["3", "-1", "back", "", "Front"] {
        run.render_refuses(&["scene.gltf", "--camera", camera], &["--camera", camera, "0 (front), 1 (side), 2 (flat)"]);
    }
    run.render_refuses(&["scene.gltf", "--camera", "flat", "--fov", "30"], &["--fov", "orthographic", "perspective"]);
    run.render_refuses(&["scene.gltf", "--view-height", "3"], &["--view-height 3", "perspective", "orthographic"]);
    let mut sun: serde_json::Value = serde_json::from_str(GLTF).unwrap();
    sun["extensions"]["KHR_lights_punctual"] = serde_json::json!({"lights": [{"type": "directional"}]});
    sun["nodes"][0]["extensions"]["KHR_lights_punctual"] = serde_json::json!({"light": 0});
    fs::write(run.path("sun.gltf"), sun.to_string()).unwrap();
    run.render_refuses(&["sun.gltf", "--light", "0,1,0"], &["--light 0,1,0", "directional", "--light-axis"]);
}

#[test]
fn a_config_file_that_cannot_be_used_is_named() {
    let run = Run::new();
    fs::write(run.path("latin1.toml"), b"# \xe4\n").unwrap();
    fs::write(run.path("huge.toml"), "#".repeat((1 << 20) + 1)).unwrap();
    fs::write(run.path("syntax.toml"), "strength = 2\nwave = = 3\n").unwrap();
    fs::write(run.path("range.toml"), "[wave]\nshells = 99\n").unwrap();
    fs::write(run.path("unknown.toml"), "[wave]\nsheels = 9\n").unwrap();
    for (file, words) in [
        ("missing.toml", &["TOML"][..]),
        (".", &["TOML"]),
        ("latin1.toml", &["UTF-8"]),
        ("huge.toml", &["1 MiB"]),
        ("syntax.toml", &["line 2", "huygens info --settings"]),
        ("range.toml", &["wave.shells", "99", "1 to 16"]),
        ("unknown.toml", &["wave.sheels", "wave.shells"]),
    ] {
        run.render_refuses(&["--config", file], &[&[file][..], words].concat());
    }
}

#[test]
fn outputs_that_cannot_be_written_are_refused_before_the_scene_is_read() {
    let run = Run::new();
    fs::create_dir(run.path("folder.png")).unwrap();
    fs::write(run.path("file"), "").unwrap();
    fs::write(run.path("kept.png"), "as it was").unwrap();
    let mut permissions = fs::metadata(run.path("kept.png")).unwrap().permissions();
    permissions.set_readonly(true);
    fs::set_permissions(run.path("kept.png"), permissions).unwrap();
    let long = format!("{}.png", "n".repeat(300));
    for (output, words) in [
        ("a.jpg", &[".png", ".exr"][..]),
        ("a", &[".png", ".exr"]),
        (".png", &[".png", ".exr"]),
        ("a.png.", &[".png", ".exr"]),
        ("missing/a.png", &["folder", "does not exist"]),
        ("file/a.png", &["folder"]),
        ("folder.png", &["it is a folder"]),
        ("a.png/", &["names a folder"]),
        ("kept.png", &["write-protected"]),
        (&long, &["too long"]),
    ] {
        // The scene is missing too: the output has to be what is reported.
        run.refuses(&["render", "missing.gltf", "-o", output], &[&["--output", output][..], words].concat());
    }
    for (stats, words) in [
        ("missing/s.json", &["folder", "does not exist"][..]),
        ("folder.png", &["it is a folder"]),
        ("a.png", &["--output names the same file"]),
        ("./a.png", &["--output names the same file"]),
        ("folder.png/../a.png", &["--output names the same file"]),
        ("scene.gltf", &["a file that is read"]),
    ] {
        run.render_refuses(&["scene.gltf", "--stats", stats], &[&["--stats", stats][..], words].concat());
    }
    fs::write(run.path("c.toml"), "").unwrap();
    run.render_refuses(&["--config", "c.toml", "--stats", "c.toml"], &["--stats c.toml", "a file that is read"]);
    #[cfg(target_os = "linux")]
    run.refuses(&["render", "-o", "/proc/a.png"], &["--output", "/proc/a.png", "folder"]);
    #[cfg(unix)]
    {
        std::os::unix::net::UnixListener::bind(run.path("socket.png")).unwrap();
        run.refuses(&["render", "-o", "socket.png"], &["socket.png", "not a regular file"]);
    }
}

#[cfg(target_os = "linux")]
#[test]
fn arguments_need_not_be_unicode() {
    use std::os::unix::ffi::OsStringExt;
    let run = Run::new();
    let odd = |ending: &str| OsString::from_vec([b"\xff", ending.as_bytes()].concat());
    let base: [OsString; 3] = ["render".into(), "-o".into(), "a.png".into()];
    run.refuses(&[&base[..], &["--size".into(), odd("")]].concat(), &["UTF-8"]);
    run.refuses(&[&base[..], &[odd(".gltf")]].concat(), &[".gltf"]);
    run.refuses(&[&base[..], &[odd("")]].concat(), &["builtin:cornell"]);
    run.refuses(&[odd("")], &["render"]);
    let picture = odd(".png");
    let tiny = TINY.map(OsString::from);
    let output = run.run([&["render".into(), "-o".into(), picture.clone()], &tiny[..]].concat());
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert!(run.folder.path().join(picture).exists());
}

#[test]
fn without_opengl_the_status_is_1_and_the_lists_work() {
    let run = Run::new();
    let before = run.files();
    for arguments in [&["render", "-o", "a.png", "--stats", "s.json"][..], &["info"]] {
        // libglvnd finds no driver then.
        let mut command = run.command();
        let output = command.env("__EGL_VENDOR_LIBRARY_FILENAMES", "/nonexistent").args(arguments).output().unwrap();
        let line = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{arguments:?}: {line}");
        assert!(line.starts_with("huygens: error: ") && line.lines().count() == 1, "{line}");
        assert_eq!(text(&output.stdout), "");
    }
    assert_eq!(before, run.files());
    for list in ["--scenes", "--settings", "--presets"] {
        let mut command = run.command();
        let output = command.env("__EGL_VENDOR_LIBRARY_FILENAMES", "/nonexistent").args(["info", list]).output();
        assert_eq!(output.unwrap().status.code(), Some(0), "{list}");
    }
}

#[test]
fn info_lists_every_scene_setting_and_preset() {
    let run = Run::new();
    let list = |flag| {
        let output = run.run(["info", flag]);
        assert_eq!((output.status.code(), text(&output.stderr).as_str()), (Some(0), ""), "{flag}");
        let list = text(&output.stdout);
        assert!(list.lines().all(|line| line.chars().count() <= 120), "{list}");
        list
    };
    let scenes = list("--scenes");
    assert_eq!(scenes.lines().count(), huygens::scene::BUILTIN_NAMES.len());
    for (line, (name, about)) in scenes.lines().zip(huygens::scene::BUILTIN_NAMES) {
        assert!(line.starts_with(&format!("builtin:{name} ")) && line.ends_with(about), "{line}");
    }
    let settings = list("--settings");
    let keys = huygens::settings::keys();
    assert_eq!(settings.lines().count(), 2 * keys.len());
    for (lines, key) in settings.lines().collect::<Vec<_>>().chunks(2).zip(&keys) {
        let default = huygens::Settings::default().get(&key.name).unwrap().to_string();
        let words: Vec<&str> = lines[0].split_whitespace().collect();
        assert_eq!(words[..4], [&key.name, key.kind.type_name(), "default", default.trim_matches('"')]);
        assert_eq!(words[4..].join(" "), key.kind.to_string());
        assert_eq!(lines[1].trim(), key.meaning);
    }
    let presets = list("--presets");
    // A line that begins with a blank goes on with the preset before it.
    let presets = presets.replace("\n ", " ");
    let names: Vec<&str> = presets.lines().filter_map(|line| line.split(' ').next()).collect();
    assert_eq!(names, huygens::settings::PRESETS);
    for (line, name) in presets.lines().zip(huygens::settings::PRESETS) {
        // What the line says, set one by one, is the preset.
        let mut settings = huygens::Settings::default();
        for (key, value) in line[name.len()..].split(',').filter_map(|part| part.split_once(" = ")) {
            settings.set(key.trim(), value).unwrap();
        }
        assert_eq!(settings, huygens::Settings::preset(name).unwrap(), "{line}");
    }
}

#[test]
fn info_names_the_driver_and_its_devices() {
    let run = Run::new();
    let output = run.run(["info"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let info = text(&output.stdout);
    for row in ["Renderer", "Version", "GLSL", "Tier in use", "Largest texture", "Devices"] {
        let line = info.lines().find(|line| line.starts_with(row));
        assert!(line.is_some_and(|line| line.len() > row.len() + 1), "no {row} in {info}");
    }
    let devices: Vec<&str> = info.lines().skip_while(|line| !line.starts_with("Devices")).skip(1).collect();
    assert!(!devices.is_empty() && devices.iter().all(|d| d.contains("software") || d.contains("hardware")), "{info}");
    // The first index is one that --device takes, and it is the one in use then.
    let index = devices[0].trim_start_matches('*').split_whitespace().next().unwrap();
    let output = run.run(["info", "--device", index]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert!(text(&output.stdout).contains(&format!("\n* {index} ")), "{}", text(&output.stdout));
    run.refuses(&["info", "--device", "999"], &["device"]);
    run.render_refuses(&["--device", "999"], &["device"]);
}

#[test]
fn whoever_closes_stdout_early_causes_no_error() {
    let run = Run::new();
    for arguments in [&["info", "--settings"][..], &["info"], &["--help"], &["render", "--size", "1x1", "-o", "a.png"]]
    {
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_huygens"));
        let command = command.current_dir(run.folder.path()).args(arguments).stdout(writer);
        let output = command.stderr(std::process::Stdio::piped()).spawn().unwrap().wait_with_output().unwrap();
        assert_eq!((output.status.code(), text(&output.stderr).as_str()), (Some(0), ""), "{arguments:?}");
    }
}

#[test]
fn a_png_and_its_numbers_are_written() {
    let run = Run::new();
    let output =
        run.render(&["-o", "A.PNG", "--stats", "s.json", "--seed", "7", "--frames", "2", "--exposure", "-2.5"]);
    let line = text(&output.stdout);
    assert!(line.starts_with("wrote A.PNG: 32x24, ") && line.contains("VPLs") && line.lines().count() == 1, "{line}");
    let (width, height, rgb) = read_png(&run.path("A.PNG"));
    assert_eq!((width, height), (32, 24));
    assert!(rgb.iter().any(|&byte| byte != rgb[0]), "the picture is of one value");
    let stats: serde_json::Value = serde_json::from_slice(&fs::read(run.path("s.json")).unwrap()).unwrap();
    assert_eq!(stats["scene"], "builtin:cornell");
    assert_eq!(stats["size"], serde_json::json!([32, 24]));
    assert_eq!((stats["seed"].as_u64(), stats["frames"].as_u64()), (Some(7), Some(2)));
    assert_eq!(stats["exposure_ev"].as_f64(), Some(-2.5));
    assert_eq!(stats["visibility"], "none");
    let mut files: Vec<PathBuf> = run.files().into_keys().collect();
    files.retain(|file| file != &run.path("scene.gltf"));
    assert_eq!(files, [run.path("A.PNG"), run.path("s.json")], "something else was left");
    #[cfg(unix)]
    for file in ["A.PNG", "s.json"] {
        use std::os::unix::fs::PermissionsExt;
        // What any new file here gets, by the umask.
        let usual = fs::metadata(run.path("scene.gltf")).unwrap().permissions().mode();
        assert_eq!(fs::metadata(run.path(file)).unwrap().permissions().mode(), usual, "{file}");
    }
}

#[test]
fn an_exr_is_linear_whatever_the_exposure() {
    let run = Run::new();
    run.render(&["scene.gltf", "-o", "albedo.exr", "--layer", "albedo", "--exposure", "3"]);
    let (width, height, channels) = read_exr(&run.path("albedo.exr"));
    assert_eq!((width, height), (32, 24));
    assert_eq!(channels.keys().collect::<Vec<_>>(), ["B", "G", "R"]);
    let middle = height / 2 * width + width / 2;
    for (channel, value) in [("R", 0.25), ("G", 0.5), ("B", 0.75)] {
        near(channels[channel][middle], value);
    }

    let mean = |file: &str| {
        let (_, _, channels) = read_exr(&run.path(file));
        channels["G"].iter().sum::<f32>() / channels["G"].len() as f32
    };
    run.render(&["-o", "dark.exr", "--exposure", "-9"]);
    run.render(&["-o", "bright.exr", "--exposure", "9"]);
    assert!(mean("dark.exr") > 0.0);
    near(mean("dark.exr") / mean("bright.exr"), 1.0);
    let brightness = |file: &str| read_png(&run.path(file)).2.iter().map(|&byte| u64::from(byte)).sum::<u64>();
    run.render(&["-o", "dark.png", "--exposure", "-9"]);
    run.render(&["-o", "bright.png", "--exposure", "2"]);
    assert!(brightness("dark.png") < brightness("bright.png"));
}

/// The two triangles, which come nearer: from 3 m to 2 m in a second.
fn moving(run: &Run) {
    let mut json: serde_json::Value = serde_json::from_str(GLTF).unwrap();
    let mut push = |list: &str, value| json[list].as_array_mut().unwrap().push(value);
    let uri = "data:application/octet-stream;base64,AAAAAAAAgD8AAAAAAAAAAAAAAAAAAAAAAAAAAAAAgD8=";
    push("buffers", serde_json::json!({"byteLength": 32, "uri": uri}));
    push("bufferViews", serde_json::json!({"buffer": 1, "byteLength": 8}));
    push("bufferViews", serde_json::json!({"buffer": 1, "byteOffset": 8, "byteLength": 24}));
    push("accessors", serde_json::json!({"bufferView": 1, "componentType": 5126, "count": 2, "type": "SCALAR"}));
    push("accessors", serde_json::json!({"bufferView": 2, "componentType": 5126, "count": 2, "type": "VEC3"}));
    json["animations"] = serde_json::json!([{"name": "nearer", "samplers": [{"input": 1, "output": 2}],
        "channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}}]}]);
    fs::write(run.path("scene.gltf"), json.to_string()).unwrap();
}

#[test]
fn animations_play_at_a_time_and_in_numbered_pictures() {
    let run = Run::new();
    moving(&run);
    near(depth(&run, &[])[0], 3.0);
    near(depth(&run, &["--time", "0.25"])[0], 2.75);
    near(depth(&run, &["--time", "1.5", "--animation", "nearer"])[0], 2.5);
    run.render_refuses(&["scene.gltf", "--time", "0", "--animation", "1"], &["--animation 1", "0 (nearer)"]);

    let before = run.files().len();
    let arguments =
        ["scene.gltf", "--layer", "depth", "-o", "out.exr", "--frames", "1..4", "--fps", "4", "--stats", "s.json"];
    let output = run.render(&arguments);
    assert_eq!(text(&output.stderr), "");
    assert!(text(&output.stdout).contains("out-0001.exr to out-0003.exr: 3 of 32x24"));
    assert_eq!(run.files().len(), before + 4);
    for (frame, expected) in [(1, 2.75), (2, 2.5), (3, 2.25)] {
        let (width, height, channels) = read_exr(&run.path(&format!("out-{frame:04}.exr")));
        near(channels["Z"][height / 2 * width + width / 2], expected);
    }
    let stats: serde_json::Value = serde_json::from_slice(&fs::read(run.path("s.json")).unwrap()).unwrap();
    let frames = stats["frames"].as_array().unwrap();
    assert_eq!((stats["fps"].as_u64(), frames.len()), (Some(4), 3));
    assert_eq!((frames[2]["frame"].as_u64(), frames[2]["seconds"].as_f64()), (Some(3), Some(0.75)));
    // The scene is uploaded once.
    assert_eq!(frames[2]["rebuilds"]["scene"].as_u64(), Some(1));

    // One of the pictures cannot be written: nothing is.
    fs::create_dir(run.path("b-0001.png")).unwrap();
    run.refuses(&["render", "scene.gltf", "-o", "b.png", "--frames", "0..2"], &["--output b-0001.png", "folder"]);
    let output = run.render(&["builtin:cornell", "-o", "c.png", "--time", "1"]);
    assert!(text(&output.stderr).contains("no animations"), "{}", text(&output.stderr));
    for command in ["reference", "compare"] {
        run.refuses(&[command, "-o", "d.exr", "--frames", "0..2"], &["--frames", "render"]);
    }
}

#[test]
fn the_light_goes_round() {
    let run = Run::new();
    let picture = |name: &str, arguments: &[&str]| {
        let fixed = ["builtin:column", "--layer", "direct", "--exposure", "0", "-o", name];
        let output = run.render(&fixed.iter().chain(arguments).copied().collect::<Vec<_>>());
        assert_eq!(text(&output.stderr), "");
        fs::read(run.path(name)).unwrap()
    };
    let rest = picture("rest.png", &[]);
    assert!(picture("still.png", &["--time", "0", "--light-orbit", "45"]) == rest);
    let turned = picture("turned.png", &["--time", "2", "--light-orbit", "45"]);
    assert!(turned != rest);
    assert!(picture("back.png", &["--time", "4", "--light-orbit", "-67.5"]) == turned, "270° back is 90° on");
    assert!(picture("whole.png", &["--time", "8", "--light-orbit", "45"]) == rest);
    let fixed = ["builtin:column", "--layer", "direct", "--exposure", "0", "-o", "orbit.png"];
    run.render(
        &fixed.iter().chain(&["--light-orbit", "45", "--frames", "0..=2", "--fps", "1"]).copied().collect::<Vec<_>>(),
    );
    assert!(fs::read(run.path("orbit-0000.png")).unwrap() == rest);
    let one = run.render(&["-o", "one.png", "--light-orbit", "45", "--frames", "7..8"]);
    assert!(text(&one.stdout).starts_with("wrote one-0007.png: 32x24, in "), "{}", text(&one.stdout));
    assert!(fs::read(run.path("orbit-0002.png")).unwrap() == turned);
}

#[test]
fn a_camera_is_chosen_by_index_or_name_and_changed_in_parts() {
    let run = Run::new();
    near(depth(&run, &[])[0], 3.0);
    near(depth(&run, &["--camera", "1"])[0], 4.0);
    near(depth(&run, &["--camera", "side"])[0], 4.0);
    near(depth(&run, &["--camera", "flat"])[0], 6.0);
    // The direction of sight stays where the eye alone is given, the eye where the target alone is.
    near(depth(&run, &["--eye", "0,0,5"])[0], 5.0);
    near(depth(&run, &["--camera", "side", "--eye", "2.5,0,0"])[0], 2.5);
    near(depth(&run, &["--eye", "0,0,-4", "--target", "0,0,0"])[0], 4.0);
    near(depth(&run, &["--camera", "side", "--target", "0,0,0"])[0], 4.0);
    near(depth(&run, &["--camera", "flat", "--eye", "0,0,-4", "--target", "0,0,0", "--fov", "40"])[0], 4.0);
    // The whole picture lies within the triangle, or the triangle within the picture.
    let [middle, corner] = depth(&run, &["--fov", "1"]);
    near(middle, 3.0);
    near(corner, 3.0);
    let [middle, corner] = depth(&run, &["--fov", "90"]);
    near(middle, 3.0);
    assert_eq!(corner, 0.0);
}

#[test]
fn set_overrides_config_and_config_overrides_the_preset() {
    let run = Run::new();
    fs::write(run.path("c.toml"), "[ism]\nsize = 8\n[wave]\nshells = 3\n").unwrap();
    let cheap = ["--set", "ism.points=16", "--set", "ism.surfels=1024", "--set", "wave.delta_phi=30"];
    let stats = |arguments: &[&str]| run.stats(&[&cheap[..], arguments].concat());
    let tile = |arguments: &[&str]| stats(arguments)["ism_tile"].as_u64();
    assert_eq!(tile(&[]), Some(64));
    assert_eq!(tile(&["--preset", "fast"]), Some(32));
    assert_eq!(tile(&["--preset", "fast", "--config", "c.toml"]), Some(8));
    // Wherever it stands, and the last of several.
    let last = ["--set", "ism.size=128", "--set", "ism.size=16", "--preset", "fast", "--config", "c.toml"];
    let numbers = stats(&last);
    assert_eq!(numbers["ism_tile"].as_u64(), Some(16));
    // What is not overridden comes from further down: the shells from the file.
    assert_eq!(numbers["shells"].as_u64(), Some(3));
}

#[test]
fn an_old_file_is_replaced_whole_or_survives() {
    let run = Run::new();
    fs::write(run.path("a.png"), "as it was").unwrap();
    run.render_refuses(&["--set", "wave.shells=99"], &["wave.shells"]);
    run.render(&["-o", "a.png"]);
    assert_eq!(read_png(&run.path("a.png")).0, 32);
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("a.png", run.path("link.png")).unwrap();
        fs::write(run.path("a.png"), "as it was").unwrap();
        run.render(&["-o", "link.png"]);
        assert_eq!(read_png(&run.path("a.png")).0, 32);
        assert!(run.path("link.png").is_symlink(), "the link was replaced, not its file");
        fs::remove_file(run.path("a.png")).unwrap();
        run.refuses(&["render", "-o", "link.png"], &["link.png", "does not exist"]);
        assert!(run.path("link.png").is_symlink());
    }
}

/// A file system that takes no more is not the input's fault.
#[cfg(unix)]
#[test]
fn a_full_disk_is_status_1_and_leaves_nothing() {
    let run = Run::new();
    fs::write(run.path("a.png"), "as it was").unwrap();
    let before = run.files();
    // No file may grow beyond 0 bytes; without the trap, the signal would end the process.
    let script = r#"trap "" XFSZ; ulimit -f 0; exec "$@""#;
    let mut command = Command::new("sh");
    command.current_dir(run.folder.path()).args(["-c", script, "sh", env!("CARGO_BIN_EXE_huygens")]);
    let output = command.args(["render", "-o", "a.png", "--stats", "s.json"]).args(TINY).output().unwrap();
    let line = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{line}");
    assert!(line.starts_with("huygens: error: --output a.png: ") && line.lines().count() == 1, "{line}");
    // Of a file that it alone knows nothing is said.
    assert!(line.contains("too large") && !line.contains(".huygens-"), "{line}");
    assert!(before == run.files(), "something was left or changed");
}

#[test]
fn a_scene_without_triangles_renders_with_a_warning() {
    let run = Run::new();
    let scene = r#"{"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"camera": 0}],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.1}}]}"#;
    fs::write(run.path("empty.gltf"), scene).unwrap();
    let output = run.render(&["empty.gltf", "-o", "a.png"]);
    let lines = text(&output.stderr);
    assert!(lines.lines().all(|line| line.starts_with("huygens: warning: ")), "{lines}");
    assert!(lines.contains("no triangles"), "{lines}");
    assert_eq!(read_png(&run.path("a.png")).0, 32);
}

#[test]
fn without_arguments_and_display_the_built_in_scene_is_rendered() {
    let run = Run::new();
    fs::create_dir(run.path("huygens.png")).unwrap();
    let output = run.run([""; 0]);
    // It takes a while to render in full: that it sets out to write this file is enough here.
    assert_eq!(output.status.code(), Some(2));
    let lines = text(&output.stderr);
    assert!(
        lines.contains("no display") && lines.contains("builtin:cornell") && lines.contains("huygens.png"),
        "{lines}"
    );
}

#[test]
fn the_thesis_preset_has_6485_vpls_and_renders_the_cornell_box_within_two_minutes() {
    let run = Run::new();
    let started = std::time::Instant::now();
    let thesis = ["render", "builtin:cornell", "--preset", "thesis", "--size", "512x512", "-o", "thesis.png"];
    let output = run.run(thesis.iter().chain(&["--stats", "stats.json"]));
    let seconds = started.elapsed().as_secs_f64();
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let stats: serde_json::Value = serde_json::from_slice(&fs::read(run.path("stats.json")).unwrap()).unwrap();
    for (key, expected) in [("rays", 1297), ("shells", 5), ("vpls", 6485), ("active_vpls", 6485)] {
        assert_eq!(stats[key].as_u64(), Some(expected), "{key}");
    }
    // The rule of the energy, and the shells at 5, 10, 20, 40 and 80 per cent of the depth.
    let number = |key: &str| stats[key].as_f64().unwrap();
    let albedo = number("mean_albedo");
    assert!((number("lattice_flux_w") / (number("light_flux_w") * albedo / (1.0 - albedo)) - 1.0).abs() < 1e-4);
    for (distance, share) in stats["shell_distances_m"].as_array().unwrap().iter().zip([0.05, 0.1, 0.2, 0.4, 0.8]) {
        assert!((distance.as_f64().unwrap() / number("scene_depth_m") / share - 1.0).abs() < 1e-4, "{share}");
    }
    assert!(seconds < 120.0, "{seconds} s");
}

#[test]
fn a_file_that_the_scene_is_made_of_is_not_replaced() {
    let run = Run::new();
    let gltf = r#"{"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}], "buffers": [{"uri": "b.png", "byteLength": 36}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}], "accessors": [{"bufferView": 0, "componentType": 5126,
        "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]}]}"#;
    let corners = [0.0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    fs::write(run.path("beside.gltf"), gltf).unwrap();
    fs::write(run.path("b.png"), corners.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>()).unwrap();
    run.refuses(&["render", "beside.gltf", "-o", "b.png"], &["--output b.png", "replace"]);
    run.refuses(&["render", "beside.gltf", "-o", "a.png", "--stats", "b.png"], &["--stats b.png", "replace"]);
    run.render(&["beside.gltf", "-o", "a.png"]);
}

/// A .glb file of a hilly grid of `n` × `n` squares, without normals, light and camera: all of that takes its time.
fn hills(n: u32) -> Vec<u8> {
    let mut binary = Vec::new();
    for y in 0..=n {
        for x in 0..=n {
            let (x, y) = (x as f32 / n as f32, y as f32 / n as f32);
            for v in [x, 0.1 * (x * 40.0).sin() * (y * 30.0).cos(), y] {
                binary.extend(v.to_le_bytes());
            }
        }
    }
    let positions = binary.len();
    for y in 0..n {
        for x in 0..n {
            let at = |x: u32, y: u32| y * (n + 1) + x;
            for i in [at(x, y), at(x, y + 1), at(x + 1, y + 1), at(x, y), at(x + 1, y + 1), at(x + 1, y)] {
                binary.extend(i.to_le_bytes());
            }
        }
    }
    let indices = binary.len() - positions;
    let (points, corners) = (positions / 12, indices / 4);
    let mut json = format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1}}]}}],
        "buffers":[{{"byteLength":{}}}],
        "bufferViews":[{{"buffer":0,"byteLength":{positions}}},
                       {{"buffer":0,"byteOffset":{positions},"byteLength":{indices}}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":{points},"type":"VEC3",
                       "min":[0,-0.1,0],"max":[1,0.1,1]}},
                     {{"bufferView":1,"componentType":5125,"count":{corners},"type":"SCALAR"}}]}}"#,
        binary.len()
    );
    while json.len() % 4 != 0 {
        json.push(' ');
    }
    let mut file = b"glTF\x02\0\0\0".to_vec();
    file.extend((28 + json.len() as u32 + binary.len() as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", json.as_bytes()), (b"BIN\0", &binary)] {
        file.extend((chunk.len() as u32).to_le_bytes());
        file.extend(kind);
        file.extend(chunk);
    }
    file
}

/// `script` (util-linux) gives the program a terminal.
#[test]
#[cfg(target_os = "linux")]
fn a_terminal_is_shown_how_far_loading_and_rendering_are() {
    let run = Run::new();
    fs::write(run.path("hills.glb"), hills(900)).unwrap();
    let render = "render hills.glb -o hills.png --size 32x24 --layer albedo";
    let on_terminal = |arguments: &str| {
        let command = format!("{} {arguments}", env!("CARGO_BIN_EXE_huygens"));
        let mut script = Command::new("script");
        let output = script.args(["-qec", &command, "/dev/null"]).current_dir(run.folder.path()).output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stdout));
        text(&output.stdout).to_owned()
    };
    let shown = on_terminal(render);
    assert!(shown.contains("loading hills.glb"), "{shown:?}");
    // Whatever was shown is gone at the end: the last thing before the result clears the line.
    let (bar, result) = shown.rsplit_once("wrote").unwrap();
    assert!(bar.ends_with("\x1b[2K") || bar.ends_with("\x1b[K"), "{bar:?}");
    assert!(result.contains("hills.png"));

    // Longer than a second is rendering too; nothing is shown on request, however long it takes.
    let long = on_terminal("render builtin:column -o long.png --size 200x150 --preset fast");
    assert!(long.contains("% [") && long.contains(" left"), "{long:?}");
    let quiet = on_terminal(&format!("{render} --quiet"));
    assert!(quiet.starts_with("wrote"), "{quiet:?}");
    let piped = run.run(render.split(' '));
    assert!(piped.status.success() && piped.stderr.is_empty(), "{}", text(&piped.stderr));
}

/// A benchmark in next to no time.
fn bench(run: &Run, arguments: &[&str]) -> Output {
    bench_at("32x24", run, arguments)
}

fn bench_at(size: &str, run: &Run, arguments: &[&str]) -> Output {
    let short = ["bench", "builtin:cornell", "--runs", "3", "--warm-up", "1", "--still", "5", "--size", size];
    run.run(short.iter().chain(&TINY[2..]).chain(arguments))
}

#[test]
fn bench_writes_what_its_frames_cost_and_how_far_they_are_from_the_exact_gather() {
    let run = Run::new();
    let variants =
        ["--variant", "whole:gather.method=exact", "--variant", "part:gather.method=interleaved,gather.interleave=2"];
    let output = bench_at(
        "64x48",
        &run,
        &[&["--presets", "fast", "--json", "b.json", "--spp", "16", "--target-fps", "1000"][..], &variants].concat(),
    );
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let table = text(&output.stdout);
    assert!(["fast", "whole", "part", "  ref. FLIP  "].iter().all(|name| table.contains(name)), "{table}");
    let json: serde_json::Value = serde_json::from_slice(&fs::read(run.path("b.json")).unwrap()).unwrap();
    let runs = json["runs"].as_array().unwrap();
    assert_eq!(runs.len(), 3);
    for (entry, name) in runs.iter().zip(["fast", "whole", "part"]) {
        assert_eq!((&entry["scene"], &entry["preset"]), (&"builtin:cornell".into(), &name.into()));
        assert_eq!(entry["size"], serde_json::json!([64, 48]));
        let number = |value: &serde_json::Value| value.as_f64().unwrap_or_else(|| panic!("{name}: {value}"));
        for time in ["frame_ms", "gi_ms", "gather_ms", "direct_frame_ms"] {
            let [median, p95] = ["median", "p95"].map(|key| number(&entry[time][key]));
            assert!(0.0 < median && median <= p95, "{name} {time}: {median} {p95}");
        }
        let passes = entry["passes"].as_array().unwrap();
        let pass = passes.iter().find(|pass| pass["name"] == "gather").unwrap();
        assert!(number(&pass["cpu_ms"]) > 0.0 && number(&entry["exact_gather_ms"]) > 0.0);
        // The same sum, or one that becomes the same while the camera rests.
        let flip = number(&entry["flip_to_exact"]);
        let rested = number(&entry["still"]["flip_to_exact"]);
        assert_eq!(flip == 0.0, name == "whole", "{name}: {flip}");
        assert!(rested <= if name == "fast" { flip } else { 0.5 * flip }, "{name}: {flip}, at rest {rested}");
        let traced = number(&entry["flip_to_reference"]);
        let row = table.lines().find(|line| line.split_whitespace().next() == Some(name)).unwrap();
        assert_eq!(row.split_whitespace().nth(7), Some(format!("{traced:.4}").as_str()), "{table}");
        assert!(row.chars().count() <= 120, "{table}");
        assert!((0.0..1.0).contains(&traced));
        assert_eq!(entry["still"]["rebuilt"], false);
        let governor = &entry["governor"];
        assert!(number(&governor["frame_ms"]["median"]) > 0.0 && number(&governor["flip_to_exact"]) < 0.5);
        // There is no time for more than the least: of 185 VPLs, one subset of 64.
        assert_eq!(number(&governor["most"]), 3.0, "{name}: {governor}");
        assert_eq!(entry["motion"], serde_json::json!([]));
    }
    assert!(runs[0]["vpls"].as_u64() == runs[1]["vpls"].as_u64());
    assert_eq!(json["sweeps"], serde_json::json!([]));
}

#[test]
fn bench_tells_flicker_from_motion() {
    let run = Run::new();
    let output = bench(&run, &["--presets", "fast,exact", "--set", "shadow.size=64", "--motion", "--json", "b.json"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert!(text(&output.stdout).contains("flicker"));
    let json: serde_json::Value = serde_json::from_slice(&fs::read(run.path("b.json")).unwrap()).unwrap();
    for entry in json["runs"].as_array().unwrap() {
        let motions = entry["motion"].as_array().unwrap();
        let names: Vec<_> = motions.iter().map(|motion| motion["moving"].as_str().unwrap()).collect();
        assert_eq!(names, ["light", "camera", "object"]);
        for motion in motions {
            let [change, of_exact, flicker] =
                ["change", "exact_change", "flicker"].map(|key| motion[key].as_f64().unwrap());
            assert!(change > 0.0 && of_exact > 0.0, "{motion}");
            assert_eq!(flicker == 0.0, entry["preset"] == "exact", "{motion}");
        }
    }
}

#[test]
fn bench_plots_how_cost_grows() {
    let run = Run::new();
    let output = bench(&run, &["--presets", "fast", "--json", "b.json", "--sweep", "b.svg"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let json: serde_json::Value = serde_json::from_slice(&fs::read(run.path("b.json")).unwrap()).unwrap();
    let sweeps = json["sweeps"].as_array().unwrap();
    let counts = |over: &str| -> Vec<u64> {
        let sweep = sweeps.iter().find(|sweep| sweep["over"] == over).unwrap();
        sweep["points"].as_array().unwrap().iter().map(|point| point["count"].as_u64().unwrap()).collect()
    };
    assert_eq!(counts("pixels"), [16 * 12, 32 * 24, 64 * 48]);
    let triangles = counts("triangles");
    assert_eq!(triangles, [triangles[0], 4 * triangles[0], 16 * triangles[0]]);
    let vpls = counts("vpls");
    // Steps of 60° do not divide 90°.
    assert_eq!(vpls.len(), 2);
    assert!(vpls.windows(2).all(|pair| pair[1] as f64 / pair[0] as f64 > 2.5), "{vpls:?}");
    let svg = String::from_utf8(fs::read(run.path("b.svg")).unwrap()).unwrap();
    assert!(svg.starts_with("<svg") && ["pixels", "VPLs", "triangles", "fast"].iter().all(|name| svg.contains(name)));
}

#[test]
fn bench_refuses_what_has_no_influence_and_what_it_cannot_write() {
    let run = Run::new();
    for (arguments, expected) in [
        (&["--frames", "2"][..], "--frames"),
        (&["--layer", "direct"], "--layer"),
        (&["--presets", "best"], "thesis"),
        (&["--presets", "fast,exact,fast"], "each preset once"),
        (&["--runs", "0"], "1 to 1000"),
        (&["--target-fps", "0"], "0.01 to 1000"),
        (&["--target-fps", "nan"], "0.01 to 1000"),
        (&["--sweep", "nowhere/b.svg"], "folder"),
        (&["--sweep", "b.txt"], "allowed: .svg"),
        (&["--json", "nowhere/b.json"], "folder"),
        (&["--json", "b.json", "--variant", "x:gather.interleave=3"], "gather.interleave"),
        (&["--presets", "fast", "--variant", "fast:strength=1"], "taken"),
        (&["--variant", "x:strength=1", "--variant", "x:strength=2"], "taken"),
    ] {
        let output = run.run(["bench", "builtin:cornell"].iter().chain(arguments));
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {message}");
        assert!(message.contains(expected) && message.lines().count() == 1, "{arguments:?}: {message}");
        assert!(!run.path("b.json").exists());
    }
    run.refuses(&["bench", "--light-orbit", "9"], &["allowed: with --time\n"]);
    let output = run.run(["bench", "--size", "16384x16384"]);
    assert!(output.status.code() == Some(2) && text(&output.stderr).contains("28 million"));
}
