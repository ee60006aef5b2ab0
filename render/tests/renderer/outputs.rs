//! What else comes out: windows, pictures of maps, figures.

use crate::support::*;
use glam::{Mat4, Vec3};
use umbriel_render::Renderer;
use umbriel_scene::*;

fn scene() -> Scene {
    let light = |kind, shadows| Light {
        kind,
        shadows,
        position: Vec3::new(0.0, 5.0, 0.0),
        map: MapSettings { size: 64, ..Default::default() },
        ..noon()
    };
    let spot = LightKind::Spot { inner_rad: 0.1, outer_rad: 0.5 };
    Scene {
        drawables: vec![
            shape(plane(9.0), matt(0.5, 0.25, 0.75), Mat4::IDENTITY),
            shape(cuboid(Vec3::ONE), matt(0.9, 0.9, 0.9), at(0.0, 1.0, 0.0)),
        ]
        .into(),
        lights: vec![
            light(LightKind::Point, ShadowMethod::None),
            light(spot, ShadowMethod::Map),
            light(LightKind::Point, ShadowMethod::Map),
            light(LightKind::Directional, ShadowMethod::Map),
        ],
        ..Default::default()
    }
}

#[test]
fn maps_can_be_looked_at() {
    let (_turn, gpu) = gpu();
    let mut renderer = Renderer::new(gpu).unwrap();
    renderer.render(&scene(), &[Picture::mono(look("maps", Vec3::new(2.0, 4.0, 5.0), Vec3::ZERO, [32, 32]))]).unwrap();
    let spot = &renderer.shadow_map_picture(1).unwrap()[0];
    let (middle, corner) = (spot.grey[32 * 64 + 32], spot.grey[64 + 1]);
    assert_eq!((spot.width, spot.height, middle), (64, 64, 255), "the top of the box is nearest");
    assert!((40..200).contains(&corner), "the floor is farther: {corner}");
    let point = renderer.shadow_map_picture(2).unwrap();
    let seen: Vec<bool> = point.iter().map(|p| p.grey.iter().any(|g| *g > 0)).collect();
    assert_eq!(seen, [true, true, false, true, true, true], "all but the sky");
    assert!(!renderer.shadow_map_picture(3).unwrap().is_empty());
    assert!(renderer.shadow_map_picture(0).is_err() && renderer.shadow_map_picture(9).is_err());
    assert_eq!(renderer.problems(), Vec::<String>::new());
}

#[test]
fn windows_show_the_same_bytes() {
    let (_turn, gpu) = gpu();
    let mut renderer = Renderer::new(gpu).unwrap();
    renderer.render(&scene(), &[Picture::mono(look("window", Vec3::new(2.0, 4.0, 5.0), Vec3::ZERO, [64, 48]))]).unwrap();
    let expected = renderer.read_back(0).unwrap()[0].rgba.clone();
    for format in [wgpu::TextureFormat::Rgba8Unorm, wgpu::TextureFormat::Rgba8UnormSrgb] {
        let window = gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: None,
            size: wgpu::Extent3d { width: 64, height: 48, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
            view_formats: &[],
        });
        let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: 64 * 48 * 4,
            usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        renderer.blit(0, &mut encoder, &window.create_view(&Default::default()), format).unwrap();
        let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(256), rows_per_image: None };
        encoder.copy_texture_to_buffer(
            window.as_image_copy(),
            wgpu::TexelCopyBufferInfo { buffer: &buffer, layout },
            window.size(),
        );
        gpu.queue.submit([encoder.finish()]);
        buffer.map_async(wgpu::MapMode::Read, .., |_| ());
        gpu.device.poll(wgpu::PollType::wait_indefinitely()).unwrap();
        let bytes = buffer.get_mapped_range(..).unwrap().to_vec();
        let differ = bytes.iter().zip(&expected).filter(|(a, b)| a.abs_diff(**b) > 1).count();
        assert_eq!(differ, 0, "{format:?}");
    }
    assert_eq!(renderer.problems(), Vec::<String>::new());
}

#[test]
fn passes_are_timed() {
    let (_turn, gpu) = gpu();
    let mut renderer = Renderer::new(gpu).unwrap();
    let picture = Picture::mono(look("timed", Vec3::new(2.0, 4.0, 5.0), Vec3::ZERO, [64, 48]));
    let mut scene = scene();
    let mut stats = Default::default();
    for frame in 0..4 {
        scene.drawables[1].world_from_object = at(0.1 * frame as f32, 1.0, 0.0);
        stats = renderer.render(&scene, std::slice::from_ref(&picture)).unwrap();
        gpu.device.poll(wgpu::PollType::wait_indefinitely()).unwrap();
    }
    let kinds: Vec<&str> = stats.gpu_s.iter().map(|(k, _)| *k).collect();
    // A software device would wait for every pass to tell its time.
    if gpu.device.features().contains(wgpu::Features::TIMESTAMP_QUERY) && gpu.info.device_type != wgpu::DeviceType::Cpu {
        assert_eq!(kinds, ["shadow maps", "views", "compose"]);
        assert!(stats.gpu_s.iter().all(|(_, s)| (0.0..5.0).contains(s)) && stats.gpu_s[1].1 > 0.0, "{:?}", stats.gpu_s);
    } else {
        assert_eq!(kinds, [""; 0]);
    }
    assert!(stats.prepare_s > 0.0 && stats.encode_s > 0.0);
}
