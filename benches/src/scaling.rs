//! What partitioning costs at one region and gains at two. Machines are noisy: the worlds are run in turn, several times
//! over, and the fastest run of each counts.

use std::error::Error;
use std::fmt::Write as _;
use std::ops::ControlFlow;
use std::path::PathBuf;

use clap::Args;
use dcd::runtime::measure::{Plan, run};
use dcd::runtime::{Partitioning, WorldConfig};
use dcd::scene::{Params, Scene};
use serde_json::json;

/// Scene, bodies, simulated seconds.
const SCENES: [(&str, usize, f64); 3] = [("pile", 20_000, 2.0), ("dve", 40_000, 2.0), ("pile", 1_000, 10.0)];

/// Runs of each world.
#[derive(Args)]
pub(crate) struct Scaling {
    /// How often each world is run; the fastest counts.
    #[arg(long, default_value_t = 4)]
    repeats: usize,
    /// A tenth of the bodies.
    #[arg(long)]
    quick: bool,
    /// Prints one JSON object last.
    #[arg(long)]
    json: bool,
    /// Writes the results as CSV.
    #[arg(long, value_name = "FILE.csv")]
    out: Option<PathBuf>,
}

struct Measured {
    scene: String,
    bodies: usize,
    /// 0: one bare Rapier world.
    regions: usize,
    threads: usize,
    mean_ms: f64,
    p50_ms: f64,
    p99_ms: f64,
    replicas: f64,
    speedup: f64,
}

impl Scaling {
    pub(crate) fn run(self) -> Result<(), Box<dyn Error>> {
        let mut rows = Vec::new();
        for (name, bodies, seconds) in SCENES {
            let bodies = if self.quick { bodies / 10 } else { bodies };
            rows.extend(self.measure(name, bodies, seconds)?);
        }
        let mut csv = String::from(
            "scene,bodies,regions,threads,mean_ms,p50_ms,p99_ms,replicas_mean,speedup_over_bare\n",
        );
        println!("scene    bodies regions threads  mean ms   p50 ms   p99 ms  replicas  over bare");
        for row in &rows {
            let Measured { scene, bodies, regions, threads, mean_ms, p50_ms, p99_ms, replicas, speedup } =
                row;
            println!(
                "{scene:8} {bodies:6} {regions:7} {threads:7} {mean_ms:8.3} {p50_ms:8.3} {p99_ms:8.3} {replicas:9.0} {speedup:9.3}x"
            );
            writeln!(
                csv,
                "{scene},{bodies},{regions},{threads},{mean_ms:.4},{p50_ms:.4},{p99_ms:.4},{replicas:.1},{speedup:.4}"
            )?;
        }
        if let Some(path) = &self.out {
            std::fs::write(path, csv).map_err(|error| format!("cannot write {}: {error}", path.display()))?;
        }
        if self.json {
            let rows: Vec<_> = rows
                .iter()
                .map(|row| {
                    json!({
                        "scene": row.scene, "bodies": row.bodies, "regions": row.regions, "threads": row.threads,
                        "mean_ms": row.mean_ms, "p50_ms": row.p50_ms, "p99_ms": row.p99_ms,
                        "replicas_mean": row.replicas, "speedup_over_bare": row.speedup,
                    })
                })
                .collect();
            println!("{}", json!({ "scaling": rows }));
        }
        Ok(())
    }

    fn measure(&self, name: &str, bodies: usize, seconds: f64) -> Result<Vec<Measured>, Box<dyn Error>> {
        let scene = Scene::named(name, &Params::new().with("n", bodies))?;
        let ticks = Plan::ticks_of(seconds, scene.dt_s);
        let variants = [(0, 1), (1, 1), (2, 2)];
        let mut best: Vec<Option<Measured>> = variants.iter().map(|_| None).collect();
        for repeat in 0..self.repeats.max(1) {
            for (&(regions, threads), best) in variants.iter().zip(&mut best) {
                eprintln!("{name} {bodies}: {regions} regions, run {} of {}", repeat + 1, self.repeats);
                let config = (regions > 0).then(|| WorldConfig {
                    partitioning: Partitioning::Regions(regions),
                    threads,
                    ..WorldConfig::for_scene(&scene)
                });
                let plan = Plan { config, ticks };
                let mut subject = plan.subject(&scene)?;
                let report = run(&scene, &plan, &mut subject, |_| ControlFlow::Continue(()))?;
                let times = (report.step_ms.mean, report.step_ms.p50, report.step_ms.p99);
                let (Some(mean_ms), Some(p50_ms), Some(p99_ms)) = times else {
                    return Err("too few steps to measure: the first 30 do not count".into());
                };
                if best.as_ref().is_none_or(|best| p50_ms < best.p50_ms) {
                    *best = Some(Measured {
                        scene: name.to_owned(),
                        bodies,
                        regions,
                        threads,
                        mean_ms,
                        p50_ms,
                        p99_ms,
                        replicas: report.replicas_mean,
                        speedup: 0.0,
                    });
                }
            }
        }
        let mut rows: Vec<_> = best.into_iter().flatten().collect();
        let bare_ms = rows[0].p50_ms;
        for row in &mut rows {
            row.speedup = bare_ms / row.p50_ms;
        }
        Ok(rows)
    }
}
