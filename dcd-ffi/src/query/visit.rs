//! Answers one query by calls of a function of the user's, which may have enough before all is found.

use std::ffi::c_void;
use std::ops::ControlFlow;

use dcd::physics::ColliderId;
use dcd::protocol::{CastAnswer, RayAnswer};

use super::cast::{question as cast_question, shape_hit, solid};
use super::overlap::{overlap, question};
use super::ray::{question as ray_question, ray_hit};
use super::{
    Batch, DcdBoxQuery, DcdFilter, DcdOverlap, DcdRay, DcdRayHit, DcdShapeCast, DcdShapeHit, DcdShapeQuery,
    Somewhere, refused,
};
use crate::callback::{Callback, enter};
use crate::guard::guard;
use crate::ids::DcdWorld;
use crate::registry::ask;
use crate::status::{DCD_ERR_NULL, DcdStatus, Failure};

/// Receives a body that a ray met; `hit` is valid during the call. Returns how far the ray goes from now on, metres: INFINITY for
/// as far as it did, hit->distance to be called for nearer bodies only, 0 to end.
///
/// The thread that asks calls the function. It must return normally (no longjmp, no C++ exception). Calls on worlds from within it
/// give DCD_ERR_BUSY.
pub type DcdRayFn = Option<unsafe extern "C" fn(context: *mut c_void, hit: *const DcdRayHit) -> f32>;
/// Receives a body that a moving shape met; `hit` is valid during the call. Returns how much of its way the shape goes from now on:
/// 1 for as much as it did, hit->fraction to be called for bodies that it meets earlier only, 0 to end. All else is as in DcdRayFn.
pub type DcdShapeCastFn = Option<unsafe extern "C" fn(context: *mut c_void, hit: *const DcdShapeHit) -> f32>;
/// Receives a body that was found; `found` is valid during the call. Returns whether to go on. All else is as in DcdRayFn.
pub type DcdOverlapFn = Option<unsafe extern "C" fn(context: *mut c_void, found: *const DcdOverlap) -> bool>;

/// Calls `function` with every body that one ray meets, until it has enough. Each collider of a body counts once. The order is not
/// promised. Use it for a question that dcd_cast_rays does not ask, such as what is thickest on the way, or the first body that a
/// rule of the program's lets count.
///
/// `ray` and `filter` are read during the call. Errors: as dcd_cast_rays.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_cast_ray_each(
    world: DcdWorld,
    ray: *const DcdRay,
    filter: *const DcdFilter,
    function: DcdRayFn,
    context: *mut c_void,
) -> DcdStatus {
    guard("dcd_cast_ray_each", || {
        let function = function.ok_or_else(no_function)?;
        // SAFETY: the caller vouches for the ray and for the filter.
        let batch = unsafe { Batch::new(ray, 1, "ray", filter)? };
        ask(world, |world| {
            let asked = batch.ask(world)?;
            let ray = ray_question(world, asked.mask, &batch.queries[0])?;
            let meet = |hit: RayAnswer| {
                let (hit, mut reach) = (ray_hit(world, Some(hit)), 0.0);
                // SAFETY: the caller vouches for the function and its context.
                enter(Callback::Query, || reach = unsafe { function(context, &raw const hit) });
                reach.into()
            };
            asked.queries.ask_ray_each(&asked.filter, &ray, meet).map_err(refused)
        })
    })
}

/// Calls `function` with every body that one shape meets which moves straight, until it has enough. Each collider of a body counts
/// once. The order is not promised. Use it for a way on which a rule of the program's says what stops the shape.
///
/// `cast` and `filter` are read during the call. Errors: as dcd_cast_shapes, DCD_ERR_ARGUMENT also for a cast that turns.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_cast_shape_each(
    world: DcdWorld,
    cast: *const DcdShapeCast,
    filter: *const DcdFilter,
    function: DcdShapeCastFn,
    context: *mut c_void,
) -> DcdStatus {
    guard("dcd_cast_shape_each", || {
        let function = function.ok_or_else(no_function)?;
        // SAFETY: the caller vouches for the cast and for the filter.
        let batch = unsafe { Batch::new(cast, 1, "cast", filter)? };
        ask(world, |world| {
            let asked = batch.ask(world)?;
            let cast = &batch.queries[0];
            let (shape, cast) = (solid(world, cast.shape)?, cast_question(world, asked.mask, cast)?);
            if cast.turn != [0.0; 3] {
                return Err(Failure::argument("turn is not 0; dcd_cast_shapes takes casts that turn"));
            }
            let meet = |hit: CastAnswer| {
                let (hit, mut reach) = (shape_hit(world, Some(hit)), 0.0);
                // SAFETY: the caller vouches for the function and its context.
                enter(Callback::Query, || reach = unsafe { function(context, &raw const hit) });
                reach
            };
            asked.queries.ask_cast_each(&asked.filter, &*shape.0, &cast, meet).map_err(refused)
        })
    })
}

/// Calls `function` with every body that a shape overlaps, until it has enough. Each collider of a body counts once. The order is
/// not promised. To know whether a place is free, one body is enough.
///
/// `shape` and `filter` are read during the call. Errors: as dcd_overlap_shapes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_overlap_shape_each(
    world: DcdWorld,
    shape: *const DcdShapeQuery,
    filter: *const DcdFilter,
    function: DcdOverlapFn,
    context: *mut c_void,
) -> DcdStatus {
    // SAFETY: the caller vouches for all of them.
    guard("dcd_overlap_shape_each", || unsafe { each_overlap(world, shape, filter, function, context) })
}

/// Calls `function` with every body whose AABB touches a box, as dcd_overlap_boxes finds them, until it has enough.
///
/// `box` and `filter` are read during the call. Errors: as dcd_overlap_boxes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_overlap_box_each(
    world: DcdWorld,
    r#box: *const DcdBoxQuery,
    filter: *const DcdFilter,
    function: DcdOverlapFn,
    context: *mut c_void,
) -> DcdStatus {
    // SAFETY: the caller vouches for all of them.
    guard("dcd_overlap_box_each", || unsafe { each_overlap(world, r#box, filter, function, context) })
}

#[cold]
fn no_function() -> Failure {
    Failure::new(DCD_ERR_NULL, "function is null; give one to be called with what is found")
}

/// # Safety
/// As [`Batch::new`]; the function may be called with its context.
unsafe fn each_overlap<Q: Somewhere>(
    world: DcdWorld,
    place: *const Q,
    filter: *const DcdFilter,
    function: DcdOverlapFn,
    context: *mut c_void,
) -> Result<(), Failure> {
    let function = function.ok_or_else(no_function)?;
    // SAFETY: the caller upholds the same contract.
    let batch = unsafe { Batch::new(place, 1, Q::ONE, filter)? };
    ask(world, |world| {
        let asked = batch.ask(world)?;
        let query = &batch.queries[0];
        let (shape, query) = (query.shape(world)?, question(world, asked.mask, query)?);
        let meet = |id: ColliderId| {
            let (found, mut goes_on) = (overlap(world, &(&id).into()), false);
            // SAFETY: the caller vouches for the function and its context.
            enter(Callback::Query, || goes_on = unsafe { function(context, &raw const found) });
            if goes_on { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        };
        asked.queries.ask_overlap_each(&asked.filter, |_| shape.cloned(), &query, meet).map_err(refused)
    })
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicBool, Ordering};
    use std::sync::{Barrier, Mutex, mpsc};
    use std::time::Duration;

    use super::*;
    use crate::query::NOBODY;
    use crate::registry;

    /// Makes a world of one sphere of two metres.
    fn world() -> DcdWorld {
        use rapier3d::prelude::{ColliderBuilder, RigidBodyBuilder};
        let mut world = dcd::World::new(dcd::WorldConfig::default()).unwrap();
        world.insert(RigidBodyBuilder::fixed(), ColliderBuilder::ball(2.0)).unwrap();
        registry::add(world, 0)
    }

    unsafe extern "C" fn meet_the_other(context: *mut c_void, _: *const DcdOverlap) -> bool {
        // SAFETY: the test gives a barrier that outlives the call.
        unsafe { &*context.cast::<Barrier>() }.wait();
        true
    }

    #[test]
    fn two_threads_ask_one_world_at_the_same_time() {
        let (world, both) = (world(), Barrier::new(2));
        std::thread::scope(|scope| {
            for _ in 0..2 {
                scope.spawn(|| {
                    let place = DcdBoxQuery {
                        min: [-1.0; 3],
                        max: [1.0; 3],
                        mask: u32::MAX,
                        exclude: NOBODY,
                        reserved: 0,
                    };
                    let context = (&raw const both).cast_mut().cast();
                    // SAFETY: all pointers are valid during the call.
                    let status = unsafe {
                        dcd_overlap_box_each(
                            world,
                            &raw const place,
                            std::ptr::null(),
                            Some(meet_the_other),
                            context,
                        )
                    };
                    assert_eq!(status, crate::status::DCD_OK);
                });
            }
        });
        registry::remove(world).unwrap();
    }

    /// A thread that asks, and waits within its query until another has read.
    struct Asking {
        inside: Barrier,
        read: Mutex<mpsc::Receiver<()>>,
        was_read: AtomicBool,
    }

    unsafe extern "C" fn wait_until_read(context: *mut c_void, _: *const DcdOverlap) -> bool {
        // SAFETY: the test gives one that outlives the call.
        let asking = unsafe { &*context.cast::<Asking>() };
        asking.inside.wait();
        let read = asking.read.lock().unwrap().recv_timeout(Duration::from_secs(60));
        asking.was_read.store(read.is_ok(), Ordering::Release);
        false
    }

    #[test]
    fn a_body_is_read_while_another_thread_asks() {
        let world = world();
        let body = registry::ask(world, |world| Ok(world.mark.body(dcd::BodyId::persistent(0)))).unwrap();
        let (tell, read) = mpsc::channel();
        let asking =
            Asking { inside: Barrier::new(2), read: Mutex::new(read), was_read: AtomicBool::new(false) };
        let place =
            DcdBoxQuery { min: [-1.0; 3], max: [1.0; 3], mask: u32::MAX, exclude: NOBODY, reserved: 0 };
        std::thread::scope(|scope| {
            scope.spawn(|| {
                let context = (&raw const asking).cast_mut().cast();
                let asked = Some(wait_until_read as unsafe extern "C" fn(_, _) -> _);
                // SAFETY: all pointers are valid during the call.
                let status = unsafe {
                    dcd_overlap_box_each(world, &raw const place, std::ptr::null(), asked, context)
                };
                assert_eq!(status, crate::status::DCD_OK);
            });
            asking.inside.wait();
            let mut pose = crate::types::DcdPose { p: [0.0; 3], q: [0.0; 4] };
            // SAFETY: the pose is valid, and nothing else is asked for.
            let status =
                unsafe { crate::motion::dcd_body_get(world, body, &raw mut pose, std::ptr::null_mut()) };
            assert_eq!((status, pose.q[3]), (crate::status::DCD_OK, 1.0));
            // The receiver is gone if the asking thread waited for too long.
            let _ = tell.send(());
        });
        assert!(asking.was_read.load(Ordering::Acquire), "it took its turn after the query");
        registry::remove(world).unwrap();
    }
}
