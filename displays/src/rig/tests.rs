//! Rigs in a graph, as worlds make them.

use super::*;
use crate::navigation::{Mode, NavigationNode, Navigator};
use crate::{Error, WindowSizes};
use glam::{Mat4, Quat, Vec2, Vec3, Vec4};
use std::sync::Arc;
use umbriel_fields::{Graph, NodeId, Value};
use umbriel_scene::{Aabb, Layout, Scene};
use umbriel_scenegraph::{Extractor, Viewpoint, WORLD, new_graph};

const BOUNDS: Aabb = Aabb { min: Vec3::new(-1.0, 0.0, -1.0), max: Vec3::ONE };

fn node(graph: &mut Graph, type_name: &str, name: &str) -> NodeId {
    let node = graph.create(type_name).unwrap();
    graph.set_name(node, name).unwrap();
    node
}

fn set(graph: &mut Graph, node: NodeId, field: &str, value: impl Into<Value>) {
    graph.set_named(node, field, value).unwrap();
}

fn nodes(list: &[NodeId]) -> Arc<[Option<NodeId>]> {
    list.iter().map(|n| Some(*n)).collect()
}

fn screen(graph: &mut Graph, name: &str, corners: &ScreenCorners) -> NodeId {
    let screen = node(graph, "Screen", name);
    set(graph, screen, "lower_left", corners.lower_left);
    set(graph, screen, "lower_right", corners.lower_right);
    set(graph, screen, "upper_left", corners.upper_left);
    screen
}

/// A display of the four walls of a room, and a user.
fn room(graph: &mut Graph, display_name: &str) -> NodeId {
    let Room { left, front, right, floor } = room_screens(3.0, 3.0, 3.0);
    let screens = [("left", left), ("front", front), ("right", right), ("floor", floor)]
        .map(|(name, corners)| screen(graph, &format!("{display_name}.{name}"), &corners));
    let user = node(graph, "User", &format!("{display_name}.user"));
    set(graph, user, "position", Vec3::new(0.4, 1.7, 0.3));
    let display = node(graph, "Display", display_name);
    set(graph, display, "screens", nodes(&screens));
    set(graph, display, "user", Some(user));
    set(graph, display, "size", Vec2::new(40.0, 30.0));
    display
}

fn layout(graph: &mut Graph, display: NodeId, name: &str) {
    set(graph, display, "layout", name);
}

fn shown(graph: &Graph, rig: &mut Rig, view: Option<&str>, viewpoints: &[Viewpoint]) -> Result<Pictures, Error> {
    let windows = WindowSizes::new();
    rig.pictures(graph, viewpoints, &BOUNDS, &Wanted { view, size: [64, 48], windows: &windows })
}

fn first_problem(graph: &Graph) -> String {
    let result = shown(graph, &mut Rig::new(), None, &[]).unwrap();
    result.problems.first().map(ToString::to_string).unwrap_or_default()
}

#[test]
fn a_room_is_a_row_of_off_axis_views() {
    let mut graph = new_graph();
    let display = room(&mut graph, "cave");
    layout(&mut graph, display, "row");
    let result = shown(&graph, &mut Rig::new(), None, &[]).unwrap();
    assert!(result.problems.is_empty(), "{:?}", result.problems);
    let [picture] = &result.pictures[..] else { panic!("one display, one picture") };
    assert_eq!((picture.name.as_str(), picture.size), ("cave", [160, 30]));
    let names: Vec<_> = picture.views.iter().map(|v| v.name.as_str()).collect();
    assert_eq!(names, ["cave.left", "cave.front", "cave.right", "cave.floor"]);
    let front = picture.views[1].frustum;
    assert!((front.left + 0.1055556).abs() < 1e-7 && (front.top - 0.072222222).abs() < 1e-7);
    // Two eyes double the row, left first.
    set(&mut graph, display, "stereo", true);
    let result = shown(&graph, &mut Rig::new(), None, &[]).unwrap();
    assert_eq!(result.pictures[0].size, [320, 30]);
    assert_eq!(result.pictures[0].views[0].name, "cave.left.left");
    let x_of = |i: usize| result.pictures[0].views[i].view_from_world.inverse().w_axis.x;
    assert!((x_of(3) - x_of(2) - 0.064).abs() < 1e-6, "the right eye is to the right");
}

#[test]
fn a_room_follows_its_window() {
    let mut graph = new_graph();
    room(&mut graph, "cave");
    let windows = WindowSizes::from([("cave".to_owned(), [403, 101])]);
    let wanted = Wanted { view: None, size: [64, 48], windows: &windows };
    let result = Rig::new().pictures(&graph, &[], &BOUNDS, &wanted).unwrap();
    assert_eq!(result.pictures[0].views[0].size, [100, 101]);
}

#[test]
fn a_headset_has_asymmetric_frusta_at_its_eyes() {
    let mut graph = new_graph();
    let user = node(&mut graph, "User", "wearer");
    let turn = Quat::from_rotation_y(1.0) * Quat::from_rotation_x(-0.2);
    set(&mut graph, user, "position", Vec3::new(1.0, 1.6, 2.0));
    set(&mut graph, user, "orientation", turn);
    let display = node(&mut graph, "Display", "headset");
    layout(&mut graph, display, "layers");
    let frusta: Arc<[Vec4]> = [Vec4::new(-1.2, 0.9, -1.1, 1.0), Vec4::new(-0.9, 1.2, -1.1, 1.0)].into();
    set(&mut graph, display, "frusta", frusta);
    set(&mut graph, display, "near", 0.05f32);
    let result = shown(&graph, &mut Rig::new(), None, &[]).unwrap();
    let picture = &result.pictures[0];
    assert_eq!((picture.layout.clone(), picture.views.len()), (Layout::Layers, 2));
    for (view, side, left, right) in [(&picture.views[0], -1.0, -1.2, 0.9), (&picture.views[1], 1.0, -0.9, 1.2)] {
        let f = view.frustum;
        for (got, want) in [(f.left, left), (f.right, right), (f.bottom, -1.1), (f.top, 1.0)] {
            assert!((got - want * 0.05).abs() < 1e-7, "{}", view.name);
        }
        let room_from_view = view.view_from_world.inverse();
        let eye = Vec3::new(1.0, 1.6, 2.0) + turn * Vec3::X * (side * 0.032);
        assert!(room_from_view.abs_diff_eq(Mat4::from_rotation_translation(turn, eye), 1e-5), "{}", view.name);
    }
}

#[test]
fn bad_rigs_are_told_and_the_others_work() {
    type Break = fn(&mut Graph, NodeId);
    let rows: [(&str, Break, &[&str]); 14] = [
        ("no screens", |g, d| set(g, d, "screens", nodes(&[])), &["Display `bad`", "`screens`", "give it screens"]),
        (
            "no area",
            |g, d| on_front(g, d, "lower_right", Vec3::new(-1.5, 0.0, -1.5)),
            &["Screen `bad.front`", "`lower_right`", "area"],
        ),
        ("not finite", |g, d| on_front(g, d, "upper_left", Vec3::NAN), &["Screen `bad.front`", "`upper_left`", "finite"]),
        (
            "skewed",
            |g, d| on_front(g, d, "upper_left", Vec3::new(0.0, 3.0, -1.5)),
            &["Screen `bad.front`", "`upper_left`", "angle"],
        ),
        (
            "behind",
            |g, d| on_user(g, d, "position", Vec3::new(0.0, 1.0, -2.0)),
            &["Screen `bad.front`", "`lower_left`", "in front"],
        ),
        ("lost head", |g, d| on_user(g, d, "position", Vec3::NAN), &["User `bad.user`", "`position`", "finite"]),
        (
            "no turn",
            |g, d| on_user(g, d, "orientation", Quat::from_xyzw(0.0, 0.0, 0.0, 0.0)),
            &["User `bad.user`", "`orientation`"],
        ),
        ("near", |g, d| set(g, d, "near", 0.0f32), &["Display `bad`", "`near`", "positive"]),
        ("size", |g, d| set(g, d, "size", Vec2::new(0.0, 100.0)), &["Display `bad`", "`size`", "0 x 100"]),
        ("dead screen", |g, d| delete(g, d, "bad.front"), &["Display `bad`", "Screen"]),
        ("no screen", |g, d| set(g, d, "screens", nodes(&[d])), &["Display `bad`", "`screens`", "not Display"]),
        ("anaglyph", |g, d| layout(g, d, "anaglyph"), &["Display `bad`", "`layout`", "4 screens"]),
        ("frusta", |g, d| headset(g, d, Vec4::new(0.5, -0.5, -1.0, 1.0)), &["Display `bad`", "`frusta`", "entry 0"]),
        ("mono", |g, d| set(g, d, "stereo", true), &["Display `bad`", "`stereo`", "one eye"]),
    ];
    for (name, destroy, wanted) in rows {
        let mut graph = new_graph();
        let bad = room(&mut graph, "bad");
        room(&mut graph, "good");
        assert_eq!(first_problem(&graph), "", "{name}");
        destroy(&mut graph, bad);
        let message = first_problem(&graph);
        assert!(wanted.iter().all(|w| message.contains(w)), "{name}: {message}");
        let result = shown(&graph, &mut Rig::new(), None, &[]).unwrap();
        assert!(result.pictures.iter().any(|p| p.name == "good"), "{name}");
        assert_eq!(result.problems.len(), 1, "{name}: {:?}", result.problems);
    }
}

fn on_front(graph: &mut Graph, _: NodeId, field: &str, value: Vec3) {
    let front = graph.find("bad.front").unwrap();
    set(graph, front, field, value);
}

fn on_user(graph: &mut Graph, _: NodeId, field: &str, value: impl Into<Value>) {
    let user = graph.find("bad.user").unwrap();
    set(graph, user, field, value);
}

fn delete(graph: &mut Graph, _: NodeId, name: &str) {
    let node = graph.find(name).unwrap();
    graph.delete(node).unwrap();
}

fn headset(graph: &mut Graph, display: NodeId, frustum: Vec4) {
    set(graph, display, "screens", nodes(&[]));
    set(graph, display, "frusta", Arc::<[Vec4]>::from([frustum]));
}

#[test]
fn a_display_without_anybody_is_told() {
    let mut graph = new_graph();
    let display = node(&mut graph, "Display", "wall");
    let wall = node(&mut graph, "Screen", "canvas");
    set(&mut graph, display, "screens", nodes(&[wall]));
    let message = first_problem(&graph);
    assert!(message.contains("Display `wall`, field `user`") && message.contains("User"), "{message}");
    // Whoever comes is taken.
    let mut rig = Rig::new();
    assert_eq!(shown(&graph, &mut rig, None, &[]).unwrap().pictures[0].name, DESKTOP);
    let guest = graph.create("User").unwrap();
    assert_eq!(shown(&graph, &mut rig, None, &[]).unwrap().pictures[0].name, "wall");
    // When the first one leaves, the next one looks.
    let next = graph.create("User").unwrap();
    set(&mut graph, next, "position", Vec3::new(0.5, 1.5, 0.0));
    shown(&graph, &mut rig, None, &[]).unwrap();
    graph.delete(guest).unwrap();
    let result = shown(&graph, &mut rig, None, &[]).unwrap();
    let room_from_view = result.pictures[0].views[0].view_from_world.inverse();
    assert!(room_from_view.w_axis.truncate().abs_diff_eq(Vec3::new(0.5, 1.5, 0.0), 1e-6));
}

#[test]
fn problems_are_told_once_and_displays_come_and_go() {
    let mut graph = new_graph();
    let display = room(&mut graph, "cave");
    let mut rig = Rig::new();
    set(&mut graph, display, "near", -1.0f32);
    let counts = [0, 1].map(|_| shown(&graph, &mut rig, None, &[]).unwrap().problems.len());
    assert_eq!(counts, [1, 0]);
    set(&mut graph, display, "near", 0.1f32);
    assert_eq!(shown(&graph, &mut rig, None, &[]).unwrap().pictures[0].name, "cave");
    set(&mut graph, display, "near", -1.0f32);
    assert_eq!(shown(&graph, &mut rig, None, &[]).unwrap().problems.len(), 1, "it is back");
    graph.delete(display).unwrap();
    let result = shown(&graph, &mut rig, None, &[]).unwrap();
    assert_eq!((result.problems.len(), result.pictures[0].name.as_str()), (0, DESKTOP));
}

/// Viewpoints in the world, as extraction sees them.
fn viewpoints(graph: &mut Graph, poses: &[(&str, Mat4)]) -> Vec<Viewpoint> {
    let created: Vec<_> = poses.iter().map(|(name, pose)| viewpoint(graph, name, pose)).collect();
    let world = graph.find(WORLD).unwrap();
    set(graph, world, "children", nodes(&created));
    extracted(graph)
}

fn viewpoint(graph: &mut Graph, name: &str, world_from_view: &Mat4) -> NodeId {
    let (_, orientation, position) = world_from_view.to_scale_rotation_translation();
    let node = node(graph, "Viewpoint", name);
    set(graph, node, "position", position);
    set(graph, node, "orientation", orientation);
    node
}

fn extracted(graph: &Graph) -> Vec<Viewpoint> {
    let mut extractor = Extractor::new();
    extractor.update(graph, &mut Scene::default());
    extractor.viewpoints().to_vec()
}

#[test]
fn views_are_found_by_name() {
    let mut graph = new_graph();
    room(&mut graph, "cave");
    room(&mut graph, "wall");
    let behind = Mat4::from_translation(Vec3::new(0.0, 1.0, 9.0));
    let viewpoints = viewpoints(&mut graph, &[("bridge", Mat4::IDENTITY), ("behind", behind)]);
    let view = |view: Option<&str>| shown(&graph, &mut Rig::new(), view, &viewpoints);
    let names = |view_name| view(view_name).unwrap().pictures.iter().map(|p| p.name.clone()).collect::<Vec<_>>();
    assert_eq!(names(None), ["cave", "wall"]);
    assert_eq!(names(Some("wall")), ["wall"]);
    assert_eq!(names(Some("behind")), [DESKTOP]);
    let picture = &view(Some("behind")).unwrap().pictures[0];
    assert_eq!((picture.size, picture.views[0].name.as_str()), ([64, 48], "behind"));
    assert!(picture.views[0].view_from_world.abs_diff_eq(behind.inverse(), 1e-6));
    let message = view(Some("brigde")).unwrap_err().to_string();
    assert!(message.contains("did you mean `bridge`") && message.contains("behind, bridge, cave, wall"), "{message}");
}

#[test]
fn a_display_that_was_asked_for_must_work() {
    let mut graph = new_graph();
    let display = room(&mut graph, "cave");
    room(&mut graph, "wall");
    set(&mut graph, display, "near", 0.0f32);
    assert!(shown(&graph, &mut Rig::new(), Some("cave"), &[]).unwrap_err().to_string().contains("`near`"));
    assert_eq!(shown(&graph, &mut Rig::new(), Some("wall"), &[]).unwrap().pictures.len(), 1);
}

#[test]
fn the_camera_stands_still_when_the_world_moves() {
    let mut graph = new_graph();
    let world_from_viewpoint = Mat4::from_rotation_translation(Quat::from_rotation_y(0.4), Vec3::new(1.0, 2.0, 3.0));
    let before = viewpoints(&mut graph, &[("bridge", world_from_viewpoint)]);
    let navigation = NavigationNode::find_or_create(&mut graph, Vec3::ZERO).unwrap();
    for (scale, turn, position) in [(1.0f32, 0.0, Vec3::ZERO), (1.0, 0.7, Vec3::new(4.0, 0.0, -1.0)), (20.0, -2.0, Vec3::X)] {
        let pose = Navigator { position, orientation: Quat::from_rotation_y(turn), ..Navigator::default() };
        navigation.write(&mut graph, &pose).unwrap();
        set(&mut graph, navigation.node, "scale", scale);
        let after = extracted(&graph);
        let went_along = after[0].room_from_view != before[0].room_from_view;
        assert_eq!(went_along, turn != 0.0, "the viewpoint is part of the world");
        let result = shown(&graph, &mut Rig::new(), None, &after).unwrap();
        let view = &result.pictures[0].views[0];
        assert!(view.view_from_world.abs_diff_eq(world_from_viewpoint.inverse(), 1e-4), "{scale}: {}", view.view_from_world);
    }
}

#[test]
fn a_navigation_is_read_as_it_was_written() {
    let mut graph = new_graph();
    let made = NavigationNode::find_or_create(&mut graph, Vec3::ONE).unwrap();
    let fresh = made.read(&graph).unwrap();
    assert_eq!((fresh.mode, fresh.center), (Mode::Examine, Vec3::ONE));
    let moved = Navigator { position: Vec3::X, orientation: Quat::from_rotation_y(0.5), center: Vec3::Y, ..fresh };
    made.write(&mut graph, &moved).unwrap();
    for (name, mode) in Mode::NAMES {
        set(&mut graph, made.node, "mode", name);
        assert_eq!(made.read(&graph).unwrap(), Navigator { mode, ..moved }, "{name}");
    }
    // The one that is there is taken.
    assert_eq!(NavigationNode::find_or_create(&mut graph, Vec3::ZERO).unwrap(), made);
}

#[test]
fn a_camera_that_was_fitted_stays() {
    let graph = new_graph();
    let mut rig = Rig::new();
    let windows = WindowSizes::new();
    let wanted = Wanted { view: None, size: [64, 48], windows: &windows };
    let mut view = |bounds: Aabb| rig.pictures(&graph, &[], &bounds, &wanted).unwrap().pictures[0].views[0].view_from_world;
    let nothing = view(Aabb::EMPTY);
    let first = view(BOUNDS);
    assert_ne!(first, nothing);
    assert_eq!(view(BOUNDS.transformed(&Mat4::from_translation(Vec3::X))), first);
    rig.refit();
    let again = rig.pictures(&graph, &[], &Aabb { min: Vec3::ZERO, max: Vec3::ONE }, &wanted).unwrap();
    assert_ne!(again.pictures[0].views[0].view_from_world, first);
}

#[test]
fn a_display_of_a_viewpoint_is_a_stereo_camera() {
    let mut graph = new_graph();
    let viewpoints = viewpoints(&mut graph, &[("bridge", Mat4::IDENTITY)]);
    let display = node(&mut graph, "Display", "glasses");
    set(&mut graph, display, "viewpoint", Some(viewpoints[0].node));
    layout(&mut graph, display, "anaglyph");
    let result = shown(&graph, &mut Rig::new(), None, &viewpoints).unwrap();
    let picture = &result.pictures[0];
    assert_eq!((picture.layout.clone(), picture.name.as_str()), (Layout::Anaglyph, "glasses"));
    let x = |i: usize| picture.views[i].view_from_world.inverse().w_axis.x;
    assert!((x(0) + 0.032).abs() < 1e-6 && (x(1) - 0.032).abs() < 1e-6);
    // A viewpoint that extraction does not know stands nowhere.
    let message = shown(&graph, &mut Rig::new(), None, &[]).unwrap().problems[0].to_string();
    assert!(message.contains("Display `glasses`, field `viewpoint`") && message.contains("not in the world"), "{message}");
}

#[test]
fn another_graph_is_seen_anew() {
    let mut first = new_graph();
    room(&mut first, "cave");
    let mut rig = Rig::new();
    shown(&first, &mut rig, None, &[]).unwrap();
    let mut second = new_graph();
    room(&mut second, "wall");
    rig.refit();
    let names: Vec<_> = shown(&second, &mut rig, None, &[]).unwrap().pictures.into_iter().map(|p| p.name).collect();
    assert_eq!(names, ["wall"]);
}
