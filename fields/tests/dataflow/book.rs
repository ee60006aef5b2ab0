//! The list of behaviours in the manual names tests that exist.

use std::path::Path;

/// The text of all Rust files below a folder.
fn source(folder: &Path) -> String {
    let entries = std::fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let texts = entries.map(|entry| entry.unwrap().path()).map(|path| match path.extension() {
        _ if path.is_dir() => source(&path),
        Some(extension) if extension == "rs" => std::fs::read_to_string(path).unwrap(),
        _ => String::new(),
    });
    texts.collect()
}

#[test]
fn every_behaviour_of_the_manual_has_its_test() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let manual = std::fs::read_to_string(root.join("docs/fields.md")).unwrap();
    let tests: String =
        ["fields/src", "fields/tests", "scripts/src", "scripts/tests", "tests"].map(|folder| source(&root.join(folder))).concat();
    let rows: Vec<&str> = manual.lines().filter(|line| line.starts_with("| F") || line.starts_with("| R")).collect();
    for row in &rows {
        let test = row.rsplit('|').nth(1).unwrap().trim().trim_matches('`');
        let is_test = |end: &str| {
            let attribute = tests[..tests.find(end)?].lines().next_back()?.trim();
            Some(attribute == "#[test]")
        };
        let found = ["", "    ", "        "].iter().any(|space| is_test(&format!("\n{space}fn {test}(")) == Some(true));
        assert!(found, "{row}");
    }
    for feature in (1..=12).map(|number| format!("F{number}")).chain(["R1".into(), "R2".into(), "R3".into()]) {
        assert!(rows.iter().any(|row| row.starts_with(&format!("| {feature} |"))), "{feature} has no row");
    }
}
