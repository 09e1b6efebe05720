//! Reports events, owners, regions and statistics of a world, and sets its load balance and area of interest.

use super::role::Instead;
use super::view::{BodyChange, Owner, RegionInfo};
use super::{Error, Inner, World};
use crate::physics::{BorderView, ContactPoint, Inconsistency, Profile, Region};
use crate::protocol::{Area, Handover, WorldEvents};
use crate::runtime::{Choice, LocalWorld, Stats};
use crate::space::{Balance, BodyId, ClientId, RegionId};

/// Events, statistics and regions.
impl World {
    /// Returns the contacts that began, ended or exceeded their force threshold in the last step, for
    /// colliders with Rapier's `ActiveEvents` on either side. In a served world a client receives those of
    /// its avatars, and the server's program those of all bodies (`ServeConfig::events`). A kinematic body
    /// notices fixed bodies and their sensors only with
    /// `active_collision_types(ActiveCollisionTypes::all())`, as in Rapier.
    ///
    /// ```
    /// # use dcd::prelude::*;
    /// # let mut world = World::new(WorldConfig::default())?;
    /// let gate = ColliderBuilder::cuboid(1.0, 1.0, 1.0).sensor(true).active_events(ActiveEvents::COLLISION_EVENTS);
    /// let gate = world.insert(RigidBodyBuilder::fixed(), gate)?;
    /// let at = RigidBodyBuilder::dynamic().translation(Vector::new(0.0, 1.6, 0.0));
    /// let ball = world.insert(at, ColliderBuilder::ball(0.5))?;
    /// while world.events().touches.is_empty() {
    ///     world.step()?;
    /// }
    /// let touch = world.events().touches[0];
    /// assert!(touch.began && touch.sensor);
    /// assert_eq!(touch.key.colliders(), [gate.into(), ball.into()]);
    /// # Ok::<(), Error>(())
    /// ```
    #[must_use]
    pub fn events(&self) -> &WorldEvents {
        match &self.inner {
            Inner::Local(world) => world.events(),
            Inner::Remote(world) => world.events(),
        }
    }

    /// Returns the contact points of a body after the last step, also those of contacts that are about to
    /// begin, by pair and manifold: where they are, how deep, and the impulse by which they push. Contacts
    /// with sensors have no points. Local worlds only: a client learns when contacts of its avatars begin and
    /// end ([`World::events`]).
    ///
    /// ```
    /// # use dcd::prelude::*;
    /// # let mut world = World::new(WorldConfig::default())?;
    /// # let floor = world.insert(RigidBodyBuilder::fixed(), ColliderBuilder::cuboid(9.0, 0.5, 9.0))?;
    /// let at = RigidBodyBuilder::dynamic().translation(Vector::new(0.0, 1.0, 0.0));
    /// let ball = world.insert(at, ColliderBuilder::ball(0.5).mass(6.0))?;
    /// for _ in 0..60 {
    ///     world.step()?;
    /// }
    /// let points = world.contact_points(ball)?;
    /// assert_eq!((points.len(), points[0].key.other(ball)), (1, Some(floor)));
    /// let impulse = 6.0 * 9.81 * world.dt_s(); // that of its weight in a step
    /// assert!((points[0].impulse_ns / impulse - 1.0).abs() < 0.02);
    /// # Ok::<(), Error>(())
    /// ```
    pub fn contact_points(&self, body: BodyId) -> Result<Vec<ContactPoint>, Error> {
        Ok(self.local("read contacts", Instead::HearTouches)?.host().contact_points(body))
    }

    /// Returns the bodies that changed owner in the last step. A client returns the changes that it learnt of
    /// in its last step; a server or node returns none.
    #[must_use]
    pub fn handovers(&self) -> &[Handover] {
        match &self.inner {
            Inner::Local(world) => world.handovers(),
            Inner::Remote(world) => world.handovers(),
        }
    }

    /// Returns the bodies of a served world that came or went in a client's last step, and the inputs that
    /// were refused. Empty in other roles: the program of a local world knows.
    #[must_use]
    pub fn changes(&self) -> &[BodyChange] {
        self.remote().map_or(&[], |world| world.changes())
    }

    /// Returns whether the link to the server is lost, or the world has ended; always false for a local
    /// world.
    #[must_use]
    pub fn is_lost(&self) -> bool {
        self.remote().is_some_and(|world| world.is_lost())
    }

    /// Returns the id of this process as a client; `None` for a local world, a server or a node.
    #[must_use]
    pub fn client(&self) -> Option<ClientId> {
        self.remote()?.client()
    }

    /// Returns statistics of the world since its beginning, as far as this process knows them.
    #[must_use]
    pub fn stats(&self) -> Stats {
        match &self.inner {
            Inner::Local(world) => world.stats(),
            Inner::Remote(world) => world.stats(),
        }
    }

    /// Returns the times of the phases of the last step, and what was computed in it. Local worlds only: for
    /// other roles see [`Stats::last_step`].
    ///
    /// ```
    /// # use dcd::prelude::*;
    /// # let mut world = World::new(WorldConfig::default())?;
    /// # world.insert(RigidBodyBuilder::dynamic(), ColliderBuilder::ball(0.5).density(1.0))?;
    /// world.step()?;
    /// let profile = world.profile()?;
    /// assert_eq!(profile.awake, 1);
    /// assert!(profile.rapier <= world.stats().last_step);
    /// # Ok::<(), Error>(())
    /// ```
    pub fn profile(&self) -> Result<Profile, Error> {
        Ok(self.local("tell what a step costs", Instead::LookLocal)?.host().profile())
    }

    /// Returns the number of messages with states of bodies that this client has received; 0 in other roles.
    #[must_use]
    pub fn updates(&self) -> u64 {
        self.remote().map_or(0, |world| world.updates())
    }

    /// Returns how a local world is computed (regions, threads, coupling) and why; `None` in other roles.
    #[must_use]
    pub fn chosen(&self) -> Option<Choice> {
        Some(self.alone()?.chosen())
    }

    /// Returns a hash of the poses and velocities of all movable bodies. Equal worlds have equal hashes,
    /// whatever the number of threads. Local worlds only.
    pub fn state_hash(&self) -> Result<u64, Error> {
        Ok(self.local("compute the state's hash", Instead::CompareLocal)?.state_hash())
    }

    /// Returns the number of regions of the world; for a node, the number that it computes.
    #[must_use]
    pub fn region_count(&self) -> usize {
        match &self.inner {
            Inner::Local(world) => world.regions().len(),
            Inner::Remote(world) => world.region_count(),
        }
    }

    /// Returns the regions of the world; empty for a server and a node.
    #[must_use]
    pub fn regions(&self) -> Vec<RegionInfo> {
        let info = |region: &Region| RegionInfo {
            id: region.id(),
            node: None,
            owned: region.owned_count(),
            ghosts: region.ghost_count(),
            cell: *region.cell(),
        };
        match &self.inner {
            Inner::Local(world) => world.regions().map(info).collect(),
            Inner::Remote(world) => world.regions(),
        }
    }

    /// Returns the region and node that have authority over a body. [`Owner::region`] is `None` for a fixed
    /// body, for one that is not in the world, and always in a server or node.
    #[must_use]
    pub fn owner(&self, body: BodyId) -> Owner {
        let world = match &self.inner {
            Inner::Local(world) => world,
            Inner::Remote(world) => return world.owner(body),
        };
        let region = world.owner_of(body);
        Owner { region, holders: world.host().holders(body), here: region.is_some(), ..Owner::default() }
    }

    /// Returns the borders between regions: what the regions share there, and by how much their copies
    /// disagree. Local worlds only.
    pub fn borders(&self) -> Result<Vec<BorderView>, Error> {
        Ok(self.local("tell what borders cost", Instead::LookLocal)?.host().borders())
    }

    /// Checks the invariants of a local world between two ticks, and returns what violates them: exactly one
    /// owner per body, an owner index that leads to it, owners and regions that agree on who holds what,
    /// lists in order, shares of masses that add up, and finite numbers. An empty list means that all is
    /// well. The check looks at every body. Local worlds only; the feature `validate` runs the check after
    /// every tick, on nodes too, and panics on a finding.
    pub fn validate(&self) -> Result<Vec<Inconsistency>, Error> {
        Ok(self.local("check how its regions agree", Instead::LookLocal)?.host().validate())
    }

    /// Moves the plane of an inner vertex of the distribution tree to `at`, metres along the plane's axis,
    /// between its neighbours on that axis. Bodies change owner as if they had crossed the plane by
    /// themselves. Local worlds only.
    pub fn move_plane(&mut self, vertex: RegionId, at: f64) -> Result<(), Error> {
        Ok(self.local_mut("move a plane", Instead::LookLocal)?.move_plane(vertex, at)?)
    }

    /// Sets the load balance of a local world: from now on its regions follow the load. `None` leaves the
    /// regions as they are.
    pub fn set_balance(&mut self, balance: Option<Balance>) -> Result<(), Error> {
        Ok(self.local_mut("balance regions", Instead::LookLocal)?.set_balance(balance)?)
    }

    /// Sets a client's area of interest: from now on it receives the states of bodies in the area and around
    /// its own avatars. `None` means all bodies, as at first unless `JoinConfig::interest` says otherwise.
    /// Bodies outside stay as they were last received ([`Body::outside`](super::Body::outside)). A local
    /// world ignores the call and shows everything; a server or node returns an error.
    pub fn set_interest(&mut self, area: Option<Area>) -> Result<(), Error> {
        match &mut self.inner {
            Inner::Local(_) => Ok(()),
            Inner::Remote(world) => world.set_interest(area),
        }
    }

    /// Limits the bytes per second of states of bodies that this client is sent, with all headers but IP's.
    /// `None`, as at first, means as many as the link carries. Where there is room for fewer bodies than have
    /// news, those come first that are most wrong here, as seen from this client's avatars, and for the
    /// longest time. Below some 2,000 bytes per second the client learns little more than that time goes on.
    /// A local world ignores the call; a server or node returns an error.
    pub fn set_bandwidth(&mut self, bytes_per_s: Option<u32>) -> Result<(), Error> {
        match &mut self.inner {
            Inner::Local(_) => Ok(()),
            Inner::Remote(world) => world.set_bandwidth(bytes_per_s),
        }
    }

    pub(super) fn alone(&self) -> Option<&LocalWorld> {
        match &self.inner {
            Inner::Local(world) => Some(world),
            Inner::Remote(_) => None,
        }
    }
}
