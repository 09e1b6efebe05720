//! Implements `dcd run`: steps a scene on this machine and measures it.

mod csv;
mod live;
mod outputs;
pub(in crate::cli) mod snapshot;
mod table;

use std::net::SocketAddr;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use super::common::{Common, print};
use super::failure::Failure;
use super::fidelity::FidelityArgs;
use super::film::FilmArgs;
use super::interrupt::Interrupt;
use super::scenes;
use super::values::{address, unused};
use super::view::{self, ANY_PORT};
use super::world::{CutArgs, explained};
use crate::Viewer;
use crate::recording::{Background, Reader, RecordingError};
use crate::runtime::measure::{Cast, Plan, Subject, run};
use crate::runtime::{Partitioning, WorldConfig};
use crate::scene::{Params, Scene};
use crate::space::MAX_REGIONS;

/// Steps a scene on this machine and measures it
///
/// Examples:
///   dcd run tower
///   dcd run pile --set n=20000
///   dcd run pile --set n=20000 --regions 2 --threads 2
///   dcd run pile --set n=20000 --regions 0 --json
///   dcd run tower --cut y=5 --seconds 60 --out tower.csv
///   dcd run convoy --set cars=200 --set road=20000 --regions 4 --balance
///   dcd run pile --save pile.dcd, and then dcd run pile.dcd
///   dcd run pile --set n=2000 --regions 4 --view
///   dcd run pile --record pile.dcdr, and then dcd replay pile.dcdr --check
///   dcd run town --fidelity auto --json
///   dcd run tower --regions 2 --gltf tower.glb --gltf-seconds 0..4
///   dcd run robot.urdf --set copies=100 --set ground=1 --regions 2
#[derive(clap::Args)]
#[command(verbatim_doc_comment, allow_negative_numbers = true, after_long_help = after_help())]
pub(super) struct Run {
    /// A scene of the library (`dcd scenes` lists them), a scene file (TOML, MJCF: .xml or .mjcf, URDF:
    /// .urdf), or a snapshot that --save wrote: it goes on to the same bits as if it had not been
    /// interrupted, cut and coupled as it was
    scene: String,
    /// Set a parameter of the scene; may be given several times
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Number of regions, cut by upright planes that halve the largest one; 0 steps one bare Rapier world
    /// instead, on one thread: the reference [default: what the scene says, else 1, which is exact; more only
    /// where bodies lie too far apart for the f32 of one region]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(0..=MAX_REGIONS as i64), conflicts_with = "cut")]
    regions: Option<u16>,
    #[command(flatten)]
    cuts: CutArgs,
    /// Threads that step the world, whatever its number of regions; few awake bodies are stepped by one
    /// thread. The result does not depend on the number of threads [default: all cores]
    #[arg(long, value_name = "T", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// How long to run, in simulated seconds [default: 10, or with --view until Ctrl-C]
    #[arg(long, value_name = "S", value_parser = seconds)]
    seconds: Option<f64>,
    /// Show the world in the browser: serve a page at this address, or at any free port of this machine if
    /// none is given, and print its URL on standard error. The world begins when the page is opened, runs in
    /// real time, and can be paused and stepped there
    #[arg(long, value_name = "ADDR", num_args = 0..=1, default_missing_value = ANY_PORT, value_parser = address)]
    view: Option<SocketAddr>,
    /// Print the result as one JSON object
    #[arg(long)]
    json: bool,
    /// Write the state of every movable body at the end: id,x,y,z,qx,qy,qz,qw,vx,vy,vz,wx,wy,wz,region; an
    /// existing file is replaced
    #[arg(long, value_name = "FILE.csv")]
    out: Option<PathBuf>,
    /// Save the whole world at the end, also when Ctrl-C ends it; `dcd run FILE.dcd` goes on with it. An
    /// existing file is replaced once the new one is whole
    #[arg(long, value_name = "FILE.dcd")]
    save: Option<PathBuf>,
    /// Record the world: `dcd replay FILE` computes it again, bit for bit. A file with
    /// content is refused
    #[arg(long, value_name = "FILE.dcdr")]
    record: Option<PathBuf>,
    #[command(flatten)]
    film: FilmArgs,
    #[command(flatten)]
    fidelity: FidelityArgs,
}

impl Run {
    pub(super) fn execute(self, common: &Common) -> Result<ExitCode, Failure> {
        self.record.as_deref().map_or(Ok(()), unused)?;
        outputs::check(
            &self.scene,
            [
                ("--out", self.out.as_deref()),
                ("--save", self.save.as_deref()),
                ("--record", self.record.as_deref()),
                ("--gltf", self.film.path()),
            ],
        )?;
        self.film.check_begin(self.seconds())?;
        let (cast, plan, mut subject) = self.start(common)?;
        let interrupt = Interrupt::listen()?;
        let out = self.out.map(csv::Target::check).transpose()?;
        let save = self.save.map(snapshot::Target::check).transpose()?;
        let mut camera = self.film.open()?;
        let viewer = self.view.map(|at| view::open(at, &cast.name, common));
        let mut viewer = viewer.transpose()?.map(Viewer::with_controls);
        if let (Some(path), Subject::Regions(world)) = (&self.record, &mut subject) {
            let fails = |error: RecordingError| Failure::usage(format!("{}: {error}", path.display()));
            let file = Background::create(path).map_err(|error| fails(error.into()))?;
            world.record(file).map_err(fails)?;
        }
        tracing::info!(scene = cast.name, ticks = plan.ticks, "stepping");
        let mut live = live::Live::new(common, plan.ticks, self.json);
        if let (Some(viewer), Subject::Regions(world)) = (&mut viewer, &subject) {
            viewer.wait(world, || interrupt.asked());
        }
        if let (Some(camera), Subject::Regions(world)) = (&mut camera, &subject) {
            camera.look(world.host(), 0.0);
        }
        let report = run(&cast, &plan, &mut subject, |tick, subject| {
            live.tell(tick, subject);
            if let (Some(camera), Subject::Regions(world)) = (&mut camera, subject) {
                camera.look(world.host(), tick as f64 * f64::from(cast.dt_s));
            }
            if let (Some(viewer), Subject::Regions(world)) = (&mut viewer, subject) {
                viewer.show_local(world);
                viewer.wait(world, || interrupt.asked());
            }
            if interrupt.asked() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        live.finish();
        let recorded = match &mut subject {
            Subject::Regions(world) => world.stop_recording(),
            Subject::Bare(_) => Ok(()),
        };
        let report = report?;
        // Before anything is printed: the JSON object is the last line, and its bodies can be found in the file.
        let written = out.map(|out| out.write(&subject)).transpose();
        let saved = match (save, &subject) {
            (Some(save), Subject::Regions(world)) => save.write(world, common),
            _ => Ok(()),
        };
        let filmed = match (camera, &subject) {
            (Some(camera), Subject::Regions(world)) => camera.finish(Some(world.host()), 0.0, common),
            _ => Ok(()),
        };
        if self.json {
            let json = serde_json::to_string(&report)
                .map_err(|error| Failure::run(format!("cannot write JSON: {error}; leave --json out")))?;
            print(&json)?;
        } else {
            print(&table::of(&report))?;
        }
        written?;
        saved?;
        recorded.map_err(|error| Failure::run(format!("the recording is not whole: {error}")))?;
        filmed?;
        if report.lost + report.doubled > 0 {
            return Err(Failure::run(format!(
                "{} bodies are lost and {} doubled: this is a fault of dcd; please report it with the scene",
                report.lost, report.doubled
            )));
        }
        if report.quarantined > 0 {
            return Err(Failure::run(format!(
                "{} bodies were set aside as their poses or velocities became infinite or NaN; look for forces, masses or \
                 joints of the scene that are out of all proportion, or take a smaller dt",
                report.quarantined
            )));
        }
        Ok(interrupt.exit_code())
    }

    fn start(&self, common: &Common) -> Result<(Cast, Plan, Subject), Failure> {
        if snapshot::is_one(&self.scene) {
            return self.resume(common);
        }
        if is_recording(&self.scene) {
            return Err(Failure::usage(format!(
                "{0} is a recording, which `dcd run` does not take; compute it again by `dcd replay {0}`",
                self.scene
            )));
        }
        let needs = [
            ("--save", self.save.is_some()),
            ("--view", self.view.is_some()),
            ("--record", self.record.is_some()),
            ("--gltf", self.film.is_given()),
            ("--threads", self.threads.is_some()),
        ];
        let given =
            needs.into_iter().chain(self.fidelity.given()).find(|(_, given)| *given).map(|(name, _)| name);
        if let Some(name) = given.or(self.cuts.first_given()).filter(|_| self.regions == Some(0)) {
            return Err(Failure::usage(format!(
                "{name} takes a world of regions, --regions 0 is one bare Rapier world; leave one of them out"
            )));
        }
        let mut scene = scenes::open(&self.scene, &Params::from_args(&self.set)?)?;
        self.fidelity.apply(&mut scene)?;
        let plan = self.plan(&scene)?;
        let subject = plan.subject(&scene).map_err(|error| explained(error, &scene))?;
        Ok((Cast::of_scene(&scene), plan, subject))
    }

    fn resume(&self, common: &Common) -> Result<(Cast, Plan, Subject), Failure> {
        let given = [("--set", !self.set.is_empty()), ("--regions", self.regions.is_some())];
        let contradicts =
            given.into_iter().chain(self.fidelity.given()).find(|(_, given)| *given).map(|(name, _)| name);
        if let Some(name) = contradicts.or(self.cuts.first_given()) {
            return Err(Failure::usage(format!(
                "{} is a snapshot, which goes on as it was begun; leave {name} out, or run the scene anew",
                self.scene
            )));
        }
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        let threads = self.threads.map_or(cores, usize::from);
        let world = snapshot::restore(&self.scene, threads, common)?;
        let cast = Cast::of_world(self.scene.clone(), &world);
        let config = WorldConfig {
            bounds: world.host().partition().tree().bounds(),
            partitioning: Partitioning::Regions(world.regions().len()),
            threads,
            halo_m: None,
            balance: world.host().balance().copied(),
            fidelity: world.host().fidelity(),
            step: *world.host().settings(),
        };
        let plan = Plan { config: Some(config), ticks: Plan::ticks_of(self.seconds(), cast.dt_s) };
        Ok((cast, plan, Subject::Regions(Box::new(world))))
    }

    fn seconds(&self) -> f64 {
        self.seconds.unwrap_or(if self.view.is_some() { MOST_SECONDS } else { 10.0 })
    }

    fn plan(&self, scene: &Scene) -> Result<Plan, Failure> {
        let ticks = Plan::ticks_of(self.seconds(), scene.dt_s);
        if self.regions == Some(0) {
            return Ok(Plan { config: None, ticks });
        }
        let mut config = self.cuts.local_config(scene, self.regions)?;
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        config.threads = self.threads.map_or(cores, usize::from);
        Ok(Plan { config: Some(config), ticks })
    }
}

/// Returns whether this path is that of a recording, by its extension or its content.
fn is_recording(path: &str) -> bool {
    let is_other =
        |path: &Path| matches!(Reader::open(path), Err(RecordingError::Foreign | RecordingError::Io(_)));
    let file = Path::new(path);
    path.ends_with(".dcdr") || file.is_file() && !is_other(file)
}

fn after_help() -> String {
    format!(
        "The time of a step counts only the step: what is measured is measured between steps. --json prints the keys\n\
         scene bodies regions threads coupling exchanges exchanges_mean disagreement_m_s{{mean,max}} imbalance{{mean,max}} ticks dt_s\n\
         wall_s rtf step_ms{{mean,p50,p99,max}} contacts ghosts_mean transfers energy_j{{start,end}} momentum_kgms{{start,end}} max_penetration_m ground_force_ratio\n\
         lost doubled quarantined state_hash chosen{{regions,threads,coupling,why}} and, with --fidelity,\n\
         fidelity{{share_of_full_time,error_stated_m_s{{mean,low95,high95}},audits,overruns,levels}}; step_ms leaves the first 30 steps out,\n\
         and holds null where there are no more. Exits with 1 when bodies were lost, doubled or quarantined.\n\n{}",
        scenes::overview()
    )
}

/// The longest run, seconds: 30 years. A longer one would not end, and ticks are counted in whole numbers.
const MOST_SECONDS: f64 = 1e9;

fn seconds(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "write simulated seconds, as 10 or 0.5".to_owned())?;
    if value > 0.0 && value <= MOST_SECONDS {
        Ok(value)
    } else {
        Err(format!("write simulated seconds above 0 and up to {MOST_SECONDS}"))
    }
}
