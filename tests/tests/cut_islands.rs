//! Tests islands that stay cut across several regions because no region takes them whole: they come to rest
//! as in one world, and stay there.

use dcd::physics::{Coupling, Measured, StepSettings};
use dcd::runtime::{LocalWorld, Partitioning, WorldConfig};
use dcd::scene::{Params, Scene};
use dcd::space::{Axis, BodyId};

/// Returns a wall of a thousand bricks in bond, 40 wide and 25 high: one island.
fn wall() -> Scene {
    Scene::named("wall", &Params::new().with("width", 40).with("height", 25)).unwrap()
}

/// Returns a world cut like this, in which islands of any size are cut.
fn cut(scene: &Scene, partitioning: Partitioning, coupling: Coupling, exchanges: usize) -> LocalWorld {
    let config = WorldConfig::for_scene(scene);
    let step = StepSettings { exchanges, island_limit: 0, ..config.step.with_coupling(coupling) };
    LocalWorld::from_scene(scene, WorldConfig { partitioning, step, ..config }).unwrap()
}

fn movable(world: &LocalWorld) -> Vec<BodyId> {
    world.states().map(|(id, ..)| id).collect()
}

fn awake(world: &LocalWorld) -> usize {
    movable(world).into_iter().filter(|&body| !world.body(body).unwrap().is_sleeping()).count()
}

fn steps(world: &mut LocalWorld, count: usize) {
    for _ in 0..count {
        world.step().unwrap();
    }
}

/// Returns the longest distance of a body from where it began, metres.
fn moved_m(world: &LocalWorld, scene: &Scene) -> f64 {
    let began = LocalWorld::from_scene(scene, WorldConfig::for_scene(scene)).unwrap();
    let off = |&body: &BodyId| {
        let (at, was) = (world.pose(body).unwrap().translation, began.pose(body).unwrap().translation);
        (0..3).map(|i| (at[i] - was[i]).powi(2)).sum::<f64>().sqrt()
    };
    movable(world).iter().map(off).fold(0.0, f64::max)
}

#[test]
fn a_wall_that_is_cut_falls_asleep_and_moves_no_farther_than_one_world_lets_it() {
    let scene = wall();
    let mut alone = cut(&scene, Partitioning::Regions(1), Coupling::Auto, 1);
    steps(&mut alone, 600);
    let sag_m = moved_m(&alone, &scene);
    let many = [
        (Partitioning::Regions(2), Coupling::Overlap, 1),
        (Partitioning::Regions(8), Coupling::Overlap, 1),
        (Partitioning::Regions(8), Coupling::Auto, 2),
        (
            Partitioning::Cuts(vec![(Axis::X, -3.0), (Axis::Y, 4.0), (Axis::X, 2.2), (Axis::Y, 1.7)]),
            Coupling::Overlap,
            2,
        ),
    ];
    for (partitioning, coupling, exchanges) in many {
        let what = format!("{partitioning:?} {coupling:?} {exchanges}");
        let mut world = cut(&scene, partitioning, coupling, exchanges);
        steps(&mut world, 600);
        let moved_m = moved_m(&world, &scene);
        println!("{what}: {} awake, moved {moved_m} of {sag_m} m", awake(&world));
        assert!(world.stats().ghosts > 0, "{what}");
        assert_eq!(awake(&world), 0, "{what}");
        assert!(moved_m < sag_m, "{what}: bricks moved by {moved_m:.3} m, in one world by {sag_m:.3} m");
    }
}

/// The heavy load falls with one exchange per tick; a wall does not need more.
#[test]
fn auto_takes_more_exchanges_for_a_heavy_load_and_not_for_a_wall() {
    let tower = Scene::named("tower", &Params::new().with("top_mass_ratio", 100).with("sleep", 0)).unwrap();
    let through = || Partitioning::Cuts(vec![(Axis::Y, 5.0)]);
    let height_m = |world: &LocalWorld| {
        let top = *movable(world).last().unwrap();
        world.pose(top).unwrap().translation[1]
    };
    let mut falls = cut(&tower, through(), Coupling::Overlap, 1);
    steps(&mut falls, 1200);
    assert!(height_m(&falls) < 8.0, "one exchange holds it: {} m", height_m(&falls));
    let mut alone = cut(&tower, Partitioning::Regions(1), Coupling::Auto, 1);
    let mut stands = cut(&tower, through(), Coupling::Auto, 4);
    for world in [&mut alone, &mut stands] {
        steps(world, 3600);
    }
    let lower_m = height_m(&alone) - height_m(&stands);
    assert!(lower_m.abs() < 0.1, "the top is {lower_m:.3} m lower than in one world");

    let wall = wall();
    let mut world = cut(&wall, Partitioning::Regions(4), Coupling::Auto, 4);
    let (ticks, mut exchanges) = (180, 0);
    for _ in 0..ticks {
        world.step().unwrap();
        exchanges += world.stats().exchanges;
    }
    assert!(exchanges < ticks * 3 / 2, "{exchanges} exchanges in {ticks} ticks");
}

/// The masses of three touching balls are split, those of two are not. When a ball comes to two others, its
/// mass is now and then whole at the wrong moment, while all regions that hold the three solve what follows.
#[test]
fn balls_that_meet_what_is_cut_get_no_energy_from_that() {
    for seed in [5, 13, 30, 37] {
        let scene = Scene::named("gas", &Params::new().with("n", 30).with("seed", seed)).unwrap();
        let config = WorldConfig::for_scene(&scene);
        let step = StepSettings { island_limit: 2, dt_s: 1.0 / 60.0, ..config.step };
        let partitioning = Partitioning::Regions(8);
        let mut world = LocalWorld::from_scene(&scene, WorldConfig { partitioning, step, ..config }).unwrap();
        let before = world.host().energy_j();
        let mut most: f64 = 0.0;
        for _ in 0..2_400 {
            world.step().unwrap();
            most = most.max(world.host().energy_j() / before);
        }
        println!("seed {seed}: at most {most:.3} of its energy");
        assert!(most < 1.05, "seed {seed}: {most:.3} of its energy");
    }
}
