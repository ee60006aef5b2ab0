//! Many small uniforms in one buffer, each with its own bind group.

use crate::buffer::GrowBuffer;
use bytemuck::Pod;
use std::marker::PhantomData;

/// The greatest alignment that a device may ask for, bytes.
const ALIGNMENT: u64 = 256;

/// Uniforms of a frame. Numbers are good until [`Slots::clear`].
pub(crate) struct Slots<T> {
    buffer: GrowBuffer,
    groups: Vec<wgpu::BindGroup>,
    bytes: Vec<u8>,
    kind: PhantomData<T>,
}

impl<T: Pod> Slots<T> {
    /// Bytes from one uniform to the next.
    const STRIDE: u64 = (size_of::<T>() as u64).next_multiple_of(ALIGNMENT);

    pub(crate) fn new(device: &wgpu::Device, label: &'static str) -> Slots<T> {
        let buffer = GrowBuffer::new(device, label, wgpu::BufferUsages::UNIFORM, 16 * Self::STRIDE);
        Slots { buffer, groups: Vec::new(), bytes: Vec::new(), kind: PhantomData }
    }

    pub(crate) fn clear(&mut self) {
        self.bytes.clear();
    }

    pub(crate) fn push(&mut self, uniform: &T) -> usize {
        let slot = self.bytes.len() / Self::STRIDE as usize;
        self.bytes.extend_from_slice(bytemuck::bytes_of(uniform));
        self.bytes.resize((slot + 1) * Self::STRIDE as usize, 0);
        slot
    }

    /// Sends all of them to the GPU.
    pub(crate) fn upload(&mut self, device: &wgpu::Device, queue: &wgpu::Queue, layout: &wgpu::BindGroupLayout) {
        if self.buffer.write(device, queue, &self.bytes) {
            self.groups.clear();
        }
        let slots = self.bytes.len() as u64 / Self::STRIDE;
        for slot in self.groups.len() as u64..slots {
            let resource = wgpu::BindingResource::Buffer(self.binding(slot as usize));
            let entries = &[wgpu::BindGroupEntry { binding: 0, resource }];
            self.groups.push(device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries }));
        }
    }

    /// The uniform alone, for groups that hold more.
    pub(crate) fn binding(&self, slot: usize) -> wgpu::BufferBinding<'_> {
        wgpu::BufferBinding {
            buffer: &self.buffer.buffer,
            offset: slot as u64 * Self::STRIDE,
            size: wgpu::BufferSize::new(size_of::<T>() as u64),
        }
    }

    pub(crate) fn group(&self, slot: usize) -> &wgpu::BindGroup {
        &self.groups[slot]
    }
}
