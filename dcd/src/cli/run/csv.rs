//! Writes the state of all movable bodies as CSV.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use crate::cli::draft::Draft;
use crate::cli::failure::Failure;
use crate::physics::Measured;

const HEADER: &str = "id,x,y,z,qx,qy,qz,qw,vx,vy,vz,wx,wy,wz,region";

/// A file that could be written to before the run began.
pub(super) struct Target(Draft);

impl Target {
    /// Checks that the file can be written, so that a wrong path does not cost a long run. Its content stays
    /// until the run is over.
    pub(super) fn check(path: PathBuf) -> Result<Self, Failure> {
        Draft::check(path.clone()).map(Self).map_err(|error| Failure::usage(refused(&path, &error)))
    }

    pub(super) fn write(&self, world: &impl Measured) -> Result<(), Failure> {
        let written = self.0.write(|path| write_states(BufWriter::new(File::create(path)?), world));
        written.map_err(|error| Failure::run(refused(self.0.path(), &error)))
    }
}

fn refused(path: &Path, error: &io::Error) -> String {
    format!(
        "cannot write {}: {error}; give --out a file in a folder that exists and that you may write to",
        path.display()
    )
}

/// Writes bodies in id order; every number is the shortest text that reads back to the same bits.
fn write_states(mut to: impl Write, world: &impl Measured) -> io::Result<()> {
    writeln!(to, "{HEADER}")?;
    for (id, region, pose, velocity) in world.states() {
        write!(to, "{}", id.bits())?;
        for v in pose.translation {
            write!(to, ",{v}")?;
        }
        for v in pose.rotation.iter().chain(&velocity.linear).chain(&velocity.angular) {
            write!(to, ",{v}")?;
        }
        writeln!(to, ",{}", region.0)?;
    }
    to.flush()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Params, Scene};

    #[test]
    fn numbers_read_back_to_the_same_bits() {
        let mut world = Scene::named("gas", &Params::new().with("n", 3)).unwrap().bare_world();
        for _ in 0..10 {
            world.step();
        }
        let mut text = Vec::new();
        write_states(&mut text, &world).unwrap();
        let text = String::from_utf8(text).unwrap();
        let rows: Vec<Vec<&str>> = text.lines().skip(1).map(|line| line.split(',').collect()).collect();
        assert_eq!(rows.len(), 3);
        for (row, (id, _, pose, velocity)) in rows.iter().zip(world.states()) {
            assert_eq!(row.len(), HEADER.split(',').count());
            assert_eq!(row[0], id.bits().to_string());
            let place: Vec<f64> = row[1..4].iter().map(|v| v.parse().unwrap()).collect();
            assert_eq!(place, pose.translation);
            let rest: Vec<f32> = row[4..14].iter().map(|v| v.parse().unwrap()).collect();
            assert_eq!(rest, [&pose.rotation[..], &velocity.linear, &velocity.angular].concat());
        }
    }
}
