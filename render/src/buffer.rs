//! Buffers that grow.

/// A buffer whose content is replaced every frame. It grows by doubling and never shrinks.
pub(crate) struct GrowBuffer {
    pub(crate) buffer: wgpu::Buffer,
    label: &'static str,
}

impl GrowBuffer {
    pub(crate) fn new(device: &wgpu::Device, label: &'static str, usage: wgpu::BufferUsages, bytes: u64) -> GrowBuffer {
        let usage = usage | wgpu::BufferUsages::COPY_DST;
        let descriptor = wgpu::BufferDescriptor { label: Some(label), size: bytes.max(256), usage, mapped_at_creation: false };
        GrowBuffer { buffer: device.create_buffer(&descriptor), label }
    }

    /// Makes room for `bytes`. True where the buffer is a new one, which bind groups must learn.
    pub(crate) fn reserve(&mut self, device: &wgpu::Device, bytes: u64) -> bool {
        if bytes <= self.buffer.size() {
            return false;
        }
        *self = GrowBuffer::new(device, self.label, self.buffer.usage(), bytes.next_power_of_two());
        true
    }

    /// Replaces the content. True where the buffer is a new one.
    pub(crate) fn write(&mut self, device: &wgpu::Device, queue: &wgpu::Queue, bytes: &[u8]) -> bool {
        let grown = self.reserve(device, bytes.len() as u64);
        if !bytes.is_empty() {
            queue.write_buffer(&self.buffer, 0, bytes);
        }
        grown
    }
}
