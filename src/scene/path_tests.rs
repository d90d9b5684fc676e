use crate::scene::path::*;

fn key(time: f64, position: [f64; 3], target: [f64; 3]) -> Keyframe {
    Keyframe { time, position, target }
}

fn path(keyframes: Vec<Keyframe>) -> CameraPath {
    CameraPath::new(60.0, [0.0, 1.0, 0.0], keyframes, Path::new("p.json")).unwrap()
}

fn parse_error(text: &str) -> String {
    CameraPath::parse(text, Path::new("p.json")).unwrap_err().to_string()
}

#[test]
fn one_keyframe_is_a_still() {
    let p = path(vec![key(3.0, [1.0, 2.0, 3.0], [0.0; 3])]);
    for (k, n) in [(0, 1), (0, 5), (2, 5), (4, 5)] {
        assert_eq!(p.frame(k, n).position, DVec3::new(1.0, 2.0, 3.0));
    }
}

#[test]
fn two_keyframes_are_a_line_at_constant_speed() {
    let p = path(vec![key(-1.0, [0.0; 3], [0.0, 0.0, -1.0]), key(3.0, [8.0, 4.0, 0.0], [8.0, 4.0, -1.0])]);
    for k in 0..9 {
        let c = p.frame(k, 9);
        assert!((c.position - DVec3::new(f64::from(k), 0.5 * f64::from(k), 0.0)).length() < 1e-14, "{k}");
    }
    assert_eq!(p.frame(0, 9).position, DVec3::ZERO);
    assert_eq!(p.frame(8, 9).position, DVec3::new(8.0, 4.0, 0.0));
    assert_eq!(p.frame(0, 1).position, DVec3::ZERO);
}

#[test]
fn passes_through_its_keyframes_smoothly() {
    let p = path(vec![
        key(0.0, [0.0, 0.0, 0.0], [9.0; 3]),
        key(0.5, [1.0, 2.0, -1.0], [9.0; 3]),
        key(4.0, [3.0, 1.0, 5.0], [8.0; 3]),
        key(4.25, [2.0, 2.0, 2.0], [9.0; 3]),
    ]);
    for k in p.keyframes() {
        assert!((p.at(k.time).position - DVec3::from(k.position)).length() < 1e-14);
        assert!((p.at(k.time).target - DVec3::from(k.target)).length() < 1e-14);
    }
    // One-sided velocities agree at the inner keyframes: C1.
    for time in [0.5, 4.0] {
        let h = 1e-6;
        let before = (p.at(time).position - p.at(time - h).position) / h;
        let after = (p.at(time + h).position - p.at(time).position) / h;
        assert!((before - after).length() < 1e-4, "{before} {after}");
    }
}

#[test]
fn reproduces_quadratic_motion_between_inner_keyframes_for_uneven_times() {
    let f = |t: f64| [3.0 * t * t - t + 1.0, t, -0.5 * t * t];
    let times = [0.0, 0.7, 1.0, 3.0, 3.5];
    let p = path(times.iter().map(|&t| key(t, f(t), [99.0; 3])).collect());
    for i in 0..=100 {
        let t = 0.7 + (3.0 - 0.7) * f64::from(i) / 100.0;
        assert!((p.at(t).position - DVec3::from(f(t))).length() < 1e-12, "at {t}");
    }
    // Negative control: uniform tangents (neighbours over two unit steps) would miss by far.
    let cubic = |t: f64| [t * t * t, 0.0, 0.0];
    let p = path(times.iter().map(|&t| key(t, cubic(t), [99.0; 3])).collect());
    assert!((p.at(2.0).position - DVec3::from(cubic(2.0))).length() > 1e-2);
}

#[test]
fn frame_times_are_fractions_of_the_range() {
    let p = path(vec![key(10.0, [0.0; 3], [1.0; 3]), key(20.0, [10.0, 0.0, 0.0], [1.0; 3])]);
    for (k, x) in [(0, 0.0), (1, 2.5), (3, 7.5), (4, 10.0), (9, 10.0)] {
        assert!((p.frame(k, 5).position.x - x).abs() < 1e-14);
    }
}

#[test]
fn parses_the_documented_form() {
    let text = r#"{"fov_y_degrees": 45, "up": [0,0,1],
        "keyframes": [{"time": 0.0, "position": [1,2,3], "target": [4,5,6]}]}"#;
    let p = CameraPath::parse(text, Path::new("p.json")).unwrap();
    let c = p.frame(0, 1);
    assert_eq!(c.fov_y, 45f64.to_radians());
    assert_eq!((c.up, c.position, c.target), (DVec3::Z, DVec3::new(1.0, 2.0, 3.0), DVec3::new(4.0, 5.0, 6.0)));
    assert_eq!(CameraPath::parse(&serde_json::to_string_pretty(&p).unwrap(), Path::new("q.json")).unwrap(), p);
}

#[test]
fn errors_name_file_and_keyframe() {
    let k = |time: &str, position: &str| format!(r#"{{"time": {time}, "position": {position}, "target": [9,9,9]}}"#);
    let file = |keys: &[String]| format!(r#"{{"keyframes": [{}]}}"#, keys.join(","));
    let good = k("0", "[0,0,0]");

    assert!(CameraPath::parse(&file(&[good.clone(), k("1", "[1,0,0]")]), Path::new("p.json")).is_ok());
    let e = parse_error(&file(&[good.clone(), k("0", "[1,0,0]")]));
    assert!(e.starts_with("p.json: keyframe 1: its time 0 is not after 0"), "{e}");
    let e = parse_error(&file(&[good.clone(), k("-1", "[1,0,0]")]));
    assert!(e.contains("keyframe 1") && e.contains("sort"), "{e}");
    let e = parse_error(&file(&[good.clone(), k("1", "[9,9,9]")]));
    assert!(e.contains("keyframe 1") && e.contains("same point"), "{e}");
    let e = parse_error(&file(&[good.clone(), k("1", "[1,0]")]));
    assert!(e.contains("keyframe 1"), "{e}");
    let e = parse_error(&file(&[good.clone(), k("1", "[1,0,null]")]));
    assert!(e.contains("keyframe 1"), "{e}");
    let e = parse_error(&file(&[good.clone(), r#"{"time": 1, "position": [1,1,1]}"#.into()]));
    assert!(e.contains("keyframe 1") && e.contains("target"), "{e}");
    let e = parse_error(&file(&[k("1e999", "[0,0,0]")]));
    assert!(e.starts_with("p.json: "), "{e}");
    let e = parse_error(&file(&[]));
    assert!(e.contains("no keyframes"), "{e}");
    assert!(parse_error("").starts_with("p.json: not a camera path"));
    assert!(parse_error("[]").starts_with("p.json: not a camera path"));
    for (fov, bad) in [("0", true), ("180", true), ("-60", true), ("179.99", false), ("1e-6", false)] {
        let text = format!(r#"{{"fov_y_degrees": {fov}, "keyframes": [{good}]}}"#);
        assert_eq!(CameraPath::parse(&text, Path::new("p.json")).is_err(), bad, "{fov}");
    }
    let e = parse_error(&format!(r#"{{"up": [0,0,0], "keyframes": [{good}]}}"#));
    assert!(e.starts_with("p.json: up is a zero vector"), "{e}");
    let nan = key(f64::NAN, [0.0; 3], [1.0; 3]);
    assert!(CameraPath::new(60.0, [0.0, 1.0, 0.0], vec![nan], Path::new("p")).is_err());
    let e = CameraPath::read(Path::new("/nonexistent/p.json")).unwrap_err().to_string();
    assert!(e.starts_with("/nonexistent/p.json: "), "{e}");
}

/// The shipped paths parse and stay inside Sponza's walls.
#[test]
fn shipped_paths_are_inside_sponza() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("paths");
    let mut seen = 0;
    for entry in std::fs::read_dir(&folder).unwrap() {
        let file = entry.unwrap().path();
        let p = CameraPath::read(&file).unwrap();
        for k in 0..50 {
            let x = p.frame(k, 50).position;
            assert!(x.x.abs() < 13.0 && x.y > 0.2 && x.y < 11.0 && x.z > -7.0 && x.z < 6.6, "{file:?}: {x}");
        }
        seen += 1;
    }
    assert!(seen >= 6, "{seen} paths in {folder:?}");
}

#[test]
fn ways_beyond_the_range_of_numbers_are_lines() {
    let at = |k: usize, x: f64| key([0.0, 1.0, 2.0, 1e308][k], [x, k as f64, 0.0], [x, 20.0, 0.0]);
    for far in [3.0, -1e308] {
        let p = path(vec![at(0, 5.0), at(1, -8.0), at(2, 7.0), at(3, far)]);
        for k in p.keyframes() {
            assert_eq!(p.at(k.time).position.to_array(), k.position);
        }
        for time in [0.5, 1.5, 2.5, 1e10, 5e307, 9e307] {
            let camera = p.at(time);
            assert!(camera.position.is_finite() && camera.target.is_finite(), "{time}: {camera:?}");
        }
    }
}
