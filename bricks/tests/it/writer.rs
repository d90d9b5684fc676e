//! A scene file appears whole or not at all.

use crate::common::{self, scene, written};
use bricks::{Error, Payload, SceneFile, Writer};
use std::fs;
use std::path::Path;

fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<_> =
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn interrupted_writing_leaves_the_old_file() {
    let (folder, path, _) = written();
    let old = fs::read(&path).unwrap();
    let mut writer = Writer::create(&path).unwrap();
    assert_eq!(writer.path(), path);
    assert_eq!(names(folder.path()).len(), 2, "the temporary file lies beside the old one");
    writer.write(&[7; 1 << 22]).unwrap();
    assert_eq!(fs::read(&path).unwrap(), old);
    drop(writer);
    assert_eq!(names(folder.path()), ["scene.bricks"]);
    assert_eq!(fs::read(&path).unwrap(), old);
    assert_eq!(common::problems(&path), "");
}

#[test]
fn finishing_replaces_the_old_file() {
    let (folder, path, _) = written();
    let old = SceneFile::open(&path).unwrap();
    common::empty().write(&path);
    assert_eq!(names(folder.path()), ["scene.bricks"]);
    assert!(SceneFile::open(&path).unwrap().resident().bricks.is_empty());
    // Whoever has the old file open keeps it.
    let mut out = vec![0; old.span(Payload::Geometry(0)).bytes as usize];
    old.copy(Payload::Geometry(0), &mut out).unwrap();
    assert!(old.verify(&mut |_, _| {}).unwrap().is_ok());
}

#[test]
fn the_same_scene_gives_the_same_bytes() {
    let (_folder, first, _) = written();
    let (_other, second, _) = written();
    assert_eq!(fs::read(first).unwrap(), fs::read(second).unwrap());
}

#[cfg(unix)]
#[test]
fn permissions_and_links_are_those_of_ordinary_files() {
    use std::os::unix::fs::PermissionsExt;
    let (folder, path, _) = written();
    let ordinary = folder.path().join("ordinary");
    fs::write(&ordinary, b"").unwrap();
    let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode();
    assert_eq!(mode(&path), mode(&ordinary));

    let links = tempfile::tempdir().unwrap();
    let link = links.path().join("link.bricks");
    std::os::unix::fs::symlink(&path, &link).unwrap();
    common::empty().write(&link);
    assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
    assert!(SceneFile::open(&path).unwrap().resident().bricks.is_empty(), "the file that the link names was replaced");
}

#[test]
fn places_that_cannot_be_written() {
    let folder = tempfile::tempdir().unwrap();
    for path in [folder.path().join("absent/scene.bricks"), folder.path().to_owned(), "".into(), "..".into()] {
        let error = Writer::create(&path).unwrap_err();
        assert!(matches!(error, Error::Io { .. }), "{error}");
    }
    assert_eq!(names(folder.path()), [""; 0]);
}

#[test]
fn a_name_in_the_present_folder() {
    // Only creation and removal: tests share the present folder.
    drop(Writer::create("name-without-folder.bricks").unwrap());
    assert!(!Path::new("name-without-folder.bricks").exists());
}

#[test]
fn what_could_not_be_read_is_not_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.bricks");
    let refused = |spoil: &dyn Fn(&mut common::Scene, &mut Writer), message: &str| {
        let mut writer = Writer::create(&path).unwrap();
        let mut scene = scene();
        scene.write_payloads(&mut writer);
        spoil(&mut scene, &mut writer);
        let error = writer.finish(&scene.resident).unwrap_err();
        assert!(matches!(error, Error::Invalid { .. }), "{error}");
        assert!(error.to_string().contains(message), "{error}");
        assert_eq!(names(folder.path()), [""; 0], "{message}");
    };
    refused(
        &|_, writer| assert!(writer.write(&[1; 16]).is_ok()),
        "no brick, level, texture, tile, map or field with the payload written at byte",
    );
    refused(&|scene, _| scene.resident.bricks[1].geometry.checksum ^= 1, "a span that the writer returned");
    refused(&|scene, _| scene.resident.bricks[1].geometry.offset += 4096, "a span that the writer returned");
    refused(&|scene, _| scene.resident.textures[0].tail = Default::default(), "texture 0");
    refused(&|scene, _| scene.resident.leaves[0].brick = 9, "record 0 of section leaves");
    refused(&|scene, _| scene.resident.manifest.min[0] = f64::NEG_INFINITY, "section manifest");
    common::scene().write(&path);
    assert_eq!(common::problems(&path), "", "the unspoiled scene is written");
}

#[test]
fn payloads_of_wrong_length() {
    let folder = tempfile::tempdir().unwrap();
    let mut writer = Writer::create(folder.path().join("scene.bricks")).unwrap();
    for length in [0, 1, 15, 17, 4095] {
        let error = writer.write(&vec![0; length]).unwrap_err();
        assert!(error.to_string().contains("multiple of 16"), "{error}");
    }
    let span = writer.write(&[3; 32]).unwrap();
    assert_eq!((span.offset, span.bytes), (4096, 32));
    assert_eq!(writer.write(&[3; 16]).unwrap().offset, 8192);
}

/// A process that ends without tidying up, as one that is killed or loses power does.
#[test]
fn an_aborted_process_leaves_the_old_file() {
    let (folder, path, _) = written();
    let old = fs::read(&path).unwrap();
    let test = std::env::current_exe().unwrap();
    let output = std::process::Command::new(test)
        .args(["--exact", "--ignored", "writer::aborts_while_writing"])
        .env("BRICKS_TEST_PATH", &path)
        .output()
        .unwrap();
    assert!(!output.status.success() && !output.stdout.is_empty());
    assert_eq!(fs::read(&path).unwrap(), old);
    assert_eq!(common::problems(&path), "");
    // What is left is no scene file.
    let left: Vec<_> = names(folder.path()).into_iter().filter(|name| name != "scene.bricks").collect();
    assert!(matches!(&left[..], [name] if name.ends_with(".partial")), "{left:?}");
    assert!(SceneFile::open(folder.path().join(&left[0])).is_err());
}

/// Run by `an_aborted_process_leaves_the_old_file`.
#[test]
#[ignore = "run by an_aborted_process_leaves_the_old_file in a process of its own"]
fn aborts_while_writing() {
    let Some(path) = std::env::var_os("BRICKS_TEST_PATH") else {
        println!("skipped: BRICKS_TEST_PATH is not set");
        return;
    };
    let mut writer = Writer::create(path).unwrap();
    writer.write(&vec![1; 8 << 20]).unwrap();
    std::process::abort();
}

/// A disk that is full: the error says so and no file appears.
#[cfg(target_os = "linux")]
#[test]
fn a_failing_disk() {
    // A process of its own takes a limit of the file size, under which writing fails as on a full disk.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.bricks");
    let test = std::env::current_exe().unwrap();
    let options = "--exact --ignored writer::writes_a_large_payload";
    let script = format!("trap '' XFSZ; ulimit -f 1; exec {} {options}", test.display());
    let output =
        std::process::Command::new("sh").args(["-c", &script]).env("BRICKS_TEST_PATH", &path).output().unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success() && said.contains("1 passed"), "{said}");
    assert_eq!(names(folder.path()), [""; 0]);
}

/// Run by `a_failing_disk` under a limit of the file size.
#[test]
#[ignore = "run by a_failing_disk in a process of its own"]
fn writes_a_large_payload() {
    let Some(path) = std::env::var_os("BRICKS_TEST_PATH") else {
        println!("skipped: BRICKS_TEST_PATH is not set");
        return;
    };
    let mut writer = Writer::create(path).unwrap();
    let error = writer.write(&vec![1; 8 << 20]).unwrap_err();
    assert!(matches!(error, Error::Io { .. }), "{error}");
    assert!(error.to_string().contains("free some space"), "{error}");
}

#[test]
fn a_kept_file_is_continued_after_its_checkpoint() {
    let (folder, whole, scene) = written();
    let path = folder.path().join("again.bricks");
    let partial = folder.path().join(".again.bricks.partial");
    let payloads: Vec<_> = scene.resident.payloads().map(|(payload, span)| (scene.stored(payload), span)).collect();
    let mut writer = Writer::reserve(&path).unwrap().start().unwrap();
    let mut spans = Vec::new();
    let (mut position, half) = (0, payloads.len() / 2);
    let mut sorted = payloads.clone();
    sorted.sort_by_key(|(_, span)| span.offset);
    for (index, (bytes, _)) in sorted.iter().enumerate() {
        if index == half {
            position = writer.checkpoint().unwrap();
        }
        let span = writer.write(bytes).unwrap();
        if index < half {
            spans.push(span);
        }
    }
    assert!(matches!(Writer::reserve(&path), Err(Error::Io { .. })), "one process at a time");
    writer.keep();
    let kept = fs::read(&partial).unwrap();
    assert!(kept.len() as u64 >= position && !path.exists());

    let reserve = || Writer::reserve(&path).unwrap();
    assert!(!reserve().is_empty() || !partial.exists(), "dropping a reserved file removes it");
    fs::write(&partial, &kept).unwrap();
    let mut spoiled = kept.clone();
    spoiled[spans[0].offset as usize + 3] ^= 1;
    fs::write(&partial, &spoiled).unwrap();
    assert!(reserve().resume(position, spans.clone(), &mut |_| {}).is_err());
    assert!(fs::read(&partial).unwrap() == spoiled, "what cannot be continued stays");
    fs::write(&partial, &kept[..position as usize - 1]).unwrap();
    assert!(reserve().resume(position, spans.clone(), &mut |_| {}).is_err());
    fs::write(&partial, &kept).unwrap();
    let mut checked = 0;
    let mut writer = reserve().resume(position, spans, &mut |bytes| checked += bytes).unwrap();
    assert!(checked > 0);
    for (bytes, span) in &sorted[half..] {
        assert_eq!(writer.write(bytes).unwrap(), *span);
    }
    writer.finish(&scene.resident).unwrap();
    assert!(fs::read(&path).unwrap() == fs::read(&whole).unwrap());
    assert!(!partial.exists());
}
