//! Traces: file format, replay against caches, Bélády's rule against exhaustive search.

use super::model::Random;
use crate::stream::{Item, Policy, Replay, ReplayResult, Trace, TraceError, replay};

fn trace_of(bricks: &[u32], sizes: Vec<(u64, u64)>) -> Trace {
    let mut trace = Trace::new(sizes, 1 << 20, 1 << 20, Policy::RoundRobin);
    trace.begin_pass(0, "primary");
    bricks.iter().for_each(|&brick| trace.request(Item::geometry(brick)));
    trace
}

#[test]
fn lines_round_trip() {
    let mut trace = Trace::new(vec![(1024, 512), (2048, 0)], 65536, 4096, Policy::Lru);
    trace.request(Item::geometry(0));
    assert_eq!(trace.requests().count(), 0, "there is no pass yet");
    trace.begin_pass(0, "primary");
    trace.request(Item::geometry(1));
    trace.request(Item::attributes(0));
    trace.begin_pass(1, "sha\"dow");
    let mut bytes = Vec::new();
    trace.write(&mut bytes).unwrap();
    let text = String::from_utf8(bytes.clone()).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(
        lines[0],
        r#"{"format":1,"policy":"lru","budget_bytes":65536,"page_bytes":4096,"sizes":[[1024,512],[2048,0]]}"#
    );
    assert_eq!(lines[1], r#"{"frame":0,"pass":"primary","requests":["g1","a0"]}"#);
    assert_eq!(lines.len(), 3);
    assert_eq!(Trace::read(&bytes[..]).unwrap(), trace);

    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("requests.jsonl");
    trace.write_file(&path).unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), bytes);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "a temporary file was left");
    assert!(trace.write_file(&folder.path().join("none/requests.jsonl")).is_err());
}

#[test]
fn a_wrong_line_is_named() {
    let good = r#"{"format":1,"policy":"lru","budget_bytes":64,"page_bytes":64,"sizes":[[16,16]]}"#;
    let cases = [
        ("".to_owned(), 1),
        ("{}".to_owned(), 1),
        (good.replace("\"format\":1", "\"format\":2"), 1),
        (good.replace("lru", "fifo"), 1),
        (format!("{good}\n{{\"frame\":0,\"pass\":\"a\",\"requests\":[\"g0\"]}}\n{{\"frame\":1"), 3),
        (format!("{good}\n{{\"frame\":0,\"pass\":\"a\",\"requests\":[\"h0\"]}}"), 2),
    ];
    for (text, expected) in cases {
        match Trace::read(text.as_bytes()) {
            Err(TraceError::Line { line, .. }) => assert_eq!(line, expected, "{text}"),
            other => panic!("{text}: {other:?}"),
        }
    }
    assert!(Trace::read(good.as_bytes()).is_ok());
}

#[test]
fn a_cycle_longer_than_the_cache() {
    // Four equal bricks round and round through room for three: round robin and LRU never hit, Bélády does.
    let sizes = vec![(16, 0); 4];
    let cycle: Vec<u32> = (0..400).map(|request| request % 4).collect();
    let trace = trace_of(&cycle, sizes.clone());
    let results = Replay::ALL.map(|against| replay(&trace, &sizes, 48, 48, against).unwrap());
    let [ring, lru, belady] = results;
    let none = ReplayResult { requests: 400, hits: 0, loads: 400, loaded_bytes: 6400, distinct: 4, distinct_bytes: 64 };
    assert_eq!((ring, lru), (none, none));
    // After the first three loads one of three requests misses.
    assert_eq!(belady.loads, 3 + 397_u64.div_ceil(3));
    assert_eq!(belady.hits + belady.loads, 400);
    assert!((belady.hit_rate() - belady.hits as f64 / 400.0).abs() < 1e-12);
    // With room for all, every cache loads each once.
    for against in Replay::ALL {
        assert_eq!(replay(&trace, &sizes, 64, 64, against).unwrap().loads, 4);
    }
}

/// The fewest loads of any cache with room for `room` items of one size: every choice of victim is tried.
fn fewest_loads(requests: &[u32], resident: u32, room: u32) -> u32 {
    let Some((&brick, rest)) = requests.split_first() else { return 0 };
    let bit = 1 << brick;
    if resident & bit != 0 {
        return fewest_loads(rest, resident, room);
    }
    if resident.count_ones() < room {
        return 1 + fewest_loads(rest, resident | bit, room);
    }
    let victims = (0..32).map(|victim| 1u32 << victim).filter(|victim| resident & victim != 0);
    1 + victims.map(|victim| fewest_loads(rest, resident & !victim | bit, room)).min().unwrap_or(0)
}

#[test]
fn belady_is_the_optimum_for_one_size() {
    let sizes = vec![(16, 0); 5];
    let mut worse = 0;
    for seed in 0..200 {
        let mut random = Random(seed);
        let requests: Vec<u32> = (0..12).map(|_| random.below(5) as u32).collect();
        let trace = trace_of(&requests, sizes.clone());
        let best = fewest_loads(&requests, 0, 3) as u64;
        let results = Replay::ALL.map(|against| replay(&trace, &sizes, 48, 48, against).unwrap());
        assert_eq!(results[2].loads, best, "seed {seed}: {requests:?}");
        assert!(results.iter().all(|result| result.loads >= best && result.loads >= result.distinct));
        worse += u32::from(results[0].loads > best) + u32::from(results[1].loads > best);
    }
    // Control: the comparison can fail, as the other policies show.
    assert!(worse > 50, "{worse}");
}

#[test]
fn replay_checks_what_it_is_given() {
    let trace = trace_of(&[0, 1, 2], vec![(16, 0); 3]);
    assert!(matches!(
        replay(&trace, &[(16, 0); 2], 64, 64, Replay::Belady),
        Err(TraceError::NoSuchBrick { item, bricks: 2 }) if item == Item::geometry(2)
    ));
    for against in Replay::ALL {
        assert!(matches!(replay(&trace, &[(16, 0); 3], 16, 64, against), Err(TraceError::Cache(_))));
    }
    // Items without bytes do not count.
    let mut trace = trace_of(&[], vec![(16, 0)]);
    trace.request(Item::attributes(0));
    trace.request(Item::geometry(0));
    for against in Replay::ALL {
        let result = replay(&trace, &[(16, 0)], 16, 16, against).unwrap();
        assert_eq!((result.requests, result.loads, result.distinct_bytes), (1, 1, 16));
    }
    assert_eq!(ReplayResult::default().hit_rate(), 1.0);
}
