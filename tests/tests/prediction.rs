//! Tests that a client's own avatar, and what it touches, react at once to the user's inputs, as the world
//! will have it, over good and bad networks.

use dcd_tests::course::{Course, Played, play};
use dcd_tests::proxy::Weather;
use dcd_tests::stage::{Stage, ms};

fn run(course: Course, weather: Weather) -> Played {
    let mut stage = Stage::of(course.world(0), weather);
    let played = play(&mut stage, course, 240);
    let jumps = played.jumps_m();
    assert!(!jumps.is_empty(), "nothing moved");
    let at = |share: f64| 1e3 * jumps[(share * (jumps.len() - 1) as f64) as usize];
    println!(
        "{} {:?} ± {:?}, {} lost: {:?}; jumps of {:.1} mm (p99), {:.1} (max)",
        course.name(),
        weather.delay,
        weather.jitter,
        weather.loss,
        played.prediction,
        at(0.99),
        at(1.0)
    );
    for pair in played.frames.windows(2) {
        assert!(pair[1].time.predicted >= pair[0].time.predicted, "nothing goes back in time");
    }
    played
}

/// The suite `prediction` measures corrections on a quiet machine. Here others may be at work.
#[test]
fn an_avatar_that_pushes_a_stack_answers_in_the_frame_of_the_input() {
    let played = run(Course::Pusher, ms(100, 0, 0.0));
    let speed = |frame: usize| played.frames[frame].bodies[&played.avatar].1.linear[0];
    for (frame, asked) in [(45, 2.0), (180, -1.0), (225, 1.5)] {
        assert!((speed(frame) - asked).abs() < 0.1, "asked for {asked} m/s, it shows {}", speed(frame));
    }
    assert!(
        played.frames[60].time.predicted - played.frames[60].time.shown > 12.0,
        "far ahead of what is told"
    );
    assert!(played.corrected() <= 0.2, "{}", played.corrected());
    assert!(played.prediction.largest_correction_m < 0.5, "{:?}", played.prediction);
}

#[test]
fn walkers_balls_and_cars_are_predicted_over_a_good_network() {
    all_are_predicted(ms(20, 0, 0.0));
}

#[test]
fn walkers_balls_and_cars_are_predicted_over_a_bad_network() {
    all_are_predicted(ms(100, 50, 0.05));
}

fn all_are_predicted(weather: Weather) {
    let mut failures = Vec::new();
    for course in Course::ALL {
        let played = run(course, weather);
        let jump_m = played.jumps_m().last().copied().unwrap();
        // Where a car hits boxes at full speed, a single tick decides where they fly.
        if played.corrected() > 0.5 || jump_m > 0.5 {
            failures.push(format!("{}, {weather:?}: {:?}, {jump_m}", course.name(), played.prediction));
        }
    }
    assert!(failures.is_empty(), "{failures:#?}");
}
