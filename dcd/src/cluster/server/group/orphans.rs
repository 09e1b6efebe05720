//! Brings back bodies that nobody holds any more, where joints tie them to bodies that went on: relative to these as they
//! were when the record last heard of both. Where the record has them, a chain would be torn apart by as far as it has
//! swung since.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use nalgebra::{Isometry3, Quaternion, UnitQuaternion, Vector3};

use crate::cluster::Record;
use crate::protocol::{BodyKind, BodyState, Velocity};
use crate::space::{BodyId, Tick};

/// The most steps from joint to joint in one view change.
const MOST_STEPS: usize = 1_000_000;

/// The orphans of a view change, which no survivor owns and joints hold, with what these tie them to.
#[derive(Clone, Debug, Default)]
pub(super) struct Orphans {
    /// What the record had of all these bodies before survivors told what they hold.
    known: BTreeMap<BodyId, (Tick, BodyState)>,
    orphans: BTreeSet<BodyId>,
}

impl Orphans {
    /// Notes what the record has of those of these bodies that joints hold.
    pub(super) fn new(record: &Record, ids: impl Iterator<Item = BodyId>) -> Self {
        let mut noted = Self::default();
        for id in ids {
            for end in record.joints_of(id).flat_map(|joint| [joint.a, joint.b]) {
                if let (Some(tick), Some(body)) = (record.told_at(end), record.body(end)) {
                    noted.known.insert(end, (tick, body.state));
                    noted.orphans.insert(id);
                }
            }
        }
        noted
    }

    /// Returns the bodies whose present states are asked for.
    pub(super) fn bodies(&self) -> impl Iterator<Item = BodyId> {
        self.known.keys().copied()
    }

    /// Sets the states of orphans of which no survivor had a copy at tick `now`. An orphan between several bodies that went
    /// on is where these have it at the mean, the nearer counting more.
    pub(super) fn bring_back(&self, record: &mut Record, now: Tick, dt_s: f64) {
        let lost = |id: &BodyId| self.orphans.contains(id) && record.told_at(*id) < Some(now);
        let lost: BTreeSet<_> = self.orphans.iter().copied().filter(lost).collect();
        let is_guide = |id: &BodyId| {
            let is_fixed = |id| record.body(id).is_some_and(|body| body.traits.kind == BodyKind::Fixed);
            !lost.contains(id) && (record.told_at(*id) >= Some(now) || is_fixed(*id))
        };
        let neighbours =
            |id: BodyId| record.joints_of(id).map(move |joint| if joint.a == id { joint.b } else { joint.a });
        let mut found: BTreeMap<BodyId, Vec<(f64, BodyState)>> = BTreeMap::new();
        let mut steps = 0;
        for (&guide, &then) in self.known.iter().filter(|(id, _)| is_guide(id)) {
            let Some(at) = record.body(guide).map(|body| body.state) else { continue };
            let (mut seen, mut next) = (BTreeSet::from([guide]), VecDeque::from([(guide, 0)]));
            while let Some((id, joints)) = next.pop_front().filter(|_| steps < MOST_STEPS) {
                if let Some(&own) = self.known.get(&id).filter(|_| id != guide) {
                    let weight = 1.0 / f64::powi(f64::from(joints), 2);
                    found.entry(id).or_default().push((weight, carried(then, at, own, dt_s)));
                }
                for other in neighbours(id).filter(|other| lost.contains(other)) {
                    steps += 1;
                    if seen.insert(other) {
                        next.push_back((other, joints + 1));
                    }
                }
            }
        }
        for (id, states) in found {
            if let Some(body) = record.body_mut(id) {
                body.set_state(mean(body.state, &states));
            }
        }
    }
}

/// Returns the state of a body that has moved with a guide, which was `then` and is `at`, since its `own` state.
fn carried(then: (Tick, BodyState), at: BodyState, own: (Tick, BodyState), dt_s: f64) -> BodyState {
    let when = then.0.max(own.0);
    let motion = |(tick, state): (Tick, BodyState)| {
        let pose = state.pose.moved(&state.velocity, (when.0 - tick.0) as f64 * dt_s);
        (pose.isometry(), vector(state.velocity.linear), vector(state.velocity.angular))
    };
    let (guide, linear, angular) = motion(then);
    let (pose, own_linear, own_angular) = motion(own);
    let way = at.pose.isometry() * guide.inverse();
    let new = way * pose;
    let arm = |of: &Isometry3<f64>, to: &Isometry3<f64>| to.translation.vector - of.translation.vector;
    // What it did beside its guide.
    let beside = own_linear - linear - angular.cross(&arm(&guide, &pose));
    let turns = vector(at.velocity.angular);
    let moves = vector(at.velocity.linear) + turns.cross(&arm(&at.pose.isometry(), &new));
    BodyState {
        pose: new.into(),
        velocity: Velocity {
            linear: (moves + way.rotation * beside).map(|v| v as f32).into(),
            angular: (turns + way.rotation * (own_angular - angular)).map(|v| v as f32).into(),
        },
        sleeping: own.1.sleeping && at.sleeping,
        ..own.1
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

fn vector(of: [f32; 3]) -> Vector3<f64> {
    Vector3::from(of.map(f64::from))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::physics::joint_record;
    use crate::protocol::{BodyRecord, WorldPose};
    use crate::sim::sim_body;
    use crate::space::JointId;

    const DT_S: f64 = 1.0 / 64.0;

    fn id(index: u32) -> BodyId {
        BodyId::persistent(index)
    }

    /// Returns a record of balls in a row along x, a metre apart, each tied to the next. All turn about the first one
    /// by a radian per second.
    fn rope(balls: u32) -> Record {
        let spherical = rapier3d::prelude::SphericalJointBuilder::new().build().into();
        let joints = (1..balls).map(|i| joint_record(JointId(i.into()), id(i - 1), id(i), &spherical));
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

    /// Returns the states after survivors have told of all balls but the lost ones, as of tick 64.
    fn brought_back(record: &mut Record, lost: &[u32], told: impl Fn(u32) -> BodyRecord) -> Vec<BodyState> {
        let orphans = Orphans::new(record, lost.iter().map(|&index| id(index)));
        for index in (0..record.len() as u32).filter(|index| !lost.contains(index)) {
            record.reclaim(Tick(64), told(index));
        }
        orphans.bring_back(record, Tick(64), DT_S);
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
    fn what_joints_tie_to_a_body_that_went_on_comes_back_beside_it() {
        for lost in [&[3][..], &[3, 4, 5], &[0], &[2, 3]] {
            let states = brought_back(&mut rope(6), lost, |index| turned(index, 2.0));
            for (index, state) in states.iter().enumerate() {
                assert_near(state, &turned(index as u32, 2.0).state, 1e-5);
            }
        }
    }

    #[test]
    fn what_was_told_of_later_is_first_taken_to_the_same_time() {
        let mut record = rope(2);
        // The second ball was last told of four ticks after the first.
        record.freshen(Tick(4), turned(1, 4.0 * DT_S));
        let states = brought_back(&mut record, &[1], |index| turned(index, 2.0));
        assert_near(&states[1], &turned(1, 2.0).state, 1e-5);
    }

    #[test]
    fn what_is_between_two_bodies_that_went_on_comes_back_between_them() {
        let moved = |index: u32| {
            let mut body = turned(index, 0.0);
            body.state.velocity = Velocity::default();
            body.state.pose.translation[1] = if index == 0 { 1.0 } else { 2.0 };
            body
        };
        let mut still = rope(4);
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
        let mut record = rope(2);
        let copy = turned(1, 1.5);
        record.freshen(Tick(64), copy.clone());
        let states = brought_back(&mut record, &[1], |index| turned(index, 2.0));
        assert_eq!(states[1], copy.state);
        let mut loose = Record::new((0..2).map(|i| turned(i, 0.0)).collect(), Vec::new(), Vec::new());
        let states = brought_back(&mut loose, &[1], |index| turned(index, 2.0));
        assert_eq!(states[1], turned(1, 0.0).state);
    }
}
