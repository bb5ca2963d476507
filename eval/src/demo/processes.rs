//! The server and the client as child processes that never outlive a failure.
//!
//! Ctrl-C in a terminal reaches the children as well: they are in the same
//! process group. Should this process alone be killed, the client still ends
//! after its seconds and the server with its only client.

use std::{
    env::consts::EXE_SUFFIX,
    fs::{self, File},
    io::{BufRead, BufReader},
    path::{Path, PathBuf},
    process::{Child, ChildStdout, Command, ExitStatus, Stdio},
    sync::mpsc::{self, Receiver, RecvTimeoutError},
    thread,
    time::{Duration, Instant},
};

use anyhow::{Context, Result, bail, ensure};
use indicatif::{ProgressBar, ProgressStyle};

use super::{COURTYARD, Options, remove};

/// Loading a scene and building its BVH is to end within this time.
const START_LIMIT: Duration = Duration::from_secs(60);
/// Time of the client beyond its seconds: its GPU pipelines, and writing pictures.
const CLIENT_LIMIT: Duration = Duration::from_secs(60);
/// From the client's end to the server's.
const STOP_LIMIT: Duration = Duration::from_secs(20);
/// Between two looks at the children.
const POLL: Duration = Duration::from_millis(50);
/// Lines of the server's log that an error shows.
const LOG_TAIL: usize = 20;

/// `shadecast serve`.
pub(super) struct Server {
    process: Process,
    lines: Receiver<String>,
    log: PathBuf,
    identity: PathBuf,
}

impl Server {
    pub(super) fn start(options: &Options) -> Result<Self> {
        let log = options.out.join("server.log");
        let stderr =
            File::create(&log).with_context(|| format!("cannot write {}", log.display()))?;
        let identity = options.out.join("identity");
        let mut command = beside_this("shadecast")?;
        command
            .arg("serve")
            .arg(&options.scene)
            .args(["--listen", "127.0.0.1:0", "--once"])
            .args(["--method", options.method.name()])
            .args(["--atlas", &options.atlas.to_string()])
            .args(["--bitrate", &options.bitrate.to_string()])
            .arg("--stats")
            .arg(options.out.join("server.json"))
            .arg("--identity")
            .arg(&identity)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(stderr);
        if options.scene == Path::new(COURTYARD) {
            command.args(["--triangles", &options.triangles.to_string()]);
        }
        let mut process = Process::spawn("shadecast serve", command)?;
        let stdout = process
            .child
            .stdout
            .take()
            .context("the server has no output")?;
        Ok(Self {
            process,
            lines: lines_of(stdout),
            log,
            identity,
        })
    }

    /// Waits for the line that a client is started with.
    pub(super) fn line(&mut self) -> Result<String> {
        let spinner = spinner("the server loads the scene");
        let deadline = Instant::now() + START_LIMIT;
        while Instant::now() < deadline {
            match self.lines.recv_timeout(POLL) {
                Ok(line) if line.starts_with("shadecast://") => {
                    spinner.finish_and_clear();
                    return Ok(line);
                }
                Ok(_) | Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => {
                    let status = self.process.wait(STOP_LIMIT)?;
                    bail!(
                        "the server ended before it served ({status})\n{}",
                        self.log_tail()
                    );
                }
            }
        }
        bail!(
            "the server was not ready within {} s\n{}",
            START_LIMIT.as_secs(),
            self.log_tail()
        )
    }

    /// Waits for the end that the client's leaving brings.
    pub(super) fn finish(mut self) -> Result<()> {
        let status = self.process.wait(STOP_LIMIT);
        match status {
            Ok(status) if status.success() => Ok(()),
            Ok(status) => bail!("the server failed ({status})\n{}", self.log_tail()),
            Err(error) => Err(error.context(self.log_tail())),
        }
    }

    fn check(&mut self) -> Result<()> {
        match self.process.poll()? {
            Some(status) if !status.success() => {
                bail!("the server failed ({status})\n{}", self.log_tail())
            }
            _ => Ok(()),
        }
    }

    fn log_tail(&self) -> String {
        let log = fs::read(&self.log).unwrap_or_default();
        let log = String::from_utf8_lossy(&log);
        let lines: Vec<&str> = log.lines().collect();
        let tail = &lines[lines.len().saturating_sub(LOG_TAIL)..];
        format!("the end of {}:\n{}", self.log.display(), tail.join("\n"))
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        // Its key served this one run; nobody should find it beside the pictures.
        if let Err(error) = remove(&self.identity) {
            eprintln!("warning: {error:#}");
        }
    }
}

/// `shadecast-desktop`.
pub(super) struct Client {
    process: Process,
    limit: Duration,
}

impl Client {
    pub(super) fn start(options: &Options, line: &str) -> Result<Self> {
        let mut command = beside_this("shadecast-desktop")?;
        command
            .arg(line)
            .args(["--seconds", &options.seconds.to_string()])
            .args(["--display-rate", &options.display_rate.to_string()])
            .args(["--eye-size", &options.eye_size.to_string()])
            .args(["--seed", &options.seed.to_string()])
            .arg("--out")
            .arg(&options.out)
            .stdin(Stdio::null());
        Ok(Self {
            process: Process::spawn("shadecast-desktop", command)?,
            limit: Duration::from_secs(options.seconds.into()) + CLIENT_LIMIT,
        })
    }

    /// Waits for the client's own end; a failure of the server is found at once.
    pub(super) fn finish(mut self, server: &mut Server) -> Result<()> {
        let deadline = Instant::now() + self.limit;
        loop {
            server.check()?;
            if let Some(status) = self.process.poll()? {
                ensure!(status.success(), "the client failed ({status})");
                return Ok(());
            }
            ensure!(
                Instant::now() < deadline,
                "the client did not end within {} s",
                self.limit.as_secs()
            );
            thread::sleep(POLL);
        }
    }
}

/// A child that is killed when it is dropped.
struct Process {
    name: &'static str,
    child: Child,
}

impl Process {
    fn spawn(name: &'static str, mut command: Command) -> Result<Self> {
        let child = command
            .spawn()
            .with_context(|| format!("cannot start {name}"))?;
        Ok(Self { name, child })
    }

    fn poll(&mut self) -> Result<Option<ExitStatus>> {
        self.child
            .try_wait()
            .with_context(|| format!("cannot wait for {}", self.name))
    }

    fn wait(&mut self, limit: Duration) -> Result<ExitStatus> {
        let deadline = Instant::now() + limit;
        loop {
            if let Some(status) = self.poll()? {
                return Ok(status);
            }
            ensure!(
                Instant::now() < deadline,
                "{} did not end within {} s",
                self.name,
                limit.as_secs()
            );
            thread::sleep(POLL);
        }
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // Both fail only for a child that has ended already.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The program of this name that was built together with this one.
fn beside_this(name: &str) -> Result<Command> {
    let own = std::env::current_exe().context("cannot find this program's own folder")?;
    let path = own.with_file_name(format!("{name}{EXE_SUFFIX}"));
    ensure!(
        path.is_file(),
        "{} is missing: build it with `cargo build --release`",
        path.display()
    );
    Ok(Command::new(path))
}

/// Lines as they come. The thread reads on when nobody listens any more, so
/// that the child never blocks on a full pipe.
fn lines_of(stdout: ChildStdout) -> Receiver<String> {
    let (sender, receiver) = mpsc::channel();
    thread::spawn(move || {
        for line in BufReader::new(stdout).lines().map_while(Result::ok) {
            let _ = sender.send(line);
        }
    });
    receiver
}

fn spinner(message: &'static str) -> ProgressBar {
    let style = ProgressStyle::with_template("{spinner} {msg} {elapsed}")
        .unwrap_or_else(|_| ProgressStyle::default_spinner());
    let spinner = ProgressBar::new_spinner()
        .with_style(style)
        .with_message(message);
    spinner.enable_steady_tick(Duration::from_millis(100));
    spinner
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    fn shell(script: &str) -> Process {
        let mut command = Command::new("sh");
        command.args(["-c", script]).stdout(Stdio::piped());
        Process::spawn("sh", command).unwrap()
    }

    #[test]
    fn lines_come_until_the_end() {
        let mut process = shell("echo one; echo two");
        let lines = lines_of(process.child.stdout.take().unwrap());
        assert_eq!(lines.iter().collect::<Vec<_>>(), ["one", "two"]);
        assert!(process.wait(STOP_LIMIT).unwrap().success());
    }

    #[test]
    fn a_child_that_does_not_end_is_killed() {
        let mut process = shell("exec sleep 600");
        let lines = lines_of(process.child.stdout.take().unwrap());
        let error = process.wait(Duration::from_millis(60)).unwrap_err();
        assert_eq!(error.to_string(), "sh did not end within 0 s");
        drop(process);
        // Its end of the pipe closes with it.
        assert_eq!(lines.recv(), Err(mpsc::RecvError));
    }
}
