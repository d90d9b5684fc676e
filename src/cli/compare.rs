//! `compare`: how far an image is from a reference.

use super::options::args::CompareArgs;
use crate::cli::output::{print, print_json};
use crate::metrics::{Comparison, FlipKind, compare, load};
use crate::settings::sizes::counted;
use anyhow::Result;
use serde::Serialize;
use std::fmt::Write;

/// Raised when a field of the JSON changes its meaning.
const FORMAT: u32 = 1;

/// What `compare --json` prints.
#[derive(Serialize)]
struct Document<'a> {
    format: u32,
    #[serde(flatten)]
    comparison: &'a Comparison,
}

/// Runs `compare`.
///
/// # Errors
/// A file cannot be read as an image, the sizes differ, or no pixel is finite in both.
pub fn run(args: &CompareArgs) -> Result<()> {
    let comparison = compare(&load(&args.image)?, &load(&args.reference)?)?;
    if args.json {
        print_json(&Document { format: FORMAT, comparison: &comparison })
    } else {
        print(&human(&comparison))
    }
}

fn human(c: &Comparison) -> String {
    let p = &c.pixels;
    let mut text = format!("{}\nagainst {}, {}x{} pixels\n", c.a.display(), c.b.display(), c.width, c.height);
    let mut row = |name: &str, value: String| {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "  {name:<14} {value}");
    };
    let rgb = |v: [f64; 3]| format!("red {:.6}, green {:.6}, blue {:.6}", v[0], v[1], v[2]);
    row("RMSE", format!("{:.6}", p.rmse));
    row("relMSE", format!("{:.6}", p.rel_mse));
    row("bias", format!("{:+.6} ({})", p.bias, rgb(p.bias_rgb)));
    row("max error", format!("{:.6}", p.max_error));
    let kind = match c.flip_kind {
        FlipKind::Ldr => "FLIP",
        FlipKind::Hdr => "HDR-FLIP",
    };
    row(kind, format!("{:.6}, max {:.6}, at {:.0} pixels per degree", c.flip, c.flip_max, c.pixels_per_degree));
    if p.non_finite_pixels > 0 {
        row("skipped", format!("{} non-finite", counted(p.non_finite_pixels, "pixel")));
    }
    if let Some(ids) = c.ids_differing {
        row("triangle ids", format!("differ in {}", counted(ids, "pixel")));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::Channel;
    use crate::output::{exr, png};

    #[test]
    fn images_that_walks_write_are_compared() {
        let folder = tempfile::tempdir().unwrap();
        let (a, b) = (folder.path().join("a.exr"), folder.path().join("b.exr"));
        let radiance: Vec<[f32; 3]> = (0..48).map(|i| [i as f32 * 0.05, 0.5, 1.0]).collect();
        let (depth, normal, albedo) = (vec![1.0; 48], vec![[0.0, 1.0, 0.0]; 48], vec![[0.5; 3]; 48]);
        let ids: Vec<u32> = (0..48).map(|i| u32::MAX - i).collect();
        let aovs = exr::Aovs {
            width: 8,
            height: 6,
            radiance: &radiance,
            depth: &depth,
            normal: &normal,
            triangle: &ids,
            albedo: &albedo,
            state: None,
        };
        exr::write(&a, &aovs).unwrap();
        let mut other = ids.clone();
        other[7] = 5;
        exr::write(&b, &exr::Aovs { triangle: &other, ..aovs }).unwrap();

        let loaded = load(&a).unwrap();
        assert_eq!(loaded.image.rgb, radiance);
        assert_eq!(loaded.channels["triangle.id"], Channel::Integer(ids));
        let comparison = compare(&loaded, &load(&b).unwrap()).unwrap();
        assert_eq!((comparison.pixels.rmse, comparison.ids_differing), (0.0, Some(1)));
        let text = human(&comparison);
        assert!(text.contains("HDR-FLIP") && text.contains("differ in 1 pixel") && text.contains("8x6"), "{text}");
        let json = serde_json::to_value(Document { format: FORMAT, comparison: &comparison }).unwrap();
        assert_eq!((json["format"].as_u64(), json["ids_differing"].as_u64()), (Some(1), Some(1)));

        let (c, d) = (folder.path().join("c.png"), folder.path().join("d.png"));
        png::write(&c, 8, 6, &[[10, 20, 30]; 48]).unwrap();
        png::write(&d, 8, 6, &[[10, 20, 230]; 48]).unwrap();
        let text = human(&compare(&load(&c).unwrap(), &load(&d).unwrap()).unwrap());
        assert!(text.contains("  FLIP") && !text.contains("triangle ids"), "{text}");
    }
}
