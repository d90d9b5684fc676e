//! A checker of the HTML that reports are made of: every element is closed in order and every attribute is quoted.

/// Elements without an end tag.
const VOID: [&str; 4] = ["meta", "input", "img", "br"];

/// Checks the page.
///
/// # Errors
/// What is wrong, with the text around it.
pub fn check(html: &str) -> Result<(), String> {
    let mut rest = html.strip_prefix("<!DOCTYPE html>").ok_or("no doctype")?;
    let mut open: Vec<&str> = Vec::new();
    while let Some(start) = rest.find('<') {
        text(&rest[..start])?;
        rest = &rest[start + 1..];
        let around = || rest.chars().take(60).collect::<String>();
        let end = tag_end(rest).ok_or_else(|| format!("a tag does not end: {}", around()))?;
        let tag = &rest[..end];
        rest = &rest[end + 1..];
        if let Some(name) = tag.strip_prefix('/') {
            match open.pop() {
                Some(opened) if opened == name => {}
                opened => return Err(format!("</{name}> closes {opened:?}")),
            }
            continue;
        }
        let name = tag.split([' ', '\n', '/']).next().unwrap_or_default();
        if name.is_empty() || !name.bytes().all(|b| b.is_ascii_alphanumeric()) {
            return Err(format!("no element: <{tag}>"));
        }
        attributes(tag[name.len()..].trim_end_matches('/'))?;
        for raw in ["style", "script"] {
            if name == raw {
                let end = rest.find(&format!("</{raw}>")).ok_or_else(|| format!("{raw} does not end"))?;
                rest = &rest[end..];
            }
        }
        if !tag.ends_with('/') && !VOID.contains(&name) {
            open.push(name);
        }
    }
    text(rest)?;
    if open.is_empty() { Ok(()) } else { Err(format!("not closed: {open:?}")) }
}

/// The end of a tag: the first `>` outside of quotes.
fn tag_end(tag: &str) -> Option<usize> {
    let mut quoted = false;
    for (at, byte) in tag.bytes().enumerate() {
        match byte {
            b'"' => quoted = !quoted,
            b'>' if !quoted => return Some(at),
            b'<' => return None,
            _ => {}
        }
    }
    None
}

fn attributes(text: &str) -> Result<(), String> {
    let mut rest = text.trim();
    while !rest.is_empty() {
        let name = rest.split(['=', ' ', '\n']).next().unwrap_or_default();
        if name.is_empty() || !name.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'-') {
            return Err(format!("no attribute: {rest}"));
        }
        rest = &rest[name.len()..];
        if let Some(value) = rest.strip_prefix('=') {
            let value = value.strip_prefix('"').ok_or_else(|| format!("{name} is not quoted"))?;
            let end = value.find('"').ok_or_else(|| format!("{name} does not end"))?;
            rest = &value[end + 1..];
        }
        rest = rest.trim_start();
    }
    Ok(())
}

/// Text holds no `>` and no `&` that begins no reference.
fn text(text: &str) -> Result<(), String> {
    if text.contains('>') {
        return Err(format!("a bare > in: {}", text.trim()));
    }
    for (at, _) in text.match_indices('&') {
        let name = text[at + 1..].split(';').next().unwrap_or_default();
        if !["amp", "lt", "gt", "quot", "apos"].contains(&name) && !name.starts_with('#') {
            return Err(format!("a bare & in: {}", text.trim()));
        }
    }
    Ok(())
}

#[test]
fn the_checker_finds_what_is_wrong() {
    let page = |body: &str| check(&format!("<!DOCTYPE html><html><body>{body}</body></html>"));
    assert_eq!(page("<p class=\"a > b\">x &amp; y<br><img src=\"a\"></p><svg><line x=\"1\"/></svg>"), Ok(()));
    for bad in
        ["<p>", "</p>", "<p><b></p></b>", "<p class=a></p>", "<p class=\"a></p>", "a & b", "a > b", "a < b", "<img"]
    {
        assert!(page(bad).is_err(), "{bad}");
    }
    assert!(check("<html></html>").is_err());
}
