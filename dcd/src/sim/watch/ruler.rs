//! Measures a world of touching bodies: how far they strayed, how far joints are open, and what moved them.

use std::collections::BTreeMap;

use nalgebra::{Point3, Vector3};

use super::Look;
use crate::cluster::deviation_m;
use crate::protocol::{BodyKind, BodyRecord, BodyState, JointRecord, Pose, WorldPose};
use crate::space::{BodyId, Bounds};

/// The gap between two bodies beyond which they do not touch, besides what they move in a tick, metres. The
/// solver sees contacts from 2 mm on.
const CLEAR_M: f64 = 0.02;

/// A quantity that has a gate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// The deepest overlap.
    Overlap,
    /// The largest distance of a standing body from where it began.
    Stray,
    /// The largest distance between the two ends of a joint.
    Gap,
    /// The energy that the world has gained since its beginning, as a share of the energy that moves in it.
    Gain,
    /// The change of velocity of a body that touches nothing.
    Push,
    /// The distance of a body that touches nothing from where its velocity brought it.
    Leap,
    /// The change of the velocities, all together, of bodies that touch one another and nothing else: in a
    /// tick, and as a mean of many.
    Drift,
}

impl Quantity {
    /// All quantities.
    pub const ALL: [Self; 7] =
        [Self::Overlap, Self::Stray, Self::Gap, Self::Gain, Self::Push, Self::Leap, Self::Drift];

    /// Returns the name of the quantity.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Overlap => "overlap",
            Self::Stray => "stray",
            Self::Gap => "gap",
            Self::Gain => "gain",
            Self::Push => "push",
            Self::Leap => "leap",
            Self::Drift => "drift",
        }
    }

    /// Returns what it means for people that the quantity is too large.
    pub const fn summary(self) -> &'static str {
        match self {
            Self::Overlap => "two bodies overlap",
            Self::Stray => "a body that stood has moved",
            Self::Gap => "the ends of a joint are apart",
            Self::Gain => "the world has got energy from nowhere",
            Self::Push => "a body that touches nothing has changed its velocity",
            Self::Leap => "a body that touches nothing is not where its velocity brought it",
            Self::Drift => "contacts did not keep the momentum, in the mean of all ticks",
        }
    }

    /// Returns the quantity's value with a unit.
    pub(super) fn told(self, strain: &Strain) -> String {
        let value = strain.of(self);
        match self {
            Self::Gain => format!("{:.2} %", 100.0 * value),
            Self::Push | Self::Drift => format!("{value:.4} m/s"),
            Self::Overlap | Self::Stray | Self::Gap | Self::Leap => format!("{:.2} mm", 1_000.0 * value),
        }
    }
}

/// A value of each quantity, in metres, metres per second, or as a share.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Strain([f64; Quantity::ALL.len()]);

impl Strain {
    /// Creates a strain from a value of each quantity.
    pub fn each(value: impl Fn(Quantity) -> f64) -> Self {
        Self(Quantity::ALL.map(value))
    }

    /// Returns the value of a quantity.
    pub fn of(&self, quantity: Quantity) -> f64 {
        self.0[quantity as usize]
    }

    /// Returns the greatest value of any quantity.
    pub fn greatest(&self) -> f64 {
        self.0.into_iter().fold(0.0, worse)
    }

    /// Returns the greater value of each quantity. A value that is no number is greater than all.
    #[must_use]
    pub fn or_worse(self, other: Self) -> Self {
        Self::each(|quantity| worse(self.of(quantity), other.of(quantity)))
    }

    pub(super) fn shares_of(self, gates: &Self) -> Self {
        Self::each(|quantity| self.of(quantity) / gates.of(quantity))
    }
}

fn worse(a: f64, b: f64) -> f64 {
    if a.is_nan() || a > b { a } else { b }
}

/// What the world of a trial is measured by: where its bodies began, what ties them, and where balls fly
/// freely.
#[derive(Clone, Debug)]
pub struct Ruler {
    dt_s: f64,
    /// The poses in which movable bodies began, and those of fixed ones.
    starts: BTreeMap<BodyId, WorldPose>,
    fixed: BTreeMap<BodyId, WorldPose>,
    /// Says whether bodies are to stay where they began.
    stands: bool,
    /// The ends of each joint, on two bodies.
    joints: Vec<[(BodyId, Point3<f64>); 2]>,
    /// The room in which balls fly freely, and the radius of these balls, metres.
    flight: Option<(Bounds, f64)>,
    /// The speed along each axis at the beginning of bodies that touch nothing but walls. They keep it.
    speeds: BTreeMap<BodyId, [f32; 3]>,
    /// The energy at the beginning, and what moves in the world, joules.
    energy_j: (f64, f64),
}

impl Ruler {
    /// Creates a ruler for these bodies and joints, which are stepped by `dt_s` seconds at a time.
    pub fn new(dt_s: f32, bodies: &[BodyRecord], joints: &[JointRecord]) -> Self {
        let end = |body, frame: Pose| (body, Point3::from(frame.translation.map(f64::from)));
        let poses = |are_fixed: bool| {
            let of = move |body: &&BodyRecord| (body.traits.kind == BodyKind::Fixed) == are_fixed;
            bodies.iter().filter(of).map(|body| (body.id, body.state.pose)).collect()
        };
        Self {
            dt_s: dt_s.into(),
            starts: poses(false),
            fixed: poses(true),
            stands: false,
            joints: joints
                .iter()
                .map(|joint| [end(joint.a, joint.frame_a), end(joint.b, joint.frame_b)])
                .collect(),
            flight: None,
            speeds: BTreeMap::new(),
            energy_j: (f64::INFINITY, 1.0),
        }
    }

    /// Returns the same ruler for bodies that are to stay where they began.
    #[must_use]
    pub fn standing(self) -> Self {
        Self { stands: true, ..self }
    }

    /// Returns the same ruler for balls of equal mass that fly without gravity in this box.
    #[must_use]
    pub fn flying(self, room: Bounds, radius_m: f64) -> Self {
        Self { flight: Some((room, radius_m)), ..self }
    }

    /// Returns the same ruler for these bodies, which fly on for ever, like points that only walls turn back.
    #[must_use]
    pub fn passing(self, bodies: &[BodyRecord]) -> Self {
        Self { speeds: bodies.iter().map(|body| (body.id, speed(&body.state))).collect(), ..self }
    }

    /// Returns the same ruler with the energy at the beginning and the scale of a gain, joules.
    #[must_use]
    pub fn with_energy(self, start_j: f64, scale_j: f64) -> Self {
        Self { energy_j: (start_j, scale_j), ..self }
    }

    /// Returns whether a look has every body.
    pub fn is_whole(&self, look: &Look) -> bool {
        look.bodies.len() == self.starts.len()
    }

    /// Measures where bodies are, how deep they overlap, and what energy they have.
    pub fn of_place(&self, look: &Look) -> Strain {
        let (start_j, scale_j) = self.energy_j;
        Strain::each(|quantity| match quantity {
            Quantity::Overlap => look.mechanics.deepest_m,
            Quantity::Stray if self.stands => {
                let strayed = |(id, state): (&BodyId, &BodyState)| deviation_m(&state.pose, &self.starts[id]);
                look.bodies.iter().map(strayed).fold(0.0, worse)
            }
            Quantity::Gap => self.joints.iter().filter_map(|ends| self.gap_m(look, ends)).fold(0.0, worse),
            Quantity::Gain => worse(0.0, (look.mechanics.energy_j - start_j) / scale_j),
            Quantity::Stray | Quantity::Push | Quantity::Leap | Quantity::Drift => 0.0,
        })
    }

    /// Measures whether bodies that are to keep their speed have it. It needs no tick before, so it holds
    /// whatever was recovered since.
    pub fn of_speed(&self, look: &Look) -> Strain {
        let of = |(id, state): (&BodyId, &BodyState)| {
            let (was, is) = (self.speeds.get(id)?, speed(state));
            Some((0..3).map(|i| f64::from(is[i] - was[i]).abs()).fold(0.0, worse))
        };
        let push = look.bodies.iter().filter_map(of).fold(0.0, worse);
        Strain::each(|quantity| if quantity == Quantity::Push { push } else { 0.0 })
    }

    /// Returns how far apart the ends of a joint are, metres; `None` if one of its bodies is missing.
    fn gap_m(&self, look: &Look, [a, b]: &[(BodyId, Point3<f64>); 2]) -> Option<f64> {
        let place = |(id, end): &(BodyId, Point3<f64>)| {
            let pose = look.bodies.get(id).map(|state| &state.pose).or_else(|| self.fixed.get(id))?;
            Some(pose.isometry() * end)
        };
        Some((place(a)? - place(b)?).norm())
    }

    /// Measures what moved bodies from one tick to the next.
    pub fn of_motion(&self, before: &Look, now: &Look) -> Strain {
        let Some((room, radius_m)) = &self.flight else { return Strain::default() };
        let balls: Vec<_> = now
            .bodies
            .iter()
            .filter_map(|(id, now)| Some(Ball::new(before.bodies.get(id)?, now, *radius_m, self.dt_s)))
            .collect();
        let (mut push, mut leap, mut drift) = (0.0, 0.0, 0.0);
        for company in companies(&balls) {
            if company.iter().any(|ball| !ball.is_inside(room)) {
                continue;
            }
            if let [alone] = company[..] {
                (push, leap) = (worse(push, alone.push.norm()), worse(leap, alone.leap_m));
            } else {
                drift += company.iter().map(|ball| ball.push).sum::<Vector3<f64>>().norm();
            }
        }
        Strain::each(|quantity| match quantity {
            Quantity::Push => push,
            Quantity::Leap => leap,
            Quantity::Drift => drift,
            _ => 0.0,
        })
    }
}

fn speed(state: &BodyState) -> [f32; 3] {
    state.velocity.linear.map(f32::abs)
}

/// A ball in one tick, with its places before and after.
#[derive(Clone, Copy, Debug)]
struct Ball {
    places: [Point3<f64>; 2],
    /// How far from its places it may have touched something, metres.
    reach_m: f64,
    push: Vector3<f64>,
    leap_m: f64,
}

impl Ball {
    fn new(before: &BodyState, now: &BodyState, radius_m: f64, dt_s: f64) -> Self {
        let places = [before, now].map(|state| Point3::from(state.pose.translation));
        let [was, is] = [before, now].map(|state| Vector3::from(state.velocity.linear.map(f64::from)));
        Self {
            places,
            reach_m: radius_m + was.norm().max(is.norm()) * dt_s + CLEAR_M,
            push: is - was,
            leap_m: (places[1] - places[0] - is * dt_s).norm(),
        }
    }

    fn may_touch(&self, other: &Self) -> bool {
        let reach_m = self.reach_m + other.reach_m;
        (0..2).any(|at| (self.places[at] - other.places[at]).norm() <= reach_m)
    }

    /// Returns whether the ball is too far from the walls of its room to touch one.
    fn is_inside(&self, room: &Bounds) -> bool {
        let clear = |place: &Point3<f64>| {
            (0..3).all(|i| place[i] - self.reach_m > room.min[i] && place[i] + self.reach_m < room.max[i])
        };
        self.places.iter().all(clear)
    }
}

/// Returns the balls grouped by those that may have touched one another in the tick, directly or through
/// others.
fn companies(balls: &[Ball]) -> Vec<Vec<Ball>> {
    let mut left = balls.to_vec();
    let mut companies = Vec::new();
    while let Some(first) = left.pop() {
        let mut company = vec![first];
        let mut at = 0;
        while at < company.len() {
            let ball = company[at];
            let (near, far) = left.into_iter().partition(|other| ball.may_touch(other));
            company.extend::<Vec<_>>(near);
            left = far;
            at += 1;
        }
        companies.push(company);
    }
    companies
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::sim_body;

    fn look(bodies: &[([f64; 3], [f32; 3])]) -> Look {
        let state = |(i, (place, velocity)): (usize, &([f64; 3], [f32; 3]))| {
            let id = BodyId::persistent(i as u32);
            let mut state = sim_body(id, *place).state;
            state.velocity.linear = *velocity;
            (id, state)
        };
        Look { bodies: bodies.iter().enumerate().map(state).collect(), ..Look::default() }
    }

    fn room() -> Ruler {
        Ruler::new(0.1, &[], &[]).flying(Bounds::new([-9.0; 3], [9.0; 3]), 0.5)
    }

    #[test]
    fn balls_that_meet_push_one_another_and_what_is_alone_flies_on() {
        let before = look(&[([0.0; 3], [1.0, 0.0, 0.0]), ([1.02, 0.0, 0.0], [-1.0, 0.0, 0.0])]);
        let bounced = look(&[([0.0; 3], [-1.0, 0.0, 0.0]), ([1.02, 0.0, 0.0], [1.0, 0.0, 0.0])]);
        let found = room().of_motion(&before, &bounced);
        assert_eq!(found.greatest(), 0.0);
        let one_sided = look(&[([0.0; 3], [1.0, 0.0, 0.0]), ([1.02, 0.0, 0.0], [1.0, 0.0, 0.0])]);
        assert_eq!(room().of_motion(&before, &one_sided).of(Quantity::Drift), 2.0);
    }

    #[test]
    fn a_ball_that_is_stopped_or_stays_behind_in_mid_air_is_found() {
        let before = look(&[([0.0; 3], [1.0, 0.0, 0.0])]);
        let of = |place, velocity| room().of_motion(&before, &look(&[(place, velocity)]));
        let on = of([0.1, 0.0, 0.0], [1.0, 0.0, 0.0]);
        assert!(on.greatest() < 1e-6, "{on:?}");
        assert!((of([0.0; 3], [1.0, 0.0, 0.0]).of(Quantity::Leap) - 0.1).abs() < 1e-6);
        assert!((of([0.1, 0.0, 0.0], [0.0; 3]).of(Quantity::Push) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn what_is_no_number_is_worse_than_all() {
        let unsound = Strain::each(|_| f64::NAN).or_worse(Strain::each(|_| 1.0));
        assert!(Quantity::ALL.into_iter().all(|quantity| unsound.of(quantity).is_nan()));
        assert!(unsound.greatest().is_nan());
    }
}
