//! Finds which moving boxes and balls of two lists will touch within some time, by sweep and prune.

use crate::protocol::NearbyBody;
use crate::space::Bounds;

/// Visits every pair of bodies that will touch within `ahead_s` seconds. It sweeps and prunes along the axis
/// on which the bodies that may meet lie farthest apart, in strips across the second one.
pub(super) fn for_each_overlap(
    first: &[NearbyBody],
    second: &[NearbyBody],
    ahead_s: f64,
    mut visit: impl FnMut(&NearbyBody, &NearbyBody),
) {
    // An empty region has no list, but is sent all bodies that lie before it.
    if first.is_empty() || second.is_empty() {
        return;
    }
    let boxes = |list: &[NearbyBody]| -> Vec<_> {
        list.iter().map(|nearby| nearby.bounds.swept(nearby.velocity, ahead_s)).collect()
    };
    let (ours, theirs) = (boxes(first), boxes(second));
    let around = |boxes: &[Bounds]| boxes.iter().copied().reduce(|a, b| a.union(&b));
    let (Some(around_ours), Some(around_theirs)) = (around(&ours), around(&theirs)) else { return };
    if !around_ours.touches(&around_theirs) {
        return;
    }
    // In most regions only the bodies in a corner may meet the others.
    let strips = Strips::of(&theirs, &around_ours.intersection(&around_theirs));
    for (bounds, a) in ours.iter().zip(first) {
        strips.for_each_near(bounds, |place| {
            let b = &second[place];
            if bounds.touches(&theirs[place]) && meet_after(a, b).is_some_and(|after_s| after_s <= ahead_s) {
                visit(a, b);
            }
        });
    }
}

/// The most strips: going over more takes longer than they save.
const MOST_STRIPS: f64 = 64.0;

/// Boxes in strips along one axis, in each strip in order of where they begin.
struct Strips {
    /// The axis along which the strips lie, and the one across.
    along: usize,
    across: usize,
    /// The coordinate at which the first strip begins, and the width of each.
    from: f64,
    width: f64,
    /// The length of the longest box along the strips. No box is wider across than a strip.
    longest: f64,
    /// The strip in which each box begins, where along that it begins, and its place in the list.
    boxes: Vec<(i32, f64, usize)>,
}

impl Strips {
    /// Divides the boxes that touch `common` into strips.
    fn of(boxes: &[Bounds], common: &Bounds) -> Self {
        let size = common.size();
        let along = common.longest_axis().index();
        let others = [(along + 1) % 3, (along + 2) % 3];
        let across = if size[others[0]] >= size[others[1]] { others[0] } else { others[1] };
        let near = || boxes.iter().enumerate().filter(|(_, bounds)| bounds.touches(common));
        // A little more, so that rounding passes over none.
        let most =
            |axis: usize| near().map(|(_, bounds)| bounds.size()[axis]).fold(0.0, f64::max) * (1.0 + 1e-9);
        let from = near().map(|(_, bounds)| bounds.min[across]).fold(f64::INFINITY, f64::min);
        // Infinite boxes leave one strip.
        let width = most(across).max(size[across] / MOST_STRIPS).max(f64::MIN_POSITIVE);
        let mut strips = Self { along, across, from, width, longest: most(along), boxes: Vec::new() };
        let all =
            near().map(|(place, bounds)| (strips.strip_at(bounds.min[across]), bounds.min[along], place));
        strips.boxes = all.collect();
        strips.boxes.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2)));
        strips
    }

    /// Returns the strip at a coordinate; NaN lies in the first one.
    fn strip_at(&self, at: f64) -> i32 {
        ((at - self.from) / self.width).floor() as i32
    }

    /// Visits the places of all boxes that may touch this one.
    fn for_each_near(&self, bounds: &Bounds, mut visit: impl FnMut(usize)) {
        let (least, most) = (bounds.min[self.along] - self.longest, bounds.max[self.along]);
        let last = self.strip_at(bounds.max[self.across]);
        let mut strip = self.strip_at(bounds.min[self.across]).saturating_sub(1);
        let mut rest = &self.boxes[..];
        while strip <= last {
            rest = &rest[rest.partition_point(|&(of, at, _)| (of, at) < (strip, least))..];
            // Strips without a box are passed over.
            let Some(&(next, ..)) = rest.first() else { return };
            if next > strip {
                strip = next;
                continue;
            }
            for &(_, _, place) in rest.iter().take_while(|&&(of, at, _)| of == strip && at <= most) {
                visit(place);
            }
            strip = strip.saturating_add(1);
        }
    }
}

/// Returns in how many seconds two bodies may begin to touch: 0 if they may now, `None` if they never will.
fn meet_after(a: &NearbyBody, b: &NearbyBody) -> Option<f64> {
    let (boxes, balls) = (boxes_overlap(a, b)?, balls_overlap(a, b)?);
    let (enter, leave) = (boxes.0.max(balls.0), boxes.1.min(balls.1));
    (enter <= leave).then_some(enter)
}

/// Returns from when until when two moving boxes overlap, in seconds from now; `None` if they never will.
fn boxes_overlap(a: &NearbyBody, b: &NearbyBody) -> Option<(f64, f64)> {
    let (mut enter, mut leave) = (0.0f64, f64::INFINITY);
    for axis in 0..3 {
        let speed = f64::from(b.velocity[axis]) - f64::from(a.velocity[axis]);
        // How far b moves along the axis until its upper face meets a's lower one, and its lower face a's
        // upper one.
        let below = a.bounds.min[axis] - b.bounds.max[axis];
        let above = a.bounds.max[axis] - b.bounds.min[axis];
        if speed == 0.0 {
            if below > 0.0 || above < 0.0 {
                return None;
            }
            continue;
        }
        let (one, other) = (below / speed, above / speed);
        enter = enter.max(one.min(other));
        leave = leave.min(one.max(other));
    }
    (enter <= leave).then_some((enter, leave))
}

/// Returns from when until when the balls around the middles of two moving boxes overlap, in seconds from
/// now; `None` if they never will.
fn balls_overlap(a: &NearbyBody, b: &NearbyBody) -> Option<(f64, f64)> {
    let sum_m = f64::from(a.radius_m) + f64::from(b.radius_m);
    if sum_m.is_infinite() {
        return Some((0.0, f64::INFINITY));
    }
    let (from, to) = (a.bounds.centre(), b.bounds.centre());
    let apart: [f64; 3] = std::array::from_fn(|i| to[i] - from[i]);
    let velocity: [f64; 3] = std::array::from_fn(|i| f64::from(b.velocity[i]) - f64::from(a.velocity[i]));
    let dot = |a: &[f64; 3], b: &[f64; 3]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    // |apart + velocity t| = the sum of the radii.
    let (square, half, rest) =
        (dot(&velocity, &velocity), dot(&apart, &velocity), dot(&apart, &apart) - sum_m * sum_m);
    if square == 0.0 {
        return (rest <= 0.0).then_some((0.0, f64::INFINITY));
    }
    let root = (half * half - square * rest).sqrt();
    let (enter, leave) = ((-half - root) / square, (root - half) / square);
    // The root of a negative number is NaN, for which no comparison holds.
    (leave >= 0.0).then_some((enter.max(0.0), leave))
}

#[cfg(test)]
mod tests {
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::{Rng, SeedableRng};

    use super::*;
    use crate::space::{BodyId, RegionSet};

    fn nearby(id: u32, at: [f64; 3], velocity: [f32; 3]) -> NearbyBody {
        let bounds = Bounds::around(at, [0.5; 3]);
        let (radius_m, goes) = (0.87, RegionSet::EMPTY);
        NearbyBody {
            id: BodyId::persistent(id),
            bounds,
            radius_m,
            velocity,
            awake: true,
            island: 1,
            stays: false,
            articulated: false,
            driven: false,
            ccd: false,
            goes,
        }
    }

    #[test]
    fn boxes_meet_when_the_gap_closes_on_every_axis_at_once() {
        let meet = |b: NearbyBody| {
            let a = nearby(0, [0.0; 3], [1.0, 0.0, 0.0]);
            meet_after(&a, &b)
        };
        assert_eq!(meet(nearby(1, [3.0, 0.0, 0.0], [-1.0, 0.0, 0.0])), Some(1.0));
        assert_eq!(meet(nearby(1, [3.0, 0.0, 0.0], [1.0, 0.0, 0.0])), None, "as fast, it is never reached");
        assert_eq!(meet(nearby(1, [3.0, 0.0, 0.0], [2.0, 0.0, 0.0])), None, "it flees");
        assert_eq!(meet(nearby(1, [3.0, 4.0, 0.0], [-1.0, 0.0, 0.0])), None, "they pass");
        assert_eq!(meet(nearby(1, [0.5, 0.5, 0.0], [9.0, 9.0, 9.0])), Some(0.0), "they overlap");
    }

    #[test]
    fn balls_that_pass_each_other_do_not_meet_where_their_boxes_do() {
        let ball = |at, velocity| NearbyBody { radius_m: 0.5, ..nearby(0, at, velocity) };
        let meet = |at, velocity| meet_after(&ball([0.0; 3], [0.0; 3]), &ball(at, velocity));
        assert_eq!(meet([0.9, 0.9, 0.0], [0.0; 3]), None, "corner to corner");
        assert_eq!(meet([0.7, 0.7, 0.0], [0.0; 3]), Some(0.0));
        let above = meet([0.9, 3.0, 0.0], [0.0, -1.0, 0.0]).unwrap();
        assert!((above - (3.0 - 0.19f64.sqrt())).abs() < 1e-12, "{above}: from above, beside the middle");
        assert_eq!(meet([0.9, 3.0, 0.9], [0.0, -1.0, 0.0]), None, "past the edge");
        assert_eq!(meet([0.9, 3.0, 0.0], [0.0, 1.0, 0.0]), None, "it flees");
        let endless = NearbyBody {
            bounds: Bounds::new([f64::NEG_INFINITY; 3], [f64::INFINITY, 0.0, f64::INFINITY]),
            radius_m: f32::INFINITY,
            ..ball([0.0; 3], [0.0; 3])
        };
        assert_eq!(meet_after(&endless, &ball([9.0, 2.0, 9.0], [0.0, -1.0, 0.0])), Some(1.5), "a half-space");
    }

    #[test]
    fn both_sides_find_the_meetings_that_a_look_at_every_pair_finds() {
        let mut dice = ChaCha8Rng::seed_from_u64(3);
        let mut roll = |from: f32, to: f32| from + (to - from) * (dice.next_u32() as f32 / u32::MAX as f32);
        let mut list = |first: u32| -> Vec<_> {
            (first..first + 60)
                .map(|id| {
                    let at = std::array::from_fn(|_| f64::from(roll(-6.0, 6.0)));
                    nearby(id, at, std::array::from_fn(|_| roll(-5.0, 5.0)))
                })
                .collect()
        };
        let (ours, mut theirs) = (list(0), list(100));
        // Boxes of any size, on either side of all others, and an infinite one.
        for (id, half) in
            [(200, [5.0, 0.1, 0.1]), (201, [0.1, 9.0, 0.2]), (202, [f64::INFINITY, 0.3, f64::INFINITY])]
        {
            let bounds = Bounds::around([-1.0, 2.0, 1.0], half);
            let radius_m = f32::INFINITY;
            theirs.push(NearbyBody { bounds, radius_m, ..nearby(id, [0.0; 3], [0.0, 1.0, 0.0]) });
        }
        let pairs = |a: &[NearbyBody], b: &[NearbyBody], swapped: bool| {
            let mut found = Vec::new();
            for_each_overlap(a, b, 0.1, |a, b| {
                found.push(if swapped { (b.id, a.id) } else { (a.id, b.id) });
            });
            found.sort_unstable();
            found
        };
        let found = pairs(&ours, &theirs, false);
        assert_eq!(found, pairs(&theirs, &ours, true));
        let all = ours.iter().flat_map(|a| theirs.iter().map(move |b| (a, b)));
        let soon = all.filter(|(a, b)| {
            let after_s = meet_after(a, b);
            after_s.is_some_and(|after_s| after_s <= 0.1)
        });
        assert_eq!(found.len(), soon.count());
        assert!(found.len() > 20, "{}", found.len());
    }
}
