//! Implements `dcd client`: lets avatars wander through a served world, for load.

use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use rapier3d::prelude::*;
use serde::Serialize;

use super::bandwidth::Report;
use super::common::{Common, print};
use super::failure::Failure;
use super::film::{Camera, FilmArgs};
use super::interrupt::Interrupt;
use super::join_token::TokenArgs;
use super::summary::Summary;
use super::truth::Truth;
use super::values::{SERVER, address, joining, positive, reachable, speed, wall_seconds};
use super::view::{self, ANY_PORT};
use crate::Viewer;
use crate::drawing::Told;
use crate::net::Token;
use crate::protocol::{Area, BodyKind, Velocity, WorldPose};
use crate::runtime::{ClientWorld, JoinConfig, ProcessError};
use crate::scene::Dice;
use crate::space::{BodyId, Bounds};

/// The interval at which Ctrl-C is looked for while the world stands still.
const LOOK: Duration = Duration::from_millis(100);
/// The time after which an avatar that has not reached its goal chooses another.
const PATIENCE: Duration = Duration::from_secs(10);
/// The time after joining from which on the transfer of the whole world no longer counts as traffic.
const SETTLED: Duration = Duration::from_millis(500);
/// The shortest time over which traffic is measured: it is known with a delay of a tenth of a second.
const MEASURED: Duration = Duration::from_millis(400);
/// Half the edge of an avatar's box.
const HALF_M: f32 = 0.4;

/// Moves avatars through the world that a server holds
///
/// Each avatar is a box that goes from one random place to the next and pushes what is in its way.
///
/// Example:
///   dcd client --token $(dcd token --role client) --avatars 10 --seconds 60
#[derive(clap::Args)]
#[command(
    verbatim_doc_comment,
    after_long_help = "Prints `joined as CLIENT` first, `listening ADDR` next with --compute, and a summary last; with --json as an object\n\
                       with the keys client avatars updates contacts refusals moved_m seconds bytes_in bytes_per_s bytes_per_moving_body_s\n\
                       staleness_ms {p50 p99} shown_behind_ms input_delay_ms corrections largest_correction_mm predicted_ticks outside;\n\
                       --truth adds shown_error_mm {p50 p99}, --bandwidth adds bandwidth {messages fields bodies}. Bytes per second leave out\n\
                       the first half second, in which the world arrives. What was not measured is null, as they are after less than a\n\
                       second. A server that is out of reach is dialled again; the avatars go on as long as nodes compute the world."
)]
pub(super) struct Client {
    /// The server's address; with standby servers (`dcd serve --directory`) all addresses, separated by
    /// commas
    #[arg(long, value_name = "ADDR", default_value = SERVER, value_parser = address, value_delimiter = ',')]
    server: Vec<SocketAddr>,
    #[command(flatten)]
    token: TokenArgs,
    /// How many avatars
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(0..=1024))]
    avatars: u16,
    /// How long to stay, in seconds [default: until Ctrl-C]
    #[arg(long, value_name = "S", value_parser = wall_seconds)]
    seconds: Option<Duration>,
    /// How fast avatars go, m/s
    #[arg(long, value_name = "M_S", default_value_t = 3.0, value_parser = speed)]
    speed: f32,
    /// Hear only of bodies within so many metres of the first avatar, or of the middle of the world without
    /// one
    #[arg(long, value_name = "M", value_parser = positive)]
    interest: Option<f32>,
    /// Compute a share of the world, too, as players' machines do
    #[arg(long)]
    compute: bool,
    /// With --compute: where to listen for other nodes and clients [default: any free port]
    #[arg(long, value_name = "ADDR", value_parser = address, requires = "compute")]
    listen: Option<SocketAddr>,
    /// With --compute: the address at which others reach this process, if not the one it listens on
    #[arg(long, value_name = "ADDR", value_parser = reachable, requires = "compute")]
    advertise: Option<SocketAddr>,
    /// Time to wait for a server that is out of reach after joining, in seconds [default: 30; with --compute without end]
    #[arg(long, value_name = "SECONDS", value_parser = wall_seconds)]
    give_up: Option<Duration>,
    /// File that keeps the client's identity: with it, and a new token for each start, the client goes on with
    /// the same avatars, where they were
    #[arg(long, value_name = "FILE")]
    identity: Option<PathBuf>,
    /// Ask for no more than so many bytes per second of states of bodies [default: as many as the link carries]
    #[arg(long, value_name = "BYTES_PER_S", value_parser = clap::value_parser!(u32).range(1..))]
    limit: Option<u32>,
    /// Show avatars in the last state received, instead of predicting them
    #[arg(long)]
    no_prediction: bool,
    /// Print what the bytes were for, too: by message, by field of states, and by body
    #[arg(long)]
    bandwidth: bool,
    /// Join once more with this token, another of `dcd token --role client`, and say how far bodies are shown
    /// from where that link says they are, which has no limit; between states both are interpolated
    #[arg(long, value_name = "TOKEN")]
    truth: Option<String>,
    /// Show what this client is told in the browser: serve a page at this address, or at any free port of
    /// this machine if none is given, and print its URL on standard error
    #[arg(long, value_name = "ADDR", num_args = 0..=1, default_missing_value = ANY_PORT, value_parser = address)]
    view: Option<SocketAddr>,
    #[command(flatten)]
    film: FilmArgs,
    /// Print the summary as one JSON object
    #[arg(long)]
    json: bool,
}

/// The summary that `dcd client` prints at its end.
#[derive(Serialize)]
struct Played {
    client: String,
    avatars: usize,
    updates: u64,
    contacts: u64,
    refusals: u64,
    moved_m: f64,
    seconds: f64,
    bytes_in: u64,
    /// `None` after too short a stay.
    bytes_per_s: Option<f64>,
    /// `None` where nothing moved, too.
    bytes_per_moving_body_s: Option<f64>,
    /// The age of the newest state of a moving body when it was looked at.
    staleness_ms: Option<Percentiles>,
    /// How far bodies that move were shown from where they were, if asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    shown_error_mm: Option<Percentiles>,
    /// The mean time by which the shown state was behind the world.
    shown_behind_ms: Option<f64>,
    /// From an input to the first state that shows it.
    input_delay_ms: Option<f64>,
    /// The number of times that avatars, or bodies that they touch, turned out to be shown more than 2 cm
    /// off.
    corrections: u64,
    largest_correction_mm: f64,
    predicted_ticks: u64,
    outside: usize,
    /// Only if asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    bandwidth: Option<Report>,
}

#[derive(Clone, Copy, Serialize)]
struct Percentiles {
    p50: f64,
    p99: f64,
}

impl Percentiles {
    /// Returns the percentiles of sorted numbers; `None` if there are none.
    fn of(numbers: &[f32]) -> Option<Self> {
        let last = numbers.len().checked_sub(1)?;
        let at = |share: f64| f64::from(numbers[(share * last as f64) as usize]);
        Some(Self { p50: at(0.5), p99: at(0.99) })
    }
}

impl Summary for Played {
    fn rows(&self) -> Vec<(&'static str, String)> {
        let mut rows = vec![
            ("client", self.client.clone()),
            (
                "avatars",
                format!("{}, which moved {:.1} m in {:.1} s", self.avatars, self.moved_m, self.seconds),
            ),
            ("updates", self.updates.to_string()),
            ("contacts", format!("{} beginnings and ends", self.contacts)),
            ("refusals", self.refusals.to_string()),
            ("traffic", or_none(self.bytes_per_s, " bytes per second")),
            ("moving body", or_none(self.bytes_per_moving_body_s, " bytes per second")),
            (
                "newest states",
                self.staleness_ms.map_or("nothing moved".into(), |age| {
                    format!("{:.0} ms old, {:.0} for one in a hundred (p99)", age.p50, age.p99)
                }),
            ),
            (
                "shown off",
                self.shown_error_mm.map_or("unknown: without --truth, or nothing moved".into(), |error| {
                    format!("{:.1} mm, {:.1} for one picture in a hundred (p99)", error.p50, error.p99)
                }),
            ),
            ("shown", or_none(self.shown_behind_ms, " ms behind the world")),
            ("inputs", or_none(self.input_delay_ms, " ms until a state shows them")),
            (
                "predicted",
                format!(
                    "{} ticks, with {} corrections above 20 mm, the largest {:.0} mm",
                    self.predicted_ticks, self.corrections, self.largest_correction_mm
                ),
            ),
            ("bytes in", format!("{}, with {} bodies outside its interest", self.bytes_in, self.outside)),
        ];
        rows.extend(self.bandwidth.iter().flat_map(Report::rows));
        rows
    }
}

fn or_none(value: Option<f64>, unit: &str) -> String {
    value.map_or("–".into(), |value| format!("{value:.0}{unit}"))
}

/// The ages of states at the times when they are looked at.
#[derive(Default)]
struct Watch {
    looks: u64,
    moving: u64,
    stale_ms: Vec<f32>,
    behind_ms: f64,
    input_delay_ms: Option<f64>,
}

/// The most ages of states that are kept: an hour of some hundred bodies.
const AGES: usize = 4 << 20;

impl Watch {
    fn look(&mut self, world: &mut ClientWorld, dt_s: f64) {
        let Some(time) = world.view_time() else { return };
        let tick_ms = 1e3 * dt_s;
        self.looks += 1;
        self.behind_ms += (time.now - time.shown) * tick_ms;
        self.input_delay_ms = time.input_delay_s.map(|seconds| 1e3 * seconds).or(self.input_delay_ms);
        world.with_bodies(|view| {
            let moves =
                !view.outside && !view.body.state.sleeping && view.body.traits.kind == BodyKind::Dynamic;
            if moves {
                self.moving += 1;
                if self.stale_ms.len() < AGES {
                    self.stale_ms.push(((time.now - view.tick.0 as f64) * tick_ms) as f32);
                }
            }
            None::<()>
        });
    }

    fn staleness(&self) -> Option<Percentiles> {
        let mut ages = self.stale_ms.clone();
        ages.sort_unstable_by(f32::total_cmp);
        Percentiles::of(&ages)
    }

    fn moving(&self) -> Option<f64> {
        (self.moving > 0).then(|| self.moving as f64 / self.looks as f64)
    }
}

impl Client {
    pub(super) fn execute(self, common: &Common) -> Result<ExitCode, Failure> {
        let interrupt = Interrupt::listen()?;
        let (json, bandwidth, compute, limit) = (self.json, self.bandwidth, self.compute, self.seconds);
        let join = JoinConfig {
            identity: self.identity,
            give_up: self.give_up,
            // Later it follows the first avatar.
            interest: self.interest.map(|radius| Area { centre: [0.0; 3], radius_m: radius.into() }),
            listen: self.listen,
            advertise: self.advertise,
            ..joining(&self.server, interrupt.at_once(|| self.token.read(true))?)
        };
        if let Some(truth) = self.truth.as_ref().filter(|truth| **truth == join.token)
            && truth.parse::<Token>().is_ok_and(|token| token.uses() == 1)
        {
            return Err(Failure::usage(
                "--truth has the token of --token, which lets one process join; give another of `dcd token --role client`",
            ));
        }
        let truth =
            self.truth.map(|token| JoinConfig { give_up: self.give_up, ..joining(&self.server, token) });
        // Everything that may fail here comes before the token is used up.
        let name = format!("a client of {}", self.server[0]);
        let viewer = self.view.map(|at| view::open(at, &name, common)).transpose()?;
        let camera = self.film.open()?;
        let enter = if compute { ClientWorld::participate } else { ClientWorld::connect };
        let mut world = interrupt.at_once(|| enter(&join))?;
        world.set_prediction(!self.no_prediction);
        print(&format!("joined as {}", world.id()))?;
        if let Some(address) = world.address() {
            print(&format!("listening {address}"))?;
        }
        world.limit(self.limit)?;
        let mut crowd = Crowd::enter(world, self.avatars.into(), self.speed, self.interest.map(f64::from))?;
        crowd.viewer = viewer;
        crowd.camera = camera;
        crowd.truth = truth.map(|join| ClientWorld::connect(&join)).transpose()?.map(Truth::of);
        let end = loop {
            let late = limit.is_some_and(|limit| crowd.start.elapsed() >= limit);
            if late || interrupt.asked() {
                break Ok(());
            }
            if let Err(error) = crowd.step() {
                break Err(error);
            }
        };
        let seconds = crowd.start.elapsed().as_secs_f64();
        let camera = crowd.camera.take();
        let filmed = camera
            .map(|camera| camera.finish(Told::of(&mut crowd.world).as_ref(), seconds, common))
            .transpose();
        crowd.played(bandwidth).show(json)?;
        filmed?;
        if let Some(truth) = crowd.truth.take() {
            truth.leave();
        }
        if interrupt.asked() {
            common.say("leaving: the avatars wait at the server");
            // A user who asked to leave does not mind that the world has ended meanwhile.
            return match crowd.world.leave() {
                Ok(_) | Err(ProcessError::ServerGone { .. }) => Ok(interrupt.exit_code()),
                Err(error) => Err(error.into()),
            };
        }
        end?;
        crowd.world.leave()?;
        Ok(interrupt.exit_code())
    }
}

/// A client's avatars and their goals.
struct Crowd {
    world: ClientWorld,
    bounds: Bounds,
    speed_m_s: f32,
    interest_m: Option<f64>,
    dice: Dice,
    start: Instant,
    walkers: BTreeMap<BodyId, Walker>,
    contacts: u64,
    refusals: u64,
    moved_m: f64,
    watch: Watch,
    truth: Option<Truth>,
    viewer: Option<Viewer>,
    camera: Option<Camera>,
    dt_s: f64,
    /// The time when the whole world had arrived, and the bytes received until then.
    bytes_since: Option<(Instant, u64)>,
}

struct Walker {
    goal: [f64; 3],
    since: Instant,
    seen: Option<[f64; 3]>,
}

impl Crowd {
    /// Enters the world: avatars of an earlier stay go on; only missing ones are created.
    fn enter(
        mut world: ClientWorld,
        count: usize,
        speed_m_s: f32,
        interest_m: Option<f64>,
    ) -> Result<Self, Failure> {
        let environment = world.environment().ok_or(ProcessError::Stopped)?;
        let limit = environment.avatar_speed_limit;
        if speed_m_s > limit {
            return Err(Failure::usage(format!(
                "this world lets avatars go {limit} m/s at most, not {speed_m_s}; give a lower --speed"
            )));
        }
        let bounds = environment.tree.bounds();
        // Different clients go different ways.
        let mut dice = Dice::new(world.id().0.into());
        let former = world.own_avatars();
        let missing = count.saturating_sub(former.len());
        let mut avatars = former;
        let half = Vector::splat(HALF_M);
        let body = RigidBodyBuilder::kinematic_velocity_based();
        let collider =
            ColliderBuilder::cuboid(half.x, half.y, half.z).active_events(ActiveEvents::COLLISION_EVENTS);
        for _ in 0..missing {
            let place = somewhere(&bounds, &mut dice);
            avatars.push(world.spawn(
                WorldPose::at(place),
                &body.build(),
                std::slice::from_ref(&collider),
            )?);
        }
        let start = Instant::now();
        let walkers = avatars
            .into_iter()
            .map(|id| (id, Walker { goal: somewhere(&bounds, &mut dice), since: start, seen: None }))
            .collect();
        let (contacts, refusals, moved_m) = (0, 0, 0.0);
        let (watch, dt_s) = (Watch::default(), f64::from(environment.step.dt_s));
        Ok(Self {
            world,
            bounds,
            speed_m_s,
            interest_m,
            dice,
            start,
            walkers,
            contacts,
            refusals,
            moved_m,
            watch,
            truth: None,
            viewer: None,
            camera: None,
            dt_s,
            bytes_since: None,
        })
    }

    /// Waits for news of the world and sends each avatar's input.
    fn step(&mut self) -> Result<(), ProcessError> {
        let seen = self.world.updates();
        self.world.wait_update(seen, LOOK);
        self.world.check()?;
        if self.bytes_since.is_none() && self.start.elapsed() > SETTLED {
            self.bytes_since = Some((Instant::now(), self.world.traffic().udp_bytes_in));
        }
        self.watch.look(&mut self.world, self.dt_s);
        if let Some(truth) = &mut self.truth {
            truth.look(&mut self.world, self.dt_s);
        }
        let events = self.world.take_events();
        self.contacts += events.touches.len() as u64;
        self.refusals += events.refusals.len() as u64;
        if let Some(viewer) = &mut self.viewer {
            viewer.show_client(&mut self.world, &events.handovers);
        }
        if let Some(camera) = &mut self.camera
            && let Some(told) = Told::of(&mut self.world)
        {
            camera.look(&told, self.start.elapsed().as_secs_f64());
        }
        if let Some(radius_m) = self.interest_m {
            let first = self.walkers.keys().next().and_then(|&first| self.world.body(first));
            let centre = first.map_or(self.bounds.centre(), |body| body.body.state.pose.translation);
            self.world.turn_to(Some(Area { centre, radius_m }))?;
        }
        for (&id, walker) in &mut self.walkers {
            let Some(body) = self.world.body(id) else { continue };
            let place = body.body.state.pose.translation;
            self.moved_m += walker.seen.map_or(0.0, |former| distance_m(former, place));
            walker.seen = Some(place);
            let left_m = distance_m(place, walker.goal);
            if left_m < 1.0 || walker.since.elapsed() > PATIENCE {
                *walker = Walker {
                    goal: somewhere(&self.bounds, &mut self.dice),
                    since: Instant::now(),
                    seen: walker.seen,
                };
            }
            let towards = std::array::from_fn(|i| walker.goal[i] - place[i]);
            self.world.send_input(id, pace(towards, self.speed_m_s), None)?;
        }
        Ok(())
    }

    fn played(&self, bandwidth: bool) -> Played {
        let bytes_in = self.world.traffic().udp_bytes_in;
        let seconds = self.start.elapsed().as_secs_f64();
        let bytes_per_s = self.bytes_since.and_then(|(since, before)| {
            let measured = since.elapsed();
            (measured >= MEASURED).then(|| (bytes_in - before) as f64 / measured.as_secs_f64())
        });
        let predicted = self.world.prediction().unwrap_or_default();
        Played {
            client: self.world.id().to_string(),
            avatars: self.world.own_avatars().len(),
            updates: self.world.updates(),
            contacts: self.contacts,
            refusals: self.refusals,
            moved_m: self.moved_m,
            seconds,
            bytes_in,
            bytes_per_s,
            bytes_per_moving_body_s: bytes_per_s
                .zip(self.watch.moving())
                .map(|(bytes, moving)| bytes / moving),
            staleness_ms: self.watch.staleness(),
            shown_error_mm: self.truth.as_ref().and_then(|truth| Percentiles::of(&truth.errors_mm())),
            shown_behind_ms: (self.watch.looks > 0).then(|| self.watch.behind_ms / self.watch.looks as f64),
            input_delay_ms: self.watch.input_delay_ms,
            corrections: predicted.corrections,
            largest_correction_mm: 1e3 * predicted.largest_correction_m,
            predicted_ticks: predicted.ticks,
            outside: self.world.with_bodies(|body| body.outside.then_some(())).len(),
            bandwidth: bandwidth.then(|| Report::of(&self.world.bandwidth())),
        }
    }
}

/// Returns a random place near the ground of the world's box, where most things are.
fn somewhere(bounds: &Bounds, dice: &mut Dice) -> [f64; 3] {
    let unit = [dice.between(0.05, 0.95), dice.between(0.0, 1.0), dice.between(0.05, 0.95)].map(f64::from);
    let size: [f64; 3] = std::array::from_fn(|i| bounds.max[i] - bounds.min[i]);
    let above_ground_m = (f64::from(HALF_M) + 0.1 + unit[1]).min(size[1]);
    [bounds.min[0] + unit[0] * size[0], bounds.min[1] + above_ground_m, bounds.min[2] + unit[2] * size[2]]
}

fn distance_m(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}

/// Returns a velocity of this speed in that direction.
fn pace(towards: [f64; 3], speed_m_s: f32) -> Velocity {
    let length = distance_m(towards, [0.0; 3]).max(1e-9);
    // A hair below the speed, so that rounding does not break the world's limit.
    let scale = f64::from(speed_m_s) * 0.999 / length;
    Velocity { linear: towards.map(|v| (v * scale) as f32), angular: [0.0; 3] }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn avatars_stay_inside_and_keep_the_speed() {
        let bounds = Bounds::new([-20.0, 0.0, -14.0], [20.0, 8.0, 14.0]);
        let mut dice = Dice::new(1);
        for _ in 0..100 {
            let place = somewhere(&bounds, &mut dice);
            assert!((0..3).all(|i| bounds.min[i] < place[i] && place[i] < bounds.max[i]), "{place:?}");
            let velocity = pace(place, 5.0).linear.map(f64::from);
            let speed = distance_m(velocity, [0.0; 3]);
            assert!((4.9..5.0).contains(&speed), "{speed}");
        }
        assert_eq!(pace([0.0; 3], 5.0).linear, [0.0; 3]);
    }
}
