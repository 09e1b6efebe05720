//! Reads fields from the front of untrusted bytes.

/// The bytes that are left to read. Its methods return `None` when the bytes end too early.
pub(super) struct Fields<'a>(pub(super) &'a [u8]);

impl<'a> Fields<'a> {
    /// Takes the next `N` bytes.
    pub(super) fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (head, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(*head)
    }

    /// Takes a field whose length in bytes the two bytes before it give.
    pub(super) fn take_counted(&mut self) -> Option<&'a [u8]> {
        let length = u16::from_be_bytes(self.take()?);
        let (head, rest) = self.0.split_at_checked(usize::from(length))?;
        self.0 = rest;
        Some(head)
    }

    /// Returns `None` if bytes are left.
    pub(super) fn end(&self) -> Option<()> {
        self.0.is_empty().then_some(())
    }
}

/// Writes a field that [`Fields::take_counted`] reads.
///
/// # Panics
/// When `field` is longer than 65,535 bytes; dcd's certificates and tokens are far shorter.
pub(super) fn put_counted(bytes: &mut Vec<u8>, field: &[u8]) {
    let length = u16::try_from(field.len()).expect("fields of joins are short");
    bytes.extend(length.to_be_bytes());
    bytes.extend(field);
}
