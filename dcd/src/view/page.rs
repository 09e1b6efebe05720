//! Holds the files of the page: they are part of the program, and load nothing from elsewhere.

macro_rules! files {
    ($($path:literal: $kind:literal, $file:literal;)*) => {
        const FILES: &[(&str, &str, &[u8])] = &[$(($path, $kind, include_bytes!(concat!("page/", $file)))),*];
    };
}

files! {
    "/": "text/html; charset=utf-8", "index.html";
    "/view.css": "text/css; charset=utf-8", "view.css";
    "/main.js": "text/javascript; charset=utf-8", "main.js";
    "/wire.js": "text/javascript; charset=utf-8", "wire.js";
    "/scene.js": "text/javascript; charset=utf-8", "scene.js";
    "/shapes.js": "text/javascript; charset=utf-8", "shapes.js";
    "/camera.js": "text/javascript; charset=utf-8", "camera.js";
    "/timeline.js": "text/javascript; charset=utf-8", "timeline.js";
}

/// Returns the MIME type and the content of the file at this path.
pub(super) fn file(path: &str) -> Option<(&'static str, &'static [u8])> {
    let &(_, kind, content) = FILES.iter().find(|(name, ..)| *name == path)?;
    Some((kind, content))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_is_small_and_whole() {
        let size: usize = FILES.iter().map(|(.., content)| content.len()).sum();
        assert!(size <= 100_000, "{size} bytes");
        let (_, html) = file("/").unwrap();
        let html = std::str::from_utf8(html).unwrap();
        for address in html.split(['"', '\'']).filter(|part| part.starts_with('/') || part.contains("://")) {
            assert!(file(address).is_some(), "{address}");
        }
    }
}
