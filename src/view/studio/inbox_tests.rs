//! The order of wishes, questions and conversions.

use super::inbox::*;
use super::*;
use crate::scene::Camera;
use crate::session::Settings;
use crate::view::studio::Overlay;
use glam::DVec3;
use std::time::Duration;

fn wish(x: f64) -> Wish {
    let camera = Camera { position: DVec3::X * x, target: DVec3::ZERO, up: DVec3::Y, fov_y: 1.0 };
    Wish { camera, settings: Settings::default(), overlay: Overlay::None }
}

#[test]
fn the_latest_wish_counts_and_every_question_does() {
    let inbox = Inbox::default();
    assert!(matches!(inbox.next(Some(Duration::ZERO)), Turn::Nothing) && !inbox.is_newer());
    inbox.wish(wish(1.0));
    inbox.ask(Ask::Compare);
    inbox.wish(wish(2.0));
    inbox.ask(Ask::Save("a.png".into()));
    assert!(inbox.is_newer());
    assert!(matches!(inbox.next(None), Turn::Ask(Ask::Compare)));
    assert!(matches!(inbox.next(None), Turn::Ask(Ask::Save(_))) && inbox.is_newer());
    assert!(matches!(inbox.next(None), Turn::Wish(latest) if latest.camera.position.x == 2.0));
    assert!(!inbox.is_newer() && matches!(inbox.next(Some(Duration::from_millis(1))), Turn::Nothing));
    inbox.quit();
    assert!(matches!(inbox.next(None), Turn::Quit) && inbox.is_newer());
}

#[test]
fn a_conversion_that_was_replaced_is_stopped_and_not_told() {
    let inbox = Inbox::default();
    let [first, second] = [Progress::hidden(), Progress::hidden()];
    inbox.begin_conversion("a.obj".into(), first.clone());
    inbox.begin_conversion("b.obj".into(), second.clone());
    assert!(first.check().is_err() && second.check().is_ok());
    inbox.end_conversion("a.obj".into(), Err("interrupted".into()));
    assert!(matches!(inbox.next(Some(Duration::ZERO)), Turn::Nothing));
    inbox.end_conversion("b.obj".into(), Ok("b.bricks".into()));
    assert!(matches!(inbox.next(None), Turn::Converted(path, Ok(_)) if path.ends_with("b.obj")));
    assert!(inbox.conversion().is_none());
}
