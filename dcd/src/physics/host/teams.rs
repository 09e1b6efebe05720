//! Sets how many threads there are. Chooses those that do the work of a tick, the calling one or teams, and
//! which regions all of them step together.

use std::sync::Arc;
use std::time::Instant;

use super::threads::{self, Threads, WORTH_WAKING};
use super::{HostError, RegionHost, Tasks};

impl RegionHost {
    /// Sets the number of threads that step the regions here; 1 uses the calling thread, as a world of few
    /// bodies always does. Results do not depend on it. With the feature `parallel` a single region uses all
    /// threads, and several regions divide them. Without it, each region uses one.
    pub fn set_threads(&mut self, threads: usize) -> Result<(), HostError> {
        let tasks = self.threads.tasks().cloned();
        self.threads = Threads::new(threads, self.sides.len(), tasks)?;
        Ok(())
    }

    /// Makes the program's own threads step the regions here from now on, as many as were set. `None` goes
    /// back to threads of the host's own.
    pub(crate) fn set_tasks(&mut self, tasks: Option<Arc<dyn Tasks>>) -> Result<(), HostError> {
        self.threads = Threads::new(self.threads.count(), self.sides.len(), tasks)?;
        Ok(())
    }

    /// Returns the number of threads that step the regions here.
    pub fn threads(&self) -> usize {
        self.threads.count()
    }

    /// Does the work for each of many small things, on all threads if they are worth waking. Returns the
    /// results in the order of the things.
    pub(in crate::physics) fn spread<T: Sync, R: Send>(
        &self,
        things: &[T],
        work: impl Fn(&T) -> R + Sync,
    ) -> Vec<R> {
        self.threads.spread(things, work)
    }

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
