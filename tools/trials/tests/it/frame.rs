//! The frame, with kinds that misbehave on purpose.

use crate::{counts, run, said};
use brickwalk_trials::tally::{Line, Range, Tally, distinct, read, sums};

#[test]
fn every_way_to_misbehave_is_found_and_repeated() {
    for (kind, what) in [
        ("own/fault", "a fault"),
        ("own/panic", "panic at "),
        ("own/hang", "hang"),
        ("own/abort", "signal 6"),
        ("own/memory", "memory"),
        ("own/all-memory", "abort for want of memory"),
        ("own/stack", "overflow of the stack"),
    ] {
        let output = run(&format!("--only {kind} --seed 0 --count 7 --minutes 5"), &[]);
        let text = said(&output);
        assert_eq!(output.status.code(), Some(1), "{kind}: {text}");
        // Trials 2 and 6 misbehave, the others do not, and none is left out or made twice.
        assert_eq!(counts(&text, kind), [7, 2, 3, 2], "{kind}: {text}");
        assert!(text.contains(&format!("{kind}: {what}")), "{kind}: {text}");
        let command = format!("brickwalk-trials --only {kind} --seed 2 --count 1");
        assert!(text.contains(&command), "{kind}: {text}");
        let again = said(&run(command.trim_start_matches("brickwalk-trials "), &[]));
        assert!(again.contains(&format!("{kind}: {what}")) && counts(&again, kind)[3] == 1, "{kind}: {again}");
        let other = run(&format!("--only {kind} --seed 3 --count 1"), &[]);
        assert_eq!(other.status.code(), Some(0), "control: {}", said(&other));
    }
}

#[test]
fn tallies_go_on_and_add_up() {
    let folder = tempfile::tempdir().unwrap();
    let words = |count: u64| format!("--only own/fault --count {count} --minutes 5 --out");
    assert_eq!(run(&words(3), &[folder.path()]).status.code(), Some(1));
    let file = folder.path().join("trials.jsonl");
    // The last line was being written when the process was killed.
    let mut bytes = std::fs::read(&file).unwrap();
    bytes.extend(b"{\"line\":\"tri");
    std::fs::write(&file, bytes).unwrap();
    assert_eq!(run(&words(2), &[folder.path()]).status.code(), Some(0), "trials 3 and 4 find nothing");
    let (lines, _) = read(&file).unwrap();
    let ranges: Vec<(u64, u64)> = lines
        .iter()
        .filter_map(|line| if let Line::Trials(range) = line { Some((range.from, range.to)) } else { None })
        .collect();
    assert_eq!(ranges, [(0, 3), (3, 5)]);
    let sum = sums(&lines)["own/fault"];
    assert_eq!((sum.trials, sum.passed, sum.stopped, sum.found), (5, 2, 2, 1));
    assert_eq!(distinct(&lines).len(), 1);
    let page = std::fs::read_to_string(folder.path().join("trials.html")).unwrap();
    assert!(page.contains("--only own/fault --seed 2 --count 1") && page.ends_with("</html>"), "{page}");
    let join = said(&run("join", &[&file]));
    std::fs::write(folder.path().join("joined"), &join).unwrap();
    let (joined, _) = read(&folder.path().join("joined")).unwrap();
    assert_eq!(joined.len(), 2, "a range and a finding: {join}");
    assert_eq!(sums(&joined)["own/fault"], sum);
    // A line that is none is told, and nothing is lost.
    std::fs::write(&file, "{}\n").unwrap();
    let output = run(&words(2), &[folder.path()]);
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("line 1"));
    assert_eq!(std::fs::read(&file).unwrap(), b"{}\n");
}

#[test]
fn seeds_of_other_kinds_do_not_count() {
    let folder = tempfile::tempdir().unwrap();
    let mut tally = Tally::open(&folder.path().join("t")).unwrap();
    let range = |kind: &str, from, to| Line::Trials(Range { kind: kind.into(), from, to, ..Range::default() });
    tally.push(range("a", 0, 9)).unwrap();
    tally.push(range("b", 4, 5)).unwrap();
    assert_eq!([tally.next("a"), tally.next("b"), tally.next("c")], [9, 5, 0]);
}

#[test]
fn what_is_wrong_is_usage() {
    for words in ["--only nothing", "--minutes 0", "--keep a --count 2", "table none/such", "join none/such"] {
        let output = run(words, &[]);
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{words}");
        assert!(text.starts_with("brickwalk-trials: ") && text.lines().count() == 1, "{words}: {text}");
    }
}
