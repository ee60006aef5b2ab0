//! Buffers of one caster under one light, and the compute passes that turn its triangles to the light and raise sides over
//! the edges that do not cancel.

use super::VolumeLight;
use super::cache::{GpuPart, largest_buffer};
use super::draw::Layouts;
use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Mat4, Vec4};
use std::sync::Arc;
use umbriel_scene::{Aabb, Silhouettes};
use wgpu::util::DeviceExt;

/// WGSL of this pass: the shared ways from vertices to the screen, what casts, then its own.
pub(super) const SHADER: &str = concat!(
    include_str!("../shaders/position.wgsl"),
    include_str!("silhouette.wgsl"),
    include_str!("caster.wgsl"),
    include_str!("extract.wgsl")
);

const EVERY_TRIANGLE: u32 = 1;
const MIRRORED: u32 = 2;
const POINTED: u32 = 4;

/// Edges of more triangles than this are left to the compute pass: with degenerate quads, every corner of as many quads
/// would ask all of them.
const WIDEST_EDGE: u32 = 32;

/// `Caster` of the shaders.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(crate) struct CasterUniform {
    world_from_object: Mat4,
    toward_light: Vec4,
    triangle_count: u32,
    edge_count: u32,
    flags: u32,
    reach_w: f32,
}

impl CasterUniform {
    /// Thrown to infinity.
    pub(crate) fn new(light: &VolumeLight, world_from_object: Mat4, bounds: &Aabb, part: &GpuPart) -> CasterUniform {
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
            reach_w: 0.0,
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

/// A piece of the volume, in the order of `Draws` of the shader.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) enum Piece {
    Sides,
    NearCaps,
    /// Near caps whose order of vertices is turned over.
    TurnedCaps,
    /// Near caps of convex solids that are not mirrored.
    SolidCaps,
    FarCaps,
}

impl Piece {
    pub(super) const ALL: [Piece; 5] = [Piece::Sides, Piece::NearCaps, Piece::TurnedCaps, Piece::SolidCaps, Piece::FarCaps];

    /// Place of the draw's arguments in [`Listed::draws`], bytes.
    pub(super) fn offset(self) -> u64 {
        self as u64 * DRAW_SIZE
    }
}

const DRAW_SIZE: u64 = size_of::<Draw>() as u64;
const DRAWS_SIZE: u64 = Piece::ALL.len() as u64 * DRAW_SIZE;

/// Everything that decides what the lists hold.
#[derive(Clone)]
struct Key {
    positions: wgpu::Buffer,
    positions_revision: u64,
    flags: u32,
    world_from_object: Mat4,
    toward_light: Vec4,
    light_in_object: Option<Vec4>,
}

impl Key {
    fn new(wanted: &Wanted<'_>, flags: u32) -> Key {
        Key {
            positions: wanted.positions.clone(),
            positions_revision: wanted.positions_revision,
            flags,
            world_from_object: wanted.world_from_object,
            toward_light: wanted.light.toward_light,
            light_in_object: light_in_object(&wanted.world_from_object, wanted.light.toward_light),
        }
    }

    /// Do lists made for `self` serve `other`? Which triangles face the light is decided by where it is as the object sees
    /// it, so a world that turns and moves as one keeps its lists, "the world moves" of an installation among it. Whatever
    /// triangles are taken to face the light, their volumes are closed, so a rounding error of the matrices moves a
    /// shadow's edge at most from one end of a triangle that the light grazes to the other.
    fn serves(&self, other: &Key) -> bool {
        let same =
            self.positions == other.positions && self.positions_revision == other.positions_revision && self.flags == other.flags;
        let (place, other_place) = ((self.world_from_object, self.toward_light), (other.world_from_object, other.toward_light));
        let near = |(a, b): (Vec4, Vec4)| a.w == b.w && (a - b).length() <= 3e-6 * a.length();
        same && (place == other_place || self.light_in_object.zip(other.light_in_object).is_some_and(near))
    }
}

/// Where an object sees the light: a position (w = 1) or a unit vector (w = 0); `None` where the matrix flattens it.
fn light_in_object(world_from_object: &Mat4, toward_light: Vec4) -> Option<Vec4> {
    let m = world_from_object.as_dmat4();
    let size = m.x_axis.length() * m.y_axis.length() * m.z_axis.length();
    if m.determinant().abs() <= 1e-6 * size {
        return None;
    }
    let light = m.inverse() * toward_light.as_dvec4();
    let light = if toward_light.w == 0.0 { light.normalize() } else { light };
    Some(light.as_vec4().truncate().extend(toward_light.w))
}

/// The volume of one part of a caster under one light.
pub(super) struct Lists {
    pub(super) part: Arc<GpuPart>,
    /// Place of the caster in its job.
    pub(super) caster: usize,
    /// Bind group 1 of the draw.
    pub(super) placed: wgpu::BindGroup,
    /// None where degenerate quads find the silhouette.
    pub(super) listed: Option<Listed>,
    uniform: wgpu::Buffer,
    content: CasterUniform,
    key: Key,
}

/// What the compute pass writes.
pub(super) struct Listed {
    /// Twice the vertex number, plus 1 for the vertex thrown away.
    pub(super) indices: wgpu::Buffer,
    pub(super) draws: wgpu::Buffer,
    bind_group: wgpu::BindGroup,
    casts: wgpu::Buffer,
}

/// What has to be done before a volume can be drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stale {
    /// Nothing.
    No,
    /// Its uniform is another one.
    Uniform,
    /// Its lists hold something else.
    Lists,
}

impl Lists {
    /// Whether near caps in the order of their vertices, and turned ones, can be among them: of closed surfaces only one
    /// side casts.
    pub(super) fn has(&self, piece: Piece) -> bool {
        let flags = self.content.flags;
        let is_mirrored = flags & MIRRORED != 0;
        let has_solids = self.part.solid_count > 0;
        let is_turned = match piece {
            Piece::NearCaps => false,
            Piece::TurnedCaps if is_mirrored && has_solids => return true,
            Piece::TurnedCaps => true,
            Piece::SolidCaps => return has_solids && (!is_mirrored || flags & EVERY_TRIANGLE != 0),
            Piece::Sides | Piece::FarCaps => return true,
        };
        flags & EVERY_TRIANGLE != 0 || self.part.windings[usize::from(is_turned != is_mirrored)]
    }

    /// Are all near caps hidden from an eye by the surface that they lie on, where that is drawn from its front alone? Convex
    /// solids hide them from outside, and a sheet hides its own from before it.
    pub(super) fn hides_caps_from(&self, eye: DVec3) -> bool {
        if self.part.solid_count == self.part.triangle_count {
            return true;
        }
        let Some(sheet) = self.part.sheet else { return false };
        let world_from_object = self.content.world_from_object.as_dmat4();
        let [a, b, c] = sheet.map(|p| world_from_object.transform_point3(p.as_dvec3()));
        let front = if self.content.flags & MIRRORED != 0 { -1.0 } else { 1.0 };
        let height = front * (b - a).cross(c - a).normalize_or_zero().dot(eye - a);
        height > 1e-3 + 1e-5 * (eye.abs().max_element() + a.abs().max_element())
    }
}

/// What one list is made of.
#[derive(Clone, Copy)]
pub(super) struct Wanted<'a> {
    pub(super) light: &'a VolumeLight,
    pub(super) part: &'a Arc<GpuPart>,
    pub(super) caster: usize,
    pub(super) positions: &'a wgpu::Buffer,
    pub(super) positions_revision: u64,
    pub(super) world_from_object: Mat4,
    pub(super) bounds_in_world: &'a Aabb,
    pub(super) reach_w: f32,
}

/// Pipelines of the two steps.
pub(super) struct Extract {
    layout: wgpu::BindGroupLayout,
    placing: Layouts,
    turn_triangles: wgpu::ComputePipeline,
    raise_edges: wgpu::ComputePipeline,
}

impl Extract {
    pub(super) fn new(device: &wgpu::Device, placing: &Layouts) -> Extract {
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
        Extract { layout, placing: placing.clone(), turn_triangles, raise_edges }
    }

    /// Brings all stale volumes up to date: uniforms, then both steps.
    pub(super) fn run(&self, device: &wgpu::Device, encoder: &mut wgpu::CommandEncoder, stale: &[(&Lists, Stale)]) {
        if stale.is_empty() {
            return;
        }
        start_anew(device, encoder, stale);
        let listed: Vec<(&GpuPart, &Listed)> = stale
            .iter()
            .filter(|(_, stale)| *stale == Stale::Lists)
            .filter_map(|(lists, _)| Some((&*lists.part, lists.listed.as_ref()?)))
            .collect();
        if listed.is_empty() {
            return;
        }
        let mut pass =
            encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: Some("volume extraction"), timestamp_writes: None });
        for (pipeline, count) in
            [(&self.turn_triangles, (|p| p.triangle_count) as fn(&GpuPart) -> u32), (&self.raise_edges, |p| p.edge_count)]
        {
            pass.set_pipeline(pipeline);
            for (part, lists) in &listed {
                let groups = count(part).div_ceil(64);
                let rows = groups.div_ceil(65_535);
                pass.set_bind_group(0, &lists.bind_group, &[]);
                pass.dispatch_workgroups(groups.div_ceil(rows), rows, 1);
            }
        }
    }

    /// The volume for `wanted`, in the buffers of `old` where these fit, and what of it [`Extract::run`] must make anew.
    /// `None` where the device cannot hold it.
    pub(super) fn lists(&self, device: &wgpu::Device, wanted: &Wanted<'_>, old: Option<Lists>) -> Option<(Lists, Stale)> {
        let uniform = CasterUniform::new(wanted.light, wanted.world_from_object, wanted.bounds_in_world, wanted.part);
        let is_pointed = wanted.light.toward_light.w == 0.0 && wanted.reach_w == 0.0;
        let flags = uniform.flags | if is_pointed { POINTED } else { 0 };
        let content = CasterUniform { reach_w: wanted.reach_w, flags, ..uniform };
        let key = Key::new(wanted, content.flags);
        let is_listed = wanted.light.settings.silhouettes == Silhouettes::Compute || wanted.part.widest_edge > WIDEST_EDGE;
        let caster = wanted.caster;
        Some(match old.filter(|o| o.listed.is_some() == is_listed) {
            Some(old) if old.key.serves(&key) && old.content == content => (Lists { caster, ..old }, Stale::No),
            Some(old) if old.key.serves(&key) => (Lists { caster, content, ..old }, Stale::Uniform),
            Some(old) if old.key.positions == key.positions => (Lists { caster, content, key, ..old }, Stale::Lists),
            old => {
                let (uniform, listed) = match old {
                    Some(old) => (old.uniform, old.listed.map(|l| (l.casts, l.draws, l.indices))),
                    None => allocate(device, wanted.part, is_listed)?,
                };
                (self.bind(device, wanted, content, key, uniform, listed), Stale::Lists)
            }
        })
    }

    /// Binds buffers to what a volume is made of.
    fn bind(
        &self,
        device: &wgpu::Device,
        wanted: &Wanted<'_>,
        content: CasterUniform,
        key: Key,
        uniform: wgpu::Buffer,
        listed: Option<(wgpu::Buffer, wgpu::Buffer, wgpu::Buffer)>,
    ) -> Lists {
        let bind = |layout, buffers: &[&wgpu::Buffer]| {
            let entries: Vec<_> = (0u32..)
                .zip(buffers)
                .map(|(binding, b)| wgpu::BindGroupEntry { binding, resource: b.as_entire_binding() })
                .collect();
            device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some("volume caster"), layout, entries: &entries })
        };
        let part = wanted.part.clone();
        let mut buffers = vec![&uniform, wanted.positions, &part.triangles, &part.edges, &part.incidences];
        let (placed, listed) = match listed {
            Some((casts, draws, indices)) => {
                buffers.extend([&casts, &draws, &indices]);
                let bind_group = bind(&self.layout, &buffers);
                (bind(&self.placing.listed, &buffers[..2]), Some(Listed { indices, draws, bind_group, casts }))
            }
            None => {
                buffers.push(&part.edge_of);
                (bind(&self.placing.quads, &buffers), None)
            }
        };
        Lists { part, caster: wanted.caster, placed, listed, uniform, content, key }
    }
}

/// The uniform, and where wanted casts, draws and indices; `None` where the device cannot hold them.
#[allow(clippy::type_complexity, reason = "buffers on their way into Lists")]
fn allocate(
    device: &wgpu::Device,
    part: &GpuPart,
    is_listed: bool,
) -> Option<(wgpu::Buffer, Option<(wgpu::Buffer, wgpu::Buffer, wgpu::Buffer)>)> {
    use wgpu::BufferUsages as U;
    let buffer = |label, size, usage| {
        device.create_buffer(&wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false })
    };
    let capacity = Capacity::new(part);
    if is_listed && capacity.bytes() > largest_buffer(device) {
        return None;
    }
    let listed = is_listed.then(|| {
        let casts = buffer("volume casts", 4 * u64::from(part.triangle_count), U::STORAGE);
        let draws = buffer("volume draws", DRAWS_SIZE, U::STORAGE | U::INDIRECT | U::COPY_DST);
        (casts, draws, buffer("volume indices", capacity.bytes(), U::STORAGE | U::INDEX))
    });
    Some((buffer("volume caster", size_of::<CasterUniform>() as u64, U::UNIFORM | U::COPY_DST), listed))
}

/// Fills uniforms and empties lists: one upload for all, since many small writes cost more than the lists themselves.
fn start_anew(device: &wgpu::Device, encoder: &mut wgpu::CommandEncoder, stale: &[(&Lists, Stale)]) {
    let mut contents = Vec::new();
    let mut copies = Vec::new();
    for (lists, stale) in stale {
        copies.push((&lists.uniform, contents.len() as u64, size_of::<CasterUniform>() as u64));
        contents.extend_from_slice(bytemuck::bytes_of(&lists.content));
        if let (Some(listed), Stale::Lists) = (&lists.listed, stale) {
            copies.push((&listed.draws, contents.len() as u64, DRAWS_SIZE));
            contents.extend_from_slice(bytemuck::cast_slice(&Capacity::new(&lists.part).empty_draws()));
        }
    }
    let upload = device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
        label: Some("volume upload"),
        contents: &contents,
        usage: wgpu::BufferUsages::COPY_SRC,
    });
    for (buffer, at, size) in copies {
        encoder.copy_buffer_to_buffer(&upload, at, buffer, 0, size);
    }
}

/// Room for the longest lists that can be, in indices.
struct Capacity {
    sides: u32,
    caps: u32,
    solid_caps: u32,
}

impl Capacity {
    /// Every side of every triangle may stand alone, as two triangles; near and far caps are as many as triangles.
    fn new(part: &GpuPart) -> Capacity {
        let [triangles, solid] = [part.triangle_count, part.solid_count];
        Capacity {
            sides: triangles.saturating_mul(3 * 6),
            caps: triangles.saturating_mul(3),
            solid_caps: solid.saturating_mul(3),
        }
    }

    fn bytes(&self) -> u64 {
        4 * (u64::from(self.sides) + 2 * u64::from(self.caps) + u64::from(self.solid_caps))
    }

    /// Turned caps grow downwards from the end of the near caps.
    fn empty_draws(&self) -> [Draw; Piece::ALL.len()] {
        let end_of_caps = self.sides.saturating_add(self.caps);
        let first = [0, self.sides, end_of_caps, end_of_caps, end_of_caps.saturating_add(self.solid_caps)];
        first.map(|first_index| Draw { instance_count: 1, first_index, ..Draw::default() })
    }
}
