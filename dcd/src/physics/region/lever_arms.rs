//! Finds how bodies lay when Rapier last found the contacts between them. It keeps the lever arms of contacts as they were then, until
//! the bodies have moved against each other by some centimetres, and tall stacks under load stand by that. Where their contacts are found
//! anew, in another region, they must be found as the bodies lay then, or the stack leans farther each time and falls.

use parry3d::query::PersistentQueryDispatcher;
use rapier3d::prelude::*;

use super::{BodyRef, Region};
use crate::space::mixed;

/// Where a body lay farther away than this from where it is, in metres, or was turned by more, in radians, the island stays as it is.
const FARTHEST_M: f32 = 0.5;
const FARTHEST_RAD: f32 = 0.25;
/// Each body is put aside by up to this part of its lever arms, since contacts of faces that lie exactly on one another lose corners to
/// rounding (of two in three cubes one corner, if they are a ten-millionth apart; of none, if it is a thousandth).
const ASIDE: f32 = 3e-4;
/// How often bodies are put aside another way where contacts are lost all the same.
const ATTEMPTS: u64 = 4;
/// Steps by which a rotation is fitted to lever arms: an angle of a tenth is right to rounding after three.
const FIT_STEPS: usize = 3;

/// Two bodies that press on each other, as they lay when their contacts were found.
struct Pressing {
    bodies: [RigidBodyHandle; 2],
    colliders: [ColliderHandle; 2],
    impulse_ns: f32,
    /// How many contacts they have, each at another place; 0 where these come from several manifolds.
    contacts: usize,
    rotations: [Rotation; 2],
    /// From the centre of mass of the first to that of the second; from the region's origin where the first is fixed, and to it where the
    /// second is.
    apart: Vector,
}

/// Where a body lay: its rotation and its centre of mass.
#[derive(Clone, Copy)]
struct Placed {
    handle: RigidBodyHandle,
    rotation: Rotation,
    centre: Vector,
}

impl Region {
    /// Returns how the bodies of an island lay, one against the other and on what carries them, when the contacts between them were found;
    /// nothing where that is not known for all. Each lies as its heaviest contact has it.
    pub(in crate::physics) fn lay_at_contact(&self, island: &[BodyRef]) -> Vec<(RigidBodyHandle, Pose)> {
        let Some(mut pressing) = self.pressing(island).filter(|all| !all.is_empty()) else {
            return Vec::new();
        };
        pressing.sort_by(|a, b| b.impulse_ns.total_cmp(&a.impulse_ns));
        let mut placed = self.carriers(island, &pressing);
        for link in island {
            self.place_along(&pressing, &mut placed);
            if !placed.iter().any(|one| one.handle == link.handle) {
                placed.push(self.placed(link.handle));
            }
        }
        self.place_along(&pressing, &mut placed);
        let mut lay = Vec::new();
        for attempt in 0..ATTEMPTS {
            let Some(found) = self.put_aside(&placed, attempt) else { return Vec::new() };
            lay = found;
            if pressing.iter().all(|pressing| self.keeps_contacts(pressing, &lay)) {
                break;
            }
        }
        lay
    }

    /// Returns the poses of the bodies that can move, each put aside a little; `None` where one is too far from where it is.
    fn put_aside(&self, placed: &[Placed], attempt: u64) -> Option<Vec<(RigidBodyHandle, Pose)>> {
        let mut lay = Vec::new();
        for one in placed.iter().filter(|one| self.world.bodies[one.handle].is_dynamic()) {
            let body = &self.world.bodies[one.handle];
            let centre = body.mass_properties().local_mprops.local_com;
            let aside = self.aside(one.handle, attempt);
            let pose = Pose::from_parts(one.centre + aside - one.rotation * centre, one.rotation);
            let (moved_m, turned_rad) = apart(body.position(), &pose);
            // Not so where it is not a number, either.
            if !(moved_m <= FARTHEST_M && turned_rad <= FARTHEST_RAD) {
                return None;
            }
            lay.push((one.handle, pose));
        }
        Some(lay)
    }

    /// Returns how far a body is put aside, another way with each owner, so that it does not go ever farther.
    fn aside(&self, handle: RigidBodyHandle, attempt: u64) -> Vector {
        let slot = self.slot(handle);
        let seed = mixed(mixed(slot.id.bits() ^ slot.epoch.0.rotate_left(32)).wrapping_add(attempt));
        // Twenty bits for each axis, between -1 and 1.
        let axis = |at: u32| (seed >> (20 * at) & 0xf_ffff) as f32 / 524_288.0 - 1.0;
        Vector::new(axis(0), axis(1), axis(2)) * (ASIDE * slot.reach_m.min(1.0))
    }

    /// Returns whether two bodies have as many contacts, each at another place, where they lay as they have now.
    fn keeps_contacts(&self, pressing: &Pressing, lay: &[(RigidBodyHandle, Pose)]) -> bool {
        let [first, second] = pressing.colliders.map(|collider| &self.world.colliders[collider]);
        let pose = |end: usize, collider: &Collider| {
            let body = pressing.bodies[end];
            let lay = lay.iter().find(|(of, _)| *of == body).map(|(_, pose)| pose);
            let body = lay.unwrap_or_else(|| self.world.bodies[body].position());
            body * collider.position_wrt_parent().copied().unwrap_or_default()
        };
        let apart = pose(0, first).inv_mul(&pose(1, second));
        let (mut manifolds, mut workspace) = (Vec::<parry3d::query::ContactManifold<(), ()>>::new(), None);
        let prediction_m = self.world.integration_parameters.prediction_distance();
        let (first, second) = (first.shape(), second.shape());
        let found = parry3d::query::DefaultQueryDispatcher.contact_manifolds(
            &apart,
            first,
            second,
            prediction_m,
            &mut manifolds,
            &mut workspace,
        );
        let points = manifolds.iter().flat_map(|manifold| &manifold.points).map(|point| point.local_p1);
        found.is_err() || distinct(points) >= pressing.contacts
    }

    /// Returns the pairs of bodies that press on each other in an island; `None` where one of them belongs to another.
    fn pressing(&self, island: &[BodyRef]) -> Option<Vec<Pressing>> {
        let mut all = Vec::new();
        for link in island {
            let body = &self.world.bodies[link.handle];
            if !body.is_dynamic() || !self.slot(link.handle).joints.is_empty() {
                return None;
            }
            for &collider in body.colliders() {
                for pair in self.world.narrow_phase.contact_pairs_with(collider) {
                    let impulse_ns = pair.total_impulse_magnitude();
                    // Of two members the first collider's sees the pair.
                    let first = pair.collider1 == collider;
                    let other = if first { pair.collider2 } else { pair.collider1 };
                    let Some(other) = self.world.colliders[other].parent().filter(|_| impulse_ns > 0.0)
                    else {
                        continue;
                    };
                    let is_member = island.iter().any(|link| link.handle == other);
                    if self.world.bodies[other].is_dynamic() && !is_member {
                        return None;
                    }
                    if first || !is_member {
                        all.push(self.pressing_of(pair, impulse_ns)?);
                    }
                }
            }
        }
        Some(all)
    }

    fn pressing_of(&self, pair: &ContactPair, impulse_ns: f32) -> Option<Pressing> {
        let colliders = [pair.collider1, pair.collider2];
        let bodies = colliders.map(|collider| self.world.colliders[collider].parent());
        let bodies = [bodies[0]?, bodies[1]?];
        let (mut arms, mut apart) = ([Vec::new(), Vec::new()], None);
        for manifold in pair.solver_manifolds() {
            let is_free = bodies.map(|handle| !self.world.bodies[handle].is_fixed());
            // Who dominates is computed as if it were fixed.
            if manifold.data.relative_dominance != 0 && is_free == [true, true] {
                return None;
            }
            for contact in &manifold.data.solver_contacts {
                let point = manifold.points.get(contact.contact_indices()[0] as usize)?;
                let (first, second) = (point.data.solver_dp1, point.data.solver_dp2);
                apart = apart.or(Some(first - second));
                // The arms end half-way between the two surfaces.
                let gap = manifold.data.normal * (0.5 * contact.dist);
                arms[0].push((contact.anchor1, first - gap));
                arms[1].push((contact.anchor2, second + gap));
            }
        }
        let rotations = [0, 1].map(|end| {
            let now = *self.world.bodies[bodies[end]].rotation();
            if self.world.bodies[bodies[end]].is_fixed() { now } else { fitted(now, &arms[end]) }
        });
        let is_one = pair.solver_manifolds().len() == 1;
        let contacts = if is_one { distinct(arms[0].iter().map(|(arm, _)| *arm)) } else { 0 };
        Some(Pressing { bodies, colliders, impulse_ns, contacts, rotations, apart: apart? })
    }

    /// Returns what carries an island and does not follow from contacts, as it lies.
    fn carriers(&self, island: &[BodyRef], pressing: &[Pressing]) -> Vec<Placed> {
        let mut all: Vec<Placed> = Vec::new();
        for handle in pressing.iter().flat_map(|pressing| pressing.bodies) {
            let is_known = all.iter().any(|one| one.handle == handle);
            if !is_known && !island.iter().any(|link| link.handle == handle) {
                all.push(self.placed(handle));
            }
        }
        all
    }

    /// Places whatever presses, directly or over others, on what is placed.
    fn place_along(&self, pressing: &[Pressing], placed: &mut Vec<Placed>) {
        let of = |placed: &[Placed], handle| placed.iter().find(|one| one.handle == handle).copied();
        let next = |placed: &[Placed]| {
            pressing.iter().find_map(|pressing| {
                let [first, second] = pressing.bodies;
                let (from, to, apart) = match (of(placed, first), of(placed, second)) {
                    (Some(from), None) => (from, 1, pressing.apart),
                    (None, Some(from)) => (from, 0, -pressing.apart),
                    _ => return None,
                };
                let centre = from.centre + apart;
                Some(Placed { handle: pressing.bodies[to], rotation: pressing.rotations[to], centre })
            })
        };
        while let Some(one) = next(placed) {
            placed.push(one);
        }
    }

    /// Returns a body as it lies. The lever arms of what is fixed begin at the origin.
    fn placed(&self, handle: RigidBodyHandle) -> Placed {
        let body = &self.world.bodies[handle];
        let centre = if body.is_fixed() { Vector::ZERO } else { body.center_of_mass() };
        Placed { handle, rotation: *body.rotation(), centre }
    }
}

/// Returns how many of these points are at different places, by a hundredth of how far they reach.
fn distinct(points: impl Iterator<Item = Vector>) -> usize {
    let points: Vec<_> = points.collect();
    let reach = points.iter().map(|point| point.length()).fold(0.0, f32::max);
    let is_new = |at: usize| points[..at].iter().all(|other| (*other - points[at]).length() > 0.01 * reach);
    (0..points.len()).filter(|at| is_new(*at)).count()
}

/// Returns how far a pose is from another one, in metres and radians.
fn apart(from: &Pose, to: &Pose) -> (f32, f32) {
    let turn = to.rotation * from.rotation.inverse();
    let angle = 2.0 * Vector::new(turn.x, turn.y, turn.z).length();
    ((to.translation - from.translation).length(), angle)
}

/// Returns the rotation next to a first guess that turns the first of each pair of vectors into the second, by least squares. What these do
/// not determine, such as a turn around their only direction, is left as guessed.
fn fitted(guess: Rotation, arms: &[(Vector, Vector)]) -> Rotation {
    let mut rotation = guess;
    for _ in 0..FIT_STEPS {
        let (mut columns, mut right) = ([Vector::ZERO; 3], Vector::ZERO);
        for &(arm, wanted) in arms {
            let is = rotation * arm;
            right += is.cross(wanted - is);
            for (axis, column) in [Vector::X, Vector::Y, Vector::Z].into_iter().zip(&mut columns) {
                *column += axis * is.length_squared() - is * is.dot(axis);
            }
        }
        let floor = 1e-6 * (columns[0].x + columns[1].y + columns[2].z) + f32::MIN_POSITIVE;
        columns[0].x += floor;
        columns[1].y += floor;
        columns[2].z += floor;
        let [a, b, c] = columns;
        let determinant = a.dot(b.cross(c));
        if determinant <= f32::MIN_POSITIVE {
            return guess;
        }
        let turn =
            Vector::new(right.dot(b.cross(c)), a.dot(right.cross(c)), a.dot(b.cross(right))) / determinant;
        rotation = (Rotation::from_scaled_axis(turn) * rotation).normalize();
    }
    rotation
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::physics::host::processes::Processes;
    use crate::runtime::WorldConfig;
    use crate::scene::{Params, Scene};
    use crate::space::{Axis, Bounds, DistributionTree};

    /// Returns the largest speed of a box against a platform on which a tower crosses borders at 6 m/s, from half a second before the first
    /// one on, in m/s, and how many bodies the last region owns in the end.
    fn ride(top_mass_ratio: u32, borders_m: &[f64], seconds: usize) -> (f32, usize) {
        let params = Params::new().with("top_mass_ratio", top_mass_ratio).with("sleep", 0);
        let mut scene = Scene::named("tower", &params).unwrap();
        let speed = Vector::new(6.0, 0.0, 0.0);
        for body in &mut scene.bodies {
            body.body = body.body.clone().linvel(speed);
        }
        scene.bodies[0].body.body_type = RigidBodyType::KinematicVelocityBased;
        scene.bounds = Bounds::new([-2.0, -1.0, -2.0], [6.0 * seconds as f64, 11.0, 2.0]);
        let cuts: Vec<_> = borders_m.iter().map(|at| (Axis::X, *at)).collect();
        let tree = DistributionTree::cut_by(scene.bounds, &cuts).unwrap();
        let last = Some(tree.leaf_at([6.0 * seconds as f64, 5.0, 0.0]));
        let mut processes = Processes::cut(&scene, WorldConfig::for_scene(&scene).step, tree, 1);
        let mut worst_m_s = 0.0f32;
        for tick in 0..60 * seconds {
            processes.step();
            // The platform comes first.
            for (.., velocity) in processes.states().into_iter().skip(1).filter(|_| tick >= 150) {
                worst_m_s = worst_m_s.max((Vector::from_array(velocity.linear) - speed).length());
            }
        }
        let arrived = processes.states().iter().filter(|(_, region, ..)| Some(*region) == last).count();
        (worst_m_s, arrived)
    }

    #[test]
    fn towers_under_load_ride_over_borders_as_in_one_world() {
        let far: Vec<_> = (0..10).map(|i| 18.0 + 20.0 * f64::from(i)).collect();
        let near: Vec<_> = (0..11).map(|i| 18.0 + 3.0 * f64::from(i)).collect();
        for ratio in [1, 10, 30, 100] {
            let (one_m_s, _) = ride(ratio, &[], 10);
            for borders in [&far, &near] {
                let (worst_m_s, arrived) = ride(ratio, borders, 36);
                println!(
                    "{ratio}:1, {} borders: {worst_m_s:.4} m/s, in one world {one_m_s:.4}",
                    borders.len()
                );
                assert!(worst_m_s < 1.3 * one_m_s, "{ratio}:1: {worst_m_s} m/s, in one world {one_m_s}");
                assert_eq!(arrived, 11, "{ratio}:1");
            }
        }
    }

    #[test]
    fn a_rotation_is_found_from_lever_arms_and_what_they_leave_open_stays_as_guessed() {
        let turn = Rotation::from_scaled_axis(Vector::new(0.05, -0.08, 0.02));
        let guess = Rotation::from_scaled_axis(Vector::new(-0.03, 0.01, 0.04));
        let corners = [(-0.5, -0.5), (-0.5, 0.5), (0.5, -0.5)].map(|(x, z)| Vector::new(x, -0.5, z));
        let arms = corners.map(|arm| (arm, turn * arm));
        let off = |a: Rotation, b: Rotation| apart(&Pose::from_rotation(a), &Pose::from_rotation(b)).1;
        assert!(off(fitted(guess, &arms), turn) < 1e-5);
        let one = [(Vector::Y, Vector::Y)];
        let left = fitted(Rotation::from_scaled_axis(Vector::new(0.0, 0.3, 0.0)), &one);
        assert!(off(left, Rotation::from_scaled_axis(Vector::new(0.0, 0.3, 0.0))) < 1e-5);
    }
}
