//! Saves a world that nodes compute, as it is after one tick, and goes back to such a save. To save, the
//! members of the main group stop in a view change and say all that they own. To go back, all begin anew with
//! what was saved.

use bincode::{Decode, Encode};

use super::common::Common;
use super::group::Group;
use super::{Server, ServerOutput};
use crate::protocol::{BodyRecord, JointRecord, ShapeRecord};
use crate::space::{DistributionTree, Tick};

/// A world between two ticks. Of Rapier's memory of contacts, it has how bodies lay when the contacts were
/// found.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub struct SavedWorld {
    /// The tick after which it was saved.
    pub tick: Tick,
    /// The ids of the next body and the next joint that a program may make.
    pub next_ids: (u32, u64),
    /// The distribution tree by which the world was cut.
    pub tree: DistributionTree,
    /// All bodies in the world, including avatars, in id order.
    pub bodies: Vec<BodyRecord>,
    /// The shapes of these bodies.
    pub shapes: Vec<ShapeRecord>,
    /// The joints between these bodies.
    pub joints: Vec<JointRecord>,
}

impl Server {
    /// Replaces the world by a saved one. Avatars are their clients': those in both worlds go to where they
    /// were saved, and none comes or goes. Ticks go on, and no id is given a second time.
    pub(super) fn replace(&mut self, saved: SavedWorld) {
        let (body, joint) = self.common.next_ids;
        self.common.next_ids = (body.max(saved.next_ids.0), joint.max(saved.next_ids.1));
        self.common.world_changed = true;
        // What anybody still says of the former world does not count.
        self.common.number = self.common.number.next();
        for group in self.groups.values_mut() {
            group.replace(&mut self.common, &saved);
        }
        // Forgets the shapes that only the former world had.
        self.look_through_shapes();
        self.arbiter = Default::default();
        self.common.allowances.values_mut().for_each(|allowance| allowance.building.sizes.clear());
        let nodes: Vec<_> = self.common.nodes.iter().map(|(&node, entry)| (node, entry.linked)).collect();
        for (node, linked) in nodes {
            match self.common.nodes.get_mut(&node).filter(|entry| entry.leaving) {
                Some(entry) => entry.serving = None,
                None if linked => self.welcome_node_again(node),
                None => self.lose(node),
            }
        }
        let linked = self.common.clients.iter().filter(|(_, entry)| entry.linked);
        for client in linked.map(|(&client, _)| client).collect::<Vec<_>>() {
            self.tell_world_again(client);
        }
    }
}

impl Group {
    /// Reports the world as saved, as it is on record.
    pub(super) fn tell_saved(&mut self, common: &mut Common) {
        self.saving = false;
        let tree = self.view.as_ref().map_or(&common.config.world.tree, |view| &view.tree);
        let bodies: Vec<_> = self.record.present().cloned().collect();
        let is_present = |id| bodies.binary_search_by_key(&id, |body| body.id).is_ok();
        let joints = self.record.joints().filter(|joint| is_present(joint.a) && is_present(joint.b));
        let saved = SavedWorld {
            tick: self.tick,
            next_ids: common.next_ids,
            tree: tree.clone(),
            joints: joints.cloned().collect(),
            shapes: self.record.shapes_of(&bodies),
            bodies,
        };
        common.outputs.push_back(ServerOutput::Saved(Box::new(saved)));
    }

    fn replace(&mut self, common: &mut Common, saved: &SavedWorld) {
        let mut record = std::mem::take(&mut self.record);
        record.replace(saved, common.number);
        common.groups_changed.insert(self.id);
        let (saving, mut retold) = (self.saving, std::mem::take(&mut self.retold));
        retold.clear();
        *self = Self::new(self.id, record, self.tick);
        (self.saving, self.retold) = (saving, retold);
    }
}
