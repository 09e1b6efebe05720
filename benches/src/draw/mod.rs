//! Draws pictures as SVG, and turns them into PNG. The font is part of the program, so that a machine without
//! fonts draws too.

mod axis;
mod heat;
mod lines;

use std::error::Error;
use std::path::Path;

use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::register_font;
use resvg::{tiny_skia, usvg};

pub(crate) use heat::{HeatMap, HeatMaps};
pub(crate) use lines::{Line, LinePanel, LinePanels, Mark};

use crate::results::write_file;

const FONT: &str = "sans-serif";

/// The colour of lines that are black on white. `COLOURS` are colours that people with any colour vision can
/// tell apart (Okabe and Ito, 2008).
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

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Drawn = Result<(), DrawingAreaErrorKind<<SVGBackend<'static> as DrawingBackend>::ErrorType>>;

/// Something that can be drawn.
pub(crate) trait Picture {
    /// Returns the width and height in pixels.
    fn size(&self) -> (u32, u32);
    /// Draws the picture on a white area of that size.
    fn draw(&self, area: &Area<'_>) -> Drawn;
}

/// Writes `stem.svg`, and `stem.png` made from it.
pub(crate) fn write(picture: &impl Picture, stem: &Path) -> Result<(), Box<dyn Error>> {
    // Plotters needs the font to know how wide a text is.
    register_font(FONT, FontStyle::Normal, dejavu::sans::regular())
        .map_err(|_| "the built-in font is broken")?;
    let mut svg = String::new();
    {
        let area = SVGBackend::with_string(&mut svg, picture.size()).into_drawing_area();
        area.fill(&WHITE).and_then(|()| picture.draw(&area)).and_then(|()| area.present())?;
    }
    write_file(&stem.with_extension("svg"), svg.as_bytes())?;
    write_file(&stem.with_extension("png"), &png_of(&svg)?)
}

fn png_of(svg: &str) -> Result<Vec<u8>, Box<dyn Error>> {
    /// The scale of the PNG, which makes it sharp on screens of high resolution too.
    const SCALE: f32 = 1.5;
    let mut options = usvg::Options::default();
    options.fontdb_mut().load_font_data(dejavu::sans::regular().to_vec());
    options.fontdb_mut().set_sans_serif_family("DejaVu Sans");
    let tree = usvg::Tree::from_str(svg, &options)?;
    let size = tree.size().to_int_size().scale_by(SCALE).ok_or("a picture without area")?;
    let mut pixels = tiny_skia::Pixmap::new(size.width(), size.height()).ok_or("a picture without area")?;
    resvg::render(&tree, tiny_skia::Transform::from_scale(SCALE, SCALE), &mut pixels.as_mut());
    Ok(pixels.encode_png()?)
}

/// Returns a text style of so many pixels.
fn text(size: u32) -> TextStyle<'static> {
    (FONT, size).into_font().color(&BLACK)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_is_written_twice_and_its_text_is_drawn_without_fonts_of_the_machine() {
        let stem = std::env::temp_dir().join(format!("dcd-benches-picture-{}", std::process::id()));
        let picture = |title: &str| HeatMaps {
            title: title.into(),
            caption: String::new(),
            x_label: String::new(),
            y_label: String::new(),
            scale_label: String::new(),
            scale: (0.1, 1.0),
            columns: 1,
            maps: vec![HeatMap {
                title: String::new(),
                columns: vec![String::new()],
                rows: vec![String::new()],
                values: vec![vec![Some(0.5)]],
            }],
        };
        let pngs = ["", "Title"].map(|title| {
            write(&picture(title), &stem).unwrap();
            assert!(std::fs::read_to_string(stem.with_extension("svg")).unwrap().contains(title));
            std::fs::read(stem.with_extension("png")).unwrap()
        });
        for ending in ["svg", "png"] {
            std::fs::remove_file(stem.with_extension(ending)).unwrap();
        }
        assert!(pngs[0].starts_with(b"\x89PNG"));
        assert_ne!(pngs[0], pngs[1], "the title leaves a trace");
    }
}
