//! Maps the error where exchanges come late or not at all: by how late, by how many, and in which direction.

use dcd::runtime::{WorldConfig, WorldError};

use super::{Cell, Grid, Kind};
use crate::accuracy::{Case, Fault, Reference, Setup, Size, experiments, read, use_method};

pub(super) const KIND: Kind = Kind {
    name: "network",
    title: "Exchanges late and lost",
    caption: "Tower of ten boxes, the top one ten times as heavy, cut across a middle box: largest distance of any box from where it\n\
              started, after 10 s, m. Row of five elastic balls, struck at 1 m/s: largest error of a velocity, m/s. A host a region.",
    x_label: "exchanges lost, %",
    y_label: "late by exchanges",
    scale_label: "tower: metres; balls: metres per second",
    scale: (0.003, 1.0),
    grid,
    cell,
};

const TOWER: &str = "tower, lost exchanges skipped by all";
const TOWER_ONE_WAY: &str = "tower, lost in one direction only";
const BALLS: &str = "row of balls, lost exchanges skipped by all";
const BALLS_ONE_WAY: &str = "row of balls, lost in one direction only";

fn grid(quick: bool) -> Grid {
    let (x, y): (&[f64], &[f64]) = if quick {
        (&[0.0, 10.0], &[0.0, 1.0])
    } else {
        (&[0.0, 1.0, 5.0, 10.0, 25.0, 50.0], &[0.0, 1.0, 2.0, 4.0])
    };
    Grid { panels: vec![TOWER, TOWER_ONE_WAY, BALLS, BALLS_ONE_WAY], x: x.to_vec(), y: y.to_vec() }
}

fn cell(cell: &Cell, _quick: bool) -> Result<f64, WorldError> {
    let mut case = match cell.panel {
        TOWER | TOWER_ONE_WAY => case("tower", "10:1 centre"),
        _ => case("cradle", "1 m/s"),
    };
    let reference = Reference::of(&case)?;
    let Some(method) = cell.method else {
        return Ok(reference.r1.error);
    };
    case.fault = Some(Fault {
        late: cell.y as usize,
        lost_one_in: if cell.x > 0.0 { (100.0 / cell.x).round() as u64 } else { 0 },
        one_way: [TOWER_ONE_WAY, BALLS_ONE_WAY].contains(&cell.panel),
    });
    let adjust = |config: &mut WorldConfig| use_method(config, method);
    Ok(read(&case, &Setup::Cut { regions: 2, adjust: &adjust }, &reference)?.error)
}

/// Returns a case of the suite, in its short form.
fn case(name: &str, label: &str) -> Case {
    let experiment = experiments().into_iter().find(|experiment| experiment.name == name);
    let cases = (experiment.expect("the suite has it").cases)(Size::Quick);
    cases.into_iter().find(|case| case.label.starts_with(label)).expect("the suite has it")
}

#[cfg(test)]
mod tests {
    use dcd::physics::Coupling;

    use super::*;

    #[test]
    fn a_tower_whose_exchanges_all_arrive_stands_and_one_cut_off_from_its_other_half_does_not() {
        let at = |x| cell(&Cell { panel: TOWER, method: Some(Coupling::Overlap), x, y: 0.0 }, false).unwrap();
        assert!(at(0.0) < 0.15, "{}", at(0.0));
        assert!(at(100.0) > at(0.0) + 0.05, "{} {}", at(100.0), at(0.0));
    }
}
