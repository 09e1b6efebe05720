//! Tests what a client hears when another world takes the place of the one that it knows.

use super::*;

/// Returns the bodies that went and came, in this order, since the last call.
fn gone_and_come(client: &mut Client) -> [Vec<BodyId>; 2] {
    let (mut gone, mut come) = (Vec::new(), Vec::new());
    for output in std::iter::from_fn(|| client.poll_output()) {
        match output {
            ClientOutput::Removed(id) => gone.push(id),
            ClientOutput::Inserted(id) => come.push(id),
            _ => {}
        }
    }
    [gone, come]
}

#[test]
fn the_world_has_ended_for_who_finds_another_one_at_its_server() {
    let [old, new] = [0.0, 5.0].map(|x| sim_body(BodyId::persistent(0), [x; 3]));
    let avatar = sim_body(BodyId::avatar(ClientId(1), 0), [1.0; 3]);
    for incarnation in [1, 2] {
        let mut client = Client::new(ClientId(1), None, None);
        joins(&mut client, vec![BodyRecord { epoch: Epoch(9), ..old.clone() }, avatar.clone()]);
        gone_and_come(&mut client);
        client.handle(Duration::ZERO, ClientEvent::Disconnected(Peer::Server));
        client.handle(Duration::ZERO, ClientEvent::Connected(Peer::Server));
        let (id, world) = (ClientId(1), sim_world(2));
        tell(&mut client, ToClient::Welcome { id, logical_time: 1, next_built: (0, 0), incarnation, world });
        tell(&mut client, ToClient::Chunk(Chunk::Bodies(vec![new.clone()])));
        tell(&mut client, ToClient::WorldEnd);
        let outputs: Vec<_> = std::iter::from_fn(|| client.poll_output()).collect();
        let has_ended = outputs.iter().any(|output| matches!(output, ClientOutput::WorldEnded));
        let goes_on = outputs.iter().any(|output| matches!(output, ClientOutput::Joined));
        assert_eq!((has_ended, goes_on), (incarnation == 2, incarnation == 1), "{outputs:?}");
        // What is known stays readable.
        assert_eq!(client.body(avatar.id).is_some(), has_ended);
        assert_eq!(
            client.body(old.id).unwrap().body.state.pose.translation,
            [0.0; 3],
            "what is newer counts"
        );
    }
}

#[test]
fn a_save_with_another_body_by_the_same_id_takes_the_one_and_brings_the_other() {
    let mut client = Client::new(ClientId(1), None, None);
    let bodies = [0, 1, 2].map(|index| sim_body(BodyId::persistent(index), [1.0; 3]));
    joins(&mut client, bodies.to_vec());
    gone_and_come(&mut client);
    let [same, mut named, mut made] = bodies;
    named.user_data = 7;
    std::sync::Arc::make_mut(&mut made.traits).linear_damping = 0.5;
    let (id, world) = (ClientId(1), sim_world(2));
    tell(&mut client, ToClient::Welcome { incarnation: 1, id, logical_time: 1, next_built: (3, 4), world });
    for body in [&mut named, &mut made] {
        body.epoch = Epoch(5);
    }
    tell(&mut client, ToClient::Chunk(Chunk::Bodies(vec![same, named.clone(), made.clone()])));
    tell(&mut client, ToClient::WorldEnd);
    let others = vec![named.id, made.id];
    assert_eq!(gone_and_come(&mut client), [others.clone(), others]);
    assert_eq!(client.body(named.id).unwrap().body.user_data, 7);
}
