//! A place in a document.

use std::fmt;

use roost_solver::scenario::escape;

/// A place in a document. It becomes a JSON pointer only where something is wrong: long lists have none made.
pub(super) enum Place<'a> {
    Root,
    Field(&'a Place<'a>, &'a str),
    Item(&'a Place<'a>, usize),
}

impl Place<'_> {
    pub(super) fn field<'a>(&'a self, name: &'a str) -> Place<'a> {
        Place::Field(self, name)
    }

    pub(super) fn item(&self, index: usize) -> Place<'_> {
        Place::Item(self, index)
    }
}

impl fmt::Display for Place<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Place::Root => Ok(()),
            Place::Field(parent, name) => write!(f, "{parent}/{}", escape(name)),
            Place::Item(parent, index) => write!(f, "{parent}/{index}"),
        }
    }
}
