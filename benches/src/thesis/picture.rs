//! Draws scale-up and cost of a tick over nodes (the thesis's figures 5.2 to 5.5).

use super::published::Published;
use super::{MANY, Row};
use crate::draw::{BLACK_LINE, COLOURS, Line, LinePanel, LinePanels, Mark};
use crate::results::Measured;

/// The worlds that are drawn: those run here with up to 32 nodes, the largest last.
const WORLDS: [usize; 5] = [1_000, 2_000, 3_000, 4_000, MANY];

pub(super) fn picture(rows: &[Measured<Row>]) -> LinePanels {
    let rows_of = |objects: usize| rows.iter().map(|row| &row.row).filter(move |row| row.objects == objects);
    let alone = |objects: usize| rows_of(objects).find(|row| row.nodes == 1).map(|row| row.slowest_ms);
    let ours = |of: &dyn Fn(&Row) -> Option<f64>| -> Vec<Line> {
        let lines = WORLDS.into_iter().zip(COLOURS).map(|(objects, colour)| {
            let points = rows_of(objects).filter_map(|row| Some((row.nodes as f64, of(row)?, String::new())));
            let name = format!("{objects} cubes");
            Line { name, colour, thick: true, mark: Mark::Dot, points: points.collect() }
        });
        lines.filter(|line| !line.points.is_empty()).collect()
    };
    let theirs = WORLDS.into_iter().zip(COLOURS).filter_map(|(objects, colour)| {
        let world = Published::world(objects)?;
        let up = |nodes| Some((nodes as f64, world.alone.0 / world.step_ms(nodes)?, String::new()));
        let points = (1..=32).filter_map(up).collect();
        Some(Line { name: format!("{objects}, thesis"), colour, thick: false, mark: Mark::Cross, points })
    });
    let ideal = Line {
        name: "as many times as nodes".to_owned(),
        colour: BLACK_LINE,
        thick: false,
        mark: Mark::Dot,
        points: [1.0, 32.0].map(|nodes| (nodes, nodes, String::new())).into(),
    };
    let panel = |title: &str, unit: &str, lines: Vec<Line>| LinePanel {
        title: title.to_owned(),
        x_label: None,
        y_label: unit.to_owned(),
        lines,
        limit: None,
    };
    let mut ups = ours(&|row| Some(alone(row.objects)? / row.slowest_ms));
    ups.extend(theirs);
    ups.push(ideal);
    let machine = rows.last().map_or(String::new(), |row| row.machine.caption());
    LinePanels {
        title: "The thesis's world by 1 to 32 participants".to_owned(),
        caption: format!("Processor time of the slowest member, exchange included.\n{machine}"),
        x_label: "nodes".to_owned(),
        columns: 2,
        panels: vec![
            panel("Scale-up by the slowest member", "times", ups),
            panel("A tick of the slowest member", "ms", ours(&|row| Some(row.slowest_ms))),
            panel("A tick of a member, mean", "ms", ours(&|row| Some(row.members_ms))),
            panel(
                "Messages sent by a member in a tick",
                "messages",
                ours(&|row| (row.nodes > 1).then_some(row.messages)),
            ),
        ],
    }
}
