//! Sets the viewpoints, planes, load balance and step settings of a local world, and reports what its
//! fidelity saves.

use std::collections::BTreeMap;

use super::LocalWorld;
use crate::fidelity::{FidelityReport, Pace};
use crate::physics::StepSettings;
use crate::recording::Operation;
use crate::runtime::WorldError;
use crate::runtime::config::check_viewpoints;
use crate::space::{Axis, Balance, RegionId, TreeError, Viewpoint};

impl LocalWorld {
    /// Sets the viewpoints of the world, for its [`Fidelity`]. Without any viewpoint all of it is looked at.
    pub fn set_viewpoints(&mut self, viewpoints: &[Viewpoint]) -> Result<(), WorldError> {
        check_viewpoints(viewpoints)?;
        self.host.set_viewpoints(viewpoints.to_vec());
        self.tape(true, || Operation::Look(viewpoints.to_vec()));
        Ok(())
    }

    /// Returns what the world's [`Fidelity`] saves and costs; `None` if all is computed in full.
    pub fn fidelity_report(&self) -> Option<FidelityReport> {
        self.host.fidelity_report()
    }

    /// Returns the pace of each region in the last tick, if there is a budget.
    #[doc(hidden)]
    pub fn timed_paces(&self) -> BTreeMap<RegionId, Pace> {
        self.host.timed_paces().cloned().unwrap_or_default()
    }

    /// Has all further steps computed at these paces, whatever time they take, so that the time of the same
    /// steps can be measured again.
    #[doc(hidden)]
    pub fn repeat_paces(&mut self, paces: BTreeMap<RegionId, Pace>) {
        self.host.follow_paces(paces);
    }

    /// Sets the part of the time that audits may take. Tests use it to check the stated error.
    #[doc(hidden)]
    pub fn set_audited(&mut self, part: f64) {
        self.host.set_audited(part);
    }

    /// Audits every island in every tick, besides the audits by which levels are chosen; see
    /// [`RegionHost::true_error_m_s`](crate::physics::RegionHost::true_error_m_s).
    #[doc(hidden)]
    pub fn audit_all(&mut self) {
        self.host.audit_all();
    }

    /// Moves the plane of an inner vertex of the distribution tree, between its neighbours on the same axis.
    /// Bodies change owner as if they had crossed the plane by themselves. Sleeping bodies stay with their
    /// region until they wake. Balance may move the plane again.
    pub fn move_plane(&mut self, vertex: RegionId, at: f64) -> Result<(), WorldError> {
        let mut tree = self.host.partition().tree().clone();
        tree.move_plane(vertex, at)?;
        if !tree.is_sound() {
            let axis = tree.cut_of(vertex).map_or(Axis::X, |(axis, _)| axis);
            return Err(TreeError::Plane { axis, at }.into());
        }
        self.host.refit(tree)?;
        self.tape(true, || Operation::MovePlane(vertex, at));
        Ok(())
    }

    /// Sets the load balance, by which the regions follow the load from now on; `None` leaves the regions as
    /// they are.
    pub fn set_balance(&mut self, balance: Option<Balance>) -> Result<(), WorldError> {
        if let Some((what, value, range)) = balance.as_ref().and_then(Balance::fault) {
            return Err(WorldError::Setting { what, value, range });
        }
        self.host.set_balance(balance);
        self.tape_spoilt();
        Ok(())
    }

    /// Sets how the world is stepped from the next tick on. The coupling, exchanges, depth and island limit
    /// must stay as they are; the tolerance may change.
    pub fn set_settings(&mut self, settings: StepSettings) -> Result<(), WorldError> {
        if let Some((what, value, range)) = settings.fault() {
            return Err(WorldError::Setting { what, value, range });
        }
        let of = |all: &StepSettings| (all.coupling, all.exchanges, all.depth, all.island_limit);
        let (asked, present) = (of(&settings), of(&self.host.asked_settings()));
        if asked != present {
            let range = "the coupling, exchanges, depth and island limit that the world has";
            return Err(WorldError::Setting { what: "coupling", value: format!("{asked:?}"), range });
        }
        self.tape_spoilt();
        self.host.catch_up_all()?;
        self.host.set_settings(settings);
        Ok(())
    }
}
