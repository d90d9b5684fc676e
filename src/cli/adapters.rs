//! `brickwalk adapters`: the devices that there are, and which of them `--adapter auto` takes.

use super::options::args::AdaptersArgs;
use crate::cli::output::{print, print_json};
use crate::cpu;
use crate::gpu::device::{Candidate, candidates_by_name};
use crate::kernels::DeviceInfo;
use crate::session::device::{Choice, automatic};
use anyhow::Result;
use serde_json::{Value, json};
use std::fmt::Write;

/// Raised when a field changes its meaning.
const FORMAT: u32 = 1;

/// Runs the command.
///
/// # Errors
/// Standard output is closed.
pub fn run(args: &AdaptersArgs) -> Result<()> {
    let candidates = candidates_by_name();
    let choice = automatic(&candidates);
    if args.json {
        return print_json(&as_json(&candidates, choice));
    }
    print(&as_text(&candidates, choice))
}

fn as_json(candidates: &[Candidate], choice: Choice) -> Value {
    let graphics = |(number, c): (usize, &Candidate)| {
        json!({
            "name": c.info.name,
            "kind": c.kind(),
            "driver": c.info.driver,
            "driver_info": c.info.driver_info,
            "backend": c.info.backend.to_string(),
            "page_bytes": c.page_bytes(),
            "buffers_a_kernel": c.limits.max_storage_buffers_per_shader_stage,
            "lacks": c.flaw,
            "chosen": choice.candidate == Some(number),
        })
    };
    let mut adapters: Vec<Value> = candidates.iter().enumerate().map(graphics).collect();
    let DeviceInfo { name, driver, driver_info, backend, .. } = cpu::device_info();
    adapters.push(json!({
        "name": name,
        "kind": "processor",
        "driver": driver,
        "driver_info": driver_info,
        "backend": backend,
        "chosen": choice.candidate.is_none(),
    }));
    json!({ "format": FORMAT, "adapters": adapters, "why": choice.why })
}

fn as_text(candidates: &[Candidate], choice: Choice) -> String {
    let mut text = String::new();
    let mark = |chosen: bool| if chosen { '*' } else { ' ' };
    for (number, c) in candidates.iter().enumerate() {
        let info = &c.info;
        let _ = writeln!(
            text,
            "{} {:?}: {}, {} {} ({}), cache pages of at most {} MiB, {} storage buffers a kernel",
            mark(choice.candidate == Some(number)),
            info.name,
            c.kind(),
            info.driver,
            info.driver_info,
            info.backend,
            c.page_bytes() >> 20,
            c.limits.max_storage_buffers_per_shader_stage
        );
        if let Some(flaw) = &c.flaw {
            let _ = writeln!(text, "    cannot be used: {flaw}");
        }
    }
    let cpu = cpu::device_info();
    let _ = writeln!(text, "{} {:?}: the processor, {}", mark(choice.candidate.is_none()), cpu.name, cpu.driver_info);
    let _ = writeln!(text, "* is what --adapter auto takes: {}", choice.why);
    text
}
