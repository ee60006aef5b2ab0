//! How many bytes the variables of a script hold.
//!
//! rhai's own size limits look at one value at a time, and not at all at `map[key] = value`, at closures or at values
//! that are shared. The scales look at everything that can be reached from the variables that are in scope.

use std::collections::HashSet;

use rhai::{Array, Dynamic, FnPtr, ImmutableString, Map, Scope};

/// Levels of arrays, maps and closures inside each other.
const DEPTH: usize = 200_000;
/// Bytes of one value in its container; a vector or a node sits in two boxes of its own.
const CELL: usize = size_of::<Dynamic>();
const BOXED: usize = 64;
const MAP_ENTRY: usize = 64;
/// Bytes that a line of the console may add to variables that hold too much already.
const ROOM: usize = 64 << 10;

/// Weighs scopes, one for each level of calls: what callers hold counts too.
pub(crate) struct Scales {
    limit: usize,
    /// What was held before the run that is weighed: more than the limit where handlers were switched off too late.
    held_before: usize,
    levels: Vec<usize>,
    pub(crate) last_operation: u64,
}

impl Scales {
    pub(crate) fn new(limit: usize) -> Self {
        Self { limit, held_before: 0, levels: Vec::new(), last_operation: 0 }
    }

    /// A new run begins.
    pub(crate) fn clear(&mut self) {
        self.levels.clear();
        self.held_before = 0;
    }

    /// The run begins with these variables. It may use them, however much they hold, and add a little.
    pub(crate) fn begin_with(&mut self, scope: &Scope<'_>) {
        self.held_before = weight(scope.iter_raw().map(|(_, _, value)| value)).saturating_add(ROOM);
    }

    /// Says why the script must end, if it must.
    pub(crate) fn weigh(&mut self, level: usize, scope: &Scope<'_>) -> Option<String> {
        self.levels.resize(level + 1, 0);
        self.levels[level] = 0;
        let held: usize = self.levels.iter().sum();
        let mut load = Load { bytes: 0, limit: self.limit.max(self.held_before).saturating_sub(held), seen: HashSet::new() };
        let verdict = scope.iter_raw().try_for_each(|(_, _, value)| load.add(value, 0));
        self.levels[level] = load.bytes;
        match verdict {
            Ok(()) => None,
            Err(Excess::Bytes) => Some(format!("the values of the script need more than {} MB", self.limit >> 20)),
            Err(Excess::Depth) => Some(format!("values are nested more than {DEPTH} deep")),
        }
    }
}

/// What values hold together, those that are shared counted once; too deep nesting weighs as much as can be.
pub(crate) fn weight<'a>(values: impl IntoIterator<Item = &'a Dynamic>) -> usize {
    let mut load = Load { bytes: 0, limit: usize::MAX, seen: HashSet::new() };
    match values.into_iter().try_for_each(|value| load.add(value, 0)) {
        Ok(()) => load.bytes,
        Err(_) => usize::MAX,
    }
}

enum Excess {
    Bytes,
    Depth,
}

struct Load {
    bytes: usize,
    limit: usize,
    seen: HashSet<usize>,
}

impl Load {
    fn add(&mut self, value: &Dynamic, depth: usize) -> Result<(), Excess> {
        if depth > DEPTH {
            return Err(Excess::Depth);
        }
        if value.is_shared() && !self.is_first_visit(value) {
            return Ok(());
        }
        self.bytes += self.own_size(value);
        if self.bytes > self.limit {
            return Err(Excess::Bytes);
        }
        if let Some(array) = value.read_lock::<Array>() {
            return array.iter().try_for_each(|v| self.add(v, depth + 1));
        }
        if let Some(map) = value.read_lock::<Map>() {
            return map.values().try_for_each(|v| self.add(v, depth + 1));
        }
        if let Some(closure) = value.read_lock::<FnPtr>() {
            return closure.iter_curry().try_for_each(|v| self.add(v, depth + 1));
        }
        Ok(())
    }

    /// A shared value is known by where it lies; one that is being written right now was seen before.
    fn is_first_visit(&mut self, value: &Dynamic) -> bool {
        !value.is_locked() && value.read_lock::<Dynamic>().is_some_and(|inner| self.seen.insert(&raw const *inner as usize))
    }

    fn own_size(&self, value: &Dynamic) -> usize {
        if value.is_int() || value.is_float() || value.is_bool() || value.is_unit() {
            return CELL;
        }
        if let Some(text) = value.read_lock::<ImmutableString>() {
            return CELL + text.len();
        }
        if let Some(map) = value.read_lock::<Map>() {
            return CELL + MAP_ENTRY * map.len() + map.keys().map(|k| k.len()).sum::<usize>();
        }
        CELL + BOXED
    }
}
