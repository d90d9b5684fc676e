//! One HTML page: what was tried, and what was found.

use crate::kinds;
use crate::tally::{Line, Sum, distinct, sums};
use maud::{DOCTYPE, Markup, PreEscaped, html};

const STYLE: &str = "body{font:15px/1.5 sans-serif;max-width:64rem;margin:2rem auto;padding:0 1rem;color:#222}\
    table{border-collapse:collapse;width:100%}td,th{padding:.25rem .6rem;border-bottom:1px solid #ddd;text-align:left}\
    td.n,th.n{text-align:right;font-variant-numeric:tabular-nums}code,pre{font:13px/1.4 monospace}\
    pre{white-space:pre-wrap;background:#f5f5f5;padding:.5rem}.bad{color:#a00;font-weight:600}";

/// The page of these lines.
pub fn page(lines: &[Line]) -> String {
    let (sums, findings) = (sums(lines), distinct(lines));
    let all = sums.values().fold(Sum::default(), |all, sum| Sum {
        trials: all.trials + sum.trials,
        passed: all.passed + sum.passed,
        stopped: all.stopped + sum.stopped,
        found: all.found + sum.found,
        seconds: all.seconds + sum.seconds,
        peak_bytes: all.peak_bytes.max(sum.peak_bytes),
    });
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head { meta charset="utf-8"; title { "Trials of brickwalk" } style { (PreEscaped(STYLE)) } }
            body {
                h1 { "Trials of brickwalk" }
                p {
                    (grouped(all.trials)) " trials in " (format!("{:.1}", all.seconds / 3600.0)) " hours of workers; "
                    (findings.len()) " sorts of findings."
                }
                table {
                    tr {
                        th { "kind" } th { "what it tries" } th.n { "trials" } th.n { "passed" } th.n { "stopped" }
                        th.n { "found" } th.n { "a second" } th.n { "peak MiB" }
                    }
                    @for (name, sum) in &sums { (row(name, sum)) }
                    (row("all", &all))
                }
                h2 { "Findings" }
                @if findings.is_empty() { p { "None." } }
                @for finding in findings {
                    h3 { (finding.kind) ": " (finding.what) }
                    pre { (finding.text) }
                    p { code { (finding.command) } " at commit " code { (finding.commit) } }
                }
            }
        }
    };
    page.into_string()
}

fn row(name: &str, sum: &Sum) -> Markup {
    html! {
        tr {
            td { (name) }
            td { @if let Some(kind) = kinds::find(name) { (kind.about()) } }
            td.n { (grouped(sum.trials)) }
            td.n { (grouped(sum.passed)) }
            td.n { (grouped(sum.stopped)) }
            td.n.bad[sum.found > 0] { (grouped(sum.found)) }
            td.n { (format!("{:.1}", sum.trials as f64 / sum.seconds.max(1e-9))) }
            td.n { (format!("{:.1}", sum.peak_bytes as f64 / f64::from(1 << 20))) }
        }
    }
}

/// A table of Markdown of the same.
pub fn table(lines: &[Line]) -> String {
    let mut text = String::from("| kind | trials | passed | stopped | found | a second | peak MiB |\n");
    text += "| --- | ---: | ---: | ---: | ---: | ---: | ---: |\n";
    for (name, sum) in sums(lines) {
        text += &format!(
            "| {name} | {} | {} | {} | {} | {:.1} | {:.1} |\n",
            grouped(sum.trials),
            grouped(sum.passed),
            grouped(sum.stopped),
            grouped(sum.found),
            sum.trials as f64 / sum.seconds.max(1e-9),
            sum.peak_bytes as f64 / f64::from(1 << 20)
        );
    }
    text
}

/// A number with commas between thousands.
fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (at, digit) in digits.chars().enumerate() {
        if at > 0 && (digits.len() - at).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}
