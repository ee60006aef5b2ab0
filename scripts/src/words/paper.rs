//! AVANGO's scheme functions by their names, so that what the papers print runs line by line (000 section 4.1).

use glam::{Mat4, Vec2, Vec3, Vec4};
use rhai::Dynamic;

use super::Words;
use super::nodes::{get, set};
use super::vectors::component;
use crate::error::{Outcome, fail};
use crate::stage::Node;

pub(super) fn teach(words: &mut Words<'_>) {
    let stage = words.stage.clone();
    words.word(
        "make_instance_by_name(type: string) -> Node",
        "`(make-instance-by-name \"fpLightSource\")`",
        move |name: &str| stage.create(name),
    );
    let stage = words.stage.clone();
    words.word(
        "fp_set_value(node: Node, field: string, value: any)",
        "`(fp-set-value newLight 'ShadowSize 512)`",
        move |node: Node, field: &str, value: Dynamic| set(&stage, node, field, &value),
    );
    let stage = words.stage.clone();
    words.word(
        "fp_get_value(node: Node, field: string) -> any",
        "`(fp-get-value newLight 'ShadowSize)`",
        move |node: Node, field: &str| get(&stage, node, field),
    );
    words.word("make_vec2(x: number, y: number) -> vec2", "`(make-vec2 0 180)`", |x: Dynamic, y: Dynamic| -> Outcome<Vec2> {
        Ok(Vec2::new(component(&x)?, component(&y)?))
    });
    words.word(
        "make_vec3(x: number, y: number, z: number) -> vec3",
        "`(make-vec3 0 0 -1)`",
        |x: Dynamic, y: Dynamic, z: Dynamic| -> Outcome<Vec3> { Ok(Vec3::new(component(&x)?, component(&y)?, component(&z)?)) },
    );
    words.word(
        "make_vec4(x: number, y: number, z: number, w: number) -> vec4",
        "`(make-vec4 0 0 0 1)`",
        |x: Dynamic, y: Dynamic, z: Dynamic, w: Dynamic| -> Outcome<Vec4> {
            Ok(Vec4::new(component(&x)?, component(&y)?, component(&z)?, component(&w)?))
        },
    );
    transforms(words);
}

/// AVANGO multiplies row vectors: `a * b` is first a, then b. Scripts here multiply matrices as mathematics does.
fn transforms(words: &mut Words<'_>) {
    words.word("make_identity_mat() -> mat4", "The matrix that changes nothing.", || Mat4::IDENTITY);
    words.word(
        "make_trans_mat(x: number, y: number, z: number) -> mat4",
        "The matrix that moves.",
        |x: Dynamic, y: Dynamic, z: Dynamic| -> Outcome<Mat4> {
            Ok(Mat4::from_translation(Vec3::new(component(&x)?, component(&y)?, component(&z)?)))
        },
    );
    words.word(
        "make_scale_mat(x: number, y: number, z: number) -> mat4",
        "The matrix that stretches.",
        |x: Dynamic, y: Dynamic, z: Dynamic| -> Outcome<Mat4> {
            Ok(Mat4::from_scale(Vec3::new(component(&x)?, component(&y)?, component(&z)?)))
        },
    );
    words.word(
        "make_rot_mat(degrees: number, x: number, y: number, z: number) -> mat4",
        "The matrix that turns about an axis, in degrees.",
        |degrees: Dynamic, x: Dynamic, y: Dynamic, z: Dynamic| -> Outcome<Mat4> {
            match Vec3::new(component(&x)?, component(&y)?, component(&z)?).try_normalize() {
                Some(axis) => Ok(Mat4::from_axis_angle(axis, component(&degrees)?.to_radians())),
                None => fail("the axis of a turn cannot be the zero vector"),
            }
        },
    );
}
