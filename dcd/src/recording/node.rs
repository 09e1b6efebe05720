//! Replays a node: gives its recorded events to a machine and physics of its own.

use std::collections::{BTreeMap, VecDeque};

use super::acts::Acts;
use super::entries::Entries;
use super::entry::{NodeEntry, NodeSeed};
use super::replayed::{Disturbance, Flip, Replayed, Settled, Who};
use super::{Cut, Maker, Physics, Readout, RecordingError, digests_of};
use crate::cluster::{Node, NodeConfig, NodeEvent, NodeOutput, PhysicsCommand, PhysicsEvent};
use crate::protocol::{Message, ToNode};
use crate::space::{BodyId, RegionId, Tick};

/// The replay of one node.
pub(super) struct NodeReplay {
    entries: Entries,
    /// The incarnation of the world.
    world: Option<u64>,
    node: Node,
    physics: Box<dyn Physics>,
    /// Answers of the physics that the machine was not given yet.
    answers: VecDeque<PhysicsEvent>,
    /// The same for what is computed once more of other members, by the number of the run.
    verified: BTreeMap<u64, VecDeque<PhysicsEvent>>,
    /// The digests of completed ticks that were not compared yet.
    computed: VecDeque<(Tick, Vec<(RegionId, u64)>)>,
    disturbance: Disturbance,
    acts: Acts,
}

impl NodeReplay {
    pub(super) fn new(entries: Entries, seed: &NodeSeed, physics: Box<dyn Physics>) -> Self {
        Self {
            entries,
            world: None,
            node: Node::new(NodeConfig::from(seed)),
            physics,
            answers: VecDeque::new(),
            verified: BTreeMap::new(),
            computed: VecDeque::new(),
            disturbance: Disturbance::default(),
            acts: Acts::default(),
        }
    }

    fn astray(&self) -> RecordingError {
        RecordingError::Astray { tick: self.node.tick().0 }
    }

    /// Returns the next answer of the physics, with the recorded times in it.
    fn answer(
        &mut self,
        compute_us: u32,
        step_us: &[f64],
        region_ms: &[[f32; 3]],
    ) -> Result<PhysicsEvent, RecordingError> {
        let mut event = self.answers.pop_front().ok_or_else(|| self.astray())?;
        if let PhysicsEvent::Settled { stats, load, regions, .. } = &mut event {
            stats.compute_us = compute_us;
            regions.iter_mut().zip(region_ms).for_each(|(state, &recorded)| state.set_times_ms(recorded));
            let regions = load.iter_mut().flat_map(|load| &mut load.regions);
            regions.zip(step_us).for_each(|(region, &recorded)| region.step_us = recorded);
        }
        Ok(event)
    }

    /// Carries out what the machine asks of its physics.
    fn compute(&mut self) -> Result<(), RecordingError> {
        while let Some(output) = self.node.poll_output() {
            let NodeOutput::Physics(command) = output else { continue };
            let tick = tick_of(&command);
            self.acts.note(&command);
            let answer = self.physics.execute(command).map_err(RecordingError::Physics)?;
            if let (Some(tick), Some(PhysicsEvent::Settled { .. })) = (tick, &answer) {
                self.disturbance.happen(tick, &mut *self.physics);
                self.computed.push_back((tick, digests_of(&*self.physics)));
            }
            match answer {
                Some(PhysicsEvent::Verified { run, .. }) => {
                    self.verified.entry(run).or_default().extend(answer)
                }
                _ => self.answers.extend(answer),
            }
        }
        Ok(())
    }
}

impl Replayed for NodeReplay {
    fn who(&self) -> Who {
        Who::Node(self.node.id())
    }

    fn maker(&self) -> &Maker {
        self.entries.maker()
    }

    fn cut(&self) -> Option<Cut> {
        self.entries.cut()
    }

    fn hash(&self) -> [u8; 8] {
        self.entries.hash()
    }

    fn world(&self) -> Option<u64> {
        self.world
    }

    fn readout(&self) -> &dyn Readout {
        &*self.physics
    }

    fn flip(&mut self, flip: Flip) {
        self.disturbance.set(flip);
    }

    fn has_flipped(&self) -> bool {
        self.disturbance.is_done()
    }

    fn acted_on(&self, body: BodyId) -> Vec<String> {
        self.acts.on(body)
    }

    fn advance(&mut self) -> Result<Option<Settled>, RecordingError> {
        while let Some(entry) = self.entries.next()? {
            let event = match entry {
                NodeEntry::Connected(peer) => NodeEvent::Connected(peer),
                NodeEntry::Disconnected(peer) => NodeEvent::Disconnected(peer),
                NodeEntry::Message { from, message } => {
                    if let Message::ToNode(ToNode::Welcome { incarnation, .. }) = message {
                        self.world = Some(incarnation);
                    }
                    NodeEvent::Message { from, message }
                }
                NodeEntry::Client(message) => NodeEvent::Client(message),
                NodeEntry::Leave => NodeEvent::Leave,
                NodeEntry::Answered { compute_us, step_us, region_ms } => {
                    NodeEvent::Physics(self.answer(compute_us, &step_us, &region_ms)?)
                }
                NodeEntry::Verified(run) => {
                    let answer = self.verified.get_mut(&run).and_then(VecDeque::pop_front);
                    NodeEvent::Physics(answer.ok_or_else(|| self.astray())?)
                }
                NodeEntry::Timeout => {
                    self.node.handle_timeout(self.entries.now());
                    self.compute()?;
                    continue;
                }
                NodeEntry::Settled(digests) => {
                    let (tick, recorded) = self.entries.digests(digests);
                    let (done, replayed) = self.computed.pop_front().ok_or_else(|| self.astray())?;
                    if done != tick {
                        return Err(self.astray());
                    }
                    return Ok(Some(Settled { tick, recorded, replayed }));
                }
            };
            self.node.handle(self.entries.now(), event);
            self.compute()?;
        }
        Ok(None)
    }
}

/// Returns the tick that a command may complete.
pub fn tick_of(command: &PhysicsCommand) -> Option<Tick> {
    if let PhysicsCommand::Accept { tick, .. } = command { Some(*tick) } else { None }
}
