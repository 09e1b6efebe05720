//! Names the shared library for the dynamic linker, so that a program finds the version that it was linked with.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    let version = |part: &str| std::env::var(format!("CARGO_PKG_VERSION_{part}")).expect("cargo sets it");
    let (major, minor) = (version("MAJOR"), version("MINOR"));
    // Before 1.0 every minor version may break programs.
    let abi = if major == "0" { format!("0.{minor}") } else { major };
    if std::env::var("CARGO_CFG_TARGET_OS").is_ok_and(|os| os == "linux") {
        println!("cargo::rustc-cdylib-link-arg=-Wl,-soname,libdcd.so.{abi}");
    }
}
