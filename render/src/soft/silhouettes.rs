//! The silhouettes of a job's casters in one list, gathered by compute passes.

use crate::shaders;
use crate::start::{Late, late};
use crate::volumes::{CasterUniform, GpuPart, VolumeCaster, VolumeLight, VolumePass};
use std::sync::Arc;
use wgpu::BufferUsages;
use wgpu::util::{BufferInitDescriptor, DeviceExt};

/// Vertices of a wedge's hull: `HULL` of wedges.wgsl.
const HULL_VERTICES: u32 = 24;
/// Arguments of `draw_indirect` before the list.
const HEADER_BYTES: u64 = 16;
const SILHOUETTE_BYTES: u64 = 32;

/// Both ends of each silhouette edge, in the world, behind the arguments of the draw of their wedges.
pub(super) struct Silhouettes {
    pub(super) buffer: wgpu::Buffer,
    made_of: Vec<Item>,
}

/// A part of a caster, and everything that decides where its silhouette is.
#[derive(Clone)]
struct Item {
    part: Arc<GpuPart>,
    uniform: CasterUniform,
    positions: wgpu::Buffer,
    positions_revision: u64,
}

impl PartialEq for Item {
    fn eq(&self, other: &Item) -> bool {
        Arc::ptr_eq(&self.part, &other.part)
            && self.uniform == other.uniform
            && self.positions == other.positions
            && self.positions_revision == other.positions_revision
    }
}

/// The pipeline.
pub(super) struct Gather {
    layout: wgpu::BindGroupLayout,
    pipeline: Late<wgpu::ComputePipeline>,
}

impl Gather {
    pub(super) fn new(device: &wgpu::Device) -> Gather {
        let storage = |read_only| wgpu::BufferBindingType::Storage { read_only };
        let kinds =
            [wgpu::BufferBindingType::Uniform, storage(true), storage(true), storage(true), storage(true), storage(false)];
        let entries: Vec<_> = (0..)
            .zip(kinds)
            .map(|(binding, ty)| wgpu::BindGroupLayoutEntry {
                binding,
                visibility: wgpu::ShaderStages::COMPUTE,
                ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None },
                count: None,
            })
            .collect();
        let layout =
            device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some("silhouettes"), entries: &entries });
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("silhouettes"),
            bind_group_layouts: &[Some(&layout)],
            immediate_size: 0,
        });
        let device = device.clone();
        let pipeline = late(move || {
            device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some("silhouettes"),
                layout: Some(&pipeline_layout),
                module: &shaders::module(&device, "silhouettes", shaders::SILHOUETTES),
                entry_point: Some("gather"),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                cache: None,
            })
        });
        Gather { layout, pipeline }
    }

    /// An empty list.
    pub(super) fn nothing(&self, device: &wgpu::Device) -> Silhouettes {
        Silhouettes { buffer: list(device, 0), made_of: Vec::new() }
    }

    /// The list of all casters; the old one where nothing changed. Says so where it does not fit into a buffer.
    pub(super) fn run(
        &self,
        (device, queue): (&wgpu::Device, &wgpu::Queue),
        encoder: &mut wgpu::CommandEncoder,
        volumes: &mut VolumePass,
        (light, casters): (&VolumeLight, &[VolumeCaster]),
        old: Option<Silhouettes>,
    ) -> Result<Silhouettes, String> {
        let made_of = items(device, volumes, light, casters);
        if let Some(old) = old.as_ref().filter(|o| o.made_of == made_of) {
            return Ok(Silhouettes { buffer: old.buffer.clone(), made_of });
        }
        let edges: u64 = made_of.iter().map(|i| u64::from(i.part.edge_count)).sum();
        let (bytes, limits) = (HEADER_BYTES + edges * SILHOUETTE_BYTES, device.limits());
        let most = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        if bytes > most {
            return Err(format!("a soft shadow of {edges} edges does not fit into a buffer of {most} bytes: it stays hard"));
        }
        let buffer = match old.filter(|o| o.buffer.size() >= bytes) {
            Some(old) => old.buffer,
            None => list(device, edges),
        };
        queue.write_buffer(&buffer, 0, bytemuck::cast_slice(&[HULL_VERTICES, 0, 0, 0]));
        self.dispatch(device, encoder, &made_of, &buffer);
        Ok(Silhouettes { buffer, made_of })
    }

    fn dispatch(&self, device: &wgpu::Device, encoder: &mut wgpu::CommandEncoder, items: &[Item], list: &wgpu::Buffer) {
        const STRIDE: usize = 256;
        let mut bytes = vec![0; items.len().max(1) * STRIDE];
        for (at, item) in bytes.chunks_mut(STRIDE).zip(items) {
            at[..size_of::<CasterUniform>()].copy_from_slice(bytemuck::bytes_of(&item.uniform));
        }
        let usage = BufferUsages::UNIFORM;
        let uniforms = device.create_buffer_init(&BufferInitDescriptor { label: Some("silhouettes"), contents: &bytes, usage });
        let mut pass =
            encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: Some("silhouettes"), timestamp_writes: None });
        pass.set_pipeline(&self.pipeline);
        for (number, item) in items.iter().enumerate() {
            let uniform = wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                buffer: &uniforms,
                offset: (number * STRIDE) as u64,
                size: wgpu::BufferSize::new(size_of::<CasterUniform>() as u64),
            });
            let buffers = [&item.positions, &item.part.triangles, &item.part.edges, &item.part.incidences, list];
            let resources = std::iter::once(uniform).chain(buffers.iter().map(|b| b.as_entire_binding()));
            let entries: Vec<_> =
                (0..).zip(resources).map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource }).collect();
            let layout = &self.layout;
            let group =
                device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some("silhouettes"), layout, entries: &entries });
            let groups = item.part.edge_count.div_ceil(64);
            let rows = groups.div_ceil(65_535).max(1);
            pass.set_bind_group(0, &group, &[]);
            pass.dispatch_workgroups(groups.div_ceil(rows), rows, 1);
        }
    }
}

/// The parts of all casters that can cast.
fn items(device: &wgpu::Device, volumes: &mut VolumePass, light: &VolumeLight, casters: &[VolumeCaster]) -> Vec<Item> {
    let mut items = Vec::new();
    for caster in casters.iter().filter(|c| c.positions.size() >= 12 * c.mesh.positions.len() as u64) {
        for part in volumes.parts(device, &caster.mesh) {
            items.push(Item {
                uniform: CasterUniform::new(light, caster.world_from_object, &caster.bounds.in_world, part),
                part: part.clone(),
                positions: caster.positions.clone(),
                positions_revision: caster.positions_revision,
            });
        }
    }
    items
}

fn list(device: &wgpu::Device, edges: u64) -> wgpu::Buffer {
    device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("silhouettes"),
        size: HEADER_BYTES + edges.max(1) * SILHOUETTE_BYTES,
        usage: BufferUsages::STORAGE | BufferUsages::INDIRECT | BufferUsages::COPY_DST,
        mapped_at_creation: false,
    })
}
