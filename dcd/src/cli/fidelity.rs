//! Defines the options of `dcd run` and `dcd serve` for how much of a world is computed in full.

use crate::cli::failure::Failure;
use crate::fidelity::Fidelity;
use crate::scene::Scene;
use crate::space::Viewpoint;

#[derive(clap::Args)]
pub(super) struct FidelityArgs {
    /// Compute in full only what is looked at. `auto` (or tolerance=M_S) steps all other regions as seldom as
    /// keeps the mean error of a body's velocity after a step below 0.33 m/s (or M_S); budget=MS steps them as
    /// seldom as keeps a tick within MS milliseconds; `off` computes everything in full [default: what the
    /// scene says, else off]
    #[arg(long, value_name = "HOW")]
    fidelity: Option<Fidelity>,
    /// Look at all that is within RADIUS metres of this point in world space; may be given several times. The
    /// clients of a served world look at it too, each at its area of interest. With `--fidelity off` it
    /// changes nothing [default: what the scene says, else everything or, in a served world, what its clients
    /// look at]
    #[arg(long, value_name = "X,Y,Z,RADIUS", allow_hyphen_values = true, value_parser = viewpoint)]
    viewpoint: Vec<Viewpoint>,
}

impl FidelityArgs {
    /// Returns the names of these options, and which are given.
    pub(super) fn given(&self) -> [(&'static str, bool); 2] {
        [("--fidelity", self.fidelity.is_some()), ("--viewpoint", !self.viewpoint.is_empty())]
    }

    /// Returns whether these options ask that not everything be computed in full.
    pub(super) fn is_on(&self) -> bool {
        self.fidelity.is_some_and(|fidelity| fidelity != Fidelity::Off)
    }

    /// Sets the fidelity and the viewpoints of a scene as these options say.
    pub(super) fn apply(&self, scene: &mut Scene) -> Result<(), Failure> {
        scene.fidelity = self.fidelity.unwrap_or(scene.fidelity);
        if !self.viewpoint.is_empty() {
            // Who asks for `off` may compare it with others by the same line.
            if self.fidelity.is_none() && scene.fidelity == Fidelity::Off {
                return Err(Failure::usage(
                    "--viewpoint says what is computed in full, and without a fidelity all is; add --fidelity auto, or leave it out",
                ));
            }
            scene.viewpoints.clone_from(&self.viewpoint);
        }
        Ok(())
    }
}

fn viewpoint(text: &str) -> Result<Viewpoint, String> {
    let numbers: Vec<f64> = text.split(',').filter_map(|number| number.trim().parse().ok()).collect();
    match numbers[..] {
        [x, y, z, radius_m]
            if text.split(',').count() == 4 && numbers.iter().all(|v| v.is_finite()) && radius_m >= 0.0 =>
        {
            Ok(Viewpoint { at: [x, y, z], radius_m })
        }
        _ => Err("write three coordinates and how far is looked, in metres, as 10,2,-5,50".to_owned()),
    }
}
