//! Reads glTF 2.0 files (.gltf, .glb) into a [`Scene`].
//!
//! The gltf crate's JSON types give the structure; every index, range and number is checked here, since files come
//! from strangers: whatever a file holds, loading ends with a scene or with one line that says what is wrong.
//!
//! What is read in a way of its own:
//! - A mesh with a skin or morph targets is deformed into one of its own for each node that has it. The node of a skinned
//!   mesh does not move it. Weights of joints are taken as shares of their sum.
//! - A light's `range` is ignored: the inverse-square law has no end.
//! - A camera's `zfar`, `aspectRatio` and `xmag` are ignored: the picture's size gives the aspect, depth has no end.
//! - A node's scale does not act on cameras and lights.
//! - A node that mirrors (negative determinant) keeps its matrix. Triangles of a mesh are counter-clockwise from the
//!   front in object space; in world space such an instance's are clockwise, so that whoever culls or needs a front
//!   face turns it round where the determinant is negative. Normals need no sign.

mod accessor;
mod animation;
mod files;
mod material;
mod mesh;

use std::collections::hash_map::Entry;
use std::collections::{BTreeSet, HashMap};
use std::f32::consts::{FRAC_PI_2, PI};
use std::path::Path;
use std::sync::Arc;

use glam::{DAffine3, DQuat, DVec3, Mat4, Vec3, Vec4};
use gltf::json::camera::Type as CameraType;
use gltf::json::extensions::scene::khr_lights_punctual as punctual;
use gltf::json::validation::Checked;
use gltf::json::{Node, Root, Value, deserialize};
use serde::Deserialize;

use self::accessor::Buffers;
use self::files::{Files, shorten};
use super::animation::{Graph, Local, Node as GraphNode, Parts, Placement, forward, place_camera};
use super::deform::Deformable;
use super::{Instance, Material, Scene};
use crate::camera::Projection;
use crate::{Camera, Error, Light, Profile, Result};

/// Extensions that this loader acts on.
const EXTENSIONS: [&str; 6] = [
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_specular",
    "KHR_materials_unlit",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
];
/// Farthest from the origin, in radii of the scene, that its shape is hardly touched by the rounding of coordinates.
const FAR_OFF: f32 = 1e3;
/// Smallest radius of a scene, m: nearer to the eye than a few times 1e-8 m, pixels are not finite.
const LEAST_RADIUS: f32 = 1e-6;
/// Most instances: a small file can ask for nodes × primitives of them.
const MAX_INSTANCES: usize = 1_000_000;
/// Most triangles, instances counted each.
const MAX_TRIANGLES: usize = 20_000_000;

/// Strongest light, candela or lux, and strongest emission, W/(m² sr): its products with areas and squares of distances stay inside f32.
const MAX_INTENSITY: f32 = 1e20;
/// Largest texture coordinate, and largest number in what transforms it: both together stay inside f32 with the size of any
/// texture.
const MAX_TEXTURE_COORDINATE: f32 = 1e12;
const UNUSED_CAMERA: &str = "a camera that no node of the drawn scene uses is left out, and later ones move up";

/// What is wrong, without the file's name.
type Problem<T> = Result<T, String>;

/// Loads the default scene of a file. Leaves `lights` and `cameras` empty if it has none.
pub(crate) fn load(path: &Path, progress: &mut dyn FnMut(f32) -> bool) -> Result<Scene> {
    let mut steps = Steps { progress, done: 0, all: 1, cancelled: false };
    let scene = read(path, &mut steps);
    if steps.cancelled {
        return Err(Error::Cancelled);
    }
    scene.map_err(|problem| {
        let mut problem = one_line(&problem);
        // Where the message itself says nothing narrower, or was cut.
        if !problem.contains("allowed") {
            problem.push_str("; allowed: a complete glTF 2.0 file (.gltf or .glb)");
        }
        Error::File { path: path.to_owned(), problem }
    })
}

/// How far the loading has come: images and nodes count the same.
struct Steps<'a> {
    progress: &'a mut dyn FnMut(f32) -> bool,
    done: usize,
    all: usize,
    cancelled: bool,
}

impl Steps<'_> {
    /// Takes note of steps that are done; fails if the caller wants no more.
    fn advance(&mut self, steps: usize) -> Problem<()> {
        self.done += steps;
        self.cancelled |= !(self.progress)((self.done as f32 / self.all.max(1) as f32).min(1.0));
        if self.cancelled { Err("cancelled".to_owned()) } else { Ok(()) }
    }
}

fn read(path: &Path, steps: &mut Steps) -> Problem<Scene> {
    let bytes = files::read_main(path)?;
    let (json, bin) = files::split(&bytes)?;
    let head: Head = deserialize::from_slice(json)
        .map_err(|e| format!("not a glTF file, its JSON is broken: {e}; allowed: glTF 2.0"))?;
    head.check()?;
    let root: Root = deserialize::from_slice(json)
        .or_else(|e| filled_in(json).map_or(Err(e), deserialize::from_value))
        .map_err(|e| format!("not a valid glTF file: {e}; allowed: glTF 2.0"))?;

    steps.all = root.images.len() + root.nodes.len();
    steps.advance(0)?;
    let mut loader = Loader {
        steps,
        buffers: Buffers::new(&root, bin),
        files: Files::new(path)?,
        scene: Scene {
            name: path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned(),
            ..Scene::default()
        },
        default_material: None,
        elements: 0,
        read: 0,
        triangles: 0,
        cameras: Vec::new(),
        lights: Vec::new(),
        drawn: vec![None; root.nodes.len()],
        skins: HashMap::new(),
        graph: Graph::default(),
        warnings: Vec::new(),
    };
    loader.materials()?;
    let drawn = loader.nodes()?;
    loader.skins()?;
    loader.sort_cameras();
    loader.animations()?;
    let hidden = loader.graph.pose(&mut loader.scene, None)?;
    loader.sort_lights();
    let mut scene = loader.scene;
    if !loader.graph.animations.is_empty() {
        scene.graph = Some(loader.graph.into());
    }
    scene.files = loader.files.opened;
    let times = |(text, count)| if count > 1 { format!("{text} ({count} times)") } else { String::from(text) };
    scene.warnings = loader.warnings.into_iter().map(times).collect();
    if root.scenes.len() > 1 {
        let others = root.scenes.len() - 1;
        scene.warnings.push(format!("scene {drawn} of the file is drawn, its other scenes ({others}) are not"));
    }
    if !hidden.is_empty() {
        let nodes = listed(hidden.iter().map(usize::to_string));
        scene
            .warnings
            .push(format!("meshes that are scaled to zero, along one axis or more, are not drawn: node {nodes}"));
    }
    let ignored = unknown(&root.extensions_used);
    if !ignored.is_empty() {
        scene.warnings.push(one_line(&format!("extensions that are ignored: {}", listed(ignored.iter()))));
    }
    let has_area = |instance: &Instance| {
        let mesh = &scene.meshes[instance.mesh];
        mesh.indices.chunks_exact(3).any(|triangle| mesh.area_normal(triangle) != DVec3::ZERO)
    };
    if scene.triangle_count() > 0 && !scene.instances.iter().any(has_area) {
        scene.warnings.push("all triangles of the scene are degenerate; there is only background".to_owned());
    } else if let Some(bounds) = scene.bounds() {
        let off = bounds.center().length();
        if bounds.radius() < LEAST_RADIUS {
            return Err(format!(
                "the scene's radius is {:.1e} m; allowed: {LEAST_RADIUS:e} m or more",
                bounds.radius()
            ));
        }
        if off > FAR_OFF * bounds.radius() {
            scene.warnings.push(format!(
                "the scene is {off:.0} m from the origin and small: there coordinates are rounded to about {:.0e} m, and so \
                 are light and shadow",
                off * f32::EPSILON
            ));
        }
    }
    Ok(scene)
}

/// The part of the JSON that decides whether the rest can be understood.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase", expecting = "a JSON object")]
struct Head {
    asset: Option<Asset>,
    #[serde(default)]
    extensions_required: Vec<String>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase", expecting = "a JSON object")]
struct Asset {
    version: Option<String>,
    min_version: Option<String>,
}

impl Head {
    fn check(&self) -> Problem<()> {
        let asset = self.asset.as_ref().ok_or("not a glTF file: its JSON has no `asset`; allowed: glTF 2.0")?;
        let version = asset.version.as_deref().unwrap_or("(none)");
        let least = asset.min_version.as_deref().unwrap_or("2.0");
        if !version.starts_with("2.") || least != "2.0" {
            let version = if version.starts_with("2.") { least } else { version };
            return Err(format!("glTF version {}; allowed: 2.0", shorten(version)));
        }
        let unsupported = unknown(&self.extensions_required);
        match unsupported.is_empty() {
            true => Ok(()),
            false => Err(format!(
                "it requires extensions that are not supported: {}; allowed: {}",
                listed(unsupported.iter()),
                EXTENSIONS.join(", ")
            )),
        }
    }
}

/// JSON with what glTF 2.0 lets a file leave out and the gltf crate demands; `None` where nothing of it is missing.
fn filled_in(json: &[u8]) -> Option<Value> {
    fn elements<'a>(value: &'a mut Value, name: &str) -> impl Iterator<Item = &'a mut Value> {
        value.get_mut(name).and_then(Value::as_array_mut).into_iter().flatten()
    }
    let mut root: Value = deserialize::from_slice(json).ok()?;
    let mut missing = false;
    for scene in elements(&mut root, "scenes").filter_map(Value::as_object_mut) {
        scene.entry("nodes").or_insert_with(|| {
            missing = true;
            Value::Array(Vec::new())
        });
    }
    for channel in elements(&mut root, "animations").flat_map(|animation| elements(animation, "channels")) {
        let target = channel.get_mut("target").and_then(Value::as_object_mut);
        if let Some(target) = target.filter(|target| !target.contains_key("node")) {
            missing = true;
            // A channel whose path is unknown is warned of and does not play, whatever its node.
            target.insert("node".to_owned(), 0.into());
            target.insert("path".to_owned(), "".into());
        }
    }
    missing.then_some(root)
}

/// The extensions among these that this loader does not act on, each once.
fn unknown(names: &[String]) -> BTreeSet<&String> {
    names.iter().filter(|name| !EXTENSIONS.contains(&name.as_str())).collect()
}

/// The first of these, for a message.
fn listed(names: impl Iterator<Item = impl AsRef<str>>) -> String {
    names.take(8).map(|name| shorten(name.as_ref())).collect::<Vec<_>>().join(", ")
}

/// Texts of the file may hold anything; messages are one line of bearable length.
fn one_line(text: &str) -> String {
    let clean: String = text.chars().take(500).map(|c| if c.is_control() { ' ' } else { c }).collect();
    clean
}

/// An element of one of the file's lists.
fn get<'a, T>(list: &'a [T], index: usize, what: &str) -> Problem<&'a T> {
    list.get(index).ok_or_else(|| {
        format!("{what} {index} is out of range; allowed: below {}, the number that the file has", list.len())
    })
}

/// The state of loading one file.
struct Loader<'a, 'p> {
    steps: &'a mut Steps<'p>,
    buffers: Buffers<'a>,
    files: Files,
    scene: Scene,
    default_material: Option<usize>,
    elements: usize,
    read: usize,
    triangles: usize,
    /// Cameras as found, with their number in the file, the node's number and its name.
    cameras: Vec<(usize, usize, Option<String>, Camera)>,
    /// Lights as found, with the index of their node in the graph.
    lights: Vec<(usize, Light)>,
    /// Index in the graph of each node that is drawn.
    drawn: Vec<Option<usize>>,
    /// Index in the graph of each skin that is used.
    skins: HashMap<usize, usize>,
    graph: Graph,
    warnings: Vec<(&'static str, usize)>,
}

impl Loader<'_, '_> {
    /// Notes what is not drawn as the file says: one line for each kind.
    fn warn(&mut self, text: &'static str) {
        match self.warnings.iter_mut().find(|(t, _)| *t == text) {
            Some((_, count)) => *count += 1,
            None => self.warnings.push((text, 1)),
        }
    }

    fn default_material(&mut self) -> usize {
        *self.default_material.get_or_insert_with(|| {
            self.scene.materials.push(Material::default());
            self.scene.materials.len() - 1
        })
    }

    /// Walks the default scene's nodes and places what hangs on them; returns the scene's number. Chains may be long:
    /// nothing here recurses.
    fn nodes(&mut self) -> Problem<usize> {
        let root = self.buffers.root;
        let mut parents = vec![None; root.nodes.len()];
        for (number, node) in root.nodes.iter().enumerate() {
            for child in node.children.iter().flatten() {
                get(&root.nodes, child.value(), "node")?;
                if let Some(parent) = parents[child.value()].replace(number) {
                    return Err(format!(
                        "node {} has two parents, {parent} and {number}; allowed: a tree",
                        child.value()
                    ));
                }
            }
        }
        let tops: Vec<usize> = (0..parents.len()).filter(|&n| parents[n].is_none()).collect();
        // With one parent each, what cannot be reached from the tops goes round in a cycle.
        let mut reached = vec![false; parents.len()];
        let mut stack = tops.clone();
        while let Some(number) = stack.pop() {
            reached[number] = true;
            stack.extend(root.nodes[number].children.iter().flatten().map(|child| child.value()));
        }
        if let Some(number) = reached.iter().position(|&r| !r) {
            return Err(format!("node {number} is part of a cycle; allowed: a tree"));
        }

        let drawn = root.scene.map_or(0, |s| s.value());
        let chosen = match root.scene {
            Some(_) => Some(get(&root.scenes, drawn, "scene")?),
            None => root.scenes.first(),
        };
        let mut stack = Vec::new();
        for number in chosen.map_or(tops, |s| s.nodes.iter().map(|n| n.value()).collect()).into_iter().rev() {
            get(&root.nodes, number, "node")?;
            // `reached` now says which roots were not taken yet.
            if parents[number].is_some() || !std::mem::take(&mut reached[number]) {
                return Err(format!("the scene lists node {number}, a child or a second time; allowed: roots, once"));
            }
            stack.push((number, None));
        }

        let mut meshes = HashMap::new();
        while let Some((number, parent)) = stack.pop() {
            let node = &root.nodes[number];
            let local = local(node).map_err(|e| format!("node {number}: {e}"))?;
            let own = local.transform();
            let (world, parent) = match parent {
                Some((parent, world)) => (world * own, Some(parent)),
                None => (own, None),
            };
            let index = self.graph.nodes.len();
            self.drawn[number] = Some(index);
            self.graph.nodes.push(GraphNode { number, parent, local, weights: Vec::new() });
            self.place(node, index, world, &mut meshes)?;
            self.steps.advance(1)?;
            let children = node.children.iter().flatten().rev();
            stack.extend(children.map(|child| (child.value(), Some((index, world)))));
        }
        Ok(drawn)
    }

    fn place(
        &mut self,
        node: &Node,
        at: usize,
        world: DAffine3,
        meshes: &mut HashMap<usize, (Vec<Shape>, usize)>,
    ) -> Problem<()> {
        let root = self.buffers.root;
        if let Some(index) = node.camera {
            let json = get(&root.cameras, index.value(), "camera")?;
            let mut camera = self.camera(json).map_err(|e| format!("camera {}: {e}", index.value()))?;
            match place_camera(&mut camera, world) {
                true => self.cameras.push((index.value(), at, node.name.clone(), camera)),
                false => self.warn("a camera or light that its node scales to zero is left out"),
            }
        }
        if let Some(light) = node.extensions.as_ref().and_then(|e| e.khr_lights_punctual.as_ref()) {
            let lights = root.extensions.as_ref().and_then(|e| e.khr_lights_punctual.as_ref());
            let json = get(lights.map_or(&[][..], |l| &l.lights), light.light.value(), "light")?;
            let light = self.light(json, node, world).map_err(|e| format!("light {}: {e}", light.light.value()))?;
            match light {
                Some(light) => self.lights.push((at, light)),
                None => self.warn("a camera or light that its node scales to zero is left out"),
            }
        }
        let Some(index) = node.mesh.map(|m| m.value()) else {
            return Ok(());
        };
        let json = get(&root.meshes, index, "mesh")?;
        if let Entry::Vacant(entry) = meshes.entry(index) {
            let targets = |primitive: &gltf::json::mesh::Primitive| primitive.targets.as_ref().map_or(0, Vec::len);
            let count = json.primitives.first().map_or(0, targets);
            if json.primitives.iter().any(|primitive| targets(primitive) != count) {
                return Err(format!(
                    "mesh {index}: primitives with different numbers of morph targets; allowed: the same"
                ));
            }
            let name = json.name.as_deref().unwrap_or_default();
            let mut converted = Vec::new();
            for (p, primitive) in json.primitives.iter().enumerate() {
                let shape = self.primitive(primitive, name);
                if let Some(shape) = shape.map_err(|e| format!("mesh {index}, primitive {p}: {e}"))? {
                    converted.push(Shape { extent: shape.base.extent(), deformable: shape.into(), shared: None });
                }
            }
            entry.insert((converted, count));
        }
        let number = self.graph.nodes[at].number;
        let skin = match node.skin {
            Some(skin) => {
                get(&root.skins, skin.value(), "skin").map_err(|e| format!("node {number}: {e}"))?;
                Some(skin.value())
            }
            None => None,
        };
        let (shapes, count) = meshes.get_mut(&index).map_or((&mut [][..], 0), |(shapes, count)| (shapes, *count));
        for Shape { deformable, shared, extent } in &mut *shapes {
            let base = &deformable.base;
            let skinned = skin.filter(|_| deformable.influences > 0);
            if skin.is_some() && skinned.is_none() {
                self.warn("a mesh without joints has a skin, which does not move it");
            }
            let own = skinned.is_some() || deformable.has_targets();
            let mesh = match shared.filter(|_| !own) {
                Some(shared) => shared,
                None => {
                    self.scene.meshes.push(base.clone());
                    self.scene.meshes.len() - 1
                }
            };
            if own {
                self.count_read(base.positions.len().saturating_mul(count + deformable.influences))?;
                self.count_elements(base.positions.len() + base.indices.len())?;
            } else {
                *shared = Some(mesh);
            }
            let known = self.skins.len();
            let skin = skinned.map(|skin| *self.skins.entry(skin).or_insert(known));
            self.triangles += base.indices.len() / 3;
            let deformable = own.then(|| deformable.clone());
            self.graph.placements.push(Placement { node: at, mesh, extent: *extent, deformable, skin });
        }
        if self.graph.placements.len() > MAX_INSTANCES || self.triangles > MAX_TRIANGLES {
            return Err(format!(
                "the file is too large; allowed: {MAX_INSTANCES} instances, {MAX_TRIANGLES} triangles in all of them"
            ));
        }
        // After the counting, which bounds what all nodes take together.
        let weights = node.weights.as_ref().or(json.weights.as_ref());
        match weights {
            Some(weights) if weights.len() != count => {
                return Err(format!(
                    "node {number}: {} weights for {count} morph targets; allowed: one for each",
                    weights.len()
                ));
            }
            Some(weights) if !weights.iter().all(|weight| weight.is_finite()) => {
                return Err(format!("node {number}: a weight that is NaN or infinite; allowed: finite"));
            }
            _ => {}
        }
        if shapes.iter().any(|shape| shape.deformable.has_targets()) {
            self.graph.nodes[at].weights = weights.cloned().unwrap_or_else(|| vec![0.0; count]);
        }
        Ok(())
    }

    /// Converts a camera, named as the file names it.
    fn camera(&self, json: &gltf::json::Camera) -> Problem<Camera> {
        let (projection, near) = match (json.type_, &json.perspective, &json.orthographic) {
            (Checked::Valid(CameraType::Perspective), Some(p), _) => {
                if !(p.yfov > 0.0 && p.yfov < PI && p.znear > 0.0 && p.znear.is_finite()) {
                    return Err("yfov or znear out of range; allowed: 0 < yfov < π, znear > 0".to_owned());
                }
                (Projection::Perspective { fov_y: p.yfov }, p.znear)
            }
            (Checked::Valid(CameraType::Orthographic), _, Some(o)) => {
                let half_height = o.ymag.abs();
                if !(half_height > 0.0 && half_height.is_finite() && o.znear >= 0.0 && o.znear.is_finite()) {
                    return Err("ymag or znear out of range; allowed: ymag ≠ 0, znear ≥ 0".to_owned());
                }
                (Projection::Orthographic { half_height }, o.znear)
            }
            _ => return Err("unknown type or no data for it; allowed: perspective, orthographic".to_owned()),
        };
        Ok(Camera {
            name: json.name.clone().unwrap_or_default(),
            eye: Vec3::ZERO,
            forward: Vec3::NEG_Z,
            up: Vec3::Y,
            projection,
            near: Some(near),
        })
    }

    /// Puts cameras in the order of the file's list, those on several nodes in the order of the nodes.
    fn sort_cameras(&mut self) {
        let mut uses = vec![0; self.buffers.root.cameras.len()];
        self.cameras.iter().for_each(|camera| uses[camera.0] += 1);
        uses.iter().filter(|&&n| n == 0).for_each(|_| self.warn(UNUSED_CAMERA));
        let number = |node: usize| self.graph.nodes[node].number;
        self.cameras.sort_by_key(|&(index, node, ..)| (index, number(node)));
        for (index, at, node, mut camera) in std::mem::take(&mut self.cameras) {
            if let Some(name) = node.filter(|_| uses[index] > 1 || camera.name.is_empty()) {
                camera.name = name;
            }
            self.graph.cameras.push((self.scene.cameras.len(), at));
            self.scene.cameras.push(camera);
        }
    }

    /// Converts a light; `None` if its node has no direction.
    fn light(&self, json: &punctual::Light, node: &Node, world: DAffine3) -> Problem<Option<Light>> {
        let intensity = Vec3::from(json.color) * json.intensity;
        if !intensity.is_finite() || intensity.min_element() < 0.0 || intensity.max_element() > MAX_INTENSITY {
            return Err(format!("intensity × color is out of range; allowed: 0 to {MAX_INTENSITY:e}"));
        }
        let profile = match (json.type_, &json.spot) {
            (Checked::Valid(punctual::Type::Point), _) => Profile::Point,
            (Checked::Valid(punctual::Type::Directional), _) => Profile::Directional,
            (Checked::Valid(punctual::Type::Spot), Some(spot)) => {
                let (inner, outer) = (spot.inner_cone_angle, spot.outer_cone_angle);
                // A hair above π/2 is a quarter turn written with few digits; equal angles are a hard edge.
                if !(0.0..=outer).contains(&inner) || outer <= 0.0 || outer > FRAC_PI_2 + 1e-3 {
                    return Err(format!(
                        "innerConeAngle {inner}, outerConeAngle {outer}; allowed: 0 ≤ inner < outer ≤ π/2"
                    ));
                }
                let outer = outer.clamp(1e-3, FRAC_PI_2);
                Profile::Spot { inner: inner.min(outer - 1e-4), outer }
            }
            _ => return Err("unknown type or no `spot`; allowed: directional, point, spot".to_owned()),
        };
        Ok(forward(world).map(|axis| Light {
            name: json.name.clone().or_else(|| node.name.clone()).unwrap_or_default(),
            position: world.translation.as_vec3(),
            axis,
            intensity,
            profile,
        }))
    }

    /// Turns point lights to the scene's centre and puts the strongest light first.
    fn sort_lights(&mut self) {
        if self.lights.is_empty() {
            return;
        }
        let bounds = self.scene.bounds();
        let radius = bounds.map_or(1.0, |b| b.radius());
        let center = bounds.map(|b| b.center());
        for (_, light) in self.lights.iter_mut().filter(|(_, light)| light.profile == Profile::Point) {
            light.axis = center.and_then(|c| (c - light.position).try_normalize()).unwrap_or(Vec3::NEG_Y);
        }
        let power = |l: &Light| l.flux(radius).dot(Vec3::new(0.2126, 0.7152, 0.0722));
        self.lights.sort_by(|(_, a), (_, b)| power(b).total_cmp(&power(a)));
        for (at, light) in std::mem::take(&mut self.lights) {
            self.graph.lights.push((self.scene.lights.len(), at));
            self.scene.lights.push(light);
        }
    }
}

/// A mesh of the file.
struct Shape {
    deformable: Arc<Deformable>,
    /// The mesh of the scene that those share who do not deform it.
    shared: Option<usize>,
    extent: Vec3,
}

/// A node's own transform.
fn local(node: &Node) -> Problem<Local> {
    if let Some(matrix) = &node.matrix {
        let matrix = Mat4::from_cols_array(matrix);
        if !matrix.is_finite() || !matrix.row(3).abs_diff_eq(Vec4::W, 1e-4) {
            return Err("its matrix is NaN, infinite or not affine; allowed: finite, last row 0 0 0 1".to_owned());
        }
        return Ok(Local::Matrix(DAffine3::from_mat4(matrix.as_dmat4())));
    }
    let [x, y, z, w] = node.rotation.unwrap_or_default().0.map(f64::from);
    Ok(Local::Parts(Parts {
        translation: Vec3::from(node.translation.unwrap_or_default()).as_dvec3(),
        rotation: DQuat::from_xyzw(x, y, z, w),
        scale: Vec3::from(node.scale.unwrap_or([1.0; 3])).as_dvec3(),
    }))
}
