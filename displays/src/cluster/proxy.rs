//! A proxy between a display and its application that delays, stalls or cuts the line: faults for tests on one machine.

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// How the line is.
#[derive(Debug, Default)]
struct Line {
    delay_us: AtomicU64,
    /// Of 1000 pieces, so many wait as long as TCP takes to notice a lost segment.
    lost_of_1000: AtomicU64,
    /// Microseconds from the start until which nothing goes through.
    cut_until_us: AtomicU64,
}

/// Forwards connections to an address.
#[derive(Debug)]
pub struct Proxy {
    line: Arc<Line>,
    started: Instant,
    port: u16,
}

/// What TCP waits before it sends a lost segment again, at the least.
const RESEND: Duration = Duration::from_millis(200);

impl Proxy {
    /// Listens on a free port of this machine; `to` is the application.
    pub fn start(to: SocketAddr) -> std::io::Result<Proxy> {
        let listener = TcpListener::bind("127.0.0.1:0")?;
        let proxy = Proxy { line: Arc::default(), started: Instant::now(), port: listener.local_addr()?.port() };
        let (line, started) = (proxy.line.clone(), proxy.started);
        std::thread::spawn(move || {
            for near in listener.incoming().flatten() {
                let Ok(far) = TcpStream::connect(to) else { continue };
                let (Ok(near_too), Ok(far_too)) = (near.try_clone(), far.try_clone()) else { continue };
                let (there, back) = (line.clone(), line.clone());
                std::thread::spawn(move || forward(near, far, &there, started));
                std::thread::spawn(move || forward(far_too, near_too, &back, started));
            }
        });
        Ok(proxy)
    }

    /// The port to connect to.
    pub fn port(&self) -> u16 {
        self.port
    }

    /// Every piece is late by so much.
    pub fn delay(&self, delay: Duration) {
        self.line.delay_us.store(delay.as_micros() as u64, Ordering::Relaxed);
    }

    /// Of 1000 pieces, so many are lost and sent again, as TCP does.
    pub fn lose(&self, of_1000: u32) {
        self.line.lost_of_1000.store(of_1000.into(), Ordering::Relaxed);
    }

    /// Nothing goes through for a while.
    pub fn cut(&self, duration: Duration) {
        let until = self.started.elapsed().saturating_add(duration);
        self.line.cut_until_us.store(u64::try_from(until.as_micros()).unwrap_or(u64::MAX), Ordering::Relaxed);
    }
}

fn forward(mut from: TcpStream, mut to: TcpStream, line: &Line, started: Instant) {
    let _ = to.set_nodelay(true);
    let mut buffer = vec![0; 65536];
    let mut dice = fastrand::Rng::with_seed(1);
    while let Ok(count) = from.read(&mut buffer)
        && count > 0
    {
        loop {
            let cut_us = line.cut_until_us.load(Ordering::Relaxed).saturating_sub(started.elapsed().as_micros() as u64);
            if cut_us == 0 {
                break;
            }
            std::thread::sleep(Duration::from_micros(cut_us.min(5000)));
        }
        let is_lost = dice.u64(..1000) < line.lost_of_1000.load(Ordering::Relaxed);
        let delay = Duration::from_micros(line.delay_us.load(Ordering::Relaxed));
        let pause = if is_lost { delay + RESEND } else { delay };
        if !pause.is_zero() {
            std::thread::sleep(pause);
        }
        if to.write_all(&buffer[..count]).is_err() {
            break;
        }
    }
    let _ = from.shutdown(std::net::Shutdown::Both);
    let _ = to.shutdown(std::net::Shutdown::Both);
}
