//! Contours nodes, and samples per pixel.

use super::World;
use umbriel_scene::Samples;

#[test]
fn groups_of_contours_are_read_and_followed() {
    let mut w = World::new();
    let outer = w.below(&[w.root()], "Contours", "drawing");
    let place = w.below(&[outer], "Transform", "place");
    let inner = w.below(&[place], "Contours", "strong");
    let (a, b) = (w.shape(&[outer], "a"), w.shape(&[inner], "b"));
    w.shape(&[w.root()], "c");
    w.set(inner, "outline_width", 5.0f32);
    let slots = |w: &World, node| w.extractor.drawables_of(node);
    let found = |w: &World| -> Vec<(Vec<usize>, f32)> {
        w.scene.contours.iter().map(|g| (g.drawables.clone(), g.style.outline_px)).collect()
    };
    w.update();
    let mut both = [slots(&w, a), slots(&w, b)].concat();
    both.sort_unstable();
    let mut first = found(&w)[0].0.clone();
    first.sort_unstable();
    assert_eq!((first, found(&w)[1].clone()), (both, (slots(&w, b), 5.0)));
    w.set(inner, "on", false);
    w.update();
    assert_eq!(found(&w).len(), 1, "the inner one is off");
    w.graph.delete(outer).unwrap();
    w.update();
    assert_eq!(found(&w).len(), 0);
}

#[test]
fn samples_are_one_or_four() {
    let mut w = World::new();
    w.update();
    assert_eq!(w.scene.samples, Samples::Four);
    let air = w.below(&[w.root()], "Environment", "air");
    for (count, expected, problem) in [
        (1, Samples::One, None),
        (4, Samples::Four, None),
        (3, Samples::Four, Some("Environment 'air', samples: 3 is neither 1 nor 4; 4 is used")),
    ] {
        w.set(air, "samples", count);
        w.update();
        assert_eq!((w.scene.samples, w.problems().first().map(String::as_str)), (expected, problem));
    }
}
