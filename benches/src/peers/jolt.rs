//! Runs Jolt through the C interface JoltC. All calls that Rust cannot check are in this file.

use std::error::Error;
use std::ffi::{CStr, c_uint, c_void};
use std::ptr;
use std::sync::OnceLock;
use std::time::Duration;

use joltc_sys::*;

use super::bodies::{Bodies, Body, Solid, State};
use super::world::{World, timed};

// Jolt is C++, and its crate leaves it to the user to link C++'s standard library.
#[cfg_attr(target_vendor = "apple", link(name = "c++"))]
#[cfg_attr(not(any(target_vendor = "apple", target_env = "msvc")), link(name = "stdc++"))]
unsafe extern "C" {}

/// One Jolt world with its job system.
pub(super) struct Jolt {
    system: *mut JPC_PhysicsSystem,
    allocator: *mut JPC_TempAllocatorImpl,
    jobs: *mut JPC_JobSystemThreadPool,
    layers: *mut JPC_BroadPhaseLayerInterface,
    layer_filter: *mut JPC_ObjectVsBroadPhaseLayerFilter,
    pair_filter: *mut JPC_ObjectLayerPairFilter,
    /// The shapes, one per kind of body, held until the world ends.
    shapes: Vec<((Solid, f32), *mut JPC_Shape)>,
    /// The bodies that move, in the order of the scene.
    movers: Vec<JPC_BodyID>,
    dt_s: f32,
}

impl Jolt {
    /// Makes a world with Jolt's own settings of the solver and of contacts: JoltC has no way to change them.
    pub(super) fn new(bodies: &Bodies, threads: usize) -> Result<Self, Box<dyn Error>> {
        /// Room for bodies beyond those that are known, for scenes of a few bodies.
        const LEAST: usize = 1_024;
        /// Pairs of bodies that touch, or whose swept boxes do, per body. Cubes in a heap have three such
        /// pairs, and as many near.
        const PAIRS: usize = 8;
        /// Bytes that a pair needs during a step; with too few, Jolt would end the program.
        const PAIR_BYTES: usize = 1_536;
        set_up();
        let count = bodies.bodies.len() + LEAST;
        let pairs = c_uint::try_from(PAIRS * count)?;
        let bytes = c_uint::try_from(PAIRS * count * PAIR_BYTES + (32 << 20))?;
        // SAFETY: Jolt is set up. The three tables of functions need no object behind them, so `self` may be
        // null. All sizes are within what Jolt counts with, and the pointers go only to calls that take them.
        let mut jolt = unsafe {
            let layers = JPC_BroadPhaseLayerInterface_new(ptr::null(), LAYERS);
            let layer_filter = JPC_ObjectVsBroadPhaseLayerFilter_new(ptr::null(), LAYER_FILTER);
            let pair_filter = JPC_ObjectLayerPairFilter_new(ptr::null(), PAIR_FILTER);
            let system = JPC_PhysicsSystem_new();
            let (most, mutexes) = (count.try_into()?, 0);
            JPC_PhysicsSystem_Init(system, most, mutexes, pairs, pairs, layers, layer_filter, pair_filter);
            Self {
                system,
                allocator: JPC_TempAllocatorImpl_new(bytes),
                // The thread that steps works too, hence one thread less.
                jobs: JPC_JobSystemThreadPool_new3(
                    JPC_MAX_PHYSICS_JOBS.try_into()?,
                    JPC_MAX_PHYSICS_BARRIERS.try_into()?,
                    i32::try_from(threads)? - 1,
                ),
                layers,
                layer_filter,
                pair_filter,
                shapes: Vec::new(),
                movers: Vec::new(),
                dt_s: bodies.dt_s,
            }
        };
        for body in &bodies.bodies {
            jolt.insert(bodies, body)?;
        }
        jolt.add_movers()?;
        Ok(jolt)
    }

    fn bodies(&self) -> *mut JPC_BodyInterface {
        // SAFETY: the system is alive, and its interface lives as long.
        unsafe { JPC_PhysicsSystem_GetBodyInterface(self.system) }
    }

    /// Makes a body. Bodies that move are added later, all at once.
    fn insert(&mut self, bodies: &Bodies, body: &Body) -> Result<(), Box<dyn Error>> {
        /// The gravity of every `PhysicsSystem`, along y; a body scales it.
        const GRAVITY: f32 = -9.81;
        let Body { moves, solid, density, start } = body;
        let [x, y, z, w] = start.pose.rotation;
        let settings = JPC_BodyCreationSettings {
            Position: vec3(start.pose.translation.map(|v| v as f32)),
            Rotation: JPC_Quat { x, y, z, w },
            LinearVelocity: vec3(start.velocity.linear),
            AngularVelocity: vec3(start.velocity.angular),
            ObjectLayer: if *moves { MOVING.into() } else { FIXED.into() },
            MotionType: if *moves { JPC_MOTION_TYPE_DYNAMIC } else { JPC_MOTION_TYPE_STATIC },
            AllowSleeping: false,
            Friction: bodies.friction,
            Restitution: bodies.restitution,
            LinearDamping: 0.0,
            AngularDamping: 0.0,
            GravityFactor: bodies.gravity[1] / GRAVITY,
            Shape: self.shape(*solid, *density)?,
            ..Default::default()
        };
        // SAFETY: the system and the shape are alive; settings are copied. Jolt returns null when it is full.
        let id = unsafe {
            let made = JPC_BodyInterface_CreateBody(self.bodies(), &raw const settings);
            if made.is_null() {
                return Err("Jolt has no room for another body".into());
            }
            JPC_Body_GetID(made)
        };
        if *moves {
            self.movers.push(id);
        } else {
            // SAFETY: the body was just made and not yet added.
            unsafe { JPC_BodyInterface_AddBody(self.bodies(), id, JPC_ACTIVATION_DONT_ACTIVATE) };
        }
        Ok(())
    }

    /// Adds all bodies that move at once, so that the tree of the broad phase is balanced.
    fn add_movers(&mut self) -> Result<(), Box<dyn Error>> {
        // Jolt sorts them in place.
        let mut sorted = self.movers.clone();
        let count = sorted.len().try_into()?;
        if sorted.is_empty() {
            return Ok(());
        }
        // SAFETY: all were made and none was added; the list and what Jolt prepared from it are passed on as
        // they are.
        unsafe {
            let prepared = JPC_BodyInterface_AddBodiesPrepare(self.bodies(), sorted.as_mut_ptr(), count);
            let (first, activate) = (sorted.as_mut_ptr(), JPC_ACTIVATION_ACTIVATE);
            JPC_BodyInterface_AddBodiesFinalize(self.bodies(), first, count, prepared, activate);
            JPC_PhysicsSystem_OptimizeBroadPhase(self.system);
        }
        Ok(())
    }

    fn shape(&mut self, solid: Solid, density: f32) -> Result<*mut JPC_Shape, Box<dyn Error>> {
        if let Some((_, shape)) = self.shapes.iter().find(|(kind, _)| *kind == (solid, density)) {
            return Ok(*shape);
        }
        let (mut shape, mut error) = (ptr::null_mut(), ptr::null_mut());
        // SAFETY: settings are read during the call, which fills one of the two pointers.
        let made = unsafe {
            match solid {
                Solid::Box(half) => {
                    let mut settings = JPC_BoxShapeSettings {
                        HalfExtent: vec3(half),
                        Density: density,
                        ..Default::default()
                    };
                    // Jolt rounds edges by this radius within the box, which must be thicker.
                    let least = half.into_iter().fold(f32::INFINITY, f32::min);
                    settings.ConvexRadius = settings.ConvexRadius.min(0.5 * least);
                    JPC_BoxShapeSettings_Create(&raw const settings, &raw mut shape, &raw mut error)
                }
                Solid::Ball(radius) => {
                    let settings =
                        JPC_SphereShapeSettings { Radius: radius, Density: density, ..Default::default() };
                    JPC_SphereShapeSettings_Create(&raw const settings, &raw mut shape, &raw mut error)
                }
            }
        };
        if !made {
            // SAFETY: the call failed, so it made a string, which is copied before it is freed.
            let message = unsafe {
                let message = CStr::from_ptr(JPC_String_c_str(error)).to_string_lossy().into_owned();
                JPC_String_delete(error);
                message
            };
            return Err(format!("Jolt refuses a shape: {message}").into());
        }
        self.shapes.push(((solid, density), shape));
        Ok(shape)
    }
}

impl World for Jolt {
    fn steps(&mut self, ticks: usize) -> Result<Vec<Duration>, Box<dyn Error>> {
        timed(ticks, || {
            // SAFETY: all three are alive, and `&mut` keeps every other call on them away.
            let error =
                unsafe { JPC_PhysicsSystem_Update(self.system, self.dt_s, 1, self.allocator, self.jobs) };
            if error == JPC_PHYSICS_UPDATE_ERROR_NONE {
                Ok(())
            } else {
                Err(format!("Jolt ran out of room for contacts (flags {error:b})").into())
            }
        })
    }

    fn states(&self) -> Vec<State> {
        let interface = self.bodies();
        let state = |&id: &JPC_BodyID| {
            let (mut place, mut turn) = (vec3([0.0; 3]), JPC_Quat { x: 0.0, y: 0.0, z: 0.0, w: 1.0 });
            let (mut linear, mut angular) = (place, place);
            // SAFETY: bodies live as long as the system, and no step runs: that takes `&mut`.
            unsafe {
                JPC_BodyInterface_GetPositionAndRotation(interface, id, &raw mut place, &raw mut turn);
                JPC_BodyInterface_GetLinearAndAngularVelocity(
                    interface,
                    id,
                    &raw mut linear,
                    &raw mut angular,
                );
            }
            let turn = [turn.x, turn.y, turn.z, turn.w];
            State::new(array(place), turn, array(linear), array(angular))
        };
        self.movers.iter().map(state).collect()
    }
}

impl Drop for Jolt {
    fn drop(&mut self) {
        // SAFETY: all were made by `new` and are used no more. The system goes first, and its bodies with it,
        // for it uses the others; shapes have been held once each.
        unsafe {
            JPC_PhysicsSystem_delete(self.system);
            JPC_BroadPhaseLayerInterface_delete(self.layers);
            JPC_ObjectVsBroadPhaseLayerFilter_delete(self.layer_filter);
            JPC_ObjectLayerPairFilter_delete(self.pair_filter);
            JPC_JobSystemThreadPool_delete(self.jobs);
            JPC_TempAllocatorImpl_delete(self.allocator);
            for (_, shape) in &self.shapes {
                JPC_Shape_Release(*shape);
            }
        }
    }
}

/// Sets Jolt up, once per process.
fn set_up() {
    static DONE: OnceLock<()> = OnceLock::new();
    // SAFETY: in the order that Jolt asks for, before anything else of it, and by one thread.
    DONE.get_or_init(|| unsafe {
        JPC_RegisterDefaultAllocator();
        JPC_FactoryInit();
        JPC_RegisterTypes();
    });
}

/// The layers, both of objects and of the broad phase. Fixed objects meet only moving ones.
const FIXED: u8 = 0;
const MOVING: u8 = 1;

const LAYERS: JPC_BroadPhaseLayerInterfaceFns = JPC_BroadPhaseLayerInterfaceFns {
    GetNumBroadPhaseLayers: Some(layer_count),
    GetBroadPhaseLayer: Some(layer_of),
};
const LAYER_FILTER: JPC_ObjectVsBroadPhaseLayerFilterFns =
    JPC_ObjectVsBroadPhaseLayerFilterFns { ShouldCollide: Some(object_meets_layer) };
const PAIR_FILTER: JPC_ObjectLayerPairFilterFns =
    JPC_ObjectLayerPairFilterFns { ShouldCollide: Some(objects_meet) };

unsafe extern "C" fn layer_count(_: *const c_void) -> c_uint {
    2
}

unsafe extern "C" fn layer_of(_: *const c_void, object: JPC_ObjectLayer) -> JPC_BroadPhaseLayer {
    if object == JPC_ObjectLayer::from(FIXED) { FIXED } else { MOVING }
}

unsafe extern "C" fn object_meets_layer(_: *const c_void, object: JPC_ObjectLayer, layer: u8) -> bool {
    object != JPC_ObjectLayer::from(FIXED) || layer != FIXED
}

unsafe extern "C" fn objects_meet(_: *const c_void, a: JPC_ObjectLayer, b: JPC_ObjectLayer) -> bool {
    a != JPC_ObjectLayer::from(FIXED) || b != JPC_ObjectLayer::from(FIXED)
}

fn vec3([x, y, z]: [f32; 3]) -> JPC_Vec3 {
    JPC_Vec3 { x, y, z, _w: z }
}

fn array(v: JPC_Vec3) -> [f32; 3] {
    [v.x, v.y, v.z]
}
