//! Examines the meshes of a model or a world, mends those of a model where it is asked to, and shows what it did.

mod picture;

use crate::cli::Doctor;
use crate::session::Session;
use glam::Mat4;
use std::collections::HashSet;
use std::path::Path;
use std::sync::Arc;
use umbriel_scene::doctor::{Mended, Steps, examine, mend, natural_weld_m};
use umbriel_scene::{Mesh, Topology};
use umbriel_scenegraph::gltf::{LoadOptions, Objects};

type Failure = Box<dyn std::error::Error>;

/// A mesh under examination.
struct Patient {
    label: String,
    path: String,
    mesh: Mesh,
    scene_from_mesh: Mat4,
}

/// Prints a report per mesh; gives the number of meshes that are not sound in the end.
pub(crate) fn run(args: &Doctor) -> Result<usize, Failure> {
    let is_world = args.path.extension().is_some_and(|e| e.eq_ignore_ascii_case("rhai"));
    if is_world && args.out.is_some() {
        return Err(format!("{}: a world is examined only; mend the models that it loads", args.path.display()).into());
    }
    if args.out.as_ref().is_some_and(|out| !out.extension().is_some_and(|e| e.eq_ignore_ascii_case("glb"))) {
        return Err("--out: models are written as .glb".into());
    }
    let file = if is_world { None } else { Some(Objects::read(&args.path, &LoadOptions::default())?) };
    for warning in file.iter().flat_map(|f| &f.warnings) {
        tracing::warn!("{}: {warning}", args.path.display());
    }
    let patients = match &file {
        Some(file) => of_file(file),
        None => of_world(&args.path)?,
    };
    let treated: Vec<Option<Mended>> = patients.iter().map(|p| treat(p, args)).collect();
    let unsound = summary(&patients, &treated);
    if let (Some(out), Some(file)) = (&args.out, &file) {
        let (bytes, left_outside) = file.write(&treated)?;
        left_outside.iter().for_each(|what| tracing::warn!("{}: {what}", out.display()));
        std::fs::write(out, &bytes).map_err(|e| format!("{}: {e}", out.display()))?;
        say!("written {}: {} bytes", out.display(), bytes.len());
    }
    if let Some(path) = &args.picture {
        let before: Vec<(Mesh, Mat4)> = patients.iter().map(|p| (p.mesh.clone(), p.scene_from_mesh)).collect();
        let after = patients
            .iter()
            .zip(&treated)
            .map(|(p, mended)| (mended.as_ref().map_or_else(|| p.mesh.clone(), |m| m.apply(&p.mesh)), p.scene_from_mesh));
        picture::write(path, &before, &after.collect::<Vec<_>>())?;
        say!(
            "written {}: before and after; red: open, magenta: more than two triangles, yellow: wound against each other, blue: backs",
            path.display()
        );
    }
    Ok(unsound)
}

fn of_file(file: &Objects) -> Vec<Patient> {
    let patient = |o: &umbriel_scenegraph::gltf::Object| Patient {
        label: o.label.clone(),
        path: o.path.clone(),
        mesh: o.mesh.clone(),
        scene_from_mesh: o.scene_from_mesh,
    };
    file.list.iter().map(patient).collect()
}

/// Every mesh that a world shows at its start, once.
fn of_world(path: &Path) -> Result<Vec<Patient>, Failure> {
    let mut session = Session::open(path)?;
    session.step(0.0);
    session.problems().iter().for_each(|problem| tracing::error!("{problem}"));
    let mut seen = HashSet::new();
    let shown = session.scene().drawables.iter().filter(|d| d.visible && seen.insert(Arc::as_ptr(&d.mesh)));
    let patient = |d: &umbriel_scene::Drawable| Patient {
        label: format!("'{}'", d.mesh.name),
        path: d.name.clone(),
        mesh: Mesh::clone(&d.mesh),
        scene_from_mesh: d.world_from_object,
    };
    Ok(shown.map(patient).collect())
}

/// The steps that the command line asks for.
fn steps(args: &Doctor, mesh: &Mesh) -> Steps {
    let natural = natural_weld_m(mesh);
    let weld = args.weld.or(args.all.then_some(None)).map(|m| m.unwrap_or(natural));
    Steps {
        weld_m: weld,
        drop: args.drop || args.all,
        stitch: args.stitch || args.all,
        split: args.split || args.all,
        orient: args.orient || args.all,
        cap: args.cap || args.all,
    }
}

/// Reports on one mesh, and mends it where that is asked for.
fn treat(patient: &Patient, args: &Doctor) -> Option<Mended> {
    let Patient { label, path, mesh, .. } = patient;
    let place = if path.is_empty() { String::new() } else { format!(" at {path}") };
    if mesh.topology != Topology::Triangles {
        say!("{label}{place}\n  {:?}: not examined", mesh.topology);
        return None;
    }
    let steps = steps(args, mesh);
    let findings = examine(mesh, steps.weld_m.unwrap_or_else(|| natural_weld_m(mesh)));
    let deforms = if mesh.joints.is_empty() && mesh.morph_targets.is_empty() { "" } else { "  it deforms; examined at rest\n" };
    say!("{label}{place}\n{deforms}{}", indented(&findings.to_string()));
    if steps.is_none() {
        return None;
    }
    let mended = mend(mesh, &steps);
    say!("  mended: {}", mended.done);
    if !mended.is_unchanged() {
        say!("{}", indented(&mended.findings.to_string()));
    }
    Some(mended)
}

fn indented(text: &str) -> String {
    text.lines().map(|line| format!("  {line}")).collect::<Vec<_>>().join("\n")
}

/// Prints the totals; gives the number of meshes with triangles that are not sound.
fn summary(patients: &[Patient], treated: &[Option<Mended>]) -> usize {
    let meshes: Vec<usize> = (0..patients.len()).filter(|i| patients[*i].mesh.topology == Topology::Triangles).collect();
    let before: Vec<_> = meshes.iter().map(|i| examine(&patients[*i].mesh, 0.0)).collect();
    let count = |is: &dyn Fn(&umbriel_scene::doctor::Findings) -> bool| before.iter().filter(|f| is(f)).count();
    say!(
        "meshes={} sound={} closed={} two_manifold={} oriented={}",
        meshes.len(),
        count(&|f| f.is_sound()),
        count(&|f| f.is_closed()),
        count(&|f| f.is_two_manifold()),
        count(&|f| f.is_oriented())
    );
    if !treated.iter().any(Option::is_some) {
        return meshes.len() - count(&|f| f.is_sound());
    }
    let sound = meshes.iter().filter(|i| treated[**i].as_ref().is_some_and(|m| m.findings.is_sound())).count();
    say!("mended: meshes={} sound={sound}", meshes.len());
    meshes.len() - sound
}
