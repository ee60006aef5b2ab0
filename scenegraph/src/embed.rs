//! Files that nodes name, put into the nodes: for a graph whose replicas have no files.

use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::Arc;

use umbriel_fields::{Changes, Graph, Image, NodeId, Revision};

use crate::extract::{decode, files::below};

/// Keeps what files hold in fields beside their addresses.
pub struct Embedder {
    root: PathBuf,
    /// Writes up to this one were looked at.
    mark: Revision,
    /// The address whose file a node holds.
    held: HashMap<NodeId, Arc<str>>,
    pictures: HashMap<PathBuf, Arc<Image>>,
}

impl Embedder {
    /// Files lie below `root`.
    pub fn new(root: impl Into<PathBuf>) -> Embedder {
        Embedder { root: root.into(), mark: 0, held: HashMap::new(), pictures: HashMap::new() }
    }

    /// Reads files that nodes name since the last time: pictures of ImageTextures into `image`, texts of FragmentShaders into `source`.
    /// What cannot be read stays with its address, and whoever draws it says what is wrong.
    /// Only nodes that `is_ours` says yes to are written.
    pub fn update(&mut self, graph: &mut Graph, is_ours: &dyn Fn(NodeId) -> bool) {
        let nodes = match graph.changes_since(self.mark) {
            Changes::Nodes(nodes) => nodes,
            Changes::All => graph.nodes().collect(),
        };
        for node in nodes {
            if !graph.contains(node) {
                self.held.remove(&node);
                continue;
            }
            if !is_ours(node) {
                continue;
            }
            match &*graph.type_of(node).name {
                "ImageTexture" => {
                    let is_empty = graph.get_named::<Option<Arc<Image>>>(node, "image").is_ok_and(|image| image.is_none());
                    if let Some(url) = self.wanted(graph, node, is_empty) {
                        let image = if url.is_empty() { None } else { self.picture(&url) };
                        self.put(graph, node, url, "image", image);
                    }
                }
                "FragmentShader" => {
                    let is_empty = graph.get_named::<Arc<str>>(node, "source").is_ok_and(|source| source.is_empty());
                    if let Some(url) = self.wanted(graph, node, is_empty) {
                        let text = below(&self.root, &url).ok().and_then(|path| std::fs::read_to_string(path).ok());
                        self.put(graph, node, url, "source", text.unwrap_or_default().as_str());
                    }
                }
                _ => {}
            }
        }
        self.mark = graph.revision();
    }

    /// The address of a node whose file it does not hold yet. What the node holds without us stays.
    fn wanted(&self, graph: &Graph, node: NodeId, is_empty: bool) -> Option<Arc<str>> {
        let url: Arc<str> = graph.get_named(node, "url").ok()?;
        let held = self.held.get(&node);
        let is_news = held.is_none_or(|held| *held != url);
        let is_free = is_empty || held.is_some_and(|held| !held.is_empty());
        (is_news && is_free && !(url.is_empty() && held.is_none())).then_some(url)
    }

    fn put(&mut self, graph: &mut Graph, node: NodeId, url: Arc<str>, field: &str, value: impl Into<umbriel_fields::Value>) {
        if graph.set_named(node, field, value).is_ok() {
            self.held.insert(node, url);
        }
    }

    /// Each file once, whoever names it.
    fn picture(&mut self, url: &str) -> Option<Arc<Image>> {
        let path = below(&self.root, url).ok()?;
        if let Some(known) = self.pictures.get(&path) {
            return Some(known.clone());
        }
        let read = decode(&path).ok()?;
        let image = Arc::new(Image { width: read.width, height: read.height, rgba: read.rgba });
        self.pictures.insert(path, image.clone());
        Some(image)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::new_graph;

    #[test]
    fn files_come_into_nodes() {
        let folder = std::env::temp_dir().join(format!("umbriel-embed-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        for (name, side) in [("a.png", 2), ("b.png", 3)] {
            image::RgbaImage::new(side, side).save(folder.join(name)).unwrap();
        }
        std::fs::write(folder.join("own.wgsl"), "// text").unwrap();
        let mut graph = new_graph();
        let (texture, other) = (graph.create("ImageTexture").unwrap(), graph.create("ImageTexture").unwrap());
        let shader = graph.create("FragmentShader").unwrap();
        graph.set_named(shader, "url", "own.wgsl").unwrap();
        let own = Arc::new(Image { width: 1, height: 1, rgba: vec![0; 4].into() });
        graph.set_named(other, "image", Some(own)).unwrap();
        graph.set_named(other, "url", "a.png").unwrap();
        let mut embedder = Embedder::new(&folder);
        let width =
            |graph: &Graph, node| graph.get_named::<Option<Arc<Image>>>(node, "image").unwrap().map_or(0, |image| image.width);
        // The address that is set, and how wide the picture is then.
        for (url, expected) in [("", 0), ("a.png", 2), ("b.png", 3), ("none.png", 0), ("../a.png", 0), ("a.png", 2), ("", 0)] {
            graph.set_named(texture, "url", url).unwrap();
            embedder.update(&mut graph, &|_| true);
            assert_eq!((width(&graph, texture), width(&graph, other)), (expected, 1), "{url}");
        }
        assert_eq!(&*graph.get_named::<Arc<str>>(shader, "source").unwrap(), "// text");
        std::fs::remove_dir_all(folder).unwrap();
    }
}
