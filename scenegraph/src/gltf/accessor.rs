//! Typed values behind accessors (glTF 2.0 specification, section 3.6.2), with every bound checked.

use super::budget::Budget;
use super::error::{Fault, label};
use super::read::Source;
use gltf::accessor::{Accessor, DataType, Dimensions};
use gltf::buffer::View;

/// Reads accessors of one file.
pub(crate) struct Accessors<'a> {
    pub(crate) source: &'a Source,
    pub(crate) budget: &'a Budget,
}

/// The elements of an accessor without gaps.
pub(crate) struct Packed {
    pub(crate) bytes: Vec<u8>,
    pub(crate) kind: DataType,
    pub(crate) normalized: bool,
}

impl<'a> Accessors<'a> {
    /// Floats in groups of `N`, integers turned to floats as the accessor says. Values that are not finite are errors.
    pub(crate) fn floats<const N: usize>(&self, accessor: &Accessor<'_>, shapes: &[Dimensions]) -> Result<Vec<[f32; N]>, Fault> {
        let (values, broken) = self.floats_or(accessor, shapes, [f32::NAN; N])?;
        match broken {
            Some(i) => Err(Fault::data(name_of(accessor), format!("element {i} is not finite"))),
            None => Ok(values),
        }
    }

    /// As [`Accessors::floats`], with `spare` in place of elements that are not finite; also gives the first such place.
    pub(crate) fn floats_or<const N: usize>(
        &self,
        accessor: &Accessor<'_>,
        shapes: &[Dimensions],
        spare: [f32; N],
    ) -> Result<(Vec<[f32; N]>, Option<usize>), Fault> {
        let object = name_of(accessor);
        if !shapes.contains(&accessor.dimensions()) || accessor.data_type() == DataType::U32 {
            return Err(mismatch(accessor, shapes, "f32 or normalized integers"));
        }
        let packed = self.packed(accessor)?;
        let to_float = converter(packed.kind, packed.normalized);
        let (size, lanes) = (packed.kind.size(), accessor.dimensions().multiplicity());
        self.budget.take(packed.bytes.len() as u64 / (lanes * size) as u64 * N as u64 * 4, &object)?;
        let (mut out, mut broken) = (Vec::with_capacity(accessor.count()), None);
        for (i, element) in packed.bytes.chunks_exact(lanes * size).enumerate() {
            let mut value = [1.0; N]; // an absent alpha is 1
            for (lane, bytes) in value.iter_mut().zip(element.chunks_exact(size)) {
                *lane = to_float(bytes);
            }
            if !value.iter().all(|x| x.is_finite()) {
                broken = broken.or(Some(i));
                value = spare;
            }
            out.push(value);
        }
        Ok((out, broken))
    }

    /// Unsigned integers in groups of `N`.
    pub(crate) fn integers<const N: usize>(&self, accessor: &Accessor<'_>, shape: Dimensions) -> Result<Vec<[u32; N]>, Fault> {
        let kinds = [DataType::U8, DataType::U16, DataType::U32];
        if accessor.dimensions() != shape || !kinds.contains(&accessor.data_type()) {
            return Err(mismatch(accessor, &[shape], "u8, u16 or u32"));
        }
        let packed = self.packed(accessor)?;
        let size = packed.kind.size();
        self.budget.take((packed.bytes.len() / size * 4) as u64, &name_of(accessor))?;
        let element = |bytes: &[u8]| {
            let mut lanes = bytes.chunks_exact(size).map(unsigned);
            std::array::from_fn(|_| lanes.next().unwrap_or(0))
        };
        Ok(packed.bytes.chunks_exact(size * N).map(element).collect())
    }

    /// The elements as they are stored, sparse ones put in.
    pub(crate) fn packed(&self, accessor: &Accessor<'_>) -> Result<Packed, Fault> {
        let (object, size, count) = (name_of(accessor), accessor.size(), accessor.count());
        let total = (count as u64).saturating_mul(size as u64);
        let mut bytes = match accessor.view() {
            Some(view) => self.strided(&object, &view, accessor.offset(), count, size)?,
            None => {
                self.budget.take(total, &object)?;
                vec![0; total as usize]
            }
        };
        if let Some(sparse) = accessor.sparse() {
            let (n, indices, values) = (sparse.count(), sparse.indices(), sparse.values());
            let width = match indices.index_type() {
                gltf::accessor::sparse::IndexType::U8 => 1,
                gltf::accessor::sparse::IndexType::U16 => 2,
                gltf::accessor::sparse::IndexType::U32 => 4,
            };
            let places = self.strided(&format!("{object}, sparse indices"), &indices.view(), indices.offset(), n, width)?;
            let replaced = self.strided(&format!("{object}, sparse values"), &values.view(), values.offset(), n, size)?;
            for (place, value) in places.chunks_exact(width).map(unsigned).zip(replaced.chunks_exact(size)) {
                let at = place as usize * size;
                let Some(target) = bytes.get_mut(at..at + size) else {
                    return Err(Fault::data(object, format!("sparse index {place} is outside of its {count} elements")));
                };
                target.copy_from_slice(value);
            }
        }
        Ok(Packed { bytes, kind: accessor.data_type(), normalized: accessor.normalized() })
    }

    /// `count` elements of `size` bytes, gaps left out.
    fn strided(&self, object: &str, view: &View<'_>, offset: usize, count: usize, size: usize) -> Result<Vec<u8>, Fault> {
        if count == 0 {
            return Ok(Vec::new());
        }
        let stride = view.stride().unwrap_or(size);
        if stride < size {
            return Err(Fault::data(object, format!("its elements have {size} bytes, but the stride of its view is {stride}")));
        }
        let needed = (count - 1).checked_mul(stride).and_then(|n| n.checked_add(size)).and_then(|n| n.checked_add(offset));
        if needed.is_none_or(|needed| needed > view.length()) {
            let needed = needed.map_or("more than all".to_owned(), |n| n.to_string());
            let message =
                format!("needs {needed} bytes for {count} elements, but bufferView {} has {}", view.index(), view.length());
            return Err(Fault::data(object, message));
        }
        self.budget.take((count * size) as u64, object)?;
        let start = view.offset() + offset;
        let bytes = &self.source.buffers[view.buffer().index()][start..view.offset() + view.length()];
        if stride == size {
            return Ok(bytes[..count * size].to_vec());
        }
        let mut out = Vec::with_capacity(count * size);
        for i in 0..count {
            out.extend_from_slice(&bytes[i * stride..i * stride + size]);
        }
        Ok(out)
    }
}

/// `accessor 3 'positions'`.
pub(crate) fn name_of(accessor: &Accessor<'_>) -> String {
    label("accessor", accessor.index(), accessor.name())
}

fn mismatch(accessor: &Accessor<'_>, shapes: &[Dimensions], kinds: &str) -> Fault {
    let shapes: Vec<_> = shapes.iter().map(|s| format!("{s:?}")).collect();
    let normalized = if accessor.normalized() { "normalized " } else { "" };
    let message = format!(
        "holds {normalized}{:?} {:?} where {} of {kinds} is needed",
        accessor.data_type(),
        accessor.dimensions(),
        shapes.join(" or ")
    );
    Fault::data(name_of(accessor), message)
}

fn unsigned(bytes: &[u8]) -> u32 {
    bytes.iter().rev().fold(0, |n, b| n << 8 | u32::from(*b))
}

/// Section 3.6.2.2 of the specification.
fn converter(kind: DataType, normalized: bool) -> fn(&[u8]) -> f32 {
    match (kind, normalized) {
        (DataType::F32 | DataType::U32, _) => |b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]),
        (DataType::U8, true) => |b| f32::from(b[0]) / 255.0,
        (DataType::U16, true) => |b| f32::from(u16::from_le_bytes([b[0], b[1]])) / 65535.0,
        (DataType::I8, true) => |b| (f32::from(b[0] as i8) / 127.0).max(-1.0),
        (DataType::I16, true) => |b| (f32::from(i16::from_le_bytes([b[0], b[1]])) / 32767.0).max(-1.0),
        (DataType::U8, false) => |b| f32::from(b[0]),
        (DataType::U16, false) => |b| f32::from(u16::from_le_bytes([b[0], b[1]])),
        (DataType::I8, false) => |b| f32::from(b[0] as i8),
        (DataType::I16, false) => |b| f32::from(i16::from_le_bytes([b[0], b[1]])),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gltf::container;

    /// A document with one buffer (bytes 0, 1, 2, ...) and one accessor.
    fn source(accessor: &str, view: &str) -> Source {
        let json = format!(
            r#"{{"asset":{{"version":"2.0"}},"buffers":[{{"byteLength":64}}],
                "bufferViews":[{{"buffer":0,"byteLength":32{view}}},{{"buffer":0,"byteOffset":1,"byteLength":3}}],
                "accessors":[{{{accessor}}}]}}"#
        );
        let root = container::parse(json.as_bytes()).unwrap().root;
        Source {
            document: gltf::Document::from_json_without_validation(root),
            buffers: vec![(0..64).collect()],
            pictures: Vec::new(),
            normal_transforms: Vec::new(),
            occlusion_transforms: Vec::new(),
            warnings: Vec::new(),
        }
    }

    #[test]
    fn integers_and_floats() {
        let scalar = [Dimensions::Scalar];
        let sparse =
            r#","sparse":{"count":3,"indices":{"bufferView":1,"componentType":5121},"values":{"bufferView":0,"byteOffset":20}}"#;
        for (accessor, view, floats, integers) in [
            (r#""bufferView":0,"componentType":5121,"count":3,"type":"SCALAR""#.to_owned(), "", vec![0., 1., 2.], vec![0, 1, 2]),
            (
                r#""bufferView":0,"componentType":5121,"count":3,"type":"SCALAR""#.into(),
                r#","byteStride":4"#,
                vec![0., 4., 8.],
                vec![0, 4, 8],
            ),
            (
                r#""bufferView":0,"byteOffset":30,"componentType":5123,"count":1,"type":"SCALAR""#.into(),
                "",
                vec![7966.],
                vec![0x1f1e],
            ),
            (r#""componentType":5121,"count":2,"type":"SCALAR""#.into(), "", vec![0., 0.], vec![0, 0]),
            (
                format!(r#""componentType":5121,"count":5,"type":"SCALAR"{sparse}"#),
                "",
                vec![0., 20., 21., 22., 0.],
                vec![0, 20, 21, 22, 0],
            ),
            (
                format!(r#""bufferView":0,"componentType":5121,"count":4,"type":"SCALAR"{sparse}"#),
                "",
                vec![0., 20., 21., 22.],
                vec![0, 20, 21, 22],
            ),
        ] {
            let source = source(&accessor, view);
            let (budget, a) = (Budget::new(1000), source.document.accessors().next().unwrap());
            let reader = Accessors { source: &source, budget: &budget };
            assert_eq!(reader.floats::<1>(&a, &scalar).unwrap(), floats.iter().map(|x| [*x]).collect::<Vec<_>>(), "{accessor}");
            assert_eq!(reader.integers::<1>(&a, Dimensions::Scalar).unwrap(), integers.iter().map(|x| [*x]).collect::<Vec<_>>());
        }
    }

    #[test]
    fn normalized_integers() {
        for (kind, bytes, expected) in [
            (DataType::U8, vec![255u8], 1.0),
            (DataType::I8, vec![0x80], -1.0),
            (DataType::I8, vec![64], 64.0 / 127.0),
            (DataType::U16, vec![0xff, 0xff], 1.0),
            (DataType::I16, vec![0x00, 0x80], -1.0),
        ] {
            assert_eq!(converter(kind, true)(&bytes), expected, "{kind:?}");
        }
    }

    #[test]
    fn faults() {
        for (accessor, view, message) in [
            (
                r#""bufferView":0,"componentType":5121,"count":33,"type":"SCALAR""#,
                "",
                "needs 33 bytes for 33 elements, but bufferView 0 has 32",
            ),
            (r#""bufferView":0,"componentType":5126,"count":3,"type":"SCALAR""#, r#","byteStride":16"#, "needs 36 bytes"),
            (
                r#""bufferView":0,"byteOffset":18446744073709551615,"componentType":5121,"count":2,"type":"SCALAR""#,
                "",
                "more than all",
            ),
            (r#""bufferView":0,"componentType":5126,"count":18446744073709551615,"type":"SCALAR""#, "", "more than all"),
            (r#""componentType":5121,"count":1000000000000,"type":"SCALAR""#, "", "needs 1000000000000 bytes"),
            (r#""bufferView":0,"componentType":5126,"count":1,"type":"VEC2","name":"uv""#, "", "accessor 0 'uv': holds F32 Vec2"),
            (
                r#""componentType":5121,"count":3,"type":"SCALAR","sparse":{"count":3,"indices":{"bufferView":1,"componentType":5121},"values":{"bufferView":0}}"#,
                "",
                "sparse index 3 is outside of its 3",
            ),
            (
                r#""componentType":5121,"count":9,"type":"SCALAR","sparse":{"count":4,"indices":{"bufferView":1,"componentType":5121},"values":{"bufferView":0}}"#,
                "",
                "sparse indices: needs 4 bytes",
            ),
        ] {
            let source = source(accessor, view);
            let (budget, a) = (Budget::new(1000), source.document.accessors().next().unwrap());
            let fault = Accessors { source: &source, budget: &budget }.floats::<1>(&a, &[Dimensions::Scalar]).unwrap_err();
            let text = format!("{}: {}", fault.object, fault.cause);
            assert!(text.contains(message), "{accessor}: {text}");
        }
        let float_index = source(r#""bufferView":0,"componentType":5126,"count":3,"type":"SCALAR""#, "");
        let a = float_index.document.accessors().next().unwrap();
        let reader = Accessors { source: &float_index, budget: &Budget::new(1000) };
        let fault = reader.integers::<1>(&a, Dimensions::Scalar).unwrap_err();
        assert!(fault.cause.to_string().contains("holds F32 Scalar where Scalar of u8, u16 or u32 is needed"), "{}", fault.cause);
    }
}
