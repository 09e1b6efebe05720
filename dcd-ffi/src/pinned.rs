//! Lends arrays that C may go on reading after they were filled anew.

/// Array lent to C. When it grows, it keeps the old memory, so that a late reader reads old numbers, never freed memory. Sizes are
/// powers of two, so what is kept is never more than what is in use.
#[derive(Debug)]
pub(crate) struct Pinned<T> {
    live: Vec<T>,
    retired: Vec<Vec<T>>,
}

impl<T> Default for Pinned<T> {
    fn default() -> Self {
        Self { live: Vec::new(), retired: Vec::new() }
    }
}

impl<T> Pinned<T> {
    /// Empties the array and makes room. Pushing up to `count` items does not move it.
    pub(crate) fn refill(&mut self, count: usize) -> &mut Vec<T> {
        self.live.clear();
        if self.live.capacity() < count {
            let grown = Vec::with_capacity(count.next_power_of_two());
            let old = std::mem::replace(&mut self.live, grown);
            if old.capacity() > 0 {
                self.retired.push(old);
            }
        }
        &mut self.live
    }

    pub(crate) fn len(&self) -> usize {
        self.live.len()
    }

    /// Returns the address for C: null when there is nothing.
    pub(crate) fn as_ptr(&self) -> *const T {
        if self.live.is_empty() { std::ptr::null() } else { self.live.as_ptr() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_handed_out_survives_growth() {
        let mut array = Pinned::default();
        array.refill(3).extend([1, 2, 3]);
        let early = array.as_ptr();
        array.refill(1000).extend(0..1000);
        // SAFETY: `Pinned` keeps the memory that it grew out of, which is what this test is about.
        assert_eq!(unsafe { std::slice::from_raw_parts(early, 3) }.len(), 3);
        assert_eq!((array.len(), array.retired.len()), (1000, 1));
        array.refill(1024);
        assert_eq!(array.retired.len(), 1);
    }

    #[test]
    fn an_empty_array_is_null() {
        assert!(Pinned::<u64>::default().as_ptr().is_null());
    }
}
