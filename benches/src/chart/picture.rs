//! Draws the chart: speed to the right, small errors at the top, so the best is top right.

use plotters::style::RGBColor;

use super::{Row, front};
use crate::draw::{BLACK_LINE, COLOURS, Line, LinePanel, LinePanels, Mark};
use crate::results::Measured;

/// One panel a case.
pub(super) fn picture(rows: &[Measured<Row>]) -> LinePanels {
    let mut cases: Vec<(&str, &str)> = Vec::new();
    for Measured { row, .. } in rows {
        if !cases.contains(&(&*row.scene, &*row.case)) {
            cases.push((&row.scene, &row.case));
        }
    }
    let verdicts = front::verdicts(rows);
    let panels = cases.into_iter().map(|(scene, case)| {
        let own =
            verdicts.iter().filter(|verdict| (&*verdict.auto.scene, &*verdict.auto.case) == (scene, case));
        let usual: Vec<_> = own.filter(|verdict| verdict.auto.setting == "game").collect();
        let beaten = usual.iter().filter(|verdict| verdict.better.is_some()).count();
        let verdict = match (beaten, usual.len()) {
            (0, _) => "auto on the front".to_owned(),
            (beaten, all) => format!("auto beaten at {beaten} of {all}"),
        };
        let of_case = rows.iter().map(|row| &row.row);
        panel(&verdict, of_case.filter(|row| (&*row.scene, &*row.case) == (scene, case)).collect())
    });
    let machine = rows.last().map_or(String::new(), |row| row.machine.caption());
    LinePanels {
        title: "Speed and accuracy".to_owned(),
        caption: format!(
            "Best is top right. Couplings: dot 2, triangle 4, square 8 regions, joined from 1 over 2 to 4 exchanges; auto: its presets, ring 1 region. Dashed: the gate. Errors lost in noise lie at its level.\n{machine}"
        ),
        x_label: "real-time factor".to_owned(),
        y_reversed: true,
        columns: 3,
        panels: panels.collect(),
    }
}

fn panel(verdict: &str, rows: Vec<&Row>) -> LinePanel {
    let mut kinds: Vec<(&str, &str, usize)> = Vec::new();
    for row in &rows {
        let kind = (&*row.method, &*row.sweep, row.regions);
        if !kinds.contains(&kind) {
            kinds.push(kind);
        }
    }
    // Auto last, over the others.
    kinds.sort_by_key(|kind| kind.0 == "auto");
    // What broke is drawn at the lower edge, not as far below as its figure says; what is lost in noise at the upper.
    let sane = rows.iter().map(|row| row.error).filter(|error| *error < 1e6).fold(0.0, f64::max);
    let noise = rows.iter().map(|row| row.noise).fold(f64::INFINITY, f64::min);
    let drawn = |error: f64| error.clamp(noise.min(sane), 3.0 * sane);
    let lines = kinds.into_iter().map(|(method, sweep, regions)| {
        let of_kind =
            rows.iter().filter(|row| (&*row.method, &*row.sweep, row.regions) == (method, sweep, regions));
        let mut of_kind: Vec<_> = of_kind.collect();
        if method == "bare" {
            // From the coarsest to the finest.
            of_kind.sort_by_key(|row| row.setting.trim_start_matches("1/").parse().unwrap_or(0u64));
        }
        let points = of_kind.into_iter().map(|row| (row.rtf, drawn(row.error), label(row))).collect();
        let name = match method {
            "bare" => format!("one bare Rapier world, by {sweep}"),
            _ => method.to_owned(),
        };
        Line { name, colour: colour(method, sweep), thick: method == "auto", mark: mark(regions), points }
    });
    let gate = rows.iter().map(|row| row.gate).fold(0.0, f64::max);
    LinePanel {
        title: format!("{} {}: {verdict}", rows[0].scene, rows[0].case),
        y_label: if rows[0].unit.is_empty() {
            "error".to_owned()
        } else {
            format!("error, {}", rows[0].unit)
        },
        lines: lines.collect(),
        limit: (gate > 0.0 && gate < 1e6).then_some(gate),
    }
}

/// Where a sweep of one world begins, and the presets of auto.
fn label(row: &Row) -> String {
    match (&*row.method, &*row.sweep) {
        ("auto", _) if row.regions == 2 => row.setting[..1].to_owned(),
        ("bare", "dt") => row.setting.clone(),
        ("bare", _) => format!("{}i", row.setting),
        _ => String::new(),
    }
}

fn colour(method: &str, sweep: &str) -> RGBColor {
    match (method, sweep) {
        ("bare", "dt") => COLOURS[6],
        ("bare", _) => COLOURS[5],
        ("proxy", _) => COLOURS[4],
        ("owner", _) => COLOURS[1],
        ("overlap", _) => COLOURS[0],
        ("island", _) => COLOURS[2],
        ("auto", _) => BLACK_LINE,
        _ => COLOURS[3],
    }
}

fn mark(regions: usize) -> Mark {
    match regions {
        0 => Mark::Cross,
        1 => Mark::Ring,
        2 => Mark::Dot,
        4 => Mark::Triangle,
        _ => Mark::Square,
    }
}
