//! Tests a budget that cannot be kept, the error that is stated, and settings that are refused.

use dcd::physics::Measured as _;

use super::*;

#[test]
fn a_budget_that_cannot_be_kept_loses_and_doubles_no_body_and_counts_what_is_over() {
    // A tenth of a microsecond.
    let mut world = world(&town(4), Fidelity::Budget { tick_ms: 1e-4 }, 2);
    let bodies: Vec<_> = world.states().map(|(id, ..)| id).collect();
    // The first second does not count.
    run(&mut world, 60);
    assert_eq!(world.fidelity_report().unwrap().overruns, 0);
    let mut shed = 0;
    for over in 1..=240 {
        world.step().unwrap();
        let census = world.census();
        assert_eq!((census.lost(&bodies), census.doubled()), (0, 0), "{over}");
        assert_eq!(world.fidelity_report().unwrap().overruns, over);
        let levels = levels(&world);
        assert_eq!(levels.iter().sum::<usize>(), 24, "{levels:?}");
        // In single ticks regions are in full, since something urgent happens in them. Which, depends on
        // the paces, and so on the time that steps take.
        shed = shed.max(levels[2]);
    }
    assert_eq!(world.host().validate(), []);
    assert!(shed >= 22, "what is looked at is shed, too: {shed} of 24");
    assert!(world.stats().transfers >= 8, "cars pass from region to region: {:?}", world.stats());
}

#[test]
fn the_stated_error_is_the_true_one() {
    let mut within = Vec::new();
    for (name, key, n) in [("pile", "n", 300), ("ragdolls", "count", 24), ("dve", "n", 400)] {
        let mut scene = Scene::open(name, &Params::default().with(key, n)).unwrap();
        // Everything is seen only from an empty region beside it.
        let [min, max] = [scene.bounds.min, scene.bounds.max];
        scene.bounds = Bounds::new([min[0] - 200.0, min[1], min[2]], max);
        scene.cuts = vec![(Axis::X, min[0] - 100.0)];
        scene.viewpoints = vec![Viewpoint { at: [min[0] - 150.0, 0.0, 0.0], radius_m: 1.0 }];
        for fidelity in [Fidelity::AUTO, ALL_COARSE] {
            let mut world = world(&scene, fidelity, 1);
            world.set_audited(0.5);
            world.audit_all();
            run(&mut world, 240);
            let stated = world.fidelity_report().unwrap();
            let truth = world.host().true_error_m_s().unwrap() as f32;
            println!("{name} {fidelity:?}: true {truth}, stated {stated:?}");
            within.push((stated.low95_m_s..=stated.high95_m_s).contains(&truth));
            assert!(stated.high95_m_s.is_finite(), "{name}: {stated:?}");
        }
    }
    let held = within.iter().filter(|within| **within).count();
    assert!(held + 1 >= within.len(), "{held} of {}", within.len());
}

#[test]
fn what_cannot_be_is_refused() {
    let refused = |fidelity, coupling| {
        let mut config = WorldConfig { fidelity, ..WorldConfig::default() };
        config.step = config.step.with_coupling(coupling);
        LocalWorld::new(config).err().map(|error| error.to_string())
    };
    assert_eq!(refused(Fidelity::AUTO, Coupling::Auto), None);
    let why = refused(Fidelity::AUTO, Coupling::Owner).unwrap();
    assert!(why.contains("fidelity") && why.contains("owner"), "{why}");
    for unfit in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        assert!(
            refused(Fidelity::Budget { tick_ms: unfit }, Coupling::Auto)
                .unwrap()
                .contains("fidelity.tick_ms")
        );
        assert!(
            refused(Fidelity::Tolerance { m_s: unfit }, Coupling::Auto).unwrap().contains("fidelity.m_s")
        );
    }
    let mut world = LocalWorld::new(WorldConfig::default()).unwrap();
    let unfit = Viewpoint { at: [f64::NAN, 0.0, 0.0], radius_m: 1.0 };
    assert!(world.set_viewpoints(&[unfit]).unwrap_err().to_string().contains("viewpoint"));
    for (text, fidelity) in [
        ("auto", Some(Fidelity::AUTO)),
        ("budget=8", Some(Fidelity::Budget { tick_ms: 8.0 })),
        ("budget=-1", None),
        ("sharp", None),
    ] {
        assert_eq!(text.parse::<Fidelity>().ok(), fidelity, "{text}");
    }
}
