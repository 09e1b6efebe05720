//! Tests that nothing is shown going back in time, or accelerating much harder than in the world.

use super::*;

/// What is shown may accelerate as hard as the body does within so many ticks of the one shown: impacts are
/// learned of late.
const WINDOW_TICKS: u64 = 30;

/// How much harder it may accelerate in any frame, and in all frames but one of a hundred, m/s²: as by
/// gravity, or by some millimetres within a frame. A jump of 2 cm is 72 m/s².
const MOST_M_S2: f64 = 40.0;
const USUAL_M_S2: f64 = 12.0;

type Place = [f64; 3];

/// What was shown frame by frame, and what was true.
struct Film {
    game: Game,
    /// The ticks at which each body was shown, and where.
    shown: BTreeMap<BodyId, Vec<(f64, Place)>>,
    truth: BTreeMap<BodyId, BTreeMap<u64, Place>>,
}

impl Film {
    fn of(game: Game) -> Self {
        Self { game, shown: BTreeMap::new(), truth: BTreeMap::new() }
    }

    fn play(&mut self, ticks: u64, ask: impl Fn(u64) -> Option<f32>) {
        for i in 0..ticks {
            self.game.tick();
            let tick = self.game.world.tick().0;
            for (id, region, handle) in self.game.world.owned_bodies() {
                let place = region.motion(handle).0.translation;
                self.truth.entry(id).or_default().insert(tick, place);
            }
            let before = self.game.time;
            self.game.frame(ask(i));
            let (time, predictor, client) = (self.game.time, &self.game.predictor, &self.game.client);
            // Before anything is told, there is no time.
            let goes_on = time.shown >= before.shown && time.predicted >= before.predicted;
            assert!(goes_on || before.now == 0.0, "from {before:?} back to {time:?}");
            for id in self.truth.keys() {
                let ahead =
                    predictor.tick_of(*id, &time).and_then(|tick| Some((tick, predictor.at(*id, tick)?)));
                let behind = || Some((time.shown, client.view(*id, time.shown)?));
                let Some((tick, motion)) = ahead.or_else(behind) else { continue };
                let shown = self.shown.entry(*id).or_default();
                shown.push((tick, motion.pose.translation));
            }
        }
    }

    /// Returns by how much the shown accelerations exceed the hardest true one of about that time, m/s²,
    /// sorted, from the frame `from` on.
    fn excess_m_s2(&self, from: usize) -> Vec<f64> {
        let mut excess = Vec::new();
        for (id, shown) in &self.shown {
            let truth = &self.truth[id];
            // What happens within three ticks is shown as one impact.
            let true_at = |tick: u64| {
                let place = |tick| truth.get(&tick).copied();
                let [a, b, c, d] = [place(tick)?, place(tick + 1)?, place(tick + 3)?, place(tick + 4)?];
                Some(acceleration([a, b], [c, d]))
            };
            for three in shown.windows(3).skip(from) {
                let [(_, a), (tick, b), (_, c)] = three else { unreachable!() };
                let (tick, is) = (*tick as u64, acceleration([*a, *b], [*b, *c]));
                let about = tick.saturating_sub(WINDOW_TICKS)..tick + WINDOW_TICKS;
                let hardest = about.filter_map(true_at).fold(0.0, f64::max);
                excess.push((is - hardest).max(0.0));
            }
        }
        excess.sort_unstable_by(f64::total_cmp);
        excess
    }
}

/// Returns the acceleration that turns the movement of one tick into that of a later tick within one tick.
fn acceleration(before: [Place; 2], after: [Place; 2]) -> f64 {
    let gained = |i: usize| (after[1][i] - after[0][i]) - (before[1][i] - before[0][i]);
    (0..3).map(|i| (gained(i) / (DT_S * DT_S)).powi(2)).sum::<f64>().sqrt()
}

/// Describes a stack near the avatar, and balls that bounce and roll beyond what is predicted.
fn stack_and_balls(shapes: &mut ShapeLibrary) -> (Vec<BodyRecord>, Vec<JointRecord>) {
    let (mut bodies, joints) = stack(shapes);
    let ball = [ColliderBuilder::ball(0.3).restitution(0.6)];
    for i in 0..20u8 {
        let velocity = Vector::new(f32::from(i % 5) - 2.0, 0.0, f32::from(i % 3) - 1.0);
        let body = RigidBodyBuilder::dynamic().linvel(velocity).can_sleep(false).build();
        let at = WorldPose::at([1.5 * f64::from(i % 5), 3.0 + f64::from(i), 30.0 + 1.5 * f64::from(i / 5)]);
        bodies.push(shapes.describe(BodyId::persistent(100 + u32::from(i)), at, &body, &ball).unwrap());
    }
    (bodies, joints)
}

/// Runs at 100 ms each way: with exact states, and with jitter of up to 0, 33 and 100 ms and one batch in
/// twenty lost.
#[test]
fn nothing_is_shown_to_accelerate_much_harder_than_it_does() {
    for jitter in [None, Some(0), Some(2), Some(6)] {
        let mut game = Game::of(6, stack_and_balls);
        game.jitter = jitter;
        let mut film = Film::of(game);
        film.play(500, |i| if i < 120 { Some(0.0) } else { to_and_fro(i - 120) });
        let excess = film.excess_m_s2(90);
        let [usual, most] = [0.99, 1.0].map(|share| excess[(share * (excess.len() - 1) as f64) as usize]);
        let prediction = film.game.predictor.stats();
        println!("jitter of {jitter:?} ticks: {usual:.1} m/s² (p99), {most:.1} (max); {prediction:?}");
        assert!(excess.len() > 10_000 && prediction.replays > 10, "{} {prediction:?}", excess.len());
        assert!(usual < USUAL_M_S2 && most < MOST_M_S2, "{jitter:?}: {usual}, {most}");
    }
}
