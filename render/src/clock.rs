//! GPU time of each kind of pass, where the device has a clock.

use crate::Gpu;
use std::cell::RefCell;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Passes of a frame that are timed; the rest is not.
const PASSES: u32 = 256;
const BYTES: u64 = 16 * PASSES as u64;

/// Times passes and brings the figures back a few frames later, without waiting.
pub(crate) struct Clock {
    gpu: Option<GpuClock>,
    /// Kinds of the passes of this frame.
    labels: RefCell<Vec<&'static str>>,
    latest: Vec<(&'static str, f64)>,
}

struct GpuClock {
    set: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    read_back: wgpu::Buffer,
    seconds_per_tick: f64,
    /// Labels of the frame that is on its way, and whether it arrived.
    pending: Option<(Vec<&'static str>, Arc<AtomicBool>)>,
}

impl Clock {
    pub(crate) fn new(gpu: &Gpu) -> Clock {
        let (device, queue) = (&gpu.device, &gpu.queue);
        let make = || {
            let buffer = |label, usage| {
                device.create_buffer(&wgpu::BufferDescriptor {
                    label: Some(label),
                    size: BYTES,
                    usage,
                    mapped_at_creation: false,
                })
            };
            GpuClock {
                set: device.create_query_set(&wgpu::QuerySetDescriptor {
                    label: Some("clock"),
                    ty: wgpu::QueryType::Timestamp,
                    count: 2 * PASSES,
                }),
                resolved: buffer("clock", wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC),
                read_back: buffer("clock read back", wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ),
                seconds_per_tick: f64::from(queue.get_timestamp_period()) * 1e-9,
                pending: None,
            }
        };
        // Software waits for all of a pass to read its clock, which takes a part of the frame.
        let is_timed = device.features().contains(wgpu::Features::TIMESTAMP_QUERY) && !gpu.is_software();
        let gpu = is_timed.then(make);
        Clock { gpu, labels: RefCell::default(), latest: Vec::new() }
    }

    /// Places of the next pass in the query set.
    fn next(&self, label: &'static str) -> Option<(&wgpu::QuerySet, u32)> {
        let gpu = self.gpu.as_ref().filter(|g| g.pending.is_none())?;
        let mut labels = self.labels.borrow_mut();
        let place = labels.len() as u32;
        (place < PASSES).then(|| {
            labels.push(label);
            (&gpu.set, 2 * place)
        })
    }

    /// Times a render pass.
    pub(crate) fn render(&self, label: &'static str) -> Option<wgpu::RenderPassTimestampWrites<'_>> {
        self.next(label).map(|(query_set, i)| wgpu::RenderPassTimestampWrites {
            query_set,
            beginning_of_pass_write_index: Some(i),
            end_of_pass_write_index: Some(i + 1),
        })
    }

    /// Times a compute pass.
    pub(crate) fn compute(&self, label: &'static str) -> Option<wgpu::ComputePassTimestampWrites<'_>> {
        self.next(label).map(|(query_set, i)| wgpu::ComputePassTimestampWrites {
            query_set,
            beginning_of_pass_write_index: Some(i),
            end_of_pass_write_index: Some(i + 1),
        })
    }

    /// After the last pass of a frame.
    pub(crate) fn resolve(&self, encoder: &mut wgpu::CommandEncoder) {
        let count = 2 * self.labels.borrow().len() as u32;
        if let Some(gpu) = self.gpu.as_ref().filter(|g| g.pending.is_none() && count > 0) {
            encoder.resolve_query_set(&gpu.set, 0..count, &gpu.resolved, 0);
            encoder.copy_buffer_to_buffer(&gpu.resolved, 0, &gpu.read_back, 0, Some(8 * u64::from(count)));
        }
    }

    /// After a frame was submitted. Gives the figures of the latest frame that came back.
    pub(crate) fn collect(&mut self, device: &wgpu::Device) -> Vec<(&'static str, f64)> {
        let labels = std::mem::take(&mut *self.labels.borrow_mut());
        let Some(gpu) = &mut self.gpu else { return Vec::new() };
        if gpu.pending.is_none() && !labels.is_empty() {
            let arrived = Arc::new(AtomicBool::new(false));
            let told = arrived.clone();
            gpu.read_back.map_async(wgpu::MapMode::Read, .., move |result| told.store(result.is_ok(), Ordering::Release));
            gpu.pending = Some((labels, arrived));
        }
        // A lost device is reported elsewhere; here it only means that no figures come.
        let _ = device.poll(wgpu::PollType::Poll);
        if let Some((labels, _)) = gpu.pending.take_if(|(_, arrived)| arrived.load(Ordering::Acquire)) {
            if let Ok(bytes) = gpu.read_back.get_mapped_range(..) {
                let ticks: Vec<u64> = bytemuck::pod_collect_to_vec(&bytes);
                self.latest = sums(&labels, &ticks, gpu.seconds_per_tick);
            }
            gpu.read_back.unmap();
        }
        self.latest.clone()
    }
}

/// Seconds by label, in the order of their first pass.
fn sums(labels: &[&'static str], ticks: &[u64], seconds_per_tick: f64) -> Vec<(&'static str, f64)> {
    let mut sums: Vec<(&'static str, f64)> = Vec::new();
    for (label, pair) in labels.iter().zip(ticks.chunks_exact(2)) {
        let seconds = pair[1].saturating_sub(pair[0]) as f64 * seconds_per_tick;
        match sums.iter_mut().find(|(l, _)| l == label) {
            Some(sum) => sum.1 += seconds,
            None => sums.push((label, seconds)),
        }
    }
    sums
}

#[cfg(test)]
mod tests {
    #[test]
    fn times_add_up_by_label() {
        let ticks = [0, 10, 10, 30, 30, 31, 50, 40];
        let sums = super::sums(&["maps", "surfaces", "maps", "surfaces"], &ticks, 2.0);
        assert_eq!(sums, [("maps", 22.0), ("surfaces", 40.0)]);
    }
}
