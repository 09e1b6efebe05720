//! Tests that what nobody looks at stands, keeps its speed, and overlaps no deeper than at full rate.

use dcd::physics::Measured as _;

use super::*;

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
