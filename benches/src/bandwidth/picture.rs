//! Draws the bits of a state by field, and writes the table of the page.

use crate::draw::{BLACK_LINE, COLOURS, Line, LinePanel, LinePanels, Mark};
use crate::page::table as markdown;
use crate::results::{Measured, short};

use super::{NETWORKS, Row};

/// A field's name, and the function that returns its bits per state.
type Field = (&'static str, fn(&Row) -> f64);

const FIELDS: [Field; 8] = [
    ("which body", |row| row.id),
    ("told against what", |row| row.reference),
    ("owner", |row| row.owner),
    ("place", |row| row.place),
    ("turn", |row| row.turn),
    ("velocity", |row| row.velocity),
    ("spin", |row| row.spin),
    ("headers", |row| 8.0 * row.headers),
];

/// Draws a panel per scene.
pub(super) fn picture(rows: &[Measured<Row>]) -> LinePanels {
    let mut scenes: Vec<_> = rows.iter().map(|row| &*row.row.scene).collect();
    scenes.dedup();
    LinePanels {
        title: "What the state of a body costs a client, by field and distance".to_owned(),
        caption: "At each point a network of the table: what comes later is predicted from longer ago."
            .to_owned(),
        x_label: "ticks from a state to its acknowledgement".to_owned(),
        columns: 2,
        panels: scenes.into_iter().map(|scene| panel(rows, scene)).collect(),
    }
}

fn panel(rows: &[Measured<Row>], scene: &str) -> LinePanel {
    let of_scene: Vec<&Row> = rows.iter().map(|row| &row.row).filter(|row| row.scene == scene).collect();
    let trip =
        |row: &Row| NETWORKS.iter().find(|(name, ..)| *name == row.network).map(|it| 1 + 2 * it.1 + it.2);
    let colours = COLOURS.into_iter().chain([BLACK_LINE]);
    let marks = [Mark::Dot, Mark::Cross, Mark::Ring, Mark::Square, Mark::Triangle].into_iter().cycle();
    let lines = FIELDS.into_iter().zip(colours).zip(marks).map(|(((name, bits), colour), mark)| {
        let points = of_scene.iter().filter_map(|row| Some((trip(row)? as f64, bits(row), String::new())));
        Line { name: name.to_owned(), colour, thick: false, mark, points: points.collect() }
    });
    let bytes = of_scene.first().map_or(0.0, |row| row.bytes_per_moving_body_s);
    LinePanel {
        title: format!("{scene}: from {} bytes/s per moving body", short(bytes)),
        x_label: None,
        y_label: "bits of a state".to_owned(),
        lines: lines.collect(),
        limit: None,
    }
}

pub(super) fn table(rows: &[Measured<Row>]) -> String {
    let head = [
        "scene",
        "network",
        "moving bodies",
        "kbit/s",
        "bytes/s per moving body",
        "as predicted",
        "told anew",
        "bits of a state: which body",
        "told against what",
        "owner",
        "place",
        "turn",
        "velocity",
        "spin",
        "headers, bits",
        "off at most, mm",
        "µs to code, to read",
        "64 clients over a step",
    ];
    let percent = |share: f64| format!("{:.0} %", 100.0 * share);
    let cells = |Measured { row, .. }: &Measured<Row>| {
        vec![
            row.scene.clone(),
            row.network.clone(),
            short(row.moving),
            short(row.bytes_per_s * 8e-3),
            short(row.bytes_per_moving_body_s),
            percent(row.predicted_share),
            percent(row.whole_share),
            short(row.id),
            short(row.reference),
            short(row.owner),
            short(row.place),
            short(row.turn),
            short(row.velocity),
            short(row.spin),
            short(8.0 * row.headers),
            short(row.told_error_max_mm),
            format!("{}, {}", short(row.code_us), short(row.read_us)),
            percent(row.clients_64),
        ]
    };
    markdown(&head, rows.iter().map(cells))
}
