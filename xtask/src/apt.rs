//! Installs Debian packages, with the backports suite added where it is asked for.

use std::io::{BufRead, Write};
use std::path::Path;
use std::process::{Command, Stdio};

const BACKPORTS_FILE: &str = "/etc/apt/sources.list.d/bookworm-backports.sources";

/// Is there an apt on this machine?
pub(crate) fn available() -> bool {
    Path::new("/usr/bin/apt-get").exists()
}

/// `bookworm` on Debian 12, and so on.
pub(crate) fn debian_codename() -> Option<String> {
    let text = std::fs::read_to_string("/etc/os-release").ok()?;
    text.lines().find_map(|l| Some(l.strip_prefix("VERSION_CODENAME=")?.trim_matches('"').to_string()))
}

/// Installed version of a package, without its epoch.
pub(crate) fn version(package: &str) -> Option<String> {
    let out = Command::new("dpkg-query")
        .args(["-W", "-f", "${db:Status-Status} ${Version}", package])
        .stderr(Stdio::null())
        .output()
        .ok()?;
    let text = String::from_utf8(out.stdout).ok()?;
    let version = text.strip_prefix("installed ")?;
    Some(version.split_once(':').map_or(version, |(_, v)| v).to_string())
}

/// Is the package installed?
pub(crate) fn installed(package: &str) -> bool {
    version(package).is_some()
}

/// Installs `packages`; asks first unless `yes`.
pub(crate) fn install(packages: &[&str], from_backports: bool, yes: bool) -> Result<(), String> {
    let suite = if from_backports { " from bookworm-backports" } else { "" };
    println!("missing packages: {}{suite}", packages.join(" "));
    if !yes && !confirmed("Install them with apt-get? [y/N] ")? {
        return Err(format!(
            "Not installed. Install them by hand, or run again with --yes:\n  apt-get install {}",
            packages.join(" ")
        ));
    }
    if from_backports {
        add_backports()?;
    }
    run_as_root(&["apt-get", "update", "-q"])?;
    let mut args = vec!["apt-get", "install", "-y", "-q", "--no-install-recommends"];
    if from_backports {
        args.extend(["-t", "bookworm-backports"]);
    }
    args.extend(packages);
    run_as_root(&args)
}

fn confirmed(question: &str) -> Result<bool, String> {
    print!("{question}");
    std::io::stdout().flush().map_err(|e| e.to_string())?;
    let mut answer = String::new();
    std::io::stdin().lock().read_line(&mut answer).map_err(|e| e.to_string())?;
    Ok(matches!(answer.trim(), "y" | "Y" | "yes"))
}

fn add_backports() -> Result<(), String> {
    let mut texts = Vec::new();
    let parts = std::fs::read_dir("/etc/apt/sources.list.d").into_iter().flatten().filter_map(|e| Some(e.ok()?.path()));
    for path in std::iter::once("/etc/apt/sources.list".into()).chain(parts) {
        texts.extend(std::fs::read_to_string(path));
    }
    let all = texts.join("\n\n");
    if all.contains("bookworm-backports") {
        return Ok(());
    }
    let source = backports_source(&all).ok_or("No apt source with the suite 'bookworm' was found on this machine.")?;
    println!("adding {BACKPORTS_FILE}");
    let mut child =
        as_root(&["tee", BACKPORTS_FILE]).stdin(Stdio::piped()).stdout(Stdio::null()).spawn().map_err(|e| format!("tee: {e}"))?;
    child.stdin.take().expect("piped").write_all(source.as_bytes()).map_err(|e| e.to_string())?;
    if child.wait().map_err(|e| e.to_string())?.success() { Ok(()) } else { Err(format!("could not write {BACKPORTS_FILE}")) }
}

/// The source of bookworm-backports on the mirror from which the machine takes bookworm itself: reads both the
/// one-line and the deb822 form.
fn backports_source(sources: &str) -> Option<String> {
    let (uri, signed_by) =
        sources.split("\n\n").find_map(deb822_bookworm).or_else(|| sources.lines().find_map(one_line_bookworm))?;
    let signed_by = signed_by.map(|s| format!("Signed-By: {s}\n")).unwrap_or_default();
    Some(format!("Types: deb\nURIs: {uri}\nSuites: bookworm-backports\nComponents: main\n{signed_by}"))
}

fn deb822_bookworm(stanza: &str) -> Option<(String, Option<String>)> {
    let field = |name: &str| stanza.lines().find_map(|l| Some(l.strip_prefix(name)?.strip_prefix(':')?.trim().to_string()));
    let suites = field("Suites")?;
    let binary = field("Types")?.split_whitespace().any(|t| t == "deb");
    (binary && suites.split_whitespace().any(|s| s == "bookworm")).then_some((field("URIs")?, field("Signed-By")))
}

fn one_line_bookworm(line: &str) -> Option<(String, Option<String>)> {
    let rest = line.trim().strip_prefix("deb ")?.trim();
    let (options, rest) = match rest.strip_prefix('[') {
        Some(r) => r.split_once(']')?,
        None => ("", rest),
    };
    let mut words = rest.split_whitespace();
    let uri = words.next()?;
    let signed_by = options.split_whitespace().find_map(|o| o.strip_prefix("signed-by="));
    (words.next() == Some("bookworm")).then(|| (uri.to_string(), signed_by.map(str::to_string)))
}

fn as_root(args: &[&str]) -> Command {
    let am_root = Command::new("id").arg("-u").output().is_ok_and(|o| o.stdout == b"0\n");
    let mut command = if am_root { Command::new(args[0]) } else { Command::new("sudo") };
    command.args(if am_root { &args[1..] } else { args }).env("DEBIAN_FRONTEND", "noninteractive");
    command
}

fn run_as_root(args: &[&str]) -> Result<(), String> {
    let status = as_root(args).status().map_err(|e| format!("{}: {e}", args[0]))?;
    if status.success() { Ok(()) } else { Err(format!("`{}` failed: {status}", args.join(" "))) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn backports_come_from_the_machines_own_mirror() {
        let deb822 = "Types: deb\nURIs: http://mirror.example/debian\nSuites: bookworm bookworm-updates\nComponents: main\nSigned-By: /k.gpg\n\n\
                      Types: deb\nURIs: http://mirror.example/security\nSuites: bookworm-security\nComponents: main\n";
        let rows = [
            (deb822, Some(("http://mirror.example/debian", true))),
            ("deb http://a.example/debian bookworm main", Some(("http://a.example/debian", false))),
            ("deb [arch=amd64 signed-by=/k.gpg] https://b.example/d bookworm main contrib", Some(("https://b.example/d", true))),
            ("# deb http://a.example/debian bookworm main", None),
            ("deb-src http://a.example/debian bookworm main\ndeb http://c.example trixie main", None),
        ];
        for (sources, expected) in rows {
            let found = backports_source(sources);
            assert_eq!(found.is_some(), expected.is_some(), "{sources}");
            if let (Some(text), Some((uri, signed))) = (found, expected) {
                assert!(text.contains(&format!("URIs: {uri}\nSuites: bookworm-backports\n")), "{text}");
                assert_eq!(text.contains("Signed-By: /k.gpg"), signed, "{text}");
            }
        }
    }
}
