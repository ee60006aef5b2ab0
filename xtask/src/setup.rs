//! Finds a Vulkan driver, and on Debian installs the software one where there is none.
//!
//! Debian 12's own Mesa (22.3) draws clipped triangles into the wrong view under multiview, so its backports' Mesa is
//! used there; the mirror is taken from the machine's own apt sources.

use crate::apt;
use std::path::{Path, PathBuf};
use std::process::Command;

/// What the machine must be able to do.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Need {
    /// Draw to files.
    Pictures,
    /// Draw to files, and open windows on a virtual screen.
    PicturesAndWindows,
}

/// The oldest Mesa whose software driver draws right.
const OLDEST_GOOD_MESA: u32 = 25;

const WINDOW_PACKAGES: [&str; 6] = ["xvfb", "libx11-xcb1", "libxcursor1", "libxi6", "libxrandr2", "libxkbcommon-x11-0"];

/// Makes sure that what is needed is there; asks before it installs anything unless `yes`.
pub(crate) fn ensure(need: Need, yes: bool) -> Result<(), String> {
    if !cfg!(target_os = "linux") {
        return Ok(()); // Metal and Direct3D come with the system
    }
    let mut packages: Vec<&str> = Vec::new();
    let mut from_backports = false;
    match driver() {
        Driver::Hardware(name) => println!("graphics: {name}"),
        Driver::Software { major: Some(major) } if major >= OLDEST_GOOD_MESA => {
            println!("graphics: software driver of Mesa {major}")
        }
        found => {
            println!("graphics: {}", found.describe());
            from_backports = apt::debian_codename().as_deref() == Some("bookworm");
            packages.extend(["libvulkan1", "mesa-vulkan-drivers"]);
        }
    }
    if need == Need::PicturesAndWindows {
        packages.extend(WINDOW_PACKAGES.into_iter().filter(|p| !apt::installed(p)));
    }
    if packages.is_empty() {
        return Ok(());
    }
    if !apt::available() {
        return Err(format!(
            "No usable Vulkan driver was found, and this is no Debian or Ubuntu.\nInstall a Vulkan loader and driver: the one of your graphics \
             card, or Mesa's software driver, version {OLDEST_GOOD_MESA} or later\n  Fedora: dnf install vulkan-loader mesa-vulkan-drivers xorg-x11-server-Xvfb\n  \
             Arch:   pacman -S vulkan-icd-loader vulkan-swrast xorg-server-xvfb"
        ));
    }
    apt::install(&packages, from_backports, yes)?;
    match driver() {
        Driver::None => Err("The packages are installed, but no Vulkan driver is found.".to_string()),
        Driver::Software { major: Some(major) } if major < OLDEST_GOOD_MESA => Err(format!(
            "Mesa {major} is too old: its software driver needs version {OLDEST_GOOD_MESA} or later. Install a newer mesa-vulkan-drivers."
        )),
        _ => Ok(()),
    }
}

enum Driver {
    Hardware(String),
    Software { major: Option<u32> },
    None,
}

impl Driver {
    fn describe(&self) -> String {
        match self {
            Driver::Hardware(name) => name.clone(),
            Driver::Software { major: Some(major) } => format!("the software driver of Mesa {major}, which is too old"),
            Driver::Software { major: None } => "a software driver of unknown version".to_string(),
            Driver::None => "no Vulkan driver found".to_string(),
        }
    }
}

fn driver() -> Driver {
    if !has_loader() {
        return Driver::None;
    }
    let manifests = manifests();
    let has_device = Path::new("/dev/dri").exists() || Path::new("/dev/nvidia0").exists() || Path::new("/dev/dxg").exists();
    let hardware = manifests.iter().filter_map(|p| p.file_stem()?.to_str()).find(|n| !n.starts_with("lvp"));
    match (hardware, manifests.is_empty()) {
        (Some(name), _) if has_device => Driver::Hardware(format!("Vulkan driver '{name}'")),
        (_, true) => Driver::None,
        _ => Driver::Software { major: mesa_major() },
    }
}

fn has_loader() -> bool {
    let listed = Command::new("ldconfig").arg("-p").output().or_else(|_| Command::new("/sbin/ldconfig").arg("-p").output());
    listed.is_ok_and(|o| String::from_utf8_lossy(&o.stdout).contains("libvulkan.so.1"))
}

/// The driver manifests that the Vulkan loader would read.
fn manifests() -> Vec<PathBuf> {
    for variable in ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"] {
        if let Some(list) = std::env::var_os(variable) {
            return std::env::split_paths(&list).filter(|p| p.exists()).collect();
        }
    }
    let folders =
        ["/usr/share/vulkan/icd.d", "/usr/local/share/vulkan/icd.d", "/etc/vulkan/icd.d", "/usr/local/etc/vulkan/icd.d"];
    folders.iter().filter_map(|f| std::fs::read_dir(f).ok()).flatten().filter_map(|e| Some(e.ok()?.path())).collect()
}

fn mesa_major() -> Option<u32> {
    apt::version("mesa-vulkan-drivers").and_then(|v| v.split('.').next()?.parse().ok())
}
