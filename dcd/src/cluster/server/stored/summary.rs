//! Reads from what is stored of a world what a process must know before it serves that world.

use super::{StoredGroup, StoredWorld, is_same};
use crate::cluster::Key;
use crate::cluster::directory::Entry;
use crate::cluster::record::StoredBody;
use crate::protocol::{EnvironmentProperties, decode_value};
use crate::space::{ClientId, NodeId};

/// Returns in what a stored world is another one than the world to be served, in words of the command line;
/// `None` if it is the same, or cannot be read. `value` is that of [`Key::World`].
pub(crate) fn difference(value: &[u8], served: &EnvironmentProperties) -> Option<String> {
    let stored = decode_value::<StoredWorld>(value).ok()?.world;
    if is_same(&stored, served) {
        return None;
    }
    let (step, to) = (&stored.step, &served.step);
    let parts = [
        ("bodies or joints", stored.world != served.world),
        ("gravity", step.gravity != to.gravity),
        ("tick length", step.dt_s != to.dt_s),
        ("solver iterations", step.solver_iterations != to.solver_iterations),
        ("speed limit", step.speed_limit_m_s != to.speed_limit_m_s),
        ("--coupling", step.coupling != to.coupling),
        ("--exchanges", step.exchanges != to.exchanges),
        ("--depth", step.depth != to.depth),
        ("--island-limit", step.island_limit != to.island_limit),
        ("--tolerance", step.tolerance_m_s != to.tolerance_m_s),
        ("regions (--regions, --cut)", stored.tree != served.tree),
        ("--balance", stored.balance != served.balance),
        // Other bodies may lead to another one.
        ("halo", stored.halo_m != served.halo_m && stored.world == served.world),
        ("--avatar-speed", stored.avatar_speed_limit != served.avatar_speed_limit),
        ("--lag", stored.protocol != served.protocol),
        ("--near, --far or --agree", stored.thresholds != served.thresholds),
        ("--unpaced", stored.pace != served.pace),
        ("--state-every", stored.state_every != served.state_every),
        ("--ticks", stored.last_tick != served.last_tick),
    ];
    let names: Vec<_> = parts.into_iter().filter(|(_, differs)| *differs).map(|(name, _)| name).collect();
    Some(if names.is_empty() { "its settings".to_owned() } else { names.join(", ") })
}

/// Returns the highest names of nodes and clients that a stored world has.
pub(crate) fn highest_names(entries: &[Entry]) -> (NodeId, ClientId) {
    let (mut node, mut client) = (NodeId::default(), ClientId::default());
    for Entry { key, value, .. } in entries {
        match key {
            Key::Body(id) => client = client.max(id.client().unwrap_or_default()),
            Key::Group(_) => {
                // What cannot be read is reported when the world is restored.
                let Ok(StoredGroup { view, former }) = decode_value::<StoredGroup>(value) else { continue };
                for member in former.iter().chain([&view]).flat_map(|view| &view.members) {
                    node = node.max(member.node);
                    client = client.max(member.client.unwrap_or_default());
                }
            }
            _ => {}
        }
    }
    (node, client)
}

/// Returns how many movable bodies a stored world has.
pub(crate) fn movable_bodies(entries: &[Entry]) -> usize {
    let bodies = entries.iter().filter(|entry| matches!(entry.key, Key::Body(_)));
    let is_movable =
        |entry: &&Entry| decode_value::<StoredBody>(&entry.value).is_ok_and(|body| body.is_movable());
    bodies.filter(is_movable).count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::{ViewNumber, encode_value};
    use crate::sim::sim_world;
    use crate::space::{GroupId, Tick};

    #[test]
    fn a_world_that_is_to_be_served_otherwise_than_it_is_stored_says_in_what() {
        let world = sim_world(2);
        let stored = StoredWorld {
            incarnation: 1,
            world: world.clone(),
            number: ViewNumber(1),
            main: GroupId(1),
            last_group: GroupId(1),
            begun: true,
            tick: Tick(7),
            next_ids: (0, 0),
            viewpoints: Vec::new(),
        };
        let value = encode_value(&stored);
        let relayed = EnvironmentProperties { relays_above: Some(7), ..world.clone() };
        assert_eq!([&world, &relayed].map(|served| difference(&value, served)), [None, None]);
        let mut other = EnvironmentProperties { state_every: world.state_every + 1, ..world };
        other.step.gravity[0] += 1.0;
        assert_eq!(difference(&value, &other).as_deref(), Some("gravity, --state-every"));
        assert_eq!(difference(&value[1..], &other), None, "it is no world, which is said elsewhere");
    }
}
