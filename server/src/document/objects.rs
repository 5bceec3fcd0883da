//! Finds lists in place of objects, without building the document: serde reads the items of such a list as the
//! fields of a struct, in their order.

use std::borrow::Cow;
use std::fmt;

use serde::de::{DeserializeSeed, Deserializer, Error, IgnoredAny, MapAccess, SeqAccess, Visitor};

use super::shape::{Rule, Shape};

/// Whether the text is JSON without a list in place of an object.
pub(super) fn has_its_objects(shape: &Shape, text: &[u8]) -> bool {
    shape.deserialize(&mut serde_json::Deserializer::from_slice(text)).is_ok()
}

impl<'de> DeserializeSeed<'de> for &Shape {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        match self.rule {
            Rule::List(_) | Rule::Map(_) | Rule::Object { .. } | Rule::Document { .. } => {
                deserializer.deserialize_any(self)
            }
            _ => deserializer.deserialize_ignored_any(IgnoredAny).map(drop),
        }
    }
}

impl<'de> Visitor<'de> for &Shape {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.noun())
    }

    fn visit_unit<E: Error>(self) -> Result<(), E> {
        Ok(())
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<(), A::Error> {
        let Rule::List(item) = &self.rule else {
            return Err(A::Error::custom("a list in place of an object"));
        };
        while items.next_element_seed(&**item)?.is_some() {}
        Ok(())
    }

    fn visit_map<A: MapAccess<'de>>(self, mut entries: A) -> Result<(), A::Error> {
        while let Some(name) = entries.next_key::<Cow<'de, str>>()? {
            let shape = match &self.rule {
                Rule::Object { fields, .. } => fields.get(&*name).map(|field| &field.shape),
                Rule::Map(item) => Some(&**item),
                _ => None,
            };
            match shape {
                Some(shape) => entries.next_value_seed(shape)?,
                None => drop(entries.next_value::<IgnoredAny>()?),
            }
        }
        Ok(())
    }
}
