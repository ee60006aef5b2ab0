//! What the certificate of an end lets it do at the application: a display follows, a guest works on the world.

use super::message::{
    APPLICATION, BULK, DEEDS, DISPLAY, FRAME, GUEST, GUEST_SNAPSHOT, HERE, INPUT, READY, RELEASE, SNAPSHOT, WORD,
};
use super::transport::End;

/// Kinds of messages, as the network library calls them, and the subjects on which an end may send them.
type Right = (&'static str, Vec<String>);

fn rights(end: End) -> Vec<Right> {
    let all = |subjects: &[&str]| subjects.iter().map(ToString::to_string).collect::<Vec<_>>();
    let below = |prefix: &str| vec![format!("{prefix}/*")];
    let own = match end {
        End::Application => Vec::new(),
        End::Display => vec![
            ("put", all(&[READY, INPUT])),
            ("query", all(&[SNAPSHOT])),
            ("declare_subscriber", all(&[FRAME, HERE, RELEASE])),
            ("liveliness_token", below(DISPLAY)),
        ],
        End::Guest => vec![
            ("put", all(&[DEEDS])),
            ("query", all(&[GUEST_SNAPSHOT])),
            ("declare_subscriber", all(&[FRAME, HERE, WORD])),
            ("liveliness_token", below(GUEST)),
        ],
    };
    let common = [
        ("query", below(BULK)),
        ("liveliness_query", all(&[APPLICATION])),
        ("declare_liveliness_subscriber", all(&[APPLICATION])),
    ];
    own.into_iter().chain(common).collect()
}

/// The access control of an application: whoever is not named may do nothing, and the application may send everything.
pub(super) fn access_control() -> String {
    let mut rules = vec![rule("out", "egress", &EVERYTHING.map(|kind| format!("\"{kind}\"")).join(","), "\"**\"")];
    let mut subjects = Vec::new();
    let mut policies = Vec::new();
    for end in [End::Display, End::Guest] {
        let name = end.name();
        let mut ids = vec!["\"out\"".to_string()];
        for (number, (kind, keys)) in rights(end).into_iter().enumerate() {
            let id = format!("{name} {number}");
            let keys: Vec<String> = keys.iter().map(|key| format!("\"{key}\"")).collect();
            rules.push(rule(&id, "ingress", &format!("\"{kind}\""), &keys.join(",")));
            ids.push(format!("\"{id}\""));
        }
        subjects.push(format!("{{ id: \"{name}\", cert_common_names: [\"{name}\"] }}"));
        policies.push(format!("{{ rules: [{}], subjects: [\"{name}\"] }}", ids.join(",")));
    }
    format!(
        "{{ enabled: true, default_permission: \"deny\", rules: [{}], subjects: [{}], policies: [{}] }}",
        rules.join(","),
        subjects.join(","),
        policies.join(",")
    )
}

const EVERYTHING: [&str; 9] = [
    "put",
    "delete",
    "declare_subscriber",
    "query",
    "reply",
    "declare_queryable",
    "liveliness_token",
    "liveliness_query",
    "declare_liveliness_subscriber",
];

fn rule(id: &str, flow: &str, kinds: &str, keys: &str) -> String {
    format!("{{ id: \"{id}\", flows: [\"{flow}\"], permission: \"allow\", messages: [{kinds}], key_exprs: [{keys}] }}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_network_library_understands_them() {
        let mut config = zenoh::Config::default();
        config.insert_json5("access_control", &access_control()).unwrap();
    }

    #[test]
    fn only_guests_touch_the_world() {
        let may = |end, kind, key: &str| rights(end).iter().any(|(known, keys)| *known == kind && keys.iter().any(|k| k == key));
        assert!(may(End::Guest, "put", DEEDS) && may(End::Guest, "query", GUEST_SNAPSHOT));
        for (kind, key) in
            [("put", DEEDS), ("query", GUEST_SNAPSHOT), ("put", FRAME), ("put", HERE), ("put", RELEASE), ("put", WORD)]
        {
            assert!(!may(End::Display, kind, key), "{kind} {key}");
        }
        for (kind, key) in
            [("put", READY), ("put", INPUT), ("query", SNAPSHOT), ("put", FRAME), ("put", HERE), ("put", RELEASE), ("put", WORD)]
        {
            assert!(!may(End::Guest, kind, key), "{kind} {key}");
        }
    }
}
