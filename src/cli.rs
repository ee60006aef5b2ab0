//! The words of the command line.

#[cfg(feature = "cluster")]
mod cluster;

#[cfg(feature = "cluster")]
pub(crate) use cluster::{Certs, Cluster, Display, Fault, FaultKind, Join, Link, OnLeave, Serve};

use clap::{Args, Parser, Subcommand, ValueEnum};
use std::path::PathBuf;
use umbriel_scene::Samples;

/// A dataflow field-container VR framework: scripted worlds, shadows, and every view of an installation.
///
/// RUST_LOG sets what is logged, such as RUST_LOG=info or RUST_LOG=umbriel_render=debug.
#[derive(Debug, Parser)]
#[command(name = "umbriel", version)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Shows a world or a model in windows, or draws it to files
    ///
    /// Windows: drag with the left button to orbit, right to pan, wheel to zoom, W A S D to go, Page Up and Page Down for
    /// viewpoints, Home to return, R to reload, P for a screenshot, Escape to end. Saved files are read again.
    ///
    /// Exit status: 0 all went well, 1 nothing could be shown, 2 shown, but problems were reported.
    Run(Run),
    /// Scores the shadows of one light against ray-traced ones
    ///
    /// The last line printed is `disagreement=<percent> iou=<0..1> pixels=<n>`: over the pixels that the truth holds to be
    /// lit or shadowed in all sub-samples, the share where the renderer disagrees, and intersection over union of the
    /// shadow.
    ShadowError(ShadowError),
    /// Writes the shadow maps of one light as a picture: near is white, far is dark grey, nothing is black
    ///
    /// One map of a spot light, one per cascade of a directional light from the finest on, six of a point light
    /// (+x -x +y -y +z -z), side by side.
    ShadowMap(ShadowMap),
    /// Runs a world and saves its nodes, values and routes, for `run` to go on with
    ///
    /// The file lies beside the world's script and pictures, which are found from there. What node types of the script do goes on;
    /// handlers of the script itself are not saved.
    Save(Save),
    /// Plays a recording and compares every frame with what was recorded
    ///
    /// Exit status: 0 all frames are the same bit by bit, 2 they differ or the recording is cut off, 1 it cannot be played.
    Replay(Replay),
    /// Tells from a recording why a field holds what it holds
    Explain(Explain),
    /// Examines the meshes of a model or a world, and mends those of a model
    ///
    /// Reports for each mesh whether its triangles are closed, two-manifold and consistently oriented, and what stands in the
    /// way. Nothing is changed unless a step is asked for, and nothing is written without --out. Surfaces that cut through
    /// themselves are not looked for.
    ///
    /// Exit status: 0 every mesh is sound (after mending, if any is asked for), 2 some are not, 1 it cannot be read or written.
    Doctor(Doctor),
    /// Prints the reference of node types
    Nodes(Nodes),
    /// Evaluates a world and publishes its frames to displays in other processes
    #[cfg(feature = "cluster")]
    Serve(Serve),
    /// Runs a script in a world that another process serves
    ///
    /// The script sees the nodes of all, owns what it makes, and may write others' nodes once a lock was granted. Ctrl-C ends it.
    #[cfg(feature = "cluster")]
    Join(Join),
    /// Shows displays of a world that another process serves, frame by frame together with all others
    ///
    /// Comes back by itself after a break of the line or a restart of the application.
    #[cfg(feature = "cluster")]
    Display(Display),
    /// Serves a world to one process per display on this machine, breaks things, and compares pictures
    ///
    /// Exit status: 0 all went well, 2 pictures or values differ, 1 it could not be run.
    #[cfg(feature = "cluster")]
    Cluster(Cluster),
    /// Makes an authority and certificates for an application and its displays
    #[cfg(feature = "cluster")]
    Certs(Certs),
}

#[derive(Args, Debug)]
pub(crate) struct Run {
    /// A world (.rhai, or saved .umbriel) or a model (.gltf, .glb)
    pub(crate) path: PathBuf,
    /// Draw to PNG files instead of windows
    #[arg(long)]
    pub(crate) headless: bool,
    /// Pixels of each picture, such as 1280x720
    #[arg(long, value_parser = size)]
    pub(crate) size: Option<[u32; 2]>,
    /// Frames to draw
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..), requires = "headless")]
    pub(crate) frames: u32,
    /// Time of the first frame in seconds
    #[arg(long, default_value_t = 0.0, value_parser = finite)]
    pub(crate) time: f64,
    /// Frames per second of the world's time
    #[arg(long, default_value_t = 60.0, value_parser = positive, requires = "headless")]
    pub(crate) fps: f64,
    /// The display or viewpoint to show, by name
    #[arg(long)]
    pub(crate) view: Option<String>,
    /// Draw nothing but the shadow of this light, by name: white where it shines, black where it does not
    #[arg(long, requires = "headless")]
    pub(crate) shadow_of: Option<String>,
    /// File to write; where there are several frames or displays, their number and name are put before `.png`
    #[arg(long, requires = "headless")]
    pub(crate) out: Option<PathBuf>,
    /// Samples per pixel, instead of what the world's Environment says: 1 or 4
    #[arg(long, value_parser = samples)]
    pub(crate) samples: Option<Samples>,
    /// Write no pictures, but tell how many frames per second were drawn, and what a frame took
    #[arg(long, requires = "headless", conflicts_with_all = ["out", "record", "shadow_of"])]
    pub(crate) measure: bool,
    /// Record the session to this file, for `replay` and `explain`
    #[arg(long)]
    pub(crate) record: Option<PathBuf>,
    /// Run every line of standard input in the world, between frames, and print its value; with --headless one before each frame
    #[arg(long, conflicts_with = "measure")]
    pub(crate) console: bool,
}

#[derive(Args, Debug)]
pub(crate) struct Save {
    /// A world (.rhai, .umbriel) or a model (.gltf, .glb)
    pub(crate) path: PathBuf,
    /// The file to write (.umbriel); otherwise the world's name
    #[arg(long)]
    pub(crate) out: Option<PathBuf>,
    /// Frames to run before
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) frames: u32,
    /// Frames per second of the world's time
    #[arg(long, default_value_t = 60.0, value_parser = positive)]
    pub(crate) fps: f64,
    /// Write bytes instead of text: smaller, quicker to read, not to be edited
    #[arg(long)]
    pub(crate) binary: bool,
}

#[derive(Args, Debug)]
pub(crate) struct Replay {
    /// A recording
    pub(crate) file: PathBuf,
    /// Compare without a window
    #[arg(long)]
    pub(crate) headless: bool,
    /// Begin after so many frames
    #[arg(long, default_value_t = 0)]
    pub(crate) seek: u64,
    /// Draw every frame to a file, its number put before `.png`
    #[arg(long, requires = "headless")]
    pub(crate) out: Option<PathBuf>,
    /// Pixels of each picture, such as 1280x720
    #[arg(long, value_parser = size)]
    pub(crate) size: Option<[u32; 2]>,
    /// The display or viewpoint to show, by name
    #[arg(long)]
    pub(crate) view: Option<String>,
}

#[derive(Args, Debug)]
pub(crate) struct Explain {
    /// A recording
    pub(crate) file: PathBuf,
    /// A node, by name or path; without one, what is in the recording is told
    #[arg(requires = "field")]
    pub(crate) node: Option<String>,
    /// A field of the node
    pub(crate) field: Option<String>,
    /// After so many frames; otherwise at the end
    #[arg(long)]
    pub(crate) frame: Option<u64>,
    /// The nodes that were evaluated, with counts and times
    #[arg(long)]
    pub(crate) costs: bool,
    /// The graph in the language of Graphviz
    #[arg(long, conflicts_with = "costs")]
    pub(crate) dot: bool,
}

#[derive(Args, Debug)]
pub(crate) struct ShadowError {
    /// A world (.rhai) or a model (.gltf, .glb)
    #[arg(required_unless_present_any = ["scene", "models"], conflicts_with = "scene")]
    pub(crate) path: Option<PathBuf>,
    /// A scene file: models, one light, one camera (JSON)
    #[arg(long)]
    pub(crate) scene: Option<PathBuf>,
    /// Score every model (.gltf, .glb) in this folder and those in it, each on a floor under a directional light, a spot and a
    /// point light, and print a table; pictures are then 320x240 unless --size says otherwise
    #[arg(long, value_name = "FOLDER", conflicts_with_all = ["path", "scene", "light", "view", "truth", "trace_only", "diff", "penumbra"])]
    pub(crate) models: Option<PathBuf>,
    /// The light, by name; otherwise the first that casts shadows
    #[arg(long, conflicts_with = "scene")]
    pub(crate) light: Option<String>,
    /// The display or viewpoint, by name; of a display its first view counts
    #[arg(long, conflicts_with = "scene")]
    pub(crate) view: Option<String>,
    /// Shadow method; otherwise the light's own, and volumes for scene files
    #[arg(long, value_enum)]
    pub(crate) method: Option<Method>,
    /// Side of the shadow map in texels
    #[arg(long)]
    pub(crate) map_size: Option<u32>,
    /// Pixels of the picture, such as 800x600
    #[arg(long, value_parser = size)]
    pub(crate) size: Option<[u32; 2]>,
    /// Time of the frame in seconds
    #[arg(long, default_value_t = 0.0, value_parser = finite)]
    pub(crate) time: f64,
    /// Rays per pixel and axis
    #[arg(long, default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=16))]
    pub(crate) sub_samples: u32,
    /// The same beside edges and along thin shadows, which are followed; at most --sub-samples for none. Scene files say their own
    /// rays
    #[arg(long, default_value_t = 16, value_parser = clap::value_parser!(u32).range(0..=32), conflicts_with = "scene")]
    pub(crate) fine_sub_samples: u32,
    /// Score against this mask (grey PNG: 0 background, 1 lit, 2 shadow, 3 away, 4 outside the cone, 255 edge) instead of
    /// tracing
    #[arg(long)]
    pub(crate) truth: Option<PathBuf>,
    /// Score so many places of the eye along a path through the casters and their shadows, and print the worst; pictures are
    /// then 160x120 unless --size says otherwise
    #[arg(long, value_name = "PLACES", value_parser = clap::value_parser!(u32).range(1..), conflicts_with_all = ["truth", "trace_only", "penumbra"])]
    pub(crate) eyes: Option<u32>,
    /// Score this mask against the truth instead of rendering: the tracer against another's
    #[arg(long, conflicts_with = "method")]
    pub(crate) trace_only: bool,
    /// Score the penumbra too, against the share of the light's disc that rays see; soft volumes are always scored so
    #[arg(long, conflicts_with = "scene")]
    pub(crate) penumbra: bool,
    /// Write a picture of the differences: red where a shadow is missing, blue where one is wrong; with --eyes of the worst place
    #[arg(long)]
    pub(crate) diff: Option<PathBuf>,
}

#[derive(Args, Debug)]
pub(crate) struct Doctor {
    /// A model (.gltf, .glb), or a world (.rhai), which is examined only
    pub(crate) path: PathBuf,
    /// Move vertices that are at most so far apart to one place; without a number, a millionth of the mesh's size
    #[arg(long, value_name = "METRES", num_args = 0..=1, require_equals = true, value_parser = distance)]
    pub(crate) weld: Option<Option<f32>>,
    /// Leave out triangles without area, and copies of triangles
    #[arg(long)]
    pub(crate) drop: bool,
    /// Split triangles of open edges at corners that lie on them (T-junctions)
    #[arg(long)]
    pub(crate) stitch: bool,
    /// Part surfaces at edges of more than two triangles, and where they only touch
    #[arg(long)]
    pub(crate) split: bool,
    /// Turn triangles so that neighbours wind alike, and closed surfaces outward
    #[arg(long)]
    pub(crate) orient: bool,
    /// Close holes
    #[arg(long)]
    pub(crate) cap: bool,
    /// Every step
    #[arg(long)]
    pub(crate) all: bool,
    /// Write the mended model to this .glb
    #[arg(long)]
    pub(crate) out: Option<PathBuf>,
    /// Draw before and after side by side to this .png
    #[arg(long)]
    pub(crate) picture: Option<PathBuf>,
}

#[derive(Args, Debug)]
pub(crate) struct ShadowMap {
    /// A world (.rhai) or a model (.gltf, .glb)
    pub(crate) path: PathBuf,
    /// The light, by name; otherwise the first that casts by a map
    #[arg(long)]
    pub(crate) light: Option<String>,
    /// File to write
    #[arg(long)]
    pub(crate) out: Option<PathBuf>,
    /// The display or viewpoint that maps are fitted to, by name; otherwise all displays
    #[arg(long)]
    pub(crate) view: Option<String>,
    /// Time of the frame in seconds
    #[arg(long, default_value_t = 0.0, value_parser = finite)]
    pub(crate) time: f64,
}

#[derive(Args, Debug)]
pub(crate) struct Nodes {
    /// One type; otherwise all of them, a line each
    pub(crate) name: Option<String>,
    /// Write definitions for editors of rhai scripts into this folder
    #[arg(long, conflicts_with = "name")]
    pub(crate) definitions: Option<PathBuf>,
}

/// How a light casts shadows.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum Method {
    /// Shadow map
    Map,
    /// Stencil shadow volumes
    Volume,
}

fn samples(text: &str) -> Result<Samples, String> {
    text.parse().ok().and_then(Samples::of).ok_or_else(|| "1 or 4 samples".to_owned())
}

fn size(text: &str) -> Result<[u32; 2], String> {
    let parse = || {
        let (width, height) = text.split_once(['x', 'X'])?;
        Some([width.parse().ok()?, height.parse().ok()?])
    };
    match parse() {
        Some([0, _] | [_, 0]) => Err("a picture needs at least one pixel each way".to_string()),
        Some(size) if size.iter().any(|s| *s > 16384) => Err("a side may have at most 16384 pixels".to_string()),
        Some(size) => Ok(size),
        None => Err("expected WIDTHxHEIGHT, such as 1280x720".to_string()),
    }
}

fn distance(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(metres) if metres.is_finite() && metres >= 0.0 => Ok(metres),
        _ => Err("expected a distance in metres, 0 or more".to_string()),
    }
}

fn finite(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "expected a number of seconds".to_string())?;
    if value.is_finite() { Ok(value) } else { Err("expected a finite number".to_string()) }
}

fn positive(text: &str) -> Result<f64, String> {
    let value = finite(text)?;
    if value > 0.0 { Ok(value) } else { Err("expected a number above 0".to_string()) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn sizes() {
        let rows = [
            ("1280x720", Some([1280, 720])),
            ("1X1", Some([1, 1])),
            ("0x10", None),
            ("99999x1", None),
            ("axb", None),
            ("12", None),
            ("-3x4", None),
        ];
        for (text, expected) in rows {
            assert_eq!(size(text).ok(), expected, "{text}");
        }
    }
}
