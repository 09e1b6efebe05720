//! The regions that one process computes: all of them in a local world, some of them on a node.

use std::collections::BTreeMap;
use std::sync::Arc;

use rapier3d::prelude::*;
use rayon::prelude::*;

use super::assembly::Groups;
use super::coupling::{Coupling, Ground};
use super::directory::{Directory, Handover, Home};
use super::partition::Partition;
use super::region::{Region, Role};
use super::shapes::{ShapeError, ShapeLibrary};
use super::statics::Statics;
use super::{convert, joints};
use crate::protocol::{
    BodyKind, BodyRecord, BorderMessage, JointRecord, RegionEvents, ShapeHash, ShapeRecord, Velocity,
    WorldPose,
};
use crate::space::{BodyId, JointId, RegionId, RegionSet, Tick};

/// How a world is stepped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepSettings {
    /// m/s².
    pub gravity: [f32; 3],
    /// Seconds a tick.
    pub dt_s: f32,
    /// Solver iterations a tick, shared out among its micro-steps.
    pub solver_iterations: usize,
    /// How regions agree.
    pub coupling: Coupling,
    /// Micro-steps a tick, with an exchange after each.
    pub exchanges: usize,
}

impl Default for StepSettings {
    fn default() -> Self {
        Self {
            gravity: [0.0, -9.81, 0.0],
            dt_s: 1.0 / 60.0,
            solver_iterations: 4,
            coupling: Coupling::default(),
            exchanges: 1,
        }
    }
}

/// Why a host cannot do what it is asked.
#[derive(Debug, thiserror::Error)]
pub enum HostError {
    /// A shape cannot be held.
    #[error(transparent)]
    Shape(#[from] ShapeError),
    /// The operating system gives no threads.
    #[error("cannot start {threads} threads: {cause}; ask for fewer")]
    Threads {
        /// How many were asked for.
        threads: usize,
        /// The system's reason.
        cause: rayon::ThreadPoolBuildError,
    },
    /// The name is taken.
    #[error("{0} is in the world already; every body has one id")]
    Taken(BodyId),
    /// A joint ties a body that is not there.
    #[error("joint {joint} ties {body}, which is not in the world; insert both bodies first")]
    Untied {
        /// Which joint.
        joint: JointId,
        /// Which body.
        body: BodyId,
    },
    /// A number that must be finite is not, or a rotation is not a unit quaternion.
    #[error(
        "{0} has a pose or velocity that is not finite, or a rotation that is not a unit quaternion; check its numbers"
    )]
    NotFinite(BodyId),
}

/// Some regions of a world, stepped together.
pub struct RegionHost {
    partition: Partition,
    settings: StepSettings,
    shapes: ShapeLibrary,
    statics: Statics,
    /// Those computed here, in rank order.
    regions: Vec<Region>,
    /// By rank: where in `regions`.
    place_of: Vec<Option<usize>>,
    directory: Directory,
    pool: Option<Arc<rayon::ThreadPool>>,
    /// From regions computed elsewhere, for the exchange that is open.
    incoming: BTreeMap<(RegionId, RegionId), BorderMessage>,
    tick: Tick,
    transfers: u64,
    /// Of the last step, and of insertions since.
    handovers: Vec<Handover>,
}

impl RegionHost {
    /// An empty host of the regions named, which must be leaves of the partition's tree.
    ///
    /// `threads` steps that many regions at a time; 1 uses the calling thread.
    pub fn new(
        partition: Partition,
        settings: StepSettings,
        threads: usize,
        hosted: &[RegionId],
    ) -> Result<Self, HostError> {
        let pool = match threads {
            0 | 1 => None,
            threads => Some(Arc::new(
                rayon::ThreadPoolBuilder::new()
                    .num_threads(threads)
                    .thread_name(|i| format!("dcd-region-{i}"))
                    .build()
                    .map_err(|cause| HostError::Threads { threads, cause })?,
            )),
        };
        let mut host = Self {
            place_of: vec![None; partition.len()],
            partition,
            settings,
            shapes: ShapeLibrary::default(),
            statics: Statics::default(),
            regions: Vec::new(),
            directory: Directory::default(),
            pool,
            incoming: BTreeMap::new(),
            tick: Tick(0),
            transfers: 0,
            handovers: Vec::new(),
        };
        for &region in hosted {
            host.add_region(region);
        }
        Ok(host)
    }

    /// Takes on one more region, empty.
    fn add_region(&mut self, id: RegionId) {
        let rank = self.partition.rank_of(id).expect("a region is a leaf of the tree");
        assert!(self.place_of[rank].is_none(), "{id} is hosted here already");
        let part = self.partition.tree().part(id);
        let cell = *self.partition.cell(rank);
        let region = Region::new(id, rank, cell, &part, self.settings.gravity, self.partition.leaves());
        let place = self.regions.partition_point(|other| other.rank() < rank);
        self.regions.insert(place, region);
        self.index();
    }

    /// Gives a region up, with all that it holds.
    fn remove_region(&mut self, id: RegionId) {
        if let Some(place) = self.partition.rank_of(id).and_then(|rank| self.place_of[rank]) {
            self.regions.remove(place);
            self.index();
        }
    }

    /// Adds a shape that came as a record; its parts first.
    pub fn add_shape(&mut self, record: ShapeRecord) -> Result<ShapeHash, HostError> {
        Ok(self.shapes.add(record)?)
    }

    /// The shapes of this process.
    pub fn shapes(&self) -> &ShapeLibrary {
        &self.shapes
    }

    /// The same, to describe bodies by Rapier's builders.
    pub fn shapes_mut(&mut self) -> &mut ShapeLibrary {
        &mut self.shapes
    }

    /// Puts bodies and the joints among them into the regions where they belong, as far as these are computed here: an
    /// assembly into the region of its lowest body, an immovable body wherever it reaches. When every region is computed
    /// here, replicas are in place at once; else an exchange after [`RegionHost::announce`] or the next step brings them.
    /// Nothing is inserted when anything is refused.
    pub fn insert(&mut self, mut bodies: Vec<BodyRecord>, joints: &[JointRecord]) -> Result<(), HostError> {
        bodies.sort_by_key(|body| body.id);
        self.check(&bodies, joints)?;
        let owners = self.owners(&bodies, joints);
        self.insert_placed(bodies, &owners, joints)?;
        if self.regions.len() == self.partition.len() {
            self.announce();
            self.exchange()?;
        }
        Ok(())
    }

    /// Computes these regions from now on and no other, as when membership changes. Kept regions keep their bodies;
    /// `placed` bodies (with their regions, which may be elsewhere) supersede what is held of them; `dropped` ones go.
    /// All forget who holds replicas, so everything shared must be announced again by the exchange that follows:
    /// [`RegionHost::announce`], [`RegionHost::exchange`], [`RegionHost::drop_unconfirmed`].
    pub fn rebuild(
        &mut self,
        hosted: &[RegionId],
        placed: Vec<(RegionId, BodyRecord)>,
        joints: &[JointRecord],
        dropped: &[BodyId],
    ) -> Result<(), HostError> {
        for region in self.regions.iter().map(Region::id).collect::<Vec<_>>() {
            if !hosted.contains(&region) {
                self.remove_region(region);
            }
        }
        let mut placed = placed;
        // What is immovable is told on joining, and stays.
        placed
            .retain(|(_, body)| body.traits.kind != BodyKind::Fixed || self.statics.body(body.id).is_none());
        for id in placed.iter().map(|(_, body)| body.id).chain(dropped.iter().copied()) {
            for region in &mut self.regions {
                region.remove(id);
            }
            self.directory.remove(id);
        }
        for region in &mut self.regions {
            region.forget_holders();
        }
        for &id in hosted {
            if !self.regions.iter().any(|region| region.id() == id) {
                self.add_region(id);
            }
        }
        // New regions get what is immovable in the same pass, so that all is inserted in id order, as in a new world.
        placed.extend(self.statics.bodies().map(|body| (RegionId(0), body.clone())));
        placed.sort_by_key(|(_, body)| body.id);
        let owners: Vec<_> =
            placed.iter().map(|(region, _)| self.partition.rank_of(*region).unwrap_or(usize::MAX)).collect();
        let bodies = placed.into_iter().map(|(_, body)| body).collect();
        self.insert_placed(bodies, &owners, joints)
    }

    /// Says which regions must hold what was inserted since the last step; the exchange carries it.
    pub fn announce(&mut self) {
        let (partition, tick, settings) = (&self.partition, self.tick, self.settings);
        on_all(&self.pool, &mut self.regions, |region| {
            settings.coupling.announce(region, partition, tick, settings.dt_s);
        });
    }

    /// Lets go of replicas that no owner has announced since [`RegionHost::rebuild`].
    pub fn drop_unconfirmed(&mut self) {
        for region in &mut self.regions {
            for link in region.replicas.clone() {
                if !region.slot(link.handle).confirmed {
                    region.remove(link.id);
                }
            }
        }
    }

    /// Takes a body out of every region. Returns whether any held it.
    pub fn remove(&mut self, id: BodyId) -> bool {
        let mut held = self.statics.remove(id);
        for region in &mut self.regions {
            held |= region.remove(id);
        }
        self.directory.remove(id);
        held
    }

    /// Ties two bodies that are in the world. Their assemblies become one: if these lie in different regions, both are
    /// placed anew, which costs them the warm start of one step.
    pub fn tie(&mut self, id: JointId, a: BodyId, b: BodyId, joint: &GenericJoint) -> Result<(), HostError> {
        let joint = joints::joint_record(id, a, b, joint);
        let (mut bodies, mut ties) = (BTreeMap::new(), BTreeMap::new());
        for body in [a, b] {
            self.gather_assembly(body, &mut bodies, &mut ties);
        }
        let places: Vec<_> = bodies.keys().map(|&body| self.present_place(body)).collect();
        if places.windows(2).all(|pair| pair[0] == pair[1]) {
            return self.insert(Vec::new(), &[joint]);
        }
        for &body in bodies.keys() {
            self.remove(body);
        }
        ties.insert(id, joint);
        self.insert(bodies.into_values().collect(), &ties.into_values().collect::<Vec<_>>())
    }

    /// Takes a joint out of every region. Returns whether any held it.
    pub fn remove_joint(&mut self, id: JointId) -> bool {
        let mut held = false;
        for region in &mut self.regions {
            held |= region.joint_handle(id).is_some();
            region.remove_joint(id);
        }
        held
    }

    /// Applies a change to every copy of a body held here, so that owner and replicas stay alike. Returns what the
    /// change returned for the owner's copy, or for the first other copy when the owner is elsewhere.
    pub fn update<R>(&mut self, id: BodyId, mut change: impl FnMut(&mut RigidBody) -> R) -> Option<R> {
        let mut result = None;
        for region in &mut self.regions {
            let Some(handle) = region.handle_of(id) else { continue };
            let role = region.slot(handle).role;
            let returned = change(&mut region.world_mut().bodies[handle]);
            region.refresh(handle);
            if role == Role::Immovable {
                self.statics.set_traits(id, &region.slot(handle).traits);
            }
            if role == Role::Owner || result.is_none() {
                result = Some(returned);
            }
        }
        result
    }

    /// Applies a change to one collider of a body, in every copy held here; `index` counts them in order of insertion.
    /// Returns what [`RegionHost::update`] would. Shape, position and mass must stay as they are.
    pub fn update_collider<R>(
        &mut self,
        id: BodyId,
        index: usize,
        mut change: impl FnMut(&mut Collider) -> R,
    ) -> Option<R> {
        let mut result = None;
        for region in &mut self.regions {
            let Some(handle) = region.handle_of(id) else { continue };
            let role = region.slot(handle).role;
            let returned = region.update_collider(handle, index, &mut change)?;
            if role == Role::Immovable {
                self.statics.set_traits(id, &region.slot(handle).traits);
            }
            if role == Role::Owner || result.is_none() {
                result = Some(returned);
            }
        }
        result
    }

    /// Applies a change to every copy of a joint held here.
    pub fn update_joint(&mut self, id: JointId, mut change: impl FnMut(&mut GenericJoint)) -> bool {
        let mut found = false;
        for region in &mut self.regions {
            let Some(handle) = region.joint_handle(id) else { continue };
            if let Some(joint) = region.world_mut().impulse_joints.get_mut(handle, true) {
                change(&mut joint.data);
                found = true;
            }
        }
        found
    }

    /// Puts a body elsewhere, in every copy; one that comes to lie in other regions is placed anew.
    pub fn teleport(&mut self, id: BodyId, pose: WorldPose) -> Result<bool, HostError> {
        if !pose.is_valid() {
            return Err(HostError::NotFinite(id));
        }
        if let Some(body) = self.statics.body(id) {
            let mut body = body.clone();
            body.state.pose = pose;
            self.remove(id);
            self.insert(vec![body], &[])?;
            return Ok(true);
        }
        let Some(record) = self.record(id) else { return Ok(false) };
        let joints: Vec<_> = self.joints_of(id).collect();
        let moved = BodyRecord { state: crate::protocol::BodyState { pose, ..record.state }, ..record };
        let owner = self.partition.rank_at(pose.translation);
        if joints.is_empty() && owner != self.present_place(id).0 {
            self.remove(id);
            self.insert(vec![moved], &[])?;
            return Ok(true);
        }
        Ok(self.move_copies(id, pose))
    }

    /// Puts every copy held here elsewhere; the next exchange hands the body over, if it left its region. Returns whether
    /// any region here holds it.
    pub fn move_copies(&mut self, id: BodyId, pose: WorldPose) -> bool {
        let mut held = false;
        for region in &mut self.regions {
            if let Some(handle) = region.handle_of(id) {
                let pose = convert::region_from_world(region.anchor(), &pose);
                region.world_mut().bodies[handle].set_position(pose, true);
                region.refresh(handle);
                held = true;
            }
        }
        held
    }

    /// The first half of a (micro-)step: every region steps and says what its neighbours must know.
    pub fn compute(&mut self) {
        let settings = self.settings;
        let dt_s = settings.dt_s / settings.exchanges as f32;
        let iterations = settings.solver_iterations.div_ceil(settings.exchanges).max(1);
        let (partition, tick) = (&self.partition, self.tick.next());
        on_all(&self.pool, &mut self.regions, |region| {
            region.step(dt_s, iterations);
            settings.coupling.gather(region, partition, tick, dt_s);
        });
    }

    /// What regions here have to say to regions elsewhere, non-empty messages only.
    pub fn outgoing(&self) -> impl Iterator<Item = &BorderMessage> {
        self.regions.iter().flat_map(|region| &region.outbox).filter(|message| {
            let rank = self.partition.rank_of(message.to).expect("messages go to leaves");
            self.place_of[rank].is_none() && !message.is_empty()
        })
    }

    /// Hands in what a region computed elsewhere said; the exchange takes it in.
    pub fn accept(&mut self, message: BorderMessage) {
        self.incoming.insert((message.to, message.from), message);
    }

    /// The second half: every region takes in what the others said, in rank order.
    pub fn exchange(&mut self) -> Result<(), HostError> {
        if self.partition.len() > 1 {
            let outboxes: Vec<_> =
                self.regions.iter_mut().map(|region| std::mem::take(&mut region.outbox)).collect();
            let ground = Ground { partition: &self.partition, shapes: &self.shapes, statics: &self.statics };
            let (incoming, place_of, coupling) = (&self.incoming, &self.place_of, self.settings.coupling);
            let failure = std::sync::Mutex::new(None);
            on_all(&self.pool, &mut self.regions, |region| {
                let (to, rank) = (region.id(), region.rank());
                let leaves = ground.partition.leaves();
                let inbox = place_of.iter().zip(leaves).filter_map(|(place, &from)| match place {
                    Some(place) => Some(&outboxes[*place][rank]),
                    None => incoming.get(&(to, from)),
                });
                if let Err(error) = coupling.apply(region, inbox, ground) {
                    failure.lock().expect("no panic while locked").get_or_insert(error);
                }
            });
            for (region, outbox) in self.regions.iter_mut().zip(outboxes) {
                region.outbox = outbox;
            }
            self.incoming.clear();
            self.note_arrivals();
            if let Some(error) = failure.into_inner().expect("no panic while locked") {
                return Err(error.into());
            }
        }
        Ok(())
    }

    /// A whole tick of a host that computes every region.
    pub fn step(&mut self) -> Result<(), HostError> {
        assert_eq!(
            self.regions.len(),
            self.partition.len(),
            "a node's exchange needs its neighbours' messages"
        );
        // One entry into the pool a tick: between its halves the threads stay awake.
        match self.pool.clone() {
            Some(pool) if self.regions.len() > 1 => pool.install(|| self.step_all()),
            _ => self.step_all(),
        }
    }

    fn step_all(&mut self) -> Result<(), HostError> {
        self.handovers.clear();
        for _ in 0..self.settings.exchanges {
            self.compute();
            self.exchange()?;
        }
        // Stable: a body that went twice has its ways in order.
        self.handovers.sort_by_key(|handover| handover.body);
        self.end_tick();
        Ok(())
    }

    /// The tick is over: counts it.
    pub fn end_tick(&mut self) {
        self.tick = self.tick.next();
    }

    /// What the regions saw of contacts since [`RegionHost::clear_events`], in rank order.
    pub fn events(&self) -> impl Iterator<Item = &RegionEvents> {
        self.regions.iter().map(|region| &region.events)
    }

    /// Forgets what the regions saw.
    pub fn clear_events(&mut self) {
        for region in &mut self.regions {
            region.events.touches.clear();
            region.events.forces.clear();
        }
    }

    /// Ticks since the world began.
    pub fn tick(&self) -> Tick {
        self.tick
    }

    /// Sets the clock of a host that joins a running world.
    pub fn set_tick(&mut self, tick: Tick) {
        self.tick = tick;
    }

    /// How it is stepped.
    pub fn settings(&self) -> &StepSettings {
        &self.settings
    }

    /// Where the regions are.
    pub fn partition(&self) -> &Partition {
        &self.partition
    }

    /// The regions computed here, in rank order.
    pub fn regions(&self) -> &[Region] {
        &self.regions
    }

    /// Bodies that changed owner since the host was made, counted by the new owner.
    pub fn transfers(&self) -> u64 {
        self.transfers
    }

    /// Bodies that regions here gave to others in the last [`RegionHost::step`], in id order.
    pub fn handovers(&self) -> &[Handover] {
        &self.handovers
    }

    /// The owner's copy of a movable body, if its region is computed here.
    pub fn owned(&self, id: BodyId) -> Option<(&Region, RigidBodyHandle)> {
        let home = self.directory.home(id)?;
        let region = &self.regions[self.place_of[home.rank]?];
        Some((region, home.handle))
    }

    /// An immovable body by name.
    pub fn immovable(&self, id: BodyId) -> Option<&BodyRecord> {
        self.statics.body(id)
    }

    /// Every immovable body in id order.
    pub fn immovables(&self) -> impl Iterator<Item = &BodyRecord> {
        self.statics.bodies()
    }

    /// A body, whole: as its owner has it, if that is here, else as a replica has it.
    pub fn record(&self, id: BodyId) -> Option<BodyRecord> {
        if let Some(body) = self.statics.body(id) {
            return Some(body.clone());
        }
        if let Some((region, handle)) = self.owned(id) {
            return Some(region.body_record(handle));
        }
        self.regions.iter().find_map(|region| Some(region.body_record(region.handle_of(id)?)))
    }

    /// The joints of one body, whole, in order of insertion.
    pub fn joints_of(&self, id: BodyId) -> impl Iterator<Item = JointRecord> {
        let held = self.regions.iter().find_map(|region| Some((region, region.handle_of(id)?)));
        held.into_iter().flat_map(|(region, handle)| region.joints_of(handle))
    }

    /// Every joint held by a region here, once, in id order.
    pub fn joints(&self) -> Vec<JointRecord> {
        let mut joints: BTreeMap<JointId, JointRecord> = BTreeMap::new();
        for region in &self.regions {
            joints.extend(region.joint_records().map(|joint| (joint.id, joint)));
        }
        joints.into_values().collect()
    }

    /// Every movable body owned here in id order, with its region.
    pub fn states(&self) -> impl Iterator<Item = (BodyId, RegionId, WorldPose, Velocity)> {
        self.owned_bodies().map(|(id, region, handle)| {
            let body = &region.physics().bodies[handle];
            (id, region.id(), region.world_pose(handle), convert::velocity_of(body))
        })
    }

    /// Every movable body owned here in id order, with its region and Rapier's handle there.
    pub fn owned_bodies(&self) -> impl Iterator<Item = (BodyId, &Region, RigidBodyHandle)> {
        self.directory
            .homes()
            .filter_map(|(id, home)| Some((id, &self.regions[self.place_of[home.rank]?], home.handle)))
    }

    /// How many movable bodies are owned here.
    pub fn owned_count(&self) -> usize {
        self.directory.len()
    }

    fn index(&mut self) {
        self.place_of.fill(None);
        for (place, region) in self.regions.iter().enumerate() {
            self.place_of[region.rank()] = Some(place);
        }
        self.directory = Directory::default();
        for region in &self.regions {
            for (id, role, handle, _) in region.bodies() {
                if role == Role::Owner {
                    self.directory.set(id, Home { rank: region.rank(), handle });
                }
            }
        }
    }

    fn note_arrivals(&mut self) {
        for message in self.regions.iter().flat_map(|region| &region.outbox) {
            for transfer in &message.transfers {
                self.directory.remove(transfer.body.id);
                self.handovers.push(Handover { body: transfer.body.id, from: message.from, to: message.to });
            }
        }
        for region in &self.regions {
            self.transfers += region.arrived.len() as u64;
            for link in &region.arrived {
                self.directory.set(link.id, Home { rank: region.rank(), handle: link.handle });
            }
        }
    }

    fn check(&self, bodies: &[BodyRecord], joints: &[JointRecord]) -> Result<(), HostError> {
        for body in bodies {
            if self.held(body.id) {
                return Err(HostError::Taken(body.id));
            }
            if !body.state.pose.is_valid() || !body.state.velocity.is_finite() {
                return Err(HostError::NotFinite(body.id));
            }
            for collider in &body.traits.colliders {
                self.shapes.shape(collider.shape)?;
            }
        }
        if let Some(pair) = bodies.windows(2).find(|pair| pair[0].id == pair[1].id) {
            return Err(HostError::Taken(pair[0].id));
        }
        for joint in joints {
            for body in [joint.a, joint.b] {
                let new = bodies.binary_search_by_key(&body, |body| body.id).is_ok();
                // On a node the other end may be held elsewhere: only a host of all regions can tell.
                let all_here = self.regions.len() == self.partition.len();
                if !new && all_here && !self.held(body) {
                    return Err(HostError::Untied { joint: joint.id, body });
                }
            }
        }
        Ok(())
    }

    fn held(&self, id: BodyId) -> bool {
        self.statics.body(id).is_some() || self.regions.iter().any(|region| region.handle_of(id).is_some())
    }

    /// Rank of the owner of each body: assemblies go whole, to the region of their lowest body.
    fn owners(&self, bodies: &[BodyRecord], joints: &[JointRecord]) -> Vec<usize> {
        let movable = |id: &BodyId| {
            let place = bodies.binary_search_by_key(id, |body| body.id);
            place.is_ok_and(|place| bodies[place].traits.kind != BodyKind::Fixed)
        };
        let mut groups = Groups::default();
        for joint in joints {
            if movable(&joint.a) && movable(&joint.b) {
                groups.join(joint.a, joint.b);
            }
        }
        bodies
            .iter()
            .map(|body| {
                let root = groups.root(body.id);
                let lead = bodies.binary_search_by_key(&root, |body| body.id).map_or(body, |at| &bodies[at]);
                self.partition.rank_at(lead.state.pose.translation)
            })
            .collect()
    }

    /// In id order, as one Rapier world would be filled; `owners` are ranks.
    fn insert_placed(
        &mut self,
        bodies: Vec<BodyRecord>,
        owners: &[usize],
        joints: &[JointRecord],
    ) -> Result<(), HostError> {
        for body in &bodies {
            if body.traits.kind != BodyKind::Fixed {
                self.partition.widen_halo(reach_of_record(body, &self.shapes)?);
            } else if self.statics.body(body.id).is_none() {
                self.statics.add(body.clone(), &self.shapes)?;
            }
        }
        // Region by region: what Rapier allocates for the bodies of one world then lies together. Filled in turns, two
        // worlds share cache lines, which cost a tenth of the step (40,000 free boxes in two regions).
        for region in &mut self.regions {
            for (body, &owner) in bodies.iter().zip(owners) {
                if body.traits.kind == BodyKind::Fixed {
                    self.statics.insert_near(body.id, region, &self.shapes)?;
                } else if owner == region.rank() {
                    let handle = region.insert(body, Role::Owner, RegionSet::EMPTY, &self.shapes)?;
                    self.statics.cover(region, handle, &self.shapes)?;
                    self.directory.set(body.id, Home { rank: owner, handle });
                }
            }
        }
        for joint in joints {
            for region in &mut self.regions {
                let movable = [joint.a, joint.b].into_iter().any(|id| {
                    let role = region.handle_of(id).and_then(|handle| region.role_of(handle));
                    role.is_some_and(|(_, role)| role != Role::Immovable)
                });
                if movable {
                    self.statics.ensure(region, joint, &self.shapes)?;
                    region.insert_joint(joint);
                }
            }
        }
        Ok(())
    }

    /// The movable bodies that joints tie to this one, with it, and the joints of all of them.
    fn gather_assembly(
        &self,
        body: BodyId,
        bodies: &mut BTreeMap<BodyId, BodyRecord>,
        ties: &mut BTreeMap<JointId, JointRecord>,
    ) {
        let mut open = vec![body];
        while let Some(body) = open.pop() {
            if bodies.contains_key(&body) || self.statics.body(body).is_some() {
                continue;
            }
            let Some(record) = self.record(body) else { continue };
            bodies.insert(body, record);
            for joint in self.joints_of(body) {
                open.extend([joint.a, joint.b]);
                ties.insert(joint.id, joint);
            }
        }
    }

    fn present_place(&self, id: BodyId) -> (usize, RegionSet) {
        match self.owned(id) {
            Some((region, handle)) => (region.rank(), region.slot(handle).holders),
            None => (usize::MAX, RegionSet::EMPTY),
        }
    }
}

/// How far a recorded body reaches from its position, in metres.
fn reach_of_record(body: &BodyRecord, shapes: &ShapeLibrary) -> Result<f32, ShapeError> {
    let mut reach = 0.0f32;
    for collider in &body.traits.colliders {
        let ball = shapes.shape(collider.shape)?.compute_bounding_sphere(&convert::pose(collider.pose));
        reach = reach.max(ball.center.length() + ball.radius + collider.contact_skin_m);
    }
    Ok(reach)
}

/// Runs the same work on every region, in parallel when there is a pool.
fn on_all(pool: &Option<Arc<rayon::ThreadPool>>, regions: &mut [Region], work: impl Fn(&mut Region) + Sync) {
    match pool {
        Some(pool) if regions.len() > 1 => {
            pool.install(|| regions.par_iter_mut().with_max_len(1).for_each(&work));
        }
        _ => regions.iter_mut().for_each(work),
    }
}
