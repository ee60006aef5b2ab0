//! Instances, lights, maps and surroundings of the frame as bind groups.

use crate::buffer::GrowBuffer;
use crate::draws::Draws;
use crate::layouts::Layouts;
use crate::maps::Maps;
use crate::projection::ProjectionLists;
use crate::uniforms;
use glam::Vec3;
use umbriel_scene::{FogKind, Scene};
use wgpu::BufferUsages;

/// Buffers that all surface passes read.
pub(crate) struct Lighting {
    instances: GrowBuffer,
    frame: GrowBuffer,
    lights: GrowBuffer,
    faces: GrowBuffer,
    receive: GrowBuffer,
    projectors: GrowBuffer,
    shadow_textures: GrowBuffer,
    instances_group: Option<wgpu::BindGroup>,
    group: Option<wgpu::BindGroup>,
}

impl Lighting {
    pub(crate) fn new(device: &wgpu::Device) -> Lighting {
        let storage = |label| GrowBuffer::new(device, label, BufferUsages::STORAGE, 1 << 12);
        Lighting {
            instances: storage("instances"),
            frame: GrowBuffer::new(device, "surroundings", BufferUsages::UNIFORM, 256),
            lights: storage("lights"),
            faces: storage("map faces"),
            receive: storage("receive lists"),
            projectors: storage("projectors"),
            shadow_textures: storage("shadow textures"),
            instances_group: None,
            group: None,
        }
    }

    /// The texture of the maps is another one now.
    pub(crate) fn forget_maps(&mut self) {
        self.group = None;
    }

    #[allow(clippy::too_many_arguments, reason = "all that surfaces read")]
    pub(crate) fn upload(
        &mut self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        layouts: &Layouts,
        scene: &Scene,
        (light_count, lights): (usize, &[uniforms::Light]),
        maps: &Maps,
        draws: &mut Draws,
        lists: &ProjectionLists,
    ) {
        let (instances, unsent) = draws.send();
        if self.instances.write_parts(device, queue, instances, &unsent) {
            self.instances_group = None;
        }
        let frame = frame_of(scene, light_count, lists.receive_words);
        let mut grown = self.frame.write(device, queue, bytemuck::bytes_of(&frame));
        grown |= self.lights.write(device, queue, bytemuck::cast_slice(lights));
        grown |= self.faces.write(device, queue, bytemuck::cast_slice(&maps.uniforms()));
        grown |= self.receive.write(device, queue, bytemuck::cast_slice(&lists.receive));
        grown |= self.projectors.write(device, queue, bytemuck::cast_slice(&lists.projectors));
        grown |= self.shadow_textures.write(device, queue, bytemuck::cast_slice(&lists.shadow_textures));
        if grown {
            self.group = None;
        }
        self.instances_group.get_or_insert_with(|| {
            let entries = &[entry(0, self.instances.buffer.as_entire_binding())];
            let layout = &layouts.instances;
            device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some("instances"), layout, entries })
        });
        self.group.get_or_insert_with(|| {
            let entries = &[
                entry(0, self.frame.buffer.as_entire_binding()),
                entry(1, self.lights.buffer.as_entire_binding()),
                entry(2, self.faces.buffer.as_entire_binding()),
                entry(3, wgpu::BindingResource::TextureView(&maps.whole)),
                entry(4, wgpu::BindingResource::Sampler(&maps.sampler)),
                entry(5, self.receive.buffer.as_entire_binding()),
                entry(6, self.projectors.buffer.as_entire_binding()),
                entry(7, self.shadow_textures.buffer.as_entire_binding()),
            ];
            let layout = &layouts.lighting;
            device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some("lighting"), layout, entries })
        });
    }

    pub(crate) fn instances(&self) -> Option<&wgpu::BindGroup> {
        self.instances_group.as_ref()
    }

    pub(crate) fn group(&self) -> Option<&wgpu::BindGroup> {
        self.group.as_ref()
    }
}

fn entry(binding: u32, resource: wgpu::BindingResource<'_>) -> wgpu::BindGroupEntry<'_> {
    wgpu::BindGroupEntry { binding, resource }
}

fn frame_of(scene: &Scene, light_count: usize, receive_words: u32) -> uniforms::Frame {
    let fog = scene.fog.filter(|f| f.visibility_range > 0.0);
    let background = &scene.background;
    uniforms::Frame {
        ambient: scene.ambient.extend(0.0).to_array(),
        zenith: background.zenith.extend(1.0).to_array(),
        horizon: background.horizon.extend(1.0).to_array(),
        nadir: background.nadir.extend(1.0).to_array(),
        fog_color: fog.map_or(Vec3::ZERO, |f| f.color).to_array(),
        fog_range: fog.map_or(0.0, |f| f.visibility_range),
        fog_kind: u32::from(fog.is_some_and(|f| f.kind == FogKind::Exponential)),
        light_count: light_count as u32,
        receive_words,
        spare: 0,
        world_from_room: scene.world_from_room.to_cols_array_2d(),
    }
}
