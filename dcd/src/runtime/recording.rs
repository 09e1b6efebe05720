//! Records a local world: what its program does to it, and the digests of its regions after each step.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Duration;

use super::LocalWorld;
use super::recorded::bodies_of;
use super::tape::{Copies, Tape};
use crate::protocol::BodyRecord;
use crate::recording::{Background, Operation, Recorder, RecordingError, digest};
use crate::space::{BodyId, JointId, Load};

impl LocalWorld {
    /// Begins to record what is done to this world, from its present state on. A replay computes the world
    /// again from the recording, bit for bit. A recording that was going on ends; if that one is not whole,
    /// its error is returned, and nothing begins.
    pub fn record(&mut self, to: impl Write + Send + Sync + 'static) -> Result<(), RecordingError> {
        self.end_former_recording()?;
        self.begin(Recorder::of_local(to)?, None);
        Ok(())
    }

    /// Does the same to a file, which is created or replaced.
    pub fn record_to(&mut self, path: &Path) -> Result<(), RecordingError> {
        // The recording before may be to the same file.
        self.end_former_recording()?;
        let recorder = Background::create(path).and_then(Recorder::of_local);
        let unwritable = |error| RecordingError::Unwritable { path: path.to_owned(), error };
        self.begin(recorder.map_err(unwritable)?, Some(path.to_owned()));
        Ok(())
    }

    /// Begins to record in memory, keeping at least the last `time`. [`LocalWorld::keep_recording`] writes
    /// it. A recording that was going on ends as by [`LocalWorld::record`].
    pub fn record_last(&mut self, time: Duration) -> Result<(), RecordingError> {
        self.end_former_recording()?;
        self.begin(Recorder::of_local_for(time), None);
        Ok(())
    }

    fn begin(&mut self, recorder: Recorder, path: Option<PathBuf>) {
        let mut tape = Box::new(Tape::new(recorder, path));
        self.host.set_hooks(tape.listen_to(self.host.hooks().cloned()));
        self.tape = Some(tape);
    }

    /// Writes what [`LocalWorld::record_last`] has kept, and goes on recording.
    pub fn keep_recording(&mut self, to: &mut impl Write) -> Result<(), RecordingError> {
        let tape = self.tape.as_mut();
        let none = || RecordingError::Unsuitable("nothing is recorded: begin by World::record_last".into());
        tape.ok_or_else(none)?.recorder.keep(to)
    }

    /// Ends the recording, and waits until it is written. Returns an error if any of it could not be written.
    pub fn stop_recording(&mut self) -> Result<(), RecordingError> {
        let Some(tape) = self.tape.take() else { return Ok(()) };
        self.host.set_hooks(tape.hooks());
        tape.finish()
    }

    /// Ends a recording that is going on, before another begins. That one only begins if this one is whole:
    /// otherwise nobody would hear of it.
    fn end_former_recording(&mut self) -> Result<(), RecordingError> {
        self.stop_recording().map_err(|error| RecordingError::Former(Box::new(error)))
    }

    /// Returns whether the world is recorded.
    pub fn is_recorded(&self) -> bool {
        self.tape.is_some()
    }

    /// Records the insertion of bodies.
    pub(super) fn tape_bodies(&mut self, bodies: Vec<BodyRecord>) {
        if let Some(tape) = &mut self.tape {
            tape.note_bodies(bodies, self.host.shapes());
        }
    }

    /// Records an operation, if it was done.
    pub(super) fn tape(&mut self, is_done: bool, operation: impl FnOnce() -> Operation) {
        if let Some(tape) = self.tape.as_mut().filter(|_| is_done) {
            tape.note(operation());
        }
    }

    /// Notes a change that only a snapshot can record.
    pub(super) fn tape_spoilt(&mut self) {
        self.tape.iter_mut().for_each(|tape| tape.spoil());
    }

    /// Records the copies of a body after a program's change.
    pub(super) fn tape_update(&mut self, body: BodyId, copies: Copies) {
        if let (Some(tape), Some(copies)) = (&mut self.tape, copies.0) {
            tape.note(Operation::Update { body, copies });
        }
    }

    /// Records the copies of a joint after a program's change.
    pub(super) fn tape_joint(&mut self, joint: JointId, copies: Copies) {
        if let (Some(tape), Some(copies)) = (&mut self.tape, copies.0) {
            tape.note(Operation::UpdateJoint { joint, copies });
        }
    }

    /// Writes the snapshot that a recording needs before a step.
    pub(super) fn tape_seed(&mut self) {
        let Some(mut tape) = self.tape.take() else { return };
        if tape.wants_seed()
            && let Err(error) = tape.seed(self.host.shapes(), |parts| self.save(parts))
        {
            tape.recorder.fail(std::io::Error::other(error));
        }
        self.tape = Some(tape);
    }

    /// Records the digests after a step.
    pub(super) fn tape_step(&mut self) {
        let Some(tape) = &mut self.tape else { return };
        tape.note_answers();
        self.host.timed_paces().into_iter().for_each(|paces| tape.note_paces(paces));
        if !tape.recorder.has_failed() {
            let digests: Vec<_> =
                self.host.regions().map(|region| (region.id(), digest(bodies_of(region)))).collect();
            tape.note_step(self.host.tick(), &digests);
        }
    }

    /// Returns whether the partition follows the times of steps, which no replay can repeat.
    pub(super) fn follows_times(&self) -> bool {
        self.host.balance().is_some_and(|balance| balance.load == Load::Times)
    }
}

#[cfg(test)]
mod tests {
    use std::io;
    use std::sync::atomic::{AtomicU32, Ordering::Relaxed};
    use std::sync::{Arc, Mutex};

    use rapier3d::prelude::*;

    use super::*;
    use crate::fidelity::Fidelity;
    use crate::physics::{ContactHooks, HookedPair};
    use crate::protocol::{Push, Velocity, WorldPose};
    use crate::recording::{Flip, Mismatch, Replay, difference, open};
    use crate::runtime::replays::Here;
    use crate::runtime::{Partitioning, WorldConfig};
    use crate::scene::{Params, Scene};
    use crate::space::{Axis, Balance, Bounds, Tick, Viewpoint};

    /// A recording in memory.
    #[derive(Clone, Default)]
    struct Memory(Arc<Mutex<Vec<u8>>>);

    impl Write for Memory {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.0.lock().unwrap().write(bytes)
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    fn replay(bytes: Vec<u8>) -> Replay {
        let member = open(io::Cursor::new(bytes), &Here { threads: 1, stand_in: None }).unwrap();
        Replay::new(vec![(String::new(), member)]).unwrap()
    }

    fn checked(bytes: Vec<u8>, flip: Option<Flip>) -> (u64, Option<Mismatch>) {
        let mut replay = replay(bytes);
        flip.into_iter().for_each(|flip| replay.flip(flip));
        while replay.mismatch().is_none() && replay.advance(Tick(u64::MAX)).unwrap() {}
        (replay.matches(), replay.mismatch().cloned())
    }

    fn ragdolls(regions: usize) -> LocalWorld {
        let scene = Scene::named("ragdolls", &Params::new().with("count", 4)).unwrap();
        let partitioning = Partitioning::Regions(regions);
        LocalWorld::from_scene(&scene, WorldConfig { partitioning, ..WorldConfig::for_scene(&scene) })
            .unwrap()
    }

    #[test]
    fn a_world_of_which_less_is_computed_is_repeated_bit_for_bit() {
        let scene = Scene::named("town", &Params::new().with("n", 600).with("cars", 2)).unwrap();
        let world = |fidelity| {
            LocalWorld::from_scene(&scene, WorldConfig { fidelity, ..WorldConfig::for_scene(&scene) })
                .unwrap()
        };
        let mut walked = world(Fidelity::AUTO);
        let memory = Memory::default();
        walked.record(memory.clone()).unwrap();
        let ids: Vec<_> = walked.states().map(|(id, ..)| id).collect();
        for tick in 0..120_u8 {
            let view = Viewpoint { at: [f64::from(tick) - 60.0, 2.0, 0.0], radius_m: 20.0 };
            walked.set_viewpoints(&[view]).unwrap();
            // Brings a region to the present.
            if tick % 4 == 3 {
                let pushed = ids[37 * usize::from(tick) % ids.len()];
                walked.push(&Push::impulse(pushed, [0.0, 1.0, 0.0])).unwrap();
            }
            walked.step().unwrap();
        }
        walked.stop_recording().unwrap();
        let levels = walked.fidelity_report().unwrap().levels;
        assert!(levels[0] > 0 && levels[2] > 0, "{levels:?}");
        let bytes = memory.0.lock().unwrap().clone();
        let (matches, mismatch) = checked(bytes, None);
        assert!(mismatch.is_none() && matches >= 100, "{matches}, {mismatch:?}");
    }

    #[test]
    fn a_world_with_a_time_budget_is_repeated_bit_for_bit_whatever_time_its_steps_take() {
        let scene = Scene::named("town", &Params::new().with("n", 600).with("cars", 2)).unwrap();
        let fidelity = Fidelity::Budget { tick_ms: 20.0 };
        let mut world =
            LocalWorld::from_scene(&scene, WorldConfig { fidelity, ..WorldConfig::for_scene(&scene) })
                .unwrap();
        let memory = Memory::default();
        world.record(memory.clone()).unwrap();
        let mut levels = Vec::new();
        for tick in 0..120_u8 {
            // Like a machine that is slower at times. No replay takes that long.
            let took = Duration::from_millis(if (30..60).contains(&tick) { 40 } else { 0 });
            world.host_mut().count_time(took);
            world.step().unwrap();
            levels.push(world.fidelity_report().unwrap().levels);
            if tick == 90 {
                // A recording that begins anew here has all that it needs, too.
                world.tape_spoilt();
            }
        }
        world.stop_recording().unwrap();
        levels.dedup();
        assert!(levels.len() > 2 && levels.iter().any(|levels| levels[2] > 0), "{levels:?}");
        let bytes = memory.0.lock().unwrap().clone();
        let (matches, mismatch) = checked(bytes, None);
        assert!(mismatch.is_none() && matches >= 120, "{matches}, {mismatch:?}");
    }

    /// Does everything that a program can do to a world, and steps it in between.
    fn play(world: &mut LocalWorld) {
        let ball = |x: f32| RigidBodyBuilder::dynamic().translation(Vector::new(x, 6.0, 0.3));
        let first = world.insert(ball(0.2), ColliderBuilder::ball(0.4)).unwrap();
        let hull: Vec<_> = (0..9)
            .map(|i| Vector::new((i as f32).sin(), (i as f32 * 1.7).cos(), (i as f32 * 0.3).sin()))
            .collect();
        let hull = ColliderBuilder::convex_hull(&hull).unwrap();
        let second = world.insert(ball(1.4), hull.clone()).unwrap();
        let lift = RigidBodyBuilder::kinematic_position_based().translation(Vector::new(3.0, 1.0, 0.0));
        let lift = world.insert(lift, ColliderBuilder::cuboid(1.0, 0.1, 1.0)).unwrap();
        let rope = world.insert_joint(first, second, RopeJointBuilder::new(2.0)).unwrap();
        for tick in 0..90_u32 {
            match tick {
                10 => {
                    world.update(first, |body| body.apply_impulse(Vector::new(0.3, 0.0, 0.1), true)).unwrap()
                }
                20 => world.push(&Push::force(second, [5.0, 0.0, 0.0], [0.0; 3])).unwrap(),
                30 => world
                    .update_joint(rope, |joint| {
                        joint.set_contacts_enabled(false);
                    })
                    .unwrap(),
                35 => world.insert_collider(first, ColliderBuilder::cuboid(0.1, 0.6, 0.1)).unwrap(),
                40 => world.update_collider(first, 0, |collider| collider.set_friction(0.1)).unwrap(),
                45 => world.remove_joint(rope).unwrap(),
                50 => world.set_pose(second, WorldPose::at([-2.0, 5.0, 0.0])).unwrap(),
                55 => world
                    .set_velocity(first, Velocity { linear: [0.0, 3.0, 1.0], angular: [0.0; 3] })
                    .unwrap(),
                60 => drop(world.insert(ball(-1.0), hull.clone()).unwrap()),
                70 => world.remove(second).unwrap(),
                _ => {}
            }
            let y = 1.0 + f64::from(tick) * 0.01;
            world.set_next_pose(lift, WorldPose::at([3.0, y, 0.0])).unwrap();
            world.step().unwrap();
        }
    }

    #[test]
    fn whatever_a_program_does_is_repeated_bit_for_bit() {
        for regions in [1, 4] {
            let mut world = ragdolls(regions);
            world.step().unwrap();
            let tape = Memory::default();
            world.record(tape.clone()).unwrap();
            play(&mut world);
            world.stop_recording().unwrap();
            let bytes = tape.0.lock().unwrap().clone();
            let regions = world.regions().len() as u64;
            assert_eq!(checked(bytes.clone(), None), (90 * regions, None));

            let body = world.states().next().unwrap().0;
            let flip = Flip { tick: Tick(40), body, bit: 32 * 10 + 3 };
            let (_, found) = checked(bytes, Some(flip));
            let found = found.expect("a flipped bit is found");
            assert_eq!((found.tick, found.body, found.field), (Tick(40), Some(body), Some("linvel.x")));
        }
    }

    #[test]
    fn a_world_that_goes_back_to_a_checkpoint_is_repeated_with_what_it_did_before_and_after() {
        let mut world = ragdolls(4);
        let tape = Memory::default();
        world.record(tape.clone()).unwrap();
        world.step().unwrap();
        let before = world.checkpoint();
        play(&mut world);
        world.rewind(&before).unwrap();
        play(&mut world);
        world.stop_recording().unwrap();
        let bytes = tape.0.lock().unwrap().clone();
        assert_eq!(checked(bytes.clone(), None), (181 * world.regions().len() as u64, None));
        let mut again = replay(bytes);
        while again.advance(Tick(u64::MAX)).unwrap() {}
        assert_eq!((again.tick_count(), again.ticks()), (181, 91));
    }

    /// Hooks that let balls fall through the floor in every other half second, carry other bodies along, and
    /// blind sensors now and then.
    #[derive(Default)]
    struct Whims(AtomicU32);

    impl ContactHooks for Whims {
        fn filter_contact_pair(&self, pair: &HookedPair<'_>) -> Option<SolverFlags> {
            let is_solid = self.0.load(Relaxed) % 60 < 30
                || pair.colliders.iter().all(|one| one.shape().as_ball().is_none());
            is_solid.then_some(SolverFlags::COMPUTE_RIGID_IMPULSES)
        }

        fn filter_intersection_pair(&self, _pair: &HookedPair<'_>) -> bool {
            self.0.load(Relaxed) % 20 < 10
        }

        fn modify_solver_contacts(
            &self,
            _pair: &HookedPair<'_>,
            contacts: &mut ContactModificationContext<'_>,
        ) {
            let Some(manifold) = contacts.rigid_mut() else { return };
            *manifold.friction = 0.9;
            *manifold.user_data += 1;
            for contact in manifold.solver_contacts.iter_mut() {
                contact.tangent_velocity = Vector::X * (*manifold.user_data as f32 * 0.1).sin();
            }
        }
    }

    fn hooked(regions: usize, fidelity: Fidelity) -> LocalWorld {
        let partitioning = Partitioning::RegionsAcross(regions, vec![Axis::X]);
        let bounds = Bounds { min: [-12.0, -2.0, -12.0], max: [12.0, 20.0, 12.0] };
        let config = WorldConfig { partitioning, bounds, fidelity, ..WorldConfig::default() };
        let mut world = LocalWorld::new(config).unwrap();
        let hooks = ActiveHooks::all();
        let floor = ColliderBuilder::cuboid(12.0, 0.5, 12.0).active_hooks(hooks);
        world.insert(RigidBodyBuilder::fixed(), floor).unwrap();
        let sensor = ColliderBuilder::cuboid(12.0, 0.5, 12.0).sensor(true).active_hooks(hooks);
        let sensor = sensor.active_events(ActiveEvents::COLLISION_EVENTS);
        world.insert(RigidBodyBuilder::fixed().translation(Vector::Y * 2.0), sensor).unwrap();
        for i in 0..12_u8 {
            let x = f32::from(i) - 5.7;
            let body =
                || RigidBodyBuilder::dynamic().translation(Vector::new(x, 2.0 + 0.3 * x.abs(), 0.9 * x));
            world.insert(body(), ColliderBuilder::ball(0.3)).unwrap();
            world
                .insert(body().translation(Vector::new(x, 1.5, -x)), ColliderBuilder::cuboid(0.3, 0.3, 0.3))
                .unwrap();
        }
        world
    }

    #[test]
    fn what_hooks_answered_is_answered_again() {
        for regions in [1, 4] {
            let mut world = hooked(regions, Fidelity::Off);
            let whims = Arc::new(Whims::default());
            world.set_hooks(Some(whims.clone()));
            let tape = Memory::default();
            world.record(tape.clone()).unwrap();
            for tick in 0..120 {
                whims.0.store(tick, Relaxed);
                // Hooks may come and go while the world is recorded.
                match tick {
                    80 => world.set_hooks(None),
                    100 => world.set_hooks(Some(whims.clone())),
                    _ => {}
                }
                world.step().unwrap();
            }
            world.stop_recording().unwrap();
            assert!(Arc::strong_count(&whims) > 1, "the hooks are those of before");
            let fell = world.states().filter(|(_, _, pose, _)| pose.translation[1] < -1.0).count();
            assert!(fell > 0 && fell < 13, "{fell} of 12 balls fell");
            let bytes = tape.0.lock().unwrap().clone();
            assert_eq!(checked(bytes, None), (120 * world.regions().len() as u64, None));
        }
    }

    #[test]
    fn what_hooks_answered_where_an_operation_came_to_what_was_behind_is_answered_again() {
        for fidelity in [Fidelity::Tolerance { m_s: 1e6 }, Fidelity::Budget { tick_ms: 1e-4 }] {
            let mut world = hooked(2, fidelity);
            world.set_viewpoints(&[Viewpoint { at: [500.0, 0.0, 0.0], radius_m: 1.0 }]).unwrap();
            let whims = Arc::new(Whims::default());
            world.set_hooks(Some(whims.clone()));
            let tape = Memory::default();
            world.record(tape.clone()).unwrap();
            let boxes: Vec<_> = world.states().map(|(id, ..)| id).collect();
            let mut behind = 0;
            for tick in 0..160 {
                whims.0.store(tick / 4, Relaxed);
                world.step().unwrap();
                // Nothing is touched for long enough that regions get behind.
                if tick % 21 == 20 {
                    behind += world.regions().filter(|region| world.host().behind(region.id()) > 0).count();
                    world.push(&Push::impulse(boxes[tick as usize % boxes.len()], [0.0, 0.1, 0.0])).unwrap();
                }
            }
            world.stop_recording().unwrap();
            assert!(behind > 0, "something was behind: {fidelity:?}");
            let bytes = tape.0.lock().unwrap().clone();
            assert_eq!(checked(bytes, None).1, None, "{fidelity:?}");
        }
    }

    #[test]
    fn the_last_seconds_are_kept_and_replayed() {
        let mut world = ragdolls(2);
        // No time at all: each step begins a segment.
        world.record_last(Duration::ZERO).unwrap();
        play(&mut world);
        let mut kept = Vec::new();
        world.keep_recording(&mut kept).unwrap();
        let (matches, mismatch) = checked(kept, None);
        assert_eq!(mismatch, None);
        assert!((2..=4).contains(&matches), "{matches}: one or two ticks are kept");
        assert!(matches!(ragdolls(1).keep_recording(&mut Vec::new()), Err(RecordingError::Unsuitable(_))));
        world.record_last(Duration::MAX).unwrap();
        play(&mut world);
        let mut kept = Vec::new();
        world.keep_recording(&mut kept).unwrap();
        assert_eq!(checked(kept, None), (180, None), "all of it");
    }

    /// A file on a disk that has room for this many bytes.
    struct Full(usize);

    impl Write for Full {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.0 = self.0.checked_sub(bytes.len()).ok_or(io::ErrorKind::StorageFull)?;
            Ok(bytes.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn a_recording_begins_at_the_second_call_where_the_one_before_failed() {
        let mut world = ragdolls(1);
        let tape = Memory::default();
        for in_memory in [true, false] {
            world.record(Full(1_000)).unwrap();
            play(&mut world);
            let again = |world: &mut LocalWorld| match in_memory {
                true => world.record_last(Duration::MAX),
                false => world.record(tape.clone()),
            };
            assert!(matches!(again(&mut world), Err(RecordingError::Former(_))), "in memory: {in_memory}");
            assert!(!world.is_recorded());
            again(&mut world).unwrap();
        }
        play(&mut world);
        world.stop_recording().unwrap();
        assert_eq!(checked(tape.0.lock().unwrap().clone(), None), (90, None));
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_full_disk_is_told_with_the_path() {
        let mut world = ragdolls(1);
        world.record_to(Path::new("/dev/full")).unwrap();
        play(&mut world);
        let error = world.stop_recording().unwrap_err().to_string();
        assert!(error.contains("\"/dev/full\" is not whole") && error.contains("make room"), "{error}");
    }

    #[test]
    fn two_worlds_are_not_recorded_to_one_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("world.dcdr");
        let (mut one, mut other) = (ragdolls(1), ragdolls(1));
        one.record_to(&path).unwrap();
        let refused = other.record_to(&path).unwrap_err().to_string();
        assert!(refused.contains("another recording is being written to it: end that one"), "{refused}");
        play(&mut one);
        one.stop_recording().unwrap();
        assert_eq!(checked(std::fs::read(&path).unwrap(), None), (90, None));
        one.record_to(&path).unwrap();
        one.record_to(&path).expect("a world's own recording ends first");
    }

    #[test]
    fn recordings_are_compared_from_the_tick_on_at_which_both_have_begun() {
        let recorded = |begins: u32, push_x: f32| {
            let mut world = ragdolls(2);
            let body = world.states().next().unwrap().0;
            let tape = Memory::default();
            for tick in 0..70 {
                if tick == begins {
                    world.record(tape.clone()).unwrap();
                }
                if tick == 60 {
                    world.push(&Push::impulse(body, [push_x, 0.0, 0.0])).unwrap();
                }
                world.step().unwrap();
            }
            world.stop_recording().unwrap();
            let bytes = tape.0.lock().unwrap().clone();
            replay(bytes)
        };
        let compared = |mut one: Replay, mut other: Replay| {
            let (last, found) = difference([&mut one, &mut other], Tick(u64::MAX), |_| ()).unwrap();
            (last, found.map(|found| found.tick))
        };
        let late = || recorded(50, 1.0);
        assert_eq!(compared(late(), recorded(50, 2.0)), (Tick(61), Some(Tick(61))));
        assert_eq!(compared(recorded(0, 1.0), late()), (Tick(70), None));
        assert_eq!(compared(late(), recorded(0, 1.0)), (Tick(70), None));
    }

    #[test]
    fn regions_that_follow_the_load_are_cut_again_in_a_replay() {
        for load in [Load::Counts, Load::Times] {
            let mut world = ragdolls(4);
            let balance =
                Balance { every_ticks: 7, tolerance: 1.01, smallest_edge_m: 0.5, load, ..Balance::default() };
            world.set_balance(Some(balance)).unwrap();
            let tape = Memory::default();
            world.record(tape.clone()).unwrap();
            play(&mut world);
            world.stop_recording().unwrap();
            let bytes = tape.0.lock().unwrap().clone();
            assert_eq!(checked(bytes, None).1, None, "{load:?}");
        }
    }

    #[test]
    fn islands_are_limited_in_the_replay_of_a_world_that_is_cut_by_times() {
        let scene = Scene::named("heap", &Params::new().with("n", 120)).unwrap();
        let config = WorldConfig { partitioning: Partitioning::Regions(4), ..WorldConfig::for_scene(&scene) };
        let mut world = LocalWorld::from_scene(&scene, config).unwrap();
        let balance = Balance { every_ticks: 30, load: Load::Times, ..Balance::default() };
        world.set_balance(Some(balance)).unwrap();
        let tape = Memory::default();
        world.record(tape.clone()).unwrap();
        (0..120).for_each(|_| world.step().unwrap());
        world.stop_recording().unwrap();
        let bytes = tape.0.lock().unwrap().clone();
        assert_eq!(checked(bytes, None).1, None);
    }
}
