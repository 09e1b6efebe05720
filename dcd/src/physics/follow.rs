//! A region's anchor follows its bodies, so that f32 keeps its millimetres wherever they go. Where they stay within a
//! kilometre of it, as in any small world, it stays too.

use super::convert;
use super::region::{Region, Role};
use crate::space::{Bounds, Tick};

/// Looked after once in so many ticks: at 1,000 m/s a body goes a kilometre meanwhile.
const EVERY_TICKS: u64 = 64;
/// f32 resolves 0.06 mm here.
const FAR_M: f64 = 1024.0;

/// Moves the anchor to the middle of the region's own awake bodies when that brings all of them much nearer to it. Before
/// the first step of a tick.
pub(super) fn follow(region: &mut Region, tick: Tick) {
    if !tick.0.is_multiple_of(EVERY_TICKS) {
        return;
    }
    let awake = region.physics().islands.active_bodies();
    let owned = awake.filter(|&handle| matches!(region.role_of(handle), Some((_, Role::Owner))));
    let places = owned
        .map(|handle| convert::world_point(region.anchor(), region.physics().bodies[handle].translation()));
    if let Some(anchor) = better_anchor(region.anchor(), places) {
        region.set_anchor(anchor);
    }
}

/// The anchor that suits these places, in world space, if the present one is far from them.
pub(super) fn better_anchor(anchor: [f64; 3], places: impl Iterator<Item = [f64; 3]>) -> Option<[f64; 3]> {
    let around = places.map(|place| Bounds::new(place, place)).reduce(|all, place| all.union(&place))?;
    let reach_m = |from: [f64; 3]| {
        let axis = |i: usize| (around.min[i] - from[i]).abs().max((around.max[i] - from[i]).abs());
        (0..3).map(axis).fold(0.0, f64::max)
    };
    let better = convert::anchor_of(around.centre());
    let far_m = reach_m(anchor);
    (far_m > FAR_M && reach_m(better) < 0.5 * far_m).then_some(better)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_anchor_moves_only_when_that_brings_everything_much_nearer() {
        let moved = |places: &[[f64; 3]]| better_anchor([0.0; 3], places.iter().copied());
        assert_eq!(moved(&[]), None);
        assert_eq!(moved(&[[1000.0, 0.0, -1000.0]]), None, "near enough");
        assert_eq!(moved(&[[99_000.0, 0.0, 0.0], [100_000.0, 50.0, 0.0]]), Some([99_328.0, 0.0, 0.0]));
        assert_eq!(moved(&[[0.0; 3], [100_000.0, 0.0, 0.0]]), None, "half of them would be as far");
    }
}
