//! Pictures on the GPU, with smaller copies made here.

use super::coverage::Alphas;
use umbriel_scene::{Filter, Image, Sampler, Wrap};

/// Sends a picture to the GPU; `srgb` says what its bytes mean. Where it cuts holes, smaller copies have as much of it above `cutoff` as
/// the picture itself. Wrong sizes give a message.
pub(crate) fn make_texture(
    device: &wgpu::Device,
    queue: &wgpu::Queue,
    image: &Image,
    srgb: bool,
    cutoff: Option<f32>,
) -> Result<wgpu::TextureView, String> {
    let (width, height) = (image.width, image.height);
    let limit = device.limits().max_texture_dimension_2d;
    if image.rgba.len() as u64 != 4 * u64::from(width) * u64::from(height) {
        return Err(format!("picture of {width} x {height} has {} bytes", image.rgba.len()));
    }
    if width == 0 || height == 0 || width > limit || height > limit {
        return Err(format!("picture of {width} x {height}: the device takes 1 to {limit} each way"));
    }
    let levels = 32 - width.max(height).leading_zeros();
    let texture = device.create_texture(&wgpu::TextureDescriptor {
        label: Some("picture"),
        size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: levels,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: if srgb { wgpu::TextureFormat::Rgba8UnormSrgb } else { wgpu::TextureFormat::Rgba8Unorm },
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    });
    write_level(queue, &texture, 0, width, height, &image.rgba);
    let mut level = Level { width, height, texels: image.rgba.chunks_exact(4).map(|p| decode(p, srgb)).collect() };
    let covered =
        cutoff.map(|cutoff| (cutoff, level.alphas().coverage(cutoff))).filter(|(_, share)| *share > 0.0 && *share < 1.0);
    for mip in 1..levels {
        level = level.halved();
        let scale = covered.map_or(1.0, |(cutoff, share)| level.alphas().scale(cutoff, share));
        let bytes: Vec<u8> = level.texels.iter().flat_map(|p| encode(*p, srgb, scale)).collect();
        write_level(queue, &texture, mip, level.width, level.height, &bytes);
    }
    Ok(texture.create_view(&wgpu::TextureViewDescriptor::default()))
}

/// Linear colour, premultiplied by alpha where it is a colour, so that what is not there does not bleed. Where nothing is there at all, the
/// colours under it are kept: filters mix them with what is there beside them.
struct Level {
    width: u32,
    height: u32,
    texels: Vec<[f32; 4]>,
}

impl Level {
    fn alphas(&self) -> Alphas {
        Alphas { width: self.width, height: self.height, texels: self.texels.iter().map(|p| p[3]).collect() }
    }

    fn halved(&self) -> Level {
        let (width, height) = ((self.width / 2).max(1), (self.height / 2).max(1));
        let mut texels = Vec::with_capacity((width * height) as usize);
        for y in 0..height {
            for x in 0..width {
                let mut sum = [0.0; 4];
                for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                    let sx = (2 * x + dx).min(self.width - 1);
                    let sy = (2 * y + dy).min(self.height - 1);
                    let texel = self.texels[(sy * self.width + sx) as usize];
                    (0..4).for_each(|c| sum[c] += 0.25 * texel[c]);
                }
                texels.push(sum);
            }
        }
        Level { width, height, texels }
    }
}

fn decode(p: &[u8], srgb: bool) -> [f32; 4] {
    let [r, g, b, a] = [p[0], p[1], p[2], p[3]].map(|v| f32::from(v) / 255.0);
    if !srgb {
        return [r, g, b, a];
    }
    let [r, g, b] = [r, g, b].map(|v| if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) });
    let a = a.max(LEAST_ALPHA);
    [r * a, g * a, b * a, a]
}

/// Too little to be seen beside anything that is there.
const LEAST_ALPHA: f32 = 1e-5;

/// The bytes of a texel, its alpha times `scale`.
fn encode([r, g, b, a]: [f32; 4], srgb: bool, scale: f32) -> [u8; 4] {
    let byte = |v: f32| (v.clamp(0.0, 1.0) * 255.0 + 0.5) as u8;
    if !srgb {
        return [r, g, b, a * scale].map(byte);
    }
    let curve = |v: f32| if v <= 0.0031308 { v * 12.92 } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 };
    let [r, g, b] = [r, g, b].map(|v| byte(curve(v / a)));
    [r, g, b, byte(a * scale)]
}

fn write_level(queue: &wgpu::Queue, texture: &wgpu::Texture, mip_level: u32, width: u32, height: u32, bytes: &[u8]) {
    let place = wgpu::TexelCopyTextureInfo { texture, mip_level, origin: wgpu::Origin3d::ZERO, aspect: wgpu::TextureAspect::All };
    let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(4 * width), rows_per_image: Some(height) };
    queue.write_texture(place, bytes, layout, wgpu::Extent3d { width, height, depth_or_array_layers: 1 });
}

/// Filter and wrap modes of a look-up.
pub(crate) fn make_sampler(device: &wgpu::Device, sampler: Sampler) -> wgpu::Sampler {
    let address = |wrap| match wrap {
        Wrap::Repeat => wgpu::AddressMode::Repeat,
        Wrap::Mirror => wgpu::AddressMode::MirrorRepeat,
        Wrap::Clamp => wgpu::AddressMode::ClampToEdge,
    };
    let is_linear = sampler.filter == Filter::Linear;
    let filter = if is_linear { wgpu::FilterMode::Linear } else { wgpu::FilterMode::Nearest };
    device.create_sampler(&wgpu::SamplerDescriptor {
        label: Some("picture"),
        address_mode_u: address(sampler.wrap_u),
        address_mode_v: address(sampler.wrap_v),
        mag_filter: filter,
        min_filter: filter,
        mipmap_filter: if is_linear { wgpu::MipmapFilterMode::Linear } else { wgpu::MipmapFilterMode::Nearest },
        lod_max_clamp: if sampler.mip_maps { 32.0 } else { 0.0 },
        anisotropy_clamp: if is_linear && sampler.mip_maps && has_sound_anisotropy(device) { 8 } else { 1 },
        ..Default::default()
    })
}

/// Mesa's software driver gives black where the texture coordinates of a triangle are all the same and anisotropy is on.
fn has_sound_anisotropy(device: &wgpu::Device) -> bool {
    device.adapter_info().device_type != wgpu::DeviceType::Cpu
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn smaller_copies_average_light_not_bytes() {
        let level =
            |bytes: &[u8], srgb| Level { width: 2, height: 1, texels: bytes.chunks(4).map(|p| decode(p, srgb)).collect() };
        let white_and_black = [255, 255, 255, 255, 0, 0, 0, 255];
        assert_eq!(encode(level(&white_and_black, true).halved().texels[0], true, 1.0), [188, 188, 188, 255]);
        assert_eq!(encode(level(&white_and_black, false).halved().texels[0], false, 1.0), [128, 128, 128, 255]);
        let red_and_nothing = [255, 0, 0, 255, 0, 255, 0, 0];
        assert_eq!(encode(level(&red_and_nothing, true).halved().texels[0], true, 1.0), [255, 0, 0, 128]);
        let green_and_nothing = [0, 255, 0, 0, 0, 255, 0, 0];
        assert_eq!(encode(level(&green_and_nothing, true).halved().texels[0], true, 1.0), [0, 255, 0, 0]);
    }
}
