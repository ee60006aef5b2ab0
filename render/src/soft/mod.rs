//! Soft shadows of volumes (004).
//!
//! The one idea: the volumes say exactly what the light's centre does not see, and the silhouettes how far around that the
//! light's rim changes it. Per view and light a *shadow texture* is made: the hard shadow out of the stencil, the penumbra's
//! radius from wedges over the silhouettes, and from both the share of the light that is hidden. Outside it is 0, hard 1.
//!
//! Only the hard shadow's counts enter, not the number of surfaces that cast it, so any mesh will do: open, of several
//! layers, skinned. What is behind something else or outside of the picture is not known; there the shadow goes on as its
//! neighbourhood.

mod layers;
mod passes;
mod silhouettes;
mod target;

pub(crate) use passes::Passes;
pub(crate) use target::SoftTarget;

use crate::lights::Lights;
use crate::plan::Purpose;
use crate::slots::Slots;
use crate::volumes::{VolumeJob, VolumePass};
use bytemuck::{Pod, Zeroable};
use silhouettes::Silhouettes;
use umbriel_scene::{Light, Samples, Scene};

/// `Source` of soft/source.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(crate) struct Source {
    pub(crate) toward_light: [f32; 4],
    pub(crate) size: f32,
    pub(crate) spare: [u32; 3],
}

/// Volumes of the frame that make a soft shadow.
pub(crate) struct SoftJob {
    /// Size of the source, as [`Light::size`].
    size: f32,
    /// Places of the jobs of the volumes of each layer of casters.
    pub(crate) layers: Vec<usize>,
}

/// A layer of casters of a soft job.
struct Layer {
    /// Number of its [`Source`].
    slot: usize,
    silhouettes: Silhouettes,
}

/// The layers of the frame's soft jobs, by the place of their volumes' job.
pub(crate) struct SoftPass {
    pub(crate) passes: Passes,
    gather: silhouettes::Gather,
    sources: Slots<Source>,
    layers: Vec<Option<Layer>>,
}

/// Does a volume's shadow need a shadow texture? A hard one that takes all of the light does without.
pub(crate) fn is_soft(light: &Light) -> bool {
    let has_size = light.soft && light.size.is_finite() && light.size > 0.0;
    has_size || light.shadow_intensity < 1.0
}

/// Size of the source as penumbrae see it.
pub(crate) fn size_of(light: &Light) -> f32 {
    if light.soft && light.size.is_finite() { light.size.max(0.0) } else { 0.0 }
}

/// Which of the jobs are soft. Their casters are parted into layers, whose volumes become jobs of their own behind all others.
pub(crate) fn soft_jobs(scene: &Scene, lights: &Lights, purposes: &[Purpose], jobs: &mut Vec<VolumeJob>) -> Vec<Option<SoftJob>> {
    let size = |purpose: &Purpose| match *purpose {
        Purpose::Light(place) => Some(&scene.lights[lights.order[place]]).filter(|l| is_soft(l)).map(size_of),
        Purpose::Film { light, .. } => Some(size_of(&scene.lights[light])).filter(|s| *s > 0.0),
    };
    let mut part = |(number, purpose): (usize, &Purpose)| {
        let (size, light, receivers) = (size(purpose)?, jobs[number].light, jobs[number].receivers);
        let mut parted = layers::distribute(&light, size, std::mem::take(&mut jobs[number].casters)).into_iter();
        jobs[number].casters = parted.next().unwrap_or_default();
        let first = jobs.len();
        jobs.extend(parted.map(|casters| VolumeJob { light, casters, receivers }));
        Some(SoftJob { size, layers: std::iter::once(number).chain(first..jobs.len()).collect() })
    };
    purposes.iter().enumerate().map(&mut part).collect()
}

impl SoftPass {
    pub(crate) fn new(device: &wgpu::Device, layouts: &crate::layouts::Layouts, samples: Samples) -> SoftPass {
        SoftPass {
            passes: Passes::new(device, layouts, samples),
            gather: silhouettes::Gather::new(device),
            sources: Slots::new(device, "soft sources"),
            layers: Vec::new(),
        }
    }

    /// Gathers the silhouettes of the soft jobs, in the encoder of the passes that draw them and before these. A layer with
    /// too many edges for the device stays hard, with a report.
    pub(crate) fn prepare(
        &mut self,
        (device, queue): (&wgpu::Device, &wgpu::Queue),
        encoder: &mut wgpu::CommandEncoder,
        volumes: &mut VolumePass,
        (jobs, soft): (&[VolumeJob], &[Option<SoftJob>]),
        mut report: impl FnMut(String),
    ) {
        self.sources.clear();
        let mut old = std::mem::take(&mut self.layers);
        old.resize_with(jobs.len(), || None);
        self.layers.resize_with(jobs.len(), || None);
        for soft in soft.iter().flatten() {
            for &place in &soft.layers {
                let job = &jobs[place];
                let toward_light = job.light.toward_light.to_array();
                let slot = self.sources.push(&Source { toward_light, size: soft.size, spare: [0; 3] });
                let casters = if soft.size > 0.0 { &job.casters[..] } else { &[] };
                let old = old[place].take().map(|o| o.silhouettes);
                let made = self.gather.run((device, queue), encoder, volumes, (&job.light, casters), old);
                let silhouettes = made.unwrap_or_else(|message| {
                    report(message);
                    self.gather.nothing(device)
                });
                self.layers[place] = Some(Layer { slot, silhouettes });
            }
        }
        self.sources.upload(device, queue, &self.passes.source_layout);
    }

    /// Adds a layer to the shadow texture, in a view whose stencil holds the counts of the layer's volumes.
    pub(crate) fn draw(
        &self,
        device: &wgpu::Device,
        encoder: &mut wgpu::CommandEncoder,
        clock: &crate::clock::Clock,
        (job, view): (usize, &wgpu::BindGroup),
        (target, is_first): (&SoftTarget, bool),
    ) {
        if let Some(layer) = self.layers.get(job).and_then(Option::as_ref) {
            let source = self.sources.binding(layer.slot);
            self.passes.draw(device, encoder, clock, view, source, &layer.silhouettes.buffer, (target, is_first));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_soft() {
        let rows = [
            ("off", false, 0.1, 1.0, None),
            ("on", true, 0.1, 1.0, Some(0.1)),
            ("a point", true, 0.0, 1.0, None),
            ("not finite", true, f32::NAN, 1.0, None),
            ("negative", true, -1.0, 1.0, None),
            ("a pale shadow", false, 0.1, 0.5, Some(0.0)),
            ("pale and soft", true, 0.1, 0.5, Some(0.1)),
        ];
        for (name, soft, size, shadow_intensity, expected) in rows {
            let light = Light { soft, size, shadow_intensity, ..Light::default() };
            assert_eq!(is_soft(&light).then(|| size_of(&light)), expected, "{name}");
        }
    }
}
