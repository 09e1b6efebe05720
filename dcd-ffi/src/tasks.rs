//! Lets the program's own threads, its job system, compute a world.

use std::ffi::c_void;
use std::sync::Arc;

use dcd::Tasks;

use crate::callback::{Callback, enter};
use crate::guard::{guard, guard_value};
use crate::ids::DcdWorld;
use crate::pointer::{self, Sized32, check_reserved};
use crate::registry::with;
use crate::status::{DCD_ERR_NULL, DcdStatus, Failure};

/// Task of the library. The program calls it once, on any thread, with the `task` that came with it. It returns when the step needs
/// it no more.
pub type DcdTaskFn = unsafe extern "C" fn(task: *mut c_void);

/// Starts `run(task)` on a thread of the program's and returns at once. The result is anything by which DcdFinishFn knows the task
/// again. A job system that has no thread free may begin the task later, or within DcdFinishFn: then the task has nothing to do.
pub type DcdEnqueueFn =
    Option<unsafe extern "C" fn(context: *mut c_void, run: DcdTaskFn, task: *mut c_void) -> *mut c_void>;
/// Waits until the task for which DcdEnqueueFn returned `started` has returned. Begins the task if it was not begun.
pub type DcdFinishFn = Option<unsafe extern "C" fn(context: *mut c_void, started: *mut c_void)>;

/// Job system of the program. Start from DCD_TASKS_INIT.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdTasks {
    /// Size of this struct: sizeof(DcdTasks).
    pub struct_size: u32,
    /// Reserved; must be 0.
    pub reserved: u32,
    /// First argument of both functions.
    pub context: *mut c_void,
    /// Function that starts a task.
    pub enqueue: DcdEnqueueFn,
    /// Function that waits for a task.
    pub finish: DcdFinishFn,
}

// SAFETY: begins with `struct_size`; every other member is a number, a pointer or a function that may be null.
unsafe impl Sized32 for DcdTasks {
    const NAME: &'static str = "DcdTasks";
}

/// Sets the job system whose threads compute a local world from the next dcd_step on, instead of threads of the library's, which
/// end. A null `tasks` goes back to the library's threads. `tasks` is read during the call. Its functions and `context` must be
/// there until others are set or the world is destroyed.
///
/// - Sharing. A step that is worth it (some hundred awake bodies) starts DcdWorldDef.threads tasks and waits a tenth of a
///   millisecond for them to begin. Tasks that have begun share the work. If none has, the calling thread does it alone, so that no
///   step waits for a thread that is busy elsewhere. The same holds for a call with many queries.
/// - Waiting. The calling thread waits meanwhile: it is best none of the job system's own. Every task is finished before dcd_step
///   returns, those that came too late too.
/// - Results. They do not depend on any of it.
/// - Callers. The functions are called by the thread that calls dcd_step, by one of the library's after dcd_step_begin, and by each
///   thread that asks many queries: by several threads at a time where several ask.
/// - Duties. The functions must return normally (no longjmp, no C++ exception). Calls on worlds from within them give DCD_ERR_BUSY,
///   so a thread that helps others while it waits must not take on a job that calls the library.
///
/// The functions are not saved with the world.
/// Errors:
/// - DCD_ERR_NULL (world, a function), DCD_ERR_STALE_ID, DCD_ERR_STRUCT, DCD_ERR_ARGUMENT.
/// - DCD_ERR_LIMIT: the system gives no threads to go back to.
/// - DCD_ERR_UNSUPPORTED: in a served world.
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

/// The work of a task.
type Work<'a> = &'a (dyn Fn() + Sync);

unsafe extern "C" fn run(task: *mut c_void) {
    // SAFETY: `task` is what `Program::run` gave for it, which waits for the task's end.
    let work = unsafe { &*task.cast::<Work<'_>>() };
    // A panic of this work comes out where the step waits.
    guard_value((), work);
}

/// Tasks that were started. Dropping it waits for them, after a panic too.
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
