//! Lets a software device draw one view of a pass while it lists the next.

use crate::Gpu;

/// Hands over what a pass has recorded so far.
///
/// A software device works through a pass in two stages: one thread lists which triangles touch which tiles, then all threads draw
/// the tiles. The second stage waits for the whole first one, unless a timestamp stands between (Mesa 25.0.7, lavapipe's
/// `handle_write_timestamp2`: what is listed is drawn from there on, and listing goes on at once). Nobody reads the times. Other
/// devices overlap the two by themselves; there nothing is written.
pub(crate) struct Handover {
    marks: Option<wgpu::QuerySet>,
}

/// A pass may write each mark once.
const MARKS: u32 = 256;

impl Handover {
    pub(crate) fn new(gpu: &Gpu) -> Handover {
        let has_marks = gpu.device.features().contains(wgpu::Features::TIMESTAMP_QUERY_INSIDE_PASSES);
        let marks = (gpu.is_software() && has_marks).then(|| {
            gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("handover"),
                ty: wgpu::QueryType::Timestamp,
                count: MARKS,
            })
        });
        Handover { marks }
    }

    /// What follows the view of this number in the pass is listed while that view is drawn.
    pub(crate) fn after_view(&self, pass: &mut wgpu::RenderPass<'_>, number: usize) {
        let number = u32::try_from(number).ok().filter(|n| *n < MARKS);
        if let (Some(marks), Some(number)) = (&self.marks, number) {
            pass.write_timestamp(marks, number);
        }
    }
}
