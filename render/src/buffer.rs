//! Buffers that grow.

use std::ops::Range;

/// A buffer of a frame's numbers. It grows by doubling and never shrinks.
pub(crate) struct GrowBuffer {
    pub(crate) buffer: wgpu::Buffer,
    label: &'static str,
    /// What [`GrowBuffer::write`] sent.
    sent: Vec<u8>,
}

impl GrowBuffer {
    pub(crate) fn new(device: &wgpu::Device, label: &'static str, usage: wgpu::BufferUsages, bytes: u64) -> GrowBuffer {
        let usage = usage | wgpu::BufferUsages::COPY_DST;
        let descriptor = wgpu::BufferDescriptor { label: Some(label), size: bytes.max(256), usage, mapped_at_creation: false };
        GrowBuffer { buffer: device.create_buffer(&descriptor), label, sent: Vec::new() }
    }

    /// Makes room for `bytes`. True where the buffer is a new one, which bind groups must learn.
    pub(crate) fn reserve(&mut self, device: &wgpu::Device, bytes: u64) -> bool {
        if bytes <= self.buffer.size() {
            return false;
        }
        *self = GrowBuffer::new(device, self.label, self.buffer.usage(), bytes.next_power_of_two());
        true
    }

    /// Replaces the content, unless it is what was sent before. True where the buffer is a new one.
    pub(crate) fn write(&mut self, device: &wgpu::Device, queue: &wgpu::Queue, bytes: &[u8]) -> bool {
        let grown = self.reserve(device, bytes.len() as u64);
        if bytes != self.sent {
            queue.write_buffer(&self.buffer, 0, bytes);
            self.sent.clear();
            self.sent.extend_from_slice(bytes);
        }
        grown
    }

    /// Replaces stretches of the content, whose whole is `list`. True where the buffer is a new one.
    pub(crate) fn write_parts<T: bytemuck::Pod>(
        &mut self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        list: &[T],
        parts: &[Range<usize>],
    ) -> bool {
        let grown = self.reserve(device, size_of_val(list) as u64);
        let all = 0..list.len();
        let parts = if grown { std::slice::from_ref(&all) } else { parts };
        for part in parts {
            let part = part.start.min(list.len())..part.end.min(list.len());
            if !part.is_empty() {
                let offset = (part.start * size_of::<T>()) as u64;
                queue.write_buffer(&self.buffer, offset, bytemuck::cast_slice(&list[part]));
            }
        }
        grown
    }
}
