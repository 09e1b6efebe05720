//! Keeps what the server's program, or a builder, did while nobody heard of it: membership changed, or the
//! leader was out of reach.

use std::collections::BTreeMap;

use crate::protocol::{Input, Push, WorldOp};
use crate::space::BodyId;

/// Keeps what counts when somebody computes the world again: the newest velocity, the last jump and the
/// newest lasting force of each body. Impulses of that time would act all at once, and are dropped.
#[derive(Clone, Debug, Default)]
pub(super) struct Postponed {
    inputs: BTreeMap<(BodyId, bool), Input>,
    pushes: BTreeMap<BodyId, Push>,
}

impl Postponed {
    pub(super) fn add(&mut self, op: WorldOp) {
        match op {
            WorldOp::Input(input) => {
                let newest = self.inputs.entry(input.slot()).or_insert(input);
                *newest = input.after(newest);
            }
            WorldOp::Push(push) if push.lasts => _ = self.pushes.insert(push.body, push),
            _ => {}
        }
    }

    /// Takes out how bodies are still to move, each body once.
    pub(super) fn take_inputs(&mut self) -> impl Iterator<Item = Input> + use<> {
        std::mem::take(&mut self.inputs).into_values()
    }

    /// Returns what is still to be done, for bodies that are there.
    pub(super) fn ops(self, is_there: impl Fn(BodyId) -> bool) -> Vec<WorldOp> {
        let inputs = self.inputs.into_values().filter(|input| is_there(input.body)).map(WorldOp::Input);
        let pushes = self.pushes.into_values().filter(|push| is_there(push.body)).map(WorldOp::Push);
        inputs.chain(pushes).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::{Velocity, WorldPose};
    use crate::space::Tick;

    #[test]
    fn what_waits_is_the_newest_of_each_body_with_the_jump_before_it() {
        let input = |index: u32, x: f32, pose: Option<f64>| Input {
            body: BodyId::persistent(index),
            logical_time: 0,
            tick: Tick(0),
            velocity: Velocity { linear: [x, 0.0, 0.0], angular: [0.0; 3] },
            pose: pose.map(|x| WorldPose::at([x, 0.0, 0.0])),
            drive: None,
        };
        let mut postponed = Postponed::default();
        for input in [input(1, 1.0, Some(5.0)), input(2, 1.0, None), input(1, 2.0, None), input(3, 1.0, None)]
        {
            postponed.add(WorldOp::Input(input));
        }
        let ops = postponed.ops(|id| id != BodyId::persistent(3));
        assert_eq!(ops, [input(1, 2.0, Some(5.0)), input(2, 1.0, None)].map(WorldOp::Input));
    }
}
