//! Runs Rapier's controllers in a partitioned world: characters that walk, vehicles that drive.
//!
//! A controller asks one Rapier world what is around it, but no region holds all of that. So dcd gathers a
//! *neighbourhood* for the controller: a small Rapier world of whole bodies from all regions, each as its
//! owner has it. What the controller does to bodies there is then done to the real ones.

mod character;
mod standing;
mod vehicle;

pub use character::{CharacterHit, CharacterMove};
pub use standing::{CharacterState, Ground, WheelState};
pub use vehicle::VehicleController;

use std::collections::{BTreeMap, BTreeSet, HashMap};

use rapier3d::prelude::*;

use super::collider_id::ColliderId;
use super::dispatcher::Dispatcher;
use super::host::{HostError, RegionHost};
use super::query::{BodyFilter, QueryError};
use super::{convert, record};
use crate::space::{BodyId, Bounds};

/// The error of a character or vehicle controller.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ControlError {
    /// A pose or a desired movement is not valid.
    #[error(transparent)]
    Query(#[from] QueryError),
    /// A body near the character or vehicle cannot be built.
    #[error(transparent)]
    Host(#[from] HostError),
    /// A character that pushes must have a mass above 0.
    #[error("a character of {0} kg cannot push; give it a mass above 0")]
    Mass(f32),
    /// The chassis is no dynamic body of the world.
    #[error("{0} is no movable body of this world; a vehicle needs a dynamic chassis that is in the world")]
    NoChassis(BodyId),
}

/// The neighbourhood of a controller: whole bodies around a place, in one Rapier world.
struct Neighbourhood {
    anchor: [f64; 3],
    world: PhysicsWorld,
    names: HashMap<ColliderHandle, ColliderId>,
    bodies: BTreeMap<BodyId, RigidBodyHandle>,
    /// The colliders that the controller may find. The others only give their bodies mass.
    found: BTreeSet<ColliderId>,
}

impl Neighbourhood {
    /// Gathers the bodies with colliders near a box that the filter lets through. The body `hidden` is added,
    /// but the controller does not find it.
    fn gather(
        host: &RegionHost,
        bounds: &Bounds,
        filter: &BodyFilter<'_>,
        hidden: Option<BodyId>,
    ) -> Result<Self, ControlError> {
        let mut found: BTreeSet<_> =
            host.queries().intersect_aabb_conservative(bounds, filter)?.into_iter().collect();
        found.retain(|id| Some(id.body) != hidden);
        let mut neighbourhood = Self {
            anchor: convert::anchor_of(bounds.centre()),
            world: PhysicsWorld::new(),
            names: HashMap::new(),
            bodies: BTreeMap::new(),
            found,
        };
        let ids: BTreeSet<_> = neighbourhood.found.iter().map(|id| id.body).chain(hidden).collect();
        for body in ids {
            neighbourhood.insert(host, body)?;
        }
        Ok(neighbourhood)
    }

    fn insert(&mut self, host: &RegionHost, id: BodyId) -> Result<(), ControlError> {
        let Some(body) = host.record(id) else { return Ok(()) };
        let (body, colliders) = record::build(&body, self.anchor, host.shapes()).map_err(HostError::from)?;
        let world = &mut self.world;
        let handle = world.insert_body(body);
        for (index, collider) in colliders.into_iter().enumerate() {
            let id = ColliderId { body: id, index };
            let collider = world.insert_collider(collider, Some(handle));
            self.names.insert(collider, id);
            if self.found.contains(&id) {
                let aabb = world.colliders[collider].compute_aabb();
                world.broad_phase.set_aabb(&world.integration_parameters, collider, aabb);
            }
        }
        world.bodies[handle].recompute_mass_properties_from_colliders(&world.colliders);
        self.bodies.insert(id, handle);
        Ok(())
    }

    /// Returns the query pipeline over the colliders that a controller may find.
    fn pipeline(&self) -> QueryPipeline<'_> {
        QueryPipeline { dispatcher: &Dispatcher, ..self.world.query_pipeline() }
    }

    /// Returns the same query pipeline for a controller that pushes bodies.
    fn pipeline_mut(&mut self) -> QueryPipelineMut<'_> {
        let PhysicsWorld { broad_phase, narrow_phase, bodies, colliders, .. } = &mut self.world;
        broad_phase.as_query_pipeline_mut(
            narrow_phase.query_dispatcher(),
            bodies,
            colliders,
            QueryFilter::default(),
        )
    }

    /// Gives the real bodies the velocities that a controller left here, and wakes those that it woke.
    fn hand_back(&self, host: &mut RegionHost) {
        for (&id, &handle) in &self.bodies {
            let body = &self.world.bodies[handle];
            let Some((region, there)) = host.owned(id) else { continue };
            let real = &region.physics().bodies[there];
            let (linear, angular) = (body.linvel(), body.angvel());
            let woke = real.is_sleeping() && !body.is_sleeping();
            if body.is_dynamic() && (woke || linear != real.linvel() || angular != real.angvel()) {
                let wake = !body.is_sleeping();
                host.change_copies(id, |body| {
                    body.set_linvel(linear, wake);
                    body.set_angvel(angular, wake);
                });
            }
        }
    }
}
