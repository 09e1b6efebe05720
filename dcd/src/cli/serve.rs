//! Implements `dcd serve`: the server of a world that other processes compute and play in.

use std::io::IsTerminal;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use super::common::{Common, print};
use super::config_file::ConfigArgs;
use super::failure::Failure;
use super::fidelity::FidelityArgs;
use super::interrupt::Interrupt;
use super::notify::Notifier;
use super::requests;
use super::run::snapshot;
use super::scenes;
use super::summary::{Served, Summary};
use super::values::{SERVER, address, duration, positive, share, shell_word, speed, unused};
use super::view::{ANY_PORT, Onlooker};
use super::world::{CutArgs, explained};
use crate::cluster::{GroupPolicy, Grouping};
use crate::net::JoinRole;
use crate::protocol::{DelayThresholds, MAX_LAG, MAX_STATE_TICKS, Pace, Thresholds, View, ViewNumber};
use crate::runtime::{
    self, GroupConfig, LocalWorld, Origin, ProcessError, ServeConfig, ServerProcess, ServerSummary,
    WorldConfig,
};
use crate::scene::{Params, Scene};
use crate::space::{Allocation, MAX_REGIONS, Tick};

/// The interval at which Ctrl-C is looked for.
const LOOK: Duration = Duration::from_millis(50);
/// How long the token of the viewer of this process is valid.
const AT_ONCE: Duration = Duration::from_secs(60);
/// How long a first Ctrl-C waits for a second one, which ends the world.
const AGAIN: Duration = Duration::from_secs(2);

/// Serves a world that nodes compute and clients play in
///
/// Examples:
///   dcd serve dcd/scenes/playground.toml
///   dcd node --token $(dcd token --role node)
///   dcd client --token $(dcd token --role client) --avatars 10
#[derive(clap::Args)]
#[command(verbatim_doc_comment, after_long_help = after_help())]
pub(super) struct Serve {
    /// A scene of the library (`dcd scenes` lists them), a scene file (TOML, MJCF: .xml or .mjcf, URDF: .urdf), or a snapshot
    /// (.dcd) of `dcd save` or `dcd run --save`
    scene: String,
    /// Set a parameter of the scene; may be given several times
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// The address on which to listen; port 0 takes any free one, 0.0.0.0 listens to other machines too
    #[arg(long, value_name = "ADDR", default_value = SERVER, value_parser = address)]
    listen: SocketAddr,
    /// Folder that keeps the server's keys, the list of used tokens, and the world: a server that died goes
    /// on with the world when it is started again in the same way
    #[arg(long, value_name = "DIR", default_value = "dcd-data")]
    data: PathBuf,
    /// Keep the world in an etcd cluster instead: etcd://HOST:PORT[,HOST:PORT...]/NAME. Servers of the same
    /// NAME stand by for one another, each with its own --data and the same scene and settings: when the one
    /// that serves the world is gone, another goes on with it. Nodes and clients are given the addresses of
    /// all of them. Over TLS, in quotes: 'etcds://...?cacert=FILE', with &cert=FILE&key=FILE if etcd asks for
    /// certificates. If etcd has users: with user=NAME&password-file=FILE, or with the password in the
    /// environment variable DCD_ETCD_PASSWORD
    #[arg(long, value_name = "PLACE")]
    directory: Option<String>,
    /// Begin anew, and forget the world that is stored
    #[arg(long)]
    fresh: bool,
    /// Nodes to wait for before the first tick
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=1024))]
    nodes: u16,
    /// Number of regions, cut by upright planes that halve the largest one [default: what the scene says,
    /// else one for each node, in proportion to what the node can do]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=MAX_REGIONS as i64), conflicts_with = "cut")]
    regions: Option<u16>,
    #[command(flatten)]
    cuts: CutArgs,
    #[command(flatten)]
    fidelity: FidelityArgs,
    /// Step as fast as the nodes can, rather than in real time
    #[arg(long)]
    unpaced: bool,
    /// End the world after so many ticks [default: by `dcd end`]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    ticks: Option<u64>,
    /// The fastest that clients may move their avatars, m/s
    #[arg(long, value_name = "M_S", default_value_t = 20.0, value_parser = speed)]
    avatar_speed: f32,
    /// Ticks from one state of a moving body that clients are told to the next; clients interpolate between
    /// them
    #[arg(long, value_name = "TICKS", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=MAX_STATE_TICKS as i64))]
    state_every: u32,
    /// The number of clients to which the leader of a group sends states of moving bodies itself. Other
    /// dedicated nodes of the group (relays) serve the clients beyond that number; the leader sends each
    /// relay once what all of its clients need [default: the leader serves all]
    #[arg(long, value_name = "CLIENTS")]
    relays: Option<u32>,
    /// Share of participants, 0 to 1, whose regions the node that leads computes once more, to compare: a
    /// participant that computes otherwise is sent away. Nobody is told who is drawn. Needs a dedicated node
    /// (`dcd node`), which has as many more regions to compute
    #[arg(long, value_name = "SHARE", default_value_t = 0.0, value_parser = share)]
    verify: f64,
    /// How long avatars wait for a client that left, before they are removed: 90s, 10m, 2h, 1d
    #[arg(long, value_name = "TIME", default_value = "1h", value_parser = duration)]
    keep_avatars: Duration,
    /// Let nodes run ahead of one another by at most so many ticks, and extrapolate: for links slower than a
    /// tick. Needs --coupling owner
    #[arg(long, value_name = "TICKS", default_value_t = 0, value_parser = clap::value_parser!(u32).range(0..=MAX_LAG as i64))]
    lag: u32,
    /// Round trip below which nodes share a group, ms; needs --far [default: all nodes that reach each other
    /// share one]
    #[arg(long, value_name = "MS", requires = "far", value_parser = positive)]
    near: Option<f32>,
    /// Round trip above which members are voted out of their group, ms; above --near
    #[arg(long, value_name = "MS", requires = "near", value_parser = positive)]
    far: Option<f32>,
    /// The most nodes of a group
    #[arg(long, value_name = "N", default_value_t = 32, value_parser = clap::value_parser!(u16).range(1..=1024))]
    group_size: u16,
    /// Form groups of 2, 4, 8 … nodes, which share a world evenly, and leave no node alone where that is
    /// possible
    #[arg(long)]
    powers_of_two: bool,
    /// How far a body in one group may be from where the authoritative group has it, metres
    #[arg(long, value_name = "M", default_value_t = 0.1, value_parser = positive)]
    agree: f32,
    /// Record all that the server is given, to be replayed by `dcd replay` with the recordings of its nodes
    #[arg(long, value_name = "FILE.dcdr")]
    record: Option<PathBuf>,
    /// Serve metrics (/metrics, in Prometheus' format) and the server's health (/healthz, /readyz) over HTTP
    /// at this address. Standby servers on one machine need one address each
    #[arg(long, value_name = "ADDR", value_parser = address)]
    metrics: Option<SocketAddr>,
    /// Show the world as a client is told of it in the browser: serve a page at this address, or at any free
    /// port of this machine if none is given, and print its URL on standard error
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

impl Serve {
    /// Returns whether a stored world is to be forgotten.
    pub(super) fn is_fresh(&self) -> bool {
        self.fresh
    }

    pub(super) fn execute(self, common: &Common) -> Result<ExitCode, Failure> {
        let origin = self.origin(common)?;
        let interrupt = Interrupt::listen()?;
        if self.until_stdin_ends {
            interrupt.listen_to_stdin();
        }
        self.record.as_deref().map_or(Ok(()), unused)?;
        if self.verify > 0.0 && self.lag > 0 {
            let why = "--verify needs lockstep, which --lag gives up: what a participant was told in a tick is not known then. Leave one of them out";
            return Err(Failure::usage(why));
        }
        if self.lag > 0 && self.fidelity.is_on() {
            let why = "--fidelity needs lockstep, which --lag gives up: regions that share bodies must be at one time. Leave one of them out";
            return Err(Failure::usage(why));
        }
        let config = self.config()?;
        requests::forget(&self.data);
        let notifier = Notifier::from_environment();
        let Some(mut server) = start(&origin, config, &notifier, interrupt)? else {
            // The same exit code as that of a server that keeps its world.
            return Ok(ExitCode::SUCCESS);
        };
        drop(origin);
        let _watch = notifier.watch(server.pulse());
        // A failure to print does not end the world.
        let watched = self
            .announce(&server, common)
            .and_then(|()| self.onlooker(&server, common))
            .and_then(|onlooker| self.watch(&server, onlooker, interrupt, common));
        notifier.stopping();
        if watched.is_err() || interrupt.asked() && !self.ends(interrupt, common) {
            server.suspend();
            watched?;
        }
        // Ends the world, unless it is suspended or over.
        server.end();
        let (failure, is_kept, summary) = (server.failure(), server.is_suspended(), server.summary());
        let unrecorded = match failure {
            None => None,
            // The world went on without its recording.
            Some(error @ ProcessError::Record { .. }) => Some(format!("the recording is not whole: {error}")),
            // Whatever it is, it is no failure of usage.
            Some(error) => return Err(Failure::run(error.to_string())),
        };
        if is_kept {
            self.tell_of_suspension(&summary, common);
            return unrecorded.map_or(Ok(ExitCode::SUCCESS), |why| Err(Failure::run(why)));
        }
        self.tell_of_end(&summary)?;
        // Started again, the server would begin the world anew.
        unrecorded.map_or_else(|| Ok(interrupt.exit_code()), |why| Err(Failure::ended(why)))
    }

    fn config(&self) -> Result<ServeConfig, Failure> {
        Ok(ServeConfig {
            listen: self.listen,
            data: self.data.clone(),
            directory: self.directory.clone(),
            fresh: self.fresh,
            nodes: self.nodes.into(),
            pace: if self.unpaced { Pace::Unpaced } else { Pace::RealTime },
            state_every: self.state_every,
            last_tick: self.ticks.map(Tick),
            avatar_speed_limit: self.avatar_speed,
            // Nobody here takes events.
            events: false,
            avatar_expiry: self.keep_avatars,
            record: self.record.clone(),
            metrics: self.metrics,
            relays_above: self.relays,
            verify: self.verify,
            groups: self.groups()?,
        })
    }

    /// Prints where the server is, and says how nodes join it.
    fn announce(&self, server: &ServerProcess, common: &Common) -> Result<(), Failure> {
        let mut first = format!("listening {}", server.address);
        if let Some(address) = server.metrics_address() {
            first += &format!("\nmetrics http://{address}/metrics");
        }
        if let Some(tick) = server.resumed {
            first += &format!("\ngoing on with the world at tick {}", tick.0);
        }
        let printed = print(&first);
        let waits_for = match (server.resumed, self.nodes) {
            (Some(_), _) => "its nodes, or others".to_owned(),
            (None, 1) => "a node".to_owned(),
            (None, nodes) => format!("{nodes} nodes"),
        };
        let (address, data) = (server.address, shell_word(&self.data));
        common.say(&if address.ip().is_unspecified() {
            let port = address.port();
            format!(
                "the world waits for {waits_for}: dcd node --server THIS-MACHINE:{port} --token TOKEN, where `dcd token \
                 --data {data} --role node` here makes the token"
            )
        } else {
            format!(
                "the world waits for {waits_for}: dcd node --server {address} --token $(dcd token --data {data} --role node)"
            )
        });
        printed
    }

    /// Says that the world is kept, and how to go on with it.
    fn tell_of_suspension(&self, summary: &ServerSummary, common: &Common) {
        let (tick, data) = (summary.tick.0, self.data.display());
        // Without the query, which names the files for etcd's TLS and users.
        let place = self.directory.as_deref().and_then(|place| place.split('?').next());
        common.say(&match (place, summary.kept) {
            (Some(place), _) => format!(
                "the world is kept in {place} at tick {tick}: a server that stands by goes on with it, or the same command"
            ),
            (None, true) => format!(
                "the world is kept at tick {tick}: the same command goes on with it, `dcd end --data {data}` ends it"
            ),
            (None, false) => "the world had not begun, and nothing of it is kept".to_owned(),
        });
        // A failure does not matter: the terminal may be gone.
        let _ = Served::new(summary, self.ticks.map(Tick)).show(self.json);
    }

    /// Prints how the world ended.
    fn tell_of_end(&self, summary: &ServerSummary) -> Result<(), Failure> {
        Served::new(summary, self.ticks.map(Tick)).show(self.json)?;
        if summary.unaudited {
            return Err(Failure::ended(
                "the nodes did not say at the end what they own, so nobody knows whether bodies are lost; see their logs",
            ));
        }
        if summary.lost + summary.doubled > 0 {
            return Err(Failure::ended(format!(
                "{} bodies are lost and {} doubled: this is a fault of dcd; please report it with the logs (-vv)",
                summary.lost, summary.doubled
            )));
        }
        Ok(())
    }

    /// Opens the scene or the snapshot with which the world begins.
    fn origin(&self, common: &Common) -> Result<Beginning, Failure> {
        if !snapshot::is_one(&self.scene) {
            let mut scene = scenes::open(&self.scene, &Params::from_args(&self.set)?)?;
            self.fidelity.apply(&mut scene)?;
            let world = self.cuts.served_config(&scene, self.regions)?;
            world.tree().map_err(|error| explained(error.into(), &scene))?;
            return Ok(Beginning::Scene(Box::new((scene, world))));
        }
        let begun = [("--set", !self.set.is_empty()), ("--regions", self.regions.is_some())];
        let given =
            begun.into_iter().chain(self.fidelity.given()).find(|(_, given)| *given).map(|(name, _)| name);
        if let Some(name) = given.or_else(|| self.cuts.first_given()) {
            return Err(Failure::usage(format!(
                "{} is a snapshot, which goes on as it was begun; leave {name} out, or serve the scene anew",
                self.scene
            )));
        }
        Ok(Beginning::Snapshot(Box::new(snapshot::restore(&self.scene, 1, common)?)))
    }

    /// Returns whether a user who asked for an end wants the world to end, and not only its server.
    fn ends(&self, interrupt: Interrupt, common: &Common) -> bool {
        // A parent process asks for that by the end of standard input, or passes on what the terminal says.
        let ends = self.until_stdin_ends
            || interrupt.pressed() && std::io::stdin().is_terminal() && {
                common.say("stopping, and keeping the world; Ctrl-C again ends it for all");
                interrupt.asked_again(AGAIN)
            };
        if ends {
            common.say("ending the world");
        }
        ends
    }

    fn groups(&self) -> Result<GroupConfig, Failure> {
        let delay = match (self.near, self.far) {
            (Some(near), Some(far)) if near >= far => {
                return Err(Failure::usage(format!(
                    "--near {near} must be below --far {far}: else nodes would come and go for ever"
                )));
            }
            (Some(inclusion_ms), Some(rejection_ms)) => {
                let deviation_ms = rejection_ms - inclusion_ms;
                Some(DelayThresholds { inclusion_ms, rejection_ms, deviation_ms })
            }
            _ => None,
        };
        let thresholds = Thresholds { delay, between_groups_m: self.agree, ..Thresholds::default() };
        let max_size = usize::from(self.group_size);
        let policy = if self.powers_of_two { GroupPolicy::PowersOfTwo } else { GroupPolicy::Largest };
        let grouping = Grouping { max_size, policy, ..Grouping::default() };
        Ok(GroupConfig { lag_ticks: self.lag, thresholds, grouping })
    }

    fn onlooker(&self, server: &ServerProcess, common: &Common) -> Result<Option<Onlooker>, Failure> {
        let join = |at| Onlooker::join(at, server.address, server.token(JoinRole::Client, AT_ONCE)?, common);
        self.view.map(join).transpose()
    }

    /// Reports memberships until the world ends or the user asks for its end.
    fn watch(
        &self,
        server: &ServerProcess,
        mut onlooker: Option<Onlooker>,
        interrupt: Interrupt,
        common: &Common,
    ) -> Result<(), Failure> {
        let bar = common.progress(self.ticks.unwrap_or(0), "ticks", self.json || self.ticks.is_none());
        let mut told = None;
        while !server.is_over() && !interrupt.asked() {
            server.wait(LOOK, |_, view| shares(view) != told);
            let view = server.view();
            bar.set_position(server.summary().tick.0);
            requests::obey(&self.data, server);
            onlooker.iter_mut().for_each(Onlooker::look);
            if shares(view.as_ref()) != told {
                told = shares(view.as_ref());
                bar.suspend(|| print(&membership(view.as_ref())))?;
            }
        }
        bar.finish_and_clear();
        Ok(())
    }
}

/// The world that a server begins with.
enum Beginning {
    Scene(Box<(Scene, WorldConfig)>),
    Snapshot(Box<LocalWorld>),
}

/// Starts the server, or stands by until it is its turn. Returns `None` if the user asked for an end before
/// that.
fn start(
    origin: &Beginning,
    config: ServeConfig,
    notifier: &Notifier,
    interrupt: Interrupt,
) -> Result<Option<ServerProcess>, Failure> {
    let stands_by = config.directory.is_some();
    let fails = |error| match (error, origin) {
        (ProcessError::World(error), Beginning::Scene(scene)) => explained(error, &scene.0),
        (ProcessError::Host(error), Beginning::Scene(scene)) => explained(error.into(), &scene.0),
        (ProcessError::Lag { coupling }, Beginning::Snapshot(_)) => Failure::usage(format!(
            "--lag is for worlds that agree by `owner`, and this snapshot goes on by `{coupling}`, as it was begun; leave --lag out, or serve the \
             scene anew with --coupling owner"
        )),
        (error @ ProcessError::Metrics { .. }, _) if stands_by => Failure::usage(format!(
            "{error}; of servers on one machine that stand by for one another each needs a --metrics of its own, as it does a --listen"
        )),
        (error, _) => error.into(),
    };
    let mut told = None;
    let mut stand_by = |why: &str, stands_by: bool| {
        notifier.alive();
        if !stands_by {
            notifier.waits(why);
        }
        // Only who holds the world counts, not how etcd words each time that it does not answer.
        let news = Some(if stands_by { why.to_owned() } else { String::new() });
        if told != news {
            told = news;
            if stands_by {
                notifier.ready(why);
            }
            // A failure to print does not end the standby.
            let _ = print(why);
        }
        !interrupt.asked()
    };
    let beginning = runtime::Beginning::of(match origin {
        Beginning::Scene(scene) => Origin::Scene(&scene.0, &scene.1),
        Beginning::Snapshot(world) => Origin::World(world),
    });
    let started =
        beginning.and_then(|beginning| ServerProcess::start_or_stand_by(beginning, config, &mut stand_by));
    started.map_err(fails)
}

/// Returns the number of a view, and which regions each member has.
fn shares(view: Option<&View>) -> Option<(ViewNumber, Allocation)> {
    view.map(|view| (view.number, view.allocation.clone()))
}

/// Describes a membership in one line.
fn membership(view: Option<&View>) -> String {
    let Some(view) = view else { return "view none: no node is left; the world waits for one".to_owned() };
    let shares: Vec<_> = view
        .members
        .iter()
        .map(|member| {
            let regions: Vec<_> = view
                .allocation
                .iter()
                .filter(|(_, node)| **node == member.node)
                .map(|(region, _)| region.to_string())
                .collect();
            let does = if regions.is_empty() { "waits".to_owned() } else { regions.join(" ") };
            format!("{} {does}", member.node)
        })
        .collect();
    format!("view {} at tick {}: {}; {} leads", view.number.0, view.tick.0, shares.join(", "), view.leader)
}

fn after_help() -> String {
    format!(
        "Prints `listening ADDR` first, with --metrics `metrics URL`, then `going on with the world at tick N` if --data holds one that has not ended, a line\n\
         `view NUMBER at tick T: n1 r1, n2 r2; n1 leads` whenever the nodes or their shares change, and the summary last; with\n\
         --json as an object with the keys tick bodies regions nodes views repartitions lost doubled audited state_hash bytes seconds kept (state_hash\n\
         with --ticks only; views, repartitions and seconds since this start; kept: whether the world goes on). Exits with 3, and is not to be\n\
         started again by itself, when the world has ended and the last look at it finds bodies lost or doubled or finds nodes that do not\n\
         say what they own, when it has ended and --record is not whole, and when it has ended while this server stood by.\n\n\
         A server that dies is to be started again with the same options: nodes compute on meanwhile, and they and clients dial\n\
         it again. Nodes may be some seconds ahead of tick N. SIGTERM, SIGHUP and Ctrl-C stop the server in the same way, with exit\n\
         code 0: the world goes on. `dcd end --data DIR` ends it for all, and so does a second Ctrl-C within two seconds\n\
         where standard input is a terminal. --data keeps the keys (authority.pem), the list of used tokens (joins.log), locks, and the world (world.redb).\n\n{}",
        scenes::overview()
    )
}
