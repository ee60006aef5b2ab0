//! Sessions of zenoh, set up for one application and its displays.

use std::net::{IpAddr, ToSocketAddrs};
use std::path::{Path, PathBuf};
use std::time::Duration;

use zenoh::{Config, Session, Wait};

use super::rights::access_control;

/// Why processes cannot work together.
#[derive(Debug, thiserror::Error)]
pub enum ClusterError {
    /// An address that is none.
    #[error("`{endpoint}` is no address: {fault}; expected such as tcp/127.0.0.1:7447 or tls/wall.local:7447")]
    Endpoint {
        /// As it was given.
        endpoint: String,
        /// What is wrong with it.
        fault: String,
    },
    /// Plain connections stay on this machine.
    #[error("{endpoint} can be reached from other machines without encryption: use tls/ with --certificates, or say --plain")]
    Plain {
        /// As it was given.
        endpoint: String,
    },
    /// The address is taken, or not of this machine.
    #[error("cannot listen on {endpoint}: {fault}")]
    Listen {
        /// As it was given.
        endpoint: String,
        /// Why.
        fault: String,
    },
    /// No file of that name in the folder of certificates.
    #[error("{}: {fault}", path.display())]
    Certificate {
        /// The file.
        path: PathBuf,
        /// Why it cannot be used.
        fault: String,
    },
    /// Of zenoh.
    #[error("the network failed: {0}")]
    Network(String),
    /// Something that was not understood.
    #[error("a message is damaged: {0}")]
    Message(String),
    /// The application does not want this display.
    #[error("the application refuses this display: {0}")]
    Refused(String),
    /// The host does not want this guest.
    #[error("the host refuses this application: {0}")]
    GuestRefused(String),
    /// The packets do not fit.
    #[error(transparent)]
    Replica(#[from] umbriel_fields::replica::ReplicaError),
    /// Nothing answers.
    #[error("no application answers at {endpoint} within {seconds} s{hint}")]
    NoApplication {
        /// As it was given.
        endpoint: String,
        /// How long was waited.
        seconds: u64,
        /// What may be the cause.
        hint: &'static str,
    },
    /// A certificate could not be made.
    #[error("cannot make a certificate: {0}")]
    Make(String),
}

impl ClusterError {
    /// Nothing answered for so long.
    pub fn silent(endpoint: &str, seconds: u64, has_certificates: bool) -> ClusterError {
        let hint = if has_certificates { ", or it does not accept the certificate" } else { "" };
        ClusterError::NoApplication { endpoint: endpoint.into(), seconds, hint }
    }
}

/// How links are protected.
#[derive(Clone, Debug, Default)]
pub enum Security {
    /// Not at all: only on this machine.
    #[default]
    Loopback,
    /// Not at all, knowingly.
    Plain,
    /// Both ends show a certificate of the same authority, from a folder that `umbriel certs` made.
    Mutual(PathBuf),
}

/// Which end a process is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum End {
    /// Evaluates the world.
    Application,
    /// Shows it.
    Display,
    /// Works on it as well.
    Guest,
}

impl End {
    /// The common name of its certificate, and the stem of its files.
    pub(super) fn name(self) -> &'static str {
        match self {
            End::Application => "application",
            End::Display => "display",
            End::Guest => "guest",
        }
    }
}

/// The port of an endpoint.
pub(super) fn port_of(endpoint: &str) -> Option<u16> {
    endpoint.rsplit_once(':').and_then(|(_, port)| port.parse().ok())
}

fn check(endpoint: &str, security: &Security) -> Result<(), ClusterError> {
    let wrong = |fault: &str| ClusterError::Endpoint { endpoint: endpoint.into(), fault: fault.into() };
    let (protocol, address) = endpoint.split_once('/').ok_or_else(|| wrong("it names no protocol"))?;
    if port_of(endpoint).is_none() {
        return Err(wrong("it has no port"));
    }
    match (protocol, security) {
        ("tls", Security::Mutual(_)) | ("tcp", Security::Plain) => Ok(()),
        ("tls", _) => Err(wrong("tls needs --certificates")),
        ("tcp", Security::Mutual(_)) => Err(wrong("certificates need tls/")),
        ("tcp", Security::Loopback) => {
            let addresses = address.to_socket_addrs().map_err(|error| wrong(&error.to_string()))?;
            let is_local = addresses.map(|address| address.ip()).all(|ip: IpAddr| ip.is_loopback());
            if is_local { Ok(()) } else { Err(ClusterError::Plain { endpoint: endpoint.into() }) }
        }
        _ => Err(wrong("the protocol is tcp or tls")),
    }
}

/// The files of one end in a folder of certificates.
fn files(folder: &Path, end: End) -> Result<[String; 3], ClusterError> {
    let stem = end.name();
    let own = format!("{stem}.pem");
    let names = ["authority.pem".to_string(), own.clone(), format!("{stem}.key.pem")];
    let [authority, certificate, key] = names.map(|name| {
        let path = folder.join(&name);
        let role = (name == own).then_some(stem);
        let fault = std::fs::read(&path).map_or_else(|error| Some(error.to_string()), |bytes| fault_of(&bytes, role));
        match fault {
            None => Ok(path.to_string_lossy().into_owned()),
            Some(fault) => Err(ClusterError::Certificate { path, fault }),
        }
    });
    Ok([authority?, certificate?, key?])
}

/// How long a link may give no sign of life before it counts as broken, and is made anew. Machines that are so busy that even this takes
/// longer want more.
pub const LEASE: Duration = Duration::from_secs(1);

/// What is wrong with a certificate or a key, if anything is. A certificate of a role has it as its common name.
fn fault_of(bytes: &[u8], role: Option<&str>) -> Option<String> {
    let Ok((_, pem)) = x509_parser::pem::parse_x509_pem(bytes) else {
        return Some("this is no certificate and no key (PEM)".into());
    };
    if pem.label.ends_with("PRIVATE KEY") {
        return None;
    }
    let Ok(certificate) = pem.parse_x509() else { return Some("the certificate is damaged".into()) };
    let validity = certificate.validity();
    if !validity.is_valid() {
        return Some(format!("the certificate is valid from {} to {} only", validity.not_before, validity.not_after));
    }
    let name = certificate.subject().iter_common_name().next().and_then(|name| name.as_str().ok()).unwrap_or_default();
    let role = role.filter(|role| *role != name)?;
    Some(format!("this is the certificate of `{name}`, and one of `{role}` is needed"))
}

/// What the network library says.
pub(super) fn network(error: zenoh::Error) -> ClusterError {
    ClusterError::Network(error.to_string())
}

/// Settings that were measured: see `docs/performance.md`. Nobody is searched for, and nobody is told of others.
pub(super) fn open(endpoint: &str, security: &Security, end: End, lease: Duration) -> Result<Session, ClusterError> {
    check(endpoint, security)?;
    let quoted = |text: &str| json_string(text);
    let mut rows: Vec<(&str, String)> = vec![
        ("mode", quoted("peer")),
        ("scouting/multicast/enabled", "false".into()),
        ("scouting/gossip/enabled", "false".into()),
        ("transport/link/tx/lease", lease.as_millis().to_string()),
        // A try while the line is cut is given up before the system would repeat it, which is after a second.
        ("transport/unicast/open_timeout", (lease.as_millis() * 6 / 10).to_string()),
        // A frame of half a megabyte finds its buffers made already.
        ("transport/link/rx/buffer_size", "524288".into()),
        ("transport/link/tx/queue/size/data", "16".into()),
        ("transport/link/tx/queue/congestion_control/block/wait_before_close", "200000".into()),
        ("transport/shared_memory/enabled", "false".into()),
        ("connect/retry", "{ period_init_ms: 50, period_max_ms: 100, period_increase_factor: 2 }".into()),
        ("open/return_conditions", "{ connect_scouted: false, declares: false }".into()),
    ];
    match end {
        End::Application => {
            rows.push(("listen/endpoints", format!("[{}]", quoted(endpoint))));
        }
        End::Display | End::Guest => {
            rows.push(("listen/endpoints", "[]".into()));
            rows.push(("connect/timeout_ms", "-1".into()));
            rows.push(("connect/exit_on_failure", "false".into()));
            rows.push(("connect/endpoints", format!("[{}]", quoted(endpoint))));
        }
    }
    if let Security::Mutual(folder) = security {
        let [authority, certificate, key] = files(folder, end)?.map(|path| quoted(&path));
        let side = if end == End::Application { "listen" } else { "connect" };
        rows.push((
            "transport/link/tls",
            format!(
                "{{ root_ca_certificate: {authority}, {side}_certificate: {certificate}, {side}_private_key: {key}, \
                 enable_mtls: true, verify_name_on_connect: false, close_link_on_expiration: false }}"
            ),
        ));
        if end == End::Application {
            rows.push(("access_control", access_control()));
        }
    }
    let mut config = Config::default();
    for (key, value) in &rows {
        config.insert_json5(key, value).map_err(|error| ClusterError::Network(format!("{key}: {error}")))?;
    }
    zenoh::open(config).wait().map_err(|error| match end {
        End::Application => ClusterError::Listen { endpoint: endpoint.into(), fault: reason(&error.to_string()) },
        End::Display | End::Guest => ClusterError::Network(error.to_string()),
    })
}

/// What an operator can act on, out of a chain of reasons with places in sources.
fn reason(text: &str) -> String {
    ["Address already in use", "Permission denied", "Cannot assign requested address"]
        .into_iter()
        .find(|known| text.contains(known))
        .map_or_else(|| text.to_string(), String::from)
}

/// A string as JSON has it.
fn json_string(text: &str) -> String {
    format!("\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\""))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn certificates_are_checked() {
        let key = rcgen::KeyPair::generate().unwrap();
        let of_years = |from, to| {
            let mut params = rcgen::CertificateParams::new(vec!["display".to_string()]).unwrap();
            (params.not_before, params.not_after) = (rcgen::date_time_ymd(from, 1, 1), rcgen::date_time_ymd(to, 1, 1));
            params.distinguished_name.push(rcgen::DnType::CommonName, "display");
            params.self_signed(&key).unwrap().pem()
        };
        let damaged = of_years(2020, 2049).replacen("MII", "MIJ", 1);
        let rows = [
            (of_years(2020, 2049), Some("display"), None),
            (of_years(2020, 2049), None, None),
            (of_years(2020, 2049), Some("guest"), Some("of `display`, and one of `guest` is needed")),
            (key.serialize_pem(), None, None),
            (of_years(2001, 2002), None, Some("valid from Jan  1 00:00:00 2001")),
            (of_years(2048, 2049), None, Some("valid from Jan  1 00:00:00 2048")),
            ("garbage".into(), None, Some("no certificate")),
            (String::new(), None, Some("no certificate")),
            (damaged, None, Some("damaged")),
        ];
        for (text, role, expected) in rows {
            let fault = fault_of(text.as_bytes(), role);
            match (&fault, expected) {
                (None, None) => {}
                (Some(fault), Some(part)) => assert!(fault.contains(part), "{fault}"),
                _ => panic!("{fault:?} is not {expected:?}"),
            }
        }
    }

    #[test]
    fn endpoints_are_checked() {
        let mutual = || Security::Mutual("certs".into());
        let rows = [
            ("tcp/127.0.0.1:7447", Security::Loopback, None),
            ("tcp/localhost:7447", Security::Loopback, None),
            ("tcp/[::1]:7447", Security::Loopback, None),
            ("tcp/0.0.0.0:7447", Security::Loopback, Some("without encryption")),
            ("tcp/0.0.0.0:7447", Security::Plain, None),
            ("tls/0.0.0.0:7447", mutual(), None),
            ("tls/0.0.0.0:7447", Security::Loopback, Some("--certificates")),
            ("tcp/127.0.0.1:7447", mutual(), Some("tls/")),
            ("127.0.0.1:7447", Security::Loopback, Some("protocol")),
            ("tcp/127.0.0.1", Security::Loopback, Some("port")),
            ("udp/127.0.0.1:1", Security::Loopback, Some("tcp or tls")),
        ];
        for (endpoint, security, expected) in rows {
            match (check(endpoint, &security), expected) {
                (Ok(()), None) => {}
                (Err(error), Some(part)) => assert!(error.to_string().contains(part), "{endpoint}: {error}"),
                (found, _) => panic!("{endpoint} {security:?}: {found:?}"),
            }
        }
    }
}
