//! Implements `dcd node`: a process that computes a share of a served world.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use super::common::{Common, print};
use super::config_file::ConfigArgs;
use super::failure::Failure;
use super::interrupt::Interrupt;
use super::join_token::TokenArgs;
use super::notify::Notifier;
use super::summary::{Computed, Summary};
use super::values::{SERVER, address, joining, reachable, unused, wall_seconds};
use super::view::{self, ANY_PORT};
use crate::net::JoinRole;
use crate::runtime::{JoinConfig, Member, MemberConfig, Onlooker, ProcessError};

/// The interval at which Ctrl-C is looked for.
const LOOK: Duration = Duration::from_millis(50);

/// Computes a share of the world that a server holds
///
/// Example:
///   dcd node --server 192.0.2.7:7420 --token $(dcd token --role node)
///
/// Prints `joined as NODE` first, then `listening ADDR`, with --metrics `metrics URL`, and a summary last.
/// Ctrl-C hands the node's regions over to other nodes, or back to the server. While the server is out of
/// reach, the node computes on with the others, and dials the server again.
#[derive(clap::Args)]
#[command(
    verbatim_doc_comment,
    after_long_help = "--json prints the summary with the keys node tick bodies regions tick_ms{mean,p50,p99,max} transfers ghosts_mean\n\
        exchanges_mean disagreement_max_m_s speculative\n\
                       bytes bytes_per_s seconds; tick_ms is the time of computing, without waiting for others, from the 31st tick on;\n\
                       speculative counts ticks that were computed for clients alone while other nodes were waited for. Exits with 3, and is\n\
                       not to be started again by itself, when it has ended in order and --record is not whole."
)]
pub(super) struct Node {
    /// The server's address; with standby servers (`dcd serve --directory`) all addresses, separated by
    /// commas
    #[arg(long, value_name = "ADDR", default_value = SERVER, value_parser = address, value_delimiter = ',')]
    server: Vec<SocketAddr>,
    #[command(flatten)]
    token: TokenArgs,
    /// The address on which to listen for other nodes and clients [default: any free port]
    #[arg(long, value_name = "ADDR", value_parser = address)]
    listen: Option<SocketAddr>,
    /// The address at which others reach this node, if not the one it listens on
    #[arg(long, value_name = "ADDR", value_parser = reachable)]
    advertise: Option<SocketAddr>,
    /// Regions stepped at the same time [default: as many as there are cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// File that keeps the node's identity: with it the node joins again under the same name
    #[arg(long, value_name = "FILE")]
    identity: Option<PathBuf>,
    /// Time to wait for a server that is out of reach after joining, in seconds [default: without end]
    #[arg(long, value_name = "SECONDS", value_parser = wall_seconds)]
    give_up: Option<Duration>,
    /// Record all that the node is given, and a digest of each region after each tick: `dcd replay FILE` computes it again
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    /// Serve metrics (/metrics, in Prometheus' format) and the node's health (/healthz, /readyz) over HTTP at
    /// this address
    #[arg(long, value_name = "ADDR", value_parser = address)]
    metrics: Option<SocketAddr>,
    /// Show the regions of this node, with their ghosts, in the browser: serve a page at this address, or at
    /// any free port of this machine if none is given, and print its URL on standard error
    #[arg(long, value_name = "ADDR", num_args = 0..=1, default_missing_value = ANY_PORT, value_parser = address)]
    view: Option<SocketAddr>,
    #[command(flatten)]
    _config: ConfigArgs,
    /// Print the summary as one JSON object
    #[arg(long)]
    json: bool,
    /// End in order when standard input ends
    #[arg(long, hide = true)]
    until_stdin_ends: bool,
}

impl Node {
    pub(super) fn execute(self, common: &Common) -> Result<ExitCode, Failure> {
        let interrupt = Interrupt::listen()?;
        if self.until_stdin_ends {
            interrupt.listen_to_stdin();
        }
        self.record.as_deref().map_or(Ok(()), unused)?;
        let (identity, record) = (self.identity, self.record.clone());
        let is_token_needed = !identity.as_ref().is_some_and(|path| path.exists());
        let join = JoinConfig {
            identity,
            record,
            listen: self.listen,
            metrics: self.metrics,
            ..joining(&self.server, interrupt.at_once(|| self.token.read(is_token_needed))?)
        };
        // Everything that may fail here comes before the token is used up.
        let name = format!("a node of {}", self.server[0]);
        let viewer = self.view.map(|at| view::open(at, &name, common)).transpose()?;
        let identity = interrupt.at_once(|| join.join(JoinRole::Node))?;
        let mut config = MemberConfig::new(join.server, identity);
        config.standbys = join.standbys;
        config.listen = join.listen;
        config.advertise = self.advertise;
        config.give_up = self.give_up;
        config.record = self.record;
        config.metrics = join.metrics;
        config.threads = self
            .threads
            .map_or_else(|| std::thread::available_parallelism().map_or(1, usize::from), usize::from);
        config.onlooker = viewer.map(|mut viewer| -> Onlooker {
            Box::new(move |regions, stats| viewer.show_node(regions, stats))
        });
        let notifier = Notifier::from_environment();
        let node = Member::start(config)?;
        let _watch = notifier.watch(node.pulse());
        let metrics = node.metrics_address().map(|address| format!("\nmetrics http://{address}/metrics"));
        print(&format!(
            "joined as {}\nlistening {}{}",
            node.summary().node,
            node.address,
            metrics.unwrap_or_default()
        ))?;
        while !node.wait_over(LOOK) && !interrupt.asked() {}
        notifier.stopping();
        if interrupt.asked() && !node.is_over() {
            common.say("leaving: regions are handed over first");
            node.leave();
        }
        // Bounded: a node that asked to leave is gone a few seconds later whatever the server does.
        while !node.wait_over(LOOK) {}
        if let Some(why) = node.farewell() {
            common.say(&format!("the server ends this node: {why}"));
        }
        Computed::from(&node.summary()).show(self.json)?;
        match node.finish() {
            Ok(_) => Ok(interrupt.exit_code()),
            // The node itself has ended in order: a drained node must not be started again because of its
            // recording.
            Err(error @ ProcessError::Record { .. }) => {
                Err(Failure::ended(format!("the recording is not whole: {error}")))
            }
            Err(error) => Err(error.into()),
        }
    }
}
