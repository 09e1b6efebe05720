//! Asks the leader queries of the server's program about bodies (rays, shape casts, overlaps), and asks again
//! until it has answered.

use std::collections::BTreeMap;
use std::time::Duration;

use super::{Server, ServerOutput};
use crate::protocol::{Query, QueryResult, ToNode, ViewNumber};
use crate::space::NodeId;

/// The time after which an unanswered question is asked again, of the node that leads by then.
const ASK_AGAIN: Duration = Duration::from_millis(500);

/// The program's unanswered questions by number, each with the time at which it is asked again.
#[derive(Clone, Debug, Default)]
pub(super) struct Questions(BTreeMap<u64, (Query, Duration)>);

impl Questions {
    pub(super) fn due(&self) -> Option<Duration> {
        self.0.values().map(|&(_, at)| at).min()
    }

    /// Returns the questions that are due to be asked.
    fn take_due(&mut self, now: Duration) -> Vec<Query> {
        let due = self.0.values_mut().filter(|(_, at)| *at <= now);
        let again = |(question, at): &mut (Query, Duration)| {
            *at = now + ASK_AGAIN;
            question.clone()
        };
        due.map(again).collect()
    }
}

impl Server {
    /// Takes in a question of the program. Its number differs from those of all others.
    pub(super) fn ask(&mut self, question: Query) {
        self.questions.0.insert(question.number, (question, self.common.now));
        self.ask_leader();
    }

    /// Forgets a question whose answer is no longer wanted.
    pub(super) fn unask(&mut self, number: u64) {
        self.questions.0.remove(&number);
    }

    /// Asks the leader the questions that are due, if somebody computes the world.
    pub(super) fn ask_leader(&mut self) {
        let due = self.questions.take_due(self.common.now);
        let Some(view) = self.view() else { return };
        let (leader, view) = (view.leader, view.number);
        for question in due {
            self.common.send_node(leader, ToNode::Ask { view, question });
        }
    }

    /// Takes in an answer. A repeated answer, or one of another kind than was asked for, changes nothing.
    pub(super) fn answered(&mut self, node: NodeId, view: ViewNumber, number: u64, found: QueryResult) {
        let leads = self.is_led_by(node, view);
        let Some((question, _)) = self.questions.0.get(&number).filter(|_| leads) else {
            self.common.stale += 1;
            return;
        };
        let mut answer = question.parts.nothing();
        if answer.join(found) {
            self.questions.0.remove(&number);
            self.common.outputs.push_back(ServerOutput::Answered { number, found: answer });
        }
    }
}
