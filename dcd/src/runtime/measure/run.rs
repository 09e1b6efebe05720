//! Steps a world, times the steps, and measures energy, penetration, owners and imbalance between them.

use std::collections::BTreeSet;
use std::ops::ControlFlow;
#[cfg(feature = "parallel")]
use std::sync::Arc;
use std::time::{Duration, Instant};

use rapier3d::prelude::{PhysicsWorld, RigidBodyType};

use super::report::{Chosen, FidelityShare, MeanMax, Report, StartEnd, StepTimes};
use crate::fidelity::FidelityReport;
#[cfg(feature = "parallel")]
use crate::physics::HostError;
use crate::physics::{ContactSample, Measured, View};
use crate::runtime::{Choice, LocalWorld, Stats, Why, WorldConfig, WorldError};
use crate::scene::Scene;
use crate::space::BodyId;

/// The world that is stepped.
pub enum Subject {
    /// One bare Rapier world, with none of our code in its step: the reference.
    Bare(Box<PhysicsWorld>),
    /// A world cut into regions.
    Regions(Box<LocalWorld>),
}

/// The plan of a run: how the world is cut and how many ticks it takes.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// The settings of the world; `None` means a bare Rapier world.
    pub config: Option<WorldConfig>,
    /// The number of steps.
    pub ticks: u64,
}

impl Plan {
    /// Returns the number of ticks in this many simulated seconds, at least one.
    pub fn ticks_of(seconds: f64, dt_s: f32) -> u64 {
        (seconds / f64::from(dt_s)).round().max(1.0) as u64
    }

    /// Makes the world as planned.
    pub fn subject(&self, scene: &Scene) -> Result<Subject, WorldError> {
        Ok(match &self.config {
            None => Subject::Bare(Box::new(scene.bare_world())),
            Some(config) => Subject::Regions(Box::new(LocalWorld::from_scene(scene, config.clone())?)),
        })
    }
}

impl Subject {
    /// Runs `work` on a thread of the bare world's pool, or of a pool of one thread. So a timed step wakes
    /// another thread only if that is worth it.
    pub fn at_home<R: Send>(&mut self, work: impl FnOnce(&mut Self) -> R + Send) -> Result<R, WorldError> {
        #[cfg(feature = "parallel")]
        {
            let own = match self {
                Self::Bare(world) => world.thread_pool(),
                Self::Regions(_) => None,
            };
            let one = || rayon::ThreadPoolBuilder::new().num_threads(1).build().map(Arc::new);
            let pool = own.map_or_else(one, Ok).map_err(|cause| HostError::Threads { threads: 1, cause })?;
            Ok(pool.install(|| work(self)))
        }
        #[cfg(not(feature = "parallel"))]
        {
            Ok(work(self))
        }
    }

    fn step(&mut self) -> Result<(), WorldError> {
        match self {
            Self::Bare(world) => world.step(),
            Self::Regions(world) => world.step()?,
        }
        Ok(())
    }

    fn stats(&self) -> Stats {
        match self {
            Self::Bare(_) => Stats::default(),
            Self::Regions(world) => world.stats(),
        }
    }

    /// Returns the load of the busiest region divided by the mean; 1 if there is no load.
    fn imbalance(&self) -> f64 {
        let Self::Regions(world) = self else { return 1.0 };
        let awake = world.regions().map(|region| region.physics().islands.active_bodies().count());
        let (sum, most) = awake.fold((0, 0), |(sum, most), count| (sum + count, most.max(count)));
        if sum == 0 { 1.0 } else { (most * world.regions().len()) as f64 / sum as f64 }
    }

    fn chosen(&self) -> Chosen {
        match self {
            Self::Bare(_) => Chosen { regions: 0, threads: 1, coupling: None, why: Why::Asked.to_string() },
            Self::Regions(world) => {
                let Choice { regions, threads, coupling, why } = world.chosen();
                Chosen { regions, threads, coupling: Some(coupling.name()), why: why.to_string() }
            }
        }
    }

    fn fidelity(&self) -> Option<FidelityReport> {
        match self {
            Self::Bare(_) => None,
            Self::Regions(world) => world.fidelity_report(),
        }
    }

    fn region_count(&self) -> usize {
        match self {
            Self::Bare(_) => 0,
            Self::Regions(world) => world.regions().len(),
        }
    }
}

impl Measured for Subject {
    fn views(&self) -> Vec<View<'_>> {
        match self {
            Self::Bare(world) => world.views(),
            Self::Regions(world) => world.views(),
        }
    }
}

/// The name, tick length and bodies of a run, for the report.
#[derive(Clone, Debug, PartialEq)]
pub struct Cast {
    /// The run's name in the report.
    pub name: String,
    /// Seconds per tick.
    pub dt_s: f32,
    /// All movable bodies that must be there, in id order.
    pub bodies: Vec<BodyId>,
}

impl Cast {
    /// Takes the bodies from the scene, not from the world: so a body that was never inserted counts as lost.
    pub fn of_scene(scene: &Scene) -> Self {
        let moves = |index: &usize| scene.bodies[*index].body.body_type != RigidBodyType::Fixed;
        let bodies = (0..scene.bodies.len()).filter(moves);
        let bodies = bodies.map(|index| BodyId::persistent(index as u32)).collect();
        Self { name: scene.name.clone(), dt_s: scene.dt_s, bodies }
    }

    /// Takes the bodies from a world as it is now, for example after it was restored.
    pub fn of_world(name: String, world: &LocalWorld) -> Self {
        let bodies = world.states().map(|(id, ..)| id).collect();
        Self { name, dt_s: world.host().settings().dt_s, bodies }
    }
}

/// Runs a subject by this plan. `after_step` gets the number of ticks done, outside the timed part, and may
/// end the run early. The report is then of what was done, with the last step in place of the last second.
pub fn run(
    cast: &Cast,
    plan: &Plan,
    subject: &mut Subject,
    after_step: impl FnMut(u64, &Subject) -> ControlFlow<()> + Send,
) -> Result<Report, WorldError> {
    subject.at_home(|subject| run_here(cast, plan, subject, after_step))?
}

fn run_here(
    cast: &Cast,
    plan: &Plan,
    subject: &mut Subject,
    mut after_step: impl FnMut(u64, &Subject) -> ControlFlow<()>,
) -> Result<Report, WorldError> {
    let second = Plan::ticks_of(1.0, cast.dt_s);
    let bodies = &cast.bodies;
    let (energy_j, momentum_kgms) = (subject.energy_j(), subject.momentum_kgms());
    let mut watch = Watch::default();
    let mut steps = Vec::new();
    for tick in 1..=plan.ticks {
        let start = Instant::now();
        subject.step()?;
        steps.push(start.elapsed());
        watch.step(subject);
        if tick + second > plan.ticks {
            watch.contacts.push(subject.contacts());
        }
        if tick % second == 0 {
            watch.census(subject, bodies);
        }
        if after_step(tick, subject).is_break() {
            break;
        }
    }
    watch.census(subject, bodies);
    let last = subject.contacts();
    if watch.contacts.is_empty() {
        watch.contacts.push(last);
    }
    let (ticks, wall_s) = (steps.len() as u64, steps.iter().sum::<Duration>().as_secs_f64());
    let settings = plan.config.as_ref();
    Ok(Report {
        scene: cast.name.clone(),
        bodies: bodies.len(),
        regions: subject.region_count(),
        threads: settings.map_or(1, |config| config.threads),
        coupling: settings.map(|config| config.step.coupling.name()),
        exchanges: settings.map_or(0, |config| config.step.exchanges),
        exchanges_mean: watch.exchanges as f64 / ticks as f64,
        disagreement_m_s: MeanMax {
            mean: watch.disagreement_sum / ticks as f64,
            max: watch.disagreement_max,
        },
        imbalance: MeanMax { mean: watch.imbalance_sum / ticks as f64, max: watch.imbalance_max },
        ticks,
        dt_s: cast.dt_s,
        wall_s,
        rtf: ticks as f64 * f64::from(cast.dt_s) / wall_s,
        step_ms: StepTimes::of(&steps),
        contacts: last.pairs,
        ghosts_mean: watch.ghosts as f64 / ticks as f64,
        transfers: subject.stats().transfers,
        energy_j: StartEnd { start: energy_j, end: subject.energy_j() },
        momentum_kgms: StartEnd { start: momentum_kgms, end: subject.momentum_kgms() },
        max_penetration_m: watch.contacts.iter().map(|c| c.max_penetration_m).fold(0.0, f64::max),
        ground_force_ratio: mean(watch.contacts.iter().map(ContactSample::ground_force_ratio)),
        lost: watch.lost,
        doubled: watch.doubled,
        quarantined: watch.quarantined.len(),
        state_hash: format!("{:016x}", subject.state_hash()),
        chosen: subject.chosen(),
        fidelity: subject.fidelity().map(FidelityShare::from),
    })
}

/// The measurements gathered between steps.
#[derive(Default)]
struct Watch {
    ghosts: usize,
    exchanges: usize,
    disagreement_sum: f64,
    disagreement_max: f64,
    imbalance_sum: f64,
    imbalance_max: f64,
    quarantined: BTreeSet<BodyId>,
    contacts: Vec<ContactSample>,
    lost: usize,
    doubled: usize,
}

impl Watch {
    fn step(&mut self, subject: &Subject) {
        let stats = subject.stats();
        let disagreement = f64::from(stats.disagreement_m_s);
        self.ghosts += stats.ghosts;
        self.exchanges += stats.exchanges;
        self.disagreement_sum += disagreement;
        self.disagreement_max = self.disagreement_max.max(disagreement);
        let imbalance = subject.imbalance();
        self.imbalance_sum += imbalance;
        self.imbalance_max = self.imbalance_max.max(imbalance);
        self.quarantined.extend(subject.quarantined());
    }

    fn census(&mut self, subject: &Subject, bodies: &[BodyId]) {
        let census = subject.census();
        self.lost = self.lost.max(census.lost(bodies));
        self.doubled = self.doubled.max(census.doubled());
    }
}

/// Returns the mean of the values that are `Some`; `None` when there are none.
fn mean(values: impl Iterator<Item = Option<f64>>) -> Option<f64> {
    let (count, sum) = values.flatten().fold((0u32, 0.0), |(count, sum), value| (count + 1, sum + value));
    (count > 0).then(|| sum / f64::from(count))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::runtime::Partitioning;
    use crate::scene::Params;

    fn report(scene: &Scene, config: Option<WorldConfig>, ticks: u64, end: u64) -> Report {
        let plan = Plan { config, ticks };
        let mut subject = plan.subject(scene).unwrap();
        let stop =
            |tick, _: &Subject| if tick == end { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
        run(&Cast::of_scene(scene), &plan, &mut subject, stop).unwrap()
    }

    #[test]
    fn one_region_does_what_the_bare_world_does() {
        let scene = Scene::named("tower", &Params::new()).unwrap();
        let bare = report(&scene, None, 200, 0);
        let one = report(&scene, Some(WorldConfig::for_scene(&scene)), 200, 0);
        assert_eq!((bare.regions, bare.coupling, bare.exchanges), (0, None, 0));
        assert_eq!((one.regions, one.coupling, one.exchanges), (1, Some("auto"), 4));
        let physics =
            |r: &Report| (r.energy_j, r.momentum_kgms, r.ground_force_ratio, r.max_penetration_m, r.contacts);
        assert_eq!(physics(&bare), physics(&one));
        assert_eq!(bare.state_hash, one.state_hash);
        assert!((bare.ground_force_ratio.unwrap() - 1.0).abs() < 0.01);
    }

    #[test]
    fn a_gas_across_four_regions_loses_no_body_and_has_no_ground() {
        let scene = Scene::named("gas", &Params::new().with("n", 100)).unwrap();
        let config = WorldConfig { partitioning: Partitioning::Regions(4), ..WorldConfig::for_scene(&scene) };
        let report = report(&scene, Some(config), 180, 0);
        assert_eq!((report.lost, report.doubled, report.quarantined), (0, 0, 0));
        assert_eq!((report.bodies, report.regions, report.ticks), (100, 4, 180));
        assert_eq!(report.ground_force_ratio, None);
        assert!(report.exchanges_mean >= 1.0 && report.exchanges_mean <= 4.0, "{report:?}");
        assert!(report.disagreement_m_s.max >= report.disagreement_m_s.mean, "{report:?}");
        assert!(report.transfers > 0 && report.ghosts_mean > 0.0, "{report:?}");
    }

    #[test]
    fn a_run_that_is_ended_early_reports_what_it_did() {
        let scene = Scene::named("tower", &Params::new()).unwrap();
        let report = report(&scene, None, 1_000_000, 100);
        assert_eq!(report.ticks, 100);
        assert!((report.ground_force_ratio.unwrap() - 1.0).abs() < 0.2);
        assert!(report.step_ms.p50.is_some());
    }
}
