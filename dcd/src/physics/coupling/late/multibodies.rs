//! Carries multibodies that are handed over late forward as a whole, with all that is tied to them.

use std::collections::BTreeMap;

use rapier3d::prelude::Vector;

use super::{Tied, ghost_of};
use crate::physics::coupling::replay::{replay_multibodies, steps};
use crate::physics::region::Region;
use crate::protocol::{BodyState, BorderMessage, JointRecord, Velocity};
use crate::space::{BodyId, Groups};

/// The most that is computed again of the multibodies of one message: bodies and joints by steps. It is a hundred humanoids
/// by twelve ticks.
const MOST_WORK: u64 = 30_000;

/// Computes multibodies that are handed over again, with all that is tied to them, from where they were told to be. Returns
/// how they are to be now, and tells the message's joints. A link that was carried forward by itself would strain the others:
/// what cannot be computed again moves on without turning.
pub(super) fn carry_multibodies_forward(
    region: &Region,
    message: &mut BorderMessage,
    late: u64,
    dt_s: f32,
) -> BTreeMap<BodyId, Tied> {
    if late == 0 || message.joints.iter().all(|joint| joint.link.is_none()) {
        return BTreeMap::new();
    }
    let told = message.transfers.iter().filter(|transfer| !transfer.body.state.sleeping);
    let told: BTreeMap<_, _> = told.map(|transfer| (transfer.body.id, transfer.body.state)).collect();
    let (mut carried, mut moved, mut work_left) = (BTreeMap::new(), BTreeMap::new(), MOST_WORK);
    for (bodies, mut joints) in with_multibodies(region, message, &told) {
        let earlier = |id: &BodyId| ghost_of(region, *id).map(|it| (it, told[id].pose, told[id].velocity));
        let start: Option<Vec<_>> = bodies.iter().map(earlier).collect();
        let start = start.filter(|start| {
            let work = (start.len() + joints.len()) as u64 * steps(region, late, dt_s);
            let is_possible = work <= work_left;
            work_left -= if is_possible { work } else { 0 };
            is_possible
        });
        let now = start.and_then(|start| replay_multibodies(region, &start, &mut joints, late, dt_s));
        match now {
            Some(now) => {
                let now = now.into_iter().map(|(pose, velocity)| Tied { pose, velocity, is_replayed: true });
                carried.extend(bodies.into_iter().zip(now));
                moved.extend(joints.into_iter().map(|joint| (joint.id, joint)));
            }
            None => carried.extend(moved_whole(&bodies, &told, late as f64 * f64::from(dt_s))),
        }
    }
    for joint in &mut message.joints {
        if let Some(now) = moved.get(&joint.id) {
            joint.clone_from(now);
        }
    }
    carried
}

/// Moves bodies by the mean of their velocities, without turning them.
fn moved_whole<'a>(
    bodies: &'a [BodyId],
    told: &'a BTreeMap<BodyId, BodyState>,
    late_s: f64,
) -> impl Iterator<Item = (BodyId, Tied)> + 'a {
    let sum: Vector = bodies.iter().map(|id| Vector::from(told[id].velocity.linear)).sum();
    let mean = Velocity { linear: (sum / bodies.len() as f32).into(), ..Velocity::default() };
    bodies.iter().map(move |id| {
        let BodyState { pose, velocity, .. } = told[id];
        (*id, Tied { pose: pose.moved(&mean, late_s), velocity, is_replayed: true })
    })
}

/// Returns the bodies that a message hands over and that hang together by its joints, where one of these is a link of a
/// multibody; with these joints. A joint of a disabled body ties nothing.
fn with_multibodies(
    region: &Region,
    message: &BorderMessage,
    told: &BTreeMap<BodyId, BodyState>,
) -> Vec<(Vec<BodyId>, Vec<JointRecord>)> {
    let is_told = |id: &BodyId| told.contains_key(id);
    let is_enabled =
        |id: BodyId| region.handle_of(id).is_none_or(|it| region.physics().bodies[it].is_enabled());
    // Both of its bodies bring a joint along.
    let joints: BTreeMap<_, _> = message.joints.iter().map(|joint| (joint.id, joint)).collect();
    let ties = |joint: &&JointRecord| is_enabled(joint.a) && is_enabled(joint.b);
    let joints: Vec<_> = joints.into_values().filter(ties).collect();
    let mut groups = Groups::default();
    for joint in joints.iter().filter(|joint| is_told(&joint.a) && is_told(&joint.b)) {
        groups.join(joint.a, joint.b);
    }
    let mut parts: BTreeMap<BodyId, (Vec<BodyId>, Vec<JointRecord>)> = BTreeMap::new();
    for &id in told.keys() {
        parts.entry(groups.root(id)).or_default().0.push(id);
    }
    for joint in joints {
        if let Some(id) = [joint.a, joint.b].into_iter().find(is_told) {
            parts.entry(groups.root(id)).or_default().1.push(joint.clone());
        }
    }
    parts.into_values().filter(|(_, joints)| joints.iter().any(|joint| joint.link.is_some())).collect()
}
