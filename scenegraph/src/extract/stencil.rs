//! StencilShadow nodes become groups of casters (000 section 4.2).

use super::instance::{Instance, Instances};
use super::problem::Problems;
use super::read::{Reader, label, type_name};
use super::role::Role;
use glam::Vec3;
use std::collections::HashSet;
use umbriel_fields::{Graph, NodeId};
use umbriel_scene::{Film, Scene, StencilGroup, StencilMode};

/// All groups that are shown and have a light. `light_of` gives a node's place in the scene's lights.
pub(super) fn read_groups(
    graph: &Graph,
    instances: &Instances,
    places: &[u32],
    scene: &Scene,
    light_of: impl Fn(NodeId) -> Option<usize>,
    problems: &mut Problems,
) -> Vec<StencilGroup> {
    let mut groups = Vec::new();
    for place in places {
        let instance = instances.at(*place);
        let read = Reader::new(graph, instance.node);
        let light = match read.node("light") {
            Some(light) => {
                let nowhere = !instances.of(light).any(|place| instances.at(place).role == Role::Light);
                let problem = nowhere.then(|| format!("'{}' is no light of this world; no shadow", label(graph, light)));
                problems.set(graph, instance.node, "light", problem);
                light_of(light)
            }
            None => {
                let first = (!scene.lights.is_empty()).then_some(0);
                let problem = first.is_none().then(|| "none is set and the scene has no light; no shadow".to_owned());
                problems.set(graph, instance.node, "light", problem);
                first
            }
        };
        let Some(light) = light.filter(|_| instance.shown && instance.finite) else { continue };
        groups.push(StencilGroup {
            name: label(graph, instance.node),
            light,
            casters: casters(&read, instances, *place, scene),
            mode: if read.choice("mode") == 1 { StencilMode::Modulative(film(&read, problems)) } else { StencilMode::Additive },
        });
    }
    groups
}

/// Drawables below the node's casters, or below the node where it names none.
fn casters(read: &Reader<'_>, instances: &Instances, place: u32, scene: &Scene) -> Vec<usize> {
    let named: HashSet<NodeId> = read.nodes("caster").into_iter().map(|(_, id)| id).collect();
    let end = instances.at(place).end;
    let mut out = Vec::new();
    let mut inside_until = if named.is_empty() { end } else { 0 };
    for at in place..end {
        let instance = instances.at(at);
        if named.contains(&instance.node) {
            inside_until = inside_until.max(instance.end);
        }
        if at < inside_until {
            out.extend(caster_of(instance, scene));
        }
    }
    out
}

/// The drawable that casts for a shape: its own, or the one that stands in for it.
fn caster_of(instance: &Instance, scene: &Scene) -> Option<usize> {
    let slot = instance.slot as usize;
    let drawable = scene.drawables.get(slot).filter(|d| instance.role == Role::Shape && d.visible)?;
    let stand_in = || scene.stand_ins.binary_search_by_key(&slot, |s| s.of).ok().map(|i| scene.stand_ins[i].place);
    if drawable.casts_shadow { Some(slot) } else { stand_in() }
}

/// The film of the node's quad; black at alpha 0.5 where it has none.
fn film(stencil: &Reader<'_>, problems: &mut Problems) -> Film {
    let (film, problem) = match stencil.node("shadow_quad") {
        None => (None, None),
        Some(quad) if type_name(stencil.graph, quad) != "ShadowQuad" => {
            (None, Some(format!("'{}' is no ShadowQuad", label(stencil.graph, quad))))
        }
        Some(quad) => {
            let read = Reader::new(stencil.graph, quad);
            let color: Vec3 = read.color("color");
            let film = color.extend(read.get::<f32>("alpha").clamp(0.0, 1.0));
            let problem = format!("the color of '{}' is not finite", label(stencil.graph, quad));
            if film.is_finite() { (Some(Film { color: film }), None) } else { (None, Some(problem)) }
        }
    };
    let problem = problem.map(|what| format!("{what}; the film is black at alpha 0.5"));
    problems.set(stencil.graph, stencil.node, "shadow_quad", problem);
    film.unwrap_or_default()
}
