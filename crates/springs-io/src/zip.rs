//! Zip archives whose entries are stored as they are: written in one go, without
//! dates, always with 64-bit sizes. After PKWARE's APPNOTE 6.3.

use std::io::{self, Read, Seek, SeekFrom, Write};

const LOCAL: u32 = 0x0403_4b50;
const CENTRAL: u32 = 0x0201_4b50;
const END_64: u32 = 0x0606_4b50;
const LOCATOR_64: u32 = 0x0706_4b50;
const END: u32 = 0x0605_4b50;
/// What needs 64-bit sizes.
const VERSION: u16 = 45;
/// 1 January 1980, the first day that a date can be.
const NO_DATE: u16 = 0x21;
/// "See the extra field".
const ELSEWHERE: u32 = u32::MAX;
const EXTRA_64: u16 = 1;
const LOCAL_LEN: u64 = 30;
const CENTRAL_LEN: usize = 46;
const END_64_LEN: u64 = 56;
const LOCATOR_64_LEN: i64 = 20;
const END_LEN: i64 = 22;

/// A file in an archive.
#[derive(Clone, Debug)]
pub(crate) struct Entry {
    pub(crate) name: String,
    /// Where its local header begins.
    header: u64,
    pub(crate) n_bytes: u64,
    sum: u32,
}

/// An archive on its way.
pub(crate) struct ZipWriter<W> {
    out: W,
    entries: Vec<Entry>,
}

/// Counts and sums up what is written.
pub(crate) struct Contents<'a, W> {
    out: &'a mut W,
    sum: crc32fast::Hasher,
    n_bytes: u64,
}

impl<W: Write> Write for Contents<'_, W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let n = self.out.write(bytes)?;
        self.sum.update(&bytes[..n]);
        self.n_bytes += n as u64;
        Ok(n)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}

impl<W: Write + Seek> ZipWriter<W> {
    pub(crate) fn new(out: W) -> Self {
        let entries = Vec::new();
        Self { out, entries }
    }

    /// Appends an entry with what `write` writes.
    pub(crate) fn entry(
        &mut self,
        name: &str,
        write: impl FnOnce(&mut Contents<'_, W>) -> io::Result<()>,
    ) -> io::Result<()> {
        let mut entry = Entry {
            name: name.to_owned(),
            header: self.out.stream_position()?,
            n_bytes: 0,
            sum: 0,
        };
        self.out.write_all(&local_header(&entry))?;
        let mut contents = Contents {
            out: &mut self.out,
            sum: crc32fast::Hasher::new(),
            n_bytes: 0,
        };
        write(&mut contents)?;
        (entry.n_bytes, entry.sum) = (contents.n_bytes, contents.sum.finalize());
        // Only now is the header known.
        self.out.seek(SeekFrom::Start(entry.header))?;
        self.out.write_all(&local_header(&entry))?;
        self.out.seek(SeekFrom::End(0))?;
        self.entries.push(entry);
        Ok(())
    }

    /// Writes the directory.
    pub(crate) fn finish(mut self) -> io::Result<()> {
        let start = self.out.stream_position()?;
        for entry in &self.entries {
            self.out.write_all(&central_header(entry))?;
        }
        let end = self.out.stream_position()?;
        let n_entries = self.entries.len();
        let mut bytes = Bytes::default();
        bytes.u32(END_64).u64(END_64_LEN - 12);
        bytes.u16(VERSION).u16(VERSION).u32(0).u32(0);
        bytes.u64(n_entries as u64).u64(n_entries as u64);
        bytes.u64(end - start).u64(start);
        bytes.u32(LOCATOR_64).u32(0).u64(end).u32(1);
        bytes.u32(END).u16(0).u16(0);
        bytes.u16(n_entries as u16).u16(n_entries as u16);
        bytes.u32(ELSEWHERE).u32(ELSEWHERE).u16(0);
        self.out.write_all(&bytes.0)
    }
}

fn local_header(entry: &Entry) -> Vec<u8> {
    let mut bytes = Bytes::default();
    bytes.u32(LOCAL).u16(VERSION).u16(0).u16(0).u16(0);
    bytes.u16(NO_DATE).u32(entry.sum);
    bytes.u32(ELSEWHERE).u32(ELSEWHERE);
    bytes.u16(entry.name.len() as u16).u16(20);
    bytes.0.extend(entry.name.bytes());
    bytes.u16(EXTRA_64).u16(16);
    bytes.u64(entry.n_bytes).u64(entry.n_bytes);
    bytes.0
}

fn central_header(entry: &Entry) -> Vec<u8> {
    let mut bytes = Bytes::default();
    bytes.u32(CENTRAL).u16(VERSION).u16(VERSION);
    bytes.u16(0).u16(0).u16(0).u16(NO_DATE).u32(entry.sum);
    bytes.u32(ELSEWHERE).u32(ELSEWHERE);
    bytes.u16(entry.name.len() as u16).u16(28).u16(0);
    bytes.u16(0).u16(0).u32(0).u32(ELSEWHERE);
    bytes.0.extend(entry.name.bytes());
    bytes.u16(EXTRA_64).u16(24);
    bytes
        .u64(entry.n_bytes)
        .u64(entry.n_bytes)
        .u64(entry.header);
    bytes.0
}

/// Little-endian numbers, one after the other.
#[derive(Default)]
struct Bytes(Vec<u8>);

impl Bytes {
    fn u16(&mut self, number: u16) -> &mut Self {
        self.0.extend(number.to_le_bytes());
        self
    }

    fn u32(&mut self, number: u32) -> &mut Self {
        self.0.extend(number.to_le_bytes());
        self
    }

    fn u64(&mut self, number: u64) -> &mut Self {
        self.0.extend(number.to_le_bytes());
        self
    }
}

/// The entries of an archive that a [`ZipWriter`] wrote, or nothing if it is none.
///
/// # Errors
///
/// If it cannot be read.
pub(crate) fn entries(file: &mut (impl Read + Seek)) -> io::Result<Option<Vec<Entry>>> {
    let n_bytes = file.seek(SeekFrom::End(0))?;
    if n_bytes < END_64_LEN + (LOCATOR_64_LEN + END_LEN) as u64 {
        return Ok(None);
    }
    file.seek(SeekFrom::End(-END_LEN - LOCATOR_64_LEN))?;
    let mut locator = [0; LOCATOR_64_LEN as usize];
    file.read_exact(&mut locator)?;
    let end = number(&locator, 8, 8);
    if number(&locator, 0, 4) != u64::from(LOCATOR_64) || end > n_bytes - END_64_LEN {
        return Ok(None);
    }
    file.seek(SeekFrom::Start(end))?;
    let mut record = [0; END_64_LEN as usize];
    file.read_exact(&mut record)?;
    let (size, start) = (number(&record, 40, 8), number(&record, 48, 8));
    if number(&record, 0, 4) != u64::from(END_64) || start.checked_add(size) != Some(end) {
        return Ok(None);
    }
    file.seek(SeekFrom::Start(start))?;
    let mut directory = Vec::new();
    file.take(size).read_to_end(&mut directory)?;
    Ok(parse_directory(&directory))
}

fn parse_directory(mut bytes: &[u8]) -> Option<Vec<Entry>> {
    let mut entries = Vec::new();
    while !bytes.is_empty() {
        let header = bytes.get(..CENTRAL_LEN)?;
        let is_stored = number(header, 10, 2) == 0;
        if number(header, 0, 4) != u64::from(CENTRAL) || !is_stored || number(header, 30, 2) != 28 {
            return None;
        }
        let name_len = number(header, 28, 2) as usize;
        let name = bytes.get(CENTRAL_LEN..CENTRAL_LEN + name_len)?;
        let extra = bytes.get(CENTRAL_LEN + name_len..CENTRAL_LEN + name_len + 28)?;
        entries.push(Entry {
            name: String::from_utf8(name.to_vec()).ok()?,
            header: number(extra, 20, 8),
            n_bytes: number(extra, 4, 8),
            sum: number(header, 16, 4) as u32,
        });
        bytes = &bytes[CENTRAL_LEN + name_len + 28..];
    }
    Some(entries)
}

impl Entry {
    /// Where its contents begin.
    pub(crate) fn start(&self) -> u64 {
        // The name and the extra field with both sizes.
        self.header
            .saturating_add(LOCAL_LEN + self.name.len() as u64 + 20)
    }
}

/// A little-endian number of so many bytes.
fn number(bytes: &[u8], start: usize, n_bytes: usize) -> u64 {
    let mut all = [0; 8];
    all[..n_bytes].copy_from_slice(&bytes[start..start + n_bytes]);
    u64::from_le_bytes(all)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Cursor;

    fn archive() -> Vec<u8> {
        let mut out = Cursor::new(Vec::new());
        let mut zip = ZipWriter::new(&mut out);
        zip.entry("a", |out| out.write_all(b"one")).unwrap();
        zip.entry("long name", |_| Ok(())).unwrap();
        zip.finish().unwrap();
        out.into_inner()
    }

    #[test]
    fn entries_are_found_again() {
        let bytes = archive();
        let found = entries(&mut Cursor::new(&bytes)).unwrap().unwrap();
        let names: Vec<&str> = found.iter().map(|entry| &*entry.name).collect();
        assert_eq!(names, ["a", "long name"]);
        let start = found[0].start() as usize;
        assert_eq!(&bytes[start..start + found[0].n_bytes as usize], b"one");
        assert_eq!(found[0].sum, crc32fast::hash(b"one"));
        assert_eq!(found[1].n_bytes, 0);
    }

    #[test]
    fn what_is_no_archive_is_none() {
        let bytes = archive();
        for n in 0..bytes.len() {
            let cut = entries(&mut Cursor::new(&bytes[..n])).unwrap();
            assert!(cut.is_none(), "{n}");
        }
        // Any byte may be wrong; nothing panics.
        for at in 0..bytes.len() {
            let mut wrong = bytes.clone();
            wrong[at] ^= 0x81;
            let _ = entries(&mut Cursor::new(&wrong)).unwrap();
        }
    }
}
