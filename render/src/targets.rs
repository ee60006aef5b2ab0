//! Textures that pictures are made in.

use crate::gpu::{DEPTH_FORMAT, LINEAR_FORMAT};
use crate::soft::SoftTarget;
use std::collections::HashMap;
use umbriel_scene::{Layout, Picture, Samples};

/// Finished pictures: 8 bit, as they are shown or saved.
pub(crate) const PICTURE_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;
/// The same bytes seen as sRGB.
pub(crate) const PICTURE_FORMAT_SRGB: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8UnormSrgb;

/// What the views of a frame are drawn in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(crate) enum Canvas {
    /// Linear light, which is composed into pictures afterwards.
    #[default]
    Linear,
    /// The picture itself, which holds light as it is shown and adds nothing up.
    Picture,
}

impl Canvas {
    pub(crate) fn format(self) -> wgpu::TextureFormat {
        match self {
            Canvas::Linear => LINEAR_FORMAT,
            Canvas::Picture => PICTURE_FORMAT_SRGB,
        }
    }

    /// The constant of shaders/light.wgsl that says it.
    pub(crate) fn constant(self) -> (&'static str, f64) {
        ("IS_PICTURE", f64::from(u8::from(self == Canvas::Picture)))
    }
}

/// A finished picture.
pub(crate) struct Target {
    pub(crate) texture: wgpu::Texture,
    /// All layers, for whoever shows it: writes and reads are sRGB encoded.
    pub(crate) whole: wgpu::TextureView,
    /// Each layer: encoding, and bytes as they are.
    pub(crate) layers: Vec<Layer>,
}

/// One layer of a finished picture.
pub(crate) struct Layer {
    pub(crate) encoding: wgpu::TextureView,
    pub(crate) plain: wgpu::TextureView,
    /// Group 1 of a pass that shows it byte by byte.
    pub(crate) group: wgpu::BindGroup,
    /// The same, decoded.
    pub(crate) group_decoding: wgpu::BindGroup,
}

impl Target {
    pub(crate) fn new(device: &wgpu::Device, picture_layout: &wgpu::BindGroupLayout, picture: &Picture) -> Target {
        let count = layer_count(picture);
        let texture = device.create_texture(&wgpu::TextureDescriptor {
            label: Some("target"),
            size: wgpu::Extent3d { width: picture.size[0], height: picture.size[1], depth_or_array_layers: count },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: PICTURE_FORMAT,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_SRC,
            view_formats: &[PICTURE_FORMAT_SRGB],
        });
        let layers = (0..count).map(|layer| {
            let view = |format| {
                texture.create_view(&wgpu::TextureViewDescriptor {
                    format: Some(format),
                    dimension: Some(wgpu::TextureViewDimension::D2),
                    base_array_layer: layer,
                    array_layer_count: Some(1),
                    ..Default::default()
                })
            };
            let (encoding, plain) = (view(PICTURE_FORMAT_SRGB), view(PICTURE_FORMAT));
            let group = picture_group(device, picture_layout, &plain);
            let group_decoding = picture_group(device, picture_layout, &encoding);
            Layer { encoding, plain, group, group_decoding }
        });
        let layers = layers.collect();
        let format = Some(PICTURE_FORMAT_SRGB);
        let whole = texture.create_view(&wgpu::TextureViewDescriptor { format, ..Default::default() });
        Target { texture, whole, layers }
    }

    /// Can it hold this picture?
    pub(crate) fn fits(&self, picture: &Picture) -> bool {
        let size = self.texture.size();
        [size.width, size.height] == picture.size && size.depth_or_array_layers == layer_count(picture)
    }
}

fn layer_count(picture: &Picture) -> u32 {
    if picture.layout == Layout::Layers { picture.views.len().max(1) as u32 } else { 1 }
}

/// Bind group of a pass that reads one picture.
pub(crate) fn picture_group(device: &wgpu::Device, layout: &wgpu::BindGroupLayout, view: &wgpu::TextureView) -> wgpu::BindGroup {
    let resource = wgpu::BindingResource::TextureView(view);
    let entries = &[wgpu::BindGroupEntry { binding: 0, resource }];
    device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some("picture"), layout, entries })
}

/// What a sheet of views is drawn in, shared by all sheets of its size.
pub(crate) struct ViewTarget {
    /// Made when the first sheet of its size is drawn in linear light.
    pub(crate) linear: Option<Linear>,
    pub(crate) depth: wgpu::TextureView,
    /// A copy of `depth`, made when the first cut-out needs it.
    pub(crate) seen_depth: Option<wgpu::TextureView>,
    /// Made when the first soft shadow needs it.
    pub(crate) soft: Option<SoftTarget>,
    last_used: u64,
}

/// Linear light of a sheet.
pub(crate) struct Linear {
    /// Colour of every sample; none where `resolved` is drawn in itself.
    samples: Option<wgpu::TextureView>,
    resolved: wgpu::TextureView,
    /// Group 1 of the pass that reads `resolved`.
    pub(crate) group: wgpu::BindGroup,
}

impl Linear {
    /// What is drawn in.
    pub(crate) fn colour(&self) -> &wgpu::TextureView {
        self.samples.as_ref().unwrap_or(&self.resolved)
    }

    /// Where the last pass brings the mean of the samples.
    pub(crate) fn resolve_target(&self) -> Option<&wgpu::TextureView> {
        self.samples.as_ref().map(|_| &self.resolved)
    }
}

/// What a sheet needs beside its depth.
#[derive(Clone, Copy)]
pub(crate) struct SheetNeeds {
    pub(crate) canvas: Canvas,
    pub(crate) is_soft: bool,
    pub(crate) has_cutouts: bool,
}

/// What depth is copied into, to be read sample by sample.
fn copy_of(device: &wgpu::Device, depth: &wgpu::Texture) -> wgpu::TextureView {
    let texture = device.create_texture(&wgpu::TextureDescriptor {
        label: Some("seen depth"),
        size: depth.size(),
        mip_level_count: 1,
        sample_count: depth.sample_count(),
        dimension: depth.dimension(),
        format: depth.format(),
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    });
    texture.create_view(&wgpu::TextureViewDescriptor { aspect: wgpu::TextureAspect::DepthOnly, ..Default::default() })
}

/// View targets by size.
#[derive(Default)]
pub(crate) struct ViewTargets(HashMap<[u32; 2], ViewTarget>);

impl ViewTargets {
    pub(crate) fn make(
        &mut self,
        device: &wgpu::Device,
        picture_layout: &wgpu::BindGroupLayout,
        size: [u32; 2],
        samples: Samples,
        needs: SheetNeeds,
        frame: u64,
    ) {
        let view = |label, format, sample_count, usage| {
            let texture = device.create_texture(&wgpu::TextureDescriptor {
                label: Some(label),
                size: wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: wgpu::TextureUsages::RENDER_ATTACHMENT | usage,
                view_formats: &[],
            });
            texture.create_view(&wgpu::TextureViewDescriptor::default())
        };
        let target = self.0.entry(size).or_insert_with(|| {
            let usage = wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_SRC;
            let depth = view("depth", DEPTH_FORMAT, samples.count(), usage);
            ViewTarget { linear: None, depth, seen_depth: None, soft: None, last_used: frame }
        });
        target.last_used = frame;
        if needs.canvas == Canvas::Linear && target.linear.is_none() {
            let resolved = view("resolved", LINEAR_FORMAT, 1, wgpu::TextureUsages::TEXTURE_BINDING);
            target.linear = Some(Linear {
                samples: (samples != Samples::One)
                    .then(|| view("samples", LINEAR_FORMAT, samples.count(), wgpu::TextureUsages::empty())),
                group: picture_group(device, picture_layout, &resolved),
                resolved,
            });
        }
        if needs.is_soft && target.soft.is_none() {
            target.soft = Some(SoftTarget::new(device, target.depth.texture()));
        }
        if needs.has_cutouts && target.seen_depth.is_none() {
            target.seen_depth = Some(copy_of(device, target.depth.texture()));
        }
    }

    pub(crate) fn get(&self, size: [u32; 2]) -> Option<&ViewTarget> {
        self.0.get(&size)
    }

    /// Drops sizes that were not used for a while.
    pub(crate) fn drop_unused(&mut self, frame: u64) {
        self.0.retain(|_, target| target.last_used + 30 > frame);
    }
}
