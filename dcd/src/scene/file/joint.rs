//! Reads the table `[[joint]]` of scene files.

use rapier3d::prelude::*;
use serde::Deserialize;

use super::Names;
use super::numbers::{Direction, Finite, NonNegative, Positive, vector};
use super::source::Fault;
use crate::physics::LinkSettings;
use crate::protocol::WorldPose;
use crate::scene::{SceneBody, SceneJoint};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct JointDef {
    kind: Kind,
    a: BodyRef,
    b: BodyRef,
    anchor_a: Option<[Finite; 3]>,
    anchor_b: Option<[Finite; 3]>,
    axis: Option<Direction>,
    limits: Option<[Finite; 2]>,
    motor: Option<MotorDef>,
    length: Option<Positive>,
    stiffness: Option<NonNegative>,
    damping: Option<NonNegative>,
    contacts: Option<bool>,
    enabled: Option<bool>,
    softness: Option<SoftnessDef>,
    user_data: Option<u64>,
    #[serde(default)]
    multibody: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Kind {
    Fixed,
    Revolute,
    Prismatic,
    Spherical,
    Rope,
    Spring,
}

/// A reference to a body by its place in the list or by its name.
#[derive(Debug, Deserialize)]
#[serde(untagged, expecting = "a body is named by a string or by its index, a whole number from 0")]
enum BodyRef {
    Index(usize),
    Name(String),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct MotorDef {
    velocity: Option<Finite>,
    position: Option<Finite>,
    stiffness: Option<NonNegative>,
    damping: Option<NonNegative>,
    max_force: Option<NonNegative>,
    #[serde(default)]
    model: Model,
}

#[derive(Clone, Copy, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Model {
    #[default]
    Acceleration,
    Force,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SoftnessDef {
    frequency: Positive,
    damping_ratio: NonNegative,
}

impl JointDef {
    pub(super) fn build(&self, bodies: &[SceneBody], names: &Names) -> Result<SceneJoint, Fault> {
        self.refuse_keys_of_other_kinds()?;
        let (a, b) = (self.a.index(bodies.len(), names)?, self.b.index(bodies.len(), names)?);
        if a == b {
            return Err(Fault::new("a joint ties a body to itself", "name two bodies"));
        }
        let mut joint = self.degrees_of_freedom()?;
        let (frame_a, frame_b) = self.frames(&bodies[a].pose, &bodies[b].pose);
        joint.set_local_frame1(frame_a).set_local_frame2(frame_b);
        joint.set_contacts_enabled(self.contacts.unwrap_or(true));
        joint.set_enabled(self.enabled.unwrap_or(true));
        if let Some(SoftnessDef { frequency, damping_ratio }) = &self.softness {
            joint.softness = SpringCoefficients::new(frequency.0, damping_ratio.0);
        }
        if self.multibody && matches!(self.kind, Kind::Rope | Kind::Spring) {
            return Err(Fault::new(
                "ropes and springs are no joints of a multibody",
                "leave `multibody` out: impulses tie them",
            ));
        }
        joint.user_data = self.user_data.map_or(0, u128::from);
        Ok(SceneJoint { a, b, joint, multibody: self.multibody.then(LinkSettings::default) })
    }

    fn degrees_of_freedom(&self) -> Result<GenericJoint, Fault> {
        let mut joint = match self.kind {
            Kind::Fixed => GenericJoint::new(JointAxesMask::LOCKED_FIXED_AXES),
            Kind::Revolute => GenericJoint::new(JointAxesMask::LOCKED_REVOLUTE_AXES),
            Kind::Prismatic => GenericJoint::new(JointAxesMask::LOCKED_PRISMATIC_AXES),
            Kind::Spherical => GenericJoint::new(JointAxesMask::LOCKED_SPHERICAL_AXES),
            Kind::Rope => RopeJoint::new(self.need("length", self.length)?.0).into(),
            Kind::Spring => SpringJoint::new(
                self.need("length", self.length)?.0,
                self.need("stiffness", self.stiffness)?.0,
                self.damping.map_or(0.0, |damping| damping.0),
            )
            .into(),
        };
        let free = if self.kind == Kind::Prismatic { JointAxis::LinX } else { JointAxis::AngX };
        if let Some([least, most]) = self.limits.map(|limits| limits.map(|v| v.0)) {
            if least > most {
                return Err(Fault::new(
                    format!("limits {least} to {most} hold nothing"),
                    "give the smaller first",
                ));
            }
            joint.set_limits(free, [least, most]);
        }
        if let Some(motor) = &self.motor {
            motor.apply(&mut joint, free);
        }
        Ok(joint)
    }

    /// Returns the joint's frames on both bodies. If the anchor on `b` is not given, it follows from where
    /// the bodies start: joints hold the pose they start in. Ropes and springs pull at the origin of `b`
    /// instead.
    fn frames(&self, a: &WorldPose, b: &WorldPose) -> (Pose, Pose) {
        let turn = |pose: &WorldPose| Rotation::from_array(pose.rotation);
        let along =
            self.axis.map_or(Rotation::IDENTITY, |axis| Rotation::from_rotation_arc(Vector::X, axis.0));
        let anchor_a = self.anchor_a.map_or(Vector::ZERO, vector);
        // The difference is taken in f64: far from the origin f32 would lose it.
        let apart = Vector::from(std::array::from_fn(|i| (a.translation[i] - b.translation[i]) as f32));
        let start_b = turn(b).inverse() * (apart + turn(a) * anchor_a);
        let follows = !matches!(self.kind, Kind::Rope | Kind::Spring);
        let anchor_b = self.anchor_b.map_or(if follows { start_b } else { Vector::ZERO }, vector);
        (Pose::from_parts(anchor_a, along), Pose::from_parts(anchor_b, turn(b).inverse() * turn(a) * along))
    }

    fn need<T>(&self, key: &str, value: Option<T>) -> Result<T, Fault> {
        value.ok_or_else(|| self.fault(format!("lacks `{key}`")))
    }

    fn refuse_keys_of_other_kinds(&self) -> Result<(), Fault> {
        let given = [
            ("axis", self.axis.is_some()),
            ("limits", self.limits.is_some()),
            ("motor", self.motor.is_some()),
            ("length", self.length.is_some()),
            ("stiffness", self.stiffness.is_some()),
            ("damping", self.damping.is_some()),
        ];
        match given.iter().find(|(key, given)| *given && !self.kind.keys().contains(key)) {
            None => Ok(()),
            Some((key, _)) => Err(self.fault(format!("has no `{key}`"))),
        }
    }

    fn fault(&self, what: String) -> Fault {
        let keys = [&["a", "b", "anchor_a", "anchor_b"], self.kind.keys()].concat().join(", ");
        let multibody = if matches!(self.kind, Kind::Rope | Kind::Spring) { "" } else { ", multibody" };
        Fault::new(
            format!("a joint of kind `{}` {what}", self.kind.name()),
            format!("it takes {keys}, and contacts, enabled, softness, user_data{multibody}"),
        )
    }
}

impl Kind {
    fn keys(self) -> &'static [&'static str] {
        match self {
            Self::Fixed | Self::Spherical => &[],
            Self::Revolute | Self::Prismatic => &["axis", "limits", "motor"],
            Self::Rope => &["length"],
            Self::Spring => &["length", "stiffness", "damping"],
        }
    }

    fn name(self) -> String {
        format!("{self:?}").to_lowercase()
    }
}

impl BodyRef {
    fn index(&self, bodies: usize, names: &Names) -> Result<usize, Fault> {
        match self {
            Self::Index(index) if *index < bodies => Ok(*index),
            Self::Index(index) => Err(Fault::new(
                format!("a joint names body {index}, but there are {bodies} bodies"),
                "count from 0: the library's bodies first, then [[body]], then [[grid]]",
            )),
            Self::Name(name) => names.index(name).ok_or_else(|| {
                Fault::new(
                    format!("a joint names body `{name}`, which does not exist"),
                    "give a body this `name` (copies of a grid are `name[0]`, `name[1]` …)",
                )
            }),
        }
    }
}

impl MotorDef {
    fn apply(&self, joint: &mut GenericJoint, axis: JointAxis) {
        joint.set_motor_model(
            axis,
            match self.model {
                Model::Acceleration => MotorModel::AccelerationBased,
                Model::Force => MotorModel::ForceBased,
            },
        );
        joint.set_motor(
            axis,
            self.position.map_or(0.0, |v| v.0),
            self.velocity.map_or(0.0, |v| v.0),
            self.stiffness.map_or(0.0, |v| v.0),
            self.damping.map_or(1.0, |v| v.0),
        );
        if let Some(max_force) = self.max_force {
            joint.set_motor_max_force(axis, max_force.0);
        }
    }
}
