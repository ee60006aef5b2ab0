//! The manual runs: every block of rhai in the README and in `docs/` is a world, and the list of functions is the real one.

use std::path::{Path, PathBuf};

use umbriel_scripts::{Settings, World, functions};

use crate::support;

fn manual() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/scripts.md")
}

/// The README and every page of the manual, named from the root of the repository.
fn pages() -> Vec<(String, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let entries = std::fs::read_dir(root.join("docs")).expect("the manual's folder can be read");
    let names = entries.map(|e| e.expect("its entries can be read").file_name().to_string_lossy().into_owned());
    let pages = names.filter(|n| n.ends_with(".md")).map(|n| format!("docs/{n}"));
    let read = |name: String| (std::fs::read_to_string(root.join(&name)).expect("a page can be read"), name);
    pages.chain(["README.md".to_string()]).map(read).map(|(text, name)| (name, text)).collect()
}

/// The blocks, each moved down to its own lines, so that a problem's line is that of the manual.
fn blocks(text: &str) -> Vec<String> {
    let mut blocks = Vec::new();
    let mut block: Option<String> = None;
    for (index, line) in text.lines().enumerate() {
        match (&mut block, line) {
            (None, "```rhai") => block = Some("\n".repeat(index + 1)),
            (Some(_), "```") => blocks.extend(block.take()),
            (Some(block), line) => *block += &format!("{line}\n"),
            _ => {}
        }
    }
    blocks
}

/// A block may say what it reports: `// reports: text`.
#[test]
fn every_block_runs() {
    let blocks: Vec<(String, String)> =
        pages().iter().flat_map(|(name, text)| blocks(text).into_iter().map(|b| (name.clone(), b))).collect();
    assert!(blocks.len() > 15, "only {} blocks", blocks.len());
    for (page, block) in blocks {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("worlds");
        let settings = Settings { asset_folders: vec![folder], ..Settings::default() };
        let mut world = World::load_source_with(&page, &block, settings).unwrap_or_else(|error| panic!("{error}"));
        (0..3).for_each(|frame| drop(world.step(f64::from(frame) / 60.0)));
        let problems = support::problems(&mut world);
        let announced: Vec<&str> = block.lines().filter_map(|line| Some(line.split_once("// reports: ")?.1)).collect();
        assert_eq!(problems.len(), announced.len(), "{problems:?}\n{}", block.trim());
        for (problem, text) in problems.iter().zip(announced) {
            assert!(problem.contains(text), "{problem}\nwithout {text}");
        }
    }
}

const BEGIN: &str = "<!-- functions: written by the test, with UPDATE_DOCS=1 -->\n";

/// The list of functions, by chapters.
fn list() -> String {
    let mut text = String::new();
    let mut chapter = "";
    for function in functions() {
        if function.chapter != chapter {
            chapter = function.chapter;
            text += &format!("\n### {chapter}\n\n");
        }
        text += &format!("- `{}`: {}\n", function.signature, function.doc);
    }
    text
}

#[test]
fn the_list_of_functions_is_the_real_one() {
    let text = std::fs::read_to_string(manual()).expect("the manual");
    let (before, after) = text.split_once(BEGIN).expect("the place of the list");
    if std::env::var_os("UPDATE_DOCS").is_some() {
        std::fs::write(manual(), format!("{before}{BEGIN}{}", list())).expect("the manual can be written");
    } else {
        assert!(after == list(), "the list of functions in docs/scripts.md is old; run the test with UPDATE_DOCS=1");
    }
}
