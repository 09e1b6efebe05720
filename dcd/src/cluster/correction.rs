//! Corrects a body towards its pose in the authoritative group (inter-group correction; thesis 3.3.8 leaves the way open):
//! by its velocity, so that the body pushes what is in its way and never appears inside it, or by a shift, which gives
//! it no energy.

use nalgebra::{UnitQuaternion, Vector3};

use crate::protocol::{SharedState, Velocity, WorldPose};

/// The time constant of the correction, seconds.
const SETTLE_S: f64 = 0.2;
/// The largest correction that is added to a velocity, m/s and rad/s: a faster body from nowhere would hurt what is in its
/// way.
const MOST: f64 = 6.0;
/// The speed up to which a body is corrected in any case, and by how much more than its target's own it may be, m/s and
/// rad/s: faster ones heat a crowd.
const SLOW: f64 = 1.0;
const FASTER_BY: f64 = 0.35;
/// The same for an avatar, which is off its course whenever its user turns, and is to be back before the next turn.
const AVATAR_SLOW: f64 = 1.5;
const AVATAR_FASTER_BY: f64 = 0.5;
/// The fastest shift, m/s and rad/s. What is then in the way is overlapped by that in a tick at most.
const FASTEST_SHIFT: f64 = 0.5;

/// Returns the distance of a body from where it should be, metres.
pub fn deviation_m(present: &WorldPose, target: &WorldPose) -> f64 {
    let error = |i: usize| target.translation[i] - present.translation[i];
    (0..3).map(|i| error(i).powi(2)).sum::<f64>().sqrt()
}

/// Returns the velocity that brings a body from `present` to where `target` is by now, `lag_s` seconds after
/// that state (dead reckoning).
///
/// Within `band_m` of the target, the body moves as the target does. Call it again while the deviation is
/// larger: the error shrinks by a factor e in 0.2 s. A body that is behind catches up by 0.35 m/s at most, an
/// avatar by 0.5 m/s.
pub fn correction(present: &WorldPose, target: &SharedState, lag_s: f64, band_m: f64) -> Velocity {
    let goal = target.pose.moved(&target.velocity, lag_s);
    if deviation_m(present, &goal) <= band_m {
        return target.velocity;
    }
    let (way, turn) = way(present, &goal);
    let Velocity { linear, angular } = target.velocity;
    let is_avatar = target.id.client().is_some();
    let (slow, faster_by) = if is_avatar { (AVATAR_SLOW, AVATAR_FASTER_BY) } else { (SLOW, FASTER_BY) };
    // As fast as is allowed.
    let towards = |velocity: [f32; 3], way: Vector3<f64>| -> [f32; 3] {
        let velocity = Vector3::from(velocity.map(f64::from));
        let most = slow.max(velocity.norm() + faster_by);
        (velocity + (way / SETTLE_S).cap_magnitude(MOST)).cap_magnitude(most).map(|v| v as f32).into()
    };
    Velocity { linear: towards(linear, way), angular: towards(angular, turn) }
}

/// Returns the velocity of a shift that brings a body from `present` to where `target` is by now, `lag_s` seconds after
/// that state, while it moves with its target's velocity. That suits a body which nothing touches: it neither gains
/// energy nor loses any (what split impulses are to penetrations).
///
/// Within `band_m` of the target, there is none.
pub fn shift(present: &WorldPose, target: &SharedState, lag_s: f64, band_m: f64) -> Velocity {
    let goal = target.pose.moved(&target.velocity, lag_s);
    if deviation_m(present, &goal) <= band_m {
        return Velocity::default();
    }
    let capped = |way: Vector3<f64>| (way / SETTLE_S).cap_magnitude(FASTEST_SHIFT).map(|v| v as f32).into();
    let (way, turn) = way(present, &goal);
    Velocity { linear: capped(way), angular: capped(turn) }
}

/// Returns the way from a pose to another: metres, and radians about an axis.
fn way(present: &WorldPose, goal: &WorldPose) -> (Vector3<f64>, Vector3<f64>) {
    let (from, to) = (present.isometry(), goal.isometry());
    let turn: UnitQuaternion<f64> = to.rotation * from.rotation.inverse();
    (to.translation.vector - from.translation.vector, turn.scaled_axis())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space::{BodyId, Epoch, RegionId};

    fn target() -> SharedState {
        let velocity = Velocity { linear: [2.0, 0.0, 0.0], angular: [0.0, 0.0, 1.0] };
        let (id, epoch) = (BodyId::persistent(1), Epoch(0));
        SharedState {
            id,
            owner: RegionId(1),
            epoch,
            pose: WorldPose::at([1.0, 2.0, 3.0]),
            velocity,
            sleeping: false,
        }
    }

    #[test]
    fn a_deviating_body_meets_its_target_on_the_way_and_moves_on_with_it() {
        let mut pose = WorldPose::at([0.0, 2.5, 3.0]);
        let (dt, target) = (1.0 / 60.0, target());
        let mut worst_step = 0.0_f64;
        for tick in 0..300 {
            let velocity = correction(&pose, &target, f64::from(tick) * dt, 0.01);
            let next = pose.moved(&velocity, dt);
            worst_step = worst_step.max(deviation_m(&pose, &next));
            pose = next;
        }
        let goal = target.pose.moved(&target.velocity, 300.0 * dt);
        assert!(deviation_m(&pose, &goal) <= 0.01, "{pose:?} {goal:?}");
        assert!(pose.isometry().rotation.angle_to(&goal.isometry().rotation) < 0.02);
        assert!(worst_step < 2.51 * dt, "never a jump, and little faster than its target: {worst_step}");
        // One that is far ahead of a fast target waits, and does not come back.
        let fast =
            SharedState { velocity: Velocity { linear: [10.0, 0.0, 0.0], angular: [0.0; 3] }, ..target };
        let ahead = WorldPose::at([5.0, 2.0, 3.0]);
        assert_eq!(correction(&ahead, &fast, 0.0, 0.01).linear, [4.0, 0.0, 0.0]);
        assert_eq!(
            correction(&goal, &target, 300.0 * dt, 0.01),
            target.velocity,
            "there it moves as the target does"
        );
    }
}
