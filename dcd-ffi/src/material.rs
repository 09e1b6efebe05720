//! Reads the number that a user gave a collider: what contacts and hits carry as its material.

use dcd::{BodyId, World as Dcd};

/// Returns the user data of a collider; 0 when it is gone.
pub(crate) fn material(world: &Dcd, body: BodyId, collider: usize) -> u64 {
    world.collider_user_data(body, collider).unwrap_or(0) as u64
}
