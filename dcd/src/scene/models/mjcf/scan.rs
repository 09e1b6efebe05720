//! Finds elements of MJCF that Rapier's reader would ignore silently. Each is refused, warned of, or known to
//! have no effect here.

use std::collections::BTreeSet;
use std::path::Path;

use roxmltree::{Document, Node};

use super::classes::{Classes, attribute};
use crate::scene::models::source::{Fault, Source, elements};
use crate::scene::models::warnings::Warnings;

/// Settings that are applied here though the reader ignores them: switches of `<option><flag>`, and more.
pub(super) struct Flags {
    /// The names of the meshes that are to weigh as their hulls.
    pub(super) convex: BTreeSet<String>,
    /// The names that bodies of attached models have here, including bodies that are not attached with the
    /// one that is.
    pub(super) attached: BTreeSet<String>,
    pub(super) contact: bool,
    pub(super) gravity: bool,
    pub(super) filter_parent: bool,
}

/// Sections that are checked elsewhere or have no effect on motion.
const SECTIONS: [&str; 16] = [
    "compiler",
    "option",
    "size",
    "statistic",
    "visual",
    "custom",
    "default",
    "asset",
    "worldbody",
    "contact",
    "equality",
    "tendon",
    "actuator",
    "sensor",
    "keyframe",
    "extension",
];
/// Elements that may stand in a body.
const IN_BODIES: [&str; 10] =
    ["body", "frame", "geom", "joint", "freejoint", "inertial", "site", "camera", "light", "attach"];
/// Switches of `<flag>` that change only how MuJoCo computes.
const HARMLESS_FLAGS: [&str; 13] = [
    "energy",
    "fwdinv",
    "invdiscrete",
    "sensornoise",
    "multiccd",
    "island",
    "warmstart",
    "nativeccd",
    "autoreset",
    "midphase",
    "sensor",
    "refsafe",
    "eulerdamp",
];
/// Attributes that hold the name of something. Some exist with 1 or 2 at the end too.
const NAMES: [&str; 17] = [
    "name",
    "class",
    "childclass",
    "model",
    "prefix",
    "body",
    "joint",
    "geom",
    "site",
    "tendon",
    "mesh",
    "hfield",
    "material",
    "texture",
    "objname",
    "refname",
    "target",
];
/// Attributes that the reader ignores: element, attribute, the value without effect, the feature as warnings
/// call it, and the consequence of another value.
const ATTRIBUTES: [(&str, &str, &str, &str, &str); 18] = [
    ("option", "density", "0", "fluid (option density)", "there is no fluid here"),
    ("option", "viscosity", "0", "fluid (option viscosity)", "there is no fluid here"),
    ("option", "wind", "0 0 0", "fluid (option wind)", "there is no fluid here"),
    ("compiler", "inertiagrouprange", "0 5", "compiler inertiagrouprange", "geoms of all groups have mass"),
    ("geom", "shellinertia", "false", "geom shellinertia", "the geom is solid"),
    (
        "joint",
        "actuatorfrcrange",
        "0 0",
        "joint actuatorfrcrange",
        "not limited; actuators' own forcerange is",
    ),
    ("joint", "actuatorgravcomp", "false", "joint actuatorgravcomp", "has no effect"),
    ("position", "dampratio", "0", "actuator dampratio", "has no effect; kv has"),
    ("position", "inheritrange", "0", "actuator inheritrange", "has no effect; ctrlrange has"),
    ("position", "timeconst", "0", "actuator timeconst", "acts at once"),
    ("general", "dyntype", "none", "actuator dyntype", "acts at once"),
    ("general", "actearly", "false", "actuator actearly", "has no effect"),
    ("mesh", "refpos", "0 0 0", "mesh refpos", "the mesh stays where its vertices say"),
    ("mesh", "refquat", "1 0 0 0", "mesh refquat", "the mesh stays where its vertices say"),
    ("geom", "fluidshape", "none", "fluid (geom fluidshape)", "there is no fluid here"),
    ("body", "sleep", "auto", "body sleep", "the parameter `sleep` says so for all bodies"),
    ("geom", "priority", "0", "geom priority", "the larger friction counts"),
    ("compiler", "fitaabb", "false", "compiler fitaabb", "has no effect"),
];

/// The attributes of elements of bodies in MuJoCo 3, but for user data. Its reader refuses others.
const KNOWN: [(&str, &str); 5] = [
    ("body", "name childclass pos quat axisangle xyaxes zaxis euler mocap gravcomp sleep user"),
    ("inertial", "pos quat axisangle xyaxes zaxis euler mass diaginertia fullinertia"),
    ("freejoint", "name group align"),
    (
        "joint",
        "name class type group pos axis springdamper limited actuatorfrclimited solreflimit solimplimit solreffriction \
         solimpfriction stiffness range actuatorfrcrange actuatorgravcomp margin ref springref springyield armature \
         damping frictionloss user",
    ),
    (
        "geom",
        "name class type contype conaffinity condim group priority size material friction mass density shellinertia \
         solmix solref solimp margin gap fromto pos quat axisangle xyaxes zaxis euler hfield mesh fitscale rgba \
         fluidshape fluidcoef adhesion surfacevel castshadow user",
    ),
];

/// Refuses a file if the scene would lack something that it describes, and warns of differences.
pub(super) fn check(
    source: &Source,
    document: &Document<'_>,
    warnings: &mut Warnings,
) -> Result<Flags, Fault> {
    values(document)?;
    for section in elements(document.root_element()) {
        let name = section.tag_name().name();
        if !SECTIONS.contains(&name) {
            return Err(unknown(section, "the model"));
        }
        match name {
            "worldbody" => bodies(source, section)?,
            "tendon" => {
                for tendon in elements(section) {
                    let how = "has no effect: impulse joints do not know tendons";
                    warnings.add("tendon", source.named(tendon), how);
                }
            }
            "extension" => {
                for plugin in elements(section) {
                    warnings.add("plugin", source.named(plugin), "has no effect");
                }
            }
            _ => {}
        }
    }
    for &(element, attribute, neutral, what, how) in &ATTRIBUTES {
        for node in document.descendants().filter(|node| node.has_tag_name(element)) {
            // The same names also stand for other things: the mesh of a geom, the joint of a tendon or an
            // equality.
            if node
                .attribute(attribute)
                .is_some_and(|value| value.split_whitespace().ne(neutral.split_whitespace()))
            {
                warnings.add(what, source.named(node), how);
            }
        }
    }
    strangers(source, document, warnings);
    flags(document, warnings)
}

/// Warns of attributes that no reader knows, in bodies and their classes. They are mostly misspelt.
fn strangers(source: &Source, document: &Document<'_>, warnings: &mut Warnings) {
    for node in document.descendants().filter(|node| node.is_element()) {
        // The same elements stand for other things in other places.
        let place = ["body", "frame", "worldbody", "default"];
        let in_body = node.parent().is_some_and(|parent| place.contains(&parent.tag_name().name()));
        let known = KNOWN.iter().find(|(element, _)| in_body && node.has_tag_name(*element));
        let Some((_, known)) = known else { continue };
        for attribute in node.attributes() {
            if !known.split_ascii_whitespace().any(|name| name == attribute.name()) {
                let whom = format!("{} ({})", source.named(node), attribute.name());
                warnings.add("attribute unknown to MJCF", whom, "is not read");
            }
        }
    }
}

/// Refuses values that the reader accepts although nothing can be computed with them.
fn values(document: &Document<'_>) -> Result<(), Fault> {
    for node in document.descendants() {
        for attribute in node.attributes().filter(|attribute| !is_name(attribute.name())) {
            let (name, value) = (attribute.name(), attribute.value());
            let numbers: Result<Vec<f64>, _> = value.split_ascii_whitespace().map(str::parse).collect();
            if numbers.is_ok_and(|numbers| numbers.iter().any(|number| !number.is_finite())) {
                let cause = format!("{name}=\"{value}\" is not finite");
                return Err(Fault::at(node, cause, "write decimal numbers"));
            }
            let zeros = || value.split_ascii_whitespace().all(|word| word.parse() == Ok(0.0));
            if name == "quat" && !value.trim().is_empty() && zeros() {
                let cause = format!("quat=\"{value}\" is no rotation");
                return Err(Fault::at(node, cause, "write 1 0 0 0, or leave it out"));
            }
            let sequence = value.len() == 3 && value.chars().all(|axis| "xyzXYZ".contains(axis));
            if name == "eulerseq" && !sequence {
                let cause = format!("eulerseq=\"{value}\" is not three axes");
                return Err(Fault::at(node, cause, "write three of x, y, z, X, Y and Z"));
            }
        }
    }
    Ok(())
}

/// Returns whether an attribute holds a name, which may be `nan` or `inf`.
fn is_name(attribute: &str) -> bool {
    NAMES.contains(&attribute.trim_end_matches(['1', '2']))
}

fn bodies(source: &Source, parent: Node<'_, '_>) -> Result<(), Fault> {
    let in_frame = parent.has_tag_name("frame");
    for node in elements(parent) {
        let name = node.tag_name().name();
        if !IN_BODIES.contains(&name) {
            return Err(unknown(node, "a body"));
        }
        if in_frame
            && (["joint", "freejoint", "inertial", "attach"].contains(&name) || node.has_attribute("fromto"))
        {
            let what = if node.has_attribute("fromto") { "fromto of a geom" } else { name };
            let cause = format!("`{what}` in a <frame> cannot be read");
            return Err(Fault::at(node, cause, "write it without the frame, in the body's own axes"));
        }
        if name == "geom" && node.has_attribute("mesh") && node.attribute("type").is_some_and(|t| t != "mesh")
        {
            let name = source.named(node);
            let cause = format!("`{name}` is a primitive fitted to a mesh, which cannot be computed");
            return Err(Fault::at(node, cause, "give type=\"mesh\", or the primitive's own size"));
        }
        bodies(source, node)?;
    }
    Ok(())
}

fn flags(document: &Document<'_>, warnings: &mut Warnings) -> Result<Flags, Fault> {
    let classes = Classes::of(document, "mesh");
    let is_convex = |mesh: &Node<'_, '_>| {
        let own = attribute(*mesh, &["inertia"]).or_else(|| classes.inherited(*mesh, &["inertia"]));
        own.is_some_and(|inertia| inertia.value() == "convex")
    };
    let meshes = document.descendants().filter(|node| node.has_tag_name("mesh"));
    let convex = meshes.filter(is_convex).filter_map(|node| {
        let file = node.attribute("file").and_then(|file| Path::new(file).file_stem()?.to_str());
        node.attribute("name").or(file).map(str::to_owned)
    });
    let mut flags = Flags {
        convex: convex.collect(),
        attached: BTreeSet::new(),
        contact: true,
        gravity: true,
        filter_parent: true,
    };
    for option in document.descendants().filter(|node| node.has_tag_name("option")) {
        if option.attribute("collision").is_some_and(|value| value == "predefined") {
            let cause = "only predefined pairs of geoms would touch (option collision)";
            return Err(Fault::at(option, cause, "let contype and conaffinity say what touches"));
        }
        for flag in elements(option).filter(|node| node.has_tag_name("flag")) {
            for attribute in flag.attributes() {
                let on = attribute.value() == "enable";
                match attribute.name() {
                    "contact" => flags.contact = on,
                    "gravity" => flags.gravity = on,
                    "filterparent" => flags.filter_parent = on,
                    "override" if !on => {}
                    name if on && name != "override" || HARMLESS_FLAGS.contains(&name) => {}
                    name => warnings.add("flag", name, "is not followed"),
                }
            }
        }
    }
    Ok(flags)
}

fn unknown(node: Node<'_, '_>, place: &str) -> Fault {
    let name = node.tag_name().name();
    let cause = format!("<{name}> in {place} is nothing that a dcd world can have");
    let remedy = match name {
        "replicate" => "write the copies out (MuJoCo does, when it saves a compiled model as XML)",
        "composite" | "flexcomp" | "flex" | "deformable" | "skin" => "take soft bodies out of the file",
        _ => "take it out (dcd/scenes/models/README.md says what is read)",
    };
    Fault::at(node, cause, remedy)
}
