//! The colours of plots, on light and dark pages.
//!
//! Colours are written as plain SVG attributes, which the rules of [`colour_rules`] override where the reader prefers a
//! dark page.

use plotters::style::RGBColor;
use std::fmt::Write as _;

/// A series' colour: on a light and on a dark page.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ink {
    light: [u8; 3],
    dark: [u8; 3],
}

/// Colours that stay apart in both modes and for colour-blind readers; a quantity keeps its ink in all plots.
pub const BLUE: Ink = Ink { light: [0x1f, 0x6f, 0xd0], dark: [0x6c, 0xae, 0xff] };
/// See [`BLUE`].
pub const ORANGE: Ink = Ink { light: [0xe0, 0x70, 0x10], dark: [0xff, 0xa1, 0x4a] };
/// See [`BLUE`].
pub const GREEN: Ink = Ink { light: [0x12, 0x96, 0x72], dark: [0x3f, 0xd0, 0xa4] };
/// See [`BLUE`].
pub const PURPLE: Ink = Ink { light: [0x9a, 0x47, 0xb8], dark: [0xd2, 0x92, 0xee] };
/// See [`BLUE`].
pub const RED: Ink = Ink { light: [0xc8, 0x28, 0x4e], dark: [0xff, 0x7f, 0x9c] };
/// See [`BLUE`]; of totals and limits.
pub const GREY: Ink = Ink { light: [0x56, 0x60, 0x6c], dark: [0xb4, 0xbe, 0xca] };
/// See [`BLUE`]; of what is read against bars.
pub const BLACK: Ink = Ink { light: [0x1a, 0x1f, 0x25], dark: [0xff, 0xff, 0xff] };
/// The inks in the order in which passes take them.
pub const INKS: [Ink; 6] = [BLUE, ORANGE, GREEN, PURPLE, RED, GREY];

/// Ink of the axes.
pub(crate) const AXIS: Ink = Ink { light: [0x8a, 0x93, 0x9e], dark: [0x6f, 0x79, 0x85] };
/// Ink of the grid.
pub(crate) const GRID: Ink = Ink { light: [0xe2, 0xe6, 0xea], dark: [0x2d, 0x34, 0x3c] };
/// Ink of the axes' labels.
pub(crate) const LABEL: Ink = Ink { light: [0x4a, 0x53, 0x5e], dark: [0xb0, 0xba, 0xc6] };

/// [`LABEL`] as it is written.
pub const LABEL_HEX: &str = "#4A535E";

impl Ink {
    /// The colour on a light page.
    pub fn rgb(self) -> RGBColor {
        RGBColor(self.light[0], self.light[1], self.light[2])
    }

    /// The colour as the drawing library writes it.
    pub fn light_hex(self) -> String {
        let [r, g, b] = self.light;
        format!("#{r:02X}{g:02X}{b:02X}")
    }

    fn dark_hex(self) -> String {
        let [r, g, b] = self.dark;
        format!("#{r:02X}{g:02X}{b:02X}")
    }
}

/// Style rules, for use under a query for dark pages, that replace every light ink of a plot by its dark one.
pub fn colour_rules() -> String {
    let mut rules = String::new();
    for ink in INKS.into_iter().chain([BLACK, AXIS, GRID, LABEL]) {
        let (light, dark) = (ink.light_hex(), ink.dark_hex());
        // Writing to a string cannot fail.
        let _ = write!(rules, ".plot [stroke=\"{light}\"]{{stroke:{dark}}}.plot [fill=\"{light}\"]{{fill:{dark}}}");
    }
    rules
}
