//! Runs a client or participant: joins a served world, sends inputs and queries, and reads the states
//! received.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use rapier3d::prelude::*;
use tracing::warn;

use std::net::SocketAddr;

use super::bandwidth::{Bandwidth, COSTLIEST};
use super::{Connections, Member, MemberConfig, NodeSummary, Presence, ProcessError, metrics};
use crate::cluster::{BodyView, Client, ClientEvent};
use crate::net::{Identity, JoinRole, NetError, PeerStats, Token, check_address, join, renew};
use crate::physics::{ShapeError, ShapeLibrary};
use crate::playback::{Motion, ViewTime};
use crate::prediction::{Prediction, Predictor};
use crate::protocol::{
    Area, BuildOp, ContactForce, Controller, Drive, EnvironmentProperties, Handover, Input, JointRecord,
    Query, QueryResult, Refusal, ShapeHash, ShapeRecord, Touch, Velocity, WorldPose,
};
use crate::recording::Background;
use crate::space::{BodyId, ClientId, DistributionTree, JointId, NodeId, RegionId, Tick};

/// The settings with which a process joins a served world.
#[derive(Clone, Debug)]
pub struct JoinConfig {
    /// The address of the server.
    pub server: SocketAddr,
    /// Addresses of standby servers. All are dialled, and the one that answers is the server. All addresses
    /// must be IPv4, or all IPv6.
    pub standbys: Vec<SocketAddr>,
    /// A token from `dcd token --role client` (or `builder`, `participant`, `node`), which joining uses up. A
    /// node whose `identity` file exists needs none: the token may be empty, or a used one.
    pub token: String,
    /// A file that keeps the process's identity: a later join with it continues with the same avatars.
    pub identity: Option<PathBuf>,
    /// How long to wait for the server and the world when joining.
    pub timeout: Duration,
    /// The longest time that the server may be out of reach after joining before the process gives up. It counts
    /// from when that was noticed: a client does so 10 to 14 s after it last heard of a server that was killed,
    /// or 2 to 3 s where it has several addresses. Meanwhile the process dials again and again. `None` means 30 s
    /// for a client. A node or participant then waits without end, since the world is at those that compute it
    /// until a server is back.
    pub give_up: Option<Duration>,
    /// The area of interest at first. The process is sent the bodies in the area, the scenery that reaches
    /// into it, and their shapes and joints; later it is sent what comes there, or lies where the area is
    /// moved to. `None`: it is sent the whole world, whatever its interest is later.
    pub interest: Option<Area>,
    /// The number of regions that a participant or node steps at the same time.
    pub threads: usize,
    /// The address on which a participant or node listens for other nodes and for clients; `None`: any free
    /// port, on the interface that leads to the server.
    pub listen: Option<SocketAddr>,
    /// The address that others are told, if it is not the one listened on.
    pub advertise: Option<SocketAddr>,
    /// A file to which a participant's or node's part of the world is recorded: all that the process is
    /// given, and a digest of each region after each tick. `dcd replay` computes the part again from that,
    /// bit for bit.
    pub record: Option<PathBuf>,
    /// An address at which a participant or node answers over HTTP with its metrics (`/metrics`, in
    /// Prometheus' format) and its health (`/healthz`, `/readyz`). Everyone who reaches the address may read
    /// that.
    pub metrics: Option<SocketAddr>,
}

/// Returns whether a kept identity can be renewed without a token. Only a node's can, since supervisors start
/// nodes again. A client that a server sent away comes back by a new token only.
fn renews(former: &Identity, role: JoinRole) -> bool {
    (former.role(), role) == (JoinRole::Node, JoinRole::Node)
}

impl JoinConfig {
    /// Returns the default settings: no identity file, ten seconds to join, one thread, any port.
    #[must_use]
    pub fn new(server: SocketAddr, token: impl Into<String>) -> Self {
        Self {
            server,
            standbys: Vec::new(),
            token: token.into(),
            identity: None,
            timeout: Duration::from_secs(10),
            interest: None,
            give_up: None,
            threads: 1,
            listen: None,
            advertise: None,
            record: None,
            metrics: None,
        }
    }

    /// Trades the token for an identity of this role. The identity that a node has kept is renewed, without a
    /// token.
    #[doc(hidden)]
    pub fn join(&self, role: JoinRole) -> Result<Identity, ProcessError> {
        // Checked before the token is used up.
        if let Some(path) = &self.record {
            Background::check(path).map_err(|cause| ProcessError::Record { path: path.clone(), cause })?;
        }
        if matches!(role, JoinRole::Node | JoinRole::Participant) {
            self.listen.map_or(Ok(()), check_address)?;
            self.metrics.map_or(Ok(()), metrics::check)?;
        }
        self.identity.as_deref().map_or(Ok(()), Identity::check_place)?;
        let former = match &self.identity {
            Some(path) if path.exists() => Some(Identity::load(path)?),
            _ => None,
        };
        let identity = match &former {
            Some(former) if renews(former, role) && self.token.trim().is_empty() => {
                renew(&self.servers(), former, self.timeout)?
            }
            _ => self.admitted(role, former.as_ref())?,
        };
        if let Some(path) = &self.identity {
            identity.save(path)?;
        }
        Ok(identity)
    }

    /// Returns all addresses at which the server may be.
    pub(super) fn servers(&self) -> Vec<SocketAddr> {
        [&[self.server], &self.standbys[..]].concat()
    }

    fn admitted(&self, role: JoinRole, former: Option<&Identity>) -> Result<Identity, ProcessError> {
        let token: Token = self.token.trim().parse()?;
        token.require(role)?;
        if let Some(former) = former.filter(|former| renews(former, role) && former.is_of_server_of(&token)) {
            match renew(&self.servers(), former, self.timeout) {
                // A server that does not know the identity may still take the token.
                Err(NetError::Refused { .. }) => {}
                renewed => return Ok(renewed?),
            }
        }
        let resume = former.and_then(Identity::resume);
        Ok(join(&self.servers(), &token, resume, self.timeout)?)
    }
}

/// The events that a client received since they were last taken.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ClientEvents {
    /// Contacts of own avatars that began or ended, with their tick.
    pub touches: Vec<(Tick, Touch)>,
    /// Forces on own avatars above their thresholds, with their tick.
    pub forces: Vec<(Tick, ContactForce)>,
    /// Bodies whose change of owner became known.
    pub handovers: Vec<Handover>,
    /// Bodies that appeared or disappeared, in the order heard. A body that went and came again is there.
    pub changes: Vec<Presence>,
    /// Inputs that were refused, with the body concerned, if any.
    pub refusals: Vec<(Option<BodyId>, Refusal)>,
}

/// The client side of a world that nodes compute. Its methods do not wait for the network unless they say so.
pub struct ClientWorld {
    member: Member,
    client: ClientId,
    may_build: bool,
    next_avatar: u32,
    shapes: ShapeLibrary,
    predicts: bool,
    /// The predictor of own avatars; `None` until the user shows the world.
    predictor: Option<Box<Predictor>>,
}

impl ClientWorld {
    /// Joins as a client, and waits until the server has sent the whole world as it has it on record, or the
    /// area of interest to begin with. The world need not have nodes yet: it stands still until it has.
    pub fn connect(config: &JoinConfig) -> Result<Self, ProcessError> {
        Self::enter(config, JoinRole::Client)
    }

    /// Joins as a participant, client and node in one process: the process also computes regions of the
    /// world.
    pub fn participate(config: &JoinConfig) -> Result<Self, ProcessError> {
        Self::enter(config, JoinRole::Participant)
    }

    fn enter(config: &JoinConfig, role: JoinRole) -> Result<Self, ProcessError> {
        let start = Instant::now();
        let identity = config.join(role)?;
        let client = identity.client().ok_or(ProcessError::Role { has: identity.role(), needs: role })?;
        let may_build = identity.role() == JoinRole::Builder;
        let usual = MemberConfig::new(config.server, identity);
        let member = Member::start(MemberConfig {
            standbys: config.standbys.clone(),
            threads: config.threads,
            give_up: config.give_up.or(usual.give_up),
            listen: config.listen,
            advertise: config.advertise,
            record: config.record.clone(),
            metrics: config.metrics,
            interest: config.interest,
            ..usual
        })?;
        let left = config.timeout.saturating_sub(start.elapsed());
        let joined = |state: &super::member::State| {
            state.end.is_some() || state.client.as_ref().is_some_and(Client::is_joined)
        };
        if !member.shared.wait(left, joined) {
            return Err(ProcessError::Timeout { server: config.server, waited: config.timeout });
        }
        let shapes = ShapeLibrary::default();
        let world =
            Self { member, client, may_build, next_avatar: 0, shapes, predicts: true, predictor: None };
        world.check()?;
        Ok(world)
    }

    /// Returns this process's id as a client.
    pub fn id(&self) -> ClientId {
        self.client
    }

    /// Returns whether its token allows the client to build: to change what is the world's own.
    pub fn may_build(&self) -> bool {
        self.may_build
    }

    /// Returns the indices of the next body and the next joint that the client may build, as the server said.
    pub(crate) fn next_built(&self) -> (u32, u32) {
        self.member.shared.lock().client.as_ref().map_or((0, 0), Client::next_built)
    }

    /// Changes the world by these operations, in order, if the client may build. Refusals come in
    /// [`ClientEvents::refusals`].
    pub fn build(&self, ops: Vec<BuildOp>) -> Result<(), ProcessError> {
        self.member.submit(ClientEvent::Build(ops))
    }

    /// Returns the number of calls of [`ClientWorld::build`], from the first on, that the server has
    /// answered.
    pub(crate) fn answered_builds(&self) -> u64 {
        self.member.shared.lock().client.as_ref().map_or(0, Client::answered_builds)
    }

    /// Returns how often the world was replaced by another.
    pub(crate) fn replacements(&self) -> u64 {
        self.member.shared.lock().client.as_ref().map_or(0, Client::replacements)
    }

    /// Returns a joint of bodies that the client was told of.
    pub(crate) fn joint(&self, id: JointId) -> Option<JointRecord> {
        self.member.shared.lock().client.as_ref()?.joint(id).cloned()
    }

    /// Returns the joints of all bodies that the client was told of.
    pub(crate) fn joints(&self) -> Vec<JointRecord> {
        self.member.shared.lock().client.iter().flat_map(Client::joints).cloned().collect()
    }

    /// Returns the joints of a body.
    pub(crate) fn joints_of(&self, body: BodyId) -> Vec<JointRecord> {
        let state = self.member.shared.lock();
        state.client.iter().flat_map(|client| client.joints_of(body)).cloned().collect()
    }

    /// Returns this process's id as a node, for a participant.
    pub fn node(&self) -> Option<NodeId> {
        self.member.who.node()
    }

    /// Returns the relay that tells the client the states of bodies in the leader's place, if there is one.
    #[doc(hidden)]
    pub fn told_by(&self) -> Option<NodeId> {
        self.member.shared.lock().client.as_ref().and_then(Client::told_by)
    }

    /// Returns how the world is cut into regions, as the server last said.
    pub fn tree(&self) -> Option<DistributionTree> {
        self.member.shared.lock().client.as_ref()?.tree().cloned()
    }

    /// Returns the node that computes a region, if known: as the server or the leader last said.
    pub fn computed_by(&self, region: RegionId) -> Option<NodeId> {
        self.member.shared.lock().client.as_ref()?.computed_by(region)
    }

    /// Returns the address at which a participant's node listens.
    pub fn address(&self) -> Option<SocketAddr> {
        self.node().map(|_| self.member.address)
    }

    /// Returns the address of the metrics endpoint of a participant's node, if it has one.
    pub fn metrics_address(&self) -> Option<SocketAddr> {
        self.member.metrics_address()
    }

    /// Returns the connections of this process.
    pub fn connections(&self) -> &Connections {
        self.member.connections()
    }

    /// Returns an error once the server has been out of reach for too long, or the world has ended.
    pub fn check(&self) -> Result<(), ProcessError> {
        let mut state = self.member.shared.lock();
        match &state.end {
            None => Ok(()),
            Some(Ok(())) => Err(ProcessError::Stopped),
            // The error is reported in the same words every time.
            Some(Err(error)) => {
                let again = error.again();
                state.end.replace(Err(again)).map_or(Ok(()), |end| end)
            }
        }
    }

    /// Returns the newest tick received. It is some milliseconds old while bodies move, and up to five
    /// seconds of the world's time while all bodies rest.
    pub fn tick(&self) -> Tick {
        self.member.shared.lock().client.as_ref().map_or(Tick(0), Client::tick)
    }

    /// Returns the properties of the world, as the server sent them.
    pub fn environment(&self) -> Option<EnvironmentProperties> {
        self.member.shared.lock().client.as_ref()?.world().cloned()
    }

    /// Inserts an avatar of this client into the world. It appears in [`ClientEvents::changes`] once it is there; a refusal
    /// comes in [`ClientEvents::refusals`].
    pub fn spawn(
        &mut self,
        pose: WorldPose,
        body: &RigidBody,
        colliders: &[ColliderBuilder],
    ) -> Result<BodyId, ProcessError> {
        self.spawn_as(None, pose, body, colliders)
    }

    /// Inserts an avatar, which may be a character or a vehicle. Otherwise it does the same as
    /// [`ClientWorld::spawn`].
    pub fn spawn_as(
        &mut self,
        controller: Option<Controller<'_>>,
        pose: WorldPose,
        body: &RigidBody,
        colliders: &[ColliderBuilder],
    ) -> Result<BodyId, ProcessError> {
        let id = self.next_avatar();
        if self.shapes.has_gained() {
            let known = self.shapes.hashes().filter(|hash| self.has_heard_of(*hash)).collect();
            self.shapes.keep(known);
        }
        let body = self.shapes.describe(id, pose, body, colliders)?.with_controller(controller);
        if !body.suits_clients(|hash| self.shapes.record_of(hash)) {
            return Err(ShapeError::Avatar.into());
        }
        let shapes = self.shapes.records_of([&body]).into_iter().map(|(_, shape)| shape.clone()).collect();
        self.member.submit(ClientEvent::Spawn { body, shapes })?;
        self.next_avatar = id.index() + 1;
        Ok(id)
    }

    /// Returns the id of the next avatar. Avatars of an earlier stay return some time after joining.
    pub(crate) fn next_avatar(&self) -> BodyId {
        let after = self.own_avatars().last().map_or(0, |id| id.index() + 1);
        BodyId::avatar(self.client, self.next_avatar.max(after))
    }

    /// Removes an avatar from the world for good.
    pub fn despawn(&self, avatar: BodyId) -> Result<(), ProcessError> {
        self.member.submit(ClientEvent::Despawn(avatar))
    }

    /// Sends an input for an avatar: a velocity, and with `pose` a new place. The newest input before a tick
    /// counts, together with the last jump before it.
    pub fn send_input(
        &mut self,
        avatar: BodyId,
        velocity: Velocity,
        pose: Option<WorldPose>,
    ) -> Result<(), ProcessError> {
        let tick =
            self.predict(Input { body: avatar, logical_time: 1, tick: Tick(0), velocity, pose, drive: None });
        self.member.submit(ClientEvent::Input { body: avatar, tick, velocity, pose })
    }

    /// Sets what the driver of a vehicle does from now on.
    pub fn drive(&mut self, vehicle: BodyId, drive: Drive) -> Result<(), ProcessError> {
        let (velocity, pose, drives) = (Velocity::default(), None, Some(drive));
        let tick = self.predict(Input {
            body: vehicle,
            logical_time: 1,
            tick: Tick(0),
            velocity,
            pose,
            drive: drives,
        });
        self.member.submit(ClientEvent::Drive { body: vehicle, tick, drive })
    }

    /// Applies an input to the prediction, and returns the tick that the input must name; 0 where nothing is
    /// predicted.
    fn predict(&mut self, input: Input) -> Tick {
        let Some(predictor) = &mut self.predictor else { return Tick(0) };
        let now = self.member.shared.start.elapsed();
        let named = self.member.shared.lock().client.as_mut().and_then(|client| client.name_tick(now));
        named.inspect(|&tick| predictor.input(Input { tick, ..input })).unwrap_or(Tick(0))
    }

    /// Sets whether own avatars, and what they touch, are predicted. At first they are.
    pub fn set_prediction(&mut self, predicts: bool) {
        self.predicts = predicts;
        if !predicts {
            self.predictor = None;
        }
    }

    /// Returns statistics of the prediction; `None` where nothing is predicted.
    pub fn prediction(&self) -> Option<Prediction> {
        self.predictor.as_ref().map(|predictor| predictor.stats())
    }

    /// Sets the area of interest: from now on the client receives the bodies in it and around its own
    /// avatars. `None`: all bodies, as at first. Bodies outside stay as last received, which
    /// [`BodyView::outside`] reports.
    pub fn turn_to(&self, area: Option<Area>) -> Result<(), ProcessError> {
        self.member.submit(ClientEvent::Interest(area))
    }

    /// Limits the bytes per second of states of bodies that this process is sent; `None`: as many as the link
    /// carries.
    pub fn limit(&self, bytes_per_s: Option<u32>) -> Result<(), ProcessError> {
        self.member.submit(ClientEvent::Bandwidth(bytes_per_s.map_or(0, |limit| limit.max(1))))
    }

    /// Returns what this process was sent since it joined, and for what, as of a tenth of a second ago.
    pub fn bandwidth(&self) -> Bandwidth {
        let state = self.member.shared.lock();
        let mut bandwidth = Bandwidth {
            udp_bytes: state.traffic.udp_bytes_in,
            messages: state.received,
            ..Bandwidth::default()
        };
        if let Some(client) = &state.client {
            bandwidth.states = *client.tally();
            bandwidth.bodies = client.costliest(COSTLIEST);
        }
        bandwidth
    }

    /// Sends a query for rays or shapes to the processes that compute the world. [`ClientWorld::take_answer`]
    /// returns the answer, which comes some ticks later. Its `number` must differ from those of other
    /// queries.
    pub fn ask(&self, question: Query) -> Result<(), ProcessError> {
        self.member.submit(ClientEvent::Ask(question))
    }

    /// Cancels a query: its answer is dropped.
    pub fn forget(&self, number: u64) -> Result<(), ProcessError> {
        self.member.submit(ClientEvent::Forget(number))
    }

    /// Takes the answer to a query, if it has come. Each answer is given once.
    pub fn take_answer(&self, number: u64) -> Option<QueryResult> {
        self.member.shared.lock().client.as_mut()?.take_answer(number)
    }

    /// Returns this client's avatars in the world, including those of an earlier stay, in id order.
    pub fn own_avatars(&self) -> Vec<BodyId> {
        let state = self.member.shared.lock();
        state.client.iter().flat_map(|client| client.own_avatars()).map(|body| body.body.id).collect()
    }

    /// Returns a body as last received.
    pub fn body(&self, id: BodyId) -> Option<BodyView> {
        self.member.shared.lock().client.as_ref()?.body(id).cloned()
    }

    /// Returns the shape of a body that is known here.
    pub(crate) fn shape(&self, hash: ShapeHash) -> Option<ShapeRecord> {
        let own = self.shapes.record_of(hash).cloned();
        own.or_else(|| self.member.shared.lock().client.as_ref()?.shapes().get(&hash).cloned())
    }

    /// Returns whether the server has sent a shape.
    pub(crate) fn has_heard_of(&self, hash: ShapeHash) -> bool {
        self.member.shared.lock().client.as_ref().is_some_and(|client| client.shapes().contains_key(&hash))
    }

    /// Calls `look` with the client's state while nothing more can come in.
    pub(crate) fn with_client<R>(&self, look: impl FnOnce(&mut Client) -> R) -> Option<R> {
        self.member.shared.lock().client.as_mut().map(look)
    }

    /// Calls `look` for every body in id order, as last received, and collects the results that are `Some`.
    pub fn with_bodies<R>(&self, mut look: impl FnMut(&BodyView) -> Option<R>) -> Vec<R> {
        let state = self.member.shared.lock();
        state.client.iter().flat_map(|client| client.bodies()).filter_map(&mut look).collect()
    }

    /// Returns the ticks to show now; `None` until anything was heard of the world.
    pub fn view_time(&mut self) -> Option<ViewTime> {
        let now = self.member.shared.start.elapsed();
        let mut state = self.member.shared.lock();
        let client = state.client.as_mut()?;
        let mut time = client.view_time(now)?;
        let predicted = client.predicted_tick(now).filter(|_| self.predicts);
        let world = client.world().filter(|_| predicted.is_some());
        if let (None, Some(world)) = (&self.predictor, world) {
            let predictor = Predictor::new(self.client, world);
            self.predictor =
                predictor.inspect_err(|error| warn!(%error, "nothing is predicted")).ok().map(Box::new);
        }
        if let (Some(predictor), Some(predicted)) = (&mut self.predictor, predicted) {
            predictor.listen(client, predicted);
            // Released first: others wait for the lock.
            drop(state);
            time.predicted = predicted.max(time.now);
            predictor.advance(&time);
        }
        Some(time)
    }

    /// Returns the motion of a body to show at a tick; `None` if the body is not known.
    pub fn motion_at(&self, id: BodyId, tick: f64) -> Option<Motion> {
        let predicted = self.predictor.as_ref().and_then(|predictor| predictor.at(id, tick));
        predicted.or_else(|| self.member.shared.lock().client.as_ref()?.view(id, tick))
    }

    /// Returns the motion of each body to show together with the others: own avatars at the predicted tick,
    /// what they touch between that tick and the shown one, and all else at the shown tick.
    pub fn motions_at(&self, bodies: impl Iterator<Item = BodyId>, time: &ViewTime) -> Vec<Option<Motion>> {
        let state = self.member.shared.lock();
        let shown = |id: BodyId| {
            let predictor = self.predictor.as_ref();
            let ahead = predictor.and_then(|predictor| predictor.tick_of(id, time));
            let is_own = id.client() == Some(self.client);
            let tick = ahead.unwrap_or(if is_own { time.predicted } else { time.shown });
            let predicted = predictor.and_then(|predictor| predictor.at(id, tick));
            predicted.or_else(|| state.client.as_ref()?.view(id, tick))
        };
        bodies.map(shown).collect()
    }

    /// Takes the events since the last call.
    pub fn take_events(&self) -> ClientEvents {
        let mut state = self.member.shared.lock();
        let (touches, forces, handovers) = match &mut state.client {
            Some(client) => (
                client.take_touches().collect(),
                client.take_forces().collect(),
                client.take_handovers().collect(),
            ),
            None => Default::default(),
        };
        ClientEvents {
            touches,
            forces,
            handovers,
            changes: std::mem::take(&mut state.changes).into(),
            refusals: std::mem::take(&mut state.refusals).into(),
        }
    }

    /// Returns the number of state messages received so far.
    pub fn updates(&self) -> u64 {
        self.member.shared.lock().updates
    }

    /// Returns the traffic over all links, as of a tenth of a second ago. Its round trip is that of the
    /// slowest link.
    pub fn traffic(&self) -> PeerStats {
        self.member.shared.lock().traffic
    }

    /// Waits until more than `seen` state messages have come; returns whether they came in time.
    pub fn wait_update(&self, seen: u64, timeout: Duration) -> bool {
        self.member.shared.wait(timeout, |state| state.updates > seen || state.end.is_some())
            && self.updates() > seen
    }

    /// Waits until the body is known here; returns whether it came in time.
    pub fn wait_body(&self, id: BodyId, timeout: Duration) -> bool {
        self.member.shared.wait(timeout, |state| {
            state.end.is_some()
                || !state.refusals.is_empty()
                || state.client.as_ref().is_some_and(|client| client.body(id).is_some())
        }) && self.body(id).is_some()
    }

    /// Returns what a participant's node has done.
    pub fn summary(&self) -> NodeSummary {
        self.member.summary()
    }

    /// Leaves the world in order. The avatars wait at the server for this client's return.
    pub fn leave(self) -> Result<NodeSummary, ProcessError> {
        self.member.leave();
        self.member.finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_tells_no_metrics_needs_no_address_for_them() {
        let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        let metrics = taken.local_addr().ok();
        let config = JoinConfig { metrics, ..JoinConfig::new(([127, 0, 0, 1], 1).into(), "no token") };
        for (role, listens) in [(JoinRole::Client, false), (JoinRole::Builder, false), (JoinRole::Node, true)]
        {
            let refused = config.join(role).unwrap_err();
            assert_eq!(matches!(refused, ProcessError::Metrics { .. }), listens, "{role}: {refused}");
        }
    }

    #[test]
    fn who_is_refused_leaves_no_recording() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("node.dcdr");
        let record = Some(path.clone());
        let config = JoinConfig { record, ..JoinConfig::new(([127, 0, 0, 1], 1).into(), "no token") };
        let refused = config.join(JoinRole::Node).unwrap_err();
        assert!(!matches!(refused, ProcessError::Record { .. }), "{refused}");
        assert!(!path.exists());
    }
}
