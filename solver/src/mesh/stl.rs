//! STL files, binary and ASCII: triangles in the file's own units. Normals and attributes are ignored: the
//! order of the corners defines the orientation.
//!
//! The published crates do not report faults precisely. `stl_io` 0.11 takes every file that begins with
//! "solid " for ASCII, and many binary files do. `nom_stl` 0.2 has an error that cannot be displayed.

use glam::DVec3;

use super::{MAX_TRIANGLES, MeshError};

/// Bytes before the first triangle of a binary file: 80 of free text, 4 of the number of triangles.
const HEADER: usize = 84;
/// Bytes of a triangle: normal and corners as 12 `f32`, and 2 unused bytes.
const RECORD: usize = 50;
/// Maximum number of characters of a file that an error quotes.
const MAX_QUOTED_CHARS: usize = 40;

/// Length of a binary file of that many triangles, in bytes.
pub fn binary_length(triangles: u32) -> u64 {
    HEADER as u64 + RECORD as u64 * u64::from(triangles)
}

/// Reads the triangles of a file: at least one, with finite corners.
///
/// # Errors
/// The fault of the file.
pub fn read(bytes: &[u8]) -> Result<Vec<[DVec3; 3]>, MeshError> {
    let found = bytes.len() as u64;
    let announced = bytes.get(HEADER - 4..HEADER).map(|count| le(count, u32::from_le_bytes));
    let triangles = match announced {
        _ if bytes.is_empty() => return Err(MeshError::Empty),
        // The length decides: the header of a binary file may also begin with "solid".
        Some(triangles) if binary_length(triangles) == found => binary(&bytes[HEADER..])?,
        _ if is_text(bytes) => ascii(bytes)?,
        // A file of another format shows a random number here, and most numbers are large.
        Some(triangles) if triangles as usize <= MAX_TRIANGLES => {
            let expected = binary_length(triangles);
            return Err(match found < expected {
                true => MeshError::Truncated { triangles, expected, found },
                false => MeshError::Surplus { triangles, expected, found },
            });
        }
        _ => return Err(MeshError::NotStl { announced, found }),
    };
    if triangles.is_empty() {
        return Err(MeshError::NoTriangle);
    }
    for (triangle, corners) in (1..).zip(&triangles) {
        if let Some(corner) = corners.iter().find(|corner| !corner.is_finite()) {
            return Err(MeshError::NotFinite { triangle, corner: corner.to_array() });
        }
    }
    Ok(triangles)
}

/// A little-endian number of four bytes.
fn le<T>(bytes: &[u8], of: fn([u8; 4]) -> T) -> T {
    of(bytes.try_into().expect("four bytes"))
}

fn binary(records: &[u8]) -> Result<Vec<[DVec3; 3]>, MeshError> {
    let found = records.len() / RECORD;
    if found > MAX_TRIANGLES {
        return Err(MeshError::TooMany { found });
    }
    let number = |bytes: &[u8]| f64::from(le(bytes, f32::from_le_bytes));
    let corner = |bytes: &[u8]| DVec3::new(number(&bytes[..4]), number(&bytes[4..8]), number(&bytes[8..12]));
    let triangle = |record: &[u8]| [12, 24, 36].map(|at| corner(&record[at..at + 12]));
    Ok(records.chunks_exact(RECORD).map(triangle).collect())
}

/// Whether an incomplete or surplus file is text. It then begins as ASCII STL does and has no zero byte; the
/// triangle count of a binary file has one.
fn is_text(bytes: &[u8]) -> bool {
    bytes.trim_ascii_start().get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid"))
        && !bytes.contains(&0)
}

fn ascii(bytes: &[u8]) -> Result<Vec<[DVec3; 3]>, MeshError> {
    let mut words = Tokens { rest: bytes, line: 1 };
    let mut triangles = Vec::new();
    words.expect("`solid`")?;
    words.skip_line();
    loop {
        match words.next() {
            Some(word) if is_keyword(word, "facet") => triangles.push(words.facet()?),
            Some(word) if is_keyword(word, "endsolid") => {
                words.skip_line();
                // Another solid may follow.
                match words.next() {
                    None => break,
                    Some(word) if is_keyword(word, "solid") => words.skip_line(),
                    other => return Err(words.fault("`solid` or the end of the file", other)),
                }
            }
            other => return Err(words.fault("`facet` or `endsolid`", other)),
        }
    }
    match triangles.len() {
        found if found > MAX_TRIANGLES => Err(MeshError::TooMany { found }),
        _ => Ok(triangles),
    }
}

/// Whether a token is this keyword, in either case.
fn is_keyword(word: &[u8], this: &str) -> bool {
    word.eq_ignore_ascii_case(this.as_bytes())
}

/// The tokens of a text, with line numbers.
struct Tokens<'a> {
    rest: &'a [u8],
    line: usize,
}

impl<'a> Tokens<'a> {
    fn next(&mut self) -> Option<&'a [u8]> {
        let start = self.rest.iter().position(|byte| !byte.is_ascii_whitespace())?;
        self.line += self.rest[..start].iter().filter(|&&byte| byte == b'\n').count();
        let rest = &self.rest[start..];
        let end = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
        self.rest = &rest[end..];
        Some(&rest[..end])
    }

    /// Skips a name: the rest of the line.
    fn skip_line(&mut self) {
        let end = self.rest.iter().position(|byte| matches!(byte, b'\n' | b'\r')).unwrap_or(self.rest.len());
        self.rest = &self.rest[end..];
    }

    fn fault(&self, expected: &'static str, found: Option<&[u8]>) -> MeshError {
        let shown = |word: &[u8]| {
            let start: String = String::from_utf8_lossy(word).chars().take(MAX_QUOTED_CHARS).collect();
            format!("`{start}`")
        };
        // A token with nothing behind it, not even a line end, was cut off.
        let cut = if self.rest.is_empty() { ", where the file ends" } else { "" };
        let found = found.map_or_else(|| "the end of the file".to_owned(), |word| shown(word) + cut);
        MeshError::Syntax { line: self.line, expected, found }
    }

    /// Takes the next token, which must be the one in backticks.
    fn expect(&mut self, expected: &'static str) -> Result<(), MeshError> {
        match self.next() {
            Some(word) if is_keyword(word, expected.trim_matches('`')) => Ok(()),
            other => Err(self.fault(expected, other)),
        }
    }

    fn number(&mut self) -> Result<f64, MeshError> {
        let word = self.next();
        let number = word.and_then(|word| std::str::from_utf8(word).ok()?.parse().ok());
        number.ok_or_else(|| self.fault("a number", word))
    }

    /// The rest of a facet after `facet`. The normal may be anything: some programs write `nan`.
    fn facet(&mut self) -> Result<[DVec3; 3], MeshError> {
        self.expect("`normal`")?;
        for _ in 0..3 {
            self.next();
        }
        self.expect("`outer`")?;
        self.expect("`loop`")?;
        let mut corners = [DVec3::ZERO; 3];
        for corner in &mut corners {
            self.expect("`vertex`")?;
            *corner = DVec3::new(self.number()?, self.number()?, self.number()?);
        }
        self.expect("`endloop`")?;
        self.expect("`endfacet`")?;
        Ok(corners)
    }
}
