//! Nodes, what stands on them, and the animations that move them (glTF 2.0, sections 3.5 and 3.11, appendix C).

use std::collections::BTreeSet;
use std::sync::Arc;

use glam::{Affine3A, DAffine3, DMat4, DQuat, DVec3, DVec4, Vec3};

use super::deform::Deformable;
use super::{Instance, Scene};
use crate::{Camera, Error, Profile, Result};

/// Farthest that anything may be from the origin, metres: squares and their sums stay far inside f32.
pub(super) const MAX_COORDINATE: f32 = 1e12;

/// Largest scale at which the first joint of a skin is its object space.
const MAX_JOINT_SCALE: f64 = 1e6;

/// The nodes of a scene's file, what stands on them, and its animations.
#[derive(Debug, Default)]
pub struct Graph {
    /// Those of the drawn scene, parents before their children.
    pub(super) nodes: Vec<Node>,
    pub(super) placements: Vec<Placement>,
    pub(super) skins: Vec<Skin>,
    /// Lights of the scene and their nodes.
    pub(super) lights: Vec<(usize, usize)>,
    /// Cameras of the scene and their nodes.
    pub(super) cameras: Vec<(usize, usize)>,
    pub(super) animations: Vec<Animation>,
}

/// A node and its own transform at rest.
#[derive(Clone, Debug)]
pub(super) struct Node {
    /// Index in the file, for messages.
    pub number: usize,
    /// Index into [`Graph::nodes`], smaller than its own.
    pub parent: Option<usize>,
    pub local: Local,
    /// Weights of the morph targets of its mesh.
    pub weights: Vec<f32>,
}

/// How a node gives its transform.
#[derive(Clone, Copy, Debug)]
pub(super) enum Local {
    Matrix(DAffine3),
    Parts(Parts),
}

/// Scale, then rotation, then translation.
#[derive(Clone, Copy, Debug)]
pub(super) struct Parts {
    pub translation: DVec3,
    pub rotation: DQuat,
    pub scale: DVec3,
}

/// A mesh on a node.
#[derive(Debug)]
pub(super) struct Placement {
    pub node: usize,
    /// Index into [`Scene::meshes`].
    pub mesh: usize,
    /// Largest coordinates of the mesh without their signs, object space.
    pub extent: Vec3,
    /// What makes the mesh, where it is this placement's own.
    pub deformable: Option<Arc<Deformable>>,
    /// Index into [`Graph::skins`].
    pub skin: Option<usize>,
}

/// Joints and what takes a mesh to the space of each.
#[derive(Debug)]
pub(super) struct Skin {
    /// Indices into [`Graph::nodes`].
    pub joints: Vec<usize>,
    /// One for each joint.
    pub inverse_bind: Vec<DAffine3>,
}

/// An animation of a file.
#[derive(Debug)]
pub struct Animation {
    /// Name in the file; empty if it has none.
    pub name: String,
    /// Time of its last key, s; it begins anew after that. 0 if it moves nothing that is drawn.
    pub duration: f64,
    /// Plays where none is chosen: it moves nothing that an earlier one of those moves.
    pub(super) plays: bool,
    pub(super) channels: Vec<Channel>,
}

/// What moves one property of one node.
#[derive(Debug)]
pub(super) struct Channel {
    pub node: usize,
    pub property: Property,
    pub sampler: Arc<Sampler>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Property {
    Translation,
    Rotation,
    Scale,
    Weights,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Interpolation {
    Step,
    Linear,
    CubicSpline,
}

/// Values at times.
#[derive(Debug)]
pub(super) struct Sampler {
    pub interpolation: Interpolation,
    /// Rising, s; at least one.
    pub times: Vec<f32>,
    /// As many numbers for every time; for a cubic spline in-tangent, value and out-tangent.
    pub values: Vec<f32>,
}

impl Parts {
    fn transform(&self) -> DAffine3 {
        let rotation = if self.rotation.length_squared() > 0.0 { self.rotation.normalize() } else { DQuat::IDENTITY };
        DAffine3::from_scale_rotation_translation(self.scale, rotation, self.translation)
    }
}

impl Local {
    pub(super) fn transform(&self) -> DAffine3 {
        match self {
            Self::Matrix(matrix) => *matrix,
            Self::Parts(parts) => parts.transform(),
        }
    }
}

impl Sampler {
    /// Numbers of one value.
    pub(super) fn width(&self) -> usize {
        let parts = if self.interpolation == Interpolation::CubicSpline { 3 } else { 1 };
        self.values.len() / (parts * self.times.len())
    }

    /// Number `i` of each value at a time, s, interpolated on its own; before the first key and after the last what
    /// they say.
    fn number(&self, seconds: f64, i: usize) -> f64 {
        let width = self.width();
        let (key, next, step, share) = self.between(seconds);
        let at = |element: usize| f64::from(self.values[element * width + i]);
        match self.interpolation {
            Interpolation::Step => at(key),
            Interpolation::Linear => at(key) * (1.0 - share) + at(next) * share,
            // Cubic Hermite; tangents are per second.
            Interpolation::CubicSpline => {
                let (s, s2, s3) = (share, share * share, share * share * share);
                (2.0 * s3 - 3.0 * s2 + 1.0) * at(3 * key + 1)
                    + (s3 - 2.0 * s2 + s) * step * at(3 * key + 2)
                    + (3.0 * s2 - 2.0 * s3) * at(3 * next + 1)
                    + (s3 - s2) * step * at(3 * next)
            }
        }
    }

    fn vector(&self, seconds: f64) -> DVec3 {
        DVec3::from_array([0, 1, 2].map(|i| self.number(seconds, i)))
    }

    /// A unit quaternion, on the shorter way between two keys.
    fn rotation(&self, seconds: f64) -> DQuat {
        let unit = |v: DVec4| DQuat::from_vec4(v.try_normalize().unwrap_or(DVec4::W));
        if self.interpolation == Interpolation::Linear {
            let (key, next, _, share) = self.between(seconds);
            let at = |key: usize| unit(DVec4::from_array([0, 1, 2, 3].map(|i| self.values[key * 4 + i].into())));
            return at(key).slerp(at(next), share);
        }
        unit(DVec4::from_array([0, 1, 2, 3].map(|i| self.number(seconds, i))))
    }

    /// The keys before and after a time, the seconds between them, and what share of those has passed.
    fn between(&self, seconds: f64) -> (usize, usize, f64, f64) {
        let next = self.times.partition_point(|&time| f64::from(time) <= seconds);
        if next == 0 || next == self.times.len() {
            let key = next.saturating_sub(1);
            return (key, key, 0.0, 0.0);
        }
        let [from, to] = [next - 1, next].map(|key| f64::from(self.times[key]));
        (next - 1, next, to - from, (seconds - from) / (to - from))
    }
}

impl Animation {
    /// The time within the animation, s. A whole number of turns is its end, where it stops if it does not repeat itself.
    fn turn(&self, seconds: f64) -> f64 {
        if self.duration <= 0.0 || (0.0..=self.duration).contains(&seconds) {
            return seconds;
        }
        match seconds.rem_euclid(self.duration) {
            0.0 => self.duration,
            rest => rest,
        }
    }

    fn apply(&self, nodes: &mut [Node], seconds: f64) {
        let seconds = self.turn(seconds);
        for Channel { node, property, sampler } in &self.channels {
            let node = &mut nodes[*node];
            if *property == Property::Weights {
                node.weights = (0..sampler.width()).map(|i| sampler.number(seconds, i) as f32).collect();
            } else if let Local::Parts(parts) = &mut node.local {
                match property {
                    Property::Translation => parts.translation = sampler.vector(seconds),
                    Property::Rotation => parts.rotation = sampler.rotation(seconds),
                    Property::Scale => parts.scale = sampler.vector(seconds),
                    Property::Weights => {}
                }
            }
        }
    }
}

impl Graph {
    /// Puts a scene's instances, lights and cameras where the nodes are: at rest, or as `playing` at a time, s. Returns the
    /// numbers of the nodes whose meshes are scaled to zero and left out; fails with what is wrong.
    pub(super) fn pose(
        &self,
        scene: &mut Scene,
        playing: Option<(Option<usize>, f64)>,
    ) -> Result<BTreeSet<usize>, String> {
        let mut nodes = self.nodes.clone();
        if let Some((chosen, seconds)) = playing {
            let plays = |i: usize, animation: &Animation| chosen.map_or(animation.plays, |chosen| chosen == i);
            for (_, animation) in self.animations.iter().enumerate().filter(|(i, animation)| plays(*i, animation)) {
                animation.apply(&mut nodes, seconds);
            }
        }
        let mut worlds: Vec<DAffine3> = Vec::with_capacity(nodes.len());
        for node in &nodes {
            let local = node.local.transform();
            let world = node.parent.map_or(local, |parent| worlds[parent] * local);
            let far = world.translation.abs().max_element() > f64::from(MAX_COORDINATE);
            if !DMat4::from(world).as_mat4().is_finite() || far {
                return Err(format!(
                    "node {}: its transform is NaN, infinite or beyond {MAX_COORDINATE:e} m; allowed: finite",
                    node.number
                ));
            }
            worlds.push(world);
        }

        let mut skins: Vec<Option<(DAffine3, Vec<Affine3A>)>> = vec![None; self.skins.len()];
        let mut hidden = BTreeSet::new();
        scene.instances.clear();
        for placement in &self.placements {
            let node = &nodes[placement.node];
            let (mut world, mut extent) = (worlds[placement.node], placement.extent);
            if let Some(deformable) = &placement.deformable {
                let skin =
                    placement.skin.map(|skin| &*skins[skin].get_or_insert_with(|| self.skins[skin].pose(&worlds)));
                let mesh = deformable.deform(&node.weights, skin.map(|(_, joints)| joints.as_slice()));
                extent = mesh.extent();
                scene.meshes[placement.mesh] = Arc::new(mesh);
                world = skin.map_or(world, |(world, _)| *world);
            }
            let reach = world.matrix3.abs() * extent.as_dvec3() + world.translation.abs();
            // What is NaN is not within reach.
            if !reach.cmple(DVec3::splat(MAX_COORDINATE.into())).all() {
                return Err(format!(
                    "node {}: its mesh reaches beyond {MAX_COORDINATE:e} m; allowed: up to it",
                    node.number
                ));
            }
            let world_from_object = DMat4::from(world).as_mat4();
            // Zero scale is how files hide things; there is no normal on what is left.
            if world_from_object.inverse().is_finite() {
                scene.instances.push(Instance { mesh: placement.mesh, world_from_object });
            } else {
                hidden.insert(node.number);
            }
        }
        for &(light, node) in &self.lights {
            if let Some(light) = scene.lights.get_mut(light) {
                light.position = worlds[node].translation.as_vec3();
                // The axis of a point light is not its node's.
                if light.profile != Profile::Point {
                    light.axis = forward(worlds[node]).unwrap_or(light.axis);
                }
            }
        }
        for &(camera, node) in &self.cameras {
            if let Some(camera) = scene.cameras.get_mut(camera) {
                place_camera(camera, worlds[node]);
            }
        }
        Ok(hidden)
    }
}

impl Skin {
    /// The space in which meshes of this skin are made: that of the first joint, so that they hardly change while the whole
    /// moves; and what takes them there by each joint.
    fn pose(&self, worlds: &[DAffine3]) -> (DAffine3, Vec<Affine3A>) {
        let joints = self.joints.iter().zip(&self.inverse_bind).map(|(&joint, &bind)| worlds[joint] * bind);
        let joints: Vec<DAffine3> = joints.collect();
        let small = |m: &DAffine3| m.matrix3.to_cols_array().iter().all(|x| x.abs() < MAX_JOINT_SCALE);
        let world = joints.first().copied().filter(|first| {
            let size = first.matrix3.determinant().abs();
            size > 0.0 && small(first) && first.is_finite() && small(&first.inverse()) && first.inverse().is_finite()
        });
        let world = world.unwrap_or(DAffine3::IDENTITY);
        let object_from_world = world.inverse();
        let joints = joints.into_iter().map(|joint| {
            let joint = object_from_world * joint;
            Affine3A::from_mat4(DMat4::from(joint).as_mat4())
        });
        (world, joints.collect())
    }
}

impl Scene {
    /// The animations of the scene's file.
    pub fn animations(&self) -> &[Animation] {
        self.graph.as_ref().map_or(&[], |graph| &graph.animations)
    }

    /// The scene as its animations have it at a time in seconds from their beginning: instances, lights, cameras, and
    /// meshes with skins or morph targets. `animation` is an index into [`Scene::animations`]; by default the first plays,
    /// and with it all others that move something else. Each begins anew when it is over. Light and camera that the file
    /// does not have stay; everything else that the caller may have changed in what is named above is lost.
    ///
    /// # Errors
    /// [`Error::Argument`] if there is no such animation, or for a time that is not finite; [`Error::File`] if something is
    /// taken farther than 1e12 m from the origin.
    pub fn at(&self, seconds: f64, animation: Option<usize>) -> Result<Scene> {
        let count = self.animations().len();
        if let Some(index) = animation.filter(|&index| index >= count) {
            return Err(Error::Argument {
                what: "animation",
                problem: format!("the scene has no animation {index}"),
                allowed: format!("indices below {count}, the number that it has"),
            });
        }
        if !seconds.is_finite() {
            return Err(Error::Argument {
                what: "time",
                problem: format!("{seconds} is not finite"),
                allowed: "any number of seconds".to_owned(),
            });
        }
        let mut scene = self.clone();
        if let Some(graph) = &self.graph {
            let posed = graph.pose(&mut scene, Some((animation, seconds)));
            posed.map_err(|problem| Error::File {
                path: (&self.name).into(),
                problem: format!("at {seconds} s: {problem}"),
            })?;
        }
        Ok(scene)
    }
}

/// World-space unit vector of −z of a node, free of scale; `None` if its scale leaves no direction.
pub(super) fn forward(world: DAffine3) -> Option<Vec3> {
    world.transform_vector3(DVec3::NEG_Z).try_normalize().map(|v| v.as_vec3().normalize())
}

/// Puts a camera where its node is; false, and nothing changes, if its scale leaves no direction.
pub(super) fn place_camera(camera: &mut Camera, world: DAffine3) -> bool {
    let Some(forward) = forward(world) else { return false };
    let y = world.transform_vector3(DVec3::Y).normalize_or_zero().as_vec3();
    let across = y - forward * forward.dot(y);
    camera.eye = world.translation.as_vec3();
    camera.forward = forward;
    camera.up = if across.length() > 1e-4 { across.normalize() } else { forward.any_orthonormal_vector() };
    true
}
