//! The vertices and indices of primitives, as the author made them: nothing is re-triangulated or reordered.

use super::accessor::{Accessors, name_of};
use super::error::{Fault, label};
use super::topology::{Topology, expand};
use glam::{Vec2, Vec3, Vec4};
use gltf::accessor::{Accessor, Dimensions};
use gltf::mesh::{Primitive, Semantic};
use std::collections::HashMap;
use std::sync::Arc;

/// One primitive, in the types of the fields of a `Mesh` node.
pub(crate) struct Surface {
    pub(crate) topology: Topology,
    pub(crate) position: Arc<[Vec3]>,
    pub(crate) normal: Arc<[Vec3]>,
    pub(crate) tangent: Arc<[Vec4]>,
    /// First and second texture coordinates.
    pub(crate) tex_coord: [Arc<[Vec2]>; 2],
    pub(crate) color: Arc<[Vec4]>,
    /// Four per vertex.
    pub(crate) joint: Arc<[i32]>,
    pub(crate) weight: Arc<[Vec4]>,
    pub(crate) index: Arc<[i32]>,
    pub(crate) targets: Vec<Target>,
    /// The largest joint with a weight.
    pub(crate) last_joint: Option<usize>,
}

/// Offsets of one morph target.
pub(crate) struct Target {
    pub(crate) position: Arc<[Vec3]>,
    pub(crate) normal: Arc<[Vec3]>,
    pub(crate) tangent: Arc<[Vec3]>,
}

/// Decodes primitives; an accessor that several primitives share is decoded and kept once.
pub(crate) struct Surfaces<'a> {
    accessors: Accessors<'a>,
    vec2: HashMap<usize, Arc<[Vec2]>>,
    vec3: HashMap<usize, Arc<[Vec3]>>,
    vec4: HashMap<usize, Arc<[Vec4]>>,
    pub(crate) warnings: Vec<String>,
}

impl<'a> Surfaces<'a> {
    pub(crate) fn new(accessors: Accessors<'a>) -> Surfaces<'a> {
        Surfaces { accessors, vec2: HashMap::new(), vec3: HashMap::new(), vec4: HashMap::new(), warnings: Vec::new() }
    }

    /// The primitive's surface; `None` (and a warning) where there is nothing to draw.
    pub(crate) fn read(&mut self, mesh: &gltf::Mesh<'_>, primitive: &Primitive<'_>) -> Result<Option<Surface>, Fault> {
        let object = format!("{}, primitive {}", label("mesh", mesh.index(), mesh.name()), primitive.index());
        let Some(positions) = primitive.get(&Semantic::Positions) else {
            self.warnings.push(format!("{object}: it has no POSITION and is left out"));
            return Ok(None);
        };
        let position = self.vec3(&positions, None)?;
        let vertices = position.len();
        let given = match primitive.indices() {
            Some(accessor) => self.indices(&object, &accessor, vertices)?,
            None => (0..vertices as i32).collect(),
        };
        let (topology, index, rest) = expand(primitive.mode(), given);
        if rest > 0 {
            self.warnings.push(format!("{object}: its last {rest} indices make no whole primitive and are left out"));
        }
        if index.is_empty() {
            self.warnings.push(format!("{object}: it is empty and left out"));
            return Ok(None);
        }
        self.accessors.budget.take(4 * index.len() as u64, &object)?;
        self.warn_unread(&object, primitive);
        let part = Part { object: &object, vertices };
        let Influences { joint, weight, last: last_joint } = self.influences(&part, primitive)?;
        let surface = Surface {
            topology,
            normal: self.attribute3(&part, primitive.get(&Semantic::Normals), Vec3::Y)?,
            tangent: self.attribute4(
                &part,
                primitive.get(&Semantic::Tangents),
                &[Dimensions::Vec4],
                Vec4::new(1.0, 0.0, 0.0, 1.0),
            )?,
            tex_coord: [
                self.attribute2(&part, primitive.get(&Semantic::TexCoords(0)))?,
                self.attribute2(&part, primitive.get(&Semantic::TexCoords(1)))?,
            ],
            color: self.attribute4(
                &part,
                primitive.get(&Semantic::Colors(0)),
                &[Dimensions::Vec3, Dimensions::Vec4],
                Vec4::ONE,
            )?,
            joint,
            weight,
            last_joint,
            targets: self.targets(&part, primitive)?,
            index: index.into(),
            position,
        };
        Ok(Some(surface))
    }

    fn indices(&self, object: &str, accessor: &Accessor<'_>, vertices: usize) -> Result<Vec<i32>, Fault> {
        let indices = self.accessors.integers::<1>(accessor, Dimensions::Scalar)?;
        match indices.iter().position(|[i]| *i as usize >= vertices) {
            None => Ok(indices.into_iter().map(|[i]| i as i32).collect()),
            Some(place) => {
                let message =
                    format!("index {} at place {place} is outside of the {vertices} vertices of {object}", indices[place][0]);
                Err(Fault::data(name_of(accessor), message))
            }
        }
    }

    fn targets(&mut self, part: &Part<'_>, primitive: &Primitive<'_>) -> Result<Vec<Target>, Fault> {
        let read = |target: gltf::mesh::MorphTarget<'_>| {
            Ok(Target {
                position: self.attribute3(part, target.positions(), Vec3::ZERO)?,
                normal: self.attribute3(part, target.normals(), Vec3::ZERO)?,
                tangent: self.attribute3(part, target.tangents(), Vec3::ZERO)?,
            })
        };
        primitive.morph_targets().map(read).collect()
    }

    /// Joints and weights: of all sets, the four strongest per vertex, with weights that sum to 1.
    fn influences(&mut self, part: &Part<'_>, primitive: &Primitive<'_>) -> Result<Influences, Fault> {
        let mut sets = Vec::new();
        let set = |n: usize| Some((primitive.get(&Semantic::Joints(n as u32))?, primitive.get(&Semantic::Weights(n as u32))?));
        while let Some((joints, weights)) = set(sets.len()) {
            part.check(&joints, joints.count())?;
            part.check(&weights, weights.count())?;
            let joints = self.accessors.integers::<4>(&joints, Dimensions::Vec4)?;
            sets.push((joints, self.accessors.floats::<4>(&weights, &[Dimensions::Vec4])?));
        }
        let mut out = Influences::default();
        if sets.is_empty() {
            return Ok(out);
        }
        if sets.len() > 1 {
            self.warnings.push(format!("{}: of its {} joints per vertex the 4 strongest are used", part.object, 4 * sets.len()));
        }
        let (mut joint, mut weight) = (Vec::with_capacity(4 * part.vertices), Vec::with_capacity(part.vertices));
        let mut vertex = Vec::new();
        for v in 0..part.vertices {
            vertex.clear();
            vertex.extend(sets.iter().flat_map(|(j, w)| j[v].into_iter().zip(w[v])));
            if sets.len() > 1 {
                vertex.sort_by(|a, b| b.1.total_cmp(&a.1));
            }
            let mut w = Vec4::from_array(std::array::from_fn(|i| vertex[i].1)).max(Vec4::ZERO);
            w = if w.element_sum() > 0.0 { w / w.element_sum() } else { Vec4::X };
            for (i, (j, _)) in vertex.iter().take(4).enumerate() {
                let used = w[i] > 0.0; // joints without weight may be out of range
                joint.push(if used { *j as i32 } else { 0 });
                out.last = out.last.max(used.then_some(*j as usize));
            }
            weight.push(w);
        }
        (out.joint, out.weight) = (joint.into(), weight.into());
        Ok(out)
    }

    fn warn_unread(&mut self, object: &str, primitive: &Primitive<'_>) {
        for (semantic, _) in primitive.attributes() {
            if let Semantic::TexCoords(2..) | Semantic::Colors(1..) = semantic {
                self.warnings.push(format!("{object}: its {} is not used", semantic.to_string()));
            }
        }
    }

    fn attribute2(&mut self, part: &Part<'_>, accessor: Option<Accessor<'_>>) -> Result<Arc<[Vec2]>, Fault> {
        let Some(accessor) = accessor else { return Ok(Arc::default()) };
        part.check(&accessor, accessor.count())?;
        if let Some(known) = self.vec2.get(&accessor.index()) {
            return Ok(known.clone());
        }
        let (values, broken) = self.accessors.floats_or(&accessor, &[Dimensions::Vec2], [0.0; 2])?;
        self.warn_broken(&accessor, broken);
        let values: Arc<[Vec2]> = values.into_iter().map(Vec2::from_array).collect();
        self.vec2.insert(accessor.index(), values.clone());
        Ok(values)
    }

    fn attribute3(&mut self, part: &Part<'_>, accessor: Option<Accessor<'_>>, spare: Vec3) -> Result<Arc<[Vec3]>, Fault> {
        let Some(accessor) = accessor else { return Ok(Arc::default()) };
        part.check(&accessor, accessor.count())?;
        self.vec3(&accessor, Some(spare))
    }

    /// Without a `spare`, values that are not finite are an error.
    fn vec3(&mut self, accessor: &Accessor<'_>, spare: Option<Vec3>) -> Result<Arc<[Vec3]>, Fault> {
        if let Some(known) = self.vec3.get(&accessor.index()) {
            return Ok(known.clone());
        }
        let values = match spare {
            None => self.accessors.floats(accessor, &[Dimensions::Vec3])?,
            Some(spare) => {
                let (values, broken) = self.accessors.floats_or(accessor, &[Dimensions::Vec3], spare.to_array())?;
                self.warn_broken(accessor, broken);
                values
            }
        };
        let values: Arc<[Vec3]> = values.into_iter().map(Vec3::from_array).collect();
        self.vec3.insert(accessor.index(), values.clone());
        Ok(values)
    }

    fn attribute4(
        &mut self,
        part: &Part<'_>,
        accessor: Option<Accessor<'_>>,
        shapes: &[Dimensions],
        spare: Vec4,
    ) -> Result<Arc<[Vec4]>, Fault> {
        let Some(accessor) = accessor else { return Ok(Arc::default()) };
        part.check(&accessor, accessor.count())?;
        if let Some(known) = self.vec4.get(&accessor.index()) {
            return Ok(known.clone());
        }
        let (values, broken) = self.accessors.floats_or(&accessor, shapes, spare.to_array())?;
        self.warn_broken(&accessor, broken);
        let values: Arc<[Vec4]> = values.into_iter().map(Vec4::from_array).collect();
        self.vec4.insert(accessor.index(), values.clone());
        Ok(values)
    }

    fn warn_broken(&mut self, accessor: &Accessor<'_>, broken: Option<usize>) {
        if let Some(first) = broken {
            self.warnings.push(format!("{}: element {first} is not finite; such values are replaced", name_of(accessor)));
        }
    }
}

/// Joints and weights of a surface.
#[derive(Default)]
struct Influences {
    joint: Arc<[i32]>,
    weight: Arc<[Vec4]>,
    last: Option<usize>,
}

/// The primitive that an attribute belongs to.
struct Part<'a> {
    object: &'a str,
    vertices: usize,
}

impl Part<'_> {
    fn check(&self, accessor: &Accessor<'_>, count: usize) -> Result<(), Fault> {
        if count == self.vertices {
            return Ok(());
        }
        Err(Fault::data(name_of(accessor), format!("has {count} elements where {} has {} vertices", self.object, self.vertices)))
    }
}
