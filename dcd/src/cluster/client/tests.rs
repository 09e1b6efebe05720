//! Tests what a client sends to server and leader (interest, queries), and which states of bodies it takes
//! in.

mod replaced;
mod shapes;

use super::*;
use crate::protocol::link::CLIENT_FRAME_BYTES;
use crate::protocol::{Costs, QueryParts, QueryResult, SharedState, Stamp, encode};
use crate::sim::{sim_body, sim_collider, sim_world};
use crate::space::{Epoch, RegionId};

#[test]
fn what_the_leader_said_is_not_undone_by_an_earlier_word_of_the_server() {
    let mut client = Client::new(ClientId(1), None, None);
    let mut tell = |message: ToClient| {
        let message = Message::ToClient(ClientId(1), message);
        client.handle(Duration::ZERO, ClientEvent::Message { from: Peer::Server, message });
        client.bodies().map(|view| (view.body.epoch, view.tick)).next()
    };
    let body = sim_body(BodyId::avatar(ClientId(1), 0), [1.0; 3]);
    let returned = |epoch| ToClient::Inserted {
        body: BodyRecord { epoch: Epoch(epoch), ..body.clone() },
        shapes: Vec::new(),
        joints: Vec::new(),
    };
    assert_eq!(tell(returned(1)), Some((Epoch(1), Tick(0))));
    let (pose, velocity) = (body.state.pose, body.state.velocity);
    let state =
        SharedState { id: body.id, owner: RegionId(1), epoch: Epoch(3), pose, velocity, sleeping: false };
    let stamp = Stamp::untimed(GroupId(1), Tick(7), false);
    assert_eq!(tell(ToClient::States { stamp, states: vec![state] }), Some((Epoch(3), Tick(7))));
    assert_eq!(tell(returned(2)), Some((Epoch(3), Tick(7))), "it comes over another link");
    assert_eq!(tell(returned(4)), Some((Epoch(4), Tick(0))));
}

/// Returns a client with a link to its leader that knows two bodies.
fn linked() -> Client {
    let mut client = Client::new(ClientId(1), None, None);
    for x in [0.0, 50.0] {
        let body = sim_body(BodyId::persistent(x as u32), [x, 0.0, 0.0]);
        tell(&mut client, ToClient::Inserted { body, shapes: Vec::new(), joints: Vec::new() });
    }
    follow(&mut client, 1);
    client
}

fn tell(client: &mut Client, message: ToClient) {
    let message = Message::ToClient(ClientId(1), message);
    client.handle(Duration::ZERO, ClientEvent::Message { from: Peer::Server, message });
}

fn follow(client: &mut Client, node: u32) {
    name_leader(client, node, 1);
    client.handle(Duration::ZERO, ClientEvent::Connected(Peer::Node(NodeId(node))));
}

fn name_leader(client: &mut Client, node: u32, port: u16) {
    let leader = Member { node: NodeId(node), address: ([127, 0, 0, 1], port).into(), client: None };
    let view = crate::protocol::ViewNumber(node.into());
    let allocation = [(RegionId(1), NodeId(node))].into();
    tell(
        client,
        ToClient::LeaderIs { group: GroupId(1), view, leader: Some(leader), tree: None, allocation },
    );
}

#[test]
fn an_input_that_is_refused_does_not_undo_the_end_of_its_avatar() {
    for (reason, is_undone) in [(Refusal::TooFast, false), (Refusal::TooFar, false), (Refusal::Unknown, true)]
    {
        let mut client = Client::new(ClientId(1), None, None);
        let body = sim_body(BodyId::avatar(ClientId(1), 0), [1.0; 3]);
        let id = body.id;
        tell(&mut client, ToClient::Inserted { body, shapes: Vec::new(), joints: Vec::new() });
        client.handle(Duration::ZERO, ClientEvent::Despawn(id));
        tell(&mut client, ToClient::Rejected { body: Some(id), reason });
        while client.poll_output().is_some() {}
        // The server was away, and is sent again what it has not done.
        client.say_again();
        let says = std::iter::from_fn(|| client.poll_output()).any(|output| {
            let said = FromClient::Despawn(id);
            matches!(output, ClientOutput::Send { message: Message::FromClient(_, message), .. } if message == said)
        });
        assert_eq!(says, !is_undone, "{reason:?}");
    }
}

#[test]
fn what_is_asked_while_the_world_is_told_again_is_asked_once_and_where_it_is_whole() {
    let mut client = Client::new(ClientId(1), None, None);
    let body = sim_body(BodyId::avatar(ClientId(1), 0), [1.0; 3]);
    let welcome = |next| {
        let (id, next_built) = (ClientId(1), (0, 0));
        ToClient::Welcome { incarnation: 1, id, logical_time: next, next_built, world: sim_world(2) }
    };
    let spawns = |client: &mut Client| {
        let is_spawn = |output: &ClientOutput| {
            matches!(
                output,
                ClientOutput::Send { message: Message::FromClient(_, FromClient::Spawn { .. }), .. }
            )
        };
        std::iter::from_fn(|| client.poll_output()).filter(is_spawn).count()
    };
    client.handle(Duration::ZERO, ClientEvent::Connected(Peer::Server));
    [welcome(1), ToClient::WorldEnd].into_iter().for_each(|message| tell(&mut client, message));
    client.handle(Duration::ZERO, ClientEvent::Disconnected(Peer::Server));
    client.handle(Duration::ZERO, ClientEvent::Connected(Peer::Server));
    client.handle(Duration::ZERO, ClientEvent::Spawn { body, shapes: Vec::new() });
    let before = spawns(&mut client);
    [welcome(2), ToClient::WorldEnd].into_iter().for_each(|message| tell(&mut client, message));
    assert_eq!((before, spawns(&mut client)), (0, 1));
}

#[test]
fn a_body_that_is_removed_again_while_it_goes_is_gone_once() {
    let [known, own] = [BodyId::persistent(0), BodyId::avatar(ClientId(1), 0)];
    let mut client = linked();
    while client.poll_output().is_some() {}
    client.handle(Duration::ZERO, ClientEvent::Despawn(own));
    for id in [known, known, BodyId::persistent(7), own, own] {
        tell(&mut client, ToClient::Removed(id));
    }
    let gone = std::iter::from_fn(|| client.poll_output()).filter_map(|output| match output {
        ClientOutput::Removed(id) => Some(id),
        _ => None,
    });
    assert_eq!(gone.collect::<Vec<_>>(), [known, own], "what it asked for is answered, known or not");
}

/// Returns the interests that the client sends to its leaders.
fn said(client: &mut Client) -> Vec<(Peer, Option<Area>)> {
    let output = |output| match output {
        ClientOutput::Send { to, message: Message::FromClient(_, FromClient::Interest(area)) } => {
            Some((to, area))
        }
        _ => None,
    };
    std::iter::from_fn(|| client.poll_output()).filter_map(output).collect()
}

#[test]
fn an_interest_is_said_when_it_changes_by_more_than_a_little_and_again_to_a_new_leader() {
    let mut client = linked();
    let area = |x: f64| Some(Area { centre: [x, 0.0, 0.0], radius_m: 20.0 });
    let turn = |client: &mut Client, area| {
        client.handle(Duration::ZERO, ClientEvent::Interest(area));
        said(client)
    };
    let (first, second) = (Peer::Node(NodeId(1)), Peer::Node(NodeId(2)));
    assert_eq!(said(&mut client), [(first, None)], "every leader is told at once");
    assert_eq!(turn(&mut client, area(0.0)), [(first, area(0.0))]);
    assert_eq!(turn(&mut client, area(0.9)), []);
    assert_eq!(turn(&mut client, area(1.1)), [(first, area(1.1))]);
    follow(&mut client, 2);
    assert_eq!(said(&mut client), [(second, area(1.1))]);
    assert_eq!(turn(&mut client, None), [(second, None)]);
    assert_eq!(turn(&mut client, None), []);
}

/// Returns the logical times of the inputs that the client sends.
fn inputs_said(client: &mut Client) -> Vec<(Peer, u64)> {
    let output = |output| match output {
        ClientOutput::Send { to, message: Message::FromClient(_, FromClient::Input(input)) } => {
            Some((to, input.logical_time))
        }
        _ => None,
    };
    std::iter::from_fn(|| client.poll_output()).filter_map(output).collect()
}

#[test]
fn a_new_leader_is_told_the_inputs_that_none_has_answered_and_those_that_are_still_meant() {
    let body = BodyId::avatar(ClientId(1), 0);
    let applied = |logical_time, speculative| {
        let stamp = Stamp { applied: logical_time, ..Stamp::untimed(GroupId(1), Tick(1), speculative) };
        Some(ToClient::States { stamp, states: Vec::new() })
    };
    let refused = Some(ToClient::Rejected { body: Some(body), reason: Refusal::TooFar });
    let [first, second] = [1, 2].map(|node| Peer::Node(NodeId(node)));
    for (answer, seconds, is_told) in [
        (None, 60, true),
        (applied(0, false), 60, true),
        (applied(1, true), 60, true),
        (applied(1, false), 4, true),
        (applied(1, false), 60, false),
        (refused.clone(), 4, true),
        (refused, 60, false),
    ] {
        let mut client = linked();
        let (velocity, pose) = (Velocity::linear([3.0, 0.0, 0.0]), None);
        client.handle(Duration::ZERO, ClientEvent::Input { body, tick: Tick(0), velocity, pose });
        assert_eq!(inputs_said(&mut client), [(first, 1)]);
        answer.clone().into_iter().for_each(|answer| tell(&mut client, answer));
        name_leader(&mut client, 2, 1);
        client.handle(Duration::from_secs(seconds), ClientEvent::Connected(second));
        let again = if is_told { vec![(second, 1)] } else { Vec::new() };
        assert_eq!(inputs_said(&mut client), again, "{answer:?}, {seconds} s later");
    }
}

#[test]
fn what_is_near_an_avatar_of_ones_own_is_not_outside() {
    let mut client = linked();
    let id = BodyId::avatar(client.id, 0);
    let stone = client.bodies().find(|view| view.body.id == BodyId::persistent(50)).unwrap().body.clone();
    let at = |x: f64| WorldPose::at([x, 0.0, 0.0]);
    tell(
        &mut client,
        ToClient::Inserted { body: sim_body(id, [44.0, 0.0, 0.0]), shapes: Vec::new(), joints: Vec::new() },
    );
    let area = Area { centre: [-20.0, 0.0, 0.0], radius_m: 5.0 };
    client.handle(Duration::ZERO, ClientEvent::Interest(Some(area)));
    let outside = |client: &Client| client.body(stone.id).unwrap().outside;
    assert!(!outside(&client), "at 50 m");
    let stamp = Stamp::untimed(GroupId(1), Tick(1), false);
    let hear = |client: &mut Client, x: f64| {
        let (pose, velocity) = (at(x), Velocity::default());
        let state = SharedState {
            id: stone.id,
            owner: RegionId(1),
            epoch: Epoch(0),
            pose,
            velocity,
            sleeping: false,
        };
        tell(client, ToClient::States { stamp, states: vec![state] });
    };
    hear(&mut client, 60.0);
    assert!(outside(&client));
    hear(&mut client, 51.0);
    assert!(!outside(&client));
}

#[test]
fn a_body_that_comes_into_the_area_is_outside_until_it_is_heard_of() {
    let mut client = linked();
    let outside = |client: &Client| client.bodies().map(|view| view.outside).collect::<Vec<_>>();
    let turn = |client: &mut Client, x: f64| {
        let area = Area { centre: [x, 0.0, 0.0], radius_m: 20.0 };
        client.handle(Duration::ZERO, ClientEvent::Interest(Some(area)));
    };
    let hear = |client: &mut Client, id: u32, x: f64, speculative: bool| {
        let (pose, velocity) = (WorldPose::at([x, 0.0, 0.0]), Velocity::default());
        let state = SharedState {
            id: BodyId::persistent(id),
            owner: RegionId(1),
            epoch: Epoch(0),
            pose,
            velocity,
            sleeping: false,
        };
        let stamp = Stamp::untimed(GroupId(1), Tick(1), speculative);
        tell(client, ToClient::States { stamp, states: vec![state] });
    };
    assert_eq!(outside(&client), [false, false]);
    turn(&mut client, 0.0);
    assert_eq!(outside(&client), [false, true]);
    turn(&mut client, 50.0);
    assert_eq!(outside(&client), [true, true]);
    hear(&mut client, 50, 50.0, false);
    assert_eq!(outside(&client), [true, false]);
    hear(&mut client, 50, 90.0, true);
    assert_eq!(client.body(BodyId::persistent(50)).unwrap().body.state.pose.translation[0], 50.0);
    hear(&mut client, 50, 90.0, false);
    assert_eq!(outside(&client), [true, true], "it went");
    client.handle(Duration::ZERO, ClientEvent::Interest(None));
    hear(&mut client, 50, 90.0, false);
    assert_eq!(outside(&client), [true, false], "everything is followed, and not everything heard of yet");
}

#[test]
fn a_question_asked_before_there_is_a_leader_is_asked_as_soon_as_there_is_and_not_again_at_once() {
    let mut client = Client::new(ClientId(1), None, None);
    let (filter, asked) = (Default::default(), QueryParts::Rays(Vec::new()));
    let question = Query { number: 7, filter, shapes: Vec::new(), parts: asked };
    client.handle(Duration::ZERO, ClientEvent::Ask(question.clone()));
    let asked = |client: &mut Client| {
        let asks = |output: &ClientOutput| match output {
            ClientOutput::Send { to, message: Message::FromClient(_, FromClient::Ask(_)) } => Some(*to),
            _ => None,
        };
        std::iter::from_fn(|| client.poll_output()).filter_map(|output| asks(&output)).collect::<Vec<_>>()
    };
    assert_eq!(asked(&mut client), [], "nobody is there to be asked");
    follow(&mut client, 1);
    assert_eq!(asked(&mut client), [Peer::Node(NodeId(1))]);
    assert_eq!(client.poll_timeout(), Some(ASK_AGAIN));
    follow(&mut client, 2);
    assert_eq!(asked(&mut client), [Peer::Node(NodeId(2))], "what the last leader was asked is gone with it");
    let message =
        Message::ToClient(ClientId(1), ToClient::Answer { number: 7, found: QueryResult::Rays(Vec::new()) });
    client.handle(Duration::ZERO, ClientEvent::Message { from: Peer::Node(NodeId(2)), message });
    assert_eq!(client.poll_timeout(), None);
    follow(&mut client, 3);
    assert_eq!(asked(&mut client), [], "it is answered");
}

#[test]
fn time_goes_on_for_a_client_though_it_is_told_of_no_body() {
    let mut client = linked();
    let mut hear = |group, tick, speculative| {
        let stamp = Stamp::untimed(GroupId(group), Tick(tick), speculative);
        tell(&mut client, ToClient::States { stamp, states: Vec::new() });
        client.tick().0
    };
    assert_eq!([hear(1, 30, false), hear(1, 29, false), hear(1, 33, true)], [30, 30, 33]);
    assert_eq!(hear(2, 90, false), 33, "another group's time is another");
}

#[test]
fn ticks_are_counted_anew_where_a_new_leader_has_gone_back_and_not_where_a_message_is_late() {
    let mut client = linked();
    let hear = |client: &mut Client, tick, speculative| {
        let stamp = Stamp::untimed(GroupId(1), Tick(tick), speculative);
        tell(client, ToClient::States { stamp, states: Vec::new() });
        client.tick().0
    };
    assert_eq!(hear(&mut client, 1_800, false), 1_800);
    assert_eq!(hear(&mut client, 900, false), 1_800, "from the same leader it is late");
    follow(&mut client, 2);
    assert_eq!(hear(&mut client, 1_790, false), 1_800, "some ticks were lost with the last leader");
    follow(&mut client, 3);
    assert_eq!(hear(&mut client, 900, true), 1_800, "a guess tells nothing");
    assert_eq!([hear(&mut client, 903, false), hear(&mut client, 906, false)], [903, 906]);
    // All nodes were started again: the same leader goes on from what the record has.
    client.handle(Duration::ZERO, ClientEvent::Connected(Peer::Node(NodeId(3))));
    assert_eq!(hear(&mut client, 780, false), 780);
}

#[test]
fn a_body_that_another_region_owns_than_before_is_a_transfer() {
    let mut client = linked();
    let id = BodyId::persistent(50);
    let hear = |client: &mut Client, group: u32, tick: u64, owner: u32, speculative: bool| {
        let (epoch, pose, velocity) = (Epoch(tick), WorldPose::at([50.0, 0.0, 0.0]), Velocity::default());
        let state = SharedState { id, owner: RegionId(owner), epoch, pose, velocity, sleeping: false };
        let stamp = Stamp::untimed(GroupId(group), Tick(tick), speculative);
        tell(client, ToClient::States { stamp, states: vec![state] });
        let heard: Vec<_> = client.take_handovers().map(|it| (it.body, it.from.0, it.to.0)).collect();
        (client.body(id).unwrap().owner.map(|owner| owner.0), heard)
    };
    assert_eq!(client.body(id).unwrap().owner, None);
    assert_eq!(hear(&mut client, 1, 2, 1, false), (Some(1), vec![]), "nobody was told before");
    assert_eq!(hear(&mut client, 1, 3, 0, true), (Some(1), vec![]), "a guess");
    assert_eq!(hear(&mut client, 1, 4, 2, false), (Some(2), vec![(id, 1, 2)]));
    assert_eq!(hear(&mut client, 1, 3, 1, false), (Some(2), vec![]), "it comes late");
    assert_eq!(hear(&mut client, 1, 5, 2, false), (Some(2), vec![]));
    // Another group has owners of its own.
    assert_eq!(client.computed_by(RegionId(1)), Some(NodeId(1)));
    let (view, allocation) = (crate::protocol::ViewNumber(9), [(RegionId(1), NodeId(7))].into());
    tell(&mut client, ToClient::LeaderIs { group: GroupId(2), view, leader: None, tree: None, allocation });
    assert_eq!((client.computed_by(RegionId(1)), client.computed_by(RegionId(2))), (Some(NodeId(7)), None));
    assert_eq!(client.body(id).unwrap().owner, None);
    assert_eq!(hear(&mut client, 2, 1, 1, false), (Some(1), vec![]));
}

#[test]
fn a_leader_that_was_started_again_elsewhere_is_dialled_there_though_its_link_seems_to_be_up() {
    let mut client = linked();
    let dials = |client: &mut Client| {
        let outputs = std::iter::from_fn(|| client.poll_output());
        let dial = |output| match output {
            ClientOutput::Connect(member) => Some(format!("dials {}", member.address.port())),
            ClientOutput::Disconnect(node) => Some(format!("leaves {node}")),
            _ => None,
        };
        outputs.filter_map(dial).collect::<Vec<_>>()
    };
    dials(&mut client);
    name_leader(&mut client, 1, 1);
    assert_eq!(dials(&mut client), [""; 0]);
    name_leader(&mut client, 1, 2);
    assert_eq!(dials(&mut client), ["leaves n1", "dials 2"]);
}

#[test]
fn a_leader_that_falls_silent_while_things_move_is_asked_and_so_is_the_server_until_it_is_heard() {
    let mut client = linked();
    let leader = Peer::Node(NodeId(1));
    let hear = |client: &mut Client, at: Duration, bodies: usize| {
        let state = SharedState {
            id: BodyId::persistent(0),
            owner: RegionId(1),
            epoch: Epoch(0),
            pose: WorldPose::default(),
            velocity: Velocity::default(),
            sleeping: false,
        };
        let stamp = Stamp::untimed(GroupId(1), Tick(at.as_millis() as u64), false);
        let message = Message::ToClient(ClientId(1), ToClient::States { stamp, states: vec![state; bodies] });
        client.handle(at, ClientEvent::Message { from: leader, message });
    };
    let asked = |client: &mut Client, at: Duration| {
        client.handle_timeout(at);
        let ping = |output| match output {
            ClientOutput::Send { to, message: Message::Ping(_) } => Some(to),
            _ => None,
        };
        std::iter::from_fn(|| client.poll_output()).filter_map(ping).collect::<Vec<_>>()
    };
    let at = Duration::from_millis;
    assert_eq!(client.poll_timeout(), None, "nothing is expected yet");
    for ms in (0..3_000).step_by(50) {
        hear(&mut client, at(ms), 1);
        assert_eq!(asked(&mut client, at(ms)), []);
    }
    assert_eq!(asked(&mut client, at(3_600)), []);
    assert_eq!(asked(&mut client, at(3_700)), [leader, Peer::Server]);
    assert_eq!(asked(&mut client, at(4_500)), [leader, Peer::Server], "again and again");
    let pong = crate::protocol::Pong { sent_us: 0, received_us: 0, answered_us: 0 };
    client.handle(at(4_600), ClientEvent::Message { from: Peer::Server, message: Message::Pong(pong) });
    assert_eq!(asked(&mut client, at(5_300)), [leader, Peer::Server], "the server is not the leader");
    client.handle(at(5_400), ClientEvent::Message { from: leader, message: Message::Pong(pong) });
    assert_eq!(client.poll_timeout(), None, "it lives, and nothing moves");
    hear(&mut client, at(10_000), 1);
    hear(&mut client, at(10_500), 0);
    assert_eq!(client.poll_timeout(), None, "it says that nothing moves");
    hear(&mut client, at(11_000), 1);
    client.handle(at(11_100), ClientEvent::Disconnected(leader));
    assert_eq!(asked(&mut client, at(30_000)), [], "nobody is there to be heard");
}

/// Returns what the client sends to be built.
fn built(client: &mut Client) -> Vec<(u64, Vec<BuildOp>)> {
    let output = |output| match output {
        ClientOutput::Send { to, message } => {
            assert!(encode(&message).len() <= CLIENT_FRAME_BYTES);
            match message {
                Message::FromClient(_, FromClient::Build { number, ops }) => {
                    assert_eq!(to, Peer::Server);
                    Some((number, ops))
                }
                _ => None,
            }
        }
        _ => None,
    };
    std::iter::from_fn(|| client.poll_output()).filter_map(output).collect()
}

fn inserted(bodies: Vec<BodyRecord>) -> BuildOp {
    BuildOp::Insert { bodies, shapes: Vec::new(), joints: Vec::new() }
}

/// Has the client join, perhaps again, and be told of these bodies.
fn joins(client: &mut Client, bodies: Vec<BodyRecord>) {
    client.handle(Duration::ZERO, ClientEvent::Connected(Peer::Server));
    let (id, world) = (ClientId(1), sim_world(2));
    tell(client, ToClient::Welcome { incarnation: 1, id, logical_time: 1, next_built: (3, 4), world });
    tell(client, ToClient::Chunk(Chunk::Bodies(bodies)));
    tell(client, ToClient::WorldEnd);
}

fn built_body(index: u32) -> BodyRecord {
    sim_body(BodyId::built(ClientId(1), index), [0.0; 3])
}

fn appeared(client: &mut Client) -> Vec<BodyId> {
    let outputs = std::iter::from_fn(|| client.poll_output());
    let inserted = outputs.filter_map(|output| match output {
        ClientOutput::Inserted(id) => Some(id),
        _ => None,
    });
    inserted.collect()
}

#[test]
fn what_came_while_the_server_was_away_or_with_another_world_appears() {
    let mut client = Client::new(ClientId(1), None, None);
    let body = |index| sim_body(BodyId::persistent(index), [1.0; 3]);
    joins(&mut client, vec![body(0)]);
    assert_eq!(appeared(&mut client), [], "who joins looks for itself");
    client.handle(Duration::ZERO, ClientEvent::Disconnected(Peer::Server));
    joins(&mut client, vec![body(0), body(1)]);
    assert_eq!(appeared(&mut client), [BodyId::persistent(1)]);
    // Over the same link a save comes in place of the world.
    let (id, world) = (ClientId(1), sim_world(2));
    tell(&mut client, ToClient::Welcome { incarnation: 1, id, logical_time: 1, next_built: (3, 4), world });
    tell(&mut client, ToClient::Chunk(Chunk::Bodies(vec![body(1), body(2)])));
    tell(&mut client, ToClient::WorldEnd);
    assert_eq!(appeared(&mut client), [BodyId::persistent(2)]);
}

#[test]
fn an_avatar_that_was_made_while_the_server_was_away_appears_once() {
    let mut client = Client::new(ClientId(1), None, None);
    joins(&mut client, Vec::new());
    let body = sim_body(BodyId::avatar(ClientId(1), 0), [1.0; 3]);
    client.handle(Duration::ZERO, ClientEvent::Spawn { body: body.clone(), shapes: Vec::new() });
    client.handle(Duration::ZERO, ClientEvent::Disconnected(Peer::Server));
    joins(&mut client, vec![body.clone()]);
    assert_eq!(appeared(&mut client), [body.id]);
}

#[test]
fn what_was_asked_is_said_again_though_another_world_came_as_the_link_broke() {
    let mut client = Client::new(ClientId(1), None, None);
    joins(&mut client, Vec::new());
    let body = sim_body(BodyId::avatar(ClientId(1), 0), [1.0; 3]);
    let (id, world) = (ClientId(1), sim_world(2));
    tell(&mut client, ToClient::Welcome { incarnation: 1, id, logical_time: 1, next_built: (3, 4), world });
    client.handle(Duration::ZERO, ClientEvent::Disconnected(Peer::Server));
    client.handle(Duration::ZERO, ClientEvent::Spawn { body, shapes: Vec::new() });
    while client.poll_output().is_some() {}
    joins(&mut client, Vec::new());
    let is_asked = |output| {
        let ClientOutput::Send { message, .. } = output else { return false };
        matches!(message, Message::FromClient(_, FromClient::Spawn { .. }))
    };
    assert_eq!(
        std::iter::from_fn(|| client.poll_output()).filter(|output| is_asked(output.clone())).count(),
        1
    );
}

#[test]
fn an_avatar_that_fits_no_frame_is_refused() {
    let mut client = Client::new(ClientId(1), None, None);
    joins(&mut client, Vec::new());
    let mut body = sim_body(BodyId::avatar(ClientId(1), 0), [1.0; 3]);
    let collider = sim_collider(&ShapeRecord::Ball(0.5));
    std::sync::Arc::make_mut(&mut body.traits).colliders = vec![collider; 1_000];
    while client.poll_output().is_some() {}
    client.handle(Duration::ZERO, ClientEvent::Spawn { body: body.clone(), shapes: Vec::new() });
    let outputs: Vec<_> = std::iter::from_fn(|| client.poll_output()).collect();
    let reason = Refusal::Costly(Costs::Bytes);
    assert_eq!(outputs, [ClientOutput::Rejected { body: Some(body.id), reason }]);
}

#[test]
fn what_is_to_be_built_is_said_again_to_a_server_that_is_back_unless_it_shows_that_it_was_done() {
    let at = Duration::ZERO;
    let mut client = Client::new(ClientId(1), None, None);
    joins(&mut client, Vec::new());
    assert_eq!(client.next_built(), (3, 4));
    let all: Vec<_> = (0..2_000).map(built_body).collect();
    client.handle(at, ClientEvent::Build(vec![inserted(all.clone())]));
    let sent = built(&mut client);
    assert!(sent.len() > 4 && sent.is_sorted_by_key(|(number, _)| *number), "{}", sent.len());

    // One message is on record, the world shows the next, and the others were never heard of.
    tell(&mut client, ToClient::Built(sent[0].0));
    assert_eq!(client.answered_builds(), 0, "not all of the request");
    let velocity = Velocity::default();
    let go = Input { body: all[0].id, logical_time: 0, tick: Tick(0), velocity, pose: None, drive: None };
    client.handle(at, ClientEvent::Build(vec![BuildOp::Move(go)]));
    client.handle(at, ClientEvent::Disconnected(Peer::Server));
    client.handle(at, ClientEvent::Build(vec![BuildOp::Remove(all[0].id)]));
    built(&mut client);
    let BuildOp::Insert { bodies, .. } = &sent[1].1[0] else { panic!("bodies were inserted") };
    joins(&mut client, bodies.iter().chain([&all[0]]).cloned().collect());
    let again = built(&mut client);
    let (removal, others) = again.split_last().expect("it asks again");
    assert_eq!(removal.1, [BuildOp::Remove(all[0].id)], "a velocity of before is not meant for now");
    assert_eq!(others, &sent[2..]);
    for (number, _) in &again {
        assert!(client.answered_builds() < 3);
        tell(&mut client, ToClient::Built(*number));
    }
    assert_eq!(client.answered_builds(), 3);
    joins(&mut client, all);
    assert_eq!(built(&mut client), []);
}

#[test]
fn what_is_to_be_built_keeps_its_order_while_a_world_arrives_and_is_said_of_a_new_one_too() {
    let at = Duration::ZERO;
    let mut client = Client::new(ClientId(1), None, None);
    let build = |client: &mut Client, index| {
        client.handle(at, ClientEvent::Build(vec![inserted(vec![built_body(index)])]));
        built(client)
    };
    joins(&mut client, Vec::new());
    client.handle(at, ClientEvent::Disconnected(Peer::Server));
    assert_eq!(build(&mut client, 1), []);
    client.handle(at, ClientEvent::Connected(Peer::Server));
    assert_eq!(build(&mut client, 2), [], "it is not welcomed yet");
    let welcome = || ToClient::Welcome {
        incarnation: 1,
        id: ClientId(1),
        logical_time: 1,
        next_built: (0, 0),
        world: sim_world(2),
    };
    tell(&mut client, welcome());
    assert_eq!(build(&mut client, 3), []);
    tell(&mut client, ToClient::WorldEnd);
    let numbers = |sent: Vec<(u64, Vec<BuildOp>)>| sent.iter().map(|(number, _)| *number).collect::<Vec<_>>();
    assert_eq!(numbers(built(&mut client)), [1, 2, 3]);

    // Another world comes in its place.
    assert_eq!((client.answered_builds(), client.replacements()), (0, 0));
    tell(&mut client, welcome());
    assert_eq!((client.answered_builds(), client.replacements()), (3, 0));
    assert_eq!(build(&mut client, 4), []);
    tell(&mut client, ToClient::WorldEnd);
    assert_eq!(numbers(built(&mut client)), [4], "what was asked before was meant for the other");
    assert_eq!((client.answered_builds(), client.replacements()), (3, 1));
}

#[test]
fn what_is_said_again_has_all_removals_and_of_alterations_the_last() {
    let at = Duration::ZERO;
    let mut client = Client::new(ClientId(1), None, None);
    let body = built_body(0);
    joins(&mut client, vec![body.clone()]);
    let alter = |damping: f32, wakes: bool| {
        let mut traits = body.traits.clone();
        std::sync::Arc::make_mut(&mut traits).linear_damping = damping;
        BuildOp::Alter(Alteration::Body { body: body.id, traits, user_data: 0, wakes })
    };
    // The client never heard of these.
    let gone = [BuildOp::Remove(BodyId::persistent(9)), BuildOp::RemoveJoint(crate::space::JointId(9))];
    client.handle(at, ClientEvent::Build(vec![alter(0.1, true), gone[0].clone(), alter(0.2, false)]));
    client.handle(at, ClientEvent::Build(vec![alter(0.3, false), gone[1].clone()]));
    assert_eq!(built(&mut client).len(), 2);
    client.handle(at, ClientEvent::Disconnected(Peer::Server));
    joins(&mut client, vec![body.clone()]);
    let again = [(1, vec![gone[0].clone()]), (2, vec![alter(0.3, true), gone[1].clone()])];
    assert_eq!(built(&mut client), again);
}

#[test]
fn what_is_to_be_built_and_fits_no_frame_is_refused() {
    let mut client = Client::new(ClientId(1), None, None);
    joins(&mut client, Vec::new());
    let mut large = built_body(7);
    let collider = sim_collider(&ShapeRecord::Ball(0.5));
    std::sync::Arc::make_mut(&mut large.traits).colliders = vec![collider; 1_000];
    client.handle(Duration::ZERO, ClientEvent::Build(vec![inserted(vec![built_body(6), large.clone()])]));
    let outputs: Vec<_> = std::iter::from_fn(|| client.poll_output()).collect();
    let reason = Refusal::Costly(Costs::Bytes);
    assert!(outputs.contains(&ClientOutput::Rejected { body: Some(large.id), reason }));
    let ops = outputs.into_iter().find_map(|output| match output {
        ClientOutput::Send { message: Message::FromClient(_, FromClient::Build { ops, .. }), .. } => {
            Some(ops)
        }
        _ => None,
    });
    assert_eq!(ops, Some(vec![inserted(vec![built_body(6)])]), "the other is sent");
}

#[test]
fn what_waits_for_a_server_that_is_away_is_bounded() {
    let mut client = Client::new(ClientId(1), None, None);
    let build = |client: &mut Client, index: u32| {
        let mut body = built_body(index);
        let collider = sim_collider(&ShapeRecord::Ball(0.5));
        std::sync::Arc::make_mut(&mut body.traits).colliders = vec![collider; 400];
        client.handle(Duration::ZERO, ClientEvent::Build(vec![inserted(vec![body])]));
        std::iter::from_fn(|| client.poll_output()).next()
    };
    let refused = (0..1_000).find_map(|index| Some((index, build(&mut client, index)?)));
    let (index, output) = refused.expect("it waits for some only");
    assert!((150..400).contains(&index), "{index} bodies of some 40 kB");
    let body = Some(BodyId::built(ClientId(1), index));
    assert_eq!(output, ClientOutput::Rejected { body, reason: Refusal::TooMany });
}
