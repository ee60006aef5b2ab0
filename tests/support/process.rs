//! Commands that run beside the test.

use super::until;
use std::io::{BufRead, BufReader};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// How long a process may take for anything.
pub(crate) const PATIENCE: Duration = Duration::from_secs(20);

/// A running command, and what it said so far.
pub(crate) struct Process {
    pub(crate) child: Child,
    said: Arc<Mutex<String>>,
}

impl Process {
    /// Starts the `umbriel` command.
    pub(crate) fn start(args: &[&str]) -> Process {
        Process::start_in(args, &[])
    }

    /// Starts it with variables of the environment.
    pub(crate) fn start_in(args: &[&str], environment: &[(&str, &str)]) -> Process {
        let mut child = Command::new(env!("CARGO_BIN_EXE_umbriel"))
            .args(args)
            .envs(environment.iter().copied())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the command can be started");
        let said = Arc::new(Mutex::new(String::new()));
        let (out, err) = (child.stdout.take().expect("piped"), child.stderr.take().expect("piped"));
        listen(out, &said);
        listen(err, &said);
        Process { child, said }
    }

    /// Everything it said so far.
    pub(crate) fn said(&self) -> String {
        self.said.lock().unwrap().clone()
    }

    /// Waits until it said something.
    pub(crate) fn says(&self, text: &str) {
        let found = until(PATIENCE, || self.said().contains(text).then_some(()));
        assert!(found.is_some(), "it did not say `{text}`, but:\n{}", self.said());
    }

    /// Waits for its end; gives the exit status.
    pub(crate) fn ends(&mut self) -> i32 {
        let status = until(PATIENCE, || self.child.try_wait().ok().flatten());
        status.unwrap_or_else(|| panic!("it does not end:\n{}", self.said())).code().unwrap_or(-1)
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn listen(from: impl std::io::Read + Send + 'static, said: &Arc<Mutex<String>>) {
    let said = said.clone();
    std::thread::spawn(move || {
        for line in BufReader::new(from).lines().map_while(Result::ok) {
            said.lock().unwrap().push_str(&(line + "\n"));
        }
    });
}

/// A folder with scripts, and an address on which nobody listens.
pub(crate) fn prepare(name: &str, scripts: &[(&str, &str)]) -> (PathBuf, String) {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::create_dir_all(&folder).unwrap();
    for (file, text) in scripts {
        std::fs::write(folder.join(file), text).unwrap();
    }
    let port = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    (folder, format!("tcp/127.0.0.1:{port}"))
}
