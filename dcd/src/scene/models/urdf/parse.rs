//! Parses the elements of a URDF file, more leniently than urdf-rs, and with the line of each error. Files
//! without `effort`, `velocity` or inertia are common.

use std::collections::{BTreeMap, BTreeSet};
use std::str::FromStr;

use rapier3d_urdf::urdf_rs::{self, Geometry, JointType, Pose, Vec3};
use roxmltree::{Document, Node};

use super::unknown;
use crate::scene::models::model::MAX_BODIES;
use crate::scene::models::source::{Fault, child, elements, required};
use crate::scene::models::warnings::Warnings;

/// The parsed robot for the loader, and the properties that the loader has no place for.
pub(super) struct Parsed {
    pub(super) robot: urdf_rs::Robot,
    /// The surfaces by link.
    pub(super) surfaces: BTreeMap<String, Surface>,
    /// Joints whose limits say that there are none.
    pub(super) unlimited: BTreeSet<String>,
    pub(super) warnings: Warnings,
}

/// The surface of a link, by Bullet's `<contact>`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Surface {
    pub(super) friction: f32,
    pub(super) restitution: f32,
}

impl Default for Surface {
    fn default() -> Self {
        Self { friction: 0.5, restitution: 0.0 }
    }
}

pub(super) fn parse(document: &Document<'_>) -> Result<Parsed, Fault> {
    let root = document.root_element();
    let mut parsed = Parsed {
        robot: urdf_rs::Robot {
            name: root.attribute("name").unwrap_or_default().to_owned(),
            links: Vec::new(),
            joints: Vec::new(),
            materials: Vec::new(),
        },
        surfaces: BTreeMap::new(),
        unlimited: BTreeSet::new(),
        warnings: Warnings::default(),
    };
    for node in elements(root) {
        match node.tag_name().name() {
            _ if node.tag_name().namespace().is_some_and(|space| space.contains("xacro")) => {
                return Err(Fault::at(
                    node,
                    "this is xacro, not URDF",
                    "expand it first (xacro FILE > FILE.urdf)",
                ));
            }
            "link" => parsed.link(node)?,
            "joint" => parsed.joint(node)?,
            // Looks, drives, sensors, other simulators' notes.
            "material" | "transmission" | "sensor" | "version" => {}
            "gazebo" => parsed.gazebo(node),
            "loop_joint" => return Err(Fault::at(node, "<loop_joint> cannot be read", "take it out")),
            name => parsed.warnings.add("element unknown to URDF", name, "is not read"),
        }
    }
    parsed.check(root)?;
    Ok(parsed)
}

impl Parsed {
    fn link(&mut self, node: Node<'_, '_>) -> Result<(), Fault> {
        let name = required(node, "name")?.to_owned();
        unknown::warn(node, &name, &mut self.warnings);
        let mut link = urdf_rs::Link {
            name: name.clone(),
            inertial: urdf_rs::Inertial::default(),
            visual: Vec::new(),
            collision: Vec::new(),
        };
        for child in elements(node) {
            match child.tag_name().name() {
                "inertial" => link.inertial = inertial(child)?,
                // A link with visuals is no mere frame. Nothing else is read of them.
                "visual" => link.visual.push(urdf_rs::Visual::default()),
                "collision" => {
                    if let Some(geometry) = geometry(child, &mut self.warnings, &name)? {
                        let origin = pose(child)?;
                        link.collision.push(urdf_rs::Collision { name: None, origin, geometry });
                    }
                }
                "contact" => self.contact(child, &name)?,
                "sensor" | "self_collision_checking" | "audio_source" => {}
                _ => self.warnings.add(
                    "element of a link unknown to URDF",
                    format!("{name} ({})", child.tag_name().name()),
                    "is not read",
                ),
            }
        }
        if self.robot.links.iter().any(|other| other.name == name) {
            return Err(Fault::at(node, format!("two links are named `{name}`"), "give each its own name"));
        }
        if self.robot.links.len() >= MAX_BODIES {
            let cause = format!("the robot has more than {MAX_BODIES} links");
            return Err(Fault::at(node, cause, "join what does not move by itself into one link"));
        }
        self.robot.links.push(link);
        Ok(())
    }

    fn contact(&mut self, node: Node<'_, '_>, link: &str) -> Result<(), Fault> {
        let mut surface = Surface::default();
        for child in elements(node) {
            match child.tag_name().name() {
                "lateral_friction" => surface.friction = number(child, "value")?.unwrap_or(0.5) as f32,
                "restitution" => surface.restitution = number(child, "value")?.unwrap_or(0.0) as f32,
                "rolling_friction" | "spinning_friction" => {
                    self.warnings.add(
                        "rolling and spinning friction",
                        link,
                        "links only slide with friction",
                    );
                }
                "stiffness" | "damping" | "contact_cfm" | "contact_erp" => {
                    self.warnings.add("softness of contacts", link, "contacts are hard");
                }
                "inertia_scaling" => {
                    if number(child, "value")?.is_some_and(|scale| scale != 1.0) {
                        self.warnings.add("inertia_scaling", link, "has no effect");
                    }
                }
                name => self.warnings.add(
                    "element of a link unknown to URDF",
                    format!("{link} ({name})"),
                    "is not read",
                ),
            }
        }
        self.surfaces.insert(link.to_owned(), surface);
        Ok(())
    }

    fn gazebo(&mut self, node: Node<'_, '_>) {
        let physical = ["mu1", "mu2", "kp", "kd", "gravity", "selfCollide", "turnGravityOff", "plugin"];
        for child in elements(node).filter(|child| physical.contains(&child.tag_name().name())) {
            let of = node.attribute("reference").unwrap_or("the robot");
            self.warnings.add("gazebo", format!("{of} ({})", child.tag_name().name()), "has no effect");
        }
    }

    fn joint(&mut self, node: Node<'_, '_>) -> Result<(), Fault> {
        let name = required(node, "name")?.to_owned();
        unknown::warn(node, &name, &mut self.warnings);
        let joint_type = match required(node, "type")? {
            "revolute" => JointType::Revolute,
            "continuous" => JointType::Continuous,
            "prismatic" => JointType::Prismatic,
            "fixed" => JointType::Fixed,
            "floating" => JointType::Floating,
            "planar" => {
                self.warnings.add("planar joint", &*name, "moves in its plane and does not turn");
                JointType::Planar
            }
            "spherical" => JointType::Spherical,
            other => {
                let cause = format!("joint `{name}` is of type `{other}`");
                return Err(Fault::at(
                    node,
                    cause,
                    "use revolute, continuous, prismatic, fixed, floating, planar or spherical",
                ));
            }
        };
        let link = |which: &str| {
            let child = child(node, which).ok_or_else(|| {
                Fault::at(
                    node,
                    format!("joint `{name}` has no <{which}>"),
                    format!("add <{which} link=\"..\"/>"),
                )
            })?;
            required(child, "link").map(|link| urdf_rs::LinkName { link: link.to_owned() })
        };
        let (parent, below) = (link("parent")?, link("child")?);
        let axis = child(node, "axis")
            .map_or(Ok(None), |axis| vector(axis, "xyz"))?
            .map_or([1.0, 0.0, 0.0], |xyz| xyz);
        if axis == [0.0; 3]
            && !matches!(joint_type, JointType::Fixed | JointType::Floating | JointType::Spherical)
        {
            return Err(Fault::at(
                node,
                format!("the axis of joint `{name}` is 0 0 0"),
                "give it a direction",
            ));
        }
        let limit = self.limit(node, &name, &joint_type)?;
        let dynamics = child(node, "dynamics").map(|dynamics| {
            let of = |what| {
                let value = number(dynamics, what)?.unwrap_or(0.0);
                let fault = || {
                    Fault::at(dynamics, format!("joint `{name}` has a {what} of {value}"), "give it from 0")
                };
                if value < 0.0 { Err(fault()) } else { Ok(value) }
            };
            Ok(urdf_rs::Dynamics { damping: of("damping")?, friction: of("friction")? })
        });
        if child(node, "mimic").is_some() {
            self.warnings.add("mimic", &*name, "moves freely: impulse joints do not know it");
        }
        self.robot.joints.push(urdf_rs::Joint {
            name,
            joint_type,
            origin: pose(node)?,
            parent,
            child: below,
            axis: urdf_rs::Axis { xyz: Vec3(axis) },
            limit,
            calibration: None,
            dynamics: dynamics.transpose()?,
            mimic: None,
            safety_controller: None,
        });
        Ok(())
    }

    fn limit(
        &mut self,
        node: Node<'_, '_>,
        name: &str,
        kind: &JointType,
    ) -> Result<urdf_rs::JointLimit, Fault> {
        let mut limit = urdf_rs::JointLimit::default();
        let Some(given) = child(node, "limit") else {
            if matches!(kind, JointType::Revolute | JointType::Prismatic) {
                self.warnings.add("joint without limit", name, "is not limited");
                self.unlimited.insert(name.to_owned());
            }
            return Ok(limit);
        };
        limit.lower = number(given, "lower")?.unwrap_or(0.0);
        limit.upper = number(given, "upper")?.unwrap_or(0.0);
        if limit.lower > limit.upper && matches!(kind, JointType::Revolute | JointType::Prismatic) {
            self.warnings.add("limit with lower above upper", name, "is not limited, as Bullet has it");
            self.unlimited.insert(name.to_owned());
        }
        Ok(limit)
    }

    /// Checks that every joint ties two links that are there, and that no link has two parents.
    fn check(&self, root: Node<'_, '_>) -> Result<(), Fault> {
        let mut parents = BTreeMap::new();
        for joint in &self.robot.joints {
            for link in [&joint.parent.link, &joint.child.link] {
                if self.robot.links.iter().all(|known| known.name != *link) {
                    let cause = format!("joint `{}` names link `{link}`, which is not there", joint.name);
                    return Err(Fault::at(root, cause, "correct the name, or add the link"));
                }
            }
            if parents.insert(&joint.child.link, &joint.parent.link).is_some() {
                let cause = format!("link `{}` has two parents: URDF is a tree", joint.child.link);
                return Err(Fault::at(root, cause, "take one of the joints out"));
            }
        }
        // Each link is visited once, on the way up from the first link that is below it.
        let mut seen = BTreeMap::new();
        for start in parents.keys() {
            let mut at = start;
            while let Some(above) = parents.get(at) {
                match seen.insert(at, start) {
                    Some(by) if by == start => {
                        let cause = format!("link `{start}` is above itself: URDF is a tree");
                        return Err(Fault::at(root, cause, "take one of the joints out"));
                    }
                    Some(_) => break,
                    None => at = above,
                }
            }
        }
        Ok(())
    }
}

fn inertial(node: Node<'_, '_>) -> Result<urdf_rs::Inertial, Fault> {
    let mass = child(node, "mass").map_or(Ok(None), |mass| number(mass, "value"))?.unwrap_or(0.0);
    let mut inertia = urdf_rs::Inertia::default();
    if let Some(given) = child(node, "inertia") {
        let of = |what| number(given, what).map(|value| value.unwrap_or(0.0));
        inertia = urdf_rs::Inertia {
            ixx: of("ixx")?,
            ixy: of("ixy")?,
            ixz: of("ixz")?,
            iyy: of("iyy")?,
            iyz: of("iyz")?,
            izz: of("izz")?,
        };
    }
    if mass < 0.0 {
        return Err(Fault::at(node, format!("a mass of {mass}"), "give kilograms, from 0"));
    }
    Ok(urdf_rs::Inertial { origin: pose(node)?, mass: urdf_rs::Mass { value: mass }, inertia })
}

/// Returns the geometry; `None` for an empty `<geometry>`, which some exporters write.
fn geometry(collision: Node<'_, '_>, warnings: &mut Warnings, link: &str) -> Result<Option<Geometry>, Fault> {
    let Some(shape) = child(collision, "geometry").and_then(|geometry| elements(geometry).next()) else {
        warnings.add("collision without geometry", link, "touches nothing");
        return Ok(None);
    };
    let size = |what: &str| {
        let value = number(shape, what)?.filter(|value| *value > 0.0);
        value.ok_or_else(|| {
            Fault::at(shape, format!("a shape of link `{link}` has no {what}"), "give it, above 0")
        })
    };
    Ok(Some(match shape.tag_name().name() {
        "box" => {
            let size = vector(shape, "size")?.filter(|size| size.iter().all(|v| *v > 0.0));
            let none = || {
                Fault::at(shape, format!("a box of link `{link}` has no size"), "give three numbers above 0")
            };
            Geometry::Box { size: Vec3(size.ok_or_else(none)?) }
        }
        "cylinder" => Geometry::Cylinder { radius: size("radius")?, length: size("length")? },
        "capsule" => Geometry::Capsule { radius: size("radius")?, length: size("length")? },
        "sphere" => Geometry::Sphere { radius: size("radius")? },
        "mesh" => Geometry::Mesh {
            filename: required(shape, "filename")?.to_owned(),
            scale: vector(shape, "scale")?.map(Vec3),
        },
        other => {
            let cause = format!("a shape of link `{link}` is a `{other}`");
            return Err(Fault::at(shape, cause, "use a box, cylinder, capsule, sphere or mesh"));
        }
    }))
}

fn pose(node: Node<'_, '_>) -> Result<Pose, Fault> {
    let Some(origin) = child(node, "origin") else { return Ok(Pose::default()) };
    let of = |what| vector(origin, what).map(|value| Vec3(value.unwrap_or_default()));
    Ok(Pose { xyz: of("xyz")?, rpy: of("rpy")? })
}

fn number(node: Node<'_, '_>, attribute: &str) -> Result<Option<f64>, Fault> {
    node.attribute(attribute).map(|text| finite(text.trim(), node, attribute)).transpose()
}

fn vector(node: Node<'_, '_>, attribute: &str) -> Result<Option<[f64; 3]>, Fault> {
    let Some(text) = node.attribute(attribute) else { return Ok(None) };
    let numbers =
        text.split_whitespace().map(|word| finite(word, node, attribute)).collect::<Result<Vec<_>, _>>()?;
    let count = numbers.len();
    let numbers = <[f64; 3]>::try_from(numbers);
    let wrong = |_| Fault::at(node, format!("{attribute}=\"{text}\" has {count} numbers"), "give three");
    numbers.map(Some).map_err(wrong)
}

fn finite(text: &str, node: Node<'_, '_>, attribute: &str) -> Result<f64, Fault> {
    f64::from_str(text).ok().filter(|value| value.is_finite()).ok_or_else(|| {
        Fault::at(node, format!("{attribute}: `{text}` is not a finite number"), "write a decimal number")
    })
}
