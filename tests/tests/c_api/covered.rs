//! Tests that the checkers of this folder call everything that the headers declare: each function from C,
//! each also once in a call that must fail, and each wrapper from C++.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use crate::library::declared;
use crate::toolchain::root;

/// Functions whose calls cannot fail: they return no status.
const NEVER_FAIL: [&str; 8] = [
    "dcd_body_is_valid",
    "dcd_joint_is_valid",
    "dcd_last_error",
    "dcd_refused_string",
    "dcd_status_string",
    "dcd_version",
    "dcd_version_string",
    "dcd_world_is_valid",
];

/// Returns the text of all sources with this file extension, in a folder of the repository and below.
fn sources(folder: &str, ending: &str) -> String {
    fn add(folder: &Path, ending: &str, all: &mut String) {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                add(&path, ending, all);
            } else if path.extension().is_some_and(|extension| extension == ending) {
                *all += &std::fs::read_to_string(path).unwrap();
            }
        }
    }
    let mut all = String::new();
    add(&root().join(folder), ending, &mut all);
    all
}

fn is_of_name(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

/// Returns the names that a text calls: each name before an opening bracket.
fn called(text: &str) -> BTreeSet<&str> {
    let before = text.match_indices('(').map(|(at, _)| &text[..at]);
    before.filter_map(|before| before.rsplit(|c| !is_of_name(c)).next()).collect()
}

/// Returns the arguments of a call, from the text behind its opening bracket.
fn arguments(text: &str) -> Vec<&str> {
    let (mut found, mut from, mut depth) = (Vec::new(), 0, 0);
    let (mut quote, mut is_escaped) = (None, false);
    for (at, c) in text.char_indices() {
        match (quote, c) {
            _ if is_escaped => is_escaped = false,
            (Some(_), '\\') => is_escaped = true,
            (Some(open), _) => quote = quote.filter(|_| c != open),
            (None, '"' | '\'') => quote = Some(c),
            (None, '(' | '[' | '{') => depth += 1,
            (None, ')' | ']' | '}') if depth > 0 => depth -= 1,
            (None, ',' | ')') if depth == 0 => {
                found.push(text[from..at].trim());
                from = at + 1;
                if c == ')' {
                    break;
                }
            }
            _ => {}
        }
    }
    found
}

/// Returns the functions of the checks that expect a call to fail: not those called for an argument of it.
fn called_wrongly(text: &str) -> BTreeSet<&str> {
    let checks = ["FAILS(", "EXPECT("].into_iter().flat_map(|check| text.split(check).skip(1));
    let fails = checks.filter_map(|rest| match arguments(rest)[..] {
        [call, code, ..] if code.starts_with("DCD_ERR_") => call.split('(').next(),
        _ => None,
    });
    fails.collect()
}

/// Returns for each function of `dcd.h` the wrappers of `dcd.hpp` that call it.
fn wrappers(header: &str) -> BTreeMap<String, BTreeSet<&str>> {
    let mut wrappers = BTreeMap::<_, BTreeSet<_>>::new();
    let (functions, mut wrapper) = (declared(), "");
    for line in header.lines() {
        // A wrapper begins in the namespace or the class. Its body is indented more, or follows on the same
        // line.
        let depth = line.len() - line.trim_start_matches(' ').len();
        let head = line.trim_start().split('(').next().unwrap_or_default();
        let is_statement = head.starts_with("return ") || head == "Status status";
        if line.contains('(') && depth <= 4 && !is_statement && !head.starts_with(['/', '*', '#', '{', '}']) {
            wrapper = head.rsplit(|c| !is_of_name(c)).next().unwrap_or_default();
        }
        for word in line.split(|c| !is_of_name(c)).filter(|word| functions.contains(*word)) {
            wrappers.entry(word.to_owned()).or_default().insert(wrapper);
        }
    }
    wrappers
}

fn without(functions: &BTreeSet<String>, has: impl Fn(&str) -> bool) -> Vec<&String> {
    functions.iter().filter(|function| !has(function)).collect()
}

#[test]
fn a_call_that_fails_is_told_from_its_arguments_and_from_what_follows() {
    let text = "FAILS(dcd_a(dcd_b(), \"dcd_c(,\"), DCD_ERR_NULL, \"out\")\nOK(dcd_d());\n\
                EXPECT(dcd_e(), DCD_OK);\nHOLDS(dcd_f() == DCD_ERR_NULL);\n\
                EXPECT(dcd_g((DcdWorld){ 0, 1 }, '\\''),\n       DCD_ERR_STRUCT);";
    assert_eq!(called_wrongly(text), BTreeSet::from(["dcd_a", "dcd_g"]));
}

#[test]
fn each_function_is_called_by_a_checker_and_once_wrongly() {
    let (checkers, functions) = (sources("tests/tests/c_api", "c"), declared());
    let (called, wrongly) = (called(&checkers), called_wrongly(&checkers));
    let never = without(&functions, |function| called.contains(function));
    assert!(never.is_empty(), "no checker in C calls {never:?}");
    let never = without(&functions, |function| wrongly.contains(function) || NEVER_FAIL.contains(&function));
    assert!(never.is_empty(), "no checker sees these fail: {never:?}");
    let fails: Vec<_> = NEVER_FAIL.iter().filter(|function| !functions.contains(**function)).collect();
    assert!(fails.is_empty(), "the list of what never fails has what is not there: {fails:?}");
}

#[test]
fn each_wrapper_is_called_from_cpp() {
    let header = std::fs::read_to_string(root().join("include/dcd.hpp")).unwrap();
    let programs = sources("tests", "cpp") + &sources("examples-c", "cpp");
    let (wrappers, called) = (wrappers(&header), called(&programs));
    assert_eq!(wrappers.len(), declared().len());
    let never: Vec<_> = wrappers
        .iter()
        .filter(|(_, names)| !names.iter().any(|name| called.contains(name)))
        .map(|(function, names)| format!("{function} by {names:?}"))
        .collect();
    assert!(never.is_empty(), "nothing in C++ calls {}", never.join(", "));
}
