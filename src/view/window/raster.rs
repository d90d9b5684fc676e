//! Draws the triangles of panels on the processor, for machines without a GPU: no crate does so for this egui.
//!
//! Colours are sRGB with premultiplied alpha, blended as they are, as egui's own renderers do it. Pixels whose
//! centres lie on a common edge belong to one of its triangles, by the usual rule: the upper and the left edges count.

use egui::epaint::{ClippedPrimitive, ImageData, Mesh, Primitive, Vertex, textures::TexturesDelta};
use egui::{Color32, ColorImage, Rect, TextureId};
use std::collections::HashMap;

/// What is drawn on: 0x00RRGGBB, row by row from the top.
pub struct Canvas<'a> {
    /// In pixels.
    pub width: usize,
    /// In pixels.
    pub height: usize,
    /// Width times height of them.
    pub pixels: &'a mut [u32],
}

/// Pixels from, and to, of a row or column; half open.
type Span = (usize, usize);

/// Draws what panels consist of.
#[derive(Default)]
pub struct Painter {
    textures: HashMap<TextureId, ColorImage>,
}

/// Three numbers of a colour in a word.
fn word([r, g, b]: [u8; 3]) -> u32 {
    u32::from(r) << 16 | u32::from(g) << 8 | u32::from(b)
}

fn bytes(word: u32) -> [u8; 3] {
    [(word >> 16) as u8, (word >> 8) as u8, word as u8]
}

/// x / 255, rounded, of products of two bytes.
fn over_255(x: u32) -> u32 {
    (x + 128 + ((x + 128) >> 8)) >> 8
}

impl Canvas<'_> {
    /// The pixels whose centres lie in a range, of so many.
    fn span(from: f32, to: f32, most: usize) -> Span {
        let of = |x: f32| ((x - 0.5).ceil().max(0.0) as usize).min(most);
        let (from, to) = (of(from), of(to));
        (from, to.max(from))
    }

    fn blend(&mut self, index: usize, color: [u32; 4]) {
        let below = bytes(self.pixels[index]).map(u32::from);
        let rest = 255 - color[3];
        let mixed: [u8; 3] = std::array::from_fn(|k| (color[k] + over_255(below[k] * rest)).min(255) as u8);
        self.pixels[index] = word(mixed);
    }

    /// Fills all with one colour.
    pub fn clear(&mut self, color: [u8; 3]) {
        self.pixels.fill(word(color));
    }

    /// Draws a picture of `size` over the pixels from `min` to `max`; between its pixels it is linear.
    pub fn picture(&mut self, [x0, y0]: [usize; 2], [x1, y1]: [usize; 2], size: (u32, u32), picture: &[[u8; 3]]) {
        let (width, height) = (size.0 as usize, size.1 as usize);
        let (x1, y1) = (x1.min(self.width), y1.min(self.height));
        if x0 >= x1 || y0 >= y1 || picture.len() != width * height || picture.is_empty() {
            return;
        }
        if (x1 - x0, y1 - y0) == (width, height) {
            for (y, row) in picture.chunks_exact(width).enumerate() {
                let to = &mut self.pixels[(y0 + y) * self.width + x0..][..width];
                to.iter_mut().zip(row).for_each(|(to, &from)| *to = word(from));
            }
            return;
        }
        // The two pixels on either side of each column, and how near the second one is, of 256.
        let taps = |count: usize, of: usize| -> Vec<(usize, usize, u32)> {
            let tap = |k: usize| {
                let at = ((k as f32 + 0.5) * of as f32 / count as f32 - 0.5).clamp(0.0, (of - 1) as f32);
                let first = at as usize;
                (first, (first + 1).min(of - 1), ((at - first as f32) * 256.0) as u32)
            };
            (0..count).map(tap).collect()
        };
        let columns = taps(x1 - x0, width);
        for (y, (above, below, down)) in taps(y1 - y0, height).into_iter().enumerate() {
            let [above, below] = [above, below].map(|row| &picture[row * width..][..width]);
            let to = &mut self.pixels[(y0 + y) * self.width + x0..][..columns.len()];
            for (to, &(left, right, across)) in to.iter_mut().zip(&columns) {
                let mix = |a: u8, b: u8, share: u32| u32::from(a) * (256 - share) + u32::from(b) * share;
                *to = word(std::array::from_fn(|k| {
                    let upper = mix(above[left][k], above[right][k], across);
                    let lower = mix(below[left][k], below[right][k], across);
                    ((upper * (256 - down) + lower * down + (1 << 15)) >> 16) as u8
                }));
            }
        }
    }
}

impl Painter {
    /// Takes new textures and changes of those there are.
    pub fn update(&mut self, delta: &mut TexturesDelta) {
        for (id, deltas) in delta.set.drain() {
            for delta in deltas {
                let ImageData::Color(image) = delta.image;
                let Some([x, y]) = delta.pos else {
                    self.textures.insert(id, (*image).clone());
                    continue;
                };
                let Some(texture) = self.textures.get_mut(&id) else { continue };
                let [width, height] = image.size;
                if x + width > texture.size[0] || y + height > texture.size[1] {
                    continue;
                }
                for row in 0..height {
                    let to = (y + row) * texture.size[0] + x;
                    texture.pixels[to..to + width].copy_from_slice(&image.pixels[row * width..][..width]);
                }
            }
        }
    }

    /// Lets textures go, after they have been drawn a last time.
    pub fn free(&mut self, delta: &mut TexturesDelta) {
        delta.free.drain().for_each(|id| drop(self.textures.remove(&id)));
    }

    /// Draws panels.
    pub fn paint(&self, canvas: &mut Canvas, primitives: &[ClippedPrimitive], pixels_per_point: f32) {
        for ClippedPrimitive { clip_rect, primitive } in primitives {
            // What draws by itself is of no use here, and nothing here does.
            let Primitive::Mesh(mesh) = primitive else { continue };
            let Some(texture) = self.textures.get(&mesh.texture_id) else { continue };
            let clip = Rect::from_min_max(
                (clip_rect.min.to_vec2() * pixels_per_point).round().to_pos2(),
                (clip_rect.max.to_vec2() * pixels_per_point).round().to_pos2(),
            );
            paint_mesh(canvas, mesh, texture, clip, pixels_per_point);
        }
    }
}

fn paint_mesh(canvas: &mut Canvas, mesh: &Mesh, texture: &ColorImage, clip: Rect, pixels_per_point: f32) {
    for corners in mesh.indices.as_chunks::<3>().0 {
        let all = corners.map(|index| mesh.vertices.get(index as usize).copied());
        let [Some(a), Some(b), Some(c)] = all else { continue };
        let scaled =
            [a, b, c].map(|vertex| Vertex { pos: (vertex.pos.to_vec2() * pixels_per_point).to_pos2(), ..vertex });
        paint_triangle(canvas, scaled, texture, clip);
    }
}

/// A colour as numbers.
fn numbers(color: Color32) -> [f32; 4] {
    color.to_array().map(f32::from)
}

fn paint_triangle(canvas: &mut Canvas, [a, mut b, mut c]: [Vertex; 3], texture: &ColorImage, clip: Rect) {
    let cross = |p: Vertex, q: Vertex, x: f32, y: f32| {
        (q.pos.x - p.pos.x) * (y - p.pos.y) - (q.pos.y - p.pos.y) * (x - p.pos.x)
    };
    let mut area = cross(a, b, c.pos.x, c.pos.y);
    if area < 0.0 {
        (b, c, area) = (c, b, -area);
    }
    if area.is_nan() || area <= 0.0 {
        return;
    }
    let [min, max] = [f32::min as fn(f32, f32) -> f32, f32::max]
        .map(|of| [of(of(a.pos.x, b.pos.x), c.pos.x), of(of(a.pos.y, b.pos.y), c.pos.y)]);
    let columns = Canvas::span(min[0].max(clip.min.x), max[0].min(clip.max.x), canvas.width);
    let rows = Canvas::span(min[1].max(clip.min.y), max[1].min(clip.max.y), canvas.height);
    let edges = [(b, c), (c, a), (a, b)];
    // On an edge a centre counts if the triangle lies below it or to the right of it.
    let counts = edges.map(|(p, q)| {
        let (x, y) = (q.pos.x - p.pos.x, q.pos.y - p.pos.y);
        y < 0.0 || (y == 0.0 && x > 0.0)
    });
    let size = texture.size;
    let flat = a.uv == b.uv && b.uv == c.uv;
    let texel = |u: f32, v: f32| {
        let at = |share: f32, of: usize| ((share * of as f32) as usize).min(of - 1);
        texture.pixels[at(v, size[1]) * size[0] + at(u, size[0])]
    };
    let first = texel(a.uv.x, a.uv.y);
    let is_plain = flat && a.color == b.color && b.color == c.color;
    let colors = [a, b, c].map(|vertex| numbers(vertex.color));
    let shaded = |weights: [f32; 3]| -> [u32; 4] {
        let of = |values: [f32; 3]| weights[0] * values[0] + weights[1] * values[1] + weights[2] * values[2];
        let texel = match flat {
            true => first,
            false => texel(of([a.uv.x, b.uv.x, c.uv.x]), of([a.uv.y, b.uv.y, c.uv.y])),
        };
        let texel = texel.to_array();
        std::array::from_fn(|k| {
            let own = of([colors[0][k], colors[1][k], colors[2][k]]).clamp(0.0, 255.0) as u32;
            over_255(own * u32::from(texel[k]))
        })
    };
    let third = [1.0 / 3.0; 3];
    let plain = shaded(third);
    for y in rows.0..rows.1 {
        for x in columns.0..columns.1 {
            let (cx, cy) = (x as f32 + 0.5, y as f32 + 0.5);
            let sides: [f32; 3] = std::array::from_fn(|k| cross(edges[k].0, edges[k].1, cx, cy));
            let is_in = (0..3).all(|k| sides[k] > 0.0 || (sides[k] == 0.0 && counts[k]));
            if is_in {
                let color = if is_plain { plain } else { shaded(sides.map(|side| side / area)) };
                if color[3] > 0 || color[0] > 0 || color[1] > 0 || color[2] > 0 {
                    canvas.blend(y * canvas.width + x, color);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use egui::{Pos2, pos2};

    fn painter() -> Painter {
        let mut painter = Painter::default();
        painter.textures.insert(TextureId::default(), ColorImage::filled([1, 1], Color32::WHITE));
        painter
    }

    fn quad(min: Pos2, max: Pos2, color: Color32) -> Mesh {
        let corner = |x, y| Vertex { pos: pos2(x, y), uv: Pos2::ZERO, color };
        Mesh {
            indices: vec![0, 1, 2, 2, 1, 3],
            vertices: vec![corner(min.x, min.y), corner(max.x, min.y), corner(min.x, max.y), corner(max.x, max.y)],
            texture_id: TextureId::default(),
        }
    }

    fn painted(mesh: Mesh, clip: Rect, scale: f32) -> Vec<u32> {
        let mut pixels = vec![0; 64];
        let mut canvas = Canvas { width: 8, height: 8, pixels: &mut pixels };
        let primitive = ClippedPrimitive { clip_rect: clip, primitive: Primitive::Mesh(mesh) };
        painter().paint(&mut canvas, &[primitive], scale);
        pixels
    }

    #[test]
    fn every_pixel_of_two_triangles_is_drawn_once() {
        // Half transparent: what is drawn twice is brighter.
        let half = Color32::from_rgba_premultiplied(100, 50, 0, 128);
        let everywhere = Rect::EVERYTHING;
        for (min, max) in
            [(pos2(1.0, 1.0), pos2(7.0, 6.0)), (pos2(0.5, 0.5), pos2(5.5, 5.5)), (pos2(-9.0, 2.2), pos2(3.1, 99.0))]
        {
            let pixels = painted(quad(min, max, half), everywhere, 1.0);
            for (index, &pixel) in pixels.iter().enumerate() {
                let (x, y) = ((index % 8) as f32 + 0.5, (index / 8) as f32 + 0.5);
                let is_in = x >= min.x && x < max.x && y >= min.y && y < max.y;
                assert_eq!(pixel, if is_in { word([100, 50, 0]) } else { 0 }, "{x} {y}");
            }
        }
    }

    #[test]
    fn clips_and_scales_count_in_points() {
        let white = |min, max| quad(min, max, Color32::WHITE);
        let pixels =
            painted(white(pos2(0.0, 0.0), pos2(4.0, 4.0)), Rect::from_min_max(pos2(1.0, 1.0), pos2(2.0, 3.0)), 2.0);
        let drawn = pixels.iter().filter(|&&pixel| pixel == 0xff_ff_ff).count();
        assert_eq!((drawn, pixels[2 * 8 + 2], pixels[2 * 8 + 4]), (8, 0xff_ff_ff, 0));
    }

    #[test]
    fn colours_blend_and_textures_are_looked_up() {
        let mut pixels = vec![word([200, 200, 200]); 4];
        let mut canvas = Canvas { width: 2, height: 2, pixels: &mut pixels };
        canvas.blend(0, [50, 0, 0, 128]);
        assert_eq!(bytes(canvas.pixels[0]), [150, 100, 100]);
        let mut painter = painter();
        let mut image = ColorImage::filled([2, 1], Color32::BLACK);
        image.pixels[1] = Color32::WHITE;
        let id = TextureId::Managed(7);
        let mut delta = TexturesDelta::default();
        delta.push(id, egui::epaint::ImageDelta::full(image, Default::default()));
        painter.update(&mut delta);
        let corner = |x: f32, y: f32| Vertex { pos: pos2(x, y), uv: pos2(x / 2.0, y / 2.0), color: Color32::WHITE };
        let mesh = Mesh {
            indices: vec![0, 1, 2, 2, 1, 3],
            vertices: vec![corner(0.0, 0.0), corner(2.0, 0.0), corner(0.0, 2.0), corner(2.0, 2.0)],
            texture_id: id,
        };
        painter.paint(
            &mut canvas,
            &[ClippedPrimitive { clip_rect: Rect::EVERYTHING, primitive: Primitive::Mesh(mesh) }],
            1.0,
        );
        assert_eq!(canvas.pixels, [0, 0xff_ff_ff, 0, 0xff_ff_ff]);
    }

    #[test]
    fn pictures_are_copied_or_scaled() {
        let picture = [[0; 3], [200; 3], [0; 3], [200; 3]];
        let mut pixels = vec![7; 32];
        let mut canvas = Canvas { width: 8, height: 4, pixels: &mut pixels };
        canvas.picture([1, 1], [3, 3], (2, 2), &picture);
        assert_eq!((canvas.pixels[9], canvas.pixels[10], canvas.pixels[8]), (0, word([200; 3]), 7));
        canvas.picture([0, 0], [8, 4], (2, 2), &picture);
        let row: Vec<u8> = canvas.pixels[..8].iter().map(|&pixel| bytes(pixel)[0]).collect();
        assert!(row.is_sorted() && row[0] == 0 && row[7] == 200 && row[3] > 60 && row[4] < 140, "{row:?}");
        // What does not fit is not drawn.
        canvas.picture([0, 0], [8, 4], (3, 2), &picture);
    }
}
