//! A drawing as SVG text.

use std::fmt::Write as _;

use base64::Engine as _;

use super::drawing::{Anchor, Drawing, Point, Shape, Stroke};
use super::style::{Colour, PAPER};
use super::{Error, png};

/// Families with the widths of the embedded font come first.
const FAMILY: &str = "DejaVu Sans, Verdana, Arial, sans-serif";

/// The drawing as a stand-alone SVG; it has no ids, so that several can stand in one page.
pub fn render(drawing: &Drawing, label: &str) -> Result<String, Error> {
    let (w, h) = (number(drawing.width), number(drawing.height));
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{w}pt\" height=\"{h}pt\" viewBox=\"0 0 {w} {h}\" role=\"img\" \
         aria-label=\"{}\" font-family=\"{FAMILY}\">\n",
        escape(label)
    );
    let _ = writeln!(out, "<rect width=\"{w}\" height=\"{h}\" fill=\"{}\"/>", hex(PAPER));
    for shape in &drawing.shapes {
        draw(&mut out, shape)?;
    }
    out.push_str("</svg>\n");
    Ok(out)
}

fn draw(out: &mut String, shape: &Shape) -> Result<(), Error> {
    // Writing to a string cannot fail.
    let _ = match shape {
        Shape::Line { points, stroke } => {
            writeln!(out, "<polyline points=\"{}\" fill=\"none\"{}/>", list(points), pen(Some(*stroke)))
        }
        Shape::Polygon { points, fill, stroke } => {
            writeln!(out, "<polygon points=\"{}\" fill=\"{}\"{}/>", list(points), paint(*fill), pen(*stroke))
        }
        Shape::Veil { points, colour, opacity } => {
            let (points, fill, opacity) = (list(points), hex(*colour), number(*opacity));
            writeln!(out, "<polygon points=\"{points}\" fill=\"{fill}\" fill-opacity=\"{opacity}\"/>")
        }
        Shape::Circle { centre: (x, y), radius, fill, stroke } => {
            let (x, y, r) = (number(*x), number(*y), number(*radius));
            writeln!(out, "<circle cx=\"{x}\" cy=\"{y}\" r=\"{r}\" fill=\"{}\"{}/>", paint(*fill), pen(*stroke))
        }
        Shape::Text { at: (x, y), text, style } => {
            let anchor = match style.anchor {
                Anchor::Start => "",
                Anchor::Middle => " text-anchor=\"middle\"",
                Anchor::End => " text-anchor=\"end\"",
            };
            let weight = if style.bold { " font-weight=\"bold\"" } else { "" };
            let (x, y, size, fill) = (number(*x), number(*y), number(style.size), hex(style.colour));
            let text = escape(text);
            writeln!(
                out,
                "<text x=\"{x}\" y=\"{y}\" font-size=\"{size}\"{anchor}{weight} fill=\"{fill}\">{text}</text>"
            )
        }
        Shape::Picture { at, size, picture } => {
            let (w, h) = png::embedded_size(picture, *size);
            let bytes = png::encode(&png::resize(picture, w, h)?)?;
            let data = base64::engine::general_purpose::STANDARD.encode(bytes);
            let (x, y, w, h) = (number(at.0), number(at.1), number(size.0), number(size.1));
            writeln!(
                out,
                "<image x=\"{x}\" y=\"{y}\" width=\"{w}\" height=\"{h}\" preserveAspectRatio=\"none\" \
                 href=\"data:image/png;base64,{data}\"/>"
            )
        }
    };
    Ok(())
}

/// A coordinate with at most two decimals.
fn number(value: f64) -> String {
    let text = format!("{value:.2}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

fn list(points: &[Point]) -> String {
    points.iter().map(|(x, y)| format!("{},{}", number(*x), number(*y))).collect::<Vec<_>>().join(" ")
}

fn hex([r, g, b]: Colour) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

fn paint(fill: Option<Colour>) -> String {
    fill.map_or_else(|| "none".to_owned(), hex)
}

fn pen(stroke: Option<Stroke>) -> String {
    let Some(Stroke { colour, width, dash }) = stroke else { return String::new() };
    let mut text = format!(" stroke=\"{}\" stroke-width=\"{}\" stroke-linejoin=\"round\"", hex(colour), number(width));
    if let Some((on, off)) = dash {
        let _ = write!(text, " stroke-dasharray=\"{} {}\"", number(on), number(off));
    }
    text
}

/// `text` as it stands in XML text and attributes.
fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            // Control characters are not allowed in XML.
            c if c.is_control() => out.push(' '),
            c => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figures::drawing::Type;

    #[test]
    fn text_of_users_cannot_break_the_document() {
        let mut d = Drawing::new();
        d.text((1.0, 2.0), "a<b & \"c\"\u{1}", Type::PLAIN);
        d.end_at(10.0);
        let svg = render(&d, "x\"y").unwrap();
        assert!(svg.contains(">a&lt;b &amp; &quot;c&quot; </text>"), "{svg}");
        assert!(svg.contains("aria-label=\"x&quot;y\""));
    }

    #[test]
    fn numbers_are_short() {
        assert_eq!([1.0, 0.5, -0.001, 12.345, 100.0].map(number), ["1", "0.5", "0", "12.35", "100"].map(String::from));
    }
}
