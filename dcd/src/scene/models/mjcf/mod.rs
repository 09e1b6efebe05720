//! Reads MJCF files through rapier3d-mjcf.

mod attach;
mod classes;
mod contacts;
mod drives;
mod flatten;
mod poses;
mod scan;
mod shapes;

use std::collections::BTreeSet;

use rapier3d::prelude::*;
use rapier3d_mjcf::mjcf_rs::body::{Joint, JointType};
use rapier3d_mjcf::mjcf_rs::equality::Equality;
use rapier3d_mjcf::mjcf_rs::{self as mjcf, ParseError};
use rapier3d_mjcf::{MjcfBody, MjcfDofKind, MjcfLoaderOptions, MjcfRobot};

use super::ModelParams;
use super::files::Files;
use super::model::{MAX_BODIES, Model, ModelJoint, Part, collider_builder, drop_wide_limits, mass_of};
use super::source::{Fault, Source};
use super::warnings::Warnings;
use crate::physics::LinkSettings;
use crate::scene::SceneError;
use scan::Flags;
use shapes::Placed;

/// Reads an MJCF file into a model.
pub(super) fn read(source: &Source, params: &ModelParams, files: &Files) -> Result<Model, SceneError> {
    let source = &flatten::flatten(source, files)?;
    let document = source.document("mujoco")?;
    let mut warnings = Warnings::default();
    let mut flags = scan::check(source, &document, &mut warnings).map_err(|fault| source.fault(fault))?;
    attach::check(source, &document, files, &mut flags, &mut warnings)?;
    let file = mjcf::Model::from_str(&poses::complete(&document), source.folder())
        .map_err(|error| source.fault(fault(&error)))?;
    convert(source, file, &flags, warnings, params, files).map_err(|fault| source.fault(fault))
}

fn convert(
    source: &Source,
    mut file: mjcf::Model,
    flags: &Flags,
    mut warnings: Warnings,
    params: &ModelParams,
    files: &Files,
) -> Result<Model, Fault> {
    if file.bodies.len() > MAX_BODIES {
        let cause = format!("the model has {} bodies, which is more than {MAX_BODIES}", file.bodies.len());
        return Err(Fault::new(cause, "join what does not move by itself into one body, or split the model"));
    }
    check_references(&mut file, &flags.attached)?;
    let shapes = shapes::prepare(&mut file, source.folder(), files, &flags.convex, &mut warnings)?;
    let options = MjcfLoaderOptions {
        skip_plane_geoms: false,
        make_roots_fixed: params.fixed,
        // `drives` makes motors from the file's numbers.
        disable_joint_motors: true,
        ..MjcfLoaderOptions::default()
    };
    let mut robot = MjcfRobot::from_model(&file, options, source.folder());
    let controls = start(&mut robot, params.key, &mut warnings)?;
    let used = world_is_used(&robot);
    // Without the world, which the loader counts as body 0, all others move down by one.
    let part_of = |body: usize| body - usize::from(!used);
    let parts = robot.bodies.iter().enumerate().skip(usize::from(!used));
    let parts = parts.map(|(index, body)| part(index, body, &file, &shapes, flags)).collect();
    let mut model = Model {
        name: file.name.clone().unwrap_or_else(|| source.stem()),
        gravity: if flags.gravity { robot.gravity.to_array() } else { [0.0; 3] },
        dt_s: Some(file.option.timestep as f32),
        parts,
        joints: Vec::new(),
        apart: contacts::apart(&robot, &file, flags.filter_parent)?
            .into_iter()
            .filter(|&(a, _)| used || a > 0)
            .map(|(a, b)| (part_of(a), part_of(b)))
            .collect(),
        warnings,
    };
    add_joints(&mut model, &robot, &file, &controls, params.multibody, part_of);
    add_loops(&mut model, &robot, &file, part_of)?;
    contacts::warn(&file, &mut model.warnings);
    Ok(model)
}

/// Refuses free joints, excludes and equalities that the loader would leave out with a line in a log. As in
/// MuJoCo, excludes and equalities are dropped if they name a body of an attached model (`attached`) that is
/// not attached with the others.
fn check_references(file: &mut mjcf::Model, attached: &BTreeSet<String>) -> Result<(), Fault> {
    let bodies: Vec<_> = file.bodies.iter().filter_map(|entry| entry.body.name.clone()).collect();
    let known = |name: &str| name == "world" || bodies.iter().any(|body| body == name);
    let is_here = |name: &str| known(name) || !attached.contains(name);
    file.contact.excludes.retain(|exclude| is_here(&exclude.body1) && is_here(&exclude.body2));
    file.equality.retain(|equality| match equality {
        Equality::Connect(of) => is_here(&of.body1) && of.body2.as_deref().is_none_or(is_here),
        Equality::Weld(of) => is_here(&of.body1) && of.body2.as_deref().is_none_or(is_here),
        Equality::Joint(_) | Equality::Tendon(_) => true,
    });
    unique("body", bodies.iter().map(String::as_str).chain(["world"]))?;
    let joints = || file.bodies.iter().flat_map(|entry| &entry.body.joints);
    unique("joint", joints().filter_map(|joint| joint.name.as_deref()))?;
    let geoms = file.bodies.iter().flat_map(|entry| &entry.body.geoms);
    unique("geom", geoms.filter_map(|geom| geom.name.as_deref()))?;
    let turns_about = |joint: &&Joint| matches!(joint.type_, JointType::Hinge | JointType::Slide);
    if let Some(joint) = joints().filter(turns_about).find(|joint| joint.axis == [0.0; 3]) {
        let name = joint.name.as_deref().unwrap_or("without a name");
        return Err(Fault::new(format!("the axis of joint {name} is 0 0 0"), "give it a direction"));
    }
    let must = |what: &str, name: &str| {
        let cause = format!("{what} names body `{name}`, which is not there");
        if known(name) {
            Ok(())
        } else {
            Err(Fault::new(cause, "correct the name, or name bodies and not sites"))
        }
    };
    for entry in &file.bodies {
        let free = entry.body.joints.iter().any(|joint| joint.type_ == JointType::Free);
        if free && (entry.body.joints.len() > 1 || entry.parent != Some(0)) {
            let name = entry.body.name.as_deref().unwrap_or("without a name");
            let cause = format!("body {name} has a free joint beside others, or inside another body");
            return Err(Fault::new(cause, "a free joint is alone on a body of the world"));
        }
    }
    for exclude in &file.contact.excludes {
        must("<exclude>", &exclude.body1)?;
        must("<exclude>", &exclude.body2)?;
    }
    for equality in &mut file.equality {
        let (body1, body2) = match equality {
            Equality::Connect(of) => (&mut of.body1, &mut of.body2),
            Equality::Weld(of) => (&mut of.body1, &mut of.body2),
            Equality::Joint(_) | Equality::Tendon(_) => continue,
        };
        must("<equality>", body1)?;
        if let Some(body2) = body2 {
            must("<equality>", body2)?;
        }
        // The loader does not know the world by a name.
        if body2.as_deref() == Some("world") {
            *body2 = None;
        }
        if body1 == "world" {
            let cause = "<equality> has the world as its first body";
            return Err(Fault::new(cause, "give it as body2, or leave body2 out"));
        }
    }
    Ok(())
}

/// Refuses two elements of one kind and one name: what refers to it could mean either.
fn unique<'a>(kind: &str, names: impl Iterator<Item = &'a str>) -> Result<(), Fault> {
    let mut seen = BTreeSet::new();
    for name in names.filter(|name| !name.is_empty()) {
        if !seen.insert(name) {
            let cause = format!("two elements <{kind}> are named `{name}`");
            return Err(Fault::new(cause, "give each its own name"));
        }
    }
    Ok(())
}

/// Puts the robot in the keyframe that is asked for, and returns its actuators' controls.
fn start(robot: &mut MjcfRobot, key: usize, warnings: &mut Warnings) -> Result<Vec<f64>, Fault> {
    if key == 0 {
        return Ok(vec![0.0; robot.actuators.len()]);
    }
    let Some(mut frame) = robot.keyframes.get(key - 1).cloned() else {
        let cause = format!("key={key}, but the file has {} keyframes", robot.keyframes.len());
        return Err(Fault::new(cause, "give key=1 for the first, or leave key out"));
    };
    unit(robot, &mut frame.qpos);
    let (mut bodies, mut colliders, mut joints) =
        (RigidBodySet::new(), ColliderSet::new(), ImpulseJointSet::new());
    let handles = robot.clone().insert_using_impulse_joints(&mut bodies, &mut colliders, &mut joints);
    handles.apply_keyframe(&mut bodies, robot, &frame);
    for (body, handle) in robot.bodies.iter_mut().zip(&handles.bodies) {
        if let Some(placed) = handle.as_ref().map(|handle| &bodies[handle.body]) {
            // In MuJoCo, the velocity of a free joint is that of the body's origin, and its spin is about the
            // body's own axes.
            let angular = *placed.rotation() * placed.angvel();
            let arm = *placed.rotation() * mass_of(&body.body).local_com;
            body.body.set_position(*placed.position(), false);
            body.body.set_linvel(placed.linvel() + angular.cross(arm), false);
            body.body.set_angvel(angular, false);
        }
    }
    let mut speeds = &frame.qvel[..];
    for dof in &robot.qpos_dofs {
        let (own, rest) = speeds.split_at(dof.kind.qvel_width().min(speeds.len()));
        speeds = rest;
        if let Some(joint) = dof.joint.filter(|_| own.iter().any(|speed| *speed != 0.0)) {
            let name = robot.joints[joint].name.as_deref().unwrap_or("a joint without a name");
            warnings.add("velocity of a joint in a keyframe", name, "starts at rest");
        }
    }
    Ok((0..robot.actuators.len()).map(|index| frame.ctrl.get(index).copied().unwrap_or(0.0)).collect())
}

/// Normalises the quaternions of a keyframe, as MuJoCo does: they may have few digits, or any length.
fn unit(robot: &MjcfRobot, qpos: &mut [f64]) {
    let mut rest = qpos;
    for dof in &robot.qpos_dofs {
        let (own, others) = rest.split_at_mut(dof.kind.qpos_width().min(rest.len()));
        rest = others;
        let rotation = match dof.kind {
            MjcfDofKind::Free => own.get_mut(3..7),
            MjcfDofKind::Ball => own.get_mut(..4),
            _ => None,
        };
        if let Some(rotation) = rotation {
            let length = rotation.iter().map(|value| value * value).sum::<f64>().sqrt();
            match length > 0.0 {
                true => rotation.iter_mut().for_each(|value| *value /= length),
                false => rotation.copy_from_slice(&[1.0, 0.0, 0.0, 0.0]),
            }
        }
    }
}

/// Returns whether the world has a body, by the loader's rule.
fn world_is_used(robot: &MjcfRobot) -> bool {
    let ties = robot.joints.iter().map(|joint| (joint.link1, joint.link2));
    let loops = robot.equality_joints.iter().map(|joint| (joint.link1, joint.link2));
    ties.chain(loops).any(|(a, b)| a == 0 || b == 0) || !robot.bodies[0].colliders.is_empty()
}

fn part(index: usize, body: &MjcfBody, file: &mjcf::Model, shapes: &[Vec<Placed>], flags: &Flags) -> Part {
    let name = body
        .name
        .clone()
        .unwrap_or_else(|| if index == 0 { "world".into() } else { format!("body {index}") });
    let geoms = file.bodies[body.mjcf_body_id].body.geoms.iter();
    let touching = geoms.filter(|geom| geom.contype != 0 || geom.conaffinity != 0);
    // To the loader every geom is a ball or a plane, so it makes one collider per geom that touches, in
    // order.
    let colliders = body.colliders.iter().zip(&shapes[body.mjcf_body_id]).zip(touching);
    let colliders = colliders.map(|((collider, (shape, pose)), geom)| {
        let builder = ColliderBuilder { shape: shape.clone(), ..collider_builder(collider) }.position(*pose);
        contacts::touch(builder, geom, flags.contact)
    });
    Part::of(name, &body.body, colliders.collect())
}

/// Returns the joints of the file in the order in which the loader makes its own. A free joint gives none. A
/// body without joints in another body gives `None`: the loader makes a joint for it that locks everything.
fn joints_in_order(file: &mjcf::Model) -> impl Iterator<Item = Option<&Joint>> {
    file.bodies.iter().skip(1).flat_map(|entry| {
        let joints = &entry.body.joints;
        let weld = (joints.is_empty() && entry.parent != Some(0)).then_some(None);
        joints.iter().filter(|joint| joint.type_ != JointType::Free).map(Some).chain(weld)
    })
}

fn add_joints(
    model: &mut Model,
    robot: &MjcfRobot,
    file: &mjcf::Model,
    controls: &[f64],
    multibody: bool,
    part_of: impl Fn(usize) -> usize,
) {
    for (index, (made, from)) in robot.joints.iter().zip(joints_in_order(file)).enumerate() {
        let (a, b) = (part_of(made.link1), part_of(made.link2));
        let name = made.name.clone().unwrap_or_else(|| format!("the joint of {}", model.parts[b].name));
        let mut joint = made.joint;
        // The bodies that stand between two joints of one body have no colliders.
        joint.contacts_enabled = !model.apart.contains(&(a.min(b), a.max(b)));
        let mut link = (multibody && model.links(a, b, &joint)).then(LinkSettings::default);
        if let Some(from) = from {
            let actuators = robot.actuators.iter().zip(controls);
            let mine = actuators.filter(|(actuator, _)| {
                actuator.actuator.joint.is_some() && actuator.joint_index == Some(index)
            });
            let mine: Vec<_> = mine.map(|(actuator, &control)| (&actuator.actuator, control)).collect();
            drives::drive(&mut joint, link.as_mut(), from, &name, &mine, &mut model.warnings);
            if link.is_none() && drop_wide_limits(&mut joint) {
                model.warnings.add("range of a whole turn or more", &*name, "is not limited");
            }
        }
        model.joints.push(ModelJoint { a, b, joint, tree: true, link });
    }
    let joint_names: BTreeSet<_> =
        file.bodies.iter().flat_map(|entry| &entry.body.joints).filter_map(|j| j.name.as_deref()).collect();
    for entry in
        file.bodies.iter().filter(|entry| entry.body.joints.iter().any(|j| j.type_ == JointType::Free))
    {
        if entry.body.joints[0].damping > 0.0 || entry.body.joints[0].stiffness > 0.0 {
            let name = entry.body.name.as_deref().unwrap_or("a body without a name");
            model.warnings.add("damping of a free joint", name, "has no effect");
        }
    }
    let is_there = |name: &String| joint_names.contains(name.as_str());
    for (actuator, made) in robot.actuators.iter().map(|made| (&made.actuator, made)) {
        if let Some(joint) = actuator.joint.as_ref().filter(|joint| !is_there(joint)) {
            model.warnings.add("actuator of a joint that is not there", &**joint, "has no effect");
        } else if actuator.joint.is_none() || made.joint_index.is_none() {
            let name = actuator.name.as_deref().unwrap_or("an actuator without a name");
            model.warnings.add("actuator of something other than a joint", name, "has no effect");
        }
    }
}

/// Adds the loops of `<equality>` that impulse joints can hold. Unlike joints of the tree, these let their
/// bodies touch.
fn add_loops(
    model: &mut Model,
    robot: &MjcfRobot,
    file: &mjcf::Model,
    part_of: impl Fn(usize) -> usize,
) -> Result<(), Fault> {
    let mut made = robot.equality_joints.iter();
    for equality in &file.equality {
        let relative = match equality {
            Equality::Connect(_) => None,
            Equality::Weld(weld) => weld.relpose.filter(|pose| pose.rotation.length_squared() > 0.0),
            Equality::Joint(of) => {
                model.warnings.add(
                    "equality of joints",
                    &*of.joint1,
                    "has no effect: impulse joints do not know it",
                );
                continue;
            }
            Equality::Tendon(of) => {
                model.warnings.add("equality of tendons", &*of.tendon1, "has no effect");
                continue;
            }
        };
        let made =
            made.next().ok_or_else(|| Fault::new("an <equality> cannot be read", "correct its bodies"))?;
        let mut joint = made.joint;
        if let Some(relative) = relative {
            let relative = Pose::from(relative);
            joint.set_local_frame1(Pose::from_parts(relative.translation, relative.rotation.normalize()));
            joint.set_local_frame2(Pose::IDENTITY);
        }
        joint.contacts_enabled = true;
        joint.set_enabled(made.active);
        model.joints.push(ModelJoint {
            a: part_of(made.link1),
            b: part_of(made.link2),
            joint,
            tree: false,
            link: None,
        });
    }
    Ok(())
}

fn fault(error: &ParseError) -> Fault {
    let remedy = match error {
        ParseError::Io { .. } | ParseError::BadInclude { .. } => "put the file there, or correct the path",
        ParseError::Unsupported { .. } => "save the model again by a newer MuJoCo",
        _ => "correct this element",
    };
    Fault::new(error.to_string(), remedy)
}
