//! Declares the bounds of what the library takes: items per call, numbers, coordinates.

/// Most items of one bulk call.
pub const DCD_MAX_ITEMS: usize = 16_777_216;

/// Every number given as a float lies within plus and minus this, where its function does not say otherwise: what is beyond
/// would not stay finite in single precision.
pub const DCD_MAX_NUMBER: f32 = 1.0e6;
/// Every coordinate in world space lies within plus and minus this, metres.
pub const DCD_MAX_COORDINATE: f64 = 1.0e9;
