//! `huygens reference` and `huygens compare` as their users meet them.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use assert_cmd::Command;
use exr::prelude::{FlatSamples, ReadChannels, ReadLayers, read};
use tempfile::TempDir;

/// Exit status, stdout and stderr of a run in a folder.
fn run(folder: &TempDir, arguments: &[&str]) -> (Option<i32>, String, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_huygens"));
    let output = command.current_dir(folder.path()).args(arguments).output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    (output.status.code(), text(output.stdout), text(output.stderr))
}

#[track_caller]
fn succeeds(folder: &TempDir, arguments: &[&str]) -> (String, String) {
    let (status, stdout, stderr) = run(folder, arguments);
    assert_eq!(status, Some(0), "{arguments:?}: {stderr}");
    (stdout, stderr)
}

#[track_caller]
fn refuses(folder: &TempDir, arguments: &[&str], words: &[&str]) {
    let before = names(folder.path());
    let (status, stdout, stderr) = run(folder, arguments);
    assert_eq!((status, stdout.as_str(), stderr.lines().count()), (Some(2), "", 1), "{arguments:?}: {stderr}");
    for word in words {
        assert!(stderr.contains(word), "{arguments:?}: no `{word}` in {stderr}");
    }
    assert_eq!(names(folder.path()), before, "{arguments:?}");
}

fn names(folder: &Path) -> BTreeSet<String> {
    fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect()
}

fn channel(path: &Path, name: &str) -> Vec<f32> {
    let reader = read().no_deep_data().largest_resolution_level().all_channels().first_valid_layer().all_attributes();
    let layer = reader.from_file(path).unwrap().layer_data;
    let channel = layer.channel_data.list.into_iter().find(|channel| channel.name.eq(name)).unwrap();
    let FlatSamples::F32(samples) = channel.sample_data else { panic!("{name} is not 32 bits") };
    samples
}

fn json(path: &Path) -> serde_json::Value {
    serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap()
}

#[test]
fn a_reference_has_its_layers_and_its_variance_and_is_the_same_again() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let traced = ["reference", "builtin:column", "--size", "20x16", "--spp", "32", "-o"];
    let (stdout, note) = succeeds(&folder, &[&traced[..], &["a.exr", "--stats", "a.json"]].concat());
    assert_eq!(note, "");
    let (_, note) = succeeds(&folder, &[&traced[..], &["note.exr", "--set", "visibility=none"]].concat());
    assert!(note.contains("no influence on the path tracer"), "{note}");
    assert!(stdout.starts_with("wrote a.exr: 20x16, 32 paths a pixel in "), "{stdout}");
    for c in ["R", "G", "B"] {
        let [seen, direct, indirect, variance] =
            ["", "direct.", "indirect.", "variance."].map(|layer| channel(&path("a.exr"), &format!("{layer}{c}")));
        assert_eq!(seen.len(), 320);
        assert!((0..320).all(|i| (seen[i] - direct[i] - indirect[i]).abs() < 1e-5 * seen[i].max(1e-3)));
        assert!(indirect.iter().all(|&v| v > 0.0) && variance.iter().all(|&v| v > 0.0 && v.is_finite()));
    }
    let stats = json(&path("a.json"));
    assert_eq!(
        (&stats["samples"], &stats["bounces"], &stats["triangles"]),
        (&32.into(), &serde_json::Value::Null, &268.into())
    );

    succeeds(&folder, &[&traced[..], &["b.exr"]].concat());
    assert_eq!(fs::read(path("a.exr")).unwrap(), fs::read(path("b.exr")).unwrap());
    succeeds(&folder, &[&traced[..], &["c.exr", "--seed", "1"]].concat());
    assert_ne!(channel(&path("a.exr"), "R"), channel(&path("c.exr"), "R"));

    // No bounce, no indirect light; each further one adds some; a layer is what R, G and B are.
    let total = |bounces: &str| {
        succeeds(&folder, &[&traced[..], &["d.exr", "--layer", "indirect", "--bounces", bounces]].concat());
        channel(&path("d.exr"), "G").iter().sum::<f32>()
    };
    let [none, one, two, all] = ["0", "1", "2", "inf"].map(total);
    assert!(none == 0.0 && 0.0 < one && one < two && two < all, "{none} {one} {two} {all}");
    succeeds(&folder, &[&traced[..], &["e.png"]].concat());
    assert!(fs::read(path("e.png")).unwrap().starts_with(b"\x89PNG"));
}

#[test]
fn a_comparison_writes_pictures_numbers_and_a_page_and_keeps_its_reference() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let arguments = [
        "compare",
        "builtin:cornell",
        "-o",
        "out",
        "--size",
        "24x24",
        "--spp",
        "16",
        "--set",
        "wave.delta_theta=30",
        "--set",
        "wave.delta_phi=30",
        "--set",
        "ism.size=8",
        "--set",
        "ism.points=64",
        "--variant",
        "strong:strength=2,visibility=none",
    ];
    let techniques = ["direct", "ambient", "ambient-ao", "none", "ism", "ao", "dao", "shadow_maps", "mixed"];
    let list = ["--techniques", &techniques.join(",")];
    let (table, note) = succeeds(&folder, &[&arguments[..], &list].concat());
    assert_eq!(note, "");
    let metrics = json(&out.join("metrics.json"));
    let entries = metrics["techniques"].as_array().unwrap();
    let found: Vec<&str> = entries.iter().map(|entry| entry["name"].as_str().unwrap()).collect();
    assert_eq!(found, [&techniques[..], &["strong"]].concat());
    let of = |name: &str, key: &str| {
        let entry = entries.iter().find(|entry| entry["name"] == name).unwrap();
        entry[key].as_f64().unwrap_or_else(|| panic!("{name} {key}: {entry}"))
    };
    for name in &found {
        assert!(table.contains(name), "{table}");
        for key in ["flip", "hdr_flip", "ssim"] {
            assert!((0.0..=1.0).contains(&of(name, key)), "{name} {key}");
        }
        for ending in [".png", ".exr", "-flip.png"] {
            assert!(out.join(format!("{name}{ending}")).is_file(), "{name}{ending}");
        }
    }
    assert_eq!((of("direct", "energy_ratio"), of("direct", "relative_rmse")), (0.0, 1.0));
    // The scale that was found is at least as good as none.
    assert!(of("ambient", "flip") < of("direct", "flip") && of("ambient", "scale") > 0.0);
    assert!(
        of("ao", "energy_ratio") < of("none", "energy_ratio") && of("dao", "energy_ratio") < of("none", "energy_ratio")
    );
    assert!((of("strong", "energy_ratio") / of("none", "energy_ratio") - 2.0).abs() < 1e-3);
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    assert!(page.contains("\"flip\"") && page.contains("strong-flip.png") && !page.contains("REPORT_JSON"));
    assert!(!page.contains("http"), "the page asks for nothing from elsewhere");

    // Again: the reference is reused, for another camera it is not; what is not ours stays.
    fs::write(out.join("mine.txt"), "mine").unwrap();
    let (_, note) = succeeds(&folder, &[&arguments[..], &["--techniques", "direct"]].concat());
    assert!(note.contains("the reference is that of"), "{note}");
    let again = json(&out.join("metrics.json"));
    assert_eq!(again["reference"]["cached"], true);
    assert_eq!(again["techniques"][0]["flip"], entries[0]["flip"]);
    // One of more paths than are asked for is taken, one of fewer is not.
    let spp = arguments.iter().position(|argument| *argument == "16").unwrap();
    let with_paths = |paths| {
        let mut arguments = arguments.to_vec();
        arguments[spp] = paths;
        arguments.extend(["--techniques", "direct"]);
        succeeds(&folder, &arguments).1
    };
    assert!(with_paths("4").contains("the reference is that of out/reference.exr (16 paths a pixel)"));
    // 17 are rounded up to whole passes.
    assert!(with_paths("17").contains("of other settings (16 paths a pixel): will be replaced"));
    assert!(with_paths("17").contains("the reference is that of out/reference.exr (18 paths a pixel)"));
    let (_, note) = succeeds(&folder, &[&arguments[..], &["--techniques", "direct", "--fov", "50"]].concat());
    assert!(note.contains("of other settings (18 paths a pixel): will be replaced"), "{note}");
    fs::write(out.join("reference.exr"), "cut").unwrap();
    let words = ["out/reference.exr", "no reference of a comparison"];
    refuses(&folder, &[&arguments[..], &["--techniques", "direct", "--fov", "50"]].concat(), &words);
    assert_eq!(fs::read_to_string(out.join("reference.exr")).unwrap(), "cut");
    assert_eq!(fs::read_to_string(out.join("mine.txt")).unwrap(), "mine");
}

#[test]
fn two_files_are_compared() {
    let folder = tempfile::tempdir().unwrap();
    for (name, seed) in [("a.exr", "0"), ("b.exr", "1"), ("a.png", "0"), ("b.png", "1")] {
        let traced = ["reference", "builtin:cornell", "--size", "24x20", "--spp", "4", "--exposure", "-1"];
        succeeds(&folder, &[&traced[..], &["--seed", seed, "-o", name]].concat());
    }
    let (same, _) = succeeds(&folder, &["compare", "a.exr", "a.exr"]);
    assert!(
        same.lines()
            .nth(1)
            .unwrap()
            .split_whitespace()
            .eq(["a.exr", "0.0000", "0.0000", "1.000", "0.000", "1.000", "-"]),
        "{same}"
    );
    for (a, b) in [("a.exr", "b.exr"), ("a.png", "b.png")] {
        succeeds(&folder, &["compare", a, b, "-o", "out"]);
        succeeds(&folder, &["compare", a, b, "--stats", "stats.json"]);
        let metrics = json(&folder.path().join("out/metrics.json"));
        assert_eq!(metrics, json(&folder.path().join("stats.json")));
        let flip = metrics["flip"].as_f64().unwrap();
        assert!(0.0 < flip && flip < 0.5, "{flip}");
        assert_eq!(metrics["hdr_flip"].is_null(), a == "a.png");
        assert!(folder.path().join("out/flip.png").is_file());
    }
    // The second is what the first is held against.
    let once = ["reference", "builtin:cornell", "--size", "24x20", "--spp", "4", "--bounces", "1", "-o", "once.exr"];
    succeeds(&folder, &once);
    let energy = |a: &str, b: &str| {
        succeeds(&folder, &["compare", a, b, "--stats", "stats.json"]);
        json(&folder.path().join("stats.json"))["energy_ratio"].as_f64().unwrap()
    };
    assert!(energy("once.exr", "a.exr") < 0.9 && energy("a.exr", "once.exr") > 1.1);
}

#[test]
fn wrong_input_is_named() {
    let folder = tempfile::tempdir().unwrap();
    succeeds(&folder, &["reference", "builtin:cornell", "--size", "8x8", "--spp", "1", "-o", "a.exr"]);
    succeeds(&folder, &["reference", "builtin:cornell", "--size", "9x8", "--spp", "1", "-o", "b.exr"]);
    succeeds(&folder, &["reference", "builtin:cornell", "--size", "8x8", "--spp", "1", "-o", "a.png"]);
    let whole = fs::read(folder.path().join("a.exr")).unwrap();
    fs::write(folder.path().join("cut.exr"), &whole[..whole.len() / 2]).unwrap();
    // A file that says of itself to be of more pixels than there is memory for.
    let mut huge = whole.clone();
    let name = b"dataWindow\0box2i\0";
    let found = huge.windows(name.len()).position(|window| window == name).unwrap() + name.len();
    huge[found + 4..][8..16].copy_from_slice(&[0xff, 0xff, 0xff, 0x0f].repeat(2));
    fs::write(folder.path().join("huge.exr"), huge).unwrap();
    fs::write(folder.path().join("text.png"), "no picture").unwrap();
    for (arguments, words) in [
        (&["compare", "builtin:cornell"][..], &["--output DIR"][..]),
        (&["compare", "builtin:cornell", "-o", "no/such"], &["no/such", "does not exist"]),
        (&["compare", "builtin:cornell", "-o", "a.exr"], &["a.exr", "it is a file"]),
        (&["compare", "builtin:cornell", "-o", "x", "--techniques", "magic"], &["magic", "allowed", "shadow_maps"]),
        (&["compare", "builtin:cornell", "-o", "x", "--variant", "a/b:strength=1"], &["a/b", "LABEL"]),
        (&["compare", "builtin:cornell", "-o", "x", "--variant", "a:strengt=1"], &["strengt", "strength"]),
        (&["compare", "builtin:cornell", "-o", "x", "--variant", "wave:strength=1"], &["wave", "taken"]),
        (&["compare", "builtin:cornell", "-o", "x", "--layer", "albedo"], &["--layer albedo", "final"]),
        (&["compare", "builtin:cornell", "-o", "x", "--variant", "ism-flip:strength=1"], &["ism-flip", "taken"]),
        (&["compare", "a.exr"], &["a.exr", "second"]),
        (&["compare", "a.exr", "a.exr", "--spp", "4"], &["--spp", "no influence"]),
        (&["compare", "a.exr", "a.exr", "--size", "8x8"], &["--size", "no influence"]),
        (&["compare", "a.exr", "a.exr", "--device", "0"], &["--device", "no influence"]),
        (&["compare", "a.exr", "a.exr", "--variant", "a:strength=1"], &["--variant ", "no influence"]),
        (&["compare", "builtin:cornell", "-o", "x", "--size", "7680x4320"], &["--size", "7680x4320", "28 million"]),
        (&["compare", "builtin:cornell", "-o", "x", "--stats", "x"], &["--stats x", "the same file"]),
        (
            &[
                "compare",
                "builtin:cornell",
                "-o",
                "x",
                "--variant",
                "a:wave.delta_theta=1,wave.delta_phi=1,ism.size=128",
            ],
            &["ism.size", "do not fit"],
        ),
        (&["compare", "huge.exr", "huge.exr"], &["huge.exr", "too many"]),
        (&["reference", "-o", "a.exr", "--stats", "/dev/stdout"], &["/dev/stdout", "not a regular file"]),
        (&["compare", "a.exr", "b.exr"], &["b.exr", "9x8", "8x8"]),
        (&["compare", "a.exr", "a.png"], &["a.png", "another format"]),
        (&["compare", "a.exr", "none.exr"], &["none.exr"]),
        (&["compare", "a.exr", "cut.exr"], &["cut.exr", "OpenEXR"]),
        (&["compare", "text.png", "a.png"], &["text.png", "PNG"]),
        (&["reference", "-o", "x.jpg"], &["x.jpg", ".exr"]),
        (&["reference", "-o", "x.exr", "--spp", "0"], &["--spp", "1 to 1048576"]),
        (&["reference", "-o", "x.exr", "--bounces", "-1"], &["--bounces", "inf"]),
        (&["reference", "-o", "x.exr", "--layer", "depth"], &["--layer depth", "indirect"]),
        (&["reference", "-o", "x.exr", "--set", "strengt=1"], &["strengt", "strength"]),
    ] {
        refuses(&folder, arguments, words);
    }
}

/// A room of one floor under one light, whose only texture is a file named like one of a comparison.
fn floor(folder: &Path, texture: &str, base_color: [f32; 4], intensity: f32) {
    let numbers: [f32; 20] = [-2., 0., -2., -2., 0., 2., 2., 0., 2., 2., 0., -2., 0., 0., 0., 1., 1., 1., 1., 0.];
    let mut bytes: Vec<u8> = numbers.iter().flat_map(|n| n.to_le_bytes()).collect();
    bytes.extend([0u16, 1, 2, 0, 2, 3].iter().flat_map(|n| n.to_le_bytes()));
    fs::write(folder.join("floor.bin"), bytes).unwrap();
    let white = image::RgbaImage::from_pixel(2, 2, image::Rgba([255; 4]));
    white.save(folder.join(texture)).unwrap();
    let json = serde_json::json!({
        "asset": {"version": "2.0"},
        "extensionsUsed": ["KHR_lights_punctual"],
        "extensions": {"KHR_lights_punctual": {"lights": [{"type": "point", "intensity": intensity}]}},
        "scenes": [{"nodes": [0, 1]}],
        "nodes": [{"mesh": 0}, {"translation": [0, 1, 0], "extensions": {"KHR_lights_punctual": {"light": 0}}}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0}]}],
        "materials": [{"pbrMetallicRoughness":
            {"baseColorFactor": base_color, "baseColorTexture": {"index": 0}, "metallicFactor": 0}}],
        "textures": [{"source": 0}],
        "images": [{"uri": texture}],
        "buffers": [{"uri": "floor.bin", "byteLength": 92}],
        "bufferViews": [{"buffer": 0, "byteLength": 48}, {"buffer": 0, "byteOffset": 48, "byteLength": 32},
            {"buffer": 0, "byteOffset": 80, "byteLength": 12}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [-2, 0, -2], "max": [2, 0, 2]},
            {"bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC2"},
            {"bufferView": 2, "componentType": 5123, "count": 6, "type": "SCALAR"}],
    });
    fs::write(folder.join("floor.gltf"), json.to_string()).unwrap();
}

/// Every file that a comparison would write is checked before anything is traced.
#[test]
fn a_comparison_replaces_nothing_that_it_reads() {
    let folder = tempfile::tempdir().unwrap();
    floor(folder.path(), "none.png", [1.0; 4], 1.0);
    fs::create_dir(folder.path().join("sub")).unwrap();
    fs::create_dir(folder.path().join("sub/report.html")).unwrap();
    let (line, _) = succeeds(&folder, &["reference", "--size", "8x8", "--spp", "1", "-o", "b.png"]);
    assert!(line.starts_with("wrote b.png: 8x8, 1 path a pixel in "), "{line}");
    // With flip.png and a metrics.json that make this the folder of a comparison.
    succeeds(&folder, &["compare", "b.png", "b.png", "-o", "."]);
    let small = ["--size", "8x8", "--spp", "1", "--techniques", "none"];
    for (arguments, words) in [
        (&["compare", "floor.gltf", "-o", "."][..], &["none.png", "the scene is made of"][..]),
        (&["compare", "floor.gltf", "-o", "sub"], &["sub/report.html", "it is a folder"]),
        (&["compare", "builtin:cornell", "-o", ".", "--stats", "report.html"], &["report.html", "the same file"]),
        (&["compare", "builtin:cornell", "-o", ".", "--stats", "none-flip.png"], &["none-flip.png", "the same file"]),
    ] {
        let before = fs::read(folder.path().join("none.png")).unwrap();
        refuses(&folder, &[arguments, &small].concat(), words);
        assert_eq!(fs::read(folder.path().join("none.png")).unwrap(), before);
    }
    refuses(&folder, &["compare", "flip.png", "b.png", "-o", "."], &["flip.png", "replace a file that is read"]);
    refuses(&folder, &["compare", "b.png", "flip.png", "-o", "."], &["flip.png", "replace a file that is read"]);
    refuses(&folder, &["compare", "b.png", "flip.png", "--stats", "b.png"], &["--stats b.png", "is read"]);
}

/// Only the folder of a comparison has files that may be replaced.
#[test]
fn a_comparison_replaces_only_files_of_another() {
    let folder = tempfile::tempdir().unwrap();
    succeeds(&folder, &["reference", "--size", "8x8", "--spp", "1", "-o", "b.png"]);
    let out = folder.path().join("out");
    let scene = ["compare", "builtin:cornell", "--size", "8x8", "--spp", "1", "--techniques", "none", "-o", "out"];
    let pictures = ["compare", "b.png", "b.png", "-o", "out"];
    let of_scene = ["none.png", "none.exr", "none-flip.png", "reference.png", "report.html", "metrics.json"];
    for (arguments, names) in [(&scene[..], &of_scene[..]), (&pictures, &["flip.png", "metrics.json"])] {
        for name in names {
            fs::create_dir(&out).unwrap();
            fs::write(out.join(name), "{}").unwrap();
            refuses(&folder, arguments, &[&format!("out/{name}"), "of a comparison", "another folder"]);
            assert_eq!(fs::read_to_string(out.join(name)).unwrap(), "{}");
            assert_eq!(fs::read_dir(&out).unwrap().count(), 1);
            fs::remove_dir_all(&out).unwrap();
        }
    }
    // One of two pictures is followed by one of a scene, and that by another of the pictures.
    for arguments in [&pictures[..], &scene, &pictures] {
        succeeds(&folder, arguments);
    }
}

/// A dim light on what reflects nothing: neither an ambient term nor HDR-FLIP has anything to go by.
#[test]
fn a_black_and_dim_scene_is_compared() {
    let folder = tempfile::tempdir().unwrap();
    floor(folder.path(), "white.png", [0.0, 0.0, 0.0, 1.0], 1e-9);
    let arguments = ["compare", "floor.gltf", "-o", "out", "--size", "16x16", "--spp", "4", "--eye", "0,2,2"];
    let target = ["--target", "0,0,0", "--techniques", "direct,ambient,ambient-ao", "--stats", "stats.json"];
    succeeds(&folder, &[&arguments[..], &target].concat());
    let stats = json(&folder.path().join("stats.json"));
    for entry in stats["techniques"].as_array().unwrap() {
        assert!(entry["flip"].as_f64().unwrap() < 0.05 && entry["hdr_flip"].is_number(), "{entry}");
        assert!(entry["name"] == "direct" || entry["scale"] == 0.0, "{entry}");
    }
}

/// A variant's settings of shadows count for its direct light too, and a reference is believed by what it says itself.
#[test]
fn direct_light_is_that_of_the_variant_and_the_reference_that_of_the_scene() {
    let folder = tempfile::tempdir().unwrap();
    let small = ["--size", "32x32", "--spp", "2", "--techniques", "none", "-o", "out"];
    let variants =
        ["--variant", "same:visibility=none", "--variant", "soft:visibility=none,shadow.size=64,shadow.filter=8"];
    let scene = ["compare", "builtin:column", "--set", "wave.delta_theta=30", "--set", "wave.delta_phi=30"];
    succeeds(&folder, &[&scene[..], &small, &variants].concat());
    let [none, same, soft] = ["none", "same", "soft"].map(|name| {
        let path = folder.path().join(format!("out/{name}.exr"));
        let (seen, indirect) = (channel(&path, "G"), channel(&path, "indirect.G"));
        seen.into_iter().zip(indirect).map(|(seen, indirect)| seen - indirect).collect::<Vec<f32>>()
    });
    assert_eq!(none, same);
    let worst = none.iter().zip(&soft).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    let brightest = none.iter().copied().fold(0.0, f32::max);
    assert!(worst > 0.1 * brightest, "{worst} of {brightest}");

    let (_, note) = succeeds(&folder, &[&scene[..], &small].concat());
    assert!(note.contains("the reference is that of"), "{note}");
    // One of another seed is not taken for it, and what is no reference at all is not replaced.
    let (_, note) = succeeds(&folder, &[&scene[..], &small, &["--seed", "1"]].concat());
    assert!(note.contains("of other settings (2 paths a pixel): will be replaced"), "{note}");
    succeeds(&folder, &["reference", "--size", "32x32", "--spp", "2", "-o", "out/reference.exr"]);
    refuses(&folder, &[&scene[..], &small].concat(), &["out/reference.exr", "no reference of a comparison"]);
}

/// Where the error of the VPLs comes from, told only where it can be.
#[test]
fn ray_cast_tells_the_steps_of_the_error() {
    let folder = tempfile::tempdir().unwrap();
    let scene =
        ["compare", "builtin:cornell", "--size", "16x16", "--spp", "16", "-o", "out", "--techniques", "ray_cast"];
    let coarse = ["--set", "model=reflected", "--set", "wave.delta_theta=30", "--set", "wave.delta_phi=30"];
    let (table, _) = succeeds(&folder, &[&scene[..], &coarse].concat());
    assert!(table.contains("where the error comes from"), "{table}");
    let metrics = json(&folder.path().join("out/metrics.json"));
    // However bad the shadow map, it has no part in the technique, only in its own step.
    succeeds(&folder, &[&scene[..], &coarse, &["--set", "shadow.size=64", "--set", "shadow.filter=8"]].concat());
    let blocks = json(&folder.path().join("out/metrics.json"));
    let flips = |of: &serde_json::Value| [&of["techniques"][0], &of["steps"][4]].map(|m| m["flip"].as_f64().unwrap());
    let [fine, coarse_map] = [flips(&metrics), flips(&blocks)];
    assert_eq!(fine[0], coarse_map[0]);
    assert!(coarse_map[1] > 2.0 * fine[1], "{fine:?} {coarse_map:?}");
    let steps = metrics["steps"].as_array().unwrap();
    let names: Vec<&str> = steps.iter().map(|step| step["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["VPLs", "bound", "visibility", "gather", "direct"]);
    // The first steps lead from the reference to the rays, the last ones are of the same sum.
    let energy = |i: usize| steps[i]["energy_ratio"].as_f64().unwrap();
    let whole = metrics["techniques"][0]["energy_ratio"].as_f64().unwrap();
    assert_eq!(energy(4), 1.0);
    assert!((energy(0) * energy(1) / whole - 1.0).abs() < 1e-3, "{} {} {whole}", energy(0), energy(1));
    assert!((energy(3) - 1.0).abs() < 0.01, "{}", energy(3));
    let fresh = ["compare", "-o", "fresh", "--frames", "2", "--techniques", "ray_cast"];
    refuses(&folder, &fresh, &["ray_cast", "--frames 1"]);
}

/// A first interrupt ends the tracing and keeps what there is.
#[test]
#[cfg(unix)]
fn an_interrupted_reference_is_what_has_been_averaged() {
    let folder = tempfile::tempdir().unwrap();
    // Until some of the 16384 passes of 64 × 16 × 16 paths are done, however busy the machine is.
    for delay in [1, 2, 4, 8, 16, 32] {
        let mut child = std::process::Command::new(env!("CARGO_BIN_EXE_huygens"))
            .args(["reference", "builtin:cornell", "--size", "16x16", "--spp", "1048576", "-o", "a.exr"])
            .current_dir(folder.path())
            .stderr(std::process::Stdio::piped())
            .spawn()
            .unwrap();
        std::thread::sleep(std::time::Duration::from_secs(delay));
        assert!(std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
        let status = child.wait().unwrap();
        if !folder.path().join("a.exr").is_file() {
            continue;
        }
        let mut line = String::new();
        std::io::Read::read_to_string(&mut child.stderr.take().unwrap(), &mut line).unwrap();
        assert_eq!(status.code(), Some(130), "{line}");
        assert!(line.contains("interrupted: the picture has ") && line.contains("of 1048576 paths"), "{line}");
        assert!(channel(&folder.path().join("a.exr"), "G").iter().any(|&v| v > 0.0));
        return;
    }
    panic!("no pass in half a minute");
}
