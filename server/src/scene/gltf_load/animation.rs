//! Animations of translation and rotation, sampled into the keys of rigid
//! objects.
//!
//! A single linearly animated node under ancestors that stand still keeps its
//! own keys. Everything else (steps, splines, chains of animated nodes) is
//! sampled at a fixed rate.

use std::time::Duration;

use glam::{DMat4, DVec3};
use gltf::animation::{Interpolation, Property};
use gltf::json::validation::Checked;
use shadecast_protocol::Pose;

use super::LoadError;
use super::accessor::Data;
use super::nodes::{pose, unit};
use crate::scene::Scene;

/// Keys a second of a motion that is not linear.
const RATE: f64 = 30.0;
/// Most keys of an object.
const MAX_KEYS: usize = 4096;
/// Longest animation, seconds: a day.
const MAX_SECONDS: f32 = 86_400.0;

/// What moves each node.
pub(super) struct Motions {
    nodes: Vec<NodeMotion>,
}

#[derive(Default)]
struct NodeMotion {
    translation: Option<Track<3>>,
    rotation: Option<Track<4>>,
}

/// Keys of one property.
struct Track<const N: usize> {
    interpolation: Interpolation,
    times: Vec<f32>,
    /// One a key; three (in-tangent, value, out-tangent) for a cubic spline.
    values: Vec<[f32; N]>,
}

impl Motions {
    /// Reads all animations. Where several move the same property of a node,
    /// the first one counts.
    pub(super) fn read(
        document: &gltf::Document,
        data: &Data<'_>,
        scene: &mut Scene,
    ) -> Result<Self, LoadError> {
        let mut nodes: Vec<NodeMotion> = Vec::new();
        nodes.resize_with(document.nodes().len(), NodeMotion::default);
        let mut left_out = [0_usize; 3];
        for (animation, json) in document.animations().zip(&document.as_json().animations) {
            for (channel, json) in animation.channels().zip(&json.channels) {
                let place = format!("animations[{}]", animation.index());
                // The parser checks neither this index nor the path.
                let motion = nodes
                    .get_mut(json.target.node.value())
                    .ok_or_else(|| LoadError::invalid(&*place, "its target is out of range"))?;
                if matches!(json.target.path, Checked::Invalid) {
                    return Err(LoadError::invalid(place, "its target's path is unknown"));
                }
                let sampler = channel.sampler();
                match channel.target().property() {
                    Property::Translation if motion.translation.is_none() => {
                        motion.translation = Some(Track::read(&sampler, data, &place)?);
                    }
                    Property::Rotation if motion.rotation.is_none() => {
                        motion.rotation = Some(Track::read(&sampler, data, &place)?);
                    }
                    Property::Scale => left_out[0] += 1,
                    Property::MorphTargetWeights => left_out[1] += 1,
                    Property::Translation | Property::Rotation => left_out[2] += 1,
                }
            }
        }
        let reasons = [
            "animations of scale are ignored",
            "animations of morph targets are ignored",
            "animations of what another one moves already are ignored",
        ];
        for (count, reason) in left_out.into_iter().zip(reasons) {
            if count > 0 {
                scene.notes.warnings.push(format!("{count} {reason}"));
            }
        }
        Ok(Self { nodes })
    }

    /// True when the node itself moves.
    pub(super) fn moves(&self, node: usize) -> bool {
        let motion = &self.nodes[node];
        motion.translation.is_some() || motion.rotation.is_some()
    }

    /// The poses of the last node of `chain` (from the root) in the world.
    pub(super) fn keys(&self, chain: &[usize], locals: &[DMat4]) -> Vec<(Duration, Pose)> {
        let moving: Vec<&NodeMotion> = chain
            .iter()
            .filter(|&&node| self.moves(node))
            .map(|&node| &self.nodes[node])
            .collect();
        let seconds = moving
            .iter()
            .flat_map(|motion| motion.times())
            .fold(0.0, |longest: f32, time| longest.max(time));
        let times = match moving.as_slice() {
            [only] if only.is_linear() => only.merged_times(),
            _ => {
                let steps = (f64::from(seconds) * RATE).ceil() as usize;
                let steps = steps.clamp(1, MAX_KEYS - 1);
                let step = |i| (f64::from(seconds) * i as f64 / steps as f64) as f32;
                (0..=steps).map(step).collect()
            }
        };
        let mut keys: Vec<(Duration, Pose)> = times
            .into_iter()
            .map(|time| {
                let world_from_node: DMat4 = chain
                    .iter()
                    .map(|&node| self.nodes[node].local(locals[node], time))
                    .product();
                (Duration::from_secs_f32(time), pose(world_from_node))
            })
            .collect();
        keys.dedup_by_key(|key| key.0);
        keys
    }
}

impl NodeMotion {
    fn times(&self) -> impl Iterator<Item = f32> {
        let translation = self.translation.iter().flat_map(|track| &track.times);
        let rotation = self.rotation.iter().flat_map(|track| &track.times);
        translation.chain(rotation).copied()
    }

    fn is_linear(&self) -> bool {
        let linear = |interpolation| matches!(interpolation, Interpolation::Linear);
        self.translation
            .as_ref()
            .is_none_or(|t| linear(t.interpolation))
            && self
                .rotation
                .as_ref()
                .is_none_or(|t| linear(t.interpolation))
            && self.times().count() < MAX_KEYS
    }

    /// Zero and the times of all keys, ascending.
    fn merged_times(&self) -> Vec<f32> {
        let mut times: Vec<f32> = std::iter::once(0.0).chain(self.times()).collect();
        times.sort_by(f32::total_cmp);
        times.dedup();
        times
    }

    /// The node in its parent at `time`, given the same at rest.
    fn local(&self, rest: DMat4, time: f32) -> DMat4 {
        if self.translation.is_none() && self.rotation.is_none() {
            return rest;
        }
        let (scale, rotation, translation) = rest.to_scale_rotation_translation();
        let translation = self.translation.as_ref().map_or(translation, |track| {
            DVec3::from_array(track.at(time, |a, b, t| {
                std::array::from_fn(|i| a[i] + (b[i] - a[i]) * t)
            }))
        });
        let rotation = self.rotation.as_ref().map_or(rotation, |track| {
            unit(track.at(time, |a, b, t| unit(a).slerp(unit(b), t).to_array()))
        });
        DMat4::from_scale_rotation_translation(scale, rotation, translation)
    }
}

impl<const N: usize> Track<N> {
    fn read(
        sampler: &gltf::animation::Sampler<'_>,
        data: &Data<'_>,
        place: &str,
    ) -> Result<Self, LoadError> {
        let interpolation = sampler.interpolation();
        let times: Vec<f32> = data
            .floats::<1>(&sampler.input())?
            .into_iter()
            .flatten()
            .collect();
        let values = data.floats::<N>(&sampler.output())?;
        let per_key = match interpolation {
            Interpolation::CubicSpline => 3,
            Interpolation::Linear | Interpolation::Step => 1,
        };
        let ascending = times.is_sorted_by(|a, b| a < b);
        let in_bounds = |time: &f32| (0.0..=MAX_SECONDS).contains(time);
        if times.is_empty() || !ascending || !times.iter().all(in_bounds) {
            return Err(LoadError::invalid(
                place,
                "its times are empty, do not ascend or are not within a day",
            ));
        }
        if values.len() != times.len() * per_key {
            return Err(LoadError::invalid(
                place,
                "it has not one value for every time",
            ));
        }
        Ok(Self {
            interpolation,
            times,
            values,
        })
    }

    /// The value at `time`, held before the first and after the last key.
    fn at(&self, time: f32, mix: impl Fn([f64; N], [f64; N], f64) -> [f64; N]) -> [f64; N] {
        let last = self.times.len() - 1;
        let next = self.times.partition_point(|&key| key <= time);
        let (before, after) = (next.saturating_sub(1), next.min(last));
        let span = f64::from(self.times[after] - self.times[before]);
        let t = if span > 0.0 {
            f64::from(time - self.times[before]) / span
        } else {
            0.0
        };
        let value = |index: usize| self.values[index].map(f64::from);
        match self.interpolation {
            Interpolation::Step => value(before),
            Interpolation::Linear => mix(value(before), value(after), t),
            Interpolation::CubicSpline => {
                let (from, to) = (value(3 * before + 1), value(3 * after + 1));
                let (leave, arrive) = (value(3 * before + 2), value(3 * after));
                let (t2, t3) = (t * t, t * t * t);
                // The glTF specification's appendix C.5.
                std::array::from_fn(|i| {
                    (2.0 * t3 - 3.0 * t2 + 1.0) * from[i]
                        + span * (t3 - 2.0 * t2 + t) * leave[i]
                        + (3.0 * t2 - 2.0 * t3) * to[i]
                        + span * (t3 - t2) * arrive[i]
                })
            }
        }
    }
}
