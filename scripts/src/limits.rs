//! Bounds on what a script may use, and the meter that watches them.

use std::cell::{Cell, RefCell};
use std::time::{Duration, Instant};

use crate::weigh::Scales;

/// What a script may use. A script that wants more ends with a report; a handler is switched off.
#[derive(Clone, Debug, PartialEq)]
pub struct Limits {
    /// Time for the main script; loading models does not count.
    pub main: Duration,
    /// Time for one call of a handler.
    pub handler: Duration,
    /// Script functions that may be inside each other.
    pub call_depth: usize,
    /// Elements of one array, nested ones included.
    pub array_len: usize,
    /// Bytes of one string, or of all strings of one array.
    pub string_len: usize,
    /// Entries of one map, nested ones included.
    pub map_len: usize,
    /// Bytes of all values that a script holds in its variables, about; and of all that its handlers hold together.
    pub memory: usize,
    /// Nodes in the graph.
    pub nodes: usize,
    /// Bytes of all arrays that scripts wrote into fields, about.
    pub field_memory: usize,
    /// Handlers of frames and of fields.
    pub handlers: usize,
    /// Bytes of script text, includes counted.
    pub text: usize,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            main: Duration::from_secs(20),
            handler: Duration::from_millis(250),
            call_depth: 64,
            array_len: 1_000_000,
            string_len: 1_000_000,
            map_len: 100_000,
            memory: 512 << 20,
            nodes: 200_000,
            field_memory: 1 << 30,
            handlers: 10_000,
            text: 4 << 20,
        }
    }
}

/// The clock and the scales beside a running script.
pub(crate) struct Meter {
    operations: Cell<u64>,
    deadline: Cell<Option<(Instant, Duration)>>,
    next_weighing: Cell<u64>,
    weighed: Cell<(Instant, Duration)>,
    scales: RefCell<Scales>,
    /// Time that scripts took since all handlers were weighed, and how long that weighing took.
    unweighed: Cell<(Duration, Duration)>,
}

/// Operations between two looks at the clock: about 10 us.
const CLOCK_EVERY: u64 = 128;
/// Operations after which values are weighed in any case, so that nesting, which grows by at most one level an
/// operation, stays within what the stack of a script carries.
const WEIGH_EVERY: u64 = 100_000;

impl Meter {
    pub(crate) fn new(memory: usize) -> Self {
        Self {
            operations: Cell::new(0),
            deadline: Cell::new(None),
            next_weighing: Cell::new(0),
            weighed: Cell::new((Instant::now(), Duration::ZERO)),
            scales: RefCell::new(Scales::new(memory)),
            unweighed: Cell::default(),
        }
    }

    /// Runs `work` against the clock; calls inside each other share the outer deadline.
    pub(crate) fn within<T>(&self, time: Duration, work: impl FnOnce() -> T) -> T {
        let outer = self.deadline.get();
        if outer.is_none() {
            self.deadline.set(Some((Instant::now() + time, time)));
            self.scales.borrow_mut().clear();
        }
        let start = Instant::now();
        let result = work();
        if outer.is_none() {
            let (spent, took) = self.unweighed.get();
            self.unweighed.set((spent + start.elapsed(), took));
        }
        self.deadline.set(outer);
        result
    }

    /// Runs `work` with the clock stopped: reading files is not the script's fault.
    pub(crate) fn uncounted<T>(&self, work: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let result = work();
        self.deadline.set(self.deadline.get().map(|(end, time)| (end + start.elapsed(), time)));
        result
    }

    /// Whether scripts ran long enough since all handlers were weighed: growth takes time, and weighing a fifth of it at most.
    pub(crate) fn handlers_are_due(&self) -> bool {
        let (spent, took) = self.unweighed.get();
        spent > (took * 4).max(Duration::from_millis(20))
    }

    /// All handlers were weighed, which took so long.
    pub(crate) fn handlers_weighed(&self, took: Duration) {
        self.unweighed.set((Duration::ZERO, took));
    }

    /// Called for every operation of a script; says why it must end, if it must.
    pub(crate) fn tick(&self) -> Option<String> {
        let operations = self.operations.get() + 1;
        self.operations.set(operations);
        if !operations.is_multiple_of(CLOCK_EVERY) {
            return None;
        }
        self.expired()
    }

    fn expired(&self) -> Option<String> {
        let (end, time) = self.deadline.get()?;
        (Instant::now() > end).then(|| format!("ran longer than {} ms", time.as_millis()))
    }

    /// Called where variables can be seen; says why the script must end, if it must. Weighing takes at most about a
    /// quarter of the time, so that growth between two weighings is in proportion to what is there already.
    pub(crate) fn weigh(&self, level: usize, scope: &rhai::Scope<'_>) -> Option<String> {
        let operations = self.operations.get();
        if operations < self.next_weighing.get() {
            return None;
        }
        let (last, took) = self.weighed.get();
        let now = Instant::now();
        self.next_weighing.set(operations + CLOCK_EVERY);
        let overdue = operations >= self.next_forced();
        if !overdue && now.duration_since(last) < (took * 3).max(Duration::from_micros(300)) {
            return None;
        }
        let verdict = self.scales.borrow_mut().weigh(level, scope);
        self.weighed.set((Instant::now(), now.elapsed()));
        self.scales.borrow_mut().last_operation = operations;
        verdict
    }

    /// The run that is going on begins with these variables.
    pub(crate) fn begin_with(&self, scope: &rhai::Scope<'_>) {
        self.scales.borrow_mut().begin_with(scope);
    }

    fn next_forced(&self) -> u64 {
        self.scales.borrow().last_operation + WEIGH_EVERY
    }
}
