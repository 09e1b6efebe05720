//! Draws what a setting adds to the error of a scene beside the time that it takes, and stated errors beside
//! true ones.

use super::Row;
use super::coverage::Cover;
use crate::draw::{BLACK_LINE, COLOURS, Line, LinePanel, LinePanels, Mark};
use crate::results::Measured;

/// The settings by the names of their rows, with the colour and mark by which they are drawn.
const SETTINGS: [(&str, plotters::style::RGBColor, Mark); 5] = [
    ("full", BLACK_LINE, Mark::Square),
    ("auto", COLOURS[0], Mark::Dot),
    ("lowest rate", COLOURS[1], Mark::Halo),
    ("budget, 75 %", COLOURS[2], Mark::Triangle),
    ("budget, 50 %", COLOURS[3], Mark::Cross),
];

/// Draws a panel for each scene, and one of the stated errors.
pub(super) fn picture(savings: &[Measured<Row>], covers: &[Measured<Cover>]) -> LinePanels {
    let mut scenes: Vec<_> = savings.iter().map(|row| (&*row.row.scene, row.row.bodies)).collect();
    scenes.dedup();
    let rows: Vec<_> = savings.iter().map(|row| &row.row).collect();
    let panels = scenes.into_iter().map(|scene| added(&rows, scene));
    let covers: Vec<_> = covers.iter().map(|cover| &cover.row).collect();
    let machine = savings.last().map_or(String::new(), |row| row.machine.caption());
    LinePanels {
        title: "Time saved and error added where less is computed".to_owned(),
        caption: format!(
            "Dashed: as far as the same scene of some seed is from the mean. At the lower edge: nothing.\n{machine}"
        ),
        x_label: "time, % of all in full".to_owned(),
        columns: 3,
        panels: panels.chain([stated(&covers)]).collect(),
    }
}

/// Returns the panel of a scene. It shows the energy, which every scene has; the table has penetrations, too.
fn added(rows: &[&Row], (scene, bodies): (&str, usize)) -> LinePanel {
    let of_scene: Vec<_> = rows.iter().filter(|row| row.scene == scene && row.bodies == bodies).collect();
    let full_j = of_scene.iter().find(|row| row.setting == "full").map_or(f64::NAN, |row| row.energy_j);
    let percent = |energy_j: f64| 100.0 * energy_j.abs() / full_j.abs();
    let lines = SETTINGS.into_iter().map(|(setting, colour, mark)| {
        let of_setting = of_scene.iter().filter(|row| row.setting == setting);
        let point = |row: &&&Row| (row.share_percent, percent(row.energy_j - full_j), String::new());
        let points = of_setting.map(point).collect();
        Line { name: setting.to_owned(), colour, thick: false, mark, points }
    });
    let spread = of_scene.first().map(|row| percent(row.energy_spread_j));
    LinePanel {
        title: format!("{scene}, {bodies} bodies"),
        x_label: None,
        y_label: "energy off, % of that in full".to_owned(),
        lines: lines.filter(|line| !line.points.is_empty()).collect(),
        limit: spread.filter(|spread| *spread > 0.0),
    }
}

fn stated(covers: &[&Cover]) -> LinePanel {
    let lines = SETTINGS.into_iter().flat_map(|(setting, colour, mark)| {
        let of_setting = covers.iter().filter(move |cover| cover.setting == setting);
        // Both settings of a scene lie close to one another, so one label serves both.
        let label = move |cover: &Cover| if setting == "auto" { cover.scene.clone() } else { String::new() };
        let points = of_setting.map(move |cover| (cover.true_m_s, cover.stated_m_s, label(cover)));
        // Each point is a line by itself: nothing lies between two scenes.
        points.map(move |point| Line {
            name: setting.to_owned(),
            colour,
            thick: false,
            mark,
            points: vec![point],
        })
    });
    let mut lines: Vec<Line> = lines.collect();
    let errors = || covers.iter().map(|cover| cover.true_m_s).filter(|error| *error > 0.0);
    let ends = [errors().fold(f64::INFINITY, f64::min), errors().fold(0.0, f64::max)];
    if ends[0] < ends[1] {
        let points = ends.map(|error| (error, error, String::new())).into();
        let (name, mark) = ("stated as it is".to_owned(), Mark::Ring);
        // Drawn below the others.
        lines.insert(0, Line { name, colour: COLOURS[6], thick: false, mark, points });
    }
    LinePanel {
        title: "Stated and true errors, means over seeds".to_owned(),
        x_label: Some("true error, m/s".to_owned()),
        y_label: "stated error, m/s".to_owned(),
        lines,
        limit: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::Machine;

    fn measured<Row>(row: Row) -> Measured<Row> {
        let machine = Machine { cpu: "a".into(), cores: 2, date: "2026-11-28".into(), commit: "b".into() };
        Measured { row, machine }
    }

    #[test]
    fn a_scene_has_a_panel_with_its_time_and_error_by_setting_and_errors_have_one() {
        let row = |scene: &str, setting: &str, share_percent, energy_j| {
            let (scene, setting) = (scene.to_owned(), setting.to_owned());
            measured(Row { scene, setting, share_percent, energy_j, energy_spread_j: 4.0, ..Row::default() })
        };
        let savings = [
            row("town", "full", 100.0, 200.0),
            row("town", "auto", 60.0, 198.0),
            row("gas", "full", 100.0, 50.0),
        ];
        let cover = |scene: &str, stated_m_s, true_m_s| {
            let (scene, setting) = (scene.to_owned(), "auto".to_owned());
            measured(Cover { scene, setting, runs: 1, within: 1, stated_m_s, true_m_s })
        };
        let LinePanels { panels, .. } =
            picture(&savings, &[cover("heap", 0.1, 0.2), cover("dve", 0.02, 0.01)]);
        let points = |panel: usize| {
            let points = panels[panel].lines.iter().flat_map(|line| &line.points);
            points.map(|point| (point.0, point.1)).collect::<Vec<_>>()
        };
        assert_eq!((panels.len(), panels[0].limit), (3, Some(2.0)));
        assert_eq!(points(0), [(100.0, 0.0), (60.0, 1.0)]);
        assert_eq!(points(1), [(100.0, 0.0)]);
        assert_eq!(points(2), [(0.01, 0.01), (0.2, 0.2), (0.2, 0.1), (0.01, 0.02)]);
    }
}
