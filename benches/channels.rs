//! Frames per second of the harbour's bridge: seven channels over 270 degrees, every shadow a stencil volume (001).
//!
//! `cargo bench --bench channels`, or with the pixels of a channel behind `--`, such as `-- 1920x1080`, and
//! names of rows, such as `"1 | volumes | still"`, to draw these alone. The loop is that of the
//! command: the world takes a step, its scene is brought up to date, the rig becomes views, and all of them are drawn; one
//! frame is drawn while the next is made, as in a window. Nothing is written to files. "Sailing" moves the ship, and with it the whole world past the
//! channels, in every frame. Rows are drawn in turns.

mod harbour;

use glam::Vec3;
use std::time::Instant;
use umbriel_displays::WindowSizes;
use umbriel_displays::rig::{Rig, Wanted};
use umbriel_fields::NodeId;
use umbriel_render::{Gpu, Renderer};
use umbriel_scene::{Aabb, Samples, Scene, ShadowMethod};
use umbriel_scenegraph::Extractor;
use umbriel_scripts::World;

const FRAMES: u32 = 12;
const TURNS: u32 = 5;

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

fn main() -> Outcome<()> {
    let size = std::env::args().skip(1).find_map(|a| harbour::size_in(&a)).unwrap_or([320, 256]);
    let gpu = Gpu::new(None)?;
    println!("{}, harbour, seven channels of {}x{}", gpu.info.name, size[0], size[1]);
    let only: Vec<String> = std::env::args().skip(1).filter(|a| a.contains('|')).collect();
    let mut rows = Vec::new();
    for samples in [Samples::One, Samples::Four] {
        for (shadows, method) in [("volumes", Some(ShadowMethod::Volume)), ("none", Some(ShadowMethod::None))] {
            for sails in [false, true] {
                let name = format!("{} | {shadows} | {}", samples.count(), if sails { "sailing" } else { "still" });
                if !only.is_empty() && !only.contains(&name) {
                    continue;
                }
                rows.push((name, Bridge::new(&gpu, size, samples, method, sails)?, Vec::new()));
            }
        }
    }
    for turn in 0..TURNS {
        for (_, bridge, times) in &mut rows {
            let start = Instant::now();
            for _ in 0..FRAMES {
                bridge.frame()?;
            }
            bridge.renderer.wait()?;
            // The first turn makes pipelines.
            if turn > 0 {
                times.push(start.elapsed().as_secs_f64() / f64::from(FRAMES));
            }
        }
    }
    println!("\n| samples | shadows | ship | frames per second, median | ms, median | ms, slowest |\n|---|---|---|---|---|---|");
    for (name, _, times) in &mut rows {
        times.sort_by(f64::total_cmp);
        let (median, slowest) = (times[times.len() / 2], times[times.len() - 1]);
        println!("| {name} | {:.1} | {:.1} | {:.1} |", 1.0 / median, 1e3 * median, 1e3 * slowest);
    }
    Ok(())
}

/// The harbour and what draws it.
struct Bridge {
    world: World,
    deck: NodeId,
    extractor: Extractor,
    scene: Scene,
    rig: Rig,
    renderer: Renderer,
    samples: Samples,
    method: Option<ShadowMethod>,
    sails: bool,
    frame: u32,
}

impl Bridge {
    fn new(gpu: &Gpu, size: [u32; 2], samples: Samples, method: Option<ShadowMethod>, sails: bool) -> Outcome<Bridge> {
        let world = harbour::open(size)?;
        let graph = world.graph();
        let deck = graph.nodes().find(|n| &*graph.type_of(*n).name == "Navigation").ok_or("no deck")?;
        Ok(Bridge {
            world,
            deck,
            extractor: Extractor::new(),
            scene: Scene::default(),
            rig: Rig::new(),
            renderer: Renderer::new(gpu)?,
            samples,
            method,
            sails,
            frame: 0,
        })
    }

    fn frame(&mut self) -> Outcome<()> {
        self.frame += 1;
        if self.sails {
            let along = 0.02 * (self.frame % 200) as f32;
            self.world.graph_mut().set_named(self.deck, "position", Vec3::new(0.0, 9.0, 16.0 - along))?;
        }
        self.world.step(f64::from(self.frame) / 60.0);
        self.extractor.update(self.world.graph(), &mut self.scene);
        self.scene.samples = self.samples;
        for light in &mut self.scene.lights {
            light.shadows = self.method.unwrap_or(light.shadows);
        }
        let wanted = Wanted { view: None, size: [320, 256], windows: &WindowSizes::new() };
        let pictures = self.rig.pictures(self.world.graph(), self.extractor.viewpoints(), &Aabb::EMPTY, &wanted)?.pictures;
        self.renderer.render(&self.scene, &pictures)?;
        self.renderer.wait_for_room()?;
        Ok(())
    }
}
