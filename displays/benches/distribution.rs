//! An application and four display processes on loopback: `cargo bench -p umbriel-displays --features cluster --bench distribution`;
//! `-- --displays 1` for another number of them, `-- --frames 3000` for longer rows.
//!
//! Each frame writes translation, rotation and scale of 10 000 transforms, or of one. Displays apply and verify them, and draw nothing. The
//! measure beside it is TCP that sends the same bytes to four processes, each of which answers with one byte. What five processes can do at all
//! is told by bare ones: one writes the same values to arrays and their bytes to memory, four read them into arrays and hash them.

use std::io::{Read, Seek, SeekFrom, Write};
use std::net::{TcpListener, TcpStream};
use std::process::{Child, Command};
use std::time::{Duration, Instant};

use glam::{Quat, Vec3};
use umbriel_displays::cluster::{ClusterError, Follower, FollowerOptions, Host, HostOptions, LEASE, Screen, Security};
use umbriel_fields::replica::{Bulk, Packet, Publisher, Replica};
use umbriel_fields::{FieldId, Graph, NodeType, TypeRegistry, builtin_types};
use umbriel_scenegraph::{new_graph, node_types};

const TRANSFORMS: usize = 10_000;
const FIELDS: usize = 3;
/// Of a display: leaves the application's memory alone, as if it were on another machine.
const OVER_NETWORK: &str = "--over-network";
/// Frames that are measured in each row, unless told otherwise.
const FRAMES: usize = 300;
const TIMEOUT: Duration = Duration::from_secs(5);

/// Draws nothing.
struct Blind;

impl Screen for Blind {
    type Error = ClusterError;
    fn draw(&mut self, _: &Graph, _: u64, _: bool) -> Result<(), ClusterError> {
        Ok(())
    }
    fn show(&mut self, _: u64) -> Result<(), ClusterError> {
        Ok(())
    }
}

type Failure = Box<dyn std::error::Error>;

fn main() -> Result<(), Failure> {
    let args: Vec<String> = std::env::args().collect();
    let place = |name: &str| args.iter().position(|arg| arg == name).and_then(|at| args.get(at + 1)).cloned();
    if let Some(address) = place("--raw") {
        return raw_display(&address);
    }
    if let Some(address) = place("--bare") {
        return bare_display(&address, &place("--memory").unwrap_or_default());
    }
    match (place("--display"), place("--name")) {
        (Some(endpoint), Some(name)) => display(endpoint, &name, !args.iter().any(|arg| arg == OVER_NETWORK)),
        _ => {
            let number = |name: &str, default: usize| place(name).map_or(Ok(default), |number| number.parse());
            application(number("--displays", 4)?, number("--frames", FRAMES)?)
        }
    }
}

fn again(args: &[&str]) -> Result<Child, Failure> {
    Ok(Command::new(std::env::current_exe()?).args(args).spawn()?)
}

fn free_address() -> Result<String, Failure> {
    Ok(TcpListener::bind("127.0.0.1:0")?.local_addr()?.to_string())
}

fn display(endpoint: String, name: &str, uses_memory: bool) -> Result<(), Failure> {
    let types: Vec<NodeType> = node_types().into_iter().chain(builtin_types()).collect();
    let options = FollowerOptions {
        endpoint,
        security: Security::Loopback,
        lease: LEASE,
        ends_with_application: true,
        uses_memory,
        cache: None,
    };
    let mut follower = Follower::connect(options, name, TypeRegistry::from(types))?;
    while !follower.is_over() {
        follower.run(&mut Blind, Duration::from_millis(50))?;
    }
    Ok(())
}

fn raw_display(address: &str) -> Result<(), Failure> {
    let mut stream = TcpStream::connect(address)?;
    stream.set_nodelay(true)?;
    let mut buffer = Vec::new();
    let mut length = [0; 8];
    while stream.read_exact(&mut length).is_ok() {
        buffer.resize(u64::from_le_bytes(length) as usize, 0);
        stream.read_exact(&mut buffer)?;
        stream.write_all(&[1])?;
    }
    Ok(())
}

/// Places in the memory of the bare application.
const BARE_PLACES: u64 = 4;
const BARE_FLOATS: usize = TRANSFORMS * 10;

/// What the bare displays agree on.
fn bare_hash(floats: &[f32]) -> u64 {
    let words = floats.as_chunks::<4>().0.iter();
    words.fold(0, |sum, [a, b, c, d]| {
        let pair = |low: f32, high: f32| low.to_bits() as u64 | (high.to_bits() as u64) << 32;
        let product = (pair(*a, *b) ^ 0x2d35_8dcc_aa6c_78a5) as u128 * (pair(*c, *d) ^ 0x8bb8_4b93_962e_acc9) as u128;
        sum.wrapping_add(product as u64 ^ (product >> 64) as u64)
    })
}

/// Reads frames out of memory into an array, and answers with the hash of what stands there.
fn bare_display(address: &str, memory: &str) -> Result<(), Failure> {
    let mut stream = TcpStream::connect(address)?;
    stream.set_nodelay(true)?;
    let mut memory = std::fs::File::open(memory)?;
    let (mut bytes, mut floats) = (vec![0; 4 * BARE_FLOATS], vec![0.0f32; BARE_FLOATS]);
    let mut place = [0];
    while stream.read_exact(&mut place).is_ok() {
        memory.seek(SeekFrom::Start(place[0] as u64 * bytes.len() as u64))?;
        memory.read_exact(&mut bytes)?;
        for (float, bytes) in floats.iter_mut().zip(bytes.as_chunks::<4>().0) {
            *float = f32::from_le_bytes(*bytes);
        }
        stream.write_all(&bare_hash(&floats).to_le_bytes())?;
    }
    Ok(())
}

/// What is possible where nothing is done but that: the next frame is made while displays have this one.
#[cfg(target_os = "linux")]
fn bare(display_count: usize, frames: usize) -> Result<(), Failure> {
    use std::os::fd::AsRawFd;
    let mut memory = std::fs::File::from(rustix::fs::memfd_create("bare", rustix::fs::MemfdFlags::CLOEXEC)?);
    let path = format!("/proc/{}/fd/{}", std::process::id(), memory.as_raw_fd());
    let listener = TcpListener::bind("127.0.0.1:0")?;
    let address = listener.local_addr()?.to_string();
    let (mut children, mut streams) = (Vec::new(), Vec::new());
    for _ in 0..display_count {
        children.push(again(&["--bare", &address, "--memory", &path])?);
        let (stream, _) = listener.accept()?;
        stream.set_nodelay(true)?;
        streams.push(stream);
    }
    let (mut floats, mut bytes, mut wrong) = (vec![0.0f32; BARE_FLOATS], Vec::with_capacity(4 * BARE_FLOATS), 0);
    let (mut hash, poses) = (None, Poses::new());
    let started = Instant::now();
    for frame in 0..=frames {
        let [translations, rotations, scales] = [0..3, 3..7, 7..10].map(|part| part.start * TRANSFORMS..part.end * TRANSFORMS);
        for (number, (translation, rotation, scale)) in poses.of(frame).iter().enumerate() {
            floats[translations.clone()].as_chunks_mut().0[number] = translation.to_array();
            floats[rotations.clone()].as_chunks_mut().0[number] = rotation.to_array();
            floats[scales.clone()].as_chunks_mut().0[number] = scale.to_array();
        }
        bytes.clear();
        bytes.extend(floats.iter().flat_map(|float| float.to_le_bytes()));
        let place = frame as u64 % BARE_PLACES;
        memory.seek(SeekFrom::Start(place * bytes.len() as u64))?;
        memory.write_all(&bytes)?;
        if let Some(hash) = hash.replace(bare_hash(&floats)) {
            for stream in &mut streams {
                let mut answer = [0; 8];
                stream.read_exact(&mut answer)?;
                wrong += (u64::from_le_bytes(answer) != hash) as usize;
            }
        }
        if frame < frames {
            for stream in &mut streams {
                stream.write_all(&[place as u8])?;
            }
        }
    }
    println!(
        "bare processes, the same values: {:.0} frames/s, {wrong} disagreed",
        frames as f64 / started.elapsed().as_secs_f64()
    );
    drop(streams);
    for mut child in children {
        child.wait()?;
    }
    Ok(())
}

#[cfg(not(target_os = "linux"))]
fn bare(_: usize, _: usize) -> Result<(), Failure> {
    Ok(())
}

/// Where things are, made before anything is measured: sines and cosines are the world's work.
struct Poses(Vec<(Vec3, Quat, Vec3)>);

impl Poses {
    fn new() -> Poses {
        let pose = |x: f32| (Vec3::new(x, 1.0, -x), Quat::from_rotation_y(x), Vec3::splat(1.0 + x));
        Poses((0..2 * TRANSFORMS).map(|number| pose(number as f32 * 0.001)).collect())
    }

    /// One for each transform, others in each frame.
    fn of(&self, frame: usize) -> &[(Vec3, Quat, Vec3)] {
        let start = frame * 31 % TRANSFORMS;
        &self.0[start..start + TRANSFORMS]
    }
}

/// Writes so many transforms.
fn write(graph: &mut Graph, fields: &[[FieldId; FIELDS]], poses: &[(Vec3, Quat, Vec3)]) -> Result<(), Failure> {
    for ([translation, rotation, scale], pose) in fields.iter().zip(poses) {
        graph.set(*translation, pose.0)?;
        graph.set(*rotation, pose.1)?;
        graph.set(*scale, pose.2)?;
    }
    Ok(())
}

/// A graph of transforms, and the fields that are written.
fn world() -> Result<(Graph, Vec<[FieldId; FIELDS]>), Failure> {
    let mut graph = new_graph();
    let mut fields = Vec::new();
    for _ in 0..TRANSFORMS {
        let node = graph.create("Transform")?;
        fields.push([graph.field(node, "translation")?, graph.field(node, "rotation")?, graph.field(node, "scale")?]);
    }
    Ok((graph, fields))
}

/// What a frame costs at each end, without a network: medians of one process that has the machine for itself.
fn parts() -> Result<(), Failure> {
    let (mut graph, fields) = world()?;
    let mut publisher = Publisher::new();
    publisher.frame(&graph);
    let snapshot = publisher.snapshot(&graph).ok_or("the graph was written")?;
    let types: Vec<NodeType> = node_types().into_iter().chain(builtin_types()).collect();
    let bulk = Bulk::new();
    let mut replica = Replica::new(&Packet::read(&snapshot)?, TypeRegistry::from(types), &bulk)?;
    let poses = Poses::new();
    let mut took_us = [const { Vec::new() }; 4];
    for frame in 0..FRAMES {
        let begun = Instant::now();
        write(&mut graph, &fields, poses.of(frame))?;
        let written = Instant::now();
        let bytes = publisher.frame(&graph);
        let made = Instant::now();
        let packet = Packet::read(bytes)?;
        let read = Instant::now();
        replica.apply(&packet, &bulk)?;
        let applied = Instant::now();
        let steps = [written - begun, made - written, read - made, applied - read];
        took_us.iter_mut().zip(steps).for_each(|(all, step)| all.push(step.as_secs_f64() * 1e6));
    }
    println!("one frame of {} values, and the hash agrees: {}", TRANSFORMS * FIELDS, replica.agrees());
    let labels =
        ["the application writes its fields", "gathered, hashed, packed", "checksum of the packet", "written to fields, hashed"];
    for (label, all) in labels.into_iter().zip(&mut took_us) {
        all.sort_unstable_by(f64::total_cmp);
        let median = all[all.len() / 2];
        println!("  {label}: {median:.0} us, {:.1} ns a value", median * 1e3 / (TRANSFORMS * FIELDS) as f64);
    }
    Ok(())
}

fn application(display_count: usize, frames: usize) -> Result<(), Failure> {
    parts()?;
    let fast = ("10 000 transforms, as fast as can be", TRANSFORMS, Duration::ZERO);
    let at_60_hz = Duration::from_micros(16_667);
    println!("displays of this machine, which read frames out of the application's memory:");
    let rows = [fast, ("10 000 transforms at 60 Hz", TRANSFORMS, at_60_hz), ("one transform at 60 Hz", 1, at_60_hz)];
    let bytes_of_frame = cluster(display_count, true, frames, &rows)?;
    raw(bytes_of_frame, display_count, frames)?;
    bare(display_count, frames)?;
    println!("the same over the network:");
    cluster(display_count, false, frames, &rows)?;
    raw(bytes_of_frame, display_count, frames)
}

/// Runs an application and its displays, and tells how each row went: what it is, transforms of a frame, and time of a frame. Gives the
/// bytes of the largest frame.
fn cluster(display_count: usize, uses_memory: bool, frames: usize, rows: &[(&str, usize, Duration)]) -> Result<usize, Failure> {
    let (mut graph, fields) = world()?;
    let endpoint = format!("tcp/{}", free_address()?);
    let mut host = Host::listen(&HostOptions {
        listen: endpoint.clone(),
        security: Security::Loopback,
        timeout: TIMEOUT,
        lease: LEASE,
        ahead: true,
        lines: None,
    })?;
    let mut displays = Vec::new();
    for number in 0..display_count {
        let number = number.to_string();
        let args = ["--display", &endpoint, "--name", &number, OVER_NETWORK];
        displays.push(again(&args[..args.len() - usize::from(uses_memory)])?);
    }
    host.frame(&graph, false);
    while host.in_time() < display_count {
        host.wait_until(&graph, Instant::now() + Duration::from_millis(10));
    }
    let (mut bytes_of_frame, poses) = (0, Poses::new());
    for (label, count, period) in rows {
        let before = host.report();
        let started = Instant::now();
        for frame in 0..frames {
            write(&mut graph, &fields[..*count], poses.of(frame))?;
            host.frame(&graph, false);
            if !period.is_zero() {
                host.wait_until(&graph, started + *period * (frame as u32 + 1));
            }
        }
        let took = started.elapsed();
        let report = host.report();
        let bytes = (report.bytes - before.bytes) as f64 / (report.frames - before.frames) as f64;
        bytes_of_frame = bytes_of_frame.max(bytes as usize);
        let waits = report.waits.since(&before.waits);
        tell(label, (frames, took), bytes, (display_count, *count), [0.5, 0.99].map(|part| waits.quantile(part)));
    }
    host.frame(&graph, true);
    println!("left behind: {}, disagreed: {}", host.report().dropped, host.report().disagreed);
    drop(host);
    for mut child in displays {
        child.wait()?;
    }
    Ok(bytes_of_frame)
}

fn raw(bytes: usize, display_count: usize, frames: usize) -> Result<(), Failure> {
    let listener = TcpListener::bind("127.0.0.1:0")?;
    let address = listener.local_addr()?.to_string();
    let mut children = Vec::new();
    let mut streams = Vec::new();
    for _ in 0..display_count {
        children.push(again(&["--raw", &address])?);
        let (stream, _) = listener.accept()?;
        stream.set_nodelay(true)?;
        streams.push(stream);
    }
    let packet = [&(bytes as u64).to_le_bytes()[..], &vec![7; bytes]].concat();
    let mut waits = Vec::new();
    let started = Instant::now();
    for _ in 0..frames {
        let sent = Instant::now();
        for stream in &mut streams {
            stream.write_all(&packet)?;
        }
        for stream in &mut streams {
            stream.read_exact(&mut [0])?;
        }
        waits.push(sent.elapsed());
    }
    let took = started.elapsed();
    waits.sort_unstable();
    let quantiles = [waits[waits.len() / 2], waits[waits.len() * 99 / 100]];
    tell("raw TCP, the same bytes", (frames, took), bytes as f64, (display_count, TRANSFORMS), quantiles);
    drop(streams);
    for mut child in children {
        child.wait()?;
    }
    Ok(())
}

fn tell(
    label: &str,
    (frames, took): (usize, Duration),
    bytes: f64,
    (displays, transforms): (usize, usize),
    waits: [Duration; 2],
) {
    let [half, most] = waits.map(|wait| wait.as_secs_f64() * 1e3);
    let rate = frames as f64 / took.as_secs_f64();
    println!(
        "{label}: {rate:.0} frames/s, {bytes:.0} bytes a frame, {:.0} MB/s to all, {:.2} million updates/s at each, barrier p50 {half:.2} ms, p99 {most:.2} ms",
        rate * bytes * displays as f64 * 1e-6,
        rate * (transforms * FIELDS) as f64 * 1e-6,
    );
}
