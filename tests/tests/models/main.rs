//! Tests scenes from MJCF and URDF files: real files against the bare world, and every feature of the formats
//! with a file of its own.

mod collada;
mod compare;
mod features;
mod hostile;
mod inertia;
mod list;
mod placing;
mod real;
mod welds;
