//! Shows a world between its steps: which ticks to show now, and where bodies are at any tick.

use std::collections::HashMap;
use std::time::Instant;

use super::error::Error;
use super::view::MovableBody;
use super::{Inner, World};
use crate::playback::{Motion, ViewTime};
#[cfg(feature = "net")]
use crate::prediction::Prediction;
use crate::protocol::{Velocity, WorldPose};
use crate::runtime::LocalWorld;
use crate::space::BodyId;

/// The motion of bodies before the last step of a local world, kept to show the world between steps.
#[derive(Default)]
pub(super) struct LastStep {
    /// The time of the last step; `None` until someone asks for a time to show, and then nothing is kept.
    stepped: Option<Instant>,
    before: HashMap<BodyId, Motion>,
}

impl LastStep {
    /// Keeps the motion of the awake bodies before a step.
    pub(super) fn keep(&mut self, world: &LocalWorld) {
        if self.stepped.is_none() {
            return;
        }
        self.before.clear();
        let host = world.host();
        self.before.extend(host.awake_bodies().into_iter().filter_map(|id| {
            let (region, handle) = host.owned(id)?;
            let (pose, velocity) = region.motion(handle);
            Some((id, Motion { pose, velocity }))
        }));
        self.stepped = Some(Instant::now());
    }

    /// Forgets the last step, since the world went back in time. It is shown as it is until the next step.
    pub(super) fn go_back(&mut self) {
        self.before.clear();
        self.stepped = self.stepped.map(|_| Instant::now());
    }

    fn time(&mut self, world: &LocalWorld) -> ViewTime {
        let stepped = *self.stepped.get_or_insert_with(Instant::now);
        let since = stepped.elapsed().as_secs_f64() / f64::from(world.host().settings().dt_s);
        let shown = (world.tick().0 as f64 - 1.0 + since.min(1.0)).max(0.0);
        ViewTime::new(world.tick().0 as f64, shown)
    }

    fn motion(&self, id: BodyId, now: Motion, world: &LocalWorld, at: f64) -> Motion {
        if self.stepped.is_none() {
            return now;
        }
        let dt_s = f64::from(world.host().settings().dt_s);
        let after = at - world.tick().0 as f64;
        if after >= 0.0 {
            return now.beyond(after * dt_s);
        }
        let Some(before) = self.before.get(&id) else { return now };
        before.towards(&now, dt_s, 1.0 + after)
    }
}

/// What to show between steps.
impl World {
    /// Returns the ticks to show now: fractions are times between two ticks. Call it once per frame.
    ///
    /// In a served world some states arrive per second: late, at uneven intervals, and not all of them.
    /// [`ViewTime::shown`] lags behind the world as little as that allows, and advances evenly;
    /// [`ViewTime::now`] is the tick of the world itself. From the first call on, a client pings the node
    /// that tells it of the world, and keeps the states that it receives.
    ///
    /// In a local world `shown` goes from one step to the next as time passes since the last [`World::step`].
    /// From the first call on, steps keep the motion of awake bodies (some 50 ns each).
    ///
    /// ```
    /// # use dcd::prelude::*;
    /// let mut world = World::new(WorldConfig::default())?;
    /// let ball = RigidBodyBuilder::dynamic().linvel(Vector::new(6.0, 0.0, 0.0)).gravity_scale(0.0);
    /// let ball = world.insert(ball, ColliderBuilder::ball(0.5))?;
    /// world.view_time();
    /// world.step()?;
    /// let time = world.view_time();
    /// assert!((0.0..=1.0).contains(&time.shown) && time.now == 1.0);
    /// let (pose, _) = world.motion_at(ball, 0.5).unwrap();
    /// assert!((pose.translation[0] - 0.05).abs() < 1e-6, "between the steps: {pose:?}");
    /// # Ok::<(), dcd::Error>(())
    /// ```
    pub fn view_time(&mut self) -> ViewTime {
        let Self { inner, last_step, .. } = self;
        match inner {
            Inner::Local(world) => last_step.time(world),
            Inner::Remote(world) => world.view_time(),
        }
    }

    /// Returns the pose and velocity with which to show a body at a tick, or between two; `None` if the body
    /// is not in the world.
    ///
    /// - Between known states positions follow cubic Hermite splines, or two straight lines where the
    ///   velocities indicate an impact. Rotations follow SLERP.
    /// - Beyond the last state the body moves on, and comes to a stop within a quarter of a second.
    /// - Where a later state contradicts what was shown at the last [`World::view_time`], the difference
    ///   fades out within 0.2 s, and 0.1 s more per metre. Above 3 m it jumps.
    /// - Before the first [`World::view_time`], and for a server, the result is that of [`World::motion`].
    #[must_use]
    pub fn motion_at(&self, body: BodyId, tick: f64) -> Option<(WorldPose, Velocity)> {
        let shown = match &self.inner {
            Inner::Local(world) => {
                let (pose, velocity) = world.motion(body)?;
                self.last_step.motion(body, Motion { pose, velocity }, world, tick)
            }
            Inner::Remote(world) => world.motion_at(body, tick)?,
        };
        Some((shown.pose, shown.velocity))
    }

    /// Sets whether a client predicts its own avatars and what they touch, so that they answer to inputs at
    /// once (client-side prediction). It does at first. A local world ignores the call; a server or node
    /// returns an error.
    ///
    /// From the first [`World::view_time`] on, a client keeps a small world of what is within some metres of
    /// its avatars. An input acts there in the same frame. It names the tick for which it is meant
    /// ([`ViewTime::predicted`]), and nodes apply it in exactly that tick. Where states arrive that differ
    /// from the prediction, the client computes the ticks since again, and the difference fades out within
    /// the bounds of [`World::motion_at`].
    ///
    /// At most 64 bodies are predicted, with the bodies that joints tie to them, for at most a second and a
    /// half. Assemblies with multibodies are not predicted, nor is anything in a world whose ticks are not
    /// paced.
    pub fn set_prediction(&mut self, predicts: bool) -> Result<(), Error> {
        match &mut self.inner {
            Inner::Local(_) => Ok(()),
            Inner::Remote(world) => world.set_prediction(predicts),
        }
    }

    /// Returns how much a client predicts, and how often it was wrong; `None` where nothing is predicted.
    #[cfg(feature = "net")]
    #[must_use]
    pub fn prediction(&self) -> Option<Prediction> {
        match &self.inner {
            Inner::Local(_) => None,
            Inner::Remote(world) => world.prediction(),
        }
    }

    /// Returns [`World::movable_bodies`] as they are to be shown: own avatars and what they touch at
    /// [`ViewTime::predicted`], all others at [`ViewTime::shown`]. A body that comes near goes over from one
    /// to the other within a second.
    #[must_use]
    pub fn movable_bodies_at(&self, time: &ViewTime) -> Box<dyn Iterator<Item = MovableBody> + '_> {
        let world = match &self.inner {
            Inner::Local(world) => world,
            Inner::Remote(world) => return world.movable_bodies_at(time),
        };
        let shown = time.shown;
        Box::new(self.movable_bodies().map(move |body| {
            let now = Motion { pose: body.pose, velocity: body.velocity };
            body.moved_to(self.last_step.motion(body.id, now, world, shown))
        }))
    }
}

#[cfg(test)]
mod tests {
    use rapier3d::prelude::*;

    use super::*;
    use crate::runtime::WorldConfig;

    #[test]
    fn a_world_is_shown_as_it_is_until_somebody_asks_for_a_time() {
        let mut world = World::new(WorldConfig::default()).unwrap();
        let ball = RigidBodyBuilder::dynamic().linvel(Vector::new(6.0, 0.0, 0.0));
        let ball = world.insert(ball, ColliderBuilder::ball(0.5)).unwrap();
        world.step().unwrap();
        let now = world.motion(ball).unwrap();
        for tick in [0.5, 1.0, 16.0] {
            assert_eq!(world.motion_at(ball, tick), Some(now), "{tick}");
        }
        let shown = world.movable_bodies_at(&ViewTime::new(16.0, 16.0)).next().unwrap();
        assert_eq!((shown.pose, shown.velocity), now);
        world.view_time();
        assert!(world.motion_at(ball, 16.0).unwrap().0.translation[0] > now.0.translation[0] + 0.5);
    }
}
