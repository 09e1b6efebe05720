//! Runs the accuracy suite: scenes where partitioned worlds go wrong, each with the border where it does most
//! harm, compared with closed forms and one bare Rapier world.

#[cfg(test)]
mod baselines;
mod fleet;
mod gate;
mod limits;
mod matrix;
mod reading;
mod record;
mod report;
mod run;
mod scene;
mod scenes;
mod trace;
mod world;

use std::collections::BTreeSet;
use std::error::Error;
use std::process::ExitCode;

use clap::Args;
use dcd::physics::Coupling;
use dcd::runtime::{WorldConfig, WorldError};
use indicatif::{ProgressBar, ProgressStyle};
use rayon::prelude::*;
use serde_json::json;

pub(crate) use fleet::Fault;
pub(crate) use reading::{Reference, finite, read};
pub(crate) use run::trace;
pub(crate) use scene::{Better, Case, Experiment, Figure, Size};
pub(crate) use scenes::{experiments, mean_gap_m};
pub(crate) use trace::{Look, Trace, masses_kg};
pub(crate) use world::{Bare, Setup};

use crate::output::{Output, Sheet, Shown};
use record::Record;
use report::{Line, Row};

const SHOWN: Shown<Record> = Shown { name: "accuracy", table: matrix::table, picture: None };

/// Runs the accuracy suite. With `--quick` shorter and smaller scenes, a few minutes in all.
#[derive(Args)]
pub(crate) struct Accuracy {
    /// Only these scenes, by name or number; rows of others stay in the file.
    #[arg(long, value_name = "NAME", num_args = 1..)]
    scene: Vec<String>,
    #[command(flatten)]
    output: Output,
    /// Prints one JSON object last.
    #[arg(long)]
    json: bool,
    /// Couplings of the regions, by name.
    #[arg(long, value_name = "METHOD", num_args = 1.., value_parser = method)]
    method: Vec<Coupling>,
    /// Numbers of regions that the scenes are cut into.
    #[arg(long, value_delimiter = ',', default_value = "1,2,4,8", value_parser = regions)]
    regions: Vec<usize>,
}

impl Accuracy {
    /// Runs the suite, and fails where a scene fails for a cause that has no name.
    pub(crate) fn run(self) -> Result<ExitCode, Box<dyn Error>> {
        let mut rows = Vec::new();
        self.output.fill(&SHOWN, |sheet| self.measure(sheet, &mut rows))?;
        let unexplained = rows.iter().filter(|row| !row.pass() && row.known_limit().is_none()).count();
        println!("{} of {} rows pass or are known limits", rows.len() - unexplained, rows.len());
        if self.json {
            let scenes: Vec<_> = rows.iter().filter(|row| !row.is_bare()).map(Row::json).collect();
            println!("{}", json!({ "scenes": scenes }));
        }
        Ok(if unexplained == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE })
    }

    fn measure(&self, sheet: &mut Sheet<Record>, rows: &mut Vec<Row>) -> Result<(), Box<dyn Error>> {
        let methods = if self.method.is_empty() { vec![Coupling::default()] } else { self.method.clone() };
        let size = if self.output.quick { Size::Quick } else { Size::Full };
        sheet.recall()?;
        println!("{}", Row::HEAD);
        for experiment in self.chosen()? {
            let mut regions = self.regions.clone();
            regions.extend(experiment.more_regions);
            println!("\n{} {}: {}", experiment.number, experiment.name, experiment.metric);
            let of_experiment = run(&experiment, size, &methods, &regions)?;
            of_experiment.iter().for_each(|row| println!("{}", row.table()));
            let fresh: Vec<_> =
                of_experiment.iter().flat_map(Row::records).map(|record| sheet.measured(record)).collect();
            let key = |record: &Record| (record.scene, record.method.clone(), record.regions);
            let keys: BTreeSet<_> = fresh.iter().map(|fresh| key(&fresh.row)).collect();
            sheet.replace(|old| keys.contains(&key(old)), fresh)?;
            rows.extend(of_experiment);
        }
        Ok(())
    }

    fn chosen(&self) -> Result<Vec<Experiment>, String> {
        let all = experiments();
        let is = |experiment: &Experiment, asked: &String| {
            *asked == experiment.name || *asked == experiment.number.to_string()
        };
        if let Some(unknown) = self.scene.iter().find(|asked| !all.iter().any(|one| is(one, asked))) {
            let known: Vec<_> = all.iter().map(|experiment| experiment.name).collect();
            return Err(format!("the suite has no scene `{unknown}`; it has {}", known.join(", ")));
        }
        let asked = |experiment: &Experiment| {
            self.scene.is_empty() || self.scene.iter().any(|asked| is(experiment, asked))
        };
        Ok(all.into_iter().filter(asked).collect())
    }
}

/// Returns a coupling by its name.
fn method(name: &str) -> Result<Coupling, String> {
    Coupling::ALL.into_iter().find(|coupling| coupling.name() == name).ok_or_else(|| {
        let known: Vec<_> = Coupling::ALL.iter().map(|coupling| coupling.name()).collect();
        format!("there is {}", known.join(", "))
    })
}

/// Parses a number of regions that every scene has cuts for.
fn regions(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(count @ (1 | 2 | 4 | 8)) => Ok(count),
        _ => Err("scenes are cut into 1, 2, 4 or 8 regions".to_owned()),
    }
}

/// Sets a coupling, with as many exchanges per tick as suit it.
pub(crate) fn use_method(config: &mut WorldConfig, method: Coupling) {
    config.step.coupling = method;
    config.step.exchanges = method.usual_exchanges();
}

/// The settings of a bare world for a case.
type Settings = fn(&Case) -> Bare;

/// Bare worlds that are finer than R1: R2 has a sixteenth of its dt, R3 has contacts of four times the
/// natural frequency.
const FINER: [(&str, Settings); 2] = [
    ("R2", |case| Bare { dt_s: Some(case.scenes[0].dt_s / 16.0), iterations: Some(16), ..Bare::default() }),
    ("R3", |_| Bare { iterations: Some(16), contact_hz: Some(120.0), ..Bare::default() }),
];

/// Measures all rows of one experiment: R1, finer references where they are wanted, then every method at
/// every number of regions.
fn run(
    experiment: &Experiment,
    size: Size,
    methods: &[Coupling],
    regions: &[usize],
) -> Result<Vec<Row>, WorldError> {
    let cases = (experiment.cases)(size);
    let finer = if experiment.finer && size == Size::Full { &FINER[..] } else { &[] };
    let count = cases.len() * (1 + finer.len() + methods.len() * regions.len());
    let bar = ProgressBar::new(count as u64)
        .with_style(ProgressStyle::with_template("{prefix} {bar:30} {pos}/{len} {elapsed}").expect("fixed"))
        .with_prefix(experiment.name);
    bar.tick();
    let references: Vec<_> = cases
        .par_iter()
        .map(|case| Reference::of(case).inspect(|_| bar.inc(1)))
        .collect::<Result<_, WorldError>>()?;
    let pairs: Vec<_> = cases.iter().zip(&references).collect();

    let r1 = pairs.iter().map(|(case, reference)| Line::new(case, reference.r1.clone(), None));
    let mut rows = vec![Row::new(experiment, "R1", 0, r1.collect())];
    for (name, settings) in finer {
        let line = |(case, reference): &(&Case, &Reference)| {
            let reading = read(case, &Setup::Bare(settings(case)), reference)?;
            bar.inc(1);
            Ok(Line::new(case, reading, None))
        };
        rows.push(Row::new(
            experiment,
            name,
            0,
            pairs.par_iter().map(line).collect::<Result<_, WorldError>>()?,
        ));
    }
    let jobs: Vec<_> =
        methods.iter().flat_map(|&method| regions.iter().map(move |&regions| (method, regions))).collect();
    let row = |&(method, regions): &(Coupling, usize)| {
        let adjust = move |config: &mut WorldConfig| use_method(config, method);
        let setup = Setup::Cut { regions, adjust: &adjust };
        let line = |(case, reference): &(&Case, &Reference)| {
            let reading = read(case, &setup, reference)?;
            bar.inc(1);
            let verdict = gate::judge(case, &reading, &reference.r1);
            Ok(Line::new(case, reading, Some(verdict)))
        };
        let lines = pairs.par_iter().map(line).collect::<Result<_, WorldError>>()?;
        Ok(Row::new(experiment, method.name(), regions, lines))
    };
    rows.extend(jobs.par_iter().map(row).collect::<Result<Vec<_>, WorldError>>()?);
    bar.finish_and_clear();
    Ok(rows)
}
