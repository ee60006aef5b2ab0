//! Materials on the GPU: a uniform and the pictures that it names.

use super::texture::{make_sampler, make_texture};
use crate::draws::Needs;
use crate::uniforms;
use std::collections::HashMap;
use std::sync::Arc;
use umbriel_scene::{AlphaMode, Coordinates, Image, Layer, LayerMode, LayerSource, Material, Sampler, Shading, TextureRef};
use wgpu::util::{BufferInitDescriptor, DeviceExt};

/// A material ready to be drawn with.
pub(crate) struct GpuMaterial {
    pub(crate) group: wgpu::BindGroup,
    pub(crate) alpha: AlphaMode,
    /// The least that the material's own alpha comes to anywhere.
    pub(crate) least_alpha: f32,
    pub(crate) double_sided: bool,
    /// Number of the shader that it is drawn with; see [`crate::author`].
    pub(crate) shader: u32,
    /// Number of the one that it names, which may be wrong.
    pub(crate) named_shader: u32,
    pub(crate) needs: Needs,
    /// Keeps the pictures, which other materials may share.
    _pictures: Vec<Arc<Picture>>,
}

struct Picture {
    view: wgpu::TextureView,
    /// Keeps the address that the picture is found by.
    _image: Option<Arc<Image>>,
}

/// Makes materials, sharing pictures and samplers among them.
pub(crate) struct MaterialCache {
    /// By address, by what their bytes mean, and by the alpha that they are cut off at.
    pictures: HashMap<(usize, bool, Option<u32>), std::sync::Weak<Picture>>,
    samplers: HashMap<Sampler, wgpu::Sampler>,
    white: Arc<Picture>,
}

impl MaterialCache {
    pub(crate) fn new(device: &wgpu::Device, queue: &wgpu::Queue) -> Result<MaterialCache, String> {
        let image = Image { width: 1, height: 1, rgba: Arc::new([255; 4]) };
        let white = Arc::new(Picture { view: make_texture(device, queue, &image, false, None)?, _image: None });
        Ok(MaterialCache { pictures: HashMap::new(), samplers: HashMap::new(), white })
    }

    /// Sends a material to the GPU, with the numbers of the shaders that it is drawn with and that it names. What is wrong with its pictures goes to `report`, and they stay white.
    pub(crate) fn make(
        &mut self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        layout: &wgpu::BindGroupLayout,
        material: &Material,
        [shader, named_shader]: [u32; 2],
        mut report: impl FnMut(String),
    ) -> GpuMaterial {
        let slots = [
            (&material.base_color_texture, true),
            (&material.metallic_roughness_texture, false),
            (&material.normal_texture, false),
            (&material.occlusion_texture, false),
            (&material.emissive_texture, true),
        ];
        let slots = slots.map(|(texture, srgb)| (texture.as_ref(), srgb));
        let layers: [_; Material::MOST_LAYERS] = std::array::from_fn(|i| (material.layers.get(i).and_then(picture_of), true));
        let mut uniform = uniform_of(material);
        let mut bound = Vec::new();
        for (i, (texture, srgb)) in slots.into_iter().chain(layers).enumerate() {
            let sampler = texture.map(|t| t.sampler).unwrap_or_default();
            let sampler = self.samplers.entry(sampler).or_insert_with(|| make_sampler(device, sampler)).clone();
            let cutoff = if i == 0 { cutoff_of(material) } else { None };
            let picture = texture.and_then(|t| match self.picture(device, queue, &t.image, srgb, cutoff) {
                Ok(picture) => Some((picture, slot_of(t))),
                Err(message) => {
                    report(format!("material '{}': {message}", material.name));
                    None
                }
            });
            let (picture, slot) = picture.unwrap_or_else(|| (self.white.clone(), bytemuck::Zeroable::zeroed()));
            if let Some(texture) = uniform.textures.get_mut(i) {
                *texture = slot;
            }
            bound.push((picture, sampler));
        }
        let is_there = |slot: &usize| uniform.textures[*slot].present != 0;
        let needs = Needs {
            textures: (0..uniform.textures.len()).filter(is_there).fold(0, |bits, slot| bits | 1 << slot),
            layers: uniform.layer_count as u8,
            shading: uniform.shading as u8,
        };
        let contents = bytemuck::bytes_of(&uniform);
        let usage = wgpu::BufferUsages::UNIFORM;
        let buffer = device.create_buffer_init(&BufferInitDescriptor { label: Some("material"), contents, usage });
        let mut entries = vec![wgpu::BindGroupEntry { binding: 0, resource: buffer.as_entire_binding() }];
        for (i, (picture, sampler)) in (0u32..).zip(&bound) {
            let (texture, look_up) = (wgpu::BindingResource::TextureView(&picture.view), wgpu::BindingResource::Sampler(sampler));
            entries.push(wgpu::BindGroupEntry { binding: 1 + 2 * i, resource: texture });
            entries.push(wgpu::BindGroupEntry { binding: 2 + 2 * i, resource: look_up });
        }
        let group = device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some("material"), layout, entries: &entries });
        GpuMaterial {
            group,
            alpha: material.alpha,
            least_alpha: least_alpha(material),
            double_sided: material.double_sided,
            shader,
            named_shader,
            needs,
            _pictures: bound.into_iter().map(|b| b.0).collect(),
        }
    }

    /// Forgets pictures that no material holds.
    pub(crate) fn drop_unused(&mut self) {
        self.pictures.retain(|_, picture| picture.strong_count() > 0);
    }

    fn picture(
        &mut self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        image: &Arc<Image>,
        srgb: bool,
        cutoff: Option<f32>,
    ) -> Result<Arc<Picture>, String> {
        let key = (Arc::as_ptr(image) as usize, srgb, cutoff.map(f32::to_bits));
        if let Some(picture) = self.pictures.get(&key).and_then(|p| p.upgrade()) {
            return Ok(picture);
        }
        let view = make_texture(device, queue, image, srgb, cutoff)?;
        let picture = Arc::new(Picture { view, _image: Some(image.clone()) });
        self.pictures.insert(key, Arc::downgrade(&picture));
        Ok(picture)
    }
}

/// Where the base colour's picture has less alpha, the material is not there; none where that is nowhere or everywhere.
fn cutoff_of(material: &Material) -> Option<f32> {
    let AlphaMode::Mask { cutoff } = material.alpha else { return None };
    Some(cutoff / material.base_color.w).filter(|cutoff| *cutoff > 0.0 && *cutoff <= 1.0)
}

/// Only looked for where it cuts holes. Layers may do anything to it.
fn least_alpha(material: &Material) -> f32 {
    if !matches!(material.alpha, AlphaMode::Mask { .. }) {
        return 1.0;
    }
    if !material.layers.is_empty() {
        return 0.0;
    }
    let texels = material.base_color_texture.iter().flat_map(|t| t.image.rgba.chunks_exact(4));
    material.base_color.w * f32::from(texels.map(|texel| texel[3]).min().unwrap_or(u8::MAX)) / 255.0
}

fn slot_of(texture: &TextureRef) -> uniforms::Texture {
    let m = texture.uv_from_mesh;
    uniforms::Texture {
        linear: [m.matrix2.x_axis.x, m.matrix2.x_axis.y, m.matrix2.y_axis.x, m.matrix2.y_axis.y],
        offset: m.translation.to_array(),
        uv_set: u32::from(texture.uv_set),
        present: 1,
    }
}

fn picture_of(layer: &Layer) -> Option<&TextureRef> {
    match &layer.source {
        LayerSource::Picture { texture, .. } => Some(texture),
        LayerSource::ShadowMap { .. } => None,
    }
}

fn layer_of(layer: &Layer) -> uniforms::Layer {
    let projector = match layer.coordinates {
        Coordinates::Mesh => uniforms::NOWHERE,
        Coordinates::Projected(number) => number as u32,
    };
    let (kind, place, shadow_texture, flags) = match &layer.source {
        LayerSource::Picture { texture, border: [u, v] } => (1, slot_of(texture), 0, u32::from(*u) | u32::from(*v) << 1),
        LayerSource::ShadowMap { texture, compare } => (2, IDENTITY, *texture as u32, (*compare as u32) << 2),
    };
    uniforms::Layer {
        linear: place.linear,
        offset: place.offset,
        uv_set: place.uv_set,
        kind,
        mode: LayerMode::ALL.iter().position(|m| *m == layer.mode).unwrap_or(0) as u32,
        projector,
        shadow_texture,
        flags,
        factor: layer.factor.to_array(),
    }
}

/// The mesh's own coordinates.
const IDENTITY: uniforms::Texture = uniforms::Texture { linear: [1.0, 0.0, 0.0, 1.0], offset: [0.0; 2], uv_set: 0, present: 1 };

fn uniform_of(material: &Material) -> uniforms::Material {
    let mut uniform: uniforms::Material = bytemuck::Zeroable::zeroed();
    uniform.base_color = material.base_color.to_array();
    uniform.emissive = material.emissive.to_array();
    uniform.normal_scale = material.normal_scale;
    uniform.occlusion_strength = material.occlusion_strength;
    uniform.ambient = 1.0;
    uniform.params = material.shader.as_ref().map_or_else(bytemuck::Zeroable::zeroed, crate::author::values_of);
    uniform.layer_count = material.layers.len().min(Material::MOST_LAYERS) as u32;
    for (place, layer) in uniform.layers.iter_mut().zip(&material.layers) {
        *place = layer_of(layer);
    }
    match material.shading {
        Shading::MetallicRoughness { metallic, roughness } => {
            (uniform.metallic, uniform.roughness, uniform.shading) = (metallic, roughness, 0);
        }
        Shading::Phong { specular, exponent, ambient_intensity } => {
            uniform.specular = specular.to_array();
            (uniform.exponent, uniform.ambient, uniform.shading) = (exponent.max(0.0), ambient_intensity, 1);
        }
        Shading::Unlit => uniform.shading = 2,
    }
    match material.alpha {
        AlphaMode::Opaque => {}
        AlphaMode::Mask { cutoff } => (uniform.alpha_mode, uniform.alpha_cutoff) = (1, cutoff),
        AlphaMode::Blend => uniform.alpha_mode = 2,
    }
    uniform
}
