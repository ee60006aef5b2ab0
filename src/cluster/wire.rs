//! The line between a display and the application of the harness, and how it is broken.

use super::Failure;
use super::netns::Namespace;
use crate::cli::FaultKind;
use std::net::SocketAddr;
use std::process::Command;
use std::time::Duration;
use umbriel_displays::cluster::Proxy;

/// How much slower a delayed line is, each way.
const DELAY: Duration = Duration::from_millis(30);
/// Of 1000 packets, or pieces of the stream, so many are lost.
const LOST_OF_1000: u32 = 10;

/// How a display reaches the application.
pub(super) enum Wire {
    /// As it is; nothing breaks it.
    Direct(SocketAddr),
    /// By a proxy in this process: what is lost waits as long as TCP takes to send it again.
    Proxy(Proxy),
    /// From a network namespace of its own: packets are lost on a cable.
    Namespace(Namespace, SocketAddr),
}

impl Wire {
    /// The endpoint that the display connects to.
    pub(super) fn endpoint(&self) -> String {
        match self {
            Wire::Direct(address) | Wire::Namespace(_, address) => format!("tcp/{address}"),
            Wire::Proxy(proxy) => format!("tcp/127.0.0.1:{}", proxy.port()),
        }
    }

    /// A command to start the display with.
    pub(super) fn command(&self) -> Result<Command, Failure> {
        let program = std::env::current_exe()?;
        Ok(match self {
            Wire::Namespace(namespace, _) => {
                let mut command = namespace.command(&program);
                command.args(["display", "--plain"]);
                command
            }
            Wire::Direct(_) | Wire::Proxy(_) => {
                let mut command = Command::new(program);
                command.arg("display");
                command
            }
        })
    }

    /// Can it be broken so?
    pub(super) fn can(&self, kind: FaultKind) -> bool {
        match self {
            Wire::Namespace(namespace, _) => kind != FaultKind::Delay || namespace.can_delay(),
            Wire::Direct(_) | Wire::Proxy(_) => true,
        }
    }

    /// Breaks it, until it is healed.
    pub(super) fn fail(&self, kind: FaultKind) -> Result<(), Failure> {
        match (self, kind) {
            (_, FaultKind::Kill | FaultKind::Freeze) => {}
            (Wire::Direct(_), _) => return Err("this line cannot be broken".into()),
            (Wire::Proxy(proxy), FaultKind::Delay) => proxy.delay(DELAY),
            (Wire::Proxy(proxy), FaultKind::Loss) => proxy.lose(LOST_OF_1000),
            (Wire::Proxy(proxy), FaultKind::Partition) => proxy.cut(Duration::MAX),
            (Wire::Namespace(namespace, _), FaultKind::Delay) => namespace.delay(DELAY)?,
            (Wire::Namespace(namespace, _), FaultKind::Loss) => namespace.lose(LOST_OF_1000)?,
            (Wire::Namespace(namespace, _), FaultKind::Partition) => namespace.cut()?,
        }
        Ok(())
    }

    /// Mends it.
    pub(super) fn heal(&self) -> Result<(), Failure> {
        match self {
            Wire::Direct(_) => {}
            Wire::Proxy(proxy) => {
                proxy.delay(Duration::ZERO);
                proxy.lose(0);
                proxy.cut(Duration::ZERO);
            }
            Wire::Namespace(namespace, _) => namespace.heal()?,
        }
        Ok(())
    }
}
