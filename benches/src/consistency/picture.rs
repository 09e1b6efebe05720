//! Draws deviations and bytes over time, and writes the table of the page.

use crate::draw::{COLOURS, Line, LinePanel, LinePanels, Mark};
use crate::page::table as markdown;
use crate::results::{Measured, short};

use super::scene::SETTINGS;
use super::{Row, Summary};

/// The most points of a line; each point is the largest value of the seconds that it stands for.
const POINTS: usize = 60;

pub(super) fn picture(rows: &[Measured<Row>]) -> LinePanels {
    let limit = Some(f64::from(SETTINGS[0].between_groups_m));
    let panels = vec![
        panel(rows, "Bodies between groups, 99th percentile", "m", limit, |row| row.bodies_p99_m),
        panel(rows, "Bodies between groups, largest", "m", limit, |row| row.bodies_max_m),
        panel(rows, "Avatars between groups, largest", "m", None, |row| row.avatars_max_m),
        panel(rows, "Ghosts from owners in a group, largest", "m", None, |row| row.ghosts_max_m),
        panel(rows, "Bytes between groups", "bytes/s", None, |row| row.between_bytes_s as f64),
        panel(rows, "Bytes inside groups", "bytes/s", None, |row| row.inside_bytes_s as f64),
    ];
    let machine = rows.last().map_or(String::new(), |row| row.machine.caption());
    LinePanels {
        title: "Three groups of four nodes, 60 ms apart, over time".to_owned(),
        caption: format!("Largest of every few seconds; dashed: the threshold between groups.\n{machine}"),
        x_label: "simulated seconds".to_owned(),
        columns: 3,
        panels,
    }
}

fn panel(
    rows: &[Measured<Row>],
    title: &str,
    unit: &str,
    limit: Option<f64>,
    of: fn(&Row) -> f64,
) -> LinePanel {
    let lines =
        SETTINGS.iter().zip(COLOURS).zip([Mark::Dot, Mark::Cross, Mark::Ring, Mark::Square, Mark::Triangle]);
    let lines = lines.map(|((setting, colour), mark)| {
        let of_setting: Vec<_> =
            rows.iter().map(|row| &row.row).filter(|row| row.setting == setting.name).collect();
        let chunks = of_setting.chunks(of_setting.len().div_ceil(POINTS).max(1));
        let points = chunks.map(|chunk| {
            let most = chunk.iter().map(|row| of(row)).fold(0.0, f64::max);
            (chunk[chunk.len() / 2].second as f64, most, String::new())
        });
        // A logarithmic axis has no place for zero.
        let points: Vec<_> = points.filter(|point| point.1 > 0.0).collect();
        Line { name: setting.name.to_owned(), colour, thick: false, mark, points }
    });
    let lines = lines.filter(|line| !line.points.is_empty()).collect();
    LinePanel { title: title.to_owned(), x_label: None, y_label: unit.to_owned(), lines, limit }
}

pub(super) fn table(summaries: &[Measured<Summary>]) -> String {
    let three = |values: [f64; 3]| values.map(short).join(", ");
    let lines = summaries.iter().map(|Measured { row, .. }| {
        vec![
            row.setting.clone(),
            row.seconds.to_string(),
            three([row.bodies_mean_m, row.bodies_p99_m, row.bodies_max_m]),
            three([row.avatars_mean_m, row.avatars_p99_m, row.avatars_max_m]),
            three([row.ghosts_mean_m, row.ghosts_p99_m, row.ghosts_max_m]),
            short(row.between_bytes_s as f64),
            short(row.inside_bytes_s as f64),
        ]
    });
    let head = [
        "setting",
        "simulated s",
        "bodies between groups, m: mean, p99, max",
        "avatars between groups, m",
        "ghosts from owners, m",
        "bytes/s between groups",
        "bytes/s inside groups",
    ];
    markdown(&head, lines)
}
