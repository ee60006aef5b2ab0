//! The list of what is drawn, in pages that know whether they were changed.

use crate::Drawable;
use std::ops::{Deref, Index, IndexMut, Range};
use std::sync::Arc;

/// Tells a page as it is from the same page before and after: equal stamps, equal contents. Whoever keeps a copy will see that it differs
/// from the page's once that is changed.
#[derive(Clone, Debug, Default)]
pub struct Stamp(Arc<()>);

impl PartialEq for Stamp {
    fn eq(&self, other: &Stamp) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

impl Stamp {
    /// The page is about to change. As long as nobody has a copy, nobody needs to see it.
    fn renew(&mut self) {
        if Arc::get_mut(&mut self.0).is_none() {
            *self = Stamp::default();
        }
    }
}

/// Drawables by place. Reading is that of a slice; whatever may write marks the pages that it may write to.
#[derive(Clone, Debug, Default)]
pub struct Drawables {
    list: Vec<Drawable>,
    stamps: Vec<Stamp>,
}

impl Drawables {
    /// Places of a page.
    pub const PAGE: usize = 64;

    /// One for each page, the last of which may be shorter.
    pub fn stamps(&self) -> &[Stamp] {
        &self.stamps
    }

    /// The places of a page in a list of `count`.
    pub fn places(page: usize, count: usize) -> Range<usize> {
        page * Self::PAGE..count.min((page + 1) * Self::PAGE)
    }

    /// To change one drawable; none behind the end.
    pub fn get_mut(&mut self, place: usize) -> Option<&mut Drawable> {
        let drawable = self.list.get_mut(place)?;
        self.stamps[place / Self::PAGE].renew();
        Some(drawable)
    }

    /// To change them all.
    pub fn iter_mut(&mut self) -> std::slice::IterMut<'_, Drawable> {
        self.stamps.iter_mut().for_each(Stamp::renew);
        self.list.iter_mut()
    }

    /// One more at the end.
    pub fn push(&mut self, drawable: Drawable) {
        self.list.push(drawable);
        self.fit(self.list.len() - 1);
    }

    /// Leaves the first ones.
    pub fn truncate(&mut self, count: usize) {
        if count < self.list.len() {
            self.list.truncate(count);
            self.fit(count);
        }
    }

    /// Truncates, or adds copies.
    pub fn resize(&mut self, count: usize, drawable: Drawable) {
        let before = self.list.len();
        self.list.resize(count, drawable);
        self.fit(before.min(count));
    }

    /// As many stamps as pages; new ones from that of a place on.
    fn fit(&mut self, changed_from: usize) {
        self.stamps.truncate(self.list.len().div_ceil(Self::PAGE));
        self.stamps.iter_mut().skip(changed_from / Self::PAGE).for_each(Stamp::renew);
        self.stamps.resize_with(self.list.len().div_ceil(Self::PAGE), Stamp::default);
    }
}

impl From<Vec<Drawable>> for Drawables {
    fn from(list: Vec<Drawable>) -> Drawables {
        let mut drawables = Drawables { list, stamps: Vec::new() };
        drawables.fit(0);
        drawables
    }
}

impl FromIterator<Drawable> for Drawables {
    fn from_iter<I: IntoIterator<Item = Drawable>>(list: I) -> Drawables {
        Vec::from_iter(list).into()
    }
}

impl Deref for Drawables {
    type Target = [Drawable];

    fn deref(&self) -> &[Drawable] {
        &self.list
    }
}

impl Index<usize> for Drawables {
    type Output = Drawable;

    fn index(&self, place: usize) -> &Drawable {
        &self.list[place]
    }
}

impl IndexMut<usize> for Drawables {
    fn index_mut(&mut self, place: usize) -> &mut Drawable {
        self.stamps[place / Self::PAGE].renew();
        &mut self.list[place]
    }
}

impl<'a> IntoIterator for &'a Drawables {
    type Item = &'a Drawable;
    type IntoIter = std::slice::Iter<'a, Drawable>;

    fn into_iter(self) -> Self::IntoIter {
        self.list.iter()
    }
}

impl<'a> IntoIterator for &'a mut Drawables {
    type Item = &'a mut Drawable;
    type IntoIter = std::slice::IterMut<'a, Drawable>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter_mut()
    }
}

impl IntoIterator for Drawables {
    type Item = Drawable;
    type IntoIter = std::vec::IntoIter<Drawable>;

    fn into_iter(self) -> Self::IntoIter {
        self.list.into_iter()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drawable() -> Drawable {
        Drawable {
            name: String::new(),
            mesh: Arc::default(),
            material: Arc::default(),
            world_from_object: glam::Mat4::IDENTITY,
            pose: None,
            bounds_in_world: crate::Aabb::EMPTY,
            visible: true,
            casts_shadow: true,
            receives_shadow: true,
            receives: None,
            revision: 0,
        }
    }

    /// Pages whose stamp is not what it was.
    fn changed(before: &[Stamp], now: &Drawables) -> Vec<usize> {
        (0..now.stamps().len()).filter(|page| before.get(*page) != now.stamps().get(*page)).collect()
    }

    #[test]
    fn only_pages_that_may_have_changed_get_new_stamps() {
        let count = 2 * Drawables::PAGE + 3;
        let whole: Drawables = (0..count).map(|_| drawable()).collect();
        type Change = fn(&mut Drawables);
        let rows: [(&str, Change, &[usize]); 9] = [
            ("reading", |list| assert!(list[3].visible && list.iter().len() > 3 && list.get(9999).is_none()), &[]),
            ("one", |list| list[Drawables::PAGE].visible = false, &[1]),
            ("one, behind the end", |list| assert!(list.get_mut(9999).is_none()), &[]),
            ("all", |list| list.iter_mut().for_each(|d| d.visible = false), &[0, 1, 2]),
            ("one more", |list| list.push(drawable()), &[2]),
            ("as many as before", |list| list.truncate(9999), &[]),
            ("fewer", |list| list.truncate(Drawables::PAGE + 1), &[1]),
            ("whole pages fewer", |list| list.truncate(Drawables::PAGE), &[]),
            ("more", |list| list.resize(4 * Drawables::PAGE, drawable()), &[2, 3]),
        ];
        for (name, change, expected) in rows {
            let mut list = whole.clone();
            let before = list.stamps().to_vec();
            change(&mut list);
            assert_eq!(changed(&before, &list), expected, "{name}");
            assert_eq!(list.stamps().len(), list.len().div_ceil(Drawables::PAGE), "{name}");
            assert_eq!(changed(whole.stamps(), &whole), [0; 0], "{name}: copies do not see each other's changes");
        }
    }

    #[test]
    fn copies_that_change_differ_from_each_other() {
        let mut a: Drawables = vec![drawable()].into();
        let mut b = a.clone();
        assert_eq!(a.stamps(), b.stamps());
        a[0].visible = false;
        let seen = a.stamps().to_vec();
        b[0].casts_shadow = false;
        assert_ne!(seen, b.stamps());
        // What nobody saw needs no stamp of its own.
        b[0].visible = false;
        assert_ne!(seen, b.stamps());
        drop(seen);
        let address = Arc::as_ptr(&b.stamps()[0].0);
        b[0].visible = true;
        assert_eq!(address, Arc::as_ptr(&b.stamps()[0].0));
    }
}
