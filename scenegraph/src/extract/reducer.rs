//! Makes reduced casters beside the frames: on a thread of its own, each once per mesh and bound.

use std::collections::HashMap;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Weak};
use umbriel_scene::{Mesh, ReduceError, reduce};

/// A reduced caster and its error in metres, or why there is none.
pub(super) type Made = Result<(Arc<Mesh>, f32), ReduceError>;

/// By mesh and bound. The weak pointer keeps the address from being used again.
type Key = (*const Mesh, u32);

/// A mesh and the error that is allowed, metres.
type Order = (Arc<Mesh>, f32);
/// Both ends of the thread that makes them.
type Worker = (Sender<Order>, Receiver<(Order, Made)>);

/// What is being made, and what was.
#[derive(Default)]
pub(super) struct Reducer {
    /// Makes them at once: pictures that must not depend on how fast a thread is.
    pub(super) waits: bool,
    known: HashMap<Key, (Weak<Mesh>, Option<Made>)>,
    worker: Option<Worker>,
}

impl Reducer {
    /// The reduced caster of a mesh; none as long as it is being made.
    pub(super) fn get(&mut self, mesh: &Arc<Mesh>, max_error_m: f32) -> Option<Made> {
        let key = (Arc::as_ptr(mesh), max_error_m.to_bits());
        if let Some((_, made)) = self.known.get(&key) {
            return made.clone();
        }
        let made = if self.waits { Some(make(mesh, max_error_m)) } else { None };
        self.known.insert(key, (Arc::downgrade(mesh), made.clone()));
        if made.is_none() {
            let (orders, _) = self.worker.get_or_insert_with(start);
            // The worker ends with this end of the channel, not before.
            let _ = orders.send((mesh.clone(), max_error_m));
        }
        made
    }

    /// Takes what was finished; true if there was anything.
    pub(super) fn poll(&mut self) -> bool {
        let Some((_, finished)) = &self.worker else { return false };
        let mut any = false;
        for ((mesh, max_error_m), made) in finished.try_iter() {
            self.known.insert((Arc::as_ptr(&mesh), max_error_m.to_bits()), (Arc::downgrade(&mesh), Some(made)));
            any = true;
        }
        any
    }

    /// Forgets meshes that nobody holds any more.
    pub(super) fn sweep(&mut self) {
        self.known.retain(|_, (mesh, _)| mesh.strong_count() > 0);
    }
}

fn make(mesh: &Mesh, max_error_m: f32) -> Made {
    reduce(mesh, max_error_m).map(|made| (Arc::new(made.mesh), made.error_m))
}

fn start() -> Worker {
    let (orders, to_do) = channel::<Order>();
    let (done, finished) = channel();
    std::thread::spawn(move || {
        for (mesh, max_error_m) in to_do {
            let made = make(&mesh, max_error_m);
            if done.send(((mesh, max_error_m), made)).is_err() {
                break;
            }
        }
    });
    (orders, finished)
}
