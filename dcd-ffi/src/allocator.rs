//! Allocates by functions of the program's (feature `allocator`).

use std::ffi::c_void;

use crate::guard::guard;
use crate::status::{DCD_ERR_NULL, DcdStatus, Failure};

/// Returns `size` bytes, above 0, aligned to `alignment`, a power of two; null if there are none, which ends the process.
pub type DcdAllocateFn =
    Option<unsafe extern "C" fn(context: *mut c_void, size: usize, alignment: usize) -> *mut c_void>;
/// Frees what DcdAllocateFn returned for this size and alignment.
pub type DcdFreeFn =
    Option<unsafe extern "C" fn(context: *mut c_void, block: *mut c_void, size: usize, alignment: usize)>;

/// Has all that the library allocates come from these functions, from now to the end of the process: to be called before any other
/// function of the library, once.
///
/// Any thread may call them, several at a time, also from within every call of the library. They must return normally and call nothing of
/// the library. The library must have been built with it: cargo build -p dcd-ffi --release --features allocator.
/// Errors: DCD_ERR_NULL (a function), DCD_ERR_BUSY when the library has allocated already, DCD_ERR_UNSUPPORTED without the feature.
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

/// The program's functions.
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
    /// Something was allocated before there were functions: it is freed where it came from, so there will be none.
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

    /// The program's allocator, or the one that the library has without.
    struct Allocator;

    #[cfg(not(feature = "mimalloc"))]
    const BASE: std::alloc::System = std::alloc::System;
    #[cfg(feature = "mimalloc")]
    const BASE: mimalloc::MiMalloc = mimalloc::MiMalloc;

    #[global_allocator]
    static ALLOCATOR: Allocator = Allocator;

    // SAFETY: either all blocks are of the base allocator or all of the program's functions, as `set` sees to; each keeps to the contract.
    unsafe impl GlobalAlloc for Allocator {
        unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
            match FUNCTIONS.get() {
                // SAFETY: the layout is not of size 0.
                Some(own) => unsafe { (own.allocate)(own.context, layout.size(), layout.align()) }.cast(),
                None => {
                    ALLOCATED.store(true, Ordering::Relaxed);
                    // SAFETY: passed on.
                    unsafe { BASE.alloc(layout) }
                }
            }
        }

        unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
            match FUNCTIONS.get() {
                // SAFETY: the block is of `allocate`.
                Some(own) => unsafe {
                    (own.free)(own.context, block.cast(), layout.size(), layout.align());
                },
                // SAFETY: passed on.
                None => unsafe { BASE.dealloc(block, layout) },
            }
        }

        unsafe fn realloc(&self, block: *mut u8, layout: Layout, size: usize) -> *mut u8 {
            if FUNCTIONS.get().is_none() {
                // SAFETY: passed on.
                return unsafe { BASE.realloc(block, layout, size) };
            }
            // SAFETY: the caller gives a size that is valid with this alignment; both blocks are as large as is copied.
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
