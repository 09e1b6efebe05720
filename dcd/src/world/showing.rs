//! Shows a world between its steps: which ticks to show now, and how bodies are at any of them.

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

/// What a local world keeps to be shown: how bodies were before the last step.
#[derive(Default)]
pub(super) struct LastStep {
    /// When it was; `None`: nobody asked for a time to show, and nothing is kept.
    stepped: Option<Instant>,
    before: HashMap<BodyId, Motion>,
}

impl LastStep {
    /// Keeps how the bodies that move are before a step.
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

    /// Forgets the last step, since the world is as it was at another time: it is shown as it is until the next.
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

/// What is shown between steps.
impl World {
    /// Returns the ticks to show now. Call it once per frame.
    ///
    /// In a served world states come some times per second, late, unevenly, and not all of them: [`ViewTime::shown`] is as little
    /// behind the world as that allows, and goes forward evenly; [`ViewTime::now`] is where the world is. From the first call on a
    /// client pings the node that tells it of the world, and keeps what states it was told. In a local world `shown` goes from one
    /// step to the next as time goes by since the last [`World::step`], and steps keep how awake bodies were before (some 50 ns each).
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

    /// Returns how a body is shown at a tick, or between two: where it is, and how it moves. `None` if it is not in the world.
    ///
    /// Between known states positions follow cubic Hermite splines, or two straight lines where the velocities tell of an impact;
    /// rotations follow SLERP. Beyond the last state the body goes on and comes to a stop within a quarter of a second. Where a
    /// later state contradicts what was shown at the last [`World::view_time`], the difference melts away within 0.2 s, and 0.1 s more
    /// per metre (above 3 m it jumps). Before [`World::view_time`] was first called, and for a server, it is [`World::motion`].
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

    /// Sets whether a client shows its own avatars, and what they touch, ahead of the world, so that they answer at once; it does at first.
    ///
    /// Once [`World::view_time`] was called, a client keeps a small world of what is within some metres of its avatars. What it asks of them
    /// acts there in the same frame, and names the tick for which it is meant ([`ViewTime::predicted`]), so that nodes do it in just that
    /// one. Where states that come are not as predicted, what follows is computed again, and the difference melts away; so do the
    /// bounds of [`World::motion_at`] hold. At most 64 bodies are predicted, with what joints tie to them, for at most a second and a half; assemblies
    /// with multibodies are not, nor is anything in a world whose ticks are not paced. A local world has nothing to predict.
    pub fn set_prediction(&mut self, predicts: bool) -> Result<(), Error> {
        match &mut self.inner {
            Inner::Local(_) => Ok(()),
            Inner::Remote(world) => world.set_prediction(predicts),
        }
    }

    /// Returns what a client predicts, and how often it was wrong; `None` where nothing is predicted.
    #[cfg(feature = "net")]
    #[must_use]
    pub fn prediction(&self) -> Option<Prediction> {
        match &self.inner {
            Inner::Local(_) => None,
            Inner::Remote(world) => world.prediction(),
        }
    }

    /// Returns [`World::movable_bodies`] as they are shown: own avatars, with what they touch, at [`ViewTime::predicted`], all others at
    /// [`ViewTime::shown`]. What comes near goes from the one to the other within a second.
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
