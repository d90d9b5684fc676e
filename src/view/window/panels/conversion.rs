//! How far a conversion is.

use crate::view::studio::Converting;
use egui::{ProgressBar, Ui};

/// A bar, or where nobody knows how much there is, the count.
pub fn show(converting: &Converting, ui: &mut Ui) {
    let (phase, done, all) = &converting.so_far;
    let name = converting.path.file_name().unwrap_or_default().to_string_lossy();
    ui.label(format!("{name}: {phase}"));
    match all {
        0 => drop(ui.label(done.to_string())),
        all => drop(ui.add(ProgressBar::new(*done as f32 / *all as f32).desired_width(120.0).show_percentage())),
    }
    ui.separator();
}
