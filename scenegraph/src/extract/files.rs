//! Files that nodes name.

use std::path::{Component, Path, PathBuf};

/// The file that a relative address names; nothing outside of the root.
pub(crate) fn below(root: &Path, url: &str) -> Result<PathBuf, String> {
    let relative = Path::new(url);
    if relative.components().all(|c| matches!(c, Component::Normal(_) | Component::CurDir)) {
        Ok(root.join(relative))
    } else {
        Err(format!("file '{url}' is not below the asset root"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_file_outside_of_the_root() {
        for (url, fine) in
            [("a.png", true), ("./b/a.png", true), ("../a.png", false), ("b/../../a.png", false), ("/a.png", false)]
        {
            assert_eq!(below(Path::new("root"), url).is_ok(), fine, "{url}");
        }
    }
}
