//! Plans paces that keep a budget of time, by how long the longest tick will take. Groups of regions that are
//! stepped in the same ticks have one pace.

use super::schedule::{COARSEST, Pace, relative_time};

/// The number of solver iterations for which shares of the time are estimated.
const ITERATIONS: usize = 4;

/// A group of regions that must be at one time, as far as one process computes it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Load {
    /// Says whether somebody looks at one of its regions.
    pub watched: bool,
    /// The distance of the nearest viewpoint from the group, metres.
    pub far_m: f64,
    /// The time that a step of one tick takes in full, milliseconds.
    pub step_ms: f64,
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
/// first.
pub(super) fn plan(loads: &[Load], goal_ms: f64) -> Plan {
    // A group does not become coarser if one of its steps would then take longer than the goal.
    let fits = |load: &Load, pace: Pace| step_ms(load, pace) <= goal_ms;
    let (paces, longest_ms) = shed(loads, goal_ms, fits, longest_ms);
    if longest_ms <= goal_ms {
        return Plan { paces: with_turns(loads, &paces), is_kept: true };
    }
    let (paces, _) = shed(loads, goal_ms, |_, _| true, mean_ms);
    Plan { paces: with_turns(loads, &paces), is_kept: false }
}

/// Makes groups coarser, where that fits, until what `measure` returns for all paces is within the goal, or
/// no group is left. Returns the paces and that measure.
fn shed(
    loads: &[Load],
    goal_ms: f64,
    fits: impl Fn(&Load, Pace) -> bool,
    measure: impl Fn(&[Load], &[Pace]) -> f64,
) -> (Vec<Pace>, f64) {
    let mut order: Vec<_> = (0..loads.len()).collect();
    order.sort_by(|&a, &b| loads[b].far_m.total_cmp(&loads[a].far_m).then(a.cmp(&b)));
    let mut paces = vec![Pace::FULL; loads.len()];
    let mut now_ms = measure(loads, &paces);
    for watched in [false, true] {
        for rate in RATES {
            for &group in order.iter().filter(|&&group| loads[group].watched == watched) {
                if now_ms <= goal_ms {
                    return (paces, now_ms);
                }
                let pace = Pace { rate, ..paces[group] };
                if fits(&loads[group], pace) {
                    paces[group] = pace;
                    now_ms = measure(loads, &paces);
                }
            }
        }
    }
    (paces, now_ms)
}

/// Returns the time of one step of a group at its pace, milliseconds.
fn step_ms(load: &Load, pace: Pace) -> f64 {
    load.step_ms * relative_time(ITERATIONS, pace.rate)
}

fn mean_ms(loads: &[Load], paces: &[Pace]) -> f64 {
    loads.iter().zip(paces).map(|(load, pace)| step_ms(load, *pace) / f64::from(pace.rate)).sum()
}

fn longest_ms(loads: &[Load], paces: &[Pace]) -> f64 {
    let (_, ticks_ms) = turns(loads, paces);
    ticks_ms.into_iter().fold(0.0, f64::max)
}

fn with_turns(loads: &[Load], paces: &[Pace]) -> Vec<Pace> {
    let (turns, _) = turns(loads, paces);
    turns.into_iter().zip(paces).map(|(turn, pace)| Pace { turn, ..*pace }).collect()
}

/// Deals groups out to the ticks in which they are stepped, the longest steps first, each to the ticks with
/// least to do (Graham 1969). Returns their turns, and how long each tick of a cycle takes.
fn turns(loads: &[Load], paces: &[Pace]) -> (Vec<u8>, [f64; COARSEST as usize]) {
    let mut ticks_ms = [0.0; COARSEST as usize];
    let steps_ms = loads.iter().zip(paces).map(|(load, pace)| step_ms(load, *pace));
    let mut dear: Vec<_> = steps_ms.enumerate().collect();
    dear.sort_by(|(a, a_ms), (b, b_ms)| b_ms.total_cmp(a_ms).then(a.cmp(b)));
    let mut turns = vec![0; loads.len()];
    for (group, step_ms) in dear {
        let rate = paces[group].rate;
        let of = |turn: u8| (turn..COARSEST).step_by(rate.into()).map(usize::from);
        let longest_ms = |turn: &u8| of(*turn).map(|tick| ticks_ms[tick]).fold(0.0, f64::max);
        let turn =
            (0..rate).min_by(|a, b| longest_ms(a).total_cmp(&longest_ms(b))).expect("rates are above 0");
        of(turn).for_each(|tick| ticks_ms[tick] += step_ms);
        turns[group] = turn;
    }
    (turns, ticks_ms)
}
