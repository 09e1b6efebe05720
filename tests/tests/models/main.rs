//! Tests scenes from MJCF and URDF files: real files against the bare world, and every feature of the formats by a file of its own.

mod collada;
mod compare;
mod features;
mod hostile;
mod list;
mod placing;
mod real;
