//! Implements `dcd demo`: runs server, nodes and a C client as real processes on this machine.

mod process;
mod program;
mod story;

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};
use std::time::{Duration, Instant};

use serde_json::Value;

use self::process::Process;
use self::story::{Cast, Played, Restart, Takeover, told};
use super::common::Common;
use super::failure::Failure;
use super::interrupt::Interrupt;
use super::scenes;
use super::summary::Summary;
use super::values::wall_seconds;
use crate::net::{Authority, JoinRole};
use crate::scene::{AvatarHint, Params, Scene};

/// The longest time for a step that takes a second or two, on a busy machine.
const STEP: Duration = Duration::from_secs(30);
/// The interval at which Ctrl-C is looked for.
const LOOK: Duration = Duration::from_millis(20);
/// The time without a server after one was killed: nodes take a second to miss it.
const DOWN: Duration = Duration::from_millis(1500);

/// Shows a world that several processes compute and that a C program plays in
///
/// Starts a server and nodes as processes of their own, builds examples-c/join.c against the C library, lets
/// it drive an avatar through the world, and tells what happened. Needs a C compiler and dcd's sources.
#[derive(clap::Args)]
#[command(
    verbatim_doc_comment,
    after_long_help = "--json prints an object last, with the keys nodes regions bodies ticks tick_ms{p50,p99} transfers ghosts_mean lost\n\
                       doubled client_updates client_contacts avatar_moved_m bytes_per_s. tick_ms is that of the slowest node; bytes_per_s is\n\
                       what server and nodes receive and send. Exits with 1 when bodies are lost or doubled, or when the C program\n\
                       has heard of no contact."
)]
pub(super) struct Demo {
    /// How long the C program plays, in seconds
    #[arg(long, value_name = "S", default_value = "10", value_parser = wall_seconds)]
    seconds: Duration,
    /// How many nodes compute the world
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u8).range(1..=64))]
    nodes: u8,
    /// A shipped scene file by its name, a scene file, or a scene of the library
    #[arg(long, value_name = "FILE|NAME", default_value = "playground")]
    scene: String,
    /// Kill one of the nodes half-way (needs two at least): the others take over its regions
    #[arg(long)]
    kill: bool,
    /// Kill the server after a third of the time, and start it again soon after: the nodes compute on meanwhile
    #[arg(long)]
    kill_server: bool,
    /// Print the result as one JSON object
    #[arg(long)]
    json: bool,
    /// Run this program instead of examples-c/join.c
    #[arg(long, value_name = "PATH", hide = true)]
    client_program: Option<PathBuf>,
    /// Link this C library instead of one that is built for the demo
    #[arg(long, value_name = "PATH", hide = true)]
    c_library: Option<PathBuf>,
}

impl Demo {
    pub(super) fn execute(self, common: &Common) -> Result<ExitCode, Failure> {
        if self.kill && self.nodes < 2 {
            return Err(Failure::usage("--kill needs another node that takes over; give --nodes 2 or more"));
        }
        let interrupt = Interrupt::listen()?;
        let workspace = program::workspace();
        let hint = avatar(&scenes::open(&self.scene, &Params::new())?, self.seconds);
        let folder = tempfile::Builder::new().prefix("dcd-demo-").tempdir().map_err(|error| {
            Failure::run(format!(
                "cannot make a temporary folder: {error}; point TMPDIR at one that can be written to"
            ))
        })?;
        let program = match &self.client_program {
            Some(program) => program.clone(),
            None => program::build(&workspace?, folder.path(), self.c_library.as_deref(), common, interrupt)?,
        };
        let show = Show {
            common,
            interrupt,
            folder: folder.path(),
            authority: Authority::load_or_create(folder.path())?,
        };
        let played = show.play(&self, &program, &hint)?;
        if !self.json {
            super::common::print(&told(&played))?;
        } else {
            played.result.show(true)?;
        }
        let result = &played.result;
        if result.lost + result.doubled > 0 {
            return Err(Failure::run(format!(
                "{} bodies are lost and {} doubled: this is a fault of dcd; please report it",
                result.lost, result.doubled
            )));
        }
        if result.client_contacts == 0 {
            return Err(Failure::run(
                "the C program heard of no contact: its avatar met nothing; give it more --seconds",
            ));
        }
        Ok(ExitCode::SUCCESS)
    }
}

/// Data that every scene of the demo needs.
struct Show<'a> {
    common: &'a Common,
    interrupt: Interrupt,
    folder: &'a Path,
    authority: Authority,
}

impl Show<'_> {
    fn play(&self, demo: &Demo, program: &Path, hint: &AvatarHint) -> Result<Played, Failure> {
        let (mut server, address) = self.serve(demo, "127.0.0.1:0")?;
        self.common.say(&format!("the server listens on {address}"));

        let mut nodes = Vec::new();
        for _ in 0..demo.nodes {
            let mut computing = self.command("node");
            computing.args(["--server", &address, "--token", &self.token(JoinRole::Node)?, "--threads", "1"]);
            let mut node = self.start("a node", &mut computing)?;
            let name = node.line("joined as ", STEP, self.interrupt)?;
            let name = name.trim_start_matches("joined as ").to_owned();
            self.common.say(&format!("node {name} has joined"));
            nodes.push((name, node));
        }
        let view = server.line("view ", STEP, self.interrupt)?;
        self.common.say(&format!("the world begins: {view}"));

        let mut playing = Command::new(program);
        playing.args([&address, &self.token(JoinRole::Client)?, &demo.seconds.as_secs_f64().to_string()]);
        playing.args(hint.pose.translation.iter().map(f64::to_string));
        playing.args(hint.drive_m_s.iter().chain(&hint.half_size_m).map(f32::to_string));
        let client = Process::start("the C program", &mut playing, false)?;
        self.common.say("the C program plays");
        let began = Instant::now();
        let mut restart = None;
        if demo.kill_server {
            let after = demo.seconds / 3;
            self.wait_until(began + after)?;
            let (back, told) = self.restart(demo, server, &address, after)?;
            (server, restart) = (back, Some(told));
        }
        let takeover = match demo.kill {
            true => {
                self.wait_until(began + demo.seconds / 2)?;
                Some(self.kill(&mut nodes, &mut server, began.elapsed())?)
            }
            false => None,
        };
        let said = client.succeed(demo.seconds + STEP, self.interrupt)?;
        let joined = said.iter().rev().find(|line| line.starts_with("join: ")).cloned();
        let joined =
            joined.ok_or_else(|| Failure::run("the C program did not say what it heard (`join: …`)"))?;
        self.common
            .say(&format!("the C program ended after {:.1} s: {joined}", began.elapsed().as_secs_f64()));

        server.end();
        let served = self.summary(server, "the server")?;
        let mut computed = Vec::new();
        for (name, node) in nodes {
            computed.push(self.summary(node, &format!("node {name}"))?);
        }
        let cast = Cast {
            address,
            scene: demo.scene.clone(),
            view,
            hint: *hint,
            nodes: demo.nodes,
            takeover,
            restart,
        };
        Played::new(cast, &joined, &served, &computed)
    }

    /// Starts the server, and returns it and the address where it listens.
    fn serve(&self, demo: &Demo, listen: &str) -> Result<(Process, String), Failure> {
        let mut serving = self.command("serve");
        serving.arg(&demo.scene).args(["--listen", listen, "--nodes", &demo.nodes.to_string(), "--data"]);
        serving.arg(self.folder);
        let mut server = self.start("the server", &mut serving)?;
        let line = server.line("listening ", STEP, self.interrupt)?;
        Ok((server, line.trim_start_matches("listening ").to_owned()))
    }

    /// Waits until a time; fails if the user asks for an end.
    fn wait_until(&self, due: Instant) -> Result<(), Failure> {
        while Instant::now() < due {
            if self.interrupt.asked() {
                return Err(Failure::interrupted());
            }
            std::thread::sleep(due.saturating_duration_since(Instant::now()).min(LOOK));
        }
        Ok(())
    }

    /// Kills the server, and starts another one that goes on.
    fn restart(
        &self,
        demo: &Demo,
        server: Process,
        address: &str,
        after: Duration,
    ) -> Result<(Process, Restart), Failure> {
        server.kill();
        self.common.say("the server is killed");
        self.wait_until(Instant::now() + DOWN)?;
        let started = Instant::now();
        let (mut server, _) = self.serve(demo, address)?;
        let goes_on = server.line("going on ", STEP, self.interrupt)?;
        let view = server.line("view ", STEP, self.interrupt)?;
        let took_s = started.elapsed().as_secs_f64();
        self.common.say(&format!("the server is back after {took_s:.2} s, {goes_on}: {view}"));
        Ok((server, Restart { after_s: after.as_secs_f64(), took_s, view }))
    }

    /// Kills a node, and waits until others have taken over its regions.
    fn kill(
        &self,
        nodes: &mut Vec<(String, Process)>,
        server: &mut Process,
        after: Duration,
    ) -> Result<Takeover, Failure> {
        let (name, node) = nodes.pop().expect("there are two at least");
        node.kill();
        let killed = Instant::now();
        self.common.say(&format!("node {name} is killed"));
        let view = server.line("view ", STEP, self.interrupt)?;
        let took_s = killed.elapsed().as_secs_f64();
        self.common.say(&format!("taken over after {took_s:.2} s: {view}"));
        Ok(Takeover { killed: name, after_s: after.as_secs_f64(), took_s, view })
    }

    fn command(&self, subcommand: &str) -> Command {
        let this = std::env::current_exe().unwrap_or_else(|_| "dcd".into());
        let mut command = Command::new(this);
        command.args([subcommand, "--json", "--until-stdin-ends"]);
        command
    }

    fn start(&self, name: &str, command: &mut Command) -> Result<Process, Failure> {
        Process::start(name, command, self.common.is_verbose())
    }

    fn token(&self, role: JoinRole) -> Result<String, Failure> {
        let now = std::time::SystemTime::now();
        Ok(self.authority.issue_token(role, Duration::from_secs(600), now)?.to_string())
    }

    /// Returns the JSON object that a process prints last, whatever its exit code.
    fn summary(&self, process: Process, name: &str) -> Result<Value, Failure> {
        let (status, said) = process.finish(STEP, self.interrupt)?;
        said.last().and_then(|line| serde_json::from_str(line).ok()).ok_or_else(|| {
            Failure::run(format!("{name} ended without a summary ({status}); run with -vv to see why"))
        })
    }
}

/// Returns where the avatar starts and goes: as the scene says, else along the ground through the middle. It
/// goes so slowly that it does not leave the world.
fn avatar(scene: &Scene, time: Duration) -> AvatarHint {
    let (min, max) = (scene.bounds.min, scene.bounds.max);
    let mut hint = scene.avatar.unwrap_or_else(|| {
        let at = [min[0] + 0.1 * (max[0] - min[0]), min[1] + 0.7, 0.5 * (min[2] + max[2])];
        AvatarHint {
            pose: crate::protocol::WorldPose::at(at),
            half_size_m: [0.6; 3],
            mass_kg: 12.0,
            drive_m_s: [5.0, 0.0, 0.0],
        }
    });
    let mut share = 1.0_f64;
    for axis in 0..3 {
        let wall = if hint.drive_m_s[axis] > 0.0 { max[axis] } else { min[axis] };
        let room_m = (wall - hint.pose.translation[axis]).abs() - f64::from(hint.half_size_m[axis]);
        let way_m = f64::from(hint.drive_m_s[axis]).abs() * time.as_secs_f64();
        if way_m > 0.0 {
            share = share.min(room_m.max(0.0) / way_m);
        }
    }
    hint.drive_m_s = hint.drive_m_s.map(|v| (f64::from(v) * share) as f32);
    hint
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_avatar_does_not_leave_the_world() {
        let scene = Scene::named("pile", &Params::new()).unwrap();
        let hint = avatar(&scene, Duration::from_secs(1000));
        let end = hint.pose.translation[0] + 1000.0 * f64::from(hint.drive_m_s[0]);
        assert!(end < scene.bounds.max[0] && end > scene.bounds.max[0] - 1.0, "{hint:?}");
        assert_eq!(avatar(&scene, Duration::from_millis(10)).drive_m_s, [5.0, 0.0, 0.0]);
    }
}
