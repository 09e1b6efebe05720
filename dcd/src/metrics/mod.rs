//! Serves the numbers of a process over HTTP, for Prometheus and for supervisors of processes. This module
//! knows nothing of worlds.

mod endpoint;
mod text;

pub(crate) use endpoint::{Endpoint, Source};
pub(crate) use text::{Histogram, Text};
