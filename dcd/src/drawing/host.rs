//! Implements `Source` for the regions that a process computes: all regions of a local world, or those of a
//! node.

use std::collections::{BTreeMap, BTreeSet};

use rapier3d::prelude::*;

use super::source::{
    BorderSeen, ContactSeen, Details, Extent, Ghost, RegionSeen, Seen, Source, Tie, appearance_of,
};
use crate::physics::{Ownership, Region, RegionHost, drawn_force_n};
use crate::protocol::{BodyRecord, ShapeHash, ShapeRecord, WorldPose};
use crate::space::{BodyId, Bounds, JointId, RegionId};

impl Source for RegionHost {
    fn tick(&self) -> u64 {
        self.tick().0
    }

    fn bounds(&self) -> Bounds {
        self.partition().tree().bounds()
    }

    fn for_each_movable(&self, mut look: impl FnMut(BodyId, Seen)) {
        let mut guests = guests(self).into_iter().peekable();
        for (id, region, handle) in self.owned_bodies() {
            while let Some((guest, seen)) = guests.next_if(|(guest, _)| *guest < id) {
                look(guest, seen);
            }
            look(id, seen(region, handle, region.rank()));
        }
        guests.for_each(|(guest, seen)| look(guest, seen));
    }

    fn for_each_fixed(&self, mut look: impl FnMut(BodyId, &WorldPose, u64)) {
        self.scenery().for_each(|body| look(body.id, &body.state.pose, appearance_of(&body.traits)));
    }

    fn record(&self, id: BodyId) -> Option<BodyRecord> {
        self.record(id)
    }

    fn shape(&self, hash: ShapeHash) -> Option<ShapeRecord> {
        self.shapes().record_of(hash).cloned()
    }

    fn joints(&self) -> BTreeMap<JointId, Tie> {
        self.regions().flat_map(Region::joints).map(Tie::of).collect()
    }

    fn regions(&self) -> Vec<RegionSeen> {
        let here: BTreeMap<RegionId, &Region> = self.regions().map(|region| (region.id(), region)).collect();
        let tree = self.partition().tree();
        let seen = |id: RegionId| {
            let region = here.get(&id);
            RegionSeen {
                id: id.0,
                node: None,
                ghosts: region.map_or(0, |region| region.ghost_count()),
                step_ms: region.map_or(0.0, |region| region.last_step().as_secs_f32() * 1e3),
                cell: region.map_or_else(|| tree.cell(id), |region| *region.cell()),
            }
        };
        tree.leaves().map(seen).collect()
    }

    fn borders(&self) -> Vec<BorderSeen> {
        let places: BTreeMap<RegionId, u16> =
            self.regions().map(|region| (region.id(), region.rank() as u16)).collect();
        let seen = self.borders().into_iter().map(|border| BorderSeen {
            between: [places[&border.a], places[&border.b]],
            bodies: border.bodies,
            exchanges: border.exchanges,
            disagreement_m_s: border.disagreement_m_s,
        });
        seen.collect()
    }

    fn ghosts(&self) -> Vec<Ghost> {
        let seen = self.ghosts().map(|(id, region, handle)| {
            let own = self.owned(id).map(|(owner, handle)| owner.velocity(handle).linear);
            let here = region.velocity(handle).linear;
            let off2 = own.map_or(0.0, |own| (0..3).map(|i| (own[i] - here[i]).powi(2)).sum::<f32>());
            Ghost { id, holder: region.rank() as u16, off_m_s: off2.sqrt() }
        });
        seen.collect()
    }

    fn ghost_boxes(&self) -> Vec<(u16, Bounds)> {
        self.ghosts().map(|(_, region, handle)| (region.rank() as u16, region.world_bounds(handle))).collect()
    }

    fn contacts(&self, most: usize) -> Vec<ContactSeen> {
        self.regions().flat_map(contacts_in).take(most).collect()
    }

    fn extent(&self, id: BodyId) -> Option<Extent> {
        if self.immovable(id).is_some() {
            return None;
        }
        let held = || self.regions().find_map(|region| Some((region, region.handle_of(id)?)));
        let (region, handle) = self.owned(id).or_else(held)?;
        let body = &region.physics().bodies[handle];
        let (centre, anchor) = (*body.position() * body.local_center_of_mass(), region.anchor());
        Some(Extent {
            aabb: region.world_bounds(handle),
            swept: self.swept_bounds(region, handle),
            centre_of_mass: std::array::from_fn(|i| anchor[i] + f64::from(centre[i])),
        })
    }

    fn details(&self, id: BodyId) -> Option<Details> {
        let record = self.record(id)?;
        let mass_kg = if self.immovable(id).is_some() { Some(0.0) } else { self.mass_kg(id) };
        let user_data = record.user_data;
        Some(Details { id, epoch: record.epoch, mass_kg, user_data, holders: self.holders(id) })
    }

    fn is_own(&self, _id: BodyId) -> bool {
        false
    }
}

pub(super) fn seen(region: &Region, handle: RigidBodyHandle, owner: usize) -> Seen {
    let body = &region.physics().bodies[handle];
    let pose = region.world_pose(handle);
    Seen {
        at: pose.translation,
        turn: pose.rotation,
        velocity_m_s: body.linvel().to_array(),
        owner: owner as u16,
        sleeping: body.is_sleeping(),
        outside: false,
        appearance: appearance_of(region.traits_of(handle)),
    }
}

/// Returns the bodies that other processes own, as ghosts in this process show them, in id order. A local
/// world has none.
pub(super) fn guests(host: &RegionHost) -> Vec<(BodyId, Seen)> {
    if host.regions().len() == host.partition().tree().leaf_count() {
        return Vec::new();
    }
    let mut known = BTreeSet::new();
    let guest = |(id, region, handle): (BodyId, &Region, RigidBodyHandle)| match region.role_of(handle)?.1 {
        Ownership::Ghost { owner } if host.owned(id).is_none() && known.insert(id) => {
            Some((id, seen(region, handle, owner)))
        }
        _ => None,
    };
    let mut guests: Vec<_> = host.ghosts().filter_map(guest).collect();
    guests.sort_unstable_by_key(|(id, _)| *id);
    guests
}

/// Returns the contacts for which a region answers. As one region answers for each pair, no pair comes twice.
fn contacts_in(region: &Region) -> impl Iterator<Item = ContactSeen> {
    let world = region.physics();
    world.contact_pairs().filter(|pair| pair.has_any_active_contact()).filter_map(move |pair| {
        let colliders = [pair.collider1, pair.collider2].map(|collider| world.colliders.get(collider));
        let [Some(first), Some(_)] = colliders else { return None };
        let force_n = drawn_force_n(region, pair)?.map(|v| v as f32);
        let manifold = pair.solver_manifolds().first()?;
        let point = manifold.points.first()?;
        let anchor = region.anchor();
        let place = *first.position() * manifold.subshape_pos1().copied().unwrap_or(Pose::IDENTITY);
        let place = place.transform_point(point.local_p1);
        let at = std::array::from_fn(|i| anchor[i] + f64::from(place[i]));
        Some(ContactSeen { at, force_n })
    })
}
