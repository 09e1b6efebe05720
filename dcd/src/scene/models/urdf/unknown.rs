//! Warns of elements and attributes of links and joints that URDF does not know: they are mostly misspelt.

use roxmltree::Node;

use crate::scene::models::source::elements;
use crate::scene::models::warnings::Warnings;

/// The attributes of elements that are read or have no effect here.
const ATTRIBUTES: [(&str, &str); 19] = [
    ("link", "name type"),
    ("joint", "name type"),
    ("origin", "xyz rpy"),
    ("mass", "value"),
    ("inertia", "ixx ixy ixz iyy iyz izz"),
    ("collision", "name group"),
    ("box", "size"),
    ("cylinder", "radius length"),
    ("capsule", "radius length"),
    ("sphere", "radius"),
    ("mesh", "filename scale"),
    ("parent", "link"),
    ("child", "link"),
    ("axis", "xyz"),
    ("limit", "lower upper effort velocity acceleration deceleration jerk"),
    ("dynamics", "damping friction"),
    ("mimic", "joint multiplier offset"),
    ("calibration", "rising falling reference_position"),
    ("safety_controller", "soft_lower_limit soft_upper_limit k_position k_velocity"),
];
/// The elements of a joint. Those of a link are looked at where they are read.
const IN_JOINTS: [&str; 9] =
    ["origin", "parent", "child", "axis", "limit", "dynamics", "mimic", "calibration", "safety_controller"];

/// Warns of the strangers in a `<link>` or `<joint>` of this name.
pub(super) fn warn(node: Node<'_, '_>, name: &str, warnings: &mut Warnings) {
    if node.has_tag_name("joint") {
        for child in elements(node) {
            let tag = child.tag_name().name();
            if !IN_JOINTS.contains(&tag) {
                warnings.add("element of a joint unknown to URDF", format!("{name} ({tag})"), "is not read");
            }
        }
    }
    attributes(node, name, warnings);
}

fn attributes(node: Node<'_, '_>, name: &str, warnings: &mut Warnings) {
    let tag = node.tag_name().name();
    if let Some((_, known)) = ATTRIBUTES.iter().find(|(element, _)| *element == tag) {
        for attribute in node.attributes() {
            if !known.split_ascii_whitespace().any(|known| known == attribute.name()) {
                let whom = format!("{name} ({tag} {})", attribute.name());
                warnings.add("attribute unknown to URDF", whom, "is not read");
            }
        }
    }
    // Looks, sensors and other simulators' notes have attributes of their own.
    let read = ["inertial", "collision", "geometry"];
    for child in elements(node) {
        let child_tag = child.tag_name().name();
        if read.contains(&child_tag) || ATTRIBUTES.iter().any(|(element, _)| *element == child_tag) {
            attributes(child, name, warnings);
        }
    }
}
