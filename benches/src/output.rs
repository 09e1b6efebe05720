//! Gives every command that measures its frame: rows go to a CSV as they come; pictures and the page's table
//! are made from that file.

use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::draw::{self, LinePanels};
use crate::machine::Machine;
use crate::page;
use crate::results::{self, Measured};

/// The place where results go, and whether they are measured or only drawn.
#[derive(Args)]
pub(crate) struct Output {
    /// Measures a few small cases, whose figures are worth nothing.
    #[arg(long)]
    pub(crate) quick: bool,
    /// The folder of the results [default: benches/results; with `--quick` quick-results beside this
    /// program].
    #[arg(long, value_name = "FOLDER")]
    out: Option<PathBuf>,
    /// Draws pictures and tables from the files, without measuring.
    #[arg(long)]
    draw: bool,
}

/// Says what missed its gates, each case with its name. Returns the suite's exit code: a failure if anything did.
pub(crate) fn exit_code(missed: impl Iterator<Item = (String, String)>) -> ExitCode {
    let count = missed.map(|(name, missed)| eprintln!("{name}: {missed}")).count();
    if count == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

type Write<Row> = fn(&[Measured<Row>]) -> String;
type Draw<Row> = fn(&[Measured<Row>]) -> LinePanels;

/// How the rows of one file are shown. The file, the picture and the markers on the page have the same name.
/// Below the table, which may be empty, the page says when the rows were measured.
pub(crate) struct Shown<Row> {
    pub(crate) name: &'static str,
    pub(crate) table: Write<Row>,
    pub(crate) picture: Option<Draw<Row>>,
}

/// The rows of one file. The file is written after every change, so that a run that is stopped keeps what it
/// has.
pub(crate) struct Sheet<Row> {
    path: PathBuf,
    machine: Machine,
    rows: Vec<Measured<Row>>,
}

impl Output {
    pub(crate) fn folder(&self) -> Result<PathBuf, Box<dyn Error>> {
        results::folder(self.out.as_deref(), self.quick)
    }

    /// Measures, unless results are only drawn, and shows what the file then holds.
    pub(crate) fn fill<Row: Serialize + DeserializeOwned>(
        &self,
        shown: &Shown<Row>,
        measure: impl FnOnce(&mut Sheet<Row>) -> Result<(), Box<dyn Error>>,
    ) -> Result<Vec<Measured<Row>>, Box<dyn Error>> {
        let folder = self.folder()?;
        let path = folder.join(shown.name).with_extension("csv");
        if !self.draw {
            measure(&mut Sheet { path: path.clone(), machine: Machine::here(), rows: Vec::new() })?;
        }
        let rows = results::read_csv(&path)?;
        shown.publish(&folder, &rows)?;
        Ok(rows)
    }
}

impl<Row> Shown<Row> {
    fn publish(&self, folder: &Path, rows: &[Measured<Row>]) -> Result<(), Box<dyn Error>> {
        if let Some(picture) = self.picture {
            draw::write(&picture(rows), &folder.join(self.name))?;
        }
        let measured = page::measured("Rows", rows.iter().map(|row| &row.machine));
        let table = if rows.is_empty() { String::new() } else { (self.table)(rows) };
        let text = format!("{}\n\n{measured}", table.trim_end());
        let text = text.trim_start();
        println!("{text}");
        page::put(folder, self.name, text)
    }
}

impl<Row: Serialize + DeserializeOwned> Sheet<Row> {
    /// Begins with the rows of the file, of which some are to be measured anew.
    pub(crate) fn recall(&mut self) -> Result<(), Box<dyn Error>> {
        self.rows = results::read_csv(&self.path)?;
        Ok(())
    }

    /// Returns the rows of the sheet.
    pub(crate) fn rows(&self) -> &[Measured<Row>] {
        &self.rows
    }

    /// Returns a row as measured now on this machine.
    pub(crate) fn measured(&self, row: Row) -> Measured<Row> {
        Measured { row, machine: self.machine.clone() }
    }

    /// Adds a row that was measured now.
    pub(crate) fn push(&mut self, row: Row) -> Result<(), Box<dyn Error>> {
        let row = self.measured(row);
        self.replace(|_| false, [row])
    }

    /// Puts rows in the place of those that are stale.
    pub(crate) fn replace(
        &mut self,
        is_stale: impl Fn(&Row) -> bool,
        rows: impl IntoIterator<Item = Measured<Row>>,
    ) -> Result<(), Box<dyn Error>> {
        let at = self.rows.iter().position(|old| is_stale(&old.row)).unwrap_or(self.rows.len());
        self.rows.retain(|old| !is_stale(&old.row));
        self.rows.splice(at..at, rows);
        results::write_csv(&self.path, &self.rows)
    }
}

#[cfg(test)]
mod tests {
    use serde::Deserialize;

    use super::*;

    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    struct Row {
        scene: String,
        error: f64,
    }

    const SHOWN: Shown<Row> =
        Shown { name: "frame", table: |rows| format!("| {} rows |\n", rows.len()), picture: None };

    fn row(scene: &str, error: f64) -> Row {
        Row { scene: scene.to_owned(), error }
    }

    fn output(folder: &Path, draw: bool) -> Output {
        Output { quick: true, out: Some(folder.to_owned()), draw }
    }

    #[test]
    fn rows_measured_anew_take_the_place_of_the_old_ones_and_the_others_stay() {
        let folder = tempfile::tempdir().unwrap();
        let first = |sheet: &mut Sheet<Row>| {
            [("pile", 1.0), ("net", 2.0), ("gas", 3.0)]
                .into_iter()
                .try_for_each(|(scene, error)| sheet.push(row(scene, error)))
        };
        output(folder.path(), false).fill(&SHOWN, first).unwrap();
        let again = |sheet: &mut Sheet<Row>| {
            sheet.recall()?;
            let fresh = sheet.measured(row("net", 9.0));
            sheet.replace(|old| old.scene == "net", [fresh])
        };
        let rows = output(folder.path(), false).fill(&SHOWN, again).unwrap();
        let rows: Vec<_> = rows.into_iter().map(|row| row.row).collect();
        assert_eq!(rows, [row("pile", 1.0), row("net", 9.0), row("gas", 3.0)]);
    }

    #[test]
    fn drawing_measures_nothing_and_the_page_says_when_its_rows_were_measured() {
        let folder = tempfile::tempdir().unwrap();
        let page = folder.path().join("README.md");
        std::fs::write(&page, "<!-- frame: x -->\n<!-- /frame -->\n").unwrap();
        output(folder.path(), true).fill(&SHOWN, |_| panic!("measures")).unwrap();
        assert!(std::fs::read_to_string(&page).unwrap().contains("-->\nNot measured yet.\n<!--"));
        output(folder.path(), false).fill(&SHOWN, |sheet| sheet.push(row("net", 1.0))).unwrap();
        let text = std::fs::read_to_string(&page).unwrap();
        assert!(text.contains("| 1 rows |\n\nRows measured on 2"), "{text}");
    }
}
