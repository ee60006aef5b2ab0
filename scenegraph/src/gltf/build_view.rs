//! Cameras and lights of a model. Both look along -z of their node, as ours do.

use super::build::{Builder, color};
use super::error::{Fault, label};
use glam::Vec3;
use gltf::camera::Projection;
use gltf::khr_lights_punctual::Kind;
use umbriel_fields::NodeId;

impl Builder<'_> {
    /// The Viewpoint of a node with a camera.
    pub(super) fn make_camera(&mut self, node: &gltf::Node<'_>) -> Result<Option<NodeId>, Fault> {
        let Some(camera) = node.camera() else { return Ok(None) };
        let name = camera.name().or(node.name());
        let view = self.create("Viewpoint", name)?;
        self.set(view, "position", Vec3::ZERO)?;
        self.set(view, "description", name.unwrap_or_default())?;
        let near = match camera.projection() {
            Projection::Perspective(p) => {
                self.set(view, "field_of_view", p.yfov().clamp(0.001, 3.1))?;
                p.znear()
            }
            Projection::Orthographic(o) => {
                let object = label("camera", camera.index(), camera.name());
                self.warnings.push(format!("{object}: it is orthographic; a perspective viewpoint is at its place"));
                o.znear()
            }
        };
        if near > 0.0 {
            self.set(view, "near", near)?;
        }
        self.viewpoints.push(view);
        Ok(Some(view))
    }

    /// The light node of a node with a light of KHR_lights_punctual.
    pub(super) fn make_light(&mut self, node: &gltf::Node<'_>) -> Result<Option<NodeId>, Fault> {
        let Some(source) = node.light() else { return Ok(None) };
        let kind = match source.kind() {
            Kind::Directional => "DirectionalLight",
            Kind::Point => "PointLight",
            Kind::Spot { .. } => "SpotLight",
        };
        let light = self.create(kind, source.name().or(node.name()))?;
        self.set(light, "color", color(source.color().into()))?;
        self.set(light, "intensity", source.intensity().max(0.0))?;
        if let Some(range) = source.range().filter(|r| *r > 0.0 && kind != "DirectionalLight") {
            self.set(light, "radius", range)?;
        }
        if let Kind::Spot { inner_cone_angle, outer_cone_angle } = source.kind() {
            let outer = outer_cone_angle.clamp(0.0, std::f32::consts::FRAC_PI_2);
            if !(0.0..=outer).contains(&inner_cone_angle) || outer != outer_cone_angle {
                let object = label("light", source.index(), source.name());
                let cone = format!("{inner_cone_angle} to {outer_cone_angle}");
                self.warnings.push(format!("{object}: its cone from {cone} radians is not within 0 to pi/2 and is clamped"));
            }
            self.set(light, "cut_off_angle", outer)?;
            self.set(light, "beam_width", inner_cone_angle.clamp(0.0, outer))?;
        }
        self.lights.push(light);
        Ok(Some(light))
    }
}
