//! Runs Box3D through its C interface. All calls that Rust cannot check are in this file.

use std::error::Error;
use std::ffi::{c_char, c_int};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use boxddd_sys::ffi::*;

use super::bodies::{Bodies, Body, Solid, State};
use super::world::{World, timed};

/// One Box3D world, stepped by Box3D's own scheduler.
pub(super) struct Box3d {
    id: b3WorldId,
    /// The bodies that move, in the order of the scene.
    movers: Vec<b3BodyId>,
    dt_s: f32,
    substeps: c_int,
}

impl Box3d {
    /// Makes a world with contact settings that are Box3D's own, except for what would make it another scene:
    /// nothing sleeps, nothing is swept, and impacts of any speed bounce.
    pub(super) fn new(bodies: &Bodies, threads: usize) -> Result<Self, Box<dyn Error>> {
        // SAFETY: takes nothing and gives a struct of numbers and null pointers.
        let mut def = unsafe { b3DefaultWorldDef() };
        def.gravity = vec3(bodies.gravity);
        def.restitutionThreshold = 0.0;
        def.enableSleep = false;
        def.enableContinuous = false;
        def.workerCount = threads.try_into()?;
        // SAFETY: the definition is a default one, whose callbacks are null: Box3D then runs threads of its
        // own.
        let id = unsafe { b3CreateWorld(&raw const def) };
        // SAFETY: any id may be asked for.
        if !unsafe { b3World_IsValid(id) } {
            return Err("Box3D made no world: 128 are its limit".into());
        }
        let movers = bodies.bodies.iter().filter_map(|body| {
            let body_id = insert(id, bodies, body);
            body.moves.then_some(body_id)
        });
        let movers = movers.collect();
        Ok(Self { id, movers, dt_s: bodies.dt_s, substeps: bodies.substeps.try_into()? })
    }
}

fn insert(world: b3WorldId, bodies: &Bodies, body: &Body) -> b3BodyId {
    let Body { moves, solid, density, start } = body;
    let [x, y, z, w] = start.pose.rotation;
    // SAFETY: both take nothing and give structs of numbers and null pointers.
    let (mut def, mut shape) = unsafe { (b3DefaultBodyDef(), b3DefaultShapeDef()) };
    def.type_ = if *moves { b3BodyType_b3_dynamicBody } else { b3BodyType_b3_staticBody };
    def.position = vec3(start.pose.translation.map(|v| v as f32));
    def.rotation = b3Quat { v: vec3([x, y, z]), s: w };
    def.linearVelocity = vec3(start.velocity.linear);
    def.angularVelocity = vec3(start.velocity.angular);
    def.enableSleep = false;
    shape.density = *density;
    shape.baseMaterial.friction = bodies.friction;
    shape.baseMaterial.restitution = bodies.restitution;
    // SAFETY: the world is alive, for only `Drop` ends it, and the definition is a default one with numbers
    // changed.
    let id = unsafe { b3CreateBody(world, &raw const def) };
    match *solid {
        Solid::Box([x, y, z]) => {
            // SAFETY: takes numbers and gives a struct without pointers.
            let hull = unsafe { b3MakeBoxHull(x, y, z) };
            // SAFETY: the body was just made. The hull's data, whose offsets reach beyond its header, are the
            // whole struct, which the pointer is made from; Box3D copies them.
            unsafe { b3CreateHullShape(id, &raw const shape, (&raw const hull).cast()) };
        }
        Solid::Ball(radius) => {
            let sphere = b3Sphere { center: vec3([0.0; 3]), radius };
            // SAFETY: the body was just made; the sphere is copied.
            unsafe { b3CreateSphereShape(id, &raw const shape, &raw const sphere) };
        }
    }
    id
}

impl World for Box3d {
    fn steps(&mut self, ticks: usize) -> Result<Vec<Duration>, Box<dyn Error>> {
        timed(ticks, || {
            // SAFETY: the world is alive, and `&mut` keeps every other call on it away.
            unsafe { b3World_Step(self.id, self.dt_s, self.substeps) };
            Ok(())
        })
    }

    fn states(&self) -> Vec<State> {
        let state = |id: &b3BodyId| {
            // SAFETY: bodies live as long as their world, and none is destroyed before it.
            let (at, linear, angular) = unsafe {
                (b3Body_GetTransform(*id), b3Body_GetLinearVelocity(*id), b3Body_GetAngularVelocity(*id))
            };
            let b3Quat { v, s } = at.q;
            State::new(array(at.p), [v.x, v.y, v.z, s], array(linear), array(angular))
        };
        self.movers.iter().map(state).collect()
    }
}

impl Drop for Box3d {
    fn drop(&mut self) {
        // SAFETY: the world is alive until here, and no id of it is used after.
        unsafe { b3DestroyWorld(self.id) };
    }
}

/// Returns whether Box3D was compiled with its assertions. Its crate leaves them in unless the C compiler is
/// told `-DNDEBUG`; figures of such a build say nothing.
pub(super) fn has_assertions() -> bool {
    static FIRED: AtomicBool = AtomicBool::new(false);
    static KNOWN: OnceLock<bool> = OnceLock::new();

    unsafe extern "C" fn note(_condition: *const c_char, _file: *const c_char, _line: c_int) -> c_int {
        FIRED.store(true, Ordering::Relaxed);
        0
    }
    unsafe extern "C" fn stop(_condition: *const c_char, _file: *const c_char, _line: c_int) -> c_int {
        1
    }
    *KNOWN.get_or_init(|| {
        // SAFETY: the handlers are functions that live as long as the program and take what Box3D passes. A
        // definition that lacks Box3D's mark breaks an assertion and nothing else: it is read as any other.
        unsafe {
            let world = b3CreateWorld(&raw const *Box::new(b3DefaultWorldDef()));
            let mut def = b3DefaultBodyDef();
            def.internalValue = 0;
            b3SetAssertFcn(Some(note));
            b3CreateBody(world, &raw const def);
            b3SetAssertFcn(Some(stop));
            b3DestroyWorld(world);
        }
        FIRED.load(Ordering::Relaxed)
    })
}

fn vec3([x, y, z]: [f32; 3]) -> b3Vec3 {
    b3Vec3 { x, y, z }
}

fn array(b3Vec3 { x, y, z }: b3Vec3) -> [f32; 3] {
    [x, y, z]
}
