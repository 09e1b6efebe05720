//! One measurement, here or in the second build. Rapier's `parallel` is a feature of the whole program, so its reference is
//! measured by this program built again with it: a child process that waits while worlds are timed here, and the other way
//! round.

use std::error::Error;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use clap::Args;
use dcd::runtime::measure::{Plan, Subject};
use dcd::runtime::{Partitioning, WorldConfig};
use dcd::scene::Scene;
use serde::{Deserialize, Serialize};

use super::case::{Case, Variant};
use crate::timing::StepMs;

/// Times worlds of one case on request: started by `speed`, one line of JSON each way.
#[derive(Args)]
pub(crate) struct SpeedWorker {
    #[arg(long)]
    scene: String,
    #[arg(long)]
    bodies: usize,
    #[arg(long)]
    settle_s: f64,
}

/// What a run gave.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Measurement {
    pub(super) step: StepMs,
    pub(super) replicas: usize,
    pub(super) coupling: String,
    pub(super) exchanges: usize,
}

#[derive(Serialize, Deserialize)]
struct Request {
    variant: Variant,
    ticks: usize,
}

/// Steps a fresh world of the scene.
pub(super) fn measure(scene: &Scene, variant: &Variant, ticks: usize) -> Result<Measurement, Box<dyn Error>> {
    let config = (variant.regions > 0).then(|| WorldConfig {
        partitioning: Partitioning::Regions(variant.regions),
        threads: variant.threads,
        ..WorldConfig::for_scene(scene)
    });
    let settings = config.as_ref().map(|config| config.step);
    let plan = Plan { config, ticks: ticks as u64 };
    let mut subject = plan.subject(scene)?;
    let step = StepMs::of(&mut subject, ticks)?;
    let replicas = match &subject {
        Subject::Bare(_) => 0,
        Subject::Regions(world) => world.stats().replicas,
    };
    Ok(Measurement {
        step,
        replicas,
        coupling: settings.map_or("none", |step| step.coupling.name()).to_owned(),
        exchanges: settings.map_or(0, |step| step.exchanges),
    })
}

impl SpeedWorker {
    pub(crate) fn run(self) -> Result<(), Box<dyn Error>> {
        let name = super::case::names().into_iter().find(|name| *name == self.scene);
        let scene = name.ok_or_else(|| format!("no case has the scene `{}`", self.scene))?;
        let scene = Case { scene, bodies: self.bodies, settle_s: self.settle_s }.scene()?;
        for line in std::io::stdin().lines() {
            let Request { variant, ticks } = serde_json::from_str(&line?)?;
            println!("{}", serde_json::to_string(&measure(&scene, &variant, ticks)?)?);
        }
        Ok(())
    }
}

/// Builds this program with Rapier's `parallel`, in a folder of its own: the two builds would undo one another.
pub(super) fn parallel_build() -> Result<PathBuf, Box<dyn Error>> {
    if cfg!(feature = "parallel") {
        return Err(
            "this build has the feature `parallel`, so it cannot measure a serial world; run it without"
                .into(),
        );
    }
    let program = std::env::current_exe()?;
    let profile = program.parent().ok_or("this program lies in no folder")?;
    let folder = profile.parent().ok_or("this program lies in no target folder")?.join("parallel");
    eprintln!("builds itself with Rapier's `parallel` in {}", folder.display());
    let mut cargo = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    cargo.args(["build", "--quiet", "--package", "dcd-benches", "--features", "parallel", "--target-dir"]);
    cargo.arg(&folder).current_dir(env!("CARGO_MANIFEST_DIR"));
    if !cfg!(debug_assertions) {
        cargo.arg("--release");
    }
    let status = cargo.status().map_err(|error| format!("cannot run cargo: {error}; try `--no-parallel`"))?;
    if !status.success() {
        return Err("the build with Rapier's `parallel` failed; `--no-parallel` does without it".into());
    }
    Ok(folder.join(profile.file_name().unwrap_or_default()).join(program.file_name().unwrap_or_default()))
}

/// The second build, measuring one case.
pub(super) struct Worker {
    child: Child,
    requests: Option<ChildStdin>,
    answers: BufReader<ChildStdout>,
}

impl Worker {
    pub(super) fn start(program: &Path, case: &Case, threads: usize) -> Result<Self, Box<dyn Error>> {
        let mut child = Command::new(program)
            .args(["speed-worker", "--scene", case.scene])
            .args(["--bodies", &case.bodies.to_string(), "--settle-s", &case.settle_s.to_string()])
            // A Rapier world without a pool of its own uses rayon's.
            .env("RAYON_NUM_THREADS", threads.to_string())
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .map_err(|error| format!("cannot start {}: {error}", program.display()))?;
        let requests = child.stdin.take();
        let answers = BufReader::new(child.stdout.take().expect("its output is piped"));
        Ok(Self { child, requests, answers })
    }

    pub(super) fn measure(&mut self, variant: &Variant, ticks: usize) -> Result<Measurement, Box<dyn Error>> {
        let request = serde_json::to_string(&Request { variant: variant.clone(), ticks })?;
        let mut answer = String::new();
        writeln!(self.requests.as_ref().expect("open until dropped"), "{request}")?;
        if self.answers.read_line(&mut answer)? == 0 {
            return Err("the second build ended early; its error stands above".into());
        }
        Ok(serde_json::from_str(&answer)?)
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        // The end of its input ends it.
        drop(self.requests.take());
        let _ = self.child.wait();
    }
}
