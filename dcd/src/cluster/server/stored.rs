//! Stores the server's state in the directory, and restores a server from it. Thesis 4.3.3 assumes that the
//! server never fails; this one may.

#[cfg(all(feature = "net", feature = "physics"))]
pub(crate) mod summary;

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use bincode::{Decode, Encode};

use super::common::{ClientEntry, Common, NodeEntry, RETURN, RETURN_OF_CLIENTS};
use super::group::Group;
use super::moves::Moves;
use super::retold::Retold;
use super::{Server, ServerConfig, ServerOutput};
use crate::cluster::directory::Entry;
use crate::cluster::record::StoredBody;
use crate::cluster::{Batch, Key, Record};
use crate::protocol::{
    Check, CodecError, EnvironmentProperties, Invalid, JointRecord, ShapeRecord, View, ViewNumber,
    decode_value, encode_value,
};
use crate::space::{GroupId, Tick, Viewpoint};

/// Fewer views than this have begun since the last number was written down.
const NUMBERS_AHEAD: u64 = 1 << 10;

/// An error of restoring a server from what is stored.
#[derive(Debug, thiserror::Error)]
pub enum RestoreError {
    /// The directory has entries, but not the world's.
    #[error(
        "the directory holds parts of a world, but not the world itself: forget them (--fresh), or choose another data folder"
    )]
    NoWorld,
    /// The stored world is not the one that the server is to serve.
    #[error(
        "what is stored is another world that has not ended: serve the same scene with the same options to go on with it, \
         end it (`dcd end`), forget it (--fresh), or choose another folder"
    )]
    OtherWorld,
    /// An entry cannot be read.
    #[error(
        "an entry of the directory cannot be read ({0}): it is damaged or of another version; forget it (--fresh), or choose \
         another data folder"
    )]
    Entry(#[from] CodecError),
}

/// Returns a view number beyond all that can have begun since this one was written down.
fn ahead_of(number: ViewNumber) -> ViewNumber {
    ViewNumber(number.0.saturating_add(NUMBERS_AHEAD))
}

#[derive(Clone, Debug, PartialEq, Encode, Decode)]
struct StoredWorld {
    world: EnvironmentProperties,
    incarnation: u64,
    number: ViewNumber,
    main: GroupId,
    last_group: GroupId,
    begun: bool,
    tick: Tick,
    next_ids: (u32, u64),
    viewpoints: Vec<Viewpoint>,
}

#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub(super) struct StoredGroup {
    pub(super) view: View,
    former: Option<View>,
}

impl Check for StoredWorld {
    fn check(&self) -> Result<(), Invalid> {
        self.world.check()?;
        match self.viewpoints.iter().all(Viewpoint::is_fit) {
            true => Ok(()),
            false => Err(Invalid { field: "viewpoints", rule: "finite, no radius negative" }),
        }
    }
}

impl Check for StoredGroup {
    fn check(&self) -> Result<(), Invalid> {
        self.view.check()?;
        self.former.as_ref().map_or(Ok(()), Check::check)
    }
}

/// Returns whether both are the same world. They may differ in how the world is computed and told: there,
/// what is served counts.
fn is_same(stored: &EnvironmentProperties, served: &EnvironmentProperties) -> bool {
    let EnvironmentProperties { fidelity, viewpoints, relays_above, .. } = served.clone();
    EnvironmentProperties { fidelity, viewpoints, relays_above, ..stored.clone() } == *served
}

/// The state with which a server begins.
#[derive(Clone, Debug, Encode, Decode)]
pub enum ServerOrigin {
    /// A world that waits for nodes.
    New(Record),
    /// A new world in place of the one that another server stored.
    Instead(Record, Vec<Entry>),
    /// The world that another server stored.
    Stored(Vec<Entry>),
}

impl Common {
    /// Returns the number of a view to come. The number is written down often enough that another server
    /// gives none of them again. View changes that never end, as members come and go, write nothing else of
    /// it.
    pub(super) fn next_view_number(&mut self) -> ViewNumber {
        self.number = self.number.next();
        self.world_changed |= self.number.0.is_multiple_of(NUMBERS_AHEAD / 2);
        self.number
    }
}

impl Server {
    /// Returns a server that begins with this state.
    pub fn of(config: ServerConfig, origin: ServerOrigin) -> Result<Self, RestoreError> {
        match origin {
            ServerOrigin::New(record) => Ok(Self::new(config, record)),
            ServerOrigin::Instead(record, entries) => Ok(Self::instead(config, record, &entries)),
            ServerOrigin::Stored(entries) => Self::restore(config, entries),
        }
    }

    /// Returns a server with a world in place of the one that another server stored. Its views are numbered
    /// after those of that world, so that nothing that anybody still has of that world counts.
    pub fn instead(config: ServerConfig, record: Record, entries: &[Entry]) -> Self {
        let former = entries.iter().find(|entry| entry.key == Key::World);
        let former = former.and_then(|entry| decode_value::<StoredWorld>(&entry.value).ok());
        let mut server = Self::new(config, record);
        server.common.number = former.map_or(ViewNumber(0), |world| ahead_of(world.number));
        server
    }

    /// Returns a server that goes on from what another server stored. It waits for the members of each group.
    /// Then the group goes on with those that came.
    pub fn restore(config: ServerConfig, entries: Vec<Entry>) -> Result<Self, RestoreError> {
        let mut world = None;
        let mut groups: BTreeMap<GroupId, StoredGroup> = BTreeMap::new();
        let (mut bodies, mut shapes, mut joints) = (Vec::new(), Vec::new(), Vec::new());
        let mut retold = BTreeSet::new();
        for Entry { key, value, .. } in entries {
            match key {
                Key::World => world = Some(decode_value::<StoredWorld>(&value)?),
                Key::Group(id) => {
                    groups.insert(id, decode_value(&value)?);
                }
                Key::Body(_) => bodies.push(decode_value::<StoredBody>(&value)?),
                Key::Shape(_) => shapes.push(decode_value::<ShapeRecord>(&value)?),
                Key::Joint(_) => joints.push(decode_value::<JointRecord>(&value)?),
                Key::GoneJoint(_)
                | Key::GoneScenery(_)
                | Key::AlteredBody(_)
                | Key::AlteredJoint(_)
                | Key::WokenBody(_) => _ = retold.insert(key),
            }
        }
        let stored: StoredWorld = world.ok_or(RestoreError::NoWorld)?;
        if !is_same(&stored.world, &config.world) {
            return Err(RestoreError::OtherWorld);
        }
        // Nodes that went on hold what was served before, and are told about a world only when they begin. So
        // they begin anew, with what is stored.
        let is_altered = stored.world != config.world;
        let over = if is_altered { std::mem::take(&mut groups) } else { BTreeMap::new() };
        // The states of bodies are written down more often than the world. Another group may be ahead by minutes, and says
        // nothing of the main one.
        let view = groups.get(&stored.main).or(over.get(&stored.main)).map(|group| group.view.tick);
        let tick = bodies.iter().map(StoredBody::tick).chain(view).fold(stored.tick, Tick::max);
        // The viewpoints that the program set since then stand, unless the world is served with others now.
        let is_seen_as_before = stored.world.viewpoints == config.world.viewpoints;
        let record = Record::restored(bodies, shapes, joints);
        let mut server = Self::new(ServerConfig { incarnation: stored.incarnation, ..config }, record);
        server.main_mut().record.forget_changes();
        server.common.world_changed |= is_altered;
        server.common.groups_changed.extend(over.into_keys());
        server.common.number = ahead_of(stored.number);
        server.common.begun = stored.begun;
        if is_seen_as_before {
            server.common.viewpoints = stored.viewpoints;
        }
        let (body, joint) = server.common.next_ids;
        server.common.next_ids = (body.max(stored.next_ids.0), joint.max(stored.next_ids.1));
        server.main = stored.main;
        server.last_group = stored.last_group;
        let main = server.groups.pop_first().map(|(_, group)| group).expect("a server has a group");
        for (id, group) in groups {
            let record = if id == stored.main { main.record.clone() } else { main.record.copied(true) };
            let tick = if id == stored.main { tick } else { tick.max(group.view.tick) };
            server.expect_back(id, record, tick, group.view, group.former);
        }
        let group = server.groups.entry(stored.main).or_insert_with(|| main.renamed(stored.main, tick));
        let is_so = |key| match key {
            Key::AlteredBody(id) | Key::WokenBody(id) => group.record.body(id).is_some(),
            Key::AlteredJoint(id) => group.record.joint(id).is_some(),
            // A builder may have given the id to another body since.
            Key::GoneScenery(id) => group.record.body(id).is_none(),
            Key::GoneJoint(id) => group.record.joint(id).is_none(),
            _ => false,
        };
        let retold = Retold::restored(retold, is_so);
        let gone = |key| if let Key::GoneScenery(id) = key { Some(id) } else { None };
        let gone: BTreeSet<_> = retold.keys().into_iter().filter_map(gone).collect();
        server.common.nodes.values_mut().for_each(|entry| entry.stale_scenery.clone_from(&gone));
        let absent: BTreeSet<_> = group.record.lives().filter_map(|(id, _)| id.client()).collect();
        server.groups.values_mut().for_each(|group| group.retold.clone_from(&retold));
        for client in absent.into_iter().filter(|client| !server.common.clients.contains_key(client)) {
            server.gone.push_back((server.common.config.avatar_expiry, client));
        }
        Ok(server)
    }

    /// Adds a group of a stored world. Its members are waited for.
    pub(super) fn expect_back(
        &mut self,
        id: GroupId,
        record: Record,
        tick: Tick,
        view: View,
        former: Option<View>,
    ) {
        for member in former.iter().chain([&view]).flat_map(|view| &view.members) {
            let entry = NodeEntry {
                member: member.clone(),
                absent_until: Some(RETURN),
                linked: false,
                loaded: true,
                loading: 0,
                leaving: false,
                unwanted: None,
                group: Some(id),
                in_group_since: Duration::ZERO,
                moved: false,
                serving: Some(view.number),
                anew_since: ViewNumber::default(),
                shapes: BTreeSet::new(),
                scenery: BTreeSet::new(),
                stale_scenery: BTreeSet::new(),
                delays: BTreeMap::new(),
                moves: Moves::default(),
            };
            self.common.nodes.insert(member.node, entry);
        }
        let clients: BTreeSet<_> = record.lives().filter_map(|(id, _)| id.client()).collect();
        for client in clients {
            let absent_until = Some(RETURN_OF_CLIENTS);
            let entry = ClientEntry { linked: false, absent_until, group: id, vicinity: None };
            self.common.clients.entry(client).or_insert(entry);
        }
        let mut group = Group::new(id, record, tick);
        group.view = Some(view);
        group.former = former;
        group.held = true;
        group.silent_since = Some(Duration::ZERO);
        self.groups.insert(id, group);
    }

    /// Writes down what has changed, before anything is sent that follows from it. `mark` is the number of
    /// outputs that were there before. If `soft`, what can wait is written too.
    pub(super) fn store(&mut self, mark: usize, soft: bool) {
        let mut writes = Vec::new();
        let tick_alone = soft && !self.common.world_changed;
        if self.common.world_changed || soft {
            let stored = StoredWorld {
                world: self.common.config.world.clone(),
                incarnation: self.common.config.incarnation,
                number: self.common.number,
                main: self.main,
                last_group: self.last_group,
                begun: self.common.begun,
                tick: self.tick(),
                next_ids: self.common.next_ids,
                viewpoints: self.common.viewpoints.clone(),
            };
            writes.push((Key::World, Some(encode_value(&stored))));
            self.common.world_changed = false;
        }
        for id in std::mem::take(&mut self.common.groups_changed) {
            let stored = self.groups.get(&id).and_then(|group| {
                let view = group.view.clone()?;
                Some(encode_value(&StoredGroup { view, former: group.former.clone() }))
            });
            writes.push((Key::Group(id), stored));
        }
        // Of the other groups, only the views are written down.
        let main = self.main;
        let others = self.groups.values_mut().filter(|group| group.id != main);
        others.for_each(|group| group.record.forget_changes());
        let Group { record, retold, .. } = self.main_mut();
        let before = writes.len();
        writes.extend(record.take_changes());
        let changes_bodies = writes.len() > before;
        writes.extend(retold.take_writes(false));
        let durable = writes.len() > usize::from(tick_alone);
        // What is written of a body is its newest state, and so are all others' then: beside older ones, bodies would come
        // back inside one another, and joints torn.
        if soft || changes_bodies {
            writes.extend(record.take_states());
        }
        if soft {
            writes.extend(retold.take_writes(true));
        }
        if !writes.is_empty() {
            self.common.outputs.insert(mark, ServerOutput::Store(Batch { writes, durable }));
        }
    }
}
