//! Tests that the properties of bodies and colliders act across a border as in a bare Rapier world.

use super::bare::{Setup, as_in_bare_rapier};
use super::*;

/// Returns a scene of a box that runs into another at the border. `change` gives both boxes the property to
/// be tested.
fn shove(
    ticks: usize,
    change: impl Fn(RigidBodyBuilder, ColliderBuilder) -> (RigidBodyBuilder, ColliderBuilder),
) -> Setup {
    let mut setup = Setup::on_floor(ticks);
    let body = body_at(-1.2, 0.5, 0.0).can_sleep(false).linvel(Vector::X * 3.0);
    let other = body_at(0.3, 0.5, 0.1).can_sleep(false);
    for (body, collider) in [change(body, cube().friction(0.3)), change(other, cube().friction(0.3))] {
        setup.push(body, collider);
    }
    setup
}

fn plain(ticks: usize) -> Setup {
    shove(ticks, |body, collider| (body, collider))
}

#[test]
fn damping_and_mass_of_bodies_are_those_of_one_world() {
    let damped = shove(60, |body, collider| (body.linear_damping(2.0).angular_damping(4.0), collider));
    as_in_bare_rapier("damping", 0.03, &damped, &plain(60));
    let mut heavy = plain(60);
    heavy.bodies[2].0 = heavy.bodies[2].0.clone().additional_mass(4.0);
    as_in_bare_rapier("additional mass", 0.05, &heavy, &plain(60));
    let mut skewed = plain(60);
    let given = MassProperties::new(Vector::new(0.0, -0.2, 0.3), 3.0, Vector::new(0.2, 0.6, 0.3));
    skewed.bodies[2].1[0] = cube().friction(0.3).mass_properties(given);
    as_in_bare_rapier("mass properties", 0.05, &skewed, &plain(60));
}

#[test]
fn groups_that_do_not_match_let_boxes_through_each_other() {
    let (one, two) = (Group::GROUP_1, Group::GROUP_2);
    let to_floor = |memberships, mode| InteractionGroups::new(memberships, two, mode);
    let and = shove(60, |body, collider| {
        (body, collider.collision_groups(to_floor(one, InteractionTestMode::And)))
    });
    as_in_bare_rapier("collision groups", 0.02, &and, &plain(60));
    let solver =
        shove(60, |body, collider| (body, collider.solver_groups(to_floor(one, InteractionTestMode::And))));
    as_in_bare_rapier("solver groups", 0.02, &solver, &plain(60));
    // One match is enough: that of the second box.
    let mut or = and.clone();
    for (place, filter) in [(1, two), (2, one)] {
        let groups = InteractionGroups::new(one, filter, InteractionTestMode::Or);
        or.bodies[place].1[0] = cube().friction(0.3).collision_groups(groups);
    }
    as_in_bare_rapier("either's match", 0.05, &or, &and);
}

#[test]
fn friction_combines_by_the_rule_of_the_colliders() {
    for rule in [
        CoefficientCombineRule::Min,
        CoefficientCombineRule::Multiply,
        CoefficientCombineRule::Max,
        CoefficientCombineRule::ClampedSum,
        CoefficientCombineRule::GeometricMean,
    ] {
        let mut with = Setup::on_floor(60);
        with.bodies[0].1[0] = ColliderBuilder::cuboid(60.0, 0.5, 60.0).friction(0.2);
        let mut without = with.clone();
        let body = || body_at(-0.9, 0.5, 0.0).linvel(Vector::X * 5.0).can_sleep(false);
        with.push(body(), cube().friction(0.8).friction_combine_rule(rule));
        without.push(body(), cube().friction(0.8));
        as_in_bare_rapier(&format!("{rule:?}"), 0.03, &with, &without);
    }
}

#[test]
fn a_contact_skin_keeps_boxes_apart_at_a_border() {
    let skinned = shove(90, |body, collider| (body, collider.contact_skin(0.1)));
    as_in_bare_rapier("contact skin", 0.02, &skinned, &plain(90));
}

#[test]
fn a_body_spins_over_a_border_with_the_gyroscopic_torque_that_it_has() {
    let tumbling = |gyroscopic: bool| {
        let mut setup = Setup::weightless(90);
        let body = body_at(-1.5, 0.0, 0.0).linvel(Vector::X * 2.0).angvel(Vector::new(0.3, 4.0, 0.2));
        let body = body.gyroscopic_forces_enabled(gyroscopic);
        setup.push(body.can_sleep(false), ColliderBuilder::cuboid(0.1, 0.25, 0.5));
        setup
    };
    as_in_bare_rapier("gyroscopic", 0.05, &tumbling(true), &tumbling(false));
    as_in_bare_rapier("not gyroscopic", 0.05, &tumbling(false), &tumbling(true));
}

#[test]
fn a_wheel_that_may_spin_fast_does_on_both_sides_of_a_border_and_others_turn_a_quarter_a_substep() {
    for allowed in [true, false] {
        for coupling in SHARING {
            let body = body_at(-1.0, 0.0, 0.0).linvel(Vector::X * 2.0).angvel(Vector::Y * 150.0);
            let body = body.allow_fast_rotation(allowed).can_sleep(false);
            let mut bare = PhysicsWorld::new();
            bare.gravity = Vector::ZERO;
            let (wheel, _) = bare.insert(body.clone(), ColliderBuilder::ball(0.3));
            (0..60).for_each(|_| bare.step());
            let mut world = LocalWorld::new(weightless(halves(coupling))).unwrap();
            let id = world.insert(body, ColliderBuilder::ball(0.3)).unwrap();
            let mut exchanges = 1;
            for _ in 0..60 {
                steps(&mut world, 1);
                exchanges = exchanges.max(world.stats().exchanges);
            }
            assert!(world.stats().transfers > 0);
            let (one, many) = (bare.bodies[wheel].angvel().y, world.velocity(id).unwrap().angular[1]);
            let what = format!("{} {allowed}: {many} rad/s, in one world {one}", coupling.name());
            assert_eq!((one - 150.0).abs() < 0.1, allowed, "{what}");
            if allowed {
                assert!((many - 150.0).abs() < 0.1, "{what}");
            } else {
                assert!(many > 0.99 * one && many < 1.01 * one * exchanges as f32, "{what}, {exchanges}");
            }
        }
    }
}

#[test]
fn soft_ccd_stops_a_fast_box_before_one_beyond_the_border() {
    let shot = |prediction_m: f32| {
        let mut setup = Setup::weightless(30);
        let wall = body_at(0.3, 0.0, 0.0).additional_mass(1e5);
        setup.push(wall, ColliderBuilder::cuboid(0.02, 4.0, 4.0).restitution(0.0));
        let body = body_at(-3.85, 0.0, 0.0).linvel(Vector::X * 30.0).soft_ccd_prediction(prediction_m);
        setup.push(body.can_sleep(false), ColliderBuilder::ball(0.1).restitution(0.0));
        setup
    };
    as_in_bare_rapier("soft CCD", 0.1, &shot(2.0), &shot(0.0));
}

#[test]
fn a_sensor_on_a_kinematic_body_notices_what_is_fixed_beyond_a_border_if_its_types_say_so() {
    for coupling in Coupling::ALL {
        for types in [ActiveCollisionTypes::default(), ActiveCollisionTypes::KINEMATIC_FIXED] {
            let mut world = LocalWorld::new(weightless(halves(coupling))).unwrap();
            let post = world.insert(
                RigidBodyBuilder::fixed().translation(Vector::X * 1.5),
                ColliderBuilder::ball(0.2).active_collision_types(types),
            );
            let feeler = ColliderBuilder::ball(0.2).sensor(true).active_collision_types(types);
            let feeler = world.insert(
                RigidBodyBuilder::kinematic_velocity_based()
                    .translation(Vector::X * -1.5)
                    .linvel(Vector::X * 3.0),
                feeler.active_events(ActiveEvents::COLLISION_EVENTS),
            );
            let (post, feeler) = (post.unwrap(), feeler.unwrap());
            let mut seen = Vec::new();
            for _ in 0..90 {
                steps(&mut world, 1);
                seen.extend(
                    world.events().touches.iter().map(|touch| (touch.key.a, touch.key.b, touch.began)),
                );
            }
            let expected = [(post, feeler, true), (post, feeler, false)];
            let expected = if types == ActiveCollisionTypes::KINEMATIC_FIXED { &expected[..] } else { &[] };
            assert_eq!(seen, expected, "{coupling:?} {types:?}");
        }
    }
}

#[test]
fn a_force_at_a_point_pushes_and_turns_a_shared_body_as_in_one_world() {
    for coupling in SHARING {
        let off = deviation(weightless(halves(coupling)), |world| {
            let left = world.insert(body_at(-0.5, 0.0, 0.0).can_sleep(false), cube()).unwrap();
            world.insert(body_at(0.5, 0.0, 0.0).can_sleep(false), cube()).unwrap();
            steps(world, 3);
            let corner = Vector::new(-1.0, 0.5, 0.0);
            world
                .update(left, |body| body.add_force_at_point(Vector::new(0.8, 0.0, 0.1), corner, true))
                .unwrap();
            steps(world, 45);
            assert!(at(world, left)[0] > -0.45);
        });
        assert!(off < 0.03, "{}: {off}", coupling.name());
    }
}
