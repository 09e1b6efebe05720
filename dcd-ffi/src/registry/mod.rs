//! Keeps the worlds that this process has handles of, and what C needs with each: shapes, lent arrays, open queries.

mod cell;

use std::cell::RefCell;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use dcd::{BodyId, Checkpoint, World as Dcd};
use rapier3d::prelude::SharedShape;

use crate::callback::check_outside;
use crate::definition::Made;
use crate::event::{EventBuffers, KeptEvents};
use crate::handle::{LookedUp, Mark, Slots, not_null, stale};
use crate::ids::{DcdBodyId, DcdWorld};
use crate::query::open::OpenQueries;
use crate::state::StateBuffers;
use crate::status::Failure;
use cell::Cell;

/// World with what C needs besides.
pub(crate) struct World {
    pub mark: Mark,
    pub dcd: Dcd,
    pub shapes: Slots<SharedShape>,
    pub looked_up: LookedUp,
    /// How bodies were made last.
    pub made: Made,
    pub states: StateBuffers,
    pub events: EventBuffers,
    pub queries: OpenQueries,
    pub checkpoints: Slots<Kept>,
    pub user_data: u64,
}

/// World that is kept in memory, with what C needs to show its events again.
pub(crate) struct Kept {
    pub world: Checkpoint,
    pub events: KeptEvents,
}

impl World {
    /// Advances the world, and shows what happened.
    pub(crate) fn step(&mut self) -> Result<(), Failure> {
        let stepped = self.dcd.step();
        self.show();
        Ok(stepped?)
    }

    /// Writes down the state and events of the last step, if they are looked at.
    pub(crate) fn show(&mut self) {
        self.events.fill(&self.dcd, self.mark);
        self.show_states();
    }

    /// Writes down the state alone.
    pub(crate) fn show_states(&mut self) {
        self.states.after_step(&self.dcd, self.mark);
    }
}

static WORLDS: Mutex<Slots<Arc<Cell>>> = Mutex::new(Slots::new());

fn worlds() -> MutexGuard<'static, Slots<Arc<Cell>>> {
    // Nothing that can panic halfway runs under this lock.
    WORLDS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Returns the cell of a world, for calls that do not take turns on it.
pub(crate) fn cell(world: DcdWorld) -> Result<Arc<Cell>, Failure> {
    check_outside()?;
    not_null(world.v, "world")?;
    worlds().get(world.v).cloned().ok_or_else(|| stale("world", world.v))
}

/// Calls `work` with the world, after every other call on it.
pub(crate) fn with<R>(
    world: DcdWorld,
    work: impl FnOnce(&mut World) -> Result<R, Failure>,
) -> Result<R, Failure> {
    in_cell(world, |cell| cell.with(work))
}

/// Calls `work` with the world, to be read only, after every other call that changes it and beside those that do not.
pub(crate) fn ask<R>(world: DcdWorld, work: impl FnOnce(&World) -> Result<R, Failure>) -> Result<R, Failure> {
    in_cell(world, |cell| cell.ask(work))
}

fn in_cell<R>(world: DcdWorld, work: impl FnOnce(&Cell) -> Option<Result<R, Failure>>) -> Result<R, Failure> {
    check_outside()?;
    not_null(world.v, "world")?;
    let mut work = Some(work);
    let done = LAST.try_with(|last| -> Result<_, Failure> {
        let mut known = last.borrow();
        if known.as_ref().is_none_or(|(handle, _)| *handle != world.v) {
            drop(known);
            let found = cell(world)?;
            last.replace(Some((world.v, found)));
            // No call is made within another on this thread, so nobody replaces the cell meanwhile.
            known = last.borrow();
        }
        Ok(known.as_ref().zip(work.take()).and_then(|((_, cell), work)| work(cell)))
    });
    let done = match done {
        Ok(done) => done?,
        // The thread ends: this is an exit handler, or the destructor of a static or thread-local object.
        Err(_) => work.take().zip(Some(cell(world)?)).and_then(|(work, cell)| work(&cell)),
    };
    done.unwrap_or_else(|| Err(stale("world", world.v)))
}

thread_local! {
    /// The world that this thread called last, so that it is not looked up again: handles are never given twice. Once the world is
    /// destroyed, nothing is left in its cell.
    static LAST: RefCell<Option<(u64, Arc<Cell>)>> = const { RefCell::new(None) };
}

pub(crate) fn add(dcd: Dcd, user_data: u64) -> DcdWorld {
    static COUNT: AtomicU32 = AtomicU32::new(1);
    let mark = Mark::new(COUNT.fetch_add(1, Ordering::Relaxed));
    let world = World {
        mark,
        dcd,
        shapes: Slots::new(),
        looked_up: LookedUp::default(),
        made: Made::default(),
        states: StateBuffers::default(),
        events: EventBuffers::default(),
        queries: OpenQueries::new(),
        checkpoints: Slots::new(),
        user_data,
    };
    let handle = DcdWorld { v: worlds().insert(Arc::new(Cell::new(world))) };
    tracing::info!(world = handle.v, "world made");
    handle
}

/// Removes a world. Calls that wait for it find it gone.
pub(crate) fn remove(world: DcdWorld) -> Result<(), Failure> {
    check_outside()?;
    not_null(world.v, "world")?;
    let cell = worlds().remove(world.v).ok_or_else(|| stale("world", world.v))?;
    drop(cell.close());
    Ok(())
}

/// Returns whether the handle names a world.
pub(crate) fn contains(world: DcdWorld) -> bool {
    worlds().get(world.v).is_some()
}

/// Returns the body behind a handle.
pub(crate) fn find(world: &World, body: DcdBodyId) -> Result<BodyId, Failure> {
    let id = world.mark.body_id(body)?;
    if world.dcd.contains(id) { Ok(id) } else { Err(missing(world, body)) }
}

/// Returns why a handle names no body: its world shows none, or it is stale.
#[cold]
pub(crate) fn missing(world: &World, body: DcdBodyId) -> Failure {
    world.dcd.sees("see the bodies of its world").err().map_or_else(|| stale("body", body.v), Failure::from)
}
