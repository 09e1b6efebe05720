//! Measures how much faster a world is on more cores: in one region, which Rapier's `parallel` shares out
//! among all threads, and cut into several, each of which has a part of the threads. The error of a cut does
//! not depend on threads: it is that of the same cut in [`Scale`](super::Scale).

use std::error::Error;
use std::thread::available_parallelism;
use std::time::Instant;

use clap::Args;
use dcd::runtime::measure::Cast;
use dcd::scene::Scene;
use serde::{Deserialize, Serialize};
use serde_json::json;

use super::case::Case;
use super::setting::Setting;
use super::time::{self, Timed};
use super::{Progress, row};
use crate::draw::{BLACK_LINE, COLOURS, Line, LinePanel, LinePanels, Mark};
use crate::output::{Output, Sheet, Shown};
use crate::page;
use crate::results::{self, Measured, short};
use crate::timing::WARM_UP;

const SHOWN: Shown<Row> = Shown { name: "cores", table, picture: Some(picture) };
/// The scenes of `scale` in which bodies lie at every border, and that take long enough for sixteen cores.
const SCENES: [&str; 5] = ["rubble", "dve", "gas", "pour", "wall"];
/// The numbers of threads. Where more threads are asked for than there are cores, times say nothing.
const THREADS: [u16; 4] = [2, 4, 8, 16];
const REGIONS: [usize; 4] = [2, 4, 8, 16];

/// Which scenes are run, and on how many threads. With `--quick` one small scene on two.
#[derive(Args)]
pub(crate) struct Cores {
    /// Only this scene; rows of others stay in the file. May be given several times.
    #[arg(long, value_name = "NAME")]
    scene: Vec<String>,
    /// Numbers of threads, whose rows replace all rows of the scene [default: of 2, 4, 8 and 16 those for
    /// which there are cores].
    #[arg(long, value_delimiter = ',', value_parser = clap::value_parser!(u16).range(2..=1024))]
    threads: Vec<u16>,
    /// Steps of each run that are timed, after the warm-up.
    #[arg(long, default_value_t = 30, value_parser = clap::value_parser!(u16).range(1..))]
    ticks: u16,
    /// Times each setting this often; the fastest counts.
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u16).range(1..))]
    repeats: u16,
    #[command(flatten)]
    output: Output,
    /// Prints one JSON object last.
    #[arg(long)]
    json: bool,
}

/// A scene by one setting on so many threads.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Row {
    scene: String,
    bodies: usize,
    /// `bare`, Rapier's `parallel`, what dcd chooses by `default`, or `auto` with regions that were asked
    /// for.
    setting: String,
    /// The number of regions; 0: one bare Rapier world.
    regions: usize,
    threads: usize,
    /// Milliseconds per step, median of the fastest run.
    ms_p50: f64,
    /// The median step over that of one bare world on one thread: below 1 is faster.
    over_bare: f64,
    /// The same for the processor time of all threads.
    cpu_over_bare: f64,
    /// The error over its gate, of the same cut in `scale`: 1 just passes.
    of_gate: Option<f64>,
}

impl Cores {
    pub(crate) fn run(self) -> Result<(), Box<dyn Error>> {
        let mut fresh = Vec::new();
        self.output.fill(&SHOWN, |sheet| self.measure_all(sheet, &mut fresh))?;
        if self.json {
            println!("{}", json!({ "rows": fresh }));
        }
        Ok(())
    }

    fn measure_all(&self, sheet: &mut Sheet<Row>, fresh: &mut Vec<Row>) -> Result<(), Box<dyn Error>> {
        sheet.recall()?;
        let scenes: Vec<&str> = match &self.scene[..] {
            [] if self.output.quick => vec!["gas"],
            [] => SCENES.to_vec(),
            asked => asked.iter().map(String::as_str).collect(),
        };
        for scene in scenes {
            let case = Case::named(scene)?;
            let rows = self.measure(case)?;
            fresh.extend(rows.iter().cloned());
            let rows: Vec<_> = rows.into_iter().map(|row| sheet.measured(row)).collect();
            sheet.replace(|old| old.scene == case.name, rows)?;
        }
        Ok(())
    }

    fn threads(&self) -> Vec<usize> {
        let cores = available_parallelism().map_or(1, usize::from);
        match &self.threads[..] {
            [] if self.output.quick => vec![2],
            [] => THREADS.into_iter().map(usize::from).filter(|&threads| threads <= cores.max(2)).collect(),
            asked => asked.iter().map(|&threads| threads.into()).collect(),
        }
    }

    fn measure(&self, case: &Case) -> Result<Vec<Row>, Box<dyn Error>> {
        let progress = Progress { scene: case.name, start: Instant::now() };
        let scene = case.timed_scene(self.output.quick)?;
        let bodies = Cast::of_scene(&scene).bodies.len();
        let errors = results::read_csv::<row::Row>(&self.output.folder()?.join("scale.csv"))?;
        let mut settings = vec![(Setting::Bare, 1)];
        for threads in self.threads() {
            settings.extend([Setting::Parallel, Setting::Default].map(|setting| (setting, threads)));
            let cuts = REGIONS.into_iter().filter(|&regions| regions <= threads);
            settings.extend(cuts.map(|regions| (Setting::Auto(regions), threads)));
        }
        let best = self.time(&scene, &settings, &progress)?;
        let rows = settings.iter().zip(&best).map(|(&(setting, threads), timed)| Row {
            scene: case.name.to_owned(),
            bodies,
            setting: setting.name().to_owned(),
            regions: timed.regions,
            threads,
            ms_p50: timed.p50_ms,
            over_bare: timed.p50_ms / best[0].p50_ms,
            cpu_over_bare: timed.cpu_ms / best[0].cpu_ms,
            of_gate: errors
                .iter()
                .find(|old| old.row.is_of(case, bodies, setting))
                .and_then(|old| old.row.of_gate()),
        });
        Ok(rows.collect())
    }

    /// Runs every setting once in each round, so that whatever else the machine does disturbs all alike.
    fn time(
        &self,
        scene: &Scene,
        settings: &[(Setting, usize)],
        progress: &Progress,
    ) -> Result<Vec<Timed>, Box<dyn Error>> {
        let mut best: Vec<Option<Timed>> = vec![None; settings.len()];
        let rounds = if self.output.quick { 1 } else { self.repeats };
        for round in 1..=rounds {
            for (&(setting, threads), best) in settings.iter().zip(&mut best) {
                progress
                    .tell(format_args!("round {round} of {rounds}: {}, {threads} threads", setting.label()));
                let mut config = setting.config(scene, threads);
                if let Some(config) = &mut config {
                    config.threads = threads;
                }
                let ticks = WARM_UP + usize::from(self.ticks);
                let timed = time::run(scene, ticks, config, setting.threads(threads))?;
                *best = Some(best.map_or(timed, |best| best.least(timed)));
            }
        }
        Ok(best.into_iter().flatten().collect())
    }
}

impl Row {
    fn label(&self) -> String {
        if self.setting == "auto" { format!("auto {}", self.regions) } else { self.setting.clone() }
    }
}

/// Returns the table: a line for each scene and number of threads, and a column for each setting. The error
/// over its gate stands there in bold where it does not pass.
fn table(rows: &[Measured<Row>]) -> String {
    let of = |scene: &str, threads: usize, label: &str| {
        let rows = rows.iter().map(|row| &row.row);
        rows.filter(|row| row.scene == scene && row.threads == threads).find(|row| row.label() == label)
    };
    let columns = ["parallel", "default"].map(str::to_owned).into_iter();
    let columns: Vec<_> = columns.chain(REGIONS.map(|regions| format!("auto {regions}"))).collect();
    let cell = |row: Option<&Row>| {
        row.map_or("–".to_owned(), |row| match row.of_gate {
            Some(of_gate) if of_gate > 1.0 => format!("{:.3}×, **{}**", row.over_bare, short(of_gate)),
            Some(_) => format!("{:.3}×", row.over_bare),
            None => format!("{:.3}×, ?", row.over_bare),
        })
    };
    let head = ["scene", "bodies", "bare, ms", "threads"].into_iter();
    let head: Vec<_> = head.chain(columns.iter().map(String::as_str)).collect();
    let firsts = rows.iter().map(|row| &row.row).filter(|row| row.setting == "parallel");
    let lines = firsts.map(|first| {
        let bare_ms = of(&first.scene, 1, "bare").map_or("–".to_owned(), |row| short(row.ms_p50));
        let named = [first.scene.clone(), first.bodies.to_string(), bare_ms, first.threads.to_string()];
        let cells = columns.iter().map(|column| cell(of(&first.scene, first.threads, column)));
        named.into_iter().chain(cells).collect()
    });
    page::table(&head, lines)
}

/// Draws a panel for each scene: how many times faster a setting is than one bare world on one thread, by
/// threads.
fn picture(rows: &[Measured<Row>]) -> LinePanels {
    let machine = rows.last().map_or(String::new(), |row| row.machine.caption());
    let mut scenes: Vec<_> = rows.iter().map(|row| (&*row.row.scene, row.row.bodies)).collect();
    scenes.dedup();
    let settings = [
        ("parallel", "Rapier's own parallel", COLOURS[3], Mark::Cross),
        ("default", "what dcd chooses", COLOURS[2], Mark::Square),
        ("auto 2", "auto, 2 regions", COLOURS[0], Mark::Dot),
        ("auto 4", "auto, 4 regions", COLOURS[1], Mark::Dot),
        ("auto 8", "auto, 8 regions", COLOURS[4], Mark::Dot),
        ("auto 16", "auto, 16 regions", BLACK_LINE, Mark::Dot),
    ];
    let panel = |(scene, bodies): (&str, usize)| {
        let lines = settings.iter().map(|&(label, name, colour, mark)| {
            let of_line = rows.iter().map(|row| &row.row);
            let of_line = of_line.filter(|row| row.scene == scene && row.label() == label);
            let points = of_line.map(|row| (row.threads as f64, 1.0 / row.over_bare, String::new()));
            // A cut world is not run on fewer threads than it has regions.
            let start = (!label.starts_with("auto")).then_some((1.0, 1.0, String::new()));
            let points = start.into_iter().chain(points).collect();
            Line { name: name.to_owned(), colour, thick: label == "default", mark, points }
        });
        LinePanel {
            title: format!("{scene}, {bodies} bodies"),
            x_label: None,
            y_label: "times as fast as one bare world".to_owned(),
            lines: lines.collect(),
            limit: None,
        }
    };
    LinePanels {
        title: "More cores".to_owned(),
        caption: format!("Against one bare Rapier world on one thread.\n{machine}"),
        x_label: "threads".to_owned(),
        columns: 3,
        panels: scenes.into_iter().map(panel).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scale::row::tests::machine;

    fn row(
        setting: &str,
        regions: usize,
        threads: usize,
        over_bare: f64,
        of_gate: Option<f64>,
    ) -> Measured<Row> {
        let (scene, setting) = ("net".to_owned(), setting.to_owned());
        let row = Row {
            scene,
            bodies: 2_500,
            setting,
            regions,
            threads,
            ms_p50: 8.0 * over_bare,
            over_bare,
            cpu_over_bare: 1.0,
            of_gate,
        };
        Measured { row, machine: machine() }
    }

    #[test]
    fn a_line_of_the_table_is_a_scene_on_so_many_threads_and_errors_that_fail_stand_beside_the_time() {
        let rows = [
            row("bare", 0, 1, 1.0, Some(0.0)),
            row("parallel", 0, 2, 0.55, Some(0.0)),
            row("default", 1, 2, 0.5, Some(0.0)),
            row("auto", 2, 2, 0.75, Some(1.5)),
            row("parallel", 0, 4, 0.25, Some(0.0)),
            row("auto", 4, 4, 0.125, None),
        ];
        let text = table(&rows);
        let lines: Vec<_> = text.lines().skip(2).collect();
        assert_eq!(lines[0], "| net | 2500 | 8.00 | 2 | 0.550× | 0.500× | 0.750×, **1.50** | – | – | – |");
        assert_eq!(lines[1], "| net | 2500 | 8.00 | 4 | 0.250× | – | – | 0.125×, ? | – | – |");
        assert_eq!(lines.len(), 2);
    }
}
