//! Writes and reads results as CSV, the one form in which figures are kept. Pictures and tables are made from
//! it, never from a run.

use std::error::Error;
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::machine::Machine;

/// A row with the machine it was measured on.
#[derive(Clone, Debug)]
pub(crate) struct Measured<Row> {
    pub(crate) row: Row,
    pub(crate) machine: Machine,
}

/// Returns the folder of committed results.
pub(crate) fn committed() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("results")
}

/// Returns the folder that results go to: the one asked for, else that of the committed results. Quick
/// results are not worth committing, and go beside this program.
pub(crate) fn folder(asked: Option<&Path>, quick: bool) -> Result<PathBuf, Box<dyn Error>> {
    let folder = match asked {
        Some(folder) => folder.to_owned(),
        None if quick => std::env::current_exe()?.with_file_name("quick-results"),
        None => committed(),
    };
    std::fs::create_dir_all(&folder).map_err(|error| format!("cannot make {}: {error}", folder.display()))?;
    Ok(folder)
}

/// Writes a file whole or not at all: a run that is stopped leaves the results of the last one.
pub(crate) fn write_file(path: &Path, bytes: &[u8]) -> Result<(), Box<dyn Error>> {
    let fresh = path.with_extension("part");
    std::fs::write(&fresh, bytes)
        .and_then(|()| std::fs::rename(&fresh, path))
        .map_err(|error| format!("cannot write {}: {error}", path.display()).into())
}

/// Writes rows; the machine's columns come after their own.
pub(crate) fn write_csv<Row: Serialize>(path: &Path, rows: &[Measured<Row>]) -> Result<(), Box<dyn Error>> {
    let mut csv = csv::Writer::from_writer(Vec::new());
    for Measured { row, machine } in rows {
        csv.serialize((row, machine))?;
    }
    write_file(path, &csv.into_inner()?)
}

/// Reads rows; a file that is not there has none.
pub(crate) fn read_csv<Row: DeserializeOwned>(path: &Path) -> Result<Vec<Measured<Row>>, Box<dyn Error>> {
    if !path.exists() {
        return Ok(Vec::new());
    }
    let explained = |error: csv::Error| format!("cannot read {}: {error}; measure it anew", path.display());
    let mut csv = csv::Reader::from_path(path).map_err(explained)?;
    let names = csv.headers().map_err(explained)?.clone();
    let mut rows = Vec::new();
    for record in csv.records() {
        let record = record.map_err(explained)?;
        // By name and twice: each struct takes its own columns.
        rows.push(Measured {
            row: record.deserialize(Some(&names)).map_err(explained)?,
            machine: record.deserialize(Some(&names)).map_err(explained)?,
        });
    }
    Ok(rows)
}

/// Formats a number as people read it, with three digits that count.
pub(crate) fn short(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    if !value.is_finite() {
        return "–".to_owned();
    }
    let magnitude = value.abs().log10().floor() as i32;
    match magnitude {
        ..-3 => format!("{value:.1e}"),
        -3..=2 => format!("{value:.*}", (2 - magnitude) as usize),
        _ => {
            let step = 10f64.powi(magnitude - 2);
            let digits = format!("{:.0}", (value / step).round() * step);
            let (sign, digits) = digits.split_at(usize::from(value < 0.0));
            let mut grouped = String::new();
            for (i, digit) in digits.chars().enumerate() {
                if i > 0 && (digits.len() - i) % 3 == 0 {
                    grouped.push(',');
                }
                grouped.push(digit);
            }
            format!("{sign}{grouped}")
        }
    }
}

#[cfg(test)]
mod tests {
    use serde::Deserialize;

    use super::*;

    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    struct Row {
        name: String,
        error: f64,
        threshold: Option<f64>,
    }

    #[test]
    fn rows_and_machine_come_back_from_a_file() {
        let path = std::env::temp_dir().join(format!("dcd-benches-rows-{}.csv", std::process::id()));
        let row = |name: &str, threshold| Row { name: name.to_owned(), error: f64::INFINITY, threshold };
        let machine = Machine { cpu: "a, b".into(), cores: 2, date: "2026-11-20".into(), commit: "c".into() };
        let rows = [row("tower, tall", None), row("pile", Some(0.01))]
            .map(|row| Measured { row, machine: machine.clone() });
        write_csv(&path, &rows).unwrap();
        let read = read_csv::<Row>(&path).unwrap();
        std::fs::remove_file(&path).unwrap();
        assert_eq!(read.len(), 2);
        for (read, row) in read.iter().zip(&rows) {
            assert_eq!((&read.row, &read.machine), (&row.row, &machine));
        }
    }

    #[test]
    fn numbers_have_three_digits_that_count() {
        let numbers = [0.0, 1.0, 0.001_234_5, 0.000_012_3, 12.345, 123.45, 1_234.5, 20_000.0, -1_234_567.0];
        let shorts = ["0", "1.00", "0.00123", "1.2e-5", "12.3", "123", "1,230", "20,000", "-1,230,000"];
        assert_eq!(numbers.map(short), shorts);
    }
}
