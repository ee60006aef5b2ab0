//! Contours nodes become groups of shapes with a style of lines (001 section 4.3).

use super::instance::Instances;
use super::read::Reader;
use super::role::Role;
use glam::Vec3;
use umbriel_fields::Graph;
use umbriel_scene::{ContourGroup, ContourStyle, Scene};

/// All groups that are on, outer ones before those below them.
pub(super) fn read(graph: &Graph, instances: &Instances, places: &[u32], scene: &mut Scene) {
    scene.contours.clear();
    for place in places {
        let instance = instances.at(*place);
        let read = Reader::new(graph, instance.node);
        if !read.get::<bool>("on") {
            continue;
        }
        let below = &instances.list[*place as usize..instance.end as usize];
        let drawables = below.iter().filter(|i| i.role == Role::Shape).map(|i| i.slot as usize).collect();
        scene.contours.push(ContourGroup { drawables, style: style(&read) });
    }
}

fn style(read: &Reader<'_>) -> ContourStyle {
    let color = read.color("color");
    ContourStyle {
        color: if color.is_finite() { color } else { Vec3::ZERO },
        line_px: read.get("line_width"),
        outline_px: read.get("outline_width"),
        crease_rad: read.get("crease_angle"),
    }
}
