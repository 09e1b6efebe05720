//! A world that nodes compute, as one of its clients sees it: what was heard up to the last step, and what was asked since.
//!
//! Between two steps nothing changes but by the caller's own doing, as in a local world: each step takes a copy of what the
//! client heard, and sends what was asked of avatars.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use dcd::cluster::BodyView as Heard;
use dcd::net::PeerStats;
use dcd::physics::ShapeLibrary;
use dcd::protocol::{
    Area, BodyKind, BodyRecord, EnvironmentProperties, Found, Handover, Question, Refusal, Velocity,
    WorldEvents, WorldPose,
};
use dcd::runtime::{ClientWorld, ProcessError, Stats};
use dcd::space::{BodyId, RegionId};
use rapier3d::prelude::*;

use crate::connection::Network;
use crate::properties::type_of;
use crate::status::{DCD_ERR_NETWORK, DCD_ERR_UNSUPPORTED, DcdStatus, Failure};
use crate::view::{BodyView, OwnerView, RegionView, StateRow};

/// A client's or participant's world.
pub(crate) struct Served {
    world: ClientWorld,
    network: Network,
    environment: EnvironmentProperties,
    /// As heard up to the last step, in id order.
    bodies: Vec<Heard>,
    /// Avatars asked for and not heard of yet.
    awaited: BTreeMap<BodyId, BodyRecord>,
    /// What is asked of avatars since the last step.
    wishes: BTreeMap<BodyId, Wish>,
    /// The newest velocity asked of each kinematic avatar, which is heard back some ticks later.
    driven: BTreeMap<BodyId, Velocity>,
    /// Avatars told to go that are still heard of, with their user data.
    leaving: BTreeMap<BodyId, u64>,
    /// User data of bodies that went: contacts that end name them.
    departed: BTreeMap<BodyId, u64>,
    events: WorldEvents,
    handovers: Vec<Handover>,
    changes: Vec<Change>,
    /// How many were asked.
    questions: u64,
    tick: u64,
    last_step: Duration,
    /// Why the world is lost, said by every later step.
    lost: Option<(DcdStatus, String)>,
}

/// A body came or went, or something asked of it was refused.
pub(crate) enum Change {
    Appeared(BodyId),
    Removed(BodyId),
    Refused(Option<BodyId>, Refusal, u64),
}

#[derive(Default)]
struct Wish {
    velocity: Option<Velocity>,
    pose: Option<WorldPose>,
}

impl Served {
    pub(crate) fn new(world: ClientWorld) -> Result<Self, Failure> {
        let environment = world.environment().ok_or(ProcessError::Stopped)?;
        let mut served = Self {
            network: Network::new(world.connections().clone()),
            world,
            environment,
            bodies: Vec::new(),
            awaited: BTreeMap::new(),
            wishes: BTreeMap::new(),
            driven: BTreeMap::new(),
            leaving: BTreeMap::new(),
            departed: BTreeMap::new(),
            events: WorldEvents::default(),
            handovers: Vec::new(),
            changes: Vec::new(),
            questions: 0,
            tick: 0,
            last_step: Duration::ZERO,
            lost: None,
        };
        served.listen();
        Ok(served)
    }

    pub(crate) fn is_participant(&self) -> bool {
        self.world.node().is_some()
    }

    pub(crate) fn client(&self) -> u32 {
        self.world.id().0
    }

    pub(crate) fn network(&self) -> &Network {
        &self.network
    }

    pub(crate) fn environment(&self) -> &EnvironmentProperties {
        &self.environment
    }

    pub(crate) fn tick(&self) -> u64 {
        self.tick
    }

    /// Sends what was asked and takes in what has come; waits for nothing.
    pub(crate) fn step(&mut self) -> Result<(), Failure> {
        let start = Instant::now();
        if self.lost.is_none() {
            // Whatever ended it, what C must know is that the world goes on without us.
            let sent = self.world.check().and_then(|()| self.send_wishes());
            self.lost = sent.err().map(|error| (DCD_ERR_NETWORK, error.to_string()));
        }
        self.listen();
        self.network.listen();
        self.last_step = start.elapsed();
        self.check_link()
    }

    /// Nothing can be asked of a world that is lost.
    fn check_link(&self) -> Result<(), Failure> {
        match &self.lost {
            None => Ok(()),
            Some((status, message)) => Err(Failure::new(*status, message.clone())),
        }
    }

    pub(crate) fn is_lost(&self) -> bool {
        self.lost.is_some()
    }

    fn listen(&mut self) {
        let heard = self.world.take_events();
        self.departed.clear();
        for &id in &heard.disappeared {
            let user_data = self.leaving.remove(&id).or_else(|| self.user_data(id));
            self.departed.insert(id, user_data.unwrap_or(0));
            self.driven.remove(&id);
        }
        for id in heard.refusals.iter().filter_map(|(id, _)| *id) {
            self.leaving.remove(&id);
        }
        // Before the bodies: what comes in between is of a later tick.
        self.tick = self.tick.max(self.world.tick().0);
        let (bodies, leaving, tick) = (&mut self.bodies, &self.leaving, &mut self.tick);
        bodies.clear();
        self.world.with_bodies(|body| {
            *tick = (*tick).max(body.tick.0);
            if !leaving.contains_key(&body.body.id) {
                bodies.push(body.clone());
            }
            None::<()>
        });
        for body in bodies.iter() {
            self.awaited.remove(&body.body.id);
        }
        self.events.touches.clear();
        self.events.touches.extend(heard.touches.into_iter().map(|(_, touch)| touch));
        self.events.forces.clear();
        self.events.forces.extend(heard.forces.into_iter().map(|(_, force)| force));
        self.handovers = heard.handovers;
        self.changes.clear();
        self.changes.extend(heard.appeared.into_iter().map(Change::Appeared));
        self.changes.extend(heard.disappeared.into_iter().map(Change::Removed));
        for (id, reason) in heard.refusals {
            let user_data = id.and_then(|id| self.user_data(id)).unwrap_or(0);
            // Nothing else is asked of an avatar before it is there.
            id.and_then(|id| self.awaited.remove(&id));
            self.changes.push(Change::Refused(id, reason, user_data));
        }
    }

    fn send_wishes(&mut self) -> Result<(), ProcessError> {
        let (waiting, due): (BTreeMap<_, _>, BTreeMap<_, _>) =
            std::mem::take(&mut self.wishes).into_iter().partition(|(id, _)| self.awaited.contains_key(id));
        self.wishes = waiting;
        for (id, wish) in due {
            let Some(body) = self.heard(id) else { continue };
            let kinematic = body.body.traits.kind != BodyKind::Dynamic;
            let now = body.body.state.velocity;
            let driven = if kinematic { self.driven.get(&id).copied() } else { None };
            let velocity = wish.velocity.or(driven).unwrap_or(now);
            self.driven.insert(id, velocity);
            self.world.drive(id, velocity, wish.pose)?;
        }
        Ok(())
    }

    pub(crate) fn spawn(
        &mut self,
        pose: WorldPose,
        body: &RigidBodyBuilder,
        collider: ColliderBuilder,
    ) -> Result<BodyId, Failure> {
        let refused = match body.body_type {
            RigidBodyType::Fixed => {
                Some(("make fixed bodies", "give the scene the fixed body, or make a kinematic one"))
            }
            RigidBodyType::KinematicPositionBased => {
                Some(("make bodies that follow poses", "make a DCD_KINEMATIC one and give it velocities"))
            }
            _ => None,
        };
        if let Some((what, instead)) = refused {
            return Err(self.unsupported(what, instead));
        }
        self.check_link()?;
        let colliders = [collider];
        let id = self.world.spawn(pose, body, &colliders)?;
        self.awaited.insert(id, ShapeLibrary::default().describe(id, pose, body, &colliders)?);
        Ok(id)
    }

    pub(crate) fn despawn(&mut self, id: BodyId) -> Result<(), Failure> {
        self.check_own(id, "destroy bodies of others")?;
        self.world.despawn(id)?;
        self.leaving.insert(id, self.user_data(id).unwrap_or(0));
        self.awaited.remove(&id);
        self.wishes.remove(&id);
        self.driven.remove(&id);
        if let Ok(place) = self.place(id) {
            self.bodies.remove(place);
        }
        Ok(())
    }

    pub(crate) fn drive(&mut self, id: BodyId, velocity: Velocity) -> Result<(), Failure> {
        self.check_own(id, "drive bodies of others")?;
        self.wishes.entry(id).or_default().velocity = Some(velocity);
        if let Some(awaited) = self.awaited.get_mut(&id) {
            awaited.state.velocity = velocity;
        }
        Ok(())
    }

    pub(crate) fn jump(&mut self, id: BodyId, pose: WorldPose) -> Result<(), Failure> {
        self.check_own(id, "move bodies of others")?;
        self.wishes.entry(id).or_default().pose = Some(pose);
        if let Some(awaited) = self.awaited.get_mut(&id) {
            awaited.state.pose = pose;
        }
        Ok(())
    }

    fn check_own(&self, id: BodyId, what: &str) -> Result<(), Failure> {
        if id.client() == Some(self.world.id()) {
            return self.check_link();
        }
        Err(self.unsupported(what, "it has its own avatars (dcd_own_avatars) to meet them with"))
    }

    /// What this role cannot do, and what to do instead.
    pub(crate) fn unsupported(&self, what: &str, instead: &str) -> Failure {
        let role = if self.is_participant() { "participant" } else { "client" };
        Failure::new(DCD_ERR_UNSUPPORTED, format!("a {role} cannot {what}: {instead}"))
    }

    fn place(&self, id: BodyId) -> Result<usize, usize> {
        self.bodies.binary_search_by_key(&id, |body| body.body.id)
    }

    fn heard(&self, id: BodyId) -> Option<&Heard> {
        self.place(id).ok().map(|place| &self.bodies[place])
    }

    pub(crate) fn contains(&self, id: BodyId) -> bool {
        self.place(id).is_ok() || self.awaited.contains_key(&id)
    }

    /// A body as last heard of, or as asked for.
    fn known(&self, id: BodyId) -> Option<&BodyRecord> {
        self.awaited.get(&id).or_else(|| self.heard(id).map(|heard| &heard.body))
    }

    pub(crate) fn record(&self, id: BodyId) -> Option<BodyRecord> {
        self.known(id).cloned()
    }

    pub(crate) fn body(&self, id: BodyId) -> Option<BodyView> {
        let BodyRecord { state, traits, .. } = self.known(id)?;
        let owner = traits.kind != BodyKind::Fixed && !self.awaited.contains_key(&id);
        Some(BodyView {
            pose: state.pose,
            velocity: state.velocity,
            kind: type_of(traits.kind),
            sleeping: state.sleeping,
            mass_kg: 0.0,
            user_data: traits.user_data as u64,
            owner: self.heard(id).filter(|_| owner).map(|heard| self.owner_of(heard)),
            outside: self.heard(id).is_some_and(|heard| heard.outside),
        })
    }

    pub(crate) fn owner(&self, id: BodyId) -> OwnerView {
        let region = self.body(id).and_then(|body| body.owner);
        let node = region.and_then(|region| self.world.computed_by(region));
        let here = node.is_some() && node == self.world.node();
        let by_place = region.is_some() && self.heard(id).is_some_and(|heard| heard.owner.is_none());
        OwnerView { region, node, by_place, holders: 0, here, heard: true }
    }

    pub(crate) fn user_data(&self, id: BodyId) -> Option<u64> {
        let known = self.known(id).map(|body| body.traits.user_data as u64);
        known.or_else(|| self.departed.get(&id).copied())
    }

    /// Until its owner is told, a body is taken for one of the region that it is in.
    fn owner_of(&self, heard: &Heard) -> RegionId {
        heard.owner.unwrap_or_else(|| self.environment.tree.leaf_at(heard.body.state.pose.translation))
    }

    fn movable_bodies(&self) -> impl Iterator<Item = &Heard> {
        self.bodies.iter().filter(|body| body.body.traits.kind != BodyKind::Fixed)
    }

    pub(crate) fn movable(&self) -> usize {
        self.movable_bodies().count()
    }

    pub(crate) fn states(&self) -> impl Iterator<Item = StateRow> {
        self.movable_bodies().map(|heard| StateRow {
            id: heard.body.id,
            region: self.owner_of(heard),
            pose: heard.body.state.pose,
            velocity: heard.body.state.velocity,
            user_data: heard.body.traits.user_data as u64,
            sleeping: heard.body.state.sleeping,
            outside: heard.outside,
        })
    }

    /// Asks the nodes; the answer comes under this number.
    pub(crate) fn submit(&mut self, question: Question) -> Result<u64, Failure> {
        self.check_link()?;
        self.questions += 1;
        self.world.ask(Question { number: self.questions, ..question })?;
        Ok(self.questions)
    }

    /// The answer, once it has come.
    pub(crate) fn answer(&self, number: u64) -> Result<Option<Found>, Failure> {
        match self.world.take_answer(number) {
            None => self.check_link().map(|()| None),
            answer => Ok(answer),
        }
    }

    pub(crate) fn forget(&self, number: u64) {
        // Who is gone has nothing to forget.
        let _ = self.world.forget(number);
    }

    pub(crate) fn turn_to(&self, area: Option<Area>) -> Result<(), Failure> {
        self.check_link()?;
        Ok(self.world.turn_to(area)?)
    }

    /// Avatars of this client that are in the world or on their way, in id order.
    pub(crate) fn own_avatars(&self) -> Vec<BodyId> {
        let own = |id: &BodyId| id.client() == Some(self.world.id());
        let mut ids: Vec<_> = self.bodies.iter().map(|body| body.body.id).filter(own).collect();
        ids.extend(self.awaited.keys());
        ids.sort_unstable();
        ids
    }

    pub(crate) fn events(&self) -> &WorldEvents {
        &self.events
    }

    pub(crate) fn handovers(&self) -> &[Handover] {
        &self.handovers
    }

    pub(crate) fn changes(&self) -> &[Change] {
        &self.changes
    }

    pub(crate) fn updates(&self) -> u64 {
        self.world.updates()
    }

    pub(crate) fn traffic(&self) -> PeerStats {
        self.world.traffic()
    }

    pub(crate) fn stats(&self) -> Stats {
        Stats { ticks: self.tick, bodies: self.movable(), last_step: self.last_step, ..Stats::default() }
    }

    pub(crate) fn regions(&self) -> Vec<RegionView> {
        let mut owned = BTreeMap::<RegionId, usize>::new();
        for body in self.movable_bodies() {
            *owned.entry(self.owner_of(body)).or_default() += 1;
        }
        let tree = &self.environment.tree;
        tree.leaves()
            .map(|id| {
                let cell = tree.cell(id);
                let owned = owned.get(&id).copied().unwrap_or(0);
                let node = self.world.computed_by(id);
                RegionView { id, node, owned, replicas: 0, min: cell.min, max: cell.max }
            })
            .collect()
    }
}
