//! Tests inputs that act at another time than they were made for, or never.

use super::*;
use crate::protocol::Refusal;

fn alone() -> Game {
    let mut game = Game::of(6, |_| (Vec::new(), Vec::new()));
    game.play(120, |_| Some(0.0));
    game
}

#[test]
fn after_the_world_stood_still_an_avatar_answers_as_soon_as_before_and_nothing_jumps() {
    let mut game = alone();
    let mut last = None;
    let mut look = |game: &Game| {
        let x = game.predictor.at(AVATAR, game.time.predicted).unwrap().pose.translation[0];
        let way_m: f64 = x - last.replace(x).unwrap_or(x);
        assert!(way_m.abs() < 0.25, "a jump of {way_m} m at {:?}", game.time);
    };
    // As while its leader dies.
    for _ in 0..90 {
        game.stood += 1.0;
        game.frame(Some(1.0));
        look(&game);
    }
    for _ in 0..60 {
        game.play(1, |_| Some(-1.0));
        look(&game);
    }
    assert!((0..=4).contains(&game.applied.1), "inputs come {} ticks early", game.applied.1);
    game.predicted.clear();
    game.play(120, to_and_fro);
    assert!(game.worst_m() < 1e-3, "{} m off", game.worst_m());
}

#[test]
fn an_input_that_is_refused_is_predicted_no_more() {
    let mut game = alone();
    game.play(1, |_| Some(3.0));
    let rejected = ToClient::Rejected { body: Some(AVATAR), reason: Refusal::TooFast };
    game.to_client.push_back((game.arrival(game.world.tick().0, None) + game.delay, rejected));
    for _ in 0..40 {
        // The input never acts, however often it is sent.
        game.to_world.clear();
        game.waiting.clear();
        game.play(1, |_| None);
    }
    game.predicted.clear();
    game.play(20, |_| None);
    assert!(game.worst_m() < 0.01, "{} m off", game.worst_m());
}

#[test]
fn inputs_of_a_client_that_shows_nothing_are_not_kept() {
    let mut predictor = Predictor::new(ME, &environment()).unwrap();
    for tick in 1..=10_000 {
        let velocity = Velocity::default();
        predictor.input(Input {
            body: AVATAR,
            logical_time: tick,
            tick: Tick(tick),
            velocity,
            pose: None,
            drive: None,
        });
    }
    assert!(predictor.inputs.len() < 1_000, "{}", predictor.inputs.len());
}
