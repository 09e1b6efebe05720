//! Reads the points at which a body touches others, as the solver left them. Each pair is read once,
//! whichever regions hold it.

use std::collections::BTreeMap;

use rapier3d::geometry::ContactManifold;
use rapier3d::prelude::*;

use super::View;
use super::contacts::{Side, answers, has_part, is_pushed, solved_dt_s};
use crate::physics::convert;
use crate::physics::host::RegionHost;
use crate::physics::region::Region;
use crate::protocol::ContactKey;
use crate::space::BodyId;

/// A point at which two colliders touch, or are about to
/// ([`World::contact_points`](crate::World::contact_points)).
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct ContactPoint {
    /// The two colliders.
    pub key: ContactKey,
    /// The number of the contact manifold among those of the pair. All points of one manifold have the same
    /// normal.
    pub manifold: u32,
    /// The point in world space, metres, in the middle between the two surfaces.
    pub point: [f64; 3],
    /// The unit normal, from `key.a` to `key.b`.
    pub normal: [f32; 3],
    /// The distance between the surfaces, metres; negative where they overlap.
    pub separation_m: f32,
    /// The impulse along the normal on `key.b` in the last step, N s, without friction.
    pub impulse_ns: f32,
}

impl RegionHost {
    /// Returns the points at which a body touches others after the last step, by pair and manifold. The
    /// region that answers for a pair has its points. Where regions share a body, the impulses of all of them
    /// are added up.
    pub fn contact_points(&self, id: BodyId) -> Vec<ContactPoint> {
        let dt_s = self.settings().dt_s;
        let (mut points, mut sums) = (Vec::new(), BTreeMap::<ContactKey, f32>::new());
        for region in self.regions() {
            let world = region.physics();
            let body = region.handle_of(id).and_then(|handle| world.bodies.get(handle));
            for pair in body
                .into_iter()
                .flat_map(|body| body.colliders())
                .flat_map(|&own| world.contact_pairs_with(own))
            {
                let Some((key, swapped)) = key_of(region, pair) else { continue };
                if !pair.has_any_active_contact() {
                    continue;
                }
                let view = View::Region(region);
                let per_tick = dt_s / solved_dt_s(view, pair);
                let sides = Side::of_pair(view, pair);
                let here = points_of(region, pair, key, swapped, per_tick);
                if has_part(sides) {
                    *sums.entry(key).or_default() += here.iter().map(|point| point.impulse_ns).sum::<f32>();
                }
                if answers(sides) || is_pushed(region, pair) {
                    points.extend(here);
                }
            }
        }
        points.sort_by_key(|point| (point.key, point.manifold));
        // Where masses are split, so are impulses: each point's is scaled to the sum over all regions.
        for pair in points.chunk_by_mut(|a, b| a.key == b.key) {
            let own: f32 = pair.iter().map(|point| point.impulse_ns).sum();
            if let Some(sum) = sums.get(&pair[0].key).filter(|_| own > 0.0) {
                pair.iter_mut().for_each(|point| point.impulse_ns *= sum / own);
            }
        }
        points
    }
}

/// Returns the key of a pair, and whether it has Rapier's second collider first; `None` if a collider is
/// gone.
fn key_of(region: &Region, pair: &ContactPair) -> Option<(ContactKey, bool)> {
    let name = |collider| region.physics().colliders.get(collider).and(region.collider_name(collider));
    let (first, second) = (name(pair.collider1)?, name(pair.collider2)?);
    let swapped = second < first;
    let (a, b) = if swapped { (second, first) } else { (first, second) };
    Some((ContactKey { a: a.0, b: b.0, collider_a: a.1, collider_b: b.1 }, swapped))
}

fn points_of(
    region: &Region,
    pair: &ContactPair,
    key: ContactKey,
    swapped: bool,
    per_tick: f32,
) -> Vec<ContactPoint> {
    let world = region.physics();
    let skin = |collider| world.colliders.get(collider).map_or(0.0, Collider::contact_skin);
    let skins_m = skin(pair.collider1) + skin(pair.collider2);
    let of = |(number, manifold): (usize, &ContactManifold)| {
        let normal = manifold.data.normal;
        let points = manifold.data.solver_contacts.iter().filter_map(|contact| {
            let known = manifold.points.get(contact.contact_indices()[0] as usize)?;
            let (first, second) = manifold.data.solver_contact_world_points(contact, &world.bodies);
            Some(ContactPoint {
                key,
                manifold: number as u32,
                point: convert::world_point(region.anchor(), 0.5 * (first + second)),
                normal: if swapped { -normal } else { normal }.to_array(),
                separation_m: (second - first).dot(normal) + skins_m,
                impulse_ns: known.data.impulse * per_tick,
            })
        });
        points.collect::<Vec<_>>()
    };
    pair.solver_manifolds().iter().enumerate().flat_map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::runtime::{LocalWorld, Partitioning, WorldConfig};
    use crate::space::Axis;

    /// Returns a world after so many steps, and its bodies: a floor, a cube of a tonne at `at`, and another
    /// on top of it.
    fn stack(cuts: Vec<(Axis, f64)>, at: f32, steps: usize) -> (LocalWorld, [BodyId; 3]) {
        let config =
            WorldConfig { partitioning: Partitioning::Cuts(cuts), threads: 1, ..WorldConfig::default() };
        let mut world = LocalWorld::new(config).unwrap();
        let floor = ColliderBuilder::cuboid(20.0, 0.5, 20.0).translation(Vector::new(0.0, -0.5, 0.0));
        let floor = world.insert(RigidBodyBuilder::fixed(), floor).unwrap();
        let cubes = [0.5, 1.5].map(|height| {
            let body = RigidBodyBuilder::dynamic().translation(Vector::new(at, height, 0.0)).can_sleep(false);
            world.insert(body, ColliderBuilder::cuboid(0.5, 0.5, 0.5).density(1000.0)).unwrap()
        });
        for _ in 0..steps {
            world.step().unwrap();
        }
        (world, [floor, cubes[0], cubes[1]])
    }

    #[test]
    fn what_stands_presses_with_its_weight_in_however_many_regions() {
        for (cuts, at) in [(vec![], 0.0), (vec![(Axis::X, 0.0)], 0.1), (vec![(Axis::X, 0.0)], -5.0)] {
            let (world, [floor, low, high]) = stack(cuts, at, 120);
            let of = |id| world.host().contact_points(id);
            let impulse = |points: &[ContactPoint]| points.iter().map(|p| p.impulse_ns).sum::<f32>();
            let weight_ns = 1000.0 * 9.81 / 60.0;
            let (ground, both, top) = (of(floor), of(low), of(high));
            assert!((impulse(&ground) / weight_ns - 2.0).abs() < 0.02, "{at}: {ground:?}");
            assert!((impulse(&top) / weight_ns - 1.0).abs() < 0.02, "{at}: {top:?}");
            assert_eq!(both.len(), ground.len() + top.len());
            assert!(ground.iter().all(|point| point.key.a == floor && point.key.b == low));
            for point in &ground {
                assert!((point.normal[1] - 1.0).abs() < 1e-4 && point.point[1].abs() < 0.01, "{point:?}");
                assert!((point.point[0] - f64::from(at)).abs() < 0.52 && point.separation_m.abs() < 0.01);
            }
        }
    }

    #[test]
    fn nothing_touches_what_falls() {
        let (world, [floor, low, _]) = stack(vec![], 60.0, 3);
        assert!(world.host().contact_points(floor).is_empty());
        assert!(world.host().contact_points(low).iter().all(|point| point.key.a != floor));
        assert!(world.host().contact_points(BodyId::persistent(9)).is_empty());
    }
}
