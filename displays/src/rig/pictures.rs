//! All pictures of a frame: those of the displays, or that of a desktop camera.

use super::display::{Surroundings, picture};
use super::nodes::{RigNode, RigNodes, label};
use super::{Camera, Eye, fit_camera};
use crate::{Error, WindowSizes};
use std::collections::BTreeSet;
use umbriel_fields::{Graph, NodeId, nearest};
use umbriel_scene::{Aabb, Picture, View};
use umbriel_scenegraph::Viewpoint;

/// Name of the picture that is shown where there are no displays.
pub const DESKTOP: &str = "desktop";
/// Vertical angle of the camera that is fitted to a model.
const FITTED_FOV_RAD: f32 = 0.7;

/// What is to be shown.
#[derive(Clone, Copy, Debug)]
pub struct Wanted<'a> {
    /// Name of the only display to show, or of the viewpoint to look from. None: all displays, or else the first viewpoint.
    pub view: Option<&'a str>,
    /// Pixels of the picture of the desktop camera.
    pub size: [u32; 2],
    /// Sizes of pictures that windows show already; they come before the sizes that displays ask for.
    pub windows: &'a WindowSizes,
}

/// Turns the nodes of a rig into pictures, frame after frame.
#[derive(Clone, Debug, Default)]
pub struct Rig {
    nodes: RigNodes,
    /// In the world; kept, so that the world can move before it.
    fitted: Option<Camera>,
    told: BTreeSet<String>,
}

/// What a rig shows now.
#[derive(Debug, Default)]
pub struct Pictures {
    /// One per display that works. Never empty: if none does, the world is seen from the desktop camera.
    pub pictures: Vec<Picture>,
    /// What is wrong with the others; the same problem is told once, until it is gone.
    pub problems: Vec<Error>,
}

impl Rig {
    /// Nothing seen yet.
    pub fn new() -> Rig {
        Rig::default()
    }

    /// Forgets what was seen, for another graph or model: a fitted camera is fitted anew.
    pub fn refit(&mut self) {
        *self = Rig::default();
    }

    /// The pictures of `graph` as it is now. `viewpoints` are those of extraction; `bounds_in_world` is what a
    /// camera is fitted to where there are none.
    ///
    /// # Errors
    /// `wanted.view` is no display or viewpoint, or the display of that name cannot be used.
    pub fn pictures(
        &mut self,
        graph: &Graph,
        viewpoints: &[Viewpoint],
        bounds_in_world: &Aabb,
        wanted: &Wanted<'_>,
    ) -> Result<Pictures, Error> {
        self.nodes.update(graph);
        let cameras: Vec<(&Viewpoint, Camera)> = viewpoints.iter().map(|v| (v, camera_of(v))).collect();
        let camera_at = |node: Option<NodeId>| {
            let found = cameras.iter().find(|(info, _)| node.is_none_or(|node| info.node == node));
            found.map(|(_, camera)| *camera)
        };

        let displays = self.displays(graph);
        let chosen = match wanted.view {
            None => None,
            Some(name) => match (displays.iter().any(|(n, _)| n == name), named(&cameras, name)) {
                (true, _) => Some(Chosen::Display(name)),
                (false, Some((_, camera))) => Some(Chosen::Camera(name, *camera)),
                (false, None) => return Err(unknown(name, &displays, viewpoints)),
            },
        };
        let mut result = Pictures::default();
        if !matches!(chosen, Some(Chosen::Camera(..))) {
            for (name, node) in &displays {
                if matches!(chosen, Some(Chosen::Display(only)) if only != name) {
                    continue;
                }
                let around = Surroundings {
                    user: self.nodes.users.first().and_then(|user| RigNode::new(graph, *user, "User")),
                    camera: &camera_at,
                    window: wanted.windows.get(name).copied(),
                };
                let Some(display) = RigNode::new(graph, *node, "Display") else { continue };
                match picture(&display, name.clone(), &around) {
                    Ok((picture, remark)) => {
                        result.pictures.push(picture);
                        result.problems.extend(remark);
                    }
                    Err(error) if chosen.is_some() => return Err(error),
                    Err(error) => result.problems.push(error),
                }
            }
        }
        if result.pictures.is_empty() {
            let (name, camera) = match chosen {
                Some(Chosen::Camera(name, camera)) => (name.to_owned(), camera),
                _ => match cameras.first() {
                    Some((info, camera)) => (info.name.clone(), *camera),
                    None => (DESKTOP.to_owned(), self.fitted(bounds_in_world, wanted.size)),
                },
            };
            let size = wanted.windows.get(DESKTOP).copied().unwrap_or(wanted.size);
            result.pictures.push(desktop(name, &camera, size)?);
        }
        self.keep_news(&mut result.problems);
        Ok(result)
    }

    /// Displays by name; each name is there once.
    fn displays(&self, graph: &Graph) -> Vec<(String, NodeId)> {
        let mut names = BTreeSet::new();
        let mut unique = |name: String| {
            let free = (1..).map(|n| if n == 1 { name.clone() } else { format!("{name} {n}") });
            free.into_iter().find(|n| names.insert(n.clone())).unwrap_or(name)
        };
        self.nodes.displays.iter().map(|node| (unique(label(graph, *node, "Display")), *node)).collect()
    }

    /// Fitted once there is something to see.
    fn fitted(&mut self, bounds_in_world: &Aabb, size: [u32; 2]) -> Camera {
        let aspect = size[0].max(1) as f32 / size[1].max(1) as f32;
        let camera = self.fitted.unwrap_or_else(|| fit_camera(bounds_in_world, FITTED_FOV_RAD, aspect));
        if !bounds_in_world.is_empty() {
            self.fitted = Some(camera);
        }
        camera
    }

    fn keep_news(&mut self, problems: &mut Vec<Error>) {
        let now: BTreeSet<String> = problems.iter().map(ToString::to_string).collect();
        problems.retain(|p| !self.told.contains(&p.to_string()));
        self.told = now;
    }
}

/// By name; menus show descriptions, so these do, too.
fn named<'a>(cameras: &'a [(&Viewpoint, Camera)], name: &str) -> Option<&'a (&'a Viewpoint, Camera)> {
    let by_name = cameras.iter().find(|(v, _)| v.name == name);
    by_name.or_else(|| cameras.iter().find(|(v, _)| v.description == name))
}

enum Chosen<'a> {
    Display(&'a str),
    Camera(&'a str, Camera),
}

/// A viewpoint is part of the world and goes along when the world moves. Its camera stands still in the room, where the
/// viewpoint would be had the world not moved.
fn camera_of(viewpoint: &Viewpoint) -> Camera {
    Camera { room_from_camera: viewpoint.world_from_view, fov_rad: viewpoint.field_of_view_rad, near: viewpoint.near_m }
}

/// The picture of a desktop window, whatever is seen in it.
fn desktop(view_name: String, camera: &Camera, size: [u32; 2]) -> Result<Picture, Error> {
    let (view_from_world, frustum) = camera.eye(Eye::Middle, 0.0, size).map_err(|reason| Error::Rig {
        type_name: "Viewpoint",
        node: view_name.clone(),
        field: "field_of_view",
        reason,
    })?;
    Ok(Picture { name: DESKTOP.to_owned(), ..Picture::mono(View { name: view_name, view_from_world, frustum, size }) })
}

fn unknown(name: &str, displays: &[(String, NodeId)], viewpoints: &[Viewpoint]) -> Error {
    let names = displays.iter().map(|(n, _)| n.clone()).chain(viewpoints.iter().map(|v| v.name.clone()));
    let known: BTreeSet<String> = names.filter(|n| !n.is_empty()).collect();
    let nearest = nearest(name, known.iter().map(String::as_str)).map(str::to_owned);
    Error::UnknownView { name: name.to_owned(), nearest, known: known.into_iter().collect() }
}
