//! Loading glTF: every feature with a closed-form expectation, every error, and thousands of broken files.

use std::f32::consts::{FRAC_1_SQRT_2, FRAC_PI_2, FRAC_PI_4, PI};
use std::fs;
use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use glam::{Mat4, Vec2, Vec3, Vec4};
use huygens::camera::Projection;
use huygens::scene::{AlphaMode, Sampler, TextureRef, Wrap};
use huygens::surfel::Surfels;
use huygens::{Error, Profile, Scene};
use image::{DynamicImage, ImageBuffer, ImageFormat, Luma, LumaA, Rgb};
use serde_json::{Value, json};
use tempfile::TempDir;

const F32: u32 = 5126;
const U32: u32 = 5125;
const U16: u32 = 5123;
const I16: u32 = 5122;
const U8: u32 = 5121;
const I8: u32 = 5120;

/// A glTF file under construction: JSON and one buffer.
struct Doc {
    json: Value,
    bin: Vec<u8>,
}

fn f32s(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

fn u16s(values: &[u16]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

impl Doc {
    fn new() -> Self {
        let json = json!({
            "asset": {"version": "2.0"}, "buffers": [], "bufferViews": [], "accessors": [], "meshes": [],
            "materials": [], "textures": [], "images": [], "samplers": [], "nodes": [], "scenes": [], "cameras": [],
            "skins": [], "animations": [],
        });
        Self { json, bin: Vec::new() }
    }

    fn push(&mut self, list: &str, value: Value) -> usize {
        let list = self.json[list].as_array_mut().unwrap();
        list.push(value);
        list.len() - 1
    }

    fn view(&mut self, bytes: &[u8]) -> usize {
        let offset = self.bin.len();
        self.bin.extend(bytes);
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        self.push("bufferViews", json!({"buffer": 0, "byteOffset": offset, "byteLength": bytes.len()}))
    }

    fn accessor(&mut self, bytes: &[u8], component: u32, kind: &str, count: usize) -> usize {
        let view = self.view(bytes);
        self.push("accessors", json!({"bufferView": view, "componentType": component, "type": kind, "count": count}))
    }

    fn floats(&mut self, kind: &str, values: &[f32]) -> usize {
        let width = ["SCALAR", "VEC2", "VEC3", "VEC4"].iter().position(|k| *k == kind).unwrap() + 1;
        self.accessor(&f32s(values), F32, kind, values.len() / width)
    }

    /// Adds a mesh of one primitive on a node at the origin.
    fn draw(&mut self, primitive: Value) {
        let mesh = self.push("meshes", json!({"name": "mesh", "primitives": [primitive]}));
        self.push("nodes", json!({"mesh": mesh}));
    }

    fn primitive(&mut self) -> &mut Value {
        &mut self.json["meshes"][0]["primitives"][0]
    }

    /// One triangle (0,0,0) (1,0,0) (0,1,0).
    fn triangle() -> Self {
        let mut doc = Self::new();
        let positions = doc.floats("VEC3", &[0., 0., 0., 1., 0., 0., 0., 1., 0.]);
        doc.draw(json!({"attributes": {"POSITION": positions}}));
        doc
    }

    /// A quad in the xy plane facing +z, texture coordinates with v down, and a material whose textures are a 1×1 PNG.
    fn with_material(material: Value) -> Self {
        let mut doc = Self::new();
        let positions = doc.floats("VEC3", &[0., 0., 0., 1., 0., 0., 1., 1., 0., 0., 1., 0.]);
        let normals = doc.floats("VEC3", &[0., 0., 1.].repeat(4));
        let uvs = doc.floats("VEC2", &[0., 1., 1., 1., 1., 0., 0., 0.]);
        let indices = doc.accessor(&u16s(&[0, 1, 2, 0, 2, 3]), U16, "SCALAR", 6);
        doc.draw(json!({"indices": indices, "material": 0, "attributes":
            {"POSITION": positions, "NORMAL": normals, "TEXCOORD_0": uvs}}));
        doc.push("materials", material);
        doc.push("images", json!({"uri": "a.png"}));
        doc.push("textures", json!({"source": 0}));
        doc
    }

    /// Adds a skin without inverse bind matrices, and joints and weights of the first primitive.
    fn skin(&mut self, joints: &[u8], weights: &[f32], nodes: &[usize]) {
        let joints = self.accessor(joints, U8, "VEC4", joints.len() / 4);
        let weights = self.floats("VEC4", weights);
        self.primitive()["attributes"]["JOINTS_0"] = json!(joints);
        self.primitive()["attributes"]["WEIGHTS_0"] = json!(weights);
        self.push("skins", json!({"joints": nodes}));
    }

    /// Adds a channel of float values to the last animation, or to a first one.
    fn animate(&mut self, times: usize, interpolation: &str, node: usize, path: &str, values: &[f32]) {
        let kind = ["VEC3", "VEC4", "SCALAR"][usize::from(path == "rotation") + 2 * usize::from(path == "weights")];
        let output = self.floats(kind, values);
        if self.json["animations"].as_array().unwrap().is_empty() {
            self.push("animations", json!({"channels": [], "samplers": []}));
        }
        let animation = self.json["animations"].as_array_mut().unwrap().last_mut().unwrap();
        let samplers = animation["samplers"].as_array_mut().unwrap();
        samplers.push(json!({"input": times, "interpolation": interpolation, "output": output}));
        let sampler = samplers.len() - 1;
        let channels = animation["channels"].as_array_mut().unwrap();
        channels.push(json!({"sampler": sampler, "target": {"node": node, "path": path}}));
    }

    fn value(&self) -> Value {
        let mut json = self.json.clone();
        if !self.bin.is_empty() {
            json["buffers"] = json!([{"uri": "data.bin", "byteLength": self.bin.len()}]);
        }
        // Empty lists are not allowed by the schema.
        json.as_object_mut().unwrap().retain(|_, v| v.as_array().is_none_or(|a| !a.is_empty()));
        json
    }

    fn gltf(&self) -> String {
        self.value().to_string()
    }

    fn glb(&self) -> Vec<u8> {
        let mut json = self.value();
        json["buffers"] = json!([{"byteLength": self.bin.len()}]);
        glb(&json, &self.bin)
    }

    fn embedded(&self) -> String {
        let mut json = self.value();
        json["buffers"][0]["uri"] = json!(format!("data:application/octet-stream;base64,{}", base64(&self.bin)));
        json.to_string()
    }

    fn write(&self) -> (TempDir, PathBuf) {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("scene.gltf");
        fs::write(&path, self.gltf()).unwrap();
        fs::write(dir.path().join("data.bin"), &self.bin).unwrap();
        fs::write(dir.path().join("a.png"), png(&DynamicImage::new_rgba8(1, 1))).unwrap();
        (dir, path)
    }

    #[track_caller]
    fn load(&self) -> Scene {
        let (_dir, path) = self.write();
        let scene = Scene::load(path).unwrap();
        check(&scene);
        scene
    }

    /// The text of the error; checks that it is one line and names the file.
    #[track_caller]
    fn error(&self) -> String {
        let (_dir, path) = self.write();
        error_of(&path)
    }
}

fn glb(json: &Value, bin: &[u8]) -> Vec<u8> {
    let mut json = json.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut out = b"glTF".to_vec();
    out.extend(2_u32.to_le_bytes());
    out.extend((12 + 8 + json.len() as u32 + 8 + bin.len() as u32).to_le_bytes());
    out.extend((json.len() as u32).to_le_bytes());
    out.extend(b"JSON");
    out.extend(&json);
    out.extend((bin.len() as u32).to_le_bytes());
    out.extend(b"BIN\0");
    out.extend(bin);
    out
}

fn png(image: &DynamicImage) -> Vec<u8> {
    encoded(image, ImageFormat::Png)
}

fn encoded(image: &DynamicImage, format: ImageFormat) -> Vec<u8> {
    let mut out = Cursor::new(Vec::new());
    image.write_to(&mut out, format).unwrap();
    out.into_inner()
}

fn base64(bytes: &[u8]) -> String {
    const LETTERS: &[u8] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut out = String::new();
    for chunk in bytes.chunks(3) {
        let word = chunk.iter().fold(0_u32, |w, &b| w << 8 | u32::from(b)) << (8 * (3 - chunk.len()));
        (0..=chunk.len()).for_each(|i| out.push(char::from(LETTERS[(word >> (18 - 6 * i) & 63) as usize])));
        (chunk.len()..3).for_each(|_| out.push('='));
    }
    out
}

#[track_caller]
fn error_of(path: &Path) -> String {
    let error = Scene::load(path).expect_err("this file must be refused");
    assert!(matches!(&error, Error::File { path: p, .. } if p == path), "{error:?}");
    assert!(error.is_bad_input());
    let text = error.to_string();
    assert!(!text.chars().any(char::is_control), "more than one line: {text:?}");
    assert!(text.contains("allowed"), "{text}");
    assert!(text.contains(&*path.file_name().unwrap().to_string_lossy()), "{text}");
    text
}

#[track_caller]
fn assert_says(text: &str, words: &[&str]) {
    words.iter().for_each(|word| assert!(text.contains(word), "`{word}` is not in: {text}"));
}

#[track_caller]
fn assert_near(a: Vec3, b: Vec3) {
    assert!((a - b).length() < 1e-5, "{a} is not {b}");
}

/// What loading promises: every index valid, every number finite.
#[track_caller]
fn check(scene: &Scene) {
    for i in &scene.instances {
        assert!(i.world_from_object.is_finite() && i.mesh < scene.meshes.len());
    }
    for m in &scene.meshes {
        let n = m.positions.len();
        assert!(m.material < scene.materials.len() && m.indices.iter().all(|&i| (i as usize) < n));
        assert!(m.normals.len() == n && m.positions.iter().all(|p| p.is_finite()));
        assert!(m.normals.iter().all(|n| n.is_normalized()));
        assert!(m.tangents.iter().all(|t| t.truncate().is_normalized() && t.w.abs() == 1.0), "{:?}", m.tangents);
        let right = m.tangents.iter().zip(&m.normals).all(|(t, n)| t.truncate().dot(*n).abs() < 1e-3);
        assert!(right, "{:?} {:?}", m.tangents, m.normals);
        assert!([m.tangents.len(), m.uvs[0].len(), m.uvs[1].len(), m.colors.len()].iter().all(|&l| l == 0 || l == n));
        assert!(m.uvs.iter().flatten().all(|uv| uv.is_finite()));
        assert_eq!(m.tangents.is_empty(), scene.materials[m.material].normal_texture.is_none());
    }
    assert!(scene.textures.iter().all(|t| t.image < scene.images.len()));
    assert!(scene.images.iter().all(|i| i.rgba.len() == (i.width * i.height * 4) as usize));
    assert!(scene.lights.iter().all(|l| l.intensity.is_finite() && l.axis.is_normalized()));
    for c in &scene.cameras {
        assert!(c.forward.is_normalized() && c.up.is_normalized() && c.up.dot(c.forward).abs() < 1e-5);
    }
    assert!(scene.bounds().is_none_or(|b| b.radius().is_finite()));
    assert!(scene.warnings.iter().all(|w| !w.chars().any(char::is_control)));
}

/// Knuth's linear congruential generator.
struct Random(u64);

impl Random {
    fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 33) as usize % n
    }
}

// Containers

#[test]
fn a_triangle_in_every_container() {
    let doc = Doc::triangle();
    let dir = tempfile::tempdir().unwrap();
    let mut escaped = doc.value();
    escaped["buffers"][0]["uri"] = json!("sub%20dir/../sub%20dir/%64ata%2Ebin");
    fs::create_dir(dir.path().join("sub dir")).unwrap();
    fs::write(dir.path().join("sub dir/data.bin"), &doc.bin).unwrap();
    fs::write(dir.path().join("data.bin"), &doc.bin).unwrap();
    for (name, bytes) in [
        ("external.gltf", doc.gltf().into_bytes()),
        ("embedded.gltf", doc.embedded().into_bytes()),
        ("escaped.gltf", escaped.to_string().into_bytes()),
        ("binary.glb", doc.glb()),
    ] {
        let path = dir.path().join(name);
        fs::write(&path, bytes).unwrap();
        let scene = Scene::load(&path).unwrap();
        assert_eq!(scene.name, name);
        assert_eq!(scene.triangle_count(), 1, "{name}");
        assert_eq!(scene.meshes[0].positions, [Vec3::ZERO, Vec3::X, Vec3::Y], "{name}");
        assert_eq!(scene.meshes[0].normals, [Vec3::Z; 3], "{name}");
        assert_eq!(scene.meshes[0].name, "mesh");
        assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    }
}

#[test]
fn a_scene_without_triangles_loads() {
    let scene = Doc::new().load();
    assert!(scene.instances.is_empty() && scene.bounds().is_none());
}

// Nodes

#[test]
fn transforms_multiply_down_the_tree() {
    let mut doc = Doc::triangle();
    let turn = [0., FRAC_1_SQRT_2, 0., FRAC_1_SQRT_2]; // 90° about y: x → −z
    doc.json["nodes"] = json!([
        {"children": [1, 2], "translation": [10, 0, 0], "rotation": turn},
        {"mesh": 0, "translation": [1, 0, 0], "scale": [2, 3, 4]},
        {"mesh": 0, "matrix": [-1,0,0,0, 0,1,0,0, 0,0,1,0, 0,5,0,1]},
    ]);
    let scene = doc.load();
    assert_eq!((scene.instances.len(), scene.meshes.len(), scene.triangle_count()), (2, 1, 2));
    let at = |i: usize, p| scene.instances[i].world_from_object.transform_point3(p);
    assert_near(at(0, Vec3::ZERO), Vec3::new(10., 0., -1.));
    assert_near(at(0, Vec3::X), Vec3::new(10., 0., -3.));
    assert_near(at(0, Vec3::Y), Vec3::new(10., 3., -1.));
    assert_near(at(0, Vec3::Z), Vec3::new(14., 0., -1.));
    assert_near(at(1, Vec3::X), Vec3::new(10., 5., 1.));
    assert!(scene.instances[1].world_from_object.determinant() < 0.0, "the mirroring stays in the matrix");
}

#[test]
fn scenes_are_chosen() {
    let mut doc = Doc::triangle();
    doc.json["nodes"] = json!([{"mesh": 0, "translation": [0, 0, 0]}, {"mesh": 0, "translation": [7, 0, 0]}]);
    assert_eq!(doc.load().instances.len(), 2, "no scenes: all roots");
    doc.json["scenes"] = json!([{"nodes": [0]}, {"nodes": [1]}]);
    assert_eq!(doc.load().instances[0].world_from_object, Mat4::IDENTITY, "no default: the first");
    assert_eq!(doc.load().warnings, ["scene 0 of the file is drawn, its other scenes (1) are not"]);
    doc.json["scene"] = json!(1);
    assert_eq!(doc.load().warnings, ["scene 1 of the file is drawn, its other scenes (1) are not"]);
    assert_eq!(doc.load().instances[0].world_from_object.w_axis.x, 7.0);
    doc.json["scene"] = json!(5);
    assert_says(&doc.error(), &["scene 5", "out of range", "below 2"]);
    // A scene may be empty, drawn or not.
    doc.json["scenes"] = json!([{"nodes": [1]}, {"name": "empty"}]);
    let (dir, _) = doc.write();
    let path = dir.path().join("scene.glb");
    for (scene, drawn) in [(0, 1), (1, 0)] {
        doc.json["scene"] = json!(scene);
        assert_eq!(doc.load().instances.len(), drawn);
        fs::write(&path, doc.glb()).unwrap();
        assert_eq!(Scene::load(&path).unwrap().instances.len(), drawn);
    }
}

#[test]
fn a_chain_of_100_000_nodes_is_walked() {
    let mut doc = Doc::triangle();
    let n = 100_000;
    let mut nodes: Vec<_> = (0..n - 1).map(|i| json!({"children": [i + 1], "translation": [0.01, 0, 0]})).collect();
    nodes.push(json!({"mesh": 0}));
    doc.json["nodes"] = json!(nodes);
    let start = Instant::now();
    let x = doc.load().instances[0].world_from_object.w_axis.x;
    assert!((x - 999.99).abs() < 1e-2, "{x}");
    assert!(start.elapsed() < Duration::from_secs(20));
}

#[test]
fn broken_trees_are_refused() {
    let mut doc = Doc::triangle();
    doc.json["nodes"] = json!([{"mesh": 0}, {"children": [2]}, {"children": [3]}, {"children": [1]}]);
    assert_says(&doc.error(), &["cycle"]);
    doc.json["nodes"] = json!([{"mesh": 0, "children": [0]}]);
    assert_says(&doc.error(), &["cycle"]);
    doc.json["nodes"] = json!([{"children": [2]}, {"children": [2]}, {"mesh": 0}]);
    assert_says(&doc.error(), &["node 2", "two parents"]);
    doc.json["nodes"] = json!([{"children": [9]}]);
    assert_says(&doc.error(), &["node 9", "out of range"]);
    doc.json["nodes"] = json!([{"mesh": 3}]);
    assert_says(&doc.error(), &["mesh 3", "out of range"]);
    doc.json["nodes"] = json!([{"children": [1]}, {"mesh": 0}]);
    doc.json["scenes"] = json!([{"nodes": [0, 1]}]);
    assert_says(&doc.error(), &["node 1", "roots"]);
}

#[test]
fn transforms_that_are_not_finite_are_refused() {
    for node in [
        json!({"mesh": 0, "translation": [1e39, 0, 0]}),
        json!({"mesh": 0, "scale": [1, 1e39, 1]}),
        json!({"mesh": 0, "rotation": [0, 1e39, 0, 1]}),
        json!({"mesh": 0, "matrix": [1e39,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1]}),
        json!({"mesh": 0, "matrix": [1,0,0,0.5, 0,1,0,0, 0,0,1,0, 0,0,0,1]}),
        json!({"mesh": 0, "translation": [1e30, 0, 0]}),
        json!({"mesh": 0, "scale": [1e30, 1e30, 1e30]}),
    ] {
        let mut doc = Doc::triangle();
        doc.json["nodes"] = json!([node]);
        assert_says(&doc.error(), &["node 0"]);
    }
    // Beyond what JSON numbers are read as.
    let text = Doc::triangle().gltf().replace(r#"{"mesh":0}"#, r#"{"mesh":0,"translation":[1e400,0,0]}"#);
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("x.gltf"), text).unwrap();
    assert_says(&error_of(&dir.path().join("x.gltf")), &["number"]);
}

#[test]
fn a_small_scene_far_from_the_origin_is_warned_of() {
    for (x, lines) in [(500.0, 0), (5000.0, 1)] {
        let mut doc = Doc::triangle();
        doc.json["nodes"] = json!([{"mesh": 0, "translation": [x, 0, 0]}]);
        let warnings = doc.load().warnings;
        assert_eq!(warnings.len(), lines, "{warnings:?}");
        warnings.iter().for_each(|warning| assert_says(warning, &["5000 m", "6e-4 m"]));
    }
}

#[test]
fn a_tiny_scene_is_refused() {
    let mut doc = Doc::triangle();
    for (scale, allowed) in [(2e-6, true), (1e-6, false), (1e-10, false)] {
        doc.json["nodes"] = json!([{"mesh": 0, "scale": [scale, scale, scale]}]);
        match allowed {
            true => assert!(doc.load().warnings.is_empty()),
            false => assert_says(&doc.error(), &["radius", "e-", "allowed: 1e-6 m"]),
        }
    }
}

#[test]
fn a_scene_of_degenerate_triangles_is_warned_of() {
    let mut doc = Doc::triangle();
    for positions in [[1.0; 9], [0., 0., 0., 1., 2., 3., 2., 4., 6.]] {
        doc.bin[..36].copy_from_slice(&f32s(&positions));
        assert_eq!(doc.load().warnings, ["all triangles of the scene are degenerate; there is only background"]);
    }
    // One that is none is enough.
    let positions = doc.floats("VEC3", &[0., 0., 0., 1., 0., 0., 0., 1., 0.]);
    doc.draw(json!({"attributes": {"POSITION": positions}}));
    assert!(doc.load().warnings.is_empty());
}

#[test]
fn zero_scale_hides() {
    let mut doc = Doc::triangle();
    doc.json["nodes"] = json!([{"mesh": 0, "scale": [0, 0, 0]}]);
    let scene = doc.load();
    assert!(scene.instances.is_empty());
    assert_says(&scene.warnings[0], &["zero", "not drawn: node 0"]);
}

// Geometry

#[test]
fn lists_strips_and_fans_with_their_winding() {
    let corners: Vec<f32> = (0..5).flat_map(|i| [i as f32, (i % 2) as f32, (i * i) as f32]).collect();
    let expected: [(u32, &[u32]); 3] =
        [(4, &[0, 1, 2]), (5, &[0, 1, 2, 1, 3, 2, 2, 3, 4]), (6, &[1, 2, 0, 2, 3, 0, 3, 4, 0])];
    for (mode, expected) in expected {
        for indexed in [false, true] {
            let mut doc = Doc::new();
            let (p, n) = (doc.floats("VEC3", &corners), doc.floats("VEC3", &[0., 0., 1.].repeat(5)));
            let mut primitive = json!({"attributes": {"POSITION": p, "NORMAL": n}, "mode": mode});
            if indexed {
                primitive["indices"] = json!(doc.accessor(&u16s(&[4, 3, 2, 1, 0]), U16, "SCALAR", 5));
            }
            doc.draw(primitive);
            let scene = doc.load();
            let want: Vec<f32> = expected.iter().map(|&i| if indexed { 4 - i } else { i } as f32).collect();
            let mesh = &scene.meshes[0];
            let got: Vec<f32> = mesh.indices.iter().map(|&i| mesh.positions[i as usize].x).collect();
            assert_eq!(got, want, "mode {mode}, indexed {indexed}");
            assert_eq!(mesh.positions.len(), if mode == 4 { 3 } else { 5 }, "what no triangle uses is dropped");
            assert_eq!(scene.warnings.len(), usize::from(mode == 4), "five corners are no list: {:?}", scene.warnings);
        }
    }
    for mode in 0..4 {
        let mut doc = Doc::triangle();
        doc.primitive()["mode"] = json!(mode);
        let scene = doc.load();
        assert!(scene.instances.is_empty());
        assert_says(&scene.warnings[0], &["points and lines"]);
    }
    let mut doc = Doc::triangle();
    doc.primitive()["mode"] = json!(7);
    assert_says(&doc.error(), &["mode"]);
}

#[test]
fn indices_of_every_type() {
    let u32s = [2_u32, 0, 1].iter().flat_map(|i| i.to_le_bytes()).collect();
    for (component, bytes) in [(U8, vec![2, 0, 1]), (U16, u16s(&[2, 0, 1])), (U32, u32s)] {
        let mut doc = Doc::triangle();
        let indices = doc.accessor(&bytes, component, "SCALAR", 3);
        let normals = doc.floats("VEC3", &[0., 0., 1.].repeat(3));
        doc.primitive()["indices"] = json!(indices);
        doc.primitive()["attributes"]["NORMAL"] = json!(normals);
        assert_eq!(doc.load().meshes[0].indices, [2, 0, 1]);
    }
    let mut doc = Doc::triangle();
    let indices = doc.floats("SCALAR", &[0., 1., 2.]);
    doc.primitive()["indices"] = json!(indices);
    assert_says(&doc.error(), &["unsigned"]);
    let mut doc = Doc::triangle();
    let indices = doc.accessor(&[0, 1, 3], U8, "SCALAR", 3);
    doc.primitive()["indices"] = json!(indices);
    assert_says(&doc.error(), &["index 3", "out of range", "below 3"]);
}

#[test]
fn missing_normals_are_flat() {
    let mut doc = Doc::new();
    // A roof: two triangles over the edge (0,0,0)–(0,0,1), 45° either way.
    let positions = doc.floats("VEC3", &[0., 0., 0., 0., 0., 1., 1., -1., 0., -1., -1., 0.]);
    let uvs = doc.floats("VEC2", &[0., 0., 1., 0., 0., 1., 1., 1.]);
    let indices = doc.accessor(&[0, 1, 2, 1, 0, 3], U8, "SCALAR", 6);
    doc.draw(json!({"indices": indices, "attributes": {"POSITION": positions, "TEXCOORD_1": uvs}}));
    let scene = doc.load();
    let mesh = &scene.meshes[0];
    assert_eq!(mesh.indices, [0, 1, 2, 3, 4, 5]);
    assert_eq!(mesh.positions.len(), 6);
    for i in 0..3 {
        assert_near(mesh.normals[i], Vec3::new(FRAC_1_SQRT_2, FRAC_1_SQRT_2, 0.));
        assert_near(mesh.normals[i + 3], Vec3::new(-FRAC_1_SQRT_2, FRAC_1_SQRT_2, 0.));
    }
    assert_eq!(mesh.uvs[1], [Vec2::ZERO, Vec2::X, Vec2::Y, Vec2::X, Vec2::ZERO, Vec2::ONE]);
    assert!(mesh.uvs[0].is_empty() && mesh.tangents.is_empty());
}

#[test]
fn odd_normals_are_mended() {
    let mut doc = Doc::triangle();
    let normals = doc.floats("VEC3", &[0., 0., 0., 0., 9., 0., 1e-30, 0., 0.]);
    doc.primitive()["attributes"]["NORMAL"] = json!(normals);
    assert_eq!(doc.load().meshes[0].normals, [Vec3::Z, Vec3::Y, Vec3::X]);
    // Triangles without area have some unit normal.
    let mut doc = Doc::new();
    let positions = doc.floats("VEC3", &[1.; 9]);
    doc.draw(json!({"attributes": {"POSITION": positions}}));
    assert_eq!(doc.load().triangle_count(), 1);
}

#[test]
fn sparse_values_replace() {
    let mut doc = Doc::triangle();
    let (indices, values) = (doc.view(&u16s(&[1, 2])), doc.view(&f32s(&[5., 0., 0., 0., 6., 0.])));
    let sparse = json!({"count": 2, "indices": {"bufferView": indices, "componentType": U16},
        "values": {"bufferView": values}});
    doc.json["accessors"][0]["sparse"] = sparse.clone();
    assert_eq!(doc.load().meshes[0].positions, [Vec3::ZERO, 5.0 * Vec3::X, 6.0 * Vec3::Y]);
    // Without a view the base is zeros.
    doc.json["accessors"][0] = json!({"componentType": F32, "type": "VEC3", "count": 3, "sparse": sparse});
    assert_eq!(doc.load().meshes[0].positions, [Vec3::ZERO, 5.0 * Vec3::X, 6.0 * Vec3::Y]);
    doc.json["accessors"][0]["count"] = json!(2);
    assert_says(&doc.error(), &["sparse index 2", "out of range"]);
    doc.json["accessors"][0]["sparse"]["count"] = json!(100);
    assert_says(&doc.error(), &["sparse", "out of bounds"]);
    doc.json["accessors"][0] = json!({"componentType": F32, "type": "VEC3", "count": 3});
    assert_eq!(doc.load().meshes[0].positions, [Vec3::ZERO; 3]);
    doc.json["accessors"][0]["count"] = json!(18_000_000);
    assert_says(&doc.error(), &["without data"]);
}

#[test]
fn interleaved_and_normalised_attributes() {
    let mut doc = Doc::new();
    // Position as three f32, texture coordinates as two normalised u16, normal as three i8 and padding.
    let mut bytes = Vec::new();
    for (position, uv, normal) in [
        ([0., 0., 0.], [0, 65535], [0, 0, 127]),
        ([1., 0., 0.], [13107, 0], [0, 0, 127]),
        ([0., 1., 0.], [0, 0], [-128_i8, 0, 0]),
    ] {
        bytes.extend(f32s(&position));
        bytes.extend(u16s(&uv));
        bytes.extend(normal.iter().chain(&[0]).map(|&n| n as u8));
    }
    let view = doc.view(&bytes);
    doc.json["bufferViews"][view]["byteStride"] = json!(20);
    let mut accessor = |offset: usize, component: u32, kind: &str, normalized: bool| {
        doc.push(
            "accessors",
            json!({"bufferView": view, "byteOffset": offset, "componentType": component, "type": kind, "count": 3,
                "normalized": normalized}),
        )
    };
    let (p, t) = (accessor(0, F32, "VEC3", false), accessor(12, U16, "VEC2", true));
    let n = accessor(16, I8, "VEC3", true);
    doc.draw(json!({"attributes": {"POSITION": p, "TEXCOORD_0": t, "NORMAL": n}}));
    let mesh = &doc.load().meshes[0];
    assert_eq!(mesh.positions, [Vec3::ZERO, Vec3::X, Vec3::Y]);
    assert_eq!(mesh.uvs[0], [Vec2::Y, Vec2::new(0.2, 0.), Vec2::ZERO]);
    assert_eq!(mesh.normals, [Vec3::Z, Vec3::Z, Vec3::NEG_X]);
}

#[test]
fn quantized_meshes_load() {
    let mut doc = Doc::new();
    let bytes: Vec<u8> = [0, 0, 0, 0, 100_i16, 0, 0, 0, 0, -200, 0, 0].iter().flat_map(|v| v.to_le_bytes()).collect();
    let positions = doc.accessor(&bytes, I16, "VEC3", 3);
    doc.json["bufferViews"][0]["byteStride"] = json!(8);
    doc.json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    let uvs = doc.accessor(&[127, 129, 0, 0, 128, 0, 0, 0, 0, 0, 0, 0], I8, "VEC2", 3);
    doc.json["bufferViews"][1]["byteStride"] = json!(4);
    doc.json["accessors"][uvs]["normalized"] = json!(true);
    doc.draw(json!({"attributes": {"POSITION": positions, "TEXCOORD_0": uvs}}));
    doc.json["nodes"][0]["scale"] = json!([0.01, 0.01, 0.01]);
    let scene = doc.load();
    assert_eq!(scene.meshes[0].positions[1], 100.0 * Vec3::X);
    assert_eq!(scene.meshes[0].uvs[0], [Vec2::new(1., -1.), Vec2::NEG_X, Vec2::ZERO]);
    assert_near(scene.bounds().unwrap().min, Vec3::new(0., -2., 0.));
}

#[test]
fn vertex_colors_of_every_type() {
    let expected = [Vec4::new(1., 0.2, 0., 0.4), Vec4::new(0., 0.6, 1., 0.), Vec4::ONE];
    for (component, most) in [(U8, 255.0), (U16, 65535.0), (F32, 1.0)] {
        for (kind, width) in [("VEC3", 3), ("VEC4", 4)] {
            let mut doc = Doc::triangle();
            let numbers = expected.iter().flat_map(|c| c.to_array()[..width].to_vec()).map(|c| c * most);
            let bytes: Vec<u8> = match component {
                U8 => numbers.map(|n| n.round() as u8).collect(),
                U16 => numbers.flat_map(|n| (n.round() as u16).to_le_bytes()).collect(),
                _ => numbers.flat_map(f32::to_le_bytes).collect(),
            };
            let colors = doc.accessor(&bytes, component, kind, 3);
            doc.json["accessors"][colors]["normalized"] = json!(component != F32);
            doc.primitive()["attributes"]["COLOR_0"] = json!(colors);
            let scene = doc.load();
            assert_eq!(scene.meshes[0].colors.len(), 3);
            for (color, mut want) in scene.meshes[0].colors.iter().zip(expected) {
                want.w = if width == 3 { 1.0 } else { want.w };
                assert!((*color - want).length() < 1e-6, "{component} × {width}: {color}");
            }
        }
    }
}

#[test]
fn tangents_only_for_normal_textures() {
    let mut doc = Doc::with_material(json!({"normalTexture": {"index": 0}}));
    for tangent in &doc.load().meshes[0].tangents {
        assert!((*tangent - Vec4::new(1., 0., 0., 1.)).length() < 1e-5, "{tangent}");
    }
    // The texture turned by 90° (u → −v, v → u): its x axis runs along the mesh's v, which is down.
    doc.json["materials"][0]["normalTexture"]["extensions"]["KHR_texture_transform"] = json!({"rotation": FRAC_PI_2});
    for tangent in &doc.load().meshes[0].tangents {
        assert!((*tangent - Vec4::new(0., -1., 0., 1.)).length() < 1e-5, "{tangent}");
    }
    // Those of the file win; odd ones are mended.
    let mut doc = Doc::with_material(json!({"normalTexture": {"index": 0}}));
    let tangents = doc.floats("VEC4", &[0., 1., 0., -1., 0., 2., 0., -1., 0., 0., 0., 0., 0., 0., 1., 1.]);
    doc.primitive()["attributes"]["TANGENT"] = json!(tangents);
    assert_eq!(doc.load().meshes[0].tangents[..2], [Vec4::new(0., 1., 0., -1.); 2]);
    // Without a normal texture there are none.
    doc.json["materials"][0] = json!({});
    assert!(doc.load().meshes[0].tangents.is_empty());
}

#[test]
fn mirrored_uvs_split_vertices() {
    let mut doc = Doc::with_material(json!({"normalTexture": {"index": 0}}));
    // u runs 0 → 1 → 0 over two quads that share the middle edge.
    let positions = doc.floats("VEC3", &[0., 0., 0., 1., 0., 0., 2., 0., 0., 0., 1., 0., 1., 1., 0., 2., 1., 0.]);
    let normals = doc.floats("VEC3", &[0., 0., 1.].repeat(6));
    let uvs = doc.floats("VEC2", &[0., 1., 1., 1., 0., 1., 0., 0., 1., 0., 0., 0.]);
    let indices = doc.accessor(&[0, 1, 4, 0, 4, 3, 1, 2, 5, 1, 5, 4], U8, "SCALAR", 12);
    *doc.primitive() = json!({"material": 0, "indices": indices,
        "attributes": {"POSITION": positions, "NORMAL": normals, "TEXCOORD_0": uvs}});
    let scene = doc.load();
    let mesh = &scene.meshes[0];
    assert_eq!((mesh.positions.len(), mesh.tangents.len()), (8, 8));
    for (corner, &i) in mesh.indices.iter().enumerate() {
        let side = if corner < 6 { 1.0 } else { -1.0 };
        let tangent = mesh.tangents[i as usize];
        assert!((tangent - Vec4::new(side, 0., 0., side)).length() < 1e-5, "corner {corner}: {tangent}");
    }
}

#[test]
fn tangents_of_a_huge_fan_take_no_time() {
    let mut doc = Doc::with_material(json!({"normalTexture": {"index": 0}}));
    let n = 100_000;
    let mut corners = vec![[0.0, 0.0]];
    corners.extend((0..=n).map(|i| f32::sin_cos(i as f32 / n as f32 * 2.0 * PI)).map(|(s, c)| [c, s]));
    let positions: Vec<f32> = corners.iter().flat_map(|c| [c[0], c[1], 0.]).collect();
    let uvs: Vec<f32> = corners.iter().flat_map(|c| [c[0], -c[1]]).collect();
    let (p, t) = (doc.floats("VEC3", &positions), doc.floats("VEC2", &uvs));
    let normals = doc.floats("VEC3", &[0., 0., 1.].repeat(corners.len()));
    *doc.primitive() = json!({"material": 0, "mode": 6,
        "attributes": {"POSITION": p, "NORMAL": normals, "TEXCOORD_0": t}});
    let start = Instant::now();
    let scene = doc.load();
    assert!(start.elapsed() < Duration::from_secs(10), "{:?}", start.elapsed());
    let close = |t: &Vec4| (*t - Vec4::new(1., 0., 0., 1.)).length() < 1e-2;
    assert!(scene.meshes[0].tangents.iter().all(close));
}

#[test]
fn tangents_of_many_degenerate_triangles_take_no_time() {
    let mut doc = Doc::with_material(json!({"normalTexture": {"index": 0}}));
    let n = 50_000;
    let good = (0..n).flat_map(|i| [i as f32, 0., 0., i as f32 + 1., 0., 0., i as f32, 1., 0.]);
    let bad = (0..n).flat_map(|i| [i as f32, 2., 0., i as f32, 2., 0., i as f32, 3., 0.]);
    let positions: Vec<f32> = good.chain(bad).collect();
    let uvs: Vec<f32> = positions.chunks(3).flat_map(|p| [p[0], -p[1]]).collect();
    let (p, t) = (doc.floats("VEC3", &positions), doc.floats("VEC2", &uvs));
    let normals = doc.floats("VEC3", &[0., 0., 1.].repeat(6 * n));
    *doc.primitive() = json!({"material": 0, "attributes": {"POSITION": p, "NORMAL": normals, "TEXCOORD_0": t}});
    let start = Instant::now();
    let scene = doc.load();
    assert!(start.elapsed() < Duration::from_secs(10), "{:?}", start.elapsed());
    assert!(scene.meshes[0].tangents[..3 * n].iter().all(|t| *t == Vec4::new(1., 0., 0., 1.)));
}

#[test]
fn random_geometry_with_tangents_never_panics() {
    let mut random = Random(7);
    // Few distinct values make shared, doubled, mirrored and empty triangles, and edges with many triangles.
    let values = [0.0, 1.0, -1.0, 1e-20, 1e12, -1e12, 1e-45, 3.0];
    for round in 0..400 {
        let mut doc = Doc::with_material(json!({"normalTexture": {"index": 0}}));
        let few = if round % 2 == 0 { 3 } else { values.len() };
        let mut numbers = |n: usize| (0..n).map(|_| values[random.below(few)]).collect::<Vec<f32>>();
        let (p, n, t) = (numbers(36), numbers(36), numbers(24));
        let indices: Vec<u8> = (0..180).map(|_| random.below(12) as u8).collect();
        let (p, n, t) = (doc.floats("VEC3", &p), doc.floats("VEC3", &n), doc.floats("VEC2", &t));
        let indices = doc.accessor(&indices, U8, "SCALAR", indices.len());
        *doc.primitive() = json!({"material": 0, "indices": indices,
            "attributes": {"POSITION": p, "NORMAL": n, "TEXCOORD_0": t}});
        assert_eq!(doc.load().triangle_count(), 60);
    }
}

#[test]
fn attributes_must_be_finite_and_match() {
    for (bad, word) in [(f32::NAN, "NaN"), (f32::INFINITY, "infinite"), (1e30, "beyond")] {
        let mut doc = Doc::triangle();
        doc.bin[4..8].copy_from_slice(&bad.to_le_bytes());
        assert_says(&doc.error(), &[word]);
    }
    for (name, kind, width) in
        [("NORMAL", "VEC3", 3), ("TEXCOORD_0", "VEC2", 2), ("TEXCOORD_1", "VEC2", 2), ("COLOR_0", "VEC4", 4)]
    {
        let mut doc = Doc::triangle();
        let short = doc.floats(kind, &vec![1.0; 2 * width]);
        doc.primitive()["attributes"][name] = json!(short);
        assert_says(&doc.error(), &[name, "2 elements", "has 3"]);
        let nan = doc.floats(kind, &vec![f32::NAN; 3 * width]);
        doc.primitive()["attributes"][name] = json!(nan);
        assert_says(&doc.error(), &["NaN"]);
        let wrong = doc.floats("SCALAR", &[1.0; 3]);
        doc.primitive()["attributes"][name] = json!(wrong);
        assert_says(&doc.error(), &["type"]);
        if kind == "VEC2" {
            let huge = doc.floats(kind, &[0., 0., 0., 0., 0., -2e12]);
            doc.primitive()["attributes"][name] = json!(huge);
            assert_says(&doc.error(), &["mesh 0, primitive 0", name, "beyond 1e12", "allowed"]);
        }
    }
}

#[test]
fn ranges_out_of_bounds_are_refused() {
    let huge = u64::MAX;
    for (list, key, value) in [
        ("accessors", "count", json!(4)),
        ("accessors", "count", json!(18_000_000)),
        ("accessors", "byteOffset", json!(4)),
        ("accessors", "byteOffset", json!(huge)),
        ("bufferViews", "byteLength", json!(1000)),
        ("bufferViews", "byteLength", json!(huge)),
        ("bufferViews", "byteOffset", json!(huge)),
        ("bufferViews", "byteOffset", json!(4)),
    ] {
        let mut doc = Doc::triangle();
        doc.json[list][0][key] = value;
        assert_says(&doc.error(), &["out of bounds"]);
    }
    for stride in [0, 4, 253, usize::MAX] {
        let mut doc = Doc::triangle();
        doc.json["bufferViews"][0]["byteStride"] = json!(stride);
        assert_says(&doc.error(), &["byteStride"]);
    }
    for (list, key, what) in [
        ("accessors", "bufferView", "bufferView 9"),
        ("bufferViews", "buffer", "buffer 9"),
        ("nodes", "mesh", "mesh 9"),
    ] {
        let mut doc = Doc::triangle();
        doc.json[list][0][key] = json!(9);
        assert_says(&doc.error(), &[what, "out of range"]);
    }
    for (key, value, what) in [
        ("indices", json!(9), "accessor 9"),
        ("material", json!(9), "material 9"),
        ("attributes", json!({"POSITION": 9}), "accessor 9"),
    ] {
        let mut doc = Doc::triangle();
        doc.primitive()[key] = value;
        assert_says(&doc.error(), &[what, "out of range"]);
    }
}

#[test]
fn what_would_be_too_large_is_refused() {
    let mut doc = Doc::triangle();
    doc.json["accessors"][0]["count"] = json!(200_000_000);
    assert_says(&doc.error(), &["too large"]);
    // 2 000 nodes with 2 000 primitives each are few bytes and four million instances.
    let mut doc = Doc::triangle();
    let primitive = doc.primitive().clone();
    doc.json["meshes"][0]["primitives"] = json!(vec![primitive; 2000]);
    doc.json["nodes"] = json!(vec![json!({"mesh": 0}); 2000]);
    assert_says(&doc.error(), &["too large", "instances"]);
}

#[test]
fn vertices_that_no_triangle_uses_are_dropped() {
    let mut doc = Doc::with_material(json!({"normalTexture": {"index": 0}}));
    let corners = doc.view(&f32s(&[7., 0., 0., 8., 0., 0., 7., 1., 0.]));
    let ups = doc.view(&f32s(&[0., 0., 1.].repeat(3)));
    let at = [5_u32, 70, 999_999];
    let at_view = doc.view(&at.iter().flat_map(|i| i.to_le_bytes()).collect::<Vec<_>>());
    let mut sparse = |values: usize| {
        let sparse = json!({"count": 3, "indices": {"bufferView": at_view, "componentType": U32},
            "values": {"bufferView": values}});
        doc.push("accessors", json!({"componentType": F32, "type": "VEC3", "count": 1_000_000, "sparse": sparse}))
    };
    let (p, n) = (sparse(corners), sparse(ups));
    let colors = doc.push("accessors", json!({"componentType": F32, "type": "VEC4", "count": 1_000_000}));
    let indices = doc.accessor(&at.iter().rev().flat_map(|i| i.to_le_bytes()).collect::<Vec<_>>(), U32, "SCALAR", 3);
    for attributes in [json!({"POSITION": p, "NORMAL": n, "COLOR_0": colors}), json!({"POSITION": p})] {
        *doc.primitive() = json!({"material": 0, "indices": indices, "attributes": attributes});
        let scene = doc.load();
        let mesh = &scene.meshes[0];
        let got: Vec<f32> =
            mesh.indices.iter().map(|&i| mesh.positions[i as usize].dot(Vec3::new(1., 9., 0.))).collect();
        assert_eq!((mesh.positions.len(), got), (3, vec![16., 8., 7.]));
    }
    // Many primitives may use a part of one array each: the unused part does not count but as reading.
    *doc.primitive() = json!({"indices": indices, "attributes": {"POSITION": p, "NORMAL": n}});
    let primitive = doc.primitive().clone();
    doc.json["meshes"][0]["primitives"] = json!(vec![primitive.clone(); 30]);
    assert_eq!(doc.load().triangle_count(), 30);
    doc.json["meshes"][0]["primitives"] = json!(vec![primitive; 101]);
    assert_says(&doc.error(), &["too large", "100000000 vertices"]);
    let mut doc = Doc::triangle();
    let indices = doc.push("accessors", json!({"componentType": U32, "type": "SCALAR", "count": 20_000_001}));
    doc.primitive()["indices"] = json!(indices);
    assert_says(&doc.error(), &["too large", "20000000 vertices and indices"]);
    // Instances count each.
    let mut doc = Doc::triangle();
    let indices = doc.push("accessors", json!({"componentType": U32, "type": "SCALAR", "count": 300_000}));
    doc.primitive()["indices"] = json!(indices);
    doc.json["nodes"] = json!(vec![json!({"mesh": 0}); 201]);
    assert_says(&doc.error(), &["too large", "20000000 triangles"]);
}

// Materials

#[test]
fn materials_with_everything() {
    let info = |texture: usize, set: usize| json!({"index": texture, "texCoord": set});
    let mut doc = Doc::with_material(json!({
        "name": "all", "doubleSided": true, "alphaMode": "MASK", "alphaCutoff": 0.25,
        "pbrMetallicRoughness": {"baseColorFactor": [0.1, 0.2, 0.3, 0.4], "metallicFactor": 0.5,
            "roughnessFactor": 0.6, "baseColorTexture": info(0, 0), "metallicRoughnessTexture": info(1, 1)},
        "normalTexture": {"index": 2, "scale": 0.7, "texCoord": 1},
        "occlusionTexture": {"index": 3, "strength": 0.8},
        "emissiveTexture": info(4, 0), "emissiveFactor": [1, 0.5, 0.25],
        "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 8},
            "KHR_materials_specular": {"specularFactor": 0.3}, "KHR_materials_unlit": {}},
    }));
    doc.json["samplers"] =
        json!([{"magFilter": 9728, "minFilter": 9985, "wrapS": 33071, "wrapT": 33648}, {"minFilter": 9728}]);
    let other = format!("data:image/png;base64,{}", base64(&png(&DynamicImage::new_rgb8(2, 1))));
    doc.json["images"] = json!([{"uri": "a.png"}, {"uri": other}, {"uri": "missing.png"}]);
    doc.json["textures"] = json!([{"source": 0}, {"source": 1, "sampler": 0}, {"source": 0, "sampler": 1},
        {"source": 1}, {"source": 0}, {"source": 2}]);
    let scene = doc.load();
    let m = &scene.materials[0];
    assert_eq!((m.name.as_str(), m.double_sided, m.unlit), ("all", true, true));
    assert_eq!(m.alpha_mode, AlphaMode::Mask { cutoff: 0.25 });
    assert_eq!((m.base_color, m.metallic, m.roughness), (Vec4::new(0.1, 0.2, 0.3, 0.4), 0.5, 0.6));
    assert_eq!((m.normal_scale, m.occlusion_strength, m.specular), (0.7, 0.8, 0.3));
    assert_eq!(m.emissive, Vec3::new(8., 4., 2.));
    let all =
        [m.base_color_texture, m.metallic_roughness_texture, m.normal_texture, m.occlusion_texture, m.emissive_texture];
    assert_eq!(all.map(|t| t.unwrap().uv_set), [0, 1, 1, 0, 0]);
    assert_eq!((scene.textures.len(), scene.images.len()), (5, 2), "the unused third image is not even looked for");
    let image = |t: Option<TextureRef>| scene.textures[t.unwrap().texture].image;
    let (a, b) = (image(m.base_color_texture), image(m.metallic_roughness_texture));
    assert_ne!(a, b);
    assert_eq!(all.map(image), [a, b, a, b, a]);
    let sampler = |t: Option<TextureRef>| scene.textures[t.unwrap().texture].sampler;
    assert_eq!(sampler(m.base_color_texture), Sampler::default());
    let (odd, nearest) = (sampler(m.metallic_roughness_texture), sampler(m.normal_texture));
    assert_eq!((odd.mag_linear, odd.min_linear, odd.mip_linear), (false, true, Some(false)));
    assert_eq!((odd.wrap_u, odd.wrap_v), (Wrap::Clamp, Wrap::Mirror));
    assert_eq!((nearest.mag_linear, nearest.min_linear, nearest.mip_linear), (true, false, None));
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
}

#[test]
fn material_defaults_are_the_specifications() {
    let mut doc = Doc::triangle();
    doc.push("materials", json!({}));
    let scene = doc.load();
    assert_eq!(scene.materials.len(), 2, "the file's, and the default one that the primitive has");
    assert_eq!(scene.meshes[0].material, 1);
    for m in &scene.materials {
        assert_eq!((m.base_color, m.metallic, m.roughness, m.emissive), (Vec4::ONE, 1.0, 1.0, Vec3::ZERO));
        assert_eq!((m.alpha_mode, m.double_sided, m.unlit, m.specular), (AlphaMode::Opaque, false, false, 1.0));
    }
    doc.json["materials"][0] = json!({"alphaMode": "MASK"});
    assert_eq!(doc.load().materials[0].alpha_mode, AlphaMode::Mask { cutoff: 0.5 });
    doc.json["materials"][0] = json!({"emissiveFactor": [1e39, 0, 0]});
    assert_says(&doc.error(), &["material 0", "infinite"]);
    doc.json["materials"][0] = json!({"alphaMode": "GLASS"});
    assert_says(&doc.error(), &["material 0", "alphaMode"]);
}

#[test]
fn texture_transforms_on_every_texture() {
    let t = json!({"index": 0, "texCoord": 0, "extensions": {"KHR_texture_transform":
        {"offset": [0.5, 0.25], "rotation": FRAC_PI_2, "scale": [2, 3], "texCoord": 1}}});
    let doc = Doc::with_material(json!({
        "pbrMetallicRoughness": {"baseColorTexture": t, "metallicRoughnessTexture": t},
        "normalTexture": t, "occlusionTexture": t, "emissiveTexture": t}));
    let m = doc.load().materials[0].clone();
    for texture in
        [m.base_color_texture, m.metallic_roughness_texture, m.normal_texture, m.occlusion_texture, m.emissive_texture]
    {
        let texture = texture.unwrap();
        assert_eq!(texture.uv_set, 1);
        // Scaled, turned counter-clockwise as seen with v down (u → −v, v → u), moved.
        for (uv, want) in
            [(Vec2::ZERO, Vec2::new(0.5, 0.25)), (Vec2::X, Vec2::new(0.5, -1.75)), (Vec2::Y, Vec2::new(3.5, 0.25))]
        {
            let got = texture.uv_transform.transform_point2(uv);
            assert!((got - want).length() < 1e-5, "{uv} → {got}, not {want}");
        }
    }
    for t in [json!({"offset": [0, -1e38]}), json!({"scale": [2e12, 1]}), json!({"rotation": 1e39})] {
        let texture = json!({"index": 0, "extensions": {"KHR_texture_transform": t}});
        for material in [json!({"normalTexture": texture}), json!({"emissiveTexture": texture})] {
            assert_says(&Doc::with_material(material).error(), &["material 0", "KHR_texture_transform", "1e12"]);
        }
    }
}

#[test]
fn factors_out_of_range_are_warned_of_and_held_in_it() {
    for material in [
        json!({"emissiveFactor": [1, 0, 0], "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": -5}}}),
        json!({"pbrMetallicRoughness": {"baseColorFactor": [2, -0.5, 0.5, 1]}}),
        json!({"pbrMetallicRoughness": {"metallicFactor": 5}}),
        json!({"pbrMetallicRoughness": {"roughnessFactor": -3}}),
        json!({"extensions": {"KHR_materials_specular": {"specularFactor": 2}}}),
    ] {
        let scene = Doc::with_material(material.clone()).load();
        assert_eq!(scene.warnings.len(), 1, "{material}: {:?}", scene.warnings);
        assert_says(&scene.warnings[0], &["outside of 0 to 1"]);
        let m = &scene.materials[0];
        let factors = [m.base_color.to_array(), [m.metallic, m.roughness, m.specular, m.emissive.x]];
        assert!(factors.as_flattened().iter().all(|factor| (0.0..=1.0).contains(factor)), "{m:?}");
    }
}

#[test]
fn what_is_not_drawn_as_written_warns_once() {
    let mut doc = Doc::with_material(json!({"alphaMode": "BLEND",
        "pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "texCoord": 2}},
        "extensions": {"KHR_materials_specular": {"specularColorFactor": [1, 0, 0]}}}));
    doc.push("materials", json!({"alphaMode": "BLEND"}));
    doc.json["skins"] = json!([{"joints": [0]}]);
    doc.json["nodes"][0]["skin"] = json!(0);
    let pointer = json!({"sampler": 0, "target": {"node": 0, "path": "pointer"}});
    let nodeless = json!({"sampler": 0, "target": {"path": "translation"}});
    doc.json["animations"] = json!([{"channels": [pointer, nodeless],
        "samplers": [{"input": 0, "output": 0}]}]);
    doc.json["extensionsUsed"] = json!(["KHR_materials_clearcoat", "KHR_lights_punctual", "KHR_materials_clearcoat"]);
    let scene = doc.load();
    for word in ["BLEND", "TEXCOORD_2", "KHR_materials_specular", "skin", "animation", "clearcoat"] {
        let lines = scene.warnings.iter().filter(|w| w.contains(word)).count();
        assert_eq!(lines, 1, "{word}: {:?}", scene.warnings);
    }
    assert_says(&scene.warnings.join("\n"), &["is not played (2 times)"]);
    assert_eq!(scene.warnings.join("\n").matches("clearcoat").count(), 1);
    assert_eq!(scene.warnings.len(), 6);
    assert_eq!(scene.materials[0].alpha_mode, AlphaMode::Opaque);
    assert_eq!(scene.materials[0].base_color_texture.unwrap().uv_set, 0);
}

#[test]
fn images_of_every_kind() {
    let rgb16 = DynamicImage::ImageRgb16(ImageBuffer::from_pixel(2, 1, Rgb([65535, 32896, 0])));
    let grey = DynamicImage::ImageLuma8(ImageBuffer::from_pixel(2, 1, Luma([77])));
    let grey_alpha = DynamicImage::ImageLumaA8(ImageBuffer::from_pixel(2, 1, LumaA([77, 9])));
    let rgb = DynamicImage::ImageRgb8(ImageBuffer::from_pixel(2, 1, Rgb([128, 128, 128])));
    for (bytes, pixel, slack) in [
        (png(&rgb16), [255_u8, 128, 0, 255], 0),
        (png(&grey), [77, 77, 77, 255], 0),
        (png(&grey_alpha), [77, 77, 77, 9], 0),
        (encoded(&rgb, ImageFormat::Jpeg), [128, 128, 128, 255], 2),
        (encoded(&grey, ImageFormat::Jpeg), [77, 77, 77, 255], 2),
    ] {
        let mut doc = Doc::with_material(json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}));
        let view = doc.view(&bytes);
        for source in [
            json!({"bufferView": view, "mimeType": "image/png"}),
            json!({"uri": format!("data:image/png;base64,{}", base64(&bytes))}),
        ] {
            doc.json["images"][0] = source;
            let scene = doc.load();
            let image = &scene.images[0];
            assert_eq!((image.width, image.height), (2, 1));
            for (got, want) in image.rgba.iter().zip(pixel.iter().cycle()) {
                assert!(got.abs_diff(*want) <= slack, "{:?} {pixel:?}", image.rgba);
            }
        }
    }
}

#[test]
fn images_with_the_same_bytes_are_one() {
    // 2 000 images on one buffer view; each 4 MiB when decoded, together beyond the limit.
    let mut doc = Doc::with_material(json!({}));
    let view = doc.view(&png(&DynamicImage::new_rgb8(1024, 1024)));
    let materials: Vec<_> = (0..2000).map(|i| json!({"emissiveTexture": {"index": i}})).collect();
    doc.json["materials"] = json!(materials);
    doc.json["textures"] = (0..2000).map(|i| json!({"source": i})).collect();
    doc.json["images"] = json!(vec![json!({"bufferView": view, "mimeType": "image/png"}); 2000]);
    let scene = doc.load();
    assert_eq!((scene.images.len(), scene.textures.len()), (1, 2000));
    doc.json["images"] = json!(vec![json!({"uri": "a.png"}); 2000]);
    assert_eq!(doc.load().images.len(), 1);
    // Each with a view of its own on the same bytes: refused by their sum, before that much is decoded.
    let mut doc = Doc::with_material(json!({}));
    let big = doc.view(&png(&DynamicImage::new_luma8(8192, 8192)));
    let view = doc.json["bufferViews"][big].clone();
    let views: Vec<_> = (0..20).map(|_| doc.push("bufferViews", view.clone())).collect();
    doc.json["materials"] = (0..20).map(|i| json!({"emissiveTexture": {"index": i}})).collect();
    doc.json["textures"] = (0..20).map(|i| json!({"source": i})).collect();
    doc.json["images"] = views.iter().map(|v| json!({"bufferView": v, "mimeType": "image/png"})).collect();
    assert_says(&doc.error(), &["too large together", "4294967296"]);
}

#[test]
fn bad_images_are_refused() {
    let mut bomb = png(&DynamicImage::new_luma8(1, 1));
    bomb[16..24].copy_from_slice(&[0, 1, 0, 0, 0, 1, 0, 0]); // 65536 × 65536, with a sound check sum
    let crc = crc32(&bomb[12..29]);
    bomb[29..33].copy_from_slice(&crc.to_be_bytes());
    let good = png(&DynamicImage::new_rgb8(64, 64));
    let mut doc = Doc::with_material(json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}));
    for (bytes, words) in [
        (b"GIF89a".to_vec(), &["image 0", "PNG"]),
        (Vec::new(), &["image 0", "PNG"]),
        (good[..good.len() / 2].to_vec(), &["image 0", "decoded"]),
        (bomb, &["image 0", "16384"]),
    ] {
        doc.json["images"][0] = json!({"uri": format!("data:;base64,{}", base64(&bytes))});
        assert_says(&doc.error(), words);
    }
    doc.json["images"][0] = json!({"uri": "missing.png"});
    assert_says(&doc.error(), &["missing.png"]);
    doc.json["images"][0] = json!({});
    assert_says(&doc.error(), &["image 0", "neither"]);
    doc.json["textures"][0] = json!({"source": 4});
    assert_says(&doc.error(), &["image 4"]);
    doc.json["textures"][0] = json!({"extensions": {"EXT_texture_webp": {"source": 0}}});
    let scene = doc.load();
    assert!(scene.materials[0].base_color_texture.is_none() && scene.warnings.len() == 1);
}

fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0_u32, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |c, _| if c & 1 == 1 { c >> 1 ^ 0xedb8_8320 } else { c >> 1 })
    })
}

// Cameras and lights

#[test]
fn cameras_keep_right_angles_under_scale() {
    let mut doc = Doc::new();
    doc.json["cameras"] = json!([
        {"name": "eye", "type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.25}},
        {"type": "orthographic", "orthographic": {"xmag": 3, "ymag": 2, "znear": 0, "zfar": 10}},
    ]);
    // A squashed parent over a turned child shears the child's axes.
    let turn = [(FRAC_PI_4 / 2.).sin(), 0., 0., (FRAC_PI_4 / 2.).cos()]; // 45° upwards
    doc.json["nodes"] = json!([
        {"children": [1], "scale": [1, 1, 3], "translation": [1, 2, 3]},
        {"camera": 0, "rotation": turn, "translation": [1, 1, 1]},
        {"camera": 1, "name": "top", "scale": [-7, 7, 7], "rotation": [-FRAC_1_SQRT_2, 0, 0, FRAC_1_SQRT_2]},
    ]);
    let scene = doc.load();
    let [eye, top] = &scene.cameras[..2] else { panic!() };
    assert_eq!((eye.name.as_str(), top.name.as_str()), ("eye", "top"));
    assert_near(eye.eye, Vec3::new(2., 3., 6.));
    assert_near(eye.forward, Vec3::new(0., 1., -3.).normalize());
    assert_near(eye.up, Vec3::new(0., 3., 1.).normalize());
    assert_eq!((eye.projection, eye.near), (Projection::Perspective { fov_y: 0.7 }, Some(0.25)));
    assert_near(top.forward, Vec3::NEG_Y);
    assert_near(top.up, Vec3::NEG_Z);
    assert_eq!((top.projection, top.near), (Projection::Orthographic { half_height: 2.0 }, Some(0.0)));

    doc.json["cameras"][0]["perspective"]["yfov"] = json!(0);
    assert_says(&doc.error(), &["camera 0", "yfov"]);
    doc.json["cameras"][0] = json!({"type": "perspective"});
    assert_says(&doc.error(), &["camera 0"]);
    doc.json["nodes"][1]["camera"] = json!(8);
    assert_says(&doc.error(), &["camera 8"]);
}

#[test]
fn cameras_have_the_order_of_the_file() {
    let mut doc = Doc::triangle();
    let camera =
        |name: &str, fov: f32| json!({"name": name, "type": "perspective", "perspective": {"yfov": fov, "znear": 1}});
    let mut nameless = camera("", 0.3);
    nameless.as_object_mut().unwrap().remove("name");
    doc.json["cameras"] = json!([camera("a", 0.1), camera("b", 0.2), nameless, camera("d", 0.4), camera("e", 0.5)]);
    // Shuffled, one below another node, camera 1 on three nodes (one without a name), camera 4 on none.
    doc.json["nodes"] = json!([
        {"camera": 3, "name": "n0"}, {"children": [5], "camera": 1, "name": "n1"}, {"camera": 2, "name": "n2"},
        {"camera": 1}, {"camera": 0, "name": "n4"}, {"camera": 1, "name": "n5"},
    ]);
    let scene = doc.load();
    let names: Vec<_> = scene.cameras.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["a", "n1", "b", "n5", "n2", "d"]);
    assert_eq!(scene.warnings.len(), 1);
    assert_says(&scene.warnings[0], &["camera", "no node"]);
}

/// A triangle, and the lights on one node each, the first on node 1.
fn with_lights(lights: Value) -> Doc {
    let mut doc = Doc::triangle();
    for i in 0..lights.as_array().unwrap().len() {
        doc.push("nodes", json!({"extensions": {"KHR_lights_punctual": {"light": i}}}));
    }
    doc.json["extensions"] = json!({"KHR_lights_punctual": {"lights": lights}});
    doc
}

#[test]
fn lights_in_world_space_strongest_first() {
    let mut doc = with_lights(json!([
        {"type": "spot", "name": "spot", "color": [1, 0.5, 0], "intensity": 10, "range": 1,
            "spot": {"innerConeAngle": 0.2, "outerConeAngle": 0.5}},
        {"type": "point", "name": "bulb", "intensity": 10},
        {"type": "directional", "intensity": 100},
        {"type": "spot", "intensity": 1, "spot": {}},
    ]));
    doc.json["nodes"][1]["translation"] = json!([1, 2, 3]);
    doc.json["nodes"][1]["rotation"] = json!([-FRAC_1_SQRT_2, 0, 0, FRAC_1_SQRT_2]);
    doc.json["nodes"][1]["scale"] = json!([3, 4, 5]);
    doc.json["nodes"][2]["translation"] = json!([0.5, 9, 0]);
    doc.json["nodes"][3]["name"] = json!("sun");
    let scene = doc.load();
    let names: Vec<_> = scene.lights.iter().map(|l| l.name.as_str()).collect();
    // Fluxes: sun 100 π r² with r² = 1/2, bulb 40 π, the spots less.
    assert_eq!(names, ["sun", "bulb", "spot", ""]);
    let [sun, bulb, spot, last] = &scene.lights[..] else { panic!() };
    assert_eq!((sun.profile, sun.axis, sun.intensity), (Profile::Directional, Vec3::NEG_Z, Vec3::splat(100.0)));
    assert_eq!(bulb.profile, Profile::Point);
    assert_near(bulb.axis, Vec3::NEG_Y); // the triangle's bounds are centred at (½, ½, 0)
    assert_near(spot.axis, Vec3::NEG_Y);
    assert_eq!((spot.position, spot.intensity), (Vec3::new(1., 2., 3.), Vec3::new(10., 5., 0.)));
    assert_eq!(spot.profile, Profile::Spot { inner: 0.2, outer: 0.5 });
    assert_eq!(last.profile, Profile::Spot { inner: 0.0, outer: FRAC_PI_4 });

    // Without triangles there is no centre.
    doc.json["nodes"][0] = json!({});
    let scene = doc.load();
    assert!(scene.lights.iter().filter(|l| l.profile == Profile::Point).all(|l| l.axis == Vec3::NEG_Y));
}

#[test]
fn bad_lights_are_refused() {
    for light in [
        json!({"type": "point", "intensity": -1}),
        json!({"type": "point", "intensity": 1e39}),
        json!({"type": "point", "intensity": 1.1e20}),
        json!({"type": "directional", "intensity": 1e15, "color": [0, 1e6, 0]}),
        json!({"type": "moon"}),
        json!({"type": "spot"}),
        json!({"type": "spot", "spot": {"innerConeAngle": 0.5, "outerConeAngle": 0.2}}),
        json!({"type": "spot", "spot": {"outerConeAngle": 3}}),
    ] {
        assert_says(&with_lights(json!([light])).error(), &["light 0"]);
    }
    let mut doc = with_lights(json!([{"type": "point", "intensity": 2e20}]));
    assert_says(&doc.error(), &["intensity", "allowed: 0 to 1e20"]);
    doc.json["extensions"]["KHR_lights_punctual"]["lights"] = json!([{"type": "point", "intensity": 0.9e20}]);
    assert_eq!(doc.load().lights[0].intensity, Vec3::splat(0.9e20));
    doc.json["nodes"][1]["extensions"]["KHR_lights_punctual"]["light"] = json!(1);
    assert_says(&doc.error(), &["light 1", "out of range"]);
    doc.json["extensions"] = json!({});
    assert_says(&doc.error(), &["out of range"]);
}

// Files

#[test]
fn files_that_are_no_gltf_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let good = Doc::triangle().glb();
    let patched = |at: usize, bytes: &[u8]| {
        let mut patched = good.clone();
        patched[at..at + bytes.len()].copy_from_slice(bytes);
        patched
    };
    let mut no_bin = Doc::triangle().value();
    no_bin["buffers"] = json!([{"byteLength": 36}]);
    let (text, no_bin_text) = (Doc::triangle().gltf(), no_bin.to_string());
    let cases: [(&str, &[u8], &[&str]); 15] = [
        ("empty.glb", b"", &["empty"]),
        ("noise.gltf", b"\x00\xff not json \n\n at all", &["JSON"]),
        ("cut.gltf", &text.as_bytes()[..200], &["JSON"]),
        ("cut.glb", &good[..good.len() - 1], &["truncated"]),
        ("head.glb", &good[..10], &["truncated"]),
        ("version.glb", &patched(4, &[1]), &["version 1", "allowed"]),
        ("chunk.glb", &patched(12, &[255; 4]), &["truncated"]),
        ("short.glb", &patched(8, &[4, 0, 0, 0]), &["truncated"]),
        ("bin.glb", &glb(&no_bin, &[0; 32]), &["buffer 0", "truncated"]),
        ("bin.gltf", no_bin_text.as_bytes(), &["buffer 0", "no URI"]),
        ("none.gltf", b"{}", &["asset"]),
        ("list.gltf", b"[]", &["expected a JSON object"]),
        ("asset.gltf", br#"{"asset": []}"#, &["expected a JSON object"]),
        ("old.gltf", br#"{"asset": {"version": "1.0"}, "nodes": {}}"#, &["version 1.0", "2.0"]),
        ("new.gltf", br#"{"asset": {"version": "2.9", "minVersion": "2.9"}}"#, &["version 2.9"]),
    ];
    for (name, bytes, words) in cases {
        let path = dir.path().join(name);
        fs::write(&path, bytes).unwrap();
        assert_says(&error_of(&path), words);
    }
    assert_says(&error_of(&dir.path().join("missing.gltf")), &["cannot be read"]);
    fs::create_dir(dir.path().join("folder.gltf")).unwrap();
    assert_says(&error_of(&dir.path().join("folder.gltf")), &["directory"]);
    // A file of three GiB that holds nothing costs nothing, unless someone reads it.
    let huge = dir.path().join("huge.glb");
    fs::File::create(&huge).unwrap().set_len(3 << 30).unwrap();
    let start = Instant::now();
    assert_says(&error_of(&huge), &["too large"]);
    assert!(start.elapsed() < Duration::from_secs(1));
}

#[test]
fn deeply_nested_json_does_no_harm() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("deep.gltf");
    let nested = "[".repeat(200_000) + &"]".repeat(200_000);
    fs::write(&path, format!(r#"{{"asset": {{"version": "2.0"}}, "extras": {nested}}}"#)).unwrap();
    assert_eq!(Scene::load(&path).unwrap().triangle_count(), 0);
    fs::write(&path, format!(r#"{{"asset": {{"version": "2.0"}}, "extensions": {{"X": {nested}}}}}"#)).unwrap();
    assert_says(&error_of(&path), &["recursion"]);
}

#[test]
fn extras_are_allowed_everywhere() {
    fn add(value: &mut Value) {
        match value {
            Value::Array(list) => list.iter_mut().for_each(add),
            Value::Object(map) => {
                map.iter_mut()
                    .filter(|(k, _)| !["attributes", "targets"].contains(&k.as_str()))
                    .for_each(|(_, v)| add(v));
                map.insert("extras".to_owned(), json!({"a": [1, "b"]}));
                map.insert("unknown".to_owned(), json!({"a": [1, "b"]}));
            }
            _ => {}
        }
    }
    let mut doc = rich();
    // Each load stands in a folder of its own.
    let load = |doc: &Doc| Scene { files: Vec::new(), ..doc.load() };
    let before = load(&doc);
    add(&mut doc.json);
    doc.primitive()["attributes"]["_CUSTOM"] = json!(0);
    doc.primitive()["attributes"]["NONSENSE"] = json!(0);
    let after = load(&doc);
    assert_eq!(format!("{before:?}"), format!("{after:?}"));
}

#[test]
fn required_extensions_are_named() {
    let mut doc = Doc::triangle();
    doc.json["extensionsRequired"] = json!(["KHR_lights_punctual", "KHR_draco_mesh_compression", "X\nY"]);
    assert_says(
        &doc.error(),
        &["KHR_draco_mesh_compression", "X Y", "allowed: KHR_lights_punctual", "KHR_texture_transform"],
    );
    doc.json["extensionsRequired"] = json!(["KHR_lights_punctual", "KHR_texture_transform"]);
    assert_eq!(doc.load().triangle_count(), 1);
}

#[test]
fn files_outside_the_folder_are_refused() {
    let outside = tempfile::tempdir().unwrap();
    fs::write(outside.path().join("data.bin"), [0; 36]).unwrap();
    let absolute = outside.path().join("data.bin").display().to_string();
    let escaped = absolute.replace('/', "%2F");
    let dir = tempfile::tempdir().unwrap();
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink(outside.path().join("data.bin"), dir.path().join("link.bin")).unwrap();
        std::os::unix::fs::symlink(outside.path(), dir.path().join("linked")).unwrap();
    }
    for (uri, word) in [
        (absolute.as_str(), "absolute"),
        (escaped.as_str(), "absolute"),
        ("../data.bin", "leaves"),
        ("%2e%2e/data.bin", "leaves"),
        ("x/../../data.bin", "leaves"),
        ("file:///etc/passwd", "file:"),
        ("http://example.com/data.bin", "http:"),
        ("C:\\data.bin", "C:"),
        #[cfg(unix)]
        ("link.bin", "through a link"),
        #[cfg(unix)]
        ("linked/data.bin", "through a link"),
        ("missing.bin", "missing.bin"),
        ("a\nb", "cannot be read"),
        ("", "not a file name"),
        ("%00", "not a file name"),
        ("%ff", "UTF-8"),
        (".", "directory"),
        ("data:application/octet-stream,abc", "base64"),
        ("data:;base64", "comma"),
        ("data:;base64,????", "broken base64"),
        ("data:;base64,AAAA", "truncated"),
    ] {
        let mut json = Doc::triangle().value();
        json["buffers"][0]["uri"] = json!(uri);
        let path = dir.path().join("scene.gltf");
        fs::write(&path, json.to_string()).unwrap();
        assert_says(&error_of(&path), &[word, "buffer 0"]);
        // The same rule holds for images.
        let mut doc = Doc::with_material(json!({"emissiveTexture": {"index": 0}}));
        doc.json["images"][0]["uri"] = json!(uri);
        fs::write(&path, doc.embedded()).unwrap();
        let word = if word == "truncated" { "PNG" } else { word };
        assert_says(&error_of(&path), &[word, "image 0"]);
    }
}

#[cfg(unix)]
#[test]
fn links_inside_the_folder_and_of_the_folder_are_fine() {
    let (dir, path) = Doc::triangle().write();
    fs::rename(dir.path().join("data.bin"), dir.path().join("other.bin")).unwrap();
    std::os::unix::fs::symlink("other.bin", dir.path().join("data.bin")).unwrap();
    assert_eq!(Scene::load(&path).unwrap().triangle_count(), 1);
    let away = tempfile::tempdir().unwrap();
    std::os::unix::fs::symlink(dir.path(), away.path().join("here")).unwrap();
    assert_eq!(Scene::load(away.path().join("here/scene.gltf")).unwrap().triangle_count(), 1);
}

// Animations, skins and morph targets

/// Where an instance takes a point at a time.
#[track_caller]
fn at(scene: &Scene, seconds: f64, instance: usize, point: Vec3) -> Vec3 {
    let scene = scene.at(seconds, None).unwrap();
    check(&scene);
    scene.instances[instance].world_from_object.transform_point3(point)
}

/// The vertices of an instance, world space.
#[track_caller]
fn vertices(scene: &Scene, instance: usize) -> Vec<Vec3> {
    check(scene);
    let instance = scene.instances[instance];
    scene.meshes[instance.mesh].positions.iter().map(|&p| instance.world_from_object.transform_point3(p)).collect()
}

/// The normals of an instance, world space.
fn normals(scene: &Scene, instance: usize) -> Vec<Vec3> {
    let matrix = scene.instances[instance].world_from_object.inverse().transpose();
    let normals = &scene.meshes[scene.instances[instance].mesh].normals;
    normals.iter().map(|&n| matrix.transform_vector3(n).normalize()).collect()
}

#[track_caller]
fn assert_all_near(a: &[Vec3], b: &[Vec3]) {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).for_each(|(&a, &b)| assert_near(a, b));
}

#[test]
fn nodes_move_by_keys_and_what_stands_on_them_follows() {
    let mut doc = Doc::triangle();
    doc.json["nodes"] = json!([
        {"children": [1, 2, 3], "translation": [9, 9, 9]},
        {"mesh": 0, "translation": [0, 0, 2], "scale": [3, 3, 3]},
        {"camera": 0},
        {"extensions": {"KHR_lights_punctual": {"light": 0}}},
    ]);
    doc.json["cameras"] = json!([{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}}]);
    doc.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [{"type": "spot", "intensity": 5, "spot": {}}]}});
    let times = doc.floats("SCALAR", &[1., 3.]);
    // 90° about y, and its negative, which is the same rotation: the way is the shorter one.
    let turn = [0., 0., 0., 1., 0., -FRAC_1_SQRT_2, 0., -FRAC_1_SQRT_2];
    doc.animate(times, "LINEAR", 0, "rotation", &turn);
    doc.animate(times, "STEP", 0, "translation", &[10., 0., 0., 20., 0., 0.]);
    doc.animate(times, "LINEAR", 1, "scale", &[1., 1., 1., 3., 1., 5.]);
    let scene = doc.load();
    assert_eq!((scene.animations().len(), scene.animations()[0].duration), (1, 3.0));
    assert_near(scene.instances[0].world_from_object.transform_point3(Vec3::X), Vec3::new(12., 9., 11.));
    assert_near(scene.cameras[0].eye, Vec3::splat(9.));
    // Before the first key what that says; the values of the node itself are gone.
    for seconds in [0.0, 0.5, 1.0] {
        assert_near(at(&scene, seconds, 0, Vec3::X), Vec3::new(11., 0., 2.));
    }
    // Half of the way: 45° about y takes x to (1, 0, −1)/√2 and z to (1, 0, 1)/√2; the scale is (2, 1, 3).
    let h = FRAC_1_SQRT_2;
    assert_near(at(&scene, 2.0, 0, Vec3::X), Vec3::new(10. + 4. * h, 0., 0.));
    assert_near(at(&scene, 2.0, 0, Vec3::Z), Vec3::new(10. + 5. * h, 0., 5. * h));
    // A quarter: 22.5°, which a mean of the quaternions' numbers misses by 0.7°.
    let quarter = at(&scene, 1.5, 0, Vec3::X) - at(&scene, 1.5, 0, Vec3::ZERO);
    assert_near(quarter, 1.5 * Vec3::new((PI / 8.).cos(), 0., -(PI / 8.).sin()));
    assert_near(at(&scene, 3.0, 0, Vec3::ZERO), Vec3::new(22., 0., 0.));
    // After the end from the beginning: 5 s are 2 s.
    assert_near(at(&scene, 5.0, 0, Vec3::Z), at(&scene, 2.0, 0, Vec3::Z));
    assert_near(at(&scene, -1.0, 0, Vec3::Z), at(&scene, 2.0, 0, Vec3::Z));
    assert_near(at(&scene, 6.0, 0, Vec3::ZERO), Vec3::new(22., 0., 0.));

    let posed = scene.at(2.0, None).unwrap();
    assert_near(posed.cameras[0].eye, Vec3::new(10., 0., 0.));
    assert_near(posed.cameras[0].forward, Vec3::new(-h, 0., -h));
    assert_near(posed.cameras[0].up, Vec3::Y);
    assert_near(posed.lights[0].position, Vec3::new(10., 0., 0.));
    assert_near(posed.lights[0].axis, Vec3::new(-h, 0., -h));
    assert!(std::sync::Arc::ptr_eq(&posed.meshes[0], &scene.meshes[0]), "a mesh that keeps its shape is shared");
    assert!(scene.at(f64::NAN, None).unwrap_err().is_bad_input());
    assert!(scene.at(0.0, Some(1)).unwrap_err().to_string().contains("below 1"));
}

#[test]
fn cubic_splines_are_those_of_the_specification() {
    let mut doc = Doc::triangle();
    let times = doc.floats("SCALAR", &[0., 1., 3.]);
    let keys = [
        [[9., 9., 9.], [1., 2., 3.], [1., -1., 0.5]],
        [[-2., 1., 0.], [4., 0., 1.], [0.5, 2., 1.]],
        [[3., -1., 2.], [0., 5., -2.], [9., 9., 9.]],
    ];
    doc.animate(times, "CUBICSPLINE", 0, "translation", keys.as_flattened().as_flattened());
    // A quarter turn about z with resting ends, whose middle is by symmetry a turn by 45°.
    let (zero, c) = ([0., 0., 0., 0.], FRAC_1_SQRT_2);
    let ends = doc.floats("SCALAR", &[0., 3.]);
    let turn = [zero, [0., 0., 0., 1.], zero, zero, [0., 0., c, c], zero];
    doc.animate(ends, "CUBICSPLINE", 0, "rotation", turn.as_flattened());
    let scene = doc.load();
    assert_near(at(&scene, 0.0, 0, Vec3::ZERO), Vec3::new(1., 2., 3.));
    assert_near(at(&scene, 1.0, 0, Vec3::ZERO), Vec3::new(4., 0., 1.));
    assert_near(at(&scene, 3.0, 0, Vec3::ZERO), Vec3::new(0., 5., -2.));
    // By de Casteljau's construction: a Hermite curve is a Bézier curve with inner points a third of the tangents away.
    for seconds in [1.3_f32, 2.0, 2.9] {
        let (k, length) = (&keys, 2.0);
        let [p, m, q, n] = [k[1][1], k[1][2], k[2][1], k[2][0]].map(Vec3::from);
        let s = (seconds - 1.0) / length;
        let mut points = vec![p, p + m * length / 3., q - n * length / 3., q];
        while points.len() > 1 {
            points = points.windows(2).map(|pair| pair[0].lerp(pair[1], s)).collect();
        }
        assert_near(at(&scene, seconds.into(), 0, Vec3::ZERO), points[0]);
    }
    let x = at(&scene, 1.5, 0, Vec3::X) - at(&scene, 1.5, 0, Vec3::ZERO);
    assert_near(x, Vec3::new(c, c, 0.));
}

#[test]
fn keys_may_be_normalised_integers() {
    let mut doc = Doc::triangle();
    let times = doc.floats("SCALAR", &[0., 1.]);
    doc.animate(times, "LINEAR", 0, "rotation", &[0.; 8]);
    let half = (f32::from(i16::MAX) * FRAC_1_SQRT_2) as i16;
    let values: Vec<u8> = [0, 0, 0, i16::MAX, half, 0, 0, half].iter().flat_map(|v: &i16| v.to_le_bytes()).collect();
    let output = doc.accessor(&values, I16, "VEC4", 2);
    doc.json["animations"][0]["samplers"][0]["output"] = json!(output);
    assert_says(&doc.error(), &["animation 0", "channel 0", "componentType"]);
    doc.json["accessors"][output]["normalized"] = json!(true);
    let y = at(&doc.load(), 1.0, 0, Vec3::Y);
    assert!((y - Vec3::Z).length() < 1e-4, "{y}");
}

#[test]
fn animations_play_together_unless_they_move_the_same() {
    let mut doc = Doc::triangle();
    doc.json["nodes"] = json!([{"mesh": 0}, {"mesh": 0}]);
    for (node, length, x) in [(0, 1., 1.), (0, 1., 5.), (1, 2., 8.)] {
        doc.push("animations", json!({"name": format!("to {x}"), "channels": [], "samplers": []}));
        let times = doc.floats("SCALAR", &[0., length]);
        doc.animate(times, "LINEAR", node, "translation", &[0., 0., 0., x, 0., 0.]);
    }
    let scene = doc.load();
    assert_eq!(scene.animations().iter().map(|a| a.name.as_str()).collect::<Vec<_>>(), ["to 1", "to 5", "to 8"]);
    let x = |seconds, animation| {
        let scene = scene.at(seconds, animation).unwrap();
        [0, 1].map(|i| scene.instances[i].world_from_object.w_axis.x)
    };
    // Each with a length of its own.
    assert_eq!(x(0.5, None), [0.5, 2.0]);
    assert_eq!(x(1.5, None), [0.5, 6.0]);
    assert_eq!((x(0.5, Some(1)), x(0.5, Some(2))), ([2.5, 0.0], [0.0, 2.0]));
}

#[test]
fn scale_may_go_through_zero() {
    let mut doc = Doc::triangle();
    let times = doc.floats("SCALAR", &[0., 2.]);
    doc.animate(times, "LINEAR", 0, "scale", &[1., 1., 1., -1., 1., 1.]);
    let scene = doc.load();
    assert_eq!(scene.at(1.0, None).unwrap().instances.len(), 0);
    assert_near(at(&scene, 1.5, 0, Vec3::X), Vec3::new(-0.5, 0., 0.));
    doc.json["nodes"][0]["scale"] = json!([0, 0, 0]);
    let scene = doc.load();
    assert_eq!((scene.instances.len(), scene.at(0.0, None).unwrap().instances.len()), (0, 1));
}

/// A strip of two squares along y, the lower one on joint 1, the upper one on joint 2, the corners between on both; the
/// joints stand at y = 0 and 1.
fn strip() -> Doc {
    let mut doc = Doc::new();
    let positions = doc.floats("VEC3", &[0., 0., 0., 1., 0., 0., 0., 1., 0., 1., 1., 0., 0., 2., 0., 1., 2., 0.]);
    let normals = doc.floats("VEC3", &[0., 0., 1.].repeat(6));
    let indices = doc.accessor(&u16s(&[0, 1, 3, 0, 3, 2, 2, 3, 5, 2, 5, 4]), U16, "SCALAR", 12);
    doc.draw(json!({"indices": indices, "attributes": {"POSITION": positions, "NORMAL": normals}}));
    let (lower, both, upper) = ([1., 0., 0., 0.], [0.5, 0.5, 0., 0.], [0., 1., 0., 0.]);
    let weights = [lower, lower, both, both, upper, upper];
    doc.skin(&[0, 1, 0, 0].repeat(6), weights.as_flattened(), &[1, 2]);
    let bind = [Mat4::IDENTITY, Mat4::from_translation(Vec3::NEG_Y)].map(|m| m.to_cols_array());
    let bind = doc.accessor(&f32s(bind.as_flattened()), F32, "MAT4", 2);
    doc.json["skins"][0]["inverseBindMatrices"] = json!(bind);
    // The node's own transform has no influence.
    doc.json["nodes"] = json!([
        {"mesh": 0, "skin": 0, "translation": [50, 60, 70], "scale": [0, 0, 0]},
        {"children": [2]},
        {"translation": [0, 1, 0]},
    ]);
    doc.json["scenes"] = json!([{"nodes": [0, 1]}]);
    doc
}

#[test]
fn a_skin_bends() {
    let mut doc = strip();
    let rest = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [1., 1., 0.], [0., 2., 0.], [1., 2., 0.]].map(Vec3::from);
    let scene = doc.load();
    assert_all_near(&vertices(&scene, 0), &rest);
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    assert!(scene.graph.is_none(), "nothing moves");

    // The upper joint turns by 90° about x: y becomes z, z becomes −y.
    let times = doc.floats("SCALAR", &[0., 1.]);
    doc.animate(times, "LINEAR", 2, "rotation", &[0., 0., 0., 1., FRAC_1_SQRT_2, 0., 0., FRAC_1_SQRT_2]);
    let scene = doc.load();
    let bent = scene.at(1.0, None).unwrap();
    let expected = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [1., 1., 0.], [0., 1., 1.], [1., 1., 1.]].map(Vec3::from);
    assert_all_near(&vertices(&bent, 0), &expected);
    let between = Vec3::new(0., -1., 1.).normalize();
    assert_all_near(&normals(&bent, 0), &[Vec3::Z, Vec3::Z, between, between, Vec3::NEG_Y, Vec3::NEG_Y]);
    assert_all_near(&vertices(&scene, 0), &rest);
    assert_ne!(scene.fingerprint(), bent.fingerprint());
    let half = vertices(&scene.at(0.5, None).unwrap(), 0)[4];
    assert_near(half, Vec3::new(0., 1. + FRAC_1_SQRT_2, FRAC_1_SQRT_2));

    // All joints together are a motion of the whole, mirroring and all, even where the first joint has no inverse.
    for (scale, lower) in [([-2., 1., 1.], -2.), ([0., 1., 1.], 0.)] {
        doc.json["nodes"][1]["scale"] = json!(scale);
        doc.json["nodes"][1]["translation"] = json!([7, 0, 0]);
        let posed = doc.load().at(1.0, None).unwrap();
        let expected = expected.map(|v| v * Vec3::new(lower, 1., 1.) + Vec3::X * 7.);
        assert_all_near(&vertices(&posed, 0), &expected);
        assert_eq!(posed.instances[0].world_from_object.determinant() < 0.0, lower < 0.0);
    }
}

#[test]
fn surfels_lie_on_the_bent_skin() {
    let mut doc = strip();
    let times = doc.floats("SCALAR", &[0., 1.]);
    doc.animate(times, "LINEAR", 2, "rotation", &[0., 0., 0., 1., FRAC_1_SQRT_2, 0., 0., FRAC_1_SQRT_2]);
    let scene = doc.load();
    let mut surfels = Surfels::new(&scene, 256);
    let bent = scene.at(1.0, None).unwrap();
    surfels.deform(&bent, &[0]);
    let mut upper = 0;
    for (now, then) in surfels.in_world(&bent).iter().zip(Surfels::new(&scene, 256).in_world(&scene)) {
        let (x, y) = (then[0].x, then[0].y);
        let raised = y > 1.0;
        let (position, normal) = match raised {
            true => (Vec3::new(x, 1., y - 1.), Vec3::NEG_Y),
            false => (Vec3::new(x, y, 0.), Vec3::Z),
        };
        assert_near(now[0].truncate(), position);
        assert_near(now[1].truncate(), normal);
        upper += u32::from(raised);
    }
    assert_eq!(upper, 128);
}

/// The strip bends over a floor that is lit from above.
#[test]
fn a_bent_skin_casts_a_shadow_and_is_lit() {
    let mut doc = strip();
    let corners = doc.floats("VEC3", &[-9., 0., -9., -9., 0., 9., 9., 0., -9., 9., 0., 9.]);
    let floor = doc.push("meshes", json!({"primitives": [{"attributes": {"POSITION": corners}, "mode": 5}]}));
    let down = [-FRAC_1_SQRT_2, 0., 0., FRAC_1_SQRT_2]; // −z becomes −y
    doc.push("nodes", json!({"mesh": floor}));
    doc.push("nodes", json!({"rotation": down, "extensions": {"KHR_lights_punctual": {"light": 0}}}));
    doc.json["scenes"] = json!([{"nodes": [0, 1, 3, 4]}]);
    doc.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [{"type": "directional", "intensity": 3}]}});
    doc.push("materials", json!({"doubleSided": true, "pbrMetallicRoughness": {"metallicFactor": 0}}));
    doc.primitive()["material"] = json!(0);
    doc.json["meshes"][1]["primitives"][0]["material"] = json!(0);
    let times = doc.floats("SCALAR", &[0., 1.]);
    doc.animate(times, "LINEAR", 2, "rotation", &[0., 0., 0., 1., FRAC_1_SQRT_2, 0., 0., FRAC_1_SQRT_2]);
    let scene = doc.load();

    // Seen from the side, the eye at half the height of the bent part, towards what is under it and above it.
    let headless = huygens::gl::Headless::new(None).unwrap();
    let mut renderer = huygens::Renderer::new(headless.context()).unwrap();
    let eye = Vec3::new(0.5, 0.6, 4.0);
    let mut pixel = |seconds: f64, target: Vec3, layer| {
        let camera = huygens::Camera::look_at(eye, target, 0.1).unwrap();
        let options = huygens::RenderOptions { layer, ..huygens::RenderOptions::new(9, 9, camera) };
        let posed = scene.at(seconds, None).unwrap();
        let mut settings = huygens::Settings::default();
        settings.shadow.size = 512;
        let rendered = renderer.render(&posed, &settings, &options, &mut |_| ()).unwrap();
        (Vec3::from(rendered.linear[40]), rendered.stats.rebuilds.scene)
    };
    let under = Vec3::new(0.5, 0.0, 0.5);
    let (lit, _) = pixel(0.0, under, huygens::Layer::Direct);
    let (shaded, uploads) = pixel(1.0, under, huygens::Layer::Direct);
    assert!(lit.min_element() > 0.5 && shaded == Vec3::ZERO, "{lit} {shaded}");
    assert_eq!(uploads, 1, "only the vertices of the skin are new");
    // Ahead was the upright strip, in the plane z = 0; what is bent shows its lower side.
    let (depth, _) = pixel(0.0, Vec3::new(0.5, 1.4, 0.0), huygens::Layer::Depth);
    assert!((depth.x - (16.0_f32 + 0.64).sqrt()).abs() < 1e-3, "{depth}");
    let (normal, _) = pixel(1.0, Vec3::new(0.5, 1.0, 0.9), huygens::Layer::Normal);
    // Between the corners on both joints and those on the upper one.
    let expected = Vec3::new(0., -1., 1.).normalize().lerp(Vec3::NEG_Y, 0.9).normalize();
    assert!((normal - expected).length() < 1e-3, "{normal} {expected}");
}

#[test]
fn weights_of_joints_are_shares_and_may_come_in_two_sets() {
    let mut doc = strip();
    let (joints, weights) = (doc.accessor(&[1; 24], U8, "VEC4", 6), doc.floats("VEC4", &[3., 0., 0., 0.].repeat(6)));
    doc.primitive()["attributes"]["JOINTS_1"] = json!(joints);
    doc.primitive()["attributes"]["WEIGHTS_1"] = json!(weights);
    doc.json["nodes"][2]["translation"] = json!([0, 1, 8]);
    // The first set has sums of 1, the second adds 3 of the upper joint, which is 8 m away along z.
    let z: Vec<f32> = vertices(&doc.load(), 0).iter().map(|v| v.z).collect();
    assert_eq!(z, [6., 6., 7., 7., 8., 8.]);
    // Without any weight the first joint has it all.
    let none = doc.floats("VEC4", &[0.; 24]);
    doc.primitive()["attributes"]["WEIGHTS_0"] = json!(none);
    doc.primitive()["attributes"]["WEIGHTS_1"] = json!(none);
    assert!(vertices(&doc.load(), 0).iter().all(|v| v.z == 0.0));
}

#[test]
fn morph_targets_are_weighted() {
    let mut doc = Doc::new();
    let positions = doc.floats("VEC3", &[0., 0., 0., 1., 0., 0., 0., 1., 0., 9., 9., 9.]);
    let ups = doc.floats("VEC3", &[0., 0., 1.].repeat(4));
    // The last vertex is not used, and the first target says nothing of normals.
    let up = doc.floats("VEC3", &[0., 0., 1., 0., 0., 2., 0., 0., 3., 7., 7., 7.]);
    let turned = doc.floats("VEC3", &[1., 0., -1.].repeat(4));
    let indices = doc.accessor(&u16s(&[0, 1, 2]), U16, "SCALAR", 3);
    doc.draw(json!({"indices": indices, "attributes": {"POSITION": positions, "NORMAL": ups},
        "targets": [{"POSITION": up}, {"NORMAL": turned}]}));
    doc.json["nodes"] = json!([{"mesh": 0}, {"mesh": 0, "weights": [0.5, 1], "translation": [0, 0, 5]}]);
    doc.json["meshes"][0]["weights"] = json!([0, 0.5]);
    let scene = doc.load();
    assert_all_near(&vertices(&scene, 0), &[Vec3::ZERO, Vec3::X, Vec3::Y]);
    assert_all_near(&normals(&scene, 0), &[Vec3::new(1., 0., 1.).normalize(); 3]);
    let raised = [Vec3::new(0., 0., 5.5), Vec3::new(1., 0., 6.), Vec3::new(0., 1., 6.5)];
    assert_all_near(&vertices(&scene, 1), &raised);
    assert_all_near(&normals(&scene, 1), &[Vec3::X; 3]);

    let times = doc.floats("SCALAR", &[0., 4.]);
    doc.animate(times, "LINEAR", 0, "weights", &[0., 0., 2., 4.]);
    let posed = doc.load().at(1.0, None).unwrap();
    assert_all_near(&vertices(&posed, 0), &raised.map(|v| v - Vec3::Z * 5.));
    assert_all_near(&normals(&posed, 0), &[Vec3::X; 3]);
    assert_all_near(&vertices(&posed, 1), &raised);

    // Without normals, those of the triangles as they are then.
    doc.primitive()["attributes"] = json!({"POSITION": positions});
    let posed = doc.load().at(1.0, None).unwrap();
    let normal = (raised[1] - raised[0]).cross(raised[2] - raised[0]).normalize();
    assert_all_near(&normals(&posed, 0), &[normal; 3]);
}

#[test]
fn tangents_of_deformed_meshes_stay_at_right_angles() {
    let mut doc = Doc::with_material(json!({"normalTexture": {"index": 0}}));
    let deltas = doc.floats("VEC3", &[0., 0., 0., 0., 0., 1., 0., 0., 1., 0., 0., 0.]);
    let turned = doc.floats("VEC3", &[-1., 0., 0.].repeat(4));
    doc.primitive()["targets"] = json!([{"POSITION": deltas, "NORMAL": turned}]);
    doc.json["meshes"][0]["weights"] = json!([1]);
    let scene = doc.load();
    let h = FRAC_1_SQRT_2;
    for tangent in &scene.meshes[0].tangents {
        assert_near(tangent.truncate(), Vec3::new(h, 0., h));
        assert_eq!(tangent.w, 1.0);
    }
}

#[test]
fn broken_animations_are_refused() {
    let good = || {
        let mut doc = strip();
        let deltas = doc.floats("VEC3", &[0.; 18]);
        doc.primitive()["targets"] = json!([{"POSITION": deltas}]);
        let times = doc.floats("SCALAR", &[0., 1.]);
        doc.animate(times, "LINEAR", 2, "translation", &[0.; 6]);
        doc.animate(times, "LINEAR", 0, "weights", &[0.; 2]);
        doc
    };
    good().load();
    type Break = fn(&mut Doc);
    let cases: &[(Break, &[&str])] = &[
        (|d| d.json["animations"][0]["channels"][0]["sampler"] = json!(7), &["animation 0", "sampler 7", "below 2"]),
        (|d| d.json["animations"][0]["channels"][0]["target"]["node"] = json!(7), &["animation 0", "node 7"]),
        (|d| d.json["animations"][0]["samplers"][0]["input"] = json!(99), &["sampler 0", "accessor 99"]),
        (|d| d.json["animations"][0]["samplers"][0]["output"] = json!(99), &["channel 0", "accessor 99"]),
        (|d| d.json["animations"][0]["samplers"][0]["output"] = json!(2), &["type", "VEC3"]),
        (|d| d.json["animations"][0]["samplers"][0]["interpolation"] = json!("CUBICSPLINE"), &["2 values", "6"]),
        (|d| d.json["animations"][0]["samplers"][0]["interpolation"] = json!("CUBIC"), &["interpolation", "STEP"]),
        (|d| d.json["animations"][0]["channels"][1]["target"] = json!({"node": 0, "path": "rotation"}), &["VEC4"]),
        (|d| d.json["animations"][0]["channels"][1]["target"]["node"] = json!(1), &["node 1", "morph targets"]),
        (|d| d.json["nodes"][2]["matrix"] = json!(Mat4::IDENTITY.to_cols_array()), &["node 2", "matrix"]),
        (
            |d| {
                let channel = d.json["animations"][0]["channels"][0].clone();
                d.json["animations"][0]["channels"].as_array_mut().unwrap().push(channel);
            },
            &["node 2", "twice"],
        ),
        (
            |d| {
                let times = d.floats("SCALAR", &[1., 1.]);
                d.json["animations"][0]["samplers"][0]["input"] = json!(times);
            },
            &["times", "rising"],
        ),
        (
            |d| {
                let times = d.floats("SCALAR", &[-1., 1.]);
                d.json["animations"][0]["samplers"][0]["input"] = json!(times);
            },
            &["times", "rising"],
        ),
        (
            |d| {
                let times = d.floats("SCALAR", &[]);
                d.json["animations"][0]["samplers"][0]["input"] = json!(times);
            },
            &["times"],
        ),
        (
            |d| {
                let times = d.floats("SCALAR", &[0., f32::NAN]);
                d.json["animations"][0]["samplers"][0]["input"] = json!(times);
            },
            &["NaN"],
        ),
        (|d| d.json["nodes"][0]["weights"] = json!([1, 2]), &["node 0", "2 weights", "1 morph"]),
        (|d| d.json["meshes"][0]["weights"] = json!([]), &["node 0", "0 weights"]),
        (|d| d.primitive()["targets"][0]["POSITION"] = json!(2), &["morph target 0", "12 elements", "6"]),
        (|d| d.primitive()["targets"][0]["POSITION"] = json!(99), &["morph target 0", "accessor 99"]),
        (
            |d| {
                let mut other = d.primitive().clone();
                other["targets"] = json!([]);
                d.json["meshes"][0]["primitives"].as_array_mut().unwrap().push(other);
            },
            &["mesh 0", "morph targets", "the same"],
        ),
        (|d| d.json["nodes"][0]["skin"] = json!(3), &["node 0", "skin 3", "below 1"]),
        (|d| d.json["skins"][0]["joints"] = json!([1, 9]), &["skin 0", "node 9"]),
        (|d| d.json["skins"][0]["joints"] = json!([1]), &["node 0", "joint 1", "below 1"]),
        (|d| d.json["skins"][0]["joints"] = json!([]), &["joints"]),
        (|d| d.json["skins"][0]["joints"] = json!([1, 2, 2]), &["skin 0", "2 inverse bind", "3 joints"]),
        (|d| d.json["skins"][0]["inverseBindMatrices"] = json!(0), &["skin 0", "MAT4"]),
        (|d| d.json["scenes"][0]["nodes"] = json!([0]), &["joint node 1", "drawn scene"]),
        (|d| drop(d.primitive()["attributes"].as_object_mut().unwrap().remove("WEIGHTS_0")), &["JOINTS_0", "both"]),
        (|d| d.primitive()["attributes"]["WEIGHTS_0"] = json!(2), &["WEIGHTS_0", "12 elements"]),
        (|d| d.primitive()["attributes"]["JOINTS_0"] = json!(1), &["JOINTS_0", "5121"]),
        (|d| d.primitive()["attributes"]["WEIGHTS_0"] = json!(0), &["VEC4"]),
    ];
    for (i, (damage, words)) in cases.iter().enumerate() {
        let mut doc = good();
        damage(&mut doc);
        println!("{i}: {}", doc.error());
        assert_says(&doc.error(), words);
    }
}

#[test]
fn what_animations_take_too_far_is_refused_then() {
    let mut doc = Doc::triangle();
    let times = doc.floats("SCALAR", &[0., 1.]);
    doc.animate(times, "LINEAR", 0, "translation", &[0., 0., 0., 1e38, 0., 0.]);
    let scene = doc.load();
    assert!(scene.at(0.0, None).is_ok());
    let error = scene.at(1.0, None).unwrap_err();
    assert!(error.is_bad_input());
    assert_says(&error.to_string(), &["scene.gltf", "at 1 s", "node 0", "allowed"]);
}

#[test]
fn what_deforms_counts_towards_the_limits() {
    // A hundred thousand nodes with a hundred thousand weights each would be few bytes and 40 GB.
    let mut doc = Doc::triangle();
    doc.primitive()["targets"] = json!(vec![json!({}); 20_000]);
    doc.json["nodes"] = json!(vec![json!({"mesh": 0}); 20_000]);
    let start = Instant::now();
    assert_says(&doc.error(), &["too large", "100000000 vertices"]);
    assert!(start.elapsed() < Duration::from_secs(20), "{:?}", start.elapsed());
}

// Broken files

/// A file that uses most of what the loader reads.
fn rich() -> Doc {
    let mut doc = Doc::with_material(json!({"normalTexture": {"index": 0, "extensions": {"KHR_texture_transform":
        {"offset": [0.5, 0], "rotation": 1, "scale": [2, 2]}}}, "alphaMode": "MASK"}));
    let image = doc.view(&png(&DynamicImage::new_rgb8(2, 2)));
    doc.json["images"][0] = json!({"bufferView": image, "mimeType": "image/png"});
    doc.json["samplers"] = json!([{"magFilter": 9729, "wrapS": 33071}]);
    doc.json["textures"][0]["sampler"] = json!(0);
    let colors = doc.accessor(&[255; 16], U8, "VEC4", 4);
    doc.json["accessors"][colors]["normalized"] = json!(true);
    doc.primitive()["attributes"]["COLOR_0"] = json!(colors);
    let (indices, values) = (doc.view(&[1, 2]), doc.view(&f32s(&[1., 0., 0., 1., 1., 0.])));
    doc.json["accessors"][0]["sparse"] = json!({"count": 2,
        "indices": {"bufferView": indices, "componentType": U8}, "values": {"bufferView": values}});
    doc.json["cameras"] = json!([{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}}]);
    doc.json["nodes"] = json!([{"children": [1, 2]}, {"mesh": 0, "scale": [1, 2, 3]},
        {"camera": 0, "extensions": {"KHR_lights_punctual": {"light": 0}}}]);
    doc.json["scenes"] = json!([{"nodes": [0]}]);
    doc.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [{"type": "spot", "intensity": 5, "spot": {}}]}});
    doc.skin(&[0; 16], &[1., 0., 0., 0.].repeat(4), &[2]);
    doc.json["nodes"][1]["skin"] = json!(0);
    let deltas = doc.floats("VEC3", &[0.1; 12]);
    doc.primitive()["targets"] = json!([{"POSITION": deltas, "NORMAL": deltas, "TANGENT": deltas}]);
    doc.json["meshes"][0]["weights"] = json!([0.5]);
    let times = doc.floats("SCALAR", &[0., 1.]);
    doc.animate(times, "LINEAR", 2, "rotation", &[0., 0., 0., 1., 0., 1., 0., 0.]);
    doc.animate(times, "CUBICSPLINE", 1, "weights", &[0., 0., 1., 1., 1., 0.]);
    doc
}

#[test]
fn mutated_files_never_panic() {
    let doc = rich();
    let dir = tempfile::tempdir().unwrap();
    let start = Instant::now();
    let mut random = Random(1);
    for (name, good) in [("a.glb", doc.glb()), ("a.gltf", doc.embedded().into_bytes())] {
        let path = dir.path().join(name);
        fs::write(&path, &good).unwrap();
        let scene = Scene::load(&path).unwrap();
        assert_eq!((scene.triangle_count(), scene.lights.len(), scene.images.len()), (2, 1, 1));
        let mut loaded = 0;
        for round in 0..6000 {
            let mut bytes = good.clone();
            if round % 20 == 0 {
                bytes.truncate(random.below(good.len()));
            }
            for _ in 0..=random.below(3) {
                let at = random.below(good.len());
                if let Some(byte) = bytes.get_mut(at) {
                    // Digits become digits, so that JSON stays JSON and its numbers change.
                    *byte = if byte.is_ascii_digit() { b'0' + random.below(10) as u8 } else { random.below(256) as u8 };
                }
            }
            fs::write(&path, &bytes).unwrap();
            match Scene::load(&path) {
                Ok(scene) => {
                    loaded += 1;
                    check(&scene);
                    let _ = scene.at(0.7, None).map(|scene| check(&scene));
                }
                Err(_) => drop(error_of(&path)),
            }
        }
        assert!(loaded > 100, "{name}: only {loaded} still load: the mutations reach too little");
    }
    assert!(start.elapsed() < Duration::from_secs(120), "{:?}", start.elapsed());
}

// Progress

#[test]
fn loading_tells_how_far_it_is_and_ends_when_it_is_asked_to() {
    let mut doc = Doc::triangle();
    doc.json["nodes"] = json!([{"mesh": 0}, {"mesh": 0}, {"mesh": 0}, {"children": [0, 1, 2]}]);
    let (_dir, path) = doc.write();
    let mut shares = Vec::new();
    let scene = Scene::load_with(&path, &mut |share| {
        shares.push(share);
        true
    });
    assert_eq!(scene.unwrap().instances.len(), 3);
    assert!(
        shares.is_sorted() && shares[0] == 0.0 && shares[shares.len() - 1] == 1.0 && shares.len() > 4,
        "{shares:?}"
    );
    for stop in 0..shares.len() {
        let mut heard = 0;
        let stopped = Scene::load_with(&path, &mut |_| {
            heard += 1;
            heard <= stop
        });
        assert!(matches!(stopped, Err(huygens::Error::Cancelled)) && heard == stop + 1, "{stop}: {heard}");
    }
}
