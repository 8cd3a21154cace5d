//! What the module has beside the functions of the engine: the only file with `unsafe`, as memory comes from the page.

use filippov_web::abi::answered;

use crate::reply::reply;

/// The reply to a text in UTF-8, as a block.
///
/// # Safety
/// `len` bytes can be read at `ptr`.
#[no_mangle]
pub unsafe extern "C" fn read(ptr: *const u8, len: usize) -> *mut u8 {
    // SAFETY: the caller vouches for it.
    unsafe { answered(ptr, len, |bytes| reply(&String::from_utf8_lossy(bytes))) }
}
