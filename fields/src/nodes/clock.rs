//! The clock of a world.

use crate::{Evaluation, Field, NodeType, SetRule, Time};

const ENABLED: u16 = 0;
const CYCLE_INTERVAL: u16 = 1;
const LOOP: u16 = 2;
const START_TIME: u16 = 3;
const STOP_TIME: u16 = 4;
const FRACTION_CHANGED: u16 = 5;
const TIME: u16 = 6;
const IS_ACTIVE: u16 = 7;
const CYCLE_TIME: u16 = 8;
const PAUSE_TIME: u16 = 9;
const RESUME_TIME: u16 = 10;
const ELAPSED_TIME: u16 = 11;
const IS_PAUSED: u16 = 12;
const PAUSED_FOR: u16 = 13;

pub(super) fn time_sensor() -> NodeType {
    NodeType::new("TimeSensor", "A clock. It reads the time of the frame, which is the same for all nodes.")
        .field(Field::new("enabled", true).doc("Runs at all."))
        .field(Field::new("cycle_interval", Time(1.0)).unit("s").doc("Length of a cycle; more than zero."))
        .field(
            Field::new("loop", false)
                .doc("Starts the next cycle at the end of a cycle; without it, the present cycle is the last."),
        )
        .field(Field::new("start_time", Time(0.0)).unit("s").doc("When the first cycle starts."))
        .field(Field::new("stop_time", Time(0.0)).unit("s").doc("When it stops, if that is after `start_time`."))
        .field(
            Field::new("fraction_changed", 0.0f32)
                .on_set(SetRule::Pulse)
                .output()
                .range(0.0, 1.0)
                .doc("Share of the cycle that has passed; 1 at its end."),
        )
        .field(Field::new("time", Time(0.0)).unit("s").output().doc("The time, while it runs."))
        .field(Field::new("is_active", false).output().doc("Whether it runs."))
        .field(Field::new("cycle_time", Time(0.0)).unit("s").output().doc("When the present cycle started."))
        .field(Field::new("pause_time", Time(0.0)).unit("s").doc("When it pauses, if that is after `start_time`."))
        .field(
            Field::new("resume_time", Time(0.0)).unit("s").doc("When it goes on where it paused, if that is after `pause_time`."),
        )
        .field(Field::new("elapsed_time", Time(0.0)).unit("s").output().doc("How long it has run, without pauses."))
        .field(Field::new("is_paused", false).output().doc("Whether it pauses."))
        .field(Field::new("paused_for", Time(0.0)).unit("s").output().doc("How long it has paused since `start_time`."))
        .evaluate(evaluate)
}

fn evaluate(evaluation: &mut Evaluation<'_>) {
    let now = evaluation.time();
    let interval = evaluation.get::<Time>(CYCLE_INTERVAL).0;
    let start = evaluation.get::<Time>(START_TIME).0;
    let stop = evaluation.get::<Time>(STOP_TIME).0;
    let valid = interval > 0.0 && interval.is_finite() && start.is_finite();
    if !valid && (evaluation.changed(CYCLE_INTERVAL) || evaluation.changed(START_TIME)) {
        evaluation.report_field(CYCLE_INTERVAL, format!("cannot run: cycle_interval is {interval} s and start_time {start} s"));
    }
    let enabled = valid && evaluation.get::<bool>(ENABLED);
    let was_active = evaluation.get::<bool>(IS_ACTIVE);
    let (paused_s, is_paused) = if enabled && was_active { pauses(evaluation, start) } else { (0.0, false) };
    let elapsed_s = if is_paused { evaluation.get::<Time>(ELAPSED_TIME).0 } else { now - start - paused_s };
    let cycles = elapsed_s / interval;
    let stopped = stop > start && now >= stop;
    // A clock that no longer loops runs to the end of its cycle (X3D 4 section 8.2.4.4).
    let seen = if was_active { evaluation.get::<Time>(ELAPSED_TIME).0 / interval } else { 0.0 };
    let last = seen.ceil().max(1.0);
    let over = !evaluation.get::<bool>(LOOP) && cycles >= last;
    let active = enabled && now >= start && !stopped && !over;
    if active && !is_paused {
        // A frame at the end of a cycle shows its end, not the beginning of the next (X3D 4 section 8.2.4.5).
        let share = cycles.fract();
        let at_end = share == 0.0 && cycles > 0.0;
        let cycle = if at_end { cycles - 1.0 } else { cycles.floor() };
        evaluation.set(FRACTION_CHANGED, if at_end { 1.0 } else { share as f32 });
        evaluation.set(CYCLE_TIME, Time(start + paused_s + cycle * interval));
        evaluation.set(ELAPSED_TIME, Time(elapsed_s));
        evaluation.set(TIME, Time(now));
    } else if enabled && over && !stopped && was_active {
        evaluation.set(FRACTION_CHANGED, 1.0f32);
        evaluation.set(ELAPSED_TIME, Time(last * interval));
        evaluation.set(TIME, Time(now));
    }
    evaluation.set(PAUSED_FOR, Time(paused_s));
    evaluation.set(IS_PAUSED, active && is_paused);
    evaluation.set(IS_ACTIVE, active);
    if active || enabled && now < start {
        evaluation.again();
    }
}

/// How long a running clock has paused since its start, and whether it does now (X3D 4 section 8.2.4.4). Its elapsed time stands still meanwhile.
fn pauses(evaluation: &mut Evaluation<'_>, start: f64) -> (f64, bool) {
    let now = evaluation.time();
    let [pause, resume, elapsed, before] =
        [PAUSE_TIME, RESUME_TIME, ELAPSED_TIME, PAUSED_FOR].map(|index| evaluation.get::<Time>(index).0);
    let pauses = pause > start && now >= pause && (resume < pause || now < resume);
    match (evaluation.get::<bool>(IS_PAUSED), pauses) {
        (false, false) => (before, false),
        (true, true) => (before, true),
        (false, true) => {
            evaluation.set(ELAPSED_TIME, Time(pause - start - before));
            (before, true)
        }
        (true, false) => {
            // What was written meanwhile may say that it should never have paused.
            let paused_at = start + before + elapsed;
            let resumed = if resume > paused_at && resume <= now { resume } else { now };
            (resumed - start - elapsed, false)
        }
    }
}
