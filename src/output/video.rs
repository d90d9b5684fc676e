//! Uncompressed video: YUV4MPEG2 (Y4M), 4:4:4, 8 bit, which ffmpeg, mpv, VLC and most encoders read.
//!
//! The frames are the sRGB pictures that the PNGs hold, as Y'CbCr by the matrix of ITU-R BT.709-6 (section 3, items 3.2
//! to 3.4) in its limited range: Y' from 16 to 235, Cb and Cr from 16 to 240. The header names the range
//! (`XCOLORRANGE=LIMITED`); for the matrix, the primaries (BT.709) and the curve (sRGB) it has no field, so the command
//! of [`ffmpeg_of_video`] does.

use super::atomic::Replacement;
use anyhow::{Result, ensure};
use std::path::Path;

/// Shares of red and blue in luma; green has the rest.
const K_RED: f32 = 0.2126;
const K_BLUE: f32 = 0.0722;

/// A video that is being written, one frame in memory.
#[derive(Debug)]
pub struct Video {
    file: Replacement,
    pixels: usize,
    /// Planes of a frame, one behind the other.
    planes: Vec<u8>,
    frames: u32,
}

/// Y', Cb and Cr of an sRGB pixel.
fn ycbcr(rgb: [u8; 3]) -> [u8; 3] {
    let [r, g, b] = rgb.map(|x| f32::from(x) / 255.0);
    let y = K_RED * r + (1.0 - K_RED - K_BLUE) * g + K_BLUE * b;
    let difference = |x: f32, k: f32| 128.0 + 224.0 * (x - y) / (2.0 * (1.0 - k));
    // All are within 16 to 240 before they are rounded.
    [16.0 + 219.0 * y, difference(b, K_BLUE), difference(r, K_RED)].map(|x| (x + 0.5) as u8)
}

impl Video {
    /// Starts the video `path` of frames of `width` x `height` pixels, `fps` a second.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn create(path: &Path, width: u32, height: u32, fps: u32) -> Result<Self> {
        let mut file = Replacement::create(path)?;
        // Progressive, square pixels.
        let header = format!("YUV4MPEG2 W{width} H{height} F{fps}:1 Ip A1:1 C444 XCOLORRANGE=LIMITED\n");
        file.push(header.as_bytes())?;
        let pixels = width as usize * height as usize;
        Ok(Self { file, pixels, planes: vec![0; 3 * pixels], frames: 0 })
    }

    /// Appends a frame: sRGB, row by row from the top.
    ///
    /// # Errors
    /// It has another size, or the disk is full.
    pub fn push(&mut self, frame: &[[u8; 3]]) -> Result<()> {
        ensure!(frame.len() == self.pixels, "a frame of {} pixels in a video of {}", frame.len(), self.pixels);
        let (luma, chroma) = self.planes.split_at_mut(self.pixels);
        let (blue, red) = chroma.split_at_mut(self.pixels);
        for (((pixel, luma), blue), red) in frame.iter().zip(luma).zip(blue).zip(red) {
            [*luma, *blue, *red] = ycbcr(*pixel);
        }
        self.file.push(b"FRAME\n")?;
        self.file.push(&self.planes)?;
        self.frames += 1;
        Ok(())
    }

    /// Ends the video and gives it its name. Without a frame there is none: the old file stays.
    ///
    /// # Errors
    /// The disk is full.
    pub fn finish(self) -> Result<()> {
        if self.frames == 0 { Ok(()) } else { self.file.finish() }
    }
}

/// What the colours of the frames are, for filters and for the encoder.
const NAMED: &str = "setparams=range=tv:colorspace=bt709:color_primaries=bt709:color_trc=iec61966-2-1";
const COLOURS: &str = "-colorspace bt709 -color_primaries bt709 -color_trc iec61966-2-1 -color_range tv";

/// Encoding as most players take it: chroma of half the resolution, for which sizes must be even.
fn encoding(width: u32, height: u32) -> (&'static str, String) {
    let pad = if width % 2 + height % 2 > 0 { "pad=ceil(iw/2)*2:ceil(ih/2)*2," } else { "" };
    (pad, format!("-c:v libx264 -crf 18 -pix_fmt yuv420p {COLOURS}"))
}

/// A word as a POSIX shell reads it back.
fn quoted(path: &Path) -> String {
    let text = path.display().to_string();
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "/._-+%=:,@".contains(c);
    match !text.is_empty() && text.chars().all(is_plain) {
        true => text,
        false => format!("'{}'", text.replace('\'', r"'\''")),
    }
}

/// The command that makes an mp4 of a folder's `0000.png` and so on, `fps` a second, of `width` x `height` pixels.
pub fn ffmpeg_of_frames(folder: &Path, (width, height): (u32, u32), fps: u32, to: &Path) -> String {
    let (pad, encoding) = encoding(width, height);
    // In a pattern a percent sign is written twice.
    let folder = folder.display().to_string().replace('%', "%%");
    format!(
        "ffmpeg -framerate {fps} -i {} -vf '{pad}scale=out_color_matrix=bt709:out_range=tv,format=yuv420p,{NAMED}' \
         {encoding} {}",
        quoted(&Path::new(&folder).join("%04d.png")),
        quoted(to)
    )
}

/// The command that makes an mp4 of the video `file`.
pub fn ffmpeg_of_video(file: &Path, (width, height): (u32, u32), to: &Path) -> String {
    let (pad, encoding) = encoding(width, height);
    // Nothing is converted but the resolution of chroma: the matrix is named before.
    format!("ffmpeg -i {} -vf '{NAMED},{pad}format=yuv420p' {encoding} {}", quoted(file), quoted(to))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_are_those_of_the_standard() {
        // 100 % bars of BT.709 in 8 bits (ITU-R BT.709-6, rounded).
        for (rgb, expected) in [
            ([0, 0, 0], [16, 128, 128]),
            ([255, 255, 255], [235, 128, 128]),
            ([255, 0, 0], [63, 102, 240]),
            ([0, 255, 0], [173, 42, 26]),
            ([0, 0, 255], [32, 240, 118]),
            ([255, 255, 0], [219, 16, 138]),
            ([0, 255, 255], [188, 154, 16]),
        ] {
            assert_eq!(ycbcr(rgb), expected, "{rgb:?}");
        }
    }

    #[test]
    fn files_appear_whole() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.y4m");
        let mut video = Video::create(&path, 3, 1, 24).unwrap();
        video.push(&[[255; 3], [0; 3], [255, 0, 0]]).unwrap();
        assert!(video.push(&[[0; 3]; 4]).is_err());
        assert!(!path.exists());
        video.finish().unwrap();
        let expected: Vec<u8> = [
            b"YUV4MPEG2 W3 H1 F24:1 Ip A1:1 C444 XCOLORRANGE=LIMITED\nFRAME\n".as_slice(),
            &[235, 16, 63, 128, 128, 102, 128, 128, 240],
        ]
        .concat();
        assert_eq!(std::fs::read(&path).unwrap(), expected);
        // Without a frame the old file stays, and nothing else is left.
        Video::create(&path, 3, 1, 24).unwrap().finish().unwrap();
        drop(Video::create(&path, 3, 1, 24).unwrap());
        assert_eq!(std::fs::read(&path).unwrap(), expected);
        assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 1);
        assert!(Video::create(folder.path(), 3, 1, 24).is_err());
        assert!(Video::create(&folder.path().join("none/a.y4m"), 3, 1, 24).is_err());
    }

    #[test]
    fn commands_are_quoted_and_pad_odd_sizes() {
        let text = ffmpeg_of_frames(Path::new("my 100%"), (64, 48), 30, Path::new("a.mp4"));
        assert!(text.starts_with("ffmpeg -framerate 30 -i 'my 100%%/%04d.png' -vf 'scale="), "{text}");
        assert!(text.ends_with(" a.mp4"), "{text}");
        let text = ffmpeg_of_video(Path::new("it's.y4m"), (63, 48), Path::new("b.mp4"));
        assert!(text.starts_with(r"ffmpeg -i 'it'\''s.y4m' -vf 'setparams="), "{text}");
        assert!(text.contains("pad=ceil(iw/2)*2:ceil(ih/2)*2,"), "{text}");
    }
}
