//! Which real files are tried.

use std::path::{Path, PathBuf};

/// A real file and how it is run.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Real {
    /// In `dcd/scenes/models/` for those that are shipped, in an unpacked wheel for the others.
    pub(crate) path: &'static str,
    /// `--set`s, apart by spaces.
    pub(crate) params: &'static str,
    /// Whether all of it ends up standing or lying on the ground, so that the ground bears its weight.
    pub(crate) rests: bool,
}

const fn rests(path: &'static str, params: &'static str) -> Real {
    Real { path, params, rests: true }
}

const fn hangs(path: &'static str, params: &'static str) -> Real {
    Real { path, params, rests: false }
}

/// In the repository, with their licences beside them.
pub(crate) const SHIPPED: [Real; 5] = [
    rests("gymnasium/ant.xml", ""),
    rests("gymnasium/humanoid.xml", ""),
    rests("dm_control/walker.xml", ""),
    rests("bullet/jenga.urdf", "ground=1"),
    rests("bullet/quadruped.urdf", "ground=1"),
];

/// From the wheels of [`WHEELS`], by the path inside.
pub(crate) const FETCHED: [Real; 20] = [
    rests("gymnasium/envs/mujoco/assets/ant.xml", ""),
    rests("gymnasium/envs/mujoco/assets/half_cheetah.xml", ""),
    rests("gymnasium/envs/mujoco/assets/humanoidstandup.xml", ""),
    rests("gymnasium/envs/mujoco/assets/walker2d_v5.xml", ""),
    hangs("gymnasium/envs/mujoco/assets/inverted_double_pendulum.xml", ""),
    hangs("gymnasium/envs/mujoco/assets/pusher_v5.xml", ""),
    rests("dm_control/suite/humanoid_CMU.xml", ""),
    rests("dm_control/suite/dog.xml", ""),
    rests("dm_control/suite/quadruped.xml", ""),
    hangs("dm_control/suite/manipulator.xml", ""),
    hangs("dm_control/third_party/kinova/jaco_arm.xml", ""),
    rests("pybullet_data/r2d2.urdf", "ground=1"),
    rests("pybullet_data/humanoid/humanoid.urdf", "ground=1"),
    rests("pybullet_data/laikago/laikago_toes.urdf", "ground=1"),
    rests("pybullet_data/a1/a1.urdf", "ground=1"),
    rests("pybullet_data/mini_cheetah/mini_cheetah.urdf", "ground=1"),
    rests("pybullet_data/racecar/racecar.urdf", "ground=1"),
    rests("pybullet_data/quadruped/minitaur.urdf", "ground=1"),
    hangs("pybullet_data/kuka_iiwa/model.urdf", "fixed=1"),
    hangs("pybullet_data/franka_panda/panda.urdf", "fixed=1"),
];

/// What `pip download` is asked for; pybullet has wheels for some versions of Python only.
pub(crate) const WHEELS: [&[&str]; 3] = [
    &["gymnasium==1.4.0"],
    &["dm_control==1.0.50"],
    &[
        "pybullet==3.2.7",
        "--python-version",
        "3.9",
        "--only-binary",
        ":all:",
        "--platform",
        "manylinux2014_x86_64",
    ],
];

/// The folder of the shipped files.
pub(crate) fn shipped() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../dcd/scenes/models")
}
