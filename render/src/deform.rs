//! Skins and morph targets: once per frame, into vertices that all passes share.

use crate::cache::GpuMesh;
use crate::clock::Clock;
use crate::shaders;
use crate::start::{Late, late};
use bytemuck::{Pod, Zeroable};
use std::collections::HashMap;
use std::sync::Arc;
use umbriel_scene::{Mesh, Pose};
use wgpu::util::{BufferInitDescriptor, DeviceExt};
use wgpu::{BufferUsages, ShaderStages};

const WORKGROUP: u32 = 64;
const MOST_GROUPS: u32 = 65_535;
/// Frames that deformed vertices outlive their last use.
const KEEP_FRAMES: u64 = 120;

/// `Deformation` of deform.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(crate) struct Uniform {
    pub(crate) vertex_count: u32,
    pub(crate) target_count: u32,
    pub(crate) joint_count: u32,
    pub(crate) spare: u32,
}

/// What deforms a mesh, on the GPU as long as the mesh is.
pub(crate) struct Sources {
    influences: wgpu::Buffer,
    offsets: wgpu::Buffer,
}

/// Vertices of one drawable as they are now.
pub(crate) struct Deformed {
    pub(crate) positions: wgpu::Buffer,
    pub(crate) frames: wgpu::Buffer,
    /// Grows whenever they change.
    pub(crate) revision: u64,
    mesh: Arc<Mesh>,
    pose: Arc<Pose>,
    last_used: u64,
}

/// Deforms the drawables that have a pose.
pub(crate) struct Deformer {
    pipeline: Late<wgpu::ComputePipeline>,
    layout: wgpu::BindGroupLayout,
    /// By place of the drawable in the scene.
    deformed: HashMap<u32, Deformed>,
    jobs: Vec<(wgpu::BindGroup, u32)>,
    revision: u64,
}

/// Does the pose change this mesh?
pub(crate) fn is_deformed(mesh: &Mesh, pose: &Pose) -> bool {
    let has_skin = !mesh.joints.is_empty() && !mesh.weights.is_empty() && !pose.object_from_bind.is_empty();
    let has_morph = mesh.morph_targets.iter().zip(&pose.morph_weights).any(|(_, w)| *w != 0.0);
    has_skin || has_morph
}

/// Sends what deforms a mesh to the GPU; nothing for a stiff mesh.
pub(crate) fn make_sources(device: &wgpu::Device, mesh: &Mesh) -> Option<Sources> {
    if mesh.joints.is_empty() && mesh.morph_targets.is_empty() {
        return None;
    }
    let mut influences: Vec<[u32; 8]> = Vec::with_capacity(mesh.joints.len());
    for (joints, weights) in mesh.joints.iter().zip(mesh.weights.iter()) {
        let [a, b, c, d] = joints.map(u32::from);
        let [e, f, g, h] = weights.to_array().map(f32::to_bits);
        influences.push([a, b, c, d, e, f, g, h]);
    }
    influences.resize(influences.len().max(1), [0; 8]);
    let mut offsets: Vec<f32> = Vec::with_capacity(mesh.morph_targets.len() * mesh.positions.len() * 9);
    for target in &mesh.morph_targets {
        for i in 0..mesh.positions.len() {
            for list in [&target.positions, &target.normals, &target.tangents] {
                offsets.extend(list.get(i).copied().unwrap_or_default().to_array());
            }
        }
    }
    offsets.resize(offsets.len().max(1), 0.0);
    Some(Sources {
        influences: init(device, "influences", bytemuck::cast_slice(&influences), BufferUsages::STORAGE),
        offsets: init(device, "morph offsets", bytemuck::cast_slice(&offsets), BufferUsages::STORAGE),
    })
}

fn init(device: &wgpu::Device, label: &str, contents: &[u8], usage: BufferUsages) -> wgpu::Buffer {
    device.create_buffer_init(&BufferInitDescriptor { label: Some(label), contents, usage })
}

impl Deformer {
    pub(crate) fn new(device: &wgpu::Device) -> Deformer {
        let entry = |binding, ty| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None },
            count: None,
        };
        let mut entries = vec![entry(0, wgpu::BufferBindingType::Uniform)];
        entries.extend((1..=6).map(|i| entry(i, wgpu::BufferBindingType::Storage { read_only: true })));
        entries.extend((7..=8).map(|i| entry(i, wgpu::BufferBindingType::Storage { read_only: false })));
        let layout =
            device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some("deform"), entries: &entries });
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("deform"),
            bind_group_layouts: &[Some(&layout)],
            immediate_size: 0,
        });
        let device = device.clone();
        let pipeline = late(move || {
            device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some("deform"),
                layout: Some(&pipeline_layout),
                module: &shaders::module(&device, "deform", shaders::DEFORM),
                entry_point: Some("deform"),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                cache: None,
            })
        });
        Deformer { pipeline, layout, deformed: HashMap::new(), jobs: Vec::new(), revision: 0 }
    }

    /// Takes a drawable's pose; vertices are computed only where it is a new one. False where nothing deforms it.
    pub(crate) fn pose(
        &mut self,
        device: &wgpu::Device,
        drawable: u32,
        mesh: &Arc<Mesh>,
        gpu_mesh: &GpuMesh,
        pose: &Arc<Pose>,
        frame: u64,
    ) -> bool {
        let Some(sources) = gpu_mesh.sources.as_ref().filter(|_| is_deformed(mesh, pose)) else { return false };
        if let Some(old) = self.deformed.get_mut(&drawable).filter(|d| Arc::ptr_eq(&d.mesh, mesh)) {
            old.last_used = frame;
            if Arc::ptr_eq(&old.pose, pose) {
                return true;
            }
        }
        self.revision += 1;
        let revision = self.revision;
        let fresh = || {
            let copy = |label, size| {
                let usage = BufferUsages::VERTEX | BufferUsages::STORAGE | BufferUsages::COPY_SRC;
                device.create_buffer(&wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false })
            };
            Deformed {
                positions: copy("deformed positions", gpu_mesh.positions.size()),
                frames: copy("deformed frames", gpu_mesh.frames.size()),
                revision,
                mesh: mesh.clone(),
                pose: pose.clone(),
                last_used: frame,
            }
        };
        let place = self.deformed.entry(drawable).or_insert_with(fresh);
        if !Arc::ptr_eq(&place.mesh, mesh) {
            *place = fresh();
        }
        (place.pose, place.revision, place.last_used) = (pose.clone(), revision, frame);
        let group = group(device, &self.layout, gpu_mesh, mesh, sources, pose, place);
        self.jobs.push((group, gpu_mesh.vertex_count));
        true
    }

    /// Computes what was taken since the last call; the number of meshes.
    pub(crate) fn run(&mut self, encoder: &mut wgpu::CommandEncoder, clock: &Clock) -> u32 {
        let count = self.jobs.len() as u32;
        if count > 0 {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some("deform"),
                timestamp_writes: clock.compute("deform"),
            });
            pass.set_pipeline(&self.pipeline);
            for (group, vertices) in self.jobs.drain(..) {
                let groups = vertices.div_ceil(WORKGROUP);
                pass.set_bind_group(0, &group, &[]);
                pass.dispatch_workgroups(groups.min(MOST_GROUPS), groups.div_ceil(MOST_GROUPS), 1);
            }
        }
        count
    }

    pub(crate) fn get(&self, drawable: u32) -> Option<&Deformed> {
        self.deformed.get(&drawable)
    }

    /// A deformed mesh is in use.
    pub(crate) fn touch(&mut self, drawable: u32, frame: u64) {
        if let Some(deformed) = self.deformed.get_mut(&drawable) {
            deformed.last_used = frame;
        }
    }

    pub(crate) fn drop_unused(&mut self, frame: u64) {
        self.deformed.retain(|_, d| d.last_used + KEEP_FRAMES > frame);
    }
}

fn group(
    device: &wgpu::Device,
    layout: &wgpu::BindGroupLayout,
    gpu_mesh: &GpuMesh,
    mesh: &Mesh,
    sources: &Sources,
    pose: &Pose,
    to: &Deformed,
) -> wgpu::BindGroup {
    let has_skin = !mesh.joints.is_empty() && !mesh.weights.is_empty();
    let uniform = Uniform {
        vertex_count: gpu_mesh.vertex_count,
        target_count: mesh.morph_targets.len().min(pose.morph_weights.len()) as u32,
        joint_count: if has_skin { pose.object_from_bind.len() as u32 } else { 0 },
        spare: 0,
    };
    let mut joints = pose.object_from_bind.clone();
    joints.resize(joints.len().max(1), glam::Mat4::IDENTITY);
    let mut weights = pose.morph_weights.clone();
    weights.resize(weights.len().max(1), 0.0);
    let uniform = init(device, "deformation", bytemuck::bytes_of(&uniform), BufferUsages::UNIFORM);
    let joints = init(device, "joints", bytemuck::cast_slice(&joints), BufferUsages::STORAGE);
    let weights = init(device, "morph weights", bytemuck::cast_slice(&weights), BufferUsages::STORAGE);
    let buffers = [
        &uniform,
        &gpu_mesh.positions,
        &gpu_mesh.frames,
        &sources.influences,
        &sources.offsets,
        &joints,
        &weights,
        &to.positions,
        &to.frames,
    ];
    let entries: Vec<wgpu::BindGroupEntry<'_>> =
        (0..).zip(buffers).map(|(binding, b)| wgpu::BindGroupEntry { binding, resource: b.as_entire_binding() }).collect();
    device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some("deform"), layout, entries: &entries })
}
