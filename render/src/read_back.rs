//! Pictures brought back from the GPU.

use crate::Error;

/// A picture in memory: rows from the top, no padding.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RgbaPixels {
    /// Across.
    pub width: u32,
    /// Down.
    pub height: u32,
    /// Four bytes per pixel; sRGB encoded, but for visibility pictures.
    pub rgba: Vec<u8>,
}

impl RgbaPixels {
    /// The four bytes of a pixel; zeros outside.
    pub fn pixel(&self, x: u32, y: u32) -> [u8; 4] {
        let at = 4 * (y as usize * self.width as usize + x as usize);
        let inside = x < self.width && y < self.height;
        self.rgba.get(at..at + 4).filter(|_| inside).map_or([0; 4], |p| [p[0], p[1], p[2], p[3]])
    }
}

/// A grey picture in memory: rows from the top, one byte per pixel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GreyPixels {
    /// Across.
    pub width: u32,
    /// Down.
    pub height: u32,
    /// One byte per pixel.
    pub grey: Vec<u8>,
}

/// Bytes of one layer of a texture of four bytes per texel.
pub(crate) fn layer(device: &wgpu::Device, queue: &wgpu::Queue, texture: &wgpu::Texture, layer: u32) -> Result<Vec<u8>, Error> {
    let size = texture.size();
    let row = 4 * size.width;
    let padded = row.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
    let buffer = device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("read back"),
        size: u64::from(padded) * u64::from(size.height),
        usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
        mapped_at_creation: false,
    });
    let is_depth = texture.format().has_depth_aspect();
    let aspect = if is_depth { wgpu::TextureAspect::DepthOnly } else { wgpu::TextureAspect::All };
    let from = wgpu::TexelCopyTextureInfo { texture, mip_level: 0, origin: wgpu::Origin3d { x: 0, y: 0, z: layer }, aspect };
    let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(padded), rows_per_image: Some(size.height) };
    let to = wgpu::TexelCopyBufferInfo { buffer: &buffer, layout };
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("read back") });
    encoder.copy_texture_to_buffer(from, to, wgpu::Extent3d { depth_or_array_layers: 1, ..size });
    queue.submit([encoder.finish()]);
    buffer.map_async(wgpu::MapMode::Read, .., |_| {});
    device.poll(wgpu::PollType::wait_indefinitely()).map_err(|e| Error::Device(e.to_string()))?;
    let bytes = buffer.get_mapped_range(..).map_err(|e| Error::Device(e.to_string()))?;
    Ok(bytes.chunks_exact(padded as usize).flat_map(|r| &r[..row as usize]).copied().collect())
}
