//! Measures time and error in the same row: large scenes with bodies at every border, by what dcd chooses itself, by forced numbers of
//! regions and by fixed methods, against one bare Rapier world. A gain that costs an error shows the error beside it.

mod case;
mod error;
mod instructions;
mod picture;
mod setting;
mod statistic;

use std::error::Error;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use clap::Args;
use dcd::physics::{Coupling, Measured as _};
use dcd::runtime::measure::{Cast, Plan};
use dcd::scene::Scene;
use serde::{Deserialize, Serialize};
use serde_json::json;

use self::case::{CASES, Case, QUICK};
use self::error::{Reading, Reference};
pub(crate) use self::instructions::ScaleWorker;
use self::setting::{SETTINGS, Setting};
use crate::machine::Machine;
use crate::page;
use crate::results::{self, Measured, short};
use crate::timing::{StepMs, WARM_UP};

/// Which scenes are run, and how often.
#[derive(Args)]
pub(crate) struct Scale {
    /// Only this scene; rows of others stay in the file. May be given several times.
    #[arg(long, value_name = "NAME")]
    scene: Vec<String>,
    /// Three scenes, small, timed once, in at most 8 regions; writes no file unless `--out` names one.
    #[arg(long)]
    quick: bool,
    /// Prints one JSON object last.
    #[arg(long)]
    json: bool,
    /// Where the results go; the picture goes beside them [default: benches/results/scale.csv].
    #[arg(long, value_name = "FILE.csv")]
    out: Option<PathBuf>,
    /// Draws the picture and the page's table from the file, without measuring.
    #[arg(long)]
    draw: bool,
    /// Regions stepped at a time, at most.
    #[arg(long, default_value_t = 2, value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: u16,
    /// Runs of one bare world that tell how far chance alone takes a figure [default: 8, with `--quick` 3].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(2..=1000))]
    seeds: Option<u64>,
    /// How often each setting is timed; the fastest counts [default: 6, with `--quick` 1].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    repeats: Option<u16>,
    /// Counts instructions of two regions over one bare world, of the scenes' small sizes on one thread; needs valgrind. Fails where
    /// they are more than they were.
    #[arg(long)]
    instructions: bool,
}

/// A scene by one setting.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Row {
    scene: String,
    bodies: usize,
    setting: String,
    /// 0: one bare Rapier world.
    regions: usize,
    threads: usize,
    /// Milliseconds a step, median of the fastest run.
    ms_p50: f64,
    /// Of the time that one bare world takes, by medians: below 1 is faster.
    over_bare: f64,
    /// Of two regions over one bare world.
    instructions_over_bare: Option<f64>,
    /// Of the statistic that is worst by its gate, which `unit` names.
    error: f64,
    /// From the least to the most of one bare world's own runs.
    r1_spread: f64,
    unit: String,
    /// The largest error that passes.
    gate: f64,
    pass: bool,
}

/// What a setting took.
#[derive(Clone, Copy)]
struct Timed {
    step: StepMs,
    regions: usize,
    /// Not worth another run: noise is small beside it.
    long: bool,
}

impl Scale {
    pub(crate) fn run(self) -> Result<(), Box<dyn Error>> {
        let out = self.out.clone().or_else(|| (!self.quick).then(|| results::committed().join("scale.csv")));
        if self.draw {
            let path = out.ok_or("`--draw` with `--quick` needs `--out`: name the file to draw")?;
            return publish(&path, &results::read_csv(&path)?);
        }
        if self.instructions && !instructions::can_count() {
            eprintln!("note: valgrind is not installed, so instructions are not counted");
        }
        let cases = self.cases()?;
        let machine = Machine::here();
        let mut rows: Vec<Measured<Row>> = match &out {
            Some(path) if !self.scene.is_empty() => results::read_csv(path)?,
            _ => Vec::new(),
        };
        let mut fresh = Vec::new();
        for case in cases {
            let of_case = self.measure(case)?;
            print(&of_case);
            rows.retain(|old| old.row.scene != case.name);
            rows.extend(of_case.iter().map(|row| Measured { row: row.clone(), machine: machine.clone() }));
            fresh.extend(of_case);
            // After every scene: a run that is stopped keeps what it has.
            if let Some(path) = &out {
                results::write_csv(path, &rows)?;
            }
        }
        if let Some(path) = &out {
            publish(path, &rows)?;
        }
        if self.json {
            println!("{}", json!({ "rows": fresh }));
        }
        let auto = fresh.iter().filter(|row| row.setting == Coupling::Auto.name());
        let above = auto.filter_map(|row| instructions::above(&row.scene, row.instructions_over_bare?));
        let above: Vec<_> = above.collect();
        if above.is_empty() { Ok(()) } else { Err(above.join("; ").into()) }
    }

    fn cases(&self) -> Result<Vec<&'static Case>, Box<dyn Error>> {
        if self.scene.is_empty() {
            return Ok(CASES.iter().filter(|case| !self.quick || QUICK.contains(&case.name)).collect());
        }
        Ok(self.scene.iter().map(|name| Case::named(name)).collect::<Result<_, _>>()?)
    }

    fn settings(&self) -> Vec<Setting> {
        SETTINGS.into_iter().filter(|setting| !self.quick || *setting != Setting::Auto(16)).collect()
    }

    fn measure(&self, case: &Case) -> Result<Vec<Row>, Box<dyn Error>> {
        let progress = Progress { scene: case.name, start: Instant::now() };
        let (scene, settings, threads) =
            (case.scene(self.quick)?, self.settings(), usize::from(self.threads));
        let seeds = self.seeds.unwrap_or(if self.quick { 3 } else { 8 });
        progress.tell(format_args!("one bare world, {seeds} seeds"));
        let reference = Reference::of(case, &scene, self.quick, seeds)?;
        let mut readings = Vec::new();
        for setting in &settings {
            progress.tell(format_args!("error, {}", setting.label()));
            readings.push(reference.read(*setting, threads)?);
        }
        let timed = self.time(&scene, case.size(self.quick).seconds, &settings, &progress)?;
        let instructions = self.count(case, &settings, &progress)?;
        let bare_ms = timed[0].step.p50_ms;
        let bodies = Cast::of_scene(&scene).bodies.len();
        let rows = settings.iter().zip(timed).zip(readings).zip(instructions);
        Ok(rows
            .map(|(((setting, Timed { step, regions, .. }), reading), instructions_over_bare)| {
                let pass = reading.of_gate() <= 1.0;
                let Reading { error, r1_spread, unit, gate } = reading;
                Row {
                    scene: case.name.to_owned(),
                    bodies,
                    setting: setting.name().to_owned(),
                    regions,
                    threads: setting.threads(threads),
                    ms_p50: step.p50_ms,
                    over_bare: step.p50_ms / bare_ms,
                    instructions_over_bare,
                    error,
                    r1_spread,
                    unit: unit.to_owned(),
                    gate,
                    pass,
                }
            })
            .collect())
    }

    /// All settings in turn, several times over: the fastest run of each. It is as long as the one whose error is measured. What
    /// takes minutes runs once.
    fn time(
        &self,
        scene: &Scene,
        seconds: f64,
        settings: &[Setting],
        progress: &Progress,
    ) -> Result<Vec<Timed>, Box<dyn Error>> {
        const LONG: Duration = Duration::from_secs(60);
        let ticks = (Plan::ticks_of(seconds, scene.dt_s) as usize).saturating_sub(WARM_UP).max(1);
        let repeats = self.repeats.unwrap_or(if self.quick { 1 } else { 6 });
        let mut best: Vec<Option<Timed>> = vec![None; settings.len()];
        for repeat in 1..=repeats {
            for (setting, best) in settings.iter().zip(&mut best) {
                if best.is_some_and(|best| best.long) {
                    continue;
                }
                progress.tell(format_args!("time, run {repeat} of {repeats}, {}", setting.label()));
                let config = setting.config(scene, usize::from(self.threads));
                let mut subject = Plan { config, ticks: ticks as u64 }.subject(scene)?;
                let start = Instant::now();
                let step = StepMs::of(&mut subject, ticks)?;
                let long = start.elapsed() > LONG;
                let step = best.map_or(step, |best| best.step.faster(step));
                let regions = if *setting == Setting::Bare { 0 } else { subject.views().len() };
                *best = Some(Timed { step, regions, long });
            }
        }
        Ok(best.into_iter().flatten().collect())
    }

    /// Of settings of two regions, if asked and possible.
    fn count(
        &self,
        case: &Case,
        settings: &[Setting],
        progress: &Progress,
    ) -> Result<Vec<Option<f64>>, Box<dyn Error>> {
        if !self.instructions || !instructions::can_count() {
            return Ok(vec![None; settings.len()]);
        }
        progress.tell(format_args!("instructions"));
        let bare = instructions::count(case, Setting::Bare)? as f64;
        let over_bare = |setting: &Setting| match setting.asked_regions() {
            Some(2) => Ok(Some(instructions::count(case, *setting)? as f64 / bare)),
            _ => Ok(None),
        };
        settings.iter().map(over_bare).collect()
    }
}

/// What is being done, on standard error.
struct Progress {
    scene: &'static str,
    start: Instant,
}

impl Progress {
    fn tell(&self, what: std::fmt::Arguments<'_>) {
        eprintln!("{} {:4.0} s: {what}", self.scene, self.start.elapsed().as_secs_f64());
    }
}

fn print(rows: &[Row]) {
    println!(
        "scene        bodies setting regions threads  p50 ms over bare instructions     error      gate"
    );
    for row in rows {
        let Row { scene, bodies, setting, regions, threads, ms_p50, over_bare, .. } = row;
        let instructions = row.instructions_over_bare.map_or("–".to_owned(), |over| format!("{over:.2}x"));
        let (error, gate) = (short(row.error), short(row.gate));
        let verdict = if row.pass { "passes" } else { "fails" };
        println!(
            "{scene:12} {bodies:6} {setting:7} {regions:7} {threads:7} {ms_p50:7.3} {over_bare:8.2}x {instructions:>12} {error:>9} {gate:>9} {verdict}: {}",
            row.unit
        );
    }
}

/// Picture and matrix, from what the file holds.
fn publish(path: &Path, rows: &[Measured<Row>]) -> Result<(), Box<dyn Error>> {
    crate::draw::write(&picture::picture(rows), &path.with_extension(""))?;
    page::put(path.parent().unwrap_or(Path::new(".")), "scale", &picture::table(rows))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_has_the_keys_that_others_read() {
        let row = Row {
            scene: "net".into(),
            bodies: 1,
            setting: "bare".into(),
            regions: 0,
            threads: 1,
            ms_p50: 1.0,
            over_bare: 1.0,
            instructions_over_bare: None,
            error: 0.0,
            r1_spread: 0.0,
            unit: "m".into(),
            gate: 0.1,
            pass: true,
        };
        let json = serde_json::to_value(row).unwrap();
        let mut keys: Vec<_> = json.as_object().unwrap().keys().map(String::as_str).collect();
        keys.sort_unstable();
        let expected = "bodies error gate instructions_over_bare ms_p50 over_bare pass r1_spread regions scene setting threads unit";
        assert_eq!(keys.join(" "), expected);
        assert!(json["instructions_over_bare"].is_null());
    }
}
