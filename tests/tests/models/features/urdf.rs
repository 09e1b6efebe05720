//! Lists the features of URDF, and the fate of each.

use rapier3d::prelude::*;

use super::Fate::{Carried, Refused, Unused, Warned};
use super::{Row, any, apart, at, ends, joint, limits, mass, motor, near, near3, only, row};

/// Returns a robot of these elements.
fn robot(elements: &str) -> String {
    format!(r#"<robot name="r">{elements}</robot>"#)
}

/// Returns a link of 1 kg with these elements.
fn link(name: &str, elements: &str) -> String {
    format!(
        r#"<link name="{name}"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>{elements}</link>"#
    )
}

/// Returns a robot of one link with this collision geometry.
fn shape(geometry: &str) -> String {
    robot(&link(
        "a",
        &format!(r#"<collision><origin xyz="0 0 1"/><geometry>{geometry}</geometry></collision>"#),
    ))
}

/// Returns a robot of two links with a box each, on a joint of this type with these elements.
fn arm(kind: &str, elements: &str) -> String {
    let cube = r#"<collision><geometry><box size=".2 .2 .2"/></geometry></collision>"#;
    robot(&format!(
        r#"{}{}<joint name="j" type="{kind}"><parent link="a"/><child link="b"/><origin xyz="0 0 1"/>{elements}</joint>"#,
        link("a", cube),
        link("b", cube),
    ))
}

/// Returns a robot with 24 kg in its last link, which has 1 kg.
fn top_heavy(robot: &str) -> String {
    let (before, after) = robot.rsplit_once(r#"<mass value="1"/>"#).expect("links have mass");
    format!(r#"{before}<mass value="24"/>{after}"#)
}

const RANGE: &str = r#"<axis xyz="0 1 0"/><limit lower="-1" upper=".5" effort="1" velocity="1"/>"#;

pub(super) fn rows() -> Vec<Row> {
    let mut rows = links();
    rows.extend(joints());
    rows
}

fn links() -> Vec<Row> {
    vec![
        row("inertial mass, inertia, origin xyz", Carried, robot(r#"<link name="a"><inertial><origin xyz="0 0 1"/><mass value="2"/><inertia ixx="1" ixy=".1" ixz="0" iyy="2" iyz="0" izz="2.5"/></inertial></link>"#), |s| near(mass(s, 0).mass(), 2.0) && near3(mass(s, 0).local_com, [0.0, 0.0, 1.0]) && near(mass(s, 0).reconstruct_inertia_matrix().to_cols_array_2d()[0][1], 0.1)),
        row("inertial origin rpy", Carried, robot(r#"<link name="a"><inertial><origin rpy="0 0 1.5707963"/><mass value="2"/><inertia ixx="1" ixy="0" ixz="0" iyy="2" iyz="0" izz="2.5"/></inertial></link>"#), |s| near(mass(s, 0).reconstruct_inertia_matrix().to_cols_array_2d()[0][0], 2.0)),
        row("inertial without inertia", Warned, robot(r#"<link name="a"><inertial><mass value="2"/></inertial><collision><geometry><cylinder radius=".05" length="1"/></geometry></collision></link>"#), |s| {
            let [[xx, ..], [_, yy, _], [.., zz]] = mass(s, 0).reconstruct_inertia_matrix().to_cols_array_2d();
            near(xx, 0.16792) && near(yy, 0.16792) && (zz - 0.0025).abs() < 1e-5
        }),
        row("inertia that no body can have", Warned, robot(r#"<link name="a"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="5" ixy="3" ixz="0" iyz="0"/></inertial></link>"#), |s| s.warnings[0].starts_with("inertia that no body can have") && mass(s, 0).principal_inertia().min_element() > 0.0),
        row("root without mass", Warned, robot(r#"<link name="a"><collision><geometry><box size="1 1 1"/></geometry></collision></link>"#), |s| s.bodies[0].body.body_type == RigidBodyType::Fixed),
        row("root without mass, fixed to a link that has it (base_inertia)", Carried, robot(&format!(r#"<link name="base">{BALL}</link>{}<joint name="j" type="fixed"><parent link="base"/><child link="a"/><origin xyz="0 0 1"/></joint>"#, link("a", ""))), |s| s.bodies.len() == 1 && s.bodies[0].body.body_type == RigidBodyType::Dynamic && s.bodies[0].colliders.len() == 1 && near(mass(s, 0).mass(), 1.0) && near3(mass(s, 0).local_com, [0.0, 0.0, 1.0])),
        row("link without mass between others", Carried, robot(&format!(r#"{}<link name="f"><collision><geometry><sphere radius=".1"/></geometry></collision></link><joint name="j" type="continuous"><parent link="a"/><child link="f"/></joint>"#, link("a", ""))), |s| near(mass(s, 0).mass() + mass(s, 1).mass(), 1.0) && mass(s, 1).mass() > 0.0),
        row("link without mass beside another robot", Refused, robot(&format!(r#"<link name="world"/><link name="pan"><visual/></link>{}<joint name="j" type="continuous"><parent link="world"/><child link="pan"/></joint><joint name="k" type="continuous"><parent link="world"/><child link="a"/></joint>"#, link("a", ""))), any),
        row("empty links (frames)", Carried, robot(&format!(r#"{}<link name="f"/><joint name="j" type="fixed"><parent link="a"/><child link="f"/></joint>"#, link("a", ""))), |s| s.bodies.len() == 1),
        row("an empty root world welded to the robot", Carried, robot(&format!(r#"<link name="world"/>{}{}<joint name="j" type="fixed"><parent link="world"/><child link="a"/><origin xyz="1 0 2" rpy="0 0 1.5707963"/></joint><joint name="k" type="fixed"><parent link="world"/><child link="b"/><origin xyz="-1 0 2"/></joint>"#, link("a", ""), link("b", ""))), |s| s.bodies.len() == 2 && s.bodies.iter().all(|body| body.body.body_type == RigidBodyType::Fixed) && at(s, 0, [1.0, 0.0, 2.0]) && at(s, 1, [-1.0, 0.0, 2.0]) && near3(Rotation::from_array(s.bodies[0].pose.rotation) * Vector::X, [0.0, 1.0, 0.0])),
        row("an empty root of another name (base_footprint)", Carried, robot(&format!(r#"<link name="base_footprint"/><link name="f"/>{}{}<joint name="i" type="fixed"><parent link="base_footprint"/><child link="f"/><origin rpy="0 0 1.5707963"/></joint><joint name="j" type="fixed"><parent link="f"/><child link="a"/><origin xyz="2 0 0"/></joint><joint name="k" type="revolute"><parent link="a"/><child link="b"/><origin xyz="1 0 0"/>{RANGE}</joint>"#, link("a", ""), link("b", ""))), |s| s.bodies.iter().all(|body| body.body.body_type == RigidBodyType::Dynamic) && at(s, 0, [0.0, 2.0, 0.0]) && at(s, 1, [0.0, 3.0, 0.0])),
        Row { params: "fixed=1", ..row("a root that stays (--set fixed=1)", Carried, shape(r#"<box size="1 1 1"/>"#), |s| s.bodies[0].body.body_type == RigidBodyType::Fixed) },
        row("collision box, sphere", Carried, shape(r#"<box size="1 2 3"/>"#), |s| near3(s.bodies[0].colliders[0].shape.as_cuboid().unwrap().half_extents, [0.5, 1.0, 1.5]) && near(s.bodies[0].colliders[0].position.translation.z, 1.0)),
        row("collision cylinder, capsule", Carried, shape(r#"<cylinder radius=".1" length="2"/>"#), |s| near(s.bodies[0].colliders[0].shape.compute_aabb(&s.bodies[0].colliders[0].position).maxs.z, 2.0)),
        row("collision origin rpy", Carried, shape(r#"<box size="1 2 3"/>"#).replace(r#"xyz="0 0 1""#, r#"rpy="0 0 1.5707963""#), |s| near(s.bodies[0].colliders[0].shape.compute_aabb(&s.bodies[0].colliders[0].position).maxs.x, 1.0)),
        row("mesh obj, stl, with scale", Carried, shape(r#"<mesh filename="cube.obj" scale="2 1 1"/>"#), |s| near(s.bodies[0].colliders[0].shape.mass_properties(1.0).mass(), 2.0)),
        row("mesh dae (Collada)", Carried, shape(r#"<mesh filename="tetra.dae"/>"#), |s| near(s.bodies[0].colliders[0].shape.mass_properties(1.0).mass(), 1.0 / 6.0)),
        row("mesh dae, unit and nodes", Carried, shape(r#"<mesh filename="turned.dae"/>"#), |s| near3(ends(s, 0)[0], [-0.01, 1.0, 1.0]) && near3(ends(s, 0)[1], [0.0, 1.01, 1.01])),
        row("mesh dae, several instances", Carried, shape(r#"<mesh filename="twice.dae"/>"#), |s| s.bodies[0].colliders.len() == 2 && near(ends(s, 0)[0].x, 0.0) && near(ends(s, 1)[0].x, 5.0)),
        row("mesh dae, skew, skeleton, polygons with holes", Refused, shape(r#"<mesh filename="skewed.dae"/>"#), any),
        row("mesh dae, up_axis other than Z_UP", Warned, shape(r#"<mesh filename="y_up.dae"/>"#), any),
        row("mesh of a moving link (its hull)", Carried, shape(r#"<mesh filename="tetra.stl"/>"#), |s| s.bodies[0].colliders[0].shape.as_convex_polyhedron().is_some()),
        Row { params: "fixed=1", ..row("mesh of a fixed link (its triangles)", Carried, shape(r#"<mesh filename="tetra.stl"/>"#), |s| s.bodies[0].colliders[0].shape.as_trimesh().is_some()) },
        row("package://, model://, file://", Carried, shape(r#"<mesh filename="package://pack/meshes/cube.obj"/>"#), |s| near(s.bodies[0].colliders[0].shape.mass_properties(1.0).mass(), 1.0)),
        row("mesh that is missing", Refused, shape(r#"<mesh filename="none.stl"/>"#), any),
        row("mesh of another format", Refused, shape(r#"<mesh filename="cube.fbx"/>"#), any),
        row("a shape of another kind", Refused, shape("<cone/>"), any),
        row("collision without geometry", Warned, shape(""), any),
        row("contact lateral_friction, restitution (Bullet)", Carried, robot(&link("a", r#"<contact><lateral_friction value=".9"/><restitution value=".3"/></contact><collision><geometry><sphere radius="1"/></geometry></collision>"#)), |s| (s.bodies[0].colliders[0].friction, s.bodies[0].colliders[0].restitution) == (0.9, 0.3)),
        row("contact rolling_friction, spinning_friction", Warned, robot(&link("a", r#"<contact><rolling_friction value=".9"/></contact>"#)), any),
        row("contact stiffness, damping", Warned, robot(&link("a", r#"<contact><stiffness value="9"/></contact>"#)), any),
        row("links that overlap at the start", Warned, robot(&format!(r#"{0}{1}{2}<joint name="j" type="continuous"><parent link="a"/><child link="b"/></joint><joint name="k" type="continuous"><parent link="b"/><child link="c"/></joint>"#, link("a", BALL), link("b", BALL), link("c", BALL))), |s| apart(s, 0, 2)),
        row("visual, material", Unused, robot(&format!(r#"<material name="m"/>{}"#, link("a", r#"<visual><geometry><mesh filename="none.dae"/></geometry></visual>"#))), only),
        row("gazebo", Warned, robot(&format!(r#"{}<gazebo reference="a"><mu1>.5</mu1></gazebo>"#, link("a", ""))), any),
        row("transmission, sensor", Unused, robot(&format!("{}<transmission/>", link("a", ""))), only),
        row("xacro", Refused, r#"<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:property name="x" value="1"/></robot>"#.into(), any),
        row("two links of one name", Refused, robot(&(link("a", "") + &link("a", ""))), any),
        row("XML that is none", Refused, "<robot><link></robot>".into(), any),
    ]
}

const BALL: &str = r#"<collision><geometry><sphere radius=".1"/></geometry></collision>"#;

fn joints() -> Vec<Row> {
    vec![
        row("joint revolute, axis, origin", Carried, arm("revolute", RANGE), |s| {
            joint(s, 0).locked_axes == JointAxesMask::LOCKED_REVOLUTE_AXES
                && at(s, 1, [0.0, 0.0, 1.0])
                && near3(joint(s, 0).local_frame1.rotation * Vector::X, [0.0, 1.0, 0.0])
        }),
        row("limit lower, upper", Carried, arm("revolute", RANGE), |s| {
            limits(s, 0, JointAxis::AngX) == Some([-1.0, 0.5])
        }),
        row("joint continuous", Carried, arm("continuous", ""), |s| {
            limits(s, 0, JointAxis::AngX).is_none()
                && joint(s, 0).locked_axes == JointAxesMask::LOCKED_REVOLUTE_AXES
        }),
        row("joint prismatic", Carried, arm("prismatic", RANGE), |s| {
            limits(s, 0, JointAxis::LinX) == Some([-1.0, 0.5])
        }),
        row("joint fixed", Carried, arm("fixed", ""), |s| {
            joint(s, 0).locked_axes == JointAxesMask::LOCKED_FIXED_AXES
        }),
        row("joint fixed, masses 10:1 and more apart", Carried, top_heavy(&arm("fixed", "")), |s| {
            let one = s.bodies.len() == 1 && s.joints.is_empty() && s.bodies[0].colliders.len() == 2;
            let inertia = mass(s, 0).reconstruct_inertia_matrix().to_cols_array_2d();
            one && near3(ends(s, 1)[1], [0.1, 0.1, 1.1])
                && near3(mass(s, 0).local_com, [0.0, 0.0, 0.96])
                && [(mass(s, 0).mass(), 25.0), (inertia[0][0], 2.96), (inertia[2][2], 2.0)]
                    .into_iter()
                    .all(|(found, right)| near(found, right))
        }),
        row(
            "a joint below such a one",
            Carried,
            top_heavy(&arm("fixed", "")).replace(r#"xyz="0 0 1""#, r#"xyz="0 0 1" rpy="0 0 1.5707963""#).replace(
                "</robot>",
                &format!(
                    r#"{}<joint name="k" type="continuous"><parent link="b"/><child link="c"/><origin xyz="2 0 0"/></joint></robot>"#,
                    link("c", "")
                ),
            ),
            |s| {
                (s.bodies.len(), s.joints.len(), s.joints[0].a, s.joints[0].b) == (2, 1, 0, 1)
                    && at(s, 1, [0.0, 2.0, 1.0])
                    && near3(joint(s, 0).local_frame1.translation, [0.0, 2.0, 1.0])
                    && near3(joint(s, 0).local_frame1.rotation * Vector::X, [0.0, 1.0, 0.0])
            },
        ),
        row("joint floating", Carried, arm("floating", ""), |s| joint(s, 0).locked_axes.is_empty()),
        row("joint spherical", Carried, arm("spherical", ""), |s| {
            joint(s, 0).locked_axes == JointAxesMask::LOCKED_SPHERICAL_AXES
        }),
        row("joint planar", Warned, arm("planar", ""), any),
        row("joint of another type", Refused, arm("screw", ""), any),
        row("links that a joint ties do not touch", Carried, arm("continuous", ""), |s| apart(s, 0, 1)),
        row("dynamics damping", Carried, arm("continuous", r#"<dynamics damping="2"/>"#), |s| {
            motor(s, 0, JointAxis::AngX) == Some([0.0, 2.0, 0.0])
        }),
        row("dynamics friction", Carried, arm("continuous", r#"<dynamics friction=".5"/>"#), |s| {
            joint(s, 0).motors[3].max_force == 0.5
        }),
        row("dynamics below 0", Refused, arm("continuous", r#"<dynamics damping="-3"/>"#), any),
        row(
            "dynamics friction beside damping",
            Warned,
            arm("continuous", r#"<dynamics damping="2" friction=".5"/>"#),
            any,
        ),
        Row {
            params: "multibody=1",
            ..row(
                "dynamics friction and damping (--set multibody=1)",
                Carried,
                arm("continuous", r#"<dynamics damping="2" friction=".5"/>"#),
                |s| {
                    let link = s.joints[0].multibody.unwrap();
                    (link.damping.unwrap()[0], link.friction[0]) == (2.0, 0.5)
                },
            )
        },
        row("mimic", Warned, arm("revolute", &format!(r#"{RANGE}<mimic joint="k"/>"#)), any),
        row(
            "limit effort, velocity, safety_controller, calibration",
            Unused,
            arm(
                "revolute",
                &format!(r#"{RANGE}<safety_controller k_velocity="1"/><calibration rising="0"/>"#),
            ),
            |s| s.joints.len() == 1,
        ),
        row("joint without limit", Warned, arm("revolute", ""), |s| limits(s, 0, JointAxis::AngX).is_none()),
        row(
            "limit with lower above upper",
            Warned,
            arm("revolute", r#"<limit lower="1" upper="0"/>"#),
            |s| limits(s, 0, JointAxis::AngX).is_none(),
        ),
        row(
            "limit beyond half a turn",
            Carried,
            arm("revolute", r#"<limit lower="-0.0175" upper="3.7525"/>"#),
            |s| limits(s, 0, JointAxis::AngX) == Some([-0.0175, 3.7525]),
        ),
        row(
            "limit of a whole turn or more",
            Warned,
            arm("revolute", r#"<limit lower="-4" upper="4"/>"#),
            |s| limits(s, 0, JointAxis::AngX).is_none(),
        ),
        Row {
            params: "multibody=1",
            ..row(
                "limit of a whole turn or more (--set multibody=1)",
                Carried,
                arm("revolute", r#"<limit lower="-4" upper="4"/>"#),
                |s| limits(s, 0, JointAxis::AngX) == Some([-4.0, 4.0]),
            )
        },
        row("axis 0 0 0", Refused, arm("continuous", r#"<axis xyz="0 0 0"/>"#), any),
        row(
            "a joint of a link that is missing",
            Refused,
            robot(r#"<joint name="j" type="fixed"><parent link="x"/><child link="y"/></joint>"#),
            any,
        ),
        row(
            "a link with two parents, a loop",
            Refused,
            arm("fixed", "").replace(
                "</robot>",
                r#"<joint name="k" type="fixed"><parent link="b"/><child link="b"/></joint></robot>"#,
            ),
            any,
        ),
        row(
            "an unknown attribute of a link or joint",
            Warned,
            arm("revolute", r#"<limit lowr="-1" upper="1"/>"#),
            |s| s.warnings[0].contains("j (limit lowr)"),
        ),
        row(
            "an unknown element of a link or joint",
            Warned,
            arm("continuous", r#"<axsi xyz="0 0 1"/>"#),
            |s| s.warnings[0].contains("j (axsi)"),
        ),
        row("a number that is none", Refused, arm("continuous", r#"<dynamics damping="1,5"/>"#), any),
    ]
}
