//! Lists the features of MJCF, and the fate of each.

use dcd::scene::Scene;
use rapier3d::prelude::*;

use super::Fate::{Carried, Refused, Unused, Warned};
use super::{Row, any, apart, at, ends, joint, limits, mass, motor, near, near3, only, row};

/// Returns a file with a world of these bodies.
fn world(bodies: &str) -> String {
    format!("<mujoco><worldbody>{bodies}</worldbody></mujoco>")
}

/// Returns a file with one free ball, and these sections.
fn ball(sections: &str) -> String {
    format!(
        r#"<mujoco>{sections}<worldbody><body name="b"><freejoint/><geom size=".1"/></body></worldbody></mujoco>"#
    )
}

/// Returns a file with a ball on a joint with these attributes, as body 1 after the world, and these
/// sections.
fn arm(attributes: &str, sections: &str) -> String {
    format!(
        r#"<mujoco>{sections}<worldbody><body name="b" pos="0 0 1"><joint name="j" {attributes}/>
        <geom name="g" pos=".5 0 0" size=".1"/></body></worldbody></mujoco>"#
    )
}

/// Returns a file with a fixed body to which a body of another file is attached.
fn attach(file: &str, body: &str) -> String {
    format!(
        r#"<mujoco><asset><model name="m" file="{file}"/></asset><worldbody><body pos="0 0 5"><attach model="m" body="{body}" prefix="p"/></body></worldbody></mujoco>"#
    )
}

/// Returns a file with three geoms that set position or orientation, and take the rest from their classes.
fn classes() -> String {
    let classes = r#"<default>
        <default class="wheel"><geom type="cylinder" size=".1 .02" zaxis="0 1 0"/><default class="high"><geom pos="0 0 1"/></default></default>
        <default class="foot"><geom type="box" size=".1 .2 .3" pos="1 0 0"/></default></default>"#;
    let body = r#"<body childclass="high"><freejoint/><geom class="wheel" pos=".2 .3 0"/><geom class="foot" euler="0 0 90"/><geom/></body>"#;
    format!("<mujoco>{classes}<worldbody>{body}</worldbody></mujoco>")
}

/// Returns a file with a free body of this geom.
fn geom(attributes: &str) -> String {
    world(&format!(r#"<body name="b"><freejoint/><geom name="g" {attributes}/></body>"#))
}

fn actuator(element: &str) -> String {
    arm("", &format!("<actuator>{element}</actuator>"))
}

fn shape(scene: &Scene) -> &SharedShape {
    &scene.bodies[0].colliders[0].shape
}

fn hinge(scene: &Scene) -> Option<[f32; 3]> {
    motor(scene, 0, JointAxis::AngX)
}

const TWO: &str = r#"<body name="a" pos="0 0 1"><freejoint/><geom size=".1"/></body>
    <body name="b" pos="1 0 1"><freejoint/><geom size=".1"/></body>"#;
const PI_2: f32 = std::f32::consts::FRAC_PI_2;

pub(super) fn rows() -> Vec<Row> {
    let mut rows = bodies();
    rows.extend(joints());
    rows.extend(geoms());
    rows.extend(contacts());
    rows.extend(rest());
    rows
}

fn bodies() -> Vec<Row> {
    let inertial =
        |given: &str| world(&format!(r#"<body><freejoint/><inertial pos="0 0 .1" {given}/></body>"#));
    vec![
        row("body pos, quat, euler, axisangle, xyaxes, zaxis", Carried, world(r#"<body pos="1 2 3"><body euler="0 0 90"><freejoint/></body></body>"#).replace("<freejoint/>", r#"<geom size=".1" pos="1 0 0"/>"#), |s| at(s, 1, [1.0, 2.0, 3.0]) && near3(Rotation::from_array(s.bodies[1].pose.rotation) * Vector::X, [0.0, 1.0, 0.0])),
        row("body without joint", Carried, world(r#"<body><geom size=".1"/><body><geom size=".1"/></body></body>"#), |s| s.bodies.iter().all(|b| b.body.body_type == RigidBodyType::Fixed) && s.joints.is_empty()),
        row("body without joint in a moving body", Carried, world(r#"<body><freejoint/><geom size=".1"/><body pos="0 0 1"><geom size=".1"/></body></body>"#), |s| joint(s, 0).locked_axes == JointAxesMask::LOCKED_FIXED_AXES && apart(s, 0, 1)),
        row("body mocap", Carried, world(r#"<body mocap="true"><geom size=".1"/></body>"#), |s| s.bodies[0].body.body_type == RigidBodyType::KinematicPositionBased),
        row("body gravcomp", Carried, world(r#"<body gravcomp="0.75"><freejoint/><geom size=".1"/></body>"#), |s| s.bodies[0].body.gravity_scale == 0.25),
        row("body without mass", Carried, world(r#"<body><freejoint/><geom size=".1" mass="2"/><body><geom size=".1" mass="0"/></body></body>"#), |s| near(mass(s, 0).mass() + mass(s, 1).mass(), 2.0) && mass(s, 1).mass() > 0.0),
        row("mass nowhere", Refused, world("<body><freejoint/></body>"), any),
        row("frame", Carried, world(r#"<frame pos="0 0 2"><body><freejoint/><geom size=".1"/></body></frame>"#), |s| at(s, 0, [0.0, 0.0, 2.0])),
        row("frame with joints, inertial or fromto", Refused, world(r#"<body><frame pos="0 0 1"><joint/></frame><geom size=".1"/></body>"#), any),
        row("inertial diaginertia, pos, quat", Carried, inertial(r#"mass="2" quat="0.7071068 0 0 0.7071068" diaginertia="1 2 2.5""#), |s| {
            let [[xx, ..], [_, yy, _], _] = mass(s, 0).reconstruct_inertia_matrix().to_cols_array_2d();
            near(mass(s, 0).mass(), 2.0) && near(xx, 2.0) && near(yy, 1.0) && near3(mass(s, 0).local_com, [0.0, 0.0, 0.1])
        }),
        row("inertial fullinertia", Carried, inertial(r#"mass="2" fullinertia="1 2 2.5 .1 0 0""#), |s| near(mass(s, 0).reconstruct_inertia_matrix().to_cols_array_2d()[0][1], 0.1)),
        row("inertial without inertia", Warned, inertial(r#"mass="2""#), |s| s.warnings[0].starts_with("inertia")),
        row("inertial mass below 0", Refused, inertial(r#"mass="-1" diaginertia="1 1 1""#), any),
        row("inertial with a moment above the sum of the others", Refused, inertial(r#"mass="1" diaginertia="1 1 5""#), any),
        row("compiler balanceinertia", Carried, inertial(r#"mass="1" diaginertia="1 1 5""#).replace("<mujoco>", r#"<mujoco><compiler balanceinertia="true"/>"#), |s| near3(mass(s, 0).principal_inertia(), [7.0 / 3.0; 3])),
        row("quat 0 0 0 0", Refused, world(r#"<body quat="0 0 0 0"><freejoint/><geom size=".1"/></body>"#), any),
        row("two bodies, joints or geoms of one name", Refused, world(r#"<body name="a"><joint/><geom size=".1"/></body><body name="a"><joint/><geom size=".1"/></body>"#), any),
        row("default, class, childclass", Carried, "<mujoco><default><geom mass=\"3\"/><default class=\"c\"><geom type=\"box\" size=\".1 .1 .1\"/></default></default><worldbody><body childclass=\"c\"><freejoint/><geom/></body></worldbody></mujoco>".into(), |s| near(mass(s, 0).mass(), 3.0) && shape(s).as_cuboid().is_some()),
        row("default pos and orientation, each by itself", Carried, classes(), |s| near3(ends(s, 0)[1], [0.3, 0.32, 0.1]) && near3(ends(s, 1)[1], [1.2, 0.1, 0.3]) && near3(ends(s, 2)[1], [0.1, 0.02, 1.1])),
        row("include", Carried, world(r#"<include file="part.xml"/>"#), |s| s.bodies.len() == 1 && mass(s, 0).mass() > 0.0),
        row("attach", Carried, attach("sub.xml", "sub"), |s| s.bodies.len() == 2 && at(s, 1, [0.0, 0.0, 5.0])),
        row("exclude or equality of a body that is not attached with the other", Carried, attach("hand.xml", "hand"), |s| s.bodies.len() == 2 && s.joints.len() == 1),
        row("attach of a body or a model that is missing", Refused, attach("sub.xml", "sup"), any),
        row("pos or orientation of a class alone, in an attached model", Refused, attach("posed.xml", "sub"), any),
        row("mesh inertia convex, in an attached model", Carried, attach("dented.xml", "sub"), |s| near(mass(s, 1).mass(), 1000.0 / 3.0)),
        row("replicate", Refused, world(r#"<replicate count="3" offset="1 0 0"><body/></replicate>"#), any),
        row("composite, flexcomp, deformable", Refused, world(r#"<body><flexcomp name="f" type="grid"/></body>"#), any),
        row("plugin", Warned, ball(r#"<extension><plugin plugin="mujoco.pid"/></extension>"#), any),
        row("site, camera, light", Unused, world(r#"<light/><camera name="c"/><site name="s"/><body><freejoint/><geom size=".1"/><site name="t"/></body>"#), only),
    ]
}

fn joints() -> Vec<Row> {
    let free = |s: &Scene| s.joints.is_empty() && s.bodies[0].body.body_type == RigidBodyType::Dynamic;
    vec![
        row(
            "joint free, freejoint",
            Carried,
            world(r#"<body><joint type="free"/><geom size=".1"/></body>"#),
            free,
        ),
        row("joint hinge, axis, pos", Carried, arm(r#"axis="0 1 0" pos="0 0 .5""#, ""), |s| {
            let joint = joint(s, 0);
            joint.locked_axes == JointAxesMask::LOCKED_REVOLUTE_AXES
                && near3(joint.local_frame1.translation, [0.0, 0.0, 1.5])
                && near3(joint.local_frame1.rotation * Vector::X, [0.0, 1.0, 0.0])
        }),
        row("joint slide", Carried, arm(r#"type="slide""#, ""), |s| {
            joint(s, 0).locked_axes == JointAxesMask::LOCKED_PRISMATIC_AXES
        }),
        row("joint ball", Carried, arm(r#"type="ball""#, ""), |s| {
            joint(s, 0).locked_axes == JointAxesMask::LOCKED_SPHERICAL_AXES
        }),
        row(
            "several joints of a body",
            Carried,
            world(r#"<body><joint axis="1 0 0"/><joint axis="0 1 0"/><geom size=".1" mass="1"/></body>"#),
            |s| {
                s.bodies.len() == 3 && near(mass(s, 1).mass() + mass(s, 2).mass(), 1.0) && s.joints.len() == 2
            },
        ),
        row("range (degrees by default)", Carried, arm(r#"range="-90 45""#, ""), |s| {
            limits(s, 0, JointAxis::AngX).is_some_and(|[a, b]| near(a, -PI_2) && near(b, PI_2 / 2.0))
        }),
        row("compiler angle", Carried, arm(r#"range="-1 1""#, r#"<compiler angle="radian"/>"#), |s| {
            limits(s, 0, JointAxis::AngX) == Some([-1.0, 1.0])
        }),
        row(
            "compiler autolimits, joint limited",
            Carried,
            arm(r#"range="-1 1""#, r#"<compiler autolimits="false"/>"#),
            |s| limits(s, 0, JointAxis::AngX).is_none(),
        ),
        row("joint ref", Carried, arm(r#"type="slide" ref=".1" range="0 1""#, ""), |s| {
            limits(s, 0, JointAxis::LinX).is_some_and(|[a, b]| near(a, -0.1) && near(b, 0.9))
        }),
        row("range beyond half a turn", Carried, arm(r#"range="-1 215""#, ""), |s| {
            limits(s, 0, JointAxis::AngX)
                .is_some_and(|[a, b]| near(a, -(1f32.to_radians())) && near(b, 215f32.to_radians()))
        }),
        row("range of a whole turn or more", Warned, arm(r#"range="-270 270""#, ""), |s| {
            limits(s, 0, JointAxis::AngX).is_none()
        }),
        Row {
            params: "multibody=1",
            ..row(
                "range of a whole turn or more (--set multibody=1)",
                Carried,
                arm(r#"range="-270 270""#, ""),
                |s| limits(s, 0, JointAxis::AngX).is_some_and(|[a, b]| near(a, -b) && near(b, 3.0 * PI_2)),
            )
        },
        row("range of a ball joint", Warned, arm(r#"type="ball" range="0 45""#, ""), any),
        row(
            "joint stiffness, damping, springref",
            Carried,
            arm(r#"stiffness="3" damping="2" springref="90""#, ""),
            |s| hinge(s).is_some_and(|[k, d, at]| (k, d) == (3.0, 2.0) && near(at, PI_2)),
        ),
        row("joint springdamper", Carried, arm(r#"springdamper=".5 1""#, ""), |s| {
            let motor = joint(s, 0).motors[JointAxis::AngX as usize];
            (motor.stiffness, motor.damping, motor.model) == (4.0, 4.0, MotorModel::AccelerationBased)
        }),
        row("joint frictionloss", Carried, arm(r#"frictionloss=".5""#, ""), |s| {
            hinge(s) == Some([0.0; 3]) && joint(s, 0).motors[3].max_force == 0.5
        }),
        row("joint frictionloss beside damping", Warned, arm(r#"frictionloss=".5" damping="1""#, ""), |s| {
            hinge(s) == Some([0.0, 1.0, 0.0])
        }),
        row("joint armature", Warned, arm(r#"armature="1""#, ""), |s| {
            s.warnings[0].contains("armature of j")
        }),
        Row {
            params: "multibody=1",
            ..row(
                "joint stiffness, damping, frictionloss, armature (--set multibody=1)",
                Carried,
                arm(r#"stiffness="3" damping="2" springref="90" frictionloss=".5" armature=".25""#, ""),
                |s| {
                    let link = s.joints[0].multibody.unwrap();
                    let [stiffness, rest] = link.springs[JointAxis::AngX as usize];
                    stiffness == 3.0
                        && near(rest, PI_2)
                        && link.damping.unwrap()[0] == 2.0
                        && (link.friction[0], link.armature[0]) == (0.5, 0.25)
                        && joint(s, 0).motor_axes.is_empty()
                },
            )
        },
        Row {
            params: "multibody=1",
            ..row(
                "actuator beside joint damping (--set multibody=1)",
                Carried,
                arm(r#"damping="2""#, r#"<actuator><position joint="j" kp="5"/></actuator>"#),
                |s| {
                    hinge(s) == Some([5.0, 0.0, 0.0])
                        && s.joints[0].multibody.unwrap().damping.unwrap()[0] == 2.0
                },
            )
        },
        row("joint actuatorfrcrange", Warned, arm(r#"actuatorfrcrange="-1 1""#, ""), any),
        row(
            "damping of a free joint",
            Warned,
            world(r#"<body><joint type="free" damping="1"/><geom size=".1"/></body>"#),
            any,
        ),
        row(
            "joint solreflimit, solimplimit, margin",
            Unused,
            arm(r#"solreflimit=".02 1" margin=".01""#, ""),
            |s| s.joints.len() == 1,
        ),
        row("axis 0 0 0 of a hinge or slide", Refused, arm(r#"axis="0 0 0""#, ""), any),
        row(
            "a free joint beside others",
            Refused,
            world(r#"<body><freejoint/><joint/><geom size=".1"/></body>"#),
            any,
        ),
    ]
}

fn geoms() -> Vec<Row> {
    let mesh = |asset: &str| {
        format!(
            r#"<mujoco><asset><mesh name="m" {asset}/></asset><worldbody><body><freejoint/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/><geom type="mesh" mesh="m"/></body></worldbody></mujoco>"#
        )
    };
    let weighed =
        |asset: &str| mesh(asset).replace(r#"<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>"#, "");
    let field = |asset: &str| {
        format!(
            r#"<mujoco><asset><hfield name="h" size="1 2 .5 .1" {asset}/></asset><worldbody><geom type="hfield" hfield="h"/></worldbody></mujoco>"#
        )
    };
    vec![
        row("geom sphere", Carried, geom(r#"size=".1""#), |s| near(mass(s, 0).mass(), 1000.0 * 4.18879e-3)),
        row("geom box", Carried, geom(r#"type="box" size=".1 .2 .3""#), |s| near(mass(s, 0).mass(), 48.0) && near3(shape(s).as_cuboid().unwrap().half_extents, [0.1, 0.2, 0.3])),
        row("geom capsule, cylinder", Carried, geom(r#"type="cylinder" size=".1 .5""#), |s| near(shape(s).compute_aabb(&s.bodies[0].colliders[0].position).maxs.z, 0.5)),
        row("geom ellipsoid", Carried, geom(r#"type="ellipsoid" size=".1 .2 .3""#), |s| near(mass(s, 0).mass(), 25.1327) && near(shape(s).mass_properties(1000.0).mass(), 25.1327)),
        row("geom plane", Carried, world(r#"<geom type="plane" size="1 1 1" euler="90 0 0"/>"#), |s| shape(s).as_halfspace().is_some() && near3(s.bodies[0].colliders[0].position.rotation * Vector::Z, [0.0, -1.0, 0.0])),
        row("geom fromto", Carried, geom(r#"type="capsule" size=".1" fromto="0 0 0 2 0 0""#), |s| near3(shape(s).compute_aabb(&s.bodies[0].colliders[0].position).maxs, [2.1, 0.1, 0.1])),
        row("geom fromto of a box", Carried, geom(r#"type="box" size=".05" fromto="0 0 0 0 0 1""#), |s| near3(shape(s).as_cuboid().unwrap().half_extents, [0.05, 0.05, 0.5])),
        row("geom mesh, obj and stl", Carried, mesh(r#"file="tetra.stl" scale="2 2 2""#), |s| near(shape(s).mass_properties(1.0).mass(), 8.0 / 6.0)),
        row("mesh vertex", Carried, mesh(r#"vertex="0 0 0 1 0 0 0 1 0 0 0 1""#), |s| near(shape(s).mass_properties(1.0).mass(), 1.0 / 6.0)),
        row("mesh vertex without face, inertia exact", Carried, weighed(r#"vertex="0 0 0 1 0 0 0 1 0 0 0 1" inertia="exact""#), |s| near(mass(s, 0).mass(), 1000.0 / 6.0)),
        row("mesh face of no vertex", Refused, weighed(r#"vertex="0 0 0 1 0 0 0 1 0 0 0 1" face="0 1 9 0 1 3 0 3 2 1 2 3""#), any),
        row("mesh inertia of a class", Carried, r#"<mujoco><default><mesh inertia="convex"/></default><asset><mesh name="m" vertex="0 0 0 1 0 0 0 1 0 0 0 1 2 0 0" face="0 2 1 0 1 3 0 3 2 1 2 3"/></asset><worldbody><body><freejoint/><geom type="mesh" mesh="m"/></body></worldbody></mujoco>"#.into(), |s| near(mass(s, 0).mass(), 1000.0 / 3.0)),
        row("mesh inertia legacy (the default), exact, convex", Carried, weighed(r#"file="cube.obj""#), |s| near(mass(s, 0).mass(), 1000.0)),
        row("mesh inertia shell", Warned, weighed(r#"file="cube.obj" inertia="shell""#), any),
        row("mesh refpos, refquat", Warned, mesh(r#"file="cube.obj" refpos="1 0 0""#), any),
        row("mesh that is missing", Refused, mesh(r#"file="none.obj""#), any),
        row("mesh msh", Refused, mesh(r#"file="cube.msh""#), any),
        row("primitive fitted to a mesh", Refused, geom(r#"type="box" mesh="m""#), any),
        row("geom hfield, elevation", Carried, field(r#"nrow="2" ncol="3" elevation="0 0 4 0 0 0""#), |s| {
            let collider = &s.bodies[0].colliders[0];
            let ray = |x: f32, y: f32| {
                let ray = rapier3d::parry::query::Ray::new(Vector::new(x, y, 2.0), Vector::new(0.0, 0.0, -1.0));
                collider.shape.cast_ray(&collider.position, &ray, 10.0, true).map(|t| 2.0 - t)
            };
            // The first row of numbers is the far one.
            ray(0.99, 1.99).is_some_and(|z| z > 0.45) && ray(0.99, -1.99).is_some_and(|z| z < 0.05) && ray(-0.99, 1.99).is_some_and(|z| z < 0.05)
        }),
        row("hfield of more than 16 million heights", Refused, field(r#"nrow="65536" ncol="65536""#), any),
        row("hfield file", Refused, field(r#"file="terrain.png""#), any),
        row("geom sdf", Refused, geom(r#"type="sdf" mesh="m""#).replace(r#" mesh="m""#, ""), any),
        row("geom mass, density", Carried, geom(r#"size=".1" mass="7""#), |s| near(mass(s, 0).mass(), 7.0)),
        row("geom mass, density below 0", Refused, geom(r#"size=".1" density="-1""#), any),
        row("compiler inertiafromgeom", Carried, world(r#"<body><freejoint/><inertial pos="0 0 0" mass="9" diaginertia="1 1 1"/><geom size=".1" mass="1"/></body>"#).replace("<mujoco>", r#"<mujoco><compiler inertiafromgeom="true"/>"#), |s| near(mass(s, 0).mass(), 1.0)),
        row("body sleep", Warned, world(r#"<body sleep="never"><freejoint/><geom size=".1"/></body>"#), any),
        row("body sleep=auto", Carried, world(r#"<body sleep="auto"><freejoint/><geom size=".1"/></body>"#), |s| s.bodies.len() == 1),
        row("compiler settotalmass", Carried, ball(r#"<compiler settotalmass="5"/>"#), |s| near(mass(s, 0).mass(), 5.0)),
        row("compiler boundmass, boundinertia", Carried, ball(r#"<compiler boundmass="50"/>"#), |s| near(mass(s, 0).mass(), 50.0)),
        row("compiler eulerseq", Carried, world(r#"<body euler="90 0 90"><geom size=".1"/></body>"#).replace("<mujoco>", r#"<mujoco><compiler eulerseq="XYZ"/>"#), |s| near3(Rotation::from_array(s.bodies[0].pose.rotation) * Vector::Z, [1.0, 0.0, 0.0])),
        row("compiler behind default", Carried, world(r#"<body><geom/></body>"#).replace("<mujoco>", r#"<mujoco><default><geom euler="1.5707963 0 0" type="box" size=".1 .2 .3"/></default><compiler angle="radian"/>"#), |s| near(s.bodies[0].colliders[0].shape.compute_aabb(&s.bodies[0].colliders[0].position).maxs.z, 0.2)),
        row("compiler eulerseq of other than three axes", Refused, world(r#"<body euler="90 0 0"><geom size=".1"/></body>"#).replace("<mujoco>", r#"<mujoco><compiler eulerseq="xyzx"/>"#), any),
        row("compiler coordinate global", Refused, ball(r#"<compiler coordinate="global"/>"#), any),
        row("compiler inertiagrouprange", Warned, ball(r#"<compiler inertiagrouprange="1 2"/>"#), any),
        row("geom shellinertia", Warned, geom(r#"size=".1" shellinertia="true""#), any),
        row("geom without size", Refused, geom(r#"type="box" size=".1""#), any),
        row("geom that touches nothing", Carried, geom(r#"size=".1" contype="0" conaffinity="0""#), |s| s.bodies[0].colliders.is_empty() && mass(s, 0).mass() > 1.0),
        row("geom group, material, rgba, solref, solimp, margin, gap", Unused, geom(r#"size=".1" group="1" rgba="1 0 0 1" solref=".02 1" gap=".01""#), only),
    ]
}

fn contacts() -> Vec<Row> {
    let two = |sections: &str| world(TWO).replace("<worldbody>", &format!("{sections}<worldbody>"));
    let nested = |flag: &str| {
        world(r#"<body name="a"><freejoint/><geom size=".1"/><body name="b" pos="1 0 0"><joint/><geom size=".1"/></body></body>"#).replace("<worldbody>", &format!("{flag}<worldbody>"))
    };
    vec![
        row("contype, conaffinity", Carried, geom(r#"size=".1" contype="2" conaffinity="4""#), |s| {
            let groups = s.bodies[0].colliders[0].collision_groups;
            (groups.memberships.bits(), groups.filter.bits(), groups.test_mode)
                == (2, 4, InteractionTestMode::Or)
        }),
        row(
            "friction of sliding (the larger of two counts)",
            Carried,
            geom(r#"size=".1" friction=".7 .1 .1""#),
            |s| {
                s.bodies[0].colliders[0].friction == 0.7
                    && s.bodies[0].colliders[0].friction_combine_rule == CoefficientCombineRule::Max
            },
        ),
        row("condim 1", Carried, geom(r#"size=".1" condim="1""#), |s| {
            s.bodies[0].colliders[0].friction == 0.0
        }),
        row("condim 4 and 6", Warned, geom(r#"size=".1" condim="6""#), any),
        row("geom priority", Warned, geom(r#"size=".1" priority="1""#), any),
        row("contact exclude", Carried, two(r#"<contact><exclude body1="a" body2="b"/></contact>"#), |s| {
            apart(s, 0, 1) && joint(s, 0).locked_axes.is_empty()
        }),
        row(
            "contact exclude of a body that is missing",
            Refused,
            two(r#"<contact><exclude body1="a" body2="x"/></contact>"#),
            any,
        ),
        row("contact pair", Warned, two(r#"<contact><pair geom1="x" geom2="y"/></contact>"#), any),
        row("parent and child do not touch", Carried, nested(""), |s| apart(s, 0, 1)),
        row(
            "flag filterparent",
            Carried,
            nested(r#"<option><flag filterparent="disable"/></option>"#),
            |s| !apart(s, 0, 1),
        ),
        row("child of the world touches the world", Carried, arm("", ""), |s| !apart(s, 0, 1)),
        row("flag contact", Carried, ball(r#"<option><flag contact="disable"/></option>"#), |s| {
            s.bodies[0].colliders[0].collision_groups.memberships.is_empty()
        }),
        row("option collision predefined", Refused, ball(r#"<option collision="predefined"/>"#), any),
    ]
}

fn rest() -> Vec<Row> {
    let equality = |element: &str| {
        world(TWO).replace("<worldbody>", &format!("<equality>{element}</equality><worldbody>"))
    };
    let tendon = r#"<tendon><fixed name="t"><joint joint="j" coef="1"/></fixed></tendon>"#;
    // A quarter of a turn about z, with the mass above the body's origin: the body's own x is the world's y.
    let flying = geom(r#"size=".1" pos="0 0 1""#).replace(
        "<worldbody>",
        r#"<keyframe><key qpos="0 0 0 .7 0 0 .7" qvel="0 0 3 2 0 0"/></keyframe><worldbody>"#,
    );
    let key = r#"<keyframe><key qpos="1.5" ctrl=".25"/></keyframe><actuator><position joint="j" kp="2"/></actuator>"#;
    vec![
        row("option gravity", Carried, ball(r#"<option gravity="0 1 -2"/>"#), |s| {
            s.gravity == [0.0, 1.0, -2.0]
        }),
        row("flag gravity", Carried, ball(r#"<option><flag gravity="disable"/></option>"#), |s| {
            s.gravity == [0.0; 3]
        }),
        row("option timestep", Carried, ball(r#"<option timestep=".004"/>"#), |s| s.dt_s == 0.004),
        row(
            "option density, viscosity, wind, geom fluidshape",
            Warned,
            ball(r#"<option density="1000"/>"#),
            any,
        ),
        row(
            "option integrator, solver, iterations, cone, impratio",
            Unused,
            ball(r#"<option integrator="RK4" solver="PGS" iterations="50"/>"#),
            only,
        ),
        row("other flags", Warned, ball(r#"<option><flag limit="disable"/></option>"#), any),
        row(
            "actuator position (kp, kv, gear, forcerange)",
            Carried,
            actuator(r#"<position joint="j" kp="10" kv="1" gear="2" forcerange="-3 3"/>"#),
            |s| hinge(s) == Some([40.0, 4.0, 0.0]) && joint(s, 0).motors[3].max_force == 6.0,
        ),
        row(
            "actuator beside joint damping",
            Carried,
            arm(r#"damping="2" stiffness="1""#, r#"<actuator><position joint="j" kp="9"/></actuator>"#),
            |s| hinge(s) == Some([10.0, 2.0, 0.0]),
        ),
        row("actuator velocity", Carried, actuator(r#"<velocity joint="j" kv="3"/>"#), |s| {
            hinge(s) == Some([0.0, 3.0, 0.0])
        }),
        row("actuator intvelocity", Carried, actuator(r#"<intvelocity joint="j" kp="3"/>"#), |s| {
            hinge(s) == Some([3.0, 0.0, 0.0])
        }),
        row(
            "actuator general, affine",
            Carried,
            actuator(r#"<general joint="j" biastype="affine" gainprm="5" biasprm="0 -5 -1"/>"#),
            |s| hinge(s) == Some([5.0, 1.0, 0.0]),
        ),
        row(
            "actuator motor, damper (control 0: no force)",
            Carried,
            actuator(r#"<motor joint="j" gear="100"/>"#),
            |s| hinge(s).is_none(),
        ),
        row(
            "actuator ctrlrange (control 0 is clamped)",
            Carried,
            actuator(r#"<position joint="j" ctrlrange=".5 1"/>"#),
            |s| hinge(s) == Some([1.0, 0.0, 0.5]),
        ),
        row(
            "actuator dampratio, inheritrange, timeconst, dyntype",
            Warned,
            actuator(r#"<position joint="j" dampratio="1"/>"#),
            any,
        ),
        row("actuator of a joint that is not there", Warned, actuator(r#"<position joint="nope"/>"#), |s| {
            s.warnings[0].contains("not there of nope")
        }),
        row("actuator muscle, adhesion, cylinder", Warned, actuator(r#"<muscle joint="j"/>"#), any),
        row(
            "actuator of a tendon, site or body",
            Warned,
            arm("", &format!(r#"{tendon}<actuator><motor tendon="t"/></actuator>"#)),
            any,
        ),
        row(
            "equality connect",
            Carried,
            equality(r#"<connect body1="a" body2="b" anchor="0 0 .5"/>"#),
            |s| {
                joint(s, 0).locked_axes == JointAxesMask::LIN_AXES
                    && near3(joint(s, 0).local_frame2.translation, [-1.0, 0.0, 0.5])
                    && !apart(s, 0, 1)
            },
        ),
        row("equality weld", Carried, equality(r#"<weld body1="a" body2="b"/>"#), |s| {
            joint(s, 0).locked_axes == JointAxesMask::LOCKED_FIXED_AXES
        }),
        row(
            "equality weld, relpose",
            Carried,
            equality(r#"<weld body1="a" body2="b" relpose="0 0 2 2 0 0 0"/>"#),
            |s| {
                near(joint(s, 0).local_frame1.rotation.length(), 1.0)
                    && near3(joint(s, 0).local_frame1.translation, [0.0, 0.0, 2.0])
                    && near3(joint(s, 0).local_frame2.translation, [0.0; 3])
            },
        ),
        row("equality active", Carried, equality(r#"<weld body1="a" body2="b" active="false"/>"#), |s| {
            !joint(s, 0).is_enabled()
        }),
        row("equality of sites", Refused, equality(r#"<connect site1="a" site2="b"/>"#), any),
        row("equality joint", Warned, arm("", r#"<equality><joint joint1="j"/></equality>"#), any),
        row(
            "equality tendon",
            Warned,
            arm("", &format!(r#"{tendon}<equality><tendon tendon1="t"/></equality>"#)),
            any,
        ),
        row("tendon fixed, spatial", Warned, arm("", tendon), any),
        Row {
            params: "key=1",
            ..row("keyframe qvel of a free joint", Carried, flying, |s| {
                let body = s.bodies[0].body.build();
                near3(body.angvel(), [0.0, 2.0, 0.0])
                    && near3(body.linvel(), [2.0, 0.0, 3.0])
                    && near(Rotation::from_array(s.bodies[0].pose.rotation).length(), 1.0)
            })
        },
        Row {
            params: "key=1",
            ..row(
                "keyframe qvel of other joints",
                Warned,
                arm("", r#"<keyframe><key qvel="1"/></keyframe>"#),
                any,
            )
        },
        Row {
            params: "key=1",
            ..row("keyframe (--set key=1)", Carried, arm("", key), |s| {
                hinge(s) == Some([2.0, 0.0, 0.25])
                    && near3(
                        Rotation::from_array(s.bodies[1].pose.rotation) * Vector::X,
                        [1.5f32.cos(), 1.5f32.sin(), 0.0],
                    )
            })
        },
        row(
            "sensor, size, statistic, visual, custom",
            Unused,
            ball(
                r#"<size njmax="500"/><statistic extent="2"/><visual/><custom><numeric name="x" data="1"/></custom><sensor><framepos objtype="body" objname="b"/></sensor>"#,
            ),
            only,
        ),
        row(
            "asset texture, material, skin",
            Unused,
            ball(
                r#"<asset><texture name="t" type="2d" builtin="flat" width="8" height="8"/><material name="m" texture="t"/></asset>"#,
            ),
            only,
        ),
        row(
            "a number that is not finite",
            Refused,
            world(r#"<body><freejoint/><inertial pos="0 0 0" mass="nan" diaginertia="1 1 1"/></body>"#),
            any,
        ),
        row("an unknown element", Refused, ball("<wheels/>"), any),
        row(
            "an unknown attribute of a body, joint, geom or inertial",
            Warned,
            geom(r#"size=".1" desnity="3""#),
            |s| s.warnings[0].contains("g (desnity)"),
        ),
        row("XML that is none", Refused, "<mujoco><worldbody></mujoco>".into(), any),
    ]
}
