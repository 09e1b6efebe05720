//! Exposes dcd as a C API. Its documentation is `include/dcd.h`, which cbindgen generates from this crate. `cargo test -p dcd-ffi`
//! fails when the two differ; `UPDATE=1 cargo test -p dcd-ffi --test header` writes the header anew.
//!
//! Every entry point runs inside [`guard`](guard::guard), which turns panics into `DCD_ERR_PANIC` and failures into a status and a
//! message. `pointer` checks pointers, `handle` checks handles, and `registry` finds worlds. [`dcd::World`] says what a process can
//! do in its role. All unsafe code of the project is here.
// The comments of this crate become those of the C header, where brackets are plain text.
#![allow(rustdoc::broken_intra_doc_links, rustdoc::private_intra_doc_links)]
// The head of the header and the documentation of each function there say, once, what callers must keep to.
#![allow(clippy::missing_safety_doc)]

#[cfg(panic = "abort")]
compile_error!(
    "dcd-ffi turns panics into DCD_ERR_PANIC, so it needs panic = \"unwind\"; remove panic = \"abort\""
);

mod callback;
mod guard;
mod handle;
mod material;
mod pinned;
mod pointer;
mod registry;

// Modules are in the order in which the header presents them. `rustfmt` sorts modules within a group, so each has a group of its
// own where it must.
pub mod ids;
pub mod library;
pub mod limits;
pub mod log;

pub mod bug;

pub mod allocator;

pub mod role;
pub mod status;
pub mod types;

pub mod world;

pub mod join;

pub mod serve;

pub mod shape;

pub mod definition;

pub mod body;

pub mod character;

pub mod vehicle;

pub mod standing;

pub mod motion;

pub mod push;

pub mod forces;

pub mod properties;

pub mod collider;

pub mod shape_info;

pub mod looks;

pub mod joint;

pub mod strength;

pub mod step;

pub mod tasks;

pub mod settings;

pub mod state;

pub mod view;

pub mod draw;

pub mod prediction;

pub mod connection;

pub mod message;

pub mod event;

pub mod contacts;

pub mod hooks;

pub mod query;

pub mod topology;

pub mod interest;

pub mod stats;

pub mod profile;

pub mod checkpoint;
pub mod fidelity;
pub mod record;
pub mod snapshot;

#[cfg(all(feature = "mimalloc", not(feature = "allocator")))]
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;
