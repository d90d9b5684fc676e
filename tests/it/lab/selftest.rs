//! The selftest passes with few rays, prints what scripts read, and fails with every planted defect.

use crate::common::{self, skip};
use brickwalk::gpu::device::candidates;
use brickwalk::lab::selftest::args::SelftestArgs;
use brickwalk::lab::selftest::case::Status;
use brickwalk::lab::selftest::defects::Defect;
use brickwalk::lab::selftest::{Report, test};
use brickwalk::session::device::Device;
use brickwalk::settings::Group;

fn args(options: &str) -> SelftestArgs {
    let adapter = common::settings("").adapter;
    let mut args = SelftestArgs { rays: 30_000, adapter, ..SelftestArgs::default() };
    args.set_options(options).expect("options");
    args
}

fn failed(report: &Report) -> Vec<u32> {
    report.rows.iter().filter(|row| row.status == Status::Fail).map(|row| row.case).collect()
}

/// The case that a defect must fail.
fn case_of(defect: Defect) -> u32 {
    match defect {
        Defect::WorldF32 | Defect::MollerTrumbore | Defect::NoBarriers => 20,
        Defect::AbsoluteEpsilon => 3,
        Defect::RelativePadding => 19,
        Defect::RawT => 23,
        Defect::NonStrictPrune => 25,
        Defect::SwappedTie => 10,
        Defect::NanSlab => 15,
        Defect::EarlyEviction | Defect::LostQuery => 2,
        Defect::TileRemainder => 30,
        Defect::NoInset => 21,
    }
}

#[test]
fn every_case_passes_on_the_processor() {
    let report = test(&args("--adapter cpu")).expect("the processor");
    assert!(failed(&report).is_empty(), "{:#?}", report.rows);
}

#[test]
fn every_planted_defect_is_noticed() {
    let Some(adapter) = candidates().into_iter().find(|candidate| candidate.flaw.is_none()) else {
        skip("no graphics adapter");
        return;
    };
    let name = adapter.info.name.split_whitespace().next().unwrap_or_default().to_string();
    let cases: std::collections::BTreeSet<u32> = Defect::ALL.iter().copied().map(case_of).collect();
    let numbers = cases.iter().map(u32::to_string).collect::<Vec<_>>().join(",");
    let sound = test(&args(&format!("--adapter {name} --case {numbers}"))).expect("a device");
    assert!(failed(&sound).is_empty(), "without a defect: {:#?}", sound.rows);
    for &defect in Defect::ALL {
        let case = case_of(defect);
        let words = format!("--adapter {name} --case {case} --rays 10K --plant {}", defect.name());
        let report = test(&args(&words)).expect("a device");
        println!("{}: case {case}, {:.1} s", defect.name(), report.seconds);
        assert_eq!(failed(&report), [case], "{} goes unnoticed: {:#?}", defect.name(), report.rows);
        let replay = report.rows[0].replay.as_ref().expect("how to repeat it");
        assert!(replay.contains(&format!("--case {case} --seed 1")), "{replay}");
    }
}

#[test]
fn defects_of_streaming_are_noticed_on_the_processor() {
    for &defect in Defect::ALL.iter().filter(|defect| !defect.is_of_kernels()) {
        let words = format!("--adapter cpu --case {} --plant {}", case_of(defect), defect.name());
        let report = test(&args(&words)).expect("the processor");
        assert_eq!(failed(&report), [case_of(defect)], "{}", defect.name());
    }
    assert!(matches!(Device::open(&"cpu".parse().expect("a name")), Ok(Device::Cpu)));
    let refused = test(&args("--adapter cpu --plant raw-t")).expect_err("it has no kernels to be changed");
    assert!(refused.to_string().contains("--adapter"), "{refused}");
}

#[test]
fn scripts_can_read_it() {
    let words = "selftest --adapter cpu --rays 10K --json --case 6,7,9,37,46,58";
    let report: serde_json::Value = serde_json::from_str(&common::succeed(words.split(' '))).expect("JSON");
    assert_eq!((&report["format"], &report["passed"], &report["failed"]), (&1.into(), &6.into(), &0.into()));
    assert_eq!(report["rows"][0]["checks"][0]["bound"], "3");
    assert!(report["traits"]["flushes_denormals"].is_boolean());
    let text = common::succeed("selftest --adapter cpu --rays 10K --case 6".split(' '));
    assert!(text.contains("  6  pass           zero area") && text.contains("1 passed, 0 failed"), "{text}");
    for words in ["selftest --case 61", "selftest --plant luck", "selftest --rays 5"] {
        assert_eq!(common::brickwalk(words.split(' ')).status.code(), Some(2), "{words}");
    }
    // A failure is told by the exit status and the command that repeats it.
    let output = common::brickwalk("selftest --adapter cpu --rays 10K --case 2 --plant lost-query".split(' '));
    assert_eq!(output.status.code(), Some(1));
    let text = String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
    assert!(text.contains("again: brickwalk selftest --case 2 --seed 1"), "{text}");
}
