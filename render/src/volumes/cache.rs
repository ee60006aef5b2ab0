//! Triangles and edges of meshes on the GPU, kept as long as their mesh lives.

use super::parts::{self, Part};
use glam::Vec3;
use std::collections::HashMap;
use std::sync::{Arc, Weak};
use umbriel_scene::Mesh;
use wgpu::util::DeviceExt;

/// A [`Part`] on the GPU.
pub(crate) struct GpuPart {
    pub(crate) triangle_count: u32,
    pub(crate) edge_count: u32,
    pub(super) layers: u32,
    /// Are there surfaces that cast as they are wound, and such that cast turned over, before a matrix mirrors them?
    pub(super) windings: [bool; 2],
    /// Triangles of convex solids, which are in neither.
    pub(super) solid_count: u32,
    /// As in [`Part::sheet`].
    pub(super) sheet: Option<[Vec3; 3]>,
    /// Most triangles at one edge.
    pub(super) widest_edge: u32,
    pub(crate) triangles: wgpu::Buffer,
    pub(crate) edges: wgpu::Buffer,
    pub(crate) incidences: wgpu::Buffer,
    /// Edge of each incidence.
    pub(super) edge_of: wgpu::Buffer,
}

/// Parts of all meshes that were ever asked for and still live.
#[derive(Default)]
pub(super) struct MeshCache {
    /// By address, which the weak reference keeps from being used again.
    meshes: HashMap<usize, (Weak<Mesh>, Vec<Arc<GpuPart>>)>,
    /// What was found wrong with meshes and not yet told.
    pub(super) problems: Vec<String>,
}

impl MeshCache {
    /// The parts of a mesh; none where it has no triangle with an area of its own.
    pub(super) fn parts(&mut self, device: &wgpu::Device, mesh: &Arc<Mesh>) -> &[Arc<GpuPart>] {
        let problems = &mut self.problems;
        let upload = || {
            let parts = parts::parts(mesh);
            if let Some(problem) = problem_of(device, mesh, &parts) {
                problems.push(format!("mesh '{}' {problem}", mesh.name));
            }
            let fit = |p: &&Part| p.largest_list() <= largest_buffer(device);
            let parts = if parts.iter().all(|p| fit(&p)) { parts } else { Vec::new() };
            (Arc::downgrade(mesh), parts.iter().map(|p| Arc::new(GpuPart::new(device, p))).collect())
        };
        &self.meshes.entry(Arc::as_ptr(mesh) as usize).or_insert_with(upload).1
    }

    /// Forgets meshes that nobody holds any more.
    pub(super) fn forget_dead(&mut self) {
        self.meshes.retain(|_, (mesh, _)| mesh.strong_count() > 0);
    }
}

/// What the author of a mesh should know of its shadow volumes.
fn problem_of(device: &wgpu::Device, mesh: &Mesh, parts: &[Part]) -> Option<String> {
    let limit = largest_buffer(device);
    let layers = parts.iter().map(|p| p.layers).max().unwrap_or(0);
    if parts.is_empty() {
        let count = mesh.triangle_count();
        return Some(format!(
            "casts no shadow volume: none of its {count} triangles has three places of its own (field `cast_shadow` of its shape)"
        ));
    }
    if parts.iter().any(|p| p.largest_list() > limit) {
        return Some(format!("casts no shadow volume: its edges do not fit into a buffer of {limit} bytes"));
    }
    (layers > parts::GROUP_LAYERS).then(|| {
        format!("may put {layers} layers of shadow over a point: where they are a multiple of 128, its volume shadow has a hole")
    })
}

/// Bytes of the largest list that the device can read.
pub(super) fn largest_buffer(device: &wgpu::Device) -> u64 {
    let limits = device.limits();
    limits.max_storage_buffer_binding_size.min(limits.max_buffer_size)
}

impl GpuPart {
    fn new(device: &wgpu::Device, part: &Part) -> GpuPart {
        let buffer = |label, contents: &[u8]| {
            device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
                label: Some(label),
                contents,
                usage: wgpu::BufferUsages::STORAGE,
            })
        };
        let has = |winding: u32| part.triangles.iter().any(|t| t[3] == 0 || t[3] == winding);
        let edge_of: Vec<u32> = (0u32..).zip(&part.edges).flat_map(|(i, e)| std::iter::repeat_n(i, e[3] as usize)).collect();
        GpuPart {
            solid_count: part.triangles.iter().filter(|t| t[3] == parts::SOLID).count() as u32,
            sheet: part.sheet,
            windings: [has(1), has(2)],
            widest_edge: part.edges.iter().map(|e| e[3]).max().unwrap_or(0),
            edge_of: buffer("volume edges of incidences", bytemuck::cast_slice(&edge_of)),
            triangle_count: part.triangles.len() as u32,
            edge_count: part.edges.len() as u32,
            layers: part.layers,
            triangles: buffer("volume triangles", bytemuck::cast_slice(&part.triangles)),
            edges: buffer("volume edges", bytemuck::cast_slice(&part.edges)),
            incidences: buffer("volume incidences", bytemuck::cast_slice(&part.incidences)),
        }
    }
}
