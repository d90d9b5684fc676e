//! `brickwalk jobs`: what a farm runs to render a walk on many machines.
//!
//! Frames are rendered as parts, which need nothing of each other, and then joined. Every command runs by itself: the
//! one that joins renders what is missing.

use super::cached;
use super::options::args::{Cli, Command};
use super::options::job_args::{JobFormat, JobsArgs, PartRange};
use super::options::render_args::WalkArgs;
use crate::cli::output::{Usage, print};
use crate::session::parts;
use anyhow::Result;
use clap::Parser;
use serde_json::{Value, json};
use std::borrow::Cow;
use std::iter::once;

/// Most values of a task's parameter (Open Job Description, 2023-09, 3.4.1.1).
const MOST_TASKS: usize = 1024;

/// Runs the command.
///
/// # Errors
/// Words that are no walk, or one that is not for many machines.
pub fn run(args: &JobsArgs) -> Result<()> {
    let walk = walk(&args.command)?;
    let settings = walk.settings()?;
    parts::check(&settings).map_err(|error| Usage(error.to_string()))?;
    let chunks = chunks(parts::count(&settings), args.chunk);
    match args.format {
        JobFormat::Json => {
            let (scene, output) = walk.files()?;
            let scene = cached::scene(scene)?;
            let job = json!({
                "scene": scene.to_string_lossy(),
                "output": output.to_string_lossy(),
                "frames": settings.frames,
                "parts": parts::count(&settings),
                "key": parts::key_of(&scene, &settings)?,
                "settings": settings.to_given_toml(),
            });
            print(&(serde_json::to_string_pretty(&job)? + "\n"))
        }
        JobFormat::Lines => print(&lines(&args.command, &chunks)),
        JobFormat::Openjd => {
            let template = template(&args.command, &chunks)?;
            print(&(serde_json::to_string_pretty(&template)? + "\n"))
        }
    }
}

/// The walk of these words.
fn walk(words: &[String]) -> Result<Box<WalkArgs>> {
    let usage = |text: String| anyhow::Error::from(Usage(text));
    let parsed = Cli::try_parse_from(once("brickwalk").chain(words.iter().map(String::as_str)));
    let walk = match parsed.map(|cli| cli.command) {
        Ok(Command::Walk(walk)) => walk,
        Ok(_) => {
            return Err(usage("jobs: only a walk is split, as in jobs --format lines -- walk S.bricks -o out".into()));
        }
        Err(error) => {
            let text = error.to_string();
            let line = text.lines().next().unwrap_or_default();
            return Err(usage(format!("jobs: {}", line.strip_prefix("error: ").unwrap_or(line))));
        }
    };
    if walk.part.is_some() || walk.join || walk.json || walk.print_settings {
        return Err(usage("jobs: give the walk without --part, --join, --json and --print-settings".into()));
    }
    Ok(walk)
}

/// The parts, so many at a time.
fn chunks(parts: u32, most: u32) -> Vec<PartRange> {
    let starts = (0..parts).step_by(most as usize);
    starts.map(|first| PartRange { first, last: (first.saturating_add(most) - 1).min(parts - 1) }).collect()
}

/// A command a line: those that render, then the one that joins.
fn lines(words: &[String], chunks: &[PartRange]) -> String {
    let line = |more: &str| {
        let words = ["brickwalk"].into_iter().chain(words.iter().map(String::as_str));
        words.map(quoted).collect::<Vec<_>>().join(" ") + " " + more + "\n"
    };
    chunks.iter().map(|parts| line(&format!("--part {parts}"))).chain(once(line("--join"))).collect()
}

/// A word as shells of POSIX read it.
fn quoted(word: &str) -> Cow<'_, str> {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_./:=,+@%".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        return word.into();
    }
    format!("'{}'", word.replace('\'', r"'\''")).into()
}

/// A job template: a step whose tasks render, and one that joins. Names of files count from the template's folder.
fn template(words: &[String], chunks: &[PartRange]) -> Result<Value> {
    let usage = |text: String| anyhow::Error::from(Usage(text));
    if chunks.len() > MOST_TASKS {
        let text = format!("jobs: Open Job Description allows {MOST_TASKS} tasks, not {}; raise --chunk", chunks.len());
        return Err(usage(text));
    }
    if let Some(word) = words.iter().find(|word| word.contains("{{")) {
        return Err(usage(format!("jobs: {word}: a job template reads {{{{ as its own; give another name")));
    }
    let script = |more: [&str; 2]| {
        // The shell goes to the folder and becomes the command.
        let own = ["-c", "cd \"$0\" && exec \"$@\"", "{{Param.Folder}}", "{{Param.Program}}"].into_iter();
        let words = words.iter().map(String::as_str).chain(more.into_iter().filter(|word| !word.is_empty()));
        json!({ "actions": { "onRun": { "command": "sh", "args": own.chain(words).collect::<Vec<_>>() } } })
    };
    Ok(json!({
        "specificationVersion": "jobtemplate-2023-09",
        "name": "brickwalk walk",
        "parameterDefinitions": [
            {
                "name": "Folder",
                "type": "PATH",
                "objectType": "DIRECTORY",
                "dataFlow": "INOUT",
                "default": ".",
                "description": "The folder that names of files count from, which all machines see; that of the template.",
            },
            { "name": "Program", "type": "STRING", "default": "brickwalk", "description": "The program." },
        ],
        "steps": [
            {
                "name": "Render",
                "parameterSpace": {
                    "taskParameterDefinitions": [{
                        "name": "Parts",
                        "type": "STRING",
                        "range": chunks.iter().map(ToString::to_string).collect::<Vec<_>>(),
                    }],
                },
                "script": script(["--part", "{{Task.Param.Parts}}"]),
            },
            { "name": "Join", "dependencies": [{ "dependsOn": "Render" }], "script": script(["--join", ""]) },
        ],
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(text: &str) -> Vec<String> {
        text.split(' ').map(str::to_owned).collect()
    }

    #[test]
    fn every_part_is_in_one_chunk() {
        for (frames, most) in [(1, 10), (10, 10), (25, 10), (7, 1), (5, 1_000_000)] {
            let all: Vec<u32> = chunks(frames, most).iter().flat_map(|range| range.first..=range.last).collect();
            assert_eq!(all, (0..frames).collect::<Vec<_>>());
        }
        assert_eq!(chunks(25, 10).iter().map(ToString::to_string).collect::<Vec<_>>(), ["0-9", "10-19", "20-24"]);
    }

    #[test]
    fn lines_are_commands_of_a_shell() {
        let words = words("walk s.bricks -o my\u{a0}out --hide a*,b'c");
        let text = lines(&words, &chunks(3, 2));
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 3);
        assert_eq!(lines[0], "brickwalk walk s.bricks -o 'my\u{a0}out' --hide 'a*,b'\\''c' --part 0-1");
        assert!(lines[1].ends_with(" --part 2") && lines[2].ends_with(" --join"));
    }

    #[test]
    fn only_walks_are_split_that_can_be() {
        assert_eq!(walk(&words("walk s.bricks -o out --frames 7")).unwrap().settings().unwrap().frames, 7);
        for (text, named) in [
            ("info s.bricks", "only a walk"),
            ("walk s.bricks", "required"),
            ("walk s.bricks -o out --nonsense", "--nonsense"),
            ("walk s.bricks -o out --part 3", "without --part"),
        ] {
            let error = walk(&words(text)).unwrap_err();
            assert!(error.is::<Usage>() && error.to_string().contains(named), "{text}: {error}");
        }
    }

    #[test]
    fn frames_that_need_others_are_not_split() {
        let command = words("walk s.bricks -o out --frame-budget 8M");
        let error = run(&JobsArgs { format: JobFormat::Lines, chunk: 10, command }).unwrap_err();
        assert!(error.is::<Usage>() && error.to_string().contains("--frame-budget"), "{error}");
    }

    #[test]
    fn templates_name_tasks_and_what_joins_them() {
        let words = words("walk s.bricks -o out");
        let template = template(&words, &chunks(25, 10)).unwrap();
        let steps = template["steps"].as_array().unwrap();
        assert_eq!(
            steps[0]["parameterSpace"]["taskParameterDefinitions"][0]["range"],
            json!(["0-9", "10-19", "20-24"])
        );
        assert_eq!(steps[1]["dependencies"][0]["dependsOn"], "Render");
        let args = &steps[0]["script"]["actions"]["onRun"]["args"];
        assert_eq!(args.as_array().unwrap().last().unwrap(), "{{Task.Param.Parts}}");
        assert!(super::template(&words, &chunks(1025, 1)).is_err());
        assert!(super::template(&["walk".into(), "{{x".into()], &chunks(1, 1)).is_err());
    }
}
