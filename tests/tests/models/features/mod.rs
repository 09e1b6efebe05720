//! Tests every feature of the formats with a file of its own: it is carried, warned of, refused, or has no
//! effect, as the tables in `dcd/scenes/models/README.md` say.

mod mjcf;
mod urdf;

use std::fs;
use std::path::Path;

use dcd::scene::{Params, Scene, SceneError};
use rapier3d::dynamics::RigidBodyAdditionalMassProps;
use rapier3d::prelude::*;

/// The fate of a feature.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Fate {
    /// The scene has it, as the row's check confirms.
    Carried,
    /// The scene lacks it, and says so by a warning.
    Warned,
    /// The file is refused.
    Refused,
    /// Nothing that moves depends on it.
    Unused,
}

/// A feature: its name in the table, its fate, a file, and a check of the scene.
struct Row {
    name: &'static str,
    fate: Fate,
    file: String,
    params: &'static str,
    check: fn(&Scene) -> bool,
}

fn row(name: &'static str, fate: Fate, file: String, check: fn(&Scene) -> bool) -> Row {
    Row { name, fate, file, params: "", check }
}

/// Returns whether there is one body and no warning.
fn only(scene: &Scene) -> bool {
    scene.bodies.len() == 1 && scene.warnings.is_empty()
}

fn any(_: &Scene) -> bool {
    true
}

fn mass(scene: &Scene, body: usize) -> MassProperties {
    match scene.bodies[body].body.build().mass_properties().additional_local_mprops.as_deref() {
        Some(RigidBodyAdditionalMassProps::MassProps(mass)) => *mass,
        other => panic!("{other:?}"),
    }
}

fn near(a: f32, b: f32) -> bool {
    (a - b).abs() < 1e-3 * b.abs().max(0.1)
}

fn near3(a: Vector, b: [f32; 3]) -> bool {
    a.to_array().into_iter().zip(b).all(|(a, b)| near(a, b))
}

/// Returns the corners of the box around a collider of the first body, in the body's space.
fn ends(scene: &Scene, collider: usize) -> [Vector; 2] {
    let collider = &scene.bodies[0].colliders[collider];
    let around = collider.shape.compute_aabb(&collider.position);
    [around.mins, around.maxs]
}

fn joint(scene: &Scene, index: usize) -> &GenericJoint {
    &scene.joints[index].joint
}

/// Returns the limits of an axis, if it has any.
fn limits(scene: &Scene, index: usize, axis: JointAxis) -> Option<[f32; 2]> {
    let joint = joint(scene, index);
    let limits = &joint.limits[axis as usize];
    joint.limit_axes.contains(axis.into()).then_some([limits.min, limits.max])
}

/// Returns stiffness, damping and target of an axis, if it has a motor by force.
fn motor(scene: &Scene, index: usize, axis: JointAxis) -> Option<[f32; 3]> {
    let joint = joint(scene, index);
    let motor = &joint.motors[axis as usize];
    let by_force = joint.motor_axes.contains(axis.into()) && motor.model == MotorModel::ForceBased;
    by_force.then_some([motor.stiffness, motor.damping, motor.target_pos])
}

fn at(scene: &Scene, body: usize, place: [f32; 3]) -> bool {
    near3(Vector::from(scene.bodies[body].pose.translation.map(|v| v as f32)), place)
}

/// Returns whether two bodies pass through each other.
fn apart(scene: &Scene, a: usize, b: usize) -> bool {
    scene
        .joints
        .iter()
        .any(|joint| [(a, b), (b, a)].contains(&(joint.a, joint.b)) && !joint.joint.contacts_enabled)
}

const CUBE_OBJ: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n\
    f 1 3 2\nf 1 4 3\nf 5 6 7\nf 5 7 8\nf 1 2 6\nf 1 6 5\nf 2 3 7\nf 2 7 6\nf 3 4 8\nf 3 8 7\nf 4 1 5\nf 4 5 8\n";
const TETRA_STL: &str = "solid t
facet normal 0 0 -1\nouter loop\nvertex 0 0 0\nvertex 0 1 0\nvertex 1 0 0\nendloop\nendfacet
facet normal 0 -1 0\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 0 1\nendloop\nendfacet
facet normal -1 0 0\nouter loop\nvertex 0 0 0\nvertex 0 0 1\nvertex 0 1 0\nendloop\nendfacet
facet normal 1 1 1\nouter loop\nvertex 1 0 0\nvertex 0 1 0\nvertex 0 0 1\nendloop\nendfacet
endsolid t\n";
const TETRA_DAE: &str = r##"<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit meter="1"/><up_axis>Z_UP</up_axis></asset><library_geometries><geometry id="t"><mesh>
<source id="p"><float_array id="a" count="12">0 0 0 1 0 0 0 1 0 0 0 1</float_array><technique_common>
<accessor source="#a" count="4" stride="3"><param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/></accessor>
</technique_common></source><vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="4"><input semantic="VERTEX" source="#v" offset="0"/><p>0 2 1 0 1 3 0 3 2 1 2 3</p></triangles></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node><instance_geometry url="#t"/></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>"##;
const PART_XML: &str = r#"<mujoco><body name="included"><freejoint/><geom size=".1"/></body></mujoco>"#;
/// A node that is turned, and in it one that is moved, in centimetres.
const TURNED: &str = r##"<node><rotate>0 0 1 90</rotate><node><translate>100 0 0</translate><instance_geometry url="#t"/></node></node>"##;
const TWICE: &str = r##"<node><instance_geometry url="#t"/></node><node><translate>5 0 0</translate><instance_geometry url="#t"/></node>"##;
const SKEWED: &str = r##"<node><skew>45 0 1 0 1 0 0</skew><instance_geometry url="#t"/></node>"##;
/// A model whose geom has its position from its class.
const POSED_XML: &str = r#"<mujoco><default><geom pos="0 0 1"/></default><worldbody><body name="sub"><joint/><geom size=".1" euler="0 0 90"/></body></worldbody></mujoco>"#;
/// A model of a mesh whose hull is twice as large as what its faces enclose.
const DENTED_XML: &str = r#"<mujoco><asset><mesh name="m" inertia="convex" vertex="0 0 0 1 0 0 0 1 0 0 0 1 2 0 0" face="0 2 1 0 1 3 0 3 2 1 2 3"/></asset>
<worldbody><body name="sub"><joint/><geom type="mesh" mesh="m"/></body></worldbody></mujoco>"#;
/// A model with statements about two bodies, of which only one may be attached.
const HAND_XML: &str = r#"<mujoco><worldbody><body name="base"><geom size=".1"/></body><body name="hand"><joint/><geom size=".1"/></body></worldbody>
<contact><exclude body1="hand" body2="base"/></contact><equality><weld body1="hand" body2="base"/></equality></mujoco>"#;
const SUB_XML: &str = r#"<mujoco><worldbody><body name="sub"><joint axis="0 0 1"/><geom size=".1"/></body></worldbody></mujoco>"#;

fn load(row: &Row, extension: &str) -> Result<Scene, SceneError> {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
    fs::create_dir_all(folder.path().join("pack/meshes")).unwrap();
    write("cube.obj", CUBE_OBJ);
    write("pack/meshes/cube.obj", CUBE_OBJ);
    write("tetra.stl", TETRA_STL);
    write("tetra.dae", TETRA_DAE);
    write("y_up.dae", &TETRA_DAE.replace("Z_UP", "Y_UP"));
    let node = r##"<node><instance_geometry url="#t"/></node>"##;
    write("turned.dae", &TETRA_DAE.replace(r#"meter="1""#, r#"meter="0.01""#).replace(node, TURNED));
    write("twice.dae", &TETRA_DAE.replace(node, TWICE));
    write("skewed.dae", &TETRA_DAE.replace(node, SKEWED));
    write("part.xml", PART_XML);
    write("sub.xml", SUB_XML);
    write("posed.xml", POSED_XML);
    write("dented.xml", DENTED_XML);
    write("hand.xml", HAND_XML);
    let path = folder.path().join("model").with_extension(extension);
    fs::write(&path, &row.file).unwrap();
    Scene::load(path, &Params::from_args(row.params.split_whitespace()).unwrap())
}

/// Checks that every row of a format has its fate, and that the format's table has the same rows.
fn check(rows: &[Row], extension: &str, heading: &str) {
    let mut wrong = Vec::new();
    for row in rows {
        let good = match (row.fate, load(row, extension)) {
            (Fate::Refused, Err(error)) => {
                let file = error.to_string();
                ["model.", "posed.xml"].iter().any(|name| file.contains(name))
            }
            (Fate::Warned, Ok(scene)) => !scene.warnings.is_empty() && (row.check)(&scene),
            (Fate::Carried | Fate::Unused, Ok(scene)) => scene.warnings.is_empty() && (row.check)(&scene),
            (_, other) => {
                wrong.push(format!(
                    "{}: {:?}",
                    row.name,
                    other.map(|scene| scene.bodies.len()).map_err(|e| e.to_string())
                ));
                continue;
            }
        };
        if !good {
            let scene =
                load(row, extension).map(|scene| (scene.warnings, scene.joints.len(), scene.bodies.len()));
            wrong.push(format!("{}: {scene:?}", row.name));
        }
    }
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../dcd/scenes/models/README.md");
    let text = fs::read_to_string(path).unwrap();
    let section =
        text.split("\n## ").find(|section| section.starts_with(heading)).expect("the section is there");
    let table: Vec<_> = section
        .lines()
        .filter(|line| line.starts_with("| ") && !line.starts_with("| feature"))
        .map(|line| {
            let cells: Vec<_> = line.split('|').map(|cell| cell.trim().to_owned()).collect();
            (cells[1].replace('`', ""), cells[2].clone())
        })
        .collect();
    let fate = |fate: Fate| match fate {
        Fate::Carried => "carried",
        Fate::Warned => "warned of",
        Fate::Refused => "refused",
        Fate::Unused => "no effect",
    };
    let tried: Vec<_> = rows.iter().map(|row| (row.name.to_owned(), fate(row.fate).to_owned())).collect();
    let missing: Vec<_> = tried.iter().filter(|row| !table.contains(row)).collect();
    let untried: Vec<_> = table.iter().filter(|row| !tried.contains(row)).collect();
    assert!(
        missing.is_empty() && untried.is_empty(),
        "not in the table: {missing:#?}\nnot tried: {untried:#?}"
    );
}

#[test]
fn every_feature_of_mjcf_is_carried_warned_of_or_refused_as_the_table_says() {
    check(&mjcf::rows(), "xml", "MJCF");
}

#[test]
fn every_feature_of_urdf_is_carried_warned_of_or_refused_as_the_table_says() {
    check(&urdf::rows(), "urdf", "URDF");
}
