//! Tells which files have changed on disk.

use crate::Error;
use crossbeam::channel::{Receiver, Sender, unbounded};
use notify_debouncer_full::notify::{EventKind, RecommendedWatcher, RecursiveMode};
use notify_debouncer_full::{DebounceEventResult, Debouncer, NoCache, new_debouncer_opt};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Editors write a file in several steps; steps within this time are one change.
const SETTLE: Duration = Duration::from_millis(60);

/// Watches a set of files. Their folders are what is really watched, so that a file that an editor replaces by renaming
/// another one, or that is deleted and made again, stays watched.
pub struct FileWatch {
    debouncer: Debouncer<RecommendedWatcher, NoCache>,
    changes: Receiver<PathBuf>,
    /// Each watched file as the system names it, and as the caller does.
    files: BTreeMap<PathBuf, PathBuf>,
    folders: BTreeSet<PathBuf>,
}

impl FileWatch {
    /// Watches nothing yet.
    ///
    /// # Errors
    /// The system has no means of watching files, or no more of them.
    pub fn new() -> Result<FileWatch, Error> {
        let (sender, changes) = unbounded();
        let debouncer =
            new_debouncer_opt(SETTLE, None, move |result| send_all(&sender, result), NoCache::new(), Default::default())
                .map_err(|e| Error::Watch { path: PathBuf::new(), reason: e.to_string() })?;
        Ok(FileWatch { debouncer, changes, files: BTreeMap::new(), folders: BTreeSet::new() })
    }

    /// Watches `files` from now on, and no others. A file need not exist, but its folder must; those that cannot be watched
    /// are told, the others are watched.
    pub fn set(&mut self, files: impl IntoIterator<Item = PathBuf>) -> Vec<Error> {
        let mut problems = Vec::new();
        let (mut wanted, mut folders) = (BTreeMap::new(), BTreeSet::new());
        for file in files {
            match names_of(&file) {
                Ok(names) => names.into_iter().for_each(|name| {
                    folders.extend(name.parent().map(Path::to_owned));
                    wanted.insert(name, file.clone());
                }),
                Err(e) => problems.push(Error::Watch { path: file, reason: e.to_string() }),
            }
        }
        for folder in self.folders.difference(&folders) {
            // The folder may be gone, and then it is not watched either.
            let _ = self.debouncer.unwatch(folder);
        }
        folders.retain(|folder| {
            if self.folders.contains(folder) {
                return true;
            }
            let watched = self.debouncer.watch(folder, RecursiveMode::NonRecursive);
            watched.map_err(|e| problems.push(Error::Watch { path: folder.clone(), reason: e.to_string() })).is_ok()
        });
        (self.files, self.folders) = (wanted, folders);
        problems
    }

    /// The watched files that changed since the last call, each once, as they were given to [`FileWatch::set`].
    pub fn changed(&self) -> Vec<PathBuf> {
        let changed: BTreeSet<_> = self.changes.try_iter().filter_map(|p| self.files.get(&p)).cloned().collect();
        changed.into_iter().collect()
    }

    /// Waits for a change of a watched file, at most for `timeout`.
    pub fn wait(&self, timeout: Duration) -> Vec<PathBuf> {
        let end = std::time::Instant::now() + timeout;
        while let Ok(path) = self.changes.recv_deadline(end) {
            if let Some(file) = self.files.get(&path) {
                let mut changed = self.changed();
                changed.retain(|p| p != file);
                changed.insert(0, file.clone());
                return changed;
            }
        }
        Vec::new()
    }
}

fn send_all(sender: &Sender<PathBuf>, result: DebounceEventResult) {
    match result {
        // Reading a file is an event, too.
        Ok(events) => events
            .into_iter()
            .filter(|e| !matches!(e.kind, EventKind::Access(_)))
            .flat_map(|e| e.event.paths)
            // Nobody listens any more when the watch is being dropped.
            .for_each(|path| _ = sender.send(path)),
        Err(errors) => errors.iter().for_each(|e| tracing::warn!("watching files: {e}")),
    }
}

/// The names under which the system may report a file: where it is, and where a link leads.
fn names_of(file: &Path) -> std::io::Result<Vec<PathBuf>> {
    let absolute = std::path::absolute(file)?;
    let (Some(folder), Some(name)) = (absolute.parent(), absolute.file_name()) else {
        return Err(std::io::Error::other("it is not a file"));
    };
    let mut names = vec![folder.canonicalize()?.join(name)];
    names.extend(absolute.canonicalize().ok().filter(|target| *target != names[0]));
    Ok(names)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    struct Folder(PathBuf);

    impl Folder {
        fn new(name: &str) -> Folder {
            let path = std::env::temp_dir().join(format!("umbriel-watch-{}-{name}", std::process::id()));
            fs::create_dir_all(&path).unwrap();
            Folder(path)
        }
    }

    impl Drop for Folder {
        fn drop(&mut self) {
            let _ = fs::remove_dir_all(&self.0);
        }
    }

    const LONG: Duration = Duration::from_secs(10);
    const SHORT: Duration = Duration::from_millis(400);

    #[test]
    fn changes_are_told_however_they_are_made() {
        type Change = fn(&Path, &Path);
        let rows: [(&str, Change); 4] = [
            ("written", |file, _| fs::write(file, "2").unwrap()),
            ("renamed", |file, other| {
                fs::write(other, "2").unwrap();
                fs::rename(other, file).unwrap();
            }),
            ("made again", |file, _| {
                fs::remove_file(file).unwrap();
                fs::write(file, "2").unwrap();
            }),
            // vim with `backupcopy=no`: the old file is moved away, and a new one is written.
            ("backed up", |file, other| {
                fs::rename(file, other).unwrap();
                fs::write(file, "2").unwrap();
            }),
        ];
        for (name, change) in rows {
            let folder = Folder::new(&name.replace(' ', "-"));
            let (file, other) = (folder.0.join("world.rhai"), folder.0.join("other"));
            fs::write(&file, "1").unwrap();
            let mut watch = FileWatch::new().unwrap();
            assert!(watch.set([file.clone()]).is_empty());
            change(&file, &other);
            assert_eq!(watch.wait(LONG), std::slice::from_ref(&file), "{name}");
            // The file that replaced it is watched as well.
            std::thread::sleep(SHORT);
            watch.changed();
            fs::write(&file, "3").unwrap();
            assert_eq!(watch.wait(LONG), std::slice::from_ref(&file), "{name}, once more");
        }
    }

    #[test]
    fn others_and_readers_are_not_told() {
        let folder = Folder::new("quiet");
        let (file, other, late) = (folder.0.join("a"), folder.0.join("b"), folder.0.join("c"));
        fs::write(&file, "1").unwrap();
        let mut watch = FileWatch::new().unwrap();
        assert!(watch.set([file.clone(), late.clone()]).is_empty());
        fs::read(&file).unwrap();
        fs::write(&other, "1").unwrap();
        assert!(watch.wait(SHORT).is_empty());
        // A file that did not exist is told when it comes.
        fs::write(&late, "1").unwrap();
        assert_eq!(watch.wait(LONG), [late]);
        // What is no longer asked for is no longer told.
        assert!(watch.set([other.clone()]).is_empty());
        fs::write(&file, "2").unwrap();
        fs::write(&other, "2").unwrap();
        assert_eq!(watch.wait(LONG), [other]);
    }

    #[test]
    fn a_folder_that_is_not_there_is_told() {
        let folder = Folder::new("missing");
        let mut watch = FileWatch::new().unwrap();
        let problems = watch.set([folder.0.join("no/such/file"), folder.0.join("fine")]);
        assert_eq!(problems.len(), 1);
        assert!(problems[0].to_string().contains("no/such/file"), "{}", problems[0]);
    }
}
