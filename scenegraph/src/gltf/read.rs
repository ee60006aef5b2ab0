//! A model file with its buffers and pictures, read and checked, before anything is built from it.

use super::LoadOptions;
use super::budget::Budget;
use super::container::{Parsed, UvTransform};
use super::error::{Cause, Fault, label, shorten};
use super::uri::Place;
use super::{check, container};
use gltf::Document;
use gltf::json::{self, Root};
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

/// A decoded picture: RGBA, 8 bit, rows from the top.
pub(crate) type Picture = umbriel_fields::Image;

/// Everything that a model file says, with all references checked.
pub(crate) struct Source {
    pub(crate) document: Document,
    /// One per buffer of the document, as long as it says.
    pub(crate) buffers: Vec<Vec<u8>>,
    /// One per image of the document; none where it could not be had.
    pub(crate) pictures: Vec<Option<Arc<Picture>>>,
    /// Of the normal texture of each material.
    pub(crate) normal_transforms: Vec<Option<UvTransform>>,
    /// Of the occlusion texture of each material.
    pub(crate) occlusion_transforms: Vec<Option<UvTransform>>,
    /// What was left out, as `object: message`.
    pub(crate) warnings: Vec<String>,
}

/// Reads and checks a file.
pub(crate) fn read(file: &Path, options: &LoadOptions, budget: &Budget) -> Result<Source, Fault> {
    let whole = |cause| Fault::new("", cause);
    let unreadable = |e: std::io::Error| whole(Cause::Unreadable(e.to_string()));
    let place = Place::of(file, options.asset_root.as_deref()).map_err(unreadable)?;
    let meta = std::fs::metadata(file).map_err(unreadable)?;
    if !meta.is_file() {
        return Err(whole(Cause::Unreadable("it is not a file".into())));
    }
    budget.take(meta.len(), "the file")?;
    let bytes = std::fs::read(file).map_err(unreadable)?;
    let parts = container::split(&bytes).map_err(whole)?;
    let Parsed { root, normal_transforms, occlusion_transforms } = container::parse(&bytes[parts.json.clone()]).map_err(whole)?;
    let mut warnings = check::check(&root)?;
    let buffers = read_buffers(&root, &bytes, parts.binary, &place, budget)?;
    check::check_views(&root, &buffers)?;
    let pictures = root
        .images
        .iter()
        .enumerate()
        .map(|(i, image)| {
            let read = read_picture(&root, image, &buffers, &place, budget);
            read.map_err(|why| warnings.push(format!("{}: {why}; the model is loaded without it", image_label(&root, i)))).ok()
        })
        .collect();
    let document = Document::from_json_without_validation(root);
    Ok(Source { document, buffers, pictures, normal_transforms, occlusion_transforms, warnings })
}

fn read_buffers(
    root: &Root,
    file: &[u8],
    binary: Option<Range<usize>>,
    place: &Place,
    budget: &Budget,
) -> Result<Vec<Vec<u8>>, Fault> {
    let mut buffers = Vec::new();
    for (i, buffer) in root.buffers.iter().enumerate() {
        let object = label("buffer", i, buffer.name.as_deref());
        let bytes = match (&buffer.uri, &binary) {
            (Some(uri), _) => {
                place.read(uri, budget.left()).map_err(|why| Fault::new(object.clone(), Cause::Uri { uri: shorten(uri), why }))?
            }
            (None, Some(range)) if i == 0 => file[range.clone()].to_vec(),
            (None, _) => {
                let compressed = root.extensions_used.iter().find(|e| e.contains("compression"));
                let hint = compressed.map(|e| format!("; the file uses {e}, which is not supported")).unwrap_or_default();
                return Err(Fault::data(object, format!("has no uri and there is no binary chunk for it{hint}")));
            }
        };
        budget.take(bytes.len() as u64, &object)?;
        let needed = buffer.byte_length.0;
        if (bytes.len() as u64) < needed {
            return Err(Fault::data(object, format!("has {} bytes where its byteLength says {needed}", bytes.len())));
        }
        buffers.push(bytes);
    }
    Ok(buffers)
}

/// `image 0 'wood' (wood.png) of texture 2`.
fn image_label(root: &Root, index: usize) -> String {
    let image = &root.images[index];
    let mut text = label("image", index, image.name.as_deref());
    if let Some(uri) = &image.uri {
        text += &format!(" ({})", shorten(uri));
    }
    if let Some(t) = root.textures.iter().position(|t| t.source.value() == index) {
        text += &format!(" of {}", label("texture", t, root.textures[t].name.as_deref()));
    }
    text
}

fn read_picture(
    root: &Root,
    image: &json::Image,
    buffers: &[Vec<u8>],
    place: &Place,
    budget: &Budget,
) -> Result<Arc<Picture>, String> {
    match (&image.uri, image.buffer_view) {
        (Some(uri), _) => decode(&place.read(uri, budget.left()).map_err(|why| format!("its uri {why}"))?, budget),
        (None, Some(view)) => {
            let view = &root.buffer_views[view.value()];
            let start = view.byte_offset.unwrap_or_default().0 as usize;
            decode(&buffers[view.buffer.value()][start..start + view.byte_length.0 as usize], budget)
        }
        (None, None) => Err("it has neither uri nor bufferView".into()),
    }
}

/// Largest width and height of a picture, pixels.
const MAX_SIDE: u32 = 16384;

fn decode(bytes: &[u8], budget: &Budget) -> Result<Arc<Picture>, String> {
    let reader = || -> Result<_, String> {
        let cursor = std::io::Cursor::new(bytes);
        let mut reader = image::ImageReader::new(cursor).with_guessed_format().map_err(|e| e.to_string())?;
        if !matches!(reader.format(), Some(image::ImageFormat::Png | image::ImageFormat::Jpeg)) {
            return Err("it is neither PNG nor JPEG".into());
        }
        let mut limits = image::Limits::default();
        limits.max_image_width = Some(MAX_SIDE);
        limits.max_image_height = Some(MAX_SIDE);
        limits.max_alloc = Some(budget.left());
        reader.limits(limits);
        Ok(reader)
    };
    let unreadable = |e: image::ImageError| format!("it cannot be decoded: {e}");
    let (width, height) = reader()?.into_dimensions().map_err(unreadable)?;
    let size = 4 * u64::from(width) * u64::from(height);
    if width > MAX_SIDE || height > MAX_SIDE || size > budget.left() {
        return Err(format!("its {width} x {height} pixels are too many"));
    }
    let rgba = reader()?.decode().map_err(unreadable)?.into_rgba8();
    budget.take(size, "").map_err(|f| f.cause.to_string())?;
    Ok(Arc::new(Picture { width, height, rgba: rgba.into_raw().into() }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures() {
        let mut png = Vec::new();
        let two = image::GrayImage::from_raw(2, 1, vec![10, 200]).unwrap();
        two.write_to(&mut std::io::Cursor::new(&mut png), image::ImageFormat::Png).unwrap();
        let picture = decode(&png, &Budget::new(1 << 20)).unwrap();
        assert_eq!((picture.width, picture.height, &picture.rgba[..]), (2, 1, &[10, 10, 10, 255, 200, 200, 200, 255][..]));
        let mut wide = png.clone();
        wide[16..20].copy_from_slice(&1_000_000u32.to_be_bytes()); // a bomb: the header claims a million columns
        for (bytes, budget, message) in [
            (&png[..40], 1 << 20, "cannot be decoded"),
            (&b"GIF89a"[..], 1 << 20, "neither PNG nor JPEG"),
            (&b""[..], 1 << 20, "neither PNG nor JPEG"),
            (&wide[..], 1 << 20, "it"),
            (&png[..], 7, "it"),
        ] {
            let why = decode(bytes, &Budget::new(budget)).unwrap_err();
            assert!(why.contains(message), "{why}");
        }
    }
}
