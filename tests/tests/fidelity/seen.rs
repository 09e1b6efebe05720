//! Tests that what is in sight is computed as in a world that is computed in full, and that what comes into
//! sight does not jump.

use std::collections::{BTreeMap, BTreeSet};

use dcd::scene::SceneBody;

use super::*;

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

/// A walk through the town: what was shown on it.
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
    assert!(in_time > 60 && calm > 8 && others > 20 && drifted > 600 && coarse > 3_000);
    assert!(seen > 10_000 && seen > full.places.len() * 9 / 10);
}
