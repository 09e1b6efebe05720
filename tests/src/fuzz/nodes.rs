//! Gives nodes events that no honest process sends, as members and as leaders of a group. A stand-in computes
//! their regions.

use std::collections::BTreeMap;
use std::time::Duration;

use dcd::cluster::{Node, NodeConfig, NodeEvent, NodeOutput, PhysicsCommand, PhysicsEvent, TickStats};
use dcd::protocol::{Message, decode, encode};
use dcd::recording::{BodyBits, Physics, Readout};
use dcd::{BodyId, NodeId, RegionId};

use super::script::{Event, Kind, events};

/// The most times in a row that a process may wake itself.
const MOST_WAKES: usize = 64;
/// The most commands that a node may give its physics in a row.
const MOST_COMMANDS: usize = 256;

/// Returns the configuration of a node.
#[must_use]
pub(super) fn node_config(id: NodeId) -> NodeConfig {
    NodeConfig {
        id,
        address: ([127, 0, 0, 1], 7_000 + id.0 as u16).into(),
        client: None,
        interest: None,
        checkpoint_every: 4,
        patience: Duration::from_millis(100),
    }
}

/// Executes a node's physics commands until it gives no more. Returns the node's other outputs.
///
/// # Panics
/// When the physics fails: nothing that another process sends may end this one.
pub(super) fn perform(now: Duration, node: &mut Node, physics: &mut dyn Physics) -> Vec<NodeOutput> {
    let (mut others, mut commands) = (Vec::new(), 0);
    while let Some(output) = node.poll_output() {
        let NodeOutput::Physics(command) = output else {
            others.push(output);
            continue;
        };
        commands += 1;
        assert!(commands <= MOST_COMMANDS, "the physics is asked without end: {command:?}");
        if let Some(answer) = physics.execute(command).expect("nothing ends a process") {
            node.handle(now, NodeEvent::Physics(answer));
        }
    }
    others
}

/// Gives a node the events of a script, except those for which `skips` returns true.
pub(super) fn play(node: &mut Node, physics: &mut dyn Physics, script: &[u8], skips: fn(&Event<'_>) -> bool) {
    let mut now = Duration::ZERO;
    for event in events(script).filter(|event| !skips(event)) {
        now += event.after();
        wake(&mut now, node, physics);
        let peer = event.peer();
        match event.kind() {
            Kind::Said => {
                let Ok(message) = decode(event.bytes) else { continue };
                node.handle(now, NodeEvent::Message { from: peer, message });
            }
            Kind::Connected => node.handle(now, NodeEvent::Connected(peer)),
            Kind::Disconnected => node.handle(now, NodeEvent::Disconnected(peer)),
            Kind::Waited => {}
            Kind::Wanted => node.handle(now, NodeEvent::Leave),
        }
        check(&perform(now, node, physics));
    }
}

/// Handles a node's timeouts for as long as it is due.
fn wake(now: &mut Duration, node: &mut Node, physics: &mut dyn Physics) {
    for _ in 0..MOST_WAKES {
        if node.poll_timeout().is_none_or(|at| *now < at) {
            return;
        }
        node.handle_timeout(*now);
        check(&perform(*now, node, physics));
    }
    panic!("it is due at {:?}, however often it is woken at {now:?}", node.poll_timeout());
}

fn check(outputs: &[NodeOutput]) {
    for output in outputs {
        if let NodeOutput::Send { message, .. } = output {
            check_said(message);
        }
    }
}

/// Checks that an honest process can decode a message.
pub(super) fn check_said(message: &Message) {
    if let Err(error) = decode(&encode(message)) {
        panic!("others refuse what is said ({error}): {message:?}");
    }
}

/// Runs the node that leads its group.
pub(super) fn leader(script: &[u8]) {
    play(&mut Node::new(node_config(NodeId(1))), &mut Answering::default(), script, |_| false);
}

/// Runs a node that does not lead its group.
pub(super) fn member(script: &[u8]) {
    play(&mut Node::new(node_config(NodeId(2))), &mut Answering::default(), script, |_| false);
}

/// Physics that computes nothing and answers each command in the required form.
#[derive(Default)]
struct Answering {
    rounds_left: u32,
    /// The physics of each run that is computed again to verify it.
    runs: BTreeMap<u64, Self>,
}

impl Physics for Answering {
    fn execute(&mut self, command: PhysicsCommand) -> Result<Option<PhysicsEvent>, String> {
        let computed = || {
            let neighbours = (0..16).map(RegionId).collect();
            Some(PhysicsEvent::Computed { outgoing: Vec::new(), neighbours, removed: Vec::new() })
        };
        Ok(match command {
            PhysicsCommand::World(_)
            | PhysicsCommand::Load(_)
            | PhysicsCommand::Anew
            | PhysicsCommand::Repartition { .. }
            | PhysicsCommand::Return => None,
            PhysicsCommand::Rebuild { .. } => {
                self.rounds_left = 1;
                computed()
            }
            PhysicsCommand::Step { rounds, .. } => {
                self.rounds_left = rounds;
                computed()
            }
            PhysicsCommand::Accept { .. } => {
                self.rounds_left -= 1;
                if self.rounds_left > 0 { computed() } else { Some(settled()) }
            }
            PhysicsCommand::Verify { run, command: None } => {
                self.runs.remove(&run);
                None
            }
            PhysicsCommand::Verify { run, command: Some(command) } => {
                let event = self.runs.entry(run).or_default().execute(*command)?;
                event.map(|event| PhysicsEvent::Verified { run, event: Some(Box::new(event)) })
            }
            PhysicsCommand::Drain { .. } => Some(PhysicsEvent::Drained),
            PhysicsCommand::Speculate(_) => Some(PhysicsEvent::Speculated(Vec::new())),
            PhysicsCommand::Survey => Some(PhysicsEvent::Surveyed(Vec::new())),
            PhysicsCommand::Fetch(_) => Some(PhysicsEvent::Found(Vec::new())),
        })
    }
}

fn settled() -> PhysicsEvent {
    PhysicsEvent::Settled {
        rounds_wanted: 1,
        stats: TickStats::default(),
        holds: Vec::new(),
        events: Vec::new(),
        answers: Vec::new(),
        report: Vec::new(),
        checkpoint: Vec::new(),
        load: None,
        regions: Vec::new(),
    }
}

impl Readout for Answering {
    fn regions(&self) -> Vec<RegionId> {
        Vec::new()
    }

    fn bodies(&self, _region: RegionId) -> Box<dyn Iterator<Item = (BodyId, BodyBits)> + '_> {
        Box::new(std::iter::empty())
    }

    fn set(&mut self, _body: BodyId, _bits: &BodyBits) -> bool {
        false
    }

    fn touching(&self, _body: BodyId) -> Vec<BodyId> {
        Vec::new()
    }
}
