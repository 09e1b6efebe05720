//! Decides whose word counts where all survivors of a view should say the same, though one of them may lie:
//! about the dispatches of the last ticks, the tree and the allocation.
//!
//! The leader made these, so its word counts while it is there. Without it, each survivor's word is checked
//! against the others':
//!
//! - **Operations for all members** must be known to most.
//! - **Inputs** went only to the members that hold the avatar, and count by one member's word.
//! - **The last tick.** A leader that dies may have told only a few of a tick. The tick is completed, but
//!   without the operations on the whole world that only participants know of.
//! - **Participants astray.** Where such operations decide who exchanges with whom, participants that began
//!   the tick with them cannot complete it with the others, and begin anew.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};

use crate::cluster::state_replication::TELL_TICK;
use crate::fidelity::Schedule;
use crate::protocol::{Dispatch, Input, View, WorldOp, encode_value};
use crate::space::{Allocation, DistributionTree, NodeId, Tick};

/// A tree, and which member computes each region.
pub(super) type Division = (DistributionTree, Allocation);

/// For how many ticks members may have gone on while the server heard nothing of their leader. The server may
/// have been down for months.
const UNHEARD_TICKS: u64 = 1 << 32;

/// Returns the dispatches of a view that its survivors are to complete, in order, and how many of the `named`
/// ones do not count. `heard` is the tick up to which the server has heard of the world, and `lag` is how
/// many ticks members may be apart.
pub(super) fn dispatches(
    view: &View,
    heard: Tick,
    lag: u64,
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
    // Survivors are at most so far apart that the ticks they name form one run. Without the leader, the run
    // of most survivors counts. Among equals the later run counts, if the leader may have come that far
    // unheard. Otherwise the run that is nearest to the tick that the server heard of counts.
    if led.is_none() {
        let least = Tick(heard.0.saturating_sub(lag + 1));
        let may_be = least..=Tick(heard.0.saturating_add(2 * (TELL_TICK + lag)));
        // A member that names nothing has heard of no tick of this view, unless it began anew or lies. It
        // counts only near the view's own tick: no member is farther behind the leader.
        let silent = named.values().filter(|own| own.is_empty() && view.tick >= least).count();
        if silent > 0 {
            by_tick.entry(view.tick).or_default();
        }
        let mut runs: Vec<BTreeMap<Tick, Vec<(NodeId, &Dispatch)>>> = Vec::new();
        for (tick, of) in std::mem::take(&mut by_tick) {
            match runs.last_mut() {
                Some(run) if run.last_key_value().is_some_and(|(last, _)| last.next() == tick) => {
                    run.insert(tick, of);
                }
                _ => runs.push([(tick, of)].into()),
            }
        }
        let all: usize = runs.iter().flat_map(BTreeMap::values).map(Vec::len).sum();
        let rank = |run: &BTreeMap<Tick, Vec<(NodeId, &Dispatch)>>| {
            let last = run.last_key_value().map_or(view.tick, |(last, _)| *last);
            let size = ends(run, view.tick, silent).len();
            (size, Some(last).filter(|last| may_be.contains(last)), Reverse(last.0.abs_diff(heard.0)))
        };
        let best = runs.into_iter().rev().max_by_key(rank);
        by_tick = best.unwrap_or_default();
        // A leader opens no tick before all have done those of which it may be ahead, so nobody knows of
        // later ones.
        let ends = ends(&by_tick, view.tick, silent);
        if let Some(end) = ends.get(ends.len().saturating_sub(1) / 2) {
            by_tick.retain(|tick, _| tick.0 <= end.0 + lag + 1);
        }
        by_tick.remove(&view.tick);
        refused += (all - by_tick.values().map(Vec::len).sum::<usize>()) as u64;
    }
    let is_dedicated = |node| view.members.iter().any(|one| one.node == node && one.client.is_none());
    let counts = |of: Vec<(NodeId, &Dispatch)>| match of.iter().find(|(node, _)| *node == view.leader) {
        Some((_, own)) => (*own).clone(),
        None => {
            let is_sure = 2 * of.len() > named.len() || of.iter().any(|(node, _)| is_dedicated(*node));
            let schedule = schedule_of(&of, is_dedicated).cloned();
            let mut one = merged(&of.into_iter().map(|(_, one)| one).collect::<Vec<_>>());
            one.ops.retain(|op| op.schedule().is_none());
            one.ops.extend(schedule.map(WorldOp::Schedule));
            // Whatever else a leader did is on record, or is lost as if the leader had died a moment before.
            one.ops.retain(|op| is_sure || is_for_some(op) || matches!(op, WorldOp::Ask { .. }));
            one
        }
    };
    (by_tick.into_values().map(counts).collect(), refused)
}

/// Returns the members that have begun a tick otherwise than these dispatches say, where all regions meet in
/// the tick, some stay behind, or the tree changes. The leader told them alone, and each would wait in that
/// tick for what the others never send.
pub(super) fn astray(
    view: &View,
    lag: u64,
    named: &BTreeMap<NodeId, Vec<Dispatch>>,
    counted: &[Dispatch],
) -> BTreeSet<NodeId> {
    let Some(end) = counted.last().filter(|_| !named.contains_key(&view.leader)) else {
        return BTreeSet::new();
    };
    // Where members may be ticks apart, all regions meet in every tick. Such a member goes on with the
    // others.
    let meets = |op: &&WorldOp| op.repartition().is_some() || lag == 0 && op.concerns_all();
    let schedule = |one: &Dispatch| one.ops.iter().find_map(WorldOp::schedule).cloned();
    let differs = |own: &Dispatch| {
        // All members have done older ticks, and some no longer name them.
        let one = counted.iter().find(|one| one.tick == own.tick && one.tick.0 + lag + 1 > end.tick.0);
        own.view == view.number
            && one.is_some_and(|one| {
                own.ops.iter().filter(meets).any(|op| !one.ops.contains(op)) || schedule(own) != schedule(one)
            })
    };
    // A dedicated node is never astray: otherwise another member that says what the leader told might have it
    // sent away.
    let plays = |node| view.members.iter().any(|one| one.node == node && one.client.is_some());
    let is_astray = |(node, own): &(&NodeId, &Vec<Dispatch>)| plays(**node) && own.iter().any(differs);
    named.iter().filter(is_astray).map(|(&node, _)| node).collect()
}

/// Returns which regions stay behind in a tick, as most of the dedicated nodes among these members say, or
/// most of all if none is dedicated. All have begun the tick as they say, and dedicated nodes never begin
/// anew.
fn schedule_of<'a>(
    of: &[(NodeId, &'a Dispatch)],
    is_dedicated: impl Fn(NodeId) -> bool,
) -> Option<&'a Schedule> {
    let said = |dedicated: bool| {
        let those = of.iter().filter(|(node, _)| !dedicated || is_dedicated(*node));
        those.map(|(_, one)| one.ops.iter().find_map(WorldOp::schedule)).collect::<Vec<_>>()
    };
    let [dedicated, all] = [said(true), said(false)];
    most_common(if dedicated.is_empty() { all.iter() } else { dedicated.iter() }).copied().flatten()
}

/// Returns the newest tick of this run that each member names, in order. `silent` members are at the view's
/// own tick, `first`.
fn ends(run: &BTreeMap<Tick, Vec<(NodeId, &Dispatch)>>, first: Tick, silent: usize) -> Vec<Tick> {
    let named = run.iter().flat_map(|(&tick, of)| of.iter().map(move |(node, _)| (*node, tick)));
    let newest: BTreeMap<NodeId, Tick> = named.collect();
    let silent = if run.contains_key(&first) { silent } else { 0 };
    let mut ends: Vec<_> = newest.into_values().chain(std::iter::repeat_n(first, silent)).collect();
    ends.sort_unstable();
    ends
}

/// Returns whether a leader tells an operation only to the members that it concerns: an avatar's input
/// without a jump.
fn is_for_some(op: &WorldOp) -> bool {
    matches!(op, WorldOp::Input(Input { body, pose: None, .. }) if body.client().is_some())
}

/// Merges what several members were sent of one dispatch.
fn merged(parts: &[&Dispatch]) -> Dispatch {
    let mut known: BTreeMap<Vec<u8>, usize> = BTreeMap::new();
    for part in parts {
        let own: BTreeSet<_> = part.ops.iter().map(encode_value).collect();
        own.into_iter().for_each(|op| *known.entry(op).or_default() += 1);
    }
    let counts = |op: &WorldOp| match op {
        op if is_for_some(op) => true,
        op => 2 * known[&encode_value(op)] > parts.len(),
    };
    let mut listed = BTreeSet::new();
    let mut ops: Vec<WorldOp> = Vec::new();
    for part in parts {
        // An operation that a leader dispatched twice happens twice.
        let new = part.ops.iter().filter(|op| counts(op) && !listed.contains(&encode_value(*op)));
        let new: Vec<_> = new.cloned().collect();
        listed.extend(new.iter().map(encode_value));
        ops.extend(new);
    }
    let rounds = most_common(parts.iter().map(|part| &part.rounds)).copied();
    Dispatch { ops, rounds: rounds.unwrap_or(1), ..*parts[0] }
}

/// Returns the tree and the allocation that the survivors of a view have after their last tick.
pub(super) fn division(view: &View, said: &BTreeMap<NodeId, Option<Division>>) -> Option<Division> {
    let is_member = |node: &NodeId| view.members.iter().any(|member| member.node == *node);
    let can_be = |(tree, allocation): &&Division| {
        tree.bounds() == view.tree.bounds() && allocation.values().all(is_member)
    };
    let led = said.get(&view.leader).and_then(Option::as_ref).filter(can_be);
    led.or_else(|| most_common(said.values().flatten().filter(can_be))).cloned()
}

/// Returns the most frequent item; among equals the first.
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
    use crate::protocol::{Input, Member, Repartition, Velocity, ViewNumber};
    use crate::sim::{sim_body, sim_world};
    use crate::space::{BodyId, ClientId, GroupId, RegionId};

    const ONE: NodeId = NodeId(1);
    const TWO: NodeId = NodeId(2);
    const THREE: NodeId = NodeId(3);

    /// Returns a view of three members, led by the first, after tick 7.
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
            viewpoints: Vec::new(),
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
        assert_eq!(dispatches(&view(), Tick(7), 0, &named), (own, 2));
    }

    #[test]
    fn without_the_leader_one_member_does_not_say_that_ticks_have_passed_which_nobody_knows() {
        let empty =
            |ticks: &[u64]| -> Vec<_> { ticks.iter().map(|&tick| dispatch(tick, Vec::new())).collect() };
        let counted = |named: &[(NodeId, Vec<Dispatch>)]| {
            let (counted, refused) = dispatches(&view(), Tick(20), 0, &named.iter().cloned().collect());
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

    fn ticks_of(heard: u64, lag: u64, named: &[(NodeId, &[u64])]) -> Vec<u64> {
        let own = |ticks: &[u64]| ticks.iter().map(|&tick| dispatch(tick, Vec::new())).collect();
        let named = named.iter().map(|&(node, ticks)| (node, own(ticks))).collect();
        dispatches(&view(), Tick(heard), lag, &named).0.iter().map(|one| one.tick.0).collect()
    }

    #[test]
    fn who_has_heard_of_no_tick_counts_as_well() {
        let liar = NodeId(4);
        assert!(ticks_of(7, 0, &[(TWO, &[]), (THREE, &[]), (liar, &[1 << 31])]).is_empty());
        assert!(ticks_of(7, 0, &[(TWO, &[]), (liar, &[1 << 31])]).is_empty(), "what may be counts");
        assert_eq!(ticks_of(7, 0, &[(TWO, &[]), (THREE, &[8])]), [8]);
        assert_eq!(ticks_of(7, 6, &[(TWO, &[]), (THREE, &[8, 9, 10, 11, 12, 13, 14])]).last(), Some(&14));
    }

    #[test]
    fn who_began_anew_does_not_take_the_world_back() {
        assert_eq!(ticks_of(480, 0, &[(TWO, &[]), (THREE, &[]), (NodeId(4), &[500])]), [500]);
    }

    #[test]
    fn no_tick_is_done_that_a_leader_could_not_have_opened() {
        let liar = NodeId(4);
        assert_eq!(ticks_of(20, 0, &[(TWO, &[20]), (THREE, &[20]), (liar, &[20, 21, 22, 23])]), [20, 21]);
        assert_eq!(ticks_of(20, 0, &[(TWO, &[20]), (liar, &[20, 21, 22, 23])]), [20, 21]);
        assert_eq!(
            ticks_of(20, 0, &[(TWO, &[20, 21]), (THREE, &[21, 22]), (liar, &[19, 20])]),
            [19, 20, 21, 22]
        );
        let (honest, lie): (Vec<u64>, Vec<u64>) = ((20..=26).collect(), (20..=47).collect());
        assert_eq!(ticks_of(20, 6, &[(TWO, &honest), (THREE, &honest), (liar, &lie)]).last(), Some(&33));
    }

    #[test]
    fn the_world_does_not_go_back_for_one_of_two() {
        let liar = NodeId(4);
        // The server last heard of tick 10: the leader told it nothing later before it died.
        assert_eq!(ticks_of(10, 0, &[(TWO, &[20, 21]), (liar, &[10])]), [20, 21]);
        assert_eq!(ticks_of(10, 0, &[(TWO, &[20, 21]), (liar, &[])]), [20, 21]);
        assert_eq!(ticks_of(10, 0, &[(TWO, &[20, 21]), (liar, &[1 << 20])]), [20, 21]);
    }

    #[test]
    fn what_participants_alone_say_was_done_to_all_is_not_done() {
        let jump = |body| {
            let velocity = Velocity::default();
            let pose = Some(crate::protocol::WorldPose::at([9.0; 3]));
            WorldOp::Input(Input { body, logical_time: 1, tick: Tick(0), velocity, pose, drive: None })
        };
        let others = [jump(BodyId::persistent(1)), jump(BodyId::avatar(ClientId(2), 0)), remove(1)];
        let ops = [others.to_vec(), vec![input(1)]].concat();
        let named = [
            (TWO, vec![dispatch(8, Vec::new())]),
            (THREE, vec![dispatch(8, others.to_vec()), dispatch(9, ops.clone())]),
        ];
        let of_nine = |view: &View, named: &[(NodeId, Vec<Dispatch>)]| {
            let (counted, _) = dispatches(view, Tick(8), 0, &named.iter().cloned().collect());
            assert_eq!(counted[0].ops, [], "of two, most are both");
            counted[1].ops.clone()
        };
        let mut view = view();
        assert_eq!(of_nine(&view, &named), ops, "a dedicated node may have been the last one to be told");
        view.members[2].client = Some(ClientId(1));
        assert_eq!(of_nine(&view, &named), [input(1)]);
        let both = named.clone().map(|(node, own)| match node {
            TWO => (node, vec![own[0].clone(), dispatch(9, ops.clone())]),
            _ => (node, own),
        });
        assert_eq!(of_nine(&view, &both), ops, "most know of it");
    }

    #[test]
    fn who_was_told_alone_that_all_regions_meet_or_are_cut_otherwise_is_astray() {
        let mut view = view();
        view.members[2].client = Some(ClientId(1));
        let jump = WorldOp::Input(Input {
            body: BodyId::persistent(1),
            logical_time: 0,
            tick: Tick(0),
            velocity: Velocity::default(),
            pose: Some(crate::protocol::WorldPose::at([9.0; 3])),
            drive: None,
        });
        let cut = WorldOp::Repartition(Repartition { changes: Vec::new(), newborn: TWO });
        let of = |named: &[(NodeId, Vec<Dispatch>)]| {
            let named = named.iter().cloned().collect();
            let (counted, _) = dispatches(&view, Tick(8), 0, &named);
            astray(&view, 0, &named, &counted)
        };
        let before = || vec![dispatch(8, vec![remove(1)])];
        for op in [jump, cut] {
            let alone = [before(), vec![dispatch(9, vec![op.clone()])]].concat();
            assert_eq!(of(&[(TWO, before()), (THREE, alone.clone())]), [THREE].into());
            assert_eq!(
                of(&[(TWO, alone.clone()), (THREE, before())]),
                [].into(),
                "a dedicated node's word counts"
            );
            assert_eq!(of(&[(TWO, alone[1..].to_vec()), (THREE, alone.clone())]), [].into(), "both know it");
            let shorter = [before(), vec![dispatch(9, Vec::new())]].concat();
            assert_eq!(of(&[(TWO, alone.clone()), (THREE, shorter)]), [].into(), "nor is it sent away");
            assert_eq!(
                of(&[(ONE, before()), (TWO, before()), (THREE, alone)]),
                [].into(),
                "the leader is there"
            );
            // All have done the tick before; one member alone still names it.
            let late = [vec![dispatch(8, vec![op])], vec![dispatch(9, Vec::new())]].concat();
            assert_eq!(of(&[(TWO, late[1..].to_vec()), (THREE, late)]), [].into());
        }
        // Where members are up to two ticks apart, one of them may have done none of the last three.
        let cut = WorldOp::Repartition(Repartition { changes: Vec::new(), newborn: TWO });
        let ticks = |ops| [dispatch(8, ops), dispatch(9, Vec::new()), dispatch(10, Vec::new())].to_vec();
        let named = [(TWO, ticks(Vec::new())), (THREE, ticks(vec![cut]))].into();
        let (counted, _) = dispatches(&view, Tick(8), 2, &named);
        assert_eq!(
            (astray(&view, 2, &named, &counted), astray(&view, 1, &named, &counted)),
            ([THREE].into(), [].into())
        );
        let harmless = vec![dispatch(8, Vec::new()), dispatch(9, vec![remove(1), input(1)])];
        assert_eq!(
            of(&[(TWO, vec![dispatch(8, Vec::new())]), (THREE, harmless)]),
            [].into(),
            "it goes on with them"
        );
    }

    #[test]
    fn which_regions_stay_behind_is_what_those_say_that_are_no_participants() {
        let mut view = view();
        view.members[2].client = Some(ClientId(1));
        let stays =
            |region| WorldOp::Schedule(Schedule { behind: vec![RegionId(region)], ..Schedule::default() });
        let tick = |ops| vec![dispatch(8, ops)];
        let of = |named: &[(NodeId, Vec<Dispatch>)]| {
            let named = named.iter().cloned().collect();
            let (counted, _) = dispatches(&view, Tick(7), 0, &named);
            (counted[0].ops.clone(), astray(&view, 0, &named, &counted))
        };
        let (true_one, lie) = (tick(vec![stays(1)]), tick(vec![stays(2)]));
        for said in [lie, tick(Vec::new()), tick(vec![remove(1)])] {
            let (ops, astray) = of(&[(TWO, true_one.clone()), (THREE, said)]);
            assert_eq!((ops, astray), (vec![stays(1)], [THREE].into()), "it has begun otherwise, or lies");
        }
        assert_eq!(of(&[(TWO, tick(Vec::new())), (THREE, true_one.clone())]), (vec![], [THREE].into()));
        assert_eq!(of(&[(TWO, true_one.clone()), (THREE, true_one)]), (vec![stays(1)], [].into()));
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
        let (counted, refused) = dispatches(&view(), Tick(7), 0, &named);
        assert_eq!(counted, [dispatch(8, vec![remove(1), remove(1), input(1), input(2)])]);
        assert_eq!(refused, 0);
    }

    #[test]
    fn a_dispatch_of_another_view_or_of_a_tick_before_this_one_is_refused() {
        let other = Dispatch { view: ViewNumber(3), ..dispatch(8, Vec::new()) };
        let named = [(TWO, vec![dispatch(7, Vec::new()), other])].into();
        assert_eq!(dispatches(&view(), Tick(7), 0, &named), (Vec::new(), 2));
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
