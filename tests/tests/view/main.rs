//! Tests the viewer of `dcd run`, `dcd serve` and `dcd client` as real processes: the stream that their page reads, who may read it, and
//! the page as seen in a browser; and the glTF files of what they show.

mod film;
mod process;
mod replay;
mod seen;
mod stream;
