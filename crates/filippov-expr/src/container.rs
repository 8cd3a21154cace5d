//! The container: the form of everything that is kept as bytes, or sent.
//!
//! Little endian throughout:
//!
//! | bytes | what |
//! |---|---|
//! | 8 | the magic `89 "FLP" 0D 0A 1A 0A`, which a transfer as text would damage |
//! | 4 | version of the format |
//! | 4 | the content, as four letters |
//! | 8 | length of the whole, in bytes |
//! | 4 | number of sections |
//! | ... | sections, each: its tag of four letters, its length (8 bytes), and that many bytes |
//! | 4 | CRC-32 of everything before |
//!
//! A [`Container`] is opened only if all of that holds. Its sections are read in the order in which they were written,
//! each to its end, so equal contents have equal bytes. The checksum finds accidents; it proves nothing about what
//! the sections hold, so a reader checks every value.
//!
//! ```
//! use filippov_expr::container::{Container, Tag, Writer};
//!
//! const POINT: Tag = Tag(*b"PNT ");
//! const PLACE: Tag = Tag(*b"XY  ");
//! let mut writer = Writer::new(POINT);
//! writer.section(PLACE);
//! writer.float(0.5);
//! let bytes = writer.finish();
//!
//! let mut container = Container::open(&bytes, POINT)?;
//! let mut place = container.section(PLACE)?;
//! assert_eq!(place.float()?, 0.5);
//! place.finish()?;
//! container.finish()?;
//! # Ok::<(), filippov_expr::ExprError>(())
//! ```

mod checksum;

use std::fmt;

use crate::error::ExprError;
use checksum::crc32;

/// The version that is written, and the only one that is read.
pub const VERSION: u32 = 1;

const MAGIC: [u8; 8] = *b"\x89FLP\r\n\x1a\n";
const LENGTH_AT: usize = 16;
const COUNT_AT: usize = 24;
const HEADER: usize = 28;
const SECTION_HEADER: usize = 12;
const CHECKSUM: usize = 4;

/// Four letters that name a content or a section.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Tag(pub [u8; 4]);

impl fmt::Display for Tag {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.0.trim_ascii_end().escape_ascii())
    }
}

impl fmt::Debug for Tag {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Tag({self})")
    }
}

/// Writes a container.
pub struct Writer {
    bytes: Vec<u8>,
    n_sections: u32,
    /// Where the section under way begins.
    begin: usize,
}

impl Writer {
    /// A container with this content and no sections.
    pub fn new(content: Tag) -> Self {
        let mut bytes = MAGIC.to_vec();
        bytes.extend(VERSION.to_le_bytes());
        bytes.extend(content.0);
        bytes.resize(HEADER, 0);
        Writer {
            bytes,
            n_sections: 0,
            begin: HEADER,
        }
    }

    /// Begins a section, and ends the one before.
    pub fn section(&mut self, tag: Tag) {
        self.end_section();
        self.bytes.extend(tag.0);
        self.bytes.extend([0; 8]);
        self.n_sections += 1;
        self.begin = self.bytes.len();
    }

    /// One byte.
    pub fn byte(&mut self, value: u8) {
        self.bytes.push(value);
    }

    /// A count or an index, in 4 bytes.
    pub fn number(&mut self, value: usize) {
        debug_assert!(u32::try_from(value).is_ok(), "{value} does not fit");
        self.bytes.extend((value as u32).to_le_bytes());
    }

    /// A floating point number, to the bit.
    pub fn float(&mut self, value: f64) {
        self.bytes.extend(value.to_bits().to_le_bytes());
    }

    /// A count and so many floating point numbers.
    pub fn floats(&mut self, values: &[f64]) {
        self.number(values.len());
        values.iter().for_each(|&value| self.float(value));
    }

    /// A text in UTF-8, with its length.
    pub fn text(&mut self, text: &str) {
        self.number(text.len());
        self.raw(text.as_bytes());
    }

    /// Bytes as they are.
    pub fn raw(&mut self, bytes: &[u8]) {
        self.bytes.extend(bytes);
    }

    /// The bytes of the container.
    pub fn finish(mut self) -> Vec<u8> {
        self.end_section();
        let length = (self.bytes.len() + CHECKSUM) as u64;
        self.bytes[LENGTH_AT..COUNT_AT].copy_from_slice(&length.to_le_bytes());
        self.bytes[COUNT_AT..HEADER].copy_from_slice(&self.n_sections.to_le_bytes());
        let checksum = crc32(&self.bytes);
        self.bytes.extend(checksum.to_le_bytes());
        self.bytes
    }

    fn end_section(&mut self) {
        if self.n_sections > 0 {
            let length = (self.bytes.len() - self.begin) as u64;
            self.bytes[self.begin - 8..self.begin].copy_from_slice(&length.to_le_bytes());
        }
    }
}

/// A container whose magic, version, content, length, sections and checksum are right.
pub struct Container<'a> {
    sections: std::vec::IntoIter<Section<'a>>,
    end: usize,
}

impl<'a> Container<'a> {
    /// Opens a container that should have this content.
    ///
    /// # Errors
    /// [`ExprError::UnknownFormat`] for other bytes, [`ExprError::OtherVersion`], [`ExprError::OtherContent`],
    /// [`ExprError::WrongLength`] if it was cut short, [`ExprError::WrongChecksum`] if a byte has changed,
    /// [`ExprError::Damaged`] if the lengths of the sections do not add up.
    pub fn open(bytes: &'a [u8], content: Tag) -> Result<Self, ExprError> {
        let prefix = bytes.len().min(MAGIC.len());
        if bytes.is_empty() || bytes[..prefix] != MAGIC[..prefix] {
            return Err(ExprError::UnknownFormat);
        }
        let mut header = Section {
            tag: Tag(*b"head"),
            bytes,
            begin: 0,
            at: prefix,
        };
        let cut_short = |_| ExprError::WrongLength {
            found: bytes.len(),
            declared: None,
        };
        let version = u32::from_le_bytes(header.take().map_err(cut_short)?);
        if version != VERSION {
            return Err(ExprError::OtherVersion { found: version });
        }
        let found = Tag(header.take().map_err(cut_short)?);
        let length = u64::from_le_bytes(header.take().map_err(cut_short)?);
        let n_sections = u32::from_le_bytes(header.take().map_err(cut_short)?);
        let body = match bytes.len().checked_sub(CHECKSUM) {
            Some(body) if length == bytes.len() as u64 && body >= HEADER => body,
            _ => {
                return Err(ExprError::WrongLength {
                    found: bytes.len(),
                    declared: Some(length),
                })
            }
        };
        let (before, checksum) = bytes.split_at(body);
        if checksum != crc32(before).to_le_bytes() {
            return Err(ExprError::WrongChecksum);
        }
        if found != content {
            return Err(ExprError::OtherContent {
                found,
                expected: content,
            });
        }
        header.bytes = before;
        let mut sections = Vec::new();
        for _ in 0..n_sections {
            sections.push(header.subsection()?);
        }
        header.finish()?;
        Ok(Container {
            sections: sections.into_iter(),
            end: body,
        })
    }

    /// The next section, which must have this tag.
    ///
    /// # Errors
    /// [`ExprError::Damaged`] if it has another one, or there is none.
    pub fn section(&mut self, tag: Tag) -> Result<Section<'a>, ExprError> {
        match self.sections.next() {
            Some(section) if section.tag == tag => Ok(section),
            Some(section) => Err(ExprError::Damaged {
                section: tag,
                offset: section.begin,
                detail: "another section stands in its place",
            }),
            None => Err(ExprError::Damaged {
                section: tag,
                offset: self.end,
                detail: "is missing",
            }),
        }
    }

    /// The next section if it has this tag; `None`, and nothing is read, if it has another one or there is none.
    pub fn optional(&mut self, tag: Tag) -> Option<Section<'a>> {
        let is_next = self.sections.as_slice().first()?.tag == tag;
        if is_next {
            self.sections.next()
        } else {
            None
        }
    }

    /// Says that all sections were read.
    ///
    /// # Errors
    /// [`ExprError::Damaged`] if there is one more.
    pub fn finish(mut self) -> Result<(), ExprError> {
        match self.sections.next() {
            None => Ok(()),
            Some(section) => Err(ExprError::Damaged {
                section: section.tag,
                offset: section.begin,
                detail: "a section too many",
            }),
        }
    }
}

/// A section under reading: never beyond its end.
#[derive(Clone)]
pub struct Section<'a> {
    tag: Tag,
    bytes: &'a [u8],
    /// Where it begins in the container.
    begin: usize,
    at: usize,
}

impl<'a> Section<'a> {
    /// The error that something is wrong at the place reached.
    ///
    /// # Errors
    /// Always.
    pub fn damaged<T>(&self, detail: &'static str) -> Result<T, ExprError> {
        Err(ExprError::Damaged {
            section: self.tag,
            offset: self.begin + self.at,
            detail,
        })
    }

    /// One byte.
    ///
    /// # Errors
    /// This and the following: [`ExprError::Damaged`] if the section ends before.
    pub fn byte(&mut self) -> Result<u8, ExprError> {
        Ok(self.take::<1>()?[0])
    }

    /// A number in 4 bytes.
    ///
    /// # Errors
    /// As [`Section::byte`].
    pub fn number(&mut self) -> Result<u32, ExprError> {
        self.take().map(u32::from_le_bytes)
    }

    /// The count of entries of at least `size` bytes each, which the rest of the section has room for: as much memory
    /// may be asked for.
    ///
    /// # Errors
    /// As [`Section::byte`], and if there is no room.
    pub fn count(&mut self, size: usize) -> Result<usize, ExprError> {
        let count = self.number()? as usize;
        if count > (self.bytes.len() - self.at) / size {
            return self.damaged("more entries than there are bytes for");
        }
        Ok(count)
    }

    /// An index below `limit`, else the error says `detail`.
    ///
    /// # Errors
    /// As [`Section::byte`], and for other indices.
    pub fn index(&mut self, limit: usize, detail: &'static str) -> Result<usize, ExprError> {
        let index = self.number()? as usize;
        if index < limit {
            Ok(index)
        } else {
            self.damaged(detail)
        }
    }

    /// A floating point number.
    ///
    /// # Errors
    /// As [`Section::byte`].
    pub fn float(&mut self) -> Result<f64, ExprError> {
        Ok(f64::from_bits(u64::from_le_bytes(self.take()?)))
    }

    /// Floating point numbers behind their count.
    ///
    /// # Errors
    /// As [`Section::count`].
    pub fn floats(&mut self) -> Result<Vec<f64>, ExprError> {
        (0..self.count(8)?).map(|_| self.float()).collect()
    }

    /// A text in UTF-8.
    ///
    /// # Errors
    /// As [`Section::count`], and for other bytes.
    pub fn text(&mut self) -> Result<String, ExprError> {
        let length = self.count(1)?;
        let text = std::str::from_utf8(&self.bytes[self.at..self.at + length]);
        let Ok(text) = text else {
            return self.damaged("a text that is not UTF-8");
        };
        self.at += length;
        Ok(text.to_owned())
    }

    /// Says that the section was read to its end.
    ///
    /// # Errors
    /// [`ExprError::Damaged`] if bytes are left.
    pub fn finish(self) -> Result<(), ExprError> {
        if self.at == self.bytes.len() {
            Ok(())
        } else {
            self.damaged("more bytes than expected")
        }
    }

    fn take<const N: usize>(&mut self) -> Result<[u8; N], ExprError> {
        match self.bytes[self.at..].first_chunk() {
            Some(&part) => {
                self.at += N;
                Ok(part)
            }
            None => self.damaged("ends too early"),
        }
    }

    /// A section within the body of a container.
    fn subsection(&mut self) -> Result<Section<'a>, ExprError> {
        let tag = Tag(self.take()?);
        let length = u64::from_le_bytes(self.take()?);
        let begin = self.at;
        let rest = &self.bytes[begin..];
        let Some(bytes) = usize::try_from(length).ok().and_then(|n| rest.get(..n)) else {
            return self.damaged("a section that is longer than the container");
        };
        self.at += bytes.len();
        Ok(Section {
            tag,
            bytes,
            begin,
            at: 0,
        })
    }
}

/// Writes the length and the checksum of a container again, after its bytes were changed: for tests of readers, which
/// have to refuse what is wrong in spite of a right checksum. `None` for bytes that are too few.
#[doc(hidden)]
pub fn resealed(bytes: &[u8]) -> Option<Vec<u8>> {
    let body = bytes.len().checked_sub(CHECKSUM)?;
    if body < HEADER {
        return None;
    }
    let mut sealed = bytes[..body].to_vec();
    sealed[LENGTH_AT..COUNT_AT].copy_from_slice(&(bytes.len() as u64).to_le_bytes());
    let checksum = crc32(&sealed);
    sealed.extend(checksum.to_le_bytes());
    Some(sealed)
}

/// The places of the sections of a container, with their headers: for tests of readers.
#[doc(hidden)]
pub fn sections_of(bytes: &[u8]) -> Vec<std::ops::Range<usize>> {
    let mut places = Vec::new();
    let end = bytes.len().saturating_sub(CHECKSUM);
    let mut at = HEADER;
    while at + SECTION_HEADER <= end {
        let length = bytes[at + 4..].first_chunk().copied();
        let length = length.map_or(0, u64::from_le_bytes) as usize;
        let next = at + SECTION_HEADER + length;
        places.push(at..next.min(end));
        at = next;
    }
    places
}

#[cfg(test)]
mod tests;
