//! Tries a user's change of a body, collider or joint on a copy of it, and records what comes out.

use std::sync::Arc;

use rapier3d::prelude::*;

use super::record::{self, state_of, traits_of};
use super::{ShapeError, ShapeLibrary, joints};
use crate::protocol::{BodyRecord, BodyState, BodyTraits, ColliderRecord, JointRecord};

/// The outcome of a user's change of a copy of a body.
pub(crate) struct Tried {
    pub traits: BodyTraits,
    pub user_data: u128,
    /// Says whether it wakes the body.
    pub wakes: bool,
    /// Says whether it changes more than traits: pose, velocity, forces, or falling asleep.
    pub moves: bool,
}

/// A copy of a body with its colliders that nothing else touches. It is asleep, so that it shows whether a
/// change wakes it.
struct Copied {
    bodies: RigidBodySet,
    colliders: ColliderSet,
    body: RigidBodyHandle,
}

impl Copied {
    fn new(known: &BodyRecord, shapes: &ShapeLibrary) -> Result<Self, ShapeError> {
        let state = BodyState { sleeping: true, ..known.state };
        let (body, parts) = record::build(&BodyRecord { state, ..known.clone() }, [0.0; 3], shapes)?;
        let (mut bodies, mut colliders) = (RigidBodySet::new(), ColliderSet::new());
        let body = bodies.insert(body);
        for part in parts {
            colliders.insert_with_parent(part, body, &mut bodies);
        }
        bodies[body].recompute_mass_properties_from_colliders(&colliders);
        Ok(Self { bodies, colliders, body })
    }
}

/// Lets a user change a copy of a body, and returns what comes out.
pub(crate) fn try_on_body(
    known: &BodyRecord,
    shapes: &ShapeLibrary,
    change: &mut dyn FnMut(&mut RigidBody),
) -> Result<Tried, ShapeError> {
    let mut copied = Copied::new(known, shapes)?;
    let body = &mut copied.bodies[copied.body];
    let before = state_of(body, [0.0; 3]);
    change(body);
    let after = state_of(body, [0.0; 3]);
    let is_asleep = BodyState { sleeping: before.sleeping, still_s: before.still_s, ..after };
    Ok(Tried {
        traits: {
            let read = traits_of(body, known.traits.colliders.clone());
            let same = read.kind == known.traits.kind;
            BodyTraits {
                character: known.traits.character.filter(|_| same),
                vehicle: known.traits.vehicle.clone().filter(|_| same),
                ..read
            }
        },
        user_data: body.user_data,
        wakes: !after.sleeping,
        moves: is_asleep != before
            || body.next_position() != body.position()
            || after.sleeping && after.still_s != before.still_s,
    })
}

/// Lets a user change a copy of a collider of a body. Returns its new record, or `None` if its shape or its
/// place on the body changed.
pub(crate) fn try_on_collider(
    known: &BodyRecord,
    index: usize,
    shapes: &ShapeLibrary,
    change: &mut dyn FnMut(&mut Collider),
) -> Result<Option<ColliderRecord>, ShapeError> {
    let mut copied = Copied::new(known, shapes)?;
    let collider = copied.bodies[copied.body].colliders()[index];
    let collider = &mut copied.colliders[collider];
    let shape = collider.shared_shape().clone();
    let place = collider.position_wrt_parent().copied();
    change(collider);
    let stays =
        Arc::ptr_eq(&collider.shared_shape().0, &shape.0) && collider.position_wrt_parent().copied() == place;
    Ok(stays.then(|| record::renewed(&known.traits.colliders[index], collider)))
}

/// Lets a user change a copy of a joint, and returns its new record.
pub(crate) fn try_on_joint(known: &JointRecord, change: &mut dyn FnMut(&mut GenericJoint)) -> JointRecord {
    let mut joint = joints::joint_of(known);
    change(&mut joint);
    joints::renewed(known, &joint)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::WorldPose;
    use crate::space::BodyId;

    #[test]
    fn what_a_change_does_besides_shows() {
        let mut shapes = ShapeLibrary::default();
        let body = RigidBodyBuilder::dynamic().linvel(Vector::new(3.0, 0.0, 0.0)).build();
        let cube = ColliderBuilder::cuboid(0.5, 0.5, 0.5);
        let known =
            shapes.describe(BodyId::persistent(2), WorldPose::at([-4.0, 0.5, 0.0]), &body, &[cube]).unwrap();
        let tried = |change: &mut dyn FnMut(&mut RigidBody)| {
            let Tried { wakes, moves, .. } = try_on_body(&known, &shapes, change).unwrap();
            (wakes, moves)
        };
        assert_eq!(tried(&mut |_| {}), (false, false));
        assert_eq!(tried(&mut |body| body.wake_up(true)), (true, false));
        assert_eq!(tried(&mut |body| body.sleep()), (false, true));
        assert_eq!(tried(&mut |body| body.apply_impulse(Vector::X, true)), (true, true));
        assert_eq!(tried(&mut |body| body.set_linvel(Vector::X, false)), (false, true));
        assert_eq!(tried(&mut |body| body.set_translation(Vector::X, false)), (false, true));
        assert_eq!(tried(&mut |body| body.add_force(Vector::X, false)), (false, true));
        let shape = |collider: &mut Collider| collider.set_shape(SharedShape::ball(1.0));
        assert_eq!(try_on_collider(&known, 0, &shapes, &mut { shape }).unwrap(), None);
        let place = |collider: &mut Collider| {
            collider.set_position_wrt_parent(Pose::from_parts(Vector::X, Rotation::IDENTITY));
        };
        assert_eq!(try_on_collider(&known, 0, &shapes, &mut { place }).unwrap(), None);
    }
}
