//! The graphics device: found here, or made elsewhere (OpenXR must make its own).

use crate::Error;
use std::sync::{Arc, Mutex};

/// Depth and stencil of every view.
pub(crate) const DEPTH_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Depth32FloatStencil8;
/// Linear picture of a view before it is encoded.
pub(crate) const LINEAR_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba16Float;

/// A device that can draw, and what led to it.
#[derive(Clone)]
pub struct Gpu {
    /// Makes surfaces of windows.
    pub instance: wgpu::Instance,
    /// The chosen driver.
    pub adapter: wgpu::Adapter,
    /// Makes resources.
    pub device: wgpu::Device,
    /// Takes work.
    pub queue: wgpu::Queue,
    /// Name and kind of the driver.
    pub info: wgpu::AdapterInfo,
    /// Mistakes that the device reported on its own.
    pub(crate) reports: Arc<Mutex<Vec<String>>>,
}

impl Gpu {
    /// An instance to make the surface of a window with, for [`Gpu::new`].
    pub fn instance() -> wgpu::Instance {
        let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle_from_env();
        // Indirect draws are checked by a compute pass before every render pass, one dispatch for each buffer. All of ours
        // are written by our own shaders into buffers that are made for the most that these can count.
        descriptor.flags.remove(wgpu::InstanceFlags::VALIDATION_INDIRECT_CALL);
        wgpu::Instance::new(descriptor)
    }

    /// Finds the fastest device that can draw, software last. For windows give the instance and a surface that it made.
    pub fn new(compatible: Option<(wgpu::Instance, &wgpu::Surface<'_>)>) -> Result<Gpu, Error> {
        let (instance, surface) = match compatible {
            Some((instance, surface)) => (instance, Some(surface)),
            None => (Gpu::instance(), None),
        };
        let mut adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::all()));
        adapters.retain(|a| surface.is_none_or(|s| a.is_surface_supported(s)));
        adapters.sort_by_key(|a| rank(a.get_info().device_type));
        let mut reasons = Vec::new();
        for adapter in adapters {
            match open(&instance, adapter) {
                Ok(gpu) => return Ok(gpu),
                Err(error) => reasons.push(error.to_string()),
            }
        }
        let found = if reasons.is_empty() { "no driver answered".to_owned() } else { reasons.join("; ") };
        Err(Error::NoDevice(found))
    }

    /// Takes a device that was made elsewhere; it must have [`Gpu::required_features`].
    pub fn from_parts(
        instance: wgpu::Instance,
        adapter: wgpu::Adapter,
        device: wgpu::Device,
        queue: wgpu::Queue,
    ) -> Result<Gpu, Error> {
        let info = adapter.get_info();
        let missing = Gpu::required_features() - device.features();
        if !missing.is_empty() {
            return Err(lacks(info.name, missing));
        }
        let reports = Arc::new(Mutex::new(Vec::new()));
        let sink = reports.clone();
        device.on_uncaptured_error(Arc::new(move |error| {
            if let Ok(mut list) = sink.lock() {
                list.push(format!("graphics device: {error}"));
            }
        }));
        Ok(Gpu { instance, adapter, device, queue, info, reports })
    }

    /// Does the processor draw?
    pub(crate) fn is_software(&self) -> bool {
        self.info.device_type == wgpu::DeviceType::Cpu
    }

    /// Features without which nothing is drawn.
    pub fn required_features() -> wgpu::Features {
        wgpu::Features::DEPTH32FLOAT_STENCIL8
    }
}

fn lacks(device: String, missing: wgpu::Features) -> Error {
    let names: Vec<&str> = missing.iter_names().map(|(name, _)| name).collect();
    Error::Lacks { device, what: format!("{} (a stencil beside depth of 32 bits)", names.join(", ")) }
}

fn rank(kind: wgpu::DeviceType) -> u32 {
    match kind {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    }
}

fn open(instance: &wgpu::Instance, adapter: wgpu::Adapter) -> Result<Gpu, Error> {
    let info = adapter.get_info();
    let missing = Gpu::required_features() - adapter.features();
    if !missing.is_empty() {
        return Err(lacks(info.name, missing));
    }
    let is_software = info.device_type == wgpu::DeviceType::Cpu;
    if is_software {
        keep_freed_memory();
    }
    let mut clock = wgpu::Features::TIMESTAMP_QUERY;
    // See `handover.rs`.
    clock.set(wgpu::Features::TIMESTAMP_QUERY_INSIDE_PASSES, is_software);
    let wanted = clock | wgpu::Features::DEPTH_CLIP_CONTROL;
    let descriptor = wgpu::DeviceDescriptor {
        label: Some("umbriel"),
        required_features: Gpu::required_features() | (adapter.features() & wanted),
        required_limits: adapter.limits(),
        ..Default::default()
    };
    let (device, queue) =
        pollster::block_on(adapter.request_device(&descriptor)).map_err(|e| Error::NoDevice(format!("{}: {e}", info.name)))?;
    Gpu::from_parts(instance.clone(), adapter, device, queue)
}

/// Lets the process keep memory that is freed and soon wanted again. A software device lists the triangles of every pass in
/// memory of its own, some 10 MB of it in a frame of seven channels; given back to the system after each pass, every page of it
/// costs a fault in the next. glibc gives back what is free beyond twice the largest block that it ever
/// mapped on its own and was handed back, up to these 32 MiB; other allocators do not care.
fn keep_freed_memory() {
    const LARGEST_MAPPED: usize = 32 << 20;
    drop(std::hint::black_box(Vec::<u8>::with_capacity(LARGEST_MAPPED - (64 << 10))));
}
