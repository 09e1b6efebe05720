//! Shows a builder's author (`author::Author`) what its client has heard of the world.

use std::collections::BTreeMap;

use super::author::Known;
use crate::cluster::BodyView as Heard;
use crate::protocol::{BodyRecord, EnvironmentProperties, JointRecord, ShapeHash, ShapeRecord};
use crate::runtime::ClientWorld;
use crate::space::{BodyId, DistributionTree, JointId};

/// What a client has heard of the world up to its last step.
pub(super) struct Seen<'a> {
    pub bodies: &'a BTreeMap<BodyId, Heard>,
    pub world: &'a ClientWorld,
    pub environment: &'a EnvironmentProperties,
}

impl Known for Seen<'_> {
    fn knows(&self, id: BodyId) -> bool {
        self.bodies.contains_key(&id)
    }

    fn body(&self, id: BodyId) -> Option<BodyRecord> {
        self.bodies.get(&id).map(|heard| heard.body.clone())
    }

    fn for_each_body(&self, look: &mut dyn FnMut(&BodyRecord)) {
        self.bodies.values().for_each(|heard| look(&heard.body));
    }

    fn shape(&self, hash: ShapeHash) -> Option<ShapeRecord> {
        self.world.shape(hash)
    }

    fn has_shape(&self, hash: ShapeHash) -> bool {
        self.world.has_heard_of(hash)
    }

    fn joint(&self, id: JointId) -> Option<JointRecord> {
        self.world.joint(id)
    }

    fn joints(&self) -> Vec<JointRecord> {
        self.world.joints()
    }

    fn joints_of(&self, body: BodyId) -> Vec<JointRecord> {
        self.world.joints_of(body)
    }

    fn tree(&self) -> DistributionTree {
        self.environment.tree.clone()
    }

    fn answered(&self) -> u64 {
        self.world.answered_builds()
    }
}
