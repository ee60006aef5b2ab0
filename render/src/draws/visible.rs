//! What the views of a frame and its maps see, as lists of instances. An answer is kept from frame to frame as long as the same is asked and
//! nothing changed: a world and eyes at rest cost nothing, and nothing of it is sent again.

use super::Draw;
use glam::Mat4;
use std::ops::Range;
use std::sync::Arc;

/// What may be asked again in the next frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Question {
    Surfaces { clip_from_world: Mat4 },
    Casters { clip_from_world: Mat4, holes_only: bool },
    Blended { clip_from_world: Mat4, view_from_world: Mat4 },
}

/// Draws that somebody asked for.
#[derive(Clone, Debug, Default)]
pub(crate) struct Found {
    pub(crate) draws: Arc<[Draw]>,
    /// How many drawables are outside.
    pub(crate) culled: usize,
}

struct Asked {
    question: Option<Question>,
    /// Where the answer starts in the list.
    first: usize,
    found: Found,
}

/// Instances that something sees, answer after answer.
#[derive(Default)]
pub(crate) struct Visible {
    list: Vec<u32>,
    asked: Vec<Asked>,
    /// Number of the next question of the frame.
    next: usize,
    unsent_from: usize,
}

impl Visible {
    /// Starts a frame. Answers stay good unless the drawables changed.
    pub(super) fn begin(&mut self, is_changed: bool) {
        self.next = 0;
        if is_changed {
            self.forget_from(0);
        }
    }

    fn forget_from(&mut self, number: usize) {
        if let Some(asked) = self.asked.get(number) {
            self.list.truncate(asked.first);
            self.asked.truncate(number);
            self.unsent_from = self.unsent_from.min(self.list.len());
        }
    }

    /// The answer to a question, that of the frame before where it is the same one. `find` adds to the list. Without a question it is found
    /// anew in every frame.
    pub(super) fn ask(&mut self, question: Option<Question>, find: impl FnOnce(&mut Vec<u32>) -> (Vec<Draw>, usize)) -> Found {
        let number = self.next;
        self.next += 1;
        if let Some(asked) = self.asked.get(number).filter(|a| question.is_some() && a.question == question) {
            return asked.found.clone();
        }
        self.forget_from(number);
        let first = self.list.len();
        let (draws, culled) = find(&mut self.list);
        let found = Found { draws: draws.into(), culled };
        self.asked.push(Asked { question, first, found: found.clone() });
        found
    }

    /// Numbers of the drawables of one draw.
    pub(crate) fn of(&self, draw: &Draw) -> &[u32] {
        &self.list[draw.first as usize..][..draw.count as usize]
    }

    /// The list, and what of it was not sent yet.
    pub(crate) fn send(&mut self) -> (&[u32], Range<usize>) {
        let unsent = self.unsent_from..self.list.len();
        self.unsent_from = self.list.len();
        (&self.list, unsent)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn surfaces(x: f32) -> Option<Question> {
        Some(Question::Surfaces { clip_from_world: Mat4::from_translation(glam::Vec3::X * x) })
    }

    #[test]
    fn answers_stay_until_something_else_is_asked() {
        let mut visible = Visible::default();
        let mut frame = |changed: bool, questions: &[(Option<Question>, u32)]| {
            visible.begin(changed);
            let mut found = 0;
            for (question, answer) in questions {
                visible.ask(*question, |list| {
                    found += 1;
                    list.push(*answer);
                    (Vec::new(), 0)
                });
            }
            let (list, unsent) = visible.send();
            (found, list.to_vec(), unsent)
        };
        let (a, b, c) = (surfaces(1.0), surfaces(2.0), surfaces(3.0));
        assert_eq!(frame(false, &[(a, 1), (b, 2), (c, 3)]), (3, vec![1, 2, 3], 0..3));
        assert_eq!(frame(false, &[(a, 9), (b, 9), (c, 9)]), (0, vec![1, 2, 3], 3..3), "all at rest");
        assert_eq!(frame(false, &[(a, 9), (c, 4), (b, 5)]), (2, vec![1, 4, 5], 1..3), "from the first that differs");
        assert_eq!(frame(false, &[(a, 9)]), (0, vec![1, 4, 5], 3..3), "fewer");
        assert_eq!(frame(false, &[(a, 9), (None, 6), (b, 7)]), (2, vec![1, 6, 7], 1..3));
        assert_eq!(frame(false, &[(a, 9), (None, 8), (b, 9)]), (2, vec![1, 8, 9], 1..3), "what cannot be kept");
        assert_eq!(frame(true, &[(a, 3), (b, 4)]), (2, vec![3, 4], 0..2), "drawables changed");
    }
}
