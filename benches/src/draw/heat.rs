//! Draws heat maps beside one another on one logarithmic scale of colours.

use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::axis::{Decades, power};
use super::{Area, Drawn, Picture, text};
use crate::results::short;

/// Maps of one kind under one title.
pub(crate) struct HeatMaps {
    pub(crate) title: String,
    /// The text below the title: what is seen, and the machine.
    pub(crate) caption: String,
    pub(crate) x_label: String,
    pub(crate) y_label: String,
    /// The meaning of the colours, with the unit.
    pub(crate) scale_label: String,
    /// The values of the best and of the worst colour; values beyond have the same colour.
    pub(crate) scale: (f64, f64),
    /// The number of maps beside one another.
    pub(crate) columns: usize,
    pub(crate) maps: Vec<HeatMap>,
}

/// One map, with a value for every pair of column and row.
pub(crate) struct HeatMap {
    pub(crate) title: String,
    pub(crate) columns: Vec<String>,
    /// The labels of the rows; the first row is the lowest.
    pub(crate) rows: Vec<String>,
    /// The values by row, then by column; `None` where nothing was measured.
    pub(crate) values: Vec<Vec<Option<f64>>>,
}

const CELL: (u32, u32) = (54, 28);
const LEFT: u32 = 74;
const ABOVE: u32 = 30;
const BELOW: u32 = 50;
const FOOT: u32 = 64;
const AIR: u32 = 14;

impl HeatMaps {
    fn columns(&self) -> usize {
        self.columns.min(self.maps.len()).max(1)
    }

    fn map_size(&self) -> (u32, u32) {
        let most = |count: fn(&HeatMap) -> usize| self.maps.iter().map(count).max().unwrap_or(1) as u32;
        (
            LEFT + most(|map| map.columns.len()) * CELL.0 + 2 * AIR,
            ABOVE + most(|map| map.rows.len()) * CELL.1 + BELOW,
        )
    }

    /// Returns the height of title and caption.
    fn head(&self) -> u32 {
        56 + 16 * self.caption.lines().count() as u32
    }

    /// Returns how bad a value is: 0 is the best, 1 the worst.
    fn badness(&self, value: f64) -> f64 {
        let (best, worst) = (self.scale.0.log10(), self.scale.1.log10());
        let value = if value.is_finite() { value.max(f64::MIN_POSITIVE).log10() } else { worst };
        ((value - best) / (worst - best)).clamp(0.0, 1.0)
    }
}

impl Picture for HeatMaps {
    fn size(&self) -> (u32, u32) {
        let (width, height) = self.map_size();
        let rows = self.maps.len().div_ceil(self.columns()).max(1) as u32;
        ((self.columns() as u32 * width + 2 * AIR).max(760), self.head() + rows * height + FOOT)
    }

    fn draw(&self, area: &Area<'_>) -> Drawn {
        area.draw(&Text::new(self.title.clone(), (16, 14), text(24)))?;
        for (i, line) in self.caption.lines().enumerate() {
            area.draw(&Text::new(line.to_owned(), (16, 42 + 16 * i as i32), text(13)))?;
        }
        let size = self.map_size();
        for (i, map) in self.maps.iter().enumerate() {
            let (column, row) = ((i % self.columns()) as u32, (i / self.columns()) as u32);
            let at = ((AIR + column * size.0) as i32, (self.head() + row * size.1) as i32);
            self.draw_map(map, &area.clone().shrink(at, size))?;
        }
        self.draw_scale(area, self.size().1 - FOOT)
    }
}

impl HeatMaps {
    fn draw_map(&self, map: &HeatMap, area: &Area<'_>) -> Drawn {
        let rows = map.rows.len() as u32;
        area.draw(&Text::new(map.title.clone(), (LEFT as i32, 8), text(15)))?;
        for (row, (name, values)) in map.rows.iter().zip(&map.values).enumerate() {
            let top = (ABOVE + (rows - 1 - row as u32) * CELL.1) as i32;
            let label = text(11).pos(Pos::new(HPos::Right, VPos::Center));
            area.draw(&Text::new(name.clone(), (LEFT as i32 - 5, top + CELL.1 as i32 / 2), label))?;
            for (column, value) in values.iter().enumerate() {
                let left = (LEFT + column as u32 * CELL.0) as i32;
                self.draw_cell(*value, (left, top), area)?;
            }
        }
        let bottom = (ABOVE + rows * CELL.1) as i32;
        for (column, name) in map.columns.iter().enumerate() {
            let middle = (LEFT + column as u32 * CELL.0 + CELL.0 / 2) as i32;
            let label = text(11).pos(Pos::new(HPos::Center, VPos::Top));
            area.draw(&Text::new(name.clone(), (middle, bottom + 4), label))?;
        }
        let middle = (LEFT + map.columns.len() as u32 * CELL.0 / 2) as i32;
        let label = text(12).pos(Pos::new(HPos::Center, VPos::Top));
        area.draw(&Text::new(self.x_label.clone(), (middle, bottom + 20), label))?;
        let label = text(12).transform(FontTransform::Rotate270).pos(Pos::new(HPos::Center, VPos::Top));
        area.draw(&Text::new(self.y_label.clone(), (4, (ABOVE + rows * CELL.1 / 2) as i32), label))
    }

    fn draw_cell(&self, value: Option<f64>, at: (i32, i32), area: &Area<'_>) -> Drawn {
        let (width, height) = (CELL.0 as i32, CELL.1 as i32);
        let colour = value.map_or(WHITE, |value| colour(self.badness(value)));
        area.draw(&Rectangle::new([at, (at.0 + width - 1, at.1 + height - 1)], colour.filled()))?;
        let Some(value) = value else { return Ok(()) };
        // Relative luminance (ITU-R BT.709) tells whether black or white text reads better.
        let RGBColor(r, g, b) = colour;
        let light = 0.2126 * f64::from(r) + 0.7152 * f64::from(g) + 0.0722 * f64::from(b) > 120.0;
        let style = text(11).color(if light { &BLACK } else { &WHITE });
        let style = style.pos(Pos::new(HPos::Center, VPos::Center));
        area.draw(&Text::new(short(value), (at.0 + width / 2, at.1 + height / 2), style))
    }

    fn draw_scale(&self, area: &Area<'_>, top: u32) -> Drawn {
        const WIDTH: i32 = 360;
        let (left, top) = (16, top as i32 + 8);
        for step in 0..WIDTH {
            let colour = colour(f64::from(step) / f64::from(WIDTH - 1)).filled();
            area.draw(&Rectangle::new([(left + step, top), (left + WIDTH, top + 14)], colour))?;
        }
        for value in Decades::points_within(self.scale) {
            let x = left + (f64::from(WIDTH) * self.badness(value)) as i32;
            let label = text(11).pos(Pos::new(HPos::Center, VPos::Top));
            area.draw(&Text::new(power(value), (x, top + 18), label))?;
        }
        area.draw(&Text::new(self.scale_label.clone(), (left + WIDTH + 24, top), text(12)))
    }
}

/// Returns a colour from dark blue (right) through grey to yellow (wrong). The scale is cividis (Nuñez,
/// Anderton and Renslow, 2018): it is the same to people with any colour vision, and a scale of brightness in
/// print.
fn colour(badness: f64) -> RGBColor {
    const STOPS: [[f64; 3]; 9] = [
        [0.0, 34.0, 78.0],
        [18.0, 53.0, 112.0],
        [59.0, 73.0, 108.0],
        [87.0, 93.0, 109.0],
        [112.0, 113.0, 115.0],
        [138.0, 134.0, 120.0],
        [165.0, 156.0, 116.0],
        [195.0, 179.0, 105.0],
        [254.0, 232.0, 56.0],
    ];
    let place = badness.clamp(0.0, 1.0) * (STOPS.len() - 1) as f64;
    let low = (place as usize).min(STOPS.len() - 2);
    let mix = |i: usize| STOPS[low][i] + (place - low as f64) * (STOPS[low + 1][i] - STOPS[low][i]);
    RGBColor(mix(0) as u8, mix(1) as u8, mix(2) as u8)
}
