//! From where a world is seen: viewpoints in the world, and the rig in the room.

use glam::{Quat, Vec2, Vec3, Vec4};
use umbriel_fields::{Field, NodeType};

pub(super) fn types() -> Vec<NodeType> {
    let metres = |name: &'static str, value: Vec3, doc: &'static str| Field::new(name, value).unit("m").doc(doc);
    let turn = |doc: &'static str| Field::new("orientation", Quat::IDENTITY).doc(doc);
    vec![
        NodeType::new("Viewpoint", "A place to see the world from, looking along -z.")
            .field(metres("position", Vec3::new(0.0, 0.0, 10.0), "Where the eye is."))
            .field(turn("How the eye is turned."))
            .field(
                Field::new("field_of_view", std::f32::consts::FRAC_PI_4)
                    .unit("rad")
                    .range(0.0, f64::from(std::f32::consts::PI))
                    .doc("Whole vertical angle."),
            )
            .field(Field::new("near", 0.05f32).unit("m").doc("Nearest distance that is drawn."))
            .field(Field::new("description", "").doc("Name for menus.")),
        NodeType::new("Navigation", "Pose of the room in the world: to travel, the world moves.")
            .field(metres("position", Vec3::ZERO, "Where the room's origin is in the world."))
            .field(turn("How the room is turned in the world."))
            .field(Field::new("scale", 1.0f32).doc("Metres of the world in one metre of the room; 10 makes the user a giant."))
            .field(Field::choice("mode", &["none", "examine", "fly", "walk"], "none").doc("What mouse and keys do."))
            .field(Field::new("speed", 1.0f32).unit("m/s").doc("Speed of travel."))
            .field(metres("center", Vec3::ZERO, "What examine turns around, in the world.")),
        NodeType::new("User", "The head of a person in the room, often tracked.")
            .field(metres("position", Vec3::new(0.0, 1.7, 0.0), "Between the eyes, in the room."))
            .field(turn("How the head is turned in the room."))
            .field(Field::new("eye_distance", 0.064f32).unit("m").doc("From the left to the right eye.")),
        NodeType::new("Screen", "A flat window into the world, fixed in the room.")
            .field(metres("lower_left", Vec3::new(-1.0, 0.7, -1.0), "Corner in the room."))
            .field(metres("lower_right", Vec3::new(1.0, 0.7, -1.0), "Corner in the room."))
            .field(metres("upper_left", Vec3::new(-1.0, 2.2, -1.0), "Corner in the room.")),
        NodeType::new("Display", "One picture: which screens it shows, for whom, and how the views are put together.")
            .field(Field::nodes("screens").doc("Screens from left to right; none: a plain camera at `viewpoint`."))
            .field(Field::node("user").doc("Whose eyes; none: the first User."))
            .field(Field::new("size", Vec2::new(1280.0, 720.0)).unit("pixels").doc("Width and height of each view."))
            .field(
                Field::choice("layout", &["mono", "side_by_side", "top_bottom", "anaglyph", "layers", "row"], "mono")
                    .doc("How the views make a picture."),
            )
            .field(Field::new("stereo", false).doc("Two eyes."))
            .field(Field::new("near", 0.1f32).unit("m").doc("Nearest distance that is drawn."))
            .field(Field::many::<Vec4>("frusta").doc("Left, right, bottom, top tangents per eye, for headsets."))
            .field(Field::node("viewpoint").doc("A Viewpoint; none: the first of the scene.")),
        NodeType::new("Pointer", "What the mouse points at, in the window of any display, on any machine.")
            .field(Field::new("enabled", true).doc("Whether displays write here."))
            .field(Field::new("display", "").doc("The only display whose mouse counts; empty: all of them."))
            .field(Field::new("shown_on", "").doc("The display that the mouse is on."))
            .field(metres("origin", Vec3::ZERO, "The eye that looks past the mouse, in the world."))
            .field(Field::new("direction", Vec3::NEG_Z).doc("From there to where the mouse points, in the world."))
            .field(Field::node("over").doc("The Shape under the mouse, if there is one."))
            .field(metres("point", Vec3::ZERO, "Where on it, in the world."))
            .field(Field::new("normal", Vec3::Y).doc("Of its surface there, in the world."))
            .field(Field::new("pressed", false).doc("The left button is held."))
            .field(Field::node("picked").doc("The Shape on which the button was pressed last; none: it was pressed on nothing."))
            .field(Field::new("clicks", 0i32).doc("How often the button was pressed.")),
    ]
}
