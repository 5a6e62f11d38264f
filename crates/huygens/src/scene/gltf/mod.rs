//! Reads glTF 2.0 files (.gltf, .glb) into a [`Scene`].
//!
//! The gltf crate's JSON types give the structure; every index, range and number is checked here, since files come
//! from strangers: whatever a file holds, loading ends with a scene or with one line that says what is wrong.
//!
//! What is read in a way of its own:
//! - Skins, morph targets and animations are not applied: meshes stand as their nodes place them.
//! - A light's `range` is ignored: the inverse-square law has no end.
//! - A camera's `zfar`, `aspectRatio` and `xmag` are ignored: the picture's size gives the aspect, depth has no end.
//! - A node's scale does not act on cameras and lights.
//! - A node that mirrors (negative determinant) keeps its matrix. Triangles of a mesh are counter-clockwise from the
//!   front in object space; in world space such an instance's are clockwise, so that whoever culls or needs a front
//!   face turns it round where the determinant is negative. Normals need no sign.

mod accessor;
mod files;
mod material;
mod mesh;

use std::collections::HashMap;
use std::f32::consts::{FRAC_PI_2, PI};
use std::path::Path;

use glam::{DAffine3, DMat4, DQuat, DVec3, Mat4, Vec3, Vec4};
use gltf::json::camera::Type as CameraType;
use gltf::json::extensions::scene::khr_lights_punctual as punctual;
use gltf::json::validation::Checked;
use gltf::json::{Node, Root, deserialize};
use serde::Deserialize;

use self::accessor::Buffers;
use self::files::{Files, shorten};
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
/// Farthest that anything may be from the origin, metres: squares and their sums stay far inside f32.
const MAX_COORDINATE: f32 = 1e12;
/// Farthest from the origin, in radii of the scene, that its shape is hardly touched by the rounding of coordinates.
const FAR_OFF: f32 = 1e3;
/// Most instances: a small file can ask for nodes × primitives of them.
const MAX_INSTANCES: usize = 1_000_000;
/// Most triangles, instances counted each.
const MAX_TRIANGLES: usize = 20_000_000;

/// Strongest light, candela or lux, and strongest emission, W/(m² sr): its products with areas and squares of distances stay inside f32.
const MAX_INTENSITY: f32 = 1e20;
const UNUSED_CAMERA: &str = "a camera that no node of the drawn scene uses is left out, and later ones move up";

/// What is wrong, without the file's name.
type Problem<T> = Result<T, String>;

/// Loads the default scene of a file. Leaves `lights` and `cameras` empty if it has none.
pub(crate) fn load(path: &Path) -> Result<Scene> {
    read(path).map_err(|problem| {
        let mut problem = one_line(&problem);
        // Where the message itself says nothing narrower, or was cut.
        if !problem.contains("allowed") {
            problem.push_str("; allowed: a complete glTF 2.0 file (.gltf or .glb)");
        }
        Error::File { path: path.to_owned(), problem }
    })
}

fn read(path: &Path) -> Problem<Scene> {
    let bytes = files::read_main(path)?;
    let (json, bin) = files::split(&bytes)?;
    let head: Head = deserialize::from_slice(json)
        .map_err(|e| format!("not a glTF file, its JSON is broken: {e}; allowed: glTF 2.0"))?;
    head.check()?;
    let root: Root =
        deserialize::from_slice(json).map_err(|e| format!("not a valid glTF file: {e}; allowed: glTF 2.0"))?;

    let mut loader = Loader {
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
        warnings: Vec::new(),
    };
    loader.materials()?;
    let drawn = loader.nodes()?;
    loader.sort_cameras();
    loader.sort_lights();
    if !root.animations.is_empty() {
        loader.warn("animations are not played: the rest pose is drawn");
    }
    let mut scene = loader.scene;
    scene.files = loader.files.opened;
    let times = |(text, count)| if count > 1 { format!("{text} ({count} times)") } else { String::from(text) };
    scene.warnings = loader.warnings.into_iter().map(times).collect();
    if root.scenes.len() > 1 {
        let others = root.scenes.len() - 1;
        scene.warnings.push(format!("scene {drawn} of the file is drawn, its other scenes ({others}) are not"));
    }
    let ignored: Vec<_> = root.extensions_used.iter().filter(|e| !EXTENSIONS.contains(&e.as_str())).collect();
    if !ignored.is_empty() {
        scene.warnings.push(one_line(&format!("extensions that are ignored: {}", listed(&ignored))));
    }
    if let Some(bounds) = scene.bounds() {
        let off = bounds.center().length();
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
#[serde(rename_all = "camelCase")]
struct Head {
    asset: Option<Asset>,
    #[serde(default)]
    extensions_required: Vec<String>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
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
        let unsupported: Vec<_> =
            self.extensions_required.iter().filter(|e| !EXTENSIONS.contains(&e.as_str())).collect();
        match unsupported.is_empty() {
            true => Ok(()),
            false => Err(format!(
                "it requires extensions that are not supported: {}; allowed: {}",
                listed(&unsupported),
                EXTENSIONS.join(", ")
            )),
        }
    }
}

fn listed(names: &[&String]) -> String {
    names.iter().take(8).map(|name| shorten(name)).collect::<Vec<_>>().join(", ")
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
struct Loader<'a> {
    buffers: Buffers<'a>,
    files: Files,
    scene: Scene,
    default_material: Option<usize>,
    elements: usize,
    read: usize,
    triangles: usize,
    /// Cameras as found, with their number in the file, the node's number and its name.
    cameras: Vec<(usize, usize, Option<String>, Camera)>,
    warnings: Vec<(&'static str, usize)>,
}

impl Loader<'_> {
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
            stack.push((number, DAffine3::IDENTITY));
        }

        let mut meshes = HashMap::new();
        while let Some((number, parent)) = stack.pop() {
            let node = &root.nodes[number];
            let world = local(node)
                .map(|local| parent * local)
                .and_then(|world| {
                    let far = world.translation.abs().max_element() > f64::from(MAX_COORDINATE);
                    let sound = DMat4::from(world).as_mat4().is_finite() && !far;
                    sound.then_some(world).ok_or_else(|| {
                        format!("its transform is NaN, infinite or beyond {MAX_COORDINATE:e} m; allowed: finite")
                    })
                })
                .map_err(|e| format!("node {number}: {e}"))?;
            if node.skin.is_some() {
                self.warn("skins are not applied: the rest pose is drawn");
            }
            self.place(node, number, world, &mut meshes)?;
            let children = node.children.iter().flatten().rev();
            stack.extend(children.map(|child| (child.value(), world)));
        }
        Ok(drawn)
    }

    fn place(
        &mut self,
        node: &Node,
        number: usize,
        world: DAffine3,
        meshes: &mut HashMap<usize, Vec<(usize, Vec3)>>,
    ) -> Problem<()> {
        let root = self.buffers.root;
        if let Some(index) = node.camera {
            let json = get(&root.cameras, index.value(), "camera")?;
            let camera = self.camera(json, world).map_err(|e| format!("camera {}: {e}", index.value()))?;
            match camera {
                Some(camera) => self.cameras.push((index.value(), number, node.name.clone(), camera)),
                None => self.warn("a camera or light that its node scales to zero is left out"),
            }
        }
        if let Some(light) = node.extensions.as_ref().and_then(|e| e.khr_lights_punctual.as_ref()) {
            let lights = root.extensions.as_ref().and_then(|e| e.khr_lights_punctual.as_ref());
            let json = get(lights.map_or(&[][..], |l| &l.lights), light.light.value(), "light")?;
            self.light(json, node, world).map_err(|e| format!("light {}: {e}", light.light.value()))?;
        }
        let Some(index) = node.mesh.map(|m| m.value()) else {
            return Ok(());
        };
        if let std::collections::hash_map::Entry::Vacant(entry) = meshes.entry(index) {
            let json = get(&root.meshes, index, "mesh")?;
            let name = json.name.as_deref().unwrap_or_default();
            let mut converted = Vec::new();
            for (p, primitive) in json.primitives.iter().enumerate() {
                let mesh = self.primitive(primitive, name);
                if let Some(mesh) = mesh.map_err(|e| format!("mesh {index}, primitive {p}: {e}"))? {
                    let extent = mesh.positions.iter().fold(Vec3::ZERO, |m, p| m.max(p.abs()));
                    converted.push((self.scene.meshes.len(), extent));
                    self.scene.meshes.push(mesh.into());
                }
            }
            entry.insert(converted);
        }
        let world_from_object = DMat4::from(world).as_mat4();
        // Zero scale is how files hide things; there is no normal on what is left.
        let hidden = !world_from_object.inverse().is_finite();
        for &(mesh, extent) in &meshes[&index] {
            let reach = world.matrix3.abs() * extent.as_dvec3() + world.translation.abs();
            if reach.max_element() > f64::from(MAX_COORDINATE) {
                return Err(format!("node {number}: its mesh reaches beyond {MAX_COORDINATE:e} m; allowed: up to it"));
            }
            if hidden {
                self.warn("a mesh that its node scales to zero is not drawn");
                continue;
            }
            self.triangles += self.scene.meshes[mesh].indices.len() / 3;
            self.scene.instances.push(Instance { mesh, world_from_object });
        }
        if self.scene.instances.len() > MAX_INSTANCES || self.triangles > MAX_TRIANGLES {
            return Err(format!(
                "the file is too large; allowed: {MAX_INSTANCES} instances, {MAX_TRIANGLES} triangles in all of them"
            ));
        }
        Ok(())
    }

    /// Converts a camera, named as the file names it; `None` if its node has no direction.
    fn camera(&self, json: &gltf::json::Camera, world: DAffine3) -> Problem<Option<Camera>> {
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
        let Some(forward) = axis(world, DVec3::NEG_Z) else {
            return Ok(None);
        };
        let y = world.transform_vector3(DVec3::Y).normalize_or_zero().as_vec3();
        let across = y - forward * forward.dot(y);
        let up = if across.length() > 1e-4 { across.normalize() } else { forward.any_orthonormal_vector() };
        Ok(Some(Camera {
            name: json.name.clone().unwrap_or_default(),
            eye: world.translation.as_vec3(),
            forward,
            up,
            projection,
            near: Some(near),
        }))
    }

    /// Puts cameras in the order of the file's list, those on several nodes in the order of the nodes.
    fn sort_cameras(&mut self) {
        let mut uses = vec![0; self.buffers.root.cameras.len()];
        self.cameras.iter().for_each(|camera| uses[camera.0] += 1);
        uses.iter().filter(|&&n| n == 0).for_each(|_| self.warn(UNUSED_CAMERA));
        self.cameras.sort_by_key(|&(index, node, ..)| (index, node));
        for (index, _, node, mut camera) in std::mem::take(&mut self.cameras) {
            if let Some(name) = node.filter(|_| uses[index] > 1 || camera.name.is_empty()) {
                camera.name = name;
            }
            self.scene.cameras.push(camera);
        }
    }

    fn light(&mut self, json: &punctual::Light, node: &Node, world: DAffine3) -> Problem<()> {
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
        let Some(axis) = axis(world, DVec3::NEG_Z) else {
            self.warn("a camera or light that its node scales to zero is left out");
            return Ok(());
        };
        self.scene.lights.push(Light {
            name: json.name.clone().or_else(|| node.name.clone()).unwrap_or_default(),
            position: world.translation.as_vec3(),
            axis,
            intensity,
            profile,
        });
        Ok(())
    }

    /// Turns point lights to the scene's centre and puts the strongest light first.
    fn sort_lights(&mut self) {
        if self.scene.lights.is_empty() {
            return;
        }
        let bounds = self.scene.bounds();
        let radius = bounds.map_or(1.0, |b| b.radius());
        let center = bounds.map(|b| b.center());
        for light in self.scene.lights.iter_mut().filter(|l| l.profile == Profile::Point) {
            light.axis = center.and_then(|c| (c - light.position).try_normalize()).unwrap_or(Vec3::NEG_Y);
        }
        let power = |l: &Light| l.flux(radius).dot(Vec3::new(0.2126, 0.7152, 0.0722));
        self.scene.lights.sort_by(|a, b| power(b).total_cmp(&power(a)));
    }
}

/// World-space unit vector of a node's axis, free of scale.
fn axis(world: DAffine3, axis: DVec3) -> Option<Vec3> {
    world.transform_vector3(axis).try_normalize().map(|v| v.as_vec3().normalize())
}

/// A node's own transform.
fn local(node: &Node) -> Problem<DAffine3> {
    if let Some(matrix) = &node.matrix {
        let matrix = Mat4::from_cols_array(matrix);
        if !matrix.is_finite() || !matrix.row(3).abs_diff_eq(Vec4::W, 1e-4) {
            return Err("its matrix is NaN, infinite or not affine; allowed: finite, last row 0 0 0 1".to_owned());
        }
        return Ok(DAffine3::from_mat4(matrix.as_dmat4()));
    }
    let [x, y, z, w] = node.rotation.unwrap_or_default().0.map(f64::from);
    let rotation = DQuat::from_xyzw(x, y, z, w);
    Ok(DAffine3::from_scale_rotation_translation(
        Vec3::from(node.scale.unwrap_or([1.0; 3])).as_dvec3(),
        if rotation.length_squared() > 0.0 { rotation.normalize() } else { DQuat::IDENTITY },
        Vec3::from(node.translation.unwrap_or_default()).as_dvec3(),
    ))
}
