//! What is drawn for each view, decided before anything is recorded.

use crate::author::STANDARD;
use crate::draws::{Draw, Draws, Found};
use crate::lights::{Lights, falls_on};
use crate::sheets::{self, Sheets};
use crate::slots::Slots;
use crate::soft::SoftJob;
use crate::stats::{FrameStats, Problems};
use crate::surface::Pass;
use crate::targets::Canvas;
use crate::volumes::Sight;
use crate::{jobs, uniforms};
use glam::{Mat4, Vec3};
use std::collections::HashMap;
use std::sync::Arc;
use umbriel_scene::{Layout, Picture, PictureKind, Rect, Samples, Scene, View};

/// One view of one picture.
pub(crate) struct ViewPlan {
    pub(crate) picture: usize,
    pub(crate) layer: usize,
    /// Where it goes in its layer.
    pub(crate) rect: Rect,
    /// Place in the pipelines of composition: all channels, red, green and blue.
    pub(crate) channels: usize,
    pub(crate) size: [u32; 2],
    /// Left and top in its sheet.
    pub(crate) origin: [u32; 2],
    pub(crate) is_visibility: bool,
    pub(crate) base_slot: usize,
    /// Where shapes are shaded once, after depth and the first light's volumes: the view with that light among the others.
    pub(crate) lit_slot: Option<usize>,
    /// What depth is filled by: where little but light from everywhere is to be shaded, that is done at once for all places, and
    /// what is lit drawn over it, without a pass for what is in shadow.
    pub(crate) first_pass: Pass,
    pub(crate) opaque: Arc<[Draw]>,
    /// Shapes with lines over their edges.
    pub(crate) contoured: Vec<(usize, Draw)>,
    pub(crate) blend_slot: usize,
    pub(crate) blended: Arc<[Draw]>,
    /// What shadow volumes are chosen by.
    pub(crate) sight: Sight,
    /// Those of the opaque shapes whose own shader makes something of a light's shadow.
    pub(crate) shading_shadow: Vec<Draw>,
    /// Shadow volumes and what is done with each.
    pub(crate) steps: Vec<Step>,
}

/// A job of the shadow volumes, and what follows it.
pub(crate) struct Step {
    pub(crate) job: usize,
    /// By a shadow texture, not by the stencil alone: the jobs of its layers.
    pub(crate) soft: Option<Vec<usize>>,
    /// Those of the opaque shapes on which its light's shadow does not fall.
    pub(crate) exempt: Arc<[Draw]>,
    pub(crate) then: Then,
}

/// What is done where a job's volumes were counted.
pub(crate) enum Then {
    /// Light is added outside: number of the view with that light.
    Light { slot: usize },
    /// A film is laid inside: number of the film.
    Film { slot: usize },
}

/// What the jobs of the frame are for.
pub(crate) enum Purpose {
    /// The light at this place of the GPU's list.
    Light(usize),
    /// The film at this number, for the light at this place of the scene.
    Film { film: usize, light: usize },
}

impl Purpose {
    /// The light, as a place in the scene.
    fn light(&self, lights: &Lights) -> usize {
        match self {
            Purpose::Light(place) => lights.order[*place],
            Purpose::Film { light, .. } => *light,
        }
    }
}

/// Number of the film that hides all light.
pub(crate) const BLACK_FILM: usize = 0;

/// The frame as plans see it.
pub(crate) struct Frame<'a> {
    pub(crate) scene: &'a Scene,
    pub(crate) lights: &'a Lights,
    /// The same as the shaders read them.
    pub(crate) light_uniforms: &'a [uniforms::Light],
    pub(crate) purposes: &'a [Purpose],
    /// The soft ones among them.
    pub(crate) soft: &'a [Option<SoftJob>],
    /// Shapes with lines over their edges, ascending.
    pub(crate) contours: &'a [usize],
    /// Depth bounds cost processors time to find. They gain it back where these draw as well.
    pub(crate) bounds_depth: bool,
}

impl ViewPlan {
    pub(crate) fn add_pass(&self, is_soft: bool) -> Pass {
        match (self.is_visibility, is_soft) {
            (true, false) => Pass::VisibilityAdd,
            (true, true) => Pass::VisibilitySoft,
            (false, false) => Pass::Add,
            (false, true) => Pass::AddSoft,
        }
    }
}

/// What a frame without lines and half-transparent shapes is drawn in: straight in the picture, where that is the only one, with its views in a
/// row, and no place of it is shaded by one light after the other or more than once.
pub(crate) fn canvas(samples: Samples, pictures: &[Picture], jobs: &jobs::Jobs, soft: &[Option<SoftJob>], limit: u32) -> Canvas {
    let is_shaded_once = match &jobs.purposes[..] {
        [] => true,
        [Purpose::Light(_)] => soft[0].is_none() && jobs.cutouts.iter().all(|job| job.cutouts.is_empty()),
        _ => false,
    };
    let is_row = |picture: &Picture| sheets::is_row(picture) && picture.views.iter().all(|v| what_is_wrong(v, limit).is_none());
    match pictures {
        [picture] if is_shaded_once && samples == Samples::One && is_row(picture) => Canvas::Picture,
        _ => Canvas::Linear,
    }
}

/// A picture that cannot be drawn is left out, with a report.
pub(crate) fn is_drawable(picture: &Picture, limit: u32, problems: &mut Problems) -> bool {
    let [width, height] = picture.size;
    let name = &picture.name;
    if width == 0 || height == 0 || width > limit || height > limit {
        problems.report(format!("picture '{name}' of {width} x {height}: the device takes 1 to {limit} each way"));
        return false;
    }
    if picture.views.is_empty() {
        problems.report(format!("picture '{name}' has no views"));
        return false;
    }
    true
}

/// Rectangle, layer and channels of a view in its picture.
fn place_of(picture: &Picture, index: usize) -> Option<(Rect, usize, usize)> {
    let [width, height] = picture.size;
    let whole = Rect { x: 0, y: 0, width, height };
    match &picture.layout {
        Layout::Tiles(rects) => {
            let rect = *rects.get(index)?;
            let fits = rect.x.checked_add(rect.width)? <= width && rect.y.checked_add(rect.height)? <= height;
            (fits && rect.width > 0 && rect.height > 0).then_some((rect, 0, 0))
        }
        Layout::Anaglyph => (index < 2).then_some((whole, 0, index + 1)),
        Layout::Layers => Some((whole, index, 0)),
    }
}

/// Plans every view of a picture.
#[allow(clippy::too_many_arguments, reason = "the frame's lists that a plan adds to")]
pub(crate) fn plan_picture(
    number: usize,
    picture: &Picture,
    frame: &Frame<'_>,
    draws: &mut Draws,
    (slots, sheets): (&mut Slots<uniforms::View>, &mut Sheets),
    problems: &mut Problems,
    stats: &mut FrameStats,
    limit: u32,
) -> Vec<ViewPlan> {
    let mut plans = Vec::new();
    for (index, view) in picture.views.iter().enumerate() {
        let Some((rect, layer, channels)) = place_of(picture, index) else {
            problems.report(format!("picture '{}': view '{}' has no place inside of it", picture.name, view.name));
            continue;
        };
        if let Some(wrong) = what_is_wrong(view, limit) {
            problems.report(format!("picture '{}': view '{}' {wrong}", picture.name, view.name));
            continue;
        }
        let shown = shown_light(picture, frame, problems);
        let clip_from_world = view.frustum.clip_from_view() * view.view_from_world;
        let found = draws.surfaces(&clip_from_world);
        let (opaque, outside) = (found.draws, found.culled);
        let is_visibility = picture.kind != PictureKind::Colour;
        let found = if is_visibility { Found::default() } else { draws.back_to_front(&clip_from_world, &view.view_from_world) };
        let (blended, blended_outside) = (found.draws, found.culled);
        let contoured = if is_visibility || frame.contours.is_empty() {
            Vec::new()
        } else {
            draws.single(&clip_from_world, |index| frame.contours.binary_search(&index).is_ok())
        };
        stats.culled += (outside + blended_outside) as u32;
        stats.views += 1;
        let mut exempt_from = Exempt { scene: frame.scene, clip_from_world: &clip_from_world, known: HashMap::new() };
        // Soft shadows read their view's pixels by their place.
        let origin = sheets.place(view.size, frame.scene.samples, frame.soft.iter().any(Option::is_some), limit);
        let mut uniform = uniform_of(view, rect, frame.scene);
        uniform.window = [origin[0], origin[1], view.size[0], view.size[1]].map(|x| x as f32);
        let mut slot_with = |first: usize, count: usize| {
            uniform.first_light = first as u32;
            uniform.light_count = count as u32;
            uniform.lights = bytemuck::Zeroable::zeroed();
            for (place, light) in uniform.lights.iter_mut().zip(&frame.light_uniforms[first..first + count]) {
                *place = *light;
            }
            uniform.shown_light = shown.unwrap_or(0) as u32;
            slots.push(&uniform)
        };
        let wants = |place: usize| !is_visibility || shown == Some(place);
        let mut steps = Vec::new();
        for (job, purpose) in frame.purposes.iter().enumerate() {
            let then = match *purpose {
                Purpose::Light(place) if wants(place) => Then::Light { slot: slot_with(place, 1) },
                Purpose::Film { light, .. } if is_visibility && shown.is_some() && shown == frame.lights.place_of(light) => {
                    Then::Film { slot: BLACK_FILM }
                }
                Purpose::Film { film, .. } if !is_visibility => Then::Film { slot: film },
                _ => continue,
            };
            let soft = frame.soft[job].as_ref().map(|s| s.layers.clone());
            steps.push(Step { job, soft, exempt: exempt_from.light(draws, purpose.light(frame.lights)), then });
        }
        // Without volumes nobody asks what they may fall on.
        let volumes_matter = !steps.is_empty();
        let seen = opaque.iter().filter(|_| volumes_matter).flat_map(|d| draws.visible.of(d)).map(|i| *i as usize);
        let mut sight = Sight::new(view, jobs::receivers(seen.clone(), frame.scene)).at(origin);
        if volumes_matter
            && frame.bounds_depth
            && let Some(surfaces) = jobs::seen(seen, frame.scene, &view.view_from_world)
        {
            sight = sight.with(surfaces);
        }
        let in_base = match shown {
            Some(place) => usize::from(place < frame.lights.in_surface_pass),
            None if is_visibility => 0,
            None => frame.lights.in_surface_pass,
        };
        // Behind the lights of the surface pass follows the first one that volumes mask.
        let shades_once =
            !is_visibility && steps.first().is_some_and(|s: &Step| s.soft.is_none() && matches!(s.then, Then::Light { .. }));
        let has_own_shader = |d: &Draw| draws.batches()[d.batch as usize].kind.shader != STANDARD;
        plans.push(ViewPlan {
            picture: number,
            layer,
            rect,
            channels,
            size: view.size,
            origin,
            is_visibility,
            base_slot: slot_with(0, in_base),
            lit_slot: shades_once.then(|| slot_with(0, in_base + 1)),
            first_pass: match shades_once {
                true if in_base > 0 || opaque.iter().any(has_own_shader) => Pass::Depth,
                true => Pass::Base,
                false if is_visibility => Pass::Visibility,
                false => Pass::Base,
            },
            blend_slot: slot_with(0, frame.lights.order.len()),
            opaque,
            blended,
            contoured,
            sight,
            shading_shadow: Vec::new(),
            steps,
        });
    }
    plans
}

/// Shapes on which a light's shadow does not fall. Lights that no shape lists share one answer.
struct Exempt<'a> {
    scene: &'a Scene,
    clip_from_world: &'a Mat4,
    known: HashMap<Option<usize>, Arc<[Draw]>>,
}

impl Exempt<'_> {
    fn light(&mut self, draws: &mut Draws, light: usize) -> Arc<[Draw]> {
        let key = (!self.scene.receive_lists.is_empty()).then_some(light);
        let (scene, clip_from_world) = (self.scene, self.clip_from_world);
        let find = || draws.surfaces_where(clip_from_world, |i| !falls_on(scene, light, i)).draws;
        self.known.entry(key).or_insert_with(find).clone()
    }
}

/// Place in the GPU's list of the light that a visibility picture shows.
fn shown_light(picture: &Picture, frame: &Frame<'_>, problems: &mut Problems) -> Option<usize> {
    let PictureKind::LightVisibility(light) = picture.kind else { return None };
    let place = frame.lights.place_of(light);
    if place.is_none() {
        problems.report(format!(
            "picture '{}' shows light {light}, but the scene has {} lights that shine",
            picture.name,
            frame.lights.order.len()
        ));
    }
    place
}

fn what_is_wrong(view: &View, limit: u32) -> Option<String> {
    let [width, height] = view.size;
    if width == 0 || height == 0 || width > limit || height > limit {
        return Some(format!("is {width} x {height}: the device takes 1 to {limit} each way"));
    }
    let f = &view.frustum;
    if !(f.right > f.left && f.top > f.bottom && f.near > 0.0) {
        return Some(format!("has a frustum without content: {f:?}"));
    }
    if !view.view_from_world.is_finite() || view.view_from_world.determinant() == 0.0 {
        return Some("has a matrix that cannot be inverted".to_owned());
    }
    None
}

fn uniform_of(view: &View, rect: Rect, scene: &Scene) -> uniforms::View {
    let clip_from_world: Mat4 = view.frustum.clip_from_view() * view.view_from_world;
    let eye = view.view_from_world.inverse().transform_point3(Vec3::ZERO);
    uniforms::View {
        clip_from_world: clip_from_world.to_cols_array_2d(),
        world_from_clip: clip_from_world.inverse().to_cols_array_2d(),
        view_from_world: view.view_from_world.to_cols_array_2d(),
        eye_in_world: eye.extend(1.0).to_array(),
        viewport: [rect.x as f32, rect.y as f32, rect.width as f32, rect.height as f32],
        window: [0.0; 4],
        first_light: 0,
        light_count: 0,
        exposure: scene.exposure,
        shown_light: 0,
        first_sample: match scene.samples {
            Samples::One => [0.0; 2],
            // The standard sample locations of Vulkan, Metal and Direct3D.
            Samples::Four => [-0.125, -0.375],
        },
        spare: [0; 2],
        lights: bytemuck::Zeroable::zeroed(),
    }
}
