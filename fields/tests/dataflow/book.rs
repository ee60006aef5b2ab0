//! The list of behaviours in the manual names tests that exist.

use std::path::Path;

#[test]
fn every_behaviour_of_the_manual_has_its_test() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let manual = std::fs::read_to_string(root.join("../docs/fields.md")).unwrap();
    let mut source = String::new();
    for folder in ["tests/dataflow", "src", "src/nodes"] {
        for file in std::fs::read_dir(root.join(folder)).unwrap().map(|entry| entry.unwrap().path()) {
            if file.extension().is_some_and(|extension| extension == "rs") {
                source += &std::fs::read_to_string(file).unwrap();
            }
        }
    }
    let rows: Vec<&str> = manual.lines().filter(|line| line.starts_with("| F")).collect();
    assert!(rows.len() > 30, "the list is short: {}", rows.len());
    for row in rows {
        let test = row.rsplit('|').nth(1).unwrap().trim().trim_matches('`');
        assert!(
            source.contains(&format!("#[test]\nfn {test}(")) || source.contains(&format!("#[test]\n    fn {test}(")),
            "{row}"
        );
    }
    for feature in ["F1", "F2", "F3", "F4", "F5", "F6", "F11", "F12"] {
        assert!(manual.contains(&format!("| {feature} |")), "{feature} has no row");
    }
}
