//! The words of commands that run a world in several processes.

use super::positive;
use clap::{Args, ValueEnum};
use std::path::{Path, PathBuf};
use std::time::Duration;
use umbriel_displays::cluster::{CacheOptions, LEASE};

/// How links between processes are protected.
#[derive(Args, Debug)]
pub(crate) struct Link {
    /// Folder of certificates that `umbriel certs` made, for tls/
    #[arg(long)]
    pub(crate) certificates: Option<PathBuf>,
    /// Allow connections from other machines without encryption
    #[arg(long, conflicts_with = "certificates")]
    pub(crate) plain: bool,
    /// A line without a sign of life for so many milliseconds is broken, and made anew
    #[arg(long, default_value_t = LEASE.as_millis() as u64, value_parser = clap::value_parser!(u64).range(100..))]
    pub(crate) lease_ms: u64,
}

impl Link {
    pub(crate) fn lease(&self) -> Duration {
        Duration::from_millis(self.lease_ms)
    }
}

/// Where displays keep meshes and images from one start to the next.
#[derive(Args, Clone, Debug)]
pub(crate) struct Kept {
    /// Folder for meshes and images, which are then not fetched again at the next start, or `none`; otherwise `umbriel` among the user's caches
    #[arg(long, value_name = "FOLDER")]
    pub(crate) cache: Option<PathBuf>,
    /// Room in it, in mebibytes; what was not used for longest goes
    #[arg(long, default_value_t = 1024, value_parser = clap::value_parser!(u64).range(1..=1 << 40))]
    pub(crate) cache_mib: u64,
}

impl Kept {
    /// None where nothing is to be kept, or nobody knows where.
    pub(crate) fn options(&self) -> Option<CacheOptions> {
        let folder = match &self.cache {
            Some(none) if none == Path::new("none") => return None,
            Some(folder) => folder.clone(),
            None => dirs::cache_dir()?.join("umbriel"),
        };
        Some(CacheOptions { folder, room: self.cache_mib << 20 })
    }
}

#[derive(Args, Debug)]
pub(crate) struct Serve {
    /// A world (.rhai) or a model (.gltf, .glb)
    pub(crate) path: PathBuf,
    /// Where displays connect to
    #[arg(long, default_value = "tcp/127.0.0.1:7447")]
    pub(crate) listen: String,
    #[command(flatten)]
    pub(crate) link: Link,
    /// Frames per second
    #[arg(long, default_value_t = 60.0, value_parser = positive)]
    pub(crate) fps: f64,
    /// End after so many frames
    #[arg(long)]
    pub(crate) frames: Option<u64>,
    /// Begin once so many displays have drawn the first frame
    #[arg(long, default_value_t = 0)]
    pub(crate) wait_for: usize,
    /// How long a frame waits for a display, in milliseconds
    #[arg(long, default_value_t = 200)]
    pub(crate) timeout_ms: u64,
    /// Run every line of standard input in the world, between frames, and print its value
    #[arg(long)]
    pub(crate) console: bool,
}

#[derive(Args, Debug)]
pub(crate) struct Join {
    /// A script (.rhai)
    pub(crate) path: PathBuf,
    /// Where the application listens that evaluates the world
    #[arg(long, default_value = "tcp/127.0.0.1:7447")]
    pub(crate) connect: String,
    #[command(flatten)]
    pub(crate) link: Link,
    /// What the others call this application; otherwise the name of the script's file
    #[arg(long)]
    pub(crate) name: Option<String>,
    /// What becomes of its nodes when it ends; the script can say so too, with on_leave
    #[arg(long, value_enum, default_value_t = OnLeave::Remove)]
    pub(crate) on_leave: OnLeave,
    /// End after so many frames
    #[arg(long)]
    pub(crate) frames: Option<u64>,
    /// End when the other application ends, instead of waiting for it to come back
    #[arg(long)]
    pub(crate) once: bool,
    /// Run every line of standard input as part of the script, between frames, and print its value
    #[arg(long)]
    pub(crate) console: bool,
}

/// What becomes of the nodes of an application that ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum OnLeave {
    /// They go to the application that evaluates the world
    Keep,
    /// They are taken out of the world
    Remove,
}

#[derive(Args, Debug)]
pub(crate) struct Display {
    /// Where the application listens
    #[arg(long, default_value = "tcp/127.0.0.1:7447")]
    pub(crate) connect: String,
    /// The display or viewpoint, by name; `NAME/2` is its third channel alone
    #[arg(long)]
    pub(crate) show: String,
    #[command(flatten)]
    pub(crate) link: Link,
    #[command(flatten)]
    pub(crate) kept: Kept,
    /// Draw without a window
    #[arg(long)]
    pub(crate) headless: bool,
    /// Fill a monitor, by its number from zero; without one, the first
    #[arg(long, value_name = "MONITOR", num_args = 0..=1, require_equals = true, default_missing_value = "0", conflicts_with = "headless")]
    pub(crate) fullscreen: Option<usize>,
    /// File for each frame that is shown; the number is put before `.png`
    #[arg(long, requires = "headless")]
    pub(crate) out: Option<PathBuf>,
    /// End when the application ends, instead of waiting for it to come back
    #[arg(long)]
    pub(crate) once: bool,
    /// Change a value of the replica after this frame: a test of what is done about it
    #[arg(long, hide = true)]
    pub(crate) corrupt: Option<u64>,
}

#[derive(Args, Debug)]
pub(crate) struct Cluster {
    /// A world (.rhai) or a model (.gltf, .glb)
    pub(crate) path: PathBuf,
    /// Compare every picture with a render in this process, pixel by pixel
    #[arg(long)]
    pub(crate) check: bool,
    /// Break something: kill, freeze, delay, loss or partition, at a frame, of a display, such as freeze@30:wall
    #[arg(long, value_parser = fault)]
    pub(crate) fault: Vec<Fault>,
    /// Break so many things by dice, one after the other
    #[arg(long, value_name = "COUNT", conflicts_with = "fault")]
    pub(crate) random: Option<u64>,
    /// The first of the seeds that choose what is broken by dice
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,
    /// Break nothing more by dice after so many minutes
    #[arg(long, value_parser = positive, requires = "random")]
    pub(crate) minutes: Option<f64>,
    /// Give each display a network namespace of its own, where packets are lost for real; needs root, `ip` and `nft`
    #[arg(long, conflicts_with = "windows")]
    pub(crate) netns: bool,
    /// One process for each channel of a display, instead of one for each display
    #[arg(long)]
    pub(crate) channels: bool,
    /// Show displays in windows, until all are closed
    #[arg(long, conflicts_with_all = ["check", "out"])]
    pub(crate) windows: bool,
    /// Frames to show; otherwise 4, or without end in windows
    #[arg(long, value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) frames: Option<u64>,
    /// Frames per second
    #[arg(long, default_value_t = 60.0, value_parser = positive)]
    pub(crate) fps: f64,
    /// How long a frame waits for a display, in milliseconds; otherwise 200 with faults, and a minute without
    #[arg(long)]
    pub(crate) timeout_ms: Option<u64>,
    /// Change a value in the first display's replica after this frame
    #[arg(long)]
    pub(crate) corrupt: Option<u64>,
    #[command(flatten)]
    pub(crate) kept: Kept,
    /// Folder for the pictures; otherwise one that is removed at the end
    #[arg(long)]
    pub(crate) out: Option<PathBuf>,
}

impl Cluster {
    /// Is anything broken on purpose?
    pub(crate) fn breaks(&self) -> bool {
        self.random.is_some() || !self.fault.is_empty()
    }

    /// At least so many frames are shown.
    pub(crate) fn frames(&self) -> u64 {
        self.frames.unwrap_or(if self.windows { u64::MAX } else { 4 })
    }
}

#[derive(Args, Debug)]
pub(crate) struct Certs {
    /// The folder to write
    pub(crate) folder: PathBuf,
}

/// What is broken, when, and whose.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Fault {
    pub(crate) kind: FaultKind,
    pub(crate) frame: u64,
    pub(crate) display: String,
}

/// How something breaks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum FaultKind {
    /// The process ends, and is started again
    Kill,
    /// The process stands still for a second
    Freeze,
    /// The line is 30 ms slower each way for a second
    Delay,
    /// One piece of a hundred is lost and sent again, for a second
    Loss,
    /// Nothing goes through the line for a second
    Partition,
}

fn fault(text: &str) -> Result<Fault, String> {
    let parsed = text.split_once('@').and_then(|(kind, rest)| {
        let (frame, display) = rest.split_once(':')?;
        Some(Fault { kind: FaultKind::from_str(kind, true).ok()?, frame: frame.parse().ok()?, display: display.into() })
    });
    parsed.ok_or_else(|| {
        "expected KIND@FRAME:DISPLAY, such as freeze@30:wall; kinds are kill, freeze, delay, loss, partition".into()
    })
}
