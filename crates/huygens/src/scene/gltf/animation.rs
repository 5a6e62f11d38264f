//! Animations and skins.

use std::collections::{HashMap, HashSet};
use std::sync::Arc;

use glam::{DAffine3, Mat4, Vec4};
use gltf::json::accessor::{ComponentType, GenericComponentType, Type};
use gltf::json::animation as json;
use gltf::json::validation::Checked;
use gltf::json::{Accessor, Index};

use super::{Loader, Problem, get};
use crate::scene::animation::{Animation, Channel, Interpolation, Local, Property, Sampler, Skin};

impl Loader<'_, '_> {
    /// Reads the animations of the nodes that are drawn.
    pub(super) fn animations(&mut self) -> Problem<()> {
        let mut moved = HashSet::new();
        for (number, animation) in self.buffers.root.animations.iter().enumerate() {
            let mut animation = self.animation(animation).map_err(|e| format!("animation {number}: {e}"))?;
            let moves: Vec<_> = animation.channels.iter().map(|channel| (channel.node, channel.property)).collect();
            animation.plays = moves.iter().all(|target| !moved.contains(target));
            if animation.plays {
                moved.extend(moves);
            }
            self.graph.animations.push(animation);
        }
        Ok(())
    }

    fn animation(&mut self, json: &json::Animation) -> Problem<Animation> {
        let root = self.buffers.root;
        let mut samplers: HashMap<usize, Arc<Sampler>> = HashMap::new();
        let mut targets = HashSet::new();
        let mut channels: Vec<Channel> = Vec::new();
        for (number, channel) in json.channels.iter().enumerate() {
            let index = channel.sampler.value();
            let sampler = get(&json.samplers, index, "sampler")?;
            let property = match channel.target.path {
                Checked::Valid(json::Property::Translation) => Property::Translation,
                Checked::Valid(json::Property::Rotation) => Property::Rotation,
                Checked::Valid(json::Property::Scale) => Property::Scale,
                Checked::Valid(json::Property::MorphTargetWeights) => Property::Weights,
                Checked::Invalid => {
                    self.warn("an animation of something else than a node's transform or weights is not played");
                    continue;
                }
            };
            let target = channel.target.node.value();
            get(&root.nodes, target, "node")?;
            let Some(node) = self.drawn[target] else { continue };
            let problem = |e: String| format!("channel {number}: {e}");
            if !targets.insert((node, property)) {
                return Err(problem(format!("node {target} has this property moved twice; allowed: once")));
            }
            if property != Property::Weights && matches!(self.graph.nodes[node].local, Local::Matrix(_)) {
                return Err(problem(format!(
                    "node {target} is moved but has a matrix; allowed: translation, rotation and scale"
                )));
            }
            let targets = self.graph.nodes[node].weights.len();
            if property == Property::Weights && targets == 0 {
                return Err(problem(format!(
                    "node {target} has no morph targets that weights could move; allowed: a node with some"
                )));
            }
            let (kind, width) = match property {
                Property::Translation | Property::Scale => (Type::Vec3, 3),
                Property::Rotation => (Type::Vec4, 4),
                Property::Weights => (Type::Scalar, targets),
            };
            let accessor = get(&root.accessors, sampler.output.value(), "accessor").map_err(problem)?;
            if accessor.type_ != Checked::Valid(kind) {
                return Err(problem(format!(
                    "accessor {}: a type that does not fit its use; allowed: {}",
                    sampler.output.value(),
                    super::accessor::name(kind)
                )));
            }
            let sampler = match samplers.get(&index) {
                Some(sampler) => sampler.clone(),
                None => {
                    let read = self.sampler(sampler, kind, width);
                    let read = Arc::new(read.map_err(|e| problem(format!("sampler {index}: {e}")))?);
                    samplers.insert(index, read.clone());
                    read
                }
            };
            if sampler.width() != width {
                return Err(problem(format!(
                    "{} weights in sampler {index}; allowed: {width}, one for each morph target",
                    sampler.width()
                )));
            }
            channels.push(Channel { node, property, sampler });
        }
        let ends = channels.iter().filter_map(|channel| channel.sampler.times.last());
        let duration = ends.fold(0.0, |end: f64, &time| end.max(time.into()));
        Ok(Animation { name: json.name.clone().unwrap_or_default(), duration, plays: false, channels })
    }

    /// Reads the keys of a sampler whose values are of some type and have so many numbers.
    fn sampler(&mut self, json: &json::Sampler, kind: Type, width: usize) -> Problem<Sampler> {
        let Checked::Valid(interpolation) = json.interpolation else {
            return Err("unknown interpolation; allowed: STEP, LINEAR, CUBICSPLINE".to_owned());
        };
        let (interpolation, parts) = match interpolation {
            json::Interpolation::Step => (Interpolation::Step, 1),
            json::Interpolation::Linear => (Interpolation::Linear, 1),
            json::Interpolation::CubicSpline => (Interpolation::CubicSpline, 3),
        };
        self.check_components(json.input, &[ComponentType::F32])?;
        let count = self.buffers.count(json.input)?;
        self.count_read(count)?;
        let times: Vec<f32> = self.scalars(json.input)?;
        let rise = times.is_sorted_by(|a, b| a < b) && times.first().is_some_and(|&first| first >= 0.0);
        if !rise {
            return Err(
                "its times do not rise from 0 or later, or there are none; allowed: one or more, rising".to_owned()
            );
        }

        let elements = if kind == Type::Scalar { width } else { 1 };
        let (expected, found) = (count.saturating_mul(parts * elements), self.buffers.count(json.output)?);
        if found != expected {
            return Err(format!("{found} values for {count} times; allowed: {expected}"));
        }
        let floats = [ComponentType::F32];
        let normalized =
            [ComponentType::F32, ComponentType::I8, ComponentType::U8, ComponentType::I16, ComponentType::U16];
        let allowed = if kind == Type::Vec3 { &floats[..] } else { &normalized };
        self.check_components(json.output, allowed)?;
        self.count_read(found)?;
        self.count_elements(found)?;
        let values = match kind {
            Type::Scalar => self.scalars(json.output)?,
            Type::Vec3 => self.buffers.floats::<3>(&mut self.files, json.output, &[kind])?.into_flattened(),
            _ => self.buffers.floats::<4>(&mut self.files, json.output, &[kind])?.into_flattened(),
        };
        Ok(Sampler { interpolation, times, values })
    }

    fn scalars(&mut self, index: Index<Accessor>) -> Problem<Vec<f32>> {
        Ok(self.buffers.floats::<1>(&mut self.files, index, &[Type::Scalar])?.into_flattened())
    }

    /// Refuses accessors of other component types, and integers that are not normalised.
    pub(super) fn check_components(&self, index: Index<Accessor>, allowed: &[ComponentType]) -> Problem<()> {
        let accessor = get(&self.buffers.root.accessors, index.value(), "accessor")?;
        let fits = match accessor.component_type {
            Checked::Valid(GenericComponentType(ComponentType::F32)) => allowed.contains(&ComponentType::F32),
            Checked::Valid(GenericComponentType(component)) => allowed.contains(&component) && accessor.normalized,
            Checked::Invalid => false,
        };
        match fits {
            true => Ok(()),
            false => Err(format!(
                "accessor {}: a componentType that does not fit its use; allowed: 5126{}",
                index.value(),
                if allowed.len() > 1 { ", or normalized integers" } else { "" }
            )),
        }
    }

    /// Reads the skins that drawn meshes have.
    pub(super) fn skins(&mut self) -> Problem<()> {
        let mut skins: Vec<(usize, usize)> = self.skins.drain().map(|(number, index)| (index, number)).collect();
        skins.sort_unstable();
        for (_, number) in skins {
            let skin = self.skin(number).map_err(|e| format!("skin {number}: {e}"))?;
            self.graph.skins.push(skin);
        }
        for placement in &self.graph.placements {
            let Some(skin) = placement.skin else { continue };
            let (joints, last) = (self.graph.skins[skin].joints.len(), placement.deformable.as_ref());
            if let Some(last) = last.and_then(|d| d.last_joint()).filter(|&last| usize::from(last) >= joints) {
                return Err(format!(
                    "node {}: JOINTS_n names joint {last}; allowed: below {joints}, the number that its skin has",
                    self.graph.nodes[placement.node].number
                ));
            }
        }
        Ok(())
    }

    fn skin(&mut self, number: usize) -> Problem<Skin> {
        let json = &self.buffers.root.skins[number];
        let mut joints = Vec::new();
        for joint in &json.joints {
            let joint = joint.value();
            get(&self.buffers.root.nodes, joint, "node")?;
            let node = self.drawn[joint];
            joints
                .push(node.ok_or_else(|| format!("joint node {joint} is not in the drawn scene; allowed: its nodes"))?);
        }
        if joints.is_empty() {
            return Err("it has no joints; allowed: one or more".to_owned());
        }
        self.count_read(joints.len())?;
        let mut inverse_bind = vec![DAffine3::IDENTITY; joints.len()];
        if let Some(index) = json.inverse_bind_matrices {
            let count = self.buffers.count(index)?;
            if count < joints.len() {
                return Err(format!(
                    "{count} inverse bind matrices for {} joints; allowed: one for each",
                    joints.len()
                ));
            }
            self.check_components(index, &[ComponentType::F32])?;
            self.count_read(count)?;
            let matrices = self.buffers.floats::<16>(&mut self.files, index, &[Type::Mat4])?;
            for (bind, matrix) in inverse_bind.iter_mut().zip(&matrices) {
                let matrix = Mat4::from_cols_array(matrix);
                if !matrix.row(3).abs_diff_eq(Vec4::W, 1e-4) {
                    return Err("an inverse bind matrix is not affine; allowed: last row 0 0 0 1".to_owned());
                }
                *bind = DAffine3::from_mat4(matrix.as_dmat4());
            }
        }
        Ok(Skin { joints, inverse_bind })
    }
}
