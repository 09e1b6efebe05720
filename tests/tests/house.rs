//! Tests the house rules that no compiler checks: files depend on each other in one direction only, and begin
//! by saying what they do.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// The names of a module, from the crate's root.
type Module = Vec<String>;

/// Returns the paths after each `use` of a file outside its tests, one per item, without a leading `::`, and
/// the paths from the crate's root that stand in its code.
fn imports(source: &str) -> Vec<Vec<String>> {
    let code = source.split("\nmod tests {").next().unwrap_or(source);
    let (mut paths, mut statement) = (Vec::new(), String::new());
    for line in code.lines().map(str::trim) {
        let line = line.split("//").next().unwrap_or(line);
        let begins = line.starts_with("use ") || line.starts_with("pub") && line.contains(" use ");
        if begins || !statement.is_empty() {
            statement.push_str(line);
        } else {
            paths.extend(inline_paths(line));
        }
        if let Some((import, _)) = statement.split_once(';') {
            let tree = import.split_once("use ").expect("it began so").1;
            spell_out(&[], tree, &mut paths);
            statement.clear();
        }
    }
    paths
}

/// Returns the paths `crate::a::b` in a line of code; of `pub(in crate::a)` too, which leads to an ancestor.
fn inline_paths(line: &str) -> impl Iterator<Item = Vec<String>> {
    line.split("crate::").skip(1).map(|rest| {
        let is_name = |letter: char| letter.is_alphanumeric() || "_:".contains(letter);
        let path = rest.split(|letter| !is_name(letter)).next().unwrap_or_default();
        let names = path.split("::").filter(|name| !name.is_empty()).map(str::to_owned);
        std::iter::once("crate".to_owned()).chain(names).collect()
    })
}

/// Appends one path for each name in a tree of imports.
fn spell_out(before: &[String], tree: &str, paths: &mut Vec<Vec<String>>) {
    let (head, group) = tree.split_once('{').map_or((tree, None), |(head, group)| (head, Some(group)));
    let mut path = before.to_vec();
    let head = head.split(" as ").next().unwrap_or(head);
    path.extend(head.split("::").map(str::trim).filter(|name| !name.is_empty()).map(str::to_owned));
    let Some(group) = group else { return paths.push(path) };
    let group = group.trim_end().strip_suffix('}').expect("a group of imports ends");
    let (mut depth, mut from) = (0, 0);
    for (at, letter) in group.char_indices().chain([(group.len(), ',')]) {
        match letter {
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 0 => {
                let item = group[from..at].trim();
                if !item.is_empty() {
                    spell_out(&path, item, paths);
                }
                from = at + 1;
            }
            _ => {}
        }
    }
}

/// Returns the file that a path leads to, seen from a module: the longest beginning of the path that is a
/// file.
fn target(from: &Module, path: &[String], files: &BTreeMap<Module, PathBuf>) -> Option<Module> {
    let mut at: Module = match path.first()?.as_str() {
        "crate" => Vec::new(),
        "self" => from.clone(),
        "super" => from[..from.len().checked_sub(1)?].to_vec(),
        child if files.contains_key(&[&from[..], &[child.to_owned()]].concat()) => {
            [&from[..], &[child.to_owned()]].concat()
        }
        _ => return None,
    };
    for name in &path[1..] {
        match name.as_str() {
            "super" => drop(at.pop()),
            _ => at.push(name.clone()),
        }
    }
    while !files.contains_key(&at) {
        at.pop()?;
    }
    Some(at)
}

/// Adds all files below a folder, by module.
fn files_below(folder: &Path, module: &Module, files: &mut BTreeMap<Module, PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_stem().unwrap().to_str().unwrap().to_owned();
        let below = || [&module[..], std::slice::from_ref(&name)].concat();
        if path.is_dir() {
            files_below(&path, &below(), files);
        } else if path.extension().is_some_and(|extension| extension == "rs") && name != "tests" {
            let of = if ["mod", "lib"].contains(&name.as_str()) { module.clone() } else { below() };
            files.insert(of, path);
        }
    }
}

/// The modules to which each module leads.
type Edges = BTreeMap<Module, BTreeSet<Module>>;

/// Returns to which files each file leads, except for a module and its own children.
fn edges(sources: &BTreeMap<Module, String>, files: &BTreeMap<Module, PathBuf>) -> Edges {
    let kin = |a: &Module, b: &Module| a.starts_with(b) || b.starts_with(a);
    let of = |(module, source): (&Module, &String)| {
        let targets = imports(source).into_iter().filter_map(|path| target(module, &path, files));
        (module.clone(), targets.filter(|other| !kin(module, other)).collect())
    };
    sources.iter().map(of).collect()
}

/// Returns to which folders of the crate's root each folder leads. Files of tests alone are left out: they may
/// use what stands above.
fn edges_of_folders(sources: &BTreeMap<Module, String>, edges: &Edges) -> Edges {
    let is_for_tests = |module: &Module| {
        (1..=module.len()).any(|len| {
            let declared = |parent: &String| {
                let name = &module[len - 1];
                ["", "pub(crate) ", "pub(super) "]
                    .iter()
                    .any(|seen| parent.contains(&format!("#[cfg(test)]\n{seen}mod {name};")))
            };
            sources.get(&module[..len - 1]).is_some_and(declared)
        })
    };
    let folder = |module: &Module| module[..1].to_vec();
    let mut folders = Edges::new();
    for (module, targets) in edges.iter().filter(|(module, _)| !module.is_empty() && !is_for_tests(module)) {
        let targets = targets.iter().map(folder).filter(|target| *target != folder(module));
        folders.entry(folder(module)).or_default().extend(targets);
    }
    folders
}

/// Returns the groups of modules that lead to each other.
fn circles(leads_to: &Edges) -> Vec<BTreeSet<Module>> {
    let reached = |from: &Module| {
        let (mut seen, mut open) = (BTreeSet::new(), vec![from.clone()]);
        while let Some(module) = open.pop() {
            for next in leads_to.get(&module).into_iter().flatten() {
                if seen.insert(next.clone()) {
                    open.push(next.clone());
                }
            }
        }
        seen
    };
    let reach: BTreeMap<&Module, BTreeSet<Module>> =
        leads_to.keys().map(|module| (module, reached(module))).collect();
    let mut found: Vec<BTreeSet<Module>> = Vec::new();
    for (module, reached) in reach.iter().filter(|(module, reached)| reached.contains(**module)) {
        let leads_back = |other: &&Module| reach.get(other).is_some_and(|back| back.contains(*module));
        let circle = reached.iter().filter(leads_back).cloned().collect();
        if !found.contains(&circle) {
            found.push(circle);
        }
    }
    found
}

#[test]
fn no_two_files_or_folders_import_each_other_but_a_module_and_its_own_children() {
    for (crate_folder, files_at_least) in [("dcd", 200), ("dcd-ffi", 40), ("benches", 60)] {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(crate_folder).join("src");
        let mut files = BTreeMap::new();
        files_below(&root, &Vec::new(), &mut files);
        let sources: BTreeMap<Module, String> =
            files.iter().map(|(module, path)| (module.clone(), fs::read_to_string(path).unwrap())).collect();
        let count: usize = sources.values().map(|source| imports(source).len()).sum();
        let found = format!("{crate_folder}: {} files with {count} imports", files.len());
        assert!(files.len() >= files_at_least && count > 5 * files.len(), "{found} were found");
        let edges = edges(&sources, &files);
        let mut all_circles = circles(&edges);
        // In dcd-ffi a topic's types, which the registry keeps, share a folder with its entry points, which ask
        // the registry.
        if crate_folder != "dcd-ffi" {
            all_circles.extend(circles(&edges_of_folders(&sources, &edges)));
        }
        assert!(all_circles.is_empty(), "{crate_folder}: these lead to each other: {all_circles:#?}");
    }
}

#[test]
fn a_circle_is_found_through_groups_and_over_several_files() {
    let module = |name: &str| name.split("::").map(str::to_owned).collect::<Module>();
    let read = |texts: &[(&str, &str)]| {
        let sources: BTreeMap<Module, String> =
            texts.iter().map(|(name, text)| (module(name), (*text).to_owned())).collect();
        let files = sources.keys().map(|module| (module.clone(), PathBuf::new())).collect();
        let edges = edges(&sources, &files);
        (sources, edges)
    };
    let of = |texts: &[(&str, &str)]| circles(&read(texts).1);
    let pair = [
        ("physics", "mod a;\nmod b;\npub use a::A;\n"),
        ("physics::a", "use std::fmt;\n\nuse super::{b::{B, C as D}, c};\n"),
        ("physics::b", "//! use crate::nothing;\npub(super) use crate::physics::a::A;\n"),
    ];
    assert_eq!(of(&pair), [BTreeSet::from([module("physics::a"), module("physics::b")])]);
    assert!(of(&pair[..2]).is_empty());
    let three = [
        ("a", "use crate::b::x;\n"),
        ("b", "use crate::c;\n"),
        ("c", "use super::a;\n\n#[cfg(test)]\nmod tests {\n    use crate::b;\n}\n"),
        ("c::d", "use super::super::b;\n"),
    ];
    assert_eq!(of(&three).len(), 1);
    assert_eq!(of(&three)[0].len(), 3, "a child of one of them is only led to");

    let of_folders = |texts: &[(&str, &str)]| {
        let (sources, edges) = read(texts);
        assert!(circles(&edges).is_empty(), "no two files do");
        circles(&edges_of_folders(&sources, &edges))
    };
    let inline =
        ("low::b", "fn make() {\n    drop(Box::<crate::high::Tool>::default()); // crate::low::a\n}\n");
    let folders = [
        ("high", ""),
        ("high::d", "use crate::low::a::A;\n"),
        ("low", "mod a;\n#[cfg(test)]\nmod b;\n"),
        ("low::a", ""),
        inline,
    ];
    assert!(of_folders(&folders).is_empty(), "tests may use what stands above");
    let folders = [folders[0], folders[1], ("low", "mod a;\nmod b;\n"), folders[3], inline];
    assert_eq!(of_folders(&folders), [BTreeSet::from([module("high"), module("low")])]);
}

/// Returns whether a file begins with a sentence about it that has a verb: `//! Computes ...`,
/// `//! Defines, ...`.
fn says_what_it_does(source: &str) -> bool {
    let verb = source.strip_prefix("//! ").and_then(|line| line.split(' ').next()).unwrap_or_default();
    let verb = verb.strip_suffix(',').unwrap_or(verb);
    verb.starts_with(|first: char| first.is_ascii_uppercase()) && verb.len() > 2 && verb.ends_with('s')
}

/// Adds the paths of all Rust files below a folder.
fn rust_files(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let is_output = path.ends_with("target");
        match path.extension() {
            Some(extension) if extension == "rs" => found.push(path),
            None if path.is_dir() && !is_output => rust_files(&path, found),
            _ => {}
        }
    }
}

#[test]
fn every_file_says_first_what_it_does() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut files = Vec::new();
    for crate_folder in ["dcd", "dcd-ffi", "benches", "tests", "fuzz"] {
        rust_files(&root.join(crate_folder), &mut files);
    }
    assert!(files.len() > 500, "{} files were found", files.len());
    let silent: Vec<_> =
        files.iter().filter(|path| !says_what_it_does(&fs::read_to_string(path).unwrap())).collect();
    assert!(silent.is_empty(), "the first line of these has no verb: {silent:#?}");
    assert!(says_what_it_does("//! Creates, finds and destroys bodies.\n"));
    for silent in
        ["", "use std::fmt;\n", "//! The format of states.\n", "//! Taking in what others say.\n", "//! is\n"]
    {
        assert!(!says_what_it_does(silent), "{silent}");
    }
}
