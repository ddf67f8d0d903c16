//! One image file to 8-bit RGB: JPEG, PNG, Radiance HDR, OpenEXR.

use std::io::Cursor;

use image::{DynamicImage, ImageFormat, ImageReader, Limits};

/// The smallest width that is taken for a panorama.
const SMALLEST_WIDTH: u32 = 64;
const LARGEST_WIDTH: u32 = 32_768;
const LARGEST_ALLOCATION: u64 = 4 << 30;

/// A decoded panorama.
pub(super) struct Decoded {
    pub width: u32,
    pub height: u32,
    pub rgb: Vec<u8>,
}

/// Decodes the bytes of a panorama; high dynamic range is tone-mapped.
///
/// # Errors
/// A sentence that says why the file cannot be used: not an image, truncated, not 2:1, too small.
pub(super) fn decode(bytes: &[u8]) -> Result<Decoded, String> {
    let format = image::guess_format(bytes).map_err(|_| not_an_image(bytes))?;
    if !matches!(format, ImageFormat::Jpeg | ImageFormat::Png | ImageFormat::Hdr | ImageFormat::OpenExr) {
        return Err(format!("{format:?} files are not read; use JPEG, PNG, Radiance HDR or OpenEXR"));
    }
    if format == ImageFormat::Jpeg && is_truncated_jpeg(bytes) {
        return Err("the JPEG file is truncated: it has no end-of-image marker after its picture".to_owned());
    }
    let (width, height) = reader(bytes, format).into_dimensions().map_err(|e| explain(&e))?;
    check_shape(width, height)?;
    let image = reader(bytes, format).decode().map_err(|e| explain(&e))?;
    let rgb = match &image {
        DynamicImage::ImageRgb32F(_) | DynamicImage::ImageRgba32F(_) => tone_map(&image.to_rgb32f()),
        _ => image.into_rgb8().into_raw(),
    };
    Ok(Decoded { width, height, rgb })
}

fn reader(bytes: &[u8], format: ImageFormat) -> ImageReader<Cursor<&[u8]>> {
    let mut limits = Limits::default();
    limits.max_image_width = Some(LARGEST_WIDTH);
    limits.max_image_height = Some(LARGEST_WIDTH / 2);
    limits.max_alloc = Some(LARGEST_ALLOCATION);
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    reader.limits(limits);
    reader
}

fn explain(error: &image::ImageError) -> String {
    format!("it does not decode: {error}")
}

fn not_an_image(bytes: &[u8]) -> String {
    let what = match bytes {
        [] => "it is empty",
        _ if std::str::from_utf8(&bytes[..bytes.len().min(512)]).is_ok() => "it is a text file, not an image",
        _ => "it is no image of a known format",
    };
    format!("{what}; use JPEG, PNG, Radiance HDR or OpenEXR")
}

fn check_shape(width: u32, height: u32) -> Result<(), String> {
    if width != 2 * height {
        return Err(format!("it is {width} × {height} px; an equirectangular panorama is twice as wide as high"));
    }
    if width < SMALLEST_WIDTH {
        return Err(format!("it is {width} × {height} px; the smallest usable width is {SMALLEST_WIDTH} px"));
    }
    Ok(())
}

/// Within the compressed picture a marker's first byte is escaped, so the last end-of-image marker
/// must come after the last start-of-scan marker; decoders fill what is missing with grey.
fn is_truncated_jpeg(bytes: &[u8]) -> bool {
    let last = |marker: [u8; 2]| bytes.windows(2).rposition(|pair| pair == marker);
    last([0xff, 0xd9]) < last([0xff, 0xda])
}

/// Radiance to 8-bit sRGB: the log-average luminance becomes 18 % grey, highlights are compressed
/// by L/(1 + L) (Reinhard et al. 2002, equations 1 to 3), colours keep their ratios.
fn tone_map(image: &image::Rgb32FImage) -> Vec<u8> {
    let luminance = |p: &image::Rgb<f32>| {
        let [r, g, b] = p.0.map(|c| if c.is_finite() { c.max(0.0) } else { 0.0 });
        0.2126 * r + 0.7152 * g + 0.0722 * b
    };
    let n = (image.width() as f64 * image.height() as f64).max(1.0);
    let log_average = image.pixels().map(|p| libm::log(luminance(p) as f64 + 1e-6)).sum::<f64>() / n;
    let exposure = (0.18 / libm::exp(log_average)) as f32;
    let mut rgb = Vec::with_capacity(image.as_raw().len());
    for pixel in image.pixels() {
        let scale = exposure / (1.0 + exposure * luminance(pixel));
        rgb.extend(pixel.0.map(|c| srgb_code(if c.is_finite() { c.max(0.0) * scale } else { 0.0 })));
    }
    rgb
}

/// Linear [0, 1] to an 8-bit sRGB code (IEC 61966-2-1).
fn srgb_code(linear: f32) -> u8 {
    let encoded = match linear {
        x if x <= 0.003_130_8 => 12.92 * x,
        x => 1.055 * libm::powf(x.min(1.0), 1.0 / 2.4) - 0.055,
    };
    (encoded * 255.0 + 0.5) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    fn encode(width: u32, height: u32, format: ImageFormat) -> Vec<u8> {
        let image =
            image::RgbImage::from_fn(width, height, |x, y| image::Rgb([(x % 256) as u8, (y * 3 % 256) as u8, 90]));
        let mut bytes = Cursor::new(Vec::new());
        image.write_to(&mut bytes, format).unwrap();
        bytes.into_inner()
    }

    #[test]
    fn whole_files_decode() {
        for format in [ImageFormat::Png, ImageFormat::Jpeg] {
            let decoded = decode(&encode(128, 64, format)).unwrap();
            assert_eq!((decoded.width, decoded.height, decoded.rgb.len()), (128, 64, 3 * 128 * 64));
        }
    }

    #[test]
    fn a_truncated_file_is_refused_at_any_length() {
        for format in [ImageFormat::Png, ImageFormat::Jpeg] {
            let bytes = encode(128, 64, format);
            for keep in [2, 3, 4, 5, 7] {
                assert!(decode(&bytes[..bytes.len() * keep / 8]).is_err(), "{format:?} {keep}/8");
            }
        }
    }

    #[test]
    fn wrong_shapes_and_other_files_are_explained() {
        let said = |bytes: &[u8]| decode(bytes).err().unwrap();
        assert!(said(&encode(1, 1, ImageFormat::Png)).contains("twice as wide"));
        assert!(said(&encode(192, 64, ImageFormat::Png)).contains("192 × 64"));
        assert!(said(&encode(32, 16, ImageFormat::Png)).contains("smallest usable"));
        assert!(said(b"hello, this is text").contains("text file"));
        assert!(said(b"").contains("empty"));
        assert!(said(&[0, 159, 146, 150, 1, 2, 3]).contains("no image"));
    }

    #[test]
    fn high_dynamic_range_files_decode_to_the_same_picture() {
        let image = image::Rgb32FImage::from_fn(128, 64, |x, y| image::Rgb([x as f32 / 16.0, y as f32 / 8.0, 0.25]));
        let picture = |format: ImageFormat| {
            let mut bytes = Cursor::new(Vec::new());
            DynamicImage::ImageRgb32F(image.clone()).write_to(&mut bytes, format).unwrap();
            decode(&bytes.into_inner()).unwrap().rgb
        };
        let (hdr, exr) = (picture(ImageFormat::Hdr), picture(ImageFormat::OpenExr));
        let worst = hdr.iter().zip(&exr).map(|(a, b)| a.abs_diff(*b)).max();
        assert!(worst <= Some(6), "Radiance keeps eight bits of each channel's mantissa: {worst:?}");
        let bright = |x: usize, y: usize| exr[3 * (y * 128 + x)];
        assert!(bright(120, 32) > bright(60, 32) && bright(60, 32) > bright(4, 32), "red rises to the right");
    }

    #[test]
    fn tone_mapping_keeps_order_and_puts_the_average_at_mid_grey() {
        let image = image::Rgb32FImage::from_fn(64, 32, |x, _| image::Rgb([libm::powf(2.0, x as f32 / 8.0 - 4.0); 3]));
        let rgb = tone_map(&image);
        assert!(rgb[..3 * 64].chunks(3).map(|p| p[0]).is_sorted());
        let middle = rgb[3 * 32];
        assert!((100..=125).contains(&middle), "0.18/(1.18) in sRGB is 109, got {middle}");
    }
}
