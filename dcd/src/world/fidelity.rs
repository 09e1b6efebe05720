//! Says where a world is looked at from, so that all else is computed less often, and what that saves and costs.

use super::error::Error;
use super::{Inner, World};
use crate::fidelity::FidelityReport;
use crate::space::Viewpoint;

/// How much is computed in full.
impl World {
    /// Sets where a world is looked at from, for its [`Fidelity`](crate::Fidelity): regions farther than what is seen from there are
    /// stepped less often. A local world without any viewpoint is looked at everywhere. Call it as often as viewers move.
    ///
    /// A served world is looked at from the viewpoints that its server's program set last, at first from those that it had when it began to be
    /// served, and by its clients ([`World::set_interest`]). What the program sets counts some ticks later, on all nodes from the same tick on, and
    /// is kept when the server stops.
    ///
    /// ```
    /// use dcd::{Fidelity, Viewpoint};
    /// # use dcd::prelude::*;
    ///
    /// let scene = Scene::open("town", &Params::default().with("n", 1_200))?;
    /// let config = WorldConfig { fidelity: Fidelity::AUTO, ..WorldConfig::for_scene(&scene) };
    /// let mut world = World::from_scene(&scene, config)?;
    /// world.set_viewpoints(&[Viewpoint { at: [-120.0, 2.0, -60.0], radius_m: 50.0 }])?;
    /// for _ in 0..120 {
    ///     world.step()?;
    /// }
    /// let report = world.fidelity_report().unwrap();
    /// assert!(report.levels[2] > 0, "some regions are stepped in every fourth tick: {report:?}");
    /// # Ok::<(), dcd::Error>(())
    /// ```
    pub fn set_viewpoints(&mut self, viewpoints: &[Viewpoint]) -> Result<(), Error> {
        match &mut self.inner {
            Inner::Local(world) => Ok(world.set_viewpoints(viewpoints)?),
            Inner::Remote(world) => world.set_viewpoints(viewpoints),
        }
    }

    /// Returns what [`Fidelity`](crate::Fidelity) saves and costs; `None` where all is computed in full. The server of a world says what the leader
    /// of its main group told last; nodes and clients do not know.
    #[must_use]
    pub fn fidelity_report(&self) -> Option<FidelityReport> {
        match &self.inner {
            Inner::Local(world) => world.fidelity_report(),
            Inner::Remote(world) => world.fidelity_report(),
        }
    }
}
