//! Numbers the operations on moving bodies that a leader is told, and keeps them until they have surely
//! arrived. What is sent into a link that is dead, but not yet known to be, is sent again over the next link.

use std::collections::VecDeque;
use std::time::Duration;

use super::postponed::Postponed;
use crate::protocol::link::IDLE_TIMEOUT;
use crate::protocol::{ViewNumber, WorldOp};
use crate::space::BodyId;

/// How long sent operations are kept, checked when more are sent. By then they have arrived, or the link is
/// known to be dead.
const SURELY_HEARD: Duration = IDLE_TIMEOUT.saturating_mul(2);
/// The most operations kept. If a program asks for more within that time, the oldest are dropped: the newest
/// count.
const MOST: usize = 1 << 17;

/// The operations on moving bodies that a node was told in its view, if it leads.
#[derive(Clone, Debug, Default)]
pub(super) struct Moves {
    view: ViewNumber,
    /// The number of the next operation in the view.
    next: u64,
    /// The last operations, each with its number and the time at which it was sent. Impulses are left out, as
    /// they would act all at once.
    kept: VecDeque<(u64, Duration, WorldOp)>,
}

impl Moves {
    /// Returns the state for a view that begins, in which no operation has been sent yet.
    pub(super) fn of_view(view: ViewNumber) -> Self {
        Self { view, ..Self::default() }
    }

    /// Notes operations that are sent now. Returns the number of the first of them that moves a body.
    pub(super) fn are_sent(&mut self, now: Duration, ops: &[WorldOp]) -> u64 {
        let first = self.next;
        for op in ops.iter().filter(|op| op.moves().is_some()) {
            if !matches!(op, WorldOp::Push(push) if !push.lasts) {
                self.kept.push_back((self.next, now, op.clone()));
            }
            self.next = self.next.saturating_add(1);
        }
        let is_over = |(_, at, _): &(u64, Duration, WorldOp)| *at + SURELY_HEARD < now;
        while self.kept.len() > MOST || self.kept.front().is_some_and(is_over) {
            self.kept.pop_front();
        }
        first
    }

    /// Takes in how many operations a node that comes back has heard in this view. The next ones are numbered
    /// from there. Returns those that it has not heard and that still count, on bodies that are there.
    pub(super) fn are_heard(
        &mut self,
        view: ViewNumber,
        heard: u64,
        is_there: impl Fn(BodyId) -> bool,
    ) -> Vec<WorldOp> {
        let kept = std::mem::take(&mut self.kept);
        let is_same = std::mem::replace(&mut self.view, view) == view;
        self.next = heard;
        let mut lost = Postponed::default();
        let unheard = kept.into_iter().filter(|(number, ..)| is_same && *number >= heard);
        unheard.for_each(|(_, _, op)| lost.add(op));
        lost.ops(is_there)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::{Input, Push, Velocity};
    use crate::space::Tick;

    const BODY: BodyId = BodyId::persistent(1);
    const VIEW: ViewNumber = ViewNumber(3);

    fn to(speed: f32) -> WorldOp {
        let velocity = Velocity::linear([speed, 0.0, 0.0]);
        WorldOp::Input(Input {
            body: BODY,
            logical_time: 0,
            tick: Tick(0),
            velocity,
            pose: None,
            drive: None,
        })
    }

    #[test]
    fn what_a_leader_did_not_hear_is_the_newest_of_each_body_and_no_impulse() {
        let impulse = WorldOp::Push(Push::impulse(BODY, [1.0; 3]));
        let force = WorldOp::Push(Push::force(BODY, [1.0; 3], [0.0; 3]));
        let mut moves = Moves::of_view(VIEW);
        let ops = [to(1.0), WorldOp::Remove(BodyId::persistent(9)), impulse.clone()];
        assert_eq!(moves.are_sent(Duration::ZERO, &ops), 0);
        assert_eq!(moves.are_sent(Duration::ZERO, &[to(2.0), force.clone(), impulse, to(3.0)]), 2);
        let heard = |heard, view| moves.clone().are_heard(view, heard, |_| true);
        assert_eq!(heard(1, VIEW), [to(3.0), force.clone()]);
        assert_eq!(heard(4, VIEW), [to(3.0)]);
        assert_eq!(heard(6, VIEW), []);
        assert_eq!(heard(0, ViewNumber(2)), [], "the view before, in which it was told other things");
        assert_eq!(moves.are_heard(VIEW, 3, |id| id != BODY), []);
        assert_eq!(moves.are_sent(Duration::ZERO, &[to(4.0)]), 3, "numbers go on from what it has heard");
    }

    #[test]
    fn what_has_surely_arrived_is_not_kept() {
        let mut moves = Moves::of_view(VIEW);
        let at = |ms| Duration::from_millis(ms);
        moves.are_sent(at(0), &[to(1.0)]);
        moves.are_sent(at(1_500), &[to(2.0)]);
        assert_eq!(moves.kept.len(), 2);
        moves.are_sent(at(2_500), &[to(3.0)]);
        assert_eq!(moves.kept.len(), 2);
        moves.are_sent(at(2_500), &vec![to(4.0); MOST + 9]);
        assert_eq!(moves.kept.len(), MOST);
    }
}
