//! Tests every scene of the library in a bare Rapier world.

use rapier3d::prelude::*;

use super::*;
use crate::space::Bounds;

/// A second set of parameters of every scene, small enough for tests.
fn small(name: &str) -> Params {
    let params = Params::new();
    match name {
        "tower" => params.with("n", 5).with("top_mass_ratio", 3),
        "pyramid" => params.with("base", 6).with("gap", 0),
        "wall" => params.with("width", 4).with("height", 4),
        "pile" => params.with("n", 120).with("gap", 1),
        "heap" => params.with("n", 60).with("seed", 2),
        "terrain" => params.with("n", 60).with("seed", 2),
        "gas" => params.with("n", 60).with("seed", 2).with("fill", 0.1),
        "dve" => params.with("n", 60).with("seed", 2).with("coverage", 0.04),
        "chain" => params.with("links", 8).with("bob_mass_ratio", 10).with("offset", 2),
        "convoy" => params.with("cars", 3).with("start", 60).with("road", 100),
        "ragdolls" => params.with("count", 5).with("seed", 2).with("multibody", 1),
        "vault" => params.with("arches", 2).with("rows", 2),
        "conveyor" => params.with("n", 48).with("belts", 4),
        "drum" => params.with("n", 60).with("seed", 2),
        "sweep" => params.with("n", 81).with("speed", 0.5).with("reach", 3),
        "net" => params.with("edge", 8).with("hang", 1),
        "town" => params.with("n", 1_200).with("cars", 2).with("seed", 2),
        "domino_ring" => params.with("n", 40).with("starts", 2),
        _ => panic!("give `{name}` a second set of parameters"),
    }
}

fn scene(name: &str) -> Scene {
    build(name, &small(name)).unwrap()
}

/// Returns the deepest overlap of bodies that are not tied to each other, metres: the ends of links meet in
/// their joint.
fn deepest_overlap_m(world: &PhysicsWorld) -> f32 {
    let tied = |pair: &&ContactPair| {
        let bodies = [pair.collider1, pair.collider2].map(|c| world.colliders[c].parent().unwrap());
        world
            .impulse_joints()
            .any(|(_, joint)| bodies.contains(&joint.body1()) && bodies.contains(&joint.body2()))
    };
    world
        .contact_pairs()
        .filter(|pair| !tied(pair))
        .flat_map(|pair| pair.manifolds())
        .flat_map(|manifold| &manifold.points)
        .map(|point| -point.dist)
        .fold(0.0, f32::max)
}

fn stepped(world: &mut PhysicsWorld, steps: usize) {
    for _ in 0..steps {
        world.step();
    }
    assert!(world.quarantine().is_empty(), "{:?}", world.quarantine().bodies());
}

fn dynamic(world: &PhysicsWorld) -> impl Iterator<Item = &RigidBody> {
    world.rigid_bodies().map(|(_, body)| body).filter(|body| body.is_dynamic())
}

fn furthest_moved_m(scene: &Scene, world: &PhysicsWorld) -> f32 {
    let starts = scene.bodies.iter().map(|body| Vector::from(body.pose.translation.map(|v| v as f32)));
    world
        .rigid_bodies()
        .zip(starts)
        .map(|((_, body), start)| body.translation().distance(start))
        .fold(0.0, f32::max)
}

fn energy(world: &PhysicsWorld) -> f32 {
    dynamic(world).map(RigidBody::kinetic_energy).sum()
}

/// Returns the number of moving bodies in the largest group in which all touch.
fn largest_island(world: &PhysicsWorld) -> usize {
    let mut open: Vec<_> =
        world.rigid_bodies().filter(|(_, body)| body.is_dynamic()).map(|(h, _)| h).collect();
    let parent = |collider: ColliderHandle| world.colliders[collider].parent().unwrap();
    let mut largest = 0;
    while let Some(first) = open.pop() {
        let (mut next, mut size) = (vec![first], 0);
        while let Some(body) = next.pop() {
            size += 1;
            for collider in world.bodies[body].colliders() {
                for pair in world.contact_pairs_with(*collider).filter(|pair| pair.has_any_active_contact()) {
                    for other in [parent(pair.collider1), parent(pair.collider2)] {
                        if let Some(found) = open.iter().position(|body| *body == other) {
                            next.push(open.swap_remove(found));
                        }
                    }
                }
            }
        }
        largest = largest.max(size);
    }
    largest
}

#[test]
fn every_scene_builds_with_defaults_and_with_other_parameters() {
    for info in library() {
        for params in [Params::new(), small(info.name)] {
            let scene = build(info.name, &params).unwrap();
            assert_eq!(scene.name, info.name);
            assert!(scene.bodies.iter().all(|body| body.pose.is_valid()), "{}", info.name);
            assert!(scene.bodies.iter().all(|body| body.body.position == Pose::IDENTITY), "{}", info.name);
            assert!(scene.joints.iter().all(|j| j.a.max(j.b) < scene.bodies.len()), "{}", info.name);
            assert!(scene.bounds.is_finite(), "{}", info.name);
            let starts = scene.bodies.iter().filter(|body| body.body.body_type == RigidBodyType::Dynamic);
            for body in starts {
                let at = body.pose.translation;
                assert!(scene.bounds.contains(&crate::space::Bounds::new(at, at)), "{}: {at:?}", info.name);
            }
        }
    }
}

#[test]
fn equal_parameters_give_equal_scenes() {
    for info in library() {
        let places = |scene: Scene| scene.bodies.into_iter().map(|b| (b.pose, b.body)).collect::<Vec<_>>();
        assert_eq!(places(scene(info.name)), places(scene(info.name)), "{}", info.name);
    }
}

#[test]
fn nothing_overlaps_at_the_start() {
    for info in library() {
        let mut world = scene(info.name).bare_world();
        world.detect_collisions(&(), &());
        let overlap_m = deepest_overlap_m(&world);
        assert!(overlap_m < 1e-3, "{}: {overlap_m} m", info.name);
    }
}

#[test]
fn what_stands_still_stands_after_two_seconds() {
    for name in ["tower", "pyramid", "wall", "pile"] {
        let scene = scene(name);
        let mut world = scene.bare_world();
        stepped(&mut world, 120);
        let moved_m = furthest_moved_m(&scene, &world);
        assert!(moved_m < 0.1, "{name}: {moved_m} m");
    }
}

#[test]
fn a_pile_comes_to_rest() {
    let mut world = scene("pile").bare_world();
    stepped(&mut world, 240);
    let awake = dynamic(&world).filter(|body| !body.is_sleeping() && body.linvel().length() > 0.05).count();
    assert_eq!(awake, 0);
}

#[test]
fn a_heap_stays_in_its_pit_and_becomes_one() {
    let scene = scene("heap");
    let mut world = scene.bare_world();
    stepped(&mut world, 240);
    for body in dynamic(&world) {
        let at = body.translation();
        assert!(at.y > 0.0 && at.x.abs().max(at.z.abs()) < scene.bounds.max[0] as f32, "{at}");
        assert!(body.linvel().length() < 2.0);
    }
    let share = largest_island(&world) as f32 / dynamic(&world).count() as f32;
    assert!(share > 0.9, "the largest island has {share} of the boxes");
}

#[test]
fn rain_stays_on_the_terrain() {
    let scene = scene("terrain");
    let mut world = scene.bare_world();
    stepped(&mut world, 300);
    for body in dynamic(&world) {
        let at = body.translation();
        assert!(at.y > -2.5 && at.x.abs().max(at.z.abs()) < scene.bounds.max[0] as f32, "{at}");
    }
}

#[test]
fn a_gas_keeps_its_energy_and_its_box() {
    for name in ["gas", "dve"] {
        let scene = scene(name);
        let mut world = scene.bare_world();
        world.step();
        let before = energy(&world);
        stepped(&mut world, 300);
        let ratio = energy(&world) / before;
        assert!((0.7..1.3).contains(&ratio), "{name}: energy grew by {ratio}");
        let half = scene.bounds.max[0] as f32;
        assert!(dynamic(&world).all(|body| body.translation().abs().max_element() < half + 0.1), "{name}");
    }
}

#[test]
fn a_chain_hangs_together_and_swings() {
    let scene = scene("chain");
    let mut world = scene.bare_world();
    stepped(&mut world, 60);
    let bob = dynamic(&world).last().unwrap().translation();
    let reach_m = 8.0 * 0.5 + 0.3;
    assert!((bob.length() - reach_m).abs() < 0.1 * reach_m, "bob at {bob}");
    assert!(bob.x < 1.5, "bob at {bob} has not swung");
}

#[test]
fn bodies_sleep_where_the_scene_lets_them() {
    let sleepers = |name: &str, params: &Params| {
        let scene = build(name, params).unwrap();
        let movable = scene.bodies.iter().filter(|body| body.body.body_type != RigidBodyType::Fixed);
        let (may, must_not): (Vec<_>, Vec<_>) = movable.partition(|body| body.body.can_sleep);
        assert!(may.is_empty() || must_not.is_empty(), "{name}: all or none");
        !may.is_empty()
    };
    for info in library() {
        let by_default = !["pile", "heap", "gas", "dve", "convoy"].contains(&info.name);
        assert_eq!(sleepers(info.name, &small(info.name)), by_default, "{}", info.name);
        if info.params.iter().any(|param| param.name == "sleep") {
            for asked in [0, 1] {
                let params = small(info.name).with("sleep", asked);
                assert_eq!(sleepers(info.name, &params), asked == 1, "{}", info.name);
            }
        }
    }
}

#[test]
fn an_unknown_scene_names_the_nearest_and_all() {
    let error = build("piel", &Params::new()).unwrap_err().to_string();
    assert!(error.contains("did you mean `pile`?") && error.contains("tower, pyramid, wall"), "{error}");
}

#[test]
fn a_chain_cannot_start_further_out_than_it_is_long() {
    let error = build("chain", &Params::new().with("links", 4).with("offset", 3)).unwrap_err().to_string();
    assert!(error.contains("`offset=3` is not at most the chain's length, 2 m"), "{error}");
}

/// Returns the scene and its state after so many steps of one world, with these parameters.
fn run(name: &str, params: &[&str], steps: usize) -> (Scene, PhysicsWorld) {
    let scene = build(name, &Params::from_args(params).unwrap()).unwrap();
    let mut world = scene.bare_world();
    stepped(&mut world, steps);
    (scene, world)
}

#[test]
fn leaning_towers_fall_into_one_another() {
    let (scene, world) = run("pile", &["n=160", "gap=0.3", "jitter=0.2", "lean=0.12"], 240);
    let aside = scene.bodies.iter().zip(world.rigid_bodies()).filter(|(start, (_, body))| {
        let start = start.pose.translation.map(|v| v as f32);
        (body.translation() - Vector::from(start)).with_y(0.0).length() > 0.3
    });
    let count = aside.count();
    assert!(count > 80, "{count} boxes");
}

#[test]
fn a_ball_shot_at_a_wall_goes_through_it() {
    let (_, world) = run("wall", &["width=8", "height=6", "shot=30"], 60);
    let ball = dynamic(&world).last().unwrap().translation();
    assert!(ball.z > 3.0, "{ball}");
    let knocked_out = dynamic(&world).filter(|brick| brick.translation().z > 0.5).count();
    assert!(knocked_out > 3, "{knocked_out}");
}

#[test]
fn a_dense_dve_and_a_gas_of_balls_and_cubes_start_without_overlap() {
    for (name, params) in
        [("dve", ["n=70", "coverage=0.1", "axis_speed=5"]), ("gas", ["n=70", "fill=0.2", "cubes=0.5"])]
    {
        let (scene, mut world) = run(name, &params, 0);
        world.detect_collisions(&(), &());
        assert!(deepest_overlap_m(&world) < 1e-3, "{name}");
        let fastest = |axis: usize| dynamic(&world).map(|body| body.linvel()[axis].abs()).fold(0.0, f32::max);
        assert!(name != "dve" || (0..3).all(|axis| (4.0..5.0).contains(&fastest(axis))));
        let is_cube = |body: &&crate::scene::SceneBody| body.colliders[0].shape.as_cuboid().is_some();
        let cubes =
            scene.bodies.iter().filter(|body| body.body.body_type == RigidBodyType::Dynamic).filter(is_cube);
        assert_eq!(cubes.count(), if name == "gas" { 35 } else { 70 });
    }
}

#[test]
fn shapes_of_five_kinds_settle_in_a_pit() {
    let (_, world) = run("heap", &["n=100", "mixed=1"], 300);
    assert!(dynamic(&world).all(|body| body.translation().y > 0.0));
    let kinds: std::collections::BTreeSet<_> =
        world.colliders.iter().map(|(_, collider)| format!("{:?}", collider.shape().shape_type())).collect();
    assert_eq!(kinds.len(), 5, "{kinds:?}");
}

#[test]
fn a_vault_stands_for_ten_seconds() {
    let (scene, world) = run("vault", &["arches=2", "sleep=0"], 600);
    let moved_m = furthest_moved_m(&scene, &world);
    assert!(moved_m < 0.1, "{moved_m} m");
}

#[test]
fn belts_carry_stacks_both_ways() {
    let (scene, world) = run("conveyor", &["n=48", "belts=4"], 180);
    let moved = scene.bodies.iter().zip(world.rigid_bodies()).skip(4).map(|(start, (_, body))| {
        (
            start.pose.translation[2] < 0.0,
            body.translation().x - start.pose.translation[0] as f32,
            body.translation().y,
        )
    });
    let moved: Vec<_> = moved.collect();
    assert!(moved.iter().all(|(_, x, y)| (x.abs() - 6.0).abs() < 0.1 && *y > 0.4), "{moved:?}");
    assert_eq!(moved.iter().filter(|(_, x, _)| *x > 0.0).count(), 24);
}

#[test]
fn a_drum_keeps_its_balls_and_lifts_them() {
    let (scene, world) = run("drum", &["n=60"], 240);
    let radius_m = scene.bounds.max[0] as f32;
    for ball in dynamic(&world).map(RigidBody::translation) {
        assert!(ball.x.hypot(ball.y) < 1.05 * radius_m && ball.z.abs() < radius_m, "{ball}");
    }
    let mean_x = dynamic(&world).map(|ball| ball.translation().x).sum::<f32>() / 60.0;
    assert!(mean_x > 0.1, "carried up on the side that rises: {mean_x} m");
}

#[test]
fn an_arm_sweeps_cubes_out_of_its_circle() {
    let near = |world: &PhysicsWorld| {
        dynamic(world).map(RigidBody::translation).filter(|at| at.x.hypot(at.z) < 3.0).count()
    };
    let (scene, before) = run("sweep", &["n=100", "reach=4", "speed=1"], 1);
    let (_, after) = run("sweep", &["n=100", "reach=4", "speed=1"], 600);
    assert!(near(&after) < near(&before) / 2, "{} of {}", near(&after), near(&before));
    let asleep = |world: &PhysicsWorld| dynamic(world).filter(|body| body.is_sleeping()).count();
    assert!(asleep(&after) > 0, "the corners are not reached");
    let (min, max) = (scene.bounds.min, scene.bounds.max);
    for cube in dynamic(&after).map(RigidBody::translation) {
        let inside = |axis: usize, at: f32| (min[axis] - 4.0..max[axis] + 4.0).contains(&f64::from(at));
        assert!(inside(0, cube.x) && inside(2, cube.z) && (0.1..1.0).contains(&cube.y), "{cube}");
    }
}

#[test]
fn a_net_hangs_over_its_pole_in_one_piece() {
    let (scene, world) = run("net", &["edge=12"], 240);
    let longest_m = world
        .impulse_joints()
        .map(|(_, joint)| {
            world.bodies[joint.body1()].translation().distance(world.bodies[joint.body2()].translation())
        })
        .fold(0.0, f32::max);
    assert!(longest_m < 0.6, "{longest_m} m");
    let lowest = dynamic(&world).map(|ball| ball.translation().y).fold(f32::INFINITY, f32::min);
    assert!((-8.0..-3.0).contains(&lowest), "{lowest} m in {:?}", scene.bounds);
}

#[test]
fn all_of_a_town_begins_within_it_and_beside_one_another() {
    for (n, cars) in [(600, 0), (600, 28), (150_000, 0), (150_000, 28)] {
        let scene = build("town", &Params::new().with("n", n).with("cars", cars)).unwrap();
        let dynamic = scene.bodies.iter().filter(|body| body.body.body_type == RigidBodyType::Dynamic);
        let mut places: Vec<_> = dynamic.map(|body| body.pose.translation).collect();
        let Bounds { min, max } = scene.bounds;
        let is_inside = |place: &[f64; 3]| (0..3).all(|i| min[i] < place[i] && place[i] < max[i]);
        assert_eq!(places.iter().find(|place| !is_inside(place)), None, "n={n} cars={cars}");
        places.sort_by(|a, b| a[0].total_cmp(&b[0]));
        for (i, a) in places.iter().enumerate() {
            let near = places[i + 1..].iter().take_while(|b| b[0] - a[0] < 0.1);
            let distance_m = |b: &[f64; 3]| (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt();
            let twin = near.into_iter().find(|b| distance_m(b) < 0.1);
            assert_eq!(twin, None, "n={n} cars={cars}: at {a:?} too");
        }
    }
}

#[test]
fn a_ring_of_dominoes_falls_from_every_start_and_then_sleeps() {
    let (scene, world) = run("domino_ring", &["n=40", "starts=2"], 480);
    assert!(dynamic(&world).all(|domino| (domino.rotation() * Vector::Y).y < 0.6));
    assert!(dynamic(&world).all(RigidBody::is_sleeping));
    let corner = scene.bounds.centre();
    let nearest_m = scene.bodies[1..]
        .iter()
        .map(|domino| (domino.pose.translation[0] - corner[0]).hypot(domino.pose.translation[2] - corner[2]))
        .fold(f64::INFINITY, f64::min);
    assert!(nearest_m < 0.3, "{nearest_m} m from the corner");
}

#[test]
fn more_starts_than_every_fourth_domino_are_refused() {
    let error = build("domino_ring", &Params::new().with("n", 8).with("starts", 3)).unwrap_err().to_string();
    assert!(error.contains("`starts=3` is not at most a quarter of the 8 dominoes"), "{error}");
}
