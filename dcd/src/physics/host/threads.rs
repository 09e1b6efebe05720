//! Steps regions on threads: teams of workers for many bodies, the calling thread for few.
//!
//! A team is a rayon pool that steps one region at a time, with Rapier's own parallel solver on all of the
//! team's threads (feature `parallel`). Each team has a pool of its own, because a step of Rapier waits,
//! without taking other work, for what it hands to its pool. In a pool that several regions shared, all
//! threads could come to wait like that, with none left to work.

use std::num::NonZero;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use super::HostError;
use super::tasks::{self, Tasks};

/// Fewer awake bodies than this are stepped by the calling thread. They are worth less than waking a worker,
/// which takes 15 to 30 µs. Rapier shares out bodies by 256.
pub(super) const WORTH_WAKING: usize = 256;

/// Fewer small things than this, a microsecond or more each, are done by the calling thread, for the same
/// reason.
const WORTH_SPREADING: usize = 128;

/// The worker threads, in teams. Results do not depend on them.
#[derive(Clone)]
pub(super) struct Threads {
    count: usize,
    teams: Arc<[rayon::ThreadPool]>,
    /// As many threads as all teams have, for a region that has more to do than all others.
    all: Option<Arc<rayon::ThreadPool>>,
    /// The source of threads when there is work. With it, there are no teams between ticks.
    tasks: Option<Arc<dyn Tasks>>,
}

impl Default for Threads {
    fn default() -> Self {
        Self { count: 1, teams: Arc::new([]), all: None, tasks: None }
    }
}

impl Threads {
    /// Starts `count` threads for so many regions; none if `count` is 1, or if the program has its own.
    pub(super) fn new(
        count: usize,
        regions: usize,
        tasks: Option<Arc<dyn Tasks>>,
    ) -> Result<Self, HostError> {
        let mut threads = Self { count: count.max(1), tasks, ..Self::default() };
        threads.suit(regions)?;
        Ok(threads)
    }

    /// Returns where threads come from, if the program has its own.
    pub(super) fn tasks(&self) -> Option<&Arc<dyn Tasks>> {
        self.tasks.as_ref()
    }

    /// Does the work on the threads that there are for so many regions. If the program has its own threads,
    /// these are the ones that come. For one region they form one team.
    pub(super) fn gathered<R>(&self, regions: usize, work: impl FnOnce(Self) -> R) -> R {
        let Some(tasks) = self.tasks.as_deref().filter(|_| !team_sizes(self.count, regions).is_empty())
        else {
            return work(self.clone());
        };
        let sizes = |came: NonZero<usize>| match came.get() {
            1 => vec![1],
            came => team_sizes(came, regions),
        };
        tasks::gather(tasks, self.count, sizes, |pools| {
            work(Self { teams: pools.into(), all: None, tasks: None, count: self.count })
        })
    }

    /// Returns the number of threads.
    pub(super) fn count(&self) -> usize {
        self.count
    }

    /// Forms the teams that suit this many regions, unless they are formed so already.
    pub(super) fn suit(&mut self, regions: usize) -> Result<(), HostError> {
        if self.tasks.is_some() {
            return Ok(());
        }
        let sizes = team_sizes(self.count, regions);
        if !self.teams.iter().map(rayon::ThreadPool::current_num_threads).eq(sizes.iter().copied()) {
            let pool = |name: String, size| {
                rayon::ThreadPoolBuilder::new()
                    .num_threads(size)
                    .thread_name(move |i| format!("dcd-{name}-{i}"))
                    .build()
                    .map_err(|cause| HostError::Threads { threads: self.count, cause })
            };
            let splits = cfg!(feature = "parallel") && sizes.len() > 1;
            let all = splits.then(|| pool("all".to_owned(), self.count).map(Arc::new)).transpose()?;
            let teams = sizes.into_iter().enumerate().map(|(team, size)| pool(team.to_string(), size));
            self.teams = teams.collect::<Result<_, _>>()?;
            self.all = all;
        }
        Ok(())
    }

    /// Does the work on a thread of the first team, if there are teams.
    pub(super) fn enter<R: Send>(&self, work: impl FnOnce() -> R + Send) -> R {
        match self.teams.first() {
            Some(first) => first.install(work),
            None => work(),
        }
    }

    /// Does the work on all threads together. Rapier's parallel solver then shares it out among them.
    pub(super) fn together<R: Send>(&self, work: impl FnOnce() -> R + Send) -> R {
        match &self.all {
            Some(all) => all.install(work),
            None => work(),
        }
    }

    /// Does the work for each of many small things, and returns the results in their order.
    pub(super) fn spread<T: Sync, R: Send>(&self, things: &[T], work: impl Fn(&T) -> R + Sync) -> Vec<R> {
        use rayon::prelude::*;
        if things.len() < WORTH_SPREADING {
            return things.iter().map(work).collect();
        }
        self.gathered(1, |threads| match threads.all.as_deref().or(threads.teams.first()) {
            Some(pool) => {
                let chunks = things.par_iter().with_min_len(WORTH_SPREADING / 4);
                pool.install(|| chunks.map(&work).collect())
            }
            None => things.iter().map(&work).collect(),
        })
    }

    /// Returns whether there are teams, or will be.
    pub(super) fn are_teams(&self) -> bool {
        !self.teams.is_empty() || (self.tasks.is_some() && self.count > 1)
    }

    /// Returns whether the calling thread is of the first team.
    pub(super) fn are_entered(&self) -> bool {
        self.teams.first().is_some_and(|first| first.current_thread_index().is_some())
    }

    /// Does the same work on all of these: each team takes the next one when it is done with its last.
    /// Outside the teams, the calling thread does all of it.
    pub(super) fn share_out<T: Send>(&self, all: Vec<&mut T>, work: impl Fn(&mut T) + Sync) {
        let teams = if self.are_entered() { &self.teams[..self.teams.len().min(all.len())] } else { &[] };
        let queue = Mutex::new(all.into_iter());
        let next = || queue.lock().expect("no panic while locked").next();
        let take_turns = || {
            while let Some(one) = next() {
                work(one);
            }
        };
        with_all(teams.get(1..).unwrap_or(&[]), &take_turns);
    }
}

/// About the part of a Rapier step that one thread does while the others wait. Sixteen threads step ten
/// thousand boxes that rest on one another six to nine times as fast as one, and the same boxes in flight
/// three to five times (suite `cores` of the benchmarks).
const SERIAL: f64 = 0.15;

/// Gathering what a region tells others takes about one part in this many of its step, an eighth, where many
/// bodies lie near borders.
pub(super) const WORTH_WAITING: usize = 8;

/// Regions are stepped one by one only if the tick then takes less than this part of what it would take
/// otherwise.
const WORTH_GATHERING: f64 = 0.85;

/// Returns the speed-up of a region's step by this many threads over one (Amdahl 1967).
fn speed_up(threads: f64) -> f64 {
    1.0 / (SERIAL + (1.0 - SERIAL) / threads.max(1.0))
}

/// Returns the places of the regions that are best stepped one after the other, each by all threads, before
/// the teams share out the others. `awake` is how many bodies are awake in each region. If one region has
/// most of the work, its team would be at it long after all others are done.
pub(super) fn one_by_one(awake: &[usize], threads: usize) -> Vec<usize> {
    let teams = team_sizes(threads, awake.len()).len();
    if teams < 2 || !cfg!(feature = "parallel") {
        return Vec::new();
    }
    let (all, team) = (speed_up(threads as f64), speed_up(threads as f64 / teams as f64));
    let mut places: Vec<_> = (0..awake.len()).collect();
    places.sort_by_key(|&place| std::cmp::Reverse(awake[place]));
    let heaviest_first: Vec<_> = places.iter().map(|&place| awake[place] as f64).collect();
    let worth_all = places.iter().take_while(|&&place| awake[place] >= 4 * WORTH_WAKING).count();
    // The time of a tick, in bodies that one thread would step in it.
    let takes = |first: usize| {
        let (by_all, by_teams) = heaviest_first.split_at(first);
        let shared_out = by_teams.iter().sum::<f64>() / by_teams.len().clamp(1, teams) as f64;
        let longest = by_teams.first().copied().unwrap_or_default();
        by_all.iter().sum::<f64>() / all + shared_out.max(longest) / team
    };
    let best = (0..=worth_all).min_by(|&a, &b| takes(a).total_cmp(&takes(b))).unwrap_or(0);
    places.truncate(if takes(best) < WORTH_GATHERING * takes(0) { best } else { 0 });
    places
}

/// Ticks that are looked at together. The shortest counts, since others may have been interrupted.
const LOOK: u32 = 4;
/// The least and the most ticks between two trials.
const PAUSES: [u32; 2] = [16, 1024];

/// A trial, made anew now and then, of whether the teams are faster than the calling thread alone. On cores
/// that others use too they may be slower by far: a thread that is kept from its share of a step keeps all of
/// them waiting. A pile and flying cubes, 1,000 bodies each, took 30 and 90 times as long on two cores with
/// 14 processes at work.
#[derive(Clone, Debug)]
pub(super) struct Trial {
    by_teams: bool,
    /// Says whether the other way is being tried.
    is_on: bool,
    /// Ticks of this look so far; `shortest` is the shortest of them.
    looked: u32,
    shortest: Duration,
    /// What the last look at the way in use found; `other`: what the last look at the other way found.
    present: Duration,
    other: Duration,
    /// Ticks since the last trial; `pause` is how long to wait for a trial that promises something.
    since: u32,
    pause: u32,
}

impl Default for Trial {
    fn default() -> Self {
        Self {
            by_teams: true,
            is_on: false,
            looked: 0,
            shortest: Duration::MAX,
            present: Duration::MAX,
            other: Duration::ZERO,
            since: PAUSES[0],
            pause: PAUSES[0],
        }
    }
}

impl Trial {
    /// Returns whether the teams do the next tick.
    pub(super) fn is_for_teams(&self) -> bool {
        self.by_teams != self.is_on
    }

    /// Notes how long that tick took.
    pub(super) fn note(&mut self, took: Duration) {
        self.shortest = self.shortest.min(took);
        self.looked += 1;
        self.since = self.since.saturating_add(1);
        let is_hopeless = self.is_on && self.looked * 2 >= LOOK && self.shortest > 2 * self.present;
        if self.looked < LOOK && !is_hopeless {
            return;
        }
        let shortest = std::mem::replace(&mut self.shortest, Duration::MAX);
        self.looked = 0;
        if self.is_on {
            self.is_on = false;
            self.since = 0;
            self.other = shortest;
            if shortest < self.present {
                self.by_teams = !self.by_teams;
                self.other = self.present;
                self.pause = PAUSES[0];
            } else {
                self.pause = (2 * self.pause).min(PAUSES[1]);
            }
        } else {
            self.present = shortest;
            let pause = if shortest > self.other { self.pause } else { PAUSES[1] };
            self.is_on = self.since >= pause;
        }
    }
}

/// Does the work here and once in each of the teams, at the same time.
fn with_all(teams: &[rayon::ThreadPool], work: &(impl Fn() + Sync)) {
    match teams.split_first() {
        Some((team, others)) => team.in_place_scope(|scope| {
            scope.spawn(|_| work());
            with_all(others, work);
        }),
        None => work(),
    }
}

/// Returns the sizes of the teams: as many teams as regions, or as threads if these are fewer, all of about
/// the same size. One thread forms none.
fn team_sizes(threads: usize, regions: usize) -> Vec<usize> {
    let teams = if threads < 2 { 0 } else { threads.min(regions) };
    if cfg!(feature = "parallel") {
        (0..teams).map(|team| threads / teams + usize::from(team < threads % teams)).collect()
    } else {
        // Without it, no work within a region is shared out.
        if teams < 2 { Vec::new() } else { vec![1; teams] }
    }
}

/// Does the work on the calling thread alone. Rapier's parallel solver spreads over the pool in which it is
/// called, or over rayon's global one. So the calling thread becomes a pool of one while this lasts, which
/// takes 1.5 µs. A thread that already is a pool of one stays it. A thread of a larger pool cannot leave
/// that, and waits for another thread that is a pool of one.
#[cfg(feature = "parallel")]
pub(super) fn alone<T: Send + 'static>(state: &mut Vec<T>, work: impl FnOnce(&mut [T]) + Send + 'static) {
    use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
    use std::sync::mpsc;

    let is_in_pool = rayon::current_thread_index().is_some();
    if is_in_pool && rayon::current_num_threads() == 1 {
        return work(state);
    }
    let mut moved = std::mem::take(state);
    let (done, outcome) = mpsc::channel();
    let job = move || {
        let result = catch_unwind(AssertUnwindSafe(|| work(&mut moved)));
        // The caller does not leave before this has come.
        let _ = done.send((moved, result));
    };
    if is_in_pool {
        beside(job)
    } else {
        as_pool_of_one(job)
    }
    let (moved, result) = outcome.recv().expect("the job always answers");
    *state = moved;
    if let Err(panic) = result {
        resume_unwind(panic);
    }
}

#[cfg(not(feature = "parallel"))]
pub(super) fn alone<T>(state: &mut Vec<T>, work: impl FnOnce(&mut [T])) {
    work(state);
}

/// Makes the calling thread the only one of a pool that ends with the job.
#[cfg(feature = "parallel")]
fn as_pool_of_one(job: impl FnOnce() + Send + 'static) {
    let mut seat = None;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).spawn_handler(|thread| {
        seat = Some(thread);
        Ok(())
    });
    let pool = pool.build().expect("no thread is started for it");
    pool.spawn(job);
    // What was spawned is still done: a worker's loop ends when its pool has been dropped and nothing is left
    // to do.
    drop(pool);
    seat.expect("a pool of one thread asks for one").run();
}

/// Begins the job on a helper thread that belongs to the calling one.
#[cfg(feature = "parallel")]
fn beside(job: impl FnOnce() + Send + 'static) {
    thread_local! {
        static BESIDE: rayon::ThreadPool = rayon::ThreadPoolBuilder::new()
            .num_threads(1)
            .thread_name(|_| "dcd-beside".to_owned())
            .build()
            .expect("the system gives each thread of a pool that steps worlds another one");
    }
    BESIDE.with(|pool| pool.spawn(job));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(feature = "parallel")]
    #[test]
    fn a_region_has_all_threads_when_others_would_long_be_done_before_it() {
        assert_eq!(one_by_one(&[2723, 2722], 2), [0; 0], "both have a thread's work");
        assert_eq!(
            one_by_one(&[6000, 4000], 2),
            [0; 0],
            "a thread each is done sooner than both one after the other"
        );
        assert_eq!(one_by_one(&[500, 9000, 100], 2), [1]);
        assert_eq!(one_by_one(&[900, 0], 2), [0; 0], "it is not worth more than one");
        assert_eq!(one_by_one(&[9000, 0, 0], 1), [0; 0], "one thread is all");
        assert_eq!(one_by_one(&[], 2), [0; 0]);
    }

    #[cfg(feature = "parallel")]
    #[test]
    fn many_threads_step_uneven_regions_one_by_one_and_even_ones_side_by_side() {
        assert_eq!(one_by_one(&[1250; 8], 16), [0; 0]);
        let mut uneven = one_by_one(&[2000, 5000, 500, 500, 500, 500, 500, 500], 16);
        uneven.sort_unstable();
        assert_eq!(uneven, [0, 1]);
    }

    #[test]
    fn threads_are_dealt_out_evenly_and_no_team_is_idle() {
        assert_eq!(team_sizes(1, 8), [0; 0]);
        assert_eq!(team_sizes(4, 256), [1; 4]);
        if cfg!(feature = "parallel") {
            assert_eq!(team_sizes(8, 3), [3, 3, 2]);
            assert_eq!(team_sizes(2, 1), [2]);
        } else {
            assert_eq!(team_sizes(8, 3), [1; 3]);
            assert_eq!(team_sizes(2, 1), [0; 0]);
        }
    }

    #[test]
    fn a_trial_finds_the_faster_way_soon_and_follows_when_that_changes() {
        // Takes milliseconds per tick by teams and alone. Returns how many ticks of a thousand the teams do.
        let ticks_of_teams = |trial: &mut Trial, by_teams: u64, alone: u64| {
            let ticks = (0..1000).filter(|_| {
                let is_for_teams = trial.is_for_teams();
                trial.note(Duration::from_millis(if is_for_teams { by_teams } else { alone }));
                is_for_teams
            });
            ticks.count()
        };
        let mut trial = Trial::default();
        let shares = [(50, 100), (3000, 100), (50, 100), (50, 100), (110, 100), (50, 100), (50, 100)]
            .map(|(by_teams, alone)| ticks_of_teams(&mut trial, by_teams, alone));
        assert!(shares[0] > 980, "{shares:?}");
        assert!(shares[1] < 40, "a machine at work for others: {shares:?}");
        assert!(shares[3] > 980, "and free again: {shares:?}");
        assert!(shares[4] < 60, "{shares:?}");
        assert!(shares[6] > 980, "{shares:?}");
    }

    #[test]
    fn everything_is_done_once_inside_the_teams_and_outside() {
        for (count, regions) in [(1, 5), (2, 5), (3, 2), (4, 1)] {
            let threads = Threads::new(count, regions, None).unwrap();
            let mut all = vec![0; 40];
            threads.share_out(all.iter_mut().collect(), |one| *one += 1);
            threads.enter(|| threads.share_out(all.iter_mut().collect(), |one| *one += 1));
            assert_eq!(all, [2; 40], "{count} threads");
        }
    }

    #[cfg(feature = "parallel")]
    #[test]
    fn many_small_things_are_spread_over_all_threads_and_answered_in_order() {
        for (count, regions) in [(1, 1), (2, 1), (3, 2)] {
            let threads = Threads::new(count, regions, None).unwrap();
            let things: Vec<_> = (0..4 * WORTH_SPREADING).collect();
            // Each thread waits at one thing: all are in at the same time, or this hangs.
            let all_are_in = std::sync::Barrier::new(count);
            let part = things.len() / count;
            let marked = |&thing: &usize| {
                if thing % part == 0 && thing / part < count {
                    all_are_in.wait();
                }
                2 * thing
            };
            let doubled = threads.spread(&things, marked);
            assert!(doubled.iter().enumerate().all(|(i, &twice)| twice == 2 * i), "{count} threads");
        }
        let here = std::thread::current().id();
        let few = Threads::new(2, 1, None).unwrap().spread(&[(); 3], |()| std::thread::current().id());
        assert_eq!(few, [here; 3], "nobody is woken for three");
    }

    #[cfg(feature = "parallel")]
    #[test]
    fn whoever_works_alone_is_a_pool_of_one_and_only_meanwhile() {
        fn look(seen: &mut Vec<(usize, std::thread::ThreadId)>) {
            alone(seen, |seen| seen[0] = (rayon::current_num_threads(), std::thread::current().id()));
        }
        let mut seen = vec![(0, std::thread::current().id())];
        for _ in 0..3 {
            seen[0].0 = 0;
            look(&mut seen);
            assert_eq!(seen, [(1, std::thread::current().id())]);
            assert_eq!(rayon::current_thread_index(), None);
        }
        let two = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
        two.install(|| look(&mut seen));
        assert_eq!(seen[0].0, 1, "never the larger pool that it is called in");
    }

    #[cfg(feature = "parallel")]
    #[test]
    fn a_panic_comes_through_and_what_was_worked_on_is_kept() {
        let mut state = vec![1, 2];
        let outcome = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
            alone(&mut state, |state| {
                state[0] = 5;
                panic!("on purpose");
            });
        }));
        assert!(outcome.is_err());
        assert_eq!(state, [5, 2]);
        assert_eq!(rayon::current_thread_index(), None);
    }
}
