//! Converts joints to their records and back.

use rapier3d::prelude::*;

use super::convert;
use crate::protocol::{self, JointRecord};
use crate::space::{BodyId, JointId};

/// Returns the record of a joint between the bodies `a` and `b`.
pub fn joint_record(id: JointId, a: BodyId, b: BodyId, joint: &GenericJoint) -> JointRecord {
    JointRecord {
        id,
        a,
        b,
        frame_a: convert::pose_record(&joint.local_frame1),
        frame_b: convert::pose_record(&joint.local_frame2),
        locked_axes: joint.locked_axes.bits(),
        limit_axes: joint.limit_axes.bits(),
        motor_axes: joint.motor_axes.bits(),
        coupled_axes: joint.coupled_axes.bits(),
        limits: joint.limits.map(|limit| protocol::JointLimit {
            min: limit.min,
            max: limit.max,
            impulse: limit.impulse,
        }),
        motors: joint.motors.map(|motor| protocol::JointMotor {
            target_vel: motor.target_vel,
            target_pos: motor.target_pos,
            stiffness: motor.stiffness,
            damping: motor.damping,
            max_force: motor.max_force,
            impulse: motor.impulse,
            acceleration_based: motor.model == MotorModel::AccelerationBased,
        }),
        softness: [joint.softness.natural_frequency, joint.softness.damping_ratio],
        contacts_enabled: joint.contacts_enabled,
        // Rapier itself disables a joint of a disabled body: that is not the user's choice.
        enabled: joint.enabled != JointEnabled::Disabled,
        user_data: joint.user_data,
        link: None,
    }
}

/// Returns the record of a joint that its user changed in place.
pub(super) fn renewed(record: &JointRecord, joint: &GenericJoint) -> JointRecord {
    JointRecord { link: record.link, ..joint_record(record.id, record.a, record.b, joint) }
}

pub(crate) fn joint_of(record: &JointRecord) -> GenericJoint {
    let axes = JointAxesMask::from_bits_truncate;
    let mut joint = GenericJoint {
        local_frame1: convert::pose(record.frame_a),
        local_frame2: convert::pose(record.frame_b),
        locked_axes: axes(record.locked_axes),
        limit_axes: axes(record.limit_axes),
        motor_axes: axes(record.motor_axes),
        coupled_axes: axes(record.coupled_axes),
        softness: SpringCoefficients::new(record.softness[0], record.softness[1]),
        contacts_enabled: record.contacts_enabled,
        user_data: record.user_data,
        ..GenericJoint::default()
    };
    for (limit, from) in joint.limits.iter_mut().zip(&record.limits) {
        *limit = JointLimits { min: from.min, max: from.max, impulse: from.impulse };
    }
    for (motor, from) in joint.motors.iter_mut().zip(&record.motors) {
        *motor = JointMotor {
            target_vel: from.target_vel,
            target_pos: from.target_pos,
            stiffness: from.stiffness,
            damping: from.damping,
            max_force: from.max_force,
            impulse: from.impulse,
            model: if from.acceleration_based {
                MotorModel::AccelerationBased
            } else {
                MotorModel::ForceBased
            },
        };
    }
    joint.set_enabled(record.enabled);
    joint
}

/// Gives the motors of a joint that `parts` regions solve their part of the record's forces (mass splitting). Acceleration-based
/// springs follow the masses by themselves.
pub(super) fn share_out(joint: &mut GenericJoint, record: &JointRecord, parts: usize) {
    let share = 1.0 / parts as f32;
    for (motor, whole) in joint.motors.iter_mut().zip(&record.motors) {
        let spring = if whole.acceleration_based { 1.0 } else { share };
        motor.stiffness = whole.stiffness * spring;
        motor.damping = whole.damping * spring;
        motor.max_force = whole.max_force * share;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_joint_survives_its_record() {
        let joint: GenericJoint = RevoluteJointBuilder::new(Vector::Z)
            .local_anchor1(Vector::new(1.0, 2.0, 3.0))
            .limits([-0.5, 0.25])
            .motor_velocity(2.0, 0.5)
            .motor_max_force(7.0)
            .motor_model(MotorModel::ForceBased)
            .contacts_enabled(false)
            .softness(SpringCoefficients::new(30.0, 2.0))
            .build()
            .into();
        let record = joint_record(JointId(3), BodyId::persistent(1), BodyId::persistent(2), &joint);
        assert_eq!(joint_of(&record), joint);
        let rope: GenericJoint = RopeJointBuilder::new(2.0).build().into();
        assert_eq!(joint_of(&joint_record(JointId(0), BodyId::default(), BodyId::default(), &rope)), rope);
    }
}
