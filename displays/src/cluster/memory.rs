//! Packets for processes of the same machine: they lie in memory of the application, and only where they lie is sent.
//!
//! Whoever is told that over its line opens the memory through `/proc` and reads the packet there, so that a display that is cut off learns
//! nothing. The memory has no name: nothing is left behind by a process that was killed, and the system frees it with the last that holds
//! it. It takes no part of `/dev/shm`. Who cannot open it (another machine, another user, another system than Linux) gets packets over the network.

use std::fs::File;
use std::io::{ErrorKind, Result, Seek, SeekFrom, Write};

use serde::{Deserialize, Serialize};

#[cfg(not(target_os = "linux"))]
use self::elsewhere::{View, descriptor, nameless};
#[cfg(target_os = "linux")]
use self::linux::{View, descriptor, nameless};

/// So many packets lie there at the least: the one that is read, the one that follows, and two for who is late.
const FEWEST_PLACES: u64 = 4;
/// And at the most, where they are small: a display that draws for seconds, as it does first of all, finds all that came meanwhile. Without
/// them it would fetch everything anew, and draw for seconds again.
const MOST_PLACES: u64 = 512;
/// More places than the fewest take no more than this, so that large packets stay in the processor's caches.
const ROOM_BYTES: u64 = 2 << 20;
/// Before the places: the token, and the number of the last packet whose place may be written anew.
const TOKEN: usize = 0;
const GONE: usize = 8;
/// Where the first place begins; places are whole pages.
const PAGE: u64 = 4096;
/// As the system shows it.
const NAME: &str = "umbriel";

/// Where a packet lies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Whereabouts {
    process: u32,
    /// The descriptor in that process.
    file: i32,
    /// Of this memory, unlike any other's; zero for none.
    pub(super) token: u64,
    number: u64,
    at: u64,
    length: u64,
}

/// The application's end.
#[derive(Debug)]
pub(super) struct Shelf {
    file: File,
    token: u64,
    number: u64,
    /// Packets up to this one may be gone.
    gone: u64,
    place_bytes: u64,
    places: u64,
}

impl Shelf {
    /// Memory without packets.
    ///
    /// # Errors
    /// The system has none to share.
    pub(super) fn make() -> Result<Shelf> {
        Ok(Shelf { file: nameless()?, token: fastrand::u64(1..), number: 0, gone: 0, place_bytes: 0, places: MOST_PLACES })
    }

    /// What tells it from others.
    pub(super) fn token(&self) -> u64 {
        self.token
    }

    /// Writes a packet, over one that was written long ago.
    ///
    /// # Errors
    /// There is no more memory.
    pub(super) fn put(&mut self, packet: &[u8]) -> Result<Whereabouts> {
        self.number += 1;
        self.gone = self.gone.max(self.number.saturating_sub(self.places));
        let length = packet.len() as u64;
        if length > self.place_bytes {
            // All places move.
            self.place_bytes = (length + length / 4).next_multiple_of(PAGE);
            self.places = (ROOM_BYTES / self.place_bytes).clamp(FEWEST_PLACES, MOST_PLACES);
            self.gone = self.number - 1;
            let end = PAGE + self.places * self.place_bytes;
            if end > self.file.metadata()?.len() {
                self.file.set_len(end)?;
            }
        }
        let head = [self.token.to_le_bytes(), self.gone.to_le_bytes()].concat();
        // Who reads what is about to be written over finds that out afterwards.
        write_at(&self.file, 0, &head)?;
        let at = PAGE + self.number % self.places * self.place_bytes;
        write_at(&self.file, at, packet)?;
        let (process, file) = (std::process::id(), descriptor(&self.file));
        Ok(Whereabouts { process, file, token: self.token, number: self.number, at, length })
    }
}

/// What came of reading.
#[derive(Debug, PartialEq)]
pub(super) enum Found {
    /// The packet.
    Packet(Vec<u8>),
    /// It was written over: this process was late.
    Gone,
    /// The memory cannot be reached from here.
    Elsewhere,
}

/// The other end.
#[derive(Debug, Default)]
pub(super) struct Reader {
    /// With its token.
    open: Option<(u64, View)>,
    /// Where a packet was that is not needed any more: new memory costs as much as reading.
    spare: Vec<u8>,
}

impl Reader {
    /// Takes the memory of a packet.
    pub(super) fn reuse(&mut self, bytes: Vec<u8>) {
        self.spare = bytes;
    }

    pub(super) fn read(&mut self, whereabouts: &Whereabouts) -> Found {
        if self.open.as_ref().is_none_or(|(token, _)| *token != whereabouts.token) {
            self.open = View::open(whereabouts).map(|view| (whereabouts.token, view)).ok();
        }
        let Some((_, view)) = &mut self.open else { return Found::Elsewhere };
        match view.packet(whereabouts, std::mem::take(&mut self.spare)) {
            Ok(Some(bytes)) => Found::Packet(bytes),
            Ok(None) => Found::Gone,
            Err(error) => {
                tracing::debug!("the application's memory cannot be read: {error}");
                Found::Elsewhere
            }
        }
    }
}

fn write_at(mut file: &File, at: u64, bytes: &[u8]) -> Result<()> {
    file.seek(SeekFrom::Start(at))?;
    file.write_all(bytes)
}

#[cfg(target_os = "linux")]
mod linux {
    use std::io::Error;
    use std::os::fd::AsRawFd;
    use std::os::unix::fs::PermissionsExt;
    use std::sync::Arc;
    use std::sync::atomic::{Ordering, fence};

    use rustix::fs::{MemfdFlags, SealFlags, fcntl_add_seals, fcntl_get_seals, memfd_create};
    use rustix::mm::{MapFlags, ProtFlags};
    use vm_memory::mmap::MmapRegionBuilder;
    use vm_memory::{Bytes, FileOffset, MmapRegion, VolatileMemory};

    use super::*;

    /// A file that nobody finds by a name, and that does not shrink: who maps it need not fear to find nothing there.
    pub(super) fn nameless() -> Result<File> {
        let file = File::from(memfd_create(NAME, MemfdFlags::CLOEXEC | MemfdFlags::ALLOW_SEALING)?);
        fcntl_add_seals(&file, SealFlags::SHRINK | SealFlags::SEAL)?;
        // Others of the same user may read it; this process holds it open for writing already.
        file.set_permissions(std::fs::Permissions::from_mode(0o400))?;
        Ok(file)
    }

    pub(super) fn descriptor(file: &File) -> i32 {
        file.as_raw_fd()
    }

    /// The memory of an application, as another process sees it.
    #[derive(Debug)]
    pub(super) struct View {
        file: Arc<File>,
        /// All that there was of it when it was looked for last.
        map: MmapRegion,
    }

    impl View {
        pub(super) fn open(whereabouts: &Whereabouts) -> Result<View> {
            let path = std::path::PathBuf::from(format!("/proc/{}/fd/{}", whereabouts.process, whereabouts.file));
            // On another machine this may be anything, and only to open it may do something.
            if !std::fs::read_link(&path)?.to_string_lossy().starts_with(&format!("/memfd:{NAME}")) {
                return Err(ErrorKind::NotFound.into());
            }
            let file = Arc::new(File::open(path)?);
            if !fcntl_get_seals(&file)?.contains(SealFlags::SHRINK) {
                return Err(Error::new(ErrorKind::NotFound, "it may shrink"));
            }
            let map = map(&file)?;
            let view = View { file, map };
            let is_same = view.word(TOKEN)? == whereabouts.token;
            if is_same { Ok(view) } else { Err(Error::new(ErrorKind::NotFound, "it is other memory")) }
        }

        fn word(&self, at: usize) -> Result<u64> {
            let word = self.map.as_volatile_slice().load::<u64>(at, Ordering::Acquire).map_err(Error::other)?;
            Ok(u64::from_le(word))
        }

        /// Reads a packet into memory that may have been another's. None if it was written over.
        pub(super) fn packet(&mut self, whereabouts: &Whereabouts, mut bytes: Vec<u8>) -> Result<Option<Vec<u8>>> {
            let Whereabouts { number, at, length, .. } = *whereabouts;
            let end = at.saturating_add(length);
            if end > self.map.size() as u64 {
                self.map = map(&self.file)?;
            }
            if end > self.map.size() as u64 {
                return Err(ErrorKind::UnexpectedEof.into());
            }
            bytes.resize(length as usize, 0);
            self.map.as_volatile_slice().read_slice(&mut bytes, at as usize).map_err(Error::other)?;
            // What was read was read before this.
            fence(Ordering::Acquire);
            Ok((number > self.word(GONE)?).then_some(bytes))
        }
    }

    fn map(file: &Arc<File>) -> Result<MmapRegion> {
        let length = file.metadata()?.len() as usize;
        let map = MmapRegionBuilder::new(length)
            .with_mmap_prot(ProtFlags::READ.bits() as i32)
            .with_mmap_flags((MapFlags::SHARED | MapFlags::NORESERVE).bits() as i32)
            .with_file_offset(FileOffset::from_arc(file.clone(), 0));
        map.build().map_err(Error::other)
    }
}

#[cfg(not(target_os = "linux"))]
mod elsewhere {
    use super::*;

    pub(super) fn nameless() -> Result<File> {
        Err(ErrorKind::Unsupported.into())
    }

    pub(super) fn descriptor(_: &File) -> i32 {
        -1
    }

    #[derive(Debug)]
    pub(super) enum View {}

    impl View {
        pub(super) fn open(_: &Whereabouts) -> Result<View> {
            Err(ErrorKind::Unsupported.into())
        }

        pub(super) fn packet(&mut self, _: &Whereabouts, _: Vec<u8>) -> Result<Option<Vec<u8>>> {
            match *self {}
        }
    }
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    /// Of packets of a length, so many can be read after each that was put.
    fn check(length: usize, places: u64) {
        let mut shelf = Shelf::make().unwrap();
        let mut reader = Reader::default();
        let packet = |number: u64| vec![number as u8; length];
        let mut put: Vec<Whereabouts> = Vec::new();
        for number in 0..places + 3 {
            put.push(shelf.put(&packet(number)).unwrap());
            let others = [0, 1, 2, number.saturating_sub(places), (number + 1).saturating_sub(places), number];
            for other in others.into_iter().filter(|other| *other <= number) {
                let is_there = other + places > number;
                let expected = if is_there { Found::Packet(packet(other)) } else { Found::Gone };
                assert_eq!(reader.read(&put[other as usize]), expected, "{other} after {number}");
            }
        }
        // A packet that is longer than all before, and one after it.
        let longer = shelf.put(&vec![7; 2 * length + 10_000]).unwrap();
        assert_eq!(reader.read(put.last().unwrap()), Found::Gone);
        assert_eq!(reader.read(&longer), Found::Packet(vec![7; 2 * length + 10_000]));
        let after = shelf.put(&[8; 3]).unwrap();
        assert_eq!(reader.read(&longer), Found::Packet(vec![7; 2 * length + 10_000]));
        assert_eq!(reader.read(&after), Found::Packet(vec![8; 3]));
    }

    #[test]
    fn packets_are_read_until_their_place_is_written_anew() {
        [(10, 512), (3000, 512), (30_000, 51), (600_000, 4)].into_iter().for_each(|(length, places)| check(length, places));
    }

    #[test]
    fn what_cannot_be_reached_is_elsewhere() {
        let mut shelf = Shelf::make().unwrap();
        let here = shelf.put(b"packet").unwrap();
        let other_file = File::open("/dev/null").unwrap();
        // With the right token, but nothing says that it will not shrink.
        let unsealed = File::from(rustix::fs::memfd_create(NAME, rustix::fs::MemfdFlags::CLOEXEC).unwrap());
        write_at(&unsealed, 0, &[here.token.to_le_bytes(), 0u64.to_le_bytes()].concat()).unwrap();
        write_at(&unsealed, here.at, b"packet").unwrap();
        let rows = [
            Whereabouts::default(),
            Whereabouts { token: here.token ^ 1, ..here },
            Whereabouts { process: u32::MAX, ..here },
            Whereabouts { file: descriptor(&other_file), ..here },
            Whereabouts { file: descriptor(&unsealed), ..here },
            Whereabouts { length: 1 << 60, ..here },
            Whereabouts { at: u64::MAX, ..here },
        ];
        for row in rows {
            assert_eq!(Reader::default().read(&row), Found::Elsewhere, "{row:?}");
        }
        let mut reader = Reader::default();
        assert_eq!(reader.read(&here), Found::Packet(b"packet".to_vec()));
        // Another run of the application.
        let mut later = Shelf::make().unwrap();
        let there = later.put(b"later").unwrap();
        assert_eq!(reader.read(&there), Found::Packet(b"later".to_vec()));
        drop(shelf);
        assert_eq!(Reader::default().read(&here), Found::Elsewhere);
    }
}
