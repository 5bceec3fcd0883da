//! Values of parameters and columns.
//!
//! A null knows its type: PostgreSQL wants the type of every parameter.

use std::borrow::Cow;

use sqlx::error::BoxDynError;

/// The value of a parameter or column.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::store) enum Value {
    /// An integer or a boolean.
    Integer(Option<i64>),
    /// A real number.
    Real(Option<f64>),
    /// A text.
    Text(Option<String>),
    /// Bytes.
    Blob(Option<Vec<u8>>),
}

macro_rules! parameters {
    ($($of:ty => $kind:ident: $from:expr;)*) => {
        $(
            impl From<$of> for Value {
                fn from(value: $of) -> Self {
                    let convert: fn($of) -> _ = $from;
                    Self::$kind(Some(convert(value)))
                }
            }

            impl From<Option<$of>> for Value {
                fn from(value: Option<$of>) -> Self {
                    Self::$kind(value.map($from))
                }
            }
        )*
    };
}

parameters! {
    bool => Integer: i64::from;
    i32 => Integer: i64::from;
    i64 => Integer: |value| value;
    u16 => Integer: i64::from;
    u32 => Integer: i64::from;
    f64 => Real: |value| value;
    &str => Text: str::to_owned;
    String => Text: |value| value;
    Vec<u8> => Blob: |value| value;
}

macro_rules! references {
    ($($of:ty),*) => {
        $(impl From<&$of> for Value {
            fn from(value: &$of) -> Self {
                Self::from(*value)
            }
        })*
    };
}

references!(i64, u32);

impl From<&String> for Value {
    fn from(value: &String) -> Self {
        Self::Text(Some(value.clone()))
    }
}

impl From<Option<&String>> for Value {
    fn from(value: Option<&String>) -> Self {
        Self::Text(value.cloned())
    }
}

impl From<&Option<String>> for Value {
    fn from(value: &Option<String>) -> Self {
        Self::Text(value.clone())
    }
}

/// A type of columns.
pub(in crate::store) trait FromValue: Sized {
    /// Reads a value that is not null.
    fn from_value(value: Value) -> Option<Self>;

    /// The value for a null, if the type has one.
    fn null() -> Option<Self> {
        None
    }
}

impl FromValue for i64 {
    fn from_value(value: Value) -> Option<Self> {
        if let Value::Integer(number) = value { number } else { None }
    }
}

impl FromValue for bool {
    fn from_value(value: Value) -> Option<Self> {
        i64::from_value(value).map(|number| number != 0)
    }
}

impl FromValue for i32 {
    fn from_value(value: Value) -> Option<Self> {
        i64::from_value(value).and_then(|number| number.try_into().ok())
    }
}

impl FromValue for u32 {
    fn from_value(value: Value) -> Option<Self> {
        i64::from_value(value).and_then(|number| number.try_into().ok())
    }
}

impl FromValue for f64 {
    fn from_value(value: Value) -> Option<Self> {
        match value {
            Value::Real(number) => number,
            Value::Integer(number) => number.map(|number| number as f64),
            _ => None,
        }
    }
}

impl FromValue for String {
    fn from_value(value: Value) -> Option<Self> {
        if let Value::Text(text) = value { text } else { None }
    }
}

impl FromValue for Vec<u8> {
    fn from_value(value: Value) -> Option<Self> {
        if let Value::Blob(bytes) = value { bytes } else { None }
    }
}

impl<T: FromValue> FromValue for Option<T> {
    fn from_value(value: Value) -> Option<Self> {
        T::from_value(value).map(Some)
    }

    fn null() -> Option<Self> {
        Some(None)
    }
}

/// Reads a column; `None` is null.
pub(super) fn read<T: FromValue>(value: Option<Value>) -> Result<T, BoxDynError> {
    let name = std::any::type_name::<T>();
    match value {
        None => T::null().ok_or_else(|| format!("null is no {name}").into()),
        Some(value) => {
            let kind = value.kind();
            T::from_value(value).ok_or_else(|| format!("this {kind} is no {name}").into())
        }
    }
}

impl Value {
    fn kind(&self) -> &'static str {
        match self {
            Self::Integer(_) => "integer",
            Self::Real(_) => "real number",
            Self::Text(_) => "text",
            Self::Blob(_) => "blob",
        }
    }
}

/// A text that PostgreSQL stores: it has no character zero.
pub(super) fn without_zero(text: &str) -> Cow<'_, str> {
    if text.contains('\0') { text.replace('\0', "\u{fffd}").into() } else { text.into() }
}
