//! Checks pointers and numbers from C before anything is done with them.

use std::ffi::{CStr, c_char};
use std::net::SocketAddr;

use crate::limits::{DCD_MAX_COORDINATE, DCD_MAX_ITEMS, DCD_MAX_NUMBER};
use crate::status::{DCD_ERR_NULL, DCD_ERR_STRUCT, Failure};

/// Struct that begins with its own size, so that it can grow under old programs.
///
/// # Safety
/// The first member is a `u32` named `struct_size`, and any bit pattern is a valid value.
pub(crate) unsafe trait Sized32: Copy {
    const NAME: &'static str;
}

/// Memory that a result goes into once the call has succeeded.
#[derive(Debug)]
pub(crate) struct Out<T>(*mut T);

impl<T> Out<T> {
    /// # Safety
    /// The pointer is null or valid for writing one `T` until the call returns.
    pub(crate) unsafe fn new(pointer: *mut T, name: &str) -> Result<Self, Failure> {
        check(pointer, name).map(|()| Self(pointer))
    }

    /// Returns `None` for a null pointer.
    ///
    /// # Safety
    /// As [`Out::new`].
    pub(crate) unsafe fn optional(pointer: *mut T, name: &str) -> Result<Option<Self>, Failure> {
        // SAFETY: the caller upholds the same contract.
        if pointer.is_null() { Ok(None) } else { unsafe { Self::new(pointer, name).map(Some) } }
    }

    pub(crate) fn write(self, value: T) {
        // SAFETY: checked for null and alignment in `new`; its caller vouches for the rest.
        unsafe { self.0.write(value) }
    }
}

impl<T: Sized32> Out<T> {
    /// # Safety
    /// As [`Out::new`], and `struct_size` is initialised.
    pub(crate) unsafe fn sized(pointer: *mut T, name: &str) -> Result<Self, Failure> {
        // SAFETY: the caller upholds the same contract.
        unsafe { check_size(pointer, name)? };
        Ok(Self(pointer))
    }
}

/// # Safety
/// The pointer is null or valid for reading one `T`.
pub(crate) unsafe fn read<T: Copy>(pointer: *const T, name: &str) -> Result<T, Failure> {
    check(pointer, name)?;
    // SAFETY: checked for null and alignment; the caller vouches for the rest.
    Ok(unsafe { pointer.read() })
}

/// # Safety
/// The pointer is null or valid for reading one `T`, or as much of it as its `struct_size` says.
pub(crate) unsafe fn read_sized<T: Sized32>(pointer: *const T, name: &str) -> Result<T, Failure> {
    // SAFETY: the caller upholds the same; with the right size all of `T` is there.
    unsafe {
        check_size(pointer, name)?;
        Ok(pointer.read())
    }
}

/// # Safety
/// The pointer is valid for reading `count` values of `T` that nobody writes during the call, or `count` is 0.
pub(crate) unsafe fn slice<'a, T>(pointer: *const T, count: usize, name: &str) -> Result<&'a [T], Failure> {
    check_count(count, name)?;
    if count == 0 {
        return Ok(&[]);
    }
    check(pointer, name)?;
    // SAFETY: not null, aligned, of a bounded length; the caller vouches for the rest.
    Ok(unsafe { std::slice::from_raw_parts(pointer, count) })
}

/// # Safety
/// The pointer is null or a NUL-terminated string that nobody writes during the call.
pub(crate) unsafe fn text<'a>(pointer: *const c_char, name: &str) -> Result<&'a str, Failure> {
    check(pointer, name)?;
    // SAFETY: not null; the caller vouches for the NUL.
    let bytes = unsafe { CStr::from_ptr(pointer) };
    bytes.to_str().map_err(|_| Failure::argument(format!("{name} is not UTF-8; convert it first")))
}

/// Reads a text that may be null.
///
/// # Safety
/// As for [`text`].
pub(crate) unsafe fn optional<'a>(pointer: *const c_char, name: &str) -> Result<Option<&'a str>, Failure> {
    // SAFETY: the caller upholds the same contract.
    if pointer.is_null() { Ok(None) } else { unsafe { text(pointer, name).map(Some) } }
}

/// Reads an address to listen at.
pub(crate) fn address(text: &str, name: &str) -> Result<SocketAddr, Failure> {
    text.parse().map_err(|_| {
        Failure::argument(format!("{name} is \"{text}\"; give an address and a port, as \"0.0.0.0:7420\""))
    })
}

/// Reads an address to listen at, if one is given.
///
/// # Safety
/// As for [`text`].
pub(crate) unsafe fn optional_address(
    pointer: *const c_char,
    name: &str,
) -> Result<Option<SocketAddr>, Failure> {
    // SAFETY: the caller upholds the same contract.
    unsafe { optional(pointer, name)? }.map(|text| address(text, name)).transpose()
}

/// The caller's memory for a list whose length only the call will know.
#[derive(Debug)]
pub(crate) struct Room<T> {
    out: *mut T,
    cap: usize,
    count: Out<usize>,
    name: &'static str,
}

impl<T> Room<T> {
    /// # Safety
    /// `out` is valid for writing `cap` values, or `cap` is 0; `count` is null or valid for writing.
    pub(crate) unsafe fn new(
        out: *mut T,
        cap: usize,
        count: *mut usize,
        [name, count_name]: [&'static str; 2],
    ) -> Result<Self, Failure> {
        // SAFETY: the caller upholds the same contract.
        let count = unsafe { Out::new(count, count_name)? };
        if cap > 0 {
            check(out, name)?;
        }
        Ok(Self { out, cap, count, name })
    }

    /// Writes how many items there are, and all of them if they fit. A caller that gives no memory asks for their number.
    pub(crate) fn fill(self, items: impl ExactSizeIterator<Item = T>) -> Result<(), Failure> {
        self.give(items).map(drop)
    }

    /// Does what [`Room::fill`] does. Returns whether the caller has all items now, and did not ask for their number alone.
    pub(crate) fn give(self, items: impl ExactSizeIterator<Item = T>) -> Result<bool, Failure> {
        let (there, Self { out, cap, count, name }) = (items.len(), self);
        count.write(there);
        if out.is_null() {
            return Ok(there == 0);
        }
        if there > cap {
            return Err(Failure::new(
                crate::status::DCD_ERR_SMALL_BUFFER,
                format!("{name} has room for {cap} and there are {there}; give it more"),
            ));
        }
        for (i, item) in items.take(cap).enumerate() {
            // SAFETY: not null, aligned, and `i` is below `cap`, for which the caller vouches.
            unsafe { out.add(i).write(item) };
        }
        Ok(true)
    }
}

/// Checks that a pointer can point to one or more `T`.
pub(crate) fn check<T>(pointer: *const T, name: &str) -> Result<(), Failure> {
    if pointer.is_null() || !pointer.is_aligned() {
        return Err(bad_pointer(pointer.is_null(), name, align_of::<T>()));
    }
    Ok(())
}

/// Makes the failure of a bad pointer, out of the way of calls that are right, as all functions that only say what is wrong.
#[cold]
fn bad_pointer(is_null: bool, name: &str, alignment: usize) -> Failure {
    if is_null {
        Failure::new(DCD_ERR_NULL, format!("{name} is null; point it to valid memory"))
    } else {
        Failure::argument(format!("{name} is not aligned to {alignment} bytes"))
    }
}

/// Checks that a bulk call of so many items is within bounds.
pub(crate) fn check_count(count: usize, name: &str) -> Result<(), Failure> {
    if count > DCD_MAX_ITEMS {
        return Err(too_many(count, name));
    }
    Ok(())
}

/// Makes the failure of a count out of bounds. A count of more than half of what there can be is a negative number that the caller
/// took for a size.
#[cold]
fn too_many(count: usize, name: &str) -> Failure {
    Failure::argument(match isize::try_from(count) {
        Ok(_) => {
            format!(
                "{name} has a count of {count}, the most is DCD_MAX_ITEMS ({DCD_MAX_ITEMS}); use several calls"
            )
        }
        Err(_) => format!(
            "{name} has a count of {}; give the number of its entries, 0 to DCD_MAX_ITEMS ({DCD_MAX_ITEMS})",
            count.cast_signed()
        ),
    })
}

/// Checks that all numbers are within range.
pub(crate) fn check_numbers(numbers: &[f32], name: &str) -> Result<(), Failure> {
    match numbers.iter().find(|v| !is_in_range(**v)) {
        None => Ok(()),
        Some(v) => Err(Failure::argument(format!(
            "{name} has {v}; give finite numbers within DCD_MAX_NUMBER ({DCD_MAX_NUMBER})"
        ))),
    }
}

/// Returns whether a number stays finite in a step. NaN does not.
pub(crate) fn is_in_range(number: f32) -> bool {
    number.abs() <= DCD_MAX_NUMBER
}

/// Checks that a number stays finite in a step, and is not below 0.
pub(crate) fn check_not_negative(value: f32, name: &str) -> Result<(), Failure> {
    if is_in_range(value) && value >= 0.0 {
        return Ok(());
    }
    Err(Failure::argument(format!("{name} is {value}; give a number from 0 to DCD_MAX_NUMBER")))
}

/// Checks that a number is a fraction: from 0 to 1.
pub(crate) fn check_fraction(value: f32, name: &str) -> Result<(), Failure> {
    match (0.0..=1.0).contains(&value) {
        true => Ok(()),
        false => Err(Failure::argument(format!("{name} is {value}; give a number from 0 to 1"))),
    }
}

/// Checks that a member that is kept for later versions is 0.
pub(crate) fn check_reserved(reserved: u32) -> Result<(), Failure> {
    if reserved == 0 {
        return Ok(());
    }
    Err(Failure::argument(format!("reserved is {reserved}; leave it 0, as the struct's _INIT macro does")))
}

/// Checks that a point of world space is within range.
pub(crate) fn check_point(point: &[f64; 3], name: &str) -> Result<(), Failure> {
    // NaN is not at most anything, so it is refused too.
    if point.iter().all(|v| v.abs() <= DCD_MAX_COORDINATE) {
        return Ok(());
    }
    Err(Failure::argument(format!(
        "{name} is {point:?}; give finite metres within DCD_MAX_COORDINATE ({DCD_MAX_COORDINATE})"
    )))
}

/// # Safety
/// The pointer is null or its first four bytes are initialised.
unsafe fn check_size<T: Sized32>(pointer: *const T, name: &str) -> Result<(), Failure> {
    check(pointer, name)?;
    // SAFETY: a `Sized32` begins with this number.
    let given = unsafe { pointer.cast::<u32>().read() };
    // When a struct grows, its earlier sizes are accepted here, and the rest is filled from its defaults.
    if given as usize == size_of::<T>() {
        return Ok(());
    }
    Err(Failure::new(
        DCD_ERR_STRUCT,
        format!(
            "{name}->struct_size is {given}, {} of this library has {} bytes; initialise it by its _INIT macro and \
             compile against the library's own header",
            T::NAME,
            size_of::<T>()
        ),
    ))
}

pub(crate) fn check_bits(bits: u32, known: u32, name: &str) -> Result<(), Failure> {
    if bits & !known == 0 {
        return Ok(());
    }
    Err(Failure::argument(format!("{name} has bits {:#x} that mean nothing; clear them", bits & !known)))
}
