//! Tests explosions, water, wind and triggers: they follow physics and act on each body once, whatever
//! regions the world is cut into.

use dcd::network::ServeConfig;
use dcd::prelude::*;
use dcd::{Axis, Explosion, Fluid, Instead, Push, StepSettings, Unsupported};

/// Returns a world of 64 m around the origin, cut at these planes.
fn cut_at(planes: &[(Axis, f64)], coupling: Coupling) -> World {
    let step = StepSettings::default().with_coupling(coupling);
    let partitioning = Partitioning::Cuts(planes.to_vec());
    World::new(WorldConfig { partitioning, step, ..WorldConfig::default() }).unwrap()
}

const FOUR: [(Axis, f64); 2] = [(Axis::X, 0.0), (Axis::Z, 0.0)];

fn insert(world: &mut World, at: [f64; 3], collider: ColliderBuilder) -> BodyId {
    world.insert_at(WorldPose::at(at), RigidBodyBuilder::dynamic(), [collider]).unwrap()
}

/// Inserts boxes, balls and capsules around the origin, some on borders, all turned.
fn strew(world: &mut World) -> Vec<BodyId> {
    let mut bodies = Vec::new();
    for i in 0..48u32 {
        let place = |step: u32| f64::from((i * step) % 13) * 0.75 - 4.5;
        let collider = match i % 3 {
            0 => ColliderBuilder::cuboid(0.25, 0.125, 0.375),
            1 => ColliderBuilder::ball(0.25),
            _ => ColliderBuilder::capsule_y(0.25, 0.125),
        };
        let angle = Vector::new(0.3, 0.1, 0.2) * i as f32;
        let body = RigidBodyBuilder::dynamic().rotation(angle).angvel(Vector::Y).linvel(Vector::X);
        let pose = WorldPose {
            rotation: body.clone().build().rotation().to_array(),
            ..WorldPose::at([place(5), f64::from(i) * 0.5 - 12.0, place(7)])
        };
        bodies.push(world.insert_at(pose, body, [collider.density(500.0 + 20.0 * i as f32)]).unwrap());
    }
    bodies
}

fn velocities(world: &World, bodies: &[BodyId]) -> Vec<Velocity> {
    bodies.iter().map(|&body| world.velocity(body).unwrap()).collect()
}

#[test]
fn extra_mass_is_there_as_soon_as_its_body_is() {
    for (density, extra_kg) in [(1.0, 999.0), (0.0, 1_000.0)] {
        let mut world = cut_at(&[(Axis::X, 0.0)], Coupling::Auto);
        let step = StepSettings { gravity: [0.0; 3], ..world.settings().unwrap() };
        world.set_settings(step).unwrap();
        let body = RigidBodyBuilder::dynamic().additional_mass(extra_kg).can_sleep(false);
        let cube = ColliderBuilder::cuboid(0.5, 0.5, 0.5).density(density);
        let id = world.insert_at(WorldPose::at([2.0, 0.0, 0.0]), body, [cube]).unwrap();
        // In the other region the body is created again.
        for x in [2.0, -2.0] {
            world.set_pose(id, WorldPose::at([x, 0.0, 0.0])).unwrap();
            world.set_velocity(id, Velocity::default()).unwrap();
            world.push(&Push::impulse(id, [1_000.0, 0.0, 0.0])).unwrap();
            let speed = |world: &World| world.velocity(id).unwrap().linear[0];
            let before = speed(&world);
            world.step().unwrap();
            assert!([before, speed(&world)].iter().all(|speed| (speed - 1.0).abs() < 1e-3), "{before} m/s");
        }
    }
}

#[test]
fn what_is_set_aside_is_told_once() {
    let mut world = cut_at(&[], Coupling::Auto);
    let id = insert(&mut world, [0.0; 3], ColliderBuilder::ball(0.5).density(1.0));
    world.update(id, |body| body.set_linvel(Vector::new(f32::NAN, 0.0, 0.0), true)).unwrap();
    let told: Vec<_> = (0..3)
        .map(|_| {
            world.step().unwrap();
            world.stats().quarantined
        })
        .collect();
    assert_eq!(told, [1, 0, 0]);
}

#[test]
fn pushes_are_the_same_to_the_bit_in_one_region_and_in_four() {
    for coupling in [Coupling::Auto, Coupling::Overlap, Coupling::Owner] {
        let pushed = |planes: &[(Axis, f64)]| {
            let mut world = cut_at(planes, coupling);
            let bodies = strew(&mut world);
            let before = velocities(&world, &bodies);
            let counts = [
                world.explode(&Explosion { centre: [0.25, -1.0, 0.0], ..Explosion::default() }).unwrap(),
                world.flow(&Fluid { surface_m: -0.3, ..Fluid::default() }).unwrap(),
            ];
            let after = velocities(&world, &bodies);
            assert_eq!(world.region_count(), 1 << planes.len());
            let changed = before.iter().zip(&after).filter(|(before, after)| before != after).count();
            assert!(changed > 36, "{changed} of {} are pushed", bodies.len());
            (counts, after)
        };
        assert_eq!(pushed(&[]), pushed(&FOUR), "{coupling:?}");
    }
}

#[test]
fn bodies_that_several_regions_hold_are_pushed_once() {
    for coupling in [Coupling::Auto, Coupling::Overlap, Coupling::Owner] {
        let mut world = cut_at(&FOUR, coupling);
        world.set_settings(StepSettings { gravity: [0.0; 3], ..world.settings().unwrap() }).unwrap();
        let ball = insert(&mut world, [0.0; 3], ColliderBuilder::ball(0.5).mass(2.0));
        let touching = insert(&mut world, [1.0, 0.0, 0.0], ColliderBuilder::ball(0.5).mass(2.0));
        for _ in 0..10 {
            world.step().unwrap();
        }
        assert!(coupling != Coupling::Owner || world.owner(ball).holders > 1, "the test means to share it");
        let before = world.velocity(ball).unwrap();
        let blast = Explosion { centre: [0.0, -2.0, 0.0], impulse_ns_m2: 10.0, ..Explosion::default() };
        assert_eq!(world.explode(&blast).unwrap(), 2);
        let kick = world.velocity(ball).unwrap().linear[1] - before.linear[1];
        assert!((kick - 10.0 * std::f32::consts::PI * 0.25 / 2.0).abs() < 1e-3, "{coupling:?}: {kick}");
        assert!(world.velocity(touching).unwrap().linear[1] > 0.0);
        let (impulse, turn) = ([0.0, 0.0, 3.0], [0.0, 0.1, 0.0]);
        let before = world.velocity(ball).unwrap();
        world.push(&Push { angular: turn, ..Push::impulse(ball, impulse) }).unwrap();
        let after = world.velocity(ball).unwrap();
        // 2 kg, and 0.2 kg m² about the centre.
        let (speed, spin) = (after.linear[2] - before.linear[2], after.angular[1] - before.angular[1]);
        assert!((speed - 1.5).abs() < 1e-4 && (spin - 0.5).abs() < 1e-4, "{coupling:?}: {speed} {spin}");
    }
}

#[test]
fn an_explosion_is_symmetric_weakens_and_gives_the_light_more_speed() {
    let mut world = cut_at(&FOUR, Coupling::Auto);
    let side =
        [1.0, -1.0].map(|sign| [[2.0 * sign, 0.0, 0.0], [0.0, 2.0 * sign, 0.0], [0.0, 0.0, 2.0 * sign]]);
    let cube = || ColliderBuilder::cuboid(0.5, 0.5, 0.5).mass(4.0);
    let around: Vec<_> = side.iter().flatten().map(|&at| (at, insert(&mut world, at, cube()))).collect();
    let beyond = insert(&mut world, [5.5, 0.0, 0.0], cube().mass(1.0));
    let far = insert(&mut world, [-8.0, 0.0, 0.0], cube());
    let masked = insert(&mut world, [1.0, 1.0, 1.0], cube().collision_groups(InteractionGroups::none()));
    let fixed = world.insert(RigidBodyBuilder::fixed(), cube()).unwrap();
    let blast = Explosion { radius_m: 3.0, falloff_m: 4.0, impulse_ns_m2: 8.0, ..Explosion::default() };
    assert_eq!(world.explode(&blast).unwrap(), 7);
    for (at, body) in around {
        let Velocity { linear, angular } = world.velocity(body).unwrap();
        // A face of 1 m² and 4 kg: 2 m/s straight away.
        let exact = at.map(|v| v as f32);
        assert!((Vector::from(linear) - Vector::from(exact)).length() < 1e-5, "{at:?}: {linear:?}");
        assert!(Vector::from(angular).length() < 1e-5, "{at:?}: {angular:?}");
    }
    // Its nearest face is at 5 m, half way down the falloff, and it has a quarter of the mass.
    assert!((world.velocity(beyond).unwrap().linear[0] - 4.0).abs() < 1e-4);
    for still in [far, masked, fixed] {
        assert_eq!(world.velocity(still).unwrap(), Velocity::default());
    }
    let draw = Explosion { centre: [9.0, 0.0, 0.0], impulse_ns_m2: -8.0, ..blast };
    world.explode(&draw).unwrap();
    assert!(world.velocity(beyond).unwrap().linear[0] > 4.0, "it is drawn there");
    let limit = world.speed_limit_m_s();
    world.explode(&Explosion { impulse_ns_m2: 1e30, ..blast }).unwrap();
    assert!(world.velocity(beyond).unwrap().linear[0] <= 13.0 + limit);
}

#[test]
fn wind_presses_what_is_slanted_aside_and_what_is_alike_on_all_sides_not() {
    let mut world = cut_at(&FOUR, Coupling::Auto);
    world.set_settings(StepSettings { gravity: [0.0; 3], ..world.settings().unwrap() }).unwrap();
    let wind = Fluid {
        surface_m: f64::INFINITY,
        density_kg_m3: 1.2,
        velocity_m_s: [10.0, 0.0, 0.0],
        drag: 0.0,
        lift: 1.0,
        damping_per_s: 0.0,
        ..Fluid::default()
    };
    // A plate of 2 m by 2 m, turned about z. The second one is its mirror image.
    let mut plate = |at: [f64; 3], angle: f32| {
        let body = RigidBodyBuilder::dynamic().rotation(Vector::Z * angle);
        let rotation = body.clone().build().rotation().to_array();
        let sheet = ColliderBuilder::cuboid(1.0, 5e-4, 1.0).mass(4.0);
        world.insert_at(WorldPose { rotation, ..WorldPose::at(at) }, body, [sheet]).unwrap()
    };
    let plates =
        [0.5, -0.5, 0.0, 0.2].map(|angle| (angle, plate([f64::from(angle) * 20.0, 0.1, 0.1], angle)));
    let ball = insert(&mut world, [0.0, 8.0, 0.0], ColliderBuilder::ball(1.0).mass(4.0));
    world.flow(&wind).unwrap();
    for (angle, plate) in plates {
        let Velocity { linear, angular } = world.velocity(plate).unwrap();
        // ½ ρ l A sin v² along the normal, of which the share cos is across the wind; over 1/60 s and 4 kg,
        // as at the end of the step.
        let part = 0.5 * 1.2 * 4.0 * angle.sin() * angle.cos() * 10.0 / 60.0 / 4.0;
        let exact = 10.0 * part / (1.0 + part.abs());
        assert!((linear[1] - -exact).abs() < 0.02 * exact.abs() + 2e-3, "{angle}: {linear:?}, not {exact}");
        assert!(linear[0].abs() < 1e-4 && linear[2].abs() < 1e-4 && angular == [0.0; 3], "{linear:?}");
    }
    assert!(Vector::from(world.velocity(ball).unwrap().linear).length() < 1e-3);
    // A gale gives no more speed across the wind than along it.
    world.flow(&Fluid { density_kg_m3: 1e6, ..wind }).unwrap();
    for (_, plate) in plates {
        assert!(Vector::from(world.velocity(plate).unwrap().linear).length() < 15.0);
    }
}

#[test]
fn bodies_float_as_deep_as_archimedes_says() {
    let mut world = cut_at(&FOUR, Coupling::Auto);
    let lake = Fluid { surface_m: 3.0, drag: 0.5, damping_per_s: 2.0, ..Fluid::default() };
    // The depth of each body's lowest point: by volume, and for the ball at half its density to its centre.
    let floating = [
        (
            insert(&mut world, [0.0, 3.0, 0.0], ColliderBuilder::cuboid(0.5, 0.25, 0.5).density(600.0)),
            0.25,
            0.3,
        ),
        (insert(&mut world, [4.0, 2.0, 0.0], ColliderBuilder::ball(0.5).density(500.0)), 0.5, 0.5),
        (insert(&mut world, [0.0, 5.0, 4.0], ColliderBuilder::cylinder(0.2, 0.6).density(250.0)), 0.2, 0.1),
    ];
    let heavy = insert(&mut world, [-4.0, 2.0, 0.0], ColliderBuilder::ball(0.5).density(1500.0));
    insert(&mut world, [-4.0, 20.0, 4.0], ColliderBuilder::ball(0.5).density(500.0));
    let mut before = Vec::new();
    for _ in 0..1200 {
        before = floating.map(|(body, ..)| world.pose(body).unwrap().translation[1]).to_vec();
        world.flow(&lake).unwrap();
        world.step().unwrap();
    }
    for ((body, half_m, depth_m), before) in floating.into_iter().zip(before) {
        let at = world.pose(body).unwrap().translation[1];
        let depth = 3.0 - (at - half_m);
        assert!((depth - depth_m).abs() < 0.01, "{body}: {depth} m deep, not {depth_m}");
        assert!((at - before).abs() < 2e-5, "{body} rests: {} m in a step", at - before);
        // Lift acts at the beginning of a step, weight over its substeps.
        let falls = world.velocity(body).unwrap().linear[1];
        assert!((-0.082..0.001).contains(&falls), "{body}: {falls} m/s");
    }
    // The speed at which drag and damping balance the weight in water, of a ball of radius r, with
    // s = rho_fluid / rho_body: 3/8 s c v² / r + s d v = (1 - s) g.
    let [a, b, c] = [0.375 * 0.5 / 1.5 / 0.5, 2.0 / 1.5, -9.81 / 3.0];
    let exact = (f32::sqrt(b * b - 4.0 * a * c) - b) / (2.0 * a);
    let sinks = -world.velocity(heavy).unwrap().linear[1];
    // Within the change of one step.
    assert!((sinks / exact - 1.0).abs() < 0.03, "{sinks} m/s, not {exact}");
    assert_eq!(world.flow(&lake).unwrap(), 5, "what fell in is in it too");
}

#[test]
fn wind_carries_what_is_in_it_along_and_never_faster() {
    let mut world = cut_at(&FOUR, Coupling::Auto);
    world.set_settings(StepSettings { gravity: [0.0; 3], ..world.settings().unwrap() }).unwrap();
    let leaf = insert(&mut world, [-20.0, 0.0, 0.0], ColliderBuilder::cuboid(0.2, 0.01, 0.2).density(20.0));
    let stone = insert(&mut world, [-20.0, 4.0, 0.0], ColliderBuilder::ball(0.2).density(3000.0));
    let outside = insert(&mut world, [-20.0, 20.0, 0.0], ColliderBuilder::ball(0.2));
    let wind = Fluid {
        bounds: Bounds::around([0.0; 3], [60.0, 10.0, 60.0]),
        surface_m: f64::INFINITY,
        density_kg_m3: 1.2,
        velocity_m_s: [6.0, 0.0, 0.0],
        ..Fluid::default()
    };
    for _ in 0..240 {
        assert_eq!(world.flow(&wind).unwrap(), 2);
        world.step().unwrap();
        assert!(world.velocity(leaf).unwrap().linear[0] <= 6.0);
    }
    let speed = |body| world.velocity(body).unwrap().linear[0];
    assert!(speed(leaf) > 3.0 && (0.001..0.5).contains(&speed(stone)), "{}, {}", speed(leaf), speed(stone));
    assert_eq!(speed(outside), 0.0);
    let gale = Fluid { density_kg_m3: 1e6, ..wind };
    world.flow(&gale).unwrap();
    assert!((speed_of(&world, leaf) - 6.0).abs() < 0.01, "it is at one with it");
}

fn speed_of(world: &World, body: BodyId) -> f32 {
    world.velocity(body).unwrap().linear[0]
}

#[test]
fn a_trigger_lists_who_is_inside_across_borders_and_asleep() {
    for coupling in [Coupling::Auto, Coupling::Overlap, Coupling::Owner] {
        let mut world = cut_at(&FOUR, coupling);
        let floor = world
            .insert(
                RigidBodyBuilder::fixed().translation(Vector::Y * -0.5),
                ColliderBuilder::cuboid(20.0, 0.5, 20.0),
            )
            .unwrap();
        // One zone stands still across the borders of all four regions; a body of one region carries the
        // other across.
        let zone = ColliderBuilder::cuboid(2.0, 2.0, 2.0).sensor(true);
        let fixed = world.insert(RigidBodyBuilder::fixed(), zone.clone()).unwrap();
        let scanner = RigidBodyBuilder::kinematic_velocity_based().translation(Vector::new(-1.5, 1.0, 6.0));
        let scanner = world.insert(scanner, zone).unwrap();
        let within = [[-1.0, -1.0], [1.0, 1.0], [1.5, -1.5]]
            .map(|[x, z]| insert(&mut world, [x, 0.25, z], ColliderBuilder::cuboid(0.25, 0.25, 0.25)));
        let scanned = insert(&mut world, [0.3, 0.25, 6.0], ColliderBuilder::cuboid(0.25, 0.25, 0.25));
        let out = insert(&mut world, [4.0, 0.25, 0.0], ColliderBuilder::cuboid(0.25, 0.25, 0.25));
        assert_eq!(world.inside(fixed).unwrap(), within, "before any step");
        for _ in 0..240 {
            world.step().unwrap();
        }
        assert!(within.iter().chain([&scanned]).all(|&body| world.body(body).unwrap().sleeping));
        assert_ne!(
            world.owner(scanner).region,
            world.owner(scanned).region,
            "there is a border between them"
        );
        assert_eq!(world.inside(fixed).unwrap(), within, "{coupling:?}");
        assert_eq!(world.inside((fixed, 0)).unwrap(), within);
        assert_eq!(world.inside(scanner).unwrap(), [scanned], "{coupling:?}");
        world.set_pose(out, WorldPose::at([0.0, 1.0, 0.0])).unwrap();
        world.set_pose(within[1], WorldPose::at([9.0, 0.25, 0.0])).unwrap();
        assert_eq!(world.inside(fixed).unwrap(), [within[0], within[2], out]);
        let groups = InteractionGroups::none();
        world.update_collider(within[0], |collider| collider.set_collision_groups(groups)).unwrap();
        assert_eq!(world.inside(fixed).unwrap(), [within[2], out]);
        let refused = world.inside(floor).unwrap_err().to_string();
        assert!(refused.contains("sensor"), "{refused}");
        assert!(world.inside((fixed, 1)).is_err() && world.inside(BodyId::persistent(99)).is_err());
    }
}

#[test]
fn what_is_out_of_range_is_refused_by_name_and_nothing_is_pushed() {
    let mut world = cut_at(&[], Coupling::Auto);
    let ball = insert(&mut world, [0.0; 3], ColliderBuilder::ball(0.5));
    let (blast, water) = (Explosion::default(), Fluid::default());
    for (bad, word) in [
        (Explosion { centre: [f64::NAN, 0.0, 0.0], ..blast }, "centre"),
        (Explosion { radius_m: -1.0, ..blast }, "radius"),
        (Explosion { falloff_m: f32::INFINITY, ..blast }, "falloff"),
        (Explosion { impulse_ns_m2: f32::NAN, ..blast }, "impulse"),
    ] {
        let refused = world.explode(&bad).unwrap_err().to_string();
        assert!(refused.contains(word), "{refused}");
    }
    for (bad, word) in [
        (Fluid { bounds: Bounds { min: [1.0; 3], max: [0.0; 3] }, ..water }, "bounds"),
        (Fluid { surface_m: f64::NAN, ..water }, "surface"),
        (Fluid { density_kg_m3: -1.0, ..water }, "density"),
        (Fluid { drag: f32::INFINITY, ..water }, "drag"),
        (Fluid { lift: -1.0, ..water }, "lift"),
        (Fluid { velocity_m_s: [f32::NAN; 3], ..water }, "velocity"),
    ] {
        let refused = world.flow(&bad).unwrap_err().to_string();
        assert!(refused.contains(word), "{refused}");
    }
    assert_eq!(world.velocity(ball).unwrap(), Velocity::default());
}

#[test]
fn a_server_is_told_what_to_do_instead() {
    let scene = Scene::open("tower", &Params::default()).unwrap();
    let data = tempfile::tempdir().unwrap();
    let config = WorldConfig::for_scene(&scene);
    let mut server = World::serve(&scene, &config, ServeConfig::new(data.path())).unwrap();
    let said = |error| match error {
        Error::Unsupported(Unsupported { role: Role::Server, instead, .. }) => instead,
        other => panic!("{other}"),
    };
    assert_eq!(said(server.explode(&Explosion::default()).unwrap_err()), Instead::PushFound);
    assert_eq!(said(server.flow(&Fluid::default()).unwrap_err()), Instead::PushFound);
    assert_eq!(said(server.inside(BodyId::persistent(0)).unwrap_err()), Instead::SubmitQuery);
}

#[test]
fn pushes_go_onto_a_recording() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("blast.dcdr");
    let mut world = cut_at(&FOUR, Coupling::Auto);
    let bodies = strew(&mut world);
    world.record_to(&path).unwrap();
    for tick in 0..20 {
        if tick == 5 {
            assert!(world.explode(&Explosion::default()).unwrap() > 20);
        }
        world.flow(&Fluid { surface_m: -4.0, ..Fluid::default() }).unwrap();
        world.step().unwrap();
    }
    world.stop_recording().unwrap();
    assert!(bodies.iter().all(|&body| world.pose(body).is_some()));
    let mut replay = std::process::Command::new(env!("CARGO_BIN_EXE_dcd-under-test"));
    let said = replay.arg("replay").arg(&path).args(["--check", "--json"]).output().unwrap();
    let said = String::from_utf8_lossy(&said.stdout).into_owned();
    assert!(said.contains("\"ticks\":20") && said.contains("\"mismatch\":null"), "{said}");
}
