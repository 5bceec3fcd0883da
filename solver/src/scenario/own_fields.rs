//! The fields of an experiment: those of its own sections, those that every experiment has, and those that it names.

use std::sync::LazyLock;

use super::field::{Field, Preset, Section};
use super::fields::{FIELDS, SECTIONS};
use super::sections::DECLARATIONS;
use super::sections::Declaration;

/// Whether a section belongs to this experiment. Without an experiment, every section does.
pub(super) fn belongs(section: &Section, experiment: Option<&str>) -> bool {
    section.experiment.is_none_or(|only| experiment.is_none_or(|experiment| experiment == only))
}

/// A field as an experiment has it.
pub(super) struct OwnField {
    pub(super) field: &'static Field,
    /// The default in this experiment.
    pub(super) default: Preset,
    /// The experiment, if it does not take the field: then only the default may be written.
    pub(super) refused_by: Option<&'static str>,
}

impl OwnField {
    pub(super) fn new(field: &'static Field, declaration: Option<&'static Declaration>) -> Self {
        Self {
            field,
            default: declaration.map_or(field.default, |declaration| declaration.default_of(field)),
            refused_by: declaration.filter(|one| !one.takes(field)).map(|one| one.name),
        }
    }
}

/// The fields of an experiment, without those in lists.
pub(super) fn fields_of(experiment: Option<&str>) -> &'static [OwnField] {
    static ALL: LazyLock<Vec<(Option<&str>, Vec<OwnField>)>> = LazyLock::new(|| {
        let of = |one: Option<&'static Declaration>| {
            let name = one.map(|one| one.name);
            let own = |field: &&Field| !field.pointer.contains('*') && field_belongs(field, name);
            (name, FIELDS.iter().filter(own).map(|field| OwnField::new(field, one)).collect())
        };
        DECLARATIONS.iter().copied().map(Some).chain([None]).map(of).collect()
    });
    ALL.iter().find(|(known, _)| *known == experiment).map_or(&[], |(_, fields)| fields.as_slice())
}

/// Whether the sections of a field belong to this experiment.
fn field_belongs(field: &Field, experiment: Option<&str>) -> bool {
    let inside = |section: &&Section| {
        field.pointer.strip_prefix(section.pointer).is_some_and(|rest| rest.starts_with('/'))
    };
    SECTIONS.iter().filter(inside).all(|section| belongs(section, experiment))
}
