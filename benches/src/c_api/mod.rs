//! Measures what the C API costs: calls as a C program sees them, joining a world, and the size of a program
//! that links it.

use std::collections::BTreeMap;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};
use std::time::{Duration, Instant};

use clap::Args;
use dcd::net::JoinRole;
use dcd::rapier3d::parry::query::ShapeCastOptions;
use dcd::rapier3d::prelude::*;
use dcd::runtime::measure::Plan;
use dcd::runtime::{
    JoinConfig, Member, MemberConfig, Origin, Partitioning, ServeConfig, ServerProcess, WorldConfig,
};
use dcd::scene::{Params, Scene};
use serde::{Deserialize, Serialize};

use crate::output::{Output, Shown};
use crate::results::{Measured, short};
use crate::{page, timing};

const SHOWN: Shown<Row> = Shown { name: "c-api", table, picture: None };
/// The number of bodies in the step that the cost of calls is compared with.
const STEPPED: usize = 1000;
/// The number of rays in one call.
const RAYS: usize = 10_000;
/// A time longer than joining takes on a busy machine.
const LIMIT: Duration = Duration::from_secs(60);
/// The linker options for what Rust's standard library needs of a Linux system;
/// `tests/tests/c_api/library.rs` checks the list.
const LINK: &str = "-Wl,--gc-sections -lgcc_s -lutil -lrt -lpthread -lm -ldl -lc";

/// Measures against the goals of the C API; fails when a goal is missed, except with `--quick`.
#[derive(Args)]
pub(crate) struct CApi {
    #[command(flatten)]
    output: Output,
}

/// One figure and its goal.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Row {
    figure: String,
    value: f64,
    unit: String,
    /// The most that the value may be; `None` where nobody set a goal.
    goal: Option<f64>,
}

impl Row {
    fn new(figure: &str, value: f64, unit: &str, goal: impl Into<Option<f64>>) -> Self {
        Self { figure: figure.to_owned(), value, unit: unit.to_owned(), goal: goal.into() }
    }

    fn is_missed(&self) -> bool {
        self.goal.is_some_and(|goal| self.value > goal)
    }
}

impl CApi {
    pub(crate) fn run(self) -> Result<ExitCode, Box<dyn Error>> {
        let rows = self
            .output
            .fill(&SHOWN, |rows| self.measure()?.into_iter().try_for_each(|row| rows.push(row)))?;
        let missed = rows.iter().any(|row| row.row.is_missed());
        Ok(if missed && !self.output.quick { ExitCode::FAILURE } else { ExitCode::SUCCESS })
    }

    fn measure(&self) -> Result<Vec<Row>, Box<dyn Error>> {
        let (bodies, repeats, steps, rounds, joins) =
            if self.output.quick { (2_000, 5, 60, 1, 1) } else { (100_000, 50, 600, 7, 9) };
        let work = std::env::temp_dir().join(format!("dcd-benches-c-api-{}", std::process::id()));
        std::fs::create_dir_all(&work)?;
        let calls = Calls(compile(&library(ALIKE)?, &root().join("benches/src/c_api/calls.c"), &work)?);

        let mut rows = Vec::new();
        let read = calls.said(&["read", &bodies.to_string(), &repeats.to_string()])?;
        let mut row = |figure: &str, name: &str, goal: Option<f64>| {
            rows.push(Row::new(figure, read[name], "ns a body", goal));
        };
        row("a pose through the view, read again", "view_again_ns", Some(2.0));
        row("a pose from an array of one's own, read again", "own_again_ns", None);
        row("a pose through the view, after other reads", "view_ns", None);
        row("a pose from an array of one's own, after other reads", "own_ns", None);
        row("a pose by a list of ids", "list_ns", None);
        let few = calls.said(&["read", &STEPPED.to_string(), &(100 * repeats).to_string()])?;
        rows.push(Row::new("dcd_body_get, of 1,000 bodies", few["get_ns"], "ns a body", 25.0));
        rows.push(Row::new("dcd_body_get, of all bodies", read["get_ns"], "ns a body", None));

        // The three run in turn, and of each the run counts that was disturbed least.
        let (mut rust, mut c, mut viewed) = (f64::INFINITY, f64::INFINITY, f64::INFINITY);
        for _ in 0..rounds {
            rust = rust.min(rust_step_ms(steps)?);
            c = c.min(calls.step_ms("step", steps)?);
            viewed = viewed.min(calls.step_ms("viewed", steps)?);
        }
        let added = |c: f64| 100.0 * (c / rust - 1.0);
        rows.push(Row::new("what dcd_step adds to a step of 1,000 bodies", added(c), "%", 1.0));
        rows.push(Row::new("the same with the view", added(viewed), "%", None));

        let many = if self.output.quick { 1_000 } else { 20_000 };
        rows.extend(making(&calls, many, rounds)?);
        rows.extend(casting(&calls, many, rounds)?);
        rows.extend(playing(&calls, steps / 5, rounds)?);

        let cores = std::thread::available_parallelism()?.get();
        for (bodies, goal) in [(2_000, 1.0), (20_000, 10.0)] {
            for (threads, on) in [(1, ""), (cores, " on all cores")] {
                let ask = ["rollback", &bodies.to_string(), &(rounds * 9).to_string(), &threads.to_string()];
                let said = calls.said(&ask)?;
                for (what, names) in [
                    ("kept by a checkpoint", &["save_ms"][..]),
                    ("the same, with what the next step copies", &["save_ms", "copy_ms"]),
                    ("gone back to", &["restore_ms"]),
                    ("the same, with what the next step copies then", &["restore_ms", "copy_again_ms"]),
                ] {
                    // What is copied at once is copied by the calling thread.
                    if threads == 1 || names.len() > 1 {
                        let took = names.iter().map(|&name| said[name]).sum();
                        rows.push(Row::new(
                            &format!("{bodies} bodies in a pile, {what}{on}"),
                            took,
                            "ms",
                            goal,
                        ));
                    }
                }
            }
        }

        let joined = join_ms(&calls, joins, &work)?;
        rows.push(Row::new("from dcd_client_connect to the first state", joined, "ms", 50.0));

        // One example joins a served world, the other has only a world of its own.
        let usual = library(&[])?;
        for example in ["game_loop", "hello"] {
            let program =
                compile(&usual, &root().join("examples-c").join(example).with_extension("c"), &work)?;
            if !Command::new("strip").arg(&program).status()?.success() {
                return Err("strip failed".into());
            }
            let size = std::fs::metadata(&program)?.len() as f64 / 1e6;
            rows.push(Row::new(&format!("{example}, linked statically and stripped"), size, "MB", 8.0));
        }
        std::fs::remove_dir_all(&work)?;
        Ok(rows)
    }
}

fn table(rows: &[Measured<Row>]) -> String {
    let cells = |Measured { row, .. }: &Measured<Row>| {
        let goal = row.goal.map_or_else(String::new, short);
        let verdict = if row.is_missed() { "missed" } else { "" };
        vec![row.figure.clone(), short(row.value), row.unit.clone(), goal, verdict.to_owned()]
    };
    page::table(&["figure", "measured", "unit", "at most", ""], rows.iter().map(cells))
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the package lies in the workspace")
}

/// The options that give the C library this program's allocator: different allocators make steps differ by
/// more than calls cost.
const ALIKE: &[&str] = &["--features", "mimalloc"];

/// Returns the static library, built as users build it, with these options. A debug build of this program
/// takes the library that was built along with it.
fn library(options: &[&str]) -> Result<PathBuf, Box<dyn Error>> {
    let program = std::env::current_exe()?;
    let profile = program.parent().ok_or("this program lies in no folder")?;
    if cfg!(debug_assertions) {
        return Ok(profile.join("deps/libdcd_ffi.a"));
    }
    let target = profile.parent().ok_or("this program lies in no target folder")?;
    let mut cargo = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    cargo.args(["build", "--quiet", "--release", "--package", "dcd-ffi"]).args(options);
    cargo.arg("--target-dir").arg(target).current_dir(root());
    if !cargo.status()?.success() {
        return Err("the C library does not build".into());
    }
    Ok(profile.join("libdcd_ffi.a"))
}

fn compile(library: &Path, source: &Path, out: &Path) -> Result<PathBuf, Box<dyn Error>> {
    let program = out.join(source.file_stem().expect("a source has a name"));
    let mut cc = Command::new(std::env::var_os("CC").unwrap_or_else(|| "cc".into()));
    cc.args(["-std=c11", "-O2", "-I"]).arg(root().join("include")).arg(source).arg(library);
    if !cc.args(LINK.split(' ')).arg("-o").arg(&program).status()?.success() {
        return Err(format!("{} does not compile", source.display()).into());
    }
    Ok(program)
}

/// The program compiled from `calls.c`.
struct Calls(PathBuf);

impl Calls {
    /// Returns the median step of [`pile`] in milliseconds, by one of the ways to step it.
    fn step_ms(&self, way: &str, steps: usize) -> Result<f64, Box<dyn Error>> {
        Ok(self.said(&[way, &STEPPED.to_string(), &steps.to_string()])?["step_ms"])
    }

    /// Runs the program and returns its output, a name and a number per line.
    fn said(&self, arguments: &[&str]) -> Result<BTreeMap<String, f64>, Box<dyn Error>> {
        let output = Command::new(&self.0).args(arguments).stderr(Stdio::inherit()).output()?;
        if !output.status.success() {
            return Err(format!("calls {arguments:?} ends with {}", output.status).into());
        }
        let text = String::from_utf8(output.stdout)?;
        let figure = |line: &str| -> Result<_, Box<dyn Error>> {
            let (name, value) = line.split_once(' ').ok_or_else(|| format!("{line} is no figure"))?;
            Ok((name.to_owned(), value.parse()?))
        };
        text.lines().map(figure).collect()
    }
}

/// Returns the scene that `calls.c` steps.
fn pile() -> Result<Scene, Box<dyn Error>> {
    Ok(Scene::named("pile", &Params::new().with("n", STEPPED as f64))?)
}

/// Returns the median step of the same world without the C API, in milliseconds.
fn rust_step_ms(steps: usize) -> Result<f64, Box<dyn Error>> {
    let scene = pile()?;
    let config =
        WorldConfig { partitioning: Partitioning::Regions(1), threads: 1, ..WorldConfig::for_scene(&scene) };
    let plan = Plan { config: Some(config), ticks: (timing::WARM_UP + steps) as u64 };
    timing::median_ms(&mut plan.subject(&scene)?, steps)
}

/// Measures what it costs to make and to destroy boxes, beside the same in bare Rapier. The two run in turn,
/// and of each the run counts that was disturbed least.
fn making(calls: &Calls, bodies: usize, rounds: usize) -> Result<Vec<Row>, Box<dyn Error>> {
    let (mut bare, mut ours) = ([f64::INFINITY; 3], [f64::INFINITY; 3]);
    for _ in 0..rounds {
        let said = calls.said(&["made", &bodies.to_string(), "3"])?;
        let least = |best: [f64; 3], new: [f64; 3]| std::array::from_fn(|part| best[part].min(new[part]));
        bare = least(bare, bare_making_ns(bodies));
        ours = least(ours, ["make_ns", "first_step_ns", "destroy_ns"].map(|name| said[name]));
    }
    let rows = [
        ("dcd_body_create", ours[0], bare[0], Some(2.0)),
        // Rapier takes a new body into its islands and its tree when it steps.
        ("dcd_body_create and the first dcd_step", ours[0] + ours[1], bare[0] + bare[1], None),
        ("dcd_body_destroy", ours[2], bare[2], Some(2.0)),
    ];
    let both = |(what, ours, bare, goal): (&str, f64, f64, Option<f64>)| {
        let figure = format!("{what}, of {bodies} boxes");
        [
            Row::new(&format!("{figure}, over the same in a bare Rapier world"), ours / bare, "times", goal),
            Row::new(&figure, ours, "ns", None),
        ]
    };
    Ok(rows.into_iter().flat_map(both).collect())
}

/// Measures what rays and moving balls cost in such boxes, per thread that casts, beside the same in bare
/// Rapier.
fn casting(calls: &Calls, bodies: usize, rounds: usize) -> Result<Vec<Row>, Box<dyn Error>> {
    let cores = std::thread::available_parallelism()?.get();
    let ways = [("one region", 1, 1), ("four regions", 4, 1), ("four regions on all cores", 4, cores)];
    let kinds = [("ray", "ray_ns"), ("ball cast", "cast_ns")];
    let (mut bare, mut ours) = ([f64::INFINITY; 2], [[f64::INFINITY; 2]; 3]);
    for _ in 0..rounds {
        for (best, took) in bare.iter_mut().zip(bare_casting_ns(bodies, RAYS)) {
            *best = best.min(took);
        }
        for (best, (_, regions, threads)) in ours.iter_mut().zip(ways) {
            let [bodies, rays] = [bodies, RAYS].map(|count| count.to_string());
            let said = calls.said(&["rays", &bodies, &rays, &regions.to_string(), &threads.to_string()])?;
            for (best, (_, name)) in best.iter_mut().zip(kinds) {
                *best = best.min(said[name] * threads as f64);
            }
        }
    }
    let mut rows = Vec::new();
    for (kind, (what, _)) in kinds.into_iter().enumerate() {
        for (ours, (way, ..)) in ours.iter().zip(ways) {
            let figure = format!("a {what} of {RAYS} into {bodies} boxes, {way}");
            let over = format!("{figure}, a thread, over the same in a bare Rapier world");
            rows.push(Row::new(&over, ours[kind] / bare[kind], "times", 1.2));
            rows.push(Row::new(&figure, ours[kind], "ns a thread", None));
        }
    }
    Ok(rows)
}

/// Measures what a game costs in four regions on one thread, where they gain nothing, over the same game in
/// one region. They run in turn, and of each the run counts that was disturbed least.
fn playing(calls: &Calls, steps: usize, rounds: usize) -> Result<Vec<Row>, Box<dyn Error>> {
    const BODIES: usize = 2_000;
    let ways = [("cut between its groups", 0.0), ("cut through its groups", 20.25)];
    let step_ms = |regions: usize, plane: f64| -> Result<f64, Box<dyn Error>> {
        let [bodies, steps, regions] = [BODIES, steps, regions].map(|count| count.to_string());
        Ok(calls.said(&["game", &bodies, &steps, &regions, &plane.to_string()])?["step_ms"])
    };
    let (mut one, mut four) = (f64::INFINITY, [f64::INFINITY; 2]);
    for _ in 0..rounds {
        one = one.min(step_ms(1, 0.0)?);
        for (best, (_, plane)) in four.iter_mut().zip(ways) {
            *best = best.min(step_ms(4, plane)?);
        }
    }
    let row = |(four, (way, _)): (f64, (&str, f64))| {
        let figure = format!("a step of a game of {BODIES} bodies in four regions, {way}, over one region");
        Row::new(&figure, four / one, "times the CPU", 1.1)
    };
    Ok(four.into_iter().zip(ways).map(row).collect())
}

/// Adds boxes to a bare Rapier world, placed as `calls made` has them.
fn bare_boxes(world: &mut PhysicsWorld, bodies: usize) -> Vec<RigidBodyHandle> {
    let make = |i: usize| {
        let at = Vector::new((i % 50) as f32, (i / 50 % 50) as f32, (i / 2500) as f32) * 1.5;
        let body = RigidBodyBuilder::dynamic().translation(at);
        world.insert(body, ColliderBuilder::cuboid(0.5, 0.5, 0.5).density(1000.0)).0
    };
    (0..bodies).map(make).collect()
}

/// Returns a bare Rapier world on one thread, as the worlds of `calls.c` are.
fn bare_world() -> PhysicsWorld {
    let mut world = PhysicsWorld::new();
    world.configure_thread_pool(1).expect("the system has one more thread");
    world
}

/// Returns the nanoseconds per box to make it, of the first step after that, and to remove it then, in a bare
/// Rapier world, as `calls made` does: each the least of three rounds.
fn bare_making_ns(bodies: usize) -> [f64; 3] {
    let (mut world, mut best) = (bare_world(), [f64::INFINITY; 3]);
    for _ in 0..3 {
        let start = Instant::now();
        let handles = bare_boxes(&mut world, bodies);
        let made = start.elapsed();
        world.step();
        let stepped = start.elapsed();
        for handle in handles {
            world.remove_body(handle);
        }
        let removed = start.elapsed();
        world.step();
        for (best, took) in best.iter_mut().zip([made, stepped - made, removed - stepped]) {
            *best = best.min(1e9 * took.as_secs_f64() / bodies as f64);
        }
    }
    best
}

/// Returns the nanoseconds per ray and per moving ball in a bare Rapier world, as `calls rays` casts them.
fn bare_casting_ns(bodies: usize, count: usize) -> [f64; 2] {
    let mut world = bare_world();
    world.gravity = Vector::ZERO;
    bare_boxes(&mut world, bodies);
    for _ in 0..timing::WARM_UP {
        world.step();
    }
    let ray = |i: usize| {
        let spread = |step: f64| (i as f64 * step).fract();
        let [y, z] = [75.0 * spread(0.754_877_666_246_692_7), 12.0 * spread(0.569_840_290_998_053_2)];
        let [up, aside] = [0.618_033_988_749_894_9, 0.414_213_562_373_095].map(|step| spread(step) - 0.5);
        let direction = Vector::new(1.0, up as f32, aside as f32);
        (Vector::new(-2.0, y as f32, z as f32), direction)
    };
    let rays: Vec<_> = (0..count).map(ray).collect();
    let pipeline = world.query_pipeline();
    let cast_ray = |&(origin, direction): &(Vector, Vector)| {
        let hit = pipeline.cast_ray_and_get_normal(&Ray::new(origin, direction.normalize()), 1e6, true);
        hit.map_or(0.0, |(_, hit)| hit.time_of_impact)
    };
    let (ball, options) = (Ball::new(0.25), ShapeCastOptions::with_max_time_of_impact(1.0));
    let options = ShapeCastOptions { compute_impact_geometry_on_penetration: true, ..options };
    let cast_ball = |&(origin, direction): &(Vector, Vector)| {
        let hit = pipeline.cast_shape(&Pose::from_translation(origin), 100.0 * direction, &ball, options);
        hit.map_or(0.0, |(_, hit)| hit.time_of_impact)
    };
    let least = |cast: &dyn Fn(&(Vector, Vector)) -> f32| {
        let took = |_| {
            let start = Instant::now();
            let hits: Vec<_> = rays.iter().map(cast).collect();
            let took = start.elapsed();
            std::hint::black_box(hits);
            1e9 * took.as_secs_f64() / count as f64
        };
        (0..9).map(took).fold(f64::INFINITY, f64::min)
    };
    [least(&cast_ray), least(&cast_ball)]
}

/// Returns the median time of several clients that join a world on this machine one after the other, in
/// milliseconds.
fn join_ms(calls: &Calls, joins: usize, work: &Path) -> Result<f64, Box<dyn Error>> {
    let scene = pile()?;
    let world = WorldConfig { partitioning: Partitioning::Regions(1), ..WorldConfig::for_scene(&scene) };
    let server = ServerProcess::start(
        Origin::Scene(&scene, &world),
        ServeConfig { ..ServeConfig::new(work.join("server")) },
    )?;
    let identity =
        JoinConfig::new(server.address, server.token(JoinRole::Node, LIMIT)?).join(JoinRole::Node)?;
    let node = Member::start(MemberConfig::new(server.address, identity))?;
    let mut times = Vec::new();
    // The first client waits for the node to begin, and does not count.
    for _ in 0..joins + 1 {
        let token = server.token(JoinRole::Client, LIMIT)?;
        times.push(calls.said(&["connect", &server.address.to_string(), &token])?["connect_ms"]);
    }
    server.stop()?;
    node.finish()?;
    let times = &mut times[1..];
    times.sort_by(f64::total_cmp);
    Ok(times[times.len() / 2])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bare_worlds_have_one_thread_as_those_of_c_programs() {
        let pool = bare_world().thread_pool().expect("without one, Rapier takes all cores");
        assert_eq!(pool.current_num_threads(), 1);
    }
}
