//! A list of times at which something is to happen.

use std::sync::Arc;

use crate::{Evaluation, Field, NodeType, SetRule, Time};

const ENABLED: u16 = 0;
const START_TIME: u16 = 1;
const TIMES: u16 = 2;
const PERIOD: u16 = 3;
const EVENT: u16 = 4;
const INDEX: u16 = 5;
const EVENT_TIME: u16 = 6;
const TOLD: u16 = 7;

pub(super) fn scheduler() -> NodeType {
    NodeType::new("Scheduler", "Tells when the times of a list have come, once or again and again.")
        .field(Field::new("enabled", true).doc("Runs at all; what falls due while it does not is told when it does."))
        .field(Field::new("start_time", Time(0.0)).unit("s").doc("What the times count from."))
        .field(Field::many::<Time>("times").unit("s").doc("When, after the start; ascending."))
        .field(
            Field::new("period", Time(0.0))
                .unit("s")
                .range(0.0, f64::INFINITY)
                .doc("After this time the list begins anew; 0 is never."),
        )
        .field(
            Field::new("event", false)
                .on_set(SetRule::Pulse)
                .output()
                .doc("True, written when a time has come; once a frame, for the last of several."),
        )
        .field(Field::new("index", -1i32).on_set(SetRule::Pulse).output().doc("Which time of the list has come."))
        .field(Field::new("event_time", Time(0.0)).unit("s").output().doc("When that was due."))
        .field(Field::new("told", 0i64).output().doc("How many times have come since the start."))
        .evaluate(evaluate)
}

fn evaluate(evaluation: &mut Evaluation<'_>) {
    let [start, period] = [START_TIME, PERIOD].map(|index| evaluation.get::<Time>(index).0);
    let times: Arc<[Time]> = evaluation.get(TIMES);
    let is_new = evaluation.changed(TIMES) || evaluation.changed(PERIOD) || evaluation.changed(START_TIME);
    if let Some(fault) = fault(&times, start, period) {
        if is_new {
            evaluation.report_field(TIMES, fault);
        }
        return;
    }
    let passed_s = evaluation.time() - start;
    let told = if is_new { 0 } else { evaluation.get(TOLD) };
    let laps = if period > 0.0 { (passed_s / period).floor() } else { 0.0 };
    let in_lap_s = passed_s - laps * period;
    let before = (laps as i64).saturating_mul(times.len() as i64);
    let due = if passed_s < 0.0 { 0 } else { before.saturating_add(times.partition_point(|time| time.0 <= in_lap_s) as i64) };
    if times.is_empty() || !evaluation.get::<bool>(ENABLED) {
        return evaluation.set(TOLD, told);
    }
    if due > told {
        let last = (due - 1) as usize;
        let (lap, index) = (last / times.len(), last % times.len());
        evaluation.set(INDEX, index as i32);
        evaluation.set(EVENT_TIME, Time(start + lap as f64 * period + times[index].0));
        evaluation.set(EVENT, true);
    }
    evaluation.set(TOLD, due.max(told));
    if period > 0.0 || (due as usize) < times.len() {
        evaluation.again();
    }
}

fn fault(times: &[Time], start: f64, period: f64) -> Option<String> {
    if !start.is_finite() || !period.is_finite() {
        return Some(format!("cannot run: start_time is {start} s and period {period} s"));
    }
    if let Some(at) = times.iter().position(|time| !time.0.is_finite() || time.0 < 0.0) {
        return Some(format!("times[{at}] is {} s", times[at].0));
    }
    if let Some(at) = times.windows(2).position(|pair| pair[1] < pair[0]) {
        return Some(format!(
            "the times must not descend: times[{}] = {} s comes after {} s",
            at + 1,
            times[at + 1].0,
            times[at].0
        ));
    }
    let last = times.last().filter(|last| period > 0.0 && last.0 >= period)?;
    Some(format!("the last of the times, {} s, is not within the period of {period} s", last.0))
}
