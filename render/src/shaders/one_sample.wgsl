// Views have one sample per pixel.
alias Depths = texture_depth_2d;
alias Stencils = texture_2d<u32>;
const SAMPLES = 1;
