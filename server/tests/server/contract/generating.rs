//! Values by the JSON Schemas of the specification: valid values, arbitrary values, and valid values with one
//! change.

use std::collections::HashMap;

use serde_json::{Map, Value, json};

/// Deeper than any document of the API.
const DEEPEST: u32 = 6;

/// Generates values from one seed.
pub(super) struct ValueGenerator {
    pub random: fastrand::Rng,
    /// Existing identifiers by name of field or parameter: without them every request would end as "not found".
    pub known: HashMap<&'static str, Vec<Value>>,
    components: Value,
}

impl ValueGenerator {
    pub(super) fn new(spec: &Value, seed: u64) -> Self {
        let components = json!({"components": spec["components"]});
        Self { random: fastrand::Rng::with_seed(seed), known: HashMap::new(), components }
    }

    pub(super) fn one_in(&mut self, n: u32) -> bool {
        self.random.u32(0..n) == 0
    }

    /// A value for a field or parameter of this name.
    pub(super) fn value_of(&mut self, name: &str, schema: &Value) -> Value {
        match self.known.get(name) {
            Some(known) if self.random.u32(0..8) > 0 => {
                self.random.choice(known).cloned().unwrap_or_default()
            }
            _ => self.value(schema, 0),
        }
    }

    /// A value that the schema allows.
    pub(super) fn value(&mut self, schema: &Value, depth: u32) -> Value {
        if let Some(reference) = schema["$ref"].as_str() {
            let target = self.components.pointer(reference.trim_start_matches('#')).cloned();
            return self.value(&target.unwrap_or_default(), depth);
        }
        let choices =
            ["enum", "oneOf", "anyOf"].into_iter().find_map(|one| Some((one, schema[one].as_array()?)));
        if let Some((one, choices)) = choices {
            let choice = self.random.choice(choices).cloned().unwrap_or_default();
            return if one == "enum" { choice } else { self.value(&choice, depth) };
        }
        let kind = match &schema["type"] {
            Value::Array(kinds) => self.random.choice(kinds).cloned().unwrap_or_default(),
            kind => kind.clone(),
        };
        match kind.as_str() {
            Some("object") if depth < DEEPEST => self.object(schema, depth),
            Some("array") if depth < DEEPEST => {
                let longest = if self.one_in(4) { 5 } else { 2 };
                (0..self.random.u32(0..longest)).map(|_| self.value(&schema["items"], depth + 1)).collect()
            }
            Some("string") => self.text(schema),
            Some("integer") => json!(schema["minimum"].as_u64().unwrap_or_default() + self.random.u64(0..5)),
            Some("number") => json!(f64::from(self.random.u32(0..50)) / 10.0),
            Some("boolean") => json!(self.random.bool()),
            Some("null") => Value::Null,
            _ => self.arbitrary(),
        }
    }

    fn object(&mut self, schema: &Value, depth: u32) -> Value {
        let mut object = Map::new();
        let required = schema["required"].as_array().cloned().unwrap_or_default();
        for (name, schema) in schema["properties"].as_object().into_iter().flatten() {
            if required.iter().any(|required| required == name) || self.one_in(2) {
                let value = match self.known.contains_key(name.as_str()) {
                    true => self.value_of(name, schema),
                    false => self.value(schema, depth + 1),
                };
                object.insert(name.clone(), value);
            }
        }
        if schema["additionalProperties"].is_object() && self.one_in(3) {
            let name = self.text(&Value::Null).as_str().unwrap_or_default().to_owned();
            object.insert(name, self.value(&schema["additionalProperties"], depth + 1));
        }
        Value::Object(object)
    }

    fn text(&mut self, schema: &Value) -> Value {
        if schema["format"] == "uuid" {
            return json!(uuid::Builder::from_random_bytes(self.random.u128(..).to_be_bytes()).into_uuid());
        }
        let texts = ["a", "line=north", "/seed", "cpu", "Füllung 1", "0", "%", "../x", "x y&z=1"];
        json!(self.random.choice(texts))
    }

    /// An arbitrary value.
    pub(super) fn arbitrary(&mut self) -> Value {
        let odd = [
            json!(null),
            json!(true),
            json!(-1),
            json!(0),
            json!(0.5),
            json!(1e308),
            json!(u64::MAX),
            json!(i64::MIN),
            json!(""),
            json!("NaN"),
            json!("\u{0}"),
            json!("x".repeat(5000)),
            json!([]),
            json!([[]]),
            json!({}),
            json!({"": {"/": 1}}),
        ];
        self.random.choice(odd).unwrap_or_default()
    }

    /// Removes, adds or replaces something somewhere in the value.
    pub(super) fn change(&mut self, value: &mut Value) {
        let further = !self.one_in(3);
        match value {
            Value::Object(fields) if further && !fields.is_empty() => {
                let at = self.random.usize(0..fields.len());
                let name = fields.keys().nth(at).cloned().unwrap_or_default();
                match self.random.u32(0..5) {
                    0 => drop(fields.remove(&name)),
                    1 => drop(fields.insert("unknown".to_owned(), json!(1))),
                    _ => self.change(&mut fields[&name]),
                }
            }
            Value::Array(items) if further && !items.is_empty() => {
                let at = self.random.usize(0..items.len());
                self.change(&mut items[at]);
            }
            _ => *value = self.arbitrary(),
        }
    }
}
