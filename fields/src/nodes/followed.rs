//! What dampers and chasers have in common: values of one item or many, and where they start.

use std::ops::Deref;
use std::slice::from_ref;
use std::sync::Arc;

use glam::{Quat, Vec2, Vec3};

use super::blend::Glide;
use crate::{Color, Evaluation, FieldValue};

/// A value of which each item glides.
pub(super) trait Followed: FieldValue {
    /// One of its items.
    type Item: FieldValue + Glide;
    /// Any number of them.
    type Items: FieldValue + Deref<Target = [Self::Item]> + From<Vec<Self::Item>>;
    fn items(&self) -> &[Self::Item];
    /// The value of all items.
    fn of(items: &[Self::Item]) -> Self;
}

macro_rules! followed { ($($type:ty)*) => { $(
    impl Followed for $type {
        type Item = $type;
        type Items = Arc<[$type]>;

        fn items(&self) -> &[$type] {
            from_ref(self)
        }

        fn of(items: &[$type]) -> $type {
            items.first().copied().unwrap_or_else(<$type>::empty)
        }
    }

    impl Followed for Arc<[$type]> {
        type Item = $type;
        type Items = Arc<[$type]>;

        fn items(&self) -> &[$type] {
            self
        }

        fn of(items: &[$type]) -> Self {
            items.into()
        }
    }
)* } }
followed! { f32 Vec2 Vec3 Quat Color }

/// The destination, and the value if it is not to go on from where it is. None while nobody said anything. Fields: destination, value to
/// jump to, initial value, initial destination, and the value that is kept.
pub(super) fn start<V: Followed>(
    evaluation: &mut Evaluation<'_>,
    [destination, set_value, initial_value, initial_destination, kept]: [u16; 5],
) -> Option<(V, Option<V>)> {
    let written = |field| evaluation.written(field);
    let at_first = !written(kept);
    let begins = [set_value, initial_value].into_iter().find(|field| written(*field));
    let goes_to = [destination, initial_destination].into_iter().find(|field| written(*field)).or(begins)?;
    let jumps = evaluation.changed(set_value);
    let destination: V = evaluation.get(goes_to);
    let value = match begins {
        Some(_) if jumps => Some(evaluation.get(set_value)),
        Some(begins) if at_first => Some(evaluation.get(begins)),
        None if at_first => Some(destination.clone()),
        _ => None,
    };
    Some((destination, value))
}
