//! Allocates memory by functions of the program (feature `allocator`).

use std::ffi::c_void;

use crate::guard::guard;
use crate::status::{DCD_ERR_NULL, DcdStatus, Failure};

/// Returns a block of `size` bytes, above 0, aligned to `alignment`, a power of two. Returns null if there is no memory, which ends
/// the process.
pub type DcdAllocateFn =
    Option<unsafe extern "C" fn(context: *mut c_void, size: usize, alignment: usize) -> *mut c_void>;
/// Frees a block that DcdAllocateFn returned for this size and alignment.
pub type DcdFreeFn =
    Option<unsafe extern "C" fn(context: *mut c_void, block: *mut c_void, size: usize, alignment: usize)>;

/// Sets the functions by which the library allocates all of its memory, from now to the end of the process. Call it once, before
/// any other function of the library.
///
/// Any thread may call the functions, several threads at a time, also from within every call of the library. They must return
/// normally and call nothing of the library. The library must have been built with the feature: cargo build -p dcd-ffi --release
/// --features allocator.
/// Errors: DCD_ERR_NULL (a function), DCD_ERR_BUSY (the library has allocated already), DCD_ERR_UNSUPPORTED (built without the
/// feature).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_allocator_set(
    allocate: DcdAllocateFn,
    free: DcdFreeFn,
    context: *mut c_void,
) -> DcdStatus {
    guard("dcd_allocator_set", || {
        let missing = |name| Failure::new(DCD_ERR_NULL, format!("{name} is null; give both functions"));
        let allocate = allocate.ok_or_else(|| missing("allocate"))?;
        let free = free.ok_or_else(|| missing("free"))?;
        set(Functions { allocate, free, context })
    })
}

/// The program's functions, and the context they are called with.
#[cfg_attr(not(feature = "allocator"), expect(dead_code, reason = "they are only checked"))]
struct Functions {
    allocate: unsafe extern "C" fn(*mut c_void, usize, usize) -> *mut c_void,
    free: unsafe extern "C" fn(*mut c_void, *mut c_void, usize, usize),
    context: *mut c_void,
}

#[cfg(not(feature = "allocator"))]
fn set(_: Functions) -> Result<(), Failure> {
    Err(Failure::new(
        crate::status::DCD_ERR_UNSUPPORTED,
        "this library was built without it; build it with: cargo build -p dcd-ffi --release --features allocator",
    ))
}

#[cfg(feature = "allocator")]
use by_functions::set;

#[cfg(feature = "allocator")]
mod by_functions {
    use std::alloc::{GlobalAlloc, Layout};
    use std::sync::OnceLock;
    use std::sync::atomic::{AtomicBool, Ordering};

    use super::Functions;
    use crate::status::{DCD_ERR_BUSY, Failure};

    // SAFETY: the header asks for functions that any thread may call with this context.
    unsafe impl Send for Functions {}
    // SAFETY: as above.
    unsafe impl Sync for Functions {}

    static FUNCTIONS: OnceLock<Functions> = OnceLock::new();
    /// Says whether something was allocated before there were functions. It is freed where it came from, so no functions can be set any
    /// more.
    static ALLOCATED: AtomicBool = AtomicBool::new(false);

    pub(super) fn set(functions: Functions) -> Result<(), Failure> {
        if ALLOCATED.load(Ordering::Relaxed) {
            return Err(late());
        }
        FUNCTIONS.set(functions).map_err(|_| late())
    }

    #[cold]
    fn late() -> Failure {
        Failure::new(
            DCD_ERR_BUSY,
            "the library has allocated already; call it once, before all other functions of the library",
        )
    }

    /// Allocates by the program's functions; without them, by the allocator that the library has otherwise.
    struct Allocator;

    #[cfg(not(feature = "mimalloc"))]
    const BASE: std::alloc::System = std::alloc::System;
    #[cfg(feature = "mimalloc")]
    const BASE: mimalloc::MiMalloc = mimalloc::MiMalloc;

    #[global_allocator]
    static ALLOCATOR: Allocator = Allocator;

    // SAFETY: all blocks come either from the base allocator or from the program's functions, as `set` ensures; each keeps to the
    // contract.
    unsafe impl GlobalAlloc for Allocator {
        unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
            match FUNCTIONS.get() {
                // SAFETY: the layout is not of size 0.
                Some(own) => unsafe { (own.allocate)(own.context, layout.size(), layout.align()) }.cast(),
                None => {
                    ALLOCATED.store(true, Ordering::Relaxed);
                    // SAFETY: the caller upholds the same contract.
                    unsafe { BASE.alloc(layout) }
                }
            }
        }

        unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
            match FUNCTIONS.get() {
                // SAFETY: the block came from `allocate`.
                Some(own) => unsafe {
                    (own.free)(own.context, block.cast(), layout.size(), layout.align());
                },
                // SAFETY: the caller upholds the same contract.
                None => unsafe { BASE.dealloc(block, layout) },
            }
        }

        unsafe fn realloc(&self, block: *mut u8, layout: Layout, size: usize) -> *mut u8 {
            if FUNCTIONS.get().is_none() {
                // SAFETY: the caller upholds the same contract.
                return unsafe { BASE.realloc(block, layout, size) };
            }
            // SAFETY: the caller gives a size that is valid with this alignment, and both blocks are at least as large as what is
            // copied.
            unsafe {
                let moved = self.alloc(Layout::from_size_align_unchecked(size, layout.align()));
                if !moved.is_null() {
                    block.copy_to_nonoverlapping(moved, layout.size().min(size));
                    self.dealloc(block, layout);
                }
                moved
            }
        }
    }
}
