//! Creates local worlds, empty or from a scene, describes worlds, and destroys them.

use std::ffi::c_char;

use dcd::physics::{Coupling, CouplingChoice, Method, Preset, StepSettings};
use dcd::space::Axis;
use dcd::{Bounds, Params, Partitioning, Scene, World as Dcd, WorldConfig};

use crate::fidelity::{self, DcdFidelity};
use crate::guard::{guard, guard_value};
use crate::ids::DcdWorld;
use crate::pointer::{self, Out, Sized32, check_reserved};
use crate::registry::{self, add, ask};
use crate::role::{DcdRole, number_of};
use crate::settings::check_speed_limit;
use crate::status::{DcdStatus, Failure};

/// Coupling: how regions come to consensus on the bodies that they share.
pub type DcdCoupling = u32;

/// The scene's coupling, else DCD_COUPLING_AUTO.
pub const DCD_COUPLING_DEFAULT: DcdCoupling = 0;
/// Ghosts of a neighbour's bodies push and are not pushed. The world gains energy and drops stacks: use it to compare with.
pub const DCD_COUPLING_PROXY: DcdCoupling = 1;
/// The owner overwrites ghosts after each step. It is the cheapest coupling. Momentum is not conserved across a border.
pub const DCD_COUPLING_OWNER: DcdCoupling = 2;
/// Bodies near a border live in both regions. Each copy has a part of the mass (mass splitting), and all copies take their mean
/// velocity (consensus).
pub const DCD_COUPLING_OVERLAP: DcdCoupling = 3;
/// Both regions solve with whole copies, and bodies that stay in touch (an island) move whole to one region. An island above
/// island_limit is treated as with DCD_COUPLING_OVERLAP.
pub const DCD_COUPLING_ISLAND: DcdCoupling = 4;
/// As DCD_COUPLING_ISLAND, with as many exchanges at each border as the disagreement of its copies asks for.
pub const DCD_COUPLING_AUTO: DcdCoupling = 5;

/// Accuracy that is asked of DCD_COUPLING_AUTO.
pub type DcdPreset = u32;

/// The scene's preset, else DCD_PRESET_GAME.
pub const DCD_PRESET_DEFAULT: DcdPreset = 0;
/// Speed first: at most 2 exchanges, islands of up to 256 bodies whole, a tolerance of 0.1 m/s.
pub const DCD_PRESET_DRAFT: DcdPreset = 1;
/// For games: at most 4 exchanges, every island whole, a tolerance of 0.03 m/s.
pub const DCD_PRESET_GAME: DcdPreset = 2;
/// Accuracy first: at most 4 exchanges, a depth of 3 hops, every island whole, a tolerance of 0.01 m/s.
pub const DCD_PRESET_PRECISE: DcdPreset = 3;

/// In DcdWorldDef.axes: planes across x may cut the world into regions. In DcdCut.axis: the plane lies across x.
pub const DCD_CUT_X: u32 = 1;
/// In DcdWorldDef.axes: planes across y may cut the world into regions. In DcdCut.axis: the plane lies across y.
pub const DCD_CUT_Y: u32 = 2;
/// In DcdWorldDef.axes: planes across z may cut the world into regions. In DcdCut.axis: the plane lies across z.
pub const DCD_CUT_Z: u32 = 4;

/// Plane that cuts a world into regions.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DcdCut {
    /// Position of the plane along its axis, metres.
    pub at: f64,
    /// Axis across which the plane lies: DCD_CUT_X, DCD_CUT_Y or DCD_CUT_Z.
    pub axis: u32,
    /// Reserved; must be 0.
    pub reserved: u32,
}

/// Definition of a local world. Start from DCD_WORLD_DEF_INIT.
///
/// The world is cut into `regions` regions by halving. The largest part of the box from `min` to `max` is halved across its longest
/// edge, until there are enough parts. The axis along which gravity pulls most is not cut, unless nothing else is left to halve: a
/// level cut goes through all that lies on the ground. `axes` says otherwise, and `cuts` names the planes instead. dcd_regions lists
/// the result.
///
/// A cut costs least where nothing lies near it, so place the box around what moves, or the planes between what moves apart. Each
/// region costs something all the same: a game of 2,000 bodies takes more processor time in four regions than in one (the manual's
/// page on regions and couplings says how much).
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdWorldDef {
    /// Size of this struct: sizeof(DcdWorldDef).
    pub struct_size: u32,
    /// Number of threads that compute the world, however many regions it has, 1 to 1024; 0: one per core. With 1, the thread that
    /// calls dcd_step computes, as it does anyhow while few bodies are awake. The result does not depend on it.
    pub threads: u32,
    /// Number of regions that the world is cut into, 1 to 256; 0: as many as the scene asks for, else 1, and more only where the
    /// bodies of a scene lie too far apart for the f32 of one region. One region is exact, and uses all threads.
    pub regions: u32,
    /// Number of solver iterations per step, 1 to 1000. More iterations make tall stacks stiffer and cost time.
    pub solver_iterations: u32,
    /// Gravity, m/s².
    pub gravity: [f32; 3],
    /// Length of a step, seconds, from 0.000001 to 1. It belongs to the world: all processes that compute a world share it.
    pub dt: f32,
    /// Lowest corner of the box that is cut into regions, metres. Bodies may leave the box: outer regions reach to infinity.
    pub min: [f64; 3],
    /// Highest corner of the box that is cut into regions, metres, above the lowest along each axis.
    pub max: [f64; 3],
    /// User data of the world; dcd_world_info gives it back.
    pub user_data: u64,
    /// DCD_COUPLING_... constant: how regions come to consensus. It has no effect in a world of one region.
    pub coupling: DcdCoupling,
    /// DCD_PRESET_... constant: stands for DCD_COUPLING_AUTO and for exchanges, depth, island_limit and tolerance. With another
    /// coupling it must be 0.
    pub preset: DcdPreset,
    /// Number of exchanges between regions per step, 1 to 64; with DCD_COUPLING_AUTO the most that a border may take. 0: what suits
    /// the coupling.
    pub exchanges: u32,
    /// Number of contact hops across a border within which bodies live in both regions, 1 to 16; 0: what suits the coupling.
    pub depth: u32,
    /// Largest number of bodies of an island that moves whole to one region, up to 65534; 0: what suits the coupling.
    pub island_limit: u32,
    /// Disagreement of copies that DCD_COUPLING_AUTO tolerates, m/s, above 0; 0: what suits the coupling.
    pub tolerance: f32,
    /// DCD_CUT_... bits: the axes across which `regions` are cut; 0: all but that of gravity. With `regions` 0 it must be 0.
    pub axes: u32,
    /// Largest speed of a dynamic body, m/s, up to DCD_MAX_NUMBER; 0: what the scene says, else 400. The speed of a body that
    /// forces and contacts make faster is cut to it. A body that is made or set to be faster is refused. dcd_settings_set changes
    /// it.
    pub speed_limit: f32,
    /// DCD_FIDELITY_... constant: how much of the world is computed in full. dcd_viewpoints_set says where the world is looked at
    /// from. It goes with the couplings that share mass: not with DCD_COUPLING_OWNER and DCD_COUPLING_PROXY.
    pub fidelity: DcdFidelity,
    /// Limit for `fidelity`, above 0: m/s with DCD_FIDELITY_TOLERANCE, milliseconds with DCD_FIDELITY_BUDGET. With all others it
    /// is 0.
    pub fidelity_limit: f32,
    /// Planes that cut the world, each through all of it, or null. Each must cut a region that those before it have left. With them,
    /// `regions` and `axes` must be 0.
    pub cuts: *const DcdCut,
    /// Number of `cuts`. There may be 256 regions between them.
    pub cut_count: u32,
    /// Reserved; must be 0.
    pub reserved: u32,
}

/// Role, tick and settings of a world. Start from DCD_WORLD_INFO_INIT.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdWorldInfo {
    /// Size of this struct: sizeof(DcdWorldInfo).
    pub struct_size: u32,
    /// Role of this process: DCD_ROLE_LOCAL, DCD_ROLE_CLIENT, DCD_ROLE_BUILDER, DCD_ROLE_PARTICIPANT, DCD_ROLE_SERVER or
    /// DCD_ROLE_NODE.
    pub role: DcdRole,
    /// Number of steps since the world began; in a served world, the newest step heard of. There it lags by some milliseconds while
    /// bodies move. While all bodies rest it comes every 30 steps, then every 5 s (dcd_view_time tells the tick meanwhile). At the
    /// server it comes every 30 steps, and lags by up to 12 steps more.
    pub tick: u64,
    /// User data that the program gave the world.
    pub user_data: u64,
    /// Number of regions that the world is cut into; for a node, of those that this process computes.
    pub regions: u32,
    /// Length of a step, seconds; 0 for a node, which takes it from its server, as gravity.
    pub dt: f32,
    /// Gravity, m/s²; 0 for a node.
    pub gravity: [f32; 3],
    /// Number by which the server knows this client, builder or participant, from 1; 0 for all others.
    pub client: u32,
    /// Largest speed of a dynamic body, m/s, as dcd_settings_set left it; 0 for a node.
    pub speed_limit: f32,
    /// Reserved; always 0.
    pub reserved: u32,
}

// SAFETY: begins with `struct_size`; every other member is a number or a pointer.
unsafe impl Sized32 for DcdWorldDef {
    const NAME: &'static str = "DcdWorldDef";
}
// SAFETY: begins with `struct_size`; every other member is a number.
unsafe impl Sized32 for DcdWorldInfo {
    const NAME: &'static str = "DcdWorldInfo";
}

/// Returns how many threads a process that joins will use.
pub(crate) fn asked_threads(asked: u32) -> Result<usize, Failure> {
    if asked > 1024 {
        return Err(Failure::argument(format!("threads is {asked}; give 1 to 1024, or 0")));
    }
    Ok(threads(asked))
}

/// Returns how many threads are meant; 0 is one per core.
pub(crate) fn threads(asked: u32) -> usize {
    match asked {
        0 => std::thread::available_parallelism().map_or(1, |cores| cores.get()),
        asked => asked as usize,
    }
}

/// Returns the item that a number means. Items are numbered in their order from 1, and 0 is none.
fn nth<T: Copy>(all: &[T], number: u32, name: &str, prefix: &str) -> Result<Option<T>, Failure> {
    match (number as usize).checked_sub(1) {
        None => Ok(None),
        Some(index) => all.get(index).copied().map(Some).ok_or_else(|| {
            Failure::argument(format!("{name} is {number}, the last is {}; give a {prefix}...", all.len()))
        }),
    }
}

/// Returns what a definition asks of the coupling. The ranges of its numbers are checked with all others.
fn choice(def: &DcdWorldDef) -> Result<CouplingChoice, Failure> {
    let coupling = nth(&Coupling::ALL, def.coupling, "coupling", "DCD_COUPLING_")?;
    let method = match (coupling, nth(&Preset::ALL, def.preset, "preset", "DCD_PRESET_")?) {
        (None, None) => None,
        (Some(coupling), None) => Some(Method::Coupling(coupling)),
        (None | Some(Coupling::Auto), Some(preset)) => Some(Method::Preset(preset)),
        (Some(coupling), Some(preset)) => {
            return Err(Failure::argument(format!(
                "preset `{}` does not go with coupling `{}`; leave preset 0, or take DCD_COUPLING_AUTO",
                preset.name(),
                coupling.name()
            )));
        }
    };
    let asked = |number: u32| (number > 0).then_some(number as usize);
    Ok(CouplingChoice {
        method,
        exchanges: asked(def.exchanges),
        depth: asked(def.depth),
        island_limit: asked(def.island_limit),
        // -0.0 is 0 too. The world refuses NaN.
        tolerance_m_s: (def.tolerance != 0.0).then_some(def.tolerance),
    })
}

/// The axes by their bits.
const AXES: [(u32, Axis); 3] = [(DCD_CUT_X, Axis::X), (DCD_CUT_Y, Axis::Y), (DCD_CUT_Z, Axis::Z)];

/// Returns the plane that a program describes.
fn plane(cut: &DcdCut) -> Result<(Axis, f64), Failure> {
    check_reserved(cut.reserved)?;
    pointer::check_point(&[cut.at, 0.0, 0.0], "cuts[i].at")?;
    let known = AXES.into_iter().find(|(bit, _)| *bit == cut.axis);
    let (_, axis) = known.ok_or_else(|| {
        let given = cut.axis;
        Failure::argument(format!("cuts[i].axis is {given}; give DCD_CUT_X, DCD_CUT_Y or DCD_CUT_Z"))
    })?;
    Ok((axis, cut.at))
}

/// Returns the cut that a definition names, if it names one.
///
/// # Safety
/// `cuts` is valid for reading `cut_count` planes, or that is 0.
unsafe fn partitioning(def: &DcdWorldDef) -> Result<Option<Partitioning>, Failure> {
    check_reserved(def.reserved)?;
    pointer::check_bits(def.axes, DCD_CUT_X | DCD_CUT_Y | DCD_CUT_Z, "axes")?;
    // SAFETY: the caller upholds the same contract.
    let cuts = unsafe { pointer::slice(def.cuts, def.cut_count as usize, "cuts")? };
    if !cuts.is_empty() {
        if def.regions != 0 || def.axes != 0 {
            return Err(Failure::argument(
                "cuts says how to cut, and so does regions or axes; leave these 0",
            ));
        }
        return Ok(Some(Partitioning::Cuts(cuts.iter().map(plane).collect::<Result<_, _>>()?)));
    }
    let axes: Vec<_> =
        AXES.into_iter().filter(|(bit, _)| def.axes & bit != 0).map(|(_, axis)| axis).collect();
    match (def.regions as usize, axes.is_empty()) {
        (0, true) => Ok(None),
        (0, false) => Err(Failure::argument("axes says how to cut, and regions is 0; give their number too")),
        (regions, true) => Ok(Some(Partitioning::Regions(regions))),
        (regions, false) => Ok(Some(Partitioning::RegionsAcross(regions, axes))),
    }
}

/// Returns the settings with the speed limit that a definition asks for.
fn limited(step: StepSettings, def: &DcdWorldDef) -> Result<StepSettings, Failure> {
    if def.speed_limit == 0.0 {
        return Ok(step);
    }
    check_speed_limit(def.speed_limit, ", or 0 for 400")?;
    Ok(step.with_speed_limit(def.speed_limit))
}

/// Creates an empty local world, which this process computes alone. Destroy it with dcd_world_destroy.
///
/// `def` and its `cuts` are read during the call. `out` receives the handle.
/// Errors: DCD_ERR_NULL, DCD_ERR_STRUCT, DCD_ERR_ARGUMENT (a member out of range), DCD_ERR_LIMIT (no threads).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_world_create(def: *const DcdWorldDef, out: *mut DcdWorld) -> DcdStatus {
    guard("dcd_world_create", || {
        // SAFETY: the caller vouches for both pointers.
        let (def, out) = unsafe { (pointer::read_sized(def, "def")?, Out::new(out, "out")?) };
        pointer::check_numbers(&def.gravity, "gravity")?;
        pointer::check_point(&def.min, "min")?;
        pointer::check_point(&def.max, "max")?;
        let step = StepSettings {
            gravity: def.gravity,
            dt_s: def.dt,
            solver_iterations: def.solver_iterations as usize,
            ..StepSettings::default()
        };
        let config = WorldConfig {
            bounds: Bounds::new(def.min, def.max),
            // SAFETY: the caller vouches for `cuts`.
            partitioning: unsafe { partitioning(&def)? }.unwrap_or_default(),
            threads: threads(def.threads),
            step: limited(choice(&def)?.applied_to(step), &def)?,
            fidelity: fidelity::asked(def.fidelity, def.fidelity_limit)?.unwrap_or_default(),
            ..WorldConfig::default()
        };
        out.write(add(Dcd::new(config)?, def.user_data));
        Ok(())
    })
}

/// Creates a local world from a scene: a scene of the library ("tower", "pile", "chain" …) or a file whose name ends in .toml,
/// .xml, .mjcf or .urdf. Body i of the scene is dcd_body_at(world, i).
///
/// `params` points to `param_count` texts "name=value" that change parameters of the scene, such as "n=100". It may be null when
/// there are none. Of `def`, only threads, regions, user_data and the members after user_data count; the scene says the rest. A
/// null `def` is DCD_WORLD_DEF_INIT. Everything is read during the call.
/// Errors:
/// - As dcd_world_create.
/// - DCD_ERR_ARGUMENT: an unknown scene or parameter, or a wrong file; the message names the line.
/// - DCD_ERR_IO: the file cannot be read.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_world_open_scene(
    name_or_path: *const c_char,
    params: *const *const c_char,
    param_count: usize,
    def: *const DcdWorldDef,
    out: *mut DcdWorld,
) -> DcdStatus {
    guard("dcd_world_open_scene", || {
        // SAFETY: the caller vouches for the pointers and the texts.
        let (opened, out) = unsafe { (open(name_or_path, params, param_count, def)?, Out::new(out, "out")?) };
        let Opened { scene, config, user_data } = opened;
        out.write(add(Dcd::from_scene(&scene, config)?, user_data));
        Ok(())
    })
}

/// A scene, and how the world that it describes is computed.
pub(crate) struct Opened {
    pub scene: Scene,
    pub config: WorldConfig,
    pub user_data: u64,
}

/// Opens a scene by the arguments of dcd_world_open_scene.
///
/// # Safety
/// Each pointer is null or valid for reading; texts end with NUL and nobody writes them meanwhile.
pub(crate) unsafe fn open(
    name_or_path: *const c_char,
    params: *const *const c_char,
    param_count: usize,
    def: *const DcdWorldDef,
) -> Result<Opened, Failure> {
    // SAFETY: the caller upholds the same contract.
    let (name, params) = unsafe {
        let texts = pointer::slice(params, param_count, "params")?;
        let texts: Vec<&str> =
            texts.iter().map(|&text| pointer::text(text, "params[i]")).collect::<Result<_, _>>()?;
        (pointer::text(name_or_path, "the scene's name or path")?, Params::from_args(texts)?)
    };
    // SAFETY: not null; the caller vouches for the rest.
    let def = if def.is_null() { None } else { Some(unsafe { pointer::read_sized(def, "def")? }) };
    let scene = Scene::open(name, &params)?;
    let mut config = WorldConfig { threads: threads(0), ..WorldConfig::for_scene(&scene) };
    let Some(def) = def else { return Ok(Opened { scene, config, user_data: 0 }) };
    // SAFETY: the caller upholds the same contract.
    if let Some(cut) = unsafe { partitioning(&def)? } {
        config.partitioning = cut;
    }
    config.threads = threads(def.threads);
    config.step = limited(choice(&def)?.applied_to(config.step), &def)?;
    config.fidelity = fidelity::asked(def.fidelity, def.fidelity_limit)?.unwrap_or(config.fidelity);
    Ok(Opened { scene, config, user_data: def.user_data })
}

/// Destroys a local world with everything in it, or leaves a served one, where the avatars of this process wait for its return. The
/// world's handles become stale, and what dcd_state_view and dcd_events lent is freed.
///
/// The call waits for a call that runs on the world in another thread. Calls that wait behind it find the world gone. A recording
/// ends, and whether it is whole is only logged (dcd_log_set): call dcd_record_stop first in a local world.
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (also when destroyed twice), DCD_ERR_BUSY.
#[unsafe(no_mangle)]
pub extern "C" fn dcd_world_destroy(world: DcdWorld) -> DcdStatus {
    guard("dcd_world_destroy", || {
        registry::remove(world)?;
        tracing::info!(world = world.v, "world destroyed");
        Ok(())
    })
}

/// Returns whether the handle names a world. It never waits.
#[unsafe(no_mangle)]
pub extern "C" fn dcd_world_is_valid(world: DcdWorld) -> bool {
    guard_value(false, || registry::contains(world))
}

/// Reads the role, tick and settings of a world.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_world_info(world: DcdWorld, out: *mut DcdWorldInfo) -> DcdStatus {
    guard("dcd_world_info", || {
        // SAFETY: the caller vouches for the pointer.
        let out = unsafe { Out::sized(out, "out")? };
        ask(world, |world| {
            out.write(DcdWorldInfo {
                struct_size: size_of::<DcdWorldInfo>() as u32,
                role: number_of(world.dcd.role()),
                tick: world.dcd.tick().0,
                user_data: world.user_data,
                regions: world.dcd.region_count() as u32,
                dt: world.dcd.dt_s(),
                gravity: world.dcd.gravity(),
                client: world.dcd.client().map_or(0, |client| client.0),
                speed_limit: world.dcd.speed_limit_m_s(),
                reserved: 0,
            });
            Ok(())
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::status::{DCD_ERR_ARGUMENT, DCD_ERR_PANIC, DCD_ERR_STALE_ID, DCD_OK};
    use crate::step::{DCD_FOREVER, dcd_step, dcd_step_begin, dcd_step_wait};

    #[test]
    fn the_numbers_of_couplings_and_presets_are_in_their_order() {
        let coupling = |number| nth(&Coupling::ALL, number, "coupling", "").unwrap();
        assert_eq!(coupling(DCD_COUPLING_DEFAULT), None);
        assert_eq!(coupling(DCD_COUPLING_PROXY), Some(Coupling::Proxy));
        assert_eq!(coupling(DCD_COUPLING_OWNER), Some(Coupling::Owner));
        assert_eq!(coupling(DCD_COUPLING_OVERLAP), Some(Coupling::Overlap));
        assert_eq!(coupling(DCD_COUPLING_ISLAND), Some(Coupling::Island));
        assert_eq!(coupling(DCD_COUPLING_AUTO), Some(Coupling::Auto));
        let preset = |number| nth(&Preset::ALL, number, "preset", "").unwrap();
        assert_eq!(preset(DCD_PRESET_DEFAULT), None);
        assert_eq!(preset(DCD_PRESET_DRAFT), Some(Preset::Draft));
        assert_eq!(preset(DCD_PRESET_GAME), Some(Preset::Game));
        assert_eq!(preset(DCD_PRESET_PRECISE), Some(Preset::Precise));
    }

    #[test]
    fn a_world_that_panicked_can_only_be_destroyed_and_others_go_on() {
        let local = || Dcd::new(WorldConfig::default()).unwrap();
        let (broken, other) = (add(local(), 0), add(local(), 0));
        let status = guard("dcd_test", || registry::with(broken, |_| panic!("a bug")));
        assert_eq!(status, DCD_ERR_PANIC);
        assert_eq!(dcd_step(broken), DCD_ERR_PANIC);
        assert_eq!(dcd_step(other), DCD_OK);
        assert_eq!(dcd_step_begin(broken), DCD_ERR_PANIC);
        assert_eq!(dcd_step_wait(broken, DCD_FOREVER), DCD_ERR_ARGUMENT, "nothing was begun");
        // This thread keeps the world that it called last.
        assert_eq!(dcd_step(broken), DCD_ERR_PANIC);
        assert_eq!(dcd_world_destroy(broken), DCD_OK);
        assert_eq!(dcd_step(broken), DCD_ERR_STALE_ID);
        assert_eq!(dcd_step_begin(broken), DCD_ERR_STALE_ID);
        let asked = add(local(), 0);
        let status = guard("dcd_test", || registry::ask(asked, |_| panic!("a bug of a query")));
        assert_eq!(status, DCD_ERR_PANIC);
        assert_eq!(dcd_step(asked), DCD_ERR_PANIC);
        assert_eq!(guard("dcd_test", || registry::ask(asked, |_| Ok(()))), DCD_ERR_PANIC);
        assert_eq!(dcd_world_destroy(asked), DCD_OK);
        assert_eq!(guard("dcd_test", || registry::ask(asked, |_| Ok(()))), DCD_ERR_STALE_ID);
        assert_eq!(dcd_world_destroy(other), DCD_OK);
    }
}
