//! The application: evaluates a world and publishes its frames.

use super::interrupt::Interrupt;
use super::maps_once::MapsOnce;
use super::refusals::lines;
use super::{Failure, security};
use crate::cli;
use crate::console::Console;
use crate::session::Session;
use std::time::{Duration, Instant};
use umbriel_displays::cluster::{Desk, Event, Host, HostOptions};

/// Serves until the last frame, or for ever.
pub(crate) fn serve(args: &cli::Serve) -> Result<usize, Failure> {
    let mut session = Session::open(&args.path)?;
    let options = HostOptions {
        listen: args.listen.clone(),
        security: security(&args.link),
        timeout: Duration::from_millis(args.timeout_ms),
        lease: args.link.lease(),
        ahead: true,
        lines: Some(lines),
    };
    let mut host = Host::listen(&options)?;
    let mut desk = Desk::open(&host, &session.name())?;
    let interrupt = Interrupt::watch()?;
    say!("{} is served at {}", session.name(), args.listen);
    let mut once = MapsOnce::default();
    let mut problems = begin(&mut session, &mut once, &mut host, args.wait_for, &mut || Ok(()))?;
    let console = Console::open(args.console);
    let (started, mut frame) = (Instant::now(), 1u64);
    while args.frames.is_none_or(|frames| frame < frames) && !interrupt.came() {
        let next = started + Duration::from_secs_f64(frame as f64 / args.fps);
        host.wait_until(session.graph(), next);
        frame += 1;
        if let Some(console) = &console {
            problems += console.run_all(&mut |line| session.console(line));
        }
        let is_last = args.frames == Some(frame) || interrupt.came();
        problems += step_with(&mut session, &mut once, &mut host, Some(&mut desk), started.elapsed().as_secs_f64(), is_last);
    }
    say!("{}", summary(&host));
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
        tracing::debug!("display `{}`: {:?}", input.display, input.event);
        match input.event {
            Event::Moved(motion) => motion.with(|input| session.navigate(input)),
            Event::Home => session.reset_navigation(),
            Event::Pointed(pointing) => session.pointed(&input.display, &pointing.pointed()),
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
        ms(report.waits.quantile(0.5)),
        ms(report.waits.quantile(0.99)),
        ms(report.waits.longest()),
        report.dropped,
        report.agreed,
        report.disagreed
    )
}
