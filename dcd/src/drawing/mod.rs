//! Draws worlds between their steps. The viewer, debug draw and glTF files read a world by one trait,
//! [`Source`], and draw it with the same few geometries.

#[cfg(feature = "view")]
mod client;
mod colour;
mod debug;
mod geometry;
mod gltf;
mod host;
#[cfg(feature = "view")]
#[cfg_attr(not(feature = "cli"), expect(dead_code, reason = "only the command line replays"))]
mod hosts;
#[cfg_attr(not(feature = "view"), expect(dead_code, reason = "the viewer shows more than files hold"))]
mod moment;
mod slots;
mod source;

#[cfg(feature = "view")]
pub(crate) use client::Told;
pub(crate) use debug::Canvas;
pub use debug::{DebugDraw, DebugDrawFlags, DebugDrawSettings, DebugShape};
#[cfg(feature = "view")]
pub(crate) use geometry::{FIRST_MESH, Mesh, Part};
pub(crate) use gltf::Film;
pub use gltf::GltfError;
#[cfg(feature = "view")]
pub(crate) use hosts::Hosts;
#[cfg(feature = "view")]
pub(crate) use moment::{Arrival, JointSeen, KEPT_FRAMES, Looker, Moment, Wishes};
#[cfg(feature = "view")]
pub(crate) use source::Details;
pub(crate) use source::{ContactSeen, Extent, RegionSeen, Seen, Source, Tie};
