//! Shadow maps as pictures for people.

use super::Maps;
use crate::Error;
use crate::read_back::{self, GreyPixels};

/// Grey of the farthest surface; what is darker is nothing.
const FARTHEST: f32 = 40.0;

impl Maps {
    /// The maps of one light.
    pub(crate) fn pictures(&self, device: &wgpu::Device, queue: &wgpu::Queue, light: usize) -> Result<Vec<GreyPixels>, Error> {
        let faces = self.faces.iter().filter(|f| f.light == light);
        faces
            .map(|face| {
                let bytes = read_back::layer(device, queue, &self.texture, face.place[2])?;
                let (row, size) = (self.texture.width() as usize, face.size as usize);
                let [left, top] = [face.place[0], face.place[1]].map(|v| v as usize);
                let texel = |i: usize| {
                    let at = 4 * ((top + i / size) * row + left + i % size);
                    f32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
                };
                let depths: Vec<f32> = (0..size * size).map(texel).collect();
                Ok(GreyPixels { width: face.size, height: face.size, grey: greys(&depths, face.projection.eye.w > 0.5) })
            })
            .collect()
    }
}

/// Reversed depth 0 is nothing. Seen from a position, depth is one over distance.
fn greys(depths: &[f32], from_position: bool) -> Vec<u8> {
    let distance = |d: f32| if from_position { 1.0 / d } else { 1.0 - d };
    let there = || depths.iter().filter(|d| **d > 0.0).map(|d| distance(*d));
    let (near, far) = (there().fold(f32::INFINITY, f32::min), there().fold(0.0, f32::max));
    let grey = |d: &f32| {
        let share = (far - distance(*d)) / (far - near).max(1e-20);
        if *d > 0.0 { (FARTHEST + share * (255.0 - FARTHEST)) as u8 } else { 0 }
    };
    depths.iter().map(grey).collect()
}

#[cfg(test)]
mod tests {
    #[test]
    fn grey_follows_distance() {
        assert_eq!(super::greys(&[1.0, 0.5, 0.25, 0.0], true), [255, 183, 40, 0]);
        assert_eq!(super::greys(&[1.0, 0.5, 0.0], false), [255, 40, 0]);
    }
}
