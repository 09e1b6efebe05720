//! A world whose regions are each computed by a host of their own, as on nodes, so that what they tell each other can be
//! late or lost. What changes who holds and owns a body always arrives, as it does over the network: only the words on how
//! bodies moved are touched.

use dcd::physics::{HostError, Measured, Partition, RegionHost, View};
use dcd::protocol::{BorderMessage, CopyState, SharedState};
use dcd::rapier3d::prelude::RigidBody;
use dcd::runtime::{WorldConfig, WorldError};
use dcd::scene::Scene;
use dcd::space::{BodyId, RegionId};

/// What is wrong with exchanges.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Fault {
    /// All holders skip every tenth one.
    Skipped,
    /// Each brings what was to come with the one before.
    Late,
    /// Of every tenth one, only what goes to regions of lower rank arrives.
    LostOneWay,
}

/// One host a region.
pub(crate) struct Fleet {
    hosts: Vec<RegionHost>,
    fault: Option<Fault>,
    exchanges: u64,
    /// Of the exchange before: who spoke to whom, and what of motion.
    before: Vec<Motion>,
}

struct Motion {
    from: RegionId,
    to: RegionId,
    states: Vec<SharedState>,
    copies: Vec<CopyState>,
}

impl Fleet {
    /// The scene, cut as the configuration says.
    pub(crate) fn new(scene: &Scene, config: &WorldConfig, fault: Option<Fault>) -> Result<Self, WorldError> {
        let partition = Partition::new(config.tree()?, config.halo_m);
        let hosts = partition
            .leaves()
            .iter()
            .map(|&leaf| {
                let mut host = RegionHost::new(partition.clone(), config.step, 1, &[leaf])?;
                let (bodies, joints) = scene.records(host.shapes_mut())?;
                host.insert(bodies, &joints)?;
                host.announce();
                Ok(host)
            })
            .collect::<Result<_, HostError>>()?;
        let mut fleet = Self { hosts, fault, exchanges: 0, before: Vec::new() };
        fleet.deliver(None)?;
        Ok(fleet)
    }

    /// One tick.
    pub(crate) fn step(&mut self) -> Result<(), WorldError> {
        let rounds = self.hosts[0].settings().exchanges;
        for _ in 0..rounds {
            self.hosts.iter_mut().for_each(RegionHost::compute);
            self.exchanges += 1;
            self.deliver(self.fault)?;
        }
        for host in &mut self.hosts {
            host.clear_events();
            host.end_tick();
        }
        Ok(())
    }

    /// Changes a body in place wherever it is held.
    pub(crate) fn update(&mut self, body: BodyId, change: impl Fn(&mut RigidBody)) {
        for host in &mut self.hosts {
            host.update(body, |copy| change(copy));
        }
    }

    /// Copies of bodies held by regions that do not own them.
    pub(crate) fn replicas(&self) -> usize {
        self.hosts.iter().flat_map(RegionHost::regions).map(|region| region.replica_count()).sum()
    }

    /// Changes of owner so far.
    pub(crate) fn transfers(&self) -> u64 {
        self.hosts.iter().map(RegionHost::transfers).sum()
    }

    fn deliver(&mut self, fault: Option<Fault>) -> Result<(), WorldError> {
        let mut messages: Vec<_> = self.hosts.iter().flat_map(RegionHost::outgoing).cloned().collect();
        let tenth = self.exchanges.is_multiple_of(10);
        match fault {
            Some(Fault::Skipped) if tenth => messages.iter_mut().for_each(BorderMessage::forget_motion),
            Some(Fault::LostOneWay) if tenth => {
                let lost = messages.iter_mut().filter(|message| message.from < message.to);
                lost.for_each(BorderMessage::forget_motion);
            }
            Some(Fault::Late) => self.delay(&mut messages),
            _ => {}
        }
        for message in messages {
            let to = self.hosts.iter_mut().find(|host| host.regions()[0].id() == message.to);
            to.expect("messages go to regions").accept(message);
        }
        for host in &mut self.hosts {
            host.exchange()?;
        }
        Ok(())
    }

    /// Gives each message the motion of the one before it.
    fn delay(&mut self, messages: &mut Vec<BorderMessage>) {
        for Motion { from, to, .. } in &self.before {
            // Whoever has nothing to say now said something before.
            if !messages.iter().any(|message| (message.from, message.to) == (*from, *to)) {
                messages.push(BorderMessage { from: *from, to: *to, ..BorderMessage::default() });
            }
        }
        let mut now = Vec::new();
        for message in messages.iter_mut() {
            let (from, to) = (message.from, message.to);
            let mut motion = Motion { from, to, states: Vec::new(), copies: Vec::new() };
            if let Some(before) = self.before.iter_mut().find(|before| (before.from, before.to) == (from, to))
            {
                std::mem::swap(&mut motion.states, &mut before.states);
                std::mem::swap(&mut motion.copies, &mut before.copies);
            }
            std::mem::swap(&mut motion.states, &mut message.states);
            std::mem::swap(&mut motion.copies, &mut message.copies);
            now.push(motion);
        }
        self.before = now;
    }
}

/// What a fault can take from a message.
trait Lossy {
    fn forget_motion(&mut self);
}

impl Lossy for BorderMessage {
    fn forget_motion(&mut self) {
        self.states.clear();
        self.copies.clear();
    }
}

impl Measured for Fleet {
    fn views(&self) -> Vec<View<'_>> {
        self.hosts.iter().flat_map(Measured::views).collect()
    }
}

#[cfg(test)]
mod tests {
    use dcd::physics::Coupling;
    use dcd::runtime::{DcdWorld, Partitioning};
    use dcd::scene::Params;
    use dcd::space::Axis;

    use super::*;

    fn tower() -> (Scene, WorldConfig) {
        let scene = Scene::named("tower", &Params::new().with("sleep", 0)).unwrap();
        let mut config = WorldConfig::for_scene(&scene);
        config.partitioning = Partitioning::Cuts(vec![(Axis::Y, 4.5)]);
        config.step = config.step.with_coupling(Coupling::Overlap);
        (scene, config)
    }

    fn hash_after(ticks: usize, fault: Option<Fault>) -> u64 {
        let (scene, config) = tower();
        let mut fleet = Fleet::new(&scene, &config, fault).unwrap();
        for _ in 0..ticks {
            fleet.step().unwrap();
        }
        fleet.state_hash()
    }

    #[test]
    fn where_nothing_is_late_or_lost_hosts_apart_do_what_one_host_does() {
        let (scene, config) = tower();
        let mut world = DcdWorld::from_scene(&scene, config).unwrap();
        for _ in 0..60 {
            world.step().unwrap();
        }
        assert_eq!(hash_after(60, None), world.state_hash());
    }

    #[test]
    fn every_fault_changes_something_and_not_before_it_occurs() {
        let sound = hash_after(60, None);
        for fault in [Fault::Skipped, Fault::Late, Fault::LostOneWay] {
            assert_ne!(hash_after(60, Some(fault)), sound, "{fault:?}");
        }
        for fault in [Fault::Skipped, Fault::LostOneWay] {
            assert_eq!(hash_after(4, Some(fault)), hash_after(4, None), "{fault:?}");
        }
    }
}
