//! What all pictures are drawn with: plotters, on SVG of our own, which draws between pixels.

mod svg;

use plotters::coord::Shift;
use plotters::prelude::*;
use svg::Svg;

/// A part of a picture.
pub(crate) type Area<'a> = DrawingArea<Svg<'a>, Shift>;
/// Drawing into memory does not fail.
pub(crate) type Drawn = Result<(), DrawingAreaErrorKind<std::fmt::Error>>;

/// Colours that the colour-blind tell apart (after Okabe and Ito), darkest first
/// for print.
pub(crate) const COLOURS: [RGBColor; 10] = [
    RGBColor(0, 0, 0),
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(120, 120, 120),
    RGBColor(110, 60, 20),
    RGBColor(150, 150, 0),
];

/// Units in a pixel of a [`fine`] picture.
pub(crate) const FINE: u32 = 10;

/// A picture of this size in pixels, drawn in whole pixels on white.
pub(crate) fn picture(size: (u32, u32), draw: impl FnOnce(&Area<'_>) -> Drawn) -> String {
    with_fineness(size, 1, draw)
}

/// A picture of this size in pixels, drawn on white in tenths of a pixel, as sizes of fonts are.
pub(crate) fn fine(size: (u32, u32), draw: impl FnOnce(&Area<'_>) -> Drawn) -> String {
    with_fineness(size, FINE, draw)
}

fn with_fineness(size: (u32, u32), fineness: u32, draw: impl FnOnce(&Area<'_>) -> Drawn) -> String {
    let mut svg = String::new();
    {
        let root = Svg::begin(&mut svg, size, fineness).into_drawing_area();
        draw(&root).expect("drawing into memory");
        root.present().expect("drawing into memory");
    }
    svg
}

/// A point of a [`fine`] picture, in pixels.
pub(crate) fn at(x: f64, y: f64) -> (i32, i32) {
    let units = |pixels: f64| (pixels * f64::from(FINE)).round() as i32;
    (units(x), units(y))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_of_one_style_are_one_path_between_pixels() {
        let svg = fine((20, 10), |root| {
            let thin = BLACK.stroke_width(5);
            for y in [1.0, 2.25] {
                root.draw(&PathElement::new([at(0.0, y), at(10.0, y)], thin))?;
            }
            root.draw(&PathElement::new([at(10.0, 2.25), at(0.0, 0.0)], thin))?;
            root.draw(&PathElement::new([at(0.0, 0.0), at(1.0, 1.0)], RED))?;
            root.draw(&Text::new("a < b & c", at(1.0, 2.0), ("sans-serif", 124)))
        });
        for part in [
            "width=\"20\" height=\"10\" viewBox=\"0 0 20 10\"",
            "stroke=\"#000000\" stroke-width=\"0.5\"",
            "d=\"M0 1L10 1M0 2.3L10 2.3L0 0\"",
            "d=\"M0 0L1 1\"",
            "font-size=\"10\" fill=\"#000000\">a &lt; b &amp; c</text>",
        ] {
            assert!(svg.contains(part), "{part} in\n{svg}");
        }
        assert!(svg.ends_with("</svg>\n"));
    }
}
