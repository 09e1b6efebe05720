//! Hashes the state of a whole world into one number. Equal numbers mean equal bits.

use super::{Velocity, WorldPose};
use crate::space::BodyId;

/// A hasher of bodies in id order: of their poses and velocities, bit for bit.
#[derive(Default)]
pub struct StateHasher {
    hasher: blake3::Hasher,
    last: Option<BodyId>,
}

impl StateHasher {
    /// Adds a body.
    ///
    /// # Panics
    /// When bodies do not come in ascending id order: the hash would mean nothing.
    pub fn add(&mut self, id: BodyId, pose: &WorldPose, velocity: &Velocity) {
        assert!(self.last < Some(id), "bodies are hashed in id order");
        self.last = Some(id);
        self.hasher.update(&id.bits().to_le_bytes());
        for v in pose.translation {
            self.hasher.update(&v.to_bits().to_le_bytes());
        }
        for v in pose.rotation.iter().chain(&velocity.linear).chain(&velocity.angular) {
            self.hasher.update(&v.to_bits().to_le_bytes());
        }
    }

    /// Returns the first 64 bits of BLAKE3 over everything that was added.
    pub fn finish(&self) -> u64 {
        let mut first = [0; 8];
        first.copy_from_slice(&self.hasher.finalize().as_bytes()[..8]);
        u64::from_le_bytes(first)
    }
}
