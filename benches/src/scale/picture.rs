//! Draws speed against error of all settings, and writes the small matrix of the page.

use crate::draw::{BLACK_LINE, COLOURS, Line, LinePanel, LinePanels, Mark};
use crate::page::table as markdown;
use crate::results::{Measured, short};

use super::Row;

/// One panel a scene: fast to the right, small errors at the top.
pub(super) fn picture(rows: &[Measured<Row>]) -> LinePanels {
    let machine = rows.last().map_or(String::new(), |row| row.machine.caption());
    LinePanels {
        title: "Speed and error at scale".to_owned(),
        caption: format!(
            "Best is top right; above the dashed line an error is within the spread of one world's own runs.\n{machine}"
        ),
        x_label: "times as fast as one bare world".to_owned(),
        y_reversed: true,
        columns: 3,
        panels: scenes(rows).into_iter().map(|scene| panel(rows, scene)).collect(),
    }
}

/// In the order of the file.
fn scenes(rows: &[Measured<Row>]) -> Vec<(&str, usize)> {
    let mut scenes: Vec<_> = rows.iter().map(|row| (&*row.row.scene, row.row.bodies)).collect();
    scenes.dedup();
    scenes
}

fn of_scene<'a>(rows: &'a [Measured<Row>], scene: (&str, usize)) -> Vec<&'a Row> {
    rows.iter().map(|row| &row.row).filter(|row| (&*row.scene, row.bodies) == scene).collect()
}

fn panel(rows: &[Measured<Row>], scene: (&str, usize)) -> LinePanel {
    let rows = of_scene(rows, scene);
    let mut names: Vec<&str> = rows.iter().map(|row| &*row.setting).collect();
    names.dedup();
    // Auto last, over the others.
    names.sort_by_key(|name| *name == "auto");
    let lines = names.into_iter().map(|name| {
        let of_name = rows.iter().filter(|row| row.setting == name);
        let label = |row: &Row| if name == "auto" { row.regions.to_string() } else { String::new() };
        let points = of_name.map(|row| (1.0 / row.over_bare, drawn(row), label(row))).collect();
        let (colour, mark) = style(name);
        Line { name: entry(name), colour, thick: name == "auto", mark, points }
    });
    LinePanel {
        title: format!("{}, {} bodies", scene.0, scene.1),
        y_label: "error over gate".to_owned(),
        lines: lines.collect(),
        limit: Some(1.0),
    }
}

/// What broke is drawn at the lower edge, what is lost in noise at the upper.
fn drawn(row: &Row) -> f64 {
    (row.error / row.gate).clamp(0.01, 1_000.0)
}

fn entry(name: &str) -> String {
    match name {
        "bare" => "one bare Rapier world".to_owned(),
        "default" => "what dcd chooses".to_owned(),
        "auto" => "auto, 1 to 16 regions".to_owned(),
        _ => format!("{name}, 2 regions, 1 exchange"),
    }
}

fn style(name: &str) -> (plotters::style::RGBColor, Mark) {
    match name {
        "bare" => (COLOURS[6], Mark::Cross),
        "default" => (COLOURS[2], Mark::Square),
        "owner" => (COLOURS[1], Mark::Triangle),
        "overlap" => (COLOURS[0], Mark::Triangle),
        _ => (BLACK_LINE, Mark::Dot),
    }
}

/// Scenes by settings: time over that of one bare world, and the error in gates where it does not pass.
pub(super) fn table(rows: &[Measured<Row>]) -> String {
    let column = |row: &Row| match &*row.setting {
        "auto" => format!("auto {}", row.regions),
        "owner" | "overlap" => format!("{} 2", row.setting),
        name => name.to_owned(),
    };
    let mut columns: Vec<String> = Vec::new();
    for row in rows {
        let column = column(&row.row);
        if !columns.contains(&column) {
            columns.push(column);
        }
    }
    let head: Vec<&str> = ["scene", "bodies"].into_iter().chain(columns.iter().map(String::as_str)).collect();
    let lines = scenes(rows).into_iter().map(|scene| {
        let of_scene = of_scene(rows, scene);
        let cell = |wanted: &String| match of_scene.iter().find(|row| column(row) == *wanted) {
            None => "–".to_owned(),
            Some(row) if row.pass => format!("{:.2}×", row.over_bare),
            Some(row) => format!("{:.2}×, **{}**", row.over_bare, short(row.error / row.gate)),
        };
        [scene.0.to_owned(), scene.1.to_string()].into_iter().chain(columns.iter().map(cell)).collect()
    });
    markdown(&head, lines)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::Machine;

    fn row(setting: &str, regions: usize, over_bare: f64, error: f64) -> Measured<Row> {
        let machine = Machine { cpu: "c".into(), cores: 2, date: "2026-11-21".into(), commit: "a".into() };
        let row = Row {
            scene: "net".into(),
            bodies: 2_500,
            setting: setting.into(),
            regions,
            threads: 2,
            ms_p50: 1.0,
            over_bare,
            instructions_over_bare: None,
            error,
            r1_spread: 0.5,
            unit: "m, mean height".into(),
            gate: 1.0,
            pass: error <= 1.0,
        };
        Measured { row, machine }
    }

    #[test]
    fn the_matrix_has_a_row_a_scene_and_the_error_of_what_does_not_pass() {
        let rows = [row("bare", 0, 1.0, 0.0), row("auto", 2, 0.65, 0.2), row("owner", 2, 0.52, 32.0)];
        let table = table(&rows);
        assert!(table.contains("| scene | bodies | bare | auto 2 | owner 2 |"), "{table}");
        assert!(table.contains("| net | 2500 | 1.00× | 0.65× | 0.52×, **32.0** |"), "{table}");
    }

    #[test]
    fn the_picture_joins_the_numbers_of_regions_and_shows_what_broke() {
        let rows = [row("owner", 2, 0.5, 1e9), row("auto", 1, 1.0, 0.0), row("auto", 2, 0.8, 0.2)];
        let panels = picture(&rows).panels;
        let lines = &panels[0].lines;
        assert_eq!(lines.len(), 2);
        assert_eq!(lines[0].points, [(2.0, 1_000.0, String::new())]);
        assert_eq!(lines[1].points, [(1.0, 0.01, "1".into()), (1.25, 0.2, "2".into())]);
    }
}
