//! Who was just refused, as the system knows it: the network library tells why, but not whom.

use std::collections::{BTreeSet, HashSet};
use std::fs;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr};

/// Addresses of the other ends of connections to ports of this process that it has just closed. Empty where the system does not tell (Linux does).
pub(super) fn strangers() -> BTreeSet<IpAddr> {
    let tables = ["/proc/net/tcp", "/proc/net/tcp6"].map(|path| fs::read_to_string(path).unwrap_or_default());
    closed(&tables.concat(), &own_sockets())
}

/// Numbers of the sockets that this process holds.
fn own_sockets() -> HashSet<u64> {
    let files = fs::read_dir("/proc/self/fd").into_iter().flatten().flatten();
    let targets = files.filter_map(|file| fs::read_link(file.path()).ok());
    let number = |target: std::path::PathBuf| target.to_str()?.strip_prefix("socket:[")?.strip_suffix(']')?.parse().ok();
    targets.filter_map(number).collect()
}

/// A line of the system's table of connections.
struct Row {
    port: u16,
    peer: IpAddr,
    state: u8,
    socket: u64,
}

const ESTABLISHED: u8 = 1;
/// Closed here, and the other end may not have noticed: `FIN_WAIT1`, `FIN_WAIT2`, `TIME_WAIT`, `CLOSE`, `LAST_ACK`, `CLOSING`.
const CLOSED: [u8; 6] = [4, 5, 6, 7, 9, 11];
const LISTENS: u8 = 10;

fn closed(table: &str, own: &HashSet<u64>) -> BTreeSet<IpAddr> {
    let rows: Vec<Row> = table.lines().filter_map(row).collect();
    let is_ours = |row: &&Row| row.state == LISTENS && own.contains(&row.socket);
    let ports: HashSet<u16> = rows.iter().filter(is_ours).map(|row| row.port).collect();
    let here = || rows.iter().filter(|row| ports.contains(&row.port));
    let friends: BTreeSet<IpAddr> = here().filter(|row| row.state == ESTABLISHED).map(|row| row.peer).collect();
    let peers = |states: &[u8]| here().filter(|row| states.contains(&row.state)).map(|row| row.peer).collect::<BTreeSet<_>>();
    // What was closed a moment ago; else what was closed in the last minute, but not by those who are in.
    let fresh = peers(&CLOSED[..2]);
    if !fresh.is_empty() { fresh } else { peers(&CLOSED).difference(&friends).copied().collect() }
}

/// `sl local_address rem_address st ... inode`, addresses in hexadecimal words of the machine's order.
fn row(line: &str) -> Option<Row> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let (_, port) = words.get(1)?.split_once(':')?;
    let (peer, _) = words.get(2)?.split_once(':')?;
    Some(Row {
        port: u16::from_str_radix(port, 16).ok()?,
        peer: address(peer)?,
        state: u8::from_str_radix(words.get(3)?, 16).ok()?,
        socket: words.get(9)?.parse().ok()?,
    })
}

fn address(hex: &str) -> Option<IpAddr> {
    let word = |at: usize| Some(u32::from_str_radix(hex.get(at..at + 8)?, 16).ok()?.to_ne_bytes());
    match hex.len() {
        8 => Some(Ipv4Addr::from(word(0)?).into()),
        32 => {
            let words = [word(0)?, word(8)?, word(16)?, word(24)?];
            let bytes: [u8; 16] = std::array::from_fn(|byte| words[byte / 4][byte % 4]);
            Some(Ipv6Addr::from(bytes).to_canonical())
        }
        _ => None,
    }
}

#[cfg(all(test, target_endian = "little"))]
mod tests {
    use super::*;

    #[test]
    fn the_systems_table_is_read() {
        let listens =
            "   0: 0100007F:1D17 00000000:0000 0A 00000000:00000000 00:00000000 00000000     0        0 77 1 0 100 0 0 10 0";
        let of = |peer: &str, state: &str, socket: u64| {
            format!(
                "   1: 0100007F:1D17 {peer}:C350 {state} 00000000:00000000 00:00000000 00000000     0        0 {socket} 1 0 20 4 30 10 -1\n"
            )
        };
        let rows: &[(String, &[&str])] = &[
            (of("0A00A8C0", "01", 78), &[]),
            (of("0A00A8C0", "04", 0), &["192.168.0.10"]),
            ([of("0A00A8C0", "06", 0), of("0B00A8C0", "05", 0)].concat(), &["192.168.0.11"]),
            ([of("0A00A8C0", "06", 0), of("0A00A8C0", "01", 78)].concat(), &[]),
            ([of("0A00A8C0", "06", 0), of("0B00A8C0", "09", 0)].concat(), &["192.168.0.10", "192.168.0.11"]),
            (of("B80D0120000000000000000001000000", "04", 0), &["2001:db8::1"]),
            (of("0000000000000000FFFF00000A00A8C0", "04", 0), &["192.168.0.10"]),
            ("garbage\n\n: :".into(), &[]),
        ];
        for (table, expected) in rows {
            let found = closed(&format!("{listens}\n{table}"), &HashSet::from([77, 78]));
            let expected: BTreeSet<IpAddr> = expected.iter().map(|address| address.parse().unwrap()).collect();
            assert_eq!(found, expected, "{table}");
        }
        assert!(closed(&format!("{listens}\n{}", of("0A00A8C0", "04", 0)), &HashSet::new()).is_empty(), "not our port");
    }
}
