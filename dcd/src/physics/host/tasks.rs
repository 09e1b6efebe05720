//! Steps a world on threads of the program's own: invites them for one step, forms teams of those that come,
//! and lets them go.

use std::num::NonZero;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{self, Receiver, Sender};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use rayon::{ThreadBuilder, ThreadPool, ThreadPoolBuildError, ThreadPoolBuilder};

/// The program's own way to compute on several threads, such as its job system, for
/// [`World::set_tasks`](crate::World::set_tasks).
///
/// ```
/// /// A thread per task.
/// struct Threads;
///
/// impl dcd::Tasks for Threads {
///     fn run(&self, count: usize, task: &(dyn Fn() + Sync), meanwhile: &mut dyn FnMut()) {
///         std::thread::scope(|scope| {
///             for _ in 0..count {
///                 scope.spawn(task);
///             }
///             meanwhile();
///         });
///     }
/// }
/// ```
pub trait Tasks: Send + Sync {
    /// Starts `task` `count` times, each on a thread of its own if one is free, calls `meanwhile` once on the
    /// calling thread, and returns when all of them have returned. A task that starts late, or on the calling
    /// thread, returns at once.
    fn run(&self, count: usize, task: &(dyn Fn() + Sync), meanwhile: &mut dyn FnMut());
}

/// How long a step waits for tasks to begin: several times as long as it takes to wake a thread.
const PATIENCE: Duration = Duration::from_micros(100);

/// A place in a pool, for the thread that will be its worker.
type Seat = ThreadBuilder;

/// Calls `work` with pools of the threads of those tasks that have begun soon enough, without pools if none
/// has. `sizes` returns the sizes of the pools for a number of threads.
pub(super) fn gather<R>(
    tasks: &dyn Tasks,
    count: usize,
    sizes: impl Fn(NonZero<usize>) -> Vec<usize>,
    work: impl FnOnce(Vec<ThreadPool>) -> R,
) -> R {
    let door = Door::open(count);
    let (mut work, mut done) = (Some(work), None);
    let mut meanwhile = || {
        let pools = match NonZero::new(door.wait()) {
            // If no pool can be built there are no threads: the caller can do without.
            Some(came) => door.seat(&sizes(came)).unwrap_or_default(),
            None => Vec::new(),
        };
        door.close();
        done = work.take().map(|work| work(pools));
    };
    tasks.run(count, &|| door.enter(), &mut meanwhile);
    done.expect("`Tasks::run` calls `meanwhile` once")
}

/// The door at which tasks wait for a seat.
struct Door {
    caller: std::thread::ThreadId,
    expected: usize,
    came: AtomicUsize,
    /// The senders of seats, one for each waiting task; `None` once the door is closed.
    waiting: Mutex<Option<Vec<Sender<Seat>>>>,
}

impl Door {
    fn open(expected: usize) -> Self {
        Self {
            caller: std::thread::current().id(),
            expected,
            came: AtomicUsize::new(0),
            waiting: Mutex::new(Some(Vec::new())),
        }
    }

    /// Runs a task: takes a seat and works there until its pool is dropped.
    fn enter(&self) {
        // A worker of one of rayon's pools cannot be a worker of another one.
        if std::thread::current().id() == self.caller || rayon::current_thread_index().is_some() {
            return;
        }
        let Some(seat) = self.queue() else { return };
        if let Ok(seat) = seat.recv() {
            seat.run();
        }
    }

    fn queue(&self) -> Option<Receiver<Seat>> {
        let mut waiting = self.waiting.lock().unwrap_or_else(PoisonError::into_inner);
        let (hand, seat) = mpsc::channel();
        waiting.as_mut()?.push(hand);
        self.came.fetch_add(1, Ordering::Release);
        Some(seat)
    }

    /// Waits until all expected tasks have come, but no longer than [`PATIENCE`]. Returns how many have come.
    fn wait(&self) -> usize {
        let start = Instant::now();
        while self.came.load(Ordering::Acquire) < self.expected && start.elapsed() < PATIENCE {
            std::thread::yield_now();
        }
        self.came.load(Ordering::Acquire)
    }

    /// Forms pools of these sizes from the threads that wait.
    fn seat(&self, sizes: &[usize]) -> Result<Vec<ThreadPool>, ThreadPoolBuildError> {
        let mut waiting = self.waiting.lock().unwrap_or_else(PoisonError::into_inner);
        let waiting = waiting.as_mut().expect("it is closed later");
        let pool = |&size: &usize| {
            ThreadPoolBuilder::new()
                .num_threads(size)
                .spawn_handler(|seat| {
                    let hand = waiting.pop().ok_or(std::io::ErrorKind::WouldBlock)?;
                    hand.send(seat).map_err(|_| std::io::ErrorKind::BrokenPipe.into())
                })
                .build()
        };
        sizes.iter().map(pool).collect()
    }

    /// Sends away the tasks that have no seat, and those that come from now on.
    fn close(&self) {
        *self.waiting.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Starts tasks on threads named `own`, and one more on the calling thread.
    struct Named;

    impl Tasks for Named {
        fn run(&self, count: usize, task: &(dyn Fn() + Sync), meanwhile: &mut dyn FnMut()) {
            std::thread::scope(|scope| {
                for _ in 0..count {
                    std::thread::Builder::new().name("own".into()).spawn_scoped(scope, task).unwrap();
                }
                task();
                meanwhile();
            });
        }
    }

    /// Starts tasks too late.
    struct Late;

    impl Tasks for Late {
        fn run(&self, count: usize, task: &(dyn Fn() + Sync), meanwhile: &mut dyn FnMut()) {
            meanwhile();
            std::thread::scope(|scope| (0..count).for_each(|_| drop(scope.spawn(task))));
        }
    }

    #[test]
    fn pools_are_of_the_programs_threads_alone_and_end_with_the_work() {
        let mut total = 0;
        for round in 0..20 {
            let came = gather(
                &Named,
                3,
                |came| vec![1; came.get()],
                |pools| {
                    for pool in &pools {
                        let name = pool.install(|| std::thread::current().name().map(str::to_owned));
                        assert_eq!(name.as_deref(), Some("own"));
                    }
                    pools.len()
                },
            );
            assert!(came <= 3, "{came} in round {round}");
            total += came;
        }
        assert!(total > 0, "somebody came in time in one of the rounds");
    }

    #[test]
    fn who_comes_late_is_not_waited_for_and_goes_home() {
        assert_eq!(gather(&Late, 4, |came| vec![came.get()], |pools| pools.len()), 0);
    }

    #[test]
    fn a_door_seats_those_who_wait_and_sends_the_rest_away() {
        let door = Door::open(3);
        std::thread::scope(|scope| {
            (0..3).for_each(|_| drop(scope.spawn(|| door.enter())));
            while door.wait() < 3 {}
            let pools = door.seat(&[2]).unwrap();
            door.close();
            assert_eq!(pools[0].current_num_threads(), 2);
            assert_eq!(pools[0].broadcast(|_| 1).len(), 2, "both are there");
            // The third has gone, or the scope would never end.
            drop(pools);
            door.enter();
        });
    }
}
