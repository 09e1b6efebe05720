//! Defines the trait `Source`: what a world tells those who draw it, and the values in which it does.

use std::collections::BTreeMap;
use std::hash::{DefaultHasher, Hash, Hasher};

use crate::protocol::{BodyRecord, BodyTraits, JointRecord, ShapeHash, ShapeRecord, WorldPose};
use crate::space::{BodyId, Bounds, Cell, Epoch, JointId};

/// A movable body as it is drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Seen {
    /// Metres, in world space.
    pub(crate) at: [f64; 3],
    /// Unit quaternion, scalar last.
    pub(crate) turn: [f32; 4],
    /// Metres per second.
    pub(crate) velocity_m_s: [f32; 3],
    /// Its owner: the place of a region in [`Source::regions`].
    pub(crate) owner: u16,
    /// Whether it sleeps.
    pub(crate) sleeping: bool,
    /// Whether it was last heard of some time ago.
    pub(crate) outside: bool,
    /// What it looks like, by [`appearance_of`]; 0 where nobody looks twice.
    pub(crate) appearance: u64,
}

/// Returns a number that tells bodies apart that do not look alike: by their kinds and colliders. A body may get other colliders, and an id may
/// be given again after a world went back to a checkpoint.
pub(crate) fn appearance_of(traits: &BodyTraits) -> u64 {
    let mut hasher = DefaultHasher::new();
    (traits.kind as u8).hash(&mut hasher);
    for collider in &traits.colliders {
        (collider.shape, collider.sensor, collider.enabled).hash(&mut hasher);
        collider.pose.translation.map(f32::to_bits).hash(&mut hasher);
        collider.pose.rotation.map(f32::to_bits).hash(&mut hasher);
    }
    hasher.finish()
}

/// A joint as it is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Tie {
    /// Its bodies.
    pub(crate) bodies: [BodyId; 2],
    /// Where it is on each, metres.
    pub(crate) anchors: [[f32; 3]; 2],
}

impl Tie {
    /// Returns the joint by its id.
    pub(crate) fn of(joint: &JointRecord) -> (JointId, Self) {
        let anchors = [joint.frame_a.translation, joint.frame_b.translation];
        (joint.id, Self { bodies: [joint.a, joint.b], anchors })
    }
}

/// A region as it is drawn.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct RegionSeen {
    /// Its id.
    pub(crate) id: u32,
    /// The node that computes it, as far as known.
    pub(crate) node: Option<u32>,
    /// Copies of other regions' bodies that it holds.
    pub(crate) ghosts: usize,
    /// Wall time of its last step, milliseconds.
    pub(crate) step_ms: f32,
    /// The space that is its own.
    pub(crate) cell: Cell,
}

/// The border of two regions, named by their places in [`Source::regions`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct BorderSeen {
    /// One region, and the other.
    pub(crate) between: [u16; 2],
    /// Bodies that both hold.
    pub(crate) bodies: usize,
    /// Exchanges per tick.
    pub(crate) exchanges: usize,
    /// By how much their copies disagree, m/s.
    pub(crate) disagreement_m_s: f32,
}

/// A copy of a body in a region that does not own it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Ghost {
    /// The body.
    pub(crate) id: BodyId,
    /// The place of the region that holds it.
    pub(crate) holder: u16,
    /// By how much its velocity differs from the owner's, m/s.
    pub(crate) off_m_s: f32,
}

/// A pair of bodies that touch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ContactSeen {
    /// Where, in world space.
    pub(crate) at: [f64; 3],
    /// The force on one of the two, newtons.
    pub(crate) force_n: [f32; 3],
}

/// Where a body is besides its pose: what only a process that computes it knows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Extent {
    /// The box around its colliders.
    pub(crate) aabb: Bounds,
    /// The box around all that it may reach in the next three ticks.
    pub(crate) swept: Bounds,
    /// In world space.
    pub(crate) centre_of_mass: [f64; 3],
}

/// What is told of one body that a viewer has chosen.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Details {
    /// The body.
    pub(crate) id: BodyId,
    /// The epoch of its owner.
    pub(crate) epoch: Epoch,
    /// Its mass, kilograms, where it is known.
    pub(crate) mass_kg: Option<f32>,
    /// The number that its user gave it.
    pub(crate) user_data: u128,
    /// How many regions hold it; 0 where that is not known.
    pub(crate) holders: usize,
}

/// A world that can be looked at between two of its steps.
pub(crate) trait Source {
    /// Returns how many ticks are done.
    fn tick(&self) -> u64;

    /// Returns the box in which borders are drawn.
    fn bounds(&self) -> Bounds;

    /// Visits every movable body in id order.
    fn for_each_movable(&self, look: impl FnMut(BodyId, Seen));

    /// Visits every fixed body in id order, with what it looks like, as [`Seen::appearance`].
    fn for_each_fixed(&self, look: impl FnMut(BodyId, &WorldPose, u64));

    /// Returns the whole record of a body.
    fn record(&self, id: BodyId) -> Option<BodyRecord>;

    /// Returns a shape by its name.
    fn shape(&self, hash: ShapeHash) -> Option<ShapeRecord>;

    /// Returns all joints, as far as they are known.
    fn joints(&self) -> BTreeMap<JointId, Tie> {
        BTreeMap::new()
    }

    /// Returns the regions in the order of their ids.
    fn regions(&self) -> Vec<RegionSeen>;

    /// Returns the borders between regions, as far as they are known.
    fn borders(&self) -> Vec<BorderSeen> {
        Vec::new()
    }

    /// Returns the copies of bodies in regions that do not own them, as far as they are known.
    fn ghosts(&self) -> Vec<Ghost> {
        Vec::new()
    }

    /// Returns the boxes around these copies, and the places of the regions that hold them, as far as they are known.
    fn ghost_boxes(&self) -> Vec<(u16, Bounds)> {
        Vec::new()
    }

    /// Returns what touches, as far as it is known, the first `most` pairs.
    fn contacts(&self, _most: usize) -> Vec<ContactSeen> {
        Vec::new()
    }

    /// Returns the extent of a movable body, where it is known.
    fn extent(&self, _id: BodyId) -> Option<Extent> {
        None
    }

    /// Returns more of one body, where it is known.
    fn details(&self, _id: BodyId) -> Option<Details> {
        None
    }

    /// Returns whether a body is an avatar of this process.
    fn is_own(&self, id: BodyId) -> bool;
}
