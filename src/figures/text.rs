//! The embedded font: widths of text, lines of a paragraph, glyphs as pixels.

use std::sync::LazyLock;

use ab_glyph::{Font, FontRef, PxScale};

static REGULAR: &[u8] = include_bytes!("../assets/fonts/DejaVuSans-subset.ttf");
static BOLD: &[u8] = include_bytes!("../assets/fonts/DejaVuSans-Bold-subset.ttf");

static FONTS: LazyLock<Option<[FontRef<'static>; 2]>> =
    LazyLock::new(|| Some([FontRef::try_from_slice(REGULAR).ok()?, FontRef::try_from_slice(BOLD).ok()?]));

fn font(bold: bool) -> Option<&'static FontRef<'static>> {
    FONTS.as_ref().map(|fonts| &fonts[usize::from(bold)])
}

/// Width of one line of text, in the unit of `size` (the em).
pub fn width(text: &str, size: f64, bold: bool) -> f64 {
    let Some(font) = font(bold) else { return 0.0 };
    let em = font.units_per_em().unwrap_or(2048.0);
    let units: f64 = text.chars().map(|c| f64::from(font.h_advance_unscaled(font.glyph_id(c)))).sum();
    units * size / f64::from(em)
}

/// Breaks `text` into lines no wider than `limit`; a word that is wider by itself is cut.
pub fn wrap(text: &str, limit: f64, size: f64, bold: bool) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in text.split_whitespace().flat_map(|word| cut(word, limit, size, bold)) {
        let last = lines.len() - 1;
        let joined = if lines[last].is_empty() { word.clone() } else { format!("{} {word}", lines[last]) };
        if lines[last].is_empty() || width(&joined, size, bold) <= limit {
            lines[last] = joined;
        } else {
            lines.push(word);
        }
    }
    lines
}

/// Cuts a word into pieces no wider than `limit`, at `_` or `/` where there is one.
fn cut(word: &str, limit: f64, size: f64, bold: bool) -> Vec<String> {
    let mut pieces = Vec::new();
    let mut piece = String::new();
    for c in word.chars() {
        piece.push(c);
        if width(&piece, size, bold) > limit && piece.chars().count() > 1 {
            let at = piece[..piece.len() - c.len_utf8()].rfind(['_', '/', ',']).map(|i| i + 1);
            let rest = piece.split_off(at.unwrap_or(piece.len() - c.len_utf8()));
            pieces.push(std::mem::replace(&mut piece, rest));
        }
    }
    pieces.push(piece);
    pieces
}

/// `text`, shortened with an ellipsis until it is no wider than `limit`.
pub fn shorten(text: &str, limit: f64, size: f64, bold: bool) -> String {
    if width(text, size, bold) <= limit {
        return text.to_owned();
    }
    let mut kept: Vec<char> = text.chars().collect();
    while !kept.is_empty() {
        kept.pop();
        let candidate: String = kept.iter().collect::<String>().trim_end().to_owned() + "…";
        if width(&candidate, size, bold) <= limit {
            return candidate;
        }
    }
    String::new()
}

/// `text`, with its middle replaced by an ellipsis until it is no wider than `limit`: names often differ at the end.
pub fn shorten_middle(text: &str, limit: f64, size: f64, bold: bool) -> String {
    let letters: Vec<char> = text.chars().collect();
    let mut kept = letters.len();
    let mut candidate = text.to_owned();
    while kept > 0 && width(&candidate, size, bold) > limit {
        kept -= 1;
        let tail = kept * 2 / 5;
        let (head, end) = (letters[..kept - tail].iter(), letters[letters.len() - tail..].iter());
        candidate = head.chain([&'…']).chain(end).collect();
    }
    candidate
}

/// Calls `paint(x, y, coverage)` for every pixel of the text.
///
/// `x`, `y` is the left end of the baseline and `size` the em, in pixels; coverage is in [0, 1].
pub fn rasterise(text: &str, x: f64, y: f64, size: f64, bold: bool, mut paint: impl FnMut(i64, i64, f64)) {
    let Some(font) = font(bold) else { return };
    let em = font.units_per_em().unwrap_or(2048.0);
    // ab_glyph scales by the height of the font (ascent − descent), not by its em.
    let scale = PxScale::from(size as f32 * font.height_unscaled() / em);
    let mut pen = x;
    for c in text.chars() {
        let id = font.glyph_id(c);
        let glyph = id.with_scale_and_position(scale, ab_glyph::point(pen as f32, y as f32));
        if let Some(outline) = font.outline_glyph(glyph) {
            let corner = outline.px_bounds().min;
            let (left, top) = (corner.x as i64, corner.y as i64);
            outline.draw(|dx, dy, c| paint(left + i64::from(dx), top + i64::from(dy), f64::from(c)));
        }
        pen += f64::from(font.h_advance_unscaled(id)) * size / f64::from(em);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_font_has_every_sign_that_figures_use() {
        for bold in [false, true] {
            let font = font(bold).unwrap();
            for c in "fξΔ½²⁻⁵₀→←↓−–—×·≤≥≈±°…µ✓".chars() {
                assert_ne!(font.glyph_id(c).0, 0, "{c} (bold: {bold})");
            }
        }
    }

    #[test]
    fn width_is_the_sum_of_the_advances() {
        // fonttools: hmtx['H'] = 1540, hmtx['i'] = 569, unitsPerEm = 2048 in DejaVu Sans 2.37.
        assert!((width("Hi", 2048.0, false) - (1540.0 + 569.0)).abs() < 1e-9);
    }

    #[test]
    fn wrapped_lines_fit_and_lose_no_letter() {
        let text = "the ranking of 7 hyper-parameters is not stable averyveryveryverylongword_with_underscores end";
        for limit in [30.0, 60.0, 120.0] {
            let lines = wrap(text, limit, 7.5, false);
            assert!(lines.iter().all(|line| width(line, 7.5, false) <= limit), "{lines:?}");
            let letters = |s: &str| s.chars().filter(|c| !c.is_whitespace()).collect::<String>();
            assert_eq!(letters(&lines.concat()), letters(text));
        }
    }

    #[test]
    fn a_shortened_name_keeps_its_end() {
        let short = shorten_middle("activation_of_layer_12", 70.0, 7.5, false);
        assert!(short.starts_with("activat") && short.ends_with("_12") && width(&short, 7.5, false) <= 70.0, "{short}");
        assert_eq!(shorten_middle("layers", 70.0, 7.5, false), "layers");
        assert_eq!(shorten_middle("layers", 0.0, 7.5, false), "…");
    }

    #[test]
    fn text_stands_on_its_baseline() {
        let (mut top, mut bottom) = (i64::MAX, i64::MIN);
        rasterise("H", 10.0, 100.0, 50.0, false, |_, y, c| {
            if c > 0.5 {
                (top, bottom) = (top.min(y), bottom.max(y));
            }
        });
        // Capital height of DejaVu Sans: 1493 of 2048 units.
        assert_eq!(bottom, 99);
        assert!((100 - top - (50.0f64 * 1493.0 / 2048.0).round() as i64).abs() <= 1, "{top}");
    }
}
