//! References to other files. URIs of glTF: data URIs and percent-encoded relative paths (glTF 2.0, sections 2.8 and
//! 3.6; RFC 2397, RFC 3986).

use bricks::planted::{self, Defect};
use std::path::{Component, Path, PathBuf};

/// What a URI refers to.
#[derive(Debug, PartialEq)]
pub(super) enum Target {
    /// The bytes of a data URI.
    Data(Vec<u8>),
    /// A path below the root, without `.` and `..`.
    File(PathBuf),
}

/// Whether `uri` carries its data itself.
pub(super) fn is_data(uri: &str) -> bool {
    uri.as_bytes().get(..5).is_some_and(|scheme| scheme.eq_ignore_ascii_case(b"data:"))
}

/// Resolves `uri` of a file in the folder `from`, which is below a root; the error says what is wrong with it. Only
/// files in or below the root are referred to: other schemes, absolute paths and paths that climb out are refused.
pub(super) fn resolve(from: &Path, uri: &str) -> Result<Target, &'static str> {
    if is_data(uri) {
        return data(&uri[5..]).map(Target::Data);
    }
    if has_scheme(uri) {
        return Err("the URI is not a relative path");
    }
    let path = String::from_utf8(percent_decode(uri)?).map_err(|_| "the URI does not decode to UTF-8")?;
    if path.contains('\0') {
        return Err("the URI holds a zero byte");
    }
    below(from.join(path)).map(Target::File)
}

/// A path below a folder, without `.` and `..`; the error says why `path` is none.
pub(super) fn below(path: impl AsRef<Path>) -> Result<PathBuf, &'static str> {
    let mut below = PathBuf::new();
    for component in path.as_ref().components() {
        match component {
            Component::Normal(name) => below.push(name),
            Component::CurDir => {}
            Component::ParentDir => {
                if planted::is(Defect::Outside) {
                    below.push("..");
                } else if !below.pop() {
                    return Err("the path leads out of the folder that may be read; convert --within names another");
                }
            }
            Component::RootDir | Component::Prefix(_) => return Err("the path is absolute"),
        }
    }
    if below.as_os_str().is_empty() {
        return Err("the path names no file");
    }
    Ok(below)
}

/// Whether `uri` begins with `scheme:`.
fn has_scheme(uri: &str) -> bool {
    let Some(colon) = uri.find(':') else { return false };
    let scheme = &uri.as_bytes()[..colon];
    scheme.first().is_some_and(u8::is_ascii_alphabetic)
        && scheme.iter().all(|c| c.is_ascii_alphanumeric() || b"+-.".contains(c))
}

/// The bytes of a data URI behind `data:`.
fn data(uri: &str) -> Result<Vec<u8>, &'static str> {
    let (media, payload) = uri.split_once(',').ok_or("the data URI has no comma")?;
    let is_base64 = media.len() >= 7 && media.as_bytes()[media.len() - 7..].eq_ignore_ascii_case(b";base64");
    if is_base64 { base64(payload.as_bytes()) } else { percent_decode(payload) }
}

/// Decodes `%XX`.
fn percent_decode(text: &str) -> Result<Vec<u8>, &'static str> {
    let digit = |c: Option<u8>| c.and_then(|c| (c as char).to_digit(16)).ok_or("the URI has a bad percent-encoding");
    let mut bytes = text.bytes();
    let mut decoded = Vec::with_capacity(text.len());
    while let Some(byte) = bytes.next() {
        decoded.push(if byte == b'%' { (digit(bytes.next())? << 4 | digit(bytes.next())?) as u8 } else { byte });
    }
    Ok(decoded)
}

/// Decodes base64 of the standard alphabet (RFC 4648, section 4); padding may be missing.
fn base64(text: &[u8]) -> Result<Vec<u8>, &'static str> {
    const BAD: &str = "the data URI is not valid base64";
    let digits = match text {
        [digits @ .., b'=', b'='] | [digits @ .., b'='] if text.len().is_multiple_of(4) => digits,
        _ => text,
    };
    let mut decoded = Vec::with_capacity(digits.len() / 4 * 3 + 2);
    for group in digits.chunks(4) {
        let mut bits = 0u32;
        for &c in group {
            let digit = match c {
                b'A'..=b'Z' => c - b'A',
                b'a'..=b'z' => c - b'a' + 26,
                b'0'..=b'9' => c - b'0' + 52,
                b'+' => 62,
                b'/' => 63,
                _ => return Err(BAD),
            };
            bits = bits << 6 | digit as u32;
        }
        // 4 digits hold 3 bytes, 3 hold 2, 2 hold 1; a lone digit holds none.
        if group.len() == 1 {
            return Err(BAD);
        }
        let bytes = (bits << (6 * (4 - group.len()))).to_be_bytes();
        decoded.extend_from_slice(&bytes[1..group.len()]);
    }
    Ok(decoded)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn resolve(uri: &str) -> Result<Target, &'static str> {
        super::resolve(Path::new(""), uri)
    }

    #[test]
    fn base64_of_rfc_4648() {
        for (text, bytes) in
            [("", ""), ("Zg==", "f"), ("Zm8=", "fo"), ("Zm9v", "foo"), ("Zm9vYg==", "foob"), ("Zm9vYmE", "fooba")]
        {
            assert_eq!(base64(text.as_bytes()).as_deref(), Ok(bytes.as_bytes()), "{text}");
        }
        assert_eq!(base64(b"+/+/"), Ok(vec![0xfb, 0xff, 0xbf]));
        for text in ["Z", "Zg=", "Z===", "Zm9v=", "Zm 9", "Zm9v\n", "====", "Zg==Zg=="] {
            assert!(base64(text.as_bytes()).is_err(), "{text}");
        }
    }

    #[test]
    fn data_uris() {
        let bytes = |uri| match resolve(uri) {
            Ok(Target::Data(bytes)) => bytes,
            other => panic!("{other:?}"),
        };
        assert_eq!(bytes("data:application/octet-stream;base64,AAEC"), [0, 1, 2]);
        assert_eq!(bytes("DATA:;BASE64,AAEC"), [0, 1, 2]);
        assert_eq!(bytes("data:,a%20b"), b"a b");
        assert!(resolve("data:image/png").is_err());
    }

    #[test]
    fn relative_paths() {
        let file = |path: &str| Ok(Target::File(PathBuf::from(path)));
        assert_eq!(resolve("a%20b/c%C3%A9.bin"), file("a b/cé.bin"));
        assert_eq!(resolve("./a/./../b.bin"), file("b.bin"));
        assert_eq!(resolve("what?#1.bin"), file("what?#1.bin"));
        let bad = [
            "",
            ".",
            "a/..",
            "../a.bin",
            "a/../../b.bin",
            "%2e%2e/a.bin",
            "/a.bin",
            "%2Fa.bin",
            "http://x/a.bin",
            "file:///a",
            "C:\\a.bin",
            "%",
            "%4",
            "%%",
            "%g0",
            "%ff",
            "a%00b",
        ];
        for uri in bad {
            assert!(resolve(uri).is_err(), "{uri}");
        }
        // A root around the folder of the file.
        let from = |uri| super::resolve(Path::new("a/b"), uri);
        assert_eq!(from("../../c.bin"), file("c.bin"));
        assert_eq!(from("d.bin"), file("a/b/d.bin"));
        for uri in ["../../../c.bin", "/c.bin", "../.."] {
            assert!(from(uri).is_err(), "{uri}");
        }
    }
}
