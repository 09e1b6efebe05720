//! Plans paces that keep a budget of time, by how long the longest tick will take. Groups of regions that are
//! stepped in the same ticks have one pace.

use super::schedule::{COARSEST, Pace, relative_time};

/// The number of solver iterations for which shares of the time are estimated.
const ITERATIONS: usize = 4;

/// The part of the goal that a new plan fills, so that it holds until steps take notably longer.
const FILLED: f64 = 0.85;
/// A plan stands unless another one computes at least this many times as much, and turns stay unless the
/// longest tick takes this many times as long as it must.
const WORTH_CHANGING: f64 = 1.1;

/// A group of regions that must be at one time, as far as one process computes it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Load {
    /// Says whether somebody looks at one of its regions.
    pub watched: bool,
    /// Says whether it must be stepped in every tick.
    pub urgent: bool,
    /// The distance of the nearest viewpoint from the group, metres.
    pub far_m: f64,
    /// The time that a step of one tick takes in full, milliseconds.
    pub step_ms: f64,
    /// The pace that it has now.
    pub pace: Pace,
}

/// The paces of all groups.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Plan {
    pub paces: Vec<Pace>,
    /// Says whether no tick is expected to take longer than it may.
    pub is_kept: bool,
}

/// The rates to which groups are made coarser in turn: first those that nobody looks at, then those that are
/// looked at.
const RATES: [u8; 2] = [2, COARSEST];

/// Returns the finest paces with which no tick takes longer than `goal_ms`. If there are none, returns those
/// with which ticks take no longer on average, if that is possible. The farthest groups are made coarser
/// first. The present paces stay while they serve, since a group whose turn changes is stepped once more.
pub(super) fn plan(loads: &[Load], goal_ms: f64) -> Plan {
    let present: Vec<_> = loads.iter().map(|load| if load.urgent { 1 } else { load.pace.rate }).collect();
    let serves = |takes_ms: f64, rates: &[u8]| {
        let is_coarser = |group: usize| loads[group].watched && present[group] > rates[group];
        takes_ms <= goal_ms
            && computed(loads, rates) < WORTH_CHANGING * computed(loads, &present)
            && !(0..loads.len()).any(is_coarser)
    };
    if let Some(rates) = within(loads, FILLED * goal_ms).or_else(|| within(loads, goal_ms)) {
        let stays = deal(loads, &present, |_| true);
        if serves(stays.longest_ms(), &rates) {
            return Plan { paces: stays.paces(&present), is_kept: true };
        }
        return Plan { paces: in_turn(loads, &rates, &present, goal_ms), is_kept: true };
    }
    let moves = moves(loads, |_, _| true);
    let rates = rates_after(loads, &moves[..fewest(loads, &moves, goal_ms)]);
    let rates = if serves(mean_ms(loads, &present), &rates) { present.clone() } else { rates };
    Plan { paces: in_turn(loads, &rates, &present, f64::INFINITY), is_kept: false }
}

/// Returns the finest rates with which no tick takes longer than `goal_ms`, if there are any.
fn within(loads: &[Load], goal_ms: f64) -> Option<Vec<u8>> {
    // A group does not become coarser if one of its steps would then take longer than the goal.
    let moves = moves(loads, |load, rate| step_ms(load, rate) <= goal_ms);
    // No tick is longer than the goal only if the mean is not. Fewer ticks are not always shorter.
    let mut rates =
        (fewest(loads, &moves, goal_ms)..=moves.len()).map(|count| rates_after(loads, &moves[..count]));
    rates.find(|rates| deal(loads, rates, |_| false).longest_ms() <= goal_ms)
}

/// Returns paces with these rates. Groups that had theirs before keep their turns, unless ticks would then take
/// longer than `most_ms`, or notably longer than if all turns were dealt out anew.
fn in_turn(loads: &[Load], rates: &[u8], present: &[u8], most_ms: f64) -> Vec<Pace> {
    let kept = deal(loads, rates, |group| rates[group] == present[group]);
    let anew = deal(loads, rates, |_| false);
    let keeps = kept.longest_ms() <= most_ms.min(WORTH_CHANGING * anew.longest_ms());
    if keeps { kept.paces(rates) } else { anew.paces(rates) }
}

/// Returns the groups that may become coarser, with the rates to which they do, in order.
fn moves(loads: &[Load], fits: impl Fn(&Load, u8) -> bool) -> Vec<(usize, u8)> {
    let mut order: Vec<_> = (0..loads.len()).filter(|&group| !loads[group].urgent).collect();
    order.sort_by(|&a, &b| loads[b].far_m.total_cmp(&loads[a].far_m).then(a.cmp(&b)));
    let mut moves = Vec::new();
    for watched in [false, true] {
        for rate in RATES {
            let coarser = order.iter().filter(|&&group| loads[group].watched == watched);
            moves.extend(coarser.filter(|&&group| fits(&loads[group], rate)).map(|&group| (group, rate)));
        }
    }
    moves
}

fn rates_after(loads: &[Load], moves: &[(usize, u8)]) -> Vec<u8> {
    let mut rates = vec![1; loads.len()];
    moves.iter().for_each(|&(group, rate)| rates[group] = rate);
    rates
}

/// Returns how many of the moves it takes until ticks take no longer than the goal on average; all if they
/// always do. Each move makes the mean less.
fn fewest(loads: &[Load], moves: &[(usize, u8)], goal_ms: f64) -> usize {
    let (mut least, mut most) = (0, moves.len());
    while least < most {
        let middle = (least + most) / 2;
        if mean_ms(loads, &rates_after(loads, &moves[..middle])) <= goal_ms {
            most = middle;
        } else {
            least = middle + 1;
        }
    }
    least
}

/// Returns the time of one step of a group at a rate, milliseconds.
fn step_ms(load: &Load, rate: u8) -> f64 {
    load.step_ms * relative_time(ITERATIONS, rate)
}

fn mean_ms(loads: &[Load], rates: &[u8]) -> f64 {
    loads.iter().zip(rates).map(|(load, &rate)| step_ms(load, rate) / f64::from(rate)).sum()
}

/// Returns how much is computed per tick: how long that would take if longer steps took no longer.
fn computed(loads: &[Load], rates: &[u8]) -> f64 {
    loads.iter().zip(rates).map(|(load, &rate)| load.step_ms / f64::from(rate)).sum()
}

/// The ticks in which groups are stepped.
struct Deal {
    turns: Vec<u8>,
    /// The time that each tick of a cycle takes, milliseconds.
    ticks_ms: [f64; COARSEST as usize],
}

impl Deal {
    fn longest_ms(&self) -> f64 {
        self.ticks_ms.into_iter().fold(0.0, f64::max)
    }

    fn paces(self, rates: &[u8]) -> Vec<Pace> {
        self.turns.into_iter().zip(rates).map(|(turn, &rate)| Pace { rate, turn }).collect()
    }
}

/// Deals groups out to the ticks in which they are stepped: those that keep their turns first, then the
/// others, the longest steps first, each to the ticks with least to do (Graham 1969).
fn deal(loads: &[Load], rates: &[u8], keeps: impl Fn(usize) -> bool) -> Deal {
    let mut dealt = Deal { turns: vec![0; loads.len()], ticks_ms: [0.0; COARSEST as usize] };
    let step_ms = |group: usize| step_ms(&loads[group], rates[group]);
    let mut order: Vec<_> = (0..loads.len()).collect();
    order.sort_by(|&a, &b| keeps(b).cmp(&keeps(a)).then(step_ms(b).total_cmp(&step_ms(a))).then(a.cmp(&b)));
    for group in order {
        let rate = rates[group];
        let of = |turn: u8| (turn..COARSEST).step_by(rate.into()).map(usize::from);
        let longest_ms = |turn: &u8| of(*turn).map(|tick| dealt.ticks_ms[tick]).fold(0.0, f64::max);
        let least = (0..rate).min_by(|a, b| longest_ms(a).total_cmp(&longest_ms(b)));
        let turn = match keeps(group) {
            true => loads[group].pace.turn % rate,
            false => least.expect("rates are above 0"),
        };
        of(turn).for_each(|tick| dealt.ticks_ms[tick] += step_ms(group));
        dealt.turns[group] = turn;
    }
    dealt
}
