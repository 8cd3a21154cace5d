//! Where the extension takes its memory from: small pieces from mimalloc, long ones from the system.

use std::alloc::{GlobalAlloc, Layout, System};
use std::ptr::copy_nonoverlapping;

use mimalloc::MiMalloc;

/// Pieces of up to so many bytes are small.
const LARGEST_SMALL: usize = 1024;

/// A run with many contacts takes and frees thousands of small pieces per millisecond, which mimalloc does faster than the
/// system. Long pieces are few. The system returns them sooner than mimalloc, which keeps a run within the memory that
/// it may take.
pub struct BySize;

/// Calls the allocator of pieces of this size.
macro_rules! of_size {
    ($size:expr, $name:ident($($argument:expr),*)) => {
        if $size <= LARGEST_SMALL {
            MiMalloc.$name($($argument),*)
        } else {
            System.$name($($argument),*)
        }
    };
}

// SAFETY: the size in the layout, which callers repeat when they free a piece, tells which allocator it is from; both keep
// to the contract of `GlobalAlloc`.
unsafe impl GlobalAlloc for BySize {
    #[inline]
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        of_size!(layout.size(), alloc(layout))
    }

    #[inline]
    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        of_size!(layout.size(), alloc_zeroed(layout))
    }

    #[inline]
    unsafe fn dealloc(&self, piece: *mut u8, layout: Layout) {
        of_size!(layout.size(), dealloc(piece, layout));
    }

    unsafe fn realloc(&self, piece: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        if (layout.size() <= LARGEST_SMALL) == (size <= LARGEST_SMALL) {
            return of_size!(size, realloc(piece, layout, size));
        }
        // SAFETY: callers guarantee that the size, rounded up to the alignment, is a valid one.
        let moved = self.alloc(Layout::from_size_align_unchecked(size, layout.align()));
        if !moved.is_null() {
            // SAFETY: both pieces are valid for the smaller size, and are not the same.
            copy_nonoverlapping(piece, moved, layout.size().min(size));
            self.dealloc(piece, layout);
        }
        moved
    }
}
