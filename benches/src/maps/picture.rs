//! Draws one picture per panel: the bare world first, then every method.

use super::{BARE, Kind, Row};
use crate::draw::{HeatMap, HeatMaps};
use crate::results::Measured;

/// Returns the name of a panel's files, without ending.
pub(super) fn stem(kind: &Kind, panel: &str) -> String {
    let name = if panel.is_empty() { kind.name.to_owned() } else { format!("{}-{panel}", kind.name) };
    let words: Vec<_> = name.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty()).collect();
    format!("map-{}", words.join("-"))
}

/// Draws one map per method; `None` when nothing of the panel was computed.
pub(super) fn picture(kind: &Kind, panel: &str, rows: &[Measured<Row>]) -> Option<HeatMaps> {
    let of_panel: Vec<_> =
        rows.iter().filter(|row| row.row.map == kind.name && row.row.panel == panel).collect();
    let machine = of_panel.first()?.machine.caption();
    let mut methods: Vec<&str> = Vec::new();
    for row in &of_panel {
        if !methods.contains(&&*row.row.method) {
            methods.push(&row.row.method);
        }
    }
    let values_of = |of: fn(&Row) -> f64| {
        let mut values: Vec<_> = of_panel.iter().map(|row| of(&row.row)).collect();
        values.sort_by(f64::total_cmp);
        values.dedup();
        values
    };
    let (x, y) = (values_of(|row| row.x), values_of(|row| row.y));
    let names = |values: &[f64]| values.iter().map(f64::to_string).collect::<Vec<_>>();
    let maps = methods.iter().map(|method| {
        let value = |x: f64, y: f64| {
            let found =
                of_panel.iter().find(|row| row.row.method == *method && (row.row.x, row.row.y) == (x, y));
            found.map(|row| row.row.value)
        };
        HeatMap {
            title: if *method == BARE { "one bare Rapier world" } else { method }.to_owned(),
            columns: names(&x),
            rows: names(&y),
            values: y.iter().map(|&y| x.iter().map(|&x| value(x, y)).collect()).collect(),
        }
    });
    Some(HeatMaps {
        title: if panel.is_empty() { kind.title.to_owned() } else { format!("{}: {panel}", kind.title) },
        caption: format!("{}\n{machine}", kind.caption),
        x_label: kind.x_label.to_owned(),
        y_label: kind.y_label.to_owned(),
        scale_label: kind.scale_label.to_owned(),
        scale: kind.scale,
        columns: 3,
        maps: maps.collect(),
    })
}
