//! What a node type means to extraction, and where its hot fields are.

use std::collections::HashMap;
use std::sync::Arc;
use umbriel_fields::{Graph, NodeId, NodeType};

/// What a node is to the scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    /// Has children and nothing else that matters here; also script types with a `children` field.
    Group,
    Transform,
    Stencil,
    Contours,
    Switch,
    Lod,
    Shape,
    Light,
    Viewpoint,
    Navigation,
    User,
    /// Background, Fog, Environment.
    Environment,
    ShadowQuad,
    /// A GeneratedShadowMap, which may be that of lights.
    ShadowMap,
    /// Geometry, materials, clocks, and all else that has no place in the world.
    Inert,
}

impl Role {
    /// Has a place in the world.
    pub(super) fn is_placed(self) -> bool {
        use Role::*;
        matches!(self, Group | Transform | Stencil | Contours | Switch | Lod | Shape | Light | Viewpoint)
    }
}

/// What extraction needs to know about a node type.
pub(super) struct TypeInfo {
    /// Kept alive, so that its address stays its own: a type may be replaced by another of the same name.
    _node_type: Arc<NodeType>,
    pub(super) role: Role,
    /// The field `children`, if nodes of this type stand above others.
    pub(super) children: Option<u16>,
    /// Fields whose change moves branches of the tree.
    pub(super) branches: Vec<u16>,
    /// translation, rotation, scale, center, scale_orientation, matrix.
    pub(super) transform: Option<[u16; 6]>,
}

/// Types seen so far; a node keeps the place of its type in the list.
#[derive(Default)]
pub(super) struct Types {
    list: Vec<TypeInfo>,
    by_address: HashMap<*const NodeType, u16>,
}

impl Types {
    pub(super) fn of(&mut self, graph: &Graph, node: NodeId) -> u16 {
        let node_type = graph.type_of(node);
        if let Some(place) = self.by_address.get(&Arc::as_ptr(node_type)) {
            return *place;
        }
        let name: &str = &node_type.name;
        let field = |name: &str| graph.field(node, name).ok().map(|f| f.index);
        let branches: Vec<u16> = ["children", "caster"].iter().filter_map(|n| field(n)).collect();
        let role = match name {
            "Group" => Role::Group,
            "Transform" => Role::Transform,
            "StencilShadow" => Role::Stencil,
            "Contours" => Role::Contours,
            "Switch" => Role::Switch,
            "LOD" => Role::Lod,
            "Shape" => Role::Shape,
            "DirectionalLight" | "SpotLight" | "PointLight" | "LightSource" => Role::Light,
            "Viewpoint" => Role::Viewpoint,
            "Navigation" => Role::Navigation,
            "User" => Role::User,
            "Background" | "Fog" | "Environment" => Role::Environment,
            "ShadowQuad" => Role::ShadowQuad,
            "GeneratedShadowMap" => Role::ShadowMap,
            _ if field("children").is_some() => Role::Group,
            _ => Role::Inert,
        };
        let transform = matches!(role, Role::Transform | Role::Stencil).then(|| {
            ["translation", "rotation", "scale", "center", "scale_orientation", "matrix"].map(|n| field(n).unwrap_or(u16::MAX))
        });
        let place = self.list.len() as u16;
        self.by_address.insert(Arc::as_ptr(node_type), place);
        self.list.push(TypeInfo { _node_type: node_type.clone(), role, children: field("children"), branches, transform });
        place
    }

    pub(super) fn get(&self, place: u16) -> &TypeInfo {
        &self.list[place as usize]
    }
}
