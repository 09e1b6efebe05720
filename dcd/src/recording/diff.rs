//! Finds the first tick at which two recordings differ, by replaying both side by side.

use super::{BodyBits, FIELDS, RecordingError, Replay};
use crate::space::{BodyId, NodeId, RegionId, Tick};

/// The place of a body in one of two recordings.
type Place = (Option<NodeId>, RegionId);

/// Where two recordings differ first: the body of lowest id after the first tick.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    /// After which tick.
    pub tick: Tick,
    /// Which body.
    pub body: BodyId,
    /// How many bodies differ then.
    pub bodies: usize,
    /// On which node and in which region it is in either; `None` where it is not.
    pub places: [Option<Place>; 2],
    /// The first field that differs.
    pub field: Option<&'static str>,
    /// Its values, in m, m/s or rad/s; positions are relative to the region.
    pub values: [Option<f64>; 2],
    /// What acted on the body in the ticks before, in either.
    pub acted: [Vec<String>; 2],
}

/// Replays two recordings until they differ, or one of them ends, or to a tick; `told` hears of every tick. Returns the last tick that was
/// compared, too.
pub fn difference(
    [a, b]: [&mut Replay; 2],
    until: Tick,
    mut told: impl FnMut(Tick),
) -> Result<(Tick, Option<Difference>), RecordingError> {
    // Before both have begun there is nothing to compare.
    let (Some(one), Some(other)) = (a.next_tick(), b.next_tick()) else { return Ok((Tick(0), None)) };
    let (mut compared, mut tick) = (Tick(0), one.max(other).max(Tick(1)));
    while tick <= until {
        for side in [&mut *a, &mut *b] {
            while side.advance(tick)? {}
        }
        // One that begins later is waited for; one that has ended stays behind.
        let [one, other] = [a.tick(), b.tick()];
        if one.min(other) < tick {
            break;
        }
        if one.max(other) > tick {
            tick = one.max(other);
            continue;
        }
        if let Some(found) = compare(tick, [a, b]) {
            return Ok((tick, Some(found)));
        }
        told(tick);
        (compared, tick) = (tick, tick.next());
    }
    Ok((compared, None))
}

fn compare(tick: Tick, sides: [&Replay; 2]) -> Option<Difference> {
    let [one, other] = sides.map(Replay::bodies);
    let bits = |found: Option<&(Option<NodeId>, RegionId, BodyBits)>| found.map(|(.., bits)| *bits);
    let ids: std::collections::BTreeSet<_> = one.keys().chain(other.keys()).copied().collect();
    let mut differing = ids.into_iter().filter(|id| bits(one.get(id)) != bits(other.get(id)));
    let body = differing.next()?;
    let states = [bits(one.get(&body)), bits(other.get(&body))];
    let field = states[0].zip(states[1]).and_then(|(one, other)| one.first_difference(&other));
    Some(Difference {
        tick,
        body,
        bodies: 1 + differing.count(),
        places: [one.get(&body), other.get(&body)]
            .map(|found| found.map(|&(node, region, _)| (node, region))),
        field: field.map(|field| FIELDS[field].0),
        values: states.map(|bits| Some(bits?.value(field?))),
        acted: sides.map(|side| side.acted_on(body)),
    })
}
