//! Holds the manual: concepts, couplings, serving, operating, seeing, recording, fidelity, engines, limits
//! and architecture. It says what the documentation of single items does not.

#[doc = include_str!("../manual/concepts.md")]
pub mod concepts {}

#[doc = include_str!("../manual/coupling.md")]
pub mod coupling {}

#[doc = include_str!("../manual/serving.md")]
pub mod serving {}

#[doc = include_str!("../manual/operating.md")]
pub mod operating {}

#[doc = include_str!("../manual/seeing.md")]
pub mod seeing {}

#[doc = include_str!("../manual/recording.md")]
pub mod recording {}

#[doc = include_str!("../manual/fidelity.md")]
pub mod fidelity {}

#[doc = include_str!("../manual/engines.md")]
pub mod engines {}

#[doc = include_str!("../manual/limits.md")]
pub mod limits {}

#[doc = include_str!("../ARCHITECTURE.md")]
pub mod architecture {}
