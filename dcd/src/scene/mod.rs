//! Builds scenes, the content of a world at its first tick, for tests, benchmarks, the command line and the
//! demo.
//!
//! A scene comes from the `library` (`tower`, `pile`, `gas` …, with parameters), from a TOML file (format:
//! `dcd/scenes/README.md`), or from an MJCF or URDF file (`dcd/scenes/models/README.md`). Body `i` of its
//! list becomes [`BodyId::persistent(i)`](crate::space::BodyId::persistent).

mod bounded;
mod dice;
mod error;
mod file;
mod library;
mod model;
#[cfg(feature = "models")]
mod models;
mod open;
mod params;
mod records;

#[cfg(feature = "cli")]
pub(crate) use dice::Dice;
pub use error::SceneError;
#[cfg(feature = "cli")]
pub(crate) use error::nearest;
pub use library::{SceneInfo, library};
pub use model::{AvatarHint, Scene, SceneBody, SceneJoint};
#[cfg(feature = "models")]
pub use models::MODEL_PARAMS;
pub use params::{ParamInfo, ParamKind, Params};
