//! Answers clients' queries about bodies (rays, shape casts, overlaps): each is dispatched with a tick to all
//! members, whose answers come when they have completed it. A member that sends none by then has nothing to
//! answer. A query whose answer does not come, because the members change, is asked again by its client.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use crate::protocol::{
    Answer, MAX_COST, MAX_OPEN_COST, MAX_OPEN_QUERIES, Query, QueryResult, ToClient, WorldOp, encoded_len,
};
use crate::space::{ClientId, NodeId, Tick};

/// The bytes of answers that a client may be sent per tick before the rest waits. A client that reads too
/// slowly loses its link, and several long answers at once are more than may wait for it.
const ANSWER_BYTES: usize = 8 << 10;

#[derive(Clone, Debug, Default)]
pub(super) struct Questions {
    waiting: VecDeque<(ClientId, Query)>,
    open: BTreeMap<(ClientId, u64), Open>,
    /// Complete answers that are not sent yet.
    ready: VecDeque<Ready>,
    /// The bytes of answers that each client was sent, less its allowance of every tick since.
    told: BTreeMap<ClientId, usize>,
}

/// A query under way.
#[derive(Clone, Debug)]
struct Open {
    /// The tick with which it is dispatched.
    tick: Tick,
    missing: BTreeSet<NodeId>,
    cost: usize,
    found: QueryResult,
}

#[derive(Clone, Debug)]
struct Ready {
    client: ClientId,
    number: u64,
    cost: usize,
    found: QueryResult,
}

impl Questions {
    /// Takes in a client's query, perhaps asked once more. A query beyond the client's bounds is dropped; the
    /// client asks it again later.
    pub(super) fn ask(&mut self, client: ClientId, question: Query) {
        let (mut count, mut cost) = (1, question.cost());
        for (number, more) in self.unanswered(client) {
            if number == question.number {
                return;
            }
            (count, cost) = (count + 1, cost + more);
        }
        if count <= MAX_OPEN_QUERIES && cost <= MAX_OPEN_COST {
            self.waiting.push_back((client, question));
        }
    }

    /// Returns the numbers of a client's unanswered queries, with what each costs.
    fn unanswered(&self, client: ClientId) -> impl Iterator<Item = (u64, usize)> {
        let waiting = self.waiting.iter().filter(move |(of, _)| *of == client);
        let waiting = waiting.map(|(_, question)| (question.number, question.cost()));
        let under_way = self.open.range((client, 0)..=(client, u64::MAX));
        let under_way = under_way.map(|(&(_, number), open)| (number, open.cost));
        let ready = self.ready.iter().filter(move |ready| ready.client == client);
        waiting.chain(under_way).chain(ready.map(|ready| (ready.number, ready.cost)))
    }

    /// Returns the queries that go with the next tick. Together they cost at most what one query may cost;
    /// the rest waits.
    pub(super) fn dispatch(&mut self, tick: Tick, members: &BTreeSet<NodeId>) -> Vec<WorldOp> {
        let (mut ops, mut cost) = (Vec::new(), 0);
        while let Some((client, question)) = self.waiting.pop_front() {
            let own = question.cost();
            cost += own;
            if cost > MAX_COST {
                self.waiting.push_front((client, question));
                break;
            }
            let open = Open { tick, missing: members.clone(), cost: own, found: question.parts.nothing() };
            self.open.insert((client, question.number), open);
            ops.push(WorldOp::Ask { client, question });
        }
        ops
    }

    /// Takes in a member's answers.
    pub(super) fn answered(&mut self, node: NodeId, answers: Vec<Answer>) {
        for Answer { client, number, found } in answers {
            let Some(open) = self.open.get_mut(&(client, number)) else { continue };
            if open.missing.contains(&node) && open.found.join(found) {
                open.missing.remove(&node);
            }
            self.close((client, number));
        }
    }

    /// Notes that a member has completed a tick. Its answers to what was dispatched until then have come with
    /// it. An answer that it left out keeps nobody waiting.
    pub(super) fn done(&mut self, node: NodeId, tick: Tick) {
        let mut over = Vec::new();
        for (&key, open) in self.open.iter_mut().filter(|(_, open)| open.tick <= tick) {
            over.extend(open.missing.remove(&node).then_some(key));
        }
        over.into_iter().for_each(|key| self.close(key));
    }

    /// Makes the answer to a query ready to be sent, if no member's is missing any more.
    fn close(&mut self, key: (ClientId, u64)) {
        if self.open.get(&key).is_some_and(|open| open.missing.is_empty())
            && let Some(Open { cost, found, .. }) = self.open.remove(&key)
        {
            let (client, number) = key;
            self.ready.push_back(Ready { client, number, cost, found });
        }
    }

    /// Grants each client its allowance of answers for a new tick.
    pub(super) fn allow(&mut self) {
        self.told.retain(|_, bytes| {
            *bytes = bytes.saturating_sub(ANSWER_BYTES);
            *bytes > 0
        });
    }

    /// Returns complete answers, for clients that have not been sent too much.
    pub(super) fn tell(&mut self) -> Vec<(ClientId, ToClient)> {
        let mut messages = Vec::new();
        for ready in std::mem::take(&mut self.ready) {
            let told = self.told.entry(ready.client).or_default();
            if *told >= ANSWER_BYTES {
                self.ready.push_back(ready);
                continue;
            }
            *told += encoded_len(&ready.found);
            messages.push((ready.client, ToClient::Answer { number: ready.number, found: ready.found }));
        }
        messages
    }

    /// Forgets a client's queries and answers.
    pub(super) fn forget(&mut self, client: ClientId) {
        self.waiting.retain(|(of, _)| *of != client);
        self.open.retain(|&(of, _), _| of != client);
        self.ready.retain(|ready| ready.client != client);
        self.told.remove(&client);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::{FilterRecord, PartFilter, QueryParts, RayAnswer, RayQuery};
    use crate::space::BodyId;

    const CLIENT: ClientId = ClientId(4);
    const MEMBERS: [NodeId; 2] = [NodeId(1), NodeId(2)];

    fn question(number: u64, rays: usize) -> Query {
        let ray = RayQuery {
            origin: [0.0; 3],
            direction: [1.0, 0.0, 0.0],
            max_m: 9.0,
            solid: true,
            filter: PartFilter::default(),
        };
        let (filter, shapes) = (FilterRecord::default(), Vec::new());
        Query { number, filter, shapes, parts: QueryParts::Rays(vec![ray; rays]) }
    }

    fn hit(body: u32, distance_m: f64) -> Option<RayAnswer> {
        let body = BodyId::persistent(body);
        Some(RayAnswer { body, collider: 0, point: [0.0; 3], normal: [0.0; 3], distance_m, subshape: 0 })
    }

    fn answer(number: u64, hits: Vec<Option<RayAnswer>>) -> Vec<Answer> {
        vec![Answer { client: CLIENT, number, found: QueryResult::Rays(hits) }]
    }

    #[test]
    fn the_nearest_of_all_members_answers_is_told_once_all_have_answered() {
        let (mut questions, members) = (Questions::default(), MEMBERS.into());
        questions.ask(CLIENT, question(7, 3));
        assert_eq!(questions.dispatch(Tick(1), &members).len(), 1);
        let [one, two] = MEMBERS;
        for (node, answer) in [
            (one, answer(7, vec![hit(1, 5.0), hit(2, 2.0), None])),
            // Sent again; to another query; of another kind; to no query.
            (one, answer(7, vec![None; 3])),
            (two, answer(7, vec![None; 2])),
            (two, vec![Answer { client: CLIENT, number: 7, found: QueryResult::TooMuch }]),
            (two, answer(8, vec![None; 3])),
        ] {
            questions.answered(node, answer);
            assert_eq!(questions.tell(), []);
        }
        questions.answered(two, answer(7, vec![hit(3, 4.0), hit(1, 2.0), None]));
        let found = QueryResult::Rays(vec![hit(3, 4.0), hit(1, 2.0), None]);
        assert_eq!(questions.tell(), [(CLIENT, ToClient::Answer { number: 7, found })]);
        questions.answered(two, answer(7, vec![None; 3]));
        assert_eq!(questions.tell(), []);
    }

    #[test]
    fn a_member_that_leaves_an_answer_out_keeps_nobody_waiting_for_it() {
        let (mut questions, members) = (Questions::default(), MEMBERS.into());
        let [one, two] = MEMBERS;
        for number in [7, 8] {
            questions.ask(CLIENT, question(number, 1));
            questions.dispatch(Tick(number), &members);
        }
        questions.answered(one, answer(7, vec![hit(1, 5.0)]));
        questions.done(one, Tick(7));
        questions.answered(two, vec![Answer { client: CLIENT, number: 7, found: QueryResult::TooMuch }]);
        questions.done(two, Tick(6));
        assert_eq!(questions.tell(), [], "its answer may come yet");
        questions.done(two, Tick(7));
        let found = QueryResult::Rays(vec![hit(1, 5.0)]);
        assert_eq!(questions.tell(), [(CLIENT, ToClient::Answer { number: 7, found })]);
        // Neither member has said anything of the next tick yet.
        questions.done(one, Tick(8));
        assert_eq!(questions.tell(), []);
        questions.answered(two, answer(8, vec![None]));
        let found = QueryResult::Rays(vec![None]);
        assert_eq!(questions.tell(), [(CLIENT, ToClient::Answer { number: 8, found })]);
    }

    #[test]
    fn a_question_said_again_is_asked_once_and_a_client_has_so_many_at_most() {
        let (mut questions, members) = (Questions::default(), MEMBERS.into());
        for number in 0..2 * MAX_OPEN_QUERIES as u64 {
            questions.ask(CLIENT, question(number, 1));
            questions.ask(CLIENT, question(number, 1));
        }
        questions.ask(ClientId(5), question(0, 1));
        assert_eq!(questions.dispatch(Tick(1), &members).len(), MAX_OPEN_QUERIES + 1);
        questions.ask(CLIENT, question(0, 1));
        questions.ask(CLIENT, question(1_000, 1));
        assert_eq!(questions.dispatch(Tick(1), &members), [], "they are under way");
        questions.forget(CLIENT);
        questions.ask(CLIENT, question(1_000, 1));
        assert_eq!(questions.dispatch(Tick(1), &members).len(), 1);
    }

    #[test]
    fn a_tick_takes_so_much_and_the_rest_waits() {
        let (mut questions, members) = (Questions::default(), MEMBERS.into());
        for number in 0..5 {
            questions.ask(CLIENT, question(number, MAX_COST / 2));
        }
        let counts: Vec<_> = (0..4).map(|_| questions.dispatch(Tick(1), &members).len()).collect();
        assert_eq!(counts, [2, 2, 1, 0]);
        for number in 5..20 {
            questions.ask(CLIENT, question(number, MAX_COST / 2));
        }
        let waiting: usize = questions.waiting.iter().map(|(_, question)| question.cost()).sum();
        assert_eq!(waiting + 5 * MAX_COST / 2, MAX_OPEN_COST, "those under way count too");
    }

    #[test]
    fn long_answers_are_told_one_after_the_other_and_count_until_they_are() {
        let (mut questions, members) = (Questions::default(), [MEMBERS[0]].into());
        for number in 0..4 {
            questions.ask(CLIENT, question(number, MAX_COST));
            questions.dispatch(Tick(1), &members);
            questions.answered(MEMBERS[0], answer(number, vec![hit(1, 1.0); MAX_COST]));
        }
        questions.ask(CLIENT, question(9, 1));
        assert_eq!(questions.waiting.len(), 0);
        let mut times = Vec::new();
        for tick in 0..100 {
            let told = questions.tell();
            assert!(told.len() <= 1);
            times.extend(told.iter().map(|_| tick));
            questions.allow();
        }
        assert_eq!(times.len(), 4);
        assert!(times[0] == 0 && times[3] > 12, "{times:?}");
        // Short answers are sent at once.
        for number in 9..20 {
            questions.ask(CLIENT, question(number, 1));
        }
        questions.dispatch(Tick(1), &members);
        for number in 9..20 {
            questions.answered(MEMBERS[0], answer(number, vec![hit(1, 1.0)]));
        }
        assert_eq!(questions.tell().len(), 11);
        questions.forget(CLIENT);
        assert!(questions.told.is_empty());
    }
}
