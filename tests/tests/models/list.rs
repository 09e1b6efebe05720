//! Lists the real model files of the tests.

use std::path::{Path, PathBuf};

/// A real file, and how it is run.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Real {
    /// The path: in `dcd/scenes/models/` for shipped files, in an unpacked wheel for the others.
    pub(crate) path: &'static str,
    /// The parameters of `--set`, separated by spaces.
    pub(crate) params: &'static str,
    /// The mass of all that can move, kilograms: for MJCF as MuJoCo 3 computes it, for URDF by the numbers of
    /// the file.
    pub(crate) mass_kg: f64,
    /// Says whether all of it ends up standing or lying on the ground, so that the ground bears its weight.
    pub(crate) rests: bool,
}

const fn rests(path: &'static str, mass_kg: f64, params: &'static str) -> Real {
    Real { path, params, mass_kg, rests: true }
}

const fn hangs(path: &'static str, mass_kg: f64, params: &'static str) -> Real {
    Real { path, params, mass_kg, rests: false }
}

/// The files in the repository, with their licences beside them.
pub(crate) const SHIPPED: [Real; 5] = [
    rests("gymnasium/ant.xml", 0.91088, ""),
    rests("gymnasium/humanoid.xml", 42.11603, ""),
    rests("dm_control/walker.xml", 28.54032, ""),
    rests("bullet/jenga.urdf", 0.05, "ground=1"),
    rests("bullet/quadruped.urdf", 6.0, "ground=1"),
];

/// The files from the wheels of [`WHEELS`], by their paths inside.
pub(crate) const FETCHED: [Real; 20] = [
    rests("gymnasium/envs/mujoco/assets/ant.xml", 0.91088, ""),
    rests("gymnasium/envs/mujoco/assets/half_cheetah.xml", 14.0, ""),
    rests("gymnasium/envs/mujoco/assets/humanoidstandup.xml", 42.11603, ""),
    rests("gymnasium/envs/mujoco/assets/walker2d_v5.xml", 23.67714, ""),
    hangs("gymnasium/envs/mujoco/assets/inverted_double_pendulum.xml", 18.86945, ""),
    hangs("gymnasium/envs/mujoco/assets/pusher_v5.xml", 13.673, ""),
    rests("dm_control/suite/humanoid_CMU.xml", 51.84594, ""),
    rests("dm_control/suite/dog.xml", 10.29694, ""),
    rests("dm_control/suite/quadruped.xml", 121.25507, ""),
    hangs("dm_control/suite/manipulator.xml", 0.34122, ""),
    hangs("dm_control/third_party/kinova/jaco_arm.xml", 2.92866, ""),
    rests("pybullet_data/r2d2.urdf", 65.25, "ground=1"),
    rests("pybullet_data/humanoid/humanoid.urdf", 45.0001, "ground=1"),
    rests("pybullet_data/laikago/laikago_toes.urdf", 25.567, "ground=1"),
    rests("pybullet_data/a1/a1.urdf", 12.458, "ground=1"),
    rests("pybullet_data/mini_cheetah/mini_cheetah.urdf", 8.852, "ground=1"),
    rests("pybullet_data/racecar/racecar.urdf", 5.89223, "ground=1"),
    rests("pybullet_data/quadruped/minitaur.urdf", 6.0, "ground=1"),
    hangs("pybullet_data/kuka_iiwa/model.urdf", 17.5, "fixed=1"),
    hangs("pybullet_data/franka_panda/panda.urdf", 15.06, "fixed=1"),
];

/// The arguments of `pip download`. pybullet has wheels for some versions of Python only.
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

/// Returns the folder of the shipped files.
pub(crate) fn shipped() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../dcd/scenes/models")
}
