//! Writes the shadow maps of one light as a picture.

use crate::cli::ShadowMap;
use crate::headless::{DESKTOP_SIZE, describe};
use crate::png;
use crate::session::Session;
use umbriel_displays::WindowSizes;
use umbriel_render::{Gpu, GreyPixels, Renderer, RgbaPixels};
use umbriel_scene::ShadowMethod;

type Failure = Box<dyn std::error::Error>;

/// Draws one frame and writes what the light saw; gives the number of problems that were reported.
pub(crate) fn run(args: &ShadowMap) -> Result<usize, Failure> {
    let mut session = Session::open(&args.path)?;
    if args.time > 0.0 {
        session.step(0.0);
    }
    session.step(args.time);
    let pictures = session.pictures(args.view.as_deref(), DESKTOP_SIZE, &WindowSizes::new())?;
    let lights = &session.scene().lights;
    let index = match &args.light {
        Some(name) => session.light_named(name).ok_or_else(|| session.no_light(name))?,
        None => {
            let mapped = lights.iter().position(|l| l.shadows == ShadowMethod::Map);
            mapped.ok_or("no light of this world casts its shadows by a map")?
        }
    };
    let light = &lights[index];
    if light.shadows != ShadowMethod::Map {
        return Err(format!("light '{}' has no shadow map: its shadows are not \"map\"", light.name).into());
    }
    let gpu = Gpu::new(None)?;
    let mut renderer = Renderer::new(&gpu)?;
    renderer.render(session.scene(), &pictures)?;
    let maps: Vec<RgbaPixels> = renderer.shadow_map_picture(index)?.into_iter().map(opaque).collect();
    let out = args.out.clone().unwrap_or_else(|| format!("{}.shadow_map.png", session.name()).into());
    png::write(&out, &png::row(&maps), &describe(&gpu))?;
    say!("{} of light '{}', {} texels wide: {}", count(maps.len()), light.name, maps[0].width, out.display());
    let problems: Vec<String> = session.problems_with(renderer.problems());
    problems.iter().for_each(|problem| tracing::error!("{problem}"));
    Ok(problems.len())
}

fn count(maps: usize) -> String {
    if maps == 1 { "1 map".to_owned() } else { format!("{maps} maps") }
}

fn opaque(map: GreyPixels) -> RgbaPixels {
    let rgba = map.grey.iter().flat_map(|g| [*g, *g, *g, 255]).collect();
    RgbaPixels { width: map.width, height: map.height, rgba }
}
