//! Short names of the columns of a table: `gate_opening_m` for `/equipment/gate_opening_m`.

/// Short names of columns, in their order. A column whose name begins with `/` has a JSON pointer as name; all others keep theirs.
///
/// The short name of a pointer is its last parts, joined by `.`, and as few of them as possible, so that
/// - the first of them begins with a letter: an index alone is no name,
/// - no other pointer of the table ends with the same parts, and
/// - no other column of the table has this name.
///
/// A pointer without such parts keeps its name.
pub fn short_names<S: AsRef<str>>(columns: &[S]) -> Vec<String> {
    let (pointers, others): (Vec<&str>, Vec<&str>) =
        columns.iter().map(AsRef::as_ref).partition(|name| name.starts_with('/'));
    let short = |pointer: &str| {
        let is_free = |parts: usize, name: &str| {
            let mut twins = pointers.iter().filter(|other| **other != pointer);
            twins.all(|other| ending(other, parts) != name) && !others.contains(&name)
        };
        let endings = (1..=pointer.matches('/').count()).map(|parts| (parts, ending(pointer, parts)));
        let mut names =
            endings.filter(|(parts, name)| name.starts_with(char::is_alphabetic) && is_free(*parts, name));
        names.next().map_or_else(|| pointer.to_owned(), |(_, name)| name)
    };
    let name = |column: &str| if column.starts_with('/') { short(column) } else { column.to_owned() };
    columns.iter().map(|column| name(column.as_ref())).collect()
}

/// The last parts of a pointer, or all of them if it has fewer.
fn ending(pointer: &str, parts: usize) -> String {
    let all: Vec<&str> = pointer.split('/').skip(1).collect();
    all[all.len().saturating_sub(parts)..].join(".")
}

#[cfg(test)]
mod tests {
    use super::short_names;

    #[test]
    fn names_are_as_short_as_they_can_be() {
        assert_eq!(short_names(&["/equipment/gate_opening_m", "/seed"]), ["gate_opening_m", "seed"]);
        let twins = ["/contact/fillet_belt/friction", "/contact/fillet_wall/friction", "/condition"];
        assert_eq!(short_names(&twins), ["fillet_belt.friction", "fillet_wall.friction", "condition"]);
        assert_eq!(short_names(&["/product/sizes_m/0/1"]), ["sizes_m.0.1"], "an index alone is no name");
        assert_eq!(short_names(&["/a/x", "/x"]), ["a.x", "/x"], "a pointer that ends another one");
    }

    #[test]
    fn other_columns_keep_their_names() {
        let columns = ["seed", "/numerics/seed", "/seed", "discharged_kg", "/a/count"];
        let short = ["seed", "numerics.seed", "/seed", "discharged_kg", "count"];
        assert_eq!(short_names(&columns), short);
        assert_eq!(short_names(&["a.x", "/a/x", "/b/x"]), ["a.x", "/a/x", "b.x"]);
    }
}
