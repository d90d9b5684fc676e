//! Bad input ends with an error that names what is wrong.

use super::decode::decode;
use super::scenes::*;
use super::structure::check;
use brickwalk_convert::build::{BuildError, BuildSettings, LatticeStep};
use brickwalk_convert::source::{IDENTITY, SourceScene};

fn error(scene: &SourceScene, settings: &BuildSettings) -> BuildError {
    match try_build(scene, settings) {
        Ok(_) => panic!("built"),
        Err(error) => error,
    }
}

#[test]
fn vertices_that_are_not_finite_are_named_or_dropped() {
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let mut primitive = sheet(30, 1.0);
        primitive.positions[500][1] = bad;
        let scene = scene(
            vec![mesh("good", vec![sheet(3, 1.0)]), mesh("bad one", vec![sheet(2, 1.0), primitive.clone()])],
            vec![placement("a", 0, IDENTITY), placement("b", 1, IDENTITY)],
        );
        let message = error(&scene, &settings(100)).to_string();
        for part in ["\"bad one\"", "primitive 1", "vertex 500", "--drop-non-finite"] {
            assert!(message.contains(part), "{message}");
        }
        let settings = BuildSettings { drop_non_finite: true, ..settings(100) };
        let built = decode(&built(&scene, &settings).path());
        check(&built);
        let uses = primitive.indices.iter().filter(|&&index| index == 500).count() as u64;
        assert!(uses > 0);
        assert_eq!(built.resident.manifest.dropped_non_finite, uses);
        assert_eq!(built.triangles(0).len() as u64, 18 + 8 + 1800 - uses);
    }
    let mut unused = sheet(3, 1.0);
    unused.positions.push([f64::NAN; 3]);
    unused.uvs.as_mut().unwrap().push([0.0; 2]);
    assert!(try_build(&plain(vec![unused]), &settings(100)).is_ok(), "a vertex of no triangle does not matter");
}

#[test]
fn coordinates_beyond_any_lattice_are_errors() {
    let huge = soup(&[[[0.0, 0.0, 0.0], [3e38, 0.0, 0.0], [0.0, 3e38, 0.0]]]);
    assert!(matches!(error(&plain(vec![huge]), &settings(100)), BuildError::OutOfRange { vertex: 1, .. }));
    let overflow = matrix(rotation(0.3, [1e300; 3]), [0.0; 3]);
    let large = soup(&[[[1e10, 0.0, 0.0], [2e10, 0.0, 0.0], [0.0, 1e10, 0.0]]]);
    let scene = scene(vec![mesh("m", vec![large])], vec![placement("n", 0, overflow)]);
    assert!(matches!(error(&scene, &settings(100)), BuildError::OutOfRange { .. }));
}

#[test]
fn instances_beyond_any_lattice_are_errors() {
    let far = matrix(rotation(0.3, [1.0; 3]), [1e33, 0.0, 0.0]);
    let scene =
        scene(vec![mesh("m", vec![sheet(40, 1.0)])], vec![placement("near", 0, IDENTITY), placement("far", 0, far)]);
    let error = error(&scene, &settings(1000));
    assert!(matches!(error, BuildError::InstanceOutOfRange { .. }) && error.to_string().contains("\"far\""));
}

#[test]
fn scales_from_1e_minus_12_to_1e12_build() {
    for exponent in [-12, -6, 6, 12] {
        let scale = 10f64.powi(exponent);
        let mut primitive = sheet(20, 1.0);
        primitive.positions.iter_mut().flatten().for_each(|x| *x *= scale);
        let scene = decode(&built(&plain(vec![primitive]), &settings(100)).path());
        check(&scene);
        assert_eq!(scene.triangles(0).len(), 800);
        assert!(scene.resident.manifest.warnings.is_empty());
    }
}

#[test]
fn lattices_that_are_too_fine_are_refused() {
    let scene = plain(vec![sheet(10, 1000.0)]);
    let settings = BuildSettings { lattice: Some(LatticeStep::Log2(-40)), ..settings(100) };
    let BuildError::LatticeTooFine { least, .. } = error(&scene, &settings) else { panic!("another error") };
    assert!(try_build(&scene, &BuildSettings { lattice: Some(LatticeStep::Log2(least)), ..settings.clone() }).is_ok());
    assert!(
        try_build(&scene, &BuildSettings { lattice: Some(LatticeStep::Log2(least - 1)), ..settings.clone() }).is_err()
    );
}

#[test]
fn too_many_triangles_are_counted_before_anything_is_built() {
    let placements = (0..70_000).map(|i| placement(&i.to_string(), 0, IDENTITY)).collect();
    let scene = scene(vec![mesh("m", vec![sheet(190, 1.0)])], placements);
    let BuildError::TooManyTriangles { found } = error(&scene, &settings(100)) else { panic!("another error") };
    assert_eq!(found, 70_000 * 2 * 190 * 190);
}

#[test]
fn what_does_not_hold_together_is_refused() {
    let good = plain(vec![sheet(3, 1.0)]);
    assert!(try_build(&good, &settings(100)).is_ok());
    let spoil: [&dyn Fn(&mut SourceScene); 8] = [
        &|scene| scene.meshes[0].primitives[0].indices[5] = 16,
        &|scene| scene.meshes[0].primitives[0].indices.truncate(4),
        &|scene| scene.meshes[0].primitives[0].uvs.as_mut().unwrap().truncate(15),
        &|scene| scene.meshes[0].primitives[0].normals = Some(vec![]),
        &|scene| scene.meshes[0].primitives[0].material = 2,
        &|scene| scene.placements[0].mesh = 1,
        &|scene| scene.placements[0].source = 1,
        &|scene| scene.materials[0].base_color_texture = 0,
    ];
    for (index, spoil) in spoil.iter().enumerate() {
        let mut scene = good.clone();
        spoil(&mut scene);
        assert!(matches!(error(&scene, &settings(100)), BuildError::Inconsistent { .. }), "case {index}");
    }
}

#[test]
fn settings_outside_their_range_are_refused() {
    let scene = plain(vec![sheet(3, 1.0)]);
    let good = settings(100);
    for bad in [
        BuildSettings { brick_triangles: 0, ..good.clone() },
        BuildSettings { brick_triangles: (1 << 20) + 1, ..good.clone() },
        BuildSettings { threads: Some(0), ..good.clone() },
        BuildSettings { lattice: Some(LatticeStep::Log2(-200)), ..good.clone() },
    ] {
        assert!(matches!(error(&scene, &bad), BuildError::Setting { .. }), "{bad:?}");
    }
}

#[test]
fn an_old_file_survives_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.bricks");
    std::fs::write(&path, "old").unwrap();
    let mut primitive = sheet(3, 1.0);
    primitive.positions[0][0] = f64::NAN;
    let progress = brickwalk_convert::progress::Progress::hidden();
    let result = brickwalk_convert::build::build(plain(vec![primitive]), &settings(100), &path, &progress);
    assert!(result.is_err());
    assert_eq!(std::fs::read(&path).unwrap(), b"old");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}
