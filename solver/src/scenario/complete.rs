//! From a written document to the complete one: a walk over the field table that lists every fault and fills in the
//! defaults.

use serde_json::{Map, Value};

use super::fault::{Fault, must_be, unknown_field};
use super::field::{Field, FieldKind, LONGEST_TEXT, MAX_SIZES, Preset, Range, Section};
use super::fields::{EXPERIMENTS, FIELDS, SECTIONS};
use super::names::{escape, names_in, nearest};
use super::own_fields::{OwnField, belongs, fields_of};
use super::relations;

/// Maximum number of unknown names per section that are listed. The others are counted, so that the answer is not
/// much longer than the document.
const MAX_UNKNOWN: usize = 50;

/// The document with every default written out.
pub(super) fn complete(document: &Value) -> Result<Value, Vec<Fault>> {
    let mut faults = Vec::new();
    let Some(root) = document.as_object() else {
        return Err(vec![Fault::new("", document, must_be("an object", document), None)]);
    };
    check_names("", root, &mut faults);
    let experiment = document.get("experiment").and_then(Value::as_str).filter(|e| EXPERIMENTS.contains(e));
    for section in SECTIONS.iter().filter(|section| !section.pointer.contains('*')) {
        check_section(section, experiment, document, &mut faults);
    }
    let completed = fill(document, experiment, &mut faults);
    relations::check(document, &completed, &mut faults);
    if faults.is_empty() { Ok(completed) } else { Err(faults) }
}

/// The value at a pointer of the table, whose names need no unescaping.
fn value_at<'a>(document: &'a Value, pointer: &str) -> Option<&'a Value> {
    pointer.split('/').skip(1).try_fold(document, |value, name| match value {
        Value::Object(fields) => fields.get(name),
        Value::Array(items) => items.get(name.parse::<usize>().ok()?),
        _ => None,
    })
}

/// Checks that a section belongs to the experiment, and is an object of known names or a list of such objects.
fn check_section(section: &Section, experiment: Option<&str>, document: &Value, faults: &mut Vec<Fault>) {
    let Some(written) = document.pointer(section.pointer) else { return };
    if !belongs(section, experiment) {
        // The sections inside it are not listed as well.
        if section.pointer.matches('/').count() == 1 {
            let only = section.experiment.unwrap_or_default();
            let detail = format!("belongs to the experiment \"{only}\"");
            let allowed = experiment.map(|experiment| format!("nothing here in \"{experiment}\""));
            faults.push(Fault::new(section.pointer, written, detail, allowed));
        }
        return;
    }
    match (section.items, written) {
        (None, Value::Object(object)) => check_names(section.pointer, object, faults),
        (None, other) => faults.push(Fault::new(section.pointer, other, must_be("an object", other), None)),
        (Some(_), Value::Array(items)) if items.len() > section.max_items => {
            let allowed = Some(format!("at most {}", section.max_items));
            let detail = format!("has {} items", items.len());
            faults.push(Fault::new(section.pointer, &Value::Null, detail, allowed));
        }
        (Some(_), Value::Array(items)) => {
            for (index, item) in items.iter().enumerate() {
                let pointer = format!("{}/{index}", section.pointer);
                match item.as_object() {
                    Some(object) => check_names(&pointer, object, faults),
                    None => faults.push(Fault::new(&pointer, item, must_be("an object", item), None)),
                }
            }
        }
        (Some(_), other) => faults.push(Fault::new(section.pointer, other, must_be("a list", other), None)),
    }
}

/// Lists the names that are no fields.
fn check_names(section: &str, object: &Map<String, Value>, faults: &mut Vec<Fault>) {
    let known = names_in(section);
    let mut unknown = object.iter().filter(|(name, _)| !known.contains(&name.as_str()));
    for (name, value) in unknown.by_ref().take(MAX_UNKNOWN) {
        let pointer = format!("{section}/{}", escape(name));
        faults.push(unknown_field(&pointer, value, nearest(&pointer), known));
    }
    let rest = unknown.count();
    if rest > 0 {
        faults.push(Fault::new(section, &Value::Null, format!("has {rest} more unknown fields"), None));
    }
}

/// Every sound field: as written, or by its default. Fields at fault are left out.
fn fill(document: &Value, experiment: Option<&str>, faults: &mut Vec<Fault>) -> Value {
    let mut completed = Value::Object(Map::new());
    for own in fields_of(experiment) {
        if let Some(value) = field_value(own, own.field.pointer, document, &completed, faults) {
            put(&mut completed, own.field.pointer, value);
        }
    }
    for section in SECTIONS.iter().filter(|section| belongs(section, experiment)) {
        let Some(items) = section.items else { continue };
        let written = document.pointer(section.pointer).and_then(Value::as_array);
        let count = written.map_or(0, |items| items.len().min(section.max_items));
        let list = (0..count).map(|index| {
            let mut item = Value::Object(Map::new());
            for field in FIELDS.iter() {
                let Some(name) = field.pointer.strip_prefix(items) else { continue };
                let pointer = format!("{}/{index}{name}", section.pointer);
                let is_object = document.pointer(section.pointer).is_some_and(|list| list[index].is_object());
                if !is_object {
                    continue;
                }
                if let Some(value) =
                    field_value(&OwnField::new(field, None), &pointer, document, &completed, faults)
                {
                    put(&mut item, name, value);
                }
            }
            item
        });
        let list = list.collect();
        put(&mut completed, section.pointer, list);
    }
    completed
}

/// The value of the field at `pointer`, as written or by its default; none when it is at fault.
fn field_value(
    own: &OwnField,
    pointer: &str,
    document: &Value,
    completed: &Value,
    faults: &mut Vec<Fault>,
) -> Option<Value> {
    let field = own.field;
    match value_at(document, pointer) {
        Some(written) => {
            let value = accept(field, pointer, written, faults)?;
            let default = default(own, completed);
            // A scenario with every default written out is sound; only another value is at fault.
            if let Some(experiment) = own.refused_by.filter(|_| default.as_ref() != Some(&value)) {
                let detail = format!("means nothing in the experiment \"{experiment}\"");
                faults.push(Fault::new(pointer, written, detail, Some("nothing here".to_owned())));
                return None;
            }
            Some(value)
        }
        None if field.default == Preset::Required => {
            let detail = match pointer {
                "/experiment" => "is missing, and is the one field that must be there",
                _ => "is missing",
            };
            faults.push(Fault::new(pointer, &Value::Null, detail.to_owned(), Some(field.allowed())));
            None
        }
        None => default(own, completed),
    }
}

/// The default of a field; none when the field that it copies is at fault.
fn default(own: &OwnField, completed: &Value) -> Option<Value> {
    let field = own.field;
    let given = |pointer: &str| value_at(completed, pointer).is_some_and(|value| !value.is_null());
    let wet = || value_at(completed, "/contact/condition").is_some_and(|condition| condition == "wet");
    if field.yields_to.is_some_and(given) {
        return Some(Value::Null);
    }
    match field.wet.filter(|_| wet()).unwrap_or(own.default) {
        Preset::SameAs(other) => value_at(completed, other).cloned(),
        preset => preset.value(),
    }
}

/// The written value in the form the typed scenario reads, or its faults.
fn accept(field: &Field, pointer: &str, written: &Value, faults: &mut Vec<Fault>) -> Option<Value> {
    let mut refuse = |detail: String| {
        faults.push(Fault::new(pointer, written, detail, Some(field.allowed())));
        None
    };
    match (field.kind, written) {
        (
            FieldKind::Nullable(_) | FieldKind::NullableInteger(_) | FieldKind::Mesh | FieldKind::Plate(_),
            Value::Null,
        ) => Some(Value::Null),
        (FieldKind::NumberOrAuto(_), Value::String(word)) if word == "auto" => Some(written.clone()),
        (
            FieldKind::Number(range)
            | FieldKind::Nullable(range)
            | FieldKind::NumberOrAuto(range)
            | FieldKind::Integer(range)
            | FieldKind::NullableInteger(range),
            Value::Number(number),
        ) => {
            let number = number.as_f64().unwrap_or(f64::NAN);
            let whole = matches!(field.kind, FieldKind::Integer(_) | FieldKind::NullableInteger(_));
            if !range.contains(number) {
                refuse("is out of range".to_owned())
            } else if !whole {
                Some(Value::from(number))
            } else if number.fract() != 0.0 {
                refuse("must be a whole number".to_owned())
            } else {
                // Exact: the range of every integer field ends below 2^53.
                Some(Value::from(number as u64))
            }
        }
        (FieldKind::Choice(words), Value::String(word)) if words.contains(&word.as_str()) => {
            Some(written.clone())
        }
        (FieldKind::Choice(_), Value::String(_)) => refuse("is not among the choices".to_owned()),
        (FieldKind::Flag, Value::Bool(_)) => Some(written.clone()),
        (FieldKind::Text, Value::String(text)) if text.is_empty() => refuse("is empty".to_owned()),
        (FieldKind::Text, Value::String(text)) if text.chars().count() > LONGEST_TEXT => {
            refuse("is too long".to_owned())
        }
        (FieldKind::Text, Value::String(_)) => Some(written.clone()),
        (FieldKind::Sizes(_), Value::Array(sizes)) if !(1..=MAX_SIZES).contains(&sizes.len()) => {
            refuse("has the wrong number of sizes".to_owned())
        }
        (FieldKind::Sizes(range), Value::Array(_)) => {
            Numbers { field, range, whole: false }.rows(pointer, written, None, faults)
        }
        (FieldKind::Plate(range), Value::Array(_)) => {
            Numbers { field, range, whole: false }.rows(pointer, written, Some(3), faults)
        }
        (FieldKind::Vector(range), Value::Array(_)) => {
            Numbers { field, range, whole: false }.row(pointer, written, faults)
        }
        (FieldKind::Counts(range), Value::Array(_)) => {
            Numbers { field, range, whole: true }.row(pointer, written, faults)
        }
        (FieldKind::Mesh, Value::Object(mesh)) => accept_mesh(field, pointer, mesh, faults),
        (FieldKind::Sizes(_) | FieldKind::Vector(_) | FieldKind::Counts(_) | FieldKind::Plate(_), _) => {
            refuse(must_be("a list", written))
        }
        (FieldKind::Mesh, _) => refuse(must_be("an object", written)),
        (FieldKind::Choice(_) | FieldKind::Text, _) => refuse(must_be("a string", written)),
        (FieldKind::Flag, _) => refuse(must_be("true or false", written)),
        _ => refuse(must_be("a number", written)),
    }
}

/// Reads lists of numbers, and reports each wrong number at its pointer.
struct Numbers<'a> {
    field: &'a Field,
    range: Range,
    whole: bool,
}

impl Numbers<'_> {
    /// Three numbers in the range.
    fn row(&self, pointer: &str, written: &Value, faults: &mut Vec<Fault>) -> Option<Value> {
        let mut refuse = |pointer: &str, value: &Value, detail: String| {
            faults.push(Fault::new(pointer, value, detail, Some(self.field.allowed())));
        };
        let Some(numbers @ [_, _, _]) = written.as_array().map(Vec::as_slice) else {
            let wanted = match self.field.kind {
                FieldKind::Sizes(_) => "must be a list of length, width and thickness",
                _ => "must be a list of three numbers",
            };
            refuse(pointer, written, wanted.to_owned());
            return None;
        };
        let mut row = Vec::new();
        for (axis, value) in numbers.iter().enumerate() {
            let at = format!("{pointer}/{axis}");
            match value.as_f64() {
                None => refuse(&at, value, must_be("a number", value)),
                Some(number) if !self.range.contains(number) => {
                    refuse(&at, value, "is out of range".to_owned())
                }
                Some(number) if self.whole && number.fract() != 0.0 => {
                    refuse(&at, value, "must be a whole number".to_owned())
                }
                Some(number) if self.whole => row.push(Value::from(number as u64)),
                Some(number) => row.push(Value::from(number)),
            }
        }
        (row.len() == 3).then_some(Value::Array(row))
    }

    /// Rows of three numbers, as many as wanted.
    fn rows(
        &self,
        pointer: &str,
        written: &Value,
        wanted: Option<usize>,
        faults: &mut Vec<Fault>,
    ) -> Option<Value> {
        let rows = written.as_array()?;
        if wanted.is_some_and(|wanted| rows.len() != wanted) {
            let detail = "must be a corner and two edges".to_owned();
            faults.push(Fault::new(pointer, written, detail, Some(self.field.allowed())));
            return None;
        }
        let read = |(index, row)| self.row(&format!("{pointer}/{index}"), row, faults);
        let read: Vec<Option<Value>> = rows.iter().enumerate().map(read).collect();
        read.into_iter().collect()
    }
}

/// A mesh by the digest of its file.
fn accept_mesh(
    field: &Field,
    pointer: &str,
    mesh: &Map<String, Value>,
    faults: &mut Vec<Fault>,
) -> Option<Value> {
    let before = faults.len();
    let mut refuse = |name: &str, value: &Value, detail: &str| {
        let at = format!("{pointer}/{}", escape(name));
        let allowed = match name {
            "units" => "\"mm\" or \"m\"".to_owned(),
            _ => field.allowed(),
        };
        faults.push(Fault::new(&at, value, detail.to_owned(), Some(allowed)));
    };
    let hex = |text: &str| {
        text.len() == 64 && text.bytes().all(|byte| byte.is_ascii_digit() || (b'a'..=b'f').contains(&byte))
    };
    match mesh.get("digest") {
        None => refuse("digest", &Value::Null, "is missing"),
        Some(Value::String(digest)) if hex(digest) => {}
        Some(other) => refuse("digest", other, "is no digest of 64 lower-case hexadecimal digits"),
    }
    match mesh.get("units") {
        None => {
            refuse("units", &Value::Null, "is missing: an STL file does not tell the unit of its coordinates")
        }
        Some(Value::String(units)) if units == "mm" || units == "m" => {}
        Some(other) => refuse("units", other, "is not among the choices"),
    }
    for (name, value) in
        mesh.iter().filter(|(name, _)| !["digest", "units"].contains(&name.as_str())).take(MAX_UNKNOWN)
    {
        refuse(name, value, "is not a known field");
    }
    (faults.len() == before).then(|| Value::Object(mesh.clone()))
}

/// Puts a value into the document, making the sections on the way.
fn put(document: &mut Value, pointer: &str, value: Value) {
    let mut place = document;
    for name in pointer.split('/').skip(1) {
        place = &mut place[name];
    }
    *place = value;
}
