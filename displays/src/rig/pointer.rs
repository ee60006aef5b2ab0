//! The `Pointer` node: what the mouse points at, as part of the world.

use super::nodes::{RigNode, RigNodes};
use crate::Error;
use glam::{Mat4, Vec2, Vec3};
use umbriel_fields::{Graph, NodeId};
use umbriel_scene::{Scene, View};

/// Where a mouse points, in the room.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aim {
    /// The eye.
    pub origin: Vec3,
    /// From there past the mouse; of any length.
    pub direction: Vec3,
    /// The left button is held.
    pub pressed: bool,
}

impl Aim {
    /// `at` is the place of the mouse in the view, from (0, 0) at the top left to (1, 1) at the bottom right.
    pub fn through(view: &View, at: Vec2, pressed: bool) -> Aim {
        let room_from_view = view.view_from_world.inverse();
        let window = view.frustum;
        let x = window.left + (window.right - window.left) * at.x;
        let y = window.top + (window.bottom - window.top) * at.y;
        Aim {
            origin: room_from_view.w_axis.truncate(),
            direction: room_from_view.transform_vector3(Vec3::new(x, y, -window.near)),
            pressed,
        }
    }
}

/// What a mouse points at, in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pointed {
    /// The eye.
    pub origin: Vec3,
    /// Unit vector from there.
    pub direction: Vec3,
    /// The shape, the place on it, and its normal there.
    pub over: Option<(NodeId, Vec3, Vec3)>,
    /// The left button is held.
    pub pressed: bool,
}

impl Pointed {
    /// Looks along an aim in a scene, which is in the room. `node_of` gives the shape in a place of the scene's drawables.
    pub fn find(aim: &Aim, scene: &Scene, world_from_room: &Mat4, node_of: impl Fn(usize) -> Option<NodeId>) -> Pointed {
        let picked = scene.pick(aim.origin, aim.direction);
        let over = picked.and_then(|picked| {
            let normal = world_from_room.transform_vector3(picked.normal).normalize_or_zero();
            Some((node_of(picked.drawable)?, world_from_room.transform_point3(picked.point), normal))
        });
        Pointed {
            origin: world_from_room.transform_point3(aim.origin),
            direction: world_from_room.transform_vector3(aim.direction).normalize_or_zero(),
            over,
            pressed: aim.pressed,
        }
    }

    fn is_finite(&self) -> bool {
        let on_surface = self.over.is_none_or(|(_, point, normal)| point.is_finite() && normal.is_finite());
        self.origin.is_finite() && self.direction.is_finite() && on_surface
    }
}

/// The `Pointer` nodes of a graph.
#[derive(Clone, Debug, Default)]
pub struct Pointers {
    nodes: RigNodes,
}

impl Pointers {
    /// Does any of them want to know of the mouse on a display, or on a channel of it such as `wall/2`? Always to be asked for the same
    /// graph.
    pub fn want(&mut self, graph: &Graph, display: &str) -> bool {
        self.of(graph, display).next().is_some()
    }

    fn of<'a>(&'a mut self, graph: &'a Graph, display: &'a str) -> impl Iterator<Item = NodeId> + 'a {
        self.nodes.update(graph);
        let wants = move |node: &RigNode<'_>| {
            let only = node.get::<std::sync::Arc<str>>("display").unwrap_or_default();
            let is_this =
                only.is_empty() || *only == *display || display.rsplit_once('/').is_some_and(|(name, _)| *only == *name);
            is_this && node.get::<bool>("enabled").unwrap_or(false)
        };
        let pointers = self.nodes.pointers.iter().filter_map(|node| RigNode::new(graph, *node, "Pointer"));
        pointers.filter(wants).map(|node| node.node)
    }

    /// Writes what the mouse on a display points at. What is not finite, or no node of the graph, is not written.
    ///
    /// # Errors
    /// A node lacks a field.
    pub fn write(&mut self, graph: &mut Graph, display: &str, pointed: &Pointed) -> Result<(), Error> {
        if !pointed.is_finite() {
            return Ok(());
        }
        let over = pointed.over.filter(|(node, ..)| graph.contains(*node));
        let pointers: Vec<NodeId> = self.of(graph, display).collect();
        for node in pointers {
            let was_pressed = graph.get_named::<bool>(node, "pressed")?;
            graph.set_named(node, "shown_on", display)?;
            graph.set_named(node, "origin", pointed.origin)?;
            graph.set_named(node, "direction", pointed.direction)?;
            graph.set_named(node, "over", over.map(|(node, ..)| node))?;
            if let Some((_, point, normal)) = over {
                graph.set_named(node, "point", point)?;
                graph.set_named(node, "normal", normal)?;
            }
            if pointed.pressed != was_pressed {
                graph.set_named(node, "pressed", pointed.pressed)?;
            }
            if pointed.pressed && !was_pressed {
                let clicks = graph.get_named::<i32>(node, "clicks")?;
                graph.set_named(node, "picked", over.map(|(node, ..)| node))?;
                graph.set_named(node, "clicks", clicks.wrapping_add(1))?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use umbriel_scene::Frustum;
    use umbriel_scenegraph::{Extractor, new_graph};

    #[test]
    fn a_click_on_a_ball_is_written_where_it_is_wanted() {
        let mut graph = new_graph();
        let world = graph.find("world").unwrap();
        let sphere = graph.create("Sphere").unwrap();
        let ball = graph.create("Shape").unwrap();
        graph.set_named(ball, "geometry", Some(sphere)).unwrap();
        graph.set_named(world, "children", std::sync::Arc::<[Option<NodeId>]>::from([Some(ball)])).unwrap();
        // The room stands ten metres from the ball, and looks at it.
        let navigation = graph.create("Navigation").unwrap();
        graph.set_named(navigation, "position", Vec3::new(0.0, 0.0, 10.0)).unwrap();
        let rows = [("any", "", true, 1), ("wall", "wall", true, 1), ("other", "floor", true, 0), ("off", "", false, 0)];
        for (name, display, enabled, _) in rows {
            let node = graph.create("Pointer").unwrap();
            graph.set_name(node, name).unwrap();
            graph.set_named(node, "display", display).unwrap();
            graph.set_named(node, "enabled", enabled).unwrap();
        }
        let (mut extractor, mut scene) = (Extractor::new(), Scene::default());
        extractor.update(&graph, &mut scene);
        let frustum = Frustum::symmetric(1.0, 2.0, 0.1);
        let view = View { name: String::new(), view_from_world: Mat4::IDENTITY, frustum, size: [200, 100] };
        let mut pointers = Pointers::default();
        let mut point = |graph: &mut Graph, at: Vec2, pressed| {
            let aim = Aim::through(&view, at, pressed);
            let pointed = Pointed::find(&aim, &scene, &extractor.world_from_room(), |d| extractor.node_of_drawable(d));
            assert!(pointers.want(graph, "wall/1") && pointers.want(graph, "wall"));
            pointers.write(graph, "wall/1", &pointed).unwrap();
            pointed
        };
        let pointed = point(&mut graph, Vec2::splat(0.5), false);
        let (node, at, normal) = pointed.over.unwrap();
        assert_eq!(node, ball);
        assert!(at.abs_diff_eq(Vec3::Z, 0.01) && normal.abs_diff_eq(Vec3::Z, 0.1), "{at} {normal}");
        assert!(pointed.origin.abs_diff_eq(Vec3::new(0.0, 0.0, 10.0), 1e-5) && pointed.direction.abs_diff_eq(Vec3::NEG_Z, 1e-5));
        point(&mut graph, Vec2::splat(0.5), true);
        point(&mut graph, Vec2::ZERO, true);
        for (name, _, _, clicks) in rows {
            let node = graph.find(name).unwrap();
            assert_eq!(graph.get_named::<i32>(node, "clicks").unwrap(), clicks, "{name}");
            assert_eq!(graph.get_named::<bool>(node, "pressed").unwrap(), clicks > 0, "{name}");
            assert_eq!(graph.get_named::<Option<NodeId>>(node, "picked").unwrap(), (clicks > 0).then_some(ball), "{name}");
            assert_eq!(graph.get_named::<Option<NodeId>>(node, "over").unwrap(), None, "{name}: the corner shows nothing");
        }
        // To the left and up.
        let corner = point(&mut graph, Vec2::ZERO, false).direction;
        assert!(corner.x < -0.3 && corner.y > 0.2 && corner.z < 0.0, "{corner}");
    }
}
