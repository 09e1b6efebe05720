//! Compares what joints bear with the strengths that their user gave them.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::physics::RegionHost;
use crate::space::JointId;

/// An event: a joint bore more than its strength in the last step ([`World::set_joint_strength`](crate::World::set_joint_strength)).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct JointOverload {
    /// Which joint.
    pub joint: JointId,
    /// The force on its locked axes, newtons.
    pub force_n: f32,
    /// The torque on its locked axes, newton metres.
    pub torque_n_m: f32,
}

/// The strengths of joints, and which of them were not strong enough in the last step.
#[derive(Clone, Default, Serialize, Deserialize)]
pub(super) struct Strengths {
    /// Newtons and newton metres.
    by_joint: BTreeMap<JointId, [f32; 2]>,
    overloads: Vec<JointOverload>,
}

impl Strengths {
    /// Sets the strength of a joint; infinite is none.
    pub(super) fn set(&mut self, joint: JointId, force_n: f32, torque_n_m: f32) {
        if force_n.is_infinite() && torque_n_m.is_infinite() {
            self.by_joint.remove(&joint);
        } else {
            self.by_joint.insert(joint, [force_n, torque_n_m]);
        }
    }

    pub(super) fn overloads(&self) -> &[JointOverload] {
        &self.overloads
    }

    /// Compares what joints bore in the last step with their strengths, in id order.
    pub(super) fn look(&mut self, host: &RegionHost) {
        self.overloads.clear();
        let overloads = &mut self.overloads;
        self.by_joint.retain(|&joint, &mut [most_n, most_n_m]| {
            // It is gone with one of its bodies, or was removed.
            let Some(load) = host.joint_load(joint) else { return false };
            let length = |axes: &[f32]| axes.iter().map(|v| v * v).sum::<f32>().sqrt();
            let (force_n, torque_n_m) = (length(&load[..3]), length(&load[3..]));
            if force_n > most_n || torque_n_m > most_n_m {
                overloads.push(JointOverload { joint, force_n, torque_n_m });
            }
            true
        });
    }
}
