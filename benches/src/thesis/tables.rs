//! Sets the thesis's tables beside ours.

use std::collections::BTreeSet;

use serde::Serialize;

use super::published::{LEADER_PERCENT, Published, SCALE_UP};
use super::{MANY, Row};
use crate::page::table as markdown_table;
use crate::results::{Measured, short};

/// One figure of a table: theirs and ours.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Compared {
    table: &'static str,
    nodes: usize,
    objects: usize,
    /// The thesis's figure; `None` where it has none.
    thesis: Option<f64>,
    ours: f64,
    unit: &'static str,
}

fn find(rows: &[Measured<Row>], objects: usize, nodes: usize) -> Option<&Row> {
    rows.iter().map(|row| &row.row).find(|row| (row.objects, row.nodes) == (objects, nodes))
}

/// Returns how many times faster than one node a group is, by its slowest member.
fn scale_up(rows: &[Measured<Row>], row: &Row) -> Option<f64> {
    Some(find(rows, row.objects, 1)?.slowest_ms / row.slowest_ms)
}

/// Returns how much more a tick costs the leader than the mean of the members, percent of the leader's.
fn leader_percent(row: &Row) -> f64 {
    100.0 * (row.leader_ms - row.members_ms) / row.leader_ms
}

/// Returns all figures, those of tables 5.3 and 5.6 per world as well.
pub(super) fn compared(rows: &[Measured<Row>]) -> Vec<Compared> {
    let mut all = Vec::new();
    for Measured { row, .. } in rows {
        let &Row { objects, nodes, .. } = row;
        let published = Published::world(objects);
        let step_ms = published.and_then(|world| world.step_ms(nodes));
        let mut add = |table, thesis, ours, unit| {
            all.push(Compared { table, nodes, objects, thesis, ours, unit });
        };
        if nodes == 1 {
            add("5.1", step_ms, row.members_ms, "ms");
            add("5.1", published.map(|world| world.alone.1), row.collisions, "collisions");
            continue;
        }
        add(if nodes <= 8 { "5.2" } else { "5.7" }, step_ms, row.members_ms, "ms");
        let theirs = |world: &Published| Some(world.alone.0 / world.step_ms(nodes)?);
        if let Some(ours) = scale_up(rows, row) {
            add("5.3", published.and_then(theirs), ours, "times");
        }
        add("5.4", None, row.leader_ms, "ms");
        add("5.5", None, row.leader_ms - row.members_ms, "ms");
        add("5.6", LEADER_PERCENT.get(nodes - 2).copied(), leader_percent(row), "percent");
        add("messages", None, row.messages, "a tick and member");
        add("bytes", None, row.bytes, "a tick and member");
        add("deviation", None, row.disagreement_m_s.into(), "m/s");
    }
    all
}

/// Returns the tables of the page.
pub(super) fn markdown(rows: &[Measured<Row>]) -> String {
    [alone(rows), groups(rows), means(rows), beyond(rows)].join("\n")
}

fn theirs(value: Option<f64>) -> String {
    value.map_or_else(|| "–".to_owned(), short)
}

fn alone(rows: &[Measured<Row>]) -> String {
    let lines = rows.iter().map(|row| &row.row).filter(|row| row.nodes == 1 && row.objects != MANY);
    let lines = lines.map(|row| {
        let published = Published::world(row.objects);
        vec![
            row.objects.to_string(),
            theirs(published.map(|world| world.alone.0)),
            short(row.members_ms),
            theirs(published.map(|world| world.alone.1)),
            short(row.collisions),
        ]
    });
    let head = ["5.1: cubes, one node", "thesis, ms", "ours, ms", "thesis, collisions", "ours, collisions"];
    markdown_table(&head, lines)
}

/// Returns the table of scale-up by the slowest member, beside the thesis's, by cubes and nodes.
fn groups(rows: &[Measured<Row>]) -> String {
    let of_groups = || rows.iter().map(|row| &row.row).filter(|row| row.nodes > 1 && row.objects != MANY);
    let (worlds, nodes): (BTreeSet<_>, BTreeSet<_>) = of_groups().map(|row| (row.objects, row.nodes)).unzip();
    let cell = |objects: usize, nodes: usize| {
        let ours = of_groups().find(|row| (row.objects, row.nodes) == (objects, nodes));
        let published = Published::world(objects);
        let up = published.and_then(|world| Some(world.alone.0 / world.step_ms(nodes)?));
        ours.map_or("–".to_owned(), |row| format!("{} ({})", theirs(scale_up(rows, row)), theirs(up)))
    };
    let lines = worlds.iter().map(|&objects| {
        std::iter::once(objects.to_string()).chain(nodes.iter().map(|&nodes| cell(objects, nodes))).collect()
    });
    let columns: Vec<_> = nodes.iter().map(|nodes| format!("{nodes} nodes")).collect();
    let head: Vec<_> = ["5.2, 5.7: cubes"].into_iter().chain(columns.iter().map(String::as_str)).collect();
    markdown_table(&head, lines)
}

fn means(rows: &[Measured<Row>]) -> String {
    let lines = (2..=8).filter_map(|nodes| {
        let of: Vec<_> =
            rows.iter().map(|row| &row.row).filter(|row| row.nodes == nodes && row.objects != MANY).collect();
        let ups: Vec<_> = of.iter().filter_map(|row| scale_up(rows, row)).collect();
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        let percent: Vec<_> = of.iter().map(|row| leader_percent(row)).collect();
        (!ups.is_empty()).then(|| {
            vec![
                nodes.to_string(),
                short(SCALE_UP[nodes - 2]),
                short(mean(&ups)),
                short(LEADER_PERCENT[nodes - 2]),
                short(mean(&percent)),
            ]
        })
    });
    let head = ["5.3, 5.6: nodes", "thesis, scale-up", "ours", "thesis, leader dearer, %", "ours"];
    markdown_table(&head, lines)
}

fn beyond(rows: &[Measured<Row>]) -> String {
    let lines = rows.iter().map(|row| &row.row).filter(|row| row.objects == MANY).map(|row| {
        vec![
            row.objects.to_string(),
            row.nodes.to_string(),
            [row.members_ms, row.slowest_ms, row.leader_ms].map(short).join(", "),
            theirs(scale_up(rows, row)),
        ]
    });
    let head = ["more cubes", "nodes", "ours, ms: mean, slowest, leader", "scale-up by the slowest"];
    markdown_table(&head, lines)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::Machine;

    fn measured(nodes: usize, leader_ms: f64, members_ms: f64, slowest_ms: f64) -> Measured<Row> {
        let row = Row {
            objects: 1_000,
            nodes,
            repeats: 3,
            leader_ms,
            members_ms,
            slowest_ms,
            wall_ms: 1.0,
            messages: 8.0,
            bytes: 900.0,
            ghosts: 10.0,
            exchanges: 1.0,
            disagreement_m_s: 0.01,
            collisions: 15.0,
        };
        Measured { row, machine: Machine::here() }
    }

    #[test]
    fn theirs_stands_beside_ours() {
        let rows = [measured(1, 2.0, 2.0, 2.0), measured(4, 0.8, 0.6, 1.0)];
        let all = compared(&rows);
        let find = |table, unit| {
            let found = all.iter().find(|row| (row.table, row.unit) == (table, unit)).unwrap();
            (found.nodes, found.thesis, found.ours)
        };
        assert_eq!(find("5.1", "collisions"), (1, Some(16.0), 15.0));
        assert_eq!(find("5.2", "ms"), (4, Some(83.0), 0.6));
        assert_eq!(find("5.3", "times"), (4, Some(360.0 / 83.0), 2.0));
        assert_eq!(find("5.6", "percent").1, Some(19.0));
        assert!((find("5.6", "percent").2 - 25.0).abs() < 1e-9);
        let text = markdown(&rows);
        assert!(text.contains("| 4 | 4.50 | 2.00 | 19.0 | 25.0 |"), "{text}");
        assert!(
            text.contains("| 5.2, 5.7: cubes | 4 nodes |\n| --- | --- |\n| 1000 | 2.00 (4.34) |"),
            "{text}"
        );
    }
}
