//! Brings back bodies that nobody holds any more, where joints tie them to bodies that went on: at the joint, as they were
//! beside it when the record last heard of both. Where the record has them, a chain would be torn apart by as far as it
//! has swung since.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use nalgebra::{Isometry3, Point3, Quaternion, UnitQuaternion, Vector3};

use crate::cluster::Record;
use crate::protocol::{BodyKind, BodyState, JointRecord, StepRecord, Velocity};
use crate::space::{BodyId, Tick};

/// The most steps from joint to joint in one view change.
const MOST_STEPS: usize = 1_000_000;
/// For how long the velocity of a body tells where it will be while joints hold it, seconds.
const FORESEEN_S: f64 = 0.25;

/// Notes of what the record had of bodies that joints hold, and when it heard of that, before survivors told of them in view
/// changes that were not completed.
#[derive(Clone, Debug, Default)]
pub(in crate::cluster::server) struct Notes(BTreeMap<BodyId, (Tick, BodyState)>);

impl Notes {
    /// Notes what the record has of a body that survivors are asked for, unless it is noted already.
    pub(super) fn note(&mut self, record: &Record, id: BodyId) {
        if record.joints_of(id).next().is_some()
            && let Some(known) = known(record, id)
        {
            self.0.entry(id).or_insert(known);
        }
    }
}

/// The orphans of a view change, which no survivor owns and joints hold, with what these tie them to.
#[derive(Clone, Debug, Default)]
pub(super) struct Orphans {
    /// What the record had of all these bodies before survivors told what they hold.
    known: BTreeMap<BodyId, (Tick, BodyState)>,
    orphans: BTreeSet<BodyId>,
}

impl Orphans {
    /// Finds those of these bodies that joints hold. What was `noted` of them and of what they are tied to counts more
    /// than what the record has by now: survivors may have told of one end of a joint and not of the other.
    pub(super) fn new(record: &Record, notes: &Notes, ids: impl Iterator<Item = BodyId>) -> Self {
        let mut found = Self::default();
        for id in ids {
            for end in record.joints_of(id).flat_map(|joint| [joint.a, joint.b]) {
                if let Some(known) = notes.0.get(&end).copied().or_else(|| known(record, end)) {
                    found.known.insert(end, known);
                    found.orphans.insert(id);
                }
            }
        }
        found
    }

    /// Returns the bodies whose present states are asked for.
    pub(super) fn bodies(&self) -> impl Iterator<Item = BodyId> {
        self.known.keys().copied()
    }

    /// Sets the states of orphans of which no survivor had a copy at tick `now`. An orphan between several bodies that went
    /// on is where these have it at the mean, the nearer counting more. It is no faster than it was when last heard of and
    /// falling since has made it: how the links of a chain turn sums up along it, and would throw what hangs at its end.
    pub(super) fn bring_back(&self, record: &mut Record, now: Tick, step: &StepRecord) {
        let dt_s = f64::from(step.dt_s);
        let lost = |id: &BodyId| self.orphans.contains(id) && record.told_at(*id) < Some(now);
        let lost: BTreeSet<_> = self.orphans.iter().copied().filter(lost).collect();
        let is_guide = |id: &BodyId| {
            let is_fixed = |id| record.body(id).is_some_and(|body| body.traits.kind == BodyKind::Fixed);
            !lost.contains(id) && (record.told_at(*id) >= Some(now) || is_fixed(*id))
        };
        let mut found: BTreeMap<BodyId, Vec<(f64, BodyState)>> = BTreeMap::new();
        let mut steps = 0;
        for &guide in self.known.keys().filter(|id| is_guide(id)) {
            let Some(at) = record.body(guide).map(|body| body.state) else { continue };
            let (mut seen, mut next) = (BTreeSet::from([guide]), VecDeque::from([(guide, at, 1)]));
            while let Some((id, at, joints)) = next.pop_front().filter(|_| steps < MOST_STEPS) {
                for joint in record.joints_of(id) {
                    let other = if joint.a == id { joint.b } else { joint.a };
                    steps += 1;
                    if !lost.contains(&other) || !seen.insert(other) {
                        continue;
                    }
                    let state = tied(joint, id, (self.known[&id], at), self.known[&other], dt_s);
                    found.entry(other).or_default().push((1.0 / f64::powi(f64::from(joints), 2), state));
                    next.push_back((other, state, joints + 1));
                }
            }
        }
        for (id, states) in found {
            if let Some(body) = record.body_mut(id) {
                let mut state = mean(body.state, &states);
                let gravity_m_s2 = vector(step.gravity) * f64::from(body.traits.gravity_scale);
                slow(&mut state, &self.known[&id].1, gravity_m_s2);
                body.set_state(state);
            }
        }
    }
}

/// Returns what a record has of a body, and when it heard of that.
fn known(record: &Record, id: BodyId) -> Option<(Tick, BodyState)> {
    Some((record.told_at(id)?, record.body(id)?.state))
}

/// Where a body is, metres and a rotation, and how it moves, m/s and rad/s.
struct Motion {
    pose: Isometry3<f64>,
    linear: Vector3<f64>,
    angular: Vector3<f64>,
}

impl Motion {
    /// Returns the motion that a body of this state has some seconds later if nothing pushes it, as far as that tells
    /// anything.
    fn of(state: &BodyState, later_s: f64) -> Self {
        Self {
            pose: state.pose.moved(&state.velocity, later_s.min(FORESEEN_S)).isometry(),
            linear: vector(state.velocity.linear),
            angular: vector(state.velocity.angular),
        }
    }

    /// Returns the velocity that the body has at a place.
    fn velocity_at(&self, place: Point3<f64>) -> Vector3<f64> {
        self.linear + self.angular.cross(&(place.coords - self.pose.translation.vector))
    }
}

/// Returns the state of a body that a joint ties to a `guide`, which was `then` and is `at`; the body itself was last heard of
/// in state `own`. It turns with its guide only as far as the joint makes it.
fn tied(
    joint: &JointRecord,
    guide: BodyId,
    (then, at): ((Tick, BodyState), BodyState),
    own: (Tick, BodyState),
    dt_s: f64,
) -> BodyState {
    let when = then.0.max(own.0);
    let [was, own_was] = [then, own].map(|(tick, state)| Motion::of(&state, (when.0 - tick.0) as f64 * dt_s));
    let is = Motion::of(&at, 0.0);
    let frames = [joint.frame_a.isometry(), joint.frame_b.isometry()];
    let [frame, own_frame] = if joint.a == guide { frames } else { [frames[1], frames[0]] };
    let turn = turn(joint.locked_axes, [&was, &is].map(|of| of.pose * frame), own_was.pose * own_frame);
    let end = |of: &Motion, frame: &Isometry3<f64>| of.pose * Point3::from(frame.translation.vector);
    let (old, old_own) = (end(&was, &frame), end(&own_was, &own_frame));
    let rotation = turn * own_was.pose.rotation;
    // Rapier measures along the axes of the joint's first body. Where the joint turns freely, these tell nothing of where
    // the other end is, but for axes that are locked.
    let (first_was, first_is) = match joint.a == guide {
        true => (was.pose.rotation * frame.rotation, is.pose.rotation * frame.rotation),
        false => (own_was.pose.rotation * own_frame.rotation, rotation * own_frame.rotation),
    };
    let first_was = if joint.locked_axes >> 3 == 0 { first_is } else { first_was };
    // Along the axes that the joint leaves free, both ends lie beside each other and move past each other as they did.
    let along_free = |by: Vector3<f64>| {
        let mut along = first_was.inverse() * by;
        (0..3).filter(|axis| joint.locked_axes & (1 << axis) != 0).for_each(|axis| along[axis] = 0.0);
        first_is * along
    };
    let new_own = end(&is, &frame) + along_free(old_own - old);
    let slides = along_free(own_was.velocity_at(old_own) - was.velocity_at(old_own));
    let turns_along = joint.locked_axes >> 3 != 0;
    let [angular_was, angular_is] =
        [&was, &is].map(|of| if turns_along { of.angular } else { Vector3::zeros() });
    let angular = angular_is + turn * (own_was.angular - angular_was);
    let arm = -(rotation * own_frame.translation.vector);
    let linear = is.velocity_at(new_own) + slides + angular.cross(&arm);
    BodyState {
        pose: Isometry3::from_parts((new_own.coords + arm).into(), rotation).into(),
        velocity: Velocity {
            linear: linear.map(|v| v as f32).into(),
            angular: angular.map(|v| v as f32).into(),
        },
        sleeping: own.1.sleeping && at.sleeping,
        ..own.1
    }
}

/// Returns by how much a joint turns a body whose guide has turned, from how the guide's end of the joint was and is, and
/// how the body's own end was.
fn turn(locked_axes: u8, guide: [Isometry3<f64>; 2], own: Isometry3<f64>) -> UnitQuaternion<f64> {
    let [was, is] = guide;
    let free: Vec<_> = (0..3).filter(|axis| locked_axes & (8 << axis) == 0).collect();
    match free[..] {
        [] => is.rotation * was.rotation.inverse(),
        [axis] => {
            let axis = Vector3::ith_axis(axis);
            let hinge = UnitQuaternion::rotation_between_axis(&(own.rotation * axis), &(is.rotation * axis));
            hinge.unwrap_or_default()
        }
        _ => UnitQuaternion::identity(),
    }
}

/// Returns the mean of some states of a body.
fn mean(present: BodyState, states: &[(f64, BodyState)]) -> BodyState {
    let total: f64 = states.iter().map(|(weight, _)| weight).sum();
    let of = |value: &dyn Fn(&BodyState) -> Vector3<f64>| {
        states.iter().map(|(weight, state)| value(state) * (weight / total)).sum::<Vector3<f64>>()
    };
    let first = states[0].1.pose.isometry().rotation;
    // Both signs of a quaternion are the same rotation.
    let rotation = states.iter().map(|(weight, state)| {
        let one = state.pose.isometry().rotation;
        one.into_inner() * if one.coords.dot(&first.coords) < 0.0 { -*weight } else { *weight }
    });
    let rotation = UnitQuaternion::new_normalize(rotation.fold(Quaternion::default(), |sum, one| sum + one));
    let place = of(&|state| state.pose.translation.into());
    let velocity = |value: &dyn Fn(&Velocity) -> [f32; 3]| {
        of(&|state| vector(value(&state.velocity))).map(|v| v as f32).into()
    };
    BodyState {
        pose: Isometry3::from_parts(place.into(), rotation).into(),
        velocity: Velocity { linear: velocity(&|v| v.linear), angular: velocity(&|v| v.angular) },
        sleeping: states.iter().all(|(_, state)| state.sleeping),
        ..present
    }
}

/// Slows a body down to the speed that it had, and what it has gained by falling since.
fn slow(state: &mut BodyState, known: &BodyState, gravity_m_s2: Vector3<f64>) {
    let place = |state: &BodyState| Vector3::from(state.pose.translation);
    let fallen_m2_s2 = gravity_m_s2.dot(&(place(state) - place(known))).max(0.0);
    let most_m_s = (vector(known.velocity.linear).norm_squared() + 2.0 * fallen_m2_s2).sqrt();
    let linear = vector(state.velocity.linear);
    if linear.norm() > most_m_s {
        state.velocity.linear = (linear * (most_m_s / linear.norm())).map(|v| v as f32).into();
    }
}

fn vector(of: [f32; 3]) -> Vector3<f64> {
    Vector3::from(of.map(f64::from))
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use rapier3d::prelude::{GenericJoint, JointAxesMask, Vector};

    use super::*;
    use crate::physics::{StepSettings, joint_record};
    use crate::protocol::{BodyRecord, WorldPose};
    use crate::sim::sim_body;
    use crate::space::JointId;

    const DT_S: f64 = 1.0 / 64.0;

    fn id(index: u32) -> BodyId {
        BodyId::persistent(index)
    }

    /// Returns a record of balls in a row along x, a metre apart, each tied to the next half-way. All turn about the first
    /// one by a radian per second.
    fn row(balls: u32, axes: JointAxesMask) -> Record {
        let mut data = GenericJoint::default();
        data.lock_axes(axes).set_local_anchor1(Vector::X * 0.5).set_local_anchor2(Vector::X * -0.5);
        let joints = (1..balls).map(|i| joint_record(JointId(i.into()), id(i - 1), id(i), &data));
        Record::new((0..balls).map(|i| turned(i, 0.0)).collect(), Vec::new(), joints.collect())
    }

    /// Returns one of these balls after they have all turned by an angle about y.
    fn turned(index: u32, angle: f64) -> BodyRecord {
        let r = f64::from(index);
        let mut body = sim_body(id(index), [r * angle.cos(), 0.0, -r * angle.sin()]);
        body.state.pose.rotation = [0.0, (0.5 * angle).sin() as f32, 0.0, (0.5 * angle).cos() as f32];
        let linear = [-r * angle.sin(), 0.0, -r * angle.cos()].map(|v| v as f32);
        body.state.velocity = Velocity { linear, angular: [0.0, 1.0, 0.0] };
        body
    }

    fn step() -> StepRecord {
        let gravity = [0.0, -9.81, 0.0];
        StepSettings { dt_s: DT_S as f32, gravity, ..StepSettings::default() }.record()
    }

    /// Returns the states after survivors have told of all balls but the lost ones, as of tick 64.
    fn brought_back(record: &mut Record, lost: &[u32], told: impl Fn(u32) -> BodyRecord) -> Vec<BodyState> {
        let mut notes = Notes::default();
        (0..record.len() as u32).for_each(|index| notes.note(record, id(index)));
        for index in (0..record.len() as u32).filter(|index| !lost.contains(index)) {
            record.reclaim(Tick(64), told(index));
        }
        let orphans = Orphans::new(record, &notes, lost.iter().map(|&index| id(index)));
        orphans.bring_back(record, Tick(64), &step());
        (0..record.len() as u32).map(|index| record.body(id(index)).unwrap().state).collect()
    }

    fn assert_near(state: &BodyState, expected: &BodyState, within: f64) {
        let far =
            (state.pose.isometry().translation.vector - expected.pose.isometry().translation.vector).norm();
        let turned = state.pose.isometry().rotation.angle_to(&expected.pose.isometry().rotation);
        let faster = |a: [f32; 3], b: [f32; 3]| (vector(a) - vector(b)).norm();
        let [linear, angular] = [
            faster(state.velocity.linear, expected.velocity.linear),
            faster(state.velocity.angular, expected.velocity.angular),
        ];
        assert!(far.max(turned).max(linear).max(angular) < within, "{state:?}, not {expected:?}");
    }

    #[test]
    fn what_is_fixed_to_a_body_that_went_on_turns_with_it() {
        for lost in [&[3][..], &[3, 4, 5], &[0], &[2, 3]] {
            let mut record = row(6, JointAxesMask::LOCKED_FIXED_AXES);
            let states = brought_back(&mut record, lost, |index| turned(index, 2.0));
            for (index, state) in states.iter().enumerate() {
                assert_near(state, &turned(index as u32, 2.0).state, 1e-5);
            }
        }
    }

    #[test]
    fn what_may_turn_at_its_joint_hangs_there_as_it_did() {
        let (sin, cos) = 2.0_f64.sin_cos();
        let mut guide = turned(0, 2.0);
        guide.state.pose.translation = [0.0, 3.0, 0.0];
        guide.state.velocity.linear = [0.0, 0.5, 0.0];
        let mut record = row(3, JointAxesMask::LOCKED_SPHERICAL_AXES);
        let states = brought_back(&mut record, &[1, 2], |_| guide.clone());
        for (index, state) in states.iter().enumerate().skip(1) {
            let along = index as f64 - 0.5;
            let mut expected = turned(index as u32, 0.0).state;
            expected.pose.translation = [0.5 * cos + along, 3.0, -0.5 * sin];
            // It turns as it did about the end of the guide.
            expected.velocity.linear = [-0.5 * sin, 0.5, -0.5 * cos - along].map(|v| v as f32);
            assert_near(state, &expected, 1e-5);
        }
    }

    #[test]
    fn the_end_of_a_chain_is_thrown_no_faster_than_it_was_and_has_fallen() {
        for (fallen_m, gravity_scale) in [(0.0, 1.0), (0.8, 1.0), (0.8, 0.0)] {
            let mut record = row(6, JointAxesMask::LOCKED_SPHERICAL_AXES);
            for index in 0..6 {
                let mut body = turned(index, 0.0);
                // The links sway as the joints let them: added up along the chain that would be 20 m/s at its end.
                body.state.velocity.angular = [0.0, 0.0, 4.0];
                record.freshen(Tick(60), body);
                let known = record.body_mut(id(index)).unwrap();
                Arc::make_mut(&mut known.traits).gravity_scale = gravity_scale;
            }
            let mut guide = turned(0, 0.0);
            guide.state.pose.translation[1] -= fallen_m;
            let states = brought_back(&mut record, &[1, 2, 3, 4, 5], |_| guide.clone());
            let gained_m2_s2 = 2.0 * 9.81 * f64::from(gravity_scale) * fallen_m;
            let most = |index: i32| (f64::from(index).powi(2) + gained_m2_s2).sqrt();
            let speeds: Vec<_> = states.iter().map(|state| vector(state.velocity.linear).norm()).collect();
            for (index, speed) in (0..).zip(&speeds).skip(1) {
                assert!(
                    *speed < 1.001 * most(index),
                    "{index}: {speed} m/s, where {} is the most",
                    most(index)
                );
            }
            assert!(speeds[5] > 0.999 * most(5), "{} m/s, not {}", speeds[5], most(5));
        }
    }

    #[test]
    fn a_hinge_turns_what_hangs_on_it_as_far_as_its_axis_turns() {
        // The axis lies along x, and the guide turns about y.
        let mut record = row(2, JointAxesMask::LOCKED_REVOLUTE_AXES);
        let states = brought_back(&mut record, &[1], |index| turned(index, 1.0));
        assert_near(&states[1], &turned(1, 1.0).state, 1e-5);
        // About its axis it does not turn with the guide.
        let mut rolled = turned(0, 0.0);
        rolled.state.pose.rotation = [0.6, 0.0, 0.0, 0.8];
        let mut record = row(2, JointAxesMask::LOCKED_REVOLUTE_AXES);
        let states = brought_back(&mut record, &[1], |_| rolled.clone());
        assert_near(&states[1], &turned(1, 0.0).state, 1e-5);
    }

    #[test]
    fn what_was_told_of_later_is_first_taken_to_the_same_time() {
        let mut record = row(2, JointAxesMask::LOCKED_FIXED_AXES);
        // The second ball was last told of four ticks after the first.
        record.freshen(Tick(4), turned(1, 4.0 * DT_S));
        let states = brought_back(&mut record, &[1], |index| turned(index, 2.0));
        assert_near(&states[1], &turned(1, 2.0).state, 1e-5);
    }

    #[test]
    fn what_was_told_of_long_before_its_guide_comes_back_at_the_joint() {
        for axes in [JointAxesMask::LOCKED_SPHERICAL_AXES, JointAxesMask::LOCKED_FIXED_AXES] {
            let mut record = row(3, axes);
            // The guide was told of three quarters of a second after the others.
            record.freshen(Tick(48), turned(0, 0.7));
            let states = brought_back(&mut record, &[1, 2], |index| turned(index, 2.0));
            for (guide, own) in states.iter().zip(&states[1..]) {
                let end = |state: &BodyState, x| state.pose.isometry() * Point3::new(x, 0.0, 0.0);
                let gap_m = (end(guide, 0.5) - end(own, -0.5)).norm();
                assert!(gap_m < 1e-6, "{gap_m}");
                let faster = vector(own.velocity.linear).norm();
                assert!(faster < 4.0, "{faster}");
            }
        }
    }

    #[test]
    fn what_slides_on_a_rail_keeps_its_place_on_it() {
        // What the joint let the cart stray across the rail is gone. Its velocity along the rail tells nothing of a
        // second later.
        for (told, speed, along) in [(0, 0.0, 1.3), (16, 2.0, 1.8), (48, 2.0, 1.8)] {
            let mut record = row(2, JointAxesMask::LOCKED_PRISMATIC_AXES);
            let mut bodies = [turned(0, 0.0), turned(1, 0.0)];
            bodies.iter_mut().for_each(|body| body.state.velocity = Velocity::default());
            bodies[1].state.pose.translation = [1.3, 0.2, 0.0];
            bodies[1].state.velocity.linear = [speed, 0.0, 0.0];
            for (body, tick) in bodies.into_iter().zip([told, 0]) {
                record.freshen(Tick(tick), body);
            }
            let states = brought_back(&mut record, &[1], |index| turned(index, 2.0));
            let (sin, cos) = 2.0_f64.sin_cos();
            let expected = Vector3::new(along * cos, 0.0, -along * sin);
            let found = states[1].pose.isometry().translation.vector;
            assert!((found - expected).norm() < 1e-5, "{found:?}, not {expected:?}");
        }
    }

    #[test]
    fn what_a_wheel_hangs_on_keeps_its_travel_though_the_wheel_has_rolled() {
        // The wheel turns about x and slides along y of the chassis, which is lost.
        let axes = JointAxesMask::LIN_X | JointAxesMask::LIN_Z | JointAxesMask::ANG_Y | JointAxesMask::ANG_Z;
        let mut data = GenericJoint::default();
        data.lock_axes(axes);
        let joint = joint_record(JointId(0), id(0), id(1), &data);
        let wheel = |rolled: f32| {
            let mut wheel = sim_body(id(1), [0.0, -0.3, 0.0]);
            wheel.state.pose.rotation = [(0.5 * rolled).sin(), 0.0, 0.0, (0.5 * rolled).cos()];
            wheel
        };
        let bodies = vec![sim_body(id(0), [0.0; 3]), wheel(1.0)];
        let mut record = Record::new(bodies, Vec::new(), vec![joint]);
        let states = brought_back(&mut record, &[0], |_| wheel(2.6));
        let off = states[0].pose.isometry().translation.vector.norm();
        assert!(off < 1e-5, "{:?}", states[0]);
    }

    #[test]
    fn what_is_between_two_bodies_that_went_on_comes_back_between_them() {
        let moved = |index: u32| {
            let mut body = turned(index, 0.0);
            body.state.velocity = Velocity::default();
            body.state.pose.translation[1] = if index == 0 { 1.0 } else { 2.0 };
            body
        };
        let mut still = row(4, JointAxesMask::LOCKED_SPHERICAL_AXES);
        for index in 0..4 {
            let mut body = moved(index);
            body.state.pose = WorldPose::at([f64::from(index), 0.0, 0.0]);
            still.freshen(Tick(1), body);
        }
        let y: Vec<_> =
            brought_back(&mut still, &[1, 2], moved).iter().map(|s| s.pose.translation[1]).collect();
        assert!((y[1] - 1.2).abs() < 1e-6 && (y[2] - 1.8).abs() < 1e-6, "{y:?}");
    }

    #[test]
    fn what_a_survivor_has_a_copy_of_or_no_joint_holds_stays_as_it_is() {
        let mut record = row(2, JointAxesMask::LOCKED_FIXED_AXES);
        let copy = turned(1, 1.5);
        record.freshen(Tick(64), copy.clone());
        let states = brought_back(&mut record, &[1], |index| turned(index, 2.0));
        assert_eq!(states[1], copy.state);
        let mut loose = Record::new((0..2).map(|i| turned(i, 0.0)).collect(), Vec::new(), Vec::new());
        let states = brought_back(&mut loose, &[1], |index| turned(index, 2.0));
        assert_eq!(states[1], turned(1, 0.0).state);
    }
}
