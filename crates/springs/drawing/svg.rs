//! SVG as a backend of plotters that draws between pixels, and joins lines of one style.

use plotters_backend::text_anchor::{HPos, VPos};
use plotters_backend::{
    BackendColor, BackendCoord, BackendStyle, BackendTextStyle, DrawingBackend, DrawingErrorKind,
    FontStyle, FontTransform,
};
use std::fmt::{Error, Write as _};

/// A picture as it grows. Coordinates, widths and sizes of fonts are in parts of a pixel.
pub(crate) struct Svg<'a> {
    text: &'a mut String,
    size: (u32, u32),
    /// Units in a pixel.
    fineness: u32,
    /// Lines of one style that follow each other, as one path.
    lines: Option<Lines>,
}

struct Lines {
    stroke: String,
    path: String,
    /// Where it ends.
    end: BackendCoord,
}

type Result<T = ()> = std::result::Result<T, DrawingErrorKind<Error>>;

/// Plotters means the height of a line by the size of a font.
const LINE_HEIGHT: f64 = 1.24;

impl<'a> Svg<'a> {
    /// Begins a picture of this size in pixels, with so many units in a pixel.
    pub(super) fn begin(text: &'a mut String, (width, height): (u32, u32), fineness: u32) -> Self {
        write!(
            text,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
             viewBox=\"0 0 {width} {height}\" fill=\"none\" stroke-linecap=\"round\" \
             stroke-linejoin=\"round\">\n\
             <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n"
        )
        .expect("writing to a string");
        Self {
            text,
            size: (width * fineness, height * fineness),
            fineness,
            lines: None,
        }
    }

    /// A number in pixels, with no more digits than the unit has.
    fn pixels(&self, units: f64) -> String {
        let pixels = units / f64::from(self.fineness);
        let digits = self.fineness.ilog10() as usize;
        let text = format!("{pixels:.digits$}");
        match text.strip_suffix(".0") {
            Some(whole) => whole.to_owned(),
            None => text,
        }
    }

    fn point(&self, (x, y): BackendCoord) -> [String; 2] {
        [x, y].map(|units| self.pixels(f64::from(units)))
    }

    /// Writes what is complete.
    fn element(&mut self, element: std::fmt::Arguments<'_>) -> Result {
        self.finish_lines()?;
        self.write(element)
    }

    fn write(&mut self, element: std::fmt::Arguments<'_>) -> Result {
        let written = self.text.write_fmt(element);
        written.map_err(DrawingErrorKind::DrawingError)?;
        self.text.push('\n');
        Ok(())
    }

    fn finish_lines(&mut self) -> Result {
        match self.lines.take() {
            Some(Lines { stroke, path, .. }) => {
                self.write(format_args!("<path {stroke} d=\"{path}\"/>"))
            }
            None => Ok(()),
        }
    }

    /// Attributes of lines.
    fn stroke(&self, style: &impl BackendStyle) -> String {
        let width = self.pixels(f64::from(style.stroke_width()));
        format!(
            "stroke=\"{}\" stroke-width=\"{width}\"{}",
            colour(style.color()),
            opacity(style.color())
        )
    }

    /// Attributes of an area.
    fn paint(&self, style: &impl BackendStyle, is_filled: bool) -> String {
        if is_filled {
            let (fill, opacity) = (colour(style.color()), opacity(style.color()));
            format!("fill=\"{fill}\"{opacity}")
        } else {
            self.stroke(style)
        }
    }
}

fn colour(colour: BackendColor) -> String {
    let (r, g, b) = colour.rgb;
    format!("#{r:02x}{g:02x}{b:02x}")
}

fn opacity(colour: BackendColor) -> String {
    if colour.alpha == 1.0 {
        String::new()
    } else {
        format!(" opacity=\"{}\"", colour.alpha)
    }
}

/// Text as the content of an XML element.
fn escape(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
}

impl DrawingBackend for Svg<'_> {
    type ErrorType = Error;

    fn get_size(&self) -> (u32, u32) {
        self.size
    }

    fn ensure_prepared(&mut self) -> Result {
        Ok(())
    }

    /// Completes the picture.
    fn present(&mut self) -> Result {
        self.element(format_args!("</svg>"))
    }

    fn draw_pixel(&mut self, point: BackendCoord, color: BackendColor) -> Result {
        self.draw_rect(point, (point.0 + 1, point.1 + 1), &color, true)
    }

    fn draw_line<S: BackendStyle>(
        &mut self,
        from: BackendCoord,
        to: BackendCoord,
        style: &S,
    ) -> Result {
        self.draw_path([from, to], style)
    }

    fn draw_path<S: BackendStyle, I: IntoIterator<Item = BackendCoord>>(
        &mut self,
        path: I,
        style: &S,
    ) -> Result {
        let mut points = path.into_iter();
        let Some(first) = points.next().filter(|_| style.color().alpha > 0.0) else {
            return Ok(());
        };
        let stroke = self.stroke(style);
        // Of what can be seen through, each line shows.
        let goes_on = style.color().alpha == 1.0
            && self
                .lines
                .as_ref()
                .is_some_and(|lines| lines.stroke == stroke);
        if !goes_on {
            self.finish_lines()?;
        }
        let (mut path, end) = match self.lines.take() {
            Some(lines) => (lines.path, Some(lines.end)),
            None => (String::new(), None),
        };
        if end != Some(first) {
            let [x, y] = self.point(first);
            path += &format!("M{x} {y}");
        }
        let mut end = first;
        for point in points {
            let [x, y] = self.point(point);
            path += &format!("L{x} {y}");
            end = point;
        }
        self.lines = Some(Lines { stroke, path, end });
        Ok(())
    }

    fn draw_rect<S: BackendStyle>(
        &mut self,
        upper_left: BackendCoord,
        bottom_right: BackendCoord,
        style: &S,
        fill: bool,
    ) -> Result {
        let [x, y] = self.point(upper_left);
        let size = (bottom_right.0 - upper_left.0, bottom_right.1 - upper_left.1);
        let [width, height] = self.point(size);
        let paint = self.paint(style, fill);
        self.element(format_args!(
            "<rect x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" {paint}/>"
        ))
    }

    fn draw_circle<S: BackendStyle>(
        &mut self,
        center: BackendCoord,
        radius: u32,
        style: &S,
        fill: bool,
    ) -> Result {
        let [x, y] = self.point(center);
        let radius = self.pixels(f64::from(radius));
        let paint = self.paint(style, fill);
        self.element(format_args!(
            "<circle cx=\"{x}\" cy=\"{y}\" r=\"{radius}\" {paint}/>"
        ))
    }

    fn fill_polygon<S: BackendStyle, I: IntoIterator<Item = BackendCoord>>(
        &mut self,
        vert: I,
        style: &S,
    ) -> Result {
        let points = vert.into_iter().map(|point| self.point(point).join(","));
        let points: Vec<String> = points.collect();
        let paint = self.paint(style, true);
        self.element(format_args!(
            "<polygon points=\"{}\" {paint}/>",
            points.join(" ")
        ))
    }

    fn draw_text<S: BackendTextStyle>(
        &mut self,
        text: &str,
        style: &S,
        pos: BackendCoord,
    ) -> Result {
        let [x, y] = self.point(pos);
        let anchor = match style.anchor().h_pos {
            HPos::Left => "start",
            HPos::Center => "middle",
            HPos::Right => "end",
        };
        let down = match style.anchor().v_pos {
            VPos::Top => "0.76em",
            VPos::Center => "0.5ex",
            VPos::Bottom => "-0.5ex",
        };
        let turned = match style.transform() {
            FontTransform::None => String::new(),
            FontTransform::Rotate90 => format!(" transform=\"rotate(90 {x} {y})\""),
            FontTransform::Rotate180 => format!(" transform=\"rotate(180 {x} {y})\""),
            FontTransform::Rotate270 => format!(" transform=\"rotate(270 {x} {y})\""),
        };
        let weight = match style.style() {
            FontStyle::Bold => " font-weight=\"bold\"",
            FontStyle::Italic | FontStyle::Oblique => " font-style=\"italic\"",
            FontStyle::Normal => "",
        };
        let size = self.pixels(style.size() / LINE_HEIGHT);
        let paint = self.paint(&style.color(), true);
        let (family, text) = (style.family().as_str().to_owned(), escape(text));
        self.element(format_args!(
            "<text x=\"{x}\" y=\"{y}\" dy=\"{down}\" text-anchor=\"{anchor}\" \
             font-family=\"{family}\" font-size=\"{size}\"{weight} {paint}{turned}>{text}</text>"
        ))
    }
}
