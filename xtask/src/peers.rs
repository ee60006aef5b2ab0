//! `cargo xtask peers fields`: the dataflow beside that of others, built and run here, in one table.

use std::path::Path;
use std::process::Command;

use crate::commands::root;

/// Case, who, nanoseconds.
type Row = (String, String, f64);

/// Builds and runs what there is, and prints the table.
pub(crate) fn fields() -> Result<(), String> {
    let folder = root().join("fields/peers");
    let target = root().join("target/peers");
    let mut cargo = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    cargo
        .args(["run", "--release", "--quiet", "--manifest-path"])
        .arg(folder.join("Cargo.toml"))
        .arg("--target-dir")
        .arg(&target);
    let mut rows = rows_of(&mut cargo, "fields/peers")?;
    match coin(&folder, &target) {
        Ok(coin) => rows.extend(coin),
        Err(why) => println!("Coin3D is not in the table: {why}\n"),
    }
    print!("{}", table(&rows));
    Ok(())
}

/// Coin's figures, or why there are none.
fn coin(folder: &Path, target: &Path) -> Result<Vec<Row>, String> {
    let installed = Command::new("dpkg").args(["-s", "libcoin-dev"]).output().is_ok_and(|output| output.status.success());
    if !installed {
        return Err("Debian's package libcoin-dev is not installed (apt-get install libcoin-dev)".into());
    }
    let program = target.join("coin");
    let built = Command::new("g++").arg("-O2").arg("-o").arg(&program).arg(folder.join("coin.cpp")).arg("-lCoin").status();
    match built {
        Ok(status) if status.success() => rows_of(&mut Command::new(&program), "Coin3D"),
        Ok(status) => Err(format!("g++ ended with {status}")),
        Err(error) => Err(format!("g++ cannot be run: {error}")),
    }
}

fn rows_of(command: &mut Command, what: &str) -> Result<Vec<Row>, String> {
    let output =
        command.stderr(std::process::Stdio::inherit()).output().map_err(|error| format!("{what} cannot be run: {error}"))?;
    if !output.status.success() {
        return Err(format!("{what} ended with {}", output.status));
    }
    parse(&String::from_utf8_lossy(&output.stdout))
}

/// Lines of case, who, nanoseconds, separated by tabs.
fn parse(text: &str) -> Result<Vec<Row>, String> {
    let row = |line: &str| {
        let mut cells = line.split('\t');
        let (case, who, ns) = (cells.next()?, cells.next()?, cells.next()?.parse().ok()?);
        Some((case.to_string(), who.to_string(), ns))
    };
    text.lines().map(|line| row(line).ok_or_else(|| format!("no figure: `{line}`"))).collect()
}

/// A line per case, in the order in which they came first, and a column for each who.
fn table(rows: &[Row]) -> String {
    let mut cases: Vec<&str> = Vec::new();
    let mut peers: Vec<&str> = Vec::new();
    for (case, who, _) in rows {
        if !cases.contains(&case.as_str()) {
            cases.push(case);
        }
        if !peers.contains(&who.as_str()) {
            peers.push(who);
        }
    }
    let mut text = format!("{:<34}", "nanoseconds");
    peers.iter().for_each(|who| text += &format!(" {who:>20}"));
    for case in cases {
        text += &format!("\n{case:<34}");
        for who in &peers {
            let found = rows.iter().find(|row| row.0 == case && row.1 == *who);
            text += &found.map_or_else(|| format!(" {:>20}", "-"), |row| format!(" {:>20.2}", row.2));
        }
    }
    text + "\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_of_several_programs_are_one_table() {
        let mut rows = parse("chain\tours\t2.5\nfan\tours\t1\n").unwrap();
        rows.extend(parse("chain\ttheirs\t112.388\n").unwrap());
        let words: Vec<Vec<String>> =
            table(&rows).lines().map(|line| line.split_whitespace().map(String::from).collect()).collect();
        let words: Vec<Vec<&str>> = words.iter().map(|line| line.iter().map(String::as_str).collect()).collect();
        assert_eq!(words, [vec!["nanoseconds", "ours", "theirs"], vec!["chain", "2.50", "112.39"], vec!["fan", "1.00", "-"]]);
        assert!(parse("something else").is_err());
    }
}
