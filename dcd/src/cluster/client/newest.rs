//! Keeps the newest inputs of a client's avatars, and sends those again, to a new leader or over a new link,
//! that nobody may have heard.

use std::collections::BTreeMap;
use std::time::Duration;

use super::{Client, ClientOutput};
use crate::cluster::Peer;
use crate::protocol::{FromClient, Input, Message};
use crate::space::BodyId;

/// The age up to which an input that a leader has answered is sent again to the next leader: later, much may
/// have happened since.
const STILL_MEANT: Duration = Duration::from_secs(5);

/// The age up to which a jump that was done, or may have been without an answer, is sent again, as the last
/// leader may have taken it with it. Later, the avatar has moved on.
const JUMP_MEANT: Duration = Duration::from_secs(1);

/// The newest input of each kind for each avatar.
#[derive(Clone, Debug, Default)]
pub(super) struct NewestInputs {
    inputs: BTreeMap<(BodyId, bool), Kept>,
    /// The logical time of the newest input that a leader said it has applied.
    applied: u64,
}

#[derive(Clone, Copy, Debug)]
struct Kept {
    input: Input,
    /// The logical time of the input that said where it jumps, and when that was.
    jumped: u64,
    jumped_at: Duration,
    /// Says whether that jump was sent to anybody.
    is_jump_sent: bool,
    made: Duration,
    /// Says whether a leader has refused it, or one for the same avatar soon before it.
    is_refused: bool,
}

impl NewestInputs {
    /// Keeps an input in place of the last one of its kind, with the jump of that one if no leader has
    /// answered it.
    pub(super) fn keep(&mut self, input: Input, now: Duration, is_sent: bool) {
        let is_open = |kept: &&Kept| kept.jumped > self.applied && !kept.is_refused;
        let before = self.inputs.get(&input.slot()).filter(|_| input.pose.is_none()).filter(is_open);
        let kept = match before {
            Some(before) => {
                Kept { input: input.after(&before.input), made: now, is_refused: false, ..*before }
            }
            None => {
                let jumped = input.logical_time;
                Kept { input, jumped, jumped_at: now, is_jump_sent: is_sent, made: now, is_refused: false }
            }
        };
        self.inputs.insert(input.slot(), kept);
    }

    /// Notes that inputs up to this logical time are applied, or were replaced by later ones.
    pub(super) fn are_applied(&mut self, logical_time: u64) {
        self.applied = self.applied.max(logical_time);
    }

    /// Notes that an input for an avatar is refused. It may be any of those that are kept.
    pub(super) fn are_refused(&mut self, avatar: BodyId) {
        let of_it = self.inputs.range_mut((avatar, false)..=(avatar, true));
        of_it.for_each(|(_, kept)| kept.is_refused = true);
    }

    /// Notes that jumps that were not sent to anybody are sent now.
    fn are_said(&mut self, now: Duration) {
        for kept in self.inputs.values_mut().filter(|kept| !kept.is_jump_sent) {
            (kept.is_jump_sent, kept.jumped_at) = (true, now);
        }
    }

    /// Forgets the inputs for an avatar that is gone.
    pub(super) fn forget(&mut self, avatar: BodyId) {
        self.inputs.retain(|(id, _), _| *id != avatar);
    }

    /// Forgets all inputs.
    pub(super) fn clear(&mut self) {
        self.inputs.clear();
    }

    /// Returns the inputs to send to a new leader, in the order in which they were made: a leader refuses an
    /// input that is older than one before. An input that no leader has answered is sent however old it is,
    /// since nobody may have heard it. The others may be lost with the leader before.
    fn to_say_again(&self, now: Duration) -> Vec<Input> {
        let is_due = |kept: &&Kept| {
            let is_answered = kept.is_refused || kept.input.logical_time <= self.applied;
            !is_answered || kept.made + STILL_MEANT >= now
        };
        let said = |kept: &Kept| {
            let is_open = kept.jumped > self.applied && !kept.is_refused;
            let is_recent = kept.jumped_at + JUMP_MEANT >= now;
            let jumps = match kept.jumped == kept.input.logical_time {
                true => is_open || is_recent,
                // The jump came with an older input. If a leader has answered that one, or may have done it
                // long ago, the avatar does not jump again.
                false => is_open && (!kept.is_jump_sent || is_recent),
            };
            Input { pose: kept.input.pose.filter(|_| jumps), ..kept.input }
        };
        let mut inputs: Vec<_> = self.inputs.values().filter(is_due).map(said).collect();
        inputs.sort_unstable_by_key(|input| input.logical_time);
        inputs
    }
}

impl Client {
    /// Sends an input, and keeps it for leaders to come.
    pub(super) fn send_newest(&mut self, input: Input) {
        self.logical_time += 1;
        let input = Input { logical_time: self.logical_time, ..input };
        let is_sent = self.leader.is_none() || self.node.is_some() || self.linked;
        self.newest.keep(input, self.now, is_sent);
        self.showing.iter_mut().for_each(|showing| showing.sent(self.now, input));
        self.send_input(input);
    }

    fn send_input(&mut self, input: Input) {
        let input = FromClient::Input(input);
        match &self.leader {
            None => self.ask_server(input),
            Some(_) if self.node.is_some() => self.outputs.push_back(ClientOutput::Node(input)),
            Some(member) if self.linked => {
                let to = Peer::Node(member.node);
                self.send(to, Message::FromClient(self.id, input));
            }
            // The newest input waits for the link.
            Some(_) => {}
        }
    }

    /// Sends the inputs again that a new leader may not know.
    pub(super) fn say_inputs_again(&mut self) {
        for input in self.newest.to_say_again(self.now) {
            self.send_input(input);
        }
        self.newest.are_said(self.now);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::{Drive, Velocity, WorldPose};
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
            newest.keep(input(body, time, drives), Duration::from_secs(time), true);
        }
        let times = |newest: &NewestInputs, seconds| -> Vec<_> {
            let inputs = newest.to_say_again(Duration::from_secs(seconds));
            inputs.iter().map(|input| input.logical_time).collect()
        };
        assert_eq!(
            times(&newest, 900),
            [1, 3, 4],
            "how it is driven, and how fast it is put, stand side by side"
        );
        newest.are_applied(3);
        assert_eq!(times(&newest, 6), [1, 3, 4], "the leader may have taken them with it");
        assert_eq!(times(&newest, 7), [3, 4]);
        newest.are_applied(2);
        assert_eq!(times(&newest, 900), [4], "nobody may have heard it");
        newest.are_refused(first);
        assert_eq!((times(&newest, 9), times(&newest, 900)), (vec![4], vec![]));
        newest.forget(first);
        assert_eq!(times(&newest, 0), [1]);
    }

    #[test]
    fn a_jump_that_nobody_may_have_heard_is_said_again_with_what_came_after_it_and_no_other() {
        let avatar = BodyId::avatar(ClientId(1), 0);
        let (pose, velocity) = (WorldPose::at([5.0, 0.0, 0.0]), Velocity::default());
        let input = |logical_time, pose| Input {
            body: avatar,
            logical_time,
            tick: Tick(0),
            velocity,
            pose,
            drive: None,
        };
        let mut newest = NewestInputs::default();
        newest.keep(input(1, Some(pose)), Duration::ZERO, true);
        newest.keep(input(2, None), Duration::ZERO, true);
        newest.keep(input(3, None), Duration::ZERO, true);
        let again = |newest: &NewestInputs| newest.to_say_again(Duration::ZERO);
        assert_eq!(again(&newest), [input(3, Some(pose))]);
        // The leader has done the jump, and not yet the newest input.
        newest.are_applied(1);
        assert_eq!(again(&newest), [input(3, None)]);
        newest.keep(input(4, None), Duration::ZERO, true);
        assert_eq!(again(&newest), [input(4, None)]);
        newest.keep(input(5, Some(pose)), Duration::ZERO, true);
        newest.are_refused(avatar);
        newest.keep(input(6, None), Duration::ZERO, true);
        assert_eq!(again(&newest), [input(6, None)], "it may not jump there");
    }

    #[test]
    fn a_jump_that_was_done_is_not_said_again_long_after_though_nothing_was_asked_since() {
        let mut newest = NewestInputs::default();
        let input = Input {
            body: BodyId::avatar(ClientId(1), 0),
            logical_time: 1,
            tick: Tick(0),
            velocity: Velocity::default(),
            pose: Some(WorldPose::at([1.0, 2.0, 3.0])),
            drive: None,
        };
        newest.keep(input, Duration::ZERO, true);
        let again = |newest: &NewestInputs, at| newest.to_say_again(Duration::from_secs(at));
        assert_eq!(again(&newest, 2), [input], "nobody may have heard it");
        newest.are_applied(1);
        assert_eq!(again(&newest, 1), [input], "the leader may have taken it with it");
        assert_eq!(again(&newest, 2), [Input { pose: None, ..input }]);
    }

    #[test]
    fn a_jump_that_was_told_is_not_said_again_long_after_and_one_that_nobody_heard_is() {
        let avatar = BodyId::avatar(ClientId(1), 0);
        let pose = WorldPose::at([1.0, 2.0, 3.0]);
        for is_sent in [false, true] {
            let mut newest = NewestInputs::default();
            for (logical_time, pose) in [(1, Some(pose)), (2, None)] {
                let (tick, velocity) = (Tick(0), Velocity::default());
                let input = Input { body: avatar, logical_time, tick, velocity, pose, drive: None };
                newest.keep(input, Duration::ZERO, is_sent);
            }
            let jump =
                |newest: &NewestInputs, at: f64| newest.to_say_again(Duration::from_secs_f64(at))[0].pose;
            assert_eq!(jump(&newest, 0.9), Some(pose));
            assert_eq!(jump(&newest, 1.1), (!is_sent).then_some(pose));
            newest.are_said(Duration::from_secs(3));
            assert_eq!(jump(&newest, 4.1), None);
        }
    }
}
