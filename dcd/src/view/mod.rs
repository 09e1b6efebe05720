//! Shows a world in the browser: serves a page, which is part of the program, to this machine, and a stream
//! of pictures.
//!
//! The thread that steps the world calls [`Viewer`] between two steps. It copies what is seen only if
//! somebody waits for a picture, and hands it to a thread that encodes it once for all viewers. Each viewer
//! has a thread of its own, and is sent the newest picture when it asks for one. A slow browser thus sees
//! fewer pictures and holds up nobody.

mod control;
mod http;
mod hub;
mod page;
mod sample;
mod server;
mod wire;

use std::io;
use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::mpsc::{SyncSender, sync_channel};
use std::time::{Duration, Instant};

use ring::rand::{SecureRandom, SystemRandom};

use crate::cluster::TickStats;
use crate::drawing::{Hosts, Looker, Moment, Source, Told, Wishes};
use crate::physics::RegionHost;
use crate::priority::give_way;
use crate::protocol::Handover;
use crate::runtime::{ClientWorld, LocalWorld};
use crate::world::{Error, Instead, World};
pub(crate) use hub::Due;
use hub::Hub;
use sample::Sample;
use server::Server;
#[doc(hidden)]
pub use server::read_browser;
use wire::Hello;

/// The shortest time between two pictures.
const PERIOD: Duration = Duration::from_millis(30);
/// The least time between two looks at the world, in multiples of the time that a look takes. Viewers thus
/// cost the stepping thread less than two percent.
const SPARING: u32 = 60;
/// The longest such time: a look may have taken long only because the system paused its thread.
const MOST_SPARED: Duration = Duration::from_secs(1);
/// The interval at which the thread of a paused world checks whether the program is to end.
const LOOK: Duration = Duration::from_millis(50);

/// The error of a viewer that cannot be opened.
#[derive(Debug, thiserror::Error)]
#[error(
    "cannot show the world at {address}: {cause}; choose an address of this machine and a free port, or port 0 for any"
)]
pub struct ViewError {
    address: SocketAddr,
    cause: io::Error,
}

/// A viewer: a page in the browser that shows a local world.
///
/// ```no_run
/// use dcd::prelude::*;
///
/// let scene = Scene::open("tower", &Params::default())?;
/// let mut world = World::from_scene(&scene, WorldConfig::for_scene(&scene))?;
/// let mut viewer = dcd::Viewer::open(([127, 0, 0, 1], 0).into(), "tower")?;
/// println!("open {}", viewer.url());
/// loop {
///     world.step()?;
///     viewer.show(&world)?;
/// }
/// # #[allow(unreachable_code)]
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Viewer {
    hub: Arc<Hub>,
    server: Server,
    name: String,
    /// The first and the last tick of a recording.
    recorded: Option<[u64; 2]>,
    looker: Looker,
    encoder: SyncSender<Moment>,
    /// The earliest time of the next look at the world.
    due: Option<Instant>,
    /// The durations of the last looks.
    costs: [Duration; 4],
    /// The tick and the wishes of the last look.
    last: Option<(u64, Wishes)>,
    bytes: u64,
}

impl std::fmt::Debug for Viewer {
    fn fmt(&self, to: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        to.debug_struct("Viewer").field("address", &self.server.address()).finish_non_exhaustive()
    }
}

impl Viewer {
    /// Opens a viewer at an address of this machine; port 0 takes any free port. `name` is the name of the
    /// world on the page, which shows nothing until the first [`Viewer::show`].
    pub fn open(address: SocketAddr, name: &str) -> Result<Self, ViewError> {
        let error = |cause| ViewError { address, cause };
        let mut key = [0; 16];
        let random = SystemRandom::new().fill(&mut key);
        random.map_err(|_| error(io::Error::other("the system has no randomness")))?;
        let hub = Arc::new(Hub::new(data_encoding::HEXLOWER.encode(&key)));
        // One moment is encoded while the next is made.
        let (encoder, moments) = sync_channel::<Moment>(1);
        let encoding = Arc::clone(&hub);
        let encode = move || {
            give_way();
            moments.into_iter().for_each(|moment| encoding.publish(moment));
        };
        std::thread::Builder::new().name("dcd-view-encode".into()).spawn(encode).map_err(error)?;
        let server = Server::start(address, Arc::clone(&hub)).map_err(error)?;
        Ok(Self {
            hub,
            server,
            name: name.to_owned(),
            recorded: None,
            looker: Looker::default(),
            encoder,
            due: None,
            costs: [MOST_SPARED; 4],
            last: None,
            bytes: 0,
        })
    }

    /// Returns the address of the page, with the key that its stream asks for: whoever has it can look on.
    #[must_use]
    pub fn url(&self) -> String {
        format!("http://{}/?key={}", self.server.address(), self.hub.key)
    }

    /// Shows a local world as it is after a step; call it after each step. It costs nothing while no page is
    /// open, and less than two percent of the time while one is. Other roles are an error.
    pub fn show(&mut self, world: &World) -> Result<(), Error> {
        self.show_local(world.local("be shown by a viewer", Instead::LookLocal)?);
        Ok(())
    }

    /// Lets viewers pause the world and step it. [`Viewer::wait`] then waits until the next step is due.
    #[doc(hidden)]
    #[must_use]
    pub fn with_controls(self) -> Self {
        self.hub.give_controls();
        self
    }

    /// Shows a local world, as [`Viewer::show`].
    #[doc(hidden)]
    pub fn show_local(&mut self, world: &LocalWorld) {
        if !self.hub.is_viewed() {
            return;
        }
        let stats = world.stats();
        let sample = Sample {
            tick: stats.ticks,
            step_ms: stats.last_step.as_secs_f32() * 1e3,
            transfers: world.handovers().len() as u32,
            exchanges: stats.exchanges as u32,
            bytes: 0,
            disagreement_m_s: stats.disagreement_m_s,
        };
        self.hub.note(sample, world.handovers());
        self.look(world.host(), world.host().settings().dt_s);
    }

    /// Shows the regions that a node computes, with their ghosts, after a tick. `stats` are the numbers of
    /// that tick.
    #[doc(hidden)]
    pub fn show_node(&mut self, regions: &RegionHost, stats: &TickStats) {
        if !self.hub.is_viewed() {
            return;
        }
        let sample = Sample {
            tick: regions.tick().0,
            step_ms: stats.compute_us as f32 / 1e3,
            transfers: stats.transfers,
            exchanges: stats.exchanges,
            bytes: 0,
            disagreement_m_s: stats.disagreement_m_s,
        };
        self.hub.note(sample, &[]);
        self.look(regions, regions.settings().dt_s);
    }

    /// Shows a client's world as its player would see it now.
    #[doc(hidden)]
    pub fn show_client(&mut self, world: &mut ClientWorld, handovers: &[Handover]) {
        let bytes = world.traffic().udp_bytes_in;
        let dt_s = world.environment().map_or(0.0, |environment| environment.step.dt_s);
        let told = if self.hub.is_viewed() { Told::of(world) } else { None };
        let Some(told) = told else {
            self.bytes = bytes;
            return;
        };
        let sample = Sample {
            tick: told.tick(),
            transfers: handovers.len() as u32,
            bytes: (bytes - self.bytes) as u32,
            ..Sample::default()
        };
        self.bytes = bytes;
        self.hub.note(sample, handovers);
        // What is shown moves on between two ticks of which the client hears.
        self.last = None;
        self.look(&told, dt_s);
    }

    /// Waits until the next step of a world that viewers control is due, and shows the world meanwhile. No
    /// step is due before the first viewer has come. Returns `true` if a step is due, `false` if `ends` has
    /// returned `true`.
    #[doc(hidden)]
    pub fn wait(&mut self, world: &LocalWorld, mut ends: impl FnMut() -> bool) -> bool {
        self.wait_for(world.host(), world.host().settings().dt_s, &mut ends).is_some()
    }

    /// Waits until a world that viewers control has something to do, and shows it meanwhile. That is a step
    /// or, for a recording, a tick to go to. Returns `None` if `ends` has returned `true`.
    pub(crate) fn wait_for(
        &mut self,
        world: &impl Source,
        dt_s: f32,
        mut ends: impl FnMut() -> bool,
    ) -> Option<Due> {
        while !ends() {
            let due = self.hub.wait_for_step(dt_s, LOOK);
            if due.is_some() {
                return due;
            }
            self.look(world, dt_s);
        }
        None
    }

    fn look(&mut self, world: &impl Source, dt_s: f32) {
        if !self.hub.is_wanted() {
            return;
        }
        let start = Instant::now();
        if self.due.is_some_and(|due| start < due) {
            return;
        }
        let wishes = self.hub.wishes();
        let look = (world.tick(), wishes);
        if self.last.as_ref() == Some(&look) && self.hub.has_picture() {
            return;
        }
        let moment = self.looker.look(world, &look.1, self.hub.take_memory());
        if self.last.is_none() && moment.number == 1 {
            self.hub.set_fixed(self.fixed(world, &moment, dt_s));
        }
        self.last = Some(look);
        // Sending fails only if the thread that encodes has panicked.
        let _ = self.encoder.send(moment);
        let end = Instant::now();
        self.costs.rotate_left(1);
        self.costs[0] = end - start;
        let cost = self.costs.into_iter().min().unwrap_or_default();
        tracing::debug!(took = ?self.costs[0], "looked at the world");
        self.due = Some((start + PERIOD).max(end + (cost * SPARING).min(MOST_SPARED)));
    }

    fn fixed(&self, world: &impl Source, moment: &Moment, dt_s: f32) -> Hello {
        let bounds = world.bounds();
        let count = moment.rows.len().max(1) as f64;
        // The page computes in f32, so that its origin is near the bodies.
        let mean = |i: usize| (moment.rows.iter().map(|row| row.at[i]).sum::<f64>() / count).round();
        let origin = std::array::from_fn(|i| Some(mean(i)).filter(|v| v.is_finite()).unwrap_or(0.0));
        let bounds = [bounds.min, bounds.max];
        let (name, controls, recorded) = (self.name.clone(), self.hub.has_controls(), self.recorded);
        Hello { name, controls, recorded, dt_s, origin, bounds }
    }
}

/// Recordings.
#[cfg_attr(not(feature = "cli"), expect(dead_code, reason = "only the command line replays"))]
impl Viewer {
    /// Lets viewers also go to any tick of the recording that is replayed. `ticks` are its first and its
    /// last.
    pub(crate) fn with_recording(self, ticks: [u64; 2]) -> Self {
        Self { recorded: Some(ticks), ..self.with_controls() }
    }

    /// Shows a replayed world after a tick. On its way to `goal`, a tick that viewers have chosen, it shows
    /// only how far it is.
    pub(crate) fn show_replayed(&mut self, world: &Hosts<'_>, goal: Option<u64>) {
        let going = goal.map(|goal| [world.tick(), goal]);
        self.hub.set_going(going);
        if !self.hub.is_viewed() {
            return;
        }
        let step_ms = world.regions().iter().map(|region| region.step_ms).sum();
        self.hub.note(Sample { tick: world.tick(), step_ms, ..Sample::default() }, &[]);
        if going.is_none() {
            self.look(world, world.dt_s());
        }
    }

    /// Takes the tick of a recording that viewers want to see, if they chose one.
    pub(crate) fn take_goal(&self) -> Option<u64> {
        self.hub.take_goal()
    }

    /// Pauses a world that viewers may pause.
    pub(crate) fn pause(&self) {
        self.hub.control(|control| control.pause(true));
    }
}
