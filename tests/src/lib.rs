//! Holds what tests and benches of several programs share.

pub mod proxy;
pub mod served;
pub mod truth;
