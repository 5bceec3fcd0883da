//! Names and pointers: the field that an unknown name most likely means, and names in JSON pointers.

use std::collections::HashMap;
use std::sync::LazyLock;

use super::fields::{FIELDS, SECTIONS, in_table};

/// Maximum length of a name that is compared: longer names resemble none.
const LONGEST: usize = 100;

/// A name as a part of a JSON pointer (RFC 6901).
pub fn escape(name: &str) -> String {
    name.replace('~', "~0").replace('/', "~1")
}

/// Pointers of all sections and fields.
fn pointers() -> impl DoubleEndedIterator<Item = &'static str> {
    SECTIONS.iter().map(|section| section.pointer).chain(FIELDS.iter().map(|field| field.pointer))
}

/// The section that holds `pointer`, and the name in it.
fn split(pointer: &str) -> (&str, &str) {
    pointer.rsplit_once('/').unwrap_or(("", pointer))
}

/// The names of a section's fields.
pub(super) fn names_in(section: &str) -> &'static [&'static str] {
    // Asked for every section of every point of a sweep.
    static NAMES: LazyLock<HashMap<&str, Vec<&str>>> = LazyLock::new(|| {
        let mut names: HashMap<&str, Vec<&str>> = HashMap::new();
        for (section, name) in pointers().map(split) {
            names.entry(section).or_default().push(name);
        }
        names
    });
    NAMES.get(in_table(section).as_str()).map_or(&[], Vec::as_slice)
}

/// How similar two names are, from 0 to 1. Edits catch slips of the finger; shared letter pairs catch a left-out unit
/// or prefix.
fn similarity(name: &str, known: &str) -> f64 {
    strsim::normalized_damerau_levenshtein(name, known).max(strsim::sorensen_dice(name, known))
}

/// The least similarity of names that are suggested.
const SIMILAR: f64 = 0.5;

/// The known name that is most similar to `name`; none when no name is.
pub fn most_similar<'a>(name: &str, known: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    if name.len() > LONGEST {
        return None;
    }
    known
        .map(|known| (similarity(name, known), known))
        .filter(|(similarity, _)| *similarity >= SIMILAR)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, known)| known)
}

/// How much more similar a neighbour counts than a field elsewhere. The same name elsewhere still goes before it.
const NEIGHBOUR: f64 = 0.2;

/// The pointer of the field or section that `pointer` most likely means: the same name anywhere, then a similar one,
/// with a bonus for its own neighbours. None when nothing is similar.
pub fn nearest(pointer: &str) -> Option<&'static str> {
    let pointer = in_table(pointer);
    let (section, name) = split(&pointer);
    let neighbour = |known: &'static str| split(known).0 == section;
    if name.len() > LONGEST {
        return None;
    }
    let rank = |(similarity, is_neighbour, _): (f64, bool, &str)| match (similarity < 1.0, is_neighbour) {
        (true, true) => (similarity + NEIGHBOUR).min(0.99),
        _ => similarity,
    };
    // Reversed, since the last of equals wins.
    pointers()
        .rev()
        .map(|known| (similarity(name, split(known).1), neighbour(known), known))
        .filter(|(similarity, ..)| *similarity >= SIMILAR)
        .max_by(|a, b| rank(*a).total_cmp(&rank(*b)).then(a.1.cmp(&b.1)))
        .map(|(.., known)| known)
}
