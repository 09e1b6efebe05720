//! Computes a world whose regions have one host each, as on nodes, so that their messages to each other can
//! be late or lost. What changes who holds and owns a body always arrives, as it does over the network.
//! Faults touch only what messages say of the motion of bodies.

use std::collections::VecDeque;

use dcd::physics::{HostError, Measured, Partition, RegionHost, View};
use dcd::protocol::{BorderMessage, CopyState, SharedState};
use dcd::rapier3d::prelude::RigidBody;
use dcd::runtime::{WorldConfig, WorldError};
use dcd::scene::Scene;
use dcd::space::{BodyId, RegionId};

/// A fault of the exchanges.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Fault {
    /// The number of exchanges by which all motion comes late.
    pub late: usize,
    /// The number of exchanges of which one is lost; 0 loses none.
    pub lost_one_in: u64,
    /// Says whether a lost exchange is lost only to regions of higher rank, so that holders disagree on what
    /// happened. Otherwise all holders skip it.
    pub one_way: bool,
}

impl Fault {
    /// All holders skip every tenth exchange.
    pub(crate) const SKIPPED: Self = Self { late: 0, lost_one_in: 10, one_way: false };
    /// Each exchange brings the motion of the exchange before.
    pub(crate) const LATE: Self = Self { late: 1, lost_one_in: 0, one_way: false };
    /// Every tenth exchange reaches only regions of lower rank than the sender.
    pub(crate) const LOST_ONE_WAY: Self = Self { one_way: true, ..Self::SKIPPED };
}

/// A world with one host per region.
pub(crate) struct Fleet {
    hosts: Vec<RegionHost>,
    fault: Option<Fault>,
    exchanges: u64,
    /// The motion of past exchanges that is under way, by sender and receiver, the oldest exchange first.
    under_way: VecDeque<Vec<Motion>>,
}

struct Motion {
    from: RegionId,
    to: RegionId,
    states: Vec<SharedState>,
    copies: Vec<CopyState>,
}

impl Fleet {
    /// Builds the scene, cut as the configuration says.
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
        let mut fleet = Self { hosts, fault, exchanges: 0, under_way: VecDeque::new() };
        fleet.deliver(None)?;
        Ok(fleet)
    }

    /// Computes one tick.
    pub(crate) fn step(&mut self) -> Result<(), WorldError> {
        let rounds = self.hosts.iter().map(RegionHost::rounds_wanted).max().unwrap_or(1);
        self.hosts.iter_mut().for_each(|host| host.set_rounds(rounds));
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
            host.update(body, |copy| change(copy)).expect("what is dynamic stays so");
        }
    }

    /// Returns the number of copies of bodies that are held by regions that do not own them.
    pub(crate) fn ghosts(&self) -> usize {
        self.hosts.iter().flat_map(RegionHost::regions).map(|region| region.ghost_count()).sum()
    }

    /// Returns the number of changes of owner so far.
    pub(crate) fn transfers(&self) -> u64 {
        self.hosts.iter().map(RegionHost::transfers).sum()
    }

    fn deliver(&mut self, fault: Option<Fault>) -> Result<(), WorldError> {
        let mut messages: Vec<_> = self.hosts.iter().flat_map(RegionHost::outgoing).cloned().collect();
        if let Some(fault) = fault {
            self.delay(&mut messages, fault.late);
            if fault.lost_one_in > 0 && self.exchanges.is_multiple_of(fault.lost_one_in) {
                let lost = messages.iter_mut().filter(|message| !fault.one_way || message.from < message.to);
                lost.for_each(BorderMessage::forget_motion);
            }
        }
        for message in messages {
            let to = self.hosts.iter_mut().find(|host| host.regions().next().unwrap().id() == message.to);
            to.expect("messages go to regions").accept(message);
        }
        for host in &mut self.hosts {
            host.exchange()?;
        }
        Ok(())
    }

    /// Replaces the motion in each message by that of so many exchanges before.
    fn delay(&mut self, messages: &mut Vec<BorderMessage>, exchanges: usize) {
        let now = messages.iter_mut().map(|message| Motion {
            from: message.from,
            to: message.to,
            states: std::mem::take(&mut message.states),
            copies: std::mem::take(&mut message.copies),
        });
        self.under_way.push_back(now.collect());
        if self.under_way.len() <= exchanges {
            return;
        }
        for motion in self.under_way.pop_front().expect("one was put in") {
            let Motion { from, to, states, copies } = motion;
            let place = messages.iter().position(|message| (message.from, message.to) == (from, to));
            // A region that has nothing to say now had something to say then.
            let place = place.unwrap_or_else(|| {
                messages.push(BorderMessage { from, to, ..BorderMessage::default() });
                messages.len() - 1
            });
            (messages[place].states, messages[place].copies) = (states, copies);
        }
    }
}

/// A message from which a fault can take the motion.
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
    use dcd::runtime::{LocalWorld, Partitioning};
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
        let mut world = LocalWorld::from_scene(&scene, config).unwrap();
        for _ in 0..60 {
            world.step().unwrap();
        }
        assert_eq!(hash_after(60, None), world.state_hash());
    }

    #[test]
    fn what_is_late_by_more_is_another_run_and_what_is_late_by_nothing_is_the_same() {
        let late = |late| hash_after(60, Some(Fault { late, ..Fault::LATE }));
        assert_eq!(late(0), hash_after(60, None));
        assert_ne!(late(1), late(2));
    }

    #[test]
    fn every_fault_changes_something_and_not_before_it_occurs() {
        let sound = hash_after(60, None);
        for fault in [Fault::SKIPPED, Fault::LATE, Fault::LOST_ONE_WAY] {
            assert_ne!(hash_after(60, Some(fault)), sound, "{fault:?}");
        }
        for fault in [Fault::SKIPPED, Fault::LOST_ONE_WAY] {
            assert_eq!(hash_after(4, Some(fault)), hash_after(4, None), "{fault:?}");
        }
    }
}
