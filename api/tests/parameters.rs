//! The parameter library: every entry fits the field table and has a source, and the page of the library is current.

#[path = "../../solver/tests/common/generated.rs"]
mod generated;

use std::collections::BTreeSet;
use std::path::Path;

use generated::assert_generated;
use roost_api::parameters::{
    ParameterEntry, ParameterLibrary, ParameterSource, ParameterStatus, ParameterTest,
};
use roost_solver::scenario::field::{FieldKind, Range};
use roost_solver::scenario::fields;

/// The range of the numbers of a field; none for words, flags and meshes.
fn range(kind: FieldKind) -> Option<Range> {
    match kind {
        FieldKind::Number(range)
        | FieldKind::Nullable(range)
        | FieldKind::NumberOrAuto(range)
        | FieldKind::Integer(range)
        | FieldKind::NullableInteger(range)
        | FieldKind::Sizes(range)
        | FieldKind::Vector(range)
        | FieldKind::Counts(range)
        | FieldKind::Plate(range) => Some(range),
        FieldKind::Choice(_) | FieldKind::Flag | FieldKind::Text | FieldKind::Mesh => None,
    }
}

/// The faults of an entry.
fn faults(entry: &ParameterEntry, sources: &[ParameterSource]) -> Vec<String> {
    let mut faults = Vec::new();
    let mut check = |is_sound: bool, fault: &str| {
        if !is_sound {
            faults.push(fault.to_owned());
        }
    };
    check(!entry.fields.is_empty(), "no field");
    let numbers: Vec<f64> = [entry.low, entry.high, entry.single_value].into_iter().flatten().collect();
    for pointer in &entry.fields {
        let Some(field) = fields::find(pointer) else {
            check(false, "no such field");
            continue;
        };
        check(field.unit == entry.unit, "another unit");
        let is_within = |range: Range| numbers.iter().all(|number| range.contains(*number));
        check(range(field.kind).is_some_and(is_within), "out of range");
    }
    match entry.status {
        ParameterStatus::Interval => match (entry.low, entry.high) {
            (Some(low), Some(high)) => {
                let has_replicates = entry.n.is_some_and(|n| n >= 2) && entry.deviation.is_some();
                check(low < high || low == high && has_replicates, "not an interval");
                check(entry.single_value.is_none(), "an interval and a single value");
            }
            _ => check(false, "no interval"),
        },
        ParameterStatus::NotPublished => {
            let numbers = [entry.low, entry.high, entry.deviation];
            check(numbers.iter().all(Option::is_none) && entry.n.is_none(), "numbers of an interval");
        }
    }
    check(entry.deviation.is_none_or(|deviation| deviation > 0.0), "a deviation of zero");
    check(entry.n != Some(0), "no replicates");
    let source = sources.iter().find(|source| source.key == entry.source);
    check(source.is_some() && !entry.place.is_empty(), "no source");
    let texts = [&entry.product, &entry.conditions, &entry.mapping];
    check(texts.iter().all(|text| !text.is_empty()), "a text is missing");
    faults
}

/// The faults of a source.
fn faults_of_source(source: &ParameterSource) -> Vec<&'static str> {
    let texts = [&source.key, &source.short, &source.citation, &source.read];
    let has_address = source.url.starts_with("https://") || source.url.starts_with("http://");
    let checks =
        [(texts.iter().all(|text| !text.is_empty()), "a text is missing"), (has_address, "no address")];
    checks.into_iter().filter(|(is_sound, _)| !is_sound).map(|(_, fault)| fault).collect()
}

#[test]
fn every_entry_fits_its_fields_and_names_its_source() {
    let library = ParameterLibrary::of_this_version();
    assert_eq!(library.schema, "roost.parameters/1");
    for entry in &library.entries {
        let faults = faults(entry, &library.sources);
        assert!(faults.is_empty(), "{} {:?}: {faults:?}", entry.product, entry.fields);
    }
    let mut names = BTreeSet::new();
    for entry in &library.entries {
        let is_new = names.insert((&entry.fields, &entry.product, &entry.counterpart));
        assert!(is_new, "{} has two entries for {:?}", entry.product, entry.fields);
    }
    let keys: BTreeSet<&String> = library.sources.iter().map(|source| &source.key).collect();
    assert_eq!(keys.len(), library.sources.len(), "two sources with one key");
    for source in &library.sources {
        assert_eq!(faults_of_source(source), [""; 0], "{}", source.key);
        let is_used = library.entries.iter().any(|entry| entry.source == source.key);
        assert!(is_used, "{} is the source of nothing", source.key);
    }
}

/// An entry without faults, of the source `a`.
fn sound() -> ParameterEntry {
    ParameterEntry {
        fields: vec!["/product/density_kg_m3".to_owned()],
        product: "meat".to_owned(),
        counterpart: String::new(),
        status: ParameterStatus::Interval,
        conditions: "cold".to_owned(),
        unit: "kg/m³".to_owned(),
        low: Some(1000.0),
        high: Some(1100.0),
        deviation: None,
        n: None,
        single_value: None,
        source: "a".to_owned(),
        place: "Table 1".to_owned(),
        mapping: "without air".to_owned(),
        test: ParameterTest::Density,
    }
}

fn source() -> ParameterSource {
    let text = |text: &str| text.to_owned();
    ParameterSource {
        key: text("a"),
        short: text("A 2000"),
        citation: text("A (2000)."),
        url: text("https://doi.org/1"),
        read: text("all"),
    }
}

#[test]
fn each_fault_of_an_entry_is_found() {
    type Change = fn(&mut ParameterEntry);
    let changes: &[(&str, Change)] = &[
        ("no field", |entry| entry.fields.clear()),
        ("no such field", |entry| entry.fields.push("/product/weight_kg".to_owned())),
        ("another unit", |entry| entry.unit = "g/cm³".to_owned()),
        ("out of range", |entry| entry.low = Some(1.0)),
        ("out of range", |entry| entry.high = Some(1e6)),
        ("not an interval", |entry| entry.low = entry.high),
        ("not an interval", |entry| entry.low = Some(1200.0)),
        ("not an interval", |entry| (entry.low, entry.n) = (entry.high, Some(3))),
        ("no interval", |entry| entry.high = None),
        ("an interval and a single value", |entry| entry.single_value = Some(1050.0)),
        ("numbers of an interval", |entry| entry.status = ParameterStatus::NotPublished),
        ("a deviation of zero", |entry| entry.deviation = Some(0.0)),
        ("no replicates", |entry| entry.n = Some(0)),
        ("no source", |entry| entry.source = "b".to_owned()),
        ("no source", |entry| entry.place.clear()),
        ("a text is missing", |entry| entry.mapping.clear()),
        ("a text is missing", |entry| entry.conditions.clear()),
    ];
    let sources = [source()];
    assert_eq!(faults(&sound(), &sources), [""; 0]);
    for (fault, change) in changes {
        let mut entry = sound();
        change(&mut entry);
        assert_eq!(faults(&entry, &sources), [*fault]);
    }
    // Replicates of one value have a deviation, and a field of words has no numbers.
    let mut measured = sound();
    (measured.low, measured.n, measured.deviation) = (measured.high, Some(3), Some(5.0));
    assert_eq!(faults(&measured, &sources), [""; 0]);
    let mut word = sound();
    (word.fields, word.unit) = (vec!["/product/fill".to_owned()], String::new());
    assert_eq!(faults(&word, &sources), ["out of range"]);
    let mut unpublished = sound();
    unpublished.status = ParameterStatus::NotPublished;
    (unpublished.low, unpublished.high, unpublished.single_value) = (None, None, Some(1e6));
    assert_eq!(faults(&unpublished, &sources), ["out of range"]);
}

#[test]
fn each_fault_of_a_source_is_found() {
    assert_eq!(faults_of_source(&source()), [""; 0]);
    let mut unread = source();
    unread.read.clear();
    assert_eq!(faults_of_source(&unread), ["a text is missing"]);
    let mut without_address = source();
    without_address.url = "doi 1".to_owned();
    assert_eq!(faults_of_source(&without_address), ["no address"]);
}

/// The numbers of an entry, for the page.
fn numbers(entry: &ParameterEntry) -> String {
    let unit = if entry.unit.is_empty() { String::new() } else { format!(" {}", entry.unit) };
    match (entry.low, entry.high, entry.single_value) {
        (Some(low), Some(high), _) => {
            let n = entry.n.map_or(String::new(), |n| format!(", n = {n}"));
            format!("{low} to {high}{unit}{n}")
        }
        (_, _, Some(value)) => format!("not published ({value}{unit} alone)"),
        _ => "not published".to_owned(),
    }
}

/// The tables of the page: entries by field, and the sources.
fn tables(library: &ParameterLibrary) -> String {
    let mut page = String::new();
    let mut groups: Vec<&Vec<String>> = Vec::new();
    for entry in &library.entries {
        if !groups.contains(&&entry.fields) {
            groups.push(&entry.fields);
        }
    }
    groups.sort_by_key(|group| {
        fields::FIELDS.iter().position(|field| group.first().is_some_and(|first| field.pointer == first))
    });
    for group in groups {
        let title: Vec<String> = group.iter().map(|pointer| format!("`{pointer}`")).collect();
        page += &format!("### {}\n\n", title.join(", "));
        page += "| product | against | interval | conditions | source | in the model | test |\n|---|---|---|---|---|---|---|\n";
        for entry in library.entries.iter().filter(|entry| entry.fields == *group) {
            let source = library.sources.iter().find(|source| source.key == entry.source);
            let source = source.map_or(String::new(), |source| format!("[{}]({})", source.short, source.url));
            let test = entry.test.as_str();
            page += &format!(
                "| {} | {} | {} | {} | {source}, {} | {} | [{test}](../howto/kitchen-tests.md#{test}) |\n",
                entry.product,
                entry.counterpart,
                numbers(entry),
                entry.conditions,
                entry.place,
                entry.mapping
            );
        }
        page += "\n";
    }
    page += "### Sources\n\n| source | publication | part that was read |\n|---|---|---|\n";
    for source in &library.sources {
        page += &format!("| [{}]({}) | {} | {} |\n", source.short, source.url, source.citation, source.read);
    }
    page
}

#[test]
fn the_page_has_every_entry() {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/reference/parameters.md");
    assert_generated(&page, "the parameter library", tables(&ParameterLibrary::of_this_version()).trim_end());
}
