//! Keeps the newest inputs of a client's avatars, which it sends again when a link, or a leader, is new.

use std::collections::BTreeMap;
use std::time::Duration;

use crate::protocol::Input;
use crate::space::BodyId;

/// The newest input of each kind for each avatar, and when it was made.
#[derive(Clone, Debug, Default)]
pub(super) struct NewestInputs(BTreeMap<(BodyId, bool), (Input, Duration)>);

impl NewestInputs {
    /// Keeps an input in place of the one of its kind before.
    pub(super) fn keep(&mut self, input: Input, now: Duration) {
        self.0.insert(input.slot(), (input, now));
    }

    /// Forgets the inputs for an avatar that is gone.
    pub(super) fn forget(&mut self, avatar: BodyId) {
        self.0.retain(|(id, _), _| *id != avatar);
    }

    /// Forgets all inputs.
    pub(super) fn clear(&mut self) {
        self.0.clear();
    }

    /// Returns the inputs that were made at this time or later, in the order in which they were made: leaders refuse those that are
    /// older than one before.
    pub(super) fn since(&self, time: Duration) -> Vec<Input> {
        let mut inputs: Vec<_> =
            self.0.values().filter(|(_, at)| *at >= time).map(|&(input, _)| input).collect();
        inputs.sort_unstable_by_key(|input| input.logical_time);
        inputs
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::{Drive, Velocity};
    use crate::space::{ClientId, Tick};

    #[test]
    fn inputs_are_said_again_in_the_order_in_which_they_were_made() {
        let [first, second] = [0, 1].map(|index| BodyId::avatar(ClientId(1), index));
        let input = |body, logical_time, drives: bool| Input {
            body,
            logical_time,
            tick: Tick(0),
            velocity: Velocity::default(),
            pose: None,
            drive: drives.then(Drive::default),
        };
        let mut newest = NewestInputs::default();
        let made = [(second, 1, false), (first, 2, true), (first, 3, true), (first, 4, false)];
        for (body, time, drives) in made {
            newest.keep(input(body, time, drives), Duration::from_secs(time));
        }
        let times = |newest: &NewestInputs, seconds| -> Vec<_> {
            newest.since(Duration::from_secs(seconds)).iter().map(|input| input.logical_time).collect()
        };
        assert_eq!(
            times(&newest, 0),
            [1, 3, 4],
            "how it is driven, and how fast it is put, stand side by side"
        );
        assert_eq!(times(&newest, 4), [4]);
        newest.forget(first);
        assert_eq!(times(&newest, 0), [1]);
    }
}
