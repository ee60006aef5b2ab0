//! What casts, as shadow maps remember it: pages that did not change are shared from frame to frame.

use glam::{Mat4, Vec3};
use std::sync::Arc;
use umbriel_scene::Aabb;

/// A drawable that casts.
#[derive(Clone, Debug)]
pub(crate) struct Caster {
    /// Its place in [`umbriel_scene::Scene::drawables`].
    pub(crate) index: usize,
    /// Mesh, material where that cuts holes, and revision of the deformation.
    pub(crate) content: [u64; 3],
    pub(crate) has_holes: bool,
    pub(crate) world_from_object: Mat4,
    /// Middle of the mesh at rest, and how far it reaches from there, in the space of the object.
    pub(crate) centre: Vec3,
    pub(crate) reach: f32,
    /// Deformation included.
    pub(crate) bounds_in_world: Aabb,
}

/// All that casts at one time.
pub(crate) struct Snapshot {
    /// In the order of their places; a page holds those of the same places in every snapshot.
    pub(crate) pages: Vec<Arc<[Caster]>>,
    /// Half the diagonal of the box around them, metres.
    pub(crate) radius: f32,
}

/// A page: all that casts, and what has holes.
type Page = [Arc<[Caster]>; 2];

/// Pages as they were last looked at.
#[derive(Default)]
pub(crate) struct Pages {
    pages: Vec<Option<Page>>,
    latest: Option<[Arc<Snapshot>; 2]>,
}

impl Pages {
    /// A page changed.
    pub(super) fn forget(&mut self, page: usize) {
        self.latest = None;
        if let Some(page) = self.pages.get_mut(page) {
            *page = None;
        }
    }

    /// There are no more pages than `count`.
    pub(super) fn truncate(&mut self, count: usize) {
        if count < self.pages.len() {
            self.latest = None;
            self.pages.truncate(count);
        }
    }

    /// What casts now: all of it, and what has holes. `look` finds the casters of a page.
    pub(super) fn snapshots(&mut self, pages: usize, radius: f32, look: impl Fn(usize) -> Arc<[Caster]>) -> [Arc<Snapshot>; 2] {
        if let Some(latest) = &self.latest {
            return latest.clone();
        }
        self.pages.resize(pages, None);
        let of_page = |(number, page): (usize, &mut Option<Page>)| {
            let find = || {
                let all = look(number);
                let with_holes = all.iter().filter(|c| c.has_holes).cloned().collect();
                [all, with_holes]
            };
            page.get_or_insert_with(find).clone()
        };
        let (all, with_holes) = self.pages.iter_mut().enumerate().map(of_page).map(|[all, holed]| (all, holed)).unzip();
        let latest = [all, with_holes].map(|pages| Arc::new(Snapshot { pages, radius }));
        self.latest = Some(latest.clone());
        latest
    }
}
