//! Declares bounds on what the library takes: items per call, numbers, coordinates.

/// Largest number of items in one bulk call.
pub const DCD_MAX_ITEMS: usize = 16_777_216;

/// Largest magnitude of a number given as a float, where its function does not say otherwise. Larger numbers would not stay finite
/// in single precision.
pub const DCD_MAX_NUMBER: f32 = 1.0e6;
/// Largest magnitude of a coordinate in world space, metres.
pub const DCD_MAX_COORDINATE: f64 = 1.0e9;
