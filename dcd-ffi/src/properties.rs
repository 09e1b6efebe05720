//! Reads and changes the properties of living bodies: type, damping, locked axes, thresholds of sleep, extra mass.

use dcd::physics::ShapeError;
use dcd::protocol::{BodyKind, BodyRecord, BodyTraits, ColliderMass, ColliderRecord, ExtraMass, MassRecord};
use dcd::space::BodyId;
use rapier3d::dynamics::RigidBodyAdditionalMassProps;
use rapier3d::prelude::*;

use crate::guard::guard;
use crate::ids::{DcdBodyId, DcdWorld};
use crate::pointer::{self, Out, Sized32, check_bits, check_not_negative, check_numbers, check_reserved};
use crate::registry::{World, ask, missing, with};
use crate::status::{DcdStatus, Failure};
use crate::types::{
    DCD_BODY_CCD, DCD_BODY_DISABLED, DCD_BODY_FAST_SPIN, DCD_BODY_NO_GYRO, DCD_BODY_NO_SLEEP, DCD_DYNAMIC,
    DCD_FIXED, DCD_KINEMATIC, DCD_KINEMATIC_POSE, DcdBodyType,
};

/// Properties of a body, except those of its colliders: the members of DcdBodyDef, to be read and changed later. Start from
/// DCD_BODY_PROPERTIES_INIT and dcd_body_properties.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DcdBodyProperties {
    /// Size of this struct: sizeof(DcdBodyProperties).
    pub struct_size: u32,
    /// Type: DCD_FIXED, DCD_DYNAMIC, DCD_KINEMATIC or DCD_KINEMATIC_POSE.
    pub body_type: DcdBodyType,
    /// DCD_BODY_CCD, DCD_BODY_NO_SLEEP, DCD_BODY_DISABLED, DCD_BODY_FAST_SPIN and DCD_BODY_NO_GYRO bits.
    pub flags: u32,
    /// DCD_LOCK_… bits: axes of the world that a dynamic body does not follow.
    pub locked: u32,
    /// Dominance, -128 to 127. This and all that follows is as in DcdBodyDef.
    pub dominance: i32,
    /// Damping of movement, 1/s.
    pub linear_damping: f32,
    /// Damping of turning, 1/s.
    pub angular_damping: f32,
    /// Factor on gravity.
    pub gravity_scale: f32,
    /// Distance ahead at which the body looks for what it may meet, metres.
    pub soft_ccd: f32,
    /// Speed below which the body may fall asleep, m/s.
    pub sleep_linear: f32,
    /// Spin below which the body may fall asleep, rad/s.
    pub sleep_angular: f32,
    /// Time that the body must have been so slow before it falls asleep, seconds.
    pub sleep_after: f32,
    /// Mass besides that of the shapes, kilograms.
    pub extra_mass: f32,
    /// Centre of the extra mass, from the body's origin, metres.
    pub extra_centre: [f32; 3],
    /// Moments of inertia of the extra mass about the body's x, y and z, kg m². For a part of a model (MJCF, URDF) they are about
    /// the part's principal axes, which may be turned on the body, and which stay until its extra_mass is 0.
    pub extra_inertia: [f32; 3],
    /// Number of solver iterations more than others have.
    pub extra_solver_iterations: u32,
    /// Number of additional iterations within each solver iteration.
    pub extra_pgs_iterations: u32,
    /// Reserved; must be 0.
    pub reserved: u32,
    /// User data of the body.
    pub user_data: u64,
}

// SAFETY: begins with `struct_size`; every other member is a number.
unsafe impl Sized32 for DcdBodyProperties {
    const NAME: &'static str = "DcdBodyProperties";
}

/// Largest number of additional solver iterations for one body.
const MAX_ITERATIONS: u32 = 1000;

impl DcdBodyProperties {
    pub(crate) fn of(BodyRecord { traits, user_data, .. }: &BodyRecord) -> Self {
        let bit = |bit: u32, set: bool| if set { bit } else { 0 };
        let can_sleep = traits.sleep_linear_threshold >= 0.0;
        let (mass, centre, inertia) = match traits.extra_mass {
            None => (0.0, [0.0; 3], [0.0; 3]),
            Some(ExtraMass::Mass(mass)) => (mass, [0.0; 3], [0.0; 3]),
            Some(ExtraMass::Properties(record)) => {
                let inverse = |v: f32| if v == 0.0 { 0.0 } else { v.recip() };
                let inertia = record.inv_principal_inertia.map(inverse);
                (inverse(record.inv_mass), record.local_com, inertia)
            }
        };
        let [sleep_linear, sleep_angular] = thresholds_of(traits);
        Self {
            struct_size: size_of::<Self>() as u32,
            body_type: type_of(traits.kind),
            flags: bit(DCD_BODY_CCD, traits.ccd)
                | bit(DCD_BODY_NO_SLEEP, !can_sleep)
                | bit(DCD_BODY_DISABLED, !traits.enabled)
                | bit(DCD_BODY_FAST_SPIN, traits.fast_rotation)
                | bit(DCD_BODY_NO_GYRO, !traits.gyroscopic),
            locked: traits.locked_axes.into(),
            dominance: traits.dominance.into(),
            linear_damping: traits.linear_damping,
            angular_damping: traits.angular_damping,
            gravity_scale: traits.gravity_scale,
            soft_ccd: traits.soft_ccd_m,
            sleep_linear,
            sleep_angular,
            sleep_after: traits.sleep_after_s,
            extra_mass: mass,
            extra_centre: centre,
            extra_inertia: inertia,
            extra_solver_iterations: traits.extra_solver_iterations,
            extra_pgs_iterations: traits.extra_pgs_iterations,
            reserved: 0,
            user_data: *user_data as u64,
        }
    }

    pub(crate) fn check(&self) -> Result<(), Failure> {
        kind_of(self.body_type)?;
        check_reserved(self.reserved)?;
        let flags =
            DCD_BODY_CCD | DCD_BODY_NO_SLEEP | DCD_BODY_DISABLED | DCD_BODY_FAST_SPIN | DCD_BODY_NO_GYRO;
        check_bits(self.flags, flags, "flags")?;
        check_bits(self.locked, 63, "locked")?;
        for (value, name) in [
            (self.linear_damping, "linear_damping"),
            (self.angular_damping, "angular_damping"),
            (self.soft_ccd, "soft_ccd"),
            (self.sleep_linear, "sleep_linear"),
            (self.sleep_angular, "sleep_angular"),
            (self.sleep_after, "sleep_after"),
            (self.extra_mass, "extra_mass"),
            (self.extra_inertia[0], "extra_inertia[0]"),
            (self.extra_inertia[1], "extra_inertia[1]"),
            (self.extra_inertia[2], "extra_inertia[2]"),
        ] {
            check_not_negative(value, name)?;
        }
        check_numbers(&[self.gravity_scale], "gravity_scale")?;
        check_numbers(&self.extra_centre, "extra_centre")?;
        if self.extra_mass == 0.0 && (self.extra_centre, self.extra_inertia) != ([0.0; 3], [0.0; 3]) {
            return Err(Failure::argument("extra_centre and extra_inertia need an extra_mass; give it too"));
        }
        if i8::try_from(self.dominance).is_err() {
            return Err(Failure::argument(format!("dominance is {}; give -128 to 127", self.dominance)));
        }
        for (count, name) in [
            (self.extra_solver_iterations, "extra_solver_iterations"),
            (self.extra_pgs_iterations, "extra_pgs_iterations"),
        ] {
            if count > MAX_ITERATIONS {
                return Err(Failure::argument(format!("{name} is {count}; give 0 to {MAX_ITERATIONS}")));
            }
        }
        Ok(())
    }

    /// Returns a builder of a body with these properties, except the thresholds of its sleep, which Rapier's builder does not know.
    pub(crate) fn builder(&self) -> Result<RigidBodyBuilder, Failure> {
        // Rapier's setters are not inlined into this crate, so each would copy the builder.
        let mut builder = RigidBodyBuilder::new(kind_of(self.body_type)?);
        builder.linear_damping = self.linear_damping;
        builder.angular_damping = self.angular_damping;
        builder.gravity_scale = self.gravity_scale;
        builder.dominance_group = self.dominance as i8;
        builder.ccd_enabled = self.has(DCD_BODY_CCD);
        builder.soft_ccd_prediction = self.soft_ccd;
        builder.allow_fast_rotation = self.has(DCD_BODY_FAST_SPIN);
        builder.gyroscopic_forces_enabled = !self.has(DCD_BODY_NO_GYRO);
        builder.can_sleep = !self.has(DCD_BODY_NO_SLEEP);
        builder.enabled = !self.has(DCD_BODY_DISABLED);
        builder.additional_solver_iterations = self.extra_solver_iterations as usize;
        builder.additional_pgs_iterations = self.extra_pgs_iterations as usize;
        builder.user_data = u128::from(self.user_data);
        if self.locked != 0 {
            builder = builder.locked_axes(self.locked_axes());
        }
        Ok(match self.extra_properties(Rotation::IDENTITY) {
            Some(properties) => builder.additional_mass_properties(properties),
            None if self.extra_mass == 0.0 => builder,
            None => builder.additional_mass(self.extra_mass),
        })
    }

    /// Returns what is recorded of a body with these properties, of this kind and with these colliders; its user data is apart. It
    /// is the same as what is recorded of what [`DcdBodyProperties::builder`] builds.
    pub(crate) fn traits(&self, kind: BodyKind, colliders: Vec<ColliderRecord>) -> BodyTraits {
        let [sleep_linear_threshold, sleep_angular_threshold] = self.thresholds();
        BodyTraits {
            kind,
            enabled: !self.has(DCD_BODY_DISABLED),
            linear_damping: self.linear_damping,
            angular_damping: self.angular_damping,
            gravity_scale: self.gravity_scale,
            locked_axes: self.locked_axes().bits(),
            dominance: self.dominance as i8,
            ccd: self.has(DCD_BODY_CCD),
            soft_ccd_m: self.soft_ccd,
            fast_rotation: self.has(DCD_BODY_FAST_SPIN),
            gyroscopic: !self.has(DCD_BODY_NO_GYRO),
            extra_solver_iterations: self.extra_solver_iterations,
            extra_pgs_iterations: self.extra_pgs_iterations,
            sleep_linear_threshold,
            sleep_angular_threshold,
            sleep_after_s: self.sleep_after,
            extra_mass: match self.extra_properties(Rotation::IDENTITY) {
                Some(properties) => Some(ExtraMass::Properties(MassRecord {
                    local_com: properties.local_com.to_array(),
                    inv_mass: properties.inv_mass,
                    inv_principal_inertia: properties.inv_principal_inertia.to_array(),
                    principal_frame: properties.principal_inertia_local_frame.to_array(),
                })),
                None if self.extra_mass == 0.0 => None,
                None => Some(ExtraMass::Mass(self.extra_mass)),
            },
            character: None,
            vehicle: None,
            colliders,
        }
    }

    /// Changes a body from the properties `before` to these. What is as it was is not touched, because Rapier knows more of some of
    /// it than C.
    pub(crate) fn apply(&self, before: &Self, body: &mut RigidBody) {
        if self.body_type != before.body_type
            && let Ok(kind) = kind_of(self.body_type)
        {
            body.set_body_type(kind, true);
        }
        let changed = |bit: u32| (self.flags ^ before.flags) & bit != 0;
        if changed(DCD_BODY_CCD) {
            body.enable_ccd(self.has(DCD_BODY_CCD));
        }
        if changed(DCD_BODY_FAST_SPIN) {
            body.set_allow_fast_rotation(self.has(DCD_BODY_FAST_SPIN));
        }
        if changed(DCD_BODY_NO_GYRO) {
            body.enable_gyroscopic_forces(!self.has(DCD_BODY_NO_GYRO));
        }
        if self.locked != before.locked {
            body.set_locked_axes(self.locked_axes(), true);
        }
        body.set_dominance_group(self.dominance as i8);
        body.set_linear_damping(self.linear_damping);
        body.set_angular_damping(self.angular_damping);
        if self.gravity_scale != before.gravity_scale {
            body.set_gravity_scale(self.gravity_scale, true);
        }
        body.set_soft_ccd_prediction(self.soft_ccd);
        if changed(DCD_BODY_NO_SLEEP) || self.sleep() != before.sleep() {
            self.set_thresholds(body);
        }
        let mass = |own: &Self| (own.extra_mass, own.extra_centre, own.extra_inertia);
        if mass(self) != mass(before) {
            match self.extra_properties(principal_frame(body)) {
                Some(properties) => body.set_additional_mass_properties(properties, true),
                None => body.set_additional_mass(self.extra_mass, true),
            }
        }
        body.set_additional_solver_iterations(self.extra_solver_iterations as usize);
        body.set_additional_pgs_iterations(self.extra_pgs_iterations as usize);
        if self.user_data != before.user_data {
            body.user_data = u128::from(self.user_data);
        }
        if changed(DCD_BODY_DISABLED) {
            body.set_enabled(!self.has(DCD_BODY_DISABLED));
        }
        if (Self { user_data: 0, ..*self }) != (Self { user_data: 0, ..*before }) {
            body.wake_up(true);
        }
    }

    /// Returns the thresholds of sleep: how slow the body must be, and for how long.
    pub(crate) fn sleep(&self) -> [f32; 3] {
        [self.sleep_linear, self.sleep_angular, self.sleep_after]
    }

    pub(crate) fn set_thresholds(&self, body: &mut RigidBody) {
        let activation = body.activation_mut();
        [activation.normalized_linear_threshold, activation.angular_threshold] = self.thresholds();
        activation.time_until_sleep = self.sleep_after;
    }

    /// Returns the thresholds of speed and spin as Rapier has them. A body does not sleep if that of speed is negative. Both are -1,
    /// as Rapier's builder makes them, unless the program has thresholds of its own: then that of speed is turned about.
    fn thresholds(&self) -> [f32; 2] {
        let own = [self.sleep_linear, self.sleep_angular];
        if !self.has(DCD_BODY_NO_SLEEP) {
            own
        } else if own == usual_thresholds() {
            [-1.0; 2]
        } else {
            // Zero turned about would still be zero.
            [-own[0].max(f32::MIN_POSITIVE), own[1]]
        }
    }

    fn has(&self, bit: u32) -> bool {
        self.flags & bit != 0
    }

    fn locked_axes(&self) -> LockedAxes {
        LockedAxes::from_bits_truncate(self.locked as u8)
    }

    /// Returns the extra mass, if it is more than a number. `frame` turns the body's axes to those of its inertia.
    fn extra_properties(&self, frame: Rotation) -> Option<MassProperties> {
        let given = (self.extra_centre, self.extra_inertia) != ([0.0; 3], [0.0; 3]);
        let [centre, inertia] = [self.extra_centre, self.extra_inertia].map(Vector::from_array);
        given.then(|| MassProperties::with_principal_inertia_frame(centre, self.extra_mass, inertia, frame))
    }

    /// Returns an error if a body that has no other mass becomes dynamic, or loses its extra mass.
    fn check_mass(&self, before: &Self, traits: &BodyTraits) -> Result<(), Failure> {
        let weighs = traits.colliders.iter().filter(|collider| collider.enabled).any(|own| match own.mass {
            ColliderMass::Density(value) | ColliderMass::Mass(value) => value > 0.0,
            ColliderMass::Properties(mass) => mass.inv_mass > 0.0,
        });
        let changes = before.body_type != DCD_DYNAMIC || before.extra_mass != 0.0;
        // A fixed or kinematic body may be hollow.
        if changes && self.body_type == DCD_DYNAMIC && self.extra_mass == 0.0 && !weighs {
            return Err(ShapeError::Massless.into());
        }
        Ok(())
    }
}

/// Returns the thresholds of speed and spin that a body has, or would have if it did sleep.
fn thresholds_of(traits: &BodyTraits) -> [f32; 2] {
    let (linear, angular) = (traits.sleep_linear_threshold, traits.sleep_angular_threshold);
    match (linear < 0.0, angular < 0.0) {
        (true, true) => usual_thresholds(),
        (true, false) if linear == -f32::MIN_POSITIVE => [0.0, angular],
        (true, false) => [-linear, angular],
        (false, true) => [linear, RigidBodyActivation::default_angular_threshold()],
        (false, false) => [linear, angular],
    }
}

fn usual_thresholds() -> [f32; 2] {
    [
        RigidBodyActivation::default_normalized_linear_threshold(),
        RigidBodyActivation::default_angular_threshold(),
    ]
}

/// Returns the rotation from a body's axes to those of the inertia of its extra mass: the parts of a model have axes other than the
/// body's own.
fn principal_frame(body: &RigidBody) -> Rotation {
    match body.mass_properties().additional_local_mprops.as_deref() {
        Some(RigidBodyAdditionalMassProps::MassProps(extra)) => extra.principal_inertia_local_frame,
        _ => Rotation::IDENTITY,
    }
}

fn kind_of(body_type: DcdBodyType) -> Result<RigidBodyType, Failure> {
    Ok(match recorded_kind(body_type)? {
        BodyKind::Fixed => RigidBodyType::Fixed,
        BodyKind::Dynamic => RigidBodyType::Dynamic,
        BodyKind::KinematicVelocity => RigidBodyType::KinematicVelocityBased,
        BodyKind::KinematicPosition => RigidBodyType::KinematicPositionBased,
    })
}

pub(crate) fn recorded_kind(body_type: DcdBodyType) -> Result<BodyKind, Failure> {
    Ok(match body_type {
        DCD_FIXED => BodyKind::Fixed,
        DCD_DYNAMIC => BodyKind::Dynamic,
        DCD_KINEMATIC => BodyKind::KinematicVelocity,
        DCD_KINEMATIC_POSE => BodyKind::KinematicPosition,
        other => {
            return Err(Failure::argument(format!(
                "body_type {other} is none; use DCD_FIXED, DCD_DYNAMIC, DCD_KINEMATIC or DCD_KINEMATIC_POSE"
            )));
        }
    })
}

pub(crate) fn type_of(kind: BodyKind) -> DcdBodyType {
    match kind {
        BodyKind::Fixed => DCD_FIXED,
        BodyKind::Dynamic => DCD_DYNAMIC,
        BodyKind::KinematicVelocity => DCD_KINEMATIC,
        BodyKind::KinematicPosition => DCD_KINEMATIC_POSE,
    }
}

/// Reads the properties of a body.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_body_properties(
    world: DcdWorld,
    body: DcdBodyId,
    out: *mut DcdBodyProperties,
) -> DcdStatus {
    guard("dcd_body_properties", || {
        // SAFETY: the caller vouches for `out`.
        let out = unsafe { Out::sized(out, "out")? };
        ask(world, |world| {
            out.write(DcdBodyProperties::of(&read(world, body)?.1));
            Ok(())
        })
    })
}

/// Changes the properties of a body: read them by dcd_body_properties, change members, and give them back. What is as it was stays
/// as it is. If anything but user_data was changed, the body wakes. A body that becomes fixed, or movable, loses the memory of its
/// contacts.
///
/// `properties` is read during the call.
/// Errors:
/// - DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT.
/// - DCD_ERR_ARGUMENT: a member out of range, a link of a multibody that would be fixed, or a dynamic body that would have no mass.
/// - DCD_ERR_UNSUPPORTED: in a served world, except for its server and builders, which change movable bodies and let them be
///   movable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_body_set_properties(
    world: DcdWorld,
    body: DcdBodyId,
    properties: *const DcdBodyProperties,
) -> DcdStatus {
    guard("dcd_body_set_properties", || {
        // SAFETY: the caller vouches for the pointer.
        let after = unsafe { pointer::read_sized(properties, "properties")? };
        with(world, |world| {
            world.dcd.changes_bodies()?;
            let (id, record) = read(world, body)?;
            let before = DcdBodyProperties::of(&record);
            after.check()?;
            after.check_mass(&before, &record.traits)?;
            world.dcd.update(id, |body| after.apply(&before, body)).map_err(Failure::from)
        })
    })
}

fn read(world: &World, body: DcdBodyId) -> Result<(BodyId, BodyRecord), Failure> {
    let id = world.mark.body_id(body)?;
    let record = world.dcd.record(id).ok_or_else(|| missing(world, body))?;
    Ok((id, record))
}
