// The standard sample locations of Vulkan, Metal and Direct3D, from the middle of the pixel, pixels right and down.
const SAMPLES_X = vec4<f32>(-0.125, 0.375, -0.375, 0.125);
const SAMPLES_Y = vec4<f32>(-0.375, -0.125, 0.125, 0.375);
