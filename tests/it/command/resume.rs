//! Conversions that are killed, continued, or out of disk space.

use crate::common::{self, brickwalk, folder};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// A scene that does not fit in the memory it gets: its items are split on the disk twice, and it has several chunks.
const OPTIONS: &str = "scene city --triangles 400K --memory 56M --brick-triangles 1K --threads 2";

/// Kills that have to hit a conversion.
const KILLS: u32 = 20;

fn command(output: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_brickwalk"));
    command.args(OPTIONS.split(' ')).arg("-o").arg(output).stdout(Stdio::null()).stderr(Stdio::piped());
    command
}

fn names(folder: &Path) -> Vec<String> {
    let mut names = common::names(folder);
    // The camera paths come after the scene file; a kill may leave a temporary file of theirs.
    names.retain(|name| !name.ends_with(".json") && !name.ends_with(".json.tmp"));
    names
}

#[test]
fn killed_conversions_continue_to_the_same_file() {
    let folder = folder();
    let (whole, output) = (folder.path().join("whole.bricks"), folder.path().join("a.bricks"));
    let start = Instant::now();
    let status = command(&whole).status().expect("the command starts");
    assert!(status.success());
    let duration = start.elapsed();
    let expected = std::fs::read(&whole).expect("the whole file");

    let seed = std::time::UNIX_EPOCH.elapsed().map_or(0, |time| time.as_nanos() as u64);
    println!("seed {seed}");
    let mut state = seed | 1;
    let mut random = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    let (mut kills, mut continued) = (0, 0);
    while kills < KILLS {
        let _ = std::fs::remove_file(&output);
        loop {
            let goes_on = names(folder.path()).iter().any(|name| name == ".a.bricks.scratch");
            let mut child = command(&output).arg("--resume").spawn().expect("the command starts");
            if kills < KILLS {
                std::thread::sleep(duration.mul_f64(random()));
                // A conversion that has ended cannot be killed any more.
                if child.try_wait().expect("a child").is_none() && child.kill().is_ok() {
                    kills += 1;
                }
            }
            let ended = child.wait_with_output().expect("a child");
            if ended.status.success() {
                continued += u32::from(goes_on);
                break;
            }
            assert_eq!(ended.status.code(), None, "{}", String::from_utf8_lossy(&ended.stderr));
        }
        assert!(std::fs::read(&output).expect("the file") == expected, "after {kills} kills");
        assert_eq!(names(folder.path()), ["a.bricks", "whole.bricks"]);
    }
    assert!(continued > 0, "some conversion was continued");
}

#[cfg(unix)]
#[test]
fn a_full_disk_is_one_line_and_leaves_nothing() {
    let folder = folder();
    let output = folder.path().join("a.bricks");
    std::fs::write(&output, "old").expect("a file");
    // A limit on the size of files is met as a full disk is: in the middle of a write.
    for (blocks, memory) in [(2000, "56M"), (20000, "56M"), (2000, "10G")] {
        let line = format!("trap '' XFSZ; ulimit -f {blocks}; exec \"$0\" {OPTIONS} --memory {memory} -o \"$1\"");
        let line = line.replacen("--memory 56M ", "", 1);
        let program = env!("CARGO_BIN_EXE_brickwalk");
        let ended = Command::new("sh").args(["-c", &line, program]).arg(&output).output().expect("a shell");
        let message = String::from_utf8_lossy(&ended.stderr);
        assert_eq!(ended.status.code(), Some(1), "{blocks} blocks, {memory}: {message}");
        assert!(message.lines().count() == 1 && message.contains("free some space"), "{message}");
        assert_eq!(names(folder.path()), ["a.bricks"]);
        assert_eq!(std::fs::read(&output).expect("the file"), b"old");
    }
}

#[test]
fn too_little_memory_is_wrong_usage() {
    let folder = folder();
    let output = folder.path().join("a.bricks");
    let words = ["scene", "city", "--memory", "5M", "-o"].map(std::ffi::OsStr::new);
    let ended = brickwalk(words.into_iter().chain([output.as_os_str()]));
    let message = String::from_utf8_lossy(&ended.stderr);
    assert_eq!(ended.status.code(), Some(2), "{message}");
    assert!(message.contains("M or more"), "{message}");
    assert!(names(folder.path()).is_empty());
}

#[cfg(target_os = "linux")]
#[test]
fn memory_stays_within_what_was_given() {
    let folder = folder();
    let peak = |options: &[&str]| {
        let output = folder.path().join("a.bricks");
        let mut child = Command::new(env!("CARGO_BIN_EXE_brickwalk"))
            .args(["scene", "city", "--triangles", "2M", "--threads", "2"])
            .args(options)
            .arg("-o")
            .arg(output)
            .stdout(Stdio::null())
            .spawn()
            .expect("the command starts");
        // The peak of a process is read while it lives: the last reading before it ends.
        let mut peak = 0;
        while child.try_wait().expect("a child").is_none() {
            let status = std::fs::read_to_string(format!("/proc/{}/status", child.id())).unwrap_or_default();
            let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
            let kibibytes = line.and_then(|line| line.trim().strip_suffix(" kB")?.parse::<u64>().ok());
            peak = kibibytes.unwrap_or(0).max(peak);
            std::thread::sleep(Duration::from_millis(5));
        }
        assert!(child.wait().expect("a child").success());
        peak << 10
    };
    let (bounded, free) = (peak(&["--memory", "128M"]), peak(&[]));
    // An eighth for what the allocator holds back.
    assert!(bounded <= (128 << 20) / 8 * 9, "{} MiB", bounded >> 20);
    assert!(free > 200 << 20, "the scene takes more without a bound: {} MiB", free >> 20);
}
