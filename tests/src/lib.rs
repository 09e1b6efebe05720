//! Holds what the tests and benches of several programs share.

pub mod browser;
pub mod course;
pub mod etcd;
pub mod fuzz;
pub mod proxy;
pub mod served;
pub mod socket;
pub mod stage;
pub mod truth;
