//! The fields that a monitor has gathered, as bytes.

use serde::Serialize;
use serde::de::DeserializeOwned;
use thiserror::Error;

/// Fields of a monitor.
#[derive(Clone, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct SavedFields(Vec<u8>);

/// The fields are not those of this monitor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("the observations are not those of this scenario")]
pub struct SavedFieldsError;

impl SavedFields {
    /// Saves a tuple of references to fields.
    pub fn of(fields: &impl Serialize) -> Self {
        Self(postcard::to_allocvec(fields).expect("fields are numbers and lists of them"))
    }

    /// Reads a tuple of fields.
    ///
    /// # Errors
    /// Bytes that are not these fields, or that go on after them.
    pub fn read<T: DeserializeOwned>(&self) -> Result<T, SavedFieldsError> {
        match postcard::take_from_bytes(&self.0) {
            Ok((fields, [])) => Ok(fields),
            _ => Err(SavedFieldsError),
        }
    }
}
