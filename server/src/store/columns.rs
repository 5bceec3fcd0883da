//! Reading columns back into the words and types of the API.

use std::str::FromStr;

use roost_api::time::Timestamp;
use serde::de::DeserializeOwned;

use super::StoreError;
use super::database::{FromValue, Row};

/// Typed access to the columns of a row, by name.
pub(super) trait Columns {
    /// A column as the database has it.
    fn column<T: FromValue>(&self, name: &'static str) -> Result<T, StoreError>;

    /// A column that holds a word or an identifier.
    fn parsed<T: FromStr<Err: std::fmt::Display>>(&self, name: &'static str) -> Result<T, StoreError> {
        let text: String = self.column(name)?;
        text.parse().map_err(|error: T::Err| corrupt(name, error))
    }

    /// The same, or null.
    fn parsed_opt<T: FromStr<Err: std::fmt::Display>>(
        &self,
        name: &'static str,
    ) -> Result<Option<T>, StoreError> {
        let text: Option<String> = self.column(name)?;
        text.map(|text| text.parse().map_err(|error: T::Err| corrupt(name, error))).transpose()
    }

    /// A column that holds JSON; the default where it is null.
    fn json<T: DeserializeOwned + Default>(&self, name: &'static str) -> Result<T, StoreError> {
        let text: Option<String> = self.column(name)?;
        text.map_or_else(|| Ok(T::default()), |text| from_json(name, &text))
    }

    /// A column that holds an unsigned number.
    fn number<T: TryFrom<i64, Error: std::fmt::Display>>(&self, name: &'static str) -> Result<T, StoreError> {
        T::try_from(self.column(name)?).map_err(|error| corrupt(name, error))
    }

    /// The same, or null.
    fn number_opt<T: TryFrom<i64, Error: std::fmt::Display>>(
        &self,
        name: &'static str,
    ) -> Result<Option<T>, StoreError> {
        let number: Option<i64> = self.column(name)?;
        number.map(|number| T::try_from(number).map_err(|error| corrupt(name, error))).transpose()
    }

    /// A column that holds a moment.
    fn moment(&self, name: &'static str) -> Result<Timestamp, StoreError> {
        Ok(Timestamp(self.column(name)?))
    }

    /// The same, or null.
    fn moment_opt(&self, name: &'static str) -> Result<Option<Timestamp>, StoreError> {
        Ok(self.column::<Option<i64>>(name)?.map(Timestamp))
    }
}

impl Columns for Row {
    fn column<T: FromValue>(&self, name: &'static str) -> Result<T, StoreError> {
        Ok(self.named(name)?)
    }
}

pub(super) fn corrupt(what: &'static str, error: impl std::fmt::Display) -> StoreError {
    StoreError::Corrupt { what, message: error.to_string() }
}

pub(super) fn from_json<T: DeserializeOwned>(what: &'static str, text: &str) -> Result<T, StoreError> {
    serde_json::from_str(text).map_err(|error| corrupt(what, error))
}

/// The JSON text of a value of ours.
pub(super) fn to_json(
    what: &'static str,
    value: &(impl serde::Serialize + ?Sized),
) -> Result<String, StoreError> {
    serde_json::to_string(value).map_err(|error| corrupt(what, error))
}
