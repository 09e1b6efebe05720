//! Writes the matrix of the page, experiments by methods, from the records of the file.

use std::collections::BTreeSet;

use dcd::physics::Coupling;

use super::limits::{self, LIMITS};
use super::record::Record;
use crate::page;
use crate::results::{Measured, short};

/// Returns the matrix as Markdown. The cell of an experiment by a method has the worst error over its gate,
/// of all cases and numbers of regions. Below the matrix stand the named limits that show.
pub(super) fn table(rows: &[Measured<Record>]) -> String {
    let records: Vec<_> = rows.iter().map(|row| &row.row).collect();
    let mut experiments: Vec<(u8, &str)> = Vec::new();
    for record in &records {
        if !experiments.contains(&(record.scene, &record.name)) {
            experiments.push((record.scene, &record.name));
        }
    }
    let measured = |method: &&str| records.iter().any(|record| record.method == *method);
    let methods: Vec<_> = Coupling::ALL.map(Coupling::name).into_iter().filter(measured).collect();
    let causes = causes(&records);
    let head: Vec<_> = ["#", "scene"].into_iter().chain(methods.iter().copied()).collect();
    let lines = experiments.into_iter().map(|(number, name)| {
        let cells = methods.iter().map(|method| {
            let own: Vec<_> =
                records.iter().filter(|one| (&*one.name, &*one.method) == (name, method)).copied().collect();
            cell(&own, &causes)
        });
        [number.to_string(), name.to_owned()].into_iter().chain(cells).collect()
    });
    let list: String =
        (1..).zip(&causes).map(|(i, cause)| format!("\n{i}. {}", excused(cause, &records))).collect();
    format!(
        "{}{}",
        page::table(&head, lines),
        if list.is_empty() { list } else { format!("\nKnown limits:\n{list}") }
    )
}

/// Returns the text of a cell. A cell that fails is bold, with the numbers of regions at which it fails, and
/// with the numbers of the limits if all failures have a known one.
fn cell(records: &[&Record], causes: &[&'static str]) -> String {
    let failing: Vec<_> = records.iter().filter(|record| !record.pass).copied().collect();
    let worst = |of: &[&Record]| of.iter().filter_map(|record| record.of_gate()).reduce(f64::max);
    if failing.is_empty() {
        return worst(records).map_or("–".to_owned(), short);
    }
    let regions: BTreeSet<_> = failing.iter().map(|record| record.regions).collect();
    let regions = regions.iter().map(usize::to_string).collect::<Vec<_>>().join(", ");
    let known: Option<BTreeSet<_>> = failing
        .iter()
        .map(|record| {
            causes.iter().position(|cause| cause_of(record) == Some(*cause)).map(|i| (i + 1).to_string())
        })
        .collect();
    let limit = known.map_or(String::new(), |known| {
        format!(", limit {}", known.into_iter().collect::<Vec<_>>().join(", "))
    });
    format!("**{}** (at {regions}{limit})", worst(&failing).map_or("fails".to_owned(), short))
}

/// Returns the limit that excuses a record. No limit excuses bodies that are lost, doubled or quarantined,
/// nor a failure whose error is within its gate.
fn cause_of(record: &Record) -> Option<&'static str> {
    let is_whole = record.lost + record.doubled + record.quarantined == 0;
    let gates = record.of_gate().filter(|&gates| is_whole && gates > 1.0)?;
    limits::cause(&record.name, &record.case, &record.method, gates)
}

/// Returns the causes that show in the records, in the order of their list.
fn causes(records: &[&Record]) -> Vec<&'static str> {
    let mut causes: Vec<&'static str> = Vec::new();
    for limit in LIMITS {
        let shows = records.iter().any(|record| !record.pass && cause_of(record) == Some(limit.cause));
        if shows && !causes.contains(&limit.cause) {
            causes.push(limit.cause);
        }
    }
    causes
}

/// Returns a limit as text, with the experiments and methods where it shows.
fn excused(cause: &str, records: &[&Record]) -> String {
    let failing = records.iter().filter(|record| !record.pass && cause_of(record) == Some(cause));
    let places: BTreeSet<_> =
        failing.map(|record| format!("`{}` by `{}`", record.name, record.method)).collect();
    format!("{cause}: {}.", places.into_iter().collect::<Vec<_>>().join(", "))
}

#[cfg(test)]
mod tests {
    use super::super::report::tests::record;
    use super::*;
    use crate::machine::Machine;

    fn measured(records: &[Record]) -> Vec<Measured<Record>> {
        let machine = Machine { cpu: "c".into(), cores: 2, date: "2026-11-26".into(), commit: "a".into() };
        records.iter().map(|row| Measured { row: row.clone(), machine: machine.clone() }).collect()
    }

    fn of(name: &str, method: &str, regions: usize, error: f64) -> Record {
        Record { name: name.into(), method: method.into(), regions, ..record("4 s", error, 0.5) }
    }

    #[test]
    fn a_cell_is_the_worst_of_all_regions_and_bold_where_it_fails() {
        let rows = measured(&[
            of("tower", "R1", 0, 9.0),
            of("tower", "auto", 2, 0.1),
            of("tower", "auto", 4, 0.25),
            of("tower", "owner", 2, 0.75),
            of("tower", "owner", 4, 0.1),
            of("tower", "owner", 8, 1.5),
        ]);
        let table = table(&rows);
        assert!(table.contains("| # | scene | owner | auto |"), "{table}");
        assert!(table.contains("| 10 | tower | **3.00** (at 2, 8) | 0.500 |"), "{table}");
        assert!(!table.contains("Known"), "{table}");
    }

    #[test]
    fn what_fails_for_a_known_cause_names_it() {
        let rows = measured(&[of("gas", "overlap", 2, 5.0), of("gas", "owner", 2, 5.0)]);
        let table = table(&rows);
        assert!(table.contains("| **10.0** (at 2) | **10.0** (at 2, limit 1) |"), "{table}");
        assert!(
            table.contains(
                "\n1. a body at the edge of the overlap is hit with a part of its mass: `gas` by `overlap`."
            ),
            "{table}"
        );
    }

    #[test]
    fn what_fails_by_something_else_than_its_error_is_bold_and_what_has_no_gate_is_nothing() {
        let mut heavy = of("tower", "auto", 2, 0.1);
        heavy.pass = false;
        let near = of("tower", "auto", 4, 0.45);
        let free = Record { threshold: None, ..of("delayed", "auto", 2, 0.1) };
        let excused = Record { name: "gas".into(), method: "overlap".into(), ..heavy.clone() };
        let table = table(&measured(&[heavy, near, free, excused]));
        assert!(table.contains("**0.200** (at 2)") && table.contains("| delayed | –"), "{table}");
        assert!(!table.contains("limit"), "{table}");
    }
}
