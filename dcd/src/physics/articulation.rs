//! Records and restores the links of multibody joints (bodies in reduced coordinates). Rapier solves all
//! links of a multibody together, so one region has all of it, with whatever other joints tie to it. A
//! multibody is never shared, and moves whole.

use std::collections::BTreeMap;

use rapier3d::prelude::*;

use super::{convert, joints};
use crate::protocol::{BodyState, JointRecord, LinkMotion, LinkRecord, WorldPose};
use crate::space::BodyId;

/// The settings of a multibody joint, besides those of every joint.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LinkSettings {
    /// Says whether only the program sets the velocities of the joint's degrees of freedom
    /// ([`World::set_link_velocity`](crate::World::set_link_velocity)).
    pub kinematic: bool,
    /// The damping by degree of freedom, the linear ones first, N·s/m or N·m·s. `None` is Rapier's choice:
    /// 0.1 for turning.
    pub damping: Option<[f32; 6]>,
    /// The inertia added to each degree of freedom, kg or kg·m².
    pub armature: [f32; 6],
    /// The dry friction of each degree of freedom, N or N·m.
    pub friction: [f32; 6],
    /// Springs by axis (x, y, z, about x, y, z): stiffness, N/m or N·m, and rest position, metres or radians.
    pub springs: [[f32; 2]; 6],
}

impl LinkSettings {
    pub(crate) fn record(&self) -> LinkRecord {
        let Self { kinematic, damping, armature, friction, springs } = *self;
        LinkRecord { kinematic, damping, armature, friction, springs, motion: None }
    }
}

/// Returns why Rapier cannot have a joint in a multibody; `None` if it can.
pub(crate) fn link_fault(joint: &GenericJoint) -> Option<&'static str> {
    // Rapier has no reduced coordinates for these.
    let turning = 3 - (joint.locked_axes.bits() >> 3).count_ones();
    (turning == 2)
        .then_some("it may turn about two axes; use an impulse joint, or two joints with a body between")
}

/// Makes the second body a link of the first one's multibody; `None` if Rapier refuses.
pub(crate) fn insert_link(
    joints: &mut MultibodyJointSet,
    a: RigidBodyHandle,
    b: RigidBodyHandle,
    joint: GenericJoint,
    record: &LinkRecord,
) -> Option<MultibodyJointHandle> {
    if record.kinematic {
        joints.insert_kinematic(a, b, joint, false)
    } else {
        joints.insert(a, b, joint, false)
    }
}

/// Gives a link what its record says, once the multibody is whole: places in the multibody's lists change as
/// links are added.
pub(crate) fn equip_link(joints: &mut MultibodyJointSet, handle: MultibodyJointHandle, record: &LinkRecord) {
    let (multibody, index) = joints.get_mut(handle).expect("just inserted");
    equip(multibody, index, record);
}

/// Gives a link that was just inserted what its record says.
pub(super) fn equip(multibody: &mut Multibody, id: usize, record: &LinkRecord) {
    let link = multibody.link_mut(id).expect("just inserted");
    let (first, dofs) = (link.assembly_id(), link.joint().ndofs());
    for (axis, &[stiffness, rest]) in record.springs.iter().enumerate() {
        link.joint.set_spring(axis, stiffness, rest);
    }
    if let Some(motion) = &record.motion {
        for way in displacements(link.joint(), motion) {
            link.joint.apply_displacement(&way);
        }
    }
    let copy = |to: &mut [f32], from: &[f32; 6]| to.copy_from_slice(&from[..to.len()]);
    if let Some(damping) = &record.damping {
        copy(&mut multibody.damping_mut().as_mut_slice()[first..first + dofs], damping);
    }
    copy(&mut multibody.armature_mut().as_mut_slice()[first..first + dofs], &record.armature);
    copy(&mut multibody.frictions_mut().as_mut_slice()[first..first + dofs], &record.friction);
    if let Some(motion) = &record.motion {
        let root = multibody.root().joint().ndofs();
        let mut velocities = multibody.generalized_velocity_mut();
        copy(&mut velocities.as_mut_slice()[..root], &motion.root_velocity);
        copy(&mut velocities.as_mut_slice()[first..first + dofs], &motion.velocity);
    }
}

/// Sets how fast a link moves, by its degrees of freedom.
pub(super) fn set_velocity(multibody: &mut Multibody, id: usize, velocity: &[f32; 6]) {
    let link = multibody.link(id).expect("a link of this multibody");
    let (first, dofs) = (link.assembly_id(), link.joint().ndofs());
    let mut velocities = multibody.generalized_velocity_mut();
    velocities.as_mut_slice()[first..first + dofs].copy_from_slice(&velocity[..dofs]);
}

/// Returns the displacements that bring a joint from its zero to where it was, to be applied in this order.
fn displacements(joint: &MultibodyJoint, motion: &LinkMotion) -> Vec<[f32; 6]> {
    let locked = joint.data.locked_axes.bits();
    let turning = 3 - (locked >> 3).count_ones();
    if turning < 3 {
        return vec![free_of(locked, motion.coordinates)];
    }
    // For three free axes Rapier keeps where the joint points, and beside that the sum of all its small
    // turns, by which limits and springs go. After a tumble neither follows from the other.
    let turned = convert::rotation(motion.rotation).to_scaled_axis();
    let [x, y, z, wound @ ..] = motion.coordinates;
    let mut ways: Vec<_> = whole_turns(Vector::from(wound) - turned)
        .map(|turn| free_of(locked, [0.0, 0.0, 0.0, turn.x, turn.y, turn.z]))
        .collect();
    ways.push(free_of(locked, [x, y, z, turned.x, turned.y, turned.z]));
    ways
}

/// Returns the values of the free axes, packed to the front.
fn free_of(locked: u8, values: [f32; 6]) -> [f32; 6] {
    let mut free = [0.0; 6];
    let axes = (0..6).filter(|axis| locked & (1 << axis) == 0);
    axes.enumerate().for_each(|(dof, axis)| free[dof] = values[axis]);
    free
}

/// Returns whole turns, each of which leaves a joint pointing where it does. Two of them can add up to any
/// vector that is not longer than both; here all pairs add up to `sum`.
fn whole_turns(sum: Vector) -> impl Iterator<Item = Vector> {
    const TURN: f32 = std::f32::consts::TAU;
    /// More than hours of tumbling add up to; a peer may send any number.
    const MOST_PAIRS: f32 = 1000.0;
    // What rounding leaves is no turn.
    let pairs = if sum.length() < 1e-5 { 0.0 } else { (0.5 * sum.length() / TURN).ceil().min(MOST_PAIRS) };
    let half = (0.5 * sum / pairs.max(1.0)).clamp_length_max(TURN);
    let aside = half.any_orthogonal_vector().normalize_or_zero()
        * (TURN * TURN - half.length_squared()).max(0.0).sqrt();
    (0..pairs as usize).flat_map(move |_| [half + aside, half - aside])
}

/// Records the link of a multibody as it is now.
pub(super) fn record_of(multibody: &Multibody, id: usize, known: &LinkRecord) -> LinkRecord {
    let link = multibody.link(id).expect("a link of this multibody");
    let (first, dofs) = (link.assembly_id(), link.joint().ndofs());
    let part = |all: &[f32], from: usize, count: usize| {
        let mut part = [0.0; 6];
        part[..count].copy_from_slice(&all[from..from + count]);
        part
    };
    let velocities = multibody.generalized_velocity();
    let coordinates = link.joint().coords();
    LinkRecord {
        damping: Some(part(multibody.damping().as_slice(), first, dofs)),
        motion: Some(LinkMotion {
            coordinates: std::array::from_fn(|axis| coordinates[axis]),
            rotation: link.joint().joint_rot().to_array(),
            velocity: part(velocities.as_slice(), first, dofs),
            root_velocity: part(velocities.as_slice(), 0, multibody.root().joint().ndofs()),
        }),
        ..*known
    }
}

/// Returns the motion of a link at rest from the poses of its two bodies, for a joint of which no more is
/// recorded. Poses do not tell whole turns: a hinge is taken to be within its limits if it can be. Nor do they tell
/// the sum of all small turns of a ball joint, by which its limits go: that is taken to be within them. Otherwise
/// Rapier would turn it back by as much in one step.
fn motion_between(joint: &GenericJoint, a: &WorldPose, b: &WorldPose) -> LinkMotion {
    // Relative to the first body's position, so that f32 is exact enough.
    let anchor = a.translation;
    let frame = |pose: &WorldPose, local: Pose| convert::region_from_world(anchor, pose) * local;
    let between = frame(a, joint.local_frame1).inverse() * frame(b, joint.local_frame2);
    let mut coordinates = [0.0; 6];
    coordinates[..3].copy_from_slice(&between.translation.to_array());
    coordinates[3..].copy_from_slice(&between.rotation.to_scaled_axis().to_array());
    let turning = JointAxesMask::ANG_AXES.difference(joint.locked_axes);
    let limited = |axis: &usize| joint.limit_axes.intersection(turning).bits() & (1 << axis) != 0;
    for axis in (3..6).filter(limited) {
        let (turned, limits) = (coordinates[axis], &joint.limits[axis]);
        coordinates[axis] = match turning.bits().count_ones() {
            1 => nearest_turn(turned, limits),
            // Not by `clamp`, which refuses a least that is above the most.
            3 => turned.min(limits.max).max(limits.min),
            _ => turned,
        };
    }
    LinkMotion { coordinates, rotation: between.rotation.to_array(), ..LinkMotion::default() }
}

/// Gives links the motion that their bodies have in these states, where the states of both are known: the
/// joint's record may be older.
pub(crate) fn set_motions<'a>(
    records: &mut [JointRecord],
    state_of: impl Fn(BodyId) -> Option<&'a BodyState>,
) {
    let links = records.iter().filter(|record| record.link.is_some());
    let parents: BTreeMap<_, _> = links.map(|record| (record.b, record.a)).collect();
    for record in records.iter_mut().filter(|record| record.link.is_some()) {
        let Some((a, b)) = state_of(record.a).zip(state_of(record.b)) else { continue };
        // Bounded, in case a record names a loop.
        let above = std::iter::successors(Some(record.a), |id| parents.get(id).copied());
        let root = above.take(parents.len()).last().and_then(&state_of);
        let joint = joints::joint_of(record);
        if let Some(link) = &mut record.link {
            link.motion = Some(motion_of(&joint, link.motion.as_ref(), a, b, root.unwrap_or(a)));
        }
    }
}

/// Returns the motion of a link from the states of its two bodies and of the root of its multibody. Bodies do
/// not tell whole turns: these stay as `known`, if the link is where that says.
pub(crate) fn motion_of(
    joint: &GenericJoint,
    known: Option<&LinkMotion>,
    a: &BodyState,
    b: &BodyState,
    root: &BodyState,
) -> LinkMotion {
    /// Metres or radians.
    const SAME: f32 = 1e-3;
    let now = motion_between(joint, &a.pose, &b.pose);
    let agrees = |known: &&LinkMotion| {
        let apart = (0..3).map(|axis| (known.coordinates[axis] - now.coordinates[axis]).abs());
        let turned = convert::rotation(known.rotation).inverse() * convert::rotation(now.rotation);
        apart.fold(2.0 * turned.xyz().length(), f32::max) < SAME
    };
    let LinkMotion { coordinates, rotation, .. } = known.filter(agrees).copied().unwrap_or(now);
    let velocity = velocity_between(joint, a, b);
    let mut root_velocity = [0.0; 6];
    root_velocity[..3].copy_from_slice(&root.velocity.linear);
    root_velocity[3..].copy_from_slice(&root.velocity.angular);
    LinkMotion { coordinates, rotation, velocity, root_velocity }
}

/// Returns the velocities of a joint's degrees of freedom, as if the mass of its two bodies lay around their
/// positions. Where it does not, the velocity of a body that slides on a turning one comes out too high or
/// too low.
fn velocity_between(joint: &GenericJoint, a: &BodyState, b: &BodyState) -> [f32; 6] {
    let [from, to] = [a, b].map(|state| convert::vector(state.velocity.linear));
    let [turning, spinning] = [a, b].map(|state| convert::vector(state.velocity.angular));
    let [frame, other] = [a, b].map(|state| convert::rotation(state.pose.rotation));
    let apart = convert::region_from_world(a.pose.translation, &b.pose).translation;
    let spin = spinning - turning;
    let slide = to - from - turning.cross(apart) + spin.cross(other * joint.local_frame2.translation);
    let into_joint = (frame * joint.local_frame1.rotation).inverse();
    let (slide, spin) = ((into_joint * slide).to_array(), (into_joint * spin).to_array());
    let all = [slide[0], slide[1], slide[2], spin[0], spin[1], spin[2]];
    free_of(joint.locked_axes.bits(), all)
}

/// Returns the angle, or the angle with a turn added or taken away, whichever is nearest to being within the
/// limits.
fn nearest_turn(angle: f32, limits: &JointLimits<f32>) -> f32 {
    const TURN: f32 = std::f32::consts::TAU;
    let beyond = |angle: &f32| (limits.min - angle).max(angle - limits.max).max(0.0);
    let angles = [angle, angle + TURN, angle - TURN].into_iter();
    angles.min_by(|a, b| beyond(a).total_cmp(&beyond(b))).unwrap_or(angle)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hinge_is_taken_to_be_within_its_limits_also_beyond_half_a_turn() {
        let found = |angle: f32, limits: [f32; 2]| {
            let hinge = GenericJointBuilder::new(JointAxesMask::LOCKED_REVOLUTE_AXES);
            let hinge = hinge.limits(JointAxis::AngX, limits).build();
            let at = WorldPose::at([0.0; 3]);
            let turned = WorldPose { rotation: Rotation::from_rotation_x(angle).to_array(), ..at };
            motion_between(&hinge, &at, &turned).coordinates[3]
        };
        let near = |a: f32, b: f32| (a - b).abs() < 1e-5;
        for (angle, limits) in
            [(3.5, [-0.0175, 3.7525]), (3.75251, [-0.0175, 3.7525]), (-4.0, [-5.0, 0.0]), (1.0, [-9.0, 9.0])]
        {
            assert!(near(found(angle, limits), angle), "{angle}: {}", found(angle, limits));
        }
        assert!(near(found(2.0, [-1.0, 0.5]), 2.0), "what is beyond them by less stays so");
    }

    #[test]
    fn a_ball_joint_is_taken_to_be_within_its_limits_and_points_where_it_does() {
        let ball = SphericalJointBuilder::new()
            .limits(JointAxis::AngX, [-0.4, 0.4])
            .limits(JointAxis::AngZ, [-0.1, 2.0])
            .build();
        let ball = GenericJoint::from(ball);
        let at = WorldPose::at([0.0; 3]);
        let rotation = Rotation::from_scaled_axis(Vector::new(0.9, -1.0, 0.3));
        let motion = motion_between(&ball, &at, &WorldPose { rotation: rotation.to_array(), ..at });
        let mut joint = MultibodyJoint::new(ball, false);
        displacements(&joint, &motion).iter().for_each(|way| joint.apply_displacement(way));
        let found: [f32; 3] = std::array::from_fn(|axis| joint.coords()[3 + axis]);
        let off = std::iter::zip(found, [0.4, -1.0, 0.3]).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(off < 1e-4, "{found:?}");
        assert!(joint.joint_rot().angle_between(rotation) < 2e-3);
    }

    #[test]
    fn a_ball_joint_that_has_tumbled_points_where_it_did_and_knows_how_far_it_turned() {
        let fresh = || MultibodyJoint::new(SphericalJointBuilder::new().build().into(), false);
        for seconds in [0, 1, 10, 100] {
            let mut joint = fresh();
            for tick in 0..60 * seconds {
                let t = tick as f32 / 60.0;
                joint.integrate(1.0 / 60.0, &[3.0 * t.sin(), 2.0, 4.0 * (1.3 * t).cos()]);
            }
            let motion = LinkMotion {
                coordinates: std::array::from_fn(|axis| joint.coords()[axis]),
                rotation: joint.joint_rot().to_array(),
                ..LinkMotion::default()
            };
            let mut again = fresh();
            displacements(&again, &motion).iter().for_each(|way| again.apply_displacement(way));
            let off =
                (0..6).map(|axis| (again.coords()[axis] - joint.coords()[axis]).abs()).fold(0.0, f32::max);
            assert!(off < 1e-4, "{seconds} s: the turns add up to {off} rad more or less");
            let apart = again.joint_rot().angle_between(joint.joint_rot());
            assert!(apart < 2e-3, "{seconds} s: points {apart} rad elsewhere");
        }
    }
}
