//! The shape of a document, from its JSON Schema. One walk over a document lists every fault.

use std::collections::BTreeMap;

use roost_api::Fault;
use roost_solver::scenario::{most_similar, must_be, unknown_field};
use serde_json::{Map, Value, json};
use utoipa::ToSchema;
use uuid::Uuid;

use super::place::Place;

/// Maximum of faults that are listed of the shape of one document.
pub(crate) const MAX_FAULTS: usize = 50;

/// The values that a place of a document accepts.
pub(crate) struct Shape {
    pub(super) rule: Rule,
    is_nullable: bool,
}

pub(super) enum Rule {
    /// Any JSON value: another reader checks it.
    Any,
    /// Any object: another reader checks it. The placeholder is the example of the schema.
    Document {
        placeholder: Value,
    },
    Flag,
    Text,
    Id,
    Number {
        low: f64,
        high: f64,
    },
    Integer {
        low: i128,
        high: i128,
    },
    Words(Vec<String>),
    List(Box<Shape>),
    Map(Box<Shape>),
    Object {
        fields: BTreeMap<String, Field>,
        /// Whether unknown fields are faults.
        is_closed: bool,
    },
}

pub(super) struct Field {
    pub(super) shape: Shape,
    is_required: bool,
}

impl Shape {
    /// The shape of a type, from the schema that OpenAPI publishes.
    pub(super) fn of<T: ToSchema>() -> Self {
        let mut named = Vec::new();
        T::schemas(&mut named);
        let named: Map<String, Value> =
            named.into_iter().map(|(name, schema)| (name, json!(schema))).collect();
        Self::compile(&json!(T::schema()), &named)
    }

    pub(super) fn compile(schema: &Value, named: &Map<String, Value>) -> Self {
        if let Some(name) = schema["$ref"].as_str().and_then(|pointer| pointer.rsplit('/').next()) {
            return named.get(name).map_or(Self::any(), |schema| Self::compile(schema, named));
        }
        if let Some(parts) = ["oneOf", "allOf", "anyOf"].iter().find_map(|key| schema[*key].as_array()) {
            let is_null = |part: &&Value| part["type"] == "null";
            let part = parts.iter().find(|part| !is_null(part));
            let shape = part.map_or(Self::any(), |part| Self::compile(part, named));
            return Self {
                is_nullable: shape.is_nullable || parts.iter().any(|part| is_null(&part)),
                ..shape
            };
        }
        let types = match &schema["type"] {
            Value::Array(types) => types.as_slice(),
            one => std::slice::from_ref(one),
        };
        let kind = types.iter().filter_map(Value::as_str).find(|kind| *kind != "null");
        let rule = match kind {
            Some("boolean") => Rule::Flag,
            Some("string") => match schema["enum"].as_array() {
                Some(words) => {
                    Rule::Words(words.iter().filter_map(Value::as_str).map(str::to_owned).collect())
                }
                None if schema["format"] == "uuid" => Rule::Id,
                None => Rule::Text,
            },
            Some("number") => Rule::Number {
                low: schema["minimum"].as_f64().unwrap_or(f64::NEG_INFINITY),
                high: schema["maximum"].as_f64().unwrap_or(f64::INFINITY),
            },
            Some("integer") => integer(schema),
            Some("array") => Rule::List(Box::new(Self::compile(&schema["items"], named))),
            Some("object") => object(schema, named),
            _ => Rule::Any,
        };
        Self { rule, is_nullable: types.iter().any(|kind| kind == "null") }
    }

    fn any() -> Self {
        Self { rule: Rule::Any, is_nullable: true }
    }

    /// The value, with a placeholder for every required part that is at fault; `None` when all of it is.
    pub(super) fn settle(&self, value: Value, place: &Place<'_>, faults: &mut Vec<Fault>) -> Option<Value> {
        let (value, detail) = match (&self.rule, value) {
            (_, Value::Null) if self.is_nullable => return Some(Value::Null),
            (Rule::Any, value) => return Some(value),
            (Rule::Flag, value @ Value::Bool(_))
            | (Rule::Text, value @ Value::String(_))
            | (Rule::Document { .. }, value @ Value::Object(_)) => return Some(value),
            (Rule::List(item), Value::Array(items)) => {
                let settle = |(index, value)| {
                    let settled = item.settle(value, &place.item(index), faults);
                    settled.unwrap_or_else(|| item.placeholder())
                };
                return Some(items.into_iter().enumerate().map(settle).collect());
            }
            (Rule::Map(item), Value::Object(entries)) => {
                let settle = |(name, value): (String, Value)| {
                    let settled = item.settle(value, &place.field(&name), faults)?;
                    Some((name, settled))
                };
                return Some(entries.into_iter().filter_map(settle).collect());
            }
            (Rule::Object { fields, is_closed }, Value::Object(written)) => {
                return Some(settle_fields(fields, *is_closed, written, place, faults));
            }
            (Rule::Words(words), Value::String(word)) if words.contains(&word) => return Some(word.into()),
            (Rule::Id, Value::String(text)) if Uuid::parse_str(&text).is_ok() => return Some(text.into()),
            (Rule::Number { low, high }, Value::Number(number)) => {
                if number.as_f64().is_some_and(|number| (*low..=*high).contains(&number)) {
                    return Some(Value::Number(number));
                }
                (Value::Number(number), "is out of range".to_owned())
            }
            (Rule::Integer { low, high }, Value::Number(number)) => {
                match number.as_i128().map(|number| (*low..=*high).contains(&number)) {
                    Some(true) => return Some(Value::Number(number)),
                    Some(false) => (Value::Number(number), "is out of range".to_owned()),
                    None => (Value::Number(number), "must be a whole number".to_owned()),
                }
            }
            (Rule::Words(_), value @ Value::String(_)) => (value, "is not among the choices".to_owned()),
            (_, value) => {
                let detail = must_be(self.noun(), &value);
                (value, detail)
            }
        };
        push(faults, || Fault::new(&place.to_string(), &value, detail, self.allowed()));
        None
    }

    /// A value of this shape.
    pub(super) fn placeholder(&self) -> Value {
        match &self.rule {
            _ if self.is_nullable => Value::Null,
            Rule::Any => Value::Null,
            Rule::Document { placeholder } => placeholder.clone(),
            Rule::Flag => json!(false),
            Rule::Text => json!(""),
            Rule::Id => json!(Uuid::nil()),
            Rule::Number { low, .. } => json!(if low.is_finite() { *low } else { 0.0 }),
            Rule::Integer { low, .. } => json!((*low).max(0) as u64),
            Rule::Words(words) => json!(words.first()),
            Rule::List(_) => json!([]),
            Rule::Map(_) => json!({}),
            Rule::Object { fields, .. } => {
                let required = fields.iter().filter(|(_, field)| field.is_required);
                required.map(|(name, field)| (name.clone(), field.shape.placeholder())).collect()
            }
        }
    }

    pub(super) fn noun(&self) -> &'static str {
        match &self.rule {
            Rule::Any => "JSON",
            Rule::Flag => "true or false",
            Rule::Text | Rule::Words(_) => "a string",
            Rule::Id => "a UUID",
            Rule::Number { .. } => "a number",
            Rule::Integer { .. } => "a whole number",
            Rule::List(_) => "a list",
            Rule::Document { .. } | Rule::Map(_) | Rule::Object { .. } => "an object",
        }
    }

    /// The accepted values in words.
    fn allowed(&self) -> Option<String> {
        let values = match &self.rule {
            Rule::Any => return None,
            Rule::Words(words) => words.join(", "),
            Rule::Number { low, high } if low.is_finite() && high.is_finite() => {
                format!("a number from {low} to {high}")
            }
            Rule::Integer { low: 0, high } if *high >= i64::MAX.into() => {
                "a whole number, 0 or more".to_owned()
            }
            Rule::Integer { low, high } => format!("a whole number from {low} to {high}"),
            _ => self.noun().to_owned(),
        };
        Some(if self.is_nullable { format!("{values} or null") } else { values })
    }
}

fn integer(schema: &Value) -> Rule {
    let bound = |name: &str| schema[name].as_f64().map(|bound| bound as i128);
    let (minimum, maximum) = (bound("minimum"), bound("maximum"));
    let is_unsigned = minimum.is_some_and(|minimum| minimum >= 0);
    // utoipa writes `u-int32` for u32.
    let (low, high) = match schema["format"].as_str() {
        Some("int32") if !is_unsigned => (i32::MIN.into(), i32::MAX.into()),
        Some("int32" | "uint32" | "u-int32") => (0, u32::MAX.into()),
        Some("uint64" | "u-int64") => (0, u64::MAX.into()),
        Some("int64") | None if is_unsigned => (0, u64::MAX.into()),
        Some("int64") | None => (i64::MIN.into(), i64::MAX.into()),
        Some(format) => panic!("integers of the format {format} have no range here: add it"),
    };
    Rule::Integer { low: minimum.unwrap_or(low), high: maximum.unwrap_or(high) }
}

fn object(schema: &Value, named: &Map<String, Value>) -> Rule {
    let extra = &schema["additionalProperties"];
    let Some(properties) = schema["properties"].as_object() else {
        // An object without any description is a document of its own, and its reader checks its type as well.
        return match (extra, &schema["examples"][0]) {
            (Value::Object(_), _) => Rule::Map(Box::new(Shape::compile(extra, named))),
            (_, Value::Null) => Rule::Any,
            (_, example) => Rule::Document { placeholder: example.clone() },
        };
    };
    let required = schema["required"].as_array().map_or(&[][..], Vec::as_slice);
    let field = |(name, schema): (&String, &Value)| {
        let is_required = required.iter().any(|required| required == name);
        (name.clone(), Field { shape: Shape::compile(schema, named), is_required })
    };
    Rule::Object { fields: properties.iter().map(field).collect(), is_closed: *extra == false }
}

/// Words that people use for a field, and the field.
const SYNONYMS: [(&str, &str); 3] =
    [("seeds", "replicates"), ("repeats", "replicates"), ("runs", "replicates")];

fn settle_fields(
    fields: &BTreeMap<String, Field>,
    is_closed: bool,
    written: Map<String, Value>,
    place: &Place<'_>,
    faults: &mut Vec<Fault>,
) -> Value {
    let missing: Vec<_> =
        fields.iter().filter(|(name, field)| field.is_required && !written.contains_key(*name)).collect();
    let mut settled = Map::new();
    for (name, value) in written {
        let at = place.field(&name);
        match fields.get(&name) {
            Some(field) => {
                let value = field.shape.settle(value, &at, faults);
                let value = value.or_else(|| field.is_required.then(|| field.shape.placeholder()));
                settled.extend(value.map(|value| (name, value)));
            }
            None if is_closed => push(faults, || {
                let known: Vec<&str> = fields.keys().map(String::as_str).collect();
                let synonym = SYNONYMS.iter().find(|(word, field)| *word == name && known.contains(field));
                let synonym = synonym.map(|(_, field)| *field);
                let nearest = synonym.or_else(|| most_similar(&name, known.iter().copied()));
                unknown_field(&at.to_string(), &value, nearest, &known)
            }),
            None => drop(settled.insert(name, value)),
        }
    }
    for (name, field) in missing {
        let at = place.field(name);
        let detail = "is missing".to_owned();
        push(faults, || Fault::new(&at.to_string(), &Value::Null, detail, field.shape.allowed()));
        settled.insert(name.clone(), field.shape.placeholder());
    }
    Value::Object(settled)
}

fn push(faults: &mut Vec<Fault>, fault: impl FnOnce() -> Fault) {
    if faults.len() < MAX_FAULTS {
        faults.push(fault());
    }
}
