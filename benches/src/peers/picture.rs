//! Draws time against penetration of all engines, and writes the table of the page.

use crate::draw::{BLACK_LINE, COLOURS, Line, LinePanel, LinePanels, Mark};
use crate::page::table as markdown;
use crate::results::{Measured, short};

use super::Row;

/// Draws one panel per scene: fast to the left, shallow at the bottom.
pub(super) fn picture(rows: &[Measured<Row>]) -> LinePanels {
    let machine = rows.last().map_or(String::new(), |row| row.machine.caption());
    LinePanels {
        title: "The same boxes in other engines".to_owned(),
        caption: format!("Best is bottom left: a short step after which little overlaps.\n{machine}"),
        x_label: "step, p50 ms".to_owned(),
        columns: 2,
        panels: scenes(rows).into_iter().map(|scene| panel(rows, scene)).collect(),
    }
}

/// Returns the scenes in the order of the file.
fn scenes(rows: &[Measured<Row>]) -> Vec<&str> {
    let mut scenes: Vec<_> = rows.iter().map(|row| &*row.row.scene).collect();
    scenes.dedup();
    scenes
}

fn panel(rows: &[Measured<Row>], scene: &str) -> LinePanel {
    let of_scene: Vec<&Row> = rows.iter().map(|row| &row.row).filter(|row| row.scene == scene).collect();
    let lines = of_scene.iter().map(|row| {
        let (colour, mark) = style(&row.engine);
        let points = vec![(row.ms_p50, 1e3 * row.mean_depth_m, String::new())];
        Line { name: row.engine.clone(), colour, thick: false, mark, points }
    });
    LinePanel {
        title: format!("{scene}, {} bodies", of_scene.first().map_or(0, |row| row.bodies)),
        x_label: None,
        y_label: "mean penetration, mm".to_owned(),
        lines: lines.collect(),
        limit: None,
    }
}

fn style(engine: &str) -> (plotters::style::RGBColor, Mark) {
    match engine {
        "rapier" => (COLOURS[6], Mark::Cross),
        "rapier parallel" => (COLOURS[6], Mark::Dot),
        "box3d" => (COLOURS[0], Mark::Square),
        "jolt" => (COLOURS[1], Mark::Triangle),
        "dcd" => (BLACK_LINE, Mark::Dot),
        _ => (BLACK_LINE, Mark::Ring),
    }
}

/// Returns the table, with a row per engine; the number of lost bodies is bold.
pub(super) fn table(rows: &[Measured<Row>]) -> String {
    let head = [
        "scene",
        "bodies",
        "engine",
        "threads",
        "step, p50 ms",
        "over bare",
        "penetration, mm",
        "deepest, mm",
        "energy over start",
        "mean height, m",
        "fell by, m",
        "lost",
    ];
    let mm = |m: f64| short(1e3 * m);
    let line = |Measured { row, .. }: &Measured<Row>| {
        vec![
            row.scene.clone(),
            row.bodies.to_string(),
            if row.engine == "dcd" { format!("dcd, chose {}", row.regions) } else { row.engine.clone() },
            row.threads.to_string(),
            short(row.ms_p50),
            format!("{:.2}×", row.over_bare),
            mm(row.mean_depth_m),
            mm(row.deepest_m),
            format!("{:.3}", row.energy_j / row.start_energy_j),
            format!("{:.4}", row.mean_height_m),
            format!("{:.4}", row.start_height_m - row.mean_height_m),
            if row.lost == 0 { "0".to_owned() } else { format!("**{}**", row.lost) },
        ]
    };
    markdown(&head, rows.iter().map(line))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::Machine;

    fn row(scene: &str, engine: &str, ms_p50: f64, lost: usize) -> Measured<Row> {
        let machine = Machine { cpu: "c".into(), cores: 2, date: "2026-11-22".into(), commit: "a".into() };
        let row = Row {
            scene: scene.into(),
            bodies: 200,
            engine: engine.into(),
            threads: 2,
            regions: 0,
            ticks: 300,
            ms_p50,
            over_bare: 0.5,
            mean_depth_m: 0.001_5,
            deepest_m: 0.004,
            energy_j: 90.0,
            start_energy_j: 100.0,
            mean_height_m: 4.5,
            start_height_m: 5.0,
            lost,
        };
        Measured { row, machine }
    }

    #[test]
    fn a_table_has_a_row_an_engine_in_millimetres_and_shows_what_was_lost() {
        let table = table(&[row("pile", "box3d", 8.11, 0), row("pile", "jolt", 22.6, 3)]);
        let first = "| pile | 200 | box3d | 2 | 8.11 | 0.50× | 1.50 | 4.00 | 0.900 | 4.5000 | 0.5000 | 0 |";
        assert!(table.contains(first), "{table}");
        assert!(table.contains("| jolt |") && table.contains("| **3** |"), "{table}");
    }

    #[test]
    fn the_picture_has_a_panel_a_scene_and_a_point_an_engine() {
        let rows =
            [row("pile", "rapier", 20.0, 0), row("pile", "jolt", 22.6, 0), row("heap", "jolt", 29.0, 0)];
        let panels = picture(&rows).panels;
        assert_eq!(panels.iter().map(|panel| panel.lines.len()).collect::<Vec<_>>(), [2, 1]);
        assert_eq!(panels[0].lines[1].points, [(22.6, 1.5, String::new())]);
    }
}
