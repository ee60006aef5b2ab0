//! Compute passes that turn triangles to the light and raise sides over the edges that do not cancel.

use super::VolumeLight;
use super::cache::GpuPart;
use bytemuck::{Pod, Zeroable};
use glam::{Mat4, Vec4};
use std::sync::Arc;
use umbriel_scene::Aabb;
use wgpu::util::DeviceExt;

/// WGSL of this pass: the shared ways from vertices to the screen, what casts, then its own.
pub(super) const SHADER: &str =
    concat!(include_str!("../shaders/position.wgsl"), include_str!("caster.wgsl"), include_str!("extract.wgsl"));

const EVERY_TRIANGLE: u32 = 1;
const MIRRORED: u32 = 2;

/// `Caster` of the shaders.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(super) struct CasterUniform {
    world_from_object: Mat4,
    toward_light: Vec4,
    triangle_count: u32,
    edge_count: u32,
    flags: u32,
    unused: u32,
}

impl CasterUniform {
    fn new(light: &VolumeLight, world_from_object: Mat4, bounds: &Aabb, part: &GpuPart) -> CasterUniform {
        // Of a closed surface the near side is enough only while the light is outside of it.
        let (p, margin) = (light.toward_light.truncate(), 1e-3 * bounds.radius());
        let outside = p.cmplt(bounds.min - margin).any() || p.cmpgt(bounds.max + margin).any();
        let mut flags = 0;
        if light.toward_light.w != 0.0 && (bounds.is_empty() || !outside) {
            flags |= EVERY_TRIANGLE;
        }
        if world_from_object.determinant() < 0.0 {
            flags |= MIRRORED;
        }
        CasterUniform {
            world_from_object,
            toward_light: light.toward_light,
            triangle_count: part.triangle_count,
            edge_count: part.edge_count,
            flags,
            unused: 0,
        }
    }
}

/// Arguments of one `draw_indexed_indirect`, `Draw` of the shader.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
struct Draw {
    index_count: u32,
    instance_count: u32,
    first_index: u32,
    base_vertex: i32,
    first_instance: u32,
}

/// Place of each draw's arguments in [`Lists::draws`], bytes.
pub(super) const SIDES: u64 = 0;
pub(super) const CAPS: u64 = DRAW_SIZE;
pub(super) const TURNED_CAPS: u64 = 2 * DRAW_SIZE;
const DRAW_SIZE: u64 = size_of::<Draw>() as u64;

/// Everything that decides what the lists hold.
#[derive(Clone, PartialEq)]
struct Key {
    uniform: CasterUniform,
    positions: wgpu::Buffer,
    positions_revision: u64,
}

/// The volume of one part of a caster under one light.
pub(super) struct Lists {
    pub(super) part: Arc<GpuPart>,
    /// Of index, twice the vertex number, plus 1 for the vertex at infinity.
    pub(super) indices: wgpu::Buffer,
    pub(super) draws: wgpu::Buffer,
    /// Bind group 1 of the draw.
    pub(super) placed: wgpu::BindGroup,
    bind_group: wgpu::BindGroup,
    uniform: wgpu::Buffer,
    casts: wgpu::Buffer,
    local_light: bool,
    key: Key,
}

/// What one list is made of.
#[derive(Clone, Copy)]
pub(super) struct Wanted<'a> {
    pub(super) light: &'a VolumeLight,
    pub(super) part: &'a Arc<GpuPart>,
    pub(super) positions: &'a wgpu::Buffer,
    pub(super) positions_revision: u64,
    pub(super) world_from_object: Mat4,
    pub(super) bounds_in_world: &'a Aabb,
}

/// Pipelines of the two steps.
pub(super) struct Extract {
    layout: wgpu::BindGroupLayout,
    placed_layout: wgpu::BindGroupLayout,
    turn_triangles: wgpu::ComputePipeline,
    raise_edges: wgpu::ComputePipeline,
}

impl Extract {
    pub(super) fn new(device: &wgpu::Device, placed_layout: &wgpu::BindGroupLayout) -> Extract {
        let storage = |read_only| wgpu::BufferBindingType::Storage { read_only };
        let entry = |binding, ty| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None },
            count: None,
        };
        let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("volume extraction"),
            entries: &[
                entry(0, wgpu::BufferBindingType::Uniform),
                entry(1, storage(true)),
                entry(2, storage(true)),
                entry(3, storage(true)),
                entry(4, storage(true)),
                entry(5, storage(false)),
                entry(6, storage(false)),
                entry(7, storage(false)),
            ],
        });
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("volume extraction"),
            source: wgpu::ShaderSource::Wgsl(SHADER.into()),
        });
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("volume extraction"),
            bind_group_layouts: &[Some(&layout)],
            immediate_size: 0,
        });
        let pipeline = |entry_point| {
            device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(entry_point),
                layout: Some(&pipeline_layout),
                module: &module,
                entry_point: Some(entry_point),
                compilation_options: Default::default(),
                cache: None,
            })
        };
        let (turn_triangles, raise_edges) = (pipeline("turn_triangles"), pipeline("raise_edges"));
        Extract { layout, placed_layout: placed_layout.clone(), turn_triangles, raise_edges }
    }

    /// Runs both steps for all `stale` lists.
    pub(super) fn run(&self, device: &wgpu::Device, encoder: &mut wgpu::CommandEncoder, stale: &[&Lists]) {
        if stale.is_empty() {
            return;
        }
        start_anew(device, encoder, stale);
        let mut pass =
            encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: Some("volume extraction"), timestamp_writes: None });
        for (pipeline, count) in
            [(&self.turn_triangles, (|p| p.triangle_count) as fn(&GpuPart) -> u32), (&self.raise_edges, |p| p.edge_count)]
        {
            pass.set_pipeline(pipeline);
            for lists in stale {
                let groups = count(&lists.part).div_ceil(64);
                let rows = groups.div_ceil(65_535);
                pass.set_bind_group(0, &lists.bind_group, &[]);
                pass.dispatch_workgroups(groups.div_ceil(rows), rows, 1);
            }
        }
    }

    /// Lists for `wanted`, in the buffers of `old` where these fit. The flag says whether they must be made anew by
    /// [`Extract::run`]. `None` where the device cannot hold them.
    pub(super) fn lists(&self, device: &wgpu::Device, wanted: &Wanted<'_>, old: Option<Lists>) -> Option<(Lists, bool)> {
        let key = Key {
            uniform: CasterUniform::new(wanted.light, wanted.world_from_object, wanted.bounds_in_world, wanted.part),
            positions: wanted.positions.clone(),
            positions_revision: wanted.positions_revision,
        };
        let local_light = wanted.light.toward_light.w != 0.0;
        let capacity = Capacity::new(wanted.part, local_light);
        let lists = match old.filter(|o| o.local_light == local_light) {
            Some(old) if old.key == key => return Some((old, false)),
            Some(old) if old.key.positions == key.positions => Lists { key, ..old },
            Some(old) => {
                let (bind_group, placed) = self.bind_groups(device, wanted, [&old.uniform, &old.casts, &old.draws, &old.indices]);
                Lists { key, bind_group, placed, ..old }
            }
            None => {
                let limits = device.limits();
                if capacity.bytes() > limits.max_storage_buffer_binding_size.min(limits.max_buffer_size) {
                    return None;
                }
                self.allocate(device, wanted, key, &capacity)
            }
        };
        Some((lists, true))
    }

    fn allocate(&self, device: &wgpu::Device, wanted: &Wanted<'_>, key: Key, capacity: &Capacity) -> Lists {
        use wgpu::BufferUsages as U;
        let buffer = |label, size, usage| {
            device.create_buffer(&wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false })
        };
        let uniform = buffer("volume caster", size_of::<CasterUniform>() as u64, U::UNIFORM | U::COPY_DST);
        let casts = buffer("volume casts", 4 * u64::from(wanted.part.triangle_count), U::STORAGE);
        let draws = buffer("volume draws", 3 * DRAW_SIZE, U::STORAGE | U::INDIRECT | U::COPY_DST);
        let indices = buffer("volume indices", capacity.bytes(), U::STORAGE | U::INDEX);
        let (bind_group, placed) = self.bind_groups(device, wanted, [&uniform, &casts, &draws, &indices]);
        let local_light = wanted.light.toward_light.w != 0.0;
        Lists { part: wanted.part.clone(), indices, draws, placed, bind_group, uniform, casts, local_light, key }
    }

    /// Bind groups of extraction and draw, over uniform, casts, draws and indices.
    fn bind_groups(
        &self,
        device: &wgpu::Device,
        wanted: &Wanted<'_>,
        [uniform, casts, draws, indices]: [&wgpu::Buffer; 4],
    ) -> (wgpu::BindGroup, wgpu::BindGroup) {
        let bind = |layout, buffers: &[&wgpu::Buffer]| {
            let entries: Vec<_> = (0u32..)
                .zip(buffers)
                .map(|(binding, b)| wgpu::BindGroupEntry { binding, resource: b.as_entire_binding() })
                .collect();
            device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some("volume caster"), layout, entries: &entries })
        };
        let part = wanted.part;
        let all = [uniform, wanted.positions, &part.triangles, &part.edges, &part.incidences, casts, draws, indices];
        (bind(&self.layout, &all), bind(&self.placed_layout, &[uniform, wanted.positions]))
    }
}

/// Fills uniforms and empties lists: one upload for all, since many small writes cost more than the lists themselves.
fn start_anew(device: &wgpu::Device, encoder: &mut wgpu::CommandEncoder, stale: &[&Lists]) {
    const UNIFORM: u64 = size_of::<CasterUniform>() as u64;
    let mut contents = Vec::with_capacity(stale.len() * (UNIFORM + 3 * DRAW_SIZE) as usize);
    for lists in stale {
        contents.extend_from_slice(bytemuck::bytes_of(&lists.key.uniform));
        contents.extend_from_slice(bytemuck::cast_slice(&Capacity::new(&lists.part, lists.local_light).empty_draws()));
    }
    let upload = device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
        label: Some("volume upload"),
        contents: &contents,
        usage: wgpu::BufferUsages::COPY_SRC,
    });
    let mut at = 0;
    for lists in stale {
        for (buffer, size) in [(&lists.uniform, UNIFORM), (&lists.draws, 3 * DRAW_SIZE)] {
            encoder.copy_buffer_to_buffer(&upload, at, buffer, 0, size);
            at += size;
        }
    }
}

/// Room for the longest lists that can be, in indices.
struct Capacity {
    sides: u32,
    caps: u32,
}

impl Capacity {
    /// Every side of every triangle may stand alone: as one triangle to infinity under parallel light, else as two, with
    /// a far cap for each triangle.
    fn new(part: &GpuPart, local_light: bool) -> Capacity {
        let per_triangle = if local_light { 3 * 6 + 3 } else { 3 * 3 };
        Capacity { sides: part.triangle_count.saturating_mul(per_triangle), caps: part.triangle_count.saturating_mul(3) }
    }

    fn bytes(&self) -> u64 {
        4 * (u64::from(self.sides) + u64::from(self.caps))
    }

    fn empty_draws(&self) -> [Draw; 3] {
        let first = [0, self.sides, self.sides.saturating_add(self.caps)];
        first.map(|first_index| Draw { instance_count: 1, first_index, ..Draw::default() })
    }
}
