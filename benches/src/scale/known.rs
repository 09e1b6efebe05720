//! Names the errors that are known to be beyond their gates, each with what is known of its cause. A run fails with
//! any other.

use super::error::BROKEN;
use super::row::Row;

/// A setting that is known to err in a scene.
struct Known {
    scene: &'static str,
    /// The setting, with its number of regions.
    setting: &'static str,
    /// Says whether the scene has the size of `--quick`.
    small: bool,
    /// The largest error that is excused, in gates: half as much again as was measured. Beyond it something
    /// else is wrong.
    most: f64,
    cause: &'static str,
}

const KNOWN: [Known; 10] = [
    Known { scene: "rubble", setting: "auto 8", small: true, most: 2.1, cause: FEW },
    Known { scene: "rubble", setting: "owner 2", small: true, most: 2.2, cause: APART },
    Known { scene: "rubble", setting: "overlap 2", small: true, most: 4.4, cause: FALLING },
    Known { scene: "gas", setting: "overlap 2", small: true, most: 14.3, cause: EDGE },
    Known { scene: "domino_ring", setting: "owner 2", small: true, most: 150.0, cause: APART },
    Known { scene: "rubble", setting: "auto 2", small: false, most: 1.6, cause: DEEPEST },
    Known { scene: "rubble", setting: "owner 2", small: false, most: 4.6, cause: APART },
    Known { scene: "gas", setting: "overlap 2", small: false, most: 5.9, cause: EDGE },
    Known { scene: "pyramid", setting: "owner 2", small: false, most: 22.4, cause: APART },
    Known { scene: "pyramid", setting: "overlap 2", small: false, most: 26.4, cause: SHALLOW },
];

const APART: &str =
    "each side of a border solves its contacts by itself, and the sides disagree about the force";
const EDGE: &str = "a body at the edge of the overlap is hit with a part of its mass";
const SHALLOW: &str = "the overlap is not as deep as the load asks for";
const DEEPEST: &str = "the deepest of all contacts decides, in one run of each";
const FALLING: &str =
    "towers that fall meet the edge of the overlap, or it is too shallow: that has not been looked into";
/// Sixteen starts, each a micrometre aside (2026-12-02): after a second what moves has 1.3 % more energy in
/// eight regions, and after four seconds the boxes fall by 2.7 m/s and are 38 mm lower, which is a tick. After
/// five they lie 12 mm lower, where the runs of one world differ by 50 mm. In full size eight regions pass.
const FEW: &str = "towers of 25 boxes to a region begin to fall a tick earlier, and are measured in mid-fall";

/// Returns the cause of a row's error, if it is known to be so large. Lost bodies are not excused.
fn cause(row: &Row, small: bool) -> Option<&'static str> {
    let (label, of_gate) = (row.label(), row.of_gate()?);
    if row.unit.as_deref() == Some(BROKEN) {
        return None;
    }
    KNOWN
        .iter()
        .filter(|known| (known.scene, known.small) == (&*row.scene, small) && known.setting == label)
        .find(|known| of_gate <= known.most)
        .map(|known| known.cause)
}

/// Returns in words what a row errs by and why, if that does not pass and is known.
pub(super) fn explained(row: &Row, small: bool) -> Option<String> {
    let cause = (!row.pass?).then(|| cause(row, small)).flatten()?;
    Some(format!("{} by {} errs by {:.2} gates: {cause}", row.scene, row.label(), row.of_gate()?))
}

/// Returns in words what a row errs by, if that does not pass and is not known.
pub(super) fn unexplained(row: &Row, small: bool) -> Option<String> {
    if row.pass? || cause(row, small).is_some() {
        return None;
    }
    let (label, unit) = (row.label(), row.unit.as_deref().unwrap_or_default());
    Some(format!("{} by {label} errs by {:.2} gates ({unit})", row.scene, row.of_gate()?))
}

#[cfg(test)]
mod tests {
    use super::super::case::Case;
    use super::super::setting::SETTINGS;
    use super::*;
    use crate::results::{committed, read_csv};

    /// Returns the rows of the page that nothing would excuse if all errors were so many times theirs.
    fn unexplained_if(times: f64) -> Vec<String> {
        let rows = read_csv::<Row>(&committed().join("scale.csv")).unwrap();
        let mut rows: Vec<_> = rows.into_iter().map(|row| row.row).collect();
        for row in &mut rows {
            row.error = row.error.map(|error| times * error);
            row.pass = row.of_gate().map(|of_gate| of_gate <= 1.0);
        }
        let failing = rows.iter().filter(|row| unexplained(row, false).is_some());
        failing.map(|row| format!("{} {}", row.scene, row.label())).collect()
    }

    #[test]
    fn errors_of_the_page_are_known_and_twice_as_large_ones_are_not() {
        assert_eq!(unexplained_if(1.0), [""; 0]);
        let twice = unexplained_if(2.0);
        for known in KNOWN.iter().filter(|known| !known.small) {
            let name = format!("{} {}", known.scene, known.setting);
            assert!(twice.contains(&name), "{name} is not in {twice:?}");
        }
    }

    #[test]
    fn lost_bodies_are_not_excused() {
        let rows = read_csv::<Row>(&committed().join("scale.csv")).unwrap();
        let row = rows.iter().map(|row| &row.row).find(|row| row.label() == "owner 2").unwrap();
        assert!(cause(row, false).is_some());
        let lost = Row { unit: Some(BROKEN.to_owned()), ..row.clone() };
        assert!(unexplained(&lost, false).is_some());
    }

    #[test]
    fn what_is_known_is_of_a_scene_and_a_setting() {
        for known in &KNOWN {
            assert!(Case::named(known.scene).is_ok(), "{}", known.scene);
            assert!(SETTINGS.iter().any(|setting| setting.label() == known.setting), "{}", known.setting);
        }
    }
}
