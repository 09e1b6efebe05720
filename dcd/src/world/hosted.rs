//! Implements [`World`](super::World) for servers and nodes. A server's program may change the world; what it
//! reads is the server's record, at most half a second old. A node shows nothing of its world.

use std::net::SocketAddr;
use std::time::Duration;

use rapier3d::prelude::*;

use super::author::{Author, Known, Names, refused};
use super::bodies::{CHANGE_BODY, CHANGE_SURFACE};
use super::error::Error;
use super::network::Network;
use super::remote::{Remote, SAVE};
use super::role::{Instead, Role, Unsupported};
use super::view::{Body, MovableBody};
use crate::cluster::{Life, Record};
use crate::fidelity::FidelityReport;
use crate::net::PeerStats;
use crate::physics::StepSettings;
use crate::protocol::{
    BodyRecord, BuildOp, Check, Controller, Drive, JointRecord, Push, Query, QueryResult, ShapeHash,
    ShapeRecord, Velocity, WorldEvents, WorldPose,
};
use crate::runtime::{LocalWorld, Member, ProcessError, SUSPENDED, ServerProcess, Stats};
use crate::space::{BodyId, DistributionTree, JointId, Tick, Viewpoint};

/// The server or node that runs behind the world, on threads of its own.
pub(super) enum Process {
    Server(ServerProcess),
    Node(Member),
}

/// The world of a server or node.
pub(super) struct Hosted {
    process: Process,
    /// What the server's program does to the world; `None` for a node.
    author: Option<Author>,
    network: Network,
    /// The step settings; `None` for a node, which takes them from its server.
    settings: Option<StepSettings>,
    /// The contact events taken in by the last step.
    events: WorldEvents,
    /// The number of queries submitted.
    questions: u64,
    /// Queries that wait for the next step, together with what was done before them.
    waiting: Vec<Query>,
}

impl Hosted {
    pub(super) fn new(process: Process, settings: Option<StepSettings>) -> Self {
        let connections = match &process {
            Process::Server(server) => server.connections(),
            Process::Node(node) => node.connections(),
        };
        let author = match &process {
            Process::Server(server) => {
                Some(Author::new(Names::Program, server.next_ids, server.speed_limit_m_s()))
            }
            Process::Node(_) => None,
        };
        let network = Network::new(connections.clone());
        let events = WorldEvents::default();
        Self { network, author, process, settings, events, questions: 0, waiting: Vec::new() }
    }

    /// Returns the server and its program's author, or the error for a node.
    fn written(&mut self, what: &'static str) -> Result<(&ServerProcess, &mut Author), Error> {
        self.look()?;
        match (&self.process, &mut self.author) {
            (Process::Server(server), Some(author)) => Ok((server, author)),
            _ => Err(Unsupported { role: Role::Node, what, instead: Instead::JoinAsClient }.into()),
        }
    }

    /// Returns the server, or the error that a node cannot do `what`.
    fn server_to(&self, what: &'static str) -> Result<&ServerProcess, Error> {
        match &self.process {
            Process::Server(server) => self.look().map(|()| server),
            Process::Node(_) => Err(self.unsupported(what, Instead::ServerKeeps)),
        }
    }

    fn read(&self) -> Option<(&ServerProcess, &Author)> {
        match (&self.process, &self.author) {
            (Process::Server(server), Some(author)) => Some((server, author)),
            _ => None,
        }
    }

    /// Returns an error if the process has failed or ended.
    fn look(&self) -> Result<(), Error> {
        let over = |why| Err(Error::Lost(format!("{why}; destroy the world, and begin or join another")));
        match &self.process {
            Process::Server(server) => match server.failure() {
                Some(failure) => Err(failure.into()),
                None if server.is_suspended() => over(SUSPENDED.to_owned()),
                None if server.is_over() => over("the world has ended".to_owned()),
                None => Ok(()),
            },
            Process::Node(node) if node.is_faulty() => Err(ProcessError::Fault.into()),
            Process::Node(node) => match node.ended() {
                Some(Some(cause)) => over(cause),
                Some(None) => over("the world has ended, or its server let this node go".to_owned()),
                None => Ok(()),
            },
        }
    }

    /// Sends what a server's program did since the last step, and the queries that wait.
    fn flush(&mut self) {
        let (Process::Server(server), Some(author)) = (&self.process, &mut self.author) else { return };
        let ops = author.take(server);
        // The clone is cheap. Adding a shape while the server still holds the clone copies the library.
        if ops.iter().any(|op| matches!(op, BuildOp::Insert { .. })) {
            server.change_with(ops, author.shapes().clone());
        } else if !ops.is_empty() {
            server.change(ops);
        }
        self.waiting.drain(..).for_each(|question| server.ask(question));
    }
}

/// The server's record.
impl Known for ServerProcess {
    fn knows(&self, id: BodyId) -> bool {
        self.read(|record| record.body(id).is_some())
    }

    fn body(&self, id: BodyId) -> Option<BodyRecord> {
        let is_there = |record: &Record| matches!(record.life(id), Some(Life::Live | Life::Waiting));
        self.read(|record| record.body(id).filter(|_| is_there(record)).cloned())
    }

    fn for_each_body(&self, look: &mut dyn FnMut(&BodyRecord)) {
        self.read(|record| record.present().for_each(look));
    }

    fn shape(&self, hash: ShapeHash) -> Option<ShapeRecord> {
        self.read(|record| record.shape(hash).cloned())
    }

    fn has_shape(&self, hash: ShapeHash) -> bool {
        self.read(|record| record.shape(hash).is_some())
    }

    fn joint(&self, id: JointId) -> Option<JointRecord> {
        self.read(|record| record.joint(id).cloned())
    }

    fn joints(&self) -> Vec<JointRecord> {
        self.read(|record| record.joints().cloned().collect())
    }

    fn joints_of(&self, body: BodyId) -> Vec<JointRecord> {
        self.read(|record| record.joints_of(body).cloned().collect())
    }

    fn tree(&self) -> DistributionTree {
        ServerProcess::tree(self)
    }

    fn answered(&self) -> u64 {
        self.changes_done()
    }
}

impl Remote for Hosted {
    fn role(&self) -> Role {
        match self.process {
            Process::Server(_) => Role::Server,
            Process::Node(_) => Role::Node,
        }
    }

    fn dt_s(&self) -> f32 {
        self.settings.map_or(0.0, |settings| settings.dt_s)
    }

    fn gravity(&self) -> [f32; 3] {
        self.settings.map_or([0.0; 3], |settings| settings.gravity)
    }

    fn settings(&self) -> Result<StepSettings, Error> {
        self.settings.ok_or_else(|| self.unsupported("say how the world is stepped", Instead::JoinAsClient))
    }

    fn speed_limit_m_s(&self) -> f32 {
        match &self.process {
            Process::Server(server) => server.speed_limit_m_s(),
            Process::Node(_) => 0.0,
        }
    }

    fn step(&mut self) -> Result<(), Error> {
        self.network.listen();
        // Events from before the end of the world are reported once, as all others.
        let events = self.server().map(ServerProcess::take_events);
        self.events = events.unwrap_or_default();
        self.look()?;
        self.flush();
        Ok(())
    }

    fn compute(&self, what: &'static str, instead: Instead) -> Error {
        match (&self.process, instead) {
            (Process::Server(_), Instead::SubmitQuery) => self.unsupported(what, instead),
            (Process::Server(_), Instead::PushByAvatars) => self.unsupported(what, Instead::PushFound),
            _ => self.unsupported(what, Instead::ComputeAlone),
        }
    }

    fn sees(&self, what: &'static str) -> Result<(), Error> {
        match self.process {
            Process::Server(_) => Ok(()),
            Process::Node(_) => Err(self.unsupported(what, Instead::JoinAsClient)),
        }
    }

    fn insert(
        &mut self,
        pose: WorldPose,
        body: &RigidBody,
        colliders: &[ColliderBuilder],
        controller: Option<Controller<'_>>,
    ) -> Result<BodyId, Error> {
        self.written("make bodies")?.1.insert(pose, body, colliders, controller)
    }

    fn take_back(&mut self, bodies: &[BodyId]) -> Result<(), Error> {
        self.written("destroy bodies")?.1.take_back(bodies);
        Ok(())
    }

    fn can_remove(&self, _id: BodyId) -> Result<(), Error> {
        self.look()?;
        match &self.process {
            Process::Server(_) => Ok(()),
            Process::Node(_) => Err(self.unsupported("destroy bodies", Instead::JoinAsClient)),
        }
    }

    fn remove(&mut self, id: BodyId) -> Result<(), Error> {
        let (server, author) = self.written("destroy bodies")?;
        author.remove(server, id)
    }

    fn set_pose(&mut self, id: BodyId, pose: WorldPose) -> Result<(), Error> {
        let (server, author) = self.written("move bodies")?;
        author.set_pose(server, id, pose)
    }

    fn set_velocity(&mut self, id: BodyId, velocity: Velocity) -> Result<(), Error> {
        let (server, author) = self.written("move bodies")?;
        author.set_velocity(server, id, velocity)
    }

    fn drive(&mut self, id: BodyId, drive: Drive) -> Result<(), Error> {
        let (server, author) = self.written("drive bodies")?;
        author.drive(server, id, drive)
    }

    fn pushes_bodies(&self) -> Result<(), Error> {
        self.sees("push bodies by force")
    }

    fn push(&mut self, push: &Push) -> Result<(), Error> {
        let (server, author) = self.written("push bodies by force")?;
        author.push(server, push)
    }

    fn changes_bodies(&self) -> Result<(), Error> {
        self.sees(CHANGE_BODY)
    }

    fn changes_colliders(&self) -> Result<(), Error> {
        self.sees(CHANGE_SURFACE)
    }

    fn update(&mut self, id: BodyId, change: &mut dyn FnMut(&mut RigidBody)) -> Result<(), Error> {
        let (server, author) = self.written(CHANGE_BODY)?;
        author.update(server, id, change)
    }

    fn update_collider(
        &mut self,
        id: BodyId,
        index: usize,
        change: &mut dyn FnMut(&mut Collider),
    ) -> Result<(), Error> {
        let (server, author) = self.written(CHANGE_SURFACE)?;
        author.update_collider(server, id, index, change)
    }

    fn suspend(&mut self) -> Result<(), Error> {
        match &self.process {
            Process::Node(_) => return Err(self.unsupported("be suspended", Instead::ServerKeeps)),
            Process::Server(server) if server.is_suspended() => return Ok(()),
            Process::Server(_) => {}
        }
        self.written("be suspended")?;
        self.flush();
        let server = self.server_to("be suspended")?;
        server.suspend();
        match server.failure() {
            Some(failure) => Err(failure.into()),
            None if server.is_suspended() => Ok(()),
            None => self.look(),
        }
    }

    fn can_be_saved(&self) -> Result<(), Error> {
        self.server_to(SAVE).map(drop)
    }

    fn saved(&self) -> Result<LocalWorld, Error> {
        let server = self.server_to(SAVE)?;
        server.save().or_else(|error| self.look().and(Err(error.into())))
    }

    fn replace(&mut self, world: &LocalWorld) -> Result<(), Error> {
        let (server, author) = self.written(SAVE)?;
        match server.replace(world) {
            Ok(next_ids) => {
                author.begin_anew(next_ids);
                Ok(())
            }
            Err(error) => self.look().and(Err(error.into())),
        }
    }

    fn ties_bodies(&self) -> Result<(), Error> {
        self.sees("make, see, drive or destroy joints")
    }

    fn insert_joint(&mut self, a: BodyId, b: BodyId, joint: &GenericJoint) -> Result<JointId, Error> {
        let (server, author) = self.written("make joints")?;
        author.insert_joint(server, [a, b], joint)
    }

    fn remove_joint(&mut self, id: JointId) -> Result<(), Error> {
        let (server, author) = self.written("destroy joints")?;
        author.remove_joint(server, id)
    }

    fn update_joint(&mut self, id: JointId, change: &mut dyn FnMut(&mut GenericJoint)) -> Result<(), Error> {
        let (server, author) = self.written("drive joints")?;
        author.update_joint(server, id, change)
    }

    fn joint(&self, id: JointId) -> Option<JointRecord> {
        let (server, author) = self.read()?;
        author.joint(server, id)
    }

    fn joints_of(&self, body: BodyId) -> Vec<JointId> {
        let Some((server, author)) = self.read() else { return Vec::new() };
        author.joints_of(server, body).into_iter().map(|joint| joint.id).collect()
    }

    fn submit(&mut self, question: Query) -> Result<u64, Error> {
        let number = self.questions + 1;
        let question = Query { number, ..question };
        question.check().map_err(refused)?;
        // A query must see what the program did before it, so it waits for these changes. Sending them now
        // would separate bodies that are to be tied.
        let waits = self.written("ask by rays, shapes and points")?.1.has_news();
        self.waiting.push(question);
        if !waits {
            self.flush();
        }
        self.questions = number;
        Ok(number)
    }

    fn answer(&mut self, number: u64) -> Result<Option<QueryResult>, Error> {
        match &self.process {
            Process::Server(server) => match server.take_answer(number) {
                None => self.look().map(|()| None),
                answer => Ok(answer),
            },
            Process::Node(_) => Ok(None),
        }
    }

    fn forget(&mut self, number: u64) {
        self.waiting.retain(|question| question.number != number);
        if let Process::Server(server) = &self.process {
            server.forget(number);
        }
    }

    fn events(&self) -> &WorldEvents {
        &self.events
    }

    fn contains(&self, id: BodyId) -> bool {
        self.record(id).is_some()
    }

    fn record(&self, id: BodyId) -> Option<BodyRecord> {
        let (server, author) = self.read()?;
        author.known(server, id)
    }

    fn shape(&self, hash: ShapeHash) -> Option<ShapeRecord> {
        let (server, author) = self.read()?;
        author.shape(server, hash)
    }

    fn for_each_fixed(&self, look: &mut dyn FnMut(BodyId, &WorldPose)) {
        let fixed = self.read().map(|(server, author)| author.fixed_bodies(server));
        fixed.into_iter().flatten().for_each(|(id, pose)| look(id, &pose));
    }

    fn joints(&self) -> Vec<JointRecord> {
        self.read().map(|(server, author)| author.joints(server)).unwrap_or_default()
    }

    fn tree(&self) -> Option<DistributionTree> {
        self.read().map(|(server, _)| server.tree())
    }

    fn motion(&self, id: BodyId) -> Option<(WorldPose, Velocity)> {
        self.record(id).map(|body| (body.state.pose, body.state.velocity))
    }

    fn user_data(&self, id: BodyId) -> Option<u128> {
        let known = self.record(id).map(|body| body.user_data);
        // Ends of contacts still name bodies that the program, a builder or a client has removed.
        known.or_else(|| self.server()?.user_data(id))
    }

    fn body(&self, id: BodyId) -> Option<Body> {
        let (server, author) = self.read()?;
        author.body(server, id)
    }

    fn movable_bodies(&self) -> Box<dyn Iterator<Item = MovableBody> + '_> {
        let bodies = self.read().map(|(server, author)| author.movable_bodies(server));
        Box::new(bodies.unwrap_or_default().into_iter())
    }

    fn movable_count(&self) -> usize {
        self.read().map_or(0, |(server, author)| author.movable_count(server))
    }

    fn poll(&self, timeout: Duration) -> bool {
        self.network.poll(timeout)
    }

    fn is_lost(&self) -> bool {
        match &self.process {
            Process::Server(server) => server.is_gone(),
            Process::Node(node) => node.ended().is_some(),
        }
    }

    fn network(&self) -> &Network {
        &self.network
    }

    fn server(&self) -> Option<&ServerProcess> {
        match &self.process {
            Process::Server(server) => Some(server),
            Process::Node(_) => None,
        }
    }

    fn address(&self) -> Option<SocketAddr> {
        Some(match &self.process {
            Process::Server(server) => server.address,
            Process::Node(node) => node.address,
        })
    }

    fn metrics_address(&self) -> Option<SocketAddr> {
        match &self.process {
            Process::Server(server) => server.metrics_address(),
            Process::Node(node) => node.metrics_address(),
        }
    }

    fn tick(&self) -> Tick {
        match &self.process {
            Process::Server(server) => server.summary().tick,
            Process::Node(node) => node.tick(),
        }
    }

    fn region_count(&self) -> usize {
        match &self.process {
            Process::Server(server) => server.summary().regions,
            Process::Node(node) => node.read_summary(|summary| summary.regions),
        }
    }

    fn fidelity_report(&self) -> Option<FidelityReport> {
        match &self.process {
            Process::Server(server) => server.fidelity_report(),
            Process::Node(_) => None,
        }
    }

    fn set_viewpoints(&self, viewpoints: &[Viewpoint]) -> Result<(), Error> {
        match &self.process {
            Process::Server(server) => {
                self.look()?;
                Ok(server.look(viewpoints)?)
            }
            Process::Node(_) => Err(self.unsupported("be looked at from viewpoints", Instead::JoinAsClient)),
        }
    }

    fn stats(&self) -> Stats {
        match &self.process {
            Process::Server(server) => {
                let summary = server.summary();
                Stats { ticks: summary.tick.0, bodies: summary.bodies, ..Stats::default() }
            }
            Process::Node(node) => node.read_summary(|summary| Stats {
                ticks: summary.tick.0,
                bodies: summary.bodies as usize,
                transfers: summary.transfers,
                last_step: Duration::from_micros(summary.last_us.into()),
                ..Stats::default()
            }),
        }
    }

    fn traffic(&self) -> PeerStats {
        match &self.process {
            Process::Server(server) => server.traffic(),
            Process::Node(node) => node.traffic(),
        }
    }
}
