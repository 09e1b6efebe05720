//! Tests the choice of rates.

use super::*;
use crate::space::{Cell, RegionId, RegionSet, Tick, Viewpoint, drawn};

/// Returns regions in a row, each 10 m wide, whose steps take `step_ms`.
fn row(count: u32, step_ms: f32) -> Vec<RegionState> {
    let region = |k| RegionState {
        region: RegionId(k),
        behind: 0,
        rests: false,
        urgent: false,
        bound: RegionSet::EMPTY,
        awake: 10,
        step_ms,
        signals: Signals::default(),
        took_ms: step_ms,
        full_ms: step_ms,
        audited: None,
    };
    (0..count).map(region).collect()
}

/// Has a governor choose for regions in a row, which `processes` processes compute in turn.
fn schedule(governor: &mut Governor, tick: u64, regions: &[RegionState], processes: u64) -> Schedule {
    let cell = |k: f64| Cell { min: [10.0 * k, -5.0, -5.0], max: [10.0 * k + 10.0, 5.0, 5.0] };
    let governed = |(k, state)| Governed { state, cell: cell(f64::from(k)), by: k as u64 % processes };
    let regions: Vec<_> = (0..).zip(regions).map(governed).collect();
    governor.schedule(Tick(tick), &regions, 1.0 / 60.0)
}

fn governor(fidelity: Fidelity) -> Governor {
    let mut governor = Governor::new(fidelity);
    governor.look(LookedAt::From(vec![Viewpoint { at: [0.0; 3], radius_m: 1.0 }]));
    governor
}

fn rates(governor: &mut Governor, regions: &[RegionState]) -> Vec<u8> {
    schedule(governor, 1, regions, 1);
    governor.paces().values().map(|pace| pace.rate).collect()
}

fn rates_after(governor: &mut Governor, regions: &[RegionState], ticks: u64) -> Vec<u8> {
    (0..ticks).map(|_| rates(governor, regions)).last().unwrap()
}

#[test]
fn a_budget_is_kept_by_what_is_farthest_first_and_what_is_seen_last() {
    for (step_ms, rates) in [
        (1.3, [1, 1, 1, 1, 1, 1]),
        (1.5, [1, 1, 1, 1, 1, 1]),
        (1.6, [1, 1, 2, 2, 2, 2]),
        (2.0, [1, 2, 2, 4, 4, 4]),
        (2.2, [2, 4, 4, 4, 4, 4]),
        (50.0, [4, 4, 4, 4, 4, 4]),
    ] {
        let mut governor = governor(Fidelity::Budget { tick_ms: 10.0 });
        assert_eq!(rates_after(&mut governor, &row(6, step_ms), 20), rates, "{step_ms} ms");
        assert_eq!(rates_after(&mut governor, &row(6, 0.5), 20), [1; 6], "when there is less to do");
    }
}

#[test]
fn what_is_bound_together_has_one_pace_with_a_budget_though_only_some_of_it_is_far() {
    let mut governor = governor(Fidelity::Budget { tick_ms: 10.0 });
    let mut regions = row(6, 2.0);
    regions.iter_mut().for_each(|region| region.bound = (0..6).collect());
    // All are stepped in the same ticks, so only the mean is kept.
    assert_eq!(rates_after(&mut governor, &regions, 20), [2; 6]);
}

#[test]
fn with_each_tick_above_the_budget_less_is_planned_for_until_one_in_a_hundred_is() {
    let mut governor = governor(Fidelity::Budget { tick_ms: 10.0 });
    let regions = row(6, 1.0);
    // Ticks take as long as their steps, except one in four, which takes half as long again.
    let mut over = 0;
    for tick in 0..8_000_u64 {
        let behind = schedule(&mut governor, tick, &regions, 1).behind;
        let due = |region: &&RegionState| behind.binary_search(&region.region).is_err();
        let pace = |region: &RegionState| governor.paces()[&region.region];
        let steps_ms: f64 =
            regions.iter().filter(due).map(|region| 1.5 * relative_time(4, pace(region).rate)).sum();
        let took_ms = steps_ms * if drawn(tick).is_multiple_of(4) { 1.5 } else { 1.0 };
        over += u32::from(tick >= 4_000 && took_ms > 10.0);
        governor.note_tick(0, took_ms, steps_ms / 1.5);
        governor.end_tick();
    }
    assert!((1..160).contains(&over), "{over} of 4,000 ticks");
}

#[test]
fn regions_look_as_far_ahead_as_any_may_be_behind_before_it_is() {
    let mut governor = governor(Fidelity::AUTO);
    let mut regions = row(4, 1.0);
    let mut looked = 0;
    let mut behind_most = 0;
    for tick in 0..400 {
        if tick == 200 {
            governor.look(LookedAt::All);
        }
        let said = schedule(&mut governor, tick, &regions, 1);
        for region in &mut regions {
            region.behind = if said.behind.contains(&region.region) { region.behind + 1 } else { 0 };
            assert!(region.behind <= looked, "tick {tick}");
            behind_most = behind_most.max(region.behind);
        }
        looked = said.behind_most;
        assert!((30..200).contains(&tick) || tick >= 200 || looked == 0, "all is computed in full at first");
    }
    assert_eq!((behind_most, looked), (3, 0));
}

#[test]
fn an_error_above_the_tolerance_makes_a_region_finer_for_ever_longer_times() {
    let mut governor = governor(Fidelity::Tolerance { m_s: 0.1 });
    let regions = row(4, 1.0);
    let mut fine = Vec::new();
    for tick in 0..4_000 {
        let rates = rates(&mut governor, &regions);
        for (id, &rate) in (0..).map(RegionId).zip(&rates) {
            // The second of the regions that are not seen errs at its lowest rate.
            governor.note_error(id, if id == RegionId(3) && rate == 4 { 0.5 } else { 0.01 });
        }
        if rates[3] < 4 && tick > 100 {
            fine.push(tick);
        }
    }
    assert_eq!(rates_after(&mut governor, &regions, 1)[..3], [1, 4, 4]);
    let returns = fine.windows(2).filter(|two| two[1] > two[0] + 1).count();
    assert!((2..8).contains(&returns), "{returns} returns to the lowest rate in 4,000 ticks");
}

#[test]
fn what_spins_is_stepped_so_often_that_it_turns_by_a_radian_at_most() {
    for (spin_rad_s, rate) in [(10.0, 4), (14.0, 4), (20.0, 2), (29.0, 2), (31.0, 1), (200.0, 1)] {
        let mut governor = governor(Fidelity::AUTO);
        let mut regions = row(3, 1.0);
        regions[2].signals.spin_rad_s = spin_rad_s;
        assert_eq!(rates_after(&mut governor, &regions, 200), [1, 4, rate], "{spin_rad_s} rad/s");
        // A region whose bodies come to spin faster is stepped more often.
        regions[1].signals.spin_rad_s = 40.0;
        assert_eq!(rates_after(&mut governor, &regions, 40)[1], 1);
    }
}

#[test]
fn what_overlaps_more_than_at_full_rate_becomes_finer() {
    let mut governor = governor(Fidelity::Tolerance { m_s: 0.3 });
    let mut regions = row(3, 1.0);
    // An overlap that is as deep at any rate is no fault of the rate.
    regions[1].signals.overlap_m = 0.5;
    regions[2].signals.overlap_m = 0.01;
    assert_eq!(rates_after(&mut governor, &regions, 200), [1, 4, 4]);
    // The tolerance of 0.3 m/s over four ticks: 20 mm.
    regions[2].signals.overlap_m = 0.029;
    assert_eq!(rates_after(&mut governor, &regions, 100)[2], 4);
    regions[2].signals.overlap_m = 0.031;
    assert!(rates_after(&mut governor, &regions, 100)[2] < 4);
}

#[test]
fn a_region_that_comes_into_view_is_computed_in_full_at_once() {
    let mut governor = governor(Fidelity::AUTO);
    let regions = row(6, 1.0);
    assert_eq!(rates_after(&mut governor, &regions, 100)[5], 4);
    governor.look(LookedAt::From(vec![Viewpoint { at: [55.0, 0.0, 0.0], radius_m: 1.0 }]));
    assert_eq!(rates_after(&mut governor, &regions, 1)[5], 1);
}

/// Returns the regions that stay behind in each of some ticks. They are stepped as they are told.
fn ticks(governor: &mut Governor, regions: &mut [RegionState], ticks: std::ops::Range<u64>) -> Vec<Vec<u32>> {
    let tick = |tick| {
        let behind = schedule(governor, tick, regions, 1).behind;
        for region in regions.iter_mut() {
            region.behind = if behind.contains(&region.region) { region.behind + 1 } else { 0 };
        }
        behind.into_iter().map(|region| region.0).collect()
    };
    ticks.map(tick).collect()
}

#[test]
fn lower_rates_are_given_up_where_all_would_look_farther_ahead_for_little() {
    let mut governor = governor(Fidelity::AUTO);
    let mut regions = row(20, 1.0);
    let mut behind_in = |governor: &mut Governor, bound: usize, span: std::ops::Range<u64>| {
        for (rank, region) in regions.iter_mut().enumerate() {
            region.bound = if rank < bound { (0..bound).collect() } else { RegionSet::EMPTY };
        }
        ticks(governor, &mut regions, span).iter().filter(|behind| !behind.is_empty()).count()
    };
    let tried = behind_in(&mut governor, 19, 0..400);
    assert!((20..150).contains(&tried), "in {tried} of 400 ticks one of twenty is behind");
    assert_eq!(behind_in(&mut governor, 19, 400..2_000), 0);
    assert!(behind_in(&mut governor, 8, 2_000..2_400) > 250, "when more may be");
}

#[test]
fn regions_catch_up_by_turns_and_those_that_share_something_together() {
    let mut governor = governor(Fidelity::AUTO);
    let mut regions = row(6, 1.0);
    let _ = ticks(&mut governor, &mut regions, 1..200);
    let behind = ticks(&mut governor, &mut regions, 200..208);
    let stepped = |id: u32| (0..8).filter(|&k| !behind[k].contains(&id)).collect::<Vec<_>>();
    assert_eq!(stepped(0), (0..8).collect::<Vec<_>>(), "in view");
    let mut begins: Vec<_> = (1..6).map(|id| stepped(id)[0]).collect();
    (1..6).for_each(|id| assert_eq!(stepped(id).len(), 2, "{id}: {behind:?}"));
    begins.sort_unstable();
    assert_eq!(begins, [0, 1, 1, 2, 3], "no tick has all of them");
    // One of them is bound to the other.
    regions[2].bound = RegionSet::only(4);
    let behind = ticks(&mut governor, &mut regions, 208..240);
    assert!(behind[4..].iter().all(|tick| tick.contains(&2) == tick.contains(&4)), "{behind:?}");
    // That one is bound to a region that is looked at.
    regions[4].bound = RegionSet::only(0);
    let behind = ticks(&mut governor, &mut regions, 240..260);
    assert!(behind.iter().all(|tick| !tick.contains(&2) && !tick.contains(&4)), "{behind:?}");
    assert!(behind.iter().any(|tick| tick.contains(&3)));
}

#[test]
fn what_rests_and_what_is_urgent_does_not_stay_behind() {
    let mut governor = governor(Fidelity::AUTO);
    let mut regions = row(4, 1.0);
    let _ = ticks(&mut governor, &mut regions, 1..200);
    (regions[2].rests, regions[3].urgent) = (true, true);
    let behind = ticks(&mut governor, &mut regions, 200..220);
    assert_eq!(governor.report().levels, [2, 0, 2]);
    assert!(behind.iter().all(|tick| tick.iter().all(|&id| id == 1)), "{behind:?}");
    assert!(behind.iter().any(|tick| tick == &[1]));
}

/// Returns the share of ticks above the budget, where a step of one tick of the region `k` takes
/// `full_ms(tick, k)`. What regions tell of that is a smoothed mean, as in a real world.
fn over_budget(
    tick_ms: f32,
    ticks: std::ops::Range<u64>,
    full_ms: impl Fn(u64, u32) -> f32,
    is_urgent: impl Fn(u64, u32) -> bool,
) -> f64 {
    let mut governor = governor(Fidelity::Budget { tick_ms });
    let mut regions = row(24, 0.0);
    let (mut over, begin) = (0, ticks.start);
    for tick in 0..ticks.end {
        regions.iter_mut().for_each(|state| state.urgent = is_urgent(tick, state.region.0));
        let behind = schedule(&mut governor, tick, &regions, 1).behind;
        let mut took_ms = 0.0;
        for state in &mut regions {
            if behind.contains(&state.region) {
                state.behind += 1;
                continue;
            }
            let span = state.behind + 1;
            let full_ms = full_ms(tick, state.region.0);
            state.step_ms += (1.0 - 0.9_f32.powi(span.into())) * (full_ms - state.step_ms);
            took_ms += f64::from(full_ms) * relative_time(4, span);
            state.behind = 0;
        }
        governor.note_tick(0, 1.1 * took_ms, took_ms);
        governor.end_tick();
        over += u64::from(tick >= begin && 1.1 * took_ms > f64::from(tick_ms));
    }
    over as f64 / (ticks.end - begin) as f64
}

/// Returns a number of -1 to 1 that looks like chance.
fn noise(tick: u64, k: u32) -> f32 {
    (drawn(tick * 64 + u64::from(k)) >> 40) as f32 / (1 << 23) as f32 - 1.0
}

#[test]
fn a_budget_is_kept_in_99_of_100_ticks_whatever_steps_take() {
    let steady = |_, k: u32| 0.5 + 0.05 * (k % 8) as f32;
    let noisy = |tick, k| steady(tick, k) * (1.0 + 0.2 * noise(tick, k));
    // Each region has its ups and downs, of several seconds.
    let swells = |tick: u64, k: u32| noisy(tick, k) * (1.0 + 0.4 * (0.02 * tick as f32 + k as f32).sin());
    let never = |_, _| false;
    // In each second others must be stepped in every tick, for half of it.
    let now_and_then = |tick: u64, k: u32| tick % 60 < 30 && (u64::from(k) + tick / 60).is_multiple_of(6);
    let doubles = |tick, k| if tick < 600 { 1.0 } else { 2.0 } * noisy(tick, k);
    let sum_ms: f32 = (0..24).map(|k| 1.1 * steady(0, k)).sum();
    for (part, may_be_kept) in [(0.55, false), (0.65, true), (0.75, true), (0.9, true)] {
        let budget_ms = part * sum_ms;
        let over = |full_ms: &dyn Fn(u64, u32) -> f32| over_budget(budget_ms, 60..1_200, full_ms, never);
        for (what, over) in [
            ("steady", over(&steady)),
            ("noisy", over(&noisy)),
            ("swells", over(&swells)),
            ("doubles", over_budget(2.0 * budget_ms, 660..1_800, doubles, never)),
            ("is urgent", over_budget(budget_ms, 60..1_200, noisy, now_and_then)),
        ] {
            // Little more than half is the least that regions can take, of which a sixth are stepped in every tick.
            let is_kept = over <= 0.01 || what == "is urgent" && !may_be_kept;
            assert!(is_kept, "what {what}: {over} of the ticks are above {part} of the time in full");
        }
    }
}

#[test]
fn a_budget_is_kept_by_each_process_for_itself() {
    let mut governor = governor(Fidelity::Budget { tick_ms: 10.0 });
    let mut regions = row(6, 1.5);
    // The odd regions are those of a process that is slower by far.
    regions.iter_mut().skip(1).step_by(2).for_each(|region| region.step_ms = 6.0);
    for tick in 0..20 {
        schedule(&mut governor, tick, &regions, 2);
    }
    let rates: Vec<_> = governor.paces().values().map(|pace| pace.rate).collect();
    assert!([0, 2, 4].iter().all(|k| rates[*k] == 1) && [1, 3, 5].iter().all(|k| rates[*k] > 1), "{rates:?}");
}

#[test]
fn an_audit_falls_on_each_region_as_often_as_its_steps_have_bodies() {
    let mut governor = governor(Fidelity::AUTO);
    let mut regions = row(4, 1.0);
    regions[0].awake = 10_000;
    regions[1].awake = 0;
    regions[2].awake = 30_000;
    regions[3].rests = true;
    let mut picked = [0; 4];
    for tick in 0..2_000 {
        if let Some(pick) = schedule(&mut governor, tick, &regions, 1).audit {
            picked[pick.region.0 as usize] += 1;
            governor.note_audited(pick.region, &Audited { error_m_s: Some(0.1), cost: 400.0 });
        }
    }
    let part = f64::from(picked[2]) / f64::from(picked[0] + picked[2]);
    assert_eq!((picked[1], picked[3]), (0, 0));
    // A hundredth of the 17,500 bodies that are stepped per tick pays for one audit in about three ticks.
    assert!(picked[0] + picked[2] > 400 && (0.7..0.8).contains(&part), "{picked:?}");
    assert!((governor.report().error_m_s - 0.1).abs() < 1e-6);
}
