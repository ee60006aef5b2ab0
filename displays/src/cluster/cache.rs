//! Long values on disk, by the hash of their content: a display that starts anew need not fetch its meshes and images again.
//!
//! A folder of plain files that any number of processes share. A file is written beside its place and moved there, so that nobody reads half of
//! it; it is read only if its content has its hash; it is touched when it is used, so that what was not used for longest goes first.

use std::collections::HashSet;
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::thread::JoinHandle;
use std::time::{Duration, SystemTime};

use crossbeam::channel::{Receiver, Sender, unbounded};
use umbriel_fields::replica::hash_of_long_value;

/// Files that are being written; what is left of a process that died goes after this time.
const UNFINISHED: (&str, Duration) = (".unfinished-", Duration::from_secs(3600));
/// What others have written is looked for each time that this part of the room was filled.
const LOOKS: u64 = 16;

/// Where long values are kept from one start to the next.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CacheOptions {
    /// The folder; it is made where it is not there.
    pub folder: PathBuf,
    /// Room for all files in it, bytes.
    pub room: u64,
}

/// A hash, and the message of what has it.
type Value = (u64, Vec<u8>);

/// The folder as one process sees it.
pub(super) struct Cache {
    folder: PathBuf,
    /// What is there, or on its way.
    kept: HashSet<u64>,
    /// Writes on a thread of its own: nobody waits for a disk with a frame.
    writer: Option<(Sender<Value>, JoinHandle<()>)>,
}

impl Cache {
    pub(super) fn open(CacheOptions { folder, room }: CacheOptions) -> Cache {
        let (to_write, values) = unbounded();
        let place = folder.clone();
        let thread = std::thread::spawn(move || {
            if let Err(error) = write_all(&place, room, &values) {
                tracing::warn!(
                    "{}: {error}; meshes and images are fetched anew at the next start (--cache names another folder, or none)",
                    place.display()
                );
            }
        });
        Cache { folder, kept: HashSet::new(), writer: Some((to_write, thread)) }
    }

    /// The value of a hash, if it is there. A file of something else is taken away.
    pub(super) fn get(&mut self, hash: u64) -> Option<Vec<u8>> {
        let path = path_of(&self.folder, hash);
        let message = fs::read(&path).ok()?;
        if hash_of_long_value(&message) != Some(hash) {
            tracing::warn!("{}: the file is damaged; it is fetched anew", path.display());
            let _ = fs::remove_file(&path);
            return None;
        }
        self.kept.insert(hash);
        touch(&path);
        Some(message)
    }

    /// Is it there, or on its way?
    pub(super) fn has(&self, hash: u64) -> bool {
        self.kept.contains(&hash)
    }

    /// Keeps a value that has this hash.
    pub(super) fn put(&mut self, hash: u64, message: Vec<u8>) {
        if let Some((writer, _)) = self.writer.as_ref().filter(|_| self.kept.insert(hash)) {
            // The writer has given up, and said so, where it does not listen.
            let _ = writer.send((hash, message));
        }
    }
}

impl Drop for Cache {
    fn drop(&mut self) {
        if let Some((values, thread)) = self.writer.take() {
            drop(values);
            let _ = thread.join();
        }
    }
}

fn path_of(folder: &Path, hash: u64) -> PathBuf {
    folder.join(format!("{hash:016x}"))
}

/// It was used; a folder that cannot be written forgets that.
fn touch(path: &Path) {
    let _ = File::options().append(true).open(path).and_then(|file| file.set_modified(SystemTime::now()));
}

/// Writes what comes, until nothing more does or something is in the way.
fn write_all(folder: &Path, room: u64, values: &Receiver<Value>) -> io::Result<()> {
    let (mut free, mut until_look) = (0, 0);
    for (hash, message) in values {
        let (path, length) = (path_of(folder, hash), message.len() as u64);
        if length > room {
            continue;
        }
        if path.exists() {
            touch(&path);
            continue;
        }
        make(folder)?;
        if length > free || length > until_look {
            free = room - make_room(folder, room - length)?;
            until_look = (room / LOOKS).max(length);
        }
        let mut file = tempfile::Builder::new().prefix(UNFINISHED.0).tempfile_in(folder)?;
        file.write_all(&message)?;
        file.persist(&path).map_err(|error| error.error)?;
        (free, until_look) = (free - length, until_look - length);
    }
    Ok(())
}

/// Makes the folder, for this user alone.
fn make(folder: &Path) -> io::Result<()> {
    let mut builder = fs::DirBuilder::new();
    builder.recursive(true);
    #[cfg(unix)]
    std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
    builder.create(folder)
}

/// Takes files away until at most so many bytes are left, those that were not used for longest first. Gives the bytes that are left.
fn make_room(folder: &Path, most: u64) -> io::Result<u64> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        // Another process may have taken it away since.
        let Ok(about) = entry.metadata() else { continue };
        let used = about.modified().unwrap_or(SystemTime::UNIX_EPOCH);
        let name = entry.file_name();
        let is_ours = name.len() == 16 && name.to_str().is_some_and(|name| u64::from_str_radix(name, 16).is_ok());
        if is_ours {
            files.push((used, about.len(), entry.path()));
        } else if name.to_string_lossy().starts_with(UNFINISHED.0) && used.elapsed().is_ok_and(|age| age > UNFINISHED.1) {
            let _ = fs::remove_file(entry.path());
        }
    }
    files.sort();
    let mut left: u64 = files.iter().map(|(_, length, _)| length).sum();
    for (_, length, path) in files {
        if left <= most {
            break;
        }
        fs::remove_file(&path).or_else(|error| if error.kind() == io::ErrorKind::NotFound { Ok(()) } else { Err(error) })?;
        left -= length;
    }
    Ok(left)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A long value, and its hash.
    fn value(number: u8, length: usize) -> Value {
        let message = [vec![0], vec![number; length]].concat();
        (hash_of_long_value(&message).unwrap(), message)
    }

    fn open(folder: &Path, room: u64) -> Cache {
        Cache::open(CacheOptions { folder: folder.join("long"), room })
    }

    #[test]
    fn what_was_kept_is_there_for_others() {
        let folder = tempfile::tempdir().unwrap();
        let (hash, message) = value(1, 10_000);
        let mut first = open(folder.path(), 1 << 20);
        assert_eq!(first.get(hash), None);
        first.put(hash, message.clone());
        drop(first);
        let mut second = open(folder.path(), 1 << 20);
        assert_eq!(second.get(hash).as_ref(), Some(&message));
        assert_eq!(fs::read_dir(folder.path().join("long")).unwrap().count(), 1, "nothing unfinished is left");
        // One byte is another, or some are missing.
        for damaged in [[&message[..message.len() - 1], &[2]].concat(), message[..5000].to_vec(), Vec::new()] {
            let path = path_of(&folder.path().join("long"), hash);
            fs::write(&path, damaged).unwrap();
            assert_eq!(second.get(hash), None);
            assert!(!path.exists());
        }
    }

    #[test]
    fn what_was_not_used_for_longest_goes() {
        let folder = tempfile::tempdir().unwrap();
        let values: Vec<Value> = (0..10).map(|number| value(number, 999)).collect();
        for (number, (hash, message)) in (0..).zip(&values) {
            let mut cache = open(folder.path(), 5500);
            cache.put(*hash, message.clone());
            drop(cache);
            let path = path_of(&folder.path().join("long"), *hash);
            let used = SystemTime::UNIX_EPOCH + Duration::from_secs(number);
            File::options().append(true).open(path).unwrap().set_modified(used).unwrap();
            // The first one is used all the time.
            assert!(open(folder.path(), 5500).get(values[0].0).is_some());
        }
        let mut cache = open(folder.path(), 5500);
        let there: Vec<bool> = values.iter().map(|(hash, _)| cache.get(*hash).is_some()).collect();
        assert_eq!(there, [true, false, false, false, false, false, true, true, true, true]);
        let (hash, message) = value(77, 6000);
        cache.put(hash, message);
        drop(cache);
        assert_eq!(open(folder.path(), 5500).get(hash), None, "what is larger than the room is not kept");
        assert!(open(folder.path(), 5500).get(values[9].0).is_some());
    }

    #[test]
    fn a_folder_that_cannot_be_written_is_survived() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("long"), "a file").unwrap();
        let (hash, message) = value(1, 5000);
        let mut cache = open(folder.path(), 1 << 20);
        for _ in 0..3 {
            cache.put(hash, message.clone());
            assert_eq!(cache.get(hash), None);
        }
    }

    #[test]
    fn what_dead_processes_left_goes() {
        let folder = tempfile::tempdir().unwrap();
        let long = folder.path().join("long");
        fs::create_dir(&long).unwrap();
        for (name, age_s, stays) in [(".unfinished-a", 7200, false), (".unfinished-b", 60, true), ("notes.txt", 7200, true)] {
            let used = SystemTime::now() - Duration::from_secs(age_s);
            File::create(long.join(name)).unwrap().set_modified(used).unwrap();
            make_room(&long, 0).unwrap();
            assert_eq!(long.join(name).exists(), stays, "{name}");
        }
    }
}
