//! Tables of measurements: every entry lies under its head, in a page as in plain text.

use brickwalk_report::{Section, Sheet, Shown, Table, Value, write_sheet};

fn table() -> Table {
    let row = |way: &str, ms: f64, paper: Option<f64>| vec![way.into(), Value::Number(ms), Value::number(paper)];
    Table {
        name: "speed".into(),
        caption: String::new(),
        columns: ["way", "generation, ms", "paper"].map(String::from).to_vec(),
        rows: vec![row("roma 128 K=4 unsnapped", 1.25, Some(0.3)), row("exact", 1200.0, None)],
    }
}

#[test]
fn columns_of_markdown_are_aligned_in_the_text() {
    let text = table().to_markdown();
    let borders =
        |line: &str| -> Vec<usize> { line.chars().enumerate().filter(|(_, c)| *c == '|').map(|(at, _)| at).collect() };
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines.len(), 4, "{text}");
    assert!(lines.iter().all(|line| borders(line) == borders(lines[0])), "{text}");
    // Words begin where their head does, numbers end there.
    assert!(lines[0].starts_with("| way  ") && lines[3].starts_with("| exact  "), "{text}");
    assert!(lines[0].contains("generation, ms |") && lines[3].contains("1,200 |"), "{text}");
    assert!(lines[1].starts_with("| ----------------------") && lines[1].ends_with("--: |"), "{text}");
}

#[test]
fn heads_lie_over_their_cells_and_names_in_one_line() {
    let folder = tempfile::tempdir().expect("a folder");
    let picture = Shown { caption: "exact <4 rays>".into(), png: b"no picture".to_vec() };
    let pictures = vec![picture];
    let section = Section { title: "Times".into(), tables: vec![table()], pictures, ..Section::default() };
    let sheet = Sheet {
        kicker: "bench".into(),
        title: "Times".into(),
        verdicts: Vec::new(),
        facts: Vec::new(),
        sections: vec![section],
    };
    write_sheet(folder.path(), &sheet).expect("a page");
    let html = std::fs::read_to_string(folder.path().join("report.html")).expect("a page");
    assert!(html.contains("<th class=\"name\">way</th><th>generation, ms</th><th>paper</th>"), "{html}");
    assert!(html.contains("<td class=\"name\">exact</td><td>"), "{html}");
    assert!(!html.contains("min-width:0"), "names are not squeezed");
    assert!(html.contains("base64,bm8gcGljdHVyZQ==") && html.contains("exact &lt;4 rays&gt;"), "{html}");
}
