//! Tests worlds that compute less where nobody looks: no body is lost, what is in sight is as if all were
//! computed in full, time neither stands still nor runs twice, and the error is as stated.

use std::collections::{BTreeMap, BTreeSet};

use dcd::physics::Measured as _;
use dcd::prelude::*;
use dcd::runtime::LocalWorld;
use dcd::scene::SceneBody;
use dcd::space::{Axis, BodyId};
use dcd::{Coupling, Fidelity, Push, Viewpoint};

/// All regions except those in sight come to be stepped in every fourth tick.
const ALL_COARSE: Fidelity = Fidelity::Tolerance { m_s: 1e6 };

fn town(cars: usize) -> Scene {
    Scene::open("town", &Params::default().with("n", 1_200).with("cars", cars)).unwrap()
}

fn world(scene: &Scene, fidelity: Fidelity, threads: usize) -> LocalWorld {
    LocalWorld::from_scene(scene, WorldConfig { fidelity, threads, ..WorldConfig::for_scene(scene) }).unwrap()
}

/// Returns an empty world of this many regions along x, 20 m each.
fn row(regions: usize, fidelity: Fidelity, gravity: [f32; 3]) -> LocalWorld {
    row_of(regions, fidelity, gravity, Coupling::Auto)
}

fn row_of(regions: usize, fidelity: Fidelity, gravity: [f32; 3], coupling: Coupling) -> LocalWorld {
    let half_m = 10.0 * regions as f64;
    let mut config = WorldConfig {
        bounds: Bounds::around([0.0; 3], [half_m, 20.0, 20.0]),
        partitioning: Partitioning::Cuts((1..regions).map(|k| (Axis::X, 20.0 * k as f64 - half_m)).collect()),
        fidelity,
        ..WorldConfig::default()
    };
    config.step = config.step.with_coupling(coupling);
    config.step.gravity = gravity;
    LocalWorld::new(config).unwrap()
}

fn run(world: &mut LocalWorld, ticks: usize) {
    for _ in 0..ticks {
        world.step().unwrap();
    }
}

fn levels(world: &LocalWorld) -> [usize; 3] {
    world.fidelity_report().unwrap().levels
}

/// Returns the place of a body at the present tick, extrapolated if its region is behind.
fn now(world: &LocalWorld, id: BodyId) -> [f64; 3] {
    let (region, handle) = world.host().owned(id).unwrap();
    let late_s = f64::from(world.host().behind(region.id())) / 60.0;
    let (pose, velocity) = region.motion(handle);
    std::array::from_fn(|i| pose.translation[i] + f64::from(velocity.linear[i]) * late_s)
}

#[test]
fn a_town_loses_nothing_and_is_the_same_by_any_threads_and_after_a_snapshot() {
    let scene = town(4);
    let mut worlds = [1, 2].map(|threads| world(&scene, Fidelity::AUTO, threads));
    let bodies = worlds[0].states().count();
    worlds.iter_mut().for_each(|world| run(world, 150));
    let mut saved = Vec::new();
    worlds[0].save(&mut saved).unwrap();
    let mut restored = LocalWorld::restore(saved.as_slice(), 1).unwrap();
    worlds.iter_mut().for_each(|world| run(world, 150));
    run(&mut restored, 150);
    for world in worlds.iter().chain([&restored]) {
        assert_eq!(world.states().count(), bodies);
        assert_eq!(world.host().validate(), []);
        assert_eq!(world.state_hash(), worlds[0].state_hash());
        assert_eq!(levels(world), levels(&worlds[0]));
    }
    assert!(levels(&worlds[0])[2] >= 10, "{:?}", levels(&worlds[0]));
    assert!(worlds[0].stats().transfers >= 8, "cars pass from region to region: {:?}", worlds[0].stats());
}

#[test]
fn a_budget_that_cannot_be_kept_loses_and_doubles_no_body_and_counts_what_is_over() {
    // A tenth of a microsecond.
    let mut world = world(&town(4), Fidelity::Budget { tick_ms: 1e-4 }, 2);
    let bodies: Vec<_> = world.states().map(|(id, ..)| id).collect();
    // The first second does not count.
    run(&mut world, 60);
    assert_eq!(world.fidelity_report().unwrap().overruns, 0);
    for over in 1..=240 {
        world.step().unwrap();
        let census = world.census();
        assert_eq!((census.lost(&bodies), census.doubled()), (0, 0), "{over}");
        assert_eq!(world.fidelity_report().unwrap().overruns, over);
    }
    assert_eq!(world.host().validate(), []);
    let shed = levels(&world);
    assert!(shed[2] >= 22 && shed.iter().sum::<usize>() == 24, "what is looked at is shed, too: {shed:?}");
    assert!(world.stats().transfers >= 8, "cars pass from region to region: {:?}", world.stats());
}

#[test]
fn what_is_looked_at_is_bit_for_bit_as_if_all_were_computed_in_full() {
    let scene = town(0);
    let view = scene.viewpoints[0];
    let [mut full, mut part] = [ALL_COARSE; 2].map(|fidelity| world(&scene, fidelity, 1));
    // Without viewpoints, everything counts as looked at.
    full.set_viewpoints(&[]).unwrap();
    run(&mut full, 240);
    run(&mut part, 240);
    assert!(levels(&part)[2] >= 12, "{:?}", levels(&part));
    let (mut seen, mut others) = (0, 0);
    for (id, _, pose, velocity) in full.states() {
        let is_seen = (0..3).all(|i| (pose.translation[i] - view.at[i]).abs() < 50.0);
        if is_seen {
            seen += 1;
            assert_eq!(part.motion(id), Some((pose, velocity)), "{id}");
        } else {
            others += usize::from(part.motion(id) != Some((pose, velocity)));
        }
    }
    assert!(seen > 150 && others > 300, "{seen} are seen, {others} of the others differ");
}

/// Returns the ball that is shot at the wall in sight.
fn shot(town: &mut Scene) -> (BodyId, &mut SceneBody) {
    let (index, ball) = town.bodies.iter_mut().enumerate().find(|(_, body)| body.body.ccd_enabled).unwrap();
    (BodyId::persistent(index as u32), ball)
}

#[test]
fn what_is_looked_at_is_bit_for_bit_as_without_fidelity_and_loads_overlap_no_deeper() {
    // The ball of 4,000 kg is supported by bricks of a quarter of its mass: fidelity computes that finer.
    for (ball_kg, is_load) in [(5.0, false), (4_000.0, true)] {
        let mut scene = town(0);
        let view = scene.viewpoints[0];
        let (id, ball) = shot(&mut scene);
        ball.colliders = vec![ColliderBuilder::ball(1.0).mass(ball_kg)];
        let mut worlds = [Fidelity::Off, Fidelity::AUTO].map(|fidelity| world(&scene, fidelity, 1));
        let hit = worlds[0].host().owned(id).unwrap().0.id();
        let mut overlaps_m = [0.0; 2];
        for _ in 0..240 {
            for (world, overlaps_m) in worlds.iter_mut().zip(&mut overlaps_m) {
                world.step().unwrap();
                let of_hit = world.states().filter(|state| state.1 == hit).map(|(id, ..)| id);
                *overlaps_m += of_hit.map(|id| overlap_m(world, id)).sum::<f64>();
            }
        }
        let [off, auto] = &worlds;
        assert!(levels(auto)[2] >= 12, "{:?}", levels(auto));
        let is_seen = |place: [f64; 3]| (0..3).all(|i| (place[i] - view.at[i]).abs() < 50.0);
        let (mut same, mut other) = (0, 0);
        for (id, region, pose, velocity) in off.states().filter(|state| is_seen(state.2.translation)) {
            let is_same = auto.motion(id) == Some((pose, velocity));
            assert!(is_same || (is_load && region == hit), "{id}, a ball of {ball_kg} kg");
            *(if is_same { &mut same } else { &mut other }) += 1;
        }
        println!(
            "a ball of {ball_kg} kg: {same} bodies are the same, {other} are not; overlaps of the wall {overlaps_m:?}"
        );
        assert!(same > 110 && (other > 20) == is_load, "{same} {other}");
        assert!(overlaps_m[1] <= 1.1 * overlaps_m[0], "{overlaps_m:?}");
    }
}

#[test]
fn what_flies_through_regions_of_unlike_rates_keeps_its_time() {
    let mut world = row(8, ALL_COARSE, [0.0; 3]);
    world.set_viewpoints(&[Viewpoint { at: [10.0, 0.0, 0.0], radius_m: 3.0 }]).unwrap();
    let mut balls = Vec::new();
    for i in 0..12_u8 {
        let speed = (3.0 + 4.0 * f32::from(i)) * if i % 2 == 0 { 1.0 } else { -1.0 };
        let from = [f64::from(-speed.signum() * 70.0), 0.0, 1.5 * f64::from(i) - 8.0];
        let ball = RigidBodyBuilder::dynamic().linvel(Vector::X * speed).can_sleep(false);
        let ball = world.insert_at(WorldPose::at(from), ball, [ColliderBuilder::ball(0.3)]).unwrap();
        balls.push((ball, from, f64::from(speed)));
    }
    let mut rates = BTreeSet::new();
    for tick in 1..=200 {
        world.step().unwrap();
        rates.insert(levels(&world).map(|count| count > 0));
        for &(ball, from, speed) in &balls {
            let off_m = now(&world, ball)[0] - (from[0] + speed * f64::from(tick) / 60.0);
            assert!(off_m.abs() < 1e-3, "{ball} is {off_m} m off at tick {tick}");
            let (region, handle) = world.host().owned(ball).unwrap();
            let x = region.motion(handle).0.translation[0];
            let outside_m = (region.cell().min[0] - x).max(x - region.cell().max[0]);
            assert!(
                outside_m < speed.abs() * 10.0 / 60.0,
                "{ball} is {outside_m} m outside of its region at tick {tick}"
            );
        }
    }
    assert!(rates.contains(&[true, false, true]), "{rates:?}");
    assert!(world.stats().transfers >= 24, "{:?}", world.stats());
}

#[test]
fn what_meets_at_a_border_of_unlike_rates_collides_as_in_one_world() {
    for speed in [1.0, 8.0, 30.0] {
        let mut world = row(2, ALL_COARSE, [0.0; 3]);
        // The right region is in sight. The left one is not, until its ball meets the other one.
        world.set_viewpoints(&[Viewpoint { at: [15.0, 0.0, 0.0], radius_m: 5.0 }]).unwrap();
        let mut ball = |x: f64, speed: f32| {
            let body =
                RigidBodyBuilder::dynamic().linvel(Vector::X * speed).can_sleep(false).ccd_enabled(true);
            let shape = ColliderBuilder::ball(0.5).restitution(1.0).friction(0.0);
            world.insert_at(WorldPose::at([x, 0.0, 0.0]), body, [shape]).unwrap()
        };
        // They meet at the border.
        let way_m = f64::from(speed) * 2.0 + 0.5;
        let (left, right) = (ball(-way_m.min(19.0), speed), ball(way_m.min(19.0), -speed));
        run(&mut world, 90);
        assert!(levels(&world)[2] == 1, "{:?}", levels(&world));
        run(&mut world, 60);
        let velocity = |id| world.velocity(id).unwrap().linear[0];
        let momentum = velocity(left) + velocity(right);
        assert!(momentum.abs() < 1e-3 * speed, "{speed} m/s: momentum {momentum}");
        assert!((velocity(right) - speed).abs() < 0.02 * speed, "{speed} m/s: away at {}", velocity(right));
    }
}

#[test]
fn towers_that_nobody_looks_at_stand() {
    let mut world = row(4, ALL_COARSE, [0.0, -9.81, 0.0]);
    world.set_viewpoints(&[Viewpoint { at: [35.0, 0.0, 0.0], radius_m: 1.0 }]).unwrap();
    world
        .insert(
            RigidBodyBuilder::fixed().translation(Vector::Y * -0.5),
            ColliderBuilder::cuboid(40.0, 0.5, 10.0),
        )
        .unwrap();
    let mut tops = Vec::new();
    for x in [-30.0_f32, -20.0, -10.0] {
        for level in 0..10_u8 {
            let body = RigidBodyBuilder::dynamic().translation(Vector::new(x, f32::from(level) + 0.5, 0.0));
            let id = world.insert(body.can_sleep(false), ColliderBuilder::cuboid(0.5, 0.5, 0.5)).unwrap();
            if level == 9 {
                tops.push(id);
            }
        }
    }
    run(&mut world, 600);
    assert_eq!(levels(&world), [1, 0, 3]);
    for top in tops {
        let height_m = world.pose(top).unwrap().translation[1];
        assert!((9.3..9.52).contains(&height_m), "{height_m} m");
    }
}

/// Runs a scene that is seen only from `at`. Returns its energy afterwards, the deepest overlap of the last
/// second, and the numbers of regions by rate.
fn far_away(scene: &Scene, at: [f64; 3], fidelity: Fidelity) -> (f64, f64, [usize; 3]) {
    let mut world = world(scene, fidelity, 1);
    world.set_viewpoints(&[Viewpoint { at, radius_m: 10.0 }]).unwrap();
    run(&mut world, 240);
    let mut deepest_m: f64 = 0.0;
    for _ in 0..60 {
        world.step().unwrap();
        deepest_m = deepest_m.max(world.contacts().max_penetration_m);
    }
    (world.energy_j(), deepest_m, world.fidelity_report().map_or([0; 3], |report| report.levels))
}

#[test]
fn a_convoy_keeps_its_speed_where_nobody_looks() {
    for (speed, most_lost, rates) in [(10.0, 0.03, 2..5), (31.0, 0.0, 0..3)] {
        let params = Params::default().with("cars", 30).with("road", 1_500.0).with("speed", speed);
        let mut scene = Scene::open("convoy", &params).unwrap();
        scene.regions = Some(5);
        let [full, auto] =
            [Fidelity::Off, Fidelity::AUTO].map(|fidelity| far_away(&scene, [1_500.0, 0.0, 0.0], fidelity));
        let lost = 1.0 - auto.0 / full.0;
        println!("{speed} m/s: {lost} of the energy lost, {:?}", auto.2);
        assert!(lost.abs() <= most_lost, "{lost}");
        assert!(rates.contains(&(auto.2[1] + auto.2[2])), "{:?}", auto.2);
    }
}

#[test]
fn what_is_shot_and_what_tumbles_overlaps_no_deeper_where_nobody_looks() {
    let params = Params::default().with("width", 40).with("height", 20).with("shot", 30.0);
    let mut wall = Scene::open("wall", &params).unwrap();
    wall.regions = Some(4);
    for (name, scene, at, most_m) in
        [("wall", &wall, [-200.0, 0.0, 0.0], 0.01), ("town", &town(0), [-400.0, 0.0, 0.0], 0.05)]
    {
        let [full, auto] = [Fidelity::Off, Fidelity::AUTO].map(|fidelity| far_away(scene, at, fidelity));
        println!("{name}: {} m deep, {} m in full; {:?}", auto.1, full.1, auto.2);
        assert!(auto.1 <= full.1 + most_m, "{name}: {} m deep, {} m in full", auto.1, full.1);
        assert!(auto.2[2] >= 3, "{name}: {:?}", auto.2);
    }
}

#[test]
fn what_a_program_ties_where_nobody_looks_holds() {
    let mut world = row(4, ALL_COARSE, [0.0, -9.81, 0.0]);
    world.set_viewpoints(&[Viewpoint { at: [35.0, 0.0, 0.0], radius_m: 1.0 }]).unwrap();
    run(&mut world, 70);
    // At a tick at which regions are behind: across the border at -20, and away from it.
    for from_m in [-22.0_f64, -8.0] {
        let nail = world
            .insert_at(
                WorldPose::at([from_m, 5.0, 0.0]),
                RigidBodyBuilder::fixed(),
                [ColliderBuilder::ball(0.1)],
            )
            .unwrap();
        let mut above = nail;
        let mut chain = Vec::new();
        for i in 1..=6 {
            let at = WorldPose::at([from_m + 0.6 * f64::from(i), 5.0, 0.0]);
            let link =
                world.insert_at(at, RigidBodyBuilder::dynamic(), [ColliderBuilder::ball(0.2)]).unwrap();
            let joint =
                SphericalJointBuilder::new().local_anchor1(Vector::X * 0.3).local_anchor2(Vector::X * -0.3);
            world.insert_joint(above, link, joint).unwrap();
            chain.push(link);
            above = link;
        }
        run(&mut world, 241);
        assert_eq!(world.host().validate(), []);
        let mut before = [from_m, 5.0, 0.0];
        for link in chain {
            let place = world.pose(link).unwrap().translation;
            let apart = (0..3).map(|i| (place[i] - before[i]).powi(2)).sum::<f64>().sqrt();
            assert!(apart < 0.65, "{link} is {apart} m from the one before it");
            before = place;
        }
    }
    assert_eq!(levels(&world)[2], 3);
}

/// Returns four regions in a row, of which the last one is seen, on a floor of half a metre.
fn unseen(fidelity: Fidelity) -> LocalWorld {
    let mut world = row(4, fidelity, [0.0, -9.81, 0.0]);
    world.set_viewpoints(&[Viewpoint { at: [35.0, 0.0, 0.0], radius_m: 1.0 }]).unwrap();
    let floor = RigidBodyBuilder::fixed().translation(Vector::Y * -0.25);
    world.insert(floor, ColliderBuilder::cuboid(80.0, 0.25, 40.0)).unwrap();
    world
}

/// Returns whether the region of a body is behind the present.
fn is_late(world: &LocalWorld, id: BodyId) -> bool {
    world.owner_of(id).is_some_and(|region| world.host().behind(region) > 0)
}

/// Boxes fall onto boxes that lie there, at 24 m/s: 1.6 m in four ticks.
#[test]
fn what_falls_fast_where_nobody_looks_pushes_nothing_through_the_floor() {
    let mut world = unseen(Fidelity::AUTO);
    let mut boxes = Vec::new();
    for i in 0..135_u8 {
        let (x, z) = (4.0 * f32::from(i / 9) - 38.0, 4.0 * f32::from(i % 9) - 16.0);
        let aside = Vector::new((7.0 * f32::from(i)).sin(), 0.0, (11.0 * f32::from(i)).cos()) * 0.3;
        for (height_m, aside) in [(0.5, Vector::ZERO), (29.0, aside)] {
            let body = RigidBodyBuilder::dynamic().translation(Vector::new(x, height_m, z) + aside);
            boxes.push(world.insert(body, ColliderBuilder::cuboid(0.5, 0.5, 0.5)).unwrap());
        }
    }
    let mut coarse = 0;
    for _ in 0..300 {
        world.step().unwrap();
        coarse += levels(&world)[2];
    }
    assert!(coarse > 100, "the test needs regions at a quarter of the rate: {coarse}");
    let below = boxes.iter().filter(|&&id| world.pose(id).unwrap().translation[1] < -0.3).count();
    assert_eq!(below, 0, "of {} boxes", boxes.len());
}

#[test]
fn what_a_program_sets_for_one_tick_counts_for_one_tick_where_nobody_looks() {
    let mut world = row(4, ALL_COARSE, [0.0; 3]);
    world.set_viewpoints(&[Viewpoint { at: [35.0, 0.0, 0.0], radius_m: 1.0 }]).unwrap();
    let mut insert = |x: f64, z: f64, body: RigidBodyBuilder| {
        world.insert_at(WorldPose::at([x, 0.0, z]), body, [ColliderBuilder::ball(0.3).mass(2.0)]).unwrap()
    };
    let places = (0..24_u8).map(|i| 2.0 * f64::from(i) - 38.0);
    let pairs: Vec<_> = places
        .map(|x| {
            let ball = insert(x, 0.0, RigidBodyBuilder::dynamic().can_sleep(false));
            (x, ball, insert(x, 5.0, RigidBodyBuilder::kinematic_velocity_based()))
        })
        .collect();
    run(&mut world, 100);
    let mut late = 0;
    for (x, ball, door) in pairs {
        late += usize::from(is_late(&world, ball));
        for (force_n, speed) in [(120.0, 6.0), (0.0, 0.0)] {
            world.push(&Push::force(ball, [0.0, force_n, 0.0], [0.0; 3])).unwrap();
            world.set_velocity(door, Velocity::linear([speed, 0.0, 0.0])).unwrap();
            run(&mut world, 1);
        }
        run(&mut world, 11);
        let (gained, gone) =
            (world.velocity(ball).unwrap().linear[1], world.pose(door).unwrap().translation[0] - x);
        assert!((gained - 1.0).abs() < 1e-4 && (gone - 0.1).abs() < 1e-4, "{gained} m/s, {gone} m");
    }
    assert!(late > 8, "{late} of 24 were in regions that were behind");
    assert_eq!(levels(&world), [1, 0, 3]);
}

#[test]
fn what_a_program_removes_where_nobody_looks_lets_go_in_the_next_tick() {
    let mut world = unseen(ALL_COARSE);
    let boxes: Vec<_> = (0..20_u8)
        .map(|i| {
            let at = Vector::new(2.0 * f32::from(i) - 38.0, 0.5, 0.0);
            let body = RigidBodyBuilder::dynamic().translation(at).can_sleep(false);
            let shape = ColliderBuilder::cuboid(0.5, 0.5, 0.5);
            world.insert(body, shape.active_events(ActiveEvents::COLLISION_EVENTS)).unwrap()
        })
        .collect();
    run(&mut world, 100);
    let mut late = 0;
    for id in boxes {
        late += usize::from(is_late(&world, id));
        world.remove(id).unwrap();
        run(&mut world, 1);
        let touches = world.events().touches.iter();
        let of_it = touches.filter(|touch| [touch.key.a, touch.key.b].contains(&id));
        let ends: Vec<_> = of_it.map(|touch| touch.began).collect();
        assert_eq!(ends, [false], "of {id}");
        run(&mut world, 12);
    }
    assert!(late > 5, "{late} of 20 were in regions that were behind");
}

/// Platforms that go to and fro and up and down, as their program says in each tick.
#[test]
fn who_rides_where_nobody_looks_keeps_its_place() {
    let cuts = [-20.0, 0.0, 20.0].map(|x| (Axis::X, x));
    let mut world = World::new(WorldConfig {
        bounds: Bounds::around([0.0; 3], [40.0, 20.0, 20.0]),
        partitioning: Partitioning::Cuts(cuts.to_vec()),
        fidelity: ALL_COARSE,
        ..WorldConfig::default()
    })
    .unwrap();
    world.set_viewpoints(&[Viewpoint { at: [35.0, 0.0, 0.0], radius_m: 1.0 }]).unwrap();
    let floor = RigidBodyBuilder::fixed().translation(Vector::Y * -0.5);
    world.insert(floor, ColliderBuilder::cuboid(80.0, 0.5, 40.0)).unwrap();
    let rides: Vec<_> = [-30.0, -10.0, 10.0]
        .map(|x| {
            let body = RigidBodyBuilder::kinematic_velocity_based;
            let platform = [ColliderBuilder::cuboid(2.0, 0.2, 2.0)];
            let platform = world.insert_at(WorldPose::at([x, 3.0, 0.0]), body(), platform).unwrap();
            let (at, capsule) = (WorldPose::at([x - 1.0, 3.95, 0.0]), [ColliderBuilder::capsule_y(0.4, 0.3)]);
            (platform, world.insert_character(at, &Character::default(), body(), capsule).unwrap())
        })
        .to_vec();
    for tick in 0..700_u16 {
        let turn = f32::from(tick.saturating_sub(200)) / 30.0;
        let velocity = Velocity::linear([1.5 * turn.sin(), (0.6 * turn).sin(), 0.0]);
        for (platform, _) in rides.iter().filter(|_| tick >= 200) {
            world.set_velocity(*platform, velocity).unwrap();
        }
        world.step().unwrap();
    }
    for (platform, rider) in rides {
        let [on, at] = [platform, rider].map(|id| world.pose(id).unwrap().translation);
        let off: [f64; 3] = std::array::from_fn(|i| at[i] - on[i] - [-1.0, 0.92, 0.0][i]);
        assert!(length(off) < 0.1, "{rider} is {off:?} m from its place");
    }
}

#[test]
fn what_a_program_does_where_nobody_looks_is_the_same_by_any_threads_and_after_a_snapshot() {
    let scene = town(4);
    let mut worlds: Vec<_> = [1, 2].map(|threads| world(&scene, Fidelity::AUTO, threads)).into();
    let ids: Vec<_> = worlds[0].states().map(|(id, ..)| id).collect();
    let pushed = |tick: usize| ids[37 * tick % ids.len()];
    let push = |world: &mut LocalWorld, tick| {
        world.push(&Push::impulse(pushed(tick), [0.0, 1.0, 0.0])).unwrap();
    };
    worlds.iter_mut().for_each(|world| run(world, 120));
    worlds.iter_mut().for_each(|world| push(world, 120));
    let mut saved = Vec::new();
    worlds[0].save(&mut saved).unwrap();
    worlds.push(LocalWorld::restore(saved.as_slice(), 1).unwrap());
    worlds.iter_mut().for_each(|world| run(world, 1));
    let mut late = 0;
    for tick in (123..240).step_by(3) {
        late += usize::from(is_late(&worlds[0], pushed(tick)));
        for world in &mut worlds {
            push(world, tick);
            run(world, 3);
        }
    }
    for world in &worlds {
        assert_eq!(world.states().count(), ids.len());
        assert_eq!(world.host().validate(), []);
        assert_eq!(world.state_hash(), worlds[0].state_hash());
        assert_eq!(world.stats().transfers, worlds[0].stats().transfers);
    }
    assert!(late > 5, "{late} were in regions that were behind");
}

/// Returns how far a tower sags under a load of 100:1, and how far a chain with a bob of 1000:1 stretches,
/// metres.
fn strain(fidelity: Fidelity) -> [f64; 2] {
    let tower =
        Scene::open("tower", &Params::default().with("top_mass_ratio", 100).with("sleep", 0)).unwrap();
    let mut standing = world(&tower, fidelity, 1);
    let top = standing.states().map(|(id, ..)| id).last().unwrap();
    let height_m = |world: &LocalWorld| world.pose(top).unwrap().translation[1];
    let begin_m = height_m(&standing);
    run(&mut standing, 300);
    let chain = Scene::open("chain", &Params::default().with("bob_mass_ratio", 1_000)).unwrap();
    let mut hanging = world(&chain, fidelity, 1);
    let bob = hanging.states().map(|(id, ..)| id).last().unwrap();
    let low_m = |world: &LocalWorld| world.pose(bob).unwrap().translation[1];
    let before_m = low_m(&hanging);
    run(&mut hanging, 300);
    [begin_m - height_m(&standing), before_m - low_m(&hanging)]
}

#[test]
fn loads_out_of_proportion_are_computed_finer() {
    let [plain, fine] = [Fidelity::Off, Fidelity::AUTO].map(strain);
    println!("sag and stretch: {plain:?} m in full, {fine:?} m finer");
    for (plain_m, fine_m) in plain.into_iter().zip(fine) {
        assert!(plain_m > 0.05 && fine_m < 0.25 * plain_m, "{plain_m} m, finer {fine_m} m");
    }
}

/// What was shown on a walk through the town.
#[derive(Default)]
struct Walk {
    /// The place of each body in sight, by tick.
    places: BTreeMap<(u32, BodyId), [f64; 3]>,
    /// The longest jump of each body: by how many metres it went beyond where its velocity led in a tick.
    jumps_m: BTreeMap<BodyId, f64>,
    /// The same without the ticks in which the body collided.
    free_jumps_m: BTreeMap<BodyId, f64>,
    /// The bodies in sight that collided.
    collided: BTreeSet<BodyId>,
    /// The bodies that were behind the present at some time.
    late: BTreeSet<BodyId>,
    /// The number of regions at the lowest rate, summed over ticks.
    coarse: usize,
}

/// Walks through the town at 20 m/s.
fn walk(scene: &Scene, fidelity: Fidelity) -> Walk {
    /// A body that is slowed by more than this, or lies deeper in another, is pushed out of it: it collides.
    const SLOWED_M_S: f64 = 0.5;
    const DEEP_M: f64 = 0.002;
    let mut world = world(scene, fidelity, 2);
    let mut before = BTreeMap::<BodyId, ([f64; 3], [f64; 3], f64)>::new();
    let mut walk = Walk::default();
    for tick in 0..360_u32 {
        let at = [-150.0 + f64::from(tick) / 3.0, 2.0, -60.0];
        let view = Viewpoint { at, radius_m: 40.0 };
        world.set_viewpoints(&[view]).unwrap();
        world.step().unwrap();
        let late = world.states().filter(|state| world.host().behind(state.1) > 0);
        walk.late.extend(late.map(|(id, ..)| id));
        walk.coarse += world.fidelity_report().map_or(0, |report| report.levels[2]);
        let off = |place: [f64; 3]| length(std::array::from_fn(|i| place[i] - at[i]));
        let mut shown = BTreeMap::new();
        for (id, region, pose, velocity) in
            world.states().filter(|state| off(state.2.translation) < view.radius_m)
        {
            assert_eq!(world.host().behind(region), 0, "{id} is seen late at tick {tick}");
            let (to, now_m_s, deep_m) =
                (pose.translation, velocity.linear.map(f64::from), overlap_m(&world, id));
            shown.insert(id, (to, now_m_s, deep_m));
            walk.places.insert((tick, id), to);
            let Some((from, then_m_s, was_deep_m)) = before.get(&id) else { continue };
            let beyond = |i: usize| to[i] - from[i] - (then_m_s[i] + now_m_s[i]) / 120.0;
            let slowed_m_s = length(std::array::from_fn(|i| now_m_s[i] - then_m_s[i]));
            let jump_m = length(std::array::from_fn(beyond));
            let note = |jumps_m: &mut BTreeMap<BodyId, f64>| {
                let most_m = jumps_m.entry(id).or_default();
                *most_m = most_m.max(jump_m);
            };
            note(&mut walk.jumps_m);
            if slowed_m_s < SLOWED_M_S && deep_m.max(*was_deep_m) < DEEP_M {
                note(&mut walk.free_jumps_m);
            } else {
                walk.collided.insert(id);
            }
        }
        before = shown;
    }
    walk
}

fn length(of: [f64; 3]) -> f64 {
    of.map(|v| v * v).iter().sum::<f64>().sqrt()
}

/// Returns how deep a body lies in another, metres.
fn overlap_m(world: &LocalWorld, id: BodyId) -> f64 {
    let (region, handle) = world.host().owned(id).unwrap();
    let physics = region.physics();
    let colliders = physics.bodies[handle].colliders().iter();
    let pairs = colliders.flat_map(|&collider| physics.narrow_phase.contact_pairs_with(collider));
    let deepest = pairs.filter_map(|pair| pair.find_deepest_contact());
    deepest.map(|(_, contact)| f64::from(-contact.dist)).fold(0.0, f64::max)
}

#[test]
fn what_comes_into_sight_does_not_jump() {
    const DRIFTING: u8 = 24;
    let mut scene = town(6);
    // Rapier itself stops a shot body that tumbles over the ground for a tick.
    shot(&mut scene).1.body.linvel = Vector::ZERO;
    // Above what is out of sight at first. Everything else that moves there collides all the time.
    let drifting: BTreeSet<_> = (0..DRIFTING)
        .map(|i| {
            let along = f32::from(i) - 0.5 * f32::from(DRIFTING);
            let body = RigidBodyBuilder::dynamic().gravity_scale(0.0).can_sleep(false);
            let body = body.linvel(Vector::new(0.3 * along, 0.0, if i % 2 == 0 { 5.0 } else { -5.0 }));
            let at = [3.0 * f64::from(along), 15.0 + f64::from(i % 5), -60.0 + f64::from(along)];
            scene.push(WorldPose::at(at), body, ColliderBuilder::ball(0.3))
        })
        .map(|index| BodyId::persistent(index as u32))
        .collect();
    let [full, part] = [Fidelity::Off, ALL_COARSE].map(|fidelity| walk(&scene, fidelity));
    let mut drifted = 0;
    for ((tick, id), place) in part.places.iter().filter(|((_, id), _)| drifting.contains(id)) {
        let Some(twin) = full.places.get(&(*tick, *id)) else { continue };
        let off_m = length(std::array::from_fn(|i| place[i] - twin[i]));
        assert!(off_m < 0.002, "{id} is {off_m} m from where it would be at full rate, at tick {tick}");
        drifted += 1;
    }
    let (mut in_time, mut calm, mut others) = (0, 0, 0);
    for (id, all_m) in &part.jumps_m {
        // A body that was behind and collides does so elsewhere, and otherwise, than at full rate.
        let (jump_m, counted) = match part.late.contains(id) {
            false => (Some(all_m), &mut in_time),
            true if !full.collided.contains(id) => (Some(all_m), &mut calm),
            true => (part.free_jumps_m.get(id), &mut others),
        };
        let (Some(jump_m), Some(twin_m)) = (jump_m, full.jumps_m.get(id)) else { continue };
        assert!(*jump_m < twin_m + 0.005, "{id} jumps by {jump_m} m, at full rate by {twin_m} m");
        *counted += 1;
    }
    let (seen, coarse) = (part.places.len(), part.coarse);
    println!(
        "{in_time} bodies were never behind, {calm} do not collide, {others} do; {seen} {drifted} {coarse}"
    );
    assert!(in_time > 100 && calm > 8 && others > 20 && drifted > 600 && coarse > 3_000);
    assert!(seen > 10_000 && seen > full.places.len() * 9 / 10);
}

#[test]
fn the_stated_error_is_the_true_one() {
    let mut within = Vec::new();
    for (name, key, n) in [("pile", "n", 300), ("ragdolls", "count", 24), ("dve", "n", 400)] {
        let mut scene = Scene::open(name, &Params::default().with(key, n)).unwrap();
        // Everything is seen only from an empty region beside it.
        let [min, max] = [scene.bounds.min, scene.bounds.max];
        scene.bounds = Bounds::new([min[0] - 200.0, min[1], min[2]], max);
        scene.cuts = vec![(Axis::X, min[0] - 100.0)];
        scene.viewpoints = vec![Viewpoint { at: [min[0] - 150.0, 0.0, 0.0], radius_m: 1.0 }];
        for fidelity in [Fidelity::AUTO, ALL_COARSE] {
            let mut world = world(&scene, fidelity, 1);
            world.set_audited(0.5);
            world.audit_all();
            run(&mut world, 240);
            let stated = world.fidelity_report().unwrap();
            let truth = world.host().true_error_m_s().unwrap() as f32;
            println!("{name} {fidelity:?}: true {truth}, stated {stated:?}");
            within.push((stated.low95_m_s..=stated.high95_m_s).contains(&truth));
            assert!(stated.high95_m_s.is_finite(), "{name}: {stated:?}");
        }
    }
    let held = within.iter().filter(|within| **within).count();
    assert!(held + 1 >= within.len(), "{held} of {}", within.len());
}

#[test]
fn what_cannot_be_is_refused() {
    let refused = |fidelity, coupling| {
        let mut config = WorldConfig { fidelity, ..WorldConfig::default() };
        config.step = config.step.with_coupling(coupling);
        LocalWorld::new(config).err().map(|error| error.to_string())
    };
    assert_eq!(refused(Fidelity::AUTO, Coupling::Auto), None);
    let why = refused(Fidelity::AUTO, Coupling::Owner).unwrap();
    assert!(why.contains("fidelity") && why.contains("owner"), "{why}");
    for unfit in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        assert!(
            refused(Fidelity::Budget { tick_ms: unfit }, Coupling::Auto)
                .unwrap()
                .contains("fidelity.tick_ms")
        );
        assert!(
            refused(Fidelity::Tolerance { m_s: unfit }, Coupling::Auto).unwrap().contains("fidelity.m_s")
        );
    }
    let mut world = LocalWorld::new(WorldConfig::default()).unwrap();
    let unfit = Viewpoint { at: [f64::NAN, 0.0, 0.0], radius_m: 1.0 };
    assert!(world.set_viewpoints(&[unfit]).unwrap_err().to_string().contains("viewpoint"));
    for (text, fidelity) in [
        ("auto", Some(Fidelity::AUTO)),
        ("budget=8", Some(Fidelity::Budget { tick_ms: 8.0 })),
        ("budget=-1", None),
        ("sharp", None),
    ] {
        assert_eq!(text.parse::<Fidelity>().ok(), fidelity, "{text}");
    }
}

/// Returns the place of a point of a body, metres.
fn point(world: &LocalWorld, id: BodyId, local: Vector) -> [f64; 3] {
    let pose = world.pose(id).unwrap();
    let arm = (Rotation::from_array(pose.rotation) * local).to_array();
    std::array::from_fn(|i| pose.translation[i] + f64::from(arm[i]))
}

#[test]
fn what_is_tied_over_regions_at_different_times_comes_to_be_one_in_the_same_tick() {
    // One of the two bodies' regions is in sight, or neither.
    for (eye_m, rates) in [(15.0, [2, 0, 1]), (28.0, [1, 0, 2])] {
        for phase in 0..4 {
            let mut world = row_of(3, ALL_COARSE, [0.0; 3], Coupling::Overlap);
            world.set_viewpoints(&[Viewpoint { at: [eye_m, 0.0, 0.0], radius_m: 1.0 }]).unwrap();
            let [left, right] = [-18.0, 0.0].map(|x: f64| {
                let body = RigidBodyBuilder::dynamic().linvel(Vector::Z * x.signum() as f32).can_sleep(false);
                world.insert_at(WorldPose::at([x, 0.0, 0.0]), body, [ColliderBuilder::ball(0.3)]).unwrap()
            });
            run(&mut world, 120 + phase);
            assert_eq!(levels(&world), rates);
            // They fly apart with a taut rope.
            let (from, to) = (now(&world, left), now(&world, right));
            let half: [f32; 3] = std::array::from_fn(|i| (0.5 * (to[i] - from[i])) as f32);
            let half = Vector::from(half);
            let rope = SphericalJointBuilder::new().local_anchor1(half).local_anchor2(-half);
            world.insert_joint(left, right, rope).unwrap();
            for ticks in [1, 60] {
                run(&mut world, ticks);
                assert_eq!(world.host().validate(), [], "{eye_m} m, phase {phase}");
            }
            let (a, b) = (point(&world, left, half), point(&world, right, -half));
            let gap_m = (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt();
            assert!(gap_m < 0.05, "{eye_m} m, phase {phase}: the ends of the rope are {gap_m} m apart");
        }
    }
}

#[test]
fn a_body_that_is_set_aside_keeps_the_iterations_that_its_user_gave_it() {
    let mut world = row(1, Fidelity::AUTO, [0.0, -9.81, 0.0]);
    let ground = RigidBodyBuilder::fixed().translation(Vector::Y * -0.5);
    world.insert(ground, ColliderBuilder::cuboid(5.0, 0.5, 5.0)).unwrap();
    let stack = [(0.5, 1.0), (1.5, 100.0)].map(|(y, mass)| {
        let body = RigidBodyBuilder::dynamic().translation(Vector::Y * y).can_sleep(false);
        world.insert(body, ColliderBuilder::cuboid(0.5, 0.5, 0.5).mass(mass)).unwrap()
    });
    // Up to before the tick in which loads are searched for.
    run(&mut world, 48);
    let iterations = |world: &LocalWorld, id| world.body(id).unwrap().additional_solver_iterations();
    assert!(stack.iter().all(|&id| iterations(&world, id) > 0), "the load is computed finer");
    world.update(stack[1], |body| body.add_force(Vector::X * f32::INFINITY, true)).unwrap();
    run(&mut world, 1);
    let region = world.regions().next().unwrap();
    assert!(region.quarantined().contains(&stack[1]), "{:?}", region.quarantined());
    for id in stack {
        assert_eq!(world.host().record(id).unwrap().traits.extra_solver_iterations, 0);
    }
    assert_eq!(iterations(&world, stack[1]), 0);
}
