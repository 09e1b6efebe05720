//! Keeps the metrics of a node: the times of its ticks, what it holds, and for whom it waits.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use super::{SECONDS, turns, write_common};
use crate::cluster::{Node, NodeCounters, PhysicsCommand, TickStats};
use crate::metrics::{Histogram, Source, Text};
use crate::protocol::ViewNumber;
use crate::runtime::bandwidth::LinkTotals;
use crate::space::Tick;

/// A node that has completed no tick for this long does not do its part.
const STALLED: Duration = Duration::from_secs(5);
/// Bounds of disagreement, m/s.
const METRES_PER_SECOND: &[f64] = &[0.0001, 0.001, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0];

/// The numbers of a node, as its loop last wrote them down.
pub(in crate::runtime) struct NodeMetrics(Mutex<Numbers>);

#[derive(Clone)]
struct Numbers {
    turned: Option<Instant>,
    settled: Option<Instant>,
    over: bool,
    links: LinkTotals,
    counters: NodeCounters,
    /// The clients that the node tells itself, and those that relays tell in its place.
    clients_told: (usize, usize),
    membership: Option<Membership>,
    views: u64,
    tick: Tick,
    last: TickStats,
    regions: usize,
    ticks: u64,
    transfers: u64,
    exchanges: u64,
    tick_times: Histogram,
    compute_times: Histogram,
    round_times: Histogram,
    wait_times: Histogram,
    disagreement: Histogram,
}

/// The place of a node in its group.
#[derive(Clone, Copy, PartialEq, Eq)]
struct Membership {
    view: ViewNumber,
    members: usize,
    leads: bool,
}

/// Measures a node's ticks for its metrics. It belongs to the node's loop.
pub(in crate::runtime) struct NodeGauge {
    metrics: Arc<NodeMetrics>,
    /// The times at which the present tick began, its present round began, and this node was done with its
    /// part of that round.
    tick: Option<Instant>,
    round: Option<Instant>,
    computed: Option<Instant>,
}

impl NodeMetrics {
    pub(in crate::runtime) fn new() -> Self {
        let [tick_times, compute_times, round_times, wait_times] =
            std::array::from_fn(|_| Histogram::new(SECONDS));
        Self(Mutex::new(Numbers {
            turned: None,
            settled: None,
            over: false,
            links: LinkTotals::default(),
            counters: NodeCounters::default(),
            clients_told: (0, 0),
            membership: None,
            views: 0,
            tick: Tick(0),
            last: TickStats::default(),
            regions: 0,
            ticks: 0,
            transfers: 0,
            exchanges: 0,
            tick_times,
            compute_times,
            round_times,
            wait_times,
            disagreement: Histogram::new(METRES_PER_SECOND),
        }))
    }

    fn lock(&self) -> MutexGuard<'_, Numbers> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn copy(&self) -> Numbers {
        self.lock().clone()
    }
}

impl NodeGauge {
    pub(in crate::runtime) fn new(metrics: Arc<NodeMetrics>) -> Self {
        Self { metrics, tick: None, round: None, computed: None }
    }

    /// Records that the loop turns.
    pub(in crate::runtime) fn turned(&self, now: Instant) {
        self.metrics.lock().turned = Some(now);
    }

    /// Records what the node's state machine and its links have counted.
    pub(in crate::runtime) fn counted(&self, node: &Node, links: LinkTotals) {
        let mut numbers = self.metrics.lock();
        (numbers.counters, numbers.links) = (node.counters(), links);
        numbers.clients_told = node.clients_told();
        numbers.place(node);
    }

    /// Records that the physics begins a command.
    pub(in crate::runtime) fn begins(&mut self, now: Instant, command: &PhysicsCommand) {
        match command {
            PhysicsCommand::Step { .. } => {
                (self.tick, self.round, self.computed) = (Some(now), Some(now), None);
            }
            PhysicsCommand::Accept { .. } => {
                let mut numbers = self.metrics.lock();
                let since = |at: Option<Instant>| at.map(|at| now.duration_since(at).as_secs_f64());
                since(self.round.replace(now)).into_iter().for_each(|time| numbers.round_times.observe(time));
                since(self.computed.take()).into_iter().for_each(|time| numbers.wait_times.observe(time));
            }
            // A view change intervenes, so the tick that had begun is not measured.
            PhysicsCommand::World(_) | PhysicsCommand::Rebuild { .. } | PhysicsCommand::Drain { .. } => {
                (self.tick, self.round, self.computed) = (None, None, None);
            }
            _ => {}
        }
    }

    /// Records that the physics has computed a round, whose border messages are exchanged now.
    pub(in crate::runtime) fn computed(&mut self, now: Instant) {
        self.computed = self.round.map(|_| now);
    }

    /// Records that a tick is complete here.
    pub(in crate::runtime) fn settled(
        &mut self,
        now: Instant,
        tick: Tick,
        stats: &TickStats,
        regions: usize,
        node: &Node,
    ) {
        let numbers = &mut *self.metrics.lock();
        let began = self.tick.take().map(|began| now.duration_since(began).as_secs_f64());
        began.into_iter().for_each(|time| numbers.tick_times.observe(time));
        numbers.compute_times.observe(f64::from(stats.compute_us) / 1e6);
        numbers.disagreement.observe(stats.disagreement_m_s.into());
        numbers.ticks += 1;
        numbers.transfers += u64::from(stats.transfers);
        numbers.exchanges += u64::from(stats.exchanges);
        (numbers.settled, numbers.tick, numbers.last, numbers.regions) = (Some(now), tick, *stats, regions);
        numbers.place(node);
    }
}

impl Drop for NodeGauge {
    fn drop(&mut self) {
        self.metrics.lock().over = true;
    }
}

impl Numbers {
    fn place(&mut self, node: &Node) {
        let membership = node.view().map(|view| Membership {
            view: view.number,
            members: view.members.len(),
            leads: view.leader == node.id(),
        });
        let number = |place: &Membership| place.view;
        if membership.as_ref().map(number) != self.membership.as_ref().map(number) && membership.is_some() {
            self.views += 1;
        }
        self.membership = membership;
        if self.membership.is_none() {
            (self.last, self.regions) = (TickStats::default(), 0);
        }
    }
}

impl Source for NodeMetrics {
    fn metrics(&self) -> String {
        let n = self.copy();
        let mut text = Text::default();
        let c = n.counters;
        let refused =
            [("stale", c.stale), ("forbidden", c.refused), ("overflow", c.overflow), ("input", c.rejected)];
        write_common(&mut text, "node", &n.links, &refused);
        text.gauge("dcd_tick", "The last complete tick of the world.").is(n.tick.0 as f64);
        text.counter("dcd_ticks_total", "Ticks that this process has computed.").is(n.ticks as f64);
        text.histogram(
            "dcd_tick_seconds",
            "From the beginning of a tick to its end, with waiting for others.",
            &n.tick_times,
        );
        text.histogram(
            "dcd_tick_compute_seconds",
            "What this node computed of a tick, without waiting.",
            &n.compute_times,
        );
        text.histogram(
            "dcd_round_seconds",
            "From the beginning of a round of exchange to when the messages of all neighbours are there.",
            &n.round_times,
        );
        text.histogram(
            "dcd_round_wait_seconds",
            "The part of a round in which this node is done and waits for its neighbours.",
            &n.wait_times,
        );
        text.counter(
            "dcd_speculative_ticks_total",
            "Ticks computed for clients alone, while others were waited for.",
        )
        .is(c.speculative as f64);
        text.counter(
            "dcd_verified_ticks_total",
            "Ticks of participants that were computed once more here, and right.",
        )
        .is(c.verified as f64);
        text.gauge("dcd_regions", "Regions computed here.").is(n.regions as f64);
        text.gauge("dcd_bodies", "Movable bodies owned here.").is(n.last.bodies.into());
        text.gauge("dcd_ghosts", "Copies of bodies of other regions, held here.").is(n.last.ghosts.into());
        text.gauge("dcd_contact_pairs", "Pairs of colliders that touch or nearly do.")
            .is(n.last.contacts.into());
        text.counter("dcd_transfers_total", "Bodies that came to a region of this node from another.")
            .is(n.transfers as f64);
        text.counter("dcd_exchanges_total", "Exchanges of regions with their neighbours.")
            .is(n.exchanges as f64);
        text.histogram(
            "dcd_disagreement_meters_per_second",
            "How far the copies of a body were from agreement at the worst border, once per tick.",
            &n.disagreement,
        );
        let place = n.membership;
        text.gauge("dcd_view", "The number of the group's membership (view); 0: in none.")
            .is(place.map_or(0.0, |place| place.view.0 as f64));
        text.counter("dcd_views_total", "Views that this node was a member of.").is(n.views as f64);
        text.gauge("dcd_group_nodes", "Members of this node's group.")
            .is(place.map_or(0.0, |place| place.members as f64));
        text.gauge("dcd_clients_told", "Clients that this node tells, and that relays tell while it leads.")
            .of(&[("by", "itself")], n.clients_told.0 as f64)
            .of(&[("by", "relays")], n.clients_told.1 as f64);
        text.gauge("dcd_leads", "1 if this node leads its group.")
            .is(place.map_or(0.0, |place| f64::from(u8::from(place.leads))));
        text.into_string()
    }

    fn healthy(&self) -> Result<(), String> {
        turns(self.lock().turned)
    }

    fn ready(&self) -> Result<(), String> {
        let numbers = self.lock();
        turns(numbers.turned)?;
        match (numbers.over, numbers.membership, numbers.settled.map(|settled| settled.elapsed())) {
            (true, ..) => Err("the node has stopped".to_owned()),
            (_, None, _) => Err("the node is in no group yet".to_owned()),
            (_, _, None) => Err("no tick is complete yet".to_owned()),
            (_, _, Some(ago)) if ago >= STALLED => Err(format!("no tick for {} s", ago.as_secs())),
            _ => Ok(()),
        }
    }
}
