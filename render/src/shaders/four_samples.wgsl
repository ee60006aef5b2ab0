// Views have four samples per pixel.
alias Depths = texture_depth_multisampled_2d;
alias Stencils = texture_multisampled_2d<u32>;
const SAMPLES = 4;
