//! The generated parts of pages: compared, or written with `ROOST_WRITE=1`.

use std::path::Path;

/// Asserts that the part of a page that is generated from `source` is `text`; with `ROOST_WRITE=1` writes it instead.
pub(crate) fn assert_generated(path: &Path, source: &str, text: &str) {
    let name = path.display();
    let page = std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{name}: {error}"));
    let start = format!("<!-- Generated from {source}");
    let (head, rest) = page.split_once(&start).unwrap_or_else(|| panic!("{name} has no `{start}`"));
    let (mark, rest) = rest.split_once("-->\n").expect("the end of the mark");
    let end = "<!-- end of the generated part -->";
    let tail = rest.split_once(end).unwrap_or_else(|| panic!("{name} has no `{end}`")).1;
    let expected = format!("{head}{start}{mark}-->\n\n{text}\n{end}{tail}");
    assert_text(path, &page, &expected);
}

/// Asserts that a page has the expected text; with `ROOST_WRITE=1` writes it instead.
#[allow(dead_code, reason = "some test binaries use only generated parts")]
pub(crate) fn assert_text(path: &Path, page: &str, expected: &str) {
    let name = path.display();
    if std::env::var_os("ROOST_WRITE").is_some() {
        if page != expected {
            println!("{name} is written: look at its difference");
            std::fs::write(path, expected).expect("the page is written");
        }
    } else {
        assert!(page == expected, "{name} is out of date: run its test with ROOST_WRITE=1");
    }
}
