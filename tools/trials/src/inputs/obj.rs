//! OBJ with its materials and their images.

use super::{Files, Format, Verdict, harmed_image, imported};
use crate::kind::Fault;
use crate::mutate::Harm;
use crate::random::Random;
use std::fmt::Write;
use std::path::Path;

/// Words of OBJ and MTL.
const NAMES: &[&str] = &[
    "v", "vt", "vn", "f", "o", "g", "usemtl", "mtllib", "l", "p", "curv", "s", "newmtl", "Kd", "Ks", "Ke", "Ns", "Ni",
    "d", "Tr", "map_Kd", "map_d", "map_Bump", "norm", "Pr", "Pm", "illum", "-clamp", "-bm", "-s", "-mm", "1/1/1",
    "1//1", "-1/-1", "a.mtl", "b.png", "\\", "#",
];

/// OBJ.
pub struct Obj;

impl Format for Obj {
    const NAME: &'static str = "inputs/obj";
    const ABOUT: &'static str = "OBJ and MTL, word by word and byte by byte, with images";

    fn make(&self, random: &mut Random, harm: Harm) -> Files {
        let mut text = String::from("mtllib a.mtl\no one\n");
        let vertices = random.within(3, 12);
        let has_colors = random.chance(30);
        for _ in 0..vertices {
            let mut number = || random.below(2001) as f64 / 100.0 - 10.0;
            let _ =
                writeln!(text, "v {} {} {}{}", number(), number(), number(), if has_colors { " 1 0 0.5" } else { "" });
            let _ = writeln!(text, "vt {} {}\nvn 0 0 1", number(), number());
        }
        for _ in 0..random.within(1, 8) {
            let corners = random.within(3, 6);
            let form = random.below(4);
            text.push('f');
            for _ in 0..corners {
                let at = random.within(1, vertices);
                let _ = match form {
                    0 => write!(text, " {at}"),
                    1 => write!(text, " {at}/{at}/{at}"),
                    2 => write!(text, " {at}//{at}"),
                    _ => write!(text, " -{at}/-{at}"),
                };
            }
            text.push('\n');
            if random.chance(30) {
                text += random.pick(["usemtl red\n", "g two\n", "usemtl glass\n", "l 1 2\n", "s off\n"]);
            }
        }
        let mut materials = b"newmtl red\nKd 1 0 0\nPr 0.25\nPm 0.5\nNs 10\nmap_Kd -clamp on b.png\nnewmtl glass\n\
            Kd 0.5\nd 0.25\nKe 1 2 3\nmap_Bump -bm 0.5 b.png\nmap_d b.png\n"
            .to_vec();
        if random.chance(30) {
            materials.extend(random.pick([
                b"map_Pr b.png\nmap_Pm b.png\n".as_slice(),
                b"map_Pm -clamp on b.png\n",
                b"map_Ke b.png\nnorm b.png\n",
                b"map_Pr c.png\nmap_Ks b.png\n",
            ]));
        }
        let mut text = text.into_bytes();
        harm.words(random, &mut text, NAMES, 70);
        harm.bytes(random, &mut text, 30);
        harm.words(random, &mut materials, NAMES, 30);
        harm.bytes(random, &mut materials, 10);
        let image = harmed_image(random, harm, 20);
        Files(vec![("a.obj".into(), text), ("a.mtl".into(), materials), ("b.png".into(), image)])
    }

    fn read(&self, random: &mut Random, files: &Files, folder: &Path) -> Result<Verdict, Fault> {
        imported::read(random, files, folder, imported::TRIANGLES_A_BYTE)
    }
}
