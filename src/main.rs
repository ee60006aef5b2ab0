//! The `umbriel` command: shows worlds written in rhai and models, in windows or in files, and scores their shadows.

/// Prints a line; a reader that has seen enough, such as `head`, is no problem.
macro_rules! say {
    ($($words:tt)*) => {{
        use std::io::Write;
        let _ = writeln!(std::io::stdout(), $($words)*);
    }};
}

mod cli;
#[cfg(feature = "cluster")]
mod cluster;
mod console;
mod doctor;
mod headless;
mod model;
mod nodes;
mod png;
mod replay;
mod save;
mod scene_file;
mod session;
mod shadow_error;
mod shadow_map;
mod source;
mod window;

use clap::Parser;
use cli::{Cli, Command};
use std::io::{IsTerminal, Write};
use std::process::ExitCode;
#[cfg(feature = "cluster")]
use tracing_subscriber::filter::Targets;
use tracing_subscriber::{EnvFilter, Layer, layer::SubscriberExt, util::SubscriberInitExt};

/// The exit status of a command that did its work, but reported problems on the way.
const WITH_PROBLEMS: u8 = 2;

fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => {
            let _ = error.print();
            return if error.use_stderr() { ExitCode::FAILURE } else { ExitCode::SUCCESS };
        }
    };
    log();
    let result = match &cli.command {
        Command::Run(args) if args.headless => headless::run(args),
        Command::Run(args) => window::run(args).map(|()| 0),
        Command::Save(args) => save::run(args),
        Command::ShadowError(args) => shadow_error::run(args),
        Command::ShadowMap(args) => shadow_map::run(args),
        Command::Replay(args) => replay::run(args),
        Command::Explain(args) => replay::explain(args).map(|text| print(&text)),
        Command::Doctor(args) => doctor::run(args),
        Command::Nodes(cli::Nodes { definitions: Some(folder), .. }) => {
            nodes::write_definitions(folder).map(|text| print(&text)).map_err(|e| format!("{}: {e}", folder.display()).into())
        }
        #[cfg(feature = "cluster")]
        Command::Serve(args) => cluster::serve(args),
        #[cfg(feature = "cluster")]
        Command::Join(args) => cluster::join(args),
        #[cfg(feature = "cluster")]
        Command::Display(args) => cluster::display(args),
        #[cfg(feature = "cluster")]
        Command::Cluster(args) => cluster::run(args),
        #[cfg(feature = "cluster")]
        Command::Certs(args) => cluster::certificates(args).map(|text| print(&text)),
        Command::Nodes(args) => nodes::reference(args.name.as_deref()).map(|text| print(&text)).map_err(Into::into),
    };
    match result {
        Ok(0) => ExitCode::SUCCESS,
        Ok(problems) => {
            tracing::error!("done, with {problems} {}", if problems == 1 { "problem" } else { "problems" });
            ExitCode::from(WITH_PROBLEMS)
        }
        Err(error) => {
            tracing::error!("{error}");
            ExitCode::FAILURE
        }
    }
}

/// Logs to the terminal what RUST_LOG asks for.
fn log() {
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| {
        "warn,umbriel::script=info,umbriel::cluster=info,umbriel_scripts=info,umbriel_displays=info,\
         zenoh=error,zenoh_link_tls=error,wgpu_hal=error,wgpu_core=error,naga=error"
            .into()
    });
    let text = tracing_subscriber::fmt::layer()
        .with_writer(std::io::stderr)
        .with_ansi(std::io::stderr().is_terminal())
        .without_time()
        .with_target(false)
        .with_filter(filter);
    let all = tracing_subscriber::registry().with(text);
    #[cfg(feature = "cluster")]
    let all = { all.with(cluster::Refusals::default().with_filter(Targets::from_iter(cluster::Refusals::TARGETS))) };
    all.init();
}

/// Prints a long text; a reader that has seen enough is no problem.
fn print(text: &str) -> usize {
    let _ = std::io::stdout().write_all(text.as_bytes());
    0
}
