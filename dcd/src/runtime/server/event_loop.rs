//! Runs the loop of a server: feeds events of the network and requests of its program to the state machine,
//! and carries out its outputs.

use std::path::PathBuf;
use std::sync::mpsc::{RecvTimeoutError, SyncSender};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use tracing::{debug, error, info, warn};

use super::{Input, SUSPENDED, Shared};
use crate::cluster::directory::{Batch, Condition, Directory, DirectoryError, Key, Revision};
use crate::cluster::{DrainError, Peer, Record, SavedWorld, Server, ServerEvent, ServerOutput, WORLD_ENDED};
use crate::net::{Authority, NetTotals, PeerName};
use crate::physics::ShapeLibrary;
use crate::protocol::{BodyKind, BodyRecord, BuildOp, Farewell, Finding, Hindrance, StateHasher};
use crate::recording::RecordedServer;
use crate::runtime::directory::FolderLock;
use crate::runtime::end_request::EndRequests;
use crate::runtime::ending::{Cause, Reason};
use crate::runtime::inbox::Inbox;
use crate::runtime::links::{LinkEvent, Links};
use crate::runtime::log::LogSpan;
use crate::runtime::metrics::ServerMetrics;
use crate::runtime::{Connections, ProcessError};
use crate::space::{NodeId, Tick};

/// How often sending is tried again after a link had no room.
const RETRY: Duration = Duration::from_millis(2);
/// How long the loop sleeps when nothing is due.
const IDLE: Duration = Duration::from_millis(500);
/// How often traffic is counted, for which each link is asked.
const COUNT: Duration = Duration::from_millis(100);
/// The time-out of the last audit. Dead members are found much sooner.
const AUDIT: Duration = Duration::from_secs(10);
/// The most contacts, and the most forces, kept for a program that does not fetch them; the oldest go first.
const MAX_EVENTS: usize = 65_536;

/// The loop of a server, with all that only the loop changes.
pub(super) struct Loop {
    pub(super) links: Option<Links>,
    pub(super) connections: Connections,
    pub(super) directory: Box<dyn Directory>,
    pub(super) authority: Arc<Authority>,
    /// Dropped after the directory.
    pub(super) folder_lock: Option<FolderLock>,
    pub(super) end_requests: EndRequests,
    /// The revision at which this server last wrote the world's entry. If anyone else writes the entry,
    /// another server has taken over.
    pub(super) stored: Option<Revision>,
    /// The file that the server is recorded to.
    pub(super) record: Option<PathBuf>,
    pub(super) start: Instant,
    pub(super) server: Arc<Mutex<RecordedServer>>,
    pub(super) shared: Arc<Shared>,
    /// The metrics of the server, if they are asked for.
    pub(super) metrics: Option<Arc<ServerMetrics>>,
    pub(super) began: Option<Instant>,
    /// The time at which traffic is counted next.
    pub(super) count_at: Instant,
    /// Callers that wait for the world to be saved.
    pub(super) savers: Vec<SyncSender<SavedWorld>>,
    /// Nodes that are being drained, with the callers that wait for that.
    pub(super) drains: Vec<Drain>,
    /// The time at which the world ends even without an audit.
    pub(super) end_by: Option<Instant>,
    pub(super) over: bool,
}

/// A node that is being drained, and the caller that waits for that.
pub(super) struct Drain {
    node: NodeId,
    asker: SyncSender<Result<(), DrainError>>,
    /// Says whether the world went on without the node before the node had handed over.
    is_lost: bool,
}

impl Drain {
    /// Reports the outcome.
    fn end(&self, drained: Result<(), DrainError>) {
        match &drained {
            Ok(()) => info!(node = %self.node, "drained: other nodes have its regions"),
            Err(error) => warn!(%error, "a node is not drained"),
        }
        // A caller that has waited for too long is gone.
        let _ = self.asker.try_send(drained);
    }
}

impl Loop {
    pub(super) fn run(mut self, inputs: &Inbox<Input>) {
        let mut log = LogSpan::new(PeerName::Server);
        while !self.over {
            let due = self.server().poll_timeout().map(|due| due.saturating_sub(self.start.elapsed()));
            let (view, tick) = self.reached();
            let _log = log.enter(view, tick);
            let Some(links) = &mut self.links else { break };
            let wait = due.unwrap_or(IDLE).min(if links.flush(Instant::now()) { RETRY } else { IDLE });
            let input = inputs.recv_timeout(wait);
            // A server that was deposed sends nothing more.
            if let Err(error) = self.directory.renew() {
                self.fail(error);
                break;
            }
            let now = self.start.elapsed();
            match input {
                Ok(Input::Net(held)) => {
                    for event in links.translate(held.into_event()) {
                        self.hear(now, event);
                    }
                }
                Ok(Input::Stop) => self.stop(now),
                Ok(Input::Suspend) => self.server().handle(now, ServerEvent::Suspend),
                Ok(Input::Program(mut ops, shapes)) => {
                    let mut server = self.server();
                    bring_shapes(&mut ops, &shapes, server.record());
                    server.handle(now, ServerEvent::Program(ops));
                    drop(server);
                    self.shared.lock().changes += 1;
                }
                Ok(Input::Look(viewpoints)) => self.server().handle(now, ServerEvent::Look(viewpoints)),
                Ok(Input::Ask(question)) => self.server().handle(now, ServerEvent::Ask(question)),
                Ok(Input::Forget(number)) => {
                    self.server().handle(now, ServerEvent::Forget(number));
                    self.shared.lock().answers.remove(&number);
                }
                Ok(Input::Drain(node, asker)) => self.drain(now, node, asker),
                Ok(Input::Copy(asker)) => drop(asker.try_send(self.directory.load())),
                Ok(Input::Save(saver)) => {
                    self.savers.push(saver);
                    self.server().handle(now, ServerEvent::Save);
                }
                Ok(Input::Replace(saved, replacer)) => {
                    info!(
                        tick = saved.tick.0,
                        bodies = saved.bodies.len(),
                        "the world is replaced by a saved one"
                    );
                    self.server().handle(now, ServerEvent::Replace(saved));
                    // The new world is on record before the program hears of it.
                    self.pump();
                    let next_ids = self.server().next_ids();
                    if !self.over {
                        let _ = replacer.send(next_ids);
                    }
                }
                Ok(Input::Wake) | Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => break,
            }
            let now = self.start.elapsed();
            if let Some(event) = self.links.as_mut().and_then(|links| links.next_greeting(Instant::now())) {
                self.hear(now, event);
            }
            if self.server().poll_timeout().is_some_and(|due| due <= now) {
                self.server().handle_timeout(now);
            }
            if self.end_requests.take() {
                info!("the world is to end: its data folder has a request");
                self.stop(now);
            }
            self.send_away(now);
            self.pump();
            let given_up = self.links.as_mut().map(Links::take_given_up).unwrap_or_default();
            if !given_up.is_empty() {
                given_up.into_iter().for_each(|event| self.hear(now, event));
                self.pump();
            }
            self.tell_of_drains();
            self.publish();
            if !self.over && self.end_by.is_some_and(|by| by <= Instant::now()) {
                warn!("the last audit is given up: members do not answer");
                self.shared.lock().summary.unaudited = true;
                break;
            }
        }
        let (view, tick) = self.reached();
        let _log = log.enter(view, tick);
        let totals = self.links.take().map(Links::shutdown);
        self.finish(totals);
    }

    fn server(&self) -> MutexGuard<'_, RecordedServer> {
        self.server.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the view of the main group, and the last tick that is on record.
    fn reached(&self) -> (Option<u64>, Tick) {
        let server = self.server();
        (server.view().map(|view| view.number.0), server.tick())
    }

    fn stop(&mut self, now: Duration) {
        self.end_by.get_or_insert(Instant::now() + AUDIT);
        self.server().handle(now, ServerEvent::Stop);
    }

    fn hear(&mut self, now: Duration, event: LinkEvent) {
        match event {
            LinkEvent::Connected(Peer::Client(client), PeerName::Builder(_)) => {
                self.server().handle(now, ServerEvent::MayBuild(client));
            }
            LinkEvent::Connected(..) => {}
            LinkEvent::Disconnected { peer, text, .. } => {
                info!(?peer, text, "a link is gone");
                self.server().handle(now, ServerEvent::Disconnected(peer));
            }
            LinkEvent::Message { from, message } => {
                self.server().handle(now, ServerEvent::Message { from, message });
            }
        }
    }

    /// Disconnects the processes that the user asked to disconnect.
    fn send_away(&mut self, now: Duration) {
        for (who, reason) in self.connections.take_sent_away() {
            info!(%who, reason, "sent away");
            self.links.iter().for_each(|links| links.bar(who, reason.clone()));
            let (node, client) = (who.node(), who.client());
            self.server().handle(now, ServerEvent::SendAway { node, client, reason });
        }
    }

    fn drain(&mut self, now: Duration, node: NodeId, asker: SyncSender<Result<(), DrainError>>) {
        if let Err(error) = self.server().check_drain(node) {
            let _ = asker.try_send(Err(error));
            return;
        }
        info!(%node, "is to be drained: it hands its regions over");
        self.server().handle(now, ServerEvent::Drain(node));
        self.drains.push(Drain { node, asker, is_lost: false });
    }

    /// Reports to the waiting callers which nodes are gone.
    fn tell_of_drains(&mut self) {
        let server = self.server.lock().unwrap_or_else(PoisonError::into_inner);
        self.drains.retain(|drain| {
            match server.is_draining(drain.node) {
                Ok(true) => return true,
                Ok(false) if drain.is_lost => drain.end(Err(DrainError::Lost(drain.node))),
                Ok(false) => drain.end(Ok(())),
                Err(error) => drain.end(Err(error)),
            }
            false
        });
    }

    fn pump(&mut self) {
        loop {
            let output = self.server().poll_output();
            let Some(output) = output else { return };
            let Some(links) = &mut self.links else { return };
            self.metrics.iter().for_each(|metrics| metrics.put_out(&output));
            match output {
                ServerOutput::Send { to, message } => links.send(to, &message),
                ServerOutput::Close { peer, farewell, reason } => {
                    if farewell == Farewell::Refused {
                        warn!(?peer, reason, "a peer is refused");
                    }
                    links.close(peer, farewell.into(), &reason);
                }
                ServerOutput::Store(batch) => {
                    if let Err(error) = self.store(&batch) {
                        return self.fail(error);
                    }
                }
                ServerOutput::Dissolved(group) => info!(%group, "a group is no more"),
                ServerOutput::Expelled(node) => {
                    warn!(%node, "the world goes on without a node");
                    let drained = self.drains.iter_mut().filter(|drain| drain.node == node);
                    drained.for_each(|drain| drain.is_lost = true);
                }
                ServerOutput::Moved(node) => info!(%node, "a node leaves its group, and goes on in another"),
                ServerOutput::Unreached(node) => warn!(
                    %node,
                    "a node and others do not reach each other at the addresses that they gave: it computes the world by itself until they do; \
                     check its --advertise, and what is between"
                ),
                ServerOutput::Verdict { node, tick, finding } => self.tell_of_verdict(node, tick, finding),
                ServerOutput::Began { group, view } if group != self.server().main_group() => {
                    info!(%group, view = view.number.0, members = view.members.len(), "a view begins");
                }
                ServerOutput::Began { view, .. } => {
                    self.began.get_or_insert_with(Instant::now);
                    info!(view = view.number.0, members = view.members.len(), "a view begins");
                    let bodies = movable(&self.server()).count();
                    let mut state = self.shared.lock();
                    state.summary.views += 1;
                    state.summary.bodies = bodies;
                    state.show(Some(&view));
                }
                ServerOutput::Repartitioned { group, view } => {
                    debug!(%group, view = view.number.0, regions = view.allocation.len(), "regions follow the load");
                    if group == self.server().main_group() {
                        let mut state = self.shared.lock();
                        state.summary.repartitions += 1;
                        state.show(Some(&view));
                    }
                }
                // If this was the main group, another may be that by now.
                ServerOutput::Held { group, tick } if self.server().view().is_some() => {
                    info!(%group, tick = tick.0, "a group has lost its nodes; others compute the world");
                }
                ServerOutput::Held { tick, .. } => {
                    warn!(tick = tick.0, "no node is heard of; the world waits for one");
                }
                ServerOutput::Audited(found) => {
                    let summary = &mut self.shared.lock().summary;
                    (summary.lost, summary.doubled) = (found.lost.len(), found.doubled.len());
                    summary.unaudited = found.unanswered;
                }
                ServerOutput::Answered { number, found } => {
                    self.shared.lock().answers.insert(number, found);
                }
                ServerOutput::Contacts(events) => {
                    let mut state = self.shared.lock();
                    keep_newest(&mut state.events.touches, events.touches);
                    keep_newest(&mut state.events.forces, events.forces);
                }
                ServerOutput::Saved(saved) => {
                    for saver in self.savers.drain(..) {
                        // A caller that has waited for too long is gone.
                        let _ = saver.try_send((*saved).clone());
                    }
                }
                ServerOutput::Ended => {
                    if self.forget()
                        && let Some(lock) = &self.folder_lock
                        && let Err(error) = lock.note(false)
                    {
                        warn!(%error, "the data folder says as before that its world is in etcd");
                    }
                    self.over = true;
                }
                ServerOutput::Suspended => {
                    // In etcd a world that has not begun is kept, too: it belongs to the standby servers. The
                    // folder has a lock of its own only there.
                    let kept = self.folder_lock.is_some() || self.server().has_begun();
                    if !kept {
                        self.forget();
                    }
                    let mut state = self.shared.lock();
                    (state.suspended, state.summary.kept) = (true, kept);
                    self.over = true;
                }
            }
        }
    }

    /// Logs what a leader has found out about a participant. A participant that computes otherwise than it
    /// should comes back by a new token only.
    fn tell_of_verdict(&self, node: NodeId, tick: Tick, finding: Finding) {
        let tick = tick.0;
        match finding {
            Finding::Deviates(region) => {
                warn!(%node, %region, tick, "a participant computes otherwise than its leader does from the same, and is sent away");
                let known = self.connections.list();
                let who = known.into_iter().map(|known| known.who).find(|who| who.node() == Some(node));
                let reason = format!("what it computed of {region} in tick {tick} is not right");
                self.links.iter().zip(who).for_each(|(links, who)| links.bar(who, reason.clone()));
            }
            Finding::Contradicts(other) => warn!(
                %node, %other, tick,
                "two participants contradict each other about what one told the other: one of them lies"
            ),
            Finding::GivenUp(Hindrance::Unknown) => info!(
                %node, tick,
                "a participant is verified no longer: what others told it is not known, since it or one of those does not say so, or has died"
            ),
            Finding::GivenUp(Hindrance::Behind) => info!(
                %node, tick,
                "a participant is verified no longer: to compute what it computes is too much for the node that leads, beside its own. Verify fewer \
                 (--verify), or start a dedicated node on a faster machine first: it leads then"
            ),
            Finding::GivenUp(Hindrance::Unled) => info!(
                %node, tick,
                "a participant is verified no longer: no dedicated node leads. Start one (dcd node), and participants are drawn again"
            ),
        }
    }

    fn fail(&mut self, error: DirectoryError) {
        error!(%error, "the server cannot go on");
        self.shared.lock().failure = Some(error.into());
        self.metrics.iter().for_each(|metrics| metrics.failed());
        self.over = true;
    }

    fn store(&mut self, batch: &Batch) -> Result<(), DirectoryError> {
        let begun = self.metrics.as_ref().map(|metrics| (metrics, Instant::now()));
        let revision = self.directory.commit(batch, &[Condition { key: Key::World, at: self.stored }])?;
        if let Some((metrics, begun)) = begun {
            let bytes = batch
                .writes
                .iter()
                .map(|(key, value)| key.to_bytes().len() + value.as_ref().map_or(0, Vec::len));
            metrics.committed(begun.elapsed(), bytes.sum());
        }
        if batch.writes.iter().any(|(key, _)| *key == Key::World) {
            self.stored = Some(revision);
        }
        Ok(())
    }

    /// Clears the directory: a world that has ended, or never began, leaves nothing to go on with. Returns
    /// whether it is clear.
    fn forget(&mut self) -> bool {
        let cleared = self.directory.load().and_then(|entries| {
            let writes = entries.into_iter().map(|entry| (entry.key, None)).collect();
            self.store(&Batch { writes, durable: true })
        });
        if let Err(error) = &cleared {
            warn!(%error, "what is stored of the world stays");
        }
        cleared.is_ok()
    }

    fn publish(&mut self) {
        let now = Instant::now();
        let server = self.server();
        let mut state = self.shared.lock();
        state.turned = Some(now);
        state.summary.tick = server.tick();
        // Links that come back end a silence without a new view. When the world has ended, its last view
        // stays shown.
        if !self.over {
            state.show(server.view());
        }
        drop(server);
        state.summary.seconds = self.began.map_or(0.0, |began| began.elapsed().as_secs_f64());
        drop(state);
        self.metrics.iter().for_each(|metrics| metrics.turned(now));
        if self.count_at <= now || self.over {
            self.count_at = now + COUNT;
            self.count();
        }
        self.shared.changed.notify_all();
    }

    /// Counts the traffic of all links.
    fn count(&self) {
        let Some(links) = &self.links else { return };
        let totals = links.totals();
        let traffic = totals.traffic;
        let mut state = self.shared.lock();
        state.traffic = traffic;
        state.summary.bytes = traffic.bytes_in + traffic.bytes_out;
        drop(state);
        self.metrics.iter().for_each(|metrics| metrics.counted(links.all_totals(totals)));
    }

    fn finish(self, totals: Option<NetTotals>) {
        // Whoever hears of the end may start another server here. Others look at the folder's lock, so it
        // goes last.
        let Self { directory, authority, folder_lock, server, shared, connections, record, .. } = self;
        authority.close_ledger();
        drop(directory);
        drop(folder_lock);
        let mut server = server.lock().unwrap_or_else(PoisonError::into_inner);
        let recorded = server.finish();
        let mut hasher = StateHasher::default();
        for body in movable(&server) {
            hasher.add(body.id, &body.state.pose, &body.state.velocity);
        }
        let mut state = shared.lock();
        state.summary.bodies = movable(&server).count();
        state.summary.state_hash = Some(hasher.finish());
        if let Some(totals) = totals {
            state.traffic = totals.traffic;
            state.summary.bytes = totals.traffic.bytes_in + totals.traffic.bytes_out;
        }
        if let (Err(cause), Some(path)) = (recorded, record) {
            state.failure.get_or_insert(ProcessError::Record { path, cause });
        }
        state.over = true;
        let reason = match (&state.failure, state.suspended) {
            (Some(failure), _) => Reason::new(Cause::Failed, failure.to_string()),
            (None, true) => Reason::new(Cause::Left, SUSPENDED),
            (None, false) => Reason::new(Cause::WorldEnded, WORLD_ENDED),
        };
        drop(state);
        shared.changed.notify_all();
        connections.end(reason);
    }
}

/// Adds to new bodies those of their shapes that are not on record. Only here it is known which these are:
/// the server forgets shapes that no body has, and does so between two events.
fn bring_shapes(ops: &mut [BuildOp], known: &ShapeLibrary, record: &Record) {
    for op in ops {
        if let BuildOp::Insert { bodies, shapes, .. } = op {
            let new = known.records_of(bodies.iter()).into_iter();
            shapes.extend(
                new.filter(|(hash, _)| record.shape(*hash).is_none()).map(|(_, shape)| shape.clone()),
            );
        }
    }
}

fn keep_newest<T>(kept: &mut Vec<T>, new: Vec<T>) {
    kept.extend(new);
    kept.drain(..kept.len().saturating_sub(MAX_EVENTS));
}

fn movable(server: &Server) -> impl Iterator<Item = &BodyRecord> {
    server.record().present().filter(|body| body.traits.kind != BodyKind::Fixed)
}
