//! Pictures: from memory, or from files below the asset root.

use super::files::below;
use super::problem::Problems;
use super::read::Reader;
use glam::{Affine2, Vec2};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Weak};
use umbriel_fields::{Graph, NodeId};
use umbriel_scene::{Filter, Image, Sampler, TextureRef, Wrap};

/// Widest and highest picture that is read from a file, pixels.
const MAX_SIDE: u32 = 16_384;
/// Most memory that decoding one file may take, bytes.
const MAX_BYTES: u64 = 1 << 30;

/// Pictures in use, so that textures of the same picture share it.
pub(super) struct Pictures {
    pub(super) asset_root: PathBuf,
    files: HashMap<PathBuf, Weak<Image>>,
    /// By the address of the texels; a live entry keeps the address taken.
    memory: HashMap<usize, Weak<Image>>,
}

impl Pictures {
    pub(super) fn new(asset_root: PathBuf) -> Pictures {
        Pictures { asset_root, files: HashMap::new(), memory: HashMap::new() }
    }

    /// Forgets pictures that nobody uses.
    pub(super) fn sweep(&mut self) {
        self.files.retain(|_, image| image.strong_count() > 0);
        self.memory.retain(|_, image| image.strong_count() > 0);
    }

    fn of_memory(&mut self, image: &umbriel_fields::Image) -> Result<Arc<Image>, String> {
        let (width, height) = (image.width, image.height);
        let expected = 4 * width as usize * height as usize;
        if expected == 0 || image.rgba.len() != expected {
            let found = image.rgba.len();
            return Err(format!("a picture of {width} x {height} needs {expected} bytes (more than none), it has {found}"));
        }
        let address = image.rgba.as_ptr() as usize;
        let known = self.memory.get(&address).and_then(Weak::upgrade);
        if let Some(known) = known.filter(|k| (k.width, k.height) == (width, height)) {
            return Ok(known);
        }
        let shared = Arc::new(Image { width, height, rgba: image.rgba.clone() });
        self.memory.insert(address, Arc::downgrade(&shared));
        Ok(shared)
    }

    fn of_file(&mut self, url: &str) -> Result<Arc<Image>, String> {
        let path = below(&self.asset_root, url)?;
        if let Some(known) = self.files.get(&path).and_then(Weak::upgrade) {
            return Ok(known);
        }
        let image = Arc::new(decode(&path).map_err(|e| format!("file '{url}': {e}"))?);
        self.files.insert(path, Arc::downgrade(&image));
        Ok(image)
    }
}

pub(crate) fn decode(path: &Path) -> Result<Image, String> {
    let mut reader = image::ImageReader::open(path).and_then(|r| r.with_guessed_format()).map_err(|e| e.to_string())?;
    let mut limits = image::Limits::default();
    limits.max_image_width = Some(MAX_SIDE);
    limits.max_image_height = Some(MAX_SIDE);
    limits.max_alloc = Some(MAX_BYTES);
    reader.limits(limits);
    let rgba = reader.decode().map_err(|e| e.to_string())?.into_rgba8();
    Ok(Image { width: rgba.width(), height: rgba.height(), rgba: rgba.into_raw().into() })
}

/// The texture that a field of a material names. A missing or broken picture is reported; the surface goes without.
pub(super) fn texture(
    graph: &Graph,
    material: &Reader<'_>,
    field: &str,
    pictures: &mut Pictures,
    problems: &mut Problems,
    deps: &mut Vec<NodeId>,
) -> Option<TextureRef> {
    let node = material.node(field)?;
    deps.push(node);
    texture_of(graph, node, pictures, problems)
}

/// The texture that an ImageTexture is. What is broken is reported.
pub(super) fn texture_of(graph: &Graph, node: NodeId, pictures: &mut Pictures, problems: &mut Problems) -> Option<TextureRef> {
    let read = Reader::new(graph, node);
    let image = picture(&read, pictures, problems, "the surface is shown without it");
    let uv_from_mesh = uv_from_mesh(&read);
    problems.set(
        graph,
        node,
        "translation",
        uv_from_mesh.is_none().then(|| "translation, rotation or scale is not finite; left out".into()),
    );
    Some(TextureRef {
        image: image?,
        sampler: sampler(&read),
        uv_set: read.get::<i32>("uv_set").clamp(0, 1) as u8,
        uv_from_mesh: uv_from_mesh.unwrap_or(Affine2::IDENTITY),
    })
}

/// The picture of an ImageTexture. One that is missing or broken is reported, with what comes of it.
pub(super) fn picture(read: &Reader<'_>, pictures: &mut Pictures, problems: &mut Problems, instead: &str) -> Option<Arc<Image>> {
    let url: Arc<str> = read.get("url");
    let memory: Option<Arc<umbriel_fields::Image>> = read.get("image");
    let (field, image) = match (&memory, &*url) {
        (Some(image), _) => ("image", pictures.of_memory(image)),
        (None, "") => ("image", Err(format!("neither image nor url is set; {instead}"))),
        (None, url) => ("url", pictures.of_file(url).map_err(|e| format!("{e}; {instead}"))),
    };
    for each in ["image", "url"] {
        problems.set(read.graph, read.node, each, image.as_ref().err().filter(|_| each == field).cloned());
    }
    image.ok()
}

/// KHR_texture_transform: u' = T R S u, turning counter-clockwise as seen, where v is down.
fn uv_from_mesh(read: &Reader<'_>) -> Option<Affine2> {
    let (translation, scale): (Vec2, Vec2) = (read.get("translation"), read.get("scale"));
    let transform = Affine2::from_scale_angle_translation(scale, -read.get::<f32>("rotation"), translation);
    transform.is_finite().then_some(transform)
}

fn sampler(read: &Reader<'_>) -> Sampler {
    let wrap = |field: &str| [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp, Wrap::Clamp][read.choice(field).min(3) as usize];
    Sampler {
        wrap_u: wrap("wrap_s"),
        wrap_v: wrap("wrap_t"),
        filter: if read.choice("filter") == 1 { Filter::Nearest } else { Filter::Linear },
        mip_maps: read.get("mip_maps"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn broken_and_missing_files_are_errors() {
        let folder = std::env::temp_dir().join(format!("umbriel-pictures-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        std::fs::write(folder.join("broken.png"), b"\x89PNG\r\n\x1a\nno").unwrap();
        let good = image::RgbaImage::from_pixel(3, 2, image::Rgba([1, 2, 3, 4]));
        good.save(folder.join("good.png")).unwrap();
        let mut pictures = Pictures::new(folder.clone());
        assert!(pictures.of_file("broken.png").unwrap_err().contains("broken.png"));
        assert!(pictures.of_file("missing.png").unwrap_err().contains("missing.png"));
        let image = pictures.of_file("good.png").unwrap();
        assert_eq!((image.width, image.height, &image.rgba[..4]), (3, 2, &[1, 2, 3, 4][..]));
        assert!(Arc::ptr_eq(&image, &pictures.of_file("good.png").unwrap()));
        std::fs::remove_dir_all(folder).unwrap();
    }
}
