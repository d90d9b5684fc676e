//! The nodes of the scene: found by name, gone to, hidden, shown alone.

use crate::session::Named;
use crate::settings::sizes::human_count;
use crate::view::viewer::{NodeAct, Viewer};
use crate::view::window::desk::Desk;
use egui::{Key, Label, ScrollArea, TextEdit, Ui};

/// Height of the list, points.
const HEIGHT: f32 = 160.0;

/// All of it.
pub fn show(desk: &mut Desk, ui: &mut Ui) {
    ui.horizontal(|ui| {
        let field = TextEdit::singleline(&mut desk.state.node).hint_text("part of a name").desired_width(150.0);
        let entered = ui.add(field).lost_focus() && ui.input(|input| input.key_pressed(Key::Enter));
        if ui.button("Find").clicked() || entered {
            desk.viewer.find(&desk.state.node);
        }
    });
    if let Some((nodes, count)) = desk.viewer.nodes.clone() {
        ScrollArea::vertical().id_salt("nodes").max_height(HEIGHT).show(ui, |ui| {
            nodes.iter().for_each(|node| row(&mut desk.viewer, node, ui));
        });
        match count - nodes.len() {
            0 => ui.weak(format!("{} found", human_count(count as u64))),
            more => ui.weak(format!("and {} more", human_count(more as u64))),
        };
    }
    if desk.viewer.is_locating {
        ui.weak("bricks are read to find where it is");
    }
    if let Some((node, [min, max])) = &desk.viewer.located {
        let [x, y, z] = (*max - *min).to_array();
        ui.add(Label::new(format!("{}: {x:.4} by {y:.4} by {z:.4}", node.name)).wrap());
    }
    left_out(&mut desk.viewer, ui);
}

/// A node, and what is done with it.
fn row(viewer: &mut Viewer, node: &Named, ui: &mut Ui) {
    let about = format!("mesh {}, {} triangles, {}", node.mesh, human_count(node.ids.len() as u64), node.pattern);
    let name = if node.name.is_empty() { &node.pattern } else { &node.name };
    let mut act = None;
    ui.horizontal(|ui| {
        act = ui.button(name).on_hover_text(about).clicked().then_some(NodeAct::Go);
        for (label, other) in [("hide", NodeAct::Hide), ("only", NodeAct::Only)] {
            if ui.small_button(label).clicked() {
                act = Some(other);
            }
        }
    });
    if let Some(act) = act {
        viewer.act(act, node);
    }
}

/// What is left out now.
fn left_out(viewer: &mut Viewer, ui: &mut Ui) {
    if !viewer.settings.hides() {
        return;
    }
    for (what, patterns) in [("hidden", &viewer.settings.hide), ("shown alone", &viewer.settings.only)] {
        if !patterns.is_empty() {
            ui.add(Label::new(format!("{what}: {}", patterns.join(", "))).wrap());
        }
    }
    if ui.button("Show everything").on_hover_text("U").clicked() {
        viewer.show_all();
    }
}

/// What is done with the node that was clicked on.
pub fn acts(viewer: &mut Viewer, node: &Named, ui: &mut Ui) {
    ui.horizontal(|ui| {
        for (label, hint, act) in [
            ("Go to node", "reads bricks to find where it is", NodeAct::Go),
            ("Hide node", "H", NodeAct::Hide),
            ("Only node", "I", NodeAct::Only),
        ] {
            if ui.button(label).on_hover_text(hint).clicked() {
                viewer.act(act, node);
            }
        }
    });
}
