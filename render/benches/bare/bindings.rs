//! What the shaders of the bare program read. Numbers stand in the order of the WGSL structs; the pictures of both programs
//! are compared before anything is timed, so a struct that has changed since is found.

use crate::program::MAP;
use glam::{Mat3, Mat4, Vec3, Vec4};
use std::ops::Range;
use std::sync::Arc;
use umbriel_render::Gpu;
use umbriel_scene::{Light, Material, Mesh, Scene, Shading, View};
use wgpu::util::{BufferInitDescriptor, DeviceExt};
use wgpu::{BindGroup, BindGroupLayout, BindingResource, BindingType, BufferUsages, Device, ShaderStages, TextureUsages};

/// Pictures of a material.
const MATERIAL_TEXTURES: usize = 5 + Material::MOST_LAYERS;
/// Floats of an instance.
pub(crate) const INSTANCE: usize = 32;

/// Layouts of the bind groups.
pub(crate) struct Layouts {
    pub(crate) view: BindGroupLayout,
    pub(crate) instances: BindGroupLayout,
    pub(crate) material: BindGroupLayout,
    pub(crate) lighting: BindGroupLayout,
    pub(crate) picture: BindGroupLayout,
}

impl Layouts {
    pub(crate) fn new(device: &Device) -> Layouts {
        let layout = |visibility: ShaderStages, types: &[BindingType]| {
            let entry =
                |(binding, ty): (u32, &BindingType)| wgpu::BindGroupLayoutEntry { binding, visibility, ty: *ty, count: None };
            let entries: Vec<_> = (0..).zip(types).map(entry).collect();
            device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: None, entries: &entries })
        };
        let buffer = |ty| BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None };
        let (uniform, storage) =
            (buffer(wgpu::BufferBindingType::Uniform), buffer(wgpu::BufferBindingType::Storage { read_only: true }));
        let texture = |sample_type, view_dimension| BindingType::Texture { sample_type, view_dimension, multisampled: false };
        let float = |filterable| texture(wgpu::TextureSampleType::Float { filterable }, wgpu::TextureViewDimension::D2);
        let look_up = BindingType::Sampler(wgpu::SamplerBindingType::Filtering);
        let maps = texture(wgpu::TextureSampleType::Depth, wgpu::TextureViewDimension::D2Array);
        let nearest = BindingType::Sampler(wgpu::SamplerBindingType::NonFiltering);
        let mut material = vec![uniform];
        (0..MATERIAL_TEXTURES).for_each(|_| material.extend([float(true), look_up]));
        Layouts {
            view: layout(ShaderStages::VERTEX_FRAGMENT, &[uniform]),
            instances: layout(ShaderStages::VERTEX, &[storage]),
            material: layout(ShaderStages::FRAGMENT, &material),
            lighting: layout(ShaderStages::FRAGMENT, &[uniform, storage, storage, maps, nearest, storage, storage, storage]),
            picture: layout(ShaderStages::FRAGMENT, &[float(false)]),
        }
    }
}

/// The map of a directional light whose box is set by hand.
pub(crate) struct LightMap {
    map_from_world: Mat4,
    towards_light: Vec3,
    size: u32,
    /// Of a texel, and of all depths, metres.
    texel: f32,
    depth: f32,
}

impl LightMap {
    /// None where the light has no map by hand.
    pub(crate) fn new(light: &Light) -> Option<LightMap> {
        let ([l, r, b, t], [near, far], size) = (light.map.frustum?, light.map.near_far?, light.map.size);
        let z = -light.direction;
        let x = Vec3::Y.cross(z).normalize();
        let light_from_world = Mat4::from_cols(x.extend(0.0), z.cross(x).extend(0.0), z.extend(0.0), Vec4::W).transpose();
        // Depth is 1 at the near distance and 0 at the far one.
        let map_from_light = Mat4::from_cols(
            Vec4::new(2.0 / (r - l), 0.0, 0.0, 0.0),
            Vec4::new(0.0, 2.0 / (t - b), 0.0, 0.0),
            Vec4::new(0.0, 0.0, 1.0 / (far - near), 0.0),
            Vec4::new(-(r + l) / (r - l), -(t + b) / (t - b), far / (far - near), 1.0),
        );
        let map_from_world = map_from_light * light_from_world * Mat4::from_translation(-light.position);
        let texel = (r - l).max(t - b) / size as f32;
        Some(LightMap { map_from_world, towards_light: z, size, texel, depth: far - near })
    }
}

/// Instances that differ in nothing but their place.
pub(crate) struct Batch {
    pub(crate) buffers: [wgpu::Buffer; 3],
    pub(crate) indices: wgpu::Buffer,
    pub(crate) index_count: u32,
    pub(crate) material: BindGroup,
    pub(crate) instances: Range<u32>,
}

/// Mesh and material, and where they stand.
type Look = (Arc<Mesh>, Arc<Material>, Vec<usize>);

/// All instances, in the order in which they are drawn.
pub(crate) struct Instances {
    pub(crate) group: BindGroup,
    pub(crate) buffer: wgpu::Buffer,
    /// Their numbers.
    pub(crate) visible: wgpu::Buffer,
    /// What the buffer holds.
    pub(crate) numbers: Vec<[f32; INSTANCE]>,
    /// Place of each drawable.
    pub(crate) places: Vec<usize>,
}

/// All instances, and the batches.
pub(crate) fn batches(gpu: &Gpu, layouts: &Layouts, scene: &Scene) -> (Instances, Vec<Batch>) {
    let device = &gpu.device;
    let mut looks: Vec<Look> = Vec::new();
    for (index, d) in scene.drawables.iter().enumerate() {
        let is_alike = |look: &&mut Look| Arc::ptr_eq(&look.0, &d.mesh) && Arc::ptr_eq(&look.1, &d.material);
        match looks.iter_mut().find(is_alike) {
            Some(look) => look.2.push(index),
            None => looks.push((d.mesh.clone(), d.material.clone(), vec![index])),
        }
    }
    let white = white(gpu);
    let sampler = device.create_sampler(&Default::default());
    let mut instances: Vec<[f32; INSTANCE]> = Vec::new();
    let mut places = vec![0; scene.drawables.len()];
    let mut batches = Vec::new();
    for (mesh, material, members) in looks {
        let first = instances.len() as u32;
        for index in members {
            places[index] = instances.len();
            instances.push(instance(&scene.drawables[index].world_from_object));
        }
        let frames: Vec<[f32; 7]> = mesh.normals.iter().map(|n| [n.x, n.y, n.z, 0.0, 0.0, 0.0, 0.0]).collect();
        let attributes = vec![[0.0f32, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0]; mesh.positions.len()];
        let uniform = init(device, &material_numbers(&material), BufferUsages::UNIFORM);
        let mut resources = vec![uniform.as_entire_binding()];
        for _ in 0..MATERIAL_TEXTURES {
            resources.extend([BindingResource::TextureView(&white), BindingResource::Sampler(&sampler)]);
        }
        batches.push(Batch {
            buffers: [
                init(device, bytemuck::cast_slice(&mesh.positions), BufferUsages::VERTEX),
                init(device, frames.as_flattened(), BufferUsages::VERTEX),
                init(device, attributes.as_flattened(), BufferUsages::VERTEX),
            ],
            indices: init_bytes(device, bytemuck::cast_slice(&mesh.indices), BufferUsages::INDEX),
            index_count: mesh.indices.len() as u32,
            material: group(device, &layouts.material, &resources),
            instances: first..instances.len() as u32,
        });
    }
    let numbers: Vec<u32> = (0..instances.len() as u32).collect();
    let visible = init_bytes(device, bytemuck::cast_slice(&numbers), BufferUsages::VERTEX);
    let buffer = init(device, instances.as_flattened(), BufferUsages::STORAGE | BufferUsages::COPY_DST);
    let group = group(device, &layouts.instances, &[buffer.as_entire_binding()]);
    (Instances { group, buffer, visible, numbers: instances, places }, batches)
}

fn white(gpu: &Gpu) -> wgpu::TextureView {
    let descriptor = wgpu::TextureDescriptor {
        label: None,
        size: wgpu::Extent3d { width: 1, height: 1, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::Rgba8Unorm,
        usage: TextureUsages::TEXTURE_BINDING,
        view_formats: &[],
    };
    let order = wgpu::util::TextureDataOrder::LayerMajor;
    gpu.device.create_texture_with_data(&gpu.queue, &descriptor, order, &[255; 4]).create_view(&Default::default())
}

/// What the shaders read of an instance.
pub(crate) fn instance(world_from_object: &Mat4) -> [f32; INSTANCE] {
    let linear = Mat3::from_mat4(*world_from_object);
    let [x, y, z] = [linear.x_axis, linear.y_axis, linear.z_axis];
    let mut numbers = [0.0; INSTANCE];
    numbers[..16].copy_from_slice(&world_from_object.to_cols_array());
    for (column, normal) in [y.cross(z), z.cross(x), x.cross(y)].iter().enumerate() {
        numbers[16 + 4 * column..][..3].copy_from_slice(&normal.to_array());
    }
    numbers[28] = f32::from_bits(1);
    numbers
}

fn material_numbers(material: &Material) -> Vec<f32> {
    let Shading::MetallicRoughness { metallic, roughness } = material.shading else { panic!("the grid is metallic-roughness") };
    let mut numbers = material.base_color.to_array().to_vec();
    numbers.extend([0.0; 8]);
    numbers.extend([metallic, roughness, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0]);
    // Textures, values for shaders of authors and layers, none of which it has.
    numbers.extend([0.0; 5 * 8 + 16 * 4 + 16 * Material::MOST_LAYERS]);
    numbers
}

/// What the shaders read of a view whose place in the sheet starts at `left`, with the numbers of its light.
pub(crate) fn view_numbers(view: &View, left: u32, light: &[f32]) -> Vec<f32> {
    let clip_from_world = view.frustum.clip_from_view() * view.view_from_world;
    let eye = view.view_from_world.inverse().w_axis;
    numbers_of([clip_from_world, view.view_from_world], eye, (left, view.size), light)
}

/// The light's map as a view.
pub(crate) fn map_view(device: &Device, layouts: &Layouts, map: &LightMap) -> BindGroup {
    let numbers = numbers_of([map.map_from_world; 2], map.towards_light.extend(0.0), (0, [map.size; 2]), &[0.0; 32]);
    view_group(device, layouts, &numbers).1
}

fn numbers_of(
    [clip_from_world, view_from_world]: [Mat4; 2],
    eye: Vec4,
    (left, size): (u32, [u32; 2]),
    light: &[f32],
) -> Vec<f32> {
    let mut numbers: Vec<f32> = Vec::new();
    for m in [clip_from_world, clip_from_world.inverse(), view_from_world] {
        numbers.extend(m.to_cols_array());
    }
    let [width, height] = size.map(|v| v as f32);
    numbers.extend(eye.to_array());
    numbers.extend([0.0, 0.0, width, height, left as f32, 0.0, width, height]);
    // One light from the first on, at exposure 1; none is shown alone.
    numbers.extend([f32::from_bits(0), f32::from_bits(1), 1.0, f32::from_bits(0)]);
    numbers.extend([-0.125, -0.375, 0.0, 0.0]);
    // That light, and no second one.
    numbers.extend(light);
    numbers.extend([0.0; 32]);
    numbers
}

/// Buffer and group of a view.
pub(crate) fn view_group(device: &Device, layouts: &Layouts, numbers: &[f32]) -> (wgpu::Buffer, BindGroup) {
    let buffer = init(device, numbers, BufferUsages::UNIFORM | BufferUsages::COPY_DST);
    let group = group(device, &layouts.view, &[buffer.as_entire_binding()]);
    (buffer, group)
}

/// Two layers, of which the first is the map.
pub(crate) fn maps_texture(device: &Device, map: Option<&LightMap>) -> wgpu::Texture {
    let side = map.map_or(1, |m| m.size);
    device.create_texture(&wgpu::TextureDescriptor {
        label: None,
        size: wgpu::Extent3d { width: side, height: side, depth_or_array_layers: 2 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: MAP,
        usage: TextureUsages::TEXTURE_BINDING | TextureUsages::RENDER_ATTACHMENT,
        view_formats: &[],
    })
}

/// One layer, to be drawn in.
pub(crate) fn layer(texture: &wgpu::Texture, base_array_layer: u32) -> wgpu::TextureView {
    texture.create_view(&wgpu::TextureViewDescriptor {
        dimension: Some(wgpu::TextureViewDimension::D2),
        base_array_layer,
        array_layer_count: Some(1),
        ..Default::default()
    })
}

/// Surroundings, the one light and its map.
pub(crate) fn lighting(
    device: &Device,
    layouts: &Layouts,
    scene: &Scene,
    map: Option<&LightMap>,
    maps: &wgpu::Texture,
) -> BindGroup {
    let mut frame = vec![scene.ambient.x, scene.ambient.y, scene.ambient.z, 0.0];
    (0..3).for_each(|_| frame.extend([0.0, 0.0, 0.0, 1.0]));
    // No fog, one light.
    frame.extend([0.0, 0.0, 0.0, 0.0, 0.0, f32::from_bits(1), 0.0, 0.0]);
    frame.extend(Mat4::IDENTITY.to_cols_array());
    let light = light_numbers(&scene.lights[0], map);
    let mut faces = vec![0.0f32; 48];
    if let Some(map) = map {
        faces = [map.map_from_world.to_cols_array(), map.map_from_world.inverse().to_cols_array()].concat();
        faces.extend([0.0, 0.0, f32::from_bits(map.size), 0.0]);
        faces.extend(map.towards_light.extend(0.0).to_array());
        faces.extend([map.texel, 0.0, map.depth, 0.0]);
    }
    let dimension = Some(wgpu::TextureViewDimension::D2Array);
    let maps = maps.create_view(&wgpu::TextureViewDescriptor { dimension, ..Default::default() });
    let frame = init(device, &frame, BufferUsages::UNIFORM);
    let [lights, faces, nothing] = [light, faces, vec![0.0; 64]].map(|list| init(device, &list, BufferUsages::STORAGE));
    let sampler = device.create_sampler(&Default::default());
    let resources = [
        frame.as_entire_binding(),
        lights.as_entire_binding(),
        faces.as_entire_binding(),
        BindingResource::TextureView(&maps),
        BindingResource::Sampler(&sampler),
        nothing.as_entire_binding(),
        nothing.as_entire_binding(),
        nothing.as_entire_binding(),
    ];
    group(device, &layouts.lighting, &resources)
}

/// A directional light as the shaders read it.
pub(crate) fn light_numbers(light: &Light, map: Option<&LightMap>) -> Vec<f32> {
    let Light { direction: d, color, intensity, .. } = light;
    let c = *color * *intensity;
    let count = f32::from_bits(u32::from(map.is_some()));
    let mut numbers = vec![0.0, 0.0, 0.0, 0.0, d.x, d.y, d.z, f32::MAX, c.x, c.y, c.z, 1.0];
    numbers.extend([0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 1.0, 0.5]);
    // Faces, four texels of filter, bias that tunes itself, flags and size.
    numbers.extend([0.0, count, 4.0, -1.0, -1.0, 0.0, Light::SUN_SIZE, count]);
    numbers
}

pub(crate) fn group(device: &Device, layout: &BindGroupLayout, resources: &[BindingResource<'_>]) -> BindGroup {
    let entries: Vec<_> =
        (0..).zip(resources).map(|(binding, r)| wgpu::BindGroupEntry { binding, resource: r.clone() }).collect();
    device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries: &entries })
}

fn init(device: &Device, numbers: &[f32], usage: BufferUsages) -> wgpu::Buffer {
    init_bytes(device, bytemuck::cast_slice(numbers), usage)
}

fn init_bytes(device: &Device, contents: &[u8], usage: BufferUsages) -> wgpu::Buffer {
    device.create_buffer_init(&BufferInitDescriptor { label: None, contents, usage })
}
