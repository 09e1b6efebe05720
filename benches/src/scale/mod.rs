//! Measures time and error of the same settings on large scenes, most with bodies at every border. The
//! settings are what dcd itself chooses, forced numbers of regions, fixed methods, and Rapier's own
//! `parallel`; all are compared with one bare Rapier world. A gain that costs an error shows the error beside
//! it.

mod case;
mod cores;
mod error;
mod front;
mod goals;
mod instructions;
mod known;
mod picture;
mod row;
mod setting;
mod statistic;
mod time;

use std::collections::BTreeMap;
use std::error::Error;
use std::time::Instant;

use clap::Args;
use dcd::runtime::measure::{Cast, Plan};
use dcd::scene::Scene;
use serde_json::json;

use self::case::{CASES, Case, QUICK};
pub(crate) use self::cores::Cores;
use self::error::Reference;
pub(crate) use self::instructions::ScaleWorker;
use self::row::Row;
use self::setting::{SETTINGS, Setting};
use crate::machine::Machine;
use crate::output::{Output, Sheet, Shown};
use crate::results::{Measured, short};

const SHOWN: Shown<Row> = Shown { name: "scale", table: picture::table, picture: Some(picture::picture) };

/// Which scenes are run, and how often. With `--quick` three small scenes, timed once, in at most 8 regions.
#[derive(Args)]
pub(crate) struct Scale {
    /// Only this scene; rows of others stay in the file. May be given several times.
    #[arg(long, value_name = "NAME")]
    scene: Vec<String>,
    /// Measures errors alone, which need no quiet machine; times stay in the file.
    #[arg(long)]
    errors: bool,
    /// Measures times alone, on a machine that does nothing else; errors stay in the file.
    #[arg(long)]
    times: bool,
    #[command(flatten)]
    output: Output,
    /// Prints one JSON object last.
    #[arg(long)]
    json: bool,
    /// Most regions stepped at the same time, and threads of Rapier's `parallel`.
    #[arg(long, default_value_t = 2, value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: u16,
    /// Runs of one bare world that tell how far chance alone takes a figure. An error beyond its gate that is
    /// not known fails.
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u64).range(2..=1000))]
    seeds: u64,
    /// How often each setting is timed; the fastest counts [default: 6, with `--quick` 1].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    repeats: Option<u16>,
    /// Counts, before the errors, the instructions of two regions over one bare world, on one thread; needs
    /// valgrind. Takes the small sizes of the scenes asked for, or of all that have a limit; fails above the
    /// limit.
    #[arg(long, conflicts_with = "times")]
    instructions: bool,
}

impl Scale {
    pub(crate) fn run(self) -> Result<(), Box<dyn Error>> {
        if self.instructions && !instructions::can_count() {
            eprintln!("note: valgrind is not installed, so instructions are not counted");
        }
        let (mut fresh, mut ratios) = (Vec::new(), BTreeMap::new());
        self.output.fill(&SHOWN, |sheet| {
            ratios = self.instructions_over_bare()?;
            self.measure_all(sheet, &ratios, &mut fresh)
        })?;
        if self.json {
            println!("{}", json!({ "rows": fresh }));
        }
        let above = ratios.iter().filter_map(|(scene, ratio)| instructions::above(scene, *ratio));
        let judged = if self.wants_errors() { &fresh[..] } else { &[] };
        judged
            .iter()
            .filter_map(|row| known::explained(row, self.output.quick))
            .for_each(|known| println!("known: {known}"));
        let wrong = judged.iter().filter_map(|row| known::unexplained(row, self.output.quick));
        let failures: Vec<_> = above.chain(wrong).collect();
        if failures.is_empty() { Ok(()) } else { Err(failures.join("; ").into()) }
    }

    /// Counts the instructions of two regions over one bare world, by scene.
    fn instructions_over_bare(&self) -> Result<BTreeMap<&'static str, f64>, Box<dyn Error>> {
        let mut ratios = BTreeMap::new();
        if self.instructions && instructions::can_count() {
            for case in instructions::counted(&self.scene)? {
                let ratio = instructions::over_bare(case)?;
                println!("{}: {ratio:.2} times the instructions of one bare world", case.name);
                ratios.insert(case.name, ratio);
            }
        }
        Ok(ratios)
    }

    fn measure_all(
        &self,
        sheet: &mut Sheet<Row>,
        ratios: &BTreeMap<&str, f64>,
        fresh: &mut Vec<Row>,
    ) -> Result<(), Box<dyn Error>> {
        sheet.recall()?;
        let cases = self.cases()?;
        if !self.output.quick {
            let minutes = cases.iter().map(|case| self.expected_min(case, sheet.rows())).sum::<f64>();
            eprintln!("{} scenes, about {minutes:.0} minutes", cases.len());
        }
        for case in cases {
            let mut rows = self.measure(case, sheet)?;
            if let Some(ratio) = ratios.get(case.name) {
                let of_two = rows.iter_mut().filter(|row| row.row.label() == Setting::Auto(2).label());
                of_two.for_each(|row| row.row.instructions_over_bare = Some(*ratio));
            }
            print(&rows);
            fresh.extend(rows.iter().map(|row| row.row.clone()));
            sheet.replace(|old| old.scene == case.name, rows)?;
        }
        Ok(())
    }

    fn cases(&self) -> Result<Vec<&'static Case>, Box<dyn Error>> {
        if self.scene.is_empty() {
            return Ok(CASES
                .iter()
                .filter(|case| !self.output.quick || QUICK.contains(&case.name))
                .collect());
        }
        Ok(self.scene.iter().map(|name| Case::named(name)).collect::<Result<_, _>>()?)
    }

    fn settings(&self) -> Vec<Setting> {
        SETTINGS.into_iter().filter(|setting| !self.output.quick || *setting != Setting::Auto(16)).collect()
    }

    fn wants_errors(&self) -> bool {
        self.errors || !self.times
    }

    fn wants_times(&self) -> bool {
        self.times || !self.errors
    }

    fn rounds(&self) -> u16 {
        self.repeats.unwrap_or(if self.output.quick { 1 } else { 6 })
    }

    /// Returns the minutes that a scene is expected to take, by its times in the file. Where it has none, it
    /// is the most that all scenes are made to take.
    fn expected_min(&self, case: &Case, rows: &[Measured<Row>]) -> f64 {
        /// The time for errors over that for times: looks take time, and what broke costs more.
        const ERRORS_OVER_TIMES: f64 = 1.5;
        const MOST_MIN: f64 = 6.0;
        let of_case = rows.iter().map(|row| &row.row).filter(|row| row.scene == case.name);
        let round_ms: f64 = of_case.clone().filter_map(|row| row.ms_p50).sum();
        let bare_ms = of_case.clone().find_map(|row| row.ms_p50).unwrap_or_default();
        let (size, dt_s) = (case.size(false), 1.0 / 60.0);
        let times_min = f64::from(self.rounds()) * round_ms * case.timed_ticks(false, dt_s) as f64 / 60e3;
        let run_ms = round_ms + bare_ms * self.seeds as f64 / f64::from(self.threads);
        let errors_min = ERRORS_OVER_TIMES * run_ms * Plan::ticks_of(size.seconds, dt_s) as f64 / 60e3;
        let or_most = |min: f64| if min > 0.0 { min } else { MOST_MIN };
        let if_wanted = |wanted: bool, min: f64| if wanted { or_most(min) } else { 0.0 };
        if_wanted(self.wants_times(), times_min) + if_wanted(self.wants_errors(), errors_min)
    }

    /// Measures the rows of a scene. What is not measured now stays as the sheet has it.
    fn measure(&self, case: &Case, sheet: &Sheet<Row>) -> Result<Vec<Measured<Row>>, Box<dyn Error>> {
        let (scene, settings, threads) =
            (case.scene(self.output.quick)?, self.settings(), usize::from(self.threads));
        let bodies = Cast::of_scene(&scene).bodies.len();
        let row = |setting: &Setting| {
            let old = sheet.rows().iter().find(|old| old.row.is_of(case, bodies, *setting));
            old.cloned().unwrap_or_else(|| sheet.measured(Row::new(case, bodies, *setting, threads)))
        };
        let mut rows: Vec<_> = settings.iter().map(row).collect();
        let progress = Progress { scene: case.name, start: Instant::now() };
        if self.wants_errors() {
            self.read_errors(case, &scene, &settings, &mut rows, &progress)?;
        }
        if self.wants_times() {
            let (scene, small) = (case.timed_scene(self.output.quick)?, self.output.quick);
            let ticks = case.timed_ticks(small, scene.dt_s);
            let times = time::time(&scene, ticks, &settings, threads, self.rounds(), &progress)?;
            for ((row, time), setting) in rows.iter_mut().zip(&times).zip(&settings) {
                let mut fresh = Row { threads: setting.threads(threads), ..row.row.clone() };
                fresh.set_time(*time, times[0]);
                *row = sheet.measured(fresh);
            }
        }
        progress.tell(format_args!("done"));
        Ok(rows)
    }

    fn read_errors(
        &self,
        case: &Case,
        scene: &Scene,
        settings: &[Setting],
        rows: &mut [Measured<Row>],
        progress: &Progress,
    ) -> Result<(), Box<dyn Error>> {
        let here = Machine::here();
        progress.tell(format_args!("errors, one bare world by {} seeds", self.seeds));
        let reference = Reference::of(case, scene, self.output.quick, self.seeds)?;
        for (setting, row) in settings.iter().zip(rows) {
            progress.tell(format_args!("errors, {}", setting.label()));
            row.row.set_error(reference.read(*setting, self.threads.into())?, &here);
        }
        Ok(())
    }
}

/// What is being done with a scene, printed on standard error.
struct Progress {
    scene: &'static str,
    start: Instant,
}

impl Progress {
    fn tell(&self, what: std::fmt::Arguments<'_>) {
        eprintln!("{} {:4.0} s: {what}", self.scene, self.start.elapsed().as_secs_f64());
    }
}

fn print(rows: &[Measured<Row>]) {
    println!(
        "scene        bodies setting    threads  p50 ms over bare  CPU over instructions     error      gate"
    );
    let figure = |value: Option<f64>| value.map_or("–".to_owned(), short);
    let times = |value: Option<f64>| value.map_or("–".to_owned(), |times| format!("{times:.2}x"));
    for Measured { row, .. } in rows {
        println!(
            "{:12} {:6} {:10} {:7} {:>7} {:>9} {:>9} {:>12} {:>9} {:>9} {}: {}",
            row.scene,
            row.bodies,
            row.label(),
            row.threads,
            figure(row.ms_p50),
            times(row.over_bare),
            times(row.cpu_over_bare),
            times(row.instructions_over_bare),
            figure(row.error),
            figure(row.gate),
            row.pass.map_or("–", |pass| if pass { "passes" } else { "fails" }),
            row.unit.as_deref().unwrap_or("–"),
        );
    }
}
