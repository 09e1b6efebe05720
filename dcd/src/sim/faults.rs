//! Defines named fault profiles. Each makes a schedule from a seed: faults at seeded instants, then a calm
//! end.

mod planner;
mod words;

use std::fmt;
use std::str::FromStr;
use std::time::Duration;

use self::planner::Planner;
use super::{NetworkConditions, Path, Random, Skew};
use crate::space::Balance;

/// A fault profile: a row of the fault table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum FaultProfile {
    /// Nothing goes wrong.
    None,
    /// 1 % of packets are lost.
    Loss1,
    /// 5 % of packets are lost.
    Loss5,
    /// 20 % of packets are lost.
    Loss20,
    /// Packets take 100 ± 50 ms.
    Delay,
    /// 4 % of packets take 50 ms more than those after them.
    Reorder,
    /// 5 % of packets arrive twice.
    Duplicate,
    /// Some processes cannot reach the others for a second.
    Partition1,
    /// The same as [`Self::Partition1`], for 5 s.
    Partition5,
    /// The same as [`Self::Partition1`], for 30 s.
    Partition30,
    /// Nothing passes one way, for up to 8 s.
    OneWay,
    /// Nodes are killed.
    KillNode,
    /// Leaders are killed.
    KillLeader,
    /// The server is killed, and started again from its disk.
    KillServer,
    /// Processes of any role stop for up to 12 s, then go on.
    Stop,
    /// Clocks differ by up to ± 10 s and run up to 500 ppm fast or slow. A node is killed.
    ClockSkew,
    /// Members may be 6 ticks out of step, 40 ± 10 ms apart. Depending on the seed, nodes or leaders are
    /// killed, cut off or stopped.
    Lag,
    /// There are three groups, 60 ms apart. Nodes or leaders of any of them are killed.
    GroupsKill,
    /// The same three groups. Their server is killed, and started again from its disk.
    GroupsServer,
    /// The same three groups. Processes of any role are cut off for 5 s, or stop for up to 12 s.
    GroupsCut,
    /// Regions follow a load that wanders, every third of a second. Depending on the seed, nothing, kills,
    /// cuts or loss come in addition.
    Rebalance,
    /// One node becomes eight, each of which gets a region, with the same additions as [`Self::Rebalance`].
    Grow,
    /// Eight nodes become one, and their regions one, with the same additions.
    Shrink,
    /// A node is ten times slower, and gets less to do, with the same additions.
    SlowNode,
    /// The server's program saves the world and goes back to the save, with the same additions.
    Restore,
    /// Loss, reordering, duplicates and skewed clocks, with cuts, kills, stops and slow processes, several at
    /// a time, in one group. In half of the seeds regions follow the load.
    All,
}

/// The recovery and accuracy that must hold under a profile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Promise {
    /// The longest time after the end of the last fault until the group computes on in one membership of live
    /// nodes.
    pub recovery: Duration,
    /// The longest time without a tick of the main group while nothing has gone wrong that it has not
    /// recovered from.
    pub pause: Duration,
    /// Says whether no live member may be evicted, because all live members reach one another.
    pub no_eviction: bool,
    /// The largest error of the estimate of the server's clock, if that is checked.
    pub clock_error: Option<Duration>,
    /// The bound on the age of clients' states of their avatars, which 99 of 100 samples over all seeds keep.
    pub staleness: Option<Duration>,
}

impl Promise {
    /// Returns whether the age that 99 of 100 samples did not exceed, milliseconds, is within the bound. It
    /// is where there are no samples, or no bound.
    pub fn is_fresh(&self, staleness_ms: Option<u32>) -> bool {
        let age = staleness_ms.map(|ms| Duration::from_millis(ms.into()));
        self.staleness.zip(age).is_none_or(|(bound, age)| age < bound)
    }
}

impl FaultProfile {
    /// All profiles in the order of the table.
    pub const TABLE: [Self; 26] = [
        Self::None,
        Self::Loss1,
        Self::Loss5,
        Self::Loss20,
        Self::Delay,
        Self::Reorder,
        Self::Duplicate,
        Self::Partition1,
        Self::Partition5,
        Self::Partition30,
        Self::OneWay,
        Self::KillNode,
        Self::KillLeader,
        Self::KillServer,
        Self::Stop,
        Self::ClockSkew,
        Self::Lag,
        Self::GroupsKill,
        Self::GroupsServer,
        Self::GroupsCut,
        Self::Rebalance,
        Self::Grow,
        Self::Shrink,
        Self::SlowNode,
        Self::Restore,
        Self::All,
    ];

    /// Returns the name of the profile.
    pub const fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Loss1 => "loss-1",
            Self::Loss5 => "loss-5",
            Self::Loss20 => "loss-20",
            Self::Delay => "delay",
            Self::Reorder => "reorder",
            Self::Duplicate => "duplicate",
            Self::Partition1 => "partition-1",
            Self::Partition5 => "partition-5",
            Self::Partition30 => "partition-30",
            Self::OneWay => "one-way",
            Self::KillNode => "kill-node",
            Self::KillLeader => "kill-leader",
            Self::KillServer => "kill-server",
            Self::Stop => "stop",
            Self::ClockSkew => "clock-skew",
            Self::Lag => "lag",
            Self::GroupsKill => "groups-kill",
            Self::GroupsServer => "groups-server",
            Self::GroupsCut => "groups-cut",
            Self::Rebalance => "rebalance",
            Self::Grow => "grow",
            Self::Shrink => "shrink",
            Self::SlowNode => "slow-node",
            Self::Restore => "restore",
            Self::All => "all",
        }
    }

    /// Returns a short description of the faults.
    pub const fn summary(self) -> &'static str {
        match self {
            Self::None => "nothing goes wrong",
            Self::Loss1 => "1 % of packets are lost",
            Self::Loss5 => "5 % of packets are lost",
            Self::Loss20 => "20 % of packets are lost",
            Self::Delay => "packets take 100 ± 50 ms",
            Self::Reorder => "4 % of packets take 50 ms longer, and are overtaken",
            Self::Duplicate => "5 % of packets arrive twice",
            Self::Partition1 => "some processes cannot reach the others for 1 s, again and again",
            Self::Partition5 => "the same for 5 s",
            Self::Partition30 => "the same for 30 s",
            Self::OneWay => "nothing passes one way for up to 8 s",
            Self::KillNode => "nodes are killed, also in the middle of transfers and view changes",
            Self::KillLeader => "leaders are killed",
            Self::KillServer => "the server is killed, and started again from its disk",
            Self::Stop => "processes of any role stop for up to 12 s, and go on",
            Self::ClockSkew => "clocks differ by up to 10 s and run 500 ppm fast or slow; a node is killed",
            Self::Lag => "6 ticks out of step, 40 ± 10 ms apart; nodes or leaders killed, cut off, stopped",
            Self::GroupsKill => {
                "three groups, 60 ms apart, each of so many nodes; nodes or leaders are killed"
            }
            Self::GroupsServer => "the same groups; the server is killed, and started again from its disk",
            Self::GroupsCut => "the same groups; processes of any role cut off for 5 s, or stopped",
            Self::Rebalance => {
                "regions follow a load that wanders; with nothing, kills, cuts or loss beside that"
            }
            Self::Grow => "one node becomes eight, each gets a region; with the same beside that",
            Self::Shrink => "eight nodes become one, and their regions too; with the same beside that",
            Self::SlowNode => "a node is ten times slower and gets less to do; with the same beside that",
            Self::Restore => {
                "the world is saved and goes back to that, three times; with the same beside that"
            }
            Self::All => "anything of that, several at a time, and slow processes",
        }
    }

    /// Returns the promise that must hold under this profile.
    pub fn promise(self) -> Promise {
        let recovery_s = match self {
            Self::KillLeader => 2,
            Self::KillServer | Self::GroupsServer => 10,
            // Loss, kills and cuts come together, and their costs add up.
            Self::All => 15,
            // Nodes come or leave while others are cut off. A change of members waits for these until they
            // are given up.
            Self::Grow | Self::Shrink => 8,
            // All nodes begin anew, as if the server had no memory.
            Self::Restore => 8,
            _ => 3,
        };
        let has_faults = self >= Self::Partition1 && self != Self::ClockSkew;
        Promise {
            recovery: Duration::from_secs(recovery_s),
            // Where a fifth is lost, an exchange may need several attempts, each twice as late as the one
            // before.
            pause: Duration::from_secs(if self == Self::Loss20 { 8 } else { 3 }),
            // At a loss of a fifth, five packets in a row are lost sooner or later, and a process that is
            // silent for seconds seems to hang.
            no_eviction: !has_faults && self != Self::Loss20,
            clock_error: (self == Self::ClockSkew).then_some(Duration::from_millis(5)),
            staleness: (self == Self::Loss5).then_some(Duration::from_millis(250)),
        }
    }

    /// Returns the faults and conditions of the run with this seed.
    pub fn schedule(self, seed: u64) -> Schedule {
        let mut random = Random::new(seed ^ 0x5eed_0000_0000_0000);
        let mut plan = Planner { at: Duration::from_secs(2), faults: Vec::new(), random: &mut random };
        let mut network = NetworkConditions::calm(Path::up_to(2_000));
        let (mut skew, mut rate, mut lag_ticks, mut sites) = (None, None, None, 1);
        let (mut balance, mut nodes, mut slow_node, mut restores) = (None, Vec::new(), None, Vec::new());
        match self {
            Self::None => plan.wait(15_000, 15_000),
            Self::Loss1 | Self::Loss5 | Self::Loss20 => {
                network.loss = match self {
                    Self::Loss1 => 0.01,
                    Self::Loss5 => 0.05,
                    _ => 0.2,
                };
                rate = Some(60);
                plan.wait(15_000, 15_000);
            }
            Self::Delay => {
                network.near = Path { base_us: 50_000, jitter_us: 100_000 };
                network.far = network.near;
                plan.wait(25_000, 25_000);
            }
            Self::Reorder => {
                network.reorder = 0.04;
                plan.wait(15_000, 15_000);
            }
            Self::Duplicate => {
                network.duplicate = 0.05;
                plan.wait(15_000, 15_000);
            }
            Self::Partition1 => (0..4).for_each(|_| plan.cut(1_000, 1_000, false, 4_000)),
            Self::Partition5 => (0..3).for_each(|_| plan.cut(5_000, 5_000, false, 5_000)),
            Self::Partition30 => plan.cut(30_000, 30_000, false, 6_000),
            Self::OneWay => (0..3).for_each(|_| plan.cut(300, 8_000, true, 5_000)),
            Self::KillNode => (0..3).for_each(|_| plan.kill(ProcessKind::Member, 500, 4_000, 5_000)),
            Self::KillLeader => (0..3).for_each(|_| plan.kill(ProcessKind::Leader, 500, 4_000, 5_000)),
            Self::KillServer => (0..2).for_each(|_| plan.kill(ProcessKind::Server, 200, 5_000, 6_000)),
            Self::Stop => (0..2).for_each(|_| plan.stop(5_000)),
            Self::ClockSkew => {
                // The network is a LAN.
                network = NetworkConditions::calm(Path::up_to(1_000));
                skew = Some(Skew { offset: Duration::from_secs(10), drift_ppm: 500 });
                plan.wait(15_000, 15_000);
                plan.kill(ProcessKind::Member, 500, 1_000, 15_000);
            }
            Self::Lag => {
                network = NetworkConditions::calm(Path { base_us: 30_000, jitter_us: 20_000 });
                // The longest round trip takes 6 ticks.
                (rate, lag_ticks) = (Some(60), Some(6));
                match seed % 5 {
                    0 => plan.wait(15_000, 15_000),
                    1 => (0..2).for_each(|_| plan.kill(ProcessKind::Member, 500, 4_000, 5_000)),
                    2 => (0..2).for_each(|_| plan.kill(ProcessKind::Leader, 500, 4_000, 5_000)),
                    3 => (0..2).for_each(|_| plan.cut(5_000, 5_000, false, 5_000)),
                    _ => (0..2).for_each(|_| plan.stop(5_000)),
                }
            }
            Self::GroupsKill | Self::GroupsServer | Self::GroupsCut => {
                sites = 3;
                network = NetworkConditions {
                    far: Path { base_us: 58_000, jitter_us: 4_000 },
                    server: Some(Path { base_us: 29_000, jitter_us: 2_000 }),
                    ..NetworkConditions::calm(Path::up_to(1_000))
                };
                match (self, seed % 2) {
                    (Self::GroupsKill, 0) => {
                        (0..3).for_each(|_| plan.kill(ProcessKind::Member, 500, 4_000, 5_000))
                    }
                    (Self::GroupsKill, _) => {
                        (0..3).for_each(|_| plan.kill(ProcessKind::Leader, 500, 4_000, 5_000))
                    }
                    (Self::GroupsServer, _) => {
                        (0..2).for_each(|_| plan.kill(ProcessKind::Server, 200, 5_000, 6_000));
                    }
                    (_, 0) => (0..2).for_each(|_| plan.cut(5_000, 5_000, false, 5_000)),
                    _ => (0..2).for_each(|_| plan.stop(5_000)),
                }
            }
            Self::Rebalance | Self::Grow | Self::Shrink | Self::SlowNode | Self::Restore => {
                balance = (self != Self::Restore || seed % 8 < 4).then(quick_balance);
                let second = |s: u32| Duration::from_secs(s.into());
                match self {
                    Self::Grow => nodes = (1..=8).map(|n| (second(n - 1), n)).collect(),
                    Self::Shrink => nodes = (1..=8).map(|n| (second(2 * (8 - n)), n)).rev().collect(),
                    Self::SlowNode => slow_node = Some(plan.random.bits()),
                    Self::Restore => {
                        let mut at = second(3);
                        for _ in 0..3 {
                            let save = at + plan.random.between_ms(0, 1_500);
                            at = save + plan.random.between_ms(200, 2_500);
                            restores.push((save, at));
                            at += second(1);
                        }
                    }
                    _ => {}
                }
                match seed % 4 {
                    0 => plan.wait(18_000, 18_000),
                    1 => (0..3).for_each(|_| plan.kill(ProcessKind::Member, 500, 4_000, 4_000)),
                    2 => (0..2).for_each(|_| plan.cut(5_000, 5_000, false, 5_000)),
                    _ => {
                        network.loss = 0.05;
                        plan.wait(18_000, 18_000);
                    }
                }
            }
            Self::All => {
                balance = (seed % 2 == 1).then(quick_balance);
                network.loss = plan.random.unit() * 0.03;
                network.reorder = plan.random.unit() * 0.04;
                network.duplicate = plan.random.unit() * 0.05;
                skew = Some(Skew { offset: Duration::from_secs(10), drift_ppm: 500 });
                (0..6).for_each(|_| plan.anything());
            }
        }
        let over = plan.faults.iter().map(|planned| planned.at + planned.fault.lasts());
        let calm_at = over.chain([plan.at]).max().unwrap_or_default();
        plan.faults.sort_by_key(|planned| planned.at);
        Schedule {
            network,
            skew,
            rate,
            lag_ticks,
            sites,
            balance,
            nodes,
            slow_node,
            restores,
            faults: plan.faults,
            calm_at,
        }
    }
}

/// Returns settings by which the small world of a trial finds something to change several times per second.
fn quick_balance() -> Balance {
    Balance { every_ticks: 10, tolerance: 1.1, smallest_edge_m: 0.25, ..Balance::by_nodes() }
}

impl fmt::Display for FaultProfile {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for FaultProfile {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Self::TABLE.into_iter().find(|profile| profile.name() == text).ok_or_else(|| {
            let names = Self::TABLE.map(Self::name).join(", ");
            format!("there is no fault profile `{text}`; choose one of {names}")
        })
    }
}

/// The faults and conditions of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Schedule {
    /// The conditions of the network until the calm end.
    pub network: NetworkConditions,
    /// The skew of the clocks.
    pub skew: Option<Skew>,
    /// The number of ticks per second, each with a report, where ages are measured; `None`: as the trial has
    /// it.
    pub rate: Option<u32>,
    /// The number of ticks that members may be apart; `None`: as the trial has it.
    pub lag_ticks: Option<u32>,
    /// The number of sites. Each has the same number of nodes, and the nodes of one site are a group.
    pub sites: u32,
    /// How regions follow the load; `None`: they do not.
    pub balance: Option<Balance>,
    /// The number of nodes that there are to be from each time on, in order of time; empty: as the trial has
    /// it.
    pub nodes: Vec<(Duration, u32)>,
    /// The choice of the node that is ten times slower than the others: any number.
    pub slow_node: Option<u64>,
    /// The times at which the world is saved, and at which it goes back to that save.
    pub restores: Vec<(Duration, Duration)>,
    /// The faults in order of time.
    pub faults: Vec<Planned>,
    /// The time from which nothing goes wrong: cuts are over, stopped processes go on.
    pub calm_at: Duration,
}

/// A planned fault and its instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Planned {
    /// The earliest time of the fault.
    pub at: Duration,
    /// The moment that the fault then waits for.
    pub moment: Moment,
    /// The fault.
    pub fault: Fault,
}

/// The moment that a fault waits for. After a second the fault happens without it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Moment {
    /// The fault waits for nothing.
    Any,
    /// This number of events after a view change has begun.
    Changing(u32),
    /// This number of events after a transfer between two nodes was sent.
    Transferring(u32),
}

/// A fault: a cut, a kill, a stop or a slow process.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fault {
    /// Nothing passes between an island and all other processes.
    Cut {
        /// The processes that are cut off.
        island: Island,
        /// The directions that are cut.
        ways: Ways,
        /// The length of the cut.
        time: Duration,
    },
    /// A process dies, and one of its kind begins later.
    Kill {
        /// The process.
        victim: Victim,
        /// The time after which a successor begins.
        back_after: Duration,
    },
    /// A process does nothing for some time.
    Stop {
        /// The process.
        victim: Victim,
        /// The length of the stop.
        time: Duration,
    },
    /// Every event costs a process time.
    Slow {
        /// The process.
        victim: Victim,
        /// The time that an event costs it.
        cost: Duration,
        /// How long the process is slow.
        time: Duration,
    },
}

impl Fault {
    fn lasts(self) -> Duration {
        match self {
            Self::Cut { time, .. } | Self::Stop { time, .. } | Self::Slow { time, .. } => time,
            Self::Kill { back_after, .. } => back_after,
        }
    }
}

/// A process, as far as it can be named before the run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Victim {
    /// The kind of process.
    pub role: ProcessKind,
    /// The choice among processes of this kind: any number.
    pub pick: u64,
}

/// The kind of a process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ProcessKind {
    /// The server.
    Server,
    /// The leader of any group.
    Leader,
    /// Any node.
    Member,
    /// A client.
    Client,
}

/// The processes on one side of a cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Island {
    /// One process, cut off from all others.
    One(Victim),
    /// Some nodes, with or without the server, cut off from all others.
    Nodes {
        /// The choice of the first node; the others follow it in id order.
        pick: u64,
        /// The number of nodes.
        count: u64,
        /// Says whether the server is among them.
        with_server: bool,
    },
    /// Two nodes, cut off from one another. The value chooses the first of them.
    Pair(u64),
}

/// The direction of a cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ways {
    /// Nothing passes in either direction.
    Both,
    /// What the processes on the island send does not arrive.
    Out,
    /// What is sent to the processes on the island does not arrive.
    In,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_profile_has_a_name_of_its_own_and_the_same_schedule_for_the_same_seed() {
        for profile in FaultProfile::TABLE {
            assert_eq!(profile.name().parse(), Ok(profile));
            assert_eq!(profile.schedule(7), profile.schedule(7));
            let schedule = profile.schedule(7);
            assert!(schedule.faults.iter().all(|planned| planned.at < schedule.calm_at), "{profile}");
            assert!(schedule.calm_at <= Duration::from_secs(90), "{profile}: {:?}", schedule.calm_at);
        }
        assert!("kill".parse::<FaultProfile>().unwrap_err().contains("kill-node, kill-leader"));
    }
}
