//! Gives a node's state machine its events, and records them.

use std::path::PathBuf;
use std::time::Duration;

use crate::cluster::{Node, NodeEvent, NodeOutput, ReplicationEvent};
use crate::recording::{Readout, Recorder, digests_of};
use crate::runtime::ProcessError;
use crate::space::Tick;

/// A node's state machine, recorded if a file was named.
pub(super) struct RecordedNode {
    node: Node,
    /// The recorder, with the path of its file.
    recorder: Option<(PathBuf, Recorder)>,
}

impl RecordedNode {
    pub(super) fn new(node: Node, recorder: Option<(PathBuf, Recorder)>) -> Self {
        Self { node, recorder }
    }

    pub(super) fn handle(&mut self, now: Duration, event: NodeEvent) {
        if let Some((_, recorder)) = &mut self.recorder {
            recorder.node_event(now, &event);
        }
        self.node.handle(now, event);
    }

    /// Lets time pass, if anything is due.
    pub(super) fn handle_timeout(&mut self, now: Duration) {
        if self.node.poll_timeout().is_some_and(|due| due <= now) {
            self.recorder.iter_mut().for_each(|(_, recorder)| recorder.node_timeout(now));
            self.node.handle_timeout(now);
        }
    }

    /// Records what the physics has computed in a tick.
    pub(super) fn computed(&mut self, now: Duration, tick: Tick, regions: &impl Readout) {
        if let Some((_, recorder)) = &mut self.recorder {
            recorder.settled(now, tick, &digests_of(regions));
        }
    }

    /// Ends the recording; returns the error if any of it could not be written.
    pub(super) fn finish(&mut self) -> Result<(), ProcessError> {
        let Some((path, recorder)) = self.recorder.take() else { return Ok(()) };
        recorder.finish().map_err(|cause| ProcessError::Record { path, cause })
    }

    /// Returns the state machine, to be read.
    pub(super) fn node(&self) -> &Node {
        &self.node
    }

    pub(super) fn poll_timeout(&self) -> Option<Duration> {
        self.node.poll_timeout()
    }

    pub(super) fn poll_output(&mut self) -> Option<NodeOutput> {
        self.node.poll_output()
    }

    pub(super) fn take_replication_events(&mut self) -> Vec<ReplicationEvent> {
        self.node.take_replication_events()
    }
}
