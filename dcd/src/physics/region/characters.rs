//! Moves the characters of a region before each tick. Rapier's character controller turns the velocity that a
//! character wants into one at which it can move, and what is in its way is pushed.
//!
//! Every region that holds a character moves its copy, and pushes its own copies of what that meets. So all
//! copies of a body are pushed alike, as by a user. Where the copies of a character differ, its owner's
//! counts, as for all kinematic bodies.

use rapier3d::control::{
    CharacterAutostep, CharacterLength, EffectiveCharacterMovement, KinematicCharacterController,
};
use rapier3d::prelude::*;
use serde::{Deserialize, Serialize};

use super::Region;
use crate::physics::convert;
use crate::physics::dispatcher::Dispatcher;
use crate::protocol::{Character, Gait};
use crate::space::BodyId;

/// The fastest that a character walks, jumps or falls, m/s. Parry's casts are for ways of some kilometres at
/// most.
const FASTEST_M_S: f32 = 1_000.0;

/// The speed at which a character that stands is assumed to fall, m/s, so that what it stands on is looked
/// for.
const ABOUT_TO_FALL_M_S: f32 = 1.0;

/// The most by which a character's weight speeds up a body that it stands on, m/s per tick.
const MOST_BY_WEIGHT_M_S: f32 = 1.0;

/// The part of its gap to the ground by which a standing character is drawn down per tick.
const HOLD: f32 = 0.5;

/// The cosine of the slope of ground on which a character that goes on is never stopped. Rapier's controller
/// takes a rounding error of the ground's normal for a slope down which the character slides, and stops it.
const LEVEL: f32 = 0.999;

/// A character held by a region.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct Walking {
    gait: Gait,
    /// Says whether the region has been stepped since the character came. Only then do queries find what came with
    /// it.
    settled: bool,
}

impl Walking {
    pub(super) fn new(gait: Gait) -> Self {
        Self { gait, settled: false }
    }
}

/// The walk of a character in one tick.
struct Walk {
    velocity: Vector,
    /// The velocity with which the character pushes what it meets: that at which it wants to go on, and
    /// falls.
    force_m_s: Vector,
    /// The speed that a tick of falling would add and that the ground takes, by which the ground feels the
    /// weight.
    weight_m_s: f32,
    rise_m_s: f32,
    grounded: bool,
    met: Vec<Met>,
}

impl Walk {
    fn standstill(gait: &Gait) -> Self {
        let Gait { rise_m_s, grounded, .. } = *gait;
        let (velocity, force_m_s) = (Vector::ZERO, Vector::ZERO);
        Self { velocity, force_m_s, weight_m_s: 0.0, rise_m_s, grounded, met: Vec::new() }
    }
}

/// A collider that a character met on its way.
struct Met {
    collider: ColliderHandle,
    /// In region space.
    point: Vector,
    /// The normal, out of the collider.
    normal: Vector,
}

/// The surroundings that a character touches before a tick.
#[derive(Default)]
struct Around {
    /// The velocity of what the character stands on.
    carried: Vector,
    pressing: Vec<Pressing>,
}

/// Something next to a character that does not give way.
struct Pressing {
    /// The normal, towards the character.
    normal: Vector,
    velocity: Vector,
    overlap_m: f32,
}

impl Around {
    /// Returns the displacement of a character in a tick: its `own`, plus that by which it is carried and
    /// shoved.
    fn borne_by(&self, own: Vector, dt_s: f32) -> Vector {
        let mut way = own + self.carried * dt_s;
        for pressing in &self.pressing {
            let shove = pressing.velocity.dot(pressing.normal) * dt_s + pressing.overlap_m;
            if shove > 0.0 {
                way += pressing.normal * (shove - way.dot(pressing.normal)).max(0.0);
            }
        }
        way
    }
}

impl Region {
    /// Returns the gait of a body, if it is a character.
    pub(in crate::physics) fn gait(&self, handle: RigidBodyHandle) -> Option<Gait> {
        let slot = self.slot(handle);
        slot.traits.character?;
        self.characters.get(&slot.id).map(|walking| walking.gait)
    }

    /// Sets the gait of a character held here.
    pub(in crate::physics) fn set_gait(&mut self, id: BodyId, gait: Option<Gait>) {
        if let (Some(walking), Some(gait)) = (self.characters.get_mut(&id), gait) {
            walking.gait = gait;
        }
    }

    /// Makes all characters stand still for a tick, since queries find what is around them only after a step.
    pub(super) fn unsettle_characters(&mut self) {
        self.characters.values_mut().for_each(|walking| walking.settled = false);
    }

    /// Sets the velocity that a character wants, m/s. Returns whether it is a character held here.
    pub(in crate::physics) fn set_wanted(&mut self, id: BodyId, wanted: [f32; 3]) -> bool {
        let Some(walking) = self.characters.get_mut(&id) else { return false };
        walking.gait.wanted = wanted;
        true
    }

    /// Returns the velocity with which a body may be about to go on, m/s, where its own is `velocity`. A
    /// character that is stopped by something, or stands on it, may walk on or fall in the next tick: it gets
    /// the larger of what it has and what it wants, per axis.
    pub(in crate::physics) fn heading(&self, handle: RigidBodyHandle, velocity: Vector) -> Vector {
        let Some(gait) = self.gait(handle) else { return velocity };
        let up = self.up();
        let wanted = convert::vector(gait.wanted);
        let rise_m_s = if gait.grounded { -ABOUT_TO_FALL_M_S } else { gait.rise_m_s };
        let asked = wanted - up * wanted.dot(up) + up * rise_m_s;
        let larger = |a: f32, b: f32| if a.abs() > b.abs() { a } else { b };
        Vector::new(larger(asked.x, velocity.x), larger(asked.y, velocity.y), larger(asked.z, velocity.z))
    }

    /// Gives all characters held here their velocity for a tick of this length, in id order, and pushes what
    /// they meet.
    pub(super) fn walk(&mut self, dt_s: f32) {
        let ids: Vec<_> = self.characters.keys().copied().collect();
        self.walked_on.clear();
        for id in ids {
            let handle = self.by_id[&id];
            let Some(character) = self.slot(handle).traits.character else { continue };
            let Walking { gait, settled } = self.characters[&id];
            let walk = if settled {
                self.walk_of(handle, &character, &gait, dt_s).unwrap_or_else(|| Walk::standstill(&gait))
            } else {
                Walk::standstill(&gait)
            };
            self.world.bodies[handle].set_linvel(walk.velocity, true);
            for met in &walk.met {
                self.push_met(met, &character, &walk);
                let body = self.world.colliders.get(met.collider).and_then(Collider::parent);
                let body = body.filter(|&body| self.world.bodies[body].is_dynamic() && self.stands_on(met));
                self.walked_on.extend(body);
            }
            let gait = Gait { rise_m_s: walk.rise_m_s, grounded: walk.grounded, ..gait };
            self.characters.insert(id, Walking { gait, settled: true });
        }
        self.walked_on.sort_unstable_by_key(|handle| handle.into_raw_parts());
    }

    /// Returns whether a character that met this stands on it: it slopes by less than half.
    fn stands_on(&self, met: &Met) -> bool {
        met.normal.dot(self.up()) > 0.5
    }

    /// Returns whether a character held here stood on a dynamic body in its last walk.
    pub(in crate::physics) fn is_walked_on(&self, handle: RigidBodyHandle) -> bool {
        let key = |handle: &RigidBodyHandle| handle.into_raw_parts();
        self.walked_on.binary_search_by_key(&handle.into_raw_parts(), key).is_ok()
    }

    /// Returns the direction against gravity.
    fn up(&self) -> Vector {
        (-self.world.gravity).try_normalize().unwrap_or(Vector::Y)
    }

    /// Returns a character's next walk; none if it is disabled or has no enabled solid collider.
    fn walk_of(
        &self,
        handle: RigidBodyHandle,
        character: &Character,
        gait: &Gait,
        dt_s: f32,
    ) -> Option<Walk> {
        let (world, up) = (&self.world, self.up());
        let body = world.bodies.get(handle).filter(|body| body.is_enabled())?;
        let parts = body.colliders().iter().filter_map(|&part| world.colliders.get(part));
        let part = parts.into_iter().find(|part| !part.is_sensor() && part.is_enabled())?;
        let place = *body.position() * part.position_wrt_parent().copied().unwrap_or(Pose::IDENTITY);
        let wanted = convert::vector(gait.wanted).clamp_length_max(FASTEST_M_S);
        let fall_m_s = world.gravity.length() * body.gravity_scale() * dt_s;
        let flies = fall_m_s == 0.0;
        let rise_m_s = if flies {
            wanted.dot(up)
        } else {
            let start = if gait.grounded { wanted.dot(up).max(0.0) } else { gait.rise_m_s };
            (start - fall_m_s).clamp(-FASTEST_M_S, FASTEST_M_S)
        };
        // A standing character is held to the ground, since the controller lifts it a little with each
        // contact.
        let stands = !flies && gait.grounded && rise_m_s <= 0.0;
        let hold_m_s = if stands { HOLD * character.gap_m / dt_s } else { 0.0 };
        let asked_m_s = rise_m_s - hold_m_s;
        let filter = QueryFilter::default()
            .exclude_rigid_body(handle)
            .exclude_sensors()
            .groups(part.collision_groups());
        // The controller must not see which bodies are kinematic: at the gap from one that moves it would at
        // times be stuck.
        let nobody = RigidBodySet::new();
        let queries = world.query_pipeline_with_filter(filter);
        let queries = QueryPipeline { dispatcher: &Dispatcher, bodies: &nobody, ..queries };
        let around = self.around(&queries, part.shape(), &place, character.gap_m, stands.then_some(up));
        let level_m_s = wanted - up * wanted.dot(up);
        let go = |own_m_s: Vector| {
            let desired = around.borne_by(own_m_s * dt_s, dt_s);
            let mut met = Vec::<Met>::new();
            let mut moved =
                controller(character, up).move_shape(dt_s, &queries, part.shape(), &place, desired, |hit| {
                    if met.iter().all(|met| met.collider != hit.handle) {
                        let (point, normal) = (hit.hit.witness1, hit.hit.normal1);
                        met.push(Met { collider: hit.handle, point, normal });
                    }
                });
            self.keep_out(&queries, part.shape(), &place, &mut moved, &mut met, dt_s);
            (moved, met)
        };
        let (mut moved, mut met) = go(level_m_s + up * asked_m_s);
        if stands && met.iter().all(|met| met.normal.dot(up) > LEVEL) {
            // Also where it only rides on what bears it.
            let goal = around.borne_by(level_m_s * dt_s, dt_s);
            let goal = goal - up * goal.dot(up);
            let way = |moved: &EffectiveCharacterMovement| moved.translation.dot(goal);
            if way(&moved) < 0.99 * goal.length_squared() {
                let (again, more) = go(level_m_s);
                if way(&again) > way(&moved) {
                    moved = again;
                    // The ground still bears it, even where this way meets nothing.
                    let known = |hit: &Met| met.iter().any(|met| met.collider == hit.collider);
                    let new: Vec<_> = more.into_iter().filter(|hit| !known(hit)).collect();
                    met.extend(new);
                }
            }
        }
        let force_m_s = level_m_s + up * rise_m_s;
        let rose_m_s = (moved.translation - around.carried * dt_s).dot(up) / dt_s;
        let is_held = rose_m_s.abs() < 0.5 * asked_m_s.abs() || rose_m_s * asked_m_s < 0.0;
        // On ground that is too steep to stand on, it falls as fast as it slides.
        let flat = character.min_slide_rad.cos() - 1e-3;
        let floors = || met.iter().map(|met| met.normal.dot(up)).filter(|&rise| rise > 0.0);
        let is_steep = floors().next().is_some() && floors().all(|rise| rise < flat);
        let grounded = moved.grounded && rise_m_s <= 0.0 && (is_held || !is_steep);
        let rise_m_s = if grounded || flies || rise_m_s > 0.0 && is_held {
            0.0
        } else if rise_m_s > 0.0 {
            rise_m_s
        } else {
            rise_m_s.max(rose_m_s.min(0.0))
        };
        let weight_m_s = if grounded { fall_m_s } else { 0.0 };
        Some(Walk { velocity: moved.translation / dt_s, force_m_s, weight_m_s, rise_m_s, grounded, met })
    }

    /// Takes from a character's way what leads into bodies that do not give way, and adds what it meets there. Parry's casts
    /// may miss the faces of large boxes by centimetres (seen with 0.31). It takes away only: whatever presses on the
    /// character drives it into nothing else.
    fn keep_out(
        &self,
        queries: &QueryPipeline<'_>,
        shape: &dyn Shape,
        place: &Pose,
        moved: &mut EffectiveCharacterMovement,
        met: &mut Vec<Met>,
        dt_s: f32,
    ) {
        let there =
            shape.compute_aabb(&Pose::from_parts(place.translation + moved.translation, place.rotation));
        let mut near = Vec::new();
        for (handle, other) in queries.intersect_aabb_conservative(there) {
            let parent = other.parent();
            let body = parent.and_then(|parent| self.world.bodies.get(parent));
            if body.is_some_and(RigidBody::is_dynamic)
                || parent.is_some_and(|parent| self.is_character(parent))
            {
                continue;
            }
            // It moves in the tick, too.
            near.push((
                handle,
                other,
                body.map_or(Vector::ZERO, |body| body.velocity_at_point(place.translation) * dt_s),
            ));
        }
        near.sort_unstable_by_key(|(handle, ..)| handle.into_raw_parts());
        for (collider, other, moves) in near {
            let relative = Pose::from_parts(place.translation + moved.translation - moves, place.rotation);
            let apart = relative.inv_mul(other.position());
            let contact = queries.dispatcher.contact(&apart, shape, other.shape(), 0.0);
            let Ok(Some(contact)) = contact else { continue };
            let normal = -(place.rotation * contact.normal1);
            let into_m = (-contact.dist).min(-moved.translation.dot(normal));
            if into_m > 0.0 {
                moved.translation += normal * into_m;
                let one = Met { collider, point: relative * contact.point1 + moves, normal };
                moved.grounded |= self.stands_on(&one);
                if met.iter().all(|met| met.collider != collider) {
                    met.push(one);
                }
            }
        }
    }

    /// Returns the part of the velocity along a normal that a character has by walking: it shoves no other one by that, but
    /// stops at it. Of two that walk against each other, the one that walks first in the tick would push the other back.
    fn walks(&self, handle: RigidBodyHandle, normal: Vector) -> Vector {
        let gait =
            self.slot_at(handle).and_then(|slot| self.characters.get(&slot.id)).map(|walking| walking.gait);
        gait.map_or(Vector::ZERO, |gait| normal * convert::vector(gait.wanted).dot(normal).max(0.0))
    }

    fn is_character(&self, handle: RigidBodyHandle) -> bool {
        self.slot_at(handle).is_some_and(|slot| slot.traits.character.is_some())
    }

    /// Finds what a character touches. `stands` is the direction upwards if it stands on something.
    fn around(
        &self,
        queries: &QueryPipeline<'_>,
        shape: &dyn Shape,
        place: &Pose,
        gap_m: f32,
        stands: Option<Vector>,
    ) -> Around {
        let reach_m = 2.0 * gap_m;
        let mut around = Around::default();
        let mut flattest = 0.0;
        for (_, other) in queries.intersect_aabb_conservative(shape.compute_aabb(place).loosened(reach_m)) {
            let apart = place.inv_mul(other.position());
            let contact = queries.dispatcher.contact(&apart, shape, other.shape(), reach_m);
            let Ok(Some(contact)) = contact else { continue };
            let (point, normal) = (*place * contact.point1, -(place.rotation * contact.normal1));
            let body = other.parent().and_then(|parent| self.world.bodies.get(parent));
            let velocity = body.map_or(Vector::ZERO, |body| body.velocity_at_point(point));
            let rise = stands.map_or(0.0, |up| normal.dot(up));
            if rise > flattest {
                (flattest, around.carried) = (rise, velocity);
            }
            // Dynamic bodies give way.
            if body.is_none_or(|body| !body.is_dynamic()) {
                let overlap_m = (-contact.dist).clamp(0.0, gap_m);
                let walks = other.parent().map_or(Vector::ZERO, |parent| self.walks(parent, normal));
                let velocity = velocity - walks.clamp_length_max(velocity.dot(normal).max(0.0));
                around.pressing.push(Pressing { normal, velocity, overlap_m });
            }
        }
        around
    }

    /// Pushes a dynamic body that a character met: by an inelastic hit where the character is faster, or by
    /// its weight where that is more.
    fn push_met(&mut self, met: &Met, character: &Character, walk: &Walk) {
        let Some(handle) = self.world.colliders.get(met.collider).and_then(Collider::parent) else { return };
        let (body, into) = (&self.world.bodies[handle], -met.normal);
        let faster_m_s = (walk.force_m_s - body.velocity_at_point(met.point)).dot(into).max(0.0);
        // The copy has its share of the mass, and takes its share of the push.
        let share = self.share_of(handle) as f32;
        let mass = body.mass_properties();
        let arm = (met.point - mass.world_com).cross(into);
        let moved = (mass.effective_inv_mass * into).dot(into);
        let turned = arm.dot(mass.effective_world_inv_inertia * arm);
        let lightness = (moved + turned) / share;
        if !body.is_dynamic() || character.mass_kg == 0.0 || lightness <= 0.0 {
            return;
        }
        let hit = faster_m_s / (lightness + character.mass_kg.recip());
        // A light body need not take all of the weight, so that a character does not throw down what falls away
        // from below it.
        let weight = if self.stands_on(met) { character.mass_kg * walk.weight_m_s } else { 0.0 };
        let impulse = hit.max(weight.min(MOST_BY_WEIGHT_M_S / lightness)) / share;
        if impulse.is_finite() && impulse > 0.0 {
            self.world_mut().bodies[handle].apply_impulse_at_point(into * impulse, met.point, true);
        }
    }
}

fn controller(character: &Character, up: Vector) -> KinematicCharacterController {
    let metres = CharacterLength::Absolute;
    KinematicCharacterController {
        up,
        offset: metres(character.gap_m),
        slide: true,
        autostep: (character.step_height_m > 0.0).then(|| CharacterAutostep {
            max_height: metres(character.step_height_m),
            min_width: metres(character.step_depth_m),
            include_dynamic_bodies: true,
        }),
        max_slope_climb_angle: character.max_climb_rad,
        min_slope_slide_angle: character.min_slide_rad,
        snap_to_ground: (character.snap_m > 0.0).then(|| metres(character.snap_m)),
        ..KinematicCharacterController::default()
    }
}
