//! Defines the trait `Source`, by which a world is read to be drawn, and the values that it returns.

use std::collections::BTreeMap;
use std::hash::{DefaultHasher, Hash, Hasher};

use crate::protocol::{BodyRecord, BodyTraits, JointRecord, ShapeHash, ShapeRecord, WorldPose};
use crate::space::{BodyId, Bounds, Cell, Epoch, JointId};

/// A movable body as it is drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Seen {
    /// The position in world space, metres.
    pub(crate) at: [f64; 3],
    /// The rotation, a unit quaternion with its scalar last.
    pub(crate) turn: [f32; 4],
    /// The linear velocity, m/s.
    pub(crate) velocity_m_s: [f32; 3],
    /// The index of its owner in [`Source::regions`].
    pub(crate) owner: u16,
    /// Says whether it sleeps.
    pub(crate) sleeping: bool,
    /// Says whether it is outside the client's area of interest, so that its state was received some time ago.
    pub(crate) outside: bool,
    /// A hash of its look, see [`appearance_of`]; 0 where it is not needed.
    pub(crate) appearance: u64,
}

/// Returns a hash of a body's look: of its kind and its colliders. The look of an id may change, as a body
/// may get other colliders, and an id may be given again after a world went back to a checkpoint.
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
    /// Its anchor on each body, in the space of the body, metres.
    pub(crate) anchors: [[f32; 3]; 2],
}

impl Tie {
    /// Returns the id of a joint, and the joint as it is drawn.
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
    /// The node that computes it, if known.
    pub(crate) node: Option<u32>,
    /// The number of ghosts that it holds.
    pub(crate) ghosts: usize,
    /// Wall time of its last step, milliseconds.
    pub(crate) step_ms: f32,
    /// Its cell.
    pub(crate) cell: Cell,
}

/// The border between two regions, which are named by their indices in [`Source::regions`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct BorderSeen {
    /// The two regions.
    pub(crate) between: [u16; 2],
    /// The number of bodies that both hold.
    pub(crate) bodies: usize,
    /// Exchanges per tick.
    pub(crate) exchanges: usize,
    /// The disagreement of their copies, m/s.
    pub(crate) disagreement_m_s: f32,
}

/// A copy of a body in a region that does not own it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Ghost {
    /// The body.
    pub(crate) id: BodyId,
    /// The index of the region that holds it, in [`Source::regions`].
    pub(crate) holder: u16,
    /// The difference of its linear velocity from the owner's, m/s.
    pub(crate) off_m_s: f32,
}

/// A pair of bodies that touch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ContactSeen {
    /// A point of contact in world space, metres.
    pub(crate) at: [f64; 3],
    /// The force on one of the two, newtons.
    pub(crate) force_n: [f32; 3],
}

/// The extent of a body, which only a process that computes the body knows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Extent {
    /// The box around its colliders, in world space.
    pub(crate) aabb: Bounds,
    /// The swept AABB: the box around all that it may reach in the next three ticks.
    pub(crate) swept: Bounds,
    /// The centre of mass in world space, metres.
    pub(crate) centre_of_mass: [f64; 3],
}

/// The details of a body that a viewer has chosen.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Details {
    /// The body.
    pub(crate) id: BodyId,
    /// The epoch of its owner.
    pub(crate) epoch: Epoch,
    /// Its mass, kilograms; `None` if unknown.
    pub(crate) mass_kg: Option<f32>,
    /// Its user data.
    pub(crate) user_data: u128,
    /// The number of regions that hold it; 0 if unknown.
    pub(crate) holders: usize,
}

/// A world that can be looked at between two of its steps.
pub(crate) trait Source {
    /// Returns the number of completed ticks.
    fn tick(&self) -> u64;

    /// Returns the box in which borders are drawn.
    fn bounds(&self) -> Bounds;

    /// Visits every movable body in id order.
    fn for_each_movable(&self, look: impl FnMut(BodyId, Seen));

    /// Visits every fixed body in id order, with its look as in [`Seen::appearance`].
    fn for_each_fixed(&self, look: impl FnMut(BodyId, &WorldPose, u64));

    /// Returns the whole record of a body.
    fn record(&self, id: BodyId) -> Option<BodyRecord>;

    /// Returns a shape by its hash.
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

    /// Returns the ghosts of all regions, as far as they are known.
    fn ghosts(&self) -> Vec<Ghost> {
        Vec::new()
    }

    /// Returns the boxes around ghosts, each with the index of the region that holds it, as far as they are
    /// known.
    fn ghost_boxes(&self) -> Vec<(u16, Bounds)> {
        Vec::new()
    }

    /// Returns the contacts, as far as they are known, and at most `most`.
    fn contacts(&self, _most: usize) -> Vec<ContactSeen> {
        Vec::new()
    }

    /// Returns the extent of a movable body, if known.
    fn extent(&self, _id: BodyId) -> Option<Extent> {
        None
    }

    /// Returns the details of a body, if known.
    fn details(&self, _id: BodyId) -> Option<Details> {
        None
    }

    /// Returns whether a body is an avatar of this process.
    fn is_own(&self, id: BodyId) -> bool;
}
