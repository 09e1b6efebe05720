//! Draws step time over the number of bodies, and writes the table of the page.

use crate::draw::{BLACK_LINE, COLOURS, Line, LinePanel, LinePanels, Mark};
use crate::page::table as markdown;
use crate::results::{Measured, short};

use super::Row;

/// One panel a scene.
pub(super) fn picture(rows: &[Measured<Row>]) -> LinePanels {
    let mut scenes: Vec<_> = rows.iter().map(|row| row.row.scene.clone()).collect();
    scenes.dedup();
    let panels = scenes.into_iter().map(|scene| panel(rows, scene)).collect();
    let machine = rows.last().map_or(String::new(), |row| row.machine.caption());
    LinePanels {
        title: "Step time by number of bodies".to_owned(),
        caption: format!("Median of the fastest of several interleaved runs; lower is faster.\n{machine}"),
        x_label: "bodies".to_owned(),
        y_reversed: false,
        columns: 3,
        panels,
    }
}

fn panel(rows: &[Measured<Row>], scene: String) -> LinePanel {
    let of_scene = || rows.iter().map(|row| &row.row).filter(|row| row.scene == scene);
    let mut kinds: Vec<_> = of_scene().map(kind).collect();
    kinds.sort();
    kinds.dedup();
    let lines = kinds.into_iter().map(|kind| {
        let mut points: Vec<_> = of_scene()
            .filter(|row| self::kind(row) == kind)
            .map(|row| (row.bodies as f64, row.p50_ms, String::new()))
            .collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        line(kind, points)
    });
    LinePanel { lines: lines.collect(), title: scene.clone(), y_label: "ms a step".to_owned(), limit: None }
}

/// Parallel solver or not, and how many regions.
type Kind = (bool, usize);

fn kind(row: &Row) -> Kind {
    (row.solver == "parallel", row.regions)
}

fn line((parallel, regions): Kind, points: Vec<(f64, f64, String)>) -> Line {
    let name = match (parallel, regions) {
        (false, 0) => "bare Rapier".to_owned(),
        (true, 0) => "Rapier's parallel".to_owned(),
        (false, 1) => "1 region".to_owned(),
        (true, 1) => "1 region, parallel inside".to_owned(),
        (false, n) => format!("{n} regions"),
        (true, n) => format!("{n} regions, parallel inside"),
    };
    let colour = match regions {
        0 => BLACK_LINE,
        n => COLOURS[n.ilog2() as usize % COLOURS.len()],
    };
    let mark = match (parallel, regions) {
        (false, 0) => Mark::Dot,
        (true, _) => Mark::Ring,
        (false, _) => Mark::Square,
    };
    Line { name, colour, thick: regions == 0 || regions == 2, mark, points }
}

/// The figures of the promises: one and two regions, the best number of regions, both references.
pub(super) fn table(rows: &[Measured<Row>]) -> String {
    let rows = || rows.iter().map(|row| &row.row);
    let mut cases: Vec<_> = rows().map(|row| (row.scene.clone(), row.bodies)).collect();
    cases.dedup();
    let cell = |row: Option<&Row>| match row {
        Some(row) => format!("{} ({:.2}×)", short(row.p50_ms), row.over_bare),
        None => "–".to_owned(),
    };
    let lines = cases.into_iter().map(|(scene, bodies)| {
        let of = |kind: Kind| {
            rows().find(|row| (&row.scene, row.bodies) == (&scene, bodies) && self::kind(row) == kind)
        };
        let most = rows()
            .filter(|row| {
                (&row.scene, row.bodies) == (&scene, bodies) && row.regions > 2 && row.solver == "serial"
            })
            .min_by(|a, b| a.p50_ms.total_cmp(&b.p50_ms));
        let (two, p99) = (of((false, 2)), of((false, 2)).map_or("–".to_owned(), |row| short(row.p99_ms)));
        let over =
            two.and_then(|row| row.over_parallel).map_or("–".to_owned(), |over| format!("{over:.2}×"));
        vec![
            scene.clone(),
            bodies.to_string(),
            of((false, 0)).map_or("–".to_owned(), |row| short(row.p50_ms)),
            cell(of((true, 0))),
            cell(of((false, 1))),
            cell(two),
            p99,
            over,
            most.map_or("–".to_owned(), |row| format!("{}: {}", row.regions, cell(Some(row)))),
            cell(of((true, 1))),
        ]
    });
    let head = [
        "scene",
        "bodies",
        "bare, p50 ms",
        "Rapier's parallel",
        "1 region",
        "2 regions",
        "2 regions, p99 ms",
        "2 regions over parallel",
        "best of 4 to 64 regions",
        "1 region, parallel inside",
    ];
    markdown(&head, lines)
}
