//! Gives mass to bodies to which the formats give none. Rapier's impulse joints take a body without mass for
//! an immovable one, but in both formats such bodies are frames that move along with others.

use std::collections::VecDeque;

use rapier3d::glamx::glam::{DMat3, DVec3};
use rapier3d::prelude::*;

use super::mass::{Mass, about_middle};
use super::model::{Model, ModelJoint, Part, is_weld};
use super::source::Fault;
use super::warnings::Warnings;

/// The largest fraction of its mass that a body lends to one without.
const LENT: f64 = 0.1;

/// Fixes bodies that are welded to something fixed, and gives every other body mass and inertia.
pub(super) fn settle(model: &mut Model) -> Result<(), Fault> {
    fix_welded(model);
    for index in 0..model.parts.len() {
        if model.parts[index].is_dynamic() && model.parts[index].mass.inv_mass == 0.0 {
            borrow(model, index)?;
        }
    }
    for part in model.parts.iter_mut().filter(|part| part.is_dynamic()) {
        give_inertia(part, &mut model.warnings);
    }
    Ok(())
}

/// Gives a body the inertia of its shapes, or that of a ball, if it has none.
pub(super) fn give_inertia(part: &mut Part, warnings: &mut Warnings) {
    let inertia = part.mass.principal_inertia();
    if inertia.min_element() > 0.0 {
        return;
    }
    let impossible = inertia.max_element() > 0.0;
    let Mass { kg, centre, .. } = Mass::of(&part.mass);
    let shapes: Mass = part
        .colliders
        .iter()
        .map(|collider| Mass::of_shape(&*collider.shape).placed(&collider.position))
        .sum();
    let has_shape = shapes.kg > 0.0 && shapes.principal().0.min_element() > 0.0;
    let (what, how) = match (impossible, has_shape) {
        (true, true) => ("inertia that no body can have", "that of its shapes is taken"),
        (true, false) => ("inertia that no body can have, without shape", "that of a ball of 0.1 m is taken"),
        (false, true) => ("inertia", "not given: that of its shapes is taken"),
        (false, false) => ("inertia without shape", "not given: that of a ball of 0.1 m is taken"),
    };
    warnings.add(what, &*part.name, how);
    let inertia = if has_shape {
        shapes.inertia * (kg / shapes.kg)
    } else {
        DMat3::from_diagonal(DVec3::splat(0.4 * kg * 0.01))
    };
    part.mass = Mass { kg, centre, inertia }.properties();
}

/// Fixes bodies that a weld of the tree ties to something fixed; the joint is removed.
fn fix_welded(model: &mut Model) {
    let Model { parts, joints, .. } = model;
    loop {
        let before = joints.len();
        // Most joints come after those of their parents, so that one pass is mostly enough.
        joints.retain(|joint| {
            let ends = [joint.a, joint.b];
            let fixes =
                joint.tree && is_weld(&joint.joint) && ends.into_iter().any(|end| parts[end].is_fixed());
            for end in ends.into_iter().filter(|_| fixes) {
                if parts[end].is_dynamic() {
                    parts[end].body.body_type = RigidBodyType::Fixed;
                }
            }
            !fixes
        });
        if joints.len() == before {
            return;
        }
    }
}

/// Moves some mass from the nearest body that has some, welded bodies first, to a body without. There it is a
/// ball at the joint through which the two are tied. Together the two keep their mass, their centre of mass,
/// and their inertia about it. This holds when the joint turns too, since a turn does not change a ball at
/// the hinge.
///
/// If the body without mass slides, a rail would bear the weight that it borrows. Then the lender keeps the
/// weight, and the ball is at the lender's centre of mass.
fn borrow(model: &mut Model, poor: usize) -> Result<(), Fault> {
    let Some((donor, joint)) = donor(model, poor) else {
        let cause = format!(
            "`{}` can move but has no mass, and neither has anything that it is joined to",
            model.parts[poor].name
        );
        return Err(Fault::new(
            cause,
            "give it a mass (MJCF: <inertial>, or <geom density>; URDF: <inertial>)",
        ));
    };
    let tied = |joint: &&ModelJoint| joint.tree && (joint.a == poor || joint.b == poor);
    let slides = model
        .joints
        .iter()
        .filter(tied)
        .any(|joint| !joint.joint.locked_axes.contains(JointAxesMask::LIN_AXES));
    let joint = &model.joints[joint];
    let frame = if joint.a == poor { joint.joint.local_frame1 } else { joint.joint.local_frame2 };
    let between = model.parts[donor].pose.inverse() * model.parts[poor].pose;
    let whole = model.parts[donor].mass;
    let at = if slides { whole.local_com } else { between * frame.translation };
    let (rest, ball) = split(&whole, at);
    if slides {
        model.parts[donor].body.gravity_scale *= whole.mass() / rest.mass();
        model.parts[poor].body.gravity_scale = 0.0;
    }
    model.parts[donor].mass = rest;
    model.parts[poor].mass = MassProperties { local_com: between.inverse() * at, ..ball };
    Ok(())
}

/// Returns the nearest dynamic body with mass and inertia, and the joint through which the poor body is tied
/// towards it. Welds are followed first, then all joints of the tree, children before parents.
fn donor(model: &Model, poor: usize) -> Option<(usize, usize)> {
    let ties = |only_welds: bool| {
        let mut seen = vec![false; model.parts.len()];
        let mut queue = VecDeque::from([(poor, None)]);
        seen[poor] = true;
        while let Some((at, first)) = queue.pop_front() {
            if let Some(first) = first
                && model.parts[at].is_dynamic()
                && model.parts[at].mass.principal_inertia().min_element() > 0.0
            {
                return Some((at, first));
            }
            // A fixed body ties no moving body to another.
            if model.parts[at].is_fixed() {
                continue;
            }
            let towards = |from_parent: bool| {
                model.joints.iter().enumerate().filter_map(move |(index, joint)| {
                    let (here, there) = if from_parent { (joint.a, joint.b) } else { (joint.b, joint.a) };
                    let usable = joint.tree && here == at && (!only_welds || is_weld(&joint.joint));
                    usable.then_some((index, there))
                })
            };
            for (index, there) in towards(true).chain(towards(false)) {
                if !std::mem::replace(&mut seen[there], true) {
                    queue.push_back((there, first.or(Some(index))));
                }
            }
        }
        None
    };
    ties(true).or_else(|| ties(false))
}

/// Splits a body's mass into a rest and a ball that together are what it was. `at` is where the ball belongs,
/// in the body's space; the ball itself is returned about its own centre.
fn split(whole: &MassProperties, at: Vector) -> (MassProperties, MassProperties) {
    let Mass { kg, centre, inertia } = Mass::of(whole);
    let least = f64::from(whole.principal_inertia().min_element());
    let arm = at.as_dvec3() - centre;
    let mut share = LENT;
    loop {
        let (lent, turning) = (kg * share, least * share);
        let kept = kg - lent;
        // The inertia of two point masses on a line through their common centre of mass.
        let pair = about_middle(arm) * (lent * kg / kept);
        let turning_inertia = DMat3::from_diagonal(DVec3::splat(turning));
        let rest = Mass {
            kg: kept,
            centre: centre - arm * (lent / kept),
            inertia: inertia - pair - turning_inertia,
        };
        if rest.principal().0.min_element() > 0.5 * least || share < 1e-4 {
            let ball = Mass { kg: lent, centre: DVec3::ZERO, inertia: turning_inertia };
            return (rest.properties(), ball.properties());
        }
        share *= 0.5;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_body_and_the_ball_that_it_lent_together_weigh_and_turn_as_before() {
        let whole = MassProperties::new(Vector::new(0.0, 0.2, -0.3), 4.0, Vector::new(0.5, 0.4, 0.1));
        let at = Vector::new(0.1, 0.0, 0.2);
        let (rest, ball) = split(&whole, at);
        let together = MassProperties { local_com: at, ..ball };
        let together = (Mass::of(&rest) + Mass::of(&together)).properties();
        assert!((together.mass() - 4.0).abs() < 1e-5);
        assert!((together.local_com - whole.local_com).length() < 1e-6);
        let difference = together.reconstruct_inertia_matrix() - whole.reconstruct_inertia_matrix();
        let largest = difference.to_cols_array().into_iter().fold(0.0, |a: f32, b| a.max(b.abs()));
        assert!(largest < 1e-5, "{difference:?}");
        assert!(ball.mass() > 0.01 && ball.principal_inertia().x > 0.0);
    }
}
