//! Strips, fans and loops as lists (glTF 2.0 specification, section 3.7.2.1), in the order of their vertices.

use gltf::mesh::Mode;

/// What each run of indices is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Topology {
    Triangles,
    Lines,
    Points,
}

impl Topology {
    /// Its name in the `topology` field of a `Mesh` node.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Topology::Triangles => "triangles",
            Topology::Lines => "lines",
            Topology::Points => "points",
        }
    }
}

/// The list that `given` stands for in `mode`, and how many indices at its end make no whole primitive.
pub(crate) fn expand(mode: Mode, mut given: Vec<i32>) -> (Topology, Vec<i32>, usize) {
    let whole = |mut given: Vec<i32>, size: usize| {
        let rest = given.len() % size;
        given.truncate(given.len() - rest);
        (given, rest)
    };
    let at_least = |size: usize, given: &[i32]| if given.len() < size { given.len() } else { 0 };
    match mode {
        Mode::Points => (Topology::Points, given, 0),
        Mode::Lines => {
            let (list, rest) = whole(given, 2);
            (Topology::Lines, list, rest)
        }
        Mode::LineStrip | Mode::LineLoop => {
            let rest = at_least(2, &given);
            if mode == Mode::LineLoop && rest == 0 {
                given.extend(given.first().copied());
            }
            (Topology::Lines, given.windows(2).flatten().copied().collect(), rest)
        }
        Mode::Triangles => {
            let (list, rest) = whole(given, 3);
            (Topology::Triangles, list, rest)
        }
        Mode::TriangleStrip => {
            // Every second triangle is turned, so that all face the same side.
            let turned =
                given.windows(3).enumerate().flat_map(|(i, t)| if i % 2 == 0 { [t[0], t[1], t[2]] } else { [t[0], t[2], t[1]] });
            (Topology::Triangles, turned.collect(), at_least(3, &given))
        }
        Mode::TriangleFan => {
            let around = given.get(1..).unwrap_or_default().windows(2).flat_map(|e| [e[0], e[1], given[0]]);
            (Topology::Triangles, around.collect(), at_least(3, &given))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use Topology::{Lines, Points, Triangles};

    #[test]
    fn every_mode() {
        for (mode, given, topology, list, rest) in [
            (Mode::Points, vec![4, 2], Points, vec![4, 2], 0),
            (Mode::Lines, vec![0, 1, 2], Lines, vec![0, 1], 1),
            (Mode::LineStrip, vec![0, 1, 2], Lines, vec![0, 1, 1, 2], 0),
            (Mode::LineLoop, vec![0, 1, 2], Lines, vec![0, 1, 1, 2, 2, 0], 0),
            (Mode::LineLoop, vec![7], Lines, vec![], 1),
            (Mode::Triangles, vec![2, 1, 0, 5], Triangles, vec![2, 1, 0], 1),
            (Mode::TriangleStrip, vec![0, 1, 2, 3, 4], Triangles, vec![0, 1, 2, 1, 3, 2, 2, 3, 4], 0),
            (Mode::TriangleFan, vec![0, 1, 2, 3], Triangles, vec![1, 2, 0, 2, 3, 0], 0),
            (Mode::TriangleStrip, vec![0, 1], Triangles, vec![], 2),
            (Mode::TriangleFan, vec![0, 1], Triangles, vec![], 2),
            (Mode::TriangleFan, vec![], Triangles, vec![], 0),
        ] {
            assert_eq!(expand(mode, given.clone()), (topology, list, rest), "{mode:?} {given:?}");
        }
    }
}
