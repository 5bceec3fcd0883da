//! Constructors of rows of the field table, and ranges that several rows share.

use super::field::{Field, FieldKind, Preset, Range, Section, from_to};

pub(super) const ORIGIN: Preset = Preset::Vector([0.0; 3]);
pub(super) const PLACE: Range = from_to(-100.0, 100.0);
pub(super) const SPEED: Range = from_to(-100.0, 100.0);
pub(super) const ANGLE: Range = from_to(-180.0, 180.0);
pub(super) const SCATTER: Range = from_to(0.0, 180.0);
pub(super) const FRICTION: Range = from_to(0.0, 5.0);

pub(super) const fn field(
    pointer: &'static str,
    kind: FieldKind,
    unit: &'static str,
    default: Preset,
    source: &'static str,
    doc: &'static str,
) -> Field {
    Field {
        pointer,
        kind,
        unit,
        default,
        wet: None,
        by_name: false,
        otherwise: None,
        yields_to: None,
        from_start: false,
        source,
        doc,
    }
}

pub(super) const fn number(
    pointer: &'static str,
    unit: &'static str,
    default: f64,
    range: Range,
    source: &'static str,
    doc: &'static str,
) -> Field {
    field(pointer, FieldKind::Number(range), unit, Preset::Number(default), source, doc)
}

pub(super) const fn nullable(
    pointer: &'static str,
    unit: &'static str,
    range: Range,
    source: &'static str,
    doc: &'static str,
) -> Field {
    field(pointer, FieldKind::Nullable(range), unit, Preset::Null, source, doc)
}

pub(super) const fn integer(
    pointer: &'static str,
    default: u64,
    range: Range,
    source: &'static str,
    doc: &'static str,
) -> Field {
    field(pointer, FieldKind::Integer(range), "", Preset::Integer(default), source, doc)
}

/// The first word is the default.
pub(super) const fn choice(
    pointer: &'static str,
    words: &'static [&'static str],
    source: &'static str,
    doc: &'static str,
) -> Field {
    field(pointer, FieldKind::Choice(words), "", Preset::Word(words[0]), source, doc)
}

pub(super) const fn flag(
    pointer: &'static str,
    default: bool,
    source: &'static str,
    doc: &'static str,
) -> Field {
    field(pointer, FieldKind::Flag, "", Preset::Flag(default), source, doc)
}

pub(super) const fn same_as(
    other: &'static str,
    pointer: &'static str,
    unit: &'static str,
    range: Range,
    source: &'static str,
    doc: &'static str,
) -> Field {
    field(pointer, FieldKind::Number(range), unit, Preset::SameAs(other), source, doc)
}

pub(super) const fn vector(
    pointer: &'static str,
    unit: &'static str,
    default: Preset,
    range: Range,
    source: &'static str,
    doc: &'static str,
) -> Field {
    field(pointer, FieldKind::Vector(range), unit, default, source, doc)
}

/// An object of fields.
pub(super) const fn section(
    pointer: &'static str,
    experiment: Option<&'static str>,
    doc: &'static str,
) -> Section {
    Section { pointer, items: None, max_items: 0, experiment, doc }
}

/// A list of objects, with the pointer of their fields in the table and their maximum number.
pub(super) const fn list(
    pointer: &'static str,
    items: &'static str,
    max_items: usize,
    experiment: Option<&'static str>,
    doc: &'static str,
) -> Section {
    Section { pointer, items: Some(items), max_items, experiment, doc }
}

impl Field {
    pub(super) const fn wet(self, number: f64) -> Self {
        Self { wet: Some(Preset::Number(number)), ..self }
    }

    /// Belongs only to the experiments that name it.
    pub(super) const fn by_name(self) -> Self {
        Self { by_name: true, ..self }
    }

    /// Belongs only to the experiments that name it, and holds `value` in the others.
    pub(super) const fn by_name_or(self, value: Preset) -> Self {
        Self { by_name: true, otherwise: Some(value), ..self }
    }

    /// Acts only from t = 0 on.
    pub(super) const fn acts_from_start(self) -> Self {
        Self { from_start: true, ..self }
    }

    pub(super) const fn yields_to(self, other: &'static str) -> Self {
        Self { yields_to: Some(other), ..self }
    }
}
