//! Condenses operations that move bodies and wait: a program goes on asking while no tick is opened, for
//! seconds if a member has died.

use std::collections::BTreeMap;

use crate::protocol::{Input, Push, WorldOp};
use crate::space::BodyId;

/// Returns fewer operations that do the same to bodies, in order:
///
/// - of each body the newest input of either kind, with the jump of those before it;
/// - its newest lasting force;
/// - the sum of its impulses without a point, from one input to the next;
/// - all impulses at points.
///
/// All other operations are left out.
pub(super) fn condensed(ops: &[WorldOp]) -> Vec<WorldOp> {
    let mut condensed = Condensed::default();
    for op in ops {
        match op {
            WorldOp::Input(input) => condensed.input(*input),
            WorldOp::Push(push) if push.lasts => condensed.force(*push),
            WorldOp::Push(push) => condensed.impulse(*push),
            _ => {}
        }
    }
    condensed.ops.into_iter().flatten().collect()
}

/// The operations that count so far, and where those of each body are.
#[derive(Default)]
struct Condensed {
    ops: Vec<Option<WorldOp>>,
    inputs: BTreeMap<(BodyId, bool), usize>,
    forces: BTreeMap<BodyId, usize>,
    impulses: BTreeMap<BodyId, usize>,
}

impl Condensed {
    fn input(&mut self, input: Input) {
        let before = self.inputs.insert(input.slot(), self.ops.len()).and_then(|at| self.ops[at].take());
        let input = match before {
            Some(WorldOp::Input(before)) => input.after(&before),
            _ => input,
        };
        self.impulses.remove(&input.body);
        self.ops.push(Some(WorldOp::Input(input)));
    }

    fn force(&mut self, push: Push) {
        if let Some(before) = self.forces.insert(push.body, self.ops.len()) {
            self.ops[before] = None;
        }
        self.ops.push(Some(WorldOp::Push(push)));
    }

    fn impulse(&mut self, push: Push) {
        let before = self.impulses.get(&push.body).and_then(|&at| self.ops[at].as_mut());
        if let Some(WorldOp::Push(before)) = before
            && let Some(sum) = sum(before, &push)
        {
            *before = sum;
            return;
        }
        if push.point.is_none() {
            self.impulses.insert(push.body, self.ops.len());
        }
        self.ops.push(Some(WorldOp::Push(push)));
    }
}

/// Returns the impulse that does what two impulses do at the centre of mass, if there is one.
fn sum(one: &Push, other: &Push) -> Option<Push> {
    let add = |a: [f32; 3], b: [f32; 3]| std::array::from_fn(|i| a[i] + b[i]);
    let (linear, angular) = (add(one.linear, other.linear), add(one.angular, other.angular));
    let is_finite = linear.iter().chain(&angular).all(|v: &f32| v.is_finite());
    (one.point.or(other.point).is_none() && is_finite).then_some(Push { linear, angular, ..*one })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::{Velocity, WorldPose};
    use crate::space::Tick;

    const BODY: BodyId = BodyId::persistent(1);

    fn input(x: f32, pose: Option<f64>) -> WorldOp {
        WorldOp::Input(Input {
            body: BODY,
            logical_time: 0,
            tick: Tick(0),
            velocity: Velocity::linear([x, 0.0, 0.0]),
            pose: pose.map(|x| WorldPose::at([x, 0.0, 0.0])),
            drive: None,
        })
    }

    fn impulse(x: f32) -> Push {
        Push::impulse(BODY, [x, 0.0, 0.0])
    }

    #[test]
    fn what_counts_of_a_body_is_its_newest_input_and_force_and_the_sum_of_its_impulses_in_order() {
        let force = |x| WorldOp::Push(Push::force(BODY, [x, 0.0, 0.0], [0.0; 3]));
        let push = |x| WorldOp::Push(impulse(x));
        let ops = [
            push(1.0),
            input(1.0, Some(5.0)),
            push(2.0),
            force(1.0),
            WorldOp::Remove(BodyId::persistent(2)),
            push(3.0),
            input(2.0, None),
            push(4.0),
            force(2.0),
            push(8.0),
        ];
        let expected = [push(1.0), push(5.0), input(2.0, Some(5.0)), push(12.0), force(2.0)];
        assert_eq!(condensed(&ops), expected);
    }

    #[test]
    fn impulses_at_points_and_those_whose_sum_nobody_can_write_stay_apart() {
        let ops = [impulse(1.0).at([1.0; 3]), impulse(1.0), impulse(2.0).at([1.0; 3])].map(WorldOp::Push);
        assert_eq!(condensed(&ops), ops);
        let ops = [impulse(f32::MAX), impulse(f32::MAX)].map(WorldOp::Push);
        assert_eq!(condensed(&ops), ops);
    }
}
