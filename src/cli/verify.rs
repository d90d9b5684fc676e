//! `verify`: every checksum and reference of a `.bricks` file.

use super::options::scene_args::VerifyArgs;
use crate::cli::output::note;
use crate::remote;
use crate::settings::sizes::{counted, human_bytes};
use anyhow::{Result, bail};
use bricks::{Error, Part, Payload, Section, VerifyReport};
use brickwalk_convert::progress::Progress;

/// Most parts that the error line lists; the rest are counted.
const LISTED: usize = 8;

/// Runs `verify`.
///
/// # Errors
/// The file cannot be opened, or something in it is not as it was written; the message names every damaged part, bricks
/// by their number.
pub fn run(args: &VerifyArgs) -> Result<()> {
    let report = watched(&Progress::new(), |progress| match remote::is_url(&args.scene) {
        true => Ok(remote::open(&args.scene)?.verify(progress)?),
        false => Ok::<_, anyhow::Error>(bricks::verify_file(&args.scene, progress)?),
    })?;
    if let Some(message) = problems(&report) {
        bail!("{message}");
    }
    note(&format!(
        "{}: OK: {}, {}\n",
        args.scene.display(),
        counted(report.payloads, "payload"),
        human_bytes(report.file_bytes)
    ))
}

/// Shows the progress of a `verification`, which reports bytes done and in all.
pub(crate) fn watched<T>(progress: &Progress, verification: impl FnOnce(&mut dyn FnMut(u64, u64)) -> T) -> T {
    let mut shown = None;
    // Mebibytes, so that the bar's numbers stay readable.
    let result = verification(&mut |done, total| {
        if shown.is_none() {
            progress.phase("verify MiB", total >> 20);
        }
        let (before, now) = (shown.unwrap_or(0), done >> 20);
        progress.advance(now.saturating_sub(before));
        shown = Some(now.max(before));
    });
    progress.finish();
    result
}

/// One line about everything that is wrong, or nothing: the first problem in full, then the other damaged parts.
fn problems(report: &VerifyReport) -> Option<String> {
    let (first, others) = report.problems.split_first()?;
    let mut line = first.to_string();
    if !others.is_empty() {
        let parts: Vec<String> = others.iter().take(LISTED).map(name).collect();
        line += &format!("; {} more: {}", others.len(), parts.join(", "));
        if others.len() > LISTED {
            line += " and others";
        }
    }
    let bricks = damaged_bricks(report);
    if bricks.len() > 1 {
        let numbers: Vec<String> = bricks.iter().take(LISTED).map(u32::to_string).collect();
        let more = if bricks.len() > LISTED { ", ..." } else { "" };
        line += &format!("; {} bricks: {}{more}", bricks.len(), numbers.join(", "));
    }
    Some(line)
}

fn name(problem: &Error) -> String {
    match problem {
        Error::Within { place, .. } if is_of_level(problem) => return place.clone(),
        _ => {}
    }
    problem.part().map_or_else(|| problem.to_string(), |part| part.to_string())
}

/// Whether a level of detail is at fault: of bricks these alone have a place.
fn is_of_level(problem: &Error) -> bool {
    let payload = match problem {
        Error::Within { .. } => problem.part(),
        _ => None,
    };
    matches!(
        payload,
        Some(
            Part::Payload(Payload::Geometry(_) | Payload::Attributes(_))
                | Part::PaddingAfterPayload(Payload::Geometry(_) | Payload::Attributes(_))
        )
    )
}

/// The bricks with a problem, ascending, each once; levels of detail are none.
fn damaged_bricks(report: &VerifyReport) -> Vec<u32> {
    let mut bricks: Vec<u32> = report
        .problems
        .iter()
        .filter(|problem| !is_of_level(problem))
        .filter_map(|problem| match problem.part()? {
            Part::Record(Section::Bricks, brick) => Some(brick),
            Part::Payload(payload) | Part::PaddingAfterPayload(payload) => match payload {
                Payload::Geometry(brick) | Payload::Attributes(brick) | Payload::Proxies(brick) => Some(brick),
                Payload::Texture(_) | Payload::Tile(_) | Payload::Opacity(_) | Payload::Displacement(_) => None,
            },
            _ => None,
        })
        .collect();
    bricks.sort_unstable();
    bricks.dedup();
    bricks
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report(parts: &[Part]) -> VerifyReport {
        let problem = |&part: &Part| Error::Corrupt { path: "s.bricks".into(), part, found: 1, expected: 2 };
        VerifyReport { file_bytes: 9, payloads: 3, problems: parts.iter().map(problem).collect() }
    }

    #[test]
    fn names_the_bricks() {
        assert_eq!(problems(&report(&[])), None);
        let line = problems(&report(&[Part::Payload(Payload::Geometry(17))])).unwrap();
        assert!(line.starts_with("s.bricks: brick 17 geometry is damaged"), "{line}");
        assert!(!line.contains("more"));
        let line = problems(&report(&[
            Part::Payload(Payload::Attributes(4)),
            Part::Payload(Payload::Geometry(4)),
            Part::Payload(Payload::Texture(9)),
            Part::Payload(Payload::Geometry(2)),
        ]))
        .unwrap();
        assert!(line.contains("3 more: brick 4 geometry, texture 9, brick 2 geometry; 2 bricks: 2, 4"), "{line}");
        // A level has its own name, and is no brick.
        let mut named = report(&[7, 9].map(|brick| Part::Payload(Payload::Geometry(brick))));
        named.problems = named
            .problems
            .into_iter()
            .map(|error| Error::Within { error: Box::new(error), place: "level 3 geometry".into() })
            .chain(report(&[Part::Payload(Payload::Geometry(2))]).problems)
            .collect();
        let line = problems(&named).unwrap();
        assert!(line.contains("(level 3 geometry); 2 more: level 3 geometry, brick 2 geometry"), "{line}");
        assert!(!line.contains(" bricks: "), "{line}");
        let many: Vec<Part> = (0..1000).map(|i| Part::Payload(Payload::Geometry(i))).collect();
        assert!(problems(&report(&many)).unwrap().len() < 600);
    }
}
