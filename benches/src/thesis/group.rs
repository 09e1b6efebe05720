//! Runs a group of participants, each in a process of its own, and a server in this process.

use std::error::Error;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use dcd::net::JoinRole;
use dcd::protocol::Pace;
use dcd::runtime::{Origin, ServeConfig, ServerProcess, WorldConfig};
use dcd::scene::{Params, Scene};
use dcd::space::{Balance, Load};

use super::participant::Report;

const LIMIT: Duration = Duration::from_secs(300);

/// The reports of one group.
pub(super) struct Group {
    pub(super) leader: u32,
    pub(super) members: Vec<Report>,
}

/// The length of a run, which ends when both are over.
#[derive(Clone, Copy)]
pub(super) struct Length {
    pub(super) ticks: u64,
    pub(super) time: Duration,
}

/// Runs so many participants in a world of so many cubes.
pub(super) fn run(nodes: usize, objects: usize, seed: u64, length: Length) -> Result<Group, Box<dyn Error>> {
    let scene = Scene::named("dve", &Params::new().with("n", objects).with("seed", seed))?;
    // Balance by counts: where processes share cores, times say what the others do.
    let balance = Some(Balance { load: Load::Counts, ..Balance::by_nodes() });
    let world = WorldConfig { balance, ..WorldConfig::for_scene(&scene) };
    let data = tempfile::tempdir()?;
    let config = ServeConfig { nodes, pace: Pace::Unpaced, events: false, ..ServeConfig::new(data.path()) };
    let server = ServerProcess::start(Origin::Scene(&scene, &world), config)?;
    let mut participants = Participants::default();
    let (low, high) = (scene.bounds.min, scene.bounds.max);
    for i in 0..nodes {
        // Along a diagonal of the world.
        let part = (i as f64 + 0.5) / nodes as f64;
        let at = [0, 1, 2].map(|axis| low[axis] + part * (high[axis] - low[axis]));
        participants.start(&server, at)?;
    }
    let running = |at_least: u64| {
        server.wait(LIMIT, |summary, view| {
            view.is_some_and(|view| view.members.len() == nodes) && summary.tick.0 >= at_least
        })
    };
    let failed = |what: &str| format!("{nodes} nodes, {objects} cubes: {what} within {} s", LIMIT.as_secs());
    if !running(1) {
        return Err(failed("not all joined").into());
    }
    let begun = Instant::now();
    if !running(length.ticks) {
        return Err(failed("too few ticks").into());
    }
    std::thread::sleep(length.time.saturating_sub(begun.elapsed()));
    let view = server.view().ok_or("nobody is left")?;
    if view.members.len() != nodes {
        return Err(failed("not all stayed").into());
    }
    let summary = server.stop()?;
    let members = participants.reports()?;
    if (summary.lost, summary.doubled) != (0, 0) {
        return Err(format!("{} bodies are lost, {} doubled", summary.lost, summary.doubled).into());
    }
    Ok(Group { leader: view.leader.0, members })
}

/// Processes that end with the run, whatever becomes of it.
#[derive(Default)]
struct Participants(Vec<Child>);

impl Participants {
    fn start(&mut self, server: &ServerProcess, at: [f64; 3]) -> Result<(), Box<dyn Error>> {
        let token = server.token(JoinRole::Participant, LIMIT)?;
        let child = Command::new(std::env::current_exe()?)
            .args(["thesis-participant", "--server", &server.address.to_string(), "--token", &token, "--at"])
            .args(at.map(|v| v.to_string()))
            .stdout(Stdio::piped())
            .spawn()
            .map_err(|error| format!("cannot start a participant: {error}"))?;
        self.0.push(child);
        Ok(())
    }

    fn reports(&mut self) -> Result<Vec<Report>, Box<dyn Error>> {
        let children = std::mem::take(&mut self.0);
        let report = |child: Child| -> Result<Report, Box<dyn Error>> {
            let output = child.wait_with_output()?;
            let said = String::from_utf8_lossy(&output.stdout);
            serde_json::from_str(&said)
                .map_err(|error| format!("a participant said {said:?}: {error}").into())
        };
        children.into_iter().map(report).collect()
    }
}

impl Drop for Participants {
    fn drop(&mut self) {
        for child in &mut self.0 {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}
