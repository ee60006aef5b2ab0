//! `shadow_update: "next_frame_only"` where the process that may write to the graph draws nothing.

use umbriel_fields::{Changes, Graph, NodeId, Revision};
use umbriel_scenegraph::wants_map_once;

/// Lights whose map was asked for in the last frame only.
#[derive(Debug, Default)]
pub(super) struct MapsOnce {
    lights: Vec<NodeId>,
    seen: Revision,
}

impl MapsOnce {
    /// Before a frame: what was asked for in the last one is over.
    pub(super) fn end(&mut self, graph: &mut Graph) {
        self.seen = self.seen.min(graph.revision());
        for light in self.lights.drain(..) {
            // A light that was deleted since has no field to fall back.
            let _ = graph.set_named(light, "shadow_update", "none");
        }
    }

    /// After a frame: looks for what was asked for in it.
    pub(super) fn find(&mut self, graph: &Graph) {
        let written = match graph.changes_since(self.seen) {
            Changes::All => graph.nodes().collect(),
            Changes::Nodes(nodes) => nodes,
        };
        self.lights = written.into_iter().filter(|node| wants_map_once(graph, *node)).collect();
        self.seen = graph.revision();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use umbriel_scenegraph::new_graph;

    #[test]
    fn a_map_is_asked_for_in_one_frame_only() {
        let mut graph = new_graph();
        let light = graph.create("SpotLight").unwrap();
        let mut once = MapsOnce::default();
        for (asks, wanted) in [(false, false), (true, true), (false, false), (true, true), (true, true), (false, false)] {
            once.end(&mut graph);
            if asks {
                graph.set_named(light, "shadow_update", "next_frame_only").unwrap();
            }
            once.find(&graph);
            assert_eq!(wants_map_once(&graph, light), wanted);
        }
    }
}
