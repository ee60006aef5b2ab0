//! What makes a renderer ready soon: pipelines are made when they are first needed, and those that are needed together at the same time.

use crate::{Error, Gpu, Renderer};
use std::sync::LazyLock;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread::{JoinHandle, ScopedJoinHandle};
use std::time::Instant;

/// A device and its renderer, which are being made while the caller sees to something else.
pub struct Starting(Option<JoinHandle<Result<(Gpu, Renderer), Error>>>);

impl Starting {
    /// Begins.
    pub fn begin() -> Starting {
        Starting(Some(std::thread::spawn(|| {
            let began = Instant::now();
            let gpu = Gpu::new(None)?;
            let found = began.elapsed();
            let renderer = Renderer::new(&gpu)?;
            tracing::debug!("`{}` was found in {found:.0?}, its renderer is there after {:.0?}", gpu.info.name, began.elapsed());
            Ok((gpu, renderer))
        })))
    }

    /// True once [`Starting::finish`] does not wait.
    pub fn is_done(&self) -> bool {
        self.0.as_ref().is_none_or(JoinHandle::is_finished)
    }

    /// Waits for them.
    ///
    /// # Errors
    /// As of [`Gpu::new`] and [`Renderer::new`].
    pub fn finish(mut self) -> Result<(Gpu, Renderer), Error> {
        match self.0.take().map(JoinHandle::join) {
            Some(Ok(made)) => made,
            Some(Err(panic)) => std::panic::resume_unwind(panic),
            None => Err(Error::NoDevice("nothing was begun".into())),
        }
    }
}

impl Drop for Starting {
    /// Drivers do not stand it if the process ends while they are at work.
    fn drop(&mut self) {
        let _ = self.0.take().map(JoinHandle::join);
    }
}

/// What is made when it is first used.
pub(crate) type Late<T> = LazyLock<T, Box<dyn FnOnce() -> T + Send>>;

/// Makes something when it is first used.
pub(crate) fn late<T>(make: impl FnOnce() -> T + Send + 'static) -> Late<T> {
    LazyLock::new(Box::new(make))
}

/// What a thread made; its panic goes on here.
pub(crate) fn joined<T>(thread: ScopedJoinHandle<'_, T>) -> T {
    thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
}

/// Makes one thing of each item, in their order, on all processors.
pub(crate) fn at_once<I: Sync, T: Send>(items: &[I], make: impl Fn(&I) -> T + Sync) -> Vec<T> {
    let threads = std::thread::available_parallelism().map_or(1, usize::from).min(items.len());
    let next = AtomicUsize::new(0);
    let work = || {
        let places = std::iter::from_fn(|| Some(next.fetch_add(1, Ordering::Relaxed)).filter(|place| *place < items.len()));
        places.map(|place| (place, make(&items[place]))).collect::<Vec<_>>()
    };
    let mut made = std::thread::scope(|scope| {
        let others: Vec<_> = (1..threads).map(|_| scope.spawn(work)).collect();
        let mut made = work();
        for other in others {
            made.extend(joined(other));
        }
        made
    });
    made.sort_by_key(|(place, _)| *place);
    made.into_iter().map(|(_, made)| made).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn everything_is_made_once_and_in_order() {
        for count in [0, 1, 2, 7, 100] {
            let calls = AtomicUsize::new(0);
            let items: Vec<usize> = (0..count).collect();
            let made = at_once(&items, |item| {
                calls.fetch_add(1, Ordering::Relaxed);
                item * item
            });
            assert_eq!(made, items.iter().map(|item| item * item).collect::<Vec<_>>());
            assert_eq!(calls.into_inner(), count);
        }
    }
}
