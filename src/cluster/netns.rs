//! Networks of displays' own on one machine: namespaces, cables, and packet filters that break them. Linux, for root.

use super::Failure;
use std::net::Ipv4Addr;
use std::path::Path;
use std::process::{Command, Output};
use std::time::Duration;

/// The networks of one harness: 10.N.0.0/16, where N comes from the number of its process.
fn network() -> u8 {
    (100 + std::process::id() % 100) as u8
}

/// An address for the application that namespaces reach and other machines do not. It goes with the value.
pub(super) struct Hub(Ipv4Addr);

impl Hub {
    /// # Errors
    /// This user may not, or the commands `ip` and `nft` are not there.
    pub(super) fn make() -> Result<Hub, Failure> {
        ran("nft", &["--version"])?;
        let address = Ipv4Addr::new(10, network(), 255, 1);
        ran("ip", &["address", "add", &format!("{address}/32"), "dev", "lo"])?;
        Ok(Hub(address))
    }

    pub(super) fn address(&self) -> Ipv4Addr {
        self.0
    }
}

impl Drop for Hub {
    fn drop(&mut self) {
        // Nothing can be done about an address that is gone already.
        let _ = ran("ip", &["address", "delete", &format!("{}/32", self.0), "dev", "lo"]);
    }
}

/// A namespace with a cable to this one. It goes with the value.
pub(super) struct Namespace {
    name: String,
    /// The near end of the cable.
    cable: String,
}

impl Namespace {
    /// `number` tells it from the others.
    pub(super) fn make(number: u8) -> Result<Namespace, Failure> {
        let id = std::process::id();
        let namespace = Namespace { name: format!("umbriel-{id}-{number}"), cable: format!("um{id}n{number}") };
        let (name, cable) = (namespace.name.as_str(), namespace.cable.as_str());
        let [near, far] = [1, 2].map(|end| Ipv4Addr::new(10, network(), number, end).to_string());
        let with_mask = |address: &str| format!("{address}/30");
        ran("ip", &["netns", "add", name])?;
        ran("ip", &["link", "add", cable, "type", "veth", "peer", "name", "eth0", "netns", name])?;
        ran("ip", &["address", "add", &with_mask(&near), "dev", cable])?;
        ran("ip", &["link", "set", cable, "up"])?;
        namespace.ran("ip", &["address", "add", &with_mask(&far), "dev", "eth0"])?;
        namespace.ran("ip", &["link", "set", "lo", "up"])?;
        namespace.ran("ip", &["link", "set", "eth0", "up"])?;
        namespace.ran("ip", &["route", "add", "default", "via", &near])?;
        namespace.ran("nft", &["add table inet umbriel"])?;
        for way in ["input", "output"] {
            namespace.ran("nft", &[&format!("add chain inet umbriel {way} {{ type filter hook {way} priority 0; }}")])?;
        }
        Ok(namespace)
    }

    /// A command that runs a program in it.
    pub(super) fn command(&self, program: &Path) -> Command {
        let mut command = Command::new("ip");
        command.args(["netns", "exec", &self.name]).arg(program);
        command
    }

    /// No packet goes through.
    pub(super) fn cut(&self) -> Result<(), Failure> {
        ["input", "output"].iter().try_for_each(|way| self.ran("nft", &[&format!("add rule inet umbriel {way} drop")]))
    }

    /// Of 1000 packets each way, so many are lost; less than 1000.
    pub(super) fn lose(&self, of_1000: u32) -> Result<(), Failure> {
        for way in ["input", "output"] {
            self.ran("nft", &[&format!("add rule inet umbriel {way} numgen random mod 1000 < {of_1000} drop")])?;
        }
        Ok(())
    }

    /// Packets are late by so much, each way.
    pub(super) fn delay(&self, delay: Duration) -> Result<(), Failure> {
        let late = format!("{}ms", delay.as_millis());
        let netem = |device| ["qdisc", "replace", "dev", device, "root", "netem", "delay", late.as_str()];
        ran("tc", &netem(&self.cable))?;
        self.ran("tc", &netem("eth0"))
    }

    /// Does this kernel have what delays packets?
    pub(super) fn can_delay(&self) -> bool {
        self.delay(Duration::ZERO).is_ok()
    }

    /// Everything goes through again.
    pub(super) fn heal(&self) -> Result<(), Failure> {
        self.ran("nft", &["flush table inet umbriel"])?;
        // There is nothing to take away where nothing was delayed.
        let _ = ran("tc", &["qdisc", "delete", "dev", &self.cable, "root"]);
        let _ = self.ran("tc", &["qdisc", "delete", "dev", "eth0", "root"]);
        Ok(())
    }

    fn ran(&self, program: &str, args: &[&str]) -> Result<(), Failure> {
        ran("ip", &[&["netns", "exec", &self.name, program], args].concat())
    }
}

impl Drop for Namespace {
    fn drop(&mut self) {
        // The cable goes with its end. What is left of a namespace that cannot be deleted is empty.
        let _ = ran("ip", &["netns", "delete", &self.name]);
    }
}

fn ran(program: &str, args: &[&str]) -> Result<(), Failure> {
    let told = |why: String| format!("`{program} {}`: {why}", args.join(" "));
    let Output { status, stderr, .. } = Command::new(program).args(args).output().map_err(|error| told(error.to_string()))?;
    if status.success() { Ok(()) } else { Err(told(String::from_utf8_lossy(&stderr).trim().to_string()).into()) }
}
