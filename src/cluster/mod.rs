//! Worlds on many displays: the application, a display, and both on one machine to test them.

mod display;
mod faults;
mod harness;
mod interrupt;
mod join;
mod maps_once;
mod netns;
mod refusals;
mod screen;
mod serve;
mod strangers;
mod wire;

pub(crate) use display::display;
pub(crate) use harness::run;
pub(crate) use join::join;
pub(crate) use refusals::Refusals;
pub(crate) use serve::serve;

use crate::cli;
use umbriel_displays::cluster::{Security, make_certificates};

type Failure = Box<dyn std::error::Error>;

fn security(link: &cli::Link) -> Security {
    match &link.certificates {
        Some(folder) => Security::Mutual(folder.clone()),
        None if link.plain => Security::Plain,
        None => Security::Loopback,
    }
}

/// Makes certificates; gives the names of the files.
pub(crate) fn certificates(args: &cli::Certs) -> Result<String, Failure> {
    let files = make_certificates(&args.folder)?;
    let names: Vec<String> = files.iter().map(|file| format!("{}\n", file.display())).collect();
    let whose = "Give authority.pem, display.pem and display.key.pem to the machines of the displays; authority.pem, guest.pem and \
        guest.key.pem to those of applications that join; keep the rest.\n";
    Ok(names.concat() + whose)
}
