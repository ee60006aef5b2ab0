//! Whom lines lead to: processes have numbers, and an operator wants addresses.

use std::collections::BTreeMap;
use std::net::SocketAddr;

/// Lines to this process that stand: the number of the process at the other end, and its address. Empty where that is not known.
pub type Lines = fn() -> BTreeMap<u64, SocketAddr>;

/// The number of a process, by which displays and guests say who they are: a part of what its session of the network library is called.
pub fn number_of_process(session: &str) -> Option<u64> {
    u128::from_str_radix(session, 16).ok().map(|number| number as u64)
}

/// Where a process is, for the log: ` at 10.0.0.7:40112`. Empty where that is not known.
pub(super) fn at(lines: Option<Lines>, process: u64) -> String {
    let address = lines.and_then(|lines| lines().get(&process).copied());
    address.map_or_else(String::new, |address| format!(" at {address}"))
}

/// Who is connected and is none of `known`, for the log: what came from nobody that is known came from one of them.
pub(super) fn others(lines: Option<Lines>, known: impl Fn(u64) -> bool) -> String {
    let lines = lines.map(|lines| lines()).unwrap_or_default();
    let others: Vec<String> =
        lines.iter().filter(|(number, _)| !known(**number)).map(|(_, address)| address.to_string()).collect();
    if others.is_empty() { String::new() } else { format!("; connected, and no display that has joined: {}", others.join(", ")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn two() -> BTreeMap<u64, SocketAddr> {
        [(7, "10.0.0.7:1"), (8, "[::1]:2")].map(|(number, address)| (number, address.parse().unwrap())).into()
    }

    #[test]
    fn processes_are_named_by_their_addresses() {
        assert_eq!(number_of_process("b4be130cee49738a3196eed05805e77d"), Some(0x3196_eed0_5805_e77d));
        assert_eq!(number_of_process("7"), Some(7));
        assert_eq!(number_of_process("who"), None);
        assert_eq!(at(Some(two), 7), " at 10.0.0.7:1");
        assert_eq!((at(Some(two), 9), at(None, 7)), (String::new(), String::new()));
        assert_eq!(others(Some(two), |number| number == 7), "; connected, and no display that has joined: [::1]:2");
        assert_eq!((others(Some(two), |_| true), others(None, |_| false)), (String::new(), String::new()));
    }
}
