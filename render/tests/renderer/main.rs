//! Pictures of scenes made in code, compared with numbers that follow from the scene.

mod author;
mod contact;
mod contours;
mod cutouts;
mod deformation;
mod device;
mod enclosed;
mod layouts;
mod lights;
mod maps;
mod outputs;
mod projection;
mod shadows;
mod shapes;
mod soft;
mod support;
mod surfaces;
mod town;
mod truth;
