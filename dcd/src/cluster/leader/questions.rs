//! Clients' questions: dispatched with a tick to all members, whose answers come with the word that they have completed it.
//! A question whose answer does not come, because the members change, is asked again by its client.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use crate::protocol::{
    Answer, MAX_OPEN_QUESTIONS, MAX_OPEN_RAYS, MAX_RAYS, Question, RayAnswer, ToClient, WorldOp,
};
use crate::space::{ClientId, NodeId};

#[derive(Clone, Debug, Default)]
pub(super) struct Questions {
    waiting: VecDeque<(ClientId, Question)>,
    open: BTreeMap<(ClientId, u64), Open>,
}

/// A question under way.
#[derive(Clone, Debug)]
struct Open {
    missing: BTreeSet<NodeId>,
    hits: Vec<Option<RayAnswer>>,
}

impl Questions {
    /// A client asks, perhaps once more. What is beyond its bounds it asks again later.
    pub(super) fn ask(&mut self, client: ClientId, question: Question) {
        let waiting = self.waiting.iter().filter(|(of, _)| *of == client);
        let waiting = waiting.map(|(_, known)| (known.number, known.rays.len()));
        let under_way = self.open.range((client, 0)..=(client, u64::MAX));
        let under_way = under_way.map(|(&(_, number), open)| (number, open.hits.len()));
        let (mut count, mut rays) = (1, question.rays.len());
        for (number, more) in waiting.chain(under_way) {
            if number == question.number {
                return;
            }
            (count, rays) = (count + 1, rays + more);
        }
        if count <= MAX_OPEN_QUESTIONS && rays <= MAX_OPEN_RAYS {
            self.waiting.push_back((client, question));
        }
    }

    /// What goes with the next tick: as many rays as one question may have; the rest waits.
    pub(super) fn dispatch(&mut self, members: &BTreeSet<NodeId>) -> Vec<WorldOp> {
        let (mut ops, mut rays) = (Vec::new(), 0);
        while let Some((client, question)) = self.waiting.pop_front() {
            rays += question.rays.len();
            if rays > MAX_RAYS {
                self.waiting.push_front((client, question));
                break;
            }
            let open = Open { missing: members.clone(), hits: vec![None; question.rays.len()] };
            self.open.insert((client, question.number), open);
            ops.push(WorldOp::Ask { client, question });
        }
        ops
    }

    /// What a member's bodies answer; what follows for clients.
    pub(super) fn answered(&mut self, node: NodeId, answers: Vec<Answer>) -> Vec<(ClientId, ToClient)> {
        let mut messages = Vec::new();
        for Answer { client, number, hits } in answers {
            let Some(open) = self.open.get_mut(&(client, number)) else { continue };
            if hits.len() == open.hits.len() && open.missing.remove(&node) {
                for (best, hit) in open.hits.iter_mut().zip(hits) {
                    *best = RayAnswer::nearer(*best, hit);
                }
            }
            if open.missing.is_empty()
                && let Some(Open { hits, .. }) = self.open.remove(&(client, number))
            {
                messages.push((client, ToClient::Answer { number, hits }));
            }
        }
        messages
    }

    /// Nobody waits for the answers any more.
    pub(super) fn forget(&mut self, client: ClientId) {
        self.waiting.retain(|(of, _)| *of != client);
        self.open.retain(|&(of, _), _| of != client);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::RayQuestion;
    use crate::space::BodyId;

    const CLIENT: ClientId = ClientId(4);
    const MEMBERS: [NodeId; 2] = [NodeId(1), NodeId(2)];

    fn question(number: u64, rays: usize) -> Question {
        let ray = RayQuestion {
            origin: [0.0; 3],
            direction: [1.0, 0.0, 0.0],
            max_m: 9.0,
            solid: true,
            mask: u32::MAX,
            exclude: None,
        };
        Question { number, flags: 0, groups: 0, exclude: Vec::new(), rays: vec![ray; rays] }
    }

    fn hit(body: u32, distance_m: f64) -> Option<RayAnswer> {
        let body = BodyId::persistent(body);
        Some(RayAnswer { body, collider: 0, point: [0.0; 3], normal: [0.0; 3], distance_m, subshape: 0 })
    }

    fn answer(number: u64, hits: Vec<Option<RayAnswer>>) -> Vec<Answer> {
        vec![Answer { client: CLIENT, number, hits }]
    }

    #[test]
    fn the_nearest_of_all_members_answers_is_told_once_all_have_answered() {
        let (mut questions, members) = (Questions::default(), MEMBERS.into());
        questions.ask(CLIENT, question(7, 3));
        assert_eq!(questions.dispatch(&members).len(), 1);
        let [one, two] = MEMBERS;
        assert_eq!(questions.answered(one, answer(7, vec![hit(1, 5.0), hit(2, 2.0), None])), []);
        assert_eq!(questions.answered(one, answer(7, vec![None; 3])), [], "said again");
        assert_eq!(questions.answered(two, answer(7, vec![None; 2])), [], "to something else");
        assert_eq!(questions.answered(two, answer(8, vec![None; 3])), []);
        let told = questions.answered(two, answer(7, vec![hit(3, 4.0), hit(1, 2.0), None]));
        let hits = vec![hit(3, 4.0), hit(1, 2.0), None];
        assert_eq!(told, [(CLIENT, ToClient::Answer { number: 7, hits })]);
        assert_eq!(questions.answered(two, answer(7, vec![None; 3])), []);
    }

    #[test]
    fn a_question_said_again_is_asked_once_and_a_client_has_so_many_at_most() {
        let (mut questions, members) = (Questions::default(), MEMBERS.into());
        for number in 0..2 * MAX_OPEN_QUESTIONS as u64 {
            questions.ask(CLIENT, question(number, 1));
            questions.ask(CLIENT, question(number, 1));
        }
        questions.ask(ClientId(5), question(0, 1));
        assert_eq!(questions.dispatch(&members).len(), MAX_OPEN_QUESTIONS + 1);
        questions.ask(CLIENT, question(0, 1));
        questions.ask(CLIENT, question(1_000, 1));
        assert_eq!(questions.dispatch(&members), [], "they are under way");
        questions.forget(CLIENT);
        questions.ask(CLIENT, question(1_000, 1));
        assert_eq!(questions.dispatch(&members).len(), 1);
    }

    #[test]
    fn a_tick_takes_so_many_rays_and_the_rest_waits() {
        let (mut questions, members) = (Questions::default(), MEMBERS.into());
        for number in 0..5 {
            questions.ask(CLIENT, question(number, MAX_RAYS / 2));
        }
        let counts: Vec<_> = (0..4).map(|_| questions.dispatch(&members).len()).collect();
        assert_eq!(counts, [2, 2, 1, 0]);
        for number in 5..20 {
            questions.ask(CLIENT, question(number, MAX_RAYS / 2));
        }
        let waiting: usize = questions.waiting.iter().map(|(_, question)| question.rays.len()).sum();
        assert_eq!(waiting + 5 * MAX_RAYS / 2, MAX_OPEN_RAYS, "those under way count too");
    }
}
