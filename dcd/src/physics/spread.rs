//! Spreads the work on each of many bodies of a region over the threads of the team that computes it.

use rayon::prelude::*;

/// The number of bodies below which the calling thread looks at all of them: to wake another thread takes as
/// long as to look at a hundred.
const WORTH_SPREADING: usize = 256;

/// The fewest bodies that a thread is given at a time.
const SHARE: usize = 64;

/// The threads that look at the bodies of a region. What they find does not depend on how many they are.
#[derive(Clone, Copy)]
pub(super) struct Team {
    threads: usize,
}

impl Team {
    /// A team of the calling thread alone.
    pub(super) const ALONE: Self = Self { threads: 1 };

    /// Returns the threads of the pool that the calling thread belongs to. The pool must compute nothing but
    /// this region: a thread that waits there does whatever else its pool has to do.
    pub(super) fn here() -> Self {
        Self { threads: rayon::current_num_threads() }
    }

    /// Does the work for each of many bodies, and returns the results in their order.
    pub(super) fn spread<T: Sync, R: Send>(self, bodies: &[T], work: impl Fn(&T) -> R + Sync) -> Vec<R> {
        if self.threads < 2 || bodies.len() < WORTH_SPREADING {
            return bodies.iter().map(work).collect();
        }
        bodies.par_iter().with_min_len(SHARE).map(&work).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_are_in_order_and_come_from_all_threads_of_the_pool_that_it_is_called_in() {
        let bodies: Vec<_> = (0..10 * WORTH_SPREADING).collect();
        let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
        let met = std::sync::Barrier::new(3);
        let is_first = |body: &usize| body.is_multiple_of(2 * WORTH_SPREADING);
        let found = pool.install(|| {
            let firsts = std::sync::atomic::AtomicUsize::new(0);
            Team::here().spread(&bodies, |body| {
                let order = std::sync::atomic::Ordering::Relaxed;
                // Three bodies must be looked at at once, or no thread gets on.
                if is_first(body) && firsts.fetch_add(1, order) < 3 {
                    met.wait();
                }
                (2 * body, rayon::current_thread_index())
            })
        });
        assert!(found.iter().map(|(double, _)| double / 2).eq(bodies.iter().copied()));
        let of = |thread| found.iter().filter(|(_, by)| *by == Some(thread)).count();
        assert!((0..3).all(|thread| of(thread) > 0));
        let alone = Team::ALONE.spread(&bodies, |_| std::thread::current().id());
        assert!(alone.iter().all(|thread| *thread == std::thread::current().id()));
    }
}
