//! Finds the settings on the Pareto front of a scene: those that no other setting beats in time and error.

use super::row::Row;

/// The factor by which times differ from run to run on a quiet machine.
const NOISE: f64 = 1.1;

/// A setting of which both time and error are measured.
#[derive(Clone, Copy)]
pub(super) struct Point<'a> {
    pub(super) row: &'a Row,
    pub(super) over_bare: f64,
    pub(super) of_gate: f64,
}

impl<'a> Point<'a> {
    pub(super) fn of(row: &'a Row) -> Option<Self> {
        Some(Self { row, over_bare: row.over_bare?, of_gate: row.of_gate()? })
    }

    /// Returns the error in gates, but 1 for what passes: all that passes is equally right, since the gate is
    /// what one world's own runs differ by.
    fn wrong_by(&self) -> f64 {
        self.of_gate.max(1.0)
    }

    /// Returns whether it is better in time or error beyond noise, and not worse in the other.
    fn beats(&self, other: &Self) -> bool {
        let faster = NOISE * self.over_bare < other.over_bare;
        let righter = NOISE * self.wrong_by() < other.wrong_by();
        (faster && self.wrong_by() <= other.wrong_by()) || (righter && self.over_bare <= other.over_bare)
    }
}

/// Returns the points that none beats, the fastest first.
pub(super) fn front<'a>(points: &[Point<'a>]) -> Vec<Point<'a>> {
    let is_beaten = |point: &&Point<'a>| points.iter().any(|other| other.beats(point));
    let mut front: Vec<_> = points.iter().filter(|point| !is_beaten(point)).copied().collect();
    front.sort_by(|a, b| a.over_bare.total_cmp(&b.over_bare));
    front
}

/// Returns the fastest of the points that beat this one, if any does.
pub(super) fn better<'a>(point: &Point<'_>, points: &[Point<'a>]) -> Option<Point<'a>> {
    let better = points.iter().filter(|other| other.beats(point));
    better.min_by(|a, b| a.over_bare.total_cmp(&b.over_bare)).copied()
}

#[cfg(test)]
mod tests {
    use dcd::physics::Coupling;

    use super::super::row::tests::row;
    use super::super::setting::Setting::{self, *};
    use super::*;

    fn on_the_front(rows: &[(Setting, f64, f64)]) -> Vec<String> {
        let rows: Vec<_> = rows.iter().map(|&(setting, time, error)| row(setting, time, error)).collect();
        let points: Vec<_> = rows.iter().filter_map(Point::of).collect();
        front(&points).into_iter().map(|point| point.row.label()).collect()
    }

    #[test]
    fn what_is_slower_beyond_noise_and_no_more_right_is_beaten() {
        let owner = Fixed(Coupling::Owner);
        assert_eq!(
            on_the_front(&[(Bare, 1.0, 0.0), (Default, 0.6, 0.9)]),
            ["default"],
            "what passes is equally right"
        );
        assert_eq!(
            on_the_front(&[(Default, 0.6, 0.5), (owner, 0.57, 0.5)]),
            ["owner 2", "default"],
            "within noise"
        );
        assert_eq!(on_the_front(&[(Default, 0.6, 0.5), (owner, 0.5, 0.5)]), ["owner 2"]);
        assert_eq!(
            on_the_front(&[(Default, 0.6, 0.5), (owner, 0.5, 3.0)]),
            ["owner 2", "default"],
            "fast or right"
        );
        assert_eq!(
            on_the_front(&[(Default, 0.6, 2.0), (owner, 0.6, 3.0)]),
            ["default"],
            "as fast and less right"
        );
    }

    #[test]
    fn the_fastest_of_those_that_are_better_is_named() {
        let rows = [row(Default, 1.0, 0.5), row(Auto(2), 0.8, 0.5), row(Auto(4), 0.7, 0.5)];
        let points: Vec<_> = rows.iter().filter_map(Point::of).collect();
        assert_eq!(better(&points[0], &points).unwrap().row.label(), "auto 4");
        assert!(better(&points[2], &points).is_none());
    }

    #[test]
    fn what_is_half_measured_is_no_point() {
        let mut half = row(Default, 0.5, 0.5);
        half.error = None;
        assert!(Point::of(&half).is_none());
    }
}
