//! Implements `dcd status`: shows which nodes compute a served world, and how it goes.

use std::fmt::Write;
use std::io::IsTerminal;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant, SystemTime};

use serde::Serialize;

use super::common::{Common, print_to_reader};
use super::failure::Failure;
use super::interrupt::Interrupt;
use super::values::{SERVER, address, is_used, joining, of_folder};
use crate::net::{Authority, JoinRole, NetError};
use crate::protocol::{NodeStatus, Status as Told};
use crate::runtime::measure::FidelityShare;
use crate::runtime::{ProcessError, StatusLink, is_served, is_standby};
use crate::space::Bounds;

/// The time between two answers of the server, from which rates follow.
const BETWEEN: Duration = Duration::from_secs(1);
/// The most time for an answer.
const ANSWER: Duration = Duration::from_secs(10);
/// The longest time to wait for an answer with --watch before the server is dialled again: another one may
/// have taken over, which the link with one that was cut off does not tell for as long as ten seconds.
const ANSWER_WATCHED: Duration = Duration::from_secs(3);
/// How long a token of our own is valid: it is used at once.
const AT_ONCE: Duration = Duration::from_secs(60);
/// The interval at which Ctrl-C is looked for.
const LOOK: Duration = Duration::from_millis(50);
/// Clears a terminal, and goes to its upper left corner.
const CLEAR: &str = "\x1b[2J\x1b[H";

/// Shows who computes a served world: nodes, groups, regions and their owners, and how fast it goes
///
/// Takes a second, to measure rates. On the server's machine, `--data` in place of `--token` makes the token.
///
/// Examples:
///   dcd status --data /var/lib/dcd
///   dcd status --server 192.0.2.7:7420 --token dcd1-... --json
#[derive(clap::Args)]
#[command(
    verbatim_doc_comment,
    after_long_help = "--json prints an object with the keys tick ticks_per_s real_time bodies clients main_group nodes groups regions. nodes are\n\
                       objects with node address client group state regions bodies load delay_ms unreached; groups with group view tick leader\n\
                       changing clients fidelity (as of dcd run; null where all is computed in full); regions with region group owner bodies min max. real_time is 1 where the world keeps up with the clock.\n\
                       With --watch there is a line per second."
)]
pub(super) struct Status {
    /// The server's address; with standby servers (`dcd serve --directory`) all addresses, separated by
    /// commas
    #[arg(long, value_name = "ADDR", default_value = SERVER, value_parser = address, value_delimiter = ',')]
    server: Vec<SocketAddr>,
    /// Token from `dcd token --role client`; it is used up by this
    #[arg(long, required_unless_present = "data")]
    token: Option<String>,
    /// The server's data folder, on its machine: whoever may read it needs no token
    #[arg(long, value_name = "DIR", conflicts_with = "token")]
    data: Option<PathBuf>,
    /// Show the status once per second until Ctrl-C; a server that is gone is dialled again
    #[arg(long)]
    watch: bool,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

impl Status {
    pub(super) fn execute(self, common: &Common) -> Result<ExitCode, Failure> {
        let interrupt = Interrupt::listen()?;
        let mut link = interrupt.at_once(|| self.dial())?;
        let (mut last, mut is_lost) = (None, false);
        let patience = if self.watch { ANSWER_WATCHED } else { ANSWER };
        while !interrupt.asked() {
            match interrupt.at_once(|| asked(&mut link, is_lost, patience)) {
                Ok(now) => {
                    let at = Instant::now();
                    if let Some((before, then)) = last.replace((now.clone(), at))
                        && !self.show(&Report::of(&before, &now, at.duration_since(then)))?
                    {
                        return Ok(ExitCode::SUCCESS);
                    }
                    is_lost = false;
                }
                Err(error) if self.goes_on_after(&error) => {
                    if !std::mem::replace(&mut is_lost, true) {
                        common.say(&format!("{}; dialling it again until Ctrl-C", lost(&error)));
                    }
                    // No rate is of the time without the server.
                    last = None;
                }
                Err(error) => return Err(self.failure(error)),
            }
            pause(interrupt);
        }
        Ok(interrupt.exit_code())
    }

    fn dial(&self) -> Result<StatusLink, Failure> {
        let token = self.token()?;
        StatusLink::connect(&joining(&self.server, token)).map_err(|error| self.failure(error))
    }

    /// Shows a report; returns whether another one is to follow.
    fn show(&self, report: &Report) -> Result<bool, Failure> {
        let text = if self.json { report.json()? } else { report.table() };
        let is_screen = self.watch && !self.json && std::io::stdout().is_terminal();
        let is_read = print_to_reader(&if is_screen { format!("{CLEAR}{text}") } else { text })?;
        Ok(is_read && self.watch)
    }

    /// Returns whether the server is to be dialled again after an error: it may come back, or another one may
    /// take over.
    fn goes_on_after(&self, error: &ProcessError) -> bool {
        self.watch && !matches!(error, ProcessError::Net(NetError::WrongPeer { .. }))
    }

    /// Returns the failure, with a hint at --server where --data and the usual address were used: the server
    /// of that folder may listen elsewhere.
    fn failure(&self, error: ProcessError) -> Failure {
        if matches!(error, ProcessError::ServerGone { .. }) {
            return Failure::run(format!("{}; see whether it runs, and ask again", lost(&error)));
        }
        if self.data.is_some()
            && self.is_at_usual_address()
            && matches!(error, ProcessError::Net(NetError::Unreachable { .. }))
        {
            return Failure::run(format!(
                "{error}; a server that stands by, or listens elsewhere, needs --server"
            ));
        }
        error.into()
    }

    fn is_at_usual_address(&self) -> bool {
        SERVER.parse().is_ok_and(|usual| self.server == [usual])
    }

    fn token(&self) -> Result<String, Failure> {
        let Some(data) = &self.data else { return Ok(self.token.clone().unwrap_or_default()) };
        if !is_used(data)? {
            return Err(Failure::usage(format!(
                "no server has used {}; name the folder that its server was started with (--data)",
                data.display()
            )));
        }
        if self.is_at_usual_address()
            && !is_standby(data)
            && !is_served(data).map_err(|error| of_folder(&error))?
        {
            return Err(Failure::usage(format!(
                "no server runs in {}; start it, or name the address of the one that has its world (--server)",
                data.display()
            )));
        }
        let token =
            Authority::load_or_create(data)?.issue_token(JoinRole::Client, AT_ONCE, SystemTime::now())?;
        Ok(token.to_string())
    }
}

/// Asks a server, which is dialled again first if its link is lost.
fn asked(link: &mut StatusLink, is_lost: bool, patience: Duration) -> Result<Told, ProcessError> {
    if is_lost {
        link.dial_again(ANSWER)?;
    }
    link.ask(patience)
}

/// Waits until the next answer is due, or the user asks for the end.
fn pause(interrupt: Interrupt) {
    let begun = Instant::now();
    while begun.elapsed() < BETWEEN && !interrupt.asked() {
        std::thread::sleep(LOOK.min(BETWEEN.saturating_sub(begun.elapsed())));
    }
}

/// Says that a server is out of reach, without the remedy of who takes part in its world.
fn lost(error: &ProcessError) -> String {
    match error {
        ProcessError::ServerGone { server, reason } => {
            format!("the link to the server at {server} is gone ({reason})")
        }
        error => error.to_string(),
    }
}

/// The status that is shown.
#[derive(Serialize)]
struct Report {
    tick: u64,
    ticks_per_s: f64,
    real_time: f64,
    bodies: u32,
    clients: u32,
    main_group: String,
    nodes: Vec<Node>,
    groups: Vec<Group>,
    regions: Vec<Region>,
}

#[derive(Serialize)]
struct Node {
    node: String,
    address: SocketAddr,
    client: Option<String>,
    group: Option<String>,
    state: &'static str,
    regions: Vec<String>,
    bodies: u32,
    /// Its share of the bodies of its group, 0 to 1.
    load: f64,
    delay_ms: Option<f32>,
    unreached: u32,
}

#[derive(Serialize)]
struct Group {
    group: String,
    view: u64,
    tick: u64,
    leader: Option<String>,
    changing: bool,
    clients: u32,
    /// As `dcd run` prints it.
    fidelity: Option<FidelityShare>,
}

#[derive(Serialize)]
struct Region {
    region: String,
    group: String,
    owner: String,
    bodies: u32,
    min: [f64; 3],
    max: [f64; 3],
}

impl Report {
    /// Creates it from two answers, and the time between them.
    fn of(before: &Told, now: &Told, between: Duration) -> Self {
        // Between the moments at which the server heard of the two ticks.
        let [since, from] = [now, before].map(|told| f64::from(told.heard_ms) / 1e3);
        let ticks = now.tick.0.saturating_sub(before.tick.0) as f64;
        let heard_s = between.as_secs_f64() + from - since;
        // Another main group has been heard of at other times.
        let is_same = before.main == now.main && heard_s > 0.1;
        let ticks_per_s = ticks / if is_same { heard_s } else { between.as_secs_f64() };
        let groups = now.groups.iter().map(|group| Group {
            group: group.group.to_string(),
            view: group.view.0,
            tick: group.tick.0,
            leader: group.leader.map(|leader| leader.to_string()),
            changing: group.is_changing,
            clients: group.clients,
            fidelity: group.fidelity.map(FidelityShare::from),
        });
        let regions = now.groups.iter().flat_map(|group| {
            group.regions.iter().map(|region| {
                let Bounds { min, max } = region.bounds;
                let (region, owner, bodies) =
                    (region.region.to_string(), region.owner.to_string(), region.bodies);
                Region { region, group: group.group.to_string(), owner, bodies, min, max }
            })
        });
        Self {
            tick: now.tick.0,
            ticks_per_s,
            real_time: ticks_per_s * f64::from(now.dt_s),
            bodies: now.bodies,
            clients: now.clients,
            main_group: now.main.to_string(),
            nodes: now.nodes.iter().map(|node| Node::of(node, now)).collect(),
            groups: groups.collect(),
            regions: regions.collect(),
        }
    }

    fn json(&self) -> Result<String, Failure> {
        serde_json::to_string(self)
            .map_err(|error| Failure::run(format!("cannot write JSON: {error}; leave --json out")))
    }

    fn table(&self) -> String {
        let mut text = format!(
            "tick {}, {:.1} per second ({:.2} of real time); {} bodies, {} regions, {} nodes, {} clients\n",
            self.tick,
            self.ticks_per_s,
            self.real_time,
            self.bodies,
            self.regions.len(),
            self.nodes.len(),
            self.clients
        );
        for Group { group, view, tick, leader, changing, clients, fidelity } in &self.groups {
            let leader = match leader {
                Some(leader) => format!("{leader} leads"),
                None => "no node computes it".to_owned(),
            };
            let changing = if *changing { ", membership changes" } else { "" };
            let main = if *group == self.main_group { " (main)" } else { "" };
            let _ = writeln!(
                text,
                "{group}{main}: view {view} at tick {tick}, {leader}, {clients} clients{changing}"
            );
            if let Some(fidelity) = fidelity {
                let _ = writeln!(text, "  {}", fidelity.words());
            }
        }
        // Names are long after a world has gone back to a backup.
        let names =
            self.nodes.iter().map(|node| &node.node).chain(self.regions.iter().map(|region| &region.owner));
        let wide = names.map(|name| name.len() + 1).max().unwrap_or_default().max(6);
        let row = |text: &mut String, cells: [&str; 7]| {
            let [node, group, state, regions, bodies, load, delay] = cells;
            let line =
                format!("{node:<wide$}{group:<6}{state:<10}{regions:<16}{bodies:>8}{load:>7}{delay:>10}");
            let _ = write!(text, "\n{line}");
        };
        row(&mut text, ["node", "group", "state", "regions", "bodies", "load", "delay"]);
        let _ = write!(text, "  address");
        for node in &self.nodes {
            let delay = node.delay_ms.map_or_else(|| "-".to_owned(), |delay| format!("{delay:.1} ms"));
            let (bodies, load) = (node.bodies.to_string(), format!("{:.0} %", 100.0 * node.load));
            let group = node.group.as_deref().unwrap_or("-");
            row(&mut text, [&node.node, group, node.state, &node.regions.join(" "), &bodies, &load, &delay]);
            let _ = write!(text, "  {}", node.address);
            if node.unreached > 0 {
                let _ = write!(text, "  does not reach {} others", node.unreached);
            }
        }
        let _ =
            write!(text, "\n\n{:<8}{:<6}{:<wide$}{:>8}  from, to (m)", "region", "group", "owner", "bodies");
        for Region { region, group, owner, bodies, min, max } in &self.regions {
            let [from, to] = [min, max].map(|at| at.map(|value| format!("{value:.1}")).join(" "));
            let _ = write!(text, "\n{region:<8}{group:<6}{owner:<wide$}{bodies:>8}  {from}, {to}");
        }
        text
    }
}

impl Node {
    fn of(node: &NodeStatus, world: &Told) -> Self {
        let group = node.group.and_then(|id| world.groups.iter().find(|group| group.group == id));
        let all = group.map(|group| &group.regions[..]).unwrap_or_default();
        let own = || all.iter().filter(|region| region.owner == node.node);
        let bodies: u32 = own().map(|region| region.bodies).sum();
        let in_group: u32 = all.iter().map(|region| region.bodies).sum();
        let state = match node {
            NodeStatus { is_linked: false, .. } => "lost",
            NodeStatus { is_leaving: true, .. } => "leaves",
            NodeStatus { is_loaded: false, .. } => "loads",
            _ if group.is_some_and(|group| group.leader == Some(node.node)) => "leads",
            _ if own().next().is_some() => "computes",
            _ => "waits",
        };
        Self {
            node: node.node.to_string(),
            address: node.address,
            client: node.client.map(|client| client.to_string()),
            group: node.group.map(|group| group.to_string()),
            state,
            regions: own().map(|region| region.region.to_string()).collect(),
            bodies,
            load: if in_group > 0 { f64::from(bodies) / f64::from(in_group) } else { 0.0 },
            delay_ms: node.delay_ms,
            unreached: node.unreached,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space::{GroupId, Tick};

    #[test]
    fn a_rate_is_of_the_time_between_what_the_server_heard() {
        let told = |tick, heard_ms| Told {
            tick: Tick(tick),
            heard_ms,
            dt_s: 1.0 / 60.0,
            bodies: 0,
            clients: 0,
            main: GroupId(1),
            groups: Vec::new(),
            nodes: Vec::new(),
        };
        let rate = |before: Told, now: Told| Report::of(&before, &now, Duration::from_secs(1)).ticks_per_s;
        // It heard of three half seconds, or of one, in a second.
        assert!((rate(told(30, 499), told(120, 0)) - 60.0).abs() < 0.1);
        assert!((rate(told(30, 0), told(60, 499)) - 60.0).abs() < 0.2);
        assert_eq!(rate(told(30, 200), told(30, 1_200)), 0.0, "it stands");
    }

    #[test]
    fn a_folder_whose_server_is_not_at_the_usual_address_leads_to_the_option_for_it() {
        let usual: SocketAddr = SERVER.parse().unwrap();
        let fails = |data: Option<&str>, server: Vec<SocketAddr>| {
            let (token, data) = (None, data.map(PathBuf::from));
            let status = Status { server, token, data, watch: false, json: false };
            let error = NetError::Unreachable { addr: usual, waited: ANSWER };
            status.failure(error.into()).message().contains("needs --server")
        };
        assert!(fails(Some("dcd-data"), vec![usual]));
        assert!(!fails(Some("dcd-data"), vec![usual, usual]));
        assert!(!fails(None, vec![usual]));
    }
}
