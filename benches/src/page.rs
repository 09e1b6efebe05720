//! Replaces the generated parts of `results/README.md`: tables between markers, made from the CSVs.

use std::error::Error;
use std::path::Path;

use crate::machine::Machine;
use crate::results::write_file;

/// Puts a table between `<!-- NAME: … -->` and `<!-- /NAME -->` of the page in a folder. A page without the
/// markers stays as it is, and so does a folder without a page: results may be written anywhere.
pub(crate) fn put(folder: &Path, name: &str, table: &str) -> Result<(), Box<dyn Error>> {
    let path = folder.join("README.md");
    let Ok(page) = std::fs::read_to_string(&path) else {
        return Ok(());
    };
    match replaced(&page, name, table) {
        Some(page) => write_file(&path, page.as_bytes()),
        None => Ok(()),
    }
}

fn replaced(page: &str, name: &str, table: &str) -> Option<String> {
    let start = page.find(&format!("<!-- {name}:"))?;
    let from = start + page[start..].find("-->")? + "-->".len();
    let to = from + page[from..].find(&format!("<!-- /{name} -->"))?;
    Some(format!("{}\n{}\n{}", &page[..from], table.trim_end(), &page[to..]))
}

/// Returns a table in Markdown.
pub(crate) fn table(head: &[&str], rows: impl IntoIterator<Item = Vec<String>>) -> String {
    let line = |cells: Vec<String>| format!("| {} |\n", cells.join(" | "));
    let mut text = line(head.iter().map(|&cell| cell.to_owned()).collect());
    text += &line(head.iter().map(|_| "---".to_owned()).collect());
    for row in rows {
        assert_eq!(row.len(), head.len(), "a table has as many cells in every row");
        text += &line(row);
    }
    text
}

/// Returns the text of a cell, bold unless it is within its gate.
pub(crate) fn bold_unless(text: String, holds: bool) -> String {
    if holds { text } else { format!("**{text}**") }
}

/// Returns a sentence that says when, at which commits and on which machines something was measured.
pub(crate) fn measured<'a>(what: &str, machines: impl Iterator<Item = &'a Machine> + Clone) -> String {
    let each = |of: fn(&Machine) -> String| {
        let mut all: Vec<String> = Vec::new();
        machines.clone().map(of).for_each(|one| {
            if !all.contains(&one) {
                all.push(one)
            }
        });
        all
    };
    let mut days = each(|machine| machine.date.clone());
    days.sort_unstable();
    let days = match &days[..] {
        [] => return "Not measured yet.".to_owned(),
        [day] => format!("on {day}"),
        [first, .., last] => format!("from {first} to {last}"),
    };
    let commits = each(|machine| machine.commit.clone()).join(", ");
    let machines = each(|machine| format!("{}, {} cores", machine.cpu, machine.cores)).join("; ");
    format!("{what} measured {days} at {commits} ({machines}).")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_stands_between_its_markers_is_replaced() {
        let page =
            "a\n<!-- scale: made by x -->\nold\n<!-- /scale -->\nb\n<!-- maps: y -->\nkept\n<!-- /maps -->\n";
        let new = replaced(page, "scale", "| new |\n").unwrap();
        assert_eq!(new, page.replace("old", "| new |"));
        assert_eq!(replaced(&new, "scale", "| new |\n").unwrap(), new);
        assert_eq!(replaced(page, "thesis", "x"), None);
    }

    #[test]
    fn days_commits_and_machines_of_rows_are_each_named_once() {
        let machine = |date: &str, commit: &str| Machine {
            cpu: "AMD EPYC".into(),
            cores: 2,
            date: date.into(),
            commit: commit.into(),
        };
        let [a, b, c] =
            [machine("2026-11-25", "e1"), machine("2026-11-20", "b2"), machine("2026-11-25", "e1")];
        assert_eq!(
            measured("Rows", [&a].into_iter()),
            "Rows measured on 2026-11-25 at e1 (AMD EPYC, 2 cores)."
        );
        let all = "Errors measured from 2026-11-20 to 2026-11-25 at e1, b2 (AMD EPYC, 2 cores).";
        assert_eq!(measured("Errors", [&a, &b, &c].into_iter()), all);
        assert_eq!(measured("Rows", [].into_iter()), "Not measured yet.");
    }
}
