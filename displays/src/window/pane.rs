//! One window and the surface that is drawn into it.

use super::controls::Controls;
use crate::Error;
use std::sync::Arc;
use umbriel_render::Gpu;
use wgpu::CurrentSurfaceTexture;
use winit::dpi::PhysicalSize;
use winit::event_loop::ActiveEventLoop;
use winit::monitor::MonitorHandle;
use winit::window::{Fullscreen, Window, WindowId};

/// Part of a monitor that a new window takes at most.
const OF_MONITOR: f64 = 0.9;

/// A window that shows the picture of the same name.
pub(super) struct Pane {
    pub(super) name: String,
    pub(super) controls: Controls,
    pub(super) occluded: bool,
    /// As the events tell it: asking the window system is slow, and fails for a window that it has just closed.
    pub(super) size: [u32; 2],
    minimized: bool,
    window: Arc<Window>,
    /// None until there is a device to draw with.
    surface: Option<(wgpu::Surface<'static>, wgpu::SurfaceConfiguration)>,
}

impl Pane {
    /// Opens a window that fills a monitor, or one of `size` pixels, smaller in the same proportion where the monitor is.
    pub(super) fn open(target: &ActiveEventLoop, name: &str, size: [u32; 2], fullscreen: Option<usize>) -> Result<Pane, Error> {
        let room = target.primary_monitor().or_else(|| target.available_monitors().next()).map(|m| m.size());
        let attributes = Window::default_attributes().with_title(name);
        let attributes = match fullscreen {
            Some(number) => attributes.with_fullscreen(Some(Fullscreen::Borderless(Some(monitor(target, number)?)))),
            None => attributes.with_inner_size(fitted(size, room)),
        };
        let window = target.create_window(attributes).map_err(|e| Error::Window(e.to_string()))?;
        let PhysicalSize { width, height } = window.inner_size();
        Ok(Pane {
            name: name.to_owned(),
            controls: Controls::default(),
            occluded: false,
            size: [width, height],
            minimized: false,
            window: Arc::new(window),
            surface: None,
        })
    }

    pub(super) fn id(&self) -> WindowId {
        self.window.id()
    }

    pub(super) fn set_title(&self, title: &str) {
        self.window.set_title(title);
    }

    /// Asks what no event tells.
    pub(super) fn refresh(&mut self) {
        self.minimized = self.window.is_minimized() == Some(true);
    }

    /// Pixels across and down; None while the window shows nothing.
    pub(super) fn size(&self) -> Option<[u32; 2]> {
        let hidden = self.occluded || self.minimized || self.size.contains(&0);
        (!hidden).then_some(self.size)
    }

    /// A surface that no device is drawing to yet.
    pub(super) fn make_surface(&self, instance: &wgpu::Instance) -> Result<wgpu::Surface<'static>, Error> {
        instance.create_surface(self.window.clone()).map_err(|e| Error::Window(e.to_string()))
    }

    /// Makes `surface` the one that the device draws into.
    pub(super) fn attach(&mut self, gpu: &Gpu, surface: wgpu::Surface<'static>) -> Result<(), Error> {
        let [width, height] = self.size().unwrap_or([1, 1]);
        let mut config = surface
            .get_default_config(&gpu.adapter, width, height)
            .ok_or_else(|| Error::Window(format!("`{}` cannot draw into windows", gpu.info.name)))?;
        let formats = surface.get_capabilities(&gpu.adapter).formats;
        config.format = formats.iter().copied().find(|f| f.is_srgb()).unwrap_or(config.format);
        config.present_mode = wgpu::PresentMode::AutoVsync;
        surface.configure(&gpu.device, &config);
        self.surface = Some((surface, config));
        Ok(())
    }

    /// Lets `draw` fill the window, and shows it. A frame that the window system does not want is left out.
    pub(super) fn show(
        &mut self,
        gpu: &Gpu,
        mut draw: impl FnMut(&mut wgpu::CommandEncoder, &wgpu::TextureView, wgpu::TextureFormat) -> Result<(), Error>,
    ) -> Result<(), Error> {
        let Some(size) = self.size() else { return Ok(()) };
        let Some((surface, config)) = &mut self.surface else { return Ok(()) };
        if [config.width, config.height] != size {
            [config.width, config.height] = size;
            surface.configure(&gpu.device, config);
        }
        let (texture, stale) = match surface.get_current_texture() {
            CurrentSurfaceTexture::Success(texture) => (texture, false),
            CurrentSurfaceTexture::Suboptimal(texture) => (texture, true),
            CurrentSurfaceTexture::Timeout | CurrentSurfaceTexture::Occluded => return Ok(()),
            CurrentSurfaceTexture::Outdated | CurrentSurfaceTexture::Validation => {
                surface.configure(&gpu.device, config);
                return Ok(());
            }
            CurrentSurfaceTexture::Lost => {
                let surface = self.make_surface(&gpu.instance)?;
                return self.attach(gpu, surface);
            }
        };
        let view = texture.texture.create_view(&wgpu::TextureViewDescriptor::default());
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("window") });
        draw(&mut encoder, &view, config.format)?;
        gpu.queue.submit([encoder.finish()]);
        self.window.pre_present_notify();
        gpu.queue.present(texture);
        if stale {
            surface.configure(&gpu.device, config);
        }
        Ok(())
    }
}

/// A monitor by its number, from zero.
fn monitor(target: &ActiveEventLoop, number: usize) -> Result<MonitorHandle, Error> {
    let sizes = || {
        let told = |(number, monitor): (usize, MonitorHandle)| {
            let PhysicalSize { width, height } = monitor.size();
            format!("{number} ({width}x{height})")
        };
        target.available_monitors().enumerate().map(told).collect::<Vec<_>>().join(", ")
    };
    let found = target.available_monitors().nth(number);
    found.ok_or_else(|| Error::Window(format!("there is no monitor {number}; there are: {}", sizes())))
}

fn fitted(size: [u32; 2], monitor: Option<PhysicalSize<u32>>) -> PhysicalSize<u32> {
    let wanted = size.map(|s| f64::from(s.max(1)));
    let room = monitor.filter(|m| m.width > 0 && m.height > 0);
    let shrink = room.map_or(1.0, |m| {
        (f64::from(m.width) * OF_MONITOR / wanted[0]).min(f64::from(m.height) * OF_MONITOR / wanted[1]).min(1.0)
    });
    let [width, height] = wanted.map(|s| (s * shrink).round().max(1.0) as u32);
    PhysicalSize { width, height }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_fit_the_monitor() {
        for (size, monitor, want) in [
            ([640, 480], Some([1920, 1080]), [640, 480]),
            ([8960, 720], Some([1920, 1080]), [1728, 139]),
            ([1000, 4000], Some([1000, 1000]), [225, 900]),
            ([640, 480], None, [640, 480]),
            ([640, 480], Some([0, 0]), [640, 480]),
            ([0, 0], None, [1, 1]),
        ] {
            let got = fitted(size, monitor.map(|[w, h]: [u32; 2]| PhysicalSize::new(w, h)));
            assert_eq!([got.width, got.height], want, "{size:?}");
        }
    }
}
