//! Queries whose text depends on data: filters of listings, and rows to insert.

use super::query::Query;
use super::value::Value;

/// A query that is built piece by piece.
pub(in crate::store) struct Builder {
    text: String,
    values: Vec<Value>,
}

impl Builder {
    /// Begins with a text.
    pub(in crate::store) fn new(text: &str) -> Self {
        Self { text: text.to_owned(), values: Vec::new() }
    }

    /// Appends a text of the program; never one of a user.
    pub(in crate::store) fn push(&mut self, text: impl AsRef<str>) -> &mut Self {
        self.text.push_str(text.as_ref());
        self
    }

    /// Appends a parameter.
    pub(in crate::store) fn push_bind(&mut self, value: impl Into<Value>) -> &mut Self {
        self.text.push('?');
        self.values.push(value.into());
        self
    }

    /// Appends `VALUES` with a row for each item.
    pub(in crate::store) fn push_values<I>(
        &mut self,
        items: impl IntoIterator<Item = I>,
        mut push: impl FnMut(Values<'_>, I),
    ) -> &mut Self {
        self.push("VALUES ");
        for (number, item) in items.into_iter().enumerate() {
            self.push(if number == 0 { "(" } else { ", (" });
            push(Values { builder: self, is_first: true }, item);
            self.push(")");
        }
        self
    }

    /// The query.
    pub(in crate::store) fn build(&mut self) -> Query {
        Query::built(std::mem::take(&mut self.text), std::mem::take(&mut self.values))
    }
}

/// The values of a row.
pub(in crate::store) struct Values<'b> {
    builder: &'b mut Builder,
    is_first: bool,
}

impl Values<'_> {
    /// Appends a value.
    pub(in crate::store) fn push_bind(&mut self, value: impl Into<Value>) -> &mut Self {
        if !std::mem::replace(&mut self.is_first, false) {
            self.builder.push(", ");
        }
        self.builder.push_bind(value);
        self
    }
}
