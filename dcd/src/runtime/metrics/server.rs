//! Keeps the metrics of a server: the world as it is on the server's record, who has joined, and how long the
//! directory takes.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use super::{SECONDS, turns, write_common};
use crate::cluster::ServerOutput;
use crate::metrics::{Histogram, Source, Text};
use crate::protocol::{BodyKind, Finding, Message, ToClient};
use crate::recording::RecordedServer;
use crate::runtime::bandwidth::LinkTotals;

/// The server is held up when its loop has not turned for this long: it turns at least twice per second.
const HELD_UP: Duration = Duration::from_secs(2);

/// The numbers of a server, as its loop last wrote them down, and its record, which is read at each scrape.
pub(in crate::runtime) struct ServerMetrics {
    numbers: Mutex<Numbers>,
    server: Arc<Mutex<RecordedServer>>,
}

#[derive(Clone)]
struct Numbers {
    turned: Option<Instant>,
    /// Why the server does not serve any more.
    over: Option<&'static str>,
    links: LinkTotals,
    views: u64,
    repartitions: u64,
    expelled: u64,
    unreached: u64,
    /// The number of participants that were found to deviate, that contradict others, and whose verification
    /// was given up.
    findings: [u64; 3],
    /// The number of clients' requests that were refused.
    refused: u64,
    commit_times: Histogram,
    commit_bytes: u64,
}

impl ServerMetrics {
    pub(in crate::runtime) fn new(server: Arc<Mutex<RecordedServer>>) -> Self {
        let numbers = Numbers {
            turned: None,
            over: None,
            links: LinkTotals::default(),
            views: 0,
            repartitions: 0,
            expelled: 0,
            unreached: 0,
            findings: [0; 3],
            refused: 0,
            commit_times: Histogram::new(SECONDS),
            commit_bytes: 0,
        };
        Self { numbers: Mutex::new(numbers), server }
    }

    fn write<R>(&self, write: impl FnOnce(&mut Numbers) -> R) -> R {
        write(&mut self.numbers.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Records that the loop turns.
    pub(in crate::runtime) fn turned(&self, now: Instant) {
        self.write(|numbers| numbers.turned = Some(now));
    }

    /// Records what the links have counted.
    pub(in crate::runtime) fn counted(&self, links: LinkTotals) {
        self.write(|numbers| numbers.links = links);
    }

    /// Counts an output of the server's state machine.
    pub(in crate::runtime) fn put_out(&self, output: &ServerOutput) {
        self.write(|numbers| match output {
            ServerOutput::Began { .. } => numbers.views += 1,
            ServerOutput::Repartitioned { .. } => numbers.repartitions += 1,
            ServerOutput::Expelled(_) => numbers.expelled += 1,
            ServerOutput::Unreached(_) => numbers.unreached += 1,
            ServerOutput::Verdict { finding: Finding::Deviates(_), .. } => numbers.findings[0] += 1,
            ServerOutput::Verdict { finding: Finding::Contradicts(_), .. } => numbers.findings[1] += 1,
            ServerOutput::Verdict { finding: Finding::GivenUp(_), .. } => numbers.findings[2] += 1,
            ServerOutput::Send { message: Message::ToClient(_, ToClient::Rejected { .. }), .. } => {
                numbers.refused += 1;
            }
            ServerOutput::Ended => numbers.over = Some("the world has ended"),
            ServerOutput::Suspended => numbers.over = Some("the server has stopped"),
            _ => {}
        });
    }

    /// Records how long the directory took to write a batch of this many bytes.
    pub(in crate::runtime) fn committed(&self, took: Duration, bytes: usize) {
        self.write(|numbers| {
            numbers.commit_times.observe(took.as_secs_f64());
            numbers.commit_bytes += bytes as u64;
        });
    }

    /// Records that the server can serve no more.
    pub(in crate::runtime) fn failed(&self) {
        self.write(|numbers| numbers.over = numbers.over.or(Some("the server has failed")));
    }
}

impl Source for ServerMetrics {
    fn metrics(&self) -> String {
        let n = self.write(|numbers| numbers.clone());
        let mut text = Text::default();
        let server = self.server.lock().unwrap_or_else(PoisonError::into_inner);
        let movable = server.record().present().filter(|body| body.traits.kind != BodyKind::Fixed).count();
        let (nodes, clients) = (server.linked_nodes().count(), server.linked_clients().count());
        let members: usize = server.views().map(|(_, view)| view.members.len()).sum();
        let regions = server.view().map_or(0, |view| view.allocation.len());
        let view = server.view().map_or(0, |view| view.number.0);
        let fidelity = server.fidelity_report();
        let (groups, tick) = (server.views().count(), server.tick().0);
        let (stale, polls, changing) = (server.stale(), server.poll_counts(), server.is_changing());
        drop(server);
        write_common(&mut text, "server", &n.links, &[("stale", stale), ("input", n.refused)]);
        text.gauge("dcd_world_tick", "The last tick that a node is known to have completed.").is(tick as f64);
        text.gauge("dcd_world_bodies", "Movable bodies on record.").is(movable as f64);
        text.gauge("dcd_world_regions", "Regions that nodes compute, of the main group.").is(regions as f64);
        // Without fidelity all regions are stepped in every tick.
        let stepped = fidelity.map_or([regions, 0, 0], |report| report.levels);
        text.gauge("dcd_world_regions_stepped", "Regions of the main group, by how often they are stepped.")
            .of(&[("every", "1")], stepped[0] as f64)
            .of(&[("every", "2")], stepped[1] as f64)
            .of(&[("every", "4")], stepped[2] as f64);
        text.gauge(
            "dcd_world_time_share",
            "The time of steps, as a share of what it would be if all regions were stepped in every tick.",
        )
        .is(fidelity.map_or(1.0, |report| report.share_of_full_time));
        text.gauge(
            "dcd_world_fidelity_error_meters_per_second",
            "The mean error of a body's velocity after a step, by the audits of fidelity.",
        )
        .is(fidelity.map_or(0.0, |report| f64::from(report.error_m_s)));
        text.gauge("dcd_world_nodes", "Nodes that have joined and are linked.").is(nodes as f64);
        text.gauge("dcd_world_members", "Nodes that are members of a group.").is(members as f64);
        text.gauge("dcd_world_clients", "Clients that have joined and are linked.").is(clients as f64);
        text.gauge("dcd_world_groups", "Groups of nodes.").is(groups as f64);
        text.gauge(
            "dcd_world_view",
            "The number of the main group's membership (view); 0: no node computes.",
        )
        .is(view as f64);
        text.gauge("dcd_world_changing", "1 while a membership changes: ticks wait for that.")
            .is(f64::from(u8::from(changing)));
        text.counter("dcd_world_views_total", "Views that began.").is(n.views as f64);
        text.counter("dcd_world_repartitions_total", "How often regions changed within a view.")
            .is(n.repartitions as f64);
        text.counter("dcd_world_expulsions_total", "Nodes without which the world went on.")
            .is(n.expelled as f64);
        text.counter(
            "dcd_world_unreached_total",
            "Nodes apart, as they and others did not reach each other.",
        )
        .is(n.unreached as f64);
        text.counter("dcd_verdicts_total", "What was found out about participants that were verified.")
            .of(&[("finding", "deviates")], n.findings[0] as f64)
            .of(&[("finding", "contradicts")], n.findings[1] as f64)
            .of(&[("finding", "given_up")], n.findings[2] as f64);
        text.counter(
            "dcd_votes_total",
            "Votes on membership, by what became of them; open ones and cancelled ones are in neither.",
        )
        .of(&[("outcome", "passed")], polls.passed as f64)
        .of(&[("outcome", "failed")], polls.failed as f64);
        text.counter("dcd_votes_opened_total", "Votes on membership that were opened.")
            .is(polls.opened as f64);
        text.counter("dcd_joins_total", "Processes that were let in by a token.")
            .is(n.links.net.joins_granted as f64);
        text.histogram(
            "dcd_directory_commit_seconds",
            "What the directory took to write a batch down.",
            &n.commit_times,
        );
        text.counter("dcd_directory_bytes_total", "Bytes of keys and values written to the directory.")
            .is(n.commit_bytes as f64);
        text.into_string()
    }

    fn healthy(&self) -> Result<(), String> {
        self.write(|numbers| turns(numbers.turned))
    }

    fn ready(&self) -> Result<(), String> {
        self.write(|numbers| {
            turns(numbers.turned)?;
            readiness(numbers.over, numbers.turned.map(|turned| turned.elapsed()))
        })
    }
}

/// Returns why a server lets nobody in, whose loop turned so long ago.
fn readiness(over: Option<&'static str>, turned: Option<Duration>) -> Result<(), String> {
    match (over, turned) {
        (Some(why), _) => Err(why.to_owned()),
        (None, None) => Err("the server begins".to_owned()),
        (None, Some(ago)) if ago >= HELD_UP => {
            Err(format!("the server has waited for {} s, perhaps for its directory", ago.as_secs()))
        }
        (None, Some(_)) => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cluster::{Record, ServerConfig, ServerOrigin};
    use crate::protocol::Hindrance;
    use crate::sim::sim_world;
    use crate::space::{NodeId, Tick};

    #[test]
    fn verdicts_on_participants_are_counted_by_what_was_found() {
        let world = sim_world(1);
        let region = world.tree.leaves().next().unwrap();
        let config = ServerConfig {
            world,
            incarnation: 1,
            min_nodes: 1,
            grouping: Default::default(),
            avatar_expiry: Duration::from_secs(60),
            events: false,
            can_build: |_, _| true,
        };
        let origin = ServerOrigin::New(Record::new(Vec::new(), Vec::new(), Vec::new()));
        let server = RecordedServer::begin(config, origin, None).unwrap();
        let metrics = ServerMetrics::new(Arc::new(Mutex::new(server)));
        let contradicts = [1, 2].map(|node| Finding::Contradicts(NodeId(node)));
        let given_up = [Finding::GivenUp(Hindrance::Unknown); 3];
        for finding in [Finding::Deviates(region)].into_iter().chain(contradicts).chain(given_up) {
            metrics.put_out(&ServerOutput::Verdict { node: NodeId(3), tick: Tick(7), finding });
        }
        let text = metrics.metrics();
        for (finding, count) in [("deviates", 1), ("contradicts", 2), ("given_up", 3)] {
            let line = format!("dcd_verdicts_total{{finding=\"{finding}\"}} {count}\n");
            assert!(text.contains(&line), "no `{line}` in {text}");
        }
    }

    #[test]
    fn a_server_lets_nobody_in_before_it_turns_while_it_is_held_up_and_when_it_is_over() {
        let [soon, late] = [1, 3].map(|s| Some(Duration::from_secs(s)));
        assert_eq!(readiness(None, soon), Ok(()));
        assert!(readiness(None, None).unwrap_err().contains("begins"));
        assert!(readiness(None, late).unwrap_err().contains("3 s, perhaps for its directory"));
        assert_eq!(readiness(Some("it has ended"), soon), Err("it has ended".to_owned()));
    }
}
