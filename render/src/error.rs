//! What can go wrong while pictures are made.

/// Why pictures could not be made.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// No device that can draw was found.
    #[error(
        "no usable graphics device: {0}. On Debian install a Vulkan driver: `apt install mesa-vulkan-drivers libvulkan1` \
         (software and Intel/AMD; from bookworm-backports on Debian 12), or the driver package of an NVIDIA card"
    )]
    NoDevice(String),
    /// The device lacks something that every picture needs.
    #[error("graphics device '{device}' lacks {what}; install a newer driver or choose another device")]
    Lacks {
        /// Name of the device.
        device: String,
        /// What it lacks.
        what: String,
    },
    /// There is no such picture in the last frame.
    #[error("there is no picture {index}: the last frame had {count}")]
    NoPicture {
        /// The asked-for place.
        index: usize,
        /// Number of pictures.
        count: usize,
    },
    /// There is no shadow map of that light in the last frame.
    #[error("light {0} had no shadow map in the last frame")]
    NoMap(usize),
    /// The device was lost or ran out of memory.
    #[error("the graphics device failed: {0}")]
    Device(String),
}
