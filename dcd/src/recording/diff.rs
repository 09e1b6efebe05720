//! Finds the first tick at which two recordings differ, by replaying both side by side.

use super::{BodyBits, FIELDS, RecordingError, Replay};
use crate::space::{BodyId, NodeId, RegionId, Tick};

/// The place of a body in one of two recordings: its node, if it is on one, and its region.
type Place = (Option<NodeId>, RegionId);

/// The first difference of two recordings: the body of lowest id that differs after the first tick that
/// differs.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    /// The tick after which the recordings differ.
    pub tick: Tick,
    /// The body that differs.
    pub body: BodyId,
    /// The number of bodies that differ then.
    pub bodies: usize,
    /// The node and region of the body in each recording; `None` where the body does not exist.
    pub places: [Option<Place>; 2],
    /// The name of the first field that differs.
    pub field: Option<&'static str>,
    /// The values of that field, in m, m/s or rad/s; positions are relative to the region.
    pub values: [Option<f64>; 2],
    /// What acted on the body in the ticks before, in each recording.
    pub acted: [Vec<String>; 2],
}

/// Replays two recordings until they differ, one of them ends, or the tick `until` has been compared. Calls
/// `told` for every tick in which they agree. Returns the last tick that was compared, and the difference.
pub fn difference(
    [a, b]: [&mut Replay; 2],
    until: Tick,
    mut told: impl FnMut(Tick),
) -> Result<(Tick, Option<Difference>), RecordingError> {
    // Without a tick in each there is nothing to compare.
    let (Some(one), Some(other)) = (a.next_tick(), b.next_tick()) else { return Ok((Tick(0), None)) };
    let (mut compared, mut tick) = (Tick(0), one.max(other).max(Tick(1)));
    while tick <= until {
        for side in [&mut *a, &mut *b] {
            while side.advance(tick)? {}
        }
        // A recording that begins later is waited for; one that has ended stays behind.
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
