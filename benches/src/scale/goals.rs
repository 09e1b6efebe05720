//! Lists the goals of time and error, and says by the rows of the file which of them are reached.

use super::case::CASES;
use super::instructions::HELD;
use super::row::Row;
use crate::page;
use crate::results::{Measured, short};

/// A bound of one figure in several scenes.
struct Goal {
    /// The figure, as the page names it.
    figure: &'static str,
    bound: Bound,
    /// The scenes that the goal is for; empty for all that have the figure.
    scenes: &'static [&'static str],
    /// Returns the figure of a scene, where it was measured.
    read: fn(&Scene<'_>) -> Option<f64>,
}

#[derive(Clone, Copy)]
enum Bound {
    Most(f64),
    Least(f64),
}

use Bound::*;

const GOALS: [Goal; 10] = [
    Goal { figure: "time of what dcd chooses, over bare", bound: Most(1.05), scenes: &[], read: chosen },
    Goal {
        figure: "time of one region on one thread, over bare",
        bound: Most(1.05),
        scenes: &[],
        read: |scene| scene.of("auto 1")?.over_bare,
    },
    Goal {
        figure: "speed of what dcd chooses, over bare",
        bound: Least(1.7),
        scenes: &["pile", "dve"],
        read: speed_up,
    },
    Goal {
        figure: "speed of what dcd chooses, over bare",
        bound: Least(1.6),
        scenes: &["gas", "pour", "pyramid"],
        read: speed_up,
    },
    Goal {
        figure: "speed of what dcd chooses, over bare",
        bound: Least(1.5),
        scenes: &["wall"],
        read: speed_up,
    },
    Goal {
        figure: "time of eight regions, over two",
        bound: Most(1.15),
        scenes: &[],
        read: |scene| Some(scene.of("auto 8")?.ms_p50? / scene.of("auto 2")?.ms_p50?),
    },
    Goal {
        figure: "time of one island cut in two (`overlap`), over bare",
        bound: Most(0.65),
        scenes: ISLANDS,
        read: |scene| scene.of("overlap 2")?.over_bare,
    },
    Goal {
        figure: "error of one island cut in two (`overlap`), mm",
        bound: Most(20.0),
        scenes: ISLANDS,
        read: |scene| {
            let row = scene.of("overlap 2")?;
            row.unit.as_ref()?.starts_with("m, ").then_some(1e3 * row.error?)
        },
    },
    Goal {
        figure: "instructions of two regions, over bare (small scenes, development build; the most that CI lets pass)",
        bound: Most(1.15),
        scenes: &["rubble", "pour", "pyramid", "wall"],
        read: held_instructions,
    },
    Goal {
        figure: "instructions of two regions, over bare (the same)",
        bound: Most(1.25),
        scenes: &["dve", "gas"],
        read: held_instructions,
    },
];

/// The scenes that are one large island.
const ISLANDS: &[&str] = &["pyramid", "wall"];

fn chosen(scene: &Scene<'_>) -> Option<f64> {
    scene.of("default")?.over_bare
}

fn speed_up(scene: &Scene<'_>) -> Option<f64> {
    Some(1.0 / chosen(scene)?)
}

fn held_instructions(scene: &Scene<'_>) -> Option<f64> {
    HELD.into_iter().find(|(name, _)| *name == scene.name).map(|(_, held)| held)
}

/// The rows of one scene.
struct Scene<'a> {
    name: &'static str,
    rows: Vec<&'a Row>,
}

impl<'a> Scene<'a> {
    /// Returns all scenes, those without a row as well.
    fn all(rows: &'a [Measured<Row>]) -> impl Iterator<Item = Self> {
        CASES.iter().map(|case| Self {
            name: case.name,
            rows: rows.iter().map(|row| &row.row).filter(|row| row.scene == case.name).collect(),
        })
    }

    fn of(&self, label: &str) -> Option<&'a Row> {
        self.rows.iter().copied().find(|row| row.label() == label)
    }
}

impl Bound {
    fn holds(self, value: f64) -> bool {
        match self {
            Most(most) => value <= most,
            Least(least) => value >= least,
        }
    }

    fn words(self) -> String {
        match self {
            Most(most) => format!("at most {most}"),
            Least(least) => format!("at least {least}"),
        }
    }
}

impl Goal {
    /// Returns the scenes in which the goal is reached, or in which it is missed, each with its figure.
    fn figures(&self, rows: &[Measured<Row>], reached: bool) -> Vec<(&'static str, f64)> {
        Scene::all(rows)
            .filter(|scene| self.scenes.is_empty() || self.scenes.contains(&scene.name))
            .filter_map(|scene| Some((scene.name, (self.read)(&scene)?)))
            .filter(|(_, value)| self.bound.holds(*value) == reached)
            .collect()
    }
}

/// Returns the table of goals, and the names of the scenes that were not measured.
pub(super) fn table(rows: &[Measured<Row>]) -> String {
    let told = |figures: Vec<(&str, f64)>| {
        let told: Vec<_> =
            figures.into_iter().map(|(name, value)| format!("{name} {}", short(value))).collect();
        if told.is_empty() { "–".to_owned() } else { told.join(", ") }
    };
    let lines = GOALS.iter().map(|goal| {
        let [reached, missed] = [true, false].map(|reached| told(goal.figures(rows, reached)));
        vec![goal.figure.to_owned(), goal.bound.words(), reached, missed]
    });
    let goals = page::table(&["goal", "bound", "reached", "missed"], lines);
    let without: Vec<_> =
        Scene::all(rows).filter(|scene| scene.rows.is_empty()).map(|scene| scene.name).collect();
    if without.is_empty() {
        return goals;
    }
    format!("{goals}\nScenes of the suite that have no row in full size: {}.\n", without.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::{committed, read_csv};

    fn measured() -> Vec<Measured<Row>> {
        read_csv::<Row>(&committed().join("scale.csv")).unwrap()
    }

    #[test]
    fn the_page_says_which_goals_the_rows_of_the_file_reach() {
        let page = std::fs::read_to_string(committed().join("README.md")).unwrap();
        let table = table(&measured());
        assert!(page.contains(&table), "`scale --draw` writes the page anew; it lacks\n{table}");
    }

    #[test]
    fn a_goal_is_missed_by_a_row_that_is_beyond_its_bound_and_only_by_that() {
        let missed = |rows: &[Measured<Row>]| -> Vec<_> {
            let of = |goal: &Goal| goal.figures(rows, false).into_iter().map(|(scene, _)| scene);
            GOALS.iter().map(|goal| of(goal).filter(|scene| *scene == "pour").count()).collect()
        };
        let mut rows = measured();
        assert_eq!(
            missed(&rows),
            [0, 0, 0, 0, 0, 0, 0, 0, 1, 0],
            "CI holds instructions of development builds"
        );
        for row in rows.iter_mut().filter(|row| row.row.scene == "pour") {
            let label = row.row.label();
            let slower = |value: &mut Option<f64>| *value = value.map(|value| 2.3 * value);
            if ["default", "auto 8"].contains(&&*label) {
                slower(&mut row.row.over_bare);
                slower(&mut row.row.ms_p50);
            }
        }
        assert_eq!(missed(&rows), [1, 0, 0, 1, 0, 1, 0, 0, 1, 0]);
    }
}
