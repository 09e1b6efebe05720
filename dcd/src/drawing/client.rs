//! Implements `Source` for a served world as a client knows it.

use std::collections::BTreeMap;

use super::source::{Details, RegionSeen, Seen, Source, appearance_of};
use crate::playback::ViewTime;
use crate::protocol::{BodyKind, BodyRecord, ShapeHash, ShapeRecord, WorldPose};
use crate::runtime::ClientWorld;
use crate::space::{BodyId, Bounds, DistributionTree, RegionId};

/// A client's world at a moment, with the distribution tree of that moment: regions do not change during a
/// look.
pub(crate) struct Told<'a> {
    world: &'a ClientWorld,
    time: ViewTime,
    tree: DistributionTree,
    places: BTreeMap<RegionId, u16>,
}

impl<'a> Told<'a> {
    /// Returns `None` before the world is known.
    pub(crate) fn of(world: &'a mut ClientWorld) -> Option<Self> {
        let time = world.view_time()?;
        let tree = world.tree().or_else(|| world.environment().map(|environment| environment.tree))?;
        let places = tree.leaves().zip(0..).collect();
        Some(Self { world, time, tree, places })
    }
}

impl Source for Told<'_> {
    fn tick(&self) -> u64 {
        self.world.tick().0
    }

    fn bounds(&self) -> Bounds {
        self.tree.bounds()
    }

    fn for_each_movable(&self, mut look: impl FnMut(BodyId, Seen)) {
        let mut known = Vec::new();
        self.world.with_bodies(|view| {
            if view.body.traits.kind != BodyKind::Fixed {
                let state = &view.body.state;
                let owner = view.owner.unwrap_or_else(|| self.tree.leaf_at(state.pose.translation));
                let seen = Seen {
                    at: state.pose.translation,
                    turn: state.pose.rotation,
                    velocity_m_s: state.velocity.linear,
                    owner: self.places.get(&owner).copied().unwrap_or(0),
                    sleeping: state.sleeping,
                    outside: view.outside,
                    appearance: appearance_of(&view.body.traits),
                };
                known.push((view.body.id, seen));
            }
            None::<()>
        });
        // Bodies are drawn where the player would see them.
        let shown = self.world.motions_at(known.iter().map(|(id, _)| *id), &self.time);
        for ((id, seen), motion) in known.into_iter().zip(shown) {
            look(
                id,
                motion.map_or(seen, |motion| Seen {
                    at: motion.pose.translation,
                    turn: motion.pose.rotation,
                    velocity_m_s: motion.velocity.linear,
                    ..seen
                }),
            );
        }
    }

    fn for_each_fixed(&self, mut look: impl FnMut(BodyId, &WorldPose, u64)) {
        self.world.with_bodies(|view| {
            if view.body.traits.kind == BodyKind::Fixed {
                look(view.body.id, &view.body.state.pose, appearance_of(&view.body.traits));
            }
            None::<()>
        });
    }

    fn record(&self, id: BodyId) -> Option<BodyRecord> {
        Some(self.world.body(id)?.body)
    }

    fn shape(&self, hash: ShapeHash) -> Option<ShapeRecord> {
        self.world.shape(hash)
    }

    fn regions(&self) -> Vec<RegionSeen> {
        let seen = self.tree.leaves().map(|id| RegionSeen {
            id: id.0,
            node: self.world.computed_by(id).map(|node| node.0),
            ghosts: 0,
            step_ms: 0.0,
            cell: self.tree.cell(id),
        });
        seen.collect()
    }

    fn details(&self, id: BodyId) -> Option<Details> {
        let record = self.world.body(id)?.body;
        let user_data = record.user_data;
        Some(Details { id, epoch: record.epoch, mass_kg: None, user_data, holders: 0 })
    }

    fn is_own(&self, id: BodyId) -> bool {
        id.client() == Some(self.world.id())
    }
}
