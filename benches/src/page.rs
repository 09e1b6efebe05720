//! Replaces the generated parts of `results/README.md`: tables between markers, made from the CSVs.

use std::error::Error;
use std::path::Path;

use crate::results::write_file;

/// Puts a table between `<!-- NAME: … -->` and `<!-- /NAME -->` of a page. A page without the markers stays as it is, and so
/// does a folder without a page: results may be written anywhere.
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

/// A table of Markdown.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_stands_between_its_markers_is_replaced() {
        let page =
            "a\n<!-- speed: made by x -->\nold\n<!-- /speed -->\nb\n<!-- maps: y -->\nkept\n<!-- /maps -->\n";
        let new = replaced(page, "speed", "| new |\n").unwrap();
        assert_eq!(new, page.replace("old", "| new |"));
        assert_eq!(replaced(&new, "speed", "| new |\n").unwrap(), new);
        assert_eq!(replaced(page, "chart", "x"), None);
    }
}
