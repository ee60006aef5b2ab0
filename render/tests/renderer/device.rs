//! Devices that cannot do what every picture needs.

use crate::support::gpu;
use umbriel_render::{Error, Gpu};

#[test]
fn a_device_without_stencil_is_refused_in_words() {
    let (_turn, gpu) = gpu();
    let bare = wgpu::DeviceDescriptor { label: Some("no stencil beside depth"), ..Default::default() };
    let (device, queue) = pollster::block_on(gpu.adapter.request_device(&bare)).unwrap();
    let refused = Gpu::from_parts(gpu.instance.clone(), gpu.adapter.clone(), device, queue).err();
    let message = match &refused {
        Some(error @ Error::Lacks { .. }) => error.to_string(),
        other => panic!("{:?}", other.is_some()),
    };
    for part in [gpu.info.name.as_str(), "lacks DEPTH32FLOAT_STENCIL8", "stencil", "newer driver"] {
        assert!(message.contains(part), "{part}: {message}");
    }
}
