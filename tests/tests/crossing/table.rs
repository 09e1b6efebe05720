//! Tests that the tests named in the table of Rapier's features, `dcd/RAPIER.md`, exist.

use std::fs;
use std::path::Path;

#[test]
fn every_feature_that_the_table_promises_names_its_tests_and_these_exist() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let text = fs::read_to_string(root.join("dcd/RAPIER.md")).unwrap();
    let is_row = |line: &&str| line.starts_with("| ") && !line.starts_with("| feature of Rapier");
    let (mut rows, mut wrong) = (0, Vec::new());
    for row in text.lines().filter(is_row) {
        rows += 1;
        let cells: Vec<_> = row.split('|').map(str::trim).collect();
        let [_, feature, fate, tests, _] = cells[..] else { panic!("three cells: {row}") };
        let promised = fate.starts_with("yes") || fate.starts_with("limit");
        assert!(promised || fate.starts_with("no"), "{feature}: {fate}");
        // A feature that is only compiled, or tested by a doc test, says so.
        if promised && tests.is_empty() && !fate.contains("not tried") && !fate.contains("tried by") {
            wrong.push(format!("{feature}: no test"));
        }
        for test in tests.split(", ").filter(|test| !test.is_empty()) {
            let found = test.trim_matches('`').split_once("::").and_then(|(file, name)| {
                let places = [root.join("tests/tests").join(file), root.join(file)];
                let source = places.iter().find_map(|path| fs::read_to_string(path).ok())?;
                source.contains(&format!("fn {name}(")).then_some(())
            });
            if found.is_none() {
                wrong.push(format!("{feature}: there is no {test}"));
            }
        }
    }
    assert!(rows > 90, "only {rows} rows");
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
}
