//! Pictures: drawn once, written as SVG and as PNG. The font is part of the program, so that a machine without one draws too.

mod axis;
mod heat;
mod lines;

use std::error::Error;
use std::path::Path;

use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::register_font;

pub(crate) use heat::{HeatMap, HeatMaps};
pub(crate) use lines::{Line, LinePanel, LinePanels, Mark};

use crate::results::write_file;

const FONT: &str = "sans-serif";

/// Black on white, then colours that people with any colour vision can tell apart (Okabe and Ito, 2008).
pub(crate) const BLACK_LINE: RGBColor = RGBColor(0, 0, 0);
pub(crate) const COLOURS: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(120, 120, 120),
];
const FAINT: RGBColor = RGBColor(225, 225, 225);

type Area<B> = DrawingArea<B, Shift>;
type Drawn<B> = Result<(), DrawingAreaErrorKind<<B as DrawingBackend>::ErrorType>>;

/// Something that can be drawn on any surface.
pub(crate) trait Picture {
    /// Pixels, wide and high.
    fn size(&self) -> (u32, u32);
    /// Draws it on a white area of that size.
    fn draw<B: DrawingBackend>(&self, area: &Area<B>) -> Drawn<B>
    where
        B::ErrorType: 'static;
}

/// Writes `stem.svg` and `stem.png`.
pub(crate) fn write(picture: &impl Picture, stem: &Path) -> Result<(), Box<dyn Error>> {
    register_font(FONT, FontStyle::Normal, dejavu::sans::regular())
        .map_err(|_| "the built-in font is broken")?;
    let (width, height) = picture.size();

    let mut svg = String::new();
    on(picture, SVGBackend::with_string(&mut svg, (width, height)))?;
    write_file(&stem.with_extension("svg"), svg.as_bytes())?;

    let mut pixels = vec![0; 3 * width as usize * height as usize];
    on(picture, BitMapBackend::with_buffer(&mut pixels, (width, height)))?;
    let mut file = Vec::new();
    let mut png = png::Encoder::new(&mut file, width, height);
    png.set_color(png::ColorType::Rgb);
    png.set_depth(png::BitDepth::Eight);
    png.write_header()?.write_image_data(&pixels)?;
    write_file(&stem.with_extension("png"), &file)
}

fn on<B: DrawingBackend>(picture: &impl Picture, backend: B) -> Result<(), Box<dyn Error>>
where
    B::ErrorType: 'static,
{
    let area = backend.into_drawing_area();
    area.fill(&WHITE).and_then(|()| picture.draw(&area)).and_then(|()| area.present())?;
    Ok(())
}

/// A text style of so many pixels.
fn text(size: u32) -> TextStyle<'static> {
    (FONT, size).into_font().color(&BLACK)
}
