//! STL, binary and ASCII.

use super::{Files, Format, Verdict, imported, le32};
use crate::kind::Fault;
use crate::mutate::Harm;
use crate::random::Random;
use std::path::Path;

/// Words of ASCII STL.
const NAMES: &[&str] =
    &["solid", "facet", "normal", "outer", "loop", "vertex", "endloop", "endfacet", "endsolid", "1e38", "-1e-38"];

/// STL.
pub struct Stl;

impl Format for Stl {
    const NAME: &'static str = "inputs/stl";
    const ABOUT: &'static str = "STL, binary and ASCII";

    fn make(&self, random: &mut Random, harm: Harm) -> Files {
        let triangles = random.within(1, 9);
        let corner = |random: &mut Random| [0; 3].map(|_: i32| random.below(64) as f32 / 4.0);
        let mut file;
        if random.chance(50) {
            file = b"solid made here".to_vec();
            file.resize(80, b' ');
            file.extend((triangles as u32).to_le_bytes());
            for _ in 0..triangles {
                file.extend([0; 12]);
                (0..3).for_each(|_| file.extend(le32(&corner(random))));
                file.extend([0; 2]);
            }
        } else {
            let mut text = String::from("solid a\n");
            for _ in 0..triangles {
                text += "facet normal 0 0 1\nouter loop\n";
                for _ in 0..3 {
                    let [x, y, z] = corner(random);
                    text += &format!("vertex {x} {y} {z}\n");
                }
                text += "endloop\nendfacet\n";
            }
            file = (text + "endsolid a\n").into_bytes();
            harm.words(random, &mut file, NAMES, 60);
        }
        harm.bytes(random, &mut file, 50);
        Files::one("a.stl", file)
    }

    fn read(&self, random: &mut Random, files: &Files, folder: &Path) -> Result<Verdict, Fault> {
        imported::read(random, files, folder, imported::TRIANGLES_A_BYTE)
    }
}
