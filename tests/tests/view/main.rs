//! Tests the viewer of `dcd run`, `dcd serve` and `dcd client` as real processes: the stream that the page
//! reads, who may read it, the page as seen in a browser, and the glTF files of what is shown.

mod film;
mod process;
mod replay;
mod seen;
mod stream;
