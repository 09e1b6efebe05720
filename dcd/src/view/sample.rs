//! Defines the numbers that the timeline shows of each tick.

/// Numbers of one tick, for the timeline.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Sample {
    /// The tick.
    pub(super) tick: u64,
    /// Wall time of the step, milliseconds; 0 where other processes compute it.
    pub(super) step_ms: f32,
    /// Bodies that changed owner.
    pub(super) transfers: u32,
    /// Exchanges of the busiest border.
    pub(super) exchanges: u32,
    /// Bytes that came over the network.
    pub(super) bytes: u32,
    /// Disagreement at the worst border, m/s.
    pub(super) disagreement_m_s: f32,
}
