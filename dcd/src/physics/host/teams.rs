//! Chooses the threads that do the work of a tick, the calling one or teams, and which regions all of them
//! step together.

use std::time::Instant;

use super::RegionHost;
use super::threads::{self, WORTH_WAKING};

impl RegionHost {
    /// Returns whether so many bodies are awake that it may be worth waking other threads.
    pub(super) fn is_busy(&self) -> bool {
        let awake = self.regions().flat_map(|region| region.physics().islands.active_bodies());
        self.threads.are_teams() && awake.take(WORTH_WAKING).count() == WORTH_WAKING
    }

    /// Does the work of a tick on the threads that take the least time.
    pub(super) fn on_threads<R: Send>(&mut self, work: impl FnOnce(&mut Self) -> R + Send) -> R {
        if !self.is_busy() {
            return work(self);
        }
        let start = Instant::now();
        let done = if self.trial.is_for_teams() { self.on_teams(work) } else { work(self) };
        self.trial.note(start.elapsed());
        done
    }

    pub(super) fn on_teams<R: Send>(&mut self, work: impl FnOnce(&mut Self) -> R + Send) -> R {
        let own = self.threads.clone();
        if own.tasks().is_none() {
            return own.enter(|| work(self));
        }
        // The threads that come for a step form one team where regions are best stepped one by one.
        let teams = if self.one_by_one().is_empty() { self.sides.len() } else { 1 };
        own.gathered(teams, |gathered| {
            self.threads = gathered.clone();
            let done = gathered.enter(|| work(self));
            self.threads = own.clone();
            done
        })
    }

    /// Returns the places of the regions that are best stepped one after the other, by all threads.
    pub(super) fn one_by_one(&self) -> Vec<usize> {
        let awake = self.regions().map(|region| region.physics().islands.num_active_bodies());
        threads::one_by_one(&awake.collect::<Vec<_>>(), self.threads.count())
    }
}
