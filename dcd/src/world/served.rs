//! Implements [`World`](super::World) for clients, builders and participants: the states received up to the
//! last step, and the inputs made since.
//!
//! Between two steps only the caller changes anything, as in a local world. Each step copies what the client
//! received since the last one, and sends the inputs of avatars and what a builder did.

mod avatars;
mod inputs;

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::time::{Duration, Instant};

use rapier3d::prelude::*;

use self::inputs::PendingInput;
use super::author::{Author, Names, refused};
use super::bodies::{CHANGE_BODY, CHANGE_SURFACE};
use super::error::Error;
use super::heard;
use super::network::Network;
use super::remote::{Remote, check_vehicle};
use super::role::{Instead, Role};
use super::seen::Seen;
use super::view::{Body, BodyChange, MovableBody, Owner, RegionInfo};
use crate::cluster::{BodyView as Heard, Departed};
use crate::net::PeerStats;
use crate::physics::StepSettings;
use crate::playback::{Motion, ViewTime};
use crate::prediction::Prediction;
use crate::protocol::{
    Area, BodyKind, BodyRecord, Check, Controller, Drive, EnvironmentProperties, Handover, JointRecord, Push,
    Query, QueryResult, Refusal, ShapeHash, ShapeRecord, Velocity, WorldEvents, WorldPose,
};
use crate::runtime::{ClientWorld, Presence, ProcessError, Stats, WorldError};
use crate::space::{BodyId, ClientId, DistributionTree, JointId, RegionId, Tick};

/// The most bodies of earlier steps whose user data is remembered once they are removed.
const DEPARTED: usize = 4_096;

/// The world of a client, builder or participant.
pub(super) struct Served {
    world: ClientWorld,
    network: Network,
    /// What a builder does to what is the world's own; `None` for other clients.
    author: Option<Author>,
    /// How often the world was replaced by another.
    replacements: u64,
    environment: EnvironmentProperties,
    /// The bodies as received up to the last step.
    bodies: BTreeMap<BodyId, Heard>,
    /// Avatars that were inserted here and are not in the world yet.
    awaited: BTreeMap<BodyId, BodyRecord>,
    /// The inputs of avatars since the last step.
    inputs: BTreeMap<BodyId, PendingInput>,
    /// The newest velocity set on each kinematic avatar, which the world reports back some ticks later.
    driven: BTreeMap<BodyId, Velocity>,
    /// Avatars that were removed here and are still in the world, with their user data.
    leaving: BTreeMap<BodyId, u128>,
    /// Bodies that were removed: ends of contacts still name them.
    departed: Departed,
    events: WorldEvents,
    handovers: Vec<Handover>,
    changes: Vec<BodyChange>,
    /// The number of queries submitted.
    questions: u64,
    tick: Tick,
    last_step: Duration,
    /// Why the world is lost; every later step returns this error.
    lost: Option<ProcessError>,
}

impl Served {
    pub(super) fn new(world: ClientWorld) -> Result<Self, Error> {
        let environment = world.environment().ok_or(ProcessError::Stopped)?;
        let author = world.may_build().then(|| {
            let (body, joint) = world.next_built();
            let limit_m_s = environment.step.speed_limit_m_s;
            Author::new(Names::Builder(world.id()), (body, joint.into()), limit_m_s)
        });
        let mut served = Self {
            author,
            replacements: 0,
            network: Network::new(world.connections().clone()),
            world,
            environment,
            bodies: BTreeMap::new(),
            awaited: BTreeMap::new(),
            inputs: BTreeMap::new(),
            driven: BTreeMap::new(),
            leaving: BTreeMap::new(),
            departed: Departed::default(),
            events: WorldEvents::default(),
            handovers: Vec::new(),
            changes: Vec::new(),
            questions: 0,
            tick: Tick(0),
            last_step: Duration::ZERO,
            lost: None,
        };
        served.listen();
        Ok(served)
    }

    /// Returns an error if the link to the world is lost, so that nothing can be asked of it.
    fn check_link(&self) -> Result<(), Error> {
        match &self.lost {
            None => Ok(()),
            Some(ProcessError::Fault) => Err(ProcessError::Fault.into()),
            Some(why) => Err(Error::Lost(why.to_string())),
        }
    }

    fn listen(&mut self) {
        // The regions of a served world may follow its load.
        if let Some(tree) = self.world.tree() {
            self.environment.tree = tree;
        }
        let heard = self.world.take_events();
        let replacements = self.world.replacements();
        if std::mem::replace(&mut self.replacements, replacements) != replacements {
            let (body, joint) = self.world.next_built();
            self.author.iter_mut().for_each(|author| author.begin_anew((body, joint.into())));
        }
        // Before those that go in this step, all of which are remembered until the next.
        self.departed.trim(DEPARTED);
        // Bodies to copy anew although nothing was told of them, since they are not leaving any more.
        let mut again = BTreeSet::new();
        self.changes.clear();
        for change in heard.changes {
            self.changes.push(match change {
                Presence::Appeared(id) => BodyChange::Appeared(id),
                Presence::Disappeared(body) => {
                    let user_data = self.user_data(body).unwrap_or(0);
                    self.departed.insert(body, user_data);
                    again.extend(self.leaving.remove(&body).map(|_| body));
                    self.driven.remove(&body);
                    BodyChange::Removed { body, user_data }
                }
            });
        }
        // These are the reasons for which a removal is refused. Inputs made before it are refused for other
        // reasons, too.
        for (id, why) in &heard.refusals {
            if let (Some(id), Refusal::NotYours | Refusal::Unknown) = (id, why) {
                again.extend(self.leaving.remove(id).map(|_| *id));
            }
        }
        // The tick is read before the bodies, since what arrives in between is of a later tick.
        self.tick = self.tick.max(self.world.tick());
        let (bodies, leaving) = (&mut self.bodies, &self.leaving);
        let copied = self
            .world
            .with_client(|client| heard::follow(bodies, client, again, |id| leaving.contains_key(&id)));
        for body in copied.iter().flatten().filter_map(|id| self.bodies.get(id)) {
            self.tick = self.tick.max(body.tick);
            self.awaited.remove(&body.body.id);
        }
        self.events.touches.clear();
        self.events.touches.extend(heard.touches.into_iter().map(|(_, touch)| touch));
        self.events.forces.clear();
        self.events.forces.extend(heard.forces.into_iter().map(|(_, force)| force));
        self.handovers = heard.handovers;
        for (body, why) in heard.refusals {
            let user_data = body.and_then(|id| self.user_data(id)).unwrap_or(0);
            // An avatar gets no other input before it is in the world: the refused input was its insertion.
            if let Some(id) = body.filter(|id| self.awaited.remove(id).is_some()) {
                self.inputs.remove(&id);
            }
            self.author.iter_mut().for_each(|author| author.refused(body));
            self.changes.push(BodyChange::Refused { body, why, user_data });
        }
    }

    fn seen(&self) -> Seen<'_> {
        Seen { bodies: &self.bodies, world: &self.world, environment: &self.environment }
    }

    /// Returns the author that changes what is the world's own, and what it has heard; or an error if this
    /// client may not build, or the body is an avatar.
    fn builder(
        &mut self,
        id: Option<BodyId>,
        what: &'static str,
        instead: Instead,
    ) -> Result<(&mut Author, Seen<'_>), Error> {
        self.check_link()?;
        let refused = self.unsupported(what, instead);
        let Self { author, bodies, world, environment, .. } = self;
        match author {
            Some(author) if id.is_none_or(|id| id.client().is_none()) => {
                Ok((author, Seen { bodies, world, environment }))
            }
            _ => Err(refused),
        }
    }

    /// Returns an error unless this client is a builder.
    fn builds(&self, what: &'static str, instead: Instead) -> Result<(), Error> {
        if self.author.is_some() { Ok(()) } else { Err(self.unsupported(what, instead)) }
    }

    fn is_own(&self, id: BodyId) -> bool {
        id.client() == Some(self.world.id())
    }

    fn send_built(&mut self) -> Result<(), ProcessError> {
        let Self { author: Some(author), bodies, world, environment, .. } = self else { return Ok(()) };
        let ops = author.take(&Seen { bodies, world, environment });
        if ops.is_empty() { Ok(()) } else { world.build(ops) }
    }

    fn heard(&self, id: BodyId) -> Option<&Heard> {
        self.bodies.get(&id)
    }

    /// Returns a body as last received, or as inserted if it is not in the world yet. A body that a builder
    /// may change is returned as it will be after the changes.
    fn known(&self, id: BodyId) -> Option<Cow<'_, BodyRecord>> {
        match &self.author {
            Some(author) if id.client().is_none() => author.known(&self.seen(), id).map(Cow::Owned),
            _ => {
                let known = self.awaited.get(&id).or_else(|| self.heard(id).map(|heard| &heard.body));
                known.map(Cow::Borrowed)
            }
        }
    }

    fn is_there(&self, heard: &Heard) -> bool {
        !self.author.as_ref().is_some_and(|author| author.is_leaving(heard.body.id))
    }

    /// Returns the owner of a body, or the region in which the body lies until the owner is known.
    fn owner_of(&self, heard: &Heard) -> RegionId {
        heard.owner.unwrap_or_else(|| self.environment.tree.leaf_at(heard.body.state.pose.translation))
    }

    fn heard_movable(&self) -> impl Iterator<Item = &Heard> {
        self.bodies.values().filter(|body| body.body.traits.kind != BodyKind::Fixed && self.is_there(body))
    }
}

impl Remote for Served {
    fn role(&self) -> Role {
        match (self.world.node(), &self.author) {
            (Some(_), _) => Role::Participant,
            (None, Some(_)) => Role::Builder,
            (None, None) => Role::Client,
        }
    }

    fn client(&self) -> Option<ClientId> {
        Some(self.world.id())
    }

    fn network(&self) -> &Network {
        &self.network
    }

    fn metrics_address(&self) -> Option<std::net::SocketAddr> {
        self.world.metrics_address()
    }

    fn tick(&self) -> Tick {
        self.tick
    }

    fn dt_s(&self) -> f32 {
        self.environment.step.dt_s
    }

    fn gravity(&self) -> [f32; 3] {
        self.environment.step.gravity
    }

    fn speed_limit_m_s(&self) -> f32 {
        self.environment.step.speed_limit_m_s
    }

    fn settings(&self) -> Result<StepSettings, Error> {
        Ok(self.environment.step.into())
    }

    fn sees(&self, _what: &'static str) -> Result<(), Error> {
        Ok(())
    }

    fn compute(&self, what: &'static str, instead: Instead) -> Error {
        self.unsupported(what, instead)
    }

    fn step(&mut self) -> Result<(), Error> {
        let start = Instant::now();
        if self.lost.is_none() {
            // Whatever ended the link, the user needs to know that the world goes on without this process.
            let sent = self.world.check().and_then(|()| self.send_inputs()).and_then(|()| self.send_built());
            self.lost = sent.err();
        }
        self.listen();
        self.network.listen();
        self.last_step = start.elapsed();
        self.check_link()
    }

    fn poll(&self, timeout: Duration) -> bool {
        self.network.poll(timeout)
    }

    fn is_lost(&self) -> bool {
        self.lost.is_some()
    }

    fn insert(
        &mut self,
        pose: WorldPose,
        body: &RigidBody,
        colliders: &[ColliderBuilder],
        controller: Option<Controller<'_>>,
    ) -> Result<BodyId, Error> {
        // Characters and vehicles are avatars, as those of any client. All else that a builder inserts is the
        // world's own.
        if controller.is_none() && self.author.is_some() {
            let (author, _) = self.builder(None, "make bodies", Instead::MakeAvatars)?;
            return author.insert(pose, body, colliders, None);
        }
        let awaited = self.next_avatar(pose, body, colliders, controller)?;
        let id = self.world.spawn_as(controller, pose, body, colliders)?;
        self.awaited.insert(id, BodyRecord { id, ..awaited });
        Ok(id)
    }

    fn can_insert(
        &self,
        pose: WorldPose,
        body: &RigidBody,
        colliders: &[ColliderBuilder],
    ) -> Result<(), Error> {
        // What a builder inserts is sent with the next step, and can be taken back before.
        match self.author {
            Some(_) => Ok(()),
            None => self.next_avatar(pose, body, colliders, None).map(drop),
        }
    }

    fn take_back(&mut self, bodies: &[BodyId]) -> Result<(), Error> {
        match &mut self.author {
            Some(author) => author.take_back(bodies),
            None => bodies.iter().try_for_each(|&id| self.remove(id))?,
        }
        Ok(())
    }

    fn can_remove(&self, id: BodyId) -> Result<(), Error> {
        self.check_link()?;
        match self.is_own(id) || self.author.is_some() && id.client().is_none() {
            true => Ok(()),
            false => Err(self.unsupported("destroy bodies of others", Instead::MakeAvatars)),
        }
    }

    fn remove(&mut self, id: BodyId) -> Result<(), Error> {
        if !self.is_own(id) {
            let (author, seen) = self.builder(Some(id), "destroy bodies of others", Instead::MakeAvatars)?;
            return author.remove(&seen, id);
        }
        self.check_link()?;
        let known = self.known(id).filter(|_| !self.leaving.contains_key(&id));
        let user_data = known.map(|body| body.user_data).ok_or(WorldError::NoBody(id))?;
        self.world.despawn(id)?;
        self.leaving.insert(id, user_data);
        self.awaited.remove(&id);
        self.inputs.remove(&id);
        self.driven.remove(&id);
        self.bodies.remove(&id);
        Ok(())
    }

    fn set_velocity(&mut self, id: BodyId, velocity: Velocity) -> Result<(), Error> {
        if !self.is_own(id) {
            let (author, seen) = self.builder(Some(id), "drive bodies of others", Instead::MakeAvatars)?;
            return author.set_velocity(&seen, id, velocity);
        }
        self.check_link()?;
        velocity.check().map_err(refused)?;
        self.check_speed(id, velocity)?;
        self.inputs.entry(id).or_default().velocity = Some(velocity);
        if let Some(awaited) = self.awaited.get_mut(&id) {
            awaited.steer(velocity);
        }
        Ok(())
    }

    fn drive(&mut self, id: BodyId, drive: Drive) -> Result<(), Error> {
        if !self.is_own(id) {
            let (author, seen) = self.builder(Some(id), "drive bodies of others", Instead::MakeAvatars)?;
            return author.drive(&seen, id, drive);
        }
        self.check_link()?;
        drive.check().map_err(refused)?;
        check_vehicle(id, self.known(id).as_deref())?;
        self.inputs.entry(id).or_default().drive = Some(drive);
        if let Some(awaited) = self.awaited.get_mut(&id) {
            awaited.state.drive = Some(drive);
        }
        Ok(())
    }

    fn set_pose(&mut self, id: BodyId, pose: WorldPose) -> Result<(), Error> {
        if !self.is_own(id) {
            let (author, seen) = self.builder(Some(id), "move bodies of others", Instead::MakeAvatars)?;
            return author.set_pose(&seen, id, pose);
        }
        self.check_link()?;
        pose.check().map_err(refused)?;
        if self.known(id).is_some_and(|body| body.traits.character.is_some()) {
            return Err(self.unsupported("put its characters elsewhere", Instead::Walk));
        }
        self.inputs.entry(id).or_default().pose = Some(pose);
        if let Some(awaited) = self.awaited.get_mut(&id) {
            awaited.state.pose = pose;
        }
        Ok(())
    }

    fn pushes_bodies(&self) -> Result<(), Error> {
        self.builds("push bodies by force", Instead::PushByAvatars)
    }

    fn push(&mut self, push: &Push) -> Result<(), Error> {
        let (author, seen) = self.builder(Some(push.body), "push bodies by force", Instead::PushByAvatars)?;
        author.push(&seen, push)
    }

    fn changes_bodies(&self) -> Result<(), Error> {
        self.builds(CHANGE_BODY, Instead::DriveAvatars)
    }

    fn changes_colliders(&self) -> Result<(), Error> {
        self.builds(CHANGE_SURFACE, Instead::ShapeAtBirth)
    }

    fn update(&mut self, id: BodyId, change: &mut dyn FnMut(&mut RigidBody)) -> Result<(), Error> {
        let (author, seen) = self.builder(Some(id), CHANGE_BODY, Instead::DriveAvatars)?;
        author.update(&seen, id, change)
    }

    fn update_collider(
        &mut self,
        id: BodyId,
        index: usize,
        change: &mut dyn FnMut(&mut Collider),
    ) -> Result<(), Error> {
        let (author, seen) = self.builder(Some(id), CHANGE_SURFACE, Instead::ShapeAtBirth)?;
        author.update_collider(&seen, id, index, change)
    }

    fn ties_bodies(&self) -> Result<(), Error> {
        self.builds("make, see, drive or destroy joints", Instead::JointsInScene)
    }

    fn insert_joint(&mut self, a: BodyId, b: BodyId, joint: &GenericJoint) -> Result<JointId, Error> {
        let (author, seen) = self.builder(None, "make joints", Instead::JointsInScene)?;
        author.insert_joint(&seen, [a, b], joint)
    }

    fn remove_joint(&mut self, id: JointId) -> Result<(), Error> {
        let (author, seen) = self.builder(None, "destroy joints", Instead::JointsInScene)?;
        author.remove_joint(&seen, id)
    }

    fn update_joint(&mut self, id: JointId, change: &mut dyn FnMut(&mut GenericJoint)) -> Result<(), Error> {
        let (author, seen) = self.builder(None, "drive joints", Instead::JointsInScene)?;
        author.update_joint(&seen, id, change)
    }

    fn joint(&self, id: JointId) -> Option<JointRecord> {
        self.author.as_ref()?.joint(&self.seen(), id)
    }

    fn joints_of(&self, body: BodyId) -> Vec<JointId> {
        let joints = self.author.as_ref().map(|author| author.joints_of(&self.seen(), body));
        joints.unwrap_or_default().into_iter().map(|joint| joint.id).collect()
    }

    fn joints(&self) -> Vec<JointRecord> {
        self.author.as_ref().map(|author| author.joints(&self.seen())).unwrap_or_default()
    }

    fn contains(&self, id: BodyId) -> bool {
        self.known(id).is_some()
    }

    fn record(&self, id: BodyId) -> Option<BodyRecord> {
        self.known(id).map(Cow::into_owned)
    }

    fn shape(&self, hash: ShapeHash) -> Option<ShapeRecord> {
        let built = self.author.as_ref().and_then(|author| author.shape(&self.seen(), hash));
        built.or_else(|| self.world.shape(hash))
    }

    fn for_each_fixed(&self, look: &mut dyn FnMut(BodyId, &WorldPose)) {
        let is_fixed = |heard: &&Heard| heard.body.traits.kind == BodyKind::Fixed && self.is_there(heard);
        let fixed = self.bodies.values().filter(is_fixed).map(|heard| &heard.body);
        fixed.for_each(|body| look(body.id, &body.state.pose));
    }

    fn tree(&self) -> Option<DistributionTree> {
        Some(self.environment.tree.clone())
    }

    fn motion(&self, id: BodyId) -> Option<(WorldPose, Velocity)> {
        let state = self.known(id)?.state;
        Some((state.pose, state.velocity))
    }

    fn view_time(&mut self) -> ViewTime {
        let tick = self.tick.0 as f64;
        // Before anything is heard, the shown tick is as far behind as it will be at first.
        let behind = 0.1 / f64::from(self.dt_s()).max(1e-6);
        self.world.view_time().unwrap_or_else(|| ViewTime::new(tick, (tick - behind).max(0.0)))
    }

    fn motion_at(&self, id: BodyId, tick: f64) -> Option<Motion> {
        let known = Motion::of(&self.known(id)?.state);
        Some(self.world.motion_at(id, tick).unwrap_or(known))
    }

    fn movable_bodies_at(&self, time: &ViewTime) -> Box<dyn Iterator<Item = MovableBody> + '_> {
        let bodies: Vec<_> = self.movable_bodies().collect();
        let shown = self.world.motions_at(bodies.iter().map(|body| body.id), time);
        let moved = move |(body, shown): (MovableBody, Option<Motion>)| match shown {
            Some(shown) => body.moved_to(shown),
            None => body,
        };
        Box::new(bodies.into_iter().zip(shown).map(moved))
    }

    fn body(&self, id: BodyId) -> Option<Body> {
        let known = self.known(id)?;
        let BodyRecord { state, traits, user_data, .. } = known.as_ref();
        let is_owned = traits.kind != BodyKind::Fixed && !self.awaited.contains_key(&id);
        Some(Body {
            pose: state.pose,
            velocity: state.velocity,
            kind: traits.kind,
            sleeping: state.sleeping,
            mass_kg: None,
            user_data: *user_data,
            owner: self.heard(id).filter(|_| is_owned).map(|heard| self.owner_of(heard)),
            outside: self.heard(id).is_some_and(|heard| heard.outside),
        })
    }

    fn owner(&self, id: BodyId) -> Owner {
        let region = self.body(id).and_then(|body| body.owner);
        let node = region.and_then(|region| self.world.computed_by(region));
        let here = node.is_some() && node == self.world.node();
        let by_place = region.is_some() && self.heard(id).is_some_and(|heard| heard.owner.is_none());
        Owner { region, node, by_place, holders: 0, here, heard: true }
    }

    fn user_data(&self, id: BodyId) -> Option<u128> {
        let known = self.known(id).map(|body| body.user_data);
        // A builder's author does not know bodies that it has removed.
        let heard = || self.heard(id).map(|heard| heard.body.user_data);
        known.or_else(|| self.leaving.get(&id).copied()).or_else(heard).or_else(|| self.departed.get(id))
    }

    fn movable_count(&self) -> usize {
        self.heard_movable().count()
    }

    fn movable_bodies(&self) -> Box<dyn Iterator<Item = MovableBody> + '_> {
        Box::new(self.heard_movable().map(|heard| MovableBody {
            id: heard.body.id,
            region: self.owner_of(heard),
            pose: heard.body.state.pose,
            velocity: heard.body.state.velocity,
            user_data: heard.body.user_data,
            sleeping: heard.body.state.sleeping,
            outside: heard.outside,
        }))
    }

    fn submit(&mut self, question: Query) -> Result<u64, Error> {
        self.check_link()?;
        let question = Query { number: self.questions + 1, ..question };
        question.check().map_err(refused)?;
        self.questions = question.number;
        self.world.ask(question)?;
        Ok(self.questions)
    }

    fn answer(&mut self, number: u64) -> Result<Option<QueryResult>, Error> {
        match self.world.take_answer(number) {
            None => self.check_link().map(|()| None),
            answer => Ok(answer),
        }
    }

    fn forget(&mut self, number: u64) {
        // If the process has ended, there is nothing to cancel.
        let _ = self.world.forget(number);
    }

    fn set_interest(&mut self, area: Option<Area>) -> Result<(), Error> {
        self.check_link()?;
        area.iter().try_for_each(Area::check).map_err(refused)?;
        Ok(self.world.turn_to(area)?)
    }

    fn set_bandwidth(&mut self, bytes_per_s: Option<u32>) -> Result<(), Error> {
        self.check_link()?;
        Ok(self.world.limit(bytes_per_s)?)
    }

    fn set_prediction(&mut self, predicts: bool) -> Result<(), Error> {
        self.world.set_prediction(predicts);
        Ok(())
    }

    fn prediction(&self) -> Option<Prediction> {
        self.world.prediction()
    }

    fn own_avatars(&self) -> Vec<BodyId> {
        let [first, last] = [0, u32::MAX].map(|index| BodyId::avatar(self.world.id(), index));
        let own = self.bodies.range(first..=last);
        let mut ids: Vec<_> = own.map(|(&id, _)| id).collect();
        ids.extend(self.awaited.keys());
        ids.sort_unstable();
        ids
    }

    fn events(&self) -> &WorldEvents {
        &self.events
    }

    fn handovers(&self) -> &[Handover] {
        &self.handovers
    }

    fn changes(&self) -> &[BodyChange] {
        &self.changes
    }

    fn updates(&self) -> u64 {
        self.world.updates()
    }

    fn traffic(&self) -> PeerStats {
        self.world.traffic()
    }

    fn stats(&self) -> Stats {
        Stats {
            ticks: self.tick.0,
            bodies: self.movable_count(),
            last_step: self.last_step,
            ..Stats::default()
        }
    }

    fn region_count(&self) -> usize {
        self.environment.tree.leaf_count()
    }

    fn regions(&self) -> Vec<RegionInfo> {
        let mut owned = BTreeMap::<RegionId, usize>::new();
        for body in self.heard_movable() {
            *owned.entry(self.owner_of(body)).or_default() += 1;
        }
        let tree = &self.environment.tree;
        let info = |id| RegionInfo {
            id,
            node: self.world.computed_by(id),
            owned: owned.get(&id).copied().unwrap_or(0),
            ghosts: 0,
            cell: tree.cell(id),
        };
        tree.leaves().map(info).collect()
    }
}
