//! Checkpoint files: a value as it was at one moment, whole or refused.
//!
//! A file is a header of `HEADER_LENGTH` bytes and a body in blocks. The header: magic, version of the format, length of the body,
//! hash of the scene, checksum. A block: its length, its checksum, its bytes; all numbers little-endian. The body is one postcard
//! stream, in which an f64 is its eight bytes, so it reads back bit for bit.
//!
//! What always holds: a file is written under another name, flushed to the disk and renamed, the one before is kept beside it, so
//! whatever happens there is one that is whole. A file is read only if every length and checksum agrees; nothing is reserved
//! for more than the file itself holds.

use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::output::Target;

/// What a checkpoint begins with. The last bytes show what a transfer as text would do to them.
pub const MAGIC: [u8; 8] = *b"moltop\r\n";

/// Version of the format: grows with every change of what a checkpoint holds.
pub const VERSION: u32 = 3;

/// Magic, version, length of the body, hash of the scene, checksum.
const HEADER_LENGTH: usize = 8 + 4 + 8 + 8 + 4;

/// Bytes of a block, but for the last.
const BLOCK: usize = 1 << 20;

/// Length and checksum of a block.
const BLOCK_HEAD: usize = 8;

/// Name of the newest checkpoint in a run directory.
pub const NEWEST: &str = "checkpoint";

/// Name of the one before.
pub const PREVIOUS: &str = "checkpoint.previous";

/// Tells what a checkpoint belongs to from anything else.
///
/// Source: FNV-1a (Fowler, Noll, Vo; RFC 9923).
pub fn hash(bytes: impl IntoIterator<Item = u8>) -> u64 {
    bytes.into_iter().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

/// Whether a file begins as a checkpoint does.
pub fn is_checkpoint(path: &Path) -> bool {
    let mut magic = [0; MAGIC.len()];
    File::open(path)
        .and_then(|mut file| file.read_exact(&mut magic))
        .is_ok_and(|()| magic == MAGIC)
}

/// Writes a file: the value and the hash of its scene.
///
/// # Errors
/// What the writer answers.
pub fn write(value: &impl Serialize, scene_hash: u64, writer: &mut dyn Write) -> io::Result<()> {
    let mut length = Length(0);
    postcard::to_io(value, &mut length).map_err(io::Error::other)?;
    let mut header = Vec::with_capacity(HEADER_LENGTH);
    header.extend(MAGIC);
    header.extend(VERSION.to_le_bytes());
    header.extend(length.0.to_le_bytes());
    header.extend(scene_hash.to_le_bytes());
    header.extend(crc32fast::hash(&header).to_le_bytes());
    writer.write_all(&header)?;
    let mut blocks = Blocks {
        writer,
        block: Vec::with_capacity(BLOCK),
        failure: None,
    };
    let written = postcard::to_io(value, &mut blocks).map(|_| ());
    match (written, blocks.failure.take()) {
        (Ok(()), None) => blocks.finish_block(),
        (_, Some(failure)) => Err(failure),
        (Err(error), None) => Err(io::Error::other(error)),
    }
}

/// Counts what is written.
struct Length(u64);

impl Write for Length {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0 += bytes.len() as u64;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Cuts what is written into blocks.
struct Blocks<'w> {
    writer: &'w mut dyn Write,
    block: Vec<u8>,
    /// What the writer answered; postcard has no room for it.
    failure: Option<io::Error>,
}

impl Blocks<'_> {
    fn finish_block(&mut self) -> io::Result<()> {
        if self.block.is_empty() {
            return Ok(());
        }
        let length = (self.block.len() as u32).to_le_bytes();
        let checksum = checksum(length, &self.block).to_le_bytes();
        self.writer.write_all(&length)?;
        self.writer.write_all(&checksum)?;
        self.writer.write_all(&self.block)?;
        self.block.clear();
        Ok(())
    }
}

impl Write for Blocks<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let taken = bytes.len().min(BLOCK - self.block.len());
        self.block.extend(&bytes[..taken]);
        if self.block.len() == BLOCK
            && let Err(error) = self.finish_block()
        {
            self.failure = Some(error);
            return Err(io::ErrorKind::Other.into());
        }
        Ok(taken)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// The value that a file holds, and the hash of its scene.
///
/// # Errors
/// What is wrong with the file, in words for the user.
pub fn decode<T: DeserializeOwned>(bytes: &[u8]) -> Result<(T, u64), String> {
    let (body, scene_hash) = body(bytes)?;
    let (value, rest) = postcard::take_from_bytes(&body)
        .map_err(|error| format!("its content cannot be understood: {error}"))?;
    if !rest.is_empty() {
        return Err("its content is followed by something else".to_owned());
    }
    Ok((value, scene_hash))
}

/// Writes a checkpoint into a directory; the one before stays as [`PREVIOUS`].
///
/// # Errors
/// What the system answers; the checkpoints there are as they were before.
pub fn store(
    directory: &Path,
    fill: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> crate::error::Result<()> {
    let newest = directory.join(NEWEST);
    let fresh = Target::replacing(directory.join("checkpoint.new"));
    fresh.write(fill)?;
    // The newest is there under one of its names at every moment.
    let renamed = keep_previous(directory).and_then(|()| fs::rename(fresh.path(), &newest));
    renamed.map_err(|source| crate::error::Error::File {
        path: newest,
        action: "write",
        source,
    })?;
    // Some file systems cannot flush a directory, and the file is good anyway.
    let _ = File::open(directory).and_then(|directory| directory.sync_all());
    Ok(())
}

fn keep_previous(directory: &Path) -> io::Result<()> {
    match fs::rename(directory.join(NEWEST), directory.join(PREVIOUS)) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
        done => done,
    }
}

/// Reads a checkpoint: a file, or the newest whole one of a run directory.
///
/// # Errors
/// The file, and what is wrong with it.
pub fn load<T: DeserializeOwned>(path: &Path) -> Result<(T, u64), String> {
    let bytes =
        fs::read(path).map_err(|error| format!("{}: cannot read: {error}", path.display()))?;
    decode(&bytes).map_err(|why| {
        format!(
            "{}: not a checkpoint that can be used: {why}",
            path.display()
        )
    })
}

/// The checkpoints that a path means, the newest first: itself, or those of a run directory.
pub fn candidates(path: &Path) -> Vec<PathBuf> {
    if path.is_dir() {
        let names = [NEWEST, PREVIOUS].map(|name| path.join(name));
        names.into_iter().filter(|path| path.exists()).collect()
    } else {
        vec![path.to_owned()]
    }
}

/// The body, once every length and checksum agrees.
fn body(bytes: &[u8]) -> Result<(Vec<u8>, u64), String> {
    let mut rest = bytes;
    let cut_short = || "it is cut short".to_owned();
    let header = rest.split_off(..HEADER_LENGTH).ok_or_else(cut_short)?;
    if header[..8] != MAGIC {
        return Err("it does not begin as one".to_owned());
    }
    let version = u32::from_le_bytes(array(&header[8..12]));
    let claimed = u32::from_le_bytes(array(&header[28..32]));
    if crc32fast::hash(&header[..28]) != claimed {
        return Err("its header is damaged".to_owned());
    }
    if version != VERSION {
        return Err(format!(
            "it has version {version} of the format, and this program reads version {VERSION}"
        ));
    }
    let length = u64::from_le_bytes(array(&header[12..20]));
    let scene_hash = u64::from_le_bytes(array(&header[20..28]));
    if length > rest.len() as u64 {
        return Err(cut_short());
    }
    let mut body = Vec::with_capacity(length as usize);
    while body.len() < length as usize {
        let head = rest.split_off(..BLOCK_HEAD).ok_or_else(cut_short)?;
        let (length, claimed) = (array(&head[..4]), u32::from_le_bytes(array(&head[4..])));
        let damaged = || format!("it is damaged in block {}", body.len() / BLOCK);
        let count = u32::from_le_bytes(length) as usize;
        if count == 0 || count > BLOCK {
            return Err(damaged());
        }
        let block = rest.split_off(..count).ok_or_else(cut_short)?;
        if checksum(length, block) != claimed {
            return Err(damaged());
        }
        body.extend(block);
    }
    if body.len() as u64 != length || !rest.is_empty() {
        return Err("it is longer than it says".to_owned());
    }
    Ok((body, scene_hash))
}

/// Checksum of a block and its length: no bit of either can change unnoticed.
fn checksum(length: [u8; 4], block: &[u8]) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(&length);
    hasher.update(block);
    hasher.finalize()
}

fn array<const N: usize>(bytes: &[u8]) -> [u8; N] {
    bytes.try_into().expect("the caller took as many bytes")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn encode(value: &impl Serialize, scene_hash: u64) -> Vec<u8> {
        let mut bytes = Vec::new();
        write(value, scene_hash, &mut bytes).expect("memory takes all");
        bytes
    }

    fn value() -> Vec<(f64, u64)> {
        (0..200_000_u64)
            .map(|index| {
                (
                    f64::from_bits(index.wrapping_mul(0x9e37_79b9_7f4a_7c15)),
                    index,
                )
            })
            .collect()
    }

    fn bits(value: &[(f64, u64)]) -> Vec<(u64, u64)> {
        value
            .iter()
            .map(|(float, word)| (float.to_bits(), *word))
            .collect()
    }

    #[test]
    fn every_bit_comes_back() {
        let bytes = encode(&value(), 7);
        assert!(bytes.len() > 2 * BLOCK);
        let (read, scene_hash): (Vec<(f64, u64)>, u64) = decode(&bytes).expect("whole");
        assert_eq!((bits(&read), scene_hash), (bits(&value()), 7));
    }

    #[test]
    fn a_length_beyond_the_file_reserves_nothing() {
        let mut bytes = encode(&value(), 7);
        bytes[12..20].copy_from_slice(&u64::MAX.to_le_bytes());
        let claimed = crc32fast::hash(&bytes[..28]).to_le_bytes();
        bytes[28..32].copy_from_slice(&claimed);
        let refused = decode::<Vec<(f64, u64)>>(&bytes).expect_err("too long");
        assert_eq!(refused, "it is cut short");
    }

    #[test]
    fn another_version_is_named() {
        let mut bytes = encode(&1_u64, 7);
        bytes[8] = 9;
        let claimed = crc32fast::hash(&bytes[..28]).to_le_bytes();
        bytes[28..32].copy_from_slice(&claimed);
        let refused = decode::<u64>(&bytes).expect_err("another version");
        assert!(refused.contains("version 9"), "{refused}");
    }

    #[test]
    fn two_are_kept() {
        let directory = tempfile::tempdir().expect("a directory");
        for number in 1..=3_u64 {
            store(directory.path(), |writer| write(&number, 0, writer)).expect("it can be written");
        }
        let read = |name: &str| load::<u64>(&directory.path().join(name)).expect("whole").0;
        assert_eq!((read(NEWEST), read(PREVIOUS)), (3, 2));
        assert_eq!(candidates(directory.path()).len(), 2);
    }
}
