//! What tests and benches of several programs share.

pub mod browser;
pub mod proxy;
pub mod served;
pub mod socket;
pub mod truth;
