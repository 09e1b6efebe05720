//! Finds what counts of that which all survivors of a view should say alike, though one of them may lie: the dispatches of its last
//! ticks, and how the world is cut.
//!
//! The leader made both, so that its word counts while it is there. Of the others' each is checked against the rest: what the leader
//! sent to all must be known to most. Inputs went to the members that hold the avatar alone, and count by one member's word.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};

use crate::protocol::{Dispatch, View, WorldOp, encode_value};
use crate::space::{Allocation, DistributionTree, NodeId, Tick};

/// A tree, and which member computes each region.
pub(super) type Division = (DistributionTree, Allocation);

/// For how many ticks members may have gone on while the server heard nothing of their leader: it may have been down for months.
const UNHEARD_TICKS: u64 = 1 << 32;

/// Returns the dispatches of a view that its survivors are to complete, in order, and how many of those that were named do not count.
/// `heard` is the tick up to which the server has heard of the world.
pub(super) fn dispatches(
    view: &View,
    heard: Tick,
    named: &BTreeMap<NodeId, Vec<Dispatch>>,
) -> (Vec<Dispatch>, u64) {
    let led = named.get(&view.leader);
    let newest = led.map(|own| own.last().map_or(view.tick, |last| last.tick));
    let mut refused = 0;
    let mut by_tick: BTreeMap<Tick, Vec<(NodeId, &Dispatch)>> = BTreeMap::new();
    for (&node, dispatch) in named.iter().flat_map(|(node, own)| own.iter().map(move |one| (node, one))) {
        let can_be = dispatch.view == view.number
            && dispatch.tick > view.tick
            && dispatch.tick <= newest.unwrap_or(Tick(heard.0.saturating_add(UNHEARD_TICKS)));
        match can_be {
            true => by_tick.entry(dispatch.tick).or_default().push((node, dispatch)),
            false => refused += 1,
        }
    }
    // Survivors are at most so far apart that what they name follows on; without the leader that of most of them counts, of equals what is
    // nearest to the tick that was heard of.
    if led.is_none() {
        let mut runs: Vec<BTreeMap<Tick, Vec<(NodeId, &Dispatch)>>> = Vec::new();
        for (tick, of) in std::mem::take(&mut by_tick) {
            match runs.last_mut() {
                Some(run) if run.last_key_value().is_some_and(|(last, _)| last.next() == tick) => {
                    run.insert(tick, of);
                }
                _ => runs.push([(tick, of)].into()),
            }
        }
        let size = |run: &BTreeMap<_, Vec<(NodeId, _)>>| {
            run.values().flatten().map(|(node, _)| *node).collect::<BTreeSet<_>>().len()
        };
        let all: usize = runs.iter().flat_map(BTreeMap::values).map(Vec::len).sum();
        let away = |run: &BTreeMap<Tick, _>| {
            run.last_key_value().map_or(u64::MAX, |(last, _)| last.0.abs_diff(heard.0))
        };
        let best = runs.into_iter().rev().max_by_key(|run| (size(run), Reverse(away(run))));
        by_tick = best.unwrap_or_default();
        refused += (all - by_tick.values().map(Vec::len).sum::<usize>()) as u64;
    }
    let counts = |of: Vec<(NodeId, &Dispatch)>| match of.iter().find(|(node, _)| *node == view.leader) {
        Some((_, own)) => (*own).clone(),
        None => merged(&of.into_iter().map(|(_, one)| one).collect::<Vec<_>>()),
    };
    (by_tick.into_values().map(counts).collect(), refused)
}

/// Returns one dispatch of what several members were sent of it.
fn merged(parts: &[&Dispatch]) -> Dispatch {
    let mut known: BTreeMap<Vec<u8>, usize> = BTreeMap::new();
    for part in parts {
        let own: BTreeSet<_> = part.ops.iter().map(encode_value).collect();
        own.into_iter().for_each(|op| *known.entry(op).or_default() += 1);
    }
    let counts = |op: &WorldOp| match op {
        // All of it concerns somebody.
        WorldOp::Input(input) if input.body.client().is_some() => true,
        op => 2 * known[&encode_value(op)] > parts.len(),
    };
    let mut listed = BTreeSet::new();
    let mut ops: Vec<WorldOp> = Vec::new();
    for part in parts {
        // What a leader dispatched twice happens twice.
        let new = part.ops.iter().filter(|op| counts(op) && !listed.contains(&encode_value(*op)));
        let new: Vec<_> = new.cloned().collect();
        listed.extend(new.iter().map(encode_value));
        ops.extend(new);
    }
    let rounds = most_common(parts.iter().map(|part| &part.rounds)).copied();
    Dispatch { ops, rounds: rounds.unwrap_or(1), ..*parts[0] }
}

/// Returns how the survivors of a view have the world cut after their last tick.
pub(super) fn division(view: &View, said: &BTreeMap<NodeId, Option<Division>>) -> Option<Division> {
    let is_member = |node: &NodeId| view.members.iter().any(|member| member.node == *node);
    let can_be = |(tree, allocation): &&Division| {
        tree.bounds() == view.tree.bounds() && allocation.values().all(is_member)
    };
    let led = said.get(&view.leader).and_then(Option::as_ref).filter(can_be);
    led.or_else(|| most_common(said.values().flatten().filter(can_be))).cloned()
}

/// Returns what is there most often; of equals the first.
fn most_common<'a, T: PartialEq>(all: impl Iterator<Item = &'a T>) -> Option<&'a T> {
    let mut counts: Vec<(&T, usize)> = Vec::new();
    for one in all {
        match counts.iter_mut().find(|(known, _)| *known == one) {
            Some((_, count)) => *count += 1,
            None => counts.push((one, 1)),
        }
    }
    let first_of_most = counts.iter().rev().max_by_key(|(_, count)| *count);
    first_of_most.map(|(one, _)| *one)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::{Input, Member, Velocity, ViewNumber};
    use crate::sim::{sim_body, sim_world};
    use crate::space::{BodyId, ClientId, GroupId, RegionId};

    const ONE: NodeId = NodeId(1);
    const TWO: NodeId = NodeId(2);
    const THREE: NodeId = NodeId(3);

    /// A view of three members, led by the first, after tick 7.
    fn view() -> View {
        let member = |node| Member { node, address: ([127, 0, 0, 1], 1).into(), client: None };
        View {
            group: GroupId(1),
            number: ViewNumber(4),
            tick: Tick(7),
            leader: ONE,
            members: [ONE, TWO, THREE].map(member).into(),
            tree: sim_world(2).tree,
            allocation: [(RegionId(1), ONE), (RegionId(2), TWO)].into(),
            events: false,
        }
    }

    fn dispatch(tick: u64, ops: Vec<WorldOp>) -> Dispatch {
        Dispatch { view: ViewNumber(4), tick: Tick(tick), rounds: 1, ops }
    }

    fn remove(index: u32) -> WorldOp {
        WorldOp::Remove(BodyId::persistent(index))
    }

    fn input(client: u32) -> WorldOp {
        let (velocity, body) = (Velocity::default(), BodyId::avatar(ClientId(client), 0));
        WorldOp::Input(Input { body, logical_time: 1, tick: Tick(0), velocity, pose: None, drive: None })
    }

    #[test]
    fn what_a_member_says_was_dispatched_counts_for_nothing_beside_the_leaders_word() {
        let own = vec![dispatch(8, vec![remove(1)])];
        let forged = vec![dispatch(8, vec![remove(2), input(1)]), dispatch(9, vec![remove(3)])];
        let later = vec![dispatch(1 << 40, Vec::new())];
        let named = [(ONE, own.clone()), (TWO, forged), (THREE, later)].into();
        assert_eq!(dispatches(&view(), Tick(7), &named), (own, 2));
    }

    #[test]
    fn without_the_leader_one_member_does_not_say_that_ticks_have_passed_which_nobody_knows() {
        let empty =
            |ticks: &[u64]| -> Vec<_> { ticks.iter().map(|&tick| dispatch(tick, Vec::new())).collect() };
        let counted = |named: &[(NodeId, Vec<Dispatch>)]| {
            let (counted, refused) = dispatches(&view(), Tick(20), &named.iter().cloned().collect());
            (counted.iter().map(|one| one.tick.0).collect::<Vec<_>>(), refused)
        };
        let liar = NodeId(4);
        assert_eq!(counted(&[(TWO, empty(&[20])), (THREE, empty(&[1 << 20]))]), (vec![20], 1));
        assert_eq!(counted(&[(THREE, empty(&[20, 1 << 20]))]), (vec![20], 1));
        let honest = [(TWO, empty(&[20, 21])), (THREE, empty(&[21, 22]))];
        for lie in [empty(&[8]), empty(&[1 << 20])] {
            let named = [honest.clone().into(), vec![(liar, lie)]].concat();
            assert_eq!(counted(&named), (vec![20, 21, 22], 1));
        }
        assert_eq!(counted(&[(THREE, empty(&[1 << 53]))]), (vec![], 1), "the world could not go on");
        assert_eq!(
            counted(&[(THREE, empty(&[1 << 30]))]),
            (vec![1 << 30], 0),
            "the server may have been away"
        );
    }

    #[test]
    fn without_the_leader_what_it_sent_to_all_counts_if_most_know_it_and_inputs_if_one_does() {
        let honest = |client| vec![dispatch(8, vec![remove(1), remove(1), input(client)])];
        let insert = WorldOp::Insert {
            bodies: vec![sim_body(BodyId::persistent(9), [1.0; 3])],
            shapes: Vec::new(),
            joints: Vec::new(),
        };
        let forged = vec![dispatch(8, vec![insert, remove(2)])];
        let named = [(TWO, honest(1)), (THREE, honest(2)), (NodeId(4), forged)].into();
        let (counted, refused) = dispatches(&view(), Tick(7), &named);
        assert_eq!(counted, [dispatch(8, vec![remove(1), remove(1), input(1), input(2)])]);
        assert_eq!(refused, 0);
    }

    #[test]
    fn a_dispatch_of_another_view_or_of_a_tick_before_this_one_is_refused() {
        let other = Dispatch { view: ViewNumber(3), ..dispatch(8, Vec::new()) };
        let named = [(TWO, vec![dispatch(7, Vec::new()), other])].into();
        assert_eq!(dispatches(&view(), Tick(7), &named), (Vec::new(), 2));
    }

    #[test]
    fn the_world_is_cut_as_its_leader_says_or_else_as_most_say_and_only_among_members() {
        let view = view();
        let truth = Some((view.tree.clone(), view.allocation.clone()));
        let of = |node| view.tree.leaves().map(|region| (region, node)).collect::<Allocation>();
        let lie = Some((view.tree.clone(), of(THREE)));
        let strangers = Some((view.tree.clone(), of(NodeId(77))));
        let said = |words: [&Option<Division>; 3]| {
            division(&view, &[ONE, TWO, THREE].into_iter().zip(words.map(Clone::clone)).collect())
        };
        assert_eq!(said([&truth, &lie, &lie]), truth, "the leader's word");
        assert_eq!(said([&None, &truth, &lie]), truth, "of equals the first");
        assert_eq!(said([&strangers, &lie, &lie]), lie);
        assert_eq!(said([&None, &strangers, &strangers]), None);
    }
}
