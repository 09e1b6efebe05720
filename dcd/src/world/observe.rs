//! What happened, who owns what, how it is computed.

use super::role::Instead;
use super::view::{BodyChange, Owner, RegionInfo};
use super::{Error, Inner, World};
use crate::physics::{BorderView, Inconsistency, Region};
use crate::protocol::{Area, Handover, WorldEvents};
use crate::runtime::{Choice, LocalWorld, Stats};
use crate::space::{Balance, BodyId, ClientId, RegionId};

/// Events, statistics, regions.
impl World {
    /// Contacts that began, ceased or pressed hard in the last step, for colliders with Rapier's `ActiveEvents`; in a served world
    /// those of avatars of this process.
    #[must_use]
    pub fn events(&self) -> &WorldEvents {
        match &self.inner {
            Inner::Local(world) => world.events(),
            Inner::Remote(world) => world.events(),
        }
    }

    /// Bodies that changed owner in the last step, or were heard to in it.
    #[must_use]
    pub fn handovers(&self) -> &[Handover] {
        match &self.inner {
            Inner::Local(world) => world.handovers(),
            Inner::Remote(world) => world.handovers(),
        }
    }

    /// Bodies of a served world that came or went in the last step, and what was refused; nothing in a local world, whose program
    /// knows.
    #[must_use]
    pub fn changes(&self) -> &[BodyChange] {
        self.remote().map_or(&[], |world| world.changes())
    }

    /// Whether the link to the server is gone, or the world has ended; never of a local world.
    #[must_use]
    pub fn is_lost(&self) -> bool {
        self.remote().is_some_and(|world| world.is_lost())
    }

    /// The number that the server knows this process by as a client; `None` for other roles.
    #[must_use]
    pub fn client(&self) -> Option<ClientId> {
        self.remote()?.client()
    }

    /// What the world did so far, as far as this process knows.
    #[must_use]
    pub fn stats(&self) -> Stats {
        match &self.inner {
            Inner::Local(world) => world.stats(),
            Inner::Remote(world) => world.stats(),
        }
    }

    /// Messages with states of bodies received so far; 0 in a local world.
    #[must_use]
    pub fn updates(&self) -> u64 {
        self.remote().map_or(0, |world| world.updates())
    }

    /// How a local world is computed, and why so; `None` where others decide.
    #[must_use]
    pub fn chosen(&self) -> Option<Choice> {
        Some(self.alone()?.chosen())
    }

    /// One number for the state of all movable bodies: equal worlds, equal numbers, whatever the number of threads. Local worlds
    /// only.
    pub fn state_hash(&self) -> Result<u64, Error> {
        Ok(self.local("compute the state's hash", Instead::CompareLocal)?.state_hash())
    }

    /// How many regions the world is cut into; those that this process computes, for a node.
    #[must_use]
    pub fn region_count(&self) -> usize {
        match &self.inner {
            Inner::Local(world) => world.regions().len(),
            Inner::Remote(world) => world.region_count(),
        }
    }

    /// The regions of the world; none where the process does not see it.
    #[must_use]
    pub fn regions(&self) -> Vec<RegionInfo> {
        let info = |region: &Region| RegionInfo {
            id: region.id(),
            node: None,
            owned: region.owned_count(),
            replicas: region.replica_count(),
            cell: *region.cell(),
        };
        match &self.inner {
            Inner::Local(world) => world.regions().map(info).collect(),
            Inner::Remote(world) => world.regions(),
        }
    }

    /// Who has authority over a body that is there.
    #[must_use]
    pub fn owner(&self, body: BodyId) -> Owner {
        let world = match &self.inner {
            Inner::Local(world) => world,
            Inner::Remote(world) => return world.owner(body),
        };
        let region = world.owner_of(body);
        Owner { region, holders: world.host().holders(body), here: region.is_some(), ..Owner::default() }
    }

    /// Where regions meet: what they share there, and by how much their copies disagree. Local worlds only.
    pub fn borders(&self) -> Result<Vec<BorderView>, Error> {
        Ok(self.local("tell what borders cost", Instead::LookLocal)?.host().borders())
    }

    /// Checks what must hold between two ticks: exactly one owner per body, an index that leads to it, owners and regions that agree on
    /// who holds what, finite numbers. Nothing is returned as long as all is well; it costs a look at every body. A world that
    /// others compute has nothing to check here.
    #[must_use]
    pub fn validate(&self) -> Vec<Inconsistency> {
        self.alone().map(|world| world.host().validate()).unwrap_or_default()
    }

    /// Moves the plane of an inner vertex of the distribution tree, between its neighbours on the same axis. Bodies change hands
    /// as if they had crossed it by themselves. Local worlds only.
    pub fn move_plane(&mut self, vertex: RegionId, at: f64) -> Result<(), Error> {
        Ok(self.local_mut("move a plane", Instead::LookLocal)?.move_plane(vertex, at)?)
    }

    /// Lets the regions of a local world follow the load from now on, or leaves them as they are.
    pub fn set_balance(&mut self, balance: Option<Balance>) -> Result<(), Error> {
        Ok(self.local_mut("balance regions", Instead::LookLocal)?.set_balance(balance)?)
    }

    /// Wants to hear of bodies in this area and about avatars of this process from now on; `None`: of all, as at first. What is
    /// outside stays as last heard of ([`Body::outside`](super::Body::outside)). A local world shows everything all the same.
    pub fn set_interest(&mut self, area: Option<Area>) -> Result<(), Error> {
        match &mut self.inner {
            Inner::Local(_) => Ok(()),
            Inner::Remote(world) => world.set_interest(area),
        }
    }

    pub(super) fn alone(&self) -> Option<&LocalWorld> {
        match &self.inner {
            Inner::Local(world) => Some(world),
            Inner::Remote(_) => None,
        }
    }
}
