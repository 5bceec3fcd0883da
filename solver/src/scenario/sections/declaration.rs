//! The declaration of an experiment: its name in documents, its own sections, and the shared fields that it takes.

use super::SurfaceSpec;
use crate::scenario::field::{Field, Preset, Section};

/// Everything that documents of an experiment may hold beyond the fields that every experiment has.
#[derive(Clone, Copy, Debug)]
pub struct Declaration {
    /// The word under `/experiment`.
    pub name: &'static str,
    /// The question that it answers, for overview pages.
    pub question: &'static str,
    /// Its own sections.
    pub sections: &'static [Section],
    /// The fields of its own sections.
    pub fields: &'static [Field],
    /// Pointers of the shared fields that it takes. It must name every field marked `by_name` that it reads.
    pub takes: &'static [&'static str],
    /// Defaults of shared fields that differ from the table.
    pub defaults: &'static [(&'static str, Preset)],
    /// Pairs of its own fields in ascending order.
    pub order: &'static [AtMost],
}

impl Declaration {
    /// Whether a shared field belongs to the experiment.
    pub fn takes(&self, field: &Field) -> bool {
        !field.by_name || self.takes.contains(&field.pointer)
    }

    /// The default of a shared field in the experiment. A field that the experiment does not take holds a fixed value.
    pub fn default_of(&self, field: &Field) -> Preset {
        if !self.takes(field) {
            return field.otherwise.unwrap_or(field.default);
        }
        let own = self.defaults.iter().find(|(pointer, _)| *pointer == field.pointer);
        own.map_or(field.default, |(_, preset)| *preset)
    }
}

/// A number that must not exceed another, and the consequence if it did.
#[derive(Clone, Copy, Debug)]
pub struct AtMost {
    /// Pointer of the smaller number.
    pub small: &'static str,
    /// Pointer of the larger number.
    pub large: &'static str,
    /// The consequence, in words.
    pub otherwise: &'static str,
}

/// The typed section of an experiment.
pub trait ExperimentSection {
    /// The surfaces that the document lists, with the pointer of the list.
    fn surfaces(&self) -> (&'static str, &[SurfaceSpec]) {
        ("", &[])
    }
}
