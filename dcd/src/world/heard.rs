//! Copies what a client has heard of bodies: only of those that changed since its last step.

use std::collections::{BTreeMap, BTreeSet};

use crate::cluster::{BodyView, Client};
use crate::space::BodyId;

/// Brings a copy of a client's bodies up to date, without the hidden ones. The bodies in `again` are copied
/// whether or not they changed. Returns the ids of all bodies that were looked at.
pub(super) fn follow(
    bodies: &mut BTreeMap<BodyId, BodyView>,
    client: &mut Client,
    mut again: BTreeSet<BodyId>,
    is_hidden: impl Fn(BodyId) -> bool,
) -> Vec<BodyId> {
    let Some(changed) = client.take_changed() else {
        let all = client.bodies().filter(|body| !is_hidden(body.body.id));
        *bodies = all.map(|body| (body.body.id, body.clone())).collect();
        return bodies.keys().copied().collect();
    };
    again.extend(changed);
    for &id in &again {
        match client.body(id).filter(|_| !is_hidden(id)) {
            Some(body) => bodies.insert(id, body.clone()),
            None => bodies.remove(&id),
        };
    }
    again.into_iter().collect()
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::cluster::{ClientEvent, Peer};
    use crate::protocol::{Message, SharedState, Stamp, ToClient};
    use crate::sim::sim_body;
    use crate::space::{ClientId, Epoch, GroupId, RegionId, Tick};

    fn tell(client: &mut Client, message: ToClient) {
        let message = Message::ToClient(ClientId(1), message);
        client.handle(Duration::ZERO, ClientEvent::Message { from: Peer::Server, message });
    }

    fn insert(client: &mut Client, index: u32) {
        let body = sim_body(BodyId::persistent(index), [f64::from(index), 0.0, 0.0]);
        tell(client, ToClient::Inserted { body, shapes: Vec::new(), joints: Vec::new() });
    }

    #[test]
    fn a_step_copies_the_bodies_that_changed_and_shows_all_as_they_are() {
        let mut client = Client::new(ClientId(1), None, None);
        (0..1_000).for_each(|index| insert(&mut client, index));
        let (mut bodies, none) = (BTreeMap::new(), BTreeSet::new);
        let ids = |range: std::ops::Range<u32>| range.map(BodyId::persistent).collect::<Vec<_>>();
        assert_eq!(follow(&mut bodies, &mut client, none(), |_| false).len(), 1_000);
        assert!(follow(&mut bodies, &mut client, none(), |_| false).is_empty(), "nothing moves");

        let mut moved = client.body(BodyId::persistent(7)).unwrap().body.state.pose;
        moved.translation[1] = 3.0;
        let state = SharedState {
            id: BodyId::persistent(7),
            owner: RegionId(1),
            epoch: Epoch(9),
            pose: moved,
            velocity: Default::default(),
            sleeping: false,
        };
        let stamp = Stamp::untimed(GroupId(1), Tick(7), false);
        tell(&mut client, ToClient::States { stamp, states: vec![state] });
        assert_eq!(follow(&mut bodies, &mut client, none(), |_| false), ids(7..8));
        insert(&mut client, 1_000);
        tell(&mut client, ToClient::Removed(BodyId::persistent(3)));
        let again = follow(&mut bodies, &mut client, none(), |_| false);
        assert_eq!(again, [ids(3..4), ids(1_000..1_001)].concat());
        assert!(bodies.values().eq(client.bodies()), "and all are as they were told");

        // A removed body is back when the removal is refused, although nothing was told of it.
        let hidden = BodyId::persistent(5);
        tell(&mut client, ToClient::Removed(BodyId::persistent(4)));
        follow(&mut bodies, &mut client, [hidden].into(), |id| id == hidden);
        assert!(!bodies.contains_key(&hidden) && bodies.len() == 998);
        assert_eq!(follow(&mut bodies, &mut client, [hidden].into(), |_| false), [hidden]);
        assert!(bodies.values().eq(client.bodies()));

        // What the leader of another group tells makes all bodies count as changed.
        let leader = ToClient::LeaderIs {
            group: GroupId(2),
            view: crate::protocol::ViewNumber(2),
            leader: None,
            tree: None,
            allocation: BTreeMap::new(),
        };
        tell(&mut client, leader);
        assert_eq!(follow(&mut bodies, &mut client, none(), |_| false).len(), 999);
        assert!(bodies.values().eq(client.bodies()));
    }
}
