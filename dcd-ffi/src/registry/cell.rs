//! Guards one world by a lock, and steps it in the background by a thread of its own.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver, Sender};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError, RwLock};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use super::World;
use crate::status::{DCD_ERR_BUSY, DCD_ERR_LIMIT, DCD_ERR_PANIC, DCD_ERR_TIMEOUT, Failure};

/// World that calls take turns on, except those that only read.
pub(crate) struct Cell {
    /// The world; `None` once it is destroyed, for calls that waited meanwhile.
    world: RwLock<Option<World>>,
    background: Mutex<Background>,
    /// Says whether a step that was begun is not done. Every call looks at it, so it has a place of its own.
    stepping: AtomicBool,
    /// Notified when a step in the background is done.
    done: Condvar,
}

#[derive(Default)]
struct Background {
    thread: Option<(Sender<()>, JoinHandle<()>)>,
    /// Outcome of the step that was begun, until it is asked for.
    outcome: Option<Result<(), Failure>>,
    /// Says whether the world is being destroyed.
    closed: bool,
}

impl Cell {
    pub(crate) fn new(world: World) -> Self {
        Self {
            world: RwLock::new(Some(world)),
            background: Mutex::default(),
            stepping: AtomicBool::new(false),
            done: Condvar::new(),
        }
    }

    /// Calls `work` with the world, after every other call on it and after a step that was begun. `None` if it is destroyed.
    pub(crate) fn with<R>(
        &self,
        work: impl FnOnce(&mut World) -> Result<R, Failure>,
    ) -> Option<Result<R, Failure>> {
        self.settle();
        match self.world.write() {
            Ok(mut world) => Some(work(world.as_mut()?)),
            Err(_) => Some(Err(poisoned())),
        }
    }

    /// Calls `work` with the world as [`Cell::with`] does, but for reading only and at the same time as other readers.
    pub(crate) fn ask<R>(
        &self,
        work: impl FnOnce(&World) -> Result<R, Failure>,
    ) -> Option<Result<R, Failure>> {
        self.settle();
        let asked = match self.world.read() {
            Ok(world) => {
                let world = world.as_ref()?;
                catch_unwind(AssertUnwindSafe(|| work(world)))
            }
            Err(_) => Ok(Err(poisoned())),
        };
        asked.map_or_else(|panic| self.poison(panic), Some)
    }

    /// Passes a panic on and poisons the lock, as a call that changes the world would: readers alone do not poison a lock.
    #[cold]
    fn poison(&self, panic: Box<dyn Any + Send>) -> ! {
        let world = self.world.write();
        // Later calls find a world gone that was destroyed meanwhile.
        if world.as_ref().is_ok_and(|world| world.is_none()) {
            drop(world);
        }
        resume_unwind(panic)
    }

    /// Waits for a step that was begun.
    fn settle(&self) {
        if self.stepping.load(Ordering::Acquire) {
            drop(self.settled());
        }
    }

    /// Begins a step in the background. Returns `None` if the world is destroyed.
    pub(crate) fn begin(self: &Arc<Self>) -> Option<Result<(), Failure>> {
        let mut background = self.background();
        if background.closed {
            return None;
        }
        if self.stepping.load(Ordering::Acquire) || background.outcome.is_some() {
            let message = "a step was begun already; call dcd_step_wait first";
            return Some(Err(Failure::new(DCD_ERR_BUSY, message)));
        }
        if self.world.is_poisoned() {
            return Some(Err(poisoned()));
        }
        if background.thread.is_none() {
            let (orders, inbox) = mpsc::channel();
            let cell = self.clone();
            let spawned =
                std::thread::Builder::new().name("dcd-step".into()).spawn(move || cell.serve(&inbox));
            match spawned {
                Ok(thread) => background.thread = Some((orders, thread)),
                Err(cause) => {
                    let message = format!("cannot start a thread: {cause}; raise the limit of threads");
                    return Some(Err(Failure::new(DCD_ERR_LIMIT, message)));
                }
            }
        }
        self.stepping.store(true, Ordering::Release);
        let (orders, _) = background.thread.as_ref()?;
        // The thread lives as long as it is kept here, so it takes the order.
        let _ = orders.send(());
        Some(Ok(()))
    }

    /// Returns the outcome of the step that was begun, once it is done, but no later than after `timeout`.
    pub(crate) fn wait(&self, timeout: Option<Duration>) -> Result<(), Failure> {
        let deadline = timeout.and_then(|timeout| Instant::now().checked_add(timeout));
        let mut background = self.background();
        while self.stepping.load(Ordering::Acquire) {
            let left = match deadline {
                None => Duration::MAX,
                Some(deadline) => deadline.saturating_duration_since(Instant::now()),
            };
            if left.is_zero() {
                return Err(Failure::new(DCD_ERR_TIMEOUT, "the step is not done yet; wait again"));
            }
            let waited = self.done.wait_timeout(background, left);
            background = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
        let none = || Err(Failure::argument("no step was begun; call dcd_step_begin first"));
        background.outcome.take().unwrap_or_else(none)
    }

    /// Removes the world, after every call that runs on it, and ends its thread.
    pub(crate) fn close(&self) -> Option<World> {
        let mut background = self.settled();
        background.closed = true;
        let thread = background.thread.take();
        drop(background);
        if let Some((orders, thread)) = thread {
            drop(orders);
            // The thread has nothing to do, and panics nowhere.
            let _ = thread.join();
        }
        // A poisoned world is destroyed like any other, and is gone afterwards for every call, as any other.
        let mut world = self.world.write().unwrap_or_else(PoisonError::into_inner);
        self.world.clear_poison();
        world.take()
    }

    fn background(&self) -> MutexGuard<'_, Background> {
        // Nothing that can panic halfway runs under this lock.
        self.background.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits until no step runs in the background.
    #[cold]
    fn settled(&self) -> MutexGuard<'_, Background> {
        let stepping = |_: &mut Background| self.stepping.load(Ordering::Acquire);
        self.done.wait_while(self.background(), stepping).unwrap_or_else(PoisonError::into_inner)
    }

    /// Does the thread's work: a step per order.
    fn serve(&self, orders: &Receiver<()>) {
        while orders.recv().is_ok() {
            let step = || match self.world.write() {
                Ok(mut world) => world.as_mut().map_or(Ok(()), World::step),
                Err(_) => Err(panicked()),
            };
            let outcome = catch_unwind(AssertUnwindSafe(step)).unwrap_or_else(|_| Err(panicked()));
            let mut background = self.background();
            background.outcome = Some(outcome);
            self.stepping.store(false, Ordering::Release);
            drop(background);
            self.done.notify_all();
        }
    }
}

#[cold]
fn poisoned() -> Failure {
    Failure::new(DCD_ERR_PANIC, "a bug in dcd stopped an earlier call on this world; destroy it")
}

fn panicked() -> Failure {
    Failure::new(DCD_ERR_PANIC, "a bug in dcd stopped a call on this world; destroy it, and report this")
}
