//! Makes neighbours wind alike, and closed pieces face outward.

use super::pairs::{Crowded, NONE, Pairs};
use super::soup::Soup;
use glam::DVec3;

/// A piece that hangs together by edges of two triangles.
struct Piece {
    triangles: Vec<u32>,
    /// Must be turned so that all wind like the first.
    against: Vec<bool>,
    closed: bool,
    /// Neighbours that cannot be made to wind alike: a Moebius strip.
    twisted: bool,
}

/// Turns triangles. Closed pieces face outward, but for one that lies within another and faced inward as a whole: that is
/// the inside of a hollow body. Open pieces face the side that more of their area faced; so do all where `outward` is false:
/// whoever sees a roof from above must see it when the doctor has closed it below.
pub(super) fn turn(soup: &mut Soup, outward: bool) {
    let edges = soup.edges();
    let pairs = Pairs::new(soup, &edges, Crowded::Open);
    let mut seen = vec![false; soup.triangles.len()];
    let mut pieces = Vec::new();
    for first in 0..soup.triangles.len() {
        if !seen[first] {
            pieces.push(piece(soup, &pairs, first, &mut seen));
        }
    }
    let boxes: Vec<(DVec3, DVec3)> = pieces.iter().map(|p| bounds(soup, p)).collect();
    for (number, piece) in pieces.iter().enumerate() {
        let volume = |piece: &Piece| {
            let signs = piece.against.iter().map(|a| if *a { -1.0 } else { 1.0 });
            piece.triangles.iter().zip(signs).map(|(t, sign)| sign * six_volumes(soup, *t as usize, boxes[number].0)).sum::<f64>()
        };
        let all_against = if outward && piece.closed && !piece.twisted {
            let volume = volume(piece);
            let was_alike = piece.against.iter().all(|a| !*a);
            let is_within = |other: &usize| {
                *other != number
                    && pieces[*other].closed
                    && boxes[*other].0.cmplt(boxes[number].0).all()
                    && boxes[*other].1.cmpgt(boxes[number].1).all()
            };
            let is_cavity = was_alike && volume < 0.0 && (0..pieces.len()).any(|o| is_within(&o));
            volume < 0.0 && !is_cavity
        } else {
            let area = |t: u32| soup.scaled_normal(t as usize).length();
            let against: f64 = piece.triangles.iter().zip(&piece.against).filter(|(_, a)| **a).map(|(t, _)| area(*t)).sum();
            let all: f64 = piece.triangles.iter().map(|t| area(*t)).sum();
            against > 0.5 * all
        };
        for (t, against) in piece.triangles.iter().zip(&piece.against) {
            if *against != all_against {
                soup.turn(*t as usize);
            }
        }
    }
}

fn six_volumes(soup: &Soup, triangle: usize, from: DVec3) -> f64 {
    let [a, b, c] = soup.points(triangle).map(|p| p - from);
    a.dot(b.cross(c))
}

fn bounds(soup: &Soup, piece: &Piece) -> (DVec3, DVec3) {
    let points = piece.triangles.iter().flat_map(|t| soup.points(*t as usize));
    points.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)))
}

/// Walks over all that hangs on the first triangle.
fn piece(soup: &Soup, pairs: &Pairs, first: usize, seen: &mut [bool]) -> Piece {
    let mut piece = Piece { triangles: vec![first as u32], against: vec![false], closed: true, twisted: false };
    let mut against = std::collections::HashMap::from([(first as u32, false)]);
    seen[first] = true;
    let mut next = 0;
    while next < piece.triangles.len() {
        let (t, is_against) = (piece.triangles[next], piece.against[next]);
        next += 1;
        let corners = soup.corners(t as usize);
        for (side, other) in pairs.across[t as usize].iter().enumerate() {
            if *other == NONE {
                piece.closed = false;
                continue;
            }
            let (from, to) = (corners[side], corners[(side + 1) % 3]);
            let theirs = soup.corners(*other as usize);
            let winds_the_same = (0..3).any(|i| (theirs[i], theirs[(i + 1) % 3]) == (from, to));
            let should_be = is_against != winds_the_same;
            match against.get(other) {
                Some(known) => piece.twisted |= *known != should_be,
                None => {
                    against.insert(*other, should_be);
                    seen[*other as usize] = true;
                    piece.triangles.push(*other);
                    piece.against.push(should_be);
                }
            }
        }
    }
    piece
}
