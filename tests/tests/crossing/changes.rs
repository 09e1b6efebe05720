//! Tests changes of a living body at a border: its type, its shape, more colliders, and parameters of the
//! solver.

use dcd::physics::{Region, StepSettings};
use dcd::protocol::{Velocity, WorldPose};
use dcd::space::RegionId;
use rapier3d::math::IVector;
use rapier3d::parry::utils::Array2;

use super::bare::{Setup, apart, as_in_bare_rapier};
use super::*;

#[test]
fn a_body_that_becomes_fixed_carries_over_a_border_and_falls_when_it_is_dynamic_again() {
    for coupling in Coupling::ALL {
        let mut world = LocalWorld::new(halves(coupling)).unwrap();
        insert_floor(&mut world);
        let plank = ColliderBuilder::cuboid(2.0, 0.1, 1.0);
        let plank = world.insert(body_at(0.0, 3.0, 0.0), plank).unwrap();
        world.update(plank, |body| body.set_body_type(RigidBodyType::Fixed, true)).unwrap();
        let load = [-1.0, 1.0].map(|x| world.insert(body_at(x, 3.6, 0.0), cube()).unwrap());
        steps(&mut world, 90);
        assert_eq!(world.owner_of(plank), None, "{coupling:?}");
        assert_eq!(at(&world, plank), [0.0, 3.0, 0.0], "{coupling:?}");
        assert!(load.iter().all(|&id| (at(&world, id)[1] - 3.6).abs() < 0.02), "{coupling:?}");
        world.update(plank, |body| body.set_body_type(RigidBodyType::Dynamic, true)).unwrap();
        assert_eq!(world.owners_of(plank), 1, "{coupling:?}");
        steps(&mut world, 180);
        assert!((at(&world, plank)[1] - 0.1).abs() < 0.03, "{coupling:?}: {:?}", at(&world, plank));
        assert_eq!(world.stats().bodies, 3, "{coupling:?}");
    }
}

#[test]
fn a_fixed_hook_that_becomes_dynamic_keeps_what_hangs_on_it() {
    for coupling in SHARING {
        let mut world = LocalWorld::new(cut(coupling, &[(Axis::Y, 4.5)])).unwrap();
        let hook = world.insert(fixed_at(5.0), ColliderBuilder::ball(0.1)).unwrap();
        let bob = world.insert(body_at(0.0, 4.0, 0.0), ColliderBuilder::ball(0.1)).unwrap();
        world.insert_joint(hook, bob, SphericalJointBuilder::new().local_anchor2(Vector::Y)).unwrap();
        steps(&mut world, 30);
        assert!((at(&world, bob)[1] - 4.0).abs() < 0.01, "{}", coupling.name());
        world.update(hook, |body| body.set_body_type(RigidBodyType::Dynamic, true)).unwrap();
        steps(&mut world, 60);
        assert!(at(&world, bob)[1] < 0.0, "{}: it falls", coupling.name());
        let gap = distance(at(&world, hook), at(&world, bob));
        assert!((gap - 1.0).abs() < 0.01, "{}: {gap} m apart", coupling.name());
        assert_eq!(world.owners_of(hook), 1);
    }
}

#[test]
fn a_body_that_becomes_kinematic_pushes_over_a_border_and_can_be_pushed_afterwards() {
    for coupling in SHARING {
        let off = deviation(halves(coupling), |world| {
            insert_floor(world);
            let left = world.insert(body_at(-0.5, 0.5, 0.0).can_sleep(false), cube()).unwrap();
            world.insert(body_at(0.52, 0.5, 0.0).can_sleep(false), cube()).unwrap();
            steps(world, 5);
            let change = |kind| move |body: &mut RigidBody| body.set_body_type(kind, true);
            world.update(left, change(RigidBodyType::KinematicVelocityBased)).unwrap();
            world.update(left, |body| body.set_linvel(Vector::X, true)).unwrap();
            steps(world, 30);
            world.update(left, change(RigidBodyType::KinematicPositionBased)).unwrap();
            for tick in 1..=10 {
                let x = 0.0 + 0.02 * f64::from(tick);
                world.set_next_pose(left, WorldPose::at([x, 0.5, 0.0])).unwrap();
                steps(world, 1);
            }
            world.update(left, change(RigidBodyType::Dynamic)).unwrap();
            world.update(left, |body| body.apply_impulse(Vector::new(-1.0, 0.0, 0.0), true)).unwrap();
            steps(world, 30);
        });
        assert!(off < 0.05, "{}: {off}", coupling.name());
    }
}

/// Returns a world with a cube at rest on the floor, which gravity pulls aside, and both bodies.
fn on_a_slope(mut config: WorldConfig) -> (LocalWorld, BodyId, BodyId) {
    config.step.gravity = [3.0, -9.0, 0.0];
    let mut world = LocalWorld::new(config).unwrap();
    let floor = insert_floor(&mut world);
    let rough = cube().friction(1.0).friction_combine_rule(CoefficientCombineRule::Min);
    let cube = world.insert(body_at(-0.1, 0.5, 0.0), rough).unwrap();
    world.update_collider(floor, 0, |floor| floor.set_friction(1.0)).unwrap();
    steps(&mut world, 60);
    assert!((at(&world, cube)[0] + 0.1).abs() < 0.01, "it holds: {:?}", at(&world, cube));
    (world, floor, cube)
}

#[test]
fn what_lies_still_feels_that_it_or_the_ground_has_become_slippery() {
    for config in [one_world()].into_iter().chain(SHARING.map(halves)) {
        for of_ground in [false, true] {
            let (mut world, floor, cube) = on_a_slope(config.clone());
            let slippery = if of_ground { floor } else { cube };
            world.update_collider(slippery, 0, |collider| collider.set_friction(0.0)).unwrap();
            steps(&mut world, 60);
            let x = at(&world, cube)[0];
            assert!((1.2..1.7).contains(&x), "half of 3 m/s² s²: {x} m, {:?}", config.step.coupling);
        }
    }
}

#[test]
fn what_lies_still_feels_that_its_skin_grows_and_that_it_may_touch_nothing() {
    for config in [one_world()].into_iter().chain(SHARING.map(halves)) {
        let (mut world, _, cube) = on_a_slope(config);
        world.update_collider(cube, 0, |collider| collider.set_contact_skin(0.1)).unwrap();
        steps(&mut world, 60);
        assert!((at(&world, cube)[1] - 0.6).abs() < 0.02, "{:?}", at(&world, cube));
        let none = ActiveCollisionTypes::empty();
        let (mut world, floor, cube) = on_a_slope(one_world());
        for id in [floor, cube] {
            world.update_collider(id, 0, |collider| collider.set_active_collision_types(none)).unwrap();
        }
        steps(&mut world, 60);
        assert!(at(&world, cube)[1] < -3.0, "it falls through: {:?}", at(&world, cube));
    }
}

#[test]
fn bodies_at_rest_cease_to_touch_when_a_joint_ties_them_and_touch_again_without_it() {
    for config in [one_world()].into_iter().chain(SHARING.map(halves)) {
        let mut world = LocalWorld::new(config).unwrap();
        insert_floor(&mut world);
        let [below, above] = [0.5, 1.5].map(|y| world.insert(body_at(-0.1, y, 0.0), cube()).unwrap());
        steps(&mut world, 60);
        let rail = PrismaticJointBuilder::new(Vector::Y).contacts_enabled(false);
        let rail = world.insert_joint(below, above, rail).unwrap();
        steps(&mut world, 60);
        assert!(at(&world, above)[1] < 0.7, "it sinks into the other: {:?}", at(&world, above));
        world.remove_joint(rail).unwrap();
        steps(&mut world, 60);
        let apart = distance(at(&world, above), at(&world, below));
        assert!(apart > 0.9, "they push each other off: {apart} m apart");
    }
}

#[test]
fn a_link_of_a_multibody_does_not_become_fixed() {
    let mut world = LocalWorld::new(WorldConfig::default()).unwrap();
    let base = world.insert(fixed_at(2.0), ColliderBuilder::ball(0.1)).unwrap();
    let arm = world.insert(body_at(0.0, 1.0, 0.0), ColliderBuilder::ball(0.1)).unwrap();
    let hinge = RevoluteJointBuilder::new(Vector::Z).local_anchor2(Vector::Y);
    world.insert_multibody_joint(base, arm, hinge, dcd::physics::LinkSettings::default()).unwrap();
    steps(&mut world, 5);
    let refused = world.update(arm, |body| body.set_body_type(RigidBodyType::Fixed, true)).unwrap_err();
    assert!(refused.to_string().contains("remove the joint first"), "{refused}");
    steps(&mut world, 5);
    assert_eq!(world.owners_of(arm), 1);
}

#[test]
fn a_dynamic_body_gets_no_first_shape_without_mass() {
    let mut world = LocalWorld::new(halves(Coupling::Auto)).unwrap();
    let bare = world.insert_at(WorldPose::at([0.0, 1.0, 0.0]), RigidBodyBuilder::dynamic(), []).unwrap();
    let corners = [Vector::ZERO, Vector::X, Vector::Z].to_vec();
    let sheet = || ColliderBuilder::trimesh(corners.clone(), vec![[0, 1, 2]]).unwrap();
    let refused = world.insert_collider(bare, sheet()).unwrap_err();
    assert!(refused.to_string().contains("no mass"), "{refused}");
    world.insert_collider(bare, cube()).unwrap();
    world.insert_collider(bare, sheet()).unwrap();
    assert_eq!(world.body(bare).unwrap().colliders().len(), 2);
}

#[test]
fn what_a_user_puts_far_away_meets_what_is_there_at_once() {
    let cuts: Vec<_> = (-7..8).map(|i| (Axis::X, 8.0 * f64::from(i))).collect();
    for through_rapier in [true, false] {
        let mut world = LocalWorld::new(cut(Coupling::Auto, &cuts)).unwrap();
        let ground = ColliderBuilder::cuboid(100.0, 0.5, 5.0);
        world.insert(fixed_at(-0.5), ground).unwrap();

        let heap = world.insert(body_at(60.0, 0.5, 0.0), cube().density(50.0)).unwrap();
        let ball = world.insert(body_at(-60.0, 1.0, 0.0), ColliderBuilder::ball(0.3)).unwrap();
        steps(&mut world, 9);
        if through_rapier {
            world.update(ball, |body| body.set_translation(Vector::new(60.0, 1.31, 0.0), true)).unwrap();
        } else {
            world.set_pose(ball, WorldPose::at([60.0, 1.31, 0.0])).unwrap();
        }
        world.set_velocity(ball, Velocity { linear: [0.0, -20.0, 0.0], angular: [0.0; 3] }).unwrap();
        steps(&mut world, 1);
        assert_eq!(world.owner_of(ball), world.owner_of(heap), "{through_rapier}");
        steps(&mut world, 3);
        assert!(at(&world, ball)[1] > 1.0, "{through_rapier}: {:?}", at(&world, ball));
    }
}

#[test]
fn shapes_that_no_body_has_any_more_are_forgotten() {
    let mut world = LocalWorld::new(halves(Coupling::Auto)).unwrap();
    let field = |height: f32| {
        let heights = Array2::new(2, 2, vec![0.0, 0.0, 0.0, height]);
        SharedShape::heightfield(heights, Vector::new(20.0, 1.0, 20.0))
    };
    let ground = world.insert(fixed_at(0.0), ColliderBuilder::new(field(0.0))).unwrap();
    let pair = |radius: f32| {
        let parts = [
            (Pose::IDENTITY, SharedShape::ball(radius)),
            (Pose::from_translation(Vector::Y), SharedShape::ball(0.2)),
        ];
        ColliderBuilder::compound(parts.to_vec())
    };
    let kept = world.insert(body_at(0.0, 2.0, 0.0), pair(0.5)).unwrap();
    for dug in 1..100u8 {
        let to = field(-0.01 * f32::from(dug));
        world.update_collider(ground, 0, |collider| collider.set_shape(to.clone())).unwrap();
        let debris = world.insert(body_at(5.0, 2.0, 0.0), pair(0.3 + 0.001 * f32::from(dug))).unwrap();
        steps(&mut world, 1);
        world.remove(debris).unwrap();
    }
    assert!(world.host().shapes().records().len() < 30, "{} shapes", world.host().shapes().records().len());
    // The rest can be saved, and later bodies may have the forgotten shape.
    let mut saved = Vec::new();
    world.save(&mut saved).unwrap();
    let mut again = LocalWorld::restore(&saved[..], 1).unwrap();
    again.insert(body_at(5.0, 2.0, 0.0), pair(0.301)).unwrap();
    steps(&mut again, 60);
    assert!(again.contains(kept) && at(&again, kept)[1] > -1.0);
}

#[test]
fn no_joint_ties_a_body_to_itself() {
    let mut world = LocalWorld::new(halves(Coupling::Auto)).unwrap();
    let ball = world.insert(body_at(0.0, 1.0, 0.0), ColliderBuilder::ball(0.3)).unwrap();
    let refused =
        world.insert_joint(ball, ball, FixedJointBuilder::new().local_anchor1(Vector::X)).unwrap_err();
    assert!(refused.to_string().contains("to itself"), "{refused}");
    assert!(world.joints_of(ball).is_empty());
}

#[test]
fn a_shape_that_changes_at_a_border_changes_in_every_copy_and_stays_so() {
    for coupling in Coupling::ALL {
        let mut world = LocalWorld::new(halves(coupling)).unwrap();
        insert_floor(&mut world);
        let body = body_at(-0.3, 0.5, 0.0).can_sleep(false);
        let grown = world.insert(body, cube().friction(0.0)).unwrap();
        let beside = world.insert(body_at(1.0, 0.5, 0.0).can_sleep(false), cube().friction(0.0)).unwrap();
        steps(&mut world, 10);
        let tall = SharedShape::cuboid(0.5, 1.5, 0.5);
        let grow = |collider: &mut Collider| {
            collider.set_shape(tall.clone());
            collider.set_position_wrt_parent(Pose::from_translation(Vector::Y));
        };
        world.update_collider(grown, 0, grow).unwrap();
        assert!((world.mass_kg(grown).unwrap() - 3.0).abs() < 1e-3, "{coupling:?}");
        // It goes to the other region with its shape.
        world.set_pose(grown, WorldPose::at([2.5, 0.6, 0.0])).unwrap();
        let on_top = world.insert(body_at(2.5, 3.7, 0.0), ColliderBuilder::ball(0.3)).unwrap();
        steps(&mut world, 60);
        assert!((at(&world, grown)[1] - 0.5).abs() < 0.02, "{coupling:?}: {:?}", at(&world, grown));
        assert!((at(&world, on_top)[1] - 3.3).abs() < 0.05, "{coupling:?}: {:?}", at(&world, on_top));
        assert!((world.mass_kg(grown).unwrap() - 3.0).abs() < 1e-3, "{coupling:?}");
        let mut tied = Voxels::new(Vector::ONE, &[IVector::ZERO]);
        let mut other = Voxels::new(Vector::ONE, &[IVector::X]);
        tied.combine_voxel_states(&mut other, IVector::ZERO);
        let tied = SharedShape::new(tied);
        let refused = world.update_collider(beside, 0, |collider| collider.set_shape(tied.clone()));
        assert!(refused.is_err(), "{coupling:?}");
        steps(&mut world, 10);
        assert!((at(&world, beside)[1] - 0.5).abs() < 0.02, "{coupling:?}: it keeps the shape that it had");
    }
}

#[test]
fn what_a_refused_shape_comes_with_changes_in_no_copy() {
    let mut tied = Voxels::new(Vector::ONE, &[IVector::ZERO]);
    let mut other = Voxels::new(Vector::ONE, &[IVector::X]);
    tied.combine_voxel_states(&mut other, IVector::ZERO);
    let tied = SharedShape::new(tied);
    for coupling in Coupling::ALL {
        let mut world = LocalWorld::new(halves(coupling)).unwrap();
        let floor = insert_floor(&mut world);
        let body = world.insert(body_at(-0.1, 0.5, 0.0).can_sleep(false), cube()).unwrap();
        steps(&mut world, 10);
        for id in [floor, body] {
            let refused = world.update_collider(id, 0, |collider| {
                collider.set_friction(0.125);
                collider.set_shape(tied.clone());
            });
            assert!(refused.is_err());
            let friction = |region: &Region| {
                let handle = region.handle_of(id)?;
                let physics = region.physics();
                Some(physics.colliders[physics.bodies[handle].colliders()[0]].friction())
            };
            let copies: Vec<_> = world.regions().filter_map(friction).collect();
            assert_eq!(copies, [0.5; 2], "{coupling:?}: {id}");
        }
    }
}

#[test]
fn ground_that_changes_its_shape_or_place_changes_in_every_region() {
    for coupling in Coupling::ALL {
        // The other region does not hold ground so far from it until the ground grows.
        let mut world = LocalWorld::new(cut(coupling, &[(Axis::X, 30.0)])).unwrap();
        let ground = world.insert(fixed_at(-0.5), ColliderBuilder::cuboid(0.5, 0.5, 0.5)).unwrap();
        let far: Vec<_> = [8.0, 45.0].map(|x| world.insert(body_at(x, 1.0, 0.0), cube()).unwrap()).into();
        assert!(world.regions().nth(1).unwrap().handle_of(ground).is_none(), "{coupling:?}");
        world
            .update_collider(ground, 0, |collider| {
                collider.set_shape(SharedShape::cuboid(60.0, 0.5, 5.0));
                collider.set_position_wrt_parent(Pose::from_translation(Vector::Y * -1.0));
            })
            .unwrap();
        steps(&mut world, 120);
        for id in far {
            assert!((at(&world, id)[1] + 0.5).abs() < 0.01, "{coupling:?}: {:?}", at(&world, id));
        }
    }
}

#[test]
fn a_collider_comes_to_a_shared_body_and_goes_again() {
    for coupling in SHARING {
        let mut world = LocalWorld::new(halves(coupling)).unwrap();
        insert_floor(&mut world);
        let left = world.insert(body_at(-0.5, 0.5, 0.0).can_sleep(false), cube()).unwrap();
        let right = world.insert(body_at(0.5, 0.5, 0.0).can_sleep(false), cube()).unwrap();
        let hinge = RevoluteJointBuilder::new(Vector::Z).local_anchor1(Vector::X * 0.5);
        world
            .insert_joint(left, right, hinge.local_anchor2(Vector::X * -0.5).contacts_enabled(false))
            .unwrap();
        steps(&mut world, 10);
        let shelf = ColliderBuilder::cuboid(1.0, 0.1, 0.5).translation(Vector::Y * 1.5).mass(2.0);
        world.insert_collider(left, shelf).unwrap();
        assert!((world.mass_kg(left).unwrap() - 3.0).abs() < 1e-3);
        let ball = world.insert(body_at(-0.5, 2.7, 0.0), ColliderBuilder::ball(0.2).mass(0.1)).unwrap();
        steps(&mut world, 60);
        assert!((at(&world, ball)[1] - 2.3).abs() < 0.05, "{}: {:?}", coupling.name(), at(&world, ball));
        world.remove_collider(left, 1).unwrap();
        assert!(world.remove_collider(left, 1).unwrap_err().to_string().contains("has 1 colliders"));
        steps(&mut world, 90);
        assert!(at(&world, ball)[1] < 1.6, "{}: {:?}", coupling.name(), at(&world, ball));
        let gap = at(&world, right)[0] - at(&world, left)[0];
        assert!((gap - 1.0).abs() < 0.02 && world.stats().bodies == 3, "{}: {gap}", coupling.name());
    }
}

/// Returns parameters that all differ from Rapier's.
fn unusual() -> IntegrationParameters {
    IntegrationParameters {
        contact_softness: SpringCoefficients::new(8.0, 1.0),
        static_contact_softness: SpringCoefficients::new(8.0, 1.0),
        normalized_max_corrective_velocity: 0.5,
        friction_model: FrictionModel::Coulomb,
        contact_clustering: false,
        num_internal_pgs_iterations: 2,
        ..IntegrationParameters::default()
    }
}

/// Returns a scene of boxes dropped in a heap.
fn heap(parameters: IntegrationParameters) -> Setup {
    let mut setup = Setup::on_floor(90);
    setup.bodies[0].1[0] = ColliderBuilder::cuboid(60.0, 0.5, 60.0);
    for i in 0..6 {
        let body = body_at(0.3 * (i % 3) as f32 - 0.3, 0.5 + 1.1 * i as f32, 0.1 * i as f32);
        setup.push(body.can_sleep(false), cube().density(1.0 + i as f32));
    }
    setup.parameters = parameters;
    setup
}

#[test]
fn the_solver_s_parameters_are_those_of_the_user_to_the_bit() {
    let usual = heap(IntegrationParameters::default()).bare();
    let (bare, (one, _)) = (heap(unusual()).bare(), heap(unusual()).partitioned(one_world()));
    assert!(bare == one, "{} m apart", apart(&bare, &one));
    assert!(apart(&bare, &usual) > 0.05, "the parameters matter: {}", apart(&bare, &usual));
}

#[test]
fn the_solver_s_parameters_reach_every_region_and_travel_in_snapshots() {
    let slow = IntegrationParameters { normalized_max_linear_velocity: 3.0, ..unusual() };
    let fall = |parameters| {
        let mut setup = Setup::weightless(90);
        setup.gravity = Vector::new(9.81, 0.0, 0.0);
        setup.parameters = parameters;
        setup.push(body_at(-1.0, 0.0, 0.0), cube());
        setup
    };
    as_in_bare_rapier("speed limit", 0.05, &fall(slow), &fall(unusual()));
    let (mut world, _) = fall(slow).world(halves(Coupling::Auto));
    steps(&mut world, 10);
    let mut saved = Vec::new();
    world.save(&mut saved).unwrap();
    let mut again = LocalWorld::restore(&saved[..], 1).unwrap();
    assert_eq!(again.host().settings().integration, slow);
    steps(&mut world, 60);
    steps(&mut again, 60);
    assert_eq!(world.state_hash(), again.state_hash());
}

#[test]
fn parameters_that_rapier_cannot_use_are_refused_by_name() {
    let refused = |integration| {
        let step = StepSettings { integration, ..StepSettings::default() };
        LocalWorld::new(WorldConfig { step, ..WorldConfig::default() }).err().unwrap().to_string()
    };
    let usual = IntegrationParameters::default();
    let soft = SpringCoefficients::new(f32::NAN, 1.0);
    let error = refused(IntegrationParameters { contact_softness: soft, ..usual });
    assert!(error.contains("contact_softness"), "{error}");
    let error = refused(IntegrationParameters { length_unit: 0.0, ..usual });
    assert!(error.contains("length_unit"), "{error}");
}

/// Inserts a robot of three links on a fixed base, all at x below 0.
fn robot(world: &mut LocalWorld) -> Vec<BodyId> {
    let base = RigidBodyBuilder::fixed().translation(Vector::new(-5.0, 4.0, 0.0));
    let mut bodies = vec![world.insert(base, ColliderBuilder::ball(0.1)).unwrap()];
    for y in [3.0, 2.0, 1.0] {
        let arm = world.insert(body_at(-5.0, y, 0.0), ColliderBuilder::ball(0.1)).unwrap();
        let hinge = RevoluteJointBuilder::new(Vector::Z).local_anchor2(Vector::Y);
        let above = *bodies.last().unwrap();
        world.insert_multibody_joint(above, arm, hinge, dcd::physics::LinkSettings::default()).unwrap();
        bodies.push(arm);
    }
    bodies
}

#[test]
fn a_link_keeps_its_type_and_its_robot_when_colliders_change() {
    let mut world = LocalWorld::new(halves(Coupling::Auto)).unwrap();
    let robot = robot(&mut world);
    steps(&mut world, 5);
    let sweep = |body: &mut RigidBody| body.set_body_type(RigidBodyType::KinematicVelocityBased, true);
    let refused = world.update(robot[2], sweep).unwrap_err().to_string();
    assert!(refused.contains("remove the joint first"), "{refused}");
    assert!(world.body(robot[2]).unwrap().is_dynamic());
    world.insert_collider(robot[2], ColliderBuilder::ball(0.2)).unwrap();
    world.remove_collider(robot[2], 1).unwrap();
    world.update_collider(robot[2], 0, |collider| collider.set_shape(SharedShape::ball(0.2))).unwrap();
    steps(&mut world, 10);
    assert!(robot.iter().all(|&id| world.contains(id)));
    assert!((distance(at(&world, robot[2]), at(&world, robot[3])) - 1.0).abs() < 1e-3);
}

#[test]
fn a_body_that_is_no_number_makes_nothing_go_with_it() {
    let mut world = LocalWorld::new(halves(Coupling::Auto)).unwrap();
    let tied: Vec<_> = [4.0, 3.0, 2.0]
        .map(|y| world.insert(body_at(-5.0, y, 0.0), ColliderBuilder::ball(0.1)).unwrap())
        .into();
    for pair in tied.windows(2) {
        let rope = SphericalJointBuilder::new().local_anchor2(Vector::Y);
        world.insert_joint(pair[0], pair[1], rope).unwrap();
    }
    let elsewhere = world.insert(body_at(5.0, 4.0, 0.0), ColliderBuilder::ball(0.1)).unwrap();
    steps(&mut world, 5);
    let nowhere = |body: &mut RigidBody| body.set_translation(Vector::splat(f32::NAN), true);
    world.update(tied[2], nowhere).unwrap();
    steps(&mut world, 1);
    let refused =
        |what: &str, result: Result<(), dcd::runtime::WorldError>| result.expect_err(what).to_string();
    let rope = SphericalJointBuilder::new().local_anchor1(Vector::X * 10.0);
    assert!(
        refused("a joint", world.insert_joint(tied[0], elsewhere, rope).map(drop)).contains("not finite")
    );
    assert!(
        refused("a collider", world.insert_collider(tied[1], ColliderBuilder::ball(0.2)))
            .contains("not finite")
    );
    let fix = |body: &mut RigidBody| body.set_body_type(RigidBodyType::Fixed, true);
    assert!(refused("another type", world.update(tied[0], fix)).contains("not finite"));
    assert!(world.body(tied[0]).unwrap().is_dynamic(), "it stays what it was");
    steps(&mut world, 10);
    assert!(tied.iter().chain([&elsewhere]).all(|&id| world.contains(id)));
}

#[test]
fn a_floor_that_a_change_moves_is_there_in_every_region_and_for_who_asks() {
    for coupling in SHARING {
        // The last region does not hold a floor so far from it until its plane moves.
        let mut world = LocalWorld::new(cut(coupling, &[(Axis::X, 0.0), (Axis::X, 60.0)])).unwrap();
        let floor = RigidBodyBuilder::fixed().translation(Vector::new(0.0, -0.5, 0.0));
        let floor = world.insert(floor, ColliderBuilder::cuboid(20.0, 0.5, 5.0)).unwrap();
        let boxes = [-5.0, 5.0].map(|x| world.insert(body_at(x, 0.5, 0.0), cube()).unwrap());
        steps(&mut world, 30);
        let pose = *world.body(floor).unwrap().position();
        let nowhere = |body: &mut RigidBody| body.set_translation(Vector::splat(f32::NAN), true);
        assert!(world.update(floor, nowhere).unwrap_err().to_string().contains("not finite"));
        assert_eq!(*world.body(floor).unwrap().position(), pose, "what is refused is taken back");
        let up = |body: &mut RigidBody| body.set_translation(body.translation() + Vector::Y * 0.25, true);
        world.update(floor, up).unwrap();
        assert_eq!(at(&world, floor), [0.0, -0.25, 0.0]);
        assert!(world.regions().nth(2).unwrap().handle_of(floor).is_none(), "{}", coupling.name());
        let tree = world.host().partition().tree();
        let is_last = |vertex: &RegionId| tree.cut_of(*vertex) == Some((Axis::X, 60.0));
        let last = (0..8).map(RegionId).find(is_last).unwrap();
        world.move_plane(last, 10.0).unwrap();
        let late = world.insert(body_at(15.0, 1.0, 0.0), cube()).unwrap();
        steps(&mut world, 120);
        for region in world.regions() {
            let handle = region.handle_of(floor).expect("it reaches into each of them");
            assert_eq!(region.world_pose(handle).translation, [0.0, -0.25, 0.0], "{}", coupling.name());
        }
        for id in boxes.into_iter().chain([late]) {
            let y = at(&world, id)[1];
            assert!((y - 0.75).abs() < 0.01, "{}: {id} at {y}", coupling.name());
        }
    }
}

#[test]
fn a_body_that_changes_its_shape_again_weighs_what_it_was_last_given() {
    type Change = fn(&mut Collider);
    let ball: Change = |collider| collider.set_shape(SharedShape::ball(1.0));
    let plank: Change = |collider| collider.set_shape(SharedShape::cuboid(0.5, 1.0, 2.0));
    let dense: Change = |collider| collider.set_density(4.0);
    let given: Change = |collider| collider.set_mass(1.0);
    let none: Change = |collider| collider.set_density(0.0);
    let courses: [&[Change]; 4] =
        [&[ball, plank], &[dense, ball, plank], &[given, ball, dense, given, plank], &[none, ball, dense]];
    let all = MassProperties::new(Vector::X, 5.0, Vector::new(1.0, 2.0, 3.0));
    let starts = [cube(), cube().density(2.0), cube().mass(2.0), cube().mass_properties(all)];
    for (start, course) in starts.iter().flat_map(|start| courses.map(|course| (start, course))) {
        for config in [one_world(), halves(Coupling::Overlap)] {
            let mut world = LocalWorld::new(weightless(config)).unwrap();
            let id = world.insert(body_at(-0.1, 0.0, 0.0).additional_mass(1.0), start.clone()).unwrap();
            let mut bare = start.build();
            for change in course {
                world.update_collider(id, 0, change).unwrap();
                change(&mut bare);
                let mass_kg = bare.mass_properties().mass() + 1.0;
                let found = world.mass_kg(id).unwrap();
                assert!((found / mass_kg - 1.0).abs() < 1e-5, "{found} kg instead of {mass_kg}");
                steps(&mut world, 2);
            }
            let (region, handle) = world.host().owned(id).unwrap();
            if region.share_of(handle) == 1 {
                let physics = region.physics();
                let own = &physics.colliders[physics.bodies[handle].colliders()[0]];
                assert_eq!(own.mass_properties(), bare.mass_properties());
            }
        }
    }
}

/// One region computes a whole heap whose last layers lie beyond the border, and does not walk through the
/// heap in every tick.
#[test]
fn a_body_of_a_large_heap_is_placed_anew_in_any_tick() {
    let mut config = halves(Coupling::Auto);
    config.step.island_limit = StepSettings::default().island_limit;
    let mut world = LocalWorld::new(config).unwrap();
    insert_floor(&mut world);
    let place = |i: i32| [i % 7, i / 7 % 7, i / 49].map(|k| 0.98 * k as f32);
    let heap = (0..343).map(|i| {
        let [x, y, z] = place(i);
        world.insert(body_at(x - 0.5, y + 0.5, z - 3.0).can_sleep(false), cube()).unwrap()
    });
    let heap: Vec<_> = heap.collect();
    steps(&mut world, 20);
    let right = world.regions().nth(1).unwrap().id();
    assert!(heap.iter().filter(|&&id| world.owner_of(id) == Some(right)).count() > 256);
    for tick in 0..16u8 {
        let shape = SharedShape::cuboid(0.5, 0.5, 0.5 - 0.001 * f32::from(tick));
        world.update_collider(heap[9], 0, |collider| collider.set_shape(shape.clone())).unwrap();
        steps(&mut world, 1);
    }
}
