//! Tests robots whose base has little or no mass, and a fixed joint to the link that has it: such robots are
//! usual in ROS.

use std::fs;
use std::path::PathBuf;

use crate::compare::{bare, regions, scene};

/// Writes a robot of 17 kg: a base of this `<inertial>`, fixed to a link of the rest of 16 kg, and a leg.
fn robot(folder: &tempfile::TempDir, inertial: &str, above: &str) -> PathBuf {
    let inertia = |mass: &str, [x, y, z]: [f32; 3]| {
        format!(
            r#"<inertial><mass value="{mass}"/><inertia ixx="{x}" ixy="0" ixz="0" iyy="{y}" iyz="0" izz="{z}"/></inertial>"#
        )
    };
    let shape = |size: &str| format!(r#"<collision><geometry><box size="{size}"/></geometry></collision>"#);
    let text = format!(
        r#"<robot name="r">{above}<link name="base">{inertial}{}</link>
        <link name="base_inertia">{}</link><joint name="j" type="fixed"><parent link="base"/><child link="base_inertia"/></joint>
        <link name="leg">{}{}</link><joint name="k" type="revolute"><parent link="base"/><child link="leg"/><origin xyz="0 .3 0"/>
        <axis xyz="1 0 0"/><limit lower="-1" upper="1"/></joint></robot>"#,
        shape(".5 .3 .2"),
        inertia("16", [0.2, 0.6, 0.6]),
        inertia("1", [0.02; 3]),
        shape(".1 .1 .3"),
    );
    let path = folder.path().join("robot.urdf");
    fs::write(&path, text).unwrap();
    path
}

#[test]
fn a_robot_whose_base_is_light_or_has_no_mass_falls_to_the_ground_and_lies_there() {
    let folder = tempfile::tempdir().unwrap();
    let light = r#"<inertial><mass value="1e-6"/><inertia ixx="1e-6" ixy="0" ixz="0" iyy="1e-6" iyz="0" izz="1e-6"/></inertial>"#;
    let floating = r#"<link name="root"/><joint name="r" type="floating"><parent link="root"/><child link="base"/></joint>"#;
    for (inertial, above, bodies) in [(light, "", 3), ("", floating, 4), ("", "", 3)] {
        let scene = scene(&robot(&folder, inertial, above), "ground=1 height=.5 sleep=0");
        assert_eq!(scene.bodies.len(), bodies, "{inertial}{above}: with the ground");
        for run in [bare(&scene, 6.0), regions(&scene, 2, false, 6.0)] {
            assert!((run.mass_kg - 17.0).abs() < 1e-3, "{inertial}{above}: {run:?}");
            assert!((run.ground.unwrap() - 1.0).abs() < 0.05, "{inertial}{above}: {run:?}");
            assert!(run.farthest_m < 0.1, "{inertial}{above}: {run:?}");
        }
    }
}
