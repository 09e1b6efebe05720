//! Has the program's own threads, its job system, compute a world.

use std::ffi::c_void;
use std::sync::Arc;

use dcd::Tasks;

use crate::callback::{Callback, enter};
use crate::guard::{guard, guard_value};
use crate::ids::DcdWorld;
use crate::pointer::{self, Sized32, check_reserved};
use crate::registry::with;
use crate::status::{DCD_ERR_NULL, DcdStatus, Failure};

/// A task of the library: to be called once, on any thread, with the `task` that came with it. It returns when the step needs it no more.
pub type DcdTaskFn = unsafe extern "C" fn(task: *mut c_void);

/// Starts `run(task)` on a thread of the program's and returns at once, with anything by which to know it again. A job system that has no
/// thread free may begin it later, or within DcdFinishFn: then it has nothing to do.
pub type DcdEnqueueFn =
    Option<unsafe extern "C" fn(context: *mut c_void, run: DcdTaskFn, task: *mut c_void) -> *mut c_void>;
/// Returns when the task that DcdEnqueueFn gave this for has returned; begins it if it was not begun.
pub type DcdFinishFn = Option<unsafe extern "C" fn(context: *mut c_void, started: *mut c_void)>;

/// The program's job system. Start from DCD_TASKS_INIT.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdTasks {
    /// sizeof(DcdTasks).
    pub struct_size: u32,
    /// 0.
    pub reserved: u32,
    /// The first argument of both functions.
    pub context: *mut c_void,
    /// Starts a task.
    pub enqueue: DcdEnqueueFn,
    /// Waits for one.
    pub finish: DcdFinishFn,
}

// SAFETY: begins with `struct_size`; every other member is a number, a pointer or a function that may be null.
unsafe impl Sized32 for DcdTasks {
    const NAME: &'static str = "DcdTasks";
}

/// Has the program's own threads compute a local world from the next dcd_step on, instead of threads of the library's, which end; null
/// goes back to these. `tasks` is read during the call; its functions and `context` must be there until others are set or the world is
/// destroyed.
///
/// A step that is worth it (some hundred awake bodies) starts DcdWorldDef.threads tasks and waits a tenth of a millisecond for them to begin.
/// Those that have share the work; with none the calling thread does it alone, so that no step waits for a thread that is busy
/// elsewhere. The calling thread waits meanwhile: it is best none of the job system's own. Every task is finished before dcd_step returns, those
/// that came too late too. The same holds for a call with many queries. The result does not depend on any of it.
///
/// Both functions are called by the thread that calls dcd_step, by one of the library's after dcd_step_begin, and by each thread that asks
/// many queries, by several at a time where several ask. They must return normally (no longjmp, no C++ exception), and calls on worlds from
/// within them give DCD_ERR_BUSY: so a thread that helps others while it waits must not take on a job that calls the library.
/// They are not saved with the world.
/// Errors: DCD_ERR_NULL (world, a function), DCD_ERR_STALE_ID, DCD_ERR_STRUCT, DCD_ERR_ARGUMENT, DCD_ERR_LIMIT when the system gives no
/// threads to go back to, DCD_ERR_UNSUPPORTED in a served world.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_tasks_set(world: DcdWorld, tasks: *const DcdTasks) -> DcdStatus {
    guard("dcd_tasks_set", || {
        // SAFETY: the caller vouches for the pointer.
        let tasks =
            if tasks.is_null() { None } else { Some(unsafe { pointer::read_sized(tasks, "tasks")? }) };
        let tasks = tasks.map(Program::of).transpose()?;
        with(world, |world| {
            let tasks = tasks.map(|program| Arc::new(program) as Arc<dyn Tasks>);
            world.dcd.set_tasks(tasks).map_err(Failure::from)
        })
    })
}

/// The program's functions, as a step calls them.
struct Program {
    context: *mut c_void,
    enqueue: unsafe extern "C" fn(*mut c_void, DcdTaskFn, *mut c_void) -> *mut c_void,
    finish: unsafe extern "C" fn(*mut c_void, *mut c_void),
}

// SAFETY: nothing here is written; whichever thread steps the world calls the functions with their context, as the header says.
unsafe impl Send for Program {}
// SAFETY: as above.
unsafe impl Sync for Program {}

impl Program {
    fn of(tasks: DcdTasks) -> Result<Self, Failure> {
        check_reserved(tasks.reserved)?;
        let missing = |name| {
            Failure::new(
                DCD_ERR_NULL,
                format!("tasks->{name} is null; give both functions, or null for tasks"),
            )
        };
        Ok(Self {
            context: tasks.context,
            enqueue: tasks.enqueue.ok_or_else(|| missing("enqueue"))?,
            finish: tasks.finish.ok_or_else(|| missing("finish"))?,
        })
    }
}

/// What a task does.
type Work<'a> = &'a (dyn Fn() + Sync);

unsafe extern "C" fn run(task: *mut c_void) {
    // SAFETY: `task` is what `Program::run` gave for it, which waits for its end.
    let work = unsafe { &*task.cast::<Work<'_>>() };
    // A panic of what is computed there comes out where the step waits.
    guard_value((), work);
}

/// Tasks that were started; dropping it waits for them, after a panic too.
struct Started<'a> {
    program: &'a Program,
    all: Vec<*mut c_void>,
}

impl Drop for Started<'_> {
    fn drop(&mut self) {
        for &started in &self.all {
            // SAFETY: as the header asks.
            enter(Callback::Tasks, || unsafe { (self.program.finish)(self.program.context, started) });
        }
    }
}

impl Tasks for Program {
    fn run(&self, count: usize, task: Work<'_>, meanwhile: &mut dyn FnMut()) {
        let mut started = Started { program: self, all: Vec::with_capacity(count) };
        let work: *const Work<'_> = &raw const task;
        for _ in 0..count {
            // SAFETY: as the header asks; `task` outlives `started`.
            let enqueue = || unsafe { (self.enqueue)(self.context, run, work.cast_mut().cast()) };
            let mut handle = std::ptr::null_mut();
            enter(Callback::Tasks, || handle = enqueue());
            started.all.push(handle);
        }
        meanwhile();
    }
}
