//! What the window remembers from one time to the next: scenes that were opened, and views of them that were kept. It
//! lies in the platform's folder for settings, as JSON.

use crate::output::atomic;
use crate::remote;
use crate::scene::Camera;
use crate::settings::folder;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Most scenes that are remembered.
const MOST: usize = 12;

/// A view that was kept.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct View {
    /// Of which scene.
    pub scene: PathBuf,
    /// Its name.
    pub name: String,
    position: [f64; 3],
    target: [f64; 3],
    up: [f64; 3],
    fov_y: f64,
}

impl View {
    /// The camera.
    pub fn camera(&self) -> Camera {
        let &Self { position, target, up, fov_y, .. } = self;
        Camera { position: position.into(), target: target.into(), up: up.into(), fov_y }
    }
}

/// What is remembered.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Recent {
    /// Scenes and models, the latest first.
    #[serde(default)]
    pub scenes: Vec<PathBuf>,
    /// Views, in the order that they were kept in.
    #[serde(default)]
    pub views: Vec<View>,
    #[serde(skip)]
    file: Option<PathBuf>,
}

impl Recent {
    /// What was remembered; nothing where that cannot be read.
    pub fn load() -> Self {
        folder::settings().map_or_else(Self::default, |folder| Self::load_from(&folder.join("window.json")))
    }

    fn load_from(file: &Path) -> Self {
        let read = std::fs::read(file).ok().and_then(|bytes| serde_json::from_slice::<Self>(&bytes).ok());
        let mut own = read.unwrap_or_default();
        own.views.retain(|view| view.camera().check().is_ok());
        own.file = Some(file.into());
        own
    }

    /// Writes it down; whatever is in the way of that is no reason to stop.
    fn store(&self) {
        let Some(file) = &self.file else { return };
        let Ok(text) = serde_json::to_string_pretty(self) else { return };
        if let Some(folder) = file.parent() {
            let _ = std::fs::create_dir_all(folder);
        }
        let _ = atomic::write(file, (text + "\n").as_bytes());
    }

    /// Whether this is not the scene that was opened last.
    pub fn is_new(&self, scene: &Path) -> bool {
        self.scenes.first().is_none_or(|first| *first != absolute(scene))
    }

    /// A scene was opened.
    pub fn opened(&mut self, scene: &Path) {
        let scene = absolute(scene);
        self.scenes.retain(|own| *own != scene);
        self.scenes.insert(0, scene);
        self.scenes.truncate(MOST);
        self.store();
    }

    /// Keeps a view of a scene.
    pub fn keep(&mut self, scene: &Path, camera: &Camera) {
        if camera.check().is_err() {
            return;
        }
        let scene = absolute(scene);
        let count = self.views.iter().filter(|view| view.scene == scene).count();
        let &Camera { position, target, up, fov_y } = camera;
        let [position, target, up] = [position, target, up].map(|v| v.to_array());
        self.views.push(View { scene, name: format!("view {}", count + 1), position, target, up, fov_y });
        self.store();
    }

    /// Forgets a view.
    pub fn forget(&mut self, index: usize) {
        if index < self.views.len() {
            self.views.remove(index);
            self.store();
        }
    }

    /// The views of a scene, with their numbers.
    pub fn views_of(&self, scene: &Path) -> Vec<(usize, View)> {
        let scene = absolute(scene);
        self.views.iter().cloned().enumerate().filter(|(_, view)| view.scene == scene).collect()
    }
}

fn absolute(path: &Path) -> PathBuf {
    if remote::is_url(path) { path.into() } else { std::path::absolute(path).unwrap_or_else(|_| path.into()) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn what_was_opened_and_kept_is_there_again() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("brickwalk/window.json");
        let mut recent = Recent::load_from(&file);
        assert_eq!(recent.scenes.len(), 0);
        let camera = Camera { position: DVec3::X, target: DVec3::ZERO, up: DVec3::Y, fov_y: 1.0 };
        for k in 0..20 {
            recent.opened(Path::new(&format!("/s/{}.bricks", k % 15)));
        }
        recent.keep(Path::new("/s/4.bricks"), &camera);
        recent.keep(Path::new("/s/4.bricks"), &Camera { position: DVec3::NAN, ..camera });
        // What is no camera does not come from here, but whoever writes into the file may put it there.
        let text = std::fs::read_to_string(&file).unwrap();
        let mut planted: serde_json::Value = serde_json::from_str(&text).unwrap();
        let mut view = planted["views"][0].clone();
        view["target"] = view["position"].clone();
        planted["views"].as_array_mut().unwrap().push(view);
        std::fs::write(&file, planted.to_string()).unwrap();
        let again = Recent::load_from(&file);
        assert_eq!((again.scenes.len(), again.scenes[0].to_str()), (MOST, Some("/s/4.bricks")));
        assert!(!again.is_new(Path::new("/s/4.bricks")) && again.is_new(Path::new("/s/3.bricks")));
        // A file that is none is no reason to fail.
        let views = again.views_of(Path::new("/s/4.bricks"));
        assert_eq!((views.len(), views[0].1.camera()), (1, camera));
        std::fs::write(&file, "[1,").unwrap();
        assert_eq!(Recent::load_from(&file).scenes.len(), 0);
    }
}
