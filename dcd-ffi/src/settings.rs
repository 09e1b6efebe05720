//! Reads and changes how a world is stepped: gravity, length of a step, parameters of the solver.

use dcd::StepSettings;
use rapier3d::prelude::FrictionModel;

use crate::guard::guard;
use crate::ids::DcdWorld;
use crate::limits::DCD_MAX_NUMBER;
use crate::pointer::{self, Out, Sized32, check_not_negative, check_numbers};
use crate::registry::{ask, with};
use crate::status::{DcdStatus, Failure};

/// Model of friction.
pub type DcdFrictionModel = u32;

/// One friction for each group of up to four points of contact, and one that brakes their turning: Rapier's default, the faster one.
pub const DCD_FRICTION_SIMPLIFIED: DcdFrictionModel = 0;
/// Friction at each point of contact. It keeps the momentum of crowds at borders better, and costs more.
pub const DCD_FRICTION_COULOMB: DcdFrictionModel = 1;

/// Settings by which a world is stepped. Start from DCD_SETTINGS_INIT and dcd_settings. The struct may grow at its end.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DcdSettings {
    /// Size of this struct: sizeof(DcdSettings).
    pub struct_size: u32,
    /// Number of solver iterations per step, 1 to 1000.
    pub solver_iterations: u32,
    /// Gravity, m/s².
    pub gravity: [f32; 3],
    /// Length of a step, seconds, from 0.000001 to 1.
    pub dt: f32,
    /// Units of length per metre, above 0: 100 if the program's numbers are centimetres. It scales the tolerances of the solver,
    /// the thresholds of sleep, and `max_correction`. Gravity, `speed_limit`, densities and all else are numbers in the program's
    /// units.
    pub length_unit: f32,
    /// Largest speed of a dynamic body (DcdWorldDef.speed_limit), m/s, above 0, up to DCD_MAX_NUMBER.
    pub speed_limit: f32,
    /// Natural frequency of contacts, 1/s, 0 or more: higher is stiffer.
    pub contact_frequency: f32,
    /// Damping ratio of contacts, 0 or more: higher takes overlaps away more slowly.
    pub contact_damping: f32,
    /// Natural frequency of contacts with fixed bodies, 1/s, 0 or more.
    pub static_frequency: f32,
    /// Damping ratio of contacts with fixed bodies, 0 or more.
    pub static_damping: f32,
    /// Largest speed at which overlaps are taken away, m/s, 0 or more.
    pub max_correction: f32,
    /// Overlap that is left as it is, metres, 0 or more.
    pub allowed_overlap: f32,
    /// Distance ahead at which contacts are looked for, metres, 0 or more.
    pub contact_margin: f32,
    /// Part of the last step's impulses with which the next begins (warm start), 0 to 1.
    pub warm_start: f32,
    /// Number of iterations within each solver iteration, 1 to 1000.
    pub internal_iterations: u32,
    /// Largest number of substeps by which bodies with DCD_BODY_CCD are swept in a step, 0 to 1000.
    pub ccd_substeps: u32,
    /// Disagreement of copies that DCD_COUPLING_AUTO tolerates, m/s, above 0.
    pub tolerance: f32,
    /// DCD_FRICTION_... constant: how friction is solved.
    pub friction_model: DcdFrictionModel,
}

// SAFETY: begins with `struct_size`; every other member is a number.
unsafe impl Sized32 for DcdSettings {
    const NAME: &'static str = "DcdSettings";
}

/// Checks the largest speed of dynamic bodies. `or` says what else may be given.
pub(crate) fn check_speed_limit(limit: f32, or: &str) -> Result<(), Failure> {
    if limit > 0.0 && limit <= DCD_MAX_NUMBER {
        return Ok(());
    }
    Err(Failure::argument(format!(
        "speed_limit is {limit}; give m/s above 0, up to DCD_MAX_NUMBER ({DCD_MAX_NUMBER}){or}"
    )))
}

/// All models of friction.
const FRICTION: [DcdFrictionModel; 2] = [DCD_FRICTION_SIMPLIFIED, DCD_FRICTION_COULOMB];

/// Largest number of iterations and substeps.
const MOST: u32 = 1000;

impl DcdSettings {
    fn of(settings: &StepSettings) -> Self {
        let rapier = &settings.integration;
        Self {
            struct_size: size_of::<Self>() as u32,
            solver_iterations: settings.solver_iterations as u32,
            gravity: settings.gravity,
            dt: settings.dt_s,
            length_unit: rapier.length_unit,
            speed_limit: settings.speed_limit_m_s(),
            contact_frequency: rapier.contact_softness.natural_frequency,
            contact_damping: rapier.contact_softness.damping_ratio,
            static_frequency: rapier.static_contact_softness.natural_frequency,
            static_damping: rapier.static_contact_softness.damping_ratio,
            max_correction: rapier.normalized_max_corrective_velocity,
            allowed_overlap: rapier.normalized_allowed_linear_error,
            contact_margin: rapier.normalized_prediction_distance,
            warm_start: rapier.warmstart_coefficient,
            internal_iterations: rapier.num_internal_pgs_iterations as u32,
            ccd_substeps: rapier.max_ccd_substeps as u32,
            tolerance: settings.tolerance_m_s,
            friction_model: match rapier.friction_model {
                FrictionModel::Simplified => DCD_FRICTION_SIMPLIFIED,
                FrictionModel::Coulomb => DCD_FRICTION_COULOMB,
            },
        }
    }

    /// Checks what the world itself does not check. The world refuses the rest.
    fn check(&self) -> Result<(), Failure> {
        if !FRICTION.contains(&self.friction_model) {
            let given = self.friction_model;
            return Err(Failure::argument(format!(
                "friction_model is {given}; give a DCD_FRICTION_ constant"
            )));
        }
        check_numbers(&self.gravity, "gravity")?;
        pointer::check_fraction(self.warm_start, "warm_start")?;
        if !(1..=MOST).contains(&self.internal_iterations) {
            let given = self.internal_iterations;
            return Err(Failure::argument(format!("internal_iterations is {given}; give 1 to {MOST}")));
        }
        if self.ccd_substeps > MOST {
            let given = self.ccd_substeps;
            return Err(Failure::argument(format!("ccd_substeps is {given}; give 0 to {MOST}")));
        }
        check_speed_limit(self.speed_limit, "")?;
        for (value, name) in [
            (self.contact_frequency, "contact_frequency"),
            (self.contact_damping, "contact_damping"),
            (self.static_frequency, "static_frequency"),
            (self.static_damping, "static_damping"),
            (self.max_correction, "max_correction"),
            (self.allowed_overlap, "allowed_overlap"),
            (self.contact_margin, "contact_margin"),
        ] {
            check_not_negative(value, name)?;
        }
        if !(self.length_unit > 0.0 && pointer::is_in_range(self.length_unit)) {
            let given = self.length_unit;
            return Err(Failure::argument(format!(
                "length_unit is {given}; give units per metre, above 0: 1 for metres, 100 for centimetres"
            )));
        }
        Ok(())
    }

    fn applied_to(&self, mut settings: StepSettings) -> StepSettings {
        settings.solver_iterations = self.solver_iterations as usize;
        settings.gravity = self.gravity;
        settings.dt_s = self.dt;
        settings.tolerance_m_s = self.tolerance;
        let rapier = &mut settings.integration;
        rapier.length_unit = self.length_unit;
        rapier.contact_softness.natural_frequency = self.contact_frequency;
        rapier.contact_softness.damping_ratio = self.contact_damping;
        rapier.static_contact_softness.natural_frequency = self.static_frequency;
        rapier.static_contact_softness.damping_ratio = self.static_damping;
        rapier.normalized_max_corrective_velocity = self.max_correction;
        rapier.normalized_allowed_linear_error = self.allowed_overlap;
        rapier.normalized_prediction_distance = self.contact_margin;
        rapier.warmstart_coefficient = self.warm_start;
        rapier.num_internal_pgs_iterations = self.internal_iterations as usize;
        rapier.max_ccd_substeps = self.ccd_substeps as usize;
        rapier.friction_model = match self.friction_model {
            DCD_FRICTION_COULOMB => FrictionModel::Coulomb,
            _ => FrictionModel::Simplified,
        };
        settings.with_speed_limit(self.speed_limit)
    }
}

/// Reads how a world is stepped. A node takes its settings from its server and cannot tell them.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT, DCD_ERR_UNSUPPORTED (a node).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_settings(world: DcdWorld, out: *mut DcdSettings) -> DcdStatus {
    guard("dcd_settings", || {
        // SAFETY: the caller vouches for the pointer.
        let out = unsafe { Out::sized(out, "out")? };
        ask(world, |world| {
            out.write(DcdSettings::of(&world.dcd.settings()?));
            Ok(())
        })
    })
}

/// Changes how a world is stepped, from the next dcd_step on: read the settings by dcd_settings, change members, and give them
/// back. Bodies that sleep are woken if gravity changes. The settings are saved with the world.
///
/// A served world keeps the settings with which its server was made, and is stepped by Rapier's own parameters. In a world that is
/// to be a server's source, change only gravity, dt, solver_iterations, tolerance and speed_limit.
///
/// `settings` is read during the call.
/// Errors:
/// - DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT.
/// - DCD_ERR_ARGUMENT: a member out of range. Then nothing is changed.
/// - DCD_ERR_UNSUPPORTED: in a served world.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_settings_set(world: DcdWorld, settings: *const DcdSettings) -> DcdStatus {
    guard("dcd_settings_set", || {
        // SAFETY: the caller vouches for the pointer.
        let settings = unsafe { pointer::read_sized(settings, "settings")? };
        settings.check()?;
        with(world, |world| {
            let present = world.dcd.settings()?;
            Ok(world.dcd.set_settings(settings.applied_to(present))?)
        })
    })
}

/// Changes gravity, m/s², as dcd_settings_set does. `gravity` has three floats.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT (numbers out of range), DCD_ERR_UNSUPPORTED (in a served world).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_gravity_set(world: DcdWorld, gravity: *const f32) -> DcdStatus {
    guard("dcd_gravity_set", || {
        // SAFETY: three floats have the alignment of one; the caller vouches for them.
        let gravity = unsafe { pointer::read(gravity.cast::<[f32; 3]>(), "gravity")? };
        check_numbers(&gravity, "gravity")?;
        with(world, |world| {
            let present = world.dcd.settings()?;
            Ok(world.dcd.set_settings(StepSettings { gravity, ..present })?)
        })
    })
}
