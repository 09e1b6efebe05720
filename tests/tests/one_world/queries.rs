//! Tests queries over all regions, one by one.

use std::ops::ControlFlow;

use dcd::physics::{BodyFilter, ColliderId, Coupling, QueryError, WorldMotion, WorldRay};
use dcd::protocol::{Velocity, WorldPose};
use dcd::runtime::{LocalWorld, Partitioning, WorldConfig};
use dcd::space::{Axis, BodyId, Bounds};
use rapier3d::prelude::*;

/// Returns a weightless world of two regions that meet at x = 0.
fn halves() -> LocalWorld {
    let mut config =
        WorldConfig { partitioning: Partitioning::Cuts(vec![(Axis::X, 0.0)]), ..WorldConfig::default() };
    config.step.gravity = [0.0; 3];
    LocalWorld::new(config).unwrap()
}

fn insert(world: &mut LocalWorld, x: f32, collider: ColliderBuilder) -> BodyId {
    world.insert(RigidBodyBuilder::dynamic().translation(Vector::new(x, 0.0, 0.0)), collider).unwrap()
}

fn along_x(from: f64) -> WorldRay {
    WorldRay::new([from, 0.0, 0.0], [2.0, 0.0, 0.0])
}

#[test]
fn a_body_on_a_border_is_met_once_and_its_ghost_never() {
    let mut config =
        WorldConfig { partitioning: Partitioning::Cuts(vec![(Axis::X, 0.0)]), ..WorldConfig::default() };
    config.step = config.step.with_coupling(Coupling::Owner);
    config.step.gravity = [0.0; 3];
    let mut world = LocalWorld::new(config).unwrap();
    let ball = insert(&mut world, 0.1, ColliderBuilder::ball(0.5));
    world.step().unwrap();
    assert_eq!(world.stats().ghosts, 1, "the test needs a ghost");
    let hits = world.queries().intersect_ray(&along_x(-10.0), &BodyFilter::default()).unwrap();
    let [hit] = hits[..] else { panic!("{hits:?}") };
    assert_eq!((hit.body, hit.collider, hit.normal), (ball, 0, [-1.0, 0.0, 0.0]));
    assert!((hit.distance_m - 9.6).abs() < 1e-5 && (hit.point[0] + 0.4).abs() < 1e-5, "{hit:?}");
}

#[test]
fn what_is_immovable_and_in_every_region_is_met_once() {
    let mut world = halves();
    let floor = world.insert(RigidBodyBuilder::fixed(), ColliderBuilder::cuboid(50.0, 1.0, 50.0)).unwrap();
    assert_eq!(world.regions().filter(|region| region.handle_of(floor).is_some()).count(), 2);
    let queries = world.queries();
    let all = BodyFilter::default();
    let expected = [ColliderId { body: floor, index: 0 }];
    let hits = queries.intersect_ray(&WorldRay::new([0.0, 9.0, 0.0], [0.1, -1.0, 0.0]), &all).unwrap();
    assert_eq!(hits.len(), 1);
    assert_eq!(queries.intersect_point([0.0, 0.5, 0.0], &all).unwrap(), expected);
    let reach = Ball::new(3.0);
    assert_eq!(queries.intersect_shape(&reach, &WorldPose::at([0.0, 3.0, 0.0]), &all).unwrap(), expected);
    let bounds = Bounds::around([0.0; 3], [f64::INFINITY; 3]);
    assert_eq!(queries.intersect_aabb_conservative(&bounds, &all).unwrap(), expected);
}

#[test]
fn a_visit_meets_what_the_lists_have_each_once_and_ends_when_told() {
    let mut world = halves();
    let floor = ColliderBuilder::cuboid(50.0, 1.0, 50.0).translation(Vector::new(0.0, -1.4, 0.0));
    world.insert(RigidBodyBuilder::fixed(), floor).unwrap();
    for x in -6..6 {
        insert(&mut world, x as f32 + 0.25, ColliderBuilder::ball(0.45));
    }
    world.step().unwrap();
    let (queries, all) = (world.queries(), BodyFilter::default());
    let slanting = WorldRay::new([-8.0, 0.2, 0.0], [1.0, -0.03, 0.0]);
    let listed = queries.intersect_ray(&slanting, &all).unwrap();
    assert!(listed.len() > 10, "the test needs a crowd on both sides: {}", listed.len());

    let mut visited = Vec::new();
    queries
        .visit_ray(&slanting, &all, |hit| {
            visited.push(*hit);
            f64::INFINITY
        })
        .unwrap();
    visited.sort_by(|a, b| a.distance_m.total_cmp(&b.distance_m));
    assert_eq!(visited, listed);
    // Asks only for nearer hits: the last one is the nearest of all.
    let mut nearest = None;
    queries
        .visit_ray(&slanting, &all, |hit| {
            assert!(nearest.is_none_or(|last| hit.distance_m <= last));
            *nearest.insert(hit.distance_m)
        })
        .unwrap();
    assert_eq!(nearest, Some(listed[0].distance_m));

    let (reach, at) = (Ball::new(3.0), WorldPose::at([0.0; 3]));
    let bounds = Bounds::around([0.0; 3], [3.0; 3]);
    let listed =
        [queries.intersect_shape(&reach, &at, &all), queries.intersect_aabb_conservative(&bounds, &all)];
    for (which, listed) in listed.into_iter().enumerate() {
        let listed = listed.unwrap();
        let visit = |most: usize| {
            let mut met = Vec::new();
            let meet = |id| {
                met.push(id);
                if met.len() == most { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            };
            match which {
                0 => queries.visit_shape(&reach, &at, &all, meet),
                _ => queries.visit_aabb_conservative(&bounds, &all, meet),
            }
            .unwrap();
            met
        };
        let mut met = visit(usize::MAX);
        met.sort_unstable();
        assert_eq!(met, listed);
        for most in 1..=listed.len() {
            assert_eq!(visit(most).len(), most);
        }
    }
}

#[test]
fn bodies_are_found_where_they_are_now_without_a_step() {
    let mut world = halves();
    let all = BodyFilter::default();
    let first =
        |world: &LocalWorld| world.queries().cast_ray(&along_x(-10.0), &all).unwrap().map(|hit| hit.body);
    let near = insert(&mut world, -3.0, ColliderBuilder::ball(0.5));
    assert_eq!(first(&world), Some(near), "inserted");
    world.step().unwrap();
    let far = insert(&mut world, 3.0, ColliderBuilder::ball(0.5));
    world.set_pose(near, WorldPose::at([5.0, 0.0, 0.0])).unwrap();
    assert_eq!(first(&world), Some(far), "moved to another region");
    world.set_pose(far, WorldPose::at([3.0, 7.0, 0.0])).unwrap();
    assert_eq!(first(&world), Some(near), "moved within its region");
    world.update(near, |body| body.set_enabled(false)).unwrap();
    assert_eq!(first(&world), None, "disabled");
    world.update(near, |body| body.set_enabled(true)).unwrap();
    assert_eq!(first(&world), Some(near), "enabled");
    world.update_collider(near, 0, |collider| collider.set_enabled(false)).unwrap();
    assert_eq!(first(&world), None, "its collider disabled");
    world.update_collider(near, 0, |collider| collider.set_enabled(true)).unwrap();
    world.remove(near).unwrap();
    assert_eq!(first(&world), None, "removed");
    // Rapier reuses the handles of the removed body for the new one.
    let newcomer = insert(&mut world, 8.0, ColliderBuilder::ball(0.5));
    assert_eq!(first(&world), Some(newcomer));
}

#[test]
fn asking_changes_nothing_of_what_happens_next() {
    let run = |asks: bool| {
        let mut world = LocalWorld::new(WorldConfig {
            partitioning: Partitioning::Cuts(vec![(Axis::X, 0.0)]),
            ..WorldConfig::default()
        })
        .unwrap();
        world.insert(RigidBodyBuilder::fixed(), ColliderBuilder::cuboid(20.0, 0.5, 20.0)).unwrap();
        for tick in 0..90 {
            if tick % 6 == 0 {
                let x = (tick % 7) as f32 * 0.3 - 1.0;
                let body = RigidBodyBuilder::dynamic().translation(Vector::new(x, 3.0, 0.0));
                world.insert(body, ColliderBuilder::cuboid(0.4, 0.4, 0.4)).unwrap();
            }
            if asks {
                let all = BodyFilter::default();
                world.queries().intersect_ray(&along_x(-10.0), &all).unwrap();
                world.queries().intersect_point([0.0, 3.0, 0.0], &all).unwrap();
            }
            world.step().unwrap();
        }
        world.state_hash()
    };
    assert_eq!(run(false), run(true));
}

#[test]
fn a_filter_overlooks_what_it_names() {
    let mut world = halves();
    let sensor = insert(&mut world, -6.0, ColliderBuilder::ball(0.5).sensor(true));
    let group_2 = InteractionGroups::new(Group::GROUP_2, Group::ALL, InteractionTestMode::And);
    let other_group = insert(&mut world, -4.0, ColliderBuilder::ball(0.5).collision_groups(group_2));
    let first = insert(&mut world, 2.0, ColliderBuilder::ball(0.5));
    let body = RigidBodyBuilder::kinematic_position_based();
    let colliders = vec![ColliderBuilder::ball(0.5), ColliderBuilder::ball(1.0)];
    let moved = world.insert_at(WorldPose::at([4.0, 0.0, 0.0]), body, colliders).unwrap();
    for stepped in [false, true] {
        let seen = |filter: BodyFilter<'_>| {
            let hit = world.queries().cast_ray(&along_x(-10.0), &filter).unwrap();
            hit.map(|hit| (hit.body, hit.collider))
        };
        let no_sensors = BodyFilter::from(QueryFilterFlags::EXCLUDE_SENSORS);
        assert_eq!(seen(BodyFilter::default()), Some((sensor, 0)), "{stepped}");
        assert_eq!(seen(no_sensors), Some((other_group, 0)));
        let groups = Some(InteractionGroups::new(Group::GROUP_1, Group::GROUP_1, InteractionTestMode::And));
        assert_eq!(seen(BodyFilter { groups, ..no_sensors }), Some((first, 0)));
        let exclude_bodies = &[sensor, other_group, first];
        assert_eq!(seen(BodyFilter { exclude_bodies, ..no_sensors }), Some((moved, 1)));
        let exclude_colliders = &[ColliderId { body: moved, index: 1 }];
        let both = BodyFilter { exclude_bodies, exclude_colliders, ..no_sensors };
        assert_eq!(seen(both), Some((moved, 0)));
        assert_eq!(seen(QueryFilterFlags::ONLY_KINEMATIC.into()), Some((moved, 1)));
        let not_first = |id: BodyId, _: &Collider| id != first && id != moved;
        let picky = BodyFilter { groups, predicate: Some(&not_first), ..no_sensors };
        assert_eq!(seen(picky), None);
        world.step().unwrap();
    }
}

#[test]
fn answers_far_from_the_origin_keep_millimetres() {
    let mut config = WorldConfig {
        bounds: Bounds::around([0.0; 3], [200_000.0, 100.0, 100.0]),
        partitioning: Partitioning::Regions(8),
        ..WorldConfig::default()
    };
    config.step.gravity = [0.0; 3];
    let mut world = LocalWorld::new(config).unwrap();
    let at = WorldPose::at([180_000.003, 0.25, 0.0]);
    let far = world.insert_at(at, RigidBodyBuilder::dynamic(), vec![ColliderBuilder::ball(0.5)]).unwrap();
    let ray = WorldRay::new([-150_000.0, 0.25, 0.0], [1.0, 0.0, 0.0]);
    let region = world.regions().find(|region| region.handle_of(far).is_some()).unwrap();
    let f32_step_m = (180_000.0 - region.anchor()[0]).abs() * f64::from(f32::EPSILON);
    for _ in 0..2 {
        let hit = world.queries().cast_ray(&ray, &BodyFilter::default()).unwrap().unwrap();
        assert_eq!(hit.body, far);
        assert!((hit.distance_m - 329_999.503).abs() < 1e-3 + f32_step_m, "{hit:?} {f32_step_m}");
        world.step().unwrap();
    }
}

#[test]
fn questions_without_an_answer_are_refused_by_name() {
    let mut world = halves();
    insert(&mut world, 0.0, ColliderBuilder::ball(0.5));
    let (queries, all) = (world.queries(), BodyFilter::default());
    let ray = along_x(-10.0);
    let cast = |ray: WorldRay| queries.cast_ray(&ray, &all).unwrap_err();
    assert_eq!(cast(WorldRay { direction: [0.0; 3], ..ray }), QueryError::NoDirection);
    assert_eq!(cast(WorldRay { origin: [f64::NAN; 3], ..ray }), QueryError::NotFinite("ray's origin"));
    assert_eq!(cast(ray.up_to(-1.0)), QueryError::Limit { what: "ray's max_m", value: -1.0 });
    assert!(matches!(cast(ray.up_to(f64::NAN)), QueryError::Limit { .. }));
    let slanted = WorldPose { rotation: [1.0, 1.0, 0.0, 0.0], ..WorldPose::default() };
    let shape = queries.intersect_shape(&Ball::new(1.0), &slanted, &all).unwrap_err();
    assert_eq!(shape, QueryError::Rotation("shape's pose"));
    let inside_out = Bounds::new([1.0; 3], [0.0; 3]);
    assert_eq!(queries.intersect_aabb_conservative(&inside_out, &all), Err(QueryError::Box));
    let point = queries.project_point([f64::INFINITY; 3], 1.0, true, &all);
    assert_eq!(point, Err(QueryError::NotFinite("point")));
    let (start, local_centre) = (WorldPose::default(), [0.0; 3]);
    let motion = WorldMotion { start, local_centre, velocity: Velocity::linear([1.0, 0.0, 0.0]) };
    let turned = queries.cast_shape_nonlinear(&HalfSpace::new(Vector::X), &motion, 0.0..1.0, true, &all);
    assert_eq!(turned, Err(QueryError::CannotTurn));
    assert_eq!(queries.cast_ray(&ray.up_to(5.0), &all), Ok(None));
}

#[test]
fn a_cast_that_turns_meets_a_half_space_where_it_meets_a_box() {
    let grounds = [
        ColliderBuilder::new(SharedShape::halfspace(Vector::Y)),
        ColliderBuilder::cuboid(20.0, 1.0, 20.0).translation(Vector::new(0.0, -1.0, 0.0)),
    ];
    // A plank that comes down through the border, more and more on one end.
    let plank = Cuboid::new(Vector::new(1.0, 0.1, 0.3));
    let (start, local_centre) = (WorldPose::at([-1.5, 3.0, 0.3]), [0.0; 3]);
    let velocity = Velocity { linear: [2.0, -4.0, 0.0], angular: [0.0, 0.0, 0.5] };
    let motion = WorldMotion { start, local_centre, velocity };
    let [on_half_space, on_box] = grounds.map(|ground| {
        let mut world = halves();
        let ground = world.insert(RigidBodyBuilder::fixed(), ground).unwrap();
        let all = BodyFilter::default();
        let cast = |end: f32| world.queries().cast_shape_nonlinear(&plank, &motion, 0.0..end, true, &all);
        assert_eq!(cast(0.5).unwrap(), None, "it ends above the ground");
        let hit = cast(1.0).unwrap().expect("it comes down");
        assert_eq!((hit.body, hit.collider), (ground, 0));
        hit
    });
    // Its end is down when 3 m are 4 t + sin(t / 2) + 0.1 cos(t / 2).
    let time = f64::from(on_half_space.time_of_impact);
    assert!((4.0 * time + (0.5 * time).sin() + 0.1 * (0.5 * time).cos() - 3.0).abs() < 1e-3, "{time}");
    assert!((on_half_space.time_of_impact - on_box.time_of_impact).abs() < 1e-3, "{on_box:?}");
    assert!(on_half_space.point[1].abs() < 1e-3, "{on_half_space:?}");
    let [x, y, _] = on_half_space.point_on_shape;
    assert!((x + 1.0).abs() < 1e-3 && (y + 0.1).abs() < 1e-3, "its left end is down: {on_half_space:?}");
    for hit in [on_half_space, on_box] {
        assert!((Vector::from(hit.normal) - Vector::Y).length() < 0.01, "{hit:?}");
    }
}

#[test]
fn a_region_far_off_does_not_answer_for_ground_that_is_near_another() {
    let world_box = Bounds::around([0.0; 3], [200_000.0, 100.0, 100.0]);
    let config =
        WorldConfig { bounds: world_box, partitioning: Partitioning::Regions(8), ..WorldConfig::default() };
    let mut world = LocalWorld::new(config).unwrap();
    let ground = ColliderBuilder::cuboid(200_000.0, 1.0, 5.0);
    let post = ColliderBuilder::cuboid(0.5, 2.0, 0.5).translation(Vector::new(0.0, 3.0, 0.0));
    let fixed = RigidBodyBuilder::fixed();
    let ground = world.insert_at(WorldPose::default(), fixed, vec![ground, post]).unwrap();
    assert!(world.regions().all(|region| region.handle_of(ground).is_some()));
    for part in 0..40 {
        let gap_m = 10.0 + 0.0071 * f64::from(part);
        let ray = WorldRay::new([-0.5 - gap_m, 3.0, 0.0], [1.0, 0.0, 0.0]);
        let hit = world.queries().cast_ray(&ray, &BodyFilter::default()).unwrap().unwrap();
        assert_eq!((hit.body, hit.collider), (ground, 1));
        // 25 km from its anchor a region computes with a grain of 2 mm, the farthest region with one of 16
        // mm.
        assert!((hit.distance_m - gap_m).abs() < 1.5e-3, "{} m, not {gap_m} m", hit.distance_m);
    }
}

#[test]
fn nothing_is_put_or_asked_beyond_the_reach_of_a_world() {
    let mut world = halves();
    let body = insert(&mut world, 0.0, ColliderBuilder::ball(0.5));
    let (edge, beyond) = (WorldPose::at([0.0, 0.0, 1e9]), WorldPose::at([0.0, 1.1e9, 0.0]));
    let mut insert_at =
        |pose| world.insert_at(pose, RigidBodyBuilder::dynamic(), [ColliderBuilder::ball(0.5)]);
    assert!(insert_at(edge).is_ok());
    assert!(insert_at(beyond).unwrap_err().to_string().contains("lies beyond 1e9 m"));
    assert!(world.set_pose(body, beyond).unwrap_err().to_string().contains("lies beyond 1e9 m"));
    let below = world.queries().project_point([0.0, -1.1e9, 0.0], 1.0, true, &BodyFilter::default());
    assert_eq!(below, Err(QueryError::NotFinite("point")));
}
