//! Draws bytes against shown error, and writes the table of the page.

use crate::draw::{COLOURS, Line, LinePanel, LinePanels, Mark};
use crate::page::table as markdown;
use crate::results::{Measured, short};

use super::Row;

/// The table has only this network of what was measured with limits; the picture has all.
const LIMITED: &str = "100 ± 20 ms, 5 % lost";

/// Draws a panel for each scene that was measured with limits: few bytes to the left, small errors at the
/// bottom.
pub(super) fn picture(rows: &[Measured<Row>]) -> LinePanels {
    let machine = rows.last().map_or(String::new(), |row| row.machine.caption());
    let limited = rows.iter().filter(|row| row.row.limit_bytes_per_s > 0);
    let mut scenes: Vec<_> = limited.map(|row| &*row.row.scene).collect();
    scenes.dedup();
    LinePanels {
        title: "What a client is shown, by the bytes that it asks for".to_owned(),
        caption: format!(
            "99th percentile of the distance from the truth at the tick that is shown.\n{machine}"
        ),
        x_label: "kbit/s, all of UDP".to_owned(),
        columns: 2,
        panels: scenes.into_iter().map(|scene| panel(rows, scene)).collect(),
    }
}

fn panel(rows: &[Measured<Row>], scene: &str) -> LinePanel {
    let of_scene: Vec<&Row> = rows.iter().map(|row| &row.row).filter(|row| row.scene == scene).collect();
    let mut networks: Vec<_> = of_scene.iter().map(|row| &*row.network).collect();
    networks.dedup();
    let marks = [Mark::Dot, Mark::Cross, Mark::Ring, Mark::Square, Mark::Triangle];
    let lines = networks.into_iter().zip(COLOURS).zip(marks).map(|((network, colour), mark)| {
        let of_network = of_scene.iter().filter(|row| row.network == network);
        let points = of_network.map(|row| (8e-3 * row.bytes_per_s, row.shown_error_p99_mm, String::new()));
        Line { name: network.to_owned(), colour, thick: false, mark, points: points.collect() }
    });
    let moving = of_scene.first().map_or(0.0, |row| row.moving);
    LinePanel {
        title: format!("{scene}, {} moving", short(moving)),
        x_label: None,
        y_label: "shown off, p99 mm".to_owned(),
        lines: lines.collect(),
        limit: None,
    }
}

pub(super) fn table(rows: &[Measured<Row>]) -> String {
    let head = [
        "scene",
        "network",
        "limit, kbit/s",
        "moving bodies",
        "kbit/s",
        "bytes/s per moving body",
        "newest state, p50 and p99 ms old",
        "shown behind the world, ms",
        "shown off, p50 / p99 / max mm",
        "jumps per frame, p99 / max mm",
        "as told: off p99, jumps p99, mm",
    ];
    let cells = |Measured { row, .. }: &Measured<Row>| {
        let list = |numbers: &[f64]| numbers.iter().map(|&n| short(n)).collect::<Vec<_>>().join(" / ");
        vec![
            row.scene.clone(),
            row.network.clone(),
            if row.limit_bytes_per_s == 0 {
                "–".into()
            } else {
                short(8e-3 * f64::from(row.limit_bytes_per_s))
            },
            format!("{} of {}", short(row.moving), row.bodies),
            short(8e-3 * row.bytes_per_s),
            short(row.bytes_per_moving_body_s),
            list(&[row.staleness_p50_ms, row.staleness_p99_ms]),
            short(row.behind_ms),
            list(&[row.shown_error_p50_mm, row.shown_error_p99_mm, row.shown_error_max_mm]),
            list(&[row.shown_jump_p99_mm, row.shown_jump_max_mm]),
            list(&[row.told_error_p99_mm, row.told_jump_p99_mm]),
        ]
    };
    let is_shown = |row: &&Measured<Row>| row.row.limit_bytes_per_s == 0 || row.row.network == LIMITED;
    markdown(&head, rows.iter().filter(is_shown).map(cells))
}
