//! Tests which contacts a server's program is told.

use dcd::Tick;
use dcd::protocol::Pace;

use super::*;

#[test]
fn a_servers_program_hears_each_contact_once_that_a_body_asks_for() {
    let hears = |events: bool| {
        let folder = tempfile::tempdir().unwrap();
        let mut server = serve(ServeConfig { nodes: 2, events, ..ServeConfig::new(folder.path()) });
        let _nodes = [node(&server), node(&server)];
        until("the world runs", &mut [&mut server], |worlds| worlds[0].tick() > Tick(0));
        let ground =
            server.insert(RigidBodyBuilder::fixed(), ColliderBuilder::cuboid(20.0, 0.5, 20.0)).unwrap();
        let ball = |x: f32| RigidBodyBuilder::dynamic().translation(Vector::new(x, 2.0, 0.0));
        let quiet = server.insert(ball(3.0), ColliderBuilder::ball(0.5)).unwrap();
        let asks = ColliderBuilder::ball(0.5)
            .active_events(ActiveEvents::COLLISION_EVENTS | ActiveEvents::CONTACT_FORCE_EVENTS)
            .contact_force_event_threshold(1.0);
        // On the border, so that both regions see it.
        let loud = server.insert(ball(0.0), asks).unwrap();
        let (mut began, mut forces) = (Vec::new(), Vec::new());
        until("both lie on the ground", &mut [&mut server], |worlds| {
            began
                .extend(worlds[0].events().touches.iter().filter(|touch| touch.began).map(|touch| touch.key));
            forces.extend(worlds[0].events().forces.iter().map(|force| force.key));
            let lies = |id| worlds[0].pose(id).is_some_and(|pose| pose.translation[1] < 1.02);
            // A contact is told at once, the record half a second later.
            lies(quiet)
                && lies(loud)
                && worlds[0].velocity(loud).is_some_and(|now| now.linear[1].abs() < 0.01)
        });
        let is_of = |key: &dcd::protocol::ContactKey| [key.a, key.b] == [ground, loud];
        assert!(began.iter().chain(&forces).all(is_of), "{began:?}");
        (began.len(), forces.is_empty())
    };
    assert_eq!(hears(true), (1, false));
    assert_eq!(hears(false), (0, true), "it does not listen");
}

#[test]
fn contacts_that_end_with_a_body_say_whose_it_was() {
    let folder = tempfile::tempdir().unwrap();
    let mut server = serve(ServeConfig { nodes: 1, ..ServeConfig::new(folder.path()) });
    let _node = node(&server);
    until("the world runs", &mut [&mut server], |worlds| worlds[0].tick() > Tick(0));
    let mut client = client(&server);
    server.insert(RigidBodyBuilder::fixed(), ColliderBuilder::cuboid(20.0, 0.5, 20.0)).unwrap();
    let ball = |world: &mut World, x: f32, user_data| {
        let body = RigidBodyBuilder::dynamic().translation(Vector::new(x, 1.2, 0.0)).user_data(user_data);
        let asks = ColliderBuilder::ball(0.5).active_events(ActiveEvents::COLLISION_EVENTS);
        world.insert(body, asks).unwrap()
    };
    let ids = [ball(&mut server, 3.0, 7), ball(&mut client, -3.0, 9)];
    let both = |what: &str, server: &mut World, client: &mut World, began: bool| {
        let mut told = [None; 2];
        until(what, &mut [server, client], |worlds| {
            for ((told, world), id) in told.iter_mut().zip(worlds).zip(ids) {
                let is_meant = |touch: &dcd::protocol::Touch| {
                    touch.began == began && [touch.key.a, touch.key.b].contains(&id)
                };
                if world.events().touches.iter().any(is_meant) {
                    *told = world.user_data(id);
                }
            }
            told.iter().all(Option::is_some)
        });
        told
    };
    assert_eq!(both("both lie on the ground", &mut server, &mut client, true), [Some(7), Some(9)]);
    server.remove(ids[0]).unwrap();
    client.remove(ids[1]).unwrap();
    assert_eq!(both("both are gone", &mut server, &mut client, false), [Some(7), Some(9)]);
    assert!(!server.contains(ids[0]) && !client.contains(ids[1]));
}

#[test]
fn a_server_tells_once_what_came_before_its_world_ended() {
    let folder = tempfile::tempdir().unwrap();
    let last_tick = Some(Tick(120));
    let config = ServeConfig { nodes: 1, pace: Pace::Unpaced, last_tick, ..ServeConfig::new(folder.path()) };
    let mut server = serve(config);
    server.insert(RigidBodyBuilder::fixed(), ColliderBuilder::cuboid(20.0, 0.5, 20.0)).unwrap();
    let asks = ColliderBuilder::ball(0.5).active_events(ActiveEvents::COLLISION_EVENTS);
    server.insert(RigidBodyBuilder::dynamic().translation(Vector::Y * 1.5), asks).unwrap();
    server.step().unwrap();
    let _node = node(&server);
    let deadline = Instant::now() + LIMIT;
    while !server.is_lost() {
        assert!(Instant::now() < deadline, "it does not end");
        server.poll(Duration::from_millis(5));
    }
    let began = |server: &World| server.events().touches.iter().filter(|touch| touch.began).count();
    assert!(server.step().is_err());
    assert_eq!(began(&server), 1);
    assert!(server.step().is_err());
    assert_eq!(began(&server), 0);
}
