//! Tests what is read from Collada files: the geometries that the scene instances, where its nodes put them,
//! and what is refused.

use std::fs;

use dcd::scene::{Params, Scene, SceneError};
use rapier3d::prelude::*;

/// The vertices and faces of a cut-off corner of a cube.
const POINTS: &str = "0 0 0 1 0 0 0 1 0 0 0 1";
const TRIANGLES: &str = "<triangles count=\"4\"><input semantic=\"VERTEX\" source=\"#v\" offset=\"0\"/>
<p>0 2 1 0 1 3 0 3 2 1 2 3</p></triangles>";
const INSTANCE: &str = "<instance_geometry url=\"#t\"/>";

/// Returns a file with these triangles and this scene content; without a scene if the content is empty.
fn dae(points: &str, primitives: &str, scene: &str, libraries: &str) -> String {
    let shown = format!(
        r##"<library_visual_scenes><visual_scene id="s">{scene}</visual_scene></library_visual_scenes>
        <scene><instance_visual_scene url="#s"/></scene>"##
    );
    let shown = if scene.is_empty() { "" } else { &shown[..] };
    format!(
        r##"<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><asset><unit meter=".5"/></asset>
<library_geometries><geometry id="t"><mesh><source id="p"><float_array id="a" count="12">{points}</float_array><technique_common>
<accessor source="#a" count="4" stride="3"><param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/></accessor>
</technique_common></source><vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
{primitives}</mesh></geometry></library_geometries>{libraries}{shown}</COLLADA>"##
    )
}

fn load(dae: &str) -> Result<Scene, SceneError> {
    let folder = tempfile::tempdir().unwrap();
    let robot = r#"<robot name="r"><link name="a"><collision><geometry><mesh filename="m.dae"/></geometry></collision></link></robot>"#;
    fs::write(folder.path().join("m.dae"), dae).unwrap();
    fs::write(folder.path().join("m.urdf"), robot).unwrap();
    Scene::load(folder.path().join("m.urdf"), &Params::new())
}

/// Returns the boxes around the meshes of a file.
fn boxes(dae: &str) -> Vec<[[f32; 3]; 2]> {
    let scene = load(dae).unwrap_or_else(|error| panic!("{error}\n{dae}"));
    let around = |collider: &ColliderBuilder| collider.shape.compute_aabb(&collider.position);
    let boxes = scene.bodies[0].colliders.iter().map(around);
    boxes.map(|around| [around.mins.to_array(), around.maxs.to_array()]).collect()
}

fn check(what: &str, dae: &str, right: &[[[f32; 3]; 2]]) {
    let found = boxes(dae);
    let mut pairs = found.as_flattened().as_flattened().iter().zip(right.as_flattened().as_flattened());
    let same = found.len() == right.len() && pairs.all(|(a, b)| (a - b).abs() < 1e-5);
    assert!(same, "{what}: {found:?}, not {right:?}");
}

#[test]
fn geometries_are_where_their_nodes_and_the_unit_put_them() {
    let at = |x: f32, y: f32, z: f32| [[x, y, z], [x + 0.5, y + 0.5, z + 0.5]];
    let library = |nodes: &str| format!("<library_nodes>{nodes}</library_nodes>");
    let part = library(&format!("<node id=\"part\"><translate>0 0 4</translate>{INSTANCE}</node>"));
    for (what, scene, libraries, right) in [
        ("no scene", String::new(), "", vec![at(0.0, 0.0, 0.0)]),
        ("small steps", format!("<node><translate>.004 0 0</translate>{INSTANCE}</node>"), "", vec![at(0.002, 0.0, 0.0)]),
        (
            "a matrix, row by row",
            format!("<node><matrix>0 -1 0 2  1 0 0 4  0 0 1 6  0 0 0 1</matrix>{INSTANCE}</node>"),
            "",
            vec![[[0.5, 2.0, 3.0], [1.0, 2.5, 3.5]]],
        ),
        (
            "what is written last comes first",
            format!("<node><rotate>0 0 2 90</rotate><translate>2 0 0</translate><scale>2 4 6</scale>{INSTANCE}</node>"),
            "",
            vec![[[-2.0, 1.0, 0.0], [0.0, 2.0, 3.0]]],
        ),
        (
            "nodes in nodes",
            format!("<node><rotate>0 0 1 90</rotate><node><translate>2 0 0</translate>{INSTANCE}</node></node>"),
            "",
            vec![[[-0.5, 1.0, 0.0], [0.0, 1.5, 0.5]]],
        ),
        (
            "a look, from 4 along y at the origin, with z up",
            format!("<node><lookat>0 4 0  0 0 0  0 0 1</lookat>{INSTANCE}</node>"),
            "",
            vec![[[-0.5, 2.0, 0.0], [0.0, 2.5, 0.5]]],
        ),
        (
            "a node of the library, twice",
            "<node><instance_node url=\"#part\"/></node><node><translate>2 0 0</translate><instance_node url=\"#part\"/></node>".into(),
            part.as_str(),
            vec![at(0.0, 0.0, 2.0), at(1.0, 0.0, 2.0)],
        ),
        ("a camera besides", format!("<node><instance_camera url=\"#c\"/></node><node>{INSTANCE}</node>"), "", vec![at(0.0, 0.0, 0.0)]),
    ] {
        check(what, &dae(POINTS, TRIANGLES, &scene, libraries), &right);
    }
}

#[test]
fn polygons_fans_and_strips_are_cut_into_triangles() {
    let input = "<input semantic=\"VERTEX\" source=\"#v\" offset=\"1\"/><input semantic=\"NORMAL\" source=\"#n\" offset=\"0\"/>";
    // A square and one more point. In each corner the index of a normal comes first.
    let points = "0 0 0 2 0 0 2 2 0 0 2 0 0 0 2";
    let square = |shape: &SharedShape| {
        let mesh = shape.as_trimesh().expect("it is fixed");
        let area: f32 = mesh.triangles().map(|triangle| triangle.area()).sum();
        (mesh.indices().len(), area)
    };
    for (kind, content) in [
        ("polylist", "<vcount>4</vcount><p>9 0 9 1 9 2 9 3</p>"),
        ("polylist", "<vcount>3 3</vcount><p>9 0 9 1 9 2 9 0 9 2 9 3</p>"),
        ("polygons", "<p>9 0 9 1 9 2 9 3</p>"),
        ("trifans", "<p>9 0 9 1 9 2 9 3</p>"),
        ("tristrips", "<p>9 0 9 1 9 3 9 2</p>"),
        ("triangles", "<p>9 0 9 1 9 2 9 0 9 2 9 3</p>"),
    ] {
        let lines =
            "<lines count=\"1\"><input semantic=\"VERTEX\" source=\"#v\" offset=\"0\"/><p>0 1</p></lines>";
        let primitive = format!("{lines}<{kind} count=\"1\">{input}{content}</{kind}>");
        let scene = load(&dae(points, &primitive, "", "")).unwrap_or_else(|error| panic!("{kind}: {error}"));
        assert_eq!(square(&scene.bodies[0].colliders[0].shape), (2, 1.0), "{kind}");
    }
}

#[test]
fn a_file_that_is_broken_or_endless_is_refused_by_name() {
    let node = format!("<node>{INSTANCE}</node>");
    let whole = dae(POINTS, TRIANGLES, &node, "");
    assert_eq!(boxes(&whole).len(), 1);
    let nested = "<node>".repeat(100_000) + INSTANCE + &"</node>".repeat(100_000);
    // Each node instances the next one twice.
    let doubling: String = (0..40)
        .map(|level| {
            let next = format!("<instance_node url=\"#n{}\"/>", level + 1);
            format!("<node id=\"n{level}\">{next}{next}</node>")
        })
        .collect();
    let doubling = format!("<library_nodes>{doubling}<node id=\"n40\"/></library_nodes>");
    let itself = "<node id=\"i\"><instance_node url=\"#i\"/></node>";
    for (cause, broken) in [
        ("m.dae:6: a triangle has vertex 9 of 4", whole.replace("0 2 1 0", "0 9 1 0")),
        ("m.dae:7: <p> has `-1` where a number", whole.replace("0 2 1 0", "0 -1 1 0")),
        ("m.dae:3: <float_array> has `x` where a number", whole.replace(POINTS, "0 0 x")),
        ("m.dae: a vertex of it is not finite", whole.replace(POINTS, "0 0 0 nan 0 0 0 1 0 0 0 1")),
        ("m.dae:4: its vertices have 2 coordinates", whole.replace("stride=\"3\"", "stride=\"2\"")),
        (
            "m.dae:4: <accessor> names <float_array> `#b`",
            whole.replace("accessor source=\"#a\"", "accessor source=\"#b\""),
        ),
        ("m.dae:5: <vertices> has no <input> of POSITION", whole.replace("POSITION", "NORMAL")),
        ("m.dae:3: <geometry> has no <mesh>", whole.replace("mesh>", "spline>")),
        ("m.dae:6: <triangles> has no <input> of VERTEX", whole.replace("VERTEX", "NORMAL")),
        (
            "it has fewer corners than <vcount>",
            whole.replace("<p>", "<vcount>3 99</vcount><p>").replace("triangles", "polylist"),
        ),
        ("m.dae:7: polygons with holes cannot be read", whole.replace("<p>", "<ph/><p>")),
        ("<instance_geometry> names <geometry> `#u`", whole.replace("#t", "#u")),
        ("<translate> has 2 numbers, not 3", whole.replace("<node>", "<node><translate>1 2</translate>")),
        ("a mesh on a skeleton", whole.replace("<node>", "<node><instance_controller url=\"#c\"/>")),
        ("m.dae:2: its unit is not a length", whole.replace("meter=\".5\"", "meter=\"-1\"")),
        ("m.dae: it has no triangle", whole.replace("<p>0 2 1 0 1 3 0 3 2 1 2 3</p>", "<p/>")),
        ("this is not XML", whole.replace("</COLLADA>", "")),
        ("more than 256 elements lie in one another", whole.replace(&node, &nested)),
        (
            "more than 16 MiB of nodes",
            dae(POINTS, TRIANGLES, "<node><instance_node url=\"#n0\"/></node>", &doubling),
        ),
        ("more than 16 MiB of nodes", dae(POINTS, TRIANGLES, itself, "")),
    ] {
        let error = load(&broken).map(|scene| scene.bodies.len()).unwrap_err().to_string();
        assert!(error.contains(cause), "{cause}: {error}");
    }
}
