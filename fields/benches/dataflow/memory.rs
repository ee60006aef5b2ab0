//! Bytes of a node and of a route, by an allocator that counts.

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};

use umbriel_fields::{NoHost, Strength};

use crate::support::{self, graph, row};

struct Counting;

static IN_USE: AtomicUsize = AtomicUsize::new(0);

#[global_allocator]
static COUNTING: Counting = Counting;

// SAFETY: everything is passed on to the system's allocator, whose promises are the same; counting touches no memory of the caller.
#[allow(unsafe_code)]
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        IN_USE.fetch_add(layout.size(), Ordering::Relaxed);
        // SAFETY: the caller's promises are passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        IN_USE.fetch_sub(layout.size(), Ordering::Relaxed);
        // SAFETY: the caller's promises are passed on.
        unsafe { System.dealloc(memory, layout) }
    }

    unsafe fn realloc(&self, memory: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        IN_USE.fetch_add(size, Ordering::Relaxed);
        IN_USE.fetch_sub(layout.size(), Ordering::Relaxed);
        // SAFETY: the caller's promises are passed on.
        unsafe { System.realloc(memory, layout, size) }
    }
}

fn in_use() -> f64 {
    IN_USE.load(Ordering::Relaxed) as f64
}

/// What grows by doubling is up to half empty; so is this figure.
fn nodes_of(node_type: &str, field: &str, count: usize) -> f64 {
    let mut graph = graph();
    graph.evaluate(0.0, &mut NoHost);
    let before = in_use();
    let fields = support::nodes(&mut graph, node_type, count, field);
    graph.evaluate(0.0, &mut NoHost);
    let bytes = in_use() - before - std::mem::size_of_val(&fields[..]) as f64;
    bytes / count as f64
}

fn nodes(count: usize) {
    for (node_type, field, what) in [
        ("Plain", "x", "1 field of f32"),
        ("Placed", "rotation", "vec3, quat, node[]"),
        ("OrientationInterpolator", "key", "5 fields"),
    ] {
        row(&format!("a node with {what}, one of {count}"), nodes_of(node_type, field, count), None);
    }
}

fn routes(count: usize) {
    let mut graph = graph();
    let fields = support::nodes(&mut graph, "Plain", count + 1, "x");
    graph.evaluate(0.0, &mut NoHost);
    let before = in_use();
    for pair in fields.windows(2) {
        graph.connect(pair[0], pair[1], Strength::Strong).unwrap();
    }
    graph.set(fields[0], 1.0f32).unwrap();
    graph.evaluate(0.0, &mut NoHost);
    row(&format!("a route, one of {count} in a chain, with its place in the order"), (in_use() - before) / count as f64, None);
}

pub(crate) fn all() {
    println!("\n{:<66} {:>10}", "bytes", "umbriel");
    nodes(100_000);
    routes(100_000);
}
