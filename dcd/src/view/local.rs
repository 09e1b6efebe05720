//! Lets a viewer look at a local world.

use std::collections::BTreeMap;

use rapier3d::prelude::*;

use super::source::{BorderSeen, ContactSeen, Details, Ghost, RegionSeen, Seen, Source};
use crate::physics::{Ownership, Region, pair_force_n};
use crate::protocol::{BodyRecord, JointRecord, ShapeHash, ShapeRecord, WorldPose};
use crate::runtime::LocalWorld;
use crate::space::{BodyId, Bounds, RegionId};

impl Source for LocalWorld {
    fn tick(&self) -> u64 {
        self.tick().0
    }

    fn bounds(&self) -> Bounds {
        self.host().partition().tree().bounds()
    }

    fn for_each_movable(&self, mut look: impl FnMut(BodyId, Seen)) {
        for (id, region, handle) in self.host().owned_bodies() {
            let body = &region.physics().bodies[handle];
            let pose = region.world_pose(handle);
            look(
                id,
                Seen {
                    at: pose.translation,
                    turn: pose.rotation,
                    speed_m_s: body.linvel().length(),
                    owner: region.rank() as u16,
                    sleeping: body.is_sleeping(),
                    outside: false,
                },
            );
        }
    }

    fn for_each_fixed(&self, mut look: impl FnMut(BodyId, &WorldPose)) {
        self.host().scenery().for_each(|body| look(body.id, &body.state.pose));
    }

    fn record(&self, id: BodyId) -> Option<BodyRecord> {
        self.host().record(id)
    }

    fn shape(&self, hash: ShapeHash) -> Option<ShapeRecord> {
        self.host().shapes().record_of(hash).cloned()
    }

    fn joints_of(&self, id: BodyId) -> Vec<JointRecord> {
        self.host().joints_of(id).collect()
    }

    fn regions(&self) -> Vec<RegionSeen> {
        let seen = |region: &Region| RegionSeen {
            id: region.id().0,
            node: None,
            ghosts: region.replica_count(),
            step_ms: region.last_step().as_secs_f32() * 1e3,
            cell: *region.cell(),
        };
        self.regions().map(seen).collect()
    }

    fn borders(&self) -> Vec<BorderSeen> {
        let places: BTreeMap<RegionId, u16> =
            self.regions().map(|region| (region.id(), region.rank() as u16)).collect();
        let borders = self.host().borders().into_iter();
        let seen = borders.map(|border| BorderSeen {
            between: [places[&border.a], places[&border.b]],
            bodies: border.bodies,
            exchanges: border.exchanges,
            disagreement_m_s: border.disagreement_m_s,
        });
        seen.collect()
    }

    fn ghosts(&self) -> Vec<Ghost> {
        let seen = self.host().ghosts().map(|(id, region, handle)| {
            let own = self.host().owned(id).map(|(owner, handle)| owner.velocity(handle).linear);
            let here = region.velocity(handle).linear;
            let off2 = own.map_or(0.0, |own| (0..3).map(|i| (own[i] - here[i]).powi(2)).sum::<f32>());
            Ghost { id, holder: region.rank() as u16, off_m_s: off2.sqrt() }
        });
        seen.collect()
    }

    fn contacts(&self, most: usize) -> Vec<ContactSeen> {
        self.regions().flat_map(contacts_in).take(most).collect()
    }

    fn details(&self, id: BodyId) -> Option<Details> {
        let record = self.host().record(id)?;
        Some(Details {
            id,
            epoch: record.epoch,
            mass_kg: self.mass_kg(id),
            user_data: record.traits.user_data,
            holders: self.host().holders(id),
        })
    }

    fn is_own(&self, _id: BodyId) -> bool {
        false
    }
}

/// Returns what touches in a region, each pair where the movable body of the lower place is owned, so that none comes twice.
fn contacts_in(region: &Region) -> impl Iterator<Item = ContactSeen> {
    let world = region.physics();
    world.contact_pairs().filter(|pair| pair.has_any_active_contact()).filter_map(move |pair| {
        let colliders = [pair.collider1, pair.collider2].map(|collider| world.colliders.get(collider));
        let [Some(first), Some(second)] = colliders else { return None };
        let roles = [first, second].map(|collider| Some(region.role_of(collider.parent()?)?.1));
        let moves = |role: &Option<Ownership>| role.is_some_and(|role| role != Ownership::Immovable);
        if roles.iter().find(|role| moves(role)) != Some(&Some(Ownership::Owner)) {
            return None;
        }
        let manifold = pair.solver_manifolds().first()?;
        let point = manifold.points.first()?;
        let anchor = region.anchor();
        let place = *first.position() * manifold.subshape_pos1().copied().unwrap_or(Pose::IDENTITY);
        let place = place.transform_point(point.local_p1);
        let at = std::array::from_fn(|i| anchor[i] + f64::from(place[i]));
        Some(ContactSeen { at, force_n: pair_force_n(world, pair).map(|v| v as f32) })
    })
}
