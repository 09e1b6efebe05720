//! Moves a character through all regions: it walks, climbs steps and pushes what is in its way.

use parry3d::bounding_volume::BoundingVolume;
use parry3d::query::ShapeCastHit;
use rapier3d::control::{
    CharacterCollision, CharacterLength, EffectiveCharacterMovement, KinematicCharacterController,
};
use rapier3d::prelude::*;

use super::{ControlError, Neighbourhood};
use crate::physics::convert;
use crate::physics::host::RegionHost;
use crate::physics::query::{BodyFilter, ShapeHit, check_pose, check_vector};
use crate::protocol::WorldPose;
use crate::space::{BodyId, Bounds};

/// The margin around a character's reach in which bodies are gathered, metres. A body that carries the
/// character may carry it farther than it moves by itself.
const SLACK_M: f32 = 1.0;

/// A character and its desired movement in one tick, for
/// [`World::move_character`](crate::World::move_character).
#[derive(Clone, Copy)]
pub struct CharacterMove<'a> {
    /// Rapier's controller, which says how the character climbs, slides and keeps to the ground.
    pub controller: &'a KinematicCharacterController,
    /// The character's shape.
    pub shape: &'a dyn Shape,
    /// The character's pose in world space.
    pub pose: WorldPose,
    /// The way that the character wants to go within the tick, metres.
    pub desired_m: [f32; 3],
    /// The bodies with which the character can collide. If the character is a body of the world, exclude it
    /// here.
    pub filter: BodyFilter<'a>,
}

impl std::fmt::Debug for CharacterMove<'_> {
    fn fmt(&self, to: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        to.debug_struct("CharacterMove")
            .field("pose", &self.pose)
            .field("desired_m", &self.desired_m)
            .field("filter", &self.filter)
            .finish_non_exhaustive()
    }
}

/// A collision of a moving character with a collider.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct CharacterHit {
    /// The character's pose at the collision, in world space.
    pub pose: WorldPose,
    /// The way that the character had gone by then, metres.
    pub applied_m: [f32; 3],
    /// The way that it still wanted to go, metres.
    pub remaining_m: [f32; 3],
    /// The collider that it met, and where.
    pub hit: ShapeHit,
}

impl CharacterMove<'_> {
    fn check(&self) -> Result<(), ControlError> {
        check_pose(&self.pose, "character's pose")?;
        Ok(check_vector(self.desired_m, "character's desired movement")?)
    }

    /// Returns the box in which the controller looks for bodies, in world space.
    fn bounds(&self) -> Bounds {
        let turn = Pose::from_rotation(convert::rotation(self.pose.rotation));
        let around = self.shape.compute_aabb(&turn);
        let size = around.extents().max_element();
        let metres = |length: CharacterLength| match length {
            CharacterLength::Relative(part) => part.abs() * size,
            CharacterLength::Absolute(metres) => metres.abs(),
        };
        let controller = self.controller;
        let steps = controller.autostep.map_or(0.0, |step| metres(step.max_height) + metres(step.min_width));
        let reach = convert::vector(self.desired_m).length()
            + steps
            + controller.snap_to_ground.map_or(0.0, metres)
            + 2.0 * metres(controller.offset)
            + SLACK_M;
        let around = around.loosened(reach);
        let world = |point: Vector| convert::world_point(self.pose.translation, point);
        Bounds { min: world(around.mins), max: world(around.maxs) }
    }
}

impl RegionHost {
    /// Moves a character; see `LocalWorld::move_character`.
    pub(crate) fn move_character(
        &self,
        character: &CharacterMove<'_>,
        mut met: impl FnMut(CharacterHit),
    ) -> Result<EffectiveCharacterMovement, ControlError> {
        character.check()?;
        let around = Neighbourhood::gather(self, &character.bounds(), &character.filter, None)?;
        let pose = convert::region_from_world(around.anchor, &character.pose);
        let desired = convert::vector(character.desired_m);
        let (shape, dt_s) = (character.shape, self.settings().dt_s);
        let tell = |collision: CharacterCollision| met(named(&around, &collision));
        Ok(character.controller.move_shape(dt_s, &around.pipeline(), shape, &pose, desired, tell))
    }

    /// Pushes the bodies that a character met; see `LocalWorld::push_by_character`.
    pub(crate) fn push_by_character(
        &mut self,
        character: &CharacterMove<'_>,
        mass_kg: f32,
        hits: &[CharacterHit],
    ) -> Result<(), ControlError> {
        character.check()?;
        if !(mass_kg.is_finite() && mass_kg > 0.0) {
            return Err(ControlError::Mass(mass_kg));
        }
        let mut around = Neighbourhood::gather(self, &character.bounds(), &character.filter, None)?;
        let collisions: Vec<_> = hits.iter().map(|hit| local(&around, hit)).collect();
        let dt_s = self.settings().dt_s;
        let controller = character.controller;
        let shape = character.shape;
        let mut pipeline = around.pipeline_mut();
        controller.solve_character_collision_impulses(dt_s, &mut pipeline, shape, mass_kg, &collisions);
        around.hand_back(self);
        Ok(())
    }
}

fn named(around: &Neighbourhood, collision: &CharacterCollision) -> CharacterHit {
    let id = around.names[&collision.handle];
    let hit = &collision.hit;
    CharacterHit {
        pose: convert::world_from_region(around.anchor, &collision.character_pos),
        applied_m: collision.translation_applied.to_array(),
        remaining_m: collision.translation_remaining.to_array(),
        hit: ShapeHit {
            body: id.body,
            collider: id.index,
            time_of_impact: hit.time_of_impact,
            point: convert::world_point(around.anchor, hit.witness1),
            normal: hit.normal1.to_array(),
            point_on_shape: hit.witness2.to_array(),
            normal_on_shape: hit.normal2.to_array(),
            status: hit.status,
            subshape: hit.subshape1,
        },
    }
}

/// Converts a hit to Rapier's record of the same collision, in the space of another neighbourhood.
fn local(around: &Neighbourhood, met: &CharacterHit) -> CharacterCollision {
    let handle = |body: BodyId| {
        let parent = around.bodies.get(&body)?;
        around.world.bodies[*parent].colliders().get(met.hit.collider).copied()
    };
    CharacterCollision {
        handle: handle(met.hit.body).unwrap_or(ColliderHandle::invalid()),
        character_pos: convert::region_from_world(around.anchor, &met.pose),
        translation_applied: convert::vector(met.applied_m),
        translation_remaining: convert::vector(met.remaining_m),
        hit: ShapeCastHit {
            time_of_impact: met.hit.time_of_impact,
            witness1: convert::region_point(around.anchor, met.hit.point),
            witness2: convert::vector(met.hit.point_on_shape),
            normal1: convert::vector(met.hit.normal),
            normal2: convert::vector(met.hit.normal_on_shape),
            status: met.hit.status,
            subshape1: met.hit.subshape,
            subshape2: 0,
        },
    }
}
