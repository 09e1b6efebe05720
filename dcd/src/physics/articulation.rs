//! Multibody joints: bodies in reduced coordinates. Rapier solves all links of a multibody together, so one region has all
//! of it, with whatever other joints tie to it: it is never shared, and moves whole.

use rapier3d::prelude::*;

use super::convert;
use crate::protocol::{JointRecord, LinkMotion, LinkRecord, WorldPose};

/// What a multibody joint has besides what every joint has.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LinkSettings {
    /// Velocities of its degrees of freedom are the user's alone.
    pub kinematic: bool,
    /// By degree of freedom, the linear ones first: damping, N·s/m or N·m·s; `None` is Rapier's choice, 0.1 for turning.
    pub damping: Option<[f32; 6]>,
    /// Inertia added to each degree of freedom, kg or kg·m².
    pub armature: [f32; 6],
    /// Dry friction of each degree of freedom, N or N·m.
    pub friction: [f32; 6],
    /// By axis (x, y, z, about x, y, z): stiffness of a spring, N/m or N·m, and where it rests, metres or radians.
    pub springs: [[f32; 2]; 6],
}

impl LinkSettings {
    pub(crate) fn record(&self) -> LinkRecord {
        let Self { kinematic, damping, armature, friction, springs } = *self;
        LinkRecord { kinematic, damping, armature, friction, springs, motion: None }
    }
}

/// Why Rapier cannot have a joint in a multibody, if so.
pub(super) fn fault(joint: &GenericJoint) -> Option<&'static str> {
    // Rapier has no reduced coordinates for these.
    let turning = 3 - (joint.locked_axes.bits() >> 3).count_ones();
    (turning == 2)
        .then_some("it may turn about two axes; use an impulse joint, or two joints with a body between")
}

/// Gives a link that was just inserted what its record says.
pub(super) fn equip(multibody: &mut Multibody, id: usize, record: &LinkRecord) {
    let link = multibody.link_mut(id).expect("just inserted");
    let (first, dofs) = (link.assembly_id(), link.joint().ndofs());
    for (axis, &[stiffness, rest]) in record.springs.iter().enumerate() {
        link.joint.set_spring(axis, stiffness, rest);
    }
    if let Some(motion) = &record.motion {
        link.joint.apply_displacement(&displacement(link.joint(), motion));
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

/// What brings a joint from its zero to where it was.
fn displacement(joint: &MultibodyJoint, motion: &LinkMotion) -> [f32; 6] {
    let locked = joint.data.locked_axes.bits();
    let turned = convert::rotation(motion.rotation).to_scaled_axis().to_array();
    let turning = 3 - (locked >> 3).count_ones();
    let mut way = [0.0; 6];
    let free = (0..6).filter(|axis| locked & (1 << axis) == 0);
    for (dof, axis) in free.enumerate() {
        // About one axis turns are counted; about three there is only where it points.
        way[dof] = if axis >= 3 && turning == 3 { turned[axis - 3] } else { motion.coordinates[axis] };
    }
    way
}

/// The link of a multibody as it is now.
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

/// Where a link is by the poses of its two bodies: for a joint of which nobody remembers more. It is at rest.
pub(super) fn motion_between(joint: &JointRecord, a: &WorldPose, b: &WorldPose) -> LinkMotion {
    // Relative to the first body's place, so that f32 does.
    let anchor = a.translation;
    let frame = |pose: &WorldPose, local| convert::region_from_world(anchor, pose) * convert::pose(local);
    let between = frame(a, joint.frame_a).inverse() * frame(b, joint.frame_b);
    let mut coordinates = [0.0; 6];
    coordinates[..3].copy_from_slice(&between.translation.to_array());
    coordinates[3..].copy_from_slice(&between.rotation.to_scaled_axis().to_array());
    LinkMotion { coordinates, rotation: between.rotation.to_array(), ..LinkMotion::default() }
}
