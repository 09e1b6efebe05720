//! Sets the viewpoints of a world, away from which it is computed less often, and reports what that saves and
//! costs.

use super::error::Error;
use super::{Inner, World};
use crate::fidelity::FidelityReport;
use crate::space::Viewpoint;

/// Viewpoints and fidelity.
impl World {
    /// Sets the viewpoints from which a world is looked at, for its [`Fidelity`](crate::Fidelity): regions
    /// that no viewpoint sees are stepped less often. A local world without any viewpoint counts as looked at
    /// everywhere. Call it whenever viewers move.
    ///
    /// A served world is looked at from the viewpoints that its server's program set last, and by its clients
    /// ([`World::set_interest`]). At first these are the viewpoints that the world had when it began to be
    /// served. Viewpoints that the program sets take effect some ticks later, in the same tick on all nodes,
    /// and are kept when the server stops. Clients and nodes return an error.
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

    /// Returns what [`Fidelity`](crate::Fidelity) saves and costs; `None` for a world that is computed in
    /// full. A server returns what the leader of the main group last reported. Nodes and clients return
    /// `None`.
    #[must_use]
    pub fn fidelity_report(&self) -> Option<FidelityReport> {
        match &self.inner {
            Inner::Local(world) => world.fidelity_report(),
            Inner::Remote(world) => world.fidelity_report(),
        }
    }
}
