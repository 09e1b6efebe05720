//! Calls the system's C compiler, and links to the `libdcd_ffi.a` of the same build.

use std::ffi::OsStr;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::sync::OnceLock;
use std::time::{Duration, Instant};

/// The native libraries that Rust's standard library needs on Linux. `library.rs` checks that the list is
/// right.
pub(crate) const NATIVE_LIBS: [&str; 7] = ["-lgcc_s", "-lutil", "-lrt", "-lpthread", "-lm", "-ldl", "-lc"];

/// A limit longer than any of our programs takes on a busy machine, valgrind included.
const PATIENCE: Duration = Duration::from_secs(600);

/// Returns the root of the repository.
pub(crate) fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the package lies in the workspace").to_owned()
}

/// Returns the folder of this test's profile, such as `target/debug`, which also has the library.
fn profile_dir() -> PathBuf {
    let test = std::env::current_exe().expect("a test has a path");
    test.parent().and_then(Path::parent).expect("tests lie in <profile>/deps").to_owned()
}

/// Returns cargo's name of this test's profile.
pub(crate) fn profile() -> String {
    let name =
        profile_dir().file_name().and_then(OsStr::to_str).expect("profiles have plain names").to_owned();
    if name == "debug" { "dev".to_owned() } else { name }
}

/// Returns the folder that has the C library, which cargo builds as a dependency of this test.
pub(crate) fn library_dir() -> PathBuf {
    profile_dir().join("deps")
}

/// Returns the folder in which cargo builds.
pub(crate) fn target_dir() -> PathBuf {
    profile_dir().parent().expect("profiles lie in the target directory").to_owned()
}

/// Removes from a command's environment what cargo tells this test about its package. An inner cargo would
/// otherwise build packages again.
pub(crate) fn forget_cargo(command: &mut Command) -> &mut Command {
    for (name, _) in std::env::vars_os() {
        if name
            .to_str()
            .is_some_and(|name| name.starts_with("CARGO_PKG_") || name.starts_with("CARGO_MANIFEST_"))
        {
            command.env_remove(name);
        }
    }
    command
}

/// Returns a compiler of the system: `CC` or `cc`, `CXX` or `c++`.
pub(crate) fn compiler(variable: &str, default: &str) -> Command {
    let mut compiler = Command::new(std::env::var_os(variable).unwrap_or_else(|| default.into()));
    compiler.arg("-I").arg(root().join("include"));
    compiler
}

/// The warning flags of all our C and C++ programs.
pub(crate) const STRICT: [&str; 4] = ["-Wall", "-Wextra", "-pedantic", "-Werror"];

/// Compiles a C or C++ program and links it to the static library. Returns the program.
pub(crate) fn build(source: &Path, out: &Path, flags: &[&str]) -> PathBuf {
    build_with(source, out, flags, &library_dir().join("libdcd_ffi.a"))
}

/// The same with another build of the library.
pub(crate) fn build_with(source: &Path, out: &Path, flags: &[&str], library: &Path) -> PathBuf {
    let program = out.join(source.file_stem().expect("a source has a name"));
    let mut compiler = if source.extension() == Some(OsStr::new("cpp")) {
        let mut cxx = compiler("CXX", "c++");
        cxx.arg("-std=c++17");
        cxx
    } else {
        let mut cc = compiler("CC", "cc");
        cc.args(["-std=c11", "-Wstrict-prototypes"]);
        cc
    };
    compiler.arg("-g").args(STRICT).args(flags).arg(source);
    compiler.arg(library).args(NATIVE_LIBS).arg("-o").arg(&program);
    if let Some(folder) = fast_linker() {
        compiler.arg("-B").arg(folder).arg("-fuse-ld=lld");
    }
    run_well(&mut compiler);
    program
}

/// Returns the folder of the linker that comes with Rust, if it does. It takes half a second where the system's
/// takes four, and there are scores of programs. Those that a Makefile or CMake builds get the system's.
fn fast_linker() -> Option<&'static Path> {
    static FOUND: OnceLock<Option<PathBuf>> = OnceLock::new();
    let find = || {
        let rustc = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
        let said = Command::new(rustc).args(["--print", "sysroot"]).output().ok()?;
        let targets = Path::new(str::from_utf8(&said.stdout).ok()?.trim()).join("lib/rustlib");
        let targets = std::fs::read_dir(targets).ok()?.flatten();
        targets.map(|target| target.path().join("bin/gcc-ld")).find(|folder| folder.join("ld.lld").is_file())
    };
    FOUND.get_or_init(find).as_deref()
}

/// The exit status and the output of a program.
pub(crate) struct Outcome {
    pub status: ExitStatus,
    pub stdout: String,
    pub stderr: String,
}

/// Runs a program to its end. Fails the test if it does not end in time.
pub(crate) fn run(command: &mut Command) -> Outcome {
    let mut child =
        command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("the program starts");
    let read = |mut from: Box<dyn Read + Send>| {
        std::thread::spawn(move || {
            let mut text = String::new();
            from.read_to_string(&mut text).expect("the program writes text");
            text
        })
    };
    let stdout = read(Box::new(child.stdout.take().expect("it is piped")));
    let stderr = read(Box::new(child.stderr.take().expect("it is piped")));
    let deadline = Instant::now() + PATIENCE;
    let status = loop {
        if let Some(status) = child.try_wait().expect("a child can be waited for") {
            break status;
        }
        if Instant::now() > deadline {
            child.kill().expect("a child can be killed");
            panic!("{command:?} does not end within {PATIENCE:?}");
        }
        std::thread::sleep(Duration::from_millis(5));
    };
    let text = |reader: std::thread::JoinHandle<String>| reader.join().expect("the reader does not panic");
    Outcome { status, stdout: text(stdout), stderr: text(stderr) }
}

/// Runs a program that must succeed, and returns its output.
pub(crate) fn run_well(command: &mut Command) -> String {
    let outcome = run(command);
    let Outcome { status, stdout, stderr } = &outcome;
    assert!(status.success(), "{command:?} ends with {status}\n{stdout}\n{stderr}");
    outcome.stdout
}

/// Returns whether a tool is installed.
pub(crate) fn is_installed(tool: &str) -> bool {
    let probe = Command::new(tool).arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status();
    probe.is_ok_and(|status| status.success())
}
