//! Draws error against time of all settings, and writes the matrix of the page.

use std::collections::BTreeMap;

use super::front::{self, Point};
use super::goals;
use super::row::Row;
use crate::draw::{BLACK_LINE, COLOURS, Line, LinePanel, LinePanels, Mark};
use crate::machine::Machine;
use crate::page;
use crate::results::{Measured, short};

/// Draws one panel per scene: fast to the left, small errors at the bottom.
pub(super) fn picture(rows: &[Measured<Row>]) -> LinePanels {
    let machine = rows.last().map_or(String::new(), |row| row.machine.caption());
    LinePanels {
        title: "Time and error at scale".to_owned(),
        caption: format!(
            "Best is bottom left; below the dashed line an error is within the spread of one world's own runs. Ringed: on the front, no other setting is better.\n{machine}"
        ),
        x_label: "time over that of one bare world".to_owned(),
        columns: 3,
        panels: scenes(rows).into_iter().map(|scene| panel(&of_scene(rows, scene), scene)).collect(),
    }
}

/// Returns the scenes in the order of the file.
fn scenes(rows: &[Measured<Row>]) -> Vec<(&str, usize)> {
    let mut scenes: Vec<_> = rows.iter().map(|row| (&*row.row.scene, row.row.bodies)).collect();
    scenes.dedup();
    scenes
}

fn of_scene<'a>(rows: &'a [Measured<Row>], scene: (&str, usize)) -> Vec<&'a Row> {
    rows.iter().map(|row| &row.row).filter(|row| (&*row.scene, row.bodies) == scene).collect()
}

fn points<'a>(rows: &[&'a Row]) -> Vec<Point<'a>> {
    rows.iter().filter_map(|row| Point::of(row)).collect()
}

fn panel(rows: &[&Row], (scene, bodies): (&str, usize)) -> LinePanel {
    let points = points(rows);
    let place = |point: &Point<'_>, label: String| (point.over_bare, drawn(point.of_gate), label);
    // Drawn below all others.
    let front = front::front(&points);
    let mut lines = vec![Line {
        name: "on the front".to_owned(),
        colour: COLOURS[4],
        thick: false,
        mark: Mark::Halo,
        points: front.iter().map(|point| place(point, String::new())).collect(),
    }];
    let mut names: Vec<&str> = points.iter().map(|point| &*point.row.setting).collect();
    names.dedup();
    // Auto is drawn last, over the others.
    names.sort_by_key(|name| *name == "auto");
    lines.extend(names.into_iter().map(|name| {
        let label = |row: &Row| if name == "auto" { row.regions.to_string() } else { String::new() };
        let of_name = points.iter().filter(|point| point.row.setting == name);
        let (colour, mark) = style(name);
        Line {
            name: entry(name),
            colour,
            thick: name == "auto",
            mark,
            points: of_name.map(|point| place(point, label(point.row))).collect(),
        }
    }));
    LinePanel {
        title: format!("{scene}, {bodies} bodies"),
        x_label: None,
        y_label: "error over gate".to_owned(),
        lines,
        limit: Some(1.0),
    }
}

/// Returns an error as it is drawn: what broke at the upper edge, what is lost in noise at the lower.
fn drawn(of_gate: f64) -> f64 {
    of_gate.clamp(0.01, 1_000.0)
}

fn entry(name: &str) -> String {
    match name {
        "bare" => "one bare Rapier world".to_owned(),
        "parallel" => "Rapier's own parallel".to_owned(),
        "default" => "what dcd chooses".to_owned(),
        "auto" => "auto, 1 to 16 regions".to_owned(),
        _ => format!("{name}, 2 regions, 1 exchange"),
    }
}

fn style(name: &str) -> (plotters::style::RGBColor, Mark) {
    match name {
        "bare" => (COLOURS[6], Mark::Cross),
        "parallel" => (COLOURS[3], Mark::Cross),
        "default" => (COLOURS[2], Mark::Square),
        "owner" => (COLOURS[1], Mark::Triangle),
        "overlap" => (COLOURS[0], Mark::Triangle),
        _ => (BLACK_LINE, Mark::Dot),
    }
}

/// Returns the matrix of scenes by settings: time over that of one bare world, and the error in gates where
/// it does not pass. Below it stands what lies on the front, which goals are reached, and when errors were
/// measured.
pub(super) fn table(rows: &[Measured<Row>]) -> String {
    let mut columns: Vec<String> = Vec::new();
    for label in rows.iter().map(|row| row.row.label()).filter(|label| label != "bare") {
        if !columns.contains(&label) {
            columns.push(label);
        }
    }
    let head = ["scene", "bodies", "bare, ms"].into_iter().chain(columns.iter().map(String::as_str));
    let head: Vec<&str> = head.chain(["on the front"]).collect();
    let lines = scenes(rows).into_iter().map(|scene| {
        let of_scene = of_scene(rows, scene);
        let of = |label: &str| of_scene.iter().find(|row| row.label() == label);
        let bare_ms = of("bare").and_then(|row| row.ms_p50);
        let front = front::front(&points(&of_scene));
        let front: Vec<_> = front.iter().map(|point| point.row.label()).collect();
        let named = [scene.0.to_owned(), scene.1.to_string(), bare_ms.map_or("–".to_owned(), short)];
        named
            .into_iter()
            .chain(columns.iter().map(|column| of(column).map_or("–".to_owned(), |row| cell(row))))
            .chain([front.join(", ")])
            .collect()
    });
    let errors = page::measured("Errors", error_machines(rows).iter());
    format!("{}\n{}\n\n{}\n{errors}", page::table(&head, lines), verdict(rows), goals::table(rows))
}

fn cell(row: &Row) -> String {
    let time = row.over_bare.map_or("–".to_owned(), |over_bare| format!("{over_bare:.2}×"));
    match (row.pass, row.of_gate()) {
        (Some(false), Some(of_gate)) => format!("{time}, **{}**", short(of_gate)),
        (Some(_), _) => time,
        _ => format!("{time}, ?"),
    }
}

/// Returns in how many scenes what dcd itself chooses lies on the front, and what is better where it does
/// not.
fn verdict(rows: &[Measured<Row>]) -> String {
    let (mut all, mut beaten) = (0, BTreeMap::new());
    for scene in scenes(rows) {
        let of_scene = of_scene(rows, scene);
        let points = points(&of_scene);
        let Some(own) = points.iter().find(|point| point.row.setting == "default") else { continue };
        all += 1;
        if let Some(better) = front::better(own, &points) {
            let text = format!(
                "{}: {} takes {} of its time, with {} of its error",
                scene.0,
                better.row.label(),
                short(better.over_bare / own.over_bare),
                short(better.of_gate / own.of_gate)
            );
            beaten.insert(scene.0, text);
        }
    }
    let better = beaten.values().cloned().collect::<Vec<_>>().join("; ");
    let stop = if better.is_empty() { ".".to_owned() } else { format!(". Not in {better}.") };
    format!("`default` is on the front in {} of {all} scenes{stop}", all - beaten.len())
}

/// Returns the machines of the errors, which have days and commits of their own.
fn error_machines(rows: &[Measured<Row>]) -> Vec<Machine> {
    let machine = |Measured { row, machine }: &Measured<Row>| {
        let (date, commit) = (row.error_date.clone()?, row.error_commit.clone()?);
        Some(Machine { date, commit, ..machine.clone() })
    };
    rows.iter().filter_map(machine).collect()
}

#[cfg(test)]
mod tests {
    use dcd::physics::Coupling;

    use super::super::row::tests::{machine, row};
    use super::super::setting::Setting::{self, *};
    use super::*;

    fn rows(of: &[(Setting, f64, f64)]) -> Vec<Measured<Row>> {
        let measured = |&(setting, over_bare, error)| Measured {
            row: row(setting, over_bare, error),
            machine: machine(),
        };
        of.iter().map(measured).collect()
    }

    const OWNER: Setting = Fixed(Coupling::Owner);

    #[test]
    fn the_matrix_has_a_row_a_scene_with_the_error_of_what_does_not_pass_and_the_front() {
        let rows = rows(&[(Bare, 1.0, 0.0), (Default, 0.55, 0.1), (Auto(2), 0.65, 0.2), (OWNER, 0.4, 32.0)]);
        let table = table(&rows);
        assert!(
            table.contains("| scene | bodies | bare, ms | default | auto 2 | owner 2 | on the front |"),
            "{table}"
        );
        let line = "| net | 2000 | 1.00 | 0.55× | 0.65× | 0.40×, **32.0** | owner 2, default |";
        assert!(table.contains(line), "{table}");
        assert!(table.contains("`default` is on the front in 1 of 1 scenes.\n"), "{table}");
        assert!(table.ends_with("Errors measured on 2026-11-21 at a (c, 2 cores)."), "{table}");
    }

    #[test]
    fn what_is_better_than_the_default_is_named() {
        let text = verdict(&rows(&[(Default, 1.0, 0.5), (OWNER, 0.5, 0.25)]));
        assert_eq!(
            text,
            "`default` is on the front in 0 of 1 scenes. Not in net: owner 2 takes 0.500 of its time, with 0.500 of its error."
        );
    }

    #[test]
    fn an_error_that_is_not_measured_is_told_from_one_that_passes() {
        let mut rows = rows(&[(Bare, 1.0, 0.0), (Default, 0.5, 0.1)]);
        (rows[1].row.error, rows[1].row.pass) = (None, None);
        assert!(table(&rows).contains("| 0.50×, ? |"));
    }

    #[test]
    fn the_picture_joins_the_numbers_of_regions_rings_the_front_and_shows_what_broke() {
        let rows = rows(&[(OWNER, 0.5, 1e9), (Auto(1), 1.0, 0.0), (Auto(2), 0.8, 0.2)]);
        let panels = picture(&rows).panels;
        let lines = &panels[0].lines;
        assert_eq!(lines.len(), 3);
        assert_eq!(lines[0].points, [(0.5, 1_000.0, String::new()), (0.8, 0.2, String::new())]);
        assert_eq!(lines[1].points, [(0.5, 1_000.0, String::new())]);
        assert_eq!(lines[2].points, [(1.0, 0.01, "1".into()), (0.8, 0.2, "2".into())]);
    }
}
