//! `brickwalk replay`: a recorded trace of requests against other cache sizes and policies.

use super::options::args::ReplayArgs;
use crate::cli::output::{print, print_json};
use crate::session::opened::cache_budget;
use crate::settings::sizes::{CacheSize, human_bytes, human_count};
use crate::stream::{Replay, ReplayResult, Residency, ResidencyError, Trace, TraceError, replay};
use anyhow::{Context, Result, ensure};
use serde_json::{Value, json};
use std::fmt::Write;
use std::fs::File;
use std::io::BufReader;

/// Raised when a field changes its meaning.
const FORMAT: u32 = 2;

/// Shares of all bricks and tiles, percent, that are replayed without `--cache`.
const LADDER: [f64; 5] = [5.0, 10.0, 20.0, 50.0, 100.0];

/// The shares with a plot.
const DENSE: [f64; 26] = [
    2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 12.0, 15.0, 18.0, 20.0, 22.0, 25.0, 28.0, 30.0, 35.0, 40.0, 45.0, 50.0, 55.0,
    60.0, 65.0, 70.0, 80.0, 90.0, 100.0,
];

/// A cache size and what every policy made of the trace in it.
struct Rung {
    budget_bytes: u64,
    recorded: bool,
    results: Vec<(Replay, ReplayResult)>,
}

/// Runs the command.
///
/// # Errors
/// The file cannot be read, is no trace, or is not whole.
pub fn run(args: &ReplayArgs) -> Result<()> {
    let name = args.requests.display().to_string();
    let file = File::open(&args.requests)
        .with_context(|| format!("{name}: cannot open this file; check its path and permissions"))?;
    ensure!(!file.metadata()?.is_dir(), "{name}: this is a folder; give the file that --requests-out wrote");
    let trace = Trace::read(BufReader::new(file)).with_context(|| name.clone())?;
    let ladder = if args.plot.is_some() { &DENSE[..] } else { &LADDER };
    let asked = if args.cache.is_empty() {
        ladder.iter().map(|&percent| CacheSize::Percent(percent)).collect()
    } else {
        args.cache.clone()
    };
    let (rungs, skipped) = climb(&trace, &asked).with_context(|| name.clone())?;
    let json = as_json(&trace, &rungs, &skipped);
    if let Some(page) = &args.plot {
        let short = args.requests.file_name().map_or(name.clone(), |file| file.to_string_lossy().into_owned());
        brickwalk_report::write_replay(page, &short, &json)?;
    }
    if args.json {
        return print_json(&json);
    }
    print(&format!("{name}: {}", as_text(&trace, &rungs, &skipped)))
}

/// Bytes of all bricks and tiles; saturates.
fn all_bytes(trace: &Trace) -> u64 {
    trace.sizes.sum()
}

/// Replays in the recorded cache and in those asked for, each size once, ascending; and the sizes too small for the
/// scene.
fn climb(trace: &Trace, asked: &[CacheSize]) -> Result<(Vec<Rung>, Vec<u64>), TraceError> {
    // As the cache rounds it.
    let recorded = trace.budget_bytes - trace.budget_bytes % 16;
    let given =
        asked.iter().map(|&size| cache_budget(size, &trace.sizes, trace.page_bytes, trace.budget_bytes) / 16 * 16);
    let mut budgets: Vec<u64> = given.chain([recorded]).collect();
    budgets.sort_unstable();
    budgets.dedup();
    let (mut rungs, mut skipped) = (Vec::new(), Vec::new());
    for budget_bytes in budgets {
        let against = |policy| {
            let result = replay(trace, &trace.sizes, budget_bytes, trace.page_bytes, policy)?;
            Ok((policy, result))
        };
        let recorded = budget_bytes == recorded;
        match Replay::ALL.into_iter().map(against).collect::<Result<_, TraceError>>() {
            Ok(results) => rungs.push(Rung { budget_bytes, recorded, results }),
            Err(TraceError::Cache(ResidencyError::CacheTooSmall { .. })) if !recorded => skipped.push(budget_bytes),
            Err(error) => return Err(error),
        }
    }
    Ok((rungs, skipped))
}

/// Share of everything in percent.
fn percent(budget: u64, all: u64) -> f64 {
    100.0 * budget as f64 / all.max(1) as f64
}

fn as_json(trace: &Trace, rungs: &[Rung], skipped: &[u64]) -> Value {
    let all = all_bytes(trace);
    let one = rungs.first().and_then(|rung| rung.results.first()).map(|one| one.1).unwrap_or_default();
    let rows = rungs.iter().flat_map(|rung| {
        rung.results.iter().map(move |(policy, result)| {
            json!({
                "cache_bytes": rung.budget_bytes,
                "cache_percent": percent(rung.budget_bytes, all),
                "recorded": rung.recorded && *policy == Replay::Cache(trace.policy),
                "policy": policy.name(),
                "loads": result.loads,
                "loaded_again": result.loaded_again(),
                "evicted": result.evicted,
                "loaded_bytes": result.loaded_bytes,
                "hits": result.hits,
                "hit_rate": result.hit_rate(),
            })
        })
    });
    json!({
        "format": FORMAT,
        "recorded": {
            "policy": trace.policy.name(),
            "cache_bytes": trace.budget_bytes,
            "page_bytes": trace.page_bytes,
        },
        "bricks": trace.sizes.bricks.len(),
        "tiles": trace.sizes.tiles.len(),
        "brick_bytes": all,
        "least_cache_bytes": Residency::least_budget(&trace.sizes),
        "passes": trace.passes.len(),
        "requests": one.requests,
        "distinct": one.distinct,
        "distinct_bytes": one.distinct_bytes,
        "results": rows.collect::<Vec<_>>(),
        "skipped_cache_bytes": skipped,
    })
}

fn as_text(trace: &Trace, rungs: &[Rung], skipped: &[u64]) -> String {
    let all = all_bytes(trace);
    let one = rungs.first().and_then(|rung| rung.results.first()).map(|one| one.1).unwrap_or_default();
    let cache = |bytes: u64| format!("{} ({:.1} %)", human_bytes(bytes), percent(bytes, all));
    let mut out = String::new();
    // Writing to a string does not fail.
    let _ = writeln!(
        out,
        "{} passes, {} requests of {} payloads ({}); recorded with {}, {}",
        human_count(trace.passes.len() as u64),
        human_count(one.requests),
        human_count(one.distinct),
        human_bytes(one.distinct_bytes),
        trace.policy,
        cache(trace.budget_bytes),
    );
    let _ = writeln!(
        out,
        "\n{:<22} {:<13} {:>10} {:>12} {:>10} {:>11} {:>8}",
        "cache", "policy", "loads", "loaded again", "evicted", "loaded", "hits"
    );
    for rung in rungs {
        for (policy, result) in &rung.results {
            let recorded = rung.recorded && *policy == Replay::Cache(trace.policy);
            let _ = writeln!(
                out,
                "{:<22} {:<13} {:>10} {:>12} {:>10} {:>11} {:>6.1} %{}",
                cache(rung.budget_bytes),
                policy.name(),
                human_count(result.loads),
                human_count(result.loaded_again()),
                human_count(result.evicted),
                human_bytes(result.loaded_bytes),
                100.0 * result.hit_rate(),
                if recorded { "  as recorded" } else { "" },
            );
        }
    }
    out += "\nLoaded again: what the walk had loaded before, in any pass. `bricks_reloaded` in records counts within \
            a pass.\n";
    if !skipped.is_empty() {
        let least = Residency::least_budget(&trace.sizes);
        let sizes: Vec<String> = skipped.iter().map(|&bytes| cache(bytes)).collect();
        let _ = writeln!(
            out,
            "\nSkipped, smaller than the least cache of this scene ({}): {}",
            human_bytes(least),
            sizes.join(", ")
        );
    }
    out
}
