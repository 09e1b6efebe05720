//! Sets how much joints bear before dcd_events reports them.

use crate::guard::guard;
use crate::handle::stale;
use crate::ids::{DcdJointId, DcdWorld};
use crate::registry::with;
use crate::status::{DcdStatus, Failure};

/// Sets how much the locked axes of a joint bear: `force` in newtons and `torque` in newton metres, 0 or more; INFINITY for any
/// load, as at first. After each dcd_step in which the joint bears more, DcdEventView.overloads reports it. The joint stays as it
/// is until the program destroys it. The strength is saved with the world.
///
/// The load is that of the whole joint, however many regions share it. It is that of the solver's last iteration, without the
/// forces of limits and motors. A load that lasts shows. Of a blow, only what the last iteration had left to bear shows. The torque
/// is not that about the anchor, unless this is the body's centre of mass: go by the force.
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world or joint), DCD_ERR_ARGUMENT (numbers below 0 or NaN), DCD_ERR_UNSUPPORTED (in a
/// served world).
#[unsafe(no_mangle)]
pub extern "C" fn dcd_joint_set_strength(
    world: DcdWorld,
    joint: DcdJointId,
    force: f32,
    torque: f32,
) -> DcdStatus {
    guard("dcd_joint_set_strength", || {
        for (value, name) in [(force, "force"), (torque, "torque")] {
            if value.is_nan() || value < 0.0 {
                return Err(Failure::argument(format!("{name} is {value}; give 0 or more, or INFINITY")));
            }
        }
        with(world, |world| {
            world.dcd.watches_joints()?;
            let id = world.mark.joint_id(joint)?;
            if world.dcd.joint(id).is_none() {
                return Err(stale("joint", joint.v));
            }
            Ok(world.dcd.set_joint_strength(id, force, torque)?)
        })
    })
}
