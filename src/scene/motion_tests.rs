//! Files, interpolation and matrices of motions.

use crate::scene::motion::*;

fn parse(text: &str) -> Result<Motion, KeyframesError> {
    Motion::parse(text, Path::new("m.json"))
}

fn mover(keyframes: &str) -> Mover {
    let text = format!(r#"{{"instances": [{{"node": "a", "keyframes": [{keyframes}]}}]}}"#);
    parse(&text).unwrap().movers.remove(0)
}

#[test]
fn errors_name_the_file_the_thing_and_the_remedy() {
    let with = |mover: &str| format!(r#"{{"instances": [{mover}]}}"#);
    let keyed = |keys: &str| with(&format!(r#"{{"node": "a", "keyframes": [{keys}]}}"#));
    for (text, says) in [
        ("{".to_owned(), vec!["not a motion"]),
        (r#"{"instance": []}"#.to_owned(), vec!["unknown field `instance`"]),
        (with(r#"{"keyframes": []}"#), vec!["entry 0", "node (a name) or instance"]),
        (with(r#"{"node": "a", "instance": 1, "keyframes": []}"#), vec!["entry 0", "one of them"]),
        (with(r#"{"node": "a", "keyframes": []}"#), vec!["node \"a\"", "no keyframes"]),
        (with(r#"{"node": "a", "pivots": [0,0,0], "keyframes": []}"#), vec!["entry 0", "pivots"]),
        (keyed(r#"{"translation": [0,0,0]}"#), vec!["node \"a\"", "keyframe 0", "time"]),
        (keyed(r#"{"time": 0, "rotation": [0,0,0,0]}"#), vec!["keyframe 0", "quaternion"]),
        (keyed(r#"{"time": 0, "scale": 0}"#), vec!["keyframe 0", "scale 0"]),
        (keyed(r#"{"time": 0, "translate": [0,0,0]}"#), vec!["keyframe 0", "translate"]),
        (keyed(r#"{"time": 1}, {"time": 1}"#), vec!["keyframe 1", "sort"]),
        (keyed(r#"{"time": -1e308}, {"time": 1e308}"#), vec!["node \"a\"", "too far apart"]),
    ] {
        let error = parse(&text).unwrap_err().to_string();
        assert!(error.starts_with("m.json: ") && !error.contains('\n'), "{error}");
        assert!(says.iter().all(|part| error.contains(part)), "{text}: {error}");
    }
}

#[test]
fn keyframes_are_met_and_ways_between_them_are_those_of_camera_paths() {
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let mover = mover(&format!(
        r#"{{"time": 1, "translation": [0,0,0]}},
           {{"time": 2, "translation": [1,0,0], "rotation": [0,{half},0,{half}]}},
           {{"time": 4, "translation": [1,2,0], "rotation": [0,1,0,0], "scale": 4}}"#
    ));
    for (time, translation, scale) in
        [(0.0, [0.0, 0.0, 0.0], 1.0), (1.0, [0.0; 3], 1.0), (2.0, [1.0, 0.0, 0.0], 1.0), (9.0, [1.0, 2.0, 0.0], 4.0)]
    {
        let pose = mover.at(time);
        assert_eq!((pose.translation, pose.scale), (translation.into(), scale), "{time}");
    }
    let path = crate::scene::CameraPath::parse(
        r#"{"keyframes": [{"time": 1, "position": [0,0,0], "target": [0,0,9]},
            {"time": 2, "position": [1,0,0], "target": [1,0,9]},
            {"time": 4, "position": [1,2,0], "target": [1,2,9]}]}"#,
        Path::new("p.json"),
    )
    .unwrap();
    for time in [1.25, 1.9, 2.5, 3.999] {
        assert_eq!(mover.at(time).translation, path.at(time).position, "{time}");
    }
    // An eighth of a turn on the way to a quarter; then the way from a quarter to a half.
    let angle = |time: f64| mover.at(time).rotation.to_axis_angle().1.to_degrees();
    assert!((angle(1.5) - 45.0).abs() < 1e-9 && (angle(3.0) - 135.0).abs() < 1e-9, "{} {}", angle(1.5), angle(3.0));
    assert!((mover.at(3.0).scale - 2.0).abs() < 1e-12);
}

#[test]
fn no_motion_leaves_matrices_as_they_are_and_turns_are_about_the_pivot() {
    let matrix = [0.1, 0.7, -0.3, 1e5 / 3.0, 0.2, 0.9, 0.4, -7.7, 0.3, -0.5, 0.6, 1.0 / 7.0];
    let pivot = DVec3::new(1.0 / 3.0, 2.2, -5.7);
    let rest = mover(r#"{"time": 0}, {"time": 1}"#);
    for time in [-1.0, 0.0, 0.3, 1.0, 2.0] {
        assert_eq!(rest.at(time).place(&matrix, pivot), matrix, "{time}");
    }
    let turned = mover(r#"{"time": 0, "rotation": [0,0,1,0], "scale": 2, "translation": [1,0,0]}"#).at(0.0);
    let placed = turned.place(&Instance::IDENTITY, pivot);
    let image = |p: DVec3| {
        DVec3::from_array(
            [0, 1, 2]
                .map(|k| placed[4 * k] * p.x + placed[4 * k + 1] * p.y + placed[4 * k + 2] * p.z + placed[4 * k + 3]),
        )
    };
    assert!((image(pivot) - pivot - DVec3::X).length() < 1e-12);
    assert!((image(pivot + DVec3::X) - pivot - DVec3::X - DVec3::new(-2.0, 0.0, 0.0)).length() < 1e-12);
}

#[test]
fn a_name_of_two_lines_is_refused_in_one() {
    for (keyframe, of) in [(r#"{"tr\nslation": [1,0,0]}"#, "`tr slation`"), (r#"{"time": "1\r\n2"}"#, "\"1")] {
        let text = format!(r#"{{"instances": [{{"node": "do\nor", "keyframes": [{keyframe}]}}]}}"#);
        let error = parse(&text).err().map(|error| error.to_string()).unwrap_or_default();
        assert!(error.contains(of) && !error.contains(char::is_control), "{error:?}");
    }
}

#[test]
fn poses_beyond_the_range_of_numbers_lie_on_lines() {
    let keys = r#"{"time": -1e308, "translation": [2, 8, -3]}, {"time": 1, "translation": [2, -1, 2.5]},
        {"time": 2, "translation": [7, 1e308, 0]}, {"time": 3, "translation": [7, -1e308, 0]}"#;
    let mover = mover(keys);
    for time in [-1e308, -5e307, -0.5, 0.0, 1.0, 1.5, 2.0, 2.5, 3.0] {
        let pose = mover.at(time);
        assert!(pose.translation.is_finite(), "{time}: {pose:?}");
    }
    assert_eq!(mover.at(1.0).translation, DVec3::new(2.0, -1.0, 2.5));
}
