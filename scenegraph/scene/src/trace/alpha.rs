//! Surfaces that are cut out by the alpha of their texture.

use crate::{AlphaMode, Filter, Image, Material, Mesh, TextureRef, Wrap};
use glam::Vec2;
use std::sync::Arc;

/// What decides whether a point of a shape is there.
pub(super) struct Cutout {
    cutoff: f32,
    /// Alpha of the base colour.
    factor: f32,
    /// Alpha of the vertex colours; empty where there are none.
    vertices: Vec<f32>,
    texture: Option<(TextureRef, Arc<[Vec2]>)>,
    indices: Arc<[u32]>,
}

impl Cutout {
    /// `None` for materials that are not masked.
    pub(super) fn of(mesh: &Mesh, material: &Material) -> Option<Cutout> {
        let AlphaMode::Mask { cutoff } = material.alpha else { return None };
        let texture = material.base_color_texture.as_ref().map(|texture| {
            let uv = if texture.uv_set == 0 { &mesh.uv0 } else { &mesh.uv1 };
            (texture.clone(), uv.clone())
        });
        Some(Cutout {
            cutoff,
            factor: material.base_color.w,
            vertices: mesh.colors.iter().map(|c| c.w).collect(),
            texture,
            indices: mesh.indices.clone(),
        })
    }

    /// Is the point of a triangle with these weights of its corners there?
    pub(super) fn is_there(&self, triangle: u32, weights: [f64; 3]) -> bool {
        let first = triangle as usize * 3;
        let corners = self.indices.get(first..first + 3).unwrap_or_default();
        let mix = |of: &dyn Fn(usize) -> Option<Vec2>, default: Vec2| {
            let values = corners.iter().map(|&i| of(i as usize).unwrap_or(default));
            values.zip(weights).fold(Vec2::ZERO, |sum, (value, w)| sum + value * w as f32)
        };
        let vertex = mix(&|i| self.vertices.get(i).map(|a| Vec2::splat(*a)), Vec2::ONE).x;
        let texel = self.texture.as_ref().map_or(1.0, |(texture, uv)| alpha(texture, mix(&|i| uv.get(i).copied(), Vec2::ZERO)));
        self.factor * vertex * texel >= self.cutoff
    }
}

/// The alpha, 0..=1, of a texture at the mesh's coordinates `uv`, from the picture at its full size.
fn alpha(texture: &TextureRef, uv: Vec2) -> f32 {
    let image = &*texture.image;
    let at = texture.uv_from_mesh.transform_point2(uv) * Vec2::new(image.width as f32, image.height as f32);
    let texel = |x: f32, y: f32| {
        let x = wrapped(x, image.width, texture.sampler.wrap_u);
        let y = wrapped(y, image.height, texture.sampler.wrap_v);
        alpha_of_texel(image, x, y)
    };
    match texture.sampler.filter {
        Filter::Nearest => texel(at.x.floor(), at.y.floor()),
        Filter::Linear => {
            let corner = (at - 0.5).floor();
            let part = at - 0.5 - corner;
            let row = |y: f32| texel(corner.x, y) * (1.0 - part.x) + texel(corner.x + 1.0, y) * part.x;
            row(corner.y) * (1.0 - part.y) + row(corner.y + 1.0) * part.y
        }
    }
}

/// The texel that stands for the one at `place`, which may be outside of `0..size`.
fn wrapped(place: f32, size: u32, wrap: Wrap) -> usize {
    let (place, size) = (place as i64, i64::from(size.max(1)));
    let inside = match wrap {
        Wrap::Repeat => place.rem_euclid(size),
        Wrap::Mirror => {
            let twice = place.rem_euclid(2 * size);
            if twice < size { twice } else { 2 * size - 1 - twice }
        }
        Wrap::Clamp => place.clamp(0, size - 1),
    };
    inside as usize
}

/// Texels that the picture lacks are opaque.
fn alpha_of_texel(image: &Image, x: usize, y: usize) -> f32 {
    image.rgba.get((y * image.width as usize + x) * 4 + 3).map_or(1.0, |a| f32::from(*a) / 255.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Sampler;
    use glam::{Affine2, vec2};

    #[test]
    fn samples_as_a_gpu_does() {
        // Alphas of 2 x 2 texels: 0 and 1 above, 0.2 and 0.4 below.
        let rgba: Vec<u8> = [0, 255, 51, 102].into_iter().flat_map(|a| [9, 9, 9, a]).collect();
        let image = Arc::new(Image { width: 2, height: 2, rgba: rgba.into() });
        let rows = [
            (Filter::Nearest, Wrap::Repeat, vec2(0.25, 0.25), 0.0),
            (Filter::Nearest, Wrap::Repeat, vec2(0.75, 0.25), 1.0),
            (Filter::Nearest, Wrap::Repeat, vec2(-0.25, 1.75), 0.4),
            (Filter::Nearest, Wrap::Mirror, vec2(-0.25, 0.75), 0.2),
            (Filter::Nearest, Wrap::Mirror, vec2(1.25, 0.75), 0.4),
            (Filter::Nearest, Wrap::Clamp, vec2(9.0, -9.0), 1.0),
            (Filter::Nearest, Wrap::Clamp, vec2(f32::NAN, f32::INFINITY), 0.0),
            (Filter::Linear, Wrap::Clamp, vec2(0.5, 0.25), 0.5),
            (Filter::Linear, Wrap::Clamp, vec2(0.0, 0.25), 0.0),
            (Filter::Linear, Wrap::Repeat, vec2(0.0, 0.25), 0.5),
            (Filter::Linear, Wrap::Clamp, vec2(0.5, 0.5), 0.4),
        ];
        for (filter, wrap, uv, expected) in rows {
            let sampler = Sampler { wrap_u: wrap, wrap_v: wrap, filter, mip_maps: false };
            let texture = TextureRef { image: image.clone(), sampler, uv_set: 0, uv_from_mesh: Affine2::IDENTITY };
            let found = alpha(&texture, uv);
            assert!((found - expected).abs() < 1e-6, "{filter:?} {wrap:?} {uv}: {found}");
        }
        let turned = TextureRef {
            image,
            sampler: Sampler { filter: Filter::Nearest, ..Sampler::default() },
            uv_set: 0,
            uv_from_mesh: Affine2::from_translation(vec2(0.5, 0.0)),
        };
        assert_eq!(alpha(&turned, vec2(0.25, 0.25)), 1.0);
    }
}
