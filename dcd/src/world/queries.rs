//! Answers spatial queries (rays, shape casts, projections, overlaps): at once in a local world, some ticks
//! later in a served one.

use std::collections::BTreeMap;

use super::role::Instead;
use super::{Error, Inner, World};
use crate::physics::Queries;
use crate::protocol::{Query, QueryResult};

/// Answers of a local world to submitted queries that the program has not taken yet.
#[derive(Default)]
pub(super) struct Answers {
    last: u64,
    here: BTreeMap<u64, QueryResult>,
}

/// Queries.
impl World {
    /// Returns the interface for rays, shape casts, projections and overlaps in all regions, of the state as
    /// it is now. Local worlds only: clients and participants of a served world use [`World::submit`], and so
    /// does the program of a server.
    ///
    /// ```
    /// # use dcd::prelude::*;
    /// # let world = World::new(WorldConfig::default())?;
    /// let down = WorldRay::new([0.0, 10.0, 0.0], [0.0, -1.0, 0.0]);
    /// if let Some(hit) = world.queries()?.cast_ray(&down, &BodyFilter::default())? {
    ///     println!("{} at {:?}, {} m away", hit.body, hit.point, hit.distance_m);
    /// }
    /// # Ok::<(), dcd::Error>(())
    /// ```
    pub fn queries(&self) -> Result<Queries<'_>, Error> {
        Ok(self.local("ask by rays, shapes and points", Instead::SubmitQuery)?.queries())
    }

    /// Submits a query to the processes that compute the world, and returns the number by which
    /// [`World::answer`] gives the answer: at once in a local world, some ticks later in a served one.
    /// `query.number` is ignored. A query of a server's program sees what the program did since its last
    /// step: both are then sent with the next step. A node returns an error.
    ///
    /// In a served world the answer may name bodies that this process does not know ([`World::contains`]): a
    /// client with an area of interest is not told of all, and bodies come and go meanwhile.
    ///
    /// ```
    /// use dcd::prelude::*;
    /// use dcd::query::{Query, QueryResult, RayQuery};
    ///
    /// # let mut world = World::new(WorldConfig::default())?;
    /// let wall = world.insert(RigidBodyBuilder::fixed(), ColliderBuilder::cuboid(1.0, 1.0, 1.0))?;
    /// // The same in a world that is served: there the loop takes some ticks.
    /// let number = world.submit(Query::rays([RayQuery::new([9.0, 0.0, 0.0], [-1.0, 0.0, 0.0]).up_to(50.0)]))?;
    /// let answer = loop {
    ///     if let Some(answer) = world.answer(number)? {
    ///         break answer;
    ///     }
    ///     world.step()?;
    /// };
    /// let QueryResult::Rays(hits) = answer else { unreachable!("rays were asked for") };
    /// assert_eq!(hits[0].map(|hit| hit.body), Some(wall));
    ///
    /// let ball = Query::intersect_shape(&SharedShape::ball(2.0), WorldPose::at([2.5, 0.0, 0.0]))?;
    /// let number = world.submit(ball)?;
    /// let Some(QueryResult::Overlaps(found)) = world.answer(number)? else { unreachable!("a local world") };
    /// assert_eq!(found[0][0].body, wall);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn submit(&mut self, query: Query) -> Result<u64, Error> {
        match &mut self.inner {
            Inner::Local(world) => {
                let found = world.queries().answer(&query);
                self.answers.last += 1;
                self.answers.here.insert(self.answers.last, found);
                Ok(self.answers.last)
            }
            Inner::Remote(world) => world.submit(query),
        }
    }

    /// Takes the answer to a submitted query, once, after it has come; `None` before.
    pub fn answer(&mut self, number: u64) -> Result<Option<QueryResult>, Error> {
        match &mut self.inner {
            Inner::Local(_) => Ok(self.answers.here.remove(&number)),
            Inner::Remote(world) => world.answer(number),
        }
    }

    /// Cancels a submitted query and drops its answer.
    pub fn forget(&mut self, number: u64) {
        match &mut self.inner {
            Inner::Local(_) => drop(self.answers.here.remove(&number)),
            Inner::Remote(world) => world.forget(number),
        }
    }
}
