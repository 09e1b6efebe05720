//! Draws small multiples of lines on logarithmic axes, with one legend for all.

use plotters::prelude::*;

use super::axis::Decades;
use super::{Area, Drawn, FAINT, Picture, text};

/// Several panels under one title.
pub(crate) struct LinePanels {
    pub(crate) title: String,
    /// The text below the title: what is seen, and the machine.
    pub(crate) caption: String,
    pub(crate) x_label: String,
    /// The number of panels beside one another.
    pub(crate) columns: usize,
    pub(crate) panels: Vec<LinePanel>,
}

/// One panel with axes of its own.
pub(crate) struct LinePanel {
    pub(crate) title: String,
    /// The label of x, in place of that of all panels.
    pub(crate) x_label: Option<String>,
    pub(crate) y_label: String,
    pub(crate) lines: Vec<Line>,
    /// A value of y that is to be reached, drawn across the panel.
    pub(crate) limit: Option<f64>,
}

/// Points joined in their order. Lines of the same name share one entry of the legend.
pub(crate) struct Line {
    pub(crate) name: String,
    pub(crate) colour: RGBColor,
    pub(crate) thick: bool,
    pub(crate) mark: Mark,
    /// The points: x, y and a label. Values that are not above zero lie on the edge.
    pub(crate) points: Vec<(f64, f64, String)>,
}

/// The mark drawn at a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Mark {
    Dot,
    Ring,
    Triangle,
    Square,
    Cross,
    /// A ring around another mark.
    Halo,
}

const PANEL: (u32, u32) = (430, 330);
const HEAD: u32 = 78;
const LEGEND_ROW: u32 = 22;
const LEGEND_ENTRY: u32 = 250;
const AIR: u32 = 12;

impl LinePanels {
    fn columns(&self) -> usize {
        self.columns.min(self.panels.len()).max(1)
    }

    /// Returns the first line of each name, in order.
    fn entries(&self) -> Vec<&Line> {
        let mut entries: Vec<&Line> = Vec::new();
        for line in self.panels.iter().flat_map(|panel| &panel.lines) {
            if entries.iter().all(|entry| entry.name != line.name) {
                entries.push(line);
            }
        }
        entries
    }

    fn legend_columns(&self) -> usize {
        ((self.size_without_legend().0 - 2 * AIR) / LEGEND_ENTRY).max(1) as usize
    }

    fn size_without_legend(&self) -> (u32, u32) {
        let rows = self.panels.len().div_ceil(self.columns()).max(1);
        (self.columns() as u32 * PANEL.0 + 2 * AIR, HEAD + rows as u32 * PANEL.1)
    }
}

impl Picture for LinePanels {
    fn size(&self) -> (u32, u32) {
        let (width, height) = self.size_without_legend();
        let rows = self.entries().len().div_ceil(self.legend_columns()) as u32;
        (width, height + rows * LEGEND_ROW + 2 * AIR)
    }

    fn draw(&self, area: &Area<'_>) -> Drawn {
        area.draw(&Text::new(self.title.clone(), (16, 14), text(24)))?;
        for (i, line) in self.caption.lines().enumerate() {
            area.draw(&Text::new(line.to_owned(), (16, 42 + 16 * i as i32), text(13)))?;
        }
        for (i, panel) in self.panels.iter().enumerate() {
            let (column, row) = ((i % self.columns()) as i32, (i / self.columns()) as i32);
            let (left, top) = (AIR as i32 + column * PANEL.0 as i32, HEAD as i32 + row * PANEL.1 as i32);
            let place = area.clone().shrink((left, top), PANEL);
            panel.draw(&place, panel.x_label.as_ref().unwrap_or(&self.x_label))?;
        }
        let top = (self.size_without_legend().1 + AIR) as i32;
        for (i, line) in self.entries().into_iter().enumerate() {
            let (column, row) = (i % self.legend_columns(), i / self.legend_columns());
            let at = (
                AIR as i32 + 8 + (column as u32 * LEGEND_ENTRY) as i32,
                top + (row as u32 * LEGEND_ROW) as i32,
            );
            area.draw(&PathElement::new([at, (at.0 + 26, at.1)], line.style()))?;
            line.mark.draw(area, (at.0 + 13, at.1), line.colour)?;
            area.draw(&Text::new(line.name.clone(), (at.0 + 33, at.1 - 7), text(13)))?;
        }
        Ok(())
    }
}

impl LinePanel {
    fn draw(&self, area: &Area<'_>, x_label: &str) -> Drawn {
        let points = || self.lines.iter().flat_map(|line| &line.points);
        let x = Decades::around(points().map(|point| point.0));
        let y = Decades::around(points().map(|point| point.1).chain(self.limit));
        let mut chart = ChartBuilder::on(area)
            .caption(&self.title, text(15))
            .margin(8)
            .x_label_area_size(36)
            .y_label_area_size(58)
            .build_cartesian_2d(x, y)?;
        chart
            .configure_mesh()
            .x_labels(7)
            .y_labels(7)
            .max_light_lines(0)
            .bold_line_style(FAINT)
            .axis_style(BLACK.mix(0.4))
            .label_style(text(11))
            .axis_desc_style(text(12))
            .x_desc(x_label)
            .y_desc(&self.y_label)
            .draw()?;
        let plot = chart.plotting_area();
        let place = |point: &(f64, f64, String)| plot.map_coordinate(&(point.0, point.1));
        if let Some(limit) = self.limit {
            let (columns, _) = plot.get_pixel_range();
            let row = plot.map_coordinate(&(1.0, limit)).1;
            for start in columns.clone().step_by(10) {
                let dash = [(start, row), ((start + 5).min(columns.end), row)];
                area.draw(&PathElement::new(dash.map(|at| relative(area, at)), RED.mix(0.6)))?;
            }
        }
        for line in &self.lines {
            let path: Vec<_> = line.points.iter().map(|point| relative(area, place(point))).collect();
            area.draw(&PathElement::new(path, line.style()))?;
        }
        for line in &self.lines {
            for point in &line.points {
                let at = relative(area, place(point));
                line.mark.draw(area, at, line.colour)?;
                if !point.2.is_empty() {
                    area.draw(&Text::new(
                        point.2.clone(),
                        (at.0 + 5, at.1 - 14),
                        text(11).color(&line.colour),
                    ))?;
                }
            }
        }
        Ok(())
    }
}

/// Converts a place on the whole picture, as charts give it, to one relative to the area, as areas draw it.
fn relative(area: &Area<'_>, at: (i32, i32)) -> (i32, i32) {
    let (left, top) = area.get_base_pixel();
    (at.0 - left, at.1 - top)
}

impl Line {
    fn style(&self) -> ShapeStyle {
        self.colour.stroke_width(if self.thick { 3 } else { 1 })
    }
}

impl Mark {
    fn draw(self, area: &Area<'_>, at: (i32, i32), colour: RGBColor) -> Drawn {
        let (fill, line) = (colour.filled(), colour.stroke_width(2));
        match self {
            Self::Dot => area.draw(&Circle::new(at, 4, fill)),
            Self::Ring => {
                area.draw(&Circle::new(at, 4, WHITE.filled()))?;
                area.draw(&Circle::new(at, 4, line))
            }
            Self::Triangle => area.draw(&TriangleMarker::new(at, 6, fill)),
            Self::Square => area.draw(&Rectangle::new([(at.0 - 4, at.1 - 4), (at.0 + 4, at.1 + 4)], fill)),
            Self::Cross => area.draw(&Cross::new(at, 4, line)),
            Self::Halo => area.draw(&Circle::new(at, 9, line)),
        }
    }
}
