//! Triangles of the solids that X3D and VRML name, and meshes from the fields of `Mesh` nodes.
//!
//! Every solid is closed and watertight where its definition is closed: vertices that meet have bit-identical
//! positions, whatever their normals and texture coordinates, and no triangle has zero area. Shadow volumes need that.
//! Triangles wind counter-clockwise seen from outside. Texture coordinates run with v down.

mod builder;
mod cuboid;
mod depth_picture;
mod from_node;
mod plane;
mod round;
mod sphere;

pub use cuboid::cuboid;
pub use depth_picture::{DepthCamera, depth_picture};
pub(crate) use from_node::{MeshFields, mesh_from_fields};
pub use plane::plane;
pub use round::{ConeParts, CylinderParts, cone, cylinder};
pub use sphere::sphere;

#[cfg(test)]
mod check;
