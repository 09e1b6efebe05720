//! Builds one motor per axis from what drives and brakes joints: springs, damping and dry friction of
//! `<joint>`, and `<actuator>`s.
//!
//! MuJoCo adds forces: -k (q - r) - d v of the joint, and K (T - q) + D (V - v) of each servo. Their sum is a
//! force-based Rapier motor, not an acceleration-based one, with stiffness k + ΣK, damping d + ΣD, and the
//! targets at which it is at rest.

use rapier3d::prelude::*;
use rapier3d_mjcf::mjcf_rs::body::{Joint, JointType};
use rapier3d_mjcf::mjcf_rs::extras::{Actuator, ActuatorKind};

use crate::physics::LinkSettings;
use crate::scene::models::warnings::Warnings;

/// An actuator as a servo of its joint, in units of the joint.
struct Servo {
    stiffness: f64,
    target: f64,
    damping: f64,
    speed: f64,
    max_force: Option<f64>,
}

/// Sets the joint's motors. `actuators` are those that drive it, each with its control. A link of a multibody
/// has its own springs, damping, dry friction and rotor inertia, so that its motors are the actuators alone.
pub(super) fn drive(
    joint: &mut GenericJoint,
    link: Option<&mut LinkSettings>,
    from: &Joint,
    name: &str,
    actuators: &[(&Actuator, f64)],
    warnings: &mut Warnings,
) {
    let linked = link.is_some();
    if from.armature > 0.0 && !linked {
        warnings.add("joint armature", name, "has no effect: impulse joints have no rotor inertia");
    }
    if from.type_ == JointType::Ball && from.range.is_some_and(|[_, most]| most > 0.0) {
        warnings.add("range of ball joints", name, "is not limited");
    }
    let servos: Vec<_> = actuators.iter().filter_map(|(of, control)| servo(of, *control, warnings)).collect();
    let axes: &[JointAxis] = match from.type_ {
        JointType::Hinge => &[JointAxis::AngX],
        JointType::Slide => &[JointAxis::LinX],
        JointType::Ball => &[JointAxis::AngX, JointAxis::AngY, JointAxis::AngZ],
        JointType::Free => &[],
    };
    let rest = from.springref - from.ref_;
    if let Some(link) = link {
        // A springdamper replaces both damping and stiffness.
        let own = if from.springdamper.is_none() { 1.0 } else { 0.0 };
        link.damping = Some([(own * from.damping) as f32; 6]);
        link.armature = [from.armature as f32; 6];
        link.friction = [from.frictionloss as f32; 6];
        for &axis in axes {
            link.springs[axis as usize] = [(own * from.stiffness) as f32, rest as f32];
        }
    }
    let [own_stiffness, own_damping, frictionloss] =
        [from.stiffness, from.damping, from.frictionloss].map(|own| if linked { 0.0 } else { own });
    if let Some([time, ratio]) = from.springdamper.filter(|[time, ratio]| *time > 0.0 && *ratio > 0.0) {
        // The motor is acceleration-based: the file asks for a time, whatever the inertia.
        if !servos.is_empty() {
            warnings.add("actuator on a joint with springdamper", name, "has no effect");
        }
        let (stiffness, damping) = (1.0 / (time * time * ratio * ratio), 2.0 / time);
        for &axis in axes {
            joint.set_motor_model(axis, MotorModel::AccelerationBased);
            joint.set_motor_position(axis, rest as f32, stiffness as f32, damping as f32);
        }
        return;
    }
    let sum = |of: &dyn Fn(&Servo) -> f64| servos.iter().map(of).sum::<f64>();
    let stiffness = own_stiffness + sum(&|servo: &Servo| servo.stiffness);
    let damping = own_damping + sum(&|servo: &Servo| servo.damping);
    let quotient = |of: f64, by: f64| if by > 0.0 { of / by } else { 0.0 };
    let target = quotient(
        own_stiffness * rest + sum(&|servo: &Servo| servo.stiffness * (servo.target - from.ref_)),
        stiffness,
    );
    let speed = quotient(sum(&|servo: &Servo| servo.damping * servo.speed), damping);
    for &axis in axes {
        if stiffness > 0.0 || damping > 0.0 {
            joint.set_motor_model(axis, MotorModel::ForceBased);
            joint.set_motor(axis, target as f32, speed as f32, stiffness as f32, damping as f32);
        } else if frictionloss > 0.0 {
            joint.set_motor_model(axis, MotorModel::ForceBased);
            joint.set_motor_velocity(axis, 0.0, 0.0);
            joint.set_motor_max_force(axis, frictionloss as f32);
        }
    }
    if frictionloss > 0.0 && (stiffness > 0.0 || damping > 0.0) {
        warnings.add("joint frictionloss", name, "has no effect beside a spring, damping or an actuator");
    }
    match &servos[..] {
        [Servo { max_force: Some(most), .. }] if own_stiffness == 0.0 => {
            for &axis in axes {
                joint.set_motor_max_force(axis, *most as f32);
            }
        }
        servos if servos.iter().any(|servo| servo.max_force.is_some()) => {
            warnings.add("actuator forcerange", name, "is not limited beside a spring or another actuator");
        }
        _ => {}
    }
}

fn servo(of: &Actuator, control: f64, warnings: &mut Warnings) -> Option<Servo> {
    let name = of.name.clone().unwrap_or_else(|| "an actuator without a name".to_owned());
    let limited = of.ctrl_limited.resolve(true, of.ctrl_range.is_some());
    let control = match of.ctrl_range.filter(|_| limited) {
        Some([least, most]) => control.max(least).min(most),
        None => control,
    };
    let gear = of.gear[0];
    if gear == 0.0 {
        return None;
    }
    let limited = of.force_limited.resolve(true, of.force_range.is_some());
    let max_force = of.force_range.filter(|_| limited).map(|[_, most]| most.abs() * gear.abs());
    let spring = |stiffness: f64, damping: f64, target: f64| Servo {
        stiffness: stiffness * gear * gear,
        target: target / gear,
        damping: damping * gear * gear,
        speed: 0.0,
        max_force,
    };
    let parameter = |list: &[f64], index: usize, default: f64| list.get(index).copied().unwrap_or(default);
    match of.kind {
        ActuatorKind::Position => Some(spring(of.kp.unwrap_or(1.0), of.kv.unwrap_or(0.0), control)),
        // The control is a speed, summed up from where the joint starts.
        ActuatorKind::IntVelocity => {
            if control != 0.0 {
                warnings.add("control of intvelocity", name, "holds still");
            }
            Some(spring(of.kp.unwrap_or(1.0), of.kv.unwrap_or(0.0), 0.0))
        }
        ActuatorKind::Velocity => {
            let damping = of.kv.unwrap_or(1.0) * gear * gear;
            Some(Servo { stiffness: 0.0, target: 0.0, damping, speed: control / gear, max_force })
        }
        ActuatorKind::General if of.bias_type.as_deref() == Some("affine") => {
            let [bias, stiffness, damping] = [0, 1, 2].map(|i| parameter(&of.biasprm, i, 0.0));
            let push = parameter(&of.gainprm, 0, 1.0) * control + bias;
            if stiffness < 0.0 {
                return Some(spring(-stiffness, -damping, push / -stiffness));
            }
            if push != 0.0 && damping >= 0.0 {
                warnings.add("constant force of an actuator", name, "is not applied");
                return None;
            }
            let damping = -damping * gear * gear;
            let speed = if damping > 0.0 { push * gear / damping } else { 0.0 };
            Some(Servo { stiffness: 0.0, target: 0.0, damping, speed, max_force })
        }
        ActuatorKind::Damper => {
            let damping = of.kv.unwrap_or(1.0) * control * gear * gear;
            Some(Servo { stiffness: 0.0, target: 0.0, damping, speed: 0.0, max_force: None })
        }
        ActuatorKind::Motor | ActuatorKind::General => {
            let muscle = |kind: &Option<String>| {
                kind.as_deref().is_some_and(|kind| kind == "muscle" || kind == "user")
            };
            if muscle(&of.gain_type) || muscle(&of.bias_type) {
                warnings.add("muscle", name, "has no effect");
            } else if control != 0.0 {
                warnings.add("constant force of an actuator", name, "is not applied");
            }
            None
        }
        ActuatorKind::Other => {
            warnings.add(
                "actuator other than motor, position, velocity, intvelocity, damper, general",
                name,
                "has no effect",
            );
            None
        }
    }
}
