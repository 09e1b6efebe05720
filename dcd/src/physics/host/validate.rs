//! Checks the invariants of all regions between two ticks, as Box2D's `b2Validate` functions do for one
//! world.

use std::collections::{BTreeMap, BTreeSet};

use super::RegionHost;
use crate::physics::region::{BodyRef, Ownership};
use crate::space::{BodyId, RegionId, RegionSet};

/// A violated invariant between two ticks: a fault of dcd or of a peer
/// ([`World::validate`](crate::World::validate)).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, thiserror::Error)]
#[non_exhaustive]
pub enum Inconsistency {
    /// A body does not have exactly one owner.
    #[error("{body} has {owners} owners instead of one")]
    Owners {
        /// Which body.
        body: BodyId,
        /// The number of regions that own it.
        owners: usize,
    },
    /// The owner index does not lead to the owner.
    #[error("the index of owners does not lead to {body} in {region}")]
    Index {
        /// Which body.
        body: BodyId,
        /// The region that owns it.
        region: RegionId,
    },
    /// The owner of a body believes that a region holds a ghost of it, which the region does not.
    #[error("{region} does not hold {body}, though its owner believes so")]
    NoGhost {
        /// Which body.
        body: BodyId,
        /// The region that should hold it.
        region: RegionId,
    },
    /// A region holds a ghost of which the owner does not know.
    #[error("{region} holds {body}, and its owner does not know")]
    UnknownGhost {
        /// Which body.
        body: BodyId,
        /// The region that holds it.
        region: RegionId,
    },
    /// The parts of a body's mass in its copies do not add up to one.
    #[error("the parts of the mass of {body} do not add up to one: see the copy in {region}")]
    Mass {
        /// Which body.
        body: BodyId,
        /// The region whose part is not the one that the owner's copy states.
        region: RegionId,
    },
    /// A region's lists of shared bodies and ghosts do not list its bodies, each once and in id order.
    #[error("the lists of shared bodies and ghosts in {region} are not those of its bodies in id order")]
    Lists {
        /// The region.
        region: RegionId,
    },
    /// A body's pose or velocity is NaN or infinite.
    #[error("the state of {body} in {region} is not finite")]
    NotFinite {
        /// Which body.
        body: BodyId,
        /// The region that holds it.
        region: RegionId,
    },
}

impl RegionHost {
    /// Returns the violated invariants of the regions computed here, in order; none as long as all is well.
    /// Call it between two ticks. The holders of bodies are checked only if this process computes all
    /// regions. Contacts of the same pair in two regions are not compared: copies may differ by the error of
    /// the coupling.
    pub fn validate(&self) -> Vec<Inconsistency> {
        let mut found = Vec::new();
        let mut owners: BTreeMap<BodyId, Vec<(usize, RegionSet)>> = BTreeMap::new();
        let mut held: BTreeMap<BodyId, RegionSet> = BTreeMap::new();
        let mut parts: BTreeMap<BodyId, Vec<(usize, RegionSet)>> = BTreeMap::new();
        let region_of = |rank: usize| self.partition.leaves()[rank];
        for region in self.regions() {
            let (mut shared, mut ghosts) = (BTreeSet::new(), BTreeSet::new());
            for (body, role, handle, rigid_body) in region.bodies() {
                let id = region.id();
                match role {
                    Ownership::Owner => {
                        let holders = region.slot(handle).holders;
                        owners.entry(body).or_default().push((region.rank(), holders));
                        if !holders.is_empty() {
                            shared.insert(body);
                        }
                        if self.owned(body).is_none_or(|(owner, at)| owner.id() != id || at != handle) {
                            found.push(Inconsistency::Index { body, region: id });
                        }
                    }
                    Ownership::Ghost { .. } => {
                        held.entry(body).or_insert(RegionSet::EMPTY).insert(region.rank());
                        ghosts.insert(body);
                    }
                    Ownership::Immovable => {}
                }
                if let Some(split) = region.mass_split(handle) {
                    parts.entry(body).or_default().push((region.rank(), split.among));
                }
                let is_finite = rigid_body.position().is_finite()
                    && rigid_body.linvel().is_finite()
                    && rigid_body.angvel().is_finite();
                if !is_finite && !region.quarantined().contains(&body) {
                    found.push(Inconsistency::NotFinite { body, region: id });
                }
            }
            let listed = |list: &[BodyRef], bodies| list.iter().map(|link| link.id).eq(bodies);
            if !listed(region.shared(), shared) || !listed(region.ghosts(), ghosts) {
                found.push(Inconsistency::Lists { region: region.id() });
            }
        }
        if self.sides.len() == self.partition.len() {
            for (&body, owners) in &owners {
                if owners.len() > 1 {
                    found.push(Inconsistency::Owners { body, owners: owners.len() });
                }
                let here = held.get(&body).copied().unwrap_or(RegionSet::EMPTY);
                let (_, holders) = owners[0];
                let missing = holders.without(here).iter().map(region_of);
                found.extend(missing.map(|region| Inconsistency::NoGhost { body, region }));
                let unknown = here.without(holders).iter().map(region_of);
                found.extend(unknown.map(|region| Inconsistency::UnknownGhost { body, region }));
            }
            for (&body, copies) in &parts {
                // All copies that have a part know of each other, so that each of n copies has the n-th part.
                let among = |of: usize| copies.iter().find(|&&(rank, _)| rank == of).map(|&(_, among)| among);
                for &(rank, all) in copies.iter().filter(|(rank, all)| all.contains(*rank)) {
                    if all.iter().any(|other| other != rank && among(other) != Some(all)) {
                        found.push(Inconsistency::Mass { body, region: region_of(rank) });
                    }
                }
            }
            let lost = held.keys().filter(|body| !owners.contains_key(body));
            found.extend(lost.map(|&body| Inconsistency::Owners { body, owners: 0 }));
        }
        found.sort_unstable();
        found
    }
}

#[cfg(test)]
mod tests {
    use rapier3d::prelude::*;

    use super::*;
    use crate::physics::host::processes::Processes;
    use crate::physics::{Coupling, StepSettings};
    use crate::scene::{Params, Scene};

    const OWNER: usize = 0;
    const HOLDER: usize = 1;

    /// Returns what is found in a tower on the border of two regions, after `break_it` has broken something
    /// about a box that both hold.
    fn found(break_it: impl FnOnce(&mut RegionHost, BodyId, [RigidBodyHandle; 2])) -> Vec<Inconsistency> {
        let scene = Scene::named("tower", &Params::default()).unwrap();
        let settings = StepSettings::default().with_coupling(Coupling::Overlap);
        let mut world = Processes::of(&scene, settings, 2, 1);
        world.step();
        let host = &mut world.0[0];
        assert_eq!(host.validate(), []);
        let body = host.sides[OWNER].region.shared()[0];
        let there = host.sides[HOLDER].region.handle_of(body.id).expect("the other holds it");
        break_it(host, body.id, [body.handle, there]);
        host.validate()
    }

    #[test]
    fn whatever_is_broken_is_found_and_named() {
        let region = |rank: usize| RegionId([1, 2][rank]);
        let role = |rank: usize, role| {
            found(|host, _, handles| host.sides[rank].region.slot_mut(handles[rank]).role = role)
        };
        let owners = |found: &[Inconsistency], count| {
            found
                .iter()
                .any(|fault| matches!(fault, Inconsistency::Owners { owners, .. } if *owners == count))
        };
        let two = role(HOLDER, Ownership::Owner);
        assert!(
            owners(&two, 2) && two.iter().any(|fault| matches!(fault, Inconsistency::Index { .. })),
            "{two:?}"
        );
        assert!(two.contains(&Inconsistency::Lists { region: region(HOLDER) }), "{two:?}");
        assert!(owners(&role(OWNER, Ownership::Ghost { owner: HOLDER }), 0));

        let unknown =
            found(|host, _, [own, _]| host.sides[OWNER].region.slot_mut(own).holders = RegionSet::EMPTY);
        let [Inconsistency::UnknownGhost { region: at, .. }, Inconsistency::Lists { .. }] = unknown[..]
        else {
            panic!("{unknown:?}")
        };
        assert_eq!(at, region(HOLDER));

        let parts = found(|host, _, [own, _]| {
            let split = host.sides[OWNER].region.slot_mut(own).mass_split.as_mut();
            split.expect("its mass is split").among = RegionSet::only(OWNER);
        });
        assert!(matches!(parts[..], [Inconsistency::Mass { .. }]), "{parts:?}");

        let spins = found(|host, id, _| {
            host.change_copies(id, |body| body.set_angvel(Vector::splat(f32::NAN), true));
        });
        assert!(
            matches!(spins[..], [Inconsistency::NotFinite { .. }, Inconsistency::NotFinite { .. }]),
            "{spins:?}"
        );
    }
}
