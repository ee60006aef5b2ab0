//! A proxy between a display and its application that delays, stalls or cuts the line, and the short one beside it: faults for tests on one
//! machine.

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

#[cfg(target_os = "linux")]
use super::near::{Ear, Pipe};

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
                if let Ok(far) = TcpStream::connect(to) {
                    let _ = far.set_nodelay(true);
                    let _ = near.set_nodelay(true);
                    join(near, far, &line, started);
                }
            }
        });
        proxy.forward_short_lines(to.port());
        Ok(proxy)
    }

    #[cfg(target_os = "linux")]
    fn forward_short_lines(&self, to: u16) {
        let Ok(ear) = Ear::open(self.port) else { return };
        let (line, started) = (self.line.clone(), self.started);
        std::thread::spawn(move || {
            while let Ok(near) = ear.accept() {
                if let Some(near) = near
                    && let Ok(far) = Pipe::connect(to)
                {
                    join(near.0, far.0, &line, started);
                }
            }
        });
    }

    #[cfg(not(target_os = "linux"))]
    fn forward_short_lines(&self, _: u16) {}

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

/// A stream of either line.
trait Stream: Read + Write + Send + Sized + 'static {
    fn again(&self) -> std::io::Result<Self>;
    fn shut(&self);
}

macro_rules! stream {
    ($stream:ty) => {
        impl Stream for $stream {
            fn again(&self) -> std::io::Result<Self> {
                self.try_clone()
            }
            fn shut(&self) {
                let _ = self.shutdown(std::net::Shutdown::Both);
            }
        }
    };
}
stream!(TcpStream);
#[cfg(target_os = "linux")]
stream!(std::os::unix::net::UnixStream);

/// Forwards what comes from either end to the other.
fn join<S: Stream>(near: S, far: S, line: &Arc<Line>, started: Instant) {
    let (Ok(near_too), Ok(far_too)) = (near.again(), far.again()) else { return };
    let (there, back) = (line.clone(), line.clone());
    std::thread::spawn(move || forward(near, far, &there, started));
    std::thread::spawn(move || forward(far_too, near_too, &back, started));
}

fn forward<S: Stream>(mut from: S, mut to: S, line: &Line, started: Instant) {
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
    from.shut();
    to.shut();
}
