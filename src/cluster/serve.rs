//! The application: evaluates a world and publishes its frames.

use super::interrupt::Interrupt;
use super::maps_once::MapsOnce;
use super::{Failure, security};
use crate::cli;
use crate::session::Session;
use std::time::{Duration, Instant};
use umbriel_displays::cluster::{Desk, Host, HostOptions, Input};
use umbriel_fields::{Graph, Value};

/// Serves until the last frame, or for ever.
pub(crate) fn serve(args: &cli::Serve) -> Result<usize, Failure> {
    let mut session = Session::open(&args.path)?;
    let options = HostOptions {
        listen: args.listen.clone(),
        security: security(&args.link),
        timeout: Duration::from_millis(args.timeout_ms),
        lease: args.link.lease(),
    };
    let mut host = Host::listen(&options)?;
    let mut desk = Desk::open(&host, &session.name())?;
    let interrupt = Interrupt::watch()?;
    println!("{} is served at {}", session.name(), args.listen);
    let mut once = MapsOnce::default();
    let mut problems = begin(&mut session, &mut once, &mut host, args.wait_for, &mut || Ok(()))?;
    let (started, mut frame) = (Instant::now(), 1u64);
    while args.frames.is_none_or(|frames| frame < frames) && !interrupt.came() {
        let next = started + Duration::from_secs_f64(frame as f64 / args.fps);
        host.wait_until(session.graph(), next);
        frame += 1;
        let is_last = args.frames == Some(frame) || interrupt.came();
        problems += step_with(&mut session, &mut once, &mut host, Some(&mut desk), started.elapsed().as_secs_f64(), is_last);
    }
    println!("{}", summary(&host));
    Ok(problems)
}

/// Publishes the first frame and waits for displays, as long as `goes_on` says nothing else.
pub(super) fn begin(
    session: &mut Session,
    once: &mut MapsOnce,
    host: &mut Host,
    displays: usize,
    goes_on: &mut dyn FnMut() -> Result<(), Failure>,
) -> Result<usize, Failure> {
    let problems = step(session, once, host, 0.0, false);
    while host.in_time() < displays {
        host.wait_until(session.graph(), Instant::now() + Duration::from_millis(20));
        goes_on()?;
    }
    Ok(problems)
}

/// One frame; gives the number of problems.
pub(super) fn step(session: &mut Session, once: &mut MapsOnce, host: &mut Host, time_s: f64, is_last: bool) -> usize {
    step_with(session, once, host, None, time_s, is_last)
}

/// One frame of a world that others work on as well.
fn step_with(
    session: &mut Session,
    once: &mut MapsOnce,
    host: &mut Host,
    mut desk: Option<&mut Desk>,
    time_s: f64,
    is_last: bool,
) -> usize {
    let mut told = 0;
    once.end(session.graph_mut());
    for input in host.inputs() {
        if let Err(reason) = apply(session.graph_mut(), &input) {
            tracing::error!("display `{}`: {reason}", input.display);
            told += 1;
        }
    }
    if let Some(desk) = &mut desk {
        desk.begin(session.graph_mut());
    }
    session.evaluate(time_s);
    once.find(session.graph());
    session.embed();
    if let Some(desk) = &mut desk {
        desk.publish(host, session.graph());
    }
    host.frame(session.graph(), is_last);
    if let Some(desk) = desk {
        desk.welcome(host, session.graph());
    }
    for problem in session.problems() {
        tracing::error!("{problem}");
        told += 1;
    }
    told
}

/// How the frames went, in a line.
pub(super) fn summary(host: &Host) -> String {
    let report = host.report();
    let ms = |wait: Duration| wait.as_secs_f64() * 1e3;
    format!(
        "frames={} bytes={} wait_p50_ms={:.2} wait_p99_ms={:.2} longest_wait_ms={:.1} dropped={} agreed={} disagreed={}",
        report.frames,
        report.bytes,
        ms(report.wait_at(500)),
        ms(report.wait_at(990)),
        ms(report.longest_wait()),
        report.dropped.len(),
        report.agreed,
        report.disagreed
    )
}

/// Writes what a display told into the world.
fn apply(graph: &mut Graph, input: &Input) -> Result<(), String> {
    let node = graph.find(&input.node).ok_or_else(|| format!("there is no node `{}`", input.node))?;
    let value = value(&input.value).ok_or_else(|| format!("`{}` is no value", input.value))?;
    graph.set_named(node, &input.field, value).map_err(|error| error.to_string())
}

/// `true`, `0.5`, `(1.0, 0.0, 0.0)`, `"text"`.
fn value(text: &str) -> Option<Value> {
    let text = text.trim();
    if let Ok(flag) = text.parse::<bool>() {
        return Some(flag.into());
    }
    if let Ok(number) = text.parse::<f64>() {
        return Some(number.into());
    }
    if let Some(quoted) = text.strip_prefix('"').and_then(|text| text.strip_suffix('"')) {
        return Some(quoted.into());
    }
    let inner = text.strip_prefix('(')?.strip_suffix(')')?;
    let numbers: Vec<f32> = inner.split(',').map(|part| part.trim().parse().ok()).collect::<Option<_>>()?;
    match numbers[..] {
        [x, y] => Some(glam::Vec2::new(x, y).into()),
        [x, y, z] => Some(glam::Vec3::new(x, y, z).into()),
        [x, y, z, w] => Some(glam::Vec4::new(x, y, z, w).into()),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_of_inputs() {
        let rows: [(&str, Option<Value>); 7] = [
            ("true", Some(true.into())),
            (" 0.5 ", Some(0.5f64.into())),
            ("\"a b\"", Some("a b".into())),
            ("(1, 2, 3)", Some(glam::Vec3::new(1.0, 2.0, 3.0).into())),
            ("(1)", None),
            ("(1, x)", None),
            ("system()", None),
        ];
        for (text, expected) in rows {
            assert_eq!(value(text), expected, "{text}");
        }
    }
}
