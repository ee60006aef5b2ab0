//! Vertices on the GPU.

use crate::deform::{Sources, make_sources};
use std::sync::OnceLock;
use umbriel_scene::{Edges, Mesh, Topology};
use wgpu::util::{BufferInitDescriptor, DeviceExt};
use wgpu::{BufferUsages, VertexAttribute, VertexBufferLayout, VertexFormat, VertexStepMode};

/// Buffers of one mesh. Positions and frames may be replaced by deformed ones.
pub(crate) struct GpuMesh {
    /// x y z per vertex; storage, so that shadow volumes and deformation read the same numbers.
    pub(crate) positions: wgpu::Buffer,
    /// Normal and tangent per vertex: seven numbers.
    pub(crate) frames: wgpu::Buffer,
    /// Both texture coordinates and the colour per vertex: eight numbers; storage for what looks up the alpha where a ray passes.
    pub(crate) attributes: wgpu::Buffer,
    pub(crate) indices: wgpu::Buffer,
    pub(crate) index_count: u32,
    pub(crate) vertex_count: u32,
    pub(crate) topology: Topology,
    /// Of the vertex colours.
    pub(crate) least_alpha: f32,
    /// Skin and morph targets, where it has any.
    pub(crate) sources: Option<Sources>,
    is_closed: OnceLock<bool>,
}

impl GpuMesh {
    /// See [`Edges::closed`]. `mesh` is the one that it was made of.
    pub(crate) fn is_closed(&self, mesh: &Mesh) -> bool {
        *self.is_closed.get_or_init(|| Edges::of_mesh(mesh).closed)
    }
}

/// Layout of the vertex buffers: positions, frames, attributes, and the instances that a view sees.
pub(crate) const VERTEX_BUFFERS: [Option<VertexBufferLayout<'static>>; 4] = [
    layout(12, VertexStepMode::Vertex, &[attribute(0, 0, VertexFormat::Float32x3)]),
    layout(28, VertexStepMode::Vertex, &[attribute(1, 0, VertexFormat::Float32x3), attribute(2, 12, VertexFormat::Float32x4)]),
    layout(
        32,
        VertexStepMode::Vertex,
        &[
            attribute(3, 0, VertexFormat::Float32x2),
            attribute(4, 8, VertexFormat::Float32x2),
            attribute(5, 16, VertexFormat::Float32x4),
        ],
    ),
    layout(4, VertexStepMode::Instance, &[attribute(6, 0, VertexFormat::Uint32)]),
];

/// Of the same buffers what places triangles: the others need not be bound.
pub(crate) const POSITION_BUFFERS: [Option<VertexBufferLayout<'static>>; 4] = {
    let [positions, _, _, instances] = VERTEX_BUFFERS;
    [positions, None, None, instances]
};

const fn layout(
    stride: u64,
    step_mode: VertexStepMode,
    attributes: &'static [VertexAttribute],
) -> Option<VertexBufferLayout<'static>> {
    Some(VertexBufferLayout { array_stride: stride, step_mode, attributes })
}

const fn attribute(shader_location: u32, offset: u64, format: VertexFormat) -> VertexAttribute {
    VertexAttribute { format, offset, shader_location }
}

/// Sends a mesh to the GPU. A mesh that cannot be drawn gives a message: it is empty, or it is
/// not what [`Mesh::checked`] accepts.
pub(crate) fn make_mesh(device: &wgpu::Device, mesh: &Mesh) -> Result<GpuMesh, String> {
    let count = mesh.positions.len();
    if mesh.indices.is_empty() || count == 0 {
        return Err(format!("mesh '{}' has nothing to draw: {count} vertices, {} indices", mesh.name, mesh.indices.len()));
    }
    // Cheap next to the upload: a wrong index must never reach the GPU, and triangles need normals.
    let mesh = &mesh.clone().checked().map_err(|e| e.to_string())?;
    let mut frames = Vec::with_capacity(count * 7);
    let mut attributes = Vec::with_capacity(count * 8);
    for i in 0..count {
        let normal = mesh.normals.get(i).copied().unwrap_or_default();
        let tangent = mesh.tangents.get(i).copied().unwrap_or_default();
        frames.extend(normal.to_array());
        frames.extend(tangent.to_array());
        attributes.extend(mesh.uv0.get(i).copied().unwrap_or_default().to_array());
        attributes.extend(mesh.uv1.get(i).copied().unwrap_or_default().to_array());
        attributes.extend(mesh.colors.get(i).map_or([1.0; 4], |c| c.to_array()));
    }
    let bound = |label: &str, contents: &[u8], usage: BufferUsages| {
        device.create_buffer_init(&BufferInitDescriptor { label: Some(label), contents, usage })
    };
    let shared = BufferUsages::VERTEX | BufferUsages::STORAGE;
    Ok(GpuMesh {
        positions: bound("positions", bytemuck::cast_slice(&mesh.positions), shared),
        frames: bound("frames", bytemuck::cast_slice(&frames), shared),
        attributes: bound("attributes", bytemuck::cast_slice(&attributes), shared),
        indices: bound("indices", bytemuck::cast_slice(&mesh.indices), BufferUsages::INDEX | BufferUsages::STORAGE),
        index_count: mesh.indices.len() as u32,
        vertex_count: count as u32,
        topology: mesh.topology,
        least_alpha: mesh.colors.iter().map(|c| c.w).fold(1.0, f32::min),
        sources: make_sources(device, mesh),
        is_closed: OnceLock::new(),
    })
}
