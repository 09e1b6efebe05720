//! Interpolates the motion of a body between two states, and extrapolates it beyond the last one.

use nalgebra::{UnitQuaternion, Vector3};

use crate::delta::{LIKE_FALL, UNTOLD_S};
use crate::protocol::{BodyState, Velocity, WorldPose};

/// The time within which an extrapolated body comes to a stop, seconds: later than that nobody can say where
/// the body is.
pub(super) const BEYOND_S: f64 = 0.25;

/// How long after the newest batch of states a body that was not in it is still taken to go on, seconds:
/// about as long as the next batch may take.
pub(super) const GOES_ON_S: f64 = 0.1;

/// The acceleration above which a change of velocity was an impact, m/s²: gravity and friction are weaker.
const IMPACT_M_S2: f64 = 40.0;

/// The turn between two states, radians, above which their rotations alone do not tell its direction.
const LONG_TURN_RAD: f64 = 2.0;

/// A body was put elsewhere, and did not move there, if it is farther away than its velocities explain by
/// this, metres.
const TELEPORT_M: f64 = 2.0;

/// The assumptions where no state of a body is known yet (dead reckoning, thesis 3.3.11).
#[derive(Clone, Copy, Debug)]
pub(super) struct Reckoning {
    pub(super) dt_s: f64,
    /// The acceleration of bodies that fall, m/s².
    pub(super) gravity: Vector3<f64>,
    /// The tick of the newest batch of states. A body that is not in the batch has gone on as before, or else
    /// the batch would tell of it.
    pub(super) told: f64,
}

impl Reckoning {
    /// Returns the motion of a body at `tick`, after its newest state, which is of the tick `from`. It keeps
    /// its acceleration for as long as a change would have been told, and then becomes slower and slower.
    pub(super) fn beyond(&self, last: &Motion, falls: bool, from: f64, tick: f64) -> Motion {
        let free_s = ((self.told - from).max(0.0) * self.dt_s + GOES_ON_S).min(UNTOLD_S);
        let seconds = (tick - from) * self.dt_s;
        let free_s = seconds.min(free_s);
        let mut motion = Motion { pose: last.pose.moved(&last.velocity, free_s), ..*last };
        if falls {
            for axis in 0..3 {
                motion.pose.translation[axis] += 0.5 * self.gravity[axis] * free_s * free_s;
                motion.velocity.linear[axis] += (self.gravity[axis] * free_s) as f32;
            }
        }
        motion.beyond(seconds - free_s)
    }

    /// Returns whether a body fell freely between two states.
    pub(super) fn falls(&self, before: &Motion, last: &Motion, ticks: f64) -> bool {
        let gained = (vector(last.velocity.linear) - vector(before.velocity.linear)) / (ticks * self.dt_s);
        (gained - self.gravity).norm() < LIKE_FALL * self.gravity.norm()
    }
}

/// The pose and velocity of a body at some time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Motion {
    /// The position and rotation, in world space.
    pub pose: WorldPose,
    /// The velocity, m/s and rad/s.
    pub velocity: Velocity,
}

impl Motion {
    /// Returns the motion of a body in this state.
    pub(crate) fn of(state: &BodyState) -> Self {
        Self { pose: state.pose, velocity: state.velocity }
    }

    /// Returns the motion of a body that rests in this pose.
    pub(super) fn at_rest(pose: WorldPose) -> Self {
        Self { pose, velocity: Velocity::default() }
    }

    /// Returns the angle between two rotations, radians.
    #[cfg(all(feature = "net", feature = "physics"))]
    pub(crate) fn turn_rad(&self, other: &Self) -> f64 {
        turn_between(&self.pose, &other.pose).norm()
    }

    /// Returns the motion at `share` (0 to 1) of the `span_s` seconds between this state and the next.
    /// Positions follow a cubic Hermite spline, or two straight lines where the velocities show an impact in
    /// between; rotations follow SLERP.
    pub(crate) fn towards(&self, next: &Self, span_s: f64, share: f64) -> Self {
        if span_s <= 0.0 || share >= 1.0 {
            return *next;
        }
        if share <= 0.0 || self.is_teleported_to(next, span_s) {
            return *self;
        }
        let mut between = *self;
        for axis in 0..3 {
            let end = |motion: &Self| End {
                at: motion.pose.translation[axis],
                speed: motion.velocity.linear[axis].into(),
            };
            let End { at, speed } = end(self).towards(end(next), span_s, share);
            (between.pose.translation[axis], between.velocity.linear[axis]) = (at, speed as f32);
        }
        between.pose.rotation = self.turned_towards(next, span_s, share);
        let spins = [self.velocity.angular, next.velocity.angular];
        between.velocity.angular =
            std::array::from_fn(|i| spins[0][i] + (spins[1][i] - spins[0][i]) * share as f32);
        between
    }

    fn turned_towards(&self, next: &Self, span_s: f64, share: f64) -> [f32; 4] {
        let rad_s = |motion: &Self| vector(motion.velocity.angular).norm();
        if rad_s(self).max(rad_s(next)) * span_s < LONG_TURN_RAD {
            return self.pose.interpolated(&next.pose, share).rotation;
        }
        // A wheel may have turned more than once: it turns on as it did, and gradually as it will.
        let on = self.pose.moved(&self.velocity, share * span_s);
        let back = next.pose.moved(&next.velocity, (share - 1.0) * span_s);
        on.interpolated(&back, share * share * (3.0 - 2.0 * share)).rotation
    }

    /// Returns the motion `seconds` later if nothing touches the body (dead reckoning, thesis 3.3.11), with a
    /// damping that stops it within [`BEYOND_S`].
    pub(crate) fn beyond(&self, seconds: f64) -> Self {
        let seconds = seconds.clamp(0.0, BEYOND_S);
        let moves_s = seconds * (1.0 - seconds / (2.0 * BEYOND_S));
        let left = (1.0 - seconds / BEYOND_S) as f32;
        let slower = |v: [f32; 3]| v.map(|v| v * left);
        Self {
            pose: self.pose.moved(&self.velocity, moves_s),
            velocity: Velocity {
                linear: slower(self.velocity.linear),
                angular: slower(self.velocity.angular),
            },
        }
    }

    /// Returns whether the body cannot have moved from this state to the next within `span_s` seconds.
    pub(crate) fn is_teleported_to(&self, next: &Self, span_s: f64) -> bool {
        let speed_m_s = vector(self.velocity.linear).norm() + vector(next.velocity.linear).norm();
        let way_m = self.distance_m(next);
        !way_m.is_finite() || !speed_m_s.is_finite() || way_m > speed_m_s * span_s + TELEPORT_M
    }

    pub(crate) fn distance_m(&self, other: &Self) -> f64 {
        let way = |i: usize| (other.pose.translation[i] - self.pose.translation[i]).powi(2);
        (0..3).map(way).sum::<f64>().sqrt()
    }
}

/// The position and speed along one axis.
#[derive(Clone, Copy)]
pub(super) struct End {
    pub(super) at: f64,
    pub(super) speed: f64,
}

impl End {
    fn towards(self, next: Self, span_s: f64, share: f64) -> Self {
        let way = next.at - self.at;
        let faster = next.speed - self.speed;
        if faster.abs() <= IMPACT_M_S2 * span_s {
            return self.hermite(next, span_s, share);
        }
        // It moved at the first speed until something struck it, and at the second from then on.
        let struck_s = (next.speed * span_s - way) / faster;
        if (0.0..=span_s).contains(&struck_s) {
            let after_s = share * span_s;
            return if after_s < struck_s {
                Self { at: self.at + self.speed * after_s, speed: self.speed }
            } else {
                Self { at: next.at - next.speed * (span_s - after_s), speed: next.speed }
            };
        }
        // It was struck more than once: it goes no farther than from one end to the other.
        let limited = |end: Self| {
            let most = 3.0 * way / span_s;
            let speed = if end.speed * way <= 0.0 { 0.0 } else { end.speed.clamp(-most.abs(), most.abs()) };
            Self { speed, ..end }
        };
        limited(self).hermite(limited(next), span_s, share)
    }

    pub(super) fn hermite(self, next: Self, span_s: f64, u: f64) -> Self {
        let (u2, u3) = (u * u, u * u * u);
        let at = (2.0 * u3 - 3.0 * u2 + 1.0) * self.at
            + (u3 - 2.0 * u2 + u) * span_s * self.speed
            + (3.0 * u2 - 2.0 * u3) * next.at
            + (u3 - u2) * span_s * next.speed;
        let speed = (6.0 * u2 - 6.0 * u) * (self.at - next.at) / span_s
            + (3.0 * u2 - 4.0 * u + 1.0) * self.speed
            + (3.0 * u2 - 2.0 * u) * next.speed;
        Self { at, speed }
    }
}

pub(super) fn vector(v: [f32; 3]) -> Vector3<f64> {
    Vector3::from(v.map(f64::from))
}

/// Returns the rotation vector (axis times angle, radians) that leads from one rotation to the other by the
/// shorter way.
pub(super) fn turn_between(from: &WorldPose, to: &WorldPose) -> Vector3<f64> {
    (to.isometry().rotation * from.isometry().rotation.inverse()).scaled_axis()
}

/// Returns the rotation of a pose, turned by a rotation vector.
pub(super) fn turned(pose: &WorldPose, turn: Vector3<f64>) -> [f32; 4] {
    let rotation = UnitQuaternion::from_scaled_axis(turn) * pose.isometry().rotation;
    [rotation.i, rotation.j, rotation.k, rotation.w].map(|v| v as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SPAN_S: f64 = 0.05;

    fn motion(x: f64, speed: f32) -> Motion {
        Motion { pose: WorldPose::at([x, 0.0, 0.0]), velocity: Velocity::linear([speed, 0.0, 0.0]) }
    }

    fn x(a: &Motion, b: &Motion, share: f64) -> f64 {
        a.towards(b, SPAN_S, share).pose.translation[0]
    }

    #[test]
    fn a_body_in_free_fall_is_shown_where_it_was() {
        let fall = |t: f64| motion(2.0 * t - 4.905 * t * t, (2.0 - 9.81 * t) as f32);
        let (a, b) = (fall(0.3), fall(0.3 + SPAN_S));
        for share in [0.0, 0.2, 0.5, 0.9, 1.0] {
            let (shown, is) = (a.towards(&b, SPAN_S, share), fall(0.3 + share * SPAN_S));
            assert!(shown.distance_m(&is) < 1e-6, "{shown:?} {is:?}");
            assert!((shown.velocity.linear[0] - is.velocity.linear[0]).abs() < 1e-4);
        }
    }

    #[test]
    fn a_body_that_hits_the_ground_is_not_shown_below_it() {
        // It falls at 5 m/s, 5 mm above the ground, and lies there from then on.
        let (a, b) = (motion(0.005, -5.0), motion(0.0, 0.0));
        for share in 0..=20 {
            let x = x(&a, &b, f64::from(share) / 20.0);
            assert!((0.0..=0.005).contains(&x), "{x}");
        }
        // It bounces: it falls at 5 m/s, 100 mm above the ground, and leaves at 3 m/s.
        let (a, b) = (motion(0.1, -5.0), motion(0.09, 3.0));
        let shown: Vec<_> = (0..=50).map(|share| x(&a, &b, f64::from(share) / 50.0)).collect();
        let lowest = shown.iter().copied().fold(f64::MAX, f64::min);
        assert!((-1e-9..0.003).contains(&lowest), "{lowest}");
    }

    #[test]
    fn a_body_struck_to_and_fro_stays_between_where_it_was() {
        let (a, b) = (motion(0.0, 20.0), motion(0.1, -20.0));
        for share in 0..=20 {
            let x = x(&motion(0.0, -20.0), &motion(0.1, -10.0), f64::from(share) / 20.0);
            assert!((-1e-9..=0.1 + 1e-9).contains(&x), "{x}");
        }
        assert!(x(&a, &b, 0.5) > 0.1, "one impact explains it: out and back");
    }

    #[test]
    fn a_wheel_that_spins_fast_is_not_shown_turning_backwards() {
        let spin = |t: f64| {
            let velocity = Velocity::angular([0.0, 0.0, 100.0]);
            Motion { pose: WorldPose::default().moved(&velocity, t), velocity }
        };
        for share in [0.1, 0.25, 0.5, 0.8] {
            let (shown, is) = (spin(0.0).towards(&spin(SPAN_S), SPAN_S, share), spin(share * SPAN_S));
            assert!(turn_between(&shown.pose, &is.pose).norm() < 1e-3, "{share}");
        }
    }

    #[test]
    fn what_is_put_elsewhere_does_not_fly_there() {
        let (a, b) = (motion(0.0, 1.0), motion(30.0, 1.0));
        assert_eq!((x(&a, &b, 0.99), x(&a, &b, 1.0)), (0.0, 30.0));
    }

    #[test]
    fn beyond_the_last_state_a_body_slows_down_and_stops() {
        let a = motion(1.0, 8.0);
        let mut last = a;
        for step in 1..=100 {
            let next = a.beyond(f64::from(step) * 0.005);
            let speed = (next.pose.translation[0] - last.pose.translation[0]) / 0.005;
            assert!((-1e-9..8.0).contains(&speed) && next.velocity.linear[0] <= last.velocity.linear[0]);
            last = next;
        }
        assert_eq!(last, a.beyond(BEYOND_S));
        assert!((last.pose.translation[0] - 2.0).abs() < 1e-9, "half the way at full speed");
    }
}
