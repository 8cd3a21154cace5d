//! The C ABI of the module: the only file with `unsafe`, which is memory that the page reads and writes.
//!
//! The module has no imports. A page writes bytes to what [`alloc`] returned, calls, and reads the block that comes back: its
//! length in 4 bytes (little endian), 4 bytes of zero, then so many bytes. Blocks begin at multiples of 8, so that the arrays of a
//! reply can be read in place; [`free_reply`] frees them.

use std::alloc::{alloc as allocate, dealloc, handle_alloc_error, Layout};
use std::cell::RefCell;

use crate::answer::answer;
use crate::model::Model;

const HEAD: usize = 8;

thread_local! {
    /// The models that are loaded; the handle of one is its place and 1.
    static MODELS: RefCell<Vec<Option<Model>>> = const { RefCell::new(Vec::new()) };
    static LAST_ERROR: RefCell<String> = const { RefCell::new(String::new()) };
}

fn layout(size: usize) -> Layout {
    match Layout::from_size_align(size.max(1), HEAD) {
        Ok(layout) => layout,
        Err(_) => handle_alloc_error(Layout::new::<u64>()),
    }
}

/// Memory for `len` bytes.
#[no_mangle]
pub extern "C" fn alloc(len: usize) -> *mut u8 {
    let layout = layout(len);
    // SAFETY: the size of the layout is not zero.
    let start = unsafe { allocate(layout) };
    if start.is_null() {
        handle_alloc_error(layout);
    }
    start
}

/// Frees what [`alloc`] returned for the same `len`.
///
/// # Safety
/// `ptr` is what [`alloc`] returned, and was not freed.
#[no_mangle]
pub unsafe extern "C" fn free(ptr: *mut u8, len: usize) {
    // SAFETY: the caller vouches for the pointer; the layout is that of `alloc`.
    unsafe { dealloc(ptr, layout(len)) }
}

/// Loads a model; its handle, or 0 if it is refused.
///
/// # Safety
/// `len` bytes can be read at `ptr`.
#[no_mangle]
pub unsafe extern "C" fn load(ptr: *const u8, len: usize) -> u32 {
    // SAFETY: the caller vouches for it.
    let bytes = unsafe { std::slice::from_raw_parts(ptr, len) };
    match Model::from_bytes(bytes) {
        Ok(model) => MODELS.with_borrow_mut(|models| {
            let place = models.iter().position(Option::is_none);
            let place = place.unwrap_or_else(|| {
                models.push(None);
                models.len() - 1
            });
            models[place] = Some(model);
            place as u32 + 1
        }),
        Err(refusal) => {
            LAST_ERROR.set(refusal.text);
            0
        }
    }
}

/// Why the last model was refused, as a block.
#[no_mangle]
pub extern "C" fn last_error() -> *mut u8 {
    LAST_ERROR.with_borrow(|text| block(text.as_bytes()))
}

/// Forgets a model.
#[no_mangle]
pub extern "C" fn drop_model(handle: u32) {
    MODELS.with_borrow_mut(|models| {
        let place = (handle as usize).checked_sub(1);
        if let Some(model) = place.and_then(|place| models.get_mut(place)) {
            *model = None;
        }
    });
}

/// The reply to a request, as a block; a null pointer for a handle of no model.
///
/// # Safety
/// `len` bytes can be read at `ptr`.
#[no_mangle]
pub unsafe extern "C" fn ask(handle: u32, ptr: *const u8, len: usize) -> *mut u8 {
    MODELS.with_borrow(|models| {
        let place = (handle as usize).checked_sub(1);
        let model = place.and_then(|place| models.get(place)?.as_ref());
        let Some(model) = model else {
            return std::ptr::null_mut();
        };
        // SAFETY: the caller vouches for it.
        unsafe { answered(ptr, len, |request| answer(model, request)) }
    })
}

/// What a function makes of bytes of the page, as a block: for further functions of a module.
///
/// # Safety
/// `len` bytes can be read at `ptr`.
pub unsafe fn answered(ptr: *const u8, len: usize, make: impl FnOnce(&[u8]) -> Vec<u8>) -> *mut u8 {
    // SAFETY: the caller vouches for it.
    block(&make(unsafe { std::slice::from_raw_parts(ptr, len) }))
}

/// Frees a block.
///
/// # Safety
/// `ptr` is a block of this module, and was not freed.
#[no_mangle]
pub unsafe extern "C" fn free_reply(ptr: *mut u8) {
    // SAFETY: a block begins with its length, and `block` allocated it with its head.
    unsafe {
        let length = ptr.cast::<u32>().read() as usize;
        free(ptr, HEAD + length);
    }
}

fn block(bytes: &[u8]) -> *mut u8 {
    let start = alloc(HEAD + bytes.len());
    // SAFETY: so many bytes were allocated, aligned for a number of 8 bytes.
    unsafe {
        start.cast::<u64>().write(bytes.len() as u64);
        std::ptr::copy_nonoverlapping(bytes.as_ptr(), start.add(HEAD), bytes.len());
    }
    start
}
