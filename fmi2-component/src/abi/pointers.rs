//! From C arrays and strings to Rust ones.

use std::borrow::Cow;
use std::ffi::{CStr, c_char};
use std::mem::MaybeUninit;

use crate::refusal::Refusal;

/// No call needs more elements; a larger count is a negative or uninitialised number.
const MOST: usize = 1 << 20;

/// The elements of an array that is read.
#[inline]
pub(super) unsafe fn input<'a, T>(pointer: *const T, count: usize, what: &str) -> Result<&'a [T], Refusal> {
    if count == 0 {
        return Ok(&[]);
    }
    check(pointer, count, what)?;
    // SAFETY: not NULL, aligned, of a sane size, and by the contract of `abi` as long as its count says.
    Ok(unsafe { std::slice::from_raw_parts(pointer, count) })
}

/// The places of an array that is written.
#[inline]
pub(super) unsafe fn output<'a, T>(
    pointer: *mut T,
    count: usize,
    what: &str,
) -> Result<&'a mut [MaybeUninit<T>], Refusal> {
    if count == 0 {
        return Ok(&mut []);
    }
    check(pointer, count, what)?;
    // SAFETY: as above; what the master's memory holds now is not looked at.
    Ok(unsafe { std::slice::from_raw_parts_mut(pointer.cast(), count) })
}

/// The elements of two arrays that belong together, to be read.
#[inline]
pub(super) unsafe fn inputs<'a, T, U>(
    (first, second): (*const T, *const U),
    count: usize,
    what: &[&str; 2],
) -> Result<(&'a [T], &'a [U]), Refusal> {
    if count == 0 {
        return Ok((&[], &[]));
    }
    check_both((first, second), count, what)?;
    // SAFETY: neither is NULL, both are aligned, of a sane size, and by the contract of `abi` as long as the count says.
    Ok(unsafe {
        (
            std::slice::from_raw_parts(first, count),
            std::slice::from_raw_parts(second, count),
        )
    })
}

/// The elements of an array that is read, and the places of one that is written.
#[inline]
pub(super) unsafe fn input_and_output<'a, T, U>(
    (first, second): (*const T, *mut U),
    count: usize,
    what: &[&str; 2],
) -> Result<(&'a [T], &'a mut [MaybeUninit<U>]), Refusal> {
    if count == 0 {
        return Ok((&[], &mut []));
    }
    check_both((first, second.cast_const()), count, what)?;
    // SAFETY: as above; what the master's memory holds now is not looked at.
    Ok(unsafe {
        (
            std::slice::from_raw_parts(first, count),
            std::slice::from_raw_parts_mut(second.cast(), count),
        )
    })
}

/// The place of a single answer.
#[inline]
pub(super) unsafe fn place<'a, T>(pointer: *mut T, what: &str) -> Result<&'a mut MaybeUninit<T>, Refusal> {
    // SAFETY: passed on.
    unsafe { output(pointer, 1, what) }.map(|places| &mut places[0])
}

/// The text of a C string; what is not UTF-8 in it is replaced.
pub(super) unsafe fn text<'a>(pointer: *const c_char) -> Option<Cow<'a, str>> {
    if pointer.is_null() {
        return None;
    }
    // SAFETY: not NULL, and by the standard it ends in NUL.
    Some(unsafe { CStr::from_ptr(pointer) }.to_string_lossy())
}

#[inline]
fn check<T>(pointer: *const T, count: usize, what: &str) -> Result<(), Refusal> {
    if pointer.is_null() || !pointer.is_aligned() || count > MOST {
        return Err(refuse(pointer.is_null(), count, what));
    }
    Ok(())
}

#[inline]
fn check_both<T, U>((first, second): (*const T, *const U), count: usize, what: &[&str; 2]) -> Result<(), Refusal> {
    let aligned = first.is_aligned() & second.is_aligned();
    if !aligned | first.is_null() | second.is_null() | (count > MOST) {
        return Err(refuse_one((first, second), count, what));
    }
    Ok(())
}

#[cold]
#[inline(never)]
fn refuse_one<T, U>((first, second): (*const T, *const U), count: usize, what: &[&str; 2]) -> Refusal {
    match check(first, count, what[0]) {
        Err(refusal) => refusal,
        Ok(()) => refuse(second.is_null(), count, what[1]),
    }
}

#[cold]
fn refuse(null: bool, count: usize, what: &str) -> Refusal {
    Refusal::error(if null {
        format!("{what} is NULL; expected an array of {count}")
    } else if count > MOST {
        format!("the count of {what} is {count}; allowed are at most {MOST}")
    } else {
        format!("{what} is not aligned; expected an array of {count}")
    })
}
