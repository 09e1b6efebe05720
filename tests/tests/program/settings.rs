//! Tests what a server's program sets: how often clients are told states, and what is looked at.

use dcd::protocol::Pace;
use dcd::{Fidelity, Instead, Viewpoint};

use super::*;

#[test]
fn clients_are_told_states_as_often_as_the_server_says() {
    let folder = tempfile::tempdir().unwrap();
    let mut server = serve(ServeConfig { state_every: 10, ..ServeConfig::new(folder.path()) });
    // A tenth of a metre per tick, so that its place tells the tick.
    let train = RigidBodyBuilder::kinematic_velocity_based().linvel(Vector::X * 6.0);
    let train = server.insert(train, ColliderBuilder::ball(0.5)).unwrap();
    server.step().unwrap();
    let _node = node(&server);
    let mut client = client(&server);
    let mut told: Vec<i64> = Vec::new();
    until("twenty states", &mut [&mut client], |worlds| {
        if let Some(pose) = worlds[0].pose(train) {
            told.push((pose.translation[0] * 10.0).round() as i64);
            told.dedup();
        }
        told.len() >= 20
    });
    // The first states, on joining, are of the world's present tick.
    assert!(told[4..].iter().all(|tick| tick % 10 == 0), "{told:?}");
    let config = ServeConfig { state_every: 31, ..ServeConfig::new(folder.path().join("other")) };
    let refused = World::new(cut()).unwrap().serve_copy(config).unwrap_err().to_string();
    assert!(refused.contains("state_every is 31"), "{refused}");
}

#[test]
fn what_a_servers_program_looks_at_is_computed_in_full_until_it_looks_away() {
    let folder = tempfile::tempdir().unwrap();
    let cuts = [-20.0, 0.0, 20.0].map(|x| (Axis::X, x));
    let config = WorldConfig {
        bounds: Bounds::around([0.0; 3], [40.0, 10.0, 10.0]),
        partitioning: Partitioning::Cuts(cuts.to_vec()),
        fidelity: Fidelity::Tolerance { m_s: 1e6 },
        ..WorldConfig::default()
    };
    let pace = Pace::Unpaced;
    let config = (config, ServeConfig { pace, ..ServeConfig::new(folder.path()) });
    let mut server = World::new(config.0).unwrap().serve_copy(config.1).unwrap();
    server.insert(RigidBodyBuilder::fixed(), ColliderBuilder::cuboid(40.0, 0.5, 10.0)).unwrap();
    for x in [-30.0, -10.0, 10.0, 30.0] {
        let body = RigidBodyBuilder::dynamic().translation(Vector::new(x, 1.0, 0.0)).can_sleep(false);
        server.insert(body, ColliderBuilder::cuboid(0.5, 0.5, 0.5)).unwrap();
    }
    let mut node = node(&server);
    let comes_to = |server: &mut World, levels: [usize; 3]| {
        let is_so = |worlds: &[&mut World]| worlds[0].fidelity_report().is_some_and(|it| it.levels == levels);
        until("its levels", &mut [server], is_so);
    };
    comes_to(&mut server, [0, 0, 4]);
    server.set_viewpoints(&[Viewpoint { at: [-30.0, 0.0, 0.0], radius_m: 1.0 }]).unwrap();
    comes_to(&mut server, [1, 0, 3]);
    server.set_viewpoints(&[]).unwrap();
    comes_to(&mut server, [0, 0, 4]);
    let unfit = server.set_viewpoints(&[Viewpoint { at: [f64::NAN; 3], radius_m: 1.0 }]);
    assert!(unfit.unwrap_err().to_string().contains("finite"));
    let mut client = client(&server);
    for (world, remedy) in [(&mut node, Instead::JoinAsClient), (&mut client, Instead::SayInterest)] {
        let Err(Error::Unsupported(refused)) = world.set_viewpoints(&[]) else { panic!("it does not look") };
        assert_eq!(refused.instead, remedy);
    }
}
