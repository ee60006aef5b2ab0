//! What a uri of a model means: bytes inside it, or a file below the asset root.

use std::borrow::Cow;
use std::io::Read;
use std::path::{Component, Path, PathBuf};

/// The folders in which a model may read.
pub(crate) struct Place {
    /// Where the model file lies; uris are relative to it.
    folder: PathBuf,
    /// Nothing outside of it is read.
    root: PathBuf,
}

impl Place {
    /// Of a model file. Without `asset_root`, the root is the file's folder.
    pub(crate) fn of(file: &Path, asset_root: Option<&Path>) -> std::io::Result<Place> {
        let folder = file.canonicalize()?.parent().map(Path::to_owned).unwrap_or_default();
        let root = asset_root.map_or_else(|| Ok(folder.clone()), Path::canonicalize)?;
        Ok(Place { folder, root })
    }

    /// The bytes behind `uri`, at most `limit` of them; the error completes the sentence "uri ... ".
    pub(crate) fn read(&self, uri: &str, limit: u64) -> Result<Vec<u8>, String> {
        match uri.strip_prefix("data:") {
            Some(data) => decode_data(data),
            None => self.read_file(uri, limit),
        }
    }

    fn read_file(&self, uri: &str, limit: u64) -> Result<Vec<u8>, String> {
        let path = self.resolve(uri)?;
        let unreadable = |e: std::io::Error| format!("cannot be read: {e}");
        let file = std::fs::File::open(&path).map_err(unreadable)?;
        if !file.metadata().map_err(unreadable)?.is_file() {
            return Err("is not a file".into());
        }
        let mut bytes = Vec::new();
        file.take(limit.saturating_add(1)).read_to_end(&mut bytes).map_err(unreadable)?;
        if bytes.len() as u64 > limit { Err(format!("has more than the {limit} bytes that are left for it")) } else { Ok(bytes) }
    }

    fn resolve(&self, uri: &str) -> Result<PathBuf, String> {
        if let Some((scheme, _)) = uri.split_once(':').filter(|(s, _)| is_scheme(s)) {
            return Err(format!("has the scheme '{scheme}'; only data and files beside the model are read"));
        }
        let decoded = urlencoding::decode(uri).map_err(|_| "is not UTF-8 when its percent signs are decoded")?;
        let relative = decoded.replace('\\', "/"); // written by exporters on Windows
        if relative.starts_with('/') {
            return Err("is absolute; only files below the asset root are read".into());
        }
        // Before the file system is asked: whether something exists outside is nobody's business.
        let path = normalize(&self.folder.join(relative));
        if !path.starts_with(&self.root) {
            return Err(format!("leads out of the asset root {}", self.root.display()));
        }
        let real = path.canonicalize().map_err(|e| match e.kind() {
            std::io::ErrorKind::NotFound => "names a file that does not exist".to_owned(),
            _ => format!("cannot be read: {e}"),
        })?;
        if !real.starts_with(&self.root) {
            return Err(format!("leads through a link out of the asset root {}", self.root.display()));
        }
        Ok(real)
    }
}

fn is_scheme(text: &str) -> bool {
    text.starts_with(|c: char| c.is_ascii_alphabetic()) && text.chars().all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c))
}

/// `path` without `.` and `..`.
fn normalize(path: &Path) -> PathBuf {
    let mut out = PathBuf::new();
    for component in path.components() {
        match component {
            Component::CurDir => {}
            Component::ParentDir => {
                out.pop();
            }
            other => out.push(other),
        }
    }
    out
}

/// Decodes what follows `data:` (RFC 2397).
fn decode_data(data: &str) -> Result<Vec<u8>, String> {
    let (kind, body) = data.split_once(',').ok_or("has no comma between media type and data")?;
    if kind.ends_with(";base64") {
        let body: Cow<'_, str> =
            if body.contains(|c: char| c.is_ascii_whitespace()) { body.split_ascii_whitespace().collect() } else { body.into() };
        base64::decode(body.as_bytes()).map_err(|e| format!("is not base64: {e}"))
    } else {
        Ok(urlencoding::decode_binary(body.as_bytes()).into_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn uris_stay_below_the_root() {
        let base = std::env::temp_dir().join(format!("umbriel-uri-{}", std::process::id()));
        let models = base.join("models");
        std::fs::create_dir_all(models.join("my textures")).unwrap();
        std::fs::write(models.join("a.gltf"), "{}").unwrap();
        std::fs::write(models.join("my textures/t.bin"), "inside").unwrap();
        std::fs::write(base.join("secret.bin"), "outside").unwrap();
        #[cfg(unix)]
        let _ = std::os::unix::fs::symlink(base.join("secret.bin"), models.join("link.bin"));
        let narrow = Place::of(&models.join("a.gltf"), None).unwrap();
        let wide = Place::of(&models.join("a.gltf"), Some(&base)).unwrap();
        for (uri, in_folder, in_root) in [
            ("my%20textures/t.bin", Ok("inside"), Ok("inside")),
            ("my textures\\t.bin", Ok("inside"), Ok("inside")),
            ("./my textures/../my textures/t.bin", Ok("inside"), Ok("inside")),
            ("../secret.bin", Err("out of the asset root"), Ok("outside")),
            ("%2e%2e/secret.bin", Err("out of the asset root"), Ok("outside")),
            ("..\\secret.bin", Err("out of the asset root"), Ok("outside")),
            ("../../../../../../etc/passwd", Err("out of the asset root"), Err("out of the asset root")),
            ("/etc/passwd", Err("is absolute"), Err("is absolute")),
            ("file:///etc/passwd", Err("scheme 'file'"), Err("scheme 'file'")),
            ("http://example.org/t.bin", Err("scheme 'http'"), Err("scheme 'http'")),
            ("gone.bin", Err("does not exist"), Err("does not exist")),
            ("my textures", Err("not a file"), Err("not a file")),
            #[cfg(unix)]
            ("link.bin", Err("through a link"), Ok("outside")),
            ("data:application/octet-stream;base64,aGk=", Ok("hi"), Ok("hi")),
            ("data:;base64,aG k=", Ok("hi"), Ok("hi")),
            ("data:text/plain,h%69", Ok("hi"), Ok("hi")),
            ("data:;base64,a?", Err("not base64"), Err("not base64")),
            ("data:nothing", Err("no comma"), Err("no comma")),
            ("%ff%fe", Err("not UTF-8"), Err("not UTF-8")),
        ] {
            for (place, expected) in [(&narrow, in_folder), (&wide, in_root)] {
                match (place.read(uri, 1000), expected) {
                    (Ok(bytes), Ok(text)) => assert_eq!(bytes, text.as_bytes(), "{uri}"),
                    (Err(why), Err(part)) => assert!(why.contains(part), "{uri}: {why}"),
                    (got, _) => panic!("{uri}: {got:?} where {expected:?} was expected"),
                }
            }
        }
        assert!(narrow.read("my textures/t.bin", 5).unwrap_err().contains("more than the 5 bytes"));
        std::fs::remove_dir_all(&base).unwrap();
    }
}
