//! Decides whether `auto` lies on the Pareto front: no fixed setting of as many regions is both faster and more accurate beyond noise.

use std::fmt::Write as _;

use super::Row;
use crate::page;
use crate::results::{Measured, short};

/// Times differ by this much from run to run on a quiet machine.
const SPEED_NOISE: f64 = 1.1;

/// A preset of `auto` in a scene, and the fixed setting that is better, if one is.
pub(super) struct Verdict<'a> {
    pub(super) auto: &'a Row,
    /// Of several the fastest.
    pub(super) better: Option<&'a Row>,
}

/// Of every preset at every number of regions above one.
pub(super) fn verdicts(rows: &[Measured<Row>]) -> Vec<Verdict<'_>> {
    let autos = rows.iter().map(|row| &row.row).filter(|row| row.method == "auto" && row.regions > 1);
    autos.map(|auto| Verdict { auto, better: better(auto, rows) }).collect()
}

fn better<'a>(auto: &Row, rows: &'a [Measured<Row>]) -> Option<&'a Row> {
    let fixed = rows.iter().map(|row| &row.row).filter(|row| {
        (&row.scene, &row.case, row.regions) == (&auto.scene, &auto.case, auto.regions)
            && row.method != "auto"
    });
    fixed.filter(|fixed| beats(fixed, auto)).max_by(|a, b| a.rtf.total_cmp(&b.rtf))
}

/// Both faster and more accurate beyond noise. What breaks the gate where the other passes it is not more accurate: its error
/// is small and its momentum or its ground force is wrong.
fn beats(fixed: &Row, auto: &Row) -> bool {
    let accurate = fixed.error < auto.error - auto.noise && (fixed.pass || !auto.pass);
    accurate && fixed.rtf > SPEED_NOISE * auto.rtf
}

/// For the terminal: one line for every setting that beats a preset.
pub(super) fn text(rows: &[Measured<Row>]) -> String {
    let mut text = String::new();
    let verdicts = verdicts(rows);
    let beaten: Vec<_> = verdicts.iter().filter(|verdict| verdict.better.is_some()).collect();
    for Verdict { auto, better } in &beaten {
        let better = better.expect("filtered");
        writeln!(
            text,
            "{} {}, {} regions: {} with {} exchanges beats auto {}: {:.2}x as fast, error {} against {} {}",
            auto.scene,
            auto.case,
            auto.regions,
            better.method,
            better.setting,
            auto.setting,
            better.rtf / auto.rtf,
            short(better.error),
            short(auto.error),
            auto.unit
        )
        .expect("a string takes all");
    }
    writeln!(text, "auto is on the front in {} of {}", verdicts.len() - beaten.len(), verdicts.len())
        .expect("a string takes all");
    text
}

/// For the page: the usual preset beside one bare world.
pub(super) fn table(rows: &[Measured<Row>]) -> String {
    let lines = verdicts(rows).into_iter().filter(|verdict| verdict.auto.setting == "game").map(|verdict| {
        let Verdict { auto, better } = verdict;
        let bare = rows
            .iter()
            .map(|row| &row.row)
            .find(|row| (&row.scene, &row.case) == (&auto.scene, &auto.case) && row.method == "bare");
        let unit = if auto.unit.is_empty() { String::new() } else { format!(" {}", auto.unit) };
        vec![
            format!("{} {}", auto.scene, auto.case),
            auto.regions.to_string(),
            bare.map_or("–".to_owned(), |bare| format!("{}{unit}", short(bare.error))),
            format!("{}{unit}", short(auto.error)),
            if auto.pass { "passes" } else { "fails" }.to_owned(),
            bare.map_or("–".to_owned(), |bare| format!("{:.2}×", auto.rtf / bare.rtf)),
            better.map_or("none".to_owned(), |better| {
                format!(
                    "{}, {} exchanges: {:.2}× as fast, error {}",
                    better.method,
                    better.setting,
                    better.rtf / auto.rtf,
                    short(better.error)
                )
            }),
        ]
    });
    let head = [
        "scene",
        "regions",
        "error, bare",
        "error, auto",
        "gate",
        "speed over bare",
        "fixed setting that is better",
    ];
    page::table(&head, lines)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::Machine;

    fn row(method: &str, regions: usize, error: f64, rtf: f64) -> Measured<Row> {
        let row = Row {
            scene: "tower".into(),
            case: "1:1".into(),
            method: method.into(),
            sweep: "exchanges".into(),
            setting: "game".into(),
            regions,
            threads: 1,
            error,
            unit: "m".into(),
            noise: 0.1 * error,
            gate: 1.0,
            pass: true,
            rtf,
            mean_ms: 1.0,
            p50_ms: 1.0,
            p99_ms: 1.0,
            max_ms: 1.0,
        };
        Measured { row, machine: Machine::here() }
    }

    #[test]
    fn only_what_is_faster_and_more_accurate_beyond_noise_at_as_many_regions_beats_auto() {
        let beaten = |other| verdicts(&[row("auto", 2, 1.0, 100.0), other])[0].better.is_some();
        assert!(beaten(row("owner", 2, 0.5, 200.0)));
        assert!(!beaten(row("owner", 2, 0.95, 200.0)), "within the noise of the error");
        assert!(!beaten(row("owner", 2, 0.5, 105.0)), "within the noise of the clock");
        assert!(!beaten(row("owner", 2, 2.0, 200.0)), "less accurate");
        assert!(!beaten(row("owner", 2, 0.5, 50.0)), "slower");
        assert!(!beaten(row("owner", 4, 0.5, 200.0)), "at other regions");
        let mut failing = row("owner", 2, 0.5, 200.0);
        failing.row.pass = false;
        assert!(!beaten(failing), "breaks the gate");
    }
}
